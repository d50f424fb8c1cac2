"""What a calibration says in words: what the test does not determine and what would, and tables for sweep files."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.model.variables import PARAMETERS, Validity
from slipsweep.studies.estimate import Estimate
from slipsweep.studies.friction import Coefficients, onset_acceleration, slides_of, threshold_of
from slipsweep.studies.likelihood import SOUGHT, Observation
from slipsweep.studies.table_motion import noise_of

Floats = NDArray[np.float64]

SYMBOL = ("Üy", "λ", "Δμ")

#: A parameter is not determined if half its interval is more than this part of it; of Δμ, of μs + Δμ.
_UNDETERMINED = (0.5, 0.5, 0.3)

#: Correlation from which two parameters are said to be inseparable if one has a larger relative error.
_CORRELATED, _LOOSE = 0.95, 0.2

#: Largest correlation that is written.
_MOST_CORRELATION = 0.9998

#: Part of the table's largest acceleration beyond which it moves.
_MOVES = 0.1

#: How many times the noise, and which part of the largest value, a misfit must be to be reported.
_WORSE, _MISSES = 1.5, 0.01

#: Factors on the motion at which the displacements of allowed parameters are compared, and how many parameters.
_FACTORS, _COMPARED = (0.6, 0.8, 1.25, 1.5, 2.0), 24


@dataclass
class Reported:
    """What is said of a calibration.

    Attributes
    ----------
    constant : str
        The sentence on a block of constant friction; "" of others.
    findings : list of str
    misfits : dict of str to float
        Channels whose misfit is larger than their noise, and how many times.
    errors, correlation : ndarray
        Standard errors and correlations; NaN of what is not determined.
    model_table, uncertainty_table : str
        Tables of a sweep file; commented out where the calibration has failed or determines too little.
    """

    constant: str
    findings: list[str]
    misfits: dict[str, float]
    errors: Floats
    correlation: Floats
    model_table: str
    uncertainty_table: str


def report(
    found: Estimate, episodes: Sequence[Sequence[tuple[float, float]]], coefficients: Sequence[Coefficients | None]
) -> Reported:
    """All that must be said of a calibration."""
    known = np.array([_determined(found, at) for at in range(3)])
    errors = np.where(known, np.sqrt(np.diag(found.covariance)), np.nan)
    correlation = found.covariance / np.outer(errors, errors)
    misfits = _misfits(found)
    constant = next((one.sentence for one in coefficients if one is not None and one.constant), "")
    slides = any(float(found.summary(one)["permanent_displacement"].item()) != 0.0 for one in found.observations)
    contradiction = _contradiction(found)
    said = [] if constant else _misfit_sentences(found, misfits)
    said += _upslope_sentences(episodes)
    if not slides:
        said.append("The computed block does not slide: no parameter is determined. Test with a larger amplitude.")
    elif not known.all():
        said += _undetermined(found, known)
    if slides and not constant and not {"held", "crossed"} & found.readings:
        said += _inseparable(found)
    said += contradiction
    if any(int(found.summary(one)["validity"].item()) & Validity.NOT_RECOUPLED for one in found.observations):
        said.append("The computed block does not come to rest before the next slide begins (flag not_recoupled).")
    if constant:
        kinetic = next(one for one in coefficients if one is not None and one.constant)
        tables = _newmark_tables(found, kinetic)
    else:
        ready = bool(known.all()) and slides and not misfits and not contradiction
        tables = _model_table(found, known), _uncertainty_table(found, errors, correlation)
        if not ready:
            tables = _as_comments(said, tables[0]), ""
    return Reported(constant, [constant, *said] if constant else said, misfits, errors, correlation, *tables)


def _determined(found: Estimate, at: int) -> bool:
    low, high = found.intervals[at]
    size = found.parameters[at] + (found.observations[0].mu_s if at == 2 else 0.0)
    if at == 0 and low <= 0.0:
        return False
    return bool(math.isfinite(high) and high - low <= 2.0 * _UNDETERMINED[at] * abs(size))


# ---------------------------------------------------------------------------------- reliability


def _moves(one: Observation) -> bool:
    """Whether the table moves already as the record begins."""
    smooth = one.motion.acceleration
    return abs(float(smooth[0])) > max(_MOVES * float(np.abs(smooth).max()), 3.0 * one.motion.noise)


def _misfit_sentences(found: Estimate, misfits: dict[str, float]) -> list[str]:
    said = []
    if misfits:
        said.append(
            f"The misfit is larger than the noise of the sensors: "
            f"{', '.join(f'{name} {times:.2g} times' for name, times in misfits.items())}. The block did not move as "
            "in the model, or a sensor drifts: do not use the parameters before you know why (see the figure)."
        )
    return said + [
        f"The table moves as the record begins, at {float(one.motion.acceleration[0]):.3g} m/s2. The block is taken to "
        "be at rest there. If it slides, the results are wrong: let the record begin where both are at rest."
        for one in found.observations
        if _moves(one)
    ]


def _misfits(found: Estimate) -> dict[str, float]:
    """Channels whose misfit is larger than their noise, as neighbouring samples scatter, and how many times."""
    worse: dict[str, float] = {}
    for one, linear in zip(found.observations, found.linears, strict=True):
        values, _ = linear.nuisances(found.parameters)
        rest = linear.raw(found.parameters) - (linear.left * linear.sizes) @ (linear.right @ values)
        at = 0
        for name, (_, use, weight) in zip(one.use, linear.columns, strict=True):
            part = rest[at : at + int(use.sum())] / weight
            at += part.size
            misfit = float(np.sqrt(np.mean(part**2)))
            measured = one.test.channels[name]
            noise = one.given_noise.get(name, max(noise_of(measured), one.least_noise[name]))
            if misfit > _WORSE * noise and misfit > _MISSES * float(np.nanmax(np.abs(measured))):
                worse[name] = max(misfit / noise, worse.get(name, 0.0))
    return worse


def _contradiction(found: Estimate) -> list[str]:
    """A lower bound of Üy that is larger than the accelerations at which the block was seen to begin to slide."""
    said = []
    for one in found.observations:
        if "block_acceleration" not in one.test.channels:
            continue
        times, block = one.test.times, one.test.channels["block_acceleration"]
        table = np.interp(times, one.motion.times, one.motion.acceleration)
        threshold = threshold_of(one.test)[0]
        slides = slides_of(times, table, block, threshold)
        if "continuous" in found.readings or not slides:
            continue
        onsets = np.array([onset_acceleration(times, table, block, slide, threshold) for slide in slides])
        step = float(np.abs(np.diff(table)).max())
        most = float(np.median(onsets)) + step + threshold + 3.0 * float(np.std(onsets)) / len(onsets) ** 0.5
        if found.intervals[0][0] > most:
            said.append(
                f"Üy is at least {found.intervals[0][0]:.3g} m/s2 by the fit, but the block was seen to begin to slide "
                f"at {float(np.median(onsets)):.3g} m/s2: the fit contradicts the test."
            )
    return said


def _upslope_sentences(episodes: Sequence[Sequence[tuple[float, float]]]) -> list[str]:
    return [
        f"The block slipped upslope {len(times)} time{'s' if len(times) > 1 else ''} (first at {times[0][0]:.3g} s). "
        "In stick-slip the model has no upslope slip: these samples are left out, and the displacement may step there."
        for times in episodes
        if times
    ]


# ------------------------------------------------------------------------------- determination


def _undetermined(found: Estimate, known: NDArray[np.bool_]) -> list[str]:
    """Which parameters the tests do not determine, why, and which measurement would."""
    tests = "these tests" if len(found.observations) > 1 else "this test"
    names = [SYMBOL[at] for at in range(3) if not known[at]]
    listed = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    ranges = "; ".join(f"{SYMBOL[at]} {_range(found.intervals[at], at)}" for at in range(3) if not known[at])
    said = [f"{listed} {'is' if len(names) == 1 else 'are'} not determined by {tests}: {ranges}."]
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
    return text + _unit(at)


def _unit(at: int) -> str:
    return " m/s2" if PARAMETERS[SOUGHT[at]]["units"] == "m s-2" else ""


def _remedy(found: Estimate) -> str:
    """The measurement that would tell allowed parameters apart: the amplitude at which displacements differ most."""
    one = found.observations[0]
    if all("block_acceleration" not in each.test.channels for each in found.observations):
        return (
            "Measure the acceleration of the block, or test at another amplitude and give calibrate all tests together."
        )
    every = found.allowed[np.unique(np.linspace(0, len(found.allowed) - 1, _COMPARED).astype(int))]
    ends = [found.allowed[number] for at in range(3) for number in np.argsort(found.allowed[:, at])[[0, -1]]]
    cases = {
        name: xr.DataArray(column, dims="case")
        for name, column in zip(SOUGHT, np.vstack([every, *ends]).T, strict=True)
    }
    moved = abs(found.summary(one, scale=list(_FACTORS), **cases)["permanent_displacement"])
    span = float(np.abs(found.summary(one)["permanent_displacement"]))
    low, high = moved.min(dim="case").values, moved.max(dim="case").values
    if not np.isfinite(high).any():
        return "Test at another amplitude and give calibrate all tests together."
    best = int(np.nanargmax((high - low) / (np.sqrt(low * high) + 0.05 * span)))
    return (
        f"Test at another amplitude and give calibrate all tests together: at {_FACTORS[best]:g} times this one "
        f"({_FACTORS[best] * one.peak:.3g} m/s2) the parameters that fit give displacements from {low[best]:.2g} to "
        f"{high[best]:.2g} m."
    )


def _inseparable(found: Estimate) -> list[str]:
    """Pairs that the tests cannot tell apart."""
    sizes = np.sqrt(np.diag(found.covariance))
    correlation = found.covariance / np.outer(sizes, sizes)
    loose = sizes > _LOOSE * np.maximum(np.abs(found.parameters), 1e-12)
    return [
        f"{SYMBOL[i]} and {SYMBOL[j]} cannot be separated: their correlation is {correlation[i, j]:.3f}."
        for i, j in ((1, 2), (0, 1), (0, 2))
        if abs(correlation[i, j]) >= _CORRELATED and (loose[i] or loose[j])
    ]


# ------------------------------------------------------------------------------------- tables


def _model_table(found: Estimate, known: NDArray[np.bool_]) -> str:
    """The [model] table of a sweep file, with intervals in comments."""
    model = found.observations[0].model
    lines = ["[model]", 'friction = "mendez"', f'rise = "{model.rise}"', f'recoupling = "{model.recoupling}"']
    for at, name in enumerate(SOUGHT):
        low, high = found.intervals[at]
        about = f"95 %: {low:.4g} to {high:.4g}{_unit(at)}" if known[at] else "not determined"
        lines.append(f"{name} = {_number(found.parameters[at])}  # {about}")
    return "\n".join([*lines, f"g = {model.g:g}"]) + "\n"


def _uncertainty_table(found: Estimate, errors: Floats, correlation: Floats) -> str:
    """[uncertainty] tables of a sweep file from the covariance: normal, cut where nothing physical lies; "" if none."""
    if not np.isfinite(errors).all():
        return ""
    lines = ["[uncertainty]"]
    # a hair less than 1, so that with rounding a matrix of correlations stays positive
    rounded = np.round(np.clip(correlation, -_MOST_CORRELATION, _MOST_CORRELATION), 4)
    whole = rounded + np.diag([1.0 - _MOST_CORRELATION] * 3)
    if np.linalg.eigvalsh(whole).min() > 1e-6:
        pairs = [f'["{SOUGHT[i]}", "{SOUGHT[j]}", {rounded[i, j]:.4f}]' for i, j in ((0, 1), (0, 2), (1, 2))]
        lines.append(f"correlation = [{', '.join(pairs)}]")
    for name, value, error in zip(SOUGHT, found.parameters, errors, strict=True):
        lines += ["", f"[uncertainty.{name}]", *_normal(value, error)]
    return "\n".join(lines) + "\n"


def _normal(value: float, error: float) -> list[str]:
    low = math.ceil(-1e4 * value / error) / 1e4
    cut = ['distribution = "truncnorm"', f"a = {low + 0.0:.4f}", "b = 8.0"]
    return [*(cut if low > -6.0 else ['distribution = "norm"']), f"loc = {_number(value)}", f"scale = {error:.4g}"]


def _newmark_tables(found: Estimate, coefficients: Coefficients) -> tuple[str, str]:
    """Newmark's block with the kinetic coefficient, for a block of constant friction."""
    one = found.observations[0]

    def onset(friction: float) -> float:
        return one.model.g * math.tan(math.atan(friction) - math.radians(one.theta))

    low, value, high = map(
        onset, (coefficients.kinetic_interval[0], coefficients.kinetic, coefficients.kinetic_interval[1])
    )
    model = (
        "# A block of constant friction: Newmark's model, with the kinetic coefficient "
        f"{coefficients.kinetic:.4g} at {one.theta:g} deg.\n"
        f'[model]\nfriction = "newmark"\nyield_acceleration = {_number(value)}  # 95 %: {low:.4g} to {high:.4g} m/s2\n'
        f"g = {one.model.g:g}\n"
    )
    lines = _normal(value, max((high - low) / 3.92, 1e-6 * value))
    return model, "\n".join(["[uncertainty]", "", "[uncertainty.yield_acceleration]", *lines]) + "\n"


def _as_comments(said: Sequence[str], table: str) -> str:
    """A table that must not be used as it is: the reasons, and each line commented out."""
    lines = ["WARNING: not ready for use.", *said, "", *table.splitlines()]
    return "\n".join(f"# {line}".rstrip() for line in lines) + "\n"


def sweep_file_text(model_table: str, uncertainty_table: str) -> str:
    """Both tables for one file: what [uncertainty] draws is a comment in [model]."""
    if not uncertainty_table:
        return model_table
    drawn = [f"{name} = " for name in SOUGHT if f"[uncertainty.{name}]" in uncertainty_table]
    lines = [
        f"# {line}; without [uncertainty]" if line.startswith(tuple(drawn)) else line
        for line in model_table.splitlines()
    ]
    return "\n".join(lines) + "\n\n" + uncertainty_table


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return text if "." in text or "e" in text else f"{text}.0"
