// Put the page together once Bokeh has drawn the empty figures.

import { nearestCell } from "./axes.js";
import { addControls, showChosen } from "./controls.js";
import { arrays, meta, value } from "./data.js";
import { element } from "./elements.js";
import { embedFigures, showScale } from "./figures.js";
import { hasHistories, hasHistory, nearestWithHistory } from "./histories.js";
import { drawMap } from "./map.js";
import { followPointer } from "./pointer.js";
import { chosen, layer, setChosen } from "./selection.js";

// True if a cell slides, and no flag says that its value is not to be relied on.
function isSound(index) {
  const number = value(layer.name, index);
  const slides = number > 0 || (meta.signed && number < 0);
  return slides && !(arrays.validity && value("validity", index) & meta.unsound);
}

// The cell to begin with: near the middle of the map, sound, and with a history.
function firstCell() {
  return (
    nearestCell(chosen, (cell) => isSound(cell) && (!hasHistories() || hasHistory(cell))) ||
    nearestCell(chosen, isSound) ||
    nearestWithHistory(chosen)
  );
}

// Draw the map anew once its size rests: the pixels of the marks are those of the screen.
function drawOnResize() {
  let timer;
  const observer = new ResizeObserver(() => {
    clearTimeout(timer);
    timer = setTimeout(drawMap, 200);
  });
  observer.observe(element("map"));
}

element("history").hidden = !hasHistories();
await embedFigures();
addControls();
followPointer();
showScale();
drawMap();
const first = firstCell();
if (first) setChosen(first);
showChosen();
drawOnResize();
document.body.dataset.ready = "true";
