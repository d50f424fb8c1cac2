"""Input that once failed, tried again: ``python -m benchmarks.hunt`` finds such."""

from pathlib import Path

import pytest

from tests.support.hunt import FOUND, KINDS, Found, Sources


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Sources:
    folder: Path = tmp_path_factory.mktemp("found")
    return Sources(folder)


@pytest.mark.parametrize("found", FOUND, ids=lambda found: found.wrong)
def test_what_failed_once_is_served_or_refused_in_one_line(sources: Sources, found: Found) -> None:
    KINDS[found.kind].trial(sources, found.value)
