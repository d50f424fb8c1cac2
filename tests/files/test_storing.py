"""A run writes the same bits whole and in chunks, in netCDF and Zarr, here and on workers."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr

from slipsweep.errors import InputError
from slipsweep.files import running, spec
from slipsweep.files.jobs import sweep_job
from slipsweep.files.opening import read_result
from slipsweep.studies.result_counts import tally_of
from tests.support.stored_runs import STUDIES, WAVE, assert_same_result, job_of, run, values_of


def run_in_chunks(
    folder: Path, study: str, output: str, monkeypatch: pytest.MonkeyPatch
) -> running.Report:
    job = job_of(folder, study)
    monkeypatch.setattr(running, "CHUNK_CELLS", int(8 * job.plan.cost) + 1)
    return run(job, folder / output)


@pytest.mark.parametrize("output", ["b.nc", "b.zarr"])
@pytest.mark.parametrize("study", [*STUDIES, "limits"])
def test_a_run_in_chunks_writes_the_same_result(
    folder: Path, study: str, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(job_of(folder, study), folder / "a.nc")
    run_in_chunks(folder, study, output, monkeypatch)
    assert_same_result(folder / output, folder / "a.nc")
    assert not list(folder.glob("*.part"))


@pytest.mark.parametrize("output", ["b.nc", "b.zarr"])
@pytest.mark.parametrize("study", [*STUDIES, "limits"])
def test_modes_and_flags_are_counted_alike_whole_in_chunks_and_in_the_file(
    folder: Path, study: str, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run(job_of(folder, study), folder / "a.nc").tally
    chunks = run_in_chunks(folder, study, output, monkeypatch).tally
    file = tally_of(read_result(folder / "a.nc"))
    assert chunks.modes == whole.modes == file.modes
    assert chunks.flags == whole.flags == file.flags
    assert file.cells == whole.cells


@pytest.mark.parametrize("study", STUDIES)
def test_a_result_repeats_its_run(folder: Path, study: str) -> None:
    run(job_of(folder, study), folder / "a.zarr")
    run(sweep_job(spec.load(folder / "a.zarr")), folder / "b.nc")
    np.testing.assert_equal(values_of(folder / "b.nc"), values_of(folder / "a.zarr"))


@pytest.fixture
def compressed(folder: Path) -> Path:
    """A sweep file that asks for compression."""
    path = folder / "compressed.toml"
    path.write_text(STUDIES["sweep"] + "compression = 4\n")
    return path


def test_a_file_in_chunks_is_compressed(
    folder: Path, compressed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "CHUNK_CELLS", 12)
    run(sweep_job(spec.load(compressed)), folder / "a.nc")
    run(job_of(folder, "sweep"), folder / "b.nc")
    with xr.open_dataset(folder / "a.nc") as data, xr.open_dataset(folder / "b.nc") as plain:
        xr.testing.assert_equal(data, plain)
        assert data.validity.encoding["zlib"]
        assert data.validity.encoding["complevel"] == 4
        assert data.attrs["history"].endswith(" slipsweep run")


def test_a_store_is_compressed(folder: Path, compressed: Path) -> None:
    run(sweep_job(spec.load(compressed)), folder / "a.zarr")
    group: Any = zarr.open_group(folder / "a.zarr", mode="r")
    (codec,) = group["permanent_displacement"].compressors
    assert codec.to_dict()["configuration"]["level"] == 4


@pytest.mark.parametrize("workers", [0, 1, 4])
def test_chunks_on_the_way_from_workers_count_as_memory(folder: Path, workers: int) -> None:
    """Each worker solves one and two wait for it, beside two here; never more than asked for."""
    plan = job_of(folder, "sweep").plan
    results = sum(np.dtype(dtype).itemsize for dtype in job_of(folder, "sweep").dtypes.values())
    base = running.BASE_MEMORY + workers * running._WORKER_MEMORY
    for memory in (base + 10**8, base + 10**9):
        most = running.most_cells(plan, memory, workers)
        taken = base + most * (2 + 3 * workers) * results
        assert 0.7 * memory < taken + 8 * most <= memory


@pytest.mark.parametrize("name", ["a.nc", "a.zarr"])
def test_a_result_that_no_disk_holds_is_refused(folder: Path, name: str) -> None:
    text = WAVE.replace("num = 4", "num = 9000000").replace("[0.5, 1, 2]", "[0.5, 1]")
    text = text.replace("mu_s.values = [0.3, 0.5]", "mu_s = {start = 0.3, stop = 1, num = 900000}")
    (folder / "large.toml").write_text(text)
    with pytest.raises(InputError, match=rf"{name}: takes .*TB, but .* are free on the disk"):
        run(job_of(folder, "large"), folder / name)
    assert not [*folder.glob(f"{name}*")]


def test_too_little_memory_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match=r"--memory = 100 MB: must be .* at least"):
        run(job_of(folder, "sweep"), folder / "a.nc", memory=100_000_000)


#: Runs the command in a process, and prints its memory at the peak, kB: that of getrusage begins
#: with the memory of its parent.
PEAK_MEMORY = """
import sys
from pathlib import Path
from slipsweep.cli import main
assert not main(["run", "a.toml", "-o", sys.argv[1], "-q", "--memory", "460MB"])
print(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
"""


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="asks Linux for the memory of a process"
)
@pytest.mark.parametrize("output", ["a.nc", "a.zarr"])
def test_a_run_takes_the_memory_asked_for_and_a_tenth_more_at_most(
    folder: Path, output: str
) -> None:
    frequencies = [0.01 * i + 1 for i in range(600)]
    text = WAVE.replace("num = 4", "num = 2000").replace("[0.5, 1, 2]", str(frequencies))
    (folder / "a.toml").write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", PEAK_MEMORY, output],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) * 1024 < 1.1 * 460e6
    how: Any = {"engine": "zarr", "consolidated": False} if output.endswith("zarr") else {}
    with xr.open_dataset(folder / output, mask_and_scale=False, **how) as file:
        assert (file.validity.dtype, file.sliding_mode.dtype) == ("int16", "int8")
        # of a store: half a million cells, about, are read at once, not thousands of small chunks
        assert output == "a.nc" or 250_000 < math.prod(file.validity.encoding["chunks"]) < 1_000_000


@pytest.mark.parametrize("output", ["w.nc", "w.zarr"])
def test_workers_give_the_same_bits(folder: Path, output: str) -> None:
    run(job_of(folder, "sweep"), folder / "a.nc")
    run(job_of(folder, "sweep"), folder / output, workers=1)
    assert_same_result(folder / output, folder / "a.nc")


def test_a_store_at_an_address_has_the_same_result(folder: Path) -> None:
    address = "memory://bucket/address.zarr"
    run(job_of(folder, "sweep"), address)
    run(job_of(folder, "sweep"), folder / "a.nc")
    assert_same_result(address, folder / "a.nc")
    assert not list(Path().glob(".address*"))


def test_a_store_at_an_address_is_found_complete(folder: Path) -> None:
    address = "memory://bucket/complete.zarr"
    run(job_of(folder, "sweep"), address)
    assert run(job_of(folder, "sweep"), address, resume=True).was_complete


def test_an_address_of_an_unknown_protocol_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere://a/b\.zarr: Protocol not known: nowhere"):
        run(job_of(folder, "sweep"), "nowhere://a/b.zarr")


@pytest.mark.parametrize(
    ("cluster", "message"),
    [
        ({"workers": 0}, "must be from 1 to"),
        ({"workers": 2, "scheduler": "a:1"}, "give one of"),
    ],
)
def test_no_cluster_and_two_clusters_are_refused(
    folder: Path, cluster: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        run(job_of(folder, "sweep"), folder / "a.nc", **cluster)
