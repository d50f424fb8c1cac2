"""How jitted kernels reach the processor: compiled once, kept on disk, shared by processes.

numba's own on-disk cache will not do here.  Several processes that compile and save at the
same moment can crash each other (numba issues 4807 and 10128); a damaged file ends the
program; a file's time, which every installation changes, is taken for a change of its
content; and it looks only at the file of the outermost function, so that a changed equation
would not be noticed.  `_Disk` takes its place:

* A file holds one kernel for one signature, after a checksum; it is written under another
  name and renamed.  One that is missing or damaged is compiled anew.
* Its name is a digest of all that the machine code depends on; the folder's name one of all
  sources that kernels are made of (`slipsweep.jit.sources`).  Folders of the four latest versions
  are kept, older ones removed when a kernel is compiled.
* The first process to need a kernel compiles it under a lock, the others wait and load.
  Where there is no lock to be had (some network folders) each compiles for itself.
* Where no folder can be written, kernels are compiled in memory.
* A kernel calls its own copies of the functions it is made of (`_Sealed`), so that the process
  that compiled it computes the same bits as those that load it.  They have no machine code
  besides (`kernels.jit`).

`NUMBA_CACHE_DIR` moves the folder, as it does for numba; `NUMBA_DISABLE_JIT` is honoured.
"""

import contextlib
import functools
import gc
import hashlib
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import filelock  # here: imported in the middle of a fork, its own fork handlers would fail
import llvmlite.binding
import numba.core.compiler
from numba import njit
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from slipsweep.jit import folders, sources

#: Versions whose kernels are kept.
_KEPT_FOLDERS = 4

#: Seconds to wait for another process that compiles: four times what a slow machine takes.
_PATIENCE = 120.0

#: Held over the first use of any kernel in this process.
_first_use = threading.RLock()
if hasattr(os, "register_at_fork"):
    # no fork in the middle of a first use: the child would inherit locks that no thread of it can release.
    # LLVM's own lock, taken also when another thread's compilation is cleared away, is out of reach here:
    # a process that forks beside threads that compile can still hang, as with numba itself
    os.register_at_fork(
        before=_first_use.acquire, after_in_parent=_first_use.release, after_in_child=_first_use.release
    )


def cache_folder() -> Path | None:
    """Folder of the compiled kernels, or None where no folder can be written."""
    base = folders.base()
    if base is None:
        return None
    folder = base / f"slipsweep-{sources.keys().machine_code}"
    with contextlib.suppress(OSError):
        folder.mkdir(exist_ok=True)
        return folder
    return None


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a file's lock against other processes, where locks can be had."""
    lock = filelock.FileLock(f"{path}.lock")
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, NotImplementedError, filelock.Timeout):
            lock.acquire(timeout=_PATIENCE)
            stack.callback(lock.release)
        yield


@contextlib.contextmanager
def _heard_later() -> Iterator[None]:
    """Have Ctrl-C and SIGTERM wait for the end of the block, where this is the thread that hears them.

    LLVM calls back into Python to hand over machine code, and what a signal raised there would be
    printed and forgotten.  It takes a tenth of a second for a kernel from disk, two for one that is new.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    known = {number: handler for number, handler in handlers.items() if handler is not None}
    for number in known:
        signal.signal(number, lambda received, _: heard.append(received))
    try:
        yield
    finally:
        for number, handler in known.items():
            signal.signal(number, handler)
        for received in heard:
            signal.raise_signal(received)


class _Disk(NullCache):
    """Where a dispatcher looks for machine code before it compiles: one file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kernel as numba wants it, or None."""
        # all that machine code needs of numba is its memory functions; `refresh`, which compiling calls, would
        # bring whatever may be compiled, scipy's BLAS among it: 0.2 of the 0.85 s that a small run takes
        rtsys.initialize(target_context)
        try:
            content = self.path.read_bytes()
            checksum, data = content[:32], content[32:]
            if hashlib.sha256(data).digest() != checksum:
                return None
            with _heard_later():
                return CompileResult._rebuild(target_context, *pickle.loads(data))
        except Exception:  # not there, or of another make: whatever is wrong with it, it can be made anew
            return None

    def save_overload(self, sig: Any, cres: Any) -> None:
        """Keep a kernel that has been compiled."""
        # a full disk, or something in the kernel that holds in this process only: it runs all the same
        with contextlib.suppress(Exception):
            if cres.library.has_dynamic_globals:
                return
            data = dumps(cres._reduce())
            folders.write(self.path, hashlib.sha256(data).digest() + data)
            folders.keep_latest(_KEPT_FOLDERS, f"slipsweep-{'[0-9a-f]' * 16}", self.path.parent)


class _Sealed(JITCodeLibrary):
    """Machine code of a kernel in which no function can be replaced by one of the same name.

    numba gives a kernel a copy of every function it calls, optimised for it (loops in SIMD, say), as a
    weak symbol.  Where the process already has such a function, from compiling it by itself or from
    another kernel, the linker would take that one instead.  It may differ in its roundings: last digits
    would depend on whether a kernel was just compiled or loaded, and on what was loaded before.
    """

    def _finalize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvmlite.binding.Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()

    def _finalize_specific(self) -> None:
        with _heard_later():
            super()._finalize_specific()


class _Compiler(numba.core.compiler.Compiler):
    """numba's compiler, writing into a sealed library."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *arguments: Any) -> None:
        library = _Sealed(targetctx.codegen(), "kernel")
        library.enable_object_caching()
        super().__init__(typingctx, targetctx, library, *arguments)


@contextlib.contextmanager
def _no_collections() -> Iterator[None]:
    """Leave reference cycles alone: a compiler's many objects, nearly all alive, cost 1.3 s of looking for some."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class Kernel:
    """A jitted function that is compiled, or loaded from disk, when first called.

    Parameters
    ----------
    function : callable
        Python function to compile; runs without the GIL.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._dispatcher: Callable[..., Any] | None = None

    def __call__(self, *args: Any) -> Any:
        """Run on `args`; their types must be those of the first call."""
        if self._dispatcher is None:
            with _first_use:
                if self._dispatcher is None:
                    self._dispatcher = self._ready(args)
        return self._dispatcher(*args)

    def _ready(self, args: tuple[Any, ...]) -> Callable[..., Any]:
        jitted: Any = njit(nogil=True, error_model="numpy", pipeline_class=_Compiler)(self._function)
        if numba.config.DISABLE_JIT:
            return jitted
        signature = tuple(numba.typeof(arg) for arg in args)
        folder = cache_folder()
        with warnings.catch_warnings(), _no_collections():
            # numba's advice is for us, not for those who run a sweep
            warnings.simplefilter("ignore", numba.NumbaWarning)
            if folder is None:
                jitted.compile(signature)
            else:
                path = folder / f"{self._function.__name__.strip('_')}-{self._digest(jitted, signature)}"
                jitted._cache = _Disk(path)
                with contextlib.nullcontext() if path.exists() else _alone(path):
                    jitted.compile(signature)
        # a call with other types is a bug here, and would compile unseen
        jitted.disable_compile()
        return jitted

    def _digest(self, jitted: Any, signature: tuple[Any, ...]) -> str:
        """Digest of all that the machine code depends on, but for the sources (the folder's name)."""
        cells = self._function.__closure__ or ()
        parts = (
            self._function.__module__,
            self._function.__qualname__,
            dumps(tuple(cell.cell_contents for cell in cells)),  # the kernels of a factory differ in nothing else
            str(signature),
            jitted.targetctx.codegen().magic_tuple(),  # processor
            (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__),
            (int(numba.config.OPT), bool(numba.config.BOUNDSCHECK), bool(numba.config.DEBUGINFO_DEFAULT)),
        )
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]
