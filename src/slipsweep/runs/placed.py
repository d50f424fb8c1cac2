"""Results as bytes of a netCDF file: written to their places, past what the system keeps of files in memory.

The netCDF library makes a file with all but the results in it.  Those are stored contiguous and
uncompressed: each value has its place before any is known, and a chunk, which is one run of values of each
result, is written there as it is.  Nothing else of the file changes from then on, so that what is no result can be
checked byte by byte.

Left to itself the system would keep what is written in memory first, where every 4 KB that it has not
at hand cost from 0.2 to 2.5 µs: 1.9 GB took the netCDF library 2.6 s of processor so.  Written directly
they took 0.1 s of it, at the disk's own 2.4 GB/s (``python -m benchmarks.large_sweeps``).  Written in the ordinary
way, each chunk followed by `posix_fadvise` (DONTNEED), they took 0.8, 2.3 and 0.9 times as long as this, in three sets
of turns on disks that others used, and `run` as a whole 1.2 s of the system's processor time instead of 0.4; on tmpfs
it made no difference.
"""

import errno
import itertools
import math
import mmap
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xxhash
from numpy.typing import NDArray

from slipsweep.files.contents import Contents
from slipsweep.files.netcdf import new_file, write_head
from slipsweep.grid.chunks import places

#: What is written directly begins and ends at multiples of this, in the file and in memory: as much as any disk asks.
_SECTOR = 4096

#: Bytes that are written directly at a time, and the least for which that is done: each time waits for the disk, but
#: what is copied there first stays in the processor's cache (8 MiB at a time take 1.03 times as long).
_PIECE = 2 * 2**20
_LEAST = 2**20


@dataclass(frozen=True)
class Layout:
    """Where the results lie in a file.

    Attributes
    ----------
    offsets : dict of str to int
        First byte of each result.
    lengths : dict of str to int
        Its number of bytes.
    nbytes : int
        Size of the file.
    """

    offsets: dict[str, int]
    lengths: dict[str, int]
    nbytes: int


def make_file(path: Path, contents: Contents) -> Layout:
    """Make a file with all that has values, and room for what has none yet.

    Raises
    ------
    RunError
        It cannot be written.
    RuntimeError
        The netCDF library did not store a result as it was told to.
    """
    with new_file(path, path) as file:
        write_head(file, contents)
        for name in contents.later:
            # the first value that is written makes room for all
            file[name][(-1,) * file[name].ndim or ...] = 0
    offsets, lengths = {}, {}
    with h5py.File(path, locking=False) as file:  # the run holds a lock of its own; some network folders have none
        for name, kind in contents.later.items():
            stored = file[name]
            offset, length = stored.id.get_offset(), stored.id.get_storage_size()
            if offset is None or length != stored.size * kind.itemsize or not stored.dtype.isnative:
                raise RuntimeError(f"{name} is not stored as one run of its values")
            offsets[name], lengths[name] = offset, length
    return Layout(offsets, lengths, path.stat().st_size)


def file_checksum(path: Path, layout: Layout, results: Mapping[str, NDArray[Any]] | None = None) -> str:
    """XXH3 of a file, with `results` in place of its own; without them, of all its bytes that belong to no result.

    It is to find flipped bits and missing sectors, not forgeries.
    """
    digest = xxhash.xxh3_128()
    for name, between in _between(path, layout):
        digest.update(between)
        if name is not None and results is not None:
            digest.update(np.ascontiguousarray(results[name]).data)
    return digest.hexdigest()


def _between(path: Path, layout: Layout) -> Iterator[tuple[str | None, bytes]]:
    """The bytes before each result, with its name, and those after the last."""
    at = 0
    with path.open("rb") as file:
        for name, offset in sorted(layout.offsets.items(), key=lambda item: item[1]):
            file.seek(at)
            yield name, file.read(offset - at)
            at = offset + layout.lengths[name]
        file.seek(at)
        yield None, file.read(layout.nbytes - at)


def runs_of(chunk: Mapping[str, slice], sizes: Mapping[str, int]) -> tuple[list[int], int]:
    """Where a chunk's values lie in a result of these dimensions: the first of each run of values, and its length.

    Chunks that are whole along the last dimensions, as `chunks.grid_chunks` cuts them where no others are to be kept
    together, are one run.
    """
    parts = places(chunk, sizes)
    strides = dict(zip(sizes, [math.prod([*sizes.values()][at + 1 :]) for at in range(len(sizes))], strict=True))
    count, inner = 1, True
    starts: list[Iterable[int]] = []
    for dim in reversed(list(sizes)):
        part, stride = parts[dim], strides[dim]
        if inner:
            starts.append([part.start * stride])
            count *= part.stop - part.start
            # what lies before a dimension that is cut is no longer next to it
            inner = part.stop - part.start == sizes[dim]
        else:
            starts.append(range(part.start * stride, part.stop * stride, stride))
    return [sum(corner) for corner in itertools.product(*reversed(starts))], count


def open_directly(path: Path) -> int | None:
    """Open a file to write past the system's cache, or None where that cannot be."""
    if not hasattr(os, "O_DIRECT"):  # anywhere but on Linux
        return None
    try:
        return os.open(path, os.O_WRONLY | os.O_DIRECT)
    except OSError as error:
        if error.errno != errno.EINVAL:  # a file system without
            raise
        return None


class PlacedFile:
    """A file made by `make_file`, whose results are written and read as bytes."""

    def __init__(self, path: Path, layout: Layout) -> None:
        self.layout = layout
        self.file = path.open("r+b", buffering=0)
        self.direct = open_directly(path)
        self.piece = np.frombuffer(mmap.mmap(-1, _PIECE), np.uint8)  # begins where a page does

    def close(self) -> None:
        """Close it."""
        self.file.close()
        if self.direct is not None:
            os.close(self.direct)
            self.direct = None

    def has_name(self, path: Path) -> bool:
        """Whether `path` is still this file."""
        try:
            return os.path.samestat(os.fstat(self.file.fileno()), path.stat())
        except OSError:
            return False

    def restore_size(self) -> None:
        """Give the file its size again: zeros where its end was cut off."""
        self.file.truncate(self.layout.nbytes)

    def read(self, name: str, runs: tuple[list[int], int], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Values of a result, where they lie as `runs_of` says."""
        firsts, count = runs
        values = np.empty(len(firsts) * count, dtype)
        for number, first in enumerate(firsts):
            left = values[number * count : (number + 1) * count].data.cast("B")
            self.file.seek(self.layout.offsets[name] + first * dtype.itemsize)
            while left and (got := self.file.readinto(left)):
                left = left[got:]
        return values

    def write(self, name: str, runs: tuple[list[int], int], values: NDArray[Any]) -> None:
        """Write values of a result to where they lie."""
        firsts, count = runs
        rows = np.ascontiguousarray(values).reshape(len(firsts), count)
        for first, row in zip(firsts, rows, strict=True):
            self._write_run(name, first, row)

    def _write_run(self, name: str, first: int, values: NDArray[Any]) -> None:
        at = self.layout.offsets[name] + first * values.itemsize
        content = values.view(np.uint8)
        begin, end = -at % _SECTOR, content.size - (at + content.size) % _SECTOR
        if self.direct is None or end - begin < _LEAST:
            begin = end = 0
        self._write(at, content[:begin])
        done = begin
        while done < end and (count := self._write_directly(at + done, content[done : min(done + _PIECE, end)])):
            done += count
        self._write(at + done, content[done:])

    def _write(self, at: int, content: NDArray[np.uint8]) -> None:
        left = content.data
        self.file.seek(at)
        while left:
            left = left[self.file.write(left) :]

    def _write_directly(self, at: int, piece: NDArray[np.uint8]) -> int:
        """Write whole sectors; how many bytes were written."""
        assert self.direct is not None
        copied = self.piece[: piece.size]
        copied[:] = piece
        try:
            return os.pwrite(self.direct, copied.data, at)
        except OSError as error:
            if error.errno != errno.EINVAL:  # the system has it, but not for this file
                raise
            return 0
