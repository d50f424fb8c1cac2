"""The chart of a displacement hazard: mean annual rate against displacement."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from slipsweep.charts.sheet import curve_looks
from slipsweep.charts.style import model_text, plain
from slipsweep.errors import InputError
from slipsweep.grid.tables import Table
from slipsweep.studies.hazard import HazardCurve, hazard_table

#: Most grid points, a curve each, and displacements of a curve.
_MOST_CURVES, _POINTS = 8, 121


def hazard_chart(table: Table, rates: Table, curve: HazardCurve, names: Sequence[str]) -> Figure:
    """Draw the mean annual rate of exceedance over the displacement.

    Parameters
    ----------
    table : Table
        The displacements under the suite.
    rates : Table
        What `slipsweep.studies.hazard.hazard_table` returns of it: its displacements are marked.
    curve : HazardCurve
    names : sequence of str
        What its grid points are called.

    Returns
    -------
    matplotlib.figure.Figure
        A curve for each grid point, dotted where more than half of the rate is held above the largest amplitude.

    Raises
    ------
    InputError
        There are too many grid points to tell apart, or no rate above 0.
    """
    if len(names) > _MOST_CURVES:
        raise InputError(
            f"{len(names)} grid points: a chart shows {_MOST_CURVES} at most; cut axes with --at NAME=VALUE"
        )
    asked = rates["threshold"].values
    most = max(np.nanmax(table["permanent_displacement"].values), asked[-1])
    if not (rates["annual_rate"].values > 0.0).any():
        raise InputError("no displacement that is asked for is exceeded by any motion: there is nothing to draw")
    least = min([one for one in asked if one > 0.0] + [most]) / 10.0
    wanted = np.union1d(np.geomspace(least, most, _POINTS), asked[asked > 0.0])
    drawn = hazard_table(table, curve, thresholds=wanted)
    lines, held = (drawn[name].values.reshape(-1, wanted.size) for name in ("annual_rate", "held_rate"))
    marks = rates["annual_rate"].values.reshape(-1, asked.size)

    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(color="0.9", which="both")
    for look, name, line, part, mark in zip(curve_looks(len(names)), names, lines, held, marks, strict=True):
        shown = np.where(line > 0.0, line, np.nan)
        colour = look["color"]
        axes.plot(
            wanted * 1000.0, np.where(part > 0.5 * line, np.nan, shown), color=colour, linestyle=look["linestyle"]
        )
        above = part > 0.5 * line
        joined = above | np.append(False, above[:-1]) | np.append(above[1:], False)  # no gaps between the two
        axes.plot(wanted * 1000.0, np.where(above, np.nan, shown), color=colour, linestyle=look["linestyle"])
        axes.plot(wanted * 1000.0, np.where(joined, shown, np.nan), color=colour, linestyle=":")
        seen = (mark > 0.0) & (asked > 0.0)
        axes.plot(asked[seen] * 1000.0, mark[seen], **{**look, "linestyle": "none"}, label=plain(name) or "asked for")
    axes.set_xlabel("permanent displacement d (mm)")
    axes.set_ylabel("mean annual rate of u > d (1/year)")
    if names != [""]:
        figure.legend(loc="outside right upper", frameon=False)
    note = "dotted: more than half of the rate is from above the largest amplitude, where P is held"
    about = [model_text(rates.attrs), f"hazard curve {plain(curve.name)}"]
    if (held > 0.5 * lines).any():
        about.append(note)
    figure.supxlabel("\n".join(about), fontsize="small")
    return figure
