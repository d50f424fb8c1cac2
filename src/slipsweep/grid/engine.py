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
from slipsweep.grid.inputs import Problem
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

#: Powers of 1/ω, or of the factor on a record's time, in results; others do not scale with the time.
_POWERS = {"permanent_displacement": 2, "newmark_displacement": 2, "peak_relative_velocity": 1}

#: Inputs that make another motion of the base, hence another table of pieces.
_MOTIONS = ("motion", "azimuth", "polarity")

Array = NDArray[np.float64]

#: Results by their names.
Arrays: TypeAlias = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Request:
    """A grid, and the results wanted of it.

    `arrays` has `theta` (degrees), `mu_s`, the optional parameters and the strength and the time of the shaking: under
    a waveform `amplitude` or `displacement_amplitude`, and `frequency` (Hz); under records one of
    `variables.STRENGTHS`, `time_scale` and `polarity`, of a suite also the place of the `motion` in it, and of pairs
    `azimuth`.
    """

    problem: Problem
    shape: tuple[int, ...]  # of the results
    arrays: Mapping[str, Array]  # of as many dimensions, of length 1 where they do not vary
    wanted: tuple[str, ...]  # names of results; nothing else is computed
    progress: Callable[[int], None] | None = None  # told of cells as they are finished, from any thread

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Types of what is wanted: float64 but for codes."""
        return {name: np.dtype(known.RESULT_DTYPES.get(name, "float64")) for name in self.wanted}

    def results(self) -> Arrays:
        """Arrays for what is wanted, not filled in."""
        return {name: np.empty(self.shape, dtype) for name, dtype in self.dtypes.items()}

    def count(self, cells: int) -> None:
        """Report progress."""
        if self.progress is not None:
            self.progress(cells)

    def part(self, where: tuple[slice, ...]) -> "Request":
        """The same of a part of the grid: arrays cut along the dimensions in which they vary."""
        arrays: dict[str, Array] = {}
        for name, values in self.arrays.items():
            own: Any = (cut if size > 1 else slice(None) for cut, size in zip(where, values.shape, strict=True))
            arrays[name] = values[(*own, ...)]
        shape = tuple(len(range(*cut.indices(size))) for cut, size in zip(where, self.shape, strict=True))
        return replace(self, shape=shape, arrays=arrays)


def solve(request: Request) -> Arrays:
    """Solve a grid for the results of a motion: those of `solvers.ROWS`.

    InputError: a result that has a value is beyond double precision.  RunError: an event was not found.
    """
    results, wants_peak = request.results(), "peak_relative_velocity" in request.wanted
    for where, part in motions(request):
        polarity = float(part.arrays["polarity"].item()) if "polarity" in part.arrays else 1.0
        _fill(_views(results, where), part, solvers.solver_of(part.problem, wants_peak, polarity))
    return results


def friction_parameters(request: Request, finite: bool = True) -> Arrays:
    """Eqs. 7-11 and λ of every cell, `sliding_mode` and the validity known before the motion; no frequency.

    They are of a harmonic motion of that `amplitude`, whatever shakes the base.  Errors as of `solve`, but that
    estimates need not be `finite`.  A cell without a value has NaN.
    """
    request = replace(request, problem=replace(request.problem, excitation=Sine()))
    results = request.results()
    _fill(results, request, solvers.parameter_solver(request.problem), finite)
    for values in results.values():
        if values.dtype.kind == "f":
            values[np.isinf(values)] = math.nan
    return results


def amplitudes(request: Request) -> Arrays:
    """The amplitude of every cell: A = ω²d under a waveform, the factor on the acceleration of a motion else."""
    results = request.results()
    for where, part in motions(request):
        for values in results.values():
            values[where] = cell_inputs(part.problem, part.arrays)["amplitude"]
        request.count(math.prod(part.shape))
    return results


def motions(request: Request) -> Iterator[tuple[tuple[slice, ...], Request]]:
    """The parts of a grid that one motion shakes, and where in the grid they lie; under a waveform all of it.

    Of a suite each is under a record of its own, with which a solver goes on as if there were no other.
    """
    own = [request.arrays[name].shape for name in _MOTIONS if name in request.arrays]
    varying, suite = np.broadcast_shapes((1,) * len(request.shape), *own), request.problem.excitation
    for side in np.ndindex(varying):
        where = tuple(slice(at, at + 1) if n > 1 else slice(None) for at, n in zip(side, varying, strict=True))
        part = request.part(where)
        if isinstance(suite, Suite):
            arrays = dict(part.arrays)
            motion, azimuth = arrays.pop("motion"), arrays.pop("azimuth", np.zeros(1))
            record = suite.record(int(motion.item()), float(azimuth.item()))
            part = replace(part, problem=replace(part.problem, excitation=record), arrays=arrays)
        yield where, part


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
        return 1.0 / (2.0 * math.pi * arrays["frequency"]) if "frequency" in arrays else np.ones(())
    return arrays["time_scale"]


def _scaled_dimension(request: Request) -> int | None:
    """The longest dimension along which only the time of the shaking varies, which the scaling law serves."""
    in_time = {"frequency", "time_scale", "structure_frequency"}
    if {"displacement_amplitude", "pgv", "arias_intensity"} & request.arrays.keys():
        in_time = {"structure_frequency"}  # the frequency is in the amplitude, too
    others = [values.shape for name, values in request.arrays.items() if name not in in_time]
    only = [n if all(own[axis] == 1 for own in others) else 1 for axis, n in enumerate(request.shape)]
    return only.index(max(only)) if max(only, default=1) > 1 else None


def _views(results: Arrays, where: tuple[slice, ...]) -> Arrays:
    """A part of results, to be filled in."""
    place: Any = (*where, ...)  # the dots keep an array without dimensions an array
    return {name: values[place] for name, values in results.items()}


def _fill(results: Arrays, request: Request, solver: solvers.Solver, finite: bool = True) -> None:
    """Fill in results, tile by tile."""
    scaled = _scaled_dimension(request)
    cell_shape = tuple(1 if axis == scaled else size for axis, size in enumerate(request.shape))
    share = math.prod(cell_shape) // (8 * threads.thread_count())
    tile = max(min(max(share, _LEAST_TILE), _MOST_TILE) // solvers.cost_of(request.problem), 1)

    def work(slab: tuple[slice, ...]) -> None:
        where = tuple(slice(None) if axis == scaled else own for axis, own in enumerate(slab))
        part, cells = request.part(where), [own.stop - own.start for own in slab]
        _fill_tile(_views(results, where), part, tuple(cells), solver, finite)
        request.count(math.prod(part.shape))

    threads.spread(list(slabs(cell_shape, tile)), work)


def _fill_tile(results: Arrays, request: Request, shape: tuple[int, ...], solver: solvers.Solver, finite: bool) -> None:
    """Solve the cells of a tile, in all its dimensions but the scaled one, and spread them over the results."""
    cells = np.full((*shape, len(Cell._fields)), math.nan).view(CELL)[..., 0]
    with np.errstate(all="ignore"):  # results that overflow are refused below
        for name, values in cell_inputs(request.problem, request.arrays).items():
            cells[name] = values
        found = np.empty((1 + max(solver.rows.values()), cells.size))
        solver.solve(cells.reshape(-1), found)
        validity = found[solver.rows["validity"]].reshape(shape).astype(np.int16)
        if (validity & UNSOLVED).any():
            why = "an event of the motion was not found; please report this cell, with the options of the run"
            raise RunError(f"{_inputs_at(validity & UNSOLVED != 0, request)}: {why}")
        valued = validity & np.int16(known.VALUELESS) == 0
        seconds = phase_seconds(request.problem, request.arrays)
        for name, target in results.items():
            own, factor = found[solver.rows[name]].reshape(shape), seconds ** _POWERS.get(name, 0)
            np.multiply(own, factor, out=target, casting="unsafe")
            largest = np.abs(own[valued]).max(initial=0.0) if target.dtype.kind == "f" else 0.0
            if finite and not math.isfinite(largest * factor.max()) and (wrong := valued & ~np.isfinite(target)).any():
                why = f"{name} is then no finite number in double precision; must be nearer to 1"
                raise InputError(f"{_inputs_at(wrong, request)}: {why}")
    if "structure_frequency" in request.arrays and "validity" in results:
        # a block that is not rigid, 0.2 ≤ f/fs ≤ 1.3
        ratio = request.arrays["frequency"] / request.arrays["structure_frequency"]
        results["validity"] |= ((ratio >= 0.2) & (ratio <= 1.3)) * np.int16(known.Validity.FLEXIBLE_BLOCK)


def _inputs_at(wrong: NDArray[np.bool_], request: Request) -> str:
    """The inputs of the first cell that is wrong, in words."""
    cell = np.unravel_index(int(np.broadcast_to(wrong, request.shape).argmax()), request.shape)
    inputs = {name: float(np.broadcast_to(one, request.shape)[cell]) for name, one in request.arrays.items()}
    inputs["g"] = request.problem.model.g
    return ", ".join(f"{name} = {number_text(value)}" for name, value in inputs.items())
