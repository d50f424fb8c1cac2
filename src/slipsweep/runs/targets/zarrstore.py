"""A Zarr store: a folder that gets its name when it is complete, or an address, whose group is made then."""

import contextlib
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.files import zarr_store
from slipsweep.files.checksums import checksum
from slipsweep.files.contents import CHECKSUMS, with_run
from slipsweep.files.outputs import appear, sync
from slipsweep.files.zarr_store import Place
from slipsweep.grid.chunks import Chunk, places
from slipsweep.runs import parts
from slipsweep.runs.jobs import Job
from slipsweep.runs.targets import Arrays
from slipsweep.runs.targets.renamed import removed


@dataclass(frozen=True)
class StoreWriter:
    """Writes chunks into a store: each is shards of its own."""

    place: Place
    results: Mapping[str, Mapping[str, int]]
    key: str

    def write(self, number: int, chunk: Chunk, table: xr.Dataset, arrays: Arrays) -> str:
        """Write a chunk, with its values as they are to be stored; return what is to go on record."""
        zarr_store.write(
            self.place, self.key, {name: (self.where(chunk, name), values) for name, values in arrays.items()}
        )
        return checksum(arrays)

    def where(self, chunk: Chunk, name: str) -> tuple[slice, ...]:
        """Where a chunk lies in a result."""
        return tuple(places(chunk, self.results[name]).values())


class ZarrStore:
    """A `Target`."""

    def __init__(self, job: Job, output: Place, work: parts.Folder, shared: bool) -> None:
        self.job, self.output, self.shared = job, output, shared
        self.identity: Mapping[str, Any] = {
            "format": "Zarr",
            **({} if isinstance(output, Path) else {"output": output}),
        }
        self.place = work.path / "data.zarr" if isinstance(output, Path) else output
        self.results = {name: one.sizes for name, one in job.plan.template().data_vars.items()}

    def close(self) -> None:
        """Nothing stays open."""

    def _begin(self, manifest: parts.Manifest) -> None:
        self.manifest = manifest
        self.contents = replace(self.job.contents(manifest.history), chunks=manifest.chunks)
        self.writer = StoreWriter(self.place, self.results, secrets.token_hex(8))

    def _head_checksum(self) -> str:
        # values of results, and of the checksums, come later
        return zarr_store.head_checksum(self.place, {*self.results, CHECKSUMS}, [*self.contents.variables, CHECKSUMS])

    def create(self, manifest: parts.Manifest) -> None:
        """Make the arrays."""
        self._begin(manifest)
        if not isinstance(self.output, Path) and manifest.overwrite:
            system, path = zarr_store.file_system(self.output)
            with contextlib.suppress(FileNotFoundError):
                system.rm(path, recursive=True)
        zarr_store.create(self.place, self.contents, manifest.lengths, self.job.compression)
        manifest.head = self._head_checksum()

    def open(self, manifest: parts.Manifest) -> bool:
        """Whether all but the chunks of an earlier run is as it was made."""
        self._begin(manifest)
        try:
            return self._head_checksum() == manifest.head
        except PermissionError:
            raise  # no damage
        except Exception:  # whatever zarr says of metadata that it did not write
            return False

    def find(self, number: int, chunk: Chunk, digest: str) -> dict[str, NDArray[Any]] | None:
        """Return the values of a chunk, as they are stored, or None if they are not those on record."""
        try:
            arrays = {
                name: zarr_store.read(self.place, self.writer.key, name, self.writer.where(chunk, name))
                for name in self.results
            }
        except PermissionError:
            raise  # no damage
        except Exception:  # whatever a codec says of bytes that it did not write
            return None
        return arrays if checksum(arrays) == digest else None

    def finish(self, finished: Mapping[int, str]) -> None:
        """Write the checksums of the chunks, and make the group (RunError: the store has been taken away)."""
        if isinstance(self.place, Path):
            for name in (*self.contents.variables, CHECKSUMS):
                if not (self.place / name / "zarr.json").exists():
                    raise removed(self.place / name)
        values = parts.checksum_rows(finished)
        zarr_store.write(self.place, self.writer.key, {CHECKSUMS: ((slice(None), slice(None)), values)})
        run = parts.stamp(self.manifest, self.contents, self.results, order=[*self.contents.variables])
        zarr_store.complete(self.place, with_run(self.contents, run))
        if isinstance(self.place, Path):
            for one in self.place.rglob("*"):
                sync(one)

    def sync(self) -> None:
        """Nothing before the end: what a power cut takes is found by its checksum."""

    def appear(self, overwrite: bool) -> None:
        """Give the folder its name; a store at an address has had it since its group was made."""
        if isinstance(self.output, Path):
            assert isinstance(self.place, Path)
            appear(self.place, self.output, overwrite)

    def is_there(self) -> bool:
        """Whether the store has not been taken away."""
        return zarr_store.exists(self.place)

    def is_complete(self) -> bool:
        """Whether something has the name of the store."""
        return zarr_store.exists(self.output)

    def has_appeared(self) -> bool:
        """Whether the store has its name, at an address its group."""
        if isinstance(self.place, Path):
            return self.is_complete() and not self.is_there()
        return zarr_store.is_finished(self.place)

    @property
    def nbytes(self) -> int:
        """Bytes of the store."""
        return zarr_store.nbytes(self.place)


def check_address(address: str, overwrite: bool) -> None:
    """Refuse an address where there is something already (InputError)."""
    zarr_store.check_package(address)
    if zarr_store.exists(address) and not overwrite:
        raise InputError(f"{address}: exists already; give --overwrite to replace it, or another name with -o")
