"""Results as long tables, CSV or Parquet: a row a cell, its coordinates in columns, units in the header.

A file is read and written in blocks of `BLOCK_CELLS`, so that memory stays small whatever its size.
"""

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files import netcdf, outputs
from slipsweep.grid.blocks import grid_blocks
from slipsweep.model.suggest import did_you_mean

#: Rows made at a time; text of ten columns takes a hundred times as many bytes.
BLOCK_CELLS = 2**18

SUFFIXES = (".csv", ".parquet")


class Column:
    """A variable of the file as a column: its values or, for flags, their codes or words.

    Parameters
    ----------
    variable : netCDF4.Variable
    words : bool
        Flags as words of `flag_meanings`; several are put one after the other, with spaces.
    """

    def __init__(self, variable: netCDF4.Variable, words: bool) -> None:
        variable.set_auto_maskandscale(False)
        variable.set_auto_chartostring(False)
        self.variable = variable
        self.is_text = variable.dtype == "S1"
        self.dims = tuple(variable.dimensions[: -1 if self.is_text else None])
        self.attributes = {name: variable.getncattr(name) for name in variable.ncattrs()}
        units = self.attributes.get("units")
        self.header = f"{variable.name} ({units})" if units else str(variable.name)
        self.words = words and "flag_meanings" in self.attributes
        # codes without a value; a floating-point value is missing as NaN
        self.fill = self.attributes.get("_FillValue") if variable.dtype.kind == "i" else None

    def read(self, block: dict[str, slice]) -> NDArray[Any]:
        """Read the part of a block: an array whose dimensions are `dims`; words are objects, None where missing."""
        values = self.variable[tuple(block[dim] for dim in self.dims) or ...]
        if self.is_text:
            return np.asarray(netCDF4.chartostring(values, "utf-8"), dtype=object)
        return self.in_words(values) if self.words else np.asarray(values)

    def in_words(self, codes: NDArray[Any]) -> NDArray[Any]:
        """Replace codes by words; the few that occur are spelled out once each."""
        occurring, places = np.unique(codes, return_inverse=True)
        meanings = self.attributes["flag_meanings"].split()
        spelled = np.empty(occurring.size, dtype=object)
        for place, code in enumerate(occurring.tolist()):
            if "flag_masks" in self.attributes:
                masks = np.atleast_1d(self.attributes["flag_masks"])
                spelled[place] = " ".join(w for w, mask in zip(meanings, masks, strict=True) if code & int(mask))
            else:
                known = dict(zip(np.atleast_1d(self.attributes["flag_values"]).tolist(), meanings, strict=True))
                spelled[place] = known.get(code)
        return spelled[places.reshape(codes.shape)]

    def missing(self, values: NDArray[Any]) -> NDArray[np.bool_]:
        """Tell where there is no value."""
        if values.dtype.kind == "f":
            return np.isnan(values)
        if values.dtype.kind == "O":
            return np.frompyfunc(lambda word: word is None, 1, 1)(values).astype(bool)
        return np.zeros(values.shape, bool) if self.fill is None else values == self.fill


def export(
    source: Path,
    path: Path,
    *,
    variables: Sequence[str] | None = None,
    words: bool = False,
    overwrite: bool = False,
    block_cells: int = BLOCK_CELLS,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Write a result of slipsweep as a long table, complete or not at all.

    Rows are in the order of the file's dimensions, the last one running fastest; where a file has
    further dimensions than theta, mu_s, amplitude and frequency, in that order within blocks.

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
    block_cells : int
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
    with netcdf.open_result(source) as file:
        columns, shape = _columns(file, source, variables, words)
        make = _csv if path.suffix == ".csv" else _parquet
        attributes = {name: str(file.getncattr(name)) for name in file.ncattrs()}
        with outputs.complete_or_absent(path, overwrite) as temporary:
            try:
                with make(temporary, columns, attributes) as write:
                    for block in grid_blocks(shape, block_cells) if shape else [{}]:
                        write(_table(columns, shape, block))
                        if progress is not None:
                            progress(math.prod(part.stop - part.start for part in block.values()))
            except OSError as error:
                raise RunError(f"{path}: writing failed: {error.strerror or error}") from error
    return math.prod(shape.values())


def count_rows(source: Path, variables: Sequence[str] | None = None) -> int:
    """Return the number of rows that `export` makes; arguments and errors are its."""
    with netcdf.open_result(source) as file:
        return math.prod(_columns(file, source, variables, False)[1].values())


def _columns(
    file: netCDF4.Dataset, source: Path, wanted: Sequence[str] | None, words: bool
) -> tuple[list[Column], dict[str, int]]:
    """Choose the columns, coordinates first, and the grid they span."""
    coordinates = netcdf.coordinate_names(file)
    results = [name for name in file.variables if name not in coordinates]
    # the samples of a record are no cells: they are exported if asked for
    cells = [name for name in results if netcdf.RECORD_DIM not in file[name].dimensions]
    chosen = list(dict.fromkeys(cells if wanted is None else wanted))
    for name in chosen:
        if name not in results:
            raise InputError(f'{source}: no variable "{name}"; {did_you_mean(name, results)}')
    dims = {dim for name in chosen for dim in file[name].dimensions}
    shape = {dim: len(file.dimensions[dim]) for dim in file.dimensions if dim in dims}
    beside = [Column(file[name], words) for name in file.variables if name in coordinates]
    return [c for c in beside if {*c.dims} <= dims] + [Column(file[name], words) for name in chosen], shape


def _table(columns: list[Column], shape: dict[str, int], block: dict[str, slice]) -> list[tuple[Column, NDArray[Any]]]:
    """Read a block of every column, each of them as broadcastable to the block."""
    table = []
    for column in columns:
        values = column.read(block)
        lengths = dict(zip(column.dims, values.shape, strict=True))
        # the dimensions of a variable of slipsweep are in the order of the file
        table.append((column, values.reshape([lengths.get(dim, 1) for dim in shape])))
    return table


def _block_shape(table: list[tuple[Column, NDArray[Any]]]) -> tuple[int, ...]:
    return np.broadcast_shapes(*(values.shape for _, values in table))


# --------------------------------------------------------------------------------- formats

Writer = Callable[[list[tuple[Column, NDArray[Any]]]], None]


@contextmanager
def _csv(path: Path, columns: list[Column], attributes: dict[str, str]) -> Iterator[Writer]:
    """Open a CSV file; what is yielded writes a block to it."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(column.header for column in columns)

        def write(table: list[tuple[Column, NDArray[Any]]]) -> None:
            shape = _block_shape(table)
            # a coordinate is put into text once a value, and then repeated
            texts = (np.broadcast_to(_text(column, values), shape).ravel().tolist() for column, values in table)
            writer.writerows(zip(*texts, strict=True))

        yield write


def _text(column: Column, values: NDArray[Any]) -> NDArray[Any]:
    """Write numbers with as few digits as bring them back exactly, missing ones as nothing."""
    # str() of a float has the digits of a double, those of a float32 are fewer
    exact = values.dtype != np.float32
    text = np.array(list(map(str, values.ravel().tolist() if exact else values.ravel())), dtype=object)
    text = text.reshape(values.shape)
    text[column.missing(values)] = ""
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
    """Open a Parquet file; what is yielded writes a block to it, as a row group."""
    import pyarrow
    from pyarrow import parquet

    def kind(column: Column) -> Any:
        if column.is_text or column.words:
            return pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
        return pyarrow.from_numpy_dtype(column.variable.dtype)

    about = ("long_name", "units", "flag_meanings")
    schema = pyarrow.schema(
        [
            pyarrow.field(
                c.header, kind(c), metadata={name: c.attributes[name] for name in about if name in c.attributes}
            )
            for c in columns
        ],
        metadata=attributes,
    )
    with parquet.ParquetWriter(path, schema) as writer:

        def write(table: list[tuple[Column, NDArray[Any]]]) -> None:
            shape = _block_shape(table)
            arrays = []
            for (column, values), field in zip(table, schema, strict=True):
                flat, missing = (
                    np.ascontiguousarray(np.broadcast_to(a, shape)).ravel() for a in (values, column.missing(values))
                )
                plain = field.type.value_type if values.dtype.kind == "O" else field.type
                array = pyarrow.array(flat, type=plain, mask=missing)
                arrays.append(array.dictionary_encode() if values.dtype.kind == "O" else array)
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))

        yield write
