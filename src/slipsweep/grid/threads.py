"""How threads are shared between slipsweep, dask and numba.

One policy, here and nowhere else:

* Kernels are single-threaded and release the GIL; none uses numba's `parallel=True`, whose threading layers can abort.
* A call from the main thread of a process spreads its cells over Python threads.  A call from any other (dask's
  scheduler, a worker, a user's own pool) computes on that thread: whoever started it already shares
  the cores.
* The number of threads is the least of the processor affinity, `NUMBA_NUM_THREADS` and `OMP_NUM_THREADS`.
* Threads live as long as the call: none is left to be lost in a fork or to hold up the exit.  Ctrl-C is heard between
  two calls of a kernel, a fraction of a second apart.
"""

import os
import threading
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numba

Part = TypeVar("Part")


def thread_count() -> int:
    """Number of threads a call from here may use."""
    if threading.current_thread() is not threading.main_thread():
        return 1
    affinity = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    # the setting, not numba.get_num_threads(): that call starts a threading layer
    limits = [numba.config.NUMBA_NUM_THREADS, affinity]
    # a list has a number for each level of nesting; ours is the first
    requested = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if requested.isdigit() and int(requested) > 0:
        limits.append(int(requested))
    return int(min(limits))


def spread(parts: Collection[Part], work: Callable[[Part], None]) -> None:
    """Call ``work(part)`` for all parts, on as many threads as the policy allows; an exception ends the whole."""
    count = min(thread_count(), len(parts))
    if count <= 1:
        for part in parts:
            work(part)
        return
    pool = ThreadPoolExecutor(count)
    try:
        list(pool.map(work, parts))  # the list: errors leave the pool with the results
    finally:
        # parts that have not begun are left out, also at Ctrl-C while they are handed in
        pool.shutdown(cancel_futures=True)
