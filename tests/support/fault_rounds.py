"""Faults done to real runs, one kind a function: each ends in the undisturbed result or in one message, or fails.

A function takes a folder of its own, a source of random choices and the name of the output, which says its format;
it returns how many faults it did.  `tests/runs/test_faults.py` does a round of some, many with ``-m slow``;
`benchmarks/faults.py` counts them.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import netCDF4
import numpy as np

from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.files.contents import RUN
from slipsweep.runs import solving, store
from slipsweep.runs.jobs import sweep_job
from tests.support.commands import command

SWEEP = """
[axes.theta]
start = 0
stop = 20
num = 30
[axes.mu_s]
start = 0.2
stop = 0.9
num = 20
[axes.amplitude]
start = 0.5
stop = 14
num = 40
[axes.frequency]
start = 0.1
stop = 20
num = 10
[output]
variables = ["permanent_displacement", "sliding_mode", "limiting_acceleration"]
"""

#: The same grid, of which each point has samples.
DRAWN = f"""{SWEEP.partition("[output]")[0]}
[uncertainty]
samples = 16
[uncertainty.yield_acceleration]
kind = "factor"
distribution = "lognorm"
s = 0.1
"""


#: Formats of outputs, and a name of each.
OUTPUTS = {"netCDF": "a.nc", "Zarr": "a.zarr"}


@dataclass(frozen=True)
class Asked:
    """A command, the sweep file that it reads, and the work of its chunks, in cells of the cycle solver."""

    output: str
    text: str = SWEEP
    command: tuple[str, ...] = ("run", "a.toml", "-q")
    work: int | None = None

    @property
    def folder(self) -> str:
        """Where its finished chunks are."""
        return f"{self.output}.parts"

    @property
    def journal(self) -> str:
        """Where its finished chunks are on record."""
        return f"{self.folder}/journal"

    @property
    def data(self) -> str:
        """What holds them."""
        return f"{self.folder}/data{Path(self.output).suffix}"


def sweep_of(output: str) -> Asked:
    """A sweep that is killed: a chunk of a store takes longer than one of a file, and 200 will do."""
    return Asked(output, work=3 * SMALL if output == OUTPUTS["Zarr"] else None)


def samples(output: str) -> Asked:
    """Statistics under uncertain inputs."""
    return Asked(output, DRAWN, work=2000)


def limits(output: str) -> Asked:
    """Limit amplitudes."""
    return Asked(output, command=("limit", "a.toml", "-q", "-d", "1cm", "-d", "10cm"), work=40_000)


#: Cells of a chunk: 600 chunks for runs that are killed, 60 for those whose chunks are damaged.
SMALL, CELLS = 400, 4000

#: Longest that a run may take to begin, to answer or to end.
PATIENCE = 300.0

#: All variables of a file, or of all files of a folder, bit for bit, and all attributes but its history.
Values: TypeAlias = dict[str, bytes]

#: A kind of fault.
Fault: TypeAlias = Callable[[Path, random.Random, str], int]

#: Runs a command in chunks of a given size.
COMMAND = """
import sys
from slipsweep.grid import chunks
from slipsweep.runs import solving
chunks.CHUNK_CELLS = int(sys.argv[1])
solving.cells_shared = lambda plan, workers: solving.default_cells(plan)
from slipsweep.cli import main
sys.exit(main(sys.argv[2:]))
"""


class Stop(BaseException):
    """Ends a run in this process."""


def run(path: Path, text: str = SWEEP, **options: Any) -> store.Report:
    """`store.run` in this process."""
    return store.run(sweep_job(spec.parse(text, "a.toml")), path, command="x", **{"chunk_cells": CELLS, **options})


def values(path: Path) -> Values:
    """All variables of a file or a store, bit for bit, and all attributes but its history."""
    if path.is_dir():
        return store_values(path)
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        found = {name: np.asarray(variable[...]).tobytes() for name, variable in file.variables.items()}
        owners: list[tuple[str, Any]] = [("", file), *file.variables.items()]
        for owner, described in owners:
            found |= {f"{owner}@{name}": repr(described.getncattr(name)).encode() for name in described.ncattrs()}
        assert found.pop("@history").endswith(b"'"), "a history that cannot be read"
        del found[f"@{RUN}"]  # tells how the run was cut into chunks
        return found


def store_values(path: Path) -> Values:
    """The same of a store, as another program reads it."""
    import zarr

    group = zarr.open_group(path, mode="r")
    found = {name: np.asarray(array[...]).tobytes() for name, array in group.arrays()}
    owners: list[tuple[str, Any]] = [("", group), *group.arrays()]
    for owner, described in owners:
        found |= {f"{owner}@{name}": repr(value).encode() for name, value in described.attrs.asdict().items()}
    del found["@history"], found[f"@{RUN}"]
    return found


def stopping(after: int) -> solving.Solved:
    """What solves some chunks and then stops the run."""

    def solved(*arguments: Any) -> Iterator[Any]:
        for count, item in enumerate(solving.solve_here(*arguments)):
            if count == after:
                raise Stop
            yield item

    return solved


def counting(numbers: list[int]) -> solving.Solved:
    """What solves chunks and notes their numbers."""

    def solved(*arguments: Any) -> Iterator[Any]:
        for item in solving.solve_here(*arguments):
            numbers.append(item[0])
            yield item

    return solved


def stopped(path: Path, after: int = 30, **options: Any) -> Path:
    """Stop a run in this process after some chunks; return its work folder."""
    try:
        run(path, solved=stopping(after), **options)
    except Stop as caught:
        notes = caught.__notes__
    else:
        raise AssertionError("not stopped")
    number = 3 if "text" in options else 60
    assert notes == [f"{after} of {number} chunks are kept; go on with --resume"]
    return path.with_name(f"{path.name}.parts")


def start(folder: Path, asked: Asked, *options: str, **more: Any) -> "subprocess.Popen[str]":
    """Start a command in small chunks as a process."""
    (folder / "a.toml").write_text(asked.text)
    command = [sys.executable, "-c", COMMAND, str(asked.work or SMALL), *asked.command, "-o", asked.output, *options]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **more
    )  # fmt: skip


def ended(process: "subprocess.Popen[str]") -> tuple[int, str]:
    """Exit status of a process, and its one line of words, if any."""
    errors = process.communicate(timeout=PATIENCE)[1]
    assert errors.count("\n") <= 1, errors
    assert errors == "" or errors.startswith("slipsweep: "), errors
    return process.returncode, errors


def wait_for(process: "subprocess.Popen[str]", happened: Callable[[], bool]) -> None:
    """Wait until something has happened or the process has ended."""
    end = time.monotonic() + PATIENCE
    while process.poll() is None and not happened():
        assert time.monotonic() < end, "nothing happens"
        time.sleep(0.002)


def wait_for_chunk(process: "subprocess.Popen[str]", folder: Path, asked: Asked, chunks: int = 1) -> None:
    """Wait until a run that is not resumed has some chunks on record."""
    journal = folder / asked.journal
    wait_for(process, lambda: journal.exists() and journal.read_text().count("\n") >= chunks)


@contextmanager
def held(process: "subprocess.Popen[str]") -> Iterator[None]:
    """Hold a process where it is."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


def whole(asked: Asked) -> Values:
    """What a command gives that nothing happens to, whatever its chunks."""
    return _whole(replace(asked, work=None))


@cache
def _whole(asked: Asked) -> Values:
    with tempfile.TemporaryDirectory() as folder:
        carry_out(Path(folder), asked)
        return values(Path(folder) / asked.output)


def carry_out(folder: Path, asked: Asked, *options: str) -> None:
    """Run a command to its end in this process, which takes no second to start."""
    (folder / "a.toml").write_text(asked.text)
    done = command(folder, *asked.command, "-o", asked.output, *options)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def go_on(folder: Path, asked: Asked) -> None:
    """Go on to the end, undisturbed: the result is the undisturbed one, and nothing else is left."""
    # also where the run before was killed when all was done
    carry_out(folder, asked, "--resume")
    assert values(folder / asked.output) == whole(asked)
    assert {entry.name for entry in folder.iterdir()} == {"a.toml", asked.output}


# ------------------------------------------------------------------------------------- killed


def signalled(folder: Path, rng: random.Random, number: signal.Signals, asked: Asked) -> int:
    """End runs at random moments, three times in a row."""
    journal = folder / asked.journal
    faults = 0
    for _ in range(3):
        before = journal.stat().st_mtime_ns if journal.exists() else None
        process = start(folder, asked, "--resume")

        def begun(before: int | None = before) -> bool:
            if number == signal.SIGKILL:  # it may come at any moment
                return journal.parent.exists()
            # Ctrl-C while Python still imports is not ours to answer
            return journal.exists() and journal.stat().st_mtime_ns != before

        wait_for(process, begun)
        time.sleep(rng.uniform(0.0, 0.6))
        process.send_signal(number)
        status, errors = ended(process)
        assert status in (0, 2, -number, 128 + number), errors
        if status == 0:
            break
        if errors == "" and (folder / asked.output).exists() and not journal.parent.exists():
            break  # it came when all was done, and Python was ending
        faults += 1
        if number != signal.SIGKILL:
            assert errors.startswith("slipsweep: interrupted; "), (status, errors)
    go_on(folder, asked)
    return faults


def killed(folder: Path, rng: random.Random, output: str) -> int:
    """Kill −9 at random moments."""
    return signalled(folder, rng, signal.SIGKILL, sweep_of(output))


def interrupted(folder: Path, rng: random.Random, output: str) -> int:
    """Ctrl-C or SIGTERM at random moments."""
    return signalled(folder, rng, rng.choice([signal.SIGINT, signal.SIGTERM]), sweep_of(output))


def samples_killed(folder: Path, rng: random.Random, output: str) -> int:
    """Kill −9 at random moments, of statistics under uncertain inputs."""
    return signalled(folder, rng, signal.SIGKILL, samples(output))


def limits_killed(folder: Path, rng: random.Random, output: str) -> int:
    """Kill −9 at random moments, of limit amplitudes."""
    return signalled(folder, rng, signal.SIGKILL, limits(output))


def children(pid: int) -> list[int]:
    """Worker processes of a run (Linux)."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == pid and b"spawn_main" in (entry / "cmdline").read_bytes():
                found.append(int(entry.name))
        except (OSError, ValueError, IndexError):
            continue
    return found


def worker_killed(folder: Path, rng: random.Random, output: str) -> int:
    """Kill −9 of a worker of --workers 2, which writes a store's chunks itself: the run goes on."""
    asked = Asked(output, work=6 * SMALL)  # 100 chunks: each costs the cluster some milliseconds of its own
    process = start(folder, asked, "--workers", "2")
    wait_for_chunk(process, folder, asked, rng.randrange(1, 50))
    workers = children(process.pid)
    if process.poll() is None and workers:
        os.kill(rng.choice(workers), signal.SIGKILL)
    assert ended(process) == (0, "")
    assert values(folder / output) == whole(asked)
    return min(1, len(workers))


def killed_with_workers(folder: Path, rng: random.Random, output: str) -> int:
    """Kill −9 of a run with --workers 2: no worker is left, and the run can be gone on with."""
    asked = Asked(output)
    process = start(folder, asked, "--workers", "2")
    wait_for_chunk(process, folder, asked, rng.randrange(1, 300))
    workers = children(process.pid)
    process.kill()
    process.communicate(timeout=PATIENCE)
    end = time.monotonic() + PATIENCE
    while any(Path(f"/proc/{worker}/cmdline").exists() and _alive(worker) for worker in workers):
        assert time.monotonic() < end, "workers outlive the run"
        time.sleep(0.05)
    go_on(folder, asked)
    return 1


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


# -------------------------------------------------------------------------------- disk and rights


@contextmanager
def small_file_system(folder: Path) -> Iterator[Path]:
    """A file system of 8 MB of its own (Linux, as root)."""
    place = folder / "small"
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(place)], check=True, capture_output=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)
        place.rmdir()


def full_file_system(folder: Path, rng: random.Random, output: str) -> int:
    """A file system that is full in the middle of a run, still full on --resume, and then no longer."""
    asked = Asked(output)
    with small_file_system(folder) as place:
        process = start(place, asked)
        wait_for_chunk(process, place, asked, rng.randrange(1, 200))
        with held(process):
            with (place / "ballast").open("wb", buffering=0) as ballast:
                try:
                    while True:
                        ballast.write(bytes(4096))
                except OSError:
                    pass
            kept = (place / asked.journal).read_text().count("\n")
        status, errors = ended(process)
        assert (status, "chunks are kept; go on with --resume" in errors) == (1, True), errors
        assert "is the disk full?" in errors
        status, errors = ended(start(place, asked, "--resume"))
        assert status in (1, 2), errors
        (place / "ballast").unlink()
        assert (place / asked.journal).read_text().count("\n") >= kept
        go_on(place, asked)
    return 2


#: Bytes beyond which writing fails: of the file, which has 2.4 million, or of the journal of 600 lines.
LIMITED = {"a.nc": (100_000, 2_000_000), "a.zarr": (8_000, 18_000)}


def limited_file_size(folder: Path, rng: random.Random, output: str) -> int:
    """Writing that fails from some byte of a file on (RLIMIT_FSIZE), from the beginning and on --resume."""
    import resource

    asked = Asked(output)

    def limit() -> None:
        bytes_allowed = rng.randrange(*LIMITED[output])
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_allowed, bytes_allowed))

    status, errors = ended(start(folder, asked, preexec_fn=limit))
    assert (status, "writing failed" in errors) == (1, True), errors
    if not (folder / asked.journal).exists():  # not even an empty file could be made
        process = start(folder, asked)
        wait_for_chunk(process, folder, asked, rng.randrange(1, 200))
        process.kill()
        ended(process)
    kept = (folder / asked.journal).read_text().count("\n")
    status, errors = ended(start(folder, asked, "--resume", preexec_fn=limit))
    assert (status, "chunks are kept; go on with --resume" in errors) == (1, True), errors
    assert (folder / asked.journal).read_text().count("\n") >= kept
    go_on(folder, asked)
    return 2


#: Goes on with a run as a user who is not root, for whom rights to one path after the other are taken
#: away.  What it needs is imported, and its kernels are loaded, while root can still read them.
_REVOKING = """
import contextlib, io, json, os, sys, tempfile
from pathlib import Path
from slipsweep.grid import chunks
from slipsweep.cli import main
text, output = Path("a.toml").read_text(), sys.argv[1]
with tempfile.TemporaryDirectory() as folder:
    Path(folder, "a.toml").write_text(text)
    assert main(["run", f"{folder}/a.toml", "-o", f"{folder}/{output}", "-q"]) == 0
if os.getuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
chunks.CHUNK_CELLS = int(sys.argv[2])
for name, mode in json.loads(sys.argv[3]):
    path = Path(name)
    before = path.stat().st_mode
    path.chmod(mode)
    with contextlib.redirect_stderr(io.StringIO()) as errors:
        status = main(["run", "a.toml", "-o", output, "--resume", "-q"])
    path.chmod(before)
    print(json.dumps([name, status, errors.getvalue(), Path(f"{output}.parts/journal").read_text()]), flush=True)
"""


def revoked_rights(folder: Path, rng: random.Random, output: str) -> int:
    """Rights to the output's folder, the work folder and what is in it taken away from a user who is not root."""
    asked = Asked(output)
    (folder / "a.toml").write_text(SWEEP)
    parts = stopped(folder / output, rng.randrange(5, 55))
    kept = (parts / "journal").read_text()
    if os.getuid() == 0:
        for path in (folder, folder / "a.toml", parts, *parts.rglob("*")):
            os.chown(path, 65534, 65534)
    # a journal that can only be read is no obstacle: it is replaced
    modes = [(".", 0o500), (f"{asked.folder}/manifest.json", 0), (asked.journal, 0)]
    modes += [(name, mode) for name in (asked.folder, f"{asked.folder}/lock", asked.data) for mode in (0o400, 0)]
    rng.shuffle(modes)
    done = subprocess.run(
        [sys.executable, "-c", _REVOKING, output, str(SMALL), json.dumps(modes)],
        cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    for line in done.stdout.splitlines():
        name, status, errors, journal = json.loads(line)
        assert status in (1, 2), (name, errors)
        assert errors.startswith("slipsweep: error: "), (name, errors)
        assert errors.count("\n") == 1, errors
        assert journal == kept, name
    assert len(done.stdout.splitlines()) == len(modes)
    go_on(folder, asked)
    return len(modes)


# ------------------------------------------------------------------------------------- damaged


def spoil(victim: Path, rng: random.Random) -> None:
    """Flip bits of a file, overwrite bytes, cut some off, or remove it."""
    content = bytearray(victim.read_bytes())
    kind = rng.choice(["flip", "overwrite", "cut", "remove"])
    if kind == "flip":
        for _ in range(rng.choice([1, 1, 10])):
            content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    elif kind == "overwrite":
        at, length = rng.randrange(len(content)), rng.randrange(1, 5000)
        content[at : at + length] = rng.randbytes(len(content[at : at + length]))
    elif kind == "cut":
        del content[rng.randrange(len(content)) :]
    if kind == "remove":
        victim.unlink()
    else:
        victim.write_bytes(content)


def damaged(folder: Path, rng: random.Random, output: str) -> int:
    """Flipped bits, bytes overwritten, cut off, or files that are gone, in what a stopped run left."""
    path, expected = folder / output, whole(Asked(output))
    split = path.suffix == ".nc" and rng.random() < 0.4
    parts = stopped(path, rng.randrange(1, 60), split=split)
    data = parts / ("data" if split else f"data{path.suffix}")
    files = sorted(one for one in data.rglob("*") if one.is_file()) if data.is_dir() else [data] * 4
    spoil(rng.choice([*files, parts / "journal", parts / "manifest.json"]), rng)
    refused = ""
    try:
        run(path, split=split, resume=True)
    except InputError as error:
        refused = str(error)
    if refused:
        assert "manifest.json: damaged or missing" in refused
        run(path, split=split, overwrite=True)
    assert not parts.exists()
    if split:
        assert joined(path) == {name: expected[name] for name in joined(path)}
        run(folder / "b.nc", split=True)
        for file in path.iterdir():
            assert values(file) == values(folder / "b.nc" / file.name), file.name
    else:
        assert values(path) == expected
    return 1


def joined(path: Path) -> Values:
    """The results in a folder of chunks, put together."""
    import xarray as xr

    with xr.open_mfdataset(str(path / "*.nc"), combine="by_coords", mask_and_scale=False) as dataset:
        return {str(name): dataset[name].values.tobytes() for name in dataset.data_vars}


# ---------------------------------------------------------------------------------- competitors


def competitor(folder: Path, rng: random.Random, output: str) -> int:
    """A second run at one output, while the first is at some chunk."""
    asked = Asked(output)
    process = start(folder, asked)
    wait_for_chunk(process, folder, asked, rng.randrange(1, 300))
    with held(process):
        status, errors = ended(start(folder, asked, *rng.choice([(), ("--resume",), ("--overwrite",)])))
        assert (status, "another run is writing it" in errors) == (1, True), errors
    assert ended(process) == (0, "")
    assert values(folder / output) == whole(asked)
    return 1


def rival(folder: Path, rng: random.Random, output: str) -> int:
    """Another program that makes the output in the meantime."""
    asked = Asked(output)
    process = start(folder, asked)
    wait_for_chunk(process, folder, asked, rng.randrange(1, 300))
    with held(process):
        (folder / output).write_text("rival")
    status, errors = ended(process)
    assert (status, "was made by another process" in errors) == (1, True), errors
    assert (folder / output).read_text() == "rival"
    (folder / output).unlink()
    go_on(folder, asked)
    return 1


#: Kinds of faults, in words.
FAULTS: dict[str, Fault] = {
    "killed (SIGKILL) at a random moment": killed,
    "the same of statistics under uncertain inputs": samples_killed,
    "the same of limit amplitudes": limits_killed,
    "interrupted (SIGINT, SIGTERM) at a random moment": interrupted,
    "a worker of `--workers 2` killed": worker_killed,
    "a run with `--workers 2` killed": killed_with_workers,
    "file system full during the run and on `--resume`": full_file_system,
    "writing fails beyond some byte (RLIMIT_FSIZE), likewise": limited_file_size,
    "rights revoked (folders, data, journal, manifest, lock)": revoked_rights,
    "bits flipped, bytes overwritten, cut off, files removed": damaged,
    "a second run at the same output": competitor,
    "the output made by another program meanwhile": rival,
}


def can_be_done(name: str) -> str:
    """Why a kind of fault cannot be done here, or nothing."""
    if os.name != "posix":
        return "signals, limits and rights the POSIX way"
    fault = FAULTS[name]
    if fault is full_file_system and (sys.platform != "linux" or os.getuid() != 0 or not shutil.which("mount")):
        return "only root mounts a small file system, on Linux"
    if fault in (worker_killed, killed_with_workers) and not Path("/proc/self/stat").exists():
        return "finds the workers in /proc"
    if fault is revoked_rights and os.getuid() == 0:
        if sys.platform != "linux":
            return "root gives its rights away as on Linux"
        installed = (Path(sys.prefix), Path(store.__file__).parents[1])
        if any(folder.stat().st_mode & 0o5 != 0o5 for path in installed for folder in (path, *path.parents)):
            return "root gives its rights away, and others may not read this installation"
    return ""


def rounds(name: str, folder: Path, seed: int, count: int, output: str) -> int:
    """Do some rounds of a kind; how many faults were done (all survived, or this fails)."""
    done = 0
    for number in range(count):
        place = folder / f"{list(FAULTS).index(name)}-{number}"
        place.mkdir(mode=0o755)
        done += FAULTS[name](place, random.Random(f"{seed} {name} {number}"), output)
        shutil.rmtree(place)
    return done
