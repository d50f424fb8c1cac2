"""Choice of the kernel that solves a problem.

A sine without ramps is solved in SIMD batches, other waves and records by the exact walk, Newmark's
block by kernels of its own, and all of them, if the solver is `Step`, in steps.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from slipsweep.grid.inputs import Problem
from slipsweep.kernels import (
    block,
    history,
    newmark,
    newmark_record,
    step,
    step_cells,
    step_newmark,
)
from slipsweep.kernels.grid import CELL, find_parameters
from slipsweep.kernels.newmark_history import fill_newmark_history
from slipsweep.kernels.sine.solve import solve_sine
from slipsweep.kernels.walk import solve_walk, workspace_of
from slipsweep.model.options import (
    Mendez,
    Model,
    Newmark,
    Recoupling,
    Rise,
    Step,
    StepRule,
    changing_strength,
    slides_both_ways,
)
from slipsweep.model.variables import FRICTION_PARAMETERS
from slipsweep.motion import cutting
from slipsweep.motion.paths import Path
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Sine, Waveform

#: Steps a cycle for which there is one step between two samples of a record.
STEPS_PER_SAMPLE = 64

#: Row of each result in the results of the exact kernels.
_NAMES = {"displacement": "permanent_displacement", "peak_velocity": "peak_relative_velocity"}
ROWS = {_NAMES.get(field, field): row for row, field in enumerate(block.Motion._fields)}
# Newmark's block is solved as a problem of its own
ROWS["newmark_displacement"] = ROWS["permanent_displacement"]

#: The same for steps and for Newmark's block, which also have extremes.
ROWS_WITH_EXTREMES = {name: row for row, name in enumerate(block.RESULTS)}
ROWS_WITH_EXTREMES["newmark_displacement"] = ROWS_WITH_EXTREMES["permanent_displacement"]

#: The same for `find_parameters`.
_PARAMETER_ROWS = {
    name: row for row, name in enumerate((*FRICTION_PARAMETERS, "sliding_mode", "validity"))
}


class Solver(NamedTuple):
    """A function of cells and results, which it fills in, and the layout of both.

    Cells have the dtype `cell`; results are (rows, cells), and `rows` has the row of each result.
    """

    solve: Callable[[np.ndarray, np.ndarray], Any]
    rows: Mapping[str, int]
    cell: np.dtype[Any] = CELL


def options_of(problem: Problem, wants_peak: bool) -> block.Options:
    """Return the options that all cells of a problem share, as kernels take them."""
    model = problem.model
    rise = Rise.NEWMARK
    recoupling = Recoupling.INTEGRATE
    if isinstance(model, Mendez):
        rise = Rise[model.rise.upper()]
        recoupling = Recoupling[model.recoupling.upper()]
    motion = problem.excitation
    return block.Options(
        rise=int(rise),
        recoupling=int(recoupling),
        cycles=motion.cycles if isinstance(motion, Waveform) else 1,
        wants_peak=wants_peak,
        g=model.g,
    )


def parameter_solver(problem: Problem) -> Solver:
    """Return the solver of Eqs. 7-11 and λ."""
    options = options_of(problem, wants_peak=False)
    return Solver(lambda cells, results: find_parameters(cells, options, results), _PARAMETER_ROWS)


def solver_of(problem: Problem, wants_peak: bool, polarity: float) -> Solver:
    """Return the solver of the cells of a problem that one motion shakes."""
    motion = problem.excitation
    options = options_of(problem, wants_peak)
    if isinstance(problem.solver, Step):
        return step_solver(problem, options, polarity)
    if isinstance(problem.model, Newmark):
        return newmark_solver(problem, options, polarity)
    assert not isinstance(motion, Suite)
    if is_plain_sine(motion) and not problem.walked:
        return sine_solver(motion, options)
    return walk_solver(motion, options, polarity)


def sine_solver(motion: Sine, options: block.Options) -> Solver:
    """Return the solver of the paper's block under a plain sine.

    Batches solve several cells at once.  Cells that they leave are solved one by one, and what is
    left of them by the walk.
    """

    def solve_in_batches(cells: np.ndarray, results: np.ndarray) -> None:
        solve_sine(cells, options, False, results)

    def solve_alone(cells: np.ndarray, results: np.ndarray) -> None:
        solve_sine(cells, options, True, results)

    def walk(cells: np.ndarray, results: np.ndarray) -> None:
        path = cutting.path_of_waveform(motion)
        solve_walk(cells, options, path, *workspace_of(path), results)

    def solve(cells: np.ndarray, results: np.ndarray) -> None:
        solve_in_batches(cells, results)
        for solve_others in (solve_alone, walk):
            unsolved = np.flatnonzero(results[ROWS["validity"]] == block.UNSOLVED)
            if unsolved.size:
                others = np.empty((len(block.Motion._fields), unsolved.size))
                solve_others(cells[unsolved], others)
                results[:, unsolved] = others

    return Solver(solve, ROWS)


def walk_solver(motion: Waveform | Record, options: block.Options, polarity: float) -> Solver:
    """Return the solver of the paper's block under a wave or a record: the exact walk."""
    path = path_under(motion, polarity)

    def solve(cells: np.ndarray, results: np.ndarray) -> None:
        solve_walk(cells, options, path, *workspace_of(path), results)

    return Solver(solve, ROWS)


def step_solver(problem: Problem, options: block.Options, polarity: float) -> Solver:
    """Return the solver in steps, of both models."""
    take_steps = stepper_of(problem, options, polarity)
    no_log = np.empty(0, step.LOG)

    def solve(cells: np.ndarray, results: np.ndarray) -> None:
        take_steps(cells, no_log, results)

    return Solver(solve, ROWS_WITH_EXTREMES, step_cells.STEP_CELL)


def newmark_solver(problem: Problem, options: block.Options, polarity: float) -> Solver:
    """Return the solver of Newmark's block: its own kernels, or under a plain sine the batches."""
    motion = problem.excitation
    assert not isinstance(motion, Suite)
    if isinstance(motion, Record):
        return newmark_record_solver(motion, options.g, polarity)
    path = path_under(motion, polarity)

    def solve(cells: np.ndarray, results: np.ndarray) -> None:
        blocks = np.zeros(1, newmark.BLOCK)
        newmark.solve_newmark(cells, options.g, options.wants_peak, path, blocks, results)

    def solve_in_batches(cells: np.ndarray, results: np.ndarray) -> None:
        solve_sine(cells, options, False, results)
        unsolved = np.flatnonzero(results[ROWS["validity"]] == block.UNSOLVED)
        if not unsolved.size:
            return
        others = np.full(unsolved.size, math.nan, newmark.NEWMARK_CELL)
        for name in newmark.DOWNSLOPE_FIELDS:
            others[name] = cells[name][unsolved]
        solved = np.empty((len(block.RESULTS), unsolved.size))
        solve(others, solved)
        results[:, unsolved] = solved[: results.shape[0]]

    # batches are faster: they solve several cells at once, the kernel one after another
    in_batches = is_plain_sine(motion) and not problem.walked
    if in_batches and not slides_both_ways(problem.model):
        return Solver(solve_in_batches, ROWS)
    return Solver(solve, ROWS_WITH_EXTREMES, newmark.NEWMARK_CELL)


def newmark_record_solver(record: Record, g: float, polarity: float) -> Solver:
    """Return the solver of Newmark's block under a record."""
    samples = cutting.samples_of_record(record, polarity)

    def solve(cells: np.ndarray, results: np.ndarray) -> None:
        blocks = np.zeros(1, newmark.BLOCK)
        newmark_record.solve_newmark_record(cells, g, samples, blocks, results)

    return Solver(solve, ROWS_WITH_EXTREMES, newmark.NEWMARK_CELL)


def path_under(motion: Waveform | Record, polarity: float) -> Path:
    """Return the path of the base under a waveform or a record."""
    if isinstance(motion, Record):
        return cutting.path_of_record(motion, polarity)
    return cutting.path_of_waveform(motion)


def fill_history(
    problem: Problem,
    fields: Mapping[str, Any],
    path: Path,
    phases: np.ndarray,
    samples: history.History,
) -> None:
    """Fill a history from event to event, at increasing phases (of a record: times at scale 1).

    `fields` are those of a cell, single numbers (`engine.cell_inputs`).
    """
    options = options_of(problem, wants_peak=True)
    if isinstance(problem.model, Newmark):
        cells = np.full(1, math.nan, newmark.NEWMARK_CELL)
        for name in newmark.NEWMARK_CELL.names or ():
            cells[name] = fields.get(name, math.nan)
        fill_newmark_history(cells, options.g, options.cycles, path, phases, samples)
        return
    cell = block.Cell(*(float(fields.get(name, math.nan)) for name in block.Cell._fields))
    history.fill_history(cell, options, path, phases, samples)


def stepper_of(
    problem: Problem, options: block.Options, polarity: float
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], Any]:
    """Return a function that solves cells in steps; it returns the block of the last cell.

    Its arguments are cells of dtype `step_cells.STEP_CELL`, a log, and results.
    """
    assert isinstance(problem.solver, Step)
    rule = int(StepRule[problem.solver.rule.upper()])
    count = problem.solver.steps_per_cycle
    assert not isinstance(problem.excitation, Suite)
    is_record = isinstance(problem.excitation, Record)
    on_piece = math.ceil(count / STEPS_PER_SAMPLE) if is_record else 0
    path = path_under(problem.excitation, polarity)
    steps = step_cells.steps_of(path, rule, count, on_piece)
    take_steps = stepping_kernel(problem.model)

    def solve(cells: np.ndarray, log: np.ndarray, results: np.ndarray) -> Any:
        blocks = step_cells.blocks_of(rule, count, on_piece)
        take_steps(cells, options, path, blocks, steps, log, results)
        return blocks[0]

    return solve


def stepping_kernel(model: Model) -> Callable[..., Any]:
    """Return the kernel that takes steps, by the model and the change of the block's strength."""
    if not isinstance(model, Newmark):
        return step_cells.solve_steps
    changing = changing_strength(model)
    if changing == "weakening":
        return step_newmark.solve_weakening
    return step_newmark.solve_rate if changing == "rate" else step_newmark.solve_newmark_steps


def is_plain_sine(motion: Any) -> TypeGuard[Sine]:
    """Return True if a motion is a sine without ramps, whose cells are solved in batches."""
    return isinstance(motion, Sine) and not motion.ramp_in and not motion.ramp_out


def cost_of(problem: Problem) -> int:
    """Return the cost of a cell, relative to one under a plain sine by the exact solver."""
    motion = problem.excitation
    steps = problem.solver.steps_per_cycle if isinstance(problem.solver, Step) else 0
    if isinstance(motion, Waveform):
        if steps:
            return 1 + steps // 16
        return 1 if is_plain_sine(motion) and not slides_both_ways(problem.model) else 8
    records = motion if isinstance(motion, Suite) else (motion,)
    samples = max(record.times.size for record in records)
    if isinstance(problem.model, Newmark) and not steps:
        return max(8, samples // 4096)
    return max(64, samples // 16) * math.ceil(max(steps, 1) / STEPS_PER_SAMPLE)


def memory_of(problem: Problem) -> int:
    """Return the bytes of the tables of pieces of recorded motions while cells are solved."""
    motion = problem.excitation
    if isinstance(motion, Waveform):
        return 0
    records = motion if isinstance(motion, Suite) else (motion,)
    lengths = [record.times.size for record in records]
    # there is a table for each polarity; a new one is made beside those that are kept
    kept = sorted(2 * lengths)[-cutting.MOST_TABLES :]
    return cutting.TABLE_BYTES * (max(lengths) + sum(kept))
