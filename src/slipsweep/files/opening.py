"""Results opened as datasets, whatever program has had them in hand since."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.grid.chunks import CHUNK_CELLS, chunk_lengths
from slipsweep.model.variables import (
    LIMIT_RESULTS,
    MOTION_COORDINATES,
    PARAMETERS,
    RECORD_RESULTS,
    RESULT_DTYPES,
    RESULTS,
    STATISTICS,
)

#: Attributes that say how values are stored, not what they mean.
_ENCODINGS = ("_FillValue", "missing_value")


def is_address(text: str | os.PathLike[str]) -> bool:
    """Whether a place is an address for fsspec (``s3://…``), and not a path."""
    return "://" in os.fspath(text)


def place_of(text: str) -> Path | str:
    """An output as typed: a path, or the address of a store."""
    return text if is_address(text) else Path(text)


def open_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a result of any size lazily: nothing is read before it is asked for.

    Parameters
    ----------
    path : str or path-like
        A netCDF file or a Zarr store, or the address of a store (``s3://…``).

    Returns
    -------
    xarray.Dataset
        As `sweep` returns it: modes and counts are whole numbers, -1 where there is no value.  Its variables are dask
        arrays; those of a store in the chunks that they were written in.

    Raises
    ------
    InputError
        There is none, it cannot be read, or it was not written by slipsweep.

    See Also
    --------
    sweep : returns results of grids that memory holds

    Examples
    --------
    >>> import slipsweep
    >>> slipsweep.sweep(theta=5, mu_s=0.4, amplitude=[4.0, 6.0], frequency=2.0).to_netcdf("first.nc")
    >>> result = slipsweep.open_result("first.nc")
    >>> print(f"{result.permanent_displacement.max().compute().item():.3f} m")
    0.445 m
    """
    table = read_result(path)
    stored = {
        dim: length for one in table.values() for dim, length in (one.encoding.get("preferred_chunks") or {}).items()
    }
    widest: Any = max((one.sizes for one in table.data_vars.values()), key=len, default={})
    return table.chunk(stored or (chunk_lengths(widest, CHUNK_CELLS) if 0 not in widest.values() else {}))


def read_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a result without dask: values are read when they are asked for (InputError as `open_result`)."""
    table = _open(path)
    if not str(table.attrs.get("source", "")).startswith("slipsweep ") and "sweep" not in table.attrs:
        raise InputError(f"{path}: not written by slipsweep, or its global attributes are lost")
    for name, one in dict(table.variables).items():
        for key in _ENCODINGS:
            table[name].attrs.pop(key, None)
        if one.dtype.kind in "UST":
            table[name] = table[name].astype(object)
        kind = np.dtype(RESULT_DTYPES.get(str(name), "f8"))
        if kind.kind == "i" and one.dtype != kind:
            # another program has made other numbers of codes
            missing = 0 if name == "validity" else -1
            table[name] = table[name].fillna(missing).astype(kind)
    return table


def _open(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a netCDF file or a Zarr store, its values decoded but for codes."""
    # codes stay whole numbers: a fill value would make them floating-point ones
    codes = {name: False for name, dtype in RESULT_DTYPES.items() if np.dtype(dtype).kind == "i"}
    place = Path(path)
    if is_address(path) or (place / "zarr.json").is_file():
        check_zarr(path)
        try:
            how: dict[str, Any] = {"mask_and_scale": codes, "decode_times": False, "consolidated": False}
            table = xr.open_zarr(os.fspath(path), chunks=None, **how)
        except Exception as error:  # whatever the storage behind the address may raise
            raise InputError(f"{path}: cannot be read as a Zarr store: {_first_line(error)}") from None
        if "unfinished" in table.attrs:
            raise InputError(f"{path}: is not finished; run its sweep again with --resume")
        return _in_order(table)
    if not place.exists():
        raise InputError(f"{path}: no such file")
    if not place.is_file():
        raise InputError(f"{path}: is neither a netCDF file nor a Zarr store of format 3")
    try:
        return xr.open_dataset(place, engine="netcdf4", mask_and_scale=codes, decode_times=False)
    except PermissionError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # netCDF4 and xarray raise what they like on a damaged file
        raise InputError(f"{path}: not a netCDF file, or a damaged one ({_first_line(error)})") from None


def _in_order(table: xr.Dataset) -> xr.Dataset:
    """Variables and coordinates in the order of slipsweep's own: a store has none."""
    order = dict.fromkeys((*PARAMETERS, *MOTION_COORDINATES, *RECORD_RESULTS, *LIMIT_RESULTS, *STATISTICS, *RESULTS))
    names = [name for name in (*order, *table.variables) if name in table.variables]
    found = xr.Dataset({name: table[name].variable for name in dict.fromkeys(names)}, attrs=table.attrs)
    return found.set_coords([name for name in found.variables if name in table.coords])


def check_zarr(path: object) -> None:
    """Refuse a Zarr store where the packages are missing that read and write it."""
    try:
        import fsspec  # noqa: F401
        import zarr  # noqa: F401
    except ImportError:
        raise InputError(f"{path}: Zarr stores need zarr and fsspec: pip install 'slipsweep[zarr]'") from None


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
