"""Cautions on a result, in words: values that are unreliable, and trends that no block has.

`run` prints them, and charts have them in their captions (docs/trust.md).
"""

import math
from collections.abc import Hashable, Iterable

import xarray as xr

from slipsweep.model import equations
from slipsweep.model.options import SOLVERS
from slipsweep.model.variables import STRENGTHS, VALUELESS, SlidingMode, Validity
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.studies.boundaries import has_flags
from slipsweep.studies.result_counts import Tally
from slipsweep.studies.solved_again import (
    DISPLACEMENT,
    DRIVES,
    INTERFACE,
    is_newmark,
    is_recorded,
    newmark_displacement,
    solve_again,
    without_coordinates,
)
from slipsweep.studies.upslope import sliding_ways

#: Most cells of a result that are examined for trends, and of one whose cells take ten times as
#: long or more: by steps, or under another waveform than a sine.
_MOST_CELLS = 250_000
_MOST_SLOW_CELLS = 25_000

#: Coordinates that decide which way a block slides.
_DRIVING = (*INTERFACE, *DRIVES, *STRENGTHS[1:], "time_scale", "polarity", "azimuth", "motion")

#: Flags of values that are unreliable, left out unless requested, and their words in captions.
LEFT_OUT = {
    Validity.NOT_RECOUPLED: "not_recoupled (does not come to rest within the cycle)",
    Validity.UPSLOPE: "upslope (ends above where it began)",
}

#: Words for cells whose block would also slide upslope.
SLIDES_BACK = (
    "the base's acceleration also exceeds the upslope yield acceleration: the displacement is too "
    'large; sliding = "both" of [model] friction = "newmark" includes sliding back'
)


def reliable(results: xr.Dataset, name: str, show_cautions: bool = False) -> xr.DataArray:
    """Return the values of a result that may be drawn, NaN elsewhere.

    Left out are values below zero (upslope), and, unless `show_cautions`, those with a flag of
    `LEFT_OUT` or without flags.
    """
    values = results[name]
    shown = values >= 0
    if "validity" in results and not show_cautions:
        flags = results["validity"]
        shown = shown & flags.notnull() & ~has_flags(flags, sum(LEFT_OUT))
    return values.where(shown).transpose(*values.dims)


def unsound(
    data: xr.Dataset, drawn: xr.DataArray, of_newmark: xr.DataArray | None
) -> tuple[xr.DataArray, str]:
    """Find displacements with a trend that no block has.

    A displacement is smaller than at an amplitude that is 1 % smaller, which is solved for each
    cell; under recorded motions, than at the next smaller amplitude of the slice.  Or it is less
    than half of that of Newmark's block.

    Parameters
    ----------
    data
        A slice of a result.
    drawn
        Its displacements, NaN where they are left out.
    of_newmark
        Those of Newmark's block; None if they are not known.

    Returns
    -------
    (DataArray, str)
        True where there is such a trend; the trends with their shares of the cells, in words.
    """
    displacement = data[DISPLACEMENT]
    drive = next(
        (name for name in ("displacement_amplitude", *STRENGTHS) if name in data.coords), ""
    )
    if is_recorded(data):
        before = displacement.shift({drive: 1}) if drive in displacement.dims else displacement
    else:
        smaller = {drive: without_coordinates(data[drive] * 0.99)}
        before = solve_again(data, [DISPLACEMENT], **smaller)[DISPLACEMENT]
        # without the coordinate, by which the cells would not be the same
        before = before.drop_vars(drive)
    trends = {"falls with A": displacement < before * (1 - 1e-9)}  # less is rounding
    if of_newmark is not None:
        trends["lies below half of Newmark's"] = displacement < 0.5 * of_newmark
    slides = drawn > 0
    cells = xr.zeros_like(drawn, bool)
    parts = []
    for text, trend in trends.items():
        sliding = trend & slides
        cells = cells | sliding
        if sliding.any():
            parts.append(f"{text} in {percent(int(sliding.sum()) / int(slides.sum()))}")
    text = ""
    if parts:
        listed = " and ".join(parts)
        text = f"the displacement {listed} of the sliding cells, a trend that no block has"
    return cells.transpose(*drawn.dims), text


def unsound_texts(results: xr.Dataset) -> list[str]:
    """Return warnings on results that a design must not rest on.

    They are trends that no block has, and continuous sliding with estimated friction.  Of many
    cells a part is examined, evenly spaced, and the text says so.
    """
    drives = {*STRENGTHS, "displacement_amplitude"}
    if DISPLACEMENT not in results or drives.isdisjoint(results.coords) or is_newmark(results):
        return []
    choices = (results.attrs.get("waveform"), results.attrs.get(SOLVERS.attribute, "cycle"))
    is_slow = not is_recorded(results) and choices != ("sine", "cycle")
    most = _MOST_SLOW_CELLS if is_slow else _MOST_CELLS
    part, counted = _part_of_cells(results, results[DISPLACEMENT].dims, most)
    part = part.load()
    drawn = reliable(part, DISPLACEMENT)
    of_newmark = newmark_displacement(part)
    texts = [unsound(part.assign({DISPLACEMENT: drawn}), drawn, of_newmark)[1]]
    if {"sliding_mode", "validity"} <= {*part}:
        is_continuous = part["sliding_mode"] == SlidingMode.CONTINUOUS
        texts.append(estimated_friction_text(part, drawn, is_continuous))
    return [text + counted for text in texts if text]


def _part_of_cells(
    results: xr.Dataset, dims: Iterable[Hashable], most: int
) -> tuple[xr.Dataset, str]:
    """Return results of at most so many cells, evenly spaced along dimensions.

    The text says how many they are, and is empty if they are all.
    """
    sizes = {dim: results.sizes[dim] for dim in dims}
    part = results
    while math.prod(sizes.values()) > most:
        longest = max(sizes, key=lambda dim: sizes[dim])
        part = part.isel({longest: slice(1, None, 2)})
        sizes[longest] = part.sizes[longest]
    cells = math.prod(sizes.values())
    return part, "" if part is results else f" (counted in {cells} cells, evenly spaced)"


def slides_back_text(results: xr.Dataset, motion: Record | Suite | None = None) -> str:
    """Return the share of the sliding cells whose block would also slide upslope, in words.

    It is empty if there are none.  It follows from the coordinates: no result is read.
    """
    there = [name for name in _DRIVING if name in results.coords]
    if DISPLACEMENT not in results or {*DRIVES, *STRENGTHS}.isdisjoint(there):
        return ""
    if "displacement_amplitude" in there:
        there.append("frequency")
    dims = dict.fromkeys(dim for name in there for dim in results[name].dims)
    unread = results.drop_vars({*results.data_vars} - {"ground_acceleration"})
    part, counted = _part_of_cells(unread, dims, _MOST_CELLS)
    ways = sliding_ways(part, motion)
    if ways is None or not (ways[0] & ways[1]).any():
        return ""
    share = float((ways[0] & ways[1]).mean() / ways[0].mean())
    cells = f"in {percent(share)} of the sliding cells " if dims else ""
    return f"{cells}{SLIDES_BACK}{counted}"


def estimated_friction_text(
    data: xr.Dataset, drawn: xr.DataArray, is_continuous: xr.DataArray
) -> str:
    """Return the share of the sliding cells that slide continuously with estimated friction.

    In words; empty if there are none (docs/trust.md).
    """
    slides = drawn > 0
    cells = slides & is_continuous & has_flags(data["validity"], Validity.FRICTION_ESTIMATED)
    if not cells.any():
        return ""
    share = percent(int(cells.sum()) / int(slides.sum()))
    return (
        f"{share} of the sliding cells slide continuously with estimated friction: not for design"
    )


def why_nothing_slides(data: xr.Dataset, tally: Tally) -> str:
    """Return the likely reason why no cell of a sweep slides; empty if one does."""
    modes = tally.modes or {}
    if not modes or modes[SlidingMode.STICK_SLIP] + modes[SlidingMode.CONTINUOUS]:
        return ""
    return _why_all_stuck(data) if modes[SlidingMode.STUCK] else _why_no_values(data, tally)


def _why_no_values(data: xr.Dataset, tally: Tally) -> str:
    """Return the flag that most cells have, and a hint if friction angles are taken for μs."""
    flags = {flag: count for flag, count in (tally.flags or {}).items() if flag in VALUELESS}
    reason = "validity is not among the variables"
    if flags:
        reason = max(flags, key=lambda flag: flags[flag]).text
    mu_s = float(data.coords["mu_s"].min()) if "mu_s" in data.coords else 0.0
    is_angle = mu_s > 3.0 and "phi" not in data.coords
    hint = f"; did you mean phi = {mu_s:.6g}?" if is_angle else ""
    return f"no cell has a value: {reason}{hint}"


def _why_all_stuck(data: xr.Dataset) -> str:
    """Return the largest amplitude and the smallest yield acceleration, and a hint on units."""
    coords = data.coords
    g = float(data.attrs["g"])
    smallest = {
        name: float(coords[name].min()) for name in ("yield_acceleration", "mu_s") if name in coords
    }
    if "mu_s" in smallest and "theta" in coords:
        steepest = math.tan(math.radians(coords["theta"].max()))
        coulomb = equations.coulomb_yield_acceleration(smallest["mu_s"], steepest, g)
        smallest.setdefault("yield_acceleration", coulomb)
    if "amplitude" not in coords or "yield_acceleration" not in smallest:
        return "no cell slides"
    least = smallest["yield_acceleration"]
    largest = float(coords["amplitude"].max())
    hint = '; did you mean units = "g"?' if largest <= 3.0 and largest * g > least else ""
    return (
        f"no cell slides: largest amplitude {_acceleration_text(largest, g)}, smallest yield "
        f"acceleration {_acceleration_text(least, g)}{hint}"
    )


def _acceleration_text(acceleration: float, g: float) -> str:
    """Return an acceleration in both units."""
    return f"{acceleration:.6g} m/s2 ({acceleration / g:.4g} g)"


def percent(share: float) -> str:
    """Return a share in percent, in two digits or 100."""
    return f"{float(f'{100 * share:.2g}'):g} %"
