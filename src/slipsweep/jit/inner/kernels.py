"""Kernels: sealed, and kept on disk."""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

from slipsweep.jit.folders import alone
from slipsweep.jit.inner.disk import Disk, digest_of
from slipsweep.jit.inner.sealed import sealed


def compiled(
    function: Callable[..., Any],
    signature: tuple[Any, ...],
    folder: Path | None,
    compiling: AbstractContextManager[None],
) -> Any:
    """A kernel compiled for a signature, or loaded from a folder; the first process to need it compiles it."""
    jitted = sealed(function)
    with ExitStack() as stack:
        if folder is None:
            stack.enter_context(compiling)
        else:
            path = folder / f"{function.__name__.strip('_')}-{digest_of(function, jitted, signature)}"
            jitted._cache = Disk(path)
            if not path.exists():
                stack.enter_context(compiling)
                stack.enter_context(alone(path))
        jitted.compile(signature)
    return jitted
