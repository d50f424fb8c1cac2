"""The kinds of charts: what each shows of a result, over which axes, and how it is made from a slice.

The command line and `Dataset.slipsweep.chart` both come here.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from matplotlib.figure import Figure

from slipsweep.charts import curves, maps, sensitivity_figures, uncertainty_figures
from slipsweep.charts.sheet import DRIVES, Sheet
from slipsweep.charts.slices import Cut, Result
from slipsweep.charts.style import Look
from slipsweep.errors import InputError
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.units import quantity
from slipsweep.model.variables import RESULTS

#: Most curves of a family, frequencies shown to collapse, and panels across and down, that a page can show.
_CURVES, _FREQUENCIES, _PANELS = 6, 3, 3

_CODES = ("sliding_mode", "validity")

#: Axes of statistics that are no parameters.
_OWN = ("quantile", "threshold")


@dataclass(frozen=True)
class Wish:
    """What is asked of a chart.

    Attributes
    ----------
    x, y : str, optional
        Axis to draw over; upright axis of a map, or the axis that tells curves apart.
    at : mapping of axis name to value
        Where to cut other axes; several values choose curves or panels.
    variable : str
        What contours and families show.
    panels : sequence of str
        Axes that panels lie along, across and down.
    whole : bool
        Show more of the result: panels lie along axes that would be cut otherwise.
    look : Look
    """

    x: str | None = None
    y: str | None = None
    at: Mapping[str, Cut] = field(default_factory=dict)
    variable: str = "permanent_displacement"
    panels: Sequence[str] = ()
    whole: bool = False
    look: Look = field(default_factory=Look)


def check_kind(kind: str) -> str:
    """`kind` if there is such a chart (InputError otherwise)."""
    if kind not in KINDS:
        raise InputError(f"--kind {kind}: no such chart; {did_you_mean(kind, tuple(KINDS))}")
    return kind


def fitting(result: Result) -> tuple[str, ...]:
    """The kinds that a result's sort has."""
    if "exceedance_probability" not in result.variables:
        return SWEEP_KINDS
    return tuple(kind for kind in STATISTIC_KINDS if kind != "sensitivity" or "total_index" in result.variables)


def draw(result: Result, kind: str, wish: Wish) -> Figure:
    """Draw one chart of a result.

    Raises
    ------
    InputError
        The chart cannot be drawn of it, or what is asked for is not there.
    """
    if len(wish.panels) > 2:
        raise InputError(f"--panels {','.join(wish.panels)}: must be one axis or two")
    return KINDS[check_kind(kind)](result, wish)


def draw_all(
    result: Result, kinds: Iterable[str], wish: Wish, *, strict: bool
) -> tuple[dict[str, Figure], dict[str, str]]:
    """Draw several charts; where not `strict`, those that cannot be drawn are named with the reason.

    Raises
    ------
    InputError
        As `draw`; or none can be drawn.
    """
    if not result.wide:
        raise InputError(
            f"{result.path}: no chart can be drawn: it has no axis of two values or more (its dimensions: "
            f"{', '.join(f'{dim}, {values.size}' for dim, values in result.axes.items()) or 'none'})"
        )
    result.places(wish.at)
    figures: dict[str, Figure] = {}
    left_out: dict[str, str] = {}
    for kind in kinds:
        try:
            figures[kind] = draw(result, kind, wish)
        except InputError as error:
            if strict:
                raise
            left_out[kind] = str(error).removeprefix(f"{result.path}: ")
    if not figures:
        reasons = "; ".join(dict.fromkeys(left_out.values()))
        raise InputError(f"{result.path}: no chart can be drawn from it: {reasons}")
    return figures, left_out


def levels_of(name: str, levels: Sequence[float | str], g: float) -> tuple[float, ...]:
    """Contour levels of a result in its own unit, in order.

    Raises
    ------
    InputError
        One is no number with a unit of the result, or not above zero.
    """
    own = RESULTS.get(name, {}).get("units") == "m"
    found = [
        quantity("levels", one, "displacement_amplitude" if own else "mu_s", g) if isinstance(one, str) else float(one)
        for one in levels
    ]
    for level in found:
        if not 0 < level < float("inf"):
            raise InputError(f"levels: {level:g}: must be > 0")
    if levels and len(set(found)) < 2:
        raise InputError(f"levels: {', '.join(map(str, levels))}: must be two different values or more")
    return tuple(sorted(set(found)))


# ------------------------------------------------------------------------------ the axes


def _check_panels(result: Result, wish: Wish, dims: Sequence[str], others: Sequence[str | None]) -> None:
    for name in wish.panels:
        if result.axis(name) in others or list(wish.panels).count(name) > 1:
            raise InputError(f"--panels {name}: must be an axis that the chart is not drawn over, and be given once")
        if name not in dims:
            raise InputError(f"{result.path}: --panels {name}: the result does not vary along it")


def _several(result: Result, wish: Wish) -> list[str]:
    """Axes of which several values are asked for: they tell curves apart, or panels."""
    return [dim for dim, found in result.places(wish.at).items() if len(found) > 1 and dim not in wish.panels]


def _free(result: Result, wish: Wish, dims: Sequence[str]) -> list[str]:
    """Axes that a chart may be drawn over."""
    return [d for d in dims if d in result.wide and d not in (*wish.panels, *wish.at)]


def _axes(
    result: Result, wish: Wish, variable: str, x: Sequence[str], y: Sequence[str], several: Sequence[str] = ()
) -> tuple[str, str]:
    """The two axes asked for, or the first free ones of `x` and `y` along which the variable varies."""
    named = {result.axis(name) for name in (wish.x, wish.y) if name is not None}
    dims = result.dims(result.result(variable))
    for name in named:
        if name not in dims:
            raise InputError(
                f"{result.path}: {name}: {variable} does not vary along it; it lies along {', '.join(dims)}"
            )
    if wish.x is not None and wish.x == wish.y:
        raise InputError(f"--x {wish.x} --y {wish.y}: must be two different axes")
    free = [d for d in (*several, *_free(result, wish, dims)) if d in dims and d not in named]
    chosen = []
    for asked, preferred in ((wish.y, (*several, *y)), (wish.x, x)):
        taken = asked or next((p for p in (*preferred, *free) if p in free), None)
        if taken is None:
            raise InputError(
                f"{result.path}: a chart needs two axes of two values or more that --at does not cut; "
                f"{variable} has {', '.join(d for d in dims if d in result.wide) or 'none'}"
            )
        if taken in free:
            free.remove(taken)
        chosen.append(taken)
    return chosen[1], chosen[0]


def _map_axes(result: Result, wish: Wish, variable: str, x: Sequence[str]) -> tuple[str, str]:
    found = _axes(result, wish, variable, x, DRIVES)
    if "case" in found:
        raise InputError(f"{result.path}: case: the cases have no order; they tell curves (--y) or panels apart")
    return found


def _sheet(
    result: Result, wish: Wish, names: Sequence[str], x: str, y: str | None, family: bool = False,
    also: Mapping[str, slice | list[int]] | None = None,
    same: Sequence[str] = (),
) -> Sheet:  # fmt: skip
    """The slice of a chart, in panels.

    `family` says that `y` tells curves apart, `also` what else is kept, `same` along what the chart does not vary.
    """
    dims = result.dims(names[0])
    taken = (x, y, *(also or {}))
    _check_panels(result, wish, dims, taken)
    panels = wish.panels or [dim for dim in _several(result, wish) if dim not in taken]
    if wish.whole and not panels:
        panels = [dim for dim in dims if dim in result.groups and dim not in (*taken, *same, *wish.at)]
    panels = panels[:2]
    keep: dict[str, Any] = {x: result.thinned(x), **(also or {})}
    at = dict(wish.at)
    if x in at:
        raise InputError(f"{result.path}: {x} = {at[x]}: is an axis of this chart; it cannot be cut there too")
    if y:
        keep[y] = result.members(y, _CURVES, at) if family else result.thinned(y)
    for name in panels:
        keep[name] = result.members(name, _PANELS, at)
    for name in (*panels, *([y] if y and family else [])):
        at.pop(name, None)
    across, down, *_ = (*panels, None, None)
    return Sheet(result.select(names, keep, at), x, y, wish.look, across, down)


# ---------------------------------------------------------------------------- the charts


def _quantity(result: Result, name: str) -> str:
    result.result(name)
    if name in _CODES:
        raise InputError(f"{result.path}: --variable {name}: is a code, not a quantity; --kind modes shows the modes")
    return name


def _contours(result: Result, wish: Wish) -> Figure:
    name = _quantity(result, wish.variable)
    x, y = _map_axes(result, wish, name, ("frequency", "theta", "mu_s"))
    result.require("theta", "mu_s", "amplitude", "frequency")
    return maps.contours(_sheet(result, wish, [name, "validity"], x, y), name)


def _modes(result: Result, wish: Wish) -> Figure:
    x, y = _map_axes(result, wish, "sliding_mode", ("theta", "mu_s", "frequency"))
    result.require("theta", "mu_s", "amplitude")
    return maps.modes(_sheet(result, wish, ["sliding_mode", "validity"], x, y, same=_same(result)))


def _newmark(result: Result, wish: Wish) -> Figure:
    name = result.result("permanent_displacement")
    if result.attrs["model"] == "newmark":
        raise InputError(f"{result.path}: is of Newmark's block itself; there is no difference to show")
    x, y = _map_axes(result, wish, name, ("theta", "mu_s", "frequency"))
    result.require("theta", "mu_s", "amplitude", "frequency")
    return maps.newmark_ratio(_sheet(result, wish, [name, "validity"], x, y, same=_same(result)))


def _same(result: Result) -> list[str]:
    """With the amplitude given, modes and ratios of displacements do not depend on the frequency."""
    return ["frequency"] if "displacement_amplitude" not in result.coordinates else []


def _families(result: Result, wish: Wish) -> Figure:
    name = _quantity(result, wish.variable)
    x, y = _axes(result, wish, name, DRIVES, ("frequency", "mu_s", "theta"), _several(result, wish)[:1])
    result.require("theta", "mu_s", "amplitude", "frequency")
    return curves.families(_sheet(result, wish, [name, "validity"], x, y, family=True), name)


def _spread(result: Result, wish: Wish) -> Figure:
    name = result.result("permanent_displacement")
    if wish.y is not None:
        raise InputError(f"{result.path}: --y {wish.y}: not with spread, which is drawn over one axis, --x")
    free = _free(result, wish, result.dims(name))
    x = result.axis(wish.x) if wish.x else next((d for d in (*DRIVES, *free) if d in free), None)
    if x is None:
        raise InputError(f"{result.path}: a chart needs an axis of two values or more that --at does not cut")
    result.require("theta", "mu_s", "amplitude", "frequency")
    return curves.spread(_sheet(result, wish, [name, "validity"], x, None))


def _dimensionless(result: Result, wish: Wish) -> Figure:
    name = result.result("permanent_displacement")
    if wish.x not in (None, *DRIVES):
        raise InputError(f"{result.path}: --x {wish.x}: the dimensionless chart is drawn over A / Üy")
    drive = result.axis(next((d for d in DRIVES if d in result.axes), "amplitude"))
    also: dict[str, slice | list[int]] = {}
    if "frequency" in result.wide and "frequency" not in wish.at:
        also["frequency"] = result.spread("frequency", _FREQUENCIES)
    free = _free(result, wish, ("mu_s", "theta", "yield_acceleration"))
    family = result.axis(wish.y) if wish.y else next(iter(free), None)
    if family in (drive, *also):
        raise InputError(f"{result.path}: --y {family}: must be an axis other than {', '.join((drive, *also))}")
    result.require("theta", "mu_s", "amplitude", "frequency")
    return curves.dimensionless(_sheet(result, wish, [name, "validity"], drive, family, family=True, also=also))


def _statistic_axes(result: Result, wish: Wish, variable: str, family: str | None) -> tuple[str, str | None]:
    """The axis that statistics are drawn over, and the one that tells curves apart, if there is one."""
    result.result(variable)
    for asked in (wish.x, wish.y):
        if asked is not None:
            result.axis(asked)
    free = _free(result, wish, result.dims(variable))
    x = wish.x or next((d for d in (*DRIVES, *free) if d in free and d not in (*_OWN, wish.y)), None)
    if x is None or x not in free or x in _OWN:
        raise InputError(f"{result.path}: {variable} needs an axis of two values or more that --at does not cut")
    chosen = wish.y or (family if family in free else None)
    if chosen == x or (chosen is not None and chosen not in (*free, "case")):
        raise InputError(f"{result.path}: --y {chosen}: must be another axis that {variable} has, and that is not cut")
    return x, chosen


def _fragility(result: Result, wish: Wish) -> Figure:
    result.result("valueless_share")
    result.require("threshold")
    x, family = _statistic_axes(result, wish, "exceedance_probability", "threshold")
    names = ["exceedance_probability", "valueless_share"]
    return uncertainty_figures.fragility(_sheet(result, wish, names, x, family, family=True))


def _quantiles(result: Result, wish: Wish) -> Figure:
    if wish.y is not None:
        raise InputError(f"{result.path}: --y {wish.y}: not with quantiles, whose bands lie over one axis, --x")
    result.result("valueless_share")
    result.require("quantile")
    x, _ = _statistic_axes(result, wish, "displacement_quantile", None)
    names = ["displacement_quantile", "valueless_share"]
    also: dict[str, slice | list[int]] = {"quantile": slice(None)}
    return uncertainty_figures.quantile_bands(_sheet(result, wish, names, x, None, also=also))


def _sensitivity(result: Result, wish: Wish) -> Figure:
    if "total_index" not in result.variables:
        raise InputError(f"{result.path}: holds no Sobol indices; sensitivity = true in [uncertainty] asks for them")
    if wish.y is not None:
        raise InputError(f"{result.path}: --y {wish.y}: not with sensitivity, whose inputs tell curves apart")
    names = sensitivity_figures.NAMES
    for name in names:
        result.result(name)
    keep: dict[str, slice | list[int]] = {"bound": slice(None)}
    if wish.x is None and not _free(result, wish, result.dims("total_index")):
        return sensitivity_figures.bars(_sheet(result, wish, names, "input", None, also=keep), result.inputs)
    x, _ = _statistic_axes(result, wish, "total_index", None)
    sheet = _sheet(result, wish, names, x, None, also={**keep, "input": slice(None)})
    return sensitivity_figures.curves(sheet, result.inputs)


KINDS: dict[str, Callable[[Result, Wish], Figure]] = {
    "contours": _contours,
    "modes": _modes,
    "families": _families,
    "dimensionless": _dimensionless,
    "newmark": _newmark,
    "spread": _spread,
    "fragility": _fragility,
    "quantiles": _quantiles,
    "sensitivity": _sensitivity,
}

#: Those of a sweep, and of a sweep with uncertain inputs.
STATISTIC_KINDS = ("fragility", "quantiles", "sensitivity")
SWEEP_KINDS = tuple(kind for kind in KINDS if kind not in STATISTIC_KINDS)
