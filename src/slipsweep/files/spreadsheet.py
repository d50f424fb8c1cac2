"""Tables as sheets of an .xlsx file, and a sheet that says what they were computed of."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.files.contents import RUN
from slipsweep.files.layout import Cells, Layout, Writer
from slipsweep.files.results import ResultFile, cut_chunks, values_text
from slipsweep.grid.tally import Tally
from slipsweep.model.variables import FLAG_KINDS, VALIDITY_TEXT

#: What a sheet can hold, the header included.
MOST_ROWS, MOST_COLUMNS = 1_048_576, 16_384

#: Letters that a sheet's name, and a cell, can hold.
_LONGEST_NAME, _LONGEST = 31, 32_767

#: Attributes that say where a result comes from; the others say what was computed.
_PROVENANCE = ("source", "history", "references", "Conventions", "sweep")

#: Attributes that say which parameters of friction were given, and which estimated.
_ESTIMATES = "friction_inputs"


def check_size(tables: list[Layout]) -> None:
    """Refuse a table that a sheet cannot hold (InputError), and say what to cut."""
    for table in tables:
        path = table.file.path
        columns = len(table.fields)
        if columns > MOST_COLUMNS:
            raise InputError(
                f"{path}: the table has {columns} columns, a sheet of .xlsx {MOST_COLUMNS}; give fewer values of "
                f"{table.across} with --at, another axis with --columns, or write .csv"
            )
        if table.rows > MOST_ROWS - 1:
            raise InputError(
                f"{path}: the table has {table.rows} rows, a sheet of .xlsx {MOST_ROWS} with its header; "
                f"{_what_to_cut(table.shape, table.rows)} with --at, or write .csv"
            )


def _what_to_cut(shape: Mapping[str, int], rows: int) -> str:
    """The axes of which one value makes a table small enough: any one of some, or the longest together."""
    longest = sorted(shape, key=lambda dim: -shape[dim])
    one_is_enough = [dim for dim in longest if rows // shape[dim] < MOST_ROWS]
    if one_is_enough:
        return f"take one value of {' or '.join(f'{dim} ({shape[dim]})' for dim in one_is_enough)}"
    taken = []
    for dim in longest:
        taken.append(f"{dim} ({shape[dim]})")
        rows //= shape[dim]
        if rows < MOST_ROWS:
            break
    return f"take one value each of {', '.join(taken)}"


@contextmanager
def workbook(path: Path, tables: list[Layout]) -> Iterator[list[Writer]]:
    """Open an .xlsx file with a sheet for each table; what is yielded writes chunks to them."""
    import xlsxwriter
    from xlsxwriter.exceptions import XlsxWriterException

    with TemporaryDirectory(prefix="slipsweep-") as folder:
        # rows go to files in this folder as they come: memory stays small
        book = xlsxwriter.Workbook(path, {"constant_memory": True, "tmpdir": folder})
        bold = book.add_format({"bold": True, "text_wrap": True, "valign": "top"})
        yield [_table(book, table, bold) for table in tables]
        _about(book, tables, bold, f"XlsxWriter {xlsxwriter.__version__}")
        try:
            book.close()
        except XlsxWriterException as error:
            raise OSError(str(error)) from error


def _table(book: Any, table: Layout, bold: Any) -> Writer:
    """Add a sheet with the header of a table; return what writes a chunk below it."""
    sheet = book.add_worksheet(table.name[:_LONGEST_NAME])
    sheet.set_column(0, len(table.left), 16)
    sheet.freeze_panes(1, len(table.left) if table.across else 0)
    for column, field in enumerate(table.fields):
        _put(sheet, 0, column, field.header, bold)
    below = 1

    def write(cells: Cells) -> None:
        nonlocal below
        for row in cells.texts(_values):
            for column, value in enumerate(row):
                _put(sheet, below, column, value)
            below += 1

    return write


def _values(values: np.ma.MaskedArray) -> NDArray[Any]:
    """Numbers and texts as cells take them; None for what is missing."""
    if values.dtype == np.float32:  # its shortest digits: those of a double would be 0.10000000149
        found = np.array([float(str(one)) for one in values.data.ravel()], dtype=object).reshape(values.shape)
    else:
        found = values.data.astype(object)
    found[np.ma.getmaskarray(values)] = None
    return found


def _put(sheet: Any, row: int, column: int, value: str | float | None, look: Any = None) -> None:
    """Write a cell: a text is never a formula, and what is no finite number is a text."""
    if value is None:
        return
    if isinstance(value, str):
        sheet.write_string(row, column, value[:_LONGEST], look)
    elif math.isfinite(value):
        sheet.write_number(row, column, value, look)
    else:
        sheet.write_string(row, column, str(value), look)


# ----------------------------------------------------------------------------- what it is of


def _about(book: Any, tables: list[Layout], bold: Any, writer: str) -> None:
    sheet = book.add_worksheet("about")
    sheet.set_column(0, 0, 28)
    sheet.set_column(1, 1, 100)
    row = 0
    for heading, lines in _sections(tables, writer).items():
        _put(sheet, row, 0, heading, bold)
        for name, text in lines:
            row += 1
            _put(sheet, row, 0, name)
            _put(sheet, row, 1, text)
        row += 2


def _sections(tables: list[Layout], writer: str) -> dict[str, list[tuple[str, str]]]:
    """Lines of name and text under headings."""
    file, attrs = tables[0].file, tables[0].file.attrs
    results = {field.column.variable.name: field.column for table in tables for field in table.right}
    settings = {name: str(value) for name, value in attrs.items() if name not in (*_PROVENANCE, _ESTIMATES, RUN)}
    return {
        "Results": [(column.header, str(column.attributes.get("long_name", ""))) for column in results.values()],
        "Inputs": [*_inputs(tables[0]), *settings.items()],
        "Estimates": [("friction parameters", str(attrs.get(_ESTIMATES, "not known")))],
        "Flags": _flags(tables[0]),
        "Provenance": [
            ("file", str(file.path)),
            ("solved by", str(attrs.get("source", "not known"))),
            ("table written by", f"slipsweep {__version__}, {writer}"),
            ("reference", str(attrs.get("references", ""))),
            *_lines("history", attrs),
            *_lines("sweep", attrs),
        ],
    }


def _lines(name: str, attrs: Mapping[str, Any]) -> list[tuple[str, str]]:
    """A text of the file, line by line: a cell does not hold a long one."""
    return [("" if at else name, line) for at, line in enumerate(str(attrs.get(name, "")).splitlines())]


def _inputs(table: Layout) -> list[tuple[str, str]]:
    """The coordinates of a table: their values, and of axes that are cut those that are kept."""
    file, where = table.file, table.where
    dims = {*table.shape, *([table.across] if table.across else [])}
    names = [name for name in file.coordinates if dims.issuperset(file[name].dims)]
    return [
        (
            str(file[name].attrs.get("long_name", name)),
            values_text(file[name], {dim: where[dim] for dim in file[name].dims if dim in where}),
        )
        for name in names
    ]


def _flags(table: Layout) -> list[tuple[str, str]]:
    """The share of the table's cells that has each flag."""
    file = table.file
    if "validity" not in file.results:
        return [("validity", "not in the file")]
    tally = count_flags(file, table.where)
    return [
        (
            f"{int(flag)} {(flag.name or '').lower()}",
            f"{FLAG_KINDS[flag]}: {tally.share(count):.2%} of {tally.cells} cells; {VALIDITY_TEXT[flag]}",
        )
        for flag, count in (tally.flags or {}).items()
    ]


def count_flags(file: ResultFile, where: Mapping[str, NDArray[np.intp]]) -> Tally:
    """Count the flags of a part of a result."""
    variable, tally = file["validity"], Tally()
    for part, shape in cut_chunks(variable.sizes, where):
        tally.cells += math.prod(shape.values())
        tally.add({"validity": variable.read_codes(part, 0)})
    return tally
