"""Results are read as the CF conventions mean them, whatever program wrote them last."""

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from unittest import mock

import netCDF4
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.files import guard, spec
from slipsweep.files.results import ResultFile
from slipsweep.runs import store
from slipsweep.runs.jobs import sweep_job
from tests.support import edits, results, trials
from tests.support.strategies import reproducible

#: Where another process finds the tests.
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("results") / "grid.nc"
    store.run(sweep_job(spec.parse(results.GRID, "grid")), path, command="slipsweep run grid.toml")
    return path


# ----------------------------------------------------------------------------- one variable

INTEGERS = ("i1", "u1", "i2", "u2", "i4", "u4", "i8")
FLOATS = ("f4", "f8")


@st.composite
def stored(draw: st.DrawFn) -> dict[str, Any]:
    """Numbers as they are stored, and the attributes that say what they mean."""
    kind = np.dtype(draw(st.sampled_from(INTEGERS + FLOATS)))
    if kind.kind == "f":
        numbers = st.sampled_from([0.0, -0.0, 1.5, -3e5, 1e-40, 1e20, np.nan, 0.1])
    else:
        # no byte stands for what was never written; the library takes one nonetheless
        inside = int(kind.itemsize == 1)
        numbers = st.integers(max(np.iinfo(kind).min + 2 * inside, -(2**50)), min(np.iinfo(kind).max - inside, 2**50))
    values = np.array(draw(st.lists(numbers, min_size=1, max_size=8)), kind)
    attributes: dict[str, Any] = {}
    if draw(st.booleans()):
        factor = np.dtype(draw(st.sampled_from(FLOATS))).type
        attributes["scale_factor"] = factor(draw(st.sampled_from([0.001, 1.0, -2.5, 1e3])))
        attributes["add_offset"] = factor(draw(st.sampled_from([0.0, 273.15, -7.0])))
    fill = values[draw(st.integers(0, values.size - 1))] if draw(st.booleans()) else None
    if draw(st.booleans()) and not np.isnan(values[0]):
        attributes["missing_value"] = values[0]
    if draw(st.booleans()):
        ordered = np.sort(np.nan_to_num(values))
        attributes["valid_range"] = ordered[[0, -1]] if draw(st.booleans()) else values[:1].repeat(2)
    return {
        "values": values, "attributes": attributes, "fill": fill,
        "endian": draw(st.sampled_from(["native", "big", "little"])), "format": draw(st.sampled_from(FORMATS)),
    }  # fmt: skip


FORMATS = ["NETCDF4", "NETCDF4", "NETCDF4_CLASSIC", "NETCDF3_CLASSIC", "NETCDF3_64BIT_DATA"]


def written(path: Path, given: dict[str, Any]) -> None:
    classic = given["format"] in ("NETCDF4_CLASSIC", "NETCDF3_CLASSIC")
    values = given["values"]
    if classic and values.dtype.str[1:] not in ("i1", "i2", "i4", "f4", "f8"):
        given["format"] = "NETCDF4"
    endian: Any = "native" if given["format"].startswith("NETCDF3") else given["endian"]
    with netCDF4.Dataset(path, "w", format=given["format"]) as file:
        file.createDimension("x", values.size)
        variable = file.createVariable("theta", values.dtype, ("x",), fill_value=given["fill"], endian=endian)
        variable.setncatts(given["attributes"])
        variable.set_auto_maskandscale(False)
        variable[:] = values


def packed(path: Path, values: np.ndarray, attributes: dict[str, Any]) -> None:
    written(path, {"values": values, "fill": None, "endian": "big", "format": "NETCDF4", "attributes": attributes})


@reproducible
@given(case=stored())
def test_numbers_mean_what_the_netcdf_library_says(
    tmp_path_factory: pytest.TempPathFactory, case: dict[str, Any]
) -> None:
    path = tmp_path_factory.getbasetemp() / "stored.nc"
    written(path, case)
    with netCDF4.Dataset(path) as file:
        theirs = np.ma.masked_invalid(file["theta"][:].astype(np.float64))
    with ResultFile(path) as opened:
        ours, floats = opened["theta"].read({}), opened["theta"].read_floats({})
        assert ours.dtype == opened["theta"].dtype
        assert ours.dtype.isnative
    np.testing.assert_array_equal(np.ma.getmaskarray(ours), np.ma.getmaskarray(theirs))
    np.testing.assert_allclose(
        ours.compressed().astype(np.float64), theirs.compressed(), rtol=1e-6 if ours.dtype == np.float32 else 1e-14
    )
    np.testing.assert_array_equal(np.isnan(floats), np.ma.getmaskarray(ours))


@pytest.mark.parametrize("kind", ["i1", "i2", "i4"])
def test_numbers_without_a_sign(tmp_path: Path, kind: str) -> None:
    """netCDF-3 has none, and says so in an attribute (NUG, appendix B); the netCDF library fails with valid_range."""
    most = 2 ** (8 * int(kind[1])) - 1
    given = {
        "values": np.array([0, 1, -1, -2, -3], kind), "fill": np.dtype(kind).type(-1), "endian": "native",
        "format": "NETCDF3_CLASSIC", "attributes": {
            "_Unsigned": "true", "valid_range": np.array([1, -3], kind), "scale_factor": 0.5, "add_offset": -1.0,
        },
    }  # fmt: skip
    written(tmp_path / "a.nc", given)
    with ResultFile(tmp_path / "a.nc") as file:
        expected = [np.nan, -0.5, np.nan, np.nan, (most - 2) / 2 - 1]
        np.testing.assert_array_equal(file["theta"].read_floats({}), expected)


@pytest.mark.parametrize("bounds", [np.array([100, 5000], "i2"), np.array([0.1, 5.0]), np.array([0.1, 5.0], "f4")])
def test_bounds_of_valid_numbers_are_packed_or_not(tmp_path: Path, bounds: np.ndarray) -> None:
    values = np.array([4948, 99, 100, 5000, 5001, -32767], "i2")
    attributes = {"scale_factor": 0.001, "valid_range": bounds}
    packed(tmp_path / "a.nc", values, attributes)
    with ResultFile(tmp_path / "a.nc") as file:
        read = file["theta"].read_floats({})
    np.testing.assert_allclose(read, [4.948, np.nan, 0.1, 5.0, np.nan, np.nan], rtol=1e-14)


@pytest.mark.parametrize("value", ["thousand", np.array([1.0, 2.0])])
def test_packing_that_makes_no_sense_is_named(tmp_path: Path, value: Any) -> None:
    attributes = {"scale_factor": value}
    packed(tmp_path / "a.nc", np.arange(3.0), attributes)
    message = r"theta: scale_factor = .*: must be one number"
    with ResultFile(tmp_path / "a.nc") as file, pytest.raises(InputError, match=message):
        file["theta"].read({})


# ------------------------------------------------------------------- results after other programs


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return results.made(tmp_path_factory.mktemp("sources"))


@settings(reproducible, max_examples=30)
@given(seed=edits.seeds)
def test_edited_results_are_read_right_or_refused_in_one_line(sources: list[Path], seed: int) -> None:
    results.edited(sources, seed)


def test_a_file_is_named_once_in_what_is_refused(
    sources: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = sources[0].with_name("statistics.nc")
    assert main(["limit", str(path), "-d", "50mm"]) == 2
    assert capsys.readouterr().err.count("statistics.nc") == 1


def test_a_record_that_was_changed_in_its_result_is_refused_by_the_name_of_that(
    sources: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = "[axes]\nscale = {values = [1, 2]}\ntheta = {values = [5]}\nmu_s = {values = [0.4]}\n"
    (tmp_path / "a.toml").write_text(f'{sweep}[excitation]\nrecord = "{results.motion(tmp_path)}"\nunits = "m/s2"\n')
    assert main(["run", str(tmp_path / "a.toml"), "-o", str(tmp_path / "a.nc"), "-q"]) == 0
    with netCDF4.Dataset(tmp_path / "a.nc", "a") as file:
        file["record_acceleration"][3] = np.nan
    assert main(["run", str(tmp_path / "a.nc"), "-o", str(tmp_path / "b.nc"), "-q"]) == 2
    assert "a.nc: acceleration of sample 4 = nan: must be a finite number" in capsys.readouterr().err


# -------------------------------------------------------------------------------------- damage


@pytest.fixture(scope="module")
def contents(sources: list[Path]) -> list[bytes]:
    return results.contents(sources)


@settings(reproducible, max_examples=50)
@given(seed=edits.seeds)
def test_damaged_results_are_read_or_refused_in_one_line(sources: list[Path], contents: list[bytes], seed: int) -> None:
    results.damaged(sources[0].parent, contents, seed)


def test_a_library_in_an_endless_loop_is_given_up(
    grid: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A list of the file whose entries have the length 0: HDF5 goes from one to itself."""
    content = bytearray(grid.read_bytes())
    heap = content.index(b"GCOL") + 16
    content[heap + 2 * 24 : heap + 20 * 24] = bytes(18 * 24)
    (tmp_path / "a.nc").write_bytes(content)
    with mock.patch.object(guard, "STEP_SECONDS", 0):
        for command in (["info"], ["run"], ["chart"]):
            assert main([command[0], str(tmp_path / "a.nc"), *command[1:]]) == 2
            assert "a.nc: damaged: reading it does not come to an end" in capsys.readouterr().err


@pytest.mark.parametrize("how", ["_forked", "_spawned"])
@pytest.mark.parametrize(
    ("read", "message"),
    [
        (trials.endless, "damaged: reading it does not come to an end"),
        (trials.broken, r"damaged: the netCDF library fails on it \(SIGABRT\)"),
        (trials.greedy, "damaged: reading it takes more memory than"),
        (trials.refused, "a.nc: ± is none"),
        (trials.failing, r"not a netCDF file, or a damaged one \(HDF error\)"),
    ],
)
def test_reading_is_tried_out_in_another_process(
    how: str, read: guard.Trial, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Copies of the process and new ones (as on Windows and macOS) alike."""
    monkeypatch.setattr(guard, "STEP_SECONDS", 0)
    monkeypatch.setattr(guard, "_forked", getattr(guard, how))
    if how == "_spawned":
        monkeypatch.setattr(sys, "path", [str(ROOT), *sys.path])
        if read is trials.endless:
            monkeypatch.setattr(guard, "_WAIT_SECONDS", 2)  # the new process has its own STEP_SECONDS
    with pytest.raises(InputError, match=message):
        guard.try_out(read, Path("a.nc"))


def test_trying_out_can_be_interrupted(tmp_path: Path) -> None:
    """Ctrl-C ends both processes."""
    code = "from tests.support import trials as t; from slipsweep.files import guard; from pathlib import Path; "
    code += "print(flush=True); guard.STEP_SECONDS = 60; guard.try_out(t.endless, Path('a.nc'))"
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    # the copy holds the other end of the pipe as well: it is at its end when both are gone
    assert "KeyboardInterrupt" in process.communicate(timeout=20)[1]
