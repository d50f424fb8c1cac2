"""Maps: a result, the sliding mode, or the ratio to Newmark's block over two axes of a slice.

Values are drawn as they are; contours are those of their logarithm, in which u = W/ω² is a straight
line over a logarithmic frequency axis.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import BoundaryNorm, Colormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedFormatter
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from slipsweep.charts import style
from slipsweep.charts.sheet import Panel, Sheet
from slipsweep.charts.slices import Result
from slipsweep.charts.solved import DISPLACEMENT, DRIVES, has_flags, is_newmark
from slipsweep.charts.style import Floats, Look, Options
from slipsweep.errors import InputError
from slipsweep.model.variables import RESULTS, SlidingMode, Validity

Cells = NDArray[np.bool_]

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

#: Share of the steps from cell to cell in which values grow more than tenfold, beyond which a grid
#: is coarse.
_COARSE = 0.1


def contours(result: Result, options: Options) -> Figure:
    """Contours of a result, with the lines of yield and of the mode limit."""
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
    if any((abs(one) > 1.0).sum() > _COARSE * (one != 0.0).sum() for one in growth):
        sheet.note(
            "Coarse grid: values grow more than tenfold from cell to cell; read none between cells."
        )
    of_length = RESULTS[name].get("units") == "m"
    texts = [
        style.length_text(one) if of_length else style.with_unit(f"{one:.3g}", style.unit(name))
        for one in levels
    ]
    # what is below the lowest level, or nothing, is a hundredth of it; what does not slide is
    # covered later
    sheet.data["drawn"] = drawn.clip(min=levels[0] / 100)
    colours = style.COLOURS.resampled(len(levels) + 1)
    end = "min" if drawn.max() < levels[-1] else "both"
    _fill_panels(sheet, colours, levels, texts, RESULTS[name]["long_name"], end)
    return _finish(sheet, name)


def newmark(result: Result, options: Options) -> Figure:
    """The ratio of the permanent displacement to that of Newmark's block."""
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
    # the colour changes at these and at their inverses; the first is as good as one
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
    """The sliding mode of every cell, by colour and hatch."""
    sheet = _sheet(
        result,
        options,
        ["sliding_mode", "validity"],
        ("theta", "yield_coefficient", "mu_s", "frequency"),
    )
    for panel, (mode, (colour, hatch)) in itertools.product(sheet.panels, MODES.items()):
        look = {"facecolor": colour, "edgecolor": "white" if hatch else "0.6", "hatch": hatch}
        _mark(
            sheet, panel, panel.grid("sliding_mode") == int(mode), style.MODE_TEXT[mode], look, 0.5
        )
    return _finish(sheet, "sliding_mode")


def _sheet(result: Result, options: Options, names: list[str], across: Sequence[str]) -> Sheet:
    """The slice of a map of the first of some results, with its axes and the lines of yield and of the mode limit."""
    # with the amplitude given, modes and ratios of displacements do not depend on the frequency
    varies = across[0] == "frequency" or "displacement_amplitude" in result.data.coords
    sheet = result.sheet(options, names, across, y=DRIVES, same=[] if varies else ["frequency"])
    sheet.show(names[0], f"Hatched {UNSOUND_HATCH}")
    for panel, (name, (text, look)) in itertools.product(sheet.panels, style.LINES.items()):
        excess = _excess(panel, name)
        if excess.count() and excess.min() < 0 < excess.max():
            drawing: Look = {f"{key}s": [value] for key, value in look.items()}
            panel.axes.contour(panel.xs, panel.ys, excess, [0.0], **drawing).set_gid(name)
            sheet.remarks[text] = Line2D([], [], **look)
    return sheet


def _excess(panel: Panel, line: str) -> Any:
    """Amplitudes over a threshold, masked where there is none."""
    return np.ma.masked_invalid(
        panel.grid("amplitude") - (panel.grid(line) if line in panel.data else np.nan)
    )


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
        # what contours leave open along the mode limit and cells without a value has the colours of
        # the cells
        cells = np.ma.masked_invalid(logs)
        panel.axes.pcolormesh(xs, ys, cells, shading="nearest", zorder=0.4, rasterized=True, **look)
        beyond = _excess(panel, "limit_line").filled(-1.0) > 0
        for side in (~beyond, beyond):  # no contour crosses the jump
            shown = np.ma.masked_invalid(np.where(side, logs, np.nan))
            if shown.count():
                areas = panel.axes.contourf(xs, ys, shown, places, zorder=0.5, extend=end, **look)
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
    """Label each contour where it is farthest from the frame and from all other lines, if there is space."""
    # inches, that a label takes to each side, and that it needs to the next line
    label_space = 0.28
    line_space = 0.11
    inches = panel.axes.transData + panel.axes.figure.dpi_scale_trans.inverted()
    corners = panel.axes.bbox.transformed(panel.axes.figure.dpi_scale_trans.inverted()).get_points()
    thresholds: list[Any] = [one for one in panel.axes.collections if one.get_gid() in style.LINES]
    segments: list[Any] = [*drawn.allsegs, *(some for one in thresholds for some in one.allsegs)]
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
    """1-3-10 levels that lie in the values; of displacements those that people design for, 1 mm to 1 m."""
    there = values[np.isfinite(values) & (values > 0)]
    if not there.size:
        return []
    low = float(there.min())
    high = float(there.max())
    if name == DISPLACEMENT and low < 1.0 and high > 1e-3:
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
    """Area of no sliding, hatching, legend and caption of a map."""
    scraps: dict[str, int] = {}
    for panel in sheet.panels:
        excess = _excess(panel, "yield_line")
        if name != "sliding_mode" and excess.count() and excess.min() < 0:
            # left white up to the line of yield: no colour of a displacement stands for what does
            # not slide
            if excess.max() > 0:
                levels = [float(excess.min()) - 1.0, 0.0]
                panel.axes.contourf(panel.xs, panel.ys, excess, levels, colors="white", zorder=1.05)
            sheet.legend[style.NO_SLIDING] = Patch(
                facecolor="white", edgecolor="0.6", linewidth=0.6
            )
        hatches = {
            style.flag_name(flag): (has_flags(panel.data["validity"], flag), HATCHES[flag])
            for flag in HATCHES
        }
        if "unsound" in panel.data:
            hatches[style.UNSOUND] = panel.data["unsound"], UNSOUND_HATCH
        for text, (cells, hatch) in hatches.items():
            flagged = panel.grid(cells)
            large = _large(panel, flagged)
            scraps[text] = scraps.get(text, 0) + int((flagged & ~large).sum())
            _mark(
                sheet,
                panel,
                large,
                text,
                {"facecolor": "none", "edgecolor": "0.2", "hatch": hatch},
                1.1,
            )
    small = [
        f"{' '.join(text.split())} ({count} cell{'s' * (count > 1)})"
        for text, count in scraps.items()
        if count
    ]
    if small:
        sheet.note(f"Also, in regions too small to hatch: {'; '.join(small)}.")
    if name != "sliding_mode":
        sheet.note_left_out(name)
    return sheet.done(beside=False)


def _mark(sheet: Sheet, panel: Panel, cells: Cells, label: str, look: Look, zorder: float) -> None:
    """Cover cells, half way to their neighbours, with a colour or hatch, and give the legend an entry."""
    if not cells.any():
        return
    with mpl.rc_context({"hatch.linewidth": 0.6}):
        fill: Look = {"colors": [look["facecolor"]], "hatches": [look["hatch"]], "zorder": zorder}
        area = panel.axes.contourf(panel.xs, panel.ys, cells.astype(float), [0.5, 1.5], **fill)
        area.set(edgecolor=look["edgecolor"], linewidth=0, gid=label)
        sheet.legend[label] = Patch(linewidth=0.6, **look)


def _large(panel: Panel, cells: Cells) -> Cells:
    """The cells of connected regions that 0.09 inches of hatch fit into, each way: less is a scrap of hatch."""
    window = panel.axes.bbox.transformed(panel.axes.figure.dpi_scale_trans.inverted())
    least = np.ceil(0.09 * np.array(cells.shape) / (window.height, window.width))
    high, wide = np.maximum(1, least).astype(int)
    # beyond the frame a region may go on
    around = np.pad(cells, [(high, high), (wide, wide)], "edge")
    inner = ndimage.binary_opening(around, np.ones((high, wide)))[high:-high, wide:-wide]
    return np.asarray(ndimage.binary_propagation(inner, np.ones((3, 3)), mask=cells))
