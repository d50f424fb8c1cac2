"""A recorded motion over a grid of blocks: parameters in, a table out.

A sweep over θ × μs × (given parameters) × scale goes through one kernel for each polarity;
the factor on time needs none: everything depends on time only through t / time_scale, so that
v ∝ time_scale and u ∝ time_scale², exactly.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from slipsweep import engine, threads
from slipsweep.errors import InputError
from slipsweep.kernels.record import RECORD_KERNEL, History
from slipsweep.plans import aligned, check_memory, check_options, checked, grid_sizes, record_attributes
from slipsweep.records import Record
from slipsweep.tables import Table, Variable
from slipsweep.variables import PARAMETERS, RECORD_COUNTS, RECORD_PARAMETERS, RESULTS

#: Parameters of the block that a record may be swept over, those of `sweep` but for amplitude and frequency.
BLOCK_PARAMETERS = ("theta", "mu_s", "yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")

#: What a cell of a record takes, in cells of the cycle solver: some 2 µs against 0.1.
_WORK_PER_CELL = 32


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


def record_table(
    record: Record,
    *,
    model: str,
    rise: str,
    recoupling: str,
    g: float,
    progress: Callable[[int], None] | None = None,
    **given: Any,
) -> Table:
    """The response of every block of a grid to a record; keyword arguments, results and errors of `sweep_record`."""
    if not isinstance(record, Record):
        raise InputError(f"record = {record!r}: must be a Record (slipsweep.read_record, slipsweep.Record)")
    problem = check_options(model=model, rise=rise, recoupling=recoupling, g=g)
    polarity = _polarity(given.pop("polarity"))
    known = PARAMETERS | RECORD_PARAMETERS
    coords = checked({name: values for name, values in given.items() if values is not None}, known)
    for name in ("scale", "time_scale"):
        if coords[name].values.ndim > 1:
            raise InputError(f"{name}: an array of {coords[name].values.ndim} dimensions; must be a scalar or 1-D")
    if model == "newmark":
        for name in ("decay_rate", "delta_mu", "minimum_friction"):
            if name in coords:
                raise InputError(f"{name}: not allowed with model = 'newmark', which has no friction law")
    solved = {name: variable for name, variable in coords.items() if name != "time_scale"}
    sizes = grid_sizes(solved)
    all_sizes = grid_sizes(coords) | polarity.sizes
    count = math.prod(all_sizes.values())
    check_memory(all_sizes, count * (2 * 8 + len(RECORD_COUNTS) * 4 + 2))

    inputs = aligned(solved, sizes)
    inputs["amplitude"] = inputs.pop("scale")
    rows = engine.cell_inputs(inputs, len(sizes))
    grid = engine.layout(tuple(sizes.values()), None, [*rows, np.ones((1,) * len(sizes))])
    flat, options = tuple(map(engine.flat, rows)), problem.options(True)

    def solve(side: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The record with a polarity: displacements and velocities, counts, flags."""
        history = history_of(record, side)
        cells = math.prod(sizes.values())
        motion, counts = np.empty((2, cells)), np.empty((len(RECORD_COUNTS), cells), np.int32)
        validity = np.empty(cells, np.int16)

        def work(first: int, last: int) -> None:
            RECORD_KERNEL(grid, first, last, flat, options, history, motion, counts, validity)
            if progress is not None:
                progress(last - first)

        threads.spread(cells, work, _WORK_PER_CELL)
        return motion, counts, validity

    parts = [solve(float(side)) for side in np.atleast_1d(polarity.values)]
    factor = coords["time_scale"]
    stretched = {
        "permanent_displacement": (np.stack([p[0][0] for p in parts], -1), 2),
        "peak_relative_velocity": (np.stack([p[0][1] for p in parts], -1), 1),
    }
    whole = {name: np.stack([p[1][at] for p in parts], -1) for at, name in enumerate(RECORD_COUNTS)}
    whole["validity"] = np.stack([p[2] for p in parts], -1)

    # the cells' own dimensions, then time_scale, then polarity
    def laid_out(values: np.ndarray, power: int) -> np.ndarray:
        values = values.reshape(*sizes.values(), 1, values.shape[-1])
        values = values * np.atleast_1d(factor.values)[:, None] ** power if power else values
        shape = (*sizes.values(), *factor.values.shape, *polarity.values.shape)
        target = np.broadcast_to(values, (*sizes.values(), max(factor.values.size, 1), values.shape[-1]))
        return np.ascontiguousarray(target).reshape(shape)

    dims = (*sizes, *factor.dims, *polarity.dims)
    attributes: Mapping[str, Mapping[str, Any]] = RESULTS | RECORD_COUNTS
    results = {name: laid_out(values, power) for name, (values, power) in stretched.items()}
    results |= {name: laid_out(values, 0) for name, values in whole.items()}
    data = {name: Variable(dims, values, attributes[name]) for name, values in results.items()}
    return Table(coords | {"polarity": polarity}, data, record_attributes(problem, record.name, record.attrs))


def _polarity(given: Any) -> Variable:
    """The signs asked for: 1, -1, both."""
    values = np.array([1.0, -1.0]) if isinstance(given, str) and given == "both" else np.asarray(given)
    if values.dtype.kind not in "if" or values.ndim > 1 or not values.size or not np.isin(values, (1, -1)).all():
        raise InputError(f"polarity = {given!r}: must be 1, -1, a list of these, or 'both'")
    dims = ("polarity",) if values.ndim else ()
    return Variable(dims, values.astype(np.int8), RECORD_PARAMETERS["polarity"])
