"""`slipsweep export`: a result as a table."""

import functools
from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli import common
from slipsweep.cli.common import At, Overwrite, Panel, Quiet, command, cuts, echo, written

TABLE = Panel("Table")


@command(
    "Read results",
    "slipsweep export paper.nc -o paper.csv --words",
    "slipsweep export design_chart.nc -o t.parquet --at theta=5 --at amplitude=0.1g,0.2g,0.3g",
    "slipsweep export design_chart.nc -o t.xlsx --at theta=5 --at mu_s=0.4 --columns frequency",
)
def export(
    file: Annotated[str, typer.Argument(metavar="OUT.nc|OUT.zarr", help="A file that slipsweep wrote.")],
    output: Annotated[Path, written("Write .csv, .parquet, .xlsx or .xml.")],
    variables: Annotated[
        list[str] | None, TABLE("Result to export (default: all); may be repeated.", "--variable", metavar="NAME")
    ] = None,
    words: Annotated[bool, TABLE("Sliding modes and flags as words, not codes.", "--words")] = False,
    in_g: Annotated[bool, TABLE("Accelerations in g, not in m/s².", "--in-g")] = False,
    at: At = None,
    rows: Annotated[
        str | None, TABLE("With --columns: axes of the rows (default: all others).", metavar="NAME[,NAME]")
    ] = None,
    columns: Annotated[
        str | None, TABLE("Axis whose values become columns; one table per result.", metavar="NAME")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a result as a table: CSV, Parquet or .xlsx; or the fragility of a suite or of samples for OpenQuake (.xml).

    One row per case, coordinates as columns, units in the header; with --columns a table of one result over two axes.
    """
    if output.suffix == ".xml":
        _export_fragility(file, output, at, overwrite)
        echo(*([] if quiet else [output]))
        return
    from slipsweep.files import export as tables
    from slipsweep.grid.resources import size_text

    count = tables.export(
        file,
        output,
        variables=variables or None,
        words=words,
        in_g=in_g,
        at=cuts(at),
        rows=rows.split(",") if rows else (),
        columns=columns,
        overwrite=overwrite,
        progress=functools.partial(common.progress_bar, quiet=quiet, unit="rows"),
    )
    if not quiet:
        echo(f"{output}  {count} rows, {size_text(output.stat().st_size)}")


def _export_fragility(file: str, output: Path, at: list[str] | None, overwrite: bool) -> None:
    """Write P(u > d) along the axis amplitude, of the values that --at takes of others."""
    from slipsweep.files.opening import read_result
    from slipsweep.files.outputs import complete_or_absent
    from slipsweep.files.selection import selected

    common.check_outputs([output], (".xml",), overwrite, [Path(file)])
    chosen = selected(read_result(file), file, cuts(at), ("motion", "quantile"))
    with complete_or_absent(output, overwrite) as temporary:
        common.write_fragility(chosen, temporary)
