"""Uncertain inputs under a record: against sweeps of the draws one by one, and in sweep files."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import InputError, Record, Suite, sample, sweep
from slipsweep.model.variables import Validity
from tests.studies.test_uncertainty import assert_statistics, sampling_of
from tests.support.made_up_records import few_pulses

SAMPLES = 64
THRESHOLDS = (0.001, 0.02)


@pytest.fixture(scope="module")
def shaking() -> Record:
    record = few_pulses()
    return Record(record.times, 2.0 * record.acceleration / record.peak)


def drawn(uncertain: dict[str, Any]) -> dict[str, xr.DataArray]:
    """The draws along a dimension."""
    draws = sampling_of(uncertain, samples=SAMPLES).draws
    return {name: xr.DataArray(values, dims="draw") for name, values in draws.items()}


NORMAL = {"distribution": "norm", "loc": 0.45, "scale": 0.04}
ABOUT_ONE = {"distribution": "lognorm", "s": 0.25, "kind": "factor"}

#: What is drawn, what is given, and what a sweep of the draws takes instead.
CASES: dict[str, tuple[dict[str, Any], dict[str, Any], Any]] = {
    "friction and amplitude": (
        {"mu_s": NORMAL, "amplitude": ABOUT_ONE},
        {"amplitude": [4.0, 9.0], "time_scale": [0.5, 1.0, 3.0], "polarity": "both"},
        lambda d: {
            "mu_s": d["mu_s"],
            "amplitude": xr.DataArray([4.0, 9.0], dims="amplitude") * d["amplitude"],
        },
    ),
    "scale": (
        {"scale": {"distribution": "uniform", "loc": 1.0, "scale": 4.0}},
        {"mu_s": [0.4, 0.5]},
        lambda d: {"scale": d["scale"]},
    ),
    "time as it is": (
        {"time_scale": {"distribution": "uniform", "loc": 0.5, "scale": 2.0}},
        {"mu_s": 0.4, "scale": [2.0, 4.0]},
        lambda d: {"time_scale": d["time_scale"]},
    ),
    "a factor on the time": (
        {"time_scale": ABOUT_ONE, "mu_s": NORMAL},
        {"scale": 3.0, "time_scale": [0.5, 2.0]},
        lambda d: {
            "mu_s": d["mu_s"],
            "time_scale": xr.DataArray([0.5, 2.0], dims="time_scale") * d["time_scale"],
        },
    ),
    **{
        f"{strength} over the time": (
            {"mu_s": NORMAL},
            {strength: [0.8, 2.0], "time_scale": [0.5, 2.0]},
            lambda d: {"mu_s": d["mu_s"]},
        )
        for strength in ("pgv", "arias_intensity")
    },
    "an offset to the time": (
        {"time_scale": {"distribution": "uniform", "loc": -0.2, "scale": 0.4, "kind": "offset"}},
        {"mu_s": 0.4, "scale": 3.0, "time_scale": [0.5, 2.0]},
        lambda d: {"time_scale": xr.DataArray([0.5, 2.0], dims="time_scale") + d["time_scale"]},
    ),
    "a factor on Coulomb's yield acceleration": (
        {"yield_acceleration": ABOUT_ONE},
        {"mu_s": 0.4, "scale": [2.0, 4.0]},
        lambda d: {
            "yield_acceleration": 9.81
            * (0.4 - np.tan(np.radians(5)))
            / (1 + 0.4 * np.tan(np.radians(5)))
            * d["yield_acceleration"]
        },
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_statistics_are_those_of_the_draws(shaking: Record, name: str) -> None:
    uncertain, given, taken = CASES[name]
    found = sample(
        theta=5.0,
        **given,
        uncertain=uncertain,
        excitation=shaking,
        samples=SAMPLES,
        thresholds=THRESHOLDS,
        quantiles=[0.1, 0.5, 0.9],
    )
    assert "mode_share" not in found
    assert "mode" not in found.coords
    swept = sweep(theta=5.0, **given | taken(drawn(uncertain)), excitation=shaking)
    moved = swept.permanent_displacement
    assert (moved > 0.0).any()
    assert found.displacement_quantile.dims[:-1] == tuple(
        dim for dim in moved.dims if dim != "draw"
    )
    assert_statistics(found, swept, "draw", 1e-11)


@pytest.mark.parametrize(
    ("given", "uncertain", "message"),
    [
        ({}, {"frequency": NORMAL}, "uncertain.frequency: not allowed with a Record"),
        ({"amplitude": 2.0}, {"scale": NORMAL}, "amplitude, scale: must not both be given"),
        ({}, {"scale": ABOUT_ONE}, 'kind = "factor" needs scale given'),
        (
            {},
            {"time_scale": {"distribution": "norm"}},
            r"time_scale = norm.*% of the draws are not",
        ),
    ],
)
def test_samples_under_a_record_that_are_refused(
    shaking: Record, given: dict[str, Any], uncertain: dict[str, Any], message: str
) -> None:
    block: dict[str, Any] = {"theta": 5.0, **({} if "mu_s" in uncertain else {"mu_s": 0.4})}
    with pytest.raises(InputError, match=message):
        sample(**block, **given, uncertain=uncertain, excitation=shaking, samples=16)


def test_pooled_motions_are_equally_likely_draws(shaking: Record) -> None:
    suite = Suite((shaking, Record(shaking.times * 0.6, shaking.acceleration**3)))
    # large scales lift some blocks, of one motion more than of another: they have no value
    given: dict[str, Any] = {
        "theta": 20.0,
        "scale": [1.0, 3.0],
        "time_scale": [1.0, 2.0],
        "polarity": "both",
        "excitation": suite,
        "uncertain": {"mu_s": NORMAL, "scale": ABOUT_ONE},
        "samples": SAMPLES,
        "thresholds": (0.1, 2.0),
    }
    over = ["polarity", "motion"]
    pooled = sample(**given, over=over)
    each = sample(**given)
    assert pooled.attrs["pooled"] == "2 polarity x 2 motion"
    assert not {*over} & {*pooled.dims, *pooled.coords}
    assert np.ptp(each.exceedance_probability.isel(scale=1, threshold=1).values) > 0.1
    counts = SAMPLES * (1.0 - each.valueless_share)
    assert 0 < counts.isel(scale=1).min() < counts.isel(scale=1).max()
    # statically unstable samples have no value and exceed every threshold
    counted = np.rint(
        counts + SAMPLES * each.flag_share.sel(flag=int(Validity.STATICALLY_UNSTABLE), drop=True)
    )
    expected = np.rint(each.exceedance_probability * counted).sum(over) / counted.sum(over)
    np.testing.assert_array_equal(
        pooled.exceedance_probability, expected.transpose(*pooled.exceedance_probability.dims)
    )
    for name in ("flag_share", "valueless_share"):
        np.testing.assert_array_equal(
            pooled[name], each[name].mean(over).transpose(*pooled[name].dims)
        )

    draws = drawn(given["uncertain"])
    scale = xr.DataArray(given["scale"], dims="scale") * draws["scale"]
    moved = sweep(
        20.0, draws["mu_s"], scale=scale, time_scale=[1.0, 2.0], polarity="both", excitation=suite
    )
    values = moved.permanent_displacement.stack(all=("draw", *over))
    np.testing.assert_allclose(
        pooled.displacement_quantile.transpose("quantile", ...),
        np.nanquantile(values, pooled["quantile"], axis=values.get_axis_num("all")),
        rtol=1e-11,
        atol=1e-15,
    )
    np.testing.assert_allclose(pooled.mean_displacement, values.mean("all"), rtol=1e-11)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"over": "motion"},
            "over = 'motion': must be a dimension of the grid: time_scale, polarity",
        ),
        (
            {"over": ["polarity", "time_scale"]},
            "over = 'time_scale': must not be a dimension of time_scale",
        ),
        ({"over": "polarity", "sensitivity": True}, "sensitivity = true: not allowed with over"),
        ({"over": 2}, "over = 2: must be a list of dimensions"),
    ],
)
def test_what_cannot_be_pooled(shaking: Record, given: dict[str, Any], message: str) -> None:
    axes: dict[str, Any] = {"theta": 5.0, "time_scale": [1.0, 2.0], "polarity": "both"}
    with pytest.raises(InputError, match=message):
        sample(**axes, **given, uncertain={"mu_s": NORMAL}, excitation=shaking, samples=16)
