"""Gains of V and W where the block follows Eq. 4 along a part of a piece: closed forms, or quadrature.

A table of pieces is (pieces, columns), its columns those of `slipsweep.motion.pieces`.
docs/numerics.md#straight-pieces and docs/numerics.md#curved-pieces
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar, summed
from slipsweep.jit.elementary import versine
from slipsweep.kernels import linear
from slipsweep.kernels.block import (
    Block,
    friction,
)
from slipsweep.kernels.cycle.legs import AT_NODES, LAGS, STATE_SIZE
from slipsweep.kernels.excitation import offset_at, plane
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import (
    ARC,
    BEGIN,
    COEFFICIENTS,
    DEGREE,
    FINISH,
    FIRST,
    LAST,
    NODES,
    TERM,
    TOP,
    WEIGHTS,
)

#: Where panels of the quadrature end, in e-foldings of the friction from the end where it is larger;
#: past the third it has decayed to 1e-18.
PANEL_BOUNDS = (6.0, 18.0, 42.0, math.inf)


@in_lanes
def straight_lag(block: Block, x: float, change: float, width: float) -> tuple[float, float, float, float]:
    """`lag_integrals` where |Üg| goes along a straight line, by `change`: closed forms.

    The exponential is taken from the end where the friction is larger, so that its argument is
    never positive: nothing overflows, however large λ is.
    """
    largest = eq.friction_coefficient(min(x, x + change), block.mu_s, block.delta_mu, block.decay_rate, block.g)
    whole, larger, smaller, both = linear.exponential_moments(block.decay_rate / block.g * abs(change))
    early, late = (smaller, larger) if change < 0.0 else (larger, smaller)
    kept = block.mu_s - block.tan_theta
    return (
        (block.mu_s - largest * whole) * width,
        (0.5 * block.mu_s - largest * early) * width * width,
        (kept * (x + 0.5 * change) - largest * (x * whole + change * late)) * width,
        (kept * (0.5 * x + change / 6.0) - largest * (x * early + change * both)) * width * width,
    )


@scalar
def gains_of_straight(block: Block, x: float, change: float, width: float) -> tuple[float, float]:
    """`eq4_integrals` where Üg > 0 goes along a straight line, by `change`."""
    first, second, first_x, second_x = straight_lag(block, x, change, width)
    return block.g * first + block.tan_theta * first_x, block.g * second + block.tan_theta * second_x


@scalar
def straight_gains(block: Block, rows: np.ndarray) -> None:
    """`eq4_integrals` in lanes: rows of |Üg|, its change, the length and the side (±1) in, the two gains out."""
    for j in range(LAGS):
        first, second, first_x, second_x = straight_lag(block, rows[j], rows[LAGS + j], rows[2 * LAGS + j])
        side_g = rows[3 * LAGS + j] * block.g
        rows[4 * LAGS + j] = side_g * first + block.tan_theta * first_x
        rows[5 * LAGS + j] = side_g * second + block.tan_theta * second_x


@scalar
def at_nodes(pieces: np.ndarray, p: int, amplitude: float, start: float, width: float, x: np.ndarray) -> None:
    """Fill in |Üg| at the nodes of the quadrature from `start` on: power by power, so that the nodes are lanes."""
    top = pieces[p, TOP]
    if pieces[p, ARC] > 0.0:
        for node in range(NODES.size):
            x[node] = amplitude * (1.0 - versine(start + width * NODES[node]))
        return
    for node in range(NODES.size):
        x[node] = 0.0
    for k in range(int(pieces[p, DEGREE]) - 1, -1, -1):
        coefficient = pieces[p, COEFFICIENTS + TERM * k]
        for node in range(NODES.size):
            x[node] = x[node] * (start + width * NODES[node]) + coefficient
    for node in range(NODES.size):
        x[node] = amplitude * abs(top + x[node] * (start + width * NODES[node]))


@summed
def curved_lag(
    block: Block, pieces: np.ndarray, p: int, start: float, end: float, x_start: float, x_end: float, state: np.ndarray
) -> tuple[float, float, float, float]:
    """`lag_integrals` where |Üg| goes along a curve: Gauss-Legendre quadrature, panel by panel."""
    amplitude, mu_s, kept = block.amplitude, block.mu_s, block.mu_s - block.tan_theta
    decay = block.decay_rate / block.g
    rising = x_start <= x_end
    least = min(x_start, x_end)
    e_foldings = decay * abs(x_end - x_start)
    near, far = (start, end) if rising else (end, start)
    whole = start == pieces[p, BEGIN] and end == pieces[p, FINISH] and e_foldings <= PANEL_BOUNDS[0]
    first, second, first_x, second_x = 0.0, 0.0, 0.0, 0.0
    values = state[AT_NODES:STATE_SIZE]
    for bound in PANEL_BOUNDS:
        until = far
        if e_foldings > bound:
            until = offset_at(pieces, p, amplitude, math.copysign(least + bound / decay, pieces[p, TOP]))
        width = until - near
        if whole:
            known = pieces[p, pieces.shape[1] - NODES.size :]
            for node in range(NODES.size):
                values[node] = amplitude * known[node]
        else:
            at_nodes(pieces, p, amplitude, near, width, values)
        for node in range(NODES.size):
            x = values[node]
            mu = friction(block, x)
            weight = abs(width) * WEIGHTS[node]
            left = end - (near + width * NODES[node])
            lag, lag_x = weight * (mu_s - mu), weight * x * (kept - mu)
            first += lag
            second += left * lag
            first_x += lag_x
            second_x += left * lag_x
        near = until
        if e_foldings <= bound:
            break
    return first, second, first_x, second_x


@scalar
def lag_integrals(
    block: Block, pieces: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> tuple[float, float, float, float]:
    """What Eq. 4 takes the block behind the plane over a part of piece p.

    ∫ (μs − μ) dτ and ∫ |x| (μs − tan θ − μ) dτ, each followed by itself with the weight end − τ: on
    the side ±1 of Üg = 0 the relative acceleration is D = ±g (μs − μ) + tan θ |x| (μs − tan θ − μ).
    Apart, because over a symmetric cycle the first must cancel to the last digit.
    """
    amplitude = block.amplitude
    # most parts begin or end where the piece does
    x_start = amplitude * pieces[p, FIRST] if start == pieces[p, BEGIN] else plane(pieces, p, amplitude, start)
    x_end = amplitude * pieces[p, LAST] if end == pieces[p, FINISH] else plane(pieces, p, amplitude, end)
    x_start, x_end = abs(x_start), abs(x_end)
    if int(pieces[p, DEGREE]) <= 1:
        return straight_lag(block, x_start, x_end - x_start, end - start)
    return curved_lag(block, pieces, p, start, end, x_start, x_end, state)


@scalar
def eq4_integrals(
    block: Block, pieces: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> tuple[float, float]:
    """∫ D dτ and ∫ (end − τ) D dτ over a part of piece p: gains of V and W from rest."""
    first, second, first_x, second_x = lag_integrals(block, pieces, p, start, end, state)
    side_g = math.copysign(block.g, pieces[p, TOP])
    return side_g * first + block.tan_theta * first_x, side_g * second + block.tan_theta * second_x
