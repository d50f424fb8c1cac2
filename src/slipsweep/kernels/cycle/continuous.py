"""Continuous sliding under any wave: Eq. 4 over a cycle, and the cycles as a series.

In a `Room`, `crossings`, (2, MOST_LEGS), has the places at which D changes its sign, on either side of Üg = 0, and
`gains`, (pieces, 5), what the whole pieces of a cycle add (`gains_along`).
docs/numerics.md#continuous-sliding
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    Block,
    Motion,
    Options,
    inflection,
    opposite,
    relative_acceleration,
    relative_acceleration_root,
)
from slipsweep.kernels.cycle.eq4 import eq4_integrals, lag_integrals
from slipsweep.kernels.cycle.legs import Room, inside, next_break
from slipsweep.kernels.excitation import offset_at
from slipsweep.kernels.pulse import (
    beginning,
    first_pulse,
)
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, LAST, TOP, Wave


@scalar
def zeros_of_relative_acceleration(block: Block, end: float, zeros: np.ndarray) -> int:
    """Where on the way from Üg = 0 to `end` D changes its sign; their number, or −1 if one is not found."""
    count = 0
    x = math.copysign(0.0, end)
    inner = inside(x, end)
    if inflection(block) <= 0.0 and opposite(relative_acceleration(block, inner), relative_acceleration(block, end)):
        # D bends to one side only
        zeros[0] = relative_acceleration_root(block, inner, end)
        return -1 if math.isnan(zeros[0]) else 1
    for _ in range(zeros.size):
        target = next_break(block, x, end)
        inner = inside(x, target)
        if opposite(relative_acceleration(block, inner), relative_acceleration(block, target)):
            zeros[count] = relative_acceleration_root(block, inner, target)
            if math.isnan(zeros[count]):
                return -1
            count += 1
        x = target
        if x == end:
            break
    return count


@scalar
def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """The smaller and the larger of two numbers."""
    return (a, b) if a < b else (b, a)


@scalar
def gains_along(
    block: Block, wave: Wave, q: int, start: float, end: float, up: int, down: int, room: Room
) -> tuple[float, float, float, float, float]:
    """`lag_integrals` over a part of piece q, and the most that V gains up to a zero of D there (−∞, if it has none).

    D changes its sign at `up` zeros on the way up from Üg = 0 and at `down` on the way down.
    """
    side = 1 if wave.pieces[q, TOP] > 0.0 else 0
    least, most = sorted_pair(block.amplitude * wave.pieces[q, FIRST], block.amplitude * wave.pieces[q, LAST])
    highest = -math.inf
    for i in range(up if side == 1 else down):
        zero = room.crossings[1 - side, i]
        if least < zero < most:
            at = offset_at(wave.pieces, q, block.amplitude, zero)
            if start < at < end:
                highest = max(highest, eq4_integrals(block, wave.pieces, q, start, at, room.state)[0])
    first, second, first_x, second_x = lag_integrals(block, wave.pieces, q, start, end, room.state)
    return first, second, first_x, second_x, highest


@scalar
def follow_cycle(
    block: Block, wave: Wave, c: int, p: int, tau: float, up: int, down: int, room: Room
) -> tuple[float, float, float]:
    """Eq. 4 from rest, τ on piece p, to the end of cycle c, whose `gains` are known: of V and W, the largest V."""
    velocity, displacement, peak = 0.0, 0.0, 0.0
    above, below, both = 0.0, 0.0, 0.0
    for q in range(p, wave.cycle[c + 1]):
        row, start, end = q - wave.cycle[c], wave.pieces[q, BEGIN], wave.pieces[q, FINISH]
        first, second, first_x = room.gains[row, 0], room.gains[row, 1], room.gains[row, 2]
        second_x, highest = room.gains[row, 3], room.gains[row, 4]
        if q == p and tau > start:
            start = tau
            if start >= end:
                continue
            first, second, first_x, second_x, highest = gains_along(block, wave, q, tau, end, up, down, room)
        upper = wave.pieces[q, TOP] > 0.0
        peak = max(peak, velocity + highest)
        side_g = block.g if upper else -block.g
        displacement += velocity * (end - start) + side_g * second + block.tan_theta * second_x
        if upper:
            above += first
        else:
            below += first
        both += first_x
        velocity = block.g * (above - below) + block.tan_theta * both
        peak = max(peak, velocity)
    return velocity, displacement, peak


@scalar
def continuous(block: Block, options: Options, wave: Wave, room: Room) -> Motion:
    """Continuous sliding from the first Üg ≥ Üy on: Eq. 4 throughout.

    Cycles of one shape give the same gains from rest, so that the repeated ones are an arithmetic series.
    """
    k = first_pulse(block, wave, 0)
    if k >= wave.height.size:
        return Motion(0.0, 0.0, 0)
    p, tau = beginning(block, wave, k)
    up, down = 0, 0
    if options.wants_peak:
        up = zeros_of_relative_acceleration(block, block.amplitude * wave.highest, room.crossings[0])
        down = zeros_of_relative_acceleration(block, block.amplitude * wave.lowest, room.crossings[1])
        if min(up, down) < 0:
            return Motion(math.nan, math.nan, 0)
    velocity, displacement, peak = 0.0, 0.0, 0.0
    gain, moved, highest, known = 0.0, 0.0, 0.0, -1
    for c in range(wave.shape.size):
        if wave.cycle[c + 1] <= p:
            continue
        repeats = wave.repeats if wave.repeats > 0 and c == wave.lead else 1
        begin = wave.cycle[c]
        if wave.shape[c] != known:
            for q in range(begin, wave.cycle[c + 1]):
                first, second, first_x, second_x, most = gains_along(
                    block, wave, q, wave.pieces[q, BEGIN], wave.pieces[q, FINISH], up, down, room
                )
                row = q - begin
                room.gains[row, 0], room.gains[row, 1], room.gains[row, 2] = first, second, first_x
                room.gains[row, 3], room.gains[row, 4] = second_x, most
            gain, moved, highest = follow_cycle(block, wave, c, begin, wave.pieces[begin, BEGIN], up, down, room)
            known = wave.shape[c]
        if begin <= p:
            velocity, displacement, peak = follow_cycle(block, wave, c, p, tau, up, down, room)
            repeats -= 1
        if repeats == 0:
            continue
        later = repeats - 1.0
        peak = max(peak, max(velocity, velocity + later * gain) + highest)
        displacement += repeats * (moved + math.pi * (2.0 * velocity + gain * later))
        velocity += repeats * gain
    return Motion(displacement, peak if options.wants_peak else math.nan, 0)
