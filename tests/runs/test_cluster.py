"""Sweeps on clusters: real scheduler and worker processes on loopback, and what is left when they are killed."""

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

import slipsweep
from slipsweep.cli import main
from slipsweep.errors import InputError, RunError
from slipsweep.files import spec
from slipsweep.runs import cluster, store
from slipsweep.runs.jobs import sweep_job
from slipsweep.runs.parts import installation
from tests.support import fault_rounds, namespaces
from tests.support.commands import command
from tests.support.processes import slipsweep as slipsweep_process

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

SWEEP = """
[axes.theta]
start = 0
stop = 20
num = 24
[axes.mu_s]
start = 0.3
stop = 0.9
num = 20
[axes.amplitude]
start = 0.5
stop = 9
num = 10
[axes.frequency]
values = [1, 2]
"""

#: 24 chunks, each of some milliseconds: enough to be killed among them.
SLOW = SWEEP + '[solver]\nmethod = "step"\nsteps_per_cycle = 1024\n'
CHUNK_CELLS = 400


def dask(*arguments: str) -> "subprocess.Popen[bytes]":
    """Start `dask scheduler` or `dask worker`."""
    options = ("--host", "127.0.0.1", "--no-dashboard")
    # by default half a minute goes by until a result is given up that a killed worker had
    environment = {**os.environ, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s"}
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments, *options],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment,
    )  # fmt: skip


@contextlib.contextmanager
def scheduler(folder: Path) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """A scheduler of one's own: its address and its process."""
    file = folder / "scheduler.json"
    with dask("scheduler", "--port", "0", "--scheduler-file", str(file)) as process:
        try:
            address = ""
            for _ in range(600):
                with contextlib.suppress(OSError, json.JSONDecodeError):  # not there, or not whole, yet
                    address = json.loads(file.read_text())["address"]
                    break
                time.sleep(0.05)
            assert address, "no scheduler"
            yield address, process
        finally:
            process.kill()


@contextlib.contextmanager
def workers(address: str, count: int) -> Iterator[None]:
    """Workers of one thread each, without nannies: a worker that is killed stays dead."""
    with contextlib.ExitStack() as stack:
        client = stack.enter_context(distributed.Client(address, set_as_default=False))
        there = len(client.nthreads())
        for _ in range(count):
            process = stack.enter_context(dask("worker", address, "--nthreads", "1", "--no-nanny"))
            stack.callback(process.kill)
        client.wait_for_workers(there + count, timeout=60)
        client.close()
        yield


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A scheduler with two workers."""
    with scheduler(tmp_path_factory.mktemp("scheduler")) as (found, _), workers(found, 2):
        yield found


def run(text: str, path: Path, **options: Any) -> store.Report:
    """`store.run` in several chunks."""
    return store.run(
        sweep_job(spec.parse(text, "a.toml")), path, command="slipsweep run", chunk_cells=CHUNK_CELLS, **options
    )


def assert_same_bits(one: Path, other: Path) -> None:
    with netCDF4.Dataset(one) as a, netCDF4.Dataset(other) as b:
        assert {*a.variables} == {*b.variables}
        for name in a.variables:
            for file in (a, b):
                file[name].set_auto_maskandscale(False)
            assert a[name].dtype == b[name].dtype
            assert a[name][...].tobytes() == b[name][...].tobytes(), name


# ------------------------------------------------------------------------- what they compute


def test_chunks_of_a_cluster_are_those_of_one_process(address: str, tmp_path: Path) -> None:
    progress: list[int] = []
    here = run(SWEEP, tmp_path / "here.nc")
    with cluster.cluster(scheduler=address) as solved:
        there = run(SWEEP, tmp_path / "there.nc", solved=solved, progress=progress.append)
    assert_same_bits(tmp_path / "here.nc", tmp_path / "there.nc")
    assert there.tally == here.tally
    assert sum(progress) == here.tally.cells == 24 * 20 * 10 * 2
    assert len(progress) >= 24


def test_case_tables_and_results_without_frequency(address: str, tmp_path: Path) -> None:
    text = "".join(f"[[cases]]\ntheta = {i % 20}\nmu_s = {0.4 + i / 2000}\n" for i in range(900))
    text += "[axes.amplitude]\nvalues = [2, 4]\n[axes.frequency]\nvalues = [1]\n"
    text += '[output]\nvariables = ["decay_rate"]\ndtype = "float32"\n'
    progress: list[int] = []
    run(text, tmp_path / "here.nc")
    with cluster.cluster(scheduler=address) as solved:
        run(text, tmp_path / "there.nc", solved=solved, progress=progress.append)
    assert_same_bits(tmp_path / "here.nc", tmp_path / "there.nc")
    assert sum(progress) == 1800


def test_the_command_uses_a_scheduler_or_starts_workers(address: str, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    for name, options in {"here": (), "scheduler": ("--scheduler", address), "workers": ("--workers", "2")}.items():
        # workers of its own are processes that import what the command's process ran
        start = slipsweep_process if name == "workers" else command
        done = start(tmp_path, "run", "a.toml", "-o", f"{name}.nc", *options)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("9600 cells (24 theta x 20 mu_s x 10 amplitude x 2 frequency)")
    assert_same_bits(tmp_path / "here.nc", tmp_path / "scheduler.nc")
    assert_same_bits(tmp_path / "here.nc", tmp_path / "workers.nc")


GRID: dict[str, Any] = {
    "theta": np.linspace(0.0, 15.0, 12),
    "mu_s": np.linspace(0.2, 0.9, 10),
    "amplitude": np.linspace(0.5, 13.0, 9),
    "frequency": [1.0, 2.0],
    "variables": ["permanent_displacement", "peak_relative_velocity", "validity", "limiting_acceleration"],
}


@pytest.mark.parametrize("kind", ["synchronous", "threads", "processes", "distributed"])
def test_lazy_sweeps_have_the_same_bits_under_every_scheduler(kind: str, address: str) -> None:
    expected = slipsweep.sweep(**GRID)
    lazy = slipsweep.sweep(**GRID, chunks={"theta": 5, "mu_s": 4})
    if kind == "distributed":
        with distributed.Client(address, set_as_default=False) as client:
            found = lazy.compute(scheduler=client)
    else:
        options = {"num_workers": 2} if kind == "processes" else {}
        found = lazy.compute(scheduler=kind, **options)
    assert set(found.data_vars) == set(GRID["variables"])
    for name in GRID["variables"]:
        assert found[name].dtype == expected[name].dtype
        assert found[name].values.tobytes() == expected[name].values.tobytes(), name


# -------------------------------------------------------------------------- what is killed


def test_a_killed_worker_loses_nothing(address: str, tmp_path: Path) -> None:
    run(SLOW, tmp_path / "here.nc")
    killed: list[str] = []

    with distributed.Client(address, set_as_default=False) as client:
        staying = client.run(os.getpid)  # those of the other tests
        with workers(address, 2):
            pids = client.run(os.getpid)
            assert len(pids) == 4

            def kill(cells: int) -> None:
                """Kill a worker that has chunks to solve, when the first chunk and again when another is back."""
                working = [worker for worker, tasks in client.processing().items() if tasks]
                busy = [worker for worker in working if worker not in (*staying, *killed)]
                if len(killed) < 2 and busy:
                    os.kill(pids[busy[0]], 9)
                    killed.append(busy[0])

            with cluster.cluster(scheduler=address) as solved:
                report = run(SLOW, tmp_path / "there.nc", solved=solved, progress=kill)
    assert len(killed) == 2
    assert report.tally.cells == 9600
    assert_same_bits(tmp_path / "here.nc", tmp_path / "there.nc")


@pytest.mark.parametrize("split", [False, True])
def test_a_killed_scheduler_leaves_a_run_that_can_be_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], address: str, split: bool
) -> None:
    """Also: no worker, no run."""
    there = address
    (tmp_path / "slow.toml").write_text(SLOW)
    whole_run: Callable[..., store.Report] = store.run
    command = ["run", str(tmp_path / "slow.toml"), "-o", str(tmp_path / "a.nc"), *(["--split"] if split else [])]
    back = 0
    with scheduler(tmp_path) as (address, process):
        with (
            pytest.raises(RunError, match=f"{address} has had no worker for 0 s: start some with: dask worker"),
            cluster.cluster(scheduler=address, patience=0.1) as solved,
        ):
            run(SWEEP, tmp_path / "none.nc", solved=solved)
        assert not (tmp_path / "none.nc").exists()

        def kill(cells: int) -> None:
            nonlocal back
            back += 1
            if back == 3:
                process.kill()

        def killing_run(*arguments: Any, **options: Any) -> store.Report:
            return whole_run(*arguments, **options | {"chunk_cells": CHUNK_CELLS, "progress": kill})

        monkeypatch.setattr(store, "run", killing_run)
        with workers(address, 1):
            capfd.readouterr()
            status = main([*command, "--scheduler", address])
    output, errors = capfd.readouterr()
    expected = (
        rf"slipsweep: error: the scheduler at {address} was lost; (\d+) of 24 chunks are kept; go on with --resume\n"
    )
    found = re.fullmatch(expected, errors)
    assert found, errors
    assert (status, output) == (1, "")
    assert 3 <= int(found[1]) < 24
    assert not (tmp_path / "a.nc").exists()

    # on another cluster, only what is missing
    again: list[int] = []

    def counting_run(*arguments: Any, **options: Any) -> store.Report:
        def counted(sweep: spec.SweepSpec, missing: Any, progress: Any) -> Any:
            again.extend(missing)
            return options["solved"](sweep, missing, progress)

        return whole_run(*arguments, **options | {"solved": counted})

    monkeypatch.setattr(store, "run", counting_run)
    assert main([*command, "--scheduler", there, "--resume", "-q"]) == 0
    assert len(again) == 24 - int(found[1])
    monkeypatch.undo()
    run(SLOW, tmp_path / "here.nc", split=split)
    if split:
        for file in sorted((tmp_path / "here.nc").iterdir()):
            assert_same_bits(file, tmp_path / "a.nc" / file.name)
    else:
        assert_same_bits(tmp_path / "here.nc", tmp_path / "a.nc")


# ---------------------------------------------------------------------------- by real means


@pytest.mark.slow
def test_machines_without_a_common_folder_one_killed_and_one_cut_off(tmp_path: Path) -> None:
    """Scheduler, client and two workers in network namespaces of their own, over TLS."""
    if reason := namespaces.cannot():
        pytest.skip(reason)
    pytest.importorskip("cryptography")
    home, keys = tmp_path / "home", tmp_path / "keys"
    home.mkdir()
    keys.mkdir()
    # a worker that is silent for so long is given up
    short = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "10s", "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s"}
    environment = {**os.environ, **namespaces.certified(keys), **short}
    text = SLOW.replace("1024", "4096").replace("num = 10\n", "num = 50\n")  # 480 chunks
    (home / "a.toml").write_text(text)
    journal = home / "a.nc.parts" / "journal"

    def finished() -> int:
        return journal.read_text().count("\n") if journal.exists() else 0

    with namespaces.machines(4) as (first, desk, one, other), contextlib.ExitStack() as stack:

        def start(machine: namespaces.Machine, *words: str, without: Path | None = home) -> "subprocess.Popen[str]":
            errors = subprocess.DEVNULL if without else subprocess.PIPE
            command = machine.command(sys.executable, *words, without=without)
            process = stack.enter_context(
                subprocess.Popen(command, env=environment, cwd="/", text=True, stdout=subprocess.DEVNULL, stderr=errors)
            )
            stack.callback(process.kill)
            return process

        address = f"tls://{first.address}:8786"
        start(first, "-m", "dask", "scheduler", "--protocol", "tls", "--host", first.address, "--no-dashboard")
        # what a worker imports while it is asked would keep it silent
        options = ("--nthreads", "1", "--no-dashboard", "--preload", "slipsweep.runs.cluster")
        worker = ("-m", "dask", "worker", address, *options, "--host")
        killed = start(one, *worker, one.address, "--no-nanny")
        start(other, *worker, other.address)
        command = ("run", str(home / "a.toml"), "-q", "-o", str(home / "a.nc"), "--scheduler", address)
        client = start(desk, "-c", fault_rounds.COMMAND, "25700", *command, without=None)
        fault_rounds.wait_for(client, lambda: finished() >= 20)
        killed.kill()
        fault_rounds.wait_for(client, lambda: finished() >= 60)
        other.link("down")
        time.sleep(15)
        silent = finished()
        time.sleep(1)
        assert client.poll() is None
        assert 60 <= silent == finished() < 480  # nobody is left
        other.link("up")
        assert fault_rounds.ended(client) == (0, "")
        came = desk.received()
    run(text, tmp_path / "here.nc")
    assert_same_bits(tmp_path / "here.nc", home / "a.nc")
    assert came > 0.9 * (home / "a.nc").stat().st_size  # all results went to the client, and by this link


@pytest.mark.slow
def test_a_thousand_million_cells_written_by_workers(tmp_path: Path) -> None:
    if shutil.disk_usage(tmp_path).free < 6e9:
        pytest.skip("needs 6 GB of disk")
    axes = {"theta": (0, 20, 100), "mu_s": (0.2, 0.9, 100), "amplitude": (0.5, 13, 1000), "frequency": (0.1, 20, 100)}
    text = "".join(f"[axes.{name}]\nstart = {a}\nstop = {b}\nnum = {n}\n" for name, (a, b, n) in axes.items())
    (tmp_path / "a.toml").write_text(
        f'{text}[output]\nvariables = ["permanent_displacement"]\ndtype = "float32"\n', encoding="utf-8"
    )
    output = str(tmp_path / "a.zarr")
    assert main(["run", str(tmp_path / "a.toml"), "-o", output, "--workers", "2"]) == 0
    assert main(["verify", output]) == 0
    data = slipsweep.open_result(output).permanent_displacement
    assert data.size == 10**9
    part = {"theta": [37], "mu_s": [42, 99], "amplitude": [0, 500, 999]}
    there = data.isel(part)
    inputs = {name: there[name].values for name in axes}
    here = slipsweep.sweep(**inputs, variables=["permanent_displacement"]).permanent_displacement
    assert there.values.tobytes() == here.values.astype("f4").tobytes()
    shutil.rmtree(output)


# ------------------------------------------------------------------------- what is refused


def test_other_versions_are_refused(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with distributed.Client(address, set_as_default=False) as client:
        # a worker that came after the first look
        late = client.submit(cluster._solve, installation() | {"slipsweep version": "9.9"}, {}, pure=False)
        message = rf"worker at tcp://.* has slipsweep version {slipsweep.__version__}, this process has 9\.9"
        with pytest.raises(RunError, match=message):
            late.result(timeout=60)
    # the same number, but other sources
    monkeypatch.setattr(cluster, "installation", lambda: installation() | {"slipsweep sources": "abc"})
    message = r"worker at tcp://.* has slipsweep sources [0-9a-f]{16}, this process has abc: install the same versions"
    with pytest.raises(RunError, match=message), cluster.cluster(scheduler=address) as solved:
        run(SWEEP, tmp_path / "a.nc", solved=solved)
    assert not (tmp_path / "a.nc").exists()


def test_nobody_at_the_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_SILENCE", 0.3)
    message = r"no scheduler answers at tcp://127\.0\.0\.1:9: "
    with pytest.raises(RunError, match=message), cluster.cluster(scheduler="127.0.0.1:9") as solved:
        run(SWEEP, tmp_path / "a.nc", solved=solved)


def test_nothing_to_solve_starts_nothing() -> None:
    with cluster.cluster(scheduler="127.0.0.1:9") as solved:
        assert list(solved(spec.parse(SWEEP, "a.toml").plan(), {}, None)) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--workers", "0"), "--workers = 0: must be from 1 to 1024"),
        (("--workers", "-3"), "--workers = -3: must be from 1 to 1024"),
        (("--workers", "100000"), "--workers = 100000: must be from 1 to 1024"),
        (("--workers", "two"), "'--workers'"),
        (("--workers", "2", "--scheduler", "a:1"), "--workers, --scheduler: give one of them, not both"),
        (("--scheduler", ""), '--scheduler = "": must be HOST:PORT'),
        (("--scheduler", "host"), '--scheduler = "host": must be HOST:PORT'),
        (("--scheduler", "host:0"), '--scheduler = "host:0": must be HOST:PORT'),
        (("--scheduler", "host:99999"), '--scheduler = "host:99999": must be HOST:PORT'),
        (("--scheduler", "http://host:80"), '--scheduler = "http://host:80": must be HOST:PORT'),
    ],
)
def test_bad_options_are_refused_in_one_line(
    arguments: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    assert main(["run", str(tmp_path / "a.toml"), "-o", str(tmp_path / "a.nc"), *arguments]) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert message in errors
    assert not (tmp_path / "a.nc").exists()


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: None)
    message = r"need the package distributed: pip install 'slipsweep\[cluster\]'"
    with pytest.raises(InputError, match=message), cluster.cluster(workers=2):
        pass
