"""Command lines with accidents: each is served or refused in one line, and nothing is lost."""

from pathlib import Path

import pytest
from hypothesis import given, settings

from tests.support import odd_commands, results
from tests.support.strategies import reproducible


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return results.made(tmp_path_factory.mktemp("made"))


@settings(reproducible, max_examples=75)
@given(words=odd_commands.command_lines())
def test_a_command_line_is_served_or_refused_in_one_line(sources: list[Path], words: list[str]) -> None:
    odd_commands.is_served(sources[0].parents[1], sources, words)
