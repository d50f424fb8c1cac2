"""Commands, in this process or as users start them."""

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple
from unittest import mock

from slipsweep.cli import main

SLIPSWEEP = (sys.executable, "-m", "slipsweep")


class Ended(NamedTuple):
    """How a command ended, and what it printed."""

    status: int
    output: str
    errors: str


def run_command(*arguments: object) -> Ended:
    """Run a command to its end in this process."""
    written = [io.BytesIO(), io.BytesIO()]
    streams = [
        io.TextIOWrapper(name, "utf-8", errors="surrogateescape", write_through=True)
        for name in written
    ]
    words = [str(argument) for argument in arguments]
    with (
        contextlib.redirect_stdout(streams[0]),
        contextlib.redirect_stderr(streams[1]),
        mock.patch.object(sys, "argv", ["slipsweep", *words]),  # which a result's history tells
    ):
        status = main(words)
    output, errors = (name.getvalue().decode(errors="surrogateescape") for name in written)
    return Ended(status, output, errors)


def command(folder: Path, *arguments: object) -> "subprocess.CompletedProcess[str]":
    """Run a command to its end in `folder`: what `slipsweep` does, without a second of start-up."""
    with working_folder(folder):
        ended = run_command(*arguments)
    return subprocess.CompletedProcess(
        [*map(str, arguments)], ended.status, ended.output, ended.errors
    )


@contextlib.contextmanager
def working_folder(folder: Path) -> Iterator[Path]:
    """Run what follows in a folder, with nothing on standard input."""
    nothing = io.StringIO()
    with contextlib.chdir(folder), mock.patch.object(sys, "stdin", nothing):
        yield folder


def slipsweep(
    folder: Path,
    *arguments: object,
    environment: Mapping[str, str] | None = None,
    preexec_fn: Callable[[], object] | None = None,
) -> "subprocess.CompletedProcess[str]":
    """Run a command in `folder` as a process, with `environment` added to this one's."""
    return subprocess.run(
        [*SLIPSWEEP, *map(str, arguments)],
        cwd=folder,
        env={**os.environ, **(environment or {})},
        capture_output=True,
        encoding="utf-8",
        timeout=300,  # kernels may have to be compiled
        check=False,
        preexec_fn=preexec_fn,
    )
