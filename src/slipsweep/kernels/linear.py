"""Integrals while the plane's acceleration goes along a straight line, x(t) = x₀ + s t.

With the block's acceleration b held the relative velocity is a parabola (`held_integrals`, `held_stop`).
Where it follows Eq. 4 the rate D = x − E(x) holds a constant, a term linear in t, and both times an
exponential, whose moments are closed forms, too (`exponential_moments`; `cycle.eq4.straight_lag` puts them
together).  No step is taken, no error but rounding.  Derivations: docs/numerics.md#straight-pieces.
"""

import math

from slipsweep.jit.decorators import scalar

#: From here on the moments' closed forms lose less than a digit; below, their power series is summed.
_SERIES_END = 2.0
_SERIES_TERMS = 24


@scalar
def exponential_moments(z: float) -> tuple[float, float, float, float]:
    """∫ e^(−zw) times 1, 1 − w, w and w(1 − w) over w from 0 to 1, for z ≥ 0.

    The first two are φ₁ and φ₂ of exponential integrators at −z.  Below z = 2 by their power
    series Σ (−z)^k/k! B(k), beyond by the closed forms, which cancel at small z.
    """
    if z < _SERIES_END:
        whole, early, late, both = 0.0, 0.0, 0.0, 0.0
        term = 1.0
        for k in range(_SERIES_TERMS):
            whole += term / (k + 1.0)
            early += term / ((k + 1.0) * (k + 2.0))
            late += term / (k + 2.0)
            both += term / ((k + 2.0) * (k + 3.0))
            term *= -z / (k + 1.0)
        return whole, early, late, both
    decayed = math.exp(-z)
    square = z * z
    return (
        (1.0 - decayed) / z,
        (z - 1.0 + decayed) / square,
        (1.0 - (1.0 + z) * decayed) / square,
        (z - 2.0 + (z + 2.0) * decayed) / (square * z),
    )


@scalar
def held_integrals(rate: float, slope: float, duration: float) -> tuple[float, float]:
    """Gains of velocity and displacement with b held: `rate` is x − b at the beginning, `slope` its own rate."""
    return (
        (rate + 0.5 * slope * duration) * duration,
        (0.5 * rate + slope * duration / 6.0) * duration * duration,
    )


#: Squares of accelerations between this and its inverse keep their digits.
_LEAST_SQUARE = 1e-200


@scalar
def held_stop(velocity: float, rate: float, slope: float) -> float:
    """When a velocity ≥ 0 whose rate is `rate` and changes by `slope` first falls to zero (infinity: never).

    The roots of v + rate t + slope t²/2, each taken from the form that does not cancel.
    """
    size, square = 1.0, rate * rate - 2.0 * slope * velocity
    if not _LEAST_SQUARE < rate * rate + abs(slope) * velocity < 1.0 / _LEAST_SQUARE:
        # accelerations over their size: their squares are no doubles
        size = max(abs(rate), math.sqrt(abs(slope)) * math.sqrt(velocity))
        if size == 0.0:
            return math.inf
        square = (rate / size) * (rate / size) - 2.0 * (slope / size) * (velocity / size)
    if rate > 0.0:
        return (rate + size * math.sqrt(square)) / -slope if slope < 0.0 else math.inf
    if square < 0.0:
        return math.inf
    fall = size * math.sqrt(square) - rate
    return 2.0 * velocity / fall if fall > 0.0 else math.inf
