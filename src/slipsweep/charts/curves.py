"""Curves of a result over one axis of a slice.

There is a curve for each value of another axis, or for each option of the model.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slipsweep.charts import equations, style
from slipsweep.charts.sheet import Panel, Sheet, curve_looks, log_axis, log_ticks, plot_curve
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Look
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Mendez, Model, Newmark
from slipsweep.model.units import in_mm
from slipsweep.model.variables import CAUTIONS, STRENGTHS, has_signed_displacements
from slipsweep.studies.boundaries import has_flags
from slipsweep.studies.cautions import reliable
from slipsweep.studies.solved_again import (
    DISPLACEMENT,
    DRIVES,
    is_newmark,
    is_recorded,
    solve_again,
)

Curve = tuple[style.Floats, style.Floats]

_NEWMARK: Look = {"color": "0.5", "linewidth": 0.8, "zorder": 1.8}
_JUMP: Look = {"linestyle": ":", "linewidth": 1.0, "zorder": 1.9}
_CAUTION: Look = {
    "color": "0.8",
    "linewidth": 7,
    "markersize": 14,
    "solid_capstyle": "butt",
    "zorder": 1.5,
}
_UNSOUND: Look = _CAUTION | {"color": "0.55", "linestyle": (0, (0.15, 0.35)), "zorder": 1.6}

#: Options that `spread` compares, and their looks: ends of sliding, and values of the friction
#: decay (the paper measured 2.30 and 2.70, Table 2) with the parameters that give them.
_ENDS: dict[Any, tuple[str, Look]] = {
    "eq12": ("Eq. 12", {"color": style.BLUE, "markerfacecolor": style.BLUE}),
    "integrate": ("integration", {"color": style.VERMILION, "markerfacecolor": "white"}),
}
_DECAYS: dict[str, tuple[dict[str, Any], Look]] = {
    "λ by Eq. 6": ({"decay_rate": None}, {"linestyle": (0, (7, 2)), "marker": "o"}),
    "λ = 2": (
        {"decay_rate": 2.0, "minimum_friction": None},
        {"linestyle": (0, (3, 1.5)), "marker": "s"},
    ),
    "λ = 3": (
        {"decay_rate": 3.0, "minimum_friction": None},
        {"linestyle": (0, (7, 2, 1.5, 2)), "marker": "^"},
    ),
}


def families(result: Result, options: style.Options) -> Figure:
    """Draw a result over one axis, a curve for each value of another.

    Displacements have those of Newmark's block beside them.
    """
    first = ("frequency", "yield_coefficient", "mu_s", "theta", *result.wide)
    sheet = result.sheet(options, result.compared(options.variable), DRIVES, curves=first)
    return _drawn(sheet, options.variable)


def curve(result: Result, options: style.Options) -> Figure:
    """Draw a result over one axis, a displacement with that of Newmark's block."""
    first = (*DRIVES, "yield_coefficient", "frequency")
    return _drawn(result.sheet(options, result.compared(options.variable), first), options.variable)


def motions(result: Result, options: style.Options) -> Figure:
    """Draw displacements under one record over one axis, a curve for each value of another."""
    first = (*STRENGTHS, "yield_acceleration", "yield_coefficient")
    others = [dim for dim in result.wide if dim != "polarity"]
    sheet = result.sheet(options, result.compared(DISPLACEMENT), first, curves=others)
    return _drawn(sheet, DISPLACEMENT)


def dimensionless(result: Result, options: style.Options) -> Figure:
    """Draw uω²/A over A/Üy, which does not depend on the frequency."""
    if options.x not in (None, *DRIVES):
        raise InputError(
            f"{result.name}: --x {options.x}: the dimensionless chart is drawn over A / Üy"
        )
    drive = next((dim for dim in reversed(DRIVES) if dim in result.wide), None)
    if drive is None:
        raise InputError(
            f"{result.name}: the dimensionless chart needs an amplitude of two values or more"
        )
    first = ("mu_s", "theta", "yield_acceleration", "yield_coefficient")
    names = result.compared(DISPLACEMENT)
    sheet = result.sheet(replace(options, x=None), names, drive, curves=first, same=["frequency"])
    return _drawn(sheet, DISPLACEMENT, scaled=True)


def _drawn(sheet: Sheet, name: str, scaled: bool = False) -> Figure:
    """Draw the curves of a result; if `scaled`, as uω²/A over A/Üy."""
    factor: Any = in_mm(1.0) if style.unit(name) == "m" else 1.0
    units, least = ("mm", 1.0) if factor > 1 else (sheet.options.unit(name), None)
    label = f"{style.result_text(sheet.data.attrs, name)} ({units})".removesuffix(" ()")
    sheet.show(name, "Barred curves")
    if scaled:
        symbol = style.displacement_symbol(sheet.data.attrs)
        label = f"permanent displacement, {symbol}\u00a0ω²\u00a0/\u00a0A"
        least = 1e-4
        factor = (2 * np.pi * sheet.data["frequency"]) ** 2 / sheet.data["amplitude"]
        sheet.data["over_yield"] = sheet.data["amplitude"] / sheet.data["yield_line"]
    for drawn in {"drawn", "newmark"} & {*sheet.data}:
        sheet.data[drawn] = sheet.data[drawn] * factor
    # the paper's axis of A/Üy begins at the yield acceleration
    values = sheet.data["drawn"].where(sheet.data["over_yield"] > 1 if scaled else True).values
    for panel in sheet.panels:
        log_axis(panel.axes, values, label, least)
        curves = _curves(panel, panel.data["drawn"])
        looks = (
            curve_looks(len(curves))
            if panel.y
            else [{"color": style.BLUE, "linestyle": "-", "marker": ""}]
        )
        for member, (curve, look) in enumerate(zip(curves, looks, strict=True)):
            _draw(sheet, panel, curve, member, len(curves), look)
        _underlay(sheet, panel)
        if "newmark" in sheet.data:
            _draw_newmark(sheet, panel, looks)
        if scaled:
            panel.axes.set(
                xscale="log", xlim=(1.0, None), xlabel="peak ground acceleration over yield, A / Üy"
            )
            log_ticks(panel.axes.xaxis, 10)
            equations.draw_normalised(sheet, panel)
        else:
            _mark_accelerations(sheet, panel)
            equations.draw_over_axis(sheet, panel)
    sheet.note_left_out(name)
    return sheet.done()


def spread(result: Result, options: style.Options) -> Figure:
    """Draw a result, and the range of the results of other options.

    The options are Newmark's block, λ by Eq. 6 or as the paper measured it, and the end of sliding
    by Eq. 12 or by integration.
    """
    if "yield_coefficient" in result.data.coords:
        raise InputError(
            f"{result.name}: the result has ky alone: other options of the model need theta and "
            "mu_s"
        )
    if has_signed_displacements(result.attrs):
        raise InputError(
            f"{result.name}: the block slides both ways: the other options slide downslope only"
        )
    sheet = result.sheet(options, result.compared(DISPLACEMENT), DRIVES)
    # the other options have a mode limit, even if this result has none
    sheet.show(DISPLACEMENT, "Barred, of this result", always=True)
    sheet.data["drawn"] = in_mm(sheet.data["drawn"])
    model_of_result = MODELS.from_attributes(sheet.data.attrs)
    looks = {}
    flags = []
    for text, model, changed, look in _alternatives(model_of_result):
        answer = solve_again(sheet.data, [DISPLACEMENT, "validity"], model, **changed)
        answer = answer.reset_coords(drop=True)
        sheet.data[text] = in_mm(reliable(answer, DISPLACEMENT, options.show_cautions))
        looks[text] = {"linewidth": 1.0, "markersize": 3.5, **look}
        flags.append(answer["validity"])
    text = f"this result:\n{_own_text(model_of_result, sheet.data)}"
    sheet.data[text] = sheet.data["drawn"]
    looks[text] = {"color": "black", "linewidth": 2.4, "zorder": 2.5}
    for panel in sheet.panels:
        log_axis(panel.axes, sheet.data[[*looks]].to_array().values, "permanent displacement (mm)")
        curves = [_curves(panel, panel.data[text])[0] for text in looks]
        xs = curves[0][0]
        each = np.array([ys for _, ys in curves])
        # a zero lies below the logarithmic axis; it is not missing
        low, high = (
            np.maximum(most(each, axis=0), 1e-300) for most in (np.fmin.reduce, np.fmax.reduce)
        )
        area: Look = {"facecolor": "0.92", "linewidth": 0, "zorder": 1, "gid": "spread"}
        sheet.legend["range of these results"] = panel.axes.fill_between(xs, low, high, **area)
        for number, (ys, (text, look)) in enumerate(zip(each, looks.items(), strict=True)):
            sheet.legend[text] = plot_curve(
                panel.axes, xs, ys, number / len(each), label=text, **look
            )
        _underlay(sheet, panel)
        _mark_accelerations(sheet, panel)
    sheet.note_left_out(DISPLACEMENT, *flags)
    sheet.note(
        "All results have the same Üy; λ = 2 to 3 is what the paper measured on its interface."
    )
    return sheet.done()


def _alternatives(model: Model) -> Iterator[tuple[str, Model, dict[str, Any], Look]]:
    """Yield the options beside those of a result.

    Each has its name in the legend, its model, its changed parameters and its look.
    """
    if isinstance(model, Mendez):
        look: Look = {"color": "0.35", "linestyle": "-", "marker": "x"}
        yield style.NEWMARK, Newmark(g=model.g), {}, look
    base = model if isinstance(model, Mendez) else Mendez(g=model.g)
    for (recoupling, (end, colours)), (decay, (changed, dash)) in itertools.product(
        _ENDS.items(), _DECAYS.items()
    ):
        yield (
            f"{decay}, stop by {end}",
            replace(base, recoupling=recoupling),
            changed,
            colours | dash,
        )


def _own_text(model: Model, data: xr.Dataset) -> str:
    """Return the options of a result in words."""
    if not isinstance(model, Mendez):
        return style.NEWMARK
    decay_rate = data.coords.get("decay_rate")
    decay = (
        "λ by Eq. 6"
        if decay_rate is None
        else f"λ = {decay_rate.item():.3g}"
        if decay_rate.size == 1
        else "λ as given"
    )
    return f"{decay}, stop by {_ENDS[model.recoupling][0]}"


def _curves(panel: Panel, array: xr.DataArray, gaps: bool = True) -> list[Curve]:
    """Return the curves of a panel, with `gaps` where they pass the mode limit."""
    rows = panel.grid(array)
    abscissae = panel.grid("over_yield") if "over_yield" in panel.data else [panel.xs] * len(rows)
    curves = list(zip(abscissae, rows, strict=True))
    if "limit_line" not in panel.data or not gaps:
        return curves
    beyond = panel.grid("amplitude") > panel.grid("limit_line")
    jumps = [np.flatnonzero(row[1:] != row[:-1]) + 1 for row in beyond]
    return [
        (np.insert(xs, at, xs[at]), np.insert(ys, at, np.nan))
        for (xs, ys), at in zip(curves, jumps, strict=True)
    ]


def _draw(sheet: Sheet, panel: Panel, curve: Curve, member: int, members: int, look: Look) -> None:
    """Draw a curve of a family, its jumps as dotted lines."""
    xs, ys = curve
    text = panel.member(member) or (style.NEWMARK if is_newmark(panel.data) else "this result")
    sheet.legend[text] = plot_curve(panel.axes, xs, ys, member / members, label=text, **look)
    for at in np.flatnonzero(np.isnan(ys[1:-1]) & (xs[1:-1] == xs[2:])) + 1:
        ends = [at - 1, at + 1]
        if (ys[ends] > 0).all():
            panel.axes.plot(xs[ends], ys[ends], color=look["color"], gid="jump", **_JUMP)
            sheet.remarks["jump at the mode limit"] = Line2D([], [], color="0.3", **_JUMP)


def _draw_newmark(sheet: Sheet, panel: Panel, looks: list[Look]) -> None:
    """Draw Newmark's curves: thin, with the dashes of a family; dashed where there is one curve."""
    single: Look = {"linestyle": (0, (5, 2)), "linewidth": 1.4, "color": "0.3"}
    for (xs, ys), look in zip(
        _curves(panel, panel.data["newmark"], gaps=False), looks, strict=True
    ):
        newmark_look = _NEWMARK | ({"linestyle": look["linestyle"]} if panel.y else single)
        panel.axes.plot(xs, np.where(ys > 0, ys, np.nan), gid="newmark", **newmark_look)
    text = f"{style.NEWMARK} (same dash)" if panel.y else style.NEWMARK
    sheet.remarks[text] = Line2D([], [], **_NEWMARK | ({} if panel.y else single))


def _underlay(sheet: Sheet, panel: Panel) -> None:
    """Put a broad grey line under values with a caution, a barred one under unsound values."""
    drawn = panel.data["drawn"]
    flagged = (drawn > 0) & has_flags(panel.data["validity"], CAUTIONS)
    seen = sheet.data["validity"].where(sheet.data["drawn"] > 0)
    words = [style.FLAG_TEXT[flag] for flag in CAUTIONS if has_flags(seen, flag).any()]
    marks = [("caution", "\n".join(words), _CAUTION, flagged)]
    if "unsound" in panel.data:
        text = style.UNSOUND if "newmark" in panel.data else "falls with A"
        marks.append(("unsound", text, _UNSOUND, panel.data["unsound"]))
    for gid, text, look, cells in marks:
        for xs, ys in _curves(panel, drawn.where(cells)):
            plot_curve(panel.axes, xs, ys, gid=gid, **look)
        if cells.any():
            sheet.remarks[text] = Line2D([], [], **look)


def _mark_accelerations(sheet: Sheet, panel: Panel) -> None:
    """Draw vertical lines at the thresholds that all curves of a panel share."""
    (low, high) = panel.axes.get_xlim()
    data = panel.data
    if (
        panel.x in ("yield_coefficient", "yield_acceleration")
        and "amplitude" in data
        and not is_recorded(data)
    ):
        scale = (
            1 / panel.g if panel.x == "yield_coefficient" else panel.options.scale(panel.x, panel.g)
        )
        place = data["amplitude"].values.max() * scale
        if low < place < high and data["amplitude"].size == 1:
            look: Look = {"facecolor": "none", "edgecolor": "0.7", "hatch": ".."}
            panel.axes.axvspan(place, high, linewidth=0, zorder=0.5, **look)
            sheet.remarks[f"{style.NO_SLIDING}: Üy above A"] = Patch(**look)
    for name, (text, look) in style.LINES.items() if panel.x == "amplitude" else ():
        if name in data and data[name].size == 1:
            place = data[name].item() * panel.options.scale("amplitude", panel.g)
            if low <= place <= high:
                sheet.remarks[text] = panel.axes.axvline(
                    place, gid=name, **{**look, "linewidth": 1.0, "zorder": 1.7}
                )
