"""`slipsweep hazard`: the mean annual rate at which a displacement is exceeded."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import command, written
from slipsweep.errors import InputError
from slipsweep.files import outputs
from slipsweep.model import variables

if TYPE_CHECKING:
    import xarray as xr

#: Results that are needed.
_NEEDED = ("permanent_displacement", "validity", "exceedance_probability", "valueless_share")

#: Every so many of the accelerations of published equations goes to a fragility of OpenQuake.
_EVERY = 8

#: Part of a rate from which on it is mentioned.
_MUCH = 0.05

HAZARD = options.Panel("Hazard")


@command(
    "Compute",
    "slipsweep hazard suite.nc --curve hazard.csv -d 50mm -d 30cm -o hazard.png -o fragility.xml",
    "slipsweep hazard suite.nc --curve hazard.csv -d 50mm --equations jibson-2007",
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
    equations: options.Equations = None,
    magnitude: options.Magnitude = None,
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
    or under both.  --equations takes published equations in place of the suite.
    """
    import xarray as xr

    from slipsweep.files.opening import read_result, values_text
    from slipsweep.files.selection import own_names, selected
    from slipsweep.studies.hazard import (
        displacement_hazard,
        fragility,
        openquake_fragility,
        published_fragility,
    )
    from slipsweep.studies.hazard_curve import read_hazard_curve

    beside = options.compared(equations, magnitude) or None
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
    hazard_curve = read_hazard_curve(curve, g, site, unstated)
    rates = displacement_hazard(
        result, hazard_curve, lengths, equations=beside, magnitude=magnitude
    )
    drawn = rates
    if any(path.suffix in FIGURES for path in paths):
        from slipsweep.charts.limits import drawn_thresholds

        marked = rates["threshold"].values
        more = None if "exceedance_probability" in result else drawn_thresholds(result, marked)
        drawn = displacement_hazard(
            result, hazard_curve, more, equations=beside, magnitude=magnitude
        ).assign_attrs(marked=marked)

    def fragility_text() -> str:
        if beside is None:
            return openquake_fragility(fragility(result, lengths))
        fitted = published_fragility(result, hazard_curve, beside, lengths, magnitude)
        return openquake_fragility(fitted.isel(amplitude=slice(None, None, _EVERY)))

    common.write_outputs(paths, overwrite, drawn, xml=fragility_text)
    if quiet:
        return
    low, high = (float(edge) / g for edge in rates.attrs["amplitude_range"])
    start, end = (float(edge) / g for edge in rates.attrs["hazard_curve_range"])
    # between these P is known; above and below it the rate is not
    first = max(low, start)
    last = min(high, end)
    if beside is None:
        pooled = rates.attrs["suite_dimensions"].replace(" ", " and ")
        echo(f"{_chance(rates)[:-1]} | PGA): share over {pooled}")
        ends = f"amplitudes of the result {low:.4g} to {high:.4g} g"
        echo(f"{ends}, hazard curve {start:.4g} to {end:.4g} g")
    else:
        echo(f"P(u > d | PGA): by published equations, hazard curve {start:.4g} to {end:.4g} g")
    values = {
        name: rates[name] for name in typed if name in rates.coords and name not in rates.sizes
    }
    echo(*(f"{name} = {values_text(value)}" for name, value in values.items()))
    rate, held, omitted = (rates[name] for name in ("annual_rate", "held_rate", "omitted_rate"))
    exceeded = rate.where(rate > 0.0)
    columns = {
        "annual rate": rate,
        "period (years)": 1.0 / exceeded,
        "steps, from": rates["lower_rate"] / exceeded,
        "to": rates["upper_rate"] / exceeded,
        f"above {last:.3g} g": held / exceeded,
        f"below {first:.3g} g": omitted / exceeded,
    }
    if beside is not None:
        columns["outside its range"] = rates["outside_rate"] / exceeded
    order = [*(dim for dim in rate.dims if dim != "threshold"), "d (m)"]
    table = xr.Dataset(columns).rename(threshold="d (m)").to_dataframe(order)[[*columns]]
    echo(table.to_string(float_format="{:.4g}".format, na_rep="-"))
    notes = {
        f"the hazard curve begins at {start:.4g} g, where displacements are exceeded already: the "
        "rates are too small by an unknown part; begin the curve lower": omitted.isnull()
        & rate.notnull(),
    }
    if beside is None:
        notes = _suite_notes(rates, first, last, "sweep" if high < end else "curve") | notes
    else:
        notes |= _published_notes(rates, last)
    echo(*(text for text, holds in notes.items() if holds.any()))
    echo(*rates.attrs.get("conditions", "").splitlines(), *paths)


def _chance(rates: "xr.Dataset") -> str:
    """Return the probability of exceedance in symbols."""
    symbol = "|u|" if variables.has_signed_displacements(rates.attrs) else "u"
    return f"P({symbol} > d)"


def _suite_notes(
    rates: "xr.Dataset", first: float, last: float, first_end: str
) -> "dict[str, xr.DataArray]":
    """Return sentences about the rates of a suite or of samples, and where they hold."""
    rate, held, omitted = (rates[name] for name in ("annual_rate", "held_rate", "omitted_rate"))
    axis = "the axis amplitude of the sweep" if first_end == "sweep" else "the hazard curve"
    chance = _chance(rates)
    missing = rates["valueless_share"]
    what = "samples" if "samples" in rates.attrs["suite_dimensions"] else "motions"
    unstable = (
        "; those that are statically unstable count as exceeding" if what == "samples" else ""
    )
    valueless = (
        f"up to {missing.max():.1%} of the {what} have no value at an amplitude: left out of "
        f"P{unstable}"
    )
    above = f"above {last:.4g} g {chance} is taken as it is there: to compute it, extend {axis}"
    below = f"below {first:.4g} g nothing is counted: to compute it, begin the axis amplitude lower"
    coarse = (
        f"{chance} grows much from one amplitude to the next: the rates may be wrong by the "
        "factors above; put more values on the axis amplitude"
    )
    grows = (rates["upper_rate"] > 2.0 * rates["lower_rate"]) & (held < rate)
    return {
        valueless: missing > 0.0,
        "without an annual rate: fewer than two amplitudes have a value": rate.isnull(),
        "annual rate 0: the displacement is not exceeded at any amplitude of the result": (
            rate == 0.0
        ),
        above: held > _MUCH * rate,
        below: omitted > _MUCH * rate,
        coarse: grows,
    }


def _published_notes(rates: "xr.Dataset", last: float) -> "dict[str, xr.DataArray]":
    """Return sentences about the rates of published equations, and where they hold."""
    rate, held, outside = (rates[name] for name in ("annual_rate", "held_rate", "outside_rate"))
    return {
        "without an annual rate: the block slides under its own weight": rate.isnull(),
        f"above {last:.4g} g P(u > d) is taken as it is there: to compute it, extend the hazard "
        "curve": held > _MUCH * rate,
        "outside its range: the part of the rate for which an equation is extrapolated": outside
        > 0.0,
    }
