"""`slipsweep explore`: a result as a page for the browser."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.common import OUTPUT, Overwrite, Quiet, check_ending, command, echo, written


@command("Draw", "slipsweep explore design_chart.nc -o design_chart.html")
def explore(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help="A file that slipsweep run wrote.")],
    output: Annotated[Path | None, written("Page to write (default: the file's name, .html).", "PAGE.html")] = None,
    overwrite: Overwrite = False,
    size: Annotated[
        str, OUTPUT("Largest size of the page; larger results are thinned to it.", metavar="SIZE")
    ] = "10MB",
    quiet: Quiet = False,
) -> None:
    """Write a page for the browser in which to explore a result."""
    from slipsweep.explore import page as pages
    from slipsweep.grid.resources import parse_size, size_text

    path = output or file.with_suffix(".html")
    check_ending(path, (".html", ".htm"))
    nbytes = parse_size("--size", size)
    excerpt = pages.write_page(file, path, size=nbytes, overwrite=overwrite)
    if quiet:
        return
    for dim, length in excerpt.lengths.items():
        shown = excerpt.sizes[dim]
        thinned = "" if shown == length else f"  thinned: {shown} of {length} (more with --size)"
        echo(f"{dim:<24}{shown} values{thinned}")
    echo(f"{path}  {size_text(path.stat().st_size)}")
