"""Figures of a page, without data: Bokeh draws them, the page's script fills them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from slipsweep.charts.style import (
    BLUE,
    SYMBOLS,
    VERMILION,
    Options,
    axis_label,
    is_acceleration,
    length_text,
)
from slipsweep.explore.excerpt import Excerpt
from slipsweep.model.variables import PARAMETERS, RESULTS, STATISTIC_COORDINATES, STATISTICS

_MM_PER_M = 1000.0


def attributes(name: str) -> dict[str, Any]:
    """Return the long name and the unit of a result or a dimension."""
    variables = PARAMETERS | STATISTIC_COORDINATES | STATISTICS | RESULTS
    return variables.get(name, {"long_name": name, "units": "1"})


def colour_scale(name: str) -> str:
    """Return the scale of colours of a result: "displacement" or "probability"."""
    return "displacement" if attributes(name).get("units") == "m" else "probability"


def axis_title(name: str, log: bool = False) -> str:
    """Long name, symbol and unit of a dimension, and its scale unless that is linear."""
    title = axis_label(name, Options()) if name in SYMBOLS else attributes(name)["long_name"]
    return f"{title}, logarithmic scale" if log else str(title)


def decades(excerpt: Excerpt) -> tuple[int, int]:
    """Powers of ten, in mm, at the ends of the scale of colours.

    They span nine displacements in ten, at most five decades, and of more those from 1 mm up.
    """
    displacements = [
        excerpt.table[name].values.ravel()
        for name in excerpt.layers
        if colour_scale(name) == "displacement"
    ]
    magnitudes = np.abs(np.concatenate([np.zeros(0), *displacements]))
    positive = magnitudes[np.isfinite(magnitudes) & (magnitudes > 0.0)]
    if positive.size == 0:
        return 0, 1
    fifth, ninety_fifth = np.log10(np.percentile(positive, (5.0, 95.0)) * _MM_PER_M)
    low = math.floor(fifth)
    high = max(math.ceil(ninety_fifth), low + 1)
    if high - low > 5:
        low = min(max(low, 0), high - 5)
    return low, min(high, low + 5)


def figures(excerpt: Excerpt) -> dict[str, Any]:
    """Return the map and the panels of a history as JSON of Bokeh's."""
    from bokeh.embed import json_item

    return {"map": json_item(map_figure(excerpt)), "panels": json_item(history_panels())}


def map_figure(excerpt: Excerpt) -> Any:
    """Map: colours under marks, cells with a history, the chosen cell, and axes."""
    from bokeh.models import Range1d
    from bokeh.plotting import figure

    up, across = excerpt.map_dims
    chart: Any = figure(  # its properties take more than their annotations say
        name="map",
        height=520,  # px; its width is that of the window
        sizing_mode="stretch_width",
        x_axis_type="log" if excerpt.is_log(across) else "linear",
        y_axis_type="log" if excerpt.is_log(up) else "linear",
        x_axis_label=axis_title(across, excerpt.is_log(across)),
        y_axis_label=axis_title(up, excerpt.is_log(up)),
        x_range=Range1d(start=1, end=2, name="x_range"),
        y_range=Range1d(start=1, end=2, name="y_range"),
        tools="",
        toolbar_location=None,
    )
    chart.grid.visible = False
    for axis, dim in ((chart.xaxis, across), (chart.yaxis, up)):
        _set_ticks(axis, excerpt.is_log(dim))
    _add_images(chart, excerpt)
    _add_markers(chart)
    if is_acceleration(up):
        _add_axis_in_g(chart, excerpt.is_log(up))
    return chart


def _add_images(chart: Any, excerpt: Excerpt) -> None:
    """Add the image of colours, with a bar for each of its scales, and that of marks."""
    from bokeh.models import ColumnDataSource

    corner: dict[str, Any] = {"x": [1.0], "y": [1.0], "dw": [1.0], "dh": [1.0]}
    columns: dict[str, Any] = {"image": "image", "x": "x", "y": "y", "dw": "dw", "dh": "dh"}
    colours = ColumnDataSource({"image": [np.zeros((1, 1), np.float32)], **corner}, name="colours")
    marks = ColumnDataSource({"image": [np.zeros((1, 1), np.uint32)], **corner}, name="marks")
    for scale in dict.fromkeys(colour_scale(name) for name in excerpt.layers):
        mapper, bar = colours_and_bar(scale, decades(excerpt))
        chart.image(**columns, color_mapper=mapper, source=colours, name=f"colours-{scale}")
        chart.add_layout(bar, "above")
    chart.image_rgba(**columns, source=marks)


def _add_markers(chart: Any) -> None:
    """Add dots in the cells that have a history, and a ring about the chosen cell."""
    from bokeh.models import ColumnDataSource

    with_history = ColumnDataSource({"x": [], "y": []}, name="cells_with_history")
    chart.scatter(
        "x",
        "y",
        source=with_history,
        size=3,
        marker="circle",
        fill_color="white",
        line_color="black",
        line_width=0.7,
    )
    chosen = ColumnDataSource({"x": [1.0], "y": [1.0]}, name="chosen")
    for colour, width in (("white", 5), ("black", 2)):
        chart.scatter(
            "x",
            "y",
            source=chosen,
            size=15,
            marker="circle",
            fill_color=None,
            line_color=colour,
            line_width=width,
        )


def _set_ticks(axis: Any, log: bool) -> None:
    """Put plain numbers at 1, 2 and 5 times each power of ten of a logarithmic axis."""
    from bokeh.models import FixedTicker, PrintfTickFormatter

    axis.axis_label_text_font_style = "normal"
    if log:
        ticks = [digit * 10.0**power for power in range(-9, 10) for digit in (1, 2, 5)]
        axis.ticker = FixedTicker(ticks=ticks)
        axis.formatter = PrintfTickFormatter(format="%g")


def colours_and_bar(scale: str, powers: tuple[int, int]) -> tuple[Any, Any]:
    """Return a scale of colours, of displacements between two powers of ten in mm, and its bar.

    Three bands a decade: their edges are contours of displacement.
    """
    from bokeh.models import FixedTicker, LinearColorMapper, LogColorMapper
    from bokeh.models.annotations import ColorBar
    from matplotlib.colors import to_hex

    from slipsweep.charts.style import COLOURS

    low, high = powers
    bands = 3 * (high - low) if scale == "displacement" else 10
    look: dict[str, Any] = {
        "palette": [to_hex(colour) for colour in COLOURS(np.linspace(0, 1, bands))],
        "nan_color": "rgba(0, 0, 0, 0)",
    }
    if scale == "displacement":
        mapper: Any = LogColorMapper(low=10.0**low, high=10.0**high, **look)
        labels: dict[Any, Any] = {
            10.0**power: length_text(10.0 ** (power - 3)) for power in range(low, high + 1)
        }
    else:
        mapper = LinearColorMapper(low=0.0, high=1.0, **look)
        labels = {tenths / 10: f"{tenths / 10:g}" for tenths in range(0, 11, 2)}
    bar = ColorBar(
        name=f"bar-{scale}",
        color_mapper=mapper,
        ticker=FixedTicker(ticks=[*labels]),
        major_label_overrides=labels,
        height=16,
    )
    return mapper, bar


def _add_axis_in_g(chart: Any, log: bool) -> None:
    """Add an axis in g on the right of an axis in m/s²."""
    from bokeh.models import LinearAxis, LinearScale, LogAxis, LogScale, Range1d

    chart.extra_y_ranges = {"g": Range1d(start=1, end=2, name=f"{chart.name}_g")}
    chart.extra_y_scales = {"g": LogScale() if log else LinearScale()}
    axis: Any = (LogAxis if log else LinearAxis)(y_range_name="g", axis_label="(g)")
    _set_ticks(axis, log)
    chart.add_layout(axis, "right")


@dataclass(frozen=True)
class Panel:
    """Panel of a history: title of its axis, height in px, and its lines with their legends."""

    name: str
    axis: str
    height: int
    lines: dict[str, str]


_PANELS = (
    Panel("accelerations", "acceleration (m/s²)", 200, {"ground": "base", "block": "block"}),
    Panel("velocity", "velocity (m/s)", 150, {"v": ""}),
    Panel("displacement", "displacement (mm)", 180, {"u": ""}),
)

_LINE_LOOKS: dict[str, dict[str, Any]] = {
    "ground": {"color": BLUE},
    "block": {"color": VERMILION, "line_dash": "dashed"},
    "v": {"color": VERMILION},
    "u": {"color": VERMILION},
}


def history_panels() -> Any:
    """Panels of the history of a cell, each under the other, over the same time."""
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, DataRange1d

    columns = {name: [0.0] for name in ("t", "ground", "block", "v", "u")}
    history = ColumnDataSource(columns, name="history")
    times = DataRange1d(range_padding=0)
    charts = [_history_panel(panel, history, times) for panel in _PANELS]
    return column(*charts, sizing_mode="stretch_width")


def _history_panel(panel: Panel, history: Any, times: Any) -> Any:
    from bokeh.models import Range1d
    from bokeh.plotting import figure

    chart: Any = figure(
        name=panel.name,
        sizing_mode="stretch_width",
        height=panel.height,
        x_range=times,
        x_axis_label="time (s)" if panel is _PANELS[-1] else None,
        y_axis_label=panel.axis,
        tools="",
        toolbar_location=None,
        min_border_left=75,
        min_border_right=55,
    )
    chart.axis.axis_label_text_font_style = "normal"
    for line, legend in panel.lines.items():
        look = dict(_LINE_LOOKS[line])
        if legend:
            look["legend_label"] = legend
        chart.line("t", line, source=history, line_width=1.8, **look)
    if panel.name == "accelerations":
        chart.y_range = Range1d(start=-1, end=1, name="accelerations_range")
        chart.legend.update(orientation="horizontal", padding=1, border_line_color=None)
        chart.add_layout(chart.legend[0], "above")
        _add_axis_in_g(chart, log=False)
    return chart
