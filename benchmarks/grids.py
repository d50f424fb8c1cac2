"""The grids that are measured: the range of a design chart, whole and regime by regime."""

from typing import Any

import numpy as np

import slipsweep
from slipsweep import SlidingMode
from slipsweep.model.options import Rule

G = 9.81

#: Regimes, and the options that go with them.
REGIMES: dict[str, dict[str, Any]] = {
    "stuck": {},
    "stick_slip": {},
    "continuous": {},
    "newmark": {"model": "newmark"},
}

#: The rules of the stepping solver.
RULES: tuple[Rule, ...] = ("rectangle", "trapezoid", "simpson")

#: The ranges of the design grid: θ in degrees, μs, and A in g.
_DESIGN = ((0.0, 20.0), (0.2, 0.9), (0.05, 1.4))

#: Those of boxes of it that lie in one regime.
BOXES = {
    "stuck": ((0.0, 5.0), (0.75, 0.9), (0.2, 0.5)),
    "stick_slip": ((12.0, 17.0), (0.75, 0.9), (0.7, 0.95)),
    "continuous": ((12.0, 17.0), (0.35, 0.55), (1.05, 1.35)),
    "newmark": ((12.0, 17.0), (0.75, 0.9), (0.7, 0.95)),
}


def _axes(ranges: tuple[tuple[float, float], ...], *sizes: int) -> dict[str, Any]:
    theta, mu_s, amplitude = (
        np.linspace(*ends, size) for ends, size in zip(ranges, sizes, strict=True)
    )
    return {"theta": theta, "mu_s": mu_s, "amplitude": amplitude * G, "frequency": 1.0}


def design_grid(thetas: int, frictions: int, amplitudes: int) -> dict[str, Any]:
    """θ 0-20°, μs 0.2-0.9 and A 0.05-1.4 g at 1 Hz."""
    return _axes(_DESIGN, thetas, frictions, amplitudes)


def regime_box(regime: str, count: int) -> dict[str, Any]:
    """About `count` cells of one of the `BOXES`, on axes."""
    side = max(2, round((count / 8) ** (1 / 3)))
    grid = _axes(BOXES[regime], side, side, 8 * side) | REGIMES[regime]
    mode = SlidingMode.STICK_SLIP if regime == "newmark" else SlidingMode[regime.upper()]
    assert (slipsweep.sweep(**grid, variables=["sliding_mode"]).sliding_mode == mode).all(), regime
    return grid
