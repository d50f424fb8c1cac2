"""The chart of a displacement hazard: mean annual rate against displacement."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from slipsweep.charts.sheet import Drawing, curve_looks
from slipsweep.charts.style import Look, model_text, plain
from slipsweep.errors import InputError
from slipsweep.studies.suite_statistics import point_names

Floats = NDArray[np.float64]

#: Most grid points, a curve each, and displacements of a curve.
_MOST_CURVES, _POINTS = 8, 121

#: Most displacements that are marked on a curve.
_MOST_MARKS = 20


def drawn_thresholds(data: xr.Dataset, requested: Floats) -> Floats:
    """Displacements that a curve is drawn through: those requested, and as many as a smooth one needs.

    Parameters
    ----------
    data : Dataset
        The displacements under the suite.
    requested : array
        Displacements, m, increasing.
    """
    most = max(np.nanmax(data["permanent_displacement"].values), requested[-1])
    least = min([one for one in requested if one > 0.0] + [most]) / 10.0
    return np.union1d(np.geomspace(least, most, _POINTS) if most > 0.0 else [], requested)


def hazard_chart(
    rates: xr.Dataset, axes: Axes | None = None, look: Look | None = None, marked: Floats | None = None
) -> Figure:
    """Draw the mean annual rate of exceedance over the displacement.

    Parameters
    ----------
    rates : Dataset
        What `slipsweep.displacement_hazard` returns.
    axes : Axes, optional
        What to draw in, instead of a new figure.
    look : Look, optional
    marked : array, optional
        Its displacements that are marked; by default all, if they are few.

    Returns
    -------
    matplotlib.figure.Figure
        A curve for each grid point, dotted where more than half of the rate is held above the largest amplitude.

    Raises
    ------
    InputError
        There are too many grid points to tell apart, or no rate above 0.
    """
    names = point_names(rates, rates["valueless_share"].sizes)
    if len(names) > _MOST_CURVES:
        raise InputError(
            f"{len(names)} grid points: a chart shows {_MOST_CURVES} at most; cut axes with --at NAME=VALUE"
        )
    wanted = rates["threshold"].values
    if marked is None:
        marked = wanted if wanted.size <= _MOST_MARKS else wanted[:0]
    marks = np.isin(wanted, marked)
    lines, held = (rates[name].values.reshape(-1, wanted.size) for name in ("annual_rate", "held_rate"))
    if not (lines[:, marks if marks.any() else slice(None)] > 0.0).any():
        raise InputError("no motion exceeds any of the given displacements: there is nothing to draw")
    drawing = Drawing(look or Look(), 1, 1, (6.4, 4.8), axes)
    panel = drawing.grid[0, 0]
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.grid(color="0.9", which="both")
    for style, name, line, part in zip(curve_looks(len(names)), names, lines, held, strict=True):
        shown = np.where((line > 0.0) & (wanted > 0.0), line, np.nan)
        above = part > 0.5 * line
        joined = above | np.append(False, above[:-1]) | np.append(above[1:], False)  # no gaps between the two
        dashed = {"color": style["color"], "linestyle": style["linestyle"]}
        panel.plot(wanted * 1000.0, np.where(above, np.nan, shown), **dashed)
        panel.plot(wanted * 1000.0, np.where(joined, shown, np.nan), color=style["color"], linestyle=":")
        (line_shown,) = panel.plot(
            wanted[marks] * 1000.0, shown[marks], **{**style, "linestyle": "none"} if marks.any() else dashed
        )
        if name:
            drawing.legend[plain(name)] = line_shown
    panel.set_xlabel("permanent displacement d (mm)")
    panel.set_ylabel("mean annual rate of u > d (1/year)")
    texts = [model_text(rates.attrs), f"hazard curve: {plain(str(rates.attrs['hazard_curve']))}"]
    if (held > 0.5 * lines).any():
        texts.append("Dotted: more than half of the rate comes from above the largest amplitude of the sweep, "
                     "where P is held constant.")  # fmt: skip
    return drawing.finish(texts)
