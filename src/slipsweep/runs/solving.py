"""How large the chunks of a run are, and how they are solved in this process."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

import xarray as xr

from slipsweep.errors import InputError
from slipsweep.grid import chunks
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk
from slipsweep.grid.resources import size_text

#: Called with a number of cells just solved, from any thread.
Progress: TypeAlias = Callable[[int], None]

#: What becomes of a chunk where it is solved: called with its plan, number and place and its results.
Deliver: TypeAlias = Callable[[AnyPlan, int, Chunk, xr.Dataset], Any]

#: What solves chunks of a plan, given with their numbers: yields each with its number, in any order; or what came of
#: it, where a `Deliver` is given last.  A chunk's results are let go of before the next is asked for, but for one:
#: whose memory may be used for those of the next but one.
Solved: TypeAlias = Callable[..., Iterator[tuple[int, Any]]]

#: Resident memory of a run beside its chunks, with the compiler: a run of 10^9 cells peaked at
#: 469 MB, of which 96 MB were its chunks.
_BASE_MEMORY = 400_000_000

#: Resident memory of a worker process on this machine beside its chunks (220 MB seen).
_WORKER_MEMORY = 250_000_000

#: Chunks for each worker process of a cluster, so that all end at about the same time, where
#: that leaves chunks of this much work at least, in cells of the cycle solver: tens of
#: milliseconds, against the two that a chunk takes on its way.
_CHUNKS_A_WORKER = 16
_LEAST_WORK = 500_000

#: Processes reckoned with where a scheduler has them.
_UNKNOWN_WORKERS = 64


def default_cells(plan: AnyPlan) -> int:
    """Return how many cells are solved and written at a time if nothing else is asked for.

    No more than seconds of work are to be lost with a chunk.
    """
    return max(1, int(chunks.CHUNK_CELLS / plan.cost))


def chunk_memory(plan: AnyPlan, most: int) -> int:
    """Return the memory that chunks of at most `most` cells take, in bytes.

    Two are there at a time, one being solved and one being written, with 8 bytes a cell
    for conversion and counting.
    """
    lengths = chunks.chunk_lengths(plan.sizes, most, plan.together)
    return plan.memory + math.prod(lengths.values()) * _cell_memory(plan)


def cells_within(memory: int, plan: AnyPlan, workers: int = 0) -> int:
    """Return how many cells a chunk may have for a run to stay within `memory` bytes.

    With `workers` processes beside this one, of which each has a chunk being solved and two
    waiting or on their way, that is the memory of all together.  Where a cell takes more work than
    one of the cycle solver, chunks are no larger than `default_cells`, however much memory there is.

    Raises
    ------
    InputError
        Not even a small chunk fits.
    """
    base = _BASE_MEMORY + plan.memory + workers * (_WORKER_MEMORY + plan.memory)
    cell = _cell_memory(plan, 2 + 3 * workers)
    cells = (memory - base) // cell
    if cells < 1000:
        least = base + 1000 * cell
        digits = 10 ** (math.floor(math.log10(least)) - 2)  # three are shown: what is shown must be enough
        shown = size_text(math.ceil(least / digits) * digits)
        with_workers = f" with --workers {workers}" if workers else ""
        raise InputError(f"--memory = {size_text(memory)}: must be {shown} at least{with_workers}")
    return cells if plan.cost <= 1.0 else min(cells, default_cells(plan))


def cells_shared(plan: AnyPlan, workers: int | None) -> int:
    """Return how many cells a chunk should have for workers to share a run evenly (None: a number unknown)."""
    share = math.prod(plan.sizes.values()) // (_CHUNKS_A_WORKER * (workers or _UNKNOWN_WORKERS))
    return min(default_cells(plan), max(math.ceil(_LEAST_WORK / plan.cost), share))


def _cell_memory(plan: AnyPlan, count: int = 2) -> int:
    """Bytes that a cell of the grid takes in so many chunks."""
    own = (
        result.values.dtype.itemsize * math.prod(size for dim, size in result.sizes.items() if dim not in plan.sizes)
        for result in plan.template().data_vars.values()
    )
    return count * sum(own) + plan.cell_memory + 8


def solve_here(
    plan: AnyPlan, missing: Mapping[int, Chunk], progress: Progress | None = None
) -> Iterator[tuple[int, xr.Dataset]]:
    """Solve chunks one after the other in this process.

    Parameters
    ----------
    plan : AnyPlan
    missing : mapping of int to Chunk
        The chunks to solve, by their numbers.
    progress : callable, optional

    Yields
    ------
    int, xr.Dataset
        The number of a chunk, and its results with their coordinates: its own until the next but
        one is asked for, whose arrays take their memory.
    """
    for number, chunk in missing.items():
        yield number, plan.part(chunk).solve(progress)


def try_out(plan: AnyPlan) -> None:
    """Solve a plan for what it is refused for, and keep nothing.

    Raises
    ------
    InputError
        A result of it is no finite number.
    """
    parts = chunks.grid_chunks(plan.sizes, default_cells(plan), plan.together)
    for _ in solve_here(plan, dict(enumerate(parts))):
        pass
