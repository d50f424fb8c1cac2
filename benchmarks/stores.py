"""Results in other forms: ``python -m benchmarks.stores`` writes stores.md, which docs/files.md shows.

Sizes and times of the shipped design chart, compressed and not, as files of ``--split`` and as a Zarr store; and what a
mean over a result takes that `slipsweep.open_result` opens, file in the system's memory.
"""

import tempfile
from pathlib import Path

from benchmarks.large_sweeps import Process, process, sweep_file
from benchmarks.machine import ROOT, arguments, measured_on, table
from slipsweep.grid.resources import size_text

LEVELS = (0, 1, 5, 9)

#: Lengths of the axes of the result whose mean is taken: 10⁹ cells.
LARGE, SMALL = (100, 100, 1000, 100), (10, 10, 10, 10)

MEAN = """
import sys, time, slipsweep
start = time.perf_counter()
float(slipsweep.open_result(sys.argv[1]).permanent_displacement.mean())
print(time.perf_counter() - start)
"""


def written(sweep: Path, output: Path, *options: str, turns: int) -> tuple[float, int]:
    """Seconds of `slipsweep run`, the least of some turns, and the bytes of its output."""
    words = ("-m", "slipsweep", "run", str(sweep), "-o", str(output), "-q", "--overwrite", *options)
    seconds = min(process(*words).seconds for _ in range(turns))
    return seconds, sum(one.stat().st_size for one in output.rglob("*") if one.is_file())


def compression(folder: Path, tiny: bool) -> str:
    """The table of levels."""
    if tiny:
        sweep_file(folder / "chart.toml", SMALL, "[output]\n")
    else:
        (folder / "chart.toml").write_text((ROOT / "sweeps" / "design_chart.toml").read_text())
    text = (folder / "chart.toml").read_text()
    rows = []
    for level in LEVELS[-1:] if tiny else LEVELS:
        sweep = folder / f"chart{level}.toml"
        sweep.write_text(text.replace("[output]", f"[output]\ncompression = {level}"))
        cells = [str(level)]
        for output, options in ((folder / "split", ("--split",)), (folder / "store.zarr", ())):
            seconds, nbytes = written(sweep, output, *options, turns=1 if tiny else 3)
            cells += [size_text(nbytes), f"{seconds:.2f}"]
        rows.append(cells)
    return table(["`output.compression`", "`--split`", "s", "Zarr store", "s"], rows)


def mean(folder: Path, tiny: bool) -> tuple[Process, int]:
    """What a mean takes, and of how many bytes; the file is read before."""
    sweep = sweep_file(
        folder / "large.toml",
        SMALL if tiny else LARGE,
        '[output]\nvariables = ["permanent_displacement"]\ndtype = "float32"\n',
    )
    output = folder / "large.nc"
    process("-m", "slipsweep", "run", str(sweep), "-o", str(output), "-q")
    process("-c", MEAN, str(output))
    return process("-c", MEAN, str(output)), output.stat().st_size


def main() -> None:
    """Measure, write stores.md."""
    given = arguments(__doc__)
    with tempfile.TemporaryDirectory() as name:
        text = compression(Path(name), given.tiny)
        taken, nbytes = mean(Path(name), given.tiny)
    about = measured_on(("numpy", "xarray", "netCDF4", "zarr"))
    (given.folder / "stores.md").write_text(
        f"{text}\nThe shipped design chart (3,084,480 cells): bytes, and seconds of the whole command, the least of "
        f"three turns. The mean over 10⁹ cells (float32, {size_text(nbytes)}, in the system's memory) took "
        f"{float(taken.printed):.1f} s, the process at its peak {size_text(int(taken.memory))}. {about} Written by "
        "`python -m benchmarks.stores`.\n"
    )


if __name__ == "__main__":
    main()
