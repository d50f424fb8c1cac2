"""What a calibration says in words: what the test cannot tell and what would, and tables to paste into sweep files."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.model.variables import HISTORY, PARAMETERS, Validity
from slipsweep.motion.shaking import RESPONSES, TABLE
from slipsweep.studies.fitting import SOUGHT, Fit, Solution
from slipsweep.studies.forward import COLUMN, Forward
from slipsweep.studies.friction import noise_of

Floats = NDArray[np.float64]

SYMBOL = {"yield_acceleration": "Üy", "decay_rate": "λ", "delta_mu": "Δμ"}

#: A pair of parameters cannot be told apart from this correlation on if one is not known to `_LOOSE` of itself,
#: and in any case from the second on.
_CORRELATED, _ONE_AND_THE_SAME, _LOOSE = 0.95, 0.9995, 0.2

#: A parameter is not determined if half its interval is more than this part of it.
_UNDETERMINED = 0.5

#: Noise that a channel not measured is taken to have, in parts of its largest value.
_USUAL_NOISE = 0.02

#: Largest correlation that is written.
_MOST_CORRELATION = 0.9998

#: Standard errors by which residuals must drift for it to be told.
_DRIFTS = 5.0

#: Part of the table's largest acceleration beyond which it moves.
_MOVES = 0.1

#: How many times the noise, and which part of the largest value, a misfit must be to be told.
_WORSE, _MISSES = 1.5, 0.01

#: Part of the largest value that a drift or an offset must reach: noise of the table adds up to less.
_TELLS = 0.05


def findings(
    fit: Fit,
    solution: Solution,
    summary: xr.Dataset,
    intervals: Floats,
    episodes: Sequence[tuple[float, float]],
    drifting: Sequence[str] = (),
) -> list[str]:
    """What must be said of a calibration, a sentence or two each; `drifting` are channels whose drift explains it."""
    said = []
    flags = Validity(int(summary["validity"].item()))
    lost = [at for at in range(3) if not np.isfinite(solution.errors[at])]
    if episodes:
        said.append(
            f"The block slipped upslope {len(episodes)} time{'s' if len(episodes) > 1 else ''} (first at "
            f"{episodes[0][0]:.3g} s). In stick-slip the model has no upslope slip: these samples are left out, and "
            "the displacement may step there."
        )
    slips = int(summary["stick_slip_pulses"].item()) + int(summary["continuous_pulses"].item())
    if slips <= 0:
        said.append("The computed block does not slide: no parameter is determined. Test with a larger amplitude.")
    elif 1 in lost and 2 in lost:
        said.append(
            "λ and Δμ are not determined: Eq. 4 gives less than the yield acceleration in every cycle, so that the "
            "motion does not depend on them. Test with a larger amplitude or inclination."
        )
    elif 0 in lost:
        said.append(
            "Üy is not determined: by Eq. 4 the block sticks to the table until the table's acceleration has "
            "passed Üy. "
            f"Any Üy up to {solution.parameters[0]:.3g} m/s2 gives the same motion; {intervals[0][1]:.3g} m/s2 is the "
            "largest that the data allow. To measure Üy, shake with an amplitude that grows slowly until the block "
            "first slides."
        )
    said += _not_apart(fit, solution, intervals, lost)
    if flags & Validity.NOT_RECOUPLED:
        said.append("The computed block does not come to rest before the next slide begins (flag not_recoupled).")
    if not _moves(fit, 0):
        said += _drifting(fit, solution, drifting)
    return [*_misfit(fit, solution, drifting), *said]


def _moves(fit: Fit, end: int) -> bool:
    """Whether the table moves already as the record begins (0), or still as it ends (-1)."""
    smooth = fit.motion.acceleration
    return abs(float(smooth[end])) > max(_MOVES * float(np.abs(smooth).max()), 3.0 * fit.motion.noise)


def _misfit(fit: Fit, solution: Solution, drifting: Sequence[str]) -> list[str]:
    """Why the results may not be relied on: the block does not do what is computed."""
    said = []
    if _moves(fit, 0):
        said.append(
            f"The table moves as the record begins, at {float(fit.motion.acceleration[0]):.3g} m/s2. The block is "
            "taken to be at rest there. If it slides, the results are wrong: let the record begin where both are at "
            "rest."
        )
    if worse := misfits(fit, solution):
        said.append(
            "The misfit is larger than the noise of the sensors: "
            f"{', '.join(f'{name} {times:.2g} times' for name, times in worse.items())}. The block did not move as "
            "in the model, or a sensor drifts: check the figure (-o FIGURE.png) before you use the results."
        )
        said += [
            f"With a drift of {name} taken out, the misfit is that of the sensors' noise: give drift = {name!r}."
            for name in drifting
        ]
    return said


def misfits(fit: Fit, solution: Solution) -> dict[str, float]:
    """Channels whose misfit is larger than their noise, as neighbouring samples scatter, and how many times."""
    history = fit.computed(solution.parameters, solution.wrong)
    rows = [int(fit.use[name].sum()) for name in fit.channels]
    added = np.zeros(sum(rows))
    for value, line in zip(solution.nuisances[fit.motion.shapes.shape[1] :], fit.lines, strict=True):
        added = added + value * fit.of_line(line)
    found = {}
    for name, lines in zip(fit.channels, np.split(added, np.cumsum(rows)[:-1]), strict=True):
        values, use = fit.test.channels[name], fit.use[name]
        rest = (values - history[:, COLUMN[name]])[use] - lines * fit.noise[name]
        misfit = float(np.sqrt(np.mean(rest**2))) if rest.size else 0.0
        noise = max(noise_of(values[use]), fit.least_noise(name))
        if misfit > _WORSE * noise and misfit > _MISSES * float(np.nanmax(np.abs(values))):
            found[name] = misfit / noise
    return found


def _not_apart(fit: Fit, solution: Solution, intervals: Floats, lost: Sequence[int]) -> list[str]:
    """Pairs that the test cannot tell apart, and parameters that it does not determine."""
    errors, parameters = solution.errors, solution.parameters
    loose = [
        at not in lost and (intervals[at][1] - intervals[at][0]) > 2.0 * _UNDETERMINED * abs(parameters[at])
        for at in range(3)
    ]
    said, named = [], set()
    for i, j in ((1, 2), (0, 1), (0, 2)):
        if i in lost or j in lost:
            continue
        correlation = solution.covariance[i, j] / (errors[i] * errors[j]) if errors[i] * errors[j] > 0.0 else 0.0
        vague = max(errors[at] / max(abs(parameters[at]), 1e-12) for at in (i, j)) > _LOOSE
        if abs(correlation) >= _ONE_AND_THE_SAME or (abs(correlation) >= _CORRELATED and vague):
            one, other = SYMBOL[SOUGHT[i]], SYMBOL[SOUGHT[j]]
            text = f"{one} and {other} cannot be separated by this test: their correlation is {correlation:.3f}."
            if (i, j) == (1, 2):
                known = _at_the_peak(fit, solution)
                text += f" What is known is the friction at the peak of the table's acceleration, {known}."
            said.append(f"{text} {_remedy(fit, solution, (i, j))}")
            named |= {i, j}
    for at in range(3):
        if loose[at] and at not in named:
            low, high = intervals[at]
            end = f"{high:.3g}" if math.isfinite(high) else "any value"
            said.append(
                f"{SYMBOL[SOUGHT[at]]} is poorly determined by this test: from {low:.3g} to {end}"
                f"{_unit(at)}. {_remedy(fit, solution, (at,))}"
            )
    return said


def _unit(at: int) -> str:
    return " m/s2" if PARAMETERS[SOUGHT[at]]["units"] == "m s-2" else ""


def _at_the_peak(fit: Fit, solution: Solution) -> str:
    """(μs + Δμ) exp(−λA/g) with its standard error."""
    peak, g = float(fit.motion.acceleration.max()), fit.forward.model.g
    _, decay, excess = solution.parameters
    value = (fit.forward.mu_s + excess) * math.exp(-decay * peak / g)
    slopes = np.array([0.0, -value * peak / g, value / (fit.forward.mu_s + excess)])
    known = np.where(np.isfinite(solution.covariance), solution.covariance, 0.0)
    return f"{value:.3f} ± {math.sqrt(max(float(slopes @ known @ slopes), 0.0)):.2g}"


def _remedy(fit: Fit, solution: Solution, places: Sequence[int]) -> str:
    """Which measurement would tell: the errors with each channel that is missing, at the usual noise."""
    history = fit.computed(solution.parameters, solution.wrong)
    best, name = solution.errors[list(places)], ""
    for channel in (one for one in RESPONSES if one not in fit.test.channels):
        values = history[:, COLUMN[channel]]
        test = replace(fit.test, channels={**fit.test.channels, channel: values})
        noise = {**fit.noise, channel: _USUAL_NOISE * float(np.abs(values).max()) or 1.0}
        clear = np.ones(values.size, dtype=bool)
        clear[-1] = False
        if channel == "block_acceleration":
            clear &= ~fit.beside(fit.jumps(solution.parameters, solution.wrong))
        more = Fit(test, fit.motion, fit.forward, {**fit.use, channel: clear}, fit.lines, fit.table_lines, noise=noise)
        errors = Solution.of(more, solution.parameters, solution.wrong, solution.shapes).errors[list(places)]
        if errors[0] < 0.5 * best[0]:
            best, name = errors, channel
    if not name:
        return (
            "No other sensor would improve this. A test in which the amplitude grows slowly, or tests at several "
            "amplitudes, would."
        )
    become = " and ".join(
        f"of {SYMBOL[SOUGHT[at]]} from {before:.2g} to {after:.2g}"
        for at, before, after in zip(places, solution.errors[list(places)], best, strict=True)
    )
    return (
        f"Measure the {HISTORY[name]['long_name']}: with {_USUAL_NOISE:.0%} noise it would bring the standard error "
        f"{become}."
    )


def _drifting(fit: Fit, solution: Solution, told: Sequence[str]) -> list[str]:
    """Channels whose residuals have an offset or a drift that was not asked for, but for those that are told of."""
    said = []
    lines = {one.name for one in fit.lines}
    history = fit.computed(solution.parameters, solution.wrong)
    since = fit.test.times - fit.test.times[0]
    table = np.interp(fit.test.times, fit.motion.times, fit.motion.acceleration)
    for name in fit.channels:
        if f"drift of {name}" in lines or name in told:
            continue
        use = fit.use[name]
        # at rest a sensor shows its own offset; in motion the model may be wrong as well
        rest = fit.test.channels[name] - history[:, COLUMN[name]]
        if use.sum() < 20:
            continue
        slope, start = np.polyfit(since[use], rest[use], 1)
        spread = float(np.std(rest[use] - (start + slope * since[use])))
        error = spread / math.sqrt(use.sum()) / max(float(np.std(since[use])), 1e-12)
        span = float(since[use][-1])
        most = float(np.nanmax(np.abs(fit.test.channels[name])))
        if abs(slope) > _DRIFTS * error and abs(slope) * span > _TELLS * most:
            said.append(
                f"The residual (measured - computed) of {name} drifts by {slope:.3g} {HISTORY[name]['units']} a "
                f"second: if its sensor drifts, give drift = {name!r}."
            )
        elif (
            abs(float(np.mean(rest[use]))) > _DRIFTS * spread / math.sqrt(use.sum())
            and abs(float(np.mean(rest[use]))) > _TELLS * most
            and f"offset of {name}" not in lines
        ):
            said.append(
                f"The residual (measured - computed) of {name} is {float(np.mean(rest[use])):.3g} "
                f"{HISTORY[name]['units']} on average: if its sensor has an offset, give offset = {name!r}."
            )
    at_rest = not (_moves(fit, 0) or _moves(fit, -1))  # a cycle cut in two has an average of its own
    if at_rest and not fit.table_lines and abs(float(np.mean(table))) > 0.02 * float(np.abs(table).max()):
        said.append(
            f"The table's acceleration is {float(np.mean(table)):.3g} m/s2 on average: if its sensor has an offset, "
            f"give offset = {TABLE!r}."
        )
    return said


# ------------------------------------------------------------------------------------- tables


def model_table(forward: Forward, solution: Solution, intervals: Floats) -> str:
    """The [model] table of a sweep file, with intervals in comments."""
    model = forward.model
    lines = ["[model]", 'friction = "mendez"', f'rise = "{model.rise}"', f'recoupling = "{model.recoupling}"']
    for at, name in enumerate(SOUGHT):
        low, high = intervals[at]
        known = np.isfinite(solution.errors[at])
        about = f"95 %: {low:.4g} to {high:.4g}{_unit(at)}" if known else "not determined by the test"
        lines.append(f"{name} = {_number(solution.parameters[at])}  # {about}")
    lines.append(f"g = {model.g:g}")
    return "\n".join(lines) + "\n"


def uncertainty_table(forward: Forward, solution: Solution, correlation: Floats) -> str:
    """[uncertainty] tables of a sweep file from the covariance: normal, cut where nothing physical lies; "" if none."""
    known = [at for at in range(3) if np.isfinite(solution.errors[at]) and solution.errors[at] > 0.0]
    if not known:
        return ""
    lines = ["[uncertainty]"]
    # a hair less than 1, so that with rounding a matrix of correlations stays positive
    rounded = np.round(np.clip(correlation, -_MOST_CORRELATION, _MOST_CORRELATION), 4)
    pairs = [(i, j) for i in known for j in known if i < j]
    whole = rounded[np.ix_(known, known)] + np.diag([1.0 - _MOST_CORRELATION] * len(known))
    if pairs and np.linalg.eigvalsh(whole).min() > 1e-6:
        texts = [f'["{SOUGHT[i]}", "{SOUGHT[j]}", {rounded[i, j]:.4f}]' for i, j in pairs]
        lines.append(f"correlation = [{', '.join(texts)}]")
    for at in known:
        value, error = solution.parameters[at], solution.errors[at]
        low = math.ceil(-1e4 * value / error) / 1e4
        lines += ["", f"[uncertainty.{SOUGHT[at]}]"]
        if low > -6.0:
            lines += ['distribution = "truncnorm"', f"a = {low + 0.0:.4f}", "b = 8.0"]
        else:
            lines.append('distribution = "norm"')
        lines += [f"loc = {_number(value)}", f"scale = {error:.4g}"]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return text if "." in text or "e" in text else f"{text}.0"
