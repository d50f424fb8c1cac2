"""The kinds of charts: what each shows of a result, over which axes, and how it is made from a slice.

The command line and `Dataset.slipsweep.chart` both come here.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts import curves, maps, sensitivity_figures, suite_figures, uncertainty_figures
from slipsweep.charts.sheet import DRIVES, Sheet
from slipsweep.charts.slices import NAMED, Cut, Result
from slipsweep.charts.style import Look
from slipsweep.charts.whole import DRAWN_WHOLE, WholeResult, whole_kind
from slipsweep.errors import InputError
from slipsweep.files.results import ResultFile, result_file
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.units import quantity
from slipsweep.model.variables import INTENSITY_MEASURES, RESULTS, STRENGTHS

#: Most curves of a family, frequencies shown to collapse, and panels across and down, that a page can show.
_CURVES, _FREQUENCIES, _PANELS = 6, 3, 3

_CODES = ("sliding_mode", "validity")

#: Displacements of a fragility under a suite where none are asked for, m.
_THRESHOLDS = (0.01, 0.1, 1.0)

#: Axes of statistics that are no parameters.
_OWN = ("quantile", "threshold")


@dataclass(frozen=True)
class Wish:
    """What is asked of a chart.

    Attributes
    ----------
    x, y : str, optional
        Axis to draw over; vertical axis of a map, or the curve parameter.
    at : mapping of axis name to value
        Where to cut other axes; several values choose curves or panels.
    variable : str
        What contours and families show.
    panels : sequence of str
        Axes that panels lie along, across and down.
    whole : bool
        Show more of the result: panels lie along axes that would be cut otherwise.
    axes : Axes, optional
        What to draw the one panel of a chart in, instead of a new figure.
    look : Look
    """

    x: str | None = None
    y: str | None = None
    at: Mapping[str, Cut] = field(default_factory=dict)
    variable: str = "permanent_displacement"
    panels: Sequence[str] = ()
    whole: bool = False
    axes: Axes | None = None
    look: Look = field(default_factory=Look)


def check_kind(kind: str) -> str:
    """`kind` if there is such a chart (InputError otherwise)."""
    known = (*KINDS, *DRAWN_WHOLE)
    if kind not in known:
        raise InputError(f"--kind {kind}: no such chart; {did_you_mean(kind, known)}")
    return kind


@contextmanager
def opened(source: Path | ResultFile) -> Iterator[Result | WholeResult]:
    """Open what can be drawn: a result that slices are drawn of, or one that is drawn whole.

    Raises
    ------
    InputError
        It is neither.
    """
    with ExitStack() as stack:
        file = stack.enter_context(result_file(source)) if isinstance(source, Path) else source
        kind = whole_kind(file)
        yield Result(file) if kind is None else WholeResult(file, kind)


def fitting(result: Result | WholeResult) -> tuple[str, ...]:
    """The kinds that a result's sort has."""
    if isinstance(result, WholeResult):
        return (result.kind,)
    return tuple(kind for kind in SORTS[result.sort] if kind != "sensitivity" or "total_index" in result.variables)


def draw(result: Result | WholeResult, kind: str | None, wish: Wish) -> Figure:
    """Draw one chart of a result, the first of those that it has if none is named.

    Raises
    ------
    InputError
        The chart cannot be drawn of it, or what is asked for is not there.
    """
    if len(wish.panels) > 2:
        raise InputError(f"--panels {','.join(wish.panels)}: must be one axis or two")
    kind = fitting(result)[0] if kind is None else check_kind(kind)
    allowed = (result.kind,) if isinstance(result, WholeResult) else SORTS[result.sort]
    if kind not in allowed:
        what = _SORT_TEXT[result.kind if isinstance(result, WholeResult) else result.sort]
        one_of = "one of " if len(allowed) > 1 else ""
        raise InputError(f"{result.path}: --kind {kind}: is {what}: must be {one_of}{', '.join(allowed)}")
    if isinstance(result, WholeResult):
        _check_unused(result, wish)
        return result.draw(wish.axes)
    return KINDS[kind](result, wish)


def _check_unused(result: WholeResult, wish: Wish) -> None:
    """Refuse what says how a slice is drawn, where the whole is drawn (InputError)."""
    given = {"--at": wish.at, "--x": wish.x, "--y": wish.y, "--panels": wish.panels, "--levels": wish.look.levels}
    for option, value in given.items():
        if value:
            raise InputError(f"{result.path}: {option}: not with {result.kind}, which is drawn as a whole")


def draw_all(
    result: Result | WholeResult, kinds: Iterable[str], wish: Wish, *, strict: bool
) -> tuple[dict[str, Figure], dict[str, str]]:
    """Draw several charts; where not `strict`, those that cannot be drawn are named with the reason.

    Raises
    ------
    InputError
        As `draw`; or none can be drawn.
    """
    if isinstance(result, Result) and result.sort != "suite" and not result.wide:
        raise InputError(
            f"{result.path}: no chart can be drawn: it has no axis of two values or more (its dimensions: "
            f"{', '.join(f'{dim}, {values.size}' for dim, values in result.axes.items()) or 'none'})"
        )
    if isinstance(result, Result):
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


def levels_of(result: Result | WholeResult, name: str, levels: Sequence[float | str]) -> tuple[float, ...]:
    """Contour levels in a variable's own unit, in order; under a suite the displacements to exceed.

    Raises
    ------
    InputError
        One is no number with a unit of the result, or not above zero.
    """
    own = RESULTS.get(name, {}).get("units") == "m"
    found = [
        quantity("levels", one, "displacement_amplitude" if own else "mu_s", result.g)
        if isinstance(one, str)
        else float(one)
        for one in levels
    ]
    for level in found:
        if not 0 < level < float("inf"):
            raise InputError(f"levels: {level:g}: must be > 0")
    if len(set(found)) == 1 and not (isinstance(result, Result) and result.sort == "suite"):
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
        raise InputError(f"{result.path}: case: the cases have no order; use them for curves (--y) or panels")
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
        raise InputError(f"{result.path}: {x} = {at[x]}: is an axis of this chart; it cannot have one value")
    if y:
        keep[y] = result.members(y, _CURVES, at) if family else result.thinned(y)
    for name in panels:
        keep[name] = result.members(name, _PANELS, at)
    for name in (*panels, *([y] if y and family else [])):
        at.pop(name, None)
    across, down, *_ = (*panels, None, None)
    return Sheet(result.select(names, keep, at), x, y, wish.look, across, down, wish.axes)


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
    if chosen == x or (chosen is not None and chosen not in (*free, *NAMED)):
        raise InputError(f"{result.path}: --y {chosen}: must be another axis that {variable} has, and that is not cut")
    return x, chosen


# ------------------------------------------------------------------- under recorded motions


def _recorded(result: Result, wish: Wish, x: str, *, y: str | None = None, more: Sequence[str] = ()) -> Sheet:
    """The slice of a chart of recorded motions: those of a suite stay, all of them but where some are asked for."""
    names = [result.result(name) for name in ("permanent_displacement", "validity", *more)]
    suite = [dim for dim in suite_figures.SUITE if dim in result.axes] if result.sort == "suite" else []
    chosen: dict[str, Any] = {dim: places for dim, places in result.places(wish.at).items() if dim in suite}
    others = {name: cut for name, cut in wish.at.items() if name not in suite}
    also = {dim: chosen.get(dim, slice(None)) for dim in suite}
    return _sheet(result, replace(wish, at=others), names, x, y, family=y is not None, also=also)


def _record_axis(result: Result, wish: Wish) -> str:
    """What a chart of recorded motions is drawn over: how strong they are, else the yield acceleration, or any axis."""
    dims = result.dims(result.result("permanent_displacement"))
    free = [dim for dim in _free(result, wish, dims) if dim != wish.y and dim not in suite_figures.SUITE]
    preferred = (*STRENGTHS, "yield_acceleration", "yield_coefficient", *free)
    x = result.axis(wish.x) if wish.x else next((dim for dim in preferred if dim in free), None)
    if x is None or x not in free:
        raise InputError(
            f"{result.path}: --x {x}: must be an axis of two values or more that --at does not cut: "
            f"{', '.join(free) or 'there is none'}"
        )
    return x


def _check_no_family(result: Result, wish: Wish, kind: str) -> None:
    if wish.y is not None:
        raise InputError(f"{result.path}: --y {wish.y}: not with {kind} of a suite; --panels draws panels over an axis")


def _motions(result: Result, wish: Wish) -> Figure:
    x = _record_axis(result, wish)
    if result.sort == "suite":
        _check_no_family(result, wish, "motions")
        beside = [name for name in ("newmark_displacement",) if name in result.variables]
        return suite_figures.motions(_recorded(result, wish, x, more=beside))
    dims = result.dims("permanent_displacement")
    free = [dim for dim in (*_several(result, wish), *_free(result, wish, dims)) if dim != x]
    family = result.axis(wish.y) if wish.y else next(iter(free), None)
    if family == x:
        raise InputError(f"{result.path}: --y {family}: must be an axis other than {x}")
    return suite_figures.curves(_recorded(result, wish, x, y=family))


def _intensity(result: Result, wish: Wish) -> Figure:
    _check_no_family(result, wish, "intensity")
    measures = [name for name in INTENSITY_MEASURES if f"motion_{name}" in result.coordinates]
    default = "arias_intensity" if "pgv" in result.axes else "pgv"
    measure = wish.x or default
    if measure not in measures:
        raise InputError(
            f"{result.path}: --x {measure}: must be an intensity measure of the motions: "
            f"{', '.join(measures) or 'the file has none'}"
        )
    factor = [] if "scale" in result.coordinates else ["motion_factor"]
    return suite_figures.intensity(_recorded(result, wish, "motion", more=factor), measure)


def _histogram(result: Result, wish: Wish) -> Figure:
    _check_no_family(result, wish, "histogram")
    if wish.x is not None:
        raise InputError(f"{result.path}: --x {wish.x}: not with histogram, which is drawn over the displacement")
    return suite_figures.histogram(_recorded(result, wish, "motion"))


def _suite_fragility(result: Result, wish: Wish) -> Figure:
    _check_no_family(result, wish, "fragility")
    sheet = _recorded(result, wish, _record_axis(result, wish))
    return suite_figures.fragility(sheet, wish.look.levels or _THRESHOLDS)


# ----------------------------------------------------------------------- of uncertain inputs


def _fragility(result: Result, wish: Wish) -> Figure:
    if result.sort == "suite":
        return _suite_fragility(result, wish)
    if wish.look.levels:
        raise InputError(f"{result.path}: levels: not with statistics, whose thresholds are those in the file")
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
        raise InputError(f"{result.path}: --y {wish.y}: not with sensitivity, whose curve parameter is the input")
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
    "motions": _motions,
    "intensity": _intensity,
    "histogram": _histogram,
}

#: Those of a sweep under harmonic motion, of statistics, and of a sweep under recorded motions.
SORTS: dict[str, tuple[str, ...]] = {
    "sweep": ("contours", "modes", "families", "dimensionless", "newmark", "spread"),
    "statistics": ("fragility", "quantiles", "sensitivity"),
    "suite": ("motions", "fragility", "intensity", "histogram"),
    "record": ("motions",),
}

#: What a result is, in messages.
_SORT_TEXT = {
    "sweep": "a sweep under harmonic motion",
    "statistics": "statistics of displacements",
    "suite": "a sweep under a suite of motions",
    "record": "a sweep under a recorded motion",
    "history": "a time history",
    "limit": "limit amplitudes",
    "friction": "measured friction",
    "calibration": "a calibration",
    "hazard": "annual rates",
}
