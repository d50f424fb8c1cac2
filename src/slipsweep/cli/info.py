"""`slipsweep info`: what a result holds."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.common import echo_tally, examples, place_of
from slipsweep.errors import InputError

EXAMPLE = examples("slipsweep info design_chart.nc", "slipsweep info history.nc")


def info(
    file: Annotated[str, typer.Argument(metavar="OUT.nc|OUT.zarr", help="A file that slipsweep wrote.")],
) -> None:
    """Show what a result holds, how it was made, and its shares of flags."""
    from slipsweep.files import contents
    from slipsweep.files.jobs import RUN
    from slipsweep.files.motions import read_embedded
    from slipsweep.files.opening import read_result
    from slipsweep.files.storing import nbytes_of
    from slipsweep.grid.resources import size_text
    from slipsweep.motion.records import Record

    table = read_result(file)
    _echo(f"{Path(file)}  {size_text(nbytes_of(place_of(file)))}")
    for title, entries in (
        ("coordinates", contents.coordinate_texts(table)),
        ("variables", contents.variable_texts(table)),
    ):
        typer.echo(f"{title}:")
        for name, text in entries.items():
            _echo(f"  {name:<23} {text}")
    recorded = read_embedded(table, Path(file))
    if isinstance(recorded, Record):
        _echo(f"record: {recorded.summary()}")
    motions = contents.motions_text(table)
    if motions:
        typer.echo("motions, as recorded:")
    for line in motions:
        _echo(f"  {line}")
    try:
        echo_tally(contents.tally_in(table))
    except InputError as error:
        _echo(f"modes and flags not counted: {error}")
    for name, value in table.attrs.items():
        lines = str(value).splitlines()
        if name != RUN:
            _echo(f"{name}: {lines[0] if len(lines) == 1 else ''}".rstrip())
            for line in lines if len(lines) > 1 else ():
                _echo(f"  {line}")


def _echo(line: str) -> None:
    """Print a line in which a file has words: what a terminal would obey (control sequences) is spelled out."""
    typer.echo("".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in line))
