"""Suites of recorded motions: each motion as alone, strengths, azimuths, limits, samples, and what
is refused.
"""

import pickle
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import InputError, Pair, Record, Suite, limit_amplitude, sample, sweep
from slipsweep.grid.plans import plan_sweep
from slipsweep.model.variables import BOTH_WAYS, DEFAULT_RECORD_RESULTS, RECORD_RESULTS
from tests.support.intensity import measures_by_sums

UNCERTAIN = {"mu_s": {"distribution": "uniform", "loc": 0.1, "scale": 0.2}}


def noise(seed: int, count: int, interval: float) -> Record:
    values = np.random.default_rng(seed).normal(size=count) * np.hanning(count)
    return Record.sampled(3.0 * values, interval, f"noise{seed}.csv")


MOTIONS = (noise(1, 300, 0.01), noise(2, 200, 0.02), noise(3, 500, 0.005))
SUITE = Suite(MOTIONS, name="three")
PAIRS = Suite(
    (Pair(MOTIONS[0], noise(4, 280, 0.01)), Pair(MOTIONS[1], noise(5, 200, 0.02))), name="pairs"
)


@pytest.mark.parametrize(
    ("model", "strength"),
    [
        ("mendez", "amplitude"),
        ("newmark", "scale"),
        ("mendez", "pgv"),
        ("newmark", "arias_intensity"),
    ],
)
def test_each_motion_does_what_it_does_alone(model: str, strength: str) -> None:
    given: dict[str, Any] = {
        strength: np.array([0.3, 0.9]) * {"amplitude": 6.0, "scale": 2.0}.get(strength, 1.0)
    }
    given |= {
        "time_scale": [1, 2.5],
        "polarity": "both",
        "model": model,
        "variables": tuple(one for one in RECORD_RESULTS if one not in BOTH_WAYS),
    }
    found = sweep([0, 5], [0.1, 0.3], excitation=SUITE, **given)
    assert found.permanent_displacement.dims == (
        "theta",
        "mu_s",
        strength,
        "time_scale",
        "polarity",
        "motion",
    )
    assert found.motion.values.tolist() == ["noise1", "noise2", "noise3"]
    assert float(found.permanent_displacement.max()) > 0.0
    for at, motion in enumerate(MOTIONS):
        alone = sweep([0, 5], [0.1, 0.3], excitation=motion, **given)
        for name in given["variables"]:
            np.testing.assert_array_equal(found[name].isel(motion=at), alone[name], err_msg=name)


def test_the_factor_of_each_motion_makes_the_strength() -> None:
    targets = {"amplitude": "pga", "pgv": "pgv", "arias_intensity": "arias_intensity"}
    for strength, measure in targets.items():
        given: dict[str, Any] = {strength: [0.5, 1.5]}
        found = sweep(5, 0.3, excitation=SUITE, variables=["motion_factor"], **given)
        assert found.motion_factor.dims == (strength, "motion")
        for at, motion in enumerate(MOTIONS):
            for value, factor in zip(
                [0.5, 1.5], found.motion_factor.isel(motion=at).values, strict=True
            ):
                scaled = measures_by_sums(motion.times, motion.acceleration * factor)
                assert scaled[measure] == pytest.approx(value, rel=1e-5)


def test_measures_are_coordinates() -> None:
    found = sweep(5, 0.3, excitation=SUITE)
    assert set(found.data_vars) == {*DEFAULT_RECORD_RESULTS, "motion_factor"}
    np.testing.assert_array_equal(found.motion_factor, 1.0)
    for at, motion in enumerate(MOTIONS):
        for name, value in measures_by_sums(motion.times, motion.acceleration).items():
            coordinate = found[f"motion_{name}"].sel(motion=f"noise{at + 1}")
            assert float(coordinate) == pytest.approx(value, rel=1e-4), name
    assert found.motion_pgv.attrs["units"] == "m s-1"
    assert (
        found.motion_significant_duration.attrs["units"]
        == found.motion_mean_period.attrs["units"]
        == "s"
    )
    assert (found.attrs["suite"], found.attrs["motions"]) == ("three", 3)


def test_a_value_for_each_motion() -> None:
    """Arrays along `motion` are taken together with it; labels that differ are refused."""
    scales = xr.DataArray([0.5, 1.0, 2.0], dims="motion", coords={"motion": list(SUITE.labels)})
    found = sweep(5, [0.1, 0.3], excitation=SUITE, scale=scales)
    assert found.permanent_displacement.dims == ("mu_s", "motion")
    for at, scale in enumerate(scales.values):
        alone = sweep(5, [0.1, 0.3], excitation=MOTIONS[at], scale=scale)
        np.testing.assert_array_equal(
            found.permanent_displacement.isel(motion=at), alone.permanent_displacement
        )
    with pytest.raises(InputError, match="scale: its coordinate 'motion' differs"):
        sweep(5, 0.3, excitation=SUITE, scale=scales.assign_coords(motion=["a", "b", "c"]))
    with pytest.raises(InputError, match=r"2 values along 'motion'|3 values along 'motion'"):
        sweep(5, 0.3, excitation=SUITE, scale=xr.DataArray([1.0, 2.0], dims="motion"))


def test_lazy_results_and_parts_have_the_same_bits() -> None:
    given: dict[str, Any] = {"excitation": SUITE, "amplitude": [2.0, 4.0, 6.0], "polarity": "both"}
    now = sweep([0, 5], [0.1, 0.3], **given)
    later = sweep([0, 5], [0.1, 0.3], **given, chunks={"motion": 1, "amplitude": 2})
    for name in now:
        np.testing.assert_array_equal(later[name].compute(), now[name], err_msg=str(name))
    plan = plan_sweep(
        {
            "theta": [0, 5],
            "mu_s": [0.1, 0.3],
            "amplitude": given["amplitude"],
            "polarity": "both",
        },
        excitation=SUITE,
    )
    part = plan.part({"motion": slice(1, 2), "theta": slice(1, 2)})
    solved = pickle.loads(pickle.dumps(part)).solve()
    assert solved["motion"].values.tolist() == ["noise2"]
    np.testing.assert_array_equal(
        solved["permanent_displacement"].values, now.permanent_displacement[1:, ..., 1:2].values
    )


def test_an_azimuth_of_pairs_is_the_component_there() -> None:
    azimuths = [0.0, 30.0, 90.0, 210.0]
    found = sweep([0, 5], 0.2, excitation=PAIRS, azimuth=azimuths, amplitude=[3.0, 6.0])
    assert found.permanent_displacement.dims == ("theta", "amplitude", "azimuth", "motion")
    assert found.motion_pga.dims == ("azimuth", "motion")
    for motion, pair in enumerate(PAIRS.motions):
        for at, azimuth in enumerate(azimuths):
            assert isinstance(pair, Pair)
            component = pair.rotated(azimuth)
            where = {"motion": motion, "azimuth": at}
            alone = sweep([0, 5], 0.2, excitation=component, amplitude=[3.0, 6.0])
            np.testing.assert_array_equal(
                found.permanent_displacement.isel(where), alone.permanent_displacement
            )
            assert float(found.motion_pga.isel(where)) == component.peak
            expected = measures_by_sums(component.times, component.acceleration)
            for name, value in expected.items():
                coordinate = found[f"motion_{name}"].isel(where)
                assert float(coordinate) == pytest.approx(value, rel=1e-4), name


def test_limits_are_those_of_each_motion() -> None:
    given: dict[str, Any] = {
        "displacement": [0.01, 0.1],
        "theta": 5,
        "mu_s": [0.1, 0.2],
        "amplitude_steps": 16,
    }
    found = limit_amplitude(**given, excitation=SUITE, polarity="both")
    assert found.limit_amplitude.dims == ("mu_s", "polarity", "motion", "displacement")
    assert np.isfinite(found.limit_amplitude).any()
    for at, motion in enumerate(MOTIONS):
        alone = limit_amplitude(**given, excitation=motion, polarity="both")
        for name in alone.data_vars:
            np.testing.assert_array_equal(
                found[name].isel(motion=at), alone[name], err_msg=str(name)
            )
    rotated = limit_amplitude(**given, excitation=PAIRS, azimuth=[0, 90])
    first = limit_amplitude(**given, excitation=MOTIONS[0])
    np.testing.assert_array_equal(
        rotated.limit_amplitude.isel(motion=0).sel(azimuth=0), first.limit_amplitude
    )


@pytest.mark.parametrize(
    ("strength", "time_scale"),
    [("amplitude", [1.0, 2.0]), ("pgv", [1.0, 2.0]), ("arias_intensity", 1.5)],
)
def test_samples_are_those_of_each_motion(strength: str, time_scale: Any) -> None:
    given: dict[str, Any] = {
        strength: [0.8, 2.0],
        "uncertain": UNCERTAIN,
        "samples": 32,
        "time_scale": time_scale,
    }
    found = sample(5, excitation=SUITE, **given)
    assert (found.mean_displacement > 0.0).any()
    for at, motion in enumerate(MOTIONS):
        alone = sample(5, excitation=motion, **given)
        for name in alone.data_vars:
            np.testing.assert_allclose(
                found[name].isel(motion=at), alone[name], rtol=1e-14, err_msg=str(name)
            )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"excitation": PAIRS}, "azimuth: must be given with pairs"),
        ({"pgv": -1}, "pgv = -1: must be"),
        ({"variables": ["sliding_mode"]}, "variables = 'sliding_mode'"),
    ],
)
def test_inputs_that_a_suite_lacks_are_named(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        sweep(5, 0.3, **{"excitation": SUITE, **given})


@pytest.mark.parametrize("strength", ["amplitude", "pgv", "arias_intensity"])
def test_motions_that_do_not_move_are_not_scaled(strength: str) -> None:
    still = Record(np.arange(3.0), np.zeros(3), "still")
    given: dict[str, Any] = {strength: 1.0}
    with pytest.raises(InputError, match=f"{strength}: still has no acceleration to scale"):
        sweep(5, 0.3, excitation=Suite((MOTIONS[0], still)), **given)
    turned = Suite((Pair(still, noise(1, 3, 1.0)),))
    with pytest.raises(InputError, match=f"{strength}: still at azimuth 0 has no acceleration"):
        sweep(5, 0.3, excitation=turned, **given, azimuth=[90, 0])
    assert float(sweep(5, 0.3, excitation=turned, azimuth=0).permanent_displacement.item()) == 0.0
