"""netCDF-4 files of results by the CF conventions: their contents, and the encoding for xarray."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from slipsweep.files.motions import embedded
from slipsweep.model.variables import RECORD_COUNTS, RECORD_SAMPLES, SlidingMode
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite

#: Results that are whole numbers, -1 where there is no value.
WITH_MISSING = ("sliding_mode", *RECORD_COUNTS)


def described(
    table: xr.Dataset, *, title: str, command: str, recorded: Record | Suite | None = None
) -> xr.Dataset:
    """Return results as a file holds them: with the recorded motion and global attributes."""
    table_in_file = table.copy()
    for name, variable in dict(table_in_file.variables).items():
        if variable.dtype.kind == "U":  # netCDF has no texts of a fixed length
            table_in_file[name] = table_in_file[name].astype(object)
        ancillary = str(variable.attrs.get("ancillary_variables", "")).split()
        if not {*ancillary} <= table_in_file.variables.keys():
            table_in_file[name].attrs.pop("ancillary_variables", None)
    if recorded is not None:
        table_in_file = table_in_file.assign(embedded(recorded))
    history = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}"
    table_in_file.attrs |= {"title": title, "Conventions": "CF-1.11", "history": history}
    return table_in_file


def fill_value(name: str, dtype: np.dtype[Any]) -> float | int | None:
    """Return the number for a missing value of a result in a file; None: there is none."""
    if dtype.kind == "f" and name not in RECORD_SAMPLES:
        return float("nan")
    return int(SlidingMode.MISSING) if name in WITH_MISSING else None


@contextmanager
def new_file(
    table: xr.Dataset,
    path: Path | str,
    lengths: Mapping[str, int] | None = None,
    compression: int = 0,
) -> Iterator[netCDF4.Dataset]:
    """Write a table of `described` to a new file, and yield the file.

    The caller writes the values of variables that are dask arrays.  With a level of compression, by
    zlib, which every build of the library has, results are stored in chunks of these `lengths`.
    """
    stored = table.assign_attrs(attributes(table.attrs))
    encoding: dict[Any, dict[str, Any]] = {}
    for name, variable in table.variables.items():
        stored[name].attrs = attributes(variable.attrs, variable.dtype)
        is_result = name in table.data_vars
        encoding[name] = {
            "_FillValue": fill_value(str(name), variable.dtype) if is_result else None
        }
        if variable.dtype.kind in "OU":
            encoding[name] = {"dtype": "S1"}  # characters, since few programs read netCDF strings
        elif compression and is_result and variable.dims:
            sizes = tuple(
                (lengths or {}).get(str(dim), size) for dim, size in variable.sizes.items()
            )
            encoding[name] |= {
                "zlib": True,
                "complevel": compression,
                "shuffle": True,
                "chunksizes": sizes,
            }
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        file.set_fill_off()  # every value is written, so that none need be filled in before
        stored.dump_to_store(xr.backends.NetCDF4DataStore(file), encoding=encoding)
        file.set_auto_maskandscale(False)
        yield file


def attributes(attrs: Mapping[Any, Any], dtype: Any = np.int32) -> dict[Any, Any]:
    """Return attributes as every program reads them.

    Texts are stored as characters, whole numbers in 32 bits, and codes in `dtype`.
    """
    stored: dict[Any, Any] = {}
    for name, value in attrs.items():
        if isinstance(value, str):
            # the library would write text beyond ASCII as a netCDF string, but bytes as characters;
            # bytes of a file's name that are no UTF-8 are spelled out
            stored[name] = value if value.isascii() else value.encode(errors="backslashreplace")
        elif name in ("flag_values", "flag_masks"):
            stored[name] = np.asarray(value, dtype)
        else:
            stored[name] = np.int32(value) if np.asarray(value).dtype.kind == "i" else value
    return stored


def write_table(table: xr.Dataset, path: Path, compression: int = 0) -> None:
    """Write a table of `described` whose values are in memory."""
    with new_file(table, path, None, compression):
        pass


def without_time_axis(table: xr.Dataset) -> xr.Dataset:
    """Return a time history along `instant` instead of `time`.

    By the CF conventions (4.4) a dimension `time` would hold dates, not seconds.
    """
    return table.swap_dims(time="instant").reset_coords("time").set_coords("time")
