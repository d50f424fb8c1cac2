"""Noise of sensors: its size, the steps of converters, its colour, and channels at the end of their range.

Coloured noise is taken as noise of first order (an autoregressive process): errors of samples at
the distance Δt have the correlation ρ^(Δt/h), with ρ of neighbours and h the interval of sampling.
Such errors are made independent by subtracting from each what its neighbour says of it.
"""

import numpy as np
from scipy import ndimage

from slipsweep.studies.friction import Floats, noise_of

#: The least noise that a channel is taken to have, in parts of its largest value: neither a spline
#: through samples nor a sensor is better.
LEAST_NOISE = 1e-4

#: Correlations of neighbours below this many standard errors are chance; none is larger than that.
_NO_CHANCE = 4.0
MOST_COLOUR = 0.98

#: Distances in samples at which residuals are looked at, and the standard deviation of normal noise
#: over that by its median, at most.
_LAGS = 10
_TAILS = 1.25

#: A flat top has so many equal values in turn at least, and so many in all.
_IN_TURN = 3
_FLAT = 4

#: Steps of a converter, and standard deviations of the noise, within which a crest that is only
#: rounded has several times as many values as are equal to the largest, and a clipped one few.
_STEPS = 24.0
_NOISES = 1.5


def converter_noise(values: Floats) -> float:
    """Return the least noise of digitised values, 1.6 times that of rounding.

    Errors of a converter repeat from cycle to cycle and average out less than noise.
    """
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return 1.6 * float(steps.min()) / 12.0**0.5 if steps.size else 0.0


def distances(times: Floats) -> Floats:
    """Return the distance of each sample to the one before, in intervals of sampling; inf of the first."""
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


def colour_of(values: Floats, apart: Floats) -> float:
    """Return the correlation of neighbours in noise; 0 where it may be chance.

    `apart` are the `distances` of the samples.
    """
    near = apart[1:] < 1.5
    before = values[:-1][near]
    after = values[1:][near]
    size = float(np.sqrt(np.sum(before**2) * np.sum(after**2)))
    if before.size < 8 or size == 0.0:
        return 0.0
    correlation = float(np.sum(before * after)) / size
    is_chance = correlation < _NO_CHANCE / before.size**0.5
    return 0.0 if is_chance else min(correlation, MOST_COLOUR)


def is_first_order(innovations: Floats) -> bool:
    """Return whether residuals less what their neighbours say of them are independent and normal.

    Those of a motion that a model misses are not: they are smooth, or few of them are large; and
    where white noise is added to that, they alternate.
    """
    centred = innovations - innovations.mean()
    square = float(np.sum(centred**2))
    limit = _NO_CHANCE / centred.size**0.5
    lags = range(1, min(_LAGS, centred.size // 4) + 1)
    correlations = [float(centred[lag:] @ centred[:-lag]) / square for lag in lags]
    typical = 1.4826 * float(np.median(np.abs(centred)))
    tails = (square / centred.size) ** 0.5 / max(typical, 1e-300)
    return max(map(abs, correlations)) < limit and tails < _TAILS


def flat_top(values: Floats) -> int:
    """Return how many samples of a clipped channel lie at the end of its range, its largest value; else 0.

    The crest of a motion is a parabola, which has five times as many samples within 25 steps of a
    converter as within one.  A clipped crest has few beside its flat top.
    """
    finite = values[np.isfinite(values)]
    top = float(np.max(finite))
    rounding = 1e-12 * float(np.ptp(finite))
    runs = ndimage.label(finite >= top - rounding)[0]
    lengths = np.bincount(runs)[1:]
    flat = int(np.sum(lengths[lengths >= _IN_TURN]))
    steps = np.diff(np.unique(finite))
    steps = steps[steps > rounding]
    if flat < _FLAT or not steps.size:
        return 0
    band = max(_STEPS * float(steps.min()), _NOISES * noise_of(values))
    beside = int(np.sum((finite < top - rounding) & (finite > top - band)))
    return flat if flat > beside else 0
