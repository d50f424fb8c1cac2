"""Maps: a result, the sliding mode, or the ratio to Newmark's block over two axes of a slice.

Values are drawn as they are; contours are those of their logarithm, in which u = W/ω² is a straight line
over a logarithmic frequency axis.
"""

import itertools
import math
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import BoundaryNorm, Colormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from slipsweep.charts.answers import DISPLACEMENT, newmark, thresholds
from slipsweep.charts.sheet import Panel, Sheet, has_flags, is_log, reliable
from slipsweep.charts.style import (
    COLOURS,
    LINES,
    MODE_TEXT,
    NO_SLIDING,
    UNSOUND,
    flag_name,
    length_text,
    ratio_colours,
    ratio_text,
    unit,
)
from slipsweep.model.variables import RESULTS, SlidingMode, Validity

Floats = NDArray[np.float64]

#: Colour and hatch of each mode: from light to dark.
MODES = {
    SlidingMode.STUCK: ("white", ""),
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

#: Hatching of displacements that have a trend which no block has.
UNSOUND_HATCH = "///"

#: Least thickness of a hatched region, inches: a thinner one is a scrap of hatch; the caption counts its cells.
_SCRAP = 0.09

#: Displacements that people design for, m.
_LEAST, _MOST = 1e-3, 1.0

#: What a contour's label takes to each side, and what it needs to the next line, inches.
_LABEL_SPACE, _LINE_SPACE = 0.28, 0.11

#: Ratios above one at which the colour changes; below one their inverses do.  The first is as good as one.
_RATIOS = (1.1, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)


# --------------------------------------------------------------------------- the three maps


def contours(sheet: Sheet, name: str) -> Figure:
    """Draw contours of a result, with the lines of yield and of the mode limit.

    Parameters
    ----------
    sheet : Sheet
        Of a slice that holds the result and `validity`.
    name : str
        The result.
    """
    drawn = reliable(sheet.data, name, sheet.look)
    _prepare(sheet, drawn)
    if name == DISPLACEMENT:
        theirs = newmark(sheet.data)
        if sheet.data.attrs["model"] != "newmark":
            sheet.notes += ratio_text((drawn / theirs).values)
        sheet.find_unsound(drawn, theirs, f"Hatched {UNSOUND_HATCH}")
    levels = list(sheet.look.levels) or _levels(name, drawn.values)
    if not levels or not np.isfinite(drawn).any():
        sheet.notes.append(_without_levels(name, drawn.values))
        return _finish(sheet, name)
    colours = COLOURS.resampled(len(levels) + 1)
    norm = BoundaryNorm(np.log10(levels), colours.N, extend="min" if np.nanmax(drawn) < levels[-1] else "both")
    texts = [_value_label(name, level) for level in levels]
    # what is below the lowest level, or nothing, is a hundredth of it; what does not slide is covered later
    _fill_panels(sheet, colours, norm, texts, RESULTS[name]["long_name"], least=levels[0] / 100)
    return _finish(sheet, name)


def newmark_ratio(sheet: Sheet) -> Figure:
    """Draw the ratio of the permanent displacement to that of Newmark's block."""
    ours = reliable(sheet.data, DISPLACEMENT, sheet.look)
    theirs = newmark(sheet.data)
    _prepare(sheet, (ours / theirs).where(theirs > 0))
    ratio = sheet.data["drawn"].values
    sheet.notes += ratio_text(ratio)
    sheet.find_unsound(ours, theirs, f"Hatched {UNSOUND_HATCH}")
    there = ratio[np.isfinite(ratio) & (ratio > 0)]
    if not there.size:
        sheet.notes.append("No ratio: no displacement above zero.")
        return _finish(sheet, DISPLACEMENT)
    farthest = float(np.abs(np.log10(there)).max())
    above = [level for level in _RATIOS if level == _RATIOS[0] or math.log10(level) < farthest]
    levels = [1 / level for level in reversed(above)] + above
    colours = ratio_colours(len(above))
    norm = BoundaryNorm(np.log10(levels), colours.N, extend="both")
    texts = [f"{level:.2g}" if level < 1 else f"{level:g}" for level in levels]
    _fill_panels(sheet, colours, norm, texts, "displacement over that of Newmark's block")
    return _finish(sheet, DISPLACEMENT)


def modes(sheet: Sheet) -> Figure:
    """Draw the sliding mode of every cell, by colour and hatch."""
    _set_axes(sheet)
    sheet.data = sheet.data.merge(thresholds(sheet.data))
    _draw_thresholds(sheet)
    for panel in sheet.panels:
        codes = panel.grid("sliding_mode")
        for mode, (colour, hatch) in MODES.items():
            look = {"facecolor": colour, "edgecolor": "white", "hatch": hatch, "zorder": 0.5}
            entry = {**look, "edgecolor": "0.6"} if mode is SlidingMode.STUCK else look
            _mark(sheet, panel, codes == int(mode), MODE_TEXT[mode], look, entry)
    return _finish(sheet, "sliding_mode")


# ------------------------------------------------------------------- what is drawn, per panel


def _prepare(sheet: Sheet, drawn: xr.DataArray) -> None:
    """Set the axes, and add to the slice what the panels draw: values and thresholds."""
    _set_axes(sheet)
    sheet.data = sheet.data.merge(thresholds(sheet.data)).assign(drawn=drawn)
    _draw_thresholds(sheet)


# ------------------------------------------------------------------------- filled contours


def _fill_panels(
    sheet: Sheet, colours: Colormap, norm: BoundaryNorm, texts: list[str], label: str, least: float = 0.0
) -> None:
    """Fill between contours and label them; both end on the mode limit, where the result jumps.

    Values below `least` are drawn as that; of zero there is no logarithm.
    """
    places, areas = norm.boundaries, None
    labels = dict(zip(places, texts, strict=True))
    look: dict[str, Any] = {"cmap": colours, "norm": norm}
    for panel in sheet.panels:
        xs, ys = panel.values(panel.x), panel.values(str(panel.y))
        with np.errstate(divide="ignore", invalid="ignore"):
            # what contours leave open beside the mode limit and cells without a value has the colours of the cells
            cells = np.ma.masked_invalid(np.log10(np.maximum(panel.grid("drawn"), least)))
            panel.axes.pcolormesh(_edges(xs), _edges(ys), cells, zorder=0.4, rasterized=True, **look)
            for values in _sides(panel):
                logs = np.ma.masked_invalid(np.log10(np.maximum(values, least)))
                if not logs.count():
                    continue
                areas = panel.axes.contourf(xs, ys, logs, places, zorder=0.5, extend=norm.extend, **look)
                line: dict[str, Any] = {"colors": "black", "linewidths": 0.7, "linestyles": "solid", "zorder": 1}
                lines = panel.axes.contour(xs, ys, logs, places, **line)
                lines.set_gid("contours")
                _label_contours(panel, lines, labels)
    if areas is None:
        return
    bar = sheet.figure.colorbar(areas, ax=[panel.axes for panel in sheet.panels], ticks=places, pad=0.02)
    bar.ax.set_yticklabels(texts, fontsize=sheet.look.font)
    bar.ax.minorticks_off()
    bar.set_label(label, fontsize="small" if len(sheet.panels) > 1 else None)


def _sides(panel: Panel) -> list[Floats]:
    """Values below the mode limit and beyond it: no contour crosses the jump."""
    values = panel.grid("drawn")
    if "limit_line" not in panel.data:
        return [values]
    beyond = panel.grid("amplitude") > panel.grid("limit_line")
    return [np.where(side, values, np.nan) for side in (~beyond, beyond) if side.any()]


def _label_contours(panel: Panel, drawn: Any, texts: dict[float, str]) -> None:
    """Label each contour where it is farthest from the frame and from all other lines, if there is space."""
    inches = panel.axes.transData + panel.axes.figure.dpi_scale_trans.inverted()
    corners = panel.axes.bbox.transformed(panel.axes.figure.dpi_scale_trans.inverted()).get_points()
    shown: list[Any] = [drawn, *(one for one in panel.axes.collections if one.get_gid() in LINES)]
    nothing = np.empty((0, 2))
    lines = [inches.transform(np.concatenate([*some, nothing])) for one in shown for some in one.allsegs]
    labels: list[Floats] = []
    for at, points in enumerate(lines[: len(drawn.levels)]):
        if not len(points):
            continue
        space = np.minimum(points - corners[0], corners[1] - points).min(axis=1)
        others = np.concatenate([nothing, *lines[:at], *lines[at + 1 :]])
        space = np.minimum(space, _LABEL_SPACE / _LINE_SPACE * KDTree(others).query(points)[0])
        if labels:
            space = np.minimum(space, KDTree(labels).query(points)[0])
        best = int(np.argmax(space))
        if space[best] > _LABEL_SPACE:
            labels.append(points[best])
    if labels:
        places: Any = inches.inverted().transform(labels)
        for text in panel.axes.clabel(drawn, manual=places, fmt=texts, fontsize=0.8 * panel.look.font):
            text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _levels(name: str, values: Floats) -> list[float]:
    """1-3-10 levels that lie in the values; of displacements those that people design for."""
    there = values[np.isfinite(values) & (values > 0)]
    if not there.size:
        return []
    low, high = float(there.min()), float(there.max())
    if name == DISPLACEMENT and low < _MOST and high > _LEAST:
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


def _finish(sheet: Sheet, name: str) -> Figure:
    """Area of no sliding, hatching, legend and caption of a map."""
    scraps: dict[str, int] = {}
    for panel in sheet.panels:
        if name != "sliding_mode":
            _cover_no_sliding(sheet, panel)
        hatches = {flag_name(flag): (has_flags(panel.data["validity"], flag), hatch) for flag, hatch in HATCHES.items()}
        if "unsound" in panel.data:
            hatches[UNSOUND] = panel.data["unsound"], UNSOUND_HATCH
        for text, (cells, hatch) in hatches.items():
            look = {"facecolor": "none", "edgecolor": "0.2", "hatch": hatch}
            scraps[text] = scraps.get(text, 0) + _mark(sheet, panel, panel.grid(cells), text, look, scraps=False)
    small = [f"{' '.join(text.split())} ({count} cell{'s' * (count > 1)})" for text, count in scraps.items() if count]
    if small:
        sheet.notes.append(f"Also, in regions too small to hatch: {'; '.join(small)}.")
    if name != "sliding_mode":
        sheet.note_left_out(name)
    return sheet.done(beside=False)


def _cover_no_sliding(sheet: Sheet, panel: Panel) -> None:
    """Leave white, up to the line of yield, what does not slide: no colour of a displacement stands for it."""
    excess = np.ma.masked_invalid(panel.grid("amplitude") - panel.grid("yield_line"))
    if not excess.count() or excess.min() >= 0:
        return
    if excess.max() > 0:
        xs, ys = panel.values(panel.x), panel.values(str(panel.y))
        panel.axes.contourf(xs, ys, excess, [float(excess.min()) - 1.0, 0.0], colors="white", zorder=1.05)
    sheet.legend[NO_SLIDING] = Patch(facecolor="white", edgecolor="0.6", linewidth=0.6)


def _draw_thresholds(sheet: Sheet) -> None:
    """Draw the lines on which the amplitude is the acceleration of yield or of the mode limit."""
    for panel, (name, (text, look)) in itertools.product(sheet.panels, LINES.items()):
        if name not in panel.data:
            continue
        excess = np.ma.masked_invalid(panel.grid("amplitude") - panel.grid(name))
        if excess.count() and excess.min() < 0 < excess.max():
            drawn = panel.axes.contour(
                panel.values(panel.x), panel.values(str(panel.y)), excess, [0.0], colors=look["color"],
                linestyles=[look["linestyle"]], linewidths=look["linewidth"],
            )  # fmt: skip
            drawn.set_gid(name)
            sheet.remarks[text] = Line2D([], [], **look)


def _mark(
    sheet: Sheet, panel: Panel, cells: NDArray[np.bool_], label: str, look: dict[str, Any],
    entry: dict[str, Any] | None = None, scraps: bool = True,
) -> int:  # fmt: skip
    """Cover cells with a colour or hatch, and give the legend an entry.

    Without `scraps` regions that are too small for a hatch are left; returns how many cells they have.
    """
    columns, rows = (_edges(panel.values(axis)) for axis in (panel.x, str(panel.y)))
    left = 0
    if not scraps and cells.any():
        large = _large(panel, cells, columns, rows)
        left, cells = int((cells & ~large).sum()), large
    if cells.any():
        look = {"linewidth": 0, **look}
        with mpl.rc_context({"hatch.linewidth": 0.6}):
            panel.axes.add_patch(PathPatch(_outline(cells, columns, rows), gid=label, **look))
            sheet.legend[label] = Patch(**{**(entry or look), "linewidth": 0.6})
    return left


def _large(panel: Panel, cells: NDArray[np.bool_], columns: Floats, rows: Floats) -> NDArray[np.bool_]:
    """The cells of connected regions that are thick enough for a hatch."""
    to_inches = panel.axes.transData + panel.axes.figure.dpi_scale_trans.inverted()
    xs = to_inches.transform(np.column_stack([columns, np.full_like(columns, rows[0])]))[:, 0]
    ys = to_inches.transform(np.column_stack([np.full_like(rows, columns[0]), rows]))[:, 1]
    regions, number = ndimage.label(cells, np.ones((3, 3)))
    large = np.zeros(number + 1, bool)
    for at, (row, column) in enumerate(ndimage.find_objects(regions), start=1):
        extents = xs[column.stop] - xs[column.start], ys[row.stop] - ys[row.start]
        covered = float(np.mean(regions[row, column] == at)) * math.prod(extents)
        large[at] = covered >= _SCRAP * max(extents)
    return np.asarray(large[regions])


def _edges(values: Floats) -> Floats:
    """Where the cells of an axis meet: midway, on the axis's own scale."""
    if is_log(values):
        return np.exp(_edges_of(np.log(values)))
    return _edges_of(values)


def _edges_of(values: Floats) -> Floats:
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _outline(cells: NDArray[np.bool_], columns: Floats, rows: Floats) -> Path:
    """The cells that are true as rectangles, one for each run along a row."""
    paths = []
    for bottom, top, row in zip(rows[:-1], rows[1:], cells, strict=True):
        change = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        for left, right in zip(columns[change[::2]], columns[change[1::2]], strict=True):
            paths.append(
                Path([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)], closed=True)
            )
    return Path.make_compound_path(*paths)
