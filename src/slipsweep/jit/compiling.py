"""Kernels: the functions that Python calls, compiled once and kept on disk for the processes that come after.

* Of several processes that start at once the first compiles, under a lock; the others load what it has kept.
* What is kept lies in a folder whose name is a digest of all sources that kernels are made of: a changed equation is
  never served from an old one.
* Machine code is loaded from a folder of this user only, in which nobody else may write.  Where there is none, kernels
  are compiled in memory.

`NUMBA_CACHE_DIR` sets the folder, as it does for numba; `NUMBA_DISABLE_JIT` is honoured.
"""

import contextlib
import functools
import hashlib
import os
import shutil
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import filelock
import numba
import platformdirs

#: Versions of the sources whose kernels are kept.
_KEPT = 4

#: Seconds to wait for another process that compiles.
_PATIENCE = 300.0

#: Called when this process begins to compile, with the kernel's name, and with None when it is done.
Watcher = Callable[[str | None], None]

_first_call = threading.RLock()
_watchers: list[Watcher] = []
_seconds = 0.0


class Kernel:
    """A function compiled by `numba.njit` when first called, or loaded from disk; it runs without the GIL.

    Its arguments have the same types in every call.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._compiled: Callable[..., Any] | None = function if numba.config.DISABLE_JIT else None

    def __call__(self, *args: Any) -> Any:
        """Run on `args`."""
        if self._compiled is None:
            with _first_call:
                if self._compiled is None:
                    # on a thread, which Ctrl-C does not strike: in a callback of LLVM it would be lost
                    with ThreadPoolExecutor(1) as pool:
                        return pool.submit(self._call_first, args).result()
        return self._compiled(*args)

    def _call_first(self, args: tuple[Any, ...]) -> Any:
        with warnings.catch_warnings():
            # numba's advice is for us, not for those who run a sweep
            warnings.simplefilter("ignore", numba.NumbaWarning)
            if (folder := cache_folder()) is not None:
                # no lock to be had, as on some network folders, or a full disk: each process compiles for itself
                lock = filelock.FileLock(folder / "compiling.lock", timeout=_PATIENCE)
                with contextlib.suppress(OSError, NotImplementedError), lock:
                    return self._compile(args, folder)
            return self._compile(args, None)

    def _compile(self, args: tuple[Any, ...], folder: Path | None) -> Any:
        compiled, name = _jitted(self._function, folder), self._function.__name__
        kept = folder is not None and any(folder.glob(f"**/*.{name}-*.nbi"))
        with contextlib.nullcontext() if kept else _noted(name):
            result = compiled(*args)
        self._compiled = compiled
        return result


#: Decorates a function that Python calls; what it calls is decorated as `slipsweep.jit.decorators` says.
kernel = Kernel


def _jitted(function: Callable[..., Any], folder: Path | None) -> Callable[..., Any]:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "arcp"}}
    if folder is None:
        return numba.njit(**options)(function)
    given, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
    try:
        return numba.njit(cache=True, **options)(function)
    finally:
        numba.config.CACHE_DIR = given


@functools.cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels of these sources, or None where there is none that is this user's alone."""
    given = numba.config.CACHE_DIR
    try:
        base = Path(given) / "slipsweep" if given else platformdirs.user_cache_path("slipsweep")
        folder = base / _digest_of_sources()
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = base.stat()
        if hasattr(os, "getuid") and (status.st_uid != os.getuid() or status.st_mode & 0o022):
            return None
        folder.mkdir(exist_ok=True)
        folder.touch()
    except (OSError, RuntimeError):  # RuntimeError: neither HOME nor an account
        return None
    old = sorted((one for one in base.iterdir() if one.is_dir()), key=lambda one: one.stat().st_mtime)
    for other in old[:-_KEPT]:
        shutil.rmtree(other, ignore_errors=True)
    return folder


def _digest_of_sources() -> str:
    package = Path(__file__).parents[1]
    sources = [*(path for room in ("model", "jit", "kernels") for path in (package / room).rglob("*.py"))]
    digest = hashlib.sha256()
    for path in sorted([*sources, package / "motion" / "pieces.py"]):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def seconds() -> float:
    """Seconds that this process has spent compiling."""
    return _seconds


@contextlib.contextmanager
def _noted(name: str) -> Iterator[None]:
    global _seconds
    started = time.perf_counter()
    try:
        for watcher in _watchers:
            watcher(name)
        yield
    finally:
        _seconds += time.perf_counter() - started
        for watcher in _watchers:
            watcher(None)


@contextlib.contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Call `watcher` when a kernel is compiled within the block, in any thread."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)
