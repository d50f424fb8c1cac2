"""The kinds of charts: over which axes each is drawn by default, and how it is made from a slice.

The command line and `Dataset.slipsweep.chart` both come here.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts import curves, maps, sensitivity_figures, suite_figures, uncertainty_figures, whole
from slipsweep.charts.answers import DISPLACEMENT, DRIVES
from slipsweep.charts.sheet import Sheet
from slipsweep.charts.slices import NAMED, Kept, Result, spread
from slipsweep.charts.style import Look, figure_width
from slipsweep.errors import InputError, did_you_mean
from slipsweep.files.selection import At
from slipsweep.model.units import quantity
from slipsweep.model.variables import INTENSITY_MEASURES, PARAMETERS, RESULTS, STRENGTHS

#: Most curves of a family, frequencies shown to collapse, and panels across and down, that a page can show.
_CURVES, _FREQUENCIES, _PANELS = 6, 3, 3

_CODES = ("sliding_mode", "validity")

#: Displacements of a fragility under a suite where none are requested, m.
_THRESHOLDS = (0.01, 0.1, 1.0)

#: Inputs that charts of a sweep need, or A = ω²d, or Newmark's yield coefficient.
_BLOCK, _SHAKEN_BLOCK = ("theta", "mu_s", "amplitude"), ("theta", "mu_s", "amplitude", "frequency")


@dataclass(frozen=True)
class Request:
    """What is requested of a chart.

    Attributes
    ----------
    x, y : str, optional
        Axis to draw over; vertical axis of a map, or the curve parameter.
    at : mapping of axis name to value
        Where to cut other axes; several values select curves or panels.
    variable : str
        What contours and families show.
    panels : sequence of str
        Axes that panels lie along, across and down.
    more_panels : bool
        Panels lie along axes that would be cut otherwise.
    axes : Axes, optional
        What to draw the one panel of a chart in, instead of a new figure.
    look : Look
    """

    x: str | None = None
    y: str | None = None
    at: Mapping[str, At] = field(default_factory=dict)
    variable: str = DISPLACEMENT
    panels: Sequence[str] = ()
    more_panels: bool = False
    axes: Axes | None = None
    look: Look = field(default_factory=Look)


Drawn = Result | whole.WholeResult


def drawable(data: xr.Dataset, name: str | Path) -> Drawn:
    """What can be drawn of a dataset: slices of a result, or one chart of the whole (InputError if neither)."""
    kind = next((kind for kind, (variable, _) in whole.DRAWN_WHOLE.items() if variable in data), None)
    return Result(data, str(name)) if kind is None else whole.WholeResult(data, str(name), kind)


def check_kind(kind: str) -> str:
    """`kind` if there is such a chart (InputError otherwise)."""
    known = (*KINDS, *whole.DRAWN_WHOLE)
    if kind not in known:
        raise InputError(f"--kind {kind}: no such chart; {did_you_mean(kind, known)}")
    return kind


def fitting(result: Drawn, request: Request) -> tuple[str, ...]:
    """The kinds that are drawn of a result if none is named; with one axis left, its curve."""
    if isinstance(result, whole.WholeResult):
        return (result.kind,)
    kinds = SORTS[result.sort]
    if result.sort == "sweep":
        free = [dim for dim in result.groups if dim not in (*request.at, *request.panels)]
        several = any(len(places) > 1 for places in result.places(request.at).values())
        if DISPLACEMENT in result.variables and len(free) == 1:
            return ("families",) if several or request.panels else ("curve",)
        unfit = {"curve"}
        if result.is_newmark:  # the ratio is 1, and without θ and μs there are no other options
            unfit |= {"newmark", *(["spread"] if "yield_coefficient" in result.data.coords else [])}
        if DISPLACEMENT not in result.variables:
            unfit = {*kinds} - {"modes"}
        return tuple(kind for kind in kinds if kind not in unfit)
    return tuple(kind for kind in kinds if kind != "sensitivity" or "total_index" in result.variables)


def draw(result: Drawn, kind: str | None, request: Request) -> Figure:
    """Draw one chart of a result, the first of those that fit if none is named.

    Raises
    ------
    InputError
        The chart cannot be drawn of it, or what is requested is not there.
    """
    if len(request.panels) > 2:
        raise InputError(f"--panels {','.join(request.panels)}: must be one axis or two")
    kind = fitting(result, request)[0] if kind is None else check_kind(kind)
    allowed = (result.kind,) if isinstance(result, whole.WholeResult) else SORTS[result.sort]
    if kind not in allowed:
        what = _SORT_TEXT[result.kind if isinstance(result, whole.WholeResult) else result.sort]
        one_of = "one of " if len(allowed) > 1 else ""
        raise InputError(f"{result.name}: --kind {kind}: is {what}: must be {one_of}{', '.join(allowed)}")
    with mpl.rc_context({"font.size": request.look.font}):
        if isinstance(result, Result):
            return KINDS[kind](result, request)
        given = {"--at": request.at, "--x": request.x, "--y": request.y, "--panels": request.panels,
                 "--levels": request.look.levels}  # fmt: skip
        for option, value in given.items():
            if value:
                raise InputError(f"{result.name}: {option}: not with {kind}, which is drawn as a whole")
        return result.draw(request.axes, request.look)


def draw_all(
    result: Drawn, kinds: Iterable[str], request: Request, *, strict: bool
) -> tuple[dict[str, Figure], dict[str, str]]:
    """Draw several charts; where not `strict`, those that cannot be drawn are named with the reason.

    Raises
    ------
    InputError
        As `draw`; or none can be drawn.
    """
    if isinstance(result, Result):
        if result.sort != "suite" and not result.wide:
            sizes = ", ".join(f"{dim}, {result.data.sizes[dim]}" for dim in result.dims) or "none"
            raise InputError(
                f"{result.name}: no chart can be drawn: it has no axis of two values or more (its dimensions: {sizes})"
            )
        result.places(request.at)
    figures: dict[str, Figure] = {}
    left_out: dict[str, str] = {}
    for kind in kinds:
        try:
            figures[kind] = draw(result, kind, request)
        except InputError as error:
            if strict:
                raise
            left_out[kind] = str(error).removeprefix(f"{result.name}: ")
    if not figures:
        reasons = "; ".join(dict.fromkeys(left_out.values()))
        raise InputError(f"{result.name}: no chart can be drawn from it: {reasons}")
    return figures, left_out


def look_of(
    result: Drawn, variable: str, levels: Sequence[float | str], units: Any, show_cautions: bool,
    width: float | str | None, grey: bool,
) -> Look:  # fmt: skip
    """What a reader chooses about charts, checked.

    Levels are contours in a variable's own unit, in order; under a suite the displacements to exceed.

    Raises
    ------
    InputError
        A level is no number with a unit of the result, or not above zero; no figure can be so wide.
    """
    own = "m" if RESULTS.get(variable, {}).get("units") == "m" else "1"
    g = float(result.data.attrs.get("g", 9.81))
    found = [quantity("levels", one, own, g) if isinstance(one, str) else float(one) for one in levels]
    for level in found:
        if not 0 < level < float("inf"):
            raise InputError(f"levels: {level:g}: must be > 0")
    if len(set(found)) == 1 and not (isinstance(result, Result) and result.sort == "suite"):
        raise InputError(f"levels: {', '.join(map(str, levels))}: must be two different values or more")
    return Look(units, show_cautions, tuple(sorted(set(found))), figure_width(width), grey)


# ------------------------------------------------------------------------------ the axes


def _several(result: Result, request: Request) -> list[str]:
    """Axes of which several values are requested: they tell curves apart, or panels."""
    return [dim for dim, found in result.places(request.at).items() if len(found) > 1 and dim not in request.panels]


def _free(result: Result, request: Request, variable: str) -> list[str]:
    """Axes that a chart of a result may be drawn over."""
    dims = result.data[result.result(variable)].dims
    return [d for d in result.wide if d in PARAMETERS and d in dims and d not in (*request.panels, *request.at)]


def _axis(
    result: Result, request: Request, variable: str, option: str, preferred: Sequence[str], taken: str | None = None
) -> str:
    """The axis that an option names, or the first of those preferred, or any, that is left for it."""
    given = {"x": request.x, "y": request.y}[option]
    free = _free(result, request, variable)
    if given is not None:
        result.axis(given)
        if given == taken:
            raise InputError(f"--x {request.x} --y {request.y}: must be two different axes")
        dims = [str(dim) for dim in result.data[variable].dims]
        if given not in PARAMETERS and given not in NAMED:
            raise InputError(
                f"{result.name}: --{option} {given}: must be a parameter: {', '.join(free) or 'none left'}"
            )
        if given not in dims:
            raise InputError(
                f"{result.name}: {given}: {variable} does not vary along it; it varies along {', '.join(dims)}"
            )
        return given
    others = [dim for dim in free if dim not in (taken, request.x, request.y)]
    found = next((dim for dim in (*preferred, *others) if dim in others), None)
    if found is None:
        needed = "one axis" if taken is None and option == "x" else "two axes"
        fixed = f" --at fixes {', '.join(request.at)}." if request.at else ""
        raise InputError(
            f"{result.name}: this chart needs {needed} with two values or more; "
            f"{variable} has {', '.join(free) or 'none'} left.{fixed}"
        )
    return found


def _map_axes(result: Result, request: Request, variable: str, x: Sequence[str]) -> tuple[str, str]:
    up = _axis(result, request, variable, "y", DRIVES, request.x)
    across = _axis(result, request, variable, "x", x, up)
    if "case" in (across, up):
        raise InputError(f"{result.name}: case: the cases have no order; use them for curves (--y) or panels")
    return across, up


def _sheet(
    result: Result, request: Request, names: Sequence[str], x: str, y: str | None, *, family: bool = False,
    also: Mapping[str, Kept] | None = None, same: Sequence[str] = (),
) -> Sheet:  # fmt: skip
    """The slice of a chart, in panels.

    `family` says that `y` tells curves apart, `also` what else is kept, `same` along what the chart does not vary.
    """
    dims = [str(dim) for dim in result.data[names[0]].dims]
    taken = (x, y, *(also or {}))
    for name in request.panels:
        if result.axis(name) in taken or list(request.panels).count(name) > 1:
            raise InputError(f"--panels {name}: must be an axis that the chart is not drawn over, and be given once")
        if name not in dims:
            raise InputError(f"{result.name}: --panels {name}: the result does not vary along it")
    panels = list(request.panels) or [dim for dim in _several(result, request) if dim not in taken]
    if request.more_panels and not panels:
        panels = [dim for dim in dims if dim in result.groups and dim not in (*taken, *same, *request.at)]
    panels = panels[:2]
    at = dict(request.at)
    if x in at:
        raise InputError(f"{result.name}: {x} = {at[x]}: is an axis of this chart; it cannot have one value")
    keep: dict[str, Any] = {x: result.thinned(x), **(also or {})}
    if y and not family and y in at:
        raise InputError(f"{result.name}: {y} = {at[y]}: is an axis of this chart; it cannot have one value")
    if y:
        keep[y] = result.members(y, _CURVES, at) if family else result.thinned(y)
    for name in panels:
        keep[name] = result.members(name, _PANELS, at)
    at = {name: value for name, value in at.items() if name not in (*panels, y)}
    across, down, *_ = (*panels, None, None)
    return Sheet(result.select(names, keep, at), x, y, request.look, across, down, request.axes)


def _check_no_family(result: Result, request: Request, kind: str) -> None:
    if request.y is not None:
        raise InputError(f"{result.name}: --y {request.y}: not with {kind}, drawn over one axis, --x; use --panels")


# ----------------------------------------------------------------------- of a sweep


def _names(result: Result, name: str) -> list[str]:
    """The results that a chart of one of them reads, with Newmark's displacement if the file has it."""
    beside = ["newmark_displacement"] if name == DISPLACEMENT and "newmark_displacement" in result.variables else []
    return [result.result(name), "validity", *beside]


def _quantity(result: Result, name: str) -> str:
    result.result(name)
    if name in _CODES:
        raise InputError(f"{result.name}: --variable {name}: is a code, not a quantity; --kind modes shows the modes")
    return name


def _same(result: Result) -> list[str]:
    """With the amplitude given, modes and ratios of displacements do not depend on the frequency."""
    return ["frequency"] if "displacement_amplitude" not in result.data.coords else []


def _contours(result: Result, request: Request) -> Figure:
    name = _quantity(result, request.variable)
    x, y = _map_axes(result, request, name, ("frequency", "theta", "mu_s"))
    result.require(*_SHAKEN_BLOCK)
    return maps.contours(_sheet(result, request, _names(result, name), x, y), name)


def _modes(result: Result, request: Request) -> Figure:
    x, y = _map_axes(result, request, "sliding_mode", ("theta", "yield_coefficient", "mu_s", "frequency"))
    result.require(*_BLOCK)
    return maps.modes(_sheet(result, request, ["sliding_mode", "validity"], x, y, same=_same(result)))


def _newmark(result: Result, request: Request) -> Figure:
    if result.is_newmark:
        raise InputError(f"{result.name}: the result is of Newmark's block itself: the ratio is 1 everywhere")
    x, y = _map_axes(result, request, DISPLACEMENT, ("theta", "mu_s", "frequency"))
    result.require(*_SHAKEN_BLOCK)
    return maps.newmark_ratio(_sheet(result, request, _names(result, DISPLACEMENT), x, y, same=_same(result)))


def _families(result: Result, request: Request) -> Figure:
    name = _quantity(result, request.variable)
    several = _several(result, request)[:1]
    if several and request.y is None and several[0] != request.x:
        y = several[0]
    else:
        y = _axis(result, request, name, "y", ("frequency", "yield_coefficient", "mu_s", "theta"), request.x or "")
    x = _axis(result, request, name, "x", DRIVES, y)
    result.require(*_SHAKEN_BLOCK)
    return curves.families(_sheet(result, request, _names(result, name), x, y, family=True), name)


def _curve(result: Result, request: Request) -> Figure:
    name = _quantity(result, request.variable)
    _check_no_family(result, request, "curve")
    x = _axis(result, request, name, "x", (*DRIVES, "yield_coefficient", "frequency"))
    result.require(*_SHAKEN_BLOCK)
    return curves.families(_sheet(result, request, _names(result, name), x, None), name)


def _spread(result: Result, request: Request) -> Figure:
    _check_no_family(result, request, "spread")
    x = _axis(result, request, DISPLACEMENT, "x", DRIVES)
    if "yield_coefficient" in result.data.coords:
        raise InputError(f"{result.name}: the result has ky alone: other options of the model need theta and mu_s")
    result.require(*_SHAKEN_BLOCK)
    return curves.spread(_sheet(result, request, _names(result, DISPLACEMENT), x, None))


def _dimensionless(result: Result, request: Request) -> Figure:
    if request.x not in (None, *DRIVES):
        raise InputError(f"{result.name}: --x {request.x}: the dimensionless chart is drawn over A / Üy")
    drive = result.axis(next((d for d in reversed(DRIVES) if d in result.dims), "amplitude"))
    also: dict[str, Kept] = {}
    free = _free(result, request, DISPLACEMENT)
    if "frequency" in free:
        also["frequency"] = spread(result.data.sizes["frequency"], _FREQUENCIES)
    preferred = ("mu_s", "theta", "yield_acceleration", "yield_coefficient")
    family = result.axis(request.y) if request.y else next((d for d in preferred if d in free), None)
    if family is None and (several := [d for d in _several(result, request) if d not in also]):
        family = several[0]
    if family in (drive, *also):
        raise InputError(f"{result.name}: --y {family}: must be an axis other than {', '.join((drive, *also))}")
    result.require(*_SHAKEN_BLOCK)
    names = _names(result, DISPLACEMENT)
    return curves.dimensionless(_sheet(result, request, names, drive, family, family=True, also=also))


# ------------------------------------------------------------------- under recorded motions


def _recorded(result: Result, request: Request, x: str, *, y: str | None = None, more: Sequence[str] = ()) -> Sheet:
    """The slice of a chart of recorded motions: those of a suite stay, all of them but where some are requested."""
    names = [result.result(name) for name in (DISPLACEMENT, "validity", *more)]
    suite = [dim for dim in suite_figures.SUITE if dim in result.dims] if result.sort == "suite" else []
    chosen: dict[str, Any] = {dim: places for dim, places in result.places(request.at).items() if dim in suite}
    others = {name: cut for name, cut in request.at.items() if name not in suite}
    also = {dim: chosen.get(dim, slice(None)) for dim in suite}
    return _sheet(result, replace(request, at=others), names, x, y, family=y is not None, also=also)


def _record_axis(result: Result, request: Request) -> str:
    """What a chart of recorded motions is drawn over: how strong they are, else Üy or ky, or any axis."""
    x = _axis(result, request, DISPLACEMENT, "x", (*STRENGTHS, "yield_acceleration", "yield_coefficient"))
    if x in suite_figures.SUITE:
        raise InputError(f"{result.name}: --x {x}: must be an axis other than {', '.join(suite_figures.SUITE)}")
    return x


def _beside(result: Result) -> list[str]:
    return ["newmark_displacement"] if "newmark_displacement" in result.variables else []


def _motions(result: Result, request: Request) -> Figure:
    if result.sort == "suite":
        _check_no_family(result, request, "motions of a suite")
        return suite_figures.motions(_recorded(result, request, _record_axis(result, request), more=_beside(result)))
    x = _record_axis(result, replace(request, y=None) if request.x else request)
    free = [d for d in (*_several(result, request), *_free(result, request, DISPLACEMENT)) if d not in (x, "polarity")]
    family = result.axis(request.y) if request.y else next(iter(free), None)
    if family == x:
        raise InputError(f"{result.name}: --y {family}: must be an axis other than {x}")
    return suite_figures.curves(_recorded(result, request, x, y=family, more=_beside(result)))


def _intensity(result: Result, request: Request) -> Figure:
    _check_no_family(result, request, "intensity")
    measures = [name for name in INTENSITY_MEASURES if f"motion_{name}" in result.data.coords]
    measure = request.x or ("arias_intensity" if "pgv" in result.dims else "pgv")
    if measure not in measures:
        raise InputError(
            f"{result.name}: --x {measure}: must be an intensity measure of the motions: "
            f"{', '.join(measures) or 'the file has none'}"
        )
    factor = [] if "scale" in result.data.coords else ["motion_factor"]
    return suite_figures.intensity(_recorded(result, request, "motion", more=factor), measure)


def _histogram(result: Result, request: Request) -> Figure:
    _check_no_family(result, request, "histogram")
    if request.x is not None:
        raise InputError(f"{result.name}: --x {request.x}: not with histogram, which is drawn over the displacement")
    return suite_figures.histogram(_recorded(result, request, "motion"))


# ----------------------------------------------------------------------- of uncertain inputs


def _fragility(result: Result, request: Request) -> Figure:
    if result.sort == "suite":
        _check_no_family(result, request, "fragility of a suite")
        sheet = _recorded(result, request, _record_axis(result, request))
        return suite_figures.fragility(sheet, request.look.levels or _THRESHOLDS)
    if request.look.levels:
        raise InputError(f"{result.name}: levels: not with statistics, whose thresholds are those in the file")
    result.result("valueless_share")
    result.require("threshold")
    x = _axis(result, request, "exceedance_probability", "x", (*DRIVES, *STRENGTHS))
    free = [*_free(result, request, "exceedance_probability"), "threshold", *NAMED, *_several(result, request)]
    several = "threshold" in result.wide and "threshold" not in request.at
    family = request.y or ("threshold" if several else next(iter(_several(result, request)), None))
    if family == x or (family is not None and result.axis(family) not in free):
        raise InputError(f"{result.name}: --y {family}: must be another axis that --at does not fix")
    names = ["exceedance_probability", "valueless_share"]
    return uncertainty_figures.fragility(_sheet(result, request, names, x, family, family=True))


def _quantiles(result: Result, request: Request) -> Figure:
    _check_no_family(result, request, "quantiles")
    result.result("valueless_share")
    result.require("quantile")
    x = _axis(result, request, "displacement_quantile", "x", (*DRIVES, *STRENGTHS))
    names = ["displacement_quantile", "valueless_share"]
    return uncertainty_figures.quantile_bands(_sheet(result, request, names, x, None, also={"quantile": slice(None)}))


def _sensitivity(result: Result, request: Request) -> Figure:
    if "total_index" not in result.variables:
        raise InputError(f"{result.name}: holds no Sobol indices; sensitivity = true in [uncertainty] computes them")
    _check_no_family(result, request, "sensitivity")
    names = sensitivity_figures.NAMES
    keep: dict[str, Kept] = {"bound": slice(None)}
    if request.x is None and not _free(result, request, "total_index"):
        return sensitivity_figures.bars(_sheet(result, request, names, "input", None, also=keep))
    x = _axis(result, request, "total_index", "x", (*DRIVES, *STRENGTHS))
    return sensitivity_figures.curves(_sheet(result, request, names, x, None, also={**keep, "input": slice(None)}))


KINDS: dict[str, Callable[[Result, Request], Figure]] = {
    "contours": _contours,
    "modes": _modes,
    "families": _families,
    "curve": _curve,
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
    "sweep": ("contours", "modes", "families", "curve", "dimensionless", "newmark", "spread"),
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
