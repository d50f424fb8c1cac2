"""What all cells of a grid share."""

from dataclasses import dataclass

from slipsweep.model.options import Model, Solver
from slipsweep.motion.records import Record
from slipsweep.motion.suites import Suite
from slipsweep.motion.waveforms import Waveform


@dataclass(frozen=True)
class Problem:
    """What `slipsweep.sweep` was asked to solve, and how."""

    model: Model
    excitation: Waveform | Record | Suite
    solver: Solver
