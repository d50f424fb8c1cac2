"""The motion of a table behind the record of its acceleration: a spline, and its errors.

Knots and the colour of the noise are chosen by Akaike's criterion.  docs/calibration.md says why it
is a spline, and why its knots are closer than by the criterion.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.linalg import block_diag, cho_solve_banded, cholesky, cholesky_banded, solve_triangular
from scipy.sparse import csr_array, diags_array, hstack

from slipsweep.studies.calibration.measured_friction import Floats, noise_of
from slipsweep.studies.calibration.noise import (
    COLOURS,
    LEAST_NOISE,
    colour_of,
    converter_noise,
    distances,
    most_likely_colour,
)

#: Degree of the spline.
_DEGREE = 3

#: Most coefficients whose uncertainty is followed; each takes a solution of the model.
_MOST_SHAPES = 150

#: Spacings of knots that are tried, in samples for each coefficient.
_SPACINGS = (64, 48, 32, 24, 16, 12, 10, 8, 6, 5, 4, 3, 2)

#: The knots are closer than by the criterion by so many of these spacings.  A motion that the
#: spline cannot follow would be taken for noise, but no interval would include its effect.
_FINER = 2

#: Spacing of knots, in samples, and most samples for the estimate of the colour of the noise.
_COLOUR_SPACING = 4
_MOST_SAMPLES = 1500

#: A slower noise is as likely if −2 ln of the likelihood is higher by at most this.
_AS_LIKELY = 4.0

#: Fewest samples at rest that show the colour of the noise.
_SHOWS_COLOUR = 50

#: Standard deviation of the level of a sensor at rest, in those of its noise: no bound, in effect.
_ANY_LEVEL = 1e3

#: Variances of the motion over that of the noise that are tried, for its fastest part.
_SIZES = np.geomspace(1e-14, 1e4, 91)

#: The table moves beyond so many times the noise, and beyond this part of its largest acceleration.
_MOVES = 5.0
_MOVES_PART = 0.03

#: Samples that show the level of the sensor at rest.
_AT_REST = 5

#: Samples before the motion where a kink is tried.
_KINK_SAMPLES = 12


class TableMotion(NamedTuple):
    """A table's motion (s and m/s², linear between its points) with its uncertainty.

    `basis` @ `errors` are independent errors that it may have, one a column, each of one standard
    deviation; few functions in `basis` differ from 0 at a point.  `noise` is the standard deviation
    of the noise of the record, m/s², and `colour` the correlation of neighbouring samples of it.
    The table is at rest until `begins`, s.  `rests` is True if it rests long enough to show the
    colour.
    """

    times: Floats
    acceleration: Floats
    basis: csr_array
    errors: Floats
    noise: float
    colour: float
    begins: float
    rests: bool

    def with_errors(self, sizes: Floats) -> Floats:
        """Return the acceleration with so many standard deviations of each error."""
        return np.asarray(self.acceleration + self.basis @ (self.errors @ sizes))

    def spread(self, at: int) -> float:
        """Return the standard deviation of the acceleration at a point."""
        return float(np.linalg.norm(self.basis[[at]] @ self.errors))


class _Record(NamedTuple):
    """Samples, and the correlations of the noise of each with that of the one before."""

    times: Floats
    values: Floats
    links: Floats
    colour: float

    def whitener(self) -> csr_array:
        """Return the matrix that makes the noise of the samples independent and keeps its size."""
        scale = 1.0 / np.sqrt(1.0 - self.links**2)
        return csr_array(diags_array([scale, -(self.links * scale)[1:]], offsets=[0, -1]))

    def design(self, knots: Floats) -> csr_array:
        """Return the B-splines at the samples, whitened."""
        splines = csr_array(BSpline.design_matrix(self.times, knots, _DEGREE))
        return splines if self.colour == 0.0 else csr_array(self.whitener() @ splines)


class _Kink(NamedTuple):
    """A place at which the slope of the table's acceleration jumps.

    `end` is 0 where the shaking begins, −1 where it ends; `at_rest` if one polynomial is enough
    outside.
    """

    time: float
    end: int
    at_rest: bool

    def put_into(self, knots: Floats) -> Floats:
        """Return knots with as many at the kink as the spline bends at."""
        outside = knots < self.time if self.end == 0 else knots > self.time
        inner = (knots > knots[0]) & (knots < knots[-1])
        near = np.abs(knots - self.time) < 1e-9 * (knots[-1] - knots[0])
        kept = knots[~(near | (outside & inner & self.at_rest))]
        return np.sort(np.append(kept, np.repeat(self.time, _DEGREE)))


class _Fitted(NamedTuple):
    """A spline, Akaike's and Schwarz's criteria for it, and the noise that it leaves."""

    spline: BSpline
    score: float
    schwarz: float
    noise: float


def table_motion(times: Floats, acceleration: Floats) -> TableMotion:
    """Return the motion behind a record of a table's acceleration."""
    record = _Record(times, acceleration, np.zeros(times.size), 0.0)
    best, kinked = _with_kinks(record, _best_fit(record))
    is_noisy = best.noise > LEAST_NOISE * np.abs(acceleration).max()
    kinks = [kink for kink, _ in kinked]
    at_rest = _at_rest(times, kinks)
    rests = bool(at_rest.sum() >= _SHOWS_COLOUR)
    colour = 0.0
    if is_noisy:
        by_rest = _colour_at_rest(times, acceleration, at_rest) if rests else 0.0
        colour = max(by_rest, _colour(times, acceleration, kinks))
    if colour > 0.0:
        record = _Record(times, acceleration, colour ** distances(times), colour)
        best, kinked = _with_kinks(record, _best_fit(record))
    knots = best.spline.t
    begins = next((kink.time for kink, _ in kinked if kink.end == 0), times[0])
    bounds = np.unique(best.spline.t)
    # 4 to 32 points between knots, so that straight lines between them are wrong by a tenth of the
    # noise at most
    curvature = np.abs(best.spline(times, nu=2)).max() * np.diff(bounds).max() ** 2 / 8.0
    noise = max(best.noise, converter_noise(acceleration), LEAST_NOISE * np.abs(acceleration).max())
    parts = int(np.clip(np.ceil(np.sqrt(curvature / (0.1 * noise))), 4, 32))
    fine = np.interp(
        np.arange((bounds.size - 1) * parts + 1) / parts, np.arange(bounds.size), bounds
    )
    # of many coefficients only slow errors matter, and fewer coefficients have these, too
    coarse = knots if knots.size <= _MOST_SHAPES else _knots(times, -(-times.size // _MOST_SHAPES))
    design = record.design(coarse)
    root = cholesky((design.T @ design).toarray() + 1e-9 * np.eye(design.shape[1]), lower=True)
    basis = [csr_array(BSpline.design_matrix(fine, coarse, _DEGREE))]
    errors = [noise * solve_triangular(root, np.eye(root.shape[0]), lower=True).T]
    smooth = np.asarray(best.spline(fine))
    for _, fits in kinked:
        # the scatter shows only a part of a converter's noise
        off, deviations = _averaged(fits, fine, (best.noise / noise) ** 2)
        smooth = smooth + off
        basis.append(csr_array(deviations))
        errors.append(np.eye(deviations.shape[1]))
    # straight lines between points of a curve lie on its concave side: they are moved back by their
    # mean distance, so that the integral is right.  Beside a kink, the shorter of two intervals
    # counts
    width = np.minimum(np.diff(fine, prepend=-np.inf), np.diff(fine, append=np.inf))
    smooth = smooth - width**2 / 12.0 * best.spline(fine, nu=2)
    return TableMotion(
        fine,
        smooth,
        csr_array(hstack(basis)),
        block_diag(*errors),
        noise,
        record.colour,
        begins,
        rests,
    )


def _best_fit(record: _Record) -> _Fitted:
    """Return a spline with knots closer than the best by Akaike's criterion."""
    fits = [
        fit
        for spacing in _SPACINGS
        if (fit := _fitted(record, _knots(record.times, spacing))) is not None
    ]
    chosen = min(range(len(fits)), key=lambda at: fits[at].score)
    return fits[min(chosen + _FINER, len(fits) - 1)]


def _at_rest(times: Floats, kinks: Sequence[_Kink]) -> NDArray[np.bool_]:
    """Return which samples are before the shaking begins or after it ends."""
    at_rest = np.zeros(times.size, dtype=bool)
    for kink in kinks:
        at_rest |= times < kink.time if kink.end == 0 else times > kink.time
    return at_rest


def _colour_at_rest(times: Floats, values: Floats, at_rest: NDArray[np.bool_]) -> float:
    """Return the colour of the noise by samples at rest, whose level may have an offset."""
    scatter = float(np.std(values[at_rest]))
    if scatter <= converter_noise(values):
        return 0.0
    level = np.full((int(at_rest.sum()), 1), _ANY_LEVEL)
    return colour_of(values[at_rest] / scatter, level, distances(times[at_rest]))


def _colour(times: Floats, values: Floats, kinks: Sequence[_Kink]) -> float:
    """Return the correlation of neighbouring samples of the noise, of largest likelihood.

    It is 0 if that may be chance.  Criteria for the number of knots would follow coloured noise.
    So the motion is taken as a process here, a spline whose third derivatives are independent
    between knots, and the likelihood of the samples, with its coefficients integrated out, is that
    of mixed linear models (restricted maximum likelihood): its size is sought with the colour and
    size of the noise.
    """
    part = slice(0, _MOST_SAMPLES)
    times, values = times[part], values[part]
    knots = _knots(times, _COLOUR_SPACING)
    free = _DEGREE
    for kink in kinks:
        if times[2] < kink.time < times[-3]:
            knots = kink.put_into(knots)
            free += _DEGREE - 1
    inner = np.unique(knots)
    third = (
        BSpline(knots, np.eye(knots.size - _DEGREE - 1), _DEGREE)(
            0.5 * (inner[1:] + inner[:-1]), nu=_DEGREE
        )
        * np.sqrt(np.diff(inner))[:, None]
    )
    apart = distances(times)
    unlikely = []
    for colour in COLOURS:
        record = _Record(times, values, colour**apart, colour)
        unlikely.append(_unlikeliness(record, record.design(knots).toarray(), third, free))
    # slow noise and a slow motion look the same: the most colour that the samples allow
    return most_likely_colour(unlikely, _AS_LIKELY)


def _unlikeliness(record: _Record, design: Floats, third: Floats, free: int) -> float:
    """Return −2 ln of the largest restricted likelihood of a record, but for a constant.

    `third` @ coefficients are the third derivatives, which are 0 for `free` combinations of these.
    """
    whitened = record.whitener() @ record.values
    root = cholesky(design.T @ design, lower=True)
    smooth = solve_triangular(root, third.T, lower=True)
    rough, vectors = np.linalg.eigh(smooth @ smooth.T)
    along = vectors.T @ solve_triangular(root, design.T @ whitened, lower=True)
    outside = float(whitened @ whitened - along @ along)
    # the penalty does not act on parabolas on either side of a kink
    rough = np.maximum(rough[free:], 1e-15 * rough[-1])
    size = whitened.size - free
    shares = 1.0 + rough[-1] * _SIZES[:, None] / rough
    variances = (outside + np.sum(along[free:] ** 2 / shares, axis=1)) / size
    scores = size * np.log(variances) + np.sum(np.log(shares), axis=1)
    return float(np.min(scores) + np.sum(np.log(1.0 - record.links**2)))


def _fitted(record: _Record, knots: Floats) -> _Fitted | None:
    """Return the spline on these knots; None where samples are too few for them."""
    times, values, links, colour = record
    size = times.size
    number = knots.size - _DEGREE - 1
    if number + 2 >= size:
        return None
    try:
        if colour == 0.0:
            spline = make_lsq_spline(times, values, knots, _DEGREE)
            rest = values - spline(times)
        else:
            spline = _coloured_spline(record, knots)
            rest = record.whitener() @ (values - spline(times))
    except (ValueError, np.linalg.LinAlgError):  # an interval of knots without a sample
        return None
    square = max(float(np.sum(rest**2)), 1e-24 * float(np.sum(values**2)))
    free = number + 1.0 * (colour > 0.0)
    unlikely = size * float(np.log(square / size)) + float(np.sum(np.log(1.0 - links**2)))
    akaike = unlikely + 2.0 * free * size / (size - free - 1.0)
    schwarz = unlikely + float(np.log(size)) * free
    return _Fitted(spline, akaike, schwarz, float(np.sqrt(square / (size - number))))


def _coloured_spline(record: _Record, knots: Floats) -> BSpline:
    """Return the spline of least squares under coloured noise."""
    design = record.design(knots)
    normal = design.T @ design
    # a sample and the one before lie in one interval of knots or in neighbours, with a kink between
    diagonals = [normal.diagonal(k) for k in range(2 * _DEGREE + 2)]
    banded = np.array([np.append(line, np.zeros(k)) for k, line in enumerate(diagonals)])
    right = design.T @ (record.whitener() @ record.values)
    return BSpline(knots, cho_solve_banded((cholesky_banded(banded, lower=True), True), right), 3)


def _knots(times: Floats, spacing: int) -> Floats:
    """Return knots that have about so many samples between each other, however these are spaced."""
    count = max(times.size // spacing, 1)
    inner = np.interp(np.linspace(0, times.size - 1, count + 1), np.arange(times.size), times)
    return np.concatenate([np.repeat(times[0], _DEGREE), inner, np.repeat(times[-1], _DEGREE)])


def _with_kinks(
    record: _Record, best: _Fitted
) -> tuple[_Fitted, list[tuple[_Kink, list[_Fitted]]]]:
    """Return the spline with kinks where the shaking begins and ends, if these improve it.

    Beside it the kinks, and for each the splines with the kink at this and other places that are
    likely.
    """
    times = record.times
    values = record.values
    noise = max(noise_of(values), best.noise * (record.colour > 0.0))
    beyond = max(_MOVES * noise, _MOVES_PART * float(np.abs(values).max()))
    kinked = []
    for end, side in ((0, -1.0), (-1, 1.0)):
        # a sensor with an offset does not rest at zero
        level = np.median(values[:_AT_REST] if end == 0 else values[-_AT_REST:])
        moving = np.flatnonzero(np.abs(values - level) > beyond)
        if not moving.size:
            continue
        places = moving[end] + side * 0.25 * np.arange(4 * _KINK_SAMPLES)
        places = places[(places > 2) & (places < times.size - 3)]
        kinks = [
            _Kink(time, end, at_rest)
            for time in np.interp(places, np.arange(times.size), times)
            for at_rest in (False, True)
        ]
        tried = [(kink, _fitted(record, kink.put_into(best.spline.t))) for kink in kinks]
        fits = [(kink, fit) for kink, fit in tried if fit is not None]
        kink, top = min(fits, key=lambda pair: pair[1].score, default=(None, best))
        if kink is not None and top.score < best.score:
            best = top
            kinked.append((kink, [fit for _, fit in fits if fit.score < top.score + 12.0]))
    return best, kinked


def _averaged(fits: list[_Fitted], fine: Floats, part: float) -> tuple[Floats, Floats]:
    """Return the likelihood-weighted deviation from the best spline, with standard errors."""
    best = min(fits, key=lambda fit: fit.score)
    likely = np.exp([0.5 * part * (best.score - fit.score) for fit in fits])
    likely /= likely.sum()
    apart = np.column_stack([fit.spline(fine) - best.spline(fine) for fit in fits])
    middle = apart @ likely
    left, sizes, _ = np.linalg.svd((apart - middle[:, None]) * np.sqrt(likely), full_matrices=False)
    return middle, (left * sizes)[:, :3]
