"""Continuous sliding under any wave: Eq. 4 over a cycle, and the cycles as a series.

`zeros`, (2, MOST_LEGS), is room for the places at which D changes its sign, on either side of Üg = 0.
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
from slipsweep.kernels.cycle.legs import inside, next_break
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
def follow_through(
    block: Block, wave: Wave, p: int, tau: float, until: int, tau_until: float, up: int, down: int, zeros: np.ndarray
) -> tuple[float, float, float]:
    """Eq. 4 from rest, τ on piece p, to `tau_until` on piece `until`: gains of V and W, the largest V.

    D changes its sign at `up` zeros on the way up from Üg = 0 and at `down` on the way down.
    """
    velocity, displacement, peak = 0.0, 0.0, 0.0
    above, below, both = 0.0, 0.0, 0.0
    for q in range(p, min(until + 1, wave.pieces.shape[0])):
        start = tau if q == p else wave.pieces[q, BEGIN]
        end = tau_until if q == until else wave.pieces[q, FINISH]
        if end <= start:
            continue
        side = 1 if wave.pieces[q, TOP] > 0.0 else 0
        least, most = sorted_pair(block.amplitude * wave.pieces[q, FIRST], block.amplitude * wave.pieces[q, LAST])
        for i in range(up if side == 1 else down):
            zero = zeros[1 - side, i]
            if least < zero < most:
                at = offset_at(wave.pieces, q, block.amplitude, zero)
                if start < at < end:
                    peak = max(peak, velocity + eq4_integrals(block, wave.pieces, q, start, at)[0])
        first, second, first_x, second_x = lag_integrals(block, wave.pieces, q, start, end)
        side_g = block.g if side == 1 else -block.g
        displacement += velocity * (end - start) + side_g * second + block.tan_theta * second_x
        if side == 1:
            above += first
        else:
            below += first
        both += first_x
        velocity = block.g * (above - below) + block.tan_theta * both
        peak = max(peak, velocity)
    return velocity, displacement, peak


@scalar
def continuous_cycle(
    block: Block, wave: Wave, c: int, p: int, tau: float, up: int, down: int, zeros: np.ndarray
) -> tuple[float, float, float]:
    """`follow_through` from τ on piece p to the end of cycle c of the table."""
    until = wave.cycle[c + 1]
    tau_until = wave.pieces[until, BEGIN] if until < wave.pieces.shape[0] else 0.0
    return follow_through(block, wave, p, tau, until, tau_until, up, down, zeros)


@scalar
def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """The smaller and the larger of two numbers."""
    return (a, b) if a < b else (b, a)


@scalar
def continuous(block: Block, options: Options, wave: Wave, zeros: np.ndarray) -> Motion:
    """Continuous sliding from the first Üg ≥ Üy on: Eq. 4 throughout.

    Cycles of one shape give the same gains from rest, so that the repeated ones are an arithmetic series.
    """
    k = first_pulse(block, wave, 0)
    if k >= wave.height.size:
        return Motion(0.0, 0.0, 0)
    p, tau = beginning(block, wave, k)
    up, down = 0, 0
    if options.wants_peak:
        up = zeros_of_relative_acceleration(block, block.amplitude * wave.highest, zeros[0])
        down = zeros_of_relative_acceleration(block, block.amplitude * wave.lowest, zeros[1])
        if min(up, down) < 0:
            return Motion(math.nan, math.nan, 0)
    velocity, displacement, peak = 0.0, 0.0, 0.0
    gain, moved, highest, known = 0.0, 0.0, 0.0, -1
    for c in range(wave.shape.size):
        if wave.cycle[c + 1] <= p:
            continue
        repeats = wave.repeats if wave.repeats > 0 and c == wave.lead else 1
        if wave.cycle[c] <= p:
            velocity, displacement, peak = continuous_cycle(block, wave, c, p, tau, up, down, zeros)
            repeats -= 1
        if repeats == 0:
            continue
        if wave.shape[c] != known:
            gain, moved, highest = continuous_cycle(
                block, wave, c, wave.cycle[c], wave.pieces[wave.cycle[c], BEGIN], up, down, zeros
            )
            known = wave.shape[c]
        later = repeats - 1.0
        peak = max(peak, max(velocity, velocity + later * gain) + highest)
        displacement += repeats * (moved + math.pi * (2.0 * velocity + gain * later))
        velocity += repeats * gain
    return Motion(displacement, peak if options.wants_peak else math.nan, 0)
