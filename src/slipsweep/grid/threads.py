"""How threads are shared between slipsweep, dask and numba.

One policy, here and nowhere else:

* Kernels are single-threaded and release the GIL; none uses numba's `parallel=True`, so
  no numba threading layer is ever started and none can abort.
* A call from the main thread of a process spreads its cells over Python threads, itself among them.
* A call from any other thread (dask's threaded scheduler, a dask.distributed worker, a
  user's own pool) computes on that thread: whoever started it already shares the cores.
* The number of threads is the least of the processor affinity, `NUMBA_NUM_THREADS` and
  `OMP_NUM_THREADS`; 1 computes everything on the caller.
* Threads live as long as the call: none is left to be lost in a fork or to hold up the
  exit.  Ctrl-C is heard between two calls of a kernel, a fraction of a second apart.
"""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba

#: Cells of the cycle solver that one call of a kernel takes: long enough to hide the call
#: (some 20 µs), short enough that Ctrl-C is heard.
MOST_CELLS_PER_CALL = 65536
LEAST_CELLS_PER_CALL = 2048


def cores() -> int:
    """Processors that this process may use: the least of the affinity, `NUMBA_NUM_THREADS` and `OMP_NUM_THREADS`."""
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    # the setting, not numba.get_num_threads(): that call starts a threading layer
    limits = [numba.config.NUMBA_NUM_THREADS, affinity]
    # a list has a number for each level of nesting; ours is the first
    requested = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if requested.isdigit() and int(requested) > 0:
        limits.append(int(requested))
    return int(min(limits))


def thread_count() -> int:
    """Number of threads a call from here may use."""
    if threading.current_thread() is not threading.main_thread():
        return 1
    return cores()


def spread(cells: int, work: Callable[[int, int], None], work_per_cell: int = 1) -> None:
    """Call ``work(first, last)`` over all of ``range(cells)``, on as many threads as the policy allows.

    Parameters
    ----------
    cells : int
        Number of cells.
    work : callable
        Does a part, or none of it, ``work(0, 0)``; the first exception of any part ends the whole.
    work_per_cell : int
        What a cell takes, in cells of the cycle solver.
    """
    threads = thread_count()
    least, most = max(LEAST_CELLS_PER_CALL // work_per_cell, 1), max(MOST_CELLS_PER_CALL // work_per_cell, 1)
    taken = 0
    taking, over = threading.Lock(), threading.Event()

    def take_parts() -> None:
        nonlocal taken
        try:
            while not over.is_set():
                with taking:
                    # ever smaller ones, so that the threads finish together
                    first = taken
                    last = taken = min(first + min(max((cells - first) // (2 * threads), least), most), cells)
                if first == last:
                    return
                work(first, last)
        except BaseException:
            over.set()
            raise

    others = min(threads - 1, (cells - 1) // least)
    if others:
        work(0, 0)  # what a first call compiles, seconds long, is compiled on the thread that hears Ctrl-C
    with ThreadPoolExecutor(max(others, 1)) as pool:  # starts as many threads as are submitted to
        try:
            futures = [pool.submit(take_parts) for _ in range(others)]
            take_parts()
        finally:  # whatever ended it, Ctrl-C too: the other threads find no more to do
            over.set()
    for future in futures:
        future.result()
