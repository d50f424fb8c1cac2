"""What a file of results holds, in whatever format: its dimensions, variables and attributes by the CF conventions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.files.motions import embedded
from slipsweep.model.variables import RECORD_COUNTS, SlidingMode
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite

#: Results that are whole numbers, -1 where there is no value.
_WITH_MISSING = ("sliding_mode", *RECORD_COUNTS)

#: Attribute that tells of the run that made a file, for programs.
RUN = "slipsweep_run"

#: Checksums of the chunks that the results of a file were written in, a row of 16 bytes each.  In a group of their own:
#: what other programs do with all variables of a file (means, tables) does not concern them.
CHECKSUM_GROUP = "checksums"
CHECKSUMS = f"{CHECKSUM_GROUP}/chunk_checksum"
CHECKSUM_DIMS = ("chunk", "checksum_byte")
CHECKSUM_BYTES = 16
CHECKSUM_ATTRIBUTES = {"long_name": "XXH3-128 of each chunk of results, for slipsweep verify"}


@dataclass(frozen=True)
class Head:
    """What a file says beside its results.

    Attributes
    ----------
    title : str
    labels : tuple of str
        Names of the cases.
    recorded : Record or Suite, optional
        The motion, or motions, that the results are the response to: their samples are written with them.
    sweep : str, optional
        The text of a sweep file, from which the run can be repeated.
    """

    title: str
    labels: tuple[str, ...] = ()
    recorded: Record | Suite | None = None
    sweep: str | None = None


@dataclass(frozen=True, eq=False)
class Stored:
    """A variable as a file holds it.

    Attributes
    ----------
    dims : tuple of str
    dtype : dtype
        That of the numbers; others are texts.
    attrs : dict
    fill : float or int, optional
        What stands for no value.
    values : ndarray, optional
        None of a result, whose values come later.
    """

    dims: tuple[str, ...]
    dtype: np.dtype[Any]
    attrs: Mapping[str, Any]
    fill: float | int | None = None
    values: NDArray[Any] | None = None

    @property
    def is_text(self) -> bool:
        """Whether its values are texts."""
        return self.dtype.kind in "OU"


@dataclass(frozen=True, eq=False)
class Contents:
    """All that a file holds but the values of its results.

    Attributes
    ----------
    sizes : dict of str to int
        Dimensions and their lengths.
    variables : dict of str to Stored
    attrs : dict
    chunks : int
        There is room for the checksums of so many chunks.
    compression : int
        Level at which results are compressed; 0 for not.
    """

    sizes: dict[str, int]
    variables: dict[str, Stored]
    attrs: dict[str, Any] = field(default_factory=dict)
    chunks: int = 0
    compression: int = 0

    @property
    def later(self) -> dict[str, np.dtype[Any]]:
        """What there is only room for, and the types of its numbers: results, and the checksums of chunks."""
        results = {name: stored.dtype for name, stored in self.variables.items() if stored.values is None}
        return results | ({CHECKSUMS: np.dtype(np.uint8)} if self.chunks else {})

    def shape(self, name: str) -> tuple[int, ...]:
        """Lengths of a variable along its dimensions."""
        return tuple(self.sizes[dim] for dim in self.variables[name].dims)


def storable(text: str) -> str:
    """A text as a file can hold it: bytes of a name that are no UTF-8 are spelled out."""
    return text.encode(errors="backslashreplace").decode()


def contents_of(head: Head, table: xr.Dataset, dtype: Callable[[str], np.dtype[Any]], history: str) -> Contents:
    """What a file holds: the coordinates and attributes of a table, its results with the data type that `dtype` says.

    Parameters
    ----------
    head : Head
    table : xr.Dataset
        Of its results only dimensions and attributes are looked at.
    dtype : callable
        Data type of a result in the file, by its name.
    history : str
        The file's `history`, see `slipsweep.files.netcdf.history_of`.
    """
    coordinates = {name: _stored(one) for name, one in table.coords.items()}
    beside: dict[str, Stored] = {}
    if head.labels:
        labels = np.array(head.labels, dtype=object)
        beside["label"] = Stored(("case",), labels.dtype, {"long_name": "name of the case"}, None, labels)
    sizes = {str(dim): size for dim, size in table.sizes.items()}
    # in the order of the results, which that of the coordinates need not be
    widest = max((result.dims for result in table.data_vars.values()), key=len, default=())
    sizes = {dim: sizes[dim] for dim in (*widest, *sizes)}
    # texts along a dimension are labels, and no coordinate variable of it (CF 6.1)
    both = {**coordinates, **beside}
    auxiliary = {name: one.dims for name, one in both.items() if name not in sizes or one.is_text}
    results = {}
    for name, result in table.data_vars.items():
        attributes, kind = dict(result.attrs), dtype(name)
        if attributes.get("ancillary_variables") not in table:
            attributes.pop("ancillary_variables", None)
        if own := [other for other, dims in auxiliary.items() if {*dims} <= {*result.dims}]:
            attributes["coordinates"] = " ".join(own)
        fill = np.nan if kind.kind == "f" else int(SlidingMode.MISSING) if name in _WITH_MISSING else None
        results[name] = Stored(result.dims, kind, attributes, fill)
    if head.recorded is not None:
        for name, one in embedded(head.recorded).items():
            beside[name] = _stored(one)
            sizes |= {str(dim): size for dim, size in one.sizes.items()}
    attrs = {**table.attrs, "title": head.title, "Conventions": "CF-1.11", "history": history}
    attrs |= {} if head.sweep is None else {"sweep": head.sweep}
    return Contents(sizes, {**coordinates, **results, **beside}, attrs)


def _stored(one: xr.Variable) -> Stored:
    """An array whose values are known."""
    values = one.values.astype(object) if one.values.dtype.kind == "U" else one.values
    return Stored(one.dims, values.dtype, one.attrs, None, values)


def with_run(contents: Contents, run: str) -> Contents:
    """The same with what tells of the run that makes the file."""
    return replace(contents, attrs={**contents.attrs, RUN: run})
