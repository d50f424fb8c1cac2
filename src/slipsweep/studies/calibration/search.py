"""Search of the least sum of squares, and of all points that the data allow.

A standard error does not describe a parameter that the data hardly determine.  So the interval of a
parameter is that of its profile likelihood, the union over the branches of the model
(`Scale.reading`), each compared with its own least (docs/calibration.md).
"""

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, least_squares

from slipsweep.studies.calibration.measured_friction import QUANTILE, Floats
from slipsweep.studies.calibration.scale import LEAST, MOST

#: What decides the block's acceleration, for each test (`Scale.reading`).
Readings = tuple[str, ...]

#: Rise of the sum of squares at the ends of a 95 % interval.
SQUARE = QUANTILE**2

#: A branch is refuted if its least sum of squares is higher than that of all by more than this.
REFUTED = 9.0

#: Up to this rise it may be refuted wrongly, as its residuals were linearised elsewhere.
_NARROWLY = 20.0

#: Most minima that are followed, and their least distance in Üy, in parts of the peak.
_MINIMA = 6
_APART = 0.004

#: A minimum whose sum of squares is higher by more than this cannot become the least.
_HOPELESS = 60.0

#: Minima at this distance in Üy, in parts of the peak, are several solutions.
_SEVERAL = 0.02


class Tried(NamedTuple):
    """A point that was tried, what decides the block's acceleration there, and the sum of squares.

    `branch` are the readings with "held" for "crossed", which have the same least.
    """

    point: Floats
    readings: Readings
    branch: Readings
    square: float


class Search:
    """A search over points: their residuals and readings, and all points that were tried."""

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
        """Return the residuals of a point, and note that it was tried."""
        rest = self._residuals(point)
        readings = self._readings(point)
        branch = tuple("held" if reading == "crossed" else reading for reading in readings)
        self.tried.append(Tried(np.array(point), readings, branch, float(rest @ rest)))
        self._least[branch] = min(self.tried[-1].square, self._least.get(branch, math.inf))
        return rest

    def at(self, point: Floats) -> Tried:
        """Try a point."""
        self.residuals(point)
        return self.tried[-1]

    def square(self, point: Floats) -> float:
        """Return the sum of squares of a point."""
        return self.at(point).square

    @property
    def least(self) -> float:
        """Least sum of squares."""
        return min(self._least.values())

    @property
    def best(self) -> Floats:
        """Point of the least sum of squares."""
        return min(self.tried, key=lambda tried: tried.square).point

    def above(self, tried: Tried) -> float:
        """Return the sum of squares of a point above the least of its branch.

        It is infinite if the branch is refuted.
        """
        least = self._least[tried.branch]
        return tried.square - least if least - self.least <= REFUTED else math.inf

    def allowed(self) -> list[Tried]:
        """Return the points that the data allow at 95 %."""
        return [tried for tried in self.tried if self.above(tried) <= SQUARE]

    def outermost(self, side: int) -> Floats:
        """Return the allowed point of least (`side` −1) or largest (1) Üy."""
        return max((tried.point for tried in self.allowed()), key=lambda point: side * point[0])

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
        return min(tried.square for tried in self.tried)

    def adopt(self, other: "Search") -> None:
        """Compare with the least of each branch that another search has found, too."""
        for branch, square in other._least.items():
            self._least[branch] = min(square, self._least.get(branch, math.inf))

    def leaders(self) -> list[Floats]:
        """Return the best point of each reading, the best of all first."""
        best: dict[Readings, Floats] = {}
        for number in np.argsort([tried.square for tried in self.tried]):
            best.setdefault(self.tried[number].readings, self.tried[number].point)
        return list(best.values())

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
        fit = least_squares(
            lambda part: self.residuals(with_values(start, free, part)),
            np.clip(start[free], low + 1e-9, high - 1e-9),
            bounds=(low, high),
            diff_step=1e-6,
            max_nfev=most,
            loss=loss,
            f_scale=3.0,
            ftol=1e-6,
            xtol=1e-7,
        )
        return with_values(start, free, fit.x)

    def follow(self, start: Floats) -> None:
        """Find the minimum that a start leads to."""
        first = len(self.tried)
        self.polish(start)
        self.minima.append(min(self.tried[first:], key=lambda tried: tried.square))

    def candidates(self) -> list[Floats]:
        """Return the best point of each reading, the best of all first, and other minima."""
        points = self.leaders()[:_MINIMA]
        for minimum in sorted(self.minima, key=lambda tried: tried.square):
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
                with_values(low, [0], part * low[0] + (1.0 - part) * high[0])
                for part in (0.3, 0.5, 0.7)
            ]
            others = [*range(1, low.size)]
            tried = [self.at(self.polish(point, others, most=6)) for point in between]
            if max(map(self.above, tried)) > SQUARE:
                onsets += [low[0], high[0]]
        return sorted(set(onsets))

    def slopes(self, point: Floats) -> Floats:
        """Return the derivatives of the residuals by the parameters, a column each."""
        columns = []
        for at, step in enumerate(1e-5 * np.eye(point.size)):
            low = np.clip(point - step, *self._bounds)
            high = np.clip(point + step, *self._bounds)
            columns.append((self.residuals(high) - self.residuals(low)) / (high - low)[at])
        return np.column_stack(columns)

    def intervals(self, widths: Floats) -> Floats:
        """Return 95 % intervals, (parameters, 2), from first guesses of half their widths.

        An end is a bound of the search where the data set no bound.
        """
        for _ in range(3):
            least = self.least
            ends = np.array(
                [[self.end(at, side, float(widths[at])) for side in (-1, 1)] for at in range(3)]
            )
            if self.least > least - 0.02:
                break
            self.polish(self.best)
        # what the profile of one parameter passed through may lie beyond the end of another's
        every = np.vstack([ends.T, [tried.point[:3] for tried in self.allowed()]])
        return np.column_stack([every.min(axis=0), every.max(axis=0)])

    def end(self, at: int, side: int, width: float) -> float:
        """Return the lower (`side` −1) or upper (1) end of the interval of one parameter.

        It is the bound of the search where the data set no bound.

        The profile of each reading is followed from the outermost point known, by `width` at first.
        """
        outermost: dict[Readings, Floats] = {}
        for tried in self.allowed():
            point = outermost.setdefault(tried.readings, tried.point)
            if side * tried.point[at] > side * point[at]:
                outermost[tried.readings] = tried.point
        return max(
            (self._followed(at, side, width, point) for point in outermost.values()),
            key=lambda end: side * end,
        )

    def _followed(self, at: int, side: int, width: float, start: Floats) -> float:
        """Return the end of a profile, followed from a point that the data allow."""
        slopes = self.slopes(start)
        others = [number for number in range(start.size) if number != at]
        direction = np.eye(start.size)[at]
        direction[others] = -np.linalg.lstsq(slopes[:, others], slopes[:, at], rcond=1e-8)[0]
        path = {float(start[at]): start}

        @functools.cache
        def beyond(value: float) -> float:
            """Return the root of the least rise of the sum of squares, less that at an end."""
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
        """Return the point of least sum of squares with one parameter held, and its rise.

        The search begins at a point near, and along a direction from it.
        """
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
            *(
                near + change * np.resize(part + [0.0] * (near.size - 3), near.size)
                for part in kept
            ),
        ]
        first = len(self.tried)
        for start in starts:
            self.residuals(with_values(np.clip(start, *self._bounds), [at], value))
        held = sorted(self.tried[first:], key=lambda tried: tried.square)
        if min(map(self.above, held)) > SQUARE:
            others = [number for number in range(near.size) if number != at]
            for tried in held[:2]:
                self.residuals(self.polish(tried.point, others, most=6))
        best = min(self.tried[first:], key=self.above)
        return best.point, self.above(best)


def with_values(point: Floats, free: list[int], part: Floats | Sequence[float] | float) -> Floats:
    """Return a point with other values of some parameters."""
    point = point.copy()
    point[free] = part
    return point


def covariance(slopes: Floats) -> Floats:
    """Return the covariance of parameters from derivatives of independent residuals.

    `slopes` has a column for each parameter.  Rows and columns of parameters that no residual
    depends on are NaN.
    """
    sizes = np.sqrt(np.sum(slopes**2, axis=0))
    determined = np.flatnonzero(sizes > 1e-3)
    covariances = np.full((sizes.size, sizes.size), np.nan)
    part = slopes[:, determined] / sizes[determined]
    scales = np.outer(sizes[determined], sizes[determined])
    covariances[np.ix_(determined, determined)] = (
        np.linalg.pinv(part.T @ part, rcond=1e-12) / scales
    )
    return covariances
