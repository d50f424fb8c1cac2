"""`slipsweep info`: the contents of a result, in words."""

from pathlib import Path
from typing import Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import echo
from slipsweep.cli.options import Texts
from slipsweep.errors import InputError
from slipsweep.grid.resources import size_text


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
    """Show what a result holds, how it was made, shares of flags, and statistics of a suite."""
    from slipsweep.files import jobs, motions, opening, selection, storing
    from slipsweep.motion.records import Record
    from slipsweep.motion.suites import Suite
    from slipsweep.studies.cautions import slides_back_text
    from slipsweep.studies.result_counts import tally_of

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
