"""How a solver meets arrays, written once: cells gathered from axes, results spread over frequencies.

A grid has cells, one for each distinct motion, and for each cell a run of frequencies
that the scaling law u = W/ω², v = V/ω serves with a multiplication.  Inputs and results
are flat arrays with a stride for each dimension of the cells (0 where an input does not
vary), so that an axis is never copied out over the grid.
"""

from typing import NamedTuple

import numpy as np

from slipsweep.compiled import Kernel
from slipsweep.kernels import cycle, sine, step
from slipsweep.kernels.block import TILE, Options, block_of, cell_of
from slipsweep.kernels.excitation import Wave
from slipsweep.kernels.jit import scalar


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
    """Flat result arrays; one of size 0 is not wanted."""

    displacement: np.ndarray
    velocity: np.ndarray
    mode: np.ndarray
    validity: np.ndarray


@scalar
def gather(
    grid: Grid, first: int, count: int, inputs: tuple[np.ndarray, ...], cells: np.ndarray, offsets: np.ndarray
) -> None:
    """Fill `cells` (7 rows of a tile) and the offsets of 1/ω and of the results for `count` cells from `first` on."""
    dimensions = grid.shape.size
    index = np.empty(dimensions, np.int64)
    rest = first
    for axis in range(dimensions - 1, -1, -1):
        index[axis] = rest % grid.shape[axis]
        rest //= grid.shape[axis]
    position = np.zeros(9, np.int64)
    for row in range(9):
        for axis in range(dimensions):
            position[row] += index[axis] * grid.strides[row, axis]
    last = dimensions - 1
    done = 0
    while done < count:
        run = min(count - done, grid.shape[last] - index[last])
        for row in range(7):
            values, at, stride = inputs[row], position[row], grid.strides[row, last]
            to = row * TILE + done
            if stride == 0:
                cells[to : to + run] = values[at]
            elif stride == 1:
                cells[to : to + run] = values[at : at + run]
            else:
                for j in range(run):
                    cells[to + j] = values[at + j * stride]
        for row in range(2):
            at, stride = position[7 + row], grid.strides[7 + row, last]
            for j in range(run):
                offsets[row, done + j] = at + j * stride
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


@scalar
def scatter(
    grid: Grid,
    count: int,
    offsets: np.ndarray,
    periods: np.ndarray,
    motion: np.ndarray,
    codes: np.ndarray,
    results: Results,
) -> None:
    """Spread the solved cells over their frequencies: u = W/ω², v = V/ω (the scaling law)."""
    step, stride = grid.frequency_stride, grid.result_stride
    if results.displacement.size and grid.frequencies == 1:
        for j in range(count):
            period = periods[offsets[0, j]]
            results.displacement[offsets[1, j]] = motion[0, j] * (period * period)
    elif results.displacement.size:
        for j in range(count):
            at_period, at, w = offsets[0, j], offsets[1, j], motion[0, j]
            for k in range(grid.frequencies):
                period = periods[at_period + k * step]
                results.displacement[at + k * stride] = w * (period * period)
    if results.velocity.size:
        for j in range(count):
            at_period, at, v = offsets[0, j], offsets[1, j], motion[1, j]
            for k in range(grid.frequencies):
                results.velocity[at + k * stride] = v * periods[at_period + k * step]
    if results.mode.size:
        for j in range(count):
            for k in range(grid.frequencies):
                results.mode[offsets[1, j] + k * stride] = codes[0, j]
    if results.validity.size:
        for j in range(count):
            for k in range(grid.frequencies):
                results.validity[offsets[1, j] + k * stride] = codes[1, j]


def _sine_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, results: Results,
) -> None:  # fmt: skip
    cells, offsets = np.empty(7 * TILE), np.empty((2, TILE), np.int64)
    motion, codes = np.empty((2, TILE)), np.empty((2, TILE), np.int64)
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        gather(grid, begin, count, inputs, cells, offsets)
        sine.solve_cells(cells, count, options, wave, motion, codes)
        scatter(grid, count, offsets, periods, motion, codes, results)


def _wave_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, results: Results,
) -> None:  # fmt: skip
    cells, offsets = np.empty(7 * TILE), np.empty((2, TILE), np.int64)
    motion, codes = np.empty((2, TILE)), np.empty((2, TILE), np.int64)
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        gather(grid, begin, count, inputs, cells, offsets)
        cycle.solve_cells(cells, count, options, wave, motion, codes)
        scatter(grid, count, offsets, periods, motion, codes, results)


def _step_grid_of(rule: int) -> Kernel:
    # a kernel a rule, so that only the one in use is compiled
    def step_grid(
        grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
        steps: step.Steps, results: Results,
    ) -> None:  # fmt: skip
        cells, offsets = np.empty(7 * TILE), np.empty((2, TILE), np.int64)
        motion, codes = np.empty((2, TILE)), np.empty((2, TILE), np.int64)
        for begin in range(first, last, TILE):
            count = min(TILE, last - begin)
            gather(grid, begin, count, inputs, cells, offsets)
            step.solve_cells(cells, count, rule, options, steps, motion, codes)
            scatter(grid, count, offsets, periods, motion, codes, results)

    return Kernel(step_grid)


#: Kernels of the stepping solver by its rule; of the cycle solver for any waveform; and its short way for the sine.
STEP_KERNELS = {rule: _step_grid_of(rule) for rule in (step.RECTANGLE, step.TRAPEZOID, step.SIMPSON)}
WAVE_KERNEL = Kernel(_wave_grid)
CYCLE_KERNEL = Kernel(_sine_grid)


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
    cells = np.empty(7 * TILE)
    offsets = np.empty((2, TILE), np.int64)
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        gather(grid, begin, count, inputs, cells, offsets)
        for j in range(count):
            block = block_of(cell_of(cells, j), options.rise, options.g)
            place = offsets[1, j]
            parameters[0, place] = block.yield_acceleration
            parameters[1, place] = block.limiting_acceleration
            parameters[2, place] = block.acceleration_ratio
            parameters[3, place] = block.minimum_friction
            parameters[4, place] = block.delta_mu
            parameters[5, place] = block.decay_rate
            mode[place] = block.sliding_mode
            validity[place] = block.validity


#: Friction parameters of every cell (rows as in `variables.FRICTION_PARAMETERS`).
parameter_grid = Kernel(_parameter_grid)
