"""The figures of a page, empty: Bokeh draws them, `page.js` fills them."""

import math
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
from slipsweep.model.units import in_mm
from slipsweep.model.variables import PARAMETERS, RESULTS, STATISTIC_COORDINATES, STATISTICS


def about(name: str) -> dict[str, Any]:
    """What is known of a result or a dimension: its long name and unit."""
    return (PARAMETERS | STATISTIC_COORDINATES | STATISTICS | RESULTS).get(
        name, {"long_name": name, "units": "1"}
    )


def scale_of(name: str) -> str:
    """The colours of a result: those of a displacement or of a probability."""
    return "displacement" if about(name).get("units") == "m" else "probability"


def label(name: str, log: bool = False) -> str:
    """Long name, symbol and unit of a dimension, and its scale where it is no linear one."""
    text = axis_label(name, Options()) if name in SYMBOLS else about(name)["long_name"]
    return f"{text}{', logarithmic scale' * log}"


def decades(excerpt: Excerpt) -> tuple[int, int]:
    """Powers of ten, in mm, that the colours span: those of nine cells in ten, five at most and from 1 mm up."""
    lengths = [
        excerpt.table[name].values.ravel()
        for name in excerpt.layers
        if scale_of(name) == "displacement"
    ]
    values = np.abs(np.concatenate([np.zeros(0), *lengths]))
    positive = values[np.isfinite(values) & (values > 0.0)]
    if positive.size == 0:
        return 0, 1
    fifth, ninety_fifth = np.log10(in_mm(np.percentile(positive, (5.0, 95.0))))
    low = math.floor(fifth)
    high = max(math.ceil(ninety_fifth), math.floor(fifth) + 1)
    if high - low > 5:
        low = min(max(low, 0), high - 5)
    return low, min(high, low + 5)


def figures(excerpt: Excerpt) -> dict[str, Any]:
    """The map, and the panels of a history, as Bokeh's JSON, which `page.js` has Bokeh draw."""
    from bokeh.embed import json_item

    return {"map": json_item(_map(excerpt)), "panels": json_item(_panels())}


def _map(excerpt: Excerpt) -> Any:
    from bokeh.models import ColumnDataSource, Range1d
    from bokeh.plotting import figure

    up, across = excerpt.map_dims
    chart: Any = figure(  # its properties take more than their annotations say
        name="map",
        height=520,  # px; its width is that of the window
        sizing_mode="stretch_width",
        x_axis_type="log" if excerpt.is_log(across) else "linear",
        y_axis_type="log" if excerpt.is_log(up) else "linear",
        x_axis_label=label(across, excerpt.is_log(across)),
        y_axis_label=label(up, excerpt.is_log(up)),
        x_range=Range1d(start=1, end=2, name="x_range"),
        y_range=Range1d(start=1, end=2, name="y_range"),
        tools="",
        toolbar_location=None,
    )
    chart.grid.visible = False
    for axis, dim in ((chart.xaxis, across), (chart.yaxis, up)):
        _plain_ticks(axis, excerpt.is_log(dim))
    place: dict[str, Any] = {"x": "x", "y": "y", "dw": "dw", "dh": "dh"}
    corner: dict[str, Any] = {"x": [1.0], "y": [1.0], "dw": [1.0], "dh": [1.0]}
    colours = ColumnDataSource({"image": [np.zeros((1, 1), np.float32)], **corner}, name="colours")
    marks = ColumnDataSource({"image": [np.zeros((1, 1), np.uint32)], **corner}, name="marks")
    for scale in {scale_of(name): None for name in excerpt.layers}:
        mapper, bar = _colours(scale, decades(excerpt))
        chart.image(
            image="image", **place, color_mapper=mapper, source=colours, name=f"colours-{scale}"
        )
        chart.add_layout(bar, "above")
    chart.image_rgba(image="image", **place, source=marks)
    held = ColumnDataSource({"x": [], "y": []}, name="held")
    chart.scatter(
        "x",
        "y",
        source=held,
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
    if is_acceleration(up):
        _add_g(chart, excerpt.is_log(up))
    return chart


def _plain_ticks(axis: Any, log: bool) -> None:
    """Numbers at 1, 2 and 5 times each power of ten of a logarithmic axis, of which a part shows several."""
    from bokeh.models import FixedTicker, PrintfTickFormatter

    axis.axis_label_text_font_style = "normal"
    if log:
        axis.ticker = FixedTicker(
            ticks=[digit * 10.0**power for power in range(-9, 10) for digit in (1, 2, 5)]
        )
        axis.formatter = PrintfTickFormatter(format="%g")


def _colours(scale: str, span: tuple[int, int]) -> tuple[Any, Any]:
    """A scale of colours and its bar."""
    from bokeh.models import FixedTicker, LinearColorMapper, LogColorMapper
    from bokeh.models.annotations import ColorBar
    from matplotlib.colors import to_hex

    from slipsweep.charts.style import COLOURS

    low, high = span
    # three bands a decade: their edges are contours of displacement
    bands = 3 * (high - low) if scale == "displacement" else 10
    shared: dict[str, Any] = {
        "palette": [to_hex(colour) for colour in COLOURS(np.linspace(0, 1, bands))],
        "nan_color": "rgba(0, 0, 0, 0)",
    }
    if scale == "displacement":
        mapper: Any = LogColorMapper(low=10.0**low, high=10.0**high, **shared)
        ticks: dict[Any, Any] = {
            10.0**power: length_text(10.0 ** (power - 3)) for power in range(low, high + 1)
        }
    else:
        mapper = LinearColorMapper(low=0.0, high=1.0, **shared)
        ticks = {tenths / 10: f"{tenths / 10:g}" for tenths in range(0, 11, 2)}
    bar = ColorBar(
        name=f"bar-{scale}",
        color_mapper=mapper,
        ticker=FixedTicker(ticks=[*ticks]),
        major_label_overrides=ticks,
        height=16,
    )
    return mapper, bar


def _add_g(chart: Any, log: bool) -> None:
    """An axis in g on the right, beside that in m/s²; `page.js` moves it along."""
    from bokeh.models import LinearAxis, LinearScale, LogAxis, LogScale, Range1d

    chart.extra_y_ranges = {"g": Range1d(start=1, end=2, name=f"{chart.name}_g")}
    chart.extra_y_scales = {"g": LogScale() if log else LinearScale()}
    axis: Any = (LogAxis if log else LinearAxis)(y_range_name="g", axis_label="(g)")
    _plain_ticks(axis, log)
    chart.add_layout(axis, "right")


#: The panels of a history: axis, height in px, and what is drawn, with its words in the legend.
_PANELS = {
    "accelerations": ("acceleration (m/s²)", 200, {"ground": "base", "block": "block"}),
    "velocity": ("velocity (m/s)", 150, {"v": ""}),
    "displacement": ("displacement (mm)", 180, {"u": ""}),
}


def _panels() -> Any:
    """The history of a cell, one panel under the other."""
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, DataRange1d, Range1d
    from bokeh.plotting import figure

    history = ColumnDataSource(
        {name: [0.0] for name in ("t", "ground", "block", "v", "u")}, name="history"
    )
    times = DataRange1d(range_padding=0)
    panels = []
    for name, (text, height, lines) in _PANELS.items():
        panel: Any = figure(
            name=name,
            sizing_mode="stretch_width",
            height=height,
            x_range=times,
            x_axis_label="time (s)" if name == "displacement" else None,
            y_axis_label=text,
            tools="",
            toolbar_location=None,
            min_border_left=75,
            min_border_right=55,
        )
        panel.axis.axis_label_text_font_style = "normal"
        for one, legend in lines.items():
            look: dict[str, Any] = {"color": BLUE if one == "ground" else VERMILION}
            look |= {"line_dash": "dashed"} if one == "block" else {}
            panel.line(
                "t",
                one,
                source=history,
                line_width=1.8,
                **look,
                **({"legend_label": legend} if legend else {}),
            )
        if name == "accelerations":
            panel.y_range = Range1d(start=-1, end=1, name="accelerations_range")
            panel.legend.update(orientation="horizontal", padding=1, border_line_color=None)
            panel.add_layout(panel.legend[0], "above")
            _add_g(panel, log=False)
        panels.append(panel)
    return column(*panels, sizing_mode="stretch_width")
