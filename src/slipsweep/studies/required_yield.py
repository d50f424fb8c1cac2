"""The yield acceleration at which Newmark's block moves a displacement, solved on the kernel.

u is continuous in the yield acceleration.  A block that slides downslope only moves less the
higher it is, and u/A depends on Üy/A alone: one scan of the motion serves all its blocks.  The
largest |u| of a block that slides both ways need not fall, so that the highest crossing of a scan
counts.  On a level base it scales likewise; on another every block is scanned.

The scan goes through x = ln(r/(1 − r)), r = Üy over the peak acceleration: near r = 1 and near
r = 0, ln u is a straight line over it.  The step of the scan that holds the displacement is
narrowed by secants of ln u until the displacement is met.
"""

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.grid import engine, threads
from slipsweep.grid.chunks import grid_chunks
from slipsweep.grid.engine import Request
from slipsweep.grid.inputs import Problem, grid_sizes
from slipsweep.grid.solvers import cost_of
from slipsweep.model.options import slides_both_ways
from slipsweep.model.variables import StrengthStatus
from slipsweep.motion.records import Record
from slipsweep.studies import limited_displacement

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Steps of the scan: of a cell that is solved fast, of a slow one, and of each block that slides
#: both ways.
_FINE_STEPS = 4096
_STEPS = 256
_BLOCK_STEPS = 128

#: Ends of the scan in x: r is then 1e-12, and 1 in double precision.
_LOWEST = math.log(1e-12)
_HIGHEST = 37.0

#: Part of the scan that has equal steps; beyond it ln u is a straight line or constant.
_EQUAL_FROM = -9.0
_EQUAL_TO = 14.0

#: Largest relative error of the displacement, and most evaluations: more than a bisection takes.
_TOLERANCE = 1e-12
_ROUNDING = 2.0**-51
_MOST_EVALUATIONS = 200

#: Cells that are solved together: their arrays stay in the cache.
_TOGETHER = 65536

#: Cells that are solved together where each may need a scan of its own, and bytes that this takes.
_SCANNED_TOGETHER = 4096
SCAN_MEMORY = 14 * 8 * _BLOCK_STEPS * _SCANNED_TOGETHER

#: A maximum of the scan above this part of the displacement may hide a higher one: the steps beside
#: it are cut into parts.
_NEAR = 0.8
_PARTS = 32


def yield_accelerations(request: Request) -> tuple[Floats, NDArray[np.int8]]:
    """Return the required Üy of a grid, m/s², and its `StrengthStatus`, with the grid's shape.

    `request.inputs` has the `displacement` in place of the strength.  Üy is 0 where every strength
    is enough, and NaN where none is.
    """
    dims = tuple(request.sizes)
    shape = tuple(request.sizes.values())
    strength = xr.Variable(dims, np.empty(shape))
    status = xr.Variable(dims, np.empty(shape, np.int8))
    for where, part in engine.motions(request):
        most = part.cells if _scales_with_amplitude(part) else _SCANNED_TOGETHER
        for chunk in grid_chunks(part.sizes, most):
            piece = part.part(chunk)
            piece_shape = tuple(piece.sizes.values())
            values, codes = _solve_part(piece)
            strength[chunk | where] = values.reshape(piece_shape)
            status[chunk | where] = codes.reshape(piece_shape)
            request.count(piece.cells)
    return strength.values, status.values


def _solve_part(part: Request) -> tuple[Floats, NDArray[np.int8]]:
    """Return Üy and status of the cells that one motion shakes, flat."""
    inputs = dict(part.inputs)
    displacement = inputs.pop("displacement")
    factor = xr.Variable((), 1.0) * engine.motion_factor(part.problem, inputs)
    seconds = engine.phase_seconds(part.problem, inputs)
    with np.errstate(divide="ignore"):  # a base that does not move
        target = displacement / seconds**2
        if _scales_with_amplitude(part):
            blocks = {}
            target = target / factor
        else:
            blocks = {"factor": factor}
            for name in ("theta", "upslope_yield_acceleration"):
                if name in inputs:
                    blocks[name] = inputs[name]
    sizes = grid_sizes(blocks)
    places = xr.Variable(
        tuple(sizes), np.arange(math.prod(sizes.values())).reshape([*sizes.values()])
    )
    scan = Scan(
        part.problem,
        float(inputs["polarity"].values.item()) if "polarity" in inputs else 1.0,
        {name: variable.set_dims(sizes).values.ravel() for name, variable in blocks.items()},
    )
    targets = target.set_dims(part.sizes).values.ravel()
    block = places.set_dims(part.sizes).values.ravel()
    ratio = np.empty(targets.size)
    status = np.empty(targets.size, np.int8)

    def work(cells: slice) -> None:
        ratio[cells], status[cells] = scan.required(block[cells], targets[cells])

    starts = range(0, targets.size, _TOGETHER)
    threads.spread([slice(start, start + _TOGETHER) for start in starts], work)
    factors = factor.set_dims(part.sizes).values.ravel()
    return ratio * factors * scan.peak, status


def _scales_with_amplitude(part: Request) -> bool:
    """Return True if u/A depends on Üy/A alone: one way, or both ways on a level base."""
    if not slides_both_ways(part.problem.model):
        return True
    if "upslope_yield_acceleration" in part.inputs:
        return False
    return not part.inputs["theta"].values.any()


@dataclass(frozen=True)
class Bracket:
    """Ends of the steps of a scan between which displacements are passed, by cell.

    u exceeds the target at `low`, and not at `high`; the differences are those of ln u from ln of
    the target.
    """

    low: Floats
    high: Floats
    low_difference: Floats
    high_difference: Floats


class Scan:
    """Displacements that one motion gives its blocks, over the yield acceleration, at unit time.

    `blocks` has the inputs by which the blocks differ.  If it is empty, there is one block, under
    the motion at unit strength.
    """

    def __init__(self, problem: Problem, polarity: float, blocks: dict[str, Floats]) -> None:
        self.problem = problem
        self.blocks = blocks
        self.both_ways = slides_both_ways(problem.model)
        self.motion: dict[str, xr.Variable] = {}
        if isinstance(record := problem.excitation, Record):
            self.motion = {
                "scale": xr.Variable((), 1.0),
                "time_scale": xr.Variable((), 1.0),
                "polarity": xr.Variable((), polarity),
            }
            signed = polarity * record.acceleration
            #: Largest acceleration that can move a block, at unit strength.
            self.peak = max(float((np.abs(signed) if self.both_ways else signed).max()), 0.0)
        else:
            self.motion = {
                "amplitude": xr.Variable((), 1.0),
                "frequency": xr.Variable((), 0.5 / math.pi),
            }
            self.peak = 1.0
        steps = _FINE_STEPS if cost_of(problem) == 1 else _STEPS
        if blocks:
            steps = _BLOCK_STEPS
        elif self.both_ways:
            self.motion["theta"] = xr.Variable((), 0.0)
        equal = np.linspace(_EQUAL_FROM, _EQUAL_TO, steps + 1)
        below = np.linspace(_LOWEST, _EQUAL_FROM, 4, endpoint=False)
        above = np.linspace(_HIGHEST, _EQUAL_TO, 4, endpoint=False)[::-1]
        self.xs = np.concatenate([below, equal, above])
        count = max((values.size for values in blocks.values()), default=1)
        block = np.repeat(np.arange(count), self.xs.size)
        #: Displacements, (block, step).
        self.displacements = self.displacement(block, np.tile(self.xs, count)).reshape(count, -1)
        with np.errstate(divide="ignore"):  # nothing slides at the end of the scan
            self.logs = np.log(self.displacements)
        #: The largest displacement at a place of the scan or above it.
        self.highest = np.maximum.accumulate(self.displacements[:, ::-1], axis=1)[:, ::-1]

    def displacement(self, block: Indices, x: Floats) -> Floats:
        """Return displacements at places x; of a block that slides both ways the largest |u|."""
        inputs = dict(self.motion)
        factor: Floats | float = 1.0
        for name, values in self.blocks.items():
            of_cells = xr.Variable("cell", values[block])
            if name == "factor":
                factor = of_cells.values
                name = "scale" if "scale" in inputs else "amplitude"
            inputs[name] = of_cells
        peak = factor * self.peak
        # where the base does not move a block, the yield acceleration does not matter
        onset = np.where(peak > 0.0, peak, 1.0) / (1.0 + np.exp(-x))
        inputs["yield_acceleration"] = xr.Variable("cell", onset)
        names = limited_displacement.results_of(self.problem.model)
        results = engine.solve(Request(self.problem, {"cell": x.size}, inputs, names))
        return limited_displacement.displacement_of(
            {name: of_cells.values for name, of_cells in results.items()}
        )

    def required(self, block: Indices, target: Floats) -> tuple[Floats, NDArray[np.int8]]:
        """Return the required r of cells (0: any, NaN: none), and their status."""
        passed = self._passed(block, target)
        status = np.full(target.size, StrengthStatus.SOLVED, np.int8)
        status[passed == 0] = StrengthStatus.ALWAYS_WITHIN
        status[passed == self.xs.size] = StrengthStatus.NEVER_WITHIN
        (cell,) = np.nonzero(status == StrengthStatus.SOLVED)
        ratio = np.where(status == StrengthStatus.ALWAYS_WITHIN, 0.0, math.nan)
        if self.both_ways:
            hidden, bracket = self._hidden(block, target, passed)
            status[hidden] = StrengthStatus.SOLVED
            ratio[hidden] = self._solved(block[hidden], target[hidden], bracket)
            cell = np.setdiff1d(cell, hidden)
        ratio[cell] = self._solved(
            block[cell], target[cell], self._step(block[cell], target[cell], passed[cell] - 1)
        )
        return ratio, status

    def _passed(self, block: Indices, target: Floats) -> Indices:
        """Return how many places of the scan lie below the highest crossing."""
        if not self.blocks:
            rising = self.highest[0, ::-1]
            return self.xs.size - np.searchsorted(rising, target, side="right")
        return np.asarray((self.highest[block] > target[:, np.newaxis]).sum(axis=1))

    def _step(self, block: Indices, target: Floats, step: Indices) -> Bracket:
        """Return the steps of the scan as brackets."""
        log_target = np.log(target)
        low_difference = self.logs[block, step] - log_target
        high_difference = self.logs[block, step + 1] - log_target
        return Bracket(self.xs[step], self.xs[step + 1], low_difference, high_difference)

    def _solved(self, block: Indices, target: Floats, bracket: Bracket) -> Floats:
        """Return r at which cells move their targets, by secants that stay within the brackets."""
        low = bracket.low.copy()
        high = bracket.high.copy()
        solution = high.copy()
        cell = np.arange(target.size)
        log_target = np.log(target)
        before = low
        before_difference = bracket.low_difference
        with np.errstate(invalid="ignore"):
            slope = (bracket.high_difference - before_difference) / (high - low)
            x = before - before_difference / slope
        for evaluation in range(_MOST_EVALUATIONS):
            # bisect where a secant leaves the bracket, and every eighth time: secants may approach
            # from one side only
            bisects = ~((x > low) & (x < high)) | (evaluation % 8 == 7)
            x = np.where(bisects, low + 0.5 * (high - low), x)
            with np.errstate(divide="ignore"):
                difference = np.log(self.displacement(block, x)) - log_target
            above = difference > 0.0
            ended = (x == low) | (x == high)
            low = np.where(above, x, low)
            high = np.where(above, high, x)
            # the rounding of r moves ln u by some of its last digits over 1 - r
            solved = np.abs(difference) <= _TOLERANCE + _ROUNDING * np.exp(x)
            solution[cell] = np.where(solved, x, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = difference * (x - before) / (difference - before_difference)
            (left,) = np.nonzero(~solved & ~ended)
            if not left.size:
                break
            before = x[left]
            before_difference = difference[left]
            x = before - step[left]
            low = low[left]
            high = high[left]
            cell = cell[left]
            block = block[left]
            log_target = log_target[left]
        return np.asarray(1.0 / (1.0 + np.exp(-solution)))

    def _hidden(self, block: Indices, target: Floats, passed: Indices) -> tuple[Indices, Bracket]:
        """Return cells that pass their displacement beside a maximum of the scan above `passed`."""
        inner = self.displacements[:, 1:-1]
        peaks = (inner > self.displacements[:, :-2]) & (inner >= self.displacements[:, 2:])
        near = peaks[block] & (inner[block] > _NEAR * target[:, np.newaxis])
        near &= np.arange(1, self.xs.size - 1) >= passed[:, np.newaxis]
        cell, peak = np.nonzero(near)
        # both steps beside a maximum, which is place peak + 1
        cell = np.repeat(cell, 2)
        step = np.stack([peak, peak + 1], axis=1).ravel()
        xs = np.linspace(self.xs[step], self.xs[step + 1], _PARTS + 1, axis=1)
        moved = self.displacement(np.repeat(block[cell], xs.shape[1]), xs.ravel())
        differences = moved.reshape(xs.shape) / target[cell, np.newaxis]
        exceeds = differences[:, :-1] > 1.0
        (which,) = np.nonzero(exceeds.any(axis=1))
        # the last part that begins above the target, of the last step that has one
        order = which[::-1]
        hidden, first = np.unique(cell[order], return_index=True)
        row = order[first]
        at = _PARTS - 1 - exceeds[row, ::-1].argmax(axis=1)
        with np.errstate(divide="ignore"):
            logs = np.log(np.stack([differences[row, at], differences[row, at + 1]]))
        return hidden, Bracket(xs[row, at], xs[row, at + 1], *logs)
