"""A sweep computed and written block by block.

Results are stored contiguous and uncompressed: then each value has its place in the file before any
is known, and once the empty file is on the disk a block is written without a change to anything but
its own bytes.  A run that is killed leaves a file that can be read and gone on with
(`slipsweep.parts`), and no value is written twice.

Fresh memory is what writing costs: the netCDF4 library alone takes from 1 to 5 s of processor for
1.9 GB, nearly all of it for the pages of the file.  So a run has few of them at a time, and solves
into the arrays of blocks that are written.  (On a grid of 20 million cells nothing compressed
wrote 2.1 GB/s; zlib on the two flag variables 1.7 GB/s for 16 % of the bytes; zlib on everything
0.1 GB/s for 58 %.)
"""

import math
import os
import shutil
import time
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import netCDF4
import numpy as np
from numpy.typing import NDArray

from slipsweep import parts
from slipsweep.blocks import (
    Block,
    Progress,
    Solved,
    block_lengths,
    block_memory,
    default_cells,
    grid_blocks,
    plan_of,
    solve_here,
)
from slipsweep.errors import InputError, RunError
from slipsweep.netcdf import Tally, new_file, rounded, stored_tally, write_head
from slipsweep.outputs import appear, check_output, writing
from slipsweep.resources import available_memory, size_text
from slipsweep.spec import SweepSpec
from slipsweep.tables import Table, Variable

#: Bytes that are written, or seconds that pass, before they are brought to the disk itself; the
#: journal follows after as many seconds.
_SYNC_BYTES = 64_000_000
_SYNC_SECONDS = 1.0


@dataclass
class Report:
    """What `run` did."""

    path: Path
    shape: dict[str, int]
    seconds: float
    nbytes: int
    tally: Tally


def run(
    spec: SweepSpec,
    path: Path,
    *,
    command: str,
    overwrite: bool = False,
    resume: bool = False,
    split: bool = False,
    block_cells: int | None = None,
    shared_cells: int | None = None,
    progress: Progress | None = None,
    solved: Solved = solve_here,
) -> Report:
    """Compute a sweep and write it as netCDF, complete or not at all.

    Finished blocks of a run that failed or was killed are kept beside the output
    (`slipsweep.parts`).

    Parameters
    ----------
    spec : SweepSpec
    path : Path
        The file to write, or the folder (`split`).
    command : str
        The command as typed, for the file's `history`.
    overwrite : bool
        Replace `path` and the blocks of an interrupted run, if they exist.
    resume : bool
        Go on with the blocks of an interrupted run, if there are any.
    split : bool
        Write a folder with a netCDF file for each block.
    block_cells : int, optional
        Most cells to solve and write at a time; two such blocks are in memory.  By default
        `blocks.default_cells`, or what an interrupted run had.
    shared_cells : int, optional
        As many cells or fewer, so that those who solve blocks share them evenly; but what an
        interrupted run had goes before.
    progress : callable
        Called with a number of cells just solved, from any thread.
    solved : callable
        What solves the blocks, in any order (`blocks.Solved`).

    Returns
    -------
    Report

    Raises
    ------
    InputError
        The output exists or cannot be written, the grid is too large for disk or memory, there
        are blocks of an interrupted run but neither `resume` nor `overwrite` is given, or they
        are of another sweep or version.
    RunError
        Writing failed, memory ran out, or another run is writing `path`.  A note tells how many
        blocks are kept.
    """
    check_output(path, overwrite or resume, folder=split)
    identity = parts.identity(spec, split)
    with parts.opened(path) as work:
        if not overwrite:
            work.read()
        if work.finished and not (resume or overwrite):
            raise InputError(
                f"{path}: {work.path.name} holds {len(work.finished)} finished blocks of an interrupted run; "
                "go on with --resume, or start anew with --overwrite"
            )
        if resume and work.finished and work.manifest is not None:
            _check_same(work, identity, block_cells)
            block_cells, overwrite = work.manifest.block_cells, work.manifest.overwrite
            data = work.data(split)
            if work.complete and path.exists() and (not data.exists() or data.samefile(path)):
                # killed between giving the output its name and clearing the folder away
                work.done = True
                return Report(path, spec.shape, 0.0, _nbytes(path), stored_tally(path))
        else:
            work.clear()
            block_cells = min(filter(None, (block_cells, shared_cells)), default=default_cells(spec))
        # once more: a run that was writing it may have ended before this one got hold of the lock
        check_output(path, overwrite, folder=split)
        data = work.data(split)
        _check_size(spec, path, block_cells, _nbytes(data))

        started = time.perf_counter()
        tally = Tally(spec.cells)
        cut = dict(enumerate(grid_blocks(spec.shape, block_cells)))
        try:
            with (_Files if split else _OneFile)(spec, data, command) as target:
                manifest = work.manifest or parts.Manifest(identity, block_cells, overwrite)
                _ready(work, target, cut, manifest, tally, progress)
                missing = {number: block for number, block in cut.items() if number not in work.finished}
                _write_blocks(work, target, cut, solved(spec, missing, progress), tally)
            with writing(path):
                parts.sync(data)
                work.close()
                appear(data, path, overwrite)
        except MemoryError:
            error = RunError(f"{path}: out of memory at a block of {_block_text(spec, block_cells)}")
            raise _noted(error, work, len(cut)) from None
        except BaseException as error:
            _noted(error, work, len(cut))
            raise
        work.done = True
    return Report(path, spec.shape, time.perf_counter() - started, _nbytes(path), tally)


def _check_same(work: parts.Folder, identity: Mapping[str, Any], block_cells: int | None) -> None:
    """Refuse to go on with blocks of another sweep, solver or version, or larger than allowed."""
    assert work.manifest is not None
    if difference := work.manifest.difference(identity):
        raise InputError(f"{work.output}: cannot go on with the blocks in {work.path.name}: {difference}")
    if block_cells is not None and block_cells < work.manifest.block_cells:
        raise InputError(
            f"--memory: too little for the blocks of {work.manifest.block_cells} cells that {work.path.name} "
            "was begun with; give more, or start anew with --overwrite"
        )


def _noted(error: BaseException, work: parts.Folder, blocks: int) -> BaseException:
    """Tell with an error how much of the run is kept."""
    if work.finished:
        error.add_note(f"{len(work.finished)} of {blocks} blocks are kept; go on with --resume")
    return error


def _ready(
    work: parts.Folder,
    target: "_OneFile | _Files",
    cut: Mapping[int, Block],
    manifest: parts.Manifest,
    tally: Tally,
    progress: Progress | None,
) -> None:
    """Take over the finished blocks that are as they were written, or begin with none."""
    kept = {}
    if work.finished and target.open(manifest.nbytes):
        for number in sorted(work.finished.keys() & cut.keys()):
            arrays = target.read(number, cut[number])
            if arrays is not None and parts.checksum(arrays) == work.finished[number]:
                kept[number] = work.finished[number]
                tally.add(arrays)
                if progress is not None:
                    progress(math.prod(part.stop - part.start for part in cut[number].values()))
    with writing(work.output):
        if kept:
            work.keep(kept)
        else:
            target.close()
            work.clear()
            manifest.nbytes = target.create()
            work.begin(manifest)


def _write_blocks(
    work: parts.Folder,
    target: "_OneFile | _Files",
    cut: Mapping[int, Block],
    found: Iterator[tuple[int, Table]],
    tally: Tally,
) -> None:
    """Write blocks and put them on record, each while the next is being solved.

    Checksums and counts are made beside the writing.  So is what is written brought to the disk
    itself, but the writer waits for that before it has more brought there: no more of the file than
    some blocks is in memory at a time.  The system finds their pages again and again: it took 0.7 s
    of processor to write 1.9 GB so, and from 1 to 5 s where all of the file stayed in memory.
    """
    pending: Future[None] | None = None
    syncing: Future[None] | None = None
    unsynced, synced = 0, time.monotonic()

    def write(number: int, table: Table) -> None:
        nonlocal syncing, unsynced, synced
        with writing(work.output):
            arrays = {
                name: rounded(name, result.values, target.spec.dtype(name)) for name, result in table.data_vars.items()
            }
            digest = examiner.submit(examine, arrays)
            target.write(number, cut[number], table, arrays)
            work.add(number, digest.result())
            unsynced += sum(values.nbytes for values in arrays.values())
            due = time.monotonic() - synced >= _SYNC_SECONDS
            if due or unsynced >= _SYNC_BYTES:
                if syncing is not None:
                    syncing.result()
                syncing = syncer.submit(bring, unsynced >= _SYNC_BYTES, due)
                unsynced, synced = 0, time.monotonic() if due else synced

    def examine(arrays: dict[str, NDArray[Any]]) -> str:
        tally.add(arrays)
        return parts.checksum(arrays)

    def bring(drop: bool, journal: bool) -> None:
        target.sync(drop)
        if journal:
            work.sync()

    # leaving them waits, for the writer first: a block that is being written is finished
    with ThreadPoolExecutor(1) as syncer, ThreadPoolExecutor(1) as examiner, ThreadPoolExecutor(1) as writer:
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
            bring(drop=False, journal=True)


class _OneFile:
    """All blocks in one netCDF file, each in its place."""

    def __init__(self, spec: SweepSpec, data: Path, command: str) -> None:
        self.spec, self.data, self.command = spec, data, command
        self.table = plan_of(spec.arguments()).empty()
        self.file: netCDF4.Dataset | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, if it is open.

        Left to itself it would be closed when garbage is looked for, by any thread: the netCDF
        library crashes where another is writing meanwhile.
        """
        if self.file is not None:
            with suppress(RuntimeError, OSError):  # every block has been flushed
                self.file.close()
            self.file = None

    def create(self) -> int:
        """Make the file, with all but the blocks in it; return its size."""
        with new_file(self.data, self.data) as file:
            write_head(file, self.spec, self.table, self.spec.labels, self.command)
            for name in self.table.data_vars:
                # the first value that is written makes room for all
                file[name][(-1,) * file[name].ndim or ...] = 0
        parts.sync(self.data)
        self.file = netCDF4.Dataset(self.data, "r+")
        self.file.set_auto_maskandscale(False)
        return self.data.stat().st_size

    def open(self, nbytes: int) -> bool:
        """Open the file of an earlier run; whether all but its blocks is as it should be."""
        try:
            # what the system refuses (rights, a disk that does not answer) is no damage: blocks are not thrown away
            with self.data.open("r+b") as file:
                if file.seek(0, os.SEEK_END) < nbytes:
                    file.truncate(nbytes)  # what was cut off is zeros: the blocks that are whole can be read
        except FileNotFoundError:
            return False
        try:
            self.file = netCDF4.Dataset(self.data, "r+")
            self.file.set_auto_maskandscale(False)
            return all(
                np.array_equal(self.file[name][...], coordinate.values)
                for name, coordinate in self.table.coords.items()
            ) and all(self.file[name].shape == result.values.shape for name, result in self.table.data_vars.items())
        except (OSError, RuntimeError, IndexError):
            return False

    def read(self, number: int, block: Block) -> dict[str, NDArray[Any]] | None:
        """Return a block's values as they are stored, or None."""
        assert self.file is not None
        try:
            return {
                name: np.asarray(self.file[name][_where(block, result.dims)])
                for name, result in self.table.data_vars.items()
            }
        except (OSError, RuntimeError):
            return None

    def write(self, number: int, block: Block, table: Table, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write a block, with its values as they are to be stored."""
        assert self.file is not None
        for name, result in table.data_vars.items():
            self.file[name][_where(block, result.dims)] = arrays[name]
        self.file.sync()

    def sync(self, drop: bool = False) -> None:
        """Have all that is written on the disk itself, and with `drop` no longer in memory."""
        parts.sync(self.data, drop)


class _Files:
    """A folder with a netCDF file for each block, complete by itself."""

    def __init__(self, spec: SweepSpec, data: Path, command: str) -> None:
        self.spec, self.data, self.command = spec, data, command
        self.unsynced: deque[Path] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def close(self) -> None:
        """Every file is closed when it is written."""

    def create(self) -> int:
        """Make the folder."""
        self.data.mkdir()
        return 0

    def open(self, nbytes: int) -> bool:
        """Whether there is a folder of an earlier run."""
        return self.data.is_dir()

    def read(self, number: int, block: Block) -> dict[str, NDArray[Any]] | None:
        """Return a block's values as they are stored, or None."""
        try:
            with netCDF4.Dataset(self._name(number)) as file:
                file.set_auto_maskandscale(False)
                return {name: np.asarray(file[name][...]) for name in self.spec.output.variables}
        except (OSError, RuntimeError, IndexError):
            return None

    def write(self, number: int, block: Block, table: Table, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write a block, with its values as they are to be stored."""
        results = {name: replace(result, values=arrays[name]) for name, result in table.data_vars.items()}
        coords = dict(table.coords)
        labels = self.spec.labels
        if "case" in block:
            # files are put together by the coordinates of their dimensions, which rows of [[cases]] lack
            rows = np.arange(block["case"].start, block["case"].stop, dtype=np.int32) + 1
            coords["case"] = Variable(("case",), rows, {"long_name": "row of [[cases]]", "units": "1"})
            labels = labels[block["case"]]
        stored = replace(table, coords=coords, data_vars=results)
        path = self._name(number)
        temporary = path.with_suffix(".tmp")
        with new_file(temporary, path) as file:
            write_head(file, self.spec, stored, labels, self.command)
            for name, result in results.items():
                file[name][...] = result.values
        temporary.replace(path)
        self.unsynced.append(path)

    def sync(self, drop: bool = False) -> None:
        """Have all that is written on the disk itself, and with `drop` no longer in memory."""
        while self.unsynced:
            parts.sync(self.unsynced.popleft(), drop)
        parts.sync(self.data)

    def _name(self, number: int) -> Path:
        return self.data / f"block-{number:06}.nc"


def _where(block: Mapping[str, slice], dims: tuple[str, ...]) -> Any:
    return tuple(block[dim] for dim in dims) or ...


def _nbytes(path: Path) -> int:
    """Bytes that a file, or the files of a folder, take on the disk."""
    if path.is_dir():
        return sum(entry.stat().st_size for entry in path.iterdir())
    return path.stat().st_size if path.exists() else 0


def _check_size(spec: SweepSpec, path: Path, block_cells: int, written: int) -> None:
    """Refuse a grid whose file cannot fit on the disk, or whose blocks cannot fit in memory."""
    free = shutil.disk_usage(path.parent).free
    if spec.nbytes > free + written:
        raise InputError(
            f"{spec.source}: a grid of {spec.cells:.3g} cells makes {size_text(spec.nbytes)}, but {path.parent} has "
            f"{size_text(free)} free: take coarser axes, fewer output.variables, "
            'output.dtype = "float32" or another disk'
        )
    memory = available_memory()
    needed = block_memory(spec, block_cells)
    if memory is not None and needed > memory:
        raise InputError(
            f"{spec.source}: blocks of {_block_text(spec, block_cells)} need {size_text(needed)} of memory, "
            f"but {size_text(memory)} is free: close other programs or take fewer output.variables"
        )


def _block_text(spec: SweepSpec, block_cells: int) -> str:
    lengths = block_lengths(spec.shape, block_cells)
    return f"{math.prod(lengths.values())} cells ({' x '.join(f'{n} {dim}' for dim, n in lengths.items())})"
