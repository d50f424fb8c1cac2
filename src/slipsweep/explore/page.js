// Moves the numbers of an explore page: looks cells up, fills the figures that Bokeh draws, and
// scales displacements and time histories to a frequency.  No physics is computed here.
(async function () {
  "use strict";
  const element = (id) => document.getElementById(id);
  const meta = JSON.parse(element("meta").textContent);
  const types = { f8: Float64Array, f4: Float32Array, i1: Int8Array, i2: Int16Array };
  const arrays = {};
  for (const [name, { data, ...about }] of Object.entries(meta.arrays)) {
    const packed = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    arrays[name] = { ...about, values: new types[about.dtype](await new Response(stream).arrayBuffer()) };
  }
  element("meta").remove(); // the text is not needed twice
  const dims = meta.dims;
  const position = Object.fromEntries(dims.map((dim, i) => [dim.name, i]));
  const X = position[meta.map.x], Y = position[meta.map.y];
  const known = { ...meta.coords, ...Object.fromEntries(dims.map((dim) => [dim.name, dim])) };
  let layer = meta.layers[0];
  // index along every dimension: what the controls say
  const chosen = dims.map((dim, i) => Math.floor((dim.values.length - (i === X || i === Y ? 0 : 1)) / 2));

  // Where an index lies in an array that may have length 1 along a dimension.
  function offset(shape, index) {
    let at = 0;
    for (let i = 0; i < shape.length; i++) at = at * shape[i] + (shape[i] === 1 ? 0 : index[i]);
    return at;
  }
  function value(name, index) {
    const array = arrays[name];
    if (!array) return null;
    const found = array.values[offset(array.shape, index)], law = array.law;
    return law ? found * coordinate(law.dim, index) ** law.power : found;
  }
  function coordinate(name, index) {
    if (name in position) return dims[position[name]].values[index[position[name]]];
    const coord = arrays["coordinate_" + name];
    return coord ? coord.values[offset(coord.shape, coord.dims.map((dim) => index[position[dim]]))] : null;
  }
  // Whether a result has one value for what is chosen: no dimension of it is hidden.
  const isShown = (dim) => position[dim] === X || position[dim] === Y || arrays[layer.name].dims.includes(dim);
  const own = (dim) => dim === "quantile" || dim === "threshold";
  const isKnown = (name) => name in arrays && arrays[name].dims.every((dim) => own(dim) || isShown(dim));

  // Edges of the cells along an axis, half way between values, in the scale of the axis.
  function scaled(dim, x) { return dim.log ? Math.log10(x) : x; }
  function edges(dim) {
    const at = dim.values.map((x) => scaled(dim, x));
    const n = at.length, found = [at[0] - (at[1] - at[0]) / 2];
    for (let i = 1; i < n; i++) found.push((at[i - 1] + at[i]) / 2);
    found.push(at[n - 1] + (at[n - 1] - at[n - 2]) / 2);
    return found;
  }
  const edgesX = edges(dims[X]), edgesY = edges(dims[Y]);
  function find(edgesOf, at) { // the cell that holds a point, or -1
    let low = 0, high = edgesOf.length - 1;
    if (!(at >= edgesOf[low] && at <= edgesOf[high])) return -1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (at >= edgesOf[middle]) low = middle; else high = middle;
    }
    return low;
  }
  // The part of an axis that is seen, and the cells in its pixels.
  const ends = (edgesOf) => [edgesOf[0], edgesOf[edgesOf.length - 1]];
  const seen = { [X]: ends(edgesX), [Y]: ends(edgesY) };
  function pixelCells(edgesOf, [from, to], pixels) {
    return Int32Array.from({ length: pixels }, (_, i) => find(edgesOf, from + ((i + 0.5) * (to - from)) / pixels));
  }
  function cellAt(i, j) {
    const index = chosen.slice();
    index[X] = i; index[Y] = j;
    return index;
  }

  // ----------------------------------------------------------------------------- in words
  const digits = (x) => String(Number(x.toPrecision(5)));
  function withUnit(name, x) {
    const { unit, acceleration, labels } = known[name];
    if (labels && labels.length) return labels[Math.round(x) - 1];
    if (name === "threshold") return lengthText(x);
    if (name === "quantile" && x === 0.5) return "0.5 (median)";
    const text = digits(x) + (unit === "" || unit === "°" ? "" : "\u00a0") + unit;
    return acceleration ? `${text} (${Number((x / meta.g).toPrecision(4))}\u00a0g)` : text;
  }
  function described(names, index) {
    return names.map((name) => `${known[name].symbol} = ${withUnit(name, coordinate(name, index))}`).join(", ");
  }
  function lengthText(u) {
    if (Number.isNaN(u)) return "no value";
    return Math.abs(u) < 10 ? `${digits(Number((u * 1000).toPrecision(4)))}\u00a0mm` : `${digits(Number(u.toPrecision(4)))}\u00a0m`;
  }
  function valueText(about, u) {
    return about.scale === "displacement" || Number.isNaN(u) ? lengthText(u) : `${Number((100 * u).toPrecision(4))}\u00a0%`;
  }
  function layerText(about, index) { // a statistic along all its quantiles or thresholds
    const i = arrays[about.name].dims.filter(own).map((dim) => position[dim])[0];
    if (i === undefined) return valueText(about, value(about.name, index));
    return dims[i].values.map((x, k) => {
      const at = index.slice();
      at[i] = k;
      return `${withUnit(dims[i].name, x)}: ${valueText(about, value(about.name, at))}`;
    }).join("; ");
  }

  // ------------------------------------------------------------------ marks over the colours
  function rgba(r, g, b, a) { return ((a << 24) | (b << 16) | (g << 8) | r) >>> 0; }
  const CLEAR = 0, LINE = rgba(0, 0, 0, 255), HATCH = rgba(0, 0, 0, 150);
  const WHITE = rgba(255, 255, 255, 255), GREY = rgba(140, 140, 140, 255), COLOUR = rgba(104, 190, 194, 255);
  const STUCK = rgba(238, 238, 238, 255), UPSLOPE = rgba(204, 121, 167, 255);
  const KINDS = {
    stuck: "no displacement",
    missing: "no value",
    flagged: "caution",
    upslope: "upslope (negative)",
    boundary: "limit of a sliding mode",
    held: "cell with a time history",
  };
  function kind(index) {
    const u = value(layer.name, index);
    if (Number.isNaN(u)) return "missing";
    if (layer.scale === "probability") return "plain";
    if (u === 0) return "stuck";
    if (u < 0) return "upslope";
    return layer.name === "permanent_displacement" && value("validity", index) & meta.cautions ? "flagged" : "plain";
  }
  function mark(what, i, j) { // the colour of pixel (i, j); told apart in grey too
    if (what === "stuck") return i % 8 === 0 && j % 8 === 0 ? GREY : STUCK;
    if (what === "upslope") return i % 6 === 0 ? HATCH : meta.signed ? CLEAR : UPSLOPE;
    if (what === "missing") return (i + j) % 10 === 0 || (i - j + 100000) % 10 === 0 ? GREY : WHITE;
    if (what === "flagged") return (i + j) % 9 === 0 ? HATCH : CLEAR;
    if (what === "boundary") return j === 8 ? LINE : WHITE;
    if (what === "held") {
      const far = Math.hypot(i - 15, j - 8);
      return far < 2.6 ? WHITE : far < 3.8 ? LINE : COLOUR;
    }
    return CLEAR;
  }

  let figures;
  const frameBox = () => window.Bokeh.index.find_one(figures.map).frame.bbox;
  function draw() {
    const nx = dims[X].values.length, ny = dims[Y].values.length;
    const shades = new Float32Array(nx * ny), kinds = new Array(nx * ny), modes = new Int8Array(nx * ny);
    const lined = layer.name === "permanent_displacement" && arrays.sliding_mode;
    const held = { x: [], y: [] };
    for (let j = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++) {
        const index = cellAt(i, j), at = j * nx + i, u = value(layer.name, index);
        shades[at] = layer.scale === "probability" ? u : u > 0 ? u * 1000 : u < 0 && meta.signed ? -u * 1000 : NaN;
        kinds[at] = kind(index);
        modes[at] = lined ? value("sliding_mode", index) : 0;
        if (place(index) >= 0) { held.x.push(dims[X].values[i]); held.y.push(dims[Y].values[j]); }
      }
    }
    const frame = frameBox(), width = Math.max(Math.round(frame.width), 1), height = Math.max(Math.round(frame.height), 1);
    const cellsX = pixelCells(edgesX, seen[X], width), cellsY = pixelCells(edgesY, seen[Y], height);
    const NumberArray = figures.colours.data.image[0].constructor, MarkArray = figures.marks.data.image[0].constructor;
    const image = new NumberArray(width * height, [height, width]);
    const overlay = new MarkArray(width * height, [height, width]);
    for (let j = 0; j < height; j++) {
      const row = cellsY[j] * nx, below = cellsY[Math.max(j - 1, 0)] * nx;
      for (let i = 0; i < width; i++) {
        const cell = row + cellsX[i], left = row + cellsX[Math.max(i - 1, 0)], under = below + cellsX[i];
        image[j * width + i] = shades[cell];
        overlay[j * width + i] =
          modes[cell] !== modes[left] || modes[cell] !== modes[under] ? LINE : mark(kinds[cell], i, j);
      }
    }
    const [[x, right], [y, top]] = [X, Y].map((i) => seen[i].map((at) => (dims[i].log ? 10 ** at : at)));
    const corner = { x: [x], y: [y], dw: [right - x], dh: [top - y] };
    figures.x_range.setv({ start: x, end: right });
    figures.y_range.setv({ start: y, end: top });
    if (figures.map_g) figures.map_g.setv({ start: y / meta.g, end: top / meta.g });
    figures.colours.data = { image: [image], ...corner };
    figures.marks.data = { image: [overlay], ...corner };
    figures.held.data = held;
    const found = new Set(kinds);
    if (new Set(modes).size > 1) found.add("boundary");
    if (held.x.length) found.add("held");
    legend(found);
    summarize(shades, kinds);
  }

  function legend(found) {
    const items = Object.entries(KINDS).filter(([name]) => found.has(name)).map(([name, text]) => {
      const item = document.createElement("li"), canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [30, 16];
      canvas.setAttribute("aria-hidden", "true");
      const context = canvas.getContext("2d"), pixels = context.createImageData(30, 16);
      const words = new Uint32Array(pixels.data.buffer);
      for (let j = 0; j < 16; j++) for (let i = 0; i < 30; i++) words[j * 30 + i] = mark(name, i, j) || COLOUR;
      context.putImageData(pixels, 0, 0);
      item.append(canvas, text);
      return item;
    });
    element("legend").replaceChildren(...items);
  }
  function summarize(shades, kinds) { // what a picture shows, for those who do not see it
    const extra = dims.filter((dim) => own(dim.name) && isShown(dim.name)).map((dim) => dim.name);
    element("map-title").textContent = layer.title + (extra.length ? ` (${described(extra, chosen)})` : "");
    const numbers = shades.filter((x) => !Number.isNaN(x)).sort(), ends = numbers.length ? [numbers[0], numbers[numbers.length - 1]] : [];
    const [low, high] = ends.map((x) => valueText(layer, layer.scale === "displacement" ? x / 1000 : x));
    const words = { stuck: "without displacement", missing: "without a value", flagged: "with a caution", upslope: "upslope" };
    const counted = Object.entries(words).map(([name, text]) => [kinds.filter((what) => what === name).length, text])
      .filter(([n]) => n > 0).map(([n, text]) => `, ${n} ${text}`).join("");
    element("map-summary").textContent =
      `${dims[Y].title} over ${dims[X].title}. ${kinds.length} cells${counted}` +
      (ends.length ? `; from ${low} to ${high}.` : ".");
  }

  // ------------------------------------------------------------------------------- readout
  function flagRows(index) {
    if (!isKnown("validity")) return arrays.validity || layer.name !== "permanent_displacement" ? [] : [["flags", "not in the file", "flags"]];
    const raised = meta.flags.filter((flag) => value("validity", index) & flag.mask);
    if (!raised.length) return [["flags", "none", "flags"]];
    return raised.map((flag) => [`${flag.kind}: ${meta.kinds[flag.kind]}`, `${flag.name}: ${flag.text}`, "flag"]);
  }
  function rows(index) {
    const found = [Y, X].map((i) => [dims[i].title.replace(/ \(.*\)$/, ""), withUnit(dims[i].name, coordinate(dims[i].name, index)), dims[i].name]);
    if ("amplitude" in meta.coords) found.splice(1, 0, [known.amplitude.title.replace(/ \(.*\)$/, ""), withUnit("amplitude", coordinate("amplitude", index)), "amplitude"]);
    for (const about of meta.layers) if (isKnown(about.name)) found.push([about.title, layerText(about, index), about.name]);
    if (isKnown("sliding_mode")) found.push(["sliding mode", meta.modes[value("sliding_mode", index)], "mode"]);
    return [...found, ...flagRows(index)];
  }
  function readout(index, title) {
    const host = element("readout");
    host.replaceChildren();
    for (const [name, text, id] of rows(index)) {
      const dt = document.createElement("dt"), dd = document.createElement("dd");
      dt.textContent = name; dd.textContent = text; dd.className = id;
      if (id !== "flag") dd.id = "readout-" + id;
      host.append(dt, dd);
    }
    host.dataset.index = JSON.stringify(index);
    element("readout-title").textContent = title;
  }
  let speaking;
  function speak(text) { // when the controls rest
    clearTimeout(speaking);
    speaking = setTimeout(() => { element("spoken").textContent = text; }, 400);
  }

  // ------------------------------------------------------------------------------ histories
  const store = meta.histories;
  function place(index) { // where the time history of a cell is, or -1
    if (!store) return -1;
    let cell = 0;
    for (const [name, kept] of Object.entries(store.keep)) {
      const at = kept.indexOf(index[position[name]]);
      if (at < 0) return -1;
      cell = cell * kept.length + at;
    }
    return Number.isNaN(arrays.history_scale.values[3 * cell]) ? -1 : cell;
  }
  function nearest(index, fits = (cell) => place(cell) >= 0) { // the cell that is nearest in the map, or null; with a time history
    const across = (edgesOf, k) => (edgesOf[k] + edgesOf[k + 1]) / 2 / (edgesOf[edgesOf.length - 1] - edgesOf[0]);
    let best = null, least = Infinity;
    for (let j = 0; j < dims[Y].values.length; j++) {
      for (let i = 0; i < dims[X].values.length; i++) {
        const far = Math.hypot(across(edgesX, i) - across(edgesX, index[X]), across(edgesY, j) - across(edgesY, index[Y]));
        if (far < least && fits(cellAt(i, j))) { best = cellAt(i, j); least = far; }
      }
    }
    return best;
  }
  function history(clicked) {
    const cell = place(chosen), note = element("history-note"), map = [meta.map.y, meta.map.x];
    const other = cell < 0 ? nearest(chosen) : null;
    element("nearest").hidden = !other;
    element("histories").hidden = cell < 0;
    note.dataset.index = cell < 0 ? "" : JSON.stringify(chosen);
    if (cell < 0) {
      const missing = Object.entries(store.keep).filter(([name, kept]) => !map.includes(name) && !kept.includes(chosen[position[name]]));
      const where = missing.map(([name, kept]) => `${known[name].symbol} = ${kept.map((k) => digits(dims[position[name]].values[k])).join(", ")}`);
      note.textContent = where.length ? `No cell of this map has a time history in the page. There are some at ${where.join("; ")}.`
        : other ? `This cell has no time history in the page. The nearest that has one: ${described(map, other)}.`
          : "No cell of this map has a time history.";
      return note.textContent;
    }
    const omega = 2 * Math.PI * coordinate("frequency", chosen), amplitude = coordinate("amplitude", chosen);
    const n = store.phase.length, scale = arrays.history_scale.values.subarray(3 * cell, 3 * cell + 3);
    const row = (quantity, factor) => {
      const start = (3 * cell + quantity) * n;
      return Array.from(arrays.histories.values.subarray(start, start + n), (x) => x * scale[quantity] * factor);
    };
    // exact: time enters the motion through the phase ωt only
    const data = {
      t: store.phase.map((phase) => phase / omega), ground: store.ground.map((w) => w * amplitude), block: row(0, 1),
      v: row(1, 1 / omega), u: row(2, 1000 / omega ** 2),
    };
    figures.history.data = data;
    const most = 1.05 * Math.max(...data.ground.map(Math.abs), ...data.block.map(Math.abs));
    figures.accelerations_range.setv({ start: -most, end: most });
    figures.accelerations_g.setv({ start: -most / meta.g, end: most / meta.g });
    const moved = clicked ? `The cell that was clicked (${described(map, clicked)}) has none; this is the nearest that has one. ` : "";
    note.textContent = `${moved}${described(map, chosen)}: the first ${store.cycles} of ${store.of} cycles.`;
    element("history-summary").textContent =
      `Acceleration of base and block, velocity and displacement of the block relative to the base. Largest velocity ${digits(Math.max(...data.v))} m/s; displacement at the end ${lengthText(data.u[n - 1] / 1000)}.`;
    return note.textContent;
  }

  // ----------------------------------------------------------------------------- controls
  const shows = []; // write a control's position anew
  function choose(clicked) {
    shows.forEach((show) => show());
    figures.chosen.data = { x: [coordinate(meta.map.x, chosen)], y: [coordinate(meta.map.y, chosen)] };
    const note = store ? history(clicked) : "";
    readout(chosen, "Chosen cell");
    speak(`${rows(chosen).map(([name, text]) => `${name}: ${text}`).join(". ")}. ${note}`);
  }
  function pointed(event) { // the cell under the pointer, or null
    const host = element("map").getBoundingClientRect(), { left, top, width, height } = frameBox();
    const x = (event.clientX - host.left - left) / width, y = 1 - (event.clientY - host.top - top) / height;
    const at = (i, share) => (share < 0 || share > 1 ? NaN : seen[i][0] + share * (seen[i][1] - seen[i][0]));
    const i = find(edgesX, at(X, x)), j = find(edgesY, at(Y, y));
    return i < 0 || j < 0 ? null : cellAt(i, j);
  }
  function click(event) { // to the nearest cell with a time history, if there are some in the map
    const cell = pointed(event);
    if (!cell) return;
    const going = (place(cell) < 0 && nearest(cell)) || cell;
    chosen.splice(0, chosen.length, ...going);
    choose(going === cell ? null : cell);
  }

  function zoom(by) { // about the chosen cell; 0: the whole map
    for (const [i, edgesOf] of [[X, edgesX], [Y, edgesY]]) {
      const [low, high] = ends(edgesOf), size = by ? Math.min((seen[i][1] - seen[i][0]) * by, high - low) : high - low;
      const middle = (edgesOf[chosen[i]] + edgesOf[chosen[i] + 1]) / 2;
      const from = Math.min(Math.max(middle - size / 2, low), high - size);
      seen[i] = [from, from + size];
    }
    draw();
  }
  function follow() { // keep the chosen cell in what is seen
    if ([[X, edgesX], [Y, edgesY]].some(([i, e]) => e[chosen[i]] < seen[i][0] || e[chosen[i] + 1] > seen[i][1])) zoom(1);
  }

  function control(dim, i) {
    const host = document.createElement("div"), label = document.createElement("label"), output = document.createElement("output");
    const input = document.createElement(dim.labels.length && i !== X ? "select" : "input");
    label.textContent = dim.title; label.htmlFor = input.id = "slider-" + dim.name;
    output.htmlFor = input.id;
    output.setAttribute("aria-live", "off"); // the status tells it, with the values
    if (input.tagName === "SELECT") dim.labels.forEach((text, k) => input.append(new Option(text, k)));
    else Object.assign(input, { type: "range", min: 0, max: dim.values.length - 1, step: 1 });
    input.disabled = dim.values.length === 1;
    shows.push(() => {
      const text = withUnit(dim.name, dim.values[chosen[i]]);
      input.value = chosen[i];
      host.hidden = !isShown(dim.name);
      output.textContent = input.tagName === "SELECT" ? "" : text;
      if (input.tagName === "INPUT") input.setAttribute("aria-valuetext", text.replace("m/s²", "metres per second squared"));
    });
    input.addEventListener("input", () => {
      chosen[i] = Number(input.value);
      if (i === X || i === Y) follow(); else draw();
      choose();
    });
    host.append(label, input, output);
    return host;
  }
  function controls() {
    const order = [...dims.keys()].filter((i) => i !== X && i !== Y), host = element("controls");
    const maps = meta.layers.filter((about) => about.short);
    if (maps.length > 1) {
      const row = document.createElement("div"), label = document.createElement("label"), select = document.createElement("select");
      label.textContent = "colours of the map"; label.htmlFor = select.id = "layer";
      maps.forEach((about, k) => select.append(new Option(about.short, k)));
      select.addEventListener("change", () => { layer = maps[Number(select.value)]; shade(); draw(); choose(); });
      row.append(label, select);
      host.append(row);
    }
    for (const i of [...order, Y, X]) host.append(control(dims[i], i));
    element("nearest").addEventListener("click", () => {
      chosen.splice(0, chosen.length, ...nearest(chosen));
      follow();
      choose();
      element("slider-" + meta.map.y).focus(); // the button is gone
    });
    for (const [name, by] of [["in", 0.5], ["out", 2], ["whole", 0]]) element("zoom-" + name).addEventListener("click", () => zoom(by));
    element("map").addEventListener("click", click);
    element("map").addEventListener("pointermove", (event) => {
      const index = event.pointerType === "touch" ? null : pointed(event);
      if (index) readout(index, "Cell under the pointer");
    });
    element("map").addEventListener("pointerleave", () => readout(chosen, "Chosen cell"));
  }
  function shade() {
    for (const scale of ["displacement", "probability"]) {
      for (const part of ["colours-", "bar-"]) if (figures[part + scale]) figures[part + scale].visible = scale === layer.scale;
    }
  }

  // A cell that slides, of which no flag says that its value is not to be relied on.
  const slides = (u) => u > 0 || (meta.signed && u < 0);
  const isSound = (index) => slides(value(layer.name, index)) && !(arrays.validity && value("validity", index) & meta.unsound);

  async function start() {
    element("history").hidden = !store;
    await window.Bokeh.embed.embed_item(meta.figures.map, "figure-map");
    await window.Bokeh.embed.embed_item(meta.figures.panels, "figure-panels");
    const documents = window.Bokeh.documents;
    while (!documents.every((one) => one.is_idle)) await new Promise((resolve) => { setTimeout(resolve, 20); });
    const names = [
      "map", "x_range", "y_range", "map_g", "colours", "marks", "held", "chosen", "history", "accelerations_range", "accelerations_g",
      ...["displacement", "probability"].flatMap((scale) => ["colours-" + scale, "bar-" + scale]),
    ];
    figures = Object.fromEntries(names.map((name) => [name, documents.map((one) => one.get_model_by_name(name)).find(Boolean)]));
    controls();
    shade();
    draw();
    const first = nearest(chosen, (cell) => isSound(cell) && (!store || place(cell) >= 0)) || nearest(chosen, isSound) || nearest(chosen);
    if (first) chosen.splice(0, chosen.length, ...first);
    choose();
    let resizing; // the pixels of the marks are those of the screen
    new ResizeObserver(() => { clearTimeout(resizing); resizing = setTimeout(draw, 200); }).observe(element("map"));
    document.body.dataset.ready = "true";
  }
  start();
})();
