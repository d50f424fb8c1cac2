"""Required strengths: solved forward, closed forms, scaling laws, suites, samples, both ways."""

import math
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep import InputError, Newmark, Record, Sine, Suite, required_strength, sweep
from slipsweep.model.variables import StrengthStatus
from slipsweep.studies.required_strength import plan_strength
from slipsweep.studies.sampling import Sampling
from tests.support.made_up_records import few_pulses

G = 9.81
BOTH = Newmark(sliding="both")

#: The displacement at the required strength, relative to the tolerable one: rounding of ky.
EXACT = 1e-9


def noise(seed: int, count: int = 300, interval: float = 0.02) -> Record:
    samples = np.random.default_rng(seed).normal(size=count) * np.hanning(count)
    return Record.sampled(3.0 * samples, interval, f"noise{seed}.csv")


MOTIONS = (noise(1), noise(2, 200), noise(3, 400, 0.01))
SUITE = Suite(MOTIONS, name="three")


def largest(result: xr.Dataset) -> xr.DataArray:
    """The largest |u| over time."""
    downslope: xr.DataArray = result.largest_displacement
    upslope = -result.smallest_displacement
    return downslope.where(downslope > upslope, upslope)


def displacement_with(strengths: xr.Dataset, of: str, **given: Any) -> xr.DataArray:
    """Solve required strengths forward; those that every strength stands for as 10 g."""
    solved = strengths.required_status == StrengthStatus.SOLVED
    values = strengths[f"required_{of}"].where(solved, 80.0 if of == "phi" else 10.0)
    options: dict[str, Any] = {"model": "newmark", **given}
    options[of] = values.drop_vars("quantile", errors="ignore")
    result = sweep(**options)
    both_ways = isinstance(options["model"], Newmark) and options["model"].sliding == "both"
    return (largest(result) if both_ways else result.permanent_displacement).where(solved)


# ------------------------------------------------------------------ solved forward


@pytest.mark.parametrize("of", ["yield_coefficient", "mu_s", "phi"])
@pytest.mark.parametrize("excitation", [Sine(cycles=6), few_pulses()], ids=["sine", "record"])
def test_forward_gives_the_displacement(of: str, excitation: Any) -> None:
    base: dict[str, Any] = {"amplitude": [1.0, 4.0, 9.0], "excitation": excitation}
    if isinstance(excitation, Sine):
        base["frequency"] = [0.5, 3.0]
    else:
        base["time_scale"] = [1.0, 3.0]
    block: dict[str, Any] = {} if of == "yield_coefficient" else {"theta": [0.0, 12.0]}
    targets = np.geomspace(1e-6, 10.0, 15)
    strengths = required_strength(targets, of=of, **base, **block)
    solved = strengths.required_status == StrengthStatus.SOLVED
    assert float(solved.mean()) > 0.6
    moved = displacement_with(strengths, of, **base, **block)
    error = abs(moved / strengths.displacement - 1.0)
    assert float(error.max()) < EXACT
    assert int(moved.count()) == int(solved.sum())


def test_forward_both_ways_gives_the_largest_displacement() -> None:
    base: dict[str, Any] = {"amplitude": [2.0, 5.0], "excitation": noise(4), "model": BOTH}
    blocks: tuple[dict[str, Any], ...] = (
        {"theta": [0.0, 4.0, 15.0]},
        {"upslope_yield_acceleration": [1.0, 3.0]},
    )
    for block in blocks:
        strengths = required_strength([1e-4, 0.003, 0.05], **base, **block)
        moved = displacement_with(strengths, "yield_coefficient", **base, **block)
        assert int(moved.count()) > 0.5 * moved.size
        assert float(abs(moved / strengths.displacement - 1.0).max()) < EXACT
    assert strengths.attrs["criterion"].startswith("largest displacement over time")


def test_other_strengths_of_the_shaking() -> None:
    shakings: tuple[dict[str, Any], ...] = (
        {"displacement_amplitude": [0.02, 0.1], "frequency": [1.0, 3.0]},
        {"pgv": [0.1, 0.4], "excitation": MOTIONS[0], "time_scale": [1.0, 2.0]},
        {"arias_intensity": 0.5, "excitation": MOTIONS[0], "polarity": "both"},
        {"scale": 0.7, "excitation": SUITE},
    )
    for given in shakings:
        strengths = required_strength(["2mm", "1cm"], **given)
        moved = displacement_with(strengths, "yield_coefficient", **given)
        assert int(moved.count()) > 0.5 * moved.size
        assert float(abs(moved / strengths.displacement - 1.0).max()) < EXACT


# ------------------------------------------------------------------ closed forms


@pytest.mark.parametrize(
    ("share", "displacement"),
    [
        (0.1, 1.012489583333),
        (0.3, 0.203885416667),
        (0.5, 0.061197916667),
        (0.7, 0.013113961031),
        (0.9, 0.000485702260),
    ],
)
def test_triangular_pulse_inverts_to_its_share(share: float, displacement: float) -> None:
    """A recorded isosceles triangle, then rest; in units of A T₀²."""
    pulse = Record(np.array([0.0, 0.25, 0.5]), np.array([0.0, 3.0, 0.0]))
    target = displacement * 3.0 * 0.5**2
    for model in (Newmark(), BOTH):
        strengths = required_strength(target, theta=_theta(model), excitation=pulse, model=model)
        ratio = strengths.required_yield_coefficient.item() * G / 3.0
        assert ratio == pytest.approx(share, abs=2e-9)


@pytest.mark.parametrize(("share", "displacement"), [(0.8, 0.019027563313), (0.9, 0.004654206411)])
def test_half_sine_pulse_inverts_to_its_share(share: float, displacement: float) -> None:
    """The first half of a sine of period 2 T₀, where the block is at rest before the pulse ends."""
    amplitude = 2.5
    duration = 0.4
    strengths = required_strength(
        displacement * amplitude * duration**2,
        amplitude,
        0.5 / duration,
        excitation=Sine(cycles=1),
    )
    ratio = strengths.required_yield_coefficient.item() * G / amplitude
    assert ratio == pytest.approx(share, abs=1e-9)


def test_strength_towards_zero_under_a_sine_from_rest() -> None:
    """The base never moves back: u stays below 2πN A/ω² however weak the block is."""
    limit = 2.0 * math.pi * 4 * 3.0 / (2.0 * math.pi * 2.0) ** 2
    strengths = required_strength(
        [0.999999 * limit, 1.000001 * limit], 3.0, 2.0, excitation=Sine(cycles=4)
    )
    np.testing.assert_array_equal(
        strengths.required_status, [StrengthStatus.SOLVED, StrengthStatus.ALWAYS_WITHIN]
    )
    weakest, none = strengths.required_yield_coefficient.values
    assert 0.0 < weakest < 1e-5
    assert none == 0.0


def test_frequency_and_amplitude_only_scale() -> None:
    """u = A/f² · U(ky/A): half the displacement at twice A and f is twice the strength."""
    for model in (Newmark(), BOTH):
        theta = _theta(model)
        for excitation in ("sine", "triangle"):
            given: dict[str, Any] = {"theta": theta, "model": model, "excitation": excitation}
            one = required_strength([0.003, 0.04], 2.0, 1.5, **given)
            other = required_strength([0.0015, 0.02], 4.0, 3.0, **given)
            np.testing.assert_allclose(
                other.required_yield_coefficient, 2.0 * one.required_yield_coefficient, rtol=1e-11
            )


def test_strength_falls_with_the_displacement_and_grows_with_the_amplitude() -> None:
    strengths = required_strength(np.geomspace(1e-4, 1.0, 30), [1.0, 2.0, 4.0], excitation=SUITE)
    required = strengths.required_yield_coefficient
    assert bool((required.diff("displacement") < 0.0).all())
    assert bool((required.diff("amplitude") > 0.0).all())


def test_level_base_has_no_polarity() -> None:
    """Turned shaking moves a block that slides both ways as far to the other side."""
    pulses = Record.sampled([0.0, -3.0, -1.0, 0.5, 1.0, 0.0], 0.1)
    strengths = required_strength(
        [1e-4, 0.02], theta=0.0, excitation=pulses, polarity="both", model=BOTH
    )
    assert (strengths.required_status == StrengthStatus.SOLVED).all()
    required = strengths.required_yield_coefficient
    np.testing.assert_allclose(required.sel(polarity=1), required.sel(polarity=-1), rtol=1e-11)
    assert float(required.max()) > 2.0 / G


def test_friction_of_a_yield_coefficient() -> None:
    """Coulomb: ky = tan(φ − θ)."""
    given: dict[str, Any] = {"amplitude": 4.0, "frequency": 1.0, "theta": [0.0, 8.0, 30.0]}
    coefficient = required_strength(0.05, 4.0, 1.0).required_yield_coefficient.item()
    angle = np.asarray(given["theta"]) + math.degrees(math.atan(coefficient))
    found = required_strength(0.05, of="phi", **given)
    np.testing.assert_allclose(found.required_phi, angle, rtol=1e-13)
    assert found.required_phi.attrs["units"] == "degree"
    found = required_strength(0.05, of="mu_s", **given)
    np.testing.assert_allclose(found.required_mu_s, np.tan(np.radians(angle)), rtol=1e-12)


def _theta(model: Newmark) -> float | None:
    """A level base, which only a block that slides both ways has to be told."""
    return 0.0 if model.sliding == "both" else None


# ------------------------------------------------------------------ every strength, or none


def test_base_that_moves_no_block_needs_no_strength() -> None:
    upslope = Record.sampled([0.0, -2.0, -1.0, 0.0], 0.1)
    shakings: tuple[dict[str, Any], ...] = (
        {"excitation": upslope},
        {"amplitude": 0.0, "frequency": 1.0},
        {"amplitude": 0.0, "frequency": 1.0, "model": BOTH},
    )
    for given in shakings:
        strengths = required_strength(0.01, of="mu_s", theta=10.0, **given)
        assert strengths.required_status == StrengthStatus.ALWAYS_WITHIN
        assert strengths.required_mu_s.item() == pytest.approx(math.tan(math.radians(10.0)))


def test_no_friction_angle_holds_a_block_on_a_wall() -> None:
    """θ + arctan ky ≥ 90° has no friction coefficient."""
    strengths = required_strength(0.01, 8.0, 1.0, of="mu_s", theta=[40.0, 70.0])
    np.testing.assert_array_equal(
        strengths.required_status, [StrengthStatus.SOLVED, StrengthStatus.NEVER_WITHIN]
    )
    assert np.isnan(strengths.required_mu_s.values[1])
    assert strengths.required_mu_s.values[0] > 0.0


def test_no_downslope_strength_holds_a_block_that_slides_upslope() -> None:
    """Upslope it slides by more than the tolerable displacement, however strong it is downslope."""
    motion: dict[str, Any] = {"amplitude": 4.0, "frequency": 1.0, "model": BOTH}
    upslope = sweep(yield_coefficient=9.0, upslope_yield_acceleration=1.0, **motion)
    moved = float(largest(upslope))
    assert moved > 0.0
    strengths = required_strength(
        [0.999 * moved, 1.001 * moved], upslope_yield_acceleration=1.0, **motion
    )
    assert strengths.required_status.values[0] == StrengthStatus.NEVER_WITHIN
    assert strengths.required_status.values[1] == StrengthStatus.SOLVED


# ------------------------------------------------------------------ both ways: no monotone u


def tones(seed: int) -> Record:
    """A few tones under a window: blocks come back to where they were."""
    random = np.random.default_rng(seed)
    times = np.arange(0.0, 10.0, 0.02)
    waves = [
        random.normal() * np.sin(2.0 * np.pi * frequency * times + random.uniform(0.0, 2.0 * np.pi))
        for frequency in (0.4, 0.7, 1.1, 1.6, 2.3)
    ]
    return Record(times, np.sum(waves, axis=0) * np.hanning(times.size))


def dense(seed: int, theta: float) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """A block that slides both ways: the shaking, yield coefficients and the largest |u|."""
    base: dict[str, Any] = {
        "amplitude": 4.0,
        "theta": theta,
        "excitation": tones(seed),
        "model": BOTH,
    }
    coefficients = np.linspace(0.001, 0.42, 2000)
    return base, coefficients, largest(sweep(yield_coefficient=coefficients, **base)).values


def test_no_greater_strength_exceeds_the_displacement() -> None:
    """|u| of a block that slides both ways may rise with ky; the highest crossing counts."""
    lower_crossings = 0
    targets = np.geomspace(1e-3, 0.2, 60)
    for seed, theta in ((0, 0.0), (2, 0.0), (3, 0.3), (4, 0.0), (5, 0.3)):
        base, coefficients, moved = dense(seed, theta)
        required = required_strength(targets, **base).required_yield_coefficient.values
        exceeds = moved[:, np.newaxis] > targets
        highest = coefficients.size - 1 - exceeds[::-1].argmax(axis=0)
        last = np.where(exceeds.any(axis=0), coefficients[highest], 0.0)
        assert (last <= required * (1.0 + EXACT)).all()
        first = coefficients[(~exceeds).argmax(axis=0)]
        lower_crossings += int((first < required - 0.001).sum())
    assert lower_crossings > 5


def test_peak_between_two_steps_of_the_scan_is_found() -> None:
    """Just below a maximum of |u| the displacement is exceeded between two steps only."""
    peaks = 0
    for seed in (0, 2, 4):
        base, coefficients, moved = dense(seed, 0.0)
        above = np.maximum.accumulate(moved[::-1])[::-1]
        highest = np.flatnonzero((moved[1:-1] > moved[:-2]) & (moved[1:-1] > above[2:])) + 1
        for place in highest:
            peaks += 1
            targets = moved[place] * (1.0 - np.array([1e-2, 1e-3, 1e-4, 1e-5]))
            required = required_strength(targets, **base).required_yield_coefficient
            assert (required > coefficients[place]).all()
    assert peaks > 2


# ------------------------------------------------------------------ suites


def test_suite_has_each_motion_its_quantiles_and_counts() -> None:
    given: dict[str, Any] = {"amplitude": [0.0, 3.0], "polarity": "both"}
    targets = [0.002, 0.3]
    strengths = required_strength(targets, **given, excitation=SUITE, quantiles=[0.1, 0.5, 0.9])
    required = strengths.required_yield_coefficient
    assert required.dims == ("amplitude", "displacement", "polarity", "motion")
    for at, motion in enumerate(MOTIONS):
        alone = required_strength(targets, **given, excitation=motion)
        for name in ("required_yield_coefficient", "required_status"):
            np.testing.assert_array_equal(
                strengths[name].isel(motion=at), alone[name].transpose(*strengths[name].dims[:-1])
            )
        assert "required_yield_coefficient_quantile" not in alone
    each = required.values.reshape(2, 2, 6)
    np.testing.assert_allclose(
        strengths.required_yield_coefficient_quantile,
        np.moveaxis(np.quantile(each, [0.1, 0.5, 0.9], axis=-1), 0, -1),
        rtol=1e-14,
    )
    always = strengths.required_status == StrengthStatus.ALWAYS_WITHIN
    np.testing.assert_array_equal(strengths.always_within_count, always.sum(["polarity", "motion"]))
    np.testing.assert_array_equal(strengths.always_within_count, [[6, 6], [0, 0]])


def test_share_of_the_motions_stays_within_at_a_quantile() -> None:
    motions = Suite(tuple(noise(seed) for seed in range(11)), name="eleven")
    strengths = required_strength(0.01, 3.0, excitation=motions, quantiles=[0.2, 0.5, 0.8])
    quantile = strengths.required_yield_coefficient_quantile
    moved = sweep(amplitude=3.0, yield_coefficient=quantile, excitation=motions, model="newmark")
    within = (moved.permanent_displacement <= 0.01 * (1.0 + EXACT)).mean("motion")
    # of eleven values the quantiles are three of them
    np.testing.assert_allclose(within, [3 / 11, 6 / 11, 9 / 11])


def test_motions_that_no_strength_holds_are_above_all_others() -> None:
    weak = Record.sampled(0.01 * np.sin(np.arange(60.0)), 0.05, "weak.csv")
    motions = Suite((noise(1), noise(2), weak), name="walls")
    strengths = required_strength(
        0.001, scale=4.0, of="phi", theta=75.0, excitation=motions, quantiles=[0.1, 0.9]
    )
    required = strengths.required_phi
    assert int(strengths.never_within_count) == int(required.isnull().sum()) == 2
    low, high = strengths.required_phi_quantile.values
    assert np.isinf(high)
    assert np.isinf(low) or low >= required.min()


def test_parts_of_a_plan_give_the_same_bits() -> None:
    inputs = {"amplitude": [1.0, 2.0, 4.0], "polarity": "both", "time_scale": [1.0, 2.0]}
    plan = plan_strength([0.001, 0.01], inputs, excitation=SUITE)
    whole = plan.solve()
    assert plan.cells == 3 * 2 * 2 * 2 * 3
    for start in range(3):
        part = plan.part({"amplitude": slice(start, start + 1), "displacement": slice(0, 1)})
        expected = whole.isel(amplitude=slice(start, start + 1), displacement=slice(0, 1))
        xr.testing.assert_identical(part.solve(), expected)


# ------------------------------------------------------------------ uncertain inputs


def test_quantiles_under_an_uncertain_amplitude() -> None:
    """The required strength grows with A: its quantile is that of the quantile of A."""
    from scipy import stats

    shaking = stats.lognorm(s=0.4, scale=3.0)
    shares = [0.16, 0.5, 0.84]
    strengths = required_strength(
        0.05, frequency=1.0, uncertain={"amplitude": shaking}, samples=4096, quantiles=shares
    )
    expected = required_strength(0.05, shaking.ppf(shares), 1.0).required_yield_coefficient
    np.testing.assert_allclose(strengths.required_yield_coefficient_quantile, expected, rtol=2e-3)
    assert "required_yield_coefficient" not in strengths
    assert "amplitude" not in strengths.coords


def test_quantile_is_the_probability_of_staying_within() -> None:
    """`sample` with the required strength exceeds the displacement in the other cases."""
    uncertain = {
        "amplitude": {"distribution": "lognorm", "s": 0.3, "kind": "factor"},
        "yield_coefficient": {"distribution": "lognorm", "s": 0.2, "kind": "factor"},
    }
    given: dict[str, Any] = {"amplitude": [2.0, 5.0], "excitation": SUITE, "uncertain": uncertain}
    given |= {"samples": 512, "seed": 4}
    strengths = required_strength(0.01, **given, quantiles=[0.3, 0.84])
    assert strengths.required_yield_coefficient_quantile.dims == ("amplitude", "quantile")
    for place, amplitude in enumerate((2.0, 5.0)):
        found = slipsweep.sample(
            yield_coefficient=strengths.required_yield_coefficient_quantile.values[place],
            model="newmark",
            over=["motion"],
            thresholds=[0.01],
            **{**given, "amplitude": amplitude},
        )
        exceeded = found.exceedance_probability.values.ravel()
        np.testing.assert_allclose(exceeded, [0.7, 0.16], atol=1.0 / (3 * 512))


def test_samples_of_a_sweep_file_with_sobol_indices() -> None:
    """The further draws that indices take are left out, and no attribute speaks of them."""
    sampling = Sampling(
        {"amplitude": FACTOR},
        samples=64,
        method="sobol",
        seed=1,
        quantiles=[0.5],
        thresholds=[0.1],
        correlation=[],
        g=G,
        sensitivity=True,
    )
    inputs = {"amplitude": 3.0, "frequency": 1.0}
    found = plan_strength(0.05, inputs, sampling=sampling).solve()
    draws = sampling.draws["amplitude"][:64]
    expected = required_strength(0.05, 3.0 * draws, 1.0).required_yield_coefficient
    median = found.required_yield_coefficient_quantile.item()
    assert median == pytest.approx(float(expected.median()), rel=1e-12)
    assert "sensitivity" not in found.attrs


# ------------------------------------------------------------------ published equations beside


def test_equations_give_the_displacement_at_the_strength_that_they_require() -> None:
    design = required_strength(["20mm", "50mm"], [3.0, 6.0], excitation=SUITE)
    names = ["jibson-2007", "bray-travasarou-2007", "rathje-saygili-2009", "ambraseys-menu-1988"]
    beside = slipsweep.published_strength(design, names, magnitude=7.0, quantiles=[0.5, 0.84])
    required = beside.required_yield_coefficient_quantile
    assert required.dims == ("equation", "amplitude", "displacement", "quantile")
    for name in names:
        record = slipsweep.published.EQUATIONS[name]
        given = {"magnitude": 7.0} if "magnitude" in record.inputs else {}
        for index in np.ndindex(2, 2, 2):
            cell = required.sel(equation=name)[index]
            estimate = record.function(cell.item(), cell.amplitude.item() / G, **given)
            moved = estimate.quantile(cell["quantile"].item())
            assert moved == pytest.approx(cell.displacement.item(), rel=1e-9)
            inside = beside.in_range.sel(equation=name)[index]
            assert bool(inside) == bool(estimate.in_range)


def test_the_largest_of_several_strengths_of_an_equation_counts() -> None:
    """Bray and Travasarou's median falls towards ky = 0: it has a maximum at ky about 0.01."""
    record = slipsweep.published.EQUATIONS["bray-travasarou-2007"]
    coefficients = np.geomspace(1e-3, 0.1, 2000)
    median = record.function(coefficients, 0.4, 7.0).quantile(0.5)
    peak = int(median.argmax())
    assert 0 < peak < 1999
    target = 0.5 * (median[0] + median[peak])
    design = required_strength(target, 0.4 * G, excitation=SUITE)
    found = slipsweep.published_strength(design, record.name, magnitude=7, quantiles=0.5)
    required = found.required_yield_coefficient_quantile.item()
    assert required > coefficients[peak]
    assert record.function(required, 0.4, 7.0).quantile(0.5) == pytest.approx(target, rel=1e-9)


# ------------------------------------------------------------------ what is refused

GOOD: dict[str, Any] = {"displacement": 0.05, "amplitude": 3.0, "frequency": 1.0}
FACTOR = {"distribution": "lognorm", "s": 0.2, "kind": "factor"}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"displacement": 0.0}, "displacement = 0: must be a finite number > 0"),
        ({"displacement": "5 kg"}, 'displacement = "5 kg": must be a number'),
        ({"of": "cohesion"}, "of = 'cohesion': must be one of 'yield_coefficient', 'mu_s', 'phi'"),
        ({"of": "mu_s"}, "theta: must be given"),
        ({"theta": 5.0}, "theta: not allowed beside yield_coefficient"),
        ({"model": BOTH}, "theta, upslope_yield_acceleration: one of them must be given"),
        ({"model": "mendez", "theta": 5.0}, "model = 'mendez': must be 'newmark' for a required"),
        ({"frequency": None}, "frequency: must be given"),
        ({"quantiles": [0.5, 0.2]}, "quantiles: 0.2 after 0.5"),
        (
            {"uncertain": {"yield_coefficient": {**FACTOR, "kind": "absolute"}}},
            "uncertain.yield_coefficient: is drawn, but yield_coefficient is given as well",
        ),
        (
            {"uncertain": {"mu_s": FACTOR}},
            "uncertain.mu_s: not allowed beside of = 'yield_coefficient'",
        ),
        ({"uncertain": {"theta": FACTOR}}, 'uncertain.theta: kind = "factor" needs theta given'),
    ],
)
def test_what_cannot_be_solved_is_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as refused:
        required_strength(**{**GOOD, **changed})
    assert str(refused.value).startswith(message)
    assert "\n" not in str(refused.value)


def test_equations_are_for_yield_coefficients() -> None:
    friction = required_strength(0.05, 3.0, 1.0, of="mu_s", theta=5.0)
    with pytest.raises(InputError, match="only beside required strengths of = 'yield_coefficient'"):
        slipsweep.published_strength(friction, "jibson-2007")
    design = required_strength(0.05, 3.0, 1.0)
    with pytest.raises(InputError, match="rathje-saygili-2009: needs moment magnitude"):
        slipsweep.published_strength(design, "rathje-saygili-2009")
