"""Python's search for reference cycles, put off."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_collections() -> Iterator[None]:
    """Leave reference cycles alone: where many objects are made, nearly all alive, to look for some costs much.

    Of a first run, 1.3 s of the compiler's 15, and half the time in which sources are parsed.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
