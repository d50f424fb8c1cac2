// The result in the page: its dimensions, and its arrays, unpacked. No physics is computed here:
// values follow from others by the powers that the page states with them.

import { element } from "./elements.js";

const ARRAY_TYPES = { f8: Float64Array, f4: Float32Array, i1: Int8Array, i2: Int16Array };

async function unpack({ data, ...description }) {
  const deflated = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = await new Response(stream).arrayBuffer();
  return { ...description, values: new ARRAY_TYPES[description.dtype](bytes) };
}

async function unpackAll(packedArrays) {
  const unpacked = {};
  for (const [name, packed] of Object.entries(packedArrays)) unpacked[name] = await unpack(packed);
  return unpacked;
}

export const meta = JSON.parse(element("meta").textContent);
export const arrays = await unpackAll(meta.arrays);
element("meta").remove(); // the text is not needed twice

export const dims = meta.dims;
export const position = Object.fromEntries(dims.map((dim, i) => [dim.name, i]));

// Positions of the dimensions across and up the map.
export const X = position[meta.map.x];
export const Y = position[meta.map.y];

// Symbol, unit and title of each dimension and coordinate.
export const descriptions = {
  ...meta.coords,
  ...Object.fromEntries(dims.map((dim) => [dim.name, dim])),
};

// Offset of a cell in an array, which has length 1 along dimensions that it does not depend on.
function offset(shape, index) {
  let sum = 0;
  for (let i = 0; i < shape.length; i++) {
    sum = sum * shape[i] + (shape[i] === 1 ? 0 : index[i]);
  }
  return sum;
}

// Value of a result in a cell, or null if the page does not have the result.
export function value(name, index) {
  const array = arrays[name];
  if (!array) return null;
  const stored = array.values[offset(array.shape, index)];
  return array.law ? stored * coordinate(array.law.dim, index) ** array.law.power : stored;
}

// Value of a parameter in a cell, or null if the page does not have the parameter.
export function coordinate(name, index) {
  if (name in position) return dims[position[name]].values[index[position[name]]];
  const array = arrays["coordinate_" + name];
  if (!array) return null;
  const positions = array.dims.map((dim) => index[position[dim]]);
  return array.values[offset(array.shape, positions)];
}

// True for a dimension along which statistics lie, and nothing else.
export function isStatistic(dim) {
  return dim === "quantile" || dim === "threshold";
}
