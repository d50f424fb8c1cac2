"""Arrays in, arrays out: the sweep without labels.

Knows numpy and the kernels; no xarray, no files.  Every input is an array that broadcasts
to the shape of the result; a dimension along which only the frequency varies is served
by the scaling law and costs no kernel call.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipsweep import threads
from slipsweep.kernels import block as physics
from slipsweep.kernels import step
from slipsweep.kernels.block import Cell, Options
from slipsweep.kernels.grid import CYCLE_KERNEL, STEP_KERNELS, Grid, Results, parameter_grid
from slipsweep.variables import FRICTION_PARAMETERS, RESULT_DTYPES, Validity

RULES = {"rectangle": step.RECTANGLE, "trapezoid": step.TRAPEZOID, "simpson": step.SIMPSON}
RISES = {"monotone": physics.MONOTONE, "literal": physics.LITERAL}
RECOUPLINGS = {"eq12": physics.EQ12, "integrate": physics.INTEGRATE}

#: Results that come out of a kernel, in the order of `grid.Results`.
MOTION_RESULTS = ("permanent_displacement", "peak_relative_velocity", "sliding_mode", "validity")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """What all cells of a grid share: the options of `slipsweep.sweep`, checked."""

    model: str
    rise: str
    recoupling: str
    cycles: int
    solver: str
    rule: str
    steps_per_cycle: int
    g: float

    def options(self, wants_peak: bool) -> Options:
        """The options as the kernels want them."""
        newmark = self.model == "newmark"
        return Options(
            rise=physics.NEWMARK if newmark else RISES[self.rise],
            recoupling=physics.INTEGRATE if newmark else RECOUPLINGS[self.recoupling],
            cycles=self.cycles,
            rule=RULES[self.rule],
            steps_per_cycle=self.steps_per_cycle,
            wants_peak=wants_peak,
            g=self.g,
        )


def solver_of(problem: Problem) -> str:
    """The solver that a problem is given to: "auto" takes "cycle", faster and exact to rounding for every sine."""
    return "cycle" if problem.solver == "auto" else problem.solver


def cell_inputs(arrays: Mapping[str, Array], dimensions: int) -> list[Array]:
    """The seven fields of `Cell` as arrays of `dimensions` dimensions; what is not given is NaN."""
    inputs = []
    for name in Cell._fields:
        source = arrays.get("theta" if name == "tan_theta" else name)
        values = np.full((1,) * dimensions, math.nan) if source is None else np.asarray(source, np.float64)
        inputs.append(np.tan(np.radians(values)) if name == "tan_theta" else values)
    return inputs


def scaled_dimension(shape: tuple[int, ...], inputs: list[Array], frequency: Array) -> int | None:
    """The longest dimension along which the frequency varies and no other input does."""
    only = [
        axis
        for axis in range(len(shape))
        if frequency.shape[axis] > 1 and all(values.shape[axis] == 1 for values in inputs)
    ]
    return max(only, key=lambda axis: shape[axis]) if only else None


def cells_to_solve(shape: tuple[int, ...], inputs: list[Array], frequency: Array) -> int:
    """Number of cells a kernel solves for a grid: all, but for the dimension that the scaling law serves."""
    scaled = scaled_dimension(shape, inputs, frequency)
    return math.prod(size for axis, size in enumerate(shape) if axis != scaled)


def solve(
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    frequency: Array,
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
) -> dict[str, NDArray[np.generic]]:
    """Solve a grid.

    Parameters
    ----------
    problem : Problem
        Options common to all cells.
    shape : tuple of int
        Shape of the results.
    arrays : mapping of str to array or None
        `theta` (degrees), `mu_s`, `amplitude` and the optional parameters, each with as
        many dimensions as `shape`, of length 1 where it does not vary.
    frequency : array
        Hz, likewise.
    wanted : tuple of str
        Names from `MOTION_RESULTS`; nothing else is computed.
    progress : callable, optional
        Called with a number of result cells as they are finished, from any thread.

    Returns
    -------
    dict of str to ndarray
        Arrays of `shape`, float64, but for the codes (`variables.RESULT_DTYPES`).
    """
    inputs = cell_inputs(arrays, len(shape))
    scaled = scaled_dimension(shape, inputs, frequency)
    results = {name: np.empty(shape, RESULT_DTYPES.get(name, "float64")) for name in wanted}
    grid = _layout(shape, scaled, [*inputs, frequency])
    targets = Results(
        *(results.get(name, np.empty(0, RESULT_DTYPES.get(name, "float64"))).reshape(-1) for name in MOTION_RESULTS)
    )
    periods = np.ascontiguousarray(1.0 / (2.0 * math.pi * np.asarray(frequency, np.float64))).reshape(-1)
    flat = tuple(np.array(values, np.float64).reshape(-1) for values in inputs)
    options = problem.options("peak_relative_velocity" in wanted)
    if solver_of(problem) == "step":
        kernel, table = STEP_KERNELS[options.rule], step.sine_table(problem.steps_per_cycle)
    else:
        kernel, table = CYCLE_KERNEL, np.empty(0)

    def work(first: int, last: int) -> None:
        kernel(grid, first, last, flat, periods, options, table, targets)
        if progress is not None:
            progress((last - first) * grid.frequencies)

    if math.prod(shape):
        threads.spread(math.prod(int(size) for size in grid.shape), work)
    return results


def friction_parameters(
    problem: Problem, shape: tuple[int, ...], arrays: Mapping[str, Array]
) -> dict[str, NDArray[np.generic]]:
    """Eqs. 7-11 and λ of every cell, with `sliding_mode` and the validity known before the motion.

    `shape` and `arrays` as in `solve`.
    """
    inputs = cell_inputs(arrays, len(shape))
    grid = _layout(shape, None, [*inputs, np.ones((1,) * len(shape))])
    size = math.prod(shape)
    parameters = np.empty((len(FRICTION_PARAMETERS), size))
    mode, validity = np.empty(size, np.int8), np.empty(size, np.int16)
    flat = tuple(np.array(values, np.float64).reshape(-1) for values in inputs)
    options = problem.options(False)
    threads.spread(
        size, lambda first, last: parameter_grid(grid, first, last, flat, options, parameters, mode, validity)
    )
    results: dict[str, NDArray[np.generic]] = {
        name: row.reshape(shape) for name, row in zip(FRICTION_PARAMETERS, parameters, strict=True)
    }
    return results | {"sliding_mode": mode.reshape(shape), "validity": validity.reshape(shape)}


def flexible_block(frequency: Array, structure_frequency: Array) -> NDArray[np.int16]:
    """The validity bit of a block that is not rigid: 0.2 ≤ f/fs ≤ 1.3."""
    ratio = frequency / structure_frequency
    return np.where((ratio >= 0.2) & (ratio <= 1.3), Validity.FLEXIBLE_BLOCK, 0).astype(np.int16)


def _layout(shape: tuple[int, ...], scaled: int | None, arrays: list[Array]) -> Grid:
    """Strides of the cells' dimensions for the inputs, the periods and the results; the scaled dimension apart."""
    dimensions = [axis for axis in range(len(shape)) if axis != scaled]
    rows = [_strides(values.shape) for values in arrays] + [_strides(shape)]
    return Grid(
        # a grid without dimensions is one cell along one
        shape=np.array([shape[axis] for axis in dimensions] or [1], np.int64),
        strides=np.array([[row[axis] for axis in dimensions] or [0] for row in rows], np.int64),
        frequencies=1 if scaled is None else shape[scaled],
        frequency_stride=0 if scaled is None else rows[-2][scaled],
        result_stride=0 if scaled is None else rows[-1][scaled],
    )


def _strides(shape: tuple[int, ...]) -> list[int]:
    """Strides in elements of a C-contiguous array, 0 along dimensions of length 1."""
    strides = []
    for axis, size in enumerate(shape):
        strides.append(math.prod(shape[axis + 1 :]) if size > 1 else 0)
    return strides
