"""`slipsweep chart`, `report` and `explore`: a result as charts, or as a page for the browser."""

from pathlib import Path
from typing import Annotated, Literal

from slipsweep.cli import options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import OUTPUT, File, Text, Texts, command, written
from slipsweep.errors import InputError
from slipsweep.files import outputs

CHART = options.Panel("Chart")
AXES = options.Panel("Axes")
LOOK = options.Panel("Look")

_KINDS = (
    "contours, modes, families, curve, dimensionless, newmark or spread; of uncertain inputs "
    "fragility, quantiles or sensitivity; of recorded motions motions, fragility, intensity or "
    "histogram; may be repeated (default: all that fit; with one axis left, its curve)."
)


@command(
    "Draw",
    "slipsweep chart design_chart.nc --kind contours --at theta=5 --at mu_s=0.4 -o chart.pdf",
)
def chart(
    file: options.Swept,
    kind: Annotated[Texts, CHART(_KINDS, "KIND", "--kind", "-k")] = None,
    at: Annotated[
        Texts,
        CHART(
            "Value of another axis, by default the middle; several select curves: theta=8,11.",
            "NAME=VALUE",
        ),
    ] = None,
    x: Annotated[
        Text, AXES("Axis to draw over; of intensity the measure: pgv, cav.", "NAME")
    ] = None,
    y: Annotated[Text, AXES("Vertical axis of a map, or the curve parameter.", "NAME")] = None,
    panels: Annotated[
        Text, AXES("One or two axes of panels, across and down.", "NAME[,NAME]")
    ] = None,
    variable: Annotated[
        str, CHART("What contours and families show.", "NAME")
    ] = "permanent_displacement",
    levels: Annotated[
        Text, LOOK("Contours, or displacements of a suite's fragility: 1cm,5cm,30cm.", "LEVEL,...")
    ] = None,
    units: Annotated[Literal["m/s2", "g"], LOOK("Unit of accelerations.")] = "m/s2",
    show_cautions: Annotated[
        bool, LOOK("Draw values flagged not_recoupled or upslope, too.", None, "--show-cautions")
    ] = False,
    width: Annotated[Text, LOOK("Width of the figure: 90mm, 3.5inch.", "LENGTH")] = None,
    grey: Annotated[bool, LOOK("Draw without colour.", None, "--grey")] = False,
    title: Annotated[Text, LOOK("A title of your own.", "TEXT")] = None,
    caption: Annotated[
        Literal["full", "short"] | None,
        LOOK("Caption: in full, or short (default: short below 127 mm)."),
    ] = None,
    equations: options.Equations = None,
    magnitude: options.Magnitude = None,
    output: Annotated[
        options.Paths,
        written(
            "Write .png, .svg or .pdf; may be repeated (default: OUT-KIND.png). Several charts go "
            "to one .pdf."
        ),
    ] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Draw design charts of a result."""
    paths = output or []
    outputs.check_endings(paths, FIGURES)
    beside = options.compared(equations, magnitude)

    from slipsweep.charts import kinds, slices, style
    from slipsweep.files import opening, selection

    requested = [kinds.check_kind(name) for name in dict.fromkeys(kind or ())]
    if levels is not None and requested and {"contours", "fragility"}.isdisjoint(requested):
        raise InputError(f"--levels {levels}: only with --kind contours or fragility")
    across, heights = (text.split(",") if text else () for text in (panels, levels))
    typed = options.cuts(at)
    with opening.read_result(file) as data:
        result = slices.Result(data, file)
        axes = selection.own_names(data, typed)
        look = style.Options(
            x,
            y,
            axes,
            across,
            variable,
            heights,
            units,
            show_cautions,
            width,
            grey,
            title,
            caption,
            equations=beside,
            magnitude=magnitude,
        )
        result.places(look.at)
        chosen = requested or kinds.fitting(result, look)
        look.more_panels = together = bool(paths) and len(chosen) > 1
        for path in paths:
            if together and path.suffix != ".pdf":
                raise InputError(
                    f"{path}: is for one chart: give one --kind, or a name that ends in .pdf for "
                    "several"
                )
        default = {name: Path(f"{file.stem}-{name}.png") for name in chosen}
        outputs.check_outputs(paths or [*default.values()], overwrite, reads=[file])
        figures, left_out = kinds.draw_all(result, chosen, look, strict=bool(requested))
        drawn = [(path, [*figures.values()]) for path in paths]
        for path, shown in drawn or [(default[name], [figure]) for name, figure in figures.items()]:
            with outputs.complete_or_absent(path, overwrite) as temporary:
                if together:
                    kinds.write_book(temporary, result, shown)
                else:
                    kinds.save(shown[0], temporary, path.suffix)
            echo(path)
    echo(*(f"no {name}: {reason}" for name, reason in left_out.items()))


@command(
    "Draw",
    "slipsweep report design_chart.nc",
    "slipsweep report design_chart.nc -o charts.pdf --overwrite",
)
def report(
    file: options.Swept,
    output: Annotated[File, written("PDF to write (default: OUT.pdf).", "OUT.pdf")] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Write all charts that fit a result to one PDF, with a title page."""
    path = output or Path(f"{file.stem}.pdf")
    outputs.check_endings([path], (".pdf",))
    chart(file, output=[path], overwrite=overwrite)


@command("Draw", "slipsweep explore design_chart.nc -o design_chart.html")
def explore(
    file: Annotated[Path, options.read("OUT.nc", "A file that slipsweep run wrote.")],
    output: Annotated[
        File, written("Page to write (default: the file's name, .html).", "PAGE.html")
    ] = None,
    overwrite: options.Overwrite = False,
    size: Annotated[
        str, OUTPUT("Largest size of the page; larger results are thinned to it.", "SIZE")
    ] = "10MB",
    quiet: options.Quiet = False,
) -> None:
    """Write a page for the browser in which to explore a result (extra \\[explore])."""
    from slipsweep.explore.page import write_page
    from slipsweep.grid.resources import parse_size, size_text

    path = output or file.with_suffix(".html")
    outputs.check_endings([path], (".html", ".htm"))
    excerpt = write_page(file, path, size=parse_size("--size", size), overwrite=overwrite)
    if quiet:
        return
    for dim, length in excerpt.lengths.items():
        shown = excerpt.sizes[dim]
        thinned = "" if shown == length else f"  thinned: {shown} of {length} (more with --size)"
        echo(f"{dim:<24}{shown} values{thinned}")
    echo(f"{path}  {size_text(path.stat().st_size)}")
