"""Intensity measures of a record by plain sums over a fine sampling of its straight lines."""

import math

import numpy as np
from numpy.typing import NDArray

#: Samples on each line of a record; the sums below are then right to 1e-5 or better.
_PARTS = 200


def measures_by_sums(times: NDArray[np.float64], values: NDArray[np.float64]) -> dict[str, float]:
    """Return all measures of accelerations (m/s²) by their definitions, g = 9.80665 m/s²."""
    places = np.arange((times.size - 1) * _PARTS + 1) / _PARTS
    fine = np.interp(places, np.arange(times.size), times)
    acceleration = np.interp(fine, times, values)
    velocity = _integral(fine, acceleration)
    displacement = _integral(fine, velocity)
    before = acceleration[:-1]
    after = acceleration[1:]
    squares = (before**2 + before * after + after**2) / 3.0  # the mean of Üg² on a straight line
    energy = np.concatenate([[0.0], np.cumsum(squares * np.diff(fine))])
    first, last = np.interp([0.05 * energy[-1], 0.95 * energy[-1]], energy, fine)
    return {
        "pga": np.abs(values).max(),
        "pgv": np.abs(velocity).max(),
        "pgd": np.abs(displacement).max(),
        "arias_intensity": math.pi / (2.0 * 9.80665) * energy[-1],
        "cav": _integral(fine, np.abs(acceleration))[-1],
        "significant_duration": last - first,
        "mean_period": _mean_period(times, values),
    }


def _integral(times: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The integral from the first time on, by trapezoids."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(times)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _mean_period(times: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Σ C²/f over Σ C² of an evenly sampled motion, 0.25 to 20 Hz in steps of 0.05 Hz at most."""
    step = (times[-1] - times[0]) / (times.size - 1)
    samples = max(times.size, math.ceil(20.0 / step))
    frequencies = np.arange(1, samples // 2 + 1) / (samples * step)
    frequencies = frequencies[(frequencies > 0.25 - 1e-9) & (frequencies < 20.0 + 1e-9)]
    waves = np.exp(-2j * np.pi * np.multiply.outer(frequencies, times - times[0]))
    powers = np.abs(waves @ values) ** 2
    return float((powers / frequencies).sum() / powers.sum())
