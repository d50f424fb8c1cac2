"""Times whose history asv keeps: six tasks that users wait for.

Kernels are compiled before a time is taken, but for `FirstUse`.  The tables of `benchmarks/`
compare with other programs; these compare the program with itself, from commit to commit.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import slipsweep

G = 9.81

#: Inclinations in degrees, static friction coefficients and peak ground accelerations in g of boxes
#: that lie in one sliding mode.
BOXES = {
    "stuck": ((0.0, 5.0), (0.75, 0.9), (0.2, 0.5)),
    "stick_slip": ((12.0, 17.0), (0.75, 0.9), (0.7, 0.95)),
    "continuous": ((12.0, 17.0), (0.35, 0.55), (1.05, 1.35)),
}

DISPLACEMENT = ["permanent_displacement"]


def box(mode: str, side: int) -> dict[str, Any]:
    """Return axes of side³ cells in a sliding mode, at 1 Hz."""
    theta, mu_s, amplitude = (np.linspace(low, high, side) for low, high in BOXES[mode])
    return {"theta": theta, "mu_s": mu_s, "amplitude": amplitude * G, "frequency": 1.0}


class Cell:
    """The cells of a sine in each sliding mode, 64 000 of them."""

    params: ClassVar[list[str]] = list(BOXES)
    param_names: ClassVar[list[str]] = ["mode"]

    def setup(self, mode: str) -> None:
        self.grid = box(mode, 40)
        self.time_cell(mode)

    def time_cell(self, mode: str) -> None:
        slipsweep.sweep(**self.grid, variables=DISPLACEMENT)


class Chart:
    """A design chart of 600 000 cells, with all results that a sweep has by default."""

    def setup(self) -> None:
        self.grid: dict[str, Any] = {
            "theta": np.linspace(0.0, 20.0, 20),
            "mu_s": np.linspace(0.2, 0.9, 10),
            "amplitude": np.linspace(0.05, 1.4, 50) * G,
            "frequency": np.geomspace(0.1, 20.0, 60),
        }
        self.time_chart()

    def time_chart(self) -> None:
        slipsweep.sweep(**self.grid)


class Walk:
    """The exact walk from event to event: 8000 cells under a triangle."""

    def setup(self) -> None:
        self.grid = box("stick_slip", 20)
        self.time_walk()

    def time_walk(self) -> None:
        slipsweep.sweep(**self.grid, excitation="triangle", variables=DISPLACEMENT)


class RecordedMotion:
    """A record of 4000 samples over 1000 cells."""

    def setup(self) -> None:
        self.grid = box("stick_slip", 10)
        del self.grid["frequency"]
        times = np.arange(4000) * 0.01
        envelope = np.exp(-(((times - 12.0) / 8.0) ** 2))
        waves = [np.sin(2.0 * np.pi * f * times + f * f) for f in (0.7, 1.3, 2.1, 3.4, 5.5)]
        self.record = slipsweep.Record(times, envelope * np.sum(waves, axis=0))
        self.time_record()

    def time_record(self) -> None:
        slipsweep.sweep(**self.grid, excitation=self.record, variables=DISPLACEMENT)


class StepByStep:
    """1000 cells in steps, 1024 a cycle."""

    def setup(self) -> None:
        self.grid = box("stick_slip", 10)
        self.time_step()

    def time_step(self) -> None:
        slipsweep.sweep(**self.grid, solver="step", variables=DISPLACEMENT)


class FirstUse:
    """A process that compiles what a design chart needs, and solves one cell."""

    unit = "s"
    timeout = 600.0

    def track_first_use(self) -> float:
        code = "import slipsweep; slipsweep.sweep(5.0, 0.4, 4.0, 1.0)"
        with tempfile.TemporaryDirectory() as folder:
            environment = dict(os.environ, NUMBA_CACHE_DIR=str(Path(folder)))
            start = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], env=environment, check=True)
            return time.perf_counter() - start
