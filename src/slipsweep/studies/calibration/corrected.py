"""A calibrated test less offsets, drifts and steps of its sensors; its slides and its friction."""

import math
from collections.abc import Mapping

import numpy as np
import xarray as xr

from slipsweep.model import variables
from slipsweep.studies.calibration.estimate import Solution
from slipsweep.studies.calibration.measured_friction import (
    NOISE_IN_THRESHOLD,
    Floats,
    coefficients_of,
    slides_of,
    threshold_of,
)
from slipsweep.studies.calibration.shaking_test import TABLE, ShakingTest


def corrected_channels(solution: Solution) -> dict[str, Floats]:
    """Return the channels of a test, less offsets, drifts and steps."""
    added, _ = added_by_sensors(solution)
    channels = solution.observation.test.channels
    return {name: values - added[name] for name, values in channels.items()}


def added_by_sensors(solution: Solution) -> tuple[dict[str, Floats], list[str]]:
    """Return the sum of offsets, drifts and steps in each channel, and each of these in words."""
    observation = solution.observation
    test = observation.test
    added = {name: np.zeros(test.times.size) for name in test.channels}
    texts = []
    of_table = np.transpose([solution.table_lines, solution.line_errors])
    sizes, errors = solution.likelihood.nuisances(solution.parameters)
    number = observation.table_errors.size  # the errors of the table's motion stand first
    of_block = np.transpose([sizes[number:], errors[number:]])
    lines = [*observation.table_lines, *observation.lines]
    for line, (size, error) in zip(lines, [*of_table, *of_block], strict=True):
        added[line.channel] = added[line.channel] + size * line.values
        units = variables.HISTORY[line.channel]["units"]
        if line.name == "drift":
            units += " over the whole test"
        size = line.deviation * size
        error = line.deviation * error
        texts.append(f"{line.name} of {line.channel}: {size:.4g} ± {error:.2g} {units}")
    return added, texts


def block_acceleration(test: ShakingTest, channels: Mapping[str, Floats]) -> Floats | None:
    """Return the block's acceleration, measured or from its velocity; None without either."""
    if "block_acceleration" in channels or "relative_velocity" not in channels:
        return channels.get("block_acceleration")
    return np.asarray(channels[TABLE] - np.gradient(channels["relative_velocity"], test.times))


def table_at_samples(solution: Solution) -> Floats:
    """Return the table's motion at the samples, less offset and drift of its sensor."""
    observation = solution.observation
    motion = observation.recorded_acceleration(solution.table_lines)
    return np.interp(observation.test.times, observation.motion.times, motion)


def slides_in(solution: Solution, table: Floats, block: Floats) -> tuple[list[slice], float]:
    """Return the slides of a test, and the threshold above which the block slides, m/s²."""
    observation = solution.observation
    threshold = threshold_of(observation.test.channels[TABLE], block)[0]
    if "block_acceleration" in observation.channels:
        # neighbouring samples show too little of coloured noise
        row = observation.channels.index("block_acceleration")
        of_block = solution.likelihood.noise_seen(solution.parameters)[row]
        of_table = observation.motion.noise * (observation.motion.colour > 0.0)
        threshold = max(threshold, NOISE_IN_THRESHOLD * math.hypot(of_block, of_table))
    return slides_of(observation.test.times, table, block, threshold), threshold


def friction_by_statics(solution: Solution) -> xr.Dataset:
    """Return static and kinetic friction by statics (`coefficients_of`).

    There are none where neither the block's acceleration nor its velocity was measured.
    """
    observation = solution.observation
    block = block_acceleration(observation.test, corrected_channels(solution))
    if block is None:
        return xr.Dataset(attrs={"constant_friction": ""})
    table = table_at_samples(solution)
    slides, _ = slides_in(solution, table, block)
    return coefficients_of(
        table, block, slides, observation.mu_s, observation.theta, observation.model.g
    )
