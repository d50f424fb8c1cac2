"""Curves: a result over one axis of a slice, a curve for each value of another, or for each answer there is."""

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from slipsweep.charts.answers import SIDE, alternatives, boundaries, newmark, sides_of, solve
from slipsweep.charts.sheet import (
    DRIVES,
    LINES,
    Panel,
    Sheet,
    broadcast,
    check_positive,
    curve_looks,
    log_axis,
    log_ticks,
    plot_curve,
    reliable,
    validity_has,
)  # fmt: skip
from slipsweep.charts.style import BLUE, VERMILION, value_text
from slipsweep.model.options import MODELS, Model
from slipsweep.model.variables import CAUTIONS, RESULTS, Validity

Floats = NDArray[np.float64]
Curve = tuple[Floats, Floats]

#: Least displacement of a logarithmic axis, mm, where the largest is far above; and of u ω² / A.
_LEAST, _LEAST_SCALED = 1.0, 1e-4

_DISPLACEMENT = "permanent_displacement"

_NEWMARK: dict[str, Any] = {"color": "0.5", "linewidth": 0.8, "zorder": 1.8}
_JUMP: dict[str, Any] = {"linestyle": ":", "linewidth": 1.0, "zorder": 1.9}
_CAUTION: dict[str, Any] = {"color": "0.8", "linewidth": 7, "solid_capstyle": "butt", "zorder": 1.5}

#: How the answers are drawn that an engineer has to choose from.
_ANSWERS: dict[str, dict[str, Any]] = {
    f"{decay}, stop by {end}": {"color": colour, "markerfacecolor": face, "linestyle": dash, "marker": marker}
    for end, colour, face in (("Eq. 12", BLUE, BLUE), ("integration", VERMILION, "white"))
    for decay, dash, marker in (
        ("λ by Eq. 6", (0, (7, 2)), "o"), ("λ = 2", (0, (3, 1.5)), "s"), ("λ = 3", (0, (7, 2, 1.5, 2)), "^"),
    )
} | {"Newmark": {"color": "0.35", "linestyle": "-", "marker": "x"}}  # fmt: skip


# ------------------------------------------------------------------------- the three charts


def families(sheet: Sheet, name: str) -> Figure:
    """Draw curves of a result over one axis, one for each value of another, and Newmark's beside displacements.

    Parameters
    ----------
    sheet : Sheet
        Of a slice that holds the result and `validity`.
    name : str
        The result.
    """
    factor = 1000.0 if RESULTS[name].get("units") == "m" else 1.0
    label, shown = RESULTS[name]["long_name"], "mm" if factor > 1 else sheet.look.unit(name)
    values = reliable(sheet.table.data_vars, name, sheet.look).values * factor
    check_positive(label, values)
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        log_axis(panel.axes, values, _LEAST if factor > 1 else None)
        panel.axes.set_ylabel(f"{label} ({shown})" if shown else label)
        curves = _curves(panel, panel.result(name), _on_limit(panel, name))
        looks = curve_looks(len(curves))
        for member, ((xs, ys), look) in enumerate(zip(curves, looks, strict=True)):
            _draw(sheet, panel, (xs, ys * factor), member, len(curves), look)
        _underlay(sheet, panel, name, factor)
        if name == _DISPLACEMENT and panel.table.attrs["model"] != "newmark":
            for ys, look in zip(panel.grid(newmark(panel.table)), looks, strict=True):
                _draw_newmark(sheet, panel, (panel.values(panel.x), ys * factor), look)
        _mark_accelerations(sheet, panel)
    sheet.note_left_out(name)
    if name == _DISPLACEMENT:
        sheet.note_newmark()
    return sheet.finish("outside right upper")


def dimensionless(sheet: Sheet) -> Figure:
    """Draw uω²/A against A/Üy, in which all frequencies give one curve.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over the amplitude and some frequencies that holds `permanent_displacement` and `validity`.
    """
    drawn = [dimensionless_curves(panel, panel.result(_DISPLACEMENT)) for panel in sheet.panels]
    # the paper's axis begins at the yield acceleration
    beyond = np.concatenate([ys[xs > 1] for one in drawn for xs, ys in one.values()])
    check_positive("displacement beyond the yield acceleration", beyond)
    frequencies = np.atleast_1d(sheet.table["frequency"].values)
    shapes: list[dict[str, Any]] = [
        {"marker": shape, "markersize": 5, "markerfacecolor": "none"} for shape in "ox+"[: frequencies.size - 1]
    ]
    for panel, curves in zip(sheet.panels, drawn, strict=True):
        panel.axes.set(xscale="log", xlabel="peak ground acceleration over yield, A / Üy")
        panel.axes.set_ylabel("permanent displacement, u ω² / A")
        log_axis(panel.axes, beyond, _LEAST_SCALED)
        found = _on_limit(panel, _DISPLACEMENT)
        edges = dimensionless_curves(panel, found, _sides(panel)["amplitude"], SIDE) if found is not None else {}
        classical = panel.table.attrs["model"] != "newmark" and dimensionless_curves(panel, newmark(panel.table))
        members = len(curves) // frequencies.size
        for member, look in enumerate(curve_looks(members)):
            xs, ys = curves[member, 0]
            if edges:
                ends, on_limit = edges[member, 0]
                xs, ys = _broken(xs, ys, xs > ends[0], ends[0], on_limit)
            _draw(sheet, panel, (xs, ys), member, members, {**look, "marker": ""})
            if classical:
                _draw_newmark(sheet, panel, classical[member, 0], look)
            for number, shape in enumerate(shapes, start=1):
                # a few markers a curve, each frequency's between those of the others
                xs, ys = curves[member, number]
                every = max(1, xs.size // 12)
                place = (number * every // frequencies.size, every)
                panel.axes.plot(xs, ys, color=look["color"], linestyle="", markevery=place, **shape)
        _underlay(sheet, panel, _DISPLACEMENT)
        log_ticks(panel.axes.xaxis, 10)
        panel.axes.set_xlim(left=1.0)
    for frequency, shape in zip(frequencies, [{"linestyle": "-"}, *shapes], strict=True) if shapes else ():
        sheet.legend[value_text("frequency", frequency)] = Line2D([], [], **{"color": "0.3", "linestyle": "", **shape})
    sheet.note_left_out(_DISPLACEMENT)
    sheet.note_newmark()
    return sheet.finish("outside right upper")


def spread(sheet: Sheet) -> Figure:
    """Draw the answers that an engineer has to choose from, the band between them, and the one of this result.

    Newmark's block; friction decay λ by Eq. 6 or as measured; sliding that ends by Eq. 12 or by integration.

    Parameters
    ----------
    sheet : Sheet
        Of a slice over one axis that holds `permanent_displacement` and `validity`.
    """
    sheet.set_axis("x", sheet.x)
    for panel in sheet.panels:
        panel.lines = boundaries(panel.table, always=True)  # the others have a mode limit, whatever this one is
    flags: list[xr.Variable] = []
    own_text = _own_text(sheet.table)  # one for all panels: the caption has what differs
    answers = [_answers(panel, own_text, flags) for panel in sheet.panels]
    values = np.concatenate([ys for one in answers for _, ys in one.values()])
    check_positive(RESULTS[_DISPLACEMENT]["long_name"], values)
    for panel, curves in zip(sheet.panels, answers, strict=True):
        log_axis(panel.axes, values, _LEAST)
        panel.axes.set_ylabel("permanent displacement (mm)")
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
        _underlay(sheet, panel, _DISPLACEMENT, 1000.0)
        _mark_accelerations(sheet, panel)
    sheet.note_left_out(_DISPLACEMENT, *flags)
    sheet.notes.append("All results have the same Üy; λ = 2 to 3 is what the paper measured on its interface.")
    return sheet.finish("outside right upper")


# ------------------------------------------------------------------------ what they show


def dimensionless_curves(
    panel: Panel, displacement: xr.Variable, amplitude: xr.Variable | None = None, along: str | None = None
) -> dict[tuple[int, int], Curve]:
    """A/Üy and uω²/A of every curve of a panel and every frequency of its slice, by their numbers."""
    dims = (panel.y, "frequency", along or panel.x)
    variables = (
        displacement, panel.table["amplitude"] if amplitude is None else amplitude, panel.table["frequency"],
        panel.lines["yield_acceleration"],
    )  # fmt: skip
    u, a, frequency, threshold = (broadcast(one, panel.table, dims) for one in variables)
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled, ratio = np.broadcast_arrays(u * (2 * math.pi * frequency) ** 2 / a, a / threshold)
    return {(i, j): (ratio[i, j], scaled[i, j]) for i in range(scaled.shape[0]) for j in range(scaled.shape[1])}


def _answers(panel: Panel, own_text: str, flags: list[xr.Variable]) -> dict[str, Curve]:
    """The curves of a spread, mm, all over the same abscissae, the result's own last; their validity to `flags`."""
    found = {}
    for text, (model, changed) in alternatives(panel.table).items():
        solved = solve(panel.table, [_DISPLACEMENT, "validity"], model, **changed)
        flags.append(solved["validity"])
        drawn = reliable(solved, _DISPLACEMENT, panel.look)
        found[text] = _curves(panel, drawn, _on_limit(panel, _DISPLACEMENT, model, **changed))[0]
    own = _curves(panel, panel.result(_DISPLACEMENT), _on_limit(panel, _DISPLACEMENT))[0]
    found[f"this result:\n{own_text}"] = own
    return {text: (xs, ys * 1000.0) for text, (xs, ys) in found.items()}


def _own_text(table: xr.Dataset) -> str:
    """What the answer of a result is called among those that there are."""
    model = MODELS.from_attributes(table.attrs)
    if model.name == "newmark":
        return "Newmark"
    given = table.coords.get("decay_rate")
    decay = "λ by Eq. 6" if given is None else f"λ = {given.item():.3g}" if given.values.size == 1 else "λ as given"
    return f"{decay}, stop by {'Eq. 12' if model.options['recoupling'] == 'eq12' else 'integration'}"


# -------------------------------------------------------------------------- jumps and gaps


def _sides(panel: Panel) -> dict[str, Any]:
    return sides_of(panel.lines["limiting_acceleration"])


def _on_limit(panel: Panel, name: str, model: Model | None = None, **changed: Any) -> xr.Variable | None:
    """A result on both sides of the mode limit, if the curves are over the amplitude and there is a limit."""
    if "limiting_acceleration" not in panel.lines or panel.x not in DRIVES:
        return None
    return reliable(solve(panel.table, [name, "validity"], model, **changed, **_sides(panel)), name, panel.look)


def _curves(panel: Panel, drawn: xr.Variable, on_limit: xr.Variable | None = None) -> list[Curve]:
    """The curves of a panel, broken where the amplitude passes the mode limit: the jump is no line.

    With the results on the limit they go there from either side.
    """
    xs, rows = panel.values(panel.x), panel.grid(drawn)
    if "limiting_acceleration" not in panel.lines:
        return [(xs, ys) for ys in rows]
    limit = panel.grid(panel.lines["limiting_acceleration"])
    beyond = panel.grid(panel.table["amplitude"]) > limit
    if panel.x not in DRIVES:
        return [_broken(xs, ys, *at) for ys, *at in zip(rows, beyond, strict=True)]
    scale = panel.look.scale(panel.x, panel.g)
    if panel.x == "displacement_amplitude":
        scale = scale / (2 * math.pi * panel.grid(panel.table["frequency"])) ** 2
    edges = panel.grid(on_limit, SIDE) if on_limit is not None else [None] * len(rows)
    return [_broken(xs, ys, *at) for ys, *at in zip(rows, beyond, (limit * scale)[:, 0], edges, strict=True)]


def _broken(
    xs: Floats, ys: Floats, beyond: NDArray[np.bool_], limit: float | None = None, on_limit: Floats | None = None
) -> Curve:
    """A curve with a gap where `beyond` changes; there are always three points more, for curves side by side."""
    gaps = np.flatnonzero(beyond[1:] != beyond[:-1]) + 1
    if limit is None:
        return np.insert(xs, gaps, xs[gaps]), np.insert(ys, gaps, np.nan)
    if not gaps.size:
        return xs, ys
    below, above = (np.nan, np.nan) if on_limit is None else on_limit
    return np.insert(xs, gaps.repeat(3), limit), np.insert(ys, gaps.repeat(3), [below, np.nan, above])


def _above_zero(curve: Curve) -> Curve:
    """What a logarithmic axis can show of a curve."""
    return curve[0], np.where(curve[1] > 0, curve[1], np.nan)


def _draw(sheet: Sheet, panel: Panel, curve: Curve, member: int, members: int, look: dict[str, Any]) -> None:
    """Draw a curve of a family, its jumps as dotted lines."""
    xs, ys = _above_zero(curve)
    text = panel.member(member) or "all frequencies"
    sheet.legend[text] = plot_curve(panel.axes, xs, ys, member / members, label=text, **look)
    for at in np.flatnonzero(np.isnan(ys[1:-1]) & (xs[1:-1] == xs[2:])) + 1:
        ends = [at - 1, at + 1]
        if np.isfinite(ys[ends]).all():
            panel.axes.plot(xs[ends], ys[ends], color=look["color"], gid="jump", **_JUMP)
            sheet.remarks["jump at the mode limit"] = Line2D([], [], color="0.3", **_JUMP)


def _draw_newmark(sheet: Sheet, panel: Panel, curve: Curve, look: dict[str, Any]) -> None:
    """Draw Newmark's curve beside one of a family, with the same dash."""
    xs, ys = _above_zero(curve)
    panel.axes.plot(xs, ys, linestyle=look["linestyle"], gid="newmark", **_NEWMARK)
    sheet.remarks["Newmark (same dash)" if panel.y else "Newmark"] = Line2D([], [], **_NEWMARK)


def _underlay(sheet: Sheet, panel: Panel, name: str, factor: float = 0.0) -> None:
    """Put a broad grey line under what a caution is about: in units of `factor`, without one dimensionless."""
    drawn = panel.result(name)
    flagged = broadcast(validity_has(panel.table["validity"], CAUTIONS), panel.table, drawn.dims)
    cautious = drawn.where(flagged & (drawn.values > 0))
    if factor:
        # the limit itself is cautious, and a jump there is no line
        curves = [(xs, ys * factor) for xs, ys in _curves(panel, cautious, _on_limit(panel, name))]
    else:
        found = dimensionless_curves(panel, cautious)
        curves = [curve for (_, frequency), curve in found.items() if frequency == 0]
    for xs, ys in curves:
        panel.axes.plot(xs, ys, gid="caution", **_CAUTION)
    if np.isfinite(cautious.values).any():
        values = reliable(sheet.table.data_vars, name, sheet.look).values
        flags = np.bitwise_or.reduce(sheet.table["validity"].values[values > 0].astype(int))
        names = [(flag.name or "").lower() for flag in CAUTIONS & Validity(int(flags))]
        sheet.remarks["caution:\n" + "\n".join(names)] = Line2D([], [], **_CAUTION)


def _mark_accelerations(sheet: Sheet, panel: Panel) -> None:
    """Upright lines where the amplitude passes a threshold that all curves of a panel share."""
    if panel.x != "amplitude":
        return
    for name, threshold in panel.lines.items():
        text, look = LINES[name]
        place = threshold.values.flat[0] * panel.look.scale("amplitude", panel.g)
        low, high = panel.axes.get_xlim()
        if threshold.values.size == 1 and low <= place <= high:
            sheet.remarks[text] = panel.axes.axvline(place, gid=name, **{**look, "linewidth": 1.0, "zorder": 1.7})
