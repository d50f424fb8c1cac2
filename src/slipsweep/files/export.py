"""Results as tables in files, by pandas: CSV, Parquet or a spreadsheet."""

import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from slipsweep._version import __version__
from slipsweep.errors import InputError, check_extra, did_you_mean
from slipsweep.files.netcdf import WITH_MISSING
from slipsweep.files.opening import read_result, result_names, values_text
from slipsweep.files.outputs import check_endings, check_outputs, complete_or_absent
from slipsweep.files.selection import axis_values, places_at
from slipsweep.grid.chunks import grid_chunks
from slipsweep.model.variables import (
    LIMIT_RESULTS,
    MOTION_FILES,
    PARAMETERS,
    RESULTS,
    UNFLAGGED_TEXT,
)
from slipsweep.studies.published_statistics import published_table
from slipsweep.studies.result_counts import tally_of

if TYPE_CHECKING:
    import pandas as pd

#: Cells read at a time; as text, ten columns take a hundred bytes a cell.
CHUNK_CELLS = 2**18

#: Endings of tables, the package that writes each, and the extra that brings it.
SUFFIXES = {
    ".csv": ("csv", ""),
    ".parquet": ("pyarrow", "parquet"),
    ".xlsx": ("xlsxwriter", "xlsx"),
}

#: Most rows, the header included, and most columns of a sheet of a spreadsheet.
MOST_ROWS = 1_048_576
MOST_COLUMNS = 16_384

#: Beginnings of texts that a spreadsheet takes for formulas when it opens a CSV file.
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")


def export(
    source: str | Path,
    path: Path,
    *,
    variables: Sequence[str] | None = None,
    words: bool = False,
    in_g: bool = False,
    at: Mapping[str, str] | None = None,
    rows: Sequence[str] = (),
    columns: str | None = None,
    equations: str | Sequence[str] = (),
    magnitude: float | None = None,
    overwrite: bool = False,
    progress: Callable[[int], AbstractContextManager[Callable[[int], None] | None]] | None = None,
) -> int:
    """Write a result of slipsweep as a table; return the number of rows, of all sheets.

    The file is complete, or not there.  The ending of `path` is one of `SUFFIXES`.  Results are
    `variables`, by default all; dimensions that none of them has are left out.  Sliding modes and
    flags are codes or `words`, accelerations in m/s² or `in_g`, the g of the model.  `at` selects
    values of axes, as `slipsweep.files.selection.places_at`.  With `columns`, the axis along the
    columns of a pivoted table, `rows` are the axes along its rows.  With `equations` a spreadsheet
    has a sheet of that name: `published_table`.  `progress` is called with the number of rows, and
    yields a function that is called with a number of rows just written.

    InputError: `source` was not written by slipsweep, `path` cannot be written, a variable, axis or
    value is not in the file, a spreadsheet cannot hold the table, or the package that writes it is
    missing.
    """
    _check_format(path)
    if equations and path.suffix != ".xlsx":
        raise InputError(f"{path}: --equations: are a sheet of their own: must end in .xlsx")
    check_outputs([path], overwrite, reads=[Path(source)])
    with read_result(source) as opened:
        whole = _in_g(opened) if in_g else opened
        chosen = list(dict.fromkeys(result_names(whole) if variables is None else variables))
        for name in chosen:
            if name not in whole.data_vars:
                raise InputError(
                    f'{source}: no variable "{name}"; '
                    f"{did_you_mean(name, [*map(str, whole.data_vars)])}"
                )
        part = whole[chosen]
        widest = max((result.dims for result in part.data_vars.values()), key=len)
        dims = list(dict.fromkeys(map(str, (*widest, *part.sizes))))
        part = part.isel(places_at(whole, source, at or {}, dims))
        if columns is None:
            if rows:
                raise InputError(
                    f"--rows {','.join(rows)}: needs --columns, the axis whose values become "
                    "columns"
                )
            tables = [Table(part, Path(str(source)).stem, words, dims)]
        else:
            along = _pivot_rows(part, source, dims, rows, columns)
            flat = {dim: 0 for dim in dims if dim not in (*along, columns)}
            tables = []
            for name in chosen:
                result = part[[name]].isel(flat, missing_dims="ignore")
                if columns not in result.sizes:
                    raise InputError(
                        f"{source}: --columns {columns}: not an axis of {name}; choose others with "
                        "--variable"
                    )
                tables.append(
                    Table(
                        result, name, words, [dim for dim in along if dim in result.sizes], columns
                    )
                )
        if path.suffix == ".xlsx":
            for table in tables:
                table.check_size(source)
        elif len(tables) > 1:
            raise InputError(
                f"{path}: a table with --columns has one result; choose it with --variable "
                f"({', '.join(table.name for table in tables)}), or write .xlsx, which has a sheet "
                "for each"
            )
        beside = None
        if equations:
            cut = opened.isel(places_at(opened, source, at or {}, dims))
            beside = published_table(cut, equations, magnitude)
        total = sum(table.count for table in tables)
        with (
            progress(total) if progress else nullcontext() as told,
            complete_or_absent(path, overwrite) as temporary,
        ):
            done = told or (lambda rows: None)
            if path.suffix == ".xlsx":
                _write_workbook(temporary, tables, source, done, beside)
            else:
                write = _write_csv if path.suffix == ".csv" else _write_parquet
                write(temporary, tables, source, done)
    return total


def _check_format(path: Path) -> None:
    """Raise InputError if the ending is not that of a table, or its package is missing."""
    check_endings([path], SUFFIXES)
    package, extra = SUFFIXES[path.suffix]
    what = f"{path}: a table in {path.suffix}"
    check_extra(what, extra, package, otherwise=", or give a name that ends in .csv")


def _in_g(table: xr.Dataset) -> xr.Dataset:
    """Return the table with accelerations in g."""
    converted = table.copy()
    for name, variable in table.variables.items():
        if variable.attrs.get("units") == "m s-2":
            converted[name] = (
                variable.dims,
                variable.values / float(table.attrs["g"]),
                {**variable.attrs, "units": "g"},
            )
    return converted


# ------------------------------------------------------------------------------- the tables


@dataclass(frozen=True)
class Table:
    """A table: results with one row a cell, or one result pivoted."""

    part: xr.Dataset  # the exported part of the results; one result in a pivoted table
    name: str
    words: bool  # instead of codes
    rows: list[str]  # dimensions along the rows
    columns: str | None = None  # the dimension along the columns of a pivoted table

    @property
    def count(self) -> int:
        """Number of rows."""
        return math.prod(self.part.sizes[dim] for dim in self.rows)

    @cached_property
    def left(self) -> list[str]:
        """Coordinates along the rows; a table that is not pivoted also has those of one value."""
        coords = self.part.drop_vars(MOTION_FILES, errors="ignore").coords
        names = [name for name in dict.fromkeys((*PARAMETERS, *map(str, coords))) if name in coords]
        return [
            name
            for name in names
            if {*coords[name].dims} <= {*self.rows} and (coords[name].dims or not self.columns)
        ]

    def check_size(self, source: object) -> None:
        """Raise InputError if a sheet of a spreadsheet cannot hold the table."""
        width = len(self.left) + (
            self.part.sizes[self.columns] if self.columns else len(self.part.data_vars)
        )
        if width > MOST_COLUMNS or self.count >= MOST_ROWS:
            sizes = " x ".join(f"{self.part.sizes[dim]} {dim}" for dim in self.rows)
            raise InputError(
                f"{source}: the table has {self.count} rows ({sizes}) and {width} columns, a sheet "
                f"of .xlsx {MOST_ROWS} with its header and {MOST_COLUMNS}; take fewer values with "
                "--at, or write .csv"
            )

    def frames(self, cells: int) -> "Iterator[pd.DataFrame]":
        """Yield the table in pieces of so many cells."""
        import pandas as pd

        across = self.part.sizes[self.columns] if self.columns else 1
        for chunk in grid_chunks(
            {dim: self.part.sizes[dim] for dim in self.rows}, max(1, cells // across)
        ):
            part = self.part.isel(chunk).load()
            shape = {dim: part.sizes[dim] for dim in self.rows}
            columns = {
                header(part[name]): part[name].variable.set_dims(shape).values.ravel()
                for name in self.left
            }
            shown: dict[Any, xr.DataArray] = {
                header(result): result for result in part.data_vars.values()
            }
            if self.columns is not None:
                ((title, result),) = shown.items()
                last = header(part[self.left[-1]]) if self.left else ""
                corner = f"{last} \\ {self._across(self.columns, title)}"
                columns[corner] = columns.pop(last, np.arange(1, 1 + math.prod(shape.values())))
                values = axis_values(part, self.columns)
                shown = {
                    value: result.isel({self.columns: place}) for place, value in enumerate(values)
                }
            for title, result in shown.items():
                columns[title] = self._column(
                    result, result.variable.set_dims(shape).values.ravel()
                )
            yield pd.DataFrame(columns)

    def _across(self, columns: str, result: str) -> str:
        """Return the heading of a pivoted table: its columns, its result, and single values."""
        coords = self.part.coords
        single = [
            name
            for name, coordinate in coords.items()
            if coordinate.size == 1 and name not in (*self.rows, columns)
        ]
        at = ", ".join(f"{name} = {values_text(coords[name])}" for name in single)
        across = header(coords[columns]) if columns in coords else columns
        return f"{across}: {result}" + (f" at {at}" if at else "")

    def _column(self, result: xr.DataArray, values: Any) -> Any:
        """Return the values of a result as a table has them: missing codes empty, or words."""
        import pandas as pd

        if result.name == "validity" and values.dtype.kind == "f":  # some have lost their flags
            missing = np.isnan(values)
            values = np.where(missing, 0, values).astype(np.int16)
        elif values.dtype.kind not in "iu":
            return values
        else:
            missing = (values == -1) & (result.name in WITH_MISSING)
        about = (LIMIT_RESULTS | RESULTS).get(str(result.name), {}) | result.attrs
        if self.words and "flag_meanings" in about:
            return (
                pd.Series(values, dtype=object)
                .map(_spelled(about, np.unique(values)))
                .mask(missing)
            )
        return (
            pd.Series(values, dtype=values.dtype.name.capitalize()).mask(missing)
            if missing.any()
            else values
        )


def header(variable: xr.DataArray) -> str:
    """Return the heading of a column: a name and its unit."""
    return (
        f"{variable.name} ({variable.attrs['units']})"
        if "units" in variable.attrs
        else str(variable.name)
    )


def _spelled(about: Mapping[str, Any], codes: Any) -> dict[Any, str]:
    """Return the words of codes, from the attributes of a variable; several flags are joined."""
    flag_codes = (
        np.atleast_1d(about.get("flag_masks", about.get("flag_values", ()))).astype(int).tolist()
    )
    words = list(zip(flag_codes, str(about["flag_meanings"]).split(), strict=False))
    if "flag_masks" in about:
        return {code: " ".join(word for mask, word in words if code & mask) for code in codes}
    return {code: dict(words).get(int(code), str(code)) for code in codes}


def _pivot_rows(
    part: xr.Dataset, source: object, dims: Sequence[str], rows: Sequence[str], columns: str
) -> list[str]:
    """Return the dimensions along the rows of a pivoted table (InputError: they do not fit)."""
    for option, name in (*(("--rows", name) for name in rows), ("--columns", columns)):
        if name not in dims:
            raise InputError(
                f"{source}: {option} {name}: no such axis here; {did_you_mean(name, dims)}"
            )
    if columns in rows or len({*rows}) < len(rows):
        raise InputError(f"--rows {','.join(rows)} --columns {columns}: must be different axes")
    wide = [dim for dim in dims if dim not in (*rows, columns) and part.sizes[dim] > 1]
    if not rows and not wide:
        raise InputError(
            f"{source}: --columns {columns}: no other axis has more than one value, none is left "
            "for rows"
        )
    if rows and wide:
        texts = ", ".join(f"{dim} ({part.sizes[dim]} values)" for dim in wide)
        raise InputError(
            f"{source}: neither in --rows nor in --columns: {texts}; take one value of it with --at"
        )
    return list(rows) or wide


# --------------------------------------------------------------------------------- formats


def _write_csv(
    path: Path, tables: list[Table], source: object, done: Callable[[int], None]
) -> None:
    (table,) = tables
    with path.open("w", encoding="utf-8", newline="") as file:
        for number, frame in enumerate(table.frames(CHUNK_CELLS)):
            for name in frame.select_dtypes(["object", "string"]):
                frame[name] = frame[name].map(
                    lambda text: (
                        f"'{text}" if isinstance(text, str) and text.startswith(_FORMULAS) else text
                    )
                )
            frame.to_csv(file, index=False, header=number == 0, lineterminator="\n")
            done(len(frame))


def _write_parquet(
    path: Path, tables: list[Table], source: object, done: Callable[[int], None]
) -> None:
    import pyarrow
    from pyarrow import parquet

    (table,) = tables
    first = pyarrow.Table.from_pandas(
        next(table.frames(1)).rename(columns=str), preserve_index=False
    ).schema
    about = {
        header(table.part[name]): table.part[name].attrs
        for name in (*table.left, *table.part.data_vars)
    }
    fields = [
        field.with_metadata({key: str(value) for key, value in about.get(field.name, {}).items()})
        for field in first
    ]
    schema = pyarrow.schema(fields, {name: str(value) for name, value in table.part.attrs.items()})
    with parquet.ParquetWriter(path, schema) as writer:
        for frame in table.frames(CHUNK_CELLS):
            writer.write_table(
                pyarrow.Table.from_pandas(frame.rename(columns=str), schema, preserve_index=False)
            )
            done(len(frame))


def _write_workbook(
    path: Path,
    tables: list[Table],
    source: object,
    done: Callable[[int], None],
    beside: "pd.DataFrame | None",
) -> None:
    import pandas as pd

    # written to memory: on a full disk zipfile of Python 3.13 would print a traceback beside the
    # error
    options = {
        "strings_to_formulas": False,
        "strings_to_urls": False,
        "nan_inf_to_errors": True,
        "in_memory": True,
    }
    whole = io.BytesIO()
    with pd.ExcelWriter(whole, engine="xlsxwriter", engine_kwargs={"options": options}) as book:
        for table in tables:
            start = 0
            for frame in table.frames(CHUNK_CELLS):
                # the shortest digits of single precision, not 0.10000000149
                for name in frame.select_dtypes("float32"):
                    frame[name] = frame[name].astype(str).astype(float)
                frame.to_excel(
                    book, sheet_name=table.name[:31], startrow=start, header=start == 0, index=False
                )
                start += len(frame) + (start == 0)
                done(len(frame))
        if beside is not None:
            beside.to_excel(book, sheet_name="equations", index=False)
            book.sheets["equations"].set_column(0, beside.shape[1] - 1, 16)
        pd.DataFrame(_about(tables, source)).to_excel(
            book, sheet_name="about", header=False, index=False
        )
        book.sheets["about"].set_column(0, 1, 40)
    path.write_bytes(whole.getvalue())


def _about(tables: list[Table], source: object) -> list[tuple[str, str]]:
    """Return names and texts on a table: its results, inputs and flags, and all attributes."""
    part = tables[0].part
    results = [result for table in tables for result in table.part.data_vars.values()]
    rows = [("file", str(source)), ("table written by", f"slipsweep {__version__}")]
    rows += [(header(variable), str(variable.attrs.get("long_name", ""))) for variable in results]
    rows += [
        (str(variable.attrs.get("long_name", name)), values_text(variable))
        for name, variable in part.coords.items()
    ]
    for table in tables:
        if "validity" in table.part:
            tally = tally_of(table.part[["validity"]])
            for flag, count in (tally.flags or {}).items():
                share = f"{tally.share(count):.2%} of {tally.cells} cells"
                rows.append(
                    (
                        f"{int(flag)} {(flag.name or '').lower()}",
                        f"{flag.kind}: {share}; {flag.text}",
                    )
                )
            if tally.unflagged:
                share = f"{tally.share(tally.unflagged):.2%} of {tally.cells} cells"
                rows.append(("flags not known", f"{share}; {UNFLAGGED_TEXT}"))
    for name, text in part.attrs.items():  # line by line: a cell does not hold a long text
        rows += [("" if at else str(name), line) for at, line in enumerate(str(text).splitlines())]
    return rows
