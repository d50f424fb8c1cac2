"""Outputs: no command writes what it reads, by any name; two outputs are two files; names that lead nowhere."""

import errno
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_type_hints

import pytest

from slipsweep import cli
from slipsweep.errors import InputError, RunError
from slipsweep.files import outputs
from tests.support.commands import command as run
from tests.support.processes import slipsweep

CELL = "".join(
    f"[axes.{name}]\nvalues = {values}\n"
    for name, values in (("theta", [0, 5]), ("mu_s", [0.4]), ("amplitude", [3, 6]), ("frequency", [1, 2]))
)
RECORD = '[excitation]\nrecord = "m.csv"\nunits = "g"\n[axes.theta]\nvalues = [0, 5]\n[axes.mu_s]\nvalues = [0.4]\n'
STATISTICS = (
    CELL.replace("[axes.mu_s]\nvalues = [0.4]\n", "")
    + '[uncertainty]\nsamples = 16\n[uncertainty.mu_s]\ndistribution = "uniform"\nloc = 0.3\nscale = 0.1\n'
)
SIMULATE = ("simulate", "--theta", "5", "--mu-s", "0.4", "--amplitude", "3", "--frequency", "1")

#: Of each command that writes: its arguments (IN for what it reads), and the endings that its outputs may have.
COMMANDS: dict[str, tuple[tuple[str, ...], str, tuple[str, ...]]] = {
    "run": (("run", "IN"), "a.toml", ("", ".nc")),
    "run a result": (("run", "IN"), "a.nc", ("", ".nc")),
    "run a record": (("run", "r.toml"), "m.csv", ("", ".nc")),
    "run statistics": (("run", "IN"), "s.toml", ("", ".nc")),
    "run --resume": (("run", "IN", "--resume"), "a.toml", ("", ".nc")),
    "simulate a record": (
        ("simulate", "--record", "IN", "--theta", "5", "--mu-s", "0.4", "--units", "g"),
        "m.csv",
        (".nc", ".csv", ".png"),
    ),
    "friction": (("friction", "IN", "--theta", "5", "--mu-s", "0.4"), "t.csv", (".nc", ".png", ".svg", ".pdf")),
    "calibrate": (
        ("calibrate", "IN", "--theta", "5", "--mu-s", "0.4"),
        "t.csv",
        (".nc", ".toml", ".png", ".svg", ".pdf"),
    ),
    "export": (("export", "IN"), "a.nc", (".csv", ".parquet")),
    "explore": (("explore", "IN"), "a.nc", (".html", ".htm")),
    "chart": (("chart", "IN", "--kind", "contours"), "a.nc", (".png", ".svg", ".pdf")),
    "report": (("report", "IN"), "a.nc", (".pdf",)),
    "limit": (("limit", "IN", "-d", "5mm"), "a.nc", (".nc", ".png", ".svg", ".pdf")),
    "hazard": (("hazard", "IN", "--curve", "t.csv", "-d", "5mm"), "a.nc", (".png", ".svg", ".pdf")),
    "hazard of a curve": (("hazard", "a.nc", "--curve", "IN", "-d", "5mm"), "t.csv", (".png", ".svg", ".pdf")),
    "limit a sweep": (("limit", "IN", "-d", "5mm"), "a.toml", (".nc", ".png", ".svg", ".pdf")),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one input of every kind."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "a.toml").write_text(CELL)
    (folder / "r.toml").write_text(RECORD)
    (folder / "s.toml").write_text(STATISTICS)
    (folder / "t.csv").write_text("time (s), table acceleration (g), block acceleration (g)\n")
    (folder / "m.csv").write_text("0,0\n0.1,0.5\n0.2,-0.5\n0.3,0\n")
    assert run(folder, "run", "a.toml", "--quiet").returncode == 0
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same, in which a test may do as it likes: the working folder."""
    place = tmp_path / "Place"
    place.mkdir()
    for entry in made.iterdir():
        (place / entry.name).write_bytes(entry.read_bytes())
    monkeypatch.chdir(place)
    return place


def contents(folder: Path) -> dict[str, bytes | str]:
    """Every file below a folder, and where links lead."""
    found: dict[str, bytes | str] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            found[str(path)] = os.readlink(path)
        elif path.is_file():
            found[str(path)] = path.read_bytes()
    return found


def refused(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What a command says that is refused, in one line, and leaves all files as they are."""
    before = contents(Path())
    capfd.readouterr()
    status = cli.main([str(argument) for argument in arguments])
    printed, errors = capfd.readouterr()
    assert (status, printed) == (2, ""), (arguments, status, printed, errors)
    assert errors.startswith("slipsweep: error: ")
    assert errors.count("\n") == 1
    assert contents(Path()) == before
    return errors


def names_of(name: str) -> Iterator[tuple[str, Callable[[str], object]]]:
    """Other names of a file in the working folder, and how each is made with an ending."""
    yield "hard link", lambda new: os.link(name, new)
    yield "symbolic link", lambda new: os.symlink(name, new)
    yield "link to a link", lambda new: os.symlink("symbolic link" + Path(new).suffix, new)


@pytest.mark.skipif(os.name != "posix", reason="makes links the POSIX way")
@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_writes_what_it_reads(folder: Path, command: str, capfd: pytest.CaptureFixture[str]) -> None:
    words, read, endings = COMMANDS[command]
    overwrite = () if "--resume" in words else ("--overwrite",)
    os.symlink(".", "here")
    written = ("Place/../Place", "here", ".//.//", str(folder), f"../{folder.name}/here")
    for ending in endings:
        # its own name, but for one that no result may have
        own = Path(read).suffix
        spellings = [read] if own == ending or ("" in endings and own == ".toml") else []
        for kind, make in names_of(read):
            make(f"{kind}{ending}")
            spellings.append(f"{kind}{ending}")
        os.chdir(folder.parent)
        for spelling in spellings:
            os.chdir(folder)
            for output in (spelling, *(f"{place}/{spelling}" for place in written[1:])):
                arguments = [read if word == "IN" else word for word in words]
                message = refused(capfd, *arguments, "-o", output, *overwrite)
                assert f"writing it would replace {Path(read)}, which this command reads" in message
        for kind, _ in names_of(read):
            os.unlink(f"{kind}{ending}")


def test_the_table_has_every_command_that_writes() -> None:
    """A command that comes to write, or to read, must say here what it reads."""
    paths = {
        str(getattr(command.callback, "__name__", "")): {
            name
            for name, kind in get_type_hints(command.callback).items()
            # the output of `run` may be an address, and so may the result that `verify` reads
            if "Path" in str(kind) or name in ("output", "result")
        }
        for command in cli.app.registered_commands
    }
    reading = {name for name, parameters in paths.items() if "output" in parameters and len(parameters) > 1}
    assert {words[0] for words, _, _ in COMMANDS.values()} == reading
    places = {(words[0], words.index("IN")) for words, _, _ in COMMANDS.values() if "IN" in words}
    for name in reading:
        assert len(paths[name] - {"output"}) == 1 or len([one for one, _ in places if one == name]) > 1, name
    # `example` writes under the names of the shipped files, and reads nothing of the user's
    assert {name for name, parameters in paths.items() if "output" not in parameters} == {"info", "verify", "example"}


def test_an_input_by_another_name_is_not_written_either(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It is the input that goes by a link."""
    os.symlink("a.nc", "link.nc")
    for read, output in (("link.nc", "a.nc"), ("link.nc", "link.nc")):
        assert "which this command reads" in refused(capfd, "run", read, "-o", output, "--overwrite")
    if os.path.exists("/dev/stdin"):
        descriptor = os.open("a.toml", os.O_RDONLY)
        for read in ("-", "/dev/stdin"):
            done = slipsweep(folder, "run", read, "-o", "a.toml", "--overwrite", stdin=descriptor)
            assert (done.returncode, "which this command reads" in done.stderr) == (2, True), done
        os.close(descriptor)
    assert (folder / "a.toml").read_text() == CELL


def test_a_work_folder_is_not_made_of_what_is_read(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Folders are emptied: that of the chunks, and with --split the output itself."""
    Path("b.nc.parts").mkdir()
    Path("a.toml").rename("b.nc.parts/data.nc")
    refused(capfd, "run", "b.nc.parts/data.nc", "-o", "b.nc")
    Path("b.nc.parts/data.nc").rename("b.nc.parts/a.toml")
    refused(capfd, "run", "b.nc.parts/a.toml", "-o", "b.nc")
    Path("b.nc.parts/a.toml").rename("a.toml")
    Path("chunks").mkdir()
    os.link("a.toml", "chunks/chunk-000007.nc")
    assert "chunk-000007.nc" not in refused(capfd, "run", "a.toml", "--split", "-o", "chunks", "--overwrite")


def test_a_work_folder_keeps_what_no_run_made(folder: Path) -> None:
    Path("b.nc.parts/data").mkdir(parents=True)
    Path("b.nc.parts/data/thesis.tex").write_text("mine")
    Path("b.nc.parts/thesis.tex").write_text("mine")
    for overwrite in ((), ("--overwrite",)):
        cli.main(["run", "a.toml", "-o", "b.nc", *overwrite])
        assert Path("b.nc.parts/thesis.tex").read_text() == "mine"
        assert Path("b.nc.parts/data/thesis.tex").read_text() == "mine"
    Path("b.nc.parts/data/thesis.tex").unlink()
    Path("b.nc").unlink(missing_ok=True)
    assert cli.main(["run", "a.toml", "-o", "b.nc"]) == 0
    assert Path("b.nc.parts/thesis.tex").read_text() == "mine"


@pytest.mark.skipif(os.name != "posix", reason="makes links the POSIX way")
def test_what_stands_where_the_work_folder_would_be(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("elsewhere").mkdir()
    Path("elsewhere/data.nc").write_text("mine")
    os.symlink("elsewhere", "b.nc.parts")
    Path("c.nc.parts").write_text("mine")
    for name in ("b.nc", "c.nc"):
        message = refused(capfd, "run", "a.toml", "-o", name, "--overwrite")
        assert f"{name}.parts is no folder" in message


# ------------------------------------------------------------------------- several outputs


def test_the_same_output_twice(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("sub").mkdir()
    for one, other in (
        ("h.csv", "h.csv"),
        ("h.nc", "./h.nc"),
        ("h.png", "sub/../h.png"),
        ("h.svg", str(folder / "h.svg")),
    ):
        for command in (SIMULATE, ("limit", "a.nc", "-d", "5mm"), ("chart", "a.nc", "--kind", "contours")):
            if Path(one).suffix in {"simulate": (".csv",), "limit": (".nc",), "chart": ()}[command[0]] + (
                ".png",
                ".svg",
            ):
                for overwrite in ((), ("--overwrite",)):
                    message = refused(capfd, *command, "-o", one, "-o", other, *overwrite)
                    assert f"{Path(other)}: is given twice as an output" in message
    assert cli.main([*SIMULATE, "-o", "h.csv", "-o", "sub/h.csv", "--quiet"]) == 0
    assert Path("h.csv").read_bytes() == Path("sub/h.csv").read_bytes()


def test_names_that_one_file_system_takes_for_the_same(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whether letters of either case are one name is the file system's to say; it is asked with a file."""
    pair = ("-o", "h.csv", "-o", "H.csv", "--quiet")
    if not Path("A.TOML").exists():  # one that tells them apart
        assert cli.main([*SIMULATE, *pair]) == 0
        assert {"h.csv", "H.csv"} <= {*os.listdir()}
        there = os.path.lexists
        monkeypatch.setattr(os.path, "lexists", lambda path: there(path) or there(str(path).replace("H", "h")))
    message = refused(capfd, *SIMULATE, *pair, "--overwrite")
    assert "H.csv: is given twice as an output" in message
    monkeypatch.undo()
    assert not [name for name in os.listdir(folder) if name.startswith(".slipsweep")]


# ------------------------------------------------------------------------ names of nothing


@pytest.mark.skipif(os.name != "posix", reason="makes links the POSIX way")
def test_a_link_that_leads_nowhere(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    os.symlink("gone.csv", "h.csv")
    os.symlink("round.csv", "round.csv")
    for name in ("h.csv", "round.csv"):
        message = refused(capfd, *SIMULATE, "-o", name)
        assert re.search(r"is a symbolic link to (gone|round)\.csv, which does not exist; give --overwrite", message)
        assert cli.main([*SIMULATE, "-o", name, "--overwrite", "--quiet"]) == 0
        assert not Path(name).is_symlink()
    assert not Path("gone.csv").exists()


def test_what_is_no_name_of_a_file(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("empty").mkdir()
    os.chdir("empty")
    for name in (".", "..", "/", ""):
        for more in ((), ("--split",)):
            for overwrite in ((), ("--overwrite",)):
                assert "exists and is not a" in refused(capfd, "run", "../a.toml", "-o", name, *more, *overwrite)


def written(path: Path, meanwhile: Callable[..., object], *arguments: object) -> None:
    """Write an output, in the middle of which something else happens."""
    with outputs.complete_or_absent(path, overwrite=False) as temporary:
        temporary.write_text("ours")
        meanwhile(*arguments)


def test_an_output_that_appears_during_the_run_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also on a file system that has no hard links."""

    def none(*arguments: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    for without in (False, True):
        with monkeypatch.context() as patched:
            if without:
                patched.setattr(os, "link", none)
            path = tmp_path / f"{without}.csv"
            with pytest.raises(RunError, match="made by another process during the run; it is left alone"):
                written(path, path.write_text, "theirs")
            assert path.read_text() == "theirs"
    assert len(os.listdir(tmp_path)) == 2


def test_the_folder_that_goes_away(tmp_path: Path) -> None:
    """What is wrong is said, and no question is asked after the disk."""
    place = tmp_path / "place"
    place.mkdir()
    with pytest.raises(RunError, match=r"a\.csv: writing failed: No such file or directory$"):
        written(place / "a.csv", shutil.rmtree, place)
    with pytest.raises(InputError, match="does not exist"):
        outputs.check_outputs([place / "a.csv"], False, reads=())
