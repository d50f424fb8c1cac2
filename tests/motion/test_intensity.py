"""Intensity measures: closed forms, other samplings of the same straight lines, and eqsig."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipsweep import Record
from slipsweep.motion import intensity

G = 9.80665


def measures(times: Any, acceleration: Any) -> dict[str, float]:
    return intensity.intensity_measures(np.array(times), np.array(acceleration))


def noise(seed: int = 1, count: int = 400) -> Record:
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.001, 0.02, count))
    return Record(times, random.normal(size=count) * np.hanning(count))


def resampled(record: Record, parts: int) -> Record:
    """The same straight lines, with more samples on them."""
    places = np.arange((record.times.size - 1) * parts + 1) / parts
    times = np.interp(places, np.arange(record.times.size), record.times)
    return Record(times, np.interp(times, record.times, record.acceleration))


def test_measures_of_a_sine_by_their_closed_forms() -> None:
    amplitude = 3.0
    frequency = 2.0
    cycles = 40
    duration = cycles / frequency
    omega = 2.0 * math.pi * frequency
    times = np.arange(cycles * 2000 + 1) / (2000 * frequency)
    computed = measures(times, amplitude * np.sin(omega * times))
    expected = {
        "pga": amplitude,
        # v = A/ω (1 - cos ωt), which never changes its sign: d is A/ω t at the end of each cycle
        "pgv": 2.0 * amplitude / omega,
        "pgd": amplitude / omega * duration,
        "arias_intensity": math.pi / (2.0 * G) * amplitude**2 * duration / 2.0,
        "cav": 2.0 * amplitude / math.pi * duration,
        "significant_duration": 0.9 * duration,
        "mean_period": 1.0 / frequency,
    }
    for name, value in expected.items():
        assert computed[name] == pytest.approx(
            value, rel=2e-6 if name != "mean_period" else 2e-3
        ), name


def test_measures_of_two_straight_lines_by_hand() -> None:
    """Up to 1 and down to -1: every number by hand."""
    computed = measures([10.0, 11.0, 13.0], [0.0, 1.0, -1.0])
    assert computed["pga"] == 1.0
    assert computed["pgv"] == pytest.approx(
        0.5 + 0.5, rel=1e-15
    )  # where the acceleration passes zero
    # 1/6 to t = 1, then v = 1/2 + τ - τ²/2 > 0 up to τ = 2
    assert computed["pgd"] == pytest.approx(1.0 / 6.0 + 1.0 + 2.0 - 8.0 / 6.0, rel=1e-15)
    assert computed["arias_intensity"] == pytest.approx(math.pi / (2.0 * G) * 1.0, rel=1e-15)
    assert computed["cav"] == pytest.approx(0.5 + 1.0, rel=1e-15)
    # of ∫ = 1: t³/3 = 0.05, and symmetrically at the end
    assert computed["significant_duration"] == pytest.approx(
        3.0 - 0.15 ** (1 / 3) - (1.0 - 0.85 ** (1 / 3)), rel=1e-14
    )


def test_the_mean_period_is_that_of_frequencies_up_to_20_hz() -> None:
    times = np.arange(0.0, 20.0, 0.005)
    waves = np.sin(2 * np.pi * 5 * times) + np.sin(2 * np.pi * 22 * times)
    assert intensity.mean_period(times, waves) == pytest.approx(0.2, rel=1e-2)


def test_a_constant_acceleration() -> None:
    """Where the cubic of the energy degenerates."""
    for last in (2.0, 2.0 + 1e-13, 2.0 + 1e-5):
        computed = measures([0.0, 10.0], [2.0, last])
        assert computed["significant_duration"] == pytest.approx(9.0, rel=1e-5)
        assert computed["pgd"] == pytest.approx(100.0, rel=1e-5)
        assert computed["cav"] == pytest.approx(20.0, rel=1e-5)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 7))
def test_more_samples_on_the_same_lines_change_nothing(seed: int, parts: int) -> None:
    record = noise(seed)
    coarse, fine = (
        measures(each.times, each.acceleration) for each in (record, resampled(record, parts))
    )
    del coarse["mean_period"]  # which the definition has of the samples
    for name, value in coarse.items():
        assert fine[name] == pytest.approx(value, rel=1e-11), name


@pytest.mark.parametrize("strength", ["scale", "amplitude", "pgv", "arias_intensity"])
@pytest.mark.parametrize("time_scale", [1.0, 2.5])
def test_a_strength_is_that_of_the_motion_that_shakes(strength: str, time_scale: float) -> None:
    record = noise()
    given_ = {strength: np.array([0.7]), "time_scale": np.array([time_scale])}
    factor = float(intensity.strength_factor(record.times, record.acceleration, given_)[0])
    shaken = measures(record.times * time_scale, record.acceleration * factor)
    if strength == "scale":
        assert factor == 0.7
    else:
        assert shaken["pga" if strength == "amplitude" else strength] == pytest.approx(
            0.7, rel=1e-13
        )


def test_motions_without_a_measure() -> None:
    still = measures(np.arange(4.0), np.zeros(4))
    assert math.isnan(still.pop("mean_period"))
    assert not any(still.values())
    # every frequency that samples 10 s apart resolve is below 0.25 Hz
    assert math.isnan(measures(10.0 * np.arange(400), noise(3).acceleration)["mean_period"])


def test_measures_are_those_of_eqsig() -> None:
    """Motions of pySLAMMER; eqsig's trapezoids have the straight lines 16 times as finely."""
    eqsig = pytest.importorskip("eqsig")
    pyslammer = pytest.importorskip("pyslammer")
    for name, motion in pyslammer.sample_ground_motions().items():
        record = Record.sampled(np.asarray(motion.accel) * G, motion.dt)
        fine = resampled(record, 16)
        signal = eqsig.AccSignal(fine.acceleration, motion.dt / 16)
        signal.generate_displacement_and_velocity_series()
        expected = {
            "pga": signal.pga,
            "pgv": signal.pgv,
            "pgd": signal.pgd,
            "arias_intensity": eqsig.im.calc_arias_intensity(signal)[-1] * 9.81 / G,
            "cav": eqsig.im.calc_cav(signal)[-1],
            "significant_duration": eqsig.im.calc_sig_dur(signal),
        }
        computed = measures(record.times, record.acceleration)
        for measure, value in expected.items():
            # eqsig's duration is from one sample to another
            near = {"abs": motion.dt / 8} if measure == "significant_duration" else {"rel": 3e-4}
            assert computed[measure] == pytest.approx(value, **near), f"{name}: {measure}"
