"""Units as people type them, names that commands can write, and a reason for each missing value."""

import importlib
import math
import sys
from pathlib import Path

import pytest

from slipsweep._version import __version__
from slipsweep.files.opening import read_result
from tests.support.commands import run_command

BLOCK = ("simulate", "--theta", "5", "--mu-s", "0.38", "--frequency", "2")
SWEEP = """
[axes]
theta.values = [5]
mu_s.values = [0.4]
amplitude.values = [4]
frequency.values = [2]
"""


def told(*arguments: object, status: int = 0) -> str:
    ended = run_command(*arguments)
    assert ended.status == status, ended.errors
    return ended.errors if status else ended.output


@pytest.mark.parametrize(
    ("typed", "same", "echo"),
    [
        (("--amplitude", "0.5g"), ("--amplitude", "4.905"), "amplitude 4.905 m/s2 (0.5 g)"),
        (
            ("--amplitude", "0.5g", "--g", "9.8"),
            ("--amplitude", "4.9", "--g", "9.8"),
            "amplitude 4.9 m/s2 (0.5 g)",
        ),
        (
            ("--amplitude", "4", "--theta", "300 arcmin", "--frequency", "120 rpm"),
            ("--amplitude", "4"),
            "theta 5 degree, mu_s 0.38, amplitude 4 m/s2",
        ),
        (
            ("--amplitude", "4", "--yield-acceleration", "0.1g"),
            ("--amplitude", "4", "--yield-acceleration", "0.981"),
            "yield acceleration 0.981 m/s2 (0.1 g)",
        ),
        (
            ("--displacement-amplitude", "30mm"),
            ("--displacement-amplitude", "0.03"),
            "displacement amplitude 0.03 m",
        ),
    ],
)
def test_simulate_takes_units_and_says_what_it_took(
    typed: tuple[str, ...], same: tuple[str, ...], echo: str
) -> None:
    first, other = (told(*BLOCK, *options) for options in (typed, same))
    assert first == other
    assert "taken as                theta 5 degree, mu_s 0.38, " in first
    assert echo in first
    assert "frequency 2 Hz" in first


def test_simulate_says_what_it_took_of_a_record(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time (s),acceleration (g)\n0,0\n1,0.5\n2,-0.5\n3,0\n")
    command_line = ("simulate", "--theta", "5", "--phi", "21", "--record", tmp_path / "a.csv")
    taken = "taken as                theta 5 degree, mu_s 0.383864, phi 21 degree, scale {}, "
    assert taken.format("1") + "time scale 1, polarity 1\n" in told(*command_line)
    typed = ("--scale", "2", "--polarity", "-1", "--time-scale", "0.5")
    assert taken.format("2") + "time scale 0.5, polarity -1\n" in told(*command_line, *typed)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--amplitude", "high"),
            '--amplitude = "high": must be a number, with a unit that converts to m s-2',
        ),
        (
            ("--amplitude", "4", "--theta", "5%"),
            '--theta = "5%": must be a number, with a unit that converts to degree',
        ),
        (("--amplitude", "-0.1g"), "amplitude = -0.981"),
    ],
)
def test_a_unit_that_does_not_fit_is_refused(options: tuple[str, ...], message: str) -> None:
    assert message in told(*BLOCK, *options, status=2)


@pytest.mark.parametrize(
    ("options", "flag"),
    [
        (
            ("--amplitude", "4", "--yield-acceleration", "-0.1g"),
            "statically_unstable: yield acceleration <= 0",
        ),
        (("--amplitude", "12g"), "uplift: A tan(theta) >= g"),
        (("--amplitude", "2.9", "--rise", "literal"), "kd_not_positive: literal rise: Kd <= 0"),
    ],
)
def test_simulate_without_a_value_says_why_and_fails(
    tmp_path: Path, options: tuple[str, ...], flag: str
) -> None:
    message = told(*BLOCK, *options, "-o", tmp_path / "a.csv", status=1)
    assert f"the model gives no value: {flag}" in message
    assert message.count("\n") == 1
    assert not (tmp_path / "a.csv").exists()


def test_a_history_not_for_design_says_so_in_its_file(tmp_path: Path) -> None:
    output = tmp_path / "a.nc"
    text = "continuous sliding with estimated friction: not for design"
    assert f"unsound                 {text}\n" in told(*BLOCK, "--amplitude", "9", "-o", output)
    assert read_result(output).attrs["unsound"] == text
    assert f"unsound: {text}\n" in told("info", output)


def test_hazard_of_samples_has_rows_for_each_frequency(tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_text("PGA (g),annual rate\n0.1,0.01\n1,0.0001\n")
    uncertain = '[uncertainty]\nsamples = 8\nthresholds = ["1cm"]\n'
    uncertain += '[uncertainty.mu_s]\ndistribution = "lognorm"\ns = 0.1\nscale = 0.4\n'
    axes = (
        SWEEP.replace("mu_s.values = [0.4]\n", "")
        .replace("[4]", "[2, 5, 8]")
        .replace("[2]", "[1, 2]")
    )
    (tmp_path / "a.toml").write_text(axes + uncertain)
    result = tmp_path / "a.nc"
    figure = tmp_path / "rates.png"
    told("run", tmp_path / "a.toml", "-o", result)
    out = told("hazard", result, "--curve", tmp_path / "curve.csv", "-d", "1cm", "-o", figure)
    assert figure.exists()
    (header,) = (line for line in out.splitlines() if line.startswith("theta frequency d (m)"))
    rows = [line.split() for line in out[out.index(header) :].splitlines()[1:3]]
    assert [row[-7:-6] for row in rows] == [["0.01"], ["0.01"]]
    assert [row[-8] for row in rows] == ["1.0", "2.0"]


def test_limit_says_what_it_took(tmp_path: Path) -> None:
    sweep = tmp_path / "a.toml"
    sweep.write_text(SWEEP)
    bare = told("limit", sweep, "-d", "0.05", "--maximum-amplitude", "19.62")
    assert "\ndisplacement 0.05 m, searched up to 19.62 m/s2 (2 g)\n" in bare
    assert bare == told("limit", sweep, "-d", "50mm", "--maximum-amplitude", "2g")


def test_the_version_is_printed() -> None:
    assert told("--version") == f"slipsweep {__version__}\n"


def test_versions_are_those_of_the_modules_that_are_loaded() -> None:
    lines = told("--versions").splitlines()
    assert lines[0] == f"slipsweep {__version__}"
    for name in ("dask", "llvmlite", "matplotlib", "numba", "numpy", "pandas", "scipy", "xarray"):
        assert f"{name} {importlib.import_module(name).__version__}" in lines


def test_versions_name_what_cannot_be_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "netCDF4", None)
    assert "netCDF library: import of netCDF4 halted" in told("--versions")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, in which commands run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_angle_as_a_coefficient_is_asked_about(here: Path) -> None:
    (here / "a.toml").write_text(SWEEP.replace("0.4", "22"))
    output = told("run", "a.toml")
    assert "no cell has a value: 1 - tan(theta) (mu_s - tan(theta)) <= 0" in output
    assert "did you mean phi = 22?" in output


def test_values_that_a_record_lacks_can_be_interpolated(here: Path) -> None:
    (here / "a.csv").write_text("0,1\n1,-999\n2,0\n")
    message = told("simulate", "--record", "a.csv", "--units", "m/s2", *BLOCK[1:5], status=2)
    assert "--gaps linear interpolates" in message


def test_the_smallest_yield_acceleration_is_printed_if_no_cell_slides(here: Path) -> None:
    (here / "a.toml").write_text(SWEEP.replace("[4]", "[0.1]").replace("[5]", "[0, 5]"))
    smallest = 9.81 * math.tan(math.atan(0.4) - math.radians(5))
    assert f"smallest yield acceleration {smallest:.6g} m/s2" in told("run", "a.toml")


@pytest.fixture
def over_angles(here: Path) -> None:
    """A result over two friction angles and some amplitudes."""
    text = SWEEP.replace("mu_s", "phi").replace("0.4", "20, 22")
    (here / "b.toml").write_text(text.replace("[4]", "[2, 4, 6, 8, 10, 12]"))
    told("run", "b.toml")


@pytest.mark.usefixtures("over_angles")
def test_a_chart_over_friction_angles_is_cut_at_a_coefficient(here: Path) -> None:
    told("chart", "b.nc", "-k", "curve", "--at", "mu_s=0.404", "-o", "a.png")
    assert (here / "a.png").exists()


@pytest.mark.usefixtures("over_angles")
def test_a_misspelt_axis_of_a_chart_is_asked_about() -> None:
    message = told("chart", "b.nc", "--at", "frequncy=2", "-o", "b.png", status=2)
    assert 'frequncy = 2: no such axis; did you mean "frequency"?' in message
