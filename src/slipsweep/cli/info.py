"""`slipsweep info` and `slipsweep export`: what a result holds, in words and as a table."""

import functools
from pathlib import Path
from typing import Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import echo
from slipsweep.cli.options import Text, Texts
from slipsweep.errors import InputError
from slipsweep.files import outputs
from slipsweep.grid.resources import size_text

TABLE = options.Panel("Table")


@options.command(
    "Read results",
    "slipsweep info design_chart.nc",
    "slipsweep info suite.nc -d 50mm --at mu_s=0.4",
    "slipsweep info suite.nc -d 50mm --at mu_s=0.4 --equations jibson-2007",
)
def info(
    file: options.Result,
    displacement: Annotated[Texts, options.LENGTH] = None,
    at: options.At = None,
    equations: options.Equations = None,
    magnitude: options.Magnitude = None,
) -> None:
    """Show what a result holds, how it was made, its shares of flags, and the statistics of a suite."""
    from slipsweep.files import jobs, motions, opening, selection, storing
    from slipsweep.grid.tally import tally_of
    from slipsweep.motion.records import Record
    from slipsweep.motion.suites import Suite
    from slipsweep.studies.cautions import slides_back_text

    beside = options.compared(equations, magnitude)
    table = opening.read_result(file)
    echo(f"{Path(file)}  {size_text(storing.nbytes_of(opening.place_of(file)))}")
    echo(
        "coordinates:",
        *(f"  {name:<23} {text}" for name, text in opening.coordinate_texts(table).items()),
    )
    echo(
        "variables:",
        *(f"  {name:<23} {text}" for name, text in opening.variable_texts(table).items()),
    )
    recorded = motions.read_embedded(table, Path(file))
    if isinstance(recorded, Record):
        echo(f"record: {recorded.summary()}")
    if rows := opening.motions_text(table):
        echo("motions, as recorded:", *(f"  {row}" for row in rows))
    if isinstance(recorded, Suite):
        echo(*recorded.cautions())
    try:
        common.echo_tally(tally_of(table))
    except InputError as error:
        echo(f"modes and flags not counted: {error}")
    common.echo_unsound(table)
    if slides_back := slides_back_text(table, recorded):
        echo(f"caution: {slides_back}")
    has_statistics = table.sizes.get("motion", 1) > 1 or "displacement_quantile" in table
    if displacement and not (has_statistics or beside):
        raise InputError(
            f"{file}: --displacement: is for results of a suite of motions, or of uncertain inputs"
        )
    chosen = selection.selected(table, file, options.cuts(at), ("motion", "quantile", "threshold"))
    common.echo_suite(chosen, most=100, typed=displacement)
    if beside:
        from slipsweep.studies.published_statistics import published_lines

        g = float(table.attrs["g"])
        lengths = options.displacements(displacement, g) if displacement else None
        echo(*published_lines(chosen, beside, magnitude, lengths))
    for name, value in table.attrs.items():
        lines = str(value).splitlines()
        if name not in (jobs.RUN, common.UNSOUND):
            echo(
                f"{name}: {lines[0]}".rstrip()
                if len(lines) == 1
                else "\n  ".join((f"{name}:", *lines))
            )


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
    """Write a result as a table: CSV, Parquet or .xlsx; or the fragility of a suite or of samples for OpenQuake (.xml).

    One row per case, coordinates as columns, units in the header; with --columns a table of one
    result over two axes.
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
