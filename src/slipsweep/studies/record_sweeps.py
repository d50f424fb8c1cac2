"""A recorded motion over a grid of blocks: parameters in, a plan, a table out.

A sweep over θ × μs × (given parameters) × scale goes through one kernel for each polarity;
the factor on time needs none: everything depends on time only through t / time_scale, so that
v ∝ time_scale and u ∝ time_scale², exactly.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.grid import engine, threads
from slipsweep.grid.blocks import slabs
from slipsweep.grid.engine import Array, Problem
from slipsweep.grid.plans import Plan, Task, about, aligned, check_inputs, check_problem, checked, grid_sizes
from slipsweep.grid.served import check_served
from slipsweep.grid.tables import Variable
from slipsweep.kernels.record import RECORD_KERNEL, History
from slipsweep.model.options import Newmark
from slipsweep.model.parameters import check_choices, check_given, check_numbers, shown
from slipsweep.model.variables import PARAMETERS, RECORD_COUNTS, RECORD_INPUTS, RECORD_RESULTS, RESULT_DTYPES
from slipsweep.motion.records import Record

#: What a cell of a record takes, in cells of the cycle solver: some 2 µs against 0.1.
_WORK_PER_CELL = 32

#: Cells solved together, wanted results or not (30 bytes each).
_SOLVED_CELLS = 65536

#: How the results change with a factor on time: as its power.
_POWERS = {"permanent_displacement": 2, "peak_relative_velocity": 1}


def history_of(record: Record, polarity: float) -> History:
    """A record with a polarity as the kernels want it, with its positive half waves."""
    values = polarity * record.acceleration
    above = np.concatenate([[False], values > 0.0, [False]])
    edges = np.flatnonzero(above[1:] != above[:-1])
    first, end = edges[::2], edges[1::2]
    peaks = np.array([values[a:b].max() for a, b in zip(first, end, strict=True)], np.float64)
    return History(
        record.times.copy(), values, first.astype(np.int64), (end - 1).astype(np.int64), peaks, float(values.min())
    )


def plan_record(
    *, excitation: Record, model: Any = "mendez", solver: Any = "auto", variables: Any = None, **given: Any
) -> Plan:
    """Plan of a sweep under a record; as `plans.plan_sweep`."""
    problem = check_problem(excitation, model, solver)
    given = {name: values for name, values in given.items() if values is not None}
    check_inputs(given, RECORD_INPUTS, "a Record")
    check_given(given, ("theta", "mu_s"))
    if "amplitude" in given and "scale" in given:
        raise InputError("amplitude, scale: must not both be given; either is the strength of the record")
    if isinstance(problem.model, Newmark):
        for name in ("decay_rate", "delta_mu", "minimum_friction"):
            if name in given:
                raise InputError(f"{name}: not allowed with model = 'newmark', which has no friction law")
    wanted = tuple(RECORD_RESULTS) if variables is None else check_choices("variables", variables, RECORD_RESULTS)
    polarity = _polarity(given.pop("polarity", 1))
    defaults = {"time_scale": 1.0} if "amplitude" in given else {"scale": 1.0, "time_scale": 1.0}
    coords = checked(_ordered(defaults | given)) | {"polarity": polarity}
    inputs = dict(coords)
    if "amplitude" in coords:
        inputs["scale"] = _scale(inputs.pop("amplitude"), excitation)
    sizes = grid_sizes(coords)
    task = Task(partial(_solve, excitation), problem, wanted, sizes, aligned(inputs, sizes))
    return Plan(sizes, coords, (task,), wanted, about("Response of a rigid block to a recorded motion", problem))


def _ordered(given: Mapping[str, Any]) -> dict[str, Any]:
    return {name: given[name] for name in PARAMETERS if name in given}


def _scale(amplitude: Variable, record: Record) -> Variable:
    """The factors that scale a record to peak accelerations."""
    peak = float(np.abs(record.acceleration).max())
    if not peak > 0.0:
        raise InputError(f"amplitude: {record.name} has no acceleration to scale; give scale")
    return Variable(amplitude.dims, amplitude.values / peak)


def _solve(
    record: Record,
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
    empty: engine.Empty = np.empty,
) -> dict[str, np.ndarray]:
    """Solve a grid; parameters but for the record, and results, as those of `engine.solve`."""
    factor, polarity = arrays["time_scale"], arrays["polarity"]
    inputs = engine.cell_inputs({**arrays, "amplitude": arrays["scale"]}, len(shape))
    results = {name: empty(shape, RESULT_DTYPES.get(name, "float64")) for name in wanted}
    # the dimensions that the kernel sees: along time_scale the laws of scaling serve, along polarity another history
    own = tuple(max(values.shape[axis] for values in inputs) for axis in range(len(shape)))
    rows = {str(at): values for at, values in enumerate(inputs)}
    extremes = {
        "acceleration of the record": np.abs(record.acceleration).max(),
        "time of the record": np.abs(record.times).max(),
    }
    for side in np.ndindex(polarity.shape):
        history = history_of(record, float(polarity[side]))
        sided = tuple(slice(at, at + 1) if n > 1 else slice(None) for at, n in zip(side, polarity.shape, strict=True))
        for slab in slabs(own, _SOLVED_CELLS):
            # what of the results the slab's cells give
            where = tuple(part if n > 1 else one for part, n, one in zip(slab, own, sided, strict=True))
            cells = tuple(part.stop - part.start for part in slab)
            shares = results[wanted[0]][where].size // math.prod(cells)
            part = list(engine.cut(rows, slab).values())
            told = None if progress is None else partial(_in_shares, progress, shares)
            found = _solve_slab(problem, cells, part, history, told)
            factors = engine.cut({"time_scale": factor}, where)["time_scale"]
            found = {name: values.reshape(cells) for name, values in found.items()}
            with np.errstate(over="ignore"):
                moved = {name: found[name] * factors**power for name, power in _POWERS.items() if name in results}
            for name, values in moved.items():
                flags = np.broadcast_to(found["validity"], values.shape)
                check_served(problem.model.g, engine.cut(arrays, where) | extremes, {name: values}, flags)
            for name, target in results.items():
                target[where] = moved.get(name, found[name])
    return results


def _in_shares(progress: Callable[[int], None], shares: int, cells: int) -> None:
    """Tell of cells solved, each of which gives several of the results."""
    progress(cells * shares)


def _solve_slab(
    problem: Problem,
    cells: tuple[int, ...],
    inputs: list[Array],
    history: History,
    progress: Callable[[int], None] | None,
) -> dict[str, np.ndarray]:
    """All results of some cells, each a row."""
    grid = engine.layout(cells, None, [*inputs, np.ones((1,) * len(cells))])
    rows, options, count = tuple(map(engine.flat, inputs)), problem.options(True), math.prod(cells)
    motion, counts = np.empty((len(_POWERS), count)), np.empty((len(RECORD_COUNTS), count), np.int32)
    validity = np.empty(count, np.int16)

    def work(first: int, last: int) -> None:
        RECORD_KERNEL(grid, first, last, rows, options, history, motion, counts, validity)
        if progress is not None:
            progress(last - first)

    threads.spread(count, work, _WORK_PER_CELL)
    return (
        dict(zip(_POWERS, motion, strict=True)) | dict(zip(RECORD_COUNTS, counts, strict=True)) | {"validity": validity}
    )


def _polarity(given: Any) -> Variable:
    """The signs asked for: 1, -1, both."""
    both = isinstance(given, str) and given == "both"
    try:
        values = check_numbers("polarity", (1, -1) if both else given)
    except InputError:
        values = np.empty(0)
    if values.ndim > 1 or not values.size or not np.isin(values, (1, -1)).all():
        raise InputError(f"polarity = {shown(given)}: must be 1, -1, a list of these, or 'both'")
    dims = ("polarity",) if values.ndim else ()
    return Variable(dims, values.astype(np.int8), PARAMETERS["polarity"])
