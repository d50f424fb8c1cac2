"""Figures over time: the history of a block, measured friction, a calibration."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from slipsweep.charts import style
from slipsweep.charts.sheet import Drawing
from slipsweep.charts.slices import Result
from slipsweep.charts.style import BLUE, VERMILION, Look, Options
from slipsweep.model.units import in_mm
from slipsweep.model.variables import SlidingMode
from slipsweep.studies.boundaries import thresholds
from slipsweep.studies.cautions import slides_back_text

#: Looks of the half waves of a record: told apart in grey, too.
_MODES: dict[SlidingMode, Look] = {
    SlidingMode.STUCK: {"facecolor": "white", "edgecolor": "0.6", "linewidth": 0.5},
    SlidingMode.STICK_SLIP: {"facecolor": "#BBD7EA", "edgecolor": BLUE, "linewidth": 0.5},
    SlidingMode.CONTINUOUS: {
        "facecolor": VERMILION,
        "edgecolor": "black",
        "linewidth": 0.5,
        "hatch": "/////",
    },
}

#: Place and form of legends above a panel.
_ABOVE: Look = {"loc": "lower right", "bbox_to_anchor": (1, 1), "frameon": False, "ncols": 4}

_GREY = "0.45"

#: Labels of the ordinates of accelerations and of friction.
_LABELS = ("acceleration\n(m/s²)", "friction\ncoefficient")

#: Of each channel of the block: label, factor to the unit drawn, and this unit.
_CHANNELS = {
    "block_acceleration": ("acceleration of\nthe block (m/s²)", 1.0, "m/s²"),
    "relative_velocity": ("relative\nvelocity (m/s)", 1.0, "m/s"),
    "relative_displacement": ("relative\ndisplacement (mm)", in_mm(1.0), "mm"),
}


def _plot(panel: Axes, table: xr.Dataset, name: str, factor: float = 1.0, **look: Any) -> None:
    panel.plot(table["time"].values, factor * table[name].values, **{"color": VERMILION, **look})


def _finish(drawing: Drawing, labels: Sequence[str], texts: list[str]) -> Figure:
    """Finish a figure: the last rows of panels have `labels`, a line at zero and a grid."""
    for panels, label in zip(drawing.grid[-len(labels) :], labels, strict=True):
        panels[0].set_ylabel(label)
        for panel in panels:
            panel.axhline(0, color="0.6", linewidth=0.8, zorder=0)
            panel.margins(x=0)
            panel.grid(color="0.9")
    for panel in drawing.grid[-1]:
        panel.set_xlabel("time (s)")
    drawing.figure.align_ylabels()
    return drawing.finish(texts)


def history(result: Result, options: Options) -> Figure:
    """Draw a time history like the paper's Figs. 5, 8 and 9.

    A record has the sliding modes of its half waves above.
    """
    data = result.data
    modes = "half_wave_mode" in data
    friction = "friction_coefficient" in data
    heights = [0.22] * modes + [1.0] * (3 + friction)
    drawing = Drawing(
        options, len(heights), 1, (7.0, 7.0 + 0.5 * modes), sharey=False, height_ratios=heights
    )
    accelerations, *coefficient, velocity, displacement = drawing.grid.ravel()[modes:]
    _plot(accelerations, data, "ground_acceleration", color=BLUE, label="base")
    _plot(accelerations, data, "block_acceleration", linestyle="--", label="block")
    if modes:
        _draw_modes(drawing.grid[0, 0], data)
        _draw_thresholds(accelerations, data)
    accelerations.legend(fontsize="small", **_ABOVE)
    for panel in coefficient:
        _plot(panel, data, "friction_coefficient")
    _plot(velocity, data, "relative_velocity")
    factor, unit = (
        (1.0, "m") if (np.abs(data["relative_displacement"]) >= 1.0).any() else (in_mm(1.0), "mm")
    )
    _plot(displacement, data, "relative_displacement", factor)
    labels = [
        *_LABELS[: 1 + friction],
        "relative\nvelocity (m/s)",
        f"relative\ndisplacement ({unit})",
    ]
    if slides_back := slides_back_text(data):
        drawing.note(f"Here {slides_back}.", "Would also slide upslope: displacement too large.")
    return _finish(drawing, labels, [style.caption(data, options)])


def _draw_thresholds(panel: Axes, data: xr.Dataset) -> None:
    """Draw lines at the accelerations of yield and of the mode limit, if the base comes near."""
    lines = thresholds(data)
    if "upslope_line" in lines:  # lines downslope and upslope, not the smaller of the two
        lines = lines.drop_vars("yield_line")
    highest = data["half_wave_peak"].values.max(initial=0.0)
    lowest = data["ground_acceleration"].values.min(initial=0.0)
    for name, value in lines.items():
        if np.isfinite(value) and 1.5 * lowest <= value <= 1.5 * highest:
            text, look = style.LINES.get(str(name), style.LINES["yield_line"])
            label = None if name == "upslope_line" else text
            thin = {**look, "linewidth": 0.9, "zorder": 1.5}
            panel.axhline(value.item(), label=label, gid=name, **thin)


def _draw_modes(panel: Axes, data: xr.Dataset) -> None:
    """Draw a box for each positive half wave of a record, by the sliding mode of its peak."""
    start, end, mode = (data[f"half_wave_{name}"].values for name in ("start", "end", "mode"))
    entries = []
    for sliding_mode, look in _MODES.items():
        which = mode == sliding_mode
        if which.any():
            spans = list(zip(start[which], (end - start)[which], strict=True))
            panel.broken_barh(spans, (0.0, 1.0), gid=sliding_mode.name.lower(), **look)
        text = f"{style.MODE_TEXT[sliding_mode]} ({np.count_nonzero(which)})"
        entries.append(Patch(label=text, **look))
    panel.set(ylim=(0.0, 1.0), yticks=[])
    panel.tick_params(axis="x", bottom=False)
    panel.set_ylabel("half\nwaves", rotation=0, ha="right", va="center", fontsize="small")
    panel.legend(handles=entries, fontsize="small", **_ABOVE)
    panel.margins(x=0)


def friction(result: Result, options: Options) -> Figure:
    """Draw measured friction like the paper's Fig. 7, by Eq. 1 and by statics.

    Slides are shaded.
    """
    table = result.data
    drawing = Drawing(options, 2, 1, (7.0, 4.8), sharey=False)
    accelerations, coefficient = drawing.grid.ravel()
    _plot(accelerations, table, "ground_acceleration", color=BLUE, label="table")
    _plot(accelerations, table, "block_acceleration", linewidth=1.0, label="block")
    accelerations.legend(**_ABOVE)
    _friction_lines(table, coefficient)
    coefficient.axhline(
        table["mu_s"].item(), color=_GREY, linewidth=0.8, linestyle="--", label="μs"
    )
    coefficient.legend(**_ABOVE)
    stops = table["slide_stop"].fillna(table["time"].values[-1]).values
    for panel, span in itertools.product(
        drawing.grid.ravel(), zip(table["slide_onset"].values, stops, strict=True)
    ):
        panel.axvspan(*span, color="0.92", zorder=0)
    shaded = f"shaded: slides, relative acceleration beyond {table.attrs['threshold']:.3g} m/s²"
    return _finish(
        drawing, _LABELS, [table.attrs["constant_friction"], f"{_interface_text(table)}; {shaded}"]
    )


def calibration(result: Result, options: Options) -> Figure:
    """Draw measured and computed motion like the paper's Figs. 8 and 9, a column for each test."""
    table = result.data
    tests = (
        [table.isel(test=i) for i in range(table.sizes["test"])]
        if "test" in table.dims
        else [table]
    )
    labels = ["acceleration of\nthe table (m/s²)", *(label for label, *_ in _CHANNELS.values())]
    labels += _LABELS[1:] if "free_body_friction" in table else ()
    width = 7.0 if len(tests) == 1 else 5.0 * len(tests)
    drawing = Drawing(options, len(labels), len(tests), (width, 9.0), sharey=False)
    for test, panels in zip(tests, drawing.grid.T, strict=True):
        _draw_test(
            test.isel(
                {test["time"].dims[0]: test["computed_ground_acceleration"].notnull().values}
            ),
            panels,
        )
    attrs = table.attrs
    texts = [table.attrs["constant_friction"]]
    if attrs["model_table"].startswith(
        "# WARNING"
    ):  # what `calibrate` comments out must not be read off a figure
        texts.append(f"Not ready for use. {attrs['findings'].splitlines()[0]}")
    texts.append(_parameters(table))
    if attrs["removed"] != "nothing":
        texts.append(f"Taken off what was measured: {attrs['removed']}")
    return _finish(drawing, labels, texts)


def _draw_test(table: xr.Dataset, panels: Sequence[Axes]) -> None:
    measured: Look = {
        "color": _GREY,
        "marker": ".",
        "linestyle": "",
        "markersize": 2,
        "label": "measured",
    }
    _plot(panels[0], table, "measured_ground_acceleration", **measured)
    _plot(panels[0], table, "computed_ground_acceleration", color=BLUE, label="smooth")
    for panel, (name, (_, factor, unit)) in zip(panels[1:4], _CHANNELS.items(), strict=True):
        text = "not measured"
        if f"misfit_{name}" in table and bool(table[f"misfit_{name}"].notnull()):
            _plot(panel, table, f"measured_{name}", factor, **measured)
            misfit = factor * table[f"misfit_{name}"].item()
            share = table[f"relative_misfit_{name}"].item()
            text = f"misfit {misfit:.2g} {unit} ({share:.1%})"
        _plot(panel, table, f"computed_{name}", factor, linewidth=1.2, label="computed")
        panel.set_title(text, fontsize="small", loc="left")
    for panel in panels[4:]:
        _friction_lines(table, panel)
    for panel in (*panels[:2], *panels[4:]):
        panel.legend(**_ABOVE)


def _friction_lines(table: xr.Dataset, panel: Axes) -> None:
    """Draw friction by Eq. 1 and by statics, told apart in grey by widths and dashes."""
    dashed: Look = {"linewidth": 1.0, "linestyle": (0, (4, 1.5))}
    _plot(panel, table, "free_body_friction", color=BLUE, linewidth=1.6, label="by statics")
    _plot(panel, table, "friction_coefficient", label="μ(t) by Eq. 1", **dashed)


def _interface_text(table: xr.Dataset) -> str:
    """Return θ and μs of a test."""
    return f"θ = {table['theta'].item():.4g}°, μs = {table['mu_s'].item():.4g}"


def _parameters(table: xr.Dataset) -> str:
    """Return the estimated parameters with their 95 % intervals, in words."""
    parts = []
    for name, unit in (("yield_acceleration", "m/s²"), ("decay_rate", ""), ("delta_mu", "")):
        low, high = table[f"{name}_interval"].values
        ends = f"{low:.3g} to {high:.3g}" if np.isfinite(high) else f"{low:.3g} or more"
        is_determined = bool(table[f"{name}_error"].notnull())
        value = f"= {style.with_unit(f'{table[name].item():.4g}', unit)} ({ends})"
        parts.append(
            f"{style.SYMBOLS[name]} "
            f"{value if is_determined else f'not determined ({style.with_unit(ends, unit)})'}"
        )
    return f"{', '.join(parts)}; 95 % intervals\n{_interface_text(table)}"
