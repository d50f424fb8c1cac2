"""Roots in lanes: Newton's iteration of the lanes of a strip together, without a bracket.

Each starts on the side from which it cannot pass the root; a lane that has not ended is marked, and its cell remains.
Lanes are (LANES_SIZE,).  docs/numerics.md#lanes-of-the-sine
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    lane_rate_and_slope,
)
from slipsweep.kernels.events import STRIP
from slipsweep.kernels.sine.lanes import (
    HALF_PI,
    HELD,
    LEFT,
    LEVEL,
    ONSET,
    V,
)
from slipsweep.kernels.sine.shapes import fallen, fallen_integrals, half_wave

#: Relative size of a lane's last step.  A lane that has taken it stays where it is, whatever its neighbours do.
_LANE_TOLERANCE = 1e-7
_MOST_LANE_STEPS = 32

#: The roots: D = 0, E = b, the stop after the peak, that of a pulse entered in motion, and that after Üg = 0.
TURN, SWITCH, FALL_STOP, HELD_STOP, RECOUPLING = range(5)


@in_lanes
def held_motion(shape: int, amplitude: float, held: float, start: float, end: float) -> tuple[float, float]:
    """∫ (x − b) dψ and ∫ (end − ψ)(x − b) dψ for a held b, |ψ| ≤ π/2: gains of V and W from rest.

    docs/numerics.md#held-block-acceleration
    """
    width = end - start
    excess = amplitude - held
    before, before_moment = fallen_integrals(shape, start)
    after, after_moment = fallen_integrals(shape, end)
    first = excess * width - amplitude * (after - before)
    second = 0.5 * excess * width * width - amplitude * (after_moment - before_moment - before * width)
    return first, second


@in_lanes
def stopping_step(shape: int, amplitude: float, held: float, velocity: float, start: float, psi: float) -> float:
    """What Newton takes off ψ on the way to the stop of a hold that was entered with V = `velocity` at `start`."""
    left = velocity + held_motion(shape, amplitude, held, start, psi)[0]
    return left / (amplitude - held - amplitude * fallen(shape, psi))


@in_lanes
def lane_response_and_slope(lanes: np.ndarray, j: int, x: float, g: float) -> tuple[float, float]:
    """E and dE/dx of a lane (x > 0)."""
    rate, slope = lane_rate_and_slope(lanes, j, x, g)
    return x - rate, 1.0 - slope


@in_lanes
def _turn_step(lanes: np.ndarray, j: int, x: float, side: float, g: float) -> tuple[float, float, float]:
    """To D = 0, from the left, where a concave D converges, slowly where it starts flat; `side` is that of Üg = 0."""
    rate, slope = lane_rate_and_slope(lanes, j, side * x, g)
    step = side * (rate / slope)
    return x - step, step, min(x, lanes[AMPLITUDE + j] - x)


@in_lanes
def _switch_step(lanes: np.ndarray, j: int, x: float, side: float, g: float) -> tuple[float, float, float]:
    """To E = b, from the right, where a convex E converges."""
    eq4, slope = lane_response_and_slope(lanes, j, x, g)
    step = (eq4 - lanes[LEVEL + j]) / slope
    return x - step, step, min(x, lanes[AMPLITUDE + j] - x)


@in_lanes
def _fall_step(shape: int, lanes: np.ndarray, j: int, psi: float, side: float, g: float) -> tuple[float, float, float]:
    """To the stop after the peak."""
    step = stopping_step(shape, lanes[AMPLITUDE + j], lanes[HELD + j], lanes[V + j], 0.0, psi)
    return min(max(psi - step, 0.0), HALF_PI), step, psi


@in_lanes
def _held_step(shape: int, lanes: np.ndarray, j: int, psi: float, side: float, g: float) -> tuple[float, float, float]:
    """To the stop of a pulse entered in motion, from Üy on, where V falls ever more slowly; no further than t1."""
    began, onset = lanes[BEGAN + j], lanes[ONSET + j]
    step = stopping_step(shape, lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[V + j], began, psi)
    onward = min(max(psi - step, began), onset)
    return onward, step, math.inf if onward >= onset else onward - began


@in_lanes
def _recoupling_step(
    shape: int, lanes: np.ndarray, j: int, chi: float, side: float, g: float
) -> tuple[float, float, float]:
    """To the stop after Üg = 0."""
    amplitude, b = lanes[AMPLITUDE + j], lanes[HELD + j]
    wave, integral, _ = half_wave(shape, chi)
    step = (lanes[LEFT + j] - b * chi - amplitude * integral) / (b + amplitude * wave)
    return min(max(chi + step, 0.0), math.pi), step, chi


@in_lanes
def _step_to(
    root: int, shape: int, lanes: np.ndarray, j: int, at: float, side: float, g: float
) -> tuple[float, float, float]:
    """The next place on the way to a root, the length of the step to it, and against what that has to be small."""
    if root == TURN:
        return _turn_step(lanes, j, at, side, g)
    if root == SWITCH:
        return _switch_step(lanes, j, at, side, g)
    if root == FALL_STOP:
        return _fall_step(shape, lanes, j, at, side, g)
    if root == HELD_STOP:
        return _held_step(shape, lanes, j, at, side, g)
    return _recoupling_step(shape, lanes, j, at, side, g)


@in_lanes
def settle(root: int, shape: int, row: int, settled: int, side: float, g: float, lanes: np.ndarray) -> None:
    """Take the lanes of a strip to a root, in row `row`; row `settled` says which are there.

    Inlined wherever it is called, so that LLVM knows root, shape and rows, but compiled by numba once for all of them.
    """
    for _ in range(_MOST_LANE_STEPS):
        unsettled = 0
        for j in range(STRIP):
            at = lanes[row + j]
            onward, step, scale = _step_to(root, shape, lanes, j, at, side, g)
            there = lanes[settled + j] > 0.0
            lanes[row + j] = at if there else onward
            there |= abs(step) <= _LANE_TOLERANCE * scale
            lanes[settled + j] = 1.0 if there else 0.0
            unsettled += 0 if there else 1
        if unsettled == 0:
            break
