"""What there is to find in a record before it is used: samples that are missing, and motions that no ground makes.

Findings are texts, with the time and the value; no text is no finding.
"""

import numpy as np
from numpy.typing import NDArray

from slipsweep.motion.intensity import Floats, Motion, peak_displacement, peak_velocity
from slipsweep.motion.reading import STANDARD_GRAVITY, UNITS

#: An interval of more median ones than this is a gap.  Of fewer samples than the second, typed by hand, nothing is said
#: but of values that cannot be.
_GAP, _FEWEST = 5.0, 16

#: Magnitudes that programs write where they have no value.
_FILL = np.array([999.0, 9999.0, 99999.0, 999999.0, 999.9, 999.99, 9999.9, 9999.99, 32767.0, 32768.0, 1e20, 1e30])

#: A value that is held for so long (s, and samples) while the ground shakes is of a sensor that stands still.
_HELD, _HELD_SAMPLES = 0.5, 20

#: Peaks that were recorded lie between these, g: the largest ever are 2.7 horizontally, 4 vertically.
_WEAKEST, _STRONGEST = 0.001, 3.0

#: Displacement of the ground (m) that is a drift where the velocity at the end is more than a share of the peak's, and
#: one that is a drift anyhow: the largest along a fault are 9.
_DRIFT, _DRIFT_VELOCITY, _LARGEST_DISPLACEMENT = 2.0, 0.05, 10.0


def without_fill_values(times: Floats, values: Floats) -> tuple[Floats, Floats, str]:
    """Times (s) and values, in any unit, without those that stand for missing samples; and what is missing."""
    missing, intervals = _is_fill(values), np.diff(times)
    findings = []
    if missing.any():
        kinds = ", ".join("blank" if np.isnan(one) else f"{one:g}" for one in np.unique(values[missing])[:3])
        count = f"{missing.sum()} fill value{'s' if missing.sum() > 1 else ''}"
        findings.append(f"{count} ({kinds}), first at t = {times[missing][0]:.6g} s")
    if intervals.size >= _FEWEST and (intervals > 0.0).all():
        median = float(np.median(intervals))
        wide = np.flatnonzero(intervals > _GAP * median)
        more = f", and {wide.size - 1} more" if wide.size > 1 else ""
        findings += [
            f"no samples from t = {times[at]:.6g} to {times[at + 1]:.6g} s ({intervals[at] / median:.0f} times the "
            f"median interval of {median:.4g} s){more}"
            for at in wide[:1]
        ]
        findings += _held(times[~missing], values[~missing])
    return times[~missing], values[~missing], "; ".join(findings)


def _is_fill(values: Floats) -> NDArray[np.bool_]:
    """Which values stand for missing samples."""
    missing, magnitude = np.isnan(values), np.abs(np.nan_to_num(values))
    known = np.isin(magnitude, _FILL)
    others = np.flatnonzero(~known & ~missing)
    if known.any() and others.size:
        # 999 gal may be a peak: then its neighbours are on the way to it
        between = np.interp(np.arange(values.size), others, values[others])
        missing |= known & (np.abs(values - between) > 0.5 * magnitude)
    # the same number again and again, far above all others
    largest = magnitude == magnitude.max(initial=0.0)
    rest = magnitude[~largest].max(initial=0.0)
    is_alone = largest.sum() > 1 and magnitude.max(initial=0.0) > 20.0 * rest > 0.0 and values.size > _FEWEST
    return missing | (largest & is_alone)


def _held(times: Floats, values: Floats) -> list[str]:
    """The first value that does not change while the ground shakes."""
    starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    lasts = np.flatnonzero(np.diff(values, append=np.nan) != 0.0)
    own, peak = values[starts], np.abs(values).max(initial=0.0)
    before, after = values[np.maximum(starts - 1, 0)], values[np.minimum(lasts + 1, values.size - 1)]
    jumps = np.minimum(np.abs(before - own), np.abs(after - own))
    shakes = (np.abs(own) > 0.01 * peak) | (jumps > 0.05 * peak)  # else the ground is at rest
    long = (lasts - starts >= _HELD_SAMPLES) & (times[lasts] - times[starts] >= _HELD)
    return [
        f"the value {own[at]:.6g} is held from t = {times[starts[at]]:.6g} to {times[lasts[at]]:.6g} s"
        for at in np.flatnonzero(shakes & long)[:1]
    ]


def odd_peak(record: Motion, unit: str) -> str:
    """A peak that was never recorded, read in `unit`, and the unit that would explain it."""
    at = int(np.abs(record.acceleration).argmax())
    peak = record.acceleration[at] / STANDARD_GRAVITY
    if (abs(peak) >= _WEAKEST or record.times.size <= _FEWEST) and abs(peak) <= _STRONGEST:
        return ""
    in_unit = {other: abs(peak) * factor / UNITS[unit] for other, factor in UNITS.items()}
    likely = min(in_unit, key=lambda other: abs(np.log(max(in_unit[other], 1e-300) / 0.3)))
    explains = 0.02 <= in_unit[likely] <= 1.5
    hint = f" (read in {unit}; in {likely} it would be {in_unit[likely]:.3g} g)" if explains else ""
    limit = f"above {_STRONGEST:g} g" if abs(peak) > 1.0 else f"below {_WEAKEST:g} g"
    return f"peak acceleration {peak:.4g} g at t = {record.times[at]:.6g} s{hint}: {limit}, check units and header"


def drift(record: Motion) -> str:
    """A ground that moves away, as the integral of an offset does."""
    if record.times.size <= _FEWEST:
        return ""
    displacement, end = peak_displacement(record), float(np.trapezoid(record.acceleration, record.times))
    moves_on = displacement > _DRIFT and abs(end) > _DRIFT_VELOCITY * peak_velocity(record)
    if not moves_on and not displacement > _LARGEST_DISPLACEMENT:
        return ""
    return (
        f"the ground moves {displacement:.3g} m and has a velocity of {end:.3g} m/s at t = {record.times[-1]:.6g} s: "
        "an offset or a drift; baseline = 'linear' takes a straight line off the acceleration"
    )
