"""Integrals with the block's acceleration b held while the base's goes along a straight line, x(t) = x₀ + s t.

The relative velocity is then a parabola.  Derivations: docs/numerics.md#straight-pieces.
"""

import math

from slipsweep.jit.decorators import scalar


@scalar
def held_integrals(rate: float, slope: float, duration: float) -> tuple[float, float]:
    """Gains of velocity and displacement, ∫ (x − b) dt and its integral: `rate` is x − b at the beginning."""
    gained = (rate + 0.5 * slope * duration) * duration
    return gained, (0.5 * rate + slope * duration / 6.0) * duration * duration


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
