"""A pulse by steps, cut at the events inside them, cell by cell: what is no matter of lanes.

State arrays as in `slides`; docs/numerics.md#step-solver.
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    LITERAL,
    MONOTONE,
    NEWMARK,
    Block,
    Options,
    relative_acceleration,
    relative_acceleration_root,
    response,
    response_and_slope,
    response_root,
    slope_root,
    starting_acceleration,
)
from slipsweep.kernels.excitation import offset_at, phase_at, plane
from slipsweep.kernels.pulse import (
    DISPLACEMENT,
    FOLLOWS,
    HELD,
    LEAST,
    PEAK,
    SLIDES,
    STOPPED_AT,
    VELOCITY,
    Pulse,
    begin_slide,
    pulse_of,
)
from slipsweep.kernels.step.rates import SIMPSON, coefficients, displacement_gain, take, velocity_gain
from slipsweep.kernels.step.slides import (
    LAYER,
    REACH,
    STATE_SIZE,
    TOUCH,
    longest_step,
    reset_state,
    resolve_fall,
    resolve_slide,
)
from slipsweep.kernels.step.table import Steps, node, tau_within
from slipsweep.kernels.train import train_of
from slipsweep.motion.pieces import BEGIN, END, FINISH, LAST, Wave

#: More events than any step holds.
_MOST_EVENTS = 16


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
    state = np.empty((STATE_SIZE, 1))[:, 0]  # spaced as a column of the lanes' states: functions serve both
    reset_state(block, state)
    return pulse_by_steps(block, options, wave, steps, k, following, velocity, state)


train = train_of(pulse)
