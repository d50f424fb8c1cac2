"""Names of files that a program might take for something else, and what becomes of files so called.

`names` draws them; `written` has a command write a file so called, `read` has all commands read one.
"""

import os
import random
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hypothesis import strategies as st

from tests.support.commands import is_served, run_command, working_folder

#: What names are made of: what shells, terminals, the netCDF library, TOML and other systems take for something else.
PARTS = [
    b" ", b"  ", b"\t", b"\n", b"\r", b"\x01", b"\x1b[31m", b"\x7f", b"\xff", b"\xc3", b"\xed\xa0\x80", "ü".encode(),
    "e\u0301".encode(), "\u202e".encode(), "\u200b".encode(), "😀".encode(), "日本".encode(), b"'", b'"', b"`", b"\\",
    b"$HOME", b"${x}", b"~", b"%p", b"%20", b"{}", b"{0}", b"[0]", b"[a-z]", b"*", b"?", b"#", b"#mode=bytes",
    b"[mode=zarr]", b"http:", b"s3:x", b"file:", b"C:", b"-", b"--", b"-o", b"=", b",", b";", b"&", b"|", b"<", b">",
    b".", b"..", b"...", b".nc", b".toml", b".parts", b"CON", b"nul", b"0", b"a", b"b", b"results", b"x" * 60, b"&amp;",
]  # fmt: skip

#: The file system's longest name, bytes, but for what is put to a name while it is written.
LONGEST = 200


@st.composite
def names(draw: st.DrawFn) -> bytes:
    """A stem, at times in a folder of its own."""
    rng = random.Random(draw(st.integers(0, 2**64 - 1)))
    name = b"".join(rng.choice(PARTS) for _ in range(rng.choice([1, 1, 2, 3, 4])))[:LONGEST]
    before = rng.choice([b"", b"", b"", b"./", b"sub/", b"sub/../", b"sub//", b" sub/"])
    return before + name


ENDINGS = {"run": ".nc", "export": ".csv", "explore": ".html", "chart": ".png", "limit": ".nc", "simulate": ".csv"}

CASE = ("--theta", "5", "--mu-s", "0.4", "--amplitude", "3", "--frequency", "1", "--points", "8", "--cycles", "2")


def _files() -> set[str]:
    """All files and folders below the working folder."""
    return {os.path.join(top, one) for top, folders, files in os.walk(".") for one in folders + files}


@contextmanager
def _place(folder: Path, sources: list[Path]) -> Iterator[set[str]]:
    """A working folder with a sweep and its result, of which it gives what is in it."""
    place = folder / "place"
    shutil.rmtree(place, ignore_errors=True)
    for sub in ("sub", " sub"):
        (place / sub).mkdir(parents=True)
    for source in (sources[0].with_suffix(".toml"), sources[0]):
        shutil.copy(source, place / f"grid{source.suffix}")
    with working_folder(place):
        yield _files()


def written(folder: Path, sources: list[Path], name: bytes) -> bool:
    """Have a command write a file of a name; it has that very name, or is refused in one line."""
    command = list(ENDINGS)[sum(name) % len(ENDINGS)]
    path = os.fsdecode(name) + ENDINGS[command]
    words: dict[str, list[str]] = {
        "run": ["run", "grid.toml"],
        "export": ["export", "grid.nc"],
        "explore": ["explore", "grid.nc"],
        "chart": ["chart", "grid.nc", "--kind", "contours"],
        "limit": ["limit", "grid.toml", "-d", "50mm"],
        "simulate": ["simulate", *CASE],
    }
    with _place(folder, sources) as before:
        quiet = [] if command == "chart" else ["--quiet"]
        served = is_served(*words[command], *quiet, f"--output={path}")
        made = {os.path.join(".", os.path.relpath(path))} if served else set()
        assert _files() - before == made, (command, path, _files() - before)
        # a backslash is most likely a folder's; all else is a name like others
        assert served or "\\" in path, (command, path)
    return served


def read(folder: Path, sources: list[Path], name: bytes) -> bool:
    """Have `info` and one of the other commands read a result of a name, and `run` a sweep file of it."""
    path = os.fsdecode(name)
    result, sweep = f"{path}.nc", f"{path}.toml"
    commands = [
        ["export", "-q", "-o", "new.csv"],
        ["explore", "-q", "-o", "new.html"],
        ["chart", "-k", "contours", "-o", "new.png"],
        ["run", "-q", "-o", "new.nc"],
        ["limit", "-q", "-d", "50mm"],
    ]
    with _place(folder, sources):
        shutil.copy("grid.nc", result)
        shutil.copy("grid.toml", sweep)
        kept = Path(result).read_bytes()
        served = is_served("info", "--", result)
        assert served == is_served(*commands[sum(name) % len(commands)], "--", result), path
        swept = run_command("run", "-q", "-o", "swept.nc", "--", sweep)
        assert (swept.status, swept.output, swept.errors) == (0, "", ""), swept
        assert Path(result).read_bytes() == kept
        assert served or "\\" in path, path
    return served
