"""Eq. 1 and statics on synthetic tests: the friction that went in, the slides, sensors at fault,
files.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import slipsweep
from slipsweep import InputError
from slipsweep.studies.calibration.measured_friction import mean_with_interval
from slipsweep.studies.calibration.shaking_test import read_test
from tests.support.shaking import CONTINUOUS, STICK_SLIP, coulomb, exact, measured

BLOCK = {"theta": STICK_SLIP["theta"], "mu_s": STICK_SLIP["mu_s"]}


@pytest.fixture(scope="module")
def stick_slip() -> xr.Dataset:
    return exact(STICK_SLIP)


def friction(test: Any, **options: Any) -> xr.Dataset:
    return slipsweep.measured_friction(test, **{**BLOCK, **options})


def test_friction_of_few_slides_has_the_interval_of_students_distribution() -> None:
    values = np.array([0.2, 0.3, 0.4])
    low, mean, high = mean_with_interval(values, noise=0.0, systematic=0.0)
    assert mean == pytest.approx(0.3)
    expected = stats.t.interval(0.95, 2, 0.3, stats.sem(values))
    np.testing.assert_allclose([low, high], expected)


def test_friction_is_that_of_the_simulation(stick_slip: xr.Dataset) -> None:
    """While the table's acceleration rises, and the block slides, μ(t) is Eq. 6."""
    found = friction(stick_slip)
    table = found.ground_acceleration.values
    sliding = (table[2:] > table[1:-1]) & (table[1:-1] > table[:-2]) & (table[:-2] > 1.0)
    law = (0.38 + 0.09) * np.exp(-2.7 * table[1:-1] / 9.81)
    np.testing.assert_allclose(
        found.friction_coefficient.values[1:-1][sliding], law[sliding], rtol=1e-10
    )
    np.testing.assert_allclose(
        found.least_friction, (0.38 + 0.09) * np.exp(-2.7 * 3.55 / 9.81), rtol=1e-3
    )
    np.testing.assert_allclose(found.friction_ratio, found.friction_coefficient / 0.38, rtol=1e-15)


def test_friction_by_eq1_takes_magnitudes_of_both_accelerations() -> None:
    """At ±2 m/s² of the table and ±1 m/s² of the block only g + Üg tan θ differs."""
    times = np.arange(20.0)
    table = np.tile([2.0, -2.0], 10)
    test = xr.Dataset(
        {"ground_acceleration": ("time", table), "block_acceleration": ("time", 0.5 * table)},
        {"time": times},
    )
    found = slipsweep.measured_friction(test, 45.0, 0.4, g=10.0)
    # 0.4 - 1 - (2 - 1 - 10) / (10 ± 2)
    expected = [-0.6 + 9.0 / 12.0, -0.6 + 9.0 / 8.0] * 10
    np.testing.assert_allclose(found.friction_coefficient, expected, rtol=1e-12)


@pytest.mark.parametrize("kinetic", [0.38, 0.25])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_coulombs_friction_is_level_by_statics_where_eq1_falls(
    kinetic: float, noise: float
) -> None:
    found = slipsweep.measured_friction(coulomb(kinetic, noise), 6.0, 0.38)
    assert found.sizes["slide"] == 6
    assert found.least_friction.max() < 0.15
    assert found.attrs["constant_friction"].startswith(
        f"This is a block of constant friction: by statics {kinetic:.2g}"
    )
    np.testing.assert_allclose(found.slide_free_body_friction, kinetic, atol=0.01)
    assert found.kinetic_friction.item() == pytest.approx(kinetic, abs=0.004)
    assert found.static_friction.item() == pytest.approx(0.38, abs=0.03)
    for name, true in (("static", 0.38), ("kinetic", kinetic)):
        low, high = found[f"{name}_friction_interval"].values
        assert low - 1e-3 <= true <= high + 1e-3, name
    at_rest = found.free_body_friction.values[:40]
    np.testing.assert_allclose(at_rest.mean(), math.tan(math.radians(6.0)), atol=0.005)


def test_friction_above_the_static_one_is_doubted() -> None:
    """As of a channel whose sign is reversed, or whose unit is another one."""
    found = slipsweep.measured_friction(coulomb(0.38, 0.0), 6.0, 0.25)
    assert (
        "more than mu_s = 0.25: are signs and units of all channels"
        in found.attrs["constant_friction"]
    )


def test_a_decaying_interface_is_not_called_constant(stick_slip: xr.Dataset) -> None:
    assert friction(stick_slip).attrs["constant_friction"] == ""
    assert friction(measured(stick_slip)).attrs["constant_friction"] == ""


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_stick_slip_has_one_slide_a_cycle(stick_slip: xr.Dataset, noise: float) -> None:
    """A slide a cycle: onset where Eq. 4 first falls behind the table, peak with it, stop as
    simulated.
    """
    found = friction(measured(stick_slip, noise=noise))
    assert found.sizes["slide"] == 5
    moving = stick_slip.relative_velocity.values > 1e-9
    onsets = stick_slip.time.values[np.flatnonzero(~moving[:-1] & moving[1:])]
    stops = stick_slip.time.values[np.flatnonzero(moving[:-1] & ~moving[1:]) + 1]
    tolerance = 0.005 if noise == 0.0 else 0.015
    np.testing.assert_allclose(found.slide_onset, onsets, atol=tolerance + 1e-9)
    np.testing.assert_allclose(found.slide_stop, stops, atol=tolerance + 1e-9)
    crests = 0.5 + (np.arange(5) + 0.25) / 1.8
    np.testing.assert_allclose(found.slide_peak, crests, atol=0.0026 if noise == 0.0 else 0.04)


def test_slides_begin_and_stop_at_the_first_sample_after_the_block_does() -> None:
    """At 100 Hz, against the simulated motion at 100 kHz."""
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "frequency": 1.8}
    block |= {"yield_acceleration": 0.59, "decay_rate": 2.7, "excitation": slipsweep.Sine(cycles=5)}
    step = 0.01
    test = slipsweep.simulate(**block, times=np.arange(0.0, 3.2, step))
    found = slipsweep.measured_friction(test, 5.0, 0.38)
    fine = slipsweep.simulate(**block, times=np.arange(0.0, 3.2, 1e-5))
    moves = np.diff((fine.relative_velocity.values > 0.0).astype(int), append=0)
    begins, stops = (fine.time.values[moves == sign] for sign in (1, -1))
    for name, times in (("slide_onset", begins), ("slide_stop", stops)):
        late = (found[name].values - times) / step
        assert (late > -0.05).all(), name  # just before the stop r is below the threshold
        assert (late < 1.0).all(), name


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_continuous_sliding_is_one_slide(noise: float) -> None:
    found = slipsweep.measured_friction(measured(exact(CONTINUOUS), noise=noise), 6.0, 0.38)
    assert found.sizes["slide"] == 1
    # Üy is reached at 0.9 m/s², and the shaking lasts for 8 cycles
    assert abs(found.slide_onset.item() - 0.51) < 0.015
    assert abs(found.slide_stop.item() - (0.5 + 8 / 2.5)) < 0.02


def test_a_slide_that_the_record_ends_in_has_no_stop(stick_slip: xr.Dataset) -> None:
    found = friction(stick_slip.isel(time=slice(0, 170)))  # 0.845 s, in the first slide
    assert found.sizes["slide"] == 1
    assert math.isnan(found.slide_stop.item())
    (span,) = found.slipsweep.chart("friction").axes[0].patches
    assert span.get_x() + span.get_width() == found.time[-1]


def test_the_threshold_is_reported(stick_slip: xr.Dataset) -> None:
    noisy = friction(measured(stick_slip))
    # r has the noise of both: 2 % of 3.55 and of the block's peak acceleration
    sigma = 0.02 * np.hypot(3.55, float(abs(stick_slip.block_acceleration).max()))
    assert noisy.attrs["threshold"] == pytest.approx(4 * sigma, rel=0.15)
    assert "standard deviations" in noisy.attrs["threshold_from"]
    exactly = friction(stick_slip)
    assert exactly.attrs["threshold"] == pytest.approx(0.005 * 3.55, rel=1e-3)
    assert friction(stick_slip, threshold=5.0).sizes["slide"] == 0


def test_friction_does_not_depend_on_equal_sampling(stick_slip: xr.Dataset) -> None:
    kept = np.sort(
        np.random.default_rng(1).permutation(stick_slip.time.size)[: stick_slip.time.size * 2 // 3]
    )
    found = friction(stick_slip.isel(time=kept))
    np.testing.assert_allclose(found.slide_onset, friction(stick_slip).slide_onset, atol=0.025)
    assert found.sizes["slide"] == 5


def test_offset_and_drift_are_taken_off_where_named(stick_slip: xr.Dataset) -> None:
    drifting = stick_slip.copy(deep=True)
    drifting.block_acceleration.values[:] += 0.4 + 0.1 * stick_slip.time.values
    asked = friction(drifting, drift="block_acceleration", rest=(0.0, 0.495))
    np.testing.assert_allclose(asked.block_acceleration, stick_slip.block_acceleration, atol=1e-12)
    assert asked.attrs["removed"] == "block_acceleration: 0.4 m s-2 and 0.1 m s-2 a second"
    late = friction(
        drifting.assign_coords(time=drifting.time + 10),
        drift="block_acceleration",
        rest=(10, 10.495),
    )
    np.testing.assert_allclose(late.block_acceleration, stick_slip.block_acceleration, atol=1e-12)
    unasked = friction(drifting)
    np.testing.assert_array_equal(unasked.block_acceleration, drifting.block_acceleration)
    assert unasked.attrs["removed"] == "nothing"


def test_a_file_is_read_with_its_units(stick_slip: xr.Dataset, tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    time, tables, blocks = (
        stick_slip[name].values for name in ("time", "ground_acceleration", "block_acceleration")
    )
    columns = time * 1e3, tables / 9.80665, blocks * 100
    rows = "\n".join(
        f"{t:.9g};{table:.15g};;{block:.15g}" for t, table, block in zip(*columns, strict=True)
    )
    path.write_text(
        f"# a test\nTime [ms];Table acceleration (g);remark;Block_acceleration (gal)\n{rows}\n"
    )
    found = friction(path)
    np.testing.assert_allclose(
        found.friction_coefficient, friction(stick_slip).friction_coefficient, atol=1e-12
    )
    assert found.attrs["test"] == "test.csv"
    assert len(found.attrs["test_sha256"]) == 64


def test_a_dataset_is_taken_in_its_units(stick_slip: xr.Dataset) -> None:
    in_g = {
        name: stick_slip[name] / 9.80665 for name in ("ground_acceleration", "block_acceleration")
    }
    for array in in_g.values():
        array.attrs["units"] = "g"
    found = friction(in_g)
    expected = friction(stick_slip)
    np.testing.assert_allclose(
        found.friction_coefficient, expected.friction_coefficient, atol=1e-12
    )


HEAD = "time (s),table acceleration (m/s2),block acceleration (m/s2)\n"
ROWS = "".join(f"{i / 100},{math.sin(i)},{math.sin(i)}\n" for i in range(20))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"0 columns of time: must be one, as in time \(s\), table acceleration"),
        (ROWS, "0 columns of time"),
        (HEAD.replace(" (m/s2),", ","), r"'table acceleration': must give its unit in brackets"),
        (HEAD.replace("(m/s2),", "(mm),") + ROWS, r"must be a unit that converts to m s-2"),
        (
            HEAD + ROWS.replace("0.05,", "0.04,"),
            "time of sample 6 = 0.04: must be greater than 0.04",
        ),
        (HEAD + "\n".join([*ROWS.splitlines(), "9,0,0"]), "no samples from t = 0.19 to 9 s"),
        (
            HEAD + "0,1,one\n",
            "line 2: '0,1,one': must be 3 cells, and a number, or nothing, for time",
        ),
        (
            HEAD.replace(",block acceleration", ",temperature") + ROWS,
            "block_acceleration: missing: Eq. 1 needs",
        ),
    ],
)
def test_files_that_are_no_tests_are_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "test.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        friction(path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"theta": -1.0}, "theta = -1"),
        ({"threshold": 0.0}, "threshold = 0.0: must be"),
        ({"offset": "friction"}, "offset = 'friction': must be 'all'"),
        ({"offset": "all", "rest": (5.0, 6.0)}, "rest = .*: 0 samples to fit to"),
        ({"theta": 80.0}, "the block would lift off"),
    ],
)
def test_impossible_options_are_refused(
    stick_slip: xr.Dataset, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        friction(stick_slip, **options)


def test_a_blank_cell_is_a_sample_that_is_not_there(stick_slip: xr.Dataset) -> None:
    gappy = stick_slip.copy(deep=True)
    gappy.block_acceleration.values[100:103] = np.nan
    found = friction(gappy)
    assert np.isnan(found.friction_coefficient.values[100:103]).all()
    assert np.isfinite(found.least_friction).all()


def test_the_friction_angle_stands_for_the_coefficient() -> None:
    path = Path(__file__).parents[2] / "sweeps/data/shaking_test.csv"
    phi = np.degrees(np.arctan(0.38))
    xr.testing.assert_allclose(
        slipsweep.measured_friction(path, 5.0, phi=phi),
        slipsweep.measured_friction(path, 5.0, 0.38),
        rtol=1e-12,
    )
    with pytest.raises(InputError, match=r"^mu_s: must be given$"):
        slipsweep.measured_friction(path, 5.0)
    with pytest.raises(InputError, match=r"^phi, mu_s: must not both be given"):
        slipsweep.calibrate(path, 5.0, 0.38, phi=phi)


@pytest.mark.parametrize(
    ("separator", "comma"), [(";", ","), ("\t", ","), (";", "."), (",", "."), ("\t", ".")]
)
def test_columns_between_semicolons_and_tabs_may_have_decimal_commas(
    tmp_path: Path, separator: str, comma: str
) -> None:
    """A column of another name is left out; milliseconds and gal are converted."""
    times = np.arange(20) * 0.005
    table = np.round(3.0 * np.sin(40.0 * times), 3)
    heading = [
        "time (ms)",
        "temperature (K)",
        "table acceleration (gal)",
        "block acceleration (m/s2)",
    ]
    lines = [separator.join(heading)]
    for time, value in zip(times, table, strict=True):
        numbers = (1000.0 * time, 293.15, 100.0 * value, 0.5 * value)
        lines.append(separator.join(f"{number:.6f}".replace(".", comma) for number in numbers))
    (tmp_path / "test.csv").write_text("\n".join(lines) + "\n")
    test = read_test(tmp_path / "test.csv")
    np.testing.assert_allclose(test.times, times, atol=1e-9)
    np.testing.assert_allclose(test.channels["ground_acceleration"], table, atol=1e-8)
    np.testing.assert_allclose(test.channels["block_acceleration"], 0.5 * table, atol=1e-6)
