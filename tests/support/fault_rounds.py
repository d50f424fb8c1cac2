"""Runs that are hurt on the way, for tests/files/test_faults.py and benchmarks/faults.py.

Each round runs the command, hurts it at a random moment, and checks what is left: the output is
complete or absent, errors are one line, and `--resume` gives the bits of an undisturbed run.
"""

import multiprocessing
import os
import random
import re
import resource
import secrets
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from slipsweep.errors import InputError
from slipsweep.files.opening import read_result

#: Some 30 chunks.
SWEEP = """
[axes.theta]
start = 0
stop = 14
num = 15
[axes.mu_s]
start = 0.27
stop = 0.6
num = 20
[axes.amplitude]
start = 0.5
stop = 9
num = 40
[axes.frequency]
start = 0.5
stop = 5
num = 60
"""

OUTPUTS = ("out.nc", "out.zarr")

#: Processes begin as copies of one that has imported what the command needs.
_PROCESSES = multiprocessing.get_context("forkserver")
_PROCESSES.set_forkserver_preload(
    ["slipsweep.cli.run", "slipsweep.studies.cautions", "dask.array", "pint", "zarr", __name__]
)


@dataclass
class Started:
    """A command that runs in a folder, and the file that has its standard error."""

    process: Any
    errors: Path

    @property
    def has_ended(self) -> bool:
        """True if the process has ended."""
        return self.process.exitcode is not None

    def finished(self, status: int | None = 0) -> str:
        """Wait for the end, with a status and without a traceback; return the standard error."""
        self.process.join(900)  # kernels may have to be compiled
        errors = self.errors.read_text()
        assert "Traceback" not in errors, errors
        assert status is None or self.process.exitcode == status, (self.process.exitcode, errors)
        return errors


def start(folder: Path, *arguments: str, cells: int = 25_000, limit: int | None = None) -> Started:
    """Start `slipsweep` in a folder, in chunks of `cells`; files may grow to `limit` bytes."""
    errors = folder / f"errors-{secrets.token_hex(4)}"
    process = _PROCESSES.Process(target=_run, args=(folder, arguments, cells, limit, errors))
    process.start()
    return Started(process, errors)


def _run(
    folder: Path, arguments: Sequence[str], cells: int, limit: int | None, errors: Path
) -> None:
    from slipsweep.cli import main
    from slipsweep.files import running

    os.chdir(folder)
    with errors.open("w") as file:
        os.dup2(file.fileno(), 2)
    sys.stderr = os.fdopen(2, "w", buffering=1)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    vars(running)["CHUNK_CELLS"] = cells
    if limit is not None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    os._exit(main(list(arguments)))


def prepared(folder: Path) -> bytes:
    """Write the sweep and an undisturbed result; return that in short."""
    (folder / "a.toml").write_text(SWEEP)
    start(folder, "run", "a.toml", "-o", "whole.nc", "-q").finished()
    return bits(folder / "whole.nc")


def bits(path: Path) -> bytes:
    """The values of a result."""
    with read_result(path) as table:
        names = sorted(map(str, table.data_vars))
        return b"".join(np.ascontiguousarray(table[name].values).tobytes() for name in names)


def complete_or_absent(folder: Path, output: str, whole: bytes) -> None:
    """Check that there is no half result, and that another run gives the whole."""
    path = folder / output
    if path.exists():
        assert bits(path) == whole
    start(folder, "run", "a.toml", "-o", output, "--resume", "-q").finished()
    assert bits(path) == whole
    assert not (folder / f"{output}.part").exists()
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def hurt(
    folder: Path, output: str, whole: bytes, chance: random.Random, sign: signal.Signals
) -> None:
    """Kill a run, or interrupt it, somewhere between its first chunk and its end."""
    process = start(folder, "run", "a.toml", "-o", output, "-q")
    _until(lambda: (folder / f"{output}.part").exists() or process.has_ended)
    time.sleep(chance.uniform(0.0, 0.6))
    _signal(process, sign)
    errors = process.finished(None)
    if sign == signal.SIGINT and process.process.exitcode:
        assert process.process.exitcode == 130, errors
        kept = any((folder / f"{output}.part").glob("*.chunk"))
        said = r"\d+ of \d+ chunks are kept in .*: --resume goes on" if kept else "nothing written"
        assert re.fullmatch(rf"slipsweep: interrupted; {said}\n", errors), errors
        assert not kept or "--resume" in start(
            folder, "run", "a.toml", "-o", output, "-q"
        ).finished(2)
    complete_or_absent(folder, output, whole)


def full_disk(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """Fill a disk while chunks are written; if none can be mounted, limit the size of files."""
    output = f"disk/{output}"
    disk = folder / "disk"
    rest = chance.randint(0, 200_000)
    disk.mkdir(exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", str(disk)]
    mounted = (
        bool(shutil.which("mount"))
        and not subprocess.run(mount, capture_output=True, check=False).returncode
    )
    try:
        process = start(
            folder,
            "run",
            "a.toml",
            "-o",
            output,
            "-q",
            limit=None if mounted else 2_000 + rest // 2,
        )
        if mounted:
            chunks = chance.randint(1, 12)
            _until(
                lambda: (
                    len([*(folder / f"{output}.part").glob("*.chunk")]) >= chunks
                    or process.has_ended
                )
            )
            with (disk / "filler").open("wb") as file:
                for _ in range(20):  # the run takes some of it meanwhile
                    with suppress(OSError):
                        os.posix_fallocate(file.fileno(), 0, shutil.disk_usage(disk).free - rest)
        errors = process.finished(1)
        assert errors.count("\n") == 1, errors
        assert output in errors, errors
        (disk / "filler").unlink(missing_ok=True)
        complete_or_absent(folder, output, whole)
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(disk)], check=True)


def two_runs(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """Two runs at once on one output: one writes it, the other says so or finds it complete."""
    first = start(folder, "run", "a.toml", "-o", output, "-q")
    time.sleep(chance.uniform(0.0, 1.5))
    second = start(folder, "run", "a.toml", "-o", output, "-q")
    errors = [run.finished(None) for run in (first, second)]
    assert [run.process.exitcode for run in (first, second)].count(0) == 1, errors
    assert any(
        word in "".join(errors) for word in ("another", "exists already", "interrupted run")
    ), errors
    complete_or_absent(folder, output, whole)


def edited(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """The sweep file is edited between: the chunks of the other sweep are not mixed in."""
    process = start(folder, "run", "a.toml", "-o", output, "-q")
    _until(lambda: any((folder / f"{output}.part").glob("**/*")) or process.has_ended)
    time.sleep(0.3)
    _signal(process, signal.SIGKILL)
    process.finished(None)
    if (folder / f"{output}.part" / "identity.json").exists():
        (folder / "a.toml").write_text(
            SWEEP.replace("stop = 14", f"stop = {chance.randint(5, 13)}")
        )
        errors = start(folder, "run", "a.toml", "-o", output, "--resume", "-q").finished(2)
        assert "another sweep file" in errors
        (folder / "a.toml").write_text(SWEEP)
    complete_or_absent(folder, output, whole)


def damaged(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """Read or refuse, in a line, a result with a part overwritten or cut off, or no result."""
    start(folder, "run", "a.toml", "-o", "damaged.nc", "-q", "--overwrite").finished()
    path = folder / "damaged.nc"
    content = bytearray(path.read_bytes())
    if chance.random() < 0.2:
        content = bytearray(chance.randbytes(1000))
    elif chance.random() < 0.5:
        content = content[: chance.randrange(len(content))]
    else:
        at = chance.randrange(min(len(content), 20_000))
        content[at : at + 64] = chance.randbytes(64)
    path.write_bytes(content)
    refused = ""
    try:
        read_result(path).close()
    except InputError as error:
        refused = str(error)
    assert "\n" not in refused
    path.unlink()


def worker_killed(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """A worker is killed: its chunks are computed once more."""
    process = start(folder, "run", "a.toml", "-o", output, "-q", "--workers", "2", cells=15_000)
    _until(lambda: any((folder / f"{output}.part").glob("*.chunk")) or process.has_ended)
    time.sleep(chance.uniform(0.0, 1.0))
    workers = _children(process.process.pid)
    for pid in workers[-1:]:
        os.kill(pid, signal.SIGKILL)
    process.finished()
    complete_or_absent(folder, output, whole)


def read_only(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """A folder that cannot be written."""
    errors = start(folder, "run", "a.toml", "-o", f"/proc/{output}", "-q").finished(None)
    assert errors.count("\n") == 1, errors
    assert f"/proc/{output}" in errors


FAULTS: dict[str, Callable[[Path, str, bytes, random.Random], None]] = {
    "kill -9": partial(hurt, sign=signal.SIGKILL),
    "Ctrl-C": partial(hurt, sign=signal.SIGINT),
    "full disk": full_disk,
    "folder not writable": read_only,
    "two runs on one output": two_runs,
    "sweep edited between": edited,
    "damaged result": damaged,
    "worker killed": worker_killed,
}


def _signal(process: Started, sign: signal.Signals) -> None:
    with suppress(ProcessLookupError):  # it has ended
        os.kill(process.process.pid, sign)


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)


def _children(pid: int) -> list[int]:
    """Processes below a process that run Python's multiprocessing: the workers."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [
        int(child)
        for child in children
        if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text()
    ]
