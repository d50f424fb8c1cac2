"""What a caller asks for, checked and laid out: parameters in, a plan, a table out.

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
from slipsweep.grid import inputs as grid_inputs
from slipsweep.grid.solvers import ROWS, ROWS_WITH_EXTREMES, cost_of, memory_of
from slipsweep.model import options
from slipsweep.model import variables as known
from slipsweep.model.parameters import check_choices, check_friction, check_given, check_progress
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform, peak_acceleration

#: Results that lie on the same dimensions: what solves them (`engine.solve`, say), and its request.
Task: TypeAlias = tuple[Callable[[engine.Request], engine.Variables], engine.Request]


@dataclass
class Plan:
    """What has been checked and only needs computing."""

    sizes: dict[str, int]  # of the grid, its dimensions in the order of the results
    coords: dict[str, xr.Variable]
    tasks: tuple[Task, ...]
    names: tuple[str, ...]  # of the results, in the order of the table
    attrs: dict[str, Any]
    cost: float = 1.0  # of a cell of the grid, in cells of the cycle solver
    together: tuple[
        str, ...
    ] = ()  # dimensions along which a part takes about as much as all: to be cut last
    memory: int = 0  # bytes that solving takes beside the results, however small the grid
    cell_memory: int = 0  # bytes for each cell of the grid that it takes beside them
    #: Attributes of the results.
    described: Mapping[str, Mapping[str, Any]] = field(
        default_factory=lambda: known.RESULTS | known.RECORD_RESULTS
    )

    def __post_init__(self) -> None:
        check_dimensions(self.sizes, self.coords, self.names)

    @property
    def cells(self) -> int:
        """What there is to solve, in what `progress` counts."""
        return math.prod(self.sizes.values())

    def part(self, chunk: chunks.Chunk) -> "Plan":
        """The plan of a chunk of the grid, which gives the same bits as the whole does there."""
        sizes = chunks.sizes_within(chunk, self.sizes)
        coords = chunks.variables_within(chunk, self.coords)
        tasks = tuple((solver, request.part(chunk)) for solver, request in self.tasks)
        return replace(self, sizes=sizes, coords=coords, tasks=tasks)

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Compute everything at once; InputError: memory cannot hold it.

        `progress` is told of cells as they are finished, from any thread.
        """
        check_progress(progress)
        requests = [request for _, request in self.tasks]
        cells, grid = max(
            ((one.cells, resources.grid_text(one.sizes)) for one in requests), default=(0, "")
        )
        itemsizes = (
            one.cells * sum(dtype.itemsize for dtype in one.dtypes.values()) for one in requests
        )
        needed = cells * self.cell_memory + sum(itemsizes)
        advice = "ask for fewer variables or cells, or give chunks= for a lazy result"
        resources.check_memory(f"grid of {grid}, {cells:.4g} cells", needed, advice)
        # all tasks cover the same cells: one of them counts
        counting = [
            replace(one, progress=progress if at == 0 else None) for at, one in enumerate(requests)
        ]
        return self._table(
            [solver(one) for (solver, _), one in zip(self.tasks, counting, strict=True)]
        )

    def template(self) -> xr.Dataset:
        """The results with their dimensions and coordinates but no values: zeros that take no memory."""
        return self._table(
            {
                name: xr.Variable((), np.zeros((), dtype)).set_dims(one.sizes)
                for name, dtype in one.dtypes.items()
            }
            for _, one in self.tasks
        )

    def lazy(self, lengths: Mapping[str, tuple[int, ...]]) -> xr.Dataset:
        """The results as dask arrays in chunks of these lengths: nothing is computed before it is asked for."""
        import dask.array as da  # takes as long as xarray

        if not lengths:  # one cell
            return self.solve()
        # an array with an element for each chunk of the grid, which is all its results: they come
        # out of one task
        ones = tuple((1,) * len(own) for own in lengths.values())
        meta = np.empty((0,) * len(ones), object)
        solved = da.map_blocks(
            _solved, plan=self, lengths=dict(lengths), chunks=ones, dtype=object, meta=meta
        )
        table = self.template()
        for name, result in table.data_vars.items():
            # it has some dimensions of the grid, in their order, and perhaps others of its own
            # after them
            own = [dim for dim in result.dims if dim in lengths]
            table[name].data = da.map_blocks(
                _result,
                solved[tuple(slice(None) if dim in own else slice(1) for dim in lengths)],
                result=name,
                drop_axis=[axis for axis, dim in enumerate(lengths) if dim not in own],
                new_axis=[*range(len(own), result.ndim)],
                chunks=tuple(lengths.get(str(dim), (size,)) for dim, size in result.sizes.items()),
                dtype=result.dtype,
                meta=np.empty((0,) * result.ndim, result.dtype),
            )
        return table

    def _table(self, results: Iterable[engine.Variables]) -> xr.Dataset:
        """The results of all tasks, described."""
        found = {name: one for own in results for name, one in own.items()}
        table = {
            name: xr.Variable(found[name].dims, found[name].data, self.described[name])
            for name in self.names
        }
        return xr.Dataset(table, self.coords, self.attrs)


def _solved(
    plan: Plan, lengths: Mapping[str, tuple[int, ...]], block_id: tuple[int, ...]
) -> np.ndarray:
    """The results of a chunk as the element of an array."""
    edges = zip(lengths.items(), block_id, strict=True)
    chunk = {dim: slice(sum(own[:at]), sum(own[: at + 1])) for (dim, own), at in edges}
    found = np.empty((1,) * len(block_id), object)
    found.flat[0] = plan.part(chunk).solve()
    return found


def _result(chunk: np.ndarray, result: str) -> np.ndarray:
    """One of the results that are the element of an array."""
    return np.asarray(chunk.item()[result])


def plan_sweep(
    inputs: grid_inputs.Inputs,
    *,
    excitation: Any = "sine",
    model: Any = "mendez",
    solver: Any = "auto",
    variables: Any = None,
    walked: bool = False,
) -> Plan:
    """Plan of a sweep; arguments and errors (InputError) are those of `slipsweep.sweep`.

    Cells under a sine may be `walked`, as those under any wave, and not put into batches.
    """
    problem = replace(grid_inputs.check_problem(excitation, model, solver), walked=walked)
    coords = grid_inputs.check_parameters(problem, inputs)
    is_wave = isinstance(problem.excitation, Waveform)
    results = known.RESULTS if is_wave else known.RECORD_RESULTS
    default: tuple[str, ...] = known.DEFAULT_RESULTS if is_wave else known.DEFAULT_RECORD_RESULTS
    default += ("motion_factor",) if isinstance(problem.excitation, Suite) else ()
    slides_back = options.slides_both_ways(problem.model)
    default += tuple(known.EXTREMES) if slides_back else ()
    wanted = default if variables is None else check_choices("variables", variables, results)
    for name in known.BOTH_WAYS:
        if name in wanted and not slides_back:
            raise InputError(f"variables: {name}: only with model = Newmark(sliding='both')")
    solved = grid_inputs.inputs_of(problem, coords)
    drive = _drive(solved)
    if "displacement_amplitude" in drive:
        dims = grid_inputs.grid_sizes(drive)
        # as a coordinate it takes no more than what it is made of, and on a grid of the two as much
        # as a result
        if any(dims.keys() == set(variable.dims) for variable in drive.values()):
            peak = peak_acceleration(**drive).transpose(*dims)
            coords = coords | {
                "amplitude": xr.Variable(tuple(dims), peak.data, known.PARAMETERS["amplitude"])
            }

    tasks = []
    if motion := tuple(
        name
        for name in wanted
        if (name in ROWS or name in ROWS_WITH_EXTREMES) and name != "newmark_displacement"
    ):
        tasks.append(_task(engine.solve, problem, motion, solved))
    if "newmark_displacement" in wanted:
        constant = options.Newmark(g=problem.model.g)
        is_changing = options.changing_strength(problem.model) is not None
        solver_of_constant = options.Cycle() if is_changing else problem.solver
        classical = replace(problem, model=constant, solver=solver_of_constant)
        tasks.append(_task(engine.solve, classical, ("newmark_displacement",), solved))
    cost = cost_of(problem) * max(len(tasks), 1)
    # one that was given is a coordinate already
    if friction := tuple(
        name for name in known.FRICTION_PARAMETERS if name in wanted and name not in solved
    ):
        tasks.append(_friction_task(problem, friction, solved))
    if amplitude := tuple(
        name for name in ("amplitude", "motion_factor") if name in wanted and name not in coords
    ):
        tasks.append(_task(engine.amplitudes, problem, amplitude, drive))
    names = tuple(name for name in wanted if any(name in request.wanted for _, request in tasks))
    attrs = _about(problem, coords)
    return Plan(
        grid_inputs.grid_sizes(solved),
        coords,
        tuple(tasks),
        names,
        attrs,
        cost,
        memory=memory_of(problem),
    )


def plan_friction_parameters(inputs: grid_inputs.Inputs, *, model: Any = "mendez") -> Plan:
    """Plan of `slipsweep.friction_parameters`; as `plan_sweep`."""
    problem = grid_inputs.check_problem("sine", model, "auto")
    check_given(inputs.given, ("theta", "amplitude"))
    check_friction(inputs.given)
    coords = grid_inputs.checked(inputs.given, problem.model.g)
    names = (
        *(name for name in known.FRICTION_PARAMETERS if name not in coords),
        "sliding_mode",
        "validity",
    )
    task = _friction_task(problem, names, coords)
    attrs = {"title": "Friction parameters", **_origin(problem)}
    return Plan(dict(task[1].sizes), coords, (task,), names, attrs)


def check_dimensions(
    sizes: Mapping[str, int], coords: engine.Variables, results: Collection[str]
) -> None:
    """Refuse dimensions that no dataset can have with what is in it; DataArrays may name any."""
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
    """The inputs that the amplitude of the base depends on."""
    strength = next(name for name in ("displacement_amplitude", *known.STRENGTHS) if name in inputs)
    clocks = {
        "displacement_amplitude": "frequency",
        "pgv": "time_scale",
        "arias_intensity": "time_scale",
    }
    names = (strength, clocks.get(strength, strength), "azimuth", "motion")
    return {name: inputs[name] for name in names if name in inputs}


def _task(
    solver: Any, problem: grid_inputs.Problem, names: tuple[str, ...], inputs: engine.Variables
) -> Task:
    """The task of some results, on the dimensions of these inputs."""
    return solver, engine.Request(problem, grid_inputs.grid_sizes(inputs), inputs, names)


def _friction_task(
    problem: grid_inputs.Problem, names: tuple[str, ...], inputs: engine.Variables
) -> Task:
    """Eqs. 7-11 on the dimensions they depend on."""
    if "yield_coefficient" in inputs and (
        unknown := [name for name in names if name != "yield_acceleration"]
    ):
        raise InputError(
            f"variables: {unknown[0]} needs theta and mu_s in place of yield_coefficient"
        )
    drive = _drive(inputs)
    strength, values = next(iter(drive.items()))
    for name in ("delta_mu", "decay_rate"):
        if name in names and (values == 0.0).any():
            raise InputError(
                f"{strength} = 0: has no finite {name} (Eqs. 6, 11); must be > 0, or {name} be given"
            )
    own = {*known.INTERFACE_INPUTS, "yield_coefficient", "amplitude", *drive}
    return _task(
        engine.friction_parameters,
        problem,
        names,
        {name: one for name, one in inputs.items() if name in own},
    )


def _about(problem: grid_inputs.Problem, given: Collection[str]) -> dict[str, Any]:
    """Attributes of the results, from which the choices can be made again."""
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
    sources = options.friction_inputs(problem.model.name, given, {})
    if options.slides_both_ways(problem.model):
        is_given = "upslope_yield_acceleration" in given
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


def _origin(problem: grid_inputs.Problem) -> dict[str, Any]:
    """Return attributes for the program and the model that results come from."""
    source = {"source": f"slipsweep {__version__}", "references": problem.model.reference}
    return source | options.MODELS.attributes(problem.model)
