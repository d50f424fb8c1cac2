"""Runs that are hurt on the way, for tests/files/test_faults.py and benchmarks/faults.py.

Each round runs the command, hurts it at a random moment, and checks what is left: the output is complete or absent,
errors are one line, and `--resume` gives the bits of an undisturbed run.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from slipsweep.errors import InputError
from slipsweep.files.opening import read_result

#: Some 30 chunks; half a second of work.
SWEEP = """
[axes.theta]
start = 0
stop = 14
num = 15
[axes.mu_s]
start = 0.27
stop = 0.6
num = 30
[axes.amplitude]
start = 0.5
stop = 9
num = 60
[axes.frequency]
start = 0.5
stop = 5
num = 60
"""

OUTPUTS = ("out.nc", "out.zarr")

#: The command in small chunks.
COMMAND = """
import sys
from slipsweep.files import storing
storing.CHUNK_CELLS = {cells}
from slipsweep.cli import main
sys.exit(main({arguments!r}))
"""


#: No file may become larger than this.
LIMITED = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
"""


def start(folder: Path, *arguments: str, cells: int = 60_000, before: str = "") -> "subprocess.Popen[str]":
    """Start `slipsweep` in a folder."""
    code = before + COMMAND.format(cells=cells, arguments=list(arguments))
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", code], cwd=folder, stdout=pipe, stderr=pipe, text=True)


def finished(process: "subprocess.Popen[str]", status: int | None = 0) -> str:
    """What a process has said on standard error; it must end with a status, and never with a traceback."""
    _, errors = process.communicate(timeout=300)
    assert "Traceback" not in errors, errors
    assert status is None or process.returncode == status, (process.returncode, errors)
    return errors


def prepared(folder: Path) -> bytes:
    """Write the sweep and an undisturbed result; return that in short."""
    (folder / "a.toml").write_text(SWEEP)
    finished(start(folder, "run", "a.toml", "-o", "whole.nc", "-q"))
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
    finished(start(folder, "run", "a.toml", "-o", output, "--resume", "-q"))
    assert bits(path) == whole
    assert not (folder / f"{output}.part").exists()
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def hurt(folder: Path, output: str, whole: bytes, sign: signal.Signals, chance: random.Random) -> None:
    """Kill a run, or interrupt it, somewhere between its first chunk and its end."""
    process = start(folder, "run", "a.toml", "-o", output, "-q")
    _until(lambda: (folder / f"{output}.part").exists() or process.poll() is not None)
    time.sleep(chance.uniform(0.0, 0.6))
    process.send_signal(sign)
    errors = finished(process, None)
    if sign == signal.SIGINT and process.returncode:
        assert process.returncode == 130, errors
        assert errors.count("\n") == 1, errors
    complete_or_absent(folder, output, whole)


def killed(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """kill -9."""
    hurt(folder, output, whole, signal.SIGKILL, chance)


def interrupted(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """Ctrl-C."""
    hurt(folder, output, whole, signal.SIGINT, chance)


def full_disk(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """No room left: a limit of the size of files stands for it where the disk is not the tests' own."""
    limited = LIMITED.format(limit=chance.randint(2_000, 100_000))
    process = start(folder, "run", "a.toml", "-o", output, "-q", before=limited)
    errors = finished(process, 1)
    assert errors.count("\n") == 1, errors
    assert output in errors, errors
    complete_or_absent(folder, output, whole)


def two_runs(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """Two runs at once on one output: one writes it, the other says so or finds it complete."""
    first = start(folder, "run", "a.toml", "-o", output, "-q")
    time.sleep(chance.uniform(0.0, 1.5))
    second = start(folder, "run", "a.toml", "-o", output, "-q")
    errors = [finished(process, None) for process in (first, second)]
    assert sorted(process.returncode != 0 for process in (first, second)) == [False, True], errors
    assert any(word in "".join(errors) for word in ("another", "exists already", "interrupted run")), errors
    complete_or_absent(folder, output, whole)


def edited(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """The sweep file is edited between: the chunks of the other sweep are not mixed in."""
    process = start(folder, "run", "a.toml", "-o", output, "-q")
    _until(lambda: any((folder / f"{output}.part").glob("**/*")) or process.poll() is not None)
    time.sleep(0.3)
    process.kill()
    finished(process, None)
    if (folder / f"{output}.part" / "identity.json").exists():
        (folder / "a.toml").write_text(SWEEP.replace("stop = 14", f"stop = {chance.randint(5, 13)}"))
        errors = finished(start(folder, "run", "a.toml", "-o", output, "--resume", "-q"), 2)
        assert "another sweep file" in errors
        (folder / "a.toml").write_text(SWEEP)
    complete_or_absent(folder, output, whole)


def damaged(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """A result with a part overwritten or cut off, or a file that is none, is read or refused in one line."""
    finished(start(folder, "run", "a.toml", "-o", "damaged.nc", "-q", "--overwrite"))
    path = folder / "damaged.nc"
    content = bytearray(path.read_bytes())
    if chance.random() < 0.5:
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
    process = start(folder, "run", "a.toml", "-o", output, "-q", "--workers", "2", cells=30_000)
    _until(lambda: (folder / f"{output}.part").exists() or process.poll() is not None)
    time.sleep(chance.uniform(1.0, 4.0))
    workers = _children(process.pid)
    for pid in workers[-1:]:
        os.kill(pid, signal.SIGKILL)
    finished(process)
    complete_or_absent(folder, output, whole)


def read_only(folder: Path, output: str, whole: bytes, chance: random.Random) -> None:
    """A folder that cannot be written."""
    errors = finished(start(folder, "run", "a.toml", "-o", f"/proc/{output}", "-q"), None)
    assert errors.count("\n") == 1, errors
    assert f"/proc/{output}" in errors


FAULTS: dict[str, Callable[[Path, str, bytes, random.Random], None]] = {
    "kill -9": killed,
    "Ctrl-C": interrupted,
    "full disk": full_disk,
    "folder not writable": read_only,
    "two runs on one output": two_runs,
    "sweep edited between": edited,
    "damaged result": damaged,
    "worker killed": worker_killed,
}


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)


def _children(pid: int) -> list[int]:
    """Processes below a process that run Python's multiprocessing: the workers."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(one) for one in children if "spawn_main" in Path(f"/proc/{one}/cmdline").read_text()]
