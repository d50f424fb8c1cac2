"""The first pulse in lanes: from its onset to the stop, or to Üg = 0 (t5).

docs/numerics.md#held-block-acceleration, docs/numerics.md#onset-and-switch and docs/numerics.md#stop
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.jit.elementary import angle_minus_sine, half_square_minus_versine, rising_phase, versine
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    YIELD,
    lane_rate_and_slope,
    lane_relative_acceleration,
)
from slipsweep.kernels.events import STRIP, settling
from slipsweep.kernels.sine.lanes import (
    CONVERGED,
    HALF_PI,
    HELD,
    LANE_NODES,
    LANE_WEIGHTS,
    LEFT,
    LEVEL,
    MOMENT,
    ONSET,
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


@in_lanes
def held_motion(amplitude: float, held: float, start: float, end: float) -> tuple[float, float]:
    """∫ (x − b) dψ and ∫ (end − ψ)(x − b) dψ for a held b, |ψ| ≤ π/2: gains of V and W from rest.

    docs/numerics.md#held-block-acceleration
    """
    width = end - start
    excess = amplitude - held
    sine_part = angle_minus_sine(start)
    first = excess * width - amplitude * (angle_minus_sine(end) - sine_part)
    second = 0.5 * excess * width * width - amplitude * (
        half_square_minus_versine(end) - half_square_minus_versine(start) - sine_part * width
    )
    return first, second


@in_lanes
def stopping_step(amplitude: float, held: float, velocity: float, start: float, psi: float) -> float:
    """What Newton takes off ψ on the way to the stop of a hold that was entered with V = `velocity` at `start`."""
    left = velocity + held_motion(amplitude, held, start, psi)[0]
    return left / (amplitude - held - amplitude * versine(psi))


@in_lanes
def lane_response_and_slope(lanes: np.ndarray, j: int, x: float, g: float) -> tuple[float, float]:
    """E and dE/dx of a lane (x > 0)."""
    rate, slope = lane_rate_and_slope(lanes, j, x, g)
    return x - rate, 1.0 - slope


@in_lanes
def _onset_step(lanes: np.ndarray, j: int, x: float, side: float, g: float) -> tuple[float, float, float]:
    """To D = 0, from the left, where a concave D converges, slowly where it starts flat."""
    rate, slope = lane_rate_and_slope(lanes, j, x, g)
    step = -rate / slope
    return x + step, step, min(x, lanes[AMPLITUDE + j] - x)


@in_lanes
def _switch_step(lanes: np.ndarray, j: int, x: float, side: float, g: float) -> tuple[float, float, float]:
    """To E = b, from the right, where a convex E converges."""
    eq4, slope = lane_response_and_slope(lanes, j, x, g)
    step = (eq4 - lanes[LEVEL + j]) / slope
    return x - step, step, min(x, lanes[AMPLITUDE + j] - x)


@in_lanes
def _fall_step(lanes: np.ndarray, j: int, psi: float, side: float, g: float) -> tuple[float, float, float]:
    """To the stop after the peak."""
    step = stopping_step(lanes[AMPLITUDE + j], lanes[HELD + j], lanes[V + j], 0.0, psi)
    return min(max(psi - step, 0.0), HALF_PI), step, psi


@in_lanes
def _held_step(lanes: np.ndarray, j: int, psi: float, side: float, g: float) -> tuple[float, float, float]:
    """To the stop of a pulse entered in motion, from Üy on, where V falls ever more slowly; no further than t1."""
    began, onset = lanes[BEGAN + j], lanes[ONSET + j]
    step = stopping_step(lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[V + j], began, psi)
    onward = min(max(psi - step, began), onset)
    return onward, step, math.inf if onward >= onset else onward - began


@in_lanes
def _recoupling_step(lanes: np.ndarray, j: int, chi: float, side: float, g: float) -> tuple[float, float, float]:
    """To the stop after Üg = 0."""
    amplitude, b = lanes[AMPLITUDE + j], lanes[HELD + j]
    half_sine, half_cosine = 0.5 * chi - angle_minus_sine(0.5 * chi), 1.0 - versine(0.5 * chi)
    over = lanes[LEFT + j] - b * chi - 2.0 * amplitude * half_sine * half_sine
    step = over / (b + 2.0 * amplitude * half_sine * half_cosine)
    return min(max(chi + step, 0.0), math.pi), step, chi


_settle_onset = settling(LEVEL, CONVERGED, _onset_step)

_settle_switch = settling(X, PSI, _switch_step)

_settle_fall = settling(PSI, X, _fall_step)

settle_held = settling(PSI, X, _held_step)

settle_recoupling = settling(PSI, X, _recoupling_step)


@scalar
def lane_onset(kind: int, g: float, lanes: np.ndarray) -> None:
    """t1: where each lane begins to slide (ψ in START) and the value it then holds (LEVEL)."""
    for j in range(STRIP):
        lanes[CONVERGED + j] = 1.0
        lanes[LEVEL + j], lanes[START + j] = lanes[YIELD + j], lanes[BEGAN + j]
    if kind != STICKS:
        return
    for j in range(STRIP):
        lanes[CONVERGED + j] = 0.0
    _settle_onset(lanes, 1.0, g)
    for j in range(STRIP):
        lanes[START + j] = rising_phase(lanes[LEVEL + j], lanes[AMPLITUDE + j])


@scalar
def lane_switch(g: float, lanes: np.ndarray) -> None:
    """x at which each lane ceases to hold its level and follows Eq. 4 (X), and b at the peak (HELD)."""
    for j in range(STRIP):
        amplitude, level = lanes[AMPLITUDE + j], lanes[LEVEL + j]
        eq4, slope = lane_response_and_slope(lanes, j, amplitude, g)
        follows = eq4 > level
        lanes[HELD + j] = eq4 if follows else level
        lanes[X + j] = amplitude - (eq4 - level) / slope if follows else amplitude
        lanes[PSI + j] = 0.0 if follows else 1.0
    _settle_switch(lanes, 1.0, g)
    for j in range(STRIP):
        lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[PSI + j])


@scalar
def lane_rise(kind: int, g: float, lanes: np.ndarray) -> None:
    """From t1 to the peak: b in HELD, V and W gained from rest in V and W."""
    if kind == YIELD_GOVERNS:
        for j in range(STRIP):
            lanes[X + j], lanes[HELD + j] = lanes[AMPLITUDE + j], lanes[LEVEL + j]
            lanes[V + j], lanes[W + j] = held_motion(lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[START + j], 0.0)
        return
    lane_switch(g, lanes)
    # the hold
    for j in range(STRIP):
        amplitude = lanes[AMPLITUDE + j]
        # no earlier than the start, from which it may differ by the roundings of two roots
        psi = max(rising_phase(lanes[X + j], amplitude), lanes[START + j])
        lanes[PSI + j] = psi
        lanes[V + j], lanes[W + j] = held_motion(amplitude, lanes[LEVEL + j], lanes[START + j], psi)
        lanes[RATE + j] = lanes[MOMENT + j] = 0.0
    # Eq. 4
    for node in range(LANE_NODES.size):
        left, weight = 1.0 - LANE_NODES[node], LANE_WEIGHTS[node]
        for j in range(STRIP):
            x = lanes[AMPLITUDE + j] * (1.0 - versine(lanes[PSI + j] * left))
            weighted = weight * lane_relative_acceleration(lanes, j, x, g)
            lanes[RATE + j] += weighted
            lanes[MOMENT + j] += left * weighted
    for j in range(STRIP):
        width = -lanes[PSI + j]
        lanes[W + j] += (lanes[V + j] + lanes[MOMENT + j] * width) * width
        lanes[V + j] += lanes[RATE + j] * width


@scalar
def lane_fall(wants_peak: bool, lanes: np.ndarray) -> None:
    """The hold from the peak to the stop or to Üg = 0 (t5): V left in LEFT, if wanted the largest V in PEAK."""
    unsettled = 0
    for j in range(STRIP):
        left = lanes[V + j] + held_motion(lanes[AMPLITUDE + j], lanes[HELD + j], 0.0, HALF_PI)[0]
        lanes[LEFT + j] = max(left, 0.0)
        lanes[PSI + j] = HALF_PI
        lanes[PEAK + j] = math.nan
        unsettled += 0 if left > 0.0 else 1
    if wants_peak or unsettled > 0:
        for j in range(STRIP):
            # V is largest where x = b; a parabola from there overestimates the stop
            amplitude, held, velocity = lanes[AMPLITUDE + j], lanes[HELD + j], lanes[V + j]
            top = -rising_phase(held, amplitude)
            peak = velocity + held_motion(amplitude, held, 0.0, top)[0]
            onward = math.sqrt(2.0 * peak / (amplitude * (top - angle_minus_sine(top))))
            lanes[PSI + j] = HALF_PI if lanes[LEFT + j] > 0.0 else min(top + onward, HALF_PI)
            lanes[PEAK + j] = peak if wants_peak else math.nan
            lanes[X + j] = 1.0 if lanes[LEFT + j] > 0.0 else 0.0
        if unsettled > 0:
            _settle_fall(lanes, 1.0, 0.0)
        for j in range(STRIP):
            lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[X + j])
    for j in range(STRIP):
        end = lanes[PSI + j]
        lanes[W + j] += lanes[V + j] * end + held_motion(lanes[AMPLITUDE + j], lanes[HELD + j], 0.0, end)[1]
