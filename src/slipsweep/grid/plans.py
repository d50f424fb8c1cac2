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
from slipsweep.grid import engine
from slipsweep.grid.chunks import Chunk, places
from slipsweep.grid.engine import Arrays, Request
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.problem import Problem
from slipsweep.grid.resources import check_memory, grid_text
from slipsweep.grid.solvers import ROWS
from slipsweep.grid.tally import Tally
from slipsweep.model.options import MODELS, SOLVERS, Cycle, Model, Newmark, Step, friction_inputs
from slipsweep.model.parameters import (
    BOUNDS,
    check_choices,
    check_given,
    check_numbers,
    check_progress,
    check_values,
    number_text,
    shown,
)
from slipsweep.model.variables import (
    DEFAULT_RECORD_RESULTS,
    DEFAULT_RESULTS,
    DEFAULT_SUITE_RESULTS,
    DIMENSION_ORDER,
    FRICTION_PARAMETERS,
    INTERFACE_INPUTS,
    MOTION,
    MOTION_COORDINATES,
    PARAMETERS,
    RECORD_INPUTS,
    RECORD_RESULTS,
    REFERENCE,
    RESULT_DTYPES,
    RESULTS,
    STRENGTHS,
    WAVEFORM_INPUTS,
)
from slipsweep.motion.cutting import MOST_TABLES, TABLE_BYTES
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform, peak_acceleration

_FRICTION_INPUTS = (
    "theta", "mu_s", "amplitude", "yield_acceleration", "yield_coefficient", "decay_rate", "delta_mu",
    "minimum_friction",
)  # fmt: skip

#: Cells of which an array can count the bytes.
_MOST_CELLS = 2**59

#: Cells of the cycle solver that a cell of a record takes, about.
_RECORD_COST = 200


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

    solver: Callable[[Request], Arrays]
    problem: Problem
    names: tuple[str, ...]
    sizes: dict[str, int]
    inputs: Arrays

    @property
    def nbytes(self) -> int:
        """Bytes of the results."""
        return math.prod(self.sizes.values()) * sum(
            np.dtype(RESULT_DTYPES.get(name, "float64")).itemsize for name in self.names
        )

    def solve(self, progress: Callable[[int], None] | None = None) -> Arrays:
        """Compute the results; `progress` is told of cells as they are finished."""
        shape = tuple(self.sizes.values())
        return self.solver(Request(self.problem, shape, self.inputs, self.names, progress))

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
    described: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: RESULTS | RECORD_RESULTS)

    def __post_init__(self) -> None:
        check_dimensions(self.sizes, self.coords, self.names)

    @property
    def cells(self) -> int:
        """Number of cells of the grid."""
        return math.prod(self.sizes.values())

    def part(self, chunk: Chunk) -> "Plan":
        """The plan cut to a chunk of its grid."""
        tasks = tuple(task.part(tuple(places(chunk, task.sizes).values())) for task in self.tasks)
        sizes = {dim: cut.stop - cut.start for dim, cut in places(chunk, self.sizes).items()}
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
        check_memory(
            f"grid of {grid_text(sizes)}, {cells:.4g} cells",
            sum(task.nbytes for task in self.tasks) + cells * self.cell_memory,
            _ADVICE,
        )
        # all tasks cover the same cells: one of them counts
        return self.table(lambda task: task.solve(progress if task is self.tasks[0] else None))

    def template(self) -> xr.Dataset:
        """The results with their dimensions and coordinates but no values: zeros that take no memory."""

        def zeros(task: Task) -> dict[str, np.ndarray]:
            shape = tuple(task.sizes.values())
            return {name: np.broadcast_to(np.zeros((), RESULT_DTYPES.get(name, "f8")), shape) for name in task.names}

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
    inputs: Inputs,
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
    problem = check_problem(excitation, model, solver)
    parameters = check_parameters(problem, inputs)
    if isinstance(problem.excitation, (Record, Suite)):
        return _plan_records(problem, parameters, variables)
    return _plan_waveform(problem, parameters, variables)


def check_parameters(problem: Problem, inputs: Inputs) -> dict[str, xr.Variable]:
    """The parameters of a sweep, all that it needs and no others, as `checked` has them."""
    motion = problem.excitation
    parameters = inputs.given
    if isinstance(motion, Waveform):
        check_inputs(parameters, WAVEFORM_INPUTS, "a waveform")
        if ("amplitude" in parameters) == ("displacement_amplitude" in parameters):
            raise InputError("amplitude, displacement_amplitude: exactly one of them must be given")
        _check_interface(problem.model, parameters)
        check_given(parameters, ("frequency",))
        return checked(parameters, problem.model.g)
    check_inputs(parameters, RECORD_INPUTS, "a Suite" if isinstance(motion, Suite) else "a Record")
    _check_interface(problem.model, parameters)
    strengths = [name for name in STRENGTHS if name in parameters]
    if len(strengths) > 1:
        raise InputError(f"{', '.join(strengths[:2])}: must not both be given; either is the strength of the motion")
    if isinstance(motion, Suite) and motion.has_pairs:
        if "azimuth" not in parameters:
            raise InputError("azimuth: must be given with pairs of components")
    elif "azimuth" in parameters:
        raise InputError("azimuth: only with a Suite of pairs of components (read_suite: pairs)")
    if isinstance(problem.model, Newmark):
        for name in ("decay_rate", "delta_mu", "minimum_friction"):
            if name in parameters:
                raise InputError(f"{name}: not allowed with model = 'newmark', which has no friction law")
    polarity = _polarity(parameters.pop("polarity", 1))
    defaults = {"time_scale": 1.0} if strengths else {"scale": 1.0, "time_scale": 1.0}
    parameters = defaults | parameters
    found = checked({name: parameters[name] for name in PARAMETERS if name in parameters}, problem.model.g)
    found["polarity"] = polarity
    found |= motion_coordinates(motion, found)
    if strengths and strengths != ["scale"]:
        _check_moving(motion, found, strengths[0])
    return found


def _check_interface(model: Model, parameters: Mapping[str, Any]) -> None:
    """Refuse an interface that is not known, or known twice."""
    if "yield_coefficient" not in parameters:
        check_given(parameters, ("theta", "mu_s"))
        return
    if not isinstance(model, Newmark):
        raise InputError(
            f"yield_coefficient: not allowed with model = {model.name!r}, whose friction needs theta and mu_s; "
            "only with model = 'newmark'"
        )
    for name in INTERFACE_INPUTS:
        if name in parameters:
            raise InputError(f"{name}: not allowed beside yield_coefficient, which replaces it")


def motion_coordinates(motion: Record | Suite, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """The labels of a suite and its intensity measures: coordinates along `motion`, of pairs also along the azimuth."""
    if not isinstance(motion, Suite):
        return {}
    found = {"motion": xr.Variable(("motion",), np.array(motion.labels), MOTION)}
    found |= {name: xr.Variable(("motion",), one, MOTION_COORDINATES[name]) for name, one in motion.measures.items()}
    if motion.has_pairs:
        azimuth, places = coords["azimuth"], xr.Variable(("motion",), np.arange(len(motion)))
        sizes = grid_sizes({"azimuth": azimuth, "motion": places})
        both = aligned({"motion": places, "azimuth": azimuth}, sizes)
        at = np.broadcast_arrays(both["motion"], both["azimuth"], np.empty(tuple(sizes.values())))
        for name, one in motion.intensities(at[0], at[1]).items():
            found[name] = xr.Variable(tuple(sizes), one, MOTION_COORDINATES[name])
    return found


def inputs_of(problem: Problem, coords: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """The coordinates that cells are solved for: no friction angle; of a motion its place in the suite, and no more."""
    own = {name: one for name, one in coords.items() if name not in ("phi", *MOTION_COORDINATES)}
    suite = problem.excitation
    if not isinstance(suite, Suite):
        return own
    places = np.array([suite.index(str(label)) for label in coords["motion"].values], np.float64)
    return own | {"motion": xr.Variable(("motion",), places)}


def _check_moving(motion: Record | Suite, coords: Mapping[str, xr.Variable], strength: str) -> None:
    """Refuse to scale a motion that has no acceleration."""
    if isinstance(motion, Record):
        if not motion.peak > 0.0:
            raise InputError(f"{strength}: {motion.name} has no acceleration to scale; give scale")
        return
    peaks = coords["motion_pga"]
    still = np.argwhere(~(peaks.values > 0.0))
    if still.size:
        at = dict(zip(peaks.dims, still[0], strict=True))
        where = f" at azimuth {float(coords['azimuth'].isel(at, missing_dims='ignore')):g}" if motion.has_pairs else ""
        raise InputError(f"{strength}: {motion.labels[at['motion']]}{where} has no acceleration to scale; give scale")


def _polarity(given: Any) -> xr.Variable:
    """The signs asked for: 1, -1, both."""
    both = isinstance(given, str) and given == "both"
    try:
        values = check_numbers("polarity", (1, -1) if both else given)
    except InputError:
        values = np.empty(0)
    if values.ndim > 1 or not values.size or not np.isin(values, (1, -1)).all():
        raise InputError(f"polarity = {shown(given)}: must be 1, -1, a list of these, or 'both'")
    dims = ("polarity",) if values.ndim else ()
    return xr.Variable(dims, values.astype(np.int8), PARAMETERS["polarity"])


def _plan_records(problem: Problem, coords: dict[str, xr.Variable], variables: Any) -> Plan:
    """Plan of a sweep under a record or a suite; `coords` as `check_parameters` gives them."""
    is_suite = isinstance(problem.excitation, Suite)
    default = DEFAULT_SUITE_RESULTS if is_suite else DEFAULT_RECORD_RESULTS
    wanted = default if variables is None else check_choices("variables", variables, RECORD_RESULTS)
    inputs = inputs_of(problem, coords)
    sizes = grid_sizes(inputs)
    tasks = _motion_tasks(problem, [name for name in RECORD_RESULTS if name in wanted], sizes, aligned(inputs, sizes))
    cost = cost_of(problem) * max(len(tasks), 1)
    if "motion_factor" in wanted:
        tasks.append(_factor_task(problem, inputs))
    motions = "suite of recorded motions" if is_suite else "recorded motion"
    attrs = about(f"Response of a rigid block to a {motions}", problem, coords)
    return Plan(sizes, coords, tuple(tasks), wanted, attrs, cost, memory=memory_of(problem))


def _factor_task(problem: Problem, inputs: Mapping[str, xr.Variable]) -> Task:
    """The factor on each motion, on the dimensions it depends on."""
    strength = next(name for name in STRENGTHS if name in inputs)
    names = [strength, *(["time_scale"] if strength in ("pgv", "arias_intensity") else []), "azimuth", "motion"]
    own = {name: inputs[name] for name in names if name in inputs}
    sizes = grid_sizes(own)
    return Task(engine.factors, problem, ("motion_factor",), sizes, aligned(own, sizes))


def _motion_tasks(problem: Problem, wanted: Collection[str], sizes: dict[str, int], inputs: Arrays) -> list[Task]:
    """The motion of the block, and of Newmark's on the same cells."""
    tasks = []
    if motion := tuple(name for name in wanted if name in ROWS and name != "newmark_displacement"):
        tasks.append(Task(engine.solve, problem, motion, sizes, inputs))
    if "newmark_displacement" in wanted:
        classical = replace(problem, model=Newmark(problem.model.g))
        tasks.append(Task(engine.solve, classical, ("newmark_displacement",), sizes, inputs))
    return tasks


def _plan_waveform(problem: Problem, coords: dict[str, xr.Variable], variables: Any) -> Plan:
    """Plan of a sweep under a waveform; `coords` as `check_parameters` gives them."""
    wanted = DEFAULT_RESULTS if variables is None else check_choices("variables", variables, RESULTS)
    sizes, inputs = grid_sizes(coords), inputs_of(problem, coords)
    drive: dict[str, xr.Variable] = {
        name: coords[name] for name in ("displacement_amplitude", "frequency") if name in coords
    }
    if len(drive) == 2:
        _check_amplitudes(**drive)
        dims = grid_sizes(drive)
        # as a coordinate it takes no more than what it is made of, and on a grid of the two as much as a result
        if any(dims.keys() == set(variable.dims) for variable in drive.values()):
            both = aligned(drive, dims)
            amplitudes = xr.Variable(tuple(dims), peak_acceleration(**both), PARAMETERS["amplitude"])
            coords = coords | {"amplitude": amplitudes}

    tasks = _motion_tasks(problem, wanted, sizes, aligned(inputs, sizes))
    cost = cost_of(problem) * max(len(tasks), 1)
    # one that was given is a coordinate already
    friction = tuple(name for name in FRICTION_PARAMETERS if name in wanted and name not in inputs)
    for name in friction if "yield_coefficient" in inputs else ():
        if name != "yield_acceleration":
            raise InputError(f"variables: {name} needs theta and mu_s in place of yield_coefficient")
    if friction:
        tasks.append(_friction_task(problem, friction, inputs))
    amplitude = ("amplitude",) if "amplitude" in wanted and "amplitude" not in coords else ()
    if amplitude:
        tasks.append(Task(engine.amplitudes, problem, amplitude, dims, aligned(drive, dims)))
    return Plan(
        sizes,
        coords,
        tuple(tasks),
        tuple(name for name in wanted if any(name in task.names for task in tasks)),
        about("Permanent displacement of a rigid block, swept", problem, coords),
        cost,
    )


def plan_friction_parameters(inputs: Inputs, *, model: Any = "mendez") -> Plan:
    """Plan of `slipsweep.friction_parameters`; as `plan_sweep`."""
    problem = check_problem("sine", model, "auto")
    check_given(inputs.given, ("theta", "mu_s", "amplitude"))
    coords = checked(inputs.given, problem.model.g)
    names = (*(name for name in FRICTION_PARAMETERS if name not in coords), "sliding_mode", "validity")
    task = _friction_task(problem, names, coords)
    attrs = {"title": "Friction parameters", **_SOURCE, **MODELS.attributes(problem.model)}
    return Plan(task.sizes, coords, (task,), names, attrs)


def check_problem(excitation: Any, model: Any, solver: Any) -> Problem:
    """What is to be solved, and how; each is an object, or the name of one with its defaults."""
    motion = excitation if isinstance(excitation, (Record, Suite)) else WAVEFORMS.of(excitation)
    chosen = SOLVERS.of(solver)
    if isinstance(motion, (Record, Suite)) and not isinstance(chosen, Cycle):
        raise InputError(f"solver = {chosen}: not allowed with a {type(motion).__name__}, to which Cycle() is exact")
    return Problem(MODELS.of(model), motion, chosen)


def check_inputs(given: Collection[str], shaking: Collection[str], what: str) -> None:
    """Refuse inputs of another kind of shaking."""
    others = {*WAVEFORM_INPUTS, *RECORD_INPUTS} - {*shaking}
    for name in given:
        if name in others:
            raise InputError(f"{name}: not allowed with {what}, which takes {', '.join(shaking)}")


def checked(parameters: Mapping[str, Any], g: float) -> dict[str, xr.Variable]:
    """Every parameter as a float64 array with named dimensions, within its bounds, described.

    `g` is what "g" as the unit of an array stands for.
    """
    checked = {}
    for name, given in parameters.items():
        if isinstance(given, (xr.Variable, xr.DataArray)):
            dims = tuple(map(str, given.dims))
            if len(set(dims)) < len(dims):
                raise InputError(f"{name}: dimensions {', '.join(dims)}: must be named each once")
            variable = xr.Variable(dims, check_values(name, given, g=g), {**given.attrs, **PARAMETERS[name]})
        else:
            values = check_values(name, given, g=g)
            if values.ndim > 1:
                raise InputError(
                    f"{name}: an array of {values.ndim} dimensions; must be a scalar, a 1-D array, or a DataArray "
                    "that names its dimensions"
                )
            variable = xr.Variable((name,) if values.ndim else (), values, PARAMETERS[name])
        if variable.values.size == 0:
            raise InputError(f"{name} = []: must hold at least one value")
        checked[name] = variable
        if name == "mu_s" and isinstance(given, xr.DataArray) and "phi" in given.coords:
            checked["phi"] = given["phi"].variable.to_base_variable()
    return checked


def _check_amplitudes(displacement_amplitude: xr.Variable, frequency: xr.Variable) -> None:
    """Refuse peak displacements that make an amplitude out of its bounds: A grows with both."""
    d, f = displacement_amplitude.values.max(), frequency.values.max()
    if not BOUNDS["amplitude"].holds(peak_acceleration(d, f)):
        raise InputError(
            f"displacement_amplitude = {number_text(float(d))}: with frequency = {number_text(float(f))} its amplitude "
            f"A = (2 pi f)^2 d must be {BOUNDS['amplitude'].text}"
        )


def check_dimensions(sizes: Mapping[str, int], coords: Mapping[str, xr.Variable], results: Collection[str]) -> None:
    """Refuse dimensions that no dataset can have beside what is in it, or of that length; DataArrays may name any."""
    if (cells := math.prod(sizes.values())) > _MOST_CELLS:
        raise InputError(f"grid of {grid_text(sizes)}, {cells:.4g} cells: must be {_MOST_CELLS:.4g} cells at most")
    for dim in sizes:
        if dim in results:
            raise InputError(f"{dim}: is the name of a result: must not be that of a dimension as well")
        if dim in coords and dim not in coords[dim].dims:
            raise InputError(f"{dim}: is a dimension of another parameter: must have values along it")


def grid_sizes(variables: Mapping[str, xr.Variable]) -> dict[str, int]:
    """Dimensions of the grid in the order of the results, and their lengths."""
    sizes: dict[str, int] = {}
    for name, variable in variables.items():
        for dim, size in zip(map(str, variable.dims), variable.shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise InputError(f"{name}: {size} values along {dim!r}, where another parameter has {sizes[dim]}")
    ordered = [dim for dim in DIMENSION_ORDER if dim in sizes] + [dim for dim in sizes if dim not in DIMENSION_ORDER]
    return {dim: sizes[dim] for dim in ordered}


def aligned(variables: Mapping[str, xr.Variable], sizes: Mapping[str, int]) -> Arrays:
    """Plain arrays with all dimensions, of length 1 where they do not vary."""
    aligned = {}
    for name, variable in variables.items():
        own = variable.values.transpose([variable.dims.index(dim) for dim in sizes if dim in variable.dims])
        aligned[name] = own.reshape([variable.sizes.get(dim, 1) for dim in sizes])
    return aligned


def _friction_task(problem: Problem, names: tuple[str, ...], variables: Mapping[str, xr.Variable]) -> Task:
    """Eqs. 7-11 on the dimensions they depend on."""
    made = ("displacement_amplitude", "frequency") if "displacement_amplitude" in variables else ()
    own = {name: variable for name, variable in variables.items() if name in (*_FRICTION_INPUTS, *made)}
    drive = made[0] if made else "amplitude"
    for name in ("delta_mu", "decay_rate"):
        if name in names and (own[drive].values == 0.0).any():
            raise InputError(f"{drive} = 0: has no finite {name} (Eqs. 6, 11); must be > 0, or {name} be given")
    sizes = grid_sizes(own)
    return Task(engine.friction_parameters, problem, names, sizes, aligned(own, sizes))


def memory_of(problem: Problem) -> int:
    """Bytes of the tables of pieces of recorded motions, while cells are solved."""
    if isinstance(problem.excitation, Waveform):
        return 0
    suite = problem.excitation
    lengths = [one.times.size for one in (suite if isinstance(suite, Suite) else (suite,))]
    # of two polarities; one table is made beside those that are kept
    kept = sorted(2 * lengths)[-MOST_TABLES:]
    return TABLE_BYTES * (max(lengths) + sum(kept))


def cost_of(problem: Problem) -> float:
    """What a cell takes, in cells of the cycle solver."""
    if isinstance(problem.excitation, (Record, Suite)):
        return _RECORD_COST
    return 1.0 + problem.solver.steps_per_cycle / 16 if isinstance(problem.solver, Step) else 1.0


_ADVICE = "ask for fewer variables or cells, or give chunks= for a lazy result"

_SOURCE = {"source": f"slipsweep {__version__}", "references": REFERENCE}


def about(title: str, problem: Problem, given: Collection[str]) -> dict[str, Any]:
    """What results say of themselves: the choices read back from it are those of the problem."""
    inputs = {"friction_inputs": friction_inputs(problem.model.name, given)}
    motion = problem.excitation
    shaking: Mapping[str, Any]
    if isinstance(motion, Record):
        shaking = {"record": motion.name, **motion.attrs}
    elif isinstance(motion, Suite):
        shaking = motion.attrs
    else:
        shaking = WAVEFORMS.attributes(motion) | SOLVERS.attributes(problem.solver)
    return {"title": title, **_SOURCE, **MODELS.attributes(problem.model), **inputs, **shaking}
