"""Ctrl-C and SIGTERM while machine code is made or loaded."""

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def heard_later() -> Iterator[None]:
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
