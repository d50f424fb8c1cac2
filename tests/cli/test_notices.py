"""Lines that commands print only where they hold, and options that keep what a sweep file says."""

from pathlib import Path

import pytest
import xarray as xr

import slipsweep
from tests.support.commands import command
from tests.support.made_up_records import write_motion

SWEEP = """
axes.theta.values = [5]
axes.mu_s.values = [0.3, 0.4]
axes.amplitude.values = [2, 4]
axes.frequency.values = [1]
"""


def printed(folder: Path, *arguments: object) -> str:
    done = command(folder, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.parametrize(
    ("amplitude", "options", "warned"),
    [
        ("0.9g", (), True),  # continuous, with λ and Δμ estimated
        ("0.3g", (), False),  # stick-slip
        ("0.9g", ("--decay-rate", "2.5", "--delta-mu", "0.1"), False),
        ("0.9g", ("--decay-rate", "2.5"), True),
    ],
)
def test_continuous_sliding_with_estimated_friction_is_not_for_design(
    tmp_path: Path, amplitude: str, options: tuple[str, ...], warned: bool
) -> None:
    block = ("--theta", "5", "--mu-s", "0.38", "--amplitude", amplitude, "--frequency", "1.8")
    text = printed(tmp_path, "simulate", *block, *options)
    line = "unsound                 continuous sliding with estimated friction: not for design\n"
    assert (line in text) == warned
    assert ("sliding mode            continuous\n" in text) == (amplitude == "0.9g")


@pytest.mark.parametrize(
    ("typed", "solver", "steps"),
    [
        ((), "step", 64),
        (("--solver", "step"), "step", 64),  # the same one keeps its options
        (("--solver", "cycle"), "cycle", None),
        (("--solver", "auto"), "cycle", None),
    ],
)
def test_a_solver_that_is_typed_keeps_the_options_of_the_sweep_file(
    tmp_path: Path, typed: tuple[str, ...], solver: str, steps: int | None
) -> None:
    text = f'{SWEEP}solver.method = "step"\nsolver.steps_per_cycle = 64\nsolver.rule = "simpson"\n'
    (tmp_path / "a.toml").write_text(text)
    printed(tmp_path, "run", "a.toml", *typed, "-q")
    with xr.open_dataset(tmp_path / "a.nc") as result:
        assert result.attrs["solver"] == solver
        assert result.attrs.get("steps_per_cycle") == steps


@pytest.mark.parametrize(
    ("amplitudes", "hint"),
    [
        ([0.5, 1.2], True),
        ([0.5, 3.0], True),
        ([0.5, 3.1], False),  # more than anybody means in g
        ([0.1, 0.4], False),  # does not slide in g either
    ],
)
def test_amplitudes_that_may_be_meant_in_g_are_asked_about(
    tmp_path: Path, amplitudes: list[float], hint: bool
) -> None:
    """If no cell slides: the largest amplitude and the smallest Üy, in both units."""
    text = SWEEP.replace("theta.values = [5]", "theta.values = [0]").replace(
        "[2, 4]", str(amplitudes)
    )
    (tmp_path / "a.toml").write_text(text.replace("[0.3, 0.4]", "[0.5, 0.6]"))
    output = printed(tmp_path, "run", "a.toml")
    largest = amplitudes[-1]
    line = (
        f"no cell slides: largest amplitude {largest:.6g} m/s2 ({largest / 9.81:.4g} g), "
        "smallest yield acceleration 4.905 m/s2 (0.5 g)"
    )
    question = '; did you mean units = "g"?' if hint else ""
    assert f"{line}{question}\n" in output


def test_an_axis_is_cut_once(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    printed(tmp_path, "run", "a.toml", "-q")
    cuts = ("--at", "mu_s=0.3", "--at", "mu_s=0.4")
    refused = command(tmp_path, "export", "a.nc", "-o", "a.csv", *cuts)
    assert refused.returncode == 2
    assert "--at mu_s=0.4: mu_s is given twice" in refused.stderr


def test_a_complete_result_is_left_as_it_is_and_said_to_be(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(SWEEP)
    first = printed(tmp_path, "run", "a.toml")
    assert "nothing was computed" not in first
    before = (tmp_path / "a.nc").read_bytes()
    again = printed(tmp_path, "run", "a.toml", "--resume")
    assert "a.nc: complete already, by the same sweep; nothing was computed\n" in again
    assert "4 cells" not in again
    assert printed(tmp_path, "run", "a.toml", "--resume", "--quiet") == ""
    assert (tmp_path / "a.nc").read_bytes() == before


@pytest.mark.usefixtures("without_layout")
def test_levels_are_contours_or_displacements_of_a_fragility(tmp_path: Path) -> None:
    for number in (1, 2, 3):
        write_motion(tmp_path / f"m{number}.csv", number, 100, 0.02)
    suite = slipsweep.read_suite(str(tmp_path / "*.csv"), units="g")
    data = slipsweep.sweep(0, 0.1, amplitude=[1.0, 2.0, 4.0], excitation=suite, model="newmark")
    data.to_netcdf(tmp_path / "suite.nc")
    levels = ("--levels", "1mm,5cm")
    out = ("-o", "f.svg")
    printed(tmp_path, "chart", "suite.nc", "--kind", "fragility", *levels, *out)
    drawn = (tmp_path / "f.svg").read_text()
    assert "d = 1 mm" in drawn
    assert "d = 50 mm" in drawn
    refused = command(tmp_path, "chart", "suite.nc", "--kind", "histogram", *levels, "-o", "h.svg")
    assert refused.returncode == 2
    assert "--levels 1mm,5cm: only with --kind contours or fragility" in refused.stderr
