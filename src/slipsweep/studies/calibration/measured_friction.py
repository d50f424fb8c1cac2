"""`measured_friction`: Eq. 1 and statics on recorded accelerations, and the slides in them.

The block slides where its acceleration is not the table's.  A slide is looked for in the relative
acceleration r = Üg − Ü: it begins where |r| exceeds a threshold at two consecutive samples, and
goes on until the relative velocity, the integral of r from there on, comes back to zero or r stays
below the threshold.  The threshold stands above the noise of r, which is estimated from r itself.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.stats import t as student

from slipsweep._version import __version__
from slipsweep.errors import InputError
from slipsweep.model import equations
from slipsweep.model.docstrings import with_parameters
from slipsweep.model.parameters import (
    check_finite,
    check_numbers,
    check_single,
    shown,
    single_friction_coefficient,
)
from slipsweep.model.variables import HISTORY, MEASURED_FRICTION, PARAMETERS, REFERENCE, SLIDES
from slipsweep.studies.calibration.shaking_test import (
    CHANNELS,
    TABLE,
    ShakingTest,
    read_test,
    unit_factor,
)

Floats = NDArray[np.float64]

#: Standard deviations of a normal distribution to either end of a 95 % interval.
QUANTILE = 1.959964

#: Types of a test.
Test = str | Path | ShakingTest | xr.Dataset | Mapping[str, xr.DataArray]

#: Threshold of a slide in standard deviations of the noise of r; one sample in 16 000 exceeds it by
#: chance.
NOISE_IN_THRESHOLD = 4.0

#: Least threshold in parts of the table's largest acceleration: two sensors may differ by this.
LEAST_THRESHOLD = 0.005

#: A slide begins where so many samples in turn exceed the threshold.
_BEGINS = 2

#: It ends where so many samples in turn stay below it and the integral of r is back at zero, or so
#: many whatever the integral is (an offset of a sensor makes it wrong).
_ENDS = 4
_ENDS_ANYWAY = 20

#: Samples at either end of a slide that do not count for its friction.
_AT_ENDS = 3

#: Samples that show the onset of a slide.
_FIRST = 6

#: Friction is level if it scatters by this part of itself at most beyond the noise, and Eq. 1 falls
#: if this part of its samples lies below that part of the static coefficient.
_LEVEL = 0.05
_LOW_SHARE = 0.05
_LOW = 0.8

#: Constant friction of more than so many times the static coefficient is doubted: a channel may
#: have a wrong unit or sign.
_TOO_MUCH = 1.25

#: Attributes of results: the program and the paper.
SOURCE = {"source": f"slipsweep {__version__}", "references": REFERENCE}

#: The ends of intervals of results.
BOUND = xr.Variable(
    ("bound",),
    [0.025, 0.975],
    {"units": "1", "long_name": "probability below an end of an interval"},
)


def noise_of(values: Floats) -> float:
    """Return the standard deviation of the noise of evenly, or nearly evenly, sampled values.

    It is that of third differences by their median, which few large values do not change.
    """
    # third differences of white noise have 20 times its variance; those of a motion that is sampled
    # densely are small
    differences = np.diff(values[np.isfinite(values)], 3) / 20.0**0.5
    return float(1.4826 * np.median(np.abs(differences))) if differences.size else 0.0


def threshold_of(table: Floats, block: Floats) -> tuple[float, str]:
    """Return the relative acceleration beyond which the block slides, m/s², and its reason."""
    noise = noise_of(table - block)
    least = LEAST_THRESHOLD * float(np.abs(table).max())
    if NOISE_IN_THRESHOLD * noise < least:
        return (
            least,
            f"{LEAST_THRESHOLD:.1%} of the largest acceleration of the table (the noise is "
            "smaller)",
        )
    reason = (
        f"{NOISE_IN_THRESHOLD:g} standard deviations of the noise of the relative acceleration, "
        f"{noise:.3g} m s-2"
    )
    return NOISE_IN_THRESHOLD * noise, reason


def slides_of(times: Floats, table: Floats, block: Floats, threshold: float) -> list[slice]:
    """Return the samples of each slide; the last has no end if the record ends first."""
    relative = np.nan_to_num(table - block)
    beyond = np.abs(relative) > threshold
    begins = np.flatnonzero(_in_turn(beyond, _BEGINS))
    quiet = _in_turn(~beyond, _ENDS)
    long_quiet = _in_turn(~beyond, _ENDS_ANYWAY)
    slides: list[slice] = []
    at = 0
    while at < times.size and (after := begins[begins >= at]).size:
        onset = int(after[0])
        # back to where r left zero
        while (
            onset > at
            and relative[onset - 1] * relative[onset] > 0.0
            and abs(relative[onset - 1]) > threshold / 4
        ):
            onset -= 1
        signed = cumulative_trapezoid(relative[onset:], times[onset:], initial=0.0)
        # at rest r stays zero, and the velocity is back at zero, but for the integral of the noise
        noise = threshold * (times[min(onset + 1, times.size - 1)] - times[onset])
        slow = np.abs(signed) <= 0.1 * np.maximum.accumulate(np.abs(signed)) + noise
        turned = (
            signed * np.sign(signed[min(_BEGINS, signed.size - 1)]) < 0.0
        )  # as a slide the other way begins
        stops = np.flatnonzero(((quiet[onset:] & slow) | long_quiet[onset:] | turned)[1:])
        slides.append(slice(onset, onset + 2 + int(stops[0]) if stops.size else None))
        at = slides[-1].stop or times.size
    return slides


def _in_turn(holds: NDArray[np.bool_], count: int) -> NDArray[np.bool_]:
    """Return True where something holds at `count` samples in a row."""
    return np.asarray(np.convolve(holds, np.ones(count))[count - 1 :] == count)


def onset_acceleration(table: Floats, block: Floats, slide: slice, threshold: float) -> float:
    """Return the table's acceleration at the onset of a slide, where r leaves zero.

    A straight line through the first samples of the slide is continued back to r = 0.
    """
    relative = table - block
    to_peak = slice(slide.start, slide.start + np.argmax(table[slide]) + 1)
    rising = slide.start + np.flatnonzero(np.abs(relative[to_peak]) > threshold)[:_FIRST]
    if rising.size < 3:
        return float(table[slide.start])
    start = np.polynomial.Polynomial.fit(relative[rising], table[rising], 1)(0.0)
    # r may not grow in a straight line: the onset is no earlier than two samples before
    return float(np.clip(start, *sorted((table[max(slide.start - 2, 0)], table[rising[0]]))))


def free_body_friction(block: Floats, theta: float, g: float) -> Floats:
    """Return the friction coefficient by statics, tan(θ + arctan(Ü/g)); `theta` in degrees.

    At rest it is the mobilised friction.
    """
    return np.asarray(np.tan(np.radians(theta) + np.arctan(block / g)))


def eq1_friction(table: Any, block: Any, theta: float, mu_s: float, g: float) -> Floats:
    """Return the friction coefficient by Eq. 1 at recorded accelerations; `theta` in degrees."""
    tan_theta = math.tan(math.radians(theta))
    return np.asarray(equations.mobilised_friction(table, block, mu_s, tan_theta, g))


def coefficients_of(
    table: Floats, block: Floats, slides: Sequence[slice], mu_s: float, theta: float, g: float
) -> xr.Dataset:
    """Return static and kinetic friction by statics, with 95 % intervals.

    They are those of the slides that begin downslope.  The attribute `constant_friction` is a
    sentence if friction is level while the block slides, where Eq. 1 falls.
    """
    threshold = threshold_of(table, block)[0]
    eq1 = eq1_friction(table, block, theta, mu_s, g)
    free = free_body_friction(block, theta, g)
    inside = []
    onsets = []
    for slide in slides:
        part = slice(slide.start + _AT_ENDS, (slide.stop or table.size) - _AT_ENDS)
        first = slice(slide.start, slide.start + _AT_ENDS)
        is_downslope = np.nanmean((table - block)[first]) > 0.0
        if is_downslope and np.isfinite(free[part]).sum() >= 3:
            inside.append(np.column_stack([free[part], eq1[part]]))
            onsets.append(_block_at_onset(table, block, slide, threshold))
    static = kinetic = np.full(3, np.nan)
    is_constant = False
    if inside:
        # slope of the friction over the block's acceleration, near enough
        slope = 1.0 / g / np.cos(np.radians(theta)) ** 2
        noise = noise_of(block) * slope
        samples = np.concatenate(inside)
        levels = np.array([np.nanmean(of_slide[:, 0]) for of_slide in inside])
        noise_of_level = noise / (samples.shape[0] / len(levels)) ** 0.5
        kinetic = mean_with_interval(levels, noise_of_level, 0.0)
        starts, errors = np.array(onsets).T
        systematic = float(np.mean(errors)) * slope
        static = mean_with_interval(free_body_friction(starts, theta, g), noise, systematic)
        scatter = float(np.nanmean((samples[:, 0] - kinetic[1]) ** 2)) - noise**2
        is_level = kinetic[1] > 0.0 and max(scatter, 0.0) ** 0.5 < _LEVEL * kinetic[1]
        is_constant = is_level and float(np.nanquantile(samples[:, 1], _LOW_SHARE)) < _LOW * mu_s
    coefficients = {}
    for kind, (low, value, high) in (("static", static), ("kinetic", kinetic)):
        name = f"{kind} friction coefficient by statics"
        about = {"units": "1", "long_name": name}
        of_interval = {"units": "1", "long_name": f"95 % interval of the {name}"}
        interval = xr.Variable(("bound",), [low, high], of_interval)
        coefficients[f"{kind}_friction"] = xr.Variable((), value, about)
        coefficients[f"{kind}_friction_interval"] = interval
    sentence = _constant_friction_text(static[1], kinetic[1], mu_s) if is_constant else ""
    return xr.Dataset(coefficients, attrs={"constant_friction": sentence})


def _block_at_onset(
    table: Floats, block: Floats, slide: slice, threshold: float
) -> tuple[float, float]:
    """Return the block's acceleration at the onset of a slide, and its error, m/s².

    If the block's acceleration jumps at the onset, the onset lies between two samples of the table.
    """
    first = slide.start + int(np.argmax((table - block)[slide] > threshold))
    after_onset = float(np.nanmean(block[first : first + _FIRST]))
    before = float(table[max(first - 1, 0)])
    after = float(table[first])
    # without a jump the block would slide at the sample before, too
    jumps = before - after_onset > threshold
    return (0.5 * (before + after), 0.5 * (after - before)) if jumps else (after_onset, 0.0)


def _constant_friction_text(static: float, kinetic: float, mu_s: float) -> str:
    """Return the sentence on constant friction; friction far above μs is doubted."""
    if max(static, kinetic) > _TOO_MUCH * mu_s:
        return (
            f"By statics friction is {static:.3g} where a slide begins and {kinetic:.3g} in it, "
            f"more than mu_s = {mu_s:.3g}: are signs and units of all channels, theta and mu_s "
            "right?"
        )
    return (
        f"This is a block of constant friction: by statics {kinetic:.3g} while it slides, though "
        "Eq. 1 falls. Newmark's model is the right one for it."
    )


def mean_with_interval(values: Floats, noise: float, systematic: float) -> Floats:
    """Return the mean of a value for each slide, between the ends of its 95 % interval.

    The interval has the scatter of the values or their noise, whichever is larger, and a systematic
    error, which does not become smaller with the number of slides.
    """
    number = values.size
    scatter = (
        float(np.std(values, ddof=1)) * float(student.ppf(0.975, number - 1)) if number > 1 else 0.0
    )
    half = max(scatter, QUANTILE * noise) / number**0.5 + systematic
    return float(np.mean(values)) + np.array([-half, 0.0, half])


@with_parameters
def measured_friction(
    test: Test,
    theta: float,
    mu_s: float | None = None,
    *,
    phi: float | None = None,
    g: float = 9.81,
    offset: str | Sequence[str] = (),
    drift: str | Sequence[str] = (),
    rest: tuple[float, float] | None = None,
    threshold: float | None = None,
) -> xr.Dataset:
    """Friction in a test on a shaking table, by Eq. 1 and by statics, and the slides in it.

    Eq. 1 of the paper (reference [1] of `sweep`) gives μ(t) from the accelerations of table and
    block.  It falls also for a block of constant friction.  Statics gives the friction that acts on
    the block, tan(θ + arctan(Ü/g)).

    Parameters
    ----------
    test : path, Dataset, mapping of str to DataArray, or ShakingTest
        A CSV file whose header names columns and units: ``time (s), table acceleration (g), block
        acceleration (m/s2)``; or a Dataset along `time` (s) with `ground_acceleration` (the
        table's) and `block_acceleration`, in m/s² or in the unit of their attribute `units`.
        Samples need not be evenly spaced.
    g : float
        Gravity, m/s².
    offset, drift : str or list of str
        Channels from which a constant, or a straight line, is subtracted; "all" for all.  The
        attribute `removed` has what was subtracted; nothing else is.
    rest : (float, float), optional
        Beginning and end of a time, s, in which table and block were at rest: what is subtracted is
        fitted to these samples, else to all.
    threshold : float, optional
        Relative acceleration beyond which the block slides, m/s²; by default 4 standard deviations
        of its noise, and 0.5 % of the table's largest acceleration at least.

    Returns
    -------
    Dataset
        Along `time` (s): `ground_acceleration`, `block_acceleration` (m/s²), `friction_coefficient`
        μ(t) by Eq. 1, `friction_ratio` μ(t)/μs, and `free_body_friction`, at rest the mobilised
        friction. Along `slide`: `slide_onset`, `slide_peak` (of the table's acceleration) and
        `slide_stop` (s; NaN where the record ends before), `onset_acceleration`,
        `peak_acceleration` and `peak_block_acceleration` (m/s²), `least_friction` (Eq. 1) and
        `slide_free_body_friction`.  `static_friction` and `kinetic_friction` by statics, each with
        ``_interval`` (95 %, along `bound`).  The attributes `threshold` (m/s²) and `threshold_from`
        say how slides were found; `constant_friction` is a sentence if friction is constant by
        statics where Eq. 1 falls.

    Raises
    ------
    InputError
        A test that cannot be read, without a block acceleration, or a value that no physics allows.

    See Also
    --------
    calibrate : the parameters of the model, from the same test

    Examples
    --------
    >>> import slipsweep
    >>> test = slipsweep.measured_friction("sweeps/data/shaking_test.csv", theta=5, mu_s=0.38)
    >>> test.sizes["slide"]
    8
    >>> test.least_friction.round(2).values
    array([0.07, 0.07, 0.06, 0.08, 0.06, 0.04, 0.06, 0.05])
    """
    recorded = test_of(test)
    if "block_acceleration" not in recorded.channels:
        raise InputError(
            f"{recorded.name}: block_acceleration: missing: Eq. 1 needs the accelerations of table "
            "and block; calibrate takes a test without"
        )
    theta = check_single("theta", theta)
    g = check_single("g", g)
    mu_s = single_friction_coefficient(mu_s, phi)
    corrected, removed = recorded.corrected(offset, drift, rest)
    check_contact(corrected, theta, g)
    times = corrected.times
    table = corrected.channels[TABLE]
    block = corrected.channels["block_acceleration"]
    eq1 = eq1_friction(table, block, theta, mu_s, g)
    free = free_body_friction(block, theta, g)
    limit, why = threshold_of(table, block)
    if threshold is not None:
        limit = check_finite("threshold", threshold)
        why = "given"
        if limit <= 0.0:
            raise InputError(f"threshold = {shown(threshold)}: must be a finite number > 0, m/s²")
    slides = slides_of(times, table, block, limit)
    coefficients = coefficients_of(table, block, slides, mu_s, theta, g)
    of_slides = {
        "slide_onset": [times[part.start] for part in slides],
        "slide_peak": [times[part][np.argmax(table[part])] for part in slides],
        "slide_stop": [times[part.stop - 1] if part.stop else np.nan for part in slides],
        "onset_acceleration": [onset_acceleration(table, block, part, limit) for part in slides],
        "peak_acceleration": [np.max(table[part]) for part in slides],
        "peak_block_acceleration": [np.nanmax(block[part]) for part in slides],
        "least_friction": [np.nanmin(eq1[part]) for part in slides],
        "slide_free_body_friction": [np.nanmedian(free[part]) for part in slides],
    }
    series = {
        TABLE: table,
        "block_acceleration": block,
        "friction_coefficient": eq1,
        "friction_ratio": eq1 / mu_s,
        "free_body_friction": free,
    }
    about = HISTORY | MEASURED_FRICTION
    return xr.Dataset(
        {name: (("time",), values, about[name]) for name, values in series.items()}
        | {
            name: (("slide",), np.array(values, np.float64), SLIDES[name])
            for name, values in of_slides.items()
        }
        | dict(coefficients.variables),
        {
            "time": ("time", times, {"units": "s", "long_name": "time"}),
            "theta": ((), theta, PARAMETERS["theta"]),
            "mu_s": ((), mu_s, PARAMETERS["mu_s"]),
            "bound": BOUND,
        },
        {
            "title": "Friction measured on a shaking table (Eq. 1, and by statics)",
            **SOURCE,
            **corrected.attrs,
            "g": g,
            **coefficients.attrs,
            "threshold": limit,
            "threshold_from": why,
            "removed": "; ".join(removed) or "nothing",
        },
    )


def test_of(test: Any) -> ShakingTest:
    """Return a test from any of the types that a caller may give."""
    if isinstance(test, ShakingTest):
        return test
    if not isinstance(test, (xr.Dataset, Mapping)):
        return read_test(test)
    arrays = {name: test[name] for name in ("time", *CHANNELS) if name in test}
    for name, array in arrays.items():
        if not isinstance(array, (xr.DataArray, xr.Variable)) or array.dims != ("time",):
            raise InputError(f"test: {name} = {shown(array)}: must be a DataArray along time")
    if "time" not in (data := xr.Dataset(arrays)):
        raise InputError("test: time: missing: must be a coordinate, s")
    channels = {}
    for name in ("time", *arrays):
        units = data[name].attrs.get("units")
        factor = 1.0 if units is None else unit_factor(f"test: {name}: units", name, str(units))
        channels[name] = factor * check_numbers(f"test: {name}", data[name])
    return ShakingTest(channels.pop("time"), channels)


def check_contact(test: ShakingTest, theta: float, g: float) -> None:
    """Raise InputError for a test in which the block would lift off (Eqs. 2 and 3)."""
    table = test.channels[TABLE]
    lowest = int(np.argmin(table))
    if equations.normal_acceleration(table[lowest], math.tan(math.radians(theta)), g) <= 0.0:
        raise InputError(
            f"{test.name}: {TABLE} = {table[lowest]:.4g} m/s2 at {test.times[lowest]:.6g} s: the "
            "block would lift off (g + Üg tan θ must be > 0); are its units right?"
        )
