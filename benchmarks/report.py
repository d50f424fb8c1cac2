"""The figures quoted in docs/speed.md and README.md: times, each with its error beside it.

``python -m benchmarks.report`` writes report.md.  Everything that is compared is measured
in turn, in one run; times are medians (for the cycle solver, of the best of three calls).  A time
per cell and core is the wall clock times the cores over the cells.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import slipsweep
from benchmarks import sample
from benchmarks.grids import REGIMES, design_grid, regime_box
from benchmarks.machine import ROOT, alternate, arguments, cores, measured_on, number, table
from slipsweep.motion.waveforms import Waveform

WAVES: dict[str, Waveform] = {
    "sine": slipsweep.Sine(),
    "cosine": slipsweep.Cosine(),
    "square": slipsweep.Square(),
    "triangle": slipsweep.Triangle(),
    "triangle, ramps of 2 cycles at both ends": slipsweep.Triangle(ramp_in=2, ramp_out=2),
    "harmonics, one of multiple 1": slipsweep.Harmonics((1.0,), (1,)),
    "harmonics, multiples 1, 2 and 5": slipsweep.Harmonics(
        (1.0, 0.6, 0.35), (1, 2, 5), (0.0, 40.0, 100.0)
    ),
    "harmonics, multiples 1 and 50": slipsweep.Harmonics((1.0, 0.15), (1, 50)),
}


def displacement(**options: Any) -> xr.DataArray:
    """`slipsweep.sweep` of nothing but the permanent displacement."""
    result = slipsweep.sweep(**options, variables=["permanent_displacement"])
    return result["permanent_displacement"]


def size_of(grid: Mapping[str, Any]) -> int:
    """Number of cells of a grid."""
    return int(np.prod([values.size for values in grid.values() if isinstance(values, np.ndarray)]))


def cycle_solver(tiny: bool) -> str:
    """Cells of 3-D grids, and of those in one regime."""
    grids = {"design chart": design_grid(*((4, 4, 8) if tiny else (60, 50, 200)))}
    grids["finer design chart"] = design_grid(*((4, 4, 16) if tiny else (100, 100, 400)))
    grids |= {regime: regime_box(regime, 64 if tiny else 4_000_000) for regime in REGIMES}

    def run(grid: dict[str, Any]) -> Callable[[], object]:
        return lambda: displacement(**grid, solver="cycle")

    times = alternate(
        {name: run(grid) for name, grid in grids.items()}, 2 if tiny else 9, calls=1 if tiny else 3
    )
    groups = sample.read()
    rows = []
    for name, grid in grids.items():
        regimes = [name] if name in groups else ["stuck", "stick_slip", "continuous"]
        errors = [
            group.errors(group.displacement("cycle"))
            for regime in regimes
            for group in groups[regime]
        ]
        error = np.concatenate(errors)
        cells = size_of(grid)
        row = [name.replace("_", "–"), f"{cells:,}", number(times[name] * cores() / cells * 1e9)]
        rows.append(
            [*row, number(float(np.nanmedian(error)), 2), number(float(np.nanmax(error)), 2)]
        )
    grid = grids["design chart"]
    modes = slipsweep.sweep(**grid, variables=["sliding_mode"]).sliding_mode.values
    shares = ", ".join(
        f"{np.mean(modes == mode):.0%} {mode.name.lower()}" for mode in slipsweep.SlidingMode
    )
    return (
        "## The cycle solver\n\n"
        + table(["cells", "number", "core time per cell, ns", "median error", "worst error"], rows)
        + "\nTen cycles, displacement only. Core time is the elapsed time times the number of "
        "cores; median over nine rounds of the best of three calls. "
        f"Of the design chart {shares.replace('_', '–')}. Errors are relative, against 30 digits, "
        f"over {sample.SIZE} random cells a regime (benchmarks/data/sample.csv).\n"
    )


def four_dimensions(tiny: bool) -> str:
    """A 4-D sweep against filling as many bytes."""
    grid = design_grid(*((4, 4, 8) if tiny else (100, 100, 200)))
    grid["frequency"] = np.geomspace(0.1, 20.0, 5 if tiny else 100)
    cells = size_of(grid)
    times = alternate(
        {"slipsweep.sweep": lambda: displacement(**grid), "np.full": lambda: np.full(cells, 1.0)},
        1 if tiny else 5,
    )
    memory = ""
    if Path("/proc/self/clear_refs").exists():
        whole, result = peak_memory(tiny)
        memory = (
            f" Sweeping {result / 1e6:,.0f} MB of result raises the memory of a process that has "
            f"its kernels by {whole / result:.2f} times that, at its peak."
        )
    rows = [
        [name, number(seconds, 3), number(8 * cells / seconds / 1e9, 3)]
        for name, seconds in times.items()
    ]
    ratio = times["slipsweep.sweep"] / times["np.full"]
    return (
        f"## A 4-D sweep of {cells:,} cells\n\n"
        + table(["", "s", "GB/s written"], rows)
        + f"\n{ratio:.2f} times the time that `np.full` takes for the same "
        f"{8 * cells / 1e9:.2g} GB.{memory}\n"
    )


def peak_memory(tiny: bool) -> tuple[float, float]:
    """Bytes that a sweep adds at its peak to a process that has swept, and bytes of its result."""
    code = (
        "import re, numpy as np, slipsweep, pathlib;"
        "status = pathlib.Path('/proc/self/status');"
        "held = lambda name: int(re.search(name + r':\\s+(\\d+)', status.read_text())[1]);"
        "run = lambda n: slipsweep.sweep(np.linspace(0, 20, 50), np.linspace(.2, .9, 50),"
        " np.linspace(.5, 13, n), np.geomspace(.1, 20, 100),"
        " variables=['permanent_displacement']);"
        "run(2); before = held('VmRSS'); pathlib.Path('/proc/self/clear_refs').write_text('5');"
        f"found = run({4 if tiny else 200});"
        "print((held('VmHWM') - before) * 1024, found.nbytes)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout
    peak, result = map(float, printed.split())
    return peak, result


def waveforms(tiny: bool) -> str:
    """Cells of one grid under every waveform."""
    grid = design_grid(*((3, 4, 5) if tiny else (40, 40, 160)))

    def run(wave: Waveform) -> Callable[[], object]:
        return lambda: displacement(**grid, excitation=wave)

    times = alternate(
        {name: run(wave) for name, wave in WAVES.items()}, 1 if tiny else 5, calls=1 if tiny else 2
    )
    rows = [
        [name, number(seconds * cores() / size_of(grid) * 1e9), number(seconds / times["sine"], 2)]
        for name, seconds in times.items()
    ]
    return (
        "## Waveforms\n\n"
        + table(["waveform", "core time per cell, ns", "over the sine's"], rows)
        + "\nThe cycle solver, displacement only, ten cycles; "
        f"{size_of(grid):,} cells of a design chart.\n"
    )


def start_up(tiny: bool) -> str:
    """Whole processes, with an empty cache of kernels and with a full one."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        sweeps = ("sweeps/design_chart.toml", "sweeps/paper.toml")
        fresh = iter(range(1000))

        def process(cache: str | None, *words: str) -> Callable[[], object]:
            def run() -> None:
                name = cache or f"cold{next(fresh)}"
                environment = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder) / name)}
                subprocess.run(words, check=True, capture_output=True, env=environment, cwd=ROOT)

            return run

        def sweep(cache: str | None, name: str) -> Callable[[], object]:
            def run() -> None:
                output = (
                    Path(folder) / f"out{next(fresh)}.nc"
                )  # to replace one of 83 MB takes 15 ms by itself
                process(cache, sys.executable, "-m", "slipsweep", "run", name, "-o", str(output))()

            return run

        warm = {f"`slipsweep run {name}`, warm": sweep("warm", name) for name in sweeps} | {
            "`slipsweep --help`": process("warm", sys.executable, "-m", "slipsweep", "--help"),
            "`python -c 'import numba, xarray'`": process(
                "warm", sys.executable, "-c", "import numba, xarray"
            ),
        }
        if tiny:
            warm = {name: run for name, run in warm.items() if "help" in name}
        cold = {
            f"`slipsweep run {name}`, first ever": sweep(None, name)
            for name in (() if tiny else sweeps)
        }
        times = alternate(cold, 2) | alternate(warm, 1 if tiny else 7)
    rows = [[name, number(seconds)] for name, seconds in times.items()]
    return "## Start-up, whole process\n\n" + table(["", "s"], rows)


def main() -> None:
    """Measure everything, write report.md."""
    options = arguments(__doc__)
    tiny = options.tiny
    parts = [
        "# What slipsweep takes\n\n"
        + measured_on(("numpy", "numba", "llvmlite", "xarray", "netCDF4")),
        "Written by `python -m benchmarks.report`.\n",
    ]
    for section in (cycle_solver, waveforms, four_dimensions, start_up):
        parts.append(section(tiny))
        (options.folder / "report.md").write_text(
            "\n".join(parts)
        )  # what is measured stands, whatever comes after


if __name__ == "__main__":
    main()
