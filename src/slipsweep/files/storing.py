"""Where a chunk is written, and how a run goes on after an interruption.

The chunks of a run, elements of the dask array that `grid.chunks.solved_chunks` makes of its plan, are written while
others are computed, each once: to its place in ``OUT.nc.part/result.nc`` or ``OUT.zarr.part/store``.  When it is
there (in a netCDF file: on the disk itself), an empty file ``000012.chunk`` beside them says so; `identity.json` says
what they are chunks of.

The netCDF file is made with all but the values of its results.  Chunks change nothing else in it, so that it can be
read whenever a run ends, and what is marked is there.  A compressed file is made of it at the end.
A store at an address (``s3://…``) is written where it is, and has the attribute `unfinished` meanwhile.
"""

import json
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from fsspec.core import url_to_fs
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files import netcdf
from slipsweep.files.jobs import Job
from slipsweep.files.opening import check_zarr
from slipsweep.files.outputs import EXISTS, appear, writing
from slipsweep.grid.chunks import Chunk, chunk_at, places, solved_chunks
from slipsweep.grid.resources import size_text

#: A file or folder, or the address of a store.
Place = Path | str

#: The results of a chunk, by name.
Arrays = Mapping[str, NDArray[Any]]

#: Most cells of a chunk of a Zarr store within one of the run's, which is a shard of the store.
_ZARR_CELLS = 500_000


def nbytes_of(path: Place) -> int:
    """Bytes that a result takes."""
    files, root = url_to_fs(os.fspath(path))
    return int(files.du(root))


@dataclass
class Chunks:
    """The chunks of a run, numbered in the order of the file, and where they are written."""

    job: Job
    path: Place
    lengths: dict[str, int]  # of a chunk, along each dimension of the grid
    done: set[int] = field(default_factory=set)  # what an interrupted run has left
    marks: list[Future[None]] = field(default_factory=list)  # of chunks that are on their way to the disk

    @property
    def place(self) -> str:
        """The folder, or its address, that an interrupted run leaves."""
        return f"{os.fspath(self.path).rstrip('/')}.part"

    @property
    def cut(self) -> dict[str, tuple[int, ...]]:
        """Lengths of all chunks along each dimension."""
        edges = {dim: [*range(0, size, self.lengths[dim]), size] for dim, size in self.job.plan.sizes.items()}
        return {dim: tuple(np.diff(own).tolist()) for dim, own in edges.items()}

    @property
    def shape(self) -> tuple[int, ...]:
        """How many chunks there are along each dimension."""
        return tuple(len(own) for own in self.cut.values())

    @property
    def solved(self) -> Any:
        """The dask array of the results of all chunks."""
        return solved_chunks(self.job.plan, self.cut)

    def missing(self) -> Iterator[tuple[int, tuple[int, ...]]]:
        """Number and index of every chunk to compute; one after the other: there may be more than memory holds."""
        return ((number, index) for number, index in enumerate(np.ndindex(*self.shape)) if number not in self.done)

    def chunk(self, number: int) -> Chunk:
        """Where a chunk lies in the grid."""
        return chunk_at(self.cut, tuple(map(int, np.unravel_index(number, self.shape))))

    @contextmanager
    def begun(self, command: str, resume: bool, overwrite: bool) -> Iterator[None]:
        """Take over the chunks of an interrupted run, or begin anew, while no other run writes this output.

        InputError: neither may be done.  RunError: another run is writing it, or writing failed.  A note to any error
        says how many chunks are kept.
        """
        with self._locked():
            self._begin(command, resume, overwrite)
            try:
                with writing(self.path):
                    yield
            except BaseException as error:
                if kept := len(self._finished()):
                    note = f"{kept} of {math.prod(self.shape)} chunks are kept in {self.place}: --resume goes on"
                else:
                    note = "nothing written"
                    self._clear()
                error.add_note(note)
                raise

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep other runs away from this output; an address has no lock."""
        from filelock import FileLock, Timeout

        if isinstance(self.path, str):
            yield
            return
        folder = Path(self.place)
        with writing(self.path):
            folder.mkdir(exist_ok=True)
            lock = FileLock(folder / "lock", timeout=0)
            try:
                lock.acquire()
            except Timeout:
                raise RunError(f"{self.path}: another run is writing it") from None
        try:
            yield
        finally:
            lock.release()
            if folder.is_dir() and not (folder / "identity.json").exists():
                shutil.rmtree(folder, ignore_errors=True)

    def _begin(self, command: str, resume: bool, overwrite: bool) -> None:
        files, folder = url_to_fs(self.place)
        state = None
        with suppress(OSError, ValueError):
            state = json.loads(files.cat_file(f"{folder}/identity.json"))
        if state is None or overwrite:
            self._clear()
            self._check_space()
            if isinstance(self.path, str) and not overwrite and files.exists(f"{self.path.rstrip('/')}/zarr.json"):
                raise InputError(EXISTS.format(path=self.path))
            with writing(self.path):
                files.makedirs(folder, exist_ok=True)
                self.make(command)
                state = {"identity": self.job.identity, "lengths": self.lengths}
                files.pipe_file(f"{folder}/identity.json", json.dumps(state).encode())
            return
        others = [name for name, value in self.job.identity.items() if state["identity"].get(name) != value]
        fault = ""
        if not resume:
            fault = "has chunks of an interrupted run; give --resume to go on with them"
        elif others:
            fault = f"has chunks of another {others[0]}; go on with that one"
        elif math.prod(state["lengths"].values()) > math.prod(self.lengths.values()):
            fault = "has larger chunks than fit into the memory asked for; give more --memory"
        if fault:
            raise InputError(f"{self.place}: {fault}, or --overwrite to start again")
        self.lengths = state["lengths"]
        self.done = self._finished()

    def _finished(self) -> set[int]:
        """Numbers of the chunks that are there."""
        wait(self.marks)
        files, folder = url_to_fs(self.place)
        return {int(Path(one).stem) for one in files.glob(f"{folder}/*.chunk")}

    def _clear(self) -> None:
        """Remove what an earlier run has left; the lock stays."""
        files, folder = url_to_fs(self.place)
        for one in files.ls(folder, detail=False) if files.exists(folder) else ():
            if not one.endswith("/lock"):
                files.rm(one, recursive=True)

    def _check_space(self) -> None:
        """Refuse what the disk has no room for."""
        if isinstance(self.path, Path):
            needed, free = self.job.outline("").nbytes, shutil.disk_usage(self.path.parent).free
            # a store is compressed, nobody knows how much
            if needed * (0.05 if self.path.suffix == ".zarr" else 1.0) > free:
                raise InputError(f"{self.path}: takes {size_text(needed)}, but {size_text(free)} are free on the disk")

    def make(self, command: str) -> None:
        """Make the file or store that chunks are written to."""

    @property
    def written(self) -> Any:
        """As `solved`, or with a dask array that writes chunks where they are computed."""
        return self.solved

    def write(self, number: int, arrays: Arrays) -> None:
        """Write a chunk, then its mark."""

    def finish(self, overwrite: bool) -> None:
        """Give the output its name."""


@dataclass
class NetcdfChunks(Chunks):
    """Chunks as parts of a netCDF file."""

    marker: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1))

    @property
    def result(self) -> Path:
        """The file that chunks are written to."""
        return Path(self.place, "result.nc")

    def make(self, command: str) -> None:
        with netcdf.new_file(self.job.outline(command), self.result) as file:
            for name in self.job.dtypes:  # with its first value an array gets its place in the file
                file[name][(0,) * file[name].ndim or ...] = 0

    def write(self, number: int, arrays: Arrays) -> None:
        with netcdf.opened(self.result, "r+") as file:
            for name in self.job.dtypes:
                file[name][self._region(number, file[name])] = arrays[name]
        wait(self.marks[-1:])  # the disk may be slower than all else
        self.marks.append(self.marker.submit(self._mark, number))

    def _mark(self, number: int) -> None:
        """Mark a chunk when a power cut can no longer take it, while another is written."""
        with self.result.open("rb") as file:
            os.fsync(file.fileno())
        Path(self.place, f"{number:06}.chunk").touch()

    def _region(self, number: int, result: netCDF4.Variable) -> Any:
        sizes = dict(zip(result.dimensions, result.shape, strict=True))
        return tuple(places(self.chunk(number), sizes).values()) or ...

    def finish(self, overwrite: bool) -> None:
        for mark in self.marks:
            mark.result()
        complete = self.result
        if level := self.job.spec.output.compression:
            complete = Path(self.place, "compressed.nc")
            with netcdf.opened(self.result) as source:
                outline = self.job.outline("").assign_attrs(history=source.history)
                with netcdf.new_file(outline, complete, self.lengths, level) as file:
                    for number in range(math.prod(self.shape)):
                        for name in self.job.dtypes:
                            region = self._region(number, file[name])
                            file[name][region] = source[name][region]
        appear(complete, Path(self.path), overwrite)
        shutil.rmtree(self.place)


class ZarrChunks(Chunks):
    """Chunks as regions of a Zarr store, each one shard of its arrays."""

    @property
    def store(self) -> str:
        """The store that chunks are written to."""
        return self.path if isinstance(self.path, str) else f"{self.place}/store"

    def make(self, command: str) -> None:
        check_zarr(self.path)
        table = self.job.outline(command).assign_attrs(unfinished="its run goes on with --resume")
        encoding = {name: self._encoding(table[name]) for name in self.job.dtypes}
        table.to_zarr(self.store, mode="w", compute=False, encoding=encoding, zarr_format=3, consolidated=False)

    def _encoding(self, one: xr.DataArray) -> dict[str, Any]:
        """A shard for each chunk of the run, and within it chunks that are read by themselves."""
        from zarr.codecs import ZstdCodec

        shard = [self.lengths.get(str(dim), size) for dim, size in one.sizes.items()]
        inner = list(shard)
        for axis in range(len(inner)):
            if math.prod(inner) > _ZARR_CELLS:
                inner[axis] = 1
        found: dict[str, Any] = {"_FillValue": netcdf.fill_value(str(one.name), one.dtype)}
        if shard:
            found |= {"chunks": inner, "shards": shard}
        if level := self.job.spec.output.compression:
            found["compressors"] = [ZstdCodec(level=level)]
        return found

    @property
    def _about(self) -> dict[str, Any]:
        """What those who write chunks need to know."""
        template = self.job.plan.template()
        results = {name: (template[name].dims, dtype) for name, dtype in self.job.dtypes.items()}
        return {"store": self.store, "place": self.place, "cut": self.cut, "results": results}

    @property
    def written(self) -> Any:
        import dask.array as da

        meta = np.empty((0,) * len(self.shape), bool)
        return da.map_blocks(_write_region, self.solved, **self._about, dtype=bool, meta=meta)

    def write(self, number: int, arrays: Arrays) -> None:
        _write_region(arrays, **self._about, block_id=tuple(map(int, np.unravel_index(number, self.shape))))

    def finish(self, overwrite: bool) -> None:
        import zarr

        group = zarr.open_group(self.store, mode="r+")
        group.attrs.put({name: value for name, value in group.attrs.items() if name != "unfinished"})
        if isinstance(self.path, Path):
            appear(Path(self.store), self.path, overwrite)
        files, folder = url_to_fs(self.place)
        files.rm(folder, recursive=True)


def _write_region(
    solved: Any,
    store: str,
    place: str,
    cut: Mapping[str, tuple[int, ...]],
    results: Mapping[str, tuple[Any, np.dtype[Any]]],
    block_id: tuple[int, ...],
) -> NDArray[np.bool_]:
    """Write a chunk to its region of a Zarr store, then its mark, in this process or a worker."""
    arrays, chunk = solved.item() if isinstance(solved, np.ndarray) else solved, chunk_at(cut, block_id)
    for name, (dims, dtype) in results.items():
        one = xr.Dataset({name: (dims, arrays[name].astype(dtype, copy=False))})
        region: Any = {dim: chunk[dim] for dim in dims if dim in chunk}
        how: Any = {"region": region} if region else {"mode": "r+"}
        one.to_zarr(store, zarr_format=3, consolidated=False, **how)
    number = int(np.ravel_multi_index(block_id, [len(own) for own in cut.values()])) if block_id else 0
    files, folder = url_to_fs(place)
    files.pipe_file(f"{folder}/{number:06}.chunk", b"")
    return np.ones((1,) * len(block_id), bool)
