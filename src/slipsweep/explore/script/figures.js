// The figures, which Bokeh draws: their parts by name.

import { meta } from "./data.js";
import { element } from "./elements.js";
import { layer } from "./selection.js";

const SCALES = ["displacement", "probability"];

const PARTS = [
  "map",
  "x_range",
  "y_range",
  "map_g",
  "colours",
  "marks",
  "cells_with_history",
  "chosen",
  "history",
  "accelerations_range",
  "accelerations_g",
  ...SCALES.flatMap((scale) => [`colours-${scale}`, `bar-${scale}`]),
];

export const figures = {};

function modelOf(part) {
  const models = window.Bokeh.documents.map((figure) => figure.get_model_by_name(part));
  return models.find(Boolean);
}

function pause(milliseconds) {
  return new Promise((resolve) => {
    setTimeout(resolve, milliseconds);
  });
}

export async function embedFigures() {
  await window.Bokeh.embed.embed_item(meta.figures.map, "figure-map");
  await window.Bokeh.embed.embed_item(meta.figures.panels, "figure-panels");
  while (!window.Bokeh.documents.every((figure) => figure.is_idle)) await pause(20);
  for (const part of PARTS) figures[part] = modelOf(part);
}

// Where the map lies in its element, and its size, in pixels.
export function frameBox() {
  return window.Bokeh.index.find_one(figures.map).frame.bbox;
}

// Place of an event in the map, in shares of its width from the left and its height from below.
export function shareOfMap(event) {
  const host = element("map").getBoundingClientRect();
  const { left, top, width, height } = frameBox();
  return {
    x: (event.clientX - host.left - left) / width,
    y: 1 - (event.clientY - host.top - top) / height,
  };
}

// Show the colours of the layer and their bar, and hide those of the other scale.
export function showScale() {
  for (const scale of SCALES) {
    for (const part of [figures[`colours-${scale}`], figures[`bar-${scale}`]]) {
      if (part) part.visible = scale === layer.scale;
    }
  }
}
