"""Time histories: samples of the walk of a cell."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipsweep.kernels import sampling
from slipsweep.kernels.block import Cell, Motion, Options
from slipsweep.kernels.grid import CELL
from slipsweep.kernels.walk import solve_walk, workspace_of
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Path, values_at


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
    walks, slides, lags, samples = workspace_of(path, phases.size)
    ground = cell.amplitude * values_at(path, phases)
    samples[sampling.PHASE] = phases
    samples[sampling.GROUND_ACCELERATION] = ground
    samples[sampling.BLOCK_ACCELERATION] = ground  # at rest
    solve_walk(cells, options, path, walks, slides, lags, samples, results)
    # after a wave a block that slides continuously keeps its velocity
    after = int(slides["sampled"][0])
    samples[sampling.VELOCITY, after:] = walks["velocity"][0]
    samples[sampling.DISPLACEMENT, after:] = walks["displacement"][0]
    history.ground_acceleration[:] = ground
    history.block_acceleration[:] = samples[sampling.BLOCK_ACCELERATION]
    history.friction_coefficient[:] = eq.mobilised_friction(
        ground,  # type: ignore[arg-type]
        samples[sampling.BLOCK_ACCELERATION],
        cell.mu_s,
        cell.tan_theta,
        options.g,
    )
    history.velocity[:] = samples[sampling.VELOCITY]
    history.displacement[:] = samples[sampling.DISPLACEMENT]
