"""Eq. 4 along the straight pieces of a record, whose integrals are found side by side.

docs/numerics.md#straight-pieces
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import Block
from slipsweep.kernels.cycle.continuous import zeros_of_relative_acceleration
from slipsweep.kernels.cycle.eq4 import straight_gains, straight_lag
from slipsweep.kernels.cycle.legs import LAGS, Room
from slipsweep.kernels.excitation import plane
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, LAST, TOP, Wave


@scalar
def lay_out(
    block: Block, wave: Wave, p: int, tau: float, until: int, tau_until: float, q: int, count: int, rows: np.ndarray
) -> None:
    """Fill in |Üg| at the beginning of `count` pieces from q on, its change, their length, and the side of Üg = 0."""
    amplitude, pieces = block.amplitude, wave.pieces
    for j in range(count):
        i = q + j
        start, x = pieces[i, BEGIN], amplitude * pieces[i, FIRST]
        end, x_end = pieces[i, FINISH], amplitude * pieces[i, LAST]
        if i == p:
            start, x = tau, plane(pieces, i, amplitude, tau)
        if i == until:
            end, x_end = tau_until, plane(pieces, i, amplitude, tau_until)
        rows[j], rows[LAGS + j], rows[2 * LAGS + j] = abs(x), abs(x_end) - abs(x), end - start
        rows[3 * LAGS + j] = math.copysign(1.0, pieces[i, TOP])


@scalar
def gain_up_to(block: Block, zero: float, x: float, change: float, width: float, side: float) -> float:
    """The gain of V on a piece up to |Üg| = zero."""
    part = (zero - x) / change
    first, _, first_x, _ = straight_lag(block, x, part * change, part * width)
    return side * block.g * first + block.tan_theta * first_x


@scalar
def follow_straight(
    block: Block, wave: Wave, p: int, tau: float, until: int, tau_until: float, wants_peak: bool, room: Room
) -> tuple[float, float, float]:
    """Eq. 4 from rest, τ on piece p, to `tau_until` on piece `until`: gains of V and W, the largest V."""
    up, down, rows = 0, 0, room.straight
    if wants_peak:
        up = zeros_of_relative_acceleration(block, block.amplitude * wave.highest, room.crossings[0])
        down = zeros_of_relative_acceleration(block, block.amplitude * wave.lowest, room.crossings[1])
        if min(up, down) < 0:
            return math.nan, math.nan, math.nan
    velocity, displacement, peak = 0.0, 0.0, 0.0
    last = min(until + 1, wave.pieces.shape[0])
    for q in range(p, last, LAGS):
        count = min(LAGS, last - q)
        lay_out(block, wave, p, tau, until, tau_until, q, count, rows)
        straight_gains(block, rows)
        for j in range(count):
            x, change, width = rows[j], rows[LAGS + j], rows[2 * LAGS + j]
            if not width > 0.0:
                continue
            above, n = (0, up) if rows[3 * LAGS + j] > 0.0 else (1, down)
            for i in range(n):
                zero = abs(room.crossings[above, i])
                if min(x, x + change) < zero < max(x, x + change):
                    peak = max(peak, velocity + gain_up_to(block, zero, x, change, width, rows[3 * LAGS + j]))
            displacement += velocity * width + rows[5 * LAGS + j]
            velocity += rows[4 * LAGS + j]
            peak = max(peak, velocity)
    return velocity, displacement, peak
