"""The table of pieces that every motion of the plane ends as: what its columns are, and how it is put together.

`slipsweep.motion.waveforms` and `slipsweep.motion.records` cut a motion into pieces, `slipsweep.kernels.excitation`
evaluates them.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Columns of a table of pieces: the phases at which a piece begins and ends, the same counted from its
#: anchor (one of the two is 0), w at its beginning, its end and its anchor, the degree of its polynomial
#: (0 on a plateau, 1 on a straight line), 1 where w jumps up at its beginning, and 1 where it is a quarter
#: of a sine about its peak, whose closed forms are shorter than its series.
START, END, BEGIN, FINISH, FIRST, LAST, TOP, DEGREE, JUMPS, ARC = range(10)
#: ∫ (w − top) dτ and ∫ (end − τ)(w − top) dτ over the whole piece.
WHOLE, WHOLE_MOMENT = 10, 11
#: c₁, and the first ones of the sum's first and second integral from the anchor, τ² and τ³; those of the
#: next power follow `TERM` columns on, as many as the longest series in a table has terms.
COEFFICIENTS, ONCE, TWICE = 12, 13, 14
TERM = 3

#: Gauss-Legendre nodes on [0, 1], two SIMD registers.
NODES, WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True))


class Wave(NamedTuple):
    """Pieces of the shaking in the order of time, and what else the solvers ask of them.

    The table holds the first `lead` cycles, then one plain cycle that stands for `repeats` alike
    (none where `repeats` is 0), then the remaining ones; phases are counted as if the plain cycle
    came once.

    Attributes
    ----------
    pieces : ndarray, shape (pieces, columns)
        Columns `START` to `ARC` and the coefficients: one array, because a function that is handed many spends
        its time, and its compilation, on handing them on.
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
    """The table of pieces, from the columns of these names.

    `length` is that of a piece, which the difference of its ends would round; `at_end` is whether |w| is larger
    at its end, its anchor then, and row i of `coefficients` are c₁, c₂, … of piece i from there.
    """
    degree = np.where(coefficients != 0.0, np.arange(1, coefficients.shape[1] + 1), 0).max(axis=1)
    coefficients = coefficients[:, : max(int(degree.max()), 1)]
    before, top = np.concatenate([[0.0], last[:-1]]), np.where(at_end, last, first)
    power = np.arange(1, coefficients.shape[1] + 1)
    pieces = np.empty((first.size, COEFFICIENTS + TERM * power.size))
    pieces[:, [START, END, FIRST, LAST, TOP, DEGREE]] = np.column_stack([start, end, first, last, top, degree])
    pieces[:, BEGIN], pieces[:, FINISH] = np.where(at_end, -length, 0.0), np.where(at_end, 0.0, length)
    pieces[:, JUMPS] = first > np.maximum(before, 0.0)
    pieces[:, ARC] = arc & (np.abs(top) == 1.0) & (coefficients[:, 0] == 0.0)
    series = COEFFICIENTS + TERM * power.size
    pieces[:, COEFFICIENTS:series:TERM] = coefficients
    pieces[:, ONCE:series:TERM] = coefficients / (power + 1)
    pieces[:, TWICE:series:TERM] = coefficients / ((power + 1) * (power + 2))
    # one of the two ends is the anchor
    tau = np.where(at_end, -length, length)
    once, moment = np.zeros(first.size), np.zeros(first.size)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows here, overflows where it is used
        for k in range(power.size - 1, -1, -1):
            once = (once + pieces[:, ONCE + TERM * k]) * tau
            moment = (moment + pieces[:, TWICE + TERM * k]) * tau
        once, moment = once * tau, moment * tau * tau
        pieces[:, WHOLE] = np.where(at_end, -once, once)
        pieces[:, WHOLE_MOMENT] = np.where(at_end, -moment - once * length, moment)
    return pieces


def wave_of_pieces(pieces: np.ndarray, cycle: ArrayLike, shape: ArrayLike, lead: int = 0, repeats: int = 0) -> Wave:
    """The wave of a table of pieces.

    Its intervals are runs of pieces above zero, one that touches zero ends; each is taken as different from all others,
    and `rises` are left out: what `same` and `rises` save is worth their computation where cycles repeat.
    """
    first, last = pieces[:, FIRST], pieces[:, LAST]
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
