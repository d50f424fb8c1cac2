"""`slipsweep info`: what a result holds."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.common import echo_tally, examples

EXAMPLE = examples("slipsweep info design_chart.nc", "slipsweep info history.nc")


def info(file: Annotated[Path, typer.Argument(metavar="OUT.nc", help="A file that slipsweep wrote.")]) -> None:
    """Show what a result holds, how it was made, and its shares of flags."""
    from slipsweep.files import results
    from slipsweep.grid.resources import size_text

    contents = results.read_contents(file)
    typer.echo(f"{contents.path}  {size_text(contents.nbytes)}")
    for title, entries in (("coordinates", contents.coordinates), ("variables", contents.variables)):
        typer.echo(f"{title}:")
        for name, text in entries.items():
            typer.echo(f"  {name:<23} {text}")
    if contents.motions:
        typer.echo("motions, as recorded:")
    for line in contents.motions:
        typer.echo(f"  {line}")
    if contents.tally is not None:
        echo_tally(contents.tally)
    else:
        typer.echo(f"modes and flags not counted: {contents.untold}")
    for name, text in contents.attributes.items():
        if "\n" in text:
            typer.echo(f"{name}:")
            typer.echo("".join(f"  {line}\n" for line in text.splitlines()), nl=False)
        else:
            typer.echo(f"{name}: {text}")
