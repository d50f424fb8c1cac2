"""Cells that no design must rest on are named wherever their result goes."""

from pathlib import Path

import pandas as pd
import pytest

from slipsweep.files import running
from slipsweep.files.opening import read_result
from tests.support.commands import run_command

AXES = """
[axes]
theta.values = [5]
mu_s.values = [0.4]
amplitude.values = [2, 4, 6, 8, 10, 12]
frequency.values = [1, 2]
"""


def told(*arguments: object) -> str:
    ended = run_command(*arguments)
    assert ended.status == 0, ended.errors
    return ended.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep in which displacements fall with A, and blocks slide continuously; and its result."""
    folder = tmp_path_factory.mktemp("shares")
    (folder / "a.toml").write_text(AXES)
    (folder / "compressed.toml").write_text(f"{AXES}[output]\ncompression = 1\n")
    assert told("run", folder / "a.toml", "-q", "-o", folder / "a.nc") == ""
    return folder


@pytest.fixture
def lines(folder: Path) -> list[str]:
    unsound: str = read_result(folder / "a.nc").attrs["unsound"]
    return unsound.splitlines()


def test_the_file_has_shares_and_reasons(lines: list[str]) -> None:
    falls, continuous = lines
    assert falls.startswith("the displacement falls with A in ")
    assert continuous.endswith(" slide continuously with estimated friction: not for design")


@pytest.mark.parametrize(
    ("sweep", "output"), [("a.toml", "b.nc"), ("compressed.toml", "c.nc"), ("a.toml", "b.zarr")]
)
def test_files_in_chunks_have_the_same_lines(
    folder: Path, lines: list[str], sweep: str, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "CHUNK_CELLS", 6)
    told("run", folder / sweep, "-q", "-o", folder / output)
    assert read_result(folder / output).attrs["unsound"].splitlines() == lines


def test_info_and_run_print_them(folder: Path, lines: list[str]) -> None:
    printed = "".join(f"unsound: {line}\n" for line in lines)
    assert printed in told("info", folder / "a.nc")
    assert printed in told("run", folder / "a.toml", "-o", folder / "again.nc")
    assert printed in told("run", folder / "a.toml", "-o", folder / "again.nc", "--resume")


def test_a_spreadsheet_has_them(folder: Path, lines: list[str]) -> None:
    told("export", folder / "a.nc", "-o", folder / "a.xlsx")
    rows = pd.read_excel(folder / "a.xlsx", sheet_name="about", header=None).ffill()
    assert rows[rows[0] == "unsound"][1].tolist() == lines


def test_a_page_has_them(folder: Path, lines: list[str]) -> None:
    pytest.importorskip("bokeh")
    told("explore", folder / "a.nc", "-o", folder / "a.html")
    text = (folder / "a.html").read_text("utf-8")
    for line in lines:
        assert f"Unsound: {line}." in text


def test_a_sound_result_has_none(folder: Path) -> None:
    (folder / "sound.toml").write_text(f'{AXES}[model]\nfriction = "newmark"\n')
    assert "unsound" not in told("run", folder / "sound.toml", "-o", folder / "sound.nc")
    assert "unsound" not in read_result(folder / "sound.nc").attrs
