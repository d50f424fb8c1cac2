"""The first pulse in lanes: from its onset to the stop, or to Üg = 0 (t5).

docs/numerics.md#held-block-acceleration, docs/numerics.md#onset-and-switch and docs/numerics.md#stop
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    DECAY,
    TAN_THETA,
    YIELD,
    lane_loss,
    lane_slant,
)
from slipsweep.kernels.events import STRIP
from slipsweep.kernels.sine.lanes import (
    CONVERGED,
    HALF_PI,
    HELD,
    LANE_NODES,
    LANE_WEIGHTS,
    LEFT,
    LEVEL,
    MOMENT,
    PEAK,
    PSI,
    RATE,
    START,
    STICKS,
    YIELD_GOVERNS,
    V,
    W,
    X,
)
from slipsweep.kernels.sine.roots import FALL_STOP, SWITCH, TURN, held_motion, lane_response_and_slope, settle
from slipsweep.kernels.sine.shapes import SQUARE, fallen, phase_of, steepness

#: No λ or tan θ is divided by that is smaller.
_LEAST = 1e-150


@scalar
def lane_onset(kind: int, shape: int, g: float, lanes: np.ndarray) -> None:
    """t1: where each lane begins to slide (ψ in START) and the value it then holds (LEVEL)."""
    for j in range(STRIP):
        lanes[CONVERGED + j] = 1.0
        lanes[LEVEL + j], lanes[START + j] = lanes[YIELD + j], lanes[BEGAN + j]
    if kind != STICKS:
        return
    for j in range(STRIP):
        # from where D ceases to be convex: beyond the root before it, and before the root beyond it
        decay, tan_theta = max(lanes[DECAY + j], _LEAST), max(lanes[TAN_THETA + j], _LEAST)
        bend = (2.0 * tan_theta / decay - g) / tan_theta
        lanes[LEVEL + j] = min(max(bend, lanes[YIELD + j]), lanes[AMPLITUDE + j])
        lanes[CONVERGED + j] = 0.0
    settle(TURN, shape, LEVEL, CONVERGED, 1.0, g, lanes)
    for j in range(STRIP):
        lanes[START + j] = phase_of(shape, lanes[LEVEL + j], lanes[AMPLITUDE + j])


@scalar
def lane_switch(shape: int, g: float, lanes: np.ndarray) -> None:
    """x at which each lane ceases to hold its level and follows Eq. 4 (X), and b at the peak (HELD)."""
    for j in range(STRIP):
        amplitude, level = lanes[AMPLITUDE + j], lanes[LEVEL + j]
        eq4, slope = lane_response_and_slope(lanes, j, amplitude, g)
        follows = eq4 > level
        lanes[HELD + j] = eq4 if follows else level
        lanes[X + j] = amplitude - (eq4 - level) / slope if follows else amplitude
        # the square jumps past it
        lanes[PSI + j] = 0.0 if follows & (shape != SQUARE) else 1.0
    settle(SWITCH, shape, X, PSI, 1.0, g, lanes)
    for j in range(STRIP):
        lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[PSI + j])


@scalar
def lane_rise(kind: int, shape: int, g: float, lanes: np.ndarray) -> None:
    """From t1 to the peak: b in HELD, V and W gained from rest in V and W."""
    if kind == YIELD_GOVERNS:
        for j in range(STRIP):
            lanes[X + j], lanes[HELD + j] = lanes[AMPLITUDE + j], lanes[LEVEL + j]
            lanes[V + j], lanes[W + j] = held_motion(
                shape, lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[START + j], 0.0
            )
        return
    lane_switch(shape, g, lanes)
    # the hold
    for j in range(STRIP):
        amplitude = lanes[AMPLITUDE + j]
        # no earlier than the start, from which it may differ by the roundings of two roots
        psi = max(phase_of(shape, lanes[X + j], amplitude), lanes[START + j])
        lanes[PSI + j] = psi
        lanes[V + j], lanes[W + j] = held_motion(shape, amplitude, lanes[LEVEL + j], lanes[START + j], psi)
        lanes[RATE + j] = lanes[MOMENT + j] = 0.0
    # Eq. 4: n (μs − μ) at nodes, the rest in closed form
    for node in range(LANE_NODES.size):
        left, weight = 1.0 - LANE_NODES[node], LANE_WEIGHTS[node]
        for j in range(STRIP):
            x = lanes[AMPLITUDE + j] * (1.0 - fallen(shape, lanes[PSI + j] * left))
            weighted = weight * lane_loss(lanes, j, x, g)
            lanes[RATE + j] += weighted
            lanes[MOMENT + j] += left * weighted
    for j in range(STRIP):
        width = -lanes[PSI + j]
        plane, plane_moment = held_motion(shape, lanes[AMPLITUDE + j], 0.0, -width, 0.0)
        lanes[W + j] += (lanes[V + j] + lanes[MOMENT + j] * width) * width - lane_slant(lanes, j, plane_moment)
        lanes[V + j] += lanes[RATE + j] * width - lane_slant(lanes, j, plane)


@scalar
def lane_fall(shape: int, wants_peak: bool, lanes: np.ndarray) -> None:
    """The hold from the peak to the stop or to Üg = 0 (t5): V left in LEFT, if wanted the largest V in PEAK."""
    unsettled = 0
    for j in range(STRIP):
        left = lanes[V + j] + held_motion(shape, lanes[AMPLITUDE + j], lanes[HELD + j], 0.0, HALF_PI)[0]
        lanes[LEFT + j] = max(left, 0.0)
        lanes[PSI + j] = HALF_PI
        lanes[PEAK + j] = math.nan
        unsettled += 0 if left > 0.0 else 1
    if wants_peak or unsettled > 0:
        for j in range(STRIP):
            # V is largest where x = b; a parabola from there overestimates the stop
            amplitude, held, velocity = lanes[AMPLITUDE + j], lanes[HELD + j], lanes[V + j]
            top = -phase_of(shape, held, amplitude)
            peak = velocity + held_motion(shape, amplitude, held, 0.0, top)[0]
            onward = math.sqrt(2.0 * peak / (amplitude * steepness(shape, top)))
            lanes[PSI + j] = HALF_PI if lanes[LEFT + j] > 0.0 else min(top + onward, HALF_PI)
            lanes[PEAK + j] = peak if wants_peak else math.nan
            lanes[X + j] = 1.0 if lanes[LEFT + j] > 0.0 else 0.0
        if unsettled > 0:
            settle(FALL_STOP, shape, PSI, X, 1.0, 0.0, lanes)
        for j in range(STRIP):
            lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[X + j])
    for j in range(STRIP):
        end = lanes[PSI + j]
        lanes[W + j] += lanes[V + j] * end + held_motion(shape, lanes[AMPLITUDE + j], lanes[HELD + j], 0.0, end)[1]
