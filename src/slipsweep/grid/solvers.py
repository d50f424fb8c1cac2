"""Which kernel solves a problem: the sine's SIMD batches, the exact walk under a wave or a record, or steps."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from slipsweep.grid.inputs import Problem
from slipsweep.kernels import block as physics
from slipsweep.kernels.grid import find_parameters
from slipsweep.kernels.sine.solve import batches_of_sine, solve_sine
from slipsweep.kernels.step import RECTANGLE, SIMPSON, TRAPEZOID, solve_steps
from slipsweep.kernels.walk import solve_walk, workspace_of
from slipsweep.model.options import Mendez, Step
from slipsweep.model.variables import FRICTION_PARAMETERS
from slipsweep.motion import cutting
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
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
_PARAMETER_ROWS = {
    name: row for row, name in enumerate((*FRICTION_PARAMETERS, "sliding_mode", "validity"))
}


class Solver(NamedTuple):
    """What solves cells, of dtype `kernels.grid.CELL`, into results, (rows, cells)."""

    solve: Callable[[np.ndarray, np.ndarray], Any]
    rows: Mapping[str, int]  # of the results


def options_of(problem: Problem, wants_peak: bool) -> physics.Options:
    """What all cells of a problem share, as the kernels take it."""
    model = problem.model
    return physics.Options(
        rise=RISES[model.rise] if isinstance(model, Mendez) else physics.NEWMARK,
        recoupling=RECOUPLINGS[model.recoupling]
        if isinstance(model, Mendez)
        else physics.INTEGRATE,
        cycles=problem.excitation.cycles if isinstance(problem.excitation, Waveform) else 1,
        wants_peak=wants_peak,
        g=model.g,
    )


def parameter_solver(problem: Problem) -> Solver:
    """What finds Eqs. 7-11 and λ of cells."""
    options = options_of(problem, wants_peak=False)
    return Solver(lambda cells, results: find_parameters(cells, options, results), _PARAMETER_ROWS)


def solver_of(problem: Problem, wants_peak: bool, polarity: float) -> Solver:
    """What solves the cells of a problem that one motion shakes."""
    motion = problem.excitation
    options = options_of(problem, wants_peak)

    def under_wave(cells: np.ndarray, results: np.ndarray) -> None:
        path = cutting.path_of_waveform(motion)
        solve_walk(cells, options, path, *workspace_of(), results)

    def under_sine(cells: np.ndarray, results: np.ndarray) -> None:
        if solve_sine(cells, options, batches_of_sine(), results):
            left = np.flatnonzero(results[ROWS["validity"]] == physics.UNSOLVED)
            found = np.empty((len(physics.Motion._fields), left.size))
            under_wave(cells[left], found)
            results[:, left] = found

    if isinstance(motion, Record):
        path = cutting.path_of_record(motion, polarity)
        return Solver(
            lambda cells, results: solve_walk(cells, options, path, *workspace_of(), results), ROWS
        )
    assert isinstance(motion, Waveform)
    if isinstance(problem.solver, Step):
        wave = cutting.wave_of(motion)
        rule = RULES[problem.solver.rule]
        count = problem.solver.steps_per_cycle
        return Solver(
            lambda cells, results: solve_steps(cells, options, wave, rule, count, results), ROWS
        )
    return Solver(under_sine if is_plain_sine(motion) else under_wave, ROWS)


def is_plain_sine(motion: Any) -> bool:
    """Whether a motion is a sine without ramps, whose cells are solved in batches."""
    return isinstance(motion, Sine) and not motion.ramp_in and not motion.ramp_out


def cost_of(problem: Problem) -> int:
    """What a cell takes, about, in those of a plain sine by the cycle solver."""
    motion = problem.excitation
    if isinstance(motion, Waveform):
        if isinstance(problem.solver, Step):
            return 1 + problem.solver.steps_per_cycle // 16
        return 1 if is_plain_sine(motion) else 16
    return max(
        64, max(one.times.size for one in (motion if isinstance(motion, Suite) else (motion,))) // 8
    )


def memory_of(problem: Problem) -> int:
    """Bytes of the tables of pieces of recorded motions, while cells are solved."""
    if isinstance(problem.excitation, Waveform):
        return 0
    suite = problem.excitation
    lengths = [one.times.size for one in (suite if isinstance(suite, Suite) else (suite,))]
    # of two polarities; one table is made beside those that are kept
    kept = sorted(2 * lengths)[-cutting.MOST_TABLES :]
    return cutting.TABLE_BYTES * (max(lengths) + sum(kept))
