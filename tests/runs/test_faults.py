"""Faults in the middle of a run: whatever is done to it, --resume ends in the undisturbed result or in one message."""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import filelock
import netCDF4
import numpy as np
import pytest
import xarray as xr

from slipsweep import Step
from slipsweep.errors import InputError, RunError
from slipsweep.files import outputs, spec
from slipsweep.files.checksums import checksum
from slipsweep.runs import parts, store
from slipsweep.runs.jobs import sweep_job
from slipsweep.runs.targets import onefile, splitfiles
from tests.support import fault_rounds
from tests.support.fault_rounds import SWEEP, run, stopped, values


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    path = tmp_path_factory.mktemp("undisturbed") / "a.nc"
    run(path, chunk_cells=10**9)
    return values(path)


def solved_on_resume(path: Path, **options: Any) -> list[int]:
    """Go on with a run; return the numbers of the chunks that had to be solved."""
    numbers: list[int] = []
    run(path, resume=True, solved=fault_rounds.counting(numbers), **options)
    assert not path.with_name(f"{path.name}.parts").exists()
    return numbers


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that another user can reach, which those of pytest are not."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def test_nothing_is_computed_twice(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    stopped(tmp_path / "a.nc")
    with pytest.raises(InputError, match="holds 30 finished chunks of an interrupted run; go on with --resume"):
        run(tmp_path / "a.nc")
    assert solved_on_resume(tmp_path / "a.nc") == list(range(30, 60))
    assert values(tmp_path / "a.nc") == undisturbed


@pytest.mark.parametrize("fault", ["flipped bit", "truncated", "deleted", "header", "journal torn", "journal lost"])
def test_damaged_chunks_are_solved_anew(tmp_path: Path, undisturbed: dict[str, bytes], fault: str) -> None:
    folder = stopped(tmp_path / "a.nc")
    data, journal = folder / "data.nc", folder / "journal"
    size = data.stat().st_size
    content = data.read_bytes()
    expected = list(range(60))
    if fault == "flipped bit":
        with netCDF4.Dataset(data) as file:
            # the displacement of the first row of chunk 7
            row = np.asarray(file["permanent_displacement"][3, 10, 39, :]).tobytes()
        at = content.index(row)
        data.write_bytes(content[:at] + bytes([content[at] ^ 16]) + content[at + 1 :])
        expected = [7, *range(30, 60)]
    elif fault == "truncated":
        # the last variable is cut off, and with it a part of every chunk
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


@pytest.mark.parametrize("split", [False, True])
def test_what_is_no_result_is_compared_bit_by_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, split: bool) -> None:
    """Attributes, fill values, coordinates, the sweep's text: a flipped bit anywhere between the results is found."""
    monkeypatch.setattr(store, "history_of", lambda command: command)  # else the time of the run
    run(tmp_path / "whole", split=split)
    folder = stopped(tmp_path / "a", split=split)
    saved = shutil.copytree(folder, tmp_path / "saved")
    victim = folder / "data" / "chunk-000007.nc" if split else folder / "data.nc"
    content = victim.read_bytes()
    work = parts.Folder(tmp_path / "a")
    work.read()
    assert work.manifest is not None
    outside = np.ones(len(content), bool)
    if (layout := work.manifest.layout) is not None:
        for name, offset in layout.offsets.items():
            outside[offset : offset + layout.lengths[name]] = False
    chosen = np.random.default_rng(3).choice(np.flatnonzero(outside), 6)
    for at in (*chosen, content.index(b"Conventions")):
        shutil.copytree(saved, folder, dirs_exist_ok=True)
        victim.write_bytes(content[:at] + bytes([content[at] ^ 4]) + content[at + 1 :])
        # the file is made anew, with all that is in it
        solved = solved_on_resume(tmp_path / "a", split=split)
        assert solved == ([7, *range(30, 60)] if split else [*range(60)]), at
        for made, expected in zip(files(tmp_path / "a"), files(tmp_path / "whole"), strict=True):
            assert made.read_bytes() == expected.read_bytes(), (at, made.name)
        shutil.rmtree(tmp_path / "a") if split else (tmp_path / "a").unlink()


def files(path: Path) -> list[Path]:
    """A file, or those of a folder."""
    return sorted(path.iterdir()) if path.is_dir() else [path]


def test_a_journal_that_ends_anywhere_promises_its_whole_lines_only(tmp_path: Path) -> None:
    folder = parts.Folder(tmp_path / "a.nc")
    folder.path.mkdir()
    manifest = parts.Manifest(parts.identity({"sweep file": SWEEP}, {}), 4000, False, "now", {}, {})
    sums = {
        number: checksum({"a": np.arange(9.0) * number, "b": np.full((3, 2), number, np.int8)}) for number in (0, 7, 12)
    }
    with parts.opened(tmp_path / "a.nc") as work:
        work.clear()
        work.begin(manifest)
        for number, digest in sums.items():
            work.add(number, digest)
    journal = folder.path / "journal"
    content = journal.read_text()
    for end in range(len(content) + 1):
        journal.write_text(content[:end])
        read = parts.Folder(tmp_path / "a.nc")
        read.read()
        assert read.finished == dict(list(sums.items())[: content[:end].count("\n")])


def test_every_changed_bit_changes_the_checksum() -> None:
    arrays: dict[str, np.ndarray] = {"a": np.linspace(0, 1, 40), "b": np.arange(40, dtype=np.int16)}
    expected = checksum(arrays)
    for name, array in arrays.items():
        for at in range(8 * array.nbytes):
            content = bytearray(array.tobytes())
            content[at // 8] ^= 1 << at % 8
            assert checksum(arrays | {name: np.frombuffer(content, array.dtype)}) != expected
    assert checksum({"b": arrays["b"], "a": arrays["a"]}) != expected
    assert checksum({"a": arrays["a"].view(np.int64), "b": arrays["b"]}) != expected


def test_chunks_of_a_version_with_other_checksums_are_refused(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    path = tmp_path / "a.nc"
    folder = stopped(path)
    content = json.loads((folder / "manifest.json").read_text().partition("\n")[2])
    del content["identity"]["checksums"]
    text = json.dumps(content)
    (folder / "manifest.json").write_text(f"{hashlib.sha256(text.encode()).hexdigest()}\n{text}")
    (folder / "journal").write_text("".join(f"{number} {'0f' * 32}\n" for number in range(30)))
    before = {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.name != "lock"}
    with pytest.raises(InputError, match="holds 30 finished chunks of an interrupted run"):
        run(path)
    with pytest.raises(InputError, match=r"cannot go on with the chunks in .*: checksums was none, is XXH3-128"):
        run(path, resume=True)
    assert before == {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.name != "lock"}


@pytest.mark.parametrize("split", [False, True])
def test_chunks_are_brought_to_the_disk_before_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: dict[str, bytes], split: bool
) -> None:
    whole = tmp_path / "a.nc"
    run(whole, split=split)
    monkeypatch.setattr(store, "_SYNC_SECONDS", 0)
    synced: list[str] = []
    sync = outputs.sync

    def noted(path: Path) -> None:
        synced.append(path.name)
        sync(path)

    for module in (onefile, splitfiles, parts):
        monkeypatch.setattr(module, "sync", noted)
    run(tmp_path / "b.nc", split=split)
    # each chunk, and after it the journal that tells of it
    names = [name for name in synced if name == "journal" or name.endswith((".nc", ".tmp"))]
    names = [name for name in names if name != "manifest.json.tmp" and name != "journal.tmp"]
    if split:
        assert [name for name in names if name != "journal"] == [f"chunk-{number:06}.tmp" for number in range(60)]
        assert names.count("journal") >= 60
    else:
        assert names[:121] == ["data.nc", *60 * ["data.nc", "journal"]]
    if not split:
        assert values(tmp_path / "b.nc") == undisturbed
    else:
        for name in sorted(entry.name for entry in whole.iterdir()):
            assert values(tmp_path / "b.nc" / name) == values(whole / name)


def test_chunks_of_another_sweep_are_refused_with_the_difference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: dict[str, bytes]
) -> None:
    path = tmp_path / "a.nc"
    folder = stopped(path)
    before = {entry.name: entry.read_bytes() for entry in folder.iterdir() if entry.name != "lock"}
    with pytest.raises(InputError, match="the sweep file differs: line 4 was 'stop = 20', is 'stop = 21'"):
        run(path, SWEEP.replace("stop = 20\nnum = 30", "stop = 21\nnum = 30"), resume=True)
    with pytest.raises(InputError, match=r"solver was Cycle\(\), is Step\("):
        store.run(sweep_job(spec.parse(SWEEP, "a").with_solver(Step())), path, command="x", resume=True)
    with pytest.raises(InputError, match="--split was False, is True"):
        run(path, resume=True, split=True)
    with pytest.raises(InputError, match="--memory: too little for the chunks of 4000 cells"):
        run(path, resume=True, chunk_cells=3000)
    with monkeypatch.context() as other:
        other.setattr(parts.sources, "keys", lambda: parts.sources.Keys("other", "other"))
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
    edited = json.loads(content) | {"chunk_cells": 4001}
    manifest.write_text(f"{head}\n{json.dumps(edited)}")
    with pytest.raises(InputError, match=r"manifest.json: damaged or missing: .* start again with --overwrite"):
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
        killed.setattr(parts.Folder, "remove", lambda folder: None)
        first = run(path, split=split)
    assert (tmp_path / "a.parts").exists()
    again = run(path, split=split, resume=True)
    assert again.tally == first.tally
    assert {entry.name for entry in tmp_path.iterdir()} == {"a"}


def test_split_opens_as_one_dataset_and_resumes(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    folder = stopped(tmp_path / "a", split=True)
    (folder / "data" / "chunk-000003.nc").unlink()
    content = (folder / "data" / "chunk-000007.nc").read_bytes()
    (folder / "data" / "chunk-000007.nc").write_bytes(content[: len(content) // 2])
    assert solved_on_resume(tmp_path / "a", split=True) == [3, 7, *range(30, 60)]
    assert len(list((tmp_path / "a").iterdir())) == 60
    with xr.open_mfdataset(str(tmp_path / "a" / "*.nc"), combine="by_coords", mask_and_scale=False) as dataset:
        assert dataset["permanent_displacement"].chunks is not None  # lazy
        for name in map(str, dataset.variables):
            assert dataset[name].values.tobytes() == undisturbed[name], name


#: Kinds of faults that are done once in every run of the tests, in a format, and what stands in where one cannot be.
OFTEN: dict[fault_rounds.Fault, str] = {
    fault_rounds.killed: "a.nc",
    fault_rounds.interrupted: "a.zarr",
    fault_rounds.worker_killed: "a.zarr",
    fault_rounds.full_file_system: "a.nc",
    fault_rounds.revoked_rights: "a.nc",
    fault_rounds.damaged: "a.zarr",
    fault_rounds.competitor: "a.nc",
}
STANDS_IN: dict[fault_rounds.Fault, fault_rounds.Fault] = {
    fault_rounds.full_file_system: fault_rounds.limited_file_size
}
NAMES = {fault: name for name, fault in fault_rounds.FAULTS.items()}


@pytest.mark.parametrize("fault", OFTEN, ids=lambda fault: fault.__name__)
def test_a_fault_is_survived(folder: Path, fault: fault_rounds.Fault) -> None:
    done = STANDS_IN.get(fault, fault) if fault_rounds.can_be_done(NAMES[fault]) else fault
    if reason := fault_rounds.can_be_done(NAMES[done]):
        pytest.skip(reason)
    assert fault_rounds.rounds(NAMES[done], folder, 7, 1, OFTEN[fault])


@pytest.mark.slow
@pytest.mark.parametrize("output", fault_rounds.OUTPUTS.values())
@pytest.mark.parametrize("name", fault_rounds.FAULTS)
def test_many_faults_are_survived(folder: Path, name: str, output: str) -> None:
    if reason := fault_rounds.can_be_done(name):
        pytest.skip(reason)
    count = 100 if fault_rounds.FAULTS[name] is fault_rounds.damaged else 10
    print(f"{fault_rounds.rounds(name, folder, 7, count, output)} times {name}, {output}: all survived")


def test_a_disk_that_fills_up_keeps_the_finished_chunks(
    tmp_path: Path, undisturbed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    import errno

    write = onefile.OneFile.write

    def full(self: onefile.OneFile, number: int, *arguments: Any) -> str:
        if number == 20:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(self, number, *arguments)

    with monkeypatch.context() as patched:
        patched.setattr(onefile.OneFile, "write", full)
        with pytest.raises(RunError, match=r"No space left on device; is the disk full\?") as caught:
            run(tmp_path / "a.nc")
    assert caught.value.__notes__ == ["20 of 60 chunks are kept; go on with --resume"]
    assert solved_on_resume(tmp_path / "a.nc") == list(range(20, 60))
    assert values(tmp_path / "a.nc") == undisturbed


# ---------------------------------------------------------- what is taken away in the middle


def interrupted(path: Path, monkeypatch: pytest.MonkeyPatch, number: int, fault: Callable[[], object]) -> RunError:
    """The error of a run in which something happens when a chunk is on record."""
    add = parts.Folder.add
    happened: list[int] = []

    def add_and_fail(self: parts.Folder, at: int, digest: str) -> None:
        add(self, at, digest)
        if at == number and not happened:
            happened.append(at)
            fault()

    with monkeypatch.context() as patched:
        patched.setattr(parts.Folder, "add", add_and_fail)
        with pytest.raises(RunError) as caught:
            run(path, split="." not in path.name)
    return caught.value


@pytest.mark.skipif(os.name != "posix", reason="elsewhere what is open cannot be removed")
@pytest.mark.parametrize("name", ["a.nc", "a"])
@pytest.mark.parametrize("at", [10, 59])
def test_a_work_folder_that_is_removed_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, at: int
) -> None:
    """Nothing is kept, and that is said; the disk is not suspected."""
    path = tmp_path / name
    folder = tmp_path / f"{name}.parts"
    error = interrupted(path, monkeypatch, at, lambda: shutil.rmtree(folder))
    assert str(error) == f"{folder}: was removed during the run, and the finished chunks with it; start again"
    assert not hasattr(error, "__notes__")
    assert os.listdir(tmp_path) == []
    run(path, split="." not in name)


@pytest.mark.skipif(os.name != "posix", reason="elsewhere what is open cannot be removed")
@pytest.mark.parametrize("name", ["a.nc", "a"])
def test_another_run_in_the_place_of_one_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The folder is removed and made again: the first run neither writes into the second's nor takes its data."""
    path = tmp_path / name
    folder = tmp_path / f"{name}.parts"
    kept: dict[str, bytes] = {}

    def begin_again() -> None:
        shutil.rmtree(folder)
        stopped(path, split="." not in name)
        kept.update({str(file): file.read_bytes() for file in folder.rglob("*") if file.is_file()})

    error = interrupted(path, monkeypatch, 40, begin_again)
    assert "was removed during the run" in str(error)
    assert not path.exists()
    assert kept == {str(file): file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    run(path, resume=True, split="." not in name)


@pytest.mark.skipif(os.name != "posix", reason="elsewhere what is open cannot be removed")
@pytest.mark.parametrize(("name", "victim"), [("a.nc", "data.nc"), ("a", "data/chunk-000003.nc"), ("a", "data")])
def test_data_that_are_removed_do_not_become_a_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, victim: str
) -> None:
    path = tmp_path / name
    target = tmp_path / f"{name}.parts" / victim
    error = interrupted(path, monkeypatch, 40, lambda: shutil.rmtree(target) if target.is_dir() else target.unlink())
    assert not path.exists()
    assert "is the disk full" not in str(error) or victim == "data"  # all that the netCDF library tells
    if victim != "data/chunk-000003.nc":
        assert not hasattr(error, "__notes__")
    run(path, resume=True, split="." not in name)


#: A block that stays where it is, one that slides, and one so far that 32 bits do not hold it.
FAR = """
[axes.theta]
values = [0, 10, 20]
[axes.mu_s]
values = [0.5]
[axes.amplitude]
values = [3]
[axes.frequency]
values = [1e-20, 1]
[output]
dtype = "float32"
"""


@pytest.mark.parametrize("split", [False, True])
def test_a_number_too_large_for_its_type_keeps_no_chunks(tmp_path: Path, split: bool) -> None:
    """No --resume could finish them."""
    path = tmp_path / "a"
    kept = FAR.replace("1e-20", "0.5")
    stopped(path, after=1, text=kept, chunk_cells=2, split=split)
    run(path, kept, chunk_cells=2, resume=True, split=split)
    with pytest.raises(InputError, match=r"""a\.toml: output\.dtype = "float32": .* must be "float64\"""") as caught:
        run(tmp_path / "b", FAR, chunk_cells=2, split=split)
    assert not hasattr(caught.value, "__notes__")
    stopped(tmp_path / "b", after=1, text=FAR, chunk_cells=2, split=split)
    with pytest.raises(InputError, match=r"output\.dtype"):
        run(tmp_path / "b", FAR, chunk_cells=2, resume=True, split=split)
    assert os.listdir(tmp_path) == ["a"]
