// The axes of the map: the edges of cells, and the part that is seen. Numbers are those of the
// scale, thus powers of ten along a logarithmic axis.

import { X, Y, dims } from "./data.js";
import { cellAt, chosen } from "./selection.js";

// Edges of the cells along an axis, half way between values.
function edgesOf(dim) {
  const values = dim.log ? dim.values.map(Math.log10) : dim.values;
  const last = values.length - 1;
  const edges = [values[0] - (values[1] - values[0]) / 2];
  for (let i = 1; i <= last; i++) edges.push((values[i - 1] + values[i]) / 2);
  edges.push(values[last] + (values[last] - values[last - 1]) / 2);
  return edges;
}

const cellEdges = { [X]: edgesOf(dims[X]), [Y]: edgesOf(dims[Y]) };

function wholeRange(axis) {
  const edges = cellEdges[axis];
  return [edges[0], edges[edges.length - 1]];
}

const seenRanges = { [X]: wholeRange(X), [Y]: wholeRange(Y) };

// Range of the axis that is seen, in the units of the axis.
export function seenRange(axis) {
  return seenRanges[axis].map((end) => (dims[axis].log ? 10 ** end : end));
}

// Position along an axis of the cell that holds a point, or -1.
function cellOf(axis, point) {
  const edges = cellEdges[axis];
  let low = 0;
  let high = edges.length - 1;
  if (!(point >= edges[low] && point <= edges[high])) return -1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (point >= edges[middle]) low = middle;
    else high = middle;
  }
  return low;
}

// Position of the cell at a share of the seen axis, or -1 outside it.
export function cellAtShare(axis, share) {
  if (share < 0 || share > 1) return -1;
  const [from, to] = seenRanges[axis];
  return cellOf(axis, from + share * (to - from));
}

// Positions of the cells in which the middles of pixels lie.
export function cellsOfPixels(axis, pixels) {
  const [from, to] = seenRanges[axis];
  return Int32Array.from({ length: pixels }, (_, i) =>
    cellOf(axis, from + ((i + 0.5) * (to - from)) / pixels),
  );
}

// Middle of a cell, as a share of the whole axis.
function middleShare(axis, cell) {
  const edges = cellEdges[axis];
  const [low, high] = wholeRange(axis);
  return (edges[cell] + edges[cell + 1]) / 2 / (high - low);
}

// Index of the nearest cell of the map that fits, or null.
export function nearestCell(index, fits) {
  let nearest = null;
  let least = Infinity;
  for (let j = 0; j < dims[Y].values.length; j++) {
    for (let i = 0; i < dims[X].values.length; i++) {
      const distance = Math.hypot(
        middleShare(X, i) - middleShare(X, index[X]),
        middleShare(Y, j) - middleShare(Y, index[Y]),
      );
      if (distance < least && fits(cellAt(i, j))) {
        nearest = cellAt(i, j);
        least = distance;
      }
    }
  }
  return nearest;
}

// See a part of the map about the chosen cell, larger by a factor than now; Infinity: all of it.
export function zoomBy(factor) {
  for (const axis of [X, Y]) {
    const edges = cellEdges[axis];
    const [low, high] = wholeRange(axis);
    const [from, to] = seenRanges[axis];
    const size = Math.min((to - from) * factor, high - low);
    const middle = (edges[chosen[axis]] + edges[chosen[axis] + 1]) / 2;
    const start = Math.min(Math.max(middle - size / 2, low), high - size);
    seenRanges[axis] = [start, start + size];
  }
}

export function isChosenSeen() {
  return [X, Y].every((axis) => {
    const edges = cellEdges[axis];
    const [from, to] = seenRanges[axis];
    return edges[chosen[axis]] >= from && edges[chosen[axis] + 1] <= to;
  });
}
