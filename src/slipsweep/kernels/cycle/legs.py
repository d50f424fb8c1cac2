"""Legs, the motion between two events: room for the block and the log of its legs, and where legs end at the latest.

docs/numerics.md#slope-and-inflection
"""

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

#: Signs at the start of a leg are read this fraction of the leg inside it.
SLIVER = 1e-10

#: More legs than any rise has: five breaks, and a stop and an onset between each.
MOST_LEGS = 32


class Room(NamedTuple):
    """Where a block is followed: its state, a log of its legs, and zeros of D on either side of Üg = 0.

    One for all cells: a function that makes an array counts the references to every array it is handed.
    """

    state: np.ndarray
    legs: np.ndarray
    zeros: np.ndarray


#: Kinds of legs, and the columns of a log of them, which `history` samples: kind, piece, phase on
#: it and in the table at the start, phase at the end, b, V and W.
HOLD, FOLLOW, ATTENUATE = range(3)

LEG_COLUMNS = 8


@scalar
def room_of(legs: int) -> Room:
    """Room, with a log of so many legs; made in kernels, where the compiler knows that nothing else lies there."""
    return Room(np.zeros(STATE_ROWS), np.zeros((legs, LEG_COLUMNS)), np.empty((2, MOST_LEGS)))


@in_lanes
def log_leg(legs: np.ndarray, kind: int, piece: int, tau: float, start: float, end: float, state: np.ndarray) -> None:
    """Add a leg to a log whose first row counts them; a sweep keeps none and gives an empty one."""
    if legs.size:
        legs[0, 0] += 1.0
        row = int(legs[0, 0])
        legs[row, 0], legs[row, 1], legs[row, 2], legs[row, 3], legs[row, 4] = kind, piece, tau, start, end
        legs[row, 5], legs[row, 6], legs[row, 7] = state[HELD], state[VELOCITY], state[DISPLACEMENT]


@scalar
def next_break(block: Block, x: float, end: float) -> float:
    """Where, on the way from x to end, one of E, dE/dx and D first ceases to be monotone."""
    inner = x + SLIVER * (end - x)
    if 0.0 < inner < inflection(block):
        end = min(inflection(block), end)
    before = slope_and_curvature(block, inner)[0]
    after = slope_and_curvature(block, end)[0]
    # dE/dx passes 1 where D turns and 0 where E turns; the one nearer to `before` comes first
    for turn in (1.0, 0.0) if before > after else (0.0, 1.0):
        if min(before, after) < turn < max(before, after):
            return slope_root(block, turn, inner, end)
    return end
