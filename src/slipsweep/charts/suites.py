"""Charts of a suite of recorded motions: curves with a band, scatter, histogram, fragility."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy  # which loads `stats` when that is first used
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from slipsweep.charts import equations, statistics, style
from slipsweep.charts.sheet import Panel, Sheet, log_axis, log_ticks, plot_curve
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Floats, Look, Options
from slipsweep.errors import InputError
from slipsweep.model.units import in_mm
from slipsweep.model.variables import CAUTIONS, INTENSITY_MEASURES, STRENGTHS
from slipsweep.studies.boundaries import has_flags
from slipsweep.studies.cautions import percent, reliable
from slipsweep.studies.solved_again import DISPLACEMENT
from slipsweep.studies.suite_statistics import SUITE, THRESHOLDS, suite_statistics, without_rounding

#: Powers of the factor and of the time scale that an intensity measure of a motion as recorded
#: grows with.
SCALING = {
    "pga": (1, 0),
    "pgv": (1, 1),
    "pgd": (1, 2),
    "arias_intensity": (2, 1),
    "cav": (1, 1),
    "significant_duration": (0, 1),
    "mean_period": (0, 1),
}

_THIN: Look = {"color": "0.5", "linewidth": 0.7, "zorder": 1.8}
_BAND: Look = {"facecolor": "#BBD7EA", "linewidth": 0, "zorder": 1.0}
_EDGE: Look = {"color": style.BLUE, "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.2}
_MEDIAN: Look = {"color": style.BLUE, "linewidth": 2.4, "zorder": 2.3}
_NEWMARK: Look = {"color": "black", "linewidth": 1.2, "linestyle": ":", "zorder": 2.4}
_POINT: Look = {"marker": "o", "ms": 5, "color": style.BLUE}
_REVERSED: Look = {"marker": "s", "ms": 5, "color": style.VERMILION, "markerfacecolor": "white"}
_BELOW: Look = {"marker": "v", "color": "0.4", "markerfacecolor": "none", "gid": "below"}
_BARS: Look = {"facecolor": "0.85", "edgecolor": "black", "linewidth": 1.0}


def motions(result: Result, options: Options) -> Figure:
    """Draw displacements over one axis, a thin line for each motion.

    Beside them are the median, the band from 16 to 84 %, and the median of Newmark's block.
    """
    sheet = _sheet(result, options)
    sheet.show(DISPLACEMENT, "Not marked")
    if options.show_cautions:  # upslope ones lie below the axis, as zeros do
        sheet.data["drawn"] = sheet.data[DISPLACEMENT]
    for panel in sheet.panels:
        floor = log_axis(panel.axes, _displacements(sheet.data), _label(sheet), zeros=True)
        drawn = panel.data["drawn"].transpose(*SUITE, panel.x, missing_dims="ignore")
        lines = in_mm(drawn.values)
        draw_suite(sheet, panel.axes, panel.xs, lines, _band(panel.data, panel.x), floor)
        if "newmark_displacement" in panel.data:
            of_newmark = panel.data.assign({DISPLACEMENT: panel.data["newmark_displacement"]})
            median = np.maximum(_band(of_newmark, panel.x)[1], floor)
            sheet.legend[f"median, {style.NEWMARK}"] = panel.axes.plot(
                panel.xs, median, gid="newmark", **_NEWMARK
            )[0]
        equations.draw_over_axis(sheet, panel)
    _note_suite(sheet, "Median and band are of", "they lie below the logarithmic axis")
    sheet.note_left_out(DISPLACEMENT)
    _note_cautions(sheet)
    return sheet.done()


def intensity(result: Result, options: Options) -> Figure:
    """Draw the displacement against an intensity measure, and the regression of ln u on it.

    The measure is that of each motion as it shakes the block.
    """
    measures = [name for name in INTENSITY_MEASURES if f"motion_{name}" in result.data.coords]
    measure = options.x or ("arias_intensity" if "pgv" in result.dims else "pgv")
    result.checked(measure, measures, f"--x {measure}: no intensity measure")
    factor = [] if "scale" in result.data.coords else ["motion_factor"]
    sheet = _sheet(result, replace(options, x=None), "motion", factor)
    drawn = [_scattered(panel, measure) for panel in sheet.panels]
    places, displacements, _ = np.concatenate(drawn, axis=1)
    there = places[np.isfinite(places) & (places > 0)]
    wide = there.size > 0 and there.max() > 3 * there.min()
    text = INTENSITY_MEASURES[measure]["long_name"].removesuffix(" as recorded")
    for panel, (xs, ys, polarity) in zip(sheet.panels, drawn, strict=True):
        log_axis(panel.axes, displacements, _label(sheet))
        panel.axes.set(xscale="log" if wide else "linear", xlabel=f"{text} ({style.unit(measure)})")
        if wide:
            log_ticks(panel.axes.xaxis, there.max() / there.min())
        low = panel.axes.get_ylim()[0]
        negative = polarity < 0
        marks: dict[str, tuple[Any, Floats, Look]] = {
            "polarity 1" if negative.any() else "a motion": (~negative & (ys >= low), ys, _POINT),
            "polarity −1": (negative & (ys >= low), ys, _REVERSED),
            "zero, or below the axis": (ys < low, np.full_like(ys, low * 1.1), _BELOW),
        }
        for name, (which, heights, look) in marks.items():
            if which.any():
                point: Look = {"gid": name, "linestyle": "", **look}
                (sheet.legend[name],) = panel.axes.plot(xs[which], heights[which], **point)
        _draw_regression(sheet, panel, xs, ys)
        equations.draw_over_measure(sheet, panel, measure, xs)
    left_out = _sliding_left_out(sheet)
    but = f", but for {left_out} left out" if left_out else ""
    sheet.note(
        f"Regression of ln u on the logarithm of the abscissa, of all motions that slide{but}; "
        "σ: standard deviation of ln u about it.",
        "σ: standard deviation of ln u about the regression.",
    )
    sheet.note(
        "Abscissa: of the motion as it shakes the block, with its factor and time scale.",
        short="",
    )
    if missing := np.count_nonzero(~np.isfinite(places)):
        sheet.note(f"{missing} of {places.size} have no {text}: the samples resolve none.")
    _note_suite(sheet, "Drawn are", "they are marked at the lower edge")
    sheet.note_left_out(DISPLACEMENT)
    return sheet.done()


def histogram(result: Result, options: Options) -> Figure:
    """Draw a histogram of the displacements of a suite, with the share of zeros."""
    sheet = _sheet(result, options, "motion")
    everything = _displacements(sheet.data)
    slid = everything[everything > 0]
    if not slid.size:
        raise InputError(
            f"{result.name}: no motion slides in this slice; choose another slice (--at)"
        )
    edges = 10.0 ** np.histogram_bin_edges(np.log10(slid), "sturges")
    # edges are rounded; the smallest and the largest displacement must lie within them
    edges[0] = min(edges[0], slid.min())
    edges[-1] = max(edges[-1], slid.max())
    for panel in sheet.panels:
        values = _displacements(panel.data)
        axes = panel.axes
        counts, _ = np.histogram(values[values > 0], edges)
        axes.bar(edges[:-1], counts, np.diff(edges), align="edge", gid="histogram", **_BARS)
        axes.set(xscale="log", xlabel=_label(sheet), ylabel="number of motions")
        log_ticks(axes.xaxis, edges[-1] / edges[0])
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        statistics_of_panel = suite_statistics(panel.data)
        low, median, high = in_mm(statistics_of_panel["displacement_quantile"].values.ravel())
        edge = "16 and 84 %"
        for place, look, text in (
            (median, _MEDIAN, "median"),
            (low, _EDGE, edge),
            (high, _EDGE, edge),
        ):
            if place > 0:
                sheet.legend[text] = axes.axvline(place, gid=text, **look)
        panel.add_title(f"zero displacement: {statistics_of_panel['zero_probability'].item():.0%}")
    _note_suite(sheet, "Median and 16 to 84 % are of", "no bar shows them")
    _note_cautions(sheet)
    return sheet.done()


def fragility(result: Result, options: Options) -> Figure:
    """Draw the share of the motions of a suite that exceed a displacement, over one axis."""
    sheet = _sheet(result, options)
    shares = suite_statistics(sheet.data, thresholds=options.heights or THRESHOLDS)
    _note_suite(sheet, "P is the share of")
    _note_cautions(sheet)
    drawn = Sheet(shares, sheet.x, "threshold", options, sheet.along)
    drawn.notes = sheet.notes
    drawn.set_axis("x")
    return statistics.draw_fragility(drawn)


def _sheet(
    result: Result, options: Options, x: str | None = None, more: Sequence[str] = ()
) -> Sheet:
    """Return the sheet of a suite, over `x`, else over the strength of motions or block."""
    axes = [
        dim
        for dim in (*STRENGTHS, "yield_acceleration", "yield_coefficient", *result.wide)
        if dim not in SUITE
    ]
    sheet = result.sheet(options, [*result.compared(DISPLACEMENT), *more], x or axes, keep=SUITE)
    displacement = sheet.data[DISPLACEMENT]
    rounded = without_rounding(sheet.data[DISPLACEMENT])
    sheet.data[DISPLACEMENT] = rounded
    if not rounded.equals(displacement):
        sheet.note("Displacements below 10⁻¹² m count as zero.")
    return sheet


def draw_suite(
    sheet: Sheet,
    axes: Axes,
    xs: Floats,
    lines: Floats,
    quantiles: Floats,
    floor: float = 0.0,
    band: str = "16 to 84 %",
) -> None:
    """Draw a thin line for each motion of `lines`, and a band with median, none below `floor`.

    `quantiles` are the lower end of the band, the median and the upper end.
    """
    lines = np.maximum(lines, floor).reshape(-1, xs.size)
    quantiles = np.maximum(quantiles, floor)
    axes.fill_between(xs, quantiles[0], quantiles[2], gid="band", **_BAND)
    for row in lines:
        plot_curve(axes, xs, row, gid="motion", **_THIN)
    for edge in (quantiles[0], quantiles[2]):
        axes.plot(xs, edge, gid="edge", **_EDGE)
    plot_curve(axes, xs, quantiles[1], gid="median", **_MEDIAN)
    sheet.legend["median"] = Line2D([], [], **_MEDIAN)
    sheet.legend[band] = Patch(facecolor=_BAND["facecolor"], edgecolor=style.BLUE, linestyle="--")
    if len(lines):
        sheet.legend["a motion"] = Line2D([], [], **_THIN)


def suite_text(sizes: Mapping[Hashable, int]) -> str:
    """Return the number of motions in words: ``8 motions in 2 polarities``."""
    polarities = f" in {sizes['polarity']} polarities" if sizes.get("polarity", 1) > 1 else ""
    return f"{sizes['motion']} motions{polarities}"


def _band(data: xr.Dataset, x: str) -> Floats:
    """Return the suite's quantiles along an axis, mm."""
    quantiles = suite_statistics(data)["displacement_quantile"].transpose("quantile", x)
    return np.asarray(in_mm(quantiles))


def _label(sheet: Sheet) -> str:
    """Return the label of an axis of displacements."""
    return f"{style.displacement_text(sheet.data.attrs)} (mm)"


def _displacements(data: xr.Dataset) -> Floats:
    """Return all displacements that have a value, mm."""
    values = in_mm(data[DISPLACEMENT].values.ravel())
    return np.asarray(values[np.isfinite(values)], np.float64)


def _scattered(panel: Panel, measure: str) -> Floats:
    """Return rows of intensity, displacement (mm) and polarity of all motions that are drawn.

    The intensity is that of the motion as it shakes the block.
    """
    data = panel.data
    power, time_power = SCALING[measure]
    factor = np.abs(data["scale"] if "scale" in data.coords else data["motion_factor"])
    time = data["time_scale"] if "time_scale" in data.coords else 1.0
    xs = data[f"motion_{measure}"] * factor**power * time**time_power
    ys = in_mm(reliable(data, DISPLACEMENT, panel.options.show_cautions))
    every = np.array([array.values.ravel() for array in xr.broadcast(xs, ys, data["polarity"])])
    return every[:, np.isfinite(every[1])]


def _sliding_left_out(sheet: Sheet) -> int:
    """Return the number of motions that slide and are not drawn, as they are unreliable."""
    moved = sheet.data[DISPLACEMENT]
    drawn = reliable(sheet.data, DISPLACEMENT, sheet.options.show_cautions)
    return int((moved.notnull() & (moved != 0.0) & drawn.isnull()).sum())


def _draw_regression(sheet: Sheet, panel: Panel, xs: Floats, ys: Floats) -> None:
    """Draw the line ln u = a + b ln(measure), with R² and scatter above the panel."""
    slid = (ys > 0) & (xs > 0) & np.isfinite(xs)
    if slid.sum() < 3:
        panel.add_title("no regression: fewer than 3 motions slide")
    elif np.ptp(np.log(xs[slid])) < 1e-6:  # motions scaled to it
        panel.add_title("no regression: one value for all motions")
    else:
        fit: Any = scipy.stats.linregress(np.log(xs[slid]), np.log(ys[slid]))
        scatter = fit.stderr * np.std(np.log(xs[slid])) * np.sqrt(slid.sum())
        ends = np.geomspace(xs[slid].min(), xs[slid].max(), 50)
        line = np.exp(fit.intercept) * ends**fit.slope
        look: Look = {"color": "0.2", "linewidth": 1.2, "linestyle": (0, (6, 2))}
        sheet.remarks["regression"] = panel.axes.plot(ends, line, gid="regression", **look)[0]
        panel.add_title(f"slope {fit.slope:.2f}, R² = {fit.rvalue**2:.2f}, σ = {scatter:.2f}")


def _note_suite(sheet: Sheet, what: str, zeros_are: str = "") -> None:
    """Add to the caption the numbers of motions, of those without a value, and of zeros."""
    counts = suite_statistics(sheet.data)
    missing = counts["valueless_count"]
    reasons = counts["valueless_flag_count"]
    total = int((counts["value_count"] + missing).max())
    most = int(missing.max())
    up_to = "" if missing.size == 1 else "up to "
    flags = zip(reasons["flag"].values, reasons.max(missing.dims).values, strict=True)
    why = ", ".join(f"{style.flag_name(int(bit))} {int(n)}" for bit, n in flags if n)
    left = (
        f"{up_to}{most} of {total} have no value and are left out ({why})"
        if most
        else "all have a value"
    )
    sheet.note(f"{what} {suite_text(sheet.data[DISPLACEMENT].sizes)}; {left}.")
    zeros = (counts["zero_probability"].fillna(0.0) * counts["value_count"]).values
    if zeros_are and zeros.max() > 0:
        count = counts["value_count"].values.flat[np.argmax(zeros)]
        shown = f"Zero displacement: {up_to}{round(zeros.max())} of {count}"
        sheet.note(f"{shown}; {zeros_are}.", f"{shown}.")


def _note_cautions(sheet: Sheet) -> None:
    """Add to the caption the cautions on values in the statistics."""
    shares = {flag: float(has_flags(sheet.data["validity"], flag).mean()) for flag in CAUTIONS}
    seen = {flag: percent(share) for flag, share in shares.items() if share}
    if seen:
        names = ", ".join(f"{style.flag_name(flag)} {share}" for flag, share in seen.items())
        words = ", ".join(f"{style.FLAG_TEXT[flag]} {share}" for flag, share in seen.items())
        sheet.note(
            f"Statistics are of all values, also those with a caution: {names}.",
            f"With a caution: {words}.",
        )
