"""What each result adds to a sweep: ``python -m benchmarks.variables`` prints it and writes results/variables.md.

Seconds of processor, in turns, for the displacement alone and with one more result: on the grid of
sweeps/design_chart.toml, whose frequencies are served by the scaling law, and on a grid with one frequency, where
each result is a cell that is solved.  ``.ci/include-report`` puts the table into docs/speed.md.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import slipsweep
from benchmarks.grids import G, design_grid
from benchmarks.machine import alternate, arguments, measured_on, table

BASE = "permanent_displacement"
ADDED = ("peak_relative_velocity", "newmark_displacement", "sliding_mode", "validity")


def grids(tiny: bool) -> dict[str, dict[str, Any]]:
    """A grid with many frequencies and one with one, by what the table calls them."""
    chart: dict[str, Any] = {
        "theta": np.linspace(0.0, 20.0, 3 if tiny else 21),
        "mu_s": np.linspace(0.2, 0.9, 3 if tiny else 15),
        "amplitude": np.linspace(0.05, 1.4, 4 if tiny else 136) * G,
        "frequency": np.geomspace(0.1, 20.0, 3 if tiny else 72),
    }
    return {
        "design chart": chart,
        "one frequency": design_grid(*((4, 4, 8) if tiny else (60, 50, 200))),
    }


def cost(grid: dict[str, Any], turns: int) -> dict[str, float]:
    """Seconds of processor: of the displacement, and of what each other result adds to it."""

    def run(*names: str) -> Callable[[], object]:
        return lambda: slipsweep.sweep(**grid, variables=list(names))

    asked = {BASE: run(BASE)} | {name: run(BASE, name) for name in ADDED}
    found = alternate(asked, turns, calls=3, clock=time.process_time)
    return {BASE: found[BASE]} | {name: found[name] - found[BASE] for name in ADDED}


def main() -> None:
    """Print and write the table."""
    given = arguments(__doc__)
    rows = []
    for name, grid in grids(given.tiny).items():
        cells = int(np.prod([np.size(values) for values in grid.values()]))
        taken = cost(grid, 1 if given.tiny else 25)
        rows.append([name, f"{cells:,}", *(f"{1e3 * seconds:.1f}" for seconds in taken.values())])
    header = ["grid", "cells", f"`{BASE}`, ms", *(f"`{name}` adds" for name in ADDED)]
    text = (
        f"{table(header, rows)}\nMilliseconds of processor, all cores together: the displacement alone, and what one "
        "more result adds. Ten cycles of a sine; median over 25 rounds of the best of three calls. "
        f"{measured_on()} Written by `python -m benchmarks.variables`.\n"
    )
    print(text)
    (given.folder / "variables.md").write_text(text)


if __name__ == "__main__":
    main()
