"""Kernels: sealed, and kept on disk."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from slipsweep.jit.folders import alone
from slipsweep.jit.inner.disk import Disk, digest_of
from slipsweep.jit.inner.sealed import sealed


def compiled(function: Callable[..., Any], signature: tuple[Any, ...], folder: Path | None) -> Any:
    """A kernel compiled for a signature, or loaded from a folder; the first process to need it compiles it."""
    jitted = sealed(function)
    if folder is None:
        jitted.compile(signature)
        return jitted
    path = folder / f"{function.__name__.strip('_')}-{digest_of(function, jitted, signature)}"
    jitted._cache = Disk(path)
    with nullcontext() if path.exists() else alone(path):
        jitted.compile(signature)
    return jitted
