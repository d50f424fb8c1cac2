"""A wave at the steps of the stepping kernel (`kernels.step`), tabulated once for all cells."""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.motion.pieces import Wave

#: Rules by which steps are taken.
RECTANGLE, TRAPEZOID, SIMPSON = 0, 1, 2


class Steps(NamedTuple):
    """The steps of a wave: `counts[p]` of one length on piece p, so that they end where it does.

    Attributes
    ----------
    rule, per_cycle : int
        The rule by which they are taken (`kernels.step`), and how many are in 2π of phase, at least.
    counts, at : ndarray of int, shape (pieces,)
        ``w[at[p] + 2 * i]`` is w where step i of piece p begins; w at its middle and at its end follow.
    w : ndarray, shape (values,)
        −0.0 where a negative piece is 0: Eq. 4 jumps there.
    rates, known : ndarray
        Workspaces of the kernel: Üg − Ü by Eq. 4 at the values of w on a piece, and what `kernels.train` keeps.
    """

    rule: int
    per_cycle: int
    counts: np.ndarray
    at: np.ndarray
    w: np.ndarray
    rates: np.ndarray
    known: np.ndarray


def steps_of(wave: Wave, rule: int, steps_per_cycle: int) -> Steps:
    """The steps of a wave, `steps_per_cycle` at least in 2π of its phase."""
    pieces, length = wave.pieces, wave.pieces["finish"] - wave.pieces["begin"]
    counts = np.maximum(np.ceil(length / (2.0 * math.pi) * steps_per_cycle - 1e-9), 1.0).astype(np.int64)
    at = np.cumsum(2 * counts + 1) - (2 * counts + 1)
    p = np.repeat(np.arange(counts.size), 2 * counts + 1)
    # counted from the anchor of a piece, so that mirrored pieces have mirrored values
    tau = (np.arange(p.size) - at[p] - np.where(pieces["begin"][p] < 0.0, 2 * counts[p], 0)) * (length / (2 * counts))[
        p
    ]
    w = np.zeros(p.size)
    for k in range(int(pieces["degree"].max()) - 1, -1, -1):
        w = (w + pieces["coefficients"][p, k]) * tau
    w += pieces["top"][p]
    w[at], w[at + 2 * counts] = pieces["first"], pieces["last"]
    w = np.copysign(np.maximum(np.copysign(1.0, pieces["top"][p]) * w, 0.0), pieces["top"][p])
    rates, known = np.empty(2 * int(counts.max()) + 1), np.empty((wave.height.size, 2))
    return Steps(rule, steps_per_cycle, counts, at, w, rates, known)


def own_steps(steps: Steps) -> Steps:
    """The same steps with workspaces of their own, for another thread."""
    return steps._replace(rates=np.empty_like(steps.rates), known=np.empty_like(steps.known))
