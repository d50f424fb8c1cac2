"""The chart of limit amplitudes: curves over one parameter, of a family or of motions, in panels over two more."""

import itertools
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts.sheet import Drawing, curve_looks, over, plot_curve, set_scale
from slipsweep.charts.style import SYMBOLS, Look, axis_label, length_text, model_text, plain, value_text
from slipsweep.charts.suite_figures import QUANTILES, SUITE, draw_suite, suite_text
from slipsweep.files.selection import axis_labels, axis_numbers
from slipsweep.model.variables import TOLERABLE_DISPLACEMENT, LimitStatus
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
    abscissa = next((dim for dim in (*_ABSCISSAE, *wide) if dim in wide), "motion" if suite else None)
    curves = next((dim for dim in (*_CURVES, *wide) if dim in wide and dim != abscissa and not suite), None)
    columns, rows = (*(dim for dim in wide if dim not in (abscissa, curves)), None, None)[:2]
    shown = {
        dim: _spread(sizes[dim], _MOST_CURVES if dim == curves else _MOST_PANELS)
        for dim in (curves, columns, rows)
        if dim is not None
    }
    fixed = dict.fromkeys((dim for dim in sizes if dim not in shown and dim not in (abscissa, *suite)), 0)
    across, down = (shown.get(dim, [0]) if dim else [0] for dim in (columns, rows))
    size = max(6.0, 3.6 * len(across) + 1.2), max(4.2, 2.9 * len(down) + 1.3)
    drawing = Drawing(look or Look(), len(down), len(across), size, axes)
    family = shown[curves] if curves else [0]
    x = axis_numbers(data, abscissa) if abscissa else np.zeros(1)

    for (i, at_row), (j, at_column) in itertools.product(enumerate(down), enumerate(across)):
        panel = drawing.grid[i, j]
        where = {**fixed, **{dim: at for dim, at in ((rows, at_row), (columns, at_column)) if dim}}
        if suite:
            _draw_motions(drawing, panel, data.isel(where), abscissa, x)
        for number, at_curve in enumerate(family if not suite else ()):
            one = data.isel({**where, **({curves: at_curve} if curves else {})})
            line = _draw_curve(drawing, panel, one, x, number / len(family), curve_looks(len(family))[number])
            if curves:
                drawing.legend[_label(data, curves, at_curve)] = line
        title = ", ".join(_label(data, d, k) for d, k in ((columns, at_column), (rows, at_row)) if d)
        if title:
            panel.set_title(title, fontsize="medium")
        panel.grid(color="0.9", which="both")
        names = axis_labels(data, abscissa) if abscissa else []
        if names:
            slanted = {"rotation": 40, "ha": "right"} if abscissa == "motion" else {}
            panel.set_xticks(x, list(map(plain, names)), **slanted)
        elif x.size > 1:
            set_scale(panel, "x", x)
        panel.set_xlabel(_axis_label(abscissa) if i == len(down) - 1 else "")
    drawing.grid[0, 0].set_ylim(bottom=0.0)  # one scale for all, from zero; only now, for it ends the autoscaling
    for panel in drawing.grid[:, 0]:
        panel.set_ylabel("limit amplitude A / g")
    return drawing.finish(_caption(data, sizes, shown, fixed))


def _draw_curve(
    drawing: Drawing, panel: Axes, data: xr.Dataset, x: np.ndarray, offset: float, look: dict[str, Any]
) -> Any:
    """A curve of a family, in circles where a discontinuity of the model sets the limit."""
    y = np.atleast_1d(data["limit_amplitude"].values) / float(data.attrs["g"])
    line = plot_curve(panel, x, y, offset, **look)
    status = np.atleast_1d(data["limit_status"].values)
    abrupt = (status >= LimitStatus.AT_MODE_JUMP) & (status <= LimitStatus.AFTER_GAP)
    circle: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 9, "color": "0.82", "zorder": 1.5}
    (marks,) = panel.plot(x[abrupt], y[abrupt], **circle)
    if abrupt.any():
        drawing.remarks["set by a discontinuity\nof the model"] = marks
    return line


def _draw_motions(drawing: Drawing, panel: Axes, data: xr.Dataset, abscissa: str | None, x: np.ndarray) -> None:
    """The limits of the motions of a suite, with their median and band."""
    limits, g = data["limit_amplitude"], float(data.attrs["g"])
    found = limit_quantiles(data, QUANTILES)["limit_quantile"]
    quantiles = found.transpose("quantile", ...).values / g
    quantiles[np.isinf(quantiles)] = np.nan
    if abscissa == "motion":
        # no lines from motion to motion: a row of points for each polarity, and the quantiles across all of them
        across = np.array([0.5, x.size + 0.5])
        draw_suite(
            drawing.legend, panel, across, np.empty((0, 2)), np.repeat(quantiles[:, np.newaxis], 2, axis=1), None
        )
        panel.set_xlim(*across)
        del drawing.legend["a motion"]
        points = limits.transpose("motion", ...).values.reshape(x.size, -1)
        names = [f"polarity {one:g}" for one in data["polarity"].values] if "polarity" in limits.dims else ["a motion"]
        look: dict[str, Any] = {"linestyle": "", "markerfacecolor": "white", "color": "0.2"}
        for name, row, marker in zip(names, points.T / g, "os", strict=False):
            (drawing.legend[name],) = panel.plot(x, row, marker=marker, **look)
        return
    lines = over(limits, data, (*(dim for dim in SUITE if dim in limits.dims), abscissa))
    draw_suite(drawing.legend, panel, x, lines.reshape(-1, x.size) / g, quantiles, None)


def _spread(size: int, most: int) -> list[int]:
    """At most `most` of `size` indices, evenly spread from the first to the last."""
    return sorted({int(index) for index in np.linspace(0, size - 1, min(size, most)).round()})


def _text(name: str, value: float) -> str:
    """A value with symbol and unit; the tolerable displacement in mm below a metre."""
    if name == "displacement":
        return f"u = {length_text(value)}"
    return value_text(name, value) if name in SYMBOLS else f"{name} {value:.4g}"


def _label(data: xr.Dataset, name: str, index: int) -> str:
    names = axis_labels(data, name)
    return f"{name} {plain(names[index])}" if names else _text(name, axis_numbers(data, name)[index])


def _axis_label(name: str | None) -> str:
    if name is None:
        return ""
    if name == "displacement":
        return f"{TOLERABLE_DISPLACEMENT['long_name']} u (m)"
    return axis_label(name) if name in SYMBOLS else name


def _caption(data: xr.Dataset, sizes: dict[str, int], shown: dict[str, list[int]], fixed: dict[str, int]) -> list[str]:
    """Parameters, model, and what of the limits is not shown."""
    single = [
        _text(str(name), value.item())
        for name, value in data.coords.items()
        if not value.dims and name in (*SYMBOLS, "displacement")
    ]
    single += [_label(data, dim, index) for dim, index in fixed.items()]
    thinned = [
        f"{len(chosen)} of {sizes[dim]} {SYMBOLS.get(dim, dim)}"
        for dim, chosen in {**shown, **{dim: [0] for dim in fixed}}.items()
        if len(chosen) < sizes[dim]
    ]
    lines = [
        ", ".join(single),
        model_text(data.attrs),
        _suite_text(data) if sizes.get("motion", 1) > 1 else "",
        "" if np.isfinite(data["limit_amplitude"]).any() else "No limits to draw: limit_status has the reasons.",
        f"Shown: {', '.join(thinned)}." if thinned else "",
    ]
    return [line for line in lines if line]


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
