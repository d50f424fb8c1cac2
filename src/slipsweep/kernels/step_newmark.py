"""Newmark's block, stepped: with its yield acceleration, or with a strength that changes.

The steps are those of `kernels.step`.  The block slides with the constant Üy, and where it does so
in both directions with Üy,up; or its acceleration is that of Coulomb with μ, g tan(arctan μ − θ)
downslope and −g tan(arctan μ + θ) upslope.  Two laws μ(v, s) change while it slides; s = ∫|v|dt is
the slip since the beginning.
docs/numerics.md#changing-strength
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import as_value, inlined, registered, scalar
from slipsweep.jit.elementary import exp
from slipsweep.kernels.block import NOT_AT_REST, Options
from slipsweep.kernels.step import (
    GROWTH_SHARE,
    SLIDES,
    STUCK,
    Law,
    Steps,
    begin_slide,
    friction_at,
    ground_at,
    place_beyond,
    rest,
    unlimited,
    walk,
)
from slipsweep.kernels.step_cells import run_out, solve_cells
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Path, Piece

#: A block of `kernels.step`.
Block: TypeAlias = Any

#: Yield acceleration upslope, m/s², where no acceleration moves the block that way.  It is finite,
#: as it has to stop a block whose strength grows so far while it slides.
LOCKED = 1e9

#: Parts of the time scale of a law that the longest step takes, times the number of steps a cycle.
LAW_SHARE = 25.0


# ------------------------------------------------------------------ from waiting to rest


@registered
def no_friction(block: Block, ground: float, velocity: float, slip: float) -> float:
    """Return NaN: the block keeps its yield acceleration."""
    return math.nan


@scalar
def resistance(law: Law, block: Block, side: float, velocity: float, slip: float) -> float:
    """Ü against the slide of a block downslope (side 1) or upslope (side −1); below 0 it drives.

    That is its yield acceleration, or that of Coulomb with μ at the speed in the direction of the
    slide, which a step may carry a little below 0.
    """
    friction = friction_at(law, block, 0.0, side * velocity, slip)
    if math.isnan(friction):
        return block.yield_acceleration if side > 0.0 else block.upslope_yield_acceleration
    if side < 0.0 and friction * block.tan_theta >= 1.0:
        return LOCKED
    return eq.coulomb_yield_acceleration(friction, side * block.tan_theta, block.g)


@registered
def newmark_rate(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Üg − Ü of a block that slides."""
    return ground - block.side * resistance(law, block, block.side, velocity, slip)


@as_value
def wait_for_yield(
    law: Law,
    block: Block,
    piece: Piece,
    curves: np.ndarray,
    tau: float,
    until: float,
    end: float,
) -> float:
    """Return τ at which a block at rest begins to slide: Üg exceeds its resistance."""
    down = resistance(law, block, 1.0, 0.0, block.slip)
    up = resistance(law, block, -1.0, 0.0, block.slip) if block.slides_up else math.inf
    block.yield_acceleration = down
    ground = ground_at(block, piece, curves, tau)
    last = block.amplitude * piece.last
    level = down
    side = 1.0
    if max(ground, last) <= down:
        level = up
        side = -1.0
        if min(ground, last) >= -up:
            return piece.finish
    if side * ground <= level:
        tau = max(tau, place_beyond(block, piece, curves, level, side))
    block.phase = SLIDES
    block.side = side
    begin_slide(block, piece, tau)
    return tau


@as_value
def come_to_rest(law: Law, block: Block, path: Path, steps: Steps, log: np.ndarray) -> None:
    """After the shaking the strength of the block takes V to 0, or never does.

    A block that is at rest then, but too weak to stay there, has no value, either.
    """
    if not law.knows_motion:
        block.held = resistance(law, block, block.side, 0.0, 0.0)
        run_out(law, block, path, steps, log)
        return
    offset = 2.0 * math.pi * max(path.repeats - 1, 0)
    p = path.base.pieces.size
    block.onset = steps.pieces[p].start + offset
    block.first_step = math.inf
    while block.phase != STUCK and p < steps.pieces.size:
        slip = block.slip
        braking = resistance(law, block, block.side, block.velocity, slip)
        if braking <= 0.0 and slip >= block.weakens_until:
            break
        time_to_stop = abs(block.velocity / braking)
        block.first_step = min(block.first_step, GROWTH_SHARE / block.steps * time_to_stop)
        walk(law, block, path, steps, p, p + 1, offset, log)
        if block.slip == slip:
            rest(block)  # where the strength that is left is just what holds it
        p += 1
    if block.phase != STUCK or resistance(law, block, 1.0, 0.0, block.slip) < 0.0:
        block.validity |= NOT_AT_REST


@inlined
def newmark_law(
    friction: Callable[..., float],
    knows_motion: bool,
    knows_slip: bool,
    longest_step: Callable[..., float],
) -> Law:
    """Return the law of Newmark's block with a friction of its own."""
    return Law(
        friction,
        knows_motion,
        knows_slip,
        longest_step,
        newmark_rate,
        wait_for_yield,
        come_to_rest,
    )


# ------------------------------------------------------------------ strength that changes


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
    tan_theta = block.side * block.tan_theta
    denominator = 1.0 + friction * tan_theta
    return block.g * (1.0 + tan_theta * tan_theta) / (denominator * denominator)


@registered
def weakening_step(block: Block, first_rate: float) -> float:
    """Longest step while the block weakens, (25/N) √(D / |g' (μs − μr)|).

    g' is that of `acceleration_slope`.

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


# ------------------------------------------------------------------ kernels


@kernel
def solve_newmark_steps(
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step cells with a constant yield acceleration; arguments as of `step_cells.solve_steps`."""
    law = newmark_law(no_friction, False, False, unlimited)
    solve_cells(law, cells, options, path, blocks, steps, log, results)


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
    """Step cells whose strength falls with slip; arguments as of `step_cells.solve_steps`."""
    law = newmark_law(weakening_friction, True, True, weakening_step)
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
    """Step cells whose strength depends on velocity; arguments as of `step_cells.solve_steps`."""
    law = newmark_law(rate_friction, True, False, rate_step)
    solve_cells(law, cells, options, path, blocks, steps, log, results)
