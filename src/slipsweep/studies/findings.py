"""What a calibration says in words: what the tests do not determine and what would, and tables for sweep files."""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from slipsweep.model.variables import Validity
from slipsweep.motion.shaking import TABLE, ShakingTest
from slipsweep.studies.estimate import Estimate
from slipsweep.studies.friction import coefficients_of, onset_acceleration, slides_of, threshold_of
from slipsweep.studies.likelihood import SOUGHT, Observation
from slipsweep.studies.table_motion import Floats

#: Symbols and units of what is sought.
_SYMBOL, _UNIT = ("Üy", "λ", "Δμ"), (" m/s2", "", "")

#: Largest correlation that is written.
_MOST_CORRELATION = 0.9998

#: Part of the table's largest acceleration beyond which it moves.
_MOVES = 0.1

#: How many times the noise, and which part of the largest value, a misfit must be to be reported.
_WORSE, _MISSES = 1.5, 0.01

#: Factors on the motion at which the displacements of allowed parameters are compared, and how many parameters.
_FACTORS, _COMPARED = (0.6, 0.8, 1.25, 1.5, 2.0), 24

_ANOTHER = "Test at another amplitude and give calibrate all tests together"


def report(
    found: Estimate, results: xr.Dataset, statics: Sequence[xr.Dataset], drifting: Sequence[str]
) -> dict[str, str]:
    """All that must be said of a calibration, as attributes of its results.

    `statics` are the coefficients of each test, `drifting` the channels with whose drift the misfit is explained.
    The tables for a sweep file are commented out where the calibration has failed or determines too little.
    """
    constant = next((one for one in statics if one.attrs["constant_friction"]), None)
    sentence = "" if constant is None else constant.attrs["constant_friction"]
    slides = bool((results["permanent_displacement"] != 0.0).any())
    said = [sentence] if sentence else _misfit(found, drifting)
    failed = bool(said)
    for one in found.observations:
        first, most = float(one.motion.acceleration[0]), float(np.abs(one.motion.acceleration).max())
        if abs(first) > max(_MOVES * most, 3.0 * one.motion.noise):
            said.append(
                f"The table moves as the record begins, at {first:.3g} m/s2. The block is taken to be at rest there. "
                "If it slides, the results are wrong: let the record begin where both are at rest."
            )
    for times in (one.upslope for one in found.observations if one.upslope):
        said.append(
            f"The block slipped upslope {len(times)} time{'s' if len(times) > 1 else ''} (first at {times[0]:.3g} s). "
            "In stick-slip the model has no upslope slip: these samples are left out, and the displacement may step "
            "there."
        )
    if not slides:
        said.append("The computed block does not slide: no parameter is determined. Test with a larger amplitude.")
    elif not found.determined.all():
        said += _undetermined(found)
    contradictions = [text for one in found.observations for text in _contradiction(found, one)]
    said += contradictions
    if (results["validity"] & Validity.NOT_RECOUPLED).any():
        said.append("The computed block does not come to rest before the next slide begins (flag not_recoupled).")
    if constant is not None:
        tables = _newmark_tables(found.observations[0], constant)
    elif found.determined.all() and slides and not failed and not contradictions:
        tables = _model_table(found), _uncertainty_table(found)
    else:
        comments = ["WARNING: not ready for use.", *said, "", *_model_table(found).splitlines()]
        tables = "".join(f"# {line}".rstrip() + "\n" for line in comments), ""
    texts = (sentence, "\n".join(said), *tables)
    return dict(zip(("constant_friction", "findings", "model_table", "uncertainty_table"), texts, strict=True))


def block_acceleration(test: ShakingTest) -> Floats | None:
    """The block's acceleration, measured or from the relative velocity."""
    if "block_acceleration" in test.channels:
        return test.channels["block_acceleration"]
    if "relative_velocity" in test.channels:
        return np.asarray(test.channels[TABLE] - np.gradient(test.channels["relative_velocity"], test.times))
    return None


def statics(one: Observation) -> xr.Dataset:
    """Friction by statics; nothing where neither the block's acceleration nor its velocity is measured."""
    block = block_acceleration(one.test)
    if block is None:
        return xr.Dataset(attrs={"constant_friction": ""})
    table = np.interp(one.test.times, one.motion.times, one.motion.acceleration)
    slides = slides_of(one.test.times, table, block, threshold_of(table, block)[0])
    return coefficients_of(table, block, slides, one.mu_s, one.theta, one.model.g)


def misfits(found: Estimate) -> dict[str, float]:
    """Channels whose misfit is larger than their noise, as neighbouring samples scatter, and how many times."""
    worse: dict[str, float] = {}
    for one in found.observations:
        of_channels = zip(one.channels, one.misfits(found.parameters), one.sensor_noise, one.largest, strict=True)
        for name, misfit, noise, largest in of_channels:
            if misfit > max(_WORSE * noise, _MISSES * largest):
                worse[name] = max(misfit / noise, worse.get(name, 0.0))
    return worse


def _misfit(found: Estimate, drifting: Sequence[str]) -> list[str]:
    """Which channels are not explained, and which of them a drift would explain."""
    listed = ", ".join(f"{name} {times:.2g} times" for name, times in misfits(found).items())
    text = (
        f"The misfit is larger than the noise of the sensors: {listed}. The block did not move as in the model, or a "
        "sensor drifts: do not use the parameters before you know why (see the figure)."
    )
    explained = "taken out, the misfit is that of the sensors' noise: give drift ="
    drifts = [f"With an offset and a drift of {name} {explained} {name!r}." for name in drifting]
    return [text, *drifts] if listed else []


def _contradiction(found: Estimate, one: Observation) -> list[str]:
    """A lower bound of Üy that is larger than the accelerations at which the block was seen to begin to slide."""
    if "block_acceleration" not in one.channels or "continuous" in found.readings:
        return []
    times, block = one.test.times, one.test.channels["block_acceleration"]
    table = np.interp(times, one.motion.times, one.motion.acceleration)
    threshold = threshold_of(one.test.channels[TABLE], block)[0]
    slides = slides_of(times, table, block, threshold)
    onsets = np.array([onset_acceleration(table, block, slide, threshold) for slide in slides])
    onsets = onsets[onsets > 0.0]  # downslope
    if not onsets.size:
        return []
    step, least, seen = np.abs(np.diff(table)).max(), found.intervals[0][0], np.median(onsets)
    text = (
        f"Üy is at least {least:.3g} m/s2 by the fit, but the block was seen to begin to slide at {seen:.3g} m/s2: the "
        "fit contradicts the test."
    )
    return [text] if least > seen + step + threshold + 3.0 * np.std(onsets) / len(onsets) ** 0.5 else []


# ------------------------------------------------------------------------------- determination


def _undetermined(found: Estimate) -> list[str]:
    """Which parameters the tests do not determine, why, and which measurement would."""
    tests = "these tests" if len(found.observations) > 1 else "this test"
    missing = [at for at in range(3) if not found.determined[at]]
    *others, last = (_SYMBOL[at] for at in missing)
    listed, are = (f"{', '.join(others)} and {last}", "are") if others else (last, "is")
    ranges = "; ".join(f"{_SYMBOL[at]} {_range(found.intervals[at], at)}" for at in missing)
    said = [f"{listed} {are} not determined by {tests}: {ranges}."]
    yields = "held" in found.readings and not math.isfinite(found.intervals[1][1])
    crosses = bool({"crossed", "crossing"} & found.readings)
    if yields and crosses:
        said.append(
            "Two readings fit equally well: Üy holds the block, and λ and Δμ are nearly free; or Eq. 4 crosses the "
            "table's acceleration at the same value, and Üy is anything below. The intervals are the union of both."
        )
    elif yields:
        said.append(
            "Where Eq. 4 gives less than the yield acceleration in every cycle, the motion does not depend on λ and Δμ."
        )
    elif crosses:
        said.append(
            "Where Eq. 4 holds the block to the table until the table's acceleration has passed Üy, the motion does "
            "not depend on Üy."
        )
    return [*said, _remedy(found)]


def _range(interval: Floats, at: int) -> str:
    low, high = interval
    text = "any value" if low <= 0.0 else f"{low:.3g} or more"
    if math.isfinite(high):
        text = f"up to {high:.3g}" if low <= 0.0 else f"{low:.3g} to {high:.3g}"
    return text + _UNIT[at]


def _remedy(found: Estimate) -> str:
    """The measurement that would tell allowed parameters apart: the amplitude at which displacements differ most."""
    one = found.observations[0]
    if all("block_acceleration" not in each.test.channels for each in found.observations):
        return f"Measure the acceleration of the block, or t{_ANOTHER[1:]}."
    some = np.unique(np.linspace(0, len(found.allowed) - 1, _COMPARED).astype(int))
    ends = np.argsort(found.allowed, axis=0)[[0, -1]].ravel()
    columns = found.allowed[[*some, *ends]].T
    cases = {name: xr.DataArray(column, dims="case") for name, column in zip(SOUGHT, columns, strict=True)}
    moved = abs(found.summary(one, scale=list(_FACTORS), **cases)["permanent_displacement"])
    span = float(np.abs(found.summary(one)["permanent_displacement"]))
    low, high = moved.min(dim="case").values, moved.max(dim="case").values
    if not np.isfinite(high).any():
        return f"{_ANOTHER}."
    best = int(np.nanargmax((high - low) / (np.sqrt(low * high) + 0.05 * span)))
    return (
        f"{_ANOTHER}: at {_FACTORS[best]:g} times this one ({_FACTORS[best] * one.peak:.3g} m/s2) the parameters that "
        f"fit give displacements from {low[best]:.2g} to {high[best]:.2g} m."
    )


# ------------------------------------------------------------------------------------- tables


def _model_table(found: Estimate) -> str:
    """The [model] table of a sweep file, with intervals in comments."""
    model = found.observations[0].model
    lines = ["[model]", 'friction = "mendez"', f'rise = "{model.rise}"', f'recoupling = "{model.recoupling}"']
    for at, name in enumerate(SOUGHT):
        low, high = found.intervals[at]
        about = f"95 %: {low:.4g} to {high:.4g}{_UNIT[at]}" if found.determined[at] else "not determined"
        lines.append(f"{name} = {_number(found.parameters[at])}  # {about}")
    return "\n".join([*lines, f"g = {model.g:g}"]) + "\n"


def _uncertainty_table(found: Estimate) -> str:
    """[uncertainty] tables of a sweep file from the covariance: normal, cut where nothing physical lies; "" if none."""
    if not np.isfinite(found.errors).all():
        return ""
    lines = ["[uncertainty]"]
    # a hair less than 1, so that with rounding a matrix of correlations stays positive
    rounded = np.round(np.clip(found.correlation, -_MOST_CORRELATION, _MOST_CORRELATION), 4)
    if np.linalg.eigvalsh(rounded + np.diag([1.0 - _MOST_CORRELATION] * 3)).min() > 1e-6:
        pairs = [f'["{SOUGHT[i]}", "{SOUGHT[j]}", {rounded[i, j]:.4f}]' for i, j in ((0, 1), (0, 2), (1, 2))]
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
    low, value, high = one.model.g * np.tan(np.arctan([low, kinetic, high]) - math.radians(one.theta))
    model = (
        "# A block of constant friction: Newmark's model, with the kinetic coefficient "
        f"{kinetic:.4g} at {one.theta:g} deg.\n"
        f'[model]\nfriction = "newmark"\nyield_acceleration = {_number(value)}  # 95 %: {low:.4g} to {high:.4g} m/s2\n'
        f"g = {one.model.g:g}\n"
    )
    lines = _normal("yield_acceleration", value, max((high - low) / 3.92, 1e-6 * value))
    return model, "\n".join(["[uncertainty]", *lines]) + "\n"


def sweep_file_text(model_table: str, uncertainty_table: str) -> str:
    """Both tables for one file: what [uncertainty] draws is a comment in [model]."""
    if not uncertainty_table:
        return model_table
    drawn = tuple(f"{name} = " for name in SOUGHT if f"[uncertainty.{name}]" in uncertainty_table)
    lines = model_table.splitlines()
    lines = [f"# {line}; without [uncertainty]" if line.startswith(drawn) else line for line in lines]
    return "\n".join(lines) + "\n\n" + uncertainty_table


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return text if "." in text or "e" in text else f"{text}.0"
