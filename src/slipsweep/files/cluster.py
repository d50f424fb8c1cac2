"""Chunks of a dask graph computed by the workers of dask.distributed, on this machine or behind a scheduler.

A worker that is lost costs its chunks once more: distributed computes them again on another.
"""

import importlib.util
import logging
import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from slipsweep._version import __version__
from slipsweep.errors import InputError, RunError

if TYPE_CHECKING:
    from distributed import Client

#: Most processes that `--workers` starts on one machine.
MOST_WORKERS = 1024

#: Chunks that are on the workers at a time, for each of their threads: one is solved while another comes back.
AHEAD = 2

#: Seconds between two looks for workers, and for which there may be none.
_LOOK, _PATIENCE = 5.0, 60.0


def check_cluster(workers: int | None, scheduler: str | None) -> None:
    """Refuse options that name no cluster (InputError), or lack the package distributed."""
    if workers is not None and scheduler is not None:
        raise InputError("--workers, --scheduler: give one of them, not both")
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError(f"--workers = {workers}: must be from 1 to {MOST_WORKERS}")
    if (workers or scheduler) and importlib.util.find_spec("distributed") is None:
        raise InputError("--workers, --scheduler: need the package distributed: pip install 'slipsweep[cluster]'")


@contextmanager
def connected(workers: int | None, scheduler: str | None) -> "Iterator[Client]":
    """Start so many processes on this machine, of one thread each, or connect to a scheduler (RunError)."""
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr

    # what it logs about lost workers is no news here: the run goes on, or ends with one message
    with silence_logging_cmgr(logging.CRITICAL):
        if scheduler is None:
            with (
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",
                    preload=[__name__],  # calls `dask_setup`
                    memory_limit=0,  # chunks are sized to fit: no worker is to be paused or killed over them
                    silence_logs=logging.CRITICAL,
                ) as local,
                Client(local) as client,
            ):
                yield client
            return
        try:
            client = Client(scheduler, timeout=10.0)
        except (OSError, ValueError) as error:
            raise RunError(f'--scheduler = "{scheduler}": no scheduler answers there: {error}') from None
        try:
            _check_versions(client, scheduler)
            yield client
        finally:
            with suppress(OSError, TimeoutError):  # the scheduler may be gone
                client.close(timeout=10.0)


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C, which a terminal sends to all processes, to the one that closes the cluster; dask calls this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _check_versions(client: "Client", scheduler: str) -> None:
    """Refuse workers that would compute something else."""

    def version() -> str:  # defined here, it is sent as code: workers need not have this module
        from slipsweep._version import __version__

        return __version__

    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise RunError(
            f"the scheduler at {scheduler} has no workers: start some with: dask worker {scheduler}"
        ) from None
    for worker, found in client.run(version, on_error="return").items():
        if found != __version__:
            raise RunError(f"slipsweep at the worker {worker}: {found}, in this process: {__version__}")


def computed(client: "Client", chunks: Iterable[tuple[Any, Any]]) -> Iterator[tuple[Any, Any]]:
    """Compute dask collections, each given with its name, and yield them as they come back (RunError: none does)."""
    from distributed import CancelledError, KilledWorker, wait

    names: dict[Any, Any] = {}
    left, seen = iter(chunks), time.monotonic()
    while True:
        try:
            threads = sum(client.ncores().values())
            for name, chunk in left if len(names) < AHEAD * max(threads, 1) else ():
                names[client.compute(chunk)] = name
                if len(names) >= AHEAD * max(threads, 1):
                    break
            if not names:
                return
            done = wait(list(names), timeout=_LOOK, return_when="FIRST_COMPLETED").done
            for future in done:
                yield names.pop(future), future.result()
            seen = time.monotonic()
        except TimeoutError:
            if threads:
                seen = time.monotonic()
            if time.monotonic() - seen > _PATIENCE:
                raise RunError(f"there has been no worker for {_PATIENCE:.0f} s") from None
        except KilledWorker as error:
            raise RunError(
                f"a chunk was lost with several workers in turn ({error}): do they run out of memory?"
            ) from None
        except (CancelledError, OSError) as error:
            raise RunError(f"the scheduler was lost: {error}") from None
