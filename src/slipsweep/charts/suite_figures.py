"""Charts of recorded motions: a curve for each, with the suite's median and band; scatter; histogram; fragility."""

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy import stats

from slipsweep.charts import uncertainty_figures
from slipsweep.charts.sheet import (
    Panel,
    Sheet,
    check_positive,
    curve_looks,
    has_flags,
    log_axis,
    log_ticks,
    over,
    plot_curve,
)
from slipsweep.charts.style import BLUE, NEWMARK, VERMILION, flag_name, unit_text
from slipsweep.model.variables import CAUTIONS, INTENSITY_MEASURES
from slipsweep.studies.suite_statistics import suite_statistics

Floats = NDArray[np.float64]

#: What makes up a suite, of the dimensions that a slice has.
SUITE = ("motion", "polarity")

#: Quantiles that all charts of suites show: the median, and one standard deviation of a normal distribution beside it.
QUANTILES = (0.16, 0.5, 0.84)

#: Powers of the factor and of the time scale that an intensity measure of a motion as recorded grows with.
SCALING = {
    "pga": (1, 0),
    "pgv": (1, 1),
    "pgd": (1, 2),
    "arias_intensity": (2, 1),
    "cav": (1, 1),
    "significant_duration": (0, 1),
    "mean_period": (0, 1),
}

#: Least displacement of a logarithmic axis, mm, where the largest is far above.
_LEAST = 1.0

#: Logarithms of an intensity measure within this are one value: motions scaled to it.
_SAME = 1e-6

_DISPLACEMENT = "permanent_displacement"
_LABEL = "permanent displacement (mm)"

_THIN: dict[str, Any] = {"color": "0.5", "linewidth": 0.7, "zorder": 1.8}
_BAND: dict[str, Any] = {"facecolor": "#BBD7EA", "linewidth": 0, "zorder": 1.0}
_EDGE: dict[str, Any] = {"color": BLUE, "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.2}
_MEDIAN: dict[str, Any] = {"color": BLUE, "linewidth": 2.4, "zorder": 2.3}
_NEWMARK: dict[str, Any] = {"color": "black", "linewidth": 1.2, "linestyle": ":", "zorder": 2.4}
_BARS: dict[str, Any] = {"facecolor": "0.85", "edgecolor": "black", "linewidth": 1.0}


# --------------------------------------------------------------------------------- the charts


def motions(sheet: Sheet) -> Figure:
    """Draw displacements over one axis: a thin line for each motion, the suite's median and its 16 to 84 % band.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over its abscissa and `SUITE` that holds `permanent_displacement` and `validity`; the median of
        Newmark's block is drawn where it holds `newmark_displacement`.
    """
    values = _millimetres(sheet.data)
    check_positive("permanent displacement", values)
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        floor = log_axis(panel.axes, values, _LEAST, zeros=True)
        panel.axes.set_ylabel(_LABEL)
        draw_suite(sheet.legend, panel.axes, panel.values(panel.x), _each(panel) * 1000.0,
                   _band(panel.data, panel.x), floor)  # fmt: skip
        if "newmark_displacement" in panel.data:
            theirs = panel.data.assign({_DISPLACEMENT: panel.data["newmark_displacement"]})
            median = _band(theirs, panel.x)[1]
            shown = np.where(np.isnan(median), np.nan, np.maximum(median, floor))
            line = panel.axes.plot(panel.values(panel.x), shown, gid="newmark", **_NEWMARK)[0]
            sheet.legend[f"median, {NEWMARK}"] = line
    _note_suite(sheet, "Median and band are of")
    _note_zeros(sheet, "they lie below the logarithmic axis")
    sheet.note_left_out(_DISPLACEMENT)
    _note_cautions(sheet)
    return sheet.done()


def curves(sheet: Sheet) -> Figure:
    """Draw displacements under one record over one axis, a curve for each value of another.

    Parameters
    ----------
    sheet : Sheet
        Of a slice that holds `permanent_displacement` and `validity`, and Newmark's displacement if the file has it.
    """
    values = np.concatenate([panel.reliable(_DISPLACEMENT).values.ravel() * 1000.0 for panel in sheet.panels])
    check_positive("permanent displacement", values)
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        log_axis(panel.axes, values, _LEAST)
        panel.axes.set_ylabel(_LABEL)
        rows = panel.grid(panel.reliable(_DISPLACEMENT)) * 1000.0
        for member, (row, look) in enumerate(zip(rows, curve_looks(len(rows)), strict=True)):
            shown, text = np.where(row > 0, row, np.nan), panel.member(member) or "this result"
            line = plot_curve(panel.axes, panel.values(panel.x), shown, member / len(rows), label=text, **look)
            sheet.legend[text] = line
            if "newmark_displacement" in panel.data:
                theirs = panel.grid("newmark_displacement")[member] * 1000.0
                classical = {**_NEWMARK, "color": "0.4", "linestyle": look["linestyle"], "linewidth": 0.8}
                panel.axes.plot(panel.values(panel.x), np.where(theirs > 0, theirs, np.nan), gid="newmark", **classical)
                sheet.remarks[f"{NEWMARK} (same dash)"] = Line2D([], [], **classical)
    sheet.note_left_out(_DISPLACEMENT)
    return sheet.done()


def intensity(sheet: Sheet, measure: str) -> Figure:
    """Draw the displacements under a suite against an intensity measure of its motions as they shake the block.

    A line is the regression of ln u on the logarithm of the measure, of the motions that slide.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over `SUITE` that holds `permanent_displacement`, `validity` and, but where `scale` says how strong
        the motions are, `motion_factor`.
    measure : str
        One of `INTENSITY_MEASURES`.
    """
    drawn = [_scattered(panel, measure) for panel in sheet.panels]
    values = np.concatenate([ys for _, ys, _ in drawn])
    check_positive("permanent displacement", values)
    places = np.concatenate([xs for xs, _, _ in drawn])
    there = places[np.isfinite(places) & (places > 0)]
    wide = there.size > 0 and there.max() > 3 * there.min()
    text = INTENSITY_MEASURES[measure]["long_name"].removesuffix(" as recorded")
    for panel, (xs, ys, negative) in zip(sheet.panels, drawn, strict=True):
        log_axis(panel.axes, values, _LEAST)
        if wide:
            panel.axes.set_xscale("log")
            panel.axes.set_xlim(there.min() / 1.15, there.max() * 1.15)
            log_ticks(panel.axes.xaxis, there.max() / there.min())
        panel.axes.grid(color="0.9", which="major")
        panel.axes.set_axisbelow(True)
        panel.axes.set_xlabel(f"{text} ({unit_text(INTENSITY_MEASURES[measure]['units'])})")
        panel.axes.set_ylabel(_LABEL)
        low = panel.axes.get_ylim()[0]
        groups: list[tuple[str, NDArray[np.bool_], dict[str, Any]]] = [
            ("polarity 1" if negative.any() else "a motion", ~negative, {"marker": "o", "color": BLUE}),
            ("polarity −1", negative, {"marker": "s", "color": VERMILION, "markerfacecolor": "white"}),
        ]
        for name, which, look in groups:
            seen = which & (ys >= low)
            if seen.any():
                sheet.legend[name] = panel.axes.plot(xs[seen], ys[seen], linestyle="", ms=5, gid=name, **look)[0]
        below = ys < low
        if below.any():
            edge: dict[str, Any] = {"linestyle": "", "marker": "v", "color": "0.4", "markerfacecolor": "none"}
            panel.axes.plot(xs[below], np.full(below.sum(), low * 1.1), gid="below", **edge)
            sheet.legend["zero, or below the axis"] = Line2D([], [], **edge)
        _draw_regression(sheet, panel, xs, ys)
    sheet.notes.append("Regression of ln u on the logarithm of the abscissa, of all motions that slide; "
                       "σ: standard deviation of ln u about it.")  # fmt: skip
    sheet.notes.append(_scaling_text(sheet.data, measure))
    missing = int(np.count_nonzero(~np.isfinite(places)))
    if missing:
        sheet.notes.append(f"{missing} of {places.size} have no {text}: the samples resolve none.")
    _note_suite(sheet, "Drawn are")
    _note_zeros(sheet, "they are marked at the lower edge")
    sheet.note_left_out(_DISPLACEMENT)
    return sheet.done()


def _draw_regression(sheet: Sheet, panel: Panel, xs: Floats, ys: Floats) -> None:
    """The line of ln u = a + b ln(measure), its R² and scatter over the panel."""
    slid = (ys > 0) & (xs > 0) & np.isfinite(xs)
    if slid.sum() < 3:
        text = "no regression: fewer than 3 motions slide"
    elif np.ptp(np.log(xs[slid])) < _SAME:
        text = "no regression: one value for all motions"
    else:
        found: Any = stats.linregress(np.log(xs[slid]), np.log(ys[slid]))
        rest = np.log(ys[slid]) - found.intercept - found.slope * np.log(xs[slid])
        scatter = float(np.sqrt(np.sum(rest**2) / (rest.size - 2)))
        ends = np.geomspace(xs[slid].min(), xs[slid].max(), 50)
        line = np.exp(found.intercept) * ends**found.slope
        look: dict[str, Any] = {"color": "0.2", "linewidth": 1.2, "linestyle": (0, (6, 2))}
        sheet.remarks["regression"] = panel.axes.plot(ends, line, gid="regression", **look)[0]
        text = f"slope {found.slope:.2f}, R² = {found.rvalue**2:.2f}, σ = {scatter:.2f}"
    title = panel.axes.get_title()
    panel.axes.set_title(f"{title}\n{text}" if title else text, fontsize="small")


def histogram(sheet: Sheet) -> Figure:
    """Draw how many motions of a suite have which displacement, with the share of zeros.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over `SUITE` that holds `permanent_displacement` and `validity`.
    """
    everything = _millimetres(sheet.data)
    check_positive("permanent displacement", everything)
    slid = everything[everything > 0]
    edges = 10.0 ** np.histogram_bin_edges(np.log10(slid), "sturges")
    # powers of logarithms are rounded: the least and the largest displacement must not lie outside
    edges[0], edges[-1] = min(edges[0], slid.min()), max(edges[-1], slid.max())
    for panel in sheet.panels:
        values = _millimetres(panel.data)
        counts, _ = np.histogram(values[values > 0], edges)
        panel.axes.bar(edges[:-1], counts, np.diff(edges), align="edge", gid="histogram", **_BARS)
        panel.axes.set_xscale("log")
        log_ticks(panel.axes.xaxis, edges[-1] / edges[0])
        panel.axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        panel.axes.set_xlabel(_LABEL)
        panel.axes.set_ylabel("number of motions")
        statistics = _statistics(panel.data)
        low, median, high = statistics["displacement_quantile"].values.ravel() * 1000.0
        for place, look, text in (
            (median, _MEDIAN, "median"), (low, _EDGE, "16 and 84 %"), (high, _EDGE, "16 and 84 %"),
        ):  # fmt: skip
            if place > 0:
                sheet.legend[text] = panel.axes.axvline(place, gid=text, **look)
        share = f"zero displacement: {statistics['zero_probability'].item():.0%}"
        title = panel.axes.get_title()
        panel.axes.set_title(f"{title}\n{share}" if title else share, fontsize="small")
    _note_suite(sheet, "Median and 16 to 84 % are of")
    _note_zeros(sheet, "no bar shows them")
    _note_cautions(sheet)
    return sheet.done()


def fragility(sheet: Sheet, limits: tuple[float, ...]) -> Figure:
    """Draw the share of the motions of a suite that exceed a displacement, over one axis.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over its abscissa and `SUITE` that holds `permanent_displacement` and `validity`.
    limits : tuple of float
        Displacements to exceed, m, increasing.
    """
    statistics = suite_statistics(sheet.data, thresholds=list(limits), quantiles=QUANTILES)
    drawn = Sheet(statistics, sheet.x, "threshold", sheet.look, sheet.across, sheet.down, sheet.axes)
    _note_suite(sheet, "P is the share of")
    _note_cautions(sheet)
    drawn.notes = sheet.notes
    return uncertainty_figures.fragility(drawn)


# ------------------------------------------------------------------------------- what they share


def draw_suite(
    legend: dict[str, Any], axes: Any, xs: Floats, lines: Floats, quantiles: Floats, floor: float | None
) -> None:
    """A thin line for each row of `lines`, and the suite's median and band of `quantiles` (16, 50 and 84 %) over them.

    What is below `floor` is drawn there; that is outside of a logarithmic axis.
    """
    if floor is not None:
        lines, quantiles = (np.where(np.isnan(one), np.nan, np.maximum(one, floor)) for one in (lines, quantiles))
    axes.fill_between(xs, quantiles[0], quantiles[2], gid="band", **_BAND)
    for row in lines:
        plot_curve(axes, xs, row, gid="motion", **_THIN)
    for edge in (quantiles[0], quantiles[2]):
        axes.plot(xs, edge, gid="edge", **_EDGE)
    plot_curve(axes, xs, quantiles[1], gid="median", **_MEDIAN)
    legend["median"] = Line2D([], [], **_MEDIAN)
    legend["16 to 84 %"] = Patch(facecolor=_BAND["facecolor"], edgecolor=BLUE, linestyle="--")
    legend["a motion"] = Line2D([], [], **_THIN)


def suite_text(sizes: Mapping[Hashable, int]) -> str:
    """How many motions there are: ``8 motions in 2 polarities``."""
    polarities = f" in {sizes['polarity']} polarities" if sizes.get("polarity", 1) > 1 else ""
    return f"{sizes['motion']} motions{polarities}"


def _statistics(data: xr.Dataset) -> xr.Dataset:
    return suite_statistics(data, thresholds=0.0, quantiles=QUANTILES)


def _band(data: xr.Dataset, x: str) -> Floats:
    """The suite's quantiles along an axis, mm."""
    found = _statistics(data)
    return np.asarray(over(found["displacement_quantile"], found, ("quantile", x))) * 1000.0


def _millimetres(data: xr.Dataset) -> Floats:
    values = data[_DISPLACEMENT].values.ravel() * 1000.0
    return np.asarray(values[np.isfinite(values)], np.float64)


def _each(panel: Panel) -> Floats:
    """A row for each motion, m: without values that are unreliable, unless they are requested."""
    drawn = panel.data[_DISPLACEMENT] if panel.look.show_cautions else panel.reliable(_DISPLACEMENT)
    values = over(drawn, panel.data, (*(dim for dim in SUITE if dim in drawn.dims), panel.x))
    return np.asarray(values.reshape(-1, values.shape[-1]), np.float64)


def _scattered(panel: Panel, measure: str) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Intensity as it shakes the block, displacement in mm, and whether the motion is reversed, of all drawn."""
    data = panel.data
    power, time_power = SCALING[measure]
    factor = np.abs(data["scale"] if "scale" in data.coords else data["motion_factor"])
    time = data["time_scale"] if "time_scale" in data.coords else 1.0
    xs = data[f"motion_{measure}"] * factor**power * time**time_power
    ys = panel.reliable(_DISPLACEMENT) * 1000.0
    every = xr.broadcast(xs, ys, data["polarity"] < 0)
    xs, ys, reverse = (one.transpose(*every[1].dims).values.ravel() for one in every)  # type: ignore[assignment]
    there = np.isfinite(ys)
    return np.asarray(xs)[there], np.asarray(ys)[there], np.asarray(reverse)[there]


def _scaling_text(data: xr.Dataset, measure: str) -> str:
    power, time_power = SCALING[measure]
    times = {1: "the motion's factor", 2: "the square of the motion's factor"}.get(power)
    stretched = "time_scale" in data.coords and np.any(data["time_scale"].values != 1.0) and time_power
    longer = {1: "the time scale", 2: "the square of the time scale"}[time_power] if stretched else None
    by = " and ".join(filter(None, (times, longer)))
    if stretched and measure == "mean_period":
        by += ", of frequencies from 0.25 to 20 Hz as recorded"
    return f"Abscissa: as recorded, times {by}." if by else "Abscissa: as recorded; no factor changes it."


def _note_suite(sheet: Sheet, what: str) -> None:
    """How many motions there are, and how many of them have no value, and why."""
    statistics = _statistics(sheet.data)
    text = f"{what} {suite_text(sheet.data[_DISPLACEMENT].sizes)}"
    total = int((statistics["value_count"] + statistics["valueless_count"]).max())
    most = int(statistics["valueless_count"].max())
    if not most:
        sheet.notes.append(f"{text}; all have a value.")
        return
    counts = statistics["valueless_flag_count"]
    reasons = counts.max([dim for dim in counts.dims if dim != "flag"])
    why = [f"{flag_name(int(bit))} {int(n)}" for bit, n in zip(counts["flag"].values, reasons.values, strict=True) if n]
    up_to = "" if statistics["valueless_count"].size == 1 else "up to "
    sheet.notes.append(f"{text}; {up_to}{most} of {total} have no value and are left out ({', '.join(why)}).")


def _note_zeros(sheet: Sheet, where: str) -> None:
    """How many displacements are zero, and where they are."""
    statistics = _statistics(sheet.data)
    zeros = (statistics["zero_probability"].fillna(0.0) * statistics["value_count"]).values
    if zeros.max() > 0:
        at = int(np.argmax(zeros))
        up_to = "" if zeros.size == 1 else "up to "
        count = statistics["value_count"].values.flat[at]
        sheet.notes.append(f"Zero displacement: {up_to}{round(zeros.flat[at])} of {count}; {where}.")


def _note_cautions(sheet: Sheet) -> None:
    """Which cautions the statistics have in them."""
    shares = {flag: float(has_flags(sheet.data["validity"], flag).mean()) for flag in CAUTIONS}
    texts = [f"{flag_name(flag)} {100.0 * share:.2g} %" for flag, share in shares.items() if share]
    if texts:
        sheet.notes.append(f"Statistics are of all values, also those with a caution: {', '.join(texts)}.")
