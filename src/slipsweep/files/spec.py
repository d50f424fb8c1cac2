"""Sweep files: TOML text in, the arguments of `slipsweep.sweep` out.

Two steps, either of which may refuse a file: pydantic checks keys, types and words
(the classes below are the schema), then plain functions check what one table cannot
know of another, turn axes into arrays and convert their units.  Every refusal is an
`InputError` of one line, ``FILE: key = VALUE: what is allowed``.
"""

import json
import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from slipsweep.errors import InputError
from slipsweep.files.names import open_netcdf
from slipsweep.files.outputs import Read
from slipsweep.grid.tables import Variable
from slipsweep.model.parameters import BOUNDS, MOST_CYCLES, MOST_STEPS
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.variables import (
    DEFAULT_RESULTS,
    DIMENSION_ORDER,
    PARAMETERS,
    RECORD_PARAMETERS,
    RECORD_RESULTS,
    RECORD_SAMPLES,
    RESULT_DTYPES,
    RESULTS,
)
from slipsweep.motion.records import Record, read_record
from slipsweep.motion.waveforms import check_waveform

if TYPE_CHECKING:
    from slipsweep.studies.uncertainty import Sampling

Floats = NDArray[np.float64]

#: Parameters that [model] may give as one number for the whole sweep.
_MODEL_PARAMETERS = ("yield_acceleration", "decay_rate", "delta_mu", "minimum_friction", "structure_frequency")

#: What shakes the block without a record, which has neither; `structure_frequency` is compared with the second.
_HARMONIC = ("amplitude", "displacement_amplitude", "frequency", "structure_frequency")

#: Inputs that [axes] and [[cases]] may give; `polarity` is one of [excitation].
_INPUTS = PARAMETERS | {name: attrs for name, attrs in RECORD_PARAMETERS.items() if name != "polarity"}

#: Keys of [excitation] that go with a record, and no other.
_RECORD_KEYS = ("record", "units", "baseline", "format", "channel", "polarity")

#: What stands for standard input on a command line.
_STANDARD_INPUT = Path("-")

#: A million cases; what is larger is no sweep file (a device, an archive).
_MOST_BYTES = 200_000_000

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
    model_config = ConfigDict(extra="forbid", frozen=True)


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


class Axes(_Table):
    """The dimensions of the grid."""

    theta: Axis | None = None
    mu_s: Axis | None = None
    amplitude: Axis | None = None
    displacement_amplitude: Axis | None = None
    frequency: Axis | None = None
    yield_acceleration: Axis | None = None
    decay_rate: Axis | None = None
    delta_mu: Axis | None = None
    minimum_friction: Axis | None = None
    structure_frequency: Axis | None = None
    scale: Axis | None = None
    time_scale: Axis | None = None


class Case(_Table):
    """One row of [[cases]]: parameters that change together, along the dimension ``case``."""

    label: Text | None = None
    theta: Number | None = None
    mu_s: Number | None = None
    amplitude: Number | None = None
    displacement_amplitude: Number | None = None
    frequency: Number | None = None
    yield_acceleration: Number | None = None
    decay_rate: Number | None = None
    delta_mu: Number | None = None
    minimum_friction: Number | None = None
    structure_frequency: Number | None = None
    scale: Number | None = None
    time_scale: Number | None = None


class Model(_Table):
    """Which model, its options, and parameters that are one number for the whole sweep."""

    friction: Literal["mendez", "newmark"] = "mendez"
    rise: Literal["monotone", "literal"] = "monotone"
    recoupling: Literal["eq12", "integrate"] = "eq12"
    yield_acceleration: Annotated[Number | None, BeforeValidator(_coulomb_or_number)] = None
    decay_rate: Number | None = None
    delta_mu: Number | None = None
    minimum_friction: Number | None = None
    structure_frequency: Number | None = None
    g: Annotated[Number, Field(gt=0)] = 9.81


class Harmonics(_Table):
    """Terms of waveform = "harmonics", a sin(m phi + p) each; phases in degrees."""

    amplitudes: Annotated[list[Number], Field(min_length=1)]
    multiples: Annotated[list[Whole], Field(min_length=1)]
    phases: list[Number] | None = None


class Excitation(_Table):
    """The shaking, but for its amplitude and frequency, or the scales of a record, which are axes."""

    waveform: Literal["sine", "cosine", "triangle", "square", "harmonics"] = "sine"
    cycles: Annotated[Whole, Field(ge=1, le=MOST_CYCLES)] = 10
    harmonics: Harmonics | None = None
    ramp_in: Number = 0.0
    ramp_out: Number = 0.0
    record: Annotated[Text, Field(pattern=r"^[^\x00]+$")] | None = None
    units: Literal["m/s2", "g", "cm/s2", "gal"] | None = None
    baseline: Literal["none", "mean", "linear"] = "none"
    format: Literal["auto", "csv", "at2", "esm", "cosmos"] = "auto"
    channel: Annotated[Whole, Field(ge=1)] | None = None
    polarity: Literal[1, -1, "both"] = 1

    @property
    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of `slipsweep.sweep`."""
        return {**self.model_dump(exclude={"harmonics", *_RECORD_KEYS}), "harmonics": self._columns()}

    def _columns(self) -> dict[str, Any] | None:
        return None if self.harmonics is None else self.harmonics.model_dump(exclude_none=True)


class Solver(_Table):
    """How cells are solved; `steps_per_cycle` and `rule` matter to the step solver alone."""

    method: Literal["auto", "step", "cycle"] = "auto"
    steps_per_cycle: Annotated[Whole, Field(ge=8, le=MOST_STEPS, multiple_of=4)] | None = None
    rule: Literal["rectangle", "trapezoid", "simpson"] = "trapezoid"


class Output(_Table):
    """Where the result goes and what it holds."""

    path: Annotated[Text, Field(pattern=r"^[^\x00]+$")] | None = None
    title: Text = "Permanent displacement of a rigid block on a shaken inclined plane"
    variables: Annotated[list[Text], Field(min_length=1)] = list(DEFAULT_RESULTS)
    dtype: Literal["float64", "float32"] = "float64"


#: One table of [uncertainty]; `slipsweep.studies.uncertainty` knows what each distribution may hold.
Drawn = dict[Text, Any]


class Uncertainty(_Table):
    """Inputs that are drawn, how they are sampled, and the statistics wanted of the displacement."""

    samples: Whole = 4096
    method: Text = "sobol"
    seed: Whole = 0
    quantiles: list[Number] = [0.05, 0.5, 0.95]
    thresholds: list[Any] = [0.01, 0.1, 1.0]
    correlation: list[Any] = []
    theta: Drawn | None = None
    mu_s: Drawn | None = None
    amplitude: Drawn | None = None
    displacement_amplitude: Drawn | None = None
    frequency: Drawn | None = None
    yield_acceleration: Drawn | None = None
    decay_rate: Drawn | None = None
    delta_mu: Drawn | None = None
    minimum_friction: Drawn | None = None

    def sampling(self, g: float) -> "Sampling":
        """What `slipsweep.studies.uncertainty` makes of the table (InputError: what is not allowed)."""
        from slipsweep.studies.uncertainty import DRAWN, check_sampling  # imports scipy: only for sweeps that need it

        return check_sampling(
            {name: drawn for name in DRAWN if (drawn := getattr(self, name)) is not None},
            samples=self.samples,
            method=self.method,
            seed=self.seed,
            quantiles=self.quantiles,
            thresholds=self.thresholds,
            correlation=self.correlation,
            g=g,
            keys="uncertainty.",
        )


class SweepFile(_Table):
    """A sweep file as written: its tables, defaults filled in."""

    axes: Axes = Axes()
    cases: Annotated[list[Case], Field(min_length=1)] | None = None
    model: Model = Model()
    excitation: Excitation = Excitation()
    solver: Solver = Solver()
    output: Output = Output()
    uncertainty: Uncertainty | None = None


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
    model, excitation, solver, output
        The tables of the sweep file.
    sampling : Sampling or None
        What [uncertainty] says; such a sweep gives statistics of the displacement.
    record : Record, optional
        The motion of [excitation] record.
    files : tuple of Path or int
        The files that were read for it, by name or descriptor.
    """

    source: str
    text: str
    parameters: dict[str, Parameter]
    labels: tuple[str, ...]
    model: Model
    excitation: Excitation
    solver: Solver
    output: Output
    sampling: "Sampling | None" = None
    record: Record | None = None
    files: tuple[Read, ...] = ()

    @property
    def shape(self) -> dict[str, int]:
        """Dimensions in the order of the results, and their lengths."""
        lengths = {p.dim: p.values.size for p in self.parameters.values() if p.dim is not None}
        return {dim: lengths[dim] for dim in (*DIMENSION_ORDER, "case") if dim in lengths}

    @property
    def cells(self) -> int:
        """Number of cells of the grid."""
        return math.prod(self.shape.values())

    def dtype(self, variable: str) -> np.dtype[Any]:
        """Data type of a result in the file."""
        return np.dtype(RESULT_DTYPES.get(variable, self.output.dtype))

    @property
    def nbytes(self) -> int:
        """Bytes of all results, uncompressed."""
        return self.cells * sum(self.dtype(name).itemsize for name in self.output.variables)

    def with_solver(self, method: Literal["auto", "step", "cycle"]) -> "SweepSpec":
        """Return the same sweep under another solver."""
        return replace(self, solver=self.solver.model_copy(update={"method": method}))

    def arguments(self, block: Mapping[str, slice] | None = None) -> dict[str, Any]:
        """Return keyword arguments for `slipsweep.sweep` (or `slipsweep.grid.plans.plan_sweep`).

        Those of a record are for `slipsweep.studies.record_sweeps.plan_record`.

        Parameters
        ----------
        block : mapping of dimension to slice, optional
            The part of the grid that is wanted; dimensions not named are taken whole.
        """
        block = block or {}
        arguments: dict[str, Any] = {}
        for name, (dim, values) in self.parameters.items():
            if dim is None:
                arguments[name] = float(values)
            elif dim == name:
                arguments[name] = values[block.get(dim, slice(None))]
            else:
                arguments[name] = Variable((dim,), values[block.get(dim, slice(None))])
        arguments |= {"model": self.model.friction, "g": self.model.g, "variables": list(self.output.variables)}
        if self.model.friction == "mendez":
            arguments |= {"rise": self.model.rise, "recoupling": self.model.recoupling}
        if self.record is not None:
            return {"record": self.record, **arguments}
        arguments |= {
            **self.excitation.arguments,
            "solver": self.solver.method,
            "rule": self.solver.rule,
        }
        if self.solver.steps_per_cycle is not None:
            arguments["steps_per_cycle"] = self.solver.steps_per_cycle
        return arguments


def load(path: str | Path) -> SweepSpec:
    """Read and check a sweep.

    Parameters
    ----------
    path : str or Path
        A sweep file (TOML), or a netCDF file that `slipsweep run` wrote: then the sweep
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
    try:
        stream = is_stream(path)
        read: Read = 0 if path == _STANDARD_INPUT else path
        with open(read, "rb", closefd=read != 0) as file:
            content = file.read(4)
            is_netcdf = content == b"\x89HDF" or (path.suffix == ".nc" and not stream)
            if is_netcdf and stream:
                raise InputError(f"{path}: is a netCDF file, which cannot be read from a pipe; give it by name")
            if not is_netcdf:
                content += file.read(_MOST_BYTES - 3)
                if len(content) > _MOST_BYTES:
                    raise InputError(f"{path}: not a sweep file: it has more than {_MOST_BYTES} bytes")
                # utf-8-sig: some editors put a byte-order mark in front
                sweep = parse(content.decode("utf-8-sig"), str(path), Path() if stream else path.parent)
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
    try:
        with open_netcdf(path) as file:
            attributes = {name: str(file.getncattr(name)) for name in file.ncattrs()}
            kept = RECORD_SAMPLES.keys() <= file.variables.keys()
            times, acceleration = (np.asarray(file[name][...]) if kept else None for name in RECORD_SAMPLES)
    except OSError:
        raise InputError(f"{path}: not a netCDF file") from None
    if "sweep" not in attributes:
        raise InputError(f'{path}: no attribute "sweep": only a result of "slipsweep run" can be repeated')
    about = {name: text for name, text in attributes.items() if name == "baseline" or name.startswith("record")}
    record = None
    if times is not None and acceleration is not None:
        record = Record(times, acceleration, about.get("record", str(path)), about)
    spec = parse(attributes["sweep"], str(path), path.parent, record)
    # the solver that ran: it may have been chosen on the command line, over the sweep file's
    ran: Any = attributes.get("solver", spec.solver.method)
    return spec.with_solver(ran)


def parse(text: str, source: str, folder: Path | None = None, record: Record | None = None) -> SweepSpec:
    """Check the text of a sweep file. See `load`.

    Parameters
    ----------
    text : str
    source : str
        What to call it in errors.
    folder : Path, optional
        Where its record is looked for; by default the folder that the command runs in.
    record : Record, optional
        That record, as a result has kept it: then no file is read.
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
        sampling = file.uncertainty.sampling(file.model.g) if file.uncertainty is not None else None
        parameters = _parameters(file, sampling)
        _check_model(file)
        _check_excitation(file.excitation)
        _check_variables(file, parameters)
        files: tuple[Read, ...] = ()
        if file.excitation.record is not None and record is None:
            path = (folder or Path()) / file.excitation.record
            record, files = _read(file.excitation, path), (path,)
    except InputError as error:
        raise InputError(f"{source}: {_one_line(str(error))}") from None
    labels = tuple(row.label or str(number) for number, row in enumerate(file.cases or (), 1))
    excitation, output = file.excitation, file.output
    if excitation.record is not None and "variables" not in output.model_fields_set:
        output = output.model_copy(update={"variables": list(RECORD_RESULTS)})
    return SweepSpec(
        source, text, parameters, labels, file.model, excitation, file.solver, output, sampling, record, files
    )


# ------------------------------------------------------------- from tables to parameters


def _parameters(file: SweepFile, sampling: "Sampling | None") -> dict[str, Parameter]:
    """Gather the inputs from [axes], [[cases]] and [model]: each once, none missing that is not drawn."""
    _check_shaking(file)
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
    harmonic = file.excitation.record is None
    for name in ("theta", "mu_s", *(["frequency"] if harmonic else [])):
        if name not in given:
            raise InputError(f"axes.{name}: missing: give it in [axes.{name}] or in every row of [[cases]]")
    if harmonic and not given & {"amplitude", "displacement_amplitude"}:
        raise InputError("axes.amplitude: missing: give amplitude or displacement_amplitude, in [axes] or [[cases]]")
    if given >= {"amplitude", "displacement_amplitude"}:
        raise InputError("axes.displacement_amplitude: not allowed beside amplitude: give one of them")

    parameters = {name: Parameter(name, _axis(name, axis, file.model.g)) for name, axis in axes.items()}
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
    return {name: parameters[name] for name in PARAMETERS | RECORD_PARAMETERS if name in parameters}


def _check_shaking(file: SweepFile) -> None:
    """Refuse keys of a harmonic motion beside a record, and keys of a record without one."""
    given = file.excitation.model_fields_set
    if file.excitation.record is None:
        for key in sorted(given & {*_RECORD_KEYS}):
            raise InputError(f"excitation.{key}: only beside excitation.record, the file of a recorded motion")
        for name in ("scale", "time_scale"):
            if place := _place(file, name):
                raise InputError(f"{place}: only with excitation.record, the file of a recorded motion")
        return
    why = "not allowed with excitation.record"
    for key in sorted(given - {*_RECORD_KEYS}):
        raise InputError(f"excitation.{key}: {why}, which is the shaking itself")
    for name in _HARMONIC:
        if place := _place(file, name):
            instead = "; give scale, a factor on the recorded acceleration" if "amplitude" in name else ""
            raise InputError(f"{place}: {why}{instead}")
    if file.uncertainty is not None:
        raise InputError(f"uncertainty: {why}; draw the inputs of a harmonic motion")
    for key in sorted(file.solver.model_fields_set):
        raise InputError(f"solver.{key}: {why}, to which the response is exact")
    for name in ("decay_rate", "delta_mu", "minimum_friction"):
        if file.model.friction == "newmark" and (place := _place(file, name)):
            raise InputError(f'{place}: not allowed with friction = "newmark", which has no friction law')


def _place(file: SweepFile, name: str) -> str | None:
    """Where an input is given first, as errors name it."""
    rows = {f"cases[row {number}]": row for number, row in enumerate(file.cases or (), 1)}
    tables: dict[str, BaseModel] = {"axes": file.axes, **rows, "model": file.model}
    return next((f"{key}.{name}" for key, table in tables.items() if getattr(table, name, None) is not None), None)


def _read(excitation: Excitation, path: Path) -> Record:
    """Read the record of a sweep file."""
    try:
        return read_record(
            path,
            units=excitation.units,
            baseline=excitation.baseline,
            file_format=excitation.format,
            channel=excitation.channel,
        )
    except InputError as error:
        raise InputError(f"excitation.record: {error}") from None


def _cases(rows: list[Case]) -> dict[str, Floats]:
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
        values = numbers * unit_factor(f"{key}.units", name, axis.units, g)
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


def _check_model(file: SweepFile) -> None:
    if file.model.friction == "newmark":
        for key in sorted(file.model.model_fields_set & {"rise", "recoupling"}):
            value = getattr(file.model, key)
            raise InputError(f'model.{key} = "{value}": not allowed with friction = "newmark"')


def _check_excitation(excitation: Excitation) -> None:
    try:
        check_waveform(**excitation.arguments)
    except InputError as error:
        raise InputError(f"excitation.{error}") from None


def _check_variables(file: SweepFile, parameters: Mapping[str, Parameter]) -> None:
    variables = file.output.variables
    if file.uncertainty is not None and "variables" in file.output.model_fields_set:
        raise InputError("output.variables: not allowed beside [uncertainty], which has statistics as its results")
    known = RESULTS if file.excitation.record is None else RECORD_RESULTS
    if "variables" not in file.output.model_fields_set:
        return
    for number, name in enumerate(variables, 1):
        where = f"output.variables[entry {number}] = {_show(name)}"
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


# --------------------------------------------------------------------------------- units

#: Spellings of each parameter's own unit that need no units library.
_OWN_UNITS = {
    "degree": ("degree", "degrees", "deg"),
    "m s-2": ("m s-2", "m/s2", "m/s^2", "m/s**2"),
    "Hz": ("Hz",),
    "m": ("m",),
    "1": ("1",),
}

#: Products and quotients of names with powers of one digit: no text can ask pint for a huge number.
_FACTOR = r"(?:[^\W\d]+0?|°)(?:\*\*-?[1-9])?"
_UNIT_GRAMMAR = re.compile(rf"(?:1/)?{_FACTOR}(?:[ */]{_FACTOR})*")


def unit_factor(key: str, name: str, units: str | None, g: float) -> float:
    """Return what to multiply a number in `units` by, to have it in the parameter's own unit.

    `key` is what the units are called in errors.
    "g" as a unit of acceleration is the sweep's own [model] g: an amplitude "in g" is
    meant against the gravity that the block feels.
    """
    own = _INPUTS[name]["units"]
    if units is None or units in _OWN_UNITS[own]:
        return 1.0
    if own == "m s-2" and units == "g":
        return g

    refusal = InputError(f"{key} = {_show(units)}: must be a unit that converts to {own}")
    # "m s-2", "m/s2" and "m/s^2" are all common; pint reads "m s**-2" and "m/s**2"
    text = re.sub(r"(?<=[A-Za-z])\^?(-?[1-9])\b", r"**\1", units.strip())
    if own == "1" or not _UNIT_GRAMMAR.fullmatch(text):
        raise refusal

    import pint  # only here: it takes 0.2 s to import

    registry = pint.get_application_registry()
    target = "m/s**2" if own == "m s-2" else own
    try:
        quantity = registry.Quantity(1.0, text)
        root = quantity.to_root_units().units
        # Pint lets radians pass for pure numbers.  Here a slope in percent is no angle, and
        # 60 rpm or 2 pi rad/s is 1 Hz: one turn a cycle.
        if own == "Hz" and "radian" in str(root):
            target = "turn/s"
        if root != registry.Quantity(1.0, target).to_root_units().units:
            raise refusal
        return float(quantity.to(target).magnitude)
    except (pint.PintError, ArithmeticError, AttributeError, TypeError, ValueError):
        raise refusal from None


def quantity(key: str, text: str, parameter: str, g: float) -> float:
    """Return a number with a unit, such as "50 mm" or "1.5g", in a parameter's own unit.

    Parameters
    ----------
    key : str
        What to call it in errors.
    text : str
        A number and, unless it is in the parameter's own unit, a unit as in `Axis.units`.
    parameter : str
        A parameter (`slipsweep.model.variables.PARAMETERS`) of the same unit.
    g : float
        What "g" as a unit of acceleration stands for, m/s².

    Raises
    ------
    InputError
        It is not a number, or its unit does not convert.
    """
    found = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", text)
    own = PARAMETERS[parameter]["units"]
    refusal = InputError(f"{key} = {_show(text)}: must be a number, with a unit that converts to {own} if in another")
    if found is None:
        raise refusal
    try:
        return float(found[1]) * unit_factor(key, parameter, found[2] or None, g)
    except InputError:
        raise refusal from None


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
    return f"{key} = {_show(found['input'])}: {message}"


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


def _show(value: object) -> str:
    """Write a value as TOML would, on one line of bearable length."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."
