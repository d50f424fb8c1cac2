"""Streams: sweeps from pipes, output in alphabets of one byte, output that nobody reads or that is lost."""

import contextlib
import os
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.commands import command as run
from tests.support.processes import SLIPSWEEP, TIMEOUT, on_a_terminal, slipsweep

CELL = "".join(
    f"[axes.{name}]\nvalues = {values}\n"
    for name, values in (("theta", [0, 5]), ("mu_s", [0.4]), ("amplitude", [3, 6]), ("frequency", [1, 2]))
)
SIMULATE = ("simulate", "--theta", "5", "--mu-s", "0.4", "--amplitude", "3", "--frequency", "1")
COMMANDS = ("run", "info", "export", "limit", "hazard", "simulate", "chart", "explore")

posix = pytest.mark.skipif(os.name != "posix", reason="opens pipes and devices the POSIX way")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    (folder / "a.toml").write_text(CELL)
    (folder / "m.csv").write_text("0,0\n0.1,0.5\n0.2,-0.5\n0.3,0\n")
    assert run(folder, "run", "a.toml", "--quiet").returncode == 0
    return folder


def shell(folder: Path, command: str, **environment: str) -> "subprocess.CompletedProcess[bytes]":
    """Run a command of the shell in which `$S` is slipsweep."""
    line = command.replace("$S", " ".join(SLIPSWEEP))
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        cwd=folder, env={**os.environ, **environment}, capture_output=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip


# ------------------------------------------------------------------------ what is printed


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "latin-1", "utf-8"])
def test_every_help_in_every_alphabet(made: Path, encoding: str) -> None:
    for command in [("simulate",)] if encoding in ("latin-1", "utf-8") else [(), *((name,) for name in COMMANDS)]:
        if command == ("simulate",):
            done = slipsweep(made, *command, "--help", environment={"PYTHONIOENCODING": encoding})
        else:
            done = run(made, *command, "--help", encoding=encoding)
        assert (done.returncode, done.stderr) == (0, ""), command
        text = done.stdout.encode(errors="surrogateescape").decode(encoding)
        assert "Usage: slipsweep" in text
        if command == ("simulate",):
            assert {"utf-8": "decay λ", "latin-1": "decay lambda"}.get(encoding, "decay lambda") in text
            assert ("m/s2" if encoding == "ascii" else "m/s²") in text


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_every_command_in_every_alphabet(made: Path, encoding: str) -> None:
    for number, command in enumerate(
        (
            ("run", "a.toml", "-o", "new.nc"), ("info", "a.nc"), ("export", "a.nc", "-o", "new.csv"),
            ("limit", "a.nc", "-d", "5mm", "-o", "limit.nc"), (*SIMULATE, "-o", "h.csv"),
            ("chart", "a.nc", "-k", "contours", "-o", "λ.png"),
            ("simulate", "--record", "m.csv", "--units", "g", "--theta", "5", "--mu-s", "0.4", "-o", "r.nc"),
            ("explore", "a.nc", "-o", "new.html"), ("info", "λ.nc"),
        )
    ):  # fmt: skip
        overwrite = ("--overwrite",) if "-o" in command else ()
        if number in (0, 8):  # as users start it: one that is served, and one that is not
            done = slipsweep(made, *command, *overwrite, environment={"PYTHONIOENCODING": encoding})
        else:
            done = run(made, *command, *overwrite, encoding=encoding)
        assert done.returncode == (2 if number == 8 else 0), done
        assert "Traceback" not in done.stderr
        text = done.stdout.encode(errors="surrogateescape").decode(encoding)  # letters that it has not are spelled
        assert "?" not in text


def test_help_on_a_terminal_without_such_letters(tmp_path: Path) -> None:
    text = on_a_terminal(tmp_path, "simulate", "--help", environment={"PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"})
    assert "lambda" in text
    assert text.isascii()


@posix
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-", "| head -c 1 | wc -c", "| true"])
def test_output_that_nobody_reads(made: Path, tmp_path: Path, closed: str) -> None:
    """All files are made all the same, and there is nothing to say."""
    commands: list[tuple[str, set[str]]] = [(f"$S run {made}/a.toml -o a.nc", {"a.nc"}), ("$S --help", set())]
    if closed in (">&-", "| head -c 1 | wc -c", "| true"):  # files are named one after the other; 2 s to start
        commands.append((f"$S chart {made}/a.nc -k modes -o m.png -o m.svg", {"m.png", "m.svg"}))
    for command, wanted in commands:
        before = {*os.listdir(tmp_path)}
        done = shell(tmp_path, f"{command} {closed}")
        assert (done.returncode, done.stderr) == (0, b""), command
        assert {*os.listdir(tmp_path)} - before == wanted
    assert shell(tmp_path, f"$S info nothing.nc {closed}").returncode == 2
    # what is written is what would have been, and no message is in it
    shown = run(tmp_path, "info", "a.nc")
    assert shown.returncode == 0
    assert shown.stdout.startswith("a.nc")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="has no device that is full")
def test_output_that_is_lost(made: Path, tmp_path: Path) -> None:
    """All files are made, and one line says that something is missing."""
    line = b"slipsweep: error: what is printed could not be written: No space left on device\n"
    chart = f"$S chart {made}/a.nc -k modes -o m.png -o m.svg"
    for command in (f"$S run {made}/a.toml -o a.nc", chart, "$S --help", "$S run --help"):
        done = shell(tmp_path, f"{command} > /dev/full")
        assert (done.returncode, done.stderr) == (1, line)
    assert {*os.listdir(tmp_path)} == {"a.nc", "m.png", "m.svg"}
    assert shell(tmp_path, "$S info nothing.nc > /dev/full").returncode == 2
    for command, status in (("$S info a.nc", 0), ("$S info nothing.nc", 2)):
        assert shell(tmp_path, f"{command} 2> /dev/full").returncode == status


# ---------------------------------------------------------------------- sweeps from pipes


@pytest.fixture
def pipe(tmp_path: Path) -> Iterator[Path]:
    """A FIFO in the working folder that somebody writes a sweep into."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=(CELL,), daemon=True)
    writer.start()
    yield path
    if writer.is_alive():
        path.read_text()
    writer.join()


@posix
def test_a_sweep_from_a_named_pipe(pipe: Path) -> None:
    done = slipsweep(pipe.parent, "run", "pipe", "-o", "a.nc")
    assert (done.returncode, done.stderr) == (0, "")


@contextlib.contextmanager
def in_place_of(source: str, path: Path) -> Iterator[str]:
    """What the shell makes of a source of a file's text, for a command in this process; its name for the command."""
    if "< a.toml" in source:
        reader = os.open(path, os.O_RDONLY)
    else:
        reader, writer = os.pipe()
        os.write(writer, path.read_bytes())  # less than a pipe takes
        os.close(writer)
    before = os.dup(0)
    try:
        if source.startswith("<("):
            yield f"/dev/fd/{reader}"
        else:
            os.dup2(reader, 0)
            yield source.partition(" ")[0]
    finally:
        os.dup2(before, 0)
        os.close(before)
        os.close(reader)


@posix
@pytest.mark.parametrize("source", ["- < a.toml", "/dev/stdin < a.toml", "<(cat a.toml)", "-", "/dev/stdin"])
def test_a_sweep_from_standard_input(made: Path, tmp_path: Path, source: str) -> None:
    text = tmp_path / "a.toml"
    text.write_text(CELL)
    done = shell(tmp_path, f"{'' if 'a.toml' in source else 'cat a.toml | '}$S run {source} -o a.nc")
    assert (done.returncode, done.stderr) == (0, b"")
    with in_place_of(source, text) as name:
        here = run(tmp_path, "limit", name, "-d", "5mm", "-o", "limit.nc")
    assert (here.returncode, here.stderr) == (0, "")
    # it has no name that one could make another of
    with in_place_of(source, text) as name:
        here = run(tmp_path, "run", name)
    assert here.returncode == 2
    assert "name the output with -o or output.path" in here.stderr
    text.write_text(CELL + '[output]\npath = "own.nc"\n')
    with in_place_of(source, text) as name:
        assert run(tmp_path, "run", name, "--quiet").returncode == 0
    assert {*os.listdir(tmp_path)} == {"a.toml", "a.nc", "limit.nc", "own.nc"}
    assert run(tmp_path, "run", "own.nc", "-o", "again.nc").returncode == 0


@posix
def test_a_record_beside_a_sweep_from_a_pipe_is_that_of_the_working_folder(made: Path, tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_bytes((made / "m.csv").read_bytes())
    text = '[excitation]\nrecord = "m.csv"\nunits = "g"\n[axes.theta]\nvalues = [5]\n[axes.mu_s]\nvalues = [0.4]\n'
    (tmp_path / "r.toml").write_text(text)
    assert shell(tmp_path, "cat r.toml | $S run - -o r.nc").returncode == 0
    for source in ("/dev/stdin < a.toml", "<(cat a.toml)"):
        with in_place_of(source, tmp_path / "r.toml") as name:
            assert run(tmp_path, "run", name, "-o", "r.nc", "--overwrite").returncode == 0
    with in_place_of("<(cat a.toml)", tmp_path / "m.csv") as name:
        block = ("--units", "g", "--theta", "5", "--mu-s", "0.4")
        assert run(tmp_path, "simulate", "--record", name, *block, "-o", "s.nc").returncode == 0


@posix
@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("$S run - -o b.nc < a.nc", "is a netCDF file, which cannot be read from a pipe; give it by name"),
        ("cat a.nc | $S run /dev/stdin -o b.nc", "is a netCDF file, which cannot be read from a pipe"),
        ("$S run - -o b.nc < /dev/null", "axes.theta: missing"),
        ("$S run - -o b.nc <&-", "axes.theta: missing"),
        ("$S run . -o b.nc", ".: cannot be read: Is a directory"),
        ("$S run /dev/zero -o b.nc", "/dev/zero: not a sweep file: it has more than 200000000 bytes"),
        ("$S simulate --record /dev/zero --theta 5 --mu-s 0.4", "/dev/zero: more than 200000000 bytes"),
        ("$S info pipe.nc", "is not a file"),
        ("$S export pipe.nc -o b.csv", "is not a file"),
        ("$S explore pipe.nc -o b.html", "is not a file"),
        ("cat a.nc | $S info /dev/stdin", "is not a file"),
    ],
)
def test_what_is_no_sweep_or_result_is_said_to_be_none(made: Path, command: str, message: str) -> None:
    if not (made / "pipe.nc").exists():
        os.mkfifo(made / "pipe.nc")
    if {*"|<"} & {*command}:
        done = shell(made, command)
        status, errors = done.returncode, done.stderr.decode()
    else:
        here = run(made, *command.split()[1:])
        status, errors = here.returncode, here.stderr
    assert status == 2
    assert errors.startswith("slipsweep: error: ")
    assert errors.count("\n") == 1
    assert message in errors
    assert not (made / "b.nc").exists()
