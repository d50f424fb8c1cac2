"""Curves: a result over one axis of a slice, a curve for each value of another, or for each option of the model."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slipsweep.charts import solved, style
from slipsweep.charts.sheet import Panel, Sheet, curve_looks, log_axis, log_ticks, plot_curve
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Look
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Mendez, Model, Newmark
from slipsweep.model.variables import CAUTIONS, RESULTS, STRENGTHS

Curve = tuple[style.Floats, style.Floats]

_NEWMARK: Look = {"color": "0.5", "linewidth": 0.8, "zorder": 1.8}
_JUMP: Look = {"linestyle": ":", "linewidth": 1.0, "zorder": 1.9}
_CAUTION: Look = {"color": "0.8", "linewidth": 7, "markersize": 14, "solid_capstyle": "butt", "zorder": 1.5}
_UNSOUND: Look = _CAUTION | {"color": "0.55", "linestyle": (0, (0.15, 0.35)), "zorder": 1.6}

#: What an engineer has to choose from in `spread`, what is given for it, and how it is drawn: the end of sliding, and
#: the friction decay, also as the paper measured it on its shaking table, 2.30 and 2.70 (Table 2).
_ENDS: dict[str, tuple[str, Look]] = {
    "Eq. 12": ("eq12", {"color": style.BLUE, "markerfacecolor": style.BLUE}),
    "integration": ("integrate", {"color": style.VERMILION, "markerfacecolor": "white"}),
}
_DECAYS: dict[str, tuple[dict[str, Any], Look]] = {
    "λ by Eq. 6": ({"decay_rate": None}, {"linestyle": (0, (7, 2)), "marker": "o"}),
    "λ = 2": ({"decay_rate": 2.0, "minimum_friction": None}, {"linestyle": (0, (3, 1.5)), "marker": "s"}),
    "λ = 3": ({"decay_rate": 3.0, "minimum_friction": None}, {"linestyle": (0, (7, 2, 1.5, 2)), "marker": "^"}),
}


def families(result: Result, options: style.Options) -> Figure:
    """Curves of a result over one axis, one for each value of another, with Newmark's of displacements."""
    first = ("frequency", "yield_coefficient", "mu_s", "theta")
    name = result.quantity(options.variable)
    return _drawn(result.sheet(options, result.compared(name), solved.DRIVES, curves=[*first, *result.wide]), name)


def curve(result: Result, options: style.Options) -> Figure:
    """One curve of a result over one axis, with Newmark's of a displacement."""
    name = result.quantity(options.variable)
    first = (*solved.DRIVES, "yield_coefficient", "frequency")
    return _drawn(result.sheet(options, result.compared(name), first), name)


def motions(result: Result, options: style.Options) -> Figure:
    """Displacements under one record over one axis, a curve for each value of another."""
    first = (*STRENGTHS, "yield_acceleration", "yield_coefficient")
    others = [dim for dim in result.wide if dim != "polarity"]
    sheet = result.sheet(options, result.compared(solved.DISPLACEMENT), first, curves=others)
    return _drawn(sheet, solved.DISPLACEMENT)


def dimensionless(result: Result, options: style.Options) -> Figure:
    """uω²/A against A/Üy, which does not depend on the frequency."""
    if options.x not in (None, *solved.DRIVES):
        raise InputError(f"{result.name}: --x {options.x}: the dimensionless chart is drawn over A / Üy")
    drive = next((dim for dim in reversed(solved.DRIVES) if dim in result.wide), None)
    if drive is None:
        raise InputError(f"{result.name}: the dimensionless chart needs an amplitude of two values or more")
    first = ("mu_s", "theta", "yield_acceleration", "yield_coefficient")
    names = result.compared(solved.DISPLACEMENT)
    sheet = result.sheet(replace(options, x=None), names, drive, curves=first, same=["frequency"])
    return _drawn(sheet, solved.DISPLACEMENT, scaled=True)


def _drawn(sheet: Sheet, name: str, scaled: bool = False) -> Figure:
    """Curves of a result, of the displacement with Newmark's; `scaled` as uω²/A over A/Üy."""
    factor: Any = 1000.0 if style.unit(name) == "m" else 1.0
    divisor: Any = 1.0
    units, least = ("mm", 1.0) if factor > 1 else (sheet.options.unit(name), None)
    label = f"{RESULTS[name]['long_name']} ({units})".removesuffix(" ()")
    sheet.show(name, "Barred curves")
    if scaled:
        label, least = "permanent displacement, u\u00a0ω²\u00a0/\u00a0A", 1e-4
        factor, divisor = (2 * math.pi * sheet.data["frequency"]) ** 2, sheet.data["amplitude"]
        sheet.data["over_yield"] = divisor / sheet.data["yield_line"]
    for one in {"drawn", "newmark"} & {*sheet.data}:
        sheet.data[one] = sheet.data[one] * factor / divisor
    every = [_curves(panel, panel.data["drawn"]) for panel in sheet.panels]
    # the paper's axis of A/Üy begins at the yield acceleration
    values = np.concatenate([ys[xs > 1] if scaled else ys for curves in every for xs, ys in curves])
    for panel, curves in zip(sheet.panels, every, strict=True):
        log_axis(panel.axes, values, label, least)
        looks = curve_looks(len(curves)) if panel.y else [{"color": style.BLUE, "linestyle": "-", "marker": ""}]
        for member, (curve, look) in enumerate(zip(curves, looks, strict=True)):
            _draw(sheet, panel, curve, member, len(curves), look)
        _underlay(sheet, panel)
        theirs = _curves(panel, panel.data["newmark"], gaps=False) if "newmark" in sheet.data else []
        for curve, look in zip(theirs, looks, strict=False):
            _draw_newmark(sheet, panel, curve, look)
        if scaled:
            panel.axes.set(xscale="log", xlabel="peak ground acceleration over yield, A / Üy")
            log_ticks(panel.axes.xaxis, 10)
            panel.axes.set_xlim(left=1.0)
        else:
            _mark_accelerations(sheet, panel)
    sheet.note_left_out(name)
    return sheet.done()


def spread(result: Result, options: style.Options) -> Figure:
    """This result, and the range of those of other options: Newmark's block, λ as measured, stop by integration."""
    if "yield_coefficient" in result.data.coords:
        raise InputError(f"{result.name}: the result has ky alone: other options of the model need theta and mu_s")
    sheet = result.sheet(options, result.compared(solved.DISPLACEMENT), solved.DRIVES)
    # the others have a mode limit, whatever this one is
    sheet.show(solved.DISPLACEMENT, "Barred, of this result", always=True)
    sheet.data["drawn"] = sheet.data["drawn"] * 1000.0
    flags: list[xr.DataArray] = []
    answers = [_answers(sheet, panel, flags) for panel in sheet.panels]
    values = np.concatenate([ys for one in answers for (_, ys), _ in one.values()])
    for panel, curves in zip(sheet.panels, answers, strict=True):
        log_axis(panel.axes, values, "permanent displacement (mm)")
        xs = next(xs for (xs, _), _ in curves.values())
        each = np.array([ys for (_, ys), _ in curves.values()])
        # what is zero lies below any logarithmic axis, not nowhere
        low, high = (np.maximum(most(each, axis=0), 1e-300) for most in (np.fmin.reduce, np.fmax.reduce))
        area: Look = {"facecolor": "0.92", "linewidth": 0, "zorder": 1, "gid": "spread"}
        sheet.legend["range of these results"] = panel.axes.fill_between(xs, low, high, **area)
        for number, (text, (curve, look)) in enumerate(curves.items()):
            place = number / len(curves)
            sheet.legend[text] = plot_curve(panel.axes, *_above_zero(curve), place, label=text, **look)
        _underlay(sheet, panel)
        _mark_accelerations(sheet, panel)
    sheet.note_left_out(solved.DISPLACEMENT, *flags)
    sheet.notes.append("All results have the same Üy; λ = 2 to 3 is what the paper measured on its interface.")
    return sheet.done()


def _answers(sheet: Sheet, panel: Panel, flags: list[xr.DataArray]) -> dict[str, tuple[Curve, Look]]:
    """The curves of a spread, mm, over the same abscissae, and their looks, the result's own last; adds to `flags`."""
    data, own = panel.data, MODELS.from_attributes(panel.data.attrs)
    ours = own if isinstance(own, Mendez) else Mendez(g=panel.g)
    newmark: Look = {"color": "0.35", "linestyle": "-", "marker": "x"}
    options: dict[str, tuple[Model, dict[str, Any], Look]] = {style.NEWMARK: (Newmark(g=panel.g), {}, newmark)}
    for (end, (recoupling, colours)), (decay, (changed, dash)) in itertools.product(_ENDS.items(), _DECAYS.items()):
        options[f"{decay}, stop by {end}"] = replace(ours, recoupling=recoupling), changed, colours | dash
    found = {}
    for text, (model, changed, look) in options.items():
        answer = solved.solve(data, [solved.DISPLACEMENT, "validity"], model, **changed)
        flags.append(answer["validity"])
        drawn = solved.reliable(answer, solved.DISPLACEMENT, panel.options.show_cautions) * 1000.0
        found[text] = _curves(panel, drawn)[0], {"linewidth": 1.0, "markersize": 3.5, **look}
    text = style.NEWMARK
    if own is ours:
        given = sheet.data.coords.get("decay_rate")
        decay = "λ by Eq. 6" if given is None else f"λ = {given.item():.3g}" if given.size == 1 else "λ as given"
        text = f"{decay}, stop by {'Eq. 12' if own.options['recoupling'] == 'eq12' else 'integration'}"
    heavy: Look = {"color": "black", "linewidth": 2.4, "zorder": 2.5}
    return {**found, f"this result:\n{text}": (_curves(panel, data["drawn"])[0], heavy)}


def _curves(panel: Panel, array: xr.DataArray, gaps: bool = True) -> list[Curve]:
    """The curves of a panel, with `gaps` where they pass the mode limit."""
    rows = panel.grid(array)
    abscissae = panel.grid("over_yield") if "over_yield" in panel.data else [panel.xs] * len(rows)
    curves = list(zip(abscissae, rows, strict=True))
    if "limit_line" not in panel.data or not gaps:
        return curves
    beyond = panel.grid("amplitude") > panel.grid("limit_line")
    jumps = [np.flatnonzero(one[1:] != one[:-1]) + 1 for one in beyond]
    return [(np.insert(xs, at, xs[at]), np.insert(ys, at, np.nan)) for (xs, ys), at in zip(curves, jumps, strict=True)]


def _above_zero(curve: Curve) -> Curve:
    """What a logarithmic axis can show of a curve."""
    return curve[0], np.where(curve[1] > 0, curve[1], np.nan)


def _draw(sheet: Sheet, panel: Panel, curve: Curve, member: int, members: int, look: Look) -> None:
    """Draw a curve of a family, its jumps as dotted lines."""
    xs, ys = _above_zero(curve)
    text = panel.member(member) or (style.NEWMARK if solved.is_newmark(panel.data) else "this result")
    sheet.legend[text] = plot_curve(panel.axes, xs, ys, member / members, label=text, **look)
    for at in np.flatnonzero(np.isnan(ys[1:-1]) & (xs[1:-1] == xs[2:])) + 1:
        ends = [at - 1, at + 1]
        if np.isfinite(ys[ends]).all():
            panel.axes.plot(xs[ends], ys[ends], color=look["color"], gid="jump", **_JUMP)
            sheet.remarks["jump at the mode limit"] = Line2D([], [], color="0.3", **_JUMP)


def _draw_newmark(sheet: Sheet, panel: Panel, curve: Curve, look: Look) -> None:
    """Draw Newmark's curve: thin, with the dash of its curve of a family; dashed where there is one curve."""
    single: Look = {"linestyle": (0, (5, 2)), "linewidth": 1.4, "color": "0.3"}
    own = _NEWMARK | ({"linestyle": look["linestyle"]} if panel.y else single)
    panel.axes.plot(*_above_zero(curve), gid="newmark", **own)
    text = f"{style.NEWMARK} (same dash)" if panel.y else style.NEWMARK
    sheet.remarks[text] = Line2D([], [], **(_NEWMARK if panel.y else own))


def _underlay(sheet: Sheet, panel: Panel) -> None:
    """Put a broad grey line under what a caution is about, and a barred one under what no block does."""
    drawn = panel.data["drawn"]
    flagged = (drawn > 0) & solved.has_flags(panel.data["validity"], CAUTIONS)
    seen = sheet.data["validity"].where(sheet.data["drawn"] > 0)
    names = [style.flag_name(flag) for flag in CAUTIONS if solved.has_flags(seen, flag).any()]
    marks = [("caution", "caution:\n" + "\n".join(names), _CAUTION, flagged)]
    if "unsound" in panel.data:
        text = style.UNSOUND if "newmark" in panel.data else "falls with A"
        marks.append(("unsound", text, _UNSOUND, panel.data["unsound"]))
    for gid, text, look, cells in marks:
        for xs, ys in _curves(panel, drawn.where(cells)):
            plot_curve(panel.axes, xs, ys, gid=gid, **look)
        if cells.any():
            sheet.remarks[text] = Line2D([], [], **look)


def _mark_accelerations(sheet: Sheet, panel: Panel) -> None:
    """Vertical lines where the amplitude passes a threshold that all curves of a panel share."""
    (low, high), data = panel.axes.get_xlim(), panel.data
    if panel.x in ("yield_coefficient", "yield_acceleration") and "amplitude" in data and not solved.is_recorded(data):
        place = data["amplitude"].values.max() / (panel.g if panel.x == "yield_coefficient" else 1.0)
        place *= panel.options.scale(panel.x, panel.g)
        if low < place < high and data["amplitude"].size == 1:
            look: Look = {"facecolor": "none", "edgecolor": "0.7", "hatch": ".."}
            panel.axes.axvspan(place, high, linewidth=0, zorder=0.5, **look)
            sheet.remarks[f"{style.NO_SLIDING}: Üy above A"] = Patch(**look)
    for name, (text, look) in style.LINES.items() if panel.x == "amplitude" else ():
        if name in data and data[name].size == 1:
            place = data[name].item() * panel.options.scale("amplitude", panel.g)
            if low <= place <= high:
                sheet.remarks[text] = panel.axes.axvline(place, gid=name, **{**look, "linewidth": 1.0, "zorder": 1.7})
