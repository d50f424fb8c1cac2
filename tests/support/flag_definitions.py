"""The flags of `validity` by their definitions (docs/model.md), in plain Python: no kernel, nothing of the package."""

import math
from typing import Any

STATICALLY_UNSTABLE = 1
UPLIFT = 2
LIMIT_UNDEFINED = 4
FRICTION_NOT_DECAYING = 8
YIELD_GOVERNS = 16
KD_NOT_POSITIVE = 32
NOT_RECOUPLED = 64
FLEXIBLE_BLOCK = 128
UPSLOPE = 256
NEAR_MODE_LIMIT = 512
FRICTION_ESTIMATED = 1024

NO_VALUE = STATICALLY_UNSTABLE | UPLIFT | LIMIT_UNDEFINED | FRICTION_NOT_DECAYING | KD_NOT_POSITIVE


def remarks(
    ratio: Any, displacement: Any, *, decay_rate: Any, delta_mu: Any, newmark: bool = False, yield_governs: bool = False
) -> int:
    """Upslope, near the mode limit, friction estimated: of a block that slides and has a value.

    Parameters
    ----------
    ratio, displacement
        ξ and u, numbers of any kind.
    decay_rate, delta_mu
        As given; None or NaN by default.
    """
    estimated = any(given is None or given != given for given in (decay_rate, delta_mu))
    return (
        UPSLOPE * bool(displacement < 0)
        | NEAR_MODE_LIMIT * bool(not newmark and 0.9 <= ratio <= 1.1)
        | FRICTION_ESTIMATED * bool(not newmark and not yield_governs and estimated)
    )


def acceleration_ratio(theta: float, mu_s: float, amplitude: float, yield_acceleration: float, g: float) -> float:
    """ξ of Eqs. 7 and 8."""
    tan_theta = math.tan(math.radians(theta))
    return amplitude / ((yield_acceleration + g * mu_s) / (1.0 - tan_theta * (mu_s - tan_theta)))


def coulomb(theta: float, mu_s: float, g: float) -> float:
    """Üy = g tan(φs − θ)."""
    return g * math.tan(math.atan(mu_s) - math.radians(theta))
