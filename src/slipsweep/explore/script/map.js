// The map: colours, marks, legend, and a summary in words.

import { cellsOfPixels, seenRange } from "./axes.js";
import { X, Y, arrays, dims, isStatistic, meta, value } from "./data.js";
import { element, newElement } from "./elements.js";
import { figures, frameBox } from "./figures.js";
import { pointsWithHistory } from "./histories.js";
import { BLACK, CELL_KINDS, LEGEND, SAMPLE_COLOUR, kindOf, markColour } from "./marks.js";
import { cellAt, chosen, isShown, layer } from "./selection.js";
import { parametersText, resultText } from "./words.js";

const MAP_COLUMNS = dims[X].values.length;
const MAP_ROWS = dims[Y].values.length;

// The number that gives a cell its colour: mm or a probability; NaN has none.
function shadeOf(number) {
  if (layer.scale === "probability") return number;
  if (number > 0) return number * 1000;
  return number < 0 && meta.signed ? -number * 1000 : NaN;
}

// Shades, kinds and sliding modes of all cells of the map, row by row from below.
function mapCells() {
  const shades = new Float32Array(MAP_COLUMNS * MAP_ROWS);
  const kinds = new Array(MAP_COLUMNS * MAP_ROWS);
  const modes = new Int8Array(MAP_COLUMNS * MAP_ROWS);
  const hasModes = layer.name === "permanent_displacement" && arrays.sliding_mode;
  for (let j = 0; j < MAP_ROWS; j++) {
    for (let i = 0; i < MAP_COLUMNS; i++) {
      const cell = j * MAP_COLUMNS + i;
      const index = cellAt(i, j);
      shades[cell] = shadeOf(value(layer.name, index));
      kinds[cell] = kindOf(index);
      modes[cell] = hasModes ? value("sliding_mode", index) : 0;
    }
  }
  return { shades, kinds, modes };
}

// An image of Bokeh's, of the type that a source of it has now.
function newImage(source, width, height) {
  const ImageArray = source.data.image[0].constructor;
  return new ImageArray(width * height, [height, width]);
}

// Colours and marks of the map, pixel by pixel of the screen; lines part the sliding modes.
function mapImages({ shades, kinds, modes }) {
  const frame = frameBox();
  const width = Math.max(Math.round(frame.width), 1);
  const height = Math.max(Math.round(frame.height), 1);
  const columns = cellsOfPixels(X, width);
  const rows = cellsOfPixels(Y, height);
  const colours = newImage(figures.colours, width, height);
  const marks = newImage(figures.marks, width, height);
  for (let j = 0; j < height; j++) {
    const row = rows[j] * MAP_COLUMNS;
    const rowBelow = rows[Math.max(j - 1, 0)] * MAP_COLUMNS;
    for (let i = 0; i < width; i++) {
      const cell = row + columns[i];
      const left = row + columns[Math.max(i - 1, 0)];
      const below = rowBelow + columns[i];
      const isBoundary = modes[cell] !== modes[left] || modes[cell] !== modes[below];
      colours[j * width + i] = shades[cell];
      marks[j * width + i] = isBoundary ? BLACK : markColour(kinds[cell], i, j);
    }
  }
  return { colours, marks };
}

// Draw the map of what is chosen.
export function drawMap() {
  const cells = mapCells();
  const images = mapImages(cells);
  const points = pointsWithHistory();
  const [left, right] = seenRange(X);
  const [bottom, top] = seenRange(Y);
  const corner = { x: [left], y: [bottom], dw: [right - left], dh: [top - bottom] };
  figures.x_range.setv({ start: left, end: right });
  figures.y_range.setv({ start: bottom, end: top });
  if (figures.map_g) figures.map_g.setv({ start: bottom / meta.g, end: top / meta.g });
  figures.colours.data = { image: [images.colours], ...corner };
  figures.marks.data = { image: [images.marks], ...corner };
  figures.cells_with_history.data = points;
  showLegend(cells, points);
  showTitle();
  showSummary(cells);
}

function legendCanvas(kind) {
  const canvas = newElement("canvas", { width: 30, height: 16 });
  canvas.setAttribute("aria-hidden", "true");
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, canvas.height);
  const pixels = new Uint32Array(image.data.buffer);
  for (let j = 0; j < canvas.height; j++) {
    for (let i = 0; i < canvas.width; i++) {
      pixels[j * canvas.width + i] = markColour(kind, i, j) || SAMPLE_COLOUR;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

// Show the marks that the map has.
function showLegend({ kinds, modes }, points) {
  const drawn = new Set(kinds);
  if (new Set(modes).size > 1) drawn.add("boundary");
  if (points.x.length) drawn.add("history");
  const items = Object.entries(LEGEND)
    .filter(([kind]) => drawn.has(kind))
    .map(([kind, text]) => {
      const item = newElement("li");
      item.append(legendCanvas(kind), text);
      return item;
    });
  element("legend").replaceChildren(...items);
}

function showTitle() {
  const statistics = dims
    .map((dim) => dim.name)
    .filter((name) => isStatistic(name) && isShown(name));
  const place = statistics.length ? ` (${parametersText(statistics, chosen)})` : "";
  element("map-title").textContent = layer.title + place;
}

// The smallest and the largest value of the map, in words.
function rangeText(shades) {
  const numbers = shades.filter((number) => !Number.isNaN(number)).sort();
  if (!numbers.length) return "";
  const unit = layer.scale === "displacement" ? 1000 : 1;
  const low = resultText(layer, numbers[0] / unit);
  const high = resultText(layer, numbers[numbers.length - 1] / unit);
  return `; from ${low} to ${high}`;
}

// Say what the map shows, for those who do not see it.
function showSummary({ shades, kinds }) {
  const counts = Object.entries(CELL_KINDS)
    .map(([kind, { summary }]) => [kinds.filter((other) => other === kind).length, summary])
    .filter(([count]) => count > 0)
    .map(([count, summary]) => `, ${count} ${summary}`);
  element("map-summary").textContent =
    `${dims[Y].title} over ${dims[X].title}. ` +
    `${kinds.length} cells${counts.join("")}${rangeText(shades)}.`;
}
