"""Variables with named dimensions in, variables out: how a grid is solved.

It is cut into tiles of some thousand cells.  The inputs of a tile are gathered by NumPy into an array of cells,
which a kernel solves (`slipsweep.grid.solvers`), on as many threads as there are; what it finds of a cell, in units of
phase, is spread over the frequencies of that cell: v = V/ω and u = W/ω² (the scaling law).
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.grid import solvers, threads
from slipsweep.grid.chunks import Chunk, grid_chunks, sizes_within, variables_within
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

#: Inputs or results by their names.
Variables: TypeAlias = Mapping[str, xr.Variable]


@dataclass(frozen=True)
class Request:
    """A grid, and the results wanted of it.

    `inputs` has `theta` (degrees), `mu_s`, the optional parameters and the strength and the time of the shaking: under
    a waveform `amplitude` or `displacement_amplitude`, and `frequency` (Hz); under records one of
    `variables.STRENGTHS`, `time_scale` and `polarity`, of a suite also the place of the `motion` in it, and of pairs
    `azimuth`.
    """

    problem: Problem
    sizes: Mapping[str, int]  # dimensions of the results, in their order, and their lengths
    inputs: Variables  # along some of these dimensions
    wanted: tuple[str, ...]  # names of results; nothing else is computed
    progress: Callable[[int], None] | None = None  # told of cells as they are finished, from any thread

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Types of what is wanted: float64 but for codes."""
        return {name: np.dtype(known.RESULT_DTYPES.get(name, "float64")) for name in self.wanted}

    @property
    def cells(self) -> int:
        """Number of cells of the grid."""
        return math.prod(self.sizes.values())

    def results(self) -> dict[str, xr.Variable]:
        """What is wanted, not filled in."""
        dims, shape = tuple(self.sizes), tuple(self.sizes.values())
        return {name: xr.Variable(dims, np.empty(shape, dtype)) for name, dtype in self.dtypes.items()}

    def count(self) -> None:
        """Report all cells as finished."""
        if self.progress is not None:
            self.progress(self.cells)

    def part(self, chunk: Chunk) -> "Request":
        """The same of a part of the grid."""
        return replace(self, sizes=sizes_within(chunk, self.sizes), inputs=variables_within(chunk, self.inputs))


def solve(request: Request) -> Variables:
    """Solve a grid for the results of a motion: those of `solvers.ROWS`.

    InputError: a result that has a value is beyond double precision.  RunError: an event was not found.
    """
    results, wants_peak = request.results(), "peak_relative_velocity" in request.wanted
    for where, part in motions(request):
        polarity = float(part.inputs["polarity"].values.item()) if "polarity" in part.inputs else 1.0
        _fill(variables_within(where, results), part, solvers.solver_of(part.problem, wants_peak, polarity))
    return results


def friction_parameters(request: Request, finite: bool = True) -> Variables:
    """Eqs. 7-11 and λ of every cell, `sliding_mode` and the validity known before the motion; no frequency.

    They are of a harmonic motion of that `amplitude`, whatever shakes the base.  Errors as of `solve`, but that
    estimates need not be `finite`.  A cell without a value has NaN.
    """
    request = replace(request, problem=replace(request.problem, excitation=Sine()))
    results = request.results()
    _fill(results, request, solvers.parameter_solver(request.problem), finite)
    for one in results.values():
        if one.dtype.kind == "f":
            one.values[np.isinf(one.values)] = math.nan
    return results


def amplitudes(request: Request) -> Variables:
    """The amplitude of every cell: A = ω²d under a waveform, the factor on the acceleration of a motion else."""
    results = request.results()
    for where, part in motions(request):
        for one in results.values():
            one[where] = cell_inputs(part.problem, part.inputs)["amplitude"]
        part.count()
    return results


def motions(request: Request) -> Iterator[tuple[Chunk, Request]]:
    """The parts of a grid that one motion shakes, and where in the grid they lie; under a waveform all of it.

    Of a suite each is under a record of its own, with which a solver goes on as if there were no other.
    """
    own = (request.inputs[name].sizes for name in _MOTIONS if name in request.inputs)
    varying = {str(dim): size for sizes in own for dim, size in sizes.items()}
    suite = request.problem.excitation
    for where in grid_chunks(varying, 1):
        part = request.part(where)
        if isinstance(suite, Suite):
            inputs = dict(part.inputs)
            motion, azimuth = inputs.pop("motion"), inputs.pop("azimuth", xr.Variable((), 0.0))
            record = suite.record(int(motion.values.item()), float(azimuth.values.item()))
            part = replace(part, problem=replace(part.problem, excitation=record), inputs=inputs)
        yield where, part


def cell_inputs(problem: Problem, inputs: Variables) -> dict[str, xr.Variable]:
    """The fields of `Cell` that are given; the amplitude is that of a waveform, or the factor on a record."""
    given: dict[str, Any] = dict(inputs)
    if isinstance(record := problem.excitation, Record):
        given["amplitude"] = strength_factor(record.times, record.acceleration, inputs)
    elif "displacement_amplitude" in inputs:
        given["amplitude"] = peak_acceleration(inputs["displacement_amplitude"], inputs["frequency"])
    if "yield_coefficient" in inputs:
        given["yield_acceleration"] = inputs["yield_coefficient"] * problem.model.g
    if "theta" in inputs:
        given["tan_theta"] = np.tan(np.radians(inputs["theta"]))
    return {name: given[name] for name in Cell._fields if name in given}


def phase_seconds(problem: Problem, inputs: Variables) -> xr.Variable:
    """Seconds that a unit of the kernels' phase takes: 1/ω, or the factor on the time of a record."""
    if isinstance(problem.excitation, Waveform):
        return 1.0 / (2.0 * math.pi * inputs["frequency"]) if "frequency" in inputs else xr.Variable((), 1.0)
    return inputs["time_scale"]


def _scaled_dimension(request: Request) -> str | None:
    """The longest dimension along which only the time of the shaking varies, which the scaling law serves."""
    in_time = {"frequency", "time_scale", "structure_frequency"}
    if {"displacement_amplitude", "pgv", "arias_intensity"} & request.inputs.keys():
        in_time = {"structure_frequency"}  # the frequency is in the amplitude, too
    others = {dim for name, one in request.inputs.items() if name not in in_time for dim in one.dims}
    only = {dim: size for dim, size in request.sizes.items() if dim not in others}
    return max(only, key=lambda dim: only[dim], default=None)


def _fill(results: Variables, request: Request, solver: solvers.Solver, finite: bool = True) -> None:
    """Fill in results, tile by tile."""
    scaled = _scaled_dimension(request)
    solved = {dim: size for dim, size in request.sizes.items() if dim != scaled}
    share = math.prod(solved.values()) // (8 * threads.thread_count())
    tile = max(min(max(share, _LEAST_TILE), _MOST_TILE) // solvers.cost_of(request.problem), 1)

    def work(chunk: Chunk) -> None:
        part = request.part(chunk)
        _fill_tile(variables_within(chunk, results), part, scaled, solver, finite)
        part.count()

    threads.spread(list(grid_chunks(solved, tile)), work)


def _fill_tile(results: Variables, request: Request, scaled: str | None, solver: solvers.Solver, finite: bool) -> None:
    """Solve the cells of a tile, in all its dimensions but the scaled one, and spread them over the results."""
    dims = tuple(request.sizes)
    shape = tuple(1 if dim == scaled else size for dim, size in request.sizes.items())
    cells = np.full((*shape, len(Cell._fields)), math.nan).view(CELL)[..., 0]
    with np.errstate(all="ignore"):  # results that overflow are refused below
        for name, one in cell_inputs(request.problem, request.inputs).items():
            cells[name] = one.set_dims(dims).values
        found = np.empty((1 + max(solver.rows.values()), cells.size))
        solver.solve(cells.reshape(-1), found)
        validity = found[solver.rows["validity"]].reshape(shape).astype(np.int16)
        if (validity & UNSOLVED).any():
            why = "an event of the motion was not found; please report this cell, with the options of the run"
            raise RunError(f"{_inputs_at(validity & UNSOLVED != 0, request)}: {why}")
        valued = validity & np.int16(known.VALUELESS) == 0
        seconds = phase_seconds(request.problem, request.inputs).set_dims(dims).values
        for name, result in results.items():
            own, factor = found[solver.rows[name]].reshape(shape), seconds ** _POWERS.get(name, 0)
            target = np.multiply(own, factor, out=result.data, casting="unsafe")
            largest = np.abs(own[valued]).max(initial=0.0) if target.dtype.kind == "f" else 0.0
            if finite and not math.isfinite(largest * factor.max()) and (wrong := valued & ~np.isfinite(target)).any():
                why = f"{name} is then no finite number in double precision; must be nearer to 1"
                raise InputError(f"{_inputs_at(wrong, request)}: {why}")
    if "structure_frequency" in request.inputs and "validity" in results:
        # a block that is not rigid, 0.2 ≤ f/fs ≤ 1.3
        ratio = request.inputs["frequency"] / request.inputs["structure_frequency"]
        flexible = ((ratio >= 0.2) & (ratio <= 1.3)).set_dims(dims).values
        results["validity"].data |= flexible * np.int16(known.Validity.FLEXIBLE_BLOCK)


def _inputs_at(wrong: NDArray[np.bool_], request: Request) -> str:
    """The inputs of the first cell that is wrong, in words."""
    shape = tuple(request.sizes.values())
    place = np.unravel_index(int(np.broadcast_to(wrong, shape).argmax()), shape)
    cell = dict(zip(request.sizes, place, strict=True))
    inputs = {name: float(one.isel(cell, missing_dims="ignore")) for name, one in request.inputs.items()}
    inputs["g"] = request.problem.model.g
    return ", ".join(f"{name} = {number_text(value)}" for name, value in inputs.items())
