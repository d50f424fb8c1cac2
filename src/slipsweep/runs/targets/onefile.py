"""All chunks in one netCDF file, each in its place."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import NDArray

from slipsweep.files.checksums import checksum
from slipsweep.files.contents import CHECKSUMS, with_run
from slipsweep.files.outputs import sync
from slipsweep.grid.chunks import Chunk, places
from slipsweep.runs import parts
from slipsweep.runs.jobs import Job
from slipsweep.runs.placed import PlacedFile, file_checksum, make_file, runs_of
from slipsweep.runs.targets import Arrays, Writer
from slipsweep.runs.targets.renamed import Renamed, removed


class OneFile(Renamed):
    """A `Target`; and its own `Writer`, as the file that is open here is written from here."""

    shared = False
    identity: Mapping[str, Any] = {"--split": False}

    def __init__(self, job: Job, path: Path, work: parts.Folder) -> None:
        self.job, self.path, self.data = job, path, work.path / "data.nc"
        self.results = {name: one.sizes for name, one in job.plan.template().data_vars.items()}
        self.file: PlacedFile | None = None

    @property
    def writer(self) -> Writer:
        """Itself."""
        return self

    def close(self) -> None:
        """Close the file, if it is open."""
        if self.file is not None:
            self.file.close()
            self.file = None

    def create(self, manifest: parts.Manifest) -> None:
        """Make the file, with all but the chunks in it."""
        contents = self.job.contents(manifest.history)
        contents = with_run(contents, parts.stamp(manifest, contents, self.results))
        manifest.layout = make_file(self.data, replace(contents, chunks=manifest.chunks))
        manifest.head = file_checksum(self.data, manifest.layout)
        sync(self.data)
        self.file = PlacedFile(self.data, manifest.layout)

    def open(self, manifest: parts.Manifest) -> bool:
        """Open the file of an earlier run; whether all but its chunks is as it was made."""
        if manifest.layout is None:
            return False
        try:
            # what the system refuses (rights, a disk that does not answer) is no damage: chunks are not thrown away
            self.file = PlacedFile(self.data, manifest.layout)
        except FileNotFoundError:
            return False
        # what was cut off is zeros: the chunks that are whole can be read
        self.file.restore_size()
        return file_checksum(self.data, manifest.layout) == manifest.head

    def find(self, number: int, chunk: Chunk, digest: str) -> dict[str, NDArray[Any]] | None:
        """Return the values of a chunk, as they are stored, or None if they are not those on record."""
        assert self.file is not None
        arrays = {}
        for name, sizes in self.results.items():
            shape = [part.stop - part.start for part in places(chunk, sizes).values()]
            try:
                values = self.file.read(name, runs_of(chunk, sizes), self.job.dtype(name))
            except OSError:  # a sector that cannot be read; that the file can was seen when it was opened
                return None
            arrays[name] = values.reshape(shape)
        return arrays if checksum(arrays) == digest else None

    def write(self, number: int, chunk: Chunk, table: xr.Dataset, arrays: Arrays) -> str:
        """Write a chunk, with its values as they are to be stored; return what is to go on record."""
        assert self.file is not None
        for name, sizes in self.results.items():
            self.file.write(name, runs_of(chunk, sizes), arrays[name])
        return checksum(arrays)

    def finish(self, finished: Mapping[int, str]) -> None:
        """Write the checksums of the chunks (RunError: another file has been put in place of the one written)."""
        assert self.file is not None
        if not self.file.has_name(self.data):
            raise removed(self.data)
        rows = parts.checksum_rows(finished).ravel()
        self.file.write(CHECKSUMS, ([0], rows.size), rows)
        self.sync()

    def sync(self) -> None:
        """Have all that is written on the disk itself."""
        sync(self.data)

    @property
    def nbytes(self) -> int:
        """Bytes of the file."""
        return self.data.stat().st_size if self.data.exists() else 0
