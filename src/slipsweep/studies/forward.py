"""What a block would do in a test: the exact solver on the table's motion, for parameters that are tried."""

import math

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid.engine import Problem
from slipsweep.grid.solvers import options_of
from slipsweep.kernels.block import Cell
from slipsweep.kernels.exact import workspace_of
from slipsweep.kernels.history import History, record_history
from slipsweep.model.options import Cycle, Mendez
from slipsweep.model.variables import HISTORY
from slipsweep.motion.cutting import wave_of_record
from slipsweep.motion.records import Record

Floats = NDArray[np.float64]

#: Columns of a history.
COLUMN = {name: at for at, name in enumerate(HISTORY)}


class Forward:
    """A block of known inclination and static friction, on motions and with parameters that are tried.

    Attributes
    ----------
    runs : int
        Solutions so far.
    """

    def __init__(self, theta: float, mu_s: float, model: Mendez) -> None:
        self.theta, self.mu_s, self.model = theta, mu_s, model
        self.runs = 0

    def __call__(self, record: Record, parameters: Floats, times: Floats) -> Floats:
        """Columns of `HISTORY` at the times, for Üy, λ and Δμ."""
        self.runs += 1
        cell = Cell(math.tan(math.radians(self.theta)), self.mu_s, 1.0, *map(float, parameters), math.nan)
        table, wave = np.empty((len(COLUMN), times.size)), wave_of_record(record, 1.0)
        options = options_of(Problem(self.model, record, Cycle()), wants_peak=True)
        record_history(cell, options, wave, workspace_of(wave, keeps_log=True), times, History(*table))
        return table.T
