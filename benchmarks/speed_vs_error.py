"""Time against error of both solvers and other programs: ``python -m benchmarks.speed_vs_error``.

Writes speed_vs_error.csv and .png, and engines.md.  Cells are those of `benchmarks.sample`, one
cycle each, over and over up to as many as fill batches and hide a call; those programs of
`benchmarks.engines` that solve one after the other take each once.  Errors are relative, against 30
digits; times are processor time a cell, of all threads together, without compiling.
"""

import csv
import itertools
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import slipsweep
from benchmarks import engines, sample
from benchmarks.grids import RULES
from benchmarks.machine import arguments, measured_on, number, table
from benchmarks.sample import Group

STEPS = tuple(2**k for k in range(5, 15))

MOST_CELLS = 2**18
STEPS_AT_A_TIME = 2**20

COLOURS = {"cycle": "#d62728", "simpson": "#08519c", "trapezoid": "#3182bd", "rectangle": "#9ecae1"}
COLOURS |= {name: program.colour for name, program in engines.PROGRAMS.items()}

#: Regimes in the order of the panels, and those that the other programs solve.
REGIMES = ("stick_slip", "continuous", "newmark", "hard")
COMPARED = ("newmark", "stick_slip")

#: Errors of the table.
WANTED = (1e-3, 1e-6, 1e-9, 1e-12)


@dataclass(frozen=True)
class Point:
    """Solver (cycle, a rule of steps, another program) with its steps or tolerance on a regime."""

    solver: str
    setting: float
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


def measure(
    solver: str,
    setting: float,
    groups: list[Group],
    solve: Callable[[Group, Any], np.ndarray],
    by: Any,
    cells: int,
) -> Point:
    """Point from all groups of a regime, each repeated up to `cells`, solved with option `by`."""
    seconds = 0.0
    errors = []
    for group in groups:
        many = group.take(np.tile(np.arange(group.size), max(1, cells // group.size)))
        errors.append(group.errors(solve(many, by)[: group.size]))
        seconds += (
            cpu_time(partial(solve, many, by), 0.05 if cells > 64 else 0.0) / many.size * group.size
        )
    error = np.concatenate(errors)
    error[~np.isfinite(error)] = np.inf
    middle, high, worst = (
        float(np.percentile(error, share, method="higher")) for share in (50, 95, 100)
    )
    return Point(
        solver, setting, groups[0].regime, error.size, seconds / error.size, middle, high, worst
    )


def points(tiny: bool) -> Iterator[Point]:
    """All points, one after the other; of other programs those of the installed ones."""
    few = np.arange(2)
    most = 64 if tiny else MOST_CELLS
    groups_of_regime = sample.read()
    for groups in groups_of_regime.values():
        used = [groups[0].take(few)] if tiny else groups
        yield measure("cycle", 0, used, Group.displacement, "cycle", most)
        for rule in RULES:
            for steps in STEPS[:2] if tiny else STEPS:
                cells = min(most, STEPS_AT_A_TIME // steps)
                yield measure(
                    rule, steps, used, Group.displacement, slipsweep.Step(rule, steps), cells
                )
    for name, program in engines.PROGRAMS.items():
        for regime in program.regimes if find_spec(name) else ():
            group = engines.begin_at_yield(groups_of_regime[regime][0])
            for setting in program.settings[: 1 if tiny else None]:
                used, cells = ([group.take(few)], 1) if tiny else ([group], program.cells)
                yield measure(name, setting, used, program.solve, setting, cells)


def write_csv(measured: list[Point], path: Path) -> None:
    """Every point, as a line."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Point)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(point) for point in measured)


def coarsest(
    measured: list[Point], regimes: Sequence[str], solvers: Sequence[str], errors: Sequence[float]
) -> str:
    """Table of the coarsest settings with 95 of 100 cells within an error, and of their times."""
    rows = []
    for regime, solver in itertools.product(regimes, solvers):
        of_solver = [
            point for point in measured if (point.solver, point.regime) == (solver, regime)
        ]
        row = [regime.replace("_", "–"), solver]
        for error in errors:
            enough = [point for point in of_solver if point.error_95 <= error]
            best = min(enough, key=lambda point: point.seconds_per_cell, default=None)
            setting = f" ({best.setting:g})" if best and best.setting else ""
            row.append(f"{number(best.seconds_per_cell * 1e6, 2)}{setting}" if best else "–")
        if of_solver:
            rows.append(row)
    return table(["regime", "solver", *(f"{error:.0e}" for error in errors)], rows)


def draw(measured: list[Point], path: Path) -> None:
    """Time against error, a panel a regime: down and to the left is better."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 8), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for regime, axis in zip(REGIMES, axes.flat, strict=True):
        for solver, colour in COLOURS.items():
            of_solver = [
                point for point in measured if (point.solver, point.regime) == (solver, regime)
            ]
            middle = np.maximum([point.median_error for point in of_solver], 1e-17)
            high = np.minimum(np.maximum([point.error_95 for point in of_solver], middle), 1e3)
            look: dict[str, Any] = {"marker": "o", "ms": 4, "label": f"step, {solver}"}
            if solver == "cycle":
                look = {"marker": "*", "ms": 15, "label": solver}
            elif solver in engines.PROGRAMS:
                look = {
                    "marker": engines.PROGRAMS[solver].marker,
                    "ms": 4,
                    "ls": "--",
                    "label": solver,
                }
            axis.errorbar(
                [point.seconds_per_cell for point in of_solver],
                middle,
                (np.zeros_like(middle), high - middle),
                color=colour,
                lw=1.2,
                elinewidth=0.6,
                **look,
            )
        axis.set(xscale="log", yscale="log", title=regime.replace("_", "–"), ylim=(3e-18, 30))
        axis.grid(which="major", alpha=0.3)
    axes[1, 1].legend(fontsize="small", loc="center right")
    figure.supxlabel("processor time a cell, s")
    figure.supylabel("relative error of the displacement")
    figure.suptitle(
        "What an error costs (median, whisker to the 95th percentile): "
        "down and to the left is better"
    )
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure, and write everything."""
    options = arguments(__doc__)
    measured = list(points(options.tiny))
    write_csv(measured, options.folder / "speed_vs_error.csv")
    (options.folder / "engines.md").write_text(
        f"{coarsest(measured, COMPARED, [*COLOURS], WANTED)}\n"
        "Processor time a cell, µs, and in brackets the steps a cycle or the tolerance, of the "
        "fastest setting with which 95 of 100 cells are within the relative error; “–”: none of "
        "those tried. "
        f"{measured_on(('numpy', 'numba', *engines.PROGRAMS))} "
        "Written by `python -m benchmarks.speed_vs_error`.\n",
        encoding="utf-8",
    )
    draw(measured, options.folder / "speed_vs_error.png")


if __name__ == "__main__":
    main()
