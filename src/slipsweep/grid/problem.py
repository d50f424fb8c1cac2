"""What all cells of a grid share: model, motion, solver."""

from dataclasses import dataclass
from typing import Any

from slipsweep.errors import InputError
from slipsweep.model.options import MODELS, SOLVERS, Cycle, Model, Solver, Step
from slipsweep.motion.cutting import MOST_TABLES, TABLE_BYTES
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import WAVEFORMS, Waveform

#: Cells of the cycle solver that a cell of a record takes, about.
_RECORD_COST = 200


@dataclass(frozen=True)
class Problem:
    """What `slipsweep.sweep` was asked to solve, and how."""

    model: Model
    excitation: Waveform | Record | Suite
    solver: Solver


def check_problem(excitation: Any, model: Any, solver: Any) -> Problem:
    """What is to be solved, and how; each is an object, or the name of one with its defaults."""
    motion = excitation if isinstance(excitation, (Record, Suite)) else WAVEFORMS.of(excitation)
    chosen = SOLVERS.of(solver)
    if isinstance(motion, (Record, Suite)) and not isinstance(chosen, Cycle):
        raise InputError(f"solver = {chosen}: not allowed with a {type(motion).__name__}, to which Cycle() is exact")
    return Problem(MODELS.of(model), motion, chosen)


def cost_of(problem: Problem) -> float:
    """What a cell takes, in cells of the cycle solver."""
    if isinstance(problem.excitation, (Record, Suite)):
        return _RECORD_COST
    return 1.0 + problem.solver.steps_per_cycle / 16 if isinstance(problem.solver, Step) else 1.0


def memory_of(problem: Problem) -> int:
    """Bytes of the tables of pieces of recorded motions, while cells are solved."""
    if isinstance(problem.excitation, Waveform):
        return 0
    suite = problem.excitation
    lengths = [one.times.size for one in (suite if isinstance(suite, Suite) else (suite,))]
    # of two polarities; one table is made beside those that are kept
    kept = sorted(2 * lengths)[-MOST_TABLES:]
    return TABLE_BYTES * (max(lengths) + sum(kept))
