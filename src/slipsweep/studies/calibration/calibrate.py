"""Calibration: Üy, λ and Δμ from one or several tests on a shaking table, together and cycle by cycle."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from slipsweep.errors import InputError
from slipsweep.model import options, parameters, variables
from slipsweep.motion.shaking import TABLE, ShakingTest
from slipsweep.studies.calibration.estimate import Estimate, Fit, best_fit, cycle_estimate, estimate
from slipsweep.studies.calibration.likelihood import SOUGHT, Observation, runs_of
from slipsweep.studies.calibration.measured_friction import (
    BOUND,
    NOISE_IN_THRESHOLD,
    QUANTILE,
    SOURCE,
    Floats,
    Test,
    coefficients_of,
    eq1_friction,
    free_body_friction,
    onset_acceleration,
    slides_of,
    test_of,
    threshold_of,
)
from slipsweep.studies.calibration.noise import flat_top, noisy_flat_top

#: The peak of a cycle at least, and what a table that moves exceeds, in parts of its largest
#: acceleration; fewest samples of a cycle.
_A_CYCLE = 0.1
_MOVES = 0.1
_FEWEST_IN_A_CYCLE = 12

#: Channels, and the ends of them, at which only the end of a range is flat.
_RANGES = {TABLE: (1, -1), "block_acceleration": (-1,), "relative_velocity": (1, -1)}

#: Symbols and units of what is sought.
_SYMBOL = ("Üy", "λ", "Δμ")
_UNIT = (" m/s2", "", "")

_ANOTHER = "Test at another amplitude and give calibrate all tests together"


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
    theta, mu_s, phi : float
        Inclination of the base, degrees, and static friction coefficient, or its angle, degrees:
        mu_s = tan phi.
    model : Mendez or str
        The rules of motion.
    offset, drift : str or list of str
        Channels, `ground_acceleration` among them, whose sensor has an offset, or an offset and a
        drift in a straight line; "all" for all.  They are fitted together with the parameters; the
        attribute `removed` has what was found.
    noise : mapping of str to float, optional
        Standard deviation of the noise of channels; by default estimated from the residuals.
    cycles : bool
        Whether each cycle is fitted by itself, too.

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
    >>> found = slipsweep.calibrate("sweeps/data/shaking_test.csv", theta=5, mu_s=0.38, cycles=False)
    >>> print(f"{found.yield_acceleration.item():.1f} m/s2, {found.decay_rate.item():.1f}, {found.delta_mu.item():.1f}")
    1.8 m/s2, 2.0, 0.1
    """
    tests = [test_of(one) for one in (test if isinstance(test, list | tuple) else [test])]
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
            f"noise = {parameters.shown(noise)}: must be a mapping of channels to standard deviations"
        )
    for name, value in (noise or {}).items():
        if not parameters.check_finite(f"noise.{name}", value) > 0.0:
            raise InputError(
                f"noise.{name} = {parameters.shown(value)}: must be a finite number > 0"
            )

    def observed(*more: str) -> list[Observation]:
        return [
            Observation(one, theta, mu_s, chosen, offset, drift, noise or {}, more) for one in tests
        ]

    with threadpool_limits(
        1, "blas"
    ):  # its threads wait for each other: ten times as long on a busy machine
        observations = observed()
        fit = best_fit(observations)
        if "continuous" not in fit.readings:
            for one in observations:
                one.leave_out_upslope_slips(fit.of_test(one))
            if any(one.upslope for one in observations):
                fit = best_fit(observations)
        found = estimate(fit)
        statics = [_statics(one, found) for one in observations]
        constant = next((one for one in statics if one.attrs["constant_friction"]), None)
        clipped = [text for one, name in _named(observations) for text in _clipped(one, name)]
        is_explained = constant is not None or bool(clipped)
        misfit = [] if is_explained else _misfit(found, lambda name: best_fit(observed(name)))
        parts = [_of_test(one, found, cycles) for one in observations]
        whole = (
            parts[0]
            if len(parts) == 1
            else xr.concat(parts, "test", join="outer", combine_attrs="override")
        )
        whole = whole.merge(_of_all(found)).assign(statics[0].variables)
    whole.attrs = {
        "title": "Calibration of a sliding block from tests on a shaking table",
        **SOURCE,
        **(tests[0].attrs if len(tests) == 1 else {"tests": ", ".join(one.name for one in tests)}),
        **options.MODELS.attributes(chosen),
        "removed": "; ".join(dict.fromkeys(one.attrs["removed"] for one in parts)),
        **_report(found, whole, constant, clipped, misfit),
    }
    return whole


def _of_test(one: Observation, found: Estimate, cycles: bool) -> xr.Dataset:
    """What belongs to one test: measured and computed series, misfits, cycles; the attribute `removed`."""
    test = one.test
    parameters = found.of_test(one)
    history = one.forward(parameters, one.test.times)
    removed = _removed(one, found)[1]
    about = variables.CALIBRATION_SERIES | variables.MEASURED_FRICTION
    channels = _measured(one, found)
    series = {f"measured_{name}": values for name, values in channels.items()}
    series |= {f"computed_{name}": values for name, values in history.items()}
    block = _block_acceleration(test, channels)
    if block is not None:
        series["friction_coefficient"] = eq1_friction(
            channels[TABLE], block, one.theta, one.mu_s, one.model.g
        )
        series["free_body_friction"] = free_body_friction(block, one.theta, one.model.g)
    data: dict[str, Any] = {name: ("time", values, about[name]) for name, values in series.items()}
    for name, misfit in zip(one.channels, one.misfits(parameters), strict=True):
        span = max(float(np.nanmax(np.abs(history[name]))), 1e-300)
        long_name = (
            f"root mean square of measured less computed {variables.HISTORY[name]['long_name']}"
        )
        data[f"misfit_{name}"] = ((), misfit, {**variables.HISTORY[name], "long_name": long_name})
        data[f"relative_misfit_{name}"] = (
            (),
            misfit / span,
            {"units": "1", "long_name": f"{long_name}, over largest"},
        )
    data |= {
        name: found.summary(one)[name].variable for name in ("permanent_displacement", "validity")
    }
    time = {"time": ("time", test.times, {"units": "s", "long_name": "time"})}
    dataset = xr.Dataset(data, time, {"removed": "; ".join(removed) or "nothing"})
    return dataset.merge(_cycles(one, found)) if cycles else dataset


def _measured(one: Observation, found: Estimate) -> dict[str, Floats]:
    """Return the channels of a test, less offsets, drifts and steps."""
    added, _ = _removed(one, found)
    return {name: values - added[name] for name, values in one.test.channels.items()}


def _removed(one: Observation, found: Estimate) -> tuple[dict[str, Floats], list[str]]:
    """What offsets, drifts and steps add to each channel, and each in words with its standard error."""
    added = {name: np.zeros(one.test.times.size) for name in one.test.channels}
    texts = []
    of_table = np.transpose(found.lines_of(one))
    of_block = np.transpose(one.nuisances(found.of_test(one)))[one.wrong.size :]
    lines = [*one.table_lines, *one.lines]
    for line, (size, error) in zip(lines, [*of_table, *of_block], strict=True):
        added[line.channel] = added[line.channel] + size * line.values
        units = variables.HISTORY[line.channel]["units"] + " over the whole test" * (
            line.name == "drift"
        )
        size = line.deviation * size
        error = line.deviation * error
        texts.append(f"{line.name} of {line.channel}: {size:.4g} ± {error:.2g} {units}")
    return added, texts


def _cycles(one: Observation, found: Estimate) -> xr.Dataset:
    """Each cycle by itself: estimates, standard errors and Kd."""
    motion = one.record(found.lines_of(one)[0])
    times = one.test.times
    continuous = "continuous" in found.readings
    least = max(found.parameters[0], _A_CYCLE * one.peak)
    pulses = [
        part
        for part in runs_of(motion.acceleration > 0.0)
        if motion.acceleration[part].max() > least
    ]
    data = {
        name: np.full(len(pulses), np.nan)
        for name in variables.CALIBRATION
        if name.startswith("cycle_")
    }
    data["cycle_start"][:] = starts = [motion.times[part.start] for part in pulses]
    data["cycle_peak_acceleration"][:] = [motion.acceleration[part].max() for part in pulses]
    parameters = found.of_test(one)
    speed = max(float(np.abs(one.forward(parameters, times)["relative_velocity"]).max()), 1e-6)
    for row, (begin, end) in enumerate(zip(starts, [*starts[1:], motion.times[-1]], strict=True)):
        inside = (times >= begin) & (times < end)
        if inside.sum() < _FEWEST_IN_A_CYCLE:
            continue
        of_cycle = one.cycle(begin, end, speed, parameters, found.lines_of(one)[1])
        values, errors = cycle_estimate(of_cycle, parameters, [1, 2] if continuous else [0, 1, 2])
        for name, value, error in zip(SOUGHT, values, errors, strict=True):
            data[f"cycle_{name}"][row] = value
            data[f"cycle_{name}_error"][row] = error
        fitted = np.where(np.isfinite(values), values, found.parameters)
        history = one.forward(np.append(fitted, parameters[3:]), times)
        slides = inside & (history[TABLE] > 0.0)
        if slides.any() and not continuous:
            data["cycle_attenuation_coefficient"][row] = (
                history["block_acceleration"][slides].max() / one.model.g
            )
    mode = variables.SlidingMode.CONTINUOUS if continuous else variables.SlidingMode.STICK_SLIP
    data["cycle_sliding_mode"] = np.full(len(pulses), mode, np.int8)
    number = {
        "cycle": (
            "cycle",
            np.arange(1, len(pulses) + 1),
            {"units": "1", "long_name": "number of the cycle"},
        )
    }
    columns = {
        name: ("cycle", values, variables.CALIBRATION[name]) for name, values in data.items()
    }
    return xr.Dataset(columns, number)


def _of_all(found: Estimate) -> xr.Dataset:
    """What belongs to all tests together: parameters, errors, intervals, correlation."""
    pair = ("parameter", "other_parameter")
    data: dict[str, Any] = {
        "correlation": (pair, found.correlation, variables.CALIBRATION["correlation"])
    }
    for name, value, error, interval in zip(
        SOUGHT, found.parameters, found.errors, found.intervals, strict=True
    ):
        about = variables.PARAMETERS[name]
        data[name] = ((), value, about)
        data[f"{name}_error"] = (
            (),
            error,
            {**about, "long_name": f"standard error of the {about['long_name']}"},
        )
        of_interval = {**about, "long_name": f"95 % interval of the {about['long_name']}"}
        data[f"{name}_interval"] = ("bound", interval, of_interval)
    codes = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(SOUGHT)}
    coords: dict[str, Any] = {
        name: (name, np.arange(3, dtype=np.int8), {"long_name": name.replace("_", " "), **codes})
        for name in pair
    }
    coords["bound"] = BOUND
    for name in ("theta", "mu_s"):
        coords[name] = ((), getattr(found.observations[0], name), variables.PARAMETERS[name])
    return xr.Dataset(data, coords)


def _named(observations: Sequence[Observation]) -> list[tuple[Observation, str]]:
    """Return tests, each with the beginning of a sentence on it: its name, if there are several."""
    several = len(observations) > 1
    return [(one, f"{one.test.name}: " if several else "") for one in observations]


def _report(
    found: Estimate,
    results: xr.Dataset,
    constant: xr.Dataset | None,
    clipped: Sequence[str],
    misfit: Sequence[str],
) -> dict[str, str]:
    """Return all that must be said of a calibration, as attributes of its results.

    `constant` are the coefficients of a test in which friction was constant, `clipped` and `misfit`
    sentences.
    The tables for a sweep file are commented out where the calibration has failed or determines too
    little.
    """
    sentence = "" if constant is None else constant.attrs["constant_friction"]
    slides = bool((results["permanent_displacement"] != 0.0).any())
    named = _named(found.observations)
    said = [*clipped, *([sentence] if sentence else misfit)]
    said += [text for one, name in named for text in _colours(one, name)]
    for one in found.observations:
        motion = one.table_acceleration(found.lines_of(one)[0])
        first = float(motion[0])
        most = float(np.abs(motion).max())
        if abs(first) > max(_MOVES * most, 3.0 * one.motion.noise):
            said.append(
                f"The table moves as the record begins, at {first:.3g} m/s2. The block is taken to be at rest there. "
                "If it slides, the results are wrong: let the record begin where both are at rest."
            )
    for times in (one.upslope for one in found.observations if one.upslope):
        many = f"{len(times)} time{'s' if len(times) > 1 else ''}"
        said.append(
            f"The block slipped upslope {many} (first at {times[0]:.3g} s). In stick-slip the model has no upslope "
            "slip: these samples are left out, and the displacement may step there."
        )
    if not slides:
        said.append(
            "The computed block does not slide: no parameter is determined. Test with a larger amplitude."
        )
    elif not found.determined.all():
        said += _undetermined(found)
    contradictions = [text for one in found.observations for text in _contradiction(found, one)]
    contradictions += [text for one, name in named for text in _outliers(found, one, name)]
    said += contradictions
    if (results["validity"] & variables.Validity.NOT_RECOUPLED).any():
        said.append(
            "The computed block does not come to rest before the next slide begins (flag "
            "not_recoupled). Small errors of the table's motion may then change the motion much: the "
            "intervals may be too narrow."
        )
    if constant is not None and not clipped:
        tables = _newmark_tables(found.observations[0], constant)
    elif found.determined.all() and slides and not [*clipped, *misfit, *contradictions]:
        tables = _model_table(found), _uncertainty_table(found)
    else:
        comments = ["WARNING: not ready for use.", *said, "", *_model_table(found).splitlines()]
        tables = "".join(f"# {line}".rstrip() + "\n" for line in comments), ""
    texts = (sentence, "\n".join(said), *tables)
    return dict(
        zip(
            ("constant_friction", "findings", "model_table", "uncertainty_table"),
            texts,
            strict=True,
        )
    )


def _block_acceleration(test: ShakingTest, channels: Mapping[str, Floats]) -> Floats | None:
    """Return the block's acceleration, measured or from its velocity; None without either."""
    if "block_acceleration" in channels or "relative_velocity" not in channels:
        return channels.get("block_acceleration")
    return np.asarray(channels[TABLE] - np.gradient(channels["relative_velocity"], test.times))


def _slides(
    one: Observation, found: Estimate, table: Floats, block: Floats
) -> tuple[list[slice], float]:
    """Return the slides of a test, and the threshold by which they are told from noise."""
    threshold = threshold_of(one.test.channels[TABLE], block)[0]
    if "block_acceleration" in one.channels:  # neighbours show too little of coloured noise
        row = one.channels.index("block_acceleration")
        noise = math.hypot(
            one.noise_seen(found.of_test(one))[row], one.motion.noise * (one.motion.colour > 0.0)
        )
        threshold = max(threshold, NOISE_IN_THRESHOLD * noise)
    return slides_of(one.test.times, table, block, threshold), threshold


def _statics(one: Observation, found: Estimate) -> xr.Dataset:
    """Friction by statics; nothing where neither the block's acceleration nor its velocity is measured."""
    block = _block_acceleration(one.test, _measured(one, found))
    if block is None:
        return xr.Dataset(attrs={"constant_friction": ""})
    table = _smooth_table(one, found)
    slides, _ = _slides(one, found, table, block)
    return coefficients_of(table, block, slides, one.mu_s, one.theta, one.model.g)


def _smooth_table(one: Observation, found: Estimate) -> Floats:
    """Return the table's motion at the samples, less offset and drift of its sensor."""
    motion = one.recorded_acceleration(found.lines_of(one)[0])
    return np.interp(one.test.times, one.motion.times, motion)


def _clipped(one: Observation, name: str) -> list[str]:
    """Return which channels are at the end of their range, in words.

    Tops at which a block holds its acceleration or its displacement, or bottoms at which it is at
    rest, are flat without that.
    """
    texts = []
    for channel, signs in _RANGES.items():
        values = one.test.channels.get(channel, np.zeros(1))
        largest = float(np.nanmax(np.abs(values)))
        ends = []
        for sign in signs:
            end = float(np.nanmax(sign * values))
            is_flat = flat_top(sign * values) > 0
            if channel == TABLE and not is_flat:
                is_flat = noisy_flat_top(sign * values) > 0
            if is_flat and end > _MOVES * largest:
                ends.append(f"{sign * end:.4g}")
        if ends:
            units = variables.HISTORY[channel]["units"]
            texts += [
                f"{name}{channel} is cut off: it is flat at {' and '.join(ends)} {units}, as of a "
                "sensor or converter at the end of its range.",
                "The intervals do not include what is cut off. Test with a larger range.",
            ]
    return texts


def _colours(one: Observation, name: str) -> list[str]:
    """Return sentences on coloured noise, if there is some."""
    table = "" if one.motion.rests else "at most "
    colours = [(TABLE, table, one.motion.colour)]
    colours += [
        (channel, "", colour) for channel, colour in zip(one.channels, one.colour, strict=True)
    ]
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
    if not one.motion.rests:
        texts.append(
            f"How slow the noise of {TABLE} is cannot be told while the table moves: the intervals "
            "may be too narrow. Let the record begin with half a second at rest."
        )
    return texts


def _misfits(found: Estimate | Fit) -> dict[str, float]:
    """Channels whose misfit is more than 1.5 times their noise and 1 % of their largest value, and how many times."""
    worse: dict[str, float] = {}
    for one in found.observations:
        parameters = found.of_test(one)
        of_channels = zip(
            one.channels,
            one.misfits(parameters),
            one.noise_seen(parameters),
            one.largest,
            strict=True,
        )
        for name, misfit, noise, largest in of_channels:
            if misfit > max(1.5 * noise, 0.01 * largest):
                worse[name] = max(misfit / noise, worse.get(name, 0.0))
    return worse


def _misfit(found: Estimate, with_drift: Callable[[str], Fit]) -> list[str]:
    """Which channels are not explained, and which of them an offset and a drift, that were not given, would explain."""
    if not (misfits := _misfits(found)):
        return []
    listed = ", ".join(f"{name} {times:.2g} times" for name, times in misfits.items())
    said = [
        f"The misfit is larger than the noise of the sensors: {listed}. The block did not move as in "
        "the model, a sensor drifts, or its noise is slow: do not use the parameters before you know "
        "why (see the figure)."
    ]
    for name in misfits:
        may_drift = all(
            name in one.channels and name not in one.drifts for one in found.observations
        )
        if may_drift and not _misfits(with_drift(name)):
            explained = "taken out, the misfit is that of the sensors' noise"
            said.append(f"With an offset and a drift of {name} {explained}: give drift = {name!r}.")
    return said


def _contradiction(found: Estimate, one: Observation) -> list[str]:
    """Say if the interval of Üy begins above where the block was seen to begin to slide."""
    if "block_acceleration" not in one.channels or "continuous" in found.readings:
        return []
    block = _measured(one, found)["block_acceleration"]
    table = _smooth_table(one, found)
    slides, threshold = _slides(one, found, table, block)
    onsets = np.array([onset_acceleration(table, block, slide, threshold) for slide in slides])
    onsets = onsets[onsets > 0.0]  # downslope
    if not onsets.size:
        return []
    step = np.abs(np.diff(table)).max()
    least = found.intervals[0][0]
    seen = np.median(onsets)
    text = (
        f"The 95 % interval of Üy begins at {least:.3g} m/s2, but the block was seen to begin to "
        f"slide at {seen:.3g} m/s2: the fit contradicts the test."
    )
    return (
        [text]
        if least > seen + step + threshold + 3.0 * np.std(onsets) / len(onsets) ** 0.5
        else []
    )


def _outliers(found: Estimate, one: Observation, name: str) -> list[str]:
    """Return which samples contradict the solution, in words."""
    texts = []
    for channel, (times, most) in one.contradicting(found.of_test(one)).items():
        units = variables.HISTORY[channel]["units"]
        samples = "1 sample" if times.size == 1 else f"{times.size} samples"
        texts.append(
            f"{name}{samples} of {channel} cannot be noise: up to {most:.3g} {units} off what is "
            f"computed, first at {times[0]:.4g} s. A sensor failed there, or the solution is wrong."
        )
    return texts


def _undetermined(found: Estimate) -> list[str]:
    """Which parameters the tests do not determine, why, and which measurement would."""
    tests = "these tests" if len(found.observations) > 1 else "this test"
    missing = [at for at in range(3) if not found.determined[at]]
    *others, last = (_SYMBOL[at] for at in missing)
    listed, are = (f"{', '.join(others)} and {last}", "are") if others else (last, "is")
    ranges = "; ".join(f"{_SYMBOL[at]} {_range(*found.intervals[at])}{_UNIT[at]}" for at in missing)
    yields = "held" in found.readings and not math.isfinite(found.intervals[1][1])
    crosses = bool({"crossed", "crossing"} & found.readings)
    why = {
        (
            True,
            True,
        ): "Two readings fit equally well: Üy holds the block, and λ and Δμ are nearly free; or Eq. 4 "
        "crosses the table's acceleration at the same value, and Üy is anything below. The intervals are the union of "
        "both.",
        (
            True,
            False,
        ): "Where Eq. 4 gives less than the yield acceleration in every cycle, the motion does not depend "
        "on λ and Δμ.",
        (
            False,
            True,
        ): "Where Eq. 4 holds the block to the table until the table's acceleration has passed Üy, the "
        "motion does not depend on Üy.",
    }.get((yields, crosses), "")
    two = ""
    if found.apart:
        onsets = " or ".join(f"{onset:.3g}" for onset in found.apart)
        two = f"Several solutions fit: Üy is about {onsets} m/s2, and nothing between."
    return [
        f"{listed} {are} not determined by {tests}: 95 % intervals {ranges}.",
        *filter(None, [two, why]),
        _remedy(found),
    ]


def _range(low: float, high: float) -> str:
    if math.isfinite(high):
        return f"up to {high:.3g}" if low <= 0.0 else f"{low:.3g} to {high:.3g}"
    return "any value" if low <= 0.0 else f"{low:.3g} or more"


def _remedy(found: Estimate) -> str:
    """The measurement that would tell allowed parameters apart: the amplitude at which displacements differ most."""
    one = found.observations[0]
    if all("block_acceleration" not in each.test.channels for each in found.observations):
        return f"Measure the acceleration of the block, or t{_ANOTHER[1:]}."
    factors = np.array([0.6, 0.8, 1.25, 1.5, 2.0])  # on the motion
    some = np.unique(np.linspace(0, len(found.allowed) - 1, 24).astype(int))
    ends = np.argsort(found.allowed, axis=0)[[0, -1]].ravel()
    columns = found.allowed[[*some, *ends]].T
    cases = {
        name: xr.DataArray(column, dims="case")
        for name, column in zip(SOUGHT, columns, strict=True)
    }
    moved = abs(found.summary(one, scale=factors, **cases)["permanent_displacement"])
    span = float(np.abs(found.summary(one)["permanent_displacement"]))
    low = moved.min(dim="case").values
    high = moved.max(dim="case").values
    if not np.isfinite(high).any():
        return f"{_ANOTHER}."
    best = int(np.nanargmax((high - low) / (np.sqrt(low * high) + 0.05 * span)))
    return (
        f"{_ANOTHER}: at {factors[best]:g} times this one ({factors[best] * one.peak:.3g} m/s2) the parameters that "
        f"fit give displacements from {low[best]:.2g} to {high[best]:.2g} m."
    )


def _model_table(found: Estimate) -> str:
    """The [model] table of a sweep file, with intervals in comments."""
    model = found.observations[0].model
    lines = [
        "[model]",
        'friction = "mendez"',
        f'rise = "{model.rise}"',
        f'recoupling = "{model.recoupling}"',
    ]
    for at, name in enumerate(SOUGHT):
        low, high = found.intervals[at]
        about = (
            f"95 %: {low:.4g} to {high:.4g}{_UNIT[at]}"
            if found.determined[at]
            else "not determined"
        )
        lines.append(f"{name} = {_number(found.parameters[at])}  # {about}")
    return "\n".join([*lines, f"g = {model.g:g}"]) + "\n"


def _uncertainty_table(found: Estimate) -> str:
    """[uncertainty] tables of a sweep file from the covariance: normal, cut where nothing physical lies; "" if none."""
    if not np.isfinite(found.errors).all():
        return ""
    lines = ["[uncertainty]"]
    most = (
        0.9998  # a hair less than 1, so that with rounding a matrix of correlations stays positive
    )
    rounded = np.round(np.clip(found.correlation, -most, most), 4)
    if np.linalg.eigvalsh(rounded + np.diag([1.0 - most] * 3)).min() > 1e-6:
        pairs = [
            f'["{SOUGHT[i]}", "{SOUGHT[j]}", {rounded[i, j]:.4f}]'
            for i, j in ((0, 1), (0, 2), (1, 2))
        ]
        lines.append(f"correlation = [{', '.join(pairs)}]")
    for name, value, error in zip(SOUGHT, found.parameters, found.errors, strict=True):
        lines += _normal(name, value, error)
    return "\n".join(lines) + "\n"


def _normal(name: str, value: float, error: float) -> list[str]:
    low = math.ceil(-1e4 * value / error) / 1e4
    cut = ['distribution = "truncnorm"', f"a = {low + 0.0:.4f}", "b = 8.0"]
    kind = cut if low > -6.0 else ['distribution = "norm"']
    return ["", f"[uncertainty.{name}]", *kind, f"loc = {_number(value)}", f"scale = {error:.4g}"]


def _newmark_tables(one: Observation, coefficients: xr.Dataset) -> tuple[str, str]:
    """Newmark's block with the kinetic coefficient, for a block of constant friction."""
    kinetic = coefficients["kinetic_friction"].item()
    low, high = coefficients["kinetic_friction_interval"].values
    low, value, high = one.model.g * np.tan(
        np.arctan([low, kinetic, high]) - math.radians(one.theta)
    )
    head = "# A block of constant friction: Newmark's model, with the kinetic coefficient"
    model = (
        f"{head} {kinetic:.4g} at {one.theta:g} deg.\n"
        f'[model]\nfriction = "newmark"\nyield_acceleration = {_number(value)}  # 95 %: {low:.4g} to {high:.4g} m/s2\n'
        f"g = {one.model.g:g}\n"
    )
    lines = _normal("yield_acceleration", value, max((high - low) / (2.0 * QUANTILE), 1e-6 * value))
    return model, "\n".join(["[uncertainty]", *lines]) + "\n"


def sweep_file_text(model_table: str, uncertainty_table: str) -> str:
    """Both tables for one file: what [uncertainty] draws is a comment in [model]."""
    if not uncertainty_table:
        return model_table
    drawn = tuple(f"{name} = " for name in SOUGHT if f"[uncertainty.{name}]" in uncertainty_table)
    lines = model_table.splitlines()
    lines = [
        f"# {line}; without [uncertainty]" if line.startswith(drawn) else line for line in lines
    ]
    return "\n".join(lines) + "\n\n" + uncertainty_table


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return text if "." in text or "e" in text else f"{text}.0"
