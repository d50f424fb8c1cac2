"""Large sweeps to disk: ``python -m benchmarks.large_sweeps`` writes large_sweeps.md.

It takes minutes and 8 GB.
`slipsweep run` of 10⁸ cells, beside what netCDF4 and xarray need to write the same arrays, and the
memory that a run takes at its peak.  ``--larger 10`` adds 10⁹ cells in netCDF, once: 20 GB of disk.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import netCDF4
import numpy as np
import xarray as xr

from benchmarks import machine

NAMES = ("theta", "mu_s", "amplitude", "frequency")

#: Times that all are measured, one after the other.
TURNS = 3

#: Cells of which xarray's arrays are made in memory, at most.
IN_MEMORY = 2e8

#: Types of the results that are stored by default.
DTYPES = {
    "permanent_displacement": "f8",
    "peak_relative_velocity": "f8",
    "sliding_mode": "i1",
    "validity": "i2",
}


def sweep_file(path: Path, lengths: Sequence[int]) -> Path:
    """A sweep with axes of these lengths."""
    ends = ((0, 15), (0.28, 0.6), (0.5, 9), (0.5, 10))
    path.write_text(
        "".join(
            f"[axes.{name}]\nstart = {start}\nstop = {stop}\nnum = {num}\n"
            for name, (start, stop), num in zip(NAMES, ends, lengths, strict=True)
        )
    )
    return path


def seconds_and_memory(*command: str) -> tuple[float, float]:
    """Seconds of a process until its output is on the disk, and its peak resident memory, MB."""
    started = time.perf_counter()
    process = subprocess.Popen([sys.executable, *command])
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, command
    os.sync()
    return time.perf_counter() - started, usage.ru_maxrss / 1000


def write_netcdf4(path: Path, lengths: Sequence[int]) -> float:
    """Seconds that netCDF4 takes to write arrays of these lengths, a slab after the other."""
    started = time.perf_counter()
    with netCDF4.Dataset(path, "w") as file:
        file.set_fill_off()
        for name, length in zip(NAMES, lengths, strict=True):
            file.createDimension(name, length)
        slabs = {name: np.ones((2, *lengths[1:]), kind) for name, kind in DTYPES.items()}
        for name, kind in DTYPES.items():
            file.createVariable(name, kind, NAMES, contiguous=True)
        for at in range(0, lengths[0], 2):
            for name, slab in slabs.items():
                file[name][at : at + 2] = slab
    os.sync()
    return time.perf_counter() - started


def write_xarray(path: Path, lengths: Sequence[int]) -> float:
    """Seconds that xarray takes to write the same from memory."""
    table = xr.Dataset(
        {name: (NAMES, np.ones(tuple(lengths), kind)) for name, kind in DTYPES.items()}
    )
    started = time.perf_counter()
    table.to_netcdf(path)
    os.sync()
    return time.perf_counter() - started


def measured(
    folder: Path, lengths: Sequence[int], turns: int, outputs: dict[str, tuple[str, ...]]
) -> str:
    """Table of a sweep of these lengths, written by `slipsweep run`, netCDF4 and xarray."""
    seconds: dict[str, list[float]] = {}
    memory: dict[str, float] = {}
    sweep = sweep_file(folder / "a.toml", lengths)
    others = {"netCDF4, the same arrays": write_netcdf4}
    if np.prod(lengths) <= IN_MEMORY:
        others["xarray, the same arrays"] = write_xarray
    for _ in range(turns):  # in turn: other processes and the disk are not always the same
        for output, options in outputs.items():
            what = f"`slipsweep run -o {' '.join((output, *options))}`"
            path = folder / output
            command = (
                "-m",
                "slipsweep",
                "run",
                str(sweep),
                "-o",
                str(path),
                "-q",
                "--overwrite",
                *options,
            )
            took, peak = seconds_and_memory(*command)
            seconds.setdefault(what, []).append(took)
            memory.setdefault(what, peak)  # later ones begin with that of this process
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        for what, write in others.items():
            seconds.setdefault(what, []).append(write(folder / "c.nc", lengths))
            (folder / "c.nc").unlink()
    rows = [
        [
            what,
            f"{np.median(took):.1f}",
            f"{min(took):.1f}",
            f"{memory[what]:.0f}" if what in memory else "",
        ]
        for what, took in seconds.items()
    ]
    times = "once" if turns == 1 else f"{turns} times each"
    cells = (
        f"{np.prod(lengths):,} cells, {np.prod(lengths) * 19 / 1e9:.2g} GB of results; {times}.\n\n"
    )
    return (
        cells
        + machine.table(["what", "s, with sync: median", "least", "peak memory, MB"], rows).strip()
    )


def main() -> None:
    """Measure, and write the table."""
    options = machine.arguments(__doc__, counts={"larger": 0})
    lengths = (10, 5, 10, 20) if options.tiny else (100, 50, 100, 200)
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        outputs: dict[str, tuple[str, ...]] = {
            "a.nc": (),
            "b.nc": ("--memory", "1GB"),
            "a.zarr": (),
        }
        tables = []
        if options.larger:  # first: the peak of a process begins with that of this one
            tables.append(
                measured(Path(name), (lengths[0] * options.larger, *lengths[1:]), 1, {"a.nc": ()})
            )
        tables.insert(0, measured(Path(name), lengths, 1 if options.tiny else TURNS, outputs))
    text = "\n\n".join([machine.measured_on(("numpy", "numba", "netCDF4", "zarr")), *tables])
    (options.folder / "large_sweeps.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
