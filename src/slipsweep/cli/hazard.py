"""`slipsweep hazard`: the mean annual rate at which a displacement is exceeded."""

from pathlib import Path
from typing import Annotated, Literal

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import command, written
from slipsweep.errors import InputError
from slipsweep.files import outputs

#: What is needed of a result.
_NEEDED = ("permanent_displacement", "validity", "exceedance_probability", "valueless_share")

#: The part of a rate that is worth a sentence.
_MUCH = 0.05

HAZARD = options.Panel("Hazard")


@command(
    "Compute",
    "slipsweep hazard suite.nc --curve hazard.csv -d 50mm -d 30cm -o hazard.png -o fragility.xml",
)
def hazard(
    file: Annotated[
        Path,
        options.read("OUT.nc", "A result under a suite or [uncertainty], with an axis amplitude."),
    ],
    curve: Annotated[
        Path,
        HAZARD(
            'Columns "PGA (g)" and "annual rate", from low to high; or OpenQuake\'s.', "HAZARD.csv"
        ),
    ],
    displacement: Annotated[list[str], options.LENGTH],
    site: Annotated[
        int | None, HAZARD("Which site of an OpenQuake file with several, from 1.", "N")
    ] = None,
    unstated: Annotated[
        Literal["refuse", "accept"],
        HAZARD("A curve that does not say PGA, or annual: refused, or taken as such."),
    ] = "refuse",
    at: options.At = None,
    output: Annotated[
        options.Paths,
        written(
            "Write .png, .svg or .pdf, or the fragility as .xml of OpenQuake; may be repeated."
        ),
    ] = None,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute the mean annual rate of exceeding a displacement.

    From a hazard curve and the fragility under a suite of recorded motions, under uncertain inputs,
    or under both.
    """
    import xarray as xr

    from slipsweep.files.opening import read_result, values_text
    from slipsweep.files.selection import own_names, selected
    from slipsweep.studies.hazard import (
        displacement_hazard,
        fragility,
        openquake_fragility,
        read_hazard_curve,
    )

    paths = outputs.check_outputs(
        output, overwrite, reads=[file, curve], endings=(*FIGURES, ".xml")
    )
    whole = read_result(file)
    table = whole[[name for name in _NEEDED if name in whole]].load()
    if "g" not in table.attrs:
        raise InputError(f"{file}: attribute g is missing: must be there, m/s2")
    typed = own_names(whole, options.cuts(at))
    chosen = selected(table, file, typed, ("amplitude", "motion", "threshold"))
    for name in typed:
        if chosen.sizes.get(name, 1) > 1:
            raise InputError(f"{file}: --at {name}: {chosen.sizes[name]} values; must be one")
    result = chosen.squeeze([name for name in typed if name in chosen.sizes])
    g = float(table.attrs["g"])
    lengths = options.displacements(displacement, g)
    given = read_hazard_curve(curve, g, site, unstated)
    rates = displacement_hazard(result, given, lengths)
    drawn = rates
    if any(path.suffix in FIGURES for path in paths):
        from slipsweep.charts.limits import drawn_thresholds

        marked = rates["threshold"].values
        more = None if "exceedance_probability" in result else drawn_thresholds(result, marked)
        drawn = displacement_hazard(result, given, more).assign_attrs(marked=marked)
    common.write_outputs(
        paths, overwrite, drawn, xml=lambda: openquake_fragility(fragility(result, lengths))
    )
    if quiet:
        return
    low, high = (float(one) / g for one in rates.attrs["amplitude_range"])
    start, end = (float(one) / g for one in rates.attrs["hazard_curve_range"])
    # P is known between these, and the rate of what lies above and below is not
    first = max(low, start)
    last = min(high, end)
    echo(f"P(u > d | PGA): share over {rates.attrs['suite_dimensions'].replace(' ', ' and ')}")
    echo(
        f"amplitudes of the result {low:.4g} to {high:.4g} g, hazard curve {start:.4g} to {end:.4g} g"
    )
    values = {
        name: rates[name] for name in typed if name in rates.coords and name not in rates.sizes
    }
    echo(*(f"{name} = {values_text(value)}" for name, value in values.items()))
    rate, held, omitted = (rates[name] for name in ("annual_rate", "held_rate", "omitted_rate"))
    axis = "the axis amplitude of the sweep" if high < end else "the hazard curve"
    missing = rates["valueless_share"]
    what = "samples" if "samples" in rates.attrs["suite_dimensions"] else "motions"
    unstable = (
        "; those that are statically unstable count as exceeding" if what == "samples" else ""
    )
    notes = {
        f"up to {missing.max():.1%} of the {what} have no value at an amplitude: left out of P{unstable}": missing
        > 0.0,
        "without an annual rate: fewer than two amplitudes have a value": rate.isnull(),
        "annual rate 0: the displacement is not exceeded at any amplitude of the result": rate
        == 0.0,
        f"above {last:.4g} g P(u > d) is taken as it is there: to compute it, extend {axis}": held
        > _MUCH * rate,
        f"below {first:.4g} g nothing is counted: to compute it, begin the axis amplitude lower": omitted
        > _MUCH * rate,
        f"the hazard curve begins at {start:.4g} g, where displacements are exceeded already: the rates are too small "
        "by an unknown part; begin the curve lower": omitted.isnull() & rate.notnull(),
        "P(u > d) grows much from one amplitude to the next: the rates may be wrong by the factors above; put more "
        "values on the axis amplitude": (rates["upper_rate"] > 2.0 * rates["lower_rate"])
        & (held < rate),
    }
    exceeded = rate.where(rate > 0.0)
    columns = {
        "annual rate": rate,
        "period (years)": 1.0 / exceeded,
        "steps, from": rates["lower_rate"] / exceeded,
        "to": rates["upper_rate"] / exceeded,
        f"above {last:.3g} g": held / exceeded,
        f"below {first:.3g} g": omitted / exceeded,
    }
    table = xr.Dataset(columns).rename(threshold="d (m)").to_dataframe()[[*columns]]
    echo(table.to_string(float_format="{:.4g}".format, na_rep="-"))
    echo(*(text for text, holds in notes.items() if holds.any()), *paths)
