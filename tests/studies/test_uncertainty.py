"""Uncertain inputs: statistics against closed forms, plain sweeps and scipy; files, commands and
charts.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import slipsweep
from slipsweep.errors import InputError
from slipsweep.studies.sampling import Sampling
from tests.support.commands import command

G = 9.81
LOGNORMAL: dict[str, Any] = {"distribution": "lognorm", "s": 0.3}
FACTOR = {**LOGNORMAL, "kind": "factor"}

#: Stuck and sliding in both modes, and two frequencies.
GRID: dict[str, Any] = {
    "theta": [0.0, 5.0],
    "mu_s": 0.4,
    "amplitude": [2.0, 4.0, 6.0],
    "frequency": [0.5, 2.0],
}


def sampling_of(uncertain: dict[str, Any], **options: Any) -> Sampling:
    settings: dict[str, Any] = {
        "samples": 4096,
        "method": "sobol",
        "seed": 0,
        "quantiles": 0.5,
        "thresholds": 0.1,
        "correlation": (),
        "g": G,
    }
    return Sampling(uncertain, **{**settings, **options})


def drawn(uncertain: dict[str, Any], **options: Any) -> dict[str, np.ndarray]:
    """The draws that `sample` makes."""
    return sampling_of(uncertain, **options).draws


def assert_statistics(found: xr.Dataset, swept: xr.Dataset, dim: str, rtol: float) -> None:
    """Those of numpy over the draws, which are one more dimension of a sweep."""
    u = swept.permanent_displacement.variable
    flags = swept.validity.variable
    expected = {
        "displacement_quantile": u.quantile(found["quantile"].values, dim).transpose(
            ..., "quantile"
        ),
        "mean_displacement": u.mean(dim),
        "exceedance_probability": (u > found["threshold"].variable).mean(dim),
        "flag_share": ((flags & found["flag"].variable) != 0).mean(dim),
    }
    if "mode_share" in found:
        expected["mode_share"] = (swept.sliding_mode.variable == found["mode"].variable).mean(dim)
    for name, one in expected.items():
        # no share of a flag or mode depends on the time of the shaking, by which it is then
        # repeated
        own = found[name].variable.set_dims(one.sizes).transpose(*one.dims)
        tolerance = rtol if name in ("displacement_quantile", "mean_displacement") else 0.0
        np.testing.assert_allclose(
            own, one, rtol=tolerance, atol=min(tolerance, 1e-15), err_msg=name
        )


@pytest.mark.parametrize("model", ["newmark", "mendez"])
def test_quantiles_are_those_of_the_input(model: str) -> None:
    """u falls with Üy, so that its quantile q is u at the quantile 1 − q of Üy."""
    case: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.4,
        "amplitude": 2.0,
        "frequency": [0.7, 2.0],
        "model": model,
    }
    yields = stats.lognorm(0.2, scale=0.9)
    levels = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    found = slipsweep.sample(
        **case, uncertain={"yield_acceleration": yields}, samples=2**15, quantiles=levels
    )
    exact = slipsweep.sweep(
        **case, yield_acceleration=yields.ppf(1 - levels)
    ).permanent_displacement
    assert (exact > 0).all()
    np.testing.assert_allclose(found.displacement_quantile, exact, rtol=1e-3)


def test_exceedance_is_the_distribution_at_the_limit() -> None:
    """P(u > d) = P(A > limit amplitude of d), for Newmark's block, whose u grows with A."""
    block: dict[str, Any] = {
        "theta": [0.0, 8.0],
        "mu_s": 0.5,
        "frequency": [0.5, 1.0, 3.0],
        "model": "newmark",
    }
    thresholds = [0.005, 0.05, 0.5]
    shaking = stats.lognorm(0.5, scale=6.0)
    found = slipsweep.sample(
        **block, uncertain={"amplitude": shaking}, thresholds=thresholds, samples=2**15
    )
    limits = slipsweep.limit_amplitude(thresholds, **block, maximum_amplitude=200.0)
    assert bool((limits.limit_status == 0).all())
    np.testing.assert_allclose(
        found.exceedance_probability, shaking.sf(limits.limit_amplitude), atol=2e-4
    )


UNCERTAIN: list[dict[str, Any]] = [
    {"amplitude": FACTOR},
    {
        "theta": {"distribution": "uniform", "scale": 3.0, "kind": "offset"},
        "frequency": {**FACTOR, "s": 0.1},
    },
    {"mu_s": {"distribution": "triang", "c": 0.5, "loc": 0.8, "scale": 0.4, "kind": "factor"}},
    {"frequency": {"distribution": "uniform", "loc": -0.2, "scale": 0.4, "kind": "offset"}},
]


@pytest.mark.parametrize("uncertain", UNCERTAIN, ids=lambda one: "-".join(one))
def test_statistics_of_a_sweep_over_the_draws(uncertain: dict[str, Any]) -> None:
    """The draws, put into `sweep` as one more dimension, and reduced by numpy."""
    options: dict[str, Any] = {"quantiles": [0.1, 0.5, 0.99], "thresholds": [0.0, 0.02, 0.3]}
    found = slipsweep.sample(**GRID, uncertain=uncertain, samples=256, seed=3, **options)
    given: dict[str, Any] = {
        name: xr.DataArray(values, dims=name) if np.ndim(values) else values
        for name, values in GRID.items()
    }
    for name, values in drawn(uncertain, samples=256, seed=3).items():
        one = xr.DataArray(values, dims="sample")
        given[name] = (
            given[name] * one if uncertain[name]["kind"] == "factor" else given[name] + one
        )
    assert found.displacement_quantile.dims == ("theta", "amplitude", "frequency", "quantile")
    assert_statistics(found, slipsweep.sweep(**given), "sample", 1e-12)


#: A block on which every parameter matters, and by how much each is drawn.
BLOCK = {
    "theta": 5.0,
    "mu_s": 0.4,
    "amplitude": 5.0,
    "displacement_amplitude": 0.03,
    "frequency": 2.0,
    "yield_acceleration": 2.5,
    "decay_rate": 2.0,
    "delta_mu": 0.1,
    "minimum_friction": 0.1,
}


@pytest.mark.parametrize("kind", ["absolute", "factor", "offset"])
@pytest.mark.parametrize("name", [*BLOCK, "phi", "yield_coefficient"])
def test_each_parameter_is_drawn_by_each_kind(name: str, kind: str) -> None:
    """One parameter drawn, against a sweep over its draws."""
    left_out = "amplitude" if name == "displacement_amplitude" else "displacement_amplitude"
    given: dict[str, Any] = {key: value for key, value in BLOCK.items() if key != left_out}
    if name in ("delta_mu", "minimum_friction"):
        # where Eq. 4 governs, with λ by Eq. 6
        del given["decay_rate"]
        given["yield_acceleration"] = 0.6
    if name == "phi":  # Coulomb's yield acceleration follows it
        given["phi"] = np.degrees(np.arctan(given.pop("mu_s")))
        del given["yield_acceleration"]
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


def test_samples_of_a_displacement_amplitude_depend_on_the_frequency() -> None:
    """A = ω²d: the frequency axis is then real work, and drawn frequencies enter A too."""
    uncertain = {"displacement_amplitude": FACTOR, "frequency": {**FACTOR, "s": 0.1}}
    grid: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4}
    found = slipsweep.sample(
        **grid,
        displacement_amplitude=[0.01, 0.03],
        frequency=[1.0, 2.0, 3.0],
        uncertain=uncertain,
        samples=64,
    )
    draws = {
        name: xr.DataArray(values, dims="sample")
        for name, values in drawn(uncertain, samples=64).items()
    }
    swept = slipsweep.sweep(
        **grid,
        displacement_amplitude=xr.DataArray([0.01, 0.03], dims="displacement_amplitude")
        * draws["displacement_amplitude"],
        frequency=xr.DataArray([1.0, 2.0, 3.0], dims="frequency") * draws["frequency"],
    )
    expected = swept.permanent_displacement.median("sample").transpose(
        "displacement_amplitude", "frequency"
    )
    assert expected.max() > 0.01
    np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), expected, rtol=1e-12)
    assert found.mode_share.dims == ("displacement_amplitude", "frequency", "mode")


def test_samples_obey_the_scaling_law() -> None:
    """u = W/ω²: twice the frequency, a quarter of every quantile, and P(u > d/4)
    what P(u > d) was.
    """
    options: dict[str, Any] = {"uncertain": {"amplitude": FACTOR}, "samples": 512}
    one = slipsweep.sample(**{**GRID, "frequency": 1.0}, **options, thresholds=[0.04, 0.4])
    two = slipsweep.sample(**{**GRID, "frequency": 2.0}, **options, thresholds=[0.01, 0.1])
    assert np.array_equal(one.displacement_quantile, 4 * two.displacement_quantile)
    assert np.array_equal(one.exceedance_probability, two.exceedance_probability)
    both = slipsweep.sample(**{**GRID, "frequency": [1.0, 2.0]}, **options)
    assert np.array_equal(both.displacement_quantile.sel(frequency=2.0), two.displacement_quantile)
    assert "frequency" not in both.mode_share.dims


@pytest.mark.parametrize(
    "name", ["yield_acceleration", "minimum_friction", "delta_mu", "decay_rate"]
)
def test_a_factor_multiplies_the_estimate_of_a_parameter(name: str) -> None:
    """Where the parameter is not given, its estimate (Coulomb's, Eqs. 9-11, Eq. 6) at each draw is
    what scatters.
    """
    uncertain: dict[str, Any] = {
        name: {"distribution": "uniform", "loc": 0.9, "scale": 0.2, "kind": "factor"},
        "mu_s": {"distribution": "uniform", "loc": 0.35, "scale": 0.1},
    }
    found = slipsweep.sample(
        theta=5, amplitude=[3.0, 7.0], frequency=1, uncertain=uncertain, samples=64
    )
    draws = {
        one: xr.DataArray(values, dims="sample")
        for one, values in drawn(uncertain, samples=64).items()
    }
    amplitude = xr.DataArray([3.0, 7.0], dims="amplitude")
    given: dict[str, Any] = {"theta": 5, "mu_s": draws["mu_s"], "amplitude": amplitude}
    estimate: Any = slipsweep.friction_parameters(**given)[name] * draws[name]
    exact = slipsweep.sweep(**given, frequency=1, **{name: estimate}).permanent_displacement.median(
        "sample"
    )
    np.testing.assert_allclose(found.displacement_quantile.sel(quantile=0.5), exact, rtol=1e-12)
    plain = slipsweep.sample(
        theta=5,
        amplitude=[3.0, 7.0],
        frequency=1,
        uncertain={"mu_s": uncertain["mu_s"]},
        samples=64,
    )
    assert not np.allclose(plain.mean_displacement, found.mean_displacement, rtol=1e-3)


@pytest.mark.parametrize("name", ["decay_rate", "delta_mu", "minimum_friction"])
def test_a_factor_on_an_estimate_that_fails_has_no_value(name: str) -> None:
    """λ by Eq. 6 is negative: the block has a flag and no displacement, not 0, whatever is drawn
    about it.
    """
    block: dict[str, Any] = {"theta": 0.0, "mu_s": 1.5, "amplitude": 14.0}
    block["yield_acceleration"] = 1.0
    estimate = slipsweep.friction_parameters(**block)
    assert estimate.decay_rate < 0.0
    about = {"distribution": "uniform", "loc": 0.9, "scale": 0.2, "kind": "factor"}
    found = slipsweep.sample(**block, frequency=1.0, uncertain={name: about}, samples=64)
    assert found.valueless_share == 1.0
    assert found.flag_share.sel(flag=slipsweep.Validity.FRICTION_NOT_DECAYING) == 1.0
    assert found.mode_share.sum() == 0.0
    assert found.mean_displacement.isnull()
    assert found.displacement_quantile.isnull().all()
    assert found.exceedance_probability.isnull().all()


def test_correlation_of_normal_scores() -> None:
    uncertain = {
        "mu_s": {**LOGNORMAL, "scale": 0.4},
        "amplitude": FACTOR,
        "decay_rate": stats.uniform(1, 4),
    }
    pairs = [("amplitude", "mu_s", -0.6)]
    free = drawn(uncertain, samples=8192)
    tied = drawn(uncertain, samples=8192, correlation=pairs)
    logs = np.log([tied["mu_s"], tied["amplitude"]])
    np.testing.assert_allclose(
        np.corrcoef([*logs, tied["decay_rate"]])[0, 1:], [-0.6, 0.0], atol=0.01
    )
    for name in free:  # each by itself is as it was
        np.testing.assert_allclose(
            np.quantile(tied[name], [0.1, 0.5, 0.9]),
            np.quantile(free[name], [0.1, 0.5, 0.9]),
            rtol=0.01,
        )


def test_samples_that_lose_contact_are_no_part_of_a_probability() -> None:
    """Unlike statically unstable ones: P(u > d) = (above + unstable) / (with a value
    + unstable).
    """
    uncertain = {
        "mu_s": {"distribution": "uniform", "loc": 0.3, "scale": 0.4},
        "amplitude": {"distribution": "uniform", "loc": 2.0, "scale": 24.0},
    }
    found = slipsweep.sample(
        25.0, frequency=1.0, uncertain=uncertain, samples=256, thresholds=[0.05, 0.5]
    )
    draws: dict[str, Any] = {
        name: xr.DataArray(values, dims="draw")
        for name, values in drawn(uncertain, samples=256).items()
    }
    swept = slipsweep.sweep(25.0, frequency=1.0, **draws)
    flags = slipsweep.flags(swept)
    unstable = int(flags.statically_unstable.sum())
    valued = int(swept.permanent_displacement.notnull().sum())
    assert min(unstable, valued, 256 - unstable - valued) > 20
    for threshold in (0.05, 0.5):
        above = int((swept.permanent_displacement > threshold).sum())
        probability = found.exceedance_probability.sel(threshold=threshold)
        assert probability == pytest.approx((above + unstable) / (valued + unstable), rel=1e-14)


def test_statically_unstable_samples_exceed_every_threshold() -> None:
    """A block that slides under its own weight (μs ≤ tan θ) has no displacement by the model."""
    friction = stats.lognorm(0.2, scale=0.3)
    found = slipsweep.sample(
        theta=[0.0, 15.0, 40.0],
        amplitude=2.0,
        frequency=1,
        uncertain={"mu_s": friction},
        samples=8192,
    )
    unstable = friction.cdf(np.tan(np.radians([0.0, 15.0, 40.0])))
    np.testing.assert_allclose(found.valueless_share, unstable, atol=1e-3)
    assert 0.2 < unstable[1] < 0.8
    np.testing.assert_array_equal(found.flag_share.sel(flag=1), found.valueless_share)
    np.testing.assert_allclose(found.mode_share.sum("mode") + found.valueless_share, 1, atol=1e-12)
    there = found.isel(theta=1)
    values = slipsweep.sweep(
        theta=15, mu_s=drawn({"mu_s": friction}, samples=8192)["mu_s"], amplitude=2.0, frequency=1
    )
    stable = values.permanent_displacement.dropna("mu_s").values
    exceeding = np.count_nonzero(values.permanent_displacement.fillna(np.inf) > 0.1)
    assert (
        there.exceedance_probability.sel(threshold=0.1) == exceeding / 8192 > np.mean(stable > 0.1)
    )
    np.testing.assert_allclose(
        there.displacement_quantile, np.quantile(stable, [0.05, 0.5, 0.95]), rtol=1e-12
    )
    nobody = slipsweep.sample(
        theta=40, mu_s=0.3, amplitude=2.0, frequency=1, uncertain={"amplitude": FACTOR}
    )
    assert nobody.valueless_share == 1
    assert (nobody.exceedance_probability == 1).all()
    assert nobody.displacement_quantile.isnull().all()


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random"])
def test_a_seed_gives_the_same_bits(method: str) -> None:
    def run(seed: int) -> xr.Dataset:
        return slipsweep.sample(
            **GRID, uncertain={"amplitude": FACTOR}, samples=64, method=method, seed=seed
        )

    xr.testing.assert_identical(run(5), run(5))
    assert not run(5).mean_displacement.equals(run(6).mean_displacement)
    assert run(5).attrs["seed"] == 5
    assert run(5).attrs["sampling"].startswith(method)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"mu_s": stats.norm(0.1, 0.1)},
            r"^uncertain.mu_s = norm\(loc=0.1, scale=0.1\): 15.8\d% of the draws",
        ),
        (
            {"amplitude": {"distribution": "norm", "scale": 1.0, "kind": "offset"}},
            "as offset on amplitude = 2: 2.2",
        ),
        (
            {"amplitude": {**FACTOR, "distribution": "lognormal"}},
            'lognormal": must be a continuous one of scipy.stats',
        ),
        (
            {"amplitude": {**FACTOR, "unit": "g"}},
            "uncertain.amplitude: has s, unit: lognorm takes s, loc, scale",
        ),
        ({"amplitude": {**FACTOR, "units": "g"}}, "units = 'g': not allowed with kind = 'factor'"),
        (
            {"amplitude": {**LOGNORMAL, "kind": "relative"}},
            "kind = 'relative': must be one of 'absolute', 'factor'",
        ),
        (
            {"amplitude": {"distribution": "lognorm"}},
            "uncertain.amplitude: has no parameters: lognorm takes s, loc",
        ),
        (
            {"amplitude": 3.0},
            "uncertain.amplitude.distribution = 3.0: must be the name of a distribution",
        ),
        ({"mu": LOGNORMAL}, 'uncertain.mu: cannot be drawn; did you mean "mu_s"?'),
        ({"decay_rate": {**LOGNORMAL, "kind": "offset"}}, 'kind = "offset" needs decay_rate given'),
        ({}, "uncertain: must give the distribution of one parameter at least"),
    ],
)
def test_impossible_distributions_are_refused(change: dict[str, Any], message: str) -> None:
    given = {
        name: value for name, value in GRID.items() if name not in change or "amplitude" in change
    }
    with pytest.raises(InputError, match=message):
        slipsweep.sample(**given, uncertain=change)


def test_draws_are_checked_at_both_ends_of_an_axis() -> None:
    offset = {"theta": {"distribution": "uniform", "scale": 20, "kind": "offset"}}
    with pytest.raises(InputError, match="as offset on theta = 80"):
        slipsweep.sample([0.0, 80.0], 0.4, 2.0, 1.0, uncertain=offset)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"samples": 1000},
            'samples = 1000: must be a power of 2 with method = "sobol", such as 512 or 1024',
        ),
        ({"quantiles": [0.5, 1.0]}, "quantiles = 1: must be a number between 0 and 1"),
        ({"thresholds": -0.1}, "thresholds = -0.1: must be a finite number >= 0"),
        ({"correlation": [("theta", "amplitude", 1.5)]}, "a number between -1 and 1"),
        ({"frequency": None}, "frequency: must be given"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], message: str) -> None:
    uncertain = {
        "theta": {"distribution": "uniform", "scale": 2, "kind": "offset"},
        "amplitude": FACTOR,
    }
    with pytest.raises((InputError, TypeError), match=message):
        slipsweep.sample(**{**GRID, "uncertain": uncertain, **options})


FILE = """
[axes]
theta.values = [0, 5]
amplitude = { start = 0.1, stop = 1, num = 10, units = "g" }
frequency.values = [1, 2]
[excitation]
cycles = 5
[uncertainty]
samples = 256
seed = 7
thresholds = ["1cm", 0.1]
correlation = [["mu_s", "yield_acceleration", 0.5]]
mu_s = { distribution = "lognorm", s = 0.1, scale = 0.4 }
amplitude = { kind = "factor", distribution = "lognorm", s = 0.3 }
yield_acceleration = { kind = "factor", distribution = "lognorm", s = 0.15 }
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
        (
            "s = 0.15",
            "q = 0.15",
            "uncertainty.yield_acceleration: has q: lognorm takes s, loc, scale",
        ),
        (
            "theta.values = [0, 5]",
            "mu_s.values = [0.3, 0.4]",
            "uncertainty.mu_s: is drawn, but mu_s is given as well",
        ),
        (
            "[excitation]",
            '[output]\nvariables = ["validity"]\n[excitation]',
            "output.variables: not allowed beside",
        ),
    ],
)
def test_impossible_sweep_files_are_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    (tmp_path / "x.toml").write_text(FILE.replace(old, new, 1))
    done = command(tmp_path, "run", "x.toml")
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.startswith("slipsweep: error: x.toml: ")
    assert done.stderr.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.toml"]
