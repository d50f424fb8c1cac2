"""Blocks of a grid: how a sweep is cut, and how its blocks are solved in this process."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import TypeAlias

from slipsweep.spec import SweepSpec
from slipsweep.tables import Table

#: A part of a grid: where it lies along each dimension.
Block: TypeAlias = dict[str, slice]

#: Called with a number of cells just solved, from any thread.
Progress: TypeAlias = Callable[[int], None]

#: What solves blocks, given with their numbers: yields each with its number, in any order.
#: A block's results are let go of before the next is asked for, but for one.
Solved: TypeAlias = Callable[[SweepSpec, Mapping[int, Block], Progress | None], Iterator[tuple[int, Table]]]

#: Cells in a chunk of a flag variable: read in well under a millisecond.
CHUNK_CELLS = 2**18

#: Dimensions that blocks and chunks cut last.  Charts are drawn over these two, and a whole
#: frequency axis costs `sweep` hardly more than one frequency.
_CUT_LAST = ("amplitude", "displacement_amplitude", "frequency")


def _cut_order(shape: Mapping[str, int]) -> list[str]:
    return [dim for dim in shape if dim not in _CUT_LAST] + [dim for dim in _CUT_LAST if dim in shape]


def chunk_lengths(shape: Mapping[str, int], most: int = CHUNK_CELLS) -> dict[str, int]:
    """Return the chunk of a grid: whole along frequency and amplitude as far as `most` and `CHUNK_CELLS` allow."""
    most = min(most, CHUNK_CELLS)
    lengths: dict[str, int] = {}
    cells = 1
    for dim in reversed(_cut_order(shape)):
        pieces = math.ceil(shape[dim] / max(1, most // cells))
        lengths[dim] = math.ceil(shape[dim] / pieces)
        cells *= lengths[dim]
    return lengths


def block_lengths(shape: Mapping[str, int], most: int) -> dict[str, int]:
    """Return the block of a grid: at most `most` cells, in whole chunks."""
    lengths = dict(shape)
    chunks = chunk_lengths(shape, most)
    for dim in _cut_order(shape):
        others = math.prod(lengths.values()) // lengths[dim]
        count = math.ceil(shape[dim] / chunks[dim])
        pieces = math.ceil(count / max(1, most // (others * chunks[dim])))
        # equal shares rather than full blocks and a remnant
        lengths[dim] = min(shape[dim], chunks[dim] * math.ceil(count / pieces))
    return lengths


def grid_blocks(shape: Mapping[str, int], most: int) -> Iterator[Block]:
    """Cut a grid into blocks, in the order of the file."""
    lengths = block_lengths(shape, most)
    starts = (range(0, shape[dim], lengths[dim]) for dim in shape)
    for corner in itertools.product(*starts):
        yield {
            dim: slice(start, min(start + lengths[dim], shape[dim])) for dim, start in zip(shape, corner, strict=True)
        }


def solve_here(
    spec: SweepSpec, blocks: Mapping[int, Block], progress: Progress | None = None
) -> Iterator[tuple[int, Table]]:
    """Solve blocks one after the other in this process.

    Parameters
    ----------
    spec : SweepSpec
    blocks : mapping of int to Block
        The blocks to solve, by their numbers.
    progress : callable, optional

    Yields
    ------
    int, Table
        The number of a block, and its results with their coordinates.
    """
    from slipsweep.plans import plan_sweep  # imports numba: not for `info`, and not to be counted as computing time

    for number, block in blocks.items():
        yield number, plan_sweep(**spec.arguments(block)).solve(progress)
