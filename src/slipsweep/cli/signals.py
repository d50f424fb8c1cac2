"""Ctrl-C and SIGTERM: one exception, raised where it is safe to raise it."""

import _thread
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

#: Modules and packages, a dot behind each, in which nothing is raised.  Locks of threads are taken by calls, and
#: between a call and its `try` a signal may come: they would stay held for ever (seen: one of some 60 interrupted runs
#: hung).  Objects of llvmlite that are not made to the end print so when they go (one of 58).
_SHIELDED = ("threading.", "queue.", "logging.", "concurrent.futures.", "llvmlite.")

#: Seconds after which a signal that could not be raised comes once more, and how often at most: ten seconds in all.
_AGAIN, _MOST = 0.02, 500


class Interrupted(BaseException):
    """Ctrl-C or SIGTERM; no `except Exception` stops it."""

    def __init__(self, signum: int) -> None:
        self.signum = signum


@contextmanager
def interrupting() -> Iterator[None]:
    """Make Ctrl-C and SIGTERM raise `Interrupted`, once: cleaning up is not interrupted again."""
    # a signal that the caller ignores (nohup, a shell's background job) stays ignored
    watched = [s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) is not signal.SIG_IGN]
    postponed, ended, main = 0, False, _thread.get_ident()

    def interrupt(signum: int, frame: FrameType | None) -> None:
        nonlocal postponed
        if _is_shielded(frame) and postponed < _MOST:
            postponed += 1
            come_again(signal.Signals(signum))
            return
        for number in watched:
            signal.signal(number, signal.SIG_IGN)
        raise Interrupted(signum)

    def watch() -> None:
        for number in watched:
            signal.signal(number, interrupt)

    def come_again(signum: signal.Signals) -> None:
        def wait() -> None:
            time.sleep(_AGAIN)
            if not ended and hasattr(signal, "pthread_kill"):
                signal.pthread_kill(main, signum)  # ends what the thread waits for, as `interrupt_main` would not
            elif not ended:
                _thread.interrupt_main(signum)

        # a `threading.Thread` would take locks that may be held
        _thread.start_new_thread(wait, ())

    def unraisable(lost: Any) -> None:
        """Have a signal come once more that came inside a destructor, where Python prints and drops what is raised."""
        if not isinstance(lost.exc_value, Interrupted):
            hook(lost)
            return
        watch()
        come_again(signal.Signals(lost.exc_value.signum))  # raised here, it would be dropped again

    before = {number: signal.getsignal(number) for number in watched}
    hook, sys.unraisablehook = sys.unraisablehook, unraisable
    watch()
    try:
        yield
    finally:
        ended = True
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook


def _is_shielded(frame: FrameType | None) -> bool:
    """Whether a function of a shielded module is under way."""
    while frame is not None:
        if f"{frame.f_globals.get('__name__')}.".startswith(_SHIELDED):
            return True
        frame = frame.f_back
    return False
