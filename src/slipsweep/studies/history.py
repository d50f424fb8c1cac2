"""One time history, exact: the phases of motion that the cycle solver finds, sampled at any times."""

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import engine
from slipsweep.grid.engine import Request
from slipsweep.grid.inputs import Inputs
from slipsweep.grid.plans import Plan, check_problem, plan_sweep
from slipsweep.grid.problem import Problem
from slipsweep.grid.resources import check_memory
from slipsweep.grid.solvers import options_of
from slipsweep.kernels.block import Cell
from slipsweep.kernels.exact import workspace_of
from slipsweep.kernels.history import History, record_history, wave_history
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

#: Points a cycle where none are given.
POINTS_PER_CYCLE = 512

#: Cycles after the shaking that have as many points each as one of the shaking; longer slides have no more points.
_CYCLES_BEYOND = 100

#: Points after a record at its mean interval; longer slides have no more.
_POINTS_BEYOND = 20_000

#: Cycles from which on a history takes so long that Ctrl-C must be heard before its end.
_MANY_CYCLES = 100_000


def time_history(
    inputs: Inputs,
    *,
    excitation: Any = "sine",
    model: Any = "mendez",
    times: Any = None,
    points_per_cycle: int | None = None,
) -> xr.Dataset:
    """Time history of one block; parameters, results and errors of `slipsweep.simulate`."""
    problem = check_problem(excitation, model, "cycle")
    if isinstance(problem.excitation, Suite):
        label = problem.excitation.labels[0]
        of = ".rotated(azimuth)" if problem.excitation.has_pairs else ""
        raise InputError(f"excitation: simulate takes one motion of a Suite, such as suite[{label!r}]{of}")
    if points_per_cycle is not None and isinstance(problem.excitation, Record):
        raise InputError("points_per_cycle: not allowed with a Record, whose samples are the points; give times")
    plan = plan_sweep(inputs, excitation=problem.excitation, model=problem.model)
    for name, variable in plan.coords.items():
        if variable.dims:
            raise InputError(f"{name}: simulate takes one case; must be a single number")
    one = _History(problem, plan)
    if times is None:
        points = POINTS_PER_CYCLE if points_per_cycle is None else points_per_cycle
        phases = one.points(check_whole("points_per_cycle", points, 4, MOST_POINTS))
        grid = phases * one.unit
    else:
        grid = _checked(times, least=-math.inf if isinstance(problem.excitation, Record) else 0.0)
        with np.errstate(over="ignore"):
            phases = grid / one.unit
        if not np.isfinite(phases[[0, -1]]).all():
            raise InputError(f"times = ..., {number_text(float(grid[-1]))}: too many cycles for double precision")
    attrs = one.summary.attrs | {"title": "Time history of a rigid block"}
    time = xr.Variable(("time",), grid, {"units": "s", "long_name": "time"})
    return one.summary.assign(one.columns(phases) | one.half_waves()).assign_coords(time=time).assign_attrs(attrs)


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

    Phases are ωt; under a record the times at time scale 1 take their place.
    """

    problem: Problem
    plan: Plan

    @cached_property
    def inputs(self) -> Mapping[str, Floats]:
        """The case."""
        return {name: variable.values for name, variable in self.plan.coords.items()}

    @cached_property
    def summary(self) -> xr.Dataset:
        """Its results as a sweep gives them."""
        return self.plan.solve()

    @cached_property
    def unit(self) -> float:
        """Seconds that a phase takes: 1/ω, or the factor on the time of a record."""
        return float(engine.phase_seconds(self.problem, self.inputs))

    @property
    def _valueless(self) -> bool:
        return bool(int(self.summary["validity"]) & VALUELESS)

    def sampled(self, phases: Floats) -> Floats:
        """The columns of `HISTORY` at phases, velocity and displacement in units of phase."""
        motion, table = self.problem.excitation, np.empty((len(HISTORY), phases.size))
        wave = wave_of_record(motion, float(self.inputs["polarity"])) if isinstance(motion, Record) else wave_of(motion)
        given = engine.cell_inputs(self.problem, self.inputs)
        cell = Cell(*(float(given.get(name, math.nan)) for name in Cell._fields))
        kernel = record_history if isinstance(motion, Record) else wave_history
        options = options_of(self.problem, wants_peak=True)
        arguments = cell, options, wave, workspace_of(wave, keeps_log=True), phases, History(*table)
        if isinstance(motion, Waveform) and motion.cycles > _MANY_CYCLES:
            # the main thread hears Ctrl-C while it waits; a thread that is a daemon does not hold up the exit
            thread = threading.Thread(target=kernel, args=arguments, daemon=True)
            thread.start()
            thread.join()
        else:
            kernel(*arguments)
        if self._valueless:  # from the beginning on, also where the flag is raised later
            table[1:] = math.nan
        return table.T

    def columns(self, phases: Floats) -> dict[str, xr.Variable]:
        """The variables of a history."""
        table = self.sampled(phases)
        # Eq. 1 needs θ and μs
        known = {name: at for at, name in enumerate(HISTORY) if name != "friction_coefficient" or "mu_s" in self.inputs}
        with np.errstate(over="ignore"):
            table[:, 3] *= self.unit
            table[:, 4] *= self.unit * self.unit
        if not self._valueless and not np.isfinite(table[:, list(known.values())]).all():
            given = ", ".join(f"{name} = {number_text(float(values))}" for name, values in self.inputs.items())
            raise InputError(f"{given}: the history is then no finite number in double precision; must be nearer to 1")
        return {name: xr.Variable(("time",), table[:, at].copy(), HISTORY[name]) for name, at in known.items()}

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
        first, after = wave.interval.T
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
            shaken = motion.times
            step, most = float(np.ptp(shaken)) / (shaken.size - 1), max(_POINTS_BEYOND, shaken.size)
            _check_memory(shaken.size + _POINTS_BEYOND)
        else:
            assert isinstance(motion, Waveform)
            step, most = 2.0 * math.pi / points_per_cycle, _CYCLES_BEYOND * points_per_cycle
            _check_memory(points_per_cycle * motion.cycles + most)
            shaken = step * np.arange(points_per_cycle * motion.cycles + 1, dtype=np.float64)
        return _to_the_end(shaken, step, most, self._runs_on())

    def _runs_on(self) -> float:
        """How long the block slides on after the shaking."""
        motion = self.problem.excitation
        slides = isinstance(motion, Record) or self.summary["sliding_mode"] == SlidingMode.STICK_SLIP
        if not slides or self._valueless:
            return 0.0
        assert not isinstance(motion, Suite)
        end = 2.0 * math.pi * motion.cycles if isinstance(motion, Waveform) else motion.times[-1]
        ground, block, _, velocity, _ = self.sampled(np.array([end]))[0]
        # after the shaking the block is still braked, by b = Ü - Üg (Eq. 12)
        with np.errstate(divide="ignore", over="ignore"):
            return float(velocity / (block - ground)) if velocity != 0.0 else 0.0


def _to_the_end(shaken: Floats, step: float, most: int, after: float) -> Floats:
    """Phases of the shaking, and others a `step` apart, `most` of them, to the end of the slide `after` it.

    A slide that brakes by 1e-7 m/s² lasts for months.  Under a constant deceleration few points are enough: they are
    spaced further apart then.
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
