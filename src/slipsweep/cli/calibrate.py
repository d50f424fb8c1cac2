"""`slipsweep friction` and `slipsweep calibrate`: what a test on a shaking table measured."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import Text, Texts, command, written
from slipsweep.files import outputs
from slipsweep.model.options import MODELS, Model
from slipsweep.model.units import quantity

if TYPE_CHECKING:
    import pandas as pd
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

#: Cycles as a table.
_CYCLES = {
    "cycle": "cycle",
    "cycle_start": "starts, s",
    "cycle_yield_acceleration": "Üy, m/s2",
    "cycle_decay_rate": "λ",
    "cycle_delta_mu": "Δμ",
    "cycle_attenuation_coefficient": "Kd",
}


@dataclass(frozen=True)
class Measured:
    """The block of a test, and what its channels have wrong."""

    theta: Annotated[str, options.THETA]
    mu_s: options.MuS = None
    phi: options.Phi = None
    offset: Annotated[
        Texts, TEST("Channel with an offset, or all; may be repeated.", "CHANNEL")
    ] = None
    drift: Annotated[
        Texts, TEST("Channel that drifts linearly, or all; may be repeated.", "CHANNEL")
    ] = None

    def arguments(self, g: float) -> dict[str, Any]:
        """Return the options as arguments of `measured_friction` and `calibrate`."""
        typed = {"offset": self.offset, "drift": self.drift}
        channels = {
            name: "all" if names == ["all"] else names or [] for name, names in typed.items()
        }
        return vars(self) | options.in_own_units(vars(self), g) | channels


@command(
    "Tests on a shaking table",
    "slipsweep friction test.csv --theta 5 --mu-s 0.38",
    "slipsweep friction test.csv --theta 5 --mu-s 0.38 --rest 0 0.5 --drift all -o friction.png",
)
def friction(
    *,
    test: Annotated[Path, options.read("TEST.csv", _COLUMNS)],
    measured: Measured,
    g: Annotated[float, options.BLOCK("Gravity, m/s².")] = 9.81,
    rest: Annotated[
        tuple[float, float] | None, TEST("Times of rest, s, to find both by.", "FROM TO")
    ] = None,
    threshold: Annotated[
        Text, TEST("Relative acceleration of a slide: 0.02g (default: 4 times its noise).", "VALUE")
    ] = None,
    output: Annotated[
        options.Paths, written("Write .nc, .png, .svg or .pdf; may be repeated.")
    ] = None,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute the friction over a test by Eq. 1 and by statics, and its slides."""
    arguments = measured.arguments(g)
    least = None if threshold is None else quantity("--threshold", threshold, "m s-2", g)
    paths = outputs.check_outputs(output, overwrite, reads=[test], endings=(".nc", *FIGURES))
    from slipsweep.studies.calibration.measured_friction import measured_friction

    table = measured_friction(test, **arguments, g=g, rest=rest, threshold=least)
    common.write_outputs(paths, overwrite, table)
    if quiet:
        return
    attrs = table.attrs
    slides = table[[*_SLIDES]].to_dataframe()[[*_SLIDES]].rename(columns=_SLIDES)
    threshold = f"threshold  {attrs['threshold']:.4g} m/s2: {attrs['threshold_from']}"
    _echo_coefficients(table, threshold, f"removed    {attrs['removed']}")
    echo(
        f"{len(slides)} slides, s and m/s2:\n{_text(slides, index=False)}"
        if len(slides)
        else "0 slides",
        *paths,
    )


@command(
    "Tests on a shaking table",
    "slipsweep calibrate test.csv --theta 5 --mu-s 0.38 -o calibration.nc -o calibration.png",
    "slipsweep calibrate strong.csv weak.csv --theta 5 --mu-s 0.38 --drift relative_displacement "
    "-o model.toml",
)
def calibrate(
    *,
    tests: Annotated[
        list[Path], options.read("TEST.csv...", f"{_COLUMNS} One at least of the block's.")
    ],
    measured: Measured,
    cycles: Annotated[bool, TEST("Fit each cycle separately, too.")] = True,
    output: Annotated[
        options.Paths, written("Write .nc, .toml, .png, .svg or .pdf; may be repeated.")
    ] = None,
    overwrite: options.Overwrite = False,
    model: Annotated[Model, MODELS],
    quiet: options.Quiet = False,
) -> None:
    """Estimate yield acceleration, λ and Δμ from one or several tests."""
    arguments = measured.arguments(model.g)
    paths = outputs.check_outputs(
        output, overwrite, reads=tests, endings=(".nc", ".toml", *FIGURES)
    )
    from slipsweep.studies.calibration.calibrate import calibrate
    from slipsweep.studies.calibration.sweep_tables import sweep_file_text

    table = calibrate(tests, **arguments, model=model, cycles=cycles)
    text = sweep_file_text(table.attrs["model_table"], table.attrs["uncertainty_table"])
    common.write_outputs(paths, overwrite, table, toml=lambda: text)
    if quiet:
        return
    echo(*["not ready for use: see the notes below"] if text.startswith("# WARNING") else [])
    _echo_coefficients(table)
    _echo_parameters(table)
    echo(f"removed: {table.attrs['removed']}")
    for number in range(table.sizes.get("test", 1)) if "cycle_start" in table else ():
        fitted = (
            table.isel(test=number, missing_dims="ignore")[[*_CYCLES]].to_dataframe().reset_index()
        )
        echo(
            _text(
                fitted[[*_CYCLES]].dropna(subset=["cycle_start"]).rename(columns=_CYCLES),
                index=False,
            )
        )
    constant = table.attrs["constant_friction"]
    echo(
        *(
            f"note: {finding}"
            for finding in table.attrs["findings"].splitlines()
            if finding != constant
        )
    )
    echo("", text, *paths)


def _echo_coefficients(table: "xr.Dataset", *lines: str) -> None:
    """Print static and kinetic friction by statics, and if friction is constant."""
    echo(*filter(None, [table.attrs["constant_friction"]]), *lines)
    for kind in ("static", "kinetic"):
        if f"{kind}_friction" in table and table[f"{kind}_friction"].notnull():
            low, high = table[f"{kind}_friction_interval"].values
            value = table[f"{kind}_friction"].item()
            echo(f"{kind + ' friction by statics':<28}{value:.3f}   95 %: {low:.3f} to {high:.3f}")


def _echo_parameters(table: "xr.Dataset") -> None:
    """Print the parameters, their correlation, and the misfit of each channel in each test."""
    import pandas as pd

    from slipsweep.studies.calibration.observation import SOUGHT
    from slipsweep.studies.calibration.shaking_test import RESPONSES

    # a parameter that the data do not determine has no value
    rows = [
        [table[name].where(table[f"{name}_error"] < math.inf), *table[f"{name}_interval"]]
        for name in SOUGHT
    ]
    labels = [f"{name} ({table[name].attrs['units']})" for name in SOUGHT]
    parameters = pd.DataFrame(rows, labels, ["value", "95 % from", "to"], dtype=float)
    echo(
        _text(parameters),
        "correlation",
        _text(pd.DataFrame(table["correlation"].values, [*SOUGHT], [*SOUGHT])),
    )
    echo("misfit, root mean square, and in parts of the largest value")
    for name in RESPONSES:
        if f"misfit_{name}" not in table:
            continue
        misfits, shares = (table[f"{kind}misfit_{name}"] for kind in ("", "relative_"))
        units = misfits.attrs["units"]
        pairs = zip(misfits.values.flat, shares.values.flat, strict=True)
        parts = (
            "not measured" if math.isnan(misfit) else f"{misfit:.2g} {units}  {share:.1%}"
            for misfit, share in pairs
        )
        echo(f"  {name:<24}{', '.join(parts)}")


def _text(table: "pd.DataFrame", **options: bool) -> str:
    text: str = table.to_string(**options, float_format="{:.4g}".format, na_rep="-")
    return text
