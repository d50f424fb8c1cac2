"""One pulse, from Üg = Üy (t1) to the next: what the block does, given how a solver moves it along one piece.

A solver brings `rise` (along a piece on which the plane's acceleration rises) and `hold` (with the block's
acceleration b held, along a part of a piece or to the stop); here stands what decides between them:

- where a rise or a plateau begins, where the plane's acceleration jumps up, and where the block comes to rest on a
  plateau, Eq. 4 gives b anew (`reset_held`);
- on a rise the block sticks, holds b or follows Eq. 4 (`rise`); elsewhere b is held;
- from Üg = 0 (t5) on, Eq. 12 takes V down, or b is held on (`recoupling`), up to the next pulse;
- after the shaking Eq. 12 goes on to the stop.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    FRICTION_ESTIMATED,
    INTEGRATE,
    KD_NOT_POSITIVE,
    LITERAL,
    NEAR_MODE_LIMIT,
    NEWMARK,
    Block,
    Options,
    response,
    starting_acceleration,
)
from slipsweep.kernels.excitation import offset_at, phase_at
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import BEGIN, END, FINISH, FIRST, JUMPS, LAST, START, Wave

#: The state of a block is a small array, which functions can change; its rows, for every solver: V, W and
#: the block's acceleration b; the largest and the least V; whether (1.0 or 0.0) it slides, and whether b
#: follows Eq. 4; the phase at which it came to rest, infinite where only the end of the shaking brought it to
#: rest; the phase at which the last slide began, and the number of slides that began at rest; and the least b
#: with which it slid at the end of a rise.
#: (An array, because the lanes of the step solver have the same rows, cell by cell, and
#: numba keeps a record's fields in memory just the same.)
VELOCITY, DISPLACEMENT, HELD, PEAK, LEAST, SLIDES, FOLLOWS, STOPPED_AT, BEGAN_AT, SLIPS, LEAST_HELD = range(11)
STATE_ROWS = 11


class Pulse(NamedTuple):
    """From one Üg = Üy to the next: V carried on, W gained, the largest and the least V.

    `stopped_at` is the phase at which the block came to rest, infinite where only the end of the shaking
    brought it to rest; `validity` says if there is no value: b ≤ 0 at the end of
    any of its rises (NaN, if at the end of the last).
    """

    velocity: float
    displacement: float
    peak: float
    least: float
    stopped_at: float
    validity: int


@scalar
def first_pulse(block: Block, wave: Wave, k: int) -> int:
    """The first stretch from k on in which the plane's acceleration exceeds Üy; past the last, if there is none."""
    while k < wave.height.size and block.amplitude * wave.height[k] <= block.yield_acceleration:
        k += 1
    return k


@scalar
def validity_before(block: Block, wave: Wave) -> int:
    """The flags known before the motion; ramps may keep the shaking below its peak, and a block from sliding."""
    slides = block.amplitude * wave.highest > block.yield_acceleration
    return block.validity if slides else block.validity & ~(NEAR_MODE_LIMIT | FRICTION_ESTIMATED)


@scalar
def beginning(block: Block, wave: Wave, k: int) -> tuple[int, float]:
    """Where in stretch k the plane's acceleration comes to Üy or jumps past it: a piece, and τ on it."""
    p = wave.stretch[k, 0]
    while block.amplitude * max(wave.pieces[p, FIRST], wave.pieces[p, LAST]) <= block.yield_acceleration:
        p += 1
    if block.amplitude * wave.pieces[p, FIRST] >= block.yield_acceleration:
        return p, wave.pieces[p, BEGIN]
    return p, offset_at(wave.pieces, p, block.amplitude, block.yield_acceleration)


@in_lanes
def rises_anew(pieces: np.ndarray, p: int) -> bool:
    """Whether piece p, of Üg > 0, begins by a jump upwards, is a plateau, or rises after a fall."""
    first, last = pieces[p, FIRST], pieces[p, LAST]
    fell = p > 0 and pieces[p - 1, FIRST] > pieces[p - 1, LAST]
    return pieces[p, JUMPS] > 0.0 or (first > 0.0 and (first == last or (first < last and fell)))


@in_lanes
def begin_slide(b: float, phase: float, state: np.ndarray) -> None:
    """The block at rest begins to slide with its acceleration b."""
    state[HELD], state[SLIDES], state[BEGAN_AT] = b, 1.0, phase
    state[SLIPS] += 1.0


@in_lanes
def reset_held(block: Block, pieces: np.ndarray, p: int, tau: float, x: float, state: np.ndarray) -> None:
    """Reset b of a block that slides at τ on piece p, Üg = x, or begin a slide there (t1), if not by a rise."""
    state[FOLLOWS] = 1.0 if block.rise == LITERAL else 0.0
    if state[SLIDES] > 0.0:
        if block.rise == LITERAL:
            state[HELD] = response(block, x)
        elif block.rise != NEWMARK:
            state[HELD] = max(state[HELD], response(block, x))
    elif x >= block.yield_acceleration and pieces[p, FIRST] >= pieces[p, LAST]:
        b = starting_acceleration(block, x)
        if b < x:
            begin_slide(b, phase_at(pieces, p, tau), state)


@scalar
def attenuate(state: np.ndarray, duration: float) -> None:
    """Eq. 12 for `duration` of phase, or to the stop, with Ümax = b; V may have either sign."""
    speed, side = abs(state[VELOCITY]), math.copysign(1.0, state[VELOCITY])
    state[DISPLACEMENT] += side * eq.attenuated_displacement(speed, state[HELD], duration)
    state[VELOCITY] = side * eq.attenuated_velocity(speed, state[HELD], duration)


def pulse_of(
    rise: Callable[[Block, np.ndarray, Any, int, float, float, np.ndarray], Any],
    hold: Callable[[Block, np.ndarray, Any, int, float, float, np.ndarray], float],
    note: Callable[[Any, float, float, np.ndarray], None],
) -> Callable[[Block, Options, Wave, Any, int, int, float, np.ndarray], Pulse]:
    """The jitted pulse of a solver.

    ``rise(block, options, wave, table, p, tau, x, state)`` goes along piece p from τ, where Üg = x, to its end;
    ``hold(block, wave.pieces, table, p, start, end, state)`` from τ = start to end, or to the stop, and returns that τ;
    `table` is what the solver itself has tabulated.  ``note(table, start, end, state)`` is told of a leg of Eq. 12.
    """

    @scalar
    def through_stretch(block: Block, wave: Wave, table: Any, k: int, p: int, tau: float, state: np.ndarray) -> None:
        """From Üg = Üy, τ on piece p, to Üg = 0 (t5) at the end of stretch k."""
        for q in range(p, wave.stretch[k, 1]):
            first, last = wave.pieces[q, FIRST], wave.pieces[q, LAST]
            x, finish = block.amplitude * first, wave.pieces[q, FINISH]
            if q == p:
                x = max(x, block.yield_acceleration)
            else:
                tau = wave.pieces[q, BEGIN]
            if rises_anew(wave.pieces, q):
                reset_held(block, wave.pieces, q, tau, x, state)
            if first < last:
                rise(block, wave.pieces, table, q, tau, x, state)
            elif state[SLIDES] > 0.0:
                if first > last:
                    state[LEAST_HELD] = min(state[LEAST_HELD], state[HELD])
                tau = hold(block, wave.pieces, table, q, tau, finish, state)
                if first == last and state[SLIDES] == 0.0:
                    reset_held(block, wave.pieces, q, tau, x, state)
                    if state[SLIDES] > 0.0:
                        hold(block, wave.pieces, table, q, tau, finish, state)

    @scalar
    def integrate_on(block: Block, wave: Wave, table: Any, q: int, p: int, tau: float, state: np.ndarray) -> None:
        """From the beginning of piece q (t5) to τ on piece p, b held."""
        for piece in range(q, min(p + 1, wave.pieces.shape[0])):
            if state[SLIDES] == 0.0:
                break
            end = tau if piece == p else wave.pieces[piece, FINISH]
            if end > wave.pieces[piece, BEGIN]:
                hold(block, wave.pieces, table, piece, wave.pieces[piece, BEGIN], end, state)

    @scalar
    def recouple(
        block: Block, options: Options, wave: Wave, table: Any, q: int, following: int, state: np.ndarray
    ) -> None:
        """From Üg = 0 (t5) at the beginning of piece q to the pulse of the `following` stretch, or to the stop."""
        pieces, last = wave.pieces.shape[0], following >= wave.height.size
        p, tau = pieces, 0.0
        if not last:
            p, tau = beginning(block, wave, following)
        started = wave.pieces[q, START] if q < pieces else wave.pieces[q - 1, END]
        state[STOPPED_AT] = started  # Eq. 12 goes on beyond the shaking just the same
        if options.recoupling == INTEGRATE:
            state[STOPPED_AT] = math.inf
            integrate_on(block, wave, table, q, p, tau, state)
            started = wave.pieces[pieces - 1, END]
        if state[SLIDES] > 0.0 and (last or options.recoupling != INTEGRATE):
            duration = math.inf if last else phase_at(wave.pieces, p, tau) - started
            note(table, started, started + min(duration, state[VELOCITY] / state[HELD]), state)
            attenuate(state, duration)

    @scalar
    def pulse(
        block: Block, options: Options, wave: Wave, table: Any, k: int, following: int, velocity: float,
        state: np.ndarray,
    ) -> Pulse:  # fmt: skip
        """From Üg = Üy in stretch k to that in the `following` one, or to the end of the motion if none follows."""
        p, tau = beginning(block, wave, k)
        x = max(block.amplitude * wave.pieces[p, FIRST], block.yield_acceleration)
        state[VELOCITY] = state[PEAK] = state[LEAST] = velocity
        state[DISPLACEMENT] = state[STOPPED_AT] = 0.0
        state[HELD], state[SLIDES] = starting_acceleration(block, x), 1.0 if velocity > 0.0 else 0.0
        state[FOLLOWS] = 1.0 if block.rise == LITERAL else 0.0
        state[BEGAN_AT], state[LEAST_HELD] = -math.inf, math.inf
        through_stretch(block, wave, table, k, p, tau, state)
        if state[SLIDES] > 0.0:
            if state[HELD] <= 0.0:
                return Pulse(0.0, math.nan, math.nan, 0.0, 0.0, KD_NOT_POSITIVE)
            recouple(block, options, wave, table, wave.stretch[k, 1], following, state)
        least = min(state[LEAST], state[VELOCITY])
        validity = KD_NOT_POSITIVE if state[LEAST_HELD] <= 0.0 else 0
        return Pulse(state[VELOCITY], state[DISPLACEMENT], state[PEAK], least, state[STOPPED_AT], validity)

    return pulse
