"""Uncertain inputs: statistics against closed forms, plain sweeps and scipy; files, commands and charts."""

import json
import warnings
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from scipy import stats

import slipsweep
from slipsweep.cli import main
from slipsweep.errors import InputError
from slipsweep.files import spec
from slipsweep.files import storing as store
from slipsweep.files.jobs import sweep_job
from slipsweep.model.variables import Validity
from slipsweep.studies.sampling import check_sampling
from tests.support.commands import command

G = 9.81
LOGNORMAL: dict[str, Any] = {"distribution": "lognorm", "s": 0.3}
FACTOR = {**LOGNORMAL, "kind": "factor"}

#: Stuck and sliding in both modes, and two frequencies.
GRID: dict[str, Any] = {"theta": [0.0, 5.0], "mu_s": 0.4, "amplitude": [2.0, 4.0, 6.0], "frequency": [0.5, 2.0]}


def drawn(uncertain: dict[str, Any], **options: Any) -> dict[str, np.ndarray]:
    """The draws that `sample` makes."""
    settings: dict[str, Any] = {
        "samples": 4096, "method": "sobol", "seed": 0, "quantiles": 0.5, "thresholds": 0.1, "correlation": (), "g": G
    }  # fmt: skip
    return check_sampling(uncertain, **{**settings, **options}).draws()


# ----------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("model", ["newmark", "mendez"])
def test_quantiles_are_those_of_the_input(model: str) -> None:
    """u falls with Üy, so that its quantile q is u at the quantile 1 − q of Üy."""
    case: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4, "amplitude": 2.0, "frequency": [0.7, 2.0], "model": model}
    yields = stats.lognorm(0.2, scale=0.9)
    levels = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    found = slipsweep.sample(**case, uncertain={"yield_acceleration": yields}, samples=2**15, quantiles=levels)
    exact = slipsweep.sweep(**case, yield_acceleration=yields.ppf(1 - levels)).permanent_displacement
    assert (exact > 0).all()
    np.testing.assert_allclose(found.displacement_quantile, exact, rtol=1e-3)


def test_exceedance_is_the_distribution_at_the_limit() -> None:
    """P(u > d) = P(A > limit amplitude of d), for Newmark's block, whose u grows with A."""
    block: dict[str, Any] = {"theta": [0.0, 8.0], "mu_s": 0.5, "frequency": [0.5, 1.0, 3.0], "model": "newmark"}
    thresholds = [0.005, 0.05, 0.5]
    shaking = stats.lognorm(0.5, scale=6.0)
    found = slipsweep.sample(**block, uncertain={"amplitude": shaking}, thresholds=thresholds, samples=2**15)
    limits = slipsweep.limit_amplitude(thresholds, **block, maximum_amplitude=200.0)
    assert bool((limits.limit_status == 0).all())
    np.testing.assert_allclose(found.exceedance_probability, shaking.sf(limits.limit_amplitude), atol=2e-4)


def test_stuck_share_is_the_distribution_at_yield() -> None:
    found = slipsweep.sample(
        theta=5, mu_s=0.4, frequency=1, uncertain={"amplitude": {**LOGNORMAL, "scale": 3.0}}, samples=2**14
    )
    limits = slipsweep.friction_parameters(5, 0.4, 3.0)
    below = [
        stats.lognorm(0.3, scale=3.0).cdf(limits[name]) for name in ("yield_acceleration", "limiting_acceleration")
    ]
    np.testing.assert_allclose(found.mode_share, [below[0], below[1] - below[0], 1 - below[1]], atol=3e-4)
    assert found.exceedance_probability.sel(threshold=0.01) < 1 - below[0]


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random"])
def test_error_falls_as_the_method_promises(method: str) -> None:
    """RMS error of P(u > 10 cm) over seeds, under two uncertain inputs: Sobol's beats plain sampling by far."""
    case: dict[str, Any] = {"theta": 5, "mu_s": 0.4, "amplitude": 3.0, "frequency": 1, "method": method}
    case |= {"uncertain": {"amplitude": FACTOR, "mu_s": {"distribution": "norm", "scale": 0.05, "kind": "offset"}}}
    truth = slipsweep.sample(**{**case, "method": "sobol"}, samples=2**20).exceedance_probability.sel(threshold=0.1)
    errors = [
        slipsweep.sample(**case, samples=1024, seed=seed).exceedance_probability.sel(threshold=0.1) - truth
        for seed in range(1, 33)
    ]
    plain = float(np.sqrt(truth * (1 - truth) / 1024))
    ratio = float(np.sqrt(np.mean(np.square(errors)))) / plain
    low, high = {"sobol": (0.0, 0.25), "latin_hypercube": (0.0, 0.75), "random": (0.7, 1.35)}[method]
    assert low < ratio < high


# -------------------------------------------------------------- statistics of plain sweeps


UNCERTAIN: list[dict[str, Any]] = [
    {"amplitude": FACTOR},
    {"theta": {"distribution": "uniform", "scale": 3.0, "kind": "offset"}, "frequency": {**FACTOR, "s": 0.1}},
    {"mu_s": {"distribution": "triang", "c": 0.5, "loc": 0.8, "scale": 0.4, "kind": "factor"}},
    {"frequency": {"distribution": "uniform", "loc": -0.2, "scale": 0.4, "kind": "offset"}},
]


@pytest.mark.parametrize("uncertain", UNCERTAIN, ids=lambda one: "-".join(one))
def test_statistics_of_a_sweep_over_the_draws(uncertain: dict[str, Any]) -> None:
    """The draws, put into `sweep` as one more dimension, and reduced by numpy."""
    options: dict[str, Any] = {"quantiles": [0.1, 0.5, 0.99], "thresholds": [0.0, 0.02, 0.3]}
    found = slipsweep.sample(**GRID, uncertain=uncertain, samples=256, seed=3, **options)
    given: dict[str, Any] = {
        name: xr.DataArray(values, dims=name) if np.ndim(values) else values for name, values in GRID.items()
    }
    for name, values in drawn(uncertain, samples=256, seed=3).items():
        one = xr.DataArray(values, dims="sample")
        given[name] = given[name] * one if uncertain[name]["kind"] == "factor" else given[name] + one
    swept = slipsweep.sweep(**given)
    u = swept.permanent_displacement
    dims = ("theta", "amplitude", "frequency")
    quantiles = u.quantile(options["quantiles"], "sample").transpose(*dims, "quantile")
    np.testing.assert_allclose(found.displacement_quantile, quantiles, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found.mean_displacement, u.mean("sample").transpose(*dims), rtol=1e-12)
    for threshold in options["thresholds"]:
        share = (u > threshold).mean("sample").transpose(*dims)
        np.testing.assert_allclose(found.exceedance_probability.sel(threshold=threshold), share, atol=1e-15)
    modes = xr.concat([(swept.sliding_mode == mode).mean("sample") for mode in range(3)], "mode")
    flags = xr.concat([(swept.validity & (1 << bit) != 0).mean("sample") for bit in range(len(Validity))], "flag")
    for name, share in (("mode_share", modes), ("flag_share", flags)):
        ours, theirs = xr.broadcast(found[name].drop_vars(str(found[name].dims[-1])), share)
        np.testing.assert_allclose(ours, theirs.transpose(*ours.dims), atol=1e-15)


#: A block on which every parameter matters, and by how much each is drawn.
BLOCK = {
    "theta": 5.0, "mu_s": 0.4, "amplitude": 5.0, "displacement_amplitude": 0.03, "frequency": 2.0,
    "yield_acceleration": 2.5, "decay_rate": 2.0, "delta_mu": 0.1, "minimum_friction": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("kind", ["absolute", "factor", "offset"])
@pytest.mark.parametrize("name", [*BLOCK, "yield_coefficient"])
def test_each_parameter_and_kind(name: str, kind: str) -> None:
    """One parameter drawn, against a sweep over its draws."""
    left_out = "amplitude" if name == "displacement_amplitude" else "displacement_amplitude"
    given: dict[str, Any] = {key: value for key, value in BLOCK.items() if key != left_out}
    if name in ("delta_mu", "minimum_friction"):
        # where Eq. 4 governs, with λ by Eq. 6
        del given["decay_rate"]
        given["yield_acceleration"] = 0.6
    if name == "yield_coefficient":
        given = {"amplitude": 5.0, "frequency": 2.0, "yield_coefficient": 0.25, "model": "newmark"}
    base = given[name]
    width = {"loc": 0.9, "scale": 0.2}
    if kind != "factor":
        width = {"loc": (0.9 if kind == "absolute" else -0.1) * base, "scale": 0.2 * base}
    uncertain = {name: {"distribution": "uniform", **width, "kind": kind}}
    values = drawn(uncertain, samples=64)[name]
    values = {"absolute": values, "factor": base * values, "offset": base + values}[kind]
    swept = slipsweep.sweep(**{**given, name: np.sort(values)}).permanent_displacement
    if kind == "absolute":
        del given[name]
    found = slipsweep.sample(**given, uncertain=uncertain, samples=64, quantiles=[0.25, 0.75])
    expected = swept.quantile([0.25, 0.75])
    assert 0 < expected[0] < expected[1]
    np.testing.assert_allclose(found.displacement_quantile, expected, rtol=1e-11)


@pytest.mark.parametrize("kind", ["absolute", "factor", "offset"])
def test_a_friction_angle_is_the_coefficient_of_its_tangent(kind: str) -> None:
    width = {"absolute": (20.0, 1.0), "factor": (1.0, 0.05), "offset": (0.0, 1.0)}[kind]
    uncertain = {"phi": {"distribution": "norm", "loc": width[0], "scale": width[1], "kind": kind}}
    case: dict[str, Any] = {"theta": 5.0, "amplitude": [3.0, 5.0], "frequency": 1.0}
    given = {} if kind == "absolute" else {"phi": 20.0}
    found = slipsweep.sample(**case, **given, uncertain=uncertain, samples=64)
    draws = drawn(uncertain, samples=64)["phi"]
    angles = {"absolute": draws, "factor": 20.0 * draws, "offset": 20.0 + draws}[kind]
    u = slipsweep.sweep(**case, phi=np.sort(angles)).permanent_displacement
    np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), u.median("phi"), rtol=1e-12)


def test_of_a_displacement_amplitude() -> None:
    """A = ω²d: the frequency axis is then real work, and drawn frequencies enter A too."""
    uncertain = {"displacement_amplitude": FACTOR, "frequency": {**FACTOR, "s": 0.1}}
    grid: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4}
    found = slipsweep.sample(
        **grid, displacement_amplitude=[0.01, 0.03], frequency=[1.0, 2.0, 3.0], uncertain=uncertain, samples=64
    )
    draws = {name: xr.DataArray(values, dims="sample") for name, values in drawn(uncertain, samples=64).items()}
    swept = slipsweep.sweep(
        **grid,
        displacement_amplitude=xr.DataArray([0.01, 0.03], dims="displacement_amplitude")
        * draws["displacement_amplitude"],
        frequency=xr.DataArray([1.0, 2.0, 3.0], dims="frequency") * draws["frequency"],
    )
    expected = swept.permanent_displacement.median("sample").transpose("displacement_amplitude", "frequency")
    assert expected.max() > 0.01
    np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), expected, rtol=1e-12)
    assert found.mode_share.dims == ("displacement_amplitude", "frequency", "mode")


def test_of_a_frequency_without_an_axis() -> None:
    """A drawn frequency enters u = W/ω², and with a displacement amplitude A = ω²d as well."""
    uncertain = {"frequency": {"distribution": "uniform", "loc": 1.0, "scale": 2.0}}
    frequency = drawn(uncertain, samples=64)["frequency"]
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4}
    drives: list[dict[str, Any]] = [{"amplitude": 4.0}, {"displacement_amplitude": 0.03}]
    for drive in drives:
        found = slipsweep.sample(**block, **drive, uncertain=uncertain, samples=64)
        swept = slipsweep.sweep(**block, **drive, frequency=np.sort(frequency)).permanent_displacement
        np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), swept.median(), rtol=1e-12)
        assert found.mean_displacement.dims == ()
        assert ("amplitude" in found.coords) == ("amplitude" in drive)


def test_the_scaling_law() -> None:
    """u = W/ω²: twice the frequency, a quarter of every quantile, and P(u > d/4) what P(u > d) was."""
    options: dict[str, Any] = {"uncertain": {"amplitude": FACTOR}, "samples": 512}
    one = slipsweep.sample(**{**GRID, "frequency": 1.0}, **options, thresholds=[0.04, 0.4])
    two = slipsweep.sample(**{**GRID, "frequency": 2.0}, **options, thresholds=[0.01, 0.1])
    assert np.array_equal(one.displacement_quantile, 4 * two.displacement_quantile)
    assert np.array_equal(one.exceedance_probability, two.exceedance_probability)
    both = slipsweep.sample(**{**GRID, "frequency": [1.0, 2.0]}, **options)
    assert np.array_equal(both.displacement_quantile.sel(frequency=2.0), two.displacement_quantile)
    assert "frequency" not in both.mode_share.dims


def test_factor_offset_and_absolute_are_the_same_distribution_said_differently() -> None:
    case: dict[str, Any] = {"theta": 5, "amplitude": 4.0, "frequency": 1, "samples": 1024}
    ways: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
        "absolute": ({}, {"distribution": "norm", "loc": 0.4, "scale": 0.02}),
        "factor": ({"mu_s": 0.4}, {"distribution": "norm", "loc": 1.0, "scale": 0.05}),
        "offset": ({"mu_s": 0.4}, {"distribution": "norm", "scale": 0.02}),
    }
    results = [
        slipsweep.sample(**case, **given, uncertain={"mu_s": {**one, "kind": kind}})
        for kind, (given, one) in ways.items()
    ]
    for other in results[1:]:
        np.testing.assert_allclose(other.displacement_quantile, results[0].displacement_quantile, rtol=1e-10)


@pytest.mark.parametrize("name", ["yield_acceleration", "minimum_friction", "delta_mu", "decay_rate"])
def test_factor_on_an_estimate(name: str) -> None:
    """Where the parameter is not given, its estimate (Coulomb's, Eqs. 9-11, Eq. 6) at each draw is what scatters."""
    uncertain: dict[str, Any] = {
        name: {"distribution": "uniform", "loc": 0.9, "scale": 0.2, "kind": "factor"},
        "mu_s": {"distribution": "uniform", "loc": 0.35, "scale": 0.1},
    }
    found = slipsweep.sample(theta=5, amplitude=[3.0, 7.0], frequency=1, uncertain=uncertain, samples=64)
    draws = {one: xr.DataArray(values, dims="sample") for one, values in drawn(uncertain, samples=64).items()}
    amplitude = xr.DataArray([3.0, 7.0], dims="amplitude")
    given: dict[str, Any] = {"theta": 5, "mu_s": draws["mu_s"], "amplitude": amplitude}
    estimate: Any = slipsweep.friction_parameters(**given)[name] * draws[name]
    exact = slipsweep.sweep(**given, frequency=1, **{name: estimate}).permanent_displacement.median("sample")
    np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), exact, rtol=1e-12)
    plain = slipsweep.sample(
        theta=5, amplitude=[3.0, 7.0], frequency=1, uncertain={"mu_s": uncertain["mu_s"]}, samples=64
    )
    assert not np.allclose(plain.mean_displacement, found.mean_displacement, rtol=1e-3)


def test_correlation_of_normal_scores() -> None:
    uncertain = {"mu_s": {**LOGNORMAL, "scale": 0.4}, "amplitude": FACTOR, "decay_rate": stats.uniform(1, 4)}
    pairs = [("amplitude", "mu_s", -0.6)]
    free, tied = drawn(uncertain, samples=8192), drawn(uncertain, samples=8192, correlation=pairs)
    logs = np.log([tied["mu_s"], tied["amplitude"]])
    np.testing.assert_allclose(np.corrcoef([*logs, tied["decay_rate"]])[0, 1:], [-0.6, 0.0], atol=0.01)
    for name in free:  # each by itself is as it was
        np.testing.assert_allclose(
            np.quantile(tied[name], [0.1, 0.5, 0.9]), np.quantile(free[name], [0.1, 0.5, 0.9]), rtol=0.01
        )


# ----------------------------------------------------------- what has no value, and chunks


def test_statically_unstable_samples_exceed_every_threshold() -> None:
    """A block that slides under its own weight (μs ≤ tan θ) has no displacement by the model."""
    friction = stats.lognorm(0.2, scale=0.3)
    found = slipsweep.sample(
        theta=[0.0, 15.0, 40.0], amplitude=2.0, frequency=1, uncertain={"mu_s": friction}, samples=8192
    )
    unstable = friction.cdf(np.tan(np.radians([0.0, 15.0, 40.0])))
    np.testing.assert_allclose(found.valueless_share, unstable, atol=1e-3)
    assert 0.2 < unstable[1] < 0.8
    np.testing.assert_array_equal(found.flag_share.sel(flag=1), found.valueless_share)
    np.testing.assert_allclose(found.mode_share.sum("mode") + found.valueless_share, 1, atol=1e-12)
    there = found.isel(theta=1)
    values = slipsweep.sweep(theta=15, mu_s=drawn({"mu_s": friction}, samples=8192)["mu_s"], amplitude=2.0, frequency=1)
    stable = values.permanent_displacement.dropna("mu_s").values
    exceeding = np.count_nonzero(values.permanent_displacement.fillna(np.inf) > 0.1)
    assert there.exceedance_probability.sel(threshold=0.1) == exceeding / 8192 > np.mean(stable > 0.1)
    np.testing.assert_allclose(there.displacement_quantile, np.quantile(stable, [0.05, 0.5, 0.95]), rtol=1e-12)
    nobody = slipsweep.sample(theta=40, mu_s=0.3, amplitude=2.0, frequency=1, uncertain={"amplitude": FACTOR})
    assert nobody.valueless_share == 1
    assert (nobody.exceedance_probability == 1).all()
    assert nobody.displacement_quantile.isnull().all()


def test_chunks_of_grid_points_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    uncertain = {"amplitude": FACTOR, "decay_rate": {**FACTOR, "s": 0.1}}
    whole = slipsweep.sample(**GRID, uncertain=uncertain, samples=128)
    monkeypatch.setattr("slipsweep.studies.uncertainty._CELLS", 300)
    parts = slipsweep.sample(**GRID, uncertain=uncertain, samples=128)
    xr.testing.assert_identical(whole, parts)


def test_progress_counts_every_sample() -> None:
    done: list[int] = []
    slipsweep.sample(**GRID, uncertain={"mu_s": {**FACTOR, "s": 0.01}}, samples=128, progress=done.append)
    assert sum(done) == 2 * 3 * 128  # frequencies cost nothing


def test_zipped_parameters_keep_their_dimension() -> None:
    sites: dict[str, Any] = {
        "theta": xr.DataArray([0.0, 5.0], {"site": ["a", "b"]}, ["site"]),
        "mu_s": xr.DataArray([0.3, 0.4], dims="site"),
    }
    found = slipsweep.sample(
        **sites, amplitude=[2.0, 4.0], frequency=xr.DataArray([1.0, 2.0], dims="site"), uncertain={"amplitude": FACTOR}
    )
    assert found.displacement_quantile.dims == ("amplitude", "site", "quantile")
    assert list(found.site.values) == ["a", "b"]
    alone = slipsweep.sample(theta=5.0, mu_s=0.4, amplitude=[2.0, 4.0], frequency=2.0, uncertain={"amplitude": FACTOR})
    np.testing.assert_array_equal(found.sel(site="b").displacement_quantile, alone.displacement_quantile)


# ------------------------------------------------------------------------- seeds and records


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random"])
def test_a_seed_gives_the_same_bits(method: str) -> None:
    def run(seed: int) -> xr.Dataset:
        return slipsweep.sample(**GRID, uncertain={"amplitude": FACTOR}, samples=64, method=method, seed=seed)

    xr.testing.assert_identical(run(5), run(5))
    assert not run(5).mean_displacement.equals(run(6).mean_displacement)
    assert run(5).attrs["seed"] == 5
    assert run(5).attrs["sampling"].startswith(method)


def test_frozen_distributions_and_order_do_not_matter() -> None:
    case: dict[str, Any] = {"theta": 5, "frequency": 1, "samples": 64}
    names = {
        "mu_s": {**LOGNORMAL, "scale": 0.4},
        "amplitude": {"distribution": "gamma", "a": 4, "units": "g", "scale": 0.1},
    }
    frozen = {"amplitude": stats.gamma(4, scale=0.1 * G), "mu_s": stats.lognorm(0.3, scale=0.4)}
    one, other = (slipsweep.sample(**case, uncertain=uncertain) for uncertain in (names, frozen))
    np.testing.assert_allclose(one.displacement_quantile, other.displacement_quantile, rtol=1e-12)
    stored = json.loads(other.attrs["uncertain"])
    assert stored["mu_s"] == {"distribution": "lognorm", "s": 0.3, "scale": 0.4, "kind": "absolute"}


def test_no_warnings() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        slipsweep.sample(**GRID, uncertain={"amplitude": FACTOR}, samples=128)


# ---------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mu_s": stats.norm(0.1, 0.1)}, r"^uncertain.mu_s = norm\(loc=0.1, scale=0.1\): 15.8\d% of the draws"),
        ({"theta": {"distribution": "norm", "loc": 80, "scale": 10}}, "of the draws are not 0 <= theta < 90 degrees"),
        ({"amplitude": {"distribution": "norm", "scale": 1.0, "kind": "offset"}}, "as offset on amplitude = 2: 2.2"),
        ({"amplitude": {**FACTOR, "distribution": "logistic"}}, 'uncertain.amplitude.s: unknown key; known here: '),
        ({"amplitude": {**FACTOR, "distribution": "lognormal"}}, 'no such distribution; did you mean "lognorm"?'),
        ({"amplitude": {**FACTOR, "distribution": "poisson"}}, "such as norm, lognorm|did you mean"),
        ({"amplitude": {**FACTOR, "unit": "g"}}, 'uncertain.amplitude.unit: unknown key; did you mean "units"?'),
        ({"amplitude": {**FACTOR, "scle": 2}}, 'uncertain.amplitude.scle: unknown key; did you mean "scale"?'),
        ({"amplitude": {**FACTOR, "s": "wide"}}, "uncertain.amplitude.s = 'wide': must be a finite number"),
        ({"amplitude": {**FACTOR, "s": -1}}, "parameters that scipy.stats does not allow"),
        ({"amplitude": {**FACTOR, "units": "g"}}, "units = 'g': not allowed with kind = 'factor'"),
        ({"amplitude": {**LOGNORMAL, "kind": "offset", "units": "mm"}}, 'amplitude.units = "mm": must be'),
        ({"amplitude": {**LOGNORMAL, "kind": "relative"}}, "kind = 'relative': must be one of 'absolute', 'factor'"),
        ({"amplitude": {"s": 1}}, "uncertain.amplitude.distribution: missing"),
        ({"amplitude": {"distribution": "lognorm"}}, "uncertain.amplitude.s: missing: lognorm needs s"),
        ({"amplitude": LOGNORMAL}, "uncertain.amplitude: is drawn, but amplitude is given as well"),
        ({"amplitude": {**FACTOR, "s": 10**400}}, "must be a finite number"),
        ({"mu_s": stats.norm([0.3, 0.4], 0.01)}, "uncertain.mu_s: is 2 distributions; must be one"),
        ({"amplitude": 3.0}, "uncertain.amplitude.distribution = 3.0: must be the name of a distribution"),
        ({"amplitude": {**FACTOR, "distribution": 1}}, "distribution = 1: must be the name of a distribution"),
        ({"mu": LOGNORMAL}, 'uncertain.mu: cannot be drawn; did you mean "mu_s"?'),
        ({"structure_frequency": LOGNORMAL}, "cannot be drawn"),
        ({"decay_rate": {**LOGNORMAL, "kind": "offset"}}, 'kind = "offset" needs decay_rate given'),
        ({"displacement_amplitude": FACTOR}, 'kind = "factor" needs displacement_amplitude given'),
        ({}, "uncertain: must give the distribution of one parameter at least"),
    ],
)  # fmt: skip
def test_bad_distributions(change: dict[str, Any], message: str) -> None:
    given = {name: value for name, value in GRID.items() if name not in change or "amplitude" in change}
    with pytest.raises(InputError, match=message):
        slipsweep.sample(**given, uncertain=change)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 1000}, 'samples = 1000: must be a power of 2 with method = "sobol", such as 512 or 1024'),
        ({"samples": 1}, "samples = 1: must be a whole number >= 2"),
        ({"method": "mc"}, "method = 'mc': must be one of"),
        ({"seed": -1}, "seed = -1"),
        ({"quantiles": [0.5, 1.0]}, "quantiles = 1: must be a number between 0 and 1"),
        ({"quantiles": [0.5, 0.1]}, "quantiles: 0.1 after 0.5: they must increase"),
        ({"quantiles": []}, "must be a list of one number or more"),
        ({"thresholds": ["5mm", "1s"]}, 'thresholds = "1s": must be a number, with a unit that converts to m'),
        ({"thresholds": -0.1}, "thresholds = -0.1: must be a finite number >= 0"),
        ({"correlation": [("mu_s", "theta", 0.1)]}, "correlation: 'mu_s' is not drawn; known here: theta, amplitude"),
        ({"correlation": [("theta", "amplitude", 1.5)]}, "must be between -1 and 1"),
        ({"correlation": ["theta"]}, "correlation = 'theta': must be"),
        ({"frequency": None}, "frequency: must be given, or drawn"),
        ({"structure_frequency": 1.0}, "structure_frequency"),
    ],
)
def test_bad_options(options: dict[str, Any], message: str) -> None:
    uncertain = {"theta": {"distribution": "uniform", "scale": 2, "kind": "offset"}, "amplitude": FACTOR}
    with pytest.raises((InputError, TypeError), match=message):
        slipsweep.sample(**{**GRID, "uncertain": uncertain, **options})


def test_what_memory_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipsweep.grid.resources.available_memory", lambda: 10**6)
    with pytest.raises(
        InputError, match=r"3 amplitude x 2 frequency, 65536 samples: takes .* but 1 MB of memory is free"
    ):
        slipsweep.sample(**GRID, uncertain={"amplitude": FACTOR}, samples=2**16)


def test_correlations_that_contradict_each_other() -> None:
    uncertain = {"theta": stats.uniform(0, 5), "amplitude": FACTOR, "mu_s": FACTOR}
    pairs = [("theta", "amplitude", 0.9), ("amplitude", "mu_s", 0.9), ("theta", "mu_s", -0.9)]
    with pytest.raises(InputError, match="no such correlations exist together"):
        slipsweep.sample(mu_s=0.4, amplitude=3, frequency=1, uncertain=uncertain, correlation=pairs)


# --------------------------------------------------------------- sweep files, commands, charts

FILE = """
[axes.theta]
values = [0, 5]
[axes.amplitude]
start = 0.1
stop = 1
num = 10
units = "g"
[axes.frequency]
values = [1, 2]
[excitation]
cycles = 5
[uncertainty]
samples = 256
seed = 7
thresholds = ["1cm", 0.1]
correlation = [["mu_s", "yield_acceleration", 0.5]]
[uncertainty.mu_s]
distribution = "lognorm"
s = 0.1
scale = 0.4
[uncertainty.amplitude]
kind = "factor"
distribution = "lognorm"
s = 0.3
[uncertainty.yield_acceleration]
kind = "factor"
distribution = "lognorm"
s = 0.15
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a result of the command."""
    path = tmp_path_factory.mktemp("uncertain")
    (path / "fragile.toml").write_text(FILE)
    done = command(path, "run", "fragile.toml")
    assert (done.returncode, done.stderr) == (0, "")
    assert "40 grid points (2 theta x 10 amplitude x 2 frequency), 256 samples each" in done.stdout
    assert "5120 samples solved" in done.stdout
    return path


def test_a_sweep_file_is_what_python_says(folder: Path) -> None:
    found = xr.load_dataset(folder / "fragile.nc")
    direct = slipsweep.sample(
        theta=[0, 5],
        amplitude=np.linspace(0.1, 1, 10) * G,
        frequency=[1, 2],
        excitation=slipsweep.Sine(cycles=5),
        samples=256,
        seed=7,
        thresholds=["10mm", 0.1],
        correlation=[("yield_acceleration", "mu_s", 0.5)],
        uncertain={
            "yield_acceleration": {**FACTOR, "s": 0.15},
            "amplitude": FACTOR,
            "mu_s": {"distribution": "lognorm", "s": 0.1, "scale": 0.4},
        },
    )
    for name, values in direct.data_vars.items():
        np.testing.assert_array_equal(found[name], values)
        assert found[name].dims == values.dims
    assert found.attrs["uncertain"] == direct.attrs["uncertain"]
    assert (found.attrs["seed"], found.attrs["samples"]) == (7, 256)


def test_a_result_is_repeated_from_itself(folder: Path) -> None:
    assert command(folder, "run", "fragile.nc", "-o", "again.nc", "--quiet").stdout == ""
    first, again = (xr.load_dataset(folder / name) for name in ("fragile.nc", "again.nc"))
    xr.testing.assert_equal(first, again)
    assert first.attrs["sweep"] == again.attrs["sweep"] == FILE
    refused = command(folder, "run", "fragile.toml")
    assert (refused.returncode, "exists already" in refused.stderr) == (2, True)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed = 7", "sed = 7", 'uncertainty.sed: unknown key; did you mean "seed"?'),
        ("[uncertainty.mu_s]", "[uncertainty.mus]", 'uncertainty.mus: unknown key; did you mean "mu_s"?'),
        ("samples = 256", "samples = 100", "uncertainty.samples = 100: must be a power of 2"),
        ('"1cm"', '"1 s"', 'uncertainty.thresholds = "1 s": must be a number, with a unit that converts to m'),
        ("s = 0.15", "q = 0.15", "uncertainty.yield_acceleration.q: unknown key; known here: distribution, kind"),
        ("scale = 0.4", 'scale = 0.4\nunits = "m"', 'uncertainty.mu_s.units = "m": must be a unit that converts to 1'),
        ("[axes.theta]", "[axes.mu_s]", "uncertainty.mu_s: is drawn, but mu_s is given as well"),
        ("scale = 0.4", "scale = 0.4\nloc = -0.4", r"x.toml: uncertainty.mu_s = lognorm("),
        (
            "[excitation]",
            '[output]\nvariables = ["validity"]\n[excitation]',
            "output.variables: not allowed beside [unc",
        ),
        ("[excitation]", "[model]\nstructure_frequency = 2\n[excitation]", "x.toml: structure_frequency: not allowed"),
    ],
)
def test_bad_sweep_files(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    old: str,
    new: str,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(FILE.replace(old, new, 1))
    assert main(["run", "x.toml"]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.startswith("slipsweep: error: x.toml: ")
    assert printed.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.toml"]


def test_other_commands_say_what_they_want(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(folder / "fragile.nc")
    assert main(["limit", path, "-d", "5cm"]) == 2
    assert "limits are those of a sweep without [uncertainty]" in capsys.readouterr().err
    assert main(["chart", path, "--kind", "contours"]) == 2
    assert "must be one of fragility, quantiles, sensitivity" in capsys.readouterr().err
    assert main(["info", path]) == 0
    assert "exceedance_probability" in capsys.readouterr().out


def test_cases_keep_their_labels(tmp_path: Path) -> None:
    text = FILE.replace(
        "[axes.theta]\nvalues = [0, 5]", '[[cases]]\nlabel = "north"\ntheta = 0\n[[cases]]\nlabel = "süd"\ntheta = 5'
    )
    store.run(sweep_job(spec.parse(text, "cases.toml")), tmp_path / "cases.nc", command="slipsweep run")
    with netCDF4.Dataset(tmp_path / "cases.nc") as file:
        assert list(file["label"][:]) == ["north", "süd"]
        assert file["displacement_quantile"].dimensions == ("amplitude", "frequency", "case", "quantile")


def test_charts_by_default(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["chart", str(folder / "fragile.nc")]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"fragile-fragility.png", "fragile-quantiles.png"}


def test_fragility_curves_are_the_probabilities(folder: Path) -> None:
    figure = xr.load_dataset(folder / "fragile.nc").slipsweep.chart(
        "fragility", at={"theta": "5deg", "frequency": "2000mHz"}
    )
    found = xr.load_dataset(folder / "fragile.nc").sel(theta=5, frequency=2).exceedance_probability
    curves = {line.get_label(): line.get_xydata() for line in figure.axes[0].get_lines()}
    assert list(curves) == ["d = 10 mm", "d = 100 mm"]
    for threshold, curve in zip(found.threshold, curves.values(), strict=True):
        np.testing.assert_array_equal(curve, np.column_stack([found.amplitude, found.sel(threshold=threshold)]))
    assert "μs ~ lognorm(s=0.1, scale=0.4), A × lognorm(s=0.3)" in figure.get_supxlabel().replace("\n", " ")
    assert "256 samples" in figure.get_supxlabel()


def test_bands_are_the_quantiles(folder: Path) -> None:
    figure = xr.load_dataset(folder / "fragile.nc").slipsweep.chart("quantiles", at={"theta": 0, "frequency": 1})
    (axes,) = (axes for axes in figure.axes if axes.get_yscale() == "log")
    (median,) = (line for line in axes.get_lines() if line.get_label() == "median")
    found = xr.load_dataset(folder / "fragile.nc").sel(theta=0, frequency=1, quantile=0.5).displacement_quantile * 1000
    slid = found.values > 1
    np.testing.assert_allclose(np.asarray(median.get_ydata())[slid], found.values[slid])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["5 to 95 %", "median"]


def test_the_share_without_a_value_is_shown(tmp_path: Path) -> None:
    text = FILE.replace("[0, 5]", "[15]").replace("s = 0.1\n", "s = 0.2\n").replace("scale = 0.4", "scale = 0.3")
    job = sweep_job(spec.parse(text.replace('"1cm", 0.1', "0.1"), "steep.toml"))
    store.run(job, tmp_path / "steep.nc", command="slipsweep run")
    whole = job.plan.solve()
    result = xr.load_dataset(tmp_path / "steep.nc")
    figure = result.slipsweep.chart("fragility", at={"frequency": 1})
    assert 0.1 < whole["valueless_share"].values.max() < 0.9
    dotted = [line for line in figure.axes[0].get_lines() if line.get_linestyle() == ":"]
    np.testing.assert_array_equal(dotted[0].get_ydata(), whole["valueless_share"].values[0])
    bands = result.slipsweep.chart("quantiles", at={"frequency": 1})
    assert "Without a value: up to" in bands.get_supxlabel()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--kind", "quantiles", "--y", "theta"), "--y theta: not with quantiles"),
        (("--kind", "fragility", "--x", "threshold"), "--x threshold: must be a parameter"),
        (("--kind", "fragility", "--x", "theta", "--y", "theta"), "--y theta: must be another axis"),
        (("--at", "threshold=1kg"), 'threshold = "1kg": must be a number, with a unit that converts to m'),
        (("--at", "amplitude=3g"), "outside the range of the result, 0.981 to 9.81 m s-2"),
    ],
)
def test_bad_charts(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...], message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["chart", str(folder / "fragile.nc"), *arguments]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
