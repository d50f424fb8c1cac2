"""The exact kernel for waveforms: a block that sticks and slips, or slides continuously, through all cycles."""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import single
from slipsweep.kernels.block import (
    YIELD_GOVERNS,
    Cell,
    Motion,
    Options,
    block_of,
    interface_of,
    store,
)
from slipsweep.kernels.continuous import slide_continuously
from slipsweep.kernels.exact import Workspace, pulse, uncounted_workspace, yield_governs
from slipsweep.kernels.grid import cell_at, uncounted_wave
from slipsweep.kernels.pulse import Pulse, motion_of, validity_before
from slipsweep.kernels.train import train_of
from slipsweep.model import equations as eq
from slipsweep.model.friction import FrictionLaw, exponential
from slipsweep.motion.pieces import Wave

_train = train_of(pulse)


@single
def solve_cell(law: FrictionLaw, cell: Cell, options: Options, wave: Wave, workspace: Workspace) -> Motion:
    """The response of a cell of any law that gives what this kernel takes of it (`FrictionLaw.missing`)."""
    interface = interface_of(cell, options.rise, options.g)
    block, mode = block_of(law, cell, interface, options.rise, options.g), interface.sliding_mode
    validity = validity_before(interface.validity, block, wave)
    found = Pulse(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    if mode == eq.CONTINUOUS:
        found = slide_continuously(block, options.wants_peak, wave, workspace)
    elif mode == eq.STICK_SLIP and block.amplitude * wave.highest > block.yield_acceleration:
        validity |= YIELD_GOVERNS if yield_governs(block, wave) else 0
        found = _train(block, options, wave, workspace, workspace.known)
    elif mode < 0:
        found = Pulse(math.nan, math.nan, math.nan, 0.0, 0.0, 0.0, 0)
    return motion_of(block, mode, validity, found)


@kernel
def solve_waves(cells: np.ndarray, options: Options, wave: Wave, workspace: Workspace, results: np.ndarray) -> None:
    """Solve the cells of a tile under a waveform exactly; `results` is (fields of `Motion`, cells)."""
    wave, workspace = uncounted_wave(wave), uncounted_workspace(workspace)
    for j in range(cells.size):
        store(solve_cell(exponential(), cell_at(cells, j), options, wave, workspace), j, results)
