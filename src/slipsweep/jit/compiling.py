"""What this process compiles, for whoever shows it or tells it apart from solving."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Called when a kernel begins to be compiled with which it is of how many ("1 of 2", "1 of at most 2"); with None
#: when it is done.
Watcher = Callable[[str | None], None]

_known: set[object] = set()
_possible: set[object] = set()
_begun: set[object] = set()
_watchers: list[Watcher] = []
_seconds = 0.0
_since: float | None = None


def seconds() -> float:
    """Seconds that this process has spent compiling, or waiting for another that compiles for it."""
    since = _since
    return _seconds + (time.perf_counter() - since if since is not None else 0.0)


def expect(kernel: object, perhaps: bool = False) -> None:
    """Say that a kernel will have to be compiled, or `perhaps`."""
    (_possible if perhaps else _known).add(kernel)


def _count() -> str:
    """Which kernel is being compiled, of how many."""
    most = len(_known | _possible)
    return f"{len(_begun)} of {'at most ' if most > len(_known) else ''}{most}"


@contextmanager
def compiling(kernel: object) -> Iterator[None]:
    """Say that a kernel is being compiled; one at a time."""
    global _seconds, _since
    _known.add(kernel)
    _begun.add(kernel)
    _since = started = time.perf_counter()
    try:
        for watcher in _watchers:
            watcher(_count())
        yield
    finally:
        _since = None
        _seconds += time.perf_counter() - started
        for watcher in _watchers:
            watcher(None)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Tell `watcher` of what is compiled in the block, from any thread."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)
