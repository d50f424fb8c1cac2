"""Chunks, and netCDF files: what they hold, and that they are complete or not there."""

import errno
import math
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import slipsweep
from slipsweep.errors import InputError, RunError
from slipsweep.files import netcdf, results, spec
from slipsweep.grid import chunks, plans
from slipsweep.model import variables
from slipsweep.runs import placed, solving, store
from slipsweep.runs.jobs import sweep_job
from slipsweep.runs.targets import onefile

GRID = """
# θ in degrees
[axes.theta]
values = [0, 5, 10, 15, 20]
[axes.mu_s]
values = [0.2, 0.4, 0.6]
[axes.amplitude]
start = 0.5
stop = 9
num = 40
[axes.frequency]
values = [0.5, 1, 2, 4]
"""

CASES = """
[[cases]]
label = "θ 5°"
theta = 5
mu_s = 0.4
[[cases]]
theta = 6
mu_s = 0.5
[axes.amplitude]
values = [2, 4, 6]
[axes.frequency]
values = [1, 2]
[model]
delta_mu = 0.1
"""


def run(text: str, path: Path, **options: Any) -> store.Report:
    return store.run(sweep_job(spec.parse(text, "a.toml")), path, command="slipsweep run a.toml", **options)


def stored(path: Path) -> dict[str, Any]:
    """Return all variables of a file, as stored."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        return {name: variable[...] for name, variable in file.variables.items()}


def assert_same_data(one: Path, other: Path) -> None:
    first, second = stored(one), stored(other)
    assert list(first) == list(second)
    for name, values in first.items():
        np.testing.assert_array_equal(values, second[name], err_msg=name)


# ---------------------------------------------------------------------------------- chunks

SHAPES = st.dictionaries(
    st.sampled_from([*variables.DIMENSION_ORDER, "case"]), st.integers(1, 12), min_size=1, max_size=5
)


@given(shape=SHAPES, most=st.integers(1, 400))
@settings(max_examples=200, deadline=None)
def test_chunks_cover_the_grid_once_and_keep_within_the_limit(shape: dict[str, int], most: int) -> None:
    parts = list(chunks.grid_chunks(shape, most))
    seen = np.zeros(tuple(shape.values()), int)
    for part in parts:
        chunk = seen[tuple(part.values())]
        chunk += 1
        assert chunk.size <= most
    assert np.all(seen == 1)


@given(shape=SHAPES, most=st.integers(1, 400), data=st.data())
@settings(max_examples=200, deadline=None)
def test_a_chunk_is_one_run_of_any_result(shape: dict[str, int], most: int, data: st.DataObject) -> None:
    """Also of those that have not all the dimensions."""
    sizes = {dim: length for dim, length in shape.items() if data.draw(st.booleans())}
    numbers = np.arange(math.prod(sizes.values())).reshape(tuple(sizes.values()))
    for part in chunks.grid_chunks(shape, most):
        (first,), count = placed.runs_of(part, sizes)
        wanted = numbers[tuple(part[dim] for dim in sizes)]
        assert wanted.ravel().tolist() == list(range(first, first + count))


@given(shape=SHAPES, most=st.integers(1, 400), data=st.data())
@settings(max_examples=200, deadline=None)
def test_runs_of_chunks_with_dimensions_kept_together(shape: dict[str, int], most: int, data: st.DataObject) -> None:
    """Wherever these are among the others, and with dimensions of results that are none of the grid's."""
    together = [dim for dim in shape if data.draw(st.booleans())]
    sizes = {dim: length for dim, length in shape.items() if data.draw(st.booleans())} | {"quantile": 3}
    numbers = np.arange(math.prod(sizes.values())).reshape(tuple(sizes.values()))
    seen = np.zeros(tuple(shape.values()), int)
    for part in chunks.grid_chunks(shape, most, together):
        firsts, count = placed.runs_of(part, sizes)
        wanted = numbers[tuple(chunks.places(part, sizes).values())]
        assert wanted.ravel().tolist() == [first + at for first in firsts for at in range(count)]
        seen[tuple(part.values())] += 1
        assert seen[tuple(part.values())].size <= most
    assert (seen == 1).all()
    lengths = chunks.chunk_lengths(shape, most, together)
    if any(lengths[dim] < shape[dim] for dim in together):
        assert all(lengths[dim] == 1 for dim in shape if dim not in together)


def test_chunks_are_whole_along_the_last_dimensions() -> None:
    shape = {"theta": 50, "mu_s": 20, "amplitude": 300, "frequency": 1000, "case": 7}
    assert chunks.chunk_lengths(shape, 4_000_000) == {
        "theta": 1,
        "mu_s": 1,
        "amplitude": 300,
        "frequency": 1000,
        "case": 7,
    }
    assert chunks.chunk_lengths(shape, 400_000)["frequency"] == 1000


def test_workers_share_a_sweep_evenly_within_the_memory() -> None:
    sweep = spec.parse(GRID.replace("num = 40", "num = 1000000"), "a.toml")
    night = sweep.plan()  # 60 million cells, 19 bytes each
    assert solving.cells_within(2 * 10**9, night) == (2 * 10**9 - 400 * 10**6) // (2 * 19 + 8)
    assert solving.cells_within(2 * 10**9, night, 4) == (2 * 10**9 - 1400 * 10**6) // (14 * 19 + 8)
    with pytest.raises(InputError, match=r"--memory = 1 GB: must be 1\.41 GB at least with --workers 4"):
        solving.cells_within(10**9, night, 4)
    stepping = sweep.with_solver(slipsweep.Step()).plan()  # a cell takes 65 times as long
    assert solving.cells_shared(stepping, 2) == 4_000_000 // 65
    assert solving.cells_shared(stepping, None) == 60_000_000 // 1024
    assert solving.cells_shared(stepping, 1000) == math.ceil(500_000 / 65)
    assert solving.cells_within(2 * 10**9, stepping) == 4_000_000 // 65  # seconds of work, whatever the memory
    assert solving.cells_shared(night, None) == 500_000  # each but a few times what sending it takes
    assert solving.cells_shared(night, 1) == 60_000_000 // 16


# ------------------------------------------------------------------------- bytes of results

LARGE = """
[axes.theta]
values = [0, 10]
[axes.mu_s]
values = [0.3, 0.5, 0.7]
[axes.amplitude]
start = 0.5
stop = 12
num = 401
[axes.frequency]
start = 1
stop = 3
num = 407
"""


def refusing(*arguments: Any) -> int:
    raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))


@pytest.mark.parametrize("way", ["as it is", "no such flag", "not this file system", "not this file", "piecemeal"])
def test_results_are_written_to_their_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    """Past the system's memory of files or through it: the same bytes."""
    open_file, write = os.open, os.pwrite
    written: list[int] = []

    def not_directly(path: Path, flags: int, *more: int) -> int:
        return refusing() if flags & os.O_DIRECT else open_file(path, flags, *more)

    def counted(descriptor: int, content: memoryview, at: int) -> int:
        assert at % 4096 == len(content) % 4096 == 0
        if way == "piecemeal":
            content = content[: min(len(content), 12288)]
        written.append(write(descriptor, content, at))
        return written[-1]

    if not hasattr(os, "O_DIRECT"):
        pytest.skip("the system has no direct writing")
    monkeypatch.setattr(os, "pwrite", refusing if way == "not this file" else counted)
    monkeypatch.setattr(placed, "_PIECE", 2**20)
    if way == "no such flag":
        monkeypatch.delattr(os, "O_DIRECT")
    elif way == "not this file system":
        monkeypatch.setattr(os, "open", not_directly)
    run(LARGE, tmp_path / "a.nc", chunk_cells=400_000)
    expected = slipsweep.sweep(**spec.parse(LARGE, "a.toml").arguments())
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        file.set_auto_mask(False)
        for name, result in expected.data_vars.items():
            np.testing.assert_array_equal(file[str(name)][...], result.values, err_msg=str(name))
    if way == "as it is" and written:  # not on every file system
        # both floating-point results, but for the sectors that two chunks share; codes are too short
        assert sum(written) > 0.98 * 16 * expected.permanent_displacement.size


def test_a_disk_that_fills_while_it_is_written_directly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    with (tmp_path / "direct").open("wb") as probe:
        pass
    try:
        os.close(os.open(probe.name, os.O_WRONLY | os.O_DIRECT))
    except (OSError, AttributeError):
        pytest.skip("the file system has no direct writing")
    with pytest.raises(RunError, match=r"writing failed: No space left on device; is the disk full\?"):
        run(LARGE, tmp_path / "a.nc")
    assert not (tmp_path / "a.nc.parts").exists()


# ----------------------------------------------------------------------------- what is in it


def test_chunks_give_what_one_call_gives(tmp_path: Path) -> None:
    run(GRID, tmp_path / "a.nc", chunk_cells=300)
    run(GRID, tmp_path / "b.nc")
    assert_same_data(tmp_path / "a.nc", tmp_path / "b.nc")
    expected = slipsweep.sweep(**spec.parse(GRID, "a.toml").arguments())
    for name, values in stored(tmp_path / "a.nc").items():
        np.testing.assert_array_equal(values, expected[name].values, err_msg=name)


def test_attributes_follow_the_conventions(tmp_path: Path) -> None:
    run(GRID, tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert file.data_model == "NETCDF4"
        assert file.Conventions == "CF-1.11"
        assert file.source.startswith("slipsweep ")
        assert file.history.endswith("Z slipsweep run a.toml")
        assert "10.1016/j.soildyn.2011.08.007" in file.references
        assert file.sweep == GRID
        assert list(file.dimensions) == ["theta", "mu_s", "amplitude", "frequency"]
        for name in file.dimensions:
            assert file[name].units == variables.PARAMETERS[name]["units"]
            assert file[name].long_name
        for name in variables.DEFAULT_RESULTS:
            assert file[name].dimensions == tuple(file.dimensions)
            assert file[name].long_name
        assert np.isnan(file["permanent_displacement"]._FillValue)
        assert file["permanent_displacement"].units == "m"
        assert file["sliding_mode"]._FillValue == -1
        assert file["sliding_mode"].dtype == file["sliding_mode"].flag_values.dtype == np.int8
        assert file["validity"].dtype == file["validity"].flag_masks.dtype == np.int16
        assert "_FillValue" not in file["validity"].ncattrs()
        for name in ("sliding_mode", "validity"):
            codes = file[name].flag_values if name == "sliding_mode" else file[name].flag_masks
            assert len(file[name].flag_meanings.split()) == len(codes)
            # no filter that a stock netCDF build lacks
            filters = file[name].filters()
            assert not any(filters.values())


def test_float32_and_chosen_variables(tmp_path: Path) -> None:
    text = GRID + '[output]\ndtype = "float32"\nvariables = ["sliding_mode", "permanent_displacement"]\n'
    report = run(text, tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert file["permanent_displacement"].dtype == np.float32
        assert file["theta"].dtype == np.float64
        assert set(file.variables) - set(file.dimensions) == {"sliding_mode", "permanent_displacement"}
        # an attribute must not name a variable that is not there
        assert "ancillary_variables" not in file["permanent_displacement"].ncattrs()
    assert report.tally.modes is not None
    assert report.tally.flags is None


SINGLE = '[output]\ndtype = "float32"\n'


@pytest.mark.parametrize("cells", [7, 10**9], ids=["in chunks", "at once"])
def test_float32_is_float64_rounded(tmp_path: Path, cells: int) -> None:
    """Displacements from below the least subnormal to near the greatest float32; modes and flags the same."""
    text = GRID.replace("[0.5, 1, 2, 4]", "[1e-18, 1e-10, 1.0, 1e10, 1e19, 1e22, 1e25]")
    run(text, tmp_path / "double.nc")
    run(text + SINGLE, tmp_path / "single.nc", chunk_cells=cells)
    double, single = stored(tmp_path / "double.nc"), stored(tmp_path / "single.nc")
    for name in ("permanent_displacement", "peak_relative_velocity"):
        assert single[name].dtype == np.float32
        np.testing.assert_array_equal(single[name], double[name].astype(np.float32))
    displacement = single["permanent_displacement"]
    assert np.nanmax(displacement) > 1e33
    assert ((displacement > 0) & (displacement < np.finfo(np.float32).tiny)).any()
    for name in ("sliding_mode", "validity"):
        np.testing.assert_array_equal(single[name], double[name])


@pytest.mark.parametrize("split", [False, True])
def test_float32_does_not_overflow_in_silence(tmp_path: Path, split: bool) -> None:
    text, path = GRID.replace("[0.5, 1, 2, 4]", "[1e-30]") + SINGLE, tmp_path / "a"
    with pytest.raises(
        InputError, match=r'output.dtype = "float32": permanent_displacement reaches .*must be "float64"'
    ):
        run(text, path, chunk_cells=100, split=split)
    assert not path.exists()


def test_cases_have_labels_and_no_string_type(tmp_path: Path) -> None:
    run(CASES, tmp_path / "a.nc", chunk_cells=5)
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert all(variable.dtype is not str for variable in file.variables.values())
        assert file["permanent_displacement"].dimensions == ("amplitude", "frequency", "case")
        assert set(file["validity"].coordinates.split()) == {"theta", "mu_s", "delta_mu", "label"}
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        assert list(dataset["label"].values) == ["θ 5°", "2"]
        np.testing.assert_array_equal(dataset["theta"], [5, 6])
        assert dataset["theta"].dims == ("case",)
        assert dataset["delta_mu"].item() == 0.1


def test_the_amplitudes_of_displacement_amplitudes_are_written_if_asked_for(tmp_path: Path) -> None:
    text = GRID.replace("axes.amplitude", "axes.displacement_amplitude").replace("stop = 9", "stop = 0.6")
    run(text, tmp_path / "a.nc", chunk_cells=100)
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        assert "amplitude" not in dataset
        values = sum(variable.nbytes for variable in dataset.variables.values())
        assert (tmp_path / "a.nc").stat().st_size < values + 50_000
    for split in (False, True):
        path = tmp_path / f"with_{split}.nc"
        run(text + '[output]\nvariables = ["validity", "amplitude"]\n', path, chunk_cells=100, split=split)
        for part in path.glob("*.nc") if split else [path]:
            with xr.open_dataset(part) as dataset:
                expected = (2 * np.pi * dataset["frequency"]) ** 2 * dataset["displacement_amplitude"]
                np.testing.assert_allclose(dataset["amplitude"], expected.transpose(*dataset["amplitude"].dims))
                assert dataset["amplitude"].units == "m s-2"


@pytest.mark.skipif(shutil.which("ncdump") is None, reason="ncdump is not installed")
@pytest.mark.parametrize("text", [GRID, CASES])
def test_ncdump_reads_it(tmp_path: Path, text: str) -> None:
    run(text, tmp_path / "a.nc")
    done = subprocess.run(["ncdump", tmp_path / "a.nc"], capture_output=True, text=True, check=True)
    assert 'flag_meanings = "stuck stick_slip continuous"' in done.stdout
    assert "string" not in done.stdout


def test_a_result_repeats_its_run(tmp_path: Path) -> None:
    sweep_spec = spec.parse(CASES, "a.toml").with_solver(slipsweep.Step())
    store.run(sweep_job(sweep_spec), tmp_path / "a.nc", command="x")
    again = spec.load(tmp_path / "a.nc")
    assert again.text == CASES
    # the solver was not the sweep file's own: it is remembered all the same
    assert again.solver == slipsweep.Step()
    store.run(sweep_job(again), tmp_path / "b.nc", command="x")
    assert_same_data(tmp_path / "a.nc", tmp_path / "b.nc")


def test_the_tally_counts_modes_and_flags(tmp_path: Path) -> None:
    report = run(GRID, tmp_path / "a.nc", chunk_cells=100)
    values = stored(tmp_path / "a.nc")
    assert report.tally.cells == values["validity"].size == 5 * 3 * 40 * 4
    assert report.tally.modes == {mode: np.sum(values["sliding_mode"] == mode) for mode in variables.SlidingMode}
    assert report.tally.flags == {flag: np.sum(values["validity"] & flag != 0) for flag in variables.Validity}
    assert results.read_contents(tmp_path / "a.nc").tally == report.tally
    assert report.nbytes == (tmp_path / "a.nc").stat().st_size


def test_tables_in_memory_are_written_by_the_same_rules(tmp_path: Path) -> None:
    table = xr.Dataset(
        {"relative_velocity": xr.Variable(("time",), np.array([0.0, 1.0]), variables.HISTORY["relative_velocity"])},
        {
            "time": xr.Variable(("time",), np.array([0.0, 0.1]), {"units": "s"}),
            "theta": xr.Variable((), np.array(5.0), variables.PARAMETERS["theta"]),
        },
        {"permanent_displacement": 0.5},
    )
    netcdf.write_table(table, tmp_path / "a.nc", title="History", command="x")
    with xr.open_dataset(tmp_path / "a.nc") as read:
        expected = xr.Dataset(
            {"relative_velocity": ("time", [0.0, 1.0])}, {"time": ("time", [0.0, 0.1]), "theta": ((), 5.0)}
        )
        xr.testing.assert_equal(read, expected)
        assert read.attrs["Conventions"] == "CF-1.11"
        assert read.attrs["permanent_displacement"] == 0.5


@pytest.mark.parametrize("content", [b"", b"nothing", b"\x89HDF\r\n\x1a\nbut no more"])
def test_other_files_have_no_contents(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.nc").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.nc: not a netCDF file"):
        results.read_contents(tmp_path / "a.nc")


def test_netcdf_of_others_has_no_contents(tmp_path: Path) -> None:
    netCDF4.Dataset(tmp_path / "a.nc", "w").close()
    with pytest.raises(InputError, match=r"a\.nc: not written by slipsweep"):
        results.read_contents(tmp_path / "a.nc")
    with pytest.raises(InputError, match=r"a\.nc: not written by slipsweep"):
        spec.load(tmp_path / "a.nc")


# -------------------------------------------------------------------- complete or not there


@pytest.mark.parametrize(
    ("raised", "seen", "message"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), RunError, "No space left on device"),
        (RuntimeError("NetCDF: HDF error"), RunError, "HDF error; is the disk full?"),
        (KeyboardInterrupt(), KeyboardInterrupt, None),
    ],
)
@pytest.mark.parametrize("existing", [False, True])
def test_a_failed_run_leaves_nothing_but_finished_chunks(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    raised: BaseException,
    seen: type[BaseException],
    message: str | None,
    existing: bool,
) -> None:
    path = tmp_path / "a.nc"
    if existing:
        path.write_text("an earlier result")
    write = onefile.OneFile.write

    def failing(self: onefile.OneFile, number: int, *arguments: Any) -> Any:
        if number == last:
            raise type(raised)(*raised.args)
        return write(self, number, *arguments)

    monkeypatch.setattr(onefile.OneFile, "write", failing)
    for last, left in ((0, set()), (2, {"a.nc.parts"})):
        with pytest.raises(seen, match=message) as caught:
            run(GRID, path, chunk_cells=300, overwrite=True)
        assert {entry.name for entry in tmp_path.iterdir()} == ({"a.nc"} if existing else set()) | left
        notes = getattr(caught.value, "__notes__", [])
        assert notes == (["2 of 15 chunks are kept; go on with --resume"] if last else [])
        if existing:
            assert path.read_text() == "an earlier result"
    monkeypatch.undo()
    solved: list[int] = []

    def counting(*arguments: Any) -> Iterator[tuple[int, xr.Dataset]]:
        for number, table in solving.solve_here(*arguments):
            solved.append(number)
            yield number, table

    # that it may replace what is there was said at the beginning
    run(GRID, path, resume=True, solved=counting)
    assert solved == list(range(2, 15))
    run(GRID, tmp_path / "b.nc")
    assert_same_data(path, tmp_path / "b.nc")
    assert {entry.name for entry in tmp_path.iterdir()} == {"a.nc", "b.nc"}


def test_memory_that_runs_out_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*arguments: object) -> None:
        raise MemoryError

    monkeypatch.setattr(plans.Plan, "solve", failing)
    with pytest.raises(RunError, match="out of memory at a chunk of 2400 cells"):
        run(GRID, tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


def test_an_output_is_not_there_before_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    run(GRID, path, chunk_cells=300, progress=lambda cells: pytest.fail("too early") if path.exists() else None)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.nc"]


def test_a_rivals_output_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    with pytest.raises(RunError, match="was made by another process during the run"):
        run(GRID, path, progress=lambda cells: path.write_text("rival"))
    assert path.read_text() == "rival"
    assert {entry.name for entry in tmp_path.iterdir()} == {"a.nc", "a.nc.parts"}


def test_file_systems_without_hard_links_will_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_links(source: Path, target: Path) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", no_links)
    run(GRID, tmp_path / "a.nc")
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.nc"]


def outputs(folder: Path) -> Iterator[tuple[Path, str]]:
    (folder / "file").touch()
    (folder / "folder").mkdir()
    yield folder / "file", "exists already; give --overwrite"
    yield folder / "folder", "exists and is not a file"
    yield folder / "none" / "a.nc", "the folder .* does not exist"
    yield folder / "file" / "a.nc", "the folder .* does not exist"


def test_outputs_that_cannot_be_are_refused_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plans.Plan, "solve", lambda *arguments: pytest.fail("has begun"))
    for path, message in outputs(tmp_path):
        with pytest.raises(InputError, match=message):
            run(GRID, path)
    monkeypatch.setattr(os, "access", lambda *arguments: False)
    with pytest.raises(InputError, match="is not writable"):
        run(GRID, tmp_path / "a.nc")


def test_a_grid_too_large_for_the_disk_is_refused(tmp_path: Path) -> None:
    axes = ("theta", "mu_s", "amplitude", "frequency")
    text = "".join(f"[axes.{name}]\nstart = 0.1\nstop = 9\nnum = 10000\n" for name in axes)
    with pytest.raises(InputError, match=r"a grid of 1e\+16 cells makes .* TB, but .* free: take coarser axes"):
        run(text, tmp_path / "a.nc")


def test_a_chunk_too_large_for_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "available_memory", lambda: 50_000)
    with pytest.raises(InputError, match=r"chunks of 2400 cells \(5 theta x .*\) need 110 kB of memory, but 50 kB"):
        run(GRID, tmp_path / "a.nc")
    run(GRID, tmp_path / "a.nc", chunk_cells=1000)
