"""Arrays in, arrays out: the sweep without labels.

A grid is cut into tiles of some thousand cells.  The inputs of a tile are gathered by NumPy into an array of cells,
which a kernel solves (`slipsweep.grid.solvers`), on as many threads as there are; what it finds of a cell, in units of
phase, is spread over the frequencies of that cell: v = V/ω and u = W/ω² (the scaling law).
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.grid import solvers, threads
from slipsweep.grid.chunks import slabs
from slipsweep.grid.problem import Problem
from slipsweep.kernels.block import UNSOLVED, Cell
from slipsweep.kernels.grid import CELL
from slipsweep.model import variables as known
from slipsweep.model.parameters import number_text
from slipsweep.motion.intensity import strength_factor
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Sine, Waveform, peak_acceleration

#: Cells that a kernel solves in a call, at least and at most: so many that Python's part is small, so few that Ctrl-C
#: is heard between two calls.
_LEAST_TILE, _MOST_TILE = 16384, 65536

#: Powers of 1/ω, or of the factor on a record's time, in results.
_POWERS = {"permanent_displacement": 2, "newmark_displacement": 2, "peak_relative_velocity": 1}

#: Inputs that make another motion of the base, hence another table of pieces.
_MOTIONS = ("motion", "azimuth", "polarity")

Array = NDArray[np.float64]

#: Results by their names.
Arrays: TypeAlias = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Request:
    """A grid: its inputs, and the results wanted of it.

    Attributes
    ----------
    problem : Problem
        What all cells share.
    shape : tuple of int
        Shape of the results.
    arrays : mapping of str to array
        `theta` (degrees), `mu_s`, the optional parameters and the strength and the time of the shaking: under a
        waveform `amplitude` or `displacement_amplitude`, and `frequency` (Hz); under records one of
        `variables.STRENGTHS`, `time_scale` and `polarity`, of a suite also the place of the `motion` in it, and of
        pairs `azimuth`.  Each has as many dimensions as `shape`, of length 1 where it does not vary.
    wanted : tuple of str
        Names of results; nothing else is computed.
    progress : callable, optional
        Called with a number of result cells as they are finished, from any thread.
    """

    problem: Problem
    shape: tuple[int, ...]
    arrays: Mapping[str, Array]
    wanted: tuple[str, ...]
    progress: Callable[[int], None] | None = None

    def results(self) -> Arrays:
        """Arrays for what is wanted, not filled in: of `shape`, float64 but for codes (`variables.RESULT_DTYPES`)."""
        return {name: np.empty(self.shape, known.RESULT_DTYPES.get(name, "float64")) for name in self.wanted}

    def count(self, cells: int) -> None:
        """Report progress."""
        if self.progress is not None:
            self.progress(cells)

    def part(self, where: tuple[slice, ...]) -> "Request":
        """The same of a part of the grid."""
        shape = tuple(len(range(*own.indices(size))) for own, size in zip(where, self.shape, strict=True))
        return replace(self, shape=shape, arrays=cut(self.arrays, where))


def solve(request: Request) -> Arrays:
    """Solve a grid for the results of a motion: those of `solvers.ROWS`.

    Raises
    ------
    InputError
        A result that has a value is beyond double precision.
    RunError
        An event of the motion was not found.
    """
    results, wants_peak = request.results(), "peak_relative_velocity" in request.wanted
    for where, part in motions(request):
        polarity = float(part.arrays["polarity"].item()) if "polarity" in part.arrays else 1.0
        solve_cells, cost = solvers.solver_of(part.problem, wants_peak, polarity)
        _fill(_views(results, where), part, solve_cells, solvers.ROWS, cost)
    return results


def friction_parameters(request: Request, finite: bool = True) -> Arrays:
    """Eqs. 7-11 and λ of every cell, `sliding_mode` and the validity known before the motion; no frequency.

    They are of a harmonic motion of that `amplitude`, whatever shakes the base.  Errors as of `solve`; unless results
    are to be `finite`, estimates that are no numbers are given as they are.
    """
    request = replace(request, problem=replace(request.problem, excitation=Sine()))
    results = request.results()
    _fill(results, request, solvers.find_friction_parameters(request.problem), solvers.PARAMETER_ROWS, 1, finite)
    for values in results.values():
        if finite and values.dtype.kind == "f":
            values[np.isinf(values)] = math.nan  # of a cell without a value
    return results


def factors(request: Request) -> Arrays:
    """The factor on the acceleration of every motion, whatever says how strong it is."""
    results = request.results()
    for where, part in motions(request):
        record = part.problem.excitation
        assert isinstance(record, Record)
        for values in results.values():
            values[where] = strength_factor(record, part.arrays)
        request.count(math.prod(part.shape))
    return results


def amplitudes(request: Request) -> Arrays:
    """The amplitude A = ω²d of every cell."""
    results = request.results()
    for values in results.values():
        np.copyto(values, peak_acceleration(request.arrays["displacement_amplitude"], request.arrays["frequency"]))
    request.count(math.prod(request.shape))
    return results


def motions(request: Request) -> Iterator[tuple[tuple[slice, ...], Request]]:
    """The parts of a grid that one motion shakes, and where in the grid they lie; under a waveform all of it.

    Of a suite each is under a record of its own, with which a solver goes on as if there were no other.
    """
    own = [request.arrays[name].shape for name in _MOTIONS if name in request.arrays]
    varying = np.broadcast_shapes((1,) * len(request.shape), *own)
    for side in np.ndindex(varying):
        where = tuple(slice(at, at + 1) if n > 1 else slice(None) for at, n in zip(side, varying, strict=True))
        yield where, _under_one(request.part(where))


def _under_one(part: Request) -> Request:
    """A part that one motion of a suite shakes, under the record of that motion."""
    suite = part.problem.excitation
    if not isinstance(suite, Suite):
        return part
    arrays = dict(part.arrays)
    motion, azimuth = arrays.pop("motion"), arrays.pop("azimuth", np.zeros(1))
    record = suite.record(int(motion.item()), float(azimuth.item()))
    return replace(part, problem=replace(part.problem, excitation=record), arrays=arrays)


def cell_inputs(problem: Problem, arrays: Mapping[str, Array]) -> dict[str, Array]:
    """The fields of `Cell` that are given, of arrays that broadcast to each other.

    The amplitude is that of a waveform, or the factor on a record.
    """
    given = dict(arrays)
    if isinstance(problem.excitation, Record):
        given["amplitude"] = strength_factor(problem.excitation, arrays)
    elif "displacement_amplitude" in arrays:
        given["amplitude"] = peak_acceleration(arrays["displacement_amplitude"], arrays["frequency"])
    if "yield_coefficient" in arrays:
        given["yield_acceleration"] = arrays["yield_coefficient"] * problem.model.g
    if "theta" in arrays:
        given["tan_theta"] = np.tan(np.radians(arrays["theta"]))
    return {name: given[name] for name in Cell._fields if name in given}


def phase_seconds(problem: Problem, arrays: Mapping[str, Array]) -> Array:
    """Seconds that a unit of the kernels' phase takes: 1/ω, or the factor on the time of a record."""
    if isinstance(problem.excitation, Waveform):
        return 1.0 / (2.0 * math.pi * arrays["frequency"]) if "frequency" in arrays else np.ones(1)
    return arrays["time_scale"]


def cut(arrays: Mapping[str, Array], slices: tuple[slice, ...]) -> dict[str, Array]:
    """A part of a grid: `arrays` cut along the dimensions in which they vary."""
    parts: dict[str, Array] = {}
    for name, values in arrays.items():
        where: Any = (part if size > 1 else slice(None) for part, size in zip(slices, values.shape, strict=True))
        parts[name] = values[(*where, ...)]
    return parts


def scaled_dimension(request: Request) -> int | None:
    """The longest dimension along which only the time of the shaking varies, which the scaling law serves."""
    in_time = {"frequency", "time_scale", "structure_frequency"}
    if {"displacement_amplitude", "pgv", "arias_intensity"} & request.arrays.keys():
        in_time = {"structure_frequency"}  # the frequency is in the amplitude, too
    others = [values for name, values in request.arrays.items() if name not in in_time]
    only = [
        axis
        for axis, size in enumerate(request.shape)
        if size > 1 and all(values.shape[axis] == 1 for values in others)
    ]
    return max(only, key=lambda axis: request.shape[axis]) if only else None


def _views(results: Arrays, where: tuple[slice, ...]) -> Arrays:
    """A part of results, to be filled in."""
    place: Any = (*where, ...)  # the dots keep an array without dimensions an array
    return {name: values[place] for name, values in results.items()}


def _fill(
    results: Arrays,
    request: Request,
    solve_cells: solvers.Solve,
    rows: Mapping[str, int],
    cost: int,
    finite: bool = True,
) -> None:
    """Fill in results, tile by tile, by what finds these rows of a cell in `cost` times the time of a sine's."""
    scaled = scaled_dimension(request)
    cell_shape = tuple(1 if axis == scaled else size for axis, size in enumerate(request.shape))
    share = math.prod(cell_shape) // (8 * threads.thread_count())
    tile = max(min(max(share, _LEAST_TILE), _MOST_TILE) // cost, 1)
    tiles = list(slabs(cell_shape, tile))

    def work(slab: tuple[slice, ...]) -> None:
        where = tuple(slice(None) if axis == scaled else own for axis, own in enumerate(slab))
        shape = tuple(len(range(*own.indices(size))) for own, size in zip(slab, cell_shape, strict=True))
        part = request.part(where)
        _fill_tile(_views(results, where), part, shape, solve_cells, rows, finite)
        part.count(math.prod(part.shape))

    if math.prod(request.shape):
        # what a first call compiles is compiled once, before the threads
        solve_cells(np.empty(0, CELL), np.empty((1 + max(rows.values()), 0)))
        threads.spread(tiles, work)


def _fill_tile(
    results: Arrays,
    request: Request,
    shape: tuple[int, ...],
    solve_cells: solvers.Solve,
    rows: Mapping[str, int],
    finite: bool,
) -> None:
    """Solve the cells of a tile, in all its dimensions but the scaled one, and spread them over the results."""
    cells = np.full((*shape, len(Cell._fields)), math.nan).view(CELL)[..., 0]
    with np.errstate(all="ignore"):  # results that overflow are refused below
        for name, values in cell_inputs(request.problem, request.arrays).items():
            cells[name] = values
        found = np.empty((1 + max(rows.values()), cells.size))
        solve_cells(cells.reshape(-1), found)
        validity = found[rows["validity"]].reshape(shape).astype(np.int16)
        if (validity & UNSOLVED).any():
            _refuse_unsolved(validity, request)
        valued = validity & np.int16(known.VALUELESS) == 0
        seconds = phase_seconds(request.problem, request.arrays)
        for name, target in results.items():
            own, factor = found[rows[name]].reshape(shape), seconds ** _POWERS.get(name, 0)
            if name in _POWERS:
                np.multiply(own, factor, out=target)
            else:
                np.copyto(target, own, casting="unsafe")
            largest = np.abs(own[valued]).max(initial=0.0) if target.dtype.kind == "f" else 0.0
            if finite and not math.isfinite(largest * factor.max()):
                _refuse_infinite(name, target, valued, request)
    if "structure_frequency" in request.arrays and "validity" in results:
        # a block that is not rigid, 0.2 ≤ f/fs ≤ 1.3
        ratio = request.arrays["frequency"] / request.arrays["structure_frequency"]
        results["validity"] |= ((ratio >= 0.2) & (ratio <= 1.3)) * np.int16(known.Validity.FLEXIBLE_BLOCK)


def _inputs_at(request: Request, cell: Any) -> str:
    """The inputs of a cell in words."""
    inputs = {name: float(np.broadcast_to(one, request.shape)[cell]) for name, one in request.arrays.items()}
    inputs["g"] = request.problem.model.g
    return ", ".join(f"{name} = {number_text(value)}" for name, value in inputs.items())


def _refuse_unsolved(validity: NDArray[np.int16], request: Request) -> None:
    """Say which cell a kernel could not solve."""
    wrong = np.broadcast_to(validity & UNSOLVED != 0, request.shape)
    cell = np.unravel_index(int(wrong.argmax()), wrong.shape)
    raise RunError(
        f"{_inputs_at(request, cell)}: an event of the motion was not found; please report this cell, with the "
        "options of the run"
    )


def _refuse_infinite(name: str, values: Array, valued: NDArray[np.bool_], request: Request) -> None:
    """Say which cell has a result that is no finite number, if there is one."""
    wrong = valued & ~np.isfinite(values)
    if wrong.any():
        cell = np.unravel_index(int(wrong.argmax()), wrong.shape)
        raise InputError(
            f"{_inputs_at(request, cell)}: {name} is then no finite number in double precision; must be nearer to 1"
        )
