"""Integrals while the plane's acceleration goes along a straight line, x(t) = x₀ + s t.

With the block's acceleration b held the relative velocity is a parabola (`held_integrals`, `held_stop`).
Where it follows Eq. 4 the rate D = x − E(x) holds a constant, a term linear in t, and both times an
exponential, whose moments are closed forms, too (`exponential_moments`; `cycle.eq4.straight_lag` puts them
together).  No step is taken, no error but rounding.  Derivations: docs/numerics.md#straight-pieces.
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.jit.elementary import exp

#: From here on the moments' closed forms lose less than a digit; below, φ₃'s power series Σ (−z)^k / (k + 3)! is
#: summed.  From `_DECAYED` on e^(−z) is 0.
_SERIES_END, _DECAYED = 2.0, 708.0
_SERIES = np.array([1.0 / math.factorial(k + 3) for k in range(21)])


@in_lanes
def exponential_moments(z: float) -> tuple[float, float, float, float]:
    """∫ e^(−zw) times 1, 1 − w, w and w(1 − w) over w from 0 to 1, for z ≥ 0.

    The first two are φ₁ and φ₂ of exponential integrators at −z, and all follow from φ₃.  Below z = 2 that is
    summed, and φₙ = 1/n! − z φₙ₊₁; beyond by the closed forms, which cancel at small z.
    """
    # both without a branch, so that a loop over pieces becomes SIMD
    small, large = min(z, _SERIES_END), max(z, _SERIES_END)
    third = 0.0
    for k in range(_SERIES.size - 1, -1, -1):
        third = _SERIES[k] - small * third
    early = 0.5 - small * third
    whole = 1.0 - small * early
    decayed = exp(-large) if large < _DECAYED else 0.0
    all_over = (1.0 - decayed) / large
    before, after = (1.0 - all_over) / large, (all_over - decayed) / large
    if z < _SERIES_END:
        return whole, early, whole - early, early - 2.0 * third
    return all_over, before, after, (before - after) / large


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
            return math.inf if slope >= 0.0 else 0.0
        square = (rate / size) * (rate / size) - 2.0 * (slope / size) * (velocity / size)
    if rate > 0.0:
        return (rate + size * math.sqrt(square)) / -slope if slope < 0.0 else math.inf
    if square < 0.0:
        return math.inf
    fall = size * math.sqrt(square) - rate
    return 2.0 * velocity / fall if fall > 0.0 else math.inf
