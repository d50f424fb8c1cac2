"""Time histories in a page: of some cells, over phase, from which the page scales them to any frequency."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.explore.excerpt import Excerpt, Indices, evenly, thinned_lengths
from slipsweep.model.options import MODELS
from slipsweep.motion.waveforms import WAVEFORMS
from slipsweep.studies.history import simulate

#: Points a cycle, and how many cycles at most.
POINTS, CYCLES = 64, 3

_COLUMNS = ("block_acceleration", "relative_velocity", "relative_displacement")


@dataclass(frozen=True)
class Histories:
    """Time histories of some cells, over phase: what they are at ω = 1 rad/s.

    `keep` has the dimensions that histories depend on, and the indices of the excerpt that have them.  `phase` (rad)
    has the points of `cycles` cycles, `ground` the ground acceleration over its amplitude.  `values`, of shape
    (..., quantity, point), are block acceleration, relative velocity and displacement in units of `scale`, of shape
    (..., quantity), which is NaN where a cell has no history.
    """

    keep: Indices
    phase: NDArray[np.float64]
    ground: NDArray[np.float64]
    values: NDArray[np.int16]
    scale: NDArray[np.float32]
    cycles: int


def compute_histories(excerpt: Excerpt, most_bytes: int) -> Histories | None:
    """Compute the histories of as many cells, evenly spaced, as fit into `most_bytes`.

    They depend on time through the phase only: v(f) = V/ω and u(f) = W/ω², so that one
    history serves all frequencies and the page scales it (MODEL, motion rules).

    Returns
    -------
    Histories or None
        None where the shaking is not periodic or ends with a ramp beyond the cycles shown, where inputs are
        uncertain, or where not even one history fits.
    """
    table = excerpt.table
    if "waveform" not in table.attrs or "permanent_displacement" not in table:
        return None
    motion = WAVEFORMS.from_attributes(table.attrs)
    if motion.cycles > CYCLES and motion.ramp_out > 0.0:
        return None  # the first cycles alone have no ramp at their end
    others = ("phi", "frequency", "displacement_amplitude", "structure_frequency", "quantile", "threshold")
    inputs = {str(name): one.variable for name, one in table.coords.items() if name not in others}  # phi: by mu_s
    depends = {str(dim) for variable in inputs.values() for dim in variable.dims}
    sizes = {dim: size for dim, size in excerpt.sizes.items() if dim in depends}
    cycles = min(motion.cycles, CYCLES)
    motion, model = motion.but(cycles=cycles), MODELS.from_attributes(table.attrs)
    points = POINTS * cycles + 1
    most = most_bytes // (len(_COLUMNS) * (2 * points + 4))
    # every position of the sliders has some, if they fit
    left = thinned_lengths(sizes, most, excerpt.map_dims, sizes.keys() - {*excerpt.map_dims})
    left = thinned_lengths(left, most, excerpt.map_dims)
    if math.prod(left.values()) > most:
        return None
    keep = {dim: evenly(length, left[dim]) for dim, length in sizes.items()}
    phase = np.linspace(0.0, 2.0 * math.pi * cycles, points)
    ground = np.zeros(points)
    values = np.zeros((*left.values(), len(_COLUMNS), points), np.int16)
    scale = np.full((*left.values(), len(_COLUMNS)), np.nan, np.float32)
    for at in np.ndindex(*left.values()):
        cell = {dim: int(keep[dim][i]) for dim, i in zip(keep, at, strict=True)}
        given: dict[str, Any] = {
            name: variable.isel(cell, missing_dims="ignore").item() for name, variable in inputs.items()
        }
        history = simulate(times=phase, excitation=motion, model=model, frequency=1.0 / (2.0 * math.pi), **given)
        columns = np.array([history[name].values for name in _COLUMNS])
        if np.isfinite(columns).all():
            largest = np.abs(columns).max(axis=1)
            scale[at] = largest / 32767.0
            with np.errstate(invalid="ignore"):
                values[at] = np.where(largest[:, None] > 0.0, columns / largest[:, None] * 32767.0, 0.0).round()
            if given["amplitude"] > 0.0:
                ground = history["ground_acceleration"].values / given["amplitude"]
    return Histories(keep, phase, ground, values, scale, cycles)
