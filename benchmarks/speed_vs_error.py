"""What an error costs: slipsweep's solvers and others on the same cells, ``python -m benchmarks.speed_vs_error``.

Writes speed_vs_error.csv, .nc, .md and .png.  Cells are those of `benchmarks.sample`, one
cycle each; errors are relative, against 30 digits; times are processor time a cell on
one core; compilation is what a first call takes over a later one.
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
from benchmarks import outside, sample
from benchmarks.grids import RULES
from benchmarks.machine import arguments, measured_on, number, table
from benchmarks.sample import Array, Group

STEPS = tuple(2**k for k in range(5, 15))

#: Cells at a time: enough to fill lanes and hide a call, few enough for small steps.
MOST_CELLS = 2**18
STEPS_AT_A_TIME = 2**25

COLOURS = {
    "cycle": "#d62728", "step, simpson": "#08519c", "step, trapezoid": "#3182bd", "step, rectangle": "#9ecae1",
    "SciPy": "#7f7f7f", "diffrax": "#9467bd", "CyRK": "#2ca02c", "pySLAMMER": "#8c564b", "pyNewmarkDisp": "#e377c2",
}  # fmt: skip


@dataclass(frozen=True)
class Point:
    """One solver with one setting on one regime; `setting` is steps, samples or a tolerance."""

    family: str
    method: str
    setting: float
    regime: str
    cells: int
    seconds_per_cell: float
    compile_seconds: float
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
        if taken[0] > least:
            break
    return statistics.median(taken)


def measure(
    family: str, method: str, setting: float, regime: str, groups: list[Group], make: Any, times_over: int, least: float
) -> Point | None:
    """A point from all groups of a regime; None where the solver takes none of them."""
    seconds, first, cells, errors = 0.0, 0.0, 0, []
    for group in groups:
        solve = make(group.repeated(times_over))
        if solve is None:
            continue
        start = time.process_time()
        answer: Array = solve()
        taken = time.process_time() - start
        each = cpu_time(solve, least)
        seconds += each / times_over
        first += max(taken - each, 0.0)
        cells += group.size
        errors.append(group.errors(answer[: group.size]))
    if not cells:
        return None
    error = np.concatenate(errors)
    error[~np.isfinite(error)] = np.inf
    median, high, worst = np.median(error), np.percentile(error, 95, method="higher"), error.max()
    return Point(
        family, method, setting, regime, cells, seconds / cells, first, float(median), float(high), float(worst)
    )


def slipsweep_solver(**options: Any) -> Callable[[Group], Callable[[], Array]]:
    """A solver of slipsweep as `measure` wants it."""

    def make(group: Group) -> Callable[[], Array]:
        given = group.sweep_arguments() | options
        return lambda: np.asarray(slipsweep.sweep(**given).permanent_displacement)

    return make


def points(tiny: bool) -> Iterator[Point]:
    """All points, one after the other."""
    least = 0.0 if tiny else 0.05
    regimes = sample.read()
    if tiny:
        regimes = {regime: [groups[0].take(np.arange(2))] for regime, groups in regimes.items()}
    most = 64 if tiny else MOST_CELLS
    for regime, groups in regimes.items():
        smallest = min(group.size for group in groups)
        found = [measure("cycle", "", 0, regime, groups, slipsweep_solver(solver="cycle"), most // smallest, least)]
        for rule in RULES:
            for steps in STEPS[:2] if tiny else STEPS:
                make = slipsweep_solver(solver=slipsweep.Step(rule, steps))
                over = max(1, min(most, STEPS_AT_A_TIME // steps) // smallest)
                found.append(measure(f"step, {rule}", "", steps, regime, groups, make, over, least))
        for family, solver in outside.FAMILIES.items():
            over = 16 if solver.takes_many and not tiny else 1
            for method, setting in solver.settings[:1] if tiny else solver.settings:

                def make_outside(
                    group: Group, solver: Any = solver, method: str = method, setting: Any = setting
                ) -> Any:
                    return solver.make(group, method, setting)

                try:
                    found.append(measure(family, method, setting, regime, groups, make_outside, over, least))
                except ModuleNotFoundError as missing:
                    print(f"{family}: {missing}; left out")
                    break
        yield from (point for point in found if point is not None)


def write_csv(found: list[Point], path: Path) -> None:
    """Every point, as a line."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Point)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(point) for point in found)


def write_netcdf(found: list[Point], path: Path) -> None:
    """The same along one dimension."""
    import xarray as xr

    columns = {field.name: [getattr(point, field.name) for point in found] for field in fields(Point)}
    dataset = xr.Dataset({name: ("point", values) for name, values in columns.items()})
    dataset["seconds_per_cell"].attrs = {"units": "s", "long_name": "processor time a cell on one core"}
    dataset["compile_seconds"].attrs = {"units": "s", "long_name": "first call less a later one"}
    dataset.attrs = {"title": "Speed against error", "comment": measured_on(), "source": "benchmarks.speed_vs_error"}
    dataset.to_netcdf(path)


def markdown(found: list[Point]) -> str:
    """A table a regime: every outside setting, and slipsweep's at a few steps."""
    packages = ("numpy", "numba", *(family.package for family in outside.FAMILIES.values()), "jax")
    parts = [f"# Speed against error\n\n{measured_on(packages)}\nWritten by `python -m benchmarks.speed_vs_error`.\n"]
    header = ["solver", "setting", "µs a cell and core", "median error", "95 %", "worst", "compilation, s"]
    for regime in dict.fromkeys(point.regime for point in found):
        rows = []
        for point in found:
            if point.regime != regime or (point.family.startswith("step") and np.log2(point.setting) % 3 != 2):
                continue
            setting = f"{point.method} {point.setting:g}".strip() if point.setting else "–"
            row = [point.family, setting, number(point.seconds_per_cell * 1e6)]
            row += [number(value, 2) for value in (point.median_error, point.error_95, point.worst_error)]
            rows.append([*row, number(point.compile_seconds, 2) if point.compile_seconds > 0.1 else "–"])
        parts.append(f"## {regime.replace('_', '–')}\n\n{table(header, rows)}")
    parts.append(
        "Settings are steps or samples a cycle, or a method and its relative tolerance. Every outside solver is given "
        "the phases at which sliding begins and at which Eq. 4 takes over, and integrates piece by piece between them. "
        "The stop is a terminal event in SciPy and diffrax (with a root finder); CyRK has no events in compiled loops, "
        "so the stop is bisected on its dense output; pySLAMMER and pyNewmarkDisp stop at a sample. pyNewmarkDisp "
        "subtracts ∫|Üg| instead of ∫(Üy − Üg) below yield: its error is that of another rule and does not fall with "
        "the step. Compilation is processor time, less where kernels come from a disk cache.\n"
    )
    return "\n".join(parts)


def draw(found: list[Point], path: Path) -> None:
    """Time against error, a panel a regime: down and to the left is better."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    regimes = ("stick_slip", "continuous", "newmark", "hard")
    figure, axes = plt.subplots(2, 2, figsize=(11, 8.5), sharex=True, sharey=True, layout="constrained")
    for regime, axis in zip(regimes, axes.flat, strict=True):
        for family, colour in COLOURS.items():
            methods = dict.fromkeys(point.method for point in found if point.family == family)
            for i, method in enumerate(methods):
                own = [
                    point for point in found if (point.family, point.method, point.regime) == (family, method, regime)
                ]
                if not own:
                    continue
                times = [point.seconds_per_cell for point in own]
                middle = np.maximum([point.median_error for point in own], 1e-17)
                high = np.minimum(np.maximum([point.error_95 for point in own], middle), 1e3)
                star = family == "cycle"
                axis.errorbar(
                    times, middle, (np.zeros_like(middle), high - middle), color=colour, lw=1.2, elinewidth=0.6,
                    label=family if i == 0 else None, marker="*" if star else "os"[i], ms=15 if star else 4,
                    zorder=3 if star else 2,
                )  # fmt: skip
                if method:
                    beside = (4, {"CyRK": -8, "diffrax": 5}.get(family, -2))  # their points lie side by side
                    axis.annotate(method, (times[-1], middle[-1]), beside, textcoords="offset points", fontsize=6)
        axis.set(xscale="log", yscale="log", title=regime.replace("_", "–"), ylim=(3e-18, 30))
        axis.grid(which="major", alpha=0.3)
    for axis in axes[1]:
        axis.set_xlabel("time a cell on one core, s")
    for axis in axes[:, 0]:
        axis.set_ylabel("relative error of the displacement")
    handles = {
        label: handle for axis in axes.flat for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles, loc="outside right center", frameon=False)
    figure.suptitle("What an error costs (median, whisker to the 95th percentile): down and to the left is better")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Measure, and write everything."""
    given = arguments(__doc__)
    found = list(points(given.tiny))
    name = given.folder / "speed_vs_error"
    write_csv(found, name.with_suffix(".csv"))
    write_netcdf(found, name.with_suffix(".nc"))
    name.with_suffix(".md").write_text(markdown(found))
    draw(found, name.with_suffix(".png"))


if __name__ == "__main__":
    main()
