"""One step: the polynomial of a rule through the rate of V, its integrals, and the stop within it.

docs/numerics.md#step-solver
"""

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.events import root_of
from slipsweep.kernels.pulse import (
    DISPLACEMENT,
    LEAST,
    PEAK,
    SLIDES,
    VELOCITY,
)

RECTANGLE, TRAPEZOID, SIMPSON = 0, 1, 2


def coefficients_of(rule: int, start: float, middle: float, end: float) -> tuple[float, float, float]:
    """c0, c1, c2 of the rate c0 + c1 s + c2 s², s in [0, 1] over the step."""
    if rule == RECTANGLE:
        return start, 0.0, 0.0
    if rule == TRAPEZOID:
        return start, end - start, 0.0
    return start, 4.0 * middle - 3.0 * start - end, 2.0 * (start + end) - 4.0 * middle


def velocity_gain_of(c0: float, c1: float, c2: float, h: float, s: float) -> float:
    """∫ of the rate from 0 to s, over a step of phase h."""
    return h * s * (c0 + s * (0.5 * c1 + s * c2 / 3.0))


def displacement_gain_of(c0: float, c1: float, c2: float, h: float, s: float) -> float:
    """∫∫ of the rate from 0 to s, over a step of phase h."""
    return h * h * s * s * (0.5 * c0 + s * (c1 / 6.0 + s * c2 / 12.0))


#: The same in kernels; the table of steps takes them as they are, for arrays.
coefficients = in_lanes(coefficients_of)
velocity_gain = in_lanes(velocity_gain_of)
displacement_gain = in_lanes(displacement_gain_of)


@scalar
def _lost(where: tuple[float, float, float, float, float], s: float) -> tuple[float, float]:
    """−V at the fraction s of a step, and its rate."""
    velocity, c0, c1, c2, h = where
    return -(velocity + velocity_gain(c0, c1, c2, h, s)), -h * (c0 + s * (c1 + s * c2))


_stop_root = root_of(_lost)


@scalar
def stop(velocity: float, c0: float, c1: float, c2: float, h: float) -> float:
    """Fraction of the step at which V, zero or less at its end, reaches zero."""
    s = velocity / (velocity - velocity_gain(c0, c1, c2, h, 1.0)) if velocity > 0.0 else 1.0
    return _stop_root((velocity, c0, c1, c2, h), 0.0, 1.0, s, 0.0)


@scalar
def take(c0: float, c1: float, c2: float, h: float, stops: bool, state: np.ndarray) -> float:
    """Take a step of phase h, up to the stop if V may not fall below zero; the fraction taken."""
    velocity = state[VELOCITY]
    fraction = 1.0
    after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
    if stops and (after < 0.0 or (after == 0.0 and velocity > 0.0)):
        fraction = stop(velocity, c0, c1, c2, h)
        after = 0.0
        state[SLIDES] = 0.0
    if c0 > 0.0 and c0 + c1 + c2 < 0.0:
        # V is largest where the rate vanishes: the secant, then Newton
        turn = -c0 / (c1 + c2)
        for _ in range(3):
            turn -= (c0 + turn * (c1 + turn * c2)) / (c1 + 2.0 * turn * c2)
        turn = min(max(turn, 0.0), fraction)
        state[PEAK] = max(state[PEAK], velocity + velocity_gain(c0, c1, c2, h, turn))
    state[DISPLACEMENT] += velocity * h * fraction + displacement_gain(c0, c1, c2, h, fraction)
    state[VELOCITY] = after
    state[PEAK] = max(state[PEAK], after)
    state[LEAST] = min(state[LEAST], after)
    return fraction
