"""Maps: a result, the sliding mode, or the ratio to Newmark's block over two axes of a slice.

Values are drawn as they are; contours are those of their logarithm, in which u = W/ω² is a straight line
over a logarithmic frequency axis.
"""

import math
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import BoundaryNorm, Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from slipsweep.charts.answers import SIDE, newmark, sides_of, solve
from slipsweep.charts.sheet import (
    DRIVES,
    LINES,
    Panel,
    Sheet,
    broadcast,
    is_log,
    ratios,
    reliable,
    validity_has,
)  # fmt: skip
from slipsweep.charts.style import length_text, unit
from slipsweep.model.variables import RESULTS, SlidingMode, Validity

Floats = NDArray[np.float64]

#: Pale to dark in even steps of lightness, read alike with any kind of colour vision; black lines show on all of it.
COLOURS = LinearSegmentedColormap.from_list("pale", mpl.colormaps["YlGnBu"](np.linspace(0.03, 0.68, 64)))

#: Diverging, white in the middle; black lines show on all of it.
RATIO_COLOURS = LinearSegmentedColormap.from_list("pale", mpl.colormaps["PuOr_r"](np.linspace(0.12, 0.88, 64)))

#: Colour and hatch of each mode: from light to dark.
MODES = {
    SlidingMode.STUCK: ("#EEF3F8", ""),
    SlidingMode.STICK_SLIP: ("#F2C56B", "//"),
    SlidingMode.CONTINUOUS: ("#B07AA8", "\\\\"),
}

#: Hatching of the flags under which there is no value, and of cautions.  Notes have none.
HATCHES = {
    Validity.STATICALLY_UNSTABLE: "\\\\\\",
    Validity.UPLIFT: "|||",
    Validity.LIMIT_UNDEFINED: "oo",
    Validity.FRICTION_NOT_DECAYING: "---",
    Validity.KD_NOT_POSITIVE: "xxx",
    Validity.NOT_RECOUPLED: "xx",
    Validity.FLEXIBLE_BLOCK: "++",
    Validity.UPSLOPE: "OO",
    Validity.NEAR_MODE_LIMIT: "..",
}

#: Displacements that people design for, m.
_LEAST, _MOST = 1e-3, 1.0

#: What a contour's label takes to each side, and what it needs to the next contour, inches.
_LABEL_ROOM, _LINE_ROOM = 0.28, 0.11

#: Ratios above one at which the colour changes; below one their inverses do.  The first is as good as one.
_RATIOS = (1.1, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)


# --------------------------------------------------------------------------- the three maps


def contours(sheet: Sheet, name: str) -> Figure:
    """Draw contours of a result, with the lines of yield and of the mode limit.

    Parameters
    ----------
    sheet : Sheet
        Of a slice that holds the result and, if there is hatching to be, `validity`.
    name : str
        The result.
    """
    _set_axes(sheet)
    drawn = reliable(sheet.table.data_vars, name, sheet.look).values
    levels = list(sheet.look.levels) or _levels(name, drawn)
    if not levels or not np.isfinite(drawn).any():
        sheet.notes.append(_without_levels(name, drawn))
        return _finish(sheet)
    places = np.log10(levels)
    colours = COLOURS.resampled(len(levels) + 1)
    norm = BoundaryNorm(places, colours.N, extend="both")
    if np.nanmax(drawn) < levels[-1]:
        norm = BoundaryNorm(places, colours.N, extend="min")
    texts = {place: _value_label(name, level) for place, level in zip(places, levels, strict=True)}

    def at_limit(panel: Panel) -> xr.Variable:
        found = solve(panel.table, [name, "validity"], **sides_of(panel.lines["limiting_acceleration"]))
        return reliable(found, name, panel.look)

    # what is below the lowest level, or nothing, is a hundredth of it
    def logarithms(values: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.maximum(np.log10(values), places[0] - 2)

    areas = None
    for panel in sheet.panels:
        areas = _fill(panel, panel.result(name), at_limit, logarithms, colours, norm, texts) or areas
    _colour_bar(sheet, areas, places, texts, RESULTS[name]["long_name"])
    if name == "permanent_displacement":
        sheet.note_newmark()
    sheet.note_left_out(name)
    return _finish(sheet)


def modes(sheet: Sheet) -> Figure:
    """Draw the sliding mode of every cell, by colour and hatch."""
    _set_axes(sheet)
    for panel in sheet.panels:
        codes = panel.grid(panel.table["sliding_mode"])
        for mode, (colour, hatch) in MODES.items():
            label = mode.name.lower().replace("_", "–")
            _mark(sheet, panel, codes == int(mode), label, facecolor=colour, edgecolor="white", hatch=hatch, zorder=0.5)
    return _finish(sheet)


def newmark_ratio(sheet: Sheet) -> Figure:
    """Draw the ratio of the permanent displacement to that of Newmark's block, in colours that diverge from 1."""
    _set_axes(sheet)
    name = "permanent_displacement"
    ours = reliable(sheet.table.data_vars, name, sheet.look)
    ratio = ratios(ours, newmark(sheet.table), sheet.table)
    there = ratio[np.isfinite(ratio) & (ratio > 0)]
    if not there.size:
        sheet.notes.append("No ratio: no displacement above zero.")
        return _finish(sheet)
    farthest = float(np.abs(np.log10(there)).max())
    above = [level for level in _RATIOS if level == _RATIOS[0] or math.log10(level) < farthest]
    levels = [1 / level for level in reversed(above)] + above
    places = np.log10(levels)
    colours = RATIO_COLOURS.resampled(len(levels) + 1)
    norm = BoundaryNorm(places, colours.N, extend="both")
    texts = {place: f"{level:.2g}" if level < 1 else f"{level:g}" for place, level in zip(places, levels, strict=True)}

    def at_limit(panel: Panel) -> xr.Variable:
        sides = sides_of(panel.lines["limiting_acceleration"])
        found = reliable(solve(panel.table, [name, "validity"], **sides), name, panel.look)
        return xr.Variable(found.dims, ratios(found, newmark(panel.table, **sides), panel.table))

    def logarithms(values: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(values > 0, np.log10(values), np.nan)

    areas = None
    for panel in sheet.panels:
        ours = panel.result(name)
        quotient = xr.Variable(ours.dims, ratios(ours, newmark(panel.table), panel.table))
        areas = _fill(panel, quotient, at_limit, logarithms, colours, norm, texts) or areas
    _colour_bar(sheet, areas, places, texts, "displacement over that of Newmark's block")
    sheet.note_newmark()
    sheet.note_left_out(name)
    return _finish(sheet)


# ------------------------------------------------------------------------- filled contours


def _fill(
    panel: Panel, drawn: xr.Variable, at_limit: Any, logarithms: Any, colours: Colormap, norm: BoundaryNorm,
    texts: dict[float, str],
) -> Any:  # fmt: skip
    """Fill between contours and label them; both end on the mode limit, where the result jumps."""
    places, areas = sorted(texts), None
    taken = _line_points(panel)
    for xs, ys, values in _sides(panel, drawn, at_limit):
        logs = np.ma.masked_invalid(logarithms(values))
        if not logs.count():
            continue
        look: dict[str, Any] = {"cmap": colours, "norm": norm, "extend": norm.extend}
        areas = panel.axes.contourf(xs, ys, logs, places, zorder=0.5, **look)
        lines = panel.axes.contour(xs, ys, logs, places, colors="black", linewidths=0.7, linestyles="solid", zorder=1)
        lines.set_gid("contours")
        _label_contours(panel, lines, texts, taken)
    return areas


def _sides(panel: Panel, drawn: xr.Variable, at_limit: Any) -> list[tuple[Floats, Floats, Floats]]:
    """x, y and values of the cells below and beyond the mode limit, as grids that end on the limit.

    Cells on the other side are moved onto the limit and have the result there.
    """
    xs, ys = np.meshgrid(panel.values(panel.x), panel.values(str(panel.y)))
    values = panel.grid(drawn)
    if "limiting_acceleration" not in panel.lines:
        return [(xs, ys, values)]
    beyond = panel.grid(panel.table["amplitude"]) > panel.grid(panel.lines["limiting_acceleration"])
    line = threshold_line(panel, "limiting_acceleration")
    if line is None or not (beyond.any() and not beyond.all()):  # the limit is no line of this plane
        return [(xs, ys, np.where(side, values, np.nan)) for side in (~beyond, beyond) if side.any()]
    upright = panel.y in DRIVES
    edges = broadcast(at_limit(panel), panel.table, (str(panel.x if upright else panel.y), SIDE))
    # along the amplitude first; one more cell, on the limit, for lines that leave the map beside it
    along, other, cells, over = (ys, xs, values, beyond) if upright else (xs.T, ys.T, values.T, beyond.T)
    sides = []
    for number, (away, end) in enumerate(((over, -1), (~over, 0))):
        limit = np.where(np.isfinite(line[upright]), line[upright], along[end])
        at = len(along) if end else 0
        grids = (
            np.insert(np.where(away, limit, along), at, limit, axis=0),
            np.insert(other, at, other[0], axis=0),
            np.insert(np.where(away, edges[:, number], cells), at, edges[:, number], axis=0),
        )
        place, beside, found = grids if upright else (one.T for one in grids)
        sides.append((beside, place, found) if upright else (place, beside, found))
    return sides


def threshold_line(panel: Panel, name: str) -> tuple[Floats, Floats] | None:
    """The line in the plane of a map on which the amplitude is a threshold acceleration.

    Returns
    -------
    tuple of ndarray or None
        x and y of the line; None if neither axis is one of amplitude.
    """
    table = panel.table
    for drive, other, swapped in ((str(panel.y), panel.x, False), (panel.x, str(panel.y), True)):
        if drive not in DRIVES:
            continue
        along = panel.values(other)
        values = broadcast(panel.lines[name], table, (other,)) * panel.look.scale(drive, panel.g)
        if drive == "displacement_amplitude":
            values = values / (2 * math.pi * broadcast(table["frequency"], table, (other,))) ** 2
        return (values, along) if swapped else (along, values)
    return None


def _line_points(panel: Panel) -> list[Floats]:
    """A few dozen points of the threshold lines, in inches: they say well enough where there is room."""
    to_inches = panel.axes.transData + panel.axes.figure.dpi_scale_trans.inverted()
    shown = [line for name in panel.lines if (line := threshold_line(panel, name)) is not None]
    return [to_inches.transform(np.column_stack(line)[:: math.ceil(line[0].size / 60)]) for line in shown]


def _label_contours(panel: Panel, drawn: Any, texts: dict[float, str], taken: list[Floats]) -> None:
    """Label each contour where it is farthest from edges, other contours and `taken`, if there is room.

    `taken` holds points of lines and labels, in inches; the new labels are added.
    """
    to_inches = panel.axes.transData + panel.axes.figure.dpi_scale_trans.inverted()
    corners = panel.axes.bbox.transformed(panel.axes.figure.dpi_scale_trans.inverted()).get_points()
    contours = [to_inches.transform(np.concatenate([*segments, np.empty((0, 2))])) for segments in drawn.allsegs]
    contours = [points[np.isfinite(points).all(axis=1)] for points in contours]
    contours = [points[:: math.ceil(len(points) / 300)] for points in contours if len(points)]
    positions = []
    for points in contours:
        room = np.minimum(points - corners[0], corners[1] - points).min(axis=1)
        for obstacle in taken:
            room = np.minimum(room, _apart(points, obstacle))
        # another contour may come nearer than the end of a label
        for other in contours:
            if other is not points:
                room = np.minimum(room, _apart(points, other) * _LABEL_ROOM / _LINE_ROOM)
        best = int(np.argmax(room))
        if room[best] > _LABEL_ROOM:
            taken.append(points[best : best + 1])
            positions.append(tuple(to_inches.inverted().transform(points[best])))
    if positions:
        labels = panel.axes.clabel(
            drawn, manual=positions, fmt=lambda place: texts[min(texts, key=lambda one: abs(one - place))],
            fontsize=8, colors="black",
        )  # fmt: skip
        for label in labels:
            label.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _apart(points: Floats, others: Floats) -> Floats:
    """How far each point is from the nearest of some others."""
    there = others[np.isfinite(others).all(axis=1)]
    apart = points[:, None] - there[None]
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]).min(axis=1, initial=np.inf))


def _colour_bar(sheet: Sheet, areas: Any, places: Floats, texts: dict[float, str], label: str) -> None:
    if areas is None:
        return
    bar = sheet.figure.colorbar(areas, ax=[panel.axes for panel in sheet.panels], ticks=places, pad=0.02)
    bar.ax.set_yticklabels([texts[place] for place in places])
    bar.ax.minorticks_off()
    bar.set_label(label, fontsize="small" if len(sheet.panels) > 1 else None)


def _levels(name: str, values: Floats) -> list[float]:
    """1-3-10 levels that lie in the values; of displacements those that people design for."""
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
        return "No contours: no values."
    if not (there > 0).any():
        return "No contours: no values above zero."
    low, high = (_value_label(name, float(value)) for value in (there[there > 0].min(), there.max()))
    return f"No contours: all values above zero are {low}" + (f" to {high}." if high != low else ".")


def _value_label(name: str, value: float) -> str:
    return length_text(value) if RESULTS[name].get("units") == "m" else f"{value:.3g} {unit(name)}".strip()


# ---------------------------------------------------------------------- lines and hatching


def _set_axes(sheet: Sheet) -> None:
    for side, name in (("x", sheet.x), ("y", str(sheet.y))):
        sheet.set_axis(side, name)


def _finish(sheet: Sheet) -> Figure:
    """Threshold lines, hatching, legend and caption of a map."""
    for panel in sheet.panels:
        for name in panel.lines:
            text, look = LINES[name]
            if _draw_threshold(panel, name, look):
                sheet.remarks[text] = Line2D([], [], **look)
        _hatch(sheet, panel)
    return sheet.finish()


def _draw_threshold(panel: Panel, name: str, look: dict[str, Any]) -> bool:
    """Draw the line of a threshold acceleration; False where none is in the plane."""
    line = threshold_line(panel, name)
    if line is not None:
        panel.axes.plot(*line, gid=name, **look)
        corners = np.array([panel.axes.get_xlim(), panel.axes.get_ylim()])
        inside = [(values >= low) & (values <= high) for values, (low, high) in zip(line, corners, strict=True)]
        return bool((inside[0] & inside[1]).any())
    excess = np.ma.masked_invalid(panel.grid(panel.table["amplitude"]) - panel.grid(panel.lines[name]))
    if not excess.count() or not excess.min() < 0 < excess.max():
        return False
    drawn = panel.axes.contour(
        panel.values(panel.x), panel.values(str(panel.y)), excess, [0.0], colors=look["color"],
        linestyles=[look["linestyle"]], linewidths=look["linewidth"],
    )  # fmt: skip
    drawn.set_gid(name)
    return True


def _hatch(sheet: Sheet, panel: Panel) -> None:
    """Hatch the cells of each flag that means no value or a caution."""
    if "validity" not in panel.table:
        return
    for flag, hatch in HATCHES.items():
        name = (flag.name or "").lower()
        cells = panel.grid(validity_has(panel.table["validity"], flag))
        _mark(sheet, panel, cells, name, facecolor="none", edgecolor="0.2", hatch=hatch)


def _mark(sheet: Sheet, panel: Panel, cells: NDArray[np.bool_], label: str, **look: Any) -> None:
    """Cover cells with a colour or hatch, and give the legend an entry."""
    if not cells.any():
        return
    look = {"linewidth": 0, **look}
    columns, rows = (_edges(panel.values(axis)) for axis in (panel.x, str(panel.y)))
    with mpl.rc_context({"hatch.linewidth": 0.6}):
        panel.axes.add_patch(PathPatch(_outline(cells, columns, rows), gid=label, **look))
        sheet.legend[label] = Patch(**{**look, "linewidth": 0.6})


def _edges(values: Floats) -> Floats:
    """Where the cells of an axis meet: midway, on the axis's own scale."""
    if is_log(values):
        return np.exp(_edges_of(np.log(values)))
    return _edges_of(values)


def _edges_of(values: Floats) -> Floats:
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


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
