"""Where a scan of amplitudes first reaches a target, and what may lie hidden between its points.

The displacement u(A) is known at the points of a scan.  Steps that may hide a peak are cut into parts; where something
changes with which u jumps or grows beyond all bounds, the place of the change is found.  docs/limit.md says what is
missed all the same.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid.chunks import slabs
from slipsweep.model.variables import Validity

Floats = NDArray[np.float64]

#: Displacements scanned together: 16 MB, and as much again to compare them.
SCANNED = 2_000_000

#: A maximum of the scan from this part of the target on may be that of a peak that is higher beside it.
_MAXIMUM = 0.9

#: By this part of an interval, times its length over that at first, a secant's guess is moved towards the middle: past
#: the root, so that both ends come to it.
_INWARD = 0.2


class Change(NamedTuple):
    """What changes with which u jumps, or grows beyond all bounds.

    Attributes
    ----------
    result : str
        In which result it is seen, ...
    bits : int
        ... and in which of its bits.
    least : float
        From this part of the target on, on either side of a step, its place is looked for, ...
    part : float
        ... to this part of the step; 0: to neighbouring numbers.
    """

    result: str
    bits: int
    least: float
    part: float


class Hides(NamedTuple):
    """Where a scan may hide a peak.

    Attributes
    ----------
    saw : float
        From this part of the target on the steps of blocks that do not recouple are cut into parts: there u jumps up
        each time that one pulse less stops a block, and then falls.
    parts : int
        Parts of such a step.
    changes : tuple of Change
        What has its places looked for.
    """

    saw: float
    parts: int
    changes: tuple[Change, ...]


#: The gap of the literal rise, in which Kd would be negative: beside it Kd vanishes, and u grows beyond all bounds.
_GAP = Change("validity", int(Validity.KD_NOT_POSITIVE), 0.0, 0.0)

#: Under a record u jumps where there are more slips or fewer, as two become one; under a waveform, of which no slips
#: are counted, jumps are found by finer parts.
UNDER_WAVEFORM = Hides(0.5, 512, (_GAP,))
UNDER_RECORD = Hides(0.7, 128, (_GAP, Change("number_of_slips", -1, 0.25, 1e-5)))


class Steps(NamedTuple):
    """Steps of a scan in which a target is reached: of which block (row), for which target (column), from where."""

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Scan:
    """Blocks at increasing amplitudes, for targets.

    Attributes
    ----------
    hides : Hides
    amplitudes : array, (block, amplitude)
    moved : array, (block, amplitude, target)
        Displacements.
    wanted : array, (block, 1, target)
        Displacements to be reached.
    carried : array of bool, (block, amplitude)
        Whether the block does not recouple.
    """

    hides: Hides
    amplitudes: Floats
    moved: Floats
    wanted: Floats
    carried: NDArray[np.bool_]

    @cached_property
    def first(self) -> NDArray[np.intp]:
        """The first amplitude that reaches a target, (block, target); their number where none does."""
        reaches = self.moved >= self.wanted
        first = reaches.argmax(axis=1)
        reached = np.take_along_axis(reaches, first[:, np.newaxis], axis=1)[:, 0]
        return np.asarray(np.where(reached, first, self.moved.shape[1]))

    @cached_property
    def before(self) -> NDArray[np.bool_]:
        """Whether a target is reached nowhere in the scan up to the start of a step, (block, step, target)."""
        steps = np.arange(self.moved.shape[1] - 1)
        return np.asarray(steps[:, np.newaxis] < self.first[:, np.newaxis])

    def ratios(self) -> Floats:
        """Displacements for each target over those for the first, (block, target); NaN where a block does not move."""
        most = np.nan_to_num(self.moved[:, :, :1], nan=-1.0).argmax(axis=1, keepdims=True)
        found = np.take_along_axis(self.moved, most, axis=1)[:, 0]
        with np.errstate(invalid="ignore"):
            return np.asarray(found / found[:, :1])


#: Whether targets (columns) are reached by blocks (rows) at amplitudes.
Displaced: TypeAlias = Callable[[Floats, NDArray[np.intp], NDArray[np.intp]], NDArray[np.bool_]]


def first_step(scan: Scan) -> Steps:
    """The first step of the scan that reaches each target, of those that are reached."""
    row, column = np.nonzero(scan.first < scan.moved.shape[1])
    # the scan begins at yield, where no block has moved: there is always a step before
    at = scan.first[row, column]
    return Steps(row, column, scan.amplitudes[row, at - 1], scan.amplitudes[row, at])


def _places(holds: NDArray[np.bool_]) -> tuple[NDArray[np.intp], ...]:
    """As `np.nonzero`, where few places hold: in a tenth of the time."""
    return np.unravel_index(np.flatnonzero(holds), holds.shape)


def hidden_peaks(scan: Scan, moved: Callable[[Floats, NDArray[np.intp]], Floats], displaced: Displaced) -> Steps:
    """Parts of steps in which a target is reached, up to the step in which the scan itself reaches it.

    `moved` gives the displacement of blocks (rows) for the first target, each at other amplitudes of its own.  Those
    for the others are in the same ratio to it at all amplitudes, so that each part is solved once.
    """
    moves, parts, points = scan.moved[:, :, 0], scan.hides.parts, scan.amplitudes.shape[1]
    # from which part of a target on a point is beside what may be a peak
    least_part = np.where(scan.carried, scan.hides.saw, np.inf)
    peaks = (moves[:, 1:-1] > moves[:, :-2]) & (moves[:, 1:-1] > moves[:, 2:])
    least_part[:, 1:-1][peaks & ~scan.carried[:, 1:-1]] = _MAXIMUM
    row, point = np.nonzero(least_part < np.inf)
    may = np.zeros(scan.moved.shape, np.bool_)
    may[row, point] = scan.moved[row, point] >= least_part[row, point, np.newaxis] * scan.wanted[row, 0]
    row, step, column = _places((may[:, 1:] | may[:, :-1]) & scan.before)
    places, which = np.unique(row * points + step, return_inverse=True)
    least = scan.wanted[row, 0, column] / scan.ratios()[row, column]
    found = [Steps(row[:0], column[:0], np.empty(0), np.empty(0))]
    for (some,) in slabs(places.shape, SCANNED // parts):
        rows, steps = np.divmod(places[some], points)
        # place, part
        at = np.linspace(scan.amplitudes[rows, steps], scan.amplitudes[rows, steps + 1], parts + 1, axis=1)
        there = moved(at, rows)
        (asked,) = np.nonzero((which >= some.start) & (which < some.stop))
        asked = asked[np.fmax.reduce(there, axis=1)[which[asked] - some.start] >= least[asked]]
        place = which[asked] - some.start
        first = np.maximum((there[place] >= least[asked, np.newaxis]).argmax(axis=1), 1)
        found.append(Steps(row[asked], column[asked], at[place, first - 1], at[place, first]))
    rows, columns, low, high = (np.concatenate(values) for values in zip(*found, strict=True))
    reaches = displaced(high, rows, columns) & ~displaced(low, rows, columns)  # the ratio is known to rounding
    return Steps(rows[reaches], columns[reaches], low[reaches], high[reaches])


def beside_changes(
    scan: Scan,
    change: Change,
    states: NDArray[np.integer[Any]],
    state: Callable[[Floats, NDArray[np.intp]], NDArray[np.integer[Any]]],
    displaced: Displaced,
) -> Steps:
    """Steps up to the last amplitude before a change, or to the first behind it, at which a target is reached.

    `states` are those of the scan, (block, amplitude), `state` gives those of blocks (rows) at other amplitudes.
    """
    row, step = np.nonzero(states[:, 1:] != states[:, :-1])
    higher = np.maximum(scan.moved[row, step + 1], scan.moved[row, step])
    may = scan.before[row, step] & ~(higher < change.least * scan.wanted[row, 0])  # NaN beside a gap
    asked = may.any(axis=1)
    row, step = row[asked], step[asked]
    start, end, known = scan.amplitudes[row, step], scan.amplitudes[row, step + 1], states[row, step]
    low, high = narrow(
        start,
        end,
        lambda at, which: np.where(state(at, row[which]) != known[which], 1.0, -1.0),
        change.part * (end - start),
    )
    every = np.arange(scan.moved.shape[2])
    row, column = np.repeat(row, every.size), np.tile(every, row.size)
    start, low, high = (np.repeat(values, every.size) for values in (start, low, high))
    at_low = displaced(low, row, column)
    reaches = at_low | displaced(high, row, column)
    below, beside = np.where(at_low, start, low), np.where(at_low, low, high)
    return Steps(row[reaches], column[reaches], below[reaches], beside[reaches])


def first_of(shape: tuple[int, ...], *found: Steps) -> Steps:
    """The lowest of the steps found for each block and target."""
    row, column, low, high = (np.concatenate(values) for values in zip(*found, strict=True))
    order = np.argsort(high, kind="stable")
    _, first = np.unique((row * shape[1] + column)[order], return_index=True)
    chosen = order[first]
    return Steps(row[chosen], column[chosen], low[chosen], high[chosen])


def narrow(
    low: Floats,
    high: Floats,
    excess: Callable[[Floats, NDArray[np.intp]], Floats],
    width: Floats | float = 0.0,
) -> tuple[Floats, Floats]:
    """Narrow every interval until its ends are neighbours in double precision, or it is no wider than `width`.

    `excess` is negative or NaN at `low`, not negative at `high`, and changes its sign once; it is asked at amplitudes
    together with the numbers of the intervals that they belong to.  By ITP (Oliveira and Takahashi 2020): the guess of
    a secant is moved towards the middle, and is never so far from it that more than one step is lost to bisection.
    Where excess has no finite value it is bisection.
    """
    low, high = low.copy(), high.copy()
    active, enough = np.arange(low.size), np.broadcast_to(width, low.shape)
    below, above = excess(low, active), excess(high, active)
    widest = high - low
    for step in count():
        start, end = low[active], high[active]
        middle = start + 0.5 * (end - start)
        wide = (start < middle) & (middle < end) & (end - start > enough[active])
        active, start, end, middle = active[wide], start[wide], end[wide], middle[wide]
        if not active.size:
            break
        length, first, last = end - start, below[active], above[active]
        with np.errstate(invalid="ignore", over="ignore"):
            aside = -np.nan_to_num(0.5 + first / (last - first)) * length
        inward = _INWARD * length * (length / widest[active])
        furthest = np.maximum(np.ldexp(widest[active], -step) - 0.5 * length, 0.0)
        at = middle + np.copysign(np.clip(np.abs(aside) - inward, 0.0, furthest), aside)
        at = np.clip(at, np.nextafter(start, end), np.nextafter(end, start))
        found = excess(at, active)
        reaches = found >= 0.0
        high[active[reaches]], above[active[reaches]] = at[reaches], found[reaches]
        low[active[~reaches]], below[active[~reaches]] = at[~reaches], found[~reaches]
    return low, high
