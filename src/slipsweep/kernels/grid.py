"""Where kernels meet arrays, written once: the loop over the cells of a tile.

A tile is some thousand cells in the order of the grid, gathered by `slipsweep.grid.engine`: one array a parameter.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from slipsweep.jit.decorators import inlined, scalar, uncounted
from slipsweep.kernels.block import Cell, Motion, store
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
