"""`slipsweep info`: what a result holds."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.common import LENGTH, At, command, cuts, echo, echo_suite, echo_tally
from slipsweep.errors import InputError


@command("Read results", "slipsweep info design_chart.nc", "slipsweep info suite.nc -d 50mm --at mu_s=0.4")
def info(
    file: Annotated[str, typer.Argument(metavar="OUT.nc|OUT.zarr", help="A file that slipsweep wrote.")],
    displacement: Annotated[list[str] | None, LENGTH] = None,
    at: At = None,
) -> None:
    """Show what a result holds, how it was made, its shares of flags, and the statistics of a suite."""
    from slipsweep.files import contents
    from slipsweep.files.jobs import RUN
    from slipsweep.files.motions import read_embedded
    from slipsweep.files.opening import place_of, read_result
    from slipsweep.files.selection import selected
    from slipsweep.files.storing import nbytes_of
    from slipsweep.grid.resources import size_text
    from slipsweep.motion.records import Record

    table = read_result(file)
    echo(f"{Path(file)}  {size_text(nbytes_of(place_of(file)))}")
    echo("coordinates:", *(f"  {name:<23} {text}" for name, text in contents.coordinate_texts(table).items()))
    echo("variables:", *(f"  {name:<23} {text}" for name, text in contents.variable_texts(table).items()))
    recorded = read_embedded(table, Path(file))
    if isinstance(recorded, Record):
        echo(f"record: {recorded.summary()}")
    if motions := contents.motions_text(table):
        echo("motions, as recorded:", *(f"  {line}" for line in motions))
    try:
        echo_tally(contents.tally_in(table))
    except InputError as error:
        echo(f"modes and flags not counted: {error}")
    if displacement and table.sizes.get("motion", 1) < 2 and "displacement_quantile" not in table:
        raise InputError(f"{file}: --displacement: is for results of a suite of motions, or of uncertain inputs")
    echo_suite(selected(table, file, cuts(at), ("motion", "quantile", "threshold")), most=100, typed=displacement)
    for name, value in table.attrs.items():
        lines = str(value).splitlines()
        if name != RUN:
            one = len(lines) == 1
            echo(f"{name}: {lines[0]}".rstrip() if one else f"{name}:", *(f"  {line}" for line in lines if not one))
