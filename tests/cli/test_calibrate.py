"""`slipsweep friction` and `slipsweep calibrate` on the test that comes with the sweeps."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep import cli
from tests.support.shaking import coulomb

ROOT = Path(__file__).parents[2]
TEST = str(ROOT / "sweeps" / "data" / "shaking_test.csv")
BLOCK = ("--theta", "5", "--mu-s", "0.38")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_friction_writes_what_it_finds(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["friction", TEST, *BLOCK, "-o", "friction.nc", "-o", "friction.png"]) == 0
    printed = capsys.readouterr().out
    assert "8 slides" in printed
    assert "removed    nothing" in printed
    assert Path("friction.png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset("friction.nc") as friction:
        assert friction.sizes["slide"] == 8
        assert friction.friction_ratio.dims == ("instant",)
    figure = slipsweep.open_result("friction.nc").slipsweep.chart("friction")
    figure.savefig("again.png", dpi=150)
    assert Path("again.png").read_bytes() == Path("friction.png").read_bytes()


def test_friction_takes_offsets_off_by_the_rest(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["friction", TEST, *BLOCK, "--offset", "all", "--rest", "0", "0.45"]) == 0
    assert "removed    ground_acceleration: " in capsys.readouterr().out
    assert cli.main(["friction", TEST, *BLOCK, "--g", "9.7", "-o", "g.nc"]) == 0
    with xr.open_dataset("g.nc") as friction:
        expected = slipsweep.measured_friction(TEST, 5.0, 0.38, g=9.7).free_body_friction
        np.testing.assert_array_equal(friction.free_body_friction, expected)


def test_calibrate_writes_what_it_finds(capsys: pytest.CaptureFixture[str]) -> None:
    outputs = ("calibration.nc", "calibration.svg", "model.toml")
    assert (
        cli.main(["calibrate", TEST, *BLOCK, *(word for name in outputs for word in ("-o", name))])
        == 0
    )
    printed = capsys.readouterr().out
    assert "[uncertainty.decay_rate]" in printed
    with xr.open_dataset("calibration.nc") as calibration:
        assert (
            abs(calibration.yield_acceleration - 1.8) < 3.5 * calibration.yield_acceleration_error
        )
        assert calibration.sizes["cycle"] == 8
        assert "constant_friction" in calibration.attrs
        misfit = f"misfit {1000 * calibration.misfit_relative_displacement.item():.2g} mm"
    assert misfit in Path("calibration.svg").read_text()
    assert Path("model.toml").read_text() in printed
    assert "[uncertainty.decay_rate]" in Path("model.toml").read_text()
    assert Path("calibration.svg").read_text().count("misfit") == 3
    check_figure(slipsweep.open_result("calibration.nc").load())


def check_figure(calibration: xr.Dataset) -> None:
    """Each panel has what was measured and what was computed, in the unit of its label."""
    figure = calibration.slipsweep.chart()
    channels = {
        "ground_acceleration": ("acceleration of\nthe table (m/s²)", 1.0, "smooth"),
        "block_acceleration": ("acceleration of\nthe block (m/s²)", 1.0, "computed"),
        "relative_velocity": ("relative\nvelocity (m/s)", 1.0, "computed"),
        "relative_displacement": ("relative\ndisplacement (mm)", 1000.0, "computed"),
    }
    for axes, (channel, (label, factor, computed)) in zip(
        figure.axes[:4], channels.items(), strict=True
    ):
        assert axes.get_ylabel() == label
        lines = {str(line.get_label()): line for line in axes.lines}
        for name, kind in (("measured", "measured"), (computed, "computed")):
            expected = factor * calibration[f"{kind}_{channel}"]
            np.testing.assert_array_equal(lines[name].get_xdata(), calibration.time)
            np.testing.assert_allclose(lines[name].get_ydata(), expected, rtol=1e-14)
    friction = {str(line.get_label()): line.get_ydata() for line in figure.axes[4].lines}
    np.testing.assert_array_equal(friction["by statics"], calibration.free_body_friction)
    np.testing.assert_array_equal(friction["μ(t) by Eq. 1"], calibration.friction_coefficient)
    low, high = calibration.yield_acceleration_interval.values
    text = f"Üy = {calibration.yield_acceleration.item():.4g} m/s² ({low:.3g} to {high:.3g}), λ = "
    assert text in figure.get_supxlabel()


def test_constant_friction_is_the_first_line(capsys: pytest.CaptureFixture[str]) -> None:
    names = {"time": "time (s)", "ground_acceleration": "table acceleration (m/s2)"}
    names |= {"block_acceleration": "block acceleration (m/s2)"}
    coulomb(0.25).to_dataframe().reset_index()[list(names)].rename(columns=names).to_csv(
        "coulomb.csv", index=False
    )
    for command in (
        ("friction", "coulomb.csv"),
        ("calibrate", "coulomb.csv", "--no-cycles", "-o", "model.toml"),
    ):
        assert cli.main([*command, "--theta", "6", "--mu-s", "0.38"]) == 0
        assert capsys.readouterr().out.startswith(
            "This is a block of constant friction: by statics 0.25"
        )
    assert 'friction = "newmark"' in Path("model.toml").read_text()


def test_two_tests_are_calibrated_together(capsys: pytest.CaptureFixture[str]) -> None:
    Path("short.csv").write_text("".join(Path(TEST).read_text().splitlines(keepends=True)[2::4]))
    assert cli.main(["calibrate", "short.csv", "short.csv", *BLOCK, "-o", "both.nc"]) == 0
    assert capsys.readouterr().out.count("cycle  starts, s") == 2
    with xr.open_dataset("both.nc") as calibration:
        assert calibration.sizes["test"] == 2
        assert calibration.misfit_relative_velocity.dims == ("test",)
        figure = calibration.load().slipsweep.chart()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    for number in range(2):  # a column for each test
        test = calibration.isel(test=number)
        misfit = test.misfit_relative_velocity.item()
        share = test.relative_misfit_relative_velocity.item()
        assert titles[4 + number] == f"misfit {misfit:.2g} m/s ({share:.1%})"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("friction", TEST, *BLOCK, "--rest", "1", "x"), "Invalid value for '--rest'"),
        (
            ("friction", TEST, *BLOCK, "-o", "friction.toml"),
            "friction.toml: the name must end in one of .nc",
        ),
        (
            ("calibrate", TEST, *BLOCK, "--drift", "table"),
            "drift = 'table': must be 'all', or of the channels",
        ),
        (("calibrate", TEST, *BLOCK, "--model", "newmark"), "must be 'mendez'"),
        (("calibrate", "none.csv", *BLOCK), "none.csv: cannot be read"),
        (("calibrate", TEST, "--theta", "95", "--mu-s", "0.38"), "theta = 95"),
    ],
)
def test_commands_on_tests_that_are_refused(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(list(arguments)) == 2
    assert message in capsys.readouterr().err


def test_the_example_is_what_its_script_makes() -> None:
    """Up to rounding, which another machine may do otherwise."""
    import runpy

    made = runpy.run_path(str(ROOT / "sweeps" / "data" / "shaking_test.py"))["text"]().splitlines()
    kept = Path(TEST).read_text().splitlines()
    assert len(made) == len(kept)
    assert sum(line != other for line, other in zip(made, kept, strict=True)) < 10
