"""The cells of a tile, one by one."""

import math
from collections.abc import Callable

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    Block,
    Motion,
    Options,
    block_at,
    store_motion,
)
from slipsweep.kernels.cycle.continuous import continuous
from slipsweep.kernels.cycle.legs import Room
from slipsweep.kernels.cycle.pulse import train
from slipsweep.kernels.pulse import (
    validity_before,
)
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.motion.pieces import Wave


def solver_of(
    continuous: Callable[[Block, Options, Wave, Room], Motion],
) -> Callable[[np.ndarray, int, Options, Wave, Room, np.ndarray, np.ndarray], None]:
    """The jitted solver of a tile's cells, one by one, given how one slides continuously."""

    @scalar
    def solve_cells(
        cells: np.ndarray, count: int, options: Options, wave: Wave, room: Room, motion: np.ndarray, codes: np.ndarray
    ) -> None:
        """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity."""
        for j in range(count):
            block = block_at(cells, j, options)
            codes[0, j], codes[1, j] = block.sliding_mode, validity_before(block, wave)
            motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
            if block.sliding_mode == CONTINUOUS:
                store_motion(continuous(block, options, wave, room), j, motion, codes)
            elif block.sliding_mode == STICK_SLIP:
                store_motion(train(block, options, wave, room), j, motion, codes)

    return solve_cells


solve_cells = solver_of(continuous)
