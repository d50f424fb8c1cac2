"""`slipsweep report`: all charts of a result as one PDF."""

from pathlib import Path
from typing import Annotated

import typer

from slipsweep.cli.chart import chart
from slipsweep.cli.common import OUTPUT, Overwrite, check_ending, examples

EXAMPLE = examples("slipsweep report design_chart.nc", "slipsweep report design_chart.nc -o charts.pdf --overwrite")


def report(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help='A result of "slipsweep run".')],
    output: Annotated[
        Path | None, OUTPUT("PDF to write (default: OUT.pdf).", "--output", "-o", metavar="OUT.pdf")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write all charts that fit a result to one PDF, with a title page."""
    path = output or Path(f"{file.stem}.pdf")
    check_ending(path, (".pdf",))
    chart(file, output=[path], overwrite=overwrite)
