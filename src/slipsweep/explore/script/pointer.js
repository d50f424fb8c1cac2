// The pointer on the map: the cell under it is read out, and chosen by a click.

import { cellAtShare } from "./axes.js";
import { showChosen } from "./controls.js";
import { X, Y } from "./data.js";
import { element } from "./elements.js";
import { shareOfMap } from "./figures.js";
import { hasHistory, nearestWithHistory } from "./histories.js";
import { showReadout } from "./readout.js";
import { cellAt, chosen, setChosen } from "./selection.js";

// Index of the cell under the pointer, or null.
function cellUnder(event) {
  const { x, y } = shareOfMap(event);
  const i = cellAtShare(X, x);
  const j = cellAtShare(Y, y);
  return i < 0 || j < 0 ? null : cellAt(i, j);
}

// Choose the cell, or the nearest one with a time history, if there are some in the map.
function click(event) {
  const cell = cellUnder(event);
  if (!cell) return;
  const nearest = hasHistory(cell) ? null : nearestWithHistory(cell);
  setChosen(nearest || cell);
  showChosen(nearest ? cell : null);
}

function hover(event) {
  const cell = event.pointerType === "touch" ? null : cellUnder(event);
  if (cell) showReadout(cell, "Cell under the pointer");
}

export function followPointer() {
  const map = element("map");
  map.addEventListener("click", click);
  map.addEventListener("pointermove", hover);
  map.addEventListener("pointerleave", () => showReadout(chosen, "Chosen cell"));
}
