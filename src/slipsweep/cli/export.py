"""`slipsweep export`: a result as a long table."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.common import Overwrite, Quiet, examples, progress_bar

EXAMPLE = examples(
    "slipsweep export design_chart.nc -o table.parquet",
    "slipsweep export paper.nc -o paper.csv --words",
    "slipsweep export design_chart.nc -o table.csv --variable permanent_displacement --variable validity",
)


def export(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help="A file that slipsweep wrote.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Table to write: .csv or .parquet (needs pyarrow).")
    ],
    overwrite: Overwrite = False,
    variables: Annotated[
        list[str] | None,
        typer.Option("--variable", metavar="NAME", help="Result to export (default: all); may be repeated."),
    ] = None,
    words: Annotated[bool, typer.Option("--words", help="Sliding modes and flags as words instead of codes.")] = False,
    quiet: Quiet = False,
) -> None:
    """Write a result as a long table: a row a cell, coordinates as columns, units in the header."""
    from slipsweep.files import export as tables
    from slipsweep.grid.resources import size_text

    with progress_bar(tables.count_rows(file, variables or None), quiet, "rows") as progress:
        rows = tables.export(
            file, output, variables=variables or None, words=words, overwrite=overwrite, progress=progress
        )
    if not quiet:
        typer.echo(f"{output}  {rows} rows, {size_text(output.stat().st_size)}")
