"""Names of files: what the system takes for a name is read and written by it, or refused in one line."""

import os
import sys
from pathlib import Path

import netCDF4
import pytest
from hypothesis import given, settings

from slipsweep.cli import main
from tests.support import odd_names, results
from tests.support.commands import command as run
from tests.support.processes import slipsweep
from tests.support.strategies import reproducible

pytestmark = pytest.mark.usefixtures("tried_here")

CELL = "".join(
    f"[axes.{name}]\nvalues = {values}\n"
    for name, values in (("theta", [0, 5]), ("mu_s", [0.4]), ("amplitude", [3, 6]), ("frequency", [1, 2]))
)

#: Stems that the netCDF library, a shell or a terminal might take for something else.
STEMS = [
    b" blank in front", b"\ttab", b"[mode=zarr]", b"http:x", b"s3:x#mode=zarr", b"a#mode=bytes", b"no \xff UTF-8",
    "ü".encode(), b"new\nline", b"\x1b[31m", b"%p", b"$HOME", b"~", b"-o", b"a'\"b",
]  # fmt: skip


def failed(done: object) -> str:
    """The one line of an error."""
    assert (done.returncode, done.stdout) in ((1, ""), (2, "")), done  # type: ignore[attr-defined]
    text = str(done.stderr)  # type: ignore[attr-defined]
    assert text.startswith("slipsweep: error: ")
    assert text.count("\n") == 1
    assert text[:-1].isprintable()
    return text


@pytest.mark.skipif(sys.platform == "win32", reason="its names are UTF-16 and may not hold these")
@pytest.mark.parametrize("stem", STEMS, ids=ascii)
def test_a_result_has_the_name_that_was_given(tmp_path: Path, stem: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that another file would be taken for is there as well, and is left alone."""
    folder = tmp_path / os.fsdecode(stem)
    folder.mkdir()
    name = os.fsdecode(stem + b".nc")
    decoys = {os.fsdecode(stem.strip() + b".nc"), "x.nc"} - {name}
    for decoy in decoys:
        (folder / decoy).write_text("not netCDF")
    (folder / "a.toml").write_text(CELL)
    before = {*os.listdir(folder)}
    monkeypatch.chdir(folder)
    # a process of its own is given bytes
    start = run if name.isascii() else slipsweep
    assert start(folder, "run", "a.toml", f"--output={name}", "--quiet").returncode == 0
    assert {*os.listdir(folder)} - before == {name}
    for decoy in decoys:
        assert (folder / decoy).read_text() == "not netCDF"
    os.link(folder / name, tmp_path / "plain.nc")
    with netCDF4.Dataset(tmp_path / "plain.nc") as file:
        assert file["permanent_displacement"].shape == (2, 1, 2, 2)
    commands = [["explore", "-o", "a.html"], ["export", "-o", "a.csv"], ["chart", "-o", "a.png", "-k", "contours"]]
    # a page and a picture take half a second each
    for command in (["info"], ["run", "-o", "b.nc"], commands[STEMS.index(stem) % 3]):
        assert main([*command, "--", name]) == 0


def test_a_backslash_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(CELL)
    message = "a backslash separates no folders here"
    assert message in failed(run(tmp_path, "run", "a.toml", "-o", "b\\c.nc"))
    assert os.listdir(tmp_path) == ["a.toml"]
    run(tmp_path, "run", "a.toml")
    (tmp_path / "a.nc").rename(tmp_path / "b\\c.nc")
    for command in (["info"], ["export", "-o", "a.csv"], ["chart"], ["run", "-o", "b.nc"]):
        assert message in failed(run(tmp_path, *command, "b\\c.nc"))


def test_the_very_longest_name(tmp_path: Path) -> None:
    """The longest that the system takes is served, or refused before anything is computed."""
    (tmp_path / "a.toml").write_text(CELL)
    case = ("simulate", "--theta", "5", "--mu-s", "0.4", "--amplitude", "3", "--frequency", "1")
    for ending in (".csv", ".nc", ".svg"):
        longest = "x" * (255 - len(ending)) + ending
        assert run(tmp_path, *case, "-o", longest).returncode == 0
        assert (tmp_path / longest).is_file()
        assert "File name too long" in failed(run(tmp_path, *case, "-o", f"x{longest}"))
    for length in (300, 255):
        assert "File name too long" in failed(run(tmp_path, "run", "a.toml", "-o", "y" * length))
    assert len(os.listdir(tmp_path)) == 4


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="its names are UTF-8 whatever the locale")
def test_where_names_are_ascii(tmp_path: Path) -> None:
    """Bytes of a command line are served; letters of a sweep file that make no bytes are refused."""
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    (tmp_path / "ü.toml").write_text(CELL)
    assert slipsweep(tmp_path, "run", "ü.toml", environment=ascii_only).returncode == 0
    assert slipsweep(tmp_path, "info", "ü.nc", environment=ascii_only).returncode == 0
    (tmp_path / "a.toml").write_text(CELL + '[output]\npath = "ö.nc"\n', encoding="utf-8")
    done = slipsweep(tmp_path, "run", "a.toml", environment=ascii_only)
    assert "no file can have this name where names are ascii" in failed(done)
    record = '[excitation]\nrecord = "ö.csv"\n[axes.theta]\nvalues = [5]\n[axes.mu_s]\nvalues = [0.4]\n'
    (tmp_path / "r.toml").write_text(record, encoding="utf-8")
    assert "cannot be read" in failed(slipsweep(tmp_path, "run", "r.toml", environment=ascii_only))
    assert {*os.listdir(tmp_path)} == {"ü.toml", "ü.nc", "a.toml", "r.toml"}


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return results.made(tmp_path_factory.mktemp("made"))


posix = pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="not every name is one there")


@posix
@settings(reproducible, max_examples=15)
@given(name=odd_names.names())
def test_any_name_is_written(sources: list[Path], name: bytes) -> None:
    odd_names.written(sources[0].parents[1], sources, name)


@posix
@settings(reproducible, max_examples=15)
@given(name=odd_names.names())
def test_any_name_is_read(sources: list[Path], name: bytes) -> None:
    odd_names.read(sources[0].parents[1], sources, name)
