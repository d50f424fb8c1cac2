"""Where a scan of amplitudes first reaches a target displacement, and what it may hide between its points.

The displacement u(A) is known at the points of a scan.  Steps of the scan that may hide a peak are cut into parts;
where a result changes with which u jumps or grows beyond all bounds, the place of the change is located.  docs/limit.md
says what is missed all the same.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid import engine
from slipsweep.grid.chunks import slabs
from slipsweep.grid.engine import Arrays, Request
from slipsweep.grid.problem import Problem
from slipsweep.model.variables import Validity
from slipsweep.motion.records import Record

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Displacements scanned together: 16 MB, and as much again to compare them.
SCANNED = 2_000_000

#: A maximum of the scan from this part of the target on may lie next to a higher peak.
_MAXIMUM = 0.9


class Change(NamedTuple):
    """A change of a result with which u jumps, or grows beyond all bounds.

    Attributes
    ----------
    result : str
        The result, of whole numbers.
    bits : int
        Its bits that count.
    least : float
        Its place is located where u on either side of a step is at least this part of the target, ...
    part : float
        ... to this part of the step; 0: to neighbouring numbers.
    """

    result: str
    bits: int
    least: float
    part: float


#: The gap of the literal rise, in which Kd would be negative: at its edges Kd vanishes, and u grows beyond all bounds.
_GAP = Change("validity", int(Validity.KD_NOT_POSITIVE), 0.0, 0.0)

#: Under a record u jumps where the number of slips changes; under a waveform, whose slips are not counted, such jumps
#: are found by finer parts of steps.
_SLIPS = Change("number_of_slips", -1, 0.25, 1e-5)


class Steps(NamedTuple):
    """Intervals of amplitude in which cells reach their targets: not at `low`, but at `high`."""

    cell: Indices
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Scan:
    """Cells at increasing amplitudes.

    Attributes
    ----------
    problem : Problem
    arrays : mapping of str to array
        Inputs but for the amplitude: one value for each cell, or one for all.
    targets : array, (cell,)
        Displacement to be reached, m.
    amplitudes : array, (cell, amplitude)
    found : mapping of str to array, (cell, amplitude)
        `permanent_displacement`, `validity` and the results of `changes_of` the problem.
    """

    problem: Problem
    arrays: Mapping[str, Floats]
    targets: Floats
    amplitudes: Floats
    found: Mapping[str, NDArray[Any]]

    def solve(self, amplitude: Floats, cell: Indices, wanted: tuple[str, ...]) -> Arrays:
        """Results of some cells, each at its own amplitudes (rows of the array)."""
        more = (1,) * (amplitude.ndim - 1)
        arrays = {
            name: (values if values.size == 1 else values[cell]).reshape(-1, *more)
            for name, values in self.arrays.items()
        }
        return engine.solve(Request(self.problem, amplitude.shape, {**arrays, "amplitude": amplitude}, wanted))

    def reach(self, amplitude: Floats, cell: Indices) -> NDArray[np.bool_]:
        """Whether some cells reach their targets at amplitudes of their own."""
        moved = self.solve(amplitude, cell, ("permanent_displacement",))["permanent_displacement"]
        return np.asarray(moved >= self.targets[cell].reshape(-1, *(1,) * (amplitude.ndim - 1)))

    @property
    def first(self) -> Indices:
        """Index of the first amplitude at which each cell reaches its target; their number where it does not."""
        reaches = self.found["permanent_displacement"] >= self.targets[:, np.newaxis]
        return np.where(reaches.any(axis=1), reaches.argmax(axis=1), reaches.shape[1])


def changes_of(problem: Problem) -> tuple[Change, ...]:
    """The changes with which the displacement of a problem jumps."""
    return (_GAP, _SLIPS) if isinstance(problem.excitation, Record) else (_GAP,)


def limits_of(scan: Scan) -> Steps:
    """The lowest neighbouring amplitudes between which cells reach their targets, of those cells that do."""
    first = scan.first
    before = np.arange(scan.amplitudes.shape[1] - 1) < first[:, np.newaxis]
    (cell,) = np.nonzero(first < scan.amplitudes.shape[1])
    # the scan begins at yield, where no block has moved: there is always a step before
    at = first[cell]
    found = [Steps(cell, scan.amplitudes[cell, at - 1], scan.amplitudes[cell, at]), *_hidden_peaks(scan, before)]
    found += [_at_change(scan, before, change) for change in changes_of(scan.problem)]
    steps = Steps(*(np.concatenate(values) for values in zip(*found, strict=True)))
    order = np.argsort(steps.high, kind="stable")
    cell, first = np.unique(steps.cell[order], return_index=True)
    lowest = order[first]
    return Steps(cell, *bisected(steps.low[lowest], steps.high[lowest], lambda at, which: scan.reach(at, cell[which])))


def _hidden_peaks(scan: Scan, before: NDArray[np.bool_]) -> list[Steps]:
    """Parts of steps in which a target is reached, `before` (cell, step) the scan itself reaches it."""
    # blocks that do not recouple: u jumps up each time that they come to rest one pulse earlier, and then falls
    saw, parts = (0.7, 128) if isinstance(scan.problem.excitation, Record) else (0.5, 512)
    moved = scan.found["permanent_displacement"]
    slides_on = scan.found["validity"] & Validity.NOT_RECOUPLED.value != 0
    # the part of a target from which on a point may lie next to a peak
    least = np.where(slides_on, saw, np.inf)
    peaks = (moved[:, 1:-1] > moved[:, :-2]) & (moved[:, 1:-1] > moved[:, 2:])
    least[:, 1:-1][peaks & ~slides_on[:, 1:-1]] = _MAXIMUM
    near = moved >= least * scan.targets[:, np.newaxis]
    cell, step = np.nonzero((near[:, 1:] | near[:, :-1]) & before)
    found = []
    for (some,) in slabs(cell.shape, SCANNED // parts):
        own, begin = cell[some], step[some]
        amplitudes = np.linspace(scan.amplitudes[own, begin], scan.amplitudes[own, begin + 1], parts + 1, axis=1)
        reaches = scan.reach(amplitudes, own)
        (which,) = np.nonzero(reaches.any(axis=1) & ~reaches[:, 0])
        first = reaches[which].argmax(axis=1)
        found.append(Steps(own[which], amplitudes[which, first - 1], amplitudes[which, first]))
    return found


def _at_change(scan: Scan, before: NDArray[np.bool_], change: Change) -> Steps:
    """Steps up to the last amplitude before a change, or to the first after it, at which a target is reached."""
    moved, states = scan.found["permanent_displacement"], scan.found[change.result] & change.bits
    cell, step = np.nonzero(states[:, 1:] != states[:, :-1])
    higher = np.maximum(moved[cell, step + 1], moved[cell, step])
    # no comparison holds for the NaN of a gap: its edges are located
    may = before[cell, step] & ~(higher < change.least * scan.targets[cell])
    cell, step = cell[may], step[may]
    start, end, known = scan.amplitudes[cell, step], scan.amplitudes[cell, step + 1], states[cell, step]

    def changed(amplitude: Floats, which: Indices) -> NDArray[np.bool_]:
        there = scan.solve(amplitude, cell[which], (change.result,))[change.result] & change.bits
        return np.asarray(there != known[which])

    low, high = bisected(start, end, changed, change.part * (end - start))
    at_low = scan.reach(low, cell)
    found = at_low | scan.reach(high, cell)
    return Steps(cell[found], np.where(at_low, start, low)[found], np.where(at_low, low, high)[found])


def bisected(
    low: Floats,
    high: Floats,
    changed: Callable[[Floats, Indices], NDArray[np.bool_]],
    width: Floats | float = 0.0,
) -> tuple[Floats, Floats]:
    """Halve intervals until their ends are neighbours in double precision, or no further apart than `width`.

    ``changed(amplitudes, which)``, for intervals by their indices, holds at `high` and not at `low`.
    """
    low, high = low.copy(), high.copy()
    active, width = np.arange(low.size), np.broadcast_to(width, low.shape)
    while True:
        middle = low[active] + 0.5 * (high[active] - low[active])
        inside = (low[active] < middle) & (middle < high[active]) & (high[active] - low[active] > width[active])
        active, middle = active[inside], middle[inside]
        if not active.size:
            return low, high
        above = changed(middle, active)
        high[active[above]], low[active[~above]] = middle[above], middle[~above]
