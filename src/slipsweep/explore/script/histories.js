// Time histories of the cells that have some, scaled to the frequency of the cell.

import { nearestCell } from "./axes.js";
import { X, Y, arrays, coordinate, descriptions, dims, meta, position } from "./data.js";
import { element } from "./elements.js";
import { figures } from "./figures.js";
import { cellAt, chosen } from "./selection.js";
import { lengthText, numberText, parametersText } from "./words.js";

const store = meta.histories;

// Rows of a history in the store.
const ACCELERATION = 0;
const VELOCITY = 1;
const DISPLACEMENT = 2;
const HISTORY_ROWS = 3;

export function hasHistories() {
  return Boolean(store);
}

// Number of a cell in the store of histories, or -1.
function numberInStore(index) {
  if (!store) return -1;
  let number = 0;
  for (const [name, kept] of Object.entries(store.keep)) {
    const place = kept.indexOf(index[position[name]]);
    if (place < 0) return -1;
    number = number * kept.length + place;
  }
  return Number.isNaN(arrays.history_scale.values[HISTORY_ROWS * number]) ? -1 : number;
}

export function hasHistory(index) {
  return numberInStore(index) >= 0;
}

// Index of the nearest cell of the map that has a history, or null.
export function nearestWithHistory(index) {
  return nearestCell(index, hasHistory);
}

// The history of a cell. Time enters the motion through the phase ωt only, so that the scaling is
// exact.
function historyOf(index) {
  const number = numberInStore(index);
  const omega = 2 * Math.PI * coordinate("frequency", index);
  const amplitude = coordinate("amplitude", index);
  const points = store.phase.length;
  const row = (quantity, factor) => {
    const start = (HISTORY_ROWS * number + quantity) * points;
    const scale = arrays.history_scale.values[HISTORY_ROWS * number + quantity];
    const stored = arrays.histories.values.subarray(start, start + points);
    return Array.from(stored, (integer) => integer * scale * factor);
  };
  return {
    t: store.phase.map((phase) => phase / omega),
    ground: store.ground.map((share) => share * amplitude),
    block: row(ACCELERATION, 1),
    v: row(VELOCITY, 1 / omega),
    u: row(DISPLACEMENT, 1000 / omega ** 2),
  };
}

function drawHistory(history) {
  figures.history.data = history;
  const accelerations = [...history.ground.map(Math.abs), ...history.block.map(Math.abs)];
  const end = 1.05 * Math.max(...accelerations);
  figures.accelerations_range.setv({ start: -end, end });
  figures.accelerations_g.setv({ start: -end / meta.g, end: end / meta.g });
}

function summaryOf(history) {
  const fastest = numberText(Math.max(...history.v));
  const moved = lengthText(history.u[history.u.length - 1] / 1000);
  return (
    "Acceleration of base and block, velocity and displacement of the block relative to the " +
    `base. Largest velocity ${fastest} m/s; displacement at the end ${moved}.`
  );
}

const MAP_DIMS = [meta.map.y, meta.map.x];

// Positions of the sliders at which there are histories, if they stand elsewhere.
function otherPositions() {
  return Object.entries(store.keep)
    .filter(([name, kept]) => !MAP_DIMS.includes(name) && !kept.includes(chosen[position[name]]))
    .map(([name, kept]) => {
      const values = kept.map((k) => numberText(dims[position[name]].values[k]));
      return `${descriptions[name].symbol} = ${values.join(", ")}`;
    });
}

// Why the chosen cell has no history, and where there is one.
function absenceText(nearest) {
  const positions = otherPositions();
  if (positions.length) {
    return (
      "No cell of this map has a time history in the page. " +
      `There are some at ${positions.join("; ")}.`
    );
  }
  if (!nearest) return "No cell of this map has a time history.";
  const place = parametersText(MAP_DIMS, nearest);
  return `This cell has no time history in the page. The nearest that has one: ${place}.`;
}

function presenceText(clicked) {
  const shown = parametersText(MAP_DIMS, chosen);
  const cycles = `${shown}: the first ${store.cycles} of ${store.of} cycles.`;
  if (!clicked) return cycles;
  const place = parametersText(MAP_DIMS, clicked);
  return (
    `The cell that was clicked (${place}) has none; ` +
    `this is the nearest that has one. ${cycles}`
  );
}

// Show the history of the chosen cell, which may stand for the one that was clicked; return the
// note that says so.
export function showHistory(clicked) {
  const isThere = hasHistory(chosen);
  const nearest = isThere ? null : nearestWithHistory(chosen);
  const note = element("history-note");
  element("nearest").hidden = !nearest;
  element("histories").hidden = !isThere;
  note.dataset.index = isThere ? JSON.stringify(chosen) : "";
  note.textContent = isThere ? presenceText(clicked) : absenceText(nearest);
  if (isThere) {
    const history = historyOf(chosen);
    drawHistory(history);
    element("history-summary").textContent = summaryOf(history);
  }
  return note.textContent;
}

// Coordinates of the cells of the map that have a history.
export function pointsWithHistory() {
  const points = { x: [], y: [] };
  for (let j = 0; j < dims[Y].values.length; j++) {
    for (let i = 0; i < dims[X].values.length; i++) {
      if (hasHistory(cellAt(i, j))) {
        points.x.push(dims[X].values[i]);
        points.y.push(dims[Y].values[j]);
      }
    }
  }
  return points;
}
