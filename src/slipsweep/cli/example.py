"""`slipsweep example`: the sweep files that come with slipsweep."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.common import Overwrite, echo
from slipsweep.cli.help import examples

EXAMPLE = examples("slipsweep example", "slipsweep example paper")


def example(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Sweep file to write (default: list their names).")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """List the sweep files that come with slipsweep, or write one with its data."""
    from slipsweep.files import shipped

    if name is None:
        for one, title in shipped.titles().items():
            echo(f"{one:<14}{title}")
        return
    for path in shipped.write(name, Path(), overwrite=overwrite):
        echo(path)
