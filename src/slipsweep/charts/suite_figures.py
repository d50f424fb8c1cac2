"""Charts of recorded motions: a curve for each, with the suite's median and band; scatter; histogram; fragility."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from slipsweep.charts import uncertainty_figures
from slipsweep.charts.sheet import (
    Panel,
    Sheet,
    broadcast,
    check_positive,
    curve_looks,
    log_axis,
    log_axis_of,
    log_ticks,
    plot_curve,
    validity_has,
)  # fmt: skip
from slipsweep.charts.style import BLUE, VERMILION, unit_text
from slipsweep.model.variables import CAUTIONS, INTENSITY_MEASURES, Validity
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

_THIN: dict[str, Any] = {"color": "0.5", "linewidth": 0.7, "zorder": 1.8}
_BAND: dict[str, Any] = {"facecolor": "#BBD7EA", "linewidth": 0, "zorder": 1.0}
_EDGE: dict[str, Any] = {"color": BLUE, "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.2}
_MEDIAN: dict[str, Any] = {"color": BLUE, "linewidth": 2.4, "zorder": 2.3}
_NEWMARK: dict[str, Any] = {"color": "black", "linewidth": 1.2, "linestyle": ":", "zorder": 2.4}
_BARS: dict[str, Any] = {"facecolor": "0.8", "edgecolor": "black", "linewidth": 0.8}


# --------------------------------------------------------------------------------- the charts


def motions(sheet: Sheet) -> Figure:
    """Draw displacements over one axis: a thin line for each motion, the suite's median and its 16 to 84 % band.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over its abscissa and `SUITE` that holds `permanent_displacement` and `validity`; the median of
        Newmark's block is drawn where it holds `newmark_displacement`.
    """
    values = _millimetres(sheet.table)
    check_positive("permanent displacement", values)
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        floor = log_axis_of(panel.axes, values, _LEAST)
        panel.axes.set_ylabel("permanent displacement (mm)")
        statistics = _statistics(panel.table)
        lines = _each(panel) * 1000.0
        band = broadcast(statistics["displacement_quantile"], statistics, ("quantile", panel.x)) * 1000.0
        draw_suite(sheet.legend, panel.axes, panel.values(panel.x), lines, band, floor)
        if "newmark_displacement" in panel.table.data_vars:
            theirs = _statistics(_as_newmark(panel.table))
            median = broadcast(theirs["displacement_quantile"], theirs, ("quantile", panel.x))[1] * 1000.0
            shown = np.where(np.isnan(median), np.nan, np.maximum(median, floor))
            sheet.legend["median, Newmark"] = panel.axes.plot(panel.values(panel.x), shown, gid="newmark", **_NEWMARK)[
                0
            ]
    _note_suite(sheet.notes, sheet.table, "Median and band are of")
    _note_zeros(sheet.notes, sheet.table, "they lie below the logarithmic axis")
    sheet.note_left_out("permanent_displacement")
    _note_cautions(sheet.notes, sheet.table)
    return sheet.finish("outside right upper")


def curves(sheet: Sheet) -> Figure:
    """Draw displacements under one record over one axis, a curve for each value of another.

    Parameters
    ----------
    sheet : Sheet
        Of a slice that holds `permanent_displacement` and `validity`.
    """
    values = np.concatenate([panel.result("permanent_displacement").values.ravel() * 1000.0 for panel in sheet.panels])
    check_positive("permanent displacement", values)
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        log_axis(panel.axes, values, _LEAST)
        panel.axes.set_ylabel("permanent displacement (mm)")
        rows = panel.grid(panel.result("permanent_displacement")) * 1000.0
        for member, (row, look) in enumerate(zip(rows, curve_looks(len(rows)), strict=True)):
            shown, text = np.where(row > 0, row, np.nan), panel.member(member)
            line = plot_curve(panel.axes, panel.values(panel.x), shown, member / len(rows), label=text, **look)
            if text:
                sheet.legend[text] = line
    sheet.note_left_out("permanent_displacement")
    return sheet.finish("outside right upper")


def intensity(sheet: Sheet, measure: str) -> Figure:
    """Draw the displacements under a suite against an intensity measure of its motions as they shake the block.

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
        panel.axes.set_ylabel("permanent displacement (mm)")
        low = panel.axes.get_ylim()[0]
        groups: list[tuple[str, NDArray[np.bool_], dict[str, Any]]] = [
            ("polarity 1" if negative.any() else "a motion", ~negative, {"marker": "o", "color": BLUE}),
            ("polarity −1", negative, {"marker": "s", "color": VERMILION, "markerfacecolor": "white"}),
        ]
        for name, which, look in groups:
            seen = which & (ys >= low)
            if seen.any():
                (sheet.legend[name],) = panel.axes.plot(
                    xs[seen], ys[seen], linestyle="", markersize=5, gid=name, **look
                )
        below = ys < low
        if below.any():
            edge: dict[str, Any] = {"linestyle": "", "marker": "v", "color": "0.4", "markerfacecolor": "none"}
            panel.axes.plot(xs[below], np.full(below.sum(), low * 1.1), gid="below", **edge)
            sheet.legend["zero, or below the axis"] = Line2D([], [], **edge)
    sheet.notes.append(_scaling_text(sheet.table, measure))
    missing = int(np.count_nonzero(~np.isfinite(places)))
    if missing:
        sheet.notes.append(f"{missing} of {places.size} have no {text}: the samples resolve none.")
    _note_suite(sheet.notes, sheet.table, "Drawn are")
    _note_zeros(sheet.notes, sheet.table, "they are marked at the lower edge")
    sheet.note_left_out("permanent_displacement")
    return sheet.finish("outside right upper")


def histogram(sheet: Sheet) -> Figure:
    """Draw how many motions of a suite have which displacement, with the share of zeros.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over `SUITE` that holds `permanent_displacement` and `validity`.
    """
    everything = _millimetres(sheet.table)
    check_positive("permanent displacement", everything)
    slid = everything[everything > 0]
    edges = 10.0 ** np.histogram_bin_edges(np.log10(slid), "sturges")
    # powers of logarithms are rounded: the least and the largest displacement must not lie outside
    edges[0], edges[-1] = min(edges[0], slid.min()), max(edges[-1], slid.max())
    for panel in sheet.panels:
        values = _millimetres(panel.table)
        counts, _ = np.histogram(values[values > 0], edges)
        panel.axes.stairs(counts, edges, fill=True, gid="histogram", **_BARS)
        panel.axes.set_xscale("log")
        log_ticks(panel.axes.xaxis, edges[-1] / edges[0])
        panel.axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        panel.axes.set_xlabel("permanent displacement (mm)")
        panel.axes.set_ylabel("number of motions")
        statistics = _statistics(panel.table)
        low, median, high = statistics["displacement_quantile"].values * 1000.0
        for place, look, text in (
            (median, _MEDIAN, "median"),
            (low, _EDGE, "16 and 84 %"),
            (high, _EDGE, "16 and 84 %"),
        ):
            if place > 0:
                sheet.legend[text] = panel.axes.axvline(place, gid=text, **look)
        panel.axes.margins(y=0.15)
        share = statistics["zero_probability"].item()
        panel.axes.text(0.02, 0.98, f"zero: {share:.0%}", transform=panel.axes.transAxes, va="top", fontsize="small")
    _note_suite(sheet.notes, sheet.table, "Median and 16 to 84 % are of")
    _note_zeros(sheet.notes, sheet.table, "no bar shows them")
    _note_cautions(sheet.notes, sheet.table)
    return sheet.finish("outside right upper")


def fragility(sheet: Sheet, thresholds: tuple[float, ...]) -> Figure:
    """Draw the share of the motions of a suite that exceed a displacement, over one axis.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over its abscissa and `SUITE` that holds `permanent_displacement` and `validity`.
    thresholds : tuple of float
        Displacements to exceed, m, increasing.
    """
    statistics = suite_statistics(sheet.table, thresholds=thresholds, quantiles=QUANTILES)
    drawn = Sheet(statistics, sheet.x, "threshold", sheet.look, sheet.across, sheet.down, sheet.axes)
    _note_suite(drawn.notes, sheet.table, "P is the share of")
    _note_cautions(drawn.notes, sheet.table)
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


def suite_text(sizes: Mapping[Any, int]) -> str:
    """How many motions there are: ``8 motions in 2 polarities``."""
    polarities = f" in {sizes['polarity']} polarities" if sizes.get("polarity", 1) > 1 else ""
    return f"{sizes['motion']} motions{polarities}"


def _statistics(table: xr.Dataset) -> xr.Dataset:
    return suite_statistics(table, thresholds=0.0, quantiles=QUANTILES)


def _as_newmark(table: xr.Dataset) -> xr.Dataset:
    return table.assign(permanent_displacement=table["newmark_displacement"])


def _millimetres(table: xr.Dataset) -> Floats:
    values = table["permanent_displacement"].values.ravel() * 1000.0
    return np.asarray(values[np.isfinite(values)], np.float64)


def _each(panel: Panel) -> Floats:
    """A row for each motion, m: without values that are not to be relied on."""
    drawn = panel.table["permanent_displacement"] if panel.look.show_cautions else panel.result(
        "permanent_displacement"
    )  # fmt: skip
    dims = [dim for dim in SUITE if dim in drawn.dims]
    values = broadcast(drawn, panel.table, (*dims, panel.x))
    return np.asarray(values.reshape(-1, values.shape[-1]), np.float64)


def _scattered(panel: Panel, measure: str) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Intensity as it shakes the block, displacement in mm, and whether the motion is reversed, of all drawn."""
    table, dims = panel.table, ("motion", "polarity")
    power, time_power = SCALING[measure]
    factor = broadcast(table["scale" if "scale" in table else "motion_factor"], table, dims)
    time = broadcast(table["time_scale"], table, dims) if "time_scale" in table else 1.0
    xs = broadcast(table[f"motion_{measure}"], table, dims) * np.abs(factor) ** power * time**time_power
    ys = broadcast(panel.result("permanent_displacement"), table, dims) * 1000.0
    turned = broadcast(table["polarity"], table, dims) < 0
    xs, ys, turned = (np.asarray(one).ravel() for one in np.broadcast_arrays(xs, ys, turned))
    there = np.isfinite(ys)
    return xs[there], ys[there], turned[there]


def _scaling_text(table: xr.Dataset, measure: str) -> str:
    power, time_power = SCALING[measure]
    times = {1: "the motion's factor", 2: "the square of the motion's factor"}.get(power)
    stretched = "time_scale" in table and np.any(table["time_scale"].values != 1.0) and time_power
    longer = {1: "the time scale", 2: "the square of the time scale"}[time_power] if stretched else None
    by = " and ".join(filter(None, (times, longer)))
    if stretched and measure == "mean_period":
        by += ", of frequencies from 0.25 to 20 Hz as recorded"
    return f"Abscissa: as recorded, times {by}." if by else "Abscissa: as recorded; no factor changes it."


def _note_suite(notes: list[str], table: xr.Dataset, what: str) -> None:
    """How many motions there are, and how many of them have no value, and why."""
    statistics = _statistics(table)
    text = f"{what} {suite_text(table['permanent_displacement'].sizes)}"
    total = int(statistics["value_count"].values.flat[0] + statistics["valueless_count"].values.flat[0])
    most = int(statistics["valueless_count"].values.max())
    if most:
        bits, counts = statistics["flag"].values, statistics["valueless_flag_count"].values
        reasons = counts.reshape(-1, bits.size).max(axis=0)
        why = [f"{_name(int(bit))} {count}" for bit, count in zip(bits, reasons, strict=True) if count]
        at = "" if statistics["valueless_count"].values.size == 1 else "up to "
        notes.append(f"{text}; {at}{most} of {total} have no value and are left out ({', '.join(why)}).")
    else:
        notes.append(f"{text}; all have a value.")


def _note_zeros(notes: list[str], table: xr.Dataset, where: str) -> None:
    """How many displacements are zero, and where they are."""
    statistics = _statistics(table)
    counts = statistics["value_count"].values
    zeros = np.nan_to_num(statistics["zero_probability"].values) * counts
    if zeros.max() > 0:
        at = np.unravel_index(np.argmax(zeros), zeros.shape)
        up_to = "" if zeros.size == 1 else "up to "
        notes.append(f"Zero displacement: {up_to}{round(zeros[at])} of {counts[at]}; {where}.")


def _note_cautions(notes: list[str], table: xr.Dataset) -> None:
    """Which cautions the statistics have in them."""
    validity = table["validity"]
    texts = []
    for flag in CAUTIONS:
        share = float(validity_has(validity, flag).values.mean())
        if share:
            texts.append(f"{_name(flag)} {100.0 * share:.2g} %")
    if texts:
        notes.append(f"Statistics are of all values, also those with a caution: {', '.join(texts)}.")


def _name(flag: int) -> str:
    return (Validity(flag).name or "").lower()
