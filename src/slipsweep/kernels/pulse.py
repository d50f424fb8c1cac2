"""Pulses of a motion: where they begin, and what one leaves to the next.

A pulse begins where the base's acceleration comes to Üy, or jumps past it, after it was not
positive (t1 at the earliest), and lasts to where the next one begins.  Velocity is all that one
leaves to the next.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.kernels import block as physics
from slipsweep.kernels.block import Block, Motion
from slipsweep.kernels.excitation import offset_at
from slipsweep.motion.pieces import Piece, Wave

#: Intervals of a rise at whose ends `yield_seems_to_govern` looks at Eq. 4.
_INTERVALS = 32


class Pulse(NamedTuple):
    """From one Üg = Üy to the next: V at its end, W gained, the largest and the least V, slides begun from rest.

    `validity` says if there is no value: the block slides at t5 with b ≤ 0.
    """

    velocity: float
    displacement: float
    peak: float
    least: float
    slips: float
    validity: int


@inlined
def first_pulse(block: Block, wave: Wave, k: int) -> int:
    """The first interval from k on in which the base's acceleration exceeds Üy; past the last, if there is none."""
    while k < wave.height.size and block.amplitude * wave.height[k] <= block.yield_acceleration:
        k += 1
    return k


@inlined
def beginning(block: Block, wave: Wave, k: int) -> tuple[int, float]:
    """Where in interval k the base's acceleration comes to Üy or jumps past it: a piece, and τ on it."""
    p = wave.interval[k, 0]
    while (
        block.amplitude * max(wave.pieces[p].first, wave.pieces[p].last) <= block.yield_acceleration
    ):
        p += 1
    if block.amplitude * wave.pieces[p].first >= block.yield_acceleration:
        return p, wave.pieces[p].begin
    return p, offset_at(wave.pieces[p], block.amplitude, block.yield_acceleration)


@inlined
def rises_anew(pieces: np.ndarray, p: int) -> bool:
    """Whether piece p, of Üg > 0, begins by a jump upwards, is a plateau, or rises after a fall."""
    first = pieces[p].first
    last = pieces[p].last
    fell = p > 0 and pieces[p - 1].first > pieces[p - 1].last
    return pieces[p].jumps or (first > 0.0 and (first == last or (first < last and fell)))


@scalar
def _rise_above_yield(block: Block, piece: Piece) -> tuple[float, float]:
    """From where to where Üg rises on a piece above Üy, or jumps to; the second is the smaller where it does not."""
    high = block.amplitude * piece.top
    rises = high > block.yield_acceleration and (piece.last >= piece.first or piece.jumps)
    return max(block.amplitude * piece.first, block.yield_acceleration), high if rises else 0.0


@scalar
def yield_governs(block: Block, wave: Wave) -> bool:
    """Return whether b = Üy throughout: Eq. 4 is nowhere above Üy where the base rises or jumps to.

    Only with the monotone rise: with the literal one b follows Eq. 4 below Üy, too.
    """
    governs = block.rise == physics.MONOTONE
    for p in range(wave.pieces.shape[0]):
        low, high = _rise_above_yield(block, wave.pieces[p])
        if governs and low <= high:
            governs = physics.stays_below_yield(block, low, high)
    return governs


@scalar
def yield_seems_to_govern(block: Block, wave: Wave) -> bool:
    """Return the same as `yield_governs`, for any friction law, from samples of Eq. 4."""
    largest = -math.inf if block.rise == physics.MONOTONE else math.inf
    for p in range(wave.pieces.shape[0]):
        low, high = _rise_above_yield(block, wave.pieces[p])
        before = math.inf
        now = -math.inf
        for j in range(_INTERVALS + 1 if low <= high else 0):
            eq4 = physics.response(block, low + (high - low) * (j / _INTERVALS))
            if before < now > eq4:  # the vertex of the parabola through three
                largest = max(
                    largest,
                    now + (eq4 - before) * (eq4 - before) / (8.0 * (2.0 * now - before - eq4)),
                )
            largest = max(largest, eq4)
            before = now
            now = eq4
    return largest <= block.yield_acceleration


@scalar
def motion_of(block: Block, sliding_mode: int, validity: int, found: Pulse) -> Motion:
    """The motion of a cell under a waveform; an iteration that has not ended has made its W or V NaN."""
    validity |= found.validity
    if math.isnan(found.displacement) and validity & physics.NO_VALUE == 0:
        validity |= physics.UNSOLVED
    validity = physics.settled(
        physics.without_estimates(validity), found.displacement, block.amplitude
    )
    mode = -1 if validity & physics.NO_VALUE else sliding_mode
    return Motion(
        found.displacement, found.peak, float(mode), float(validity), math.nan, math.nan, math.nan
    )
