"""Lanes that stick at Üg = Üy when at rest, but come to a later pulse in motion.

docs/numerics.md#pulses-entered-in-motion
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar, summed
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


@in_lanes
def moved_to_stop(shape: int, lanes: np.ndarray, j: int, velocity: float, psi: float) -> float:
    """W of the hold from Üg = Üy, entered with `velocity`, to its stop at ψ."""
    began = lanes[BEGAN + j]
    held_on = held_motion(shape, lanes[AMPLITUDE + j], lanes[LEVEL + j], began, psi)[1]
    return 0.0 if psi <= began else velocity * (psi - began) + held_on


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
        lanes[LEVEL + j], slope = lane_response_and_slope(lanes, j, lanes[YIELD + j], options.g)
        lanes[START + j] = lanes[BEGAN + j]
        lanes[CONVERGED + j] = 1.0 if slope <= 0.0 else 0.0  # else b goes on with Eq. 4 from Üy on
    # the slide through: the pulse from rest, held at E(Üy) and started at Üy, with V carried added
    lane_rise(FOLLOWS_EQ4, shape, options.g, lanes)
    for j in range(STRIP):
        amplitude, held, began, carried = lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[BEGAN + j], lanes[CARRIED + j]
        slowest = phase_of(shape, min(held, lanes[X + j]), amplitude)
        lanes[SLOWEST + j] = carried + held_motion(shape, amplitude, held, began, slowest)[0]
        # held until past its slowest, or else Eq. 4 itself slows it
        lanes[THROUGH + j] = lanes[CONVERGED + j] if (held >= amplitude) | (lanes[X + j] >= held) else 0.0
        lanes[W + j] += -carried * began
        lanes[V + j] += carried
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
    for j in range(count):
        if lanes[CONVERGED + j] < 0.0:
            rest = lanes[CARRIED + j], lanes[MOVED + j], lanes[HIGHEST + j]
            follow_pulses(shape, options, options.cycles - 1, False, rest, lanes, j)


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
        again = moved_to_stop(shape, lanes, j, lanes[V + j], psi)
        stops = psi > began
        braked = eq.attenuated_displacement(left, lanes[HELD + j], pause_of(began))
        periods = np.floor(later / (most + 1.0))
        remaining = later - periods * (most + 1.0)
        sliding_on = most * (lanes[W + j] + braked + math.pi * gain * (most - 1.0))
        slides = sliding_on if stops else lane_series(lanes, j, braked, gain, most - 1.0)
        period = lanes[MOVED + j] + again + (slides if most > 0.0 else 0.0)
        tail = lanes[MOVED + j] + lane_series(lanes, j, braked, gain, remaining - 1.0)
        # the slides through all reach t5, as the first does
        gets_over = (lanes[LEVEL + j] < lanes[AMPLITUDE + j]) & (lanes[CONVERGED + j] > 0.0)
        alike = (most == 0.0) | (gets_over & ((most <= 1.0) | (left + (most - 1.0) * gain > 0.0)))
        settled = (lanes[THROUGH + j] > 0.0) & (lanes[X + j] > 0.0)
        repeats = alike & settled & ((not stops) | (psi < lanes[ONSET + j]))
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


class Through(NamedTuple):
    """A pulse that slides through: what V gains to where it is least; b and the gains of V and W at the peak."""

    least: float
    held: float
    gained: float
    moved: float


@scalar
def slide_through(shape: int, lanes: np.ndarray, j: int, g: float) -> Through:
    """A pulse that holds E(Üy), in LEVEL from now on, to where V is least; b is NaN where it does not hold so long."""
    amplitude, began = lanes[AMPLITUDE + j], lanes[BEGAN + j]
    level, slope = lane_response_and_slope(lanes, j, lanes[YIELD + j], g)
    lanes[LEVEL + j] = level
    least = held_motion(shape, amplitude, level, began, phase_of(shape, min(level, amplitude), amplitude))[0]
    held, gained, moved = restart(shape, lanes, j, began, g)
    if slope > 0.0 or (level < amplitude and lane_response(lanes, j, level, g) > level):
        held = math.nan
    return Through(least, held, gained, moved)


@scalar
def to_peak(
    shape: int, lanes: np.ndarray, j: int, through: Through, velocity: float, g: float
) -> tuple[float, float, float]:
    """b, V and W at the peak of a pulse entered with `velocity`; or NaN.

    One that stops restarts at once, or at t1 if that is later.
    """
    began = lanes[BEGAN + j]
    if velocity + through.least > 0.0:
        return through.held, velocity + through.gained, through.moved - velocity * began
    stop = held_stop(shape, lanes, j, velocity) if velocity > 0.0 else began
    held, at_peak, moved = restart(shape, lanes, j, max(stop, lanes[ONSET + j]), g)
    return held, at_peak, moved + moved_to_stop(shape, lanes, j, velocity, stop)


@scalar
def from_peak(
    shape: int, lanes: np.ndarray, j: int, held: float, at_peak: float, pause: float
) -> tuple[float, float, float]:
    """V left of that at the peak when `pause` is over after Üg = 0 (t5), W gained, and the largest V."""
    amplitude = lanes[AMPLITUDE + j]
    top = -phase_of(shape, held, amplitude)
    peak = at_peak + held_motion(shape, amplitude, held, 0.0, top)[0]
    left = at_peak + held_motion(shape, amplitude, held, 0.0, HALF_PI)[0]
    end = HALF_PI if left > 0.0 else fall_stop(shape, amplitude, held, at_peak, peak, top)
    moved = at_peak * end + held_motion(shape, amplitude, held, 0.0, end)[1]
    left = max(left, 0.0)
    moved += eq.attenuated_displacement(left, held, pause)
    return eq.attenuated_velocity(left, held, pause), moved, peak


@scalar
def follow_pulses(
    shape: int, options: Options, pulses: int, to_last_peak: bool, rest: tuple[float, float, float],
    lanes: np.ndarray, j: int,
) -> None:  # fmt: skip
    """So many pulses of a lane, if not too many, after the W in MOVED and entered with the V in CARRIED.

    `rest` is what a pulse from rest comes to: V left at the next Üg = Üy, W and the largest V.  The shaking ends at
    the peak of the last pulse, or with its negative half wave.
    """
    if pulses > _MOST_PULSES:
        return
    through = slide_through(shape, lanes, j, options.g)
    if math.isnan(through.held):
        return
    moved, highest, velocity, began = lanes[MOVED + j], lanes[HIGHEST + j], lanes[CARRIED + j], lanes[BEGAN + j]
    entered, gain, slid, crest = math.nan, math.nan, math.nan, math.nan  # of a pulse that slides through
    for _ in range(pulses - 1):
        slides_through, more = velocity + through.least > 0.0, velocity - entered
        if velocity == 0.0:
            velocity, further, peak = rest
        elif slides_through and velocity + gain > 0.0:
            velocity, further, peak = velocity + gain, slid + 2.0 * math.pi * more, crest + more
        else:
            held, at_peak, rising = to_peak(shape, lanes, j, through, velocity, options.g)
            after, falling, peak = from_peak(shape, lanes, j, held, at_peak, pause_of(began))
            further = rising + falling
            if slides_through and after > 0.0:
                entered, gain, slid, crest = velocity, after - velocity, further, peak
            velocity = after
        moved += further
        highest = max(highest, peak)
    held, peak, rising = to_peak(shape, lanes, j, through, velocity, options.g)
    if to_last_peak:
        falling = eq.attenuated_displacement(peak, held, math.inf)
    else:
        _, falling, peak = from_peak(shape, lanes, j, held, peak, math.inf)
    moved += rising + falling
    highest = max(highest, peak)
    # NaN where an iteration has not converged
    if moved >= 0.0:
        lanes[W + j], lanes[PEAK + j], lanes[CONVERGED + j] = moved, highest, 1.0
