"""The inverse of a sweep: the smallest amplitude at which a tolerable displacement is reached.

The displacement u(A) jumps where the sliding mode changes, may fall after a jump, and has gaps
where the model gives no value.  So every block is first scanned from its yield acceleration
upwards, including both sides of the amplitudes at which its mode changes.  Steps of the scan that
may hide a peak are cut into parts, and where u jumps or grows beyond all bounds the place is
located; docs/limit.md says what is missed all the same.  The first step that reaches the target is
halved until two neighbouring double-precision numbers are left.  All cells are solved together.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.chunks import grid_chunks
from slipsweep.grid.engine import Request, Variables
from slipsweep.grid.inputs import Inputs, given_inputs, grid_sizes
from slipsweep.grid.plans import Plan, plan_sweep
from slipsweep.model import options, parameters, units, variables
from slipsweep.model.docstrings import with_parameters
from slipsweep.model.variables import LimitStatus, Validity
from slipsweep.motion.cutting import wave_of_record
from slipsweep.motion.records import Record
from slipsweep.studies import limited_displacement
from slipsweep.studies.sweeps import Excitation, Signs, Values, brought_coordinates, naming_choices

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Cells, and intervals of amplitude: at the upper end a cell reaches its target, at the lower it
#: does not.
Steps = tuple[Indices, Floats, Floats]

TITLE = "Amplitudes at which a tolerable displacement is reached"

#: Steps of the scan, in equal ratios from the yield acceleration to the maximum amplitude.
AMPLITUDE_STEPS = 256

#: The dimension of the amplitudes that a scan tries.
_ALONG = "scanned amplitude"

#: A rise of u between neighbouring amplitudes by more than this part of it is a jump.
JUMP = 1e-6

#: Displacements scanned together: 16 MB, and as much again to compare them.
SCANNED = 2_000_000

#: Inputs on which no scan depends: those that only scale its result, or only flag it, and the
#: target.
_AFTER_SCAN = ("frequency", "time_scale", "structure_frequency", "displacement")


@naming_choices
@with_parameters
def limit_amplitude(
    displacement: Values | str | Sequence[str],
    theta: Values | None = None,
    mu_s: Values | None = None,
    frequency: Values | None = None,
    *,
    excitation: Excitation = "sine",
    model: options.Model | str = "mendez",
    phi: Values | None = None,
    yield_acceleration: Values | None = None,
    yield_coefficient: Values | None = None,
    upslope_yield_acceleration: Values | None = None,
    decay_rate: Values | None = None,
    delta_mu: Values | None = None,
    minimum_friction: Values | None = None,
    residual_mu: Values | None = None,
    residual_phi: Values | None = None,
    weakening_distance: Values | None = None,
    fast_mu: Values | None = None,
    rate_constant: Values | None = None,
    structure_frequency: Values | None = None,
    time_scale: Values | None = None,
    polarity: Signs | None = None,
    azimuth: Values | None = None,
    maximum_amplitude: float | None = None,
    amplitude_steps: int = AMPLITUDE_STEPS,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Smallest amplitude at which the permanent displacement reaches a tolerable one.

    The inverse of `sweep`, exact to the last bit: `sweep` with the cycle solver gives at least
    `displacement` at the amplitude returned, and less (or no value) at the double-precision number
    before it.  The other parameters are those of `sweep`.

    The displacement u(A) need not grow with A, jumps where the sliding mode changes, and has gaps
    where the model gives no value (`validity`), so that a displacement may be reached at several
    amplitudes, or passed in a jump.  The smallest is returned: the first step of a scan with ``u >=
    displacement`` holds it.  The scan runs from the yield acceleration to `maximum_amplitude` in
    `amplitude_steps` equal ratios, finer where it may hide a peak, and has both sides of the change
    of mode.  A peak narrower than a part of a step can be missed.  Under a record the amplitude is
    that peak ground acceleration to which it is scaled, and the scan has both sides of every
    amplitude at which one of its 128 highest pulses begins to count, or changes its mode.  Of a
    block that slides both ways the largest ``|u|`` over time is to reach the displacement.

    Parameters
    ----------
    displacement : float, array or DataArray, str or list of str
        Tolerable permanent displacement, > 0, m or with a unit ("50mm").
    maximum_amplitude : float, optional
        Where the search ends, m/s²; by default 5 g.
    amplitude_steps : int
        Steps of the scan, 2 or more.
    progress : callable, optional
        Called with the number of cells just finished, from any thread.

    Returns
    -------
    Dataset
        Dimensions theta, mu_s, frequency, then others, displacement last:

        - `limit_amplitude`, m/s²; NaN where there is none.
        - `limit_status`: 0 reached, 1 at_mode_jump, 2 at_jump (u rises by more than 1e-6 of itself
          between neighbouring numbers, with and without a change of sliding mode), 3 after_gap (no
          value just below), 4 not_reached, 5 invalid (no value anywhere).
        - `permanent_displacement`, m, and `sliding_mode` (under a record the counts of slips and
          pulses) at the limit; more than `displacement` where a discontinuity of the model sets the
          limit.  Of a block that slides both ways also `largest_displacement` and
          `smallest_displacement`.
        - `validity` at the limit or, where there is none, at `maximum_amplitude`.

    Raises
    ------
    InputError
        As `sweep`; or a displacement or a maximum amplitude that is not positive.

    See Also
    --------
    sweep : the displacement at an amplitude
    displacement_hazard : the annual rate at which a displacement is exceeded

    Examples
    --------
    >>> import slipsweep
    >>> limits = slipsweep.limit_amplitude(0.05, theta=5, mu_s=0.4, frequency=[1, 2])
    >>> limits.limit_amplitude.round(3).values
    array([3.34 , 3.756])
    """
    inputs = given_inputs(locals())
    plan = plan_limits(
        displacement,
        inputs,
        excitation=excitation,
        model=model,
        maximum_amplitude=maximum_amplitude,
        amplitude_steps=amplitude_steps,
    )
    return plan.solve(progress).assign_coords(brought_coordinates(inputs, plan.coords, plan.names))


def plan_limits(
    displacement: Any,
    inputs: Inputs,
    *,
    excitation: Any = "sine",
    model: Any = "mendez",
    maximum_amplitude: float | None = None,
    amplitude_steps: int = AMPLITUDE_STEPS,
) -> Plan:
    """Return the plan of `limit_amplitude`; same parameters and errors.

    `inputs` have no strength of the shaking.
    """

    target = check_displacement(displacement)
    dims = target.dims
    values = target.values
    steps = parameters.check_whole("amplitude_steps", amplitude_steps, 2, 1_000_000)
    # the displacement takes the place of the amplitude among the dimensions of the grid
    swapped = {**inputs, "amplitude": xr.Variable(dims, values)}
    plan = plan_sweep(
        swapped, excitation=excitation, model=model, variables=["permanent_displacement"]
    )
    ((_, request),) = plan.tasks
    if maximum_amplitude is None:
        maximum_amplitude = variables.MAXIMUM_AMPLITUDE_IN_G * request.problem.model.g
    highest = parameters.check_single("maximum_amplitude", maximum_amplitude)
    solved = dict(request.inputs)
    solved["displacement"] = solved.pop("amplitude")
    blocks = grid_sizes(
        {name: variable for name, variable in solved.items() if name not in _AFTER_SCAN}
    )
    scaled = {dim: size for dim, size in plan.sizes.items() if dim not in blocks}
    # the sliding mode, or under a record the numbers of pulses
    codes = variables.RECORD_COUNTS if "time_scale" in solved else ("sliding_mode",)
    extremes = variables.EXTREMES if options.slides_both_ways(request.problem.model) else ()
    names = (*variables.LIMIT_RESULTS, *extremes, *codes, "validity")
    request = replace(request, inputs=solved, names=names)
    return replace(
        plan,
        coords={name: variable for name, variable in plan.coords.items() if name != "amplitude"}
        | {"displacement": target},
        tasks=((partial(_solve, highest, steps), request),),
        names=names,
        attrs={
            **plan.attrs,
            "title": TITLE,
            "maximum_amplitude": highest,
            "amplitude_steps": steps,
            **limited_displacement.attributes_of(request.problem.model),
        },
        # one scan of a block serves all its targets, each of which takes some 100 cells in addition
        cost=plan.cost * (max(1.0, steps / math.prod(scaled.values())) + 100.0),
        together=tuple(scaled),
        # inputs laid out over the grid, and transposed copies
        cell_memory=60,
        described=variables.RESULTS | variables.RECORD_COUNTS | variables.LIMIT_RESULTS,
    )


def check_displacement(displacement: Any) -> xr.Variable:
    """Return tolerable displacements, m, or with a unit, as a coordinate (InputError: not > 0)."""

    def in_m(length: Any) -> Any:
        if isinstance(length, str):
            return units.quantity("displacement", length, "m", math.nan)
        return length

    lengths = (
        [in_m(length) for length in displacement]
        if isinstance(displacement, list)
        else in_m(displacement)
    )
    values = parameters.check_values("displacement", lengths)
    dims = getattr(lengths, "dims", ("displacement",) * values.ndim)
    if not values.size or len({*dims}) < values.ndim:
        raise InputError(
            f"displacement = {parameters.shown(lengths)}: must be a number, a list, or a DataArray"
            ", not empty"
        )
    return xr.Variable(dims, values, variables.TOLERABLE_DISPLACEMENT)


def _solve(maximum_amplitude: float, steps: int, request: Request) -> Variables:
    """Return the limit amplitudes of a grid.

    Its inputs have the `displacement` to be reached in place of the amplitude.
    """
    results = request.results()
    for where, motion in engine.motions(request):
        # two thresholds of a pulse, and two sides of each, in addition to the steps
        scanned = steps + 4 * _heights(motion).size
        for chunk in grid_chunks(motion.sizes, max(1, SCANNED // scanned)):
            part = motion.part(chunk)
            for name, values in _solve_part(part, maximum_amplitude, steps).items():
                results[name][chunk | where] = values
            part.count(part.cells)
    return results


def _solve_part(request: Request, maximum_amplitude: float, steps: int) -> dict[str, NDArray[Any]]:
    """Return the limit amplitudes of a part of a grid that one motion shakes."""
    scan = Scan(request, maximum_amplitude, steps)
    cell, low, high = _limits(scan)
    names = tuple(name for name in request.names if not name.startswith("limit_"))
    before = scan.solve(low, cell, names)
    after = scan.solve(high, cell, names)
    results = {name: variable.data.ravel() for name, variable in request.results().items()}
    for values in results.values():
        values[:] = math.nan if values.dtype.kind == "f" else variables.SlidingMode.MISSING
    # without a limit the validity at the maximum amplitude says why
    results["validity"][:] = scan.results["validity"][:, -1]
    valueless = np.isnan(scan.displacements).all(axis=1)
    results["limit_status"][:] = np.where(valueless, LimitStatus.INVALID, LimitStatus.NOT_REACHED)
    for name, values in {**after, "limit_amplitude": high}.items():
        results[name][cell] = values
    below = limited_displacement.displacement_of(before)
    above = limited_displacement.displacement_of(after)
    with np.errstate(invalid="ignore"):
        jumps = (above - below > JUMP * above) | np.isinf(above)  # it does not come to rest
    modes = [
        name for name in ("sliding_mode", "stick_slip_pulses", "continuous_pulses") if name in after
    ]
    other_mode = np.any([before[name] != after[name] for name in modes], axis=0)
    other_mode &= np.isfinite(above)
    results["limit_status"][cell] = np.select(
        [np.isnan(below), jumps & other_mode, jumps],
        [LimitStatus.AFTER_GAP, LimitStatus.AT_MODE_JUMP, LimitStatus.AT_JUMP],
        LimitStatus.REACHED,
    )
    return {name: values.reshape(tuple(request.sizes.values())) for name, values in results.items()}


class Scan:
    """Displacements of the cells of a part of a grid, under one motion of increasing amplitude."""

    def __init__(self, request: Request, maximum_amplitude: float, steps: int) -> None:
        self.problem = request.problem
        inputs = dict(request.inputs)
        displacement = inputs.pop("displacement")
        amplitudes = _scanned_amplitudes(request, maximum_amplitude, steps)
        # the dimensions of the grid are kept here, as blocks that differ only in their frequency
        # are solved once
        every = inputs | {"amplitude": amplitudes}
        slips = ("number_of_slips",) if isinstance(self.problem.excitation, Record) else ()
        self.moved = limited_displacement.results_of(self.problem.model)
        names = (*self.moved, "validity", *slips)
        results = engine.solve(Request(self.problem, grid_sizes(every), every, names))
        full = {**request.sizes, _ALONG: amplitudes.sizes[_ALONG]}
        #: Results and amplitudes, (cell, amplitude).
        self.results = {
            name: variable.set_dims(full).values.reshape(-1, full[_ALONG])
            for name, variable in (*results.items(), ("amplitude", amplitudes))
        }
        self.amplitudes = self.results["amplitude"]
        #: Displacements that are compared with those to be reached, (cell, amplitude).
        self.displacements = limited_displacement.displacement_of(self.results)
        #: Displacements to be reached, (cell,).
        self.targets = displacement.set_dims(request.sizes).values.ravel()
        #: Inputs but for the amplitude: one value for each cell, or one for all.
        self.inputs = {
            name: xr.Variable("cell", variable.set_dims(request.sizes).values.ravel())
            if variable.dims
            else variable
            for name, variable in inputs.items()
        }

    def solve(
        self, amplitude: Floats, cell: Indices, names: tuple[str, ...]
    ) -> dict[str, NDArray[Any]]:
        """Return results of some cells, each at its own amplitudes (a row of the array)."""
        dims = ("cell", _ALONG)[: amplitude.ndim]
        inputs = {
            name: variable[cell] if variable.dims else variable
            for name, variable in self.inputs.items()
        }
        inputs["amplitude"] = xr.Variable(dims, amplitude)
        results = engine.solve(
            Request(self.problem, dict(zip(dims, amplitude.shape, strict=True)), inputs, names)
        )
        return {name: variable.values for name, variable in results.items()}

    def reach(self, amplitude: Floats, cell: Indices) -> NDArray[np.bool_]:
        """Return True where cells reach their targets at amplitudes of their own."""
        moved = limited_displacement.displacement_of(self.solve(amplitude, cell, self.moved))
        return np.asarray(moved >= self.targets[cell].reshape(-1, *(1,) * (amplitude.ndim - 1)))


def _scanned_amplitudes(request: Request, maximum_amplitude: float, steps: int) -> xr.Variable:
    """Return the amplitudes of the scan, with both sides of every change of mode.

    They lie along the last dimension.  The other dimensions are those of the grid along which more
    than the target and the time scale varies.
    """
    problem = request.problem
    blocks = {
        name: variable for name, variable in request.inputs.items() if name not in _AFTER_SCAN
    }
    sizes = {dim: size for dim, size in request.sizes.items() if dim in grid_sizes(blocks)}
    # Newmark's block has no limiting acceleration, and may have no θ and μs that one would follow
    # from
    limited = ("limiting_acceleration",) if not isinstance(problem.model, options.Newmark) else ()
    names = ("yield_acceleration", *limited)
    blocks["amplitude"] = xr.Variable((), 0.0)
    accelerations = engine.friction_parameters(Request(problem, sizes, blocks, names))
    # a pulse begins to slide, or changes its mode, where its own peak passes Üy or Üg,lim; these do
    # not depend on A
    thresholds = np.stack([accelerations[name].values.ravel() for name in names], axis=1)
    yields = thresholds[:, :1]
    if options.slides_both_ways(problem.model):
        arrays = {name: variable.set_dims(sizes).values for name, variable in blocks.items()}
        upslope = engine.cell_inputs(problem, arrays)["upslope_yield_acceleration"]
        lowest = np.minimum(yields, np.broadcast_to(upslope, [*sizes.values()]).reshape(-1, 1))
        yields = np.where(yields > 0.0, lowest, yields)
    # without a yield acceleration there is no value at any amplitude
    start = np.minimum(np.where(yields > 0.0, yields, maximum_amplitude), maximum_amplitude)
    with np.errstate(over="ignore"):
        ratio = np.minimum(maximum_amplitude / start, np.finfo(np.float64).max)
    amplitudes = start * ratio ** np.linspace(0.0, 1.0, steps + 1)
    amplitudes[:, :1] = start
    amplitudes[:, -1] = maximum_amplitude
    amplitudes = np.maximum.accumulate(np.minimum(amplitudes, maximum_amplitude), axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        places = (thresholds[:, :, None] / _heights(request)).reshape(len(thresholds), -1)
        changes = np.hstack([places * (1.0 - 1e-15), places * (1.0 + 1e-15)])  # they are rounded
    within = np.where(
        (changes >= start) & (changes <= maximum_amplitude), changes, maximum_amplitude
    )
    scanned = np.sort(
        np.hstack([amplitudes, within[:, (within < maximum_amplitude).any(axis=0)]]), axis=1
    )
    return xr.Variable((*sizes, _ALONG), scanned.reshape(*sizes.values(), -1))


def _heights(request: Request) -> Floats:
    """Return the heights of the 128 highest pulses, in parts of the motion's amplitude.

    They increase.  A record with noise has thousands of pulses.
    """
    motion = request.problem.excitation
    if not isinstance(motion, Record):
        return np.ones(1)
    heights = (
        wave_of_record(motion, float(request.inputs["polarity"].values.item())).height / motion.peak
    )
    return np.unique(heights)[-128:]


def _limits(scan: Scan) -> Steps:
    """Return the cells that reach their targets, and neighbouring amplitudes between which they do.

    They are the lowest such amplitudes.
    """
    reaches = scan.displacements >= scan.targets[:, np.newaxis]
    reached = np.logical_or.accumulate(reaches, axis=1)
    # the scan begins at yield, where no block has moved: there is always a step before
    before = ~reached[:, :-1]
    cell, step = np.nonzero(before & reached[:, 1:])
    steps = [
        (cell, scan.amplitudes[cell, step], scan.amplitudes[cell, step + 1]),
        *_hidden_peaks(scan, before),
    ]
    # the literal rise has a gap where Kd is negative: at its edges Kd is 0, and u infinite
    steps.append(_at_change(scan, before, "validity", bits=Validity.KD_NOT_POSITIVE.value))
    if (
        "number_of_slips" in scan.results
    ):  # where it changes, u jumps; under a waveform such jumps are hidden peaks
        steps.append(_at_change(scan, before, "number_of_slips", least=0.25, part=1e-5))
    cells, low, high = (np.concatenate(values) for values in zip(*steps, strict=True))
    order = np.argsort(high, kind="stable")
    cell, at = np.unique(cells[order], return_index=True)
    lowest = order[at]
    return cell, *_bisected(
        low[lowest], high[lowest], lambda at, which: scan.reach(at, cell[which])
    )


def _hidden_peaks(scan: Scan, before: NDArray[np.bool_]) -> Iterator[Steps]:
    """Yield parts of steps in which a target is reached beside a peak between two amplitudes.

    `before`, (cell, step), is True as long as the scan itself has not reached the target.
    """
    # if a block does not recouple, u jumps up where it comes to rest one pulse earlier, then falls
    saw, parts = (0.7, 128) if isinstance(scan.problem.excitation, Record) else (0.5, 512)
    moved = scan.displacements
    slides_on = scan.results["validity"] & Validity.NOT_RECOUPLED.value != 0
    # from this part of a target on, a point may lie next to a peak, or a maximum next to a higher
    # one
    least = np.where(slides_on, saw, np.inf)
    peaks = (moved[:, 1:-1] > moved[:, :-2]) & (moved[:, 1:-1] > moved[:, 2:])
    least[:, 1:-1][peaks & ~slides_on[:, 1:-1]] = 0.9
    near = moved >= least * scan.targets[:, np.newaxis]
    cell, step = np.nonzero((near[:, 1:] | near[:, :-1]) & before)
    for chunk in grid_chunks({"cell": cell.size}, SCANNED // parts):
        cells = cell[chunk["cell"]]
        begin = step[chunk["cell"]]
        amplitudes = np.linspace(
            scan.amplitudes[cells, begin], scan.amplitudes[cells, begin + 1], parts + 1, axis=1
        )
        reaches = scan.reach(amplitudes, cells)
        (which,) = np.nonzero(reaches.any(axis=1) & ~reaches[:, 0])
        first = reaches[which].argmax(axis=1)
        yield cells[which], amplitudes[which, first - 1], amplitudes[which, first]


def _at_change(
    scan: Scan,
    before: NDArray[np.bool_],
    result: str,
    *,
    bits: int = -1,
    least: float = 0.0,
    part: float = 0.0,
) -> Steps:
    """Return steps that reach a target at a change of a result, just before it or just after it.

    The place of the change is located to a `part` of the step, if u on one side of it is at least
    the part `least` of the target.
    """
    moved = scan.displacements
    states = scan.results[result] & bits
    cell, step = np.nonzero(states[:, 1:] != states[:, :-1])
    higher = np.maximum(moved[cell, step + 1], moved[cell, step])
    # a gap is NaN, and no comparison with NaN is true: its edges are located, too
    may = before[cell, step] & ~(higher < least * scan.targets[cell])
    cell = cell[may]
    step = step[may]
    start = scan.amplitudes[cell, step]
    end = scan.amplitudes[cell, step + 1]
    state_before = states[cell, step]

    def changed(amplitude: Floats, which: Indices) -> NDArray[np.bool_]:
        there = scan.solve(amplitude, cell[which], (result,))[result] & bits
        return np.asarray(there != state_before[which])

    low, high = _bisected(start, end, changed, part * (end - start))
    at_low = scan.reach(low, cell)
    reaches = at_low | scan.reach(high, cell)
    lower = np.where(at_low, start, low)
    upper = np.where(at_low, low, high)
    return cell[reaches], lower[reaches], upper[reaches]


def _bisected(
    low: Floats,
    high: Floats,
    changed: Callable[[Floats, Indices], NDArray[np.bool_]],
    width: Floats | float = 0.0,
) -> tuple[Floats, Floats]:
    """Halve intervals until their ends are neighbours in double precision, or `width` apart.

    `changed` takes amplitudes and the indices of their intervals; it is True at `high`, not at
    `low`.
    """
    low = low.copy()
    high = high.copy()
    active = np.arange(low.size)
    width = np.broadcast_to(width, low.shape)
    while True:
        middle = low[active] + 0.5 * (high[active] - low[active])
        inside = (
            (low[active] < middle)
            & (middle < high[active])
            & (high[active] - low[active] > width[active])
        )
        active = active[inside]
        middle = middle[inside]
        if not active.size:
            return low, high
        above = changed(middle, active)
        high[active[above]] = middle[above]
        low[active[~above]] = middle[~above]
