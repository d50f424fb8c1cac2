"""Rows and columns of the tables that a result is exported as: long ones with one row per case, or pivoted ones."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.files.cuts import axis_labels, stored_places
from slipsweep.files.results import FileVariable, ResultFile, Where, cut_chunks
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.variables import LIMIT_RESULTS, MOTION_FILES, RESULTS


class Column:
    """A variable of the file as a column: its values or, for flags, their codes or words.

    Parameters
    ----------
    variable : FileVariable
    words : bool
        Flags as words of `flag_meanings`; several are put one after the other, with spaces.
    """

    def __init__(self, variable: FileVariable, words: bool) -> None:
        self.variable, self.dims = variable, variable.dims
        # another program may have left these attributes away
        self.attributes = {**RESULTS.get(variable.name, LIMIT_RESULTS.get(variable.name, {})), **variable.attrs}
        units = variable.attrs.get("units")
        self.header = f"{variable.name} ({units})" if units else variable.name
        self.words = words and "flag_meanings" in self.attributes
        self.is_text = variable.is_text or self.words

    def read(self, chunk: Where) -> np.ma.MaskedArray:
        """Read the part of a chunk: an array along `dims`, masked where there is no value; texts are objects."""
        values = self.variable.read(chunk)
        if not self.words:
            return values
        return np.ma.MaskedArray(self.in_words(self.variable.read_codes(chunk)), np.ma.getmaskarray(values))

    def in_words(self, codes: NDArray[Any]) -> NDArray[Any]:
        """Replace codes by words; the few that occur are spelled out once each."""
        occurring, places = np.unique(codes, return_inverse=True)
        meanings = self.attributes["flag_meanings"].split()
        key = "flag_masks" if "flag_masks" in self.attributes else "flag_values"
        given = np.atleast_1d(self.attributes.get(key, ()))
        # other programs write them as floating-point numbers
        is_whole = given.dtype.kind in "iuf" and np.array_equal(given, np.rint(given))
        numbers = given.astype(np.int64).tolist() if is_whole else []
        if len(numbers) != len(meanings):
            raise InputError(
                f"{self.variable.path}: {self.variable.name}: flag_meanings has {len(meanings)} words and {key} "
                f"{len(numbers)} whole numbers; must be as many"
            )
        known = dict(zip(numbers, meanings, strict=True))
        spelled = np.empty(occurring.size, dtype=object)
        for place, code in enumerate(occurring.tolist()):
            flags = [word for mask, word in known.items() if code & mask] if key == "flag_masks" else []
            spelled[place] = " ".join(flags) if key == "flag_masks" else known.get(code, str(code))
        return spelled[places.reshape(codes.shape)]


@dataclass(frozen=True)
class Field:
    """A column of a table as it is written.

    Attributes
    ----------
    column : Column
        What it shows.
    header : str or float
        A number of a pivoted axis.
    """

    column: Column
    header: str | float


@dataclass(frozen=True)
class Cells:
    """A chunk of rows: each column as broadcastable to `shape`, masked where there is no value; texts are objects."""

    columns: list[np.ma.MaskedArray]
    shape: tuple[int, ...]

    @property
    def rows(self) -> int:
        """How many there are."""
        return math.prod(self.shape)

    def texts(self, text: Callable[[np.ma.MaskedArray], NDArray[Any]]) -> Iterator[tuple[Any, ...]]:
        """The rows, with values put as `text` has them; a coordinate is put so once a value, and then repeated."""
        return zip(*(np.broadcast_to(text(one), self.shape).ravel().tolist() for one in self.columns), strict=True)


#: Writes a chunk of rows.
Writer = Callable[[Cells], None]


@dataclass(frozen=True)
class Layout:
    """A table: what its rows and columns are, and where in the file they lie.

    Attributes
    ----------
    file : ResultFile
    name : str
        What it is of.
    left : list of Field
        Coordinates along the rows.
    right : list of Field
        Results; of a pivoted table one result, at each value of an axis.
    shape : dict of str to int
        Dimensions along the rows, and their lengths.
    where : dict of str to ndarray
        Indices into the file along the dimensions that are cut.
    across : str, optional
        The dimension along the columns.
    """

    file: ResultFile
    name: str
    left: list[Field]
    right: list[Field]
    shape: dict[str, int]
    where: Mapping[str, NDArray[np.intp]]
    across: str | None = None

    @property
    def fields(self) -> list[Field]:
        """All columns."""
        return [*self.left, *self.right]

    @property
    def rows(self) -> int:
        """How many there are below the header."""
        return math.prod(self.shape.values())

    def chunks(self, cells: int) -> Iterator[Cells]:
        """Read the columns in chunks."""
        most = max(1, cells // (len(self.right) if self.across else 1))
        for where, shape in cut_chunks(self.shape, self.where, most):
            arrays = [self._read(field.column, where, shape) for field in self.left]
            if self.across is None:
                arrays += [self._read(field.column, where, shape) for field in self.right]
            else:
                where[self.across] = self.where.get(self.across, slice(None))
                block = self._read(self.right[0].column, where, {**shape, self.across: len(self.right)})
                # a result that does not vary along this axis is the same in all columns
                arrays += [block[..., min(at, block.shape[-1] - 1)] for at in range(len(self.right))]
            yield Cells(arrays, tuple(shape.values()))

    def _read(self, column: Column, where: Where, shape: dict[str, int]) -> np.ma.MaskedArray:
        values = column.read(where)
        # another program may have put the dimensions of a variable into another order
        values = values.transpose([column.dims.index(dim) for dim in shape if dim in column.dims])
        return values.reshape([length if dim in column.dims else 1 for dim, length in shape.items()])


# ------------------------------------------------------------------------- rows and columns


def layouts(
    file: ResultFile,
    wanted: Sequence[str] | None,
    words: bool,
    at: Mapping[str, str],
    rows: Sequence[str],
    columns: str | None,
) -> list[Layout]:
    """The tables asked for: a long one, or pivoted ones of a result each; as `slipsweep.files.export.export`."""
    chosen = _results(file, wanted)
    dims = {dim for name in chosen for dim in file[name].dims}
    sizes = {dim: length for dim, length in file.sizes.items() if dim in dims}
    where = stored_places(file, at, sizes)
    shape = sizes | {dim: len(places) for dim, places in where.items()}
    beside = [name for name in file.coordinates if dims.issuperset(file[name].dims) and name not in MOTION_FILES]
    if columns is None:
        if rows:
            raise InputError(f"--rows {','.join(rows)}: needs --columns, the axis whose values become columns")
        left, right = ([_field(file[name], words) for name in names] for names in (beside, chosen))
        return [Layout(file, file.path.stem, left, right, shape, where)]
    along = _rows(file, shape, rows, columns)
    left = [_field(file[name], words) for name in beside if file[name].dims and {*file[name].dims} <= {*along}]
    fixed = [dim for dim in shape if dim != columns and dim not in along]
    ends = axis_ends(file, columns, where)
    below = {dim: shape[dim] for dim in (*along, *fixed)}
    tables = []
    for name in chosen:
        column = Column(file[name], words)
        corner = f"{_header(file, columns)}: {column.header}" + _constants(file, {dim: where.get(dim) for dim in fixed})
        own = [*left[:-1], *(Field(last.column, f"{last.header} \\ {corner}") for last in left[-1:])]
        tables.append(Layout(file, name, own, [Field(column, end) for end in ends], below, where, columns))
    return tables


def _results(file: ResultFile, wanted: Sequence[str] | None) -> list[str]:
    """The results to export."""
    chosen = list(dict.fromkeys(file.cells if wanted is None else wanted))
    for name in chosen:
        if name in file.unread:
            raise InputError(f"{file.path}: {name}: is of type {file.unread[name]}; must be numbers or text")
        if name not in file.results:
            raise InputError(f'{file.path}: no variable "{name}"; {did_you_mean(name, file.results)}')
    if not chosen:
        raise InputError(f"{file.path}: holds no results")
    return chosen


def _rows(file: ResultFile, shape: Mapping[str, int], rows: Sequence[str], columns: str) -> list[str]:
    """The axes along the rows of a pivoted table."""
    for option, names in (("--rows", rows), ("--columns", [columns])):
        for name in names:
            if name not in shape:
                advice = did_you_mean(name, list(shape)) if shape else "the result has none"
                raise InputError(f"{file.path}: {option} {name}: no such axis here; {advice}")
    if columns in rows or len({*rows}) < len(rows):
        raise InputError(f"--rows {','.join(rows)} --columns {columns}: must be different axes")
    others = {dim: length for dim, length in shape.items() if dim not in (*rows, columns)}
    wide = [dim for dim, length in others.items() if length > 1]
    if not rows and not wide:
        raise InputError(
            f"{file.path}: --columns {columns}: no other axis has more than one value, none is left for rows"
        )
    if rows and wide:
        texts = ", ".join(f"{dim} ({others[dim]} values)" for dim in wide)
        raise InputError(f"{file.path}: neither in --rows nor in --columns: {texts}; take one value of it with --at")
    return list(rows) or wide


def _field(variable: FileVariable, words: bool) -> Field:
    column = Column(variable, words)
    return Field(column, column.header)


def _header(file: ResultFile, dim: str) -> str:
    return Column(file[dim], False).header if dim in file else dim


def axis_ends(file: ResultFile, dim: str, where: Mapping[str, NDArray[np.intp]]) -> list[str | float]:
    """The values along a dimension, or their labels."""
    values: list[Any] = axis_labels(file, dim)
    if not values and dim in file and file[dim].dims == (dim,):
        found = file[dim].read({}).data
        values = [_plain(one) for one in found]
    values = values or list(range(1, file.sizes[dim] + 1))
    return [values[at] for at in where[dim]] if dim in where else values


def _plain(number: Any) -> float:
    """A number with as few digits as bring it back: of single precision not those of a double."""
    return float(str(number)) if isinstance(number, np.floating) else float(number)


def _constants(file: ResultFile, fixed: Mapping[str, NDArray[np.intp] | None]) -> str:
    """What a pivoted table has one value of: axes that are cut, and parameters that are one number."""
    found = {}
    for dim, places in fixed.items():
        (found[dim],) = axis_ends(file, dim, {dim: np.zeros(1, np.intp) if places is None else places})
    for name in file.coordinates:
        if not file[name].dims and not file[name].is_text:
            found[name] = _plain(np.ma.filled(file[name].read({}), np.nan)[()])
    texts = []
    for name, value in found.items():
        units = str(file[name].attrs.get("units", "1")) if name in file else "1"
        number = value if isinstance(value, str) else f"{value:.10g}"
        texts.append(f"{name} = {number}" + ("" if units == "1" else f" {units}"))
    return f" at {', '.join(texts)}" if texts else ""
