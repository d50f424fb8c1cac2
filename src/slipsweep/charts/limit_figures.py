"""The chart of limit amplitudes: a family of curves over one parameter, panels over two more."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from slipsweep.charts.sheet import curve_looks, plot_curve, set_scale
from slipsweep.charts.style import SYMBOLS, axis_label, length_text, model_text, plain, value_text
from slipsweep.grid.tables import Table
from slipsweep.model.variables import TOLERABLE_DISPLACEMENT, LimitStatus

#: Most curves in a panel, and panels across and down, that a page can show.
_MOST_CURVES, _MOST_PANELS = 6, 3

#: What is drawn along the abscissa, as curves and as panels, in order of preference.
_ABSCISSAE = ("frequency", "mu_s", "theta", "displacement")
_CURVES = ("theta", "displacement", "mu_s")


def limit_chart(table: Table, labels: Sequence[str] = ()) -> Figure:
    """Draw limit amplitudes, in g, over one dimension.

    The abscissa is frequency, else mu_s, theta or displacement; theta (else displacement or
    mu_s) makes a family of curves, the next two dimensions panels.  Of a dimension with more
    values than a page can show, evenly spread ones are drawn and the caption says so; any
    further dimension is drawn at its first value.

    Parameters
    ----------
    table : Table
        What `slipsweep.studies.limits.limit_table` returns.
    labels : sequence of str
        Names of its cases; by default they are numbered.

    Returns
    -------
    matplotlib.figure.Figure
        Curves end where no limit exists; grey disks mark limits in a jump or behind a gap.
    """
    limits, status = table["limit_amplitude"], table["limit_status"].values
    sizes = limits.sizes
    long = [dim for dim in sizes if sizes[dim] > 1]
    abscissa = next((dim for dim in (*_ABSCISSAE, *long) if dim in long), None)
    curves = next((dim for dim in (*_CURVES, *long) if dim in long and dim != abscissa), None)
    panels = [dim for dim in long if dim not in (abscissa, curves)]
    columns, rows = (*panels, None, None)[:2]
    shown = {
        dim: _spread(sizes[dim], _MOST_CURVES if dim == curves else _MOST_PANELS)
        for dim in (curves, columns, rows)
        if dim is not None
    }
    fixed = dict.fromkeys((dim for dim in sizes if dim not in shown and dim != abscissa), 0)

    across = shown.get(columns, [0]) if columns else [0]
    down = shown.get(rows, [0]) if rows else [0]
    figure = Figure(figsize=(max(6.0, 3.6 * len(across) + 1.2), max(4.2, 2.9 * len(down) + 1.3)), layout="constrained")
    axes = figure.subplots(len(down), len(across), sharex=True, sharey=True, squeeze=False)
    family = shown[curves] if curves else [0]
    looks = curve_looks(len(family))
    x = _values(table, abscissa, sizes) if abscissa else np.zeros(1)
    g = float(table.attrs["g"])

    for (i, at_row), (j, at_column) in itertools.product(enumerate(down), enumerate(across)):
        panel = axes[i, j]
        for number, (look, at_curve) in enumerate(zip(looks, family, strict=True)):
            chosen = {**fixed, **{d: k for d, k in ((rows, at_row), (columns, at_column), (curves, at_curve)) if d}}
            where: Any = tuple(chosen.get(dim, slice(None)) for dim in limits.dims)
            y = np.atleast_1d(limits.values[where]) / g
            label = _label(table, curves, at_curve, labels) if curves else None
            plot_curve(panel, x, y, number / len(family), label=label, **look)
            states = np.atleast_1d(status[where])
            abrupt = (states >= LimitStatus.AT_MODE_JUMP) & (states <= LimitStatus.AFTER_GAP)
            panel.plot(x[abrupt], y[abrupt], linestyle="none", marker="o", markersize=9, color="0.82", zorder=1.5)
        title = ", ".join(_label(table, d, k, labels) for d, k in ((columns, at_column), (rows, at_row)) if d)
        panel.set_title(title, fontsize="medium")
        panel.grid(color="0.9", which="both")
        if abscissa is not None and (abscissa == "case" or _names(table, abscissa, labels)):
            panel.set_xticks(x, list(map(plain, _names(table, abscissa, labels))) or None)
        elif x.size > 1:
            set_scale(panel, "x", x)
        panel.set_xlabel(_axis_label(abscissa) if i == len(down) - 1 else "")
    axes[0, 0].set_ylim(bottom=0.0)  # one scale for all, from zero; only now, for it ends the autoscaling
    figure.supylabel("limit amplitude A / g")
    if curves:
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
    figure.supxlabel(_caption(table, shown, fixed, labels), fontsize="small")
    return figure


def _spread(size: int, most: int) -> list[int]:
    """At most `most` of `size` indices, evenly spread from the first to the last."""
    return sorted({int(index) for index in np.linspace(0, size - 1, min(size, most)).round()})


def _values(table: Table, dim: str, sizes: dict[str, int]) -> np.ndarray:
    """Coordinates along a dimension; numbers from 1 where it has none (cases), or labels (motions)."""
    if dim in table.coords and table[dim].values.dtype.kind != "U":
        return table[dim].values
    return np.arange(1, sizes[dim] + 1)


def _names(table: Table, dim: str, labels: Sequence[str]) -> Sequence[str]:
    """What the places along a dimension are called, where that is no number."""
    if dim == "case":
        return labels
    return table[dim].values.tolist() if dim in table.coords and table[dim].values.dtype.kind == "U" else ()


def _text(name: str, value: float) -> str:
    """A value with symbol and unit; the tolerable displacement in mm below a metre."""
    if name == "displacement":
        return f"u = {length_text(value)}"
    return value_text(name, value) if name in SYMBOLS else f"{name} {value:.4g}"


def _label(table: Table, name: str, index: int, labels: Sequence[str]) -> str:
    if names := _names(table, name, labels):
        return f"{name} {plain(names[index])}"
    return _text(name, _values(table, name, table["limit_amplitude"].sizes)[index])


def _axis_label(name: str | None) -> str:
    if name is None:
        return ""
    if name == "displacement":
        return f"{TOLERABLE_DISPLACEMENT['long_name']} u (m)"
    return axis_label(name) if name in SYMBOLS else name


def _caption(table: Table, shown: dict[str, list[int]], fixed: dict[str, int], labels: Sequence[str]) -> str:
    """Parameters, model, and what of the table is not shown."""
    sizes, attributes = table["limit_amplitude"].sizes, table.attrs
    single = [_text(name, value.item()) for name, value in table.coords.items() if not value.dims]
    single += [_label(table, dim, index, labels) for dim, index in fixed.items()]
    thinned = [
        f"{len(chosen)} of {sizes[dim]} {SYMBOLS.get(dim, dim)}"
        for dim, chosen in shown.items()
        if len(chosen) < sizes[dim]
    ]
    if any(sizes[dim] > 1 for dim in fixed):
        thinned += [f"1 of {sizes[dim]} {SYMBOLS.get(dim, dim)}" for dim in fixed if sizes[dim] > 1]
    lines = [
        ", ".join(single),
        f"{model_text(attributes)}; on grey: limit set by a discontinuity of the model",
        "" if np.isfinite(table["limit_amplitude"].values).any() else "no limits to draw: limit_status says why",
        f"shown: {', '.join(thinned)}" if thinned else "",
    ]
    return "\n".join(line for line in lines if line)
