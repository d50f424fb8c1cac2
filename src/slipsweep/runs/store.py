"""A sweep computed and written chunk by chunk.

Each value has its place in the file before any is known: once the empty file is on the disk a chunk is written
without a change to anything but its own bytes (`slipsweep.runs.placed`).  A run that is killed leaves a file that can
be read and gone on with (`slipsweep.runs.parts`), and no value is written twice.

Nothing is compressed.  (On a grid of 20 million cells that wrote 2.1 GB/s; zlib on the two flag variables
1.7 GB/s for 16 % of the bytes; zlib on everything 0.1 GB/s for 58 %.)
"""

import hashlib
import math
import shutil
import time
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xxhash
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files.names import open_netcdf
from slipsweep.files.netcdf import TooLarge, history_of, rounded
from slipsweep.files.outputs import appear, check_outputs, sync, writing
from slipsweep.files.results import open_result
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk, chunk_lengths, grid_chunks, places
from slipsweep.grid.resources import available_memory, grid_text, size_text
from slipsweep.grid.tables import Table, Variable
from slipsweep.grid.tally import Tally
from slipsweep.runs import parts
from slipsweep.runs.jobs import Job
from slipsweep.runs.placed import PlacedFile, file_checksum, make_file, runs_of
from slipsweep.runs.solving import Progress, Solved, chunk_memory, default_cells, solve_here

#: Seconds after which what is written is brought to the disk itself.
_SYNC_SECONDS = 1.0


@dataclass
class Report:
    """What `run` did."""

    path: Path
    chunk_cells: int
    seconds: float
    nbytes: int
    tally: Tally
    found: bool = False  # complete, by an earlier run: nothing was computed


def run(
    job: Job,
    path: Path,
    *,
    command: str,
    overwrite: bool = False,
    resume: bool = False,
    split: bool = False,
    chunk_cells: int | None = None,
    shared_cells: int | None = None,
    progress: Progress | None = None,
    solved: Solved = solve_here,
) -> Report:
    """Solve a plan and write its results as netCDF, complete or not at all.

    Finished chunks of a run that failed or was killed are kept beside the output
    (`slipsweep.runs.parts`).

    Parameters
    ----------
    job : Job
    path : Path
        The file to write, or the folder (`split`).
    command : str
        The command as typed, for the file's `history`.
    overwrite : bool
        Replace `path` and the chunks of an interrupted run, if they exist.
    resume : bool
        Go on with the chunks of an interrupted run, if there are any.  An output that is complete and of this very
        sweep is left as it is.
    split : bool
        Write a folder with a netCDF file for each chunk.
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
    identity = parts.identity(job.asked, split)
    with parts.opened(path) as work:
        if not overwrite:
            work.read()
        if work.finished and not (resume or overwrite):
            raise InputError(
                f"{path}: {work.path.name} holds {len(work.finished)} finished chunks of an interrupted run; "
                "go on with --resume, or start anew with --overwrite"
            )
        if resume and not work.finished and path.exists():
            return _found(job, path, _complete(job, path, identity, split))
        if resume and work.finished and work.manifest is not None:
            _check_same(work, identity, chunk_cells)
            manifest, data = work.manifest, work.data(split)
            if work.complete and path.exists() and (not data.exists() or data.samefile(path)):
                # killed between giving the output its name and clearing the folder away
                work.done = True
                return _found(job, path, manifest.chunk_cells)
        else:
            work.clear()
            cells = min(filter(None, (chunk_cells, shared_cells)), default=default_cells(plan))
            manifest = parts.Manifest(identity, cells, overwrite, history_of(command))
        # once more: a run that was writing it may have ended before this one got hold of the lock
        check_outputs([path], manifest.overwrite, reads=job.files, folder=split)
        return _carry_out(job, path, work, manifest, progress, solved)


def _carry_out(
    job: Job, path: Path, work: parts.Folder, manifest: parts.Manifest, progress: Progress | None, solved: Solved
) -> Report:
    """Solve and write what is missing, and give the output its name."""
    plan, split, chunk_cells = job.plan, bool(manifest.identity["--split"]), manifest.chunk_cells
    data = work.data(split)
    _check_size(job, path, chunk_cells, _nbytes(data))
    started = time.perf_counter()
    tally = Tally(plan.cells)
    cut = dict(enumerate(grid_chunks(plan.sizes, chunk_cells, plan.together)))
    try:
        with closing((_Files if split else _OneFile)(job, data, manifest)) as target:
            _ready(work, target, cut, tally, progress)
            missing = {number: chunk for number, chunk in cut.items() if number not in work.finished}
            _write_chunks(work, target, cut, _named(job, solved(plan, missing, progress)), tally)
            target.check(len(cut))
        with writing(path):
            work.close()
            appear(data, path, manifest.overwrite)
    except TooLarge as large:
        work.clear()  # no --resume could finish it
        raise InputError(f"{job.source}: {large}") from None
    except MemoryError:
        error = RunError(f"{path}: out of memory at a chunk of {_chunk_text(plan, chunk_cells)}")
        raise _noted(error, work, data, len(cut)) from None
    except BaseException as error:
        if isinstance(error, RunError):
            work.check()  # what came of that is not worth telling
        _noted(error, work, data, len(cut))
        raise
    work.done = True
    return Report(path, chunk_cells, time.perf_counter() - started, _nbytes(path), tally)


def _complete(job: Job, path: Path, identity: Mapping[str, Any], split: bool) -> int:
    """The size of the chunks of an output that is complete.

    Raises
    ------
    InputError
        It is not the result of this very sweep.
    """
    stored = None
    try:
        with open_result(path / _chunk_name(0) if split else path) as file:
            stored = parts.read_stamp(file.attrs, identity)
        difference = "it was not made by slipsweep run or limit" if stored is None else stored.difference(identity)
        if stored is not None and difference is None and split:
            chunks = len(list(grid_chunks(job.plan.sizes, stored.chunk_cells, job.plan.together)))
            there = len(list(path.iterdir()))
            difference = None if there == chunks else f"it has {there} files of {chunks}"
    except InputError as error:
        difference = str(error).removeprefix(f"{path}: ")
    if stored is None or difference is not None:
        raise InputError(
            f"{path}: exists already, and is not the complete result of this very sweep ({difference}); give "
            "--overwrite to replace it, or another name with -o"
        )
    return stored.chunk_cells or default_cells(job.plan)


def _found(job: Job, path: Path, chunk_cells: int) -> Report:
    """The report of an output that is complete already."""
    tally = Tally(job.plan.cells)
    for chunk, arrays in stored_chunks(job.plan, path, chunk_cells):
        _count(tally, job.plan, chunk, arrays)
    return Report(path, chunk_cells, 0.0, _nbytes(path), tally, found=True)


def check_output(job: Job, path: Path, *, overwrite: bool, split: bool) -> None:
    """Refuse an output that cannot be, before anything is computed for it."""
    check_outputs([path], overwrite, reads=job.files, folder=split, work=parts.Folder(path).path)


def stored_chunks(plan: AnyPlan, path: Path, chunk_cells: int) -> Iterator[tuple[Chunk, dict[str, NDArray[Any]]]]:
    """Read a result as it was written: chunks, and the arrays of their results."""
    sizes = {name: result.sizes for name, result in plan.empty().data_vars.items()}
    cut = grid_chunks(plan.sizes, chunk_cells, plan.together)
    if path.is_dir():
        for number, chunk in enumerate(cut):
            with _opened(path / _chunk_name(number)) as file:
                yield chunk, {name: np.asarray(file[name][...]) for name in sizes}
        return
    with _opened(path) as file:
        for chunk in cut:
            yield (
                chunk,
                {
                    name: np.asarray(file[name][tuple(places(chunk, own).values()) or ...])
                    for name, own in sizes.items()
                },
            )


def stored_table(plan: AnyPlan, path: Path, chunk_cells: int, names: Collection[str]) -> Table:
    """Read some results of a plan that were written as `run` told."""
    table = plan.empty()
    found = {
        name: replace(one, values=np.empty(one.values.shape, one.values.dtype))
        for name, one in table.data_vars.items()
        if name in names
    }
    for chunk, arrays in stored_chunks(plan, path, chunk_cells) if found else ():
        for name, one in found.items():
            one.values[tuple(places(chunk, one.sizes).values())] = arrays[name]
    return Table(table.coords, found, table.attrs)


def _opened(path: Path) -> Any:
    file = open_netcdf(path)
    file.set_auto_maskandscale(False)
    return file


def _named(job: Job, found: Iterator[tuple[int, Table]]) -> Iterator[tuple[int, Table]]:
    with job.named():
        yield from found


def _count(tally: Tally, plan: AnyPlan, chunk: Chunk, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Count a chunk, but for what other chunks along a dimension that a result lacks have as well."""
    whole = plan.empty().data_vars
    tally.merge(
        plan.tally(
            {
                name: values
                for name, values in arrays.items()
                if not any(part.start for dim, part in chunk.items() if dim not in whole[name].dims)
            }
        )
    )


def _check_same(work: parts.Folder, identity: Mapping[str, Any], chunk_cells: int | None) -> None:
    """Refuse to go on with chunks of another sweep, solver or version, or larger than allowed."""
    assert work.manifest is not None
    if difference := work.manifest.difference(identity):
        raise InputError(f"{work.output}: cannot go on with the chunks in {work.path.name}: {difference}")
    if chunk_cells is not None and chunk_cells < work.manifest.chunk_cells:
        raise InputError(
            f"--memory: too little for the chunks of {work.manifest.chunk_cells} cells that {work.path.name} "
            "was begun with; give more, or start anew with --overwrite"
        )


def _noted(error: BaseException, work: parts.Folder, data: Path, chunks: int) -> BaseException:
    """Tell with an error how much of the run is kept."""
    if work.finished and work.is_there() and data.exists():
        error.add_note(f"{len(work.finished)} of {chunks} chunks are kept; go on with --resume")
    return error


def _ready(
    work: parts.Folder,
    target: "_OneFile | _Files",
    cut: Mapping[int, Chunk],
    tally: Tally,
    progress: Progress | None,
) -> None:
    """Take over the finished chunks that are as they were written, or begin with none."""
    kept = {}
    if work.finished and target.open():
        for number in sorted(work.finished.keys() & cut.keys()):
            arrays = target.find(number, cut[number], work.finished[number])
            if arrays is not None:
                kept[number] = work.finished[number]
                _count(tally, target.job.plan, cut[number], arrays)
                if progress is not None:
                    progress(target.job.plan.part(cut[number]).cells)
    with writing(work.output):
        if kept:
            work.keep(kept)
        else:
            target.close()
            work.clear()
            target.create()
            work.begin(target.manifest)


def _write_chunks(
    work: parts.Folder,
    target: "_OneFile | _Files",
    cut: Mapping[int, Chunk],
    found: Iterator[tuple[int, Table]],
    tally: Tally,
) -> None:
    """Write chunks and put them on record, each while the next is being solved.

    Beside the writing cells are counted, and what is written is brought to the disk itself.
    """
    pending: Future[None] | None = None
    syncing: Future[None] | None = None
    synced = time.monotonic()

    def write(number: int, table: Table) -> None:
        nonlocal syncing, synced
        with writing(work.output):
            arrays = {
                name: rounded(name, result.values, target.job.dtype(name)) for name, result in table.data_vars.items()
            }
            counted = counter.submit(_count, tally, target.job.plan, cut[number], arrays)
            work.check()
            work.add(number, target.write(number, cut[number], table, arrays))
            if time.monotonic() - synced >= _SYNC_SECONDS:
                if syncing is not None:
                    syncing.result()
                syncing, synced = syncer.submit(bring), time.monotonic()
            counted.result()

    def bring() -> None:
        target.sync()
        work.sync()

    # leaving them waits, for the writer first: a chunk that is being written is finished
    with ThreadPoolExecutor(1) as syncer, ThreadPoolExecutor(1) as counter, ThreadPoolExecutor(1) as writer:
        for number, table in found:
            if pending is not None:
                pending.result()
            pending = writer.submit(write, number, table)
            del table
        if pending is not None:
            pending.result()
        with writing(work.output):
            if syncing is not None:
                syncing.result()
            bring()


class _OneFile:
    """All chunks in one netCDF file, each in its place."""

    def __init__(self, job: Job, data: Path, manifest: parts.Manifest) -> None:
        self.job, self.data, self.manifest = job, data, manifest
        self.table = job.plan.empty()
        self.file: PlacedFile | None = None

    def close(self) -> None:
        """Close the file, if it is open."""
        if self.file is not None:
            self.file.close()
            self.file = None

    def create(self) -> None:
        """Make the file, with all but the chunks in it."""
        head = replace(self.job.head, labels=self.job.labels, run=parts.stamp(self.manifest))
        layout = make_file(self.data, head, self.table, self.job.dtype, self.manifest.history)
        self.manifest.layout, self.manifest.head = layout, file_checksum(self.data, layout)
        sync(self.data)
        self.file = PlacedFile(self.data, layout)

    def open(self) -> bool:
        """Open the file of an earlier run; whether all but its chunks is as it was made."""
        layout = self.manifest.layout
        if layout is None:
            return False
        try:
            # what the system refuses (rights, a disk that does not answer) is no damage: chunks are not thrown away
            self.file = PlacedFile(self.data, layout)
        except FileNotFoundError:
            return False
        # what was cut off is zeros: the chunks that are whole can be read
        self.file.restore_size()
        return file_checksum(self.data, layout) == self.manifest.head

    def find(self, number: int, chunk: Chunk, digest: str) -> dict[str, NDArray[Any]] | None:
        """Return the values of a chunk, as they are stored, or None if they are not those on record."""
        assert self.file is not None
        arrays = {}
        for name, result in self.table.data_vars.items():
            shape = [part.stop - part.start for part in places(chunk, result.sizes).values()]
            try:
                values = self.file.read(name, runs_of(chunk, result.sizes), self.job.dtype(name))
            except OSError:  # a sector that cannot be read; that the file can was seen when it was opened
                return None
            arrays[name] = values.reshape(shape)
        return arrays if parts.checksum(arrays) == digest else None

    def write(self, number: int, chunk: Chunk, table: Table, arrays: Mapping[str, NDArray[Any]]) -> str:
        """Write a chunk, with its values as they are to be stored; return what is to go on record."""
        assert self.file is not None
        for name, result in self.table.data_vars.items():
            self.file.write(name, runs_of(chunk, result.sizes), arrays[name])
        return parts.checksum(arrays)

    def check(self, chunks: int) -> None:
        """Refuse to take another file for the one that was written (RunError)."""
        assert self.file is not None
        if not self.file.has_name(self.data):
            raise _removed(self.data)

    def sync(self) -> None:
        """Have all that is written on the disk itself."""
        sync(self.data)


class _Files:
    """A folder with a netCDF file for each chunk, complete by itself."""

    def __init__(self, job: Job, data: Path, manifest: parts.Manifest) -> None:
        self.job, self.data, self.manifest = job, data, manifest
        self.unsynced: deque[Path] = deque()

    def close(self) -> None:
        """Every file is closed when it is written."""

    def create(self) -> None:
        """Make the folder."""
        self.data.mkdir()

    def open(self) -> bool:
        """Whether there is a folder of an earlier run."""
        return self.data.is_dir()

    def find(self, number: int, chunk: Chunk, digest: str) -> dict[str, NDArray[Any]] | None:
        """Return the values of a chunk, as they are stored, or None if its file is not that on record."""
        try:
            with self._name(number).open("rb") as content:
                if hashlib.file_digest(content, xxhash.xxh3_128).hexdigest() != digest:
                    return None
        except PermissionError:
            raise  # no damage
        except OSError:
            return None
        with _opened(self._name(number)) as file:
            return {name: np.asarray(file[name][...]) for name in self.job.plan.names}

    def write(self, number: int, chunk: Chunk, table: Table, arrays: Mapping[str, NDArray[Any]]) -> str:
        """Write a chunk, with its values as they are to be stored; return what is to go on record."""
        coords = dict(table.coords)
        labels = self.job.labels
        if "case" in chunk:
            # files are put together by the coordinates of their dimensions, which rows of [[cases]] lack
            rows = np.arange(chunk["case"].start, chunk["case"].stop, dtype=np.int32) + 1
            coords["case"] = Variable(("case",), rows, {"long_name": "row of [[cases]]", "units": "1"})
            labels = labels[chunk["case"]]
        path = self._name(number)
        temporary = path.with_suffix(".tmp")
        head = replace(self.job.head, labels=labels, run=parts.stamp(self.manifest))
        layout = make_file(temporary, head, replace(table, coords=coords), self.job.dtype, self.manifest.history)
        file = PlacedFile(temporary, layout)
        try:
            for name, values in arrays.items():
                file.write(name, ([0], values.size), values)
        finally:
            file.close()
        temporary.replace(path)
        self.unsynced.append(path)
        return file_checksum(path, layout, arrays)

    def check(self, chunks: int) -> None:
        """Refuse to take the folder for whole where a file is missing (RunError)."""
        for number in range(chunks):
            if not self._name(number).exists():
                raise _removed(self._name(number))

    def sync(self) -> None:
        """Have all that is written on the disk itself."""
        while self.unsynced:
            sync(self.unsynced.popleft())
        sync(self.data)

    def _name(self, number: int) -> Path:
        return self.data / _chunk_name(number)


def _chunk_name(number: int) -> str:
    return f"chunk-{number:06}.nc"


def _removed(path: Path) -> RunError:
    return RunError(f"{path}: was removed during the run; start again")


def _nbytes(path: Path) -> int:
    """Bytes that a file, or the files of a folder, take on the disk."""
    if path.is_dir():
        return sum(entry.stat().st_size for entry in path.iterdir())
    return path.stat().st_size if path.exists() else 0


def _check_size(job: Job, path: Path, chunk_cells: int, written: int) -> None:
    """Refuse a grid whose file cannot fit on the disk, or whose chunks cannot fit in memory."""
    plan = job.plan
    results = plan.empty().data_vars
    nbytes = sum(result.values.size * job.dtype(name).itemsize for name, result in results.items())
    free = shutil.disk_usage(path.parent).free
    if nbytes > free + written:
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
