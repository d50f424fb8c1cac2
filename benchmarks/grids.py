"""The grids that are measured: the range of a design chart, whole and regime by regime."""

from typing import Any

import numpy as np
import xarray as xr

import slipsweep
from slipsweep import SlidingMode, Validity
from slipsweep.model.options import Rule

G = 9.81

#: Regimes, and the options that go with them.
REGIMES: dict[str, dict[str, Any]] = {"stuck": {}, "stick_slip": {}, "continuous": {}, "newmark": {"model": "newmark"}}

#: The rules of the stepping solver.
RULES: tuple[Rule, ...] = ("rectangle", "trapezoid", "simpson")

#: A stick-slip slide closer to yield than this is stepped by finer steps of its own.
_CLEAR_OF_YIELD = 1.01

#: The ranges of the design grid: θ in degrees, μs, and A in g.
_DESIGN = ((0.0, 20.0), (0.2, 0.9), (0.05, 1.4))

#: Those of boxes of it that lie in one regime, or in that part of stick-slip in which one of its two laws governs.
BOXES = {
    "stuck": ((0.0, 5.0), (0.75, 0.9), (0.2, 0.5)),
    "stick_slip": ((12.0, 17.0), (0.75, 0.9), (0.7, 0.95)),
    "stick_slip, yield governs": ((13.0, 17.0), (0.7, 0.9), (0.58, 0.66)),
    "stick_slip, Eq. 4 governs": ((14.0, 18.0), (0.8, 0.9), (1.05, 1.25)),
    "continuous": ((12.0, 17.0), (0.35, 0.55), (1.05, 1.35)),
    "newmark": ((12.0, 17.0), (0.75, 0.9), (0.7, 0.95)),
}


def _axes(ranges: tuple[tuple[float, float], ...], *sizes: int) -> dict[str, Any]:
    theta, mu_s, amplitude = (np.linspace(*ends, size) for ends, size in zip(ranges, sizes, strict=True))
    return {"theta": theta, "mu_s": mu_s, "amplitude": amplitude * G, "frequency": 1.0}


def design_grid(thetas: int, frictions: int, amplitudes: int) -> dict[str, Any]:
    """θ 0-20°, μs 0.2-0.9 and A 0.05-1.4 g at 1 Hz."""
    return _axes(_DESIGN, thetas, frictions, amplitudes)


def regime_box(regime: str, count: int) -> dict[str, Any]:
    """About `count` cells of one of the `BOXES`, on axes: what each costs when its inputs cost nothing."""
    side = max(2, round((count / 8) ** (1 / 3)))
    name, _, law = regime.partition(", ")
    grid = _axes(BOXES[regime], side, side, 8 * side) | REGIMES[name]
    found = slipsweep.sweep(**grid, variables=["sliding_mode", "validity"])
    governs = (found.validity.values & Validity.YIELD_GOVERNS) > 0
    assert (found.sliding_mode == _mode(name)).all(), regime
    assert not law or np.all(governs == law.startswith("yield")), regime
    return grid


def _mode(regime: str) -> SlidingMode:
    return SlidingMode.STICK_SLIP if regime == "newmark" else SlidingMode[regime.upper()]


def regime_cells(regime: str, count: int) -> dict[str, Any]:
    """About `count` cells of the design grid that lie in one regime, neighbours kept together, zipped along `cell`.

    Of the sliding ones, those are taken whose every pulse comes to rest: the others repeat
    a solver's work cycle by cycle, and say nothing of the work itself.
    """
    options = REGIMES[regime]
    side = max(4, round((count / 2) ** (1 / 3)))
    while True:
        grid = design_grid(side, side, 8 * side)
        found = slipsweep.sweep(**grid, **options, variables=["sliding_mode", "validity", "yield_acceleration"])
        inside = (found.sliding_mode == _mode(regime)) & ((found.validity & Validity.NOT_RECOUPLED) == 0)
        if regime in ("stick_slip", "newmark"):
            inside &= found.amplitude > _CLEAR_OF_YIELD * found.yield_acceleration
        places = np.flatnonzero(inside.transpose("theta", "mu_s", "amplitude").values)
        if places.size >= count:
            break
        side = side * 5 // 4 + 1
    places = places[: places.size // count * count : places.size // count]
    axes = np.unravel_index(places, (side, side, 8 * side))
    cells = {
        name: xr.DataArray(grid[name][axis], dims="cell")
        for name, axis in zip(("theta", "mu_s", "amplitude"), axes, strict=True)
    }
    return {**cells, "frequency": 1.0, **options}
