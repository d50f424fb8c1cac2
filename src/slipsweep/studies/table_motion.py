"""The motion of a shaking table behind its noisy record: a cubic spline by least squares, and how sure it is.

A block integrates the table's acceleration, and its own acceleration rises with the largest that the table
reached: noise taken for motion would shift both.  The spline has as many coefficients as Akaike's criterion, with
its correction for few samples, asks for: few under a smooth motion, many under a sharp one or without noise.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicSpline
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

from slipsweep.motion.records import Record
from slipsweep.studies.friction import noise_of

Floats = NDArray[np.float64]

DEGREE = 3

#: Splines with a kink at various places, and how likely each is.
_Kink = list[tuple[float, BSpline]]

#: Samples a coefficient that are tried.
_SPACINGS = (48, 32, 24, 20, 16, 12, 10, 8, 6, 5, 4, 3, 2)

#: Points at which a spline is handed to the solver, in each interval of its knots: straight lines between them are
#: wrong by 5e-4 of the peak or less where a cycle has 12 intervals.
_POINTS = 8

#: Most ways in which a motion may be wrong; each costs a solution.
MOST_SHAPES = 150

#: Standard deviations of the noise with which the shaking has begun, and half samples before it where a kink may lie.
_MOVES, _KINK_SAMPLES = 5.0, 24

#: Ways in which a motion may be wrong as the place of a kink is not known.
_KINK_WAYS = 4

#: Noise, in parts of the largest acceleration, below which a record is taken as it is.
LITTLE_NOISE = 1e-3


@dataclass(frozen=True, eq=False)
class TableMotion:
    """A table's motion with its uncertainty.

    Attributes
    ----------
    times : ndarray
        Where `acceleration` and `shapes` are given, s; the motion is linear between them.
    acceleration : ndarray
        m/s².
    shapes : ndarray
        Ways in which it may be wrong, each of one standard deviation, independent of each other; one a column.
    noise : float
        Standard deviation of the noise of the record, m/s².
    coefficients : int
        Of the spline.
    """

    times: Floats
    acceleration: Floats
    shapes: Floats
    noise: float
    coefficients: int
    _last: list[tuple[Floats, Record]] = field(default_factory=list, init=False, repr=False)

    def record(self, wrong: Floats) -> Record:
        """The motion as a record, wrong by so many standard deviations of each shape.

        The last one is kept, and with it its pieces: parameters are tried on one motion many times.
        """
        last = self._last[0] if self._last else None
        if last is None or not np.array_equal(last[0], wrong):
            last = wrong.copy(), Record(self.times, self.acceleration + self.shapes @ wrong)
            self._last[:] = [last]
        return last[1]

    def with_line(self, line: Floats, deviation: float) -> "TableMotion":
        """One more way to be wrong: a line (given at `times`), whose standard deviation is known so far."""
        return replace(self, shapes=np.column_stack([self.shapes, deviation * line]))


def _knots(times: Floats, spacing: int) -> Floats:
    """Knots that have about so many samples between each other, however these are spaced."""
    count = max(times.size // spacing, 1)
    inner = np.interp(np.linspace(0, times.size - 1, count + 1), np.arange(times.size), times)
    return np.concatenate([np.repeat(times[0], DEGREE), inner, np.repeat(times[-1], DEGREE)])


def table_motion(times: Floats, acceleration: Floats) -> TableMotion:
    """The motion behind a record of a table's acceleration."""
    peak, size = float(np.abs(acceleration).max()), times.size
    if noise_of(acceleration) <= LITTLE_NOISE * peak:
        smooth = CubicSpline(times, acceleration)
        fine = _points(times, 4)
        return TableMotion(fine, np.asarray(smooth(fine)), np.zeros((fine.size, 0)), 0.0, size)
    best = np.inf
    for spacing in _SPACINGS:
        knots = _knots(times, spacing)
        found, rest = _fitted(times, acceleration, knots)
        number = found.size
        if number + 2 >= size:
            break
        score = size * np.log(float(np.sum(rest**2)) / size) + 2.0 * number * size / (size - number - 1.0)
        if score < best:
            best, chosen = score, knots
    chosen, kinks = _with_kinks(times, acceleration, chosen)
    coefficients, rest = _fitted(times, acceleration, chosen)
    noise = float(np.sqrt(np.sum(rest**2) / (size - coefficients.size)))
    fine = np.unique(_points(np.unique(chosen), _POINTS))
    # of many coefficients only what is wrong over long times matters, which fewer can say
    coarse = chosen if coefficients.size <= MOST_SHAPES else _knots(times, -(-size // MOST_SHAPES))
    design = BSpline.design_matrix(times, coarse, DEGREE)
    root = cholesky((design.T @ design).toarray(), lower=True)
    shapes = noise * solve_triangular(root, BSpline.design_matrix(fine, coarse, DEGREE).toarray().T, lower=True).T
    average, ways = _of_kinks(kinks, fine)
    smooth = np.asarray(BSpline(chosen, coefficients, DEGREE)(fine)) + average
    return TableMotion(fine, smooth, np.column_stack([shapes, ways]), noise, coefficients.size)


def _fitted(times: Floats, acceleration: Floats, knots: Floats) -> tuple[Floats, Floats]:
    """Coefficients by least squares, and what they leave over."""
    design = BSpline.design_matrix(times, knots, DEGREE)
    found = np.asarray(cho_solve(cho_factor((design.T @ design).toarray()), design.T @ acceleration))
    return found, acceleration - design @ found


def _with_kinks(times: Floats, acceleration: Floats, knots: Floats) -> tuple[Floats, list[_Kink]]:
    """A kink where the shaking begins, and one where it ends, if the record asks for them, as a sine does.

    Beyond it the table is at rest, which one polynomial says if the record does not ask for more.
    """
    size = times.size
    moving = np.flatnonzero(np.abs(acceleration) > _MOVES * noise_of(acceleration))
    if not moving.size:
        return knots, []

    def fitted(tried: Floats) -> tuple[float, BSpline]:
        found, rest = _fitted(times, acceleration, tried)
        score = size * float(np.log(np.sum(rest**2) / size)) + 2.0 * found.size * size / (size - found.size - 1.0)
        return score, BSpline(tried, found, DEGREE)

    def kinked(place: float, end: int, rests: bool) -> Floats:
        at = float(np.interp(place, np.arange(size), times))
        beyond = (knots < at) & (knots > times[0]) if end == 0 else (knots > at) & (knots < times[-1])
        return np.sort(np.concatenate([knots[~(beyond & rests)], np.repeat(at, DEGREE)]))

    kinks: list[_Kink] = []
    for end, steps in ((0, -np.arange(_KINK_SAMPLES)), (-1, np.arange(_KINK_SAMPLES))):
        places = moving[end] + 0.5 * steps
        places = places[(places > 2) & (places < size - 3)]
        tried = [fitted(kinked(place, end, rests)) for rests in (False, True) for place in places]
        best = min(tried, key=lambda one: one[0], default=None)
        if best is None or best[0] >= fitted(knots)[0]:
            continue
        knots = best[1].t
        kinks.append([(float(np.exp(0.5 * (best[0] - score))), spline) for score, spline in tried])
    return knots, kinks


def _of_kinks(kinks: list[_Kink], fine: Floats) -> tuple[Floats, Floats]:
    """What is wrong as the places of kinks are not known: on average, and ways of one standard deviation each."""
    average, ways = np.zeros(fine.size), [np.zeros((fine.size, 0))]
    for kink in kinks:
        likely = np.array([weight for weight, _ in kink])
        best = max(kink, key=lambda one: one[0])[1](fine)
        likely /= likely.sum()
        apart = np.column_stack([spline(fine) - best for _, spline in kink])
        middle = apart @ likely
        average += middle
        left, sizes, _ = np.linalg.svd((apart - middle[:, None]) * np.sqrt(likely), full_matrices=False)
        ways.append((left * sizes)[:, :_KINK_WAYS])
    return average, np.column_stack(ways)


def _points(bounds: Floats, parts: int) -> Floats:
    """Each interval cut in so many parts."""
    return np.interp(np.arange((bounds.size - 1) * parts + 1) / parts, np.arange(bounds.size), bounds)
