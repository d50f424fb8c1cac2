// The readout: parameters, results and flags of a cell.

import { X, Y, arrays, coordinate, descriptions, dims, meta, value } from "./data.js";
import { element, newElement } from "./elements.js";
import { isSingle, layer } from "./selection.js";
import { cellText, parameterText } from "./words.js";

function flagRows(index) {
  if (!isSingle("validity")) {
    if (arrays.validity || layer.name !== "permanent_displacement") return [];
    return [["flags", "not in the file", "flags"]];
  }
  const validity = value("validity", index);
  const raised = meta.flags.filter((flag) => validity & flag.mask);
  if (!raised.length) return [["flags", "none", "flags"]];
  return raised.map((flag) => [
    `${flag.kind}: ${meta.kinds[flag.kind]}`,
    `${flag.name}: ${flag.text}`,
    "flag",
  ]);
}

function parameterRow(name, index) {
  const title = descriptions[name].title.replace(/ \(.*\)$/, "");
  return [title, parameterText(name, coordinate(name, index)), name];
}

function parameterRows(index) {
  const up = parameterRow(dims[Y].name, index);
  const across = parameterRow(dims[X].name, index);
  if (!("amplitude" in meta.coords)) return [up, across];
  return [up, parameterRow("amplitude", index), across];
}

// Rows of the readout of a cell: name, text, and the end of the identifier of the element.
export function readoutRows(index) {
  const results = meta.layers
    .filter((result) => isSingle(result.name))
    .map((result) => [result.title, cellText(result, index), result.name]);
  const mode = isSingle("sliding_mode")
    ? [["sliding mode", meta.modes[value("sliding_mode", index)], "mode"]]
    : [];
  return [...parameterRows(index), ...results, ...mode, ...flagRows(index)];
}

export function showReadout(index, title) {
  const host = element("readout");
  host.replaceChildren();
  for (const [name, text, id] of readoutRows(index)) {
    const term = newElement("dt", { textContent: name });
    const description = newElement("dd", { textContent: text, className: id });
    if (id !== "flag") description.id = "readout-" + id;
    host.append(term, description);
  }
  host.dataset.index = JSON.stringify(index);
  element("readout-title").textContent = title;
}
