"""Work for another process, while this one does its part."""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numba

#: Goes on with the paths of the process that starts it, and does what it is told.
_CHILD = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
do, arguments = pickle.load(sys.stdin.buffer)
do(*arguments)
"""


def cores() -> int:
    """Processors that this process may use: the least of the affinity, `NUMBA_NUM_THREADS` and `OMP_NUM_THREADS`."""
    # the setting, not numba.get_num_threads(): that call starts a threading layer
    limits = [numba.config.NUMBA_NUM_THREADS, _affinity()]
    # a list has a number for each level of nesting; ours is the first
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if asked.isdigit() and int(asked) > 0:
        limits.append(int(asked))
    return int(min(limits))


def _affinity() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def begun(do: Callable[..., Any], *arguments: Any) -> Iterator[Callable[[], Any]]:
    """Call a function in another process; yields what waits for its end, whatever comes of it.

    With one processor, or where there is no Python to start (in a program that embeds it), nothing is begun.
    The process ends with the block.
    """
    with ExitStack() as stack:
        child = None
        if cores() > 1 and Path(sys.executable or "").name.startswith("python"):
            with suppress(OSError):
                child = stack.enter_context(_told(pickle.dumps(sys.path) + pickle.dumps((do, arguments))))
        yield child.wait if child else lambda: None


@contextmanager
def _told(what: bytes) -> Iterator["subprocess.Popen[bytes]"]:
    """Another process, told what to do; says nothing, and ends with the block."""
    with subprocess.Popen(
        [sys.executable, "-c", _CHILD], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as child:
        assert child.stdin
        try:
            with suppress(OSError), child.stdin:  # it may have ended
                child.stdin.write(what)
            yield child
        finally:
            child.kill()
