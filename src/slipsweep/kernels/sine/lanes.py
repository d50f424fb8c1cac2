"""Lanes of blocks under a sine, which `pulses` and `continuous` solve together: their rows, and the kinds of motion."""

import math

import numpy as np

from slipsweep.kernels.block import LANE_ROWS, TILE

HALF_PI = 0.5 * math.pi

#: Kinds of motion: none, stuck or without a value; none, as Eq. 4 does not fall below Üg up to the peak; held at the
#: yield value to the peak; held, then by Eq. 4; stuck at Üg = Üy until Eq. 4 falls below Üg; sliding continuously; the
#: same, where the largest V is wanted and D changes its sign late on the rise; any other, event by event.
STAYS, RESTS, YIELD_GOVERNS, FOLLOWS_EQ4, STICKS, SLIDES_ON, TURNS_LATE, OTHER = range(8)

#: Rows of the lanes beside the block's.
X, LEVEL, START, V, W, HELD, RATE, MOMENT, PSI, LEFT, PEAK, CONVERGED, CODE = range(
    LANE_ROWS * TILE, (LANE_ROWS + 13) * TILE, TILE
)
#: What a first pulse leaves to the pulses after it: V carried on, W up to then, W if it were the
#: last, t1 and the largest V; of a pulse entered in motion, whether a hold brings it through, V as that is slowest,
#: what V gains, and how many such pulses follow each other; and, under a cosine, V and W at the peak.
CARRIED, MOVED, LAST, ONSET, HIGHEST, THROUGH, SLOWEST, GAIN, MOST, AT_PEAK, TO_PEAK = range(
    (LANE_ROWS + 13) * TILE, (LANE_ROWS + 24) * TILE, TILE
)
LANES_SIZE = (LANE_ROWS + 24) * TILE

#: 12 nodes reach 1e-14 where friction falls by no more than e^6 (at 8 e-foldings, 2e-14).
LANE_NODES, LANE_WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(12), (1.0, 0.0), strict=True))
LANE_E_FOLDINGS = 6.0

#: 8 nodes, for the short parts of continuous sliding.
SHORT_NODES, SHORT_WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(8), (1.0, 0.0), strict=True))
