"""Maps: a result, the sliding mode, or the ratio to Newmark's block over two axes of a slice.

Values are drawn as they are; contours are those of their logarithm, in which u = W/ω² is a straight
line over a logarithmic frequency axis.

Regions end at the limits of the equations: at the yield acceleration, at the mode limit, and where
the block begins to slide under its own weight (θ = φ).  Up to there the values of the nearest
cells are continued.  Regions of flags have no equation: they end half way between cells.
"""

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import BoundaryNorm, Colormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedFormatter
from scipy import ndimage
from scipy.spatial import KDTree

from slipsweep.charts import regions, style
from slipsweep.charts.regions import Cells
from slipsweep.charts.sheet import Panel, Sheet
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Floats, Look, Options
from slipsweep.errors import InputError
from slipsweep.model.variables import RESULTS, VALUELESS, SlidingMode, Validity
from slipsweep.studies.boundaries import boundaries, has_flags
from slipsweep.studies.solved_again import DISPLACEMENT, DRIVES, is_newmark

#: Colour and hatch of each mode: from light to dark.
MODES = {
    SlidingMode.STUCK: ("white", ""),
    SlidingMode.STICK_SLIP: ("#F2C56B", "//"),
    SlidingMode.CONTINUOUS: ("#B07AA8", "--"),
}

#: Order of drawing (matplotlib's zorder): values, no sliding, cells without a value, hatches; then,
#: over the lines, blocks that slide under their own weight.
_VALUES = 0.5
_STUCK = 1.05
_MISSING = 1.07
_HATCHES = 1.1
_UNSTABLE = 2.1

#: Colour of cells whose value is missing or left out: white means no sliding.
NO_VALUE = "0.88"

#: Hatching of the flags under which there is no value, and of cautions: signs that differ also
#: where they are small.  Notes have none.
HATCHES = {
    Validity.STATICALLY_UNSTABLE: "\\\\\\",
    Validity.UPLIFT: "|||",
    Validity.LIMIT_UNDEFINED: "oo",
    Validity.FRICTION_NOT_DECAYING: "---",
    Validity.KD_NOT_POSITIVE: "**",
    Validity.NOT_RECOUPLED: "xx",
    Validity.FLEXIBLE_BLOCK: "++",
    Validity.UPSLOPE: "OO",
    Validity.NEAR_MODE_LIMIT: "..",
    Validity.MAY_NOT_STOP: "|..",
    Validity.NOT_AT_REST: "O.",
}

#: Hatching of displacements that have a trend which no block has.
UNSOUND_HATCH = "///"

#: Share of the steps from cell to cell in which values grow more than tenfold, beyond which a grid
#: is coarse.
_COARSE = 0.1


def contours(result: Result, options: Options) -> Figure:
    """Draw contours of a result, with the lines of yield and of the mode limit."""
    names = result.compared(options.variable)
    levels = options.heights
    if len(levels) == 1:
        raise InputError(f"levels: {levels[0]:g}: must be two different values or more")
    sheet = _sheet(result, options, names, ("frequency", "theta", "mu_s"))
    name = names[0]
    drawn = sheet.data["drawn"]
    levels = levels or _levels(name, drawn.values)
    if not levels or not np.isfinite(drawn).any():
        why = "all values are about the same" if (drawn > 0).any() else "no values above zero"
        sheet.note(f"No contours: {why}.")
        return _finish(sheet, name)
    logs = xr.apply_ufunc(np.log10, drawn.clip(min=levels[0]))
    growth = [logs.diff(dim) for dim in (sheet.x, str(sheet.y))]
    if any((abs(steps) > 1.0).sum() > _COARSE * (steps != 0.0).sum() for steps in growth):
        sheet.note(
            "Coarse grid: values grow more than tenfold from cell to cell; read none between "
            "cells.",
            "Coarse grid: read no values between cells.",
        )
    of_length = RESULTS[name].get("units") == "m"
    texts = [
        style.length_text(level) if of_length else style.with_unit(f"{level:.3g}", style.unit(name))
        for level in levels
    ]
    # values below the lowest level, zeros too, are drawn as a hundredth of it; the area of no
    # sliding is covered later
    sheet.data["drawn"] = drawn.clip(min=levels[0] / 100)
    colours = style.COLOURS.resampled(len(levels) + 1)
    end = "min" if drawn.max() < levels[-1] else "both"
    _fill_panels(sheet, colours, levels, texts, style.result_text(sheet.data.attrs, name), end)
    return _finish(sheet, name)


def newmark(result: Result, options: Options) -> Figure:
    """Draw the ratio of the permanent displacement to that of Newmark's block."""
    if is_newmark(result.data):
        raise InputError(
            f"{result.name}: the result is of Newmark's block itself: the ratio is 1 everywhere"
        )
    sheet = _sheet(result, options, result.compared(DISPLACEMENT), ("theta", "mu_s", "frequency"))
    sheet.data["drawn"] = (sheet.data["drawn"] / sheet.data["newmark"]).where(
        sheet.data["newmark"] > 0
    )
    there = sheet.data["drawn"].where(sheet.data["drawn"] > 0)
    if not there.count():
        sheet.note("No ratio: no displacement above zero.")
        return _finish(sheet, DISPLACEMENT)
    farthest = np.abs(np.log10(there)).max()
    # the colour changes at these ratios and at their inverses; 1.1 counts as no difference
    above = [
        1.1,
        *(level for level in (1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0) if np.log10(level) < farthest),
    ]
    levels = [1 / level for level in reversed(above)] + above
    texts = [f"{level:.2g}" if level < 1 else f"{level:g}" for level in levels]
    label = "displacement over that of Newmark's block"
    _fill_panels(sheet, style.ratio_colours(len(above)), levels, texts, label, "both")
    return _finish(sheet, DISPLACEMENT)


def modes(result: Result, options: Options) -> Figure:
    """Draw the sliding mode of every cell, by colour and hatch."""
    sheet = _sheet(
        result,
        options,
        ["sliding_mode", "validity"],
        ("theta", "yield_coefficient", "mu_s", "frequency"),
    )
    for panel in sheet.panels:
        codes = panel.grid("sliding_mode")
        # the areas of continuous sliding and of no sliding are drawn over that of stick-slip
        margins = {
            SlidingMode.STUCK: (-regions.excess_over(panel, "yield_line"), _STUCK),
            SlidingMode.STICK_SLIP: (np.ma.ones(codes.shape), _VALUES),
            SlidingMode.CONTINUOUS: (regions.excess_over(panel, "limit_line"), _VALUES + 0.1),
        }
        for mode, (colour, hatch) in MODES.items():
            if not (codes == mode).any():
                continue
            look = {"facecolor": colour, "edgecolor": "white" if hatch else "0.6", "hatch": hatch}
            _fill(sheet, panel, *margins[mode], style.MODE_TEXT[mode], look)
    return _finish(sheet, "sliding_mode")


def _sheet(result: Result, options: Options, names: list[str], across: Sequence[str]) -> Sheet:
    """Return the sheet of a map of the first of some results.

    It has axes, and the lines of yield and of the mode limit.
    """
    # with the amplitude given, modes and ratios of displacements do not depend on the frequency
    varies = across[0] == "frequency" or "displacement_amplitude" in result.data.coords
    sheet = result.sheet(options, names, across, y=DRIVES, same=[] if varies else ["frequency"])
    sheet.show(names[0], f"Hatched {UNSOUND_HATCH}")
    # the lines go on to where the block slides under its own weight, which is drawn over them
    sheet.data = sheet.data.assign(boundaries(sheet.data))
    for panel in sheet.panels:
        panel.axes.set_facecolor(NO_VALUE)
    for panel, (name, (text, look)) in itertools.product(sheet.panels, style.LINES.items()):
        excess = regions.excess_over(panel, name)
        there = excess[regions.at_rest(panel)].compressed()
        if there.size and there.min() < 0 < there.max():
            drawing: Look = {f"{key}s": [value] for key, value in look.items()}
            panel.axes.contour(panel.xs, panel.ys, excess, [0.0], **drawing).set_gid(name)
            sheet.remarks[text] = Line2D([], [], **look)
    return sheet


def _fill_panels(
    sheet: Sheet, colours: Colormap, levels: list[float], texts: list[str], label: str, end: Any
) -> None:
    """Fill between contours and label them, up to the jump at the mode limit."""
    places = np.log10(levels)
    areas = None
    look: Look = {"cmap": colours, "norm": BoundaryNorm(places, colours.N, extend=end)}
    line: Look = {"colors": "black", "linewidths": 0.7, "linestyles": "solid", "zorder": 1}
    for panel in sheet.panels:
        xs = panel.xs
        ys = panel.ys
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log10(panel.grid("drawn"))
        # of a ratio there is none where nothing slides
        slides = (regions.excess_over(panel, "yield_line") > 0).filled(True)
        edges = (
            regions.edges_of(xs, panel.axes.get_xscale()),
            regions.edges_of(ys, panel.axes.get_yscale()),
        )
        for side, region in regions.sides_of(panel):  # no contour crosses the jump
            inside = side & (slides | np.isfinite(logs))
            shown = np.ma.masked_invalid(np.where(inside, logs, np.nan))
            if not shown.count():
                continue
            filled = np.ma.masked_invalid(regions.continued(logs, inside))
            # contours leave gaps along cells without a value; there the cells are drawn
            cells = panel.axes.pcolormesh(*edges, filled, zorder=0.4, rasterized=True, **look)
            areas = panel.axes.contourf(xs, ys, filled, places, zorder=_VALUES, extend=end, **look)
            for artist in (cells, areas):
                regions.clip(panel, artist, region)
            lines = panel.axes.contour(xs, ys, shown, places, **line)
            lines.set_gid("contours")
            _label_contours(panel, lines, dict(zip(places, texts, strict=True)))
    if areas is None:
        return
    bar = sheet.figure.colorbar(
        areas, ax=sheet.grid, ticks=places, format=FixedFormatter(texts), pad=0.02
    )
    bar.ax.tick_params(labelsize=sheet.options.font)
    bar.minorticks_off()
    bar.set_label(label, fontsize="small" if len(sheet.panels) > 1 else None)


def _label_contours(panel: Panel, drawn: Any, texts: dict[float, str]) -> None:
    """Label each contour at its point farthest from frame and other lines, if there is space."""
    # space of a label to each side, and to the next line, inches
    label_space = 0.28
    line_space = 0.11
    inches = panel.axes.transData + panel.axes.figure.dpi_scale_trans.inverted()
    corners = panel.axes.bbox.transformed(panel.axes.figure.dpi_scale_trans.inverted()).get_points()
    thresholds: list[Any] = [
        artist for artist in panel.axes.collections if artist.get_gid() in style.LINES
    ]
    segments: list[Any] = [
        *drawn.allsegs,
        *(some for artist in thresholds for some in artist.allsegs),
    ]
    lines = [inches.transform(np.concatenate([*some, np.empty((0, 2))])) for some in segments]
    labels: list[Floats] = []
    for at, points in enumerate(lines[: len(drawn.levels)]):
        others = np.concatenate([*lines[:at], *lines[at + 1 :], np.full((1, 2), 1e9)])
        space = np.minimum(points - corners[0], corners[1] - points).min(axis=1)
        space = np.minimum(space, label_space / line_space * KDTree(others).query(points)[0])
        space = np.minimum(space, KDTree([*labels, (1e9, 1e9)]).query(points)[0])
        if space.size and space.max() > label_space:
            labels.append(points[int(np.argmax(space))])
    if labels:
        places: Any = inches.inverted().transform(labels)
        for text in panel.axes.clabel(
            drawn, manual=places, fmt=texts, fontsize=0.8 * panel.options.font
        ):
            text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _levels(name: str, values: Floats) -> list[float]:
    """Return levels 1, 3, 10, … among the values; of displacements, those from 1 mm to 1 m."""
    there = values[np.isfinite(values) & (values > 0)]
    if not there.size:
        return []
    low = float(there.min())
    high = float(there.max())
    if RESULTS[name].get("units") == "m" and low < 1.0 and high > 1e-3:
        low = max(low, 1e-3)
        high = min(high, 1.0)
    else:
        low = max(low, high * 1e-5)
    every = [float(f"{digit}e{decade}") for decade in range(-20, 20) for digit in (1, 3)]
    inside = [level for level in every if low * (1 - 1e-9) <= level <= high * (1 + 1e-9)]
    if len(inside) < 2:  # values of about one size: levels among them
        return (
            [float(f"{level:.3g}") for level in np.geomspace(low, high, 6)]
            if high > low * 1.01
            else []
        )
    return inside


def _finish(sheet: Sheet, name: str) -> Figure:
    """Draw the area of no sliding, hatching, legend and caption of a map."""
    scraps: Counter[Validity | None] = Counter()
    for panel in sheet.panels:
        if name != "sliding_mode":
            _whiten(sheet, panel)
        _draw_unstable(sheet, panel)
        scraps += _hatch(sheet, panel)
    if scraps:
        counts = {flag: f"({count} cell{'s' * (count > 1)})" for flag, count in scraps.items()}
        names = [f"{_name(flag)} {count}" for flag, count in counts.items()]
        words = [f"{_words(flag)} {count}" for flag, count in counts.items()]
        sheet.note(
            f"Also, in regions too small to hatch: {'; '.join(names)}.",
            f"Too small to hatch: {'; '.join(words)}.",
        )
    if name != "sliding_mode":
        sheet.note_left_out(name)
    return sheet.done(beside=False)


def _words(flag: Validity | None) -> str:
    """Return the legend's words for a flag; None stands for a trend that no block has."""
    return style.UNSOUND if flag is None else style.FLAG_TEXT[flag]


def _name(flag: Validity | None) -> str:
    """Return the name of a flag in full captions, which is that in results."""
    return " ".join(style.UNSOUND.split()) if flag is None else style.flag_name(flag)


def _whiten(sheet: Sheet, panel: Panel) -> None:
    """Draw the area of no sliding in white, up to the line of yield."""
    excess = regions.excess_over(panel, "yield_line")
    if (excess[regions.at_rest(panel)] < 0).any():
        look = {"facecolor": "white", "edgecolor": "0.6", "hatch": ""}
        _fill(sheet, panel, -excess, _STUCK, style.NO_SLIDING, look)


def _draw_unstable(sheet: Sheet, panel: Panel) -> None:
    """Hatch the area where the block slides under its own weight, up to Üy = 0."""
    if regions.at_rest(panel).all():
        return
    flag = Validity.STATICALLY_UNSTABLE
    look = {"facecolor": NO_VALUE, "edgecolor": "0.2", "hatch": HATCHES[flag]}
    area = _fill(sheet, panel, -panel.grid("rest_angle"), _UNSTABLE, _words(flag), look)
    area.set_gid(style.flag_name(flag))


def _hatch(sheet: Sheet, panel: Panel) -> Counter[Validity | None]:
    """Hatch cells by flags (but statically_unstable) and unsound cells; count those too few."""
    validity = panel.data["validity"]
    rests = regions.at_rest(panel)
    missing = panel.grid(has_flags(validity, VALUELESS)) & rests
    if missing.any():
        look = {"facecolor": NO_VALUE, "edgecolor": "none", "hatch": ""}
        regions.paint(panel, *regions.steps(panel, missing), _MISSING, look)
    marks: dict[Validity | None, tuple[xr.DataArray, str]] = {
        flag: (has_flags(validity, flag), hatch)
        for flag, hatch in HATCHES.items()
        if flag != Validity.STATICALLY_UNSTABLE
    }
    if "unsound" in panel.data:
        marks[None] = panel.data["unsound"], UNSOUND_HATCH
    sides = regions.sides_of(panel)
    scraps: Counter[Validity | None] = Counter()
    for flag, (cells, hatch) in marks.items():
        flagged = panel.grid(cells)
        large = _large(panel, flagged)
        scraps[flag] = int((flagged & ~large).sum())
        look = {"facecolor": "none", "edgecolor": "0.2", "hatch": hatch}
        if flag is not None and flag in VALUELESS:
            look["facecolor"] = NO_VALUE
            if large.any():
                _draw_cells(sheet, panel, flag, large, None, _UNSTABLE + 0.1, look)
            continue
        for side, region in sides:
            if (large & side).any():
                _draw_cells(
                    sheet, panel, flag, regions.continued(large, side), region, _HATCHES, look
                )
    return +scraps


def _draw_cells(
    sheet: Sheet,
    panel: Panel,
    flag: Validity | None,
    cells: Cells,
    region: Path | None,
    zorder: float,
    look: Look,
) -> None:
    """Hatch cells, within a region if it is not None, and add a legend entry."""
    area = regions.paint(panel, *regions.steps(panel, cells), zorder, look)
    area.set_gid(style.UNSOUND if flag is None else style.flag_name(flag))
    regions.clip(panel, area, region)
    sheet.legend[_words(flag)] = regions.legend_patch(panel, look)


def _fill(sheet: Sheet, panel: Panel, margin: Any, zorder: float, text: str, look: Look) -> Any:
    """Fill the region in which a margin is above zero, and add a legend entry.

    The margin has a value at each cell, or is masked.
    """
    there = ~np.ma.getmaskarray(margin)
    margin = regions.continued(np.ma.getdata(margin), there)
    area = regions.paint(panel, panel.xs, panel.ys, margin, zorder, look)
    area.set_gid(text)
    sheet.legend[text] = regions.legend_patch(panel, look)
    return area


def _large(panel: Panel, cells: Cells) -> Cells:
    """Return the cells of regions large enough to hatch: 0.09 inches in width and height."""
    window = panel.axes.bbox.transformed(panel.axes.figure.dpi_scale_trans.inverted())
    least = np.ceil(0.09 * np.array(cells.shape) / (window.height, window.width))
    high, wide = np.maximum(1, least).astype(int)
    # a region at the frame may continue beyond it
    around = np.pad(cells, [(high, high), (wide, wide)], "edge")
    inner = ndimage.binary_opening(around, np.ones((high, wide)))[high:-high, wide:-wide]
    return np.asarray(ndimage.binary_propagation(inner, np.ones((3, 3)), mask=cells))
