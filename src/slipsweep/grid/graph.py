"""A plan as a dask graph, by dask's public functions: chunks of its grid, each solved once for all results."""

import itertools
from collections.abc import Mapping
from typing import Any

import dask.array as da
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk

#: Lengths of the chunks along each dimension of a grid.
Lengths = Mapping[str, tuple[int, ...]]


def chunk_at(lengths: Lengths, index: tuple[int, ...]) -> Chunk:
    """Where the chunk of this index lies in the grid."""
    edges = (itertools.accumulate(own, initial=0) for own in lengths.values())
    starts = [tuple(one) for one in edges]
    return {dim: slice(own[at], own[at + 1]) for dim, own, at in zip(lengths, starts, index, strict=True)}


def solved_chunks(plan: AnyPlan, lengths: Lengths) -> Any:
    """A dask array with one element a chunk of the grid: the results of the chunk, arrays by their names.

    Its element is an object, so that all results of a chunk come out of one task, whatever their types and dimensions.
    """
    ones = tuple((1,) * len(own) for own in lengths.values())
    meta = np.empty((0,) * len(ones), object)
    return da.map_blocks(_solve, plan=plan, lengths=dict(lengths), chunks=ones, dtype=object, meta=meta)


def _solve(plan: AnyPlan, lengths: Lengths, block_id: tuple[int, ...]) -> NDArray[Any]:
    table = plan.part(chunk_at(lengths, block_id)).solve()
    found = np.empty((1,) * len(block_id), object)
    found[(0,) * len(block_id)] = {str(name): one.values for name, one in table.data_vars.items()}
    return found


def lazy_dataset(plan: AnyPlan, lengths: Lengths) -> xr.Dataset:
    """The results of a plan as dask arrays in chunks of these lengths: nothing is computed before it is asked for."""
    chunks, table = solved_chunks(plan, lengths), plan.template()
    found = {}
    for name, result in table.data_vars.items():
        # a result has some dimensions of the grid, in their order, and perhaps others of its own after them
        own = [dim for dim in result.dims if dim in lengths]
        source = chunks[tuple(slice(None) if dim in own else 0 for dim in lengths)] if lengths else chunks
        values = da.map_blocks(
            _result,
            source,
            result=name,
            chunks=tuple(lengths[str(dim)] if dim in lengths else (result.sizes[dim],) for dim in result.dims),
            new_axis=list(range(len(own), len(result.dims))) or None,
            dtype=result.dtype,
            meta=np.empty((0,) * result.ndim, result.dtype),
        )
        found[name] = xr.Variable(result.dims, values, result.attrs)
    return xr.Dataset(found, table.coords, table.attrs)


def _result(chunk: Any, result: str) -> NDArray[Any]:
    """One result of a chunk, which is an element of `solved_chunks` or an array of that alone."""
    results = chunk.item() if isinstance(chunk, np.ndarray) else chunk
    return np.asarray(results[result])
