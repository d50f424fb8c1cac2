"""Noise of sensors: its size, steps of converters, its colour, channels that are cut off.

Coloured noise is taken as noise of first order (an autoregressive process): errors of samples at
the distance Δt have the correlation ρ^(Δt/h), with ρ of neighbours and h the interval of sampling.
Such errors are made independent by subtracting from each the part that follows from the one before.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slipsweep.studies.calibration.measured_friction import Floats, noise_of

#: The least noise that a channel is taken to have, in parts of its largest value: neither a spline
#: through samples nor a sensor is better.
LEAST_NOISE = 1e-4

#: Standard deviation of normal noise over the median of its absolute values.
OF_MEDIAN = 1.4826

#: Correlations of neighbouring samples of the noise that are tried.
COLOURS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.93, 0.95, 0.98)

#: Noise is coloured if −2 ln of the likelihood is lower by at least this than for white noise.
NO_CHANCE = 8.0

#: Variances of the noise that are tried.
_VARIANCES = np.geomspace(0.01, 100.0, 81)

#: Innovations are independent if no correlation up to this distance, in samples, is larger than so
#: many standard errors.
_LAGS = 10
_CHANCE = 4.0

#: They are normal if their standard deviation is at most so many times that by the median.
_TAILS = 1.25

#: A flat top has at least so many equal values in turn, and so many in all.
_IN_TURN = 3
_FLAT = 4

#: Height of the band below the largest value in which a crest that is not clipped has several times
#: as many samples as at the largest value: in steps of the converter, and in standard deviations of
#: the noise; the larger counts.
_STEPS = 24.0
_NOISES = 1.5

#: A top is flat under noise if so many times as many samples lie within the first distance from the
#: largest value as between it and the second (in standard deviations of the noise), and at least so
#: many.
_TOP = 5.0
_BELOW = 13.0
_CROWDED = 2.5
_IN_TOP = 12


def converter_noise(values: Floats) -> float:
    """Return the least noise of digitised values, 1.6 times that of rounding.

    Errors of a converter repeat from cycle to cycle and average out less than noise.
    """
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return 1.6 * float(steps.min()) / 12.0**0.5 if steps.size else 0.0


def distances(times: Floats) -> Floats:
    """Return the distance of each sample to the one before; inf of the first.

    The unit is the interval of sampling.
    """
    intervals = np.diff(times)
    return np.append(np.inf, intervals / np.median(intervals))


def whitened(values: Floats, links: Floats) -> Floats:
    """Return values of unit variance made independent along the first axis.

    `links` are the correlations of each with the one before, 0 where there is none.
    """
    scale = 1.0 / np.sqrt(1.0 - links**2)
    shape = (-1,) + (1,) * (values.ndim - 1)
    result = values * scale.reshape(shape)
    result[1:] -= values[:-1] * (links * scale)[1:].reshape(shape)
    return result


def colour_of(rest: Floats, effects: Floats, apart: Floats) -> float:
    """Return the correlation of neighbouring samples of the noise, of largest likelihood.

    It is 0 where that may be chance.  `rest` are residuals, of which errors with the effects
    `effects`, a column each and of unit variance, are a part; `apart` are `distances`.
    """
    unlikely = [_unlikeliness(rest, effects, colour, apart) for colour in COLOURS]
    return most_likely_colour(unlikely, 0.0)


def most_likely_colour(unlikely: Sequence[float], allowance: float) -> float:
    """Return the largest of `COLOURS` whose −2 ln likelihood is within `allowance` of the least.

    It is 0 where white noise is hardly less likely than the best.
    """
    least = min(unlikely)
    if unlikely[0] < least + NO_CHANCE:
        return 0.0
    return max(
        colour
        for colour, score in zip(COLOURS, unlikely, strict=True)
        if score <= least + allowance
    )


def _unlikeliness(rest: Floats, effects: Floats, colour: float, apart: Floats) -> float:
    """Return −2 ln of the largest likelihood of residuals with noise of any size."""
    links = colour**apart
    independent = whitened(rest, links)
    errors = whitened(effects, links)
    squares, vectors = np.linalg.eigh(errors.T @ errors)
    matter = squares > 1e-4
    along = vectors[:, matter].T @ (errors.T @ independent) / np.sqrt(squares[matter])
    outside = max(float(independent @ independent - along @ along), 0.0)
    variances = squares[matter] + _VARIANCES[:, None]
    scores = (
        (rest.size - along.size) * np.log(_VARIANCES)
        + outside / _VARIANCES
        + np.sum(np.log(variances) + along**2 / variances, axis=1)
    )
    return float(np.min(scores) + np.sum(np.log(1.0 - links**2)))


def is_first_order(innovations: Floats) -> bool:
    """Return True if innovations are independent and normal.

    Innovations are residuals less the part that follows from the residual before (`whitened`).
    Those of a motion that the model does not have are smooth, or few of them are large; with white
    noise in addition they alternate.
    """
    centred = innovations - innovations.mean()
    square = float(np.sum(centred**2))
    limit = _CHANCE / centred.size**0.5
    lags = range(1, min(_LAGS, centred.size // 4) + 1)
    correlations = [float(centred[lag:] @ centred[:-lag]) / square for lag in lags]
    typical = OF_MEDIAN * float(np.median(np.abs(centred)))
    tails = (square / centred.size) ** 0.5 / max(typical, 1e-300)
    return bool(max(map(abs, correlations)) < limit and tails < _TAILS)


def flat_top(values: Floats) -> int:
    """Return the number of samples at the largest value of a clipped channel; else 0.

    The crest of a motion is a parabola, which has five times as many samples within 25 steps of a
    converter as within one.  A clipped crest has few beside its flat top.
    """
    finite = values[np.isfinite(values)]
    top = float(np.max(finite))
    rounding = 1e-12 * float(np.ptp(finite))
    flat = _in_runs(finite >= top - rounding)
    steps = np.diff(np.unique(finite))
    steps = steps[steps > rounding]
    if flat < _FLAT or not steps.size:
        return 0
    band = max(_STEPS * float(steps.min()), _NOISES * noise_of(values))
    beside = int(np.sum((finite < top - rounding) & (finite > top - band)))
    return flat if flat > beside else 0


def _in_runs(holds: NDArray[np.bool_]) -> int:
    """Return the number of samples in runs of three or more at which `holds` is True."""
    lengths = np.bincount(ndimage.label(holds)[0])[1:]
    return int(np.sum(lengths[lengths >= _IN_TURN]))


def noisy_flat_top(values: Floats) -> int:
    """Return the number of samples in a flat top under noise; else 0.

    A parabola has about as many samples within 5 standard deviations of the noise of the largest
    value as within the next 8; a top that was cut off before the noise was added has many more.
    """
    noise = max(noise_of(values), converter_noise(values))
    depth = float(np.max(values)) - values
    top = _in_runs(depth < _TOP * noise)
    below = int(np.sum((depth >= _TOP * noise) & (depth < _BELOW * noise)))
    return top if top >= _IN_TOP and top > _CROWDED * below else 0
