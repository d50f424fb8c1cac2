"""Charts of uncertain inputs: fragility curves, and bands of quantiles."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from slipsweep.charts import charts
from slipsweep.charts.style import BLUE, axis_label, value_text
from slipsweep.grid.tables import Table

Floats = NDArray[np.float64]

#: Least displacement of a logarithmic axis, mm, where the largest is far above.
_LEAST = 1.0


def fragility(table: Table, x: str, family: str | None) -> Figure:
    """Draw the probability of exceeding a displacement over one axis.

    Parameters
    ----------
    table : Table
        Slice over `x` and `family` that holds `exceedance_probability` and `valueless_share`.
    x : str
        The axis to draw over, mostly that of the amplitude.
    family : str or None
        The axis whose values tell the curves apart, mostly the threshold.

    Returns
    -------
    matplotlib.figure.Figure
        A dotted line shows the share of samples without a value, where there are any.
    """
    figure, axes = charts.new_plot()
    dims = (family, x) if family else (x,)
    curves = np.atleast_2d(charts.broadcast(table["exceedance_probability"], table, dims))
    members = table[family].values if family else np.zeros(1)
    for curve, member, colour in zip(curves, members, charts.curve_colours(members.size), strict=True):
        text = _threshold_text(table["threshold"].item()) if family is None else _member_text(family, member)
        charts.plot_curve(axes, table[x].values, curve, color=colour, label=text)
    shares = np.atleast_2d(charts.broadcast(table["valueless_share"], table, dims))
    if shares.any():
        axes.plot(table[x].values, shares.max(axis=0), color="0.4", linestyle=":", label="no value (share)")
    axes.set_ylim(-0.02, 1.02)
    given = "u > d" if family in (None, "threshold") else f"u > {_length_text(table['threshold'].item())}"
    axes.set_ylabel(f"probability of exceedance P({given})")
    _finish(figure, axes, table, x)
    return figure


def quantile_bands(table: Table, x: str) -> Figure:
    """Draw bands between quantiles of the permanent displacement over one axis.

    Parameters
    ----------
    table : Table
        Slice over `x` and `quantile` that holds `displacement_quantile` and `valueless_share`.
    x : str
        The axis to draw over.
    """
    figure, axes = charts.new_plot()
    values = charts.broadcast(table["displacement_quantile"], table, ("quantile", x)) * 1000.0
    quantiles, xs = np.atleast_1d(table["quantile"].values), table[x].values
    charts.check_positive("permanent displacement", values)
    axes.set_yscale("log")
    charts.limit_decades(axes, values, _LEAST)
    if (values <= 0).any() and axes.get_ylim()[1] > 10 * _LEAST:
        axes.set_ylim(bottom=_LEAST / 1.2)
    # what is zero lies below any logarithmic axis, not nowhere
    floor = axes.get_ylim()[0] / 10
    shown = np.where(np.isnan(values), np.nan, np.maximum(values, floor))
    pairs = [(low, quantiles.size - 1 - low) for low in range(quantiles.size // 2)]
    for number, (low, high) in enumerate(pairs):
        axes.fill_between(
            xs, shown[low], shown[high], color=BLUE, alpha=0.2 + 0.2 * number / len(pairs), linewidth=0,
            label=f"{quantiles[low] * 100:g} to {quantiles[high] * 100:g} %",
        )  # fmt: skip
    if quantiles.size % 2:
        middle = quantiles.size // 2
        text = "median" if quantiles[middle] == 0.5 else f"{quantiles[middle] * 100:g} %"
        axes.plot(xs, shown[middle], color=BLUE, linewidth=1.8, label=text)
    axes.set_ylabel("permanent displacement (mm)")
    most = float(table["valueless_share"].values.max())
    if most > 0:
        axes.plot([], [], linestyle="", label=f"without a value:\nup to {most:.1%} of samples")
    _finish(figure, axes, table, x)
    return figure


def _finish(figure: Figure, axes: Axes, table: Table, x: str) -> None:
    charts.set_scale(axes, "x", table[x].values)
    axes.set_xlabel(axis_label(x))
    if x == "amplitude":
        charts.second_scale(axes, table, "x")
    charts.add_legend(axes, figure)
    charts.add_caption(figure, table)


def _member_text(family: str, member: float) -> str:
    return _threshold_text(member) if family == "threshold" else value_text(family, member)


def _threshold_text(threshold: float) -> str:
    return f"d = {_length_text(threshold)}"


def _length_text(length: float) -> str:
    return f"{length * 1000:.4g} mm" if length < 1.0 else f"{length:.4g} m"
