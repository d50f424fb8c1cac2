"""Kernels: the functions that Python calls, compiled once and kept on disk for later processes.

* Of several processes that need a kernel at once the first compiles it, under its lock; the others
  load what it keeps.
* A kernel is kept in a folder whose name is a digest of all sources that kernels are made of: a
  changed equation is never served from an old one.
* The digests of a kernel's files are written when they are complete, and compared before numba
  loads them.  Files that a power cut left empty or short, which may crash LLVM, are removed, and
  the kernel is compiled anew.
* Machine code is loaded from a folder of this user only, in which nobody else may write.  Where
  there is none, kernels are compiled in memory, with a warning.
* Where the folder has no locks, several processes may compile the same kernel.  numba gives each
  file its name when it is whole, so that the others load all of it.

`NUMBA_CACHE_DIR` sets the folder, as it does for numba; `NUMBA_DISABLE_JIT` is honoured.
"""

import contextlib
import functools
import gc
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

import numba
import platformdirs

from slipsweep.errors import RunWarning
from slipsweep.jit.decorators import part
from slipsweep.locks import lock_held

#: Versions of the sources whose kernels are kept.
_KEPT = 4

#: Seconds to wait for another process that compiles.
_PATIENCE = 300.0

#: Seconds that this process has spent compiling, and what is called with a kernel's name before it
#: is compiled.
seconds = 0.0
announce: Callable[[str], object] = str

_compiling = threading.Lock()


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a function that Python calls.

    Functions that it calls are decorated as `slipsweep.jit.decorators` says.

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
                            _compiled, function, tuple(map(numba.typeof, args))
                        ).result()
        return compiled(*args)

    return call


def _compiled(function: Callable[..., Any], types: tuple[Any, ...]) -> Any:
    """Return the machine code of a kernel for arguments of these types, loaded or compiled."""
    with warnings.catch_warnings():
        # numba's advice is for us, not for those who run a sweep
        warnings.simplefilter("ignore", numba.NumbaWarning)
        try:
            folder = cache_folder()
            with contextlib.ExitStack() as stack:
                # of no use to wait longer for a process that hangs
                with contextlib.suppress(TimeoutError):
                    lock = folder / f"{function.__name__}.lock"
                    stack.enter_context(lock_held(lock, _PATIENCE))
                return _compiled_in(folder, function, types)
        except OSError as error:
            place = f"{error.filename}: " if error.filename else ""
            _warn(f"{place}{error.strerror or error}")
        return _compiled_in(None, function, types)


@functools.cache
def _warn(reason: str) -> None:
    """Say once why kernels cannot be kept."""
    text = f"compiled kernels cannot be kept, and each process compiles them anew: {reason}"
    warnings.warn(RunWarning(f"{text}; NUMBA_CACHE_DIR sets another folder"), stacklevel=2)


def _compiled_in(folder: Path | None, function: Callable[..., Any], types: tuple[Any, ...]) -> Any:
    """Compile a kernel, or load what the folder keeps of it, and note the digests of new files."""
    global seconds
    name = function.__name__
    digests = b"" if folder is None else _digests(folder, name)
    kept = folder is not None and bool(digests) and digests == _noted(folder, name)
    if not kept:
        for path in () if folder is None else _files(folder, name):
            path.unlink(missing_ok=True)
        announce(name)
    started = time.perf_counter()
    cache_dir = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    # compiling makes so many objects that looking for dead ones takes a sixth of its time
    collects = gc.isenabled()
    gc.disable()
    try:
        # with its types it is compiled at once, and for no others
        compiled = part(
            "arcp",
            cache=folder is not None,
            signature_or_function=[types],
            no_cfunc_wrapper=True,
        )(function)
    finally:
        if collects:
            gc.enable()
        numba.config.CACHE_DIR = cache_dir
    if not kept:
        seconds += time.perf_counter() - started
    # numba may have compiled it again although it was kept, for another processor
    if folder is not None and not (kept and digests == _digests(folder, name)):
        temporary = folder / f"{name}.{os.getpid()}.tmp"
        temporary.write_bytes(_digests(folder, name))
        temporary.replace(_note(folder, name))
    return compiled


def _files(folder: Path, name: str) -> list[Path]:
    """Files that numba keeps of a kernel: an index, and the machine code for each processor."""
    return sorted(folder.glob(f"**/*.{name}-*.nb[ci]"))


def _digests(folder: Path, name: str) -> bytes:
    """Digests of the files of a kernel, as `sha256sum` writes them."""
    lines = (
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder)}\n"
        for path in _files(folder, name)
    )
    return "".join(lines).encode()


def _note(folder: Path, name: str) -> Path:
    """File that holds the digests of a kernel's files."""
    return folder / f"{name}.sha256"


def _noted(folder: Path, name: str) -> bytes:
    """Digests that were written when the files of a kernel were complete."""
    with contextlib.suppress(FileNotFoundError):
        return _note(folder, name).read_bytes()
    return b""


@functools.cache
def cache_folder() -> Path:
    """Return the folder of the compiled kernels of these sources; OSError if none is private."""
    cache_dir = numba.config.CACHE_DIR
    try:
        caches = Path(cache_dir) if cache_dir else platformdirs.user_cache_path()
    except RuntimeError:
        raise OSError("there is neither HOME nor an account") from None
    base = caches / "slipsweep"
    folder = base / _digest_of_sources()
    base.mkdir(mode=0o700, parents=True, exist_ok=True)
    status = base.stat()
    if hasattr(os, "getuid") and (status.st_uid != os.getuid() or status.st_mode & 0o022):
        raise OSError(f"{base}: other users may write to it")
    folder.mkdir(exist_ok=True)
    folder.touch()
    versions = sorted(
        (path for path in base.iterdir() if path.is_dir()), key=lambda path: path.stat().st_mtime
    )
    for other in versions[:-_KEPT]:
        shutil.rmtree(other, ignore_errors=True)
    return folder


def _digest_of_sources() -> str:
    package = Path(__file__).parents[1]
    sources = [
        path for room in ("model", "jit", "kernels") for path in (package / room).rglob("*.py")
    ]
    sources += [package / "motion" / name for name in ("pieces.py", "paths.py", "samples.py")]
    contents = (path.read_bytes() for path in sorted(sources))
    return hashlib.sha256(b"".join(contents)).hexdigest()[:16]
