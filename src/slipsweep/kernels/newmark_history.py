"""Time histories of Newmark's block: the slides on each piece of the path, sampled.

The block is moved as in a sweep, but through every cycle of a wave; a record is a path of straight
pieces (`motion.paths`).  A sample in a slide comes from the integrals that move the block there.
"""

import math

import numpy as np
from numpy.typing import NDArray

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels.history import History
from slipsweep.kernels.newmark import (
    BLOCK,
    Block,
    begin,
    gains,
    move_along,
)
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Curve, Path, Piece, values_at


def fill_newmark_history(
    cells: np.ndarray,
    g: float,
    cycles: int,
    path: Path,
    phases: NDArray[np.float64],
    history: History,
) -> None:
    """Fill a history at increasing phases, of a record at increasing times at time scale 1.

    `cells`, (1,) of `NEWMARK_CELL`, has the block; its amplitude is the factor on the path.
    """
    history.ground_acceleration[:] = cells["amplitude"][0] * values_at(path, phases)
    sample_newmark(cells, g, cycles, path, phases, np.zeros(1, BLOCK), history)


@scalar
def cycle_of_path(path: Path, n: int) -> int:
    """Return the cycle of the path that is cycle n of the shaking."""
    if n < path.lead:
        return n
    return path.lead if n < path.lead + path.repeats else n - max(path.repeats - 1, 0)


@scalar
def sample_on_piece(
    block: Block, piece: Piece, curve: Curve, tau: float, at: int, history: History
) -> None:
    """Fill Ü, V and W of a sample at τ on the piece that the block was moved along last."""
    history.block_acceleration[at] = history.ground_acceleration[at]
    history.velocity[at] = 0.0
    history.displacement[at] = block.displacement
    for n in range(block.parts):
        if tau < block.part_start[n]:  # at rest before it
            history.displacement[at] = block.part_displacement[n]
            return
        if tau < block.part_end[n]:
            side = block.part_side[n]
            downslope = side > 0.0
            limit = block.yield_acceleration if downslope else block.upslope_yield_acceleration
            scale = side * block.amplitude
            excess = scale * piece.top - limit
            start = block.part_start[n]
            speed = block.part_speed[n]
            gained, moved = gains(piece, curve, scale, excess, start, tau)
            history.block_acceleration[at] = side * limit
            history.velocity[at] = side * max(speed + gained, 0.0)
            way = moved + speed * (tau - start)
            history.displacement[at] = block.part_displacement[n] + side * way
            return


@scalar
def sample_after(block: Block, since: float, at: int, history: History) -> None:
    """Fill Ü, V and W of a sample in the run-out, so long after the shaking."""
    speed = abs(block.velocity)
    side = math.copysign(1.0, block.velocity)
    limit = block.yield_acceleration if side > 0.0 else block.upslope_yield_acceleration
    slides = since * limit < speed
    slid = since if slides else speed / limit
    history.block_acceleration[at] = side * limit if slides else 0.0
    history.velocity[at] = side * (speed - limit * since) if slides else 0.0
    history.displacement[at] = block.displacement + side * (speed - 0.5 * limit * slid) * slid


@kernel
def sample_newmark(
    cells: np.ndarray,
    g: float,
    cycles: int,
    path: Path,
    phases: np.ndarray,
    blocks: np.ndarray,
    history: History,
) -> None:
    """Fill Ü, μ by Eq. 1, V and W of a history whose Üg is there."""
    block = blocks[0]
    cell = cells[0]
    begin(block, cell, g)
    pieces = path.base.pieces
    at = 0
    while at < phases.size and phases[at] < pieces[0].start:
        history.block_acceleration[at] = 0.0
        history.velocity[at] = 0.0
        history.displacement[at] = 0.0
        at += 1
    before = 0.0
    for n in range(cycles):
        c = cycle_of_path(path, n)
        before = 2.0 * math.pi * (n - c)
        for p in range(path.cycles[c].first, path.cycles[c + 1].first):
            piece = pieces[p]
            curve = path.base.curves[piece.curve]
            move_along(block, piece, curve, False)
            while at < phases.size and phases[at] - before < piece.end:
                tau = piece.begin + (phases[at] - before - piece.start)
                tau = min(max(tau, piece.begin), piece.finish)
                sample_on_piece(block, piece, curve, tau, at, history)
                at += 1
    end = before + pieces[pieces.size - 1].end
    while at < phases.size:
        sample_after(block, max(phases[at] - end, 0.0), at, history)
        at += 1
    for k in range(phases.size):
        history.friction_coefficient[k] = eq.mobilised_friction(
            history.ground_acceleration[k],
            history.block_acceleration[k],
            cell.mu_s,
            cell.tan_theta,
            g,
        )
