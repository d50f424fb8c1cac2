"""slipsweep as users start it: a process of its own."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

SLIPSWEEP = (sys.executable, "-m", "slipsweep")

#: Long enough for kernels to be compiled on a busy machine.
TIMEOUT = 300


def slipsweep(
    folder: Path,
    *arguments: object,
    environment: Mapping[str, str] | None = None,
    preexec_fn: Callable[[], object] | None = None,
    stdin: int | None = None,
) -> "subprocess.CompletedProcess[str]":
    """Run a command in `folder`, with `environment` on top of this process's own but for colours, and wait for it."""
    clean = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR")}
    return subprocess.run(
        [*SLIPSWEEP, *map(str, arguments)],
        cwd=folder,
        env={**clean, **(environment or {})},
        capture_output=True,
        encoding="utf-8",
        errors="surrogateescape",  # names of files may have any bytes
        timeout=TIMEOUT,
        check=False,
        preexec_fn=preexec_fn,
        stdin=stdin,
    )


def on_a_terminal(folder: Path, *arguments: str, environment: Mapping[str, str] | None = None) -> str:
    """What a command writes to a terminal, by either stream."""
    pty = pytest.importorskip("pty", reason="opens a pseudo-terminal")
    reader, writer = pty.openpty()
    seen = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", "PYTHONUTF8": "1", **(environment or {})}
    with subprocess.Popen([*SLIPSWEEP, *arguments], cwd=folder, env=seen, stdout=writer, stderr=writer) as process:
        os.close(writer)
        read = b""
        try:
            while part := os.read(reader, 10_000):
                read += part
        except OSError:  # how Linux says that the other end is closed
            pass
        process.wait(TIMEOUT)
    os.close(reader)
    return read.decode()


@contextmanager
def workers(count: int) -> Iterator[str]:
    """Workers as processes, each of which takes 3 s to start: the address of their scheduler."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=count, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, memory_limit=0
    ) as cluster:
        yield cluster.scheduler_address
