"""`slipsweep friction` and `slipsweep calibrate`: what a test on a shaking table measured."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slipsweep.cli.common import (
    BLOCK,
    FIGURES,
    OUTPUT,
    MuS,
    Overwrite,
    Panel,
    Quiet,
    Theta,
    check_outputs,
    examples,
    netcdf_writer,
    write_outputs,
)
from slipsweep.cli.options import chooses
from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Model
from slipsweep.model.units import quantity

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FRICTION_EXAMPLE = examples(
    "slipsweep friction test.csv --theta 5 --mu-s 0.38",
    "slipsweep friction test.csv --theta 5 --mu-s 0.38 --rest 0:0.5 --drift all -o friction.png",
)

EXAMPLE = examples(
    "slipsweep calibrate test.csv --theta 5 --mu-s 0.38 -o calibration.nc -o calibration.png",
    "slipsweep calibrate strong.csv weak.csv --theta 5 --mu-s 0.38 --drift relative_displacement -o model.toml",
)

#: The group of options that say what of the measurement is used, and how.
TEST = Panel("Measurement")

Test = Annotated[
    Path,
    typer.Argument(
        metavar="TEST.csv",
        help="Columns time (s), table acceleration (g), block acceleration (m/s2), "
        "relative velocity (m/s), relative displacement (mm).",
    ),
]
Tests = Annotated[
    list[Path],
    typer.Argument(
        metavar="TEST.csv...",
        help="One test or several of one interface, with columns as for friction; of the block one column at least.",
    ),
]
Offset = Annotated[
    list[str] | None, TEST("Channel whose sensor has an offset, or all; may be repeated.", metavar="CHANNEL")
]
Drift = Annotated[
    list[str] | None, TEST("Channel whose sensor drifts linearly, or all; may be repeated.", metavar="CHANNEL")
]


def friction(
    *,
    test: Test,
    theta: Theta,
    mu_s: MuS,
    g: Annotated[float, BLOCK("Gravity, m/s².")] = 9.81,
    offset: Offset = None,
    drift: Drift = None,
    rest: Annotated[str | None, TEST("Times of rest, s, to find offsets and drifts by.", metavar="FROM:TO")] = None,
    threshold: Annotated[
        str | None, TEST("Relative acceleration of a slide: 0.02g (default: 4 times its noise).", metavar="VALUE")
    ] = None,
    output: Annotated[
        list[Path] | None, OUTPUT("Write .nc, .png, .svg or .pdf; may be repeated.", "--output", "-o", metavar="FILE")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Compute the friction over a test by Eq. 1 and by statics, and its slides."""
    angle = quantity("--theta", theta, "degree", g)
    least = None if threshold is None else quantity("--threshold", threshold, "m s-2", g)
    paths = check_outputs(output, (".nc", *FIGURES), overwrite, [test])
    from slipsweep.studies.friction import measured_friction

    table = measured_friction(
        test,
        angle,
        mu_s,
        g=g,
        offset=_channels(offset),
        drift=_channels(drift),
        rest=None if rest is None else _times(rest),
        threshold=least,
    )

    def figure() -> "Figure":
        from slipsweep.charts.kinds import figure_of

        return figure_of(table)

    write_outputs(paths, overwrite, figure, {".nc": netcdf_writer(table, table.attrs["title"])})
    if quiet:
        return
    if table.attrs["constant_friction"]:
        typer.echo(table.attrs["constant_friction"])
    typer.echo(f"threshold  {table.attrs['threshold']:.4g} m/s2: {table.attrs['threshold_from']}")
    typer.echo(f"removed    {table.attrs['removed']}")
    _echo_coefficients(table)
    columns = {
        "slide_onset": ("onset", 9),
        "slide_peak": ("peak", 9),
        "slide_stop": ("stop", 9),
        "onset_acceleration": ("table at onset", 16),
        "peak_block_acceleration": ("block at most", 15),
        "least_friction": ("least of Eq. 1", 16),
        "slide_free_body_friction": ("by statics", 12),
    }
    typer.echo(f"{table.sizes['slide']} slides" + (", s and m/s2:" if table.sizes["slide"] else ""))
    if table.sizes["slide"]:
        typer.echo("".join(f"{text:>{width}}" for text, width in columns.values()))
    for row in zip(*(table[name].values for name in columns), strict=True):
        typer.echo("".join(f"{value:{width}.4g}" for value, (_, width) in zip(row, columns.values(), strict=True)))
    for path in paths:
        typer.echo(path)


@chooses(model=MODELS)
def calibrate(
    *,
    tests: Tests,
    theta: Theta,
    mu_s: MuS,
    offset: Offset = None,
    drift: Drift = None,
    cycles: Annotated[bool, TEST("Fit each cycle separately, too.", "--cycles/--no-cycles")] = True,
    output: Annotated[
        list[Path] | None,
        OUTPUT("Write .nc, .toml, .png, .svg or .pdf; may be repeated.", "--output", "-o", metavar="FILE"),
    ] = None,
    overwrite: Overwrite = False,
    model: Model,
    quiet: Quiet = False,
) -> None:
    """Estimate yield acceleration, λ and Δμ from one or several tests."""
    angle = quantity("--theta", theta, "degree", model.g)
    paths = check_outputs(output, (".nc", ".toml", *FIGURES), overwrite, tests)
    from slipsweep.studies.calibration import calibrate as calibrated
    from slipsweep.studies.findings import sweep_file_text

    table = calibrated(
        tests,
        angle,
        mu_s,
        model=model,
        offset=_channels(offset),
        drift=_channels(drift),
        cycles=cycles,
    )
    text = sweep_file_text(table.attrs["model_table"], table.attrs["uncertainty_table"])

    def figure() -> "Figure":
        from slipsweep.charts.kinds import figure_of

        return figure_of(table)

    writers = {
        ".nc": netcdf_writer(table, table.attrs["title"]),
        ".toml": lambda path: path.write_text(text, encoding="utf-8"),
    }
    write_outputs(paths, overwrite, figure, writers)
    if quiet:
        return
    _summarize(table)
    typer.echo(f"\n{text}")
    for path in paths:
        typer.echo(path)


def _channels(given: list[str] | None) -> str | list[str]:
    return "all" if given == ["all"] else given or []


def _times(text: str) -> tuple[float, float]:
    try:
        first, last = text.split(":")
        return float(first), float(last)
    except ValueError:
        raise InputError(f"--rest {text}: must be two times, s, as FROM:TO") from None


def _echo_coefficients(table: "xr.Dataset") -> None:
    """Static and kinetic friction by statics, where the block was seen to slide."""
    for kind in ("static", "kinetic"):
        if f"{kind}_friction" in table and table[f"{kind}_friction"].notnull():
            low, high = table[f"{kind}_friction_interval"].values
            value = table[f"{kind}_friction"].item()
            typer.echo(f"{kind + ' friction by statics':<28}{value:.3f}   95 %: {low:.3f} to {high:.3f}")


def _summarize(table: "xr.Dataset") -> None:
    import numpy as np

    constant = table.attrs["constant_friction"]
    if constant:
        typer.echo(constant)
    _echo_coefficients(table)
    typer.echo(f"{'':<24}{'value':>10}{'error':>10}   95 % interval")
    for name in ("yield_acceleration", "decay_rate", "delta_mu"):
        low, high = table[f"{name}_interval"].values
        unit = " m/s2" if name == "yield_acceleration" else ""
        interval = f"{low:.4g} to {high:.4g}{unit}" if np.isfinite(high) else f"{low:.4g}{unit} or more"
        error = table[f"{name}_error"].item()
        value = f"{table[name].item():>10.4g}{error:>10.2g}" if np.isfinite(error) else f"{'not determined':>20}"
        typer.echo(f"{name:<24}{value}   {interval}")
    matrix = table["correlation"].values
    typer.echo("correlation")
    for text, i, j in (
        ("yield_acceleration, decay_rate", 0, 1),
        ("yield_acceleration, delta_mu", 0, 2),
        ("decay_rate, delta_mu", 1, 2),
    ):
        typer.echo(f"  {text:<32}" + (f"{matrix[i, j]:7.3f}" if np.isfinite(matrix[i, j]) else "      -"))
    typer.echo("misfit, root mean square, and in parts of the largest value")
    for name in ("block_acceleration", "relative_velocity", "relative_displacement"):
        if f"misfit_{name}" in table:
            unit = table[f"misfit_{name}"].attrs["units"]
            misfits, shares = (np.atleast_1d(table[f"{kind}misfit_{name}"].values) for kind in ("", "relative_"))
            text = ", ".join(f"{misfit:.2g} {unit}  {share:.1%}" for misfit, share in zip(misfits, shares, strict=True))
            typer.echo(f"  {name:<32}{text}")
    typer.echo(f"removed: {table.attrs['removed']}")
    if "cycle_start" in table:
        for part in [table] if "test" not in table.dims else [table.isel(test=i) for i in range(table.sizes["test"])]:
            _echo_cycles(part)
    for finding in table.attrs["findings"].splitlines():
        if finding != constant:
            typer.echo(f"note: {finding}")


def _echo_cycles(table: "xr.Dataset") -> None:
    import numpy as np

    typer.echo("cycle  starts, s     Üy, m/s2       λ      Δμ      Kd")
    names = ("start", "yield_acceleration", "decay_rate", "delta_mu", "attenuation_coefficient")
    for number, (start, *values) in enumerate(zip(*(table[f"cycle_{name}"].values for name in names), strict=True), 1):
        if np.isfinite(start):
            cells = [f"{value:.3g}" if np.isfinite(value) else "-" for value in values]
            typer.echo(f"{number:5d} {start:10.4g} {cells[0]:>12} {cells[1]:>7} {cells[2]:>7} {cells[3]:>7}")
