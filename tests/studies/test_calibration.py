"""Calibration of synthetic tests: the parameters that went in, coverage of intervals, branches,
sensors at fault.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep import InputError, cli
from slipsweep.studies.calibration.noise import flat_top, noisy_flat_top
from slipsweep.studies.calibration.search import Search
from slipsweep.studies.calibration.sweep_tables import sweep_file_text
from tests.support.shaking import CALIBRATED, SOUGHT, coulomb, digitised, exact, measured

#: The issue's case: with this motion of 3.2 m/s² Üy holds the block, or Eq. 4 crosses at the same
#: value.
BRANCHES: dict[str, Any] = {
    "theta": 5.0,
    "mu_s": 0.38,
    "amplitude": 3.2,
    "frequency": 2.0,
    "yield_acceleration": 1.3,
    "decay_rate": 4.0,
    "delta_mu": 0.1,
    "excitation": slipsweep.Sine(cycles=6),
}


@pytest.fixture(scope="module")
def clean() -> dict[str, xr.Dataset]:
    return {
        name: exact(case, rate=120.0, tail=0.5 if name == "stick_slip" else 0.0)
        for name, case in CALIBRATED.items()
    }


@pytest.fixture(scope="module")
def noisy(clean: dict[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    return {
        name: calibrated(measured(test, seed=1), name, cycles=True) for name, test in clean.items()
    }


def calibrated(test: Any, mode: str = "stick_slip", **options: Any) -> xr.Dataset:
    case = CALIBRATED[mode]
    return slipsweep.calibrate(test, case["theta"], case["mu_s"], **{"cycles": False, **options})


def check_intervals(found: xr.Dataset, case: dict[str, Any]) -> None:
    """Check that the true values lie within the intervals: the seeds are fixed."""
    for name in SOUGHT:
        low, high = found[f"{name}_interval"].values
        assert low <= case[name] <= high, name


@pytest.mark.parametrize("mode", CALIBRATED)
def test_without_noise_the_parameters_come_back(clean: dict[str, xr.Dataset], mode: str) -> None:
    found = calibrated(clean[mode], mode)
    for name in SOUGHT:
        assert found[name].item() == pytest.approx(CALIBRATED[mode][name], rel=0.01), name


@pytest.mark.parametrize("mode", CALIBRATED)
def test_intervals_hold_the_truth_under_noise_and_a_converter(
    noisy: dict[str, xr.Dataset], mode: str
) -> None:
    found = noisy[mode]
    case = CALIBRATED[mode]
    check_intervals(found, case)
    for name in ("block_acceleration", "relative_velocity", "relative_displacement"):
        assert found[f"relative_misfit_{name}"].item() == pytest.approx(0.02, rel=0.15), name
    assert found.attrs["removed"] == "nothing"
    assert found.attrs["findings"] == ""
    assert found.sizes["cycle"] == case["excitation"].cycles
    for name in SOUGHT[1:]:
        off = (found[f"cycle_{name}"] - case[name]) / found[f"cycle_{name}_error"]
        assert 0.5 < np.abs(off).max() < 3.5, name
    if mode == "stick_slip":
        top = (
            found.computed_block_acceleration.where(found.computed_relative_velocity > 0)
            .max()
            .item()
        )
        np.testing.assert_allclose(found.cycle_attenuation_coefficient, top / 9.81, rtol=0.05)
    else:
        assert np.isnan(found.cycle_yield_acceleration).all()


def test_two_branches_are_united_and_a_second_test_tells_them_apart() -> None:
    weak = measured(exact(BRANCHES, rate=120.0), seed=0, noise=0.01)
    found = slipsweep.calibrate(weak, 5.0, 0.38, cycles=False)
    check_intervals(found, BRANCHES)
    first, second, third, *_ = found.attrs["findings"].splitlines()
    assert first.startswith(
        "Üy, λ and Δμ are not determined by this test: 95 % intervals Üy up to 1.3 "
    )
    assert second.startswith("Two readings fit equally well: Üy holds the block")
    assert third.startswith("Test at another amplitude and give calibrate all tests together: at ")
    assert np.isnan(found.yield_acceleration_error)
    # nothing that can be pasted unread
    assert all(line.startswith("#") for line in found.attrs["model_table"].splitlines())
    assert (
        "# WARNING: not ready for use.\n# Üy, λ and Δμ are not determined"
        in found.attrs["model_table"]
    )
    assert found.attrs["uncertainty_table"] == ""
    # at twice the noise a reading next to what refutes it comes and goes with the rounding of the
    # search
    strong = measured(exact({**BRANCHES, "amplitude": 5.0}, rate=120.0), seed=2, noise=0.005)
    both = slipsweep.calibrate([weak, strong], 5.0, 0.38, cycles=False)
    check_intervals(both, BRANCHES)
    assert both.sizes["test"] == 2
    assert both.yield_acceleration_error.item() < 0.01
    assert both.decay_rate_interval.values[1] < 6.0
    assert not both.attrs["model_table"].startswith("#")
    titles = [axes.get_title(loc="left") for axes in both.slipsweep.chart().axes]
    for number, misfit in enumerate(both.misfit_relative_displacement.values):
        assert titles[6 + number].startswith(f"misfit {1000.0 * misfit:.2g} mm (")


def test_a_branch_is_compared_with_its_own_least() -> None:
    """A second branch, better by less than what refutes it, must not cut the
    interval of the first.
    """

    def residuals(point: np.ndarray) -> np.ndarray:
        if point[0] < 0.5:  # one parameter, least 4 at 0.4
            return np.array([(point[0] - 0.4) / 0.01, 2.0])
        return np.array([(point[0] - 0.8) / 0.01, (point[1] - 1.0) / 0.1])

    def branch(point: np.ndarray) -> tuple[str, ...]:
        return ("low" if point[0] < 0.5 else "high",)

    search = Search(residuals, branch)
    for start in (0.41, 0.79):
        search.polish(np.array([start, 0.9, 0.1]))
    low, high = (search.end(0, side, 0.02) for side in (-1, 1))
    assert low == pytest.approx(0.4 - 0.0196, abs=3e-4)
    assert high == pytest.approx(0.8 + 0.0196, abs=3e-4)


def test_several_minima_that_fit_are_several_solutions() -> None:
    """Two values of one parameter fit equally well, and none between them."""

    def residuals(point: np.ndarray) -> np.ndarray:
        return np.array([(point[0] - 0.2) * (point[0] - 0.6) / 0.001, point[1] - 1.0, point[2]])

    search = Search(residuals, lambda point: ("all",))
    for onset in (0.19, 0.61):
        search.follow(np.array([onset, 0.9, 0.1]))
    assert search.apart() == pytest.approx([0.2, 0.6], abs=1e-3)
    for at, (low, high) in enumerate(search.intervals(np.full(3, 0.01))[:1]):
        assert low < 0.2 < 0.6 < high, at


def test_a_second_minimum_of_an_exact_test_is_not_the_answer() -> None:
    """With Üy 1.010 m/s2 the block would have gained the same velocity up to the onset."""
    case: dict[str, Any] = {
        "theta": 3.8,
        "mu_s": 0.2268,
        "amplitude": 5.589,
        "frequency": 4.518,
        "yield_acceleration": 1.934,
        "decay_rate": 2.94,
        "delta_mu": 0.124,
        "excitation": slipsweep.Sine(cycles=5),
    }
    test = slipsweep.simulate(**case, times=np.arange(0.0, 5.0 / 4.518, 1.0 / 150.0))
    found = slipsweep.calibrate(test, 3.8, 0.2268, cycles=False)
    check_intervals(found, case)
    assert np.diff(found.yield_acceleration_interval) < 0.02
    assert found.attrs["findings"] == ""


def test_samples_that_contradict_the_solution_are_named(clean: dict[str, xr.Dataset]) -> None:
    test = measured(clean["stick_slip"], seed=1, noise=0.005)
    # while the block follows Eq. 4
    fastest = int(np.argmax(test.ground_acceleration.values))
    test.block_acceleration.values[fastest - 3 : fastest + 3] += 0.3
    found = calibrated(test)
    *_, finding = found.attrs["findings"].splitlines()
    assert re.match(r"6 samples of block_acceleration cannot be noise: up to 0\.[234]", finding)
    assert f"first at {test.time.values[fastest - 3]:.4g} s" in finding
    assert found.attrs["model_table"].startswith("# WARNING: not ready for use.")


def test_offsets_in_all_channels_are_fitted(clean: dict[str, xr.Dataset]) -> None:
    """Offsets of 3 % of each channel's peak, of either sign."""
    test = measured(clean["stick_slip"], seed=3, noise=0.005, bits=None)
    sizes = {}
    for sign, name in zip((1.0, -1.0, 1.0, -1.0), test.data_vars, strict=True):
        sizes[name] = sign * 0.03 * float(np.abs(test[name]).max())
        test[name].values[:] += sizes[name]
    found = calibrated(test, offset="all")
    check_intervals(found, CALIBRATED["stick_slip"])
    assert found.yield_acceleration_error.item() < 0.1
    assert found.attrs["findings"] == ""
    for name, true in sizes.items():
        (said,) = re.findall(
            rf"offset of {name}: (-?[\d.e-]+) ± ([\d.e-]+)", found.attrs["removed"]
        )
        assert abs(float(said[0]) - true) < 3.0 * float(said[1]), name
        assert float(said[1]) < 0.2 * abs(true), name


def test_a_table_channel_that_is_cut_off_is_named(clean: dict[str, xr.Dataset]) -> None:
    test = measured(clean["stick_slip"], 5, 0.01, responses=["block_acceleration"])
    table = test.ground_acceleration.values
    table[:] = np.minimum(table, 4.8)
    found = calibrated(test)
    first, second, *_ = found.attrs["findings"].splitlines()
    assert first.startswith("ground_acceleration is cut off: it is flat at 4.8 m s-2, ")
    assert second == "The intervals do not include what is cut off. Test with a larger range."
    assert found.attrs["model_table"].startswith("# WARNING: not ready for use.\n# ground_acc")
    assert found.attrs["uncertainty_table"] == ""


@pytest.mark.parametrize("bits", [None, 8, 12])
@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
def test_a_crest_is_told_from_a_flat_top(noise: float, bits: int | None) -> None:
    random = np.random.default_rng(2)
    wave = np.sin(2.0 * np.pi * 2.0 * np.arange(0.0, 3.0, 1.0 / 200.0))
    errors = noise * random.standard_normal(wave.size)

    def sampled(values: np.ndarray) -> np.ndarray:
        return values if bits is None else digitised(values, bits, 1.25)

    assert not flat_top(sampled(wave + errors))
    assert not noisy_flat_top(sampled(wave + errors))
    assert flat_top(sampled(np.minimum(wave + errors, 0.9))) > 40
    under_noise = sampled(np.minimum(wave, 0.9) + errors)
    assert max(flat_top(under_noise), noisy_flat_top(under_noise)) > 40


@pytest.mark.parametrize("kinetic", [0.38, 0.25])
def test_a_block_of_constant_friction_gets_newmarks_tables(kinetic: float) -> None:
    test = coulomb(kinetic).isel(time=slice(None, None, 2))
    found = slipsweep.calibrate(test, 6.0, 0.38, cycles=False)
    first = found.attrs["findings"].splitlines()[0]
    assert first.startswith("This is a block of constant friction: by statics ")
    assert first == found.attrs["constant_friction"]
    assert "contradicts" not in found.attrs["findings"]
    for name, true in (("static", 0.38), ("kinetic", kinetic)):
        low, high = found[f"{name}_friction_interval"].values
        assert low <= true <= high, name
        assert high - low < 0.08, name
    assert 'friction = "newmark"' in found.attrs["model_table"]
    onset = 9.81 * np.tan(np.arctan(kinetic) - np.radians(6.0))
    (value,) = re.findall(r"yield_acceleration = ([\d.]+)", found.attrs["model_table"])
    assert float(value) == pytest.approx(onset, rel=0.02)
    (ends,) = re.findall(r"95 %: ([\d.]+) to ([\d.]+)", found.attrs["model_table"])
    (scale,) = re.findall(r"scale = ([\d.]+)", found.attrs["uncertainty_table"])
    assert 3.92 * float(scale) == pytest.approx(float(ends[1]) - float(ends[0]), rel=0.1)


@pytest.mark.parametrize("missing", ["block_acceleration", "relative_velocity"])
def test_two_channels_of_the_block_are_enough(clean: dict[str, xr.Dataset], missing: str) -> None:
    found = calibrated(measured(clean["stick_slip"], seed=2).drop_vars(missing))
    check_intervals(found, CALIBRATED["stick_slip"])
    assert f"misfit_{missing}" not in found


def test_displacement_alone_does_not_tell_decay_from_excess(clean: dict[str, xr.Dataset]) -> None:
    found = calibrated(
        measured(clean["stick_slip"], seed=3, noise=0.05, responses=["relative_displacement"])
    )
    assert "Measure the acceleration of the block" in found.attrs["findings"]
    assert found.attrs["model_table"].startswith("# WARNING")
    check_intervals(found, CALIBRATED["stick_slip"])


def test_sensors_at_fault() -> None:
    responses = ["block_acceleration", "relative_displacement"]
    test = measured(exact(CALIBRATED["stick_slip"], rate=100.0), 4, responses=responses)
    test.relative_displacement.values[:] += 0.01 + 0.2 * test.time.values
    found = calibrated(test)
    first, second, *_ = found.attrs["findings"].splitlines()
    assert first.startswith("The misfit is larger than the noise of the sensors: ")
    assert second.endswith("give drift = 'relative_displacement'.")
    assert found.attrs["model_table"].startswith(
        "# WARNING: not ready for use.\n# The misfit is larger"
    )
    assert found.attrs["uncertainty_table"] == ""
    caption = " ".join(found.slipsweep.chart().get_supxlabel().split())
    assert caption.startswith(
        "Not ready for use. The misfit is larger than the noise of the sensors: "
    )
    test.ground_acceleration.values[:] += 0.2
    drift = 0.2 * float(np.ptp(test.time.values))
    asked = calibrated(test, drift="relative_displacement", offset="all")
    check_intervals(asked, CALIBRATED["stick_slip"])
    for name, true in (
        ("drift of relative_displacement", drift),
        ("offset of ground_acceleration", 0.2),
    ):
        (said,) = re.findall(rf"{name}: ([\d.]+) ± ([\d.]+)", asked.attrs["removed"])
        assert abs(float(said[0]) - true) < min(3.0 * float(said[1]), 0.1 * true), name


def test_intervals_hold_the_truth_with_gaps_and_an_early_end(clean: dict[str, xr.Dataset]) -> None:
    test = measured(clean["stick_slip"], seed=7).isel(time=slice(0, 312))
    kept = np.sort(np.random.default_rng(1).permutation(test.time.size)[: test.time.size * 3 // 4])
    test.relative_velocity.values[180:240] = np.nan
    check_intervals(calibrated(test.isel(time=kept)), CALIBRATED["stick_slip"])


def test_slips_upslope_are_left_out_and_named(clean: dict[str, xr.Dataset]) -> None:
    test = measured(clean["stick_slip"], seed=8)
    time = test.time.values
    for begin in (1.36, 2.36):
        # half a wave of velocity upslope, as the table's acceleration is lowest
        phase = np.clip((time - begin) / 0.08, 0.0, 1.0)
        test.relative_velocity.values[:] -= 0.08 * np.sin(np.pi * phase)
        test.relative_displacement.values[:] -= 0.08 * 0.08 / np.pi * (1.0 - np.cos(np.pi * phase))
        moves = (phase > 0.0) & (phase < 1.0)
        test.block_acceleration.values[:] += np.where(moves, np.pi * np.cos(np.pi * phase), 0.0)
    found = calibrated(test)
    assert "slipped upslope 2 times" in found.attrs["findings"]
    assert "contradicts" not in found.attrs["findings"]
    check_intervals(found, CALIBRATED["stick_slip"])


def test_a_record_that_begins_in_motion_is_named(clean: dict[str, xr.Dataset]) -> None:
    test = measured(clean["stick_slip"], seed=15, responses=["block_acceleration"])
    late = calibrated(test.isel(time=slice(int(np.argmax(test.time.values > 1.12)), None)))
    assert "The table moves as the record begins, at " in late.attrs["findings"]


def test_a_sweep_file_of_both_tables_runs(noisy: dict[str, xr.Dataset], tmp_path: Path) -> None:
    found = noisy["stick_slip"]
    given = {"theta": 5, "mu_s": 0.38, "amplitude": 3, "frequency": 2}
    axes = "".join(f"\n[axes.{name}]\nvalues = [{value}]\n" for name, value in given.items())
    path = tmp_path / "pasted.toml"
    path.write_text(found.attrs["model_table"] + axes)
    assert cli.main(["run", str(path), "-q", "-o", str(tmp_path / "model.nc")]) == 0
    with xr.open_dataset(tmp_path / "model.nc") as result:
        assert result.yield_acceleration.item() == pytest.approx(
            found.yield_acceleration.item(), rel=1e-5
        )
    path.write_text(
        sweep_file_text(found.attrs["model_table"], found.attrs["uncertainty_table"]) + axes
    )
    assert cli.main(["run", str(path), "-q", "-o", str(tmp_path / "band.nc")]) == 0


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({}, {"model": "newmark"}, "must be 'mendez'"),
        ({}, {"noise": {"block_acceleration": 0.0}}, "noise.block_acceleration = 0.0: must be"),
        ({}, {"noise": {"friction": 1.0}}, "noise = 'friction': must be"),
        ({}, {"offset": ["table"]}, "offset = 'table': must be"),
        ({}, {"drift": 3}, "drift = 3: must be a list of channels"),
        ({"ground_acceleration": -1.0}, {}, "never positive"),
        ({"ground_acceleration": 1000.0}, {}, "the block would lift off"),
    ],
)
def test_tests_that_tell_nothing_are_refused(
    clean: dict[str, xr.Dataset], change: dict[str, float], options: dict[str, Any], message: str
) -> None:
    test = clean["stick_slip"].copy(deep=True)
    for name, factor in change.items():
        values = test[name].values
        test[name].values[:] = -np.abs(values) if factor < 0.0 else values * factor
    with pytest.raises(InputError, match=message):
        calibrated(test, **options)
    with pytest.raises(InputError, match="nothing of the block was measured"):
        calibrated(clean["stick_slip"][["ground_acceleration"]])
