"""Threads and processes: the policy of `slipsweep.grid.threads`, under everything that may call a sweep."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import slipsweep
from slipsweep.grid import threads

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


@pytest.mark.parametrize("name", ["NUMBA_NUM_THREADS", "OMP_NUM_THREADS"])
def test_environment_limits_threads(name: str) -> None:
    assert count_in_process(**{name: "1"}) == 1


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


# ------------------------------------------------------------------------------- who calls


def test_threads_of_others_compute_on_themselves(expected: np.ndarray) -> None:
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: threads.thread_count(), range(4))) == [1] * 4
        for result in pool.map(lambda _: displacement(), range(8)):
            np.testing.assert_array_equal(result, expected)


def test_dasks_threads(expected: np.ndarray) -> None:
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
def test_processes(method: str, expected: np.ndarray) -> None:
    """Forked after a sweep, too: no thread is left that a child could miss; and kernels that are loaded give the bits
    of those that were compiled here."""
    # a process that is not forked takes two seconds to start
    with ProcessPoolExecutor(
        2 if method == "fork" else 1, multiprocessing.get_context(method)
    ) as pool:
        both = {waveform: pool.submit(displacement, waveform) for waveform in ("sine", "cosine")}
        np.testing.assert_array_equal(both["sine"].result(timeout=120), expected)
        np.testing.assert_array_equal(both["cosine"].result(timeout=120), displacement("cosine"))


# ---------------------------------------------------------------------------------- Ctrl-C

LONG = {
    "cycle": "np.linspace(0, 20, 2000), np.linspace(0.2, 0.9, 2000), np.linspace(0.5, 13, 500), 1.0, "
    "variables=['sliding_mode']",
    "frequencies": "np.linspace(0, 20, 300), np.linspace(0.2, 0.9, 300), 3.0, np.linspace(0.1, 9, 20_000), "
    "variables=['sliding_mode']",
    "step": "np.linspace(0, 20, 200), np.linspace(0.2, 0.9, 200), np.linspace(0.5, 13, 500), 1.0, "
    "solver=slipsweep.Step(steps_per_cycle=1_000_000), variables=['permanent_displacement']",
}


#: Says when a sweep of each kind begins, and that it was interrupted.
INTERRUPTED = f"""
import numpy as np, slipsweep
for options in ({{}}, {{"solver": slipsweep.Step(steps_per_cycle=8)}}):
    slipsweep.sweep(1.0, 0.38, 3.0, 1.0, **options)  # machine code
for sweep in ({", ".join(f"lambda: slipsweep.sweep({arguments})" for arguments in LONG.values())}):
    print("ready", flush=True)
    try: sweep()
    except KeyboardInterrupt: print("interrupted", flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("limit", ["", "1"], ids=["threads", "one"])
def test_an_interrupt_is_heard_at_once(limit: str) -> None:
    streams: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = {**os.environ, "OMP_NUM_THREADS": limit}
    with subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED], env=environment, **streams
    ) as process:
        assert process.stdout is not None
        stop = threading.Timer(120, process.kill)
        stop.start()
        try:
            for kind in LONG:
                assert process.stdout.readline() == "ready\n", (kind, process.communicate()[1])
                time.sleep(0.2)
                assert process.poll() is None, f"{kind}: over before it could be interrupted"
                process.send_signal(signal.SIGINT)
                sent = time.monotonic()
                assert process.stdout.readline() == "interrupted\n", kind
                # generous: a call of a kernel takes a tenth of a second at most, on a machine that
                # others use, too
                assert time.monotonic() - sent < 20.0, kind
            assert process.communicate(timeout=60) == ("", "")
        finally:
            stop.cancel()
            process.kill()
    assert process.returncode == 0
