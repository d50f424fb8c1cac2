"""Sobol indices: closed forms, scipy, what physics leaves no doubt about; what has none; files and
commands.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import slipsweep
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.model.variables import SensitivityStatus
from slipsweep.studies.sampling import MOST_SAMPLES, RESAMPLES, Sampling, sobol_indices
from tests.studies.test_uncertainty import FACTOR, sampling_of

#: Uniform from -π to π.
ANGLE: dict[str, Any] = {"distribution": "uniform", "loc": -np.pi, "scale": 2 * np.pi}
ANGLES = {"theta": ANGLE, "mu_s": ANGLE, "amplitude": ANGLE}


def ishigami(draws: Any) -> np.ndarray:
    """Ishigami's and Homma's function of three angles, with a = 7 and b = 0.1."""
    first, second, third = (draws[name] for name in ("theta", "mu_s", "amplitude"))
    return np.asarray(np.sin(first) + 7.0 * np.sin(second) ** 2 + 0.1 * third**4 * np.sin(first))


def closed_form() -> tuple[np.ndarray, np.ndarray]:
    """Its first-order and total indices."""
    alone = np.array([0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 7.0**2 / 8, 0.0])
    both = 0.1**2 * np.pi**8 * 8 / 225
    variance = alone.sum() + both
    return alone / variance, (alone + np.array([both, 0.0, both])) / variance


def reduced(sampling: Sampling, values: np.ndarray) -> dict[str, np.ndarray]:
    """The indices of one grid point's runs."""
    found = sobol_indices(sampling, values[np.newaxis])
    return {name: one[0] for name, one in found.items()}


@pytest.mark.parametrize("seed", [0, 1])
def test_ishigamis_function(seed: int) -> None:
    sampling = sampling_of(ANGLES, sensitivity=True, samples=2**14, seed=seed)
    found = reduced(sampling, ishigami(sampling.draws))
    for name, exact in zip(("first_order", "total"), closed_form(), strict=True):
        np.testing.assert_allclose(found[f"{name}_index"], exact, rtol=0.01, atol=0.003)
        low, high = found[f"{name}_interval"]
        assert ((low <= exact) & (exact <= high)).all()


def test_estimates_are_those_of_scipy() -> None:
    """The estimators of scipy.stats.sobol_indices, and its bootstrap's percentiles but for what
    chance does to them.
    """
    sampling = sampling_of(ANGLES, sensitivity=True, samples=512)
    runs = ishigami(sampling.draws).reshape(5, 1, 512)
    found = reduced(sampling, runs.ravel())
    theirs = stats.sobol_indices(func={"f_A": runs[0], "f_B": runs[1], "f_AB": runs[2:]}, n=512)
    np.testing.assert_allclose(found["first_order_index"], theirs.first_order, atol=1e-12)
    np.testing.assert_allclose(found["total_index"], theirs.total_order, atol=1e-12)

    centred = runs[:, 0] - runs[:2].mean()

    def statistic(index: np.ndarray) -> np.ndarray:
        a, b, *others = centred[:, index]
        variance = np.var([a, b])
        first = [np.mean(b * (other - a)) / variance for other in others]
        return np.array([first, [np.mean((a - other) ** 2) / 2 / variance for other in others]])

    theirs = stats.bootstrap(
        [np.arange(512)],
        statistic,
        n_resamples=4000,
        method="percentile",
        rng=np.random.default_rng(1),
    ).confidence_interval
    ours = np.stack([found["first_order_interval"], found["total_interval"]])
    width = theirs.high - theirs.low
    assert (np.abs(ours[:, 0] - theirs.low) < 0.1 * width).all()
    assert (np.abs(ours[:, 1] - theirs.high) < 0.1 * width).all()


def test_intervals_of_random_numbers_hold_the_truth_as_often_as_they_say() -> None:
    held = []
    for seed in range(60):
        sampling = sampling_of(ANGLES, sensitivity=True, samples=2048, seed=seed, method="random")
        found = reduced(sampling, ishigami(sampling.draws))
        for name, exact in zip(("first_order", "total"), closed_form(), strict=True):
            low, high = found[f"{name}_interval"]
            held.append((low <= exact) & (exact <= high))
    assert 0.90 <= np.mean(held) <= 0.99


def test_a_product_of_two_inputs() -> None:
    """u = W(A)/ω²: with A and f drawn the variance of a product, whose indices have
    a closed form.
    """
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4}
    strength = stats.uniform(3.0, 5.0)
    pace = stats.lognorm(0.1, scale=2.0)
    found = slipsweep.sample(
        **block,
        uncertain={"amplitude": strength, "frequency": pace},
        samples=2**14,
        sensitivity=True,
    )
    levels = (np.arange(20000) + 0.5) / 20000
    alone = slipsweep.sweep(
        **block, amplitude=strength.ppf(levels), frequency=1.0
    ).permanent_displacement.values
    scatter = {
        "amplitude": np.var(alone) / np.mean(alone) ** 2,
        "frequency": np.exp(4 * 0.1**2) - 1,
    }
    variance = np.prod([1 + value for value in scatter.values()]) - 1
    for name, other in (("amplitude", "frequency"), ("frequency", "amplitude")):
        one = found.sel(input=name)
        assert one.first_order_index == pytest.approx(scatter[name] / variance, rel=0.01)
        assert one.total_index == pytest.approx(1 - scatter[other] / variance, rel=0.01)


def test_an_input_without_effect_has_no_index() -> None:
    """λ plays no part where the yield acceleration governs: not to the last bit."""
    block: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.4,
        "yield_acceleration": 2.5,
        "decay_rate": 8.0,
    }
    uncertain = {"decay_rate": FACTOR, "amplitude": {**FACTOR, "s": 0.05}}
    found = slipsweep.sample(
        **block, amplitude=4.0, frequency=1.0, uncertain=uncertain, sensitivity=True, samples=1024
    )
    assert found.flag_share.sel(flag=int(slipsweep.Validity.YIELD_GOVERNS)) == 1.0
    assert found.total_index.sel(input="decay_rate") == 0.0
    assert found.first_order_index.sel(input="decay_rate") == 0.0
    np.testing.assert_array_equal(found.total_interval.sel(input="decay_rate"), 0.0)
    assert found.total_index.sel(input="amplitude") == pytest.approx(1.0, rel=0.01)


def test_correlated_inputs_are_one() -> None:
    uncertain = {
        "mu_s": {**FACTOR, "s": 0.05},
        "amplitude": FACTOR,
        "decay_rate": FACTOR,
        "delta_mu": FACTOR,
    }
    pairs = [("delta_mu", "decay_rate", 0.9), ("mu_s", "delta_mu", 0.1)]
    sampling = sampling_of(uncertain, sensitivity=True, correlation=pairs)
    assert sampling.independent == (("mu_s", "decay_rate", "delta_mu"), ("amplitude",))
    drawn = sampling.draws
    draws = {name: values.reshape(4, -1) for name, values in drawn.items()}
    for name in ("mu_s", "decay_rate", "delta_mu"):
        np.testing.assert_array_equal(draws[name][2:], [draws[name][1], draws[name][0]])
    np.testing.assert_array_equal(
        draws["amplitude"][2:], [draws["amplitude"][0], draws["amplitude"][1]]
    )
    # of a sum of what is drawn: the variance of the group is that of its sum
    found = reduced(sampling, np.sum([np.log(values) for values in drawn.values()], axis=0))
    share = (0.05**2 + 2 * 0.3**2 * 1.9 + 2 * 0.1 * 0.05 * 0.3) / (
        0.05**2 + 2 * 0.3**2 * 1.9 + 0.003 + 0.3**2
    )
    for index in ("first_order_index", "total_index"):
        np.testing.assert_allclose(found[index], [share, 1 - share], rtol=0.02)


CASE: dict[str, Any] = {
    "theta": [0.0, 15.0],
    "amplitude": [0.5, 4.0, 8.0],
    "samples": 128,
    "sensitivity": True,
}


def test_where_there_are_no_indices_the_status_says_why() -> None:
    """A block that never slides, and one that some draws make slide under its own weight."""
    uncertain = {"mu_s": stats.uniform(0.2, 0.2), "amplitude": {**FACTOR, "s": 0.05}}
    found = slipsweep.sample(**CASE, frequency=1.0, uncertain=uncertain)
    expected = [
        [SensitivityStatus.NO_VARIANCE, SensitivityStatus.COMPUTED, SensitivityStatus.COMPUTED],
        [SensitivityStatus.RUNS_WITHOUT_VALUE] * 3,
    ]
    np.testing.assert_array_equal(found.sensitivity_status, expected)
    assert (found.valueless_share.sel(theta=15.0) > 0.3).all()
    for name in ("first_order_index", "first_order_interval", "total_index", "total_interval"):
        there = (
            found[name]
            .notnull()
            .all([dim for dim in ("input", "bound") if dim in found[name].dims])
        )
        np.testing.assert_array_equal(there, found.sensitivity_status == 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sensitivity": 1024}, "sensitivity = 1024: must be true or false"),
        (
            {"samples": MOST_SAMPLES // 2},
            f"samples = {MOST_SAMPLES // 2}: Sobol indices take .* runs a grid point",
        ),
    ],
)
def test_indices_that_cannot_be_computed_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        sampling_of(ANGLES, **{"sensitivity": True, **options})


SWEEP = """
[axes]
theta.values = [0, 5]
amplitude.values = [0.2, 2, 4, 6, 8]
frequency.values = [1, 2]
[uncertainty]
samples = 256
sensitivity = true
mu_s = { distribution = "uniform", loc = 0.35, scale = 0.1 }
amplitude = { kind = "factor", distribution = "lognorm", s = 0.3 }
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sensitivity")
    (folder / "a.toml").write_text(SWEEP)
    assert main(["run", str(folder / "a.toml"), "-o", str(folder / "a.nc"), "--quiet"]) == 0
    return folder / "a.nc"


def test_a_file_has_what_python_gives(result: Path) -> None:
    found = slipsweep.sample(
        theta=[0.0, 5.0],
        amplitude=[0.2, 2.0, 4.0, 6.0, 8.0],
        frequency=[1.0, 2.0],
        samples=256,
        sensitivity=True,
        uncertain={"mu_s": stats.uniform(0.35, 0.1), "amplitude": FACTOR},
    )
    with xr.open_dataset(result) as file:
        assert file.input.values.tolist() == ["mu_s", "amplitude"]
        for name in ("first_order_index", "first_order_interval", "total_index", "total_interval"):
            np.testing.assert_array_equal(
                file[name].sel(input="amplitude"), found[name].sel(input="amplitude")
            )
        np.testing.assert_array_equal(file.sensitivity_status, found.sensitivity_status)
        assert (
            file.attrs["sensitivity"]
            == f"Saltelli et al. (2010), 1024 runs; bootstrap of {RESAMPLES}"
        )
