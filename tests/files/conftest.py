"""Folders with sweep files."""

from pathlib import Path

import pytest

from tests.support.stored_runs import write_studies


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two recorded motions, and a sweep file of every kind."""
    write_studies(tmp_path)
    return tmp_path
