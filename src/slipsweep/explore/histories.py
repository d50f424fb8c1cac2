"""Time histories of some of the cells that a page shows."""

import math
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.explore.excerpt import Excerpt, evenly, thinned_lengths
from slipsweep.grid import engine, plans, solvers
from slipsweep.grid.inputs import Problem
from slipsweep.kernels.history import History
from slipsweep.model.options import MODELS, Cycle, changing_strength
from slipsweep.model.variables import VALUELESS
from slipsweep.motion.cutting import path_of_waveform
from slipsweep.motion.waveforms import WAVEFORMS

#: Points a cycle, and how many cycles at most.
POINTS = 64
CYCLES = 3

_COLUMNS = ("block_acceleration", "velocity", "displacement")


@dataclass(frozen=True)
class Histories:
    """Time histories of some cells over phase, from which the page scales them to any frequency: those at ω = 1 rad/s.

    `keep` has the dimensions that histories depend on, and the indices of the excerpt that have
    them.  `phase` (rad) has the points of `cycles` cycles, `ground` the ground acceleration over
    its amplitude.  `values`, of shape (..., quantity, point), are block acceleration, relative
    velocity and displacement in units of `scale`, of shape (..., quantity), which is NaN where a
    cell has no history.
    """

    keep: dict[str, NDArray[np.intp]]
    phase: NDArray[np.float64]
    ground: NDArray[np.float64]
    values: NDArray[np.int16]
    scale: NDArray[np.float32]
    cycles: int


def compute_histories(excerpt: Excerpt, most_bytes: int) -> Histories | None:
    """Compute the histories of as many cells, evenly spaced, as fit into `most_bytes`.

    They depend on time through the phase only: v(f) = V/ω and u(f) = W/ω², so that one history
    serves all frequencies and the page scales it (MODEL, motion rules).  None where the shaking is
    not periodic or ends with a ramp beyond the cycles shown, where inputs are uncertain, where the
    strength changes while the block slides (no scaling then), or where not even one history fits.
    """
    table = excerpt.table
    if "waveform" not in table.attrs or "permanent_displacement" not in table:
        return None
    if changing_strength(MODELS.from_attributes(table.attrs)) is not None:
        return None
    motion = WAVEFORMS.from_attributes(table.attrs)
    if motion.cycles > CYCLES and motion.ramp_out > 0.0:
        return None  # the first cycles alone have no ramp at their end
    others = (
        "phi",
        "frequency",
        "displacement_amplitude",
        "structure_frequency",
        "quantile",
        "threshold",
    )
    inputs = {
        str(name): one for name, one in table.coords.items() if name not in others
    }  # phi: by mu_s
    depends = {str(dim) for one in inputs.values() for dim in one.dims}
    sizes = {dim: size for dim, size in excerpt.sizes.items() if dim in depends}
    cycles = min(motion.cycles, CYCLES)
    points = POINTS * cycles + 1
    most = most_bytes // (len(_COLUMNS) * (2 * points + 4))
    # every position of the sliders has some, if they fit
    left = thinned_lengths(sizes, most, excerpt.map_dims, sizes.keys() - {*excerpt.map_dims})
    left = thinned_lengths(left, most, excerpt.map_dims)
    if math.prod(left.values()) > most:
        return None
    keep = {dim: evenly(length, left[dim]) for dim, length in sizes.items()}
    # other names of dimensions: `frequency` is one where accelerations were given as displacements
    # of the base
    renamed = {dim: f"{dim} of the page" for dim in left}
    left = {renamed[dim]: length for dim, length in left.items()}
    kept = {name: one.isel(keep, missing_dims="ignore") for name, one in inputs.items()}
    given = {
        name: xr.DataArray(one.values, dims=[renamed[str(dim)] for dim in one.dims])
        for name, one in kept.items()
    }
    motion = replace(motion, cycles=cycles)
    model = MODELS.from_attributes(table.attrs)
    at_one = {**given, "frequency": 1.0 / (2.0 * math.pi)}  # ω = 1 rad/s
    plan = plans.plan_sweep(at_one, excitation=motion, model=model, variables=("validity",))
    has_values = (plan.solve()["validity"].variable.set_dims(left).values & VALUELESS) == 0
    problem = Problem(model, motion, Cycle())
    path = path_of_waveform(motion)
    fields = {
        name: xr.as_variable(values).set_dims(left).values
        for name, values in engine.cell_inputs(problem, plan.coords).items()
    }
    phase = np.linspace(0.0, 2.0 * math.pi * cycles, points)
    ground = np.zeros(points)
    values = np.zeros((*left.values(), len(_COLUMNS), points), np.int16)
    scale = np.full((*left.values(), len(_COLUMNS)), np.nan, np.float32)
    samples = History(*np.empty((len(History._fields), points)))
    for at in np.ndindex(*left.values()):
        cell = {name: float(values[at]) for name, values in fields.items()}
        solvers.fill_history(problem, cell, path, phase, samples)
        columns = np.array([getattr(samples, name) for name in _COLUMNS])
        if has_values[at] and np.isfinite(columns).all():
            largest = np.abs(columns).max(axis=1)
            scale[at] = largest / 32767.0
            with np.errstate(invalid="ignore"):
                values[at] = np.where(
                    largest[:, None] > 0.0, columns / largest[:, None] * 32767.0, 0.0
                ).round()
        if cell["amplitude"] > 0.0:
            ground = samples.ground_acceleration / cell["amplitude"]
    return Histories(keep, phase, ground, values, scale, cycles)
