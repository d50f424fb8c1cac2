"""What a user meets while a sweep runs, a round or two of each kind; `benchmarks.faults` does fifty."""

import random
from pathlib import Path

import pytest

from tests.support.fault_rounds import FAULTS, OUTPUTS, prepared


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """A sweep, and the bits of its result."""
    path = tmp_path_factory.mktemp("faults")
    return path, prepared(path)


#: Faults that meet every kind of output alike: one round.
ALIKE = ("folder not writable", "damaged result", "worker killed")


@pytest.mark.parametrize(
    ("fault", "output"),
    [(fault, output) for fault in FAULTS for output in (OUTPUTS[-1:] if fault in ALIKE else OUTPUTS)],
)
def test_nothing_is_lost_but_the_chunk_in_work(folder: tuple[Path, bytes], fault: str, output: str) -> None:
    path, whole = folder
    FAULTS[fault](path, output, whole, random.Random(output))
