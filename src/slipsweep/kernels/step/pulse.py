"""A pulse by steps, cut at the events inside them, cell by cell: the part without lanes.

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
    inflection,
    relative_acceleration,
    relative_acceleration_root,
    response,
    response_and_slope,
    response_root,
    slope_root,
    starting_acceleration,
)
from slipsweep.kernels.events import first_of
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
from slipsweep.kernels.step.lanes import (
    EQ4,
    HAPPENS,
    MIDDLE,
    RATE,
    Room,
    X,
    advance,
    eq4_rates,
    first_event,
    held_rates,
    take_followed,
)
from slipsweep.kernels.step.rates import SIMPSON, coefficients, take
from slipsweep.kernels.step.slides import (
    LAYER,
    REACH,
    TOUCH,
    longest_step,
    reset_state,
    resolve_fall,
    resolve_slide,
)
from slipsweep.kernels.step.table import AHEAD, Steps, node
from slipsweep.kernels.train import train_of
from slipsweep.motion.pieces import BEGIN, END, FINISH, FIRST, LAST, TOP, Wave

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
def held_velocity(block: Block, steps: Steps, p: int, i: int, k: int, state: np.ndarray) -> float:
    """V at node k of piece p, with b held from node i on."""
    at = steps.offset[p]
    excess = block.amplitude * steps.wave.pieces[p, TOP] - state[HELD]
    gained = block.amplitude * (steps.once[at + k] - steps.once[at + i])
    return state[VELOCITY] + (excess * ((k - i) * steps.length[p]) + gained)


@scalar
def take_held(block: Block, steps: Steps, p: int, i: int, k: int, state: np.ndarray) -> None:
    """All steps from node i to node k of piece p with b held; V does not turn between them."""
    at, duration = steps.offset[p], (k - i) * steps.length[p]
    excess = block.amplitude * steps.wave.pieces[p, TOP] - state[HELD]
    moved = steps.twice[at + k] - steps.twice[at + i] - steps.once[at + i] * duration
    after = held_velocity(block, steps, p, i, k, state)
    state[DISPLACEMENT] += (state[VELOCITY] + 0.5 * excess * duration) * duration + block.amplitude * moved
    state[VELOCITY] = after
    state[PEAK], state[LEAST] = max(state[PEAK], after), min(state[LEAST], after)


@scalar
def take_one_held(block: Block, steps: Steps, p: int, i: int, state: np.ndarray) -> None:
    """Step i of piece p with b held, cut at the stop."""
    at, amplitude, held = steps.offset[p] + i, block.amplitude, state[HELD]
    rates = amplitude * steps.nodes[at] - held, amplitude * steps.middles[at] - held
    c0, c1, c2 = coefficients(steps.rule, rates[0], rates[1], amplitude * steps.nodes[at + 1] - held)
    take(c0, c1, c2, steps.length[p], True, state)


@scalar
def _is_below(where: tuple[np.ndarray, int, float, float], k: int) -> bool:
    nodes, at, amplitude, level = where
    return amplitude * nodes[at + k] < level


@scalar
def _has_stopped(where: tuple[Block, Steps, int, int, np.ndarray], k: int) -> bool:
    block, steps, p, i, state = where
    return held_velocity(block, steps, p, i, k, state) <= 0.0


@scalar
def _has_reached(where: tuple[np.ndarray, int, float, float], k: int) -> bool:
    nodes, at, amplitude, level = where
    return amplitude * nodes[at + k] >= level


_first_below = first_of(_is_below)
_first_stopped = first_of(_has_stopped)
_first_reached = first_of(_has_reached)


@scalar
def hold_one_way(block: Block, steps: Steps, p: int, i: int, until: int, state: np.ndarray) -> None:
    """Steps i to `until` of piece p with b held, up to the stop, where V only grows or only falls."""
    if i >= until or state[SLIDES] == 0.0:
        return
    if held_velocity(block, steps, p, i, until, state) > 0.0:
        take_held(block, steps, p, i, until, state)
        return
    stopped = _first_stopped((block, steps, p, i, state), i + 1, until)
    take_held(block, steps, p, i, stopped - 1, state)
    take_one_held(block, steps, p, stopped - 1, state)
    if state[SLIDES] > 0.0 and stopped < until:  # but for rounding
        take_one_held(block, steps, p, stopped, state)


@scalar
def hold_steps(block: Block, room: Room, p: int, i: int, until: int, state: np.ndarray) -> None:
    """Steps i to `until` of piece p with b held, up to the stop.

    V turns where Üg passes b: where Üg falls it is largest there, where Üg rises, after t5, least.
    """
    steps, level, at, turn = room.steps, state[HELD], room.steps.offset[p], until + 1
    where = (steps.nodes, at, block.amplitude, level)
    if block.amplitude * steps.nodes[at + i] > level:
        turn = _first_below(where, i + 1, until + 1)
    elif steps.wave.pieces[p, FIRST] < steps.wave.pieces[p, LAST]:
        turn = _first_reached(where, i + 1, until + 1)
    hold_one_way(block, steps, p, i, turn - 1, state)
    if turn <= until and state[SLIDES] > 0.0:
        take_one_held(block, steps, p, turn - 1, state)
        hold_one_way(block, steps, p, turn, until, state)


@scalar
def fall_steps(
    block: Block, pieces: np.ndarray, room: Room, p: int, start: float, end: float, state: np.ndarray
) -> float:
    """From the beginning of piece p (τ = `start`) to `end` with b held, finer while a slide just begun asks for it.

    Where on the piece the block stops is not kept: no waveform has a plateau on which it does, and elsewhere nothing
    follows from it.
    """
    steps, first = room.steps, 0
    whole = steps.counts[p] if end == pieces[p, FINISH] else int((end - start) / steps.length[p])
    resolve_fall(block, pieces, p, state)
    while first < whole and phase_at(pieces, p, node(steps, p, first)) < state[REACH]:
        tau, until = node(steps, p, first), node(steps, p, first + 1)
        while tau < until and state[SLIDES] > 0.0:
            cut = min(until, tau + longest_step(block, steps, pieces, p, tau, math.inf, state))
            hold_step(block, steps.rule, pieces, p, tau, cut, state)
            tau = cut
        first += 1
    if state[SLIDES] > 0.0:
        hold_steps(block, room, p, first, whole, state)
    if state[SLIDES] > 0.0 and whole < steps.counts[p] and end > node(steps, p, whole):
        hold_step(block, steps.rule, pieces, p, node(steps, p, whole), end, state)
    if state[SLIDES] == 0.0:
        state[STOPPED_AT] = pieces[p, END]
    return end


@scalar
def rise_step(block: Block, steps: Steps, p: int, k: int, tau: float, x: float, state: np.ndarray) -> None:
    """From τ on piece p, where Üg = x rises, to the end of step k.

    Cut at Üg = Üy, at t1, at switches to and from the hold, and at the stop.
    """
    wave, amplitude, literal, rule = steps.wave, block.amplitude, block.rise == LITERAL, steps.rule
    begin, end, at = node(steps, p, k), node(steps, p, k + 1), steps.offset[p] + k
    x_end, located = amplitude * steps.nodes[at + 1], True
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
                tau, located = min(max(offset_at(wave.pieces, p, amplitude, x), begin), end), True
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
            cut = min(max(offset_at(wave.pieces, p, amplitude, x_cut), tau), end)
        follows, held, h = state[FOLLOWS] == 1.0, state[HELD], cut - tau
        rate, middle = x - (eq4 if follows else held), 0.0
        if rule == SIMPSON:
            x_middle = amplitude * steps.middles[at]
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
def steps_to_event(block: Block, p: int, i: int, most: int, state: np.ndarray, room: Room) -> int:
    """Steps from i on, `most` at most, before the one on the rise in which something happens; rates of V in the lanes.

    To a block that slides: a switch to or from the hold, or a largest V.  To one at rest: its onset.
    """
    steps, lanes, amplitude, at = room.steps, room.lanes, block.amplitude, room.steps.offset[p] + i
    slides, follows, held = state[SLIDES] > 0.0, state[FOLLOWS] > 0.0, state[HELD]
    monotone, touch, yields = block.rise == MONOTONE, state[TOUCH], block.yield_acceleration
    if block.rise == NEWMARK:
        for k in range(AHEAD):
            lanes[EQ4 + k] = math.inf
    else:
        eq4_rates(block, steps.nodes, at, most, EQ4, lanes)
    w = steps.nodes[at : at + AHEAD]
    for k in range(AHEAD):
        lanes[X + k] = amplitude * w[k]
    events = 0
    for k in range(AHEAD):
        x, x_end, rate, rate_end = lanes[X + k], lanes[X + k + 1], lanes[EQ4 + k], lanes[EQ4 + k + 1]
        eq4, eq4_end = x - rate, x_end - rate_end
        rate = rate if follows else x - held
        rate_end = rate_end if follows else x_end - held
        lanes[RATE + k] = rate
        switches = monotone & (eq4_end < eq4 if follows else eq4_end > held)
        turns = (rate > 0.0) & (rate_end < 0.0)
        starts = ((x_end > yields) & (lanes[EQ4 + k + 1] > 0.0)) | ((x < touch) & (touch < x_end))
        happens = (switches | turns if slides else starts) & (k < most)
        lanes[HAPPENS + k] = 1.0 if happens else 0.0
        events += 1 if happens else 0
    return first_event(most, lanes) if events > 0 else most


@scalar
def rise_ahead(block: Block, p: int, i: int, state: np.ndarray, room: Room) -> int:
    """Take the steps from i on, on the rise, in which nothing happens, as many as the lanes hold; how many."""
    steps, lanes, amplitude = room.steps, room.lanes, block.amplitude
    at, follows = steps.offset[p] + i, state[FOLLOWS] > 0.0
    most = steps_to_event(block, p, i, min(steps.counts[p] - i, AHEAD - 1), state, room)
    if state[SLIDES] == 0.0:
        return most
    if steps.rule == SIMPSON and follows:
        eq4_rates(block, steps.middles, at, most, MIDDLE, lanes)
    elif steps.rule == SIMPSON:
        held_rates(amplitude, state[HELD], steps.middles, at, MIDDLE, lanes)
    taken = advance(steps, p, most, True, state, lanes)
    if follows:
        state[HELD] = amplitude * steps.nodes[at + taken] - lanes[EQ4 + taken]
    return taken


@scalar
def quiet_steps(block: Block, steps: Steps, p: int, i: int, state: np.ndarray) -> int:
    """Steps from i on, on the rise, in which nothing happens; -1 if not known.

    Beyond the inflection E is convex, so that it grows on where it grows, and E − b and D each change their sign once
    at most, D not at all between two places where it is positive.
    """
    at, end, slides, held = steps.offset[p], steps.counts[p], state[SLIDES] > 0.0, state[HELD]
    follows = slides and state[FOLLOWS] > 0.0
    x, top = block.amplitude * steps.nodes[at + i], block.amplitude * steps.nodes[at + end]
    if slides and not follows and x < held:
        return -1
    if block.rise == NEWMARK:
        return end - i if slides else -1
    if x < inflection(block):
        return -1
    if follows:
        grows = relative_acceleration(block, x) > 0.0 and relative_acceleration(block, top) > 0.0
        return end - i if grows and (block.rise == LITERAL or response_and_slope(block, x)[1] > 0.0) else -1
    if x < block.yield_acceleration or state[TOUCH] < math.inf:
        return -1
    if slides:
        if response(block, top) <= held:
            return end - i
        if response(block, x) >= held:
            return 0
        level = response_root(block, held, x, top)
    else:
        if relative_acceleration(block, top) <= 0.0:
            return end - i
        if relative_acceleration(block, x) >= 0.0:
            return 0
        level = relative_acceleration_root(block, x, top)
    return _first_reached((steps.nodes, at, block.amplitude, level), i + 1, end) - 1 - i


@scalar
def take_quiet(block: Block, steps: Steps, p: int, i: int, state: np.ndarray) -> int:
    """Take the steps from i on, on the rise, in which nothing happens; how many, -1 if not known."""
    quiet = quiet_steps(block, steps, p, i, state)
    if quiet <= 0 or state[SLIDES] == 0.0:
        return quiet
    if state[FOLLOWS] == 0.0:
        take_held(block, steps, p, i, i + quiet, state)
    else:
        take_followed(block, steps, p, i, i + quiet, state)
        state[HELD] = response(block, block.amplitude * steps.nodes[steps.offset[p] + i + quiet])
    return quiet


@scalar
def rise_steps(block: Block, pieces: np.ndarray, room: Room, p: int, tau: float, x: float, state: np.ndarray) -> None:
    """Along piece p, on which Üg > 0 does not fall, from τ on, where Üg = x."""
    steps = room.steps
    share = (tau - pieces[p, BEGIN]) / (pieces[p, FINISH] - pieces[p, BEGIN])
    i = min(max(int(share * steps.counts[p]), 0), steps.counts[p] - 1)
    rise_step(block, steps, p, i, tau, x, state)
    i += 1
    while i < steps.counts[p]:
        if state[SLIDES] == 0.0 or (state[REACH] == -math.inf and state[LAYER] == 0.0):
            quiet = take_quiet(block, steps, p, i, state)
            taken = quiet if quiet >= 0 else rise_ahead(block, p, i, state, room)
            i += taken
            if quiet < 0 and taken == AHEAD - 1:
                continue
        if i < steps.counts[p]:
            rise_step(block, steps, p, i, node(steps, p, i), block.amplitude * steps.nodes[steps.offset[p] + i], state)
            i += 1


@scalar
def note_nothing(room: Room, start: float, end: float, state: np.ndarray) -> None:
    """Steps are not sampled later."""


pulse_by_steps = pulse_of(rise_steps, fall_steps, note_nothing)


@scalar
def pulse(block: Block, options: Options, wave: Wave, room: Room, k: int, following: int, velocity: float) -> Pulse:
    """A pulse of a train (see `train`)."""
    reset_state(block, room.state)
    return pulse_by_steps(block, options, wave, room, k, following, velocity, room.state)


train = train_of(pulse)
