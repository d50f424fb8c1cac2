"""Figures of tests on a shaking table: friction measured (the paper's Fig. 7), measured against computed motion."""

import json

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts.sheet import new_panels
from slipsweep.charts.style import BLUE, VERMILION
from slipsweep.model.variables import HISTORY

_GREY = "0.45"

_LABELS = {
    "block_acceleration": "acceleration of\nthe block (m/s²)",
    "relative_velocity": "relative\nvelocity (m/s)",
    "relative_displacement": "relative\ndisplacement (mm)",
}


def friction(table: xr.Dataset, axes: Axes | None = None) -> Figure:
    """Draw measured friction in the manner of the paper's Fig. 7.

    Parameters
    ----------
    table : xr.Dataset
        What `slipsweep.studies.friction.friction_table` returns.

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time: accelerations of table and block; μ(t)/μs.  Slides are shaded, from onset to stop.
    """
    figure, panels = new_panels(axes, 2, 1, (7.0, 4.5), sharey=False)
    accelerations, ratio = panels.ravel()
    time = table["time"].values
    accelerations.plot(time, table["ground_acceleration"].values, color=BLUE, label="table")
    accelerations.plot(time, table["block_acceleration"].values, color=VERMILION, linewidth=1.0, label="block")
    accelerations.set_ylabel("acceleration\n(m/s²)")
    accelerations.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    ratio.plot(time, table["friction_ratio"].values, color=VERMILION, linewidth=1.0)
    ratio.axhline(1.0, color=_GREY, linewidth=0.8, linestyle="--")
    ratio.set_ylabel("friction coefficient\nμ(t) / μs")
    ratio.set_xlabel("time (s)")
    stops = np.where(np.isnan(table["slide_stop"].values), time[-1], table["slide_stop"].values)
    for panel in (accelerations, ratio):
        for onset, stop in zip(table["slide_onset"].values, stops, strict=True):
            panel.axvspan(onset, stop, color="0.92", zorder=0)
    _finish(figure, (accelerations, ratio))
    figure.supxlabel(
        f"θ = {table['theta'].item():.4g}°, μs = {table['mu_s'].item():.4g}; shaded: slides, relative acceleration "
        f"beyond {table.attrs['threshold']:.3g} m/s²",
        fontsize="small",
    )
    return figure


def calibration(table: xr.Dataset, axes: Axes | None = None) -> Figure:
    """Draw measured against computed motion in the manner of the paper's Figs. 8 and 9.

    Parameters
    ----------
    table : xr.Dataset
        What `slipsweep.studies.calibration.calibration_table` returns.

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time: the table's acceleration, then each channel of the block, measured or not, with its misfit;
        parameters with their intervals in a caption.
    """
    figure, grid = new_panels(axes, 4, 1, (7.0, 7.5), sharey=False)
    panels = tuple(grid.ravel())
    time, measured = table["time"].values, json.loads(table.attrs["channels"])
    ground = panels[0]
    ground.plot(time, table["measured_ground_acceleration"].values, ".", color=_GREY, markersize=2, label="measured")
    ground.plot(time, table["computed_ground_acceleration"].values, color=BLUE, label="smooth")
    ground.set_ylabel("acceleration of\nthe table (m/s²)")
    ground.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    for panel, (name, label) in zip(panels[1:], _LABELS.items(), strict=True):
        factor = 1000.0 if name == "relative_displacement" else 1.0
        if name in measured:
            values = factor * table[f"measured_{name}"].values
            panel.plot(time, values, ".", color=_GREY, markersize=2, label="measured")
        panel.plot(time, factor * table[f"computed_{name}"].values, color=VERMILION, linewidth=1.2, label="computed")
        panel.set_ylabel(label)
        if name in measured:
            unit = "mm" if name == "relative_displacement" else HISTORY[name]["units"].replace(" s-2", "/s²")
            unit = unit.replace(" s-1", "/s")
            misfit = factor * table[f"misfit_{name}"].item()
            share = table[f"relative_misfit_{name}"].item()
            text = f"misfit {misfit:.2g} {unit} ({share:.1%} of the largest)"
        else:
            text = "not measured"
        panel.set_title(text, fontsize="small", loc="left")
    panels[1].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    panels[-1].set_xlabel("time (s)")
    _finish(figure, panels)
    figure.supxlabel(_caption(table), fontsize="small")
    return figure


def _caption(table: xr.Dataset) -> str:
    """The parameters with their 95 % intervals."""
    parts = []
    for name, sign, unit in (
        ("yield_acceleration", "Üy", " m/s²"),
        ("decay_rate", "λ", ""),
        ("delta_mu", "Δμ", ""),
    ):
        low, high = table[f"{name}_interval"].values
        between = f" ({low:.3g} to {high:.3g})" if np.isfinite(low) else " (not determined)"
        parts.append(f"{sign} = {table[name].item():.4g}{unit}{between}")
    given = f"θ = {table['theta'].item():.4g}°, μs = {table['mu_s'].item():.4g}"
    return f"{', '.join(parts)}; 95 % intervals\n{given}"


def _finish(figure: Figure, panels: tuple[Axes, ...]) -> None:
    for axes in panels:
        axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        axes.margins(x=0)
        axes.grid(color="0.9")
    figure.align_ylabels()
