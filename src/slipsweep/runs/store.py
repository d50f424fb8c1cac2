"""A sweep computed and written chunk by chunk.

A run that is killed leaves what it has finished on record (`slipsweep.runs.parts`) where it belongs
(`slipsweep.runs.targets`), so that another goes on from there and no value is written twice.
"""

import math
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from slipsweep.errors import InputError, RunError
from slipsweep.files import zarr_store
from slipsweep.files.netcdf import TooLarge, history_of
from slipsweep.files.outputs import CHUNKS, FILE, ZARR, check_outputs, writing
from slipsweep.files.zarr_store import Place, names_store
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk, chunk_lengths, grid_chunks
from slipsweep.grid.resources import available_memory, grid_text, size_text
from slipsweep.grid.tally import Tally
from slipsweep.runs import parts
from slipsweep.runs.jobs import Job
from slipsweep.runs.solving import Progress, Solved, chunk_memory, default_cells, solve_here
from slipsweep.runs.stored import attributes, nbytes, stored_chunks
from slipsweep.runs.targets import Delivered, Delivery, Target, counts
from slipsweep.runs.targets.onefile import OneFile
from slipsweep.runs.targets.splitfiles import SplitFiles
from slipsweep.runs.targets.zarrstore import ZarrStore, check_address

#: Seconds after which what is written is brought to the disk itself.
_SYNC_SECONDS = 1.0


@dataclass
class Report:
    """What `run` did."""

    path: Place
    chunk_cells: int
    seconds: float
    nbytes: int
    tally: Tally
    found: bool = False  # complete, by an earlier run: nothing was computed


def run(
    job: Job,
    path: Place,
    *,
    command: str,
    overwrite: bool = False,
    resume: bool = False,
    split: bool = False,
    shared: bool = False,
    chunk_cells: int | None = None,
    shared_cells: int | None = None,
    progress: Progress | None = None,
    solved: Solved = solve_here,
) -> Report:
    """Solve a plan and write its results, complete or not at all.

    Finished chunks of a run that failed or was killed are kept beside the output
    (`slipsweep.runs.parts`).

    Parameters
    ----------
    job : Job
    path : Path or str
        The file to write, or the folder (`split`), or a Zarr store: a folder, or the address of one.
    command : str
        The command as typed, for the file's `history`.
    overwrite : bool
        Replace `path` and the chunks of an interrupted run, if they exist.
    resume : bool
        Go on with the chunks of an interrupted run, if there are any.  An output that is complete and of this very
        sweep is left as it is.
    split : bool
        Write a folder with a netCDF file for each chunk.
    shared : bool
        Those who solve chunks reach the output: they write it themselves, if it is split or a store.
    chunk_cells : int, optional
        Most cells to solve and write at a time; two such chunks are in memory.  By default
        `solving.default_cells`, or what an interrupted run had.
    shared_cells : int, optional
        As many cells or fewer, so that those who solve chunks share them evenly; but what an
        interrupted run had goes before.
    progress : callable
        Called with a number of cells just solved, from any thread.
    solved : callable
        What solves the chunks, in any order (`solving.Solved`).

    Returns
    -------
    Report

    Raises
    ------
    InputError
        The output exists or cannot be written, the grid is too large for disk or memory, there
        are chunks of an interrupted run but neither `resume` nor `overwrite` is given, or they
        are of another sweep or version.
    RunError
        Writing failed, memory ran out, or another run is writing `path`.  A note tells how many
        chunks are kept.
    """
    check_output(job, path, overwrite=overwrite or resume, split=split)
    plan = job.plan  # what it refuses, it refuses before there is a folder
    with parts.opened(_local(path)) as work:
        target = _target(job, path, work, split=split, shared=shared)
        identity = parts.identity(job.asked, target.identity)
        if not overwrite:
            work.read()
        if work.finished and not (resume or overwrite):
            raise InputError(
                f"{path}: {work.path.name} holds {len(work.finished)} finished chunks of an interrupted run; "
                "go on with --resume, or start again with --overwrite"
            )
        if resume and not work.finished and target.is_complete():
            return _found(job, path, _complete(job, path, identity))
        if resume and work.finished and work.manifest is not None:
            _check_same(work, identity, chunk_cells)
            manifest = work.manifest
            if work.complete and target.has_appeared():
                # killed between giving the output its name and clearing the folder away
                work.done = True
                return _found(job, path, manifest.chunk_cells)
        else:
            work.clear()
            cells = min(filter(None, (chunk_cells, shared_cells)), default=default_cells(plan))
            lengths = chunk_lengths(plan.sizes, cells, plan.together)
            manifest = parts.Manifest(identity, cells, overwrite, history_of(command), dict(plan.sizes), lengths)
        # once more: a run that was writing it may have ended before this one got hold of the lock
        check_output(job, path, overwrite=manifest.overwrite or (resume and bool(work.finished)), split=split)
        return _carry_out(job, path, work, target, manifest, progress, solved)


def _target(job: Job, path: Place, work: parts.Folder, *, split: bool, shared: bool) -> Target:
    if names_store(path):
        return ZarrStore(job, path, work, shared)
    assert isinstance(path, Path)
    return SplitFiles(job, path, work, shared) if split else OneFile(job, path, work)


def _carry_out(
    job: Job,
    path: Place,
    work: parts.Folder,
    target: Target,
    manifest: parts.Manifest,
    progress: Progress | None,
    solved: Solved,
) -> Report:
    """Solve and write what is missing, and give the output its name."""
    plan, chunk_cells = job.plan, manifest.chunk_cells
    _check_size(job, path, chunk_cells, target.nbytes)
    started = time.perf_counter()
    tally = Tally(plan.cells)
    cut = dict(enumerate(grid_chunks(plan.sizes, chunk_cells, plan.together)))
    try:
        with closing(target):
            _ready(job, work, target, manifest, cut, tally, progress)
            missing = {number: chunk for number, chunk in cut.items() if number not in work.finished}
            delivery = Delivery(target.writer, {name: job.dtype(name) for name in plan.names}, job.dims)
            found = solved(plan, missing, progress, *([delivery] if target.shared else []))

            def deliver(number: int, table: xr.Dataset) -> Delivered:
                return delivery(plan, number, cut[number], table)

            _write_chunks(work, target, _named(job, found), deliver, tally)
            with writing(path):
                work.check()
                target.finish(work.finished)
        with writing(path):
            work.close()
            target.appear(manifest.overwrite)
    except TooLarge as large:
        work.clear()  # no --resume could finish it
        raise InputError(f"{job.source}: {large}") from None
    except MemoryError:
        error = RunError(f"{path}: out of memory at a chunk of {_chunk_text(plan, chunk_cells)}")
        raise _noted(error, work, target, len(cut)) from None
    except BaseException as error:
        if isinstance(error, RunError):
            work.check()  # what came of that is not worth telling
        _noted(error, work, target, len(cut))
        raise
    work.done = True
    return Report(path, chunk_cells, time.perf_counter() - started, nbytes(path), tally)


def _complete(job: Job, path: Place, identity: Mapping[str, Any]) -> int:
    """The size of the chunks of an output that is complete.

    Raises
    ------
    InputError
        It is not the result of this sweep.
    """
    stored = None
    try:
        stored = parts.read_stamp(attributes(path), identity)
        difference = "it was not made by slipsweep run or limit" if stored is None else stored.difference(identity)
        if stored is not None and difference is None and stored.identity.get("--split"):
            there = len(list(Path(path).iterdir()))
            difference = None if there == stored.chunks else f"it has {there} files of {stored.chunks}"
    except InputError as error:
        difference = str(error).removeprefix(f"{path}: ")
    if stored is None or difference is not None:
        raise InputError(
            f"{path}: exists already, and is not the complete result of this sweep ({difference}); give "
            "--overwrite to replace it, or another name with -o"
        )
    return stored.chunk_cells


def _found(job: Job, path: Place, chunk_cells: int) -> Report:
    """The report of an output that is complete already."""
    tally = Tally(job.plan.cells)
    for chunk, arrays in stored_chunks(job.plan, path, chunk_cells):
        tally.merge(counts(job.plan, job.dims, chunk, arrays))
    return Report(path, chunk_cells, 0.0, nbytes(path), tally, found=True)


def check_output(job: Job, path: Place, *, overwrite: bool, split: bool) -> None:
    """Refuse an output that cannot be, before anything is computed for it."""
    if job.compression and not (split or names_store(path)):
        raise InputError(
            f"output.compression = {job.compression}: {path} is one netCDF file, whose values have their places before "
            "they are known, for --resume; give --split, or a name in .zarr"
        )
    if names_store(path):
        zarr_store.check_package(str(path))
        if split:
            raise InputError(f"--split: {path} is a store, which has an object for each chunk; leave --split away")
    if isinstance(path, str):
        check_address(path, overwrite)
        return
    kind = ZARR if names_store(path) else CHUNKS if split else FILE
    check_outputs([path], overwrite, reads=job.files, kind=kind, work=parts.Folder(path).path)


def _local(path: Place) -> Path:
    """The name here of an output; that of a store at an address is where the work folder lies."""
    return path if isinstance(path, Path) else Path(path.rstrip("/").rpartition("/")[2])


def _named(job: Job, found: Iterator[Any]) -> Iterator[Any]:
    with job.named():
        yield from found


def _check_same(work: parts.Folder, identity: Mapping[str, Any], chunk_cells: int | None) -> None:
    """Refuse to go on with chunks of another sweep, solver or version, or larger than allowed."""
    assert work.manifest is not None
    if difference := work.manifest.difference(identity):
        raise InputError(f"{work.output}: cannot go on with the chunks in {work.path.name}: {difference}")
    if chunk_cells is not None and chunk_cells < work.manifest.chunk_cells:
        raise InputError(
            f"--memory: too little for the chunks of {work.manifest.chunk_cells} cells that {work.path.name} "
            "was begun with; give more, or start again with --overwrite"
        )


def _noted(error: BaseException, work: parts.Folder, target: Target, chunks: int) -> BaseException:
    """Tell with an error how much of the run is kept."""
    if work.finished and work.is_there() and target.is_there():
        error.add_note(f"{len(work.finished)} of {chunks} chunks are kept; go on with --resume")
    return error


def _ready(
    job: Job,
    work: parts.Folder,
    target: Target,
    manifest: parts.Manifest,
    cut: Mapping[int, Chunk],
    tally: Tally,
    progress: Progress | None,
) -> None:
    """Take over the finished chunks that are as they were written, or begin with none."""
    kept = {}
    if work.finished and target.open(manifest):
        for number in sorted(work.finished.keys() & cut.keys()):
            arrays = target.find(number, cut[number], work.finished[number])
            if arrays is not None:
                kept[number] = work.finished[number]
                tally.merge(counts(job.plan, job.dims, cut[number], arrays))
                if progress is not None:
                    progress(job.plan.part(cut[number]).cells)
    with writing(work.output):
        if kept:
            work.keep(kept)
        else:
            target.close()
            work.clear()
            target.create(manifest)
            work.begin(manifest)


def _write_chunks(
    work: parts.Folder,
    target: Target,
    found: Iterator[tuple[int, xr.Dataset | Delivered]],
    deliver: Callable[[int, xr.Dataset], Delivered],
    tally: Tally,
) -> None:
    """Put chunks on record that are written, and write the others, each while the next is being solved.

    Beside it what is written is brought to the disk itself.
    """
    pending: Future[None] | None = None
    syncing: Future[None] | None = None
    synced = time.monotonic()

    def take(number: int, one: xr.Dataset | Delivered) -> None:
        nonlocal syncing, synced
        with writing(work.output):
            work.check()
            done = one if isinstance(one, Delivered) else deliver(number, one)
            work.add(number, done.digest)
            tally.merge(done.tally)
            if time.monotonic() - synced >= _SYNC_SECONDS:
                if syncing is not None:
                    syncing.result()
                syncing, synced = syncer.submit(bring), time.monotonic()

    def bring() -> None:
        target.sync()
        work.sync()

    # leaving them waits, for the writer first: a chunk that is being written is finished
    with ThreadPoolExecutor(1) as syncer, ThreadPoolExecutor(1) as writer:
        for number, one in found:
            if pending is not None:
                pending.result()
            pending = writer.submit(take, number, one)
            del one
        if pending is not None:
            pending.result()
        with writing(work.output):
            if syncing is not None:
                syncing.result()
            bring()


def _check_size(job: Job, path: Place, chunk_cells: int, written: int) -> None:
    """Refuse a grid whose file cannot fit on the disk, or whose chunks cannot fit in memory."""
    plan = job.plan
    results = plan.template().data_vars
    nbytes = sum(result.values.size * job.dtype(name).itemsize for name, result in results.items())
    free = shutil.disk_usage(path.parent).free if isinstance(path, Path) else math.inf
    if isinstance(path, Path) and nbytes > free + written and not job.compression:
        raise InputError(
            f"{job.source}: a grid of {math.prod(plan.sizes.values()):.3g} cells makes {size_text(nbytes)}, but "
            f"{path.parent} has {size_text(free)} free: take coarser axes, fewer output.variables, "
            'output.dtype = "float32" or another disk'
        )
    memory = available_memory()
    needed = chunk_memory(plan, chunk_cells)
    if memory is not None and needed > memory:
        raise InputError(
            f"{job.source}: chunks of {_chunk_text(plan, chunk_cells)} need {size_text(needed)} of memory, "
            f"but {size_text(memory)} is free: close other programs or take fewer output.variables"
        )


def _chunk_text(plan: AnyPlan, chunk_cells: int) -> str:
    lengths = chunk_lengths(plan.sizes, chunk_cells, plan.together)
    return f"{math.prod(lengths.values())} cells ({grid_text(lengths)})"
