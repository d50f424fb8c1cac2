"""Intensity measures of a recorded motion, by the definitions of the literature.

Acceleration is interpolated linearly between samples, and v = d = 0 at the first one: velocity is then a parabola on
each interval and displacement a cubic, and every integral and extreme below is theirs, exact to rounding, at any
sampling, even or not.  (The mean period alone is defined by a discrete Fourier transform.)  Nothing is taken off the
acceleration but what `baseline` took off when it was read: where it leaves a drift, the peak ground velocity and
displacement have it.  "g" is standard gravity.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from slipsweep.model.variables import INTENSITY_MEASURES
from slipsweep.motion.records import STANDARD_GRAVITY, Record

Floats = NDArray[np.float64]

#: Frequencies that the mean period is of, Hz, and their largest spacing (Rathje et al. 1998, 2004).
_LOWEST, _HIGHEST, _SPACING = 0.25, 20.0, 0.05

#: Sampling of a motion whose own is not even, s, and the most samples of a transform.
_RESAMPLED, _MOST_SAMPLES = 0.005, 2**22

#: π/2g of the Arias intensity, s²/m.
_ARIAS = math.pi / (2.0 * STANDARD_GRAVITY)

#: Intervals that differ by less than this part of them are the same: times are rounded.
_EVEN = 1e-6


def intensity_measures(record: Record) -> dict[str, float]:
    """All measures of `variables.INTENSITY_MEASURES` of a record; NaN where one is not defined."""
    found = {
        "pga": record.peak,
        "pgv": peak_velocity(record),
        "pgd": peak_displacement(record),
        "arias_intensity": arias_intensity(record),
        "cav": cumulative_absolute_velocity(record),
        "significant_duration": significant_duration(record),
        "mean_period": mean_period(record),
    }
    return {name: found[name] for name in INTENSITY_MEASURES}


def strength_factor(record: Record, given: Mapping[str, Floats]) -> Floats:
    """What the acceleration of a record is multiplied by, for the strength that is given.

    Parameters
    ----------
    record : Record
    given : mapping of str to array
        One of `scale`, `amplitude` (m/s²), `pgv` (m/s) and `arias_intensity` (m/s), and `time_scale`.  The last two
        grow with the time scale: the target is that of the motion as it shakes the plane.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # what is infinite then is refused by name
        if "scale" in given:
            return given["scale"]
        if "amplitude" in given:
            return given["amplitude"] / record.peak
        if "pgv" in given:
            return given["pgv"] / (peak_velocity(record) * given["time_scale"])
        # root by root: the square of a peak may be too large
        root = math.sqrt(_ARIAS * float(_energy(record)[-1])) * record.peak
        return np.sqrt(given["arias_intensity"]) / np.sqrt(given["time_scale"]) / root


def peak_velocity(record: Record) -> float:
    """Peak ground velocity, max |∫ Üg dt|, m/s."""
    interval, first, last = _intervals(record)
    velocity = _velocities(interval, first, last)
    # between two samples v is extreme where the acceleration is zero
    crosses = first * np.sign(last) < 0.0
    first, last = first[crosses], last[crosses]
    between = velocity[:-1][crosses] + 0.5 * first * interval[crosses] * (first / (first - last))
    return _largest(velocity, between)


def peak_displacement(record: Record) -> float:
    """Peak ground displacement, max |∫∫ Üg dt dt|, m."""
    interval, first, last = _intervals(record)
    velocity = _velocities(interval, first, last)
    with np.errstate(over="ignore", invalid="ignore"):
        moved = (velocity[:-1] + (first / 3.0 + last / 6.0) * interval) * interval
        displacement = np.concatenate([[0.0], np.cumsum(moved)])
        # between two samples d is extreme where v = v₀ + a₀τ + sτ²/2 is zero
        slope = (last - first) / interval
        root = np.sqrt(np.maximum(first * first - 2.0 * slope * velocity[:-1], 0.0))
        q = -(first + np.copysign(root, first))
    between = [np.empty(0)]
    for above, below in ((q, slope), (2.0 * velocity[:-1], q)):
        with np.errstate(all="ignore"):
            tau = above / below
            inside = (tau > 0.0) & (tau < interval)
            own = (velocity[:-1] + (first / 2.0 + slope * tau / 6.0) * tau) * tau
        between.append((displacement[:-1] + own)[inside])
    return _largest(displacement, *between)


def arias_intensity(record: Record) -> float:
    """Arias intensity π/(2g) ∫ Üg² dt, m/s (Arias 1970)."""
    return _ARIAS * float(_energy(record)[-1]) * record.peak * record.peak


def cumulative_absolute_velocity(record: Record) -> float:
    """Cumulative absolute velocity ∫ |Üg| dt, m/s (EPRI 1988; Kramer 1996, section 3.3)."""
    interval, first, last = _intervals(record)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        straight = 0.5 * np.abs(first + last)
        # two triangles where the line passes zero
        share = first / (first - last)
        crossed = 0.5 * (np.abs(first) * share + np.abs(last) * (1.0 - share))
        area = np.where(first * np.sign(last) < 0.0, crossed, straight)
        return float((area * interval).sum())


def significant_duration(record: Record, low: float = 0.05, high: float = 0.95) -> float:
    """Time between 5 % and 95 % of the Arias intensity, s (Trifunac and Brady 1975)."""
    energy = _energy(record)
    if not energy[-1] > 0.0:
        return 0.0
    interval, first, last = _intervals(record)
    times = []
    for share in (low, high):
        target = share * energy[-1]
        at = min(int(np.searchsorted(energy, target, side="right")) - 1, interval.size - 1)
        a, b, step = float(first[at]) / record.peak, float(last[at]) / record.peak, float(interval[at])
        rest, slope = target - energy[at], (b - a) / step
        # ∫ (a + sτ)² dτ = ((a + sτ)³ - a³) / 3s
        if abs(b - a) > 1e-4 * abs(a):
            within = (float(np.cbrt(a**3 + 3.0 * slope * rest)) - a) / slope
        else:  # the difference of two cubes would be all rounding: the mean of Üg² is found in a few rounds
            within = 0.0
            for _ in range(5):
                within = rest / (a * a + slope * within * (a + slope * within / 3.0))
        times.append(float(record.times[at]) + min(max(within, 0.0), step))
    return times[1] - times[0]


def mean_period(record: Record) -> float:
    """Mean period Tm = Σ Cᵢ²/fᵢ / Σ Cᵢ², s, over 0.25 Hz ≤ fᵢ ≤ 20 Hz (Rathje, Abrahamson and Bray 1998).

    Cᵢ are the amplitudes of the discrete Fourier transform, at frequencies at most 0.05 Hz apart: a motion shorter
    than 20 s is continued with zeros (Rathje et al. 2004).  One that is not evenly sampled is sampled anew, at its
    median interval or, if that is longer, every 0.005 s.  NaN of a motion without such frequencies.
    """
    values = _evenly_sampled(record)
    if values is None:
        return math.nan
    samples, step = values
    length = max(samples.size, math.ceil(1.0 / (_SPACING * step)))
    frequency = np.fft.rfftfreq(length, step)
    chosen = (frequency >= _LOWEST * (1.0 - 1e-12)) & (frequency <= _HIGHEST * (1.0 + 1e-12))
    power = np.abs(np.fft.rfft(samples, length)[chosen]) ** 2
    total = power.sum()
    return float((power / frequency[chosen]).sum() / total) if total > 0.0 else math.nan


def _evenly_sampled(record: Record) -> tuple[Floats, float] | None:
    """A record of peak 1 at an even interval, and that; None where nothing moves."""
    if not record.peak > 0.0:
        return None
    duration = float(record.times[-1] - record.times[0])
    own = np.diff(record.times)
    mean = duration / own.size
    is_even = bool(np.abs(own - mean).max() <= _EVEN * mean + 4.0 * np.spacing(np.abs(record.times).max()))
    step = mean if is_even else min(float(np.median(own)), _RESAMPLED)
    step = max(step, max(duration, 1.0 / _SPACING) / _MOST_SAMPLES)
    if not math.isfinite(step):
        return None
    if step == mean:
        return record.acceleration / record.peak, step
    times = record.times[0] + step * np.arange(math.floor(duration / step) + 1)
    return np.interp(times, record.times, record.acceleration) / record.peak, step


def _intervals(record: Record) -> tuple[Floats, Floats, Floats]:
    """Lengths of the intervals between samples, and the accelerations at their ends."""
    with np.errstate(over="ignore"):
        return np.diff(record.times), record.acceleration[:-1], record.acceleration[1:]


def _velocities(interval: Floats, first: Floats, last: Floats) -> Floats:
    """The velocity at every sample."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.concatenate([[0.0], np.cumsum(0.5 * (first + last) * interval)])


def _energy(record: Record) -> Floats:
    """∫ Üg² dt up to every sample, with the peak as the unit: its square may be too large."""
    if not record.peak > 0.0:
        return np.zeros(record.times.size)
    interval, first, last = _intervals(record)
    first, last = first / record.peak, last / record.peak
    with np.errstate(over="ignore"):
        return np.concatenate([[0.0], np.cumsum((first * first + first * last + last * last) * (interval / 3.0))])


def _largest(*values: Floats) -> float:
    return max(float(np.abs(one).max(initial=0.0)) for one in values)
