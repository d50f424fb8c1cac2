"""`slipsweep chart`: design charts of a result."""

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.common import Overwrite
from slipsweep.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from slipsweep.charts.slices import Result

EXAMPLE = "Example: slipsweep chart design_chart.nc --kind contours --at theta=5 --at mu_s=0.4 -o chart.pdf"

#: Most curves of a family, and frequencies shown to collapse.
_CURVES, _FREQUENCIES = 6, 3


@dataclass(frozen=True)
class _Wish:
    """What the command line asks of a chart."""

    x: str | None
    y: str | None
    at: Mapping[str, str]
    variable: str


def chart(
    file: Annotated[Path, typer.Argument(metavar="OUT.nc", help='A result of "slipsweep run".')],
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            "-k",
            metavar="KIND",
            help="contours, modes, families, dimensionless or newmark; of uncertain inputs fragility or quantiles; "
            "may be repeated (default: all that fit).",
        ),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Where to cut an axis, at the nearest value: theta=12, amplitude=0.3g (default: its middle).",
        ),
    ] = None,
    x: Annotated[str | None, typer.Option(metavar="NAME", help="Axis to draw over.")] = None,
    y: Annotated[
        str | None, typer.Option(metavar="NAME", help="Upright axis of a map, or the axis that tells curves apart.")
    ] = None,
    variable: Annotated[
        str, typer.Option(metavar="NAME", help="What contours and families show.")
    ] = "permanent_displacement",
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Write .png, .svg or .pdf; may be repeated (default: OUT-KIND.png)."
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Draw design charts from a result: contours, sliding modes, families of curves, ratios to Newmark.

    From statistics of uncertain inputs: fragility curves and bands of quantiles.
    """
    kinds = list(dict.fromkeys(kind or ()))
    for name in kinds:
        if name not in _CHARTS:
            near = difflib.get_close_matches(name, _CHARTS, n=1)
            hint = f'did you mean "{near[0]}"? ' if near else ""
            raise InputError(f"--kind {name}: no such chart; {hint}there are {', '.join(_CHARTS)}")
    given = output or []
    for path in given:
        if path.suffix not in (".png", ".svg", ".pdf"):
            raise InputError(f"{path}: the name must end in one of .png, .svg, .pdf")
    if given and len(kinds) != 1:
        raise InputError(f"-o {given[0]}: is for one chart: give one --kind, one of {', '.join(_CHARTS)}")
    wish = _Wish(x, y, _cuts(at or ()), variable)

    from slipsweep.charts.slices import Result
    from slipsweep.files import outputs

    with Result(file) as result:
        figures: dict[str, Figure] = {}
        left_out: dict[str, str] = {}
        fitting = _STATISTIC_CHARTS if "exceedance_probability" in result.variables else _SWEEP_CHARTS
        wanted = {name: given or [Path(f"{file.stem}-{name}.png")] for name in kinds or fitting}
        outputs.check_outputs([path for paths in wanted.values() for path in paths], overwrite, reads=[file])
        if not result.wide:
            raise InputError(
                f"{file}: no chart can be drawn: it has no axis of two values or more (its dimensions: "
                f"{', '.join(f'{dim}, {values.size}' for dim, values in result.axes.items()) or 'none'})"
            )
        result.nearest(wish.at)
        for name in wanted:
            try:
                figures[name] = _CHARTS[name](result, wish)
            except InputError as error:
                if kinds:
                    raise
                left_out[name] = str(error).removeprefix(f"{file}: ")
    if not figures:
        reasons = "; ".join(dict.fromkeys(left_out.values()))
        raise InputError(f"{file}: no chart can be drawn from it: {reasons}")
    for name, figure in figures.items():
        for path in wanted[name]:
            with outputs.complete_or_absent(path, overwrite) as temporary:
                figure.savefig(temporary, format=path.suffix[1:], dpi=150)
            typer.echo(path)
    for name, reason in left_out.items():
        typer.echo(f"no {name}: {reason}")


def _cuts(given: "tuple[str, ...] | list[str]") -> dict[str, str]:
    cuts: dict[str, str] = {}
    for text in given:
        name, separator, value = text.partition("=")
        if not (separator and name and value):
            raise InputError(f"--at {text}: must be NAME=VALUE, as in --at theta=12")
        if name.strip() in cuts:
            raise InputError(f"--at {text}: {name.strip()} is given twice")
        cuts[name.strip()] = value.strip()
    return cuts


# --------------------------------------------------------------------------- the charts


def _axes(result: "Result", wish: _Wish, variable: str, x: tuple[str, ...], y: tuple[str, ...]) -> tuple[str, str]:
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
    free = [d for d in dims if d in result.wide and d not in named and d not in wish.at]
    chosen = []
    for asked, preferred in ((wish.y, y), (wish.x, x)):
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


_DRIVES = ("amplitude", "displacement_amplitude")
_FLOAT_NAMES = ("sliding_mode", "validity")


def _shown(result: "Result", name: str) -> list[str]:
    """A result, and the flags that go with it."""
    return [name, *(["validity"] if "validity" in result.variables else [])]


def _continuous(result: "Result", name: str) -> str:
    result.result(name)
    if name in _FLOAT_NAMES:
        raise InputError(f"{result.path}: --variable {name}: is a code, not a quantity; --kind modes shows the modes")
    return name


def _contours(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import charts, slices

    name = _continuous(result, wish.variable)
    x, y = _axes(result, wish, name, ("frequency", "theta", "mu_s"), _DRIVES)
    result.require("theta", "mu_s", "amplitude")
    table = result.select(_shown(result, name), {x: result.thinned(x), y: result.thinned(y)}, wish.at)
    return charts.contours(table, slices.boundaries(table), name, x, y)


def _modes(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import charts, slices

    x, y = _axes(result, wish, "sliding_mode", ("theta", "mu_s", "frequency"), _DRIVES)
    result.require("theta", "mu_s", "amplitude")
    table = result.select(_shown(result, "sliding_mode"), {x: result.thinned(x), y: result.thinned(y)}, wish.at)
    return charts.modes(table, slices.boundaries(table), x, y)


def _families(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import charts, slices

    name = _continuous(result, wish.variable)
    x, family = _axes(result, wish, name, _DRIVES, ("frequency", "mu_s", "theta"))
    result.require("theta", "mu_s", "amplitude")
    table = result.select([name], {x: result.thinned(x), family: result.spread(family, _CURVES)}, wish.at)
    return charts.families(table, slices.boundaries(table), name, x, family)


def _dimensionless(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import charts, slices

    name = result.result("permanent_displacement")
    if wish.x not in (None, *_DRIVES):
        raise InputError(f"{result.path}: --x {wish.x}: the dimensionless chart is drawn over A / Üy")
    drive = result.axis(next((d for d in _DRIVES if d in result.axes), "amplitude"))
    keep: dict[str, slice | list[int]] = {drive: result.thinned(drive)}
    if "frequency" in result.axes and "frequency" not in wish.at:
        keep["frequency"] = result.spread("frequency", _FREQUENCIES)
    others = [n for n in ("mu_s", "theta", "yield_acceleration") if n in result.axes and result.axes[n].size > 1]
    family = result.axis(wish.y) if wish.y else next((n for n in others if n not in wish.at), None)
    if family in keep:
        raise InputError(f"{result.path}: --y {family}: must be an axis other than {', '.join(keep)}")
    if family:
        keep[family] = result.spread(family, _CURVES)
    result.require("theta", "mu_s", "amplitude", "frequency")
    table = result.select([name], keep, wish.at)
    return charts.dimensionless(table, slices.boundaries(table), family)


def _newmark(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import charts, slices

    name = result.result("permanent_displacement")
    if result.attrs["model"] == "newmark":
        raise InputError(f"{result.path}: is of Newmark's block itself; there is no difference to show")
    x, y = _axes(result, wish, name, ("theta", "mu_s", "frequency"), _DRIVES)
    result.require("theta", "mu_s", "amplitude", "frequency")
    table = result.select(_shown(result, name), {x: result.thinned(x), y: result.thinned(y)}, wish.at)
    return charts.newmark_ratio(table, slices.newmark(table), slices.boundaries(table), x, y)


def _curves(result: "Result", wish: _Wish, variable: str, family: str | None) -> tuple[str, str | None]:
    """The axis that statistics are drawn over, and the one that tells curves apart, if there is one."""
    result.result(variable)
    for asked in (wish.x, wish.y):
        if asked is not None:
            result.axis(asked)
    own = ("quantile", "threshold")
    free = [d for d in result.dims(variable) if d in result.wide and d not in wish.at]
    x = wish.x or next((d for d in (*_DRIVES, *free) if d in free and d not in (*own, wish.y)), None)
    if x is None or x not in free or x in own:
        raise InputError(f"{result.path}: {variable} needs an axis of two values or more that --at does not cut")
    chosen = wish.y or (family if family in free else None)
    if chosen == x or (chosen is not None and chosen not in free):
        raise InputError(f"{result.path}: --y {chosen}: must be another axis that {variable} has, and that is not cut")
    return x, chosen


def _fragility(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import uncertainty_figures

    result.result("valueless_share")
    result.require("threshold")
    x, family = _curves(result, wish, "exceedance_probability", "threshold")
    keep: dict[str, slice | list[int]] = {x: result.thinned(x)}
    if family:
        keep[family] = result.spread(family, _CURVES)
    table = result.select(["exceedance_probability", "valueless_share"], keep, wish.at)
    return uncertainty_figures.fragility(table, x, family)


def _quantiles(result: "Result", wish: _Wish) -> "Figure":
    from slipsweep.charts import uncertainty_figures

    if wish.y is not None:
        raise InputError(f"{result.path}: --y {wish.y}: not with quantiles, whose bands lie over one axis, --x")
    result.result("valueless_share")
    result.require("quantile")
    x, _ = _curves(result, wish, "displacement_quantile", None)
    names = ["displacement_quantile", "valueless_share"]
    table = result.select(names, {x: result.thinned(x), "quantile": slice(None)}, wish.at)
    return uncertainty_figures.quantile_bands(table, x)


_SWEEP_CHARTS: dict[str, "Callable[[Result, _Wish], Figure]"] = {
    "contours": _contours,
    "modes": _modes,
    "families": _families,
    "dimensionless": _dimensionless,
    "newmark": _newmark,
}

#: Those of a sweep with uncertain inputs.
_STATISTIC_CHARTS: dict[str, "Callable[[Result, _Wish], Figure]"] = {"fragility": _fragility, "quantiles": _quantiles}

_CHARTS = _SWEEP_CHARTS | _STATISTIC_CHARTS
