"""Üy, λ and Δμ from one or several tests: the best values, and all that the data allow.

The search begins from many starts with large noise, so that no sample counts for much, and goes on
with ever less.  Then the noise of the sensors, the errors of the table's motion and the samples
beside jumps are estimated, and the search is repeated until they no longer change.  Intervals are
those of `search.Search`, widened where the residuals are not linear (docs/calibration.md).
"""

import copy
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from slipsweep.model import equations
from slipsweep.studies.calibration.likelihood import Likelihood
from slipsweep.studies.calibration.measured_friction import QUANTILE, Floats
from slipsweep.studies.calibration.observation import Observation, runs_of
from slipsweep.studies.calibration.scale import LEAST, MOST, Scale
from slipsweep.studies.calibration.search import (
    Readings,
    Search,
    Tried,
    covariance,
    with_values,
)

#: Values at which the search begins: Üy over the table's peak A, λA/g, and ln(1 + Δμ/μs).
_ONSETS = (0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
_DECAYS = (0.25, 0.5, 1.0, 2.0, 4.0)
_EXCESS = (0.02, 0.1, 0.25)

#: Starts that are followed roughly, and to the end.
_ROUGH = 8
_FINE = 4

#: Most rounds in which motion, noise and samples at jumps settle.  They have settled if no noise
#: (in parts of it) and no correlation changes by more.
_ROUNDS = 6
_SETTLED = 0.1

#: Least noise in the stages of the search, in parts of a channel's largest value.
_STAGES = (0.1, 0.01, 1e-3)

#: Values of Üy, in parts of the peak, at which the second stage looks for minima: with λ and Δμ
#: fitted, and as they are.
_LOOKS = np.arange(1, 33) / 33.0
_CLOSE_LOOKS = np.arange(1, 160) / 160.0

#: Fall of the sum of squares by a new linearisation from which on the residuals are not linear, and
#: most times that an end of the interval of Üy is followed so.
_NOT_LINEAR = 1.0
_TURNS = 3


class Solution(NamedTuple):
    """The solution for one test: Üy, λ, Δμ, then offset and drift of the table's sensor.

    `line_errors` are the standard errors of the last two.
    """

    likelihood: Likelihood
    parameters: Floats
    line_errors: Floats

    @property
    def observation(self) -> Observation:
        """The test."""
        return self.likelihood.observation

    @property
    def table_lines(self) -> Floats:
        """Offset and drift of the table's sensor, m/s²."""
        return self.parameters[3:]


class Estimate(NamedTuple):
    """Üy, λ and Δμ of all tests, and what the data allow.

    Attributes
    ----------
    parameters
        The best values.
    errors, correlation
        Of the linear fit; NaN of parameters that are not determined.
    intervals
        95 %, (3, 2); 0 and inf where the data set no bound.
    determined
        True for a parameter whose interval is narrow enough.
    allowed
        Sets of parameters that were tried and that the data allow, one a row.
    readings
        What decides the acceleration of the block for these (`Scale.reading`).
    apart
        Values of Üy that the data allow, if they do not allow those between.
    solutions
        The solution for each test.
    """

    parameters: Floats
    errors: Floats
    correlation: Floats
    intervals: Floats
    determined: NDArray[np.bool_]
    allowed: Floats
    readings: set[str]
    apart: Sequence[float]
    solutions: Sequence[Solution]


class JointLikelihood:
    """Likelihoods of all tests, each linearised near a point of the search."""

    def __init__(
        self,
        scale: Scale,
        observations: Sequence[Observation],
        point: Floats,
        rough: float = 0.0,
    ) -> None:
        self.scale = scale
        self.observations = observations
        self.likelihoods = self._near(point, rough)

    def _near(self, point: Floats, rough: float) -> list[Likelihood]:
        return [
            Likelihood(observation, self.scale.of_test(point, number), rough)
            for number, observation in enumerate(self.observations)
        ]

    def linearize(self, point: Floats, rough: float = 0.0) -> None:
        """Linearise anew, near another point (`rough` as of `Likelihood`)."""
        self.likelihoods = self._near(point, rough)

    def moved_to(self, point: Floats) -> "JointLikelihood":
        """Return the likelihoods near another point, with the motion of the table likely there.

        They have copies of the observations: these here do not change.
        """
        observations = []
        for number, likelihood in enumerate(self.likelihoods):
            observation = copy.copy(likelihood.observation)
            observation.table_errors = likelihood.likely_motion(self.scale.of_test(point, number))
            observations.append(observation)
        return JointLikelihood(self.scale, observations, point)

    def residuals(self, point: Floats) -> Floats:
        """Return independent residuals of all tests."""
        return np.concatenate(
            [
                likelihood.residuals(self.scale.of_test(point, number))
                for number, likelihood in enumerate(self.likelihoods)
            ]
        )

    def readings(self, point: Floats) -> Readings:
        """Return what decides the block's acceleration in each test (`Scale.reading`)."""
        return tuple(
            self.scale.reading(point, observation.peak_of(self.scale.of_test(point, number)[3:]))
            for number, observation in enumerate(self.observations)
        )

    def settle(self, points: Sequence[Floats]) -> float:
        """Estimate noise and the table's motion by the first of some points that may be right.

        Return the largest change (`Likelihood.settle`).
        """
        changes = []
        for number, likelihood in enumerate(self.likelihoods):
            first, *others = (self.scale.of_test(point, number) for point in points)
            changes.append(likelihood.settle(first, others))
        return max(changes)

    def search(self) -> Search:
        """Return a search by these likelihoods, with nothing tried."""
        return Search(self.residuals, self.readings, self.scale.least, self.scale.most)

    def search_near(self, point: Floats, rough: float = 0.0) -> Search:
        """Linearise near a point and return a search."""
        self.linearize(point, rough)
        return self.search()


class Fit(NamedTuple):
    """The best fit of one or several tests: their likelihoods, and the search that found it."""

    joint: JointLikelihood
    search: Search

    @property
    def readings(self) -> set[str]:
        """Readings of the model (`Scale.reading`) at the points that the data allow."""
        return {reading for tried in self.search.allowed() for reading in tried.readings}

    @property
    def solutions(self) -> list[Solution]:
        """The solution for each test, without standard errors."""
        none = np.full(2, np.nan)
        solutions = []
        for number, likelihood in enumerate(self.joint.likelihoods):
            parameters = self.joint.scale.of_test(self.search.best, number)
            solutions.append(Solution(likelihood, parameters, none[: parameters.size - 3]))
        return solutions


def estimate(fit: Fit) -> Estimate:
    """Return errors and intervals of the parameters beside their best values."""
    joint, search = fit
    scale = joint.scale
    width = QUANTILE * np.sqrt(np.diag(covariance(search.slopes(search.best))))
    intervals = search.intervals(np.where(np.isfinite(width), np.clip(width, 1e-5, 0.3), 0.1))
    intervals, allowed = _linearised_anew(search, intervals, joint)
    intervals[0] = _beyond_mode_limit(intervals[0], search.best, joint)
    low, high = (scale.parameters(ends) for ends in intervals.T)
    low = np.where(intervals[:, 0] == LEAST, 0.0, low)
    high = np.where(intervals[:, 1] == MOST, np.inf, high)
    best = scale.parameters(search.best)
    # half an interval is no more than half of the value, of Δμ 0.3 of μs + Δμ
    widest = 2.0 * np.array([0.5, 0.5, 0.3]) * np.abs(best + np.array([0.0, 0.0, scale.mu_s]))
    determined = np.isfinite(high) & (high - low <= widest) & [low[0] > 0.0, True, True]
    apart = search.apart()
    determined[0] &= not apart
    slopes = scale.slopes(search.best)
    covariances = covariance(search.slopes(search.best)) * np.outer(slopes, slopes)
    deviations = np.sqrt(np.diag(covariances))
    # no correlation with a parameter that no residual depends on near the best
    correlation = np.nan_to_num(covariances / np.outer(deviations, deviations))
    np.fill_diagonal(correlation, 1.0)
    errors = _errors(deviations[:3], best, low, high)
    solutions = [
        Solution(
            likelihood,
            np.append(best, scale.of_test(search.best, number)[3:]),
            deviations[scale.lines(number)],
        )
        for number, likelihood in enumerate(joint.likelihoods)
    ]
    return Estimate(
        parameters=best,
        errors=np.where(determined, errors, np.nan),
        correlation=np.where(np.outer(determined, determined), correlation[:3, :3], np.nan),
        intervals=np.column_stack([low, high]),
        determined=determined,
        allowed=np.array([scale.parameters(tried.point) for tried in allowed]),
        readings={reading for tried in allowed for reading in tried.readings},
        apart=[onset * scale.peak for onset in apart],
        solutions=solutions,
    )


def best_fit(observations: Sequence[Observation]) -> Fit:
    """Fit one or several tests of one interface.

    Noise, the motion of the tables and the samples at jumps settle with the fit.
    """
    scale = Scale(observations)
    joint, points = _first_minima(scale, observations)
    change = math.inf
    for turn in range(_ROUNDS):
        search = joint.search_near(points[0])
        for point in points:
            search.follow(point)
        if turn == 0:
            _try_branches(search, scale)
        elif change < _SETTLED and search.square(points[0]) - search.least < 0.1:
            break
        points = search.candidates()
        change = joint.settle(points)
    return Fit(joint, search)


def _linearised_anew(
    search: Search, intervals: Floats, joint: JointLikelihood
) -> tuple[Floats, list[Tried]]:
    """Return intervals wide enough for points far from the best, and all points allowed.

    The residuals depend on errors of the table's motion linearly only near the point at which they
    were linearised.  Far from it, at the ends of the interval of Üy and at the best of other
    branches, they are linearised once more, with the motion of the table that is likely there.
    """
    joint.linearize(search.best)
    ends = [np.transpose(intervals)]
    allowed = search.allowed()
    width = float(np.clip(0.1 * np.ptp(intervals[0]), 1e-5, 0.3))
    for side in (-1, 1):
        before = Fit(joint, search)
        for _ in range(_TURNS):
            after = _linearised_at(before.search.outermost(side), before, search)
            if after is None:
                break
            after.search.end(0, side, width)
            allowed += after.search.allowed()
            before = after
    for point in search.refuted_narrowly():
        after = _linearised_at(point, Fit(joint, search), search)
        if after is not None:
            ends.append(np.transpose(after.search.intervals(np.full(3, 0.05))))
            allowed += after.search.allowed()
    points = np.vstack([*ends, [tried.point[:3] for tried in allowed]])
    return np.column_stack([points.min(axis=0), points.max(axis=0)]), allowed


def _linearised_at(point: Floats, before: Fit, first: Search) -> Fit | None:
    """Return a search linearised at a point; None if that changes little or allows nothing.

    `before` led to the point, and the least of the search `first` counts, too.
    """
    square = before.search.square(point)
    joint = before.joint.moved_to(point)
    search = joint.search()
    search.adopt(first)
    search.polish(point, free=range(1, point.size), most=6)
    changes = search.least_tried() < square - _NOT_LINEAR
    return Fit(joint, search) if changes and search.allowed() else None


def _errors(deviations: Floats, best: Floats, low: Floats, high: Floats) -> Floats:
    """Return standard errors, of the linear fit or of the interval.

    They are those of the interval where the two differ by a factor of more than 2: there the sum of
    squares is flat in a parameter, or has several minima.  Then the longer side counts.
    """
    of_interval = (high - low) / (2.0 * QUANTILE)
    agree = (deviations < 2.0 * of_interval) & (of_interval < 2.0 * deviations)
    longer = np.maximum(high - best, best - low) / QUANTILE
    return np.where(agree | ~np.isfinite(of_interval), deviations, longer)


def _first_minima(
    scale: Scale, observations: Sequence[Observation]
) -> tuple[JointLikelihood, list[Floats]]:
    """Return likelihoods, and minima, the best first.

    The minima are those of ever less noise, so that no sample counts for much at first.
    """
    largest = [
        noise
        for observation in observations
        for noise in observation.sensor_noise / observation.largest
    ]
    joint, points = _rough_minima(scale, observations)
    for stage in _STAGES[1:]:
        search = joint.search_near(points[0], rough=stage)
        for point in points:
            search.follow(point)
        if stage == _STAGES[1]:
            _look_along_onset(search)
        points = search.candidates()
        for number, observation in enumerate(observations):
            observation.look_at_jumps([scale.of_test(point, number) for point in points])
        if max(largest) > stage:
            break
    return joint, points


def _rough_minima(
    scale: Scale, observations: Sequence[Observation]
) -> tuple[JointLikelihood, list[Floats]]:
    """Return likelihoods with large noise, and starts, the best first, by fits with these."""
    starts = [
        scale.point(onset, decay, excess)
        for onset in _ONSETS
        for decay in _DECAYS
        for excess in _EXCESS
    ]
    for onset in _ONSETS:  # Eq. 4 crosses there
        for decay in _DECAYS:
            excess = scale.excess(onset, onset, decay)
            starts += [scale.point(part * onset, decay, excess) for part in (0.1, 0.6)]
        starts.append(scale.point(onset, MOST[1], 0.0))  # the yield value governs
    joint = JointLikelihood(scale, observations, starts[0], rough=_STAGES[0])
    search = joint.search()

    def distance(point: Floats) -> float:
        return float(np.sum(np.log1p(search.residuals(point) ** 2)))

    nearest = sorted(starts, key=distance)[:_ROUGH]
    polished = sorted((search.polish(start, loss="cauchy") for start in nearest), key=distance)
    return joint, polished[:_FINE]


def _look_along_onset(search: Search) -> None:
    """Follow the minima along Üy.

    Two values of Üy can give the same velocity, of which one is right.  This is so in continuous
    sliding if the table's acceleration crosses Eq. 4 between the two: the block begins to slide at
    the same time by either.
    """
    best = search.best
    fitted = [search.polish(with_values(best, [0], onset), free=(1, 2), most=3) for onset in _LOOKS]
    for points in (fitted, [with_values(best, [0], onset) for onset in _CLOSE_LOOKS]):
        squares = np.array([search.square(point) for point in points])
        padded = np.concatenate([[np.inf], squares, [np.inf]])
        lowest = (squares < padded[:-2]) & (squares <= padded[2:])
        order = np.flatnonzero(lowest)[np.argsort(squares[lowest])]
        for at in order[:_FINE]:
            search.follow(points[at])


def _try_branches(search: Search, scale: Scale) -> None:
    """Try Üy alone, and Eq. 4 where it crosses the table's acceleration at the same value."""
    best = search.best
    starts = [with_values(best, [0, 1, 2], [onset, MOST[1], 0.0]) for onset in (best[0], 0.7)]
    held = min((search.polish(start, free=(0,)) for start in starts), key=search.square)[0]
    for decay in _DECAYS:
        top = scale.excess(1.0, min(1.05 * held, 0.99), decay)
        crossing = scale.excess(held, held, decay)
        for onset, excess in (
            (held, top),
            (0.5 * held, top),
            (0.3 * held, crossing),
            (0.9 * held, crossing),
        ):
            point = np.clip([onset, decay, excess], LEAST, MOST)
            search.square(with_values(best, [0, 1, 2], point))
    for start in search.leaders():
        search.follow(start)


def _beyond_mode_limit(ends: Floats, best: Floats, joint: JointLikelihood) -> Floats:
    """Return the ends of Üy's interval, moved where one lies at the mode limit of a pulse.

    There it is moved by the error of the pulse's peak.  The Üy of the limit is Eq. 7 solved for it.
    """
    scale = joint.scale
    moved = ends
    denominator = equations.limit_denominator(scale.mu_s, scale.tan_theta)
    for number, observation in enumerate(joint.observations):
        motion = observation.table_acceleration(scale.of_test(best, number)[3:])
        for part in runs_of(motion > 0.0):
            top = part.start + int(np.argmax(motion[part]))
            limit = (denominator * motion[top] - scale.g * scale.mu_s) / scale.peak
            error = QUANTILE * denominator * observation.motion.spread(top) / scale.peak
            beyond = np.clip(
                [min(moved[0], limit - error), max(moved[1], limit + error)], LEAST[0], MOST[0]
            )
            moved = np.where(np.abs(ends - limit) < error, beyond, moved)
    return moved


def cycle_estimate(
    of_cycle: Callable[[Floats], Floats], parameters: Floats, free: list[int]
) -> tuple[Floats, Floats]:
    """Return Üy, λ, Δμ and standard errors from the samples of one cycle.

    Those that the samples do not determine are NaN.  `of_cycle` are the residuals of these samples;
    `parameters` are those of the whole test, from which the search begins.
    """
    start = parameters[free]

    def residuals(values: Floats) -> Floats:
        return of_cycle(with_values(parameters, free, values))

    fit = least_squares(
        residuals,
        start,
        bounds=(-1e-9, 10.0 * start + 1.0),
        x_scale="jac",
        diff_step=1e-4,
        max_nfev=6,
    )
    none = np.full(3, np.nan)
    covariances = covariance(fit.jac)
    if not np.isfinite(covariances).all():
        return none, none
    errors = np.sqrt(np.diag(covariances))
    return with_values(none, free, fit.x), with_values(none, free, errors)
