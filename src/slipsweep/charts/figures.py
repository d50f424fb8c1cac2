"""The figure of a time history: a table in, a matplotlib figure out (`charts` has those of sweeps).

Figures are made without pyplot, hence without a window system or state between calls;
`matplotlib.figure.Figure.savefig` writes them in any format.
"""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from slipsweep.charts.answers import boundaries
from slipsweep.charts.sheet import LINES, new_panels
from slipsweep.charts.style import BLUE, VERMILION, caption
from slipsweep.model.variables import HISTORY, SlidingMode

#: How the half waves of a record are drawn: told apart in grey, too.
_MODES: dict[SlidingMode, tuple[str, dict[str, Any]]] = {
    SlidingMode.STUCK: ("no sliding", {"facecolor": "white", "edgecolor": "0.6", "linewidth": 0.5}),
    SlidingMode.STICK_SLIP: (
        "stick–slip", {"facecolor": "#BBD7EA", "edgecolor": BLUE, "linewidth": 0.5}
    ),
    SlidingMode.CONTINUOUS: (
        "continuous", {"facecolor": VERMILION, "edgecolor": "black", "linewidth": 0.5, "hatch": "/////"}
    ),
}  # fmt: skip


def history(table: xr.Dataset, axes: Axes | None = None) -> Figure:
    """Draw a time history in the manner of the paper's Figs. 5, 8 and 9.

    Parameters
    ----------
    table : xr.Dataset
        What `slipsweep.studies.history.history_table` returns.
    axes : Axes, optional
        Refused: there are several panels.

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time: accelerations of plane and block, friction coefficient,
        relative velocity, relative displacement; the parameters in a caption.  Under a record a row of boxes on top has
        the sliding mode of each positive half wave, and lines show the accelerations of yield and of the mode limit.
    """
    values = {name: table[name].values for name in ("time", *HISTORY) if name in table}
    modes = "half_wave_mode" in table
    rows = len(values) - 2  # both accelerations share one panel
    ratios = [*([0.22] if modes else []), *([1.0] * rows)]
    figure, grid = new_panels(
        axes, len(ratios), 1, (7.0, 7.0 + 0.5 * modes), sharey=False, gridspec_kw={"height_ratios": ratios}
    )
    panels = list(grid.ravel()[modes:])
    accelerations, *_, velocity, displacement = panels
    time = values["time"]

    accelerations.plot(time, values["ground_acceleration"], color=BLUE, label="plane")
    accelerations.plot(time, values["block_acceleration"], color=VERMILION, linestyle="--", label="block")
    if modes:
        _draw_modes(grid.ravel()[0], table)
        _draw_thresholds(accelerations, table)
    accelerations.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, frameon=False)
    accelerations.set_ylabel("acceleration\n(m/s²)")

    if "friction_coefficient" in values:
        panels[1].plot(time, values["friction_coefficient"], color=VERMILION)
        panels[1].set_ylabel("friction\ncoefficient")

    velocity.plot(time, values["relative_velocity"], color=VERMILION)
    velocity.set_ylabel("relative\nvelocity (m/s)")

    moved = np.abs(values["relative_displacement"])
    metres = bool((moved >= 1.0).any())
    displacement.plot(time, values["relative_displacement"] * (1 if metres else 1000), color=VERMILION)
    displacement.set_ylabel(f"relative\ndisplacement ({'m' if metres else 'mm'})")
    displacement.set_xlabel("time (s)")

    for panel in panels:
        panel.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        panel.margins(x=0)
        panel.grid(color="0.9")
    figure.align_ylabels()
    figure.supxlabel(caption(table), fontsize="small")
    return figure


def _draw_modes(panel: Axes, table: xr.Dataset) -> None:
    """A box for each positive half wave of the record, by the sliding mode that its peak decides."""
    start, end, mode = (table[f"half_wave_{name}"].values for name in ("start", "end", "mode"))
    entries = []
    for one, (text, look) in _MODES.items():
        which = mode == one
        if which.any():
            spans = list(zip(start[which], (end - start)[which], strict=True))
            panel.broken_barh(spans, (0.0, 1.0), gid=one.name.lower(), **look)
        entries.append(Patch(label=f"{text} ({np.count_nonzero(which)})", **look))
    panel.set_ylim(0.0, 1.0)
    panel.set_yticks([])
    panel.tick_params(axis="x", bottom=False)
    panel.set_ylabel("half\nwaves", rotation=0, ha="right", va="center", fontsize="small")
    panel.legend(handles=entries, loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False, fontsize="small")
    panel.margins(x=0)


def _draw_thresholds(panel: Axes, table: xr.Dataset) -> None:
    """Lines of the accelerations of yield and, but for Newmark's block, of the mode limit."""
    if "theta" in table and "mu_s" in table:
        found = {name: one.values.item() for name, one in boundaries(table).items()}
    else:
        found = {"yield_acceleration": table["yield_coefficient"].values.item() * float(table.attrs["g"])}
    highest = table["half_wave_peak"].values.max(initial=0.0)
    for name, value in found.items():
        if np.isfinite(value) and value <= 1.5 * highest:
            text, look = LINES[name]
            panel.axhline(value, label=text, gid=name, **{**look, "linewidth": 0.9, "zorder": 1.5})
