"""Classes for asv: ``asv run`` in this folder, ``asv compare`` between commits."""

from typing import Any

import numpy as np

import slipsweep
from benchmarks.grids import REGIMES, design_grid, regime_cells
from slipsweep.model.options import Rule

ONLY_DISPLACEMENT: dict[str, Any] = {"variables": ["permanent_displacement"]}


class Cycle:
    """The cycle solver, by regime and number of cells."""

    params = (tuple(REGIMES), (1_000, 100_000))
    param_names = ("regime", "cells")

    def setup(self, regime: str, cells: int) -> None:
        self.cells: dict[str, Any] = regime_cells(regime, cells)
        self.time_sweep(regime, cells)  # compiled or loaded before it is timed

    def time_sweep(self, regime: str, cells: int) -> None:
        slipsweep.sweep(**self.cells, solver="cycle", **ONLY_DISPLACEMENT)

    def peakmem_sweep(self, regime: str, cells: int) -> None:
        slipsweep.sweep(**self.cells, solver="cycle", **ONLY_DISPLACEMENT)


class Step:
    """The stepping solver, by regime, rule and number of cells."""

    params = (tuple(REGIMES), ("rectangle", "trapezoid", "simpson"), (1_000, 10_000))
    param_names = ("regime", "rule", "cells")

    def setup(self, regime: str, rule: Rule, cells: int) -> None:
        self.cells: dict[str, Any] = regime_cells(regime, cells)
        self.time_sweep(regime, rule, cells)

    def time_sweep(self, regime: str, rule: Rule, cells: int) -> None:
        slipsweep.sweep(**self.cells, solver=slipsweep.Step(rule, 1024), **ONLY_DISPLACEMENT)


class DesignChart:
    """A design chart in three and in four dimensions."""

    params = (20, 60)
    param_names = ("side",)

    def setup(self, side: int) -> None:
        self.grid = design_grid(side, side, 2 * side)
        self.frequency = np.geomspace(0.1, 20.0, 50)
        self.time_3d(side)

    def time_3d(self, side: int) -> None:
        slipsweep.sweep(**self.grid, **ONLY_DISPLACEMENT)

    def time_4d(self, side: int) -> None:
        slipsweep.sweep(**self.grid | {"frequency": self.frequency}, **ONLY_DISPLACEMENT)

    def time_all_variables(self, side: int) -> None:
        slipsweep.sweep(**self.grid)


class History:
    """One time history."""

    def setup(self) -> None:
        self.time_simulate()

    def time_simulate(self) -> None:
        slipsweep.simulate(5.0, 0.38, 3.55, 1.8, yield_acceleration=0.59)


class Sampling:
    """Uncertain inputs: a million samples at one grid point, and 4096 at each of many."""

    params = ("sobol", "latin_hypercube", "random")
    param_names = ("method",)

    def setup(self, method: str) -> None:
        self.options: dict[str, Any] = {
            "theta": 5.0,
            "method": method,
            "uncertain": {
                "mu_s": {"distribution": "lognorm", "s": 0.1, "scale": 0.38},
                "amplitude": {"distribution": "lognorm", "s": 0.3, "kind": "factor"},
                "theta": {"distribution": "norm", "scale": 0.5, "kind": "offset"},
            },
        }
        self.time_million(method)

    def time_million(self, method: str) -> None:
        slipsweep.sample(**self.options, amplitude=4.0, frequency=1.0, samples=2**20)

    def time_grid(self, method: str) -> None:
        slipsweep.sample(
            **self.options, amplitude=np.linspace(0.5, 12.0, 500), frequency=np.geomspace(0.1, 10.0, 50), samples=4096
        )

    def peakmem_grid(self, method: str) -> None:
        self.time_grid(method)
