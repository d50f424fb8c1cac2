"""What this process compiles, for whoever shows it or tells it apart from solving."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Called with the number of the kernel being compiled and of all known so far; with None when it is done.
Watcher = Callable[[tuple[int, int] | None], None]

_known: set[object] = set()
_begun: set[object] = set()
_watchers: list[Watcher] = []
_seconds = 0.0
_since: float | None = None


def seconds() -> float:
    """Seconds that this process has spent compiling, or waiting for another that compiles for it."""
    since = _since
    return _seconds + (time.perf_counter() - since if since is not None else 0.0)


def expect(kernel: object) -> None:
    """Say that a kernel will have to be compiled."""
    _known.add(kernel)


@contextmanager
def compiling(kernel: object) -> Iterator[None]:
    """Say that a kernel is being compiled; one at a time."""
    global _seconds, _since
    _known.add(kernel)
    _begun.add(kernel)
    _since = started = time.perf_counter()
    try:
        for watcher in _watchers:
            watcher((len(_begun), len(_known)))
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
