"""Derivatives, places and integrals of Eq. 6, which the exact kernels need besides its value.

The stepping kernel (`kernels.step`) takes any law μ(Üg, v) and needs none of these.
"""

import math

import numpy as np

from slipsweep.jit.decorators import equation, registered
from slipsweep.jit.elementary import exp, log
from slipsweep.model import equations as eq


@registered
def exponential_derivatives(friction: float, decay_rate: float, g: float) -> tuple[float, float]:
    """Derivatives of Eq. 6 by |Üg|: −(λ/g) μ and (λ/g)² μ."""
    rate = decay_rate / g
    return -rate * friction, rate * rate * friction


@registered
def exponential_inflection(tan_theta: float, decay_rate: float, g: float) -> float:
    """Üg at which d²Ü/dÜg² of Eqs. 4 and 6 turns positive, (2 tan θ / λ − 1) g / tan θ.

    It is not positive where λ ≥ 2 tan θ.

    docs/numerics.md#slope-and-inflection
    """
    return (2.0 * tan_theta / decay_rate - 1.0) * g / tan_theta


@registered
def exponential_static_acceleration(
    mu_s: float, delta_mu: float, decay_rate: float, g: float
) -> float:
    """|Üg| at which Eq. 6 gives μs: (g/λ) ln((μs + Δμ)/μs)."""
    return g / decay_rate * log((mu_s + delta_mu) / mu_s)


@registered
def exponential_decay_length(decay_rate: float, g: float) -> float:
    """g/λ, over which μ of Eq. 6 falls to a part 1/e."""
    return g / decay_rate


#: From this z on the closed forms of the moments lose less than a digit.  Below it φ₃ is summed as
#: its power series, Σ (−z)^k / (k + 3)!.  From `_DECAYED` on e^(−z) is 0.
_SERIES_END = 2.0
_DECAYED = 708.0
_SERIES = np.array([1.0 / math.factorial(k + 3) for k in range(21)])


@equation
def moments_of_decay(z: float) -> tuple[float, float, float, float]:
    """∫ e^(−zw) times 1, 1 − w, w and w (1 − w) over w from 0 to 1, for z ≥ 0.

    The first two are φ₁ and φ₂ of exponential integrators at −z, and all follow from φ₃.  Below z =
    2 φ₃ is summed, and φₙ = 1/n! − z φₙ₊₁.  Above it the closed forms are used, which cancel at
    small z.
    """
    if z < _SERIES_END:
        third = 0.0
        for k in range(_SERIES.size - 1, -1, -1):
            third = _SERIES[k] - z * third
        early = 0.5 - z * third
        whole = 1.0 - z * early
        return whole, early, whole - early, early - 2.0 * third
    decayed = exp(-z) if z < _DECAYED else 0.0
    whole = (1.0 - decayed) / z
    early = (1.0 - whole) / z
    late = (whole - decayed) / z
    return whole, early, late, (early - late) / z


@registered
def exponential_moments(
    start: float, change: float, mu_s: float, delta_mu: float, decay_rate: float, g: float
) -> tuple[float, float, float, float]:
    """Moments of Eq. 6 along a straight line of |Üg|, from `start` by `change`.

    docs/numerics.md#straight-pieces.  The exponential is taken from the end where the friction is
    larger, so that its argument is never positive: nothing overflows, however large λ is.
    """
    largest = eq.friction_coefficient(min(start, start + change), mu_s, delta_mu, decay_rate, g)
    whole, larger, smaller, both = moments_of_decay(decay_rate / g * abs(change))
    early, late = (smaller, larger) if change < 0.0 else (larger, smaller)
    return largest * whole, largest * early, largest * late, largest * both
