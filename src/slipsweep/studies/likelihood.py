"""One test as a likelihood: measured less computed channels, with the errors of the table's motion and of sensors.

Beside Üy, λ and Δμ stand nuisance parameters with known standard deviations: errors of the table's
motion (`table_motion`), offsets and drifts of sensors.  What is computed depends on them linearly,
near enough, so that they need no search: scaled residuals have the covariance 1 + E Eᵀ, E being the
effects of one standard deviation of each, and are made independent by it.  Which samples count
less, and why the table's motion is a spline: docs/calibration.md.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.linalg import cholesky, solve_triangular

from slipsweep.errors import InputError
from slipsweep.grid.inputs import Problem
from slipsweep.grid.solvers import options_of
from slipsweep.kernels.block import Cell
from slipsweep.kernels.history import History, fill_history
from slipsweep.model.options import Cycle, Mendez
from slipsweep.model.variables import HISTORY
from slipsweep.motion.cutting import path_of_record
from slipsweep.motion.records import Record
from slipsweep.motion.shaking import RESPONSES, TABLE, ShakingTest, check_channels
from slipsweep.studies.friction import Floats, check_contact, noise_of

#: The series of `HISTORY` at some times, for Üy, λ and Δμ.
Forward = Callable[[Floats, Floats], Mapping[str, Floats]]

#: What is sought, in the order of all vectors.
SOUGHT = ("yield_acceleration", "decay_rate", "delta_mu")

#: In parts of a channel's largest value: the least noise that it is taken to have, the noise of a
#: rough likelihood, and the standard deviation of an offset, drift or step: no bound, in effect.
_LEAST_NOISE = 1e-5
_ROUGH_NOISE = 0.1
_LARGE = 3.0

#: Intervals of sampling to either side of a jump that are left out; consecutive samples, and
#: standard deviations of the noise, by which a block slips upslope.
_BESIDE_A_JUMP = 1.6
_UPSLOPE_SAMPLES = 4
_UPSLOPE_NOISE = 5.0

#: Degree of the table's spline, and most coefficients whose uncertainty is followed; each costs a
#: solution.
_DEGREE = 3
_MOST_SHAPES = 150

#: Samples for each coefficient that are tried, and by how many of these spacings the knots are
#: closer than the criterion says: what a spline cannot follow is no noise, and enters no interval.
_SPACINGS = (64, 48, 32, 24, 16, 12, 10, 8, 6, 5, 4, 3, 2)
_FINER = 2

#: Multiples of the noise beyond which the table moves, and samples before that where a kink is
#: tried.
_MOVES = 5.0
_KINK_SAMPLES = 12


class Line(NamedTuple):
    """An offset, a drift or a step of a channel's sensor: its standard deviation, and what that adds at the samples."""

    name: str
    channel: str
    deviation: float
    values: Floats


class Linear:
    """Residuals of parameters and of nuisance parameters, on which what is computed depends linearly.

    `computed` gives samples for parameters, in standard deviations, to be compared with those
    `measured`; `effects` are those of one standard deviation of each nuisance parameter on them.
    """

    def __init__(
        self, computed: Callable[[Floats], Floats], measured: Floats, effects: Floats
    ) -> None:
        self.computed = computed
        self.measured = measured
        self.left, self.sizes, self.right = np.linalg.svd(effects, full_matrices=False)
        self.known = self.sizes**2 / (1.0 + self.sizes**2)
        self._shrunk = self.left * (1.0 - 1.0 / np.sqrt(1.0 + self.sizes**2))

    def __call__(self, parameters: Floats) -> Floats:
        """Independent residuals of unit variance, if the model and the noise are right."""
        rest = self._raw(parameters)
        return np.asarray(rest - self._shrunk @ (self.left.T @ rest))

    def _raw(self, parameters: Floats) -> Floats:
        return np.nan_to_num(
            self.measured - self.computed(parameters), nan=1e3, posinf=1e3, neginf=1e3
        )

    def nuisances(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Most likely values of the nuisance parameters and their standard deviations, in those of their priors."""
        along = self.left.T @ self._raw(parameters)
        values = self.right.T @ (self.sizes / (1.0 + self.sizes**2) * along)
        spread = 1.0 - np.sum(self.right**2 * self.known[:, None], axis=0)
        return np.asarray(values), np.sqrt(np.maximum(spread, 0.0))

    def unexplained(self, parameters: Floats) -> Floats:
        """What the most likely nuisance parameters leave."""
        explained = (self.left * self.sizes) @ (self.right @ self.nuisances(parameters)[0])
        return np.asarray(self._raw(parameters) - explained)


class Observation:
    """A test and what is known of its sensors, checked, and the likelihood that it gives.

    `channels` of the block have the noise `sensor_noise` as neighbouring samples scatter, or as
    given.  `drifts` may drift: those given and `drifting`.  `lines` are offsets, drifts and steps,
    those of the table first; `wrong` the most likely errors of the table's motion and its lines, in
    standard deviations; `upslope` the times at which slips begin that are left out.  `forward` and
    `linear` are the model and the likelihood near the last solution.
    """

    def __init__(
        self,
        test: ShakingTest,
        theta: float,
        mu_s: float,
        model: Mendez,
        offset: Any,
        drift: Any,
        noise: Mapping[str, float],
        drifting: Sequence[str] = (),
    ) -> None:
        if not test.responses:
            raise InputError(
                f"{test.name}: nothing of the block was measured: must have one at least of {', '.join(RESPONSES)}"
            )
        check_channels("noise", list(noise), test.responses)
        check_contact(test, theta, model.g)
        if not float(test.channels[TABLE].max()) > 0.0:
            raise InputError(
                f"{test.name}: {TABLE}: never positive: the table does not drive the block downslope"
            )
        offsets = check_channels("offset", offset, test.channels)
        self.drifts = (*check_channels("drift", drift, test.channels), *drifting)
        self.test = test
        self.theta = theta
        self.mu_s = mu_s
        self.model = model
        self.channels = test.responses
        measured = np.array([test.channels[name] for name in self.channels])
        # the last sample is that at which a record ends
        self._use = np.isfinite(measured) & (np.arange(test.times.size) < test.times.size - 1)
        self._beside_jumps = np.zeros_like(self._use)
        self._weights = np.array([_weights_of(values) for values in measured])
        self.largest = np.nanmax(np.abs(measured), axis=1)
        converters = [max(converter_noise(values), 1e-15) for values in measured]
        self._least_noise = np.maximum(_LEAST_NOISE * self.largest, converters)
        self._given_noise = np.array([noise.get(name, np.nan) for name in self.channels])
        scatter = np.maximum([noise_of(values) for values in measured], self._least_noise)
        self.sensor_noise = np.where(np.isnan(self._given_noise), scatter, self._given_noise)
        self._noise = self.sensor_noise.copy()
        self.lines: list[Line] = []
        since = (test.times - test.times[0]) / (test.times[-1] - test.times[0])
        for name, values in test.channels.items():
            size = _LARGE * float(np.nanmax(np.abs(values)))
            if name in offsets or name in self.drifts:
                self.lines.append(Line("offset", name, size, np.full(since.size, size)))
            if name in self.drifts:
                self.lines.append(Line("drift", name, size, size * since))
        self.motion = table_motion(test.times, test.channels[TABLE])
        self.peak = float(self.motion.acceleration.max())
        of_table = [
            np.interp(self.motion.times, test.times, one.values)
            for one in self.lines
            if one.channel == TABLE
        ]
        self._shapes = np.column_stack([self.motion.shapes, *(-line for line in of_table)])
        self.wrong = np.zeros(self._shapes.shape[1])
        self.upslope: list[float] = []

    def record(self, wrong: Floats | None = None) -> Record:
        """The table's motion as last estimated, or with so many standard deviations of each of its errors."""
        errors = self._shapes @ (self.wrong if wrong is None else wrong)
        return Record(self.motion.times, self.motion.acceleration + errors)

    def _forward(self, wrong: Floats | None = None) -> Forward:
        """The model's block on that motion of the table."""
        record = self.record(wrong)
        options = options_of(Problem(self.model, record, Cycle()), wants_peak=True)
        path = path_of_record.__wrapped__(record, 1.0)  # tried once: not kept in its cache

        def histories(parameters: Floats, times: Floats) -> dict[str, Floats]:
            onset, decay, drop = map(float, parameters)
            cell = Cell(
                math.tan(math.radians(self.theta)), self.mu_s, 1.0, onset, decay, drop, math.nan
            )
            table = np.empty((len(HISTORY), times.size))
            fill_history(cell, options, path, times, History(*table))
            return dict(zip(HISTORY, table, strict=True))

        return histories

    def _weighted(self, series: Mapping[str, Floats]) -> Floats:
        """The samples that count, channel by channel, in standard deviations; 0 of a channel that is not there."""
        none = np.zeros(self.test.times.size)
        weighted: Floats = (
            np.array([series.get(name, none) for name in self.channels])[self._counted]
            * self._scale
        )
        return weighted

    def _by_channel(self, values: Floats) -> list[Floats]:
        return np.split(values, np.cumsum(self._counted.sum(axis=1))[:-1])

    def linearize(self, parameters: Floats, rough: bool = False) -> None:
        """Set `linear` near a solution; `rough` as if the table's record had no noise, and the channels had much."""
        self.forward = self._forward()

        def computed(parameters: Floats, by: Forward = self.forward) -> Floats:
            return self._weighted(by(parameters, self.test.times))

        self._counted = self._use & ~self._beside_jumps
        noise = np.maximum(self._noise, _ROUGH_NOISE * self.largest * rough)
        self._scale = (self._weights / noise[:, None])[self._counted]
        base = computed(parameters)
        shapes = self.motion.shapes.shape[1]
        moving = self.wrong.size
        effects = np.zeros((base.size, shapes + len(self.lines)))
        for at in range(shapes if rough else 0, moving):
            moved = self.wrong.copy()
            moved[at] += (
                0.3 if at < shapes else 1e-3
            )  # steps of the derivatives, in standard deviations
            change = computed(parameters, self._forward(moved)) - base
            effects[:, at] = np.nan_to_num(change) / (moved[at] - self.wrong[at])
        for at, line in enumerate(self.lines[moving - shapes :], moving):
            effects[:, at] = self._weighted({line.channel: line.values})
        measured = self._weighted(self.test.channels) + effects[:, :moving] @ self.wrong
        self.linear = Linear(computed, measured, effects)

    def _unexplained(self, parameters: Floats) -> list[Floats]:
        """What nothing explains of the samples of each channel, in its own unit."""
        return self._by_channel(self.linear.unexplained(parameters) / self._scale)

    def misfits(self, parameters: Floats) -> list[float]:
        """Root mean square of what nothing explains of each channel."""
        return [float(np.sqrt(np.mean(rest**2))) for rest in self._unexplained(parameters)]

    def cycle(self, begin: float, end: float, speed: float) -> Linear:
        """The samples between two times; the motion at the beginning is unknown, velocities of the order of `speed`."""
        whole = self.linear
        times = self.test.times
        rows = (self._counted & (times >= begin) & (times < end))[self._counted]
        still = np.full(times.size, speed)
        moved = speed * (times - begin)
        place = self._weighted({"relative_displacement": still})
        velocity = self._weighted({"relative_displacement": moved, "relative_velocity": still})
        effects = np.column_stack([(whole.left * whole.sizes) @ whole.right, place, velocity])
        return Linear(
            lambda parameters: whole.computed(parameters)[rows], whole.measured[rows], effects[rows]
        )

    def settle(self, parameters: Floats) -> None:
        """Estimate the noise that is not given, take the table's motion as most likely, leave out samples at jumps."""
        leverage = self._by_channel(self.linear.left**2 @ self.linear.known)
        weights = self._by_channel(self._scale)
        rests = self._unexplained(parameters)
        for at, (rest, part) in enumerate(zip(rests, leverage, strict=True)):
            weight = weights[at] * self._noise[at]
            freedom = float(np.sum(weight**2)) - float(np.sum(part)) - 1.0
            if np.isnan(self._given_noise[at]) and freedom > 0.0:
                self._noise[at] = max(
                    np.sqrt(np.sum((rest * weight) ** 2) / freedom), self._least_noise[at]
                )
        self.wrong = self.linear.nuisances(parameters)[0][: self.wrong.size]
        if "block_acceleration" in self.channels:
            row = self.channels.index("block_acceleration")
            self._beside_jumps[row] = self._next_to_jumps(parameters, self._noise[row])

    def _next_to_jumps(self, parameters: Floats, noise: float) -> NDArray[np.bool_]:
        """Samples next to a jump of the block's computed acceleration: they tell on which side of it the jump lies."""
        times = self.test.times
        fine = np.interp(np.arange(0, times.size - 1, 0.125), np.arange(times.size), times)
        history = self._forward()(parameters, fine)
        block = history["block_acceleration"]
        table = history[TABLE]
        # either is smooth where the block holds its acceleration or sticks to the table
        change = np.minimum(np.abs(np.diff(block)), np.abs(np.diff(block - table)))
        least = max(noise, 0.02 * float(np.abs(table).max()))
        before = np.diff(times, prepend=2 * times[0] - times[1])
        after = np.append(before[1:], before[-1])
        found = np.zeros(times.size, dtype=bool)
        for jump in fine[np.flatnonzero(change > least)]:
            found |= (times > jump - _BESIDE_A_JUMP * after) & (
                times < jump + _BESIDE_A_JUMP * before
            )
        return found

    def leave_out_upslope_slips(self) -> None:
        """Leave out the samples of slips upslope, after each of which the displacement may have stepped."""
        times = self.test.times
        channels = self.test.channels
        if self.channels == ("block_acceleration",):  # no velocity
            return
        velocity = channels.get("relative_velocity")
        if velocity is None:
            velocity = np.gradient(channels["relative_displacement"], times)
        noise = max(noise_of(velocity), 2e-3 * float(np.nanmax(np.abs(velocity))))
        upslope = np.nan_to_num(velocity) < -_UPSLOPE_NOISE * noise
        several = ndimage.binary_opening(upslope, np.ones(_UPSLOPE_SAMPLES))
        slips = ndimage.binary_dilation(several, iterations=3)
        self._use = self._use & ~slips
        for slip in runs_of(slips):
            self.upslope.append(float(times[slip.start]))
            if "relative_displacement" in channels:
                size = _LARGE * float(np.nanmax(np.abs(channels["relative_displacement"])))
                name = f"upslope slip at {times[slip.start]:.4g} s"
                step = size * (times > times[slip.stop - 1])
                self.lines.append(Line(name, "relative_displacement", size, step))


def _weights_of(values: Floats) -> Floats:
    """Square roots of the samples' weights: readings of a level that repeats have one error and the weight of one."""
    repeated = np.diff(values) == 0.0
    runs = np.append(repeated, False) | np.append(False, repeated)
    weights = np.ones(values.size)
    _, level, counts = np.unique(values[runs], return_inverse=True, return_counts=True)
    weights[runs] = 1.0 / np.sqrt(counts[level])
    return weights


class TableMotion(NamedTuple):
    """A table's motion (s and m/s², linear between its points) with its uncertainty.

    `shapes` are independent errors that it may have, one a column, each of one standard deviation;
    `noise` is the standard deviation of the noise of the record, m/s².
    """

    times: Floats
    acceleration: Floats
    shapes: Floats
    noise: float


class _Fitted(NamedTuple):
    """A spline, Akaike's criterion for it, and the noise that it leaves."""

    spline: BSpline
    score: float
    noise: float


def converter_noise(values: Floats) -> float:
    """The least noise of digitised values: errors of a converter repeat from cycle to cycle and average out less."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return (
        1.6 * float(steps.min()) / 12.0**0.5 if steps.size else 0.0
    )  # that of rounding, 1.6 times


def runs_of(holds: NDArray[np.bool_]) -> list[slice]:
    """The runs of samples at which something holds."""
    return [part for (part,) in ndimage.find_objects(ndimage.label(holds)[0])]


def table_motion(times: Floats, acceleration: Floats) -> TableMotion:
    """The motion behind a record of a table's acceleration."""
    fits = [
        one
        for spacing in _SPACINGS
        if (one := _fitted(times, acceleration, _knots(times, spacing))) is not None
    ]
    chosen = min(range(len(fits)), key=lambda at: fits[at].score)
    best, kinked = _with_kinks(times, acceleration, fits[min(chosen + _FINER, len(fits) - 1)])
    knots = best.spline.t
    bounds = np.unique(best.spline.t)
    # 4 to 32 points between knots, so that straight lines between them are wrong by a tenth of the
    # noise at most
    curvature = np.abs(best.spline(times, nu=2)).max() * np.diff(bounds).max() ** 2 / 8.0
    parts = np.sqrt(curvature / max(0.1 * best.noise, 1e-9 * float(np.abs(acceleration).max())))
    parts = int(np.clip(np.ceil(parts), 4, 32))
    fine = np.interp(
        np.arange((bounds.size - 1) * parts + 1) / parts, np.arange(bounds.size), bounds
    )
    # of many coefficients only what is wrong over long times matters, which fewer can say
    coarse = knots if knots.size <= _MOST_SHAPES else _knots(times, -(-times.size // _MOST_SHAPES))
    design = BSpline.design_matrix(times, coarse, _DEGREE)
    root = cholesky((design.T @ design).toarray() + 1e-9 * np.eye(design.shape[1]), lower=True)
    shapes = solve_triangular(
        root, BSpline.design_matrix(fine, coarse, _DEGREE).toarray().T, lower=True
    ).T
    noise = max(best.noise, converter_noise(acceleration))
    smooth = np.asarray(best.spline(fine))
    errors = [noise * shapes]
    for fits in kinked:
        # of a converter's noise only a part is seen as scatter
        off, error = _averaged(fits, fine, (best.noise / noise) ** 2)
        smooth = smooth + off
        errors.append(error)
    # chords of a curve lie on its hollow side: moved back by their mean distance, the integral is
    # right; beside a kink the curve bends only over the shorter of two intervals, which may be much
    # the shorter
    width = np.minimum(np.diff(fine, prepend=-np.inf), np.diff(fine, append=np.inf))
    smooth = smooth - width**2 / 12.0 * best.spline(fine, nu=2)
    return TableMotion(fine, smooth, np.column_stack(errors), noise)


def _fitted(times: Floats, values: Floats, knots: Floats) -> _Fitted | None:
    """The spline on these knots; None where samples are too few for them."""
    size = times.size
    number = knots.size - _DEGREE - 1
    if number + 2 >= size:
        return None
    try:
        spline = make_lsq_spline(times, values, knots, _DEGREE)
    except (ValueError, np.linalg.LinAlgError):  # an interval of knots without a sample
        return None
    square = max(float(np.sum((values - spline(times)) ** 2)), 1e-24 * float(np.sum(values**2)))
    score = size * float(np.log(square / size)) + 2.0 * number * size / (size - number - 1.0)
    return _Fitted(spline, score, float(np.sqrt(square / (size - number))))


def _knots(times: Floats, spacing: int) -> Floats:
    """Knots that have about so many samples between each other, however these are spaced."""
    count = max(times.size // spacing, 1)
    inner = np.interp(np.linspace(0, times.size - 1, count + 1), np.arange(times.size), times)
    return np.concatenate([np.repeat(times[0], _DEGREE), inner, np.repeat(times[-1], _DEGREE)])


def _with_kinks(
    times: Floats, values: Floats, best: _Fitted
) -> tuple[_Fitted, list[list[_Fitted]]]:
    """The spline with a kink where the shaking begins, and one where it ends, if these improve it, as for a sine.

    Beside it, for each kink, the splines with the kink at this and other places that are likely.
    """
    moving = np.flatnonzero(
        np.abs(values) > _MOVES * max(noise_of(values), 1e-6 * float(np.abs(values).max()))
    )
    kinked: list[list[_Fitted]] = []
    for end, side in ((0, -1.0), (-1, 1.0)) if moving.size else ():
        places = moving[end] + side * 0.25 * np.arange(4 * _KINK_SAMPLES)
        places = places[(places > 2) & (places < times.size - 3)]
        knots = best.spline.t
        tried = []
        for at in np.interp(places, np.arange(times.size), times):
            outside = (
                (knots < at) & (knots > times[0])
                if end == 0
                else (knots > at) & (knots < times[-1])
            )
            for kept in (knots, knots[~outside]):  # at rest outside, one polynomial is enough
                near = np.abs(kept - at) < 1e-9 * (times[-1] - times[0])
                tried.append(
                    _fitted(
                        times,
                        values,
                        np.sort(np.concatenate([kept[~near], np.repeat(at, _DEGREE)])),
                    )
                )
        found = [one for one in tried if one is not None]
        top = min(found, key=lambda one: one.score, default=best)
        if top.score < best.score:
            best = top
            kinked.append([one for one in found if one.score < top.score + 12.0])
    return best, kinked


def _averaged(fits: list[_Fitted], fine: Floats, part: float) -> tuple[Floats, Floats]:
    """By what splines with a kink at several places, averaged by likelihood, differ from the best; errors of this."""
    best = min(fits, key=lambda one: one.score)
    likely = np.exp([0.5 * part * (best.score - one.score) for one in fits])
    likely /= likely.sum()
    apart = np.column_stack([one.spline(fine) - best.spline(fine) for one in fits])
    middle = apart @ likely
    left, sizes, _ = np.linalg.svd((apart - middle[:, None]) * np.sqrt(likely), full_matrices=False)
    return middle, (left * sizes)[:, :3]
