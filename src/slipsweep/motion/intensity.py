"""Intensity measures of a recorded motion, by the definitions of the literature.

Acceleration is interpolated linearly between samples, and v = d = 0 at the first one.  Velocity is
then a parabola on each interval, and displacement a cubic, so that all integrals and extremes are
exact to rounding, also with uneven sampling.  (Only the mean period is defined by a discrete
Fourier transform.)  Nothing is subtracted from the acceleration beside the `baseline` at reading.
"g" is standard gravity.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.motion.reading import STANDARD_GRAVITY

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Floats = NDArray[np.float64]

#: Least and largest frequency in the mean period, and largest spacing, Hz (Rathje et al. 1998,
#: 2004).
_LOWEST = 0.25
_HIGHEST = 20.0
_SPACING = 0.05

#: Largest sampling interval, s, at which an unevenly sampled motion is sampled anew.
_RESAMPLED = 0.005


def intensity_measures(times: Floats, acceleration: Floats) -> dict[str, float]:
    """Return all of `variables.INTENSITY_MEASURES`; NaN if one is not defined.

    `times` are in s, `acceleration` in m/s².
    """
    return {
        "pga": float(np.abs(acceleration).max()),
        "pgv": peak_velocity(times, acceleration),
        "pgd": peak_displacement(times, acceleration),
        "arias_intensity": arias_intensity(times, acceleration),
        "cav": cumulative_absolute_velocity(times, acceleration),
        "significant_duration": significant_duration(times, acceleration),
        "mean_period": mean_period(times, acceleration),
    }


def strength_factor(times: Floats, acceleration: Floats, inputs: Mapping[str, Any]) -> Any:
    """Return the factor on the acceleration of a record for the strength in `inputs`.

    The strength is one of `scale`, `amplitude` (m/s²), `pgv` (m/s) and `arias_intensity` (m/s).
    The last two grow with the time scale; they are those of the motion after `time_scale`.
    """
    # a motion that is zero throughout is refused elsewhere, by its name
    with np.errstate(divide="ignore", invalid="ignore"):
        if "scale" in inputs:
            return inputs["scale"]
        if "amplitude" in inputs:
            return inputs["amplitude"] / np.abs(acceleration).max()
        if "pgv" in inputs:
            return inputs["pgv"] / (peak_velocity(times, acceleration) * inputs["time_scale"])
        recorded = np.float64(arias_intensity(times, acceleration))
        return np.sqrt(inputs["arias_intensity"] / (recorded * inputs["time_scale"]))


def peak_velocity(times: Floats, acceleration: Floats) -> float:
    """Peak ground velocity, max |∫ Üg dt|, m/s."""
    lines = _lines(times, acceleration)
    return _largest(lines.antiderivative(), lines)


def peak_displacement(times: Floats, acceleration: Floats) -> float:
    """Peak ground displacement, max |∫∫ Üg dt dt|, m."""
    velocity = _lines(times, acceleration).antiderivative()
    return _largest(velocity.antiderivative(), velocity)


def arias_intensity(times: Floats, acceleration: Floats) -> float:
    """Arias intensity π/(2g) ∫ Üg² dt, m/s (Arias 1970)."""
    return math.pi / (2.0 * STANDARD_GRAVITY) * float(_energy(times, acceleration)(times[-1]))


def cumulative_absolute_velocity(times: Floats, acceleration: Floats) -> float:
    """Cumulative absolute velocity ∫ |Üg| dt, m/s (EPRI 1988; Kramer 1996, section 3.3)."""
    places = np.union1d(times, _zeros(_lines(times, acceleration)))
    return float(np.trapezoid(np.abs(np.interp(places, times, acceleration)), places))


def significant_duration(times: Floats, acceleration: Floats) -> float:
    """Time between 5 % and 95 % of the Arias intensity, s (Trifunac and Brady 1975)."""
    from scipy.optimize import brentq

    energy = _energy(times, acceleration)
    (first, last) = (times[0], times[-1])
    total = float(energy(last))
    if not total > 0.0:
        return 0.0

    def reached(share: float) -> float:
        time: float = brentq(
            lambda time: float(energy(time)) - share * total,
            first,
            last,
            xtol=1e-15 * (last - first),
        )
        return time

    return reached(0.95) - reached(0.05)


def mean_period(times: Floats, acceleration: Floats) -> float:
    """Mean period Tm = Σ Cᵢ²/fᵢ / Σ Cᵢ², s, over 0.25 Hz ≤ fᵢ ≤ 20 Hz (Rathje et al. 1998).

    Cᵢ are the amplitudes of the discrete Fourier transform, at frequencies at most 0.05 Hz apart: a
    motion shorter than 20 s is continued with zeros (Rathje et al. 2004).  A motion that is not
    evenly sampled is sampled anew, at its median interval or, if that is longer, every 0.005 s.
    NaN if the motion has no such frequencies.
    """
    spacing = spacing_of(times)
    step = (
        float(spacing[0]) if np.ptp(spacing) == 0.0 else min(float(np.median(spacing)), _RESAMPLED)
    )
    samples = np.interp(np.arange(times[0], times[-1] + 1e-6 * step, step), times, acceleration)
    length = max(samples.size, math.ceil(1.0 / (_SPACING * step)))
    frequency = np.fft.rfftfreq(length, step)
    chosen = (frequency >= _LOWEST * (1.0 - 1e-12)) & (frequency <= _HIGHEST * (1.0 + 1e-12))
    power = np.abs(np.fft.rfft(samples, length)[chosen]) ** 2
    return float((power / frequency[chosen]).sum() / power.sum()) if power.sum() > 0.0 else math.nan


def spacing_of(times: Floats) -> Floats:
    """Return the intervals between samples; all are equal if the times are even to rounding.

    Differences of times would have the rounding of the times, 1e-10 of an interval after a million
    samples.
    """
    even = np.linspace(times[0], times[-1], times.size)
    is_even = np.abs(times - even).max() <= 2.0 * np.spacing(np.abs(times).max())
    if is_even:
        return np.full(times.size - 1, (times[-1] - times[0]) / (times.size - 1))
    return np.diff(times)


def _lines(times: Floats, acceleration: Floats) -> "PPoly":
    """Return the straight lines between the samples."""
    from scipy.interpolate import PPoly  # imported late: a sweep under a waveform does without

    slope = np.diff(acceleration) / np.diff(times)
    return PPoly(np.array([slope, acceleration[:-1]]), times)


def _energy(times: Floats, acceleration: Floats) -> "PPoly":
    """Return ∫ Üg² dt as a function of time."""
    lines = _lines(times, acceleration)
    slope, first = lines.c
    return type(lines)(
        np.array([slope * slope, 2.0 * slope * first, first * first]), lines.x
    ).antiderivative()


def _zeros(curve: "PPoly") -> Floats:
    """Return the zeros of a curve; a piece that is zero throughout has none."""
    roots: Floats = curve.roots(discontinuity=False, extrapolate=False)
    return roots[np.isfinite(roots)]


def _largest(curve: "PPoly", derivative: "PPoly") -> float:
    return float(np.abs(curve(np.concatenate([curve.x, _zeros(derivative)]))).max())
