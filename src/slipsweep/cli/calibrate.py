"""`slipsweep friction` and `slipsweep calibrate`: what a test on a shaking table measured."""

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import Text, Texts, command, written
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Model
from slipsweep.model.units import quantity

if TYPE_CHECKING:
    import xarray as xr

TEST = options.Panel("Measurement")

#: Columns of a test.
_COLUMNS = (
    "Columns time (s), table acceleration (g), block acceleration (m/s2), relative velocity (m/s), "
    "relative displacement (mm)."
)

#: Slides as a table: results, and what stands above, as wide as the column.
_SLIDES = {
    "slide_onset": "    onset",
    "slide_peak": "    peak",
    "slide_stop": "    stop",
    "onset_acceleration": " table at onset",
    "peak_block_acceleration": " block at most",
    "least_friction": " least of Eq. 1",
    "slide_free_body_friction": " by statics",
}

#: Parameters that a calibration finds, and those of a cycle.
_FOUND = ("yield_acceleration", "decay_rate", "delta_mu")
_OF_CYCLES = ("start", *_FOUND, "attenuation_coefficient")


@dataclass(frozen=True)
class Measured:
    """The block of a test, and what its channels have wrong."""

    theta: Annotated[str, options.THETA]
    mu_s: options.MuS = None
    phi: options.Phi = None
    offset: Annotated[Texts, TEST("Channel with an offset, or all; may be repeated.", "CHANNEL")] = None
    drift: Annotated[Texts, TEST("Channel that drifts linearly, or all; may be repeated.", "CHANNEL")] = None

    def given(self, g: float) -> dict[str, Any]:
        """The same as Python's functions take it."""
        removed = (("offset", self.offset), ("drift", self.drift))
        channels = {name: "all" if one == ["all"] else one or [] for name, one in removed}
        return vars(self) | options.in_own_units(vars(self), g) | channels


@command(
    "Tests on a shaking table",
    "slipsweep friction test.csv --theta 5 --mu-s 0.38",
    "slipsweep friction test.csv --theta 5 --mu-s 0.38 --rest 0:0.5 --drift all -o friction.png",
)
def friction(
    *,
    test: Annotated[Path, options.read("TEST.csv", _COLUMNS)],
    measured: Measured,
    g: Annotated[float, options.BLOCK("Gravity, m/s².")] = 9.81,
    rest: Annotated[Text, TEST("Times of rest, s, to find offsets and drifts by.", "FROM:TO")] = None,
    threshold: Annotated[
        Text, TEST("Relative acceleration of a slide: 0.02g (default: 4 times its noise).", "VALUE")
    ] = None,
    output: Annotated[options.Paths, written("Write .nc, .png, .svg or .pdf; may be repeated.")] = None,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute the friction over a test by Eq. 1 and by statics, and its slides."""
    given = measured.given(g)
    least = None if threshold is None else quantity("--threshold", threshold, "m s-2", g)
    paths = common.check_outputs(output, (".nc", *FIGURES), overwrite, [test])
    from slipsweep.studies.friction import measured_friction

    span = None
    if rest is not None:
        try:
            first, last = map(float, rest.split(":"))
        except ValueError:
            raise InputError(f"--rest {rest}: must be two times, s, as FROM:TO") from None
        span = first, last
    table = measured_friction(test, **given, g=g, rest=span, threshold=least)
    common.write_outputs(paths, overwrite, table)
    if quiet:
        return
    attrs, slides = table.attrs, table[[*_SLIDES]].to_dataframe()[[*_SLIDES]].rename(columns=_SLIDES)
    threshold = f"threshold  {attrs['threshold']:.4g} m/s2: {attrs['threshold_from']}"
    _echo_coefficients(table, threshold, f"removed    {attrs['removed']}")
    rows = slides.to_string(index=False, na_rep="nan", float_format="{:.4g}".format)
    echo(f"{len(slides)} slides, s and m/s2:\n{rows}" if len(slides) else "0 slides", *paths)


@command(
    "Tests on a shaking table",
    "slipsweep calibrate test.csv --theta 5 --mu-s 0.38 -o calibration.nc -o calibration.png",
    "slipsweep calibrate strong.csv weak.csv --theta 5 --mu-s 0.38 --drift relative_displacement -o model.toml",
)
def calibrate(
    *,
    tests: Annotated[list[Path], options.read("TEST.csv...", f"{_COLUMNS} One at least of the block's.")],
    measured: Measured,
    cycles: Annotated[bool, TEST("Fit each cycle separately, too.")] = True,
    output: Annotated[options.Paths, written("Write .nc, .toml, .png, .svg or .pdf; may be repeated.")] = None,
    overwrite: options.Overwrite = False,
    model: Annotated[Model, MODELS],
    quiet: options.Quiet = False,
) -> None:
    """Estimate yield acceleration, λ and Δμ from one or several tests."""
    given = measured.given(model.g)
    paths = common.check_outputs(output, (".nc", ".toml", *FIGURES), overwrite, tests)
    from slipsweep.studies import calibration

    table = calibration.calibrate(tests, **given, model=model, cycles=cycles)
    text = calibration.sweep_file_text(table.attrs["model_table"], table.attrs["uncertainty_table"])
    common.write_outputs(paths, overwrite, table, toml=lambda: text)
    if quiet:
        return
    _echo_coefficients(table)
    echo(f"{'':<24}{'value':>10}{'error':>10}   95 % interval")
    for name in _FOUND:
        low, high = table[f"{name}_interval"].values
        unit = " m/s2" if name == "yield_acceleration" else ""
        interval = f"{low:.4g} to {high:.4g}{unit}" if math.isfinite(high) else f"{low:.4g}{unit} or more"
        error = table[f"{name}_error"].item()
        value = f"{table[name].item():>10.4g}{error:>10.2g}" if math.isfinite(error) else f"{'not determined':>20}"
        echo(f"{name:<24}{value}   {interval}")
    echo("correlation")
    for (i, one), (j, other) in itertools.combinations(enumerate(_FOUND), 2):
        echo(f"  {f'{one}, {other}':<32}{_number(table['correlation'].values[i, j], '.3f'):>7}")
    echo("misfit, root mean square, and in parts of the largest value")
    for name in ("block_acceleration", "relative_velocity", "relative_displacement"):
        if f"misfit_{name}" in table:
            misfits, shares = (table[f"{kind}misfit_{name}"] for kind in ("", "relative_"))
            pairs = zip(misfits.values.flat, shares.values.flat, strict=True)
            parts = (f"{misfit:.2g} {misfits.attrs['units']}  {share:.1%}" for misfit, share in pairs)
            echo(f"  {name:<32}{', '.join(parts)}")
    echo(f"removed: {table.attrs['removed']}")
    for number in range(table.sizes.get("test", 1)) if "cycle_start" in table else ():
        fitted = table.isel(test=number, missing_dims="ignore")
        echo("cycle  starts, s     Üy, m/s2       λ      Δμ      Kd")
        rows = zip(*(fitted[f"cycle_{name}"].values for name in _OF_CYCLES), strict=True)
        for at, (start, *found) in enumerate(rows, 1):
            if math.isfinite(start):
                echo("{:5d} {:10.4g} {:>12} {:>7} {:>7} {:>7}".format(at, start, *map(_number, found)))
    constant = table.attrs["constant_friction"]
    echo(*(f"note: {finding}" for finding in table.attrs["findings"].splitlines() if finding != constant))
    echo("", text, *paths)


def _echo_coefficients(table: "xr.Dataset", *lines: str) -> None:
    """That the friction is constant, and static and kinetic friction by statics, where the block was seen to slide."""
    echo(*filter(None, [table.attrs["constant_friction"]]), *lines)
    for kind in ("static", "kinetic"):
        if f"{kind}_friction" in table and table[f"{kind}_friction"].notnull():
            low, high = table[f"{kind}_friction_interval"].values
            value = table[f"{kind}_friction"].item()
            echo(f"{kind + ' friction by statics':<28}{value:.3f}   95 %: {low:.3f} to {high:.3f}")


def _number(value: float, form: str = ".3g") -> str:
    return format(value, form) if math.isfinite(value) else "-"
