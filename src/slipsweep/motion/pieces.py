"""The table of pieces that a motion of the plane ends as: what its columns are.

`slipsweep.motion.waveforms` fills it, `slipsweep.kernels.excitation` evaluates it.
"""

from typing import NamedTuple

import numpy as np

#: Terms of the Taylor series of a piece about its anchor.
TERMS = 22

#: Columns of a table of pieces: the phases at which a piece begins and ends, the same counted from its
#: anchor (one of the two is 0), w at its beginning, its end and its anchor, the degree of its polynomial
#: (0 on a plateau, 1 on a straight line), 1 where w jumps up at its beginning, and 1 where it is a quarter
#: of a sine about its peak, whose closed forms are shorter than its series.
START, END, BEGIN, FINISH, FIRST, LAST, TOP, DEGREE, JUMPS, ARC = range(10)
#: c₁, c₂, …; and those of the sum's first and second integral from the anchor, τ² and τ³ on.
COEFFICIENTS, ONCE, TWICE = range(10, 10 + 3 * TERMS, TERMS)


class Wave(NamedTuple):
    """Pieces of the shaking in the order of time, and what else the solvers ask of them.

    The table holds the first `lead` cycles, then one plain cycle that stands for `repeats` alike
    (none where `repeats` is 0), then the remaining ones; phases are counted as if the plain cycle
    came once.

    Attributes
    ----------
    pieces : ndarray, shape (pieces, columns)
        Columns `START` to `ARC` and, each `TERMS` wide, `COEFFICIENTS`, `ONCE` and `TWICE`: one array,
        because a function that is handed many spends its time, and its compilation, on handing them on.
    cycle : ndarray of int, shape (cycles in the table + 1,)
        First piece of every cycle.
    shape : ndarray of int, shape (cycles in the table,)
        Cycles of one number have the same pieces.
    stretch : ndarray of int, shape (stretches, 2)
        Runs of pieces with w > 0: the first piece, and the first after it.
    height : ndarray, shape (stretches,)
        Largest w of each.
    rises : ndarray, shape (ranges, 2)
        Ranges of w > 0 that are passed through, or jumped to, without falling; they do not overlap.
    lead, repeats : int
        See above.
    alike : bool
        Whether what follows the plain cycle is one more of it.
    """

    pieces: np.ndarray
    cycle: np.ndarray
    shape: np.ndarray
    stretch: np.ndarray
    height: np.ndarray
    rises: np.ndarray
    lead: int
    repeats: int
    alike: bool
