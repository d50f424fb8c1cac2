"""The cycle solver for the sine: the common kinds of motion in SIMD lanes.

The cells of a tile are sorted by the kind of their motion; those of one kind are laid out side by side and
solved together (`pulses`, `continuous`), in loops that LLVM turns into SIMD: Newton with a fixed
number of iterations, quadrature nodes outside, cells inside.  A cell whose iteration has not converged, or that is of
another kind, is left to `cycle`, which solves any waveform; in continuous sliding it is solved here, by
symmetry from one quarter of the cycle.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.jit.elementary import rising_phase
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    DECAY,
    DELTA_MU,
    INTEGRATE,
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
    lane_response,
    settled_in_cycles,
    whole_lanes,
)
from slipsweep.kernels.block import YIELD_GOVERNS as YIELD_GOVERNS_FLAG
from slipsweep.kernels.continuous import SHORT_SINE, continuous, lane_continuous
from slipsweep.kernels.cycle import solver_of
from slipsweep.kernels.lanes import (
    CODE,
    CONVERGED,
    FOLLOWS_EQ4,
    LANE_E_FOLDINGS,
    LANES_SIZE,
    OTHER,
    PEAK,
    SLIDES_ON,
    STAYS,
    STICKS,
    YIELD_GOVERNS,
    W,
)
from slipsweep.kernels.pulses import lane_attenuation, lane_carried, lane_fall, lane_onset, lane_recoupling, lane_rise
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK

#: Rows of a tile's blocks beside the lanes': the codes, the kind of its motion, μmin, and E at Üg = Üy and at the peak.
_MODE, _VALIDITY, _KIND, _LEAST_FRICTION, _AT_START, _AT_END = range(LANE_ROWS * TILE, (LANE_ROWS + 6) * TILE, TILE)
BLOCKS_SIZE = (LANE_ROWS + 6) * TILE


class Room(NamedTuple):
    """Where the cells of a tile are worked on.

    One for all tiles: a function that makes no array need not count references to any, a nanosecond a cell.
    `runs` has the cells at which runs of one kind start, `where` the cells of the lanes, and `remaining` is
    true for cells that are to go from event to event.
    """

    blocks: np.ndarray
    lanes: np.ndarray
    runs: np.ndarray
    where: np.ndarray
    remaining: np.ndarray


def room_of() -> Room:
    """Room for a tile."""
    return Room(
        np.empty(BLOCKS_SIZE), np.empty(LANES_SIZE), np.empty(TILE + 1, np.int64), np.empty(TILE, np.int64),
        np.empty(TILE, np.bool_),
    )  # fmt: skip


@in_lanes
def kind_of(blocks: np.ndarray, j: int, options: Options) -> int:
    """The kind of a cell's motion (docs/numerics.md#lanes-of-the-sine)."""
    at_start, at_end, mode = blocks[_AT_START + j], blocks[_AT_END + j], blocks[_MODE + j]
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
    # where the peak velocity is wanted, D has to be concave (`lane_turn`)
    early = gentle & (start <= SHORT_SINE * end) & (convex | (not options.wants_peak))
    kind = SLIDES_ON if (mode == CONTINUOUS) & early else kind
    return kind if mode > STUCK else STAYS


@scalar
def fill_carried(count: int, lanes: np.ndarray, where: np.ndarray) -> int:
    """Bring the lanes that stick at Üg = Üy and do not recouple to the front; the number of them."""
    used = 0
    for lane in range(count):
        if lanes[CONVERGED + lane] < 0.0:
            where[used] = where[lane]
            for row in range(0, LANES_SIZE, TILE):
                lanes[row + used] = lanes[row + lane]
            used += 1
    fill_up(used, LANES_SIZE // TILE, lanes)
    return used


@scalar
def solve_strip(kind: int, options: Options, lanes: np.ndarray) -> None:
    """Lanes of one kind, from the onset to the end of all cycles."""
    if kind == SLIDES_ON:
        lane_continuous(options, lanes)
        return
    lane_onset(kind, options.g, lanes)
    lane_rise(kind, options.g, lanes)
    lane_fall(options.wants_peak, lanes)
    if options.recoupling == INTEGRATE:
        lane_recoupling(options.cycles, lanes)
    else:
        lane_attenuation(kind, options.cycles, lanes)


@scalar
def sort_strip(cells: np.ndarray, options: Options, blocks: np.ndarray) -> None:
    """Blocks of a strip of a tile in lanes, with their codes and the kind of each.

    Neighbours are mostly alike, and what none of them needs is left out: λ and t1 of those that stay,
    E of those that do not stick and slip (7 against 9 ns a cell of a design chart).
    """
    g, slides, sticks, newmark = options.g, 0, 0, options.rise == NEWMARK
    for j in range(STRIP if newmark else 0):
        # with the constant, LLVM leaves out what Newmark's block has no need of (a fifth of its time)
        cell = cell_of(cells, j)
        yield_acceleration, _, _, _, _, mode, validity = interface_of(cell, NEWMARK, g)
        blocks[AMPLITUDE + j], blocks[YIELD + j] = cell.amplitude, yield_acceleration
        blocks[_MODE + j], blocks[_VALIDITY + j] = mode, validity
        blocks[_KIND + j] = STAYS
        slides += 1 if mode > STUCK else 0
    for j in range(0 if newmark else STRIP):
        cell = cell_of(cells, j)
        yield_acceleration, _, _, minimum_friction, delta_mu, mode, validity = interface_of(cell, options.rise, g)
        blocks[AMPLITUDE + j], blocks[YIELD + j] = cell.amplitude, yield_acceleration
        blocks[MU_S + j], blocks[TAN_THETA + j] = cell.mu_s, cell.tan_theta
        blocks[DELTA_MU + j], blocks[_LEAST_FRICTION + j] = delta_mu, minimum_friction
        blocks[_MODE + j], blocks[_VALIDITY + j] = mode, validity
        blocks[_KIND + j] = STAYS
        slides += 1 if mode > STUCK else 0
        sticks += 1 if mode == STICK_SLIP else 0
    if slides == 0:
        return
    for j in range(0 if newmark else STRIP):
        least = blocks[_LEAST_FRICTION + j]
        blocks[DECAY + j] = decay_rate_of(cell_of(cells, j), blocks[DELTA_MU + j], least, g) / g
    for j in range(STRIP):
        blocks[BEGAN + j] = rising_phase(blocks[YIELD + j], blocks[AMPLITUDE + j])
    if sticks > 0:
        for j in range(STRIP):
            blocks[_AT_START + j] = lane_response(blocks, j, blocks[YIELD + j], g)
            blocks[_AT_END + j] = lane_response(blocks, j, blocks[AMPLITUDE + j], g)
    for j in range(STRIP):
        blocks[_KIND + j] = kind_of(blocks, j, options)


@scalar
def sort_cells(cells: np.ndarray, count: int, options: Options, blocks: np.ndarray) -> None:
    """`sort_strip` for a tile."""
    for first in range(0, count, STRIP):
        sort_strip(cells[first:], options, blocks[first:])


@scalar
def runs_of(blocks: np.ndarray, count: int, runs: np.ndarray) -> int:
    """Where runs of cells of one kind start (and the last ends); the number of them.

    Along an axis of a sweep neighbours are mostly of one kind: cells are laid out and collected
    run by run.
    """
    runs[0], found = 0, 1
    for first in range(1, count, STRIP):
        size = min(STRIP, count - first)
        before, after = blocks[_KIND + first - 1 :], blocks[_KIND + first :]
        changes = 0
        for j in range(size):
            changes += 1 if after[j] != before[j] else 0
        for j in range(size if changes > 0 else 0):
            if after[j] != before[j]:
                runs[found] = first + j
                found += 1
    runs[found] = count
    return found


@scalar
def fill_lanes(blocks: np.ndarray, first: int, last: int, used: int, lanes: np.ndarray) -> int:
    """Lay out a run of blocks behind the `used` lanes; the number of lanes with them."""
    if last - first < 8:  # a loop for each row would cost more than it does
        for j in range(first, last):
            for row in range(0, LANE_ROWS * TILE, TILE):
                lanes[row + used + j - first] = blocks[row + j]
    else:
        for row in range(0, LANE_ROWS * TILE, TILE):
            source, target = blocks[row + first : row + last], lanes[row + used : row + TILE]
            for j in range(source.size):
                target[j] = source[j]
    return used + last - first


@scalar
def fill_up(used: int, rows: int, lanes: np.ndarray) -> None:
    """Repeat the first lane up to the next whole number of strips."""
    for row in range(0, rows * TILE, TILE):
        for lane in range(used, whole_lanes(used)):
            lanes[row + lane] = lanes[row]


@in_lanes
def store_lane(
    lanes: np.ndarray, lane: int, kind: int, options: Options, blocks: np.ndarray, motion: np.ndarray,
    codes: np.ndarray, j: int,
) -> None:  # fmt: skip
    """Store the result of a lane that has converged as that of cell j; else the cell remains to be solved."""
    solved = lanes[CONVERGED + lane] > 0.0
    flags = int(lanes[CODE + lane]) | (YIELD_GOVERNS_FLAG if (kind == YIELD_GOVERNS) & (options.rise != NEWMARK) else 0)
    motion[0, j] = lanes[W + lane]
    if options.wants_peak:
        motion[1, j] = lanes[PEAK + lane]
    codes[1, j] = settled_in_cycles(codes[1, j] | flags, lanes[W + lane]) if solved else codes[1, j]
    blocks[_KIND + j] = kind if solved else OTHER


@scalar
def solve_kind(kind: int, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray) -> None:
    """Solve the cells of a tile, which has `count` runs, that are of one kind."""
    blocks, lanes, runs, where = room.blocks, room.lanes, room.runs, room.where
    used = 0
    for run in range(count):
        if blocks[_KIND + runs[run]] == kind:
            used = fill_lanes(blocks, runs[run], runs[run + 1], used, lanes)
    if used == 0:
        return
    fill_up(used, LANE_ROWS, lanes)
    for first in range(0, used, STRIP):
        solve_strip(kind, options, lanes[first:])
    lane = 0
    for run in range(count):
        first, last = runs[run], runs[run + 1]
        if blocks[_KIND + first] == kind:
            # by slices, which numba knows to begin at 0: then this is a loop in SIMD
            found, cells, moved, coded = lanes[lane:], blocks[first:], motion[:, first:last], codes[:, first:last]
            for j in range(last - first):
                store_lane(found, j, kind, options, cells, moved, coded, j)
            if kind == STICKS:
                for j in range(last - first):
                    where[lane + j] = first + j
            lane += last - first
    if kind == STICKS:
        used = fill_carried(used, lanes, where)
        for first in range(0, used, STRIP):
            lane_carried(min(used - first, STRIP), options, lanes[first:])
        for lane in range(used):
            store_lane(lanes, lane, kind, options, blocks, motion, codes, where[lane])


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> int:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity.

    Those that are to go from event to event, as any waveform does, are marked in `room.remaining`; their number.
    """
    blocks = room.blocks
    fill_up(count, 7, cells)
    sort_cells(cells, whole_lanes(count), options, blocks)
    for j in range(count):
        codes[0, j], codes[1, j] = int(blocks[_MODE + j]), int(blocks[_VALIDITY + j])
        motion[0, j] = motion[1, j] = 0.0 if blocks[_MODE + j] == STUCK else math.nan
    number = runs_of(blocks, count, room.runs)
    for kind in (YIELD_GOVERNS, FOLLOWS_EQ4, STICKS, SLIDES_ON):
        solve_kind(kind, number, options, room, motion, codes)
    remaining = 0
    for j in range(count):
        room.remaining[j] = blocks[_KIND + j] == OTHER
        remaining += 1 if room.remaining[j] else 0
    return remaining


#: Solves the cells that are left: in continuous sliding by quarters of the sine's cycle, else as of any wave.
solve_remaining = solver_of(continuous)
