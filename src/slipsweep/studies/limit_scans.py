"""Where a scan of amplitudes first reaches a target displacement, and what it may hide between its points.

The displacement u(A) is known at the points of a scan.  Steps of the scan that may hide a peak are cut into parts;
where a result changes with which u jumps or grows beyond all bounds, the place of the change is located.  docs/limit.md
says what is missed all the same.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid import engine
from slipsweep.grid.chunks import slabs
from slipsweep.grid.engine import Arrays, Request
from slipsweep.grid.problem import Problem
from slipsweep.model.variables import Validity

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


class Hides(NamedTuple):
    """Where a scan may hide a peak.

    Attributes
    ----------
    saw : float
        Steps of blocks that do not recouple are cut into parts where u is at least this part of the target: there u
        jumps up each time that the block comes to rest one pulse earlier, and then falls.
    parts : int
        Parts of such a step.
    changes : tuple of Change
    """

    saw: float
    parts: int
    changes: tuple[Change, ...]


#: The gap of the literal rise, in which Kd would be negative: at its edges Kd vanishes, and u grows beyond all bounds.
_GAP = Change("validity", int(Validity.KD_NOT_POSITIVE), 0.0, 0.0)

#: Under a record u jumps where the number of slips changes; under a waveform, whose slips are not counted, jumps are
#: found by finer parts.
UNDER_WAVEFORM = Hides(0.5, 512, (_GAP,))
UNDER_RECORD = Hides(0.7, 128, (_GAP, Change("number_of_slips", -1, 0.25, 1e-5)))


class Steps(NamedTuple):
    """Intervals of amplitude in which cells reach their targets: not at `low`, but at `high`."""

    cell: Indices
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Cells:
    """Cells that can be solved at any amplitude.

    Attributes
    ----------
    problem : Problem
    arrays : mapping of str to array
        Inputs but for the amplitude: one value for each cell, or one for all.
    targets : array
        Displacement to be reached by each cell, m.
    """

    problem: Problem
    arrays: Mapping[str, Floats]
    targets: Floats

    def solve(self, amplitude: Floats, cell: Indices, wanted: tuple[str, ...]) -> Arrays:
        """Results of some cells, each at its own amplitudes (rows of the array)."""
        more = (1,) * (amplitude.ndim - 1)
        arrays = {
            name: (values if values.size == 1 else values[cell]).reshape(-1, *more)
            for name, values in self.arrays.items()
        }
        return engine.solve(Request(self.problem, amplitude.shape, {**arrays, "amplitude": amplitude}, wanted))

    def excess(self, amplitude: Floats, cell: Indices) -> Floats:
        """Displacements less the targets."""
        found = self.solve(amplitude, cell, ("permanent_displacement",))["permanent_displacement"]
        return np.asarray(found - self.targets[cell].reshape(-1, *(1,) * (amplitude.ndim - 1)))

    def reach(self, amplitude: Floats, cell: Indices) -> NDArray[np.bool_]:
        """Whether cells reach their targets."""
        return np.asarray(self.excess(amplitude, cell) >= 0.0)


@dataclass(frozen=True)
class Scan:
    """Cells at increasing amplitudes.

    Attributes
    ----------
    cells : Cells
    hides : Hides
    amplitudes : array, (cell, amplitude)
    found : mapping of str to array, (cell, amplitude)
        Displacement, validity and the results of the changes.
    """

    cells: Cells
    hides: Hides
    amplitudes: Floats
    found: Mapping[str, NDArray[Any]]

    @property
    def displacement(self) -> Floats:
        """Displacements of the scan, (cell, amplitude)."""
        return self.found["permanent_displacement"]

    @cached_property
    def first(self) -> Indices:
        """Index of the first amplitude at which each cell reaches its target; their number where it does not."""
        reaches = self.displacement >= self.cells.targets[:, np.newaxis]
        return np.where(reaches.any(axis=1), reaches.argmax(axis=1), reaches.shape[1])

    @cached_property
    def before(self) -> NDArray[np.bool_]:
        """Whether a target is not reached in the scan up to the start of a step, (cell, step)."""
        steps = np.arange(self.amplitudes.shape[1] - 1)
        return np.asarray(steps < self.first[:, np.newaxis])


def first_step(scan: Scan) -> Steps:
    """The first step of the scan that reaches each target, of those that are reached."""
    (cell,) = np.nonzero(scan.first < scan.amplitudes.shape[1])
    # the scan begins at yield, where no block has moved: there is always a step before
    at = scan.first[cell]
    return Steps(cell, scan.amplitudes[cell, at - 1], scan.amplitudes[cell, at])


def hidden_peaks(scan: Scan) -> Steps:
    """Parts of steps in which a target is reached, up to the step in which the scan itself reaches it."""
    moved, parts = scan.displacement, scan.hides.parts
    slides_on = scan.found["validity"] & Validity.NOT_RECOUPLED.value != 0
    # the part of a target from which on a point may lie next to a peak
    least = np.where(slides_on, scan.hides.saw, np.inf)
    peaks = (moved[:, 1:-1] > moved[:, :-2]) & (moved[:, 1:-1] > moved[:, 2:])
    least[:, 1:-1][peaks & ~slides_on[:, 1:-1]] = _MAXIMUM
    near = moved >= least * scan.cells.targets[:, np.newaxis]
    cell, step = np.nonzero((near[:, 1:] | near[:, :-1]) & scan.before)
    found = [Steps(cell[:0], np.empty(0), np.empty(0))]
    for (some,) in slabs(cell.shape, SCANNED // parts):
        own, begin = cell[some], step[some]
        amplitudes = np.linspace(scan.amplitudes[own, begin], scan.amplitudes[own, begin + 1], parts + 1, axis=1)
        reaches = scan.cells.reach(amplitudes, own)
        (which,) = np.nonzero(reaches.any(axis=1) & ~reaches[:, 0])
        first = reaches[which].argmax(axis=1)
        found.append(Steps(own[which], amplitudes[which, first - 1], amplitudes[which, first]))
    return _together(found)


def steps_at_changes(scan: Scan, change: Change) -> Steps:
    """Steps up to the last amplitude before a change, or to the first after it, at which a target is reached."""
    cells, states = scan.cells, scan.found[change.result] & change.bits
    cell, step = np.nonzero(states[:, 1:] != states[:, :-1])
    higher = np.maximum(scan.displacement[cell, step + 1], scan.displacement[cell, step])
    # no comparison holds for the NaN of a gap: its edges are located
    may = scan.before[cell, step] & ~(higher < change.least * cells.targets[cell])
    cell, step = cell[may], step[may]
    start, end, known = scan.amplitudes[cell, step], scan.amplitudes[cell, step + 1], states[cell, step]

    def changed(amplitude: Floats, which: Indices) -> NDArray[np.bool_]:
        there = cells.solve(amplitude, cell[which], (change.result,))[change.result] & change.bits
        return np.asarray(there != known[which])

    low, high = bisected(start, end, changed, change.part * (end - start))
    at_low = cells.reach(low, cell)
    found = at_low | cells.reach(high, cell)
    return Steps(cell[found], np.where(at_low, start, low)[found], np.where(at_low, low, high)[found])


def lowest_of(*found: Steps) -> Steps:
    """The lowest of the steps found for each cell."""
    steps = _together(found)
    order = np.argsort(steps.high, kind="stable")
    _, first = np.unique(steps.cell[order], return_index=True)
    chosen = order[first]
    return Steps(steps.cell[chosen], steps.low[chosen], steps.high[chosen])


def _together(found: Sequence[Steps]) -> Steps:
    return Steps(*(np.concatenate(values) for values in zip(*found, strict=True)))


def crossings(low: Floats, high: Floats, excess: Callable[[Floats, Indices], Floats]) -> tuple[Floats, Floats]:
    """Narrow intervals to neighbouring numbers of double precision about the change of sign of `excess`.

    Parameters
    ----------
    low, high : array
        Ends of intervals.
    excess : callable
        ``excess(amplitudes, which)`` for intervals by their indices: negative or NaN at `low`, not negative at `high`.

    Returns
    -------
    low, high : array
        Neighbours: excess is negative or NaN at `low`, not negative at `high`.
    """
    from scipy.optimize import elementwise

    if not low.size:
        return low, high

    def finite(at: Floats, which: Indices) -> Floats:
        found = np.nan_to_num(excess(at, which), nan=-1.0, posinf=1e300)
        return np.where(found == 0.0, 1e-300, found)  # a root that is met exactly is not the end of the search

    tolerances = {"xatol": 0.0, "xrtol": 4.0 * np.finfo(np.float64).eps, "fatol": 0.0, "frtol": 0.0}
    found = elementwise.find_root(finite, (low, high), args=(np.arange(low.size),), tolerances=tolerances)
    below, above = found.bracket
    return bisected(below, above, lambda at, which: np.asarray(excess(at, which) >= 0.0))


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
