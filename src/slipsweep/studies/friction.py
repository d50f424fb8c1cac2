"""The friction that a test measured: Eq. 1 on recorded accelerations, and the slides in them.

The block slides where its acceleration is not the table's.  A slide is looked for in the relative acceleration
r = Üg − Ü: it begins where |r| exceeds a threshold at two samples in turn, and goes on until the relative velocity,
the integral of r from there on, comes back to zero or r stays below the threshold.  The threshold stands above
the noise of r, which is estimated from r itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.kernels.history import eq1_friction
from slipsweep.model.parameters import check_finite, check_single, shown
from slipsweep.model.variables import HISTORY, MEASURED_FRICTION, PARAMETERS, SLIDES
from slipsweep.motion.shaking import TABLE, ShakingTest, removed_text

Floats = NDArray[np.float64]

#: Standard deviations of the noise that the threshold is: one sample in 16 000 exceeds it by chance.
NOISE_IN_THRESHOLD = 4.0

#: The least threshold, in parts of the table's largest acceleration: what differs by less is no slide, but two
#: sensors that do not agree.
LEAST_THRESHOLD = 0.005

#: Samples in turn that begin a slide by exceeding the threshold; that end one by staying below it while the integral
#: of r is back at zero; and that end one whatever the integral, which an offset of a sensor takes along.
_BEGINS, _ENDS, _ENDS_ANYWAY = 2, 4, 20

#: Third differences of white noise have 20 times its variance; those of a motion that the sampling resolves are small.
_DIFFERENCES, _VARIANCE = 3, 20.0


@dataclass(frozen=True)
class Slide:
    """A slide: samples at which it begins and stops, None where the record ends first, and that of the table's peak."""

    onset: int
    peak: int
    stop: int | None

    @property
    def part(self) -> slice:
        """Its samples."""
        return slice(self.onset, None if self.stop is None else self.stop + 1)


def noise_of(values: Floats) -> float:
    """Standard deviation of the noise of evenly or nearly evenly sampled values: robust, from third differences."""
    finite = values[np.isfinite(values)]
    differences = np.diff(finite, _DIFFERENCES) / _VARIANCE**0.5
    return float(1.4826 * np.median(np.abs(differences))) if differences.size else 0.0


def threshold_of(test: ShakingTest, threshold: Any = None) -> tuple[float, str]:
    """The relative acceleration beyond which the block slides, m/s², and why that much."""
    if threshold is not None:
        value = check_finite("threshold", threshold)
        if value <= 0.0:
            raise InputError(f"threshold = {shown(threshold)}: must be a finite number > 0, m/s²")
        return value, "given"
    table = test.channels[TABLE]
    noise = noise_of(table - test.channels["block_acceleration"])
    least = LEAST_THRESHOLD * float(np.abs(table).max())
    if NOISE_IN_THRESHOLD * noise >= least:
        return NOISE_IN_THRESHOLD * noise, (
            f"{NOISE_IN_THRESHOLD:g} standard deviations of the noise of the relative acceleration, {noise:.3g} m s-2"
        )
    return least, f"{LEAST_THRESHOLD:.1%} of the largest acceleration of the table (the noise is smaller)"


def slides_of(times: Floats, table: Floats, block: Floats, threshold: float) -> list[Slide]:
    """The slides in recorded accelerations of the table and of the block."""
    relative = np.nan_to_num(table - block)
    beyond = np.abs(relative) > threshold
    quiet, long = _turns(~beyond, _ENDS), _turns(~beyond, _ENDS_ANYWAY)
    slides: list[Slide] = []
    begins = np.flatnonzero(_turns(beyond, _BEGINS))
    at = 0
    while (after := begins[begins >= at]).size:
        onset = int(after[0])
        # back to where r left zero
        while onset > at and relative[onset - 1] * relative[onset] > 0.0 and abs(relative[onset - 1]) > threshold / 4:
            onset -= 1
        stop = _stop(times[onset:], relative[onset:], quiet[onset:], long[onset:], threshold)
        last = times.size - 1 if stop is None else onset + stop
        peak = onset + int(np.argmax(table[onset : last + 1]))
        slides.append(Slide(onset, peak, None if stop is None else last))
        if stop is None:
            break
        at = last + 1
    return slides


def _turns(holds: NDArray[np.bool_], count: int) -> NDArray[np.bool_]:
    """Where something holds at a sample and at those after it, `count` in all."""
    found = holds.copy()
    for shift in range(1, count):
        found[:-shift] &= holds[shift:]
        found[-shift:] = False
    return found


def _stop(
    times: Floats, relative: Floats, quiet: NDArray[np.bool_], long: NDArray[np.bool_], threshold: float
) -> int | None:
    """Where a slide that begins at the first sample stops; None if the record ends before."""
    steps = 0.5 * (relative[1:] + relative[:-1]) * np.diff(times)
    velocity = np.abs(np.concatenate([[0.0], np.cumsum(steps)]))
    # at rest r is zero and stays so, and the velocity is back at zero, but for what the noise adds up to
    slow = velocity <= 0.1 * np.maximum.accumulate(velocity) + threshold * (times[1] - times[0])
    stops = np.flatnonzero((quiet & slow) | long)
    stops = stops[stops > 0]
    return int(stops[0]) if stops.size else None


def friction_table(
    test: ShakingTest,
    theta: Any,
    mu_s: Any,
    *,
    g: Any,
    offset: Any,
    drift: Any,
    rest: Sequence[float] | None,
    threshold: Any,
) -> xr.Dataset:
    """Measured friction; arguments, results and errors of `slipsweep.measured_friction`."""
    if "block_acceleration" not in test.channels:
        raise InputError(
            f"{test.name}: block_acceleration: missing: Eq. 1 needs the accelerations of table and block; calibrate "
            "takes a test without"
        )
    theta, mu_s, g = (check_single(name, value) for name, value in (("theta", theta), ("mu_s", mu_s), ("g", g)))
    test, removed = test.corrected(offset, drift, rest)
    table, block = test.channels[TABLE], test.channels["block_acceleration"]
    tan_theta = float(np.tan(np.radians(theta)))
    lowest = int(np.argmin(table))
    if g + table[lowest] * tan_theta <= 0.0:
        raise InputError(
            f"{test.name}: {TABLE} = {table[lowest]:.4g} m/s2 at {test.times[lowest]:.6g} s: the block would lift off "
            f"(g + Üg tan θ must be > 0); are its units right?"
        )
    friction = np.empty_like(table)
    eq1_friction(table, block, mu_s, tan_theta, g, friction)
    limit, why = threshold_of(test, threshold)
    slides = slides_of(test.times, table, block, limit)
    stops = [None if one.stop is None else test.times[one.stop] for one in slides]
    found = {
        "slide_onset": [test.times[one.onset] for one in slides],
        "slide_peak": [test.times[one.peak] for one in slides],
        "slide_stop": [np.nan if stop is None else stop for stop in stops],
        "onset_acceleration": [onset_acceleration(test.times, table, block, one, limit) for one in slides],
        "peak_acceleration": [table[one.peak] for one in slides],
        "peak_block_acceleration": [np.nanmax(block[one.part]) for one in slides],
        "least_friction": [np.nanmin(friction[one.part]) for one in slides],
    }
    series = {
        TABLE: table,
        "block_acceleration": block,
        "friction_coefficient": friction,
        "friction_ratio": friction / mu_s,
    }
    about = HISTORY | MEASURED_FRICTION
    return xr.Dataset(
        {name: xr.Variable(("time",), values, about[name]) for name, values in series.items()}
        | {name: xr.Variable(("slide",), np.array(values, np.float64), SLIDES[name]) for name, values in found.items()},
        {
            "time": xr.Variable(("time",), test.times, {"units": "s", "long_name": "time"}),
            "theta": xr.Variable((), np.array(theta), PARAMETERS["theta"]),
            "mu_s": xr.Variable((), np.array(mu_s), PARAMETERS["mu_s"]),
        },
        {
            "title": "Friction measured on a shaking table (Eq. 1)",
            **test.attrs,
            "g": g,
            "threshold": limit,
            "threshold_from": why,
            "removed": "; ".join(removed_text(removed)) or "nothing",
        },
    )


def onset_acceleration(times: Floats, table: Floats, block: Floats, slide: Slide, threshold: float) -> float:
    """The table's acceleration where r left zero: a straight line through the first samples of the slide, back to 0."""
    relative = table - block
    part = slice(slide.onset, slide.peak + 1)
    rising = np.flatnonzero(np.isfinite(relative[part]) & (np.abs(relative[part]) > threshold))[:6] + slide.onset
    if rising.size < 3:
        return float(table[slide.onset])
    line = np.polynomial.Polynomial.fit(relative[rising], table[rising], 1)
    start = float(line(0.0))
    # r need not grow in a straight line: no further back than the samples before
    low, high = sorted((table[max(slide.onset - 2, 0)], table[rising[0]]))
    return float(np.clip(start, low, high))
