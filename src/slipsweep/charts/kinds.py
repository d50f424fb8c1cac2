"""The kinds of charts: which result has which, one of them drawn, all of them as one PDF."""

import io
import textwrap
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import xarray as xr
from matplotlib.figure import Figure

from slipsweep._version import __version__
from slipsweep.charts import (
    curves,
    equations,
    histories,
    limits,
    maps,
    statistics,
    style,
    suites,
)
from slipsweep.charts.slices import Result
from slipsweep.charts.style import Options
from slipsweep.errors import InputError, did_you_mean
from slipsweep.files.opening import values_text
from slipsweep.files.selection import At, own_names
from slipsweep.model.options import MODELS, changing_strength
from slipsweep.model.variables import PARAMETERS, Validity, has_signed_displacements
from slipsweep.studies.cautions import LEFT_OUT, unsound_texts
from slipsweep.studies.solved_again import DISPLACEMENT, is_newmark, is_recorded

Draw = Callable[[Result, Options], Figure]

#: The name of each sort of result in messages, and its charts.  The name of a chart's function is
#: its kind.
SORTS: dict[str, tuple[str, tuple[Draw, ...]]] = {
    "sweep": (
        "a sweep under harmonic motion",
        (
            maps.contours,
            maps.modes,
            curves.families,
            curves.curve,
            curves.dimensionless,
            maps.newmark,
            curves.spread,
        ),
    ),
    "statistics": (
        "statistics of displacements",
        (statistics.fragility, statistics.quantiles, statistics.sensitivity),
    ),
    "suite": (
        "a sweep under a suite of motions",
        (suites.motions, suites.fragility, suites.intensity, suites.histogram),
    ),
    "record": ("a sweep under a recorded motion", (curves.motions,)),
    "history": ("a time history", (histories.history,)),
    "limit": ("limit amplitudes", (limits.limit,)),
    "strength": ("required strengths", (limits.strength,)),
    "friction": ("measured friction", (histories.friction,)),
    "calibration": ("a calibration", (histories.calibration,)),
    "hazard": ("annual rates", (limits.hazard,)),
}


#: Flags that charts hatch and Newmark's block can raise.
_NEWMARK_FLAGS = (Validity.STATICALLY_UNSTABLE, Validity.FLEXIBLE_BLOCK)

#: Flags that it raises only where its strength changes while it slides.
_STRENGTH_FLAGS = (Validity.MAY_NOT_STOP, Validity.NOT_AT_REST)


def kinds_of(sort: str) -> dict[str, Draw]:
    """Return the kinds of charts of a sort of result, in order."""
    return {function.__name__: function for function in SORTS[sort][1]}


def check_kind(kind: str) -> str:
    """Return `kind` if there is such a chart (InputError otherwise)."""
    kinds = [name for sort in SORTS for name in kinds_of(sort)]
    if kind not in kinds:
        raise InputError(f"--kind {kind}: no such chart; {did_you_mean(kind, kinds)}")
    return kind


def fitting(result: Result, options: Options) -> list[str]:
    """Return the kinds to draw of a result if none is named; with one axis left, its curve."""
    result.check_axes()
    kinds = kinds_of(result.sort)
    if options.equations and (drawn := [kind for kind in kinds if kind in equations.KINDS]):
        return drawn
    if result.sort != "sweep":
        return [
            kind for kind in kinds if kind != "sensitivity" or "total_index" in result.variables
        ]
    if DISPLACEMENT not in result.variables:
        return ["modes"]
    free = [dim for dim in result.groups if dim not in (*options.at, *options.panels)]
    if len(free) == 1:
        several = any(len(places) > 1 for places in result.places(options.at).values())
        return ["families"] if several or options.panels else ["curve"]
    unfit = {"curve"}
    if is_newmark(result.data):  # the ratio is 1, and without θ and μs there are no other options
        unfit |= {"newmark"}
        if "yield_coefficient" in result.data.coords or has_signed_displacements(result.attrs):
            unfit |= {"spread"}
    return [kind for kind in kinds if kind not in unfit]


def draw(result: Result, kind: str | None, options: Options) -> Figure:
    """Draw one chart of a result, by default the first that fits.

    InputError: the chart cannot be drawn of this result.
    """
    kinds = kinds_of(result.sort)
    kind = fitting(result, options)[0] if kind is None else check_kind(kind)
    if kind not in kinds:
        allowed = f"{'one of ' if len(kinds) > 1 else ''}{', '.join(kinds)}"
        raise InputError(
            f"{result.name}: --kind {kind}: is {SORTS[result.sort][0]}: must be {allowed}"
        )
    if options.equations and (kind not in equations.KINDS or options.variable != DISPLACEMENT):
        drawn = f"--kind {', '.join(equations.KINDS)}, of {DISPLACEMENT}"
        raise InputError(f"{result.name}: --equations: not with --kind {kind}: only with {drawn}")
    for name in ("at", "x", "y", "panels", "levels"):
        if getattr(options, name) and not result.dims:
            raise InputError(f"{result.name}: --{name}: not with {kind}, which is drawn as a whole")
    result.check_axes()
    with mpl.rc_context({"font.size": options.font}):
        try:
            return kinds[kind](result, options)
        except KeyError as error:
            if result.dims:
                raise
            raise InputError(
                f"{result.name}: {error.args[0]}: not there, but {kind} needs it"
            ) from None


def figure_of(
    data: xr.Dataset, kind: str | None = None, at: Mapping[str, At] | None = None, **chosen: Any
) -> Figure:
    """Draw a chart of a dataset: the options are those of `SlipsweepAccessor.chart`."""
    return draw(Result(data, "dataset"), kind, Options(at=own_names(data, at or {}), **chosen))


def draw_all(
    result: Result, kinds: Iterable[str], options: Options, *, strict: bool
) -> tuple[dict[str, Figure], dict[str, str]]:
    """Draw several charts; return them, and the reasons why others cannot be drawn.

    InputError: as `draw`, if `strict`; or none can be drawn.
    """
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
        raise InputError(
            f"{result.name}: no chart can be drawn from it: "
            f"{'; '.join(dict.fromkeys(left_out.values()))}"
        )
    return figures, left_out


def save(figure: Figure, path: Path, ending: str) -> None:
    """Write a figure in the format of an ending."""
    content = io.BytesIO()  # to memory: matplotlib leaves a traceback where a disk is full
    figure.savefig(content, format=ending[1:], dpi=150)
    path.write_bytes(content.getvalue())


def write_book(path: Path, result: Result, figures: Iterable[Figure]) -> None:
    """Write a title page and some charts as pages of one PDF."""
    from matplotlib.backends.backend_pdf import PdfPages  # here: other charts do without it

    content = io.BytesIO()  # as in `save`
    about = {"Title": str(result.attrs.get("title", "")), "Creator": "slipsweep"}
    with PdfPages(content, metadata=about) as pages:
        for figure in (title_page(result), *figures):
            pages.savefig(figure)
    path.write_bytes(content.getvalue())


def title_page(result: Result) -> Figure:
    """Draw a page with the results, the inputs, the model and its estimates, and the versions."""
    attributes = result.attrs
    coords = result.data.coords
    names = {
        name: f"{about['long_name']} {style.SYMBOLS[name]}" for name, about in PARAMETERS.items()
    }
    names |= {"label": "label", "motion": "motion"}
    inputs = [
        style.plain(f"{text}: {values_text(coords[name])}")
        for name, text in names.items()
        if name in coords
    ]
    of_newmark = is_newmark(result.data)
    flags = [flag for flag in maps.HATCHES if flag not in _STRENGTH_FLAGS]
    if of_newmark:
        changes = changing_strength(MODELS.from_attributes(attributes)) is not None
        flags = [*_NEWMARK_FLAGS, *(_STRENGTH_FLAGS if changes else ())]
    compared = [
        "one interface (μs 0.38), two shaking-table tests: θ 5 and 6°, 0.36 and 0.52 g, 1.8 and "
        "3.5 Hz"
    ]
    if is_recorded(result.data):
        compared.append("none under recorded motions: the rules for them extend the paper")
    sections = {
        "Results": [f"{name}: {style.SHOWN[name]['long_name']}" for name in result.variables],
        "Inputs": [*inputs, *filter(None, [style.drawn_text(attributes)])],
        "Model and estimates": style.model_text(attributes).splitlines(),
    }
    if not of_newmark:
        sections["Range in which the model was compared with measurements"] = compared
    if unsound := unsound_texts(result.data):
        sections["Unsound"] = unsound
    if not is_recorded(result.data):
        left_out = "; left out of contours and curves unless their caption says that it is drawn"
        sections["Flags that the charts hatch"] = [
            f"{style.FLAG_TEXT[flag]}: {style.flag_name(flag)} ({flag.kind}): {flag.text}"
            f"{left_out if flag in LEFT_OUT else ''}"
            for flag in maps.HATCHES
            if flag in flags
        ]
    sections["Origin"] = [
        style.plain(result.name),
        f"solved by {attributes.get('source', 'slipsweep')}",
        f"drawn by slipsweep {__version__}, matplotlib {mpl.__version__}",
        *style.plain(str(attributes.get("history", ""))).splitlines(),
        MODELS.from_attributes(attributes).reference,
    ]
    figure = Figure(figsize=(8.27, 11.69))
    title = style.plain(textwrap.fill(str(attributes.get("title", "")), 54))
    figure.text(0.08, 0.94, title, fontsize="xx-large", va="top")
    lines = []
    for heading, texts in sections.items():
        lines += ["", heading.upper()]
        for text in texts:
            lines += textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="    ")
    figure.text(0.08, 0.86, "\n".join(lines), fontsize="small", va="top", linespacing=1.4)
    return figure
