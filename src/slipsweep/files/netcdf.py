"""netCDF-4 files of results by the CF conventions: what stands in them, and how xarray is told to write it."""

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
    """Results as a file holds them: with the samples of the recorded motion, and global attributes."""
    found = table.copy()
    for name, one in dict(found.variables).items():
        if one.dtype.kind == "U":  # of any length
            found[name] = found[name].astype(object)
        ancillary = str(one.attrs.get("ancillary_variables", "")).split()
        if not {*ancillary} <= found.variables.keys():
            found[name].attrs.pop("ancillary_variables", None)
    if recorded is not None:
        found = found.assign(embedded(recorded))
    history = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}"
    found.attrs |= {"title": title, "Conventions": "CF-1.11", "history": history}
    return found


def fill_value(name: str, dtype: np.dtype[Any]) -> float | int | None:
    """Value that stands in a file for no value of a result."""
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
    """Write what `described` gives; of variables that are dask arrays all but their values, which the caller writes.

    With a level of compression by zlib, which every build of the library has, results are in chunks
    of these lengths.
    """
    found = table.assign_attrs(attributes(table.attrs))
    encoding: dict[Any, dict[str, Any]] = {}
    for name, one in table.variables.items():
        found[name].attrs = attributes(one.attrs, one.dtype)
        is_result = name in table.data_vars
        encoding[name] = {"_FillValue": fill_value(str(name), one.dtype) if is_result else None}
        if one.dtype.kind in "OU":
            encoding[name] = {"dtype": "S1"}  # characters, since few programs read netCDF strings
        elif compression and is_result and one.dims:
            sizes = tuple((lengths or {}).get(str(dim), size) for dim, size in one.sizes.items())
            encoding[name] |= {
                "zlib": True,
                "complevel": compression,
                "shuffle": True,
                "chunksizes": sizes,
            }
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        file.set_fill_off()  # every value is written: to fill the file first would be to write it twice
        found.dump_to_store(xr.backends.NetCDF4DataStore(file), encoding=encoding)
        file.set_auto_maskandscale(False)
        yield file


def attributes(attrs: Mapping[Any, Any], dtype: Any = np.int32) -> dict[Any, Any]:
    """Attributes as every program reads them: text as characters, whole numbers of 32 bits, codes of their type."""
    found: dict[Any, Any] = {}
    for name, value in attrs.items():
        if isinstance(value, str):
            # as bytes: the library writes text beyond ASCII as a netCDF string; bytes of a name
            # that are no UTF-8 are spelled out
            found[name] = value if value.isascii() else value.encode(errors="backslashreplace")
        elif name in ("flag_values", "flag_masks"):
            found[name] = np.asarray(value, dtype)
        else:
            found[name] = np.int32(value) if np.asarray(value).dtype.kind == "i" else value
    return found


def write_table(table: xr.Dataset, path: Path, compression: int = 0) -> None:
    """Write what `described` gives, with its values in memory."""
    with new_file(table, path, None, compression):
        pass


def without_time_axis(table: xr.Dataset) -> xr.Dataset:
    """Put a time history along `instant`: a dimension `time` holds dates by the CF conventions (4.4), not seconds."""
    return table.swap_dims(time="instant").reset_coords("time").set_coords("time")
