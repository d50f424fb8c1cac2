"""Continuous sliding by steps: what a cycle adds to V and W, from which the repeated ones follow.

docs/numerics.md#step-solver and docs/numerics.md#continuous-sliding
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import Block, Motion, friction, relative_acceleration
from slipsweep.kernels.events import first_of
from slipsweep.kernels.excitation import offset_at, plane
from slipsweep.kernels.pulse import DISPLACEMENT, PEAK, VELOCITY
from slipsweep.kernels.step.lanes import MIDDLE, RATE, Room, advance, eq4_rates, node_rate, steps_to_turn, take_followed
from slipsweep.kernels.step.rates import RECTANGLE, SIMPSON, coefficients, take, velocity_gain
from slipsweep.kernels.step.slides import LAYER, LEAST_STEP, SHARE_OF_CYCLE, layer_of, reset_state
from slipsweep.kernels.step.table import AHEAD, Steps, node
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, LAST, TOP

#: From so many steps on a piece's are summed at once: to find the one in which V turns takes as long as 20 to 60 steps.
_AT_ONCE = 2 * AHEAD


class Gain(NamedTuple):
    """What a part of the shaking adds to V and W of a block at rest before it, its largest V, and how long it is."""

    velocity: float
    displacement: float
    peak: float
    phase: float


@scalar
def then(before: Gain, after: Gain) -> Gain:
    """One part of the shaking and the next as one."""
    return Gain(
        before.velocity + after.velocity,
        before.displacement + before.velocity * after.phase + after.displacement,
        max(before.peak, before.velocity + after.peak),
        before.phase + after.phase,
    )


@scalar
def continuous_step(
    block: Block, rule: int, steps: Steps, pieces: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> None:
    """From τ = start to end on piece p with Eq. 4 throughout, finer in a layer of friction."""
    layer, length = layer_of(block, pieces, p, state)
    edge = min(max(layer, start), end)
    outwards = pieces[p, FINISH] == 0.0
    finest = max(SHARE_OF_CYCLE / steps.per_cycle * length, LEAST_STEP)
    for first, last, within in ((start, edge, outwards), (edge, end, not outwards)):
        parts = 1 if last > first else 0
        if parts and within and length > 0.0:
            # rounding may not make the two sides of a zero differ
            parts = max(1, math.ceil(min((last - first) / finest, float(steps.per_cycle)) - 1e-6))
        h = (last - first) / max(parts, 1)
        for part in range(parts):
            tau = first + part * h
            middle = rate_at(block, pieces, p, tau + 0.5 * h) if rule == SIMPSON else 0.0
            end_rate = rate_at(block, pieces, p, tau + h) if rule != RECTANGLE else 0.0
            c0, c1, c2 = coefficients(rule, rate_at(block, pieces, p, tau), middle, end_rate)
            take(c0, c1, c2, h, False, state)


@scalar
def rate_at(block: Block, pieces: np.ndarray, p: int, tau: float) -> float:
    """D at τ on piece p, whose side of Üg = 0 it takes where rounding would take the other's."""
    return relative_acceleration(block, math.copysign(plane(pieces, p, block.amplitude, tau), pieces[p, TOP]))


@scalar
def in_layer(block: Block, steps: Steps, p: int, i: int, state: np.ndarray) -> bool:
    """Whether step i of piece p reaches into a layer of friction thinner than steps."""
    at = steps.offset[p] + i
    return block.amplitude * min(abs(steps.nodes[at]), abs(steps.nodes[at + 1])) < state[LAYER]


@scalar
def _is_falling(where: tuple[Block, np.ndarray, int], k: int) -> bool:
    block, nodes, at = where
    return node_rate(block, nodes, at + k) < 0.0


_first_falling = first_of(_is_falling)


@scalar
def turning_step(block: Block, steps: Steps, p: int, i: int, until: int) -> int:
    """Of steps i to `until` of piece p the one in which the rate of V falls through 0; `until` if none; -1: not known.

    As |Üg| grows D falls through 0 once where Üg < 0; where Üg > 0 it rises through 0 and then falls through it, if
    at all.
    """
    at, upper = steps.offset[p], steps.wave.pieces[p, TOP] > 0.0
    rate, rate_end = node_rate(block, steps.nodes, at + i), node_rate(block, steps.nodes, at + until)
    if rate > 0.0 >= rate_end:
        return _first_falling((block, steps.nodes, at), i + 1, until) - 1
    return -1 if upper and max(rate, rate_end) <= 0.0 else until


@scalar
def steps_along(block: Block, p: int, i: int, until: int, wants_peak: bool, room: Room) -> None:
    """Steps i to `until` of piece p."""
    steps, state, lanes = room.steps, room.state, room.lanes
    turn = -1
    if state[LAYER] == 0.0 and not wants_peak:
        turn = until  # where V turns is nothing to W
    elif state[LAYER] == 0.0 and until - i >= _AT_ONCE:
        turn = turning_step(block, steps, p, i, until)
    if turn >= 0:
        take_followed(block, steps, p, i, turn, state)
        if turn < until:
            tau, tau_end = node(steps, p, turn), node(steps, p, turn + 1)
            continuous_step(block, steps.rule, steps, steps.wave.pieces, p, tau, tau_end, state)
            take_followed(block, steps, p, turn + 1, until, state)
        return
    while i < until:
        at, most = steps.offset[p] + i, min(until - i, AHEAD - 1)
        eq4_rates(block, steps.nodes, at, most, RATE, lanes)
        if steps.rule == SIMPSON:
            eq4_rates(block, steps.middles, at, most, MIDDLE, lanes)
        taken = steps_to_turn(most, lanes)
        if state[LAYER] > 0.0:
            for k in range(taken):
                if in_layer(block, steps, p, i + k, state):
                    taken = k
                    break
        advance(steps, p, taken, False, state, lanes)
        i += taken
        if taken < most:
            pieces = steps.wave.pieces
            continuous_step(block, steps.rule, steps, pieces, p, node(steps, p, i), node(steps, p, i + 1), state)
            i += 1


@scalar
def part_of_cycle(block: Block, p: int, i: int, last: int, until: int, wants_peak: bool, room: Room) -> Gain:
    """From step i of piece p to step `until` of piece `last`, from rest."""
    steps, state = room.steps, room.state
    state[VELOCITY] = state[DISPLACEMENT] = state[PEAK] = phase = 0.0
    for q in range(p, last + 1):
        begin, end = i if q == p else 0, until if q == last else steps.counts[q]
        steps_along(block, q, begin, end, wants_peak, room)
        phase += (end - begin) * steps.length[q]
    return Gain(state[VELOCITY], state[DISPLACEMENT], state[PEAK], phase)


@scalar
def onset(block: Block, steps: Steps, c: int) -> tuple[int, int, float]:
    """Where in cycle c Üg first exceeds Üy: piece, step and τ; past its last piece if it does not."""
    pieces = steps.wave.pieces
    p = steps.wave.cycle[c]
    while p < steps.wave.cycle[c + 1]:
        if block.amplitude * max(pieces[p, FIRST], pieces[p, LAST]) > block.yield_acceleration:
            break
        p += 1
    i, tau = 0, 0.0
    if p < steps.wave.cycle[c + 1]:
        tau = pieces[p, BEGIN]
        if block.amplitude * pieces[p, FIRST] < block.yield_acceleration:
            tau = offset_at(pieces, p, block.amplitude, block.yield_acceleration)
        i = min(max(int((tau - pieces[p, BEGIN]) / steps.length[p]), 0), steps.counts[p] - 1)
    return p, i, tau


@scalar
def mirrored_gain(block: Block, steps: Steps, c: int) -> float:
    """Gain of V over cycle c, whose halves mirror each other: what both sides share, twice.

    The rest cancels.  In V it would leave its rounding, and on a plane nearly level that is more than the gain.
    """
    gain = 0.0
    for p in range(steps.wave.cycle[c], steps.wave.cycle[c + 1]):
        if steps.wave.pieces[p, TOP] > 0.0:
            at, h = steps.offset[p], steps.length[p]
            for i in range(steps.counts[p]):
                x, x_end = block.amplitude * steps.nodes[at + i], block.amplitude * steps.nodes[at + i + 1]
                middle = 0.0
                if steps.rule == SIMPSON:
                    middle = drift(block, block.amplitude * steps.middles[at + i])
                c0, c1, c2 = coefficients(steps.rule, drift(block, x), middle, drift(block, x_end))
                gain += 2.0 * velocity_gain(c0, c1, c2, h, 1.0)
    return gain


@scalar
def drift(block: Block, x: float) -> float:
    """The part of D(x) that is the same at x and −x."""
    return eq.drift(x, friction(block, x), block.mu_s, block.tan_theta)


@scalar
def continuous(block: Block, wants_peak: bool, room: Room) -> Motion:
    """Continuous sliding from the first Üg > Üy on; repeated cycles are a series."""
    steps, state, pieces = room.steps, room.state, room.steps.wave.pieces
    reset_state(block, state)
    total, begun = Gain(0.0, 0.0, 0.0, 0.0), False
    for c in range(steps.wave.shape.size):
        if begun and steps.wave.lead < c <= steps.wave.lead + steps.wave.again:
            continue
        first, last = steps.wave.cycle[c], steps.wave.cycle[c + 1] - 1
        times = 0.0
        if c == steps.wave.lead and steps.wave.repeats > 0:
            times = steps.wave.repeats - 1.0 + steps.wave.again
        whole = Gain(0.0, 0.0, 0.0, 0.0)
        if begun:
            whole = part_of_cycle(block, first, 0, last, steps.counts[last], wants_peak, room)
            total = then(total, whole)
        else:
            p, i, tau = onset(block, steps, c)
            if p > last:
                continue
            state[VELOCITY] = state[DISPLACEMENT] = state[PEAK] = 0.0
            continuous_step(block, steps.rule, steps, pieces, p, tau, node(steps, p, i + 1), state)
            total = Gain(state[VELOCITY], state[DISPLACEMENT], state[PEAK], 0.0)
            after = part_of_cycle(block, p, i + 1, last, steps.counts[last], wants_peak, room)
            total, begun = then(total, after), True
            if times > 0.0:
                whole = then(part_of_cycle(block, first, 0, p, i + 1, wants_peak, room), after)
        if times > 0.0:
            # entered with V, a cycle adds W + 2πV
            gain = mirrored_gain(block, steps, c) if steps.mirrored else whole.velocity
            moved = whole.displacement + whole.phase * total.velocity
            peak = total.velocity + whole.peak + max(0.0, (times - 1.0) * gain)
            total = Gain(
                total.velocity + times * gain,
                total.displacement + times * (moved + math.pi * gain * (times - 1.0)),
                max(total.peak, peak),
                0.0,
            )
    return Motion(total.displacement, total.peak if wants_peak else math.nan, 0)
