"""The peak acceleration of a motion whose peak displacement is given."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def peak_acceleration(displacement_amplitude: NDArray[np.float64], frequency: NDArray[np.float64]) -> NDArray[Any]:
    """A = (2πf)² d of a motion of peak displacement d (m), m/s²; the arrays broadcast."""
    omega = 2.0 * math.pi * frequency
    with np.errstate(over="ignore"):  # `plans.plan_sweep` refuses what has no finite A
        return omega * omega * displacement_amplitude
