"""Zarr stores: what they hold, who reads them, workers that write them, and addresses of an S3 server on loopback."""

import json
import pickle
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.runs import cluster, store
from slipsweep.runs.jobs import sweep_job
from slipsweep.runs.verify import verify
from tests.support import fault_rounds
from tests.support.fault_rounds import SWEEP, Stop, counting, run, stopping
from tests.support.processes import workers

zarr = pytest.importorskip("zarr")
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning"),
    pytest.mark.usefixtures("tried_here"),
]

#: Cells of a chunk where each takes messages: 15 chunks.
LARGE = 4 * fault_rounds.CELLS

#: Labels of cases, of which none is ASCII only.
CASES = """
[axes.amplitude]
values = [2, 4, 6]
[axes.frequency]
values = [1, 2]
[[cases]]
label = "Böschung – λ"
theta = 5
mu_s = 0.4
[[cases]]
label = "b"
theta = 10
mu_s = 0.5
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same sweeps as one netCDF file, as a folder of them and as a store."""
    folder = tmp_path_factory.mktemp("results")
    for name, text in (("grid", SWEEP), ("cases", CASES)):
        cells = 4000 if name == "grid" else 3
        run(folder / f"{name}.nc", text, chunk_cells=cells)
        run(folder / f"{name}.zarr", text, chunk_cells=cells)
        run(folder / name, text, chunk_cells=cells, split=True)
    return folder


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Bit for bit, with all that describes it."""
    assert list(one.data_vars) == list(other.data_vars)
    assert {*one.coords} == {*other.coords}
    for name in one.variables:
        first, second = one[name], other[name]
        assert first.dims == second.dims, name
        if first.dtype.kind in "OUT":
            assert first.values.tolist() == second.values.tolist(), name
        else:
            assert first.dtype == second.dtype, name
            assert first.values.tobytes() == second.values.tobytes(), name
        for key, value in first.attrs.items():
            assert np.array_equal(value, second.attrs[key]), (name, key)
        assert first.attrs.keys() == second.attrs.keys(), name
    for name in one.attrs.keys() | other.attrs.keys():
        assert name in ("history", "slipsweep_run") or np.array_equal(one.attrs[name], other.attrs[name]), name


@pytest.mark.parametrize("name", ["grid", "cases"])
def test_a_result_is_the_same_in_every_format(results: Path, name: str) -> None:
    whole = slipsweep.open_result(results / f"{name}.nc")
    assert_same(whole, slipsweep.open_result(results / f"{name}.zarr"))
    if name == "grid":  # the cases of split files have numbers
        assert_same(whole, slipsweep.open_result(results / name))


def test_a_result_is_opened_in_the_chunks_that_it_was_written_in(results: Path) -> None:
    for path in ("grid.nc", "grid", "grid.zarr"):
        chunks = slipsweep.open_result(results / path).permanent_displacement.chunks
        assert chunks is not None
        assert [max(lengths) for lengths in chunks] == [1, 10, 40, 10], path
    lazy = slipsweep.open_result(results / "grid.nc")
    one = slipsweep.sweep(
        theta=lazy.theta.values, mu_s=lazy.mu_s.values, amplitude=lazy.amplitude.values, frequency=lazy.frequency.values
    )
    assert lazy.permanent_displacement.values.tobytes() == one.permanent_displacement.values.tobytes()
    assert lazy.sliding_mode.dtype == one.sliding_mode.dtype
    assert float(lazy.permanent_displacement.mean()) == pytest.approx(
        float(one.permanent_displacement.mean()), rel=1e-12
    )


def test_threads_read_a_file_together(results: Path) -> None:
    import dask

    for path in ("grid.nc", "grid.zarr"):
        lazy = slipsweep.open_result(results / path).permanent_displacement
        expected = lazy.compute(scheduler="synchronous")
        with dask.config.set(scheduler="threads", num_workers=8):
            for _ in range(5):
                assert lazy.compute().values.tobytes() == expected.values.tobytes()


def test_another_implementation_reads_a_store(results: Path) -> None:
    tensorstore = pytest.importorskip("tensorstore")
    own = slipsweep.open_result(results / "grid.zarr")
    for name in ("permanent_displacement", "sliding_mode", "theta"):
        place = {"driver": "file", "path": str(results / "grid.zarr" / name)}
        other = tensorstore.open({"driver": "zarr3", "kvstore": place}).result()
        assert list(other.domain.labels) == list(own[name].dims)
        assert np.asarray(other.read().result()).tobytes() == own[name].values.tobytes()


def test_xarray_alone_reads_a_store(results: Path) -> None:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("error", category=RuntimeWarning)  # of metadata that are not consolidated
        data = xr.open_zarr(results / "grid.zarr")
    assert data.permanent_displacement.attrs["units"] == "m"
    whole = xr.open_dataset(results / "grid.nc")
    xr.testing.assert_identical(data.drop_attrs().compute(), whole.drop_attrs().compute())


def test_a_store_is_not_open_to_readers_before_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    with pytest.raises(Stop):
        run(path, solved=stopping(20))
    assert not path.exists()
    place = tmp_path / "a.zarr.parts" / "data.zarr"
    assert not (place / "zarr.json").exists()
    with pytest.raises(InputError, match="holds 20 finished chunks"):
        run(path)
    numbers: list[int] = []
    run(path, resume=True, solved=counting(numbers))
    assert numbers == list(range(20, 60))
    assert verify(path).damaged == []
    assert not (tmp_path / "a.zarr.parts").exists()
    assert run(path, resume=True).found
    with pytest.raises(InputError, match="exists already; give --overwrite"):
        run(path)
    run(path, overwrite=True)


@pytest.mark.parametrize("name", ["checksums/chunk_checksum", "theta", "permanent_displacement"])
def test_a_stopped_store_that_lost_an_array_is_begun_anew(results: Path, tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.zarr"
    with pytest.raises(Stop):
        run(path, solved=stopping(20))
    (tmp_path / "a.zarr.parts" / "data.zarr" / name / "zarr.json").unlink()
    numbers: list[int] = []
    run(path, resume=True, solved=counting(numbers))
    assert numbers == list(range(60))
    xr.testing.assert_identical(
        xr.open_zarr(path).drop_attrs().compute(), xr.open_zarr(results / "grid.zarr").drop_attrs().compute()
    )


@pytest.mark.parametrize("split", [False, True, None], ids=["one file", "split", "zarr"])
def test_every_changed_byte_of_the_results_is_found(results: Path, tmp_path: Path, split: bool | None) -> None:
    source = results / {False: "grid.nc", True: "grid", None: "grid.zarr"}[split]
    path = tmp_path / source.name
    (shutil.copytree if source.is_dir() else shutil.copy)(source, path)
    assert (verify(path).chunks, verify(path).damaged) == (60, [])
    if split is None:
        victim = path / "permanent_displacement" / "c" / "17" / "1" / "0" / "0"
    else:
        victim = path / "chunk-000035.nc" if split else path
    content = victim.read_bytes()
    values = slipsweep.open_result(results / "grid.nc").permanent_displacement
    at = content.index(values.isel(theta=17, mu_s=slice(10, 20)).values.tobytes()[-64:])
    victim.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
    (damaged,) = verify(path).damaged
    assert "chunk 35 (theta 17 to 17, mu_s 10 to 19, amplitude 0 to 39, frequency 0 to 9)" in damaged


def test_a_changed_attribute_or_coordinate_is_found(results: Path, tmp_path: Path) -> None:
    shutil.copytree(results / "grid.zarr", tmp_path / "a.zarr")
    head = tmp_path / "a.zarr" / "zarr.json"
    told = json.loads(head.read_text())
    told["attributes"]["g"] = 9.82
    head.write_text(json.dumps(told))
    assert verify(tmp_path / "a.zarr").damaged == ["coordinates or attributes"]
    shutil.copy(results / "grid.nc", tmp_path / "a.nc")
    import netCDF4

    with netCDF4.Dataset(tmp_path / "a.nc", "a") as file:
        file["theta"][3] = 2.07
    assert verify(tmp_path / "a.nc").damaged == ["coordinates or attributes"]


def test_verify_tells_by_its_status(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(results / "grid.nc")]) == 0
    assert "60 chunks, coordinates and attributes are as they were written" in capsys.readouterr().out
    shutil.copytree(results / "grid", tmp_path / "grid")
    (tmp_path / "grid" / "chunk-000007.nc").unlink()
    assert main(["verify", str(tmp_path / "grid")]) == 1
    printed = capsys.readouterr()
    assert "chunk-000007.nc: no such file" in printed.out
    assert "1 places are not as they were written" in printed.err
    xr.open_dataset(results / "grid.nc").drop_attrs().to_netcdf(tmp_path / "other.nc")
    assert main(["verify", str(tmp_path / "other.nc")]) == 2


@pytest.mark.parametrize("name", ["a.zarr", "a"])
def test_compressed_results_are_smaller_and_the_same(results: Path, tmp_path: Path, name: str) -> None:
    text = f"{SWEEP}compression = 5\n"
    split = name == "a"
    run(tmp_path / name, text, split=split)
    assert verify(tmp_path / name).damaged == []
    packed, plain = (slipsweep.open_result(path) for path in (tmp_path / name, results / "grid.nc"))
    for one in plain.data_vars:
        assert packed[one].values.tobytes() == plain[one].values.tobytes()
    if split:
        import netCDF4

        with netCDF4.Dataset(tmp_path / name / "chunk-000030.nc") as file:
            filters = file["permanent_displacement"].filters()
        assert (filters["zlib"], filters["shuffle"], filters["complevel"]) == (True, True, 5)
        assert (tmp_path / name / "chunk-000030.nc").stat().st_size < (
            results / "grid" / "chunk-000030.nc"
        ).stat().st_size
    with pytest.raises(InputError, match=r"output.compression = 5: .* is one netCDF file"):
        run(tmp_path / "a.nc", text)


@pytest.mark.usefixtures("without_layout")
def test_commands_read_a_store_as_a_file(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What they print and write is the same, but for names, sizes and when it was made."""
    for name in ("grid", "cases"):
        told = []
        for suffix in (".nc", ".zarr"):
            assert main(["info", str(results / f"{name}{suffix}")]) == 0
            told.append([line for line in capsys.readouterr().out.splitlines()[1:] if not line.startswith("history")])
            table = tmp_path / f"{name}{suffix}.csv"
            some = ("--at", "theta=0") if name == "grid" else ()
            assert main(["export", str(results / f"{name}{suffix}"), *some, "-o", str(table)]) == 0
            figure = tmp_path / f"{name}{suffix}.png"
            at = (*some, "--at", "frequency=0.1") if name == "grid" else ("--at", "case=b")
            kind = ("--kind", "contours" if name == "grid" else "families")
            assert main(["chart", str(results / f"{name}{suffix}"), *kind, *at, "-o", str(figure)]) == 0
            again = tmp_path / f"{name}{suffix}.again.nc"
            assert main(["run", str(results / f"{name}{suffix}"), "-o", str(again), "-q"]) == 0
            assert_same(slipsweep.open_result(again), slipsweep.open_result(results / f"{name}.nc"))
            capsys.readouterr()
        assert told[0] == told[1]
        for suffix in (".csv", ".png"):
            assert (tmp_path / f"{name}.nc{suffix}").read_bytes() == (tmp_path / f"{name}.zarr{suffix}").read_bytes()


def test_limits_go_into_a_store_as_into_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(CASES, encoding="utf-8")
    for name in ("a.nc", "a.zarr"):
        assert main(["limit", str(tmp_path / "a.toml"), "-d", "1cm", "-o", str(tmp_path / name), "-q"]) == 0
    assert verify(tmp_path / "a.zarr").damaged == []
    assert_same(slipsweep.open_result(tmp_path / "a.nc"), slipsweep.open_result(tmp_path / "a.zarr"))


# ------------------------------------------------------------------------------- workers


def test_workers_write_their_chunks_themselves(results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes back from them is what goes on record: no results pass through the client."""
    came: list[Any] = []
    result = cluster._Run._result

    def counted(self: Any, future: Any, number: int) -> Any:
        came.append(result(self, future, number))
        return came[-1]

    monkeypatch.setattr(cluster._Run, "_result", counted)
    nbytes = (results / "grid.nc").stat().st_size
    with workers(2) as address:
        for name, split in (("a.zarr", False), ("a", True)):
            came.clear()
            with cluster.cluster(scheduler=address) as solved:
                run(tmp_path / name, split=split, shared=True, solved=solved, chunk_cells=LARGE)
            assert len(came) == 15
            assert {type(one).__name__ for one in came} == {"Delivered"}
            # however many cells a chunk has: names, a checksum and counts
            assert sum(len(pickle.dumps(one)) for one in came) < 15 * 1000 < nbytes / 120
            assert verify(tmp_path / name).damaged == []
            assert_same(slipsweep.open_result(tmp_path / name), slipsweep.open_result(results / "grid.nc"))


# ------------------------------------------------------------------------------- addresses


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """A bucket of an S3 server on the loopback interface."""
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    running.start()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AWS_ACCESS_KEY_ID", "x")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "x")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        patch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
        import s3fs

        s3fs.S3FileSystem.clear_instance_cache()
        s3fs.S3FileSystem().mkdir("results")
        yield "s3://results"
    running.stop()


def test_a_store_at_an_address(
    results: Path, tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(SWEEP)
    address = f"{bucket}/grid.zarr"
    assert main(["run", "a.toml", "-o", address, "-q"]) == 0, capsys.readouterr().err
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.toml"]
    assert_same(slipsweep.open_result(address), slipsweep.open_result(results / "grid.nc"))
    assert main(["verify", address]) == 0
    assert main(["run", "a.toml", "-o", address]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["run", "a.toml", "-o", address, "--resume"]) == 0
    assert "complete already" in capsys.readouterr().out


def test_a_run_at_an_address_goes_on(tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    job = sweep_job(spec.parse(SWEEP, "a.toml"))
    address = f"{bucket}/stopped.zarr"
    with pytest.raises(Stop):
        store.run(job, address, command="x", chunk_cells=LARGE, solved=stopping(4))
    with pytest.raises(InputError, match="no such store, or one that is not complete"):
        slipsweep.open_result(address)
    numbers: list[int] = []
    store.run(job, address, command="x", resume=True, solved=counting(numbers))
    assert numbers == list(range(4, 15))
    assert verify(address).damaged == []
    assert list(tmp_path.iterdir()) == []


def test_an_address_that_nobody_answers_at_is_one_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(SWEEP)
    for address, text in (("nowhere://x/a.zarr", "nowhere"), ("s3://x/a.nc", "must end in .zarr")):
        assert main(["run", "a.toml", "-o", address]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert text in line
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.toml"]
