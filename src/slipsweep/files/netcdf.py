"""netCDF files of results: made by the CF conventions, and read."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.files.contents import (
    CHECKSUM_ATTRIBUTES,
    CHECKSUM_BYTES,
    CHECKSUM_DIMS,
    CHECKSUM_GROUP,
    CHECKSUMS,
    Contents,
    Head,
    Stored,
    contents_of,
    storable,
)
from slipsweep.files.names import open_netcdf
from slipsweep.files.outputs import complete_or_absent, writing
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite

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


def _describe(target: netCDF4.Dataset | netCDF4.Variable, attributes: Mapping[str, Any]) -> None:
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


def history_of(command: str) -> str:
    """The `history` of a file that `command` makes now."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}"


def write_head(file: netCDF4.Dataset, contents: Contents) -> None:
    """Write all of a file but its results, for which there is room then."""
    for dim, length in contents.sizes.items():
        file.createDimension(dim, length)
    for name, stored in contents.variables.items():
        _create(file, name, stored, contents.compression)
    if contents.chunks:
        group = file.createGroup(CHECKSUM_GROUP)
        for dim, length in zip(CHECKSUM_DIMS, (contents.chunks, CHECKSUM_BYTES), strict=True):
            group.createDimension(dim, length)
        variable = group.createVariable(CHECKSUMS.rpartition("/")[2], "u1", CHECKSUM_DIMS, contiguous=True)
        _describe(variable, CHECKSUM_ATTRIBUTES)
    _describe(file, contents.attrs)
    file.set_auto_maskandscale(False)
    for name, stored in contents.variables.items():
        if stored.values is not None:
            file[name][...] = _characters(stored.values) if stored.is_text else stored.values


def _create(file: netCDF4.Dataset, name: str, stored: Stored, compression: int) -> None:
    if stored.is_text:
        # as characters, since few programs read netCDF strings
        assert stored.values is not None
        length = f"{name}_length"
        file.createDimension(length, _characters(stored.values).shape[-1])
        variable = file.createVariable(name, "S1", (*stored.dims, length))
        variable.set_auto_chartostring(False)
        _describe(variable, {**stored.attrs, "_Encoding": "utf-8"})
        return
    # zlib and shuffle: what every build of the library has
    packed = {"zlib": True, "complevel": compression, "shuffle": True}
    how = packed if compression and stored.values is None and stored.dims else {"contiguous": True}
    variable = file.createVariable(name, stored.dtype, stored.dims, fill_value=stored.fill, **how)
    _describe(variable, stored.attrs)


def read_head(file: Any, results: Collection[str]) -> Contents:
    """Read what `write_head` wrote, or of a store what was made of the same contents.

    Parameters
    ----------
    file : netCDF4.Dataset or StoreFile
    results : collection of str
        Names of the variables whose values do not belong to it.
    """
    variables = {}
    for name, variable in file.variables.items():
        attributes = {key: variable.getncattr(key) for key in variable.ncattrs() if key != "_FillValue"}
        dims, kind, values = tuple(variable.dimensions), variable.dtype, None
        if name not in results:
            variable.set_auto_maskandscale(False)
            variable.set_auto_chartostring(False)
            values = np.asarray(variable[...])
        if kind == "S1" and values is not None:
            attributes.pop("_Encoding", None)
            dims, kind = dims[:-1], np.dtype(object)
            rows = np.ascontiguousarray(values).reshape(-1, values.shape[-1])
            texts = np.array([row.tobytes().rstrip(b"\0").decode() for row in rows], dtype=object)
            values = texts.reshape(values.shape[:-1])
        elif kind is str:
            kind = np.dtype(object)
        variables[name] = Stored(dims, kind, attributes, None, values)
    used = {dim for one in variables.values() for dim in one.dims}
    sizes = {dim: len(length) for dim, length in file.dimensions.items() if dim in used}
    return Contents(sizes, variables, {key: file.getncattr(key) for key in file.ncattrs()})


def _characters(texts: NDArray[Any]) -> NDArray[Any]:
    """Texts as rows of characters in UTF-8."""
    encoded = np.array([text.encode() for text in texts.flat])
    return encoded.view("S1").reshape(*texts.shape, -1)


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
    table: xr.Dataset,
    path: Path,
    *,
    title: str,
    command: str,
    overwrite: bool = False,
    recorded: Record | Suite | None = None,
    labels: tuple[str, ...] = (),
) -> None:
    """Write a table that is in memory (a time history) by the rules that sweeps are written by.

    The `recorded` motion that it is the response to is written with it, and the `labels` of its cases.
    """
    with (
        complete_or_absent(path, overwrite) as temporary,
        new_file(temporary, path) as file,
        writing(path),
    ):
        head = Head(title, labels, recorded)
        write_head(file, contents_of(head, table, lambda name: table[name].values.dtype, history_of(command)))
        for name, array in table.data_vars.items():
            file[name][...] = array.values


def without_time_axis(table: xr.Dataset) -> xr.Dataset:
    """Put a time history along `instant`, with `time` beside it as an auxiliary coordinate.

    A dimension `time` is a time axis of the CF conventions (4.4), whose values are dates.  Seconds
    since the shaking began are none, and given a made-up date they would be read back as dates.
    """
    dims = {"time": "instant"}
    coords, data_vars = (
        {
            name: xr.Variable(tuple(dims.get(dim, dim) for dim in array.dims), array.values, array.attrs)
            for name, array in arrays.items()
        }
        for arrays in (table.coords, table.data_vars)
    )
    return xr.Dataset(data_vars, coords, table.attrs)
