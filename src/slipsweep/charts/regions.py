"""Regions of a map: their boundaries and their painting.

The cells of a map are points.  A threshold between them (the yield acceleration, the mode limit,
θ = φ) lies where a margin, which has a value at each cell, is interpolated to zero.  Up to there
the values of the nearest cells are continued.
"""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.patches import Patch
from matplotlib.path import Path
from numpy.typing import NDArray
from scipy import ndimage

from slipsweep.charts.sheet import Panel
from slipsweep.charts.style import Floats, Look

Cells = NDArray[np.bool_]


def excess_over(panel: Panel, line: str) -> Any:
    """Return amplitude less threshold, masked where there is no threshold."""
    return np.ma.masked_invalid(
        panel.grid("amplitude") - (panel.grid(line) if line in panel.data else np.nan)
    )


def at_rest(panel: Panel) -> Cells:
    """Return True where the block does not slide under its own weight."""
    return np.asarray(panel.grid("rest_angle") > 0)


def sides_of(panel: Panel) -> list[tuple[Cells, Path | None]]:
    """Return the cells on either side of the mode limit that do not slide under their own weight.

    With each side comes its region.  There is one side, and no region, if the limit does not divide
    the panel.
    """
    excess = excess_over(panel, "limit_line")
    beyond = excess.filled(-1.0) > 0
    rests = at_rest(panel)
    if beyond.all() or not beyond.any():
        return [(rests, None)]
    return [(~beyond & rests, _region(panel, -excess)), (beyond & rests, _region(panel, excess))]


def _region(panel: Panel, margin: Any) -> Path:
    """Return the region in which a margin is above zero, in data coordinates."""
    there = ~np.ma.getmaskarray(margin)
    margin = continued(np.ma.getdata(margin), there)
    area = panel.axes.contourf(panel.xs, panel.ys, margin, [0.0, float(margin.max()) + 1.0])
    area.remove()
    (region,) = area.get_paths()
    return region


def continued(values: Any, inside: Cells) -> Any:
    """Return values in which cells outside of a region have that of the nearest one inside.

    If no cell is inside, values stay as they are.
    """
    if not inside.any():
        return values
    nearest = ndimage.distance_transform_edt(~inside, return_distances=False, return_indices=True)
    return values[tuple(nearest)]


def edges_of(values: Floats, scale: str) -> Floats:
    """Return edges of cells, half way between neighbours as drawn, and the ends of the axis."""
    drawn = np.log(values) if scale == "log" else values
    between = (drawn[1:] + drawn[:-1]) / 2.0
    if scale == "log":
        between = np.exp(between)
    return np.concatenate([values[:1], between, values[-1:]])


def steps(panel: Panel, cells: Cells) -> tuple[Floats, Floats, Any]:
    """Return edges of cells and a margin that is above zero in them (arguments of `paint`)."""
    xs = edges_of(panel.xs, panel.axes.get_xscale())
    ys = edges_of(panel.ys, panel.axes.get_yscale())
    margin = np.repeat(np.repeat(cells, 2, axis=0), 2, axis=1) - 0.5
    return np.repeat(xs, 2)[1:-1], np.repeat(ys, 2)[1:-1], margin


def clip(panel: Panel, artist: Any, region: Path | None) -> None:
    """Show the part of an artist that lies in a region."""
    if region is not None:
        artist.set_clip_path(region, panel.axes.transData)


def paint(panel: Panel, xs: Floats, ys: Floats, margin: Floats, zorder: float, look: Look) -> Any:
    """Cover the region in which a margin is above zero with a colour and a hatch."""
    fill: Look = {
        "colors": [look["facecolor"]],
        "hatches": [_dense(panel, look["hatch"])],
        "zorder": zorder,
    }
    with mpl.rc_context({"hatch.linewidth": 0.6}):
        area = panel.axes.contourf(xs, ys, margin, [0.0, float(margin.max()) + 1.0], **fill)
    area.set(edgecolor=look["edgecolor"], linewidth=0)
    return area


def legend_patch(panel: Panel, look: Look) -> Patch:
    """Return the legend's patch of a region."""
    with mpl.rc_context({"hatch.linewidth": 0.6}):
        return Patch(linewidth=0.6, **{**look, "hatch": _dense(panel, look["hatch"])})


def _dense(panel: Panel, hatch: str) -> str:
    """Return a hatch that is denser in narrow figures, as their text is smaller."""
    return hatch[:1] * round(len(hatch) * 10.0 / panel.options.font)
