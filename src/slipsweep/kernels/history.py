"""Time histories: the log of a walk, sampled.

The parts of the motion in the log are those that a sweep goes through, and each sample in one comes
from the functions that integrate it there: a history ends at the displacement that the sweep gives.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels.base import held_gains
from slipsweep.kernels.block import Cell, Motion, Options, interface_of
from slipsweep.kernels.eq4 import Block, block_of, eq4_gains, response
from slipsweep.kernels.grid import CELL
from slipsweep.kernels.slide import ATTENUATES, HELD, SLIDES_ON, Slide
from slipsweep.kernels.walk import solve_walk, workspace_of
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Path, values_at

#: Rows of the first log that is tried, enough for most records at once; one of which a single pulse
#: has more is made twice as long.
_ROWS = 8192


class History(NamedTuple):
    """Samples of a history, each (samples,): Üg, Ü, μ by Eq. 1, V and W."""

    ground_acceleration: NDArray[np.float64]
    block_acceleration: NDArray[np.float64]
    friction_coefficient: NDArray[np.float64]
    velocity: NDArray[np.float64]
    displacement: NDArray[np.float64]


def fill_history(
    cell: Cell, options: Options, path: Path, phases: NDArray[np.float64], history: History
) -> None:
    """Fill a history at increasing phases, of a record at increasing times at time scale 1.

    `cell.amplitude` is the factor on the path.
    """
    cells = np.array([tuple(cell)], CELL)
    results = np.empty((len(Motion._fields), 1))
    walks, slides, log = workspace_of(_ROWS)
    history.ground_acceleration[:] = cell.amplitude * values_at(path, phases)
    sampled = 0
    while True:
        solve_walk(cells, options, path, walks, slides, log, results)
        rows = int(slides[0].logged)
        walk = walks[0]
        if rows == 0 and not walk.ended:
            log = np.zeros(2 * log.size, log.dtype)
            continue
        sampled = sample_log(
            cell, options, path, walks, slides, log[:rows], phases, sampled, history
        )
        if walk.ended or sampled == phases.size:
            break


@scalar
def sample_part(
    block: Block, path: Path, part: Any, phi: float, at: int, history: History, slide: Slide
) -> None:
    """Fill Ü, V and W of a sample at phase φ of the path in a part of the motion."""
    since = max(phi - part.start, 0.0)
    velocity = part.velocity
    piece = path.base.pieces[part.piece]
    curve = path.base.curves[piece.curve]
    if part.kind == ATTENUATES:
        history.block_acceleration[at] += part.held
        gained = -part.held * since
        moved = -0.5 * part.held * since * since
    elif part.kind == HELD:
        history.block_acceleration[at] = part.held
        gained, moved = held_gains(
            piece, curve, block.amplitude, part.held, part.tau, part.tau + since
        )
    else:
        history.block_acceleration[at] = response(block, history.ground_acceleration[at])
        gained, moved = eq4_gains(block, piece, curve, part.tau, part.tau + since, slide)
    left = velocity + gained
    if part.kind != SLIDES_ON:  # beyond a stop, by rounding
        left = max(left, 0.0) if velocity >= 0.0 else min(left, 0.0)
    history.velocity[at] = left
    history.displacement[at] = part.displacement + velocity * since + moved


@kernel
def sample_log(
    cell: Cell,
    options: Options,
    path: Path,
    walks: np.ndarray,
    slides: np.ndarray,
    log: np.ndarray,
    phases: np.ndarray,
    at: int,
    history: History,
) -> int:
    """Fill Ü, μ, V and W of the samples from number `at` on, as far as the walk has gone.

    Returns the number of the next one.      The block moves with the base where it does not slide.
    """
    walk = walks[0]
    interface = interface_of(cell, options.rise, options.g)
    block = block_of(cell, cell.amplitude, interface, options)
    row = 0
    while at < phases.size and phases[at] < walk.until:
        history.block_acceleration[at] = history.ground_acceleration[at]
        history.velocity[at] = 0.0
        while row < log.size and phases[at] - log[row].phases_before >= log[row].end:
            row += 1
        if row == log.size:
            # at rest, or after a wave under which the block slides continuously
            history.velocity[at] = walk.velocity if walk.ended else 0.0
            history.displacement[at] = walk.displacement
        else:
            part = log[row]
            phi = phases[at] - part.phases_before
            history.displacement[at] = part.displacement
            # a part that is entered with V follows the one before: what lies between is rounding
            if phi >= part.start or part.velocity != 0.0:
                block = with_friction(block, part.delta_mu, part.decay_rate)
                sample_part(block, path, part, phi, at, history, slides[0])
        history.friction_coefficient[at] = eq.mobilised_friction(  # Eq. 1
            history.ground_acceleration[at],
            history.block_acceleration[at],
            block.mu_s,
            block.tan_theta,
            block.g,
        )
        at += 1
    return at


@scalar
def with_friction(block: Block, delta_mu: float, decay_rate: float) -> Block:
    """Return the block with the friction of a pulse."""
    return Block(
        block.amplitude,
        block.yield_acceleration,
        block.mu_s,
        block.tan_theta,
        delta_mu,
        decay_rate,
        block.g,
        block.rise,
    )
