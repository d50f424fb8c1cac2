"""Files of results opened to read from: every command has its names, attributes and values from here.

A result may have passed through other programs (xarray, NCO, CDO, Octave), which pack values, write other
types and formats, change the order of dimensions or of values, and leave away what they do not need.
Values come out as the CF conventions (2.5.1, 8.1) mean them; what is missing is masked or NaN.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.files.motions import RECORD_DIM, SUITE_DIM
from slipsweep.files.names import open_netcdf
from slipsweep.grid.chunks import CHUNK_CELLS, grid_chunks
from slipsweep.grid.resources import available_memory, size_text
from slipsweep.model.variables import (
    HISTORY,
    LIMIT_RESULTS,
    MOTION_COORDINATES,
    PARAMETERS,
    RECORD_RESULTS,
    RESULT_DTYPES,
    RESULTS,
    STATISTIC_COORDINATES,
    STATISTICS,
)

Floats = NDArray[np.float64]

#: Where to read along each dimension: a slice, an index or indices; a dimension not named, all of it.
Where = Mapping[str, Any]

#: All that a command of slipsweep writes, but for the samples of a record, and what it lies along.
_RESULTS = {**RECORD_RESULTS, **LIMIT_RESULTS, **HISTORY, **STATISTICS, **RESULTS}
_COORDINATES = {**STATISTIC_COORDINATES, **PARAMETERS, **MOTION_COORDINATES}

#: Attributes by which a file says values in other numbers, or none.
_VALID = ("valid_range", "valid_min", "valid_max")
_ENCODING = ("scale_factor", "add_offset", "_Unsigned", "_FillValue", "missing_value", *_VALID)

#: Attributes of variables that are texts: what another program has put there instead is made one.
_TEXTS = ("units", "long_name", "coordinates", "bounds", "flag_meanings")

#: Cells of a variable in chunks (none is slipsweep's own) that are read on trial: chunks are found by lists in
#: the file, which may be damaged.
_TRIED_CELLS = 2**25

#: Of them, those that are read in one step, with its limit of time: chunks of one cell take some microseconds each.
_STEP_CELLS = 2**16

#: Bytes from which on it is asked whether memory holds what is read.
_LARGE = 100_000_000

#: What the netCDF library raises on a damaged file.
_LIBRARY_ERRORS = (OSError, RuntimeError, AttributeError, UnicodeError, LookupError, TypeError)


@contextmanager
def result_file(path: Path) -> Iterator["ResultFile"]:
    """Open a file of slipsweep to read from.

    Raises
    ------
    InputError
        It cannot be read, is not netCDF or damaged, or was not written by slipsweep.
    """
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    with ResultFile(path) as file:
        if not str(file.attrs.get("source", "")).startswith("slipsweep ") and "sweep" not in file.attrs:
            raise InputError(f"{path}: not written by slipsweep, or its global attributes are lost")
        yield file


@contextmanager
def _library(path: Path) -> Iterator[None]:
    """Say what the netCDF library raises in one line."""
    try:
        yield
    except InputError:
        raise
    except _LIBRARY_ERRORS as error:
        raise InputError(f"{path}: not a netCDF file, or a damaged one ({error})") from None


# -------------------------------------------------------------------------------- a variable


class FileVariable:
    """A variable of a file, and its values as the CF conventions mean them.

    Attributes
    ----------
    path : Path
        The file.
    name : str
    dims : tuple of str
        Without that of the characters of a text.
    sizes : dict of str to int
        Dimensions and their lengths.
    attrs : dict
        But for those by which values are packed or missing; units, names and meanings are texts.
    is_text : bool
    encoding : dict
        The others, by which they are.
    stored : dtype
        That of the numbers in the file.
    """

    def __init__(self, path: Path, variable: netCDF4.Variable) -> None:
        variable.set_auto_maskandscale(False)
        variable.set_auto_chartostring(False)
        self.path, self.name, self._variable = path, str(variable.name), variable
        attributes = {name: _attribute(variable, name) for name in variable.ncattrs()}
        self.encoding = {name: attributes.pop(name) for name in _ENCODING if name in attributes}
        texts = {name: str(attributes[name]) for name in _TEXTS if name in attributes}
        self.attrs: dict[str, Any] = attributes | texts
        self._has_characters = variable.dtype == "S1"
        self.is_text = self._has_characters or variable.dtype is str
        self.dims: tuple[str, ...] = tuple(variable.dimensions[: -1 if self._has_characters else None])
        self.sizes = {dim: int(size) for dim, size in zip(variable.dimensions, variable.shape, strict=True)}
        self.sizes = {dim: self.sizes[dim] for dim in self.dims}
        self.stored: np.dtype[Any] = np.dtype(object) if self.is_text else variable.dtype.newbyteorder("=")

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.sizes.values())

    @property
    def in_one_piece(self) -> bool:
        """Whether the values lie one after the other in the file."""
        return not isinstance(self._variable.chunking(), list)

    # ------------------------------------------------------------------------------- types

    @property
    def dtype(self) -> np.dtype[Any]:
        """That of the values that `read` returns; packed numbers are floating-point ones."""
        if self.is_text or self._packing is None:
            return self._raw
        unpacked = np.result_type(self._raw, *self._packing)
        return unpacked if unpacked.kind == "f" else np.dtype(np.float64)

    @property
    def _raw(self) -> np.dtype[Any]:
        """The stored type, without its sign where `_Unsigned` says so (netCDF-3 has no unsigned numbers)."""
        unsigned = self.stored.kind == "i" and str(self.encoding.get("_Unsigned")).lower() == "true"
        return np.dtype(f"u{self.stored.itemsize}") if unsigned else self.stored

    @cached_property
    def _packing(self) -> tuple[Any, Any] | None:
        """scale_factor and add_offset, or None without them."""
        if self.encoding.keys().isdisjoint(("scale_factor", "add_offset")):
            return None
        found = []
        for name, default in (("scale_factor", np.int8(1)), ("add_offset", np.int8(0))):
            value = np.asarray(self.encoding.get(name, default))
            if value.dtype.kind not in "iuf" or value.size != 1:
                raise InputError(f"{self.path}: {self.name}: {name} = {self.encoding[name]!r}: must be one number")
            found.append(value.ravel()[0])
        return found[0], found[1]

    @cached_property
    def _signs(self) -> list[Any]:
        """The stored numbers that stand for no value, but for NaN."""
        given = [self.encoding.get(name, ()) for name in ("_FillValue", "missing_value")]
        if "_FillValue" not in self.encoding and self.stored.itemsize > 1:
            # that of values which were never written; by convention not of bytes, all of which may be in use
            given.append(netCDF4.default_fillvals[self.stored.str[1:]])
        signs = []
        for numbers in map(np.atleast_1d, given):
            with np.errstate(all="ignore"):
                stored = numbers.astype(self.stored) if numbers.dtype.kind in "iuf" else np.array([])
            for number, sign in zip(numbers, stored, strict=False):
                # not those that the type cannot hold
                if self.stored.kind == "f" or number in (sign, sign.view(self._raw)):
                    signs.append(sign.view(self._raw))
        return [sign for sign in signs if sign == sign]

    @property
    def _is_plain(self) -> bool:
        """Whether values are stored as they are, what is missing as NaN."""
        return not (self._packing or self._signs or self._raw != self.stored or {*_VALID} & self.encoding.keys())

    # ------------------------------------------------------------------------------ values

    def read(self, where: Where) -> np.ma.MaskedArray:
        """Read a hyperslab along `dims`, what is missing masked (NaN included); text as objects."""
        raw = self._hyperslab(where)
        if self.is_text:
            return np.ma.MaskedArray(_text(raw) if self._has_characters else raw)
        raw = raw.astype(self.stored, copy=False).view(self._raw)
        values = raw
        if self._packing is not None:
            factor, offset = map(self.dtype.type, self._packing)
            values = raw.astype(self.dtype) * factor + offset
        missing = np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, bool)
        for sign in self._signs:
            missing |= raw == sign
        for name in _VALID:
            bounds = np.atleast_1d(self.encoding.get(name, ()))
            if bounds.dtype.kind not in "iuf" or bounds.size != (2 if name == "valid_range" else 1):
                continue
            if bounds.dtype == self.stored:
                bounds = bounds.view(self._raw)
            # bounds are packed as well, but for those of a wider type than the packed numbers (NUG, appendix A)
            wider = bounds.dtype.kind == "f" and (raw.dtype.kind != "f" or bounds.itemsize > raw.itemsize)
            compared = values.astype(bounds.dtype) if wider else raw
            if name != "valid_max":
                missing |= compared < bounds[0]
            if name != "valid_min":
                missing |= compared > bounds[-1]
        return np.ma.MaskedArray(values, missing)

    def read_floats(self, where: Where) -> NDArray[Any]:
        """Read a hyperslab of floating-point numbers along `dims`, NaN where there is no value."""
        self._check_numbers()
        if self.stored.kind == "f" and self._is_plain:
            return self._hyperslab(where).astype(self.stored, copy=False)  # as slipsweep writes them
        values = self.read(where)
        kind = self.dtype if self.dtype.kind == "f" else np.float64
        return np.asarray(np.ma.filled(values.astype(kind, copy=False), np.nan))

    def read_codes(self, where: Where, missing: int = -1) -> NDArray[Any]:
        """Read a hyperslab of codes or counts along `dims`, `missing` where there is no value.

        Raises
        ------
        InputError
            One is no whole number: cells were averaged.
        """
        self._check_numbers()
        kind = np.dtype(RESULT_DTYPES.get(self.name, np.int32))
        if self.stored == kind and self.encoding in ({}, {"_FillValue": -1}):
            return self._hyperslab(where).astype(kind, copy=False)  # as slipsweep writes them
        values, limits = self.read(where), np.iinfo(kind)
        there = values.compressed()
        wrong = there[(there != np.rint(there)) | (there < limits.min) | (there > limits.max)]
        if wrong.size:
            raise InputError(
                f"{self.path}: {self.name}: holds {wrong[0]:.6g}, which is no code (codes cannot be averaged or packed)"
            )
        return np.asarray(values.filled(missing)).astype(kind)

    def _check_numbers(self) -> None:
        if self.is_text:
            raise InputError(f"{self.path}: {self.name}: is text; must be numbers")

    def _hyperslab(self, where: Where) -> NDArray[Any]:
        """Read stored values; the library takes indices in ascending order only, and is slow with many."""
        parts: list[Any] = []
        orders: dict[int, NDArray[Any]] = {}
        axis = 0  # of what is read, in which a dimension with one index is none
        for dim in self.dims:
            part = where.get(dim, slice(None))
            if _is_index(part):
                parts.append(int(part))
                continue
            if not isinstance(part, slice):
                part, orders[axis] = _ascending(np.asarray(part))
            parts.append(part)
            axis += 1
        _check_memory(self, parts)
        kind = object if self._variable.dtype is str else None
        with _library(self.path):
            values = np.asarray(self._variable[tuple(parts) or ...], dtype=kind)
        for axis, order in orders.items():
            values = values.take(order, axis)
        return values


def _is_index(part: Any) -> bool:
    return isinstance(part, (int, np.integer))


def _ascending(indices: NDArray[Any]) -> tuple[slice | list[int], NDArray[Any]]:
    """What to read for some indices, and where each of them is in that."""
    ascending = np.unique(indices)
    if not ascending.size:
        return slice(0, 0), indices.astype(np.intp)
    steps = np.diff(ascending)
    first, last = int(ascending[0]), int(ascending[-1])
    if not steps.size or (steps == steps[0]).all():
        step = int(steps[0]) if steps.size else 1
        return slice(first, last + 1, step), (indices - first) // step
    if ascending.size <= 16:
        return ascending.tolist(), np.searchsorted(ascending, indices)
    return slice(first, last + 1), indices - first


def _check_memory(variable: FileVariable, parts: list[Any]) -> None:
    """Refuse to read what memory does not hold: a length in the file may be damaged."""
    lengths = [
        1 if _is_index(part) else len(part) if isinstance(part, list) else len(range(*part.indices(size)))
        for part, size in zip(parts, variable.sizes.values(), strict=True)
    ]
    needed = math.prod(lengths) * variable.dtype.itemsize
    free = available_memory() if needed > _LARGE else None
    if free is not None and needed > free:
        wanted = f"{size_text(needed)} are to be read, but {size_text(free)} of memory is free"
        raise InputError(f"{variable.path}: {variable.name}: {wanted}")


def _text(characters: NDArray[Any]) -> NDArray[Any]:
    """Put characters together; programs pad texts with zeros or blanks."""
    if not characters.ndim:
        return np.array(_decoded(characters.item()), dtype=object)
    flat = np.ascontiguousarray(characters).reshape(-1, characters.shape[-1])
    texts = np.empty(len(flat), dtype=object)
    texts[:] = [_decoded(row.tobytes()) for row in flat]
    return texts.reshape(characters.shape[:-1])


def _decoded(text: bytes) -> str:
    return text.decode(errors="replace").rstrip("\0 ")


def _attribute(owner: netCDF4.Dataset | netCDF4.Variable, name: str) -> Any:
    """Read an attribute; text of another encoding than UTF-8 is no error."""
    try:
        return owner.getncattr(name)
    except UnicodeDecodeError:
        return owner.getncattr(name, encoding="latin-1")


# ------------------------------------------------------------------------------------ a file


class ResultFile:
    """A netCDF file, whatever program wrote it, or a Zarr store, open to read from; a context manager.

    Attributes
    ----------
    path : Path
    attrs : dict
        Global attributes.
    sizes : dict of str to int
        Dimensions and their lengths.
    variables : dict of str to FileVariable
        Those of numbers or text.
    unread : dict of str to str
        Other variables, and their types.

    Raises
    ------
    InputError
        The file cannot be read, is not netCDF, or damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _library(path):
            self._file: Any = open_netcdf(path)
        try:
            with _library(path):
                self._read_head()
        except BaseException:
            self._file.close()
            raise

    def _read_head(self) -> None:
        file = self._file
        self.attrs: dict[str, Any] = {name: _attribute(file, name) for name in file.ncattrs()}
        self.variables: dict[str, FileVariable] = {}
        self.unread: dict[str, str] = {}
        nbytes = self.path.stat().st_size
        for name, variable in file.variables.items():
            kind = variable.dtype
            if (isinstance(kind, np.dtype) and (kind.kind in "iuf" or kind == "S1")) or kind is str:
                own = FileVariable(self.path, variable)
                if len(own.dims) > len(own.sizes):
                    self.unread[name] = "the same dimension twice"
                    continue
                if not own.is_text and own.in_one_piece and own.size * own.stored.itemsize > nbytes:
                    raise InputError(
                        f"{self.path}: damaged: {name} is to have {own.size} values, but the file has {nbytes} bytes"
                    )
                self.variables[name] = own
            else:
                self.unread[name] = str(getattr(kind, "name", kind))
        used = [dim for variable in self.variables.values() for dim in variable.dims]
        self.sizes = {dim: len(length) for dim, length in file.dimensions.items() if dim in used}

    def __enter__(self) -> "ResultFile":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def __getitem__(self, name: str) -> FileVariable:
        return self.variables[name]

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    @cached_property
    def coordinates(self) -> list[str]:
        """Names of coordinate variables: of dimensions, those that results name, and parameters."""
        owners = [self.attrs, *(variable.attrs for variable in self.variables.values())]
        named = " ".join(str(owner.get(key, "")) for owner in owners for key in ("coordinates", "bounds")).split()
        own = {"label", "displacement", *_COORDINATES} - _RESULTS.keys()
        return [name for name in self.variables if name in self.sizes or name in named or name in own]

    @cached_property
    def results(self) -> list[str]:
        """Names of all other variables."""
        return [name for name in self.variables if name not in self.coordinates]

    @cached_property
    def cells(self) -> list[str]:
        """Names of the results that make up a table: slipsweep's own, and those that lie along the same dimensions.

        The samples of a record do not, nor do bounds of cells that another program added.
        """
        own = [name for name in self.results if name in _RESULTS] or self.results
        dims = {dim for name in own for dim in self[name].dims} - {RECORD_DIM, SUITE_DIM}
        return [name for name in self.results if dims.issuperset(self[name].dims)]

    @cached_property
    def labels(self) -> list[str]:
        """Names of the cases; empty without them."""
        return self.texts("case", "label") or self.texts("case")

    def texts(self, dim: str, name: str = "") -> list[str]:
        """Texts along a dimension, those of the variable of its name if not of another; empty without them."""
        name = name or dim
        if name in self and self[name].is_text and self[name].dims == (dim,):
            return [str(text) for text in self[name].read({}).data]
        return []

    def axis(self, dim: str) -> tuple[Floats, NDArray[np.intp]]:
        """Read the values along a dimension, ascending, and where in the file each of them is.

        A dimension without numbers, such as ``case``, counts from 1.

        Raises
        ------
        InputError
            A value is missing, or there twice.
        """
        if dim not in self or self[dim].is_text or self[dim].dims != (dim,):
            return np.arange(1.0, 1.0 + self.sizes[dim]), np.arange(self.sizes[dim])
        values = self[dim].read_floats({}).astype(np.float64)
        if not np.isfinite(values).all():
            raise InputError(f"{self.path}: {dim}: values are missing along this axis")
        order = np.argsort(values, kind="stable")
        values = values[order]
        twice = values[1:][values[1:] == values[:-1]]
        if twice.size:
            raise InputError(f"{self.path}: {dim}: the value {twice[0]:.6g} is there twice; must be there once")
        return values, order


def cut_chunks(
    sizes: Mapping[str, int], where: Mapping[str, NDArray[np.intp]], most: int = CHUNK_CELLS
) -> Iterator[tuple[dict[str, Any], dict[str, int]]]:
    """Cut what is kept of a grid into chunks of at most `most` cells: where in the file each lies, and its lengths.

    `where` has the indices that are kept along some of the dimensions.
    """
    kept = {dim: len(where[dim]) if dim in where else length for dim, length in sizes.items()}
    for chunk in grid_chunks(kept, most):
        part = {dim: where[dim][one] if dim in where else one for dim, one in chunk.items()}
        yield part, {dim: one.stop - one.start for dim, one in chunk.items()}


def read_table(file: ResultFile, names: Sequence[str]) -> xr.Dataset:
    """Read some results, and all coordinates along their dimensions.

    Raises
    ------
    InputError
        One of the results is not in the file.
    """
    for name in names:
        if name not in file:
            raise InputError(f"{file.path}: {name}: not in this file, which has {', '.join(file.results) or 'nothing'}")
    dims = {dim for name in names for dim in file[name].dims}

    def read(name: str) -> xr.Variable:
        one = file[name]
        if name == "validity":
            return xr.Variable(one.dims, one.read_codes({}, 0), one.attrs)
        return xr.Variable(one.dims, np.asarray(one.read({}).data if one.is_text else one.read_floats({})), one.attrs)

    coords = {name: read(name) for name in file.coordinates if dims.issuperset(file[name].dims)}
    return xr.Dataset({name: read(name) for name in names}, coords, dict(file.attrs))
