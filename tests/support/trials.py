"""Ways in which reading a file ends, for `slipsweep.files.guard`: functions of a module that other processes import."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from slipsweep.errors import InputError


def endless(path: Path, next_step: Callable[[], None]) -> None:
    next_step()
    while True:
        pass


def broken(path: Path, next_step: Callable[[], None]) -> None:
    os.abort()


def greedy(path: Path, next_step: Callable[[], None]) -> None:
    np.zeros(10**12)


def refused(path: Path, next_step: Callable[[], None]) -> None:
    raise InputError(f"{path}: ± is none")


def failing(path: Path, next_step: Callable[[], None]) -> None:
    raise RuntimeError("HDF error")
