"""The table of pieces that every motion of the base ends as: what a piece is, and how the table is put together.

`slipsweep.motion.cutting` cuts waveforms and records into pieces, `slipsweep.kernels.excitation` evaluates them.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: A piece: a record of the fields of `piece_type`.
Piece: TypeAlias = np.record

#: Gauss-Legendre nodes on [0, 1], two SIMD registers.
NODES, WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True))


def piece_type(terms: int) -> np.dtype[Any]:
    """The fields of a piece, τ counted from its anchor, that end of it where |w| is larger; w = top + c₁τ + c₂τ² + …

    `start` and `end` are phases of the motion, `begin` and `finish` the same as τ (one of the two is 0); `first`,
    `last` and `top` are w at the beginning, the end and the anchor.  The `degree` is 0 on a plateau and 1 on a straight
    line; a piece `jumps` if w jumps up at its beginning, and is an `arc` if it is a quarter of a sine about its peak,
    whose closed forms are shorter than its series.  `whole` and `whole_moment` are ∫ (w − top) dτ and
    ∫ (end − τ)(w − top) dτ over the piece; c₁, c₂, … are `coefficients`, and `once` and `twice` those of the sum's
    first and second integral from the anchor, of τ² and τ³ on.
    """
    numbers = ("start", "end", "begin", "finish", "first", "last", "top", "whole", "whole_moment")
    series = ("coefficients", "once", "twice")
    return np.dtype(
        (
            np.record,
            [(name, np.float64) for name in numbers]
            + [("degree", np.int64), ("jumps", np.bool_), ("arc", np.bool_)]
            + [(name, np.float64, (terms,)) for name in series],
        ),
        align=True,
    )


class Wave(NamedTuple):
    """Pieces of the shaking in the order of time, and what else the solvers ask of them.

    The table holds the first `lead` cycles, then one plain cycle that stands for `repeats` alike
    (none where `repeats` is 0), then the remaining ones; phases are counted as if the plain cycle
    came once.

    Attributes
    ----------
    pieces : record array, shape (pieces,)
        See `piece_type`.
    cycle : ndarray of int, shape (cycles in the table + 1,)
        First piece of every cycle.
    shape : ndarray of int, shape (cycles in the table,)
        Cycles of one number have the same pieces.
    interval : ndarray of int, shape (intervals, 2)
        Runs of pieces with w > 0: the first piece, and the first after it.
    height : ndarray, shape (intervals,)
        Largest w of each.
    same : ndarray of int, shape (intervals,)
        The first interval of the same pieces as each, those up to the interval after it among them.
    rises : ndarray, shape (ranges, 2)
        Ranges of w > 0 that are passed through, or jumped to, without falling; they do not overlap.
    highest, lowest : float
        Largest and least w.
    lead, repeats : int
        See above.
    """

    pieces: np.ndarray
    cycle: np.ndarray
    shape: np.ndarray
    interval: np.ndarray
    height: np.ndarray
    same: np.ndarray
    rises: np.ndarray
    highest: float
    lowest: float
    lead: int
    repeats: int


def pieces_of(
    start: NDArray[Any], end: NDArray[Any], length: NDArray[Any], first: NDArray[Any], last: NDArray[Any],
    at_end: NDArray[Any], coefficients: NDArray[Any], arc: NDArray[Any],
) -> np.ndarray:  # fmt: skip
    """The table of pieces, from the fields of these names.

    `length` is that of a piece, which the difference of its ends would round; `at_end` is whether |w| is larger
    at its end, its anchor then, and row i of `coefficients` are c₁, c₂, … of piece i from there.
    """
    degree = np.where(coefficients != 0.0, np.arange(1, coefficients.shape[1] + 1), 0).max(axis=1)
    power = np.arange(1, coefficients.shape[1] + 1)
    top = np.where(at_end, last, first)
    pieces = np.zeros(first.size, piece_type(power.size))
    pieces["start"], pieces["end"] = start, end
    pieces["begin"], pieces["finish"] = np.where(at_end, -length, 0.0), np.where(at_end, 0.0, length)
    pieces["first"], pieces["last"], pieces["top"] = first, last, top
    pieces["degree"] = degree
    pieces["jumps"] = first > np.maximum(np.concatenate([[0.0], last[:-1]]), 0.0)
    pieces["arc"] = arc & (np.abs(top) == 1.0) & (coefficients[:, 0] == 0.0)
    pieces["coefficients"] = coefficients
    pieces["once"] = coefficients / (power + 1)
    pieces["twice"] = coefficients / ((power + 1) * (power + 2))
    # one of the two ends is the anchor
    tau = np.where(at_end, -length, length)
    once, moment = np.zeros(first.size), np.zeros(first.size)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows here, overflows where it is used
        for k in range(int(degree.max()) - 1, -1, -1):
            once = (once + pieces["once"][:, k]) * tau
            moment = (moment + pieces["twice"][:, k]) * tau
        once, moment = once * tau, moment * tau * tau
        pieces["whole"] = np.where(at_end, -once, once)
        pieces["whole_moment"] = np.where(at_end, -moment - once * length, moment)
    return pieces


def wave_of_pieces(pieces: np.ndarray, cycle: ArrayLike, shape: ArrayLike, lead: int = 0, repeats: int = 0) -> Wave:
    """The wave of a table of pieces.

    Its intervals are runs of pieces above zero, one that touches zero ends; each is taken as different from all others,
    and `rises` are left out: what `same` and `rises` save is worth their computation where cycles repeat.
    """
    first, last = pieces["first"], pieces["last"]
    above = np.concatenate([[False], first + last > 0.0, [False]])
    touches = np.concatenate([[False], (last[:-1] == 0.0) & (first[1:] == 0.0), [False]])
    starts = np.flatnonzero(above[1:-1] & (~above[:-2] | touches[:-1]))
    ends = np.flatnonzero(above[1:-1] & (~above[2:] | touches[1:])) + 1
    interval = np.column_stack([starts, ends]).astype(np.int64)
    top = np.maximum(first, last)
    return Wave(
        pieces=pieces,
        cycle=np.asarray(cycle, np.int64),
        shape=np.asarray(shape, np.int64),
        interval=interval,
        height=np.maximum.reduceat(np.append(top, 0.0), interval.ravel())[::2].copy() if interval.size else np.empty(0),
        same=np.arange(len(interval)),
        rises=np.empty((0, 2)),
        highest=float(top.max()),
        lowest=float(np.minimum(first, last).min()),
        lead=lead,
        repeats=repeats,
    )
