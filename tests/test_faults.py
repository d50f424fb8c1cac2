"""Faults in the middle of a run: whatever is done to it, --resume ends in the undisturbed result or in one message."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import filelock
import netCDF4
import numpy as np
import pytest
import xarray as xr

from slipsweep import blocks, parts, spec, store
from slipsweep.errors import InputError, RunError

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

CELLS = 4000  # 60 blocks


def run(path: Path, text: str = SWEEP, **options: Any) -> store.Report:
    return store.run(spec.parse(text, "a.toml"), path, command="x", **{"block_cells": CELLS, **options})


def values(path: Path) -> dict[str, bytes]:
    """Return all variables of a file, bit for bit."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {name: np.asarray(variable[...]).tobytes() for name, variable in file.variables.items()}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    path = tmp_path_factory.mktemp("undisturbed") / "a.nc"
    run(path, block_cells=10**9)
    return values(path)


class Stop(BaseException):
    pass


def stopped(path: Path, after: int = 30, **options: Any) -> Path:
    """Stop a run after some blocks; return its work folder."""

    def solved(*arguments: object) -> object:
        for count, item in enumerate(blocks.solve_here(*arguments)):  # type: ignore[arg-type]
            if count == after:
                raise Stop
            yield item

    with pytest.raises(Stop) as caught:
        run(path, solved=solved, **options)
    assert caught.value.__notes__ == [f"{after} of 60 blocks are kept; go on with --resume"]
    return path.with_name(f"{path.name}.parts")


def solved_on_resume(path: Path, **options: Any) -> list[int]:
    """Go on with a run; return the numbers of the blocks that had to be solved."""
    numbers = []

    def solved(*arguments: object) -> object:
        for item in blocks.solve_here(*arguments):  # type: ignore[arg-type]
            numbers.append(item[0])
            yield item

    run(path, resume=True, solved=solved, **options)
    assert not path.with_name(f"{path.name}.parts").exists()
    return numbers


def test_nothing_is_computed_twice(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    stopped(tmp_path / "a.nc")
    with pytest.raises(InputError, match="holds 30 finished blocks of an interrupted run; go on with --resume"):
        run(tmp_path / "a.nc")
    assert solved_on_resume(tmp_path / "a.nc") == list(range(30, 60))
    assert values(tmp_path / "a.nc") == undisturbed


@pytest.mark.parametrize("fault", ["flipped bit", "truncated", "deleted", "header", "journal torn", "journal lost"])
def test_damaged_blocks_are_solved_anew(tmp_path: Path, undisturbed: dict[str, bytes], fault: str) -> None:
    folder = stopped(tmp_path / "a.nc")
    data, journal = folder / "data.nc", folder / "journal"
    size = data.stat().st_size
    content = data.read_bytes()
    expected = list(range(60))
    if fault == "flipped bit":
        with netCDF4.Dataset(data) as file:
            # the displacement of the first row of block 7
            row = np.asarray(file["permanent_displacement"][3, 10, 39, :]).tobytes()
        at = content.index(row)
        data.write_bytes(content[:at] + bytes([content[at] ^ 16]) + content[at + 1 :])
        expected = [7, *range(30, 60)]
    elif fault == "truncated":
        # the last variable is cut off, and with it a part of every block
        os.truncate(data, size // 2)
    elif fault == "deleted":
        data.unlink()
    elif fault == "header":
        data.write_bytes(bytes(100) + content[100:])
    elif fault == "journal torn":
        journal.write_text(journal.read_text()[:-20])
        expected = list(range(29, 60))
    else:
        journal.unlink()
    solved = solved_on_resume(tmp_path / "a.nc")
    assert solved == expected or (fault == "truncated" and {*range(30, 60)} < {*solved})
    assert values(tmp_path / "a.nc") == undisturbed


def test_blocks_of_another_sweep_are_refused_with_the_difference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: dict[str, bytes]
) -> None:
    path = tmp_path / "a.nc"
    folder = stopped(path)
    before = {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.name != "lock"}
    with pytest.raises(InputError, match="the sweep file differs: line 4 was 'stop = 20', is 'stop = 21'"):
        run(path, SWEEP.replace("stop = 20\nnum = 30", "stop = 21\nnum = 30"), resume=True)
    with pytest.raises(InputError, match="solver was auto, is step"):
        store.run(spec.parse(SWEEP, "a").with_solver("step"), path, command="x", resume=True)
    with pytest.raises(InputError, match="--split was False, is True"):
        run(path, resume=True, split=True)
    with pytest.raises(InputError, match="--memory: too little for the blocks of 4000 cells"):
        run(path, resume=True, block_cells=3000)
    with monkeypatch.context() as other:
        other.setattr(parts, "numerics", lambda: "other")
        with pytest.raises(InputError, match=r"slipsweep sources was .*, is other"):
            run(path, resume=True)
    # refusing has harmed nothing
    assert before == {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.name != "lock"}
    assert solved_on_resume(path) == list(range(30, 60))
    assert values(path) == undisturbed


def test_an_edited_manifest_is_refused(tmp_path: Path) -> None:
    folder = stopped(tmp_path / "a.nc", 5)
    manifest = folder / "manifest.json"
    head, _, content = manifest.read_text().partition("\n")
    edited = json.loads(content) | {"block_cells": 4001}
    manifest.write_text(f"{head}\n{json.dumps(edited)}")
    with pytest.raises(InputError, match=r"manifest.json: damaged or missing: .* start anew with --overwrite"):
        run(tmp_path / "a.nc", resume=True)
    run(tmp_path / "a.nc", overwrite=True)
    assert {entry.name for entry in tmp_path.iterdir()} == {"a.nc"}


def test_a_second_run_is_refused(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    path = tmp_path / "a.nc"
    stopped(path)
    with filelock.FileLock(tmp_path / "a.nc.parts" / "lock"):
        attempts: list[dict[str, Any]] = [{}, {"resume": True}, {"overwrite": True}]
        for options in attempts:
            with pytest.raises(RunError, match="another run is writing it"):
                run(path, **options)
    solved_on_resume(path)
    assert values(path) == undisturbed


@pytest.mark.parametrize("split", [False, True])
def test_killed_after_the_output_has_its_name(tmp_path: Path, split: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    with monkeypatch.context() as killed:
        killed.setattr(shutil, "rmtree", lambda *arguments, **options: None)
        first = run(path, split=split)
    assert (tmp_path / "a.parts").exists()
    again = run(path, split=split, resume=True)
    assert again.tally == first.tally
    assert {entry.name for entry in tmp_path.iterdir()} == {"a"}


def test_split_opens_as_one_dataset_and_resumes(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    folder = stopped(tmp_path / "a", split=True)
    (folder / "data" / "block-000003.nc").unlink()
    content = (folder / "data" / "block-000007.nc").read_bytes()
    (folder / "data" / "block-000007.nc").write_bytes(content[: len(content) // 2])
    assert solved_on_resume(tmp_path / "a", split=True) == [3, 7, *range(30, 60)]
    assert len(list((tmp_path / "a").iterdir())) == 60
    with xr.open_mfdataset(str(tmp_path / "a" / "*.nc"), combine="by_coords", mask_and_scale=False) as dataset:
        assert dataset["permanent_displacement"].chunks is not None  # lazy
        for name, expected in undisturbed.items():
            assert dataset[name].values.tobytes() == expected, name


def kill_rounds(folder: Path, undisturbed: dict[str, bytes], rounds: int, number: signal.Signals) -> int:
    """Start runs as processes and end each at a random moment, resuming until done; return how many were ended."""
    (folder / "a.toml").write_text(SWEEP)
    seed = random.Random(7)
    code = (
        "import sys; from slipsweep import blocks, store; store.BLOCK_CELLS = 400; "
        "from slipsweep.cli import main; sys.exit(main(['run', 'a.toml', '--resume', '-q']))"
    )
    journal = folder / "a.nc.parts" / "journal"
    ended = 0
    for _ in range(rounds):
        before = journal.stat().st_mtime_ns if journal.exists() else None
        process = subprocess.Popen([sys.executable, "-c", code], cwd=folder, stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 60
        # Ctrl-C while Python still imports is not ours to answer; a kill may come at any moment
        while process.poll() is None and (
            not journal.exists() or (number == signal.SIGINT and journal.stat().st_mtime_ns == before)
        ):
            assert time.monotonic() < end
            time.sleep(0.01)
        time.sleep(seed.uniform(0, 0.4))
        process.send_signal(number)
        errors = process.communicate(timeout=60)[1]
        assert not (folder / "a.nc").exists() or process.returncode in (0, -number, 128 + number)
        if process.returncode == 0:
            break
        ended += 1
        if number == signal.SIGINT:
            assert errors.startswith("slipsweep: interrupted; ")
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode == 2:  # the last one was killed when all was done
        assert "a.nc: exists already" in done.stderr
    assert values(folder / "a.nc") == undisturbed
    assert {entry.name for entry in folder.iterdir()} == {"a.toml", "a.nc"}
    return ended


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT] if os.name == "posix" else [])
def test_killed_at_a_random_moment(tmp_path: Path, undisturbed: dict[str, bytes], number: signal.Signals) -> None:
    assert kill_rounds(tmp_path, undisturbed, 2, number)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT] if os.name == "posix" else [])
def test_killed_many_times(tmp_path: Path, undisturbed: dict[str, bytes], number: signal.Signals) -> None:
    survived = 0
    for attempt in range(10):
        (tmp_path / str(attempt)).mkdir()
        survived += kill_rounds(tmp_path / str(attempt), undisturbed, 5, number)
    print(f"{survived} times ended by {number.name}, {survived} survived")


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files the POSIX way")
def test_a_disk_that_fills_up_keeps_the_finished_blocks(
    tmp_path: Path, undisturbed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    import errno

    write = store._OneFile.write

    def full(self: store._OneFile, number: int, *arguments: object) -> object:
        if number == 20:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(self, number, *arguments)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setattr(store._OneFile, "write", full)
        with pytest.raises(RunError, match=r"No space left on device; is the disk full\?") as caught:
            run(tmp_path / "a.nc")
    assert caught.value.__notes__ == ["20 of 60 blocks are kept; go on with --resume"]
    assert solved_on_resume(tmp_path / "a.nc") == list(range(20, 60))
    assert values(tmp_path / "a.nc") == undisturbed
