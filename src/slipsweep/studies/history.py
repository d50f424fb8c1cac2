"""`simulate`: the motion of one block over time, at any times."""

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine, plans, resources, solvers
from slipsweep.grid.inputs import Problem, check_problem, given_inputs
from slipsweep.kernels import step, step_cells
from slipsweep.kernels.block import RESULTS
from slipsweep.kernels.history import History
from slipsweep.model import equations, options, parameters, variables
from slipsweep.model.docstrings import with_parameters
from slipsweep.model.variables import HISTORY
from slipsweep.motion import cutting
from slipsweep.motion.paths import values_at
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Waveform
from slipsweep.studies.sweeps import Excitation, naming_choices

Floats = NDArray[np.float64]


@naming_choices
@with_parameters
def simulate(
    theta: float | None = None,
    mu_s: float | None = None,
    amplitude: float | None = None,
    frequency: float | None = None,
    *,
    excitation: Excitation = "sine",
    model: options.Model | str = "mendez",
    solver: options.Solver | str = "auto",
    phi: float | None = None,
    displacement_amplitude: float | None = None,
    yield_acceleration: float | None = None,
    yield_coefficient: float | None = None,
    upslope_yield_acceleration: float | None = None,
    decay_rate: float | None = None,
    delta_mu: float | None = None,
    minimum_friction: float | None = None,
    residual_mu: float | None = None,
    residual_phi: float | None = None,
    weakening_distance: float | None = None,
    fast_mu: float | None = None,
    rate_constant: float | None = None,
    structure_frequency: float | None = None,
    scale: float | None = None,
    pgv: float | None = None,
    arias_intensity: float | None = None,
    time_scale: float | None = None,
    polarity: int | None = None,
    times: Sequence[float] | np.ndarray | None = None,
    points_per_cycle: int | None = None,
) -> xr.Dataset:
    """Time history of one block: event by event, so that the samples are exact, or by steps.

    Of a suite one motion is taken: ``excitation=suite["label"]``, of a pair
    ``suite["label"].rotated(azimuth)``.

    Parameters
    ----------
    times : array, optional
        Times to sample, s, increasing, and not negative under a waveform; by default
        `points_per_cycle` a cycle, from 0 to the end of the shaking, or the times of a record's
        samples; and on until the block has come to rest, if that is later.  A slide that lasts long
        after the shaking has as many points as 100 cycles have (after a record 20 000, or as many
        as it has samples), evenly spaced.
    points_per_cycle : int, optional
        Samples a cycle where `times` is not given, 512 by default; not with a record.

    Returns
    -------
    Dataset
        Along `time` (s): `ground_acceleration`, `block_acceleration` (m/s²), `friction_coefficient`
        (what Eq. 1 gives for the two; not with `yield_coefficient`), `relative_velocity` (m/s) and
        `relative_displacement` (m); and the results of `sweep` for the case.  Where the base's
        acceleration jumps, as at the end of a record, the values are those after the jump.  NaN
        where the case has no value (`validity`).

    Raises
    ------
    InputError
        As `sweep`; or times that are not increasing.

    See Also
    --------
    sweep : many blocks, without their histories

    Examples
    --------
    The stick-slip test of the paper, with its printed λ:

    >>> import slipsweep
    >>> history = slipsweep.simulate(
    ...     5, 0.38, 3.55, 1.8, yield_acceleration=0.59, decay_rate=2.7,
    ...     excitation=slipsweep.Sine(cycles=5),
    ... )
    >>> mm = history.permanent_displacement.item() * 1000
    >>> print(f"{mm:.0f} mm after {history.time.values[-1]:.2f} s")
    331 mm after 2.78 s
    """
    inputs = given_inputs(locals())
    problem = check_problem(excitation, model, solver)
    motion = problem.excitation
    if isinstance(motion, Suite):
        one_motion = f"suite[{motion.labels[0]!r}]{'.rotated(azimuth)' if motion.has_pairs else ''}"
        raise InputError(f"excitation: simulate takes one motion of a Suite, such as {one_motion}")
    if points_per_cycle is not None and isinstance(motion, Record):
        raise InputError(
            "points_per_cycle: not allowed with a Record, whose samples are the points; give times"
        )
    plan = plans.plan_sweep(
        inputs, excitation=motion, model=problem.model, solver=problem.solver, walked=True
    )
    for name, variable in plan.coords.items():
        if variable.dims:
            raise InputError(f"{name}: simulate takes one case; must be a single number")
    case = _History(problem, plan.coords, plan.solve())
    if times is None:
        points = 512 if points_per_cycle is None else points_per_cycle
        phases = case.points(
            parameters.check_whole("points_per_cycle", points, 4, parameters.MOST_POINTS)
        )
        grid = phases * case.unit
    else:
        grid = np.atleast_1d(parameters.check_numbers("times", times))
        least, sign = (0.0, " >= 0") if isinstance(motion, Waveform) else (-math.inf, "")
        with np.errstate(over="ignore"):
            phases = grid / case.unit
        increasing = (
            grid.ndim == 1 and grid.size and (np.diff(grid) > 0.0).all() and grid[0] >= least
        )
        if not increasing or not np.isfinite(phases).all():
            raise InputError(f"times: must be one row of finite, increasing numbers{sign}")
    time = xr.Variable(("time",), grid, {"units": "s", "long_name": "time"})
    series = case.columns(phases) | case.half_waves()
    history = case.summary.assign(series).assign_coords(time=time)
    return history.assign_attrs(title="Time history of a rigid block")


class _History:
    """The history of one case; `summary` has its results as a sweep gives them.

    Phases are ωt, or the times of a record at time scale 1.
    """

    def __init__(
        self, problem: Problem, inputs: Mapping[str, xr.Variable], summary: xr.Dataset
    ) -> None:
        self.problem = problem
        self.inputs = inputs
        self.summary = summary
        cell = engine.cell_inputs(problem, inputs)
        motion = problem.excitation
        self.fields = {name: float(value) for name, value in cell.items()}
        self.options = solvers.options_of(problem, wants_peak=True)
        self.record = motion if isinstance(motion, Record) else None
        if self.record is not None:
            self.path = cutting.path_of_record(self.record, float(inputs["polarity"]))
        else:
            self.path = cutting.path_of_waveform(motion)
        #: Seconds that a phase takes: 1/ω, or the factor on the time of a record.
        self.unit = float(engine.phase_seconds(problem, inputs))
        self.valueless = bool(int(summary["validity"]) & variables.VALUELESS)

    def sampled(self, phases: Floats) -> Floats:
        """Return the rows of `HISTORY` at phases; phase is the unit of time."""
        table = np.empty((len(HISTORY), phases.size))
        if isinstance(self.problem.solver, options.Step):
            self._step(phases, table)
        else:
            self._walk(phases, table)
        if self.valueless:  # there is no value from the beginning on
            table[1:] = math.nan
        return table

    def _logged(self) -> np.ndarray:
        """Return the steps that are taken, of dtype `step.LOG`."""
        polarity = 1.0 if self.record is None else float(self.inputs["polarity"])
        stepper = solvers.stepper_of(self.problem, self.options, polarity)
        cells = np.full((1, len(step_cells.STEP_CELL.names or ())), math.nan).view(
            step_cells.STEP_CELL
        )[:, 0]
        for name, value in self.fields.items():
            cells[name] = value
        results = np.empty((len(RESULTS), 1))
        # the first run counts the steps, the second logs them
        counted = _interruptible(stepper, cells, np.empty(1, step.LOG), results)
        log = np.empty(int(counted["logged"]), step.LOG)
        _interruptible(stepper, cells, log, results)
        return log

    def _step(self, phases: Floats, table: Floats) -> None:
        """Fill in a history by steps."""
        log = self._logged()
        table[0] = self.fields["amplitude"] * values_at(self.path, phases)
        table[1], table[3], table[4] = step_cells.samples_of(log, phases, table[0])
        table[2] = equations.mobilised_friction(
            table[0],
            table[1],
            self.fields.get("mu_s", math.nan),
            self.fields.get("tan_theta", math.nan),
            self.options.g,
        )

    def _walk(self, phases: Floats, table: Floats) -> None:
        """Fill in a history from event to event."""
        _interruptible(
            solvers.fill_history, self.problem, self.fields, self.path, phases, History(*table)
        )

    def columns(self, phases: Floats) -> dict[str, xr.Variable]:
        """Return the variables of a history."""
        series = dict(zip(HISTORY, self.sampled(phases), strict=True))
        if "mu_s" not in self.inputs:  # Eq. 1 needs θ and μs
            del series["friction_coefficient"]
        with np.errstate(over="ignore"):
            series["relative_velocity"] *= self.unit
            series["relative_displacement"] *= self.unit * self.unit
        if not self.valueless and not all(np.isfinite(values).all() for values in series.values()):
            inputs_text = ", ".join(
                f"{name} = {parameters.number_text(float(value))}"
                for name, value in self.inputs.items()
            )
            raise InputError(
                f"{inputs_text}: the history is then no finite number in double precision; must be "
                "nearer to 1"
            )
        return {
            name: xr.Variable(("time",), values.copy(), HISTORY[name])
            for name, values in series.items()
        }

    def half_waves(self) -> dict[str, xr.Variable]:
        """Return the positive half waves of a record and their sliding modes (`HALF_WAVES`).

        A waveform has none.
        """
        if self.record is None:
            return {}
        with np.errstate(over="ignore"):
            peak = self.path.intervals["height"] * self.fields["amplitude"]
        of_half_waves = {**self.inputs, "amplitude": xr.Variable("half_wave", peak)}
        sizes = {"half_wave": peak.size}
        request = engine.Request(self.problem, sizes, of_half_waves, ("sliding_mode",))
        mode = engine.friction_parameters(request)["sliding_mode"].values
        if self.valueless:
            mode[:] = variables.SlidingMode.MISSING
        first = self.path.intervals["first"]
        after = self.path.intervals["end"]
        series = {
            "half_wave_start": self.unit * self.path.base.pieces["start"][first],
            "half_wave_end": self.unit * self.path.base.pieces["end"][after - 1],
            "half_wave_peak": peak,
            "half_wave_mode": mode,
        }
        return {
            name: xr.Variable(("half_wave",), values, variables.HALF_WAVES[name])
            for name, values in series.items()
        }

    def points(self, points_per_cycle: int) -> Floats:
        """Return phases of the shaking (of a record, its samples) and of the slide after it."""
        # points of the shaking, and most points of a slide after it
        if self.record is not None:
            count = self.record.times.size
            most = max(20_000, self.record.times.size)
            step = float(np.ptp(self.record.times)) / (count - 1)
        else:
            count = points_per_cycle * self.options.cycles + 1
            most = 100 * points_per_cycle
            step = 2.0 * math.pi / points_per_cycle
        # table, copies of its columns, phases and times
        needed = (count + most) * 8 * (2 * len(HISTORY) + 2)
        advice = "take fewer cycles or points_per_cycle, or give times"
        resources.check_memory(f"a history of {count + most:.4g} points", needed, advice)
        shaken = (
            self.record.times
            if self.record is not None
            else step * np.arange(count, dtype=np.float64)
        )
        after = 0.0
        if options.changing_strength(self.problem.model) is not None and not self.valueless:
            log = self._logged()
            end = log["time"][-1] + log["step"][-1] if log.size else 0.0
            after = max(float(end - shaken[-1]), 0.0)
            return self._points_to(shaken, after, step, most)
        stick_slip = variables.SlidingMode.STICK_SLIP
        if not self.valueless and self.summary.get("sliding_mode", stick_slip) == stick_slip:
            ground, block, _, velocity, _ = self.sampled(shaken[-1:])[:, 0]
            # after the shaking the block is still braked, by b = Ü - Üg (Eq. 12)
            with np.errstate(divide="ignore", over="ignore"):
                after = float(velocity / (block - ground)) if velocity != 0.0 else 0.0
        if not math.isfinite(after):
            raise InputError(
                "the block slides on after the shaking for more cycles than double precision "
                "holds; give times, or a larger yield_acceleration"
            )
        return self._points_to(shaken, after, step, most)

    def _points_to(self, shaken: Floats, after: float, step: float, most: int) -> Floats:
        """Return the phases of the shaking, then those of the slide that goes on after it."""
        # a slide that brakes by 1e-7 m/s² lasts for months: under a constant deceleration few
        # points are enough
        beyond = math.ceil(min(after, most * step) / step)
        # a little beyond the end, which is rounded
        rest = np.linspace(0.0, max(after * (1.0 + 1e-12), beyond * step), beyond + 1)[1:]
        return np.concatenate([shaken, shaken[-1] + rest])


def _interruptible(kernel: Callable[..., Any], *args: Any) -> Any:
    """Run a kernel on a daemon thread, so that Ctrl-C interrupts it and ends the program."""
    done: Future[Any] = Future()

    def run() -> None:
        try:
            done.set_result(kernel(*args))
        except BaseException as error:  # raised where the result is waited for
            done.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return done.result()
