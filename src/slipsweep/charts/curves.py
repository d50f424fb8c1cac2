"""Curves: a result over one axis of a slice, a curve for each value of another, or for each option of the model."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from slipsweep.charts import solved, style
from slipsweep.charts.sheet import Panel, Sheet, curve_looks, has_flags, log_axis, log_ticks, over, plot_curve, reliable
from slipsweep.charts.slices import Result
from slipsweep.charts.solved import DISPLACEMENT, DRIVES, SIDE
from slipsweep.charts.style import Options
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Model
from slipsweep.model.variables import CAUTIONS, RESULTS, STRENGTHS, Validity

Floats = NDArray[np.float64]
Curve = tuple[Floats, Floats]

#: Least value of u ω² / A on its axis, where the largest is far above, and frequencies that are shown to fall together.
_LEAST_SCALED, _FREQUENCIES = 1e-4, 3

_NEWMARK: dict[str, Any] = {"color": "0.5", "linewidth": 0.8, "zorder": 1.8}
_JUMP: dict[str, Any] = {"linestyle": ":", "linewidth": 1.0, "zorder": 1.9}
_CAUTION: dict[str, Any] = {"color": "0.8", "linewidth": 7, "solid_capstyle": "butt", "zorder": 1.5}
_UNSOUND: dict[str, Any] = {"color": "0.55", "linewidth": 7, "linestyle": (0, (0.15, 0.35)), "zorder": 1.6}

#: How the options are drawn that an engineer has to choose from.
_ANSWERS: dict[str, dict[str, Any]] = {
    f"{decay}, stop by {end}": {"color": colour, "markerfacecolor": face, "linestyle": dash, "marker": marker}
    for end, colour, face in (("Eq. 12", style.BLUE, style.BLUE), ("integration", style.VERMILION, "white"))
    for decay, dash, marker in (
        ("λ by Eq. 6", (0, (7, 2)), "o"), ("λ = 2", (0, (3, 1.5)), "s"), ("λ = 3", (0, (7, 2, 1.5, 2)), "^"),
    )
} | {style.NEWMARK: {"color": "0.35", "linestyle": "-", "marker": "x"}}  # fmt: skip


# ------------------------------------------------------------------------------- the kinds


def families(result: Result, options: Options) -> Figure:
    """Curves of a result over one axis, one for each value of another, with Newmark's of displacements."""
    first = ("frequency", "yield_coefficient", "mu_s", "theta")
    name = result.quantity(options.variable)
    return _drawn(result.sheet(options, result.compared(name), DRIVES, curves=[*first, *result.wide]), name)


def curve(result: Result, options: Options) -> Figure:
    """One curve of a result over one axis, with Newmark's of a displacement."""
    name = result.quantity(options.variable)
    return _drawn(result.sheet(options, result.compared(name), (*DRIVES, "yield_coefficient", "frequency")), name)


def motions(result: Result, options: Options) -> Figure:
    """Displacements under one record over one axis, a curve for each value of another."""
    first = (*STRENGTHS, "yield_acceleration", "yield_coefficient")
    others = [dim for dim in result.wide if dim != "polarity"]
    return _drawn(result.sheet(options, result.compared(DISPLACEMENT), first, curves=others), DISPLACEMENT)


def dimensionless(result: Result, options: Options) -> Figure:
    """uω²/A against A/Üy, in which all frequencies give one curve."""
    if options.x not in (None, *DRIVES):
        raise InputError(f"{result.name}: --x {options.x}: the dimensionless chart is drawn over A / Üy")
    drive = next((dim for dim in reversed(DRIVES) if dim in result.wide), None)
    if drive is None:
        raise InputError(f"{result.name}: the dimensionless chart needs an amplitude of two values or more")
    first = ("mu_s", "theta", "yield_acceleration", "yield_coefficient")
    keep = {"frequency": result.spread("frequency", _FREQUENCIES)} if "frequency" in result.wide else {}
    names = result.compared(DISPLACEMENT)
    sheet = result.sheet(replace(options, x=None), names, drive, curves=first, keep=keep)
    return _drawn(sheet, DISPLACEMENT, scaled=True)


def _drawn(sheet: Sheet, name: str, scaled: bool = False) -> Figure:
    """Curves of a result, of the displacement with Newmark's; `scaled` as uω²/A over A/Üy."""
    units = sheet.options.unit(name)
    factor, units = (1000.0, "mm") if units == "m" else (1.0, units)
    label, least = f"{RESULTS[name]['long_name']} ({units})".removesuffix(" ()"), 1.0 if factor > 1 else None
    sheet.show(name, "Barred curves")
    values = sheet.data["drawn"].values * factor
    if scaled:
        label, least, factor = "permanent displacement, u ω² / A", _LEAST_SCALED, 0.0
        every = [curve for panel in sheet.panels for curve in _scaled(panel, panel.data["drawn"]).values()]
        values = np.concatenate([ys[xs > 1] for xs, ys in every])  # the paper's axis begins at the yield acceleration
    else:
        sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        if scaled:
            panel.axes.set(xscale="log", xlabel="peak ground acceleration over yield, A / Üy")
        log_axis(panel.axes, values, label, least)
        found = _curves(panel, panel.data["drawn"], factor, None if scaled else _on_limit(panel, name))
        looks = (
            curve_looks(len(found)) if panel.y or scaled else [{"color": style.BLUE, "linestyle": "-", "marker": ""}]
        )
        for member, (curve, look) in enumerate(zip(found, looks, strict=True)):
            _draw(sheet, panel, curve, member, len(found), {**look, "marker": ""} if scaled else look)
        _underlay(sheet, panel, name, factor)
        theirs = _curves(panel, panel.data["newmark"], factor, gaps=False) if "newmark" in sheet.data else []
        for curve, look in zip(theirs, looks, strict=False):
            _draw_newmark(sheet, panel, curve, look)
        if scaled:
            _draw_frequencies(sheet, panel, looks)
        else:
            _mark_accelerations(sheet, panel)
    sheet.note_left_out(name)
    return sheet.done()


def _draw_frequencies(sheet: Sheet, panel: Panel, looks: list[dict[str, Any]]) -> None:
    """A few markers a curve for each frequency but the first, between those of the others."""
    frequencies = np.atleast_1d(panel.data["frequency"].values)
    curves, size = _scaled(panel, panel.data["drawn"]), frequencies.size
    for number, (frequency, shape) in enumerate(zip(frequencies, ["", *"ox+"], strict=False)):
        marker: dict[str, Any] = {"marker": shape, "markersize": 5, "markerfacecolor": "none", "linestyle": ""}
        for member, look in enumerate(looks if shape else ()):
            xs, ys = curves[member, number]
            every = max(1, xs.size // 12)
            panel.axes.plot(xs, ys, color=look["color"], markevery=(number * every // size, every), **marker)
        if size > 1:
            text = style.value_text(sheet.data, "frequency", frequency, sheet.options)
            sheet.legend[text] = Line2D([], [], color="0.3", **(marker if shape else {"linestyle": "-"}))
    log_ticks(panel.axes.xaxis, 10)
    panel.axes.set_xlim(left=1.0)


def spread(result: Result, options: Options) -> Figure:
    """The results of options that an engineer has to choose from, the band between them, and this result.

    Newmark's block; friction decay λ by Eq. 6 or as measured; sliding that ends by Eq. 12 or by integration.
    """
    if "yield_coefficient" in result.data.coords:
        raise InputError(f"{result.name}: the result has ky alone: other options of the model need theta and mu_s")
    sheet = result.sheet(options, result.compared(DISPLACEMENT), DRIVES)
    # the others have a mode limit, whatever this one is
    sheet.show(DISPLACEMENT, "Barred, of this result", always=True)
    sheet.set_axis("x", sheet.x)
    flags: list[xr.DataArray] = []
    own_text = _own_text(sheet.data)  # one for all panels: the caption has what differs
    answers = [_answers(panel, own_text, flags) for panel in sheet.panels]
    values = np.concatenate([ys for one in answers for _, ys in one.values()])
    for panel, curves in zip(sheet.panels, answers, strict=True):
        log_axis(panel.axes, values, "permanent displacement (mm)")
        xs = next(xs for xs, _ in curves.values())
        each = np.array([ys for _, ys in curves.values()])
        # what is zero lies below any logarithmic axis, not nowhere
        low, high = (np.maximum(most(each, axis=0), 1e-300) for most in (np.fmin.reduce, np.fmax.reduce))
        area: dict[str, Any] = {"facecolor": "0.92", "linewidth": 0}
        panel.axes.fill_between(xs, low, high, zorder=1, gid="spread", **area)
        sheet.legend["range of these results"] = Patch(**area)
        for number, (text, curve) in enumerate(curves.items()):
            own: dict[str, Any] = {"color": "black", "linewidth": 2.4, "zorder": 2.5}
            look = {"linewidth": 1.0, "markersize": 3.5, **_ANSWERS[text]} if text in _ANSWERS else own
            place = number / len(curves)
            sheet.legend[text] = plot_curve(panel.axes, *_above_zero(curve), place, label=text, **look)
        _underlay(sheet, panel, DISPLACEMENT, 1000.0)
        _mark_accelerations(sheet, panel)
    sheet.note_left_out(DISPLACEMENT, *flags)
    sheet.notes.append("All results have the same Üy; λ = 2 to 3 is what the paper measured on its interface.")
    return sheet.done()


# ------------------------------------------------------------------------ what they show


def _scaled(panel: Panel, displacement: xr.DataArray) -> dict[tuple[int, int], Curve]:
    """A/Üy and uω²/A of every curve of a panel and every frequency of its slice, by their numbers."""
    data, dims = panel.data, (panel.y, "frequency", panel.x)
    variables = (displacement, data["amplitude"], data["frequency"], data["yield_line"])
    u, a, frequency, threshold = (over(one, data, dims) for one in variables)
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled, ratio = np.broadcast_arrays(u * (2 * math.pi * frequency) ** 2 / a, a / threshold)
    return {(i, j): (ratio[i, j], scaled[i, j]) for i in range(scaled.shape[0]) for j in range(scaled.shape[1])}


def _answers(panel: Panel, own_text: str, flags: list[xr.DataArray]) -> dict[str, Curve]:
    """The curves of a spread, mm, all over the same abscissae, the result's own last; their validity to `flags`."""
    found = {}
    for text, (model, changed) in solved.alternatives(panel.data).items():
        answer = solved.solve(panel.data, [DISPLACEMENT, "validity"], model, **changed)
        flags.append(answer["validity"])
        drawn = reliable(answer, DISPLACEMENT, panel.options)
        found[text] = _curves(panel, drawn, 1000.0, _on_limit(panel, DISPLACEMENT, model, **changed))[0]
    own = _curves(panel, panel.data["drawn"], 1000.0, _on_limit(panel, DISPLACEMENT))[0]
    return {**found, f"this result:\n{own_text}": own}


def _own_text(data: xr.Dataset) -> str:
    """What a result is called among those of other options."""
    model = MODELS.from_attributes(data.attrs)
    if model.name == "newmark":
        return style.NEWMARK
    given = data.coords.get("decay_rate")
    decay = "λ by Eq. 6" if given is None else f"λ = {given.item():.3g}" if given.size == 1 else "λ as given"
    return f"{decay}, stop by {'Eq. 12' if model.options['recoupling'] == 'eq12' else 'integration'}"


# -------------------------------------------------------------------------- jumps and gaps


def _on_limit(panel: Panel, name: str, model: Model | None = None, **changed: Any) -> xr.DataArray | None:
    """A result on both sides of the mode limit, if the curves are over the amplitude and there is a limit."""
    data = panel.data
    if "limit_line" not in data or panel.x not in DRIVES:
        return None
    sides = solved.solve(data, [name, "validity"], model, **changed, **solved.sides_of(data["limit_line"]))
    return reliable(sides, name, panel.options)


def _curves(
    panel: Panel, array: xr.DataArray, factor: float, on_limit: xr.DataArray | None = None, gaps: bool = True
) -> list[Curve]:
    """The curves of a panel, broken where the amplitude passes the mode limit: the jump is no line.

    In units of `factor`; of 0, as uω²/A over A/Üy.  With the results on the limit they go there from either side.
    """
    if factor:
        curves = [(panel.values(panel.x), ys * factor) for ys in panel.grid(array)]
    else:
        curves = [curve for (_, frequency), curve in _scaled(panel, array).items() if frequency == 0]
    if "limit_line" not in panel.data or not gaps:
        return curves
    limit = panel.grid("limit_line")
    beyond = panel.grid("amplitude") > limit
    if on_limit is None or not factor:
        return [_broken(*curve, *at) for curve, *at in zip(curves, beyond, strict=True)]
    scale = panel.options.scale(panel.x, panel.g)
    if panel.x == "displacement_amplitude":
        scale = scale / (2 * math.pi * panel.grid("frequency")) ** 2
    edges = panel.grid(on_limit, SIDE) * factor
    return [_broken(*curve, *at) for curve, *at in zip(curves, beyond, (limit * scale)[:, 0], edges, strict=True)]


def _broken(
    xs: Floats, ys: Floats, beyond: NDArray[np.bool_], limit: float | None = None, on_limit: Floats | None = None
) -> Curve:
    """A curve with a gap where `beyond` changes; there are always three points more, for curves side by side."""
    gaps = np.flatnonzero(beyond[1:] != beyond[:-1]) + 1
    if limit is None or on_limit is None or not gaps.size:
        return np.insert(xs, gaps, xs[gaps]), np.insert(ys, gaps, np.nan)
    below, above = on_limit
    return np.insert(xs, gaps.repeat(3), limit), np.insert(ys, gaps.repeat(3), [below, np.nan, above])


def _above_zero(curve: Curve) -> Curve:
    """What a logarithmic axis can show of a curve."""
    return curve[0], np.where(curve[1] > 0, curve[1], np.nan)


def _draw(sheet: Sheet, panel: Panel, curve: Curve, member: int, members: int, look: dict[str, Any]) -> None:
    """Draw a curve of a family, its jumps as dotted lines."""
    xs, ys = _above_zero(curve)
    several = panel.x != "frequency" and panel.data.sizes.get("frequency", 1) > 1
    single = style.NEWMARK if solved.is_newmark(panel.data) else "this result"
    text = panel.member(member) or ("all frequencies" if several else single)
    sheet.legend[text] = plot_curve(panel.axes, xs, ys, member / members, label=text, **look)
    for at in np.flatnonzero(np.isnan(ys[1:-1]) & (xs[1:-1] == xs[2:])) + 1:
        ends = [at - 1, at + 1]
        if np.isfinite(ys[ends]).all():
            panel.axes.plot(xs[ends], ys[ends], color=look["color"], gid="jump", **_JUMP)
            sheet.remarks["jump at the mode limit"] = Line2D([], [], color="0.3", **_JUMP)


def _draw_newmark(sheet: Sheet, panel: Panel, curve: Curve, look: dict[str, Any]) -> None:
    """Draw Newmark's curve: thin, with the dash of its curve of a family; dashed where there is one curve."""
    single = {"linestyle": (0, (5, 2)), "linewidth": 1.4, "color": "0.3"}
    look = _NEWMARK | ({"linestyle": look["linestyle"]} if panel.y else single)
    panel.axes.plot(*_above_zero(curve), gid="newmark", **look)
    text = f"{style.NEWMARK} (same dash)" if panel.y else style.NEWMARK
    sheet.remarks[text] = Line2D([], [], **(_NEWMARK if panel.y else look))


def _underlay(sheet: Sheet, panel: Panel, name: str, factor: float = 0.0) -> None:
    """Put a broad grey line under what a caution is about, and a barred one under what no block does.

    In units of `factor`, as `_curves`.
    """
    data = panel.data
    drawn = data["drawn"]
    marks = [("caution", _CAUTION, (drawn > 0) & has_flags(data["validity"], CAUTIONS))]
    marks += [("unsound", _UNSOUND, data["unsound"])] if "unsound" in data else []
    for gid, look, cells in marks:
        # the limit itself is cautious, and a jump there is no line
        edge = _on_limit(panel, name) if gid == "caution" and factor else None
        curves = _curves(panel, drawn.where(cells).transpose(*drawn.dims), factor, edge)
        for xs, ys in curves:
            panel.axes.plot(xs, ys, gid=gid, **look)
        if cells.any() and gid == "unsound":
            sheet.remarks[style.UNSOUND] = Line2D([], [], **look)
        elif cells.any():
            codes = sheet.data["validity"].where(sheet.data["drawn"] > 0, 0).values.astype(int)
            names = [style.flag_name(flag) for flag in CAUTIONS & Validity(int(np.bitwise_or.reduce(codes, axis=None)))]
            sheet.remarks["caution:\n" + "\n".join(names)] = Line2D([], [], **look)


def _mark_accelerations(sheet: Sheet, panel: Panel) -> None:
    """Vertical lines where the amplitude passes a threshold that all curves of a panel share."""
    low, high = panel.axes.get_xlim()
    data = panel.data
    if panel.x in ("yield_coefficient", "yield_acceleration") and "amplitude" in data and not solved.is_recorded(data):
        place = data["amplitude"].values.max() / (panel.g if panel.x == "yield_coefficient" else 1.0)
        place *= panel.options.scale(panel.x, panel.g)
        if low < place < high and data["amplitude"].size == 1:
            look: dict[str, Any] = {"facecolor": "none", "edgecolor": "0.7", "hatch": ".."}
            panel.axes.axvspan(place, high, linewidth=0, zorder=0.5, **look)
            sheet.remarks[f"{style.NO_SLIDING}: Üy above A"] = Patch(**look)
    for name, (text, look) in style.LINES.items() if panel.x == "amplitude" else ():
        if name in data and data[name].size == 1:
            place = data[name].item() * panel.options.scale("amplitude", panel.g)
            if low <= place <= high:
                sheet.remarks[text] = panel.axes.axvline(place, gid=name, **{**look, "linewidth": 1.0, "zorder": 1.7})
