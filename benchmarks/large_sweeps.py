"""Large sweeps to disk: ``python -m benchmarks.large_sweeps`` writes results/large_sweeps.md; minutes, 8 GB.

`slipsweep run` of 10⁸ cells, beside what netCDF4 and xarray need to write the same arrays, and the memory that a run
takes at its peak.
"""

import os
import resource
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

#: Types of the results that are stored by default.
DTYPES = {"permanent_displacement": "f8", "peak_relative_velocity": "f8", "sliding_mode": "i1", "validity": "i2"}


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
    """Seconds of a process, with what it has written on the disk itself, and its resident memory at the peak, MB."""
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
    table = xr.Dataset({name: (NAMES, np.ones(tuple(lengths), kind)) for name, kind in DTYPES.items()})
    started = time.perf_counter()
    table.to_netcdf(path)
    os.sync()
    return time.perf_counter() - started


def main() -> None:
    """Measure, and write the table."""
    given = machine.arguments(__doc__)
    lengths = (10, 5, 10, 20) if given.tiny else (100, 50, 100, 200)
    seconds: dict[str, list[float]] = {}
    memory: dict[str, float] = {}
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        folder = Path(name)
        sweep = sweep_file(folder / "a.toml", lengths)
        for _ in range(1 if given.tiny else TURNS):  # in turn: other processes and the disk are not always the same
            for output, options in (("a.nc", ()), ("b.nc", ("--memory", "1GB")), ("a.zarr", ())):
                what = f"`slipsweep run -o {' '.join((output, *options))}`"
                command = (
                    "-m",
                    "slipsweep",
                    "run",
                    str(sweep),
                    "-o",
                    str(folder / output),
                    "-q",
                    "--overwrite",
                    *options,
                )
                took, peak = seconds_and_memory(*command)
                seconds.setdefault(what, []).append(took)
                memory.setdefault(what, peak)  # later ones begin with that of this process
            for what, write in (("netCDF4, the same arrays", write_netcdf4), ("xarray, the same arrays", write_xarray)):
                seconds.setdefault(what, []).append(write(folder / "c.nc", lengths))
                (folder / "c.nc").unlink()
    rows = [
        [what, f"{np.median(took):.1f}", f"{min(took):.1f}", f"{memory[what]:.0f}" if what in memory else ""]
        for what, took in seconds.items()
    ]
    cells = f"{np.prod(lengths):,} cells, {np.prod(lengths) * 19 / 1e9:.2g} GB of results."
    text = f"{machine.measured_on(('numpy', 'numba', 'netCDF4', 'zarr'))} {cells}\n\n"
    text += machine.table(["what", "s, with sync: median", "least", "peak memory, MB"], rows)
    (given.folder / "large_sweeps.md").write_text(text + "\n")
    print(text, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1000, "MB here")


if __name__ == "__main__":
    main()
