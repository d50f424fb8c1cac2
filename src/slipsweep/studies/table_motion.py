"""The motion of a shaking table behind its noisy record: a least-squares spline, and how uncertain it is.

The block integrates the table's acceleration and its own acceleration rises with the largest that the table reached:
noise taken for motion would shift both.  Akaike's criterion (corrected for few samples) chooses the number of
coefficients: few under a smooth motion, many under a sharp one or without noise.  A kink is put where the shaking
begins and ends if the criterion asks for it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.linalg import cholesky, solve_triangular

Floats = NDArray[np.float64]

_DEGREE = 3

#: Samples for each coefficient that are tried.
_SPACINGS = (64, 48, 32, 24, 16, 12, 10, 8, 6, 5, 4, 3, 2)

#: Spacings by which the knots are closer than the criterion says: what a spline cannot follow is no noise, and enters
#: no interval.
_FINER = 2

#: Most coefficients whose uncertainty is followed; each costs a solution.
_MOST_SHAPES = 150

#: Multiples of the noise beyond which the table moves, and samples before that where a kink is tried.
_MOVES, _KINK_SAMPLES = 5.0, 12

#: Linear interpolation of the spline is wrong by this part of the noise at most, between these numbers of points.
_INTERPOLATION, _FEWEST_POINTS, _MOST_POINTS = 0.1, 4, 32

#: Multiple of the standard deviation of a converter's errors that is taken for their noise.
_CONVERTER = 1.6

#: Third differences of white noise have 20 times its variance; those of a motion that the sampling resolves are small.
_VARIANCE = 20.0


class TableMotion(NamedTuple):
    """A table's motion (s and m/s², linear between its points) with its uncertainty.

    `shapes` are independent errors that it may have, one a column, each of one standard deviation; `noise` is the
    standard deviation of the noise of the record, m/s².
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


def noise_of(values: Floats) -> float:
    """Standard deviation of the noise of evenly or nearly evenly sampled values: robust, from third differences."""
    differences = np.diff(values[np.isfinite(values)], 3) / _VARIANCE**0.5
    return float(1.4826 * np.median(np.abs(differences))) if differences.size else 0.0


def converter_noise(values: Floats) -> float:
    """The least noise of digitised values: errors of a converter repeat from cycle to cycle and average out less."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return _CONVERTER * float(steps.min(initial=np.inf)) / 12.0**0.5 if steps.size else 0.0


def runs_of(holds: NDArray[np.bool_]) -> list[slice]:
    """The runs of samples at which something holds."""
    return [part for (part,) in ndimage.find_objects(ndimage.label(holds)[0])]


def table_motion(times: Floats, acceleration: Floats) -> TableMotion:
    """The motion behind a record of a table's acceleration."""
    fits = [one for spacing in _SPACINGS if (one := _fitted(times, acceleration, _knots(times, spacing))) is not None]
    chosen = min(range(len(fits)), key=lambda at: fits[at].score)
    best, kinked = _with_kinks(times, acceleration, fits[min(chosen + _FINER, len(fits) - 1)])
    knots = best.spline.t
    bounds = np.unique(knots)
    curvature = np.abs(best.spline(times, nu=2)).max() * np.diff(bounds).max() ** 2 / 8.0
    parts = np.sqrt(curvature / max(_INTERPOLATION * best.noise, 1e-9 * float(np.abs(acceleration).max())))
    parts = int(np.clip(np.ceil(parts), _FEWEST_POINTS, _MOST_POINTS))
    fine = np.interp(np.arange((bounds.size - 1) * parts + 1) / parts, np.arange(bounds.size), bounds)
    # of many coefficients only what is wrong over long times matters, which fewer can say
    coarse = knots if knots.size <= _MOST_SHAPES else _knots(times, -(-times.size // _MOST_SHAPES))
    design = BSpline.design_matrix(times, coarse, _DEGREE)
    root = cholesky((design.T @ design).toarray() + 1e-9 * np.eye(design.shape[1]), lower=True)
    shapes = solve_triangular(root, BSpline.design_matrix(fine, coarse, _DEGREE).toarray().T, lower=True).T
    noise = max(best.noise, converter_noise(acceleration))
    smooth, errors = np.asarray(best.spline(fine)), [noise * shapes]
    for fits in kinked:
        # of a converter's noise only a part is seen as scatter
        off, error = _averaged(fits, fine, (best.noise / noise) ** 2)
        smooth = smooth + off
        errors.append(error)
    # chords of a curve lie on its hollow side: moved back by their mean distance, the integral is right; beside a kink
    # the curve bends only over the shorter of two intervals, which may be much the shorter
    width = np.minimum(np.diff(fine, prepend=-np.inf), np.diff(fine, append=np.inf))
    smooth = smooth - width**2 / 12.0 * best.spline(fine, nu=2)
    return TableMotion(fine, smooth, np.column_stack(errors), noise)


def _fitted(times: Floats, values: Floats, knots: Floats) -> _Fitted | None:
    """The spline on these knots; None where samples are too few for them."""
    size, number = times.size, knots.size - _DEGREE - 1
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


def _with_kinks(times: Floats, values: Floats, best: _Fitted) -> tuple[_Fitted, list[list[_Fitted]]]:
    """The spline with a kink where the shaking begins, and one where it ends, if these improve it, as for a sine.

    Beside it, for each kink, the splines with the kink at this and other places that are likely.
    """
    moving = np.flatnonzero(np.abs(values) > _MOVES * max(noise_of(values), 1e-6 * float(np.abs(values).max())))
    kinked: list[list[_Fitted]] = []
    for end, side in ((0, -1.0), (-1, 1.0)) if moving.size else ():
        places = moving[end] + side * 0.25 * np.arange(4 * _KINK_SAMPLES)
        places = places[(places > 2) & (places < times.size - 3)]
        knots, tried = best.spline.t, []
        for at in np.interp(places, np.arange(times.size), times):
            outside = (knots < at) & (knots > times[0]) if end == 0 else (knots > at) & (knots < times[-1])
            for kept in (knots, knots[~outside]):  # at rest outside, one polynomial is enough
                near = np.abs(kept - at) < 1e-9 * (times[-1] - times[0])
                tried.append(_fitted(times, values, np.sort(np.concatenate([kept[~near], np.repeat(at, _DEGREE)]))))
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
