"""Commands run in this process: what they print, and that a refusal is one line."""

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from unittest import mock

from slipsweep.cli import main


class Ended(NamedTuple):
    """How a command ended, and what it printed."""

    status: int
    output: str
    errors: str


def run_command(*arguments: object, encoding: str = "utf-8") -> Ended:
    """Run a command to its end; `encoding` is that of what it prints."""
    written = [io.BytesIO(), io.BytesIO()]
    streams = [io.TextIOWrapper(one, encoding, errors="surrogateescape", write_through=True) for one in written]
    words = [str(argument) for argument in arguments]
    with (
        contextlib.redirect_stdout(streams[0]),
        contextlib.redirect_stderr(streams[1]),
        mock.patch.object(sys, "argv", ["slipsweep", *words]),  # which a result's history tells
    ):
        status = main(words)
    output, errors = (one.getvalue().decode(errors="surrogateescape") for one in written)
    return Ended(status, output, errors)


def command(folder: Path, *arguments: object, encoding: str = "utf-8") -> "subprocess.CompletedProcess[str]":
    """Run a command to its end in `folder`: what `processes.slipsweep` does, without a second of start-up."""
    with working_folder(folder):
        ended = run_command(*arguments, encoding=encoding)
    return subprocess.CompletedProcess([*map(str, arguments)], ended.status, ended.output, ended.errors)


def one_line(message: str, most: int = 700) -> str:
    """Check that what is said of bad input is one line, of letters that a terminal shows, and not a long one."""
    assert message.splitlines() == [message], ascii(message)
    assert message.isprintable(), ascii(message)
    assert 0 < len(message) < most, message
    return message


def is_served(*arguments: object) -> bool:
    """Run a command, which may be refused for its input, or have no value to give; tell whether it was served."""
    ended = run_command(*arguments)
    valueless = ended.errors.startswith("slipsweep: error: the model gives no value: ")
    assert ended.status == (1 if valueless else 2 if ended.errors else 0), (arguments, ended)
    if ended.status == 0:
        return True
    assert ended.output == "", (arguments, ended)
    start = "slipsweep: error: "
    assert ended.errors.startswith(start), (arguments, ended)
    assert ended.errors.endswith("\n"), (arguments, ended)
    one_line(ended.errors.removeprefix(start)[:-1], 1010)
    return False


@contextlib.contextmanager
def working_folder(folder: Path) -> Iterator[Path]:
    """Run what follows in a folder, with nothing on standard input."""
    before, stdin = Path.cwd(), sys.stdin
    os.chdir(folder)
    try:
        with open(os.devnull, encoding="utf-8") as nothing:
            sys.stdin = nothing
            yield folder
    finally:
        sys.stdin = stdin
        os.chdir(before)
