"""Kernels: sealed, and kept on disk."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

from slipsweep.jit.folders import alone
from slipsweep.jit.inner.disk import Disk, digest_of
from slipsweep.jit.inner.sealed import sealed, sealed_apart


def compiled(
    function: Callable[..., Any],
    signature: tuple[Any, ...],
    folder: Path | None,
    compiling: AbstractContextManager[None],
) -> Any:
    """A kernel compiled for a signature, or loaded from a folder; the first process to need it compiles it."""
    jitted = sealed(function)
    with _kept(jitted, function, signature, folder, compiling):
        jitted.compile(signature)
    return jitted


def compiled_apart(
    function: Callable[..., Any], signature: Any, folder: Path | None, compiling: AbstractContextManager[None]
) -> Any:
    """The same for a function that is handed to a kernel."""
    jitted = sealed_apart(function, signature)
    with _kept(jitted, function, signature, folder, compiling):
        jitted.compile()
    return jitted


@contextmanager
def _kept(
    jitted: Any,
    function: Callable[..., Any],
    signature: Any,
    folder: Path | None,
    compiling: AbstractContextManager[None],
) -> Iterator[None]:
    """Have what is compiled in the block looked for in a folder, and kept there."""
    with ExitStack() as stack:
        if folder is None:
            stack.enter_context(compiling)
        else:
            path = folder / f"{function.__name__.strip('_')}-{digest_of(function, signature)}"
            jitted._cache = Disk(path)
            if not path.exists():
                stack.enter_context(compiling)
                stack.enter_context(alone(path))
        yield
