"""Runs: the chunks of a job are computed and written, here or by workers of dask.distributed.

The chunks of a worker that is lost are computed again on another.
"""

import importlib
import itertools
import logging
import math
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError, RunError, check_extra
from slipsweep.files import netcdf
from slipsweep.files.jobs import RUN, Job
from slipsweep.files.opening import check_zarr, read_result
from slipsweep.files.outputs import check_outputs, complete_or_absent, real_path
from slipsweep.files.spec import check_grid, named
from slipsweep.files.storing import Chunks, Place, ZarrChunks
from slipsweep.grid.chunks import CHUNK_CELLS, chunk_lengths
from slipsweep.grid.plans import Plan
from slipsweep.grid.resources import size_text
from slipsweep.studies.result_counts import Tally, tally_of

if TYPE_CHECKING:
    from distributed import Client

#: Resident memory, in bytes, of a run, and of a worker of this machine, without its chunks.
BASE_MEMORY = 430_000_000
_WORKER_MEMORY = 250_000_000

#: Chunks for each worker, so that all workers end at about the same time, and the least work of a
#: chunk, in cells under a sine.
_CHUNKS_A_WORKER = 16
_LEAST_WORK = 500_000

#: Most processes that `--workers` starts on one machine.
_MOST_WORKERS = 1024

#: Chunks that each thread of the workers has at a time: one is solved while the results of the
#: other are sent back.
_AHEAD = 2

#: Seconds between two looks for workers, and seconds for which there may be no worker.
_LOOK = 5.0
_PATIENCE = 60.0


@dataclass(frozen=True)
class Report:
    """Result of `run`; if the output `was_complete` by an earlier run, nothing was computed."""

    path: Place
    tally: Tally
    was_complete: bool = False


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
    remarks: Callable[[xr.Dataset], Mapping[str, str]] = lambda results: {},
) -> Report:
    """Solve a plan and write its results, complete or not at all.

    `path` is a netCDF file, a Zarr store (a name that ends in .zarr) or the address of one;
    `command`, as typed, goes into its `history`.  `overwrite` replaces it and the chunks of an
    interrupted run, `resume` goes on with these, and leaves a complete output as it is.  The run
    takes so many bytes of `memory`, on so many `workers` of this machine or on those of a
    `scheduler`.  `progress` is called with a number of cells just solved.  `remarks` makes
    attributes of the results, which go into the file before it gets its name.

    InputError: the output exists or cannot be written, the grid is too large for disk or memory, or
    there are chunks of an interrupted run, of another sweep or version, or without `resume` and
    `overwrite`.  RunError: writing failed, or another run is writing `path`; a note tells how many
    chunks are kept.
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers, --scheduler: give one of them, not both")
    if workers is not None and not 1 <= workers <= _MOST_WORKERS:
        raise InputError(f"--workers = {workers}: must be from 1 to {_MOST_WORKERS}")
    if workers or scheduler:
        check_extra("--workers, --scheduler: a cluster", "cluster", "distributed")
    plan = job.plan
    is_zarr = isinstance(path, str) or path.suffix == ".zarr"
    if is_zarr:
        check_zarr(path)
    if isinstance(path, Path):
        check_outputs([path], overwrite or resume, reads=job.spec.files)
        path = real_path(path)
    if resume and (complete := _complete(job, path)) is not None:
        return Report(path, tally_of(complete), was_complete=True)
    processes = workers or (64 if scheduler else 0)
    most = most_cells(plan, memory, workers or 0)
    lengths = chunk_lengths(plan.sizes, _chunk_cells(plan, most, processes), plan.together)
    chunks = (ZarrChunks if is_zarr else Chunks)(job, path, lengths, most)
    if lengths == plan.sizes and not is_zarr and not processes and not Path(chunks.place).exists():
        with named(job.spec.source):
            table = job.described(plan.solve(progress), command)
        table.attrs.update(remarks(table))
        with complete_or_absent(Path(path), overwrite) as temporary:
            netcdf.write_table(table, temporary, job.spec.output.compression)
        return Report(path, tally_of(table))
    with chunks.begun(command, resume, overwrite), named(job.spec.source), ExitStack() as stack:
        kept = ((place, None) for place in chunks if place[0] in chunks.done)
        tasks = ((place, chunks.task(*place)) for place in chunks if place[0] not in chunks.done)
        if processes:
            computed = _computed(stack.enter_context(_connected(workers, scheduler)), tasks)
        else:
            computed = ((place, task()) for place, task in tasks)
        for (number, chunk), results in itertools.chain(kept, computed):
            if results is not None:
                chunks.write(number, chunk, results)
            del results  # to free the memory before the next chunk is solved
            if progress is not None:
                progress(plan.part(chunk).cells)
        chunks.finish(overwrite, remarks)
        return Report(path, tally_of(read_result(path)))


def _complete(job: Job, path: Place) -> xr.Dataset | None:
    """Return the output, if it exists and is complete (InputError: it is of another sweep)."""
    if isinstance(path, Path) and not path.exists():
        return None
    try:
        table = read_result(path)
    except InputError:
        if isinstance(path, Path):
            raise
        return None  # nothing is at the address, or a store that is not finished
    if table.attrs.get(RUN) != job.digest:
        raise InputError(
            f"{path}: is of another sweep or version; give --overwrite to replace it, or another "
            "name with -o"
        )
    check_grid(table, job.plan.template().coords, path)
    return table


def most_cells(plan: Plan, memory: int | None, workers: int) -> float:
    """Return the number of cells of a chunk that the memory holds; infinity: it is not limited."""
    if memory is None:
        return math.inf
    base = BASE_MEMORY + plan.memory + workers * (_WORKER_MEMORY + plan.memory)
    results = sum(
        result.dtype.itemsize
        * math.prod(size for dim, size in result.sizes.items() if dim not in plan.sizes)
        for result in plan.template().data_vars.values()
    )
    # this process has a chunk, and its copies while it is written; a worker has one chunk, and
    # others are being sent
    cell = (2 + 3 * workers) * results + plan.cell_memory + 8
    most = (memory - base) // cell
    if most < 1000:
        raise InputError(
            f"--memory = {size_text(memory)}: must be {size_text(1.01 * (base + 1000 * cell))} "
            "at least"
        )
    return most


def _chunk_cells(plan: Plan, most: float, processes: int) -> int:
    """Return the number of cells of a chunk.

    A chunk is some seconds of work, and there are enough chunks for all processes.  Cells that cost
    little fill the memory that is allowed.
    """
    cells = max(1, int(CHUNK_CELLS / plan.cost))
    if processes:
        share = math.prod(plan.sizes.values()) // (_CHUNKS_A_WORKER * processes)
        cells = min(cells, max(math.ceil(_LEAST_WORK / plan.cost), share))
    fills = math.isfinite(most) and plan.cost <= 1.0 and not processes
    return int(most if fills else min(most, cells))


@contextmanager
def _connected(workers: int | None, scheduler: str | None) -> "Iterator[Client]":
    """Start workers on this machine, of one thread each, or connect to a scheduler.

    RunError: no scheduler answers.
    """
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr

    # its log of lost workers helps nobody: the run goes on, or ends with one message
    with silence_logging_cmgr(logging.CRITICAL):
        if scheduler is None:
            local = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                preload=[__name__],  # calls `dask_setup`
                memory_limit=0,  # no worker is paused or killed: chunks are made to fit
                silence_logs=logging.CRITICAL,
            )
            with local, Client(local) as client:
                yield client
            return
        try:
            client = Client(scheduler, timeout=10.0)
        except (OSError, ValueError) as error:
            raise RunError(
                f'--scheduler = "{scheduler}": no scheduler answers there: {error}'
            ) from None
        try:
            _check_versions(client, scheduler)
            yield client
        finally:
            with suppress(OSError, TimeoutError):  # the scheduler may be gone
                client.close(timeout=10.0)


def dask_setup(worker: object) -> None:
    """Ignore Ctrl-C in a worker, as the process that closes the cluster handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _check_versions(client: "Client", scheduler: str) -> None:
    """Raise RunError if there are no workers, or workers with another version of slipsweep."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        message = (
            f"the scheduler at {scheduler} has no workers: start some with: dask worker {scheduler}"
        )
        raise RunError(message) from None
    # a lambda is sent as code, so that workers need not have this module
    versions = client.run(
        lambda: importlib.import_module("slipsweep._version").__version__, on_error="return"
    )
    for worker, version in versions.items():
        if version != __version__:
            raise RunError(
                f"slipsweep at the worker {worker}: {version}, in this process: {__version__}"
            )


def _computed(
    client: "Client", tasks: Iterable[tuple[Any, Callable[[], Any]]]
) -> Iterator[tuple[Any, Any]]:
    """Carry out named tasks, and yield the name and the result of each as it comes back.

    RunError: there are no workers any more, or the scheduler was lost.
    """
    from distributed import CancelledError, KilledWorker, wait

    names: dict[Any, Any] = {}
    left = iter(tasks)
    seen = time.monotonic()
    while True:
        try:
            threads = sum(client.ncores().values())
            for name, task in itertools.islice(left, max(_AHEAD * max(threads, 1) - len(names), 0)):
                names[client.submit(task, pure=False)] = name
            if not names:
                return
            for future in wait(list(names), timeout=_LOOK, return_when="FIRST_COMPLETED").done:
                yield names.pop(future), future.result()
            seen = time.monotonic()
        except TimeoutError:
            if threads:
                seen = time.monotonic()
            if time.monotonic() - seen > _PATIENCE:
                raise RunError(f"there has been no worker for {_PATIENCE:.0f} s") from None
        except KilledWorker as error:
            raise RunError(
                f"a chunk was lost with several workers in turn ({error}): do they run out of "
                "memory?"
            ) from None
        except (CancelledError, OSError) as error:
            raise RunError(f"the scheduler was lost: {error}") from None
