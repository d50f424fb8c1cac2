"""All charts of a result as one PDF: a title page that says what they show, then a chart a page."""

import textwrap
from collections.abc import Iterable
from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from slipsweep._version import __version__
from slipsweep.charts import style
from slipsweep.charts.maps import HATCHES
from slipsweep.charts.slices import Result
from slipsweep.charts.solved import is_recorded
from slipsweep.files.contents import values_text
from slipsweep.model.variables import PARAMETERS, REFERENCE

#: Characters in a line.
_WIDTH = 96


def write(path: Path, result: Result, figures: Iterable[Figure]) -> None:
    """Write a title page and some charts as pages of one PDF."""
    with PdfPages(path, metadata={"Title": str(result.attrs.get("title", "")), "Creator": "slipsweep"}) as pages:
        for figure in (title_page(result), *figures):
            pages.savefig(figure)


def title_page(result: Result) -> Figure:
    """What was computed, of which inputs, by which model and estimates, and by which versions."""
    attributes = result.attrs
    recorded = is_recorded(result.data)
    left_out = "; left out of contours and curves unless their caption says that it is drawn"
    hatched = [
        f"{style.flag_name(flag)} ({flag.kind}): {flag.text}{left_out if flag in style.LEFT_OUT else ''}"
        for flag in HATCHES
    ]
    coords = result.data.coords
    inputs = [
        style.plain(f"{PARAMETERS[name]['long_name']} {style.SYMBOLS[name]}: {values_text(coords[name])}")
        for name in PARAMETERS
        if name in coords
    ]
    inputs += [style.plain(f"{name}: {values_text(coords[name])}") for name in ("label", "motion") if name in coords]
    sections: dict[str, list[str]] = {
        "Results": [f"{name}: {style.SHOWN[name]['long_name']}" for name in result.variables],
        "Inputs": [*inputs, *filter(None, [style.drawn_text(attributes)])],
        "Model and estimates": style.model_text(attributes).splitlines(),
        "Range in which the model was compared with measurements": [
            "one interface (μs 0.38), two shaking-table tests: θ 5 and 6°, 0.36 and 0.52 g, 1.8 and 3.5 Hz",
            *(["none under recorded motions: the rules for them extend the paper"] if recorded else []),
        ],
        **({} if recorded else {"Flags that the charts hatch": hatched}),
        "Origin": [
            style.plain(result.name),
            f"solved by {attributes.get('source', 'slipsweep')}",
            f"drawn by slipsweep {__version__}, matplotlib {mpl.__version__}",
            *style.plain(str(attributes.get("history", ""))).splitlines(),
            REFERENCE,
        ],
    }
    figure = Figure(figsize=(8.27, 11.69))
    title = style.plain(textwrap.fill(str(attributes.get("title", "")), 54))
    figure.text(0.08, 0.94, title, fontsize="xx-large", va="top")
    lines = []
    for heading, texts in sections.items():
        lines += ["", heading.upper()]
        for text in texts:
            lines += textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="    ")
    figure.text(0.08, 0.86, "\n".join(lines), fontsize="small", va="top", linespacing=1.4)
    return figure
