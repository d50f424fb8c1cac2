"""Lanes of the step solver: flat arrays in which row + j is cell j of the lanes, and their states likewise."""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    LANE_ROWS,
    TILE,
    YIELD,
)
from slipsweep.kernels.pulse import (
    DISPLACEMENT,
    FOLLOWS,
    HELD,
    LEAST,
    PEAK,
    SLIDES,
    VELOCITY,
)

#: The first rows of the lanes' states, and the rows of the lanes beside the block's: D (or E) at the last node,
#: whether something happens in the step, whether the cell goes on without the lanes, |w| up to which
#: friction is a layer thinner than steps, W, V, b and the largest V before the cycle.  Row + j is cell j.
LANE_VELOCITY, LANE_DISPLACEMENT, LANE_HELD, LANE_PEAK, LANE_LEAST, LANE_SLIDES, LANE_FOLLOWS = (
    row * TILE for row in (VELOCITY, DISPLACEMENT, HELD, PEAK, LEAST, SLIDES, FOLLOWS)
)

LANE_EQ4, HAPPENS, WITHOUT_LANES, THIN, BEFORE, BEFORE_V, BEFORE_HELD, BEFORE_PEAK, GAIN = range(
    LANE_ROWS * TILE, (LANE_ROWS + 9) * TILE, TILE
)

LANE_SIZE = (LANE_ROWS + 9) * TILE


@scalar
def leave_lanes(lanes: np.ndarray, states: np.ndarray, j: int) -> None:
    """Leave lane j at rest for good: its cell is not for lanes."""
    lanes[WITHOUT_LANES + j], lanes[YIELD + j] = 1.0, math.inf
    states[LANE_VELOCITY + j] = states[LANE_SLIDES + j] = 0.0
