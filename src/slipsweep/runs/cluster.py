"""Chunks of a sweep solved by the workers of a dask.distributed cluster.

The client (this process) sends the plan of a chunk, a few kilobytes, and gets its results
back as plain arrays, which it alone writes, so that workers need no shared folder; or workers that share one write
their chunks themselves, and send back what goes on record (`slipsweep.runs.targets.Delivery`).  A task
runs on a thread of its worker, hence on one core (`slipsweep.grid.threads`): a worker with n threads
solves n chunks at a time.  What a dead worker had is solved again by another.
"""

import importlib.util
import itertools
import logging
import pickle
import queue
import signal
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from slipsweep.errors import InputError, RunError
from slipsweep.grid.anyplan import AnyPlan
from slipsweep.grid.chunks import Chunk
from slipsweep.runs.parts import installation
from slipsweep.runs.solving import Deliver, Progress, Solved

if TYPE_CHECKING:
    from distributed import Client, Future

#: Most processes that `--workers` starts on one machine.
MOST_WORKERS = 1024

#: Chunks sent ahead for each thread of the workers: none waits for the client between two chunks,
#: and no more results than these wait on the workers for the client to write.
_AHEAD = 2

#: Seconds between two looks at the scheduler, and for which it may be silent.
_LOOK = 5.0
_SILENCE = 10.0

#: Seconds to wait for a first worker, or for another after the last is gone.
_PATIENCE = 60.0

#: An address without these is one of TCP.
_PROTOCOLS = ("tcp", "tls", "ucx")


@contextmanager
def cluster(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    patience: float = _PATIENCE,
) -> Iterator[Solved]:
    """Yield a function that solves chunks on a cluster: the `solved` of `slipsweep.runs.store.run`.

    The cluster is started, or the scheduler connected to, when the first chunk is asked for;
    both end with the context.

    Parameters
    ----------
    workers : int
        Start so many processes on this machine, of one thread each, on the loopback interface.
    scheduler : str
        Use the scheduler at this address instead, ``HOST:PORT`` or ``tcp://HOST:PORT``, and all of its workers.
    patience : float
        Seconds to wait for workers while there are none.

    Raises
    ------
    InputError
        Both or neither are given, a number or address that is none, or no package distributed.
    RunError
        The scheduler or all workers cannot be reached, or have been lost; a worker has another
        version of slipsweep; a chunk has killed several workers in turn.
    """
    _check(workers, scheduler)
    with ExitStack() as stack:

        def solved(
            plan: AnyPlan,
            chunks: Mapping[int, Chunk],
            progress: Progress | None = None,
            deliver: Deliver | None = None,
        ) -> Iterator[tuple[int, Any]]:
            if chunks:
                client, name = _connect(stack, workers, scheduler)
                yield from _Run(client, name, patience, deliver).solve(plan, chunks, progress)

        yield solved


def _check(workers: int | None, scheduler: str | None) -> None:
    if (workers is None) == (scheduler is None):
        raise InputError("--workers, --scheduler: give one of them, not both")
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError(f"--workers = {workers}: must be from 1 to {MOST_WORKERS}")
    if importlib.util.find_spec("distributed") is None:
        raise InputError("--workers, --scheduler: need the package distributed: pip install 'slipsweep[cluster]'")
    if scheduler is not None:
        _address(scheduler)


def _address(scheduler: str) -> str:
    """A scheduler's address in full."""
    protocol, separator, place = scheduler.rpartition("://")
    host, _, port = place.rpartition(":")
    known = protocol in _PROTOCOLS if separator else True
    if not (known and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise InputError(
            f'--scheduler = "{scheduler}": must be HOST:PORT or {"://, ".join(_PROTOCOLS)}:// and HOST:PORT, '
            'as "dask scheduler" prints it'
        )
    return f"{protocol or 'tcp'}://{place}"


# ---------------------------------------------------------------------------- the cluster


def _connect(stack: ExitStack, workers: int | None, scheduler: str | None) -> "tuple[Client, str]":
    """Return a client and the name of its scheduler; `stack` closes them."""
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr

    # what it logs about lost workers is no news here: the run goes on, or ends with one message
    stack.enter_context(silence_logging_cmgr(logging.CRITICAL))
    if scheduler is None:
        local = stack.enter_context(
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # no dashboard; what status pages are left must not ask for port 8787, which another may have
                dashboard_address=None,
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                memory_limit=0,  # chunks are sized to fit: no worker is to be paused or killed over them
                preload=[__name__],  # calls `dask_setup`
                silence_logs=logging.CRITICAL,
            )
        )
        # workers of this machine can be reached without the detour over the scheduler
        return stack.enter_context(Client(local, set_as_default=False, direct_to_workers=True)), "the local cluster"
    address = _address(scheduler)
    try:
        client = Client(address, timeout=_SILENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RunError(f"no scheduler answers at {address}: {error}") from None
    stack.callback(_close, client)
    return client, address


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C, which a terminal sends to all processes, to the one that closes the cluster; dask calls this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _close(client: "Client") -> None:
    with suppress(OSError, TimeoutError):  # the scheduler may be gone
        client.close(timeout=_SILENCE)


def _solve(client: dict[str, str], task: bytes) -> Any:
    """Solve one chunk, on a worker, and deliver it from there if asked to: only the same installation can read it."""
    if client != installation():  # a worker that came after `_check_installations`
        from distributed import get_worker

        raise RunError(_mismatch(get_worker().address, installation(), client))
    one: _Task = pickle.loads(task)
    results = one.plan.solve()
    return results if one.deliver is None else one.deliver(one.plan, one.number, one.chunk, results)


def _mismatch(worker: str, found: dict[str, str] | None, client: dict[str, str]) -> str:
    name = next((name for name in client if found is not None and found.get(name) != client[name]), "")
    has = "no slipsweep" if found is None else f"{name} {found.get(name, 'unknown')}, this process has {client[name]}"
    return f"the worker at {worker} has {has}: install the same versions everywhere"


@dataclass(frozen=True)
class _Task:
    """A chunk to solve: its plan and its place, and what becomes of it there (None: it is sent back)."""

    plan: AnyPlan
    number: int
    chunk: Chunk
    deliver: Deliver | None


class _Run:
    """One sweep on one cluster."""

    def __init__(self, client: "Client", name: str, patience: float, deliver: Deliver | None) -> None:
        self.client = client
        self.deliver = deliver
        self.name = name
        self.patience = patience
        self.threads = 0
        self.looked = self.had_workers = time.monotonic()
        self.finished: queue.SimpleQueue[Future] = queue.SimpleQueue()

    def solve(self, plan: AnyPlan, chunks: Mapping[int, Chunk], progress: Progress | None) -> Iterator[tuple[int, Any]]:
        """Yield chunks as they come back; a bounded number of them is under way."""
        self._wait_for_workers()
        self._check_installations()
        remaining = iter(chunks.items())
        pending: dict[Any, tuple[int, int]] = {}  # by key of the task: the chunk's number and its cells
        while True:
            for number, chunk in itertools.islice(remaining, max(0, _AHEAD * self.threads - len(pending))):
                part = plan.part(chunk)
                future = self._submit(pickle.dumps(_Task(part, number, chunk, self.deliver)))
                pending[future.key] = number, part.cells
                future.add_done_callback(self.finished.put)
                del future  # the workers may forget a chunk once it is here
            if not pending:
                return
            done = self._next()
            if done is None:
                continue
            number, cells = pending.pop(done.key)
            results = self._result(done, number)
            del done
            if progress is not None:
                progress(cells)
            yield number, results
            del results

    def _submit(self, task: bytes) -> "Future":
        with warnings.catch_warnings():
            # scattering large [[cases]] instead would lose them with the worker that has them
            warnings.filterwarnings("ignore", "Sending large graph")
            try:
                return self.client.submit(_solve, installation(), task, pure=False)
            except Exception as error:
                raise self._lost() from error

    def _next(self) -> "Future | None":
        """The next chunk that is finished, one way or the other; None after `_LOOK` seconds."""
        if time.monotonic() - self.looked > _LOOK:
            self._look()
        try:
            return self.finished.get(timeout=_LOOK)
        except queue.Empty:
            return None

    def _result(self, future: "Future", number: int) -> Any:
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError
        from distributed.comm import CommClosedError

        try:
            results = future.result()
        except (InputError, RunError, MemoryError):
            raise
        except (FutureCancelledError, CommClosedError):
            # the second, where the client itself has not yet seen it; from workers results come by the scheduler
            raise self._lost() from None
        except KilledWorker as error:
            raise RunError(
                f"chunk {number + 1} was lost with {error.allowed_failures + 1} workers in turn, the last at "
                f"{error.last_worker.address}: do they run out of memory?"
            ) from None
        except Exception as error:  # whatever an unlike installation may raise
            if self.client.status != "running":
                raise self._lost() from None
            raise RunError(f"a worker failed at chunk {number + 1}: {type(error).__name__}: {error}") from error
        return results

    def _lost(self) -> RunError:
        return RunError(f"the scheduler at {self.name} was lost")

    def _look(self) -> None:
        """See whether the scheduler answers, and how many threads its workers have."""
        scheduler = self.client.scheduler
        if scheduler is None:  # closed
            raise self._lost()
        try:
            threads = self.client.sync(scheduler.ncores, callback_timeout=_SILENCE)
        except Exception:  # the connection is closed, or to be, or silent
            raise self._lost() from None
        self.looked = time.monotonic()
        self.threads = sum(threads.values())
        if self.threads:
            self.had_workers = self.looked
        elif self.looked - self.had_workers > self.patience:
            raise RunError(
                f"the scheduler at {self.name} has had no worker for {self.patience:.0f} s: "
                f"start some with: dask worker {self.name}"
            )

    def _wait_for_workers(self) -> None:
        self._look()
        while not self.threads:
            time.sleep(0.2)
            self._look()

    def _check_installations(self) -> None:
        """Refuse workers that would compute something else."""

        def installed() -> dict[str, str] | None:  # defined here, it is sent as code: workers need not have this module
            try:
                from slipsweep._version import __version__
            except ImportError:
                return None
            try:
                from slipsweep.runs.parts import installation
            except ImportError:  # of a version before there were clusters
                return {"slipsweep version": __version__}
            return installation()

        try:
            found = self.client.run(installed)
        except (OSError, TimeoutError):
            raise self._lost() from None
        for worker, other in found.items():
            if other != installation():
                raise RunError(_mismatch(worker, other, installation()))
