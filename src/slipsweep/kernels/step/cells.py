"""The cells of a tile by steps, one by one."""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import Options, block_at, store_motion
from slipsweep.kernels.pulse import validity_before
from slipsweep.kernels.step.continuous import continuous
from slipsweep.kernels.step.lanes import Room
from slipsweep.kernels.step.pulse import train
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> None:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity."""
    wave = room.steps.wave
    for j in range(count):
        block = block_at(cells, j, options)
        codes[0, j], codes[1, j] = block.sliding_mode, validity_before(block, wave)
        motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
        if block.sliding_mode == CONTINUOUS:
            store_motion(continuous(block, options.wants_peak, room), j, motion, codes)
        elif block.sliding_mode == STICK_SLIP:
            store_motion(train(block, options, wave, room), j, motion, codes)
