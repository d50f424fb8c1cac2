"""The chart of limit amplitudes: curves over one parameter, of a family or of motions, in panels over two more."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts.sheet import add_caption, add_legend, curve_looks, new_panels, plot_curve, set_scale
from slipsweep.charts.style import SYMBOLS, axis_label, length_text, model_text, plain, value_text
from slipsweep.charts.suite_figures import QUANTILES, SUITE, draw_suite, suite_text
from slipsweep.model.variables import TOLERABLE_DISPLACEMENT, LimitStatus
from slipsweep.studies.suite_statistics import limit_quantiles

#: Most curves in a panel, and panels across and down, that a page can show.
_MOST_CURVES, _MOST_PANELS = 6, 3

#: What is drawn along the abscissa, as curves and as panels, in order of preference.
_ABSCISSAE = ("frequency", "mu_s", "theta", "displacement")
_CURVES = ("theta", "displacement", "mu_s")

#: Parameters that the caption tells.
_TOLD = (*SYMBOLS, "displacement")


def limit_chart(table: xr.Dataset, axes: Axes | None = None) -> Figure:
    """Draw limit amplitudes, in g, over one dimension.

    The abscissa is frequency, else mu_s, theta or displacement; theta (else displacement or
    mu_s) makes a family of curves, the next two dimensions panels.  Of a suite each motion has a thin line, with the
    median and the 16 to 84 % band over them; where there is no abscissa, the motions lie along it.  Of a dimension with
    more values than a page can show, evenly spread ones are drawn and the caption says so; any
    further dimension is drawn at its first value.

    Parameters
    ----------
    table : xr.Dataset
        What `slipsweep.studies.limits.limit_table` returns; names of its cases in its attribute ``labels``.
    axes : Axes, optional
        What to draw one panel in, instead of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        Curves end where no limit exists; grey disks mark limits set by a discontinuity of the model.
    """
    labels: Sequence[str] = table.attrs.get("labels", {}).get("case", ())
    limits = table["limit_amplitude"]
    sizes = limits.sizes
    suite = [dim for dim in SUITE if dim in sizes] if sizes.get("motion", 1) > 1 else []
    long = [dim for dim in sizes if sizes[dim] > 1 and dim not in suite]
    abscissa = next((dim for dim in (*_ABSCISSAE, *long) if dim in long), "motion" if suite else None)
    curves = next((dim for dim in (*_CURVES, *long) if dim in long and dim != abscissa and not suite), None)
    panels = [dim for dim in long if dim not in (abscissa, curves)]
    columns, rows = (*panels, None, None)[:2]
    shown = {
        dim: _spread(sizes[dim], _MOST_CURVES if dim == curves else _MOST_PANELS)
        for dim in (curves, columns, rows)
        if dim is not None
    }
    fixed = dict.fromkeys((dim for dim in sizes if dim not in shown and dim not in (abscissa, *suite)), 0)

    across = shown.get(columns, [0]) if columns else [0]
    down = shown.get(rows, [0]) if rows else [0]
    size = max(6.0, 3.6 * len(across) + 1.2), max(4.2, 2.9 * len(down) + 1.3)
    figure, grid = new_panels(axes, len(down), len(across), size)
    family = shown[curves] if curves else [0]
    x = _values(table, abscissa, sizes) if abscissa else np.zeros(1)
    entries: dict[str, Any] = {}

    for (i, at_row), (j, at_column) in itertools.product(enumerate(down), enumerate(across)):
        panel = grid[i, j]
        where = {**fixed, **{dim: at for dim, at in ((rows, at_row), (columns, at_column)) if dim}}
        if suite:
            _draw_motions(entries, panel, table.isel(where, missing_dims="ignore"), abscissa, x)
        for number, at_curve in enumerate(family if not suite else ()):
            one = table.isel({**where, **({curves: at_curve} if curves else {})}, missing_dims="ignore")
            look = curve_looks(len(family))[number]
            line = _draw_curve(panel, one, x, number / len(family), look)
            if curves:
                entries[_label(table, curves, at_curve, labels)] = line
        title = ", ".join(_label(table, d, k, labels) for d, k in ((columns, at_column), (rows, at_row)) if d)
        if title:
            panel.set_title(title, fontsize="medium")
        panel.grid(color="0.9", which="both")
        if abscissa is not None and (abscissa == "case" or _names(table, abscissa, labels)):
            names = list(map(plain, _names(table, abscissa, labels)))
            panel.set_xticks(x, names or None, **({"rotation": 40, "ha": "right"} if abscissa == "motion" else {}))
        elif x.size > 1:
            set_scale(panel, "x", x)
        panel.set_xlabel(_axis_label(abscissa) if i == len(down) - 1 else "")
    grid[0, 0].set_ylim(bottom=0.0)  # one scale for all, from zero; only now, for it ends the autoscaling
    for panel in grid[:, 0]:
        panel.set_ylabel("limit amplitude A / g")
    if entries:
        add_legend(figure, axes, entries, "outside right upper")
    add_caption(figure, axes, _caption(table, shown, fixed, labels))
    return figure


def _draw_curve(panel: Axes, table: xr.Dataset, x: np.ndarray, offset: float, look: dict[str, Any]) -> Any:
    """A curve of a family, on grey disks where a discontinuity of the model sets the limit."""
    y = np.atleast_1d(table["limit_amplitude"].values) / float(table.attrs["g"])
    line = plot_curve(panel, x, y, offset, **look)
    status = np.atleast_1d(table["limit_status"].values)
    abrupt = (status >= LimitStatus.AT_MODE_JUMP) & (status <= LimitStatus.AFTER_GAP)
    panel.plot(x[abrupt], y[abrupt], linestyle="none", marker="o", markersize=9, color="0.82", zorder=1.5)
    return line


def _draw_motions(entries: dict[str, Any], panel: Axes, table: xr.Dataset, abscissa: str | None, x: np.ndarray) -> None:
    """The limits of the motions of a suite, with their median and band."""
    limits, g = table["limit_amplitude"], float(table.attrs["g"])
    quantiles = limit_quantiles(table, QUANTILES)["limit_quantile"].values.T / g
    quantiles[np.isinf(quantiles)] = np.nan
    if abscissa == "motion":
        # no lines from motion to motion: a row of points for each polarity, and the quantiles across all of them
        across = np.array([0.5, x.size + 0.5])
        draw_suite(entries, panel, across, np.empty((0, 2)), np.repeat(quantiles[:, np.newaxis], 2, axis=1), None)
        panel.set_xlim(*across)
        del entries["a motion"]
        points = limits.values.transpose([limits.dims.index(dim) for dim in SUITE if dim in limits.dims])
        names = [f"polarity {one:g}" for one in table["polarity"].values] if points.ndim > 1 else ["a motion"]
        look: dict[str, Any] = {"linestyle": "", "markerfacecolor": "white", "color": "0.2"}
        for name, row, marker in zip(names, points.reshape(x.size, -1).T / g, "os", strict=False):
            (entries[name],) = panel.plot(x, row, marker=marker, **look)
        return
    lines = limits.values.transpose([limits.dims.index(dim) for dim in (*SUITE, abscissa) if dim in limits.dims])
    draw_suite(entries, panel, x, lines.reshape(-1, x.size) / g, quantiles, None)


def _spread(size: int, most: int) -> list[int]:
    """At most `most` of `size` indices, evenly spread from the first to the last."""
    return sorted({int(index) for index in np.linspace(0, size - 1, min(size, most)).round()})


def _values(table: xr.Dataset, dim: str, sizes: dict[str, int]) -> np.ndarray:
    """Coordinates along a dimension; numbers from 1 where it has none (cases), or labels (motions)."""
    if dim in table.coords and table[dim].values.dtype.kind not in "OU":
        return table[dim].values
    return np.arange(1, sizes[dim] + 1)


def _names(table: xr.Dataset, dim: str, labels: Sequence[str]) -> Sequence[str]:
    """What the places along a dimension are called, where that is no number."""
    if dim == "case":
        return labels
    return table[dim].values.tolist() if dim in table.coords and table[dim].values.dtype.kind in "OU" else ()


def _text(name: str, value: float) -> str:
    """A value with symbol and unit; the tolerable displacement in mm below a metre."""
    if name == "displacement":
        return f"u = {length_text(value)}"
    return value_text(name, value) if name in SYMBOLS else f"{name} {value:.4g}"


def _label(table: xr.Dataset, name: str, index: int, labels: Sequence[str]) -> str:
    if names := _names(table, name, labels):
        return f"{name} {plain(names[index])}"
    return _text(name, _values(table, name, table["limit_amplitude"].sizes)[index])


def _axis_label(name: str | None) -> str:
    if name is None:
        return ""
    if name == "displacement":
        return f"{TOLERABLE_DISPLACEMENT['long_name']} u (m)"
    return axis_label(name) if name in SYMBOLS else name


def _caption(table: xr.Dataset, shown: dict[str, list[int]], fixed: dict[str, int], labels: Sequence[str]) -> list[str]:
    """Parameters, model, and what of the table is not shown."""
    sizes, attributes = table["limit_amplitude"].sizes, table.attrs
    single = [_text(name, value.item()) for name, value in table.coords.items() if not value.dims and name in _TOLD]
    single += [_label(table, dim, index, labels) for dim, index in fixed.items()]
    thinned = [
        f"{len(chosen)} of {sizes[dim]} {SYMBOLS.get(dim, dim)}"
        for dim, chosen in shown.items()
        if len(chosen) < sizes[dim]
    ]
    if any(sizes[dim] > 1 for dim in fixed):
        thinned += [f"1 of {sizes[dim]} {SYMBOLS.get(dim, dim)}" for dim in fixed if sizes[dim] > 1]
    suite = sizes.get("motion", 1) > 1
    grey = "" if suite else "; on grey: limit set by a discontinuity of the model"
    lines = [
        ", ".join(single),
        f"{model_text(attributes)}{grey}",
        _suite_text(table) if suite else "",
        "" if np.isfinite(table["limit_amplitude"].values).any() else "no limits to draw: limit_status has the reasons",
        f"shown: {', '.join(thinned)}" if thinned else "",
    ]
    return [line for line in lines if line]


def _suite_text(table: xr.Dataset) -> str:
    """What the median is of, and the motions that have no limit."""
    status = table["limit_status"].values
    beyond, invalid = (int(np.count_nonzero(status == one)) for one in (LimitStatus.NOT_REACHED, LimitStatus.INVALID))
    texts = [f"median and band are of {suite_text(table['limit_amplitude'].sizes)}"]
    if beyond:
        highest = float(table.attrs["maximum_amplitude"]) / float(table.attrs["g"])
        texts.append(f"{beyond} of {status.size} limits are above {highest:.4g} g, and count as larger than all others")
    if invalid:
        texts.append(f"{invalid} of {status.size} have no value and are left out")
    return "; ".join(texts)
