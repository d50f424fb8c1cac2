"""Where the chunks of a run go: into their places in one netCDF file, to a netCDF file each, or into a Zarr store."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.files.netcdf import rounded
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk
from slipsweep.grid.tally import Tally
from slipsweep.runs.parts import Manifest

#: Results of a chunk as they are stored.
Arrays = Mapping[str, NDArray[Any]]


class Writer(Protocol):
    """Writes chunks, in this process, or sent to another."""

    def write(self, number: int, chunk: Chunk, table: xr.Dataset, arrays: Arrays) -> str:
        """Write a chunk, with its values as they are to be stored; return what is to go on record."""


class Target(Protocol):
    """Where the chunks of a run go.

    Attributes
    ----------
    identity : dict of str to object
        What two runs must have in common in it for one to go on with the chunks of the other.
    shared : bool
        Whether the writer may be sent to other processes: what it writes does not pass through this one.
    """

    identity: Mapping[str, Any]
    shared: bool

    @property
    def writer(self) -> Writer:
        """What writes chunks; there once the target is created or opened."""

    def create(self, manifest: Manifest) -> None:
        """Begin with no chunks; `manifest` learns what is to be known to go on."""

    def open(self, manifest: Manifest) -> bool:
        """Whether all but the chunks of an earlier run is as it was made."""

    def find(self, number: int, chunk: Chunk, digest: str) -> dict[str, NDArray[Any]] | None:
        """Return the values of a chunk, as they are stored, or None if they are not those on record."""

    def sync(self) -> None:
        """Have all that this process has written on the disk itself."""

    def finish(self, finished: Mapping[int, str]) -> None:
        """All chunks are there: add what can be added only now (RunError: something was taken away meanwhile)."""

    def close(self) -> None:
        """Close what is open."""

    def appear(self, overwrite: bool) -> None:
        """Give the finished result its name."""

    def is_there(self) -> bool:
        """Whether the chunks have not been taken away."""

    def is_complete(self) -> bool:
        """Whether something has the name of the result."""

    def has_appeared(self) -> bool:
        """Whether what has the name of the result is what this run finished."""

    @property
    def nbytes(self) -> int:
        """Bytes that the chunks take so far."""


@dataclass(frozen=True)
class Delivered:
    """A chunk that is where it belongs: what goes on record, and the counts of its cells."""

    digest: str
    tally: Tally


@dataclass(frozen=True)
class Delivery:
    """What becomes of a chunk when it is solved, here or on a worker: it is rounded, counted and written.

    Attributes
    ----------
    writer : Writer
    dtypes : dict of str to dtype
        Types in which results are stored.
    dims : dict of str to tuple of str
        Dimensions of the results.
    """

    writer: Writer
    dtypes: Mapping[str, np.dtype[Any]]
    dims: Mapping[str, tuple[str, ...]]

    def __call__(self, plan: AnyPlan, number: int, chunk: Chunk, table: xr.Dataset) -> Delivered:
        """Deliver a chunk of a plan, or of the whole of which the plan is a part."""
        arrays = {name: rounded(name, one.values, self.dtypes[name]) for name, one in table.data_vars.items()}
        with ThreadPoolExecutor(1) as counter:
            tally = counter.submit(counts, plan, self.dims, chunk, arrays)
            digest = self.writer.write(number, chunk, table, arrays)
            return Delivered(digest, tally.result())


def counts(plan: AnyPlan, dims: Mapping[str, tuple[str, ...]], chunk: Chunk, arrays: Arrays) -> Tally:
    """Count a chunk, but for what other chunks along a dimension that a result lacks have as well."""
    own = {
        name: values
        for name, values in arrays.items()
        if not any(part.start for dim, part in chunk.items() if dim not in dims[name])
    }
    return plan.tally(own)
