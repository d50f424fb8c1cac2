"""Results read as they were written: by chunks, from one netCDF file, a folder of them or a Zarr store."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.files import zarr_store
from slipsweep.files.names import open_netcdf
from slipsweep.files.results import result_file
from slipsweep.files.zarr_store import Place, StoreFile, names_store
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk, grid_chunks, places
from slipsweep.runs.targets.splitfiles import chunk_name


@contextmanager
def opened(path: Place) -> Iterator[Any]:
    """Open a netCDF file or a store: ``file[name][slices]`` are values as they are stored."""
    if names_store(path):
        yield StoreFile(path)
        return
    with open_netcdf(Path(path)) as file:
        file.set_auto_maskandscale(False)
        yield file


def attributes(path: Place) -> dict[str, Any]:
    """Global attributes of a result; of a folder, those of its first file.

    Raises
    ------
    InputError
        There is no such result, or it is damaged.
    """
    if names_store(path):
        with opened(path) as store:
            return global_attributes(store)
    path = Path(path)
    with result_file(path / chunk_name(0) if path.is_dir() else path) as file:
        return file.attrs


def global_attributes(file: Any) -> dict[str, Any]:
    """Those of what `opened` yields."""
    return {name: file.getncattr(name) for name in file.ncattrs()}


def stored_chunks(plan: AnyPlan, path: Place, chunk_cells: int) -> Iterator[tuple[Chunk, dict[str, NDArray[Any]]]]:
    """Read the chunks of a result, and the arrays of their results."""
    sizes = {name: result.sizes for name, result in plan.template().data_vars.items()}
    cut = grid_chunks(plan.sizes, chunk_cells, plan.together)
    if not names_store(path) and Path(path).is_dir():
        for number, chunk in enumerate(cut):
            with opened(Path(path) / chunk_name(number)) as file:
                yield chunk, {name: np.asarray(file[name][...]) for name in sizes}
        return
    with opened(path) as file:
        for chunk in cut:
            where = {name: tuple(places(chunk, own).values()) for name, own in sizes.items()}
            yield chunk, {name: np.asarray(file[name][where[name] or ...]) for name in sizes}


def stored_table(plan: AnyPlan, path: Place, chunk_cells: int, names: Collection[str]) -> xr.Dataset:
    """Read some results of a plan that were written as `slipsweep.runs.store.run` told."""
    table = plan.template()
    found = {
        name: xr.Variable(one.dims, np.empty(one.shape, one.dtype), one.attrs)
        for name, one in table.data_vars.items()
        if name in names
    }
    for chunk, arrays in stored_chunks(plan, path, chunk_cells) if found else ():
        for name, one in found.items():
            one.values[tuple(places(chunk, one.sizes).values())] = arrays[name]
    return xr.Dataset(found, table.coords, table.attrs)


def nbytes(path: Place) -> int:
    """Bytes that a result takes."""
    if names_store(path):
        return zarr_store.nbytes(path)
    path = Path(path)
    return sum(one.stat().st_size for one in path.iterdir()) if path.is_dir() else path.stat().st_size
