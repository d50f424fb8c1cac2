"""netCDF-4 files of results by the CF conventions: what stands in them, and how their values are written."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from slipsweep.files.motions import embedded
from slipsweep.files.outputs import complete_or_absent, writing
from slipsweep.model.variables import RECORD_COUNTS, SlidingMode
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite

#: Results that are whole numbers, -1 where there is no value.
WITH_MISSING = ("sliding_mode", *RECORD_COUNTS)


def history_of(command: str) -> str:
    """The `history` of a file that `command` makes now."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}"


def storable(text: str) -> str:
    """A text as a file can hold it: bytes of a name that are no UTF-8 are spelled out."""
    return text.encode(errors="backslashreplace").decode()


def described(
    table: xr.Dataset,
    *,
    title: str,
    history: str,
    labels: tuple[str, ...] = (),
    recorded: Record | Suite | None = None,
    **attrs: str,
) -> xr.Dataset:
    """Results as a file holds them: with labels of cases, the samples of records, and global attributes.

    Parameters
    ----------
    table : Dataset
    title, history : str
    labels : tuple of str
        Names of the cases.
    recorded : Record or Suite, optional
        The motion that the results are the response to.
    attrs : str
        Further global attributes.
    """
    found = table.copy()
    if labels:
        about = {"long_name": "name of the case"}
        found = found.assign_coords(label=xr.Variable(("case",), np.array(labels, object), about))
    for name, one in dict(found.variables).items():
        if one.dtype.kind == "U":  # of any length
            found[name] = found[name].astype(object)
        if one.attrs.get("ancillary_variables") not in found.variables:
            found[name].attrs.pop("ancillary_variables", None)
    if recorded is not None:
        found = found.assign(embedded(recorded))
    return found.assign_attrs(title=title, Conventions="CF-1.11", history=history, **attrs)


def fill_value(name: str, dtype: np.dtype[Any]) -> float | int | None:
    """What stands in a file for no value."""
    if dtype.kind == "f":
        return float("nan")
    return int(SlidingMode.MISSING) if name in WITH_MISSING else None


@contextmanager
def new_file(
    temporary: Path,
    path: Path,
    table: xr.Dataset,
    dtypes: Mapping[str, np.dtype[Any]],
    chunks: Mapping[str, int] | None = None,
    compression: int = 0,
) -> Iterator[netCDF4.Dataset]:
    """Make a netCDF file with all that `table` has but its results, which the caller writes.

    Parameters
    ----------
    temporary, path : Path
        The file, and what it is called in errors.
    table : Dataset
        As `described` gives it.
    dtypes : mapping of str to dtype
        The results, and their types in the file.
    chunks : mapping of str to int, optional
        Lengths that compressed results are cut into.
    compression : int
        Level of zlib, which every build of the library has; 0 for none.

    Raises
    ------
    RunError
        It cannot be written.
    """
    with writing(path):
        file = netCDF4.Dataset(temporary, "w", format="NETCDF4")
        file.set_fill_off()  # every value is written: filling the file first would write it twice
        file.set_auto_maskandscale(False)
        try:
            _write_head(file, table, dtypes, chunks or {}, compression)
            yield file
        except BaseException:
            with suppress(RuntimeError, OSError):  # the first error is the one to report
                file.close()
            raise
        file.close()


def _write_head(
    file: netCDF4.Dataset,
    table: xr.Dataset,
    dtypes: Mapping[str, np.dtype[Any]],
    chunks: Mapping[str, int],
    compression: int,
) -> None:
    # in the order of the results, which that of the coordinates need not be
    widest: Any = max((table[name].dims for name in dtypes), key=len, default=())
    for dim in dict.fromkeys((*map(str, widest), *map(str, table.sizes))):
        file.createDimension(dim, table.sizes[dim])
    # texts along a dimension are labels, and no coordinate variable of it (CF 6.1)
    auxiliary = [name for name, one in table.coords.items() if name not in table.sizes or one.dtype.kind in "OU"]
    for name in (*table.coords, *dtypes, *(one for one in table.data_vars if one not in dtypes)):
        one = table[name].variable
        if one.dtype.kind in "OU":
            _write_text(file, str(name), one)
            continue
        dtype, attrs = dtypes.get(str(name), one.dtype), dict(one.attrs)
        how: dict[str, Any] = {"contiguous": True}
        if name in dtypes and (own := [str(other) for other in auxiliary if {*table[other].dims} <= {*one.dims}]):
            attrs["coordinates"] = " ".join(own)
        if name in dtypes and compression and one.dims:
            sizes = [min(chunks.get(str(dim), size), size) for dim, size in one.sizes.items()]
            how = {"zlib": True, "complevel": compression, "shuffle": True, "chunksizes": sizes}
        fill = fill_value(str(name), dtype) if name in dtypes else None
        variable: Any = file.createVariable(name, dtype, one.dims, fill_value=fill, **how)
        _describe(variable, attrs)
        if name not in dtypes:
            variable[...] = one.values
    _describe(file, table.attrs)


def _write_text(file: netCDF4.Dataset, name: str, one: xr.Variable) -> None:
    """Write texts as characters in UTF-8, since few programs read netCDF strings."""
    encoded = np.array([str(text).encode() for text in one.values.flat])
    characters = encoded.view("S1").reshape(*one.shape, -1)
    file.createDimension(f"{name}_length", characters.shape[-1])
    variable: Any = file.createVariable(name, "S1", (*map(str, one.dims), f"{name}_length"))
    variable.set_auto_chartostring(False)
    _describe(variable, {**one.attrs, "_Encoding": "utf-8"})
    variable[...] = characters


def _describe(target: netCDF4.Dataset | netCDF4.Variable, attributes: Mapping[Any, Any]) -> None:
    """Set attributes: text as characters in UTF-8, flag values in the type of their variable."""
    for name, value in attributes.items():
        if isinstance(value, str):
            # as bytes: the library would write text beyond ASCII as a netCDF string
            target.setncattr(name, storable(value).encode())
        elif name in ("flag_values", "flag_masks"):
            target.setncattr(name, np.asarray(value, target.dtype))
        elif np.asarray(value).dtype.kind == "i":
            target.setncattr(name, np.int32(value))  # not every program reads 64-bit attributes
        else:
            target.setncattr(name, value)


def write_table(
    table: xr.Dataset,
    path: Path,
    *,
    title: str,
    command: str,
    overwrite: bool = False,
    recorded: Record | Suite | None = None,
    labels: tuple[str, ...] = (),
) -> None:
    """Write a Dataset that is in memory (a time history) by the rules that sweeps are written by.

    The `recorded` motion that it is the response to is written with it, and the `labels` of its cases.
    """
    whole = described(table, title=title, history=history_of(command), labels=labels, recorded=recorded)
    write_whole(whole, path, {str(name): one.dtype for name, one in table.data_vars.items()}, overwrite)


def write_whole(
    table: xr.Dataset, path: Path, dtypes: Mapping[str, np.dtype[Any]], overwrite: bool, compression: int = 0
) -> None:
    """Write what `described` gives, with all of its values; the types of its results are those of `dtypes`."""
    with (
        complete_or_absent(path, overwrite) as temporary,
        new_file(temporary, path, table, dtypes, compression=compression) as file,
    ):
        for name, dtype in dtypes.items():
            file[name][...] = table[name].values.astype(dtype, copy=False)


def without_time_axis(table: xr.Dataset) -> xr.Dataset:
    """Put a time history along `instant`, with `time` beside it as an auxiliary coordinate.

    A dimension `time` is a time axis of the CF conventions (4.4), whose values are dates.  Seconds
    since the shaking began are none, and given a made-up date they would be read back as dates.
    """
    return table.swap_dims(time="instant").reset_coords("time").set_coords("time")
