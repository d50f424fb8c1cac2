"""Calibration: Üy, λ and Δμ from one or several tests on a shaking table, together and cycle by cycle."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model import options, parameters, variables
from slipsweep.motion.shaking import RESPONSES, TABLE
from slipsweep.studies import findings, friction
from slipsweep.studies.estimate import Estimate, cycle_estimate, estimate
from slipsweep.studies.likelihood import SOUGHT, Observation
from slipsweep.studies.table_motion import Floats, runs_of

#: Part of the largest acceleration that a pulse has at least to be a cycle, and fewest samples of one.
_A_CYCLE, _FEWEST_IN_A_CYCLE = 0.1, 12


def calibrate(
    test: friction.Test | Sequence[friction.Test],
    theta: float,
    mu_s: float | None = None,
    *,
    phi: float | None = None,
    model: options.Model | str = "mendez",
    offset: str | Sequence[str] = (),
    drift: str | Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    cycles: bool = True,
) -> xr.Dataset:
    """Üy, λ and Δμ from tests on a shaking table, by profile likelihood with the exact solver.

    The table's recorded motion shakes the model's block, and what it does is fitted to whatever was measured of the
    real one, each channel weighted by its noise.  The noise of the table's own record enters the intervals.

    Parameters
    ----------
    test : path, Dataset, mapping of str to DataArray, or ShakingTest, or a list of these
        As for `measured_friction`, but of the block any one or more of `block_acceleration` (m/s²), `relative_velocity`
        (m/s) and `relative_displacement` (m), downslope positive; NaN or a blank cell where there is no sample.
        Several tests of one interface are calibrated together.
    theta, mu_s, phi : float
        Inclination of the plane, degrees, and static friction coefficient, or its angle, degrees: mu_s = tan phi.
    model : Mendez or str
        The rules of motion.
    offset, drift : str or list of str
        Channels, `ground_acceleration` among them, whose sensor has an offset, or an offset and a drift in a straight
        line; "all" for all.  They are fitted together with the parameters; the attribute `removed` has what was found.
    noise : mapping of str to float, optional
        Standard deviation of the noise of channels; by default estimated from the residuals.
    cycles : bool
        Whether each cycle is fitted by itself, too.

    Returns
    -------
    Dataset
        `yield_acceleration` (m/s²), `decay_rate` and `delta_mu`, each with ``_error`` (standard error; NaN where it is
        not determined) and ``_interval`` (95 %, along `bound`; 0 and inf where the data set no bound), and their
        `correlation`.  `static_friction` and `kinetic_friction` by statics with intervals.  Along `cycle`:
        ``cycle_`` and the same names, `cycle_start` (s), `cycle_peak_acceleration` (m/s²), `cycle_sliding_mode` and
        `cycle_attenuation_coefficient` (Kd, stick-slip).  Along `time`: ``measured_`` (less `removed`) and
        ``computed_`` accelerations, velocity and displacement, the computed friction, and the measured
        `friction_coefficient` (Eq. 1) and `free_body_friction`.  ``misfit_`` and a channel is the root mean square of
        their difference.  Several tests have a dimension `test` more.  Attributes: `findings`, sentences on what the
        tests do not determine and what would; `constant_friction`, as of `measured_friction`; `model_table` and
        `uncertainty_table`, to paste into a sweep file, commented out if they are not ready for use.

    Raises
    ------
    InputError
        A test that cannot be read or measured nothing of the block, or a value that no physics allows.

    See Also
    --------
    measured_friction : the friction that the test shows, without a model
    sample : displacements with the errors of the parameters

    Examples
    --------
    A test of two cycles without noise, as `simulate` gives it:

    >>> import numpy as np
    >>> import slipsweep
    >>> test = slipsweep.simulate(
    ...     5, 0.38, 5.0, 2.0, yield_acceleration=1.8, decay_rate=2.0, delta_mu=0.1,
    ...     excitation=slipsweep.Sine(cycles=2), times=np.arange(240) * 0.005,
    ... )
    >>> found = slipsweep.calibrate(test, theta=5, mu_s=0.38, cycles=False)
    >>> print(f"{found.yield_acceleration.item():.2f} m/s2, {found.decay_rate.item():.2f}, {found.delta_mu.item():.2f}")
    1.80 m/s2, 2.00, 0.10
    """
    tests = [friction.test_of(one) for one in (test if isinstance(test, list | tuple) else [test])]
    if not tests:
        raise InputError("test = []: must be one test at least")
    theta, mu_s = parameters.check_single("theta", theta), parameters.single_friction_coefficient(mu_s, phi)
    chosen = options.MODELS.of(model)
    if not isinstance(chosen, options.Mendez):
        raise InputError(f"model = {chosen!r}: must be 'mendez': Newmark's block has no λ and no Δμ")
    drifts = [drift] if isinstance(drift, str) else list(drift)
    if noise is not None and not isinstance(noise, Mapping):
        raise InputError(f"noise = {parameters.shown(noise)}: must be a mapping of channels to standard deviations")
    for name, value in (noise or {}).items():
        if not parameters.check_finite(f"noise.{name}", value) > 0.0:
            raise InputError(f"noise.{name} = {parameters.shown(value)}: must be a finite number > 0")

    def observed(*more: str) -> list[Observation]:
        return [Observation(one, theta, mu_s, chosen, offset, [*drifts, *more], noise or {}) for one in tests]

    observations = observed()
    found = estimate(observations)
    if "continuous" not in found.readings:
        for one in observations:
            one.leave_out_upslope_slips()
        if any(one.upslope for one in observations):
            found = estimate(observations)
    statics = [findings.statics(one) for one in observations]
    drifting: list[str] = []
    if findings.misfits(found) and not any(one.attrs["constant_friction"] for one in statics):
        # of which channels an offset and a drift, that were not given, would explain a misfit
        measured = [name for name in RESPONSES if all(name in one.responses for one in tests) and name not in drifts]
        drifting = [name for name in measured if not findings.misfits(estimate(observed(name)))]
    parts = [_of_test(one, found, cycles) for one in observations]
    whole = parts[0] if len(parts) == 1 else xr.concat(parts, "test", join="outer", combine_attrs="override")
    whole = whole.merge(_of_all(found)).assign(statics[0].variables)
    whole.attrs = {
        "title": "Calibration of a sliding block from tests on a shaking table",
        **friction.SOURCE,
        **(tests[0].attrs if len(tests) == 1 else {"tests": ", ".join(one.name for one in tests)}),
        **options.MODELS.attributes(chosen),
        "removed": "; ".join(dict.fromkeys(one.attrs["removed"] for one in parts)),
        **findings.report(found, whole, statics, drifting),
    }
    return whole


def _of_test(one: Observation, found: Estimate, cycles: bool) -> xr.Dataset:
    """What belongs to one test: measured and computed series, misfits, cycles; the attribute `removed`."""
    test, history = one.test, one.forward(found.parameters, one.test.times)
    added, removed = _removed(one, found.parameters)
    about = variables.CALIBRATION_SERIES | variables.MEASURED_FRICTION
    series = {f"measured_{name}": values - added[name] for name, values in test.channels.items()}
    series |= {f"computed_{name}": values for name, values in history.items()}
    block = findings.block_acceleration(test)
    if block is not None:
        block = block - added.get("block_acceleration", 0.0)
        table = series[f"measured_{TABLE}"]
        series["friction_coefficient"] = friction.eq1_friction(table, block, one.theta, one.mu_s, one.model.g)
        series["free_body_friction"] = friction.free_body_friction(block, one.theta, one.model.g)
    data: dict[str, Any] = {name: ("time", values, about[name]) for name, values in series.items()}
    for name, misfit in zip(one.channels, one.misfits(found.parameters), strict=True):
        span = max(float(np.nanmax(np.abs(history[name]))), 1e-300)
        of_channel = variables.HISTORY[name]
        long_name = f"root mean square of measured less computed {of_channel['long_name']}"
        data[f"misfit_{name}"] = ((), misfit, {**of_channel, "long_name": long_name})
        data[f"relative_misfit_{name}"] = ((), misfit / span, {"units": "1", "long_name": f"{long_name}, over largest"})
    data |= {name: found.summary(one)[name].variable for name in ("permanent_displacement", "validity")}
    time = ("time", test.times, {"units": "s", "long_name": "time"})
    dataset = xr.Dataset(data, {"time": time}, {"removed": "; ".join(removed) or "nothing"})
    return dataset.merge(_cycles(one, found)) if cycles else dataset


def _removed(one: Observation, parameters: Floats) -> tuple[dict[str, Floats], list[str]]:
    """What offsets, drifts and steps add to each channel, and each in words with its standard error."""
    added = {name: np.zeros(one.test.times.size) for name in one.test.channels}
    texts = []
    sizes = np.transpose(one.linear.nuisances(parameters))[one.motion.shapes.shape[1] :]
    for line, (size, error) in zip(one.lines, sizes, strict=True):
        added[line.channel] = added[line.channel] + size * line.values
        units = variables.HISTORY[line.channel]["units"] + " over the whole test" * (line.name == "drift")
        size, error = line.deviation * size, line.deviation * error
        texts.append(f"{line.name} of {line.channel}: {size:.4g} ± {error:.2g} {units}")
    return added, texts


def _cycles(one: Observation, found: Estimate) -> xr.Dataset:
    """Each cycle by itself: estimates, standard errors and Kd."""
    motion, times, continuous = one.motion, one.test.times, "continuous" in found.readings
    least = max(found.parameters[0], _A_CYCLE * one.peak)
    pulses = [part for part in runs_of(motion.acceleration > 0.0) if motion.acceleration[part].max() > least]
    data = {name: np.full(len(pulses), np.nan) for name in variables.CALIBRATION if name.startswith("cycle_")}
    data["cycle_start"][:] = starts = [motion.times[part.start] for part in pulses]
    data["cycle_peak_acceleration"][:] = [motion.acceleration[part].max() for part in pulses]
    speed = max(float(np.abs(one.forward(found.parameters, times)["relative_velocity"]).max()), 1e-6)
    for row, (begin, end) in enumerate(zip(starts, [*starts[1:], motion.times[-1]], strict=True)):
        inside = (times >= begin) & (times < end)
        if inside.sum() < _FEWEST_IN_A_CYCLE:
            continue
        values, errors = cycle_estimate(one.cycle(begin, end, speed), found, [1, 2] if continuous else [0, 1, 2])
        for name, value, error in zip(SOUGHT, values, errors, strict=True):
            data[f"cycle_{name}"][row], data[f"cycle_{name}_error"][row] = value, error
        history = one.forward(np.where(np.isfinite(values), values, found.parameters), times)
        slides = inside & (history[TABLE] > 0.0)
        if slides.any() and not continuous:
            data["cycle_attenuation_coefficient"][row] = history["block_acceleration"][slides].max() / one.model.g
    mode = variables.SlidingMode.CONTINUOUS if continuous else variables.SlidingMode.STICK_SLIP
    data["cycle_sliding_mode"] = np.full(len(pulses), mode, np.int8)
    number = ("cycle", np.arange(1, len(pulses) + 1), {"units": "1", "long_name": "number of the cycle"})
    return xr.Dataset(
        {name: ("cycle", values, variables.CALIBRATION[name]) for name, values in data.items()}, {"cycle": number}
    )


def _of_all(found: Estimate) -> xr.Dataset:
    """What belongs to all tests together: parameters, errors, intervals, correlation."""
    pair = ("parameter", "other_parameter")
    data: dict[str, Any] = {"correlation": (pair, found.correlation, variables.CALIBRATION["correlation"])}
    for name, value, error, interval in zip(SOUGHT, found.parameters, found.errors, found.intervals, strict=True):
        about = variables.PARAMETERS[name]
        data[name] = ((), value, about)
        data[f"{name}_error"] = ((), error, {**about, "long_name": f"standard error of the {about['long_name']}"})
        of_interval = {**about, "long_name": f"95 % interval of the {about['long_name']}"}
        data[f"{name}_interval"] = ("bound", interval, of_interval)
    codes = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(SOUGHT)}
    first = found.observations[0]
    coords: dict[str, Any] = {
        name: (name, np.arange(3, dtype=np.int8), {"long_name": name.replace("_", " "), **codes}) for name in pair
    }
    coords |= {
        "bound": friction.BOUND,
        "theta": ((), first.theta, variables.PARAMETERS["theta"]),
        "mu_s": ((), first.mu_s, variables.PARAMETERS["mu_s"]),
    }
    return xr.Dataset(data, coords)
