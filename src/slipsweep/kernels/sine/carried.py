"""Lanes that stick at Üg = Üy when at rest, but come to a later pulse in motion.

docs/numerics.md#pulses-entered-in-motion
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar, summed
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    NOT_RECOUPLED,
    YIELD,
    Options,
    lane_loss,
    lane_response,
    lane_slant,
)
from slipsweep.kernels.events import STRIP, root_of
from slipsweep.kernels.sine.cycles import lane_series, pause_of
from slipsweep.kernels.sine.lanes import (
    AT_PEAK,
    CARRIED,
    CODE,
    CONVERGED,
    FOLLOWS_EQ4,
    GAIN,
    HALF_PI,
    HELD,
    HIGHEST,
    LANE_NODES,
    LANE_WEIGHTS,
    LAST,
    LEFT,
    LEVEL,
    MOST,
    MOVED,
    ONSET,
    PEAK,
    PSI,
    SLOWEST,
    START,
    THROUGH,
    TO_PEAK,
    V,
    W,
    X,
)
from slipsweep.kernels.sine.pulse import (
    lane_fall,
    lane_rise,
)
from slipsweep.kernels.sine.roots import HELD_STOP, held_motion, lane_response_and_slope, settle
from slipsweep.kernels.sine.shapes import fallen, phase_of, steepness
from slipsweep.model import equations as eq

#: Cells that stop anew in every pulse are followed that far; `train` finds where more of them repeat.
_MOST_PULSES = 64


@scalar
def lane_carried(shape: int, count: int, options: Options, lanes: np.ndarray) -> None:
    """All cycles of `count` lanes that stick at Üg = Üy when at rest, but come to the second pulse in motion.

    Then they hold E(Üy) ≥ Üg from Üy on and slide through, and each pulse is entered with V greater by
    the same gain.  Where that is a loss, one of two things ends it, and the motion repeats: a pulse that
    recouples, or one that stops before t1 of the first pulse and goes on like it
    (docs/numerics.md#pulses-entered-in-motion).
    """
    later = options.cycles - 1.0
    for j in range(STRIP):
        lanes[LEVEL + j] = lane_response(lanes, j, lanes[YIELD + j], options.g)
        lanes[START + j], lanes[CONVERGED + j] = lanes[BEGAN + j], 1.0
    # the slide through: the pulse from rest, held at E(Üy) and started at Üy, with V carried added
    lane_rise(FOLLOWS_EQ4, shape, options.g, lanes)
    for j in range(STRIP):
        amplitude, held, began, carried = lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[BEGAN + j], lanes[CARRIED + j]
        slowest = phase_of(shape, min(held, lanes[X + j]), amplitude)
        lanes[SLOWEST + j] = carried + held_motion(shape, amplitude, held, began, slowest)[0]
        # held until past its slowest, or else Eq. 4 itself slows it
        through = (held >= amplitude) | (lanes[X + j] >= held)
        lanes[THROUGH + j] = lanes[CONVERGED + j] if through else 0.0
        lanes[W + j] += -carried * began
        lanes[V + j] += carried
        lanes[AT_PEAK + j], lanes[TO_PEAK + j] = lanes[V + j], lanes[W + j]
    lane_fall(shape, options.wants_peak, lanes)
    for j in range(STRIP):
        # pulses that slide through without a stop, and those of them that do not recouple, until it repeats
        carried, slowest = lanes[CARRIED + j], lanes[SLOWEST + j]
        gain = lanes[LEFT + j] - lanes[HELD + j] * pause_of(lanes[BEGAN + j]) - carried
        after = carried + gain
        through = (np.ceil(slowest / -gain) if gain < 0.0 else later) if slowest > 0.0 else 0.0
        sliding = (np.ceil(after / -gain) if gain < 0.0 else later) if after > 0.0 else 0.0
        most = min(min(through, sliding + 1.0), later)
        stops = (through <= sliding) & (most < later)
        lanes[GAIN + j], lanes[MOST + j] = gain, most
        # the stop on the way from Üy
        lanes[V + j] = carried + (most * gain if most > 0.0 else 0.0)
        lanes[PSI + j] = lanes[BEGAN + j]
        lanes[X + j] = 0.0 if stops else 1.0
    settle(HELD_STOP, shape, PSI, X, 1.0, options.g, lanes)
    lane_repeated(shape, later, lanes)
    if later <= _MOST_PULSES:
        for j in range(count):
            if lanes[CONVERGED + j] < 0.0:
                follow_pulses(shape, options, lanes, j)


@scalar
def lane_repeated(shape: int, later: float, lanes: np.ndarray) -> None:
    """W and the largest V of `later` more cycles: whole periods, and what remains.  CONVERGED is −1 without a period.

    docs/numerics.md#pulses-entered-in-motion
    """
    for j in range(STRIP):
        began, psi, left, gain, most = (
            lanes[BEGAN + j],
            lanes[PSI + j],
            lanes[LEFT + j],
            lanes[GAIN + j],
            lanes[MOST + j],
        )
        held_on = held_motion(shape, lanes[AMPLITUDE + j], lanes[LEVEL + j], began, psi)[1]
        again = lanes[V + j] * (psi - began) + held_on if psi > began else 0.0
        stops = psi > began
        braked = eq.attenuated_displacement(left, lanes[HELD + j], pause_of(began))
        periods = np.floor(later / (most + 1.0))
        remaining = later - periods * (most + 1.0)
        sliding_on = most * (lanes[W + j] + braked + math.pi * gain * (most - 1.0))
        slides = sliding_on if stops else lane_series(lanes, j, braked, gain, most - 1.0)
        period = lanes[MOVED + j] + again + (slides if most > 0.0 else 0.0)
        tail = lanes[MOVED + j] + lane_series(lanes, j, braked, gain, remaining - 1.0)
        # the slides through all reach t5, as the first does
        gets_over = (lanes[LEVEL + j] < lanes[AMPLITUDE + j]) & (lanes[CONVERGED + j] * lanes[THROUGH + j] > 0.0)
        alike = gets_over & ((most <= 1.0) | (left + (most - 1.0) * gain > 0.0))
        repeats = ((most == 0.0) | alike) & (lanes[X + j] > 0.0) & ((not stops) | (psi < lanes[ONSET + j]))
        lanes[W + j] = (periods * period if periods > 0.0 else 0.0) + (tail if remaining > 0.0 else lanes[LAST + j])
        highest = lanes[PEAK + j] + max(gain, 0.0) * max(remaining - 1.0, 0.0)
        lanes[PEAK + j] = max(lanes[HIGHEST + j], highest if most > 0.0 else 0.0)
        # -1: each pulse has to be followed
        lanes[CONVERGED + j] = 1.0 if repeats else -1.0
        lanes[CODE + j] = NOT_RECOUPLED


@scalar
def _lost_and_rate(where: tuple[int, float, float, float, float], psi: float) -> tuple[float, float]:
    """−V at ψ of a hold that was entered with `velocity` at `start`, and its rate."""
    shape, amplitude, held, velocity, start = where
    left = velocity + held_motion(shape, amplitude, held, start, psi)[0]
    return -left, held - amplitude * (1.0 - fallen(shape, psi))


_stop_root = root_of(_lost_and_rate)


@scalar
def held_stop(shape: int, lanes: np.ndarray, j: int, velocity: float) -> float:
    """ψ at which the hold from Üy on, entered with `velocity`, stops before its slowest; NaN if not found."""
    amplitude, held, began = lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[BEGAN + j]
    slowest = phase_of(shape, min(held, amplitude), amplitude)
    return _stop_root((shape, amplitude, held, velocity, began), began, slowest, began, began)


@summed
def followed_to_peak(shape: int, lanes: np.ndarray, j: int, start: float, g: float) -> tuple[float, float]:
    """V and W gained from rest at ψ = `start` to the peak by Eq. 4."""
    rate, moment = 0.0, 0.0
    for node in range(LANE_NODES.size):
        left = 1.0 - LANE_NODES[node]
        x = lanes[AMPLITUDE + j] * (1.0 - fallen(shape, start * left))
        weighted = LANE_WEIGHTS[node] * lane_loss(lanes, j, x, g)
        rate += weighted
        moment += left * weighted
    plane, plane_moment = held_motion(shape, lanes[AMPLITUDE + j], 0.0, start, 0.0)
    return -start * rate - lane_slant(lanes, j, plane), start * start * moment - lane_slant(lanes, j, plane_moment)


@scalar
def _lane_response_above(where: tuple[np.ndarray, int, float, float], x: float) -> tuple[float, float]:
    lanes, j, level, g = where
    value, slope = lane_response_and_slope(lanes, j, x, g)
    return value - level, slope


_switch_root = root_of(_lane_response_above)


@scalar
def restart(shape: int, lanes: np.ndarray, j: int, start: float, g: float) -> tuple[float, float, float]:
    """b at the peak, and V and W gained there, of a lane that starts to slide at ψ = `start`, beyond t1; or NaN."""
    amplitude = lanes[AMPLITUDE + j]
    x_start = amplitude * (1.0 - fallen(shape, start))
    eq4, slope = lane_response_and_slope(lanes, j, x_start, g)
    level = max(lanes[YIELD + j], eq4)
    at_peak, slope_at_peak = lane_response_and_slope(lanes, j, amplitude, g)
    if at_peak <= level:
        return level, *held_motion(shape, amplitude, level, start, 0.0)
    psi = start
    if slope <= 0.0 or eq4 < level:  # as in `lane_switch`
        x = amplitude - (at_peak - level) / slope_at_peak
        x = _switch_root((lanes, j, level, g), x_start, amplitude, x, amplitude)
        if math.isnan(x):
            return math.nan, math.nan, math.nan
        psi = max(phase_of(shape, x, amplitude), start)
    held_on = held_motion(shape, amplitude, level, start, psi)
    followed = followed_to_peak(shape, lanes, j, psi, g)
    return at_peak, held_on[0] + followed[0], held_on[1] - held_on[0] * psi + followed[1]


@scalar
def fall_stop(shape: int, amplitude: float, held: float, at_peak: float, highest: float, top: float) -> float:
    """ψ after the peak at which V = `at_peak` there, largest at ψ = `top`, is used up by the hold; NaN if not found."""
    beyond = top + math.sqrt(2.0 * highest / (amplitude * steepness(shape, top)))
    return _stop_root((shape, amplitude, held, at_peak, 0.0), top, min(beyond, HALF_PI), min(beyond, HALF_PI), 0.0)


@scalar
def follow_pulses(shape: int, options: Options, lanes: np.ndarray, j: int) -> None:
    """All cycles of a lane of `lane_carried` that stops between t1 and Üg = b, so that no pulse is like another.

    It restarts at once; the other pulses are those that `lane_carried` knows.
    """
    amplitude, began, carried = lanes[AMPLITUDE + j], lanes[BEGAN + j], lanes[CARRIED + j]
    moved, highest, velocity = lanes[MOVED + j], lanes[HIGHEST + j], carried
    for later in range(options.cycles - 2, -1, -1):
        if velocity > 0.0 and lanes[SLOWEST + j] + velocity - carried > 0.0:
            if lanes[THROUGH + j] == 0.0:
                return
            held, at_peak = lanes[HELD + j], lanes[AT_PEAK + j] + (velocity - carried)
            moved += lanes[TO_PEAK + j] - (velocity - carried) * began
        else:
            stop = began
            if velocity > 0.0:
                stop = held_stop(shape, lanes, j, velocity)
                moved += velocity * (stop - began) + held_motion(shape, amplitude, lanes[LEVEL + j], began, stop)[1]
            if stop <= lanes[ONSET + j]:
                moved += lanes[MOVED + j] if later > 0 else lanes[LAST + j]
                velocity = carried
                continue
            held, at_peak, gained = restart(shape, lanes, j, stop, options.g)
            moved += gained
        top = -phase_of(shape, held, amplitude)
        peak = at_peak + held_motion(shape, amplitude, held, 0.0, top)[0]
        left = at_peak + held_motion(shape, amplitude, held, 0.0, HALF_PI)[0]
        end = HALF_PI if left > 0.0 else fall_stop(shape, amplitude, held, at_peak, peak, top)
        moved += at_peak * end + held_motion(shape, amplitude, held, 0.0, end)[1]
        left, pause = max(left, 0.0), pause_of(began) if later > 0 else math.inf
        velocity = eq.attenuated_velocity(left, held, pause)
        moved += eq.attenuated_displacement(left, held, pause)
        highest = max(highest, peak)
    # NaN where an iteration has not converged
    if moved >= 0.0:
        lanes[W + j], lanes[PEAK + j], lanes[CONVERGED + j] = moved, highest, 1.0
