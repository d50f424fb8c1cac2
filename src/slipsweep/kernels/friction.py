"""Eq. 1 on recorded accelerations."""

import numpy as np

from slipsweep.jit.cache import Kernel
from slipsweep.model import equations as eq


def _mobilised_friction(
    table: np.ndarray, block: np.ndarray, mu_s: float, tan_theta: float, g: float, friction: np.ndarray
) -> None:
    for at in range(table.size):
        friction[at] = eq.mobilised_friction(table[at], block[at], mu_s, tan_theta, g)


#: Fills the friction that goes with accelerations of the table and of the block.
mobilised_friction = Kernel(_mobilised_friction)
