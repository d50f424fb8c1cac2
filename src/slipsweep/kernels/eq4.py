"""Eq. 4 with the friction of a block: values, roots, and gains of V and W where b follows it.

E is the block's acceleration by Eq. 4, and D = Üg − E the relative acceleration,

    D = ± g (μs − μ) + |Üg| tan θ (μs − tan θ − μ)        ± is the sign of Üg

docs/numerics.md#eq-4-as-a-lag and docs/numerics.md#slope-and-inflection
"""

import math
from enum import IntEnum
from typing import NamedTuple

from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.jit.elementary import versine
from slipsweep.kernels.base import base_acceleration, offset_at
from slipsweep.kernels.block import LITERAL, Cell, Interface, Options, decay_rate_of
from slipsweep.kernels.roots import root_of
from slipsweep.kernels.slide import Slide
from slipsweep.model import equations as eq
from slipsweep.model import friction
from slipsweep.motion.paths import Curve, Piece
from slipsweep.motion.pieces import NODES, WEIGHTS


class Quantity(IntEnum):
    """Quantities of which `eq4_root` seeks a level: E, dE/dx and D."""

    RESPONSE = 0
    SLOPE = 1
    RELATIVE_ACCELERATION = 2


#: Panels of the quadrature end where |Üg| is so many decay lengths larger than at the end where the
#: friction is larger; past the third it has decayed to 1e-18.
_PANEL_ENDS = (6.0, 18.0, 42.0, math.inf)

NODE_COUNT = NODES.size


class Block(NamedTuple):
    """A block that slides: all that its motion depends on."""

    amplitude: float  # factor on w of the path
    yield_acceleration: float
    mu_s: float
    tan_theta: float
    delta_mu: float
    decay_rate: float
    g: float
    rise: int


@inlined
def block_of(cell: Cell, amplitude: float, interface: Interface, options: Options) -> Block:
    """Return the block of a cell; λ is from Eq. 6 where it is not given."""
    decay_rate = decay_rate_of(cell, interface.delta_mu, interface.minimum_friction, options.g)
    return Block(
        amplitude,
        interface.yield_acceleration,
        cell.mu_s,
        cell.tan_theta,
        interface.delta_mu,
        decay_rate,
        options.g,
        options.rise,
    )


# ---------------------------------------------------------------------------------------- values


@inlined
def friction_at(block: Block, x: float) -> float:
    """Return μ at Üg = x, Eq. 6."""
    return eq.friction_coefficient(x, block.mu_s, block.delta_mu, block.decay_rate, block.g)


@scalar
def relative_acceleration(block: Block, x: float) -> float:
    """Return D(x), the rate of V where the block obeys Eq. 4."""
    mu = friction_at(block, x)
    return eq.relative_acceleration(x, mu, block.mu_s, block.tan_theta, block.g)


@inlined
def response(block: Block, x: float) -> float:
    """Return E(x), the block's acceleration by Eq. 4."""
    return x - relative_acceleration(block, x)


@scalar
def slopes(block: Block, x: float) -> tuple[float, float, float]:
    """Return D, dE/dx and d²E/dx² at x ≠ 0."""
    mu = friction_at(block, x)
    first, second = friction.exponential_derivatives(mu, block.decay_rate, block.g)
    slope = eq.relative_acceleration_slope(x, mu, first, block.mu_s, block.tan_theta, block.g)
    curvature = eq.relative_acceleration_curvature(x, first, second, block.tan_theta, block.g)
    value = eq.relative_acceleration(x, mu, block.mu_s, block.tan_theta, block.g)
    return value, 1.0 - slope, -curvature


@inlined
def inflection(block: Block) -> float:
    """Return the x > 0 up to which E is concave; it is convex beyond."""
    return friction.exponential_inflection(block.tan_theta, block.decay_rate, block.g)


@inlined
def opposite(a: float, b: float) -> bool:
    """Return True if a and b have opposite signs; their product might underflow."""
    return a < 0.0 < b or b < 0.0 < a


@inlined
def follows_eq4(block: Block, held: float, by_eq4: float, slope: float) -> bool:
    """Return True if b is E on a rise of Üg, and not held: option `rise`.

    Literal: b = E.  Monotone, b = max(b, E): b is E where that exceeds the `held` b, as long as E
    rises, dE/dx > 0.
    """
    return block.rise == LITERAL or (by_eq4 > held and slope > 0.0)


# ----------------------------------------------------------------------------------------- roots


@scalar
def _excess(where: tuple[Block, Quantity, float], x: float) -> tuple[float, float]:
    block, quantity, level = where
    value, slope, curvature = slopes(block, x)
    if quantity == Quantity.SLOPE:
        return slope - level, curvature
    if quantity == Quantity.RELATIVE_ACCELERATION:
        return value, 1.0 - slope
    return (x - value) - level, slope


_eq4_root = root_of(_excess)


@scalar
def eq4_root(
    block: Block, quantity: Quantity, level: float, start: float, end: float, first: float
) -> float:
    """Return the x between start and end at which E, dE/dx or D is a level, from `first` on.

    The quantity passes the level once.
    """
    where = (block, quantity, level)
    if _excess(where, end)[0] >= 0.0:
        return _eq4_root(where, start, end, first, 0.0)
    return _eq4_root(where, end, start, first, 0.0)


@scalar
def relative_acceleration_root(block: Block, start: float, end: float) -> float:
    """Return the x between start and end at which D changes its sign."""
    # friction is back at μs there, and most D are near 0: from the end Newton's steps would leave
    # the bracket
    at_static = friction.exponential_static_acceleration(
        block.mu_s, block.delta_mu, block.decay_rate, block.g
    )
    static = math.copysign(at_static, end)
    first = static if min(start, end) < static < max(start, end) else end
    return eq4_root(block, Quantity.RELATIVE_ACCELERATION, 0.0, start, end, first)


@scalar
def stays_at_yield(block: Block, start: float, end: float) -> bool:
    """Return True if b, at Üy before, stays there while Üg rises from `start` ≥ Üy to `end`."""
    highest = max(response(block, start), response(block, end))
    bend = min(inflection(block), end)
    if bend > start and slopes(block, start)[1] > 0.0 > slopes(block, bend)[1]:
        turn = eq4_root(block, Quantity.SLOPE, 0.0, start, bend, bend)
        highest = max(highest, response(block, turn))
    return not follows_eq4(block, block.yield_acceleration, highest, math.inf)


# ------------------------------------------------------------------------- gains along a piece


class LagIntegrals(NamedTuple):
    """Integrals of the two terms of `equations.lag`, over g and tan θ, and their moments.

    ∫ (μs − μ) dτ and ∫ |x| (μs − tan θ − μ) dτ, and each with the weight end − τ.  They stand
    apart, because over a symmetric cycle the first must cancel to the last digit.
    """

    first: float
    second: float
    first_x: float
    second_x: float


@scalar
def straight_lag_integrals(block: Block, x: float, change: float, width: float) -> LagIntegrals:
    """Return `LagIntegrals` in closed form where |Üg| changes by `change` along a straight line.

    docs/numerics.md#straight-pieces
    """
    whole, early, late, both = friction.exponential_moments(
        x, change, block.mu_s, block.delta_mu, block.decay_rate, block.g
    )
    kept = block.mu_s - block.tan_theta
    return LagIntegrals(
        (block.mu_s - whole) * width,
        (0.5 * block.mu_s - early) * width * width,
        (kept * (x + 0.5 * change) - (x * whole + change * late)) * width,
        (kept * (0.5 * x + change / 6.0) - (x * early + change * both)) * width * width,
    )


@scalar
def panel_lag_integrals(
    block: Block, piece: Piece, curve: Curve, near: float, until: float, end: float, slide: Slide
) -> LagIntegrals:
    """Return `LagIntegrals` over a panel of the quadrature: 16 nodes of Gauss and Legendre."""
    # loops of their own, and powers one by one, so that LLVM takes nodes together
    x = slide.nodes
    mu = slide.friction
    amplitude = block.amplitude
    width = until - near
    top = piece.top
    if abs(width) == piece.finish - piece.begin:
        for node in range(NODE_COUNT):
            x[node] = amplitude * curve.nodes[node]
    elif piece.arc:
        for node in range(NODE_COUNT):
            x[node] = amplitude * (1.0 - versine(near + width * NODES[node]))
    else:
        for node in range(NODE_COUNT):
            x[node] = 0.0
        for k in range(piece.degree - 1, -1, -1):
            coefficient = curve.coefficients[k]
            for node in range(NODE_COUNT):
                x[node] = x[node] * (near + width * NODES[node]) + coefficient
        for node in range(NODE_COUNT):
            x[node] = amplitude * abs(top + x[node] * (near + width * NODES[node]))
    for node in range(NODE_COUNT):
        mu[node] = friction_at(block, x[node])
    mu_s = block.mu_s
    kept = mu_s - block.tan_theta
    first = 0.0
    second = 0.0
    first_x = 0.0
    second_x = 0.0
    for node in range(NODE_COUNT):
        left = end - (near + width * NODES[node])
        weight = abs(width) * WEIGHTS[node]
        rate = weight * (mu_s - mu[node])
        rate_x = weight * x[node] * (kept - mu[node])
        first += rate
        second += left * rate
        first_x += rate_x
        second_x += left * rate_x
    return LagIntegrals(first, second, first_x, second_x)


@scalar
def lag_integrals(
    block: Block, piece: Piece, curve: Curve, start: float, end: float, slide: Slide
) -> LagIntegrals:
    """Return `LagIntegrals` over a part of a piece.

    A curve is integrated panel by panel from the larger friction on.

    docs/numerics.md#curved-pieces
    """
    x_start = abs(base_acceleration(piece, curve, block.amplitude, start))
    x_end = abs(base_acceleration(piece, curve, block.amplitude, end))
    if piece.degree <= 1:
        return straight_lag_integrals(block, x_start, x_end - x_start, end - start)
    length = friction.exponential_decay_length(block.decay_rate, block.g)
    e_foldings = abs(x_end - x_start) / length
    near, far = (start, end) if x_start <= x_end else (end, start)
    least = min(x_start, x_end)
    first = 0.0
    second = 0.0
    first_x = 0.0
    second_x = 0.0
    for bound in _PANEL_ENDS:
        until = far
        if e_foldings > bound:
            x = math.copysign(least + bound * length, piece.top)
            until = offset_at(piece, curve, block.amplitude, x)
        panel = panel_lag_integrals(block, piece, curve, near, until, end, slide)
        first += panel.first
        second += panel.second
        first_x += panel.first_x
        second_x += panel.second_x
        near = until
        if e_foldings <= bound:
            break
    return LagIntegrals(first, second, first_x, second_x)


@single
def eq4_gains(
    block: Block, piece: Piece, curve: Curve, start: float, end: float, slide: Slide
) -> tuple[float, float]:
    """Return ∫ D dτ and ∫ (end − τ) D dτ, gains of V and W from rest by Eq. 4, on a piece."""
    lag = lag_integrals(block, piece, curve, start, end, slide)
    side_g = math.copysign(block.g, piece.top)
    gained = side_g * lag.first + block.tan_theta * lag.first_x
    return gained, side_g * lag.second + block.tan_theta * lag.second_x
