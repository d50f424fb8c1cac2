"""Newmark's block under a record: blocks side by side in lanes, piece by piece.

Its one rule is that b = Üy from every Üg = Üy on to the stop.  A slide along straight pieces is a sum of three terms
a piece, the same for all lanes but for Üy; only where one of them begins, turns or stops is there more to do.
Cells of a tile are sorted by Üy, so that those of a strip begin and stop on the same pieces, or on pieces near each
other.
docs/numerics.md#newmarks-block-under-a-record
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import NEWMARK, STATICALLY_UNSTABLE, TILE, Options, block_of, cell_of
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, LAST, Wave

#: Blocks that are followed together.  More of them part more often: one begins or stops on another piece.
LANES = 16

#: Rows of the lanes: Üy over the scale; V and W of the slide on hand; W of all before, and what rounding has lost of
#: it; the largest V; slips and pulses; and whether it slides (1), is at rest (0), or stops on the piece on hand (−1).
_YIELD, _V, _W, _BEFORE, _LOST, _PEAK, _SLIPS, _PULSES, _SLIDES = range(0, 9 * LANES, LANES)
LANES_SIZE = 9 * LANES


#: Columns of the lines of a record: the first, the last and the larger value of a piece, and its length.
FIRST_VALUE, LAST_VALUE, LARGER_VALUE, LENGTH = range(4)


class Record(NamedTuple):
    """A record as the straight lines that it is, for loops over its pieces.

    `lines` (pieces, 4) has the columns above, `height` (stretches,) the peaks.  Values are in units of `unit`, a power
    of two near the largest: their squares are doubles.
    """

    lines: np.ndarray
    height: np.ndarray
    unit: float


class Room(NamedTuple):
    """Where the cells of a tile are worked on: Üy over the scale in units of the record, and the cells' order by it."""

    lanes: np.ndarray
    onsets: np.ndarray
    order: np.ndarray


def record_of(wave: Wave) -> Record:
    """The record of a wave, made once for all cells."""
    pieces, height = wave.pieces, wave.height
    unit = math.ldexp(1.0, math.frexp(max(wave.highest, -wave.lowest))[1])
    first, last = pieces[:, FIRST] / unit, pieces[:, LAST] / unit
    lines = np.column_stack([first, last, np.maximum(first, last), pieces[:, FINISH] - pieces[:, BEGIN]])
    return Record(lines, height / unit, unit)


def room_of() -> Room:
    """Room for a tile."""
    return Room(np.empty(LANES_SIZE), np.empty(TILE), np.empty(TILE, np.int64))


@in_lanes
def add(total: float, lost: float, term: float) -> tuple[float, float]:
    """A sum and what rounding has lost of it, with a term more: a record has up to a million of them."""
    now = total + term
    without = now - total
    rounded = (total - (now - without)) + (term - without)
    return now, lost + (rounded if math.isfinite(now) else 0.0)


@in_lanes
def moved_by(velocity: float, rate: float, rate_end: float, step: float) -> float:
    """W along a piece."""
    return (velocity + (rate / 3.0 + rate_end / 6.0) * step) * step


@scalar
def slide_above(lanes: np.ndarray, first: float, last: float, step: float) -> None:
    """Along a piece at or above every Üy, on which all lanes slide."""
    for j in range(LANES):
        rate, rate_end = first - lanes[_YIELD + j], last - lanes[_YIELD + j]
        lanes[_W + j] += moved_by(lanes[_V + j], rate, rate_end, step)
        lanes[_V + j] += 0.5 * (rate + rate_end) * step


@scalar
def note_crests(lanes: np.ndarray, first: float, last: float, step: float) -> None:
    """The largest V of lanes whose Üy the plane falls through on a piece."""
    for j in range(LANES):
        rate, rate_end = first - lanes[_YIELD + j], last - lanes[_YIELD + j]
        crest = lanes[_V + j] + 0.5 * rate * (rate / (rate - rate_end)) * step
        higher = (lanes[_SLIDES + j] > 0.0) & (rate >= 0.0) & (rate_end < 0.0) & (crest > lanes[_PEAK + j])
        lanes[_PEAK + j] = crest if higher else lanes[_PEAK + j]


@scalar
def slide(lanes: np.ndarray, first: float, last: float, step: float) -> int:
    """Along a piece, but for lanes that stop on it; their number."""
    stopping = 0
    slope = (last - first) / step
    for j in range(LANES):
        rate, rate_end = first - lanes[_YIELD + j], last - lanes[_YIELD + j]
        velocity = lanes[_V + j]
        after = velocity + 0.5 * (rate + rate_end) * step
        # V falls to zero at the end of the piece, or before it turns up again
        slides = lanes[_SLIDES + j] > 0.0
        turns = (rate < 0.0) & (rate * rate >= 2.0 * slope * velocity)
        stops = slides & (turns if rate_end >= 0.0 else after <= 0.0)
        moved = lanes[_W + j] + moved_by(velocity, rate, rate_end, step)
        goes = slides & (not stops)
        lanes[_W + j] = moved if goes else lanes[_W + j]
        lanes[_V + j] = after if goes else velocity
        lanes[_SLIDES + j] = -1.0 if stops else lanes[_SLIDES + j]
        stopping += 1 if stops else 0
    return stopping


@scalar
def stop(lanes: np.ndarray, first: float, last: float, step: float) -> None:
    """Stop the lanes that do so on a piece."""
    slope = (last - first) / step
    for j in range(LANES):
        rate, velocity = first - lanes[_YIELD + j], lanes[_V + j]
        stops = lanes[_SLIDES + j] < 0.0
        # `linear.held_stop`; that the square is not negative is known, but for rounding
        root = math.sqrt(max(rate * rate - 2.0 * slope * velocity, 0.0))
        duration = (rate + root) / -slope if rate > 0.0 else 2.0 * velocity / (root - rate)
        duration = min(duration, step)
        moved = lanes[_W + j] + (velocity + (0.5 * rate + slope * duration / 6.0) * duration) * duration
        before, lost = add(lanes[_BEFORE + j], lanes[_LOST + j], moved)
        lanes[_BEFORE + j] = before if stops else lanes[_BEFORE + j]
        lanes[_LOST + j] = lost if stops else lanes[_LOST + j]
        lanes[_V + j] = 0.0 if stops else velocity
        lanes[_W + j] = 0.0 if stops else lanes[_W + j]
        lanes[_SLIDES + j] = 0.0 if stops else lanes[_SLIDES + j]


@scalar
def begin(lanes: np.ndarray, first: float, last: float, step: float) -> None:
    """Begin to slide where the plane rises through Üy on a piece; its beginning and end need not differ in time."""
    for j in range(LANES):
        rate, rate_end = first - lanes[_YIELD + j], last - lanes[_YIELD + j]
        rising = step * (rate_end / (rate_end - rate))
        begins = (lanes[_SLIDES + j] == 0.0) & (rate <= 0.0) & (rate_end > 0.0)
        lanes[_V + j] = 0.5 * rate_end * rising if begins else lanes[_V + j]
        lanes[_W + j] = rate_end * rising * rising / 6.0 if begins else lanes[_W + j]
        lanes[_SLIPS + j] += 1.0 if begins else 0.0
        lanes[_SLIDES + j] = 1.0 if begins else lanes[_SLIDES + j]


@scalar
def sliding(lanes: np.ndarray) -> int:
    """The number of lanes that slide."""
    count = 0
    for j in range(LANES):
        count += 1 if lanes[_SLIDES + j] > 0.0 else 0
    return count


@scalar
def along(lanes: np.ndarray, least: float, most: float, first: float, last: float, step: float, count: int) -> int:
    """All lanes along a piece, `count` of which slide, with Üy from `least` to `most`; how many slide at its end."""
    if count == LANES and first >= most and last >= most:
        slide_above(lanes, first, last, step)
        return count
    if count > 0:
        if first >= least and last < most:
            note_crests(lanes, first, last, step)
        if slide(lanes, first, last, step) > 0:
            stop(lanes, first, last, step)
            count = sliding(lanes)
    if first <= most and last > least:
        begin(lanes, first, last, step)
        count = sliding(lanes)
    return count


@scalar
def walk(wave: Wave, record: Record, lanes: np.ndarray, least: float, most: float) -> None:
    """Follow lanes through the record; from where all are at rest to the next pulse above the `least` Üy at once."""
    lines = record.lines
    pieces, stretches, p, k, count = lines.shape[0], record.height.size, 0, 0, 0
    if pieces > 0 and lines[0, FIRST_VALUE] > least:
        begin(lanes, 0.0, lines[0, FIRST_VALUE], 0.0)
        count = sliding(lanes)
    while True:
        if count == 0:
            while k < stretches and (wave.stretch[k, 1] <= p or record.height[k] <= least):
                k += 1
            if k == stretches:
                return
            p = max(p, wave.stretch[k, 0])
            while p < wave.stretch[k, 1] and lines[p, LARGER_VALUE] <= least:
                p += 1
            if p == wave.stretch[k, 1]:
                continue
        elif p == pieces:
            return
        count = along(lanes, least, most, lines[p, FIRST_VALUE], lines[p, LAST_VALUE], lines[p, LENGTH], count)
        p += 1


@scalar
def lay_out(cells: np.ndarray, count: int, options: Options, unit: float, room: Room, codes: np.ndarray) -> None:
    """Find Üy over the scale and the validity of the cells of a tile, and their order by the former (Shell's sort)."""
    onsets, order = room.onsets, room.order
    for j in range(count):
        block = block_of(cell_of(cells, j), NEWMARK, options.g)
        codes[3, j] = block.validity & STATICALLY_UNSTABLE
        # one that slides by itself has no motion to follow
        onsets[j] = math.inf if codes[3, j] else block.yield_acceleration / block.amplitude / unit
        order[j] = j
    for gap in (301, 132, 57, 23, 10, 4, 1):
        for j in range(gap, count):
            own, at = order[j], j
            while at >= gap and onsets[order[at - gap]] > onsets[own]:
                order[at] = order[at - gap]
                at -= gap
            order[at] = own


@scalar
def solve_strip(wave: Wave, record: Record, room: Room, first: int, count: int) -> None:
    """Follow `count` cells, from the one at place `first` of their order on, in as many lanes or more."""
    lanes, height = room.lanes, record.height
    for row in range(LANES_SIZE):
        lanes[row] = 0.0
    for j in range(LANES):
        lanes[_YIELD + j] = room.onsets[room.order[first + min(j, count - 1)]]
    least, most = lanes[_YIELD], lanes[_YIELD + LANES - 1]
    for k in range(height.size):
        for j in range(LANES if height[k] > least else 0):
            lanes[_PULSES + j] += 1.0 if height[k] > lanes[_YIELD + j] else 0.0
    walk(wave, record, lanes, least, most)


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, wave: Wave, record: Record, room: Room, motion: np.ndarray,
    codes: np.ndarray,
) -> None:  # fmt: skip
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and the codes of `record.respond`."""
    lanes, order, onsets = room.lanes, room.order, room.onsets
    lay_out(cells, count, options, record.unit, room, codes)
    for first in range(0, count, LANES):
        solve_strip(wave, record, room, first, min(LANES, count - first))
        for lane in range(min(LANES, count - first)):
            j, velocity = order[first + lane], lanes[_V + lane]
            scale, none = cell_of(cells, j).amplitude * record.unit, codes[3, j] != 0
            # the record may have ended before the slide: then the plane is at rest
            moved = lanes[_W + lane] + eq.attenuated_displacement(velocity, onsets[j], math.inf)
            total, lost = add(lanes[_BEFORE + lane], lanes[_LOST + lane], moved)
            motion[0, j] = math.nan if none else scale * (total + lost)
            motion[1, j] = math.nan if none else scale * max(lanes[_PEAK + lane], velocity)
            codes[0, j] = -1 if none else int(lanes[_SLIPS + lane])
            codes[1, j] = -1 if none else int(lanes[_PULSES + lane])
            codes[2, j] = -1 if none else 0
