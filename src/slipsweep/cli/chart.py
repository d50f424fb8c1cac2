"""`slipsweep chart` and `slipsweep report`: design charts of a result."""

import functools
from pathlib import Path
from typing import Annotated, Literal

import typer

from slipsweep.cli import common
from slipsweep.cli.common import FIGURES, Overwrite, Panel, command, cuts, echo, written
from slipsweep.errors import InputError

#: Groups of options.
CHART, AXES, LOOK = Panel("Chart"), Panel("Axes"), Panel("Look")


@command("Draw", "slipsweep chart design_chart.nc --kind contours --at theta=5 --at mu_s=0.4 -o chart.pdf")
def chart(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help='A result of "slipsweep run".')],
    kind: Annotated[
        list[str] | None,
        CHART(
            "contours, modes, families, curve, dimensionless, newmark or spread; of uncertain inputs fragility, "
            "quantiles or sensitivity; of recorded motions motions, fragility, intensity or histogram; may be repeated "
            "(default: all that fit; with one axis left, its curve).",
            "--kind",
            "-k",
            metavar="KIND",
        ),
    ] = None,
    at: Annotated[
        list[str] | None,
        CHART("Value of another axis, by default the middle; several select curves: theta=8,11.", metavar="NAME=VALUE"),
    ] = None,
    x: Annotated[str | None, AXES("Axis to draw over; of intensity the measure: pgv, cav.", metavar="NAME")] = None,
    y: Annotated[str | None, AXES("Vertical axis of a map, or the curve parameter.", metavar="NAME")] = None,
    panels: Annotated[str | None, AXES("One or two axes of panels, across and down.", metavar="NAME[,NAME]")] = None,
    variable: Annotated[str, CHART("What contours and families show.", metavar="NAME")] = "permanent_displacement",
    levels: Annotated[
        str | None, LOOK("Contours, or displacements of a suite's fragility: 1cm,5cm,30cm.", metavar="LEVEL,...")
    ] = None,
    units: Annotated[Literal["m/s2", "g"], LOOK("Unit of accelerations.")] = "m/s2",
    show_cautions: Annotated[
        bool, LOOK("Draw values flagged not_recoupled or upslope, too.", "--show-cautions")
    ] = False,
    width: Annotated[str | None, LOOK("Width of the figure: 90mm, 3.5inch.", metavar="LENGTH")] = None,
    grey: Annotated[bool, LOOK("Draw without colour.", "--grey")] = False,
    output: Annotated[
        list[Path] | None,
        written("Write .png, .svg or .pdf; may be repeated (default: OUT-KIND.png). Several charts go to one .pdf."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Draw design charts of a result."""
    given = output or []
    for path in given:
        common.check_ending(path, FIGURES)

    from slipsweep.charts import kinds
    from slipsweep.charts.slices import Result
    from slipsweep.charts.style import Options
    from slipsweep.files import outputs
    from slipsweep.files.opening import read_result
    from slipsweep.files.selection import own_names

    requested = [kinds.check_kind(name) for name in dict.fromkeys(kind or ())]
    if levels is not None and requested and {"contours", "fragility"}.isdisjoint(requested):
        raise InputError(f"--levels {levels}: only with --kind contours or fragility")
    across, heights = (text.split(",") if text else () for text in (panels, levels))
    typed = cuts(at)
    with read_result(file) as data:
        result = Result(data, file)
        options = Options(x, y, own_names(data, typed), across, variable, heights, units, show_cautions, width, grey)
        result.places(options.at)
        chosen = requested or kinds.fitting(result, options)
        together = bool(given) and len(chosen) > 1
        for path in given:
            if together and path.suffix != ".pdf":
                raise InputError(f"{path}: is for one chart: give one --kind, or a name that ends in .pdf for several")
        wanted = {name: given or [Path(f"{file.stem}-{name}.png")] for name in chosen}
        outputs.check_outputs(given or [wanted[name][0] for name in chosen], overwrite, reads=[file])
        options.more_panels = together
        figures, left_out = kinds.draw_all(result, chosen, options, strict=bool(requested))
        for path in given if together else ():
            with outputs.complete_or_absent(path, overwrite) as temporary:
                kinds.write_book(temporary, result, figures.values())
            echo(path)
    for name in () if together else figures:
        common.write_outputs(wanted[name], overwrite, functools.partial(figures.__getitem__, name))
        echo(*wanted[name])
    echo(*(f"no {name}: {reason}" for name, reason in left_out.items()))


@command("Draw", "slipsweep report design_chart.nc", "slipsweep report design_chart.nc -o charts.pdf --overwrite")
def report(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help='A result of "slipsweep run".')],
    output: Annotated[Path | None, written("PDF to write (default: OUT.pdf).", "OUT.pdf")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write all charts that fit a result to one PDF, with a title page."""
    path = output or Path(f"{file.stem}.pdf")
    common.check_ending(path, (".pdf",))
    chart(file, output=[path], overwrite=overwrite)
