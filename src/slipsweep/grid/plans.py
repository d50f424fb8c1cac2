"""What a caller asks for, checked and laid out: parameters in, a plan, a table out.

A plan holds the checked options, the coordinates, and the tasks that give the results:
one for the motion, one for the friction parameters, which have no frequency dimension.
A plan can be cut into parts; solved at once or part by part, it gives the same bits.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.grid import chunks, engine, resources
from slipsweep.grid import inputs as grid_inputs
from slipsweep.grid import problem as problems
from slipsweep.grid.solvers import ROWS
from slipsweep.grid.tally import Tally
from slipsweep.model import options
from slipsweep.model import variables as known
from slipsweep.model.parameters import check_choices, check_given, check_progress
from slipsweep.motion import waveforms
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite

_FRICTION_INPUTS = (
    "theta", "mu_s", "amplitude", "yield_acceleration", "yield_coefficient", "decay_rate", "delta_mu",
    "minimum_friction",
)  # fmt: skip


@dataclass(frozen=True)
class Task:
    """Results that lie on the same dimensions, and all it takes to compute them.

    Attributes
    ----------
    solver : callable
        `engine.solve`, `engine.friction_parameters`, or another function of an `engine.Request`.
    problem : Problem
    names : tuple of str
        Results to compute.
    sizes : dict of str to int
        Their dimensions.
    inputs : dict of str to ndarray
        Parameters, with all dimensions, of length 1 where they do not vary.
    """

    solver: Callable[[engine.Request], engine.Arrays]
    problem: problems.Problem
    names: tuple[str, ...]
    sizes: dict[str, int]
    inputs: engine.Arrays

    @property
    def nbytes(self) -> int:
        """Bytes of the results."""
        return math.prod(self.sizes.values()) * sum(
            np.dtype(known.RESULT_DTYPES.get(name, "float64")).itemsize for name in self.names
        )

    def solve(self, progress: Callable[[int], None] | None = None) -> engine.Arrays:
        """Compute the results; `progress` is told of cells as they are finished."""
        shape = tuple(self.sizes.values())
        return self.solver(engine.Request(self.problem, shape, self.inputs, self.names, progress))

    def part(self, slices: tuple[slice, ...]) -> "Task":
        """The task cut to a slice of every dimension."""
        sizes = {dim: cut.stop - cut.start for dim, cut in zip(self.sizes, slices, strict=True)}
        return replace(self, sizes=sizes, inputs=engine.cut(self.inputs, slices))


@dataclass(frozen=True)
class Plan:
    """A sweep that has been checked and only needs computing.

    Attributes
    ----------
    sizes : dict of str to int
        Dimensions of the grid in the order of the results, and their lengths.
    coords : dict of str to xr.Variable
        The parameters.
    tasks : tuple of Task
    names : tuple of str
        Results in the order they are returned in.
    attrs : dict
        What the results say of themselves.
    cost, together, memory, cell_memory
        As in `anyplan.AnyPlan`.
    described : mapping of str to dict
        Attributes of the results.
    """

    sizes: dict[str, int]
    coords: dict[str, xr.Variable]
    tasks: tuple[Task, ...]
    names: tuple[str, ...]
    attrs: dict[str, Any]
    cost: float = 1.0
    together: tuple[str, ...] = ()
    memory: int = 0
    cell_memory: int = 0
    described: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: known.RESULTS | known.RECORD_RESULTS)

    def __post_init__(self) -> None:
        check_dimensions(self.sizes, self.coords, self.names)

    @property
    def cells(self) -> int:
        """Number of cells of the grid."""
        return math.prod(self.sizes.values())

    def part(self, chunk: chunks.Chunk) -> "Plan":
        """The plan cut to a chunk of its grid."""
        tasks = tuple(task.part(tuple(chunks.places(chunk, task.sizes).values())) for task in self.tasks)
        sizes = {dim: cut.stop - cut.start for dim, cut in chunks.places(chunk, self.sizes).items()}
        coords = {name: one.isel(chunk, missing_dims="ignore") for name, one in self.coords.items()}
        return replace(self, sizes=sizes, coords=coords, tasks=tasks)

    def tally(self, results: Mapping[str, np.ndarray]) -> Tally:
        """Modes and flags in a chunk of results."""
        return Tally.of(results)

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Compute everything at once; `progress` is told of cells as they are finished, from any thread.

        Raises
        ------
        InputError
            The results do not fit in memory.
        """
        check_progress(progress)
        sizes: dict[str, int] = max(
            (task.sizes for task in self.tasks), key=lambda sizes: math.prod(sizes.values()), default={}
        )
        cells = math.prod(sizes.values())
        resources.check_memory(
            f"grid of {resources.grid_text(sizes)}, {cells:.4g} cells",
            sum(task.nbytes for task in self.tasks) + cells * self.cell_memory,
            _ADVICE,
        )
        # all tasks cover the same cells: one of them counts
        return self.table(lambda task: task.solve(progress if task is self.tasks[0] else None))

    def template(self) -> xr.Dataset:
        """The results with their dimensions and coordinates but no values: zeros that take no memory."""

        def zeros(task: Task) -> dict[str, np.ndarray]:
            shape = tuple(task.sizes.values())
            return {
                name: np.broadcast_to(np.zeros((), known.RESULT_DTYPES.get(name, "f8")), shape) for name in task.names
            }

        return self.table(zeros)

    def table(self, evaluate: Callable[[Task], Mapping[str, Any]]) -> xr.Dataset:
        """The results, with `evaluate` giving a task's arrays."""
        found = {
            name: xr.Variable(tuple(task.sizes), values, self.described[name])
            for task in self.tasks
            for name, values in evaluate(task).items()
        }
        return xr.Dataset({name: found[name] for name in self.names}, self.coords, self.attrs)


def plan_sweep(
    inputs: grid_inputs.Inputs,
    *,
    excitation: Any = "sine",
    model: Any = "mendez",
    solver: Any = "auto",
    variables: Any = None,
) -> Plan:
    """Plan of a sweep.

    Parameters
    ----------
    inputs : Inputs
    excitation, model, solver, variables
        As `slipsweep.sweep`.

    Raises
    ------
    InputError
        As `slipsweep.sweep`.
    """
    problem = problems.check_problem(excitation, model, solver)
    parameters = grid_inputs.check_parameters(problem, inputs)
    if isinstance(problem.excitation, (Record, Suite)):
        return _plan_records(problem, parameters, variables)
    return _plan_waveform(problem, parameters, variables)


def _plan_records(problem: problems.Problem, coords: dict[str, xr.Variable], variables: Any) -> Plan:
    """Plan of a sweep under a record or a suite; `coords` as `check_parameters` gives them."""
    is_suite = isinstance(problem.excitation, Suite)
    default = known.DEFAULT_SUITE_RESULTS if is_suite else known.DEFAULT_RECORD_RESULTS
    wanted = default if variables is None else check_choices("variables", variables, known.RECORD_RESULTS)
    inputs = grid_inputs.inputs_of(problem, coords)
    sizes = grid_inputs.grid_sizes(inputs)
    tasks = _motion_tasks(
        problem, [name for name in known.RECORD_RESULTS if name in wanted], sizes, grid_inputs.aligned(inputs, sizes)
    )
    cost = problems.cost_of(problem) * max(len(tasks), 1)
    if "motion_factor" in wanted:
        tasks.append(_factor_task(problem, inputs))
    motions = "suite of recorded motions" if is_suite else "recorded motion"
    attrs = about(f"Response of a rigid block to a {motions}", problem, coords)
    return Plan(sizes, coords, tuple(tasks), wanted, attrs, cost, memory=problems.memory_of(problem))


def _factor_task(problem: problems.Problem, inputs: Mapping[str, xr.Variable]) -> Task:
    """The factor on each motion, on the dimensions it depends on."""
    strength = next(name for name in known.STRENGTHS if name in inputs)
    names = [strength, *(["time_scale"] if strength in ("pgv", "arias_intensity") else []), "azimuth", "motion"]
    own = {name: inputs[name] for name in names if name in inputs}
    sizes = grid_inputs.grid_sizes(own)
    return Task(engine.factors, problem, ("motion_factor",), sizes, grid_inputs.aligned(own, sizes))


def _motion_tasks(
    problem: problems.Problem, wanted: Collection[str], sizes: dict[str, int], inputs: engine.Arrays
) -> list[Task]:
    """The motion of the block, and of Newmark's on the same cells."""
    tasks = []
    if motion := tuple(name for name in wanted if name in ROWS and name != "newmark_displacement"):
        tasks.append(Task(engine.solve, problem, motion, sizes, inputs))
    if "newmark_displacement" in wanted:
        classical = replace(problem, model=options.Newmark(problem.model.g))
        tasks.append(Task(engine.solve, classical, ("newmark_displacement",), sizes, inputs))
    return tasks


def _plan_waveform(problem: problems.Problem, coords: dict[str, xr.Variable], variables: Any) -> Plan:
    """Plan of a sweep under a waveform; `coords` as `check_parameters` gives them."""
    wanted = known.DEFAULT_RESULTS if variables is None else check_choices("variables", variables, known.RESULTS)
    sizes, inputs = grid_inputs.grid_sizes(coords), grid_inputs.inputs_of(problem, coords)
    drive: dict[str, xr.Variable] = {
        name: coords[name] for name in ("displacement_amplitude", "frequency") if name in coords
    }
    if len(drive) == 2:
        grid_inputs.check_amplitudes(**drive)
        dims = grid_inputs.grid_sizes(drive)
        # as a coordinate it takes no more than what it is made of, and on a grid of the two as much as a result
        if any(dims.keys() == set(variable.dims) for variable in drive.values()):
            both = grid_inputs.aligned(drive, dims)
            amplitudes = xr.Variable(tuple(dims), waveforms.peak_acceleration(**both), known.PARAMETERS["amplitude"])
            coords = coords | {"amplitude": amplitudes}

    tasks = _motion_tasks(problem, wanted, sizes, grid_inputs.aligned(inputs, sizes))
    cost = problems.cost_of(problem) * max(len(tasks), 1)
    # one that was given is a coordinate already
    friction = tuple(name for name in known.FRICTION_PARAMETERS if name in wanted and name not in inputs)
    for name in friction if "yield_coefficient" in inputs else ():
        if name != "yield_acceleration":
            raise InputError(f"variables: {name} needs theta and mu_s in place of yield_coefficient")
    if friction:
        tasks.append(_friction_task(problem, friction, inputs))
    amplitude = ("amplitude",) if "amplitude" in wanted and "amplitude" not in coords else ()
    if amplitude:
        tasks.append(Task(engine.amplitudes, problem, amplitude, dims, grid_inputs.aligned(drive, dims)))
    return Plan(
        sizes,
        coords,
        tuple(tasks),
        tuple(name for name in wanted if any(name in task.names for task in tasks)),
        about("Permanent displacement of a rigid block, swept", problem, coords),
        cost,
    )


def plan_friction_parameters(inputs: grid_inputs.Inputs, *, model: Any = "mendez") -> Plan:
    """Plan of `slipsweep.friction_parameters`; as `plan_sweep`."""
    problem = problems.check_problem("sine", model, "auto")
    check_given(inputs.given, ("theta", "mu_s", "amplitude"))
    coords = grid_inputs.checked(inputs.given, problem.model.g)
    names = (*(name for name in known.FRICTION_PARAMETERS if name not in coords), "sliding_mode", "validity")
    task = _friction_task(problem, names, coords)
    attrs = {"title": "Friction parameters", **_SOURCE, **options.MODELS.attributes(problem.model)}
    return Plan(task.sizes, coords, (task,), names, attrs)


def check_dimensions(sizes: Mapping[str, int], coords: Mapping[str, xr.Variable], results: Collection[str]) -> None:
    """Refuse dimensions that no dataset can have with what is in it; DataArrays may name any."""
    for dim in sizes:
        if dim in results:
            raise InputError(f"{dim}: is the name of a result: must not be that of a dimension as well")
        if dim in coords and dim not in coords[dim].dims:
            raise InputError(f"{dim}: is a dimension of another parameter: must have values along it")


def _friction_task(problem: problems.Problem, names: tuple[str, ...], variables: Mapping[str, xr.Variable]) -> Task:
    """Eqs. 7-11 on the dimensions they depend on."""
    made = ("displacement_amplitude", "frequency") if "displacement_amplitude" in variables else ()
    own = {name: variable for name, variable in variables.items() if name in (*_FRICTION_INPUTS, *made)}
    drive = made[0] if made else "amplitude"
    for name in ("delta_mu", "decay_rate"):
        if name in names and (own[drive].values == 0.0).any():
            raise InputError(f"{drive} = 0: has no finite {name} (Eqs. 6, 11); must be > 0, or {name} be given")
    sizes = grid_inputs.grid_sizes(own)
    return Task(engine.friction_parameters, problem, names, sizes, grid_inputs.aligned(own, sizes))


_ADVICE = "ask for fewer variables or cells, or give chunks= for a lazy result"

_SOURCE = {"source": f"slipsweep {__version__}", "references": known.REFERENCE}


def about(title: str, problem: problems.Problem, given: Collection[str]) -> dict[str, Any]:
    """What results say of themselves: the choices read back from it are those of the problem."""
    inputs = {"friction_inputs": options.friction_inputs(problem.model.name, given)}
    motion = problem.excitation
    shaking: Mapping[str, Any]
    if isinstance(motion, Record):
        shaking = {"record": motion.name, **motion.attrs}
    elif isinstance(motion, Suite):
        shaking = motion.attrs
    else:
        shaking = waveforms.WAVEFORMS.attributes(motion) | options.SOLVERS.attributes(problem.solver)
    return {"title": title, **_SOURCE, **options.MODELS.attributes(problem.model), **inputs, **shaking}
