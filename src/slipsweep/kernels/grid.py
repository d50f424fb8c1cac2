"""How a solver meets arrays, written once: cells gathered from axes, results spread over frequencies.

A grid has cells, one for each distinct motion, and for each cell a run of frequencies
that the scaling law u = W/ω², v = V/ω serves with a multiplication.  Inputs and results
are flat arrays with a stride for each dimension of the cells (0 where an input does not
vary), so that an axis is never copied out over the grid.
"""

from typing import Any, NamedTuple

import numpy as np

from slipsweep.jit.cache import Handed, Kernel
from slipsweep.jit.decorators import scalar
from slipsweep.jit.handed import call
from slipsweep.kernels import newmark, record
from slipsweep.kernels.block import FRICTION_ESTIMATED, TILE, UNSOLVED, Options, cell_of, decay_rate_of, interface_of
from slipsweep.kernels.cycle import cells as cycle
from slipsweep.kernels.cycle.legs import longest_cycle, room_of
from slipsweep.kernels.sine import cells as sine
from slipsweep.kernels.sine import cosine
from slipsweep.kernels.sine import newmark as sine_newmark
from slipsweep.kernels.step import cells as step
from slipsweep.kernels.step import lanes as step_lanes
from slipsweep.kernels.step.table import Steps
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


class Tile(NamedTuple):
    """Room for the cells of a tile: `cells` (7 rows, the fields of `Cell`), and their `motion` and `codes`.

    Cells that follow each other along the last dimension of the grid are a run: run r begins with cell `first[r]`
    of the tile (the last ends with cell `first[count] - 1`), at period `period[r]` and result `result[r]`.
    `at` and `position` are room for the indices of a cell along the dimensions and in the nine flat arrays.
    """

    cells: np.ndarray
    motion: np.ndarray
    codes: np.ndarray
    first: np.ndarray
    period: np.ndarray
    result: np.ndarray
    at: np.ndarray
    position: np.ndarray


def tile_of(grid: Grid) -> Tile:
    """Room for a tile of a grid; made here, for each function that makes arrays costs a kernel's compilation much."""
    integers = [np.empty(size, np.int64) for size in (TILE + 1, TILE, TILE, grid.shape.size, 9)]
    return Tile(np.empty(7 * TILE), np.empty((2, TILE)), np.empty((4, TILE), np.int64), *integers)


@scalar
def gather(grid: Grid, begin: int, count: int, inputs: tuple[np.ndarray, ...], tile: Tile) -> int:
    """Fill a tile with `count` cells of a grid from `begin` on; the number of runs."""
    dimensions = grid.shape.size
    index, position = tile.at, tile.position
    remaining = begin
    for axis in range(dimensions - 1, -1, -1):
        index[axis] = remaining % grid.shape[axis]
        remaining //= grid.shape[axis]
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
            target = tile.cells[row * TILE + done : row * TILE + done + run]
            if stride == 0:
                value = values[at]
                for j in range(run):
                    target[j] = value
            else:
                source = values[at : at + (run - 1) * stride + 1]
                for j in range(run):
                    target[j] = source[j * stride]
        tile.first[found], tile.period[found], tile.result[found] = done, position[7], position[8]
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
    tile.first[found] = count
    return found


@scalar
def scatter(grid: Grid, tile: Tile, count: int, row: int, periods: np.ndarray, target: np.ndarray) -> None:
    """Spread a row of motion of `count` runs over their frequencies: u = W/ω², row 0, or v = V/ω (the scaling law)."""
    frequencies, step, stride = grid.frequencies, grid.frequency_stride, grid.result_stride
    period_stride, cell_stride = grid.strides[7, -1], grid.strides[8, -1]
    for run in range(count if target.size else 0):
        begin, end = tile.first[run], tile.first[run + 1]
        period, result = tile.period[run], tile.result[run]
        if frequencies == 1 and period_stride == 0 and cell_stride == 1:
            # slices, which numba knows to begin at 0: a loop in SIMD
            moved, found = tile.motion[row, begin:end], target[result : result + end - begin]
            scale = periods[period] if row else periods[period] * periods[period]
            for j in range(end - begin):
                found[j] = moved[j] * scale
        else:
            for j in range(end - begin):
                moved_j, from_, to = tile.motion[row, begin + j], period + j * period_stride, result + j * cell_stride
                if step == 1 and stride == 1:
                    seconds, found = periods[from_ : from_ + frequencies], target[to : to + frequencies]
                    for k in range(frequencies):
                        found[k] = moved_j * (seconds[k] if row else seconds[k] * seconds[k])
                else:
                    for k in range(frequencies):
                        second = periods[from_ + k * step]
                        target[to + k * stride] = moved_j * (second if row else second * second)


@scalar
def spread_codes(grid: Grid, tile: Tile, count: int, row: int, target: np.ndarray) -> None:
    """Spread a row of codes of `count` runs over their frequencies."""
    frequencies, stride, cell_stride = grid.frequencies, grid.result_stride, grid.strides[8, -1]
    for run in range(count if target.size else 0):
        begin, end, result = tile.first[run], tile.first[run + 1], tile.result[run]
        if frequencies == 1 and cell_stride == 1:
            codes, found = tile.codes[row, begin:end], target[result : result + end - begin]
            for j in range(end - begin):
                found[j] = codes[j]
        else:
            for j in range(end - begin):
                code, to = tile.codes[row, begin + j], result + j * cell_stride
                if stride == 1:
                    found = target[to : to + frequencies]
                    for k in range(frequencies):
                        found[k] = code
                else:
                    for k in range(frequencies):
                        target[to + k * stride] = code


@scalar
def spread(grid: Grid, tile: Tile, count: int, periods: np.ndarray, results: Results) -> None:
    """Spread W, V, mode and validity of `count` runs."""
    scatter(grid, tile, count, 0, periods, results.displacement)
    scatter(grid, tile, count, 1, periods, results.velocity)
    spread_codes(grid, tile, count, 0, results.codes[0])
    spread_codes(grid, tile, count, 1, results.codes[1])


@scalar
def note_unsolved(begin: int, count: int, validity: np.ndarray, results: Results) -> None:
    """Note a cell in which an event was not found (`events`), if there is one."""
    for j in range(count):
        if validity[j] & UNSOLVED:
            results.unsolved[0] = begin + j


def _sine_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    results: Results, tile: Tile, room: sine.Room, remaining: np.ndarray, solve: int,
) -> int:  # fmt: skip
    # `solve` is the address of a `sine.Solver`
    stretches = 0
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        runs = gather(grid, begin, count, inputs, tile)
        count_remaining = call(solve, tile.cells, count, options, room, tile.motion, tile.codes)
        spread(grid, tile, runs, periods, results)
        for j in range(count if count_remaining > 0 else 0):
            if room.remaining[j] and stretches > 0 and remaining[stretches - 1, 1] == begin + j:
                remaining[stretches - 1, 1] += 1
            elif room.remaining[j]:
                remaining[stretches, 0], remaining[stretches, 1] = begin + j, begin + j + 1
                stretches += 1
    return stretches


@scalar
def place(grid: Grid, begin: int, count: int, runs: int, periods: np.ndarray, results: Results, tile: Tile) -> None:
    """Place the results of a tile of cells from `begin` on, which lie in `runs`: W, V, mode and validity."""
    note_unsolved(begin, count, tile.codes[1], results)
    spread(grid, tile, runs, periods, results)


def _remaining_grid(
    grid: Grid, stretches: np.ndarray, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, results: Results, tile: Tile,
) -> None:  # fmt: skip
    room = room_of(0, longest_cycle(wave), wave.height.size)
    for stretch in range(stretches.shape[0]):
        last = stretches[stretch, 1]
        for begin in range(stretches[stretch, 0], last, TILE):
            count = min(TILE, last - begin)
            runs = gather(grid, begin, count, inputs, tile)
            sine.solve_remaining(tile.cells, count, options, wave, room, tile.motion, tile.codes)
            place(grid, begin, count, runs, periods, results, tile)


def _wave_grid(
    grid: Grid, stretches: np.ndarray, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, results: Results, tile: Tile,
) -> None:  # fmt: skip
    room = room_of(0, longest_cycle(wave), wave.height.size)
    for stretch in range(stretches.shape[0]):
        last = stretches[stretch, 1]
        for begin in range(stretches[stretch, 0], last, TILE):
            count = min(TILE, last - begin)
            runs = gather(grid, begin, count, inputs, tile)
            cycle.solve_cells(tile.cells, count, options, wave, room, tile.motion, tile.codes)
            place(grid, begin, count, runs, periods, results, tile)


@scalar
def place_recorded(
    grid: Grid, begin: int, count: int, runs: int, periods: np.ndarray, results: Results, tile: Tile
) -> None:
    """Place the results of a tile of cells under a record: W, V, three counts and validity."""
    note_unsolved(begin, count, tile.codes[3], results)
    scatter(grid, tile, runs, 0, periods, results.displacement)
    scatter(grid, tile, runs, 1, periods, results.velocity)
    spread_codes(grid, tile, runs, 0, results.codes[0])
    spread_codes(grid, tile, runs, 1, results.codes[1])
    spread_codes(grid, tile, runs, 2, results.codes[2])
    spread_codes(grid, tile, runs, 3, results.codes[3])


def _record_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, own: newmark.Record, results: Results, tile: Tile,
) -> None:  # fmt: skip
    room = room_of(0, 0, 0)  # pulses only
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        runs = gather(grid, begin, count, inputs, tile)
        record.solve_cells(tile.cells, count, options, wave, own, room, tile.motion, tile.codes)
        place_recorded(grid, begin, count, runs, periods, results, tile)


def _newmark_record_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    wave: Wave, own: newmark.Record, results: Results, tile: Tile, lanes: newmark.Room,
) -> None:  # fmt: skip
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        runs = gather(grid, begin, count, inputs, tile)
        newmark.solve_cells(tile.cells, count, options, wave, own, lanes, tile.motion, tile.codes)
        place_recorded(grid, begin, count, runs, periods, results, tile)


def _step_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], periods: np.ndarray, options: Options,
    steps: Steps, results: Results, tile: Tile,
) -> None:  # fmt: skip
    room = step_lanes.room_of(steps)
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        runs = gather(grid, begin, count, inputs, tile)
        step.solve_cells(tile.cells, count, options, room, tile.motion, tile.codes)
        place(grid, begin, count, runs, periods, results, tile)


def _given_to_tiles(grid: Grid, first: int, *others: Any) -> tuple[Any, ...]:
    """Of the arguments of `_sine_grid`, those of a `sine.Solver`; a number stands for another."""
    _, _, _, options, _, tile, room, _ = others
    return tile.cells, first, options, room, tile.motion, tile.codes


#: Kernels of the stepping solver; of the cycle solver for any waveform, from one cell up to another of each stretch;
#: its short ways for plain waves, which leave some cells: the number of their stretches is returned,
#: and `remaining` holds them (rows: the first cell, and the first after it); what solves those of the sine (most
#: sweeps leave none, and half the first compilation is spared; those of the others are as of any wave); and
#: what solves Newmark's block under a sine, which leaves none.
STEP_KERNEL = Kernel(_step_grid)
WAVE_KERNEL = Kernel(_wave_grid)
_OVER_TILES = Kernel(_sine_grid)
SINE_KERNEL = Handed(_OVER_TILES, sine.solve_under_sine, _given_to_tiles)
COSINE_KERNEL = Handed(_OVER_TILES, cosine.solve_under_cosine, _given_to_tiles)
TRIANGLE_KERNEL = Handed(_OVER_TILES, sine.solve_under_triangle, _given_to_tiles)
SQUARE_KERNEL = Handed(_OVER_TILES, sine.solve_under_square, _given_to_tiles)
REMAINING_KERNEL = Kernel(_remaining_grid)
NEWMARK_SINE_KERNEL = Handed(_OVER_TILES, sine_newmark.solve_newmark_under_sine, _given_to_tiles)

#: Of records: each pulse with its own peak, and counts of slips and pulses in place of the sliding mode; and of
#: Newmark's block, whose first use takes 5 s of processor to compile, the other 19.
RECORD_KERNEL = Kernel(_record_grid)
NEWMARK_RECORD_KERNEL = Kernel(_newmark_record_grid)


def _parameter_grid(
    grid: Grid,
    first: int,
    last: int,
    inputs: tuple[np.ndarray, ...],
    options: Options,
    tile: Tile,
    parameters: np.ndarray,
    mode: np.ndarray,
    validity: np.ndarray,
) -> None:
    for begin in range(first, last, TILE):
        count = min(TILE, last - begin)
        gather(grid, begin, count, inputs, tile)
        end = begin + count
        # row by row: of a block of rows numba does not know that they are contiguous, and takes three times as long
        onset, limit, ratio = parameters[0, begin:end], parameters[1, begin:end], parameters[2, begin:end]
        least, drop, decay = parameters[3, begin:end], parameters[4, begin:end], parameters[5, begin:end]
        for j in range(count):
            onset[j], limit[j], ratio[j], least[j], drop[j], tile.codes[0, j], tile.codes[1, j] = interface_of(
                cell_of(tile.cells, j), options.rise, options.g
            )
        for j in range(count):
            decay[j] = decay_rate_of(cell_of(tile.cells, j), drop[j], least[j], options.g)
        for j in range(count):
            mode[begin + j] = tile.codes[0, j]
            validity[begin + j] = tile.codes[1, j] & ~FRICTION_ESTIMATED  # known only with the motion


#: Friction parameters of every cell (rows as in `variables.FRICTION_PARAMETERS`).
PARAMETER_KERNEL = Kernel(_parameter_grid)
