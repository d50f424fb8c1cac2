"""`slipsweep export`: a result as a table, or its fragility for OpenQuake."""

import functools
from pathlib import Path
from typing import Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import echo
from slipsweep.cli.options import Text, Texts
from slipsweep.files import outputs
from slipsweep.grid.resources import size_text

TABLE = options.Panel("Table")


@options.command(
    "Read results",
    "slipsweep export paper.nc -o paper.csv --words",
    "slipsweep export design_chart.nc -o t.parquet --at theta=5 --at amplitude=0.1g,0.2g,0.3g",
    "slipsweep export design_chart.nc -o t.xlsx --at theta=5 --at mu_s=0.4 --columns frequency",
    "slipsweep export suite.nc -o t.xlsx --at mu_s=0.4 --equations jibson-2007",
)
def export(
    file: options.Result,
    output: Annotated[
        Path, options.written("Write .csv, .parquet, .xlsx (extras [parquet], [xlsx]) or .xml.")
    ],
    variables: Annotated[
        Texts, TABLE("Result to export (default: all); may be repeated.", "NAME", "--variable")
    ] = None,
    words: Annotated[
        bool, TABLE("Sliding modes and flags as words, not codes.", None, "--words")
    ] = False,
    in_g: Annotated[bool, TABLE("Accelerations in g, not in m/s².", None, "--in-g")] = False,
    at: options.At = None,
    rows: Annotated[
        Text, TABLE("With --columns: axes of the rows (default: all others).", "NAME[,NAME]")
    ] = None,
    columns: Annotated[
        Text, TABLE("Axis whose values become columns; one table per result.", "NAME")
    ] = None,
    equations: options.Equations = None,
    magnitude: options.Magnitude = None,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
) -> None:
    """Write a result as a table: CSV, Parquet, .xlsx; or its fragility for OpenQuake (.xml).

    One row per case, coordinates as columns, units in the header; with --columns a table of one
    result over two axes.  The fragility is that of a suite or of samples.
    """
    from slipsweep.files import export as tables
    from slipsweep.files import opening, selection

    if output.suffix == ".xml":
        from slipsweep.studies.hazard import fragility, openquake_fragility

        paths = outputs.check_outputs([output], overwrite, reads=[Path(file)], endings=(".xml",))
        # P(u > d) along the axis amplitude, of the values that --at takes of others
        chosen = selection.selected(
            opening.read_result(file), file, options.cuts(at), ("motion", "quantile")
        )
        common.write_outputs(
            paths, overwrite, chosen, xml=lambda: openquake_fragility(fragility(chosen))
        )
        echo(*([] if quiet else paths))
        return
    count = tables.export(
        file,
        output,
        variables=variables or None,
        words=words,
        in_g=in_g,
        at=options.cuts(at),
        rows=rows.split(",") if rows else (),
        columns=columns,
        equations=options.compared(equations, magnitude),
        magnitude=magnitude,
        overwrite=overwrite,
        progress=functools.partial(common.progress_bar, quiet=quiet, unit="rows"),
    )
    if not quiet:
        echo(f"{output}  {count} rows, {size_text(output.stat().st_size)}")
