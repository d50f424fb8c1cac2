"""Grids cut into chunks."""

import itertools
import math
from collections.abc import Collection, Hashable, Iterator, Mapping
from typing import TypeAlias, TypeVar

#: A part of a grid: where it lies along each dimension.
Chunk: TypeAlias = dict[str, slice]

#: Cells read, solved or written at a time: 80 MB of results, yet enough to keep the kernels busy.
CHUNK_CELLS = 4_000_000

#: Lengths of the chunks along each dimension of a grid.
Lengths = Mapping[str, tuple[int, ...]]

Dim = TypeVar("Dim", bound=Hashable)


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
