"""Faults while a sweep runs, a round or two of each kind; `benchmarks.faults` does fifty."""

import random
from pathlib import Path

import pytest

from tests.support.fault_rounds import FAULTS, OUTPUTS, prepared


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """A sweep, and the bits of its result."""
    path = tmp_path_factory.mktemp("faults")
    return path, prepared(path)


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("fault", FAULTS)
def test_nothing_is_lost_but_the_chunk_in_work(
    folder: tuple[Path, bytes], fault: str, output: str
) -> None:
    path, whole = folder
    FAULTS[fault](path, output, whole, random.Random(output))
