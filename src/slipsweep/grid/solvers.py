"""Which kernel solves a problem: the sine's SIMD batches, the exact walk under a wave or a record, or steps."""

from collections.abc import Callable
from typing import Any

import numpy as np

from slipsweep.grid.problem import Problem
from slipsweep.kernels import block as physics
from slipsweep.kernels.exact import workspace_of
from slipsweep.kernels.grid import find_parameters
from slipsweep.kernels.record import solve_record
from slipsweep.kernels.sine.solve import solve_sine
from slipsweep.kernels.step import solve_steps
from slipsweep.kernels.waves import solve_waves
from slipsweep.model.options import Mendez, Step
from slipsweep.model.variables import FRICTION_PARAMETERS
from slipsweep.motion import cutting
from slipsweep.motion.pieces import RECTANGLE, SIMPSON, TRAPEZOID, own_steps, steps_of
from slipsweep.motion.records import Record
from slipsweep.motion.waveforms import Sine, Waveform

RULES = {"rectangle": RECTANGLE, "trapezoid": TRAPEZOID, "simpson": SIMPSON}
RISES = {"monotone": physics.MONOTONE, "literal": physics.LITERAL}
RECOUPLINGS = {"eq12": physics.EQ12, "integrate": physics.INTEGRATE}

#: Results by their names: the row of a kernel's results that each is found in.
_NAMES = {"displacement": "permanent_displacement", "peak_velocity": "peak_relative_velocity"}
ROWS = {_NAMES.get(field, field): row for row, field in enumerate(physics.Motion._fields)}
# Newmark's block is solved as a problem of its own
ROWS["newmark_displacement"] = ROWS["permanent_displacement"]

#: The same of `find_parameters`.
PARAMETER_ROWS = {name: row for row, name in enumerate((*FRICTION_PARAMETERS, "sliding_mode", "validity"))}

#: Solves cells, of dtype `kernels.grid.CELL`, into rows of results, (rows, cells).
Solve = Callable[[np.ndarray, np.ndarray], Any]


def options_of(problem: Problem, wants_peak: bool) -> physics.Options:
    """What all cells of a problem share, as the kernels take it."""
    model = problem.model
    return physics.Options(
        rise=RISES[model.rise] if isinstance(model, Mendez) else physics.NEWMARK,
        recoupling=RECOUPLINGS[model.recoupling] if isinstance(model, Mendez) else physics.INTEGRATE,
        cycles=problem.excitation.cycles if isinstance(problem.excitation, Waveform) else 1,
        wants_peak=wants_peak,
        g=model.g,
    )


def find_friction_parameters(problem: Problem) -> Solve:
    """What finds Eqs. 7-11 and λ of cells."""
    options = options_of(problem, wants_peak=False)
    return lambda cells, results: find_parameters(cells, options, results)


def solver_of(problem: Problem, wants_peak: bool, polarity: float) -> tuple[Solve, int]:
    """What solves the cells of a problem that one motion shakes, and the time of a cell in those of the sine's."""
    motion, options = problem.excitation, options_of(problem, wants_peak)
    if isinstance(motion, Record):
        recorded = cutting.wave_of_record(motion, polarity)

        def under_record(cells: np.ndarray, results: np.ndarray) -> None:
            solve_record(cells, options, recorded, workspace_of(recorded), results)

        return under_record, max(64, recorded.pieces.shape[0] // 8)
    assert isinstance(motion, Waveform)
    if isinstance(problem.solver, Step):
        steps = steps_of(cutting.wave_of(motion), RULES[problem.solver.rule], problem.solver.steps_per_cycle)

        def by_steps(cells: np.ndarray, results: np.ndarray) -> None:
            solve_steps(cells, options, cutting.wave_of(motion), own_steps(steps), results)

        return by_steps, 1 + problem.solver.steps_per_cycle // 16

    def under_wave(cells: np.ndarray, results: np.ndarray) -> None:
        wave = cutting.wave_of(motion)
        solve_waves(cells, options, wave, workspace_of(wave), results)

    if not isinstance(motion, Sine) or motion.ramp_in or motion.ramp_out:
        return under_wave, 16

    def under_sine(cells: np.ndarray, results: np.ndarray) -> None:
        if solve_sine(cells, options, results):
            left = np.flatnonzero(results[ROWS["validity"]] == physics.UNSOLVED)
            found = np.empty((len(physics.Motion._fields), left.size))
            under_wave(cells[left], found)
            results[:, left] = found

    return under_sine, 1
