"""Gains of V and W where the block follows Eq. 4 along a part of a piece: closed forms, or quadrature.

The relative acceleration is D = ±g (μs − μ) + tan θ |x| (μs − tan θ − μ) on the side ±1 of Üg = 0,
x = Üg. docs/numerics.md#straight-pieces and docs/numerics.md#curved-pieces
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.jit.elementary import versine
from slipsweep.kernels.block import Block, friction
from slipsweep.kernels.excitation import base_acceleration, offset_at
from slipsweep.motion.pieces import NODES, WEIGHTS, Piece

#: Where panels of the quadrature end, in e-foldings of the friction from the end where it is
#: larger; past the third it has decayed to 1e-18.
PANEL_BOUNDS = (6.0, 18.0, 42.0, math.inf)


class Lag(NamedTuple):
    """∫ (μs − μ) dτ and ∫ |x| (μs − tan θ − μ) dτ, and each with the weight end − τ.

    Apart, because over a symmetric cycle the first must cancel to the last digit.
    """

    first: float
    second: float
    first_x: float
    second_x: float


@scalar
def straight_lag(block: Block, x: float, change: float, width: float) -> Lag:
    """`Lag` where |Üg| goes along a straight line, by `change`: closed forms of the law's moments."""
    whole, early, late, both = block.law.moments(
        x, change, block.mu_s, block.delta_mu, block.decay_rate, block.g
    )
    kept = block.mu_s - block.tan_theta
    return Lag(
        (block.mu_s - whole) * width,
        (0.5 * block.mu_s - early) * width * width,
        (kept * (x + 0.5 * change) - (x * whole + change * late)) * width,
        (kept * (0.5 * x + change / 6.0) - (x * early + change * both)) * width * width,
    )


@scalar
def at_nodes(piece: Piece, amplitude: float, start: float, width: float) -> np.ndarray:
    """|Üg| at the nodes of the quadrature from `start` on: power by power, so that LLVM takes nodes together."""
    top = piece.top
    x = np.zeros(NODES.size)
    if piece.arc:
        for node in range(NODES.size):
            x[node] = amplitude * (1.0 - versine(start + width * NODES[node]))
        return x
    for k in range(piece.degree - 1, -1, -1):
        coefficient = piece.coefficients[k]
        for node in range(NODES.size):
            x[node] = x[node] * (start + width * NODES[node]) + coefficient
    for node in range(NODES.size):
        x[node] = amplitude * abs(top + x[node] * (start + width * NODES[node]))
    return x


@scalar
def panel_lag(block: Block, piece: Piece, near: float, until: float, end: float) -> Lag:
    """`Lag` over a panel of the quadrature: 16 nodes of Gauss and Legendre."""
    width = until - near
    x = at_nodes(piece, block.amplitude, near, width)
    mu = np.empty(NODES.size)
    for node in range(NODES.size):  # alone, so that LLVM takes nodes together
        mu[node] = friction(block, x[node])
    kept = block.mu_s - block.tan_theta
    first = 0.0
    second = 0.0
    first_x = 0.0
    second_x = 0.0
    for node in range(NODES.size):
        weight = abs(width) * WEIGHTS[node]
        left = end - (near + width * NODES[node])
        rate = weight * (block.mu_s - mu[node])
        rate_x = weight * x[node] * (kept - mu[node])
        first += rate
        second += left * rate
        first_x += rate_x
        second_x += left * rate_x
    return Lag(first, second, first_x, second_x)


@scalar
def curved_lag(
    block: Block, piece: Piece, start: float, end: float, x_start: float, x_end: float
) -> Lag:
    """`Lag` where |Üg| goes along a curve, panel by panel from the end where the friction is larger."""
    length = block.law.decay_length(block.decay_rate, block.g)
    e_foldings = abs(x_end - x_start) / length
    near, far = (start, end) if x_start <= x_end else (end, start)
    least = min(x_start, x_end)
    lag = Lag(0.0, 0.0, 0.0, 0.0)
    for bound in PANEL_BOUNDS:
        until = far
        if e_foldings > bound:
            until = offset_at(
                piece, block.amplitude, math.copysign(least + bound * length, piece.top)
            )
        panel = panel_lag(block, piece, near, until, end)
        lag = Lag(
            lag.first + panel.first,
            lag.second + panel.second,
            lag.first_x + panel.first_x,
            lag.second_x + panel.second_x,
        )
        near = until
        if e_foldings <= bound:
            break
    return lag


@scalar
def lag_integrals(block: Block, piece: Piece, start: float, end: float) -> Lag:
    """`Lag` over a part of piece p."""
    amplitude = block.amplitude
    # most parts begin or end where the piece does
    x_start = (
        amplitude * piece.first
        if start == piece.begin
        else base_acceleration(piece, amplitude, start)
    )
    x_end = (
        amplitude * piece.last if end == piece.finish else base_acceleration(piece, amplitude, end)
    )
    x_start = abs(x_start)
    x_end = abs(x_end)
    if piece.degree <= 1:
        return straight_lag(block, x_start, x_end - x_start, end - start)
    return curved_lag(block, piece, start, end, x_start, x_end)


@scalar
def eq4_integrals(block: Block, piece: Piece, start: float, end: float) -> tuple[float, float]:
    """∫ D dτ and ∫ (end − τ) D dτ over a part of piece p: gains of V and W from rest, after Eq. 4."""
    lag = lag_integrals(block, piece, start, end)
    side_g = math.copysign(block.g, piece.top)
    return (
        side_g * lag.first + block.tan_theta * lag.first_x,
        side_g * lag.second + block.tan_theta * lag.second_x,
    )
