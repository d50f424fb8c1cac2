"""The machine, the clock, and the Markdown that results are written in."""

import argparse
import gc
import math
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from slipsweep import __version__

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
DOCS = ROOT / "docs"


def processor() -> str:
    """Name of the processor and the number of cores this process may use."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        name = next(
            (line.split(":")[1].strip() for line in info.open() if line.startswith("model name")),
            name,
        )
    return f"{name}, {cores()} cores"


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def versions(packages: Iterable[str]) -> str:
    """Versions of those of `packages` that are installed, and Python's."""
    texts = [f"Python {platform.python_version()}"]
    for package in packages:
        try:
            texts.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    return ", ".join(texts)


def measured_on(packages: Iterable[str] = ("numpy", "numba", "xarray"), timed: bool = True) -> str:
    """Machine and versions, over every table; with times also the load of other processes."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    is_busy = timed and load > 2 * cores()
    busy = (
        f" Other processes used the machine (load {load:.0f}): times are rough." if is_busy else ""
    )
    return (
        f"Measured on {processor()}; {platform.system()}, {versions(packages)}, "
        f"slipsweep {__version__}.{busy}"
    )


def alternate(
    functions: Mapping[str, Callable[[], object]], repeats: int, calls: int = 1
) -> dict[str, float]:
    """Median seconds of each function, called in turn `repeats` times after an unmeasured call.

    Taking turns puts a slow spell of a shared machine on all of them alike.  The best of `calls` at
    a turn counts: the first of them may have to get memory from the host of a virtual machine, at
    up to 2.5 µs for 4 KB.
    """
    for function in functions.values():
        function()
    taken: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, function in functions.items():
            gc.collect()
            best = math.inf
            for _ in range(calls):
                start = time.perf_counter()
                result = function()
                best = min(best, time.perf_counter() - start)
                del result  # outside the clock, before the next allocation
            taken[name].append(best)
    return {name: statistics.median(times) for name, times in taken.items()}


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; all columns but the first are set to the right."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines) + "\n"


def number(value: float, digits: int = 3) -> str:
    """`value` to a few digits, as people write it."""
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        rounded = float(f"{value:.{digits}g}")
        return f"{rounded:.0f}" if abs(rounded) >= 10.0 ** (digits - 1) else f"{value:#.{digits}g}"
    return f"{value:.{max(digits - 2, 0)}e}"


def arguments(
    description: str | None,
    folder: Path = RESULTS,
    counts: Mapping[str, int] | None = None,
    files: Iterable[str] = (),
) -> argparse.Namespace:
    """Command line that all measurements share, with further whole numbers and files."""
    parser = argparse.ArgumentParser(description=(description or "").split("\n")[0])
    parser.add_argument("--tiny", action="store_true", help="a few cells only, to see that it runs")
    parser.add_argument(
        "--folder",
        type=Path,
        default=folder,
        help="where tables and figures go (default: %(default)s)",
    )
    for name, default in (counts or {}).items():
        parser.add_argument(f"--{name}", type=int, default=default, help="(default: %(default)s)")
    for name in files:
        parser.add_argument(f"--{name}", type=Path)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    return options
