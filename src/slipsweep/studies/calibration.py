"""Calibration: Üy, λ and Δμ from one or several tests on a shaking table, together and cycle by cycle."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import ndimage

from slipsweep.errors import InputError
from slipsweep.model import options, parameters, variables
from slipsweep.model.variables import HISTORY
from slipsweep.motion.shaking import RESPONSES, TABLE, ShakingTest, check_channels
from slipsweep.studies import findings, friction
from slipsweep.studies.estimate import Estimate, cycle_estimate, estimate
from slipsweep.studies.likelihood import COLUMN, SOUGHT, Line, Linear, Observation
from slipsweep.studies.table_motion import noise_of

Floats = NDArray[np.float64]

#: Consecutive samples, and standard deviations of the noise, by which a block slips upslope.
_UPSLOPE_SAMPLES, _UPSLOPE_NOISE = 4, 5.0

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
    theta, mu_s : float
        Inclination of the plane, degrees, and static friction coefficient, measured by other means.
    phi : float, optional
        Friction angle, degrees, instead of mu_s = tan phi.
    model : Mendez or str
        The rules of motion.
    offset, drift : str or list of str
        Channels, `ground_acceleration` among them, whose sensor has an offset, or an offset and a drift in a straight
        line; "all" for all.  These are fitted together with the parameters; what was found stands in the attribute
        `removed`.
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
    tests = [friction.test_of(one) for one in test] if isinstance(test, list | tuple) else [friction.test_of(test)]
    if not tests:
        raise InputError("test = []: must be one test at least")
    theta, mu_s = parameters.check_single("theta", theta), parameters.single_friction_coefficient(mu_s, phi)
    chosen = options.MODELS.of(model)
    if not isinstance(chosen, options.Mendez):
        raise InputError(f"model = {chosen!r}: must be 'mendez': Newmark's block has no λ and no Δμ")
    drifts = [drift] if isinstance(drift, str) else list(drift)
    _check_noise(noise)

    def observed(*more: str) -> list[Observation]:
        return [_observation(one, theta, mu_s, chosen, offset, [*drifts, *more], noise or {}) for one in tests]

    observations = observed()
    found = estimate(observations)
    slips = [[] if "continuous" in found.readings else _upslope_slips(one) for one in tests]
    if any(slips):
        for one, episodes in zip(observations, slips, strict=True):
            _leave_out(one, episodes)
        found = estimate(observations)
    coefficients = [findings.coefficients(one) for one in observations]
    drifting: list[str] = []
    if findings.misfits(found) and not any(one.attrs["constant_friction"] for one in coefficients):
        # of which channels an offset and a drift, that were not given, would explain a misfit
        measured = [name for name in RESPONSES if all(name in one.responses for one in tests) and name not in drifts]
        drifting = [name for name in measured if not findings.misfits(estimate(observed(name)))]
    parts = [_of_test(one, linear, found, cycles) for one, linear in zip(observations, found.linears, strict=True)]
    whole = parts[0] if len(parts) == 1 else xr.concat(parts, "test", join="outer", combine_attrs="override")
    removed = "; ".join(dict.fromkeys(np.atleast_1d(whole["removed"].values).tolist()))
    whole = whole.drop_vars("removed").merge(_of_all(found)).assign(coefficients[0].variables)
    whole.attrs = {
        "title": "Calibration of a sliding block from tests on a shaking table",
        **friction.SOURCE,
        **(tests[0].attrs if len(tests) == 1 else {"tests": ", ".join(one.name for one in tests)}),
        **options.MODELS.attributes(chosen),
        "removed": removed,
        **findings.report(found, slips, coefficients, drifting),
    }
    return whole


def _check_noise(noise: Any) -> None:
    if noise is not None and not isinstance(noise, Mapping):
        raise InputError(f"noise = {parameters.shown(noise)}: must be a mapping of channels to standard deviations")
    for name, value in (noise or {}).items():
        if not parameters.check_finite(f"noise.{name}", value) > 0.0:
            raise InputError(f"noise.{name} = {parameters.shown(value)}: must be a finite number > 0")


def _observation(
    test: ShakingTest,
    theta: float,
    mu_s: float,
    model: options.Mendez,
    offset: Any,
    drift: Any,
    noise: Mapping[str, float],
) -> Observation:
    """A test with what is given of its sensors, checked."""
    if not test.responses:
        raise InputError(
            f"{test.name}: nothing of the block was measured: must have one at least of {', '.join(RESPONSES)}"
        )
    check_channels("noise", list(noise), test.responses)
    friction.check_contact(test, theta, model.g)
    if not float(test.channels[TABLE].max()) > 0.0:
        raise InputError(f"{test.name}: {TABLE}: never positive: the table does not drive the block downslope")
    offsets, drifts = check_channels("offset", offset, test.channels), check_channels("drift", drift, test.channels)
    return Observation(test, theta, mu_s, model, offsets, drifts, noise)


# ------------------------------------------------------------------------------ upslope slips


def _upslope_slips(test: ShakingTest) -> list[tuple[float, float]]:
    """From when to when the block slips upslope, which stick-slip does not have."""
    velocity = test.channels.get("relative_velocity")
    if velocity is None:
        if "relative_displacement" not in test.channels:
            return []
        velocity = np.gradient(test.channels["relative_displacement"], test.times)
    noise = max(noise_of(velocity), 2e-3 * float(np.nanmax(np.abs(velocity))))
    upslope = np.nan_to_num(velocity) < -_UPSLOPE_NOISE * noise
    several = ndimage.binary_opening(upslope, np.ones(_UPSLOPE_SAMPLES))
    slips = ndimage.find_objects(ndimage.label(ndimage.binary_dilation(several, iterations=3))[0])
    return [(float(test.times[part.start]), float(test.times[part.stop - 1])) for (part,) in slips]


def _leave_out(one: Observation, slips: Sequence[tuple[float, float]]) -> None:
    """Leave out the samples of upslope slips, after each of which the displacement may have stepped."""
    times = one.test.times
    for begin, end in slips:
        for name, use in one.use.items():
            one.use[name] = use & ~((times >= begin) & (times <= end))
        if "relative_displacement" in one.use:
            size = 3.0 * float(np.nanmax(np.abs(one.test.channels["relative_displacement"])))
            step = {"relative_displacement": size * (times > end).astype(np.float64)}
            one.lines.append(Line(f"upslope slip at {begin:.4g} s of relative_displacement", step, size))


# ------------------------------------------------------------------------------------ results


def _of_test(one: Observation, linear: Linear, found: Estimate, cycles: bool) -> xr.Dataset:
    """What belongs to one test: measured and computed series, misfits, cycles, what was removed."""
    test, history = one.test, linear.forward(found.parameters, one.test.times)
    added, removed = _removed(one, linear, found.parameters)
    about = variables.CALIBRATION_SERIES | variables.MEASURED_FRICTION
    series = {f"measured_{name}": values - added[name] for name, values in test.channels.items()}
    series |= {f"computed_{name}": history[:, at] for name, at in COLUMN.items()}
    block = findings.block_acceleration(test)
    if block is not None:
        block = block - added.get("block_acceleration", 0.0)
        table = series[f"measured_{TABLE}"]
        series["friction_coefficient"] = friction.eq1_friction(table, block, one.theta, one.mu_s, one.model.g)
        series["free_body_friction"] = friction.free_body_friction(block, one.theta, one.model.g)
    data: dict[str, Any] = {name: ("time", values, about[name]) for name, values in series.items()}
    for name, rest in linear.unexplained(found.parameters).items():
        misfit = float(np.sqrt(np.mean(rest**2)))
        span = max(float(np.nanmax(np.abs(history[:, COLUMN[name]]))), 1e-300)
        long_name = f"root mean square of measured less computed {HISTORY[name]['long_name']}"
        data[f"misfit_{name}"] = ((), misfit, {**HISTORY[name], "long_name": long_name})
        data[f"relative_misfit_{name}"] = ((), misfit / span, {"units": "1", "long_name": f"{long_name}, over largest"})
    data |= {name: found.summary(one)[name].variable for name in ("permanent_displacement", "validity")}
    data["removed"] = ((), "; ".join(removed) or "nothing")
    dataset = xr.Dataset(data, {"time": ("time", test.times, {"units": "s", "long_name": "time"})})
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
            value, error = (line.deviation * number[at] for number in (values, spread))
            over = " over the whole test" if line.name.startswith("drift") else ""
            texts.append(f"{line.name}: {value:.4g} ± {error:.2g} {HISTORY[name]['units']}{over}")
    return added, texts


def _cycles(one: Observation, linear: Linear, found: Estimate) -> xr.Dataset:
    """Each cycle by itself: estimates, standard errors and Kd."""
    motion, continuous = one.motion, "continuous" in found.readings
    pulses = [
        (float(motion.times[part.start]), float(motion.acceleration[part].max()))
        for (part,) in ndimage.find_objects(ndimage.label(motion.acceleration > 0.0)[0])
    ]
    pulses = [(begin, top) for begin, top in pulses if top > max(found.parameters[0], _A_CYCLE * one.peak)]
    data = {name: np.full(len(pulses), np.nan) for name in variables.CALIBRATION if name.startswith("cycle_")}
    data["cycle_start"], data["cycle_peak_acceleration"] = np.array(pulses).reshape(-1, 2).T
    ends = [*data["cycle_start"][1:], motion.times[-1]]
    speed = max(
        float(np.abs(linear.forward(found.parameters, one.test.times)[:, COLUMN["relative_velocity"]]).max()), 1e-6
    )
    for row, ((begin, _), end) in enumerate(zip(pulses, ends, strict=True)):
        inside = (one.test.times >= begin) & (one.test.times < end)
        if inside.sum() < _FEWEST_IN_A_CYCLE:
            continue
        part = linear.between(begin, end, speed)
        values, errors = cycle_estimate(part, found, free=(1, 2) if continuous else (0, 1, 2))
        for name, value, error in zip(SOUGHT, values, errors, strict=True):
            data[f"cycle_{name}"][row], data[f"cycle_{name}_error"][row] = value, error
        history = linear.forward(np.where(np.isfinite(values), values, found.parameters), one.test.times)
        slides = inside & (history[:, COLUMN[TABLE]] > 0.0)
        if slides.any() and not continuous:
            data["cycle_attenuation_coefficient"][row] = (
                history[slides, COLUMN["block_acceleration"]].max() / one.model.g
            )
    mode = variables.SlidingMode.CONTINUOUS if continuous else variables.SlidingMode.STICK_SLIP
    data["cycle_sliding_mode"] = np.full(len(pulses), mode, np.int8)
    number = ("cycle", np.arange(1, len(pulses) + 1), {"units": "1", "long_name": "number of the cycle"})
    return xr.Dataset(
        {name: ("cycle", values, variables.CALIBRATION[name]) for name, values in data.items()}, {"cycle": number}
    )


def _of_all(found: Estimate) -> xr.Dataset:
    """What belongs to all tests together: parameters, errors, intervals, correlation."""
    data: dict[str, Any] = {
        "correlation": (("parameter", "other_parameter"), found.correlation, variables.CALIBRATION["correlation"])
    }
    for at, name in enumerate(SOUGHT):
        about = variables.PARAMETERS[name]
        error = {**about, "long_name": f"standard error of the {about['long_name']}"}
        interval = {**about, "long_name": f"95 % interval of the {about['long_name']}"}
        data[name] = ((), found.parameters[at], about)
        data[f"{name}_error"] = ((), found.errors[at], error)
        data[f"{name}_interval"] = ("bound", found.intervals[at], interval)
    codes = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(SOUGHT)}
    first = found.observations[0]
    coords = {
        "parameter": ("parameter", np.arange(3, dtype=np.int8), {"long_name": "parameter", **codes}),
        "other_parameter": ("other_parameter", np.arange(3, dtype=np.int8), {"long_name": "other parameter", **codes}),
        "bound": friction.BOUND,
        "theta": ((), first.theta, variables.PARAMETERS["theta"]),
        "mu_s": ((), first.mu_s, variables.PARAMETERS["mu_s"]),
    }
    return xr.Dataset(data, coords)
