"""Results as long tables, CSV or Parquet: a row a cell, its coordinates in columns, units in the header.

A file is read and written in chunks of `CHUNK_CELLS`, so that memory stays small whatever its size.
"""

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files import outputs
from slipsweep.files.results import FileVariable, ResultFile, result_file
from slipsweep.grid.chunks import grid_chunks
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.variables import LIMIT_RESULTS, MOTION_FILES, RESULTS

#: Rows made at a time; text of ten columns takes a hundred times as many bytes.
CHUNK_CELLS = 2**18

SUFFIXES = (".csv", ".parquet")


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

    def read(self, chunk: dict[str, slice]) -> np.ma.MaskedArray:
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


def export(
    source: Path,
    path: Path,
    *,
    variables: Sequence[str] | None = None,
    words: bool = False,
    overwrite: bool = False,
    chunk_cells: int = CHUNK_CELLS,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Write a result of slipsweep as a long table, complete or not at all.

    Rows are in the order of the file's dimensions, the last one running fastest; where a file has
    further dimensions than theta, mu_s, amplitude and frequency, in that order within chunks.

    Parameters
    ----------
    source : Path
        A netCDF file that slipsweep wrote.
    path : Path
        The table: .csv (UTF-8; missing values are empty) or .parquet (missing values are null).
    variables : sequence of str, optional
        Results to export, by default all; their coordinates come along.  Dimensions that none of
        them has are left out, with their rows.
    words : bool
        Sliding modes and flags as words instead of codes.
    overwrite : bool
        Replace `path` if it exists.
    chunk_cells : int
        Rows made at a time, hence in memory.
    progress : callable, optional
        Called with the number of rows just written.

    Returns
    -------
    int
        The number of rows.

    Raises
    ------
    InputError
        `source` is not slipsweep's, `path` cannot be written or has another ending, a variable is
        unknown, or pyarrow is missing.
    RunError
        Writing failed.
    """
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: the name must end in one of {', '.join(SUFFIXES)}")
    if path.suffix == ".parquet":
        _check_pyarrow(path)
    outputs.check_outputs([path], overwrite, reads=[source])
    with result_file(source) as file:
        columns, shape = _columns(file, variables, words)
        make = _csv if path.suffix == ".csv" else _parquet
        attributes = {name: str(value) for name, value in file.attrs.items()}
        with outputs.complete_or_absent(path, overwrite) as temporary:
            try:
                with make(temporary, columns, attributes) as write:
                    for chunk in grid_chunks(shape, chunk_cells):
                        write(_table(columns, shape, chunk))
                        if progress is not None:
                            progress(math.prod(part.stop - part.start for part in chunk.values()))
            except OSError as error:
                raise RunError(f"{path}: writing failed: {error.strerror or error}") from error
    return math.prod(shape.values())


def count_rows(source: Path, variables: Sequence[str] | None = None) -> int:
    """Return the number of rows that `export` makes; arguments and errors are its."""
    with result_file(source) as file:
        return math.prod(_columns(file, variables, False)[1].values())


def _columns(file: ResultFile, wanted: Sequence[str] | None, words: bool) -> tuple[list[Column], dict[str, int]]:
    """Choose the columns, coordinates first, and the grid they span."""
    chosen = list(dict.fromkeys(file.cells if wanted is None else wanted))
    for name in chosen:
        if name in file.unread:
            raise InputError(f"{file.path}: {name}: is of type {file.unread[name]}; must be numbers or text")
        if name not in file.results:
            raise InputError(f'{file.path}: no variable "{name}"; {did_you_mean(name, file.results)}')
    if not chosen:
        raise InputError(f"{file.path}: holds no results")
    dims = {dim for name in chosen for dim in file[name].dims}
    shape = {dim: length for dim, length in file.sizes.items() if dim in dims}
    beside = [name for name in file.coordinates if dims.issuperset(file[name].dims) and name not in MOTION_FILES]
    return [Column(file[name], words) for name in (*beside, *chosen)], shape


Cells = list[tuple[Column, np.ma.MaskedArray]]


def _table(columns: list[Column], shape: dict[str, int], chunk: dict[str, slice]) -> Cells:
    """Read a chunk of every column, each of them as broadcastable to the chunk."""
    table = []
    for column in columns:
        values = column.read(chunk)
        # another program may have put the dimensions of a variable into another order
        values = values.transpose([column.dims.index(dim) for dim in shape if dim in column.dims])
        lengths = [chunk[dim].stop - chunk[dim].start if dim in column.dims else 1 for dim in shape]
        table.append((column, values.reshape(lengths)))
    return table


def _chunk_shape(table: Cells) -> tuple[int, ...]:
    return np.broadcast_shapes(*(values.shape for _, values in table))


# --------------------------------------------------------------------------------- formats

Writer = Callable[[Cells], None]


@contextmanager
def _csv(path: Path, columns: list[Column], attributes: dict[str, str]) -> Iterator[Writer]:
    """Open a CSV file; what is yielded writes a chunk to it."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(column.header for column in columns)

        def write(table: Cells) -> None:
            shape = _chunk_shape(table)
            # a coordinate is put into text once a value, and then repeated
            texts = (np.broadcast_to(_text(values), shape).ravel().tolist() for _, values in table)
            writer.writerows(zip(*texts, strict=True))

        yield write


def _text(values: np.ma.MaskedArray) -> NDArray[Any]:
    """Write numbers with as few digits as bring them back exactly, missing ones as nothing."""
    # str() of a float has the digits of a double, those of a float32 are fewer
    numbers = values.data.ravel()
    text = np.array(list(map(str, numbers if values.dtype == np.float32 else numbers.tolist())), dtype=object)
    text = text.reshape(values.shape)
    text[np.ma.getmaskarray(values)] = ""
    return text


def _check_pyarrow(path: Path) -> None:
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        raise InputError(
            f"{path}: Parquet needs pyarrow: pip install 'slipsweep[parquet]', or give a name that ends in .csv"
        ) from None


@contextmanager
def _parquet(path: Path, columns: list[Column], attributes: dict[str, str]) -> Iterator[Writer]:
    """Open a Parquet file; what is yielded writes a chunk to it, as a row group."""
    import pyarrow
    from pyarrow import parquet

    def kind(column: Column) -> Any:
        if column.is_text:
            return pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
        return pyarrow.from_numpy_dtype(column.variable.dtype)

    about = ("long_name", "units", "flag_meanings")
    schema = pyarrow.schema(
        [
            pyarrow.field(
                c.header, kind(c), metadata={name: str(c.attributes[name]) for name in about if name in c.attributes}
            )
            for c in columns
        ],
        metadata=attributes,
    )
    with parquet.ParquetWriter(path, schema) as writer:

        def write(table: Cells) -> None:
            shape = _chunk_shape(table)
            arrays = []
            for (column, values), field in zip(table, schema, strict=True):
                flat, missing = (
                    np.ascontiguousarray(np.broadcast_to(part, shape)).ravel()
                    for part in (values.data, np.ma.getmaskarray(values))
                )
                plain = field.type.value_type if column.is_text else field.type
                array = pyarrow.array(flat, type=plain, mask=missing)
                arrays.append(array.dictionary_encode() if column.is_text else array)
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))

        yield write
