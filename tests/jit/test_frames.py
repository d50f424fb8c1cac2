"""Frames of calls within calls: none costs pages of memory, however deep the calls begin."""

import sys
from collections.abc import Callable
from functools import partial

import pytest

from slipsweep.jit.frames import with_room

resource = pytest.importorskip("resource")


def called(depth: int, call: Callable[[], None]) -> None:
    if depth:
        called(depth - 1, call)
    else:
        call()


def faults(call: Callable[[], None]) -> int:
    """Pages that the system gave."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    call()
    return int(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)


def call_often() -> None:
    for _ in range(2000):
        called(3, lambda: None)


def test_the_result_is_the_calls() -> None:
    assert with_room(lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        with_room(lambda: 1 // 0)


@pytest.mark.skipif(sys.implementation.name != "cpython", reason="frames of CPython")
def test_no_depth_takes_and_gives_back_memory() -> None:
    """Without the room some depths take a page or more for each of the 2000 calls."""
    for depth in range(150):
        assert faults(partial(with_room, partial(called, depth, call_often))) < 500
