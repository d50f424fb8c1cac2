"""Lanes of blocks under a sine, which `pulses` and `continuous` solve together: rows, ways, and when iterations end."""

import math
from collections.abc import Callable

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import LANE_ROWS, STRIP, TILE

HALF_PI = 0.5 * math.pi

#: The ways a cell can go: not at all, stuck or without a value; held at the yield value to the peak;
#: held, then by Eq. 4; stuck at Üg = Üy until Eq. 4 falls below Üg; sliding continuously; any other,
#: event by event.
STAYS, YIELD_GOVERNS, FOLLOWS_EQ4, STICKS, SLIDES_ON, OTHER = range(6)

#: Rows of the lanes beside the block's.
X, LEVEL, START, V, W, HELD, RATE, MOMENT, PSI, LEFT, PEAK, CONVERGED, CODE = range(
    LANE_ROWS * TILE, (LANE_ROWS + 13) * TILE, TILE
)
#: What a first pulse leaves to the pulses after it: V carried on, W up to then, W if it were the
#: last, t1 and the largest V; and, of a pulse
#: entered in motion, whether a hold brings it through, V as that is slowest, V and W at the peak, what V
#: gains, and how many such pulses follow each other.
CARRIED, MOVED, LAST, ONSET, HIGHEST, THROUGH, SLOWEST, AT_PEAK, TO_PEAK, GAIN, MOST = range(
    (LANE_ROWS + 13) * TILE, (LANE_ROWS + 24) * TILE, TILE
)
LANES_SIZE = (LANE_ROWS + 24) * TILE

#: 12 nodes reach 1e-14 where friction falls by no more than e^6 (at 8 e-foldings, 2e-14).
LANE_NODES, LANE_WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(12), (1.0, 0.0), strict=True))
LANE_E_FOLDINGS = 6.0

#: Relative size of a Newton step that is the last (the error left is its square, and enters the
#: result squared again).  A lane that has taken it stays where it is, whatever its neighbours do.
LANE_TOLERANCE = 1e-7
MOST_ITERATIONS = 16


def settling(row: int, settled: int, step_of: Callable[..., tuple[float, float, float]]) -> Callable[..., None]:
    """A jitted iteration of the lanes of a strip to a root, in row `row`; row `settled` says which are there.

    ``step_of(lanes, j, at, side, g)`` gives the next place, the length of the step to it, and against what that
    has to be small.  Rows and function are bound here: LLVM has to know the rows, and numba cannot keep a
    kernel on disk in which a function is a value.
    """

    @scalar
    def settle(lanes: np.ndarray, side: float, g: float) -> None:
        for _ in range(MOST_ITERATIONS):
            unsettled = 0
            for j in range(STRIP):
                at = lanes[row + j]
                onward, step, scale = step_of(lanes, j, at, side, g)
                there = lanes[settled + j] > 0.0
                lanes[row + j] = at if there else onward
                there |= abs(step) <= LANE_TOLERANCE * scale
                lanes[settled + j] = 1.0 if there else 0.0
                unsettled += 0 if there else 1
            if unsettled == 0:
                break

    return settle
