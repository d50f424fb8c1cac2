"""Outputs are complete or absent, and never what a command reads."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from slipsweep.cli import main
from slipsweep.errors import InputError, RunError
from slipsweep.files import outputs, running, storing
from tests.support.no_locks import refusing_locks

SWEEP = """
[axes]
theta.values = [0, 5]
mu_s.values = [0.3, 0.4]
amplitude.values = [3, 5]
frequency.values = [1]
"""

#: Every command that writes, with its output left out, and what it writes.
COMMANDS = {
    "run a.toml -o": ".nc",
    "limit a.toml -d 50mm -o": ".nc",
    "simulate --theta 5 --mu-s 0.4 --amplitude 4 --frequency 2 -o": ".nc",
    "chart a.nc --kind contours -o": ".png",
    "export a.nc -o": ".csv",
    "explore a.nc -o": ".html",
    "report a.nc -o": ".pdf",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sweep and its result."""
    folder = tmp_path_factory.mktemp("outputs")
    (folder / "a.toml").write_text(SWEEP)
    assert main(["run", str(folder / "a.toml"), "-o", str(folder / "a.nc"), "-q"]) == 0
    return folder


def refused(capfd: pytest.CaptureFixture[str], *words: str) -> str:
    capfd.readouterr()
    assert main([*words]) in (1, 2)
    text = capfd.readouterr().err
    assert text.count("\n") == 1, text
    return text


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_that_exists_is_kept(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    path = Path(f"kept{COMMANDS[command]}")
    path.write_text("mine")
    assert "exists already; give --overwrite" in refused(capfd, *command.split(), str(path))
    assert path.read_text() == "mine"


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_in_a_missing_folder_is_refused(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    output = f"nowhere/new{COMMANDS[command]}"
    assert "the folder nowhere does not exist" in refused(capfd, *command.split(), output)


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="has no folder that nobody may write to")
@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_in_a_folder_that_nobody_may_write_to_is_refused(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    output = f"/proc/new{COMMANDS[command]}"
    assert output in refused(capfd, *command.split(), output)


@pytest.mark.skipif(os.name != "posix", reason="links need rights that users of Windows lack")
def test_no_command_writes_what_it_reads(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    before = Path("a.nc").read_bytes()
    Path("link.nc").symlink_to("a.nc")
    for output in ("a.nc", "link.nc"):
        text = refused(capfd, "run", "a.nc", "-o", output, "--overwrite")
        assert f"{output}: writing it would replace a.nc, which this command reads" in text
    assert Path("a.nc").read_bytes() == before


def test_an_output_that_is_given_twice_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    chart = ("chart", "a.nc", "--kind", "contours", "-o", "b.png", "-o", "b.png")
    assert "is given twice" in refused(capfd, *chart)
    assert not Path("b.png").exists()


#: Commands one after the other, in a process of their own.
SEVERAL = """
import sys
from slipsweep.cli import main
print(*[main(line.split()) for line in sys.argv[1:]])
"""


def test_without_file_locks_the_message_has_the_setting_that_goes_without(
    folder: Path,
) -> None:
    def ended(lines: list[str], **setting: str) -> tuple[str, list[str]]:
        done = subprocess.run(
            [sys.executable, "-c", SEVERAL, *lines],
            cwd=folder,
            env=os.environ | setting,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
            preexec_fn=refusing_locks(errno.ENOLCK),
        )
        return done.stdout, done.stderr.splitlines()

    lines = ["run a.toml -o n.nc -q", "info a.nc", "run a.toml -o n.zarr -q"]
    status, (written, read, store) = ended(lines)
    assert status == "1 2 0\n"
    named = "the file system has no locks; set HDF5_USE_FILE_LOCKING=FALSE to go without"
    assert written == f"slipsweep: error: n.nc: writing failed: Permission denied: {named}"
    assert read == f"slipsweep: error: a.nc: cannot be read: {named}"
    unseen = "the file system has no locks: a second run at this output would not be seen"
    assert store == f"slipsweep: warning: n.zarr: {unseen}"
    assert not (folder / "n.nc").exists()
    lines = ["run a.toml -o n.nc -q", "export n.nc -o n.csv -q"]
    assert ended(lines, HDF5_USE_FILE_LOCKING="FALSE") == ("0 0\n", [])


@pytest.mark.parametrize("output", ["a.nc", "a.zarr", "a.csv"])
def test_overwrite_through_a_link_replaces_what_it_points_to(
    folder: Path, tmp_path: Path, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "CHUNK_CELLS", 2)  # in chunks
    Path("elsewhere").mkdir()
    link = Path(output)
    target = Path("elsewhere", f"real{link.suffix}")
    command = ["export", str(folder / "a.nc")] if link.suffix == ".csv" else []
    command = [*(command or ["run", str(folder / "a.toml")]), "-q", "-o"]
    assert main([*command, str(target)]) == 0
    before = target.stat()
    link.symlink_to(target)
    assert main([*command, output]) == 2  # it exists
    assert main([*command, output, "--overwrite"]) == 0
    assert link.readlink() == target
    assert target.stat().st_ino != before.st_ino
    assert {path.name for path in tmp_path.iterdir()} == {"elsewhere", output}
    assert [path.name for path in Path("elsewhere").iterdir()] == [target.name]
    link.unlink()
    link.symlink_to("nowhere/real.nc")
    assert main([*command, output, "--overwrite"]) == 2


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_without_a_name_is_refused(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    before = {path.name for path in folder.iterdir()}
    assert "--output: must be the name of a file" in refused(capfd, *command.split(), "")
    assert {path.name for path in folder.iterdir()} == before


def test_a_result_that_is_not_finished_says_so(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "CHUNK_CELLS", 2)
    write = storing.Chunks.write

    def interrupted(chunks: storing.Chunks, number: int, *results: Any) -> None:
        if number == 2:
            raise KeyboardInterrupt
        write(chunks, number, *results)

    monkeypatch.setattr(storing.Chunks, "write", interrupted)
    assert main(["run", str(folder / "a.toml"), "-o", "b.nc", "-q"]) == 130
    for name in ("b.nc", "b.nc.part"):
        text = refused(capfd, "info", name)
        assert f"{name}: is not finished: 2 of its chunks are in b.nc.part" in text
        assert "run its sweep again with --resume" in text
    Path("b.nc").write_bytes((folder / "a.nc").read_bytes())
    assert main(["info", "b.nc"]) == 0  # an earlier one is there


def test_a_folder_that_is_no_store_is_kept(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "b.zarr").mkdir()
    (tmp_path / "b.zarr" / "mine").write_text("mine")
    with pytest.raises(InputError, match="exists and is neither a file nor a Zarr store"):
        outputs.check_outputs([tmp_path / "b.zarr"], True, reads=())


def write(
    path: Path, overwrite: bool, failure: OSError | None = None, theirs: str | None = None
) -> None:
    """Write a file, in which a failure or another process may interfere."""
    with outputs.complete_or_absent(path, overwrite) as temporary:
        temporary.write_text("mine")
        if theirs is not None:
            path.write_text(theirs)
        if failure is not None:
            raise failure


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="takes the file system that has no size")
def test_a_file_system_without_a_size_is_not_said_to_be_full() -> None:
    with (
        pytest.raises(RunError, match=r"failed: Not a directory$"),
        outputs.writing("/proc/self/a.nc"),
    ):
        raise OSError(20, "Not a directory")


def test_nothing_is_left_of_an_output_that_could_not_be_written(tmp_path: Path) -> None:
    message = r"a\.txt: writing failed: No space left on device \(.* free on the disk\)"
    with pytest.raises(RunError, match=message):
        write(tmp_path / "a.txt", False, OSError(28, "No space left on device"))
    assert not list(tmp_path.iterdir())


def test_an_output_that_another_process_made_meanwhile_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with pytest.raises(RunError, match="was made by another process during the run"):
        write(path, False, theirs="theirs")
    assert path.read_text() == "theirs"


def test_overwriting_replaces_an_output_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("theirs")
    write(path, True)
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text() == "mine"
