"""The findings of a calibration: sentences on what the tests do not determine, and what would.

A sentence names one fact and what follows from it.  Those that forbid the use of the parameters
comment out the tables for a sweep file (`sweep_tables`).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.model import variables
from slipsweep.studies.calibration import sweep_tables
from slipsweep.studies.calibration.corrected import (
    corrected_channels,
    slides_in,
    table_at_samples,
)
from slipsweep.studies.calibration.estimate import Estimate, Fit, Solution
from slipsweep.studies.calibration.measured_friction import onset_acceleration
from slipsweep.studies.calibration.noise import flat_top, noisy_flat_top
from slipsweep.studies.calibration.observation import SOUGHT, Observation
from slipsweep.studies.calibration.shaking_test import TABLE
from slipsweep.studies.sweeps import sweep

#: Part of its largest acceleration from which on a table moves.
_MOVES = 0.1

#: Channels that may be cut off, and the ends (1 the upper) at which only the end of a range is
#: flat.
_RANGES = {TABLE: (1, -1), "block_acceleration": (-1,), "relative_velocity": (1, -1)}

#: The misfit of a channel is larger than its noise if it is more than so many times as large, and
#: more than this part of the channel's largest value.
_MISFIT_IN_NOISE = 1.5
_MISFIT_IN_LARGEST = 0.01

#: Factors on the motion of a test among which a further test is recommended.
_FURTHER_TESTS = np.array([0.6, 0.8, 1.25, 1.5, 2.0])

_ANOTHER = "Test at another amplitude and give calibrate all tests together"


def sweep_of(solution: Solution, estimated: Estimate, **changed: Any) -> xr.Dataset:
    """Return the sweep of the estimated parameters, or `changed` ones, under a test's motion."""
    observation = solution.observation
    best = dict(zip(SOUGHT, map(float, estimated.parameters), strict=True))
    return sweep(
        observation.theta,
        observation.mu_s,
        excitation=observation.record(solution.table_lines),
        model=observation.model,
        **{**best, **changed},
    )


def report(
    estimated: Estimate,
    results: xr.Dataset,
    constant: xr.Dataset | None,
    clipped: Sequence[str],
    misfit: Sequence[str],
) -> dict[str, str]:
    """Return the attributes that report a calibration: findings, and tables for a sweep file.

    `constant` are the coefficients of a test in which friction was constant, `clipped` and `misfit`
    sentences of `clipped_channels` and `unexplained_channels`.
    """
    observations = [solution.observation for solution in estimated.solutions]
    constant_friction = "" if constant is None else constant.attrs["constant_friction"]
    slides = bool((results["permanent_displacement"] != 0.0).any())
    sentences = [*clipped, *([constant_friction] if constant_friction else misfit)]
    for solution, name in _named(estimated):
        sentences += _coloured_noise(solution.observation, name)
    for solution in estimated.solutions:
        sentences += _moving_start(solution)
    for observation in observations:
        sentences += _upslope_slips(observation)
    if not slides:
        sentences.append(
            "The computed block does not slide: no parameter is determined. Test with a larger "
            "amplitude."
        )
    elif not estimated.determined.all():
        sentences += _undetermined(estimated)
    contradictions = []
    for solution in estimated.solutions:
        contradictions += _contradicted_yield(estimated, solution)
    for solution, name in _named(estimated):
        contradictions += _outliers(solution, name)
    sentences += contradictions
    if (results["validity"] & variables.Validity.NOT_RECOUPLED).any():
        sentences.append(
            "The computed block does not come to rest before the next slide begins (flag "
            "not_recoupled). Small errors of the table's motion may then change the motion much: "
            "the intervals may be too narrow."
        )
    if constant is not None and not clipped:
        tables = sweep_tables.newmark_tables(observations[0], constant)
    elif estimated.determined.all() and slides and not [*clipped, *misfit, *contradictions]:
        tables = sweep_tables.model_table(estimated), sweep_tables.uncertainty_table(estimated)
    else:
        tables = sweep_tables.commented_out(estimated, sentences), ""
    return {
        "constant_friction": constant_friction,
        "findings": "\n".join(sentences),
        "model_table": tables[0],
        "uncertainty_table": tables[1],
    }


def _named(estimated: Estimate) -> list[tuple[Solution, str]]:
    """Return tests, each with the beginning of a sentence: its name, if there are several."""
    several = len(estimated.solutions) > 1
    return [
        (solution, f"{solution.observation.test.name}: " if several else "")
        for solution in estimated.solutions
    ]


def _moving_start(solution: Solution) -> list[str]:
    """Return a sentence if the table moves as the record begins."""
    observation = solution.observation
    motion = observation.table_acceleration(solution.table_lines)
    first = float(motion[0])
    largest = float(np.abs(motion).max())
    if abs(first) <= max(_MOVES * largest, 3.0 * observation.motion.noise):
        return []
    return [
        f"The table moves as the record begins, at {first:.3g} m/s2. The block is taken to be at "
        "rest there. If it slides, the results are wrong: let the record begin where both are at "
        "rest."
    ]


def _upslope_slips(observation: Observation) -> list[str]:
    """Return a sentence if samples of slips upslope are left out."""
    times = observation.upslope
    if not times:
        return []
    many = f"{len(times)} time{'s' if len(times) > 1 else ''}"
    return [
        f"The block slipped upslope {many} (first at {times[0]:.3g} s). In stick-slip the model "
        "has no upslope slip: these samples are left out, and the displacement may step there."
    ]


def clipped_channels(estimated: Estimate) -> list[str]:
    """Return which channels are at the end of their range, in words.

    Some ends are flat without that: the top where a block holds its acceleration or its
    displacement, the bottom where it is at rest.
    """
    texts = []
    for solution, name in _named(estimated):
        for channel, signs in _RANGES.items():
            values = solution.observation.test.channels.get(channel, np.zeros(1))
            ends = _flat_ends(channel, values, signs)
            if ends:
                units = variables.HISTORY[channel]["units"]
                texts += [
                    f"{name}{channel} is cut off: it is flat at {' and '.join(ends)} {units}, as "
                    "of a sensor or converter at the end of its range.",
                    "The intervals do not include what is cut off. Test with a larger range.",
                ]
    return texts


def _flat_ends(channel: str, values: np.ndarray, signs: Sequence[int]) -> list[str]:
    """Return the values of a channel at the ends (1 the upper, −1 the lower) that are flat."""
    largest = float(np.nanmax(np.abs(values)))
    ends = []
    for sign in signs:
        end = float(np.nanmax(sign * values))
        is_flat = flat_top(sign * values) > 0
        if channel == TABLE and not is_flat:
            is_flat = noisy_flat_top(sign * values) > 0
        if is_flat and end > _MOVES * largest:
            ends.append(f"{sign * end:.4g}")
    return ends


def _coloured_noise(observation: Observation, name: str) -> list[str]:
    """Return sentences on coloured noise, if there is some."""
    rests = observation.motion.rests
    colours = [(TABLE, "" if rests else "at most ", observation.motion.colour)]
    for channel, colour in zip(observation.channels, observation.colour, strict=True):
        colours.append((channel, "", colour))
    listed = [
        f"{bound}{colour:.2f} in {channel}" for channel, bound, colour in colours if colour > 0.0
    ]
    if not listed:
        return []
    texts = [
        f"{name}The noise is coloured. The correlation of neighbouring samples of it is "
        f"{', '.join(listed)}.",
        "Intervals and standard errors include it as noise of first order.",
    ]
    if not rests:
        texts.append(
            f"How slow the noise of {TABLE} is cannot be told while the table moves: the intervals "
            "may be too narrow. Let the record begin with half a second at rest."
        )
    return texts


def _misfits_in_noise(estimated: Estimate | Fit) -> dict[str, float]:
    """Return the channels whose misfit is larger than their noise, and how many times."""
    larger: dict[str, float] = {}
    for solution in estimated.solutions:
        observation = solution.observation
        of_channels = zip(
            observation.channels,
            solution.likelihood.misfits(solution.parameters),
            solution.likelihood.noise_seen(solution.parameters),
            observation.largest,
            strict=True,
        )
        for name, misfit, noise, largest in of_channels:
            if misfit > max(_MISFIT_IN_NOISE * noise, _MISFIT_IN_LARGEST * largest):
                larger[name] = max(misfit / noise, larger.get(name, 0.0))
    return larger


def unexplained_channels(estimated: Estimate, with_drift: Callable[[str], Fit]) -> list[str]:
    """Return which channels the fit does not explain, in words.

    For each that may drift, `with_drift` fits with an offset and a drift of it; a sentence says if
    these explain it.
    """
    misfits = _misfits_in_noise(estimated)
    if not misfits:
        return []
    listed = ", ".join(f"{name} {times:.2g} times" for name, times in misfits.items())
    texts = [
        f"The misfit is larger than the noise of the sensors: {listed}. The block did not move as "
        "in the model, a sensor drifts, or its noise is slow: do not use the parameters before you "
        "know why (see the figure)."
    ]
    observations = [solution.observation for solution in estimated.solutions]
    for name in misfits:
        may_drift = all(name in each.channels and name not in each.drifts for each in observations)
        if may_drift and not _misfits_in_noise(with_drift(name)):
            texts.append(
                f"With an offset and a drift of {name} taken out, the misfit is that of the "
                f"sensors' noise: give drift = {name!r}."
            )
    return texts


def _contradicted_yield(estimated: Estimate, solution: Solution) -> list[str]:
    """Return a sentence if the block was seen to begin to slide below the interval of Üy."""
    if (
        "block_acceleration" not in solution.observation.channels
        or "continuous" in estimated.readings
    ):
        return []
    block = corrected_channels(solution)["block_acceleration"]
    table = table_at_samples(solution)
    slides, threshold = slides_in(solution, table, block)
    onsets = np.array([onset_acceleration(table, block, slide, threshold) for slide in slides])
    onsets = onsets[onsets > 0.0]  # downslope
    if not onsets.size:
        return []
    step = np.abs(np.diff(table)).max()
    seen = np.median(onsets)
    error = 3.0 * np.std(onsets) / len(onsets) ** 0.5
    least = estimated.intervals[0][0]
    if least <= seen + step + threshold + error:
        return []
    return [
        f"The 95 % interval of Üy begins at {least:.3g} m/s2, but the block was seen to begin to "
        f"slide at {seen:.3g} m/s2: the fit contradicts the test."
    ]


def _outliers(solution: Solution, name: str) -> list[str]:
    """Return which samples contradict the solution, in words."""
    texts = []
    contradicting = solution.likelihood.contradicting(solution.parameters)
    for channel, (times, most) in contradicting.items():
        units = variables.HISTORY[channel]["units"]
        samples = "1 sample" if times.size == 1 else f"{times.size} samples"
        texts.append(
            f"{name}{samples} of {channel} cannot be noise: up to {most:.3g} {units} off what is "
            f"computed, first at {times[0]:.4g} s. A sensor failed there, or the solution is wrong."
        )
    return texts


def _undetermined(estimated: Estimate) -> list[str]:
    """Return which parameters the tests do not determine, why, and which measurement would."""
    tests = "these tests" if len(estimated.solutions) > 1 else "this test"
    missing = [at for at in range(3) if not estimated.determined[at]]
    *others, last = (sweep_tables.SYMBOLS[at] for at in missing)
    listed, are = (f"{', '.join(others)} and {last}", "are") if others else (last, "is")
    ranges = "; ".join(_interval_text(at, *estimated.intervals[at]) for at in missing)
    texts = [f"{listed} {are} not determined by {tests}: 95 % intervals {ranges}."]
    if estimated.apart:
        onsets = " or ".join(f"{onset:.3g}" for onset in estimated.apart)
        texts.append(f"Several solutions fit: Üy is about {onsets} m/s2, and nothing between.")
    reason = _reason_undetermined(estimated)
    if reason:
        texts.append(reason)
    texts.append(_remedy(estimated))
    return texts


def _reason_undetermined(estimated: Estimate) -> str:
    """Return why some parameters do not act on the motion, in words; "" if all of them do."""
    yield_holds = "held" in estimated.readings and not math.isfinite(estimated.intervals[1][1])
    crosses = bool({"crossed", "crossing"} & estimated.readings)
    if yield_holds and crosses:
        return (
            "Two readings fit equally well: Üy holds the block, and λ and Δμ are nearly free; or "
            "Eq. 4 crosses the table's acceleration at the same value, and Üy is anything below. "
            "The intervals are the union of both."
        )
    if yield_holds:
        return (
            "Where Eq. 4 gives less than the yield acceleration in every cycle, the motion does "
            "not depend on λ and Δμ."
        )
    if crosses:
        return (
            "Where Eq. 4 holds the block to the table until the table's acceleration has passed "
            "Üy, the motion does not depend on Üy."
        )
    return ""


def _interval_text(at: int, low: float, high: float) -> str:
    """Return the interval of a parameter in words, such as "Üy up to 1.3 m/s2"."""
    if math.isfinite(high):
        text = f"up to {high:.3g}" if low <= 0.0 else f"{low:.3g} to {high:.3g}"
    else:
        text = "any value" if low <= 0.0 else f"{low:.3g} or more"
    return f"{sweep_tables.SYMBOLS[at]} {text}{sweep_tables.UNITS[at]}"


def _remedy(estimated: Estimate) -> str:
    """Return the measurement that would tell the allowed parameters apart, in words.

    It is the acceleration of the block if no test has it, else a test at the amplitude at which
    the displacements differ most.
    """
    solution = estimated.solutions[0]
    channels = [each.observation.test.channels for each in estimated.solutions]
    if all("block_acceleration" not in names for names in channels):
        return f"Measure the acceleration of the block, or t{_ANOTHER[1:]}."
    some = np.unique(np.linspace(0, len(estimated.allowed) - 1, 24).astype(int))
    ends = np.argsort(estimated.allowed, axis=0)[[0, -1]].ravel()
    columns = estimated.allowed[[*some, *ends]].T
    cases = {
        name: xr.DataArray(column, dims="case")
        for name, column in zip(SOUGHT, columns, strict=True)
    }
    further = sweep_of(solution, estimated, scale=_FURTHER_TESTS, **cases)
    moved = abs(further["permanent_displacement"])
    span = float(np.abs(sweep_of(solution, estimated)["permanent_displacement"]))
    low = moved.min(dim="case").values
    high = moved.max(dim="case").values
    if not np.isfinite(high).any():
        return f"{_ANOTHER}."
    best = int(np.nanargmax((high - low) / (np.sqrt(low * high) + 0.05 * span)))
    factor = _FURTHER_TESTS[best]
    return (
        f"{_ANOTHER}: at {factor:g} times this one ({factor * solution.observation.peak:.3g} m/s2) "
        f"the parameters that fit give displacements from {low[best]:.2g} to {high[best]:.2g} m."
    )
