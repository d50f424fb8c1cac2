"""Results as tables in files: CSV, Parquet or a spreadsheet.

A file is read and written in chunks of `CHUNK_CELLS`, so that memory stays small whatever its size.
"""

import csv
import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.files import outputs, spreadsheet
from slipsweep.files.layout import Cells, Column, Layout, Writer, layouts
from slipsweep.files.results import result_file

#: Cells read at a time; text of ten columns takes a hundred times as many bytes.
CHUNK_CELLS = 2**18

#: Endings of tables, and for those that need one the module and the extra that brings it.
SUFFIXES = {".csv": None, ".parquet": ("pyarrow.parquet", "parquet"), ".xlsx": ("xlsxwriter", "xlsx")}

#: Told how many rows there are, yields what to call with a number of rows just written.
Progress = Callable[[int], AbstractContextManager[Callable[[int], None] | None]]


def export(
    source: Path,
    path: Path,
    *,
    variables: Sequence[str] | None = None,
    words: bool = False,
    at: Mapping[str, str] | None = None,
    rows: Sequence[str] = (),
    columns: str | None = None,
    overwrite: bool = False,
    chunk_cells: int = CHUNK_CELLS,
    progress: Progress | None = None,
) -> int:
    """Write a result of slipsweep as a table, complete or not at all.

    Rows of a long table are in the order of the file's dimensions, the last one running fastest; where a file has
    further dimensions than theta, mu_s, amplitude and frequency, in that order within chunks.

    Parameters
    ----------
    source : Path
        A netCDF file or a Zarr store that slipsweep wrote.
    path : Path
        The table: .csv (UTF-8; missing values are empty), .parquet (missing values are null) or .xlsx (missing values
        are empty cells; numbers have 16 digits; the sheet "about" has inputs, estimates, flags and provenance).
    variables : sequence of str, optional
        Results to export, by default all; their coordinates come along.  Dimensions that none of
        them has are left out, with their rows.
    words : bool
        Sliding modes and flags as words instead of codes.
    at : mapping of axis to text, optional
        Values to keep of an axis, see `slipsweep.files.cuts.stored_places`.
    rows : sequence of str
        With `columns`: the axes along the rows of a pivoted table, by default all others.
    columns : str, optional
        The axis along the columns of a pivoted table of one result; in .xlsx of a sheet for each.
    overwrite : bool
        Replace `path` if it exists.
    chunk_cells : int
        Cells read at a time, hence in memory.
    progress : callable, optional
        See `Progress`.

    Returns
    -------
    int
        The number of rows, of all sheets.

    Raises
    ------
    InputError
        `source` is not slipsweep's, `path` cannot be written or has another ending, a variable, axis or value is not
        in the file, a spreadsheet cannot hold the table, or the package is missing that writes it.
    RunError
        Writing failed.
    """
    _check_format(path)
    outputs.check_outputs([path], overwrite, reads=[source])
    with ExitStack() as stack:
        file = stack.enter_context(result_file(source))
        tables = layouts(file, variables, words, at or {}, rows, columns)
        make: Callable[[Path, list[Layout]], AbstractContextManager[list[Writer]]] = _csv
        if path.suffix == ".xlsx":
            spreadsheet.check_size(tables)
            make = spreadsheet.workbook
        elif len(tables) > 1:
            raise InputError(
                f"{path}: a table with --columns has one result; choose it with --variable "
                f"({', '.join(table.name for table in tables)}), or write .xlsx, which has a sheet for each"
            )
        elif path.suffix == ".parquet":
            make = _parquet
        total = sum(table.rows for table in tables)
        done = stack.enter_context(progress(total) if progress else nullcontext())
        temporary = stack.enter_context(outputs.complete_or_absent(path, overwrite))
        try:
            with make(temporary, tables) as writers:
                for table, write in zip(tables, writers, strict=True):
                    for chunk in table.chunks(chunk_cells):
                        write(chunk)
                        if done is not None:
                            done(chunk.rows)
        except OSError as error:
            raise RunError(f"{path}: writing failed: {error.strerror or error}") from error
    return total


def _check_format(path: Path) -> None:
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: the name must end in one of {', '.join(SUFFIXES)}")
    if (needed := SUFFIXES[path.suffix]) is None:
        return
    module, extra = needed
    try:
        importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise InputError(
            f"{path}: {path.suffix} needs {package}: pip install 'slipsweep[{extra}]', or give a name that ends in .csv"
        ) from None


# --------------------------------------------------------------------------------- formats


@contextmanager
def _csv(path: Path, tables: list[Layout]) -> Iterator[list[Writer]]:
    """Open a CSV file; what is yielded writes a chunk to it."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(field.header for field in tables[0].fields)

        yield [lambda cells: writer.writerows(cells.texts(_text))]


def _text(values: np.ma.MaskedArray) -> NDArray[Any]:
    """Write numbers with as few digits as bring them back exactly, missing ones as nothing."""
    # str() of a float has the digits of a double, those of a float32 are fewer
    numbers = values.data.ravel()
    text = np.array(list(map(str, numbers if values.dtype == np.float32 else numbers.tolist())), dtype=object)
    text = text.reshape(values.shape)
    text[np.ma.getmaskarray(values)] = ""
    return text


@contextmanager
def _parquet(path: Path, tables: list[Layout]) -> Iterator[list[Writer]]:
    """Open a Parquet file; what is yielded writes a chunk to it, as a row group."""
    import pyarrow
    from pyarrow import parquet

    fields = tables[0].fields

    def kind(column: Column) -> Any:
        if column.is_text:
            return pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
        return pyarrow.from_numpy_dtype(column.variable.dtype)

    def about(column: Column) -> dict[str, str]:
        told = ("long_name", "units", "flag_meanings")
        return {name: str(column.attributes[name]) for name in told if name in column.attributes}

    schema = pyarrow.schema(
        [pyarrow.field(str(one.header), kind(one.column), metadata=about(one.column)) for one in fields],
        metadata={name: str(value) for name, value in tables[0].file.attrs.items()},
    )
    with parquet.ParquetWriter(path, schema) as writer:

        def write(cells: Cells) -> None:
            arrays = []
            for field, values, typed in zip(fields, cells.columns, schema, strict=True):
                flat, missing = (
                    np.ascontiguousarray(np.broadcast_to(part, cells.shape)).ravel()
                    for part in (values.data, np.ma.getmaskarray(values))
                )
                plain = typed.type.value_type if field.column.is_text else typed.type
                array = pyarrow.array(flat, type=plain, mask=missing)
                arrays.append(array.dictionary_encode() if field.column.is_text else array)
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))

        yield [write]
