"""Figures of tests on a shaking table: measured friction (the paper's Fig. 7), measured against computed motion."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts.sheet import Drawing
from slipsweep.charts.style import BLUE, VERMILION, Look

_GREY = "0.45"

#: What legends above a panel have in common.
_ABOVE: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1, 1), "frameon": False}

#: Of each channel of the block: label, factor to the unit drawn, and this unit.
_CHANNELS = {
    "block_acceleration": ("acceleration of\nthe block (m/s²)", 1.0, "m/s²"),
    "relative_velocity": ("relative\nvelocity (m/s)", 1.0, "m/s"),
    "relative_displacement": ("relative\ndisplacement (mm)", 1000.0, "mm"),
}


def friction(table: xr.Dataset, axes: Axes | None = None, look: Look | None = None) -> Figure:
    """Draw measured friction in the manner of the paper's Fig. 7, with the friction by statics.

    Parameters
    ----------
    table : xr.Dataset
        What `slipsweep.measured_friction` returns.
    axes : Axes, optional
        Refused: there are several panels.
    look : Look, optional

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time: accelerations of table and block; friction by Eq. 1 and by statics.  Slides are shaded, from
        onset to stop.
    """
    drawing = Drawing(look or Look(), 2, 1, (7.0, 4.8), axes, sharey=False)
    accelerations, coefficient = drawing.grid.ravel()
    time = table["time"].values
    accelerations.plot(time, table["ground_acceleration"].values, color=BLUE, label="table")
    accelerations.plot(time, table["block_acceleration"].values, color=VERMILION, linewidth=1.0, label="block")
    accelerations.set_ylabel("acceleration\n(m/s²)")
    accelerations.legend(ncols=2, **_ABOVE)
    _friction_lines(table, coefficient)
    coefficient.axhline(table["mu_s"].item(), color=_GREY, linewidth=0.8, linestyle="--", label="μs")
    coefficient.legend(ncols=3, **_ABOVE)
    coefficient.set_xlabel("time (s)")
    stops = np.where(np.isnan(table["slide_stop"].values), time[-1], table["slide_stop"].values)
    for panel in (accelerations, coefficient):
        for onset, stop in zip(table["slide_onset"].values, stops, strict=True):
            panel.axvspan(onset, stop, color="0.92", zorder=0)
    drawing.mark_zero([accelerations, coefficient])
    caption = (
        f"θ = {table['theta'].item():.4g}°, μs = {table['mu_s'].item():.4g}; shaded: slides, relative acceleration "
        f"beyond {table.attrs['threshold']:.3g} m/s²"
    )
    return drawing.finish([table.attrs["constant_friction"], caption])


def calibration(table: xr.Dataset, axes: Axes | None = None, look: Look | None = None) -> Figure:
    """Draw measured against computed motion in the manner of the paper's Figs. 8 and 9.

    Parameters
    ----------
    table : xr.Dataset
        What `slipsweep.calibrate` returns.
    axes : Axes, optional
        Refused: there are several panels.
    look : Look, optional

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time, a column for each test: the table's acceleration, each channel of the block, measured or not,
        with its misfit, and the friction by Eq. 1 and by statics; parameters with their intervals in a caption.
    """
    tests = [table.isel(test=i) for i in range(table.sizes["test"])] if "test" in table.dims else [table]
    rows = 5 if "free_body_friction" in table else 4
    size = (7.0 if len(tests) == 1 else 5.0 * len(tests), 9.0)
    drawing = Drawing(look or Look(), rows, len(tests), size, axes, sharey=False)
    for test, panels in zip(tests, drawing.grid.T, strict=True):
        shown = test.isel({test["time"].dims[0]: test["computed_ground_acceleration"].notnull().values})
        _test(shown, list(panels))
    for panel in drawing.grid[:, 1:].ravel():
        panel.set_ylabel("")
    drawing.mark_zero(drawing.grid.ravel())
    return drawing.finish([table.attrs["constant_friction"], _parameters(table)])


def _test(table: xr.Dataset, panels: list[Axes]) -> None:
    """One test of a calibration."""
    time, ground = table["time"].values, panels[0]
    ground.plot(time, table["measured_ground_acceleration"].values, ".", color=_GREY, markersize=2, label="measured")
    ground.plot(time, table["computed_ground_acceleration"].values, color=BLUE, label="smooth")
    ground.set_ylabel("acceleration of\nthe table (m/s²)")
    ground.legend(ncols=2, **_ABOVE)
    for panel, (name, (label, factor, unit)) in zip(panels[1:4], _CHANNELS.items(), strict=True):
        measured = f"misfit_{name}" in table and bool(table[f"misfit_{name}"].notnull())
        if measured:
            values = factor * table[f"measured_{name}"].values
            panel.plot(time, values, ".", color=_GREY, markersize=2, label="measured")
        panel.plot(time, factor * table[f"computed_{name}"].values, color=VERMILION, linewidth=1.2, label="computed")
        panel.set_ylabel(label)
        text = "not measured"
        if measured:
            misfit, share = factor * table[f"misfit_{name}"].item(), table[f"relative_misfit_{name}"].item()
            text = f"misfit {misfit:.2g} {unit} ({share:.1%})"
        panel.set_title(text, fontsize="small", loc="left")
    panels[1].legend(ncols=2, **_ABOVE)
    if len(panels) > 4:
        _friction_lines(table, panels[4])
        panels[4].legend(ncols=2, **_ABOVE)
    panels[-1].set_xlabel("time (s)")


def _friction_lines(table: xr.Dataset, panel: Axes) -> None:
    """Friction by Eq. 1 and by statics; told apart in grey by their widths and dashes."""
    time = table["time"].values
    panel.plot(time, table["free_body_friction"].values, color=BLUE, linewidth=1.6, label="by statics")
    eq1 = table["friction_coefficient"].values
    panel.plot(time, eq1, color=VERMILION, linewidth=1.0, linestyle=(0, (4, 1.5)), label="μ(t) by Eq. 1")
    panel.set_ylabel("friction\ncoefficient")


def _parameters(table: xr.Dataset) -> str:
    """The parameters with their 95 % intervals."""
    parts = []
    for name, sign, unit in (
        ("yield_acceleration", "Üy", " m/s²"),
        ("decay_rate", "λ", ""),
        ("delta_mu", "Δμ", ""),
    ):
        low, high = table[f"{name}_interval"].values
        ends = f"{low:.3g} to {high:.3g}" if np.isfinite(high) else f"{low:.3g} or more"
        known = bool(table[f"{name}_error"].notnull())
        value = f"= {table[name].item():.4g}{unit} ({ends})" if known else f"not determined ({ends}{unit})"
        parts.append(f"{sign} {value}")
    given = f"θ = {table['theta'].item():.4g}°, μs = {table['mu_s'].item():.4g}"
    return f"{', '.join(parts)}; 95 % intervals\n{given}"
