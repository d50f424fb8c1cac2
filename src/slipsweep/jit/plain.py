"""Kernels and their parts by what numba documents alone.

Slower to compile and, with waves, to run, and last digits may differ between the process that compiled a kernel and
those that load it; but it takes nothing of numba that a new version may lack (`slipsweep.jit.form`).
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numba
from numba import cfunc, njit

from slipsweep.jit import folders


def part(function: Callable[..., Any], **options: Any) -> Any:
    """A function that kernels are made of, with options of `numba.njit`."""
    return njit(error_model="numpy", **options)(function)


def compiled(
    function: Callable[..., Any],
    signature: tuple[Any, ...],
    folder: Path | None,
    compiling: AbstractContextManager[None],
) -> Any:
    """A kernel compiled for a signature, or loaded from numba's own cache in a folder."""

    def make(**kept: bool) -> Any:
        jitted = njit(nogil=True, error_model="numpy", **kept)(function)
        jitted.compile(signature)
        return jitted

    return _made(make, function, folder, compiling)


def compiled_apart(
    function: Callable[..., Any], signature: Any, folder: Path | None, compiling: AbstractContextManager[None]
) -> Any:
    """The same for a function that is handed to a kernel."""

    def make(**kept: bool) -> Any:
        return cfunc(signature, error_model="numpy", **kept)(function)

    return _made(make, function, folder, compiling)


def _made(
    make: Callable[..., Any], function: Callable[..., Any], folder: Path | None, compiling: AbstractContextManager[None]
) -> Any:
    with compiling if folder is None or not folders.has(folder, function) else nullcontext():
        if folder is not None:
            # no source file, a damaged cache, a full disk: whatever is wrong with the cache, a kernel can do without.
            # Only one process at a time, for numba's own cache stands no more
            with suppress(Exception), folders.alone(folder / function.__name__), _cache_in(folder):
                return make(cache=True)
        return make()


@contextmanager
def _cache_in(folder: Path) -> Iterator[None]:
    """Have numba keep what it compiles in a folder: that of our sources, of which it looks at one only."""
    given, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder / "plain")
    try:
        yield
    finally:
        numba.config.CACHE_DIR = given
