"""What a calibration found, as a table: estimates and intervals, cycles, series, misfits, and what was removed."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.model.options import MODELS
from slipsweep.model.variables import CALIBRATION, CALIBRATION_SERIES, HISTORY, PARAMETERS
from slipsweep.motion.shaking import TABLE
from slipsweep.studies.findings import model_table, uncertainty_table
from slipsweep.studies.fitting import SOUGHT, Fit, Profile, Solution
from slipsweep.studies.forward import COLUMN

Floats = NDArray[np.float64]

#: The share of tests whose interval holds the true value, and the rise of the sum of squares at its ends.
CONFIDENCE, SQUARE = 0.95, 3.841

#: How large an offset or drift may be, in parts of a channel's largest value: no bound, in effect.
LARGE = 3.0


@dataclass(frozen=True)
class Cycle:
    """What one cycle gave: estimates and standard errors of Üy, λ and Δμ, and Kd; NaN where there is none."""

    start: float
    peak: float
    continuous: bool
    estimate: Floats
    errors: Floats
    attenuation: float


def intervals_of(solution: Solution, profile: Profile) -> Floats:
    """95 % intervals of Üy, λ and Δμ, (3, 2); NaN of what was not determined."""
    intervals = np.array([profile.interval(at, SQUARE) for at in range(3)])
    # the profile may be lower beside what was found: both are possible
    intervals = np.column_stack(
        [np.minimum(intervals[:, 0], solution.parameters), np.maximum(intervals[:, 1], solution.parameters)]
    )
    intervals = np.maximum(intervals, 0.0)  # nothing physical lies below
    intervals[1:][~np.isfinite(solution.errors[1:])] = np.nan
    return np.asarray(intervals)


def table_of(
    fit: Fit, solution: Solution, intervals: Floats, summary: xr.Dataset, cycles: Sequence[Cycle], notes: Sequence[str]
) -> xr.Dataset:
    """All that was found; `summary` has the results of a sweep for it, `notes` are findings in words."""
    history, added = fit.computed(solution.parameters, solution.wrong), _added(fit, solution)
    data = _estimates(solution, intervals) | _of_cycles(cycles)
    data |= _series(fit, history, added) | _misfits(fit, history, added)
    for name in ("permanent_displacement", "stick_slip_pulses", "continuous_pulses", "validity"):
        data[name] = summary[name].variable
    attrs = {
        "title": "Calibration of a sliding block from a test on a shaking table",
        **fit.test.attrs,
        **MODELS.attributes(fit.forward.model),
        "channels": json.dumps(fit.test.responses),
        "table_noise": fit.motion.noise,
        "table_coefficients": fit.motion.coefficients,
        "removed": "; ".join(_removed(fit, solution)) or "nothing",
        "findings": "\n".join(notes),
        "model_table": model_table(fit.forward, solution, intervals),
        "uncertainty_table": uncertainty_table(fit.forward, solution, correlation_of(solution.covariance)),
    }
    return xr.Dataset(data, _coordinates(fit, len(cycles)), attrs)


def _coordinates(fit: Fit, cycles: int) -> dict[str, xr.Variable]:
    place = np.arange(3, dtype=np.int8)
    names = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(SOUGHT)}
    ends = np.array([0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    coords = {
        "time": xr.Variable(("time",), fit.test.times, {"units": "s", "long_name": "time"}),
        "parameter": xr.Variable(("parameter",), place, {"long_name": "parameter", **names}),
        "other_parameter": xr.Variable(("other_parameter",), place, {"long_name": "other parameter", **names}),
        "bound": xr.Variable(("bound",), ends, {"units": "1", "long_name": "probability below an end of an interval"}),
        "theta": xr.Variable((), np.array(fit.forward.theta), PARAMETERS["theta"]),
        "mu_s": xr.Variable((), np.array(fit.forward.mu_s), PARAMETERS["mu_s"]),
    }
    if cycles:
        about = {"units": "1", "long_name": "number of the cycle"}
        coords["cycle"] = xr.Variable(("cycle",), np.arange(1, cycles + 1), about)
    return coords


def _estimates(solution: Solution, intervals: Floats) -> dict[str, xr.Variable]:
    """Üy, λ and Δμ, their standard errors, intervals and correlation."""
    data = {}
    for at, name in enumerate(SOUGHT):
        about = PARAMETERS[name]
        error = solution.errors[at] if np.isfinite(solution.errors[at]) else np.nan
        data[name] = xr.Variable((), np.array(solution.parameters[at]), about)
        data[f"{name}_error"] = xr.Variable(
            (), np.array(error), {**about, "long_name": f"standard error of the {about['long_name']}"}
        )
        data[f"{name}_interval"] = xr.Variable(
            ("bound",), intervals[at], {**about, "long_name": f"95 % interval of the {about['long_name']}"}
        )
    correlation = correlation_of(solution.covariance)
    data["correlation"] = xr.Variable(("parameter", "other_parameter"), correlation, CALIBRATION["correlation"])
    return data


def _of_cycles(cycles: Sequence[Cycle]) -> dict[str, xr.Variable]:
    """What each cycle gave; nothing where none was asked for."""
    table: dict[str, Any] = {
        "cycle_start": [one.start for one in cycles],
        "cycle_peak_acceleration": [one.peak for one in cycles],
        "cycle_sliding_mode": np.array([2 if one.continuous else 1 for one in cycles], np.int8),
        "cycle_attenuation_coefficient": [one.attenuation for one in cycles],
    }
    for at, name in enumerate(SOUGHT):
        table[f"cycle_{name}"] = [one.estimate[at] for one in cycles]
        table[f"cycle_{name}_error"] = [one.errors[at] for one in cycles]
    return {
        name: xr.Variable(("cycle",), np.asarray(values), CALIBRATION[name]) for name, values in table.items() if cycles
    }


def _series(fit: Fit, history: Floats, added: dict[str, Floats]) -> dict[str, xr.Variable]:
    """Measured channels, without what was removed of them, and computed ones."""
    series = {f"measured_{name}": values - added.get(name, 0.0) for name, values in fit.test.channels.items()}
    series |= {f"computed_{name}": history[:, COLUMN[name]] for name in HISTORY}
    return {name: xr.Variable(("time",), values, CALIBRATION_SERIES[name]) for name, values in series.items()}


def _misfits(fit: Fit, history: Floats, added: dict[str, Floats]) -> dict[str, xr.Variable]:
    """Root mean squares of measured less computed, and their parts of the largest computed value."""
    data = {}
    for name in fit.test.responses:
        rest = (fit.test.channels[name] - added[name] - history[:, COLUMN[name]])[fit.use[name]]
        about, misfit = HISTORY[name], np.sqrt(np.mean(rest**2))
        data[f"misfit_{name}"] = xr.Variable(
            (),
            np.array(misfit),
            {**about, "long_name": f"root mean square of measured less computed {about['long_name']}"},
        )
        span = float(np.nanmax(np.abs(history[:, COLUMN[name]]), initial=1e-300))
        data[f"relative_misfit_{name}"] = xr.Variable(
            (),
            np.array(misfit / span),
            {"units": "1", "long_name": f"misfit of the {about['long_name']} over its largest computed value"},
        )
    return data


def correlation_of(covariance: Floats) -> Floats:
    """The correlation matrix; NaN of what is not known."""
    sizes = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        found = covariance / np.outer(sizes, sizes)
    known = np.isfinite(sizes) & (sizes > 0.0)
    found[~known, :] = np.nan
    found[:, ~known] = np.nan
    np.fill_diagonal(found, np.where(known, 1.0, np.nan))
    return np.asarray(found)


def _added(fit: Fit, solution: Solution) -> dict[str, Floats]:
    """What offsets, drifts and steps add to each channel."""
    added = {name: np.zeros(fit.test.times.size) for name in fit.test.channels}
    shapes = fit.motion.shapes.shape[1]
    for value, line in zip(solution.nuisances[shapes:], fit.lines, strict=True):
        for name, part in line.parts.items():
            added[name] = added[name] + value * line.deviation * part
    for value, name in zip(solution.nuisances[shapes - len(fit.table_lines) : shapes], fit.table_lines, strict=True):
        since = (fit.test.times - fit.test.times[0]) / (fit.test.times[-1] - fit.test.times[0])
        size = LARGE * float(np.abs(fit.test.channels[TABLE]).max())
        added[TABLE] = added[TABLE] + value * size * (since if name.startswith("drift") else 1.0)
    return added


def _removed(fit: Fit, solution: Solution) -> list[str]:
    """What was found of each offset, drift and step, with its standard error."""
    shapes = fit.motion.shapes.shape[1]
    peak = float(np.abs(fit.test.channels[TABLE]).max())
    named = [(name, LARGE * peak) for name in fit.table_lines] + [(one.name, one.deviation) for one in fit.lines]
    places = range(shapes - len(fit.table_lines), solution.nuisances.size)
    texts = []
    for at, (name, size) in zip(places, named, strict=True):
        channel = next((one for one in fit.test.channels if one in name), "relative_displacement")
        unit = HISTORY[channel]["units"]
        over = " over the whole test" if name.startswith("drift") else ""
        value, error = solution.nuisances[at] * size, solution.spread[at] * size
        texts.append(f"{name}: {value:.4g} ± {error:.2g} {unit}{over}")
    return texts
