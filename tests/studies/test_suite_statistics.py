"""Statistics over a suite of motions, beside numpy and by hand; what is refused."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import InputError, Record, Suite, Validity, suite_statistics, sweep
from slipsweep.model.variables import LimitStatus
from slipsweep.studies.suite_statistics import REASONS, limit_quantiles

UNSTABLE = Validity.STATICALLY_UNSTABLE
UPLIFT = Validity.UPLIFT
CAUTION = Validity.NOT_RECOUPLED


def suite_result(displacement: Any, validity: Any, dims: tuple[str, ...]) -> xr.Dataset:
    """A result as a sweep returns it, of numbers made up."""
    values = np.asarray(displacement, float)
    coords: dict[str, Any] = {
        "motion": [f"m{i}" for i in range(values.shape[dims.index("motion")])]
    }
    coords["motion_pga"] = ("motion", np.arange(len(coords["motion"])) + 1.0)
    coords |= {"polarity": [1, -1]} if "polarity" in dims else {}
    coords |= {
        dim: np.arange(1.0, 1.0 + values.shape[dims.index(dim)])
        for dim in dims
        if dim not in coords
    }
    data = {
        "permanent_displacement": (dims, values),
        "validity": (dims, np.asarray(validity, np.int16)),
    }
    return xr.Dataset(data, coords, {"g": 9.81, "suite": "made up"})


def test_zeros_missing_values_and_rounding_in_statistics_by_hand() -> None:
    """Rows: some zeros; all zeros; no values; one value; one non-zero value."""
    nan = np.nan
    values = [
        [0.0, 0.1, 0.4, nan, 1e-48],
        [0.0] * 5,
        [nan] * 5,
        [nan, 0.2, nan, nan, nan],
        [0.0, 0.0, 0.0, 0.0, 0.3],
    ]
    flags = [
        [0, CAUTION, 0, UPLIFT, 0],
        [0] * 5,
        [UNSTABLE | UPLIFT] * 4 + [UNSTABLE],
        [UPLIFT, 0] + [UPLIFT] * 3,
        [0] * 5,
    ]
    found = suite_statistics(
        suite_result(values, flags, ("mu_s", "motion")),
        thresholds=[0, "10cm"],
        quantiles=[0.25, 0.5],
    )
    assert "motion" not in found.dims
    assert "motion_pga" not in found.coords
    assert found.value_count.values.tolist() == [4, 5, 0, 1, 5]
    assert found.valueless_count.values.tolist() == [1, 0, 5, 4, 0]
    assert found.valueless_share.values.tolist() == [0.2, 0.0, 1.0, 0.8, 0.0]
    by_reason = found.valueless_flag_count.sel(flag=[int(UNSTABLE), int(UPLIFT)]).values
    assert by_reason.tolist() == [[0, 1], [0, 0], [5, 4], [0, 4], [0, 0]]
    assert found.flag.values.tolist() == [int(flag) for flag in REASONS]
    assert int(CAUTION) not in found.flag
    np.testing.assert_array_equal(found.zero_probability, [0.5, 1.0, nan, 0.0, 0.8])
    upslope = suite_statistics(suite_result([[-0.1, 0.0, 0.2, 0.4]], [[0] * 4], ("mu_s", "motion")))
    assert upslope.zero_probability == 0.5  # a displacement upslope is none, too
    np.testing.assert_allclose(found.nonzero_median, [0.25, nan, nan, 0.2, 0.3])
    np.testing.assert_allclose(found.nonzero_geometric_mean, [0.2, nan, nan, 0.2, 0.3])
    np.testing.assert_allclose(
        found.log_standard_deviation, [np.log(4.0) / np.sqrt(2.0), nan, nan, nan, nan]
    )
    np.testing.assert_array_equal(
        found.exceedance_probability, [[0.5, 0.25], [0.0, 0.0], [nan, nan], [1.0, 1.0], [0.2, 0.2]]
    )
    np.testing.assert_allclose(
        found.displacement_quantile, [[0.0, 0.05], [0.0, 0.0], [nan, nan], [0.2, 0.2], [0.0, 0.0]]
    )
    assert found.nonzero_median.attrs["units"] == "m"
    assert found.attrs["suite_dimensions"] == "motion"


@pytest.mark.parametrize("over", [None, "motion", ["motion", "polarity", "theta"]])
def test_statistics_are_numpys_of_each_grid_point(over: Any) -> None:
    """Random displacements, a third zero and a fifth missing; polarity is part of the suite unless
    told otherwise.
    """
    rng = np.random.default_rng(11)
    dims = ("theta", "polarity", "mu_s", "motion")
    values = np.where(rng.random((3, 2, 4, 20)) < 0.3, 0.0, rng.lognormal(-3.0, 1.2, (3, 2, 4, 20)))
    values[rng.random(values.shape) < 0.2] = np.nan
    given = suite_result(values, np.where(np.isnan(values), int(UPLIFT), 0), dims)
    found = suite_statistics(given, quantiles=[0.1, 0.5, 0.9], thresholds=[0.01, 0.05], over=over)
    taken = (
        ("motion", "polarity")
        if over is None
        else (over,)
        if isinstance(over, str)
        else tuple(over)
    )
    left = tuple(dim for dim in dims if dim not in taken)
    assert found.nonzero_median.dims == left
    cells = np.moveaxis(values, [dims.index(dim) for dim in taken], range(-len(taken), 0))
    cells = cells.reshape(*cells.shape[: len(left)], -1)
    for index in np.ndindex(cells.shape[:-1]):
        cell = cells[index][~np.isnan(cells[index])]
        slid = cell[cell > 0.0]
        assert int(found.value_count[index]) == cell.size
        for name, expected in {
            "zero_probability": np.mean(cell == 0.0),
            "nonzero_median": np.median(slid),
            "nonzero_geometric_mean": np.exp(np.log(slid).mean()),
            "log_standard_deviation": np.log(slid).std(ddof=1),
            "displacement_quantile": np.quantile(cell, [0.1, 0.5, 0.9]),
            "exceedance_probability": [(cell > 0.01).mean(), (cell > 0.05).mean()],
        }.items():
            np.testing.assert_allclose(
                found[name].values[index], expected, rtol=1e-12, err_msg=name
            )
    np.testing.assert_array_equal(
        found.valueless_flag_count.sel(flag=int(UPLIFT)), found.valueless_count
    )


def test_statistics_of_a_sweep_count_steep_and_flat_slopes() -> None:
    """A steep slope has no value, a flat one does not slide; what xarray computes is the same."""
    motions = [
        Record.sampled(np.random.default_rng(i).normal(size=200) * np.hanning(200), 0.02, f"n{i}")
        for i in range(5)
    ]
    result = sweep(
        [0, 5, 40],
        0.4,
        amplitude=[0.0, 3.0, 6.0],
        excitation=Suite(tuple(motions), name="s"),
        polarity="both",
    )
    found = suite_statistics(result, thresholds=[0.0])
    assert found.nonzero_median.dims == ("theta", "amplitude")
    assert found.value_count.values.tolist() == [[10] * 3, [10] * 3, [0] * 3]
    assert found.valueless_flag_count.sel(theta=40, flag=int(UNSTABLE)).values.tolist() == [10] * 3
    np.testing.assert_array_equal(found.zero_probability.sel(amplitude=0.0), [1.0, 1.0, np.nan])
    u = result.permanent_displacement.sel(theta=5)
    np.testing.assert_allclose(
        found.nonzero_median.sel(theta=5), u.where(u > 0).median(["motion", "polarity"]), rtol=1e-12
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"over": "polarity"},
            "over = 'polarity': must be a dimension of the result: mu_s, motion",
        ),
        ({"over": "mu_s"}, "over = 'mu_s': must have motion among them"),
        ({"thresholds": [0.2, 0.1]}, "thresholds: 0.1 after 0.2: they must increase"),
        ({"quantiles": [1.5]}, "quantiles = 1.5: must be a number between 0 and 1"),
        ({"zero": [0.1, 0.2]}, r"zero = \[0.1, 0.2\]: must be one displacement"),
        ({"zero": "2 s"}, 'zero = "2 s": must be a number, with a unit that converts to m'),
    ],
)
def test_statistics_of_no_suite_are_refused(given: dict[str, Any], message: str) -> None:
    result = suite_result([[0.1, 0.2]], [[0, 0]], ("mu_s", "motion"))
    with pytest.raises(InputError, match=message):
        suite_statistics(result, **given)


def test_limits_of_motions_without_a_value_are_left_out_of_their_quantiles() -> None:
    """Those that are not reached are above all others; without a value at any amplitude there is no
    limit.
    """
    nan = np.nan
    reached, beyond, invalid = LimitStatus.REACHED, LimitStatus.NOT_REACHED, LimitStatus.INVALID
    values = [[1.0, 2.0, 3.0, nan, nan], [1.0, nan, nan, nan, nan], [nan, nan, nan, nan, nan]]
    status = [
        [reached, LimitStatus.AT_JUMP, LimitStatus.AFTER_GAP, beyond, invalid],
        [reached, beyond, beyond, invalid, invalid],
        [invalid] * 5,
    ]
    limits = xr.Dataset(
        {
            "limit_amplitude": (("mu_s", "motion"), values),
            "limit_status": (("mu_s", "motion"), np.array(status, np.int8)),
        }
    )
    found = limit_quantiles(limits)
    np.testing.assert_array_equal(found["quantile"], [0.16, 0.5, 0.84])
    # of 1, 2, 3 and one above: between the third and the fourth there is no number
    expected = [[1.48, 2.5, np.inf], [np.inf] * 3, [nan] * 3]
    np.testing.assert_allclose(found.limit_quantile.transpose("mu_s", "quantile"), expected)
    np.testing.assert_array_equal(found.value_count, [4, 3, 0])
    np.testing.assert_array_equal(found.not_reached_count, [1, 2, 0])
    assert found.limit_quantile.attrs["units"] == "m s-2"
