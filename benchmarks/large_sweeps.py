"""Sweeps to disk: throughput, chunks, workers, memory, compression, and what follows for 10¹² cells.

``python -m benchmarks.large_sweeps`` writes large_sweeps.md, scaling.md and large_sweeps.json; then
``.ci/include-report`` puts the tables into docs.  Commands are run as processes, as a user runs them.
What is compared takes turns, and the least of several times is taken: on a machine that others use
the median would measure them.  Where they use all of it, only the seconds of processor say something.
Some minutes, and 8 GB of disk (`TMPDIR`).
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

import slipsweep
from benchmarks.grids import design_grid, regime_cells
from benchmarks.machine import ROOT, alternate, arguments, cores, measured_on, number, table
from slipsweep.files import spec
from slipsweep.grid import chunks
from slipsweep.runs import store
from slipsweep.runs.jobs import Job, sweep_job

#: Results that are written by default, with their types.
RESULTS = {"permanent_displacement": "f8", "peak_relative_velocity": "f8", "sliding_mode": "i1", "validity": "i2"}

#: Writes the same bytes with the netCDF4 library alone, as many cells at a time as a chunk has, from arrays that are
#: there: what is measured begins with opening the file.
ALONE = """
import os, sys, time
import netCDF4, numpy as np
path, length, rows, synced = sys.argv[1], *map(int, sys.argv[2:])
arrays = {name: np.random.default_rng(0).random((rows, length, length, length)).astype(kind)
          for name, kind in %r.items()}
start = time.perf_counter()
with netCDF4.Dataset(path, "w") as file:
    for dim in "abcd":
        file.createDimension(dim, length)
    variables = [file.createVariable(name, array.dtype, tuple("abcd")) for name, array in arrays.items()]
    for first in range(0, length, rows):
        for variable, array in zip(variables, arrays.values()):
            variable[first : first + rows] = array[: length - first]
if synced:
    with open(path, "rb+") as file:
        os.fsync(file.fileno())
print(time.perf_counter() - start)
"""

#: Writes as many bytes, 2 MiB at a time, past the system's cache where that can be: what the disk takes by itself.
DISK = """
import mmap, os, sys, time
from slipsweep.runs.placed import open_directly
path, nbytes = sys.argv[1], int(sys.argv[2])
piece = mmap.mmap(-1, 2**21)
piece.write(os.urandom(2**21))
start = time.perf_counter()
buffered = os.open(path, os.O_WRONLY | os.O_CREAT)
file = open_directly(path) or buffered
for _ in range(-(-nbytes // 2**21)):
    os.write(file, piece)
os.fsync(file)
print(time.perf_counter() - start)
"""


@dataclass
class Process:
    """What a process took: seconds by the clock and of the processor, peak resident bytes, and what it printed."""

    seconds: float
    processor: float
    memory: float
    printed: str


def process(*words: str) -> Process:
    """Run Python with some arguments."""
    start = time.perf_counter()
    with subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True, cwd=ROOT) as running:
        assert running.stdout is not None
        printed = running.stdout.read()
        _, status, usage = os.wait4(running.pid, 0)
        running.returncode = os.waitstatus_to_exitcode(status)
    if running.returncode:
        raise RuntimeError(f"{words}: exit status {running.returncode}")
    return Process(time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024.0, printed)


def sweep_file(path: Path, lengths: Sequence[int], more: str = "") -> Path:
    """Write a sweep file over the range of a design chart."""
    ranges = {"theta": (0, 20), "mu_s": (0.2, 0.9), "amplitude": (0.5, 13), "frequency": (0.1, 20)}
    axes = (
        f"[axes.{name}]\n"
        + (f"start = {start}\nstop = {stop}\nnum = {length}\n" if length > 1 else f"values = [{stop}]\n")
        for (name, (start, stop)), length in zip(ranges.items(), lengths, strict=True)
    )
    path.write_text("".join(axes) + more)
    return path


def run(sweep: Path, *options: str) -> Process:
    """`slipsweep run`, whose output is removed again."""
    output = sweep.with_suffix(".nc")
    try:
        return process("-m", "slipsweep", "run", str(sweep), "-o", str(output), "--quiet", *options)
    finally:
        output.unlink(missing_ok=True)


def alone(folder: Path, length: int, synced: bool) -> Process:
    """The netCDF4 library writing what four axes of a length give; it prints the seconds, and the file is removed."""
    rows = max(1, chunks.CHUNK_CELLS // length**3)
    path = folder / "alone.nc"
    try:
        return process("-c", ALONE % RESULTS, str(path), str(length), str(rows), str(int(synced)))
    finally:
        path.unlink(missing_ok=True)


def size_of(length: int) -> int:
    """Bytes that four axes of a length give."""
    return length**4 * sum(np.dtype(kind).itemsize for kind in RESULTS.values())


def throughput(folder: Path, tiny: bool) -> tuple[str, dict[str, float]]:
    """`slipsweep run` to netCDF, against the netCDF4 library writing as many bytes."""
    length = 10 if tiny else 100
    sweep = sweep_file(folder / "big.toml", [length] * 4)
    taken: dict[str, list[tuple[float, float]]] = {"run": [], "alone": [], "again": [], "synced": [], "disk": []}
    memory = 0.0
    nbytes = size_of(length)
    run(sweep)  # the kernels are on disk from here on
    for _ in range(1 if tiny else 4):
        # each after what is not of its kind, but for "again": a virtual machine takes up to seconds of processor to
        # have 1.9 GB of memory from its host, and none for what a process has just given back
        for name in ("alone", "again", "run", "synced", "run", "disk"):
            if name == "run":
                found = run(sweep)
                memory = max(memory, found.memory)
                taken["run"].append((found.seconds, found.processor))
                continue
            if name == "disk":
                found = process("-c", DISK, str(folder / "alone.nc"), str(nbytes))
                (folder / "alone.nc").unlink()
            else:
                found = alone(folder, length, name == "synced")
            taken[name].append((float(found.printed), found.processor))
    seconds = {name: min(first for first, _ in times) for name, times in taken.items()}
    processor = {name: min(second for _, second in times) for name, times in taken.items()}
    # what the disk does in this minute both have had
    whole = [one for one, _ in taken["run"]]
    ratios = [0.5 * sum(whole[2 * k : 2 * k + 2]) / one for k, (one, _) in enumerate(taken["synced"])]
    names = {
        "run": "`slipsweep run`, whole process, on the disk at the end",
        "alone": "netCDF4 alone, in the page cache at the end",
        "again": "the same once more, right after itself",
        "synced": "netCDF4 alone, on the disk at the end",
        "disk": "as many bytes written directly, on the disk at the end",
    }
    rows_of_table = [
        [
            text,
            number(seconds[name]),
            number(nbytes / seconds[name] / 1e9),
            number(seconds["run"] / seconds[name]),
            number(processor[name]),
        ]
        for name, text in names.items()
    ]
    text = (
        f"### {length**4:,} cells to netCDF ({nbytes / 1e9:.3g} GB)\n\n"
        + table(["", "s", "GB/s", "`run` takes times that", "s of processor"], rows_of_table)
        + f"\nFour axes of {length}, default results, {1 if tiny else 4} times each in turn, `run` twice as often. "
        f"Peak resident memory of `run`: {memory / 1e6:.0f} MB. Round by round, each within a minute, the mean of both "
        f"`run` over netCDF4 on the disk: {', '.join(map(number, ratios))}.\n"
    )
    return text, {"run_s": seconds["run"], "alone_s": seconds["alone"], "synced_s": seconds["synced"], "bytes": nbytes}


def larger(folder: Path, tiny: bool) -> tuple[str, dict[str, float]]:
    """The same with four times the bytes, beside which the start-up of `run` counts less."""
    length = 14 if tiny else 142
    sweep = sweep_file(folder / "larger.toml", [length] * 4)
    taken = [(run(sweep).seconds, float(alone(folder, length, True).printed)) for _ in range(1 if tiny else 4)]
    runs, others = (f"{number(min(times))} to {number(max(times))} s" for times in zip(*taken, strict=True))
    ratios = ", ".join(number(ours / theirs) for ours, theirs in taken)
    text = (
        f"### {length**4:,} cells to netCDF ({size_of(length) / 1e9:.3g} GB)\n\n`slipsweep run` took {runs}, netCDF4 "
        f"alone, on the disk at the end, {others}. Round by round, `run` over netCDF4: {ratios}.\n"
    )
    return text, {"run_s": min(ours for ours, _ in taken), "synced_s": min(theirs for _, theirs in taken)}


def overhead(folder: Path, tiny: bool) -> tuple[str, dict[str, float]]:
    """What a chunk costs beside its cells: the same sweep in chunks of the default size and in smaller ones."""
    length, size = (10, 1000) if tiny else (80, chunks.CHUNK_CELLS)
    rows, worst = [], 0.0
    for name, lengths in {
        f"four axes of {length}": [length] * 4,
        "no frequency axis": [length // 2, length, 10 * length, 1],
    }.items():
        job = sweep_job(spec.parse(sweep_file(folder / "chunks.toml", lengths).read_text(), "chunks.toml"))

        def chunked(cells: int, job: Job = job) -> Callable[[], object]:
            return lambda: store.run(job, folder / "chunks.nc", command="-", overwrite=True, chunk_cells=cells)

        counts = [sum(1 for _ in chunks.grid_chunks(job.plan.sizes, cells)) for cells in (size, size // 8)]
        whole, eighth = alternate({"1": chunked(size), "8": chunked(size // 8)}, 1 if tiny else 5, min).values()
        each = max(0.0, eighth - whole) / (counts[1] - counts[0])
        share = each * counts[0] / whole
        worst = max(worst, share)
        rows.append([name, f"{job.plan.cells:,}", *counts, number(whole), number(eighth), number(each * 1e3)])
        rows[-1].append(f"{share:.1%}")
    (folder / "chunks.nc").unlink(missing_ok=True)
    text = (
        f"### A chunk's overhead (default: {chunks.CHUNK_CELLS:,} cells)\n\n"
        + table(["", "cells", "chunks", "in eighths", "s", "s in eighths", "ms a chunk", "share at default"], rows)
        + "\nThe time that more chunks add, over their number.\n"
    )
    return text, {"share": worst}


def workers(folder: Path, tiny: bool) -> tuple[str, dict[str, float]]:
    """The step solver on processes: one worker, two, and threads of one process."""
    lengths = [4, 4, 8, 1] if tiny else [50, 50, 400, 1]
    more = '[solver]\nmethod = "step"\nrule = "simpson"\nsteps_per_cycle = 4096\n'
    sweep = sweep_file(folder / "step.toml", lengths, more)
    options = {"--workers 1": ["--workers", "1"], "--workers 2": ["--workers", "2"], "threads": []}
    run(sweep)
    taken: dict[str, list[float]] = {name: [] for name in options}
    for _ in range(1 if tiny else 3):
        for name, words in options.items():
            taken[name].append(run(sweep, *words).seconds)
    seconds = {name: min(times) for name, times in taken.items()}
    # what a cluster and a process take to start is no work to be shared
    idle = sweep_file(folder / "idle.toml", [1, 1, 1, 1], more)
    start = {name: min(run(idle, *words).seconds for _ in range(1 if tiny else 3)) for name, words in options.items()}
    one = "--workers 1"
    rows = [
        [
            f"`{name}`" if name != "threads" else f"neither ({cores()} threads)",
            number(seconds[name]),
            number(start[name]),
            number(seconds[one] / seconds[name]),
            number((seconds[one] - start[one]) / (seconds[name] - start[name])) if not tiny else "–",
        ]
        for name in options
    ]
    text = (
        f"### {np.prod(lengths):,} cells by the step solver, on processes\n\n"
        + table(["", "s", "of it start-up", "times as fast as one worker", "without start-up"], rows)
        + f"\nSimpson's rule, 4096 steps a cycle, on a machine of {cores()} cores.\n"
    )
    return text, {"one_s": seconds[one], "two_s": seconds["--workers 2"]}


def memory(folder: Path, tiny: bool) -> tuple[str, dict[str, float]]:
    """Peak resident memory of the largest sweep, which must not grow with the grid."""
    more = '[output]\nvariables = ["permanent_displacement"]\ndtype = "float32"\n'
    rows, peak = [], 0.0
    for lengths in [[4] * 4] if tiny else [[100, 100, 100, 100], [100, 100, 1000, 100]]:
        found = run(sweep_file(folder / "memory.toml", lengths, more))
        peak = max(peak, found.memory)
        cells = int(np.prod(lengths))
        rows.append([f"{cells:,}", number(4e-9 * cells), number(found.seconds), f"{found.memory / 1e6:.0f} MB"])
    text = "### Memory\n\n" + table(["cells", "GB", "s", "peak resident memory"], rows)
    return text + "\nDisplacement as float32, default size of chunks.\n", {"peak_bytes": peak}


def compression(folder: Path, tiny: bool) -> tuple[str, dict[str, float]]:
    """The filters that every build of netCDF has, on results as they are."""
    grid = design_grid(*((4, 4, 4) if tiny else (50, 50, 100)))
    found = slipsweep.sweep(**grid | {"frequency": np.geomspace(0.1, 20.0, 4 if tiny else 80)})
    flags = ("sliding_mode", "validity")
    filters: dict[str, Callable[[str], dict[str, Any]]] = {
        "none": lambda name: {"contiguous": True},
        "zlib 1 and shuffle on modes and flags": lambda name: (
            {"zlib": True, "complevel": 1, "shuffle": True} if name in flags else {"contiguous": True}
        ),
        "zlib 1 and shuffle on all": lambda name: {"zlib": True, "complevel": 1, "shuffle": True},
        "zlib 4 and shuffle on all": lambda name: {"zlib": True, "complevel": 4, "shuffle": True},
    }
    path = folder / "compressed.nc"
    sizes: dict[str, int] = {}

    def writing(name: str) -> Callable[[], object]:
        def write() -> None:
            with netCDF4.Dataset(path, "w") as file:
                for dim in found.dims:
                    file.createDimension(str(dim), found.sizes[dim])
                for variable in RESULTS:
                    array = found[variable]
                    chunks = None if "contiguous" in filters[name](variable) else (5, *array.shape[1:])
                    options = filters[name](variable) | ({"chunksizes": chunks} if chunks and not tiny else {})
                    file.createVariable(variable, array.dtype, map(str, array.dims), **options)[...] = array.values
            sizes[name] = path.stat().st_size

        return write

    times = alternate({name: writing(name) for name in filters}, 1 if tiny else 2, min)
    path.unlink()
    nbytes = sum(found[name].nbytes for name in RESULTS)
    rows = [
        [name, number(seconds), number(nbytes / seconds / 1e9), f"{sizes[name] / sizes['none']:.0%}"]
        for name, seconds in times.items()
    ]
    text = (
        f"### Compression of {found.permanent_displacement.size:,} cells ({nbytes / 1e6:.0f} MB)\n\n"
        + table(["filters", "s", "GB/s", "bytes"], rows)
        + "\nWritten by the netCDF4 library in one piece.\n"
    )
    return text, {}


def scaling(tiny: bool, measured: Mapping[str, Mapping[str, float]]) -> str:
    """Tables for 10¹² cells out of what one machine takes for 10⁸."""
    thousand: dict[str, Any] = {"variables": ["permanent_displacement"]}
    flat = design_grid(*((4, 4, 8) if tiny else (60, 50, 400)))
    deep = design_grid(*((4, 4, 8) if tiny else (60, 50, 200))) | {"frequency": np.geomspace(0.1, 20, 100)}
    stepped = regime_cells("continuous", 32 if tiny else 20_000)
    works: dict[str, tuple[Callable[[], Any], int]] = {
        "cycle solver, no frequency axis": (
            lambda: slipsweep.sweep(**flat),
            4 * 4 * 8 if tiny else 1_200_000,
        ),
        "cycle solver, 100 frequencies": (
            lambda: slipsweep.sweep(**deep),
            4 * 4 * 800 if tiny else 60_000_000,
        ),
        "step solver, Simpson, 1024 steps, continuous": (
            lambda: slipsweep.sweep(**stepped, **thousand, solver=slipsweep.Step("simpson", 1024)),
            next(values.size for values in stepped.values() if hasattr(values, "size")),
        ),
    }
    times = alternate({name: work for name, (work, _) in works.items()}, 1 if tiny else 5, min)
    each = {name: times[name] * cores() / works[name][1] for name in works}
    rate = measured["throughput"]["bytes"] / measured["throughput"]["run_s"]
    rows = [
        [
            name,
            number(seconds * 1e9),
            f"{seconds * 1e12:,.0f} s = {seconds * 1e12 / 3600:,.1f} h",
            duration(seconds * 1e9),
        ]
        for name, seconds in each.items()
    ]
    parts = [table(["10¹² cells", "ns a cell and core", "core time: 10¹² times that", "1,000 cores"], rows)]
    kinds = {
        "default results, float64: 8 + 8 + 1 + 2": 19,
        "default results, float32: 4 + 4 + 1 + 2": 11,
        "displacement only, float32": 4,
        "mode only": 1,
    }
    rows = [
        [
            name,
            str(size),
            f"{size} TB",
            duration(size * 1e12 / rate),
            duration(size * 1e12 / 1.25e9),
            duration(size * 10.0),
        ]
        for name, size in kinds.items()
    ]
    header = ["10¹² cells", "bytes a cell", "in all", f"one `run`, {rate / 1e9:.2g} GB/s", "10 Gbit/s", "100 GB/s"]
    parts.append(table(header, rows))
    rows = [
        [name, number(19e-6 / seconds), number(rate * seconds / 19, 2), number(1.25e9 * seconds / 19, 2)]
        for name, seconds in each.items()
    ]
    header = ["", "MB/s of results a core", f"cores for {rate / 1e9:.2g} GB/s", "cores for 10 Gbit/s"]
    parts.append(table(header, rows))
    solved = each["cycle solver, no frequency axis"]
    parts.append(
        f"All of them together: 10¹² cells at one frequency of 60, half the points on θ, μs and A, displacement "
        f"only, float32: 10¹² / 60 / 8 = 2.1 × 10⁹ cells, times 4 bytes = 8.3 GB, and times {solved * 1e9:.3g} ns = "
        f"{2.083e9 * solved:.0f} s of one core.\n"
    )
    return "\n".join(parts)


def duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{number(seconds / size, 2)} {unit}"
    return f"{number(seconds, 2)} s"


def main() -> None:
    """Measure everything, write large_sweeps.md, scaling.md and large_sweeps.json."""
    given = arguments(__doc__)
    before = os.getloadavg()[0]
    measured: dict[str, dict[str, float]] = {}
    texts: list[str] = []

    def write() -> str:
        """Write what there is so far; return the sentence that stands over it."""
        measured["load"] = {"before": before, "after": os.getloadavg()[0]}
        head = (
            f"{measured_on(('numpy', 'numba', 'netCDF4', 'distributed'))} Load of the machine (processes that want a "
            f"core) {before:.1f} before and {measured['load']['after']:.1f} after; "
            "the least of several times. Written by `python -m benchmarks.large_sweeps`.\n"
        )
        (given.folder / "large_sweeps.md").write_text("\n".join([head, *texts]))
        (given.folder / "large_sweeps.json").write_text(json.dumps(measured, indent=1) + "\n")
        return head

    with tempfile.TemporaryDirectory() as folder:
        for section in (throughput, larger, overhead, workers, memory, compression):
            text, measured[section.__name__] = section(Path(folder), given.tiny)
            texts.append(text)
            print(text, flush=True)
            write()
    scaled = scaling(given.tiny, measured)
    (given.folder / "scaling.md").write_text(f"{write()}\n{scaled}")


if __name__ == "__main__":
    main()
