"""The sweep files that come with slipsweep can be written anywhere, with all that they read."""

import os
from pathlib import Path

import pytest

from slipsweep.files import spec
from tests.support.commands import command

SWEEPS = Path(__file__).parents[2] / "sweeps"


def test_all_of_them_are_listed(tmp_path: Path) -> None:
    done = command(tmp_path, "example")
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()] == sorted(
        path.stem for path in SWEEPS.glob("*.toml")
    )
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["paper", "records", "suite"])
def test_an_example_is_complete(tmp_path: Path, name: str) -> None:
    """It can be read where it was written, and is the one that is shipped."""
    done = command(tmp_path, "example", name)
    written = [tmp_path / line for line in done.stdout.splitlines()]
    assert written[0] == tmp_path / f"{name}.toml"
    assert sorted(written) == sorted(path for path in tmp_path.rglob("*") if path.is_file())
    for path in written:
        assert path.read_bytes() == (SWEEPS / path.relative_to(tmp_path)).read_bytes()
    loaded = spec.load(tmp_path / f"{name}.toml")
    assert {Path(file) for file in loaded.files if not isinstance(file, int)} == {*written}


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    mine = tmp_path / "data" / "synthetic.csv"
    mine.write_text("mine")
    done = command(tmp_path, "example", "records")
    assert (done.returncode, mine.read_text()) == (2, "mine")
    assert "data/synthetic.csv: exists already; give --overwrite" in done.stderr
    assert not (tmp_path / "records.toml").exists()
    assert command(tmp_path, "example", "records", "--overwrite").returncode == 0
    assert mine.read_bytes() == (SWEEPS / "data" / "synthetic.csv").read_bytes()


@pytest.mark.skipif(os.name != "posix", reason="links need rights that users of Windows lack")
def test_a_sweep_file_that_is_not_shipped_is_refused(tmp_path: Path) -> None:
    """A name that is not there; to replace the shipped files themselves."""
    done = command(tmp_path, "example", "recrods")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert 'NAME = recrods: no such sweep file; did you mean "records"?' in done.stderr
    (tmp_path / "paper.toml").symlink_to(SWEEPS / "paper.toml")
    assert "which this command reads" in command(tmp_path, "example", "paper", "--overwrite").stderr
