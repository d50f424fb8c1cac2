"""Üy, λ and Δμ from one or several tests: where to look, the best, and the intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import least_squares

from slipsweep.studies.confidence import LEAST, MOST, SQUARE, Search
from slipsweep.studies.datasets import sweep
from slipsweep.studies.likelihood import COLUMN, SOUGHT, Linear, Observation

Floats = NDArray[np.float64]

#: Where the search begins: Üy in parts of the table's peak A, λA/g, ln(1 + Δμ/μs).
_ONSETS = (0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
_DECAYS = (0.25, 0.5, 1.0, 2.0, 4.0)
_EXCESS = (0.02, 0.1, 0.25)

#: Starts that are followed roughly, and those of them that are followed to the end.
_ROUGH, _FINE = 10, 4

#: A parameter is not determined if half its interval is more than this part of it; of Δμ, of μs + Δμ.
_UNDETERMINED = (0.5, 0.5, 0.3)

#: Most rounds in which the table's motion, the noise and the samples beside jumps settle.
_ROUNDS = 5


class Scale:
    """Scaled parameters of the search, and Üy, λ, Δμ."""

    def __init__(self, observations: Sequence[Observation]) -> None:
        self.peaks = [one.peak for one in observations]
        self.peak = max(self.peaks)
        self.mu_s, self.g = observations[0].mu_s, observations[0].model.g
        self.tan_theta = math.tan(math.radians(observations[0].theta))

    def parameters(self, point: Floats) -> Floats:
        """Üy, λ and Δμ."""
        return np.array([point[0] * self.peak, point[1] * self.g / self.peak, self.mu_s * math.expm1(point[2])])

    def slopes(self, point: Floats) -> Floats:
        """Derivatives of Üy, λ and Δμ by the scaled ones."""
        return np.array([self.peak, self.g / self.peak, self.mu_s * math.exp(point[2])])

    def branch(self, point: Floats) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The branch of each test, and its reading: what decides the block's acceleration.

        "continuous": Eq. 4 throughout.  "all": first Üy, later Eq. 4.  "crossing": Eq. 4, from where it crosses the
        table's acceleration on; Üy plays no part.  "constant": one value, either Üy ("held"), or that at the crossing
        ("crossed").
        """
        onset, decay, excess = point
        branches, readings = [], []
        for peak in self.peaks:
            table = np.linspace(0.0, 1.0, 65)[1:] * peak
            coupled = self.mu_s - self.tan_theta - self.mu_s * np.exp(excess - decay * table / self.peak)
            response = table - (self.g + table * self.tan_theta) * coupled - self.g * self.tan_theta
            limit = (onset * self.peak + self.g * self.mu_s) / (1.0 - self.tan_theta * (self.mu_s - self.tan_theta))
            above = table > onset * self.peak
            slides = above & (response < table)
            first = int(np.argmax(slides))
            crossed = bool(above[:first].any()) or not slides.any()
            begins = max(onset * self.peak, float(response[first]))
            if peak > limit:
                branch = reading = "continuous"
            elif not slides.any() or float(response[first:].max()) <= begins:
                branch, reading = "constant", "crossed" if crossed else "held"
            else:
                branch = reading = "crossing" if crossed else "all"
            branches.append(branch)
            readings.append(reading)
        return tuple(branches), tuple(readings)

    def crossing(self, onset: float, decay: float) -> float:
        """ln(1 + Δμ/μs) with which Eq. 4 crosses the table's acceleration at the part `onset` of its peak."""
        return self.following(onset, onset, decay)

    def following(self, table: float, block: float, decay: float) -> float:
        """ln(1 + Δμ/μs) with which Eq. 4 gives the block's acceleration for one of the table, in parts of the peak."""
        normal = self.g + table * self.peak * self.tan_theta
        behind = (table - block) * self.peak - self.g * self.tan_theta
        friction = self.mu_s - self.tan_theta - behind / normal
        return math.log(max(friction, 1e-3) / self.mu_s) + decay * table


@dataclass(frozen=True, eq=False)
class Estimate:
    """What one or several tests say of Üy, λ and Δμ.

    Attributes
    ----------
    parameters : ndarray
        The best.
    covariance : ndarray
        Of the linear fit; NaN of what no sample depends on.
    intervals : ndarray
        95 %, (3, 2); 0 and inf where the data set no bound.
    allowed : ndarray
        Parameters tried that the data allow, one set a row.
    readings : set of str
        What decides the block's acceleration for parameters that the data allow (`Scale.branch`), in any test.
    linears : list of Linear
        The likelihood of each test.
    observations : sequence of Observation
    """

    parameters: Floats
    covariance: Floats
    intervals: Floats
    allowed: Floats
    readings: set[str]
    linears: list[Linear]
    observations: Sequence[Observation]

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Which parameters the tests determine: half an interval is no more than a part of the value (of μs + Δμ)."""
        low, high = self.intervals.T
        sizes = np.abs(self.parameters + np.array([0.0, 0.0, self.observations[0].mu_s]))
        known = np.isfinite(high) & (high - low <= 2.0 * np.array(_UNDETERMINED) * sizes)
        known[0] &= low[0] > 0.0
        return np.asarray(known)

    @property
    def errors(self) -> Floats:
        """Standard errors; NaN of what is not determined."""
        return np.where(self.determined, np.sqrt(np.diag(self.covariance)), np.nan)

    @property
    def correlation(self) -> Floats:
        """Correlations of the parameters; NaN of what is not determined."""
        return np.asarray(self.covariance / np.outer(self.errors, self.errors))

    def summary(self, one: Observation, **more: Any) -> xr.Dataset:
        """The results of a sweep for the parameters found, and the table's motion of a test; `more` replaces them."""
        given = {**dict(zip(SOUGHT, map(float, self.parameters), strict=True)), **more}
        return sweep(one.theta, one.mu_s, excitation=one.record(one.wrong), model=one.model, **given)


def estimate(observations: Sequence[Observation]) -> Estimate:
    """Calibrate one or several tests of one interface."""
    scale = Scale(observations)
    best, others = _rough(observations, scale)
    for turn in range(_ROUNDS):
        linears = [one.linear(scale.parameters(best)) for one in observations]
        if turn == 0:
            for one, linear in zip(observations, linears, strict=True):
                one.take_noise(linear, scale.parameters(best))
                one.move(linear, scale.parameters(best))
            linears = [one.linear(scale.parameters(best)) for one in observations]
        search = _search(linears, scale)
        for start in (best, *others) if turn < 2 else (best,):
            search.polish(start)
        found = search.polish(search.best)
        settled = turn > 0 and search.square(best) - search.least < 0.1
        best, others = search.best, [*_branches(search, scale, found), *others] if turn == 0 else others
        for one, linear in zip(observations, linears, strict=True):
            one.take_noise(linear, scale.parameters(best))
            one.move(linear, scale.parameters(best))
        if settled:
            break
    linears = [one.linear(scale.parameters(best)) for one in observations]
    search = _search(linears, scale)
    for start in (best, *_branches(search, scale, best), *others):
        search.polish(start)
    return _with_intervals(search, scale, linears, observations)


def _search(linears: Sequence[Linear], scale: Scale) -> Search:
    return Search(lambda point: np.concatenate([one(scale.parameters(point)) for one in linears]), scale.branch)


def _rough(observations: Sequence[Observation], scale: Scale) -> tuple[Floats, list[Floats]]:
    """The best start, and others, by fits in which no sample counts for much and the table's record has no noise."""
    forwards = [one.forward() for one in observations]
    starts = [np.array([onset, decay, excess]) for onset in _ONSETS for decay in _DECAYS for excess in _EXCESS]
    for onset in _ONSETS:  # Eq. 4 crosses there
        for decay in _DECAYS:
            excess = scale.crossing(onset, decay)
            starts += [np.array([part * onset, decay, excess]) for part in (0.1, 0.6)]
        starts.append(np.array([onset, MOST[1], 0.0]))  # the yield value governs

    def far(point: Floats) -> float:
        parameters = scale.parameters(np.clip(point, LEAST, MOST))
        return sum(one.rough(forward, parameters) for one, forward in zip(observations, forwards, strict=True))

    starts = sorted((np.clip(one, LEAST, MOST) for one in starts), key=far)[:_ROUGH]
    search = _search([one.linear(scale.parameters(starts[0]), noisy=False) for one in observations], scale)
    found = sorted((search.polish(start, loss="soft_l1") for start in starts), key=far)
    return found[0], found[1:_FINE]


def _branches(search: Search, scale: Scale, best: Floats) -> list[Floats]:
    """Starts in which Üy holds the block, and in which Eq. 4 crosses the table's acceleration at the same value."""
    held = search.polish(np.array([best[0], MOST[1], 0.0]), free=(0,))
    held = min((held, search.polish(np.array([0.7, MOST[1], 0.0]), free=(0,))), key=search.square)
    starts = [held]
    for decay in _DECAYS:
        top = scale.following(1.0, min(1.05 * held[0], 0.99), decay)
        starts += [np.array([held[0], decay, top]), np.array([0.5 * held[0], decay, top])]
        starts += [np.array([part * held[0], decay, scale.crossing(held[0], decay)]) for part in (0.3, 0.9)]
    for start in starts:
        search.square(np.clip(start, LEAST, MOST))
    readings: dict[object, int] = {}
    for i in sorted(range(len(search.points)), key=lambda i: search.squares[i]):
        readings.setdefault(search.readings[i], i)
    return [search.points[i] for i in readings.values()]


def _with_intervals(
    search: Search, scale: Scale, linears: list[Linear], observations: Sequence[Observation]
) -> Estimate:
    """Follow the profiles; twice, so that what one parameter's profile found widens that of another."""
    best = search.best
    covariance = _covariance(search.slopes(best))
    width = 1.96 * np.sqrt(np.diag(covariance))
    width = np.where(np.isfinite(width), np.clip(width, 1e-5, 0.3), 0.1)
    ends: dict[tuple[int, int], tuple[float, bool]] = {}
    for _ in range(3):
        least = search.least
        for at in range(3):
            for side in (-1, 1):
                reached = search.allowed()[:, at]
                now = ends.get((at, side))
                if now is None or side * (reached.min() if side < 0 else reached.max()) > side * now[0] + 1e-9:
                    ends[at, side] = search.end(at, side, float(width[at]))
        if search.least > least - 0.02:
            break
        search.polish(search.best)
        ends.clear()
    intervals = np.empty((3, 2))
    for (at, side), (end, unbounded) in ends.items():
        point = np.zeros(3)
        point[at] = end
        value = scale.parameters(point)[at]
        intervals[at, (side + 1) // 2] = value if not unbounded else 0.0 if side < 0 else math.inf
    best = search.best
    slopes = scale.slopes(best)
    covariance = _covariance(search.slopes(best)) * np.outer(slopes, slopes)
    allowed = np.array([scale.parameters(one) for one in search.allowed()])
    readings = {name for i, names in enumerate(search.readings) if search.above(i) <= SQUARE for name in names}
    return Estimate(scale.parameters(best), covariance, intervals, allowed, readings, linears, observations)


def cycle_estimate(
    linear: Linear, found: Estimate, begin: float, end: float, free: Sequence[int]
) -> tuple[Floats, Floats]:
    """Parameters and standard errors from the samples between two times; NaN of what these do not determine.

    The block's displacement and velocity at the beginning are unknown.
    """
    times = np.concatenate([linear.times[use] for use, _ in linear.weights.values()])
    rows = (times >= begin) & (times < end)
    # what a displacement, and a velocity, at the beginning add to each channel
    starts = np.zeros((times.size, 2))
    for name, part in linear.by_channel(np.arange(times.size)).items():
        weight = linear.weights[name][1]
        if name == "relative_displacement":
            starts[part] = np.column_stack([weight, weight * (times[part] - begin)])
        elif name == "relative_velocity":
            starts[part, 1] = weight
    size = float(np.abs(linear.forward(found.parameters, linear.times)[:, COLUMN["relative_velocity"]]).max())
    effects = np.column_stack([(linear.left * linear.sizes) @ linear.right, starts * max(size, 1e-6)])[rows]
    left, sizes, _ = np.linalg.svd(effects, full_matrices=False)
    free = list(free)

    def residuals(part: Floats) -> Floats:
        values = found.parameters.copy()
        values[free] = part
        rest = linear.raw(values)[rows]
        return np.asarray(rest - left @ ((1.0 - 1.0 / np.sqrt(1.0 + sizes**2)) * (left.T @ rest)))

    start = found.parameters[free]
    fit = least_squares(residuals, start, bounds=(-1e-9, 10.0 * start + 1.0), x_scale="jac", diff_step=1e-4, max_nfev=6)
    values, errors = found.parameters.copy(), np.full(3, np.nan)
    covariance = _covariance(fit.jac)
    if not np.isfinite(covariance).all():
        return np.full(3, np.nan), errors
    values[free], errors[free] = fit.x, np.sqrt(np.diag(covariance))
    return np.where(np.isfinite(errors), values, np.nan), errors


def _covariance(slopes: Floats) -> Floats:
    """Covariance from derivatives of independent residuals, a column each; NaN of what none depends on."""
    sizes = np.sqrt(np.sum(slopes**2, axis=0))
    known = np.flatnonzero(sizes > 1e-3)
    covariance = np.full((sizes.size, sizes.size), np.nan)
    part = slopes[:, known] / sizes[known]
    inverse = np.linalg.pinv(part.T @ part, rcond=1e-12) / np.outer(sizes[known], sizes[known])
    covariance[np.ix_(known, known)] = inverse
    return covariance
