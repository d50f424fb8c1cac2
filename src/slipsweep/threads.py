"""How threads are shared between slipsweep, dask and numba.

One policy, here and nowhere else:

* Kernels are single-threaded and release the GIL; none uses numba's `parallel=True`, so
  no numba threading layer is ever started and none can abort.
* A call from the main thread of a process spreads its cells over Python threads.
* A call from any other thread (dask's threaded scheduler, a dask.distributed worker, a
  user's own pool) computes on that thread: whoever started it already shares the cores.
* The number of threads is the least of the processor affinity, `NUMBA_NUM_THREADS` and
  `OMP_NUM_THREADS`; 1 computes everything on the caller.
"""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba

#: Cells that one call of a kernel takes: long enough to hide the call (some 5 µs), short
#: enough that Ctrl-C is heard and that threads finish together.
MOST_CELLS_PER_CALL = 65536
LEAST_CELLS_PER_CALL = 1024


def thread_count() -> int:
    """Number of threads a call from here may use."""
    if threading.current_thread() is not threading.main_thread():
        return 1
    # the setting, not numba.get_num_threads(): that call starts a threading layer
    limits = [numba.config.NUMBA_NUM_THREADS, _affinity()]
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if asked.isdigit() and int(asked) > 0:
        limits.append(int(asked))
    return min(limits)


def _affinity() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def spread(cells: int, work: Callable[[int, int], None]) -> None:
    """Call ``work(first, last)`` over all of ``range(cells)``, on as many threads as the policy allows."""
    threads = thread_count()
    size = min(max(-(-cells // (4 * threads)), LEAST_CELLS_PER_CALL), MOST_CELLS_PER_CALL)
    parts = [(first, min(first + size, cells)) for first in range(0, cells, size)]
    if min(threads, len(parts)) <= 1:
        for first, last in parts:
            work(first, last)
        return
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work, first, last) for first, last in parts]
        try:
            for future in futures:
                future.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
