"""One time history, exact: the cycle solver's legs sampled on any time grid."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep import engine
from slipsweep.errors import InputError
from slipsweep.kernels.history import history
from slipsweep.parameters import check_whole
from slipsweep.sweep import check_options, sweep
from slipsweep.variables import HISTORY


def simulate(
    theta: float,
    mu_s: float,
    amplitude: float | None = None,
    frequency: float | None = None,
    *,
    times: Sequence[float] | np.ndarray | None = None,
    points_per_cycle: int = 512,
    displacement_amplitude: float | None = None,
    cycles: int = 10,
    yield_acceleration: float | None = None,
    decay_rate: float | None = None,
    delta_mu: float | None = None,
    minimum_friction: float | None = None,
    structure_frequency: float | None = None,
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    waveform: str = "sine",
    g: float = 9.81,
) -> xr.Dataset:
    """Time history of one block, event by event: the samples carry rounding errors only.

    Parameters
    ----------
    theta, mu_s, amplitude, frequency : float
        One case; these and the remaining parameters as in `slipsweep.sweep`.
    times : array, optional
        Times to sample, s, increasing and not negative; by default `points_per_cycle` a
        cycle, from 0 to the end of the shaking, or until the block has come to rest if later.
    points_per_cycle : int
        Samples a cycle where `times` is not given.

    Returns
    -------
    Dataset
        Along `time` (s): `ground_acceleration`, `block_acceleration` (m/s²),
        `friction_coefficient` (what Eq. 1 gives for the two), `relative_velocity` (m/s)
        and `relative_displacement` (m); and the results of `sweep` for the case.  NaN where
        the case has no value (`validity`).

    Raises
    ------
    InputError
        As `sweep`; or times that are not increasing.
    """
    problem = check_options(model, rise, recoupling, waveform, cycles, g=g)
    parameters: dict[str, Any] = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": amplitude,
        "frequency": frequency,
        "displacement_amplitude": displacement_amplitude,
        "yield_acceleration": yield_acceleration,
        "decay_rate": decay_rate,
        "delta_mu": delta_mu,
        "minimum_friction": minimum_friction,
        "structure_frequency": structure_frequency,
    }
    for name, value in parameters.items():
        if value is not None and np.ndim(value):
            raise InputError(f"{name}: simulate takes one case; must be a single number")
    summary = sweep(
        **parameters,
        cycles=cycles,
        model=model,
        rise=rise,
        recoupling=recoupling,
        waveform=waveform,
        solver="cycle",
        g=g,
    )
    own = {str(name): np.asarray(value) for name, value in summary.coords.items()}
    omega = 2.0 * math.pi * float(own["frequency"])
    cells = np.array([[float(values)] for values in engine.cell_inputs(own, 0)])
    options = problem.options(True)

    def sampled(phases: np.ndarray) -> np.ndarray:
        table = np.empty((phases.size, len(HISTORY)))
        history(cells, options, phases, table)
        return table

    if times is None:
        points = check_whole("points_per_cycle", points_per_cycle, 4)
        shaken = points * problem.cycles
        last = sampled(np.array([2.0 * math.pi * problem.cycles]))[0]
        # beyond the shaking the block is still braked, by b = Ü - Üg (Eq. 12)
        braking = last[1] - last[0]
        after = last[3] / braking if summary.sliding_mode == 1 and last[3] > 0.0 else 0.0
        phases = np.arange(shaken + math.ceil(after * points / (2.0 * math.pi)) + 1) * (2.0 * math.pi / points)
        grid = phases / omega
    else:
        grid = np.atleast_1d(np.asarray(times, np.float64))
        if grid.ndim != 1 or not np.isfinite(grid).all() or (grid < 0.0).any() or (np.diff(grid) <= 0.0).any():
            raise InputError("times: must be one row of finite, increasing numbers >= 0")
        phases = grid * omega
    table = sampled(phases)
    table[:, 3] /= omega
    table[:, 4] /= omega * omega
    columns = {
        name: ("time", np.ascontiguousarray(column), attributes)
        for (name, attributes), column in zip(HISTORY.items(), table.T, strict=True)
    }
    time = ("time", grid, {"units": "s", "long_name": "time"})
    result = xr.Dataset(columns, summary.coords | {"time": time}).merge(summary)
    return result.assign_attrs(summary.attrs | {"title": "Time history of a rigid block"})
