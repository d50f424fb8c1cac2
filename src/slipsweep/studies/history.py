"""One time history, exact: the cycle solver's legs sampled on any time grid."""

import math
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.plans import check_problem, plan_sweep
from slipsweep.grid.resources import check_memory
from slipsweep.grid.served import check_served
from slipsweep.grid.tables import Table, Variable
from slipsweep.kernels.block import TILE
from slipsweep.kernels.history import history
from slipsweep.model.parameters import MOST_POINTS, check_numbers, check_whole, number_text
from slipsweep.model.variables import HISTORY, PARAMETERS, VALUELESS
from slipsweep.motion.cutting import wave_of
from slipsweep.motion.waveforms import WAVEFORMS

#: Cycles after the shaking that have as many points each as one of the shaking; longer slides have no more points.
_CYCLES_BEYOND = 100


def history_table(
    *, times: Any = None, points_per_cycle: int = 512, excitation: Any = "sine", model: Any = "mendez", **given: Any
) -> Table:
    """Time history of one block; keyword arguments, results and errors of `slipsweep.simulate`."""
    motion = WAVEFORMS.of(excitation)
    problem = check_problem(motion, model, "cycle")
    for name in PARAMETERS:
        value = given.get(name)
        if value is not None and check_numbers(name, value.values if isinstance(value, Variable) else value).ndim:
            raise InputError(f"{name}: simulate takes one case; must be a single number")
    summary = plan_sweep(**given, excitation=motion, model=problem.model).solve()
    own = {name: variable.values for name, variable in summary.coords.items()}
    omega = 2.0 * math.pi * float(own["frequency"])
    cells = np.repeat([float(values) for values in engine.cell_inputs(own, 0)], TILE)
    wave = wave_of(motion)
    valueless = int(summary["validity"].item()) & VALUELESS

    def sampled(phases: np.ndarray) -> np.ndarray:
        table = np.empty((phases.size, len(HISTORY)))
        history(cells, problem.options(True), wave, phases, table)
        if valueless:  # from the beginning on, also where the flag is raised later
            table[:, 1:] = math.nan
        return table

    if times is None:
        points = check_whole("points_per_cycle", points_per_cycle, 4, MOST_POINTS)
        last = sampled(np.array([2.0 * math.pi * motion.cycles]))[0]
        # beyond the shaking the block is still braked, by b = Ü - Üg (Eq. 12)
        braking = last[1] - last[0]
        with np.errstate(divide="ignore", over="ignore"):
            after = last[3] / braking if summary["sliding_mode"].item() == 1 and last[3] > 0.0 else 0.0
        phases = _phases(points, motion.cycles, float(after))
        grid = phases / omega
    else:
        grid = np.atleast_1d(check_numbers("times", times))
        if grid.ndim != 1 or not np.isfinite(grid).all() or (grid < 0.0).any() or (np.diff(grid) <= 0.0).any():
            raise InputError("times: must be one row of finite, increasing numbers >= 0")
        with np.errstate(over="ignore"):
            phases = grid * omega
        if not np.isfinite(phases[-1:]).all():
            raise InputError(f"times = ..., {number_text(float(grid[-1]))}: too many cycles for double precision")
    table = sampled(phases)
    with np.errstate(over="ignore"):
        table[:, 3] /= omega
        table[:, 4] /= omega * omega
    if not valueless:
        moved = {name: table[:, at] for at, name in enumerate(HISTORY)}
        check_served(problem.model.g, own, moved, np.zeros(len(table), np.int16))
    columns = {
        name: Variable(("time",), np.ascontiguousarray(column), attributes)
        for (name, attributes), column in zip(HISTORY.items(), table.T, strict=True)
    }
    time = Variable(("time",), grid, {"units": "s", "long_name": "time"})
    return Table(
        {**summary.coords, "time": time},
        columns | summary.data_vars,
        summary.attrs | {"title": "Time history of a rigid block"},
    )


def _phases(points: int, cycles: int, after: float) -> np.ndarray:
    """Phases of so many points a cycle, to the end of the shaking and, `after` it (rad), to the end of the slide.

    A slide that brakes by 1e-7 m/s² lasts for months.  Under a constant deceleration few points tell
    all: they are spaced further apart then.
    """
    if not math.isfinite(after):
        raise InputError(
            "the block slides on after the shaking for more cycles than double precision holds; give times, or a "
            "larger yield_acceleration"
        )
    step, shaken = 2.0 * math.pi / points, points * cycles
    beyond = math.ceil(min(after, 2.0 * math.pi * _CYCLES_BEYOND) / step)
    _check_memory(shaken + beyond)
    if after <= 2.0 * math.pi * _CYCLES_BEYOND:
        return np.arange(shaken + beyond + 1) * step
    # a hair further than the end, which is rounded
    rest = np.linspace(0.0, after * (1.0 + 1e-12), beyond + 1)[1:]
    return np.concatenate([np.arange(shaken + 1) * step, shaken * step + rest])


def _check_memory(samples: int) -> None:
    """Refuse what memory cannot hold: the table, its columns apart, phases and times."""
    needed = samples * 8 * (2 * len(HISTORY) + 2)
    check_memory(f"a history of {samples:.4g} points", needed, "take fewer cycles or points_per_cycle, or give times")
