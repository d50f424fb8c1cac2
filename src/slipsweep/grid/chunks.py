"""How a plan is carried out in chunks of its grid, one after the other or as a graph of dask's."""

import itertools
import math
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.grid.tally import Tally

#: A part of a grid: where it lies along each dimension.
Chunk: TypeAlias = dict[str, slice]

#: Cells read, solved or written at a time: 80 MB of results, yet enough to keep the kernels busy.
CHUNK_CELLS = 4_000_000

#: Lengths of the chunks along each dimension of a grid.
Lengths = Mapping[str, tuple[int, ...]]

Dim = TypeVar("Dim", bound=Hashable)


class AnyPlan(Protocol):
    """What every study is: a grid, results over it, and all that it takes to compute them."""

    sizes: dict[str, int]  # of the grid, its dimensions in the order of the results
    names: tuple[str, ...]  # of the results, in the order of the table
    cost: float  # of a cell of the grid, in cells of the cycle solver
    together: tuple[str, ...]  # dimensions along which a part takes about as much as all: to be cut last
    memory: int  # bytes that solving takes beside the results, however small the grid
    cell_memory: int  # bytes for each cell of the grid that it takes beside them

    @property
    def cells(self) -> int:
        """What there is to solve, in what `progress` counts."""

    def template(self) -> xr.Dataset:
        """The results with their dimensions and coordinates but no values: zeros that take no memory."""

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Compute everything at once; `progress` is told of cells as they are finished, from any thread."""

    def part(self, chunk: Chunk) -> "AnyPlan":
        """The plan of a part of the grid, which gives the same bits as the whole does there."""

    def tally(self, results: xr.Dataset) -> Tally:
        """Modes and flags in a chunk of results."""


def chunk_lengths(shape: Mapping[Dim, int], most: int, together: Collection[Dim] = ()) -> dict[Dim, int]:
    """Return the chunk of a grid: at most `most` cells, whole along the last dimensions as far as they allow.

    Its cells then follow one another in the file.  Among the last dimensions is the frequency, of which a
    whole axis costs `sweep` hardly more than one value.  Dimensions `together` are cut only where no other is left.
    """
    lengths: dict[Dim, int] = {}
    order, cells = sorted(shape, key=lambda dim: dim in together), 1
    for dim in reversed(order):
        # equal shares rather than full chunks and a remnant
        pieces = math.ceil(shape[dim] / max(1, most // cells))
        lengths[dim] = math.ceil(shape[dim] / pieces)
        cells *= lengths[dim]
    return {dim: lengths[dim] for dim in shape}


def grid_chunks(shape: Mapping[Dim, int], most: int, together: Collection[Dim] = ()) -> Iterator[dict[Dim, slice]]:
    """Cut a grid into chunks as `chunk_lengths` says, in the order of the file; a grid without cells has none."""
    if 0 not in shape.values():
        lengths = chunk_lengths(shape, most, together)
        for corner in itertools.product(*(range(0, shape[dim], lengths[dim]) for dim in shape)):
            starts = dict(zip(shape, corner, strict=True))
            yield {dim: slice(start, min(start + lengths[dim], shape[dim])) for dim, start in starts.items()}


def slabs(shape: tuple[int, ...], most: int) -> Iterator[tuple[slice, ...]]:
    """Cut a grid whose dimensions have no names."""
    for chunk in grid_chunks(dict(enumerate(shape)), most):
        yield tuple(chunk.values())


def places(chunk: Mapping[str, slice], sizes: Mapping[str, int]) -> dict[str, slice]:
    """Where a chunk lies in what has these dimensions: in all of those that are none of the grid's."""
    return {dim: chunk.get(dim, slice(0, length)) for dim, length in sizes.items()}


def chunk_at(lengths: Lengths, index: tuple[int, ...]) -> Chunk:
    """Where the chunk of this index lies in the grid."""
    edges = ((sum(own[:at]), own[at]) for own, at in zip(lengths.values(), index, strict=True))
    return {dim: slice(start, start + length) for dim, (start, length) in zip(lengths, edges, strict=True)}


def solved_chunks(plan: AnyPlan, lengths: Lengths) -> Any:
    """A dask array with one element a chunk of the grid: the results of the chunk, arrays by their names.

    Its element is an object, so that all results of a chunk come out of one task, whatever their types and dimensions.
    """
    import dask.array as da  # takes as long as xarray: only for runs in chunks

    ones = tuple((1,) * len(own) for own in lengths.values())
    meta = np.empty((0,) * len(ones), object)
    return da.map_blocks(_solved, plan=plan, lengths=dict(lengths), chunks=ones, dtype=object, meta=meta)


def _solved(plan: AnyPlan, lengths: Lengths, block_id: tuple[int, ...]) -> NDArray[Any]:
    table = plan.part(chunk_at(lengths, block_id)).solve()
    found = np.empty((1,) * len(block_id), object)
    found[(0,) * len(block_id)] = {str(name): one.values for name, one in table.data_vars.items()}
    return found


def lazy_dataset(plan: AnyPlan, lengths: Lengths) -> xr.Dataset:
    """The results of a plan as dask arrays in chunks of these lengths: nothing is computed before it is asked for."""
    import dask.array as da

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
