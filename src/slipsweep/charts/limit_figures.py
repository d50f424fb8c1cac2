"""The chart of limit amplitudes: curves over one parameter, of a family or of motions, in panels over two more."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts.sheet import Panel, Sheet, curve_looks, over, plot_curve
from slipsweep.charts.slices import NAMED, spread
from slipsweep.charts.style import SYMBOLS, Look, plain
from slipsweep.charts.suite_figures import QUANTILES, SUITE, draw_suite, suite_text
from slipsweep.files.selection import axis_labels
from slipsweep.model.variables import LimitStatus
from slipsweep.studies.suite_statistics import limit_quantiles

#: Most curves in a panel, and panels across and down, that a page can show.
_MOST_CURVES, _MOST_PANELS = 6, 3

#: What is drawn along the abscissa, and as curves, in order of preference.
_ABSCISSAE = ("frequency", "mu_s", "theta", "displacement")
_CURVES = ("theta", "displacement", "mu_s")


def limit_chart(data: xr.Dataset, axes: Axes | None = None, look: Look | None = None) -> Figure:
    """Draw limit amplitudes, in g, over one dimension.

    The abscissa is frequency, else mu_s, theta or displacement; theta (else displacement or
    mu_s) makes a family of curves, the next two dimensions panels.  Of a suite each motion has a thin line, with the
    median and the 16 to 84 % band over them; where there is no abscissa, the motions lie along it.  Of a dimension with
    more values than a page can show, evenly spread ones are drawn and the caption says so; any
    further dimension is drawn at its first value.

    Parameters
    ----------
    data : Dataset
        What `slipsweep.limit_amplitude` returns.
    axes : Axes, optional
        What to draw one panel in, instead of a new figure.
    look : Look, optional

    Returns
    -------
    matplotlib.figure.Figure
        Curves end where no limit exists; circles mark limits set by a discontinuity of the model.
    """
    sizes = {str(dim): size for dim, size in data["limit_amplitude"].sizes.items()}
    suite = [dim for dim in SUITE if dim in sizes] if sizes.get("motion", 1) > 1 else []
    wide = [dim for dim in sizes if sizes[dim] > 1 and dim not in suite]
    x = next((dim for dim in (*_ABSCISSAE, *wide) if dim in wide), "motion" if suite else "")
    curves = next((dim for dim in (*_CURVES, *wide) if dim in wide and dim != x and not suite), None)
    across, down = (*(dim for dim in wide if dim not in (x, curves)), None, None)[:2]
    shown: dict[str, Any] = {
        dim: spread(sizes[dim], _MOST_CURVES if dim == curves else _MOST_PANELS)
        for dim in (curves, across, down)
        if dim is not None
    }
    shown |= {dim: 0 for dim in sizes if dim not in (x, *suite, *shown)}
    sheet = Sheet(data.isel(shown), x, curves, look or Look(), across, down, axes)
    for panel in sheet.panels:
        panel.axes.grid(color="0.9", which="both")
        panel.axes.set_ylabel("limit amplitude A / g")
        if suite:
            _draw_motions(sheet, panel, *suite)
        else:
            _draw_curves(sheet, panel)
    _set_abscissa(sheet)
    # one scale for all, from zero; only now, for it ends the autoscaling
    sheet.panels[0].axes.set_ylim(bottom=0.0)
    if not np.isfinite(data["limit_amplitude"]).any():
        sheet.notes.append("No limits to draw: limit_status has the reasons.")
    if suite:
        sheet.notes.append(_suite_text(data))
    chosen = {dim: np.size(places) for dim, places in shown.items()}
    thinned = [f"{n} of {sizes[dim]} {SYMBOLS.get(dim, dim)}" for dim, n in chosen.items() if n < sizes[dim]]
    if thinned:
        sheet.notes.append(f"Shown: {', '.join(thinned)}.")
    return sheet.done()


def _set_abscissa(sheet: Sheet) -> None:
    """Scale and label of a parameter's axis; names along one of cases or motions."""
    if sheet.x in NAMED:
        names = [plain(name) for name in axis_labels(sheet.data, sheet.x)]
        slanted: dict[str, Any] = {"rotation": 40, "ha": "right"} if sheet.x == "motion" else {}
        for panel in sheet.panels:
            panel.axes.set_xticks(panel.values(sheet.x), names or None, **slanted)
            panel.axes.set_xlabel(sheet.x)
    elif sheet.x:
        sheet.set_axis("x", sheet.x)


def _draw_curves(sheet: Sheet, panel: Panel) -> None:
    """The curves of a family, in circles where a discontinuity of the model sets the limit."""
    xs = panel.values(panel.x) if panel.x else np.zeros(1)
    limits, states = panel.grid("limit_amplitude") / panel.g, panel.grid("limit_status")
    circle: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 9, "color": "0.82", "zorder": 1.5}
    for member, look in enumerate(curve_looks(len(limits))):
        line = plot_curve(panel.axes, xs, limits[member], member / len(limits), **look)
        if panel.y:
            sheet.legend[panel.member(member)] = line
        abrupt = (states[member] >= LimitStatus.AT_MODE_JUMP) & (states[member] <= LimitStatus.AFTER_GAP)
        if abrupt.any():
            (marks,) = panel.axes.plot(xs[abrupt], limits[member][abrupt], **circle)
            sheet.remarks["set by a discontinuity\nof the model"] = marks


def _draw_motions(sheet: Sheet, panel: Panel, *suite: str) -> None:
    """The limits of the motions of a suite, with their median and band."""
    xs, limits = panel.values(panel.x), panel.data["limit_amplitude"]
    found = limit_quantiles(panel.data, QUANTILES)["limit_quantile"]
    quantiles = found.transpose("quantile", ...).values / panel.g
    quantiles[np.isinf(quantiles)] = np.nan
    if panel.x != "motion":
        lines = over(limits, panel.data, (*suite, panel.x)).reshape(-1, xs.size)
        draw_suite(sheet.legend, panel.axes, xs, lines / panel.g, quantiles, None)
        return
    # no lines from motion to motion: a row of points for each polarity, and the quantiles across all of them
    ends = np.array([0.5, xs.size + 0.5])
    draw_suite(sheet.legend, panel.axes, ends, np.empty((0, 2)), np.repeat(quantiles[:, np.newaxis], 2, axis=1), None)
    panel.axes.set_xlim(*ends)
    del sheet.legend["a motion"]
    points = limits.transpose("motion", ...).values.reshape(xs.size, -1)
    polarities = panel.data["polarity"].values if "polarity" in limits.dims else ()
    names = [f"polarity {one:g}" for one in polarities] or ["a motion"]
    look: dict[str, Any] = {"linestyle": "", "markerfacecolor": "white", "color": "0.2"}
    for name, row, marker in zip(names, points.T / panel.g, "os", strict=False):
        (sheet.legend[name],) = panel.axes.plot(xs, row, marker=marker, **look)


def _suite_text(data: xr.Dataset) -> str:
    """What the median is of, and the motions that have no limit."""
    status = data["limit_status"].values
    beyond, invalid = (int(np.count_nonzero(status == one)) for one in (LimitStatus.NOT_REACHED, LimitStatus.INVALID))
    texts = [f"Median and band are of {suite_text(data['limit_amplitude'].sizes)}."]
    if beyond:
        highest = float(data.attrs["maximum_amplitude"]) / float(data.attrs["g"])
        texts.append(
            f"{beyond} of {status.size} limits are above {highest:.4g} g; they count as larger than all others."
        )
    if invalid:
        texts.append(f"{invalid} of {status.size} have no value and are left out.")
    return " ".join(texts)
