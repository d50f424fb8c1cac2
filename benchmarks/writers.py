"""Workers that write their chunks themselves, 1, 2 and 4 of them, against the disk; and what is left to the client.

``python -m benchmarks.writers`` writes writers.md; ``.ci/include-report`` puts it into docs/scaling.md.
"""

import os
import pickle
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.large_sweeps import DISK, RESULTS, process, sweep_file
from benchmarks.machine import arguments, measured_on, number, table
from slipsweep.files import spec
from slipsweep.grid import chunks
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk
from slipsweep.runs import store
from slipsweep.runs.jobs import sweep_job
from slipsweep.runs.solving import Deliver, Progress, solve_here

WORKERS = (1, 2, 4)


def seconds(sweep: Path, output: Path, *options: str) -> float:
    """What `slipsweep run` takes by the clock; its output is removed."""
    words = ("-m", "slipsweep", "run", str(sweep), "-o", str(output), "-q", *options)
    taken = process(*words).seconds
    shutil.rmtree(output) if output.is_dir() else output.unlink()
    return taken


def throughput(folder: Path, tiny: bool) -> str:
    """GB/s of results, without start-up."""
    lengths = (4, 4, 4, 4) if tiny else (50, 100, 100, 100)
    nbytes = int(np.prod(lengths)) * sum(np.dtype(kind).itemsize for kind in RESULTS.values())
    sweep, idle = sweep_file(folder / "big.toml", lengths), sweep_file(folder / "idle.toml", [1] * 4)
    rows = []
    outputs = {"one file, by the client": ("a.nc", ()), "`--split`": ("a", ("--split",)), "Zarr store": ("a.zarr", ())}
    for name, (output, options) in outputs.items():
        cells = [name]
        for count in WORKERS:
            words = (*options, "--workers", str(count))
            start, whole = (seconds(one, folder / output, *words) for one in (idle, sweep))
            cells.append(number(nbytes / max(whole - start, 1e-9) / 1e9) if not tiny else "–")
        rows.append(cells)
    alone = float(process("-c", DISK, str(folder / "disk"), str(nbytes)).printed)
    rows.append(["the disk alone, written directly", number(nbytes / alone / 1e9), "", ""])
    header = ["GB/s", *(f"`--workers {count}`" for count in WORKERS)]
    return f"{table(header, rows)}\n{int(np.prod(lengths)):,} cells, {number(nbytes / 1e9)} GB, start-up taken off.\n"


def at_the_client(folder: Path, tiny: bool) -> str:
    """What is left of a chunk for the client, and the arithmetic for 10¹² cells."""
    found: list[int] = []

    def solved(
        plan: AnyPlan, missing: Mapping[int, Chunk], progress: Progress | None, deliver: Deliver
    ) -> Iterator[tuple[int, Any]]:
        for chunk, solution in solve_here(plan, missing, progress):
            delivered = deliver(plan, chunk, missing[chunk], solution)
            found.append(len(pickle.dumps(delivered)))
            yield chunk, delivered

    sweep = sweep_file(folder / "some.toml", (4, 4, 4, 4) if tiny else (20, 20, 50, 10))
    job = sweep_job(spec.parse(sweep.read_text(), "some.toml"))
    store.run(job, folder / "some.zarr", command="-", chunk_cells=100, shared=True, solved=solved)
    each, count = max(found), 10**12 // chunks.CHUNK_CELLS
    whole = 10**12 * sum(np.dtype(kind).itemsize for kind in RESULTS.values())
    return (
        f"What comes back of a chunk that a worker wrote is {each} bytes. 10¹² cells in {count:,} chunks of "
        f"{chunks.CHUNK_CELLS:,} make {count * each / 1e6:.0f} MB of them at the client, which 10 Gbit/s carry in "
        f"{count * each * 8 / 1e10:.2g} s, instead of {whole / 1e12:.0f} TB in {whole * 8 / 1e10 / 3600:.1f} h.\n"
    )


def main() -> None:
    """Measure, write writers.md."""
    given = arguments(__doc__)
    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        text = f"{throughput(Path(name), given.tiny)}\n{at_the_client(Path(name), given.tiny)}"
    load = f"Load of the machine (processes that want a core) {before:.1f} before and {os.getloadavg()[0]:.1f} after."
    about = measured_on(("numpy", "netCDF4", "zarr", "distributed"))
    (given.folder / "writers.md").write_text(f"{text}\n{about} {load} Written by `python -m benchmarks.writers`.\n")


if __name__ == "__main__":
    main()
