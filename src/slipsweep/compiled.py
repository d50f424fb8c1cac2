"""How jitted kernels reach the processor: compiled once, kept on disk, one process at a time.

numba's own on-disk cache fails in two ways that matter here.  Several processes that
compile and save at the same moment can crash each other (numba issues 4807 and 10128);
and it looks only at the file of the outermost function, so that a changed equation would
not be noticed.  Here the first use of a kernel in a process, load or compile, happens
under a lock between processes, and the folder is named for the content of every source
file that a kernel is made of.

`NUMBA_CACHE_DIR` moves the folder, as it does for numba; `NUMBA_DISABLE_JIT` is honoured.
"""

import contextlib
import functools
import hashlib
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import filelock
import numba
import platformdirs
from numba import njit

_SOURCES = ("elementary.py", "equations.py", "variables.py", "kernels/*.py")


@functools.cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels, or None where no folder can be written."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for pattern in _SOURCES:
        for source in sorted(here.glob(pattern)):
            digest.update(source.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    given = numba.config.CACHE_DIR
    bases = [Path(given)] if given else [platformdirs.user_cache_path("slipsweep"), Path(tempfile.gettempdir())]
    for base in bases:
        folder = base / name
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
    return None


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder against every other process."""
    with filelock.FileLock(folder / "lock"):
        yield


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
        self._lock = threading.Lock()

    def __call__(self, *args: Any) -> Any:
        """Run on `args`; their types must be those of the first call."""
        if self._dispatcher is None:
            with self._lock:
                if self._dispatcher is None:
                    self._dispatcher = self._compile(tuple(numba.typeof(arg) for arg in args))
        return self._dispatcher(*args)

    def _compile(self, signature: tuple[Any, ...]) -> Callable[..., Any]:
        folder = None if numba.config.DISABLE_JIT else cache_folder()
        jit = functools.partial(njit, nogil=True, error_model="numpy")
        if folder is None:
            return jit(self._function)
        with _alone(folder):
            given = numba.config.CACHE_DIR
            numba.config.CACHE_DIR = str(folder)
            try:
                dispatcher = jit(self._function, cache=True)
            finally:
                numba.config.CACHE_DIR = given
            dispatcher.compile(signature)
        # a call with other types is a bug here, and would compile outside the lock
        dispatcher.disable_compile()
        return dispatcher
