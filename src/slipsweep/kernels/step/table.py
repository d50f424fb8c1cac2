"""The steps of a wave: how many on each piece, and w at their ends and middles, the same for all cells."""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.step.rates import coefficients_of, displacement_gain_of, velocity_gain_of
from slipsweep.motion.pieces import BEGIN, COEFFICIENTS, DEGREE, FINISH, FIRST, LAST, TERM, TOP, Wave

#: Nodes that are looked at together (`lanes`): the tables are as much longer than the nodes of the last piece.
AHEAD = 32

#: Cycles from which on the rounding of V over one (1e-14) is kept from adding up (`mirrored_gain`).
_MANY = 64


class Steps(NamedTuple):
    """The steps of the pieces of a wave: `counts[p]` of one `length[p]` on each.

    ``nodes[offset[p] + k]`` is w at the beginning of step k of piece p, followed by w at its end, and
    ``middles[offset[p] + k]`` w at its middle (−0.0 where a negative piece is 0); `mirrored` is whether the halves
    of a cycle repeated often are, but for the sign, the same.
    Row p of `weights` is what the rates at the start, the middle and the end of a step are multiplied by, for V and W.
    ``once[offset[p] + k]`` and ``twice[offset[p] + k]`` are the sums by the rule for ∫ (w − top) and its integral,
    from the anchor of piece p to node k.
    """

    wave: Wave
    nodes: np.ndarray
    middles: np.ndarray
    once: np.ndarray
    twice: np.ndarray
    offset: np.ndarray
    counts: np.ndarray
    length: np.ndarray
    weights: np.ndarray
    mirrored: bool
    per_cycle: int
    rule: int


def steps_of(wave: Wave, steps_per_cycle: int, rule: int) -> Steps:
    """Steps of all pieces of a wave, `steps_per_cycle` at least in a cycle, and the rule by which they are taken."""
    pieces = wave.pieces.shape[0]
    length = wave.pieces[:, FINISH] - wave.pieces[:, BEGIN]
    count = np.maximum(np.ceil(length / (2.0 * math.pi) * steps_per_cycle - 1e-9), 1.0).astype(np.int64)
    offset = np.empty(pieces, np.int64)
    nodes: list[np.ndarray] = []
    middles: list[np.ndarray] = []
    once: list[np.ndarray] = []
    twice: list[np.ndarray] = []
    known: dict[int, int] = {}
    size = 0
    for c in range(wave.shape.size):
        low, high = wave.cycle[c], wave.cycle[c + 1]
        same = known.setdefault(int(wave.shape[c]), c)
        if same != c:
            offset[low:high] = offset[wave.cycle[same] : wave.cycle[same + 1]]
            continue
        for p in range(low, high):
            halves, below = _nodes(wave, p, int(count[p]))
            offset[p] = size
            nodes.append(halves[::2])
            middles.append(np.append(halves[1::2], 0.0))
            h = float(length[p] / count[p])
            sums = _sums(_weights(rule, h), h, below, bool(wave.pieces[p, BEGIN] == 0.0))
            once.append(sums[0])
            twice.append(sums[1])
            size += nodes[-1].size
    spare = [np.zeros(AHEAD)]
    table = [np.concatenate(parts + spare) for parts in (nodes, middles, once, twice)]
    mirrored = _mirrored(wave, table[:2], offset, count)
    each = length / count
    weights = np.array([_weights(rule, float(h)) for h in each])
    return Steps(
        wave, table[0], table[1], table[2], table[3], offset, count, each, weights, mirrored, steps_per_cycle, rule
    )


def _weights(rule: int, h: float) -> np.ndarray:
    """What the rates at the start, the middle and the end of a step are multiplied by, for V and for W."""
    units = [coefficients_of(rule, *unit) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    return np.array([of(*unit, h, 1.0) for of in (velocity_gain_of, displacement_gain_of) for unit in units])


def _sums(weights: np.ndarray, h: float, below: np.ndarray, from_start: bool) -> np.ndarray:
    """The rule's sums of w − top, which is given at every half step, at the nodes: for V, and for W."""
    sums = np.zeros((2, below.size // 2 + 1))
    rates = np.array([below[:-2:2], below[1::2], below[2::2]])
    gain, moved = weights[:3] @ rates, weights[3:] @ rates
    if from_start:
        sums[0, 1:] = np.cumsum(gain)
        sums[1, 1:] = np.cumsum(sums[0, :-1] * h + moved)
    else:
        sums[0, :-1] = -np.cumsum(gain[::-1])[::-1]
        sums[1, :-1] = -np.cumsum((sums[0, :-1] * h + moved)[::-1])[::-1]
    return sums


def _nodes(wave: Wave, p: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """w at every half step of piece p, and w − top."""
    # counted from the anchor, so that mirrored pieces have mirrored nodes
    tau = np.arange(2 * count + 1) * ((wave.pieces[p, FINISH] - wave.pieces[p, BEGIN]) / (2 * count))
    tau = -tau[::-1] if wave.pieces[p, FINISH] == 0.0 else tau
    nodes = np.zeros(tau.size)
    for k in range(int(wave.pieces[p, DEGREE]) - 1, -1, -1):
        nodes = (nodes + wave.pieces[p, COEFFICIENTS + TERM * k]) * tau
    below = nodes.copy()
    nodes += wave.pieces[p, TOP]
    nodes[0], nodes[-1] = wave.pieces[p, FIRST], wave.pieces[p, LAST]
    side = math.copysign(1.0, wave.pieces[p, TOP])
    return side * np.maximum(side * nodes, 0.0), below


def _mirrored(wave: Wave, table: list[np.ndarray], offset: np.ndarray, count: np.ndarray) -> bool:
    """Whether in a cycle repeated often w(φ + π) = −w(φ)."""
    if wave.repeats < _MANY:
        return False
    low, high = wave.cycle[wave.lead], wave.cycle[wave.lead + 1]
    if (high - low) % 2:
        return False
    half = (high - low) // 2
    for p in range(low, low + half):
        if count[p] != count[p + half]:
            return False
        a, b = (slice(offset[q], offset[q] + count[q] + 1) for q in (p, p + half))
        if not all(np.allclose(w[a], -w[b], rtol=0.0, atol=1e-14) for w in table):
            return False
    return True


@scalar
def node(steps: Steps, p: int, i: int) -> float:
    """τ on piece p at which step i begins."""
    return (i if steps.wave.pieces[p, BEGIN] == 0.0 else i - steps.counts[p]) * steps.length[p]
