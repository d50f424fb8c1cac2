"""Chunks written to a file or store, so that an interrupted run can go on.

Each chunk of a run is written once, to its place in ``OUT.nc.part/result.nc`` or
``OUT.zarr.part/store``.  When it is written (to a netCDF file: on the disk itself), an empty file
``000012.chunk`` beside it marks it.  `identity.json` has the identity of the run, and the lengths
of the chunks.

The netCDF file is made first, with everything but the values of its results.  Chunks change nothing
else in it, so that it can be read whenever a run ends, and has all chunks that are marked.  A
compressed file is made from it at the end.  A store has the attribute `unfinished` until its run is
complete; a store at an address (``s3://…``) is written in place.
"""

import json
import math
import os
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import netCDF4
import numpy as np
import xarray as xr
from fsspec.core import url_to_fs

from slipsweep.errors import InputError, RunError, RunWarning
from slipsweep.files import netcdf
from slipsweep.files.jobs import Job
from slipsweep.files.opening import check_zarr, read_result
from slipsweep.files.outputs import EXISTS, appear, writing
from slipsweep.grid.chunks import Chunk, grid_chunks
from slipsweep.grid.plans import Plan
from slipsweep.grid.resources import size_text
from slipsweep.locks import lock_held

#: A file or folder, or the address of a store.
Place = Path | str

#: Approximate number of cells in a chunk of a Zarr store.  A chunk of the run is a shard of the
#: store, and holds several of them.
_ZARR_CELLS = 500_000


def nbytes_of(path: Place) -> int:
    """Return the bytes that a result takes."""
    files, root = url_to_fs(os.fspath(path))
    return int(files.du(root))


@dataclass
class Chunks:
    """The chunks of a run, in the order of the file; this process writes them to a netCDF file."""

    job: Job
    path: Place
    lengths: dict[str, int]  # of a chunk, along each dimension of the grid
    most: float = math.inf  # cells of a chunk that the allowed memory holds
    done: set[int] = field(default_factory=set)  # numbers of chunks from an interrupted run
    #: Name of the file or store that chunks are written to, within `place`.
    name: ClassVar[str] = "result.nc"

    def __post_init__(self) -> None:
        # the folder that an interrupted run leaves
        self.place = f"{os.fspath(self.path).rstrip('/')}.part"
        self.target = self.path if isinstance(self.path, str) else f"{self.place}/{self.name}"
        try:
            self._files, self._folder = url_to_fs(self.place)
        except (ImportError, ValueError) as error:  # a package is missing; not a protocol
            raise InputError(f"{self.path}: {error}") from None

    def __iter__(self) -> Iterator[tuple[int, Chunk]]:
        """Yield the number and the place of every chunk; there may be more than memory holds."""
        plan = self.job.plan
        return enumerate(grid_chunks(plan.sizes, math.prod(self.lengths.values()), plan.together))

    @contextmanager
    def begun(self, command: str, resume: bool, overwrite: bool) -> Iterator[None]:
        """Take over the chunks of an interrupted run, or begin anew, and lock the output.

        InputError: neither is allowed.  RunError: another run is writing it, or writing failed.  A
        note to any error says how many chunks are kept.
        """
        # there are no locks at an address
        with self._locked() if isinstance(self.path, Path) else nullcontext(True) as is_locked:
            self._begin(command, resume, overwrite)
            if not is_locked:
                text = "the file system has no locks: a second run at this output would not be seen"
                warnings.warn(RunWarning(f"{self.path}: {text}"), stacklevel=2)
            try:
                with writing(self.path):
                    yield
            except BaseException as error:
                kept = len(self._finished())
                if not kept:
                    self._clear()
                chunks = f"{kept} of {sum(1 for _ in self)} chunks"
                note = f"{chunks} are kept in {self.place}: --resume goes on"
                error.add_note(note if kept else "nothing written")
                raise

    @contextmanager
    def _locked(self) -> Iterator[bool]:
        """Lock the output against other runs; yield False if the file system has no locks."""
        folder = Path(self.place)
        try:
            with ExitStack() as stack:
                with writing(self.path):
                    folder.mkdir(exist_ok=True)
                    try:
                        is_locked = stack.enter_context(lock_held(folder / "lock", timeout=0.0))
                    except TimeoutError:
                        raise RunError(f"{self.path}: another run is writing it") from None
                yield is_locked
        finally:
            if folder.is_dir() and not (folder / "identity.json").exists() and not self._finished():
                shutil.rmtree(folder, ignore_errors=True)

    def _begin(self, command: str, resume: bool, overwrite: bool) -> None:
        state = None
        with writing(self.path), suppress(FileNotFoundError, ValueError):
            state = json.loads(self._files.cat_file(f"{self._folder}/identity.json"))
        if state is None and not overwrite and self._finished():
            raise InputError(
                f"{self.place}: has chunks that nothing identifies; --overwrite starts again "
                "without them"
            )
        if state is None or overwrite:
            self._clear()
            if isinstance(self.path, Path):
                needed = self.job.outline("").nbytes
                free = shutil.disk_usage(self.path.parent).free
                # a store is compressed, to an unknown size
                if needed * (0.05 if self.path.suffix == ".zarr" else 1.0) > free:
                    sizes = f"takes {size_text(needed)}, but {size_text(free)} are free on the disk"
                    raise InputError(f"{self.path}: {sizes}")
            if not overwrite and self._files.exists(
                f"{self.place.removesuffix('.part')}/zarr.json"
            ):
                raise InputError(EXISTS.format(path=self.path))
            with writing(self.path):
                self._files.makedirs(self._folder, exist_ok=True)
                self.make(command)
                state = {"identity": self.job.identity, "lengths": self.lengths}
                self._files.pipe_file(f"{self._folder}/identity.json", json.dumps(state).encode())
            return
        others = [
            name
            for name, value in self.job.identity.items()
            if state["identity"].get(name) != value
        ]
        fault = ""
        if not resume:
            fault = "has chunks of an interrupted run; give --resume to go on with them"
        elif others:
            fault = f"has chunks of another {others[0]}; go on with that one"
        elif math.prod(state["lengths"].values()) > self.most:
            fault = "has larger chunks than fit into the memory asked for; give more --memory"
        if fault:
            raise InputError(f"{self.place}: {fault}, or --overwrite to start again")
        self.lengths = state["lengths"]
        self.done = self._finished()

    def _finished(self) -> set[int]:
        """Return the numbers of the chunks that are written."""
        return {int(Path(path).stem) for path in self._left() if path.endswith(".chunk")}

    def _clear(self) -> None:
        """Remove the files of an earlier run; the lock stays."""
        for path in self._left():
            if not path.endswith("/lock"):
                self._files.rm(path, recursive=True)

    def _left(self) -> list[str]:
        self._files.invalidate_cache()  # workers write there as well
        return (
            list(self._files.ls(self._folder, detail=False))
            if self._files.exists(self._folder)
            else []
        )

    def make(self, command: str) -> None:
        """Make the file or store that chunks are written to."""
        with netcdf.new_file(self.job.outline(command), self.target) as file:
            for name in self.job.dtypes:  # with its first value an array gets its place in the file
                file[name][(0,) * file[name].ndim or ...] = 0

    def task(self, number: int, chunk: Chunk) -> Callable[[], xr.Dataset | None]:
        """Return a function that computes a chunk, here or in a worker.

        It returns the results, or None if it has written them.
        """
        return partial(_solved, self.job.plan, self.job.dtypes, chunk)

    def write(self, number: int, chunk: Chunk, results: xr.Dataset) -> None:
        """Write the results of a chunk, then its mark."""
        with netCDF4.Dataset(self.target, "r+") as file:
            file.set_auto_maskandscale(False)
            for name in self.job.dtypes:
                file[name][_region(chunk, file[name])] = results[name].values
        with open(self.target, "rb") as written:
            os.fsync(written.fileno())  # to the disk itself, in case of a power cut
        _mark(self.place, number)

    def completed(self) -> str:
        """Return the path of the complete file or store, compressed as requested."""
        level = self.job.spec.output.compression
        if not level:
            return self.target
        compressed = f"{self.place}/compressed.nc"
        with netCDF4.Dataset(self.target) as source:
            source.set_auto_maskandscale(False)
            outline = self.job.outline("").assign_attrs(history=source.history)
            with netcdf.new_file(outline, compressed, self.lengths, level) as file:
                for _, chunk in self:
                    for name in self.job.dtypes:
                        region = _region(chunk, file[name])
                        file[name][region] = source[name][region]
        return compressed

    def add_attributes(self, path: str, attributes: Mapping[str, str]) -> None:
        """Add attributes to the file or store."""
        with netCDF4.Dataset(path, "r+") as file:
            file.setncatts(netcdf.attributes(attributes))

    def finish(self, overwrite: bool, remarks: Callable[[xr.Dataset], Mapping[str, str]]) -> None:
        """Add attributes that follow from the results, and give the output its name."""
        complete = self.completed()
        with read_result(complete) as results:
            attributes = remarks(results)
        self.add_attributes(complete, attributes)
        if isinstance(self.path, Path):
            appear(Path(complete), self.path, overwrite)
        self._files.rm(self._folder, recursive=True)


def _region(chunk: Chunk, result: "netCDF4.Variable[Any]") -> Any:
    return tuple(chunk.get(dim, slice(None)) for dim in result.dimensions) or ...


def _solved(plan: Plan, dtypes: Mapping[str, np.dtype[Any]], chunk: Chunk) -> xr.Dataset:
    """Return the results of a chunk in the types of the file, without coordinates."""
    table = plan.part(chunk).solve()
    return xr.Dataset(
        {name: table[name].variable.astype(dtype, copy=False) for name, dtype in dtypes.items()}
    )


def _mark(place: str, number: int) -> None:
    """Mark a chunk as written."""
    files, folder = url_to_fs(place)
    files.pipe_file(f"{folder}/{number:06}.chunk", b"")


class ZarrChunks(Chunks):
    """The chunks of a run as shards of a Zarr store; workers write the chunks that they solve."""

    name = "store"

    def make(self, command: str) -> None:
        check_zarr(self.path)
        from zarr.codecs import ZstdCodec

        table = self.job.outline(command).assign_attrs(unfinished="its run goes on with --resume")
        level = self.job.spec.output.compression
        encoding: dict[str, dict[str, Any]] = {}
        for name, dtype in self.job.dtypes.items():
            # each chunk of the run is a shard, within which smaller chunks can be read
            shard = [self.lengths.get(str(dim), size) for dim, size in table[name].sizes.items()]
            inner = list(shard)
            for axis, length in enumerate(shard):
                if (cells := math.prod(inner)) > _ZARR_CELLS:
                    # a shard holds a whole number of chunks
                    parts = (count for count in range(1, length + 1) if length % count == 0)
                    inner[axis] = length // min(
                        parts, key=lambda count: abs(math.log(cells / count / _ZARR_CELLS))
                    )
            encoding[name] = {"_FillValue": netcdf.fill_value(name, dtype)}
            encoding[name] |= {"chunks": inner, "shards": shard} if shard else {}
            encoding[name] |= {"compressors": [ZstdCodec(level=level)]} if level else {}
        table.to_zarr(
            self.target,
            mode="w",
            compute=False,
            encoding=encoding,
            zarr_format=3,
            consolidated=False,
        )

    def task(self, number: int, chunk: Chunk) -> Callable[[], None]:
        solve = partial(_solved, self.job.plan, self.job.dtypes, chunk)
        return partial(_write_region, solve, chunk, self.target, self.place, number)

    def completed(self) -> str:
        import zarr

        del zarr.open_group(self.target, mode="r+").attrs["unfinished"]
        return self.target

    def add_attributes(self, path: str, attributes: Mapping[str, str]) -> None:
        import zarr

        zarr.open_group(path, mode="r+").attrs.update(attributes)


def _write_region(
    solve: Callable[[], xr.Dataset], chunk: Chunk, store: str, place: str, number: int
) -> None:
    """Compute a chunk and write it to its region of a Zarr store, then its mark."""
    results = solve()
    # results without a dimension of the chunk are written whole
    whole = [name for name, result in results.items() if chunk.keys().isdisjoint(result.dims)]
    for part in filter(None, (results.drop_vars(whole), results[whole])):
        region: Any = {dim: chunk[str(dim)] for dim in part.dims if dim in chunk} or None
        part.to_zarr(store, mode="r+", region=region, zarr_format=3, consolidated=False)
    _mark(place, number)
