"""Variables with named dimensions in, variables out: how a grid is solved.

It is cut into tiles of some thousand cells.  The inputs of a tile are gathered by NumPy into an
array of cells, which a kernel solves (`slipsweep.grid.solvers`), on as many threads as there are;
what it finds of a cell, in units of phase, is spread over the frequencies of that cell: v = V/ω and
u = W/ω² (the scaling law).
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
from slipsweep.kernels.step_cells import STRENGTH_FIELDS
from slipsweep.model import variables as known
from slipsweep.model.options import changing_strength, slides_both_ways
from slipsweep.model.parameters import number_text
from slipsweep.motion.intensity import strength_factor
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Sine, Waveform, peak_acceleration

#: Cells that a kernel solves in a call, at least and at most: Python's part is small, and Ctrl-C
#: heard between two.
_LEAST_TILE = 16384
_MOST_TILE = 65536

#: Powers of 1/ω, or of the factor on a record's time, in results; others do not scale with the
#: time.
_POWERS = {
    "permanent_displacement": 2,
    "newmark_displacement": 2,
    **dict.fromkeys(known.BOTH_WAYS, 2),
    "peak_relative_velocity": 1,
}

#: Inputs or results by their names.
Variables: TypeAlias = Mapping[str, xr.Variable]


@dataclass(frozen=True)
class Request:
    """A grid, and the results wanted of it.

    `inputs` has `theta` (degrees), `mu_s`, the optional parameters and the strength and the time of
    the shaking: under a waveform `amplitude` or `displacement_amplitude`, and `frequency` (Hz);
    under records one of `variables.STRENGTHS`, `time_scale` and `polarity`, of a suite also the
    place of the `motion` in it, and of pairs `azimuth`.
    """

    problem: Problem
    sizes: Mapping[str, int]  # dimensions of the results, in their order, and their lengths
    inputs: Variables  # along some of these dimensions
    wanted: tuple[str, ...]  # names of results; nothing else is computed
    progress: Callable[[int], None] | None = (
        None  # told of cells as they are finished, from any thread
    )

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Types of what is wanted: float64 but for codes."""
        return {name: np.dtype(known.RESULT_DTYPES.get(name, "float64")) for name in self.wanted}

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
        """The same of a part of the grid."""
        return replace(
            self, sizes=sizes_within(chunk, self.sizes), inputs=variables_within(chunk, self.inputs)
        )


def solve(request: Request) -> Variables:
    """Solve a grid for the results of a motion: those of `solvers.ROWS`.

    InputError: a result that has a value is beyond double precision.  RunError: an event was not
    found.
    """
    results = request.results()
    wants_peak = "peak_relative_velocity" in request.wanted
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
    """Eqs. 7-11 and λ of every cell, `sliding_mode` and the validity known before the motion; no frequency.

    They are of a harmonic motion of that `amplitude`, whatever shakes the base.  Errors as of
    `solve`, but that estimates need not be `finite`.  A cell without a value has NaN.
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
            one[where] = motion_factor(part.problem, part.inputs)
        part.count(part.cells)
    return results


def motions(request: Request) -> Iterator[tuple[Chunk, Request]]:
    """The parts of a grid that one motion shakes, and where in the grid they lie; under a waveform all of it.

    Of a suite each is under a record of its own, with which a solver goes on as if there were no
    other.
    """
    own = (
        request.inputs[name].sizes
        for name in ("motion", "azimuth", "polarity")
        if name in request.inputs
    )
    varying = {str(dim): size for sizes in own for dim, size in sizes.items()}
    suite = request.problem.excitation
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
    """Return the given fields of a cell, of variables or arrays that broadcast.

    Under a record A is its factor.  A block that slides both ways also has its upslope yield
    acceleration, one whose strength changes the parameters of that and the seconds in a unit of
    phase.
    """
    given = dict(inputs)
    if isinstance(problem.excitation, Record) or "displacement_amplitude" in inputs:
        given["amplitude"] = motion_factor(problem, inputs)
    if "yield_coefficient" in inputs:
        given["yield_acceleration"] = inputs["yield_coefficient"] * problem.model.g
    if "theta" in inputs:
        given["tan_theta"] = np.tan(np.radians(inputs["theta"]))
    fields = {name: given[name] for name in Cell._fields if name in given}
    if changing_strength(problem.model) is not None:
        fields |= {name: given[name] for name in STRENGTH_FIELDS if name in given}
        fields["seconds"] = phase_seconds(problem, inputs)
    if slides_both_ways(problem.model):
        fields["upslope_yield_acceleration"] = upslope_yield_acceleration(given, problem.model.g)
    return fields


def motion_factor(problem: Problem, inputs: Mapping[str, Any]) -> Any:
    """Return A of a waveform, m/s², or the factor on the acceleration of a record."""
    if isinstance(record := problem.excitation, Record):
        return strength_factor(record.times, record.acceleration, inputs)
    if "displacement_amplitude" in inputs:
        return peak_acceleration(inputs["displacement_amplitude"], inputs["frequency"])
    return inputs["amplitude"]


def upslope_yield_acceleration(given: Mapping[str, Any], g: float) -> Any:
    """Return Üy,up: as given, or by statics; infinite where no acceleration moves the block upslope.

    By statics it is g tan(φs + θ), and from a given Üy g tan(arctan(Üy/g) + 2θ).
    """
    if "upslope_yield_acceleration" in given:
        return given["upslope_yield_acceleration"]
    tan_theta = given["tan_theta"]
    if "yield_acceleration" in given:
        onset = given["yield_acceleration"]
        cosine = 1.0 - tan_theta * tan_theta  # of 2θ, and its sine: over cos² θ
        sine = 2.0 * tan_theta
        numerator = onset * cosine + g * sine
        denominator = cosine - onset * sine / g
    else:
        numerator = g * (given["mu_s"] + tan_theta)
        denominator = 1.0 - given["mu_s"] * tan_theta
    with np.errstate(divide="ignore"):
        return np.where(denominator > 0.0, numerator / denominator, math.inf)


def phase_seconds(problem: Problem, inputs: Mapping[str, Any]) -> Any:
    """Seconds that a unit of the kernels' phase takes: 1/ω, or the factor on the time of a record."""
    if isinstance(problem.excitation, Waveform):
        return 1.0 / (2.0 * math.pi * inputs["frequency"]) if "frequency" in inputs else np.ones(())
    return inputs["time_scale"]


def _scaled_dimension(request: Request) -> str | None:
    """The longest dimension along which only the time of the shaking varies, which the scaling law serves."""
    in_time = {"frequency", "time_scale", "structure_frequency"}
    if {"displacement_amplitude", "pgv", "arias_intensity"} & request.inputs.keys():
        in_time = {"structure_frequency"}  # the frequency is in the amplitude, too
    if changing_strength(request.problem.model) is not None:
        in_time = {"structure_frequency"}  # slip and velocity have lengths and times of their own
    others = {
        dim for name, one in request.inputs.items() if name not in in_time for dim in one.dims
    }
    only = {dim: size for dim, size in request.sizes.items() if dim not in others}
    return max(only, key=lambda dim: only[dim], default=None)


def _fill(
    results: Variables, request: Request, solver: solvers.Solver, finite: bool = True
) -> None:
    """Fill in results, tile by tile, cut from plain arrays: names of dimensions take a part of the cells' time."""
    scaled = _scaled_dimension(request)
    dims = tuple(request.sizes)
    solved = {dim: size for dim, size in request.sizes.items() if dim != scaled}
    share = math.prod(solved.values()) // (8 * threads.thread_count())
    tile = max(min(max(share, _LEAST_TILE), _MOST_TILE) // solvers.cost_of(request.problem), 1)
    arrays = {name: one.set_dims(dims).values for name, one in request.inputs.items()}

    def work(chunk: Chunk) -> None:
        where = [chunk.get(dim, slice(None)) for dim in dims]
        targets = {name: one.data[(*where, ...)] for name, one in results.items()}
        given = {}
        for name, values in arrays.items():
            own = (
                cut if size > 1 else slice(None)
                for cut, size in zip(where, values.shape, strict=True)
            )
            given[name] = values[(*own, ...)]
        shape = tuple(chunk[dim].stop - chunk[dim].start if dim in chunk else 1 for dim in dims)
        _fill_tile(targets, request.problem, given, shape, solver, finite)
        request.count(next(iter(targets.values())).size)

    threads.spread(list(grid_chunks(solved, tile)), work)


def _fill_tile(
    results: dict[str, NDArray[Any]],
    problem: Problem,
    inputs: Mapping[str, NDArray[Any]],
    shape: tuple[int, ...],
    solver: solvers.Solver,
    finite: bool,
) -> None:
    """Solve the cells of a tile, in all its dimensions but the scaled one, and spread them over the results."""
    names = solver.cell.names
    assert names is not None
    cells = np.full((*shape, len(names)), math.nan).view(solver.cell)[..., 0]
    with np.errstate(all="ignore"):  # results that overflow are refused below
        for name, values in cell_inputs(problem, inputs).items():
            if name in names:
                cells[name] = values
        found = np.empty((1 + max(solver.rows.values()), cells.size))
        solver.solve(cells.reshape(-1), found)
        validity = found[solver.rows["validity"]].reshape(shape).astype(np.int16)
        if (validity & UNSOLVED).any():
            why = "an event of the motion was not found; please report this cell, with the options of the run"
            raise RunError(f"{_inputs_at(validity & UNSOLVED != 0, problem, inputs)}: {why}")
        valued = validity & np.int16(known.VALUELESS) == 0
        seconds = phase_seconds(problem, inputs)
        for name, target in results.items():
            own = found[solver.rows[name]].reshape(shape)
            factor = seconds ** _POWERS.get(name, 0)
            np.multiply(own, factor, out=target, casting="unsafe")
            largest = np.abs(own[valued]).max(initial=0.0) if target.dtype.kind == "f" else 0.0
            if (
                finite
                and not math.isfinite(largest * factor.max())
                and (wrong := valued & ~np.isfinite(target)).any()
            ):
                why = f"{name} is then no finite number in double precision; must be nearer to 1"
                raise InputError(f"{_inputs_at(wrong, problem, inputs)}: {why}")
    if "structure_frequency" in inputs and "validity" in results:
        _flag_flexible(results["validity"], inputs["frequency"], inputs["structure_frequency"])


def _flag_flexible(
    validity: NDArray[np.int16], frequency: NDArray[Any], structure_frequency: NDArray[Any]
) -> None:
    """Flag blocks that are not rigid, 0.2 ≤ f/fs ≤ 1.3, piece by piece: f/fs takes four times as much as the flags."""
    with np.nditer(
        [validity, frequency, structure_frequency],
        ["external_loop", "buffered", "zerosize_ok"],
        [["readwrite"], ["readonly"], ["readonly"]],
        buffersize=_LEAST_TILE,
    ) as pieces:
        for flags, f, fs in pieces:
            ratio = f / fs
            flags |= ((ratio >= 0.2) & (ratio <= 1.3)) * np.int16(known.Validity.FLEXIBLE_BLOCK)


def _inputs_at(
    wrong: NDArray[np.bool_], problem: Problem, inputs: Mapping[str, NDArray[Any]]
) -> str:
    """The inputs of the first cell that is wrong, in words."""
    every = np.broadcast_arrays(wrong, *inputs.values())
    cell = np.unravel_index(int(every[0].argmax()), every[0].shape)
    values = {name: float(one[cell]) for name, one in zip(inputs, every[1:], strict=True)} | {
        "g": problem.model.g
    }
    return ", ".join(f"{name} = {number_text(value)}" for name, value in values.items())
