"""How a solver meets arrays, written once: cells gathered from axes, results spread over frequencies.

A grid has cells, one for each distinct motion, and for each cell a run of frequencies
that the scaling law u = W/ω², v = V/ω serves with a multiplication.  Inputs and results
are flat arrays with a stride for each dimension of the cells (0 where an input does not
vary), so that an axis is never copied out over the grid.
"""

from typing import NamedTuple

import numpy as np

from slipsweep.jit.cache import Kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels import cycle, record, sine, step
from slipsweep.kernels.block import FRICTION_ESTIMATED, TILE, UNSOLVED, Options, block_of, cell_of
from slipsweep.kernels.lanes import LANES_SIZE
from slipsweep.motion.pieces import Wave


class Grid(NamedTuple):
    """Layout of a grid: the shape of its cells, strides of inputs and results, and the frequencies.

    `strides` has a row for each of the seven fields of `Cell`, one for the periods
    1/ω and one for the results; its columns are the dimensions of the cells.
    """

    shape: np.ndarray
    strides: np.ndarray
    frequencies: int
    frequency_stride: int
    result_stride: int


class Results(NamedTuple):
    """Flat result arrays; one of size 0 is not wanted.  `unsolved` has one number, of a cell that was not solved.

    `codes` are those of rows of codes: sliding mode and validity, or the counts of a record and validity.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    codes: tuple[np.ndarray, ...]
    unsolved: np.ndarray


class Runs(NamedTuple):
    """Cells of a tile that follow each other along the last dimension: `count` runs, of which run r begins with
    cell `first[r]` (the last ends with cell `first[count] - 1`), at period `period[r]` and result `result[r]`.

    `at` and `position` are room for those of a cell along the dimensions and in the nine flat arrays.
    """

    first: np.ndarray
    period: np.ndarray
    result: np.ndarray
    at: np.ndarray
    position: np.ndarray


@scalar
def gather(grid: Grid, begin: int, count: int, inputs: tuple[np.ndarray, ...], cells: np.ndarray, runs: Runs) -> int:
    """Fill `cells` (7 rows of a tile) and `runs` for `count` cells of a grid from `begin` on; the number of runs."""
    dimensions = grid.shape.size
    index, position = runs.at, runs.position
    rest = begin
    for axis in range(dimensions - 1, -1, -1):
        index[axis] = rest % grid.shape[axis]
        rest //= grid.shape[axis]
    for row in range(9):
        position[row] = 0
        for axis in range(dimensions):
            position[row] += index[axis] * grid.strides[row, axis]
    last = dimensions - 1
    done, found = 0, 0
    while done < count:
        run = min(count - done, grid.shape[last] - index[last])
        for row in range(7):
            values, at, stride = inputs[row], position[row], grid.strides[row, last]
            # by loops: an assignment to a slice brings 30 functions of numba's, 2 s of the first compilation
            target = cells[row * TILE + done : row * TILE + done + run]
            if stride == 0:
                value = values[at]
                for j in range(run):
                    target[j] = value
            else:
                source = values[at : at + (run - 1) * stride + 1]
                for j in range(run):
                    target[j] = source[j * stride]
        runs.first[found], runs.period[found], runs.result[found] = done, position[7], position[8]
        found += 1
        done += run
        # carry to the next run along the last dimension
        for row in range(9):
            position[row] += run * grid.strides[row, last]
        index[last] += run
        axis = last
        while axis > 0 and index[axis] == grid.shape[axis]:
            for row in range(9):
                position[row] += grid.strides[row, axis - 1] - index[axis] * grid.strides[row, axis]
            index[axis] = 0
            index[axis - 1] += 1
            axis -= 1
    runs.first[found] = count
    return found


@scalar
def empty_runs(grid: Grid) -> Runs:
    """Room for the runs of a tile."""
    return Runs(
        np.empty(TILE + 1, np.int64), np.empty(TILE, np.int64), np.empty(TILE, np.int64),
        np.empty(grid.shape.size, np.int64), np.empty(9, np.int64),
    )  # fmt: skip


@scalar
def place_of(grid: Grid, runs: Runs, run: int, j: int) -> int:
    """Where the result of cell j of a tile stands, which lies in a run."""
    return runs.result[run] + (j - runs.first[run]) * grid.strides[8, -1]


@scalar
def scatter(grid: Grid, runs: Runs, count: int, periods: np.ndarray, motion: np.ndarray, results: Results) -> None:
    """Spread the solved cells of `count` runs over their frequencies: u = W/ω², v = V/ω (the scaling law).

    Rows of codes are spread one by one (`spread_codes`), as the arrays they go to have types of their own.
    """
    frequencies, step, stride = grid.frequencies, grid.frequency_stride, grid.result_stride
    period_stride, cell_stride = grid.strides[7, -1], grid.strides[8, -1]
    for run in range(count):
        begin, end = runs.first[run], runs.first[run + 1]
        period, result = runs.period[run], runs.result[run]
        if results.displacement.size and frequencies == 1 and period_stride == 0 and cell_stride == 1:
            # slices, which numba knows to begin at 0: a loop in SIMD
            moved, target = motion[0, begin:end], results.displacement[result : result + end - begin]
            scale = periods[period] * periods[period]
            for j in range(end - begin):
                target[j] = moved[j] * scale
        elif results.displacement.size:
            for j in range(end - begin):
                w, from_, to = motion[0, begin + j], period + j * period_stride, result + j * cell_stride
                if step == 1 and stride == 1:
                    seconds, target = periods[from_ : from_ + frequencies], results.displacement[to : to + frequencies]
                    for k in range(frequencies):
                        target[k] = w * (seconds[k] * seconds[k])
                else:
                    for k in range(frequencies):
                        second = periods[from_ + k * step]
                        results.displacement[to + k * stride] = w * (second * second)
        if results.velocity.size:
            for j in range(end - begin):
                v, from_, to = motion[1, begin + j], period + j * period_stride, result + j * cell_stride
                if step == 1 and stride == 1:
                    seconds, target = periods[from_ : from_ + frequencies], results.velocity[to : to + frequencies]
                    for k in range(frequencies):
                        target[k] = v * seconds[k]
                else:
                    for k in range(frequencies):
                        results.velocity[to + k * stride] = v * periods[from_ + k * step]


@scalar
def spread_codes(grid: Grid, runs: Runs, count: int, codes: np.ndarray, target: np.ndarray) -> None:
    """Spread a row of codes of `count` runs over their frequencies."""
    cell_stride = grid.strides[8, -1]
    for run in range(count if target.size else 0):
        begin, end, result = runs.first[run], runs.first[run + 1], runs.result[run]
        for j in range(end - begin):
            for k in range(grid.frequencies):
                target[result + j * cell_stride + k * grid.result_stride] = codes[begin + j]


@scalar
def note_unsolved(begin: int, count: int, validity: np.ndarray, results: Results) -> None:
    """Note a cell in which an event was not found (`events`), if there is one."""
    for j in range(count):
        if validity[j] & UNSOLVED:
            results.unsolved[0] = begin + j


def _sine_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    results: Results, rest: np.ndarray,
) -> int:  # fmt: skip
    cells, runs = np.empty(7 * TILE), empty_runs(grid)
    motion, codes = np.empty((2, TILE)), np.empty((2, TILE), np.int64)
    room = sine.Room(
        np.empty(sine.BLOCKS_SIZE), np.empty(LANES_SIZE), np.empty(TILE + 1, np.int64), np.empty(TILE, np.int64),
        np.empty(TILE, np.bool_),
    )  # fmt: skip
    stretches = 0
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        found = gather(grid, begin, count, inputs, cells, runs)
        others = sine.solve_cells(cells, count, options, room, motion, codes)
        scatter(grid, runs, found, periods, motion, results)
        spread_codes(grid, runs, found, codes[0], results.codes[0])
        spread_codes(grid, runs, found, codes[1], results.codes[1])
        for j in range(count if others > 0 else 0):
            if room.left[j] and stretches > 0 and rest[stretches - 1, 1] == begin + j:
                rest[stretches - 1, 1] += 1
            elif room.left[j]:
                rest[stretches, 0], rest[stretches, 1] = begin + j, begin + j + 1
                stretches += 1
    return stretches


def _wave_grid(
    grid: Grid, stretches: np.ndarray, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, results: Results,
) -> None:  # fmt: skip
    cells, runs = np.empty(7 * TILE), empty_runs(grid)
    motion, codes = np.empty((2, TILE)), np.empty((2, TILE), np.int64)
    room = cycle.room_for(0)
    for stretch in range(stretches.shape[0]):
        last = stretches[stretch, 1]
        for begin in range(stretches[stretch, 0], last, TILE):
            count = min(TILE, last - begin)
            found = gather(grid, begin, count, inputs, cells, runs)
            cycle.solve_cells(cells, count, options, wave, room, motion, codes)
            note_unsolved(begin, count, codes[1], results)
            scatter(grid, runs, found, periods, motion, results)
            spread_codes(grid, runs, found, codes[0], results.codes[0])
            spread_codes(grid, runs, found, codes[1], results.codes[1])


def _record_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, results: Results,
) -> None:  # fmt: skip
    cells, runs = np.empty(7 * TILE), empty_runs(grid)
    motion, codes = np.empty((2, TILE)), np.empty((4, TILE), np.int64)
    room = cycle.room_for(0)
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        found = gather(grid, begin, count, inputs, cells, runs)
        record.solve_cells(cells, count, options, wave, room, motion, codes)
        scatter(grid, runs, found, periods, motion, results)
        spread_codes(grid, runs, found, codes[0], results.codes[0])
        spread_codes(grid, runs, found, codes[1], results.codes[1])
        spread_codes(grid, runs, found, codes[2], results.codes[2])
        spread_codes(grid, runs, found, codes[3], results.codes[3])
        note_unsolved(begin, count, codes[3], results)


def _step_grid_of(rule: int) -> Kernel:
    # a kernel a rule, so that only the one in use is compiled
    def step_grid(
        grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
        steps: step.Steps, results: Results,
    ) -> None:  # fmt: skip
        cells, runs = np.empty(7 * TILE), empty_runs(grid)
        motion, codes = np.empty((2, TILE)), np.empty((2, TILE), np.int64)
        for begin in range(first, last, TILE):
            count = min(TILE, last - begin)
            found = gather(grid, begin, count, inputs, cells, runs)
            step.solve_cells(cells, count, rule, options, steps, motion, codes)
            note_unsolved(begin, count, codes[1], results)
            scatter(grid, runs, found, periods, motion, results)
            spread_codes(grid, runs, found, codes[0], results.codes[0])
            spread_codes(grid, runs, found, codes[1], results.codes[1])

    return Kernel(step_grid)


#: Kernels of the stepping solver by its rule; of the cycle solver for any waveform, for stretches of cells
#: (rows: the first, and the first after it); and its short way for the sine, which leaves some cells to that: their
#: number of stretches is returned, and `rest` holds them.  Most sweeps of a sine leave none, and a third of
#: the first compilation is spared.
STEP_KERNELS = {rule: _step_grid_of(rule) for rule in (step.RECTANGLE, step.TRAPEZOID, step.SIMPSON)}
WAVE_KERNEL = Kernel(_wave_grid)
CYCLE_KERNEL = Kernel(_sine_grid)

#: Of records: each pulse with its own peak, and counts of slips and pulses in place of the sliding mode.
RECORD_KERNEL = Kernel(_record_grid)


def _parameter_grid(
    grid: Grid,
    first: int,
    last: int,
    inputs: tuple[np.ndarray, ...],
    options: Options,
    parameters: np.ndarray,
    mode: np.ndarray,
    validity: np.ndarray,
) -> None:
    cells, runs = np.empty(7 * TILE), empty_runs(grid)
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        found = gather(grid, begin, count, inputs, cells, runs)
        for run in range(found):
            for j in range(runs.first[run], runs.first[run + 1]):
                block = block_of(cell_of(cells, j), options.rise, options.g)
                place = place_of(grid, runs, run, j)
                parameters[0, place] = block.yield_acceleration
                parameters[1, place] = block.limiting_acceleration
                parameters[2, place] = block.acceleration_ratio
                parameters[3, place] = block.minimum_friction
                parameters[4, place] = block.delta_mu
                parameters[5, place] = block.decay_rate
                mode[place] = block.sliding_mode
                validity[place] = block.validity & ~FRICTION_ESTIMATED  # known only with the motion


#: Friction parameters of every cell (rows as in `variables.FRICTION_PARAMETERS`).
parameter_grid = Kernel(_parameter_grid)
