"""Üy, λ and Δμ from one or several tests: the best, and all that the data allow.

Where the yield acceleration governs, λ and Δμ may be nearly anything; where Eq. 4 crosses the
table's acceleration, Üy may.  A standard error describes neither, so an interval is the profile
likelihood's, the union over these branches, each compared with its own least (docs/calibration.md).
"""

import copy
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from slipsweep.studies.calibration.likelihood import SOUGHT, Observation, runs_of
from slipsweep.studies.calibration.measured_friction import QUANTILE, Floats
from slipsweep.studies.datasets import sweep

#: What decides the block's acceleration, of each test.
Readings = tuple[str, ...]

#: Rise of the sum of squares at the ends of a 95 % interval, and of the least of a branch by which
#: it is refuted.
SQUARE = QUANTILE**2
REFUTED = 9.0

#: Accelerations of the table in a pulse, in parts of its peak, by which `Scale.reading` decides.
_TO_PEAK = np.linspace(0.0, 1.0, 65)[1:]

#: Bounds of the search: Üy over the table's peak A, λA/g, ln(1 + Δμ/μs); how far an offset of the
#: table's sensor, and a drift over the test, may be from where the search begins, in parts of A.
LEAST = np.array([1e-4, 0.0, 0.0])
MOST = np.array([1.0, 20.0, 3.0])
_TABLE_LINE = 0.5

#: Where the search begins.
_ONSETS = (0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
_DECAYS = (0.25, 0.5, 1.0, 2.0, 4.0)
_EXCESS = (0.02, 0.1, 0.25)

#: Starts that are followed roughly, and to the end; rounds at most in which motion, noise and
#: samples at jumps settle, and the largest change of a noise, in parts of it, or of a correlation
#: with which they have.
_ROUGH = 8
_FINE = 4
_ROUNDS = 6
_SETTLED = 0.1

#: Least noise in the stages of the search, in parts of a channel's largest value, and values of Üy
#: in parts of the peak at which the second stage looks for minima: with λ and Δμ fitted, and as
#: they are.
_STAGES = (0.1, 0.01, 1e-3)
_LOOKS = np.arange(1, 33) / 33.0
_CLOSE_LOOKS = np.arange(1, 160) / 160.0

#: Minima that are followed, at this distance in Üy at least in parts of the peak, and the rise of
#: the sum of squares above the least beyond which none can become the least; the distance from
#: which on minima are said to be several solutions.
_MINIMA = 6
_APART = 0.004
_HOPELESS = 60.0
_SEVERAL = 0.02

#: Fall of the sum of squares as the residuals are linearised anew, with which they are not linear;
#: how many times at most an end of the interval of Üy is followed so; rise of the least of a branch
#: up to which it may be refuted wrongly.
_NOT_LINEAR = 1.0
_TURNS = 3
_NARROWLY = 20.0


class Scale:
    """Scaled parameters of the search, a point, and Üy, λ, Δμ.

    A point also has the offset and the drift of the table's sensor of each test that has them, in
    parts of the peak.
    """

    def __init__(self, observations: Sequence[Observation]) -> None:
        self.peak = max(one.peak for one in observations)
        self.mu_s = observations[0].mu_s
        self.g = observations[0].model.g
        self.tan_theta = math.tan(math.radians(observations[0].theta))
        self.first_lines = np.concatenate([one.first_sizes for one in observations]) / self.peak
        self.least = np.append(LEAST, self.first_lines - _TABLE_LINE)
        self.most = np.append(MOST, self.first_lines + _TABLE_LINE)
        ends = np.cumsum([3, *(one.first_sizes.size for one in observations)])
        self._lines = [slice(begin, end) for begin, end in itertools.pairwise(ends)]

    def point(self, onset: float, decay: float, excess: float) -> Floats:
        """Return a point with offset and drift of the table where the search begins."""
        return np.asarray(np.clip([onset, decay, excess, *self.first_lines], self.least, self.most))

    def parameters(self, point: Floats) -> Floats:
        """Return Üy, λ and Δμ."""
        return np.array(
            [point[0] * self.peak, point[1] * self.g / self.peak, self.mu_s * math.expm1(point[2])]
        )

    def lines(self, number: int) -> slice:
        """Return which parts of a point are offset and drift of the table in a test."""
        return self._lines[number]

    def of_test(self, point: Floats, number: int) -> Floats:
        """Return Üy, λ and Δμ, and offset and drift of the table in a test."""
        return np.append(self.parameters(point), self.peak * point[self._lines[number]])

    def slopes(self, point: Floats) -> Floats:
        """Return the derivatives of all parameters by those of the point."""
        first = [self.peak, self.g / self.peak, self.mu_s * math.exp(point[2])]
        return np.append(first, np.full(self.first_lines.size, self.peak))

    def reading(self, point: Floats, peak: float) -> str:
        """What decides the block's acceleration in a test with this peak of the table's.

        "continuous": Eq. 4 throughout.  "all": first Üy, later Eq. 4.  "crossing": Eq. 4, from
        where it crosses the table's acceleration on; Üy plays no part.  One value throughout:
        "held", Üy; "crossed", that at the crossing.
        """
        onset, decay, excess = point[:3]
        table = _TO_PEAK * peak
        coupled = (
            self.mu_s - self.tan_theta - self.mu_s * np.exp(excess - decay * table / self.peak)
        )
        response = table - (self.g + table * self.tan_theta) * coupled - self.g * self.tan_theta
        if peak > (onset * self.peak + self.g * self.mu_s) / (
            1.0 - self.tan_theta * (self.mu_s - self.tan_theta)
        ):
            return "continuous"
        above = table > onset * self.peak
        slides = above & (response < table)
        first = int(np.argmax(slides))
        crosses = bool(above[:first].any()) or not slides.any()
        if not slides.any() or float(response[first:].max()) <= max(
            onset * self.peak, float(response[first])
        ):
            return "crossed" if crosses else "held"
        return "crossing" if crosses else "all"

    def excess(self, table: float, block: float, decay: float) -> float:
        """ln(1 + Δμ/μs) with which Eq. 4 gives the block's acceleration for one of the table, in parts of the peak."""
        normal = self.g + table * self.peak * self.tan_theta
        behind = (table - block) * self.peak - self.g * self.tan_theta
        return (
            math.log(max(self.mu_s - self.tan_theta - behind / normal, 1e-3) / self.mu_s)
            + decay * table
        )


class Tried(NamedTuple):
    """A point that was tried, what decides the block's acceleration there, and the sum of squares.

    `branch` are the readings but for "crossed", which is "held": the least is the same.
    """

    point: Floats
    readings: Readings
    branch: Readings
    square: float


class Search:
    """Independent residuals and readings (`Scale.reading`) of points, and all points that were tried."""

    def __init__(
        self,
        residuals: Callable[[Floats], Floats],
        readings: Callable[[Floats], Readings],
        least: Floats = LEAST,
        most: Floats = MOST,
    ) -> None:
        self._residuals = residuals
        self._readings = readings
        self._bounds = (least, most)
        self.tried: list[Tried] = []
        self.minima: list[Tried] = []
        self._least: dict[Readings, float] = {}

    def residuals(self, point: Floats) -> Floats:
        rest = self._residuals(point)
        readings = self._readings(point)
        branch = tuple("held" if one == "crossed" else one for one in readings)
        self.tried.append(Tried(np.array(point), readings, branch, float(rest @ rest)))
        self._least[branch] = min(self.tried[-1].square, self._least.get(branch, math.inf))
        return rest

    def at(self, point: Floats) -> Tried:
        """Try a point."""
        self.residuals(point)
        return self.tried[-1]

    def square(self, point: Floats) -> float:
        """Sum of squares."""
        return self.at(point).square

    @property
    def least(self) -> float:
        return min(self._least.values())

    @property
    def best(self) -> Floats:
        return min(self.tried, key=lambda one: one.square).point

    def above(self, one: Tried) -> float:
        """Sum of squares of a point above the least of its branch; infinite if the branch is refuted."""
        least = self._least[one.branch]
        return one.square - least if least - self.least <= REFUTED else math.inf

    def allowed(self) -> list[Tried]:
        return [one for one in self.tried if self.above(one) <= SQUARE]

    def outermost(self, side: int) -> Floats:
        """Return the allowed point of least (`side` −1) or largest (1) Üy."""
        return max((one.point for one in self.allowed()), key=lambda point: side * point[0])

    def refuted_narrowly(self) -> list[Floats]:
        """Return the best points of readings that are refuted, but narrowly."""
        return [
            point
            for point in self.leaders()
            if self.square(point) < self.least + _NARROWLY
            and not math.isfinite(self.above(self.at(point)))
        ]

    def least_tried(self) -> float:
        """Return the least sum of squares of the points that were tried here."""
        return min(one.square for one in self.tried)

    def adopt(self, other: "Search") -> None:
        """Compare with the least of each branch that another search has found, too."""
        for branch, square in other._least.items():
            self._least[branch] = min(square, self._least.get(branch, math.inf))

    def leaders(self) -> list[Floats]:
        """The best point of each reading, the best of all first."""
        found: dict[Readings, Floats] = {}
        for number in np.argsort([one.square for one in self.tried]):
            found.setdefault(self.tried[number].readings, self.tried[number].point)
        return list(found.values())

    def polish(
        self,
        start: Floats,
        free: Sequence[int] | None = None,
        most: int = 12,
        loss: str = "linear",
    ) -> Floats:
        """Return the point of least squares over some parameters, by default all, from a start."""
        free = [*range(start.size)] if free is None else list(free)
        low, high = (bound[free] for bound in self._bounds)
        found = least_squares(
            lambda part: self.residuals(_with(start, free, part)),
            np.clip(start[free], low + 1e-9, high - 1e-9),
            bounds=(low, high),
            diff_step=1e-6,
            max_nfev=most,
            loss=loss,
            f_scale=3.0,
            ftol=1e-6,
            xtol=1e-7,
        )
        return _with(start, free, found.x)

    def follow(self, start: Floats) -> None:
        """Find the minimum that a start leads to."""
        first = len(self.tried)
        self.polish(start)
        self.minima.append(min(self.tried[first:], key=lambda one: one.square))

    def candidates(self) -> list[Floats]:
        """Return the best point of each reading, the best of all first, and other minima."""
        points = self.leaders()[:_MINIMA]
        for minimum in sorted(self.minima, key=lambda one: one.square):
            near = min(abs(minimum.point[0] - point[0]) for point in points)
            if near > _APART and minimum.square < self.least + _HOPELESS and len(points) < _MINIMA:
                points.append(minimum.point)
        return points

    def apart(self) -> list[float]:
        """Return Üy of minima that the data allow with values between that they do not.

        It is in parts of the peak.
        """
        minima = sorted(self.candidates(), key=lambda point: point[0])
        allowed = [point for point in minima if self.above(self.at(point)) <= SQUARE]
        onsets: list[float] = []
        for low, high in itertools.pairwise(allowed):
            if high[0] - low[0] < _SEVERAL:
                continue
            between = [
                _with(low, [0], part * low[0] + (1.0 - part) * high[0]) for part in (0.3, 0.5, 0.7)
            ]
            others = [*range(1, low.size)]
            tried = [self.at(self.polish(point, others, most=6)) for point in between]
            if max(map(self.above, tried)) > SQUARE:
                onsets += [low[0], high[0]]
        return sorted(set(onsets))

    def slopes(self, point: Floats) -> Floats:
        """Derivatives of the residuals by the parameters, a column each."""
        columns = []
        for at, step in enumerate(1e-5 * np.eye(point.size)):
            low = np.clip(point - step, *self._bounds)
            high = np.clip(point + step, *self._bounds)
            columns.append((self.residuals(high) - self.residuals(low)) / (high - low)[at])
        return np.column_stack(columns)

    def intervals(self, widths: Floats) -> Floats:
        """95 % intervals, (parameters, 2), from first guesses of half their widths; a bound where the data set none."""
        for _ in range(3):
            least = self.least
            found = np.array(
                [[self.end(at, side, float(widths[at])) for side in (-1, 1)] for at in range(3)]
            )
            if self.least > least - 0.02:
                break
            self.polish(self.best)
        # what the profile of one parameter passed through may lie beyond the end of another's
        every = np.vstack([found.T, [one.point[:3] for one in self.allowed()]])
        return np.column_stack([every.min(axis=0), every.max(axis=0)])

    def end(self, at: int, side: int, width: float) -> float:
        """The lower (`side` −1) or upper (1) end of the interval of one parameter; the bound where the data set none.

        The profile of each reading is followed from the outermost point known, by `width` at first.
        """
        outermost: dict[Readings, Floats] = {}
        for one in self.allowed():
            if side * one.point[at] > side * outermost.setdefault(one.readings, one.point)[at]:
                outermost[one.readings] = one.point
        return max(
            (self._followed(at, side, width, point) for point in outermost.values()),
            key=lambda end: side * end,
        )

    def _followed(self, at: int, side: int, width: float, start: Floats) -> float:
        """The end of a profile, from a point that the data allow."""
        slopes = self.slopes(start)
        others = [one for one in range(start.size) if one != at]
        direction = np.eye(start.size)[at]
        direction[others] = -np.linalg.lstsq(slopes[:, others], slopes[:, at], rcond=1e-8)[0]
        path = {float(start[at]): start}

        @functools.cache
        def beyond(value: float) -> float:
            """Root of the least rise of the sum of squares at this value, less that of the end."""
            near, *further = sorted(path.values(), key=lambda point: abs(point[at] - value))[:2]
            along = (near - further[0]) / (near - further[0])[at] if further else direction
            point, above = self._profiled(at, value, near, along)
            if above <= SQUARE:
                path[value] = point
            return math.sqrt(min(max(above, 0.0), 30.0)) - math.sqrt(SQUARE)

        limit = float(self._bounds[side > 0][at])
        inside = float(start[at])
        step = width
        if inside == limit:
            return limit
        while beyond(value := side * min(side * (inside + side * step), side * limit)) <= 0.0:
            if value == limit:
                return limit
            inside = value
            step = 2.0 * step
        if inside == start[at] and beyond(inside) >= 0.0:
            return inside
        return float(
            brentq(beyond, inside, value, xtol=max(0.01 * abs(value - start[at]), 1e-9), rtol=1e-6)
        )

    def _profiled(self, at: int, value: float, near: Floats, along: Floats) -> tuple[Floats, float]:
        """The least rise of the sum of squares with one parameter held, and where: `along` leads from a point near."""
        change = value - near[at]
        # and with the same friction at three accelerations of the table, in parts of its peak
        kept = [
            [0.0, 1.0, table] if at == 1 else [0.0, 1.0 / table, 1.0]
            for table in (0.3, 0.6, 1.0)
            if at > 0
        ]
        starts = [
            near,
            near + change * along,
            *(near + change * np.resize(one + [0.0] * (near.size - 3), near.size) for one in kept),
        ]
        first = len(self.tried)
        for start in starts:
            self.residuals(_with(np.clip(start, *self._bounds), [at], value))
        held = sorted(self.tried[first:], key=lambda one: one.square)
        if min(map(self.above, held)) > SQUARE:
            others = [one for one in range(near.size) if one != at]
            for one in held[:2]:
                self.residuals(self.polish(one.point, others, most=6))
        best = min(self.tried[first:], key=self.above)
        return best.point, self.above(best)


class Estimate(NamedTuple):
    """What one or several tests say of Üy, λ and Δμ.

    `intervals`, (3, 2), are at 95 %, 0 and inf where the data set no bound, and `determined` the
    parameters that these bound well enough.  `errors` and `correlation`, of the linear fit, are NaN
    of the others.  `allowed` are parameters tried that the data allow, one set a row, `readings`
    what decides the acceleration for these (`Scale.reading`).  `apart` are values of Üy that the
    data allow, if those between are not allowed.  `table_lines` are offset and drift of the table's
    sensor in each test, with their standard errors.
    """

    parameters: Floats
    errors: Floats
    correlation: Floats
    intervals: Floats
    determined: NDArray[np.bool_]
    allowed: Floats
    readings: set[str]
    apart: Sequence[float]
    observations: Sequence[Observation]
    table_lines: Sequence[tuple[Floats, Floats]]

    def lines_of(self, observation: Observation) -> tuple[Floats, Floats]:
        """Return offset and drift of the table's sensor in a test, and their standard errors."""
        return self.table_lines[[each is observation for each in self.observations].index(True)]

    def of_test(self, observation: Observation) -> Floats:
        """Return Üy, λ and Δμ, and offset and drift of the table's sensor in a test."""
        return np.append(self.parameters, self.lines_of(observation)[0])

    def summary(self, one: Observation, **more: Any) -> xr.Dataset:
        """The results of a sweep for the parameters found, and the table's motion of a test; `more` replaces them."""
        given = {**dict(zip(SOUGHT, map(float, self.parameters), strict=True)), **more}
        record = one.record(self.lines_of(one)[0])
        return sweep(one.theta, one.mu_s, excitation=record, model=one.model, **given)


class Fit(NamedTuple):
    """The best fit of one or several tests, by the search that found it."""

    scale: Scale
    search: Search
    observations: Sequence[Observation]

    @property
    def readings(self) -> set[str]:
        """Return what decides the acceleration at the points tried that the data allow."""
        return {reading for one in self.search.allowed() for reading in one.readings}

    def of_test(self, observation: Observation) -> Floats:
        """Return Üy, λ and Δμ, and offset and drift of the table's sensor in a test."""
        number = [each is observation for each in self.observations].index(True)
        return self.scale.of_test(self.search.best, number)


def best_fit(observations: Sequence[Observation]) -> Fit:
    """Fit one or several tests of one interface; noise and samples at jumps settle with the fit."""
    scale = Scale(observations)
    starts = _first_minima(observations, scale)
    change = math.inf
    for turn in range(_ROUNDS):
        search = _search(scale, observations, starts[0])
        for start in starts:
            search.follow(start)
        if turn == 0:
            _try_branches(search, scale)
        elif change < _SETTLED and search.square(starts[0]) - search.least < 0.1:
            break
        starts = search.candidates()
        change = max(
            one.settle(*_solutions(scale, starts, number))
            for number, one in enumerate(observations)
        )
    return Fit(scale, search, observations)


def estimate(fit: Fit) -> Estimate:
    """Return what the tests of a fit say of the parameters: errors and intervals beside the best."""
    scale, search, observations = fit
    width = QUANTILE * np.sqrt(np.diag(_covariance(search.slopes(search.best))))
    intervals = search.intervals(np.where(np.isfinite(width), np.clip(width, 1e-5, 0.3), 0.1))
    intervals, allowed = _linearised_anew(search, intervals, observations, scale)
    intervals[0] = _beyond_mode_limit(intervals[0], search.best, observations, scale)
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
    covariance = _covariance(search.slopes(search.best)) * np.outer(slopes, slopes)
    deviations = np.sqrt(np.diag(covariance))
    # no correlation with a parameter that no residual depends on near the best
    correlation = np.nan_to_num(covariance / np.outer(deviations, deviations))
    np.fill_diagonal(correlation, 1.0)
    errors = _errors(deviations[:3], best, low, high)
    return Estimate(
        best,
        np.where(determined, errors, np.nan),
        np.where(np.outer(determined, determined), correlation[:3, :3], np.nan),
        np.column_stack([low, high]),
        determined,
        np.array([scale.parameters(one.point) for one in allowed]),
        {reading for one in allowed for reading in one.readings},
        [onset * scale.peak for onset in apart],
        observations,
        [
            (scale.of_test(search.best, number)[3:], deviations[scale.lines(number)])
            for number in range(len(observations))
        ],
    )


def _linearised_anew(
    search: Search, intervals: Floats, observations: Sequence[Observation], scale: Scale
) -> tuple[Floats, list[Tried]]:
    """Return intervals wide enough for what is far from the best, and all points allowed.

    The residuals depend on errors of the table's motion linearly only near the point at which they
    were linearised.  Far from it, at the ends of the interval of Üy and at the best of other
    branches, they are linearised once more, with the motion of the table that is likely there.
    """
    _linearise(observations, scale, search.best, [one.wrong for one in observations])
    every = [np.transpose(intervals)]
    allowed = search.allowed()

    def near(
        before: Search, tests: Sequence[Observation], point: Floats
    ) -> tuple[Search, Sequence[Observation]] | None:
        """Return a search and its tests linearised at a point; None if that changes little."""
        square = before.square(point)
        motions = _likely_motions(scale, tests, point)
        moved = [copy.copy(one) for one in tests]
        _linearise(moved, scale, point, motions)
        after = _search_at(scale, moved)
        after.adopt(search)
        after.polish(point, free=range(1, point.size), most=6)
        changes = after.least_tried() < square - _NOT_LINEAR
        return (after, moved) if changes and after.allowed() else None

    width = float(np.clip(0.1 * np.ptp(intervals[0]), 1e-5, 0.3))
    for side in (-1, 1):
        linearised = search, observations
        for _ in range(_TURNS):
            turned = near(*linearised, linearised[0].outermost(side))
            if turned is None:
                break
            linearised = turned
            linearised[0].end(0, side, width)
            allowed += linearised[0].allowed()
    for point in search.refuted_narrowly():
        turned = near(search, observations, point)
        if turned is not None:
            every.append(np.transpose(turned[0].intervals(np.full(3, 0.05))))
            allowed += turned[0].allowed()
    points = np.vstack([*every, [one.point[:3] for one in allowed]])
    return np.column_stack([points.min(axis=0), points.max(axis=0)]), allowed


def _linearise(
    observations: Sequence[Observation], scale: Scale, point: Floats, motions: Sequence[Floats]
) -> None:
    """Linearise residuals near a point, with these errors of the table's motion."""
    for number, (one, wrong) in enumerate(zip(observations, motions, strict=True)):
        one.wrong = wrong
        one.linearize(scale.of_test(point, number))


def _likely_motions(
    scale: Scale, observations: Sequence[Observation], point: Floats
) -> list[Floats]:
    """Return the most likely errors of the table's motion of each test at a point."""
    return [
        one.likely_motion(scale.of_test(point, number)) for number, one in enumerate(observations)
    ]


def _errors(deviations: Floats, best: Floats, low: Floats, high: Floats) -> Floats:
    """Return standard errors: of the linear fit, or of the interval if that tells another story.

    It does where the sum of squares is flat in a parameter, or has several minima; then the longer
    side of the interval counts.
    """
    of_interval = (high - low) / (2.0 * QUANTILE)
    agree = (deviations < 2.0 * of_interval) & (of_interval < 2.0 * deviations)
    longer = np.maximum(high - best, best - low) / QUANTILE
    return np.where(agree | ~np.isfinite(of_interval), deviations, longer)


def _solutions(scale: Scale, points: Sequence[Floats], number: int) -> tuple[Floats, list[Floats]]:
    """Return the parameters of a test for the first of some points, and for the others."""
    first, *others = (scale.of_test(point, number) for point in points)
    return first, others


def _search(
    scale: Scale, observations: Sequence[Observation], near: Floats, rough: float = 0.0
) -> Search:
    """Return a search by the likelihoods near a point."""
    for number, one in enumerate(observations):
        one.linearize(scale.of_test(near, number), rough)
    return _search_at(scale, observations)


def _search_at(scale: Scale, observations: Sequence[Observation]) -> Search:
    """Return a search by the likelihoods as they are linearised."""

    def residuals(point: Floats) -> Floats:
        rests = [one.residuals(scale.of_test(point, at)) for at, one in enumerate(observations)]
        return np.concatenate(rests)

    def readings(point: Floats) -> Readings:
        parts = (scale.of_test(point, at)[3:] for at in range(len(observations)))
        peaks = (one.peak_of(part) for one, part in zip(observations, parts, strict=True))
        return tuple(scale.reading(point, peak) for peak in peaks)

    return Search(residuals, readings, scale.least, scale.most)


def _first_minima(observations: Sequence[Observation], scale: Scale) -> list[Floats]:
    """Return minima, the best first.

    They are those of ever less noise, so that no sample counts for much at first.
    """
    largest = [noise for one in observations for noise in one.sensor_noise / one.largest]
    points = _rough_minima(observations, scale)
    for stage in _STAGES[1:]:
        search = _search(scale, observations, points[0], rough=stage)
        for point in points:
            search.follow(point)
        if stage == _STAGES[1]:
            _look_along_onset(search)
        points = search.candidates()
        for number, one in enumerate(observations):
            one.look_at_jumps([scale.of_test(point, number) for point in points])
        if max(largest) > stage:
            break
    return points


def _rough_minima(observations: Sequence[Observation], scale: Scale) -> list[Floats]:
    """Return starts, the best first, by fits in which no sample counts for much."""
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
    search = _search(scale, observations, starts[0], rough=_STAGES[0])

    def far(point: Floats) -> float:
        return float(np.sum(np.log1p(search.residuals(point) ** 2)))

    nearest = sorted(starts, key=far)[:_ROUGH]
    return sorted((search.polish(start, loss="cauchy") for start in nearest), key=far)[:_FINE]


def _look_along_onset(search: Search) -> None:
    """Follow the minima along Üy.

    Two values of it can give the same velocity, of which one is right.  In continuous sliding Üy
    and the acceleration at which the block would begin to slide as late by Eq. 4 do so, if the
    table's acceleration crosses Eq. 4 between the two.
    """
    best = search.best
    fitted = [search.polish(_with(best, [0], onset), free=(1, 2), most=3) for onset in _LOOKS]
    for points in (fitted, [_with(best, [0], onset) for onset in _CLOSE_LOOKS]):
        squares = np.array([search.square(point) for point in points])
        padded = np.concatenate([[np.inf], squares, [np.inf]])
        lowest = (squares < padded[:-2]) & (squares <= padded[2:])
        order = np.flatnonzero(lowest)[np.argsort(squares[lowest])]
        for at in order[:_FINE]:
            search.follow(points[at])


def _try_branches(search: Search, scale: Scale) -> None:
    """Try what Üy alone explains, and Eq. 4 that crosses the table's acceleration at the same value."""
    best = search.best
    starts = [_with(best, [0, 1, 2], [onset, MOST[1], 0.0]) for onset in (best[0], 0.7)]
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
            search.square(_with(best, [0, 1, 2], point))
    for start in search.leaders():
        search.follow(start)


def _beyond_mode_limit(
    ends: Floats, best: Floats, observations: Sequence[Observation], scale: Scale
) -> Floats:
    """Ends of Üy's interval; where one lies at the mode limit (Eq. 7) of a pulse, the error of its peak moves it."""
    found = ends
    slope = 1.0 - scale.tan_theta * (scale.mu_s - scale.tan_theta)
    for number, one in enumerate(observations):
        motion = one.table_acceleration(scale.of_test(best, number)[3:])
        for part in runs_of(motion > 0.0):
            top = part.start + int(np.argmax(motion[part]))
            limit = (slope * motion[top] - scale.g * scale.mu_s) / scale.peak
            error = QUANTILE * slope * one.motion.spread(top) / scale.peak
            beyond = np.clip(
                [min(found[0], limit - error), max(found[1], limit + error)], LEAST[0], MOST[0]
            )
            found = np.where(np.abs(ends - limit) < error, beyond, found)
    return found


def cycle_estimate(
    of_cycle: Callable[[Floats], Floats], parameters: Floats, free: list[int]
) -> tuple[Floats, Floats]:
    """Return Üy, λ, Δμ and standard errors from the samples of one cycle.

    Those that the samples do not determine are NaN.  `of_cycle` are the residuals of these samples;
    `parameters` are those of the whole test, from which the search begins.
    """
    start = parameters[free]

    def residuals(part: Floats) -> Floats:
        return of_cycle(_with(parameters, free, part))

    fit = least_squares(
        residuals,
        start,
        bounds=(-1e-9, 10.0 * start + 1.0),
        x_scale="jac",
        diff_step=1e-4,
        max_nfev=6,
    )
    none = np.full(3, np.nan)
    covariance = _covariance(fit.jac)
    if not np.isfinite(covariance).all():
        return none, none
    return _with(none, free, fit.x), _with(none, free, np.sqrt(np.diag(covariance)))


def _with(point: Floats, free: list[int], part: Floats | Sequence[float] | float) -> Floats:
    """A point with other values of some parameters."""
    point = point.copy()
    point[free] = part
    return point


def _covariance(slopes: Floats) -> Floats:
    """Covariance from derivatives of independent residuals, a column each; NaN of what none depends on."""
    sizes = np.sqrt(np.sum(slopes**2, axis=0))
    known = np.flatnonzero(sizes > 1e-3)
    covariance = np.full((sizes.size, sizes.size), np.nan)
    part = slopes[:, known] / sizes[known]
    inverse = np.linalg.pinv(part.T @ part, rcond=1e-12) / np.outer(sizes[known], sizes[known])
    covariance[np.ix_(known, known)] = inverse
    return covariance
