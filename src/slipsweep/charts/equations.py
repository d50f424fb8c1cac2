"""Published equations on charts: median dashed, ± σ thin, dotted beyond the range."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.lines import Line2D

from slipsweep.charts.sheet import Panel, Sheet
from slipsweep.charts.style import Floats, Look
from slipsweep.errors import InputError
from slipsweep.model.parameters import GRAVITY
from slipsweep.model.units import in_mm
from slipsweep.published import EQUATIONS, Estimate
from slipsweep.studies.published_statistics import conditions_texts, estimates
from slipsweep.studies.published_strength import strength_by

#: Kinds of charts that draw published equations.
KINDS = ("curve", "dimensionless", "motions", "intensity", "strength")

#: Equations for N cycles of a period, which the dimensionless chart draws.
NORMALISED = tuple(name for name, equation in EQUATIONS.items() if "cycles" in equation.inputs)

#: Most equations that a chart can tell apart.
_MOST = 5

#: Colour, dash and marker of each equation: told apart without colour.
_COLOURS = ("#A8480A", "#1B7F5C", "#7B4FA0", "#444444", "#B0882A")
_DASHES = (
    (0, (6, 2)),
    (0, (3, 1.5)),
    (0, (8, 2, 2, 2)),
    (0, (14, 3)),
    (0, (6, 1.5, 1.5, 1.5, 1.5, 1.5)),
)
_MARKERS = ("^", "v", "D", "P", "X")

#: Shares of a normal distribution below its median, and one standard deviation on either side.
_SHARES = (0.5, 0.15865525393145707, 0.8413447460685429)

#: Markers on a median.
_MARKED = 5

#: Decades that an ordinate may show.
_DECADES = 7.0


def draw_over_axis(sheet: Sheet, panel: Panel) -> None:
    """Draw equations over the axis of a panel that has one curve, in mm."""
    names = _names(sheet)
    if not names:
        return
    if panel.y is not None:
        raise InputError(
            f"--equations: are drawn beside one curve, and there is one for each {panel.y}: choose "
            f"a value with --at {panel.y}=VALUE"
        )
    each = estimates(panel.data, names, sheet.options.magnitude)
    drawn = {}
    for name, estimate in each.items():
        for dim in (other for other in estimate.median.dims if other != panel.x):
            raise InputError(f"--equations: {name} varies along {dim}: choose a value with --at")
        drawn[name] = _along(estimate, panel.data[panel.x])
    _draw_each(sheet, panel, panel.xs, drawn)
    _note(sheet, names)


def draw_over_measure(sheet: Sheet, panel: Panel, measure: str, places: Floats) -> None:
    """Draw equations over an intensity measure, which the motions have at `places`, in mm.

    Over PGA and PGV equations are curves; over another measure they are level, at the PGA that
    all motions have.
    """
    names = _names(sheet)
    if not names:
        return
    there = places[np.isfinite(places) & (places > 0.0)]
    if not there.size:
        return
    low = float(there.min())
    high = float(there.max())
    if high < 1.1 * low:  # motions scaled to the measure
        low /= 1.5
        high *= 1.5
    xs = np.geomspace(low, high, 101)
    along = xr.DataArray(xs, dims="place")
    data = panel.data
    if measure == "pga":
        # as if the motions were scaled to each: the velocities that equations take grow with it
        data = data.drop_vars("scale", errors="ignore").assign_coords(amplitude=along)
    elif "amplitude" not in data.coords:
        raise InputError(
            f"--equations: over {measure} all motions must have the same peak ground acceleration: "
            "choose --x pga, or scale them with the axis amplitude"
        )
    elif measure == "pgv":
        data = data.assign_coords(pgv=along)
    each = estimates(data, names, sheet.options.magnitude)
    drawn = {name: _along(estimate, along) for name, estimate in each.items()}
    _draw_each(sheet, panel, xs, drawn)
    _note(sheet, names)


def draw_normalised(sheet: Sheet, panel: Panel) -> None:
    """Draw equations for N cycles of a period as uω²/A over A/Üy."""
    names = _names(sheet)
    if not names:
        return
    for name in names:
        if name not in NORMALISED:
            raise InputError(
                f"--equations: {name}: the dimensionless chart draws those for equal cycles: "
                f"{', '.join(NORMALISED)}"
            )
    over_yield = np.geomspace(1.001, max(panel.axes.get_xlim()[1], 1.01), 201)
    # of a base with A = g and f = 1 Hz: uω²/A depends on A/Üy only
    unit: dict[str, Any] = {"amplitude": GRAVITY, "frequency": 1.0}
    attrs = {**panel.data.attrs, "g": GRAVITY}
    coords = {"yield_coefficient": ("place", 1.0 / over_yield), **unit}
    each = estimates(xr.Dataset(coords=coords, attrs=attrs), names, sheet.options.magnitude)
    drawn = {name: Estimate(*(part.values for part in estimate)) for name, estimate in each.items()}
    _draw_each(sheet, panel, over_yield, drawn, (2.0 * np.pi) ** 2 / GRAVITY)
    _note(sheet, names)


def draw_strengths(sheet: Sheet, panel: Panel) -> None:
    """Draw the yield coefficients that equations require, over the axis of a panel."""
    names = _names(sheet)
    data = panel.data
    if panel.y is not None:
        raise InputError(
            f"--equations: are drawn beside one curve, and there is one for each {panel.y}: choose "
            f"a value with --at {panel.y}=VALUE"
        )
    if data.attrs.get("required") != "yield_coefficient":
        raise InputError("--equations: only beside required yield coefficients")
    along = xr.DataArray(np.zeros(panel.xs.size), dims=panel.x)
    for number, name in enumerate(names):
        curves = {}
        for share in _SHARES:
            strength, inside = strength_by(data, name, sheet.options.magnitude, share)
            for dim in (other for other in strength.dims if other != panel.x):
                raise InputError(
                    f"--equations: {name} varies along {dim}: choose a value with --at"
                )
            curves[share] = (
                strength.broadcast_like(along).values,
                inside.broadcast_like(along).values,
            )
        _draw_equation(sheet, panel, panel.xs, name, (number, len(names)), curves)
    _note(sheet, names)


def _names(sheet: Sheet) -> tuple[str, ...]:
    """Return the equations of a chart (InputError: more than can be told apart)."""
    names = tuple(sheet.options.equations)
    if len(names) > _MOST:
        raise InputError(f"--equations: {len(names)}: a chart shows {_MOST} at most")
    return names


def _along(estimate: Estimate, places: xr.DataArray) -> Estimate:
    """Return an estimate as arrays along a dimension, repeated if it does not depend on it."""
    bare = places.drop_vars([*places.coords])
    return Estimate(*(part.broadcast_like(bare).values for part in estimate))


def _draw_each(
    sheet: Sheet, panel: Panel, xs: Floats, each: dict[str, Estimate], factor: float = in_mm(1.0)
) -> None:
    """Draw estimates along `xs`, their displacements times `factor`."""
    for number, (name, estimate) in enumerate(each.items()):
        inside = np.asarray(estimate.in_range, bool)
        curves = {
            share: (np.asarray(estimate.quantile(share)) * factor, inside) for share in _SHARES
        }
        _draw_equation(sheet, panel, xs, name, (number, len(each)), curves)
        median = curves[0.5][0]
        _widen(panel, np.where(median > 0.0, median, np.nan))


def _draw_equation(
    sheet: Sheet,
    panel: Panel,
    xs: Floats,
    name: str,
    place: tuple[int, int],
    curves: dict[float, tuple[Floats, Any]],
) -> None:
    """Draw the curves of an equation by their shares, each with where it is in range.

    `place` is its number among the equations of the chart, and how many there are.
    """
    number, count = place
    colour = _COLOURS[number]
    dash = _DASHES[number]
    median = curves[0.5][0]
    is_scattered = any(not np.array_equal(values, median) for values, _ in curves.values())
    for share in _SHARES if is_scattered else _SHARES[:1]:
        line: Look = {"color": colour, "linestyle": dash, "gid": f"{name} {share:.0%}"}
        line |= {"linewidth": 1.5 if share == 0.5 else 0.6, "zorder": 2.5}
        _draw_line(sheet, panel, xs, *curves[share], line)
    # side by side with those of other equations
    marked = ((np.arange(_MARKED) + (number + 0.5) / count) / _MARKED * xs.size).astype(int)
    marks: Look = {"marker": _MARKERS[number], "markerfacecolor": "white", "markersize": 5}
    marks |= {"color": colour, "zorder": 2.6}
    shown = np.where(median > 0.0, median, np.nan)
    panel.axes.plot(xs[marked], shown[marked], linestyle="", **marks)
    handle = Line2D([], [], linestyle=dash, linewidth=1.5, **marks)
    sheet.legend[EQUATIONS[name].label] = handle
    if is_scattered:
        thin: Look = {"color": "0.3", "linewidth": 0.6, "linestyle": _DASHES[0]}
        sheet.remarks["equation, ± one standard deviation"] = Line2D([], [], **thin)


def _draw_line(
    sheet: Sheet, panel: Panel, xs: Floats, values: Floats, inside: Any, line: Look
) -> None:
    """Draw a line, dotted where it is not `inside` the range of an equation."""
    shown = np.where(values > 0.0, values, np.nan)
    outside = ~inside
    # a part beyond the range begins where the one inside ends
    outside[1:] |= ~inside[:-1]
    outside[:-1] |= ~inside[1:]
    panel.axes.plot(xs, np.where(inside, shown, np.nan), **line)
    beyond = np.where(outside, shown, np.nan)
    if np.isfinite(beyond).any():
        dotted: Look = {**line, "linestyle": ":", "gid": f"{line['gid']} beyond"}
        panel.axes.plot(xs, beyond, **dotted)
        handle: Look = {"color": "0.3", "linestyle": ":", "linewidth": 1.5}
        sheet.remarks["equation beyond its range"] = Line2D([], [], **handle)


def _widen(panel: Panel, values: Floats) -> None:
    """Extend a logarithmic ordinate upwards to show `values`, up to `_DECADES`."""
    low, high = panel.axes.get_ylim()
    if np.isfinite(values).any():
        top = min(1.5 * float(np.nanmax(values)), low * 10.0**_DECADES)
        panel.axes.set_ylim(low, max(high, top))


def _note(sheet: Sheet, names: tuple[str, ...]) -> None:
    """Add to the caption, once, the conditions that the equations are for."""
    magnitude = sheet.options.magnitude
    magnitude_text = "" if magnitude is None else f" M = {magnitude:g}."
    text = f"{' '.join(conditions_texts(names))}{magnitude_text}"
    if text not in sheet.notes:
        sheet.notes.append(text)
