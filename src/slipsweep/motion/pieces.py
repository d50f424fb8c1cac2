"""The table of pieces that is made of every motion of the base.

`slipsweep.motion.cutting` cuts waveforms and records into pieces, `slipsweep.kernels.base`
evaluates them.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: A piece: a record of the fields that `pieces_of` names.
Piece: TypeAlias = np.record

#: Gauss-Legendre nodes on [0, 1], two SIMD registers.
NODES, WEIGHTS = (
    (a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True)
)


class Wave(NamedTuple):
    """Pieces of the shaking in the order of time, and what else the solvers ask of them.

    The table holds the first `lead` cycles, then one plain cycle that stands for `repeats` alike
    (none where `repeats` is 0), then the remaining ones; phases are counted as if the plain cycle
    came once.  An interval is a run of pieces with w > 0.
    """

    pieces: np.ndarray  # of `pieces_of`
    cycle: np.ndarray  # (cycles + 1,) the first piece of each cycle in the table
    shape: np.ndarray  # (cycles,) cycles of one number have the same pieces
    interval: np.ndarray  # (intervals, 2) its first piece, and the first after it
    height: np.ndarray  # (intervals,) its largest w
    highest: float  # w
    lowest: float
    lead: int
    repeats: int


def pieces_of(
    start: NDArray[Any],
    end: NDArray[Any],
    length: NDArray[Any],
    first: NDArray[Any],
    last: NDArray[Any],
    coefficients: NDArray[Any],
    arc: NDArray[Any] | bool = False,
) -> np.ndarray:
    """Return the table of pieces.

    On a piece w = top + c₁τ + c₂τ² + …, with τ from its anchor, the end at which |w| is larger.

    `length` is without the rounding of `start` and `end`, and `arc` whether a piece may be one.
    """
    power = np.arange(1, coefficients.shape[1] + 1, dtype=np.int64)
    at_end = np.abs(last) > np.abs(first)
    top = np.where(at_end, last, first)
    fields: dict[str, NDArray[Any]] = {
        "start": start,  # phases of the motion
        "end": end,
        "begin": np.where(at_end, -length, 0.0),  # the same as τ: one of the two is 0
        "finish": np.where(at_end, 0.0, length),
        "first": first,  # w at the beginning, the end and the anchor
        "last": last,
        "top": top,
        "degree": np.where(coefficients != 0.0, power, 0).max(
            axis=1
        ),  # 0: a plateau, 1: a straight line
        "jumps": first
        > np.maximum(np.concatenate([[0.0], last[:-1]]), 0.0),  # w jumps up at its beginning
        # a quarter of a sine about its peak, whose closed forms are shorter than its series
        "arc": arc & (np.abs(top) == 1.0) & (coefficients[:, 0] == 0.0),
        "coefficients": coefficients,  # c₁, c₂, …
        "once": coefficients
        / (power + 1),  # of the first and second integral from the anchor, of τ² and τ³ on
        "twice": coefficients / ((power + 1) * (power + 2)),
    }
    types = [(name, values.dtype, values.shape[1:]) for name, values in fields.items()]
    return np.rec.fromarrays(list(fields.values()), np.dtype((np.record, types))).view(np.ndarray)


def wave_of_pieces(
    pieces: np.ndarray, cycle: ArrayLike, shape: ArrayLike, lead: int = 0, repeats: int = 0
) -> Wave:
    """Return the wave of a table of pieces; an interval ends where it touches zero."""
    first = pieces["first"]
    last = pieces["last"]
    above = first + last > 0.0
    top = np.maximum(first, last)
    parted = ~(above[:-1] & above[1:]) | (
        (last[:-1] == 0.0) & (first[1:] == 0.0)
    )  # from the next piece
    starts = np.flatnonzero(above & np.append(True, parted))
    ends = np.flatnonzero(above & np.append(parted, True)) + 1
    interval = np.column_stack([starts, ends]).astype(np.int64)
    return Wave(
        pieces=pieces,
        cycle=np.asarray(cycle, np.int64),
        shape=np.asarray(shape, np.int64),
        interval=interval,
        height=np.maximum.reduceat(np.append(top, 0.0), interval.ravel())[::2].copy(),
        highest=float(top.max()),
        lowest=float(np.minimum(first, last).min()),
        lead=lead,
        repeats=repeats,
    )
