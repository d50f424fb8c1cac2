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
from slipsweep.kernels.sine.continuous import SHORT_SINE, lane_turn_start
from slipsweep.kernels.sine.lanes import (
    FOLLOWS_EQ4,
    LANE_E_FOLDINGS,
    OTHER,
    RESTS,
    SLIDES_ON,
    STAYS,
    STICKS,
    TURNS_LATE,
    YIELD_GOVERNS,
)
from slipsweep.kernels.sine.shapes import SQUARE, phase_of
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK

#: Rows of a tile's blocks beside the lanes': the codes, the kind of its motion, μmin, and E at Üg = Üy and at the peak.
MODE, VALIDITY, KIND, _LEAST_FRICTION, _AT_START, _AT_END = range(LANE_ROWS * TILE, (LANE_ROWS + 6) * TILE, TILE)

BLOCKS_SIZE = (LANE_ROWS + 6) * TILE


@in_lanes
def kind_of(shape: int, blocks: np.ndarray, j: int, options: Options) -> int:
    """The kind of a cell's motion (docs/numerics.md#lanes-of-the-sine)."""
    at_start, at_end, mode = blocks[_AT_START + j], blocks[_AT_END + j], blocks[MODE + j]
    decay = blocks[DECAY + j]
    start, end = blocks[YIELD + j], blocks[AMPLITUDE + j]
    jumps = shape == SQUARE  # to the peak, and friction is of one value
    gentle = jumps | (decay * end <= LANE_E_FOLDINGS)
    sticks = at_start >= start
    # as D > 0 at the peak, it stays positive once it is: either E is convex from where sliding may begin, hence D
    # concave; or D, convex first, is negative at Üy or rises there, and dE/dx > 0, both by bounds with the largest
    # friction
    tan_theta, mu_s = blocks[TAN_THETA + j], blocks[MU_S + j]
    most = mu_s + blocks[DELTA_MU + j]
    least = start if mode == STICK_SLIP else 0.0
    bends = decay * (options.g + least * tan_theta)
    convex = bends >= 2.0 * tan_theta
    steepest = min(decay * (options.g + end * tan_theta) - tan_theta, tan_theta)
    rises = (mu_s if sticks else most) * steepest < eq.limit_denominator(mu_s, tan_theta)
    lags = sticks | (most * (tan_theta - bends) <= tan_theta * (mu_s - tan_theta))
    smooth = (options.rise == MONOTONE) & (at_end < end) & (jumps | convex | (rises & lags))
    sticks_or_follows = STICKS if sticks else FOLLOWS_EQ4
    kind = sticks_or_follows if gentle else OTHER
    kind = YIELD_GOVERNS if (not sticks) & (at_end <= start) else kind
    kind = kind if smooth else OTHER
    kind = YIELD_GOVERNS if options.rise == NEWMARK else kind
    kind = kind if mode == STICK_SLIP else OTHER
    # where the peak velocity is wanted, D has to be concave (`lane_turns`)
    early = gentle & (start <= SHORT_SINE * end) & (convex | (not options.wants_peak))
    late = options.wants_peak & (lane_turn_start(blocks, j) > 0.7 * SHORT_SINE * end)
    slides = TURNS_LATE if late else SLIDES_ON
    kind = slides if (mode == CONTINUOUS) & early else kind
    return kind if mode > STUCK else STAYS


@in_lanes
def rests(shape: int, blocks: np.ndarray, j: int, g: float) -> bool:
    """Whether Eq. 4 keeps a block with the plane up to the peak: D is nowhere above 0 from Üy on.

    D is convex, then concave: nowhere larger than at Üy or than its tangent at the peak.
    """
    start, peak = blocks[YIELD + j], blocks[AMPLITUDE + j]
    rate, slope = lane_rate_and_slope(blocks, j, peak, g)
    highest = rate if shape == SQUARE else rate - min(slope, 0.0) * (peak - start)
    stays = (shape == SQUARE) | (blocks[_AT_START + j] >= start)
    return (blocks[MODE + j] == STICK_SLIP) & stays & (highest <= 0.0)


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
        blocks[KIND + j] = kind_of(shape, blocks, j, options)
        lagging += 1 if (blocks[MODE + j] == STICK_SLIP) & (blocks[_AT_END + j] >= blocks[AMPLITUDE + j]) else 0
    if lagging > 0 and options.rise != NEWMARK:
        for j in range(STRIP):
            blocks[KIND + j] = RESTS if rests(shape, blocks, j, g) else blocks[KIND + j]


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
