"""A run: the chunks of a job solved, here or by workers, and written while others are computed."""

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from slipsweep.errors import InputError
from slipsweep.files import cluster, netcdf
from slipsweep.files.jobs import RUN, Job
from slipsweep.files.opening import read_result
from slipsweep.files.outputs import check_outputs, complete_or_absent
from slipsweep.files.storing import Chunks, NetcdfChunks, Place, ZarrChunks
from slipsweep.grid.chunks import CHUNK_CELLS, AnyPlan, chunk_lengths, grid_chunks
from slipsweep.grid.resources import size_text
from slipsweep.grid.tally import Tally

#: Resident memory of a run, and of a worker of this machine, beside its chunks.
_BASE_MEMORY, _WORKER_MEMORY = 430_000_000, 250_000_000

#: Chunks for each worker, so that all end at about the same time, and the least work of one, in cells of a sine.
_CHUNKS_A_WORKER, _LEAST_WORK = 16, 500_000


@dataclass(frozen=True)
class Report:
    """What `run` did; `found`: the output was complete by an earlier run, and nothing was computed."""

    path: Place
    tally: Tally
    found: bool = False


def run(
    job: Job,
    path: Place,
    *,
    command: str,
    overwrite: bool = False,
    resume: bool = False,
    memory: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> Report:
    """Solve a plan and write its results, complete or not at all.

    `path` is a netCDF file, a Zarr store (a name that ends in .zarr) or the address of one; `command`, as typed, goes
    into its `history`.  `overwrite` replaces it and the chunks of an interrupted run, `resume` goes on with these, and
    leaves a complete output as it is.  The run takes so many bytes of `memory`, on so many `workers` of this machine or
    on those of a `scheduler`.  `progress` is called with a number of cells just solved.

    Raises
    ------
    InputError
        The output exists or cannot be written, the grid is too large for disk or memory, or there are chunks of an
        interrupted run, and neither `resume` nor `overwrite` is given, or they are of another sweep or version.
    RunError
        Writing failed, or another run is writing `path`.  A note tells how many chunks are kept.
    """
    cluster.check_cluster(workers, scheduler)
    plan = job.plan
    if isinstance(path, Path):
        check_outputs([path], overwrite or resume, reads=job.spec.files)
    if resume and (complete := _complete(job, path)) is not None:
        return Report(path, tally_of(complete, plan), found=True)
    processes = workers or (64 if scheduler else 0)
    lengths = chunk_lengths(plan.sizes, _chunk_cells(plan, memory, processes, workers or 0), plan.together)
    is_zarr = isinstance(path, str) or path.suffix == ".zarr"
    chunks = (ZarrChunks if is_zarr else NetcdfChunks)(job, path, lengths)
    if math.prod(chunks.shape) == 1 and not is_zarr and not processes and not Path(chunks.place).exists():
        with job.spec.named():
            table = plan.solve(progress)
        with complete_or_absent(Path(path), overwrite) as temporary:
            netcdf.write_table(job.described(table, command), temporary, job.spec.output.compression)
        return Report(path, tally_of(table, plan))

    def tell(number: int) -> None:
        if progress is not None:
            progress(plan.part(chunks.chunk(number)).cells)

    with chunks.begun(command, resume, overwrite), job.spec.named():
        for number in chunks.done:
            tell(number)
        if processes:
            _solve_elsewhere(chunks, workers, scheduler, tell)
        else:
            _solve_here(chunks, tell)
        chunks.finish(overwrite)
        return Report(path, tally_of(read_result(path), plan))


def tally_of(table: xr.Dataset, plan: AnyPlan) -> Tally:
    """Count the results of a plan, read in chunks."""
    tally = Tally()
    for chunk in grid_chunks(plan.sizes, CHUNK_CELLS, plan.together):
        part = table[list(plan.names)].isel(chunk, missing_dims="ignore")
        tally.merge(plan.tally({name: part[name].values for name in plan.names}))
    tally.cells = plan.cells
    return tally


def _complete(job: Job, path: Place) -> xr.Dataset | None:
    """The output, if it is there and of this very sweep."""
    if isinstance(path, Path) and not path.exists():
        return None
    try:
        found = read_result(path)
    except InputError:
        if isinstance(path, Path):
            raise
        return None  # nothing is at the address, or a store that is not finished
    if found.attrs.get(RUN) != job.digest:
        raise InputError(
            f"{path}: is of another sweep or version; give --overwrite to replace it, or another name with -o"
        )
    return found


def _chunk_cells(plan: AnyPlan, memory: int | None, processes: int, workers: int) -> int:
    """How many cells a chunk may have: seconds of work, within the memory, and enough chunks for all processes."""
    cells = max(1, int(CHUNK_CELLS / plan.cost))
    if processes:
        share = math.prod(plan.sizes.values()) // (_CHUNKS_A_WORKER * processes)
        cells = min(cells, max(math.ceil(_LEAST_WORK / plan.cost), share))
    if memory is None:
        return cells
    base = _BASE_MEMORY + plan.memory + workers * (_WORKER_MEMORY + plan.memory)
    results = sum(
        one.dtype.itemsize * math.prod(size for dim, size in one.sizes.items() if dim not in plan.sizes)
        for one in plan.template().data_vars.values()
    )
    # in this process one chunk is solved and one is written; a worker has one, and others are on their way
    cell = (2 + 3 * workers) * results + plan.cell_memory + 8
    within = (memory - base) // cell
    if within < 1000:
        raise InputError(f"--memory = {size_text(memory)}: must be {size_text(1.01 * (base + 1000 * cell))} at least")
    return int(min(within, cells) if plan.cost > 1.0 or processes else within)


def _solve_here(chunks: Chunks, progress: Callable[[int], None]) -> None:
    """Compute the chunks that are missing; one thread writes each while the next is computed."""
    solved = chunks.solved
    with ThreadPoolExecutor(1) as writer:
        waiting: Future[None] | None = None
        for number, index in chunks.missing():
            found = solved.blocks[index].compute(scheduler="synchronous").item()
            if waiting is not None:
                waiting.result()
            waiting = writer.submit(chunks.write, number, found)
            progress(number)
        if waiting is not None:
            waiting.result()


def _solve_elsewhere(
    chunks: Chunks, workers: int | None, scheduler: str | None, progress: Callable[[int], None]
) -> None:
    """Have the chunks that are missing computed by workers, and written by them or here as they come back."""
    written = chunks.written
    with cluster.connected(workers, scheduler) as client:
        blocks = ((number, written.blocks[index]) for number, index in chunks.missing())
        for number, found in cluster.computed(client, blocks):
            if found.dtype == object:  # results, which a worker has not written
                chunks.write(number, found.item())
            progress(number)
