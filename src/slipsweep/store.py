"""Results on disk: a sweep computed and written block by block, netCDF files made and read.

A file appears under its name only when it is complete.  Results are stored contiguous and
uncompressed: then each value has its place in the file before any is known, and once the empty
file is on the disk a block is written without a change to anything but its own bytes.  A run that
is killed leaves a file that can be read and gone on with (`slipsweep.parts`), and no value is
written twice.

Fresh memory is what writing costs: the netCDF4 library alone takes from 1 to 5 s of processor for
1.9 GB, nearly all of it for the pages of the file.  So a run has few of them at a time, and solves
into the arrays of blocks that are written.  (On a grid of 20 million cells nothing compressed
wrote 2.1 GB/s; zlib on the two flag variables 1.7 GB/s for 16 % of the bytes; zlib on everything
0.1 GB/s for 58 %.)
"""

import itertools
import math
import os
import re
import shutil
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

import netCDF4
import numpy as np
from numpy.typing import NDArray

from slipsweep import parts
from slipsweep.blocks import (
    BLOCK_CELLS,
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
from slipsweep.parts import sync
from slipsweep.records import Record
from slipsweep.resources import available_memory, size_text
from slipsweep.spec import SweepSpec
from slipsweep.tables import Table, Variable
from slipsweep.variables import RECORD_COUNTS, RECORD_SAMPLES, SlidingMode, Validity

#: Results that are whole numbers, -1 where there is no value.
_WITH_MISSING = ("sliding_mode", *RECORD_COUNTS)

#: Dimension of the samples of a record.
RECORD_DIM = "record_sample"

#: Bytes that are written, or seconds that pass, before they are brought to the disk itself; the
#: journal follows after as many seconds.
_SYNC_BYTES = 64_000_000
_SYNC_SECONDS = 1.0

#: Name of a block's file in a folder that `run` made.
_BLOCK_FILE = re.compile(r"block-\d{6,}\.nc")


# ------------------------------------------------------------------- complete or not there


def check_output(path: Path, overwrite: bool, folder: bool = False) -> None:
    """Refuse an output (a file, or a `folder` of blocks) that cannot be written, or exists and may not be replaced.

    Raises
    ------
    InputError
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    if folder and path.exists() and not (path.is_dir() and all(map(_BLOCK_FILE.fullmatch, os.listdir(path)))):
        raise InputError(f"{path}: exists and is not a folder of blocks")
    if not folder and path.exists() and not path.is_file():
        raise InputError(f"{path}: exists and is not a file")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; give --overwrite to replace it, or another name with -o")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: the folder {path.parent} is not writable")


@contextmanager
def complete_or_absent(path: Path, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary name beside `path`; what is written there becomes `path` on success.

    On any error or interruption the temporary file is removed and `path` stays as it was.

    Raises
    ------
    RunError
        The file cannot be written, or another process made `path` in the meantime.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        with _writing(path):
            _appear(temporary, path, overwrite)
    finally:
        temporary.unlink(missing_ok=True)


def _appear(temporary: Path, path: Path, overwrite: bool) -> None:
    """Give a finished file, or folder of files, its name."""
    sync(temporary)
    if temporary.is_dir():
        if overwrite and path.is_dir():
            shutil.rmtree(path)
        elif path.exists():
            raise RunError(f"{path}: was made by another process during the run; it is left alone")
        temporary.replace(path)
    elif overwrite:
        temporary.replace(path)
    else:
        _rename_to_new(temporary, path)
    sync(path.parent)


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Rename, but never over a file that has appeared since `check_output`."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise RunError(f"{path}: was made by another process during the run; it is left alone") from None
    except OSError:  # a file system without hard links
        temporary.replace(path)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn what the system and the netCDF library raise into one message."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if isinstance(error, RunError):
            raise
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        # all that the netCDF library says of a full disk is "HDF error"
        free = size_text(shutil.disk_usage(path.parent).free)
        raise RunError(f"{path}: writing failed: {reason}; is the disk full? ({free} free)") from error


# ------------------------------------------------------------------------- running a sweep


@dataclass
class Tally:
    """Counts of cells, and among them of each sliding mode and each flag (None: not stored)."""

    cells: int = 0
    modes: dict[SlidingMode, int] | None = None
    flags: dict[Validity, int] | None = None

    def add(self, results: Mapping[str, NDArray[Any]]) -> None:
        """Count one block; `results` holds its arrays by variable name."""
        if "sliding_mode" in results:
            self.modes = self.modes or dict.fromkeys(SlidingMode, 0)
            for mode in SlidingMode:
                # int(): numpy would take a member of an enumeration for 64 bits, and all cells with it
                self.modes[mode] += int(np.count_nonzero(results["sliding_mode"] == int(mode)))
        if "validity" in results:
            self.flags = self.flags or dict.fromkeys(Validity, 0)
            seen = int(np.bitwise_or.reduce(results["validity"], axis=None))
            for flag in Validity(seen & 255):
                self.flags[flag] += int(np.count_nonzero(results["validity"] & int(flag)))

    def merge(self, other: "Tally") -> None:
        """Add the counts of other cells."""
        self.cells += other.cells
        if other.modes is not None:
            self.modes = {mode: (self.modes or {}).get(mode, 0) + count for mode, count in other.modes.items()}
        if other.flags is not None:
            self.flags = {flag: (self.flags or {}).get(flag, 0) + count for flag, count in other.flags.items()}


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
                return Report(path, spec.shape, 0.0, _nbytes(path), _stored_tally(path))
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
            with _writing(path):
                parts.sync(data)
                work.close()
                _appear(data, path, overwrite)
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
    with _writing(work.output):
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
        with _writing(work.output):
            arrays = {
                name: _rounded(name, result.values, target.spec.dtype(name)) for name, result in table.data_vars.items()
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
        with _writing(work.output):
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
        with _netcdf(self.data, self.data) as file:
            _head(file, self.spec, self.table, self.spec.labels, self.command)
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


def _rounded(name: str, values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """A result as the file holds it; what is too large for that is an error, and not infinite."""
    if values.dtype == dtype:
        return values
    with np.errstate(over="ignore"):
        rounded = values.astype(dtype)
    beyond = np.isinf(rounded)
    if beyond.any() and np.isfinite(worst := np.abs(values[beyond]).max()):
        raise InputError(
            f'output.dtype = "{dtype}": {name} reaches {worst:.4g}, more than the {np.finfo(dtype).max:.4g} that it '
            'holds; must be "float64"'
        )
    return rounded


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
        with _netcdf(temporary, path) as file:
            _head(file, self.spec, stored, labels, self.command)
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


def _head(file: netCDF4.Dataset, spec: SweepSpec, table: Table, labels: tuple[str, ...], command: str) -> None:
    """Write all of a sweep's file but its results."""
    _define(file, table, spec.dtype)
    _label_cases(file, labels)
    _describe(file, {**table.attrs, "title": spec.output.title, **_provenance(command), "sweep": spec.text})
    file.set_auto_maskandscale(False)
    for name, coordinate in table.coords.items():
        file[name][...] = coordinate.values
    if spec.record is not None:
        _embed(file, spec.record)


def _embed(file: netCDF4.Dataset, record: Record) -> None:
    """Write the samples of a record, from which the run can be repeated when its file is gone."""
    file.createDimension(RECORD_DIM, record.times.size)
    for name, values in zip(RECORD_SAMPLES, (record.times, record.acceleration), strict=True):
        variable = file.createVariable(name, "f8", (RECORD_DIM,))
        _describe(variable, RECORD_SAMPLES[name])
        variable[:] = values


def _nbytes(path: Path) -> int:
    """Bytes that a file, or the files of a folder, take on the disk."""
    if path.is_dir():
        return sum(entry.stat().st_size for entry in path.iterdir())
    return path.stat().st_size if path.exists() else 0


def write_table(
    table: Table, path: Path, *, title: str, command: str, overwrite: bool = False, record: Record | None = None
) -> None:
    """Write a table that is in memory (a time history) by the rules that sweeps are written by.

    The `record` that it is the response to is written with it.
    """
    check_output(path, overwrite)
    with (
        complete_or_absent(path, overwrite) as temporary,
        _netcdf(temporary, path) as file,
        _writing(path),
    ):
        _define(file, table, lambda name: table[name].values.dtype)
        _describe(file, {**table.attrs, "title": title, **_provenance(command)})
        file.set_auto_maskandscale(False)
        for name, array in {**table.coords, **table.data_vars}.items():
            file[name][...] = array.values
        if record is not None:
            _embed(file, record)


def write_statistics(spec: SweepSpec, table: Table, path: Path, *, command: str, overwrite: bool = False) -> None:
    """Write the statistics of a sweep with uncertain inputs: with its text, so that it can be repeated from them."""
    check_output(path, overwrite)
    with (
        complete_or_absent(path, overwrite) as temporary,
        _netcdf(temporary, path) as file,
        _writing(path),
    ):
        _head(file, spec, table, spec.labels, command)
        for name, array in table.data_vars.items():
            file[name][...] = _rounded(name, array.values, spec.dtype(name))


def without_time_axis(table: Table) -> Table:
    """Put a time history along `instant`, with `time` beside it as an auxiliary coordinate.

    A dimension `time` is a time axis of the CF conventions (4.4), whose values are dates.  Seconds
    since the shaking began are none, and given a made-up date they would be read back as dates.
    """
    dims = {"time": "instant"}
    coords, data_vars = (
        {
            name: Variable(tuple(dims.get(dim, dim) for dim in array.dims), array.values, array.attrs)
            for name, array in arrays.items()
        }
        for arrays in (table.coords, table.data_vars)
    )
    return Table(coords, data_vars, table.attrs)


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


# ------------------------------------------------------------------------------ netCDF files


@contextmanager
def _netcdf(temporary: Path, path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a new netCDF file, and close it whatever happens."""
    with _writing(path):
        file = netCDF4.Dataset(temporary, "w", format="NETCDF4")
    file.set_fill_off()  # every value is written: filling the file first would write it twice
    try:
        yield file
    except BaseException:
        with suppress(RuntimeError, OSError):  # the first error is the one to report
            file.close()
        raise
    with _writing(path):
        file.close()


def _define(file: netCDF4.Dataset, table: Table, dtype: Callable[[str], np.dtype[Any]]) -> None:
    """Define the dimensions and variables of `table`."""
    sizes = table.sizes
    # in the order of the results, which that of the coordinates need not be
    widest = max((result.dims for result in table.data_vars.values()), key=len, default=())
    shape = {dim: sizes[dim] for dim in (*widest, *sizes)}
    for dim, length in shape.items():
        file.createDimension(dim, length)
    for name, coordinate in table.coords.items():
        variable = file.createVariable(name, coordinate.values.dtype, coordinate.dims)
        _describe(variable, coordinate.attrs)
    for name, result in table.data_vars.items():
        dims, kind = result.dims, dtype(name)
        fill = np.nan if kind.kind == "f" else SlidingMode.MISSING if name in _WITH_MISSING else None
        variable = file.createVariable(name, kind, dims, fill_value=fill, contiguous=True)
        attributes = dict(result.attrs)
        if attributes.get("ancillary_variables") not in table:
            attributes.pop("ancillary_variables", None)
        auxiliary = [c for c in table.coords if c not in shape and {*table[c].dims} <= {*dims}]
        if auxiliary:
            attributes["coordinates"] = " ".join(auxiliary)
        _describe(variable, attributes)


def _label_cases(file: netCDF4.Dataset, labels: tuple[str, ...]) -> None:
    """Write the names of the rows of [[cases]]: as characters, since few programs read netCDF strings."""
    if not labels:
        return
    text = np.array([label.encode() for label in labels])
    file.createDimension("label_length", text.dtype.itemsize)
    variable = file.createVariable("label", "S1", ("case", "label_length"))
    variable.set_auto_chartostring(False)
    _describe(variable, {"long_name": "name of the case", "_Encoding": "utf-8"})
    variable[:] = text.view("S1").reshape(len(labels), -1)
    for other in file.variables.values():
        if "case" in other.dimensions and "coordinates" in other.ncattrs():
            _describe(other, {"coordinates": f"{other.getncattr('coordinates')} label"})


def _describe(target: netCDF4.Dataset | netCDF4.Variable, attributes: Mapping[str, Any]) -> None:
    """Set attributes: text as characters in UTF-8, flag values in the type of their variable."""
    for name, value in attributes.items():
        if isinstance(value, str):
            # as bytes: the library would write text beyond ASCII as a netCDF string
            target.setncattr(name, value.encode())
        elif name in ("flag_values", "flag_masks"):
            target.setncattr(name, np.asarray(value, target.dtype))
        elif isinstance(value, int):
            target.setncattr(name, np.int32(value))  # not every program reads 64-bit attributes
        else:
            target.setncattr(name, value)


def _provenance(command: str) -> dict[str, str]:
    return {
        "Conventions": "CF-1.11",
        "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} {command}",
    }


# --------------------------------------------------------------------------- reading a file


@dataclass
class Contents:
    """What a file of slipsweep holds and how it was made; coordinates and variables in words."""

    path: Path
    nbytes: int
    attributes: dict[str, str]
    coordinates: dict[str, str]
    variables: dict[str, str]
    tally: Tally


@contextmanager
def open_result(path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a file of slipsweep to read from.

    Raises
    ------
    InputError
        It cannot be read, is not netCDF, or was not written by slipsweep.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file")
    try:
        file = netCDF4.Dataset(path)
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path}: not a netCDF file, or a damaged one ({error})") from None
    with file:
        if not str(getattr(file, "source", "")).startswith("slipsweep "):
            raise InputError(f"{path}: not written by slipsweep")
        yield file


def coordinate_names(file: netCDF4.Dataset) -> set[str]:
    """Names of a file's coordinate variables, auxiliary and scalar ones among them."""
    named = (
        variable.coordinates.split() for variable in file.variables.values() if "coordinates" in variable.ncattrs()
    )
    return {*file.dimensions, *itertools.chain.from_iterable(named)}


def read_contents(path: Path) -> Contents:
    """Describe a file of slipsweep; memory stays small whatever its size.

    Raises
    ------
    InputError
        It cannot be read, is not netCDF, or was not written by slipsweep.
    """
    with open_result(path) as file:
        try:
            coordinates = coordinate_names(file)
            return Contents(
                path,
                path.stat().st_size,
                {name: str(file.getncattr(name)) for name in file.ncattrs()},
                {name: _values_text(file[name]) for name in file.variables if name in coordinates},
                {name: _variable_text(file[name]) for name in file.variables if name not in coordinates},
                _count(file),
            )
        except (OSError, RuntimeError) as error:
            raise InputError(f"{path}: not a netCDF file, or a damaged one ({error})") from None


def _count(file: netCDF4.Dataset) -> Tally:
    tally = Tally()
    for name in ("sliding_mode", "validity"):
        if name in file.variables:
            variable = file[name]
            variable.set_auto_mask(False)
            tally.cells = variable.size
            for block in grid_blocks(dict(zip(variable.dimensions, variable.shape, strict=True)), BLOCK_CELLS):
                tally.add({name: variable[tuple(block.values())]})
    return tally


def _stored_tally(path: Path) -> Tally:
    """Count what is in a file, or in the files of a folder."""
    tally = Tally()
    for name in sorted(path.iterdir()) if path.is_dir() else [path]:
        with netCDF4.Dataset(name) as file:
            tally.merge(_count(file))
    return tally


def _values_text(variable: netCDF4.Variable) -> str:
    values = variable[...]
    if variable.dtype == "S1":
        return ", ".join(values)
    units = "" if variable.units == "1" else f" {variable.units}"
    if values.size == 1:
        return f"{values.item():.6g}{units}"
    return f"{values.size} values, {values.min():.6g} to {values.max():.6g}{units}"


def _variable_text(variable: netCDF4.Variable) -> str:
    units = f", {variable.units}" if "units" in variable.ncattrs() and variable.units != "1" else ""
    return f"{variable.long_name}{units} ({variable.dtype})"
