"""The command line: exit status, messages, files; as a process where that counts."""

import contextlib
import csv
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from slipsweep import cli
from slipsweep.cli.options import app
from tests.support.commands import SLIPSWEEP, command, run_command, slipsweep

SWEEPS = Path(__file__).parents[2] / "sweeps"
SMALL = """
[axes]
theta.values = [0, 5]
mu_s.values = [0.3, 0.5]
amplitude.values = [1, 4]
frequency.values = [1, 2]
"""

SIMULATE = (
    "simulate",
    "--theta",
    "5",
    "--mu-s",
    "0.38",
    "--amplitude",
    "3.55",
    "--frequency",
    "1.8",
)

#: All commands.
NAMES = sorted(one.callback.__name__ for one in app.registered_commands if one.callback is not None)


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


def test_a_run_of_the_papers_cases_gives_table_1(tmp_path: Path) -> None:
    done = command(tmp_path, "run", SWEEPS / "paper.toml")
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
    assert command(small, "run", "a.nc", "-o", "b.nc", "--quiet").stdout == ""
    with netCDF4.Dataset(small / "a.nc") as first, netCDF4.Dataset(small / "b.nc") as other:
        assert other.sweep == SMALL
        assert other.solver == "step"
        assert list(first.variables) == list(other.variables)
        for name in first.variables:
            np.testing.assert_array_equal(first[name][:].filled(), other[name][:].filled())
        assert other.history.endswith("slipsweep run a.nc -o b.nc --quiet")


def test_an_output_is_named_by_option_by_sweep_file_or_after_it(small: Path) -> None:
    (small / "other.toml").write_text(f'{SMALL}[output]\npath = "mine.nc"')
    for arguments, name in (
        (("small.toml",), "small.nc"),
        (("other.toml",), "mine.nc"),
        (("other.toml", "-o", "a.nc"), "a.nc"),
    ):
        before = names(small)
        assert command(small, "run", *arguments).returncode == 0
        assert names(small) - before == {name}


def test_a_sweep_from_standard_input(tmp_path: Path) -> None:
    done = subprocess.run(
        [*SLIPSWEEP, "run", "-", "-o", "a.nc"], cwd=tmp_path, input=SMALL, text=True, check=False
    )
    assert done.returncode == 0
    assert names(tmp_path) == {"a.nc"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "none.toml"), "none.toml: cannot be read: No such file"),
        (("run", "."), "cannot be read: Is a directory"),
        (
            ("run", "bad.toml"),
            'bad.toml: axes.theta.units = "kg": must be a unit that converts to degree',
        ),
        (("run", "broken.toml"), "broken.toml: not valid TOML: "),
        (("run", "small.toml", "-o", "none/a.nc"), "none/a.nc: the folder none does not exist"),
        (
            ("run", "small.toml", "-o", "small.pdf"),
            "small.pdf: the name must end in one of .nc, .zarr",
        ),
        (
            ("run", "small.toml", "-o", "small.CSV"),
            "small.CSV: the name must end in one of .nc, .zarr",
        ),
        (("run", "small.toml", "-o", "s3://a/b.nc"), "s3://a/b.nc: the name must end in .zarr"),
        (("run", "named.toml"), "b.pdf: the name must end in one of .nc, .zarr"),
        (("explore", "small.nc", "-o", "a.pdf"), "a.pdf: the name must end in one of .html, .htm"),
        (("info", "none.nc"), "none.nc: no such file"),
        (("info", "small.toml"), "small.toml: not a netCDF file"),
        (("info", "small.toml"), "); of a sweep file slipsweep run makes one"),
        (
            (*SIMULATE, "-o", "a.txt"),
            "a.txt: the name must end in one of .nc, .csv, .png, .svg, .pdf",
        ),
        ((*SIMULATE, "-o", "small.csv"), "small.csv: exists already"),
        ((*SIMULATE, "--theta", "95"), "theta"),
        ((*SIMULATE, "--mu-s", "nan"), "mu_s"),
        (
            (*SIMULATE, "--ramp-in", "7", "--ramp-out", "8"),
            "--ramp-in + --ramp-out = 15: must not exceed",
        ),
    ],
)
def test_bad_input_fails_in_one_line(small: Path, arguments: tuple[str, ...], message: str) -> None:
    (small / "bad.toml").write_text(SMALL.replace("[0, 5]", '[0, 5]\ntheta.units = "kg"'))
    (small / "broken.toml").write_text("axes = [")
    (small / "named.toml").write_text(f'{SMALL}[output]\npath = "b.pdf"\n')
    (small / "small.csv").write_text("mine")
    before = names(small)
    assert_fails(command(small, *arguments), 2, message)
    assert names(small) == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run",), "Missing argument"),
        (("rum",), "No such command 'rum'"),
        (
            ("run", "a.toml", "--ouput", "a.nc"),
            "No such option: --ouput (Possible options: --output)",
        ),
        (("run", "a.toml", "--solver", "fast"), "'fast' is not one of"),
        (("simulate", "--mu-s", "rough"), "Invalid value for '--mu-s'"),
    ],
)
def test_bad_commands_are_refused_by_typer(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = command(tmp_path, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in " ".join(done.stderr.replace("│", "").split())


# ---------------------------------------------------------------- disks, signals, surroundings


def limited() -> None:
    import resource  # not on Windows

    resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, 2_000))


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files the POSIX way")
@pytest.mark.parametrize(
    "line",
    [
        "run small.toml -o a.nc",
        "chart small.nc -k contours -o a.pdf",
        "chart small.nc -k modes -k dimensionless -o a.pdf",
        "export small.nc -o a.xlsx",
    ],
)
@pytest.mark.usefixtures("without_layout")
def test_a_full_disk_leaves_one_line_that_names_the_file(small: Path, line: str) -> None:
    *arguments, name = line.split()
    assert command(small, "run", "small.toml").returncode == 0
    assert command(small, *arguments, name).returncode == 0  # with all kernels compiled
    (small / name).unlink()
    before = names(small)
    environment = {"PYTHONDONTWRITEBYTECODE": "1"}  # Python itself would keep half of them
    done = slipsweep(small, *arguments, name, environment=environment, preexec_fn=limited)
    assert_fails(done, 1, f"{name}: ")
    assert names(small) == before


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="has no device that is full")
def test_output_that_is_lost_is_said(small: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*SLIPSWEEP, "run", "small.toml"],
            cwd=small,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "slipsweep: error: what is printed: No space left on device\n"
    assert (small / "small.nc").exists()


def test_settings_of_other_programs_do_no_harm(small: Path) -> None:
    setting = {"MPLBACKEND": "nonsense", "PYTHONIOENCODING": "ascii"}
    done = slipsweep(
        small, "limit", "small.toml", "-d", "50mm", "-o", "limit.png", environment=setting
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (small / "limit.png").exists()


def test_letters_that_a_terminal_cannot_print_are_spelled(small: Path) -> None:
    command(small, "run", "small.toml")
    printed = []
    for encoding in ("ascii", "latin-1", "utf-8"):
        written = io.BytesIO()
        stream = io.TextIOWrapper(written, encoding, write_through=True)
        with contextlib.redirect_stdout(stream), contextlib.chdir(small):
            assert cli.main(["info", "small.nc"]) == 0
        printed.append(written.getvalue().decode(encoding))
    inputs = [re.findall("friction_inputs: (.*)\n", text)[0] for text in printed]
    assert inputs == [
        "Uy by Coulomb, lambda by Eq. 6, Deltamu by Eqs. 10-11: estimated",
        "Üy by Coulomb, lambda by Eq. 6, Deltamu by Eqs. 10-11: estimated",
        "Üy by Coulomb, λ by Eq. 6, Δμ by Eqs. 10–11: estimated",
    ]
    assert "\\" not in printed[0]


#: A process whose user has no account.
NOBODY = """
import pwd, sys
def missing(uid):
    raise KeyError(uid)
pwd.getpwuid = missing
from slipsweep.cli import main
chart = ["chart", "small.nc", "-k", "contours", "-o", "a.png"]
sys.exit(main(["run", "small.toml"]) or main(chart))
"""


def test_a_user_without_home_and_account_is_served(small: Path) -> None:
    # whose kernels are compiled anew: one that is compiled soon
    newmark = '[model]\nfriction = "newmark"\n[excitation]\nwaveform = "square"\n'
    (small / "small.toml").write_text(SMALL + newmark)
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("HOME", "XDG"))
    }
    done = subprocess.run(
        [sys.executable, "-c", NOBODY],
        cwd=small,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def test_control_sequences_of_a_file_do_not_reach_the_terminal(small: Path) -> None:
    command(small, "run", "small.toml")
    with netCDF4.Dataset(small / "small.nc", "a") as file:
        file.title = "\x1b]52;c;ZXZpbA==\x07 title"
    done = command(small, "info", "small.nc")
    assert done.returncode == 0
    assert "\\x1b]52;c;ZXZpbA==\\x07 title" in done.stdout
    assert "\x1b" not in done.stdout


# ---------------------------------------------------------------------------- info, simulate


def test_info_prints_axes_variables_and_shares(small: Path) -> None:
    command(small, "run", "small.toml")
    done = command(small, "info", "small.nc")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[0].startswith("small.nc  ")
    assert "  theta                   2 values, 0 to 5 degree" in lines
    assert "  permanent_displacement  permanent displacement, downslope, m (float64)" in lines
    assert any(line.startswith("  stuck  ") and line.endswith("%") for line in lines)
    assert any(
        line.startswith("history: ") and line.endswith("slipsweep run small.toml") for line in lines
    )
    assert "  mu_s.values = [0.3, 0.5]" in lines


OUTPUTS = [f"a{suffix}" for suffix in (".nc", ".csv", ".png", ".svg", ".pdf")]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder with a time history in every kind of file, and what `simulate` printed."""
    folder = tmp_path_factory.mktemp("simulated")
    options = [part for output in OUTPUTS for part in ("-o", output)]
    done = command(folder, *SIMULATE, "--cycles", "2", "--points", "64", *options)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_simulate_prints_results_and_outputs(simulated: tuple[Path, str]) -> None:
    folder, text = simulated
    assert text.startswith("permanent displacement  ")
    assert "sliding mode            stick_slip\n" in text
    assert text.endswith("".join(f"{output}\n" for output in OUTPUTS))
    assert names(folder) == set(OUTPUTS)


def test_simulate_writes_the_history_to_netcdf(simulated: tuple[Path, str]) -> None:
    with xr.open_dataset(simulated[0] / "a.nc") as history:
        assert float(history["time"][1]) == pytest.approx(1 / (1.8 * 64))
        displacement = history["relative_displacement"]
        assert displacement.dims == history["time"].dims == ("instant",)
        last = float(history["permanent_displacement"])
        assert float(displacement[-1]) == pytest.approx(last, rel=1e-9)


def test_simulate_writes_the_same_history_as_a_table(simulated: tuple[Path, str]) -> None:
    with (simulated[0] / "a.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header[0] == "time (s)"
    column = header.index("relative_displacement (m)")
    with xr.open_dataset(simulated[0] / "a.nc") as history:
        displacement = history["relative_displacement"].values
    np.testing.assert_array_equal([float(row[column]) for row in rows], displacement)


@pytest.mark.parametrize(("suffix", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_simulate_draws_images(simulated: tuple[Path, str], suffix: str, start: bytes) -> None:
    assert (simulated[0] / f"a.{suffix}").read_bytes().startswith(start)


def test_simulate_draws_vector_graphics(simulated: tuple[Path, str]) -> None:
    assert "<svg" in (simulated[0] / "a.svg").read_text()


@pytest.mark.usefixtures("without_layout")
def test_a_report_has_a_title_page_and_a_chart_a_page(small: Path) -> None:
    assert command(small, "run", "small.toml").returncode == 0
    done = command(small, "report", "small.nc")
    assert (done.returncode, done.stdout, done.stderr) == (0, "small.pdf\n", "")
    content = (small / "small.pdf").read_bytes()
    # contours, modes, families, dimensionless, spread, ratio
    assert len(re.findall(rb"/Type /Page\b", content)) == 1 + 6
    assert_fails(
        command(small, "report", "small.nc"), 2, "small.pdf: exists already; give --overwrite"
    )
    assert_fails(
        command(small, "report", "small.nc", "-o", "a.png"), 2, "a.png: the name must end in .pdf"
    )
    assert (small / "small.pdf").read_bytes() == content
    assert command(small, "report", "small.nc", "--overwrite").returncode == 0


# ------------------------------------------------------------------------- help and progress


@pytest.mark.parametrize(
    ("arguments", "heavy"),
    [
        (
            ["--help"],
            {
                "numpy",
                "numba",
                "xarray",
                "netCDF4",
                "pint",
                "matplotlib",
                "dask",
                "pandas",
                "scipy",
            },
        ),
        (["run", "small.toml"], {"matplotlib"}),
    ],
)
def test_a_command_loads_only_packages_that_it_needs(
    small: Path, arguments: list[str], heavy: set[str]
) -> None:
    code = f"import sys; from slipsweep.cli import main; main({arguments}); print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=small, capture_output=True, text=True, check=True
    )
    assert not heavy & {name.partition(".")[0] for name in done.stdout.splitlines()[-1].split()}


@pytest.mark.parametrize("name", ["", *NAMES])
def test_help_names_its_examples_and_their_options(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("COLUMNS", "150")
    ended = run_command(*([name] if name else []), "--help")
    assert ended.status == 0
    options, _, examples = ended.output.partition(" Example")
    if not name:
        assert set(re.findall(r"^│ (\w+) ", options, re.MULTILINE)) == set(NAMES)
        return
    assert f" slipsweep {name}" in examples
    for option in re.findall(r" (--?[a-z][\w-]*)", examples):
        assert re.search(rf"│ .*{option}\b", options), option


def test_a_terminal_sees_progress(small: Path) -> None:
    pty = pytest.importorskip("pty", reason="opens a pseudo-terminal")
    reader, writer = pty.openpty()
    seen = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", "PYTHONUTF8": "1"}
    read = b""
    with subprocess.Popen(
        [*SLIPSWEEP, "run", "small.toml"], cwd=small, env=seen, stdout=writer, stderr=writer
    ):
        os.close(writer)
        with contextlib.suppress(OSError):  # how Linux says that the other end is closed
            while part := os.read(reader, 10_000):
                read += part
    os.close(reader)
    assert b"100%" in read
    assert (small / "small.nc").exists()
