"""What a block would do in a test: the exact solver on the table's motion, for parameters that are tried."""

import math

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid.engine import Problem
from slipsweep.kernels.block import TILE
from slipsweep.kernels.history import record_history
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
        self._cell = np.array([math.tan(math.radians(theta)), mu_s, 1.0, math.nan, math.nan, math.nan, math.nan])
        self._options = Problem(model, record, Cycle()).options(True)
        self._wave = wave_of_record(record, 1.0)

    def __call__(self, parameters: Floats, times: Floats, scale: float = 1.0) -> Floats:
        """Columns of `HISTORY` at the times, for Üy, λ and Δμ and the motion times `scale`."""
        cell = self._cell.copy()
        cell[2] = scale
        cell[3:6] = parameters
        history = np.empty((times.size, len(COLUMN)))
        record_history(np.repeat(cell, TILE), self._options, self._wave, times, history)
        return history
