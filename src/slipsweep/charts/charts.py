"""Design charts: slices of a sweep in, matplotlib figures out; no file is read here.

A slice is a table as `slices.Result.select` returns it.  Values are drawn as they are; contours are
those of their logarithm, in which u = W/ω² is a straight line over a logarithmic frequency axis.
Figures are made without pyplot, as in `figures`.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from slipsweep.charts.style import ORANGE, PURPLE, SKY_BLUE, VERMILION, axis_label, caption, plain, unit, value_text
from slipsweep.errors import InputError
from slipsweep.grid.tables import Table, Variable
from slipsweep.model.variables import RESULTS, SlidingMode, Validity

Floats = NDArray[np.float64]
Boundaries = Mapping[str, Variable]

#: From violet to yellow in even steps of lightness, read alike with any kind of colour vision.
COLOURS = "viridis"

_MODE_COLOURS = {
    SlidingMode.STUCK: SKY_BLUE,
    SlidingMode.STICK_SLIP: ORANGE,
    SlidingMode.CONTINUOUS: PURPLE,
}

#: Hatching of each flag but notes, under which a value is sound.
HATCHES = {
    Validity.STATICALLY_UNSTABLE: "////",
    Validity.UPLIFT: "||||",
    Validity.LIMIT_UNDEFINED: "oo",
    Validity.FRICTION_NOT_DECAYING: "----",
    Validity.KD_NOT_POSITIVE: "xxx",
    Validity.NOT_RECOUPLED: "\\\\\\",
    Validity.FLEXIBLE_BLOCK: "++",
    Validity.UPSLOPE: "**",
    Validity.NEAR_MODE_LIMIT: "OO",
}

_LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "yield_acceleration": ("yield", {"color": "black", "linestyle": "-", "linewidth": 1.6}),
    "limiting_acceleration": ("mode limit (Eq. 7)", {"color": "black", "linestyle": (0, (5, 2)), "linewidth": 1.6}),
}

#: Displacements that a chart is about, m: a millimetre to ten metres.
_LEAST, _MOST = 1e-3, 10.0

#: Displacements that differ by less are the same but for rounding.
_EQUAL = 1e-9

#: What a contour's label takes: about that fraction of the axes to each side.
_LABEL_ROOM = 0.06

_UPSLOPE = "0.6"
_NOT_SHOWN = "gaps: upslope\n(negative)"

_RATIO_LEVELS = (0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)


# --------------------------------------------------------------------------- the five charts


def contours(table: Table, lines: Boundaries, name: str, x: str, y: str) -> Figure:
    """Draw contours of a result over two axes, with the lines of yield and of the mode limit.

    Parameters
    ----------
    table : Table
        Slice over `x` and `y` that holds the result and, if there is hatching to be, `validity`.
    lines : mapping of str to Variable
        `slices.boundaries` of the slice.
    name, x, y : str
        The result and the two axes.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = _map(table, x, y)
    values = _grid(table[name], table, y, x)
    entries = _upslope(axes, table, values, x, y)
    levels = _levels(name, values)
    if not levels:
        entries.append(Patch(facecolor="none", label=_without_levels(name, values)))
    else:
        # contours of the logarithm; what is below the lowest level, or nothing, is a hundredth of it
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.maximum(np.log10(values), math.log10(levels[0]) - 2)
        places = np.log10(levels)
        xs, ys = table[x].values, table[y].values
        colours = mpl.colormaps[COLOURS].resampled(len(levels))
        areas = axes.contourf(
            xs, ys, logs, places, cmap=colours, norm=BoundaryNorm(places, colours.N, extend="max"), extend="max"
        )
        areas.set_rasterized(False)
        # the result jumps at the mode limit: the lines of either side end there
        to_axes = axes.transData + axes.transAxes.inverted()
        shown = [threshold_line(line, table, x, y) for line in lines.values()]
        # a few dozen points of a line say well enough where there is room
        taken = [
            to_axes.transform(np.column_stack(line)[:: math.ceil(line[0].size / 60)])
            for line in shown
            if line is not None
        ]
        for side in _sides(table, lines, x, y):
            masked = np.ma.array(logs, mask=~side | np.isnan(logs))
            drawn = axes.contour(xs, ys, masked, places, colors="white", linewidths=0.9, linestyles="solid")
            drawn.set_gid(f"contours of {name}")
            _label_contours(axes, drawn, name, taken)
        bar = figure.colorbar(areas, ax=axes, ticks=places, pad=0.02)
        bar.ax.set_yticklabels([_value_label(name, level) for level in levels])
        bar.ax.minorticks_off()
        bar.set_label(RESULTS[name]["long_name"])
    _finish_map(figure, axes, table, lines, x, y, entries)
    return figure


def modes(table: Table, lines: Boundaries, x: str, y: str) -> Figure:
    """Draw the sliding mode of every cell over two axes; parameters as those of `contours`."""
    figure, axes = _map(table, x, y)
    codes = _grid(table["sliding_mode"], table, y, x)
    edges = [_edges(table[axis].values) for axis in (x, y)]
    drawn = np.ma.masked_less(codes, 0)
    axes.pcolormesh(
        *edges, drawn, cmap=ListedColormap(list(_MODE_COLOURS.values())), vmin=-0.5, vmax=2.5, rasterized=True
    )
    entries = [
        Patch(facecolor=colour, label=mode.name.lower().replace("_", "–"))
        for mode, colour in _MODE_COLOURS.items()
        if np.any(codes == int(mode))
    ]
    _finish_map(figure, axes, table, lines, x, y, entries)
    return figure


def newmark_ratio(table: Table, baseline: Variable, lines: Boundaries, x: str, y: str) -> Figure:
    """Draw the ratio of the permanent displacement to that of Newmark's block over two axes.

    Parameters
    ----------
    baseline : Variable
        `slices.newmark` of the slice.
    table, lines, x, y
        As those of `contours`.
    """
    figure, axes = _map(table, x, y)
    ratio = displacement_ratio(table, baseline, x, y)
    xs, ys = table[x].values, table[y].values
    equal = np.isclose(ratio, 1.0, rtol=_EQUAL, atol=0.0)
    there = np.isfinite(ratio) & (ratio > 0) & ~equal
    entries = _upslope(axes, table, ratio, x, y)
    if equal.any():
        grey = ListedColormap(["0.8"])
        axes.pcolormesh(_edges(xs), _edges(ys), np.ma.masked_equal(equal, False), cmap=grey, rasterized=True)
        entries.append(Patch(facecolor="0.8", label="equal to Newmark's"))
    crossing: list[Any] = []
    if there.any():
        inside = [level for level in _RATIO_LEVELS if ratio[there].min() / 2.5 < level < ratio[there].max() * 2.5]
        levels = inside if len(inside) > 1 else list(_RATIO_LEVELS)
        places = np.log10(levels)
        logs = np.full(ratio.shape, np.nan)
        logs[there] = np.log10(ratio[there])
        colours = mpl.colormaps[COLOURS].resampled(len(levels) + 1)
        norm = BoundaryNorm(places, colours.N, extend="both")
        areas = axes.pcolormesh(
            _edges(xs), _edges(ys), np.ma.masked_invalid(logs), cmap=colours, norm=norm, rasterized=True
        )
        for side in _sides(table, lines, x, y):
            masked = np.ma.array(logs, mask=~side | ~there)
            if masked.count() and min(masked.shape) > 1 and masked.min() < 0 < masked.max():
                axes.contour(xs, ys, masked, [0.0], colors=VERMILION, linewidths=1.6)
                crossing = [Line2D([], [], color=VERMILION, linewidth=1.6, label="as much as Newmark's")]
        bar = figure.colorbar(areas, ax=axes, ticks=places, pad=0.02, extend="both")
        bar.ax.set_yticklabels([f"{level:g}" for level in levels])
        bar.ax.minorticks_off()
        bar.set_label("permanent displacement over that of Newmark's block")
    elif not equal.any():
        entries.append(Patch(facecolor="none", label="no ratio: no displacement above zero"))
    _finish_map(figure, axes, table, lines, x, y, [*entries, *crossing])
    return figure


def families(table: Table, lines: Boundaries, name: str, x: str, family: str) -> Figure:
    """Draw curves of a result over one axis, one for each value of another.

    Parameters
    ----------
    table : Table
        Slice over `x` and `family`.
    lines : mapping of str to Variable
        `slices.boundaries` of the slice.
    name, x, family : str
        The result, the axis to draw over, and the axis whose values tell the curves apart.
    """
    figure, axes = new_plot()
    values = _grid(table[name], table, family, x)
    accelerations = _grid(table["amplitude"], table, family, x)
    millimetres = RESULTS[name].get("units") == "m"
    members = table[family].values
    check_positive(RESULTS[name]["long_name"], values)
    for member, colour in zip(range(members.size), curve_colours(members.size), strict=True):
        curve = np.where(values[member] > 0, values[member], np.nan) * (1000 if millimetres else 1)
        xs, curve = _broken(table[x].values, curve, accelerations[member], _along(lines, table, family, x, member))
        plot_curve(axes, xs, curve, color=colour, label=value_text(family, members[member]))
    axes.set_yscale("log")
    set_scale(axes, "x", table[x].values)
    limit_decades(axes, values * (1000 if millimetres else 1), _LEAST * 1000 if millimetres else None)
    axis_text(axes, "x", x)
    label = RESULTS[name]["long_name"]
    shown = "mm" if millimetres else unit(name)
    axes.set_ylabel(f"{label} ({shown})" if shown else label)
    _mark_accelerations(axes, table, lines, x, family)
    if (values < 0).any():
        axes.plot([], [], linestyle="", label=_NOT_SHOWN)
    add_legend(axes, figure)
    add_caption(figure, table)
    return figure


def dimensionless(table: Table, lines: Boundaries, family: str | None) -> Figure:
    """Draw uω²/A against A/Üy, in which all frequencies give one curve.

    Parameters
    ----------
    table : Table
        Slice over the amplitude, some frequencies and the values of `family`, that holds
        `permanent_displacement`.
    lines : mapping of str to Variable
        `slices.boundaries` of the slice.
    family : str or None
        The axis whose values tell the curves apart.
    """
    figure, axes = new_plot()
    curves = dimensionless_curves(table, lines, family)
    # the paper's axis begins at the yield acceleration
    check_positive(
        "displacement beyond the yield acceleration", np.concatenate([ys[xs > 1] for xs, ys in curves.values()])
    )
    members = table[family].values if family else np.zeros(1)
    markers = ("", "o", "x", "s", "+", "D")
    frequencies = np.atleast_1d(table["frequency"].values)
    for member, colour in zip(range(members.size), curve_colours(members.size), strict=True):
        for number in range(frequencies.size):
            xs, ys = curves[member, number]
            ys = np.where(ys > 0, ys, np.nan)
            text = value_text(family, members[member]) if family else "all frequencies"
            if number == 0:
                amplitudes = xs * _along(lines, table, family, None, member)["yield_acceleration"]
                xs, ys = _broken(xs, ys, amplitudes, _along(lines, table, family, None, member))
                plot_curve(axes, xs, ys, color=colour, label=text)
            else:
                # a few markers a curve, each frequency's between those of the others
                every = max(1, xs.size // 12)
                axes.plot(
                    xs, ys, color=colour, linestyle="", markersize=5, markerfacecolor="none",
                    marker=markers[number % len(markers)] or "^", markevery=(number * every // frequencies.size, every),
                )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="A / Üy", ylabel="u ω² / A")
    limit_decades(axes, np.array([ys for _, ys in curves.values()]), 1e-4)
    axes.set_xlim(left=1.0)
    for side in ("x", "y"):
        getattr(axes, f"{side}axis").set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}" if f"{value:.0e}"[0] in "235" else ""))
    entries, texts = axes.get_legend_handles_labels()
    shapes = ["none", *(marker or "^" for marker in markers[1:])]
    for number, frequency in enumerate(frequencies):
        line = Line2D(
            [], [], color="0.3", linestyle="-" if number == 0 else "", marker=shapes[number % len(shapes)],
            markerfacecolor="none", markersize=5,
        )  # fmt: skip
        entries.append(line)
        texts.append(value_text("frequency", frequency))
    if any((ys < 0).any() for _, ys in curves.values()):
        entries.append(Line2D([], [], linestyle=""))
        texts.append(_NOT_SHOWN)
    add_legend(axes, figure, entries, texts)
    add_caption(figure, table)
    return figure


# ------------------------------------------------------------------------ what they show


def displacement_ratio(table: Table, baseline: Variable, x: str, y: str) -> Floats:
    """u over Newmark's u on the cells of a slice, shape (y, x); NaN where either is missing or both are zero."""
    ours, theirs = (_grid(variable, table, y, x) for variable in (table["permanent_displacement"], baseline))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(ours / theirs)


def dimensionless_curves(
    table: Table, lines: Boundaries, family: str | None
) -> dict[tuple[int, int], tuple[Floats, Floats]]:
    """A/Üy and uω²/A of every member of a family and every frequency of a slice, by their numbers."""
    drive = _drive(table)
    dims = tuple(dim for dim in (family, "frequency", drive) if dim)
    displacement = broadcast(table["permanent_displacement"], table, dims)
    amplitude = broadcast(table["amplitude"], table, dims)
    omega = 2 * math.pi * broadcast(table["frequency"], table, dims)
    threshold = broadcast(lines["yield_acceleration"], table, dims)
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled, ratio = displacement * omega**2 / amplitude, amplitude / threshold
    if family is None:
        scaled, ratio = scaled[None], ratio[None]
    return {(i, j): (ratio[i, j], scaled[i, j]) for i in range(scaled.shape[0]) for j in range(scaled.shape[1])}


def threshold_line(threshold: Variable, table: Table, x: str, y: str) -> tuple[Floats, Floats] | None:
    """The line in the plane of two axes on which the amplitude is a threshold acceleration.

    Returns
    -------
    tuple of ndarray or None
        x and y of the line; None if neither axis is one of amplitude.
    """
    for drive, other, swapped in ((y, x, False), (x, y, True)):
        if drive not in ("amplitude", "displacement_amplitude"):
            continue
        along = table[other].values
        values = broadcast(threshold, table, (other,))
        if drive == "displacement_amplitude":
            values = values / (2 * math.pi * broadcast(table["frequency"], table, (other,))) ** 2
        return (values, along) if swapped else (along, values)
    return None


# ------------------------------------------------------------------------------- grids


def broadcast(variable: Variable, table: Table, dims: tuple[str, ...]) -> Floats:
    """A variable over `dims`, in that order, broadcast along those it does not vary along."""
    own = variable.values.transpose([variable.dims.index(dim) for dim in dims if dim in variable.dims])
    shape = [table[dim].values.size for dim in dims]
    return np.broadcast_to(
        own.reshape([n if dim in variable.dims else 1 for dim, n in zip(dims, shape, strict=True)]), shape
    )


def _grid(variable: Variable, table: Table, y: str, x: str) -> Floats:
    return broadcast(variable, table, (y, x))


def _drive(table: Table) -> str:
    return "displacement_amplitude" if "displacement_amplitude" in table.coords else "amplitude"


def _along(lines: Boundaries, table: Table, family: str | None, x: str | None, member: int) -> dict[str, Any]:
    """The threshold accelerations of one curve of a family: a number, or an array along `x`."""
    dims = tuple(dim for dim in (family, x) if dim)
    found = {}
    for name, threshold in lines.items():
        values = broadcast(threshold, table, dims)
        found[name] = values[member] if family else values
    return found


def _sides(table: Table, lines: Boundaries, x: str, y: str) -> list[NDArray[np.bool_]]:
    """The cells below and beyond the mode limit."""
    if "limiting_acceleration" not in lines:
        return [np.ones((table[y].values.size, table[x].values.size), bool)]
    amplitude = _grid(table["amplitude"], table, y, x)
    limit = _grid(lines["limiting_acceleration"], table, y, x)
    return [side for side in (amplitude <= limit, amplitude > limit) if side.any()]


def _upslope(axes: Axes, table: Table, values: Floats, x: str, y: str) -> list[Patch]:
    """Mark the cells in which the block ends upslope, which have no logarithm; return the legend's entry."""
    upslope = values < 0
    if not upslope.any():
        return []
    edges = [_edges(table[axis].values) for axis in (x, y)]
    colours = ListedColormap([_UPSLOPE])
    axes.pcolormesh(*edges, np.ma.masked_equal(upslope, False), cmap=colours, rasterized=True)
    return [Patch(facecolor=_UPSLOPE, label="upslope (negative)")]


def _broken(xs: Floats, ys: Floats, amplitude: Floats, thresholds: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """A curve with a gap where the amplitude passes the mode limit: the jump is no line."""
    if "limiting_acceleration" not in thresholds:
        return xs, ys
    beyond = amplitude > thresholds["limiting_acceleration"]
    gaps = np.flatnonzero(beyond[1:] != beyond[:-1]) + 1
    return np.insert(xs, gaps, xs[gaps]), np.insert(ys, gaps, np.nan)


def _is_log(values: Floats) -> bool:
    """Whether an axis is spaced by a constant factor rather than a constant step."""
    if values.size < 3 or values[0] <= 0:
        return False
    steps, factors = np.diff(values), np.diff(np.log(values))
    return bool(np.ptp(factors) / factors.mean() < np.ptp(steps) / steps.mean())


def _edges(values: Floats) -> Floats:
    """Where the cells of an axis meet: midway, on the axis's own scale."""
    if _is_log(values):
        return np.exp(_edges_of(np.log(values)))
    return _edges_of(values)


def _edges_of(values: Floats) -> Floats:
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _levels(name: str, values: Floats) -> list[float]:
    """1-3-10 levels that lie in the values; of displacements those between a millimetre and ten metres."""
    there = values[np.isfinite(values) & (values > 0)]
    if not there.size:
        return []
    low, high = float(there.min()), float(there.max())
    if name == "permanent_displacement" and low < _MOST and high > _LEAST:
        low, high = max(low, _LEAST), min(high, _MOST)
    else:
        low = max(low, high * 1e-5)
    decades = range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1)
    every = [float(f"{digit}e{decade}") for decade in decades for digit in (1, 3)]
    inside = [level for level in every if low * (1 - 1e-9) <= level <= high * (1 + 1e-9)]
    if len(inside) < 2:  # values of about one size: levels among them
        return [float(f"{level:.3g}") for level in np.geomspace(low, high, 6)] if high > low * 1.01 else []
    return inside


def _without_levels(name: str, values: Floats) -> str:
    """Why a map has no contours."""
    there = values[np.isfinite(values)]
    if not there.size:
        return "no values"
    if not (there > 0).any():
        return "no values above zero"
    low, high = (_value_label(name, float(value)) for value in (there[there > 0].min(), there.max()))
    return f"all values above zero: {low}" + (f" to {high}" if high != low else "")


def _value_label(name: str, value: float) -> str:
    if RESULTS[name].get("units") == "m":
        return f"{value * 1000:.4g} mm" if value < 0.9999 else f"{value:.4g} m"
    return f"{value:.3g} {unit(name)}".strip()


def curve_colours(number: int) -> list[Any]:
    # not up to the yellow end, which is faint on white
    return [mpl.colormaps[COLOURS](place) for place in np.linspace(0, 0.87, number)]


# ------------------------------------------------------------------------- parts of figures


def new_plot() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(7.0, 4.8), layout="constrained")
    axes = figure.subplots()
    axes.grid(color="0.9", which="major")
    axes.set_axisbelow(True)
    return figure, axes


def _map(table: Table, x: str, y: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(7.0, 5.3), layout="constrained")
    axes = figure.subplots()
    for side, name in (("x", x), ("y", y)):
        set_scale(axes, side, table[name].values)
        axis_text(axes, side, name)
    return figure, axes


def set_scale(axes: Axes, side: str, values: Floats) -> None:
    getattr(axes, f"set_{side}lim")(values[0], values[-1])
    if not _is_log(values):
        return
    getattr(axes, f"set_{side}scale")("log")
    axis = getattr(axes, f"{side}axis")
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if values[-1] < 2000 * values[0] else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def axis_text(axes: Axes, side: str, name: str) -> None:
    getattr(axes, f"set_{side}label")(axis_label(name))


def _label_contours(axes: Axes, drawn: Any, name: str, taken: list[Floats]) -> None:
    """Label each contour where it is farthest from edges and from `taken`, if there is room.

    `taken` holds points of lines and labels as fractions of the axes; the new labels are added.
    """
    to_axes = axes.transData + axes.transAxes.inverted()
    positions = []
    for segments in drawn.allsegs:
        points = np.concatenate([to_axes.transform(segment) for segment in segments or [np.empty((0, 2))]])
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            continue
        room = np.minimum(points, 1 - points).min(axis=1)
        for line in taken:
            near = line[np.isfinite(line).all(axis=1)]
            for part in np.array_split(near, max(1, len(near) // 200)):
                if len(part):
                    apart = points[:, None] - part[None]
                    room = np.minimum(room, np.hypot(apart[..., 0], apart[..., 1]).min(axis=1))
        best = int(np.argmax(room))
        if room[best] > _LABEL_ROOM:
            taken.append(points[best : best + 1])
            positions.append(tuple(to_axes.inverted().transform(points[best])))
    if positions:
        labels = axes.clabel(drawn, manual=positions, fmt=lambda place: _value_label(name, 10**place), fontsize=8)
        for label in labels:
            label.set_bbox({"facecolor": "black", "alpha": 0.6, "edgecolor": "none", "boxstyle": "round,pad=0.15"})


def second_scale(axes: Axes, table: Table, side: str) -> None:
    """The amplitude in units of g, on the other side."""
    g = float(table.attrs["g"])
    convert = (lambda a: a / g, lambda a: a * g)
    other = (
        axes.secondary_yaxis("right", functions=convert)
        if side == "y"
        else axes.secondary_xaxis("top", functions=convert)
    )
    getattr(other, f"set_{side}label")("A / g")


def plot_curve(axes: Axes, xs: Floats, ys: Floats, **look: Any) -> None:
    """Draw a line, and points where a value has no neighbour to be joined with."""
    there = np.concatenate([[False], np.isfinite(ys), [False]])
    alone = there[1:-1] & ~there[:-2] & ~there[2:]
    if alone.any() and "marker" not in look:
        look |= {"marker": ".", "markevery": alone.tolist()}
    axes.plot(xs, ys, **look)


def check_positive(name: str, values: Floats) -> None:
    """Refuse what a logarithmic axis cannot show (InputError)."""
    there = values[np.isfinite(values)]
    if not (there > 0).any():
        reason = "no value" if not there.size else "no value above zero"
        raise InputError(f"{name}: {reason} in this slice, and the axis is logarithmic; cut it elsewhere (--at)")


def limit_decades(axes: Axes, values: Floats, least: float | None) -> None:
    """Show what is above `least`, and no more than seven decades."""
    there = values[np.isfinite(values) & (values > 0)]
    if there.size:
        high = float(there.max())
        low = max(float(there.min()), high * 1e-7)
        if least is not None and high > 10 * least:
            low = max(low, least)
        axes.set_ylim(low / 1.2, high * 1.5)


def _finish_map(
    figure: Figure, axes: Axes, table: Table, lines: Boundaries, x: str, y: str, entries: Sequence[Any] = ()
) -> None:
    """Hatching, lines, second scale, legend and caption of a map."""
    legend = [*entries]
    for name, threshold in lines.items():
        text, look = _LINES[name]
        line = threshold_line(threshold, table, x, y)
        if line is not None:
            axes.plot(*line, label=text, gid=name, **look)
        else:
            amplitude, limit = _grid(table["amplitude"], table, y, x), _grid(threshold, table, y, x)
            excess = np.ma.masked_invalid(amplitude - limit)
            if not excess.count() or not excess.min() < 0 < excess.max():
                continue
            drawn = axes.contour(
                table[x].values, table[y].values, excess, [0.0], colors=look["color"],
                linestyles=[look["linestyle"]], linewidths=look["linewidth"],
            )  # fmt: skip
            drawn.set_gid(name)
        legend.append(Line2D([], [], label=text, **look))
    legend += _hatch(axes, table, x, y)
    for side, name in (("x", x), ("y", y)):
        if name == "amplitude":
            second_scale(axes, table, side)
    if legend:
        figure.legend(
            handles=legend, loc="outside upper center", ncols=3, frameon=False, fontsize="small", handlelength=2.4
        )
    add_caption(figure, table)


def _hatch(axes: Axes, table: Table, x: str, y: str) -> list[Patch]:
    """Hatch the cells of each flag that is no note; return the entries of the legend."""
    if "validity" not in table:
        return []
    validity: NDArray[Any] = _grid(table["validity"], table, y, x)
    columns, rows = (_edges(table[axis].values) for axis in (x, y))
    entries = []
    with mpl.rc_context({"hatch.linewidth": 0.6}):
        for flag, hatch in HATCHES.items():
            cells = (validity & int(flag)) != 0
            if not cells.any():
                continue
            name = (flag.name or "").lower()
            look: dict[str, Any] = {"facecolor": "none", "edgecolor": "0.25", "linewidth": 0, "hatch": hatch}
            axes.add_patch(PathPatch(_outline(cells, columns, rows), gid=name, **look))
            entries.append(Patch(label=name, **look))
    return entries


def _outline(cells: NDArray[np.bool_], columns: Floats, rows: Floats) -> Path:
    """The cells that are true as rectangles: runs along a row, put together where the next row has the same."""
    open_runs: dict[tuple[int, int], int] = {}
    rectangles: list[tuple[int, int, int, int]] = []
    for row in range(cells.shape[0] + 1):
        runs: set[tuple[int, int]] = set()
        if row < cells.shape[0]:
            change = np.flatnonzero(np.diff(np.concatenate([[0], cells[row].astype(np.int8), [0]])))
            runs = set(zip(change[::2].tolist(), change[1::2].tolist(), strict=True))
        ended = [run for run in open_runs if run not in runs]
        rectangles += [(*run, open_runs.pop(run), row) for run in ended]
        for run in runs:
            open_runs.setdefault(run, row)
    paths = []
    for left, right, bottom, top in rectangles:
        x0, x1, y0, y1 = columns[left], columns[right], rows[bottom], rows[top]
        paths.append(Path([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], closed=True))
    return Path.make_compound_path(*paths)


def _mark_accelerations(axes: Axes, table: Table, lines: Boundaries, x: str, family: str) -> None:
    """Upright lines where the amplitude passes a threshold that all curves of a family share."""
    for name, threshold in lines.items():
        text, look = _LINES[name]
        if x == "amplitude" and not threshold.dims and np.isfinite(threshold.item()):
            axes.axvline(threshold.item(), gid=name, label=text, **{**look, "linewidth": 1.0})
    if x == "amplitude":
        second_scale(axes, table, "x")


def add_legend(axes: Axes, figure: Figure, handles: Any = None, labels: Any = None) -> None:
    if handles is None:
        handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize="small")


def add_caption(figure: Figure, table: Table) -> None:
    """Parameters, model and origin, under the figure."""
    case = f"case {plain(table.attrs['case'])}: " if "case" in table.attrs else ""
    figure.supxlabel(f"{case}{caption(table)}; {table.attrs.get('source', 'slipsweep')}", fontsize="small")
