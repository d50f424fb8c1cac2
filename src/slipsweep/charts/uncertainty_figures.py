"""Charts of uncertain inputs: fragility curves, and bands of quantiles."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slipsweep.charts.sheet import Sheet, check_positive, curve_looks, log_axis, over, plot_curve
from slipsweep.charts.style import BLUE, length_text

#: Least displacement of a logarithmic axis, mm, where the largest is far above.
_LEAST = 1.0


def fragility(sheet: Sheet) -> Figure:
    """Draw the probability of exceeding a displacement over one axis, mostly that of the amplitude.

    Parameters
    ----------
    sheet : Sheet
        Of a slice that holds `exceedance_probability` and `valueless_share`; mostly the threshold tells
        curves apart.

    Returns
    -------
    matplotlib.figure.Figure
        A dotted line shows the share of samples without a value, where there are any.
    """
    sheet.set_axis("x", sheet.x)
    fixed = None if "threshold" in (sheet.y, sheet.across, sheet.down) else length_text(sheet.data["threshold"].item())
    for panel in sheet.panels:
        panel.axes.grid(color="0.9")
        curves = panel.grid("exceedance_probability")
        for member, (curve, look) in enumerate(zip(curves, curve_looks(len(curves)), strict=True)):
            text = panel.member(member) or f"d = {fixed}"
            line = plot_curve(panel.axes, panel.values(panel.x), curve, member / len(curves), label=text, **look)
            sheet.legend[text] = line
        shares = panel.grid("valueless_share")
        if shares.any():
            plain: dict[str, Any] = {"color": "0.4", "linestyle": ":"}
            panel.axes.plot(panel.values(panel.x), shares.max(axis=0), **plain)
            sheet.legend["no value (share)"] = Line2D([], [], **plain)
        panel.axes.set_ylim(-0.02, 1.02)
        given = "u > d" if fixed is None or sheet.y is None else f"u > {fixed}"
        panel.axes.set_ylabel(f"probability of exceedance P({given})")
    return sheet.done()


def quantile_bands(sheet: Sheet) -> Figure:
    """Draw bands between quantiles of the permanent displacement over one axis.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over its abscissa and `quantile` that holds `displacement_quantile` and `valueless_share`.
    """
    everything = sheet.data["displacement_quantile"].values * 1000.0
    check_positive("permanent displacement", everything)
    sheet.set_axis("x", sheet.x)
    quantiles = np.atleast_1d(sheet.data["quantile"].values)
    for panel in sheet.panels:
        floor = log_axis(panel.axes, everything, _LEAST, zeros=True)
        data = panel.data
        values = over(data["displacement_quantile"], data, ("quantile", panel.x)) * 1000.0
        shown, xs = np.where(np.isnan(values), np.nan, np.maximum(values, floor)), panel.values(panel.x)
        pairs = [(low, quantiles.size - 1 - low) for low in range(quantiles.size // 2)]
        for number, (low, high) in enumerate(pairs):
            colour = mpl.colormaps["Blues"](0.2 + 0.3 * number / len(pairs))
            look: dict[str, Any] = {"facecolor": colour, "linewidth": 0}
            panel.axes.fill_between(xs, shown[low], shown[high], **look)
            sheet.legend[f"{quantiles[low] * 100:g} to {quantiles[high] * 100:g} %"] = Patch(**look)
        if quantiles.size % 2:
            middle = quantiles.size // 2
            text = "median" if quantiles[middle] == 0.5 else f"{quantiles[middle] * 100:g} %"
            sheet.legend[text] = panel.axes.plot(xs, shown[middle], color=BLUE, linewidth=1.8, label=text)[0]
        panel.axes.set_ylabel("permanent displacement (mm)")
    most = float(sheet.data["valueless_share"].max())
    if most > 0:
        sheet.notes.append(f"Without a value: up to {most:.1%} of the samples.")
    return sheet.done()
