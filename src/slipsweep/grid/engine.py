"""Arrays in, arrays out: the sweep without labels.

Knows numpy and the kernels; no xarray, no files.  Every input is an array that broadcasts
to the shape of the result; a dimension along which only the frequency varies is served
by the scaling law and costs no kernel call.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import RunError
from slipsweep.grid import threads
from slipsweep.grid.blocks import slabs
from slipsweep.grid.served import check_served, is_ordinary
from slipsweep.grid.tables import Empty
from slipsweep.kernels import block as physics
from slipsweep.kernels import step
from slipsweep.kernels.block import Cell, Options
from slipsweep.kernels.grid import CYCLE_KERNEL, RECORD_KERNEL, STEP_KERNELS, WAVE_KERNEL, Grid, Results, parameter_grid
from slipsweep.model.options import Mendez, Model, Solver, Step
from slipsweep.model.variables import FRICTION_PARAMETERS, RECORD_COUNTS, RESULT_DTYPES, Validity
from slipsweep.motion.amplitude import peak_acceleration
from slipsweep.motion.cutting import wave_of, wave_of_record
from slipsweep.motion.pieces import Wave
from slipsweep.motion.records import Record
from slipsweep.motion.waveforms import Sine, Waveform

if TYPE_CHECKING:
    from slipsweep.jit.cache import Kernel

#: Cells whose friction parameters are computed together, wanted or not (50 bytes each).
_FRICTION_CELLS = 65536

#: Amplitudes that are computed from peak displacements at a time (2 MB).
_AMPLITUDES = 262144

#: Results in which `mark_flexible_blocks` sets flags together.
_FLAGS = 65536

RULES = {"rectangle": step.RECTANGLE, "trapezoid": step.TRAPEZOID, "simpson": step.SIMPSON}
RISES = {"monotone": physics.MONOTONE, "literal": physics.LITERAL}
RECOUPLINGS = {"eq12": physics.EQ12, "integrate": physics.INTEGRATE}

#: Results that come out of a kernel; the codes in the order of its rows, and those of a record.
MOTION_CODES = ("sliding_mode", "validity")
MOTION_RESULTS = ("permanent_displacement", "peak_relative_velocity", *MOTION_CODES)
RECORD_CODES = (*RECORD_COUNTS, "validity")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """What all cells of a grid share: what `slipsweep.sweep` was asked to solve, and how."""

    model: Model
    excitation: Waveform | Record
    solver: Solver

    def options(self, wants_peak: bool) -> Options:
        """The options as the kernels want them."""
        model, solver = self.model, self.solver if isinstance(self.solver, Step) else Step()
        return Options(
            rise=RISES[model.rise] if isinstance(model, Mendez) else physics.NEWMARK,
            recoupling=RECOUPLINGS[model.recoupling] if isinstance(model, Mendez) else physics.INTEGRATE,
            cycles=self.excitation.cycles if isinstance(self.excitation, Waveform) else 1,
            rule=RULES[solver.rule],
            steps_per_cycle=solver.steps_per_cycle,
            wants_peak=wants_peak,
            g=model.g,
        )


def cell_inputs(arrays: Mapping[str, Array], dimensions: int) -> list[Array]:
    """The seven fields of `Cell` as arrays of `dimensions` dimensions; what is not given is NaN.

    The amplitude may be given as a peak displacement with its frequency.
    """
    if "displacement_amplitude" in arrays:
        amplitude = peak_acceleration(arrays["displacement_amplitude"], arrays["frequency"])
        arrays = {**arrays, "amplitude": amplitude}
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
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
    empty: Empty = np.empty,
) -> dict[str, NDArray[Any]]:
    """Solve a grid.

    Parameters
    ----------
    problem : Problem
        Options common to all cells.
    shape : tuple of int
        Shape of the results.
    arrays : mapping of str to array
        `theta` (degrees), `mu_s`, `amplitude` or `displacement_amplitude`, `frequency` (Hz) and the
        optional parameters, each with as many dimensions as `shape`, of length 1 where it does
        not vary.
    wanted : tuple of str
        Names from `MOTION_RESULTS`; nothing else is computed.
    progress : callable, optional
        Called with a number of result cells as they are finished, from any thread.
    empty : callable
        Makes the arrays of the results.

    Returns
    -------
    dict of str to ndarray
        Arrays of `shape`, float64, but for the codes (`variables.RESULT_DTYPES`).

    Raises
    ------
    InputError
        A result that has a value is beyond double precision.
    """
    results = {name: empty(shape, RESULT_DTYPES.get(name, "float64")) for name in wanted}
    if _amplitudes(arrays) <= _AMPLITUDES:
        _solve_into(results, problem, shape, arrays, progress)
        return results
    # A = ω²d where d and ω span a grid: as large as a result, and there for a slab at a time only
    for slab in slabs(shape, _AMPLITUDES):
        sizes = tuple(part.stop - part.start for part in slab)
        parts = {name: values[slab] for name, values in results.items()}
        _solve_into(parts, problem, sizes, cut(arrays, slab), progress)
    return results


def _amplitudes(arrays: Mapping[str, Array]) -> int:
    """How many amplitudes the peak displacements of a grid make."""
    if "displacement_amplitude" not in arrays:
        return 0
    return math.prod(np.broadcast_shapes(arrays["displacement_amplitude"].shape, arrays["frequency"].shape))


def _is_plain_sine(motion: Waveform | Record) -> bool:
    """Whether a motion is a sine without ramps, for which there are shorter ways."""
    return isinstance(motion, Sine) and motion == Sine(motion.cycles)


def _solve_into(
    results: Mapping[str, NDArray[Any]],
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    progress: Callable[[int], None] | None,
) -> None:
    """Solve a grid, or a slab of one; `results` lie without gaps."""
    inputs, frequency = cell_inputs(arrays, len(shape)), arrays["frequency"]
    # what is out of the ordinary is looked at, for which flags are wanted in any case
    ordinary = all(map(is_ordinary, (np.array(problem.model.g), *inputs[1:], frequency)))
    filled = dict(results) if ordinary else {"validity": np.empty(shape, RESULT_DTYPES["validity"]), **results}
    options = problem.options("peak_relative_velocity" in results)
    motion = problem.excitation
    assert isinstance(motion, Waveform)
    wave = wave_of(motion)
    work = 1
    if isinstance(problem.solver, Step):
        kernel, steps = STEP_KERNELS[options.rule], step.steps_of(wave, options.steps_per_cycle, options.rule)
        work += options.steps_per_cycle // 16  # a step takes about 1/16 of a cell of the cycle solver

    def call(grid: Grid, first: int, last: int, rows: tuple[Array, ...], periods: Array, targets: Results) -> None:
        if isinstance(problem.solver, Step):
            kernel(grid, first, last, rows, periods, options, steps, targets)
            return
        stretches = np.array([[first, last]])
        if _is_plain_sine(motion):
            rest = np.empty(((last - first + 1) // 2, 2), np.int64)
            stretches = rest[: CYCLE_KERNEL(grid, first, last, rows, periods, options, targets, rest)]
        if stretches.size:
            WAVE_KERNEL(grid, stretches, rows, periods, options, wave, targets)

    periods = 1.0 / (2.0 * math.pi * frequency)
    unsolved = _fill(filled, MOTION_CODES, shape, shape, 0, inputs, periods, call, work, progress)
    if not ordinary:
        check_served(problem.model.g, arrays, results, filled["validity"])
    _refuse_unsolved(unsolved, shape, arrays)
    if "structure_frequency" in arrays and "validity" in results:
        mark_flexible_blocks(results["validity"], frequency, arrays["structure_frequency"])


def amplitudes(
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
    empty: Empty = np.empty,
) -> dict[str, NDArray[Any]]:
    """The amplitude A = ω²d of every cell; arguments as those of `solve`."""
    results = {name: empty(shape, "float64") for name in wanted}
    for values in results.values():
        np.copyto(values, peak_acceleration(arrays["displacement_amplitude"], arrays["frequency"]))
    if progress is not None:
        progress(math.prod(shape))
    return results


def solve_record(
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
    empty: Empty = np.empty,
) -> dict[str, NDArray[Any]]:
    """Solve a grid of responses to a record.

    Parameters and results as in `solve`, but for the names: results are of `variables.RECORD_RESULTS`, and
    in place of `amplitude` and `frequency` there are `scale`, `time_scale`, by which the scaling laws go as by
    1/ω, and `polarity`.
    """
    record, options = problem.excitation, problem.options("peak_relative_velocity" in wanted)
    assert isinstance(record, Record)
    results = {name: empty(shape, RESULT_DTYPES.get(name, "float64")) for name in wanted}
    extremes = {
        "acceleration of the record": np.abs(record.acceleration).max(),
        "time of the record": np.abs(record.times).max(),
    }
    inputs = cell_inputs({**arrays, "amplitude": arrays["scale"]}, len(shape))
    ordinary = all(map(is_ordinary, (np.array(problem.model.g), *inputs[1:], arrays["time_scale"], *extremes.values())))
    filled = results if ordinary else {"validity": np.empty(shape, RESULT_DTYPES["validity"]), **results}
    polarity = arrays["polarity"]
    for side in np.ndindex(polarity.shape):
        # the part of the grid that has this polarity, and where its results begin
        part = tuple(slice(at, at + 1) if n > 1 else slice(None) for at, n in zip(side, polarity.shape, strict=True))
        sizes = tuple(1 if n > 1 else size for n, size in zip(polarity.shape, shape, strict=True))
        begin = sum(at * stride for at, stride in zip(side, _strides(shape), strict=True))
        own, wave = cut(arrays, part), wave_of_record(record, float(polarity[side]))

        def call(
            grid: Grid,
            first: int,
            last: int,
            rows: tuple[Array, ...],
            periods: Array,
            targets: Results,
            wave: Wave = wave,
        ) -> None:
            RECORD_KERNEL(grid, first, last, rows, periods, options, wave, targets)

        # some 2 µs against 0.1, and more for a long record
        work = max(32, wave.pieces.shape[0] // 64)
        rows = cell_inputs({**own, "amplitude": own["scale"]}, len(shape))
        unsolved = _fill(filled, RECORD_CODES, sizes, shape, begin, rows, own["time_scale"], call, work, progress)
        if not ordinary:
            served = {name: values[part] for name, values in results.items()}
            check_served(problem.model.g, own | extremes, served, filled["validity"][part])
        _refuse_unsolved(unsolved, sizes, own)
    return results


def _fill(
    results: Mapping[str, NDArray[Any]],
    codes: tuple[str, ...],
    sizes: tuple[int, ...],
    shape: tuple[int, ...],
    begin: int,
    inputs: list[Array],
    periods: Array,
    call: Callable[[Grid, int, int, tuple[Array, ...], Array, Results], None],
    work_per_cell: int,
    progress: Callable[[int], None] | None,
) -> tuple[int, ...] | None:
    """Fill in a part, of these `sizes`, of results of a `shape`, from place `begin` on, by `call` of a kernel.

    u and v go as the squares of `periods` and as `periods`; `codes` are the names of the kernel's rows of codes.
    Returns a cell of the part that was not solved, if there is one.
    """
    scaled = scaled_dimension(sizes, inputs, periods)
    grid = layout(sizes, scaled, [*inputs, periods], shape)

    def target(name: str) -> NDArray[Any]:
        values = results.get(name, np.empty(0, RESULT_DTYPES.get(name, "float64")))
        return values.reshape(-1)[begin:]

    targets = Results(
        target("permanent_displacement"),
        target("peak_relative_velocity"),
        tuple(map(target, codes)),
        unsolved=np.full(1, -1),
    )
    rows, flat_periods = tuple(flat(values) for values in inputs), flat(periods)

    def work(first: int, last: int) -> None:
        call(grid, first, last, rows, flat_periods, targets)
        if progress is not None:
            progress((last - first) * grid.frequencies)

    if math.prod(sizes):
        # a result takes about 1/32 of a cell of the cycle solver
        threads.spread(math.prod(int(size) for size in grid.shape), work, work_per_cell + grid.frequencies // 32)
    if targets.unsolved[0] < 0:
        return None
    at = [int(i) for i in np.unravel_index(int(targets.unsolved[0]), tuple(grid.shape))]
    return tuple(at.pop(0) if axis != scaled else 0 for axis in range(len(sizes)))


def _refuse_unsolved(cell: tuple[int, ...] | None, shape: tuple[int, ...], arrays: Mapping[str, Array]) -> None:
    """Say which cell a kernel could not solve."""
    if cell is None:
        return
    parameters = ", ".join(f"{name} = {float(np.broadcast_to(values, shape)[cell])}" for name, values in arrays.items())
    raise RunError(
        f"{parameters}: an event of the motion was not found; please report this cell, with the options of the run"
    )


def friction_parameters(
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
    empty: Empty = np.empty,
) -> dict[str, NDArray[Any]]:
    """Eqs. 7-11 and λ of every cell, `sliding_mode` and the validity known before the motion.

    Parameters, results and errors as in `solve`; there is no frequency.
    """
    return estimates(problem, shape, arrays, wanted, progress, empty, checked=True)


def estimates(
    problem: Problem,
    shape: tuple[int, ...],
    arrays: Mapping[str, Array],
    wanted: tuple[str, ...],
    progress: Callable[[int], None] | None = None,
    empty: Empty = np.empty,
    checked: bool = False,
) -> dict[str, NDArray[Any]]:
    """As `friction_parameters`; unless `checked`, an estimate that is no finite number is given as it is."""
    results = {name: empty(shape, RESULT_DTYPES.get(name, "float64")) for name in wanted}
    options = problem.options(False)
    parts = list(slabs(shape, _FRICTION_CELLS))

    def solve_slab(slab: tuple[slice, ...]) -> None:
        own = cut(arrays, slab)
        inputs = cell_inputs(own, len(shape))
        sizes = tuple(part.stop - part.start for part in slab)
        grid = layout(sizes, None, [*inputs, np.ones((1,) * len(shape))])
        cells = math.prod(sizes)
        parameters = np.empty((len(FRICTION_PARAMETERS), cells))
        codes = {name: np.empty(cells, RESULT_DTYPES[name]) for name in ("sliding_mode", "validity")}
        rows = tuple(flat(values) for values in inputs)
        parameter_grid(grid, 0, cells, rows, options, parameters, codes["sliding_mode"], codes["validity"])
        found = dict(zip(FRICTION_PARAMETERS, parameters, strict=True)) | codes
        shaped = {name: found[name].reshape(sizes) for name in wanted}
        if checked:
            check_served(problem.model.g, own, shaped, found["validity"].reshape(sizes))
        for name, values in shaped.items():
            if checked and values.dtype.kind == "f":
                values[np.isinf(values)] = math.nan  # of a cell without a value
            results[name][slab] = values
        if progress is not None:
            progress(cells)

    def work(first: int, last: int) -> None:
        for slab in parts[first:last]:
            solve_slab(slab)

    # the kernel gives all parameters: slab by slab, those not wanted take no room
    threads.spread(len(parts), work, _FRICTION_CELLS)
    return results


def kernels_of(solver: Callable[..., Any], problem: Problem) -> "list[Kernel]":
    """The kernels that one of the functions above takes for any grid (a sine may need the waves' one besides)."""
    if solver is friction_parameters:
        return [parameter_grid]
    if solver is solve_record:
        return [RECORD_KERNEL]
    if solver is not solve:
        return []
    if isinstance(problem.solver, Step):
        return [STEP_KERNELS[RULES[problem.solver.rule]]]
    return [CYCLE_KERNEL if _is_plain_sine(problem.excitation) else WAVE_KERNEL]


def mark_flexible_blocks(validity: NDArray[np.int16], frequency: Array, structure_frequency: Array) -> None:
    """Set the validity bit of blocks that are not rigid, 0.2 ≤ f/fs ≤ 1.3."""
    varying = np.broadcast_shapes(frequency.shape, structure_frequency.shape)
    # in slabs: temporaries stay small even where the two vary along every dimension
    for slab in slabs(varying, _FLAGS):
        part = cut({"f": frequency, "fs": structure_frequency}, slab)
        ratio = part["f"] / part["fs"]
        flags = ((ratio >= 0.2) & (ratio <= 1.3)) * np.int16(Validity.FLEXIBLE_BLOCK)
        where: Any = (one if size > 1 else slice(None) for one, size in zip(slab, varying, strict=True))
        validity[(*where, ...)] |= flags


def cut(arrays: Mapping[str, Array], slices: tuple[slice, ...]) -> dict[str, Array]:
    """A part of a grid: `arrays` cut along the dimensions in which they vary."""
    parts: dict[str, Array] = {}
    for name, values in arrays.items():
        where: Any = (part if size > 1 else slice(None) for part, size in zip(slices, values.shape, strict=True))
        parts[name] = values[(*where, ...)]  # the dots keep an array without dimensions an array
    return parts


def flat(values: Array) -> Array:
    """One row of float64 as the kernels are compiled for; a copy only where there is no other way."""
    return np.require(values, np.float64, ["C", "ALIGNED", "WRITEABLE"]).reshape(-1)


def layout(
    shape: tuple[int, ...], scaled: int | None, arrays: list[Array], whole: tuple[int, ...] | None = None
) -> Grid:
    """Strides of the cells' dimensions for the inputs, the periods and the results; the scaled dimension apart.

    The results are a part of ones of the shape `whole`, if that is given.
    """
    dimensions = [axis for axis in range(len(shape)) if axis != scaled]
    rows = [_strides(values.shape) for values in arrays] + [_strides(whole or shape)]
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
