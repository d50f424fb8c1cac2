"""Reading that can be given up: it is tried in a process of its own, with limits of time and memory.

In a damaged file the netCDF and HDF5 libraries go round in endless loops, deaf to Ctrl-C, ask for any
amount of memory, or end the process.  A copy of this process (Linux) takes 5 ms to try a file out; elsewhere
a new one takes a third of a second.
"""

import faulthandler
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

from slipsweep.errors import InputError
from slipsweep.grid.resources import available_memory, size_text

#: Seconds of processor time for each step of reading: a slow disk or network takes none of it.
STEP_SECONDS = 5

#: Seconds for each step in all, should it wait for something that never comes.
_WAIT_SECONDS = 300

#: Most memory beyond what the process has, where the half of what is free is not less.
_MEMORY = 4_000_000_000

#: How a trial ends; other statuses are those of a process that broke down.
_DONE, _REFUSED, _NO_MEMORY, _ENDLESS = 0, 3, 4, 5

#: Signals that end a trial whose time is over (none of them on Windows).
_TIME_OVER = [getattr(signal, name) for name in ("SIGXCPU", "SIGALRM") if hasattr(signal, name)]

#: Reads a file from end to end, calling what it is given before each step; raises InputError.
Trial = Callable[[Path, Callable[[], None]], None]


def try_out(read: Trial, path: Path) -> None:
    """Have another process read a file first.

    Parameters
    ----------
    read : callable
        A function of a module.  It takes the path, and what it has to call before each step.
    path : Path

    Raises
    ------
    InputError
        That of `read`; or reading does not come to an end, takes more memory than there is, or ends the process.
    """
    status, message = _forked(read, path) if sys.platform == "linux" else _spawned(read, path)
    if status == _REFUSED:
        raise InputError(message)
    if status == _NO_MEMORY:
        raise InputError(f"{path}: damaged: reading it takes more memory than {size_text(_memory_limit())}")
    if status == _ENDLESS or -status in _TIME_OVER:
        raise InputError(f"{path}: damaged: reading it does not come to an end")
    if status != _DONE:
        reason = signal.Signals(-status).name if -status in {*signal.Signals} else f"status {status}"
        raise InputError(f"{path}: damaged: the netCDF library fails on it ({reason})")


def _memory_limit() -> int:
    return min(_MEMORY, (available_memory() or 2 * _MEMORY) // 2)


# ------------------------------------------------------------------------------ the trial


def _run(read: Trial, path: Path, answer: Callable[[str], object]) -> int:
    """Try to read in this process, which is there for nothing else; return its status."""
    _limit_memory()
    try:
        read(path, _next_step)
    except InputError as error:
        answer(str(error))
        return _REFUSED
    except MemoryError:
        return _NO_MEMORY
    except Exception as error:
        answer(f"{path}: not a netCDF file, or a damaged one ({error})")
        return _REFUSED
    return _DONE


def _next_step() -> None:
    """Give the next step its time; the system ends the process when that is over."""
    try:
        import resource
    except ImportError:  # not on Windows, where the time of all steps is limited
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    soft = int(used.ru_utime + used.ru_stime) + 1 + STEP_SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))
    signal.alarm(_WAIT_SECONDS)


def _limit_memory() -> None:
    if sys.platform != "linux":
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    try:
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except OSError:  # no /proc
        return
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    soft = taken + _memory_limit()
    resource.setrlimit(resource.RLIMIT_AS, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


# ---------------------------------------------------------------------------- the process


def _forked(read: Trial, path: Path) -> tuple[int, str]:
    """Read in a copy of this process."""
    reading, writing = os.pipe()
    child = 0
    # a signal that came while Python forks would be lost
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        with os.fdopen(reading, "rb") as answer:
            try:
                child = _fork(read, path, writing)
            finally:
                os.close(writing)
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
            message = answer.read().decode(errors="replace")
        _, status = os.waitpid(child, 0)
        child = 0
        return os.waitstatus_to_exitcode(status), message
    finally:
        if child:  # interrupted
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def _fork(read: Trial, path: Path, writing: int) -> int:
    """Start a copy of this process, which reads the file and ends; return its number."""
    with warnings.catch_warnings():
        # of other threads, which the copy lacks: it takes nothing of theirs
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child:
        return child
    status = 1
    try:
        faulthandler.disable()
        watched = (*_TIME_OVER, signal.SIGTERM, signal.SIGINT)
        for number in watched:
            if number in _TIME_OVER or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, watched)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (1, 2):  # what the C library says of a broken heap
            os.dup2(nowhere, stream)
        status = _run(read, path, lambda text: os.write(writing, text.encode(errors="replace")[:4000]))
    finally:
        os._exit(status)


_CODE = """
import importlib, json, pathlib, sys
path, module, name, sys.path[:] = json.loads(sys.argv[1])
from slipsweep.files import guard
read = getattr(importlib.import_module(module), name)
sys.exit(guard._run(read, pathlib.Path(path), lambda text: print(text, flush=True)))
"""


def _spawned(read: Trial, path: Path) -> tuple[int, str]:
    """Read in a new process, where copies are not to be had (Windows) or not safe (macOS)."""
    import json

    given = json.dumps([str(path), read.__module__, read.__name__, sys.path])
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CODE, given],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8", errors="replace",
            env={**os.environ, "PYTHONIOENCODING": "utf-8"}, timeout=_WAIT_SECONDS, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return _ENDLESS, ""
    return done.returncode, done.stdout.strip()
