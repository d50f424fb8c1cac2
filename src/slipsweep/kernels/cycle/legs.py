"""Legs, the motion between two events: room for the block and the log of its legs, and where legs end at the latest.

docs/numerics.md#slope-and-inflection
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    Block,
    inflection,
    slope_and_curvature,
    slope_root,
)
from slipsweep.kernels.pulse import (
    DISPLACEMENT,
    HELD,
    STATE_ROWS,
    VELOCITY,
)
from slipsweep.kernels.train import REST_COLUMNS
from slipsweep.motion.pieces import NODES, Wave

#: Signs at the start of a leg are read this fraction of the leg inside it, but no closer to the start than this
#: fraction of that: where a leg ends at a turn of E, the sign just behind is known only beyond rounding.
_SLIVER, _ROUNDING = 1e-10, 4.5e-16

#: Rows of the state of a block beyond those that all solvers share: the crest of the pulse; from which Üg on the next
#: onset is known (t1 of a block at rest), and that; the Üg that a rise has come to, at which the leg on hand ends,
#: whether b follows Eq. 4 on it, and from there on.
CREST, ONSET_FROM, ONSET, LEG_AT, LEG_END, LEG_FOLLOWS, NEXT_FOLLOWS = range(STATE_ROWS, STATE_ROWS + 7)

#: From here on Üg at the nodes of a quadrature (`eq4.curved_lag`): with an array that is made for each, ramps take 1.1
#: times as long.
AT_NODES = STATE_ROWS + 7
STATE_SIZE = AT_NODES + NODES.size

#: More legs than any rise has: five breaks, and a stop and an onset between each.
MOST_LEGS = 32


#: Straight pieces whose integrals of Eq. 4 are found side by side, in lanes (`eq4.straight_gains`).
LAGS = 16

#: Pulses of a record whose friction is found side by side (`record.lay_out`).
PULSES = 16
PULSE_ROWS = 13


class Room(NamedTuple):
    """Where a block is followed: its state, a log of its legs, room for continuous sliding (`continuous`), and lanes.

    `rests` is what `train` keeps of pulses.

    No field is called `zeros` or `empty`: a function with such a name in it would count references (`jit.inner.parts`).

    One for all cells: a function that makes an array counts the references to every array it is handed.
    """

    state: np.ndarray
    legs: np.ndarray
    crossings: np.ndarray
    gains: np.ndarray
    straight: np.ndarray
    pulses: np.ndarray
    rests: np.ndarray


@scalar
def longest_cycle(wave: Wave) -> int:
    """The most pieces that a cycle has."""
    longest = 0
    for c in range(wave.shape.size):
        longest = max(longest, wave.cycle[c + 1] - wave.cycle[c])
    return longest


#: Kinds of legs, and the columns of a log of them, which `history` samples: kind, piece, phase on
#: it and in the table at the start, phase at the end, b, V and W.
HOLD, FOLLOW, ATTENUATE = range(3)

LEG_COLUMNS = 8


@scalar
def room_of(legs: int, pieces: int, stretches: int) -> Room:
    """Room, with a log of so many legs, for cycles of so many pieces and a train of so many stretches.

    It is made in kernels, where the compiler knows that nothing else lies there.
    """
    return Room(
        np.zeros(STATE_SIZE),
        np.zeros((legs, LEG_COLUMNS)),
        np.empty((2, MOST_LEGS)),
        np.empty((pieces, 5)),
        np.empty(6 * LAGS),
        np.empty(PULSE_ROWS * PULSES),
        np.empty((stretches, REST_COLUMNS)),
    )


@in_lanes
def log_leg(legs: np.ndarray, kind: int, piece: int, tau: float, start: float, end: float, state: np.ndarray) -> None:
    """Add a leg to a log whose first row counts them; a sweep keeps none and gives an empty one."""
    if legs.size:
        legs[0, 0] += 1.0
        row = int(legs[0, 0])
        legs[row, 0], legs[row, 1], legs[row, 2], legs[row, 3], legs[row, 4] = kind, piece, tau, start, end
        legs[row, 5], legs[row, 6], legs[row, 7] = state[HELD], state[VELOCITY], state[DISPLACEMENT]


@in_lanes
def inside(x: float, end: float) -> float:
    """Where on the way from x to end the signs of a leg from x on are read, which is not at x itself."""
    way = end - x
    return x + math.copysign(min(max(_SLIVER * abs(way), _ROUNDING * abs(x)), abs(way)), way)


@scalar
def next_break(block: Block, x: float, end: float) -> float:
    """Where, on the way from x to end, one of E, dE/dx and D first ceases to be monotone."""
    inner = inside(x, end)
    if 0.0 < inner < inflection(block):
        end = min(inflection(block), end)
    before = slope_and_curvature(block, inner)[0]
    after = slope_and_curvature(block, end)[0]
    # dE/dx passes 1 where D turns and 0 where E turns; the one nearer to `before` comes first
    for turn in (1.0, 0.0) if before > after else (0.0, 1.0):
        if min(before, after) < turn < max(before, after):
            return slope_root(block, turn, inner, end)
    return end
