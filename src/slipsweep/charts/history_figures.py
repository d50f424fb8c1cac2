"""The figure of a time history."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from slipsweep.charts.answers import thresholds
from slipsweep.charts.sheet import Drawing
from slipsweep.charts.style import BLUE, LINES, MODE_TEXT, VERMILION, Look, caption
from slipsweep.model.variables import SlidingMode

#: How the half waves of a record are drawn: told apart in grey, too.
_MODES: dict[SlidingMode, dict[str, Any]] = {
    SlidingMode.STUCK: {"facecolor": "white", "edgecolor": "0.6", "linewidth": 0.5},
    SlidingMode.STICK_SLIP: {"facecolor": "#BBD7EA", "edgecolor": BLUE, "linewidth": 0.5},
    SlidingMode.CONTINUOUS: {"facecolor": VERMILION, "edgecolor": "black", "linewidth": 0.5, "hatch": "/////"},
}

#: What legends above a panel have in common.
_ABOVE: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1, 1), "frameon": False, "fontsize": "small"}


def history(data: xr.Dataset, axes: Axes | None = None, look: Look | None = None) -> Figure:
    """Draw a time history in the manner of the paper's Figs. 5, 8 and 9.

    Parameters
    ----------
    data : Dataset
        What `slipsweep.simulate` returns.
    axes : Axes, optional
        Refused: there are several panels.
    look : Look, optional

    Returns
    -------
    matplotlib.figure.Figure
        Panels over time: accelerations of base and block, friction coefficient, relative velocity, relative
        displacement; the parameters in a caption.  Under a record a row of boxes on top has the sliding mode of each
        positive half wave, and lines show the accelerations of yield and of the mode limit.
    """
    look = look or Look()
    modes, friction = "half_wave_mode" in data, "friction_coefficient" in data
    heights = [*([0.22] if modes else []), *([1.0] * (3 + friction))]
    drawing = Drawing(
        look, len(heights), 1, (7.0, 7.0 + 0.5 * modes), axes, sharey=False, gridspec_kw={"height_ratios": heights}
    )
    panels = list(drawing.grid.ravel()[modes:])
    accelerations, *_, velocity, displacement = panels
    time = data["time"].values
    accelerations.plot(time, data["ground_acceleration"].values, color=BLUE, label="base")
    accelerations.plot(time, data["block_acceleration"].values, color=VERMILION, linestyle="--", label="block")
    if modes:
        _draw_modes(drawing.grid[0, 0], data)
        _draw_thresholds(accelerations, data)
    accelerations.legend(ncols=4, **_ABOVE)
    accelerations.set_ylabel("acceleration\n(m/s²)")
    if friction:
        panels[1].plot(time, data["friction_coefficient"].values, color=VERMILION)
        panels[1].set_ylabel("friction\ncoefficient")
    velocity.plot(time, data["relative_velocity"].values, color=VERMILION)
    velocity.set_ylabel("relative\nvelocity (m/s)")
    metres = bool((np.abs(data["relative_displacement"]) >= 1.0).any())
    displacement.plot(time, data["relative_displacement"].values * (1 if metres else 1000), color=VERMILION)
    displacement.set_ylabel(f"relative\ndisplacement ({'m' if metres else 'mm'})")
    displacement.set_xlabel("time (s)")
    drawing.mark_zero(panels)
    return drawing.finish([caption(data, look)])


def _draw_modes(panel: Axes, data: xr.Dataset) -> None:
    """A box for each positive half wave of the record, by the sliding mode that its peak decides."""
    start, end, mode = (data[f"half_wave_{name}"].values for name in ("start", "end", "mode"))
    entries = []
    for one, look in _MODES.items():
        which = mode == one
        if which.any():
            spans = list(zip(start[which], (end - start)[which], strict=True))
            panel.broken_barh(spans, (0.0, 1.0), gid=one.name.lower(), **look)
        entries.append(Patch(label=f"{MODE_TEXT[one]} ({np.count_nonzero(which)})", **look))
    panel.set_ylim(0.0, 1.0)
    panel.set_yticks([])
    panel.tick_params(axis="x", bottom=False)
    panel.set_ylabel("half\nwaves", rotation=0, ha="right", va="center", fontsize="small")
    panel.legend(handles=entries, ncols=3, **_ABOVE)
    panel.margins(x=0)


def _draw_thresholds(panel: Axes, data: xr.Dataset) -> None:
    """Lines of the accelerations of yield and, but for Newmark's block, of the mode limit."""
    highest = data["half_wave_peak"].values.max(initial=0.0)
    for name, value in thresholds(data).items():
        if np.isfinite(value) and value <= 1.5 * highest:
            text, look = LINES[str(name)]
            panel.axhline(value.item(), label=text, gid=name, **{**look, "linewidth": 0.9, "zorder": 1.5})
