"""A folder with a netCDF file for each chunk, complete by itself."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import xxhash
from numpy.typing import NDArray

from slipsweep.files.checksums import checksum
from slipsweep.files.contents import Contents, Head, contents_of, with_run
from slipsweep.files.names import open_netcdf
from slipsweep.files.netcdf import new_file, write_head
from slipsweep.files.outputs import sync
from slipsweep.grid.chunks import Chunk
from slipsweep.runs import parts
from slipsweep.runs.jobs import Job
from slipsweep.runs.placed import PlacedFile, file_checksum, make_file
from slipsweep.runs.targets import Arrays, Writer
from slipsweep.runs.targets.renamed import Renamed, removed


def chunk_name(number: int) -> str:
    """The file of a chunk."""
    return f"chunk-{number:06}.nc"


def _checksum(path: Path) -> str:
    """XXH3 of all bytes of a file."""
    with path.open("rb") as content:
        return hashlib.file_digest(content, xxhash.xxh3_128).hexdigest()


@dataclass(frozen=True)
class FileWriter:
    """Writes the file of a chunk."""

    folder: Path
    head: Head
    manifest: parts.Manifest
    compression: int

    def write(self, number: int, chunk: Chunk, table: xr.Dataset, arrays: Arrays) -> str:
        """Write it, and bring it to the disk itself; return the checksum of the file."""
        coords: dict[Any, Any] = dict(table.coords)
        labels = self.head.labels
        if "case" in chunk:
            # files are put together by the coordinates of their dimensions, which rows of [[cases]] lack
            rows = np.arange(chunk["case"].start, chunk["case"].stop, dtype=np.int32) + 1
            coords["case"] = xr.Variable(("case",), rows, {"long_name": "row of [[cases]]", "units": "1"})
            labels = labels[chunk["case"]]
        contents = contents_of(
            replace(self.head, labels=labels),
            xr.Dataset(table.data_vars, coords, table.attrs),
            lambda name: arrays[name].dtype,
            self.manifest.history,
        )
        run = parts.stamp(self.manifest, contents, arrays, chunk=number, checksum=checksum(arrays))
        path = self.folder / chunk_name(number)
        temporary = path.with_suffix(".tmp")
        digest = self._make(temporary, replace(with_run(contents, run), compression=self.compression), arrays)
        sync(temporary)
        temporary.replace(path)
        return digest

    def _make(self, path: Path, contents: Contents, arrays: Arrays) -> str:
        """Make a file whole; return its checksum."""
        if self.compression:
            with new_file(path, path) as written:
                write_head(written, contents)
                for name, values in arrays.items():
                    written[name][...] = values
            return _checksum(path)
        layout = make_file(path, contents)
        file = PlacedFile(path, layout)
        try:
            for name, values in arrays.items():
                file.write(name, ([0], values.size), values)
        finally:
            file.close()
        return file_checksum(path, layout, arrays)


class SplitFiles(Renamed):
    """A `Target`."""

    identity: Mapping[str, Any] = {"--split": True}

    def __init__(self, job: Job, path: Path, work: parts.Folder, shared: bool) -> None:
        self.job, self.path, self.data, self.shared = job, path, work.path / "data", shared
        self.chunks = 0

    def close(self) -> None:
        """Every file is closed when it is written."""

    def _begin(self, manifest: parts.Manifest) -> None:
        self.chunks = manifest.chunks
        self.writer: Writer = FileWriter(
            self.data, replace(self.job.head, labels=self.job.labels), manifest, self.job.compression
        )

    def create(self, manifest: parts.Manifest) -> None:
        """Make the folder."""
        self.data.mkdir()
        self._begin(manifest)

    def open(self, manifest: parts.Manifest) -> bool:
        """Whether there is a folder of an earlier run."""
        self._begin(manifest)
        return self.data.is_dir()

    def find(self, number: int, chunk: Chunk, digest: str) -> dict[str, NDArray[Any]] | None:
        """Return the values of a chunk, as they are stored, or None if its file is not that on record."""
        path = self.data / chunk_name(number)
        try:
            if _checksum(path) != digest:
                return None
        except PermissionError:
            raise  # no damage
        except OSError:
            return None
        with open_netcdf(path) as file:
            file.set_auto_maskandscale(False)
            return {name: np.asarray(file[name][...]) for name in self.job.plan.names}

    def finish(self, finished: Mapping[int, str]) -> None:
        """Refuse to take the folder for whole where a file is missing (RunError)."""
        for number in range(self.chunks):
            if not (self.data / chunk_name(number)).exists():
                raise removed(self.data / chunk_name(number))
        self.sync()

    def sync(self) -> None:
        """Have the names of the files on the disk itself; the files are there."""
        sync(self.data)

    @property
    def nbytes(self) -> int:
        """Bytes of all files."""
        return sum(entry.stat().st_size for entry in self.data.iterdir()) if self.data.is_dir() else 0
