// Numbers with their units, in words.

import {
  arrays,
  coordinate,
  descriptions,
  dims,
  isStatistic,
  meta,
  position,
  value,
} from "./data.js";

const NO_BREAK_SPACE = "\u00a0";

function rounded(number, digits) {
  return Number(number.toPrecision(digits));
}

export function numberText(number) {
  return String(rounded(number, 5));
}

export function lengthText(metres) {
  if (Number.isNaN(metres)) return "no value";
  const [number, unit] = Math.abs(metres) < 10 ? [metres * 1000, "mm"] : [metres, "m"];
  return numberText(rounded(number, 4)) + NO_BREAK_SPACE + unit;
}

// A value of a dimension or coordinate.
export function parameterText(name, number) {
  const { unit, acceleration, labels } = descriptions[name];
  if (labels && labels.length) return labels[Math.round(number) - 1];
  if (name === "threshold") return lengthText(number);
  if (name === "quantile" && number === 0.5) return "0.5 (median)";
  const space = unit === "" || unit === "°" ? "" : NO_BREAK_SPACE;
  const text = numberText(number) + space + unit;
  if (!acceleration) return text;
  return `${text} (${rounded(number / meta.g, 4)}${NO_BREAK_SPACE}g)`;
}

// The values of some dimensions and coordinates in a cell, with their symbols.
export function parametersText(names, index) {
  return names
    .map((name) => `${descriptions[name].symbol} = ${parameterText(name, coordinate(name, index))}`)
    .join(", ");
}

// A value of a result: a displacement or a probability.
export function resultText(result, number) {
  if (result.scale === "displacement" || Number.isNaN(number)) return lengthText(number);
  return `${rounded(100 * number, 4)}${NO_BREAK_SPACE}%`;
}

// The value of a result in a cell; of a statistic those at all its quantiles or thresholds.
export function cellText(result, index) {
  const statistic = arrays[result.name].dims.find(isStatistic);
  if (statistic === undefined) return resultText(result, value(result.name, index));
  const texts = dims[position[statistic]].values.map((number, k) => {
    const other = index.slice();
    other[position[statistic]] = k;
    const text = resultText(result, value(result.name, other));
    return `${parameterText(statistic, number)}: ${text}`;
  });
  return texts.join("; ");
}
