"""The inverse of a sweep: the smallest amplitude at which a tolerable displacement is reached.

The displacement u(A) is no simple function: it jumps where the sliding mode changes, may fall after a jump, and has
gaps where the model gives no value.  So every block is first scanned from its yield acceleration upwards, including
both sides of the amplitudes at which its mode changes, and what the steps of the scan may hide is looked for
(`limit_scans`).  The first step that reaches the target is narrowed until two neighbouring double-precision numbers
are left.  All cells are solved together, by the cycle solver.
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
from slipsweep.grid.engine import Arrays, Request
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import Plan, plan_sweep
from slipsweep.grid.problem import Problem
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
)
from slipsweep.motion.cutting import wave_of_record
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.studies import limit_scans
from slipsweep.studies.limit_scans import SCANNED, Cells, Scan

Floats = NDArray[np.float64]

#: Steps of the scan, in equal ratios from the yield acceleration to the maximum amplitude.
AMPLITUDE_STEPS = 256

#: Cost of a limit in addition to the scan of its block, in cells of the cycle solver.
_COST = 100.0

TITLE = "Amplitudes at which a tolerable displacement is reached"

#: A rise of u between neighbouring amplitudes by more than this part of it is a jump.
JUMP = 1e-6

#: Rounding of the amplitude at which a mode changes by a formula, relative.
_ROUNDING = 1e-15

#: Pulses of a record whose changes of mode a scan includes: noise has thousands.
_MOST_PULSES = 128

#: Results that say in which mode a block slides.
_MODES = ("sliding_mode", "stick_slip_pulses", "continuous_pulses")

#: Inputs that only scale the result, or only flag it.
_SCALES = ("frequency", "time_scale", "structure_frequency")


def plan_limits(
    displacement: Any,
    inputs: Inputs,
    *,
    excitation: Any = "sine",
    model: Any = "mendez",
    maximum_amplitude: float | None = None,
    amplitude_steps: int = AMPLITUDE_STEPS,
) -> Plan:
    """Plan of limit amplitudes.

    Parameters
    ----------
    displacement, excitation, model, maximum_amplitude, amplitude_steps
        As `slipsweep.limit_amplitude`.
    inputs : Inputs
        All but the strength of the shaking.

    Raises
    ------
    InputError
        As `slipsweep.limit_amplitude`.
    """
    checked = check_values("displacement", displacement)
    if isinstance(displacement, (xr.DataArray, xr.Variable)):
        target = xr.Variable(displacement.dims, checked)
    elif checked.ndim <= 1:
        target = xr.Variable(("displacement",) * checked.ndim, checked)
    else:
        raise InputError(f"displacement: an array of {checked.ndim} dimensions; must be a scalar or a 1-D array")
    if checked.size == 0:
        raise InputError("displacement = []: must hold at least one value")
    steps = check_whole("amplitude_steps", amplitude_steps, 2, 1_000_000)

    # displacement and amplitude change places: in the layout of the grid it stands where the amplitude would
    plan = plan_sweep(
        inputs.but({"amplitude": target}), excitation=excitation, model=model, variables=["permanent_displacement"]
    )
    task = plan.tasks[0]
    if maximum_amplitude is None:
        maximum_amplitude = MAXIMUM_AMPLITUDE_IN_G * task.problem.model.g
    highest = check_single("maximum_amplitude", maximum_amplitude)
    arrays = dict(task.inputs)
    arrays["displacement"] = arrays.pop("amplitude")
    blocks = np.broadcast_shapes(*(one.shape for name, one in arrays.items() if name not in (*_SCALES, "displacement")))
    scaled = {dim: size for (dim, size), own in zip(plan.sizes.items(), blocks, strict=True) if own == 1}
    coords = {name: variable for name, variable in plan.coords.items() if name != "amplitude"}
    names = (*LIMIT_RESULTS, *_codes(task.problem), "validity")
    return Plan(
        plan.sizes,
        coords | {"displacement": xr.Variable(target.dims, target.values, TOLERABLE_DISPLACEMENT)},
        (replace(task, solver=partial(solve, highest, steps), names=names, inputs=arrays),),
        names,
        {**plan.attrs, "title": TITLE, "maximum_amplitude": highest, "amplitude_steps": steps},
        # one scan of a block serves all its targets
        cost=plan.cost * (max(1.0, steps / math.prod(scaled.values())) + _COST),
        together=tuple(scaled),
        memory=plan.memory,
        # inputs laid out over the grid, and transposed copies
        cell_memory=60,
        described=RESULTS | RECORD_COUNTS | LIMIT_RESULTS,
    )


def _codes(problem: Problem) -> tuple[str, ...]:
    """Results that say in which mode a block slides, or in how many pulses of a record."""
    return tuple(RECORD_COUNTS) if isinstance(problem.excitation, (Record, Suite)) else ("sliding_mode",)


def solve(maximum_amplitude: float, steps: int, request: Request) -> Arrays:
    """Find the limit amplitudes of a grid.

    Parameters
    ----------
    maximum_amplitude : float
        Where the scan ends, m/s².
    steps : int
        Steps of the scan.
    request : Request
        Variables of `slipsweep.limit_amplitude`; its inputs are those of `engine.solve` but for the amplitude,
        and the `displacement` that is to be reached, m.
    """
    results = request.results()
    for where, motion in engine.motions(request):
        for slab in slabs(motion.shape, max(1, SCANNED // (steps + _most_changes(motion)))):
            part = motion.part(slab)
            solved = _solve_part(part, maximum_amplitude, steps)
            for name, values in results.items():
                own: Any = values[(*where, ...)]  # type: ignore[arg-type]
                own[(*slab, ...)] = solved[name]
            request.count(math.prod(part.shape))
    return results


def _solve_part(request: Request, maximum_amplitude: float, steps: int) -> Arrays:
    """Find the limit amplitudes of a part of a grid that one motion shakes."""
    problem, shape, arrays = request.problem, request.shape, dict(request.arrays)
    displacement = arrays.pop("displacement")
    amplitudes = _scanned_amplitudes(problem, arrays, maximum_amplitude, steps)
    hides = limit_scans.UNDER_RECORD if isinstance(problem.excitation, Record) else limit_scans.UNDER_WAVEFORM
    # the dimensions of the grid are kept here, as blocks that differ only in their frequency are solved once
    every = {name: values[..., np.newaxis] for name, values in arrays.items()} | {"amplitude": amplitudes}
    lengths = np.broadcast_shapes(*(values.shape for values in every.values()))
    names = tuple({"permanent_displacement", "validity", *(change.result for change in hides.changes)})
    found = engine.solve(Request(problem, lengths, every, names))

    def in_rows(values: NDArray[Any]) -> NDArray[Any]:
        return np.broadcast_to(values, (*shape, amplitudes.shape[-1])).reshape(-1, amplitudes.shape[-1])

    own = {name: values.ravel() if values.size == 1 else _cells(values, shape) for name, values in arrays.items()}
    cells = Cells(problem, own, _cells(displacement, shape))
    scan = Scan(cells, hides, in_rows(amplitudes), {name: in_rows(values) for name, values in found.items()})
    at_changes = [limit_scans.steps_at_changes(scan, change) for change in hides.changes]
    steps_found = limit_scans.first_step(scan), limit_scans.hidden_peaks(scan), *at_changes
    cell, low, high = limit_scans.lowest_of(*steps_found)
    low, high = limit_scans.crossings(low, high, lambda at, which: cells.excess(at, cell[which]))
    wanted = ("permanent_displacement", *_codes(problem), "validity")
    before, after = cells.solve(low, cell, wanted), cells.solve(high, cell, wanted)

    # without a limit the validity at the maximum amplitude says why
    every_cell = np.arange(cells.targets.size)
    results = cells.solve(np.full(every_cell.shape, maximum_amplitude), every_cell, ("validity",))
    results |= {
        "limit_amplitude": np.full(every_cell.shape, math.nan),
        "limit_status": np.full(every_cell.shape, LimitStatus.NOT_REACHED, np.int8),
        "permanent_displacement": np.full(every_cell.shape, math.nan),
        **{name: np.full(every_cell.shape, SlidingMode.MISSING, RESULT_DTYPES[name]) for name in _codes(problem)},
    }
    results["limit_status"][np.isnan(scan.displacement).all(axis=1)] = LimitStatus.INVALID
    for name in wanted:
        results[name][cell] = after[name]
    results["limit_amplitude"][cell] = high
    results["limit_status"][cell] = _status(before, after)
    return {name: values.reshape(shape) for name, values in results.items()}


def _cells(values: Floats, shape: tuple[int, ...]) -> Floats:
    """The value of each cell of a grid, in order."""
    return np.broadcast_to(values, shape).ravel()


def _scanned_amplitudes(problem: Problem, arrays: Mapping[str, Floats], maximum_amplitude: float, steps: int) -> Floats:
    """Amplitudes to try, increasing along the last dimension, with both sides of every change of mode.

    The other dimensions are those of the grid, of length 1 where only the target or the time scale varies.
    """
    blocks = {name: values for name, values in arrays.items() if name not in _SCALES}
    shape = np.broadcast_shapes(*(values.shape for values in blocks.values()))
    # Newmark's block has no limiting acceleration, and may have no θ and μs that one would follow from
    limited = ("limiting_acceleration",) if not isinstance(problem.model, Newmark) else ()
    wanted = ("yield_acceleration", *limited)
    rest = np.zeros((1,) * len(shape))
    parameters = engine.friction_parameters(Request(problem, shape, {**blocks, "amplitude": rest}, wanted))
    known = {name: values.reshape(-1, 1) for name, values in parameters.items()}
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
    scanned = np.sort(np.hstack([amplitudes, within[:, (within < maximum_amplitude).any(axis=0)]]), axis=1)
    return scanned.reshape(*shape, -1)


def _most_changes(request: Request) -> int:
    """How many amplitudes a scan may have in addition to its steps."""
    motion = request.problem.excitation
    if not isinstance(motion, Record):
        return 4
    # two thresholds of a pulse, and two sides of each
    return 4 * int(_highest(motion, float(request.arrays["polarity"].item())).size)


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
        return np.hstack([places * (1.0 - _ROUNDING), places * (1.0 + _ROUNDING)])


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
