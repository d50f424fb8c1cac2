"""Settings and fixtures of all tests."""

import gc
import os
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

# before NumPy is loaded: its linear algebra waits for its threads in busy loops, which costs ten
# times the work where each core has a process of the suite already
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# a collection of garbage goes through all that numba and Matplotlib have made: a twentieth of the
# suite's time
gc.set_threshold(100_000, 20, 20)

# faults are made with what Linux has: forked processes, /proc, limits of file sizes
collect_ignore = [] if sys.platform == "linux" else ["files/test_faults.py"]

# each process that a test starts would compile all sources of the program anew, which is a fifth of
# its time
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# a suite started in the background ignores Ctrl-C, and so would every process it starts to
# interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


#: Files whose tests take long, each for itself.
LONG = {"test_readme.py", "test_calibration.py", "test_extremes.py", "test_benchmarks.py"}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with long files, then go on with those of most tests: so all processes end together."""
    counts = Counter(item.path for item in items)
    items.sort(key=lambda item: (item.path.name not in LONG, -counts[item.path]))


@pytest.fixture(autouse=True, scope="session")
def _no_power_cut() -> Iterator[None]:
    """Do not wait for the disk, which takes minutes on a slow one; processes of tests do wait."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        yield
    # pytest ends by collecting garbage five times, for warnings of what is deleted: seconds
    gc.freeze()


#: What each process of the suite does first, to compile kernels that most tests need.
FIRST: dict[str, tuple[dict[str, Any], ...]] = {
    "gw0": ({}, {"model": "newmark", "excitation": "square"}),
    "gw1": ({"excitation": "square"}, {"solver": "step"}),
}


@pytest.fixture(autouse=True, scope="session")
def _no_waiting_for_kernels(worker_id: str) -> None:
    """Compile different kernels in different processes, which would wait for one another."""
    import slipsweep  # here: the settings above come first

    for options in FIRST.get(worker_id, ()):
        slipsweep.sweep(theta=5.0, mu_s=0.4, amplitude=5.0, frequency=1.0, **options)


@pytest.fixture
def without_layout() -> Iterator[None]:
    """Draw charts once, not first to find room for their labels, which takes half of the time.

    tests/charts has those with room.
    """
    from matplotlib.figure import Figure  # here: the settings above come first

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "get_layout_engine", lambda figure: None)
        yield
