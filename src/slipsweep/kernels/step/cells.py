"""The cells of a tile by steps: laid out in lanes by their sliding mode."""

import math

import numpy as np
from numba import literally

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    LANE_ROWS,
    TILE,
    Options,
    block_at,
    lane_of,
    whole_lanes,
)
from slipsweep.kernels.pulse import (
    validity_before,
)
from slipsweep.kernels.step.continuous import continuous_lanes
from slipsweep.kernels.step.rows import LANE_SIZE
from slipsweep.kernels.step.slides import STATE_SIZE
from slipsweep.kernels.step.stick_slip import stick_slip_lanes
from slipsweep.kernels.step.table import Steps
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK


@scalar
def solve_cells(
    cells: np.ndarray, count: int, rule: int, options: Options, steps: Steps, motion: np.ndarray, codes: np.ndarray
) -> None:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity.

    `rule` is a compile-time constant: with it the loops over lanes lose the middle of the
    step, which only Simpson's rule wants (rectangle, 1.7 against 5.3 ns a step).
    """
    literally(rule)
    where = np.empty(TILE, np.int64)
    lanes, states = np.empty(LANE_SIZE), np.empty(STATE_SIZE * TILE)
    for wanted in (STICK_SLIP, CONTINUOUS):
        lane = 0
        for j in range(count):
            block = block_at(cells, j, options)
            if wanted == STICK_SLIP:
                codes[0, j], codes[1, j] = block.sliding_mode, validity_before(block, steps.wave)
                motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
            if block.sliding_mode == wanted:
                lane_of(block, lanes, lane)
                where[lane] = j
                lane += 1
        for spare in range(lane, whole_lanes(lane)):  # repeats the first, see `whole_lanes`
            where[spare] = where[0]
            for row in range(LANE_ROWS):
                lanes[row * TILE + spare] = lanes[row * TILE]
        if lane > 0 and wanted == STICK_SLIP:
            stick_slip_lanes(lane, rule, options, steps, cells, where, lanes, states, motion, codes)
        elif lane > 0:
            continuous_lanes(lane, rule, options, steps, cells, where, lanes, states, motion, codes)
