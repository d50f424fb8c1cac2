"""Results opened lazily, in chunks that suit both what they lie in and dask."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slipsweep.errors import InputError
from slipsweep.files import zarr_store
from slipsweep.files.contents import RUN
from slipsweep.files.results import result_file
from slipsweep.files.zarr_store import Place, names_store
from slipsweep.grid.chunks import CHUNK_CELLS, chunk_lengths

if TYPE_CHECKING:
    import xarray as xr

#: Attributes that say how values are stored, not what they mean.
_ENCODINGS = ("_FillValue", "missing_value")


def open_result(path: str | os.PathLike[str]) -> "xr.Dataset":
    """Open a result of any size lazily: nothing is read before it is asked for.

    Parameters
    ----------
    path : str or path-like
        A netCDF file, a folder of them (``--split``), a Zarr store, or the address of a store (``s3://…``).

    Returns
    -------
    xarray.Dataset
        As `sweep` returns it: modes and counts are whole numbers, -1 where there is no value.  Its variables are dask
        arrays, in the chunks that they were written in (some tens of MB).

    Raises
    ------
    InputError
        There is none, it cannot be read, or it was not written by slipsweep.

    Notes
    -----
    HDF5 has one lock for a process: threads read netCDF files one after the other, and reading is as fast as the
    disk.  The parts of a Zarr store are read and unpacked beside each other.

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
    import xarray as xr

    place: Place = str(path) if zarr_store.is_address(os.fspath(path)) else Path(path)
    if names_store(place):
        zarr_store.check_package(str(place))
        group = zarr_store.open_group(place)
        lazy: Any = xr.open_zarr(group.store, mask_and_scale=False, decode_times=False, chunks=None)
        return _in_chunks(place, lazy)
    assert isinstance(place, Path)
    if not place.is_dir():
        return _open_file(place)
    files = sorted(place.iterdir())
    if not files:
        raise InputError(f"{place}: has no files")
    parts = [_open_file(file) for file in files]
    joined = xr.combine_by_coords(
        parts, data_vars="minimal", coords="minimal", compat="override", combine_attrs="override"
    )
    assert isinstance(joined, xr.Dataset)
    return joined


def _open_file(path: Path) -> "xr.Dataset":
    import xarray as xr

    with result_file(path) as file:
        packed = any({"scale_factor", "add_offset"} & file[name].encoding.keys() for name in file.variables)
    return _in_chunks(path, xr.open_dataset(path, engine="netcdf4", mask_and_scale=packed, decode_times=False))


def _in_chunks(path: Place, lazy: "xr.Dataset") -> "xr.Dataset":
    """The chunks in which a result was written, or others of their size."""
    if not str(lazy.attrs.get("source", "")).startswith("slipsweep "):
        raise InputError(f"{path}: not written by slipsweep, or its global attributes are lost")
    for variable in lazy.variables.values():
        for name in _ENCODINGS:
            variable.attrs.pop(name, None)
    widest = max((one.sizes for one in lazy.data_vars.values()), key=len, default={})
    sizes = {str(dim): length for dim, length in widest.items()}
    try:
        told = json.loads(lazy.attrs[RUN])
        lengths = {dim: int(length) for dim, length in told["lengths"].items() if dim in lazy.sizes}
        # a store has no order
        first = [name for name in told["results"] if name in lazy.data_vars]
        lazy = lazy[[*first, *(name for name in lazy.data_vars if name not in first)]]
    except (KeyError, TypeError, ValueError, AttributeError):
        lengths = chunk_lengths(sizes, CHUNK_CELLS) if 0 not in sizes.values() else {}
    return lazy.chunk({dim: min(length, lazy.sizes[dim]) for dim, length in lengths.items()})
