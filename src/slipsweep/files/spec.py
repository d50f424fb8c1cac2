"""Sweep files: TOML text in, the arguments of `slipsweep.sweep` out.

Two steps, either of which may refuse a file: pydantic checks keys, types and words
(the classes below are the schema), then plain functions check what one table cannot
know of another, turn axes into arrays and convert their units.  Every refusal is an
`InputError` of one line, ``FILE: key = VALUE: what is allowed``.
"""

import itertools
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from slipsweep.errors import InputError, did_you_mean
from slipsweep.files.motions import read_embedded
from slipsweep.files.outputs import Read
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.model.choices import Family, declared
from slipsweep.model.options import MODELS, SOLVERS, Model, Newmark, Solver
from slipsweep.model.parameters import BOUNDS
from slipsweep.model.units import conversion, show
from slipsweep.model.variables import (
    DEFAULT_RECORD_RESULTS,
    DEFAULT_RESULTS,
    DEFAULT_SUITE_RESULTS,
    DRAWN,
    PARAMETERS,
    RECORD_INPUTS,
    RECORD_RESULTS,
    RESULTS,
    STRENGTHS,
    WAVEFORM_INPUTS,
)
from slipsweep.motion.reading import Reading
from slipsweep.motion.records import Record, read_record
from slipsweep.motion.suites import Suite, suite_in
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

if TYPE_CHECKING:
    from slipsweep.grid.inputs import Inputs
    from slipsweep.studies.sampling import Sampling

Floats = NDArray[np.float64]

#: Parameters that [model] may give as one number for the whole sweep.
_MODEL_PARAMETERS = (
    "yield_acceleration", "yield_coefficient", "decay_rate", "delta_mu", "minimum_friction", "structure_frequency",
)  # fmt: skip

#: Inputs that [axes] and [[cases]] may give; `polarity` is one of [excitation].
_INPUTS = tuple(name for name in PARAMETERS if name != "polarity")

#: Keys of [excitation] that name recorded motions, and those that go with either of them.
_RECORDED = ("record", "records")
_RECORD_KEYS = (*_RECORDED, "pairs", *(one.name for one in declared(Reading)), "polarity")

#: What stands for standard input on a command line.
_STANDARD_INPUT = Path("-")

#: Largest number of points on one axis: 80 MB of coordinates, more than any grid can use.
_MOST_POINTS = 10_000_000

# --------------------------------------------------------------------------- the schema

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Whole = Annotated[int, Field(strict=True)]
Text = Annotated[str, Field(strict=True)]


def _coulomb_or_number(value: object) -> object:
    """Turn "coulomb" into None, which is what `sweep` takes for it."""
    if value == "coulomb":
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError('must be "coulomb" or a number in m/s2')
    return value


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class Axis(_Table):
    """One dimension: `values`, or `start`, `stop`, `num` and `spacing`.

    `units` is any unit that converts to the parameter's own, which is the default;
    "g" is the gravity of the sweep's own [model].
    """

    values: list[Number] | None = None
    start: Number | None = None
    stop: Number | None = None
    num: Annotated[Whole, Field(ge=2, le=_MOST_POINTS)] | None = None
    spacing: Literal["linear", "log"] = "linear"
    units: Text | None = None


def _table(name: str, about: str, fields: Mapping[str, Any]) -> Any:
    """The schema of a table whose keys are declared elsewhere."""
    return create_model(name, __base__=_Table, __doc__=about, **fields)


#: The dimensions of the grid.
Axes: Any = _table("Axes", "The dimensions of the grid.", dict.fromkeys(_INPUTS, (Axis | None, None)))

#: One row of [[cases]].
Case: Any = _table(
    "Case",
    "One row of [[cases]]: parameters that change together, along the dimension ``case``.",
    {"label": (Text | None, None)} | dict.fromkeys(_INPUTS, (Number | None, None)),
)


def _family(family: Family[Any], about: str, more: Mapping[str, Any]) -> Any:
    """The schema of a table that names a choice and gives its options, which the choice itself checks."""
    choice = {family.key: (Any, family.default)} | dict.fromkeys(family.options, (Any, None))
    return _table(family.keyword.title(), about, choice | dict(more))


#: Which model, its options, and parameters that are one number for the whole sweep.
ModelTable = _family(
    MODELS,
    "The model of the interface.",
    dict.fromkeys(_MODEL_PARAMETERS, (Number | None, None))
    | {"yield_acceleration": (Annotated[Number | None, BeforeValidator(_coulomb_or_number)], None)},
)

#: A path or a pattern.
_Name = Annotated[Text, Field(pattern=r"^[^\x00]+$")]

#: The shaking, but for its strength and its time, which are axes.
ExcitationTable = _family(
    WAVEFORMS,
    "The shaking.",
    {"record": (_Name | None, None), "records": (Any, None), "pairs": (list[Text] | None, None)}
    | {one.name: (Any, None) for one in declared(Reading)}
    | {"polarity": (Literal[1, -1, "both"], 1)},
)

#: How cells are solved.
SolverTable = _family(SOLVERS, "The solver.", {})


class Output(_Table):
    """Where the result goes and what it holds."""

    path: _Name | None = None
    title: Text = "Permanent displacement of a rigid block on a shaken inclined plane"
    variables: Annotated[list[Text], Field(min_length=1)] = list(DEFAULT_RESULTS)
    dtype: Literal["float64", "float32"] = "float64"
    compression: Annotated[int, Field(strict=True, ge=0, le=9)] = 0


#: One table of [uncertainty]; `slipsweep.studies.distributions` knows what each distribution may hold.
Drawn = dict[Text, Any]


class _Sampling(_Table):
    """How inputs are sampled, and the statistics wanted of the displacement."""

    samples: Whole = 4096
    method: Text = "sobol"
    seed: Whole = 0
    quantiles: list[Number] = [0.05, 0.5, 0.95]
    thresholds: list[Any] = [0.01, 0.1, 1.0]
    correlation: list[Any] = []
    sensitivity: Annotated[bool, Field(strict=True)] = False
    over: list[Text] = []

    def sampling(self, g: float) -> "Sampling":
        """What `slipsweep.studies.sampling` makes of the table (InputError: what is not allowed)."""
        from slipsweep.studies.sampling import check_sampling  # imports scipy: only for sweeps that need it

        return check_sampling(
            {name: drawn for name in DRAWN if (drawn := getattr(self, name)) is not None},
            samples=self.samples,
            method=self.method,
            seed=self.seed,
            quantiles=self.quantiles,
            thresholds=self.thresholds,
            correlation=self.correlation,
            sensitivity=self.sensitivity,
            over=self.over,
            g=g,
            keys="uncertainty.",
        )


#: Inputs that are drawn, and how.
Uncertainty: Any = create_model(
    "Uncertainty",
    __base__=_Sampling,
    **dict.fromkeys(DRAWN, (Drawn | None, None)),  # type: ignore[call-overload]
)

#: A sweep file as written: its tables, defaults filled in.
SweepFile = _table(
    "SweepFile",
    "A sweep file.",
    {
        "axes": (Axes, Axes()),
        "cases": (Annotated[list[Case], Field(min_length=1)] | None, None),
        "model": (ModelTable, ModelTable()),
        "excitation": (ExcitationTable, ExcitationTable()),
        "solver": (SolverTable, SolverTable()),
        "output": (Output, Output()),
        "uncertainty": (Uncertainty | None, None),
    },
)


# ----------------------------------------------------------------------- what comes out


class Parameter(NamedTuple):
    """Values of one input and the dimension they lie along (None: one number for all cells)."""

    dim: str | None
    values: Floats


@dataclass(frozen=True)
class SweepSpec:
    """A checked sweep: its grid, its options and the text it came from.

    Attributes
    ----------
    source : str
        The file, as the user named it.
    text : str
        The sweep file, verbatim.
    parameters : dict of str to Parameter
        Inputs in the units of `slipsweep.model.variables.PARAMETERS`.
    labels : tuple of str
        Names of the rows of [[cases]]; empty without them.
    model : Mendez or Newmark
    excitation : Waveform, Record or Suite
    solver : Cycle or Step
    output : Output
        The table of the sweep file.
    sampling : Sampling or None
        What [uncertainty] says; such a sweep gives statistics of the displacement.
    files : tuple of Path or int
        The files that were read for it, by name or descriptor.
    """

    source: str
    text: str
    parameters: dict[str, Parameter]
    labels: tuple[str, ...]
    model: Model
    excitation: Waveform | Record | Suite
    solver: Solver
    output: Output
    sampling: "Sampling | None" = None
    files: tuple[Read, ...] = ()

    @property
    def recorded(self) -> Record | Suite | None:
        """The recorded motion or motions, where these are the shaking."""
        return None if isinstance(self.excitation, Waveform) else self.excitation

    def plan(self) -> "AnyPlan":
        """Return what the sweep file asks for: a sweep, or the statistics of samples.

        Raises
        ------
        InputError
            What only the plan can know is not allowed.
        """
        # these import numba, and scipy: not for sweeps that are only looked at
        with self._named():
            if self.sampling is None:
                from slipsweep.grid.plans import plan_sweep

                return plan_sweep(
                    self.inputs(),
                    excitation=self.excitation,
                    model=self.model,
                    solver=self.solver,
                    variables=list(self.output.variables),
                )
            from slipsweep.studies.uncertainty import plan_samples

            return plan_samples(
                self.sampling, self.inputs(), excitation=self.excitation, model=self.model, solver=self.solver
            )

    def limits(self, displacement: float | list[float], maximum_amplitude: float | None = None) -> "AnyPlan":
        """Return the plan of `slipsweep.limit_amplitude` over all axes but the amplitude, by the cycle solver.

        Raises
        ------
        InputError
            As `plan`; or it is no sweep of which there are limits.
        """
        with self._named():
            if self.sampling is not None:
                raise InputError("has uncertain inputs; limits are those of a sweep without [uncertainty]")
            from slipsweep.studies.limits import plan_limits

            inputs = self.inputs().but(dict.fromkeys(("displacement_amplitude", *STRENGTHS)))
            return plan_limits(
                displacement,
                inputs,
                excitation=self.excitation,
                model=self.model,
                maximum_amplitude=maximum_amplitude,
            )

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Name the file in front of what is not allowed."""
        try:
            yield
        except InputError as error:
            raise InputError(f"{self.source}: {error}") from None

    def inputs(self) -> "Inputs":
        """Return the parameters of the sweep."""
        from slipsweep.grid.inputs import Inputs

        given: dict[str, Any] = {}
        for name, (dim, values) in self.parameters.items():
            if dim is None:
                given[name] = float(values)
            else:
                given[name] = values if dim == name else xr.DataArray(values, dims=(dim,))
        return Inputs(**given)


#: How netCDF files begin: netCDF-4, and the classic formats.
_NETCDF = (b"\x89HDF", b"CDF\x01", b"CDF\x02", b"CDF\x05")


def load(path: str | Path) -> SweepSpec:
    """Read and check a sweep.

    Parameters
    ----------
    path : str or Path
        A sweep file (TOML), or a netCDF file or Zarr store that `slipsweep run` wrote: then the sweep
        it was made from.  A sweep file may be a pipe, or ``-`` for standard input; the record
        that it names is then looked for in the folder that the command runs in.

    Returns
    -------
    SweepSpec

    Raises
    ------
    InputError
        The file cannot be read, or something in it is not allowed: one line that names
        the file, the key, its value and what is allowed.
    """
    path = Path(path)
    if (path / "zarr.json").is_file():
        return replace(_load_result(path), files=(path,))
    try:
        read: Read = 0 if path == _STANDARD_INPUT else path
        with open(read, "rb", closefd=read != 0) as file:
            content = file.read(4)
            is_netcdf = content.startswith(_NETCDF) or path.suffix == ".nc"
            if not is_netcdf:
                # utf-8-sig: some editors put a byte-order mark in front
                text = (content + file.read()).decode("utf-8-sig")
                sweep = parse(text, str(path), Path() if is_stream(path) else path.parent)
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a sweep file: it is not UTF-8 text") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if is_netcdf:
        sweep = _load_result(path)
    return replace(sweep, files=(read, *sweep.files))


def is_stream(path: Path) -> bool:
    """Whether a sweep is read from a pipe, a device or a shell's redirection: it has no folder and no name then."""
    if path == _STANDARD_INPUT or path.absolute().parts[1:2] in (("dev",), ("proc",)):
        return True
    return path.exists() and not (path.is_file() or path.is_dir())


def _load_result(path: Path) -> SweepSpec:
    from slipsweep.files.opening import read_result

    with read_result(path) as file:
        attributes = file.attrs
        recorded = read_embedded(file, path)
    if "sweep" not in attributes:
        raise InputError(f'{path}: no attribute "sweep": only a result of "slipsweep run" can be repeated')
    spec = parse(str(attributes["sweep"]), str(path), path.parent, recorded)
    # the solver that ran: it may have been chosen on the command line, over the sweep file's
    try:
        return replace(spec, solver=SOLVERS.from_attributes(attributes)) if "solver" in attributes else spec
    except (ValueError, TypeError) as error:  # InputError, and what numpy says of an array
        raise InputError(f"{path}: {error}") from None


def parse(text: str, source: str, folder: Path | None = None, recorded: Record | Suite | None = None) -> SweepSpec:
    """Check the text of a sweep file. See `load`.

    Parameters
    ----------
    text : str
    source : str
        What to call it in errors.
    folder : Path, optional
        Where its records are looked for; by default the folder that the command runs in.
    recorded : Record or Suite, optional
        These records, as a result has kept them: then no file is read.
    """
    try:
        # tomllib raises ValueError for integers too long to convert, RecursionError for deep nesting
        content = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{source}: not valid TOML: {_one_line(str(error))}") from None
    try:
        file = SweepFile.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{source}: {_one_line(_words(error))}") from None
    try:
        model = _chosen(MODELS, file.model, dict.fromkeys(_MODEL_PARAMETERS))
        sampling = file.uncertainty.sampling(model.g) if file.uncertainty is not None else None
        parameters = _parameters(file, model, sampling)
        excitation = recorded or _excitation(file.excitation, folder or Path())
        solver = _chosen(SOLVERS, file.solver, {})
        output = _output(file, parameters)
    except InputError as error:
        error.args = (f"{source}: {_one_line(str(error))}",)
        raise
    components = excitation.components if isinstance(excitation, Suite) else ()
    records = (excitation,) if isinstance(excitation, Record) else components
    files = () if recorded else tuple(Path(one.name) for one in records)
    labels = tuple(row.label or str(number) for number, row in enumerate(file.cases or (), 1))
    return SweepSpec(source, text, parameters, labels, model, excitation, solver, output, sampling, files)


def _chosen(family: Family[Any], table: BaseModel, others: Mapping[str, Any]) -> Any:
    """The choice that a table names, with its options; `others` are keys of the table that are none."""
    given = {name: value for name, value in table.model_dump(exclude_unset=True).items() if name not in others}
    name = given.pop(family.key, family.default)
    return family.made(name, given, lambda text: f"{family.keyword}.{text}")


def _excitation(table: Any, folder: Path) -> Waveform | Record | Suite:
    """What [excitation] says: a waveform, or the records in files."""
    key = _recorded(table)
    if key is None:
        waveform: Waveform = _chosen(WAVEFORMS, table, {})
        return waveform
    try:
        reading = Reading(**table.model_dump(exclude_unset=True, exclude={*_RECORDED, "pairs", "polarity"}))
    except InputError as error:
        raise InputError(f"excitation.{error}") from None
    try:
        if key == "record":
            return read_record(folder / table.record, **reading.options)
        return suite_in(folder, table.records, table.pairs, reading)
    except InputError as error:
        text = str(error).replace("paths", key, 1) if str(error).startswith("paths") else str(error)
        named = text.startswith((key, "pairs"))
        error.args = (f"excitation.{text}" if named else f"excitation.{key}: {text}",)
        raise


# ------------------------------------------------------------- from tables to parameters


def _parameters(file: Any, model: Model, sampling: "Sampling | None") -> dict[str, Parameter]:
    """Gather the inputs from [axes], [[cases]] and [model]: each once, none missing that is not drawn."""
    _check_shaking(file, model)
    axes = {name: axis for name in _INPUTS if (axis := getattr(file.axes, name)) is not None}
    cases = _cases(file.cases or [])
    # yield_acceleration = "coulomb" is None here: it only says what holds by default
    numbers = {name: value for name in _MODEL_PARAMETERS if (value := getattr(file.model, name)) is not None}

    for name in _INPUTS:
        tables = {"axes": axes, "cases": cases, "model": numbers}
        places = [f"{table}.{name}" for table, names in tables.items() if name in names]
        if len(places) > 1:
            raise InputError(f"{places[0]}: given twice, also as {places[1]}: give it once")
    given = {*axes, *cases, *numbers}
    if sampling is not None:
        sampling.check_given(tuple(given))
        given |= {*sampling.absolute}
    harmonic = _recorded(file.excitation) is None
    if given >= {"mu_s", "phi"}:
        raise InputError("axes.phi: not allowed beside mu_s: mu_s = tan(phi); give one of them")
    given |= {"mu_s"} if "phi" in given else set()
    interface = () if "yield_coefficient" in given else ("theta", "mu_s")
    for name in (*interface, *(["frequency"] if harmonic else [])):
        if name not in given:
            raise InputError(f"axes.{name}: missing: give it in [axes.{name}] or in every row of [[cases]]")
    if harmonic and not given & {"amplitude", "displacement_amplitude"}:
        raise InputError("axes.amplitude: missing: give amplitude or displacement_amplitude, in [axes] or [[cases]]")
    for first, other in itertools.combinations(("amplitude", "displacement_amplitude", *STRENGTHS[1:]), 2):
        if given >= {first, other}:
            raise InputError(f"axes.{other}: not allowed beside {first}: give one of them")

    parameters = {name: Parameter(name, _axis(name, axis, model.g)) for name, axis in axes.items()}
    parameters |= {name: Parameter("case", values) for name, values in cases.items()}
    for name, value in numbers.items():
        if _first_bad(name, np.array([value])) is not None:
            raise InputError(f"model.{name} = {value}: must be {BOUNDS[name].text}")
        parameters[name] = Parameter(None, np.array(value))
    if not harmonic:
        sign = file.excitation.polarity
        parameters["polarity"] = (
            Parameter("polarity", np.array([1, -1])) if sign == "both" else Parameter(None, np.array(sign))
        )
    return {name: parameters[name] for name in PARAMETERS if name in parameters}


def _check_shaking(file: Any, model: Model) -> None:
    """Refuse keys of a harmonic motion beside records, and keys of records without any."""
    given = file.excitation.model_fields_set
    key = _recorded(file.excitation)
    if key is None:
        for other in sorted(given & {*_RECORD_KEYS}):
            raise InputError(f"excitation.{other}: only beside excitation.record, the file of a recorded motion")
        for name in RECORD_INPUTS:
            if name not in WAVEFORM_INPUTS and (place := _place(file, name)):
                raise InputError(f"{place}: only with excitation.record, the file of a recorded motion")
        return
    if {*_RECORDED} <= given:
        raise InputError("excitation.records: not allowed beside record: give one of them")
    if key == "record" and "pairs" in given:
        raise InputError("excitation.pairs: only beside excitation.records, the files of a suite")
    why = f"not allowed with excitation.{key}"
    for key in sorted(given - {*_RECORD_KEYS}):
        raise InputError(f"excitation.{key}: {why}, which is the shaking itself")
    for name in ("displacement_amplitude", "frequency", "structure_frequency"):
        if place := _place(file, name):
            instead = "; give amplitude, or scale" if "amplitude" in name else ""
            raise InputError(f"{place}: {why}{instead}")
    for key in sorted(file.solver.model_fields_set):
        raise InputError(f"solver.{key}: {why}, to which the response is exact")
    for name in ("decay_rate", "delta_mu", "minimum_friction"):
        if isinstance(model, Newmark) and (place := _place(file, name)):
            raise InputError(f'{place}: not allowed with friction = "newmark", which has no friction law')


def _recorded(table: Any) -> str | None:
    """The key of [excitation] that names recorded motions; None of a waveform."""
    return next((key for key in _RECORDED if getattr(table, key) is not None), None)


def _place(file: Any, name: str) -> str | None:
    """Where an input is given first, as errors name it."""
    rows = {f"cases[row {number}]": row for number, row in enumerate(file.cases or (), 1)}
    drawn = {} if file.uncertainty is None else {"uncertainty": file.uncertainty}
    tables: dict[str, BaseModel] = {"axes": file.axes, **rows, "model": file.model, **drawn}
    return next((f"{key}.{name}" for key, table in tables.items() if getattr(table, name, None) is not None), None)


def _cases(rows: list[Any]) -> dict[str, Floats]:
    """Return the columns of [[cases]]."""
    if not rows:
        return {}
    columns = rows[0].model_fields_set - {"label"}
    if not columns:
        raise InputError("cases[row 1]: must give at least one parameter")
    for number, row in enumerate(rows, 1):
        given = row.model_fields_set - {"label"}
        for name in sorted(columns - given):
            raise InputError(f"cases[row {number}].{name}: missing: every row must give what row 1 gives")
        for name in sorted(given - columns):
            value = getattr(row, name)
            raise InputError(f"cases[row {number}].{name} = {value}: every row must give what row 1 gives, no more")
    table = {name: np.array([getattr(row, name) for row in rows]) for name in columns}
    for name, values in table.items():
        if (bad := _first_bad(name, values)) is not None:
            raise InputError(f"cases[row {bad + 1}].{name} = {values[bad]}: must be {BOUNDS[name].text}")
    return table


def _axis(name: str, axis: Axis, g: float) -> Floats:
    """Return an axis as an array in the parameter's own units."""
    key = f"axes.{name}"
    if axis.values is not None:
        for other in sorted(axis.model_fields_set & {"start", "stop", "num", "spacing"}):
            raise InputError(f"{key}.{other}: not allowed beside values")
        if not axis.values:
            raise InputError(f"{key}.values = []: must hold at least one number")
        numbers = np.array(axis.values)
        for i in np.flatnonzero(numbers[1:] <= numbers[:-1]):
            where = f"{key}.values[entry {i + 2}] = {numbers[i + 1]}"
            raise InputError(f"{where}: must be greater than the entry before it, {numbers[i]}")
    else:
        numbers = _spaced(key, axis)

    with np.errstate(over="ignore"):
        values = numbers * conversion(f"{key}.units", PARAMETERS[name]["units"], axis.units, g)
    if (bad := _first_bad(name, values)) is not None:
        where = f"values[entry {bad + 1}]" if axis.values is not None else "start" if bad == 0 else "stop"
        number = axis.stop if where == "stop" else numbers[bad]
        raise InputError(f"{key}.{where} = {number}: must be {BOUNDS[name].text}")
    if np.any(values[1:] <= values[:-1]):
        raise InputError(f"{key}: neighbouring values are the same number in double precision")
    return values


def _spaced(key: str, axis: Axis) -> Floats:
    for part in ("start", "stop", "num"):
        if getattr(axis, part) is None:
            raise InputError(f"{key}.{part}: missing: an axis is values = [...], or start, stop and num")
    assert axis.start is not None
    assert axis.stop is not None
    assert axis.num is not None
    if axis.stop <= axis.start:
        raise InputError(f"{key}.stop = {axis.stop}: must be greater than start, {axis.start}")
    if axis.spacing == "linear":
        with np.errstate(over="ignore", invalid="ignore"):
            return np.linspace(axis.start, axis.stop, axis.num)
    if axis.start <= 0:
        raise InputError(f'{key}.start = {axis.start}: must be positive with spacing = "log"')
    return np.geomspace(axis.start, axis.stop, axis.num)


def _first_bad(name: str, values: Floats) -> int | None:
    """Return where the first value lies that no physics allows of this parameter."""
    bad = np.flatnonzero(~BOUNDS[name].holds(values))
    return int(bad[0]) if bad.size else None


def _output(file: Any, parameters: Mapping[str, Parameter]) -> Output:
    """The table [output]; under a record all results are returned if none are named."""
    output: Output = file.output
    key = _recorded(file.excitation)
    if "variables" not in output.model_fields_set:
        named = {None: DEFAULT_RESULTS, "record": DEFAULT_RECORD_RESULTS, "records": DEFAULT_SUITE_RESULTS}[key]
        return output.model_copy(update={"variables": list(named)})
    variables = file.output.variables
    if file.uncertainty is not None:
        raise InputError("output.variables: not allowed beside [uncertainty], which has statistics as its results")
    known = RESULTS if key is None else RECORD_RESULTS
    for number, name in enumerate(variables, 1):
        where = f"output.variables[entry {number}] = {show(name)}"
        if name not in known:
            raise InputError(f"{where}: unknown variable; {did_you_mean(name, tuple(known))}")
        if name in parameters:
            raise InputError(f"{where}: it is an input of this sweep, hence a coordinate of the result already")
        if name == "amplitude":
            d, f = (parameters[one].dim for one in ("displacement_amplitude", "frequency"))
            if d is None or f is None or d == f:
                raise InputError(f"{where}: is a coordinate of the result already, as d and f do not span a grid")
        if name in variables[: number - 1]:
            raise InputError(f"{where}: must not be repeated")
    return output


# --------------------------------------------------------------------- errors into words


def _words(error: ValidationError) -> str:
    """Put the first of pydantic's complaints as ``key = VALUE: what is allowed``."""
    # an unknown key first: misspelling a key also makes it missing
    found = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")[0]
    location, kind, message = found["loc"], found["type"], found["msg"]
    key = ""
    for part in location:
        if isinstance(part, str):
            key += f".{part}" if key else part
        else:
            key += f"[{'row' if key == 'cases' else 'entry'} {part + 1}]"
    if kind == "extra_forbidden":
        return f"{key}: unknown key; {did_you_mean(str(location[-1]), _keys_beside(location))}"
    message = {"model_type": "must be a table", "list_type": "must be a list"}.get(kind, message)
    message = re.sub("^(Input|String|List) should", "must", message.removeprefix("Value error, "))
    message = message.removesuffix(" after validation, not 0")
    return f"{key} = {show(found['input'])}: {message}"


def _keys_beside(location: tuple[int | str, ...]) -> tuple[str, ...]:
    """Keys that the table of an unknown key may hold."""
    table: type[BaseModel] = SweepFile
    for part in location[:-1]:
        if isinstance(part, str):
            annotation = table.model_fields[part].annotation
            # the table itself, or the one inside `list[...] | None`
            while not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
                annotation = get_args(annotation)[0]
            table = annotation
    return tuple(table.model_fields)


#: Longest message about a sweep file.
_MOST_CHARACTERS = 600


def _one_line(message: str) -> str:
    """Escape what a terminal would not print as it stands (a file may hold control characters), and cut the rest."""
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in message)
    return text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 3]}..."
