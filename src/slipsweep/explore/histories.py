"""Time histories of some cells of a page."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.explore.excerpt import Excerpt, evenly_spaced, thinned_lengths
from slipsweep.grid import engine, plans, solvers
from slipsweep.grid.inputs import Problem
from slipsweep.kernels.history import History
from slipsweep.model.options import MODELS, Cycle, changing_strength
from slipsweep.model.variables import VALUELESS
from slipsweep.motion.cutting import path_of_waveform
from slipsweep.motion.waveforms import WAVEFORMS

#: Points of a history in a cycle.
POINTS = 64

#: Cycles that a history has at most.
CYCLES = 3

_QUANTITIES = ("block_acceleration", "velocity", "displacement")

#: Largest magnitude of a 16-bit integer, in which the values of a history are kept.
_LARGEST_INTEGER = 32767.0

#: Coordinates that are no inputs of the motion over phase: φ enters as μs.
_NO_INPUTS = (
    "phi",
    "frequency",
    "displacement_amplitude",
    "structure_frequency",
    "quantile",
    "threshold",
)


@dataclass(frozen=True)
class Histories:
    """Time histories of some cells over phase, at ω = 1 rad/s, which the page scales.

    `keep` has the dimensions that histories depend on, and the indices of the excerpt that have
    them.  `phase` (rad) has the points of `cycles` cycles, `ground` the ground acceleration over
    its amplitude.  `values`, of shape (..., quantity, point), are block acceleration, relative
    velocity and displacement in units of `scale`, of shape (..., quantity), which is NaN if a cell
    has no history.
    """

    keep: dict[str, NDArray[np.intp]]
    phase: NDArray[np.float64]
    ground: NDArray[np.float64]
    values: NDArray[np.int16]
    scale: NDArray[np.float32]
    cycles: int


def compute_histories(excerpt: Excerpt, most_bytes: int) -> Histories | None:
    """Compute the histories of as many cells, evenly spaced, as fit into `most_bytes`.

    They depend on time through the phase only: v(f) = V/ω and u(f) = W/ω², so that a single history
    serves all frequencies and the page scales it (MODEL, motion rules).  None if the shaking is not
    periodic or ends with a ramp beyond the cycles shown, if inputs are uncertain, if the strength
    changes while the block slides (no scaling then), or if not even one history fits.
    """
    attrs = excerpt.table.attrs
    if "waveform" not in attrs or "permanent_displacement" not in excerpt.table:
        return None
    model = MODELS.from_attributes(attrs)
    if changing_strength(model) is not None:
        return None
    motion = WAVEFORMS.from_attributes(attrs)
    if motion.cycles > CYCLES and motion.ramp_out > 0.0:
        return None  # the first cycles alone have no ramp at their end
    motion = replace(motion, cycles=min(motion.cycles, CYCLES))
    inputs = {
        str(name): values for name, values in excerpt.table.coords.items() if name not in _NO_INPUTS
    }
    points = POINTS * motion.cycles + 1
    keep = _kept_indices(excerpt, inputs, most_bytes // (len(_QUANTITIES) * (2 * points + 4)))
    if keep is None:
        return None
    problem = Problem(model, motion, Cycle())
    cells, has_values = _cells(problem, inputs, keep)
    phase = np.linspace(0.0, 2.0 * math.pi * motion.cycles, points)
    ground, values, scale = _integers(problem, cells, has_values, phase)
    return Histories(keep, phase, ground, values, scale, motion.cycles)


def _kept_indices(
    excerpt: Excerpt, inputs: Mapping[str, xr.DataArray], most: int
) -> dict[str, NDArray[np.intp]] | None:
    """Indices along the dimensions of the inputs, of at most `most` cells; None if `most` is 0.

    Every position of the sliders has some, if they fit.
    """
    dims = {str(dim) for values in inputs.values() for dim in values.dims}
    lengths = {dim: size for dim, size in excerpt.sizes.items() if dim in dims}
    sliders = lengths.keys() - {*excerpt.map_dims}
    kept = thinned_lengths(lengths, most, excerpt.map_dims, sliders)
    kept = thinned_lengths(kept, most, excerpt.map_dims)
    if math.prod(kept.values()) > most:
        return None
    return {dim: evenly_spaced(length, kept[dim]) for dim, length in lengths.items()}


def _cells(
    problem: Problem,
    inputs: Mapping[str, xr.DataArray],
    keep: Mapping[str, NDArray[np.intp]],
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_]]:
    """Fields of the cells that are kept, and which of them have a displacement."""
    # other names of dimensions: `frequency` is an axis of amplitudes that were given as
    # displacements of the base
    renamed = {dim: f"{dim} of the page" for dim in keep}
    sizes = {renamed[dim]: len(indices) for dim, indices in keep.items()}
    kept_inputs = {}
    for name, values in inputs.items():
        kept = values.isel(keep, missing_dims="ignore")
        dims = [renamed[str(dim)] for dim in kept.dims]
        kept_inputs[name] = xr.DataArray(kept.values, dims=dims)
    plan = plans.plan_sweep(
        {**kept_inputs, "frequency": 1.0 / (2.0 * math.pi)},  # ω = 1 rad/s
        excitation=problem.excitation,
        model=problem.model,
        variables=("validity",),
    )
    validity = plan.solve()["validity"].variable.set_dims(sizes).values
    coords = {
        name: xr.as_variable(values).set_dims(sizes).values for name, values in plan.coords.items()
    }
    return engine.cell_inputs(problem, coords), (validity & VALUELESS) == 0


def _integers(
    problem: Problem,
    cells: Mapping[str, NDArray[np.float64]],
    has_values: NDArray[np.bool_],
    phase: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int16], NDArray[np.float32]]:
    """Ground acceleration over A; histories of the cells as integers; and the unit of each."""
    path = path_of_waveform(problem.excitation)
    samples = History(*np.empty((len(History._fields), phase.size)))
    ground = np.zeros(phase.size)
    values = np.zeros((*has_values.shape, len(_QUANTITIES), phase.size), np.int16)
    scale = np.full((*has_values.shape, len(_QUANTITIES)), np.nan, np.float32)
    for place in np.ndindex(has_values.shape):
        cell = {name: float(numbers[place]) for name, numbers in cells.items()}
        solvers.fill_history(problem, cell, path, phase, samples)
        quantities = np.array([getattr(samples, name) for name in _QUANTITIES])
        if has_values[place] and np.isfinite(quantities).all():
            largest = np.abs(quantities).max(axis=1)
            scale[place] = largest / _LARGEST_INTEGER
            divisors = np.where(largest > 0.0, largest, 1.0)[:, None]
            values[place] = (quantities / divisors * _LARGEST_INTEGER).round()
        if cell["amplitude"] > 0.0:
            ground = samples.ground_acceleration / cell["amplitude"]
    return ground, values, scale
