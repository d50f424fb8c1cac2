"""Threads: one policy for slipsweep beside dask and numba.

* Kernels are single-threaded and release the GIL.  None uses numba's `parallel=True`, whose
  threading layers can abort.
* A call from the main thread of a process spreads its cells over Python threads.  A call from
  another thread (dask's scheduler, a worker, a pool of the user) computes on that thread: its owner
  already shares the cores.
* The number of threads is the least of the processor affinity, `NUMBA_NUM_THREADS` and
  `OMP_NUM_THREADS`.
* Threads end with the call, so that none is lost in a fork or delays the exit.  Ctrl-C is heard
  between two calls of a kernel, a fraction of a second apart.
"""

import os
import threading
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numba

Part = TypeVar("Part")


def thread_count() -> int:
    """Return the number of threads that a call from this thread may use."""
    if threading.current_thread() is not threading.main_thread():
        return 1
    has_affinity = hasattr(os, "sched_getaffinity")  # not on all systems
    cores = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
    # numba.get_num_threads() would start a threading layer
    limits = [numba.config.NUMBA_NUM_THREADS, cores]
    # the variable may list a number for each level of nesting; the first is that of this level
    requested = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if requested.isdigit() and int(requested) > 0:
        limits.append(int(requested))
    return int(min(limits))


def spread(parts: Collection[Part], work: Callable[[Part], None]) -> None:
    """Call ``work(part)`` for all parts, on as many threads as the policy allows.

    An exception in one of them ends the whole call.
    """
    count = min(thread_count(), len(parts))
    if count <= 1:
        for part in parts:
            work(part)
        return
    pool = ThreadPoolExecutor(count)
    try:
        list(pool.map(work, parts))  # a list, so that exceptions are raised here
    finally:
        # parts that have not begun are dropped, also after Ctrl-C
        pool.shutdown(cancel_futures=True)
