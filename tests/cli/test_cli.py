"""The command line: exit status, messages, files; as a process of its own where that is what counts."""

import csv
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import llvmlite.binding
import netCDF4
import numpy as np
import pytest
import xarray as xr
from llvmlite.binding.ffi import ObjectRef

from slipsweep import cli
from slipsweep.cli.signals import Interrupted, interrupting
from tests.support.commands import command
from tests.support.processes import SLIPSWEEP, on_a_terminal, slipsweep

SWEEPS = Path(__file__).parents[2] / "sweeps"
SMALL = """
[axes.theta]
values = [0, 5]
[axes.mu_s]
values = [0.3, 0.5]
[axes.amplitude]
values = [1, 4]
[axes.frequency]
values = [1, 2]
"""

#: Two thousand million cells, a byte each: minutes of work.
LONG = """
[axes.theta]
start = 0
stop = 20
num = 200
[axes.mu_s]
start = 0.2
stop = 0.9
num = 100
[axes.amplitude]
start = 0.5
stop = 14
num = 1000
[axes.frequency]
start = 0.1
stop = 20
num = 100
[output]
variables = ["sliding_mode"]
"""

SIMULATE = ("simulate", "--theta", "5", "--mu-s", "0.38", "--amplitude", "3.55", "--frequency", "1.8")


def assert_fails(done: "subprocess.CompletedProcess[str]", status: int, *messages: str) -> None:
    """Check the exit status, and that there is one line that says why."""
    assert done.returncode == status, done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith("slipsweep: error: ")
    assert done.stderr.count("\n") == 1
    for message in messages:
        assert message in done.stderr


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A folder with a small sweep file in it."""
    (tmp_path / "small.toml").write_text(SMALL)
    return tmp_path


def names(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


# ------------------------------------------------------------------------------------- run


def test_run_paper(tmp_path: Path) -> None:
    done = slipsweep(tmp_path, "run", SWEEPS / "paper.toml")
    assert done.returncode == 0
    assert done.stderr == ""  # no progress bar but on a terminal
    assert done.stdout.startswith("2 cells (2 case) in ")
    assert "stick_slip               50.00%" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("paper.nc  ")
    with xr.open_dataset(tmp_path / "paper.nc") as dataset:
        assert list(dataset["label"].values) == ["stick-slip", "continuous"]
        # Table 1 of the paper
        np.testing.assert_allclose(dataset["limiting_acceleration"], [4.43, 3.92], atol=0.005)
        np.testing.assert_allclose(dataset["acceleration_ratio"], [0.80, 1.30], atol=0.005)


def test_run_repeats_a_result(small: Path) -> None:
    assert command(small, "run", "small.toml", "-o", "a.nc", "--solver", "step").returncode == 0
    assert slipsweep(small, "run", "a.nc", "-o", "b.nc", "--quiet").stdout == ""
    with netCDF4.Dataset(small / "a.nc") as one, netCDF4.Dataset(small / "b.nc") as other:
        assert other.sweep == SMALL
        assert other.solver == "step"
        assert list(one.variables) == list(other.variables)
        for name in one.variables:
            np.testing.assert_array_equal(one[name][:].filled(), other[name][:].filled())
        assert other.history.endswith("slipsweep run a.nc -o b.nc --quiet")


@pytest.mark.parametrize(
    ("text", "arguments", "name"),
    [
        (SMALL, (), "small.nc"),
        (SMALL + '[output]\npath = "mine.nc"', (), "mine.nc"),
        (SMALL + '[output]\npath = "mine.nc"', ("-o", "other.nc"), "other.nc"),
    ],
)
def test_the_name_of_the_output(tmp_path: Path, text: str, arguments: tuple[str, ...], name: str) -> None:
    (tmp_path / "small.toml").write_text(text)
    assert command(tmp_path, "run", "small.toml", *arguments).returncode == 0
    assert names(tmp_path) == {"small.toml", name}


def test_an_existing_output_is_replaced_only_when_told(small: Path) -> None:
    (small / "small.nc").write_text("mine")
    assert_fails(command(small, "run", "small.toml"), 2, "small.nc: exists already; give --overwrite")
    assert (small / "small.nc").read_text() == "mine"
    assert command(small, "run", "small.toml", "--overwrite").returncode == 0
    assert command(small, "info", "small.nc").returncode == 0
    assert names(small) == {"small.toml", "small.nc"}


def test_the_sweep_file_is_never_overwritten(small: Path) -> None:
    assert_fails(command(small, "run", "small.toml", "-o", "small.toml", "--overwrite"), 2, "which this command reads")
    assert (small / "small.toml").read_text() == SMALL


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "none.toml"), "none.toml: cannot be read: No such file"),
        (("run", "."), "cannot be read: Is a directory"),
        (("run", "bad.toml"), 'bad.toml: axes.theta.units = "kg": must be a unit that converts to degree'),
        (("run", "broken.toml"), "broken.toml: not valid TOML: "),
        (("run", "broken.nc"), "broken.nc: not a netCDF file"),
        (("run", "small.toml", "-o", "none/a.nc"), "none/a.nc: the folder none does not exist"),
        (("run", "small.toml", "-o", "small.toml/a.nc"), "the folder small.toml does not exist"),
        (("run", "small.toml", "-o", "."), "exists and is not a file"),
        (("run", "huge.toml"), "huge.toml: a grid of 1e+16 cells makes 1e+04 TB, but"),
        (("run", "small.toml", "--solver", "fast"), "'fast'"),
        (("run", "small.toml", "--overwrit"), "--overwrit"),
        (("run",), "Missing argument"),
        (("rum",), "No such command 'rum'"),
        (("info", "none.nc"), "none.nc: no such file"),
        (("info", "small.toml"), "small.toml: not a netCDF file"),
        ((*SIMULATE, "-o", "a.txt"), "a.txt: the name must end in one of .nc, .csv, .png, .svg, .pdf"),
        ((*SIMULATE, "-o", "small.csv"), "small.csv: exists already"),
        ((*SIMULATE, "--theta", "95"), "theta"),
        ((*SIMULATE, "--frequency", "0"), "frequency"),
        ((*SIMULATE, "--mu-s", "nan"), "mu_s"),
    ],
)
def test_bad_commands_fail_in_one_line(small: Path, arguments: tuple[str, ...], message: str) -> None:
    (small / "bad.toml").write_text(SMALL.replace("values = [0, 5]", 'values = [0, 5]\nunits = "kg"'))
    (small / "broken.toml").write_text("axes = [")
    (small / "broken.nc").write_text("nothing")
    (small / "small.csv").write_text("mine")
    grid = "".join(
        f"[axes.{name}]\nstart = 0.1\nstop = 9\nnum = 10000\n" for name in ("theta", "mu_s", "amplitude", "frequency")
    )
    (small / "huge.toml").write_text(grid + '[output]\nvariables = ["sliding_mode"]')
    before = names(small)
    assert_fails(command(small, *arguments), 2, message)
    assert names(small) == before


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files the POSIX way")
def test_a_full_disk_leaves_nothing_behind(tmp_path: Path) -> None:
    import resource

    limit = 2_000_000
    (tmp_path / "long.toml").write_text(LONG.replace('"sliding_mode"', '"permanent_displacement"'))
    done = slipsweep(
        tmp_path, "run", "long.toml", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    assert_fails(done, 1, "long.nc.parts/data.nc: writing failed: ", "is the disk full?")
    assert names(tmp_path) == {"long.toml"}


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_inside_a_destructor_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], number: signal.Signals
) -> None:
    """Python prints and drops what a destructor, or the end of a generator, raises."""

    def generator() -> Iterator[int]:
        try:
            yield 1
        finally:
            os.kill(os.getpid(), number)
            time.sleep(0.01)  # the handler runs here

    def run() -> None:
        next(generator())
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            time.sleep(0.001)

    (command,) = (one for one in cli.app.registered_commands if one.callback is cli.run.run)
    monkeypatch.setattr(command, "callback", run)
    before = [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)], sys.unraisablehook
    assert cli.main(["run"]) == 128 + number
    assert capsys.readouterr().err == "slipsweep: interrupted; nothing written\n"
    assert before == ([signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)], sys.unraisablehook)


def interrupted_at(event: str, function: Any, act: Callable[[], object]) -> list[object]:
    """Interrupt at an event of a function that `act` calls; what `act` returned, if it could."""
    sent: list[signal.Signals] = []
    returned: list[object] = []

    def trace(frame: FrameType, what: str, _: object) -> Any:
        if what == event and frame.f_code is function.__code__ and not sent:
            sent.append(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
        return trace

    def run() -> None:
        before = sys.gettrace()
        sys.settrace(trace)
        try:
            returned.append(act())
        finally:
            sys.settrace(before)
        time.sleep(60.0)  # it is raised here, and does not wait for the end

    started = time.monotonic()
    with pytest.raises(Interrupted), interrupting():
        run()
    assert sent
    assert time.monotonic() - started < 30.0
    return returned


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_a_signal_leaves_no_lock_held() -> None:
    """Between the call that takes a lock and what gives it back, an exception would leave it held for ever."""
    semaphore = threading.Semaphore(0)
    interrupted_at("return", threading.Condition.__enter__, lambda: semaphore.acquire(timeout=0))
    another = threading.Thread(target=semaphore.release, daemon=True)
    another.start()
    another.join(10.0)
    assert not another.is_alive()


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_a_signal_leaves_no_object_of_llvm_half_made() -> None:
    """One that is not made to the end prints a traceback when it goes."""
    (context,) = interrupted_at("call", ObjectRef.__init__, llvmlite.binding.create_context)
    assert isinstance(context, ObjectRef)


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_its_finished_chunks(tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "long.toml").write_text(LONG)
    with subprocess.Popen(
        [*SLIPSWEEP, "run", "long.toml"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            wait_until(lambda: (tmp_path / "long.nc.parts" / "journal").exists())
            time.sleep(0.2)  # well into the run
            assert process.poll() is None
            process.send_signal(number)
            output, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 128 + number
    assert output == ""
    assert re.fullmatch(r"slipsweep: interrupted; \d+ of 600 chunks are kept; go on with --resume\n", errors)
    assert names(tmp_path) == {"long.toml", "long.nc.parts"}
    assert_fails(slipsweep(tmp_path, "run", "long.toml"), 2, "finished chunks of an interrupted run", "--resume")


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_terminal_sees_progress(small: Path) -> None:
    assert "100%" in on_a_terminal(small, "run", "small.toml")
    assert (small / "small.nc").exists()


# ---------------------------------------------------------------------------- info, simulate


def test_info(small: Path) -> None:
    slipsweep(small, "run", "small.toml")
    done = command(small, "info", "small.nc")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[0].startswith("small.nc  ")
    assert "  theta                   2 values, 0 to 5 degree" in lines
    assert "  permanent_displacement  permanent displacement, downslope, m (float64)" in lines
    assert any(line.startswith("  stuck  ") and line.endswith("%") for line in lines)
    assert any(line.startswith("history: ") and line.endswith("slipsweep run small.toml") for line in lines)
    assert "  [axes.mu_s]" in lines


def test_a_reader_that_goes_away_is_no_error(small: Path) -> None:
    command(small, "run", "small.toml")
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*SLIPSWEEP, "info", "small.nc"], cwd=small, stdout=writer, stderr=subprocess.PIPE, timeout=60, check=False
    )
    os.close(writer)
    assert done.stderr == b""


def test_simulate_writes_every_kind(tmp_path: Path) -> None:
    outputs = [f"a{suffix}" for suffix in (".nc", ".csv", ".png", ".svg", ".pdf")]
    options = [part for output in outputs for part in ("-o", output)]
    done = command(tmp_path, *SIMULATE, "--cycles", "2", "--points", "64", *options)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("permanent displacement  ")
    assert "sliding mode            stick_slip\n" in done.stdout
    assert done.stdout.endswith("".join(f"{output}\n" for output in outputs))
    assert names(tmp_path) == set(outputs)
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        displacement = dataset["relative_displacement"]
        assert displacement.dims == dataset["time"].dims == ("instant",)
        with (tmp_path / "a.csv").open(newline="") as file:
            header, *rows = csv.reader(file)
        column = header.index("relative_displacement (m)")
        assert header[0] == "time (s)"
        np.testing.assert_array_equal([float(row[column]) for row in rows], displacement)
        assert float(displacement[-1]) == pytest.approx(float(dataset["permanent_displacement"]), rel=1e-9)
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert "<svg" in (tmp_path / "a.svg").read_text()


# --------------------------------------------------------------------------------- start-up


def imported(code: str, folder: Path) -> set[str]:
    """Return the packages that some code brings in."""
    code += "; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; {code}"], cwd=folder, capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_help_is_there_at_once(tmp_path: Path) -> None:
    heavy = {"numpy", "numba", "xarray", "netCDF4", "pydantic", "pint", "matplotlib", "dask", "pandas", "scipy"}
    assert not heavy & imported("from slipsweep.cli import main; main(['--help'])", tmp_path)


@pytest.mark.parametrize("sweep", ["small.toml", SWEEPS / "paper.toml"], ids=["axes", "cases"])
def test_run_imports_no_more_than_it_needs(small: Path, sweep: Path | str) -> None:
    heavy = {"xarray", "pandas", "dask", "pint", "matplotlib"}
    assert not heavy & imported(f"from slipsweep.cli import main; main(['run', {str(sweep)!r}, '-q'])", small)


def test_info_imports_no_more_than_it_needs(small: Path) -> None:
    command(small, "run", "small.toml", "-q")
    heavy = {"numba", "xarray", "pandas", "dask", "pint", "matplotlib", "scipy"}
    assert not heavy & imported("from slipsweep.cli import main; main(['info', 'small.nc'])", small)


@pytest.mark.parametrize("command", [(), ("run",), ("info",), ("simulate",)])
def test_help(tmp_path: Path, command: tuple[str, ...]) -> None:
    done = slipsweep(tmp_path, *command, "--help")
    assert done.returncode == 0
    assert "Usage: slipsweep" in done.stdout
