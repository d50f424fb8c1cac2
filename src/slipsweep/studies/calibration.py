"""Calibration: Üy, λ and Δμ from a test on a shaking table, for the whole of it and cycle by cycle."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import plan_sweep
from slipsweep.model.options import MODELS, Mendez
from slipsweep.model.parameters import check_finite, check_single, shown
from slipsweep.motion.shaking import RESPONSES, TABLE, ShakingTest, check_channels
from slipsweep.studies.calibration_tables import LARGE, Cycle, intervals_of, table_of
from slipsweep.studies.findings import findings, misfits
from slipsweep.studies.fitting import SOUGHT, Fit, Line, Solution, Whitening
from slipsweep.studies.forward import COLUMN, Forward
from slipsweep.studies.friction import noise_of, onset_acceleration, slides_of, threshold_of
from slipsweep.studies.table_motion import TableMotion, table_motion

Floats = NDArray[np.float64]

#: Starts that are tried beside those that Eq. 1 gives: parts of the table's peak, λ, and parts of μs.
_START_ONSETS, _START_DECAYS, _START_EXCESS = (0.05, 0.15, 0.3, 0.5, 0.7), (1.0, 2.5, 5.0), (0.05, 0.25, 0.5)

#: Samples in turn, and standard deviations of the noise, by which a block slips upslope.
_UPSLOPE_SAMPLES, _UPSLOPE_NOISE = 4, 5.0

#: Rises of the sum of squares up to which a yield acceleration is as good as the best, and another reading of a test.
_SAME, _SAME_SQUARE = 1.0, 6.0

#: Starts that are followed in search of another reading, the part of Üy they have, and of the acceleration at the peak.
_OTHERS, _LOW, _TOPS = 3, 0.3, (1.0, 1.1, 1.25, 1.5)

#: Part of the largest acceleration that a pulse has at least to be a cycle.
_A_CYCLE = 0.1

#: Fewest samples of a cycle that is fitted by itself.
_FEWEST_IN_A_CYCLE = 12


def calibration_table(
    test: ShakingTest,
    theta: Any,
    mu_s: Any,
    *,
    model: Any = "mendez",
    offset: Any = (),
    drift: Any = (),
    noise: Mapping[str, float] | None = None,
    cycles: bool = True,
) -> xr.Dataset:
    """Calibration of a test; arguments, results and errors of `slipsweep.calibrate`."""
    theta, mu_s = check_single("theta", theta), check_single("mu_s", mu_s)
    chosen = MODELS.of(model)
    if not isinstance(chosen, Mendez):
        raise InputError(f"model = {chosen!r}: must be 'mendez': Newmark's block has no λ and no Δμ")
    if not test.responses:
        raise InputError(
            f"{test.name}: nothing of the block was measured: must have one at least of {', '.join(RESPONSES)}"
        )
    given_noise = _noise_given(noise, test)
    _check_contact(test, theta, chosen.g)
    offsets, drifts = check_channels("offset", offset, test.channels), check_channels("drift", drift, test.channels)
    motion, table_lines = _with_table_lines(table_motion(test.times, test.channels[TABLE]), test, offsets, drifts)
    fit = Fit(
        test,
        motion,
        Forward(theta, mu_s, chosen),
        _samples(test),
        lines=_lines(test, offsets, drifts),
        table_lines=table_lines,
        given_noise=given_noise,
    )
    starts = _starts(fit)
    solution = fit.solve(starts)
    fit = solution.fit
    summary = _summary(fit, solution)
    episodes: list[tuple[float, float]] = []
    if summary["continuous_pulses"].item() == 0:
        # continuous sliding goes both ways; stick-slip goes one
        episodes = _upslope(test)
    if episodes:
        fit = _without(fit, episodes)
        solution = fit.solve([solution.parameters, *starts])
        fit = solution.fit
        summary = _summary(fit, solution)
    if not np.isfinite(solution.errors[1:]).any():
        solution = _with_friction(fit, solution)
        fit = solution.fit
    profile = solution.profile()
    if (better := profile.better(solution.parameters)) is not None:
        # the search was caught where Üy does not matter, beside where it does
        other = replace(fit, use=_kept(fit), noise={}, given_noise=dict(fit.noise)).solve([better], near=True)
        if other.cost() < solution.cost() and np.isfinite(other.errors[1:]).all():
            solution, fit = other, other.fit
            profile = solution.profile()
    if not np.isfinite(solution.errors[0]):
        # all Üy up to there give the same motion: the largest is where the block was seen to slide
        same = profile.onsets[profile.above <= _SAME]
        solution = replace(solution, parameters=np.array([same.max(), *solution.parameters[1:]]))
    summary = _summary(fit, solution)
    own = _cycles(fit, solution) if cycles else []
    intervals = intervals_of(solution, profile)
    notes = findings(fit, solution, summary, intervals, episodes, _drifting(fit, solution, starts))
    return table_of(fit, solution, intervals, summary, own, notes)


def _drifting(fit: Fit, solution: Solution, starts: Sequence[Floats]) -> list[str]:
    """Channels of which a drift, that was not asked for, would explain a misfit."""
    known = {one.name for one in fit.lines}
    found = []
    for name in fit.test.responses if misfits(fit, solution) else ():
        if f"drift of {name}" in known:
            continue
        lines = [*fit.lines, *(one for one in _lines(fit.test, (), [name]) if one.name not in known)]
        other = Fit(fit.test, fit.motion, fit.forward, _kept(fit), lines, fit.table_lines, scans=False).solve(starts)
        if not misfits(other.fit, other):
            found.append(name)
    return found


def _with_friction(fit: Fit, solution: Solution) -> Solution:
    """Another solution, in which friction plays a part, if it fits as well: a large Üy is but one reading."""
    forward, g = fit.forward, fit.forward.model.g
    held, peak = float(solution.parameters[0]), float(fit.motion.acceleration.max())
    tan_theta = math.tan(math.radians(forward.theta))
    # Eq. 7: a smaller Üy would have the block slide continuously
    least = peak * (1.0 - tan_theta * (forward.mu_s - tan_theta)) - g * forward.mu_s
    onset = max(_LOW * held, least + _LOW * (held - least))
    starts = []
    for decay in _START_DECAYS:
        for top in _TOPS:
            # Eq. 4 at the peak has the block's acceleration there a little above what was held throughout
            behind = peak - min(top * held, peak)
            friction = (g * forward.mu_s + peak * tan_theta * (forward.mu_s - tan_theta) - behind) / (
                g + peak * tan_theta
            )
            excess = friction * math.exp(decay * peak / g) - forward.mu_s
            if excess >= 0.0:
                starts.append(np.array([onset, decay, excess]))
    whiten = Whitening.of(fit.effects(solution.shapes))
    effects = fit.effects(solution.shapes)

    def square(start: Floats) -> float:
        return float(np.sum(whiten(fit.residuals(start, solution.wrong, effects)) ** 2))

    best = solution
    for start in sorted(starts, key=square)[:_OTHERS]:
        other = Fit(
            fit.test, fit.motion, forward, _kept(fit), fit.lines, fit.table_lines, given_noise=dict(fit.noise),
            scans=False,
        ).solve([start])  # fmt: skip
        alive = bool(np.isfinite(other.errors[1:]).all())
        if alive and other.cost() < best.cost() + (_SAME_SQUARE if best is solution else 0.0):
            best = other
    return best


def _kept(fit: Fit) -> dict[str, NDArray[np.bool_]]:
    """The samples that a fit uses, with those beside jumps, which are others for another solution."""
    use = dict(fit.use)
    if "block_acceleration" in use:
        use["block_acceleration"] = _samples(fit.test)["block_acceleration"]
    return use


# -------------------------------------------------------------------------------- what is asked


def _noise_given(noise: Mapping[str, float] | None, test: ShakingTest) -> dict[str, float]:
    if noise is None:
        return {}
    if not isinstance(noise, Mapping):
        raise InputError(f"noise = {shown(noise)}: must be a mapping of channels to standard deviations")
    check_channels("noise", list(noise), test.responses)
    found = {name: check_finite(f"noise.{name}", value) for name, value in noise.items()}
    for name, value in found.items():
        if value <= 0.0:
            raise InputError(f"noise.{name} = {shown(value)}: must be a finite number > 0")
    return found


def _check_contact(test: ShakingTest, theta: float, g: float) -> None:
    table, tan_theta = test.channels[TABLE], math.tan(math.radians(theta))
    if g + float(table.min()) * tan_theta <= 0.0:
        raise InputError(
            f"{test.name}: {TABLE} = {table.min():.4g} m/s2: the block would lift off (g + Üg tan θ must be > 0); are "
            "its units right?"
        )
    if not float(table.max()) > 0.0:
        raise InputError(f"{test.name}: {TABLE}: never positive: the table does not drive the block downslope")


def _samples(test: ShakingTest) -> dict[str, NDArray[np.bool_]]:
    """Samples that are there; not the last, at which a record ends."""
    inside = np.arange(test.times.size) < test.times.size - 1
    return {name: inside & np.isfinite(test.channels[name]) for name in test.responses}


def _with_table_lines(
    motion: TableMotion, test: ShakingTest, offsets: Sequence[str], drifts: Sequence[str]
) -> tuple[TableMotion, tuple[str, ...]]:
    """The table's motion with its own offset and drift among what may be wrong."""
    peak = float(np.abs(test.channels[TABLE]).max())
    span = test.times[-1] - test.times[0]
    names = []
    if TABLE in offsets or TABLE in drifts:
        motion = motion.with_line(-np.ones(motion.times.size), LARGE * peak)
        names.append(f"offset of {TABLE}")
    if TABLE in drifts:
        motion = motion.with_line(-(motion.times - test.times[0]) / span, LARGE * peak)
        names.append(f"drift of {TABLE}")
    return motion, tuple(names)


def _lines(test: ShakingTest, offsets: Sequence[str], drifts: Sequence[str]) -> list[Line]:
    """Offsets and drifts of the block's sensors."""
    since = (test.times - test.times[0]) / (test.times[-1] - test.times[0])
    lines = []
    for name in test.responses:
        size = LARGE * float(np.nanmax(np.abs(test.channels[name])))
        if name in offsets or name in drifts:
            lines.append(Line(f"offset of {name}", {name: np.ones(since.size)}, size))
        if name in drifts:
            lines.append(Line(f"drift of {name}", {name: since}, size))
    return lines


# ------------------------------------------------------------------------------------- starts


def _starts(fit: Fit) -> list[Floats]:
    """Where to look from: what Eq. 1 gives on the accelerations, and a coarse grid."""
    test, peak, mu_s = fit.test, float(fit.test.channels[TABLE].max()), fit.forward.mu_s
    starts = [
        np.array([onset * peak, decay, excess * mu_s])
        for onset in _START_ONSETS
        for decay in _START_DECAYS
        for excess in _START_EXCESS
    ]
    block = _block_acceleration(test)
    if block is not None:
        starts += _regressed(fit, block)
    return starts


def _block_acceleration(test: ShakingTest) -> Floats | None:
    """The block's acceleration, measured or from the relative velocity."""
    if "block_acceleration" in test.channels:
        return test.channels["block_acceleration"]
    if "relative_velocity" in test.channels:
        return np.asarray(test.channels[TABLE] - np.gradient(test.channels["relative_velocity"], test.times))
    return None


def _regressed(fit: Fit, block: Floats) -> list[Floats]:
    """Onsets, and a straight line through ln μ over |Üg|/g while the block slides and Üg rises."""
    test, forward = fit.test, fit.forward
    smooth = np.interp(test.times, fit.motion.times, fit.motion.acceleration)
    threshold = threshold_of(replace(test, channels={TABLE: smooth, "block_acceleration": block}))[0]
    slides = slides_of(test.times, smooth, block, threshold)
    if not slides:
        return []
    onsets = [onset_acceleration(test.times, smooth, block, one, threshold) for one in slides]
    onset = max(float(np.median(onsets)), 0.02 * float(smooth.max()))
    tan_theta, g = math.tan(math.radians(forward.theta)), forward.model.g
    friction = forward.mu_s - tan_theta - (np.abs(smooth) - np.abs(block) - g * tan_theta) / (g + smooth * tan_theta)
    rising = (np.gradient(smooth, test.times) > 0.0) & (smooth > onset) & (friction > 0.02 * forward.mu_s)
    sliding = np.zeros(test.times.size, dtype=bool)
    for one in slides:
        sliding[one.part] = True
    starts = []
    # near the onset the yield value may govern, and Eq. 4 only above
    for above in (onset, 0.5 * (onset + float(smooth.max()))):
        use = rising & sliding & (smooth > above) & np.isfinite(friction)
        if use.sum() < 4:
            continue
        slope, start = np.polyfit(smooth[use] / g, np.log(friction[use]), 1)
        found = np.array([onset, -slope, math.exp(start) - forward.mu_s])
        starts.append(np.maximum(found, [onset, 0.05, 1e-3]))
    return starts


# ------------------------------------------------------------------------------ upslope slips


def _upslope(test: ShakingTest) -> list[tuple[float, float]]:
    """From when to when the block slips upslope, which stick-slip does not have."""
    times, wrong = test.times, np.zeros(test.times.size, dtype=bool)
    if "relative_velocity" in test.channels:
        velocity = test.channels["relative_velocity"]
        wrong |= velocity < -_UPSLOPE_NOISE * max(noise_of(velocity), 1e-3 * float(np.nanmax(np.abs(velocity))))
    elif "block_acceleration" in test.channels:
        table, block = test.channels[TABLE], test.channels["block_acceleration"]
        for one in slides_of(times, table, block, threshold_of(test)[0]):
            part = slice(one.onset, one.onset + _UPSLOPE_SAMPLES)
            wrong[one.part] |= bool(np.nanmean((table - block)[part]) < 0.0 and np.mean(table[part]) < 0.0)
    else:
        displacement = test.channels["relative_displacement"]
        back = np.full(times.size, 0.0)
        back[:-10] = displacement[10:] - displacement[:-10]
        wrong |= back < -1.5 * _UPSLOPE_NOISE * max(
            noise_of(displacement), 1e-3 * float(np.nanmax(np.abs(displacement)))
        )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong, [False]]).astype(int)))
    episodes: list[tuple[float, float]] = []
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if after - first < _UPSLOPE_SAMPLES:
            continue
        begin, end = float(times[max(first - 3, 0)]), float(times[min(after + 3, times.size - 1)])
        if episodes and begin <= episodes[-1][1]:
            episodes[-1] = episodes[-1][0], end
        else:
            episodes.append((begin, end))
    return episodes


def _without(fit: Fit, episodes: Sequence[tuple[float, float]]) -> Fit:
    """The fit without the samples of upslope slips, after each of which the displacement may have stepped."""
    times, use = fit.test.times, _samples(fit.test)
    lines = list(fit.lines)
    for begin, end in episodes:
        for name in use:
            use[name] = use[name] & ~((times >= begin) & (times <= end))
        if "relative_displacement" in use:
            size = LARGE * float(np.nanmax(np.abs(fit.test.channels["relative_displacement"])))
            step = {"relative_displacement": (times > end).astype(float)}
            lines.append(Line(f"upslope slip at {begin:.4g} s", step, size))
    return Fit(fit.test, fit.motion, fit.forward, use, lines, fit.table_lines, given_noise=fit.given_noise)


# ------------------------------------------------------------------------------------- cycles


def _windows(motion: TableMotion, onset: float) -> list[tuple[float, float, float]]:
    """Cycles of the table's motion in which it exceeds Üy: begin (a rise through zero), end, and peak."""
    above = np.concatenate([[False], motion.acceleration > 0.0, [False]])
    edges = np.flatnonzero(np.diff(above.astype(int)))
    pulses = [
        (float(motion.times[first]), float(motion.acceleration[first:after].max()))
        for first, after in zip(edges[::2], edges[1::2], strict=True)
    ]
    least = max(onset, _A_CYCLE * float(motion.acceleration.max()))
    pulses = [(begin, peak) for begin, peak in pulses if peak > least]
    ends = [begin for begin, _ in pulses[1:]] + [float(motion.times[-1])]
    return [(begin, end, peak) for (begin, peak), end in zip(pulses, ends, strict=True)]


def _cycles(fit: Fit, solution: Solution) -> list[Cycle]:
    """Each cycle by itself, from where the whole test's block stands as it begins."""
    test, times = fit.test, fit.test.times
    limit = _limit(fit, solution.parameters)
    whole = fit.computed(solution.parameters, solution.wrong)
    found = []
    for begin, end, peak in _windows(fit.motion, float(solution.parameters[0])):
        inside = (times >= begin) & (times < end)
        since = np.where(inside, times - begin, 0.0)
        use = {name: fit.use[name] & inside for name in fit.use}
        first = int(np.argmax(inside))
        continuous = peak > limit
        nothing = np.full(3, np.nan)
        if sum(int(one.sum()) for one in use.values()) < _FEWEST_IN_A_CYCLE or not inside.any():
            found.append(Cycle(begin, peak, continuous, nothing, nothing, math.nan))
            continue
        lines = list(fit.lines)
        # what the cycles before have left: a displacement, and a velocity where the block is not at rest
        size = {name: LARGE * float(np.nanmax(np.abs(test.channels[name]))) for name in test.responses}
        if "relative_displacement" in use:
            lines.append(Line("start", {"relative_displacement": np.ones(times.size)}, size["relative_displacement"]))
        if whole[first, COLUMN["relative_velocity"]] != 0.0:
            parts = {"relative_velocity": np.ones(times.size), "relative_displacement": since}
            parts = {name: part for name, part in parts.items() if name in use}
            most = max(size.get("relative_velocity", 0.0), size.get("relative_displacement", 0.0))
            if parts:
                lines.append(Line("initial velocity", parts, most))
        unknown = [at for at in range(3) if not np.isfinite(solution.errors[at])]
        fixed = tuple({*unknown, 0} if continuous else unknown)
        own = Fit(
            test, fit.motion, fit.forward, use, lines, fit.table_lines, fixed, given_noise=dict(fit.noise), scans=False
        )
        part = own.solve([solution.parameters], solution.shapes)
        estimate, errors = part.parameters.copy(), part.errors
        lost = np.array([at in fixed or not np.isfinite(errors[at]) for at in range(3)])
        block = fit.computed(part.parameters, solution.wrong)
        slides = inside & (block[:, COLUMN[TABLE]] > 0.0)
        top = float(block[slides, COLUMN["block_acceleration"]].max()) if slides.any() else math.nan
        attenuation = math.nan if continuous else top / fit.forward.model.g
        found.append(
            Cycle(
                begin,
                peak,
                continuous,
                np.where(lost, np.nan, estimate),
                np.where(lost, np.nan, errors),
                attenuation,
            )
        )
    return found


def _limit(fit: Fit, parameters: Floats) -> float:
    """Üg,lim by Eq. 7."""
    from slipsweep.grid.plans import plan_friction_parameters

    inputs = Inputs(
        theta=fit.forward.theta, mu_s=fit.forward.mu_s, amplitude=1.0, yield_acceleration=float(parameters[0]),
        decay_rate=float(parameters[1]), delta_mu=float(parameters[2]),
    )  # fmt: skip
    plan = plan_friction_parameters(inputs, model=fit.forward.model)
    return float(plan.solve()["limiting_acceleration"].item())


def _summary(fit: Fit, solution: Solution) -> xr.Dataset:
    """The results of a sweep for what was found."""
    given = dict(zip(SOUGHT, map(float, solution.parameters), strict=True))
    plan = plan_sweep(
        Inputs(theta=fit.forward.theta, mu_s=fit.forward.mu_s, **given),
        excitation=fit.motion.record(solution.wrong),
        model=fit.forward.model,
    )
    return plan.solve()
