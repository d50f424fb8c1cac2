"""What a block would do in a test: the exact solver on the table's motion, for parameters that are tried."""

import math

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid.problem import Problem
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
    """A block of known inclination and static friction on one motion, for parameters that are tried."""

    def __init__(self, theta: float, mu_s: float, model: Mendez, record: Record) -> None:
        self.theta, self.mu_s, self.model = theta, mu_s, model
        self._options = options_of(Problem(model, record, Cycle()), wants_peak=True)
        self._wave = wave_of_record(record, 1.0)
        self._workspace = workspace_of(self._wave, keeps_log=True)

    def __call__(self, parameters: Floats, times: Floats, scale: float = 1.0) -> Floats:
        """Columns of `HISTORY` at the times, for Üy, λ and Δμ and the motion times `scale`."""
        onset, decay, drop = (float(one) for one in parameters)
        cell = Cell(math.tan(math.radians(self.theta)), self.mu_s, scale, onset, decay, drop, math.nan)
        table = np.empty((len(COLUMN), times.size))
        record_history(cell, self._options, self._wave, self._workspace, times, History(*table))
        return table.T
