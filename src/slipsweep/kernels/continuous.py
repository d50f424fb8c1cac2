"""Continuous sliding from event to event: Eq. 4 throughout, over a cycle, and the cycles as a series.

docs/numerics.md#continuous-sliding
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import Block, inflection, opposite, relative_acceleration, relative_acceleration_root
from slipsweep.kernels.eq4 import Lag, eq4_integrals, lag_integrals
from slipsweep.kernels.exact import MOST_PHASES, Workspace, inside, next_break
from slipsweep.kernels.excitation import offset_at
from slipsweep.kernels.pulse import Pulse, beginning, first_pulse
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, LAST, TOP, Wave


class Zeros(NamedTuple):
    """How many zeros D has from Üg = 0 up to the largest and down to the least Üg; −1: not all were found."""

    up: int
    down: int


class Gain(NamedTuple):
    """V and W gained from rest, and the largest V on the way."""

    velocity: float
    displacement: float
    peak: float


@scalar
def zeros_on_one_side(block: Block, end: float, zeros: np.ndarray) -> int:
    """Where on the way from Üg = 0 to `end` D changes its sign; their number, or −1 if one is not found."""
    count = 0
    x = math.copysign(0.0, end)
    inner = inside(x, end)
    if inflection(block) <= 0.0 and opposite(relative_acceleration(block, inner), relative_acceleration(block, end)):
        # D bends to one side only
        zeros[0] = relative_acceleration_root(block, inner, end)
        return -1 if math.isnan(zeros[0]) else 1
    for _ in range(MOST_PHASES):
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
def zeros_of_relative_acceleration(block: Block, wave: Wave, workspace: Workspace) -> Zeros:
    """Where V may be largest: the zeros of D, written into the workspace."""
    up = zeros_on_one_side(block, block.amplitude * wave.highest, workspace.zeros[0])
    return Zeros(up, zeros_on_one_side(block, block.amplitude * wave.lowest, workspace.zeros[1]))


@scalar
def most_gained(
    block: Block, wave: Wave, q: int, start: float, end: float, zeros: Zeros, workspace: Workspace
) -> float:
    """The most that V gains on a part of piece q up to a zero of D (−∞, if it has none)."""
    pieces, amplitude, highest = wave.pieces, block.amplitude, -math.inf
    upper = pieces[q, TOP] > 0.0
    first, last = amplitude * pieces[q, FIRST], amplitude * pieces[q, LAST]
    for i in range(zeros.up if upper else zeros.down):
        zero = workspace.zeros[0 if upper else 1, i]
        if min(first, last) < zero < max(first, last):
            at = offset_at(pieces, q, amplitude, zero)
            if start < at < end:
                highest = max(highest, eq4_integrals(block, pieces, q, start, at)[0])
    return highest


@scalar
def follow_cycle(block: Block, wave: Wave, c: int, p: int, tau: float, zeros: Zeros, workspace: Workspace) -> Gain:
    """Eq. 4 from rest, τ on piece p, to the end of cycle c, whose `gains` are known."""
    pieces = wave.pieces
    velocity, displacement, peak = 0.0, 0.0, 0.0
    above, below, both = 0.0, 0.0, 0.0
    for q in range(p, wave.cycle[c + 1]):
        known, start, end = workspace.gains[q - wave.cycle[c]], pieces[q, BEGIN], pieces[q, FINISH]
        lag = Lag(known["first"], known["second"], known["first_x"], known["second_x"])
        highest = known["highest"]
        if q == p and tau > start:
            start = tau
            if start >= end:
                continue
            lag = lag_integrals(block, pieces, q, start, end)
            highest = most_gained(block, wave, q, start, end, zeros, workspace)
        upper = pieces[q, TOP] > 0.0
        peak = max(peak, velocity + highest)
        side_g = block.g if upper else -block.g
        displacement += velocity * (end - start) + side_g * lag.second + block.tan_theta * lag.second_x
        if upper:
            above += lag.first
        else:
            below += lag.first
        both += lag.first_x
        velocity = block.g * (above - below) + block.tan_theta * both
        peak = max(peak, velocity)
    return Gain(velocity, displacement, peak)


@scalar
def gains_of_cycle(block: Block, wave: Wave, c: int, zeros: Zeros, workspace: Workspace) -> None:
    """Write what Eq. 4 gains over each piece of cycle c into the workspace."""
    for q in range(wave.cycle[c], wave.cycle[c + 1]):
        start, end = wave.pieces[q, BEGIN], wave.pieces[q, FINISH]
        lag = lag_integrals(block, wave.pieces, q, start, end)
        row = workspace.gains[q - wave.cycle[c]]
        row["first"], row["second"], row["first_x"], row["second_x"] = lag
        row["highest"] = most_gained(block, wave, q, start, end, zeros, workspace)


@scalar
def slide_continuously(block: Block, wants_peak: bool, wave: Wave, workspace: Workspace) -> Pulse:
    """Continuous sliding from the first Üg ≥ Üy on, as one pulse: Eq. 4 throughout.

    Cycles of one shape give the same gains from rest, so that the repeated ones are an arithmetic series.
    """
    k = first_pulse(block, wave, 0)
    if k >= wave.height.size:
        return Pulse(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    p, tau = beginning(block, wave, k)
    zeros = Zeros(0, 0)
    if wants_peak:
        zeros = zeros_of_relative_acceleration(block, wave, workspace)
        if min(zeros.up, zeros.down) < 0:
            return Pulse(math.nan, math.nan, math.nan, 0.0, 0.0, 0.0, 0)
    velocity, displacement, peak = 0.0, 0.0, 0.0
    whole, known = Gain(0.0, 0.0, 0.0), -1
    for c in range(wave.shape.size):
        if wave.cycle[c + 1] <= p:
            continue
        repeats = wave.repeats if wave.repeats > 0 and c == wave.lead else 1
        begin = wave.cycle[c]
        if wave.shape[c] != known:
            gains_of_cycle(block, wave, c, zeros, workspace)
            whole = follow_cycle(block, wave, c, begin, wave.pieces[begin, BEGIN], zeros, workspace)
            known = wave.shape[c]
        if begin <= p:
            velocity, displacement, peak = follow_cycle(block, wave, c, p, tau, zeros, workspace)
            repeats -= 1
        if repeats == 0:
            continue
        later = repeats - 1.0
        peak = max(peak, max(velocity, velocity + later * whole.velocity) + whole.peak)
        displacement += repeats * (whole.displacement + math.pi * (2.0 * velocity + whole.velocity * later))
        velocity += repeats * whole.velocity
    return Pulse(velocity, displacement, peak if wants_peak else math.nan, 0.0, 0.0, 0.0, 0)
