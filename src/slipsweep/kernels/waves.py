"""The exact kernel for waveforms: a block that sticks and slips, or slides continuously, through all cycles."""

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.kernels.block import Options, store
from slipsweep.kernels.continuous import slide_continuously
from slipsweep.kernels.exact import Workspace, pulse, uncounted_workspace
from slipsweep.kernels.grid import cell_at, uncounted_wave
from slipsweep.kernels.pulse import yield_governs
from slipsweep.kernels.train import cell_solver_of
from slipsweep.model.friction import exponential
from slipsweep.motion.pieces import Wave

solve_cell = cell_solver_of(pulse, slide_continuously, yield_governs)


@kernel
def solve_waves(
    cells: np.ndarray, options: Options, wave: Wave, workspace: Workspace, results: np.ndarray
) -> None:
    """Solve the cells of a tile under a waveform exactly; `results` is (fields of `Motion`, cells)."""
    wave = uncounted_wave(wave)
    workspace = uncounted_workspace(workspace)
    for j in range(cells.size):
        store(solve_cell(exponential(), cell_at(cells, j), options, wave, workspace), j, results)
