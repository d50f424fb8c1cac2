"""`slipsweep verify`: a result checked against its checksums."""

from typing import Annotated

import typer

EXAMPLE = "Example: slipsweep verify design_chart.nc"

#: Damaged places that are named.
_NAMED = 20


def verify(
    result: Annotated[
        str, typer.Argument(metavar="OUT.nc|FOLDER|OUT.zarr", help="A result of run or limit, whole or split.")
    ],
) -> None:
    """Check a result against the checksums in it; status 1 if it differs."""
    from slipsweep.cli.common import place_of
    from slipsweep.errors import RunError
    from slipsweep.runs.verify import verify as verified

    found = verified(place_of(result))
    if not found.damaged:
        typer.echo(f"{result}: {found.chunks} chunks, coordinates and attributes are as they were written")
        return
    for text in found.damaged[:_NAMED]:
        typer.echo(f"  {text}")
    more = f" (the first {_NAMED} are listed)" if len(found.damaged) > _NAMED else ""
    raise RunError(f"{result}: {len(found.damaged)} places are not as they were written{more}")
