"""The best parameters and the set that the data allow, for likelihoods with several branches.

Where the yield acceleration governs, λ and Δμ may be nearly anything; where Eq. 4 crosses the table's
acceleration, Üy may.  A standard error describes neither.  An interval here is the profile likelihood's: all values
of a parameter for which some values of the others raise the sum of squares by less than the quantile of χ².

The branches have different numbers of parameters that matter, and the one with most always fits best.  So the sum of
squares is compared with the least of the same branch, for every branch that is not refuted by a much better one, and
the interval is the union over these branches.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]

#: A branch or a reading, a name for each test.
Names = tuple[str, ...]

#: Rise of the sum of squares at the ends of a 95 % interval.
SQUARE = 3.841

#: Bounds of the search: Üy over the table's peak A, λA/g, ln(1 + Δμ/μs).
LEAST, MOST = np.array([1e-4, 0.0, 0.0]), np.array([1.0, 20.0, 3.0])

_STEP = 1e-6

#: Most steps to an end, starts of a step that are followed, and when an end is known: between two roots of the sum of
#: squares so close, or two values.  What is further above is far beyond the end.
_MOST_STEPS, _FOLLOWED, _CLOSE, _ACCURACY, _FAR = 24, 2, 0.3, 1e-5, 30.0

#: Accelerations of the table, in parts of its peak, at which friction is kept as λ and Δμ change together.
_ALONG = np.linspace(0.1, 1.0, 10)

#: Rise of the least sum of squares by which a branch is refuted.
REFUTED = 9.0


class Search:
    """All parameters tried so far, with their sums of squares.

    Parameters
    ----------
    residuals : callable
        Independent residuals of scaled parameters (`LEAST`, `MOST`).
    branch : callable
        Of scaled parameters: the branch whose least sum of squares they are compared with, and the reading (a part of a
        branch with other flat directions).
    """

    def __init__(self, residuals: Callable[[Floats], Floats], branch: Callable[[Floats], tuple[Names, Names]]) -> None:
        self._residuals, self._branch = residuals, branch
        self.branches: list[Names] = []
        self.readings: list[Names] = []
        self._least: dict[Names, float] = {}
        self.points: list[Floats] = []
        self.squares: list[float] = []

    def residuals(self, point: Floats) -> Floats:
        """Residuals; the point is kept."""
        rest = self._residuals(point)
        self.points.append(np.array(point))
        self.squares.append(float(rest @ rest))
        branch, reading = self._branch(point)
        self.branches.append(branch)
        self.readings.append(reading)
        self._least[branch] = min(self.squares[-1], self._least.get(branch, math.inf))
        return rest

    def square(self, point: Floats) -> float:
        """Sum of squares; the point is kept."""
        self.residuals(point)
        return self.squares[-1]

    def above(self, number: int) -> float:
        """Sum of squares of a point kept above the least of its branch; infinite if the branch is refuted."""
        least = self._least[self.branches[number]]
        return self.squares[number] - least if least - self.least <= REFUTED else math.inf

    @property
    def best(self) -> Floats:
        """The best of all points."""
        return self.points[int(np.argmin(self.squares))]

    @property
    def least(self) -> float:
        """The least sum of squares."""
        return min(self._least.values())

    def polish(self, start: Floats, free: Sequence[int] = (0, 1, 2), most: int = 12, loss: str = "linear") -> Floats:
        """Least squares over some parameters, from a start; the point found."""
        free = list(free)

        def whole(part: Floats) -> Floats:
            point = np.array(start)
            point[free] = part
            return point

        low, high = LEAST[free], MOST[free]
        found = least_squares(
            lambda part: self.residuals(whole(part)),
            np.clip(start[free], low + 1e-9, high - 1e-9),
            bounds=(low, high),
            diff_step=_STEP,
            max_nfev=most,
            loss=loss,
            f_scale=3.0,
            ftol=1e-6,
            xtol=1e-7,
        )
        return whole(found.x)

    def allowed(self) -> Floats:
        """The points that the data allow, one a row."""
        return np.array([point for i, point in enumerate(self.points) if self.above(i) <= SQUARE])

    def slopes(self, point: Floats) -> Floats:
        """Derivatives of the residuals by the parameters, a column each."""
        columns = []
        for at in range(point.size):
            step = np.zeros(point.size)
            step[at] = 1e-5
            low, high = np.clip(point - step, LEAST, MOST), np.clip(point + step, LEAST, MOST)
            columns.append((self._residuals(high) - self._residuals(low)) / (high - low)[at])
        return np.column_stack(columns)

    def end(self, at: int, side: int, width: float) -> tuple[float, bool]:
        """The lower (`side` −1) or upper (1) end of the interval of one parameter, and whether it is unbounded.

        The profile is followed from the outermost point known of each reading.  `width` is a first guess of the end's
        distance from the best value.
        """
        outermost: dict[Names, int] = {}
        for i in range(len(self.points)):
            known = outermost.get(self.readings[i], i)
            if self.above(i) <= SQUARE and side * self.points[i][at] >= side * self.points[known][at]:
                outermost[self.readings[i]] = i
        found = (-math.inf, False)
        for i in sorted(outermost.values(), key=lambda i: -side * self.points[i][at]):
            value, unbounded = self._followed(at, side, width, i)
            found = max(found, (side * value, unbounded))
            if unbounded:
                break
        return side * found[0], found[1]

    def _followed(self, at: int, side: int, width: float, number: int) -> tuple[float, bool]:
        """The end of a profile, from a point that the data allow."""
        good, inner = self.points[number], self.above(number)
        limit = (LEAST, MOST)[side > 0][at]
        previous, bad, outer = good, None, math.inf
        step = width
        for _ in range(_MOST_STEPS):
            value = good[at] + side * step
            value = min(value, limit) if side > 0 else max(value, limit)
            trial, above = self._profiled(at, value, good, previous)
            if above <= SQUARE:
                if value == limit:
                    return float(limit), True
                previous, good, inner = good, trial, above
                step = 2.0 * step if bad is None else abs(bad - value)
            else:
                bad, outer = value, above
                step = abs(bad - good[at])
            if bad is None:
                continue
            part = (SQUARE**0.5 - inner**0.5) / (outer**0.5 - inner**0.5)
            if (outer < _FAR and outer**0.5 - inner**0.5 < _CLOSE) or step < _ACCURACY * abs(good[at]):
                break
            step *= float(np.clip(part, 0.1, 0.9)) if outer < _FAR else 0.5
        return float(good[at] + side * part * step), False

    def _profiled(self, at: int, value: float, good: Floats, previous: Floats) -> tuple[Floats, float]:
        """The least rise of the sum of squares with one parameter held, from the last two points of the profile."""
        starts = [good]
        if abs(good[at] - previous[at]) > 1e-12:
            starts.append(good + (value - good[at]) / (good[at] - previous[at]) * (good - previous))
        for table in _ALONG if at > 0 else ():  # the same friction at this acceleration of the table
            along = good.copy()
            along[3 - at] += (value - good[at]) * (table if at == 1 else 1.0 / table)
            starts.append(along)
        first = len(self.points)
        for start in starts:
            start = start.copy()
            start[at] = value
            self.square(np.clip(start, LEAST, MOST))
        tried = range(first, len(self.points))
        if min(map(self.above, tried)) > SQUARE:
            others = [one for one in range(good.size) if one != at]
            for number in sorted(tried, key=lambda i: self.squares[i])[:_FOLLOWED]:
                self.square(self.polish(self.points[number], others, most=6))
        held = [i for i in range(first, len(self.points)) if self.points[i][at] == value]
        best = min(held, key=self.above)
        return self.points[best], self.above(best)
