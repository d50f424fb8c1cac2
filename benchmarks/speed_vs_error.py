"""What an error costs, by either solver: ``python -m benchmarks.speed_vs_error``.

Writes speed_vs_error.csv and .png.  Cells are those of `benchmarks.sample`, one cycle each; errors are relative,
against 30 digits; times are processor time a cell on one core.
"""

import csv
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

import slipsweep
from benchmarks import sample
from benchmarks.grids import RULES
from benchmarks.machine import arguments
from benchmarks.sample import Group

STEPS = tuple(2**k for k in range(5, 15))

#: Cells at a time: enough to fill SIMD batches and to hide a call.
MOST_CELLS = 2**18
STEPS_AT_A_TIME = 2**20

COLOURS = {"cycle": "#d62728", "simpson": "#08519c", "trapezoid": "#3182bd", "rectangle": "#9ecae1"}


@dataclass(frozen=True)
class Point:
    """One solver (cycle, or a rule of the step solver) with a number of steps on one regime."""

    solver: str
    steps: int
    regime: str
    cells: int
    seconds_per_cell: float
    median_error: float
    error_95: float
    worst_error: float


def cpu_time(function: Callable[[], object], least: float) -> float:
    """Median processor seconds of a call, over calls that take `least` seconds together."""
    taken: list[float] = []
    while sum(taken) < least or len(taken) < 2:
        start = time.process_time()
        function()
        taken.append(time.process_time() - start)
    return statistics.median(taken)


def measure(solver: str, steps: int, groups: list[Group], times_over: int, least: float) -> Point:
    """A point from all groups of a regime, each repeated `times_over`."""
    seconds, errors = 0.0, []
    for group in groups:
        given = group.repeated(times_over).sweep_arguments()
        given["solver"] = slipsweep.Step(solver, steps) if steps else solver  # type: ignore[arg-type]

        def solve(given: dict[str, Any] = given) -> np.ndarray:
            return np.asarray(slipsweep.sweep(**given).permanent_displacement)

        errors.append(group.errors(solve()[: group.size]))
        seconds += cpu_time(solve, least) / times_over
    error = np.concatenate(errors)
    error[~np.isfinite(error)] = np.inf
    high = float(np.percentile(error, 95, method="higher"))
    return Point(
        solver, steps, groups[0].regime, error.size, seconds / error.size, float(np.median(error)), high,
        float(error.max()),
    )  # fmt: skip


def points(tiny: bool) -> Iterator[Point]:
    """All points, one after the other."""
    least, most = (0.0, 64) if tiny else (0.05, MOST_CELLS)
    for groups in sample.read().values():
        used = [groups[0].take(np.arange(2))] if tiny else groups
        smallest = min(group.size for group in used)
        yield measure("cycle", 0, used, most // smallest, least)
        for rule in RULES:
            for steps in STEPS[:2] if tiny else STEPS:
                yield measure(rule, steps, used, max(1, min(most, STEPS_AT_A_TIME // steps) // smallest), least)


def write_csv(found: list[Point], path: Path) -> None:
    """Every point, as a line."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Point)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(point) for point in found)


def draw(found: list[Point], path: Path) -> None:
    """Time against error, a panel a regime: down and to the left is better."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 8), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for regime, axis in zip(("stick_slip", "continuous", "newmark", "hard"), axes.flat, strict=True):
        for solver, colour in COLOURS.items():
            own = [point for point in found if (point.solver, point.regime) == (solver, regime)]
            middle = np.maximum([point.median_error for point in own], 1e-17)
            high = np.minimum(np.maximum([point.error_95 for point in own], middle), 1e3)
            axis.errorbar(
                [point.seconds_per_cell for point in own], middle, (np.zeros_like(middle), high - middle),
                color=colour, lw=1.2, elinewidth=0.6, marker="*" if solver == "cycle" else "o",
                ms=15 if solver == "cycle" else 4, label=solver if solver == "cycle" else f"step, {solver}",
            )  # fmt: skip
        axis.set(xscale="log", yscale="log", title=regime.replace("_", "–"), ylim=(3e-18, 30))
        axis.grid(which="major", alpha=0.3)
    axes[0, 0].legend()
    figure.supxlabel("time a cell on one core, s")
    figure.supylabel("relative error of the displacement")
    figure.suptitle("What an error costs (median, whisker to the 95th percentile): down and to the left is better")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure, and write everything."""
    given = arguments(__doc__)
    found = list(points(given.tiny))
    write_csv(found, given.folder / "speed_vs_error.csv")
    draw(found, given.folder / "speed_vs_error.png")


if __name__ == "__main__":
    main()
