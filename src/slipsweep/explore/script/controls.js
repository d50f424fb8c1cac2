// Sliders, lists and buttons, and what follows from them.

import { isChosenSeen, zoomBy } from "./axes.js";
import { X, Y, coordinate, dims, meta } from "./data.js";
import { element, newElement } from "./elements.js";
import { figures, showScale } from "./figures.js";
import { hasHistories, nearestWithHistory, showHistory } from "./histories.js";
import { drawMap } from "./map.js";
import { readoutRows, showReadout } from "./readout.js";
import { chosen, isShown, setChosen, setLayer } from "./selection.js";
import { parameterText } from "./words.js";

// Functions that show the position of a control anew.
const updates = [];

let speech;

// Have a screen reader speak, once the controls rest.
function speak(text) {
  clearTimeout(speech);
  speech = setTimeout(() => {
    element("spoken").textContent = text;
  }, 400);
}

// Show the chosen cell everywhere; it may stand for one that was clicked and has no history.
export function showChosen(clicked = null) {
  updates.forEach((update) => update());
  const x = coordinate(meta.map.x, chosen);
  const y = coordinate(meta.map.y, chosen);
  figures.chosen.data = { x: [x], y: [y] };
  const note = hasHistories() ? showHistory(clicked) : "";
  showReadout(chosen, "Chosen cell");
  const values = readoutRows(chosen).map(([name, text]) => `${name}: ${text}`);
  speak(`${values.join(". ")}. ${note}`);
}

function zoom(factor) {
  zoomBy(factor);
  drawMap();
}

// Keep the chosen cell in what is seen.
function follow() {
  if (!isChosenSeen()) zoom(1);
}

// Row of a label and a list or slider.
function controlRow(text, id, input) {
  const row = newElement("div");
  input.id = id;
  row.append(newElement("label", { textContent: text, htmlFor: id }), input);
  return row;
}

function selectOf(texts) {
  const select = newElement("select");
  texts.forEach((text, k) => select.append(new Option(text, k)));
  return select;
}

function sliderOf(length) {
  const slider = newElement("input");
  return Object.assign(slider, { type: "range", min: 0, max: length - 1, step: 1 });
}

function moveTo(i, place) {
  chosen[i] = place;
  if (i === X || i === Y) follow();
  else drawMap();
  showChosen();
}

// Control of the dimension at position i: a list if its values have names, else a slider.
function dimensionControl(i) {
  const dim = dims[i];
  const isList = dim.labels.length > 0 && i !== X;
  const input = isList ? selectOf(dim.labels) : sliderOf(dim.values.length);
  const row = controlRow(dim.title, "slider-" + dim.name, input);
  const output = newElement("output");
  output.htmlFor = input.id;
  output.setAttribute("aria-live", "off"); // the status tells it, with the values
  row.append(output);
  input.disabled = dim.values.length === 1;
  input.addEventListener("input", () => moveTo(i, Number(input.value)));
  updates.push(() => {
    const text = parameterText(dim.name, dim.values[chosen[i]]);
    input.value = chosen[i];
    row.hidden = !isShown(dim.name);
    if (isList) return;
    output.textContent = text;
    input.setAttribute("aria-valuetext", text.replace("m/s²", "metres per second squared"));
  });
  return row;
}

// List of the results that can colour the map.
function layerControl(layers) {
  const select = selectOf(layers.map((result) => result.short));
  select.addEventListener("change", () => {
    setLayer(layers[Number(select.value)]);
    showScale();
    drawMap();
    showChosen();
  });
  return controlRow("colours of the map", "layer", select);
}

function goToNearest() {
  setChosen(nearestWithHistory(chosen));
  follow();
  showChosen();
  element("slider-" + meta.map.y).focus(); // the button is gone
}

export function addControls() {
  const host = element("controls");
  const layers = meta.layers.filter((result) => result.short);
  if (layers.length > 1) host.append(layerControl(layers));
  const others = [...dims.keys()].filter((i) => i !== X && i !== Y);
  for (const i of [...others, Y, X]) host.append(dimensionControl(i));
  element("nearest").addEventListener("click", goToNearest);
  element("zoom-in").addEventListener("click", () => zoom(0.5));
  element("zoom-out").addEventListener("click", () => zoom(2));
  element("zoom-whole").addEventListener("click", () => zoom(Infinity));
}
