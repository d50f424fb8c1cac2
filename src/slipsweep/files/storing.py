"""Where a chunk is written, and how a run goes on after an interruption.

A run of one chunk is solved and written at once.  The chunks of a larger one, elements of the dask array that
`slipsweep.grid.graph.solved_chunks` makes of its plan, are written as they are computed:

- for a netCDF file each to a file of its own, ``OUT.nc.part/000012.chunk``.  It is written under another name and
  renamed: a chunk is a complete file or is not there.  When all are, they are put together in their order;
- for a Zarr store each as a region of a store, ``OUT.zarr.part/store``, followed by a mark in its array `finished`.
  A store at an address (``s3://…``) is written where it is, and is no result before the marks are gone.

`identity.json` beside them (for a store its attribute `unfinished`) says what they are chunks of.
"""

import json
import math
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files import cluster, netcdf
from slipsweep.files.jobs import RUN, Job
from slipsweep.files.opening import check_zarr, is_address, read_result
from slipsweep.files.outputs import appear, check_outputs, writing
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import CHUNK_CELLS, Chunk, chunk_lengths, grid_chunks, places
from slipsweep.grid.resources import size_text
from slipsweep.grid.tally import Tally

#: A file or folder, or the address of a store.
Place = Path | str

#: The results of a chunk, by name.
Arrays = Mapping[str, NDArray[Any]]

#: Resident memory of a run, and of a worker of this machine, beside its chunks.
_BASE_MEMORY, _WORKER_MEMORY = 400_000_000, 250_000_000

#: Chunks for each worker, so that all end at about the same time, and the least work of one, in cells of a sine.
_CHUNKS_A_WORKER, _LEAST_WORK = 16, 500_000

#: Cells of a finished result that are read at a time, to be counted.
_READ_CELLS = 4_000_000

#: Most cells of a chunk of a Zarr store within one of the run's, which is a shard of the store.
_ZARR_CELLS = 500_000


@dataclass
class Report:
    """What `run` did; `found`: the output was complete by an earlier run, and nothing was computed."""

    path: Place
    seconds: float
    nbytes: int
    tally: Tally
    found: bool = False


@dataclass(frozen=True)
class Means:
    """What a run may take: bytes of memory, and processes of this machine or the address of a scheduler."""

    memory: int | None = None
    workers: int | None = None
    scheduler: str | None = None

    @property
    def has_cluster(self) -> bool:
        """Whether chunks are computed by other processes."""
        return self.workers is not None or self.scheduler is not None


def run(
    job: Job,
    path: Place,
    *,
    command: str,
    overwrite: bool = False,
    resume: bool = False,
    means: Means | None = None,
    progress: Callable[[int], None] | None = None,
) -> Report:
    """Solve a plan and write its results, complete or not at all.

    Parameters
    ----------
    job : Job
    path : Path or str
        The netCDF file, or the Zarr store (a name that ends in .zarr), or the address of a store.
    command : str
        The command as typed, for the file's `history`.
    overwrite : bool
        Replace `path` and the chunks of an interrupted run, if they exist.
    resume : bool
        Go on with the chunks of an interrupted run, if there are any.  An output that is complete and of this very
        sweep is left as it is.
    means : Means, optional
    progress : callable, optional
        Called with a number of cells just solved.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        The output exists or cannot be written, the grid is too large for disk or memory, or there are chunks of an
        interrupted run, and neither `resume` nor `overwrite` is given, or they are of another sweep or version.
    RunError
        Writing failed, or another run is writing `path`.  A note tells how many chunks are kept.
    """
    means, started = means or Means(), time.perf_counter()
    cluster.check_cluster(means.workers, means.scheduler)
    if isinstance(path, Path):
        check_outputs([path], overwrite or resume, reads=job.files)
    if resume and (found := _complete(job, path)) is not None:
        tally = tally_of(found, job.plan)
        return Report(path, time.perf_counter() - started, nbytes_of(path), tally, found=True)
    lengths = chunk_lengths(job.plan.sizes, _chunk_cells(job.plan, means), job.plan.together)
    is_zarr = isinstance(path, str) or path.suffix == ".zarr"
    target = (_ZarrChunks if is_zarr else _NetcdfChunks)(job, path, lengths)
    if lengths == dict(job.plan.sizes) and not is_zarr and not means.has_cluster and not target.folder.exists():
        with job.named():
            table = job.plan.solve(progress)
            whole = job.described(table, command)
            netcdf.write_whole(whole, Path(path), job.dtypes, overwrite, job.compression)
        tally = tally_of(table, job.plan)
    else:
        with target.locked():
            target.begin(resume, overwrite)
            with _kept(target), job.named():
                _solve(target, means, progress)
                tally = target.finish(command, overwrite)
    return Report(path, time.perf_counter() - started, nbytes_of(path), tally)


def nbytes_of(path: Place) -> int:
    """Bytes that a result takes."""
    if isinstance(path, str):
        import fsspec

        files, root = fsspec.core.url_to_fs(path)
        return int(files.du(root))
    if path.is_dir():
        return sum(one.stat().st_size for one in path.rglob("*") if one.is_file())
    return path.stat().st_size


def tally_of(table: xr.Dataset, plan: AnyPlan) -> Tally:
    """Count the results of a plan, read in chunks."""
    tally = Tally()
    for chunk in grid_chunks(plan.sizes, _READ_CELLS, plan.together):
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
            f"{path}: exists already, and is of another sweep or version; give --overwrite to replace it, or another "
            "name with -o"
        )
    return found


# ------------------------------------------------------------------------------- the chunks


def _chunk_cells(plan: AnyPlan, means: Means) -> int:
    """How many cells a chunk may have: seconds of work, within the memory, and enough chunks for all workers."""
    cells = max(1, int(CHUNK_CELLS / plan.cost))
    if means.has_cluster:
        share = math.prod(plan.sizes.values()) // (_CHUNKS_A_WORKER * (means.workers or 64))
        cells = min(cells, max(math.ceil(_LEAST_WORK / plan.cost), share))
    if means.memory is None:
        return cells
    workers = means.workers or 0
    base = _BASE_MEMORY + plan.memory + workers * (_WORKER_MEMORY + plan.memory)
    # in this process one chunk is solved and one is written; a worker has one, and others are on their way
    cell = (2 + 3 * workers) * _cell_bytes(plan) + plan.cell_memory + 8
    within = (means.memory - base) // cell
    if within < 1000:
        raise InputError(
            f"--memory = {size_text(means.memory)}: must be {size_text(1.01 * (base + 1000 * cell))} at least"
        )
    return int(min(within, cells) if plan.cost > 1.0 or means.has_cluster else within)


def _cell_bytes(plan: AnyPlan) -> int:
    """Bytes of the results of a cell of the grid."""
    return sum(
        one.dtype.itemsize * math.prod(size for dim, size in one.sizes.items() if dim not in plan.sizes)
        for one in plan.template().data_vars.values()
    )


@dataclass
class _Chunks:
    """The chunks of a run, and where they are written."""

    job: Job
    path: Place
    lengths: dict[str, int]
    done: set[int] = field(default_factory=set)

    @property
    def folder(self) -> Path:
        """What an interrupted run leaves."""
        path = Path(self.path)
        return path.with_name(f"{path.name}.part")

    @property
    def cut(self) -> dict[str, tuple[int, ...]]:
        """Lengths of all chunks along each dimension."""
        found = {}
        for dim, size in self.job.plan.sizes.items():
            whole, rest = divmod(size, self.lengths[dim])
            found[dim] = (self.lengths[dim],) * whole + ((rest,) if rest else ())
        return found

    @property
    def shape(self) -> tuple[int, ...]:
        """How many chunks there are along each dimension; they are numbered in the order of the file."""
        return tuple(math.ceil(size / self.lengths[dim]) for dim, size in self.job.plan.sizes.items())

    @property
    def count(self) -> int:
        """How many chunks there are."""
        return math.prod(self.shape)

    def index(self, number: int) -> tuple[int, ...]:
        """The place of a chunk."""
        return tuple(int(at) for at in np.unravel_index(number, self.shape))

    def indices(self) -> Iterator[tuple[int, tuple[int, ...]]]:
        """Number and place of every chunk; one after the other, as there may be more than memory holds."""
        return enumerate(np.ndindex(*self.shape))

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs away from this output.

        Raises
        ------
        RunError
            Another run is writing it.
        """
        from filelock import FileLock, Timeout

        with writing(self.folder):
            self.folder.mkdir(exist_ok=True)
            lock = FileLock(self.folder / "lock", timeout=0)
            try:
                lock.acquire()
            except Timeout:
                raise RunError(f"{self.path}: another run is writing it") from None
        try:
            yield
        finally:
            lock.release()
            if self.folder.is_dir() and not (self.folder / "identity.json").exists():
                shutil.rmtree(self.folder, ignore_errors=True)

    def begin(self, resume: bool, overwrite: bool) -> None:
        """Take over the chunks of an interrupted run, or begin anew.

        Raises
        ------
        InputError
            There are chunks, which neither `resume` nor `overwrite` says what to do with, or of another sweep; or the
            disk has no room for the results.
        """
        if overwrite:
            self.clear()
        found = self.read_identity()
        if found is None:
            self.clear()
            self.check_room()
            with writing(self.path):
                self.make()
            return
        if not resume:
            raise InputError(
                f"{self.path}: an interrupted run has left chunks in {self.place}; give --resume to go on with them, "
                "or --overwrite to start again"
            )
        for name, value in self.job.identity.items():
            if found["identity"].get(name) != value:
                raise InputError(
                    f"{self.place}: has chunks of another {name}; go on with that one, or give --overwrite to start "
                    "again"
                )
        if math.prod(found["lengths"].values()) > math.prod(self.lengths.values()):
            raise InputError(
                f"{self.place}: has larger chunks than fit into the memory asked for; give more --memory, or "
                "--overwrite to start again"
            )
        self.lengths = found["lengths"]
        self.done = self.finished()
        self.check_room()

    @property
    def place(self) -> Place:
        """Where the chunks are, for messages."""
        return self.folder

    def check_room(self) -> None:
        """Refuse what the disk has no room for."""
        needed, left = self.nbytes, 1.0 - len(self.done) / self.count
        free = shutil.disk_usage(self.folder).free
        if needed * (1.0 + left) > free:
            raise InputError(
                f"{self.path}: takes {size_text(needed)}, and as much again for its chunks while it is written, but "
                f"{size_text(free)} are free on the disk"
            )

    @property
    def nbytes(self) -> int:
        """Bytes of the results, without compression."""
        template = self.job.plan.template()
        return sum(math.prod(template[name].shape) * dtype.itemsize for name, dtype in self.job.dtypes.items())

    @property
    def state(self) -> dict[str, Any]:
        """What is written beside the chunks."""
        return {"identity": self.job.identity, "lengths": self.lengths}

    def clear(self) -> None:
        """Remove what an earlier run has left; the lock stays."""
        for one in self.folder.iterdir():
            if one.name != "lock":
                shutil.rmtree(one) if one.is_dir() else one.unlink()

    def make(self) -> None:
        """Get ready to write chunks."""
        temporary = self.folder / "identity.tmp"
        temporary.write_text(json.dumps(self.state))
        os.replace(temporary, self.folder / "identity.json")

    def read_identity(self) -> dict[str, Any] | None:
        """The `state` of an interrupted run; None without one."""
        try:
            return dict(json.loads((self.folder / "identity.json").read_text()))
        except (OSError, ValueError):
            return None

    def finished(self) -> set[int]:
        """Numbers of the chunks that are there."""
        raise NotImplementedError

    def written(self, chunks: Any) -> Any:
        """A dask array of chunks that are written where they are computed; None if this process writes them."""
        return None

    def write(self, number: int, arrays: Arrays) -> None:
        """Write a chunk."""
        raise NotImplementedError

    def finish(self, command: str, overwrite: bool) -> Tally:
        """Make the output of all chunks, give it its name, and count its modes and flags."""
        raise NotImplementedError


class _NetcdfChunks(_Chunks):
    """Chunks in files of arrays, one after the other in the order of the plan."""

    def finished(self) -> set[int]:
        return {int(one.stem) for one in self.folder.glob("*.chunk")}

    def write(self, number: int, arrays: Arrays) -> None:
        temporary = self.folder / f"{number:06}.tmp"
        with writing(temporary):
            with temporary.open("wb") as file:
                for values in arrays.values():
                    np.save(file, values)
            os.replace(temporary, self.folder / f"{number:06}.chunk")

    def _read(self, number: int) -> Arrays:
        path = self.folder / f"{number:06}.chunk"
        try:
            with path.open("rb") as file:
                return {name: np.load(file) for name in self.job.dtypes}
        except (OSError, ValueError, EOFError) as error:
            raise RunError(f"{path}: is damaged ({error}); remove it, and give --resume to compute it again") from None

    def finish(self, command: str, overwrite: bool) -> Tally:
        from slipsweep.grid.graph import chunk_at

        plan, tally, path = self.job.plan, Tally(), Path(self.path)
        table = self.job.described(plan.template(), command)
        temporary = self.folder / "result.nc"
        with netcdf.new_file(temporary, path, table, self.job.dtypes, self.lengths, self.job.compression) as file:
            for number, index in self.indices():
                chunk, arrays = chunk_at(self.cut, index), self._read(number)
                for name, values in arrays.items():
                    file[name][_where(table[name], chunk)] = values
                tally.merge(plan.part(chunk).tally(arrays))
        tally.cells = plan.cells
        with writing(path):
            appear(temporary, path, overwrite)
        shutil.rmtree(self.folder)
        return tally


class _ZarrChunks(_Chunks):
    """Chunks as regions of a Zarr store, each one shard of its arrays."""

    @property
    def store(self) -> str:
        """The store that chunks are written to."""
        return os.fspath(self.path if is_address(self.path) else self.folder / "store")

    @property
    def place(self) -> Place:
        return self.path if is_address(self.path) else self.folder

    @property
    def folder(self) -> Path:
        # no other machine knows of the lock of a store at an address, but other runs on this one do
        return Path(f".{Path(self.path).name}.part") if is_address(self.path) else super().folder

    def check_room(self) -> None:
        if not is_address(self.path) and self.nbytes > 20 * shutil.disk_usage(self.folder).free:
            super().check_room()

    def clear(self) -> None:
        super().clear()
        if is_address(self.path):
            import fsspec

            files, root = fsspec.core.url_to_fs(self.store)
            if files.exists(root):
                files.rm(root, recursive=True)

    def make(self) -> None:
        import dask.array as da
        import zarr

        check_zarr(self.path)
        table = self.job.described(self.job.plan.template(), "")
        for name, dtype in self.job.dtypes.items():
            one = table[name]
            table[name] = (one.dims, da.zeros(one.shape, dtype=dtype, chunks=-1), one.attrs)  # not computed
        encoding = {name: self._encoding(table[name]) for name in self.job.dtypes}
        table.to_zarr(self.store, mode="w", compute=False, encoding=encoding, zarr_format=3, consolidated=False)
        group = zarr.open_group(self.store, mode="r+")
        group.create_array("finished", shape=(self.count,), chunks=(1,), dtype="uint8", dimension_names=("number",))
        group.attrs["unfinished"] = json.dumps(self.state)
        super().make()

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
        if self.job.compression:
            found["compressors"] = [ZstdCodec(level=self.job.compression)]
        return found

    def read_identity(self) -> dict[str, Any] | None:
        import zarr

        with suppress(Exception):  # whatever the storage behind an address may raise where there is none
            return dict(json.loads(str(zarr.open_group(self.store, mode="r").attrs["unfinished"])))
        return None

    def finished(self) -> set[int]:
        import zarr

        marks: Any = zarr.open_group(self.store, mode="r")["finished"]
        return {int(number) for number in np.flatnonzero(marks[:] == 1)}

    def written(self, chunks: Any) -> Any:
        import dask.array as da

        return da.map_blocks(
            _write_region, chunks, about=self.region, dtype=bool, meta=np.empty((0,) * chunks.ndim, bool)
        )

    @property
    def region(self) -> "_Region":
        """What those who write chunks need to know."""
        template = self.job.plan.template()
        return _Region(self.store, self.cut, {name: template[name].dims for name in self.job.dtypes}, self.job.dtypes)

    def write(self, number: int, arrays: Arrays) -> None:
        with writing(self.path):
            self.region.write(self.index(number), arrays)

    def finish(self, command: str, overwrite: bool) -> Tally:
        import zarr

        with writing(self.path):
            group = zarr.open_group(self.store, mode="r+")
            del group["finished"]
            attrs = {name: value for name, value in group.attrs.items() if name != "unfinished"}
            group.attrs.put({**attrs, "history": netcdf.history_of(command)})
            if isinstance(self.path, Path):
                appear(Path(self.store), self.path, overwrite)
        shutil.rmtree(self.folder)
        return tally_of(read_result(self.path), self.job.plan)


@dataclass(frozen=True)
class _Region:
    """Where the chunks of a run lie in a Zarr store; sent to workers, which write them themselves."""

    store: str
    cut: Mapping[str, tuple[int, ...]]
    dims: Mapping[str, tuple[Any, ...]]
    dtypes: Mapping[str, np.dtype[Any]]

    def write(self, index: tuple[int, ...], arrays: Arrays) -> None:
        """Write a chunk, then its mark."""
        import zarr

        from slipsweep.grid.graph import chunk_at

        chunk = chunk_at(self.cut, index)
        for name, values in arrays.items():
            one = xr.Dataset({name: (self.dims[name], values.astype(self.dtypes[name], copy=False))})
            region: Any = {dim: chunk[dim] for dim in self.dims[name] if dim in chunk}
            how: Any = {"region": region} if region else {"mode": "r+"}
            one.to_zarr(self.store, zarr_format=3, consolidated=False, **how)
        marks: Any = zarr.open_group(self.store, mode="r+")["finished"]
        marks[int(np.ravel_multi_index(index, [len(own) for own in self.cut.values()])) if index else 0] = 1


def _write_region(chunk: Any, about: _Region, block_id: tuple[int, ...]) -> NDArray[np.bool_]:
    """Write a chunk where it is computed."""
    about.write(block_id, chunk.item())
    return np.ones(chunk.shape, bool)


def _where(result: xr.DataArray, chunk: Chunk) -> Any:
    """Where a chunk lies in a result."""
    return tuple(places(chunk, {str(dim): size for dim, size in result.sizes.items()}).values()) or ...


@contextmanager
def _kept(target: _Chunks) -> Iterator[None]:
    """Say with an error what is kept of the run."""
    try:
        yield
    except BaseException as error:
        kept = len(target.finished())
        if kept:
            error.add_note(f"{kept} of {target.count} chunks are kept in {target.place}: --resume goes on")
        else:
            target.clear()
            error.add_note("nothing written")
        raise


# ------------------------------------------------------------------------------- solving them


def _solve(target: _Chunks, means: Means, progress: Callable[[int], None] | None) -> None:
    """Compute the chunks that are missing, and write them while others are computed."""
    from slipsweep.grid.graph import chunk_at, solved_chunks

    plan, cut = target.job.plan, target.cut
    chunks = solved_chunks(plan, cut)
    missing = ((number, index) for number, index in target.indices() if number not in target.done)

    def tell(number: int) -> None:
        if progress is not None:
            progress(plan.part(chunk_at(cut, target.index(number))).cells)

    if progress is not None and target.done:
        progress(plan.cells * len(target.done) // target.count)
    if means.has_cluster:
        written = target.written(chunks)
        with cluster.connected(means.workers, means.scheduler) as client:
            blocks = ((number, (chunks if written is None else written).blocks[index]) for number, index in missing)
            for number, found in cluster.computed(client, blocks):
                if written is None:
                    target.write(number, _stored(target.job, found.item()))
                tell(number)
        return
    with ThreadPoolExecutor(1) as writer:
        waiting: Future[None] | None = None
        for number, index in missing:
            found = chunks.blocks[index].compute(scheduler="synchronous").item()
            if waiting is not None:
                waiting.result()
            waiting = writer.submit(target.write, number, _stored(target.job, found))
            tell(number)
        if waiting is not None:
            waiting.result()


def _stored(job: Job, arrays: Arrays) -> Arrays:
    """The results of a chunk in the types of the file."""
    return {name: arrays[name].astype(dtype, copy=False) for name, dtype in job.dtypes.items()}
