"""netCDF files of results: made by the CF conventions, and read."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.files.names import open_netcdf
from slipsweep.files.outputs import complete_or_absent, writing
from slipsweep.grid.tables import Table, Variable
from slipsweep.model.variables import RECORD_COUNTS, RECORD_SAMPLES, SlidingMode
from slipsweep.motion.records import Record

#: Results that are whole numbers, -1 where there is no value.
_WITH_MISSING = ("sliding_mode", *RECORD_COUNTS)

#: Attribute that tells of the run that made a file, for programs.
RUN = "slipsweep_run"

#: Dimension of the samples of a record.
RECORD_DIM = "record_sample"


# --------------------------------------------------------------------------- making a file


@contextmanager
def new_file(temporary: Path, path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a new netCDF file, and close it whatever happens."""
    with writing(path):
        file = open_netcdf(temporary, "w")
    file.set_fill_off()  # every value is written: filling the file first would write it twice
    try:
        yield file
    except BaseException:
        with suppress(RuntimeError, OSError):  # the first error is the one to report
            file.close()
        raise
    with writing(path):
        file.close()


def _define(file: netCDF4.Dataset, table: Table, dtype: Callable[[str], np.dtype[Any]]) -> None:
    """Define the dimensions and variables of `table`."""
    sizes = table.sizes
    # in the order of the results, which that of the coordinates need not be
    widest = max((result.dims for result in table.data_vars.values()), key=len, default=())
    shape = {dim: sizes[dim] for dim in (*widest, *sizes)}
    for dim, length in shape.items():
        file.createDimension(dim, length)
    for name, coordinate in table.coords.items():
        variable = file.createVariable(name, coordinate.values.dtype, coordinate.dims)
        _describe(variable, coordinate.attrs)
    for name, result in table.data_vars.items():
        dims, kind = result.dims, dtype(name)
        fill = np.nan if kind.kind == "f" else SlidingMode.MISSING if name in _WITH_MISSING else None
        variable = file.createVariable(name, kind, dims, fill_value=fill, contiguous=True)
        attributes = dict(result.attrs)
        if attributes.get("ancillary_variables") not in table:
            attributes.pop("ancillary_variables", None)
        auxiliary = [c for c in table.coords if c not in shape and {*table[c].dims} <= {*dims}]
        if auxiliary:
            attributes["coordinates"] = " ".join(auxiliary)
        _describe(variable, attributes)


def _label_cases(file: netCDF4.Dataset, labels: tuple[str, ...]) -> None:
    """Write the names of the rows of [[cases]]: as characters, since few programs read netCDF strings."""
    if not labels:
        return
    text = np.array([label.encode() for label in labels])
    file.createDimension("label_length", text.dtype.itemsize)
    variable = file.createVariable("label", "S1", ("case", "label_length"))
    variable.set_auto_chartostring(False)
    _describe(variable, {"long_name": "name of the case", "_Encoding": "utf-8"})
    variable[:] = text.view("S1").reshape(len(labels), -1)
    for other in file.variables.values():
        if "case" in other.dimensions and "coordinates" in other.ncattrs():
            _describe(other, {"coordinates": f"{other.getncattr('coordinates')} label"})


def _describe(target: netCDF4.Dataset | netCDF4.Variable, attributes: Mapping[str, Any]) -> None:
    """Set attributes: text as characters in UTF-8, flag values in the type of their variable."""
    for name, value in attributes.items():
        if isinstance(value, str):
            # as bytes: the library would write text beyond ASCII as a netCDF string
            # (a name with bytes that are no UTF-8 has them spelled out)
            target.setncattr(name, value.encode(errors="backslashreplace"))
        elif name in ("flag_values", "flag_masks"):
            target.setncattr(name, np.asarray(value, target.dtype))
        elif np.asarray(value).dtype.kind == "i":
            target.setncattr(name, np.int32(value))  # not every program reads 64-bit attributes
        else:
            target.setncattr(name, value)


def history_of(command: str) -> str:
    """The `history` of a file that `command` makes now."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}"


def _provenance(history: str) -> dict[str, str]:
    return {"Conventions": "CF-1.11", "history": history}


@dataclass(frozen=True)
class Head:
    """What a file says beside its results.

    Attributes
    ----------
    title : str
    labels : tuple of str
        Names of the cases.
    record : Record, optional
        The motion that the results are the response to: its samples are written with them.
    sweep : str, optional
        The text of a sweep file, from which the run can be repeated.
    run : str
        What another run must have in common with the one that made the file (`slipsweep.runs.parts.stamp`).
    """

    title: str
    labels: tuple[str, ...] = ()
    record: Record | None = None
    sweep: str | None = None
    run: str = ""


def write_head(
    file: netCDF4.Dataset, head: Head, table: Table, dtype: Callable[[str], np.dtype[Any]], history: str
) -> None:
    """Write all of a file but its results."""
    _define(file, table, dtype)
    _label_cases(file, head.labels)
    sweep = {} if head.sweep is None else {"sweep": head.sweep}
    run = {RUN: head.run} if head.run else {}
    _describe(file, {**table.attrs, "title": head.title, **_provenance(history), **sweep, **run})
    file.set_auto_maskandscale(False)
    for name, coordinate in table.coords.items():
        file[name][...] = coordinate.values
    if head.record is not None:
        _embed(file, head.record)


def _embed(file: netCDF4.Dataset, record: Record) -> None:
    """Write the samples of a record, from which the run can be repeated when its file is gone."""
    file.createDimension(RECORD_DIM, record.times.size)
    for name, values in zip(RECORD_SAMPLES, (record.times, record.acceleration), strict=True):
        variable = file.createVariable(name, "f8", (RECORD_DIM,))
        _describe(variable, RECORD_SAMPLES[name])
        variable[:] = values


class TooLarge(InputError):
    """A result is too large for the type that the sweep file asks for: no run of that sweep can be finished."""


def rounded(name: str, values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """A result as the file holds it; what is too large for that is an error (`TooLarge`), and not infinite."""
    if values.dtype == dtype:
        return values
    with np.errstate(over="ignore"):
        stored = values.astype(dtype)
    beyond = np.isinf(stored)
    if beyond.any() and np.isfinite(worst := np.abs(values[beyond]).max()):
        raise TooLarge(
            f'output.dtype = "{dtype}": {name} reaches {worst:.4g}, more than the {np.finfo(dtype).max:.4g} that it '
            'holds; must be "float64"'
        )
    return stored


def write_table(
    table: Table,
    path: Path,
    *,
    title: str,
    command: str,
    overwrite: bool = False,
    record: Record | None = None,
    labels: tuple[str, ...] = (),
) -> None:
    """Write a table that is in memory (a time history) by the rules that sweeps are written by.

    The `record` that it is the response to is written with it, and the `labels` of its cases.
    """
    with (
        complete_or_absent(path, overwrite) as temporary,
        new_file(temporary, path) as file,
        writing(path),
    ):
        head = Head(title, labels, record)
        write_head(file, head, table, lambda name: table[name].values.dtype, history_of(command))
        for name, array in table.data_vars.items():
            file[name][...] = array.values


def without_time_axis(table: Table) -> Table:
    """Put a time history along `instant`, with `time` beside it as an auxiliary coordinate.

    A dimension `time` is a time axis of the CF conventions (4.4), whose values are dates.  Seconds
    since the shaking began are none, and given a made-up date they would be read back as dates.
    """
    dims = {"time": "instant"}
    coords, data_vars = (
        {
            name: Variable(tuple(dims.get(dim, dim) for dim in array.dims), array.values, array.attrs)
            for name, array in arrays.items()
        }
        for arrays in (table.coords, table.data_vars)
    )
    return Table(coords, data_vars, table.attrs)
