"""Where kernels meet arrays, written once: the loop over the cells of a tile.

A tile is some thousand cells in the order of the grid, gathered by `slipsweep.grid.engine`: one array a parameter.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar, uncounted
from slipsweep.kernels.block import FRICTION_ESTIMATED, Cell, Motion, Options, decay_rate_of, interface_of, store
from slipsweep.motion.pieces import Wave

#: Rows of a tile's results.
ROWS = Motion._fields


class Cells(NamedTuple):
    """The fields of `Cell` of all cells of a tile, each (cells,), float64 without gaps."""

    tan_theta: np.ndarray
    mu_s: np.ndarray
    amplitude: np.ndarray
    yield_acceleration: np.ndarray
    decay_rate: np.ndarray
    delta_mu: np.ndarray
    minimum_friction: np.ndarray


@inlined
def cell_at(cells: Cells, j: int) -> Cell:
    """Cell j of a tile."""
    return Cell(
        cells.tan_theta[j],
        cells.mu_s[j],
        cells.amplitude[j],
        cells.yield_acceleration[j],
        cells.decay_rate[j],
        cells.delta_mu[j],
        cells.minimum_friction[j],
    )


@inlined
def uncounted_cells(cells: Cells) -> Cells:
    """The same cells (`decorators.uncounted`)."""
    return Cells(
        uncounted(cells.tan_theta),
        uncounted(cells.mu_s),
        uncounted(cells.amplitude),
        uncounted(cells.yield_acceleration),
        uncounted(cells.decay_rate),
        uncounted(cells.delta_mu),
        uncounted(cells.minimum_friction),
    )


@inlined
def uncounted_wave(wave: Wave) -> Wave:
    """The same wave (`decorators.uncounted`)."""
    return Wave(
        uncounted(wave.pieces), uncounted(wave.cycle), uncounted(wave.shape), uncounted(wave.interval),
        uncounted(wave.height), uncounted(wave.same), uncounted(wave.rises), wave.highest, wave.lowest, wave.lead,
        wave.repeats, wave.again,
    )  # fmt: skip


@scalar
def solve_each(solve: Callable[..., Motion], cells: Cells, common: Any, results: np.ndarray) -> None:
    """Solve the cells of a tile one by one: ``solve(cell, common)`` gives the `Motion` of each.

    `results` is (fields of `Motion`, cells).
    """
    for j in range(results.shape[1]):
        store(solve(cell_at(cells, j), common), j, results)


@kernel
def find_parameters(cells: Cells, options: Options, parameters: np.ndarray) -> None:
    """Write Üy, Eqs. 7-11 and λ of the cells of a tile, their mode and the validity known before the motion.

    `parameters` is (8, cells), its rows in that order (`variables.FRICTION_PARAMETERS`).
    """
    for j in range(parameters.shape[1]):
        cell = cell_at(cells, j)
        found = interface_of(cell, options.rise, options.g)
        parameters[0, j] = found.yield_acceleration
        parameters[1, j] = found.limiting_acceleration
        parameters[2, j] = found.acceleration_ratio
        parameters[3, j] = found.minimum_friction
        parameters[4, j] = found.delta_mu
        parameters[5, j] = decay_rate_of(cell, found.delta_mu, found.minimum_friction, options.g)
        parameters[6, j] = found.sliding_mode
        parameters[7, j] = found.validity & ~FRICTION_ESTIMATED  # known only with the motion
