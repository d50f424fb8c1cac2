"""The stepping solver: fixed steps in phase, cut at the events inside them.

A rule is the polynomial through the rate of the relative velocity, Üg − Ü, at one, two or
three points of a step; V and W are its first and second integrals.

==========  =====================  =====  ==================================
rule        rate taken at          order  also known as
==========  =====================  =====  ==================================
rectangle   start                  1      Euler (Eq. 12 is written this way)
trapezoid   start, end             2      linear acceleration
simpson     start, middle, end     4      Runge-Kutta 4 for a rate free of V
==========  =====================  =====  ==================================

Steps end where a piece of the waveform does (`excitation`): on its jumps, kinks, turns and zeros, and are
of one length on each piece (`steps_of`).  The orders hold because a step in which something happens (t1, a
switch to or from the hold, a turn of Eq. 4, the stop) is divided there by `rise_step` and `take`, and
because a slide or a layer of friction shorter than a few steps is given steps of its own.  Steps in
which nothing happens, nearly all, are taken by lanes of cells in lockstep, with w from a table
(`stick_slip_lanes`, `continuous_lanes`); what is no matter of lanes goes pulse by pulse (`pulse`, `train`).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import literally

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    AMPLITUDE,
    INTEGRATE,
    LANE_ROWS,
    LITERAL,
    MONOTONE,
    NEWMARK,
    TILE,
    YIELD,
    YIELD_GOVERNS,
    Block,
    Motion,
    Options,
    block_at,
    inflection,
    lane_drift,
    lane_of,
    lane_relative_acceleration,
    lane_response,
    relative_acceleration,
    relative_acceleration_root,
    response,
    response_and_slope,
    response_root,
    slope_root,
    starting_acceleration,
    store_motion,
    whole_lanes,
)
from slipsweep.kernels.events import root_of
from slipsweep.kernels.excitation import offset_at, offset_root, phase_at, plane
from slipsweep.kernels.pulse import (
    BEGAN_AT,
    DISPLACEMENT,
    FOLLOWS,
    HELD,
    LEAST,
    PEAK,
    SLIDES,
    STATE_ROWS,
    STOPPED_AT,
    VELOCITY,
    Pulse,
    begin_slide,
    pulse_of,
    reset_held,
    rises_anew,
    validity_before,
)
from slipsweep.kernels.train import train_of, yield_governs
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.motion.pieces import BEGIN, COEFFICIENTS, DEGREE, END, FINISH, FIRST, JUMPS, LAST, START, TERM, TOP, Wave

RECTANGLE, TRAPEZOID, SIMPSON = 0, 1, 2

#: No slide up to its greatest rate, and no layer of decaying friction, is covered by fewer than
#: steps_per_cycle / 64 steps, or one shorter than a step would not converge with the step.
_SHARE_OF_CYCLE = 64
_SHORTEST = 2.0 * math.pi / _SHARE_OF_CYCLE

#: Friction decays in a layer of this many e-foldings: e^-40 of it is less than rounding.
_FOLDINGS = 40.0

#: No step is shorter: it would no longer move the phase.
_LEAST_STEP = 1e-14

#: Cycles from which on the rounding of V over one (1e-14) is kept from adding up (`mirrored_gain`).
_MANY = 64

#: More events than any step holds.
_MOST_EVENTS = 16


#: Kinds of pieces: Üg > 0 not falling, Üg > 0 falling, Üg < 0.
RISES, FALLS, BELOW = 0, 1, 2


class Steps(NamedTuple):
    """The steps of the pieces of a wave: `counts[p]` of one `length[p]` on each.

    ``nodes[offset[p] + 2 * k]`` is w at the beginning of step k of piece p, followed by w at its middle and
    at its end (−0.0 where a negative piece is 0); `mirrored` is whether the halves of a cycle repeated
    often are, but for the sign, the same.
    """

    wave: Wave
    nodes: np.ndarray
    offset: np.ndarray
    counts: np.ndarray
    length: np.ndarray
    mirrored: bool
    per_cycle: int
    rule: int


def steps_of(wave: Wave, steps_per_cycle: int, rule: int) -> Steps:
    """Steps of all pieces of a wave, `steps_per_cycle` at least in a cycle, and the rule by which they are taken."""
    pieces = wave.pieces.shape[0]
    length = wave.pieces[:, FINISH] - wave.pieces[:, BEGIN]
    count = np.maximum(np.ceil(length / (2.0 * math.pi) * steps_per_cycle - 1e-9), 1.0).astype(np.int64)
    offset = np.empty(pieces, np.int64)
    parts: list[np.ndarray] = []
    known: dict[int, int] = {}
    size = 0
    for c in range(wave.shape.size):
        low, high = wave.cycle[c], wave.cycle[c + 1]
        same = known.setdefault(int(wave.shape[c]), c)
        if same != c:
            offset[low:high] = offset[wave.cycle[same] : wave.cycle[same + 1]]
            continue
        for p in range(low, high):
            offset[p] = size
            parts.append(_nodes(wave, p, int(count[p])))
            size += parts[-1].size
    nodes = np.concatenate(parts)
    mirrored = _mirrored(wave, nodes, offset, count)
    return Steps(wave, nodes, offset, count, length / count, mirrored, steps_per_cycle, rule)


def _nodes(wave: Wave, p: int, count: int) -> np.ndarray:
    """w at every half step of piece p."""
    # counted from the anchor, so that mirrored pieces have mirrored nodes
    tau = np.arange(2 * count + 1) * ((wave.pieces[p, FINISH] - wave.pieces[p, BEGIN]) / (2 * count))
    tau = -tau[::-1] if wave.pieces[p, FINISH] == 0.0 else tau
    nodes = np.zeros(tau.size)
    for k in range(int(wave.pieces[p, DEGREE]) - 1, -1, -1):
        nodes = (nodes + wave.pieces[p, COEFFICIENTS + TERM * k]) * tau
    nodes += wave.pieces[p, TOP]
    nodes[0], nodes[-1] = wave.pieces[p, FIRST], wave.pieces[p, LAST]
    side = math.copysign(1.0, wave.pieces[p, TOP])
    return side * np.maximum(side * nodes, 0.0)


def _mirrored(wave: Wave, nodes: np.ndarray, offset: np.ndarray, count: np.ndarray) -> bool:
    """Whether in a cycle repeated often w(φ + π) = −w(φ)."""
    if wave.repeats < _MANY:
        return False
    low, high = wave.cycle[wave.lead], wave.cycle[wave.lead + 1]
    if (high - low) % 2:
        return False
    half = (high - low) // 2
    for p in range(low, low + half):
        a, b = (slice(offset[q], offset[q] + 2 * count[q] + 1) for q in (p, p + half))
        if count[p] != count[p + half] or not np.allclose(nodes[a], -nodes[b], rtol=0.0, atol=1e-14):
            return False
    return True


@scalar
def node(steps: Steps, p: int, i: int) -> float:
    """τ on piece p at which step i begins."""
    return (i if steps.wave.pieces[p, BEGIN] == 0.0 else i - steps.counts[p]) * steps.length[p]


@scalar
def course_of(wave: Wave, p: int) -> int:
    """Whether Üg > 0 does not fall on piece p, falls, or Üg < 0."""
    if wave.pieces[p, TOP] < 0.0:
        return BELOW
    return RISES if wave.pieces[p, LAST] >= wave.pieces[p, FIRST] else FALLS


#: Rows of a state beside those of every solver's: the phase up to which the last slide needs steps of its own,
#: and how long its rate grows; the plane's acceleration where D has its maximum on the way up, and that up to
#: which friction is a layer thinner than steps.
REACH, LENGTH, TOUCH, LAYER = range(STATE_ROWS, STATE_ROWS + 4)
_STATE_SIZE = STATE_ROWS + 4


@in_lanes
def coefficients(rule: int, start: float, middle: float, end: float) -> tuple[float, float, float]:
    """c0, c1, c2 of the rate c0 + c1 s + c2 s², s in [0, 1] over the step."""
    if rule == RECTANGLE:
        return start, 0.0, 0.0
    if rule == TRAPEZOID:
        return start, end - start, 0.0
    return start, 4.0 * middle - 3.0 * start - end, 2.0 * (start + end) - 4.0 * middle


@in_lanes
def velocity_gain(c0: float, c1: float, c2: float, h: float, s: float) -> float:
    """∫ of the rate from 0 to s, over a step of phase h."""
    return h * s * (c0 + s * (0.5 * c1 + s * c2 / 3.0))


@in_lanes
def displacement_gain(c0: float, c1: float, c2: float, h: float, s: float) -> float:
    """∫∫ of the rate from 0 to s, over a step of phase h."""
    return h * h * s * s * (0.5 * c0 + s * (c1 / 6.0 + s * c2 / 12.0))


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


@scalar
def reset_state(block: Block, state: np.ndarray) -> None:
    """Fill the state of a block at rest that has not moved yet."""
    state[:] = 0.0
    state[BEGAN_AT], state[REACH], state[TOUCH] = -math.inf, -math.inf, math.inf
    if block.rise == NEWMARK:
        return
    if block.decay_rate * block.amplitude * _SHORTEST > _FOLDINGS * block.g:
        state[LAYER] = _FOLDINGS * block.g / block.decay_rate
    # D = x − E is concave only beyond the inflection of E: it has its maximum there, if at all, and none where
    # friction is steeper than the plane and decays by more than tan θ
    steep = block.mu_s < block.tan_theta or block.decay_rate < block.tan_theta
    if steep and response_and_slope(block, block.amplitude)[1] > 1.0:
        low = max(inflection(block), _LEAST_STEP * block.amplitude)
        if low < block.amplitude and response_and_slope(block, low)[1] < 1.0:
            state[TOUCH] = slope_root(block, 1.0, low, block.amplitude)


@scalar
def layer_of(block: Block, pieces: np.ndarray, p: int, state: np.ndarray) -> tuple[float, float]:
    """τ at which the layer of friction on piece p ends (or begins, where |Üg| falls), and its length."""
    outwards = pieces[p, FINISH] == 0.0
    near = pieces[p, BEGIN] if outwards else pieces[p, FINISH]
    if state[LAYER] <= block.amplitude * min(abs(pieces[p, FIRST]), abs(pieces[p, LAST])):
        return near, 0.0
    end = offset_at(pieces, p, block.amplitude, math.copysign(state[LAYER], pieces[p, TOP]))
    return end, abs(end - near)


@scalar
def longest_step(
    block: Block, steps: Steps, pieces: np.ndarray, p: int, tau: float, x: float, state: np.ndarray
) -> float:
    """The longest step from τ on that resolves a slide just begun and a layer of friction on the rise.

    It grows with the time since the slide's onset, but not before the short slides end that stop soon after
    the peak: over steps of one length the rectangle's errors on the way up and down cancel.
    """
    share, longest = _SHARE_OF_CYCLE / steps.per_cycle, math.inf
    phi = phase_at(pieces, p, tau)
    if phi < state[REACH]:
        longest = share * max(state[LENGTH], 0.25 * (phi - state[BEGAN_AT]))
    if x < state[LAYER]:
        longest = min(longest, share * layer_of(block, pieces, p, state)[1])
    return max(longest, _LEAST_STEP)


@scalar
def resolve_slide(pieces: np.ndarray, p: int, tau: float, turn: float, state: np.ndarray) -> None:
    """A slide begins at τ on piece p; its rate grows up to τ = `turn`."""
    phi, length = phase_at(pieces, p, tau), turn - tau
    state[LENGTH] = length
    state[REACH] = phi + 4.0 * _SHORTEST if length < _SHORTEST else -math.inf


@scalar
def resolve_fall(block: Block, pieces: np.ndarray, p: int, state: np.ndarray) -> None:
    """Along a piece on which Üg does not rise: if a slide begins with it, it grows up to where Üg = b."""
    if state[BEGAN_AT] == pieces[p, START]:
        level = pieces[p, FIRST] == pieces[p, LAST]
        turn = pieces[p, FINISH] if level else offset_at(pieces, p, block.amplitude, state[HELD])
        resolve_slide(pieces, p, pieces[p, BEGIN], turn, state)


@scalar
def tau_within(steps: Steps, p: int, k: int, amplitude: float, x: float) -> float:
    """τ at which Üg = x within step k of piece p: as `offset_at`, but from the ends of the step, which are known."""
    wave, at = steps.wave, steps.offset[p] + 2 * k
    low, high, w_low, w_high = node(steps, p, k), node(steps, p, k + 1), steps.nodes[at], steps.nodes[at + 2]
    if w_low == w_high:
        return low
    wanted = (x - amplitude * wave.pieces[p, TOP]) / amplitude
    tau = low + (high - low) * min(max((x / amplitude - w_low) / (w_high - w_low), 0.0), 1.0)
    if w_high > w_low:
        return offset_root((wave.pieces, p, wanted), low, high, tau, 0.0)
    return offset_root((wave.pieces, p, wanted), high, low, tau, 0.0)


@scalar
def hold_step(block: Block, rule: int, pieces: np.ndarray, p: int, start: float, end: float, state: np.ndarray) -> None:
    """From τ = start to end on piece p with b held, cut at the stop."""
    held, h, amplitude = state[HELD], end - start, block.amplitude
    c0, c1, c2 = coefficients(
        rule,
        plane(pieces, p, amplitude, start) - held,
        plane(pieces, p, amplitude, start + 0.5 * h) - held,
        plane(pieces, p, amplitude, end) - held,
    )
    take(c0, c1, c2, h, True, state)


@scalar
def whole_hold_step(
    rule: int, amplitude: float, w_start: float, w_middle: float, w_end: float, h: float, state: np.ndarray
) -> None:
    """A step of length h with b held, cut at the stop."""
    held = state[HELD]
    c0, c1, c2 = coefficients(rule, amplitude * w_start - held, amplitude * w_middle - held, amplitude * w_end - held)
    take(c0, c1, c2, h, True, state)


@scalar
def hold_steps(
    rule: int, amplitude: float, nodes: np.ndarray, at: int, count: int, h: float, state: np.ndarray
) -> None:
    """So many steps with b held, up to the stop; w from nodes[at] on."""
    for i in range(count):
        whole_hold_step(rule, amplitude, nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2], h, state)
        if state[SLIDES] == 0.0:
            break


@scalar
def fall_steps(
    block: Block, pieces: np.ndarray, steps: Steps, p: int, start: float, end: float, state: np.ndarray
) -> None:
    """From the beginning of piece p (τ = `start`) to `end` with b held, finer while a slide just begun asks for it."""
    rule, first, at = steps.rule, 0, steps.offset[p]
    whole = steps.counts[p] if end == pieces[p, FINISH] else int((end - start) / steps.length[p])
    resolve_fall(block, pieces, p, state)
    while first < whole and phase_at(pieces, p, node(steps, p, first)) < state[REACH]:
        tau, until = node(steps, p, first), node(steps, p, first + 1)
        while tau < until and state[SLIDES] > 0.0:
            cut = min(until, tau + longest_step(block, steps, pieces, p, tau, math.inf, state))
            hold_step(block, rule, pieces, p, tau, cut, state)
            tau = cut
        first += 1
    if state[SLIDES] > 0.0:
        hold_steps(rule, block.amplitude, steps.nodes, at + 2 * first, whole - first, steps.length[p], state)
    if state[SLIDES] > 0.0 and whole < steps.counts[p] and end > node(steps, p, whole):
        hold_step(block, rule, pieces, p, node(steps, p, whole), end, state)
    if state[SLIDES] == 0.0:
        state[STOPPED_AT] = pieces[p, END]


@scalar
def rise_step(block: Block, rule: int, steps: Steps, p: int, k: int, tau: float, x: float, state: np.ndarray) -> None:
    """From τ on piece p, where Üg = x rises, to the end of step k.

    Cut at Üg = Üy, at t1, at switches to and from the hold, and at the stop.
    """
    wave, amplitude, literal = steps.wave, block.amplitude, block.rise == LITERAL
    begin, end, at = node(steps, p, k), node(steps, p, k + 1), steps.offset[p] + 2 * k
    x_end, located = amplitude * steps.nodes[at + 2], True
    # of a slide's own steps (`longest_step`), which grow by share/4 from 1e-14 on, there are ln(1e13) 4/share
    for _ in range(_MOST_EVENTS + 3 * steps.per_cycle):
        if state[SLIDES] == 0.0:
            if x < block.yield_acceleration:
                if x_end <= block.yield_acceleration:
                    break
                x, located = block.yield_acceleration, False
            if block.rise == NEWMARK or relative_acceleration(block, x) > 0.0:
                held = starting_acceleration(block, x)
            else:
                top, touch = x_end, state[TOUCH]
                if relative_acceleration(block, x_end) <= 0.0:
                    if not (x < touch < x_end and relative_acceleration(block, touch) > 0.0):
                        break
                    top = touch
                x = held = relative_acceleration_root(block, x, top)  # where Eq. 4 meets Üg
                located = False
            if not located:
                tau, located = tau_within(steps, p, k, amplitude, x), True
            follows = literal or (held > block.yield_acceleration and response_and_slope(block, x)[1] > 0.0)
            state[FOLLOWS] = 1.0 if follows else 0.0
            turn = wave.pieces[p, FINISH]
            if x < state[TOUCH] < amplitude * wave.pieces[p, LAST]:
                turn = offset_at(wave.pieces, p, amplitude, state[TOUCH])
            begin_slide(min(held, x), phase_at(wave.pieces, p, tau), state)  # equal at an onset, but for rounding
            resolve_slide(wave.pieces, p, tau, turn, state)
        cut, x_cut, switches = end, x_end, False
        if state[REACH] > -math.inf or state[LAYER] > 0.0:
            longest = longest_step(block, steps, wave.pieces, p, tau, x, state)
            if longest < end - tau:
                cut = tau + longest
                x_cut = plane(wave.pieces, p, amplitude, cut)
        eq4, eq4_cut = 0.0, 0.0
        if block.rise != NEWMARK:
            eq4, slope = response_and_slope(block, x)
            eq4_cut = response(block, x_cut)
            if block.rise == MONOTONE:
                held = state[HELD]
                if state[FOLLOWS] == 0.0 and eq4_cut > held:
                    if eq4 < held or slope <= 0.0:
                        x_cut, eq4_cut, switches = response_root(block, held, x, x_cut), held, True
                    else:
                        state[FOLLOWS] = 1.0
                elif state[FOLLOWS] == 1.0 and eq4_cut < eq4:
                    if slope > 0.0:
                        x_cut, switches = slope_root(block, 0.0, x, x_cut), True
                        eq4_cut = response(block, x_cut)
                    else:
                        state[FOLLOWS] = 0.0
        if switches:
            cut = tau_within(steps, p, k, amplitude, x_cut)
        follows, held, h = state[FOLLOWS] == 1.0, state[HELD], cut - tau
        rate, middle = x - (eq4 if follows else held), 0.0
        if rule == SIMPSON:
            x_middle = amplitude * steps.nodes[at + 1]
            if tau != begin or cut != end:
                x_middle = plane(wave.pieces, p, amplitude, tau + 0.5 * h)
            middle = relative_acceleration(block, x_middle) if follows else x_middle - held
        c0, c1, c2 = coefficients(
            rule,
            rate if state[VELOCITY] > 0.0 else max(rate, 0.0),  # rounding may not stop what starts here
            middle,
            x_cut - (eq4_cut if follows else held),
        )
        fraction = take(c0, c1, c2, h, True, state)
        if state[SLIDES] == 0.0:
            cut = tau + fraction * h
            x_cut = plane(wave.pieces, p, amplitude, cut)
        elif follows:
            state[HELD] = eq4_cut
        if switches:
            state[FOLLOWS] = 1.0 - state[FOLLOWS]
        tau, x = cut, x_cut
        if tau >= end:
            break
    else:
        state[VELOCITY] = math.nan


@scalar
def rise_steps(block: Block, pieces: np.ndarray, steps: Steps, p: int, tau: float, x: float, state: np.ndarray) -> None:
    """Along piece p, on which Üg > 0 does not fall, from τ on, where Üg = x."""
    rule, nodes, at, h = steps.rule, steps.nodes, steps.offset[p], steps.length[p]
    share = (tau - pieces[p, BEGIN]) / (pieces[p, FINISH] - pieces[p, BEGIN])
    first = min(max(int(share * steps.counts[p]), 0), steps.counts[p] - 1)
    newmark, eq4 = block.rise == NEWMARK, math.nan
    for i in range(first, steps.counts[p]):
        x_end = block.amplitude * nodes[at + 2 * i + 2]
        if state[SLIDES] == 0.0 and x_end <= block.yield_acceleration:
            eq4 = math.nan
            continue
        eq4_end = -math.inf if newmark else response(block, x_end)
        # the step as it is where nothing happens in it, as in `lockstep_rise`
        if state[SLIDES] > 0.0 and i > first and state[REACH] == -math.inf and state[LAYER] == 0.0:
            x = block.amplitude * nodes[at + 2 * i]
            if not newmark and math.isnan(eq4):
                eq4 = response(block, x)
            follows, held, velocity, middle = state[FOLLOWS] > 0.0, state[HELD], state[VELOCITY], 0.0
            if rule == SIMPSON:
                x_middle = block.amplitude * nodes[at + 2 * i + 1]
                middle = relative_acceleration(block, x_middle) if follows else x_middle - held
            c0, c1, c2 = coefficients(rule, x - held, middle, x_end - (eq4_end if follows else held))
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            switches = block.rise == MONOTONE and (eq4_end < eq4 if follows else eq4_end > held)
            if not (switches or after <= 0.0 or (c0 > 0.0 and c0 + c1 + c2 < 0.0)):
                state[DISPLACEMENT] += velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
                state[VELOCITY] = after
                state[PEAK], state[LEAST] = max(state[PEAK], after), min(state[LEAST], after)
                if follows:
                    state[HELD] = eq4_end
                eq4 = eq4_end
                continue
        if i > first:
            tau, x = node(steps, p, i), block.amplitude * nodes[at + 2 * i]
        rise_step(block, rule, steps, p, i, tau, x, state)
        eq4 = eq4_end


@scalar
def note_nothing(steps: Steps, start: float, end: float, state: np.ndarray) -> None:
    """Steps are not sampled later."""


pulse_by_steps = pulse_of(rise_steps, fall_steps, note_nothing)


@scalar
def pulse(block: Block, options: Options, wave: Wave, steps: Steps, k: int, following: int, velocity: float) -> Pulse:
    """A pulse of a train (see `train`)."""
    state = np.empty((_STATE_SIZE, 1))[:, 0]  # spaced as a column of the lanes' states: functions serve both
    reset_state(block, state)
    return pulse_by_steps(block, options, wave, steps, k, following, velocity, state)


train = train_of(pulse)


@scalar
def continuous_step(
    block: Block, rule: int, steps: Steps, pieces: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> None:
    """From τ = start to end on piece p with Eq. 4 throughout, finer in a layer of friction."""
    layer, length = layer_of(block, pieces, p, state)
    edge = min(max(layer, start), end)
    outwards = pieces[p, FINISH] == 0.0
    finest = max(_SHARE_OF_CYCLE / steps.per_cycle * length, _LEAST_STEP)
    for first, last, within in ((start, edge, outwards), (edge, end, not outwards)):
        parts = 1 if last > first else 0
        if parts and within and length > 0.0:
            # rounding may not make the two sides of a zero differ
            parts = max(1, math.ceil(min((last - first) / finest, float(steps.per_cycle)) - 1e-6))
        h = (last - first) / max(parts, 1)
        for part in range(parts):
            tau = first + part * h
            x, x_middle = (
                plane(pieces, p, block.amplitude, tau),
                plane(pieces, p, block.amplitude, tau + 0.5 * h),
            )
            x_end = plane(pieces, p, block.amplitude, tau + h)
            c0, c1, c2 = coefficients(
                rule,
                sided_relative_acceleration(block, pieces, p, x),
                sided_relative_acceleration(block, pieces, p, x_middle),
                sided_relative_acceleration(block, pieces, p, x_end),
            )
            take(c0, c1, c2, h, False, state)


@scalar
def sided_relative_acceleration(block: Block, pieces: np.ndarray, p: int, x: float) -> float:
    """D at Üg = x on piece p, whose side of Üg = 0 it takes where rounding would take the other's."""
    return relative_acceleration(block, math.copysign(x, pieces[p, TOP]))


#: The first rows of the lanes' states, and the rows of the lanes beside the block's: D (or E) at the last node,
#: whether something happens in the step, whether the cell goes on without the lanes, |w| up to which
#: friction is a layer thinner than steps, W, V, b and the largest V before the cycle.  Row + j is cell j.
_VELOCITY, _DISPLACEMENT, _HELD, _PEAK, _LEAST, _SLIDES, _FOLLOWS = (
    row * TILE for row in (VELOCITY, DISPLACEMENT, HELD, PEAK, LEAST, SLIDES, FOLLOWS)
)
_EQ4, _HAPPENS, _WITHOUT_LANES, _THIN, _BEFORE, _BEFORE_V, _BEFORE_HELD, _BEFORE_PEAK, _GAIN = range(
    LANE_ROWS * TILE, (LANE_ROWS + 9) * TILE, TILE
)
_LANE_SIZE = (LANE_ROWS + 9) * TILE


@scalar
def leave_lanes(lanes: np.ndarray, states: np.ndarray, j: int) -> None:
    """Leave lane j at rest for good: its cell is not for lanes."""
    lanes[_WITHOUT_LANES + j], lanes[YIELD + j] = 1.0, math.inf
    states[_VELOCITY + j] = states[_SLIDES + j] = 0.0


@scalar
def lockstep_rise(
    count: int, rule: int, options: Options, steps: Steps, p: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Lanes along piece p, on which Üg > 0 does not fall."""
    literally(rule)
    columns = states.reshape((_STATE_SIZE, TILE))
    rise, g = options.rise, options.g
    nodes, at, h = steps.nodes, steps.offset[p], steps.length[p]
    first, least, going = 0, math.inf, 0
    for j in range(count):
        least = min(least, lanes[YIELD + j] / lanes[AMPLITUDE + j])
        going += 1 if states[_SLIDES + j] > 0.0 else 0
    if going == 0:
        # at rest below Üy nothing happens
        while first < steps.counts[p] and nodes[at + 2 * first + 2] <= least * (1.0 - 1e-15):
            first += 1
        if first == steps.counts[p]:
            return
    for j in range(count):
        lanes[_EQ4 + j] = lane_response(lanes, j, lanes[AMPLITUDE + j] * nodes[at + 2 * first], g)
    for i in range(first, steps.counts[p]):
        w_start, w_middle, w_end = nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2]
        events = 0
        for j in range(count):
            x, x_end = lanes[AMPLITUDE + j] * w_start, lanes[AMPLITUDE + j] * w_end
            slides, follows, held = states[_SLIDES + j] > 0.0, states[_FOLLOWS + j] > 0.0, states[_HELD + j]
            eq4 = lanes[_EQ4 + j]
            eq4_end = -math.inf if rise == NEWMARK else lane_response(lanes, j, x_end, g)
            lanes[_EQ4 + j] = eq4_end
            held_end = eq4_end if follows else held
            middle = 0.0
            if rule == SIMPSON:
                x_middle = lanes[AMPLITUDE + j] * w_middle
                eq4_middle = -math.inf if rise == NEWMARK else lane_response(lanes, j, x_middle, g)
                middle = x_middle - (eq4_middle if follows else held)
            c0, c1, c2 = coefficients(rule, x - held, middle, x_end - held_end)
            velocity = states[_VELOCITY + j]
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            switches = (rise == MONOTONE) & (follows & (eq4_end < eq4) | (not follows) & (eq4_end > held))
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            irregular = switches | turns | (after <= 0.0)
            starts = (x_end > lanes[YIELD + j]) & (x_end > eq4_end)
            happens = irregular if slides else starts
            goes = slides & (not happens)
            states[_VELOCITY + j] = after if goes else velocity
            states[_DISPLACEMENT + j] += moved if goes else 0.0
            states[_HELD + j] = held_end if goes else held
            states[_PEAK + j] = max(states[_PEAK + j], after if goes else 0.0)
            lanes[_HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
        if events > 0:
            for j in range(count):
                if lanes[_HAPPENS + j] > 0.0:
                    block, state = block_at(cells, where[j], options), columns[:, j]
                    rise_step(block, rule, steps, p, i, node(steps, p, i), block.amplitude * w_start, state)
                    if state[REACH] > -math.inf:
                        leave_lanes(lanes, states, j)


@scalar
def lockstep_fall(
    count: int, rule: int, options: Options, steps: Steps, p: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Lanes along piece p with b held, or until all have stopped."""
    literally(rule)
    columns = states.reshape((_STATE_SIZE, TILE))
    nodes, at, h = steps.nodes, steps.offset[p], steps.length[p]
    for i in range(steps.counts[p]):
        w_start, w_middle, w_end = nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2]
        events, going = 0, 0
        for j in range(count):
            amplitude, held, velocity = lanes[AMPLITUDE + j], states[_HELD + j], states[_VELOCITY + j]
            slides = states[_SLIDES + j] > 0.0
            c0, c1, c2 = coefficients(
                rule, amplitude * w_start - held, amplitude * w_middle - held, amplitude * w_end - held
            )
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            happens = slides & (turns | (after <= 0.0))
            goes = slides & (not happens)
            states[_VELOCITY + j] = after if goes else velocity
            states[_DISPLACEMENT + j] += moved if goes else 0.0
            states[_PEAK + j] = max(states[_PEAK + j], after if goes else velocity)
            lanes[_HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
            going += 1 if slides else 0
        if going == 0:
            break
        if events > 0:
            for j in range(count):
                if lanes[_HAPPENS + j] > 0.0:
                    whole_hold_step(rule, lanes[AMPLITUDE + j], w_start, w_middle, w_end, h, columns[:, j])


@scalar
def until_next(block: Block, wave: Wave, p: int) -> float:
    """Phase from the beginning of piece p to where Üg next comes to Üy on the rise, or jumps past it."""
    waited = 0.0
    for q in range(p, wave.pieces.shape[0]):
        if block.amplitude * max(wave.pieces[q, FIRST], wave.pieces[q, LAST]) > block.yield_acceleration:
            if block.amplitude * wave.pieces[q, FIRST] >= block.yield_acceleration:
                return waited
            return waited + (
                offset_at(wave.pieces, q, block.amplitude, block.yield_acceleration) - wave.pieces[q, BEGIN]
            )
        waited += wave.pieces[q, FINISH] - wave.pieces[q, BEGIN]
    return math.inf


@scalar
def reset_held_in_lane(block: Block, wave: Wave, p: int, state: np.ndarray) -> None:
    """What the beginning of piece p, after a jump upwards or a fall, asks of a lane; its rise begins a slide itself."""
    if state[SLIDES] > 0.0 or wave.pieces[p, FIRST] > wave.pieces[p, LAST]:
        reset_held(block, wave.pieces, p, block.amplitude * wave.pieces[p, FIRST], state)
        resolve_fall(block, wave.pieces, p, state)


@scalar
def stick_slip_cycle(
    count: int, rule: int, options: Options, steps: Steps, c: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Stick-slip lanes through cycle c of the table; one that carries velocity into a new slide is set aside."""
    literally(rule)
    columns = states.reshape((_STATE_SIZE, TILE))
    wave = steps.wave
    pieces = wave.pieces.shape[0]
    for p in range(wave.cycle[c], wave.cycle[c + 1]):
        kind = course_of(wave, p)
        before = BELOW if p == 0 else course_of(wave, p - 1)
        rises_on = kind == RISES and before == RISES and wave.pieces[p, JUMPS] == 0.0
        if kind != BELOW and not rises_on and rises_anew(wave.pieces, p):
            for j in range(count):
                if lanes[_WITHOUT_LANES + j] == 0.0:
                    reset_held_in_lane(block_at(cells, where[j], options), wave, p, columns[:, j])
                    if columns[REACH, j] > -math.inf:
                        leave_lanes(lanes, states, j)
        if options.rise == LITERAL and kind != RISES and before != kind:
            for j in range(count):
                if states[_SLIDES + j] > 0.0 and states[_HELD + j] <= 0.0:
                    leave_lanes(lanes, states, j)
        if kind == RISES:
            lockstep_rise(count, rule, options, steps, p, cells, where, lanes, states)
        elif kind == FALLS or options.recoupling == INTEGRATE:
            lockstep_fall(count, rule, options, steps, p, cells, where, lanes, states)
        elif before != BELOW:
            pause, q = 0.0, p
            while q < pieces and wave.pieces[q, TOP] < 0.0:
                pause += wave.pieces[q, FINISH] - wave.pieces[q, BEGIN]
                q += 1
            for j in range(count):
                if states[_SLIDES + j] > 0.0:
                    held, velocity = states[_HELD + j], states[_VELOCITY + j]
                    wait = math.inf
                    if velocity > held * pause:  # else it stops before Üg > 0
                        wait = until_next(block_at(cells, where[j], options), wave, p)
                    states[_DISPLACEMENT + j] += eq.attenuated_displacement(velocity, held, wait)
                    states[_VELOCITY + j] = states[_SLIDES + j] = 0.0
                    if eq.attenuated_velocity(velocity, held, wait) > 0.0:
                        leave_lanes(lanes, states, j)
        if kind == BELOW and p + 1 < pieces and wave.pieces[p + 1, TOP] > 0.0:
            for j in range(count):
                if states[_SLIDES + j] > 0.0:
                    leave_lanes(lanes, states, j)


@scalar
def stick_slip_lanes(
    count: int, rule: int, options: Options, steps: Steps, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    states: np.ndarray, motion: np.ndarray, codes: np.ndarray,
) -> None:  # fmt: skip
    """Stick-slip: pulses from rest in lockstep; cells that do not come to rest in one go on pulse by pulse."""
    literally(rule)
    columns = states.reshape((_STATE_SIZE, TILE))
    wave, whole = steps.wave, whole_lanes(count)
    for j in range(whole):
        state = columns[:, j]
        reset_state(block_at(cells, where[j], options), state)
        lanes[_WITHOUT_LANES + j] = 0.0
        if state[LAYER] > 0.0 or state[TOUCH] < math.inf:
            leave_lanes(lanes, states, j)
    for c in range(wave.shape.size):
        times = 1.0
        if c == wave.lead and wave.repeats > 0:
            times = wave.repeats + (1.0 if wave.alike else 0.0)
        for j in range(whole):
            lanes[_BEFORE + j], lanes[_BEFORE_V + j] = states[_DISPLACEMENT + j], states[_VELOCITY + j]
            lanes[_BEFORE_HELD + j] = states[_HELD + j] if states[_SLIDES + j] > 0.0 else 0.0
        stick_slip_cycle(whole, rule, options, steps, c, cells, where, lanes, states)
        for j in range(whole):
            before = lanes[_BEFORE + j]
            states[_DISPLACEMENT + j] = before + times * (states[_DISPLACEMENT + j] - before)
            # one cycle stands for all only if it ends in the state in which it began
            held = states[_HELD + j] if states[_SLIDES + j] > 0.0 else 0.0
            if times > 1.0 and (states[_VELOCITY + j] != lanes[_BEFORE_V + j] or held != lanes[_BEFORE_HELD + j]):
                leave_lanes(lanes, states, j)
        if c == wave.lead and wave.alike:
            break
    highest = 0.0
    for height in wave.height:
        highest = max(highest, height)
    for j in range(count):
        block = block_at(cells, where[j], options)
        # the shaking may end in a rise, which leaves b <= 0 where none is held any more
        if lanes[_WITHOUT_LANES + j] > 0.0 or (states[_SLIDES + j] > 0.0 and states[_HELD + j] <= 0.0):
            found = train(block, options, wave, steps)
        else:
            moved = states[_DISPLACEMENT + j]
            if states[_SLIDES + j] > 0.0:
                moved += eq.attenuated_displacement(states[_VELOCITY + j], states[_HELD + j], math.inf)
            slides = block.amplitude * highest > block.yield_acceleration
            validity = YIELD_GOVERNS if slides and yield_governs(block, wave) else 0
            found = Motion(moved, states[_PEAK + j], validity)
        store_motion(found, where[j], motion, codes)


@scalar
def continuous_cycle(
    count: int, rule: int, options: Options, steps: Steps, c: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Continuous lanes through cycle c of the table, from the first Üg ≥ Üy on."""
    literally(rule)
    columns = states.reshape((_STATE_SIZE, TILE))
    g, wave, nodes = options.g, steps.wave, steps.nodes
    thickest = 0.0
    for j in range(count):
        thickest = max(thickest, lanes[_THIN + j])
    for p in range(wave.cycle[c], wave.cycle[c + 1]):
        starting = False
        for j in range(count):
            starting = starting | (states[_SLIDES + j] == 0.0)
        at, h = steps.offset[p], steps.length[p]
        for j in range(count):
            lanes[_EQ4 + j] = lane_relative_acceleration(lanes, j, lanes[AMPLITUDE + j] * nodes[at], g)
        for i in range(steps.counts[p]):
            w_start, w_middle, w_end = nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2]
            near = min(abs(w_start), abs(w_end))
            layered = near < thickest
            events = 0
            for j in range(count):
                x, x_end = lanes[AMPLITUDE + j] * w_start, lanes[AMPLITUDE + j] * w_end
                rate, rate_end = lanes[_EQ4 + j], lane_relative_acceleration(lanes, j, x_end, g)
                lanes[_EQ4 + j] = rate_end
                middle = 0.0
                if rule == SIMPSON:
                    middle = lane_relative_acceleration(lanes, j, lanes[AMPLITUDE + j] * w_middle, g)
                c0, c1, c2 = coefficients(rule, rate, middle, rate_end)
                velocity, began = states[_VELOCITY + j], (not starting) | (states[_SLIDES + j] > 0.0)
                after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
                moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
                turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
                begins = max(x, x_end) > lanes[YIELD + j]
                happens = (turns | (layered & (near < lanes[_THIN + j]))) if began else begins
                goes = began & (not happens)
                states[_VELOCITY + j] = after if goes else velocity
                states[_DISPLACEMENT + j] += moved if goes else 0.0
                states[_PEAK + j] = max(states[_PEAK + j], after if goes else velocity)
                lanes[_HAPPENS + j] = 1.0 if happens else 0.0
                events += 1 if happens else 0
            if events > 0:
                for j in range(count):
                    if lanes[_HAPPENS + j] > 0.0:
                        block, state = block_at(cells, where[j], options), columns[:, j]
                        start = node(steps, p, i)
                        if state[SLIDES] == 0.0 and block.amplitude * w_start < block.yield_acceleration:
                            start = offset_at(wave.pieces, p, block.amplitude, block.yield_acceleration)
                        state[SLIDES] = 1.0
                        continuous_step(block, rule, steps, wave.pieces, p, start, node(steps, p, i + 1), state)


@scalar
def mirrored_gain(count: int, rule: int, options: Options, steps: Steps, c: int, lanes: np.ndarray) -> None:
    """Gain of V of continuous lanes over cycle c, whose halves mirror each other: what both sides share, twice.

    The rest cancels.  In V it would leave its rounding, and on a plane nearly level that is more than the gain.
    """
    literally(rule)
    wave, nodes = steps.wave, steps.nodes
    for j in range(count):
        lanes[_GAIN + j] = 0.0
    stride = 1 if rule == SIMPSON else 2
    for p in range(wave.cycle[c], wave.cycle[c + 1]):
        if wave.pieces[p, TOP] > 0.0:
            at, last = steps.offset[p], 2 * steps.counts[p]
            for k in range(0, last + 1, stride):
                # what the step before k and that behind it give the node
                c0, c1, c2 = coefficients(rule, 0.0, 1.0 if k % 2 else 0.0, 0.0 if k % 2 or k == 0 else 1.0)
                share = velocity_gain(c0, c1, c2, steps.length[p], 1.0)
                c0, c1, c2 = coefficients(rule, 0.0 if k % 2 or k == last else 1.0, 0.0, 0.0)
                share += velocity_gain(c0, c1, c2, steps.length[p], 1.0)
                w = nodes[at + k]
                for j in range(count):
                    lanes[_GAIN + j] += 2.0 * share * lane_drift(lanes, j, lanes[AMPLITUDE + j] * w)


@scalar
def continuous_lanes(
    count: int, rule: int, options: Options, steps: Steps, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    states: np.ndarray, motion: np.ndarray, codes: np.ndarray,
) -> None:  # fmt: skip
    """Continuous sliding, cycle by cycle; repeated ones are stepped twice, the later ones follow from the second."""
    literally(rule)
    columns = states.reshape((_STATE_SIZE, TILE))
    wave, whole = steps.wave, whole_lanes(count)
    for j in range(whole):
        state = columns[:, j]
        reset_state(block_at(cells, where[j], options), state)
        lanes[_THIN + j] = state[LAYER] / lanes[AMPLITUDE + j]
    for c in range(wave.shape.size):
        continuous_cycle(whole, rule, options, steps, c, cells, where, lanes, states)
        if c != wave.lead or wave.repeats == 0:
            continue
        times = wave.repeats - 1.0 + (1.0 if wave.alike else 0.0)
        if times > 0.0:
            for j in range(whole):
                lanes[_BEFORE + j], lanes[_BEFORE_V + j] = states[_DISPLACEMENT + j], states[_VELOCITY + j]
                lanes[_BEFORE_PEAK + j], states[_PEAK + j] = states[_PEAK + j], states[_VELOCITY + j]
            continuous_cycle(whole, rule, options, steps, c, cells, where, lanes, states)
            if steps.mirrored:
                mirrored_gain(whole, rule, options, steps, c, lanes)
            for j in range(whole):
                moved, velocity = states[_DISPLACEMENT + j] - lanes[_BEFORE + j], lanes[_BEFORE_V + j]
                gain = lanes[_GAIN + j] if steps.mirrored else states[_VELOCITY + j] - velocity
                peak = states[_PEAK + j] + max(0.0, (times - 1.0) * gain)
                states[_PEAK + j] = max(lanes[_BEFORE_PEAK + j], peak)
                states[_VELOCITY + j] = velocity + times * gain
                states[_DISPLACEMENT + j] = lanes[_BEFORE + j] + times * (moved + math.pi * gain * (times - 1.0))
        if wave.alike:
            break
    for j in range(count):
        store_motion(Motion(states[_DISPLACEMENT + j], states[_PEAK + j], 0), where[j], motion, codes)


@scalar
def solve_cells(
    cells: np.ndarray, count: int, rule: int, options: Options, steps: Steps, motion: np.ndarray, codes: np.ndarray
) -> None:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity.

    `rule` is a compile-time constant: with it the loops over lanes lose the middle of the
    step, which only Simpson's rule wants (rectangle, 1.7 against 5.3 ns a step).
    """
    literally(rule)
    where = np.empty(TILE, np.int64)
    lanes, states = np.empty(_LANE_SIZE), np.empty(_STATE_SIZE * TILE)
    for wanted in (STICK_SLIP, CONTINUOUS):
        lane = 0
        for j in range(count):
            block = block_at(cells, j, options)
            if wanted == STICK_SLIP:
                codes[0, j], codes[1, j] = block.sliding_mode, validity_before(block, steps.wave)
                motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
            if block.sliding_mode == wanted:
                lane_of(block, lanes, lane)
                where[lane] = j
                lane += 1
        for spare in range(lane, whole_lanes(lane)):  # repeats the first, see `whole_lanes`
            where[spare] = where[0]
            for row in range(LANE_ROWS):
                lanes[row * TILE + spare] = lanes[row * TILE]
        if lane > 0 and wanted == STICK_SLIP:
            stick_slip_lanes(lane, rule, options, steps, cells, where, lanes, states, motion, codes)
        elif lane > 0:
            continuous_lanes(lane, rule, options, steps, cells, where, lanes, states, motion, codes)
