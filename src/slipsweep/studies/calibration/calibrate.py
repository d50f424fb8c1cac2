"""`calibrate`: Üy, λ and Δμ from tests on a shaking table, all together and cycle by cycle."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from slipsweep.errors import InputError
from slipsweep.model import options, parameters, variables
from slipsweep.model.docstrings import with_parameters
from slipsweep.studies.calibration import findings
from slipsweep.studies.calibration.corrected import (
    added_by_sensors,
    block_acceleration,
    corrected_channels,
    friction_by_statics,
)
from slipsweep.studies.calibration.estimate import (
    Estimate,
    Fit,
    Solution,
    best_fit,
    cycle_estimate,
    estimate,
)
from slipsweep.studies.calibration.measured_friction import (
    BOUND,
    SOURCE,
    Test,
    eq1_friction,
    free_body_friction,
    test_of,
)
from slipsweep.studies.calibration.observation import SOUGHT, Observation, runs_of
from slipsweep.studies.calibration.shaking_test import TABLE

#: Least peak of a cycle, in parts of the largest acceleration of the table, and fewest samples.
_LEAST_CYCLE = 0.1
_FEWEST_IN_A_CYCLE = 12


@with_parameters
def calibrate(
    test: Test | Sequence[Test],
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

    The table's recorded motion shakes the model's block, and what it does is fitted to whatever was
    measured of the real one, each channel weighted by its noise.  The noise of the table's own
    record enters the intervals, and so does the correlation of neighbouring samples of the noise.
    If several solutions fit, an interval holds them all.  A channel that is cut off is named.

    Parameters
    ----------
    test : path, Dataset, mapping of str to DataArray, or ShakingTest, or a list of these
        As for `measured_friction`, but of the block any one or more of `block_acceleration` (m/s²),
        `relative_velocity` (m/s) and `relative_displacement` (m), downslope positive; NaN or a
        blank cell where there is no sample. Several tests of one interface are calibrated together.
    model : Mendez or str
        The rules of motion.
    offset, drift : str or list of str
        Channels, `ground_acceleration` among them, whose sensor has an offset, or an offset and a
        drift in a straight line; "all" for all.  They are fitted together with the parameters; the
        attribute `removed` has their sizes.
    noise : mapping of str to float, optional
        Standard deviation of the noise of channels; by default estimated from the residuals.
    cycles : bool
        Fit each cycle by itself, too.

    Returns
    -------
    Dataset
        `yield_acceleration` (m/s²), `decay_rate` and `delta_mu`, each with ``_error`` (standard
        error; NaN where it is not determined) and ``_interval`` (95 %, along `bound`; 0 and inf
        where the data set no bound), and their `correlation`.  `static_friction` and
        `kinetic_friction` by statics with intervals.  Along `cycle`: ``cycle_`` and the same names,
        `cycle_start` (s), `cycle_peak_acceleration` (m/s²), `cycle_sliding_mode` and
        `cycle_attenuation_coefficient` (Kd, stick-slip).  Along `time`: ``measured_`` (less
        `removed`) and ``computed_`` accelerations, velocity and displacement, the computed
        friction, and the measured `friction_coefficient` (Eq. 1) and `free_body_friction`.
        ``misfit_`` and a channel is the root mean square of their difference.  Several tests have a
        dimension `test` more.  Attributes: `findings`, sentences on what the tests do not determine
        and what would; `constant_friction`, as of `measured_friction`; `model_table` and
        `uncertainty_table`, to paste into a sweep file, commented out if they are not ready for
        use.

    Raises
    ------
    InputError
        A test that cannot be read or measured nothing of the block, or a value that no physics
        allows.

    See Also
    --------
    measured_friction : the friction that the test shows, without a model
    sample : displacements with the errors of the parameters

    Examples
    --------
    >>> import slipsweep
    >>> test = "sweeps/data/shaking_test.csv"
    >>> results = slipsweep.calibrate(test, theta=5, mu_s=0.38, cycles=False)
    >>> results.yield_acceleration.round(1).item()  # m/s2
    1.8
    >>> results.decay_rate.round(1).item(), results.delta_mu.round(1).item()
    (2.0, 0.1)
    """
    tests = [test_of(each) for each in (test if isinstance(test, list | tuple) else [test])]
    if not tests:
        raise InputError("test = []: must be one test at least")
    theta = parameters.check_single("theta", theta)
    mu_s = parameters.single_friction_coefficient(mu_s, phi)
    chosen = options.MODELS.of(model)
    if not isinstance(chosen, options.Mendez):
        raise InputError(
            f"model = {chosen!r}: must be 'mendez': Newmark's block has no λ and no Δμ"
        )
    if noise is not None and not isinstance(noise, Mapping):
        raise InputError(
            f"noise = {parameters.shown(noise)}: must be a mapping of channels to standard "
            "deviations"
        )
    for name, value in (noise or {}).items():
        if not parameters.check_finite(f"noise.{name}", value) > 0.0:
            raise InputError(
                f"noise.{name} = {parameters.shown(value)}: must be a finite number > 0"
            )

    def observed(*drifting: str) -> list[Observation]:
        return [
            Observation(each, theta, mu_s, chosen, offset, drift, noise or {}, drifting)
            for each in tests
        ]

    # threads of BLAS wait for each other: ten times as long on a busy machine
    with threadpool_limits(1, "blas"):
        estimated = estimate(_fit(observed()))
        statics = [friction_by_statics(solution) for solution in estimated.solutions]
        constant = next((each for each in statics if each.attrs["constant_friction"]), None)
        clipped = findings.clipped_channels(estimated)
        misfit: list[str] = []
        if constant is None and not clipped:
            misfit = findings.unexplained_channels(estimated, lambda name: best_fit(observed(name)))
        parts = [_of_test(solution, estimated, cycles) for solution in estimated.solutions]
        results = parts[0]
        if len(parts) > 1:
            results = xr.concat(parts, "test", join="outer", combine_attrs="override")
        results = results.merge(_of_all(estimated)).assign(statics[0].variables)
        report = findings.report(estimated, results, constant, clipped, misfit)
    names = ", ".join(each.name for each in tests)
    results.attrs = {
        "title": "Calibration of a sliding block from tests on a shaking table",
        **SOURCE,
        **(tests[0].attrs if len(tests) == 1 else {"tests": names}),
        **options.MODELS.attributes(chosen),
        "removed": "; ".join(dict.fromkeys(part.attrs["removed"] for part in parts)),
        **report,
    }
    return results


def _fit(observations: Sequence[Observation]) -> Fit:
    """Return the best fit, without samples of slips upslope, which stick-slip does not have."""
    fit = best_fit(observations)
    if "continuous" in fit.readings:
        return fit
    for solution in fit.solutions:
        solution.observation.leave_out_upslope_slips(solution.parameters)
    if any(observation.upslope for observation in observations):
        return best_fit(observations)
    return fit


def _of_test(solution: Solution, estimated: Estimate, cycles: bool) -> xr.Dataset:
    """Return the results of one test: measured and computed series, misfits, cycles.

    The attribute `removed` names offsets, drifts and steps.
    """
    observation = solution.observation
    test = observation.test
    history = solution.likelihood.forward(solution.parameters, test.times)
    channels = corrected_channels(solution)
    series = {f"measured_{name}": values for name, values in channels.items()}
    series |= {f"computed_{name}": values for name, values in history.items()}
    block = block_acceleration(test, channels)
    if block is not None:
        theta = observation.theta
        g = observation.model.g
        series["friction_coefficient"] = eq1_friction(
            channels[TABLE], block, theta, observation.mu_s, g
        )
        series["free_body_friction"] = free_body_friction(block, theta, g)
    about = variables.CALIBRATION_SERIES | variables.MEASURED_FRICTION
    data: dict[str, Any] = {name: ("time", values, about[name]) for name, values in series.items()}
    misfits = solution.likelihood.misfits(solution.parameters)
    for name, misfit in zip(observation.channels, misfits, strict=True):
        span = max(float(np.nanmax(np.abs(history[name]))), 1e-300)
        of_channel = variables.HISTORY[name]
        text = f"root mean square of measured less computed {of_channel['long_name']}"
        data[f"misfit_{name}"] = ((), misfit, {**of_channel, "long_name": text})
        relative = {"units": "1", "long_name": f"{text}, over largest"}
        data[f"relative_misfit_{name}"] = ((), misfit / span, relative)
    data |= {
        name: findings.sweep_of(solution, estimated)[name].variable
        for name in ("permanent_displacement", "validity")
    }
    time = {"time": ("time", test.times, {"units": "s", "long_name": "time"})}
    removed = "; ".join(added_by_sensors(solution)[1]) or "nothing"
    dataset = xr.Dataset(data, time, {"removed": removed})
    return dataset.merge(_cycles(solution, estimated)) if cycles else dataset


def _cycles(solution: Solution, estimated: Estimate) -> xr.Dataset:
    """Return each cycle by itself: estimates, standard errors and Kd."""
    observation = solution.observation
    motion = observation.record(solution.table_lines)
    times = observation.test.times
    continuous = "continuous" in estimated.readings
    least = max(estimated.parameters[0], _LEAST_CYCLE * observation.peak)
    pulses = [
        part
        for part in runs_of(motion.acceleration > 0.0)
        if motion.acceleration[part].max() > least
    ]
    starts = [motion.times[part.start] for part in pulses]
    columns = {
        name: np.full(len(pulses), np.nan)
        for name in variables.CALIBRATION
        if name.startswith("cycle_")
    }
    columns["cycle_start"][:] = starts
    columns["cycle_peak_acceleration"][:] = [motion.acceleration[part].max() for part in pulses]
    parameters = solution.parameters
    forward = solution.likelihood.forward
    speed = max(float(np.abs(forward(parameters, times)["relative_velocity"]).max()), 1e-6)
    free = [1, 2] if continuous else [0, 1, 2]
    for row, (begin, end) in enumerate(zip(starts, [*starts[1:], motion.times[-1]], strict=True)):
        inside = (times >= begin) & (times < end)
        if inside.sum() < _FEWEST_IN_A_CYCLE:
            continue
        of_cycle = solution.likelihood.cycle(begin, end, speed, parameters, solution.line_errors)
        values, errors = cycle_estimate(of_cycle, parameters, free)
        for name, value, error in zip(SOUGHT, values, errors, strict=True):
            columns[f"cycle_{name}"][row] = value
            columns[f"cycle_{name}_error"][row] = error
        fitted = np.where(np.isfinite(values), values, estimated.parameters)
        history = forward(np.append(fitted, solution.table_lines), times)
        slides = inside & (history[TABLE] > 0.0)
        if slides.any() and not continuous:
            columns["cycle_attenuation_coefficient"][row] = (
                history["block_acceleration"][slides].max() / observation.model.g
            )
    mode = variables.SlidingMode.CONTINUOUS if continuous else variables.SlidingMode.STICK_SLIP
    columns["cycle_sliding_mode"] = np.full(len(pulses), mode, np.int8)
    about = {"units": "1", "long_name": "number of the cycle"}
    return xr.Dataset(
        {name: ("cycle", values, variables.CALIBRATION[name]) for name, values in columns.items()},
        {"cycle": ("cycle", np.arange(1, len(pulses) + 1), about)},
    )


def _of_all(estimated: Estimate) -> xr.Dataset:
    """Return the results of all tests together: parameters, errors, intervals, correlation."""
    pair = ("parameter", "other_parameter")
    data: dict[str, Any] = {
        "correlation": (pair, estimated.correlation, variables.CALIBRATION["correlation"])
    }
    for at, name in enumerate(SOUGHT):
        about = variables.PARAMETERS[name]
        of_error = {**about, "long_name": f"standard error of the {about['long_name']}"}
        of_interval = {**about, "long_name": f"95 % interval of the {about['long_name']}"}
        data[name] = ((), estimated.parameters[at], about)
        data[f"{name}_error"] = ((), estimated.errors[at], of_error)
        data[f"{name}_interval"] = ("bound", estimated.intervals[at], of_interval)
    codes = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(SOUGHT)}
    coords: dict[str, Any] = {
        name: (name, np.arange(3, dtype=np.int8), {"long_name": name.replace("_", " "), **codes})
        for name in pair
    }
    coords["bound"] = BOUND
    observation = estimated.solutions[0].observation
    coords["theta"] = ((), observation.theta, variables.PARAMETERS["theta"])
    coords["mu_s"] = ((), observation.mu_s, variables.PARAMETERS["mu_s"])
    return xr.Dataset(data, coords)
