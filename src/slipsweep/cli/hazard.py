"""`slipsweep hazard`: the mean annual rate at which a displacement is exceeded."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from slipsweep.cli import common, options
from slipsweep.cli.common import FIGURES, echo
from slipsweep.cli.options import command, written
from slipsweep.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

#: What is needed of a result.
_NEEDED = ("permanent_displacement", "validity", "exceedance_probability", "valueless_share")

#: The part of a rate that is worth a sentence.
_MUCH = 0.05

#: A row of the table of rates.
_ROW = "  {:<10}{:>12}{:>16}{:>14}{:>14}{:>16}"

HAZARD = options.Panel("Hazard")


@command("Compute", "slipsweep hazard suite.nc --curve hazard.csv -d 50mm -d 30cm -o hazard.png -o fragility.xml")
def hazard(
    file: Annotated[Path, options.read("OUT.nc", "A result under a suite or [uncertainty], with an axis amplitude.")],
    curve: Annotated[
        Path, HAZARD('Columns "PGA (g)" and "annual rate", from low to high; or OpenQuake\'s.', "HAZARD.csv")
    ],
    displacement: Annotated[list[str], options.LENGTH],
    site: Annotated[int | None, HAZARD("Which site of an OpenQuake file with several, from 1.", "N")] = None,
    at: options.At = None,
    output: Annotated[
        options.Paths, written("Write .png, .svg or .pdf, or the fragility as .xml of OpenQuake; may be repeated.")
    ] = None,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute the mean annual rate of exceeding a displacement.

    From a hazard curve and the fragility under a suite of recorded motions, under uncertain inputs, or under both.
    """
    import numpy as np

    from slipsweep.files.opening import read_result, values_text
    from slipsweep.files.selection import own_names, selected
    from slipsweep.studies import suite_statistics
    from slipsweep.studies.hazard import displacement_hazard, fragility, openquake_fragility, read_hazard_curve

    paths = common.check_outputs(output, (*FIGURES, ".xml"), overwrite, [file, curve])
    whole = read_result(file)
    table = whole[[name for name in _NEEDED if name in whole]].load()
    if "g" not in table.attrs:
        raise InputError(f"{file}: attribute g is missing: must be there, m/s2")
    typed = own_names(whole, options.cuts(at))
    chosen = selected(table, file, typed, ("amplitude", "motion", "threshold"))
    for name in typed:
        if chosen.sizes.get(name, 1) > 1:
            raise InputError(f"{file}: --at {name}: {chosen.sizes[name]} values; must be one")
    result, g = chosen.squeeze([name for name in typed if name in chosen.sizes]), float(table.attrs["g"])
    lengths = options.displacements(displacement, g)
    given = read_hazard_curve(curve, g, site)
    rates = displacement_hazard(result, given, lengths)
    drawn = rates
    if any(path.suffix in FIGURES for path in paths):
        from slipsweep.charts.limits import drawn_thresholds

        marked = rates["threshold"].values
        more = None if "exceedance_probability" in result else drawn_thresholds(result, marked)
        drawn = displacement_hazard(result, given, more).assign_attrs(marked=marked)
    common.write_outputs(paths, overwrite, drawn, xml=lambda: openquake_fragility(fragility(result, lengths)))
    if quiet:
        return
    low, high = (float(one) / g for one in rates.attrs["amplitude_range"])
    start, end = (float(one) / g for one in rates.attrs["hazard_curve_range"])
    # P is known between these, and the rate of what lies above and below is not
    first, last = max(low, start), min(high, end)
    echo(f"P(u > d | PGA): share over {rates.attrs['suite_dimensions'].replace(' ', ' and ')}")
    echo(f"amplitudes of the result {low:.4g} to {high:.4g} g, hazard curve {start:.4g} to {end:.4g} g")
    # a share without a value may lie along fewer dimensions: it does not depend on the frequency
    sizes = {dim: size for dim, size in rates["annual_rate"].sizes.items() if dim != "threshold"}
    fixed = [f"{name} = {values_text(rates[name])}" for name in typed if name in rates.coords and name not in sizes]
    for index, point in zip(np.ndindex(*sizes.values()), suite_statistics.point_names(rates, sizes), strict=True):
        echo(*filter(None, [", ".join(filter(None, [point, *fixed]))]))
        _summarize_point(rates.isel(dict(zip(sizes, index, strict=True))), first, last)
    rate, held, omitted = (rates[name] for name in ("annual_rate", "held_rate", "omitted_rate"))
    axis = "the axis amplitude of the sweep" if high < end else "the hazard curve"
    notes = {
        f"above {last:.4g} g P(u > d) is taken as it is there: to compute it, extend {axis}": held > _MUCH * rate,
        f"below {first:.4g} g nothing is counted: to compute it, begin the axis amplitude lower": omitted
        > _MUCH * rate,
        f"the hazard curve begins at {start:.4g} g, where displacements are exceeded already: the rates are too small "
        "by an unknown part; begin the curve lower": omitted.isnull() & rate.notnull(),
        "P(u > d) grows much from one amplitude to the next: the rates may be wrong by the factors above; put more "
        "values on the axis amplitude": (rates["upper_rate"] > 2.0 * rates["lower_rate"]) & (held < rate),
    }
    echo(*(text for text, holds in notes.items() if holds.any()), *paths)


def _summarize_point(rates: "xr.Dataset", first: float, last: float) -> None:
    """The table of one grid point."""
    share = rates["valueless_share"].item()
    if share > 0.0:
        what = "motions" if rates.attrs["suite_dimensions"].split()[-1] != "samples" else "samples"
        unstable = "; those that are statically unstable count as exceeding" if what == "samples" else ""
        echo(f"  up to {share:.1%} of the {what} have no value at an amplitude: left out of P{unstable}")
    if rates["annual_rate"].isnull().any():
        echo("  no annual rate: fewer than two amplitudes have a value")
        return
    above, below = f"above {last:.3g} g", f"below {first:.3g} g"
    echo(_ROW.format("d (m)", "annual rate", "period (years)", "steps", above, below))
    names = ("threshold", "annual_rate", "lower_rate", "upper_rate", "held_rate", "omitted_rate")
    for d, rate, *parts in zip(*(rates[name].values for name in names), strict=True):
        if not rate > 0.0:
            echo(f"  {d:<10.6g}{0:>12}  not exceeded at any amplitude of the result")
            continue
        lower, upper, held, omitted = (part / rate for part in parts)
        steps, left = f"{lower:.2f} to {upper:.2f}", "not known" if math.isnan(omitted) else f"<= {omitted:.2%} more"
        echo(_ROW.format(f"{d:.6g}", f"{rate:.4g}", f"{1.0 / rate:.4g}", steps, f"{held:.2%}", left))
