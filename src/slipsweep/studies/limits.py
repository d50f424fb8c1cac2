"""The inverse of a sweep: the smallest amplitude at which a tolerable displacement is reached.

The displacement u(A) is no simple function: it jumps where the sliding mode changes, may fall
behind a jump, and has gaps where the model gives no value.  So every block is first scanned
from its yield acceleration upwards, with both sides of the amplitudes at which its mode changes.
What may lie hidden in its steps is looked for (`limit_scans`).  The first step that reaches the
target is narrowed until two neighbouring double-precision numbers are left.  Both ask the cycle
solver, for all cells at once.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.chunks import slabs
from slipsweep.grid.engine import Arrays, Problem, Request
from slipsweep.grid.plans import Plan, plan_sweep
from slipsweep.model.options import Newmark
from slipsweep.model.parameters import check_single, check_values, check_whole
from slipsweep.model.variables import (
    LIMIT_RESULTS,
    MAXIMUM_AMPLITUDE_IN_G,
    RECORD_COUNTS,
    RESULT_DTYPES,
    RESULTS,
    TOLERABLE_DISPLACEMENT,
    LimitStatus,
    SlidingMode,
    Validity,
)
from slipsweep.motion.cutting import wave_of_record
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.studies.limit_scans import (
    SCANNED,
    UNDER_RECORD,
    UNDER_WAVEFORM,
    Change,
    Scan,
    Steps,
    beside_changes,
    first_of,
    first_step,
    hidden_peaks,
    narrow,
)

Floats = NDArray[np.float64]

#: Steps of the scan, in equal ratios from the yield acceleration to the maximum amplitude.
AMPLITUDE_STEPS = 256

#: What a limit takes beside its block's scan, in cells of the cycle solver: the search in a step, a scan's scaling.
_COST = 100.0

TITLE = "Amplitudes at which a tolerable displacement is reached"

#: A rise of u between neighbouring amplitudes by more than this part of it is a jump.
JUMP = 1e-6

#: How far from its place, in parts of it, a change of mode that is known by a formula may be: rounding.
_BESIDE = 1e-15

#: Pulses of a record whose changes of mode a scan looks at on both sides: noise has thousands.
_MOST_PULSES = 128

#: Results that tell in which mode a block slides.
_MODES = ("sliding_mode", "stick_slip_pulses", "continuous_pulses")

#: Inputs that only scale the result, or only flag it.
_SCALES = ("frequency", "time_scale", "structure_frequency")


def plan_limits(
    *,
    displacement: Any,
    maximum_amplitude: float | None = None,
    amplitude_steps: int = AMPLITUDE_STEPS,
    **given: Any,
) -> Plan:
    """Plan of limit amplitudes; keyword arguments, results and errors of `slipsweep.limit_amplitude`.

    Arrays with dimensions of their own are `xr.Variable`.
    """
    values = displacement.values if isinstance(displacement, xr.Variable) else displacement
    checked = check_values("displacement", values)
    if isinstance(displacement, xr.Variable):
        target = xr.Variable(displacement.dims, checked)
    elif checked.ndim <= 1:
        target = xr.Variable(("displacement",) * checked.ndim, checked)
    else:
        raise InputError(f"displacement: an array of {checked.ndim} dimensions; must be a scalar or a 1-D array")
    if checked.size == 0:
        raise InputError("displacement = []: must hold at least one value")
    steps = check_whole("amplitude_steps", amplitude_steps, 2, 1_000_000)

    # displacement and amplitude change places: in the layout of the grid it stands where the amplitude would
    plan = plan_sweep(**given, amplitude=target, variables=["permanent_displacement"])
    task = plan.tasks[0]
    if maximum_amplitude is None:
        maximum_amplitude = MAXIMUM_AMPLITUDE_IN_G * task.problem.model.g
    highest = check_single("maximum_amplitude", maximum_amplitude)
    inputs = dict(task.inputs)
    inputs["displacement"] = inputs.pop("amplitude")
    _, scaling = _groups(inputs, len(plan.sizes))
    dims = tuple(plan.sizes)
    coords = {name: variable for name, variable in plan.coords.items() if name != "amplitude"}
    names = (*LIMIT_RESULTS, *_codes(task.problem), "validity")
    return Plan(
        plan.sizes,
        coords | {"displacement": xr.Variable(target.dims, target.values, TOLERABLE_DISPLACEMENT)},
        (replace(task, solver=partial(solve, highest, steps), names=names, inputs=inputs),),
        names,
        {**plan.attrs, "title": TITLE, "maximum_amplitude": highest, "amplitude_steps": steps},
        # a scan serves a block for all that is asked of it
        cost=plan.cost * (max(1.0, steps / math.prod(plan.sizes[dims[axis]] for axis in scaling)) + _COST),
        together=tuple(dims[axis] for axis in scaling),
        memory=plan.memory,
        # inputs laid out over the grid, and transposed copies
        cell_memory=60,
        described=RESULTS | RECORD_COUNTS | LIMIT_RESULTS,
    )


def _groups(inputs: Mapping[str, Floats], dimensions: int) -> tuple[list[int], list[int]]:
    """Dimensions along which blocks differ, and those along which only what is asked of them does."""
    blocks = [values.shape for name, values in inputs.items() if name not in (*_SCALES, "displacement")]
    moving = [axis for axis in range(dimensions) if any(own[axis] > 1 for own in blocks)]
    return moving, [axis for axis in range(dimensions) if axis not in moving]


def _codes(problem: Problem) -> tuple[str, ...]:
    """Results that tell in which mode a block slides, or how many pulses of a record it slides in."""
    return tuple(RECORD_COUNTS) if isinstance(problem.excitation, (Record, Suite)) else ("sliding_mode",)


def solve(maximum_amplitude: float, steps: int, asked: Request) -> Arrays:
    """Find the limit amplitudes of a grid.

    Parameters
    ----------
    maximum_amplitude : float
        Where the scan ends, m/s².
    steps : int
        Steps of the scan.
    asked : Request
        Variables of `slipsweep.limit_amplitude`; its inputs are those of `engine.solve` but for the amplitude,
        and the `displacement` that is to be reached, m.
    """
    results = asked.results()
    for where, part in engine.motions(asked):
        found = _solve_motion(maximum_amplitude, steps, part)
        for name, values in results.items():
            values[where] = found[name]
    return results


def _solve_motion(maximum_amplitude: float, steps: int, asked: Request) -> Arrays:
    """Find the limit amplitudes of a grid that one motion shakes."""
    shape, arrays = asked.shape, asked.arrays
    moving, scaling = _groups(arrays, len(shape))
    # two dimensions are enough: the blocks, and what is asked of each
    table = tuple(math.prod(shape[axis] for axis in group) for group in (moving, scaling))
    rows = {name: _two_dimensional(values, shape, (moving, scaling)) for name, values in arrays.items()}
    whole = replace(asked, shape=table, arrays=rows, empty=np.empty)
    found = whole.results()
    for slab in slabs(table, max(1, SCANNED // (steps + _most_changes(asked)))):
        part = whole.part(slab)
        solved = _solve_slab(part, maximum_amplitude, steps)
        for name, values in found.items():
            values[slab] = solved[name]
        asked.tell(math.prod(part.shape))
    order = [[*moving, *scaling].index(axis) for axis in range(len(shape))]
    sizes = [shape[axis] for axis in (*moving, *scaling)]
    return {name: values.reshape(sizes).transpose(order) for name, values in found.items()}


def _two_dimensional(values: Floats, shape: tuple[int, ...], groups: tuple[list[int], list[int]]) -> Floats:
    """An input with each group of dimensions made one, of length 1 where it does not vary along the group."""
    sizes, lengths = list(values.shape), []
    for group in groups:
        if any(values.shape[axis] > 1 for axis in group):
            for axis in group:
                sizes[axis] = shape[axis]
        lengths.append(math.prod(sizes[axis] for axis in group))
    return np.broadcast_to(values, sizes).transpose([*groups[0], *groups[1]]).reshape(lengths)


def _solve_slab(asked: Request, maximum_amplitude: float, steps: int) -> Arrays:
    """Solve blocks (rows) for what is asked of each (columns)."""
    problem, shape, arrays = asked.problem, asked.shape, dict(asked.arrays)
    displacement = np.broadcast_to(arrays.pop("displacement"), shape)
    blocks = {name: values for name, values in arrays.items() if name not in _SCALES}
    amplitudes = _scan(problem, shape[0], blocks, maximum_amplitude, steps)

    # every amplitude of the scan, at every frequency
    every = {name: values[:, np.newaxis, :] for name, values in arrays.items()}
    size = (shape[0], amplitudes.shape[1], shape[1])
    hides = UNDER_RECORD if isinstance(problem.excitation, Record) else UNDER_WAVEFORM
    codes = {"validity", *(change.result for change in hides.changes)}
    found = _at(problem, every, amplitudes[:, :, None], ("permanent_displacement", *codes), size)
    scanned, carried = found["permanent_displacement"], found["validity"][:, :, 0] & Validity.NOT_RECOUPLED != 0
    scan = Scan(hides, amplitudes, scanned, displacement[:, np.newaxis, :], carried)

    def of_blocks(row: NDArray[np.intp]) -> dict[str, Floats]:
        # but for a factor the same at all that is asked of a block
        return _zipped(arrays, row, np.zeros_like(row))

    def moved(amplitude: Floats, row: NDArray[np.intp]) -> Floats:
        cells = {name: values[:, np.newaxis] for name, values in of_blocks(row).items()}
        return _at(problem, cells, amplitude, ("permanent_displacement",))["permanent_displacement"]

    def excess(amplitude: Floats, row: NDArray[np.intp], column: NDArray[np.intp]) -> Floats:
        cells = _zipped(arrays, row, column)
        moved = _at(problem, cells, amplitude, ("permanent_displacement",))["permanent_displacement"]
        return np.asarray(moved - displacement[row, column])

    def displaced(amplitude: Floats, row: NDArray[np.intp], column: NDArray[np.intp]) -> NDArray[np.bool_]:
        return np.asarray(excess(amplitude, row, column) >= 0.0)

    def beside(change: Change) -> Steps:
        def state(amplitude: Floats, row: NDArray[np.intp]) -> NDArray[np.integer[Any]]:
            return np.asarray(_at(problem, of_blocks(row), amplitude, (change.result,))[change.result] & change.bits)

        return beside_changes(scan, change, found[change.result][:, :, 0] & change.bits, state, displaced)

    places = (first_step(scan), hidden_peaks(scan, moved, displaced), *map(beside, hides.changes))
    row, column, low, high = first_of(shape, *places)
    cells = _zipped(arrays, row, column)
    low, high = narrow(low, high, lambda amplitude, which: excess(amplitude, row[which], column[which]))
    wanted = ("permanent_displacement", *_codes(problem), "validity")
    before, after = _at(problem, cells, low, wanted), _at(problem, cells, high, wanted)

    # what is missing says why in its validity: that of the greatest amplitude
    results = _at(problem, arrays, np.full((1, 1), maximum_amplitude), ("validity",), shape)
    results |= {
        "limit_amplitude": np.full(shape, math.nan),
        "limit_status": np.full(shape, LimitStatus.NOT_REACHED, np.int8),
        "permanent_displacement": np.full(shape, math.nan),
        **{name: np.full(shape, SlidingMode.MISSING, RESULT_DTYPES[name]) for name in _codes(problem)},
    }
    results["limit_status"][np.isnan(scanned[:, :, 0]).all(axis=1)] = LimitStatus.INVALID
    for name in wanted:
        results[name][row, column] = after[name]
    results["limit_amplitude"][row, column] = high
    results["limit_status"][row, column] = _status(before, after)
    return results


def _at(
    problem: Problem,
    arrays: Mapping[str, Floats],
    amplitude: Floats,
    wanted: tuple[str, ...],
    shape: tuple[int, ...] | None = None,
) -> Arrays:
    """Solve blocks at amplitudes; `shape` if it is not that of the amplitudes."""
    return engine.solve(Request(problem, shape or amplitude.shape, {**arrays, "amplitude": amplitude}, wanted))


def _scan(problem: Problem, count: int, blocks: Mapping[str, Floats], maximum_amplitude: float, steps: int) -> Floats:
    """Amplitudes to try for `count` blocks, increasing along each row; both sides of every change of mode are there."""
    # Newmark's block has no limit, and may have no θ and μs that one would follow from
    limited = ("limiting_acceleration",) if not isinstance(problem.model, Newmark) else ()
    wanted = ("yield_acceleration", *limited)
    known = engine.friction_parameters(Request(problem, (count, 1), {**blocks, "amplitude": np.zeros((1, 1))}, wanted))
    yields = known["yield_acceleration"]
    # without a yield acceleration there is no value at any amplitude
    start = np.minimum(np.where(yields > 0.0, yields, maximum_amplitude), maximum_amplitude)
    with np.errstate(over="ignore"):
        ratio = np.minimum(maximum_amplitude / start, np.finfo(np.float64).max)
    amplitudes = start * ratio ** np.linspace(0.0, 1.0, steps + 1)
    amplitudes[:, :1], amplitudes[:, -1] = start, maximum_amplitude
    amplitudes = np.maximum.accumulate(np.minimum(amplitudes, maximum_amplitude), axis=1)
    if isinstance(problem.excitation, Record):
        heights = _highest(problem.excitation, float(blocks["polarity"].item())) / problem.excitation.peak
        thresholds = np.hstack([known[name] for name in wanted])
    else:
        heights, thresholds = np.ones(1), np.hstack([known[name] for name in limited] or [start])
    changes = _mode_changes(thresholds, heights)
    within = np.where((changes >= start) & (changes <= maximum_amplitude), changes, maximum_amplitude)
    return np.sort(np.hstack([amplitudes, within[:, (within < maximum_amplitude).any(axis=0)]]), axis=1)


def _most_changes(asked: Request) -> int:
    """How many amplitudes beside the steps a scan may have."""
    motion = asked.problem.excitation
    if not isinstance(motion, Record):
        return 4
    # two thresholds of a pulse, and two sides of each
    return 4 * int(_highest(motion, float(asked.arrays["polarity"].item())).size)


def _highest(record: Record, polarity: float) -> Floats:
    """Heights of the highest pulses of a record, increasing."""
    return np.unique(wave_of_record(record, polarity).height)[-_MOST_PULSES:]


def _mode_changes(thresholds: Floats, heights: Floats) -> Floats:
    """Amplitudes just below and just above those at which a pulse begins to count, or changes its mode.

    A pulse does where its own peak, of these `heights` in parts of the amplitude, passes one of the `thresholds`
    (columns) of a block (rows): Üy, or Üg,lim of Eq. 7, neither of which depends on the amplitude.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        places = (thresholds[:, :, None] / heights).reshape(len(thresholds), -1)
        return np.hstack([places * (1.0 - _BESIDE), places * (1.0 + _BESIDE)])


def _zipped(arrays: Mapping[str, Floats], row: NDArray[np.intp], column: NDArray[np.intp]) -> dict[str, Floats]:
    """Cells picked from two-dimensional inputs, one after the other."""
    picked = {}
    for name, values in arrays.items():
        if values.size == 1:
            picked[name] = values.reshape(1)
            continue
        down = row if values.shape[0] > 1 else np.zeros_like(row)
        across = column if values.shape[1] > 1 else np.zeros_like(row)
        picked[name] = values[down, across]
    return picked


def _status(before: Mapping[str, NDArray[Any]], after: Mapping[str, NDArray[Any]]) -> NDArray[np.int8]:
    """What the displacement does at a limit, from the last amplitude below it and from the limit itself."""
    below, above = before["permanent_displacement"], after["permanent_displacement"]
    jumps = above - below > JUMP * above
    other_mode = np.any([before[name] != after[name] for name in _MODES if name in after], axis=0)
    status = np.full(above.shape, LimitStatus.REACHED, np.int8)
    status[jumps] = LimitStatus.AT_JUMP
    status[jumps & other_mode] = LimitStatus.AT_MODE_JUMP
    status[np.isnan(below)] = LimitStatus.AFTER_GAP
    return status
