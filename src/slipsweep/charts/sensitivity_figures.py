"""Charts of Sobol indices: bars at one grid point, curves over an axis."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slipsweep.charts.sheet import Sheet, curve_looks, over, plot_curve
from slipsweep.charts.style import BLUE, SYMBOLS, VERMILION, plain
from slipsweep.errors import InputError
from slipsweep.files.selection import axis_labels
from slipsweep.model.variables import SensitivityStatus

#: Results that the charts show, and how: name, interval, text, colour of bars.
_INDICES = (
    ("total_index", "total_interval", "total", VERMILION),
    ("first_order_index", "first_order_interval", "first order", BLUE),
)

NAMES = ("total_index", "total_interval", "first_order_index", "first_order_interval", "sensitivity_status")

_LABEL = "Sobol index of the permanent displacement"


def bars(sheet: Sheet) -> Figure:
    """Draw both indices of every input at one grid point, with their intervals, the largest total index first.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over `input` and `bound` that holds `NAMES`.
    """
    _check_there(sheet)
    inputs = axis_labels(sheet.data, "input")
    _legend(sheet)
    totals = over(sheet.data["total_index"], sheet.data, ("input", sheet.across, sheet.down))
    order = np.argsort(np.nan_to_num(totals).reshape(len(inputs), -1).sum(axis=1))
    places = np.arange(len(inputs))
    for panel in sheet.panels:
        for number, (name, interval, _, colour) in enumerate(_INDICES):
            values = over(panel.data[name], panel.data, ("input",))[order]
            low, high = over(panel.data[interval], panel.data, ("bound", "input"))[:, order]
            at = places + (0.2, -0.2)[number]
            panel.axes.barh(at, values, height=0.36, color=colour)
            there = np.isfinite(values + low + high)
            # a bootstrap's interval may, by a hair, not hold the estimate
            beside = np.maximum([(values - low)[there], (high - values)[there]], 0.0)
            panel.axes.errorbar(values[there], at[there], xerr=beside, fmt="none", color="black", capsize=2.5)
        panel.axes.set_yticks(places, [_symbol(inputs[at]) for at in order])
        panel.axes.set_ylim(-0.6, len(inputs) - 0.4)
        panel.axes.set_xlim(*_ends(sheet, [interval for _, interval, _, _ in _INDICES]))
        panel.axes.axvline(0, color="0.6", linewidth=0.8, zorder=0)
        panel.axes.set_xlabel(_LABEL)
    return sheet.done()


def curves(sheet: Sheet) -> Figure:
    """Draw the indices of every input over one axis, the total one with a band, its 95 % interval.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over its abscissa, `input` and `bound` that holds `NAMES`.
    """
    _check_there(sheet)
    inputs = axis_labels(sheet.data, "input")
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        panel.axes.grid(color="0.9")
        xs = panel.values(panel.x)
        total, first = (over(panel.data[name], panel.data, ("input", panel.x)) for name, *_ in _INDICES)
        low, high = over(panel.data["total_interval"], panel.data, ("bound", "input", panel.x))
        for at, look in enumerate(curve_looks(len(inputs))):
            panel.axes.fill_between(xs, low[at], high[at], color=look["color"], alpha=0.15, linewidth=0)
            text = _symbol(inputs[at])
            line = plot_curve(panel.axes, xs, total[at], at / len(inputs), **{**look, "linestyle": "-"}, label=text)
            panel.axes.plot(xs, first[at], color=look["color"], linestyle=(0, (3, 1.5)), linewidth=1.0)
            sheet.legend[text] = line
        panel.axes.set_ylim(*_ends(sheet))
        panel.axes.set_ylabel(_LABEL)
    plain_look: dict[str, Any] = {"color": "0.3"}
    sheet.remarks["total"] = Line2D([], [], **plain_look)
    sheet.remarks["first order"] = Line2D([], [], linestyle=(0, (3, 1.5)), linewidth=1.0, **plain_look)
    sheet.remarks["95 % interval (total)"] = Patch(alpha=0.15, linewidth=0, **plain_look)
    status = sheet.data["sensitivity_status"].values
    for one in SensitivityStatus:
        if one is not SensitivityStatus.COMPUTED and (status == int(one)).any():
            sheet.notes.append(f"No indices where {one.text}.")
    return sheet.done()


def _check_there(sheet: Sheet) -> None:
    """Refuse a slice without indices (InputError)."""
    if np.isfinite(sheet.data["total_index"].values).any():
        return
    status = {int(one) for one in np.unique(sheet.data["sensitivity_status"].values)}
    reasons = [one.text for one in SensitivityStatus if int(one) in status and int(one)]
    raise InputError(f"no Sobol indices in this slice: {'; '.join(reasons) or 'missing'}; choose another slice (--at)")


def _legend(sheet: Sheet) -> None:
    for _, _, text, colour in _INDICES:
        sheet.legend[text] = Patch(color=colour)
    sheet.legend["95 % interval"] = Line2D([], [], color="black", marker="|", markersize=6)


def _ends(sheet: Sheet, intervals: Sequence[str] = ()) -> tuple[float, float]:
    """Ends of the axis of indices: 0 to 1 and what lies beyond, of intervals not more than half as much again."""
    values = np.concatenate([sheet.data[name].values.ravel() for name, *_ in _INDICES])
    beside = [np.clip(sheet.data[name].values.ravel(), -0.5, 1.5) for name in intervals]
    low, high = (float(function(np.concatenate([values, *beside]))) for function in (np.nanmin, np.nanmax))
    return min(-0.05, 1.05 * low), max(1.05, 1.05 * high)


def _symbol(name: str) -> str:
    """An input by its symbol; correlated ones with a plus between them."""
    return " + ".join(SYMBOLS.get(one, plain(one)) for one in name.split("+"))
