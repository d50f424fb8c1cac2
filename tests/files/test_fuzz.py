"""Sweep files damaged at random: each is a sweep or is refused in one line, and nothing else happens."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tests.support import sweep_files

many = settings(
    deadline=None, derandomize=True, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)


@settings(many, max_examples=2000)
@given(sweep_files.mutated())
def test_a_damaged_file_is_a_sweep_or_refused_in_one_line(text: str) -> None:
    sweep_files.check(text)


@settings(many, max_examples=300)
@given(sweep_files.random_tables)
def test_random_tables_are_a_sweep_or_refused_in_one_line(text: str) -> None:
    sweep_files.check(text)


def test_the_writer_of_toml() -> None:
    content = {"axes": {"theta": {"values": [1.5, -2], "a\nb": [True, "θ"], "x": float("inf")}}}
    assert tomllib.loads(sweep_files.document(content)) == content


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@settings(many, max_examples=40)
@given(text=sweep_files.mutated())
def test_a_damaged_file_runs_or_fails_in_one_line(folder: Path, text: str) -> None:
    sweep_files.run(folder, text)
