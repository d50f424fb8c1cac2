"""Newmark's block whose strength changes while it slides: two laws μ(v, s), and how they are stepped.

s = ∫|v|dt is the slip since the beginning.  The block is that of `kernels.step`; its acceleration is
that of Coulomb with μ, g tan(arctan μ − θ) downslope and −g tan(arctan μ + θ) upslope.
docs/numerics.md#changing-strength
"""

import math
from typing import Any, TypeAlias

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import registered
from slipsweep.jit.elementary import exp
from slipsweep.kernels.block import Options
from slipsweep.kernels.step import UP, Law, Steps
from slipsweep.kernels.step_cells import solve_cells
from slipsweep.motion.paths import Path

#: A block of `kernels.step`.
Block: TypeAlias = Any

#: Parts of the time scale of a law that the longest step takes, times the number of steps a cycle.
LAW_SHARE = 25.0


@registered
def weakening_friction(block: Block, ground: float, velocity: float, slip: float) -> float:
    """Friction that falls linearly with the slip, μr + (μs − μr) max(0, 1 − s/D).

    That is the strength of geosynthetic interfaces between peak and residual, as Matasovic,
    Kavazanjian and Giroud (1998, Geosynthetics International 5, 491-520) approximate it.
    """
    left = max(0.0, 1.0 - slip / block.weakening_distance)
    return block.residual_mu + (block.mu_s - block.residual_mu) * left


@registered
def rate_friction(block: Block, ground: float, velocity: float, slip: float) -> float:
    """Friction that depends on the speed, μf − (μf − μs) e^(−a|v|).

    Just below v = 0 it goes on smoothly: steps are cut there.

    Constantinou, Mokha and Reinhorn (1990), "Teflon bearings in base isolation II: modeling",
    Journal of Structural Engineering 116, 455-474.
    """
    decayed = exp(-block.rate_constant * velocity)
    return block.fast_mu - (block.fast_mu - block.mu_s) * decayed


@registered
def acceleration_slope(block: Block, friction: float) -> float:
    """Derivative of the block's acceleration by μ, g (1 + tan² θ) / (1 ± μ tan θ)²."""
    tan_theta = -block.tan_theta if block.phase == UP else block.tan_theta
    denominator = 1.0 + friction * tan_theta
    return block.g * (1.0 + tan_theta * tan_theta) / (denominator * denominator)


@registered
def weakening_step(block: Block, first_rate: float) -> float:
    """Longest step while the block weakens: (25/N) √(D / |g' (μs − μr)|), g' by `acceleration_slope`.

    The motion is that of dV/dφ = Üg − k (W₀ − W) then, with a time of its own, 1/√k.
    """
    if block.slip >= block.weakens_until:
        return math.inf
    slip = block.slip * block.seconds * block.seconds
    slope = acceleration_slope(block, weakening_friction(block, 0.0, 0.0, slip))
    change = abs(slope * (block.mu_s - block.residual_mu)) / block.weakens_until
    return LAW_SHARE / (block.steps * math.sqrt(change))


@registered
def rate_step(block: Block, first_rate: float) -> float:
    """Longest step where friction depends on the velocity.

    Two times limit it: that in which V returns to its steady value, and that in which a|v| changes
    by 1 + a|v|/4.
    """
    constant = block.rate_constant * block.seconds
    exponent = constant * abs(block.velocity)
    speed = abs(block.velocity) * block.seconds
    slope = acceleration_slope(block, rate_friction(block, 0.0, speed, 0.0))
    change = slope * abs(block.fast_mu - block.mu_s) * exp(-exponent)
    returning = 1.0 / (constant * change)
    passing = (1.0 + 0.25 * exponent) / (constant * abs(first_rate))
    return LAW_SHARE / block.steps * min(returning, passing)


@kernel
def solve_weakening(
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile whose strength falls with slip; arguments as of `step.solve_steps`."""
    law = Law(weakening_friction, True, True, True, weakening_step)
    solve_cells(law, cells, options, path, blocks, steps, log, results)


@kernel
def solve_rate(
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile whose strength depends on velocity; arguments as of `step.solve_steps`."""
    law = Law(rate_friction, True, False, True, rate_step)
    solve_cells(law, cells, options, path, blocks, steps, log, results)
