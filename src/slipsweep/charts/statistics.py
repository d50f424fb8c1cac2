"""Charts of statistics: fragility curves, bands of quantiles, Sobol indices."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slipsweep.charts import style
from slipsweep.charts.sheet import Sheet, curve_looks, log_axis, plot_curve
from slipsweep.charts.slices import Result
from slipsweep.charts.style import BLUE, VERMILION, Look, Options
from slipsweep.errors import InputError
from slipsweep.files.selection import axis_labels
from slipsweep.model.units import in_mm
from slipsweep.model.variables import PARAMETERS, STRENGTHS, SensitivityStatus
from slipsweep.studies.solved_again import DRIVES

#: Axes that statistics are drawn over, in order of preference.
_AXES = (*DRIVES, *STRENGTHS)

#: Sobol indices: name, interval, words, colour of bars.
_INDICES = (
    ("total_index", "total_interval", "total", VERMILION),
    ("first_order_index", "first_order_interval", "first order", BLUE),
)
_FIRST_ORDER: Look = {"linestyle": (0, (3, 1.5)), "linewidth": 1.0}


def fragility(result: Result, options: Options) -> Figure:
    """Draw the probability of exceeding a displacement over one axis, a curve a threshold."""
    if options.levels:
        raise InputError(
            f"{result.name}: levels: not with statistics, whose thresholds are those in the file"
        )
    names = ["exceedance_probability", "valueless_share"]
    return draw_fragility(result.sheet(options, names, _AXES, curves=["threshold"]))


def draw_fragility(sheet: Sheet) -> Figure:
    """Draw curves of `exceedance_probability`, and the share of samples without a value."""
    thresholds = sheet.data["threshold"]
    fixed = style.length_text(thresholds.item()) if thresholds.ndim == 0 else None
    symbol = style.displacement_symbol(sheet.data.attrs)
    for panel in sheet.panels:
        panel.axes.grid(color="0.9")
        curves = panel.grid("exceedance_probability")
        for member, (curve, look) in enumerate(zip(curves, curve_looks(len(curves)), strict=True)):
            text = panel.member(member) or f"d = {fixed}"
            sheet.legend[text] = plot_curve(
                panel.axes, panel.xs, curve, member / len(curves), label=text, **look
            )
        shares = panel.grid("valueless_share")
        if shares.any():
            dotted = panel.axes.plot(panel.xs, shares.max(axis=0), color="0.4", linestyle=":")
            sheet.legend["no value (share)"] = dotted[0]
        event = f"{symbol} > d" if fixed is None or sheet.y is None else f"{symbol} > {fixed}"
        panel.axes.set(ylim=(-0.02, 1.02), ylabel=f"probability of exceedance P({event})")
    return sheet.done()


def quantiles(result: Result, options: Options) -> Figure:
    """Draw bands between quantiles of the permanent displacement over one axis."""
    sheet = result.sheet(
        options, ["displacement_quantile", "valueless_share"], _AXES, keep=["quantile"]
    )
    everything = in_mm(sheet.data["displacement_quantile"].values)
    shares = np.atleast_1d(sheet.data["quantile"].values)
    for panel in sheet.panels:
        label = f"{style.displacement_text(sheet.data.attrs)} (mm)"
        floor = log_axis(panel.axes, everything, label, zeros=True)
        values = in_mm(panel.grid("displacement_quantile", "quantile", panel.x))
        shown = np.maximum(values, floor)
        xs = panel.xs
        middle = shares.size // 2
        for low in range(middle):
            high = shares.size - 1 - low
            colour = mpl.colormaps["Blues"](0.2 + 0.3 * low / middle)
            band = panel.axes.fill_between(
                xs, shown[low], shown[high], facecolor=colour, linewidth=0
            )
            sheet.legend[f"{shares[low] * 100:g} to {shares[high] * 100:g} %"] = band
        if shares.size % 2:
            text = "median" if shares[middle] == 0.5 else f"{shares[middle] * 100:g} %"
            sheet.legend[text] = panel.axes.plot(
                xs, shown[middle], color=BLUE, linewidth=1.8, label=text
            )[0]
    if (most := float(sheet.data["valueless_share"].max())) > 0:
        sheet.note(f"Without a value: up to {most:.1%} of the samples.")
    return sheet.done()


def sensitivity(result: Result, options: Options) -> Figure:
    """Draw Sobol indices of every input with their 95 % intervals.

    They are curves over an axis, or bars at one grid point.
    """
    if "total_index" not in result.variables:
        raise InputError(
            f"{result.name}: holds no Sobol indices; sensitivity = true in [uncertainty] computes "
            "them"
        )
    names = [name for index in _INDICES for name in index[:2]] + ["sensitivity_status"]
    left = [
        dim for dim in result.wide if dim in PARAMETERS and dim in result.data["total_index"].dims
    ]
    bars = options.x is None and not {*left} - {*options.at, *options.panels}
    sheet = result.sheet(options, names, "input" if bars else _AXES, keep=["bound", "input"])
    status = {*sheet.data["sensitivity_status"].values.flat}
    reasons = [
        code.text
        for code in SensitivityStatus
        if code in status and code != SensitivityStatus.COMPUTED
    ]
    if not np.isfinite(sheet.data["total_index"]).any():
        raise InputError(
            f"no Sobol indices in this slice: {'; '.join(reasons)}; choose another slice (--at)"
        )
    for text in reasons:
        sheet.note(f"No indices where {text}.")
    inputs = axis_labels(sheet.data, "input")
    symbols = [
        " + ".join(style.SYMBOLS.get(part, style.plain(part)) for part in name.split("+"))
        for name in inputs
    ]
    if bars:
        _draw_bars(sheet, symbols)
        return sheet.done()
    for panel in sheet.panels:
        panel.axes.grid(color="0.9")
        total, first = (panel.grid(name, "input", panel.x) for name, *_ in _INDICES)
        low, high = panel.grid("total_interval", "bound", "input", panel.x)
        for at, look in enumerate(curve_looks(len(inputs))):
            panel.axes.fill_between(
                panel.xs, low[at], high[at], color=look["color"], alpha=0.15, linewidth=0
            )
            solid = {**look, "linestyle": "-", "label": symbols[at]}
            sheet.legend[symbols[at]] = plot_curve(
                panel.axes, panel.xs, total[at], at / len(inputs), **solid
            )
            panel.axes.plot(panel.xs, first[at], color=look["color"], **_FIRST_ORDER)
        panel.axes.set(
            ylim=_ends(sheet, intervals=False), ylabel="Sobol index of the permanent displacement"
        )
    sheet.remarks["total"] = Line2D([], [], color="0.3")
    sheet.remarks["first order"] = Line2D([], [], color="0.3", **_FIRST_ORDER)
    sheet.remarks["95 % interval (total)"] = Patch(alpha=0.15, linewidth=0, color="0.3")
    return sheet.done()


def _draw_bars(sheet: Sheet, symbols: list[str]) -> None:
    """Draw both indices of every input as bars, the largest total index first."""
    order = np.argsort(sheet.data["total_index"].sum(sheet.along).values)
    for panel in sheet.panels:
        for (name, interval, text, colour), shift in zip(_INDICES, (0.2, -0.2), strict=True):
            values = panel.grid(name, "input")[order]
            low, high = panel.grid(interval, "bound", "input")[:, order]
            at = np.arange(len(order)) + shift
            panel.axes.barh(at, values, height=0.36, color=colour)
            sheet.legend[text] = Patch(color=colour)
            # the interval of a bootstrap may end just beside the estimate; NaN: there is none
            ends = np.maximum([values - low, high - values], 0.0)
            panel.axes.errorbar(values, at, xerr=ends, fmt="none", color="black", capsize=2.5)
        panel.axes.set_yticks(np.arange(len(order)), [symbols[at] for at in order])
        panel.axes.axvline(0, color="0.6", linewidth=0.8, zorder=0)
        label = "Sobol index of the permanent displacement"
        panel.axes.set(
            ylim=(-0.6, len(order) - 0.4), xlim=_ends(sheet, intervals=True), xlabel=label
        )
    sheet.legend["95 % interval"] = Line2D([], [], color="black", marker="|", markersize=6)


def _ends(sheet: Sheet, intervals: bool) -> tuple[float, float]:
    """Return the ends of the axis of indices, 0 and 1, or beyond if indices are.

    Intervals extend it to −0.5 and 1.5 at most.
    """
    values = [sheet.data[name].values.ravel() for name, *_ in _INDICES]
    values += (
        [np.clip(sheet.data[name].values.ravel(), -0.5, 1.5) for _, name, *_ in _INDICES]
        if intervals
        else []
    )
    every = np.concatenate(values)
    return min(-0.05, 1.05 * float(np.nanmin(every))), max(1.05, 1.05 * float(np.nanmax(every)))
