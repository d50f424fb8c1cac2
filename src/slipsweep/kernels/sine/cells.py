"""The cells of a tile: those of one kind side by side in lanes, and what solves those that remain.

`cells` is (7 TILE,), `motion` and `codes` are (2, TILE), as in `slipsweep.kernels.grid.Tile`.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    INTEGRATE,
    LANE_ROWS,
    NEWMARK,
    STRIP,
    TILE,
    Options,
    fill_up,
    settled_in_cycles,
    whole_lanes,
)
from slipsweep.kernels.block import YIELD_GOVERNS as YIELD_GOVERNS_FLAG
from slipsweep.kernels.cycle.cells import solver_of
from slipsweep.kernels.sine.carried import lane_carried
from slipsweep.kernels.sine.continuous import continuous, lane_continuous
from slipsweep.kernels.sine.cycles import lane_attenuation, lane_recoupling
from slipsweep.kernels.sine.lanes import (
    CODE,
    CONVERGED,
    FOLLOWS_EQ4,
    LANES_SIZE,
    OTHER,
    PEAK,
    RESTS,
    SLIDES_ON,
    STICKS,
    TURNS_LATE,
    YIELD_GOVERNS,
    W,
)
from slipsweep.kernels.sine.pulse import lane_fall, lane_onset, lane_rise
from slipsweep.kernels.sine.shapes import SINE, SQUARE, TRIANGLE
from slipsweep.kernels.sine.sorting import BLOCKS_SIZE, KIND, MODE, VALIDITY, runs_of, sort_strip
from slipsweep.model.equations import STUCK

#: What solves the cells of a tile; how many remain.
Solver = Callable[[np.ndarray, int, Options, "Room", np.ndarray, np.ndarray], int]


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


def strip_of(shape: int) -> Callable[[int, Options, np.ndarray], None]:
    """The jitted solver of a strip under a wave of a shape (`shapes`) that begins at Üg = 0."""

    @scalar
    def solve_strip(kind: int, options: Options, lanes: np.ndarray) -> None:
        """Lanes of one kind, from the onset to the end of all cycles."""
        if kind >= SLIDES_ON:  # or TURNS_LATE
            lane_continuous(kind, shape, options, lanes)
            return
        lane_onset(kind, shape, options.g, lanes)
        lane_rise(kind, shape, options.g, lanes)
        lane_fall(shape, options.wants_peak, lanes)
        if options.recoupling == INTEGRATE:
            lane_recoupling(shape, options.cycles, lanes)
        else:
            lane_attenuation(kind, options.cycles, lanes)

    return solve_strip


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


@in_lanes
def store_lane(
    lanes: np.ndarray, lane: int, kind: int, options: Options, blocks: np.ndarray, moved: np.ndarray,
    peak: np.ndarray, validity: np.ndarray, j: int,
) -> None:  # fmt: skip
    """Store the result of a lane that has converged as that of cell j; else the cell remains to be solved."""
    solved = lanes[CONVERGED + lane] > 0.0
    governs = (kind == YIELD_GOVERNS) & (options.rise != NEWMARK)
    flags = int(lanes[CODE + lane]) | (YIELD_GOVERNS_FLAG if governs else 0)
    moved[j] = lanes[W + lane]
    if options.wants_peak:
        peak[j] = lanes[PEAK + lane]
    validity[j] = settled_in_cycles(validity[j] | flags, lanes[W + lane]) if solved else validity[j]
    blocks[KIND + j] = kind if solved else OTHER


def carry_of(
    go_on: Callable[[int, int, Options, np.ndarray], None],
) -> Callable[[int, int, Options, Room, np.ndarray, np.ndarray], None]:
    """The jitted way on for lanes in motion; `go_on` is given the shape, how many they are, options and lanes."""

    @scalar
    def carry(shape: int, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray) -> None:
        """Bring those of `count` lanes that stick at Üg = Üy and do not recouple to the front, and go on with them."""
        lanes, where = room.lanes, room.where
        used = 0
        for lane in range(count):
            if lanes[CONVERGED + lane] < 0.0:
                where[used] = where[lane]
                for row in range(0, LANES_SIZE, TILE):
                    lanes[row + used] = lanes[row + lane]
                used += 1
        fill_up(used, LANES_SIZE // TILE, lanes)
        for first in range(0, used, STRIP):
            go_on(shape, min(used - first, STRIP), options, lanes[first:])
        for lane in range(used):
            store_lane(lanes, lane, STICKS, options, room.blocks, motion[0], motion[1], codes[1], where[lane])

    return carry


@scalar
def leave(shape: int, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray) -> None:
    """Leave lanes in motion to go from event to event."""


def lanes_of(
    shape: int,
    solve_strip: Callable[[int, Options, np.ndarray], None],
    carry: Callable[[int, int, Options, Room, np.ndarray, np.ndarray], None],
) -> Solver:
    """The jitted solver of a tile's cells in lanes under a shape of wave.

    Given what solves a strip, and what goes on with lanes in motion.
    """

    @scalar
    def solve_kind(kind: int, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray) -> None:
        """Solve the cells of a tile, which has `count` runs, that are of one kind."""
        blocks, lanes, runs, where = room.blocks, room.lanes, room.runs, room.where
        moved, peak, validity = motion[0], motion[1], codes[1]
        used = 0
        for run in range(count):
            if blocks[KIND + runs[run]] == kind:
                used = fill_lanes(blocks, runs[run], runs[run + 1], used, lanes)
        if used == 0:
            return
        fill_up(used, LANE_ROWS, lanes)
        for first in range(0, used, STRIP):
            solve_strip(kind, options, lanes[first:])
        lane = 0
        for run in range(count):
            first, last = runs[run], runs[run + 1]
            if blocks[KIND + first] == kind:
                # by slices, which numba knows to begin at 0: then this is a loop in SIMD
                found, cells, w, v, flags = lanes[lane:], blocks[first:], moved[first:], peak[first:], validity[first:]
                for j in range(last - first):
                    store_lane(found, j, kind, options, cells, w, v, flags, j)
                if kind == STICKS:
                    for j in range(last - first):
                        where[lane + j] = first + j
                lane += last - first
        if kind == STICKS:
            carry(shape, used, options, room, motion, codes)

    @scalar
    def solve_cells(
        cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
    ) -> int:
        """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity.

        Those that are to go from event to event, as any waveform does, are marked in `room.remaining`; their number.
        """
        blocks = room.blocks
        fill_up(count, 7, cells)
        for first in range(0, whole_lanes(count), STRIP):
            sort_strip(shape, cells[first:], options, blocks[first:])
        for j in range(count):
            codes[0, j], codes[1, j] = int(blocks[MODE + j]), int(blocks[VALIDITY + j])
            motion[0, j] = motion[1, j] = 0.0 if blocks[MODE + j] == STUCK or blocks[KIND + j] == RESTS else math.nan
        number = runs_of(blocks, count, room.runs)
        for kind in (YIELD_GOVERNS, FOLLOWS_EQ4, STICKS, SLIDES_ON, TURNS_LATE):
            solve_kind(kind, number, options, room, motion, codes)
        remaining = 0
        for j in range(count):
            room.remaining[j] = blocks[KIND + j] == OTHER
            remaining += 1 if room.remaining[j] else 0
        return remaining

    return solve_cells


_carry = carry_of(lane_carried)
_solve_cells = lanes_of(SINE, strip_of(SINE), _carry)
_solve_under_triangle = lanes_of(TRIANGLE, strip_of(TRIANGLE), _carry)
_solve_under_square = lanes_of(SQUARE, strip_of(SQUARE), leave)


def solve_under_sine(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> int:
    """As any that `lanes_of` gives; to be handed to the kernel that brings cells."""
    return _solve_cells(cells, count, options, room, motion, codes)


def solve_under_triangle(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> int:
    """As `solve_under_sine`."""
    return _solve_under_triangle(cells, count, options, room, motion, codes)


def solve_under_square(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> int:
    """As `solve_under_sine`."""
    return _solve_under_square(cells, count, options, room, motion, codes)


#: Solves the cells that are left: in continuous sliding by quarters of the sine's cycle, else as of any wave.
solve_remaining = solver_of(continuous)
