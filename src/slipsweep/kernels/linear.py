"""The motion while the plane's acceleration goes along a straight line, x(t) = x₀ + s t.

What a recorded history, joined by straight lines, and a triangle or square wave are made of.
With the block's acceleration b held the relative velocity is a parabola; where it follows Eq. 4,
D = x − E(x) = ±[n (μs − tan θ − μ) + g tan θ] holds a constant, a term linear in t, and both times
an exponential, so that its integrals are closed forms, too.  No step is taken, no error but rounding.

All of them are gains from rest over a duration τ: ∫ D dt (velocity) and ∫ (τ − t) D dt (displacement).
"""

import math

from slipsweep.kernels.block import EVENT_TOLERANCE, Block, friction, slip
from slipsweep.kernels.jit import scalar

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
def follow_integrals(block: Block, x: float, slope: float, duration: float, side: float) -> tuple[float, float]:
    """Gains of velocity and displacement under Eq. 4 from plane acceleration x on.

    The piece must lie on one `side` (±1) of Üg = 0.  The exponential is taken from the end where
    the friction is larger, so that its argument is never positive: nothing overflows, however
    large λ is.
    """
    tan_theta, g = block.tan_theta, block.g
    kept = block.mu_s - tan_theta
    change = slope * duration
    n, n_change = g + tan_theta * x, tan_theta * change
    decays = side * slope >= 0.0  # |x| grows, the friction falls
    z = block.decay_rate / g * abs(change)
    largest = friction(block, x if decays else x + change)
    whole, early, late, both = exponential_moments(z)
    if not decays:
        early, late = late, early
    first = kept * (n + 0.5 * n_change) + g * tan_theta - largest * (n * whole + n_change * late)
    second = 0.5 * (kept * n + g * tan_theta) + kept * n_change / 6.0 - largest * (n * early + n_change * both)
    return side * first * duration, side * second * duration * duration


@scalar
def held_integrals(x: float, slope: float, held: float, duration: float) -> tuple[float, float]:
    """Gains of velocity and displacement with the block's acceleration held, from plane acceleration x on."""
    rate = x - held
    return (
        (rate + 0.5 * slope * duration) * duration,
        (0.5 * rate + slope * duration / 6.0) * duration * duration,
    )


@scalar
def held_stop(velocity: float, rate: float, slope: float) -> float:
    """When a velocity ≥ 0 whose rate is `rate` and changes by `slope` first falls to zero (infinity: never).

    The roots of v + rate t + slope t²/2, each taken from the form that does not cancel.
    """
    square = rate * rate - 2.0 * slope * velocity
    if rate > 0.0:
        return (rate + math.sqrt(square)) / -slope if slope < 0.0 else math.inf
    if square < 0.0:
        return math.inf
    fall = math.sqrt(square) - rate
    return 2.0 * velocity / fall if fall > 0.0 else math.inf


@scalar
def follow_stop(block: Block, x: float, slope: float, duration: float, velocity: float) -> float:
    """When, within `duration`, a velocity that falls under Eq. 4 (x > 0) is zero: Newton kept in its bracket."""
    low, high = 0.0, duration
    t = 0.5 * duration
    for _ in range(200):
        left = velocity + follow_integrals(block, x, slope, t, 1.0)[0]
        if left > 0.0:
            low = t
        else:
            high = t
        new = t - left / slip(block, x + slope * t)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        step = abs(new - t)
        t = new
        if step <= EVENT_TOLERANCE * t:
            break
    return t
