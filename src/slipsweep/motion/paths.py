"""The path of the base that the exact walk of the law goes through: one form for waves and records.

Kernels are compiled for the types of their arguments.  The pieces of a wave (`motion.pieces`) have
coefficients of 22 powers, those of a record of one: two types.  In a path the pieces of both are of
one type, and the coefficients of the curved ones stand apart.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from slipsweep.motion.pieces import NODES, Wave

#: Terms of the Taylor series of a smooth piece about its anchor: the first one beyond is 1.3e-18
#: (docs/numerics.md#pieces-of-a-wave).
TERMS = 22

#: A piece of a path, and the coefficients of a curved one: records of the dtypes below.
Piece: TypeAlias = Any
Curve: TypeAlias = Any

PIECE = np.dtype(
    (
        np.record,
        np.dtype(
            [
                # phases of the motion, and the same as τ: one of `begin` and `finish` is 0
                ("start", np.float64),
                ("end", np.float64),
                ("begin", np.float64),
                ("finish", np.float64),
                # w at the beginning, the end and the anchor, and dw/dτ there
                ("first", np.float64),
                ("last", np.float64),
                ("top", np.float64),
                ("slope", np.float64),
                # 0: a plateau, 1: a straight line
                ("degree", np.int64),
                # its number, and that of its curve
                ("number", np.int64),
                ("curve", np.int64),
                # the last piece of the rise that it belongs to, which goes on without a jump
                ("rise_end", np.int64),
                # w jumps up at its beginning; it is a quarter of a sine about its peak
                ("jumps", np.bool_),
                ("arc", np.bool_),
                # w > 0 jumps up at its beginning, stays there, or rises after a fall
                ("resets_held", np.bool_),
            ],
            align=True,
        ),
    )
)

CURVE = np.dtype(
    (
        np.record,
        [
            ("coefficients", np.float64, (TERMS,)),
            # of the first and second integral from the anchor, of τ² and τ³ on
            ("once", np.float64, (TERMS,)),
            ("twice", np.float64, (TERMS,)),
            # of the whole piece: |w| at the nodes of a quadrature from its lower end on, and
            # ∫ (w − top) dτ and ∫ (finish − τ)(w − top) dτ
            ("nodes", np.float64, (NODES.size,)),
            ("whole_once", np.float64),
            ("whole_twice", np.float64),
        ],
    )
)

#: A cycle: its first piece, and a number that it shares with cycles of the same pieces.
CYCLE = np.dtype((np.record, [("first", np.int64), ("shape", np.int64)]))

#: A run of pieces with w > 0: the first of them, the first after them, the first after the negative
#: half wave that follows at once (a sample of 0 within it does not end it), and the largest w.
INTERVAL = np.dtype(
    (
        np.record,
        [("first", np.int64), ("end", np.int64), ("next_end", np.int64), ("height", np.float64)],
    )
)


class Base(NamedTuple):
    """The motion of the base in the order of time."""

    pieces: np.ndarray  # of PIECE
    curves: np.ndarray  # of CURVE; one at least


class Path(NamedTuple):
    """The motion of the base, and what else the walk asks of it.

    As in `motion.pieces.Wave` one plain cycle stands for those alike.
    """

    base: Base
    intervals: np.ndarray  # of INTERVAL
    cycles: np.ndarray  # of CYCLE; the last one begins where the path ends
    rises: np.ndarray  # (ranges, 2) all w > 0 that a wave rises through, or jumps to
    highest: float  # w
    lowest: float
    lead: int
    repeats: int
    alike: int  # cycles after the plain one that are as it is, and followed by another such one
    last_alike: bool  # the last cycle is as those, but that none follows
    recorded: bool  # time stands in place of the phase, and each pulse has its own friction


def path_of(wave: Wave, recorded: bool) -> Path:
    """Return the path of a wave."""
    pieces = np.zeros(wave.pieces.size, PIECE)
    for name in ("start", "end", "begin", "finish", "first", "last", "top", "degree"):
        pieces[name] = wave.pieces[name]
    pieces["jumps"] = wave.pieces["jumps"]
    pieces["arc"] = wave.pieces["arc"]
    pieces["slope"] = wave.pieces["coefficients"][:, 0]
    pieces["number"] = np.arange(pieces.size)
    pieces["rise_end"] = _ends_of_rises(wave.pieces)
    pieces["resets_held"] = _reset_held(wave.pieces)
    curved = np.flatnonzero(pieces["degree"] > 1)
    pieces["curve"][curved] = np.arange(curved.size)
    curves = np.zeros(max(curved.size, 1), CURVE)
    for name in ("coefficients", "once", "twice") if curved.size else ():
        curves[name] = wave.pieces[name][curved]
    _fill_whole(curves, wave.pieces[curved])
    intervals = np.zeros(wave.height.size, INTERVAL)
    intervals["first"] = wave.interval[:, 0]
    intervals["end"] = wave.interval[:, 1]
    above = np.append(np.flatnonzero(pieces["top"] >= 0.0), pieces.size)
    intervals["next_end"] = above[np.searchsorted(above, intervals["end"])]
    intervals["height"] = wave.height
    after = wave.shape[wave.lead :]
    alike = 0
    while alike + 2 < after.size and after[alike + 1] == after[alike + 2] == after[0]:
        alike += 1
    last_alike = after.size == alike + 2 and after[alike + 1] == after[0]
    cycles = np.zeros(wave.cycle.size, CYCLE)
    cycles["first"] = wave.cycle
    cycles["shape"][:-1] = wave.shape
    return Path(
        base=Base(pieces, curves),
        intervals=intervals,
        cycles=cycles,
        rises=np.empty((0, 2)) if recorded else _rises(wave.pieces),
        highest=wave.highest,
        lowest=wave.lowest,
        lead=wave.lead,
        repeats=wave.repeats,
        alike=alike,
        # an interval that runs over is cut off by the end of the shaking
        last_alike=bool(last_alike and wave.pieces["last"][-1] <= 0.0),
        recorded=recorded,
    )


def _fill_whole(curves: np.ndarray, pieces: np.ndarray) -> None:
    """Fill what is said of whole curved pieces."""
    for curve, piece in zip(curves, pieces, strict=False):
        powers = np.arange(1, TERMS + 1)
        begin = piece["begin"]
        finish = piece["finish"]
        lower, upper = (
            (begin, finish) if abs(piece["first"]) <= abs(piece["last"]) else (finish, begin)
        )
        tau = lower + (upper - lower) * NODES
        curve["nodes"] = np.abs(piece["top"] + tau[:, np.newaxis] ** powers @ curve["coefficients"])
        # one of the two ends is the anchor, where all these are 0
        curve["whole_once"] = curve["once"] @ (finish ** (powers + 1) - begin ** (powers + 1))
        moment = curve["twice"] @ (finish ** (powers + 2) - begin ** (powers + 2))
        before = curve["once"] @ begin ** (powers + 1)
        curve["whole_twice"] = moment - before * (finish - begin)


def _ends_of_rises(pieces: np.ndarray) -> np.ndarray:
    """Return the number of the last piece of the rise that each piece belongs to."""
    first = pieces["first"]
    last = pieces["last"]
    goes_on = (first < last)[:-1] & (last[:-1] == first[1:]) & (first < last)[1:]
    ends = np.append(np.flatnonzero(~goes_on), last.size - 1)
    last_pieces: np.ndarray = ends[np.searchsorted(ends, np.arange(last.size))]
    return last_pieces


def _reset_held(pieces: np.ndarray) -> np.ndarray:
    """Return where the base jumps up to w > 0, stays there, or rises after a fall."""
    first = pieces["first"]
    last = pieces["last"]
    fell = np.append(False, first[:-1] > last[:-1])
    stays = (first > 0.0) & (first == last)
    resets: np.ndarray = pieces["jumps"] | stays | (fell & (first > 0.0) & (first < last))
    return resets


def _rises(pieces: np.ndarray) -> np.ndarray:
    """Return the ranges of w > 0 that the base rises through, each as large as possible."""
    rising = (pieces["top"] > 0.0) & ((pieces["last"] >= pieces["first"]) | pieces["jumps"])
    if not rising.any():
        return np.empty((0, 2))
    falls = pieces["jumps"] & (pieces["last"] < pieces["first"])
    lows = np.where(falls, pieces["top"], pieces["first"])[rising]
    highs = pieces["top"][rising]
    order = np.argsort(lows)
    lows = lows[order]
    reached = np.maximum.accumulate(highs[order])
    parted = lows[1:] > reached[:-1]
    starts = lows[np.append(True, parted)]
    ends = reached[np.append(parted, True)]
    return np.column_stack([starts, ends])


def values_at(path: Path, phases: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return w at phases of the shaking, or at times of a record; at a jump the value after it."""
    pieces = path.base.pieces
    repeated = max(path.repeats - 1, 0)
    cycle = np.zeros(phases.size, np.int64)  # of the shaking; `row` is that of the path
    row = cycle
    if not path.recorded:
        cycles = path.cycles.size - 1 + repeated
        cycle = np.clip(np.floor(phases / (2.0 * np.pi)), 0, cycles - 1).astype(np.int64)
        row = np.where(cycle < path.lead, cycle, np.maximum(cycle - repeated, path.lead))
    inside = phases - 2.0 * np.pi * (cycle - row)
    p = np.searchsorted(pieces["start"], inside, side="right") - 1
    p = np.clip(p, path.cycles["first"][row], path.cycles["first"][row + 1] - 1)
    begin = pieces["begin"][p]
    tau = np.clip(begin + (inside - pieces["start"][p]), begin, pieces["finish"][p])
    offset = pieces["slope"][p] * tau
    curved = np.flatnonzero(pieces["degree"][p] > 1)
    if curved.size:
        offset[curved] = 0.0
        for coefficient in path.base.curves["coefficients"][pieces["curve"][p[curved]]].T[::-1]:
            offset[curved] = (offset[curved] + coefficient) * tau[curved]
    shaken = (pieces["start"][0] <= inside) & (inside < pieces["end"][-1])
    return np.where(shaken, pieces["top"][p] + offset, 0.0)
