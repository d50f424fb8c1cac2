// The chosen cell, and the result that colours the map.

import { X, Y, arrays, dims, isStatistic, meta, position } from "./data.js";

export let layer = meta.layers[0];

export function setLayer(newLayer) {
  layer = newLayer;
}

function isAcrossOrUp(i) {
  return i === X || i === Y;
}

// Index of the chosen cell along every dimension, which is what the controls say.
export const chosen = dims.map((dim, i) => {
  const last = dim.values.length - (isAcrossOrUp(i) ? 0 : 1);
  return Math.floor(last / 2);
});

export function setChosen(index) {
  chosen.splice(0, chosen.length, ...index);
}

// Index of the cell of the map in column i and row j.
export function cellAt(i, j) {
  const index = chosen.slice();
  index[X] = i;
  index[Y] = j;
  return index;
}

// True for a dimension that the map has, or that its colours depend on.
export function isShown(dim) {
  return isAcrossOrUp(position[dim]) || arrays[layer.name].dims.includes(dim);
}

// True for a result that has a single value in the chosen cell: no dimension of it is hidden.
export function isSingle(name) {
  if (!(name in arrays)) return false;
  return arrays[name].dims.every((dim) => isStatistic(dim) || isShown(dim));
}
