"""One time history, exact: the cycle solver's legs sampled on any time grid."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.engine import Problem, Request
from slipsweep.grid.plans import Plan, check_problem, plan_sweep
from slipsweep.grid.resources import check_memory
from slipsweep.grid.served import check_served
from slipsweep.kernels.block import TILE
from slipsweep.kernels.history import history, record_history
from slipsweep.model.options import Newmark
from slipsweep.model.parameters import MOST_POINTS, check_numbers, check_whole, number_text
from slipsweep.model.variables import HALF_WAVES, HISTORY, VALUELESS, SlidingMode
from slipsweep.motion.cutting import wave_of, wave_of_record
from slipsweep.motion.intensity import strength_factor
from slipsweep.motion.pieces import END, START
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Waveform

Floats = NDArray[np.float64]

#: Points a cycle where none are asked for.
POINTS_PER_CYCLE = 512

#: Cycles after the shaking that have as many points each as one of the shaking; longer slides have no more points.
_CYCLES_BEYOND = 100

#: Points after a record at its mean interval; longer slides have no more.
_POINTS_BEYOND = 20_000


def history_table(
    *,
    times: Any = None,
    points_per_cycle: int | None = None,
    excitation: Any = "sine",
    model: Any = "mendez",
    **given: Any,
) -> xr.Dataset:
    """Time history of one block; keyword arguments, results and errors of `slipsweep.simulate`."""
    problem = check_problem(excitation, model, "cycle")
    if isinstance(problem.excitation, Suite):
        label = problem.excitation.labels[0]
        of = ".rotated(azimuth)" if problem.excitation.has_pairs else ""
        raise InputError(f"excitation: simulate takes one motion of a Suite, such as suite[{label!r}]{of}")
    if points_per_cycle is not None and isinstance(problem.excitation, Record):
        raise InputError("points_per_cycle: not allowed with a Record, whose samples are the points; give times")
    plan = plan_sweep(**given, excitation=problem.excitation, model=problem.model)
    for name, variable in plan.coords.items():
        if variable.dims:
            raise InputError(f"{name}: simulate takes one case; must be a single number")
    one = _History(problem, plan)
    summary = one.summary
    if times is None:
        points = POINTS_PER_CYCLE if points_per_cycle is None else points_per_cycle
        points = check_whole("points_per_cycle", points, 4, MOST_POINTS)
        phases = one.points(points)
        grid = phases * one.unit
    else:
        grid = _checked(times, least=-math.inf if isinstance(problem.excitation, Record) else 0.0)
        with np.errstate(over="ignore"):
            phases = grid / one.unit
        if not np.isfinite(phases[[0, -1]]).all():
            raise InputError(f"times = ..., {number_text(float(grid[-1]))}: too many cycles for double precision")
    columns = one.columns(phases) | one.half_waves()
    return xr.Dataset(
        {**columns, **summary.data_vars},
        {**summary.coords, "time": xr.Variable(("time",), grid, {"units": "s", "long_name": "time"})},
        summary.attrs | {"title": "Time history of a rigid block"},
    )


def _checked(times: Any, least: float) -> Floats:
    """Times that a caller gives."""
    grid = np.atleast_1d(check_numbers("times", times))
    increasing = grid.ndim == 1 and grid.size and np.isfinite(grid).all() and (np.diff(grid) > 0.0).all()
    if not increasing or (grid < least).any():
        bound = " >= 0" if least == 0.0 else ""
        raise InputError(f"times: must be one row of finite, increasing numbers{bound}")
    return grid


@dataclass(frozen=True)
class _History:
    """One case, its results as a sweep gives them, and its history.

    Phases are ωt; under a record the times at time scale 1 stand in their place.
    """

    problem: Problem
    plan: Plan

    @cached_property
    def inputs(self) -> Mapping[str, Floats]:
        """The case."""
        return {name: variable.values for name, variable in self.plan.coords.items()}

    @cached_property
    def summary(self) -> xr.Dataset:
        """Its results as a sweep gives them.

        The first history of all waits for two kernels: where there are two processors, not for one after the other.
        """
        with self._kernel.compiled_elsewhere(self._arguments(np.empty(0))):
            return self.plan.solve()

    @property
    def unit(self) -> float:
        """Seconds that a phase takes: 1/ω, or the factor on the time of a record."""
        return float(engine.kernel_inputs(self._asked)[1])

    @property
    def _asked(self) -> Request:
        return Request(self.problem, (), self.inputs, ())

    @property
    def _valueless(self) -> int:
        return int(self.summary["validity"].item()) & VALUELESS

    @property
    def _kernel(self) -> Any:
        """What samples the case."""
        return record_history if isinstance(self.problem.excitation, Record) else history

    def _arguments(self, phases: Floats) -> tuple[Any, ...]:
        """Of that kernel; it fills the last, (phase, column of `HISTORY`)."""
        motion = self.problem.excitation
        wave = wave_of_record(motion, float(self.inputs["polarity"])) if isinstance(motion, Record) else wave_of(motion)
        cells = np.repeat([float(values) for values in engine.kernel_inputs(self._asked)[0]], TILE)
        return cells, self.problem.options(True), wave, phases, np.empty((phases.size, len(HISTORY)))

    def sampled(self, phases: Floats) -> Floats:
        """The columns of `HISTORY` at phases, velocity and displacement in units of phase."""
        arguments = self._arguments(phases)
        self._kernel(*arguments)
        table: Floats = arguments[-1]
        if self._valueless:  # from the beginning on, also where the flag is raised later
            table[:, 1:] = math.nan
        return table

    def columns(self, phases: Floats) -> dict[str, xr.Variable]:
        """The variables of a history."""
        table, unit = self.sampled(phases), self.unit
        # Eq. 1 needs θ and μs
        known = {name: at for at, name in enumerate(HISTORY)}
        if "mu_s" not in self.inputs:
            del known["friction_coefficient"]
        with np.errstate(over="ignore"):
            table[:, 3] *= unit
            table[:, 4] *= unit * unit
        if not self._valueless:
            moved = {name: table[:, at] for name, at in known.items()}
            check_served(self.problem.model.g, self.inputs, moved, np.zeros(len(table), np.int16))
        columns = {name: np.ascontiguousarray(table[:, at]) for name, at in known.items()}
        return {name: xr.Variable(("time",), values, HISTORY[name]) for name, values in columns.items()}

    def half_waves(self) -> dict[str, xr.Variable]:
        """The positive half waves of a record, and the sliding mode of each (`HALF_WAVES`); of a waveform none."""
        record = self.problem.excitation
        if not isinstance(record, Record):
            return {}
        wave = wave_of_record(record, float(self.inputs["polarity"]))
        with np.errstate(over="ignore"):
            peak = wave.height * float(strength_factor(record, self.inputs))
        limited = () if isinstance(self.problem.model, Newmark) else ("limiting_acceleration",)
        block = {**{name: np.atleast_1d(values) for name, values in self.inputs.items()}, "amplitude": np.zeros(1)}
        known = engine.friction_parameters(Request(self.problem, (1,), block, ("yield_acceleration", *limited)))
        mode = np.where(peak > known["yield_acceleration"], SlidingMode.STICK_SLIP, SlidingMode.STUCK)
        for limit in (known[name] for name in limited):
            mode = np.where((mode != SlidingMode.STUCK) & (peak > limit), SlidingMode.CONTINUOUS, mode)
        if self._valueless:
            mode = np.full(peak.shape, SlidingMode.MISSING)
        first, after = wave.stretch.T
        found = {
            "half_wave_start": self.unit * wave.pieces[first, START],
            "half_wave_end": self.unit * wave.pieces[after - 1, END],
            "half_wave_peak": peak,
            "half_wave_mode": mode.astype(np.int8),
        }
        return {name: xr.Variable(("half_wave",), values, HALF_WAVES[name]) for name, values in found.items()}

    def points(self, points_per_cycle: int) -> Floats:
        """Phases of so many points a cycle, or the samples of a record, and on to the end of the slide."""
        motion = self.problem.excitation
        if isinstance(motion, Record):
            step = float(motion.times[-1] - motion.times[0]) / (motion.times.size - 1)
            _check_memory(motion.times.size + _POINTS_BEYOND)
            return _to_the_end(motion.times, step, max(_POINTS_BEYOND, motion.times.size), self._runs_on())
        assert isinstance(motion, Waveform)
        step, shaken = 2.0 * math.pi / points_per_cycle, points_per_cycle * motion.cycles
        _check_memory(shaken + _CYCLES_BEYOND * points_per_cycle)
        return _to_the_end(
            step * np.arange(shaken + 1, dtype=np.float64), step, _CYCLES_BEYOND * points_per_cycle, self._runs_on()
        )

    def _runs_on(self) -> float:
        """How long the block slides on after the shaking."""
        motion = self.problem.excitation
        assert not isinstance(motion, Suite)
        slides = isinstance(motion, Record) or self.summary["sliding_mode"].item() == SlidingMode.STICK_SLIP
        if not slides or self._valueless:
            return 0.0
        end = 2.0 * math.pi * motion.cycles if isinstance(motion, Waveform) else motion.times[-1]
        ground, block, _, velocity, _ = self.sampled(np.array([end]))[0]
        # beyond the shaking the block is still braked, by b = Ü - Üg (Eq. 12)
        with np.errstate(divide="ignore", over="ignore"):
            return float(velocity / (block - ground)) if velocity != 0.0 else 0.0


def _to_the_end(shaken: Floats, step: float, most: int, after: float) -> Floats:
    """Phases of the shaking, and others a `step` apart, `most` of them, to the end of the slide `after` it.

    A slide that brakes by 1e-7 m/s² lasts for months.  Under a constant deceleration few points tell
    all: they are spaced further apart then.
    """
    if not math.isfinite(after):
        raise InputError(
            "the block slides on after the shaking for more cycles than double precision holds; give times, or a "
            "larger yield_acceleration"
        )
    beyond = math.ceil(min(after, most * step) / step)
    if after <= most * step:
        rest = np.arange(1, beyond + 1) * step
    else:
        # a hair further than the end, which is rounded
        rest = np.linspace(0.0, after * (1.0 + 1e-12), beyond + 1)[1:]
    return np.concatenate([shaken, shaken[-1] + rest])


def _check_memory(samples: int) -> None:
    """Refuse what memory cannot hold: the table, its columns apart, phases and times."""
    needed = samples * 8 * (2 * len(HISTORY) + 2)
    check_memory(f"a history of {samples:.4g} points", needed, "take fewer cycles or points_per_cycle, or give times")
