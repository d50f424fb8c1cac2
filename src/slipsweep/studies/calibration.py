"""Calibration: Üy, λ and Δμ from one or several tests on a shaking table, together and cycle by cycle."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, Mendez
from slipsweep.model.parameters import check_finite, check_single, shown
from slipsweep.model.variables import CALIBRATION, CALIBRATION_SERIES, HISTORY, MEASURED_FRICTION, PARAMETERS
from slipsweep.motion.shaking import RESPONSES, TABLE, ShakingTest, check_channels
from slipsweep.studies.estimate import Estimate, cycle_estimate, estimate
from slipsweep.studies.findings import Reported, report
from slipsweep.studies.forward import COLUMN
from slipsweep.studies.friction import (
    BOUND,
    SOURCE,
    Coefficients,
    check_contact,
    coefficients_of,
    eq1_friction,
    free_body_friction,
    slides_of,
    threshold_of,
)
from slipsweep.studies.likelihood import SOUGHT, Line, Linear, Observation
from slipsweep.studies.table_motion import noise_of

Floats = NDArray[np.float64]

#: Consecutive samples, and standard deviations of the noise, by which a block slips upslope.
_UPSLOPE_SAMPLES, _UPSLOPE_NOISE = 4, 5.0

#: Part of the largest acceleration that a pulse has at least to be a cycle, and fewest samples of one.
_A_CYCLE, _FEWEST_IN_A_CYCLE = 0.1, 12


def calibration_dataset(
    tests: Sequence[ShakingTest],
    theta: Any,
    mu_s: Any,
    *,
    model: Any,
    offset: Any,
    drift: Any,
    noise: Mapping[str, float] | None,
    cycles: bool,
) -> xr.Dataset:
    """Calibration of tests of one interface; arguments, results and errors of `slipsweep.calibrate`."""
    theta, mu_s = check_single("theta", theta), check_single("mu_s", mu_s)
    chosen = MODELS.of(model)
    if not isinstance(chosen, Mendez):
        raise InputError(f"model = {chosen!r}: must be 'mendez': Newmark's block has no λ and no Δμ")
    if not tests:
        raise InputError("test = []: must be one test at least")

    def observed(**more: Any) -> list[Observation]:
        return [_observation(test, theta, mu_s, chosen, offset, more.get("drift", drift), noise) for test in tests]

    observations = observed()
    found = estimate(observations)
    episodes = [[] if "continuous" in found.readings else _upslope(test) for test in tests]
    if any(episodes):
        for one, times in zip(observations, episodes, strict=True):
            _leave_out(one, times)
        found = estimate(observations)
    said = report(found, episodes, coefficients := [_coefficients(one) for one in observations])
    if said.misfits and not said.constant:
        said.findings[1:1] = _drifts(observed, tests, drift)
    parts = [
        _test_dataset(one, linear, found, cycles) for one, linear in zip(found.observations, found.linears, strict=True)
    ]
    whole = parts[0] if len(parts) == 1 else xr.concat(parts, "test", join="outer", combine_attrs="override")
    return _with_estimates(whole, found, said, coefficients, tests)


def _observation(
    test: ShakingTest,
    theta: float,
    mu_s: float,
    model: Mendez,
    offset: Any,
    drift: Any,
    noise: Mapping[str, float] | None,
) -> Observation:
    """A test with what is given of its sensors, checked."""
    if not test.responses:
        raise InputError(
            f"{test.name}: nothing of the block was measured: must have one at least of {', '.join(RESPONSES)}"
        )
    if noise is not None and not isinstance(noise, Mapping):
        raise InputError(f"noise = {shown(noise)}: must be a mapping of channels to standard deviations")
    check_channels("noise", list(noise or ()), test.responses)
    known = {name: check_finite(f"noise.{name}", value) for name, value in (noise or {}).items()}
    for name, value in known.items():
        if value <= 0.0:
            raise InputError(f"noise.{name} = {shown(value)}: must be a finite number > 0")
    check_contact(test, theta, model.g)
    if not float(test.channels[TABLE].max()) > 0.0:
        raise InputError(f"{test.name}: {TABLE}: never positive: the table does not drive the block downslope")
    offsets, drifts = check_channels("offset", offset, test.channels), check_channels("drift", drift, test.channels)
    return Observation(test, theta, mu_s, model, offsets, drifts, known)


def _drifts(observed: Any, tests: Sequence[ShakingTest], drift: Any) -> list[str]:
    """Channels of which an offset and a drift, that were not given, would explain a misfit."""
    said = []
    for name in tests[0].responses:
        if all(name in test.responses for test in tests) and name not in drift:
            other = estimate(observed(drift=[*([drift] if isinstance(drift, str) else drift), name]))
            if not report(other, [], []).misfits:
                said.append(
                    f"With an offset and a drift of {name} taken out, the misfit is that of the sensors' noise: give "
                    f"drift = {name!r}."
                )
    return said


# ------------------------------------------------------------------------------ upslope slips


def _upslope(test: ShakingTest) -> list[tuple[float, float]]:
    """From when to when the block slips upslope, which stick-slip does not have."""
    times = test.times
    velocity = test.channels.get("relative_velocity")
    if velocity is None and "relative_displacement" in test.channels:
        velocity = np.gradient(test.channels["relative_displacement"], times)
    if velocity is None:
        return []
    noise = max(noise_of(velocity), 2e-3 * float(np.nanmax(np.abs(velocity))))
    wrong = np.nan_to_num(velocity) < -_UPSLOPE_NOISE * noise
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong, [False]]).astype(int)))
    episodes: list[tuple[float, float]] = []
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if after - first < _UPSLOPE_SAMPLES:
            continue
        begin, end = float(times[max(first - 4, 0)]), float(times[min(after + 3, times.size - 1)])
        if episodes and begin <= episodes[-1][1]:
            episodes[-1] = episodes[-1][0], end
        else:
            episodes.append((begin, end))
    return episodes


def _leave_out(observation: Observation, episodes: Sequence[tuple[float, float]]) -> None:
    """Leave out the samples of upslope slips, after each of which the displacement may have stepped."""
    times = observation.test.times
    for begin, end in episodes:
        for name, use in observation.use.items():
            observation.use[name] = use & ~((times >= begin) & (times <= end))
        if "relative_displacement" in observation.use:
            size = 3.0 * float(np.nanmax(np.abs(observation.test.channels["relative_displacement"])))
            step = {"relative_displacement": size * (times > end).astype(np.float64)}
            observation.lines.append(Line(f"upslope slip at {begin:.4g} s of relative_displacement", step, size))


# ------------------------------------------------------------------------------------ results


def _block_acceleration(test: ShakingTest) -> Floats | None:
    """The block's acceleration, measured or from the relative velocity."""
    if "block_acceleration" in test.channels:
        return test.channels["block_acceleration"]
    if "relative_velocity" in test.channels:
        return np.asarray(test.channels[TABLE] - np.gradient(test.channels["relative_velocity"], test.times))
    return None


def _coefficients(one: Observation) -> Coefficients | None:
    """Friction by statics; None where neither the block's acceleration nor its velocity is measured."""
    test, block = one.test, _block_acceleration(one.test)
    if block is None:
        return None
    smooth = np.interp(test.times, one.motion.times, one.motion.acceleration)
    known = ShakingTest(test.times, {TABLE: smooth, "block_acceleration": block}, test.name)
    slides = slides_of(test.times, smooth, block, threshold_of(known)[0])
    eq1 = eq1_friction(smooth, block, one.theta, one.mu_s, one.model.g)
    return coefficients_of(smooth, block, eq1, slides, one.mu_s, one.theta, one.model.g)


def _test_dataset(one: Observation, linear: Linear, found: Estimate, cycles: bool) -> xr.Dataset:
    """What belongs to one test: measured and computed series, misfits, cycles, what was removed."""
    test = one.test
    history = linear.forward(found.parameters, test.times)
    added, removed = _removed(one, linear, found.parameters)
    data: dict[str, Any] = {}
    for name, values in test.channels.items():
        data[f"measured_{name}"] = (("time",), values - added[name], CALIBRATION_SERIES[f"measured_{name}"])
    for name in HISTORY:
        data[f"computed_{name}"] = (("time",), history[:, COLUMN[name]], CALIBRATION_SERIES[f"computed_{name}"])
    block = _block_acceleration(test)
    if block is not None:
        free = free_body_friction(block - added.get("block_acceleration", 0.0), one.theta, one.model.g)
        eq1 = eq1_friction(data[f"measured_{TABLE}"][1], block, one.theta, one.mu_s, one.model.g)
        data["friction_coefficient"] = (("time",), eq1, MEASURED_FRICTION["friction_coefficient"])
        data["free_body_friction"] = (("time",), free, MEASURED_FRICTION["free_body_friction"])
    for name, use in one.use.items():
        counted = use & ~one.jumps_left_out if name == "block_acceleration" else use
        rest = (test.channels[name] - added[name] - history[:, COLUMN[name]])[counted]
        misfit = float(np.sqrt(np.mean(rest**2)))
        span = max(float(np.nanmax(np.abs(history[:, COLUMN[name]]))), 1e-300)
        about = HISTORY[name]
        long_name = f"root mean square of measured less computed {about['long_name']}"
        data[f"misfit_{name}"] = ((), misfit, {**about, "long_name": long_name})
        data[f"relative_misfit_{name}"] = ((), misfit / span, {"units": "1", "long_name": f"{long_name}, over largest"})
    for name in ("permanent_displacement", "validity"):
        data[name] = found.summary(one)[name].variable
    data["removed"] = ((), "; ".join(removed) or "nothing", {"long_name": "offsets, drifts and steps taken off"})
    dataset = xr.Dataset(data, {"time": ("time", test.times, {"units": "s", "long_name": "time"})}, dict(test.attrs))
    return dataset.merge(_cycles(one, linear, found)) if cycles else dataset


def _removed(one: Observation, linear: Linear, parameters: Floats) -> tuple[dict[str, Floats], list[str]]:
    """What offsets, drifts and steps add to each channel, and each in words with its standard error."""
    values, spread = linear.nuisances(parameters)
    added = {name: np.zeros(one.test.times.size) for name in one.test.channels}
    texts = []
    first = one.wrong.size - len(one.table_lines)
    for at, line in enumerate([*one.table_lines, *one.lines], first):
        for name, part in line.parts.items():
            added[name] = added[name] + values[at] * part
            over = " over the whole test" if line.name.startswith("drift") else ""
            texts.append(
                f"{line.name}: {values[at] * line.deviation:.4g} ± {spread[at] * line.deviation:.2g} "
                f"{HISTORY[name]['units']}{over}"
            )
    return added, texts


def _cycles(one: Observation, linear: Linear, found: Estimate) -> xr.Dataset:
    """Each cycle by itself: estimates, standard errors and Kd."""
    peak, onset = one.peak, float(found.parameters[0])
    above = np.concatenate([[False], one.motion.acceleration > 0.0, [False]])
    edges = np.flatnonzero(np.diff(above.astype(int)))
    pulses = [
        (float(one.motion.times[first]), float(one.motion.acceleration[first:after].max()))
        for first, after in zip(edges[::2], edges[1::2], strict=True)
    ]
    pulses = [(begin, top) for begin, top in pulses if top > max(onset, _A_CYCLE * peak)]
    ends = [begin for begin, _ in pulses[1:]] + [float(one.motion.times[-1])]
    continuous = "continuous" in found.readings
    rows = []
    for (begin, top), end in zip(pulses, ends, strict=True):
        inside = (one.test.times >= begin) & (one.test.times < end)
        values, errors = np.full(3, np.nan), np.full(3, np.nan)
        if inside.sum() >= _FEWEST_IN_A_CYCLE:
            values, errors = cycle_estimate(linear, found, begin, end, free=(1, 2) if continuous else (0, 1, 2))
        history = linear.forward(np.where(np.isfinite(values), values, found.parameters), one.test.times)
        slides = inside & (history[:, COLUMN[TABLE]] > 0.0)
        held = float(history[slides, COLUMN["block_acceleration"]].max()) if slides.any() else math.nan
        rows.append(
            (begin, top, 2 if continuous else 1, math.nan if continuous else held / one.model.g, values, errors)
        )
    data: dict[str, Any] = {
        "cycle_start": [row[0] for row in rows],
        "cycle_peak_acceleration": [row[1] for row in rows],
        "cycle_sliding_mode": np.array([row[2] for row in rows], np.int8),
        "cycle_attenuation_coefficient": [row[3] for row in rows],
    }
    for at, name in enumerate(SOUGHT):
        data[f"cycle_{name}"] = [row[4][at] for row in rows]
        data[f"cycle_{name}_error"] = [row[5][at] for row in rows]
    number = ("cycle", np.arange(1, len(rows) + 1), {"units": "1", "long_name": "number of the cycle"})
    return xr.Dataset(
        {name: (("cycle",), np.asarray(values), CALIBRATION[name]) for name, values in data.items()}, {"cycle": number}
    )


def _with_estimates(
    dataset: xr.Dataset,
    found: Estimate,
    said: Reported,
    coefficients: Sequence[Coefficients | None],
    tests: Sequence[ShakingTest],
) -> xr.Dataset:
    """What belongs to all tests together: parameters, intervals, correlation, sentences and tables."""
    first = found.observations[0]
    data: dict[str, Any] = {}
    for at, name in enumerate(SOUGHT):
        about = PARAMETERS[name]
        data[name] = ((), found.parameters[at], about)
        error = said.errors[at]
        data[f"{name}_error"] = ((), error, {**about, "long_name": f"standard error of the {about['long_name']}"})
        interval = {**about, "long_name": f"95 % interval of the {about['long_name']}"}
        data[f"{name}_interval"] = (("bound",), found.intervals[at], interval)
    data["correlation"] = (("parameter", "other_parameter"), said.correlation, CALIBRATION["correlation"])
    for one in coefficients[:1]:
        data |= one.variables() if one is not None else {}
    place = np.arange(3, dtype=np.int8)
    names = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(SOUGHT)}
    coords = {
        "parameter": (("parameter",), place, {"long_name": "parameter", **names}),
        "other_parameter": (("other_parameter",), place, {"long_name": "other parameter", **names}),
        "bound": BOUND,
        "theta": ((), first.theta, PARAMETERS["theta"]),
        "mu_s": ((), first.mu_s, PARAMETERS["mu_s"]),
    }
    dataset = dataset.assign(data).assign_coords(coords)
    removed = dict.fromkeys(np.atleast_1d(dataset["removed"].values).tolist())
    dataset = dataset.drop_vars("removed")
    dataset.attrs = {
        "title": "Calibration of a sliding block from tests on a shaking table",
        **SOURCE,
        **(tests[0].attrs if len(tests) == 1 else {"tests": ", ".join(test.name for test in tests)}),
        **MODELS.attributes(first.model),
        "removed": "; ".join(removed),
        "constant_friction": said.constant,
        "findings": "\n".join(said.findings),
        "model_table": said.model_table,
        "uncertainty_table": said.uncertainty_table,
    }
    return dataset
