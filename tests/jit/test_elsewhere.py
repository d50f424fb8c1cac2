"""Work for another process: done beside the block, and over with it."""

import os
import sys
import time
from pathlib import Path

import pytest

from slipsweep.jit import elsewhere


@pytest.fixture(autouse=True)
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elsewhere, "cores", lambda: 2)


def write_paths(path: str) -> None:
    Path(path).write_text(f"{os.getpid()} {sys.path}")


def write_and_wait(path: str) -> None:
    Path(path).write_text(str(os.getpid()))
    time.sleep(600)


def written(path: Path) -> str:
    end = time.monotonic() + 60
    while not path.exists() or not path.read_text():
        assert time.monotonic() < end
        time.sleep(0.01)
    return path.read_text()


def test_another_process_does_it_with_the_same_paths(tmp_path: Path) -> None:
    with elsewhere.begun(write_paths, str(tmp_path / "done")) as wait:
        wait()
        number, _, paths = (tmp_path / "done").read_text().partition(" ")
    assert int(number) != os.getpid()
    assert paths == str(sys.path)


@pytest.mark.skipif(os.name != "posix", reason="numbers of processes mean something else")
def test_it_ends_with_the_block(tmp_path: Path) -> None:
    """Also by an error, such as Ctrl-C."""
    path = tmp_path / "begun"

    def interrupted() -> None:
        with elsewhere.begun(write_and_wait, str(path)):
            written(path)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    with pytest.raises(ProcessLookupError):
        os.kill(int(path.read_text()), 0)


@pytest.mark.parametrize("program", [None, "", "/no/such/python3", "/usr/bin/some-program"])
def test_without_a_python_to_start_nothing_is_begun(
    program: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", program)
    with elsewhere.begun(write_paths, str(tmp_path / "done")) as wait:
        wait()
    assert not list(tmp_path.iterdir())


def test_with_one_processor_nothing_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elsewhere, "cores", lambda: 1)
    with elsewhere.begun(write_paths, str(tmp_path / "done")) as wait:
        wait()
    assert not list(tmp_path.iterdir())
