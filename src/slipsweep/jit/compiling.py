"""Kernels: the functions that Python calls, compiled once and kept on disk for the processes that come after.

* Of several processes that need a kernel at once the first compiles it, under its lock; the others load what it keeps.
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
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import filelock
import numba
import platformdirs

from slipsweep.jit.decorators import part

#: Versions of the sources whose kernels are kept.
_KEPT = 4

#: Seconds to wait for another process that compiles.
_PATIENCE = 300.0

#: Seconds that this process has spent compiling, and what is called with a kernel's name before it
#: is compiled.
seconds = 0.0
announce: Callable[[str], object] = str

_compiling = threading.Lock()


def kernel(function: Callable[..., Any], allocates: bool = True) -> Callable[..., Any]:
    """Decorates a function that Python calls; what it calls is decorated as `slipsweep.jit.decorators` says.

    It is compiled by `numba.njit` when first called, or loaded from disk, and runs without the GIL.
    Its arguments have the same types in every call.
    """
    compiled: Any = function if numba.config.DISABLE_JIT else None

    @functools.wraps(function)
    def call(*args: Any) -> Any:
        nonlocal compiled
        if compiled is None:
            with _compiling:
                if compiled is None:
                    # on a thread, which Ctrl-C does not strike: in a callback of LLVM it would be
                    # lost
                    with ThreadPoolExecutor(1) as pool:
                        compiled = pool.submit(
                            _compiled, function, tuple(map(numba.typeof, args)), allocates
                        ).result()
        return compiled(*args)

    return call


#: The same for a kernel that allocates nothing: it counts no references to its arguments.
kernel_without_memory = functools.partial(kernel, allocates=False)


def _compiled(function: Callable[..., Any], types: tuple[Any, ...], allocates: bool) -> Any:
    """The machine code of a kernel for arguments of these types, from disk or kept there for other processes."""
    folder = cache_folder()
    with warnings.catch_warnings():
        # numba's advice is for us, not for those who run a sweep
        warnings.simplefilter("ignore", numba.NumbaWarning)
        if folder is not None:
            # no lock to be had, as on some network folders, or a full disk: each process compiles
            # for itself
            lock = filelock.FileLock(folder / f"{function.__name__}.lock", timeout=_PATIENCE)
            with contextlib.suppress(OSError, NotImplementedError), lock:
                return _compiled_in(folder, function, types, allocates)
        return _compiled_in(None, function, types, allocates)


def _compiled_in(
    folder: Path | None, function: Callable[..., Any], types: tuple[Any, ...], allocates: bool
) -> Any:
    global seconds
    kept = folder is not None and any(folder.glob(f"**/*.{function.__name__}-*.nbi"))
    if not kept:
        announce(function.__name__)
    started = time.perf_counter()
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        # with its types it is compiled at once, and for no others
        compiled = part(
            "arcp",
            cache=folder is not None,
            signature_or_function=[types],
            no_cfunc_wrapper=True,
            _nrt=allocates,
        )(function)
    finally:
        numba.config.CACHE_DIR = given
    if not kept:
        seconds += time.perf_counter() - started
    return compiled


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
    old = sorted(
        (one for one in base.iterdir() if one.is_dir()), key=lambda one: one.stat().st_mtime
    )
    for other in old[:-_KEPT]:
        shutil.rmtree(other, ignore_errors=True)
    return folder


def _digest_of_sources() -> str:
    package = Path(__file__).parents[1]
    sources = [
        path for room in ("model", "jit", "kernels") for path in (package / room).rglob("*.py")
    ]
    sources += [package / "motion" / name for name in ("pieces.py", "paths.py")]
    contents = (path.read_bytes() for path in sorted(sources))
    return hashlib.sha256(b"".join(contents)).hexdigest()[:16]
