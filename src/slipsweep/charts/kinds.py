"""The kinds of charts: which results have them, and what draws each.

The command line and `Dataset.slipsweep.chart` both come here.
"""

from collections.abc import Callable, Iterable
from typing import Any

import matplotlib as mpl
import xarray as xr
from matplotlib.figure import Figure

from slipsweep.charts import curves, histories, limits, maps, statistics, suites
from slipsweep.charts.slices import Result
from slipsweep.charts.solved import DISPLACEMENT, is_newmark
from slipsweep.charts.style import Options
from slipsweep.errors import InputError, did_you_mean

Draw = Callable[[Result, Options], Figure]

#: Of each sort of result: what it is called in messages, and its charts, of the kinds that their functions' names say.
SORTS: dict[str, tuple[str, tuple[Draw, ...]]] = {
    "sweep": (
        "a sweep under harmonic motion",
        (maps.contours, maps.modes, curves.families, curves.curve, curves.dimensionless, maps.newmark, curves.spread),
    ),
    "statistics": ("statistics of displacements", (statistics.fragility, statistics.quantiles, statistics.sensitivity)),
    "suite": (
        "a sweep under a suite of motions", (suites.motions, suites.fragility, suites.intensity, suites.histogram)
    ),
    "record": ("a sweep under a recorded motion", (curves.motions,)),
    "history": ("a time history", (histories.history,)),
    "limit": ("limit amplitudes", (limits.limit,)),
    "friction": ("measured friction", (histories.friction,)),
    "calibration": ("a calibration", (histories.calibration,)),
    "hazard": ("annual rates", (limits.hazard,)),
}  # fmt: skip

#: What results that are drawn whole have no choice of.
_CHOICES = ("at", "x", "y", "panels", "levels")


def kinds_of(sort: str) -> dict[str, Draw]:
    """The kinds of charts of a sort of result, in order."""
    return {function.__name__: function for function in SORTS[sort][1]}


def check_kind(kind: str) -> str:
    """`kind` if there is such a chart (InputError otherwise)."""
    known = [name for sort in SORTS for name in kinds_of(sort)]
    if kind not in known:
        raise InputError(f"--kind {kind}: no such chart; {did_you_mean(kind, known)}")
    return kind


def fitting(result: Result, options: Options) -> list[str]:
    """The kinds that are drawn of a result if none is named; with one axis left, its curve."""
    kinds = [*kinds_of(result.sort)]
    if result.sort == "statistics" and "total_index" not in result.variables:
        kinds.remove("sensitivity")
    if result.sort != "sweep":
        return kinds
    if DISPLACEMENT not in result.variables:
        return ["modes"]
    free = [dim for dim in result.groups if dim not in (*options.at, *options.panels)]
    if len(free) == 1:
        several = any(len(places) > 1 for places in result.places(options.at).values())
        return ["families"] if several or options.panels else ["curve"]
    unfit = {"curve"}
    if is_newmark(result.data):  # the ratio is 1, and without θ and μs there are no other options
        unfit |= {"newmark", *(["spread"] if "yield_coefficient" in result.data.coords else [])}
    return [kind for kind in kinds if kind not in unfit]


def draw(result: Result, kind: str | None, options: Options) -> Figure:
    """Draw one chart of a result, the first of those that fit if none is named (InputError if it cannot be drawn)."""
    kinds = kinds_of(result.sort)
    kind = fitting(result, options)[0] if kind is None else check_kind(kind)
    if kind not in kinds:
        one_of = "one of " if len(kinds) > 1 else ""
        raise InputError(
            f"{result.name}: --kind {kind}: is {SORTS[result.sort][0]}: must be {one_of}{', '.join(kinds)}"
        )
    for name in _CHOICES if not result.dims else ():
        if getattr(options, name):
            raise InputError(f"{result.name}: --{name}: not with {kind}, which is drawn as a whole")
    with mpl.rc_context({"font.size": options.font}):
        try:
            return kinds[kind](result, options)
        except KeyError as error:
            if result.dims:
                raise
            raise InputError(f"{result.name}: {error.args[0]}: not there, but {kind} needs it") from None


def figure_of(data: xr.Dataset, name: str = "dataset", kind: str | None = None, **chosen: Any) -> Figure:
    """Draw a chart of a dataset: the options are those of `SlipsweepAccessor.chart`."""
    return draw(Result(data, name), kind, Options(**chosen))


def draw_all(
    result: Result, kinds: Iterable[str], options: Options, *, strict: bool
) -> tuple[dict[str, Figure], dict[str, str]]:
    """Draw several charts; where not `strict`, those that cannot be drawn are named with the reason.

    InputError as `draw`, or if none can be drawn.
    """
    result.places(options.at)
    figures: dict[str, Figure] = {}
    left_out: dict[str, str] = {}
    for kind in kinds:
        try:
            figures[kind] = draw(result, kind, options)
        except InputError as error:
            if strict:
                raise
            left_out[kind] = str(error).removeprefix(f"{result.name}: ")
    if not figures:
        reasons = "; ".join(dict.fromkeys(left_out.values()))
        raise InputError(f"{result.name}: no chart can be drawn from it: {reasons}")
    return figures, left_out
