// Marks over the colours of the map, which can be told apart in grey too.

import { meta, value } from "./data.js";
import { layer } from "./selection.js";

function rgba(red, green, blue, alpha) {
  return ((alpha << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

const CLEAR = 0;
const HATCH = rgba(0, 0, 0, 150);
const WHITE = rgba(255, 255, 255, 255);
const GREY = rgba(140, 140, 140, 255);
const LIGHT_GREY = rgba(238, 238, 238, 255);
const PINK = rgba(204, 121, 167, 255);

export const BLACK = rgba(0, 0, 0, 255);

// Behind the marks in the legend: a colour of the map.
export const SAMPLE_COLOUR = rgba(104, 190, 194, 255);

// What a cell can be, in the order of the legend, in its words and in those of the summary.
export const CELL_KINDS = {
  stuck: { legend: "no displacement", summary: "without displacement" },
  missing: { legend: "no value", summary: "without a value" },
  flagged: { legend: "caution", summary: "with a caution" },
  upslope: { legend: "upslope (negative)", summary: "upslope" },
};

// What the legend shows.
export const LEGEND = {
  ...Object.fromEntries(Object.entries(CELL_KINDS).map(([kind, { legend }]) => [kind, legend])),
  boundary: "limit of a sliding mode",
  history: "cell with a time history",
};

export function kindOf(index) {
  const number = value(layer.name, index);
  if (Number.isNaN(number)) return "missing";
  if (layer.scale === "probability") return "plain";
  if (number === 0) return "stuck";
  if (number < 0) return "upslope";
  const isFlagged =
    layer.name === "permanent_displacement" && value("validity", index) & meta.cautions;
  return isFlagged ? "flagged" : "plain";
}

function isOnDiagonal(i, period) {
  return i % period === 0;
}

// Colours of the pixel in column i and row j.
const PATTERNS = {
  plain: () => CLEAR,
  stuck: (i, j) => (i % 8 === 0 && j % 8 === 0 ? GREY : LIGHT_GREY),
  upslope: (i) => {
    if (i % 6 === 0) return HATCH;
    return meta.signed ? CLEAR : PINK;
  },
  missing: (i, j) => (isOnDiagonal(i + j, 10) || isOnDiagonal(i - j, 10) ? GREY : WHITE),
  flagged: (i, j) => (isOnDiagonal(i + j, 9) ? HATCH : CLEAR),
  boundary: (i, j) => (j === 8 ? BLACK : WHITE),
  history: (i, j) => {
    const radius = Math.hypot(i - 15, j - 8);
    if (radius < 2.6) return WHITE;
    return radius < 3.8 ? BLACK : SAMPLE_COLOUR;
  },
};

export function markColour(kind, i, j) {
  return PATTERNS[kind](i, j);
}
