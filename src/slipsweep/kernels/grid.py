"""Where kernels meet arrays: the cells of a tile, and the kernel of Eqs. 7-11.

A tile is some thousand cells in the order of the grid, gathered by `slipsweep.grid.engine`: an
array of dtype `CELL`.
"""

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined
from slipsweep.kernels.block import FRICTION_ESTIMATED, Cell, Options, decay_rate_of, interface_of

#: The fields of `Cell` of the cells of a tile.
CELL = np.dtype((np.record, [(name, np.float64) for name in Cell._fields]))


@inlined
def cell_at(cells: np.ndarray, j: int) -> Cell:
    """Cell j of a tile."""
    cell = cells[j]
    return Cell(
        cell.tan_theta,
        cell.mu_s,
        cell.amplitude,
        cell.yield_acceleration,
        cell.decay_rate,
        cell.delta_mu,
        cell.minimum_friction,
    )


@kernel
def find_parameters(cells: np.ndarray, options: Options, parameters: np.ndarray) -> None:
    """Write Üy, Eqs. 7-11 and λ of the cells of a tile, their mode and validity before the motion.

    `parameters` is (8, cells), its rows in that order (`variables.FRICTION_PARAMETERS`).
    """
    for j in range(parameters.shape[1]):
        cell = cell_at(cells, j)
        interface = interface_of(cell, options.rise, options.g)
        parameters[0, j] = interface.yield_acceleration
        parameters[1, j] = interface.limiting_acceleration
        parameters[2, j] = interface.acceleration_ratio
        parameters[3, j] = interface.minimum_friction
        parameters[4, j] = interface.delta_mu
        parameters[5, j] = decay_rate_of(
            cell, interface.delta_mu, interface.minimum_friction, options.g
        )
        parameters[6, j] = interface.sliding_mode
        parameters[7, j] = interface.validity & ~FRICTION_ESTIMATED  # known only with the motion
