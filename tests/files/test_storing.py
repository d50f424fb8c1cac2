"""A run gives the same bits whole and in chunks, in netCDF and Zarr, here and on workers, and after an interruption."""

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import zarr

import slipsweep
from slipsweep.errors import InputError, RunError
from slipsweep.files import running, spec, storing
from slipsweep.files.jobs import Job, limit_job, sweep_job
from slipsweep.files.opening import read_result
from slipsweep.studies.result_counts import tally_of
from tests.support.commands import command
from tests.support.made_up_records import write_motion

GRID = """
[axes]
theta.values = [0, 5, 10]
mu_s.values = [0.3, 0.5]
amplitude = {start = 0.1, stop = 1, num = 4, units = "g"}
"""

WAVE = GRID + "[axes.frequency]\nvalues = [0.5, 1, 2]\n"

#: One of each kind of study.
STUDIES = {
    "sweep": WAVE
    + """
[output]
variables = ["permanent_displacement", "newmark_displacement", "limiting_acceleration", "sliding_mode", "validity"]
""",
    "newmark": WAVE + '[model]\nfriction = "newmark"\n',
    "step": WAVE
    + '[solver]\nmethod = "step"\nsteps_per_cycle = 64\n[excitation]\nwaveform = "triangle"\n',
    "cases": """
cases = [{label = "mild ± slope, wet", theta = 5, amplitude = 3}, {label = "steep", theta = 25, amplitude = 5}]
axes.mu_s.values = [0.3, 0.5, 0.7]
axes.frequency.values = [1, 2]
""",
    "record": GRID + '[excitation]\nrecord = "motions/m1.csv"\nunits = "g"\npolarity = "both"\n',
    "suite": GRID + '[excitation]\nrecords = ["motions/*.csv"]\nunits = "g"\n',
    "samples": WAVE
    + "[uncertainty]\nsamples = 16\ndecay_rate = {distribution = 'lognorm', s = 0.3, scale = 2.0}\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two recorded motions, and a sweep of every kind."""
    (tmp_path / "motions").mkdir()
    write_motion(tmp_path / "motions" / "m1.csv", 3, 80, 0.01)
    write_motion(tmp_path / "motions" / "m2.csv", 4, 60, 0.02)
    for name, text in STUDIES.items():
        (tmp_path / f"{name}.toml").write_text(text)
    return tmp_path


def job_of(folder: Path, study: str) -> Job:
    if study == "limits":
        return limit_job(spec.load(folder / "sweep.toml"), [0.01, 0.1], 8.0)
    return sweep_job(spec.load(folder / f"{study}.toml"))


def stored(job: Job, path: Path | str, **options: Any) -> running.Report:
    return running.run(job, path, command="slipsweep run", **options)


def without_time(table: xr.Dataset) -> xr.Dataset:
    """A result without what tells of one run only."""
    return table.load().assign_attrs(history="")


@pytest.mark.parametrize("output", ["b.nc", "b.zarr"])
@pytest.mark.parametrize("study", [*STUDIES, "limits"])
def test_every_study_runs_every_way(
    folder: Path, study: str, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = job_of(folder, study)
    whole = stored(job, folder / "a.nc")
    monkeypatch.setattr(running, "CHUNK_CELLS", int(8 * job.plan.cost) + 1)
    parts = stored(job_of(folder, study), folder / output)
    one = read_result(folder / "a.nc")
    other = read_result(folder / output)
    xr.testing.assert_identical(without_time(other), without_time(one))
    assert not list(folder.glob("*.part"))
    assert (parts.tally.modes, parts.tally.flags) == (whole.tally.modes, whole.tally.flags)
    again = tally_of(one)
    assert (again.modes, again.flags, again.cells) == (
        whole.tally.modes,
        whole.tally.flags,
        whole.tally.cells,
    )
    # a result repeats its run, and has the values of Python's own functions
    if study != "limits" and output == "b.zarr":
        stored(sweep_job(spec.load(folder / output)), folder / "c.nc")
        np.testing.assert_equal(
            [one.values for one in read_result(folder / "c.nc").data_vars.values()],
            [one.values for one in one.data_vars.values()],
        )


def test_a_file_in_chunks_is_compressed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "CHUNK_CELLS", 12)
    (folder / "a.toml").write_text(STUDIES["sweep"] + "compression = 4\n")
    stored(sweep_job(spec.load(folder / "a.toml")), folder / "a.nc")
    stored(job_of(folder, "sweep"), folder / "b.nc")
    with xr.open_dataset(folder / "a.nc") as one, xr.open_dataset(folder / "b.nc") as other:
        xr.testing.assert_equal(one, other)
        assert (one.validity.encoding["zlib"], one.validity.encoding["complevel"]) == (True, 4)
        assert one.attrs["history"].endswith(" slipsweep run")
    stored(sweep_job(spec.load(folder / "a.toml")), folder / "a.zarr")
    group: Any = zarr.open_group(folder / "a.zarr", mode="r")
    (codec,) = group["permanent_displacement"].compressors
    assert codec.to_dict()["configuration"]["level"] == 4


@pytest.mark.parametrize("output", ["a[1].nc", "a[1].zarr"])
def test_a_run_goes_on_with_its_own_chunks_only(
    folder: Path, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "CHUNK_CELLS", 6)
    path = folder / output
    mark = storing._mark
    seen = []

    def failing(place: str, number: int) -> None:
        if number == 3:
            raise OSError(28, "No space left on device")
        noting(place, number)

    def noting(place: str, number: int) -> None:
        seen.append(number)
        mark(place, number)

    monkeypatch.setattr(storing, "_mark", failing)
    with pytest.raises(RunError, match="No space") as failure:
        stored(job_of(folder, "sweep"), path)
    assert failure.value.__notes__ == [f"3 of 24 chunks are kept in {path}.part: --resume goes on"]
    assert not path.exists()
    monkeypatch.setattr(storing, "_mark", noting)

    with pytest.raises(
        InputError,
        match=r"part: has chunks of an interrupted run; give --resume to go on with them, or --ov",
    ):
        stored(job_of(folder, "sweep"), path)
    with pytest.raises(InputError, match="has chunks of another sweep file; go on with that one"):
        stored(job_of(folder, "newmark"), path, resume=True)
    monkeypatch.setattr("slipsweep.files.jobs.__version__", "9.9")
    with pytest.raises(InputError, match="another version of slipsweep"):
        stored(job_of(folder, "sweep"), path, resume=True)
    monkeypatch.undo()
    monkeypatch.setattr(storing, "_mark", noting)

    identity = folder / f"{output}.part" / "identity.json"
    kept = identity.rename(folder / "kept.json")
    identity.mkdir()  # what cannot be read is not taken for nothing: the chunks stay
    with pytest.raises(RunError, match="writing failed: Is a directory"):
        stored(job_of(folder, "sweep"), path, resume=True)
    identity.rmdir()
    with pytest.raises(InputError, match="has chunks that nothing identifies"):
        stored(job_of(folder, "sweep"), path, resume=True)
    kept.rename(identity)
    monkeypatch.setattr(running, "CHUNK_CELLS", 2)  # as with workers
    assert not stored(
        job_of(folder, "sweep"), path, resume=True
    ).was_complete  # with the chunks it was begun with
    assert sorted(seen) == list(range(24))
    stored(job_of(folder, "sweep"), folder / "whole.nc")
    xr.testing.assert_identical(
        without_time(read_result(path)), without_time(read_result(folder / "whole.nc"))
    )

    assert stored(job_of(folder, "sweep"), path, resume=True).was_complete
    with pytest.raises(InputError, match="is of another sweep or version; give --overwrite"):
        stored(job_of(folder, "newmark"), path, resume=True)
    with pytest.raises(InputError, match="exists already; give --overwrite"):
        stored(job_of(folder, "sweep"), path)
    stored(job_of(folder, "newmark"), path, overwrite=True)
    assert read_result(path).attrs["model"] == "newmark"


def test_a_run_goes_on_with_other_memory_if_its_chunks_fit(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks keep the size that the run was begun with; less memory than they take is refused."""
    monkeypatch.setattr(running, "_BASE_MEMORY", 0)
    monkeypatch.setattr(running, "CHUNK_CELLS", 100)  # without a limit; else cells fill the memory
    cell = 2 * (8 + 8 + 1 + 2) + 8  # two copies of the default results, and 8 bytes
    (folder / "sweep.toml").write_text(WAVE.replace("num = 4", "num = 400"))
    path = folder / "a.nc"
    mark = storing._mark

    def failing(place: str, number: int) -> None:
        if number == 2:
            raise OSError(28, "No space left on device")
        mark(place, number)

    monkeypatch.setattr(storing, "_mark", failing)
    with pytest.raises(RunError, match="No space"):
        stored(job_of(folder, "sweep"), path, memory=2400 * cell)
    marked: list[int] = []
    monkeypatch.setattr(storing, "_mark", lambda place, number: marked.append(number))
    with pytest.raises(
        InputError, match="larger chunks than fit into the memory asked for; give more --memory"
    ):
        stored(job_of(folder, "sweep"), path, resume=True, memory=1000 * cell)
    assert not stored(job_of(folder, "sweep"), path, resume=True, memory=7200 * cell).was_complete
    assert marked == [2]
    monkeypatch.undo()
    stored(job_of(folder, "sweep"), folder / "whole.nc")
    xr.testing.assert_identical(
        without_time(read_result(path)), without_time(read_result(folder / "whole.nc"))
    )


@pytest.mark.parametrize("workers", [0, 1, 4])
def test_chunks_on_the_way_from_workers_count_as_memory(folder: Path, workers: int) -> None:
    """Of each worker one that is solved and two that wait, beside two here; never more than asked for."""
    plan = job_of(folder, "sweep").plan
    results = sum(np.dtype(dtype).itemsize for dtype in job_of(folder, "sweep").dtypes.values())
    base = running._BASE_MEMORY + workers * running._WORKER_MEMORY
    for memory in (base + 10**8, base + 10**9):
        most = running._most_cells(plan, memory, workers)
        taken = base + most * (2 + 3 * workers) * results
        assert 0.7 * memory < taken + 8 * most <= memory


def test_another_motion_is_another_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stored(job_of(folder, "suite"), folder / "a.nc")
    (folder / "motions" / "m2.csv").rename(folder / "motions" / "m3.csv")
    with pytest.raises(InputError, match="another sweep or version"):
        stored(job_of(folder, "suite"), folder / "a.nc", resume=True)
    write_motion((folder / "motions" / "m3.csv").rename(folder / "motions" / "m2.csv"), 5, 60, 0.02)
    with pytest.raises(InputError, match="another sweep or version"):
        stored(job_of(folder, "suite"), folder / "a.nc", resume=True)
    step, sweep = (spec.load(folder / f"{name}.toml") for name in ("step", "sweep"))
    assert (
        sweep_job(step).digest
        != sweep_job(replace(step, solver=slipsweep.Step(steps_per_cycle=128))).digest
    )
    assert limit_job(sweep, [0.01], 8.0).digest != limit_job(sweep, [0.01], 9.0).digest


def test_what_no_disk_and_no_memory_holds(folder: Path) -> None:
    text = WAVE.replace("num = 4", "num = 9000000").replace("[0.5, 1, 2]", "[0.5, 1]")
    text = text.replace("mu_s.values = [0.3, 0.5]", "mu_s = {start = 0.3, stop = 1, num = 900000}")
    (folder / "large.toml").write_text(text)
    for name in ("a.nc", "a.zarr"):
        with pytest.raises(InputError, match=rf"{name}: takes .*TB, but .* are free on the disk"):
            stored(job_of(folder, "large"), folder / name)
        assert not [*folder.glob(f"{name}*")]
    with pytest.raises(InputError, match=r"--memory = 100 MB: must be .* at least"):
        stored(job_of(folder, "sweep"), folder / "a.nc", memory=100_000_000)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="asks Linux for the memory of a process"
)
@pytest.mark.parametrize("output", ["a.nc", "a.zarr"])
def test_memory_is_what_is_asked_for(folder: Path, output: str) -> None:
    """A run in chunks takes no more than --memory says, and a tenth; codes are stored as whole numbers."""
    text = WAVE.replace("num = 4", "num = 2000").replace(
        "[0.5, 1, 2]", str([0.01 * i + 1 for i in range(600)])
    )
    (folder / "a.toml").write_text(text)
    code = (
        "import sys; from pathlib import Path; from slipsweep.cli import main; "
        "assert not main(['run', 'a.toml', '-o', sys.argv[1], '-q', '--memory', '460MB']); "
        # not of getrusage: what that tells of a process begins with the memory of its parent
        "print(Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, output], cwd=folder, capture_output=True, text=True, check=True
    )
    assert int(done.stdout) * 1024 < 1.1 * 460e6
    how: Any = {"engine": "zarr", "consolidated": False} if output.endswith("zarr") else {}
    with xr.open_dataset(folder / output, mask_and_scale=False, **how) as file:
        assert (file.validity.dtype, file.sliding_mode.dtype) == ("int16", "int8")
        # of a store: half a million cells, about, are read at once, not thousands of small chunks
        assert output == "a.nc" or 250_000 < math.prod(file.validity.encoding["chunks"]) < 1_000_000


@pytest.mark.parametrize("output", ["w.nc", "w.zarr"])
def test_workers_give_the_same_bits(folder: Path, output: str) -> None:
    stored(job_of(folder, "sweep"), folder / "a.nc")
    stored(job_of(folder, "sweep"), folder / output, workers=1)
    xr.testing.assert_identical(
        without_time(read_result(folder / output)), without_time(read_result(folder / "a.nc"))
    )


def test_a_store_at_an_address(folder: Path) -> None:
    address = "memory://bucket/address.zarr"
    stored(job_of(folder, "sweep"), address)
    stored(job_of(folder, "sweep"), folder / "a.nc")
    xr.testing.assert_identical(
        without_time(read_result(address)), without_time(read_result(folder / "a.nc"))
    )
    assert stored(job_of(folder, "sweep"), address, resume=True).was_complete
    assert not list(Path().glob(".address*"))
    with pytest.raises(InputError, match=r"nowhere://a/b\.zarr: Protocol not known: nowhere"):
        stored(job_of(folder, "sweep"), "nowhere://a/b.zarr")


def test_clusters_that_are_none(folder: Path) -> None:
    for means, message in (
        ({"workers": 0}, "must be from 1 to"),
        ({"workers": 2, "scheduler": "a:1"}, "give one of"),
    ):
        with pytest.raises(InputError, match=message):
            stored(job_of(folder, "sweep"), folder / "a.nc", **means)


# --------------------------------------------------------------------------------- opening


def test_results_open_as_sweep_returns_them(folder: Path) -> None:
    stored(job_of(folder, "sweep"), folder / "a.nc")
    opened = slipsweep.open_result(folder / "a.nc")
    assert all(one.chunks is not None for one in opened.data_vars.values())
    arguments = {"theta": [0, 5, 10], "mu_s": [0.3, 0.5], "amplitude": opened.amplitude.values}
    expected = slipsweep.sweep(
        **arguments, frequency=[0.5, 1, 2], variables=list(map(str, opened.data_vars))
    )
    xr.testing.assert_equal(opened, expected)
    assert opened.sliding_mode.dtype == expected.sliding_mode.dtype == np.int8
    for name in opened.data_vars:
        assert opened[name].attrs["long_name"] == expected[name].attrs["long_name"]


def packed(table: xr.Dataset) -> xr.Dataset:
    about = {"scale_factor": 1e-5, "dtype": "int32", "_FillValue": -9}
    table.permanent_displacement.encoding = about
    return table


#: What other programs do to a file, and leave its meaning.
EDITS: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "packed": packed,
    "transposed": lambda table: table.transpose(*reversed(table.permanent_displacement.dims)),
    "codes as numbers": lambda table: table.assign(sliding_mode=table.sliding_mode.astype(float)),
    "flags as numbers": lambda table: table.assign(validity=table.validity.astype(float)),
    "single precision": lambda table: table.astype("float32", keep_attrs=True).assign(
        validity=table.validity
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_what_other_programs_have_rewritten(folder: Path, edit: str) -> None:
    stored(job_of(folder, "sweep"), folder / "a.nc")
    whole = read_result(folder / "a.nc").load()
    EDITS[edit](xr.open_dataset(folder / "a.nc").load()).to_netcdf(folder / "b.nc")
    again = slipsweep.open_result(folder / "b.nc")
    assert again.sliding_mode.dtype.kind in "if"
    np.testing.assert_allclose(
        again.permanent_displacement.transpose(*whole.permanent_displacement.dims),
        whole.permanent_displacement,
        atol=2e-5,
    )
    for name in ("sliding_mode", "validity"):
        np.testing.assert_array_equal(again[name].transpose(*whole[name].dims), whole[name])


def outer(table: xr.Dataset) -> xr.Dataset:
    """Cells that one of two results has, joined with those of both."""
    other = table.isel(mu_s=[0]).assign_coords(theta=table.theta + 1.0)
    return xr.concat([table, other], "theta", join="outer")


#: What makes another grid of a result, and what is said of it.
OTHER_GRIDS: dict[str, tuple[Callable[[xr.Dataset], xr.Dataset], str]] = {
    "joined": (
        lambda table: xr.concat([table, table.assign_coords(theta=table.theta + 20)], "theta"),
        "theta: 6 values, 0 to 30 degree, where the sweep that it stores has 3 values, 0 to 10 degree",
    ),
    "joined along another axis": (
        lambda table: xr.concat([table, table], xr.IndexVariable("cycles", [5, 10])),
        "cycles: is no dimension of the sweep that it stores",
    ),
    "joined along a parameter": (
        lambda table: xr.concat([table, table], xr.IndexVariable("yield_acceleration", [1.0, 2.0])),
        "yield_acceleration: is no dimension of the sweep that it stores",
    ),
    "outer": (outer, "theta: 6 values, 0 to 11 degree, where"),
    "cut": (
        lambda table: table.isel(mu_s=0),
        "mu_s: 0.3, where the sweep that it stores has 2 values, 0.3 to 0.5",
    ),
    "shifted": (
        lambda table: table.assign_coords(frequency=table.frequency * 1.001),
        "frequency: 3 values, 0.5005 to 2.002 Hz, where",
    ),
    "mean": (
        lambda table: table.mean("theta", keep_attrs=True),
        "theta: no values, where the sweep that it stores has 3 values, 0 to 10",
    ),
}


@pytest.mark.parametrize("change", OTHER_GRIDS)
def test_a_result_with_another_grid_than_its_sweep_is_not_solved_again(
    folder: Path, change: str
) -> None:
    make, message = OTHER_GRIDS[change]
    job = job_of(folder, "sweep")
    stored(job, folder / "a.nc")
    make(slipsweep.open_result(folder / "a.nc").load()).to_netcdf(folder / "b.nc")
    with pytest.raises(InputError, match=rf"b\.nc: {message}"):
        spec.load(folder / "b.nc")  # which run and limit do
    with pytest.raises(InputError, match=rf"b\.nc: {message}"):
        stored(job, folder / "b.nc", resume=True)


def test_a_suite_with_other_motions_is_not_solved_again(folder: Path) -> None:
    stored(job_of(folder, "suite"), folder / "a.nc")
    whole = slipsweep.open_result(folder / "a.nc").load()
    whole.isel(motion=[0]).to_netcdf(folder / "b.nc")
    with pytest.raises(InputError, match=r"b\.nc: motion: m1, where .* has m1, m2: "):
        spec.load(folder / "b.nc")


@pytest.mark.parametrize("change", ["masked", "outer", "filled"])
def test_cells_that_have_lost_their_flags_are_not_without_flags(folder: Path, change: str) -> None:
    stored(job_of(folder, "sweep"), folder / "a.nc")
    whole = slipsweep.open_result(folder / "a.nc").load()
    if change == "outer":
        table = outer(whole)
        lost = table.permanent_displacement.isnull() & (table.theta % 5 == 1)
    else:
        lost = whole.theta == 5
        table = whole.where(~lost)
        if change == "filled":
            table["validity"].encoding |= {"dtype": "int16", "_FillValue": -9}
    table.to_netcdf(folder / "b.nc")
    opened = slipsweep.open_result(folder / "b.nc")
    lost = lost.broadcast_like(opened.validity)
    xr.testing.assert_equal(opened.validity.isnull().compute(), lost)
    assert (opened.sliding_mode.where(lost, -1) == -1).all()
    with pytest.raises(InputError, match="whole numbers, of which none is missing"):
        slipsweep.flags(opened)
    tally = tally_of(opened)
    assert tally.unflagged == int(lost.sum()) > 0
    assert tally.flags is not None
    for flag, count in tally.flags.items():
        assert count == int(((table.validity.fillna(0).astype(int) & int(flag)) != 0).sum())
    done = command(folder, "export", "b.nc", "-o", "b.csv", "--words")
    assert done.returncode == 0, done.stderr
    words = pd.read_csv(folder / "b.csv", keep_default_na=False)["validity"].to_numpy()
    named = table.validity.transpose(*opened.validity.dims).values.ravel()
    assert [bool(word) for word in words] == (np.nan_to_num(named) != 0).tolist()
    shown = f"  not known              {tally.unflagged / tally.cells:9.2%}  another program has"
    assert shown in command(folder, "info", "b.nc").stdout


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"", "not a netCDF file, or a damaged one"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "not a netCDF file, or a damaged one"),
        ("foreign", "not written by slipsweep"),
        ("folder", "neither a netCDF file nor a Zarr store"),
    ],
)
def test_what_is_no_result(tmp_path: Path, content: Any, message: str) -> None:
    path = tmp_path / "a.nc"
    if content == "foreign":
        xr.Dataset({"a": 1}).to_netcdf(path)
    elif content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as refused:
        slipsweep.open_result(path)
    assert "\n" not in str(refused.value)
