// Moves the numbers of an explore page: looks cells up, fills the figures that Bokeh draws, and
// scales time histories to a frequency.  No physics is computed here.
(function () {
  "use strict";
  const meta = JSON.parse(document.getElementById("meta").textContent);
  const types = { f4: Float32Array, i1: Int8Array, i2: Int16Array };
  const arrays = {};
  for (const [name, { dtype, shape }] of Object.entries(meta.arrays)) {
    const element = document.getElementById("array-" + name);
    const text = atob(element.textContent.trim());
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    arrays[name] = { values: new types[dtype](bytes.buffer), shape };
    element.remove(); // the text is not needed twice
  }
  const dims = meta.dims;
  const position = Object.fromEntries(dims.map((dim, i) => [dim.name, i]));
  const X = position[meta.map.x], Y = position[meta.map.y];
  // index along every dimension: the sliders' and the chosen cell's
  const chosen = dims.map((dim, i) => (i === X || i === Y ? Math.floor(dim.values.length / 2) : Math.floor((dim.values.length - 1) / 2)));

  // Where an index lies in an array that may have length 1 along a dimension.
  function offset(shape, index) {
    let at = 0;
    for (let i = 0; i < shape.length; i++) at = at * shape[i] + (shape[i] === 1 ? 0 : index[i]);
    return at;
  }
  function value(name, index) {
    const array = arrays[name];
    return array ? array.values[offset(array.shape, index)] : null;
  }
  function coordinate(name, index) {
    if (name in position) return dims[position[name]].values[index[position[name]]];
    const coord = meta.coords[name];
    return coord ? coord.values[offset(coord.shape, coord.dims.map((dim) => index[position[dim]]))] : null;
  }

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
  function pixelCells(edgesOf, pixels) {
    const first = edgesOf[0], step = (edgesOf[edgesOf.length - 1] - first) / pixels;
    return Int32Array.from({ length: pixels }, (_, i) => find(edgesOf, first + (i + 0.5) * step));
  }
  const width = meta.map.width, height = meta.map.height;
  const cellsX = pixelCells(edgesX, width), cellsY = pixelCells(edgesY, height);

  // ------------------------------------------------------------------ marks over the colours
  function rgba(r, g, b, a) { return ((a << 24) | (b << 16) | (g << 8) | r) >>> 0; }
  const CLEAR = 0, LINE = rgba(0, 0, 0, 255), HATCH = rgba(0, 0, 0, 150);
  const STUCK = rgba(238, 238, 238, 255), MISSING = rgba(255, 255, 255, 255), CROSS = rgba(150, 150, 150, 255);
  const UPSLOPE = rgba(204, 121, 167, 255);
  const KINDS = {
    stuck: "stuck: no displacement",
    missing: "no value (see flags)",
    flagged: "caution (see flags)",
    upslope: "upslope (negative)",
    boundary: "limit of a sliding mode",
  };
  function kind(index) {
    const u = value("permanent_displacement", index);
    if (Number.isNaN(u)) return "missing";
    if (u === 0) return "stuck";
    if (u < 0) return "upslope";
    return value("validity", index) & meta.cautions ? "flagged" : "plain";
  }
  function mark(what, i, j) { // the colour of pixel (i, j)
    if (what === "stuck") return STUCK;
    if (what === "upslope") return UPSLOPE;
    if (what === "missing") return (i + j) % 10 === 0 || (i - j + 100000) % 10 === 0 ? CROSS : MISSING;
    if (what === "flagged") return (i + j) % 9 === 0 ? HATCH : CLEAR;
    if (what === "boundary") return Math.abs(j - 8) < 1 ? LINE : CLEAR;
    return CLEAR;
  }

  let model, figures;
  function draw() {
    const nx = dims[X].values.length, ny = dims[Y].values.length, index = chosen.slice();
    const mm = new Float32Array(nx * ny), kinds = new Array(nx * ny), modes = new Int8Array(nx * ny);
    for (let j = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++) {
        index[X] = i; index[Y] = j;
        const u = value("permanent_displacement", index) * 1000;
        mm[j * nx + i] = u > 0 ? u : NaN;
        kinds[j * nx + i] = kind(index);
        modes[j * nx + i] = arrays.sliding_mode ? value("sliding_mode", index) : 0;
      }
    }
    const NumberArray = figures.colours.data.image[0].constructor, MarkArray = figures.marks.data.image[0].constructor;
    const image = new NumberArray(width * height, [height, width]);
    const overlay = new MarkArray(width * height, [height, width]);
    for (let j = 0; j < height; j++) {
      const row = cellsY[j] * nx, below = cellsY[Math.max(j - 1, 0)] * nx;
      for (let i = 0; i < width; i++) {
        const cell = row + cellsX[i], left = row + cellsX[Math.max(i - 1, 0)], under = below + cellsX[i];
        image[j * width + i] = mm[cell];
        overlay[j * width + i] =
          modes[cell] !== modes[left] || modes[cell] !== modes[under] ? LINE : mark(kinds[cell], i, j);
      }
    }
    const raised = (dim, at) => (dim.log ? 10 ** at : at);
    const x = raised(dims[X], edgesX[0]), y = raised(dims[Y], edgesY[0]);
    const dw = raised(dims[X], edgesX[nx]) - x, dh = raised(dims[Y], edgesY[ny]) - y;
    const place = { x: [x], y: [y], dw: [dw], dh: [dh] };
    figures.colours.data = { image: [image], ...place };
    figures.marks.data = { image: [overlay], ...place };
    legend(new Set(kinds), new Set(modes).size > 1);
    return { x, y, dw, dh };
  }

  function legend(kinds, boundaries) {
    const host = document.getElementById("legend");
    host.replaceChildren();
    for (const [name, text] of Object.entries(KINDS)) {
      if (name === "boundary" ? !boundaries : !kinds.has(name)) continue;
      const item = document.createElement("span"), canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [30, 16];
      const context = canvas.getContext("2d"), pixels = context.createImageData(30, 16);
      const words = new Uint32Array(pixels.data.buffer);
      for (let j = 0; j < 16; j++) for (let i = 0; i < 30; i++) words[j * 30 + i] = mark(name, i, j) || (name === "flagged" ? rgba(104, 190, 194, 255) : MISSING);
      context.putImageData(pixels, 0, 0);
      item.append(canvas, text);
      host.append(item);
    }
  }

  // ------------------------------------------------------------------------------- readout
  function digits(x) { return String(Number(x.toPrecision(5))); }
  function withUnit(name, x) {
    const unit = meta.units[name], space = unit === "" || unit === "°" ? "" : "\u00a0";
    return digits(x) + space + (unit || "");
  }
  function described(names, index) {
    return names.map((name) => `${meta.symbols[name] || name} = ${withUnit(name, coordinate(name, index))}`).join(", ");
  }
  function displacementText(u) { return Number.isNaN(u) ? "no value" : `${(u * 1000).toPrecision(4)} mm`; }
  function flagsOf(index) {
    const validity = value("validity", index);
    return validity === null ? null : meta.flags.filter((flag) => validity & flag.mask);
  }
  function readout(index, pointed) {
    const amplitude = coordinate("amplitude", index), mode = value("sliding_mode", index), flags = flagsOf(index);
    const rows = [];
    for (const i of [Y, X]) rows.push([dims[i].title.replace(/ \(.*\)$/, ""), withUnit(dims[i].name, coordinate(dims[i].name, index)), dims[i].name]);
    if (meta.map.y === "amplitude") rows[0][1] += ` (${(amplitude / meta.g).toPrecision(4)} g)`;
    else if (amplitude !== null) rows.splice(1, 0, ["peak ground acceleration", `${withUnit("amplitude", amplitude)} (${(amplitude / meta.g).toPrecision(4)} g)`, "amplitude"]);
    rows.push(["permanent displacement", displacementText(value("permanent_displacement", index)), "displacement"]);
    rows.push(["sliding mode", mode === null ? "not in the file" : meta.modes[mode], "mode"]);
    rows.push(["flags", flags === null ? "not in the file" : flags.map((f) => `${f.kind} ${f.name}: ${f.text}`).join("; ") || "none", "flags"]);
    const host = document.getElementById("readout");
    host.replaceChildren();
    for (const [title, text, id] of rows) {
      const dt = document.createElement("dt"), dd = document.createElement("dd");
      dt.textContent = title; dd.textContent = text; dd.className = id; dd.id = "readout-" + id;
      host.append(dt, dd);
    }
    host.dataset.index = JSON.stringify(index);
    document.getElementById("readout-title").textContent = pointed ? "Cell under the pointer" : "Chosen cell";
  }

  // ------------------------------------------------------------------------------ histories
  function nearest(kept, dim, index) { // position in `kept` of the value nearest to that of `index`
    const at = scaled(dim, dim.values[index]);
    let best = 0;
    kept.forEach((k, i) => {
      if (Math.abs(scaled(dim, dim.values[k]) - at) < Math.abs(scaled(dim, dim.values[kept[best]]) - at)) best = i;
    });
    return best;
  }
  function history() {
    const note = document.getElementById("history-note"), store = meta.histories;
    if (!store) { note.textContent = "This page holds no time histories; see the notes below."; return; }
    const index = chosen.slice();
    let cell = 0;
    for (const [name, kept] of Object.entries(store.keep)) {
      const at = nearest(kept, dims[position[name]], chosen[position[name]]);
      index[position[name]] = kept[at];
      cell = cell * kept.length + at;
    }
    const omega = 2 * Math.PI * coordinate("frequency", chosen), amplitude = coordinate("amplitude", index);
    const n = store.phase.length, scale = arrays.history_scale.values.subarray(3 * cell, 3 * cell + 3);
    const row = (quantity, factor) => {
      const start = (3 * cell + quantity) * n;
      return Array.from(arrays.histories.values.subarray(start, start + n), (x) => x * scale[quantity] * factor);
    };
    const same = Object.keys(store.keep).every((name) => index[position[name]] === chosen[position[name]]);
    const which = same ? "of this cell" : `of the nearest cell that has one in the page: ${described(Object.keys(store.keep), index)}`;
    const empty = Number.isNaN(scale[2]);
    // exact: time enters the motion through the phase ωt only
    figures.history.data = empty
      ? { t: [], ground: [], block: [], v: [], u: [] }
      : { t: store.phase.map((phase) => phase / omega), ground: store.ground.map((w) => w * amplitude), block: row(0, 1), v: row(1, 1 / omega), u: row(2, 1000 / omega ** 2) };
    note.textContent = `${described([meta.map.y, meta.map.x], chosen)}. ` +
      (empty ? `No history: the model gives no value (${(flagsOf(index) || []).filter((f) => f.mask & meta.valueless).map((f) => f.name).join(", ") || "see flags"}).`
        : `First ${store.cycles} of ${store.of} cycles, ${which}.`);
    note.dataset.index = JSON.stringify(index);
  }

  function choose() {
    figures.chosen.data = { x: [coordinate(meta.map.x, chosen)], y: [coordinate(meta.map.y, chosen)] };
    history();
    readout(chosen, false);
  }
  function pointed(x, y) {
    const i = find(edgesX, scaled(dims[X], x)), j = find(edgesY, scaled(dims[Y], y));
    if (i < 0 || j < 0) return null;
    const index = chosen.slice();
    index[X] = i; index[Y] = j;
    return index;
  }

  function sliders() {
    const host = document.getElementById("sliders");
    dims.forEach((dim, i) => {
      if (i === X || i === Y) return;
      const label = document.createElement("label"), input = document.createElement("input"), output = document.createElement("output");
      label.textContent = dim.title; label.htmlFor = input.id = "slider-" + dim.name;
      Object.assign(input, { type: "range", min: 0, max: dim.values.length - 1, step: 1, value: chosen[i], disabled: dim.values.length === 1 });
      const show = () => { output.textContent = dim.labels.length ? dim.labels[chosen[i]] : withUnit(dim.name, dim.values[chosen[i]]); };
      input.addEventListener("input", () => { chosen[i] = Number(input.value); show(); draw(); choose(); });
      show();
      host.append(label, input, output);
    });
  }

  function start() {
    // Bokeh builds its figures after the page has loaded
    model = window.Bokeh.documents[0];
    const names = ["colours", "marks", "chosen", "history", "x_range", "y_range"];
    if (!model || names.some((name) => !model.get_model_by_name(name))) { setTimeout(start, 20); return; }
    figures = Object.fromEntries(names.map((name) => [name, model.get_model_by_name(name)]));
    sliders();
    const { x, y, dw, dh } = draw();
    for (const [range, from, by] of [[figures.x_range, x, dw], [figures.y_range, y, dh]]) {
      range.setv({ start: from, end: from + by, reset_start: from, reset_end: from + by });
    }
    choose();
    window.slipsweep = {
      point(px, py) { const index = pointed(px, py); if (index) readout(index, true); },
      leave() { readout(chosen, false); },
      choose(px, py) { const index = pointed(px, py); if (index) { chosen.splice(0, chosen.length, ...index); choose(); } },
    };
    document.body.dataset.ready = "true";
  }
  start();
})();
