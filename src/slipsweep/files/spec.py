"""Sweep files: TOML text in, the arguments of `slipsweep.sweep` out.

This module checks the keys, makes arrays of the axes in their own units, and refuses a parameter
that two tables give.  Values are checked by the functions that take them.  A refusal is an
`InputError`, ``FILE: key = VALUE: what is allowed``.
"""

import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.files import motions, opening
from slipsweep.grid.inputs import Inputs, given_inputs
from slipsweep.model import choices, options, parameters, units, variables
from slipsweep.motion import reading, records, suites
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

if TYPE_CHECKING:
    from slipsweep.grid.plans import Plan
    from slipsweep.studies.sampling import Sampling

#: Inputs that [axes] and [[cases]] may give; `polarity` is one of [excitation].
_INPUTS = tuple(name for name in variables.PARAMETERS if name != "polarity")

#: Tables that are a choice with its options.
_FAMILIES: tuple[choices.Family[Any], ...] = (options.MODELS, WAVEFORMS, options.SOLVERS)

#: Keys of [excitation] that go with recorded motions.
_RECORD_KEYS = (
    "record",
    "records",
    "pairs",
    "vertical",
    *(option.name for option in choices.declared(reading.Reading)),
    "polarity",
)


@dataclass(frozen=True)
class Output:
    """The table [output].  `variables` None stands for the default results of the kind of sweep."""

    path: str | None = None
    title: str = "Permanent displacement of a rigid block on a shaken inclined base"
    variables: list[str] | None = None
    dtype: str = "float64"
    compression: int = 0


#: The keys of each table, with the defaults that are not declared elsewhere; None: no default.
KEYS: dict[str, dict[str, Any]] = {
    "axes": dict.fromkeys(_INPUTS),
    "axes.NAME": {
        "values": None,
        "start": None,
        "stop": None,
        "num": None,
        "spacing": "linear",
        "units": None,
    },
    "cases": dict.fromkeys(("label", *_INPUTS)),
    **{
        family.keyword: {family.key: family.default} | dict.fromkeys(family.options)
        for family in _FAMILIES
    },
    "output": asdict(Output()) | {"variables": list(variables.DEFAULT_RESULTS)},
    "uncertainty": {"samples": 4096, "method": "sobol", "seed": 0, "quantiles": [0.05, 0.5, 0.95]}
    | {"thresholds": [0.01, 0.1, 1.0], "correlation": [], "sensitivity": False, "over": []}
    | dict.fromkeys(variables.DRAWN),
}
KEYS["model"] |= dict.fromkeys(variables.MODEL_INPUTS) | {"yield_acceleration": "coulomb"}
KEYS["excitation"] |= dict.fromkeys(_RECORD_KEYS) | {"polarity": 1}

#: Largest number of points on an axis: 80 MB of coordinates, more than any grid can use.
_MOST_POINTS = 10_000_000

#: First bytes of netCDF files: netCDF-4, and the classic formats.
_NETCDF = (b"\x89HDF", b"CDF")

#: The motions of records, as [excitation] gives them.
Recorded = records.Record | suites.Suite

_Table = Mapping[str, Any]


@dataclass(frozen=True)
class SweepSpec:
    """A checked sweep: its grid, its options and the text it came from."""

    source: str  # the file, as the user named it
    text: str  # of it, verbatim
    inputs: Inputs
    labels: tuple[str, ...]  # of the rows of [[cases]]
    model: options.Model
    excitation: Waveform | Recorded
    solver: options.Solver
    output: Output
    sampling: "Sampling | None" = None  # of [uncertainty]; then the results are statistics
    files: tuple[Path | int, ...] = ()  # the files that were read, by name or descriptor

    @property
    def recorded(self) -> Recorded | None:
        """The recorded motion or motions, where these are the shaking."""
        return None if isinstance(self.excitation, Waveform) else self.excitation

    @property
    def grid(self) -> dict[str, xr.DataArray]:
        """Coordinates of the result that the sweep file gives, also those with one value."""
        over = () if self.sampling is None else self.sampling.over
        grid = {}
        for name, value in self.inputs.items():
            values = [1, -1] if isinstance(value, str) else value  # polarity = "both"
            grid[name] = (
                values
                if isinstance(values, xr.DataArray)
                else xr.DataArray(values, dims=(name,) * np.ndim(values))
            )
        if isinstance(self.recorded, suites.Suite):
            grid["motion"] = xr.DataArray(np.array(self.recorded.labels), dims="motion")
        return {name: values for name, values in grid.items() if name not in over}

    def plan(self) -> "Plan":
        """Return the plan of the sweep, or of its statistics (InputError: see `sweep`)."""
        chosen: dict[str, Any] = {
            "excitation": self.excitation,
            "model": self.model,
            "solver": self.solver,
        }
        # these import numba, and scipy: not for sweeps that are only looked at
        with named(self.source):
            if self.sampling is None:
                from slipsweep.grid.plans import plan_sweep

                return plan_sweep(self.inputs, variables=self.output.variables, **chosen)
            from slipsweep.studies.uncertainty import plan_samples

            return plan_samples(self.sampling, self.inputs, **chosen)


def load(path: str | Path) -> SweepSpec:
    """Read and check a sweep file (TOML), or the sweep stored in a result of `slipsweep run`.

    A sweep file may be a pipe, or ``-`` for standard input; its records are then looked for in the
    folder that the command runs in.  InputError: the file cannot be read, or something in it is not
    allowed.
    """
    path = Path(path)
    if (path / "zarr.json").is_file():
        return replace(_load_result(path), files=(path,))
    read: Path | int = 0 if path == Path("-") else path
    try:
        with open(read, "rb", closefd=read != 0) as file:
            content = file.read(4)
            is_netcdf = content.startswith(_NETCDF) or path.suffix == ".nc"
            # utf-8-sig: some editors put a byte-order mark in front
            text = "" if is_netcdf else (content + file.read()).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a sweep file: it is not UTF-8 text") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    sweep = (
        _load_result(path)
        if is_netcdf
        else parse(text, str(path), Path() if is_stream(path) else path.parent)
    )
    return replace(sweep, files=(read, *sweep.files))


def is_stream(path: Path) -> bool:
    """Return True if a sweep is read from a pipe or a redirection, without a name and a folder."""
    return path == Path("-") or (path.exists() and not path.is_file() and not path.is_dir())


def _load_result(path: Path) -> SweepSpec:
    with opening.read_result(path) as file:
        attributes = file.attrs
        if "sweep" not in attributes:
            raise InputError(
                f'{path}: no attribute "sweep": only a result of "slipsweep run" can be repeated'
            )
        recorded = motions.read_embedded(file, path)
        spec = parse(str(attributes["sweep"]), str(path), path.parent, recorded)
        check_grid(file, spec.grid, path)
    # the solver that ran; on the command line another one than the sweep file's may be chosen
    with named(str(path)):
        return (
            replace(spec, solver=options.SOLVERS.from_attributes(attributes))
            if "solver" in attributes
            else spec
        )


def check_grid(result: xr.Dataset, grid: Mapping[Any, xr.DataArray], source: object) -> None:
    """Raise InputError if the grid of a result is not that of its sweep: it was joined or cut."""
    dims = {*variables.STATISTIC_COORDINATES, motions.RECORD_DIM, motions.SUITE_DIM}
    dims |= {str(dim) for values in grid.values() for dim in values.dims}
    since = "results were joined or cut after their run"
    for dim in result.sizes:
        if dim not in dims:
            raise InputError(
                f"{source}: {dim}: is no dimension of the sweep that it stores: {since}"
            )
    for name, expected in grid.items():
        values = result[name] if name in result.coords else xr.DataArray(np.empty(0))
        is_dropped = values.size == 0 and expected.size == 1  # some programs drop scalars
        if not is_dropped and not _are_same(values.values.ravel(), expected.values.ravel()):
            there = opening.values_text(values) if values.size else "no values"
            stored = opening.values_text(expected.assign_attrs(values.attrs))
            raise InputError(
                f"{source}: {name}: {there}, where the sweep that it stores has {stored}: {since}"
            )


def _are_same(values: NDArray[Any], others: NDArray[Any]) -> bool:
    """Return True if values are equal to others in any order, numbers to single precision."""
    if values.size != others.size:
        return False
    if others.dtype.kind in "OU":
        return sorted(map(str, values)) == sorted(map(str, others))
    return np.allclose(np.sort(values), np.sort(others), rtol=1e-6, atol=0.0, equal_nan=True)


def parse(
    text: str, source: str, folder: Path | None = None, recorded: Recorded | None = None
) -> SweepSpec:
    """Check the text of a sweep file; errors call it `source`.  See `load`.

    Its records are looked for in `folder`, by default the one that the command runs in; `recorded`
    are those that are stored in a result.
    """
    try:
        content = tomllib.loads(text)
    # ValueError also for integers that are too long to convert, RecursionError for deep nesting
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: not valid TOML: {error}") from None
    with named(source):
        names = [name for name in KEYS if name not in ("axes.NAME", "cases")]
        tables = {
            name: dict(_check_keys(name, content.get(name, {}), KEYS[name])) for name in names
        }
        _check_keys("", content, (*names, "cases"))
        numbers = {
            name: tables["model"].pop(name)
            for name in variables.MODEL_INPUTS
            if name in tables["model"]
        }
        if numbers.get("yield_acceleration") == "coulomb":
            del numbers["yield_acceleration"]
        model = _chosen(options.MODELS, tables["model"])
        rows = _cases(content["cases"]) if "cases" in content else []
        inputs = _inputs(tables["axes"], rows, numbers, model.g)
        files: tuple[Path, ...] = ()
        named_keys = [key for key in ("record", "records") if key in tables["excitation"]]
        if named_keys:
            key = named_keys[0]
            inputs["polarity"] = tables["excitation"].pop("polarity", 1)
            motion: Any = _recorded_motion(key, tables, folder or Path(), recorded)
            if recorded is None:
                parts = motion.components if isinstance(motion, suites.Suite) else (motion,)
                files = tuple(Path(record.name) for record in parts)
        else:
            for other in (key for key in tables["excitation"] if key in _RECORD_KEYS):
                raise InputError(
                    f"excitation.{other}: only beside excitation.record, the file of a recorded "
                    "motion"
                )
            motion = _chosen(WAVEFORMS, tables["excitation"])
        sampling = _sampling(tables["uncertainty"], model.g) if "uncertainty" in content else None
        labels = tuple(str(row.get("label", number)) for number, row in enumerate(rows, 1))
        named_solver = _chosen(options.SOLVERS, tables["solver"])
        is_default = tables["solver"].get("method", "auto") == "auto"
        solver = options.solver_for(model, "auto" if is_default else named_solver)
        output = _output(tables["output"], sampling is not None)
        return SweepSpec(
            source,
            text,
            given_inputs(inputs),
            labels,
            model,
            motion,
            solver,
            output,
            sampling,
            files,
        )


@contextmanager
def named(source: str) -> Iterator[None]:
    """Add the name of the sweep file to the beginning of errors."""
    try:
        yield
    except InputError as error:
        error.args = (f"{source}: {error}",)
        raise


def _check_keys(key: str, table: Any, keys: Collection[str]) -> _Table:
    """Return a table if it has no other keys than these."""
    if not isinstance(table, dict):
        raise InputError(f"{key} = {units.show(table)}: must be a table")
    for name in table:
        if name not in keys:
            raise InputError(
                f"{key}{'.' if key else ''}{name}: unknown key; {did_you_mean(name, tuple(keys))}"
            )
    return table


def _chosen(family: choices.Family[Any], table: _Table) -> Any:
    """Return the choice that a table names, with its options."""
    option_values = {name: value for name, value in table.items() if name != family.key}
    return family.made(
        table.get(family.key, family.default),
        option_values,
        lambda text: f"{family.keyword}.{text}",
    )


def _sampling(table: dict[str, Any], g: float) -> "Sampling":
    from slipsweep.studies.sampling import Sampling  # imports scipy: only for sweeps that need it

    drawn = {name: value for name, value in table.items() if name in variables.DRAWN}
    settings = {
        name: value
        for name, value in (KEYS["uncertainty"] | table).items()
        if name not in variables.DRAWN
    }
    return Sampling(drawn, **settings, g=g, keys="uncertainty.")


def _inputs(axes: _Table, rows: list[dict[str, Any]], numbers: _Table, g: float) -> dict[str, Any]:
    """Return the parameters from [axes], [[cases]] and [model] (InputError: one is given twice)."""
    columns = [name for name in rows[0] if name != "label"] if rows else []
    inputs: dict[str, Any] = {name: _axis(name, axis, g) for name, axis in axes.items()}
    cases = {name: xr.DataArray([row[name] for row in rows], dims="case") for name in columns}
    model = {
        name: parameters.check_single(name, value, f"model.{name}")
        for name, value in numbers.items()
    }
    for table, values in (("cases", cases), ("model", model)):
        for name in inputs.keys() & values.keys():
            raise InputError(f"{table}.{name}: given twice: give it in one table")
        inputs |= values
    return inputs


def _recorded_motion(
    key: str, tables: Mapping[str, _Table], folder: Path, recorded: Recorded | None
) -> Recorded:
    """Return the records in files that [excitation] names, or those that a result has stored."""
    table = tables["excitation"]
    for other in table:
        if other not in _RECORD_KEYS:
            raise InputError(
                f"excitation.{other}: not allowed with excitation.{key}, to which the response is "
                "exact"
            )
    if {"record", "records"} <= {*table}:
        raise InputError("excitation.records: not allowed beside record: give one of them")
    for other in ("pairs", "vertical"):
        if key == "record" and other in table:
            raise InputError(
                f"excitation.{other}: only beside excitation.records, the files of a suite"
            )
    if key == "record" and not isinstance(table["record"], str):
        raise InputError(
            f"excitation.record = {units.show(table['record'])}: must be the name of a file"
        )
    if recorded is not None:
        return recorded
    of_files = ("record", "records", "pairs", "vertical")
    reading_options = {name: value for name, value in table.items() if name not in of_files}
    try:
        how = reading.Reading(**reading_options)
        if key == "record":
            return records.read_record(folder / table["record"], **how.options)
        vertical = table.get("vertical", "leave_out")
        return suites.suite_in(folder, table["records"], table.get("pairs"), how, vertical)
    except InputError as error:
        message = (
            str(error).replace("paths", key, 1) if str(error).startswith("paths") else str(error)
        )
        names_key = message.startswith((key, *_RECORD_KEYS))
        error.args = (f"excitation.{message}" if names_key else f"excitation.{key}: {message}",)
        raise


def _cases(rows: Any) -> list[dict[str, Any]]:
    """Return the rows of [[cases]], which all give the same parameters."""
    if not isinstance(rows, list) or not rows:
        raise InputError(f"cases = {units.show(rows)}: must be one table [[cases]] at least")
    columns = [
        name for name in _check_keys("cases[row 1]", rows[0], KEYS["cases"]) if name != "label"
    ]
    if not columns:
        raise InputError("cases[row 1]: must give at least one parameter")
    checked_rows = []
    for number, row in enumerate(rows, 1):
        key = f"cases[row {number}]"
        for name in {*columns} ^ {*_check_keys(key, row, KEYS["cases"])} - {"label"}:
            raise InputError(
                f"{key}.{name}: every row must give what row 1 gives: {', '.join(columns)}"
            )
        checked_rows.append(
            row
            | {name: parameters.check_single(name, row[name], f"{key}.{name}") for name in columns}
        )
    return checked_rows


@np.errstate(over="ignore", invalid="ignore")
def _axis(name: str, axis: Any, g: float) -> NDArray[np.float64]:
    """Return an axis as an array in the unit of the parameter."""
    key = f"axes.{name}"
    table = _check_keys(key, axis, KEYS["axes.NAME"])
    if "values" in table:
        for other in table:
            if other not in ("values", "units"):
                raise InputError(f"{key}.{other}: not allowed beside values")
        key = f"{key}.values"
        numbers = parameters.check_numbers(key, table["values"])
        if numbers.ndim != 1 or not numbers.size:
            raise InputError(
                f"{key} = {units.show(table['values'])}: must be a list of one number at least"
            )
    else:
        for part in ("start", "stop", "num"):
            if part not in table:
                raise InputError(
                    f"{key}.{part}: missing: an axis is values = [...], or start, stop and num"
                )
        start, stop = (
            parameters.check_finite(f"{key}.{part}", table[part]) for part in ("start", "stop")
        )
        num = parameters.check_whole(f"{key}.num", table["num"], 2, _MOST_POINTS)
        spacing = parameters.check_choice(
            f"{key}.spacing", table.get("spacing", "linear"), ("linear", "log")
        )
        if stop <= start:
            raise InputError(f"{key}.stop = {stop}: must be greater than start, {start}")
        if spacing == "log" and start <= 0.0:
            raise InputError(f'{key}.start = {start}: must be positive with spacing = "log"')
        numbers = (
            np.linspace(start, stop, num) if spacing == "linear" else np.geomspace(start, stop, num)
        )
    unit = table.get("units")
    if unit is not None and not isinstance(unit, str):
        raise InputError(f"axes.{name}.units = {units.show(unit)}: must be a text")
    values = numbers * units.conversion(
        f"axes.{name}.units", variables.PARAMETERS[name]["units"], unit, g
    )
    parameters.check_values(name, values, key)
    for at in np.flatnonzero(np.diff(values) <= 0.0):
        raise InputError(
            f"{key}: {numbers[at + 1]} after {numbers[at]}: must increase from one value to the "
            "next"
        )
    return values


def _output(table: _Table, has_statistics: bool) -> Output:
    """Return the table [output]; its variables, which depend on the sweep, are checked later."""
    if has_statistics and "variables" in table:
        raise InputError(
            "output.variables: not allowed beside [uncertainty], which has statistics as its "
            "results"
        )
    for name in ("path", "title"):
        if not isinstance(table.get(name, ""), str):
            raise InputError(f"output.{name} = {units.show(table[name])}: must be a text")
    if table.get("path") == "":
        raise InputError('output.path = "": must be the name of a file')
    output = Output(**table)
    parameters.check_choice("output.dtype", output.dtype, ("float64", "float32"))
    parameters.check_whole("output.compression", output.compression, 0, 9)
    return output
