"""Solution of a grid: variables with named dimensions in, variables out.

A grid is cut into tiles of up to some ten thousand cells, which threads solve.  NumPy gathers the
inputs of a tile into an array of cells, and a kernel solves it (`slipsweep.grid.solvers`).  The
results of the kernel are in units of phase; the scaling law, v = V/ω and u = W/ω², gives those at
all frequencies of a cell.
"""

import math
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.grid import solvers, threads
from slipsweep.grid.chunks import Chunk, grid_chunks, sizes_within, variables_within
from slipsweep.grid.flexible import flag_flexible_blocks
from slipsweep.grid.inputs import Problem
from slipsweep.kernels.block import UNSOLVED, Cell
from slipsweep.kernels.step_cells import STRENGTH_FIELDS
from slipsweep.model import variables
from slipsweep.model.options import changing_strength, slides_both_ways
from slipsweep.model.parameters import number_text
from slipsweep.motion.intensity import strength_factor
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Sine, Waveform, peak_acceleration

#: Least and largest number of cells that a kernel solves in a call.  With fewer the time of Python
#: counts; with more Ctrl-C, which is heard between two calls, is heard late.
_LEAST_TILE = 16384
_MOST_TILE = 32768

#: Powers of 1/ω, or of the factor on a record's time, by which results scale; others do not.
_POWERS = {
    "permanent_displacement": 2,
    "newmark_displacement": 2,
    **dict.fromkeys(variables.BOTH_WAYS, 2),
    "peak_relative_velocity": 1,
}

#: Inputs or results by their names.
Variables: TypeAlias = Mapping[str, xr.Variable]


@dataclass(frozen=True)
class Request:
    """A grid, and the results that are requested.

    `inputs` has `theta` (degrees), `mu_s`, the optional parameters and the strength and the time of
    the shaking: under a waveform `amplitude` or `displacement_amplitude`, and `frequency` (Hz);
    under records one of `variables.STRENGTHS`, `time_scale` and `polarity`, of a suite also the
    place of the `motion` in it, and of pairs `azimuth`.
    """

    problem: Problem
    sizes: Mapping[str, int]  # dimensions of the results, in their order, and their lengths
    inputs: Variables  # along some of these dimensions
    names: tuple[str, ...]  # of results; nothing else is computed
    #: Called with a number of cells as they are finished, from any thread.
    progress: Callable[[int], None] | None = None

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Types of the results: float64, but for codes."""
        return {name: np.dtype(variables.RESULT_DTYPES.get(name, "float64")) for name in self.names}

    @property
    def cells(self) -> int:
        """Number of cells of the grid."""
        return math.prod(self.sizes.values())

    def results(self) -> dict[str, xr.Variable]:
        """Allocate the requested results."""
        dims = tuple(self.sizes)
        shape = tuple(self.sizes.values())
        return {
            name: xr.Variable(dims, np.empty(shape, dtype)) for name, dtype in self.dtypes.items()
        }

    def count(self, cells: int) -> None:
        """Report cells as finished."""
        if self.progress is not None:
            self.progress(cells)

    def part(self, chunk: Chunk) -> "Request":
        """Return the request for a part of the grid."""
        return replace(
            self, sizes=sizes_within(chunk, self.sizes), inputs=variables_within(chunk, self.inputs)
        )


def solve(request: Request) -> Variables:
    """Solve a grid for results of the motion, those of `solvers.ROWS`.

    InputError: a result is beyond double precision.  RunError: an event was not found.
    """
    results = request.results()
    wants_peak = "peak_relative_velocity" in request.names
    for where, part in motions(request):
        polarity = (
            float(part.inputs["polarity"].values.item()) if "polarity" in part.inputs else 1.0
        )
        _fill(
            variables_within(where, results),
            part,
            solvers.solver_of(part.problem, wants_peak, polarity),
        )
    return results


def friction_parameters(request: Request, finite: bool = True) -> Variables:
    """Return Eqs. 7-11 and λ of every cell, `sliding_mode`, and the flags known before the motion.

    They do not depend on the frequency.  They are those of a harmonic motion of that `amplitude`,
    whatever shakes the base.  Errors are those of `solve`; with `finite` False an estimate may
    exceed double precision.  A cell without a value has NaN.
    """
    request = replace(request, problem=replace(request.problem, excitation=Sine()))
    results = request.results()
    _fill(results, request, solvers.parameter_solver(request.problem), finite)
    for result in results.values():
        if result.dtype.kind == "f":
            result.values[np.isinf(result.values)] = math.nan
    return results


def amplitudes(request: Request) -> Variables:
    """Return the amplitude of every cell: A = ω²d of a waveform, or the factor on a record."""
    results = request.results()
    for where, part in motions(request):
        for result in results.values():
            result[where] = motion_factor(part.problem, part.inputs)
        part.count(part.cells)
    return results


def motions(request: Request) -> Iterator[tuple[Chunk, Request]]:
    """Yield the parts of a grid that one motion shakes, each after its place in the grid.

    Under a waveform the whole grid is one part.  A part of a suite has its record as excitation, so
    that a solver sees one record only.
    """
    suite = request.problem.excitation
    if isinstance(suite, Waveform):
        yield {}, request
        return
    varying: dict[str, int] = {}
    for name in ("motion", "azimuth", "polarity"):
        if name in request.inputs:
            sizes = request.inputs[name].sizes
            varying |= {str(dim): size for dim, size in sizes.items()}
    for where in grid_chunks(varying, 1):
        part = request.part(where)
        if isinstance(suite, Suite):
            inputs = dict(part.inputs)
            motion = inputs.pop("motion")
            azimuth = inputs.pop("azimuth", xr.Variable((), 0.0))
            record = suite.record(int(motion.values.item()), float(azimuth.values.item()))
            part = replace(part, problem=replace(part.problem, excitation=record), inputs=inputs)
        yield where, part


def cell_inputs(problem: Problem, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a cell that are given, from variables or arrays that broadcast.

    θ becomes tan θ.  Under a record A is the factor on its acceleration.  A block that slides both
    ways also has its upslope yield acceleration.  A block whose strength changes has the parameters
    of the change, and the seconds in a unit of phase.
    """
    values = dict(inputs)
    if isinstance(problem.excitation, Record) or "displacement_amplitude" in inputs:
        values["amplitude"] = motion_factor(problem, inputs)
    if "yield_coefficient" in inputs:
        values["yield_acceleration"] = inputs["yield_coefficient"] * problem.model.g
    if "theta" in inputs:
        values["tan_theta"] = np.tan(np.radians(inputs["theta"]))
    fields = {name: values[name] for name in Cell._fields if name in values}
    if changing_strength(problem.model) is not None:
        fields |= {name: values[name] for name in STRENGTH_FIELDS if name in values}
        fields["seconds"] = phase_seconds(problem, inputs)
    if slides_both_ways(problem.model):
        fields["upslope_yield_acceleration"] = upslope_yield_acceleration(values, problem.model.g)
    return fields


def motion_factor(problem: Problem, inputs: Mapping[str, Any]) -> Any:
    """Return A of a waveform, m/s², or the factor on the acceleration of a record."""
    if isinstance(record := problem.excitation, Record):
        return strength_factor(record.times, record.acceleration, inputs)
    if "displacement_amplitude" in inputs:
        return peak_acceleration(inputs["displacement_amplitude"], inputs["frequency"])
    return inputs["amplitude"]


def upslope_yield_acceleration(values: Mapping[str, Any], g: float) -> Any:
    """Return Üy,up, given or by statics; infinite where no acceleration moves the block upslope.

    By statics it is g tan(φs + θ), and from a given Üy g tan(arctan(Üy/g) + 2θ).
    """
    if "upslope_yield_acceleration" in values:
        return values["upslope_yield_acceleration"]
    tan_theta = values["tan_theta"]
    if "yield_acceleration" in values:
        onset = values["yield_acceleration"]
        cosine = 1.0 - tan_theta * tan_theta  # of 2θ, and its sine: over cos² θ
        sine = 2.0 * tan_theta
        numerator = onset * cosine + g * sine
        denominator = cosine - onset * sine / g
    else:
        numerator = g * (values["mu_s"] + tan_theta)
        denominator = 1.0 - values["mu_s"] * tan_theta
    with np.errstate(divide="ignore"):
        return np.where(denominator > 0.0, numerator / denominator, math.inf)


def phase_seconds(problem: Problem, inputs: Mapping[str, Any]) -> Any:
    """Return the seconds in a unit of the kernels' phase: 1/ω, or the factor on a record's time."""
    if not isinstance(problem.excitation, Waveform):
        return inputs["time_scale"]
    if "frequency" in inputs:
        return 1.0 / (2.0 * math.pi * inputs["frequency"])
    return np.ones(())


def _scaled_dimension(request: Request) -> str | None:
    """Return the longest dimension along which the scaling law gives the results, if there is one.

    Along it only the time of the shaking varies.
    """
    in_time = {"frequency", "time_scale", "structure_frequency"}
    if {"displacement_amplitude", "pgv", "arias_intensity"} & request.inputs.keys():
        in_time = {"structure_frequency"}  # the amplitude depends on the frequency
    if changing_strength(request.problem.model) is not None:
        in_time = {"structure_frequency"}  # slip and velocity have lengths and times of their own
    solved = {
        dim for name, values in request.inputs.items() if name not in in_time for dim in values.dims
    }
    scaled = {dim: size for dim, size in request.sizes.items() if dim not in solved}
    return max(scaled, key=lambda dim: scaled[dim], default=None)


class Workspace:
    """Arrays of a tile's cells and results, which all tiles of a thread use.

    New arrays for each would come as new pages of memory, which take as long as the cells.
    """

    def __init__(self, solver: solvers.Solver, most: int) -> None:
        self._cells = np.empty(most, solver.cell)
        self._row_count = 1 + max(solver.rows.values())
        self._rows = np.empty(self._row_count * most)

    def arrays(self, count: int) -> tuple[NDArray[Any], NDArray[np.float64]]:
        """Return cells whose fields are all NaN, and the rows of their results."""
        cells = self._cells[:count]
        cells.view(np.float64)[:] = math.nan
        return cells, self._rows[: self._row_count * count].reshape(self._row_count, count)


def _fill(
    results: Variables, request: Request, solver: solvers.Solver, finite: bool = True
) -> None:
    """Fill in the results tile by tile, from NumPy arrays, as cutting xarray variables is slow."""
    scaled = _scaled_dimension(request)
    dims = tuple(request.sizes)
    solved = {dim: size for dim, size in request.sizes.items() if dim != scaled}
    count = math.prod(solved.values())
    share = count // (8 * threads.thread_count())
    tile = max(min(max(share, _LEAST_TILE), _MOST_TILE) // solvers.cost_of(request.problem), 1)
    arrays = {name: values.set_dims(dims).values for name, values in request.inputs.items()}
    workspaces = threading.local()

    def work(chunk: Chunk) -> None:
        where = [chunk.get(dim, slice(None)) for dim in dims]
        targets = {name: result.data[(*where, ...)] for name, result in results.items()}
        inputs = {}
        for name, values in arrays.items():
            place = (
                cut if size > 1 else slice(None)
                for cut, size in zip(where, values.shape, strict=True)
            )
            inputs[name] = values[(*place, ...)]
        shape = tuple(chunk[dim].stop - chunk[dim].start if dim in chunk else 1 for dim in dims)
        if not hasattr(workspaces, "own"):
            workspaces.own = Workspace(solver, min(tile, count))
        _fill_tile(targets, request.problem, inputs, shape, solver, workspaces.own, finite)
        request.count(next(iter(targets.values())).size)

    threads.spread(list(grid_chunks(solved, tile)), work)


def _fill_tile(
    results: dict[str, NDArray[Any]],
    problem: Problem,
    inputs: Mapping[str, NDArray[Any]],
    shape: tuple[int, ...],
    solver: solvers.Solver,
    workspace: Workspace,
    finite: bool,
) -> None:
    """Solve the cells of a tile, and write the results at all frequencies of each cell.

    The cells lie along all dimensions but the one of the scaling law.
    """
    names = solver.cell.names
    assert names is not None
    cells, rows = workspace.arrays(math.prod(shape))
    on_dimensions = cells.reshape(shape)
    with np.errstate(all="ignore"):  # results that overflow are refused below
        for name, values in cell_inputs(problem, inputs).items():
            if name in names:
                on_dimensions[name] = values
        solver.solve(cells, rows)
        validity = rows[solver.rows["validity"]].reshape(shape).astype(np.int16)
        is_unsolved = validity & UNSOLVED != 0
        if is_unsolved.any():
            raise RunError(
                f"{_inputs_at(is_unsolved, problem, inputs)}: an event of the motion was not "
                "found; please report this cell, with the options of the run"
            )
        seconds = phase_seconds(problem, inputs)
        for name, target in results.items():
            in_phase = rows[solver.rows[name]].reshape(shape)
            factor = seconds ** _POWERS.get(name, 0)
            np.multiply(in_phase, factor, out=target, casting="unsafe")
            if not finite or target.dtype.kind != "f":
                continue
            # quicker than a look at all results; a cell without a value has NaN
            largest = np.fmax.reduce(np.abs(in_phase), axis=None, initial=0.0) * factor.max()
            if math.isfinite(largest):
                continue
            has_value = validity & np.int16(variables.VALUELESS) == 0
            is_infinite = has_value & ~np.isfinite(target)
            if is_infinite.any():
                raise InputError(
                    f"{_inputs_at(is_infinite, problem, inputs)}: {name} is then no finite number "
                    "in double precision; must be nearer to 1"
                )
    if "structure_frequency" in inputs and "validity" in results:
        flag_flexible_blocks(
            results["validity"], inputs["frequency"], inputs["structure_frequency"]
        )


def _inputs_at(
    is_wrong: NDArray[np.bool_], problem: Problem, inputs: Mapping[str, NDArray[Any]]
) -> str:
    """Return the inputs of the first cell that is wrong, in words."""
    is_wrong, *arrays = np.broadcast_arrays(is_wrong, *inputs.values())
    cell = np.unravel_index(int(is_wrong.argmax()), is_wrong.shape)
    numbers = {name: float(array[cell]) for name, array in zip(inputs, arrays, strict=True)}
    numbers["g"] = problem.model.g
    return ", ".join(f"{name} = {number_text(value)}" for name, value in numbers.items())
