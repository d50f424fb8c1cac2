"""Stick-slip under a sine in SIMD lanes: the pulse from its onset to the stop, phase by phase, and all cycles.

Nearly all cells are of one of a few kinds: they slide from Üg = Üy, hold the yield value, perhaps follow Eq. 4 to the
peak, hold again and stop before the next pulse.  Where a block comes to the next pulse in motion it goes on by one
of a few rules (`lane_attenuation`, `lane_carried`), pulse by pulse where none is like another (`follow_pulses`).
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar, summed
from slipsweep.jit.elementary import angle_minus_sine, half_square_minus_versine, rising_phase, versine
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    NOT_RECOUPLED,
    YIELD,
    Options,
    lane_rate_and_slope,
    lane_relative_acceleration,
    lane_response,
)
from slipsweep.kernels.events import STRIP, root_of, settling
from slipsweep.kernels.lanes import (
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
    MOMENT,
    MOST,
    MOVED,
    ONSET,
    PEAK,
    PSI,
    RATE,
    SLOWEST,
    START,
    STICKS,
    THROUGH,
    TO_PEAK,
    YIELD_GOVERNS,
    V,
    W,
    X,
)
from slipsweep.model import equations as eq

#: Cells that stop anew in every pulse are followed that far; `train` finds where more of them repeat.
_MOST_PULSES = 64


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
_settle_held = settling(PSI, X, _held_step)
_settle_recoupling = settling(PSI, X, _recoupling_step)


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


@in_lanes
def pause_of(began: float) -> float:
    """Phase from Üg = 0 (t5) to the next Üg = Üy."""
    return 1.5 * math.pi + began


@in_lanes
def lane_series(lanes: np.ndarray, j: int, braked: float, gain: float, later: float) -> float:
    """W of the pulse that a lane has followed and of `later` more, each entered with V greater by `gain`.

    Pulse n, counted from 0, adds 2π · gain · n more than the first does with `braked`, the last slides to its
    stop (docs/numerics.md#lanes-of-the-sine).
    """
    moved, left = lanes[W + j], lanes[LEFT + j] + later * gain
    last = (
        moved
        + later * gain * (HALF_PI - lanes[BEGAN + j])
        + eq.attenuated_displacement(left, lanes[HELD + j], math.inf)
    )
    return later * (moved + braked + math.pi * gain * (later - 1.0)) + last


@scalar
def lane_attenuation(kind: int, cycles: int, lanes: np.ndarray) -> None:
    """Eq. 12, and all cycles: W in W, the largest V in PEAK.

    Where a block still slides at the next Üg = Üy, Eq. 4 and the hold act on it as in the
    pulse before, so that each cycle adds the same velocity v: an arithmetic series.  But what
    sticks at Üg = Üy when at rest does not when it slides: `lane_carried` goes on with it.
    """
    for j in range(STRIP):
        held, left, moved = lanes[HELD + j], lanes[LEFT + j], lanes[W + j]
        pause = pause_of(lanes[BEGAN + j])
        carried = eq.attenuated_velocity(left, held, pause)
        braked = eq.attenuated_displacement(left, held, pause)
        later = cycles - 1.0
        lanes[CARRIED + j], lanes[MOVED + j] = carried, moved + braked
        lanes[LAST + j] = moved + eq.attenuated_displacement(left, held, math.inf)
        lanes[HIGHEST + j], lanes[ONSET + j] = lanes[PEAK + j], lanes[START + j]
        lanes[W + j] = lane_series(lanes, j, braked, carried, later)
        lanes[PEAK + j] += later * carried
        still = (carried > 0.0) & (cycles > 1)
        lanes[CODE + j] = NOT_RECOUPLED if still else 0
        # -1: right so far, but not over
        lanes[CONVERGED + j] *= -1.0 if still & (kind == STICKS) else 1.0


@scalar
def lane_recoupling(cycles: int, lanes: np.ndarray) -> None:
    """From Üg = 0 on by integration, χ = φ − π to the stop, which comes before 2π for b ≥ Üy; and all cycles."""
    sliding = 0
    for j in range(STRIP):
        sliding += 1 if lanes[LEFT + j] > 0.0 else 0
    for j in range(STRIP):
        lanes[CODE + j] = 0.0
        lanes[W + j] *= 1.0 if sliding > 0 else cycles
    if sliding == 0:
        return
    for j in range(STRIP):
        # vers χ ≥ 2 χ²/π²: this start lies beyond the stop
        b, left = lanes[HELD + j], lanes[LEFT + j]
        curvature = 4.0 * lanes[AMPLITUDE + j] / (math.pi * math.pi)
        longest = left / b
        lanes[PSI + j] = min(2.0 * longest / (1.0 + math.sqrt(1.0 + 2.0 * (curvature / b) * longest)), math.pi)
        lanes[X + j] = 0.0
    _settle_recoupling(lanes, 1.0, 0.0)
    for j in range(STRIP):
        lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[X + j])
    for j in range(STRIP):
        amplitude, b, chi = lanes[AMPLITUDE + j], lanes[HELD + j], lanes[PSI + j]
        sine = 2.0 * (0.5 * chi - angle_minus_sine(0.5 * chi)) * (1.0 - versine(0.5 * chi))
        lanes[W + j] += (lanes[LEFT + j] - 0.5 * b * chi) * chi - amplitude * (chi - sine)
        lanes[W + j] *= cycles


@scalar
def lane_carried(count: int, options: Options, lanes: np.ndarray) -> None:
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
    lane_rise(FOLLOWS_EQ4, options.g, lanes)
    for j in range(STRIP):
        amplitude, held, began, carried = lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[BEGAN + j], lanes[CARRIED + j]
        slowest = rising_phase(min(held, lanes[X + j]), amplitude)
        lanes[SLOWEST + j] = carried + held_motion(amplitude, held, began, slowest)[0]
        # held until past its slowest, or else Eq. 4 itself slows it
        through = (held >= amplitude) | (lanes[X + j] >= held)
        lanes[THROUGH + j] = lanes[CONVERGED + j] if through else 0.0
        lanes[W + j] += -carried * began
        lanes[V + j] += carried
        lanes[AT_PEAK + j], lanes[TO_PEAK + j] = lanes[V + j], lanes[W + j]
    lane_fall(options.wants_peak, lanes)
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
    _settle_held(lanes, 1.0, options.g)
    for j in range(STRIP):
        began, psi, left, gain, most = (
            lanes[BEGAN + j],
            lanes[PSI + j],
            lanes[LEFT + j],
            lanes[GAIN + j],
            lanes[MOST + j],
        )
        held_on = held_motion(lanes[AMPLITUDE + j], lanes[LEVEL + j], began, psi)[1]
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
    if later <= _MOST_PULSES:
        for j in range(count):
            if lanes[CONVERGED + j] < 0.0:
                follow_pulses(options, lanes, j)


@scalar
def _lost_and_rate(where: tuple[float, float, float, float], psi: float) -> tuple[float, float]:
    """−V at ψ of a hold that was entered with `velocity` at `start`, and its rate."""
    amplitude, held, velocity, start = where
    left = velocity + held_motion(amplitude, held, start, psi)[0]
    return -left, held - amplitude * (1.0 - versine(psi))


_stop_root = root_of(_lost_and_rate)


@scalar
def held_stop(lanes: np.ndarray, j: int, velocity: float) -> float:
    """ψ at which the hold from Üy on, entered with `velocity`, stops before its slowest; NaN if not found."""
    amplitude, held, began = lanes[AMPLITUDE + j], lanes[LEVEL + j], lanes[BEGAN + j]
    slowest = rising_phase(min(held, amplitude), amplitude)
    return _stop_root((amplitude, held, velocity, began), began, slowest, began, began)


@summed
def followed_to_peak(lanes: np.ndarray, j: int, start: float, g: float) -> tuple[float, float]:
    """V and W gained from rest at ψ = `start` to the peak by Eq. 4."""
    rate, moment = 0.0, 0.0
    for node in range(LANE_NODES.size):
        left = 1.0 - LANE_NODES[node]
        x = lanes[AMPLITUDE + j] * (1.0 - versine(start * left))
        weighted = LANE_WEIGHTS[node] * lane_relative_acceleration(lanes, j, x, g)
        rate += weighted
        moment += left * weighted
    return -start * rate, start * start * moment


@scalar
def _lane_response_above(where: tuple[np.ndarray, int, float, float], x: float) -> tuple[float, float]:
    lanes, j, level, g = where
    value, slope = lane_response_and_slope(lanes, j, x, g)
    return value - level, slope


_switch_root = root_of(_lane_response_above)


@scalar
def restart(lanes: np.ndarray, j: int, start: float, g: float) -> tuple[float, float, float]:
    """b at the peak, and V and W gained there, of a lane that starts to slide at ψ = `start`, beyond t1; or NaN."""
    amplitude = lanes[AMPLITUDE + j]
    x_start = amplitude * (1.0 - versine(start))
    eq4, slope = lane_response_and_slope(lanes, j, x_start, g)
    level = max(lanes[YIELD + j], eq4)
    at_peak, slope_at_peak = lane_response_and_slope(lanes, j, amplitude, g)
    if at_peak <= level:
        return level, *held_motion(amplitude, level, start, 0.0)
    psi = start
    if slope <= 0.0 or eq4 < level:  # as in `lane_switch`
        x = amplitude - (at_peak - level) / slope_at_peak
        x = _switch_root((lanes, j, level, g), x_start, amplitude, x, amplitude)
        if math.isnan(x):
            return math.nan, math.nan, math.nan
        psi = max(rising_phase(x, amplitude), start)
    held_on = held_motion(amplitude, level, start, psi)
    followed = followed_to_peak(lanes, j, psi, g)
    return at_peak, held_on[0] + followed[0], held_on[1] - held_on[0] * psi + followed[1]


@scalar
def fall_stop(amplitude: float, held: float, at_peak: float, highest: float, top: float) -> float:
    """ψ after the peak at which V = `at_peak` there, largest at ψ = `top`, is used up by the hold; NaN if not found."""
    beyond = top + math.sqrt(2.0 * highest / (amplitude * (top - angle_minus_sine(top))))
    return _stop_root((amplitude, held, at_peak, 0.0), top, min(beyond, HALF_PI), min(beyond, HALF_PI), 0.0)


@scalar
def follow_pulses(options: Options, lanes: np.ndarray, j: int) -> None:
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
                stop = held_stop(lanes, j, velocity)
                moved += velocity * (stop - began) + held_motion(amplitude, lanes[LEVEL + j], began, stop)[1]
            if stop <= lanes[ONSET + j]:
                moved += lanes[MOVED + j] if later > 0 else lanes[LAST + j]
                velocity = carried
                continue
            held, at_peak, gained = restart(lanes, j, stop, options.g)
            moved += gained
        top = -rising_phase(held, amplitude)
        peak = at_peak + held_motion(amplitude, held, 0.0, top)[0]
        left = at_peak + held_motion(amplitude, held, 0.0, HALF_PI)[0]
        end = HALF_PI if left > 0.0 else fall_stop(amplitude, held, at_peak, peak, top)
        moved += at_peak * end + held_motion(amplitude, held, 0.0, end)[1]
        left, pause = max(left, 0.0), pause_of(began) if later > 0 else math.inf
        velocity = eq.attenuated_velocity(left, held, pause)
        moved += eq.attenuated_displacement(left, held, pause)
        highest = max(highest, peak)
    # NaN where an iteration has not converged
    if moved >= 0.0:
        lanes[W + j], lanes[PEAK + j], lanes[CONVERGED + j] = moved, highest, 1.0
