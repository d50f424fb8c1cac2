"""Plan of a computation: checked parameters in, an `xarray.Dataset` of results out.

A plan holds the coordinates, and the tasks that give the results: one for the motion, one for the
friction parameters, which have no frequency dimension.  It can be cut into parts; solved at once or
part by part, it gives the same bits.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.grid import chunks, engine, resources
from slipsweep.grid.inputs import (
    Inputs,
    Problem,
    check_arrays,
    check_parameters,
    check_problem,
    grid_sizes,
    inputs_of,
)
from slipsweep.grid.solvers import ROWS, ROWS_WITH_EXTREMES, cost_of, memory_of
from slipsweep.model import options
from slipsweep.model.parameters import check_choices, check_friction, check_given, check_progress
from slipsweep.model.variables import (
    BOTH_WAYS,
    DEFAULT_RECORD_RESULTS,
    DEFAULT_RESULTS,
    EXTREMES,
    FRICTION_PARAMETERS,
    INTERFACE_INPUTS,
    PARAMETERS,
    RECORD_RESULTS,
    RESULTS,
    STRENGTHS,
)
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform, peak_acceleration

#: Results on the same dimensions: a function that solves them, such as `engine.solve`, and its
#: request.
Task: TypeAlias = tuple[Callable[[engine.Request], engine.Variables], engine.Request]


@dataclass
class Plan:
    """A computation that has been checked and can be solved."""

    sizes: dict[str, int]  # dimensions of the grid in the order of the results, and their lengths
    coords: dict[str, xr.Variable]
    tasks: tuple[Task, ...]
    names: tuple[str, ...]  # of the results, in the order of the table
    attrs: dict[str, Any]
    #: Cost of a cell of the grid, in cells of the cycle solver.
    cost: float = 1.0
    #: Dimensions that are cut last: solving a part of them takes about as long as all of them.
    together: tuple[str, ...] = ()
    #: Bytes that solving takes in addition to the results: for any grid, and for each cell.
    memory: int = 0
    cell_memory: int = 0
    #: Attributes of the results.
    described: Mapping[str, Mapping[str, Any]] = field(
        default_factory=lambda: RESULTS | RECORD_RESULTS
    )

    def __post_init__(self) -> None:
        check_dimensions(self.sizes, self.coords, self.names)

    @property
    def cells(self) -> int:
        """Number of cells to solve, as `progress` counts them."""
        return math.prod(self.sizes.values())

    def part(self, chunk: chunks.Chunk) -> "Plan":
        """Return the plan of a chunk of the grid; it gives the same bits as the whole plan."""
        sizes = chunks.sizes_within(chunk, self.sizes)
        coords = chunks.variables_within(chunk, self.coords)
        tasks = tuple((solver, request.part(chunk)) for solver, request in self.tasks)
        return replace(self, sizes=sizes, coords=coords, tasks=tasks)

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Compute everything at once (InputError: memory cannot hold it).

        `progress` is called with a number of cells as they are finished, from any thread.
        """
        check_progress(progress)
        requests = [request for _, request in self.tasks]
        cells, grid = max(
            ((request.cells, resources.grid_text(request.sizes)) for request in requests),
            default=(0, ""),
        )
        itemsizes = (
            request.cells * sum(dtype.itemsize for dtype in request.dtypes.values())
            for request in requests
        )
        needed = cells * self.cell_memory + sum(itemsizes)
        advice = "ask for fewer variables or cells, or give chunks= for a lazy result"
        resources.check_memory(f"grid of {grid}, {cells:.4g} cells", needed, advice)
        results = []
        for solve, request in self.tasks:
            results.append(solve(replace(request, progress=progress)))
            progress = None  # all tasks have the same cells: the first one counts them
        return self._table(results)

    def template(self) -> xr.Dataset:
        """Return the results with coordinates but no values: zeros that take no memory."""
        return self._table(
            {
                name: xr.Variable((), np.zeros((), dtype)).set_dims(request.sizes)
                for name, dtype in request.dtypes.items()
            }
            for _, request in self.tasks
        )

    def lazy(self, lengths: Mapping[str, tuple[int, ...]]) -> xr.Dataset:
        """Return the results as dask arrays in chunks of these lengths, not yet computed."""
        import dask.array as da  # loading it takes as long as xarray

        if not lengths:  # one cell
            return self.solve()
        # an array with one element for each chunk of the grid: a Dataset of all results, so that
        # one task solves the chunk
        ones = tuple((1,) * len(cuts) for cuts in lengths.values())
        meta = np.empty((0,) * len(ones), object)
        solved = da.map_blocks(
            _solved, plan=self, lengths=dict(lengths), chunks=ones, dtype=object, meta=meta
        )
        table = self.template()
        for name, result in table.data_vars.items():
            # first some dimensions of the grid, in their order, then perhaps others
            grid_dims = [dim for dim in result.dims if dim in lengths]
            table[name].data = da.map_blocks(
                _result,
                solved[tuple(slice(None) if dim in grid_dims else slice(1) for dim in lengths)],
                result=name,
                drop_axis=[axis for axis, dim in enumerate(lengths) if dim not in grid_dims],
                new_axis=[*range(len(grid_dims), result.ndim)],
                chunks=tuple(lengths.get(str(dim), (size,)) for dim, size in result.sizes.items()),
                dtype=result.dtype,
                meta=np.empty((0,) * result.ndim, result.dtype),
            )
        return table

    def _table(self, results: Iterable[engine.Variables]) -> xr.Dataset:
        """Return the results of all tasks as a Dataset with attributes."""
        variables: dict[str, xr.Variable] = {}
        for of_task in results:
            variables |= of_task
        table = {
            name: xr.Variable(variables[name].dims, variables[name].data, self.described[name])
            for name in self.names
        }
        return xr.Dataset(table, self.coords, self.attrs)


def _solved(
    plan: Plan, lengths: Mapping[str, tuple[int, ...]], block_id: tuple[int, ...]
) -> np.ndarray:
    """Return the results of a chunk, a Dataset, as the only element of an array."""
    edges = zip(lengths.items(), block_id, strict=True)
    chunk = {dim: slice(sum(cuts[:at]), sum(cuts[: at + 1])) for (dim, cuts), at in edges}
    element = np.empty((1,) * len(block_id), object)
    element.flat[0] = plan.part(chunk).solve()
    return element


def _result(chunk: np.ndarray, result: str) -> np.ndarray:
    """Return one of the results in the Dataset that is the only element of an array."""
    return np.asarray(chunk.item()[result])


def plan_sweep(
    inputs: Inputs,
    *,
    excitation: Any = "sine",
    model: Any = "mendez",
    solver: Any = "auto",
    variables: Any = None,
    walked: bool = False,
) -> Plan:
    """Return the plan of a sweep; arguments and errors (InputError) are those of `slipsweep.sweep`.

    If `walked`, cells under a sine are solved like those under any wave, not in batches.
    """
    problem = replace(check_problem(excitation, model, solver), walked=walked)
    coords = check_parameters(problem, inputs)
    requested = _requested_results(problem, variables)
    solved = inputs_of(problem, coords)
    drive = _drive(solved)
    coords = coords | _amplitude_coordinate(drive)
    tasks = []
    of_motion = {*ROWS, *ROWS_WITH_EXTREMES} - {"newmark_displacement"}
    if motion := tuple(name for name in requested if name in of_motion):
        tasks.append(_task(engine.solve, problem, motion, solved))
    if "newmark_displacement" in requested:
        constant = options.Newmark(g=problem.model.g)
        is_changing = options.changing_strength(problem.model) is not None
        solver_of_constant = options.Cycle() if is_changing else problem.solver
        classical = replace(problem, model=constant, solver=solver_of_constant)
        tasks.append(_task(engine.solve, classical, ("newmark_displacement",), solved))
    cost = cost_of(problem) * max(len(tasks), 1)
    # parameters that are given, and an amplitude that is a coordinate, are not computed again
    estimated = [name for name in FRICTION_PARAMETERS if name not in solved]
    if friction := tuple(name for name in estimated if name in requested):
        tasks.append(_friction_task(problem, friction, solved))
    amplitudes = [name for name in ("amplitude", "motion_factor") if name not in coords]
    if amplitude := tuple(name for name in amplitudes if name in requested):
        tasks.append(_task(engine.amplitudes, problem, amplitude, drive))
    names = tuple(name for name in requested if any(name in request.names for _, request in tasks))
    attrs = _attributes(problem, coords)
    return Plan(
        grid_sizes(solved),
        coords,
        tuple(tasks),
        names,
        attrs,
        cost,
        memory=memory_of(problem),
    )


def _requested_results(problem: Problem, variables: Any) -> tuple[str, ...]:
    """Return the names of the results to compute; by default those of the kind of sweep."""
    is_wave = isinstance(problem.excitation, Waveform)
    slides_back = options.slides_both_ways(problem.model)
    if variables is None:
        requested: tuple[str, ...] = DEFAULT_RESULTS if is_wave else DEFAULT_RECORD_RESULTS
        if isinstance(problem.excitation, Suite):
            requested += ("motion_factor",)
        if slides_back:
            requested += tuple(EXTREMES)
    else:
        requested = check_choices("variables", variables, RESULTS if is_wave else RECORD_RESULTS)
    for name in BOTH_WAYS:
        if name in requested and not slides_back:
            raise InputError(f"variables: {name}: only with model = Newmark(sliding='both')")
    return requested


def _amplitude_coordinate(drive: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return A = ω²d as a coordinate, where it is as small as the inputs that it is made of.

    Where displacement amplitude and frequency span a grid, it is as large as a result.
    """
    if "displacement_amplitude" not in drive:
        return {}
    dims = grid_sizes(drive)
    if not any(dims.keys() == set(values.dims) for values in drive.values()):
        return {}
    peak = peak_acceleration(**drive).transpose(*dims)
    return {"amplitude": xr.Variable(tuple(dims), peak.data, PARAMETERS["amplitude"])}


def plan_friction_parameters(inputs: Inputs, *, model: Any = "mendez") -> Plan:
    """Return the plan of `slipsweep.friction_parameters`; same arguments and errors."""
    problem = check_problem("sine", model, "auto")
    check_given(inputs, ("theta", "amplitude"))
    check_friction(inputs)
    coords = check_arrays(inputs, problem.model.g)
    names = (
        *(name for name in FRICTION_PARAMETERS if name not in coords),
        "sliding_mode",
        "validity",
    )
    task = _friction_task(problem, names, coords)
    attrs = {"title": "Friction parameters", **_origin(problem)}
    return Plan(dict(task[1].sizes), coords, (task,), names, attrs)


def check_dimensions(
    sizes: Mapping[str, int], coords: engine.Variables, results: Collection[str]
) -> None:
    """Raise InputError if a dimension has the name of a result, or of a coordinate without it."""
    for dim in sizes:
        if dim in results:
            raise InputError(
                f"{dim}: is the name of a result: must not be that of a dimension as well"
            )
        if dim in coords and dim not in coords[dim].dims:
            raise InputError(
                f"{dim}: is a dimension of another parameter: must have values along it"
            )


def _drive(inputs: engine.Variables) -> dict[str, xr.Variable]:
    """Return the inputs that the amplitude of the base depends on."""
    strength = next(name for name in ("displacement_amplitude", *STRENGTHS) if name in inputs)
    clocks = {
        "displacement_amplitude": "frequency",
        "pgv": "time_scale",
        "arias_intensity": "time_scale",
    }
    names = (strength, clocks.get(strength, strength), "azimuth", "motion")
    return {name: inputs[name] for name in names if name in inputs}


def _task(solver: Any, problem: Problem, names: tuple[str, ...], inputs: engine.Variables) -> Task:
    """Return the task of some results, on the dimensions of these inputs."""
    return solver, engine.Request(problem, grid_sizes(inputs), inputs, names)


def _friction_task(problem: Problem, names: tuple[str, ...], inputs: engine.Variables) -> Task:
    """Return the task of Eqs. 7-11, on the dimensions that they depend on."""
    if "yield_coefficient" in inputs:
        for name in names:
            if name != "yield_acceleration":
                raise InputError(
                    f"variables: {name} needs theta and mu_s in place of yield_coefficient"
                )
    drive = _drive(inputs)
    strength, values = next(iter(drive.items()))
    for name in ("delta_mu", "decay_rate"):
        if name in names and (values == 0.0).any():
            raise InputError(
                f"{strength} = 0: has no finite {name} (Eqs. 6, 11); must be > 0, or {name} be "
                "given"
            )
    needed = {*INTERFACE_INPUTS, "yield_coefficient", "amplitude", *drive}
    needed_inputs = {name: values for name, values in inputs.items() if name in needed}
    return _task(engine.friction_parameters, problem, names, needed_inputs)


def _attributes(problem: Problem, coords: Collection[str]) -> dict[str, Any]:
    """Return the attributes of the results, from which the choices can be made again."""
    motion = problem.excitation
    title = "Response of a rigid block to a recorded motion"
    shaking: dict[str, Any]
    if isinstance(motion, Record):
        shaking = {"record": motion.name, **motion.attrs}
    elif isinstance(motion, Suite):
        title = "Response of a rigid block to a suite of recorded motions"
        shaking = {**motion.attrs}
    else:
        title = "Permanent displacement of a rigid block, swept"
        shaking = WAVEFORMS.attributes(motion)
    sources = options.friction_inputs(problem.model.name, coords, {})
    if options.slides_both_ways(problem.model):
        is_given = "upslope_yield_acceleration" in coords
        sources += f"; Üy,up {'given' if is_given else 'by statics, from Üy and θ'}"
    if changing := options.changing_strength(problem.model):
        sources += f"; {options.STRENGTH_TEXT[changing]}"
    inputs = {"friction_inputs": sources}
    return {
        "title": title,
        **_origin(problem),
        **inputs,
        **shaking,
        **options.SOLVERS.attributes(problem.solver),
    }


def _origin(problem: Problem) -> dict[str, Any]:
    """Return attributes for the program and the model that results come from."""
    source = {"source": f"slipsweep {__version__}", "references": problem.model.reference}
    return source | options.MODELS.attributes(problem.model)
