"""Charts of limit amplitudes, required strengths and annual rates of a displacement."""

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from slipsweep.charts import equations, style
from slipsweep.charts.regions import Cells
from slipsweep.charts.sheet import (
    Drawing,
    Panel,
    Sheet,
    curve_looks,
    log_ticks,
    member_text,
    plot_curve,
)
from slipsweep.charts.slices import NAMED, Result
from slipsweep.charts.style import Floats, Look, Options
from slipsweep.charts.suites import draw_suite, suite_text
from slipsweep.errors import InputError
from slipsweep.files.selection import axis_labels
from slipsweep.model.units import in_mm
from slipsweep.model.variables import STRENGTHS, LimitStatus, StrengthStatus
from slipsweep.published import EQUATIONS
from slipsweep.studies.suite_statistics import SUITE, limit_quantiles

#: Most curves of annual rates, one for each grid point.
_MOST_CURVES = 8

#: Most displacements that are marked without being requested.
_MOST_MARKS = 20


def limit(result: Result, options: Options) -> Figure:
    """Draw limit amplitudes, in g, over one axis.

    There is a curve for each value of another axis, or the motions of a suite (`draw_suite`).
    """
    suite = SUITE if "motion" in result.dims else ()
    single = suite and not {*result.wide} - {*SUITE, *options.at}  # nothing varies but the motion
    along = "motion" if single else ("frequency", "mu_s", "theta", "displacement")
    curves = None if suite else ("theta", "displacement", "mu_s", "case")
    names = ["limit_amplitude", "limit_status"]
    shown = replace(options, more_panels=True)
    sheet = result.sheet(shown, names, along, curves=curves, keep=suite)
    for panel in sheet.panels:
        panel.axes.grid(color="0.9", which="both")
        panel.axes.set_ylabel("limit amplitude A / g")
        (_draw_motions if suite else _draw_curves)(sheet, panel)
        if sheet.x in NAMED:
            labels = [style.plain(name) for name in axis_labels(sheet.data, sheet.x)]
            panel.axes.set_xticks(panel.xs, labels, rotation=40, ha="right")
            panel.axes.set_xlabel(sheet.x)
    # one scale for all, from zero; it is set last, because it ends the autoscaling
    sheet.panels[0].axes.set_ylim(bottom=0.0)
    if not np.isfinite(sheet.data["limit_amplitude"]).any():
        sheet.note("No limits to draw: limit_status has the reasons.")
    if suite:
        sheet.note(_suite_text(sheet.data))
    return sheet.done()


def _draw_curves(sheet: Sheet, panel: Panel) -> None:
    """Draw a family of curves, with circles where a discontinuity of the model sets the limit."""
    xs = panel.xs
    limits = panel.grid("limit_amplitude") / panel.g
    states = panel.grid("limit_status")
    _draw_family(sheet, panel, limits)
    circle: Look = {
        "linestyle": "none",
        "marker": "o",
        "markersize": 9,
        "color": "0.82",
        "zorder": 1.5,
    }
    for member in range(len(limits)):
        abrupt = (states[member] >= LimitStatus.AT_MODE_JUMP) & (
            states[member] <= LimitStatus.AFTER_GAP
        )
        if abrupt.any():
            (marks,) = panel.axes.plot(xs[abrupt], limits[member][abrupt], **circle)
            sheet.remarks["set by a discontinuity\nof the model"] = marks


def _draw_family(sheet: Sheet, panel: Panel, values: Floats) -> None:
    """Draw a curve for each row of values, and name it if there are several."""
    for member, look in enumerate(curve_looks(len(values))):
        line = plot_curve(panel.axes, panel.xs, values[member], member / len(values), **look)
        if panel.y:
            sheet.legend[panel.member(member)] = line


def _draw_motions(sheet: Sheet, panel: Panel) -> None:
    """Draw the limits of the motions of a suite, with their median and band."""
    xs = panel.xs
    limits = panel.data["limit_amplitude"]
    quantiles = (
        limit_quantiles(panel.data)["limit_quantile"].transpose("quantile", ...).values / panel.g
    )
    quantiles[np.isinf(quantiles)] = np.nan
    if panel.x != "motion":
        lines = limits.transpose(*SUITE, panel.x, missing_dims="ignore").values
        draw_suite(sheet, panel.axes, xs, lines / panel.g, quantiles)
        return
    _draw_points(sheet, panel, limits / panel.g, quantiles)


def _draw_points(
    sheet: Sheet, panel: Panel, values: xr.DataArray, quantiles: Floats, band: str = "16 to 84 %"
) -> None:
    """Draw a point for each motion and polarity, and the quantiles across all of them."""
    xs = panel.xs
    ends = np.array([0.5, xs.size + 0.5])
    across = np.repeat(quantiles.reshape(-1, 1), 2, axis=1)
    draw_suite(sheet, panel.axes, ends, np.empty((0, 2)), across, band=band)
    panel.axes.set_xlim(*ends)
    points = values.transpose("motion", ...).values.reshape(xs.size, -1)
    polarities = panel.data["polarity"].values if "polarity" in values.dims else ()
    names = [f"polarity {polarity:g}" for polarity in polarities] or ["a motion"]
    look: Look = {"linestyle": "", "markerfacecolor": "white", "color": "0.2"}
    for name, row, marker in zip(names, points.T, "os", strict=False):
        (sheet.legend[name],) = panel.axes.plot(xs, row, marker=marker, **look)


def strength(result: Result, options: Options) -> Figure:
    """Draw required strengths over one axis, of a suite or of samples with median and band."""
    of = str(result.attrs["required"])
    name = f"required_{of}"
    has_band = f"{name}_quantile" in result.variables
    counts = ("always_within_count", "never_within_count")
    names = [f"{name}_quantile", *counts] if has_band else ["required_status"]
    names += [name] if name in result.variables else []
    suite = [dim for dim in SUITE if dim in result.dims and has_band]
    single = suite and not {*result.wide} - {*SUITE, "quantile", *options.at}
    along = "motion" if single else ("amplitude", *STRENGTHS, "frequency", "theta", "displacement")
    curves = None if has_band else ("displacement", "theta", "amplitude", "case")
    if single:  # the quantiles have no such axis
        names = [name, *names[:-1]]
    keep = [*suite, *(["quantile"] if has_band else [])]
    shown = replace(options, more_panels=True)
    sheet = result.sheet(shown, names, along, curves=curves, keep=keep)
    for panel in sheet.panels:
        panel.axes.grid(color="0.9", which="both")
        panel.axes.set_ylabel(f"required {style.axis_label(of, options)}")
        if not has_band:
            _draw_family(sheet, panel, panel.grid(name))
        else:
            _draw_required(sheet, panel, name)
        if sheet.x in NAMED:
            labels = [style.plain(label) for label in axis_labels(sheet.data, sheet.x)]
            panel.axes.set_xticks(panel.xs, labels, rotation=40, ha="right")
            panel.axes.set_xlabel(sheet.x)
        if options.equations:
            equations.draw_strengths(sheet, panel)
    sheet.panels[0].axes.set_ylim(bottom=0.0)
    sheet.note(_required_text(sheet.data, has_band))
    return sheet.done()


def _draw_required(sheet: Sheet, panel: Panel, name: str) -> None:
    """Draw strengths of motions, if the result has them, with their median and band."""
    quantiles = panel.data[f"{name}_quantile"].transpose("quantile", ...)
    values = quantiles.where(np.isfinite(quantiles)).values
    shares = quantiles["quantile"].values
    middle = np.flatnonzero(shares == 0.5)
    median = values[middle[0]] if middle.size else np.full_like(values[0], np.nan)
    band = f"{100.0 * shares[0]:.3g} to {100.0 * shares[-1]:.3g} %"
    edges = np.stack([values[0], median, values[-1]])
    if panel.x == "motion":
        _draw_points(sheet, panel, panel.data[name], edges, band)
        return
    lines = np.empty((0, panel.xs.size))
    if name in panel.data:
        strengths = panel.data[name]
        lines = strengths.transpose(*SUITE, panel.x, missing_dims="ignore").values
    draw_suite(sheet, panel.axes, panel.xs, lines, edges, band=band)


def _required_text(data: xr.Dataset, has_band: bool) -> str:
    """Return the caption: runs of the band, and how many stay within at any or no strength."""
    texts = []
    if has_band:
        runs = str(data.attrs.get("pooled", ""))
        if "samples" in data.attrs:
            runs = f"{runs} x {data.attrs['samples']} samples".removeprefix(" x ")
        texts.append(f"Median and band: quantiles of the required strength over {runs}.")
        always = int(data["always_within_count"].max())
        never = int(data["never_within_count"].max())
    else:
        status = data["required_status"]
        always = int((status == StrengthStatus.ALWAYS_WITHIN).sum())
        never = int((status == StrengthStatus.NEVER_WITHIN).sum())
    if always:
        texts.append(f"Up to {always} stay within at every strength; they count as the least.")
    if never:
        texts.append(f"Up to {never} stay within at no strength; they count as above all others.")
    if "criterion" in data.attrs:
        texts.append(f"Displacement: {data.attrs['criterion']}.")
    return " ".join(texts)


def _suite_text(data: xr.Dataset) -> str:
    """Return the caption: motions of the median, and those that have no limit."""
    status = data["limit_status"].values
    beyond, invalid = (
        int(np.count_nonzero(status == code))
        for code in (LimitStatus.NOT_REACHED, LimitStatus.INVALID)
    )
    texts = [f"Median and band are of {suite_text(data['limit_amplitude'].sizes)}."]
    if beyond:
        highest = f"{float(data.attrs['maximum_amplitude']) / float(data.attrs['g']):.4g} g"
        texts.append(
            f"{beyond} of {status.size} limits are above {highest}; they count as larger than all "
            "others."
        )
    if invalid:
        texts.append(f"{invalid} of {status.size} have no value and are left out.")
    return " ".join(texts)


def drawn_thresholds(data: xr.Dataset, requested: Floats) -> Floats:
    """Return displacements, m, of a smooth curve of rates, among them those requested."""
    most = max(np.nanmax(data["permanent_displacement"].values), requested[-1])
    least = min([displacement for displacement in requested if displacement > 0.0] + [most]) / 10.0
    return np.union1d(np.geomspace(least, most, 121) if most > 0.0 else [], requested)


def hazard(result: Result, options: Options) -> Figure:
    """Draw the mean annual rate of exceedance over the displacement, a curve for each grid point.

    The displacements of the attribute ``marked``, or all if they are few, have a marker.
    Curves are dotted where more than half of the rate is held above the largest amplitude.
    """
    rates = result.data
    if "equation" in rates.dims:
        labels = [EQUATIONS[str(name)].label for name in rates["equation"].values]
        rates = rates.assign_coords(equation=labels)
    names = _names_of_curves(rates, options)
    thresholds = rates["threshold"].values
    few = thresholds.size <= _MOST_MARKS
    marks = np.isin(thresholds, thresholds if few else rates.attrs.get("marked", []))
    lines = rates["annual_rate"].values.reshape(-1, thresholds.size)
    held = rates["held_rate"].values.reshape(-1, thresholds.size)
    is_held = held > 0.5 * lines
    if not (lines[:, marks if marks.any() else slice(None)] > 0.0).any():
        raise InputError(
            "no motion exceeds any of the given displacements: there is nothing to draw"
        )
    drawing = Drawing(options, 1, 1, (6.4, 4.8))
    panel = drawing.grid[0, 0]
    panel.set(
        xscale="log",
        yscale="log",
        xlabel="permanent displacement d (mm)",
        ylabel=f"mean annual rate of {style.displacement_symbol(rates.attrs)} > d (1/year)",
    )
    panel.grid(color="0.9", which="both")
    xs = in_mm(thresholds)
    for look, name, line, above in zip(curve_looks(len(names)), names, lines, is_held, strict=True):
        rate = np.where((line > 0.0) & (thresholds > 0.0), line, np.nan)
        drawing.legend[name] = _draw_rate(panel, xs, rate, above, marks, look)
    for axis, (low, high) in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
        log_ticks(axis, high / low)
    if len(names) == 1:  # the caption has the grid point
        drawing.legend.clear()
    texts = [
        style.caption(rates, options),
        f"hazard curve: {style.plain(rates.attrs['hazard_curve'])}",
    ]
    if "conditions" in rates.attrs:
        texts.append("Rates are by published equations in place of motions.")
        texts.append(" ".join(str(rates.attrs["conditions"]).splitlines()))
    if few:
        texts.append("Rates are computed at the markers; between them the lines are straight.")
    if is_held.any():
        texts.append(_held_text(rates))
    return drawing.finish(texts)


def _names_of_curves(rates: xr.Dataset, options: Options) -> list[str]:
    """Return the names of the grid points of annual rates (InputError: they are too many)."""
    sizes = rates["annual_rate"].sizes
    grid = {str(dim): size for dim, size in sizes.items() if dim != "threshold"}
    names = []
    for indices in np.ndindex(*grid.values()):
        point = zip(grid, indices, strict=True)
        names.append(", ".join(member_text(rates, dim, index, options) for dim, index in point))
    if len(names) > _MOST_CURVES:
        raise InputError(
            f"{len(names)} grid points: a chart shows {_MOST_CURVES} at most; cut axes with --at "
            "NAME=VALUE"
        )
    return names


def _draw_rate(
    panel: Axes, xs: Floats, rate: Floats, is_held: Cells, marks: Cells, look: Look
) -> Line2D:
    """Draw a curve of annual rates, dotted where they are held; return its sign in the legend."""
    # the dotted line begins where the other one ends
    joined = is_held | np.append(False, is_held[:-1]) | np.append(is_held[1:], False)
    dashed = {"color": look["color"], "linestyle": look["linestyle"]}
    panel.plot(xs, np.where(is_held, np.nan, rate), **dashed)
    panel.plot(xs, np.where(joined, rate, np.nan), color=look["color"], linestyle=":")
    marked = {**look, "linestyle": "none"} if marks.any() else dashed
    (line,) = panel.plot(xs[marks], rate[marks], **marked)
    return line


def _held_text(rates: xr.Dataset) -> str:
    """Return the caption's sentence on rates that come from above the largest amplitude."""
    ends = [float(rates.attrs[f"{name}_range"][-1]) for name in ("amplitude", "hazard_curve")]
    end = "the end of the hazard curve"
    if ends[0] < ends[1]:
        end = "the largest amplitude of the sweep"
    return f"Dotted: more than half of the rate comes from above {end}, where P is held constant."
