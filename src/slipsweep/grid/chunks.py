"""Grids cut into chunks."""

import itertools
import math
from collections.abc import Collection, Iterator, Mapping
from typing import TypeAlias

import xarray as xr

#: A part of a grid: the slice of each dimension.
Chunk: TypeAlias = dict[str, slice]

#: Cells read, solved or written at a time: 80 MB of results, yet enough to keep the kernels busy.
CHUNK_CELLS = 4_000_000


def chunk_lengths(
    shape: Mapping[str, int], most: int, together: Collection[str] = ()
) -> dict[str, int]:
    """Return the lengths of a chunk of at most `most` cells, whole along the last dimensions.

    The cells of a chunk then follow one another in the file.  The frequency is among the last
    dimensions, and a whole axis of it costs `sweep` hardly more than one value.  Dimensions in
    `together` are cut last.
    """
    lengths: dict[str, int] = {}
    order = sorted(shape, key=lambda dim: dim in together)
    cells = 1
    for dim in reversed(order):
        # equal shares rather than full chunks and a remnant
        pieces = math.ceil(shape[dim] / max(1, most // cells))
        lengths[dim] = math.ceil(shape[dim] / pieces)
        cells *= lengths[dim]
    return {dim: lengths[dim] for dim in shape}


def grid_chunks(
    shape: Mapping[str, int], most: int, together: Collection[str] = ()
) -> Iterator[Chunk]:
    """Yield the chunks of a grid, of the lengths of `chunk_lengths`, in the order of the file.

    A grid without cells has none.
    """
    if 0 not in shape.values():
        lengths = chunk_lengths(shape, most, together)
        for corner in itertools.product(*(range(0, shape[dim], lengths[dim]) for dim in shape)):
            starts = dict(zip(shape, corner, strict=True))
            yield {
                dim: slice(start, min(start + lengths[dim], shape[dim]))
                for dim, start in starts.items()
            }


def sizes_within(chunk: Chunk, sizes: Mapping[str, int]) -> dict[str, int]:
    """Return the lengths of the dimensions of a grid within a chunk of it."""
    return {
        dim: chunk[dim].stop - chunk[dim].start if dim in chunk else size
        for dim, size in sizes.items()
    }


def variables_within(chunk: Chunk, variables: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return the parts of variables that lie within a chunk, as views."""
    return {name: values.isel(chunk, missing_dims="ignore") for name, values in variables.items()}
