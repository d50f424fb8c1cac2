"""Threads and processes: `slipsweep.grid.threads` under everything that may call a sweep."""

import multiprocessing
import os
import subprocess
import sys
import threading
from collections.abc import Collection, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import slipsweep
from slipsweep.grid import solvers, threads
from slipsweep.kernels.block import UNSOLVED

GRID: dict[str, Any] = {
    "theta": np.linspace(0.0, 15.0, 60),
    "mu_s": np.linspace(0.2, 0.9, 50),
    "amplitude": np.linspace(0.5, 13.0, 20),
    "frequency": [1.0, 2.0],
}


def displacement(waveform: str = "sine") -> np.ndarray:
    result = slipsweep.sweep(**GRID, excitation=waveform, variables=["permanent_displacement"])
    values: np.ndarray = result.permanent_displacement.values
    return values


@pytest.fixture(scope="module")
def expected() -> np.ndarray:
    return displacement()


def count_in_process(code: str = "", **environment: str) -> int:
    """Threads that a fresh process would use, after some code."""
    clean = {
        name: value
        for name, value in os.environ.items()
        if name not in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
    }
    code += "\nfrom slipsweep.grid.threads import thread_count; print(thread_count())"
    return int(subprocess.check_output([sys.executable, "-c", code], env=clean | environment))


# ------------------------------------------------------------------------------ how many


def test_as_many_threads_as_cores() -> None:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    assert count_in_process() == cores


@pytest.mark.parametrize(
    ("name", "value"),
    [("NUMBA_NUM_THREADS", "1"), ("OMP_NUM_THREADS", "1"), ("OMP_NUM_THREADS", "1,4")],
)
def test_environment_limits_threads(name: str, value: str) -> None:
    """A list has a number for each level of nesting, of which the first counts."""
    assert count_in_process(**{name: value}) == 1


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity here")
def test_affinity_limits_threads() -> None:
    assert (
        count_in_process(code="import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})")
        == 1
    )
    # even where it changes later
    late = (
        "import os, slipsweep.grid.threads; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})"
    )
    assert count_in_process(code=late) == 1


# ------------------------------------------------------------------------------- spreading


@pytest.mark.parametrize("count", [1, 3])
def test_every_part_is_done_once(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "thread_count", lambda: count)
    done: list[int] = []
    threads.spread(range(1000), done.append)
    assert sorted(done) == [*range(1000)]


class Interrupted(list[int]):
    """Parts; Ctrl-C is pressed when the last of them has been handed in."""

    def __iter__(self) -> Iterator[int]:
        yield from super().__iter__()
        raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("count", "parts", "error"),
    [
        (1, range(1000), ZeroDivisionError),
        (2, range(1000), ZeroDivisionError),
        (2, Interrupted(range(1000)), KeyboardInterrupt),
    ],
)
def test_an_error_in_a_part_ends_the_whole(
    count: int,
    parts: Collection[int],
    error: type[BaseException],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is raised, parts that have not begun are left out, and no thread stays behind."""
    monkeypatch.setattr(threads, "thread_count", lambda: count)
    ending = threading.Event()
    shutdown = ThreadPoolExecutor.shutdown

    def announced(pool: ThreadPoolExecutor, **options: Any) -> None:
        shutdown(pool, **options | {"wait": False})
        ending.set()
        shutdown(pool)

    monkeypatch.setattr(ThreadPoolExecutor, "shutdown", announced)
    begun: list[int] = []

    def work(part: int) -> None:
        begun.append(part)
        if part == 1 and error is ZeroDivisionError:
            raise ZeroDivisionError
        if part > 1 or error is KeyboardInterrupt:
            ending.wait(60)

    before = threading.active_count()
    with pytest.raises(error):
        threads.spread(parts, work)
    assert {0, 1} >= {*begun} - {2, 3}
    assert len(begun) <= 2 * count
    assert threading.active_count() == before


@pytest.mark.parametrize("count", [1, 2])
def test_an_error_in_a_tile_leaves_the_sweep(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The results of the tile would be memory that nothing has written."""
    monkeypatch.setattr(threads, "thread_count", lambda: count)
    solver_of = solvers.solver_of

    def failing(*arguments: Any) -> Any:
        solver = solver_of(*arguments)

        def solve(cells: np.ndarray, results: np.ndarray) -> None:
            solver.solve(cells, results)
            results[solver.rows["validity"], cells["mu_s"] > 0.899] = UNSOLVED

        return solver._replace(solve=solve)

    monkeypatch.setattr(solvers, "solver_of", failing)
    with pytest.raises(
        slipsweep.RunError, match=r"mu_s = 0\.9, .*an event of the motion was not found"
    ):
        slipsweep.sweep(**GRID, variables=["permanent_displacement"])


# ------------------------------------------------------------------------------- who calls


def test_threads_of_others_compute_on_themselves(expected: np.ndarray) -> None:
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: threads.thread_count(), range(4))) == [1] * 4
        for result in pool.map(lambda _: displacement(), range(8)):
            np.testing.assert_array_equal(result, expected)


def test_dasks_threads_give_the_same_bits(expected: np.ndarray) -> None:
    lazy = slipsweep.sweep(
        **GRID, variables=["permanent_displacement"], chunks={"theta": 7, "mu_s": 13}
    )
    np.testing.assert_array_equal(
        lazy.permanent_displacement.data.compute(scheduler="threads"), expected
    )


@pytest.mark.parametrize(
    "method", [m for m in ("fork", "spawn") if m in multiprocessing.get_all_start_methods()]
)
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_processes_forked_or_not_give_the_same_bits(method: str, expected: np.ndarray) -> None:
    """No thread is left that a child could miss; loaded kernels give the bits of compiled ones."""
    # a process that is not forked takes two seconds to start
    with ProcessPoolExecutor(
        2 if method == "fork" else 1, multiprocessing.get_context(method)
    ) as pool:
        both = {waveform: pool.submit(displacement, waveform) for waveform in ("sine", "cosine")}
        np.testing.assert_array_equal(both["sine"].result(timeout=120), expected)
        np.testing.assert_array_equal(both["cosine"].result(timeout=120), displacement("cosine"))


# ---------------------------------------------------------------------------------- Ctrl-C

#: Sweeps of minutes, and their cells.
LONG = {
    "cycle": (
        "np.linspace(0, 20, 2000), np.linspace(0.2, 0.9, 2000), np.linspace(0.5, 13, 500), 1.0, "
        "variables=['sliding_mode']",
        2000 * 2000 * 500,
    ),
    "frequencies": (
        "np.linspace(0, 20, 300), np.linspace(0.2, 0.9, 300), 3.0, np.linspace(0.1, 9, 20_000), "
        "variables=['sliding_mode']",
        300 * 300 * 20_000,
    ),
    "step": (
        "np.linspace(0, 20, 20), np.linspace(0.2, 0.9, 20), np.linspace(0.5, 13, 50), 1.0, "
        "solver=slipsweep.Step(steps_per_cycle=1_000_000), variables=['permanent_displacement']",
        20 * 20 * 50,
    ),
}

#: Sends itself Ctrl-C when the first cells of a sweep are solved, and prints how many were in all.
INTERRUPTED = f"""
import os, signal
import numpy as np, slipsweep

def interrupt(cells):
    if not solved:
        os.kill(os.getpid(), signal.SIGINT)
    solved.append(cells)

for sweep in (
    {", ".join(f"lambda: slipsweep.sweep({text}, progress=interrupt)" for text, _ in LONG.values())}
):
    solved = []
    try:
        sweep()
    except KeyboardInterrupt:
        print(sum(solved))
"""


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("limit", ["", "1"], ids=["threads", "one"])
def test_an_interrupt_ends_a_sweep_long_before_its_end(limit: str) -> None:
    """Ctrl-C is heard between two calls of a kernel, of which a sweep has many."""
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        env={**os.environ, "OMP_NUM_THREADS": limit},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    for (kind, (_, cells)), solved in zip(LONG.items(), done.stdout.split(), strict=True):
        assert int(solved) < 0.6 * cells, kind
