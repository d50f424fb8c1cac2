"""Cells of a tile as blocks, sorted by the kind of their motion.

Blocks are a flat array, (BLOCKS_SIZE,), in which row + j is cell j.  docs/numerics.md#lanes-of-the-sine
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    DECAY,
    DELTA_MU,
    LANE_ROWS,
    MONOTONE,
    MU_S,
    NEWMARK,
    STRIP,
    TAN_THETA,
    TILE,
    YIELD,
    Options,
    cell_of,
    decay_rate_of,
    interface_of,
    lane_rate_and_slope,
    lane_response,
)
from slipsweep.kernels.sine.continuous import SHORT_SINE
from slipsweep.kernels.sine.lanes import (
    FOLLOWS_EQ4,
    LANE_E_FOLDINGS,
    OTHER,
    RESTS,
    SLIDES_ON,
    STAYS,
    STICKS,
    YIELD_GOVERNS,
)
from slipsweep.kernels.sine.shapes import SQUARE, phase_of
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK

#: Rows of a tile's blocks beside the lanes': the codes, the kind of its motion, μmin, and E at Üg = Üy and at the peak.
MODE, VALIDITY, KIND, _LEAST_FRICTION, _AT_START, _AT_END = range(LANE_ROWS * TILE, (LANE_ROWS + 6) * TILE, TILE)

BLOCKS_SIZE = (LANE_ROWS + 6) * TILE


@in_lanes
def kind_of(blocks: np.ndarray, j: int, options: Options) -> int:
    """The kind of a cell's motion (docs/numerics.md#lanes-of-the-sine)."""
    at_start, at_end, mode = blocks[_AT_START + j], blocks[_AT_END + j], blocks[MODE + j]
    decay = blocks[DECAY + j]
    start, end = blocks[YIELD + j], blocks[AMPLITUDE + j]
    gentle = decay * end <= LANE_E_FOLDINGS
    # as D > 0 at the peak, it stays positive once it is: either E is convex from where sliding may begin, hence D
    # concave; or dD/dx ≥ 0 at Üg = 0, so that D rises first and turns once at most, and dE/dx > 0, by a bound with
    # the largest friction and normal acceleration
    tan_theta, mu_s = blocks[TAN_THETA + j], blocks[MU_S + j]
    most = mu_s + blocks[DELTA_MU + j]
    least = start if mode == STICK_SLIP else 0.0
    convex = decay * (options.g + least * tan_theta) >= 2.0 * tan_theta
    rises = most * (decay * (options.g + end * tan_theta) - tan_theta) < eq.limit_denominator(mu_s, tan_theta)
    lags = most * (tan_theta - decay * options.g) <= tan_theta * (mu_s - tan_theta)
    smooth = (options.rise == MONOTONE) & (at_end < end) & (convex | (rises & lags))
    sticks_or_follows = STICKS if at_start >= start else FOLLOWS_EQ4
    kind = sticks_or_follows if gentle else OTHER
    kind = YIELD_GOVERNS if (at_start < start) & (at_end <= start) else kind
    kind = kind if smooth else OTHER
    kind = YIELD_GOVERNS if options.rise == NEWMARK else kind
    kind = kind if mode == STICK_SLIP else OTHER
    # where the peak velocity is wanted, D has to be concave (`lane_turns`)
    early = gentle & (start <= SHORT_SINE * end) & (convex | (not options.wants_peak))
    kind = SLIDES_ON if (mode == CONTINUOUS) & early else kind
    return kind if mode > STUCK else STAYS


@in_lanes
def rests(blocks: np.ndarray, j: int, g: float) -> bool:
    """Whether Eq. 4 keeps a block with the plane: D, concave from Üy on, stays below its tangent at the peak, and that
    below 0.
    """
    tan_theta, start, peak = blocks[TAN_THETA + j], blocks[YIELD + j], blocks[AMPLITUDE + j]
    rate, slope = lane_rate_and_slope(blocks, j, peak, g)
    convex = blocks[DECAY + j] * (g + start * tan_theta) >= 2.0 * tan_theta
    return (blocks[MODE + j] == STICK_SLIP) & convex & (rate - min(slope, 0.0) * (peak - start) <= 0.0)


@scalar
def sort_strip(shape: int, cells: np.ndarray, options: Options, blocks: np.ndarray) -> None:
    """Blocks of a strip of a tile in lanes, with their codes and the kind of each.

    Neighbours are mostly alike, and what none of them needs is left out: λ and t1 of those that stay,
    E of those that do not stick and slip (7 against 9 ns a cell of a design chart).
    """
    g, slides, sticks = options.g, 0, 0
    for j in range(STRIP):
        cell = cell_of(cells, j)
        yield_acceleration, _, _, minimum_friction, delta_mu, mode, validity = interface_of(cell, options.rise, g)
        blocks[AMPLITUDE + j], blocks[YIELD + j] = cell.amplitude, yield_acceleration
        blocks[MU_S + j], blocks[TAN_THETA + j] = cell.mu_s, cell.tan_theta
        blocks[DELTA_MU + j], blocks[_LEAST_FRICTION + j] = delta_mu, minimum_friction
        blocks[MODE + j], blocks[VALIDITY + j] = mode, validity
        blocks[KIND + j] = STAYS
        slides += 1 if mode > STUCK else 0
        sticks += 1 if mode == STICK_SLIP else 0
    if slides == 0:
        return
    for j in range(STRIP):
        least = blocks[_LEAST_FRICTION + j]
        blocks[DECAY + j] = decay_rate_of(cell_of(cells, j), blocks[DELTA_MU + j], least, g) / g
    for j in range(STRIP):
        blocks[BEGAN + j] = phase_of(shape, blocks[YIELD + j], blocks[AMPLITUDE + j])
    if sticks > 0:
        for j in range(STRIP):
            # the square jumps past Üy
            at_start = -math.inf if shape == SQUARE else lane_response(blocks, j, blocks[YIELD + j], g)
            blocks[_AT_START + j] = at_start
            blocks[_AT_END + j] = lane_response(blocks, j, blocks[AMPLITUDE + j], g)
    lagging = 0
    for j in range(STRIP):
        blocks[KIND + j] = kind_of(blocks, j, options)
        lagging += 1 if (blocks[MODE + j] == STICK_SLIP) & (blocks[_AT_END + j] >= blocks[AMPLITUDE + j]) else 0
    if lagging > 0 and options.rise != NEWMARK:
        for j in range(STRIP):
            blocks[KIND + j] = RESTS if rests(blocks, j, g) else blocks[KIND + j]


@scalar
def runs_of(blocks: np.ndarray, count: int, runs: np.ndarray) -> int:
    """Where runs of cells of one kind start (and the last ends); the number of them.

    Along an axis of a sweep neighbours are mostly of one kind: cells are laid out and collected
    run by run.
    """
    runs[0], found, kind = 0, 1, blocks[KIND]
    for j in range(1, count):
        if blocks[KIND + j] != kind:
            kind = blocks[KIND + j]
            runs[found] = j
            found += 1
    runs[found] = count
    return found
