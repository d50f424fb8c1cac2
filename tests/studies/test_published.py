"""Published equations: printed values, closed forms, ranges; at points of a result; rates."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import integrate, stats

import slipsweep
from slipsweep import HazardCurve, InputError, published
from slipsweep.published import EQUATIONS, Estimate
from slipsweep.studies.published_statistics import published_table

G = 9.81

SUITE = Path(__file__).parents[2] / "sweeps" / "data" / "suite"

#: Magnitudes of the earthquakes of pySLAMMER's motions.
MAGNITUDES = {
    "Cape_Mendocino": 7.0,
    "Chi-Chi": 7.6,
    "Coalinga": 6.4,
    "Coyote_Lake": 5.7,
    "Duzce": 7.1,
    "Imperial_Valley": 6.5,
    "Kobe": 6.9,
    "Kocaeli": 7.4,
    "Landers": 7.3,
    "Loma_Prieta": 6.9,
    "Mammoth_Lakes": 5.9,
    "Morgan_Hill": 6.2,
    "N_Palm_Springs": 6.1,
    "Nahanni": 6.8,
    "Nisqually": 6.8,
    "Northridge": 6.7,
}


def arguments(name: str, **changed: Any) -> dict[str, Any]:
    """Inputs of an equation, all within any range."""
    usual = {
        "yield_coefficient": 0.1,
        "pga": 0.4,
        "magnitude": 7.0,
        "pgv": 0.4,
        "period": 0.5,
        "cycles": 10.0,
        "pulse_duration": 0.2,
    }
    return {one: (usual | changed)[one] for one in EQUATIONS[name].inputs}


# ------------------------------------------------------------------------ printed values


@pytest.mark.parametrize(
    ("estimate", "centimetres", "half_digit"),
    [
        (published.ambraseys_menu_1988(0.1, 0.4), 17.3840, 5e-5),
        (published.jibson_2007(0.1, 0.4), 6.14159, 5e-6),
        (published.jibson_2007_magnitude(0.1, 0.4, 7.0), 7.17981, 5e-6),
        (published.saygili_rathje_2008_pgv(0.1, 0.4, 0.40), 17.7568, 5e-5),
        (published.rathje_saygili_2009(0.1, 0.54, 6.75), 43.7, 0.05),
        (published.saygili_rathje_2008_pgv(0.1, 0.54, 0.42), 27.5, 0.05),
        (published.rathje_saygili_2009(0.1, 0.88, 6.75), 112.0, 0.05),
        (published.saygili_rathje_2008_pgv(0.1, 0.88, 0.71), 81.4, 0.05),
    ],
)
def test_medians_are_those_of_other_programs(
    estimate: Estimate, centimetres: float, half_digit: float
) -> None:
    assert 100.0 * estimate.median == pytest.approx(centimetres, abs=half_digit)


def test_a_textbook_example_of_jibson_with_the_magnitude() -> None:
    """Kramer and Stewart, example 10.4: ky 0.067, 0.1 g, M 6.7: 0.18 cm, with one
    deviation 0.52.
    """
    estimate = published.jibson_2007_magnitude(0.067, 0.1, 6.7)
    above = estimate.median * np.exp(estimate.log_standard_deviation)
    assert (round(100 * estimate.median, 2), round(100 * above, 2)) == (0.18, 0.52)


def test_a_textbook_example_of_rathje_and_saygili() -> None:
    """The same slope: 0.28 cm, which is r = 0.67 exactly."""
    estimate = published.rathje_saygili_2009(0.067, 0.1, 6.7)
    assert math.log(100.0 * estimate.median) == pytest.approx(-1.287, abs=0.0005)


def test_saygili_and_rathje_without_the_magnitude_is_that_of_the_mean_one() -> None:
    """Both fits are of the same records, so that one magnitude makes them equal at all ratios.

    With −20.93 r², as one program has it, the magnitude would fall from 6.7 to 6.2.
    """
    ky = 0.5 * np.linspace(0.02, 0.98, 49)
    ratio = published.saygili_rathje_2008(ky, 0.5).median
    ratio = ratio / published.rathje_saygili_2009(ky, 0.5, 6.0).median
    magnitude = 6.0 + np.log(ratio) / 0.89
    assert np.ptp(magnitude) < 0.15
    assert magnitude.mean() == pytest.approx(6.77, abs=0.05)


def test_a_rigid_dam_of_bray_and_travasarou() -> None:
    """Their table: ky 0.08, 0.24 g, M 7: 4 to 15 cm, one deviation on either side; P(zero) 0.1."""
    estimate = published.bray_travasarou_2007(0.08, 0.24, 7.0)
    ends = estimate.median * np.exp([-estimate.log_standard_deviation, 0.66])
    np.testing.assert_allclose(100.0 * ends, [4.0, 15.0], rtol=0.05)
    assert round(estimate.zero_probability, 1) == 0.1


def test_the_example_of_a_flexible_mass_differs_by_its_own_terms() -> None:
    """Bray 2007: ky 0.14, Ts 0.4 s, Sa 0.48 g, M 7.2: ln u 2.29, P(zero) 0.01."""
    estimate = published.bray_travasarou_2007(0.14, 0.48, 7.2)
    flexible = math.log(100.0 * estimate.median) + 0.22 - 1.10 + 1.5 * 0.4
    assert flexible == pytest.approx(2.29, abs=0.005)
    distance = stats.norm.isf(estimate.zero_probability) - 0.484 * 0.4 * math.log(0.14)
    assert stats.norm.sf(distance) == pytest.approx(0.01, abs=0.005)


@pytest.mark.parametrize(
    ("name", "ratio", "deviation"),
    [
        ("ambraseys-menu-1988", 0.25, 0.30 * math.log(10)),
        ("jibson-2007", 0.25, 0.510 * math.log(10)),
        ("jibson-2007-magnitude", 0.25, 0.454 * math.log(10)),
        ("saygili-rathje-2008", 0.25, 1.13),
        # the curves in Fig. 6 of Saygili and Rathje (2008) and Eq. 9 of Rathje and Saygili (2009)
        ("saygili-rathje-2008-pgv", 0.5, 0.667),
        ("rathje-saygili-2009", 0.5, 0.99175),
        ("bray-travasarou-2007", 0.25, 0.66),
        ("yegian-1991", 0.25, 0.45 * math.log(10)),
    ],
)
def test_standard_deviations_are_of_natural_logarithms(
    name: str, ratio: float, deviation: float
) -> None:
    given = arguments(name, yield_coefficient=0.4 * ratio)
    estimate = EQUATIONS[name].function(**given)
    assert estimate.log_standard_deviation == pytest.approx(deviation, rel=1e-12)


def test_the_constant_of_yegian_is_that_of_recorded_motions() -> None:
    """One copy of a textbook has −0.22 instead of 0.22; motions of pySLAMMER tell the two apart.

    T is the period of the largest spectral acceleration, N that of Seed and others (1975) for the
    magnitude, and the displacement the larger of both polarities.
    """
    eqsig = pytest.importorskip("eqsig")
    pyslammer = pytest.importorskip("pyslammer")
    periods = np.geomspace(0.1, 3.0, 24)
    ratios = np.array([0.1, 0.2, 0.4, 0.6])
    differences = []
    for name in pyslammer.sample_ground_motions():
        motion = pyslammer.load_sample_ground_motion(name)
        acceleration = np.asarray(motion.accel) * G
        every = max(1, round(0.02 / motion.dt))  # enough for a spectrum from 0.1 s on
        signal = eqsig.AccSignal(acceleration[::every], every * motion.dt)
        signal.generate_response_spectrum(response_times=periods)
        period = periods[np.argmax(signal.s_a)]
        magnitude = next(one for start, one in MAGNITUDES.items() if name.startswith(start))
        cycles = np.interp(magnitude, [5.25, 6.0, 6.75, 7.5, 8.5], [2.5, 5.5, 10.0, 15.0, 26.0])
        pga = np.abs(acceleration).max() / G
        result = slipsweep.sweep(
            yield_coefficient=ratios * pga,
            scale=1.0,
            polarity="both",
            excitation=slipsweep.Record.sampled(acceleration, interval=motion.dt),
            model="newmark",
            variables=["permanent_displacement"],
        )
        moved = result.permanent_displacement.max("polarity").values
        estimate = published.yegian_1991(ratios * pga, pga, period, cycles)
        differences.append(np.log10(moved / estimate.median))
    constant = 0.22 + np.median(differences)
    # two standard errors of 18 motions; −0.22 is more than four away
    assert constant == pytest.approx(0.22, abs=0.2)
    assert np.std(differences) == pytest.approx(0.45, abs=0.1)


# --------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9])
def test_a_rectangular_pulse_moves_the_block_as_newmark_and_sarma_have_it(ratio: float) -> None:
    """A record with edges of a microsecond, and the exact solution of Newmark's block under it."""
    duration = 0.3
    edge = 1e-6
    times = [0.0, edge, duration, duration + edge, 10.0]
    acceleration = np.array([0.0, 1.0, 1.0, 0.0, 0.0]) * 0.4 * G
    result = slipsweep.sweep(
        yield_coefficient=0.4 * ratio,
        scale=1.0,
        excitation=slipsweep.Record(np.array(times), acceleration),
        model="newmark",
    )
    moved = result.permanent_displacement.item()
    sarma = published.sarma_1975(0.4 * ratio, 0.4, duration)
    newmark = published.newmark_1965(0.4 * ratio, 0.4, pgv=0.4 * G * duration)
    assert sarma.median == pytest.approx(moved, rel=1e-4)
    assert newmark.median == pytest.approx(sarma.median, rel=1e-12)


def test_a_quantile_is_exceeded_by_the_rest() -> None:
    estimate = published.bray_travasarou_2007([0.05, 0.1, 0.2], 0.4, 7.0)
    for share in (0.1, 0.5, 0.9):
        exceeded = estimate.exceedance_probability(estimate.quantile(share))
        expected = np.minimum(1.0 - share, 1.0 - estimate.zero_probability)
        np.testing.assert_allclose(exceeded, expected, rtol=1e-12)


def test_quantiles_are_those_of_a_lognormal_distribution() -> None:
    estimate = published.jibson_2007(0.1, 0.4)
    distribution = stats.lognorm(estimate.log_standard_deviation, scale=estimate.median)
    for share in (0.16, 0.5, 0.84):
        assert estimate.quantile(share) == pytest.approx(distribution.ppf(share), rel=1e-12)
    assert estimate.exceedance_probability(0.05) == pytest.approx(distribution.sf(0.05), rel=1e-12)
    pulse = published.sarma_1975(0.1, 0.4, 0.1)
    assert pulse.quantile(0.16) == pulse.quantile(0.84) == pulse.median
    assert pulse.exceedance_probability(pulse.median * np.array([0.99, 1.01])).tolist() == [1, 0]


# --------------------------------------------------------------------- ranges and refusals


@pytest.mark.parametrize("name", EQUATIONS)
def test_a_block_stronger_than_the_shaking_does_not_slide(name: str) -> None:
    estimate = EQUATIONS[name].function(**arguments(name, yield_coefficient=[0.4, 0.5]))
    assert estimate.median.tolist() == [0.0, 0.0]
    assert estimate.quantile(0.84).tolist() == [0.0, 0.0]
    assert estimate.exceedance_probability(1e-9).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("name", EQUATIONS)
def test_a_missing_strength_gives_no_value(name: str) -> None:
    estimate = EQUATIONS[name].function(**arguments(name, yield_coefficient=[np.nan, 0.1]))
    for values in (
        estimate.median,
        estimate.quantile(0.5),
        estimate.exceedance_probability(0.01),
    ):
        assert np.isnan(values).tolist() == [True, False]
    assert not estimate.in_range[0]


@pytest.mark.parametrize("name", [name for name, one in EQUATIONS.items() if one.bounds])
def test_values_beyond_the_range_are_marked_and_not_hidden(name: str) -> None:
    for bounded, (low, high) in EQUATIONS[name].bounds.items():
        changed = "yield_coefficient" if bounded == "ratio" else bounded
        unit = 0.4 if bounded == "ratio" else 1.0
        beyond = unit * np.array([0.99 * low, low, high, 1.01 * high])
        pga = {} if bounded == "ratio" else {"pga": 0.9}
        estimate = EQUATIONS[name].function(**arguments(name, **{changed: beyond}, **pga))
        assert estimate.in_range.tolist() == [False, True, True, False]
        assert (estimate.median > 0.0).all()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"yield_coefficient": 0.0}, "yield_coefficient = 0: must be yield coefficient ky, > 0"),
        ({"pga": -0.4}, "pga = -0.4: must be peak ground acceleration, g, > 0"),
        ({"magnitude": 70.0}, "magnitude = 70: must be moment magnitude M, > 0 and at most 10"),
        ({"pga": "much"}, "pga = 'much': must be a number"),
    ],
)
def test_inputs_that_no_physics_allows(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        published.rathje_saygili_2009(**arguments("rathje-saygili-2009", **wrong))
    assert message in str(error.value)


def test_every_record_has_its_source_and_its_name() -> None:
    for name, record in EQUATIONS.items():
        assert record.function.__name__ == name.replace("-", "_")
        year = next(part for part in name.split("-") if part.isdigit())
        assert f"({year})" in record.source
        assert year in record.label
        assert "https://doi.org/10." in record.source


# --------------------------------------------------------------- at the points of a result


@pytest.fixture(scope="module")
def suite() -> slipsweep.Suite:
    return slipsweep.read_suite(str(SUITE / "*_H1.AT2"))


@pytest.fixture(scope="module")
def result(suite: slipsweep.Suite) -> xr.Dataset:
    return slipsweep.sweep(
        yield_coefficient=[0.04, 0.1, 0.2],
        amplitude=[2.0, 4.0],
        excitation=suite,
        polarity="both",
        model="newmark",
    )


def test_equations_at_the_points_of_a_suite(result: xr.Dataset) -> None:
    names = ["jibson-2007", "bray-travasarou-2007", "saygili-rathje-2008-pgv"]
    found = slipsweep.published_statistics(
        result, names, magnitude=7.0, thresholds="50mm", quantiles=[0.5, 0.84]
    )
    assert found.displacement_quantile.dims == (
        "equation",
        "amplitude",
        "yield_coefficient",
        "quantile",
    )
    at = {"amplitude": 4.0, "yield_coefficient": 0.04}
    point = found.sel(at)
    pgv = float((result.motion_pgv / result.motion_pga).median()) * 4.0
    expected = {
        "jibson-2007": published.jibson_2007(0.04, 4.0 / G),
        "bray-travasarou-2007": published.bray_travasarou_2007(0.04, 4.0 / G, 7.0),
        "saygili-rathje-2008-pgv": published.saygili_rathje_2008_pgv(0.04, 4.0 / G, pgv),
    }
    for name, estimate in expected.items():
        one = point.sel(equation=name)
        assert one.nonzero_median.item() == pytest.approx(estimate.median, rel=1e-12)
        assert one.displacement_quantile.sel(quantile=0.84).item() == pytest.approx(
            estimate.quantile(0.84), rel=1e-12
        )
        assert one.exceedance_probability.item() == pytest.approx(
            estimate.exceedance_probability(0.05), rel=1e-12
        )
        assert bool(one.in_range) == bool(estimate.in_range)
    assert [*point.in_range.values] == [0, 1, 0]


def test_the_yield_coefficient_is_that_of_the_block() -> None:
    """Coulomb's tan(φ − θ), or the measured one over g; none where θ ≥ φ."""
    angles: dict[str, Any] = {"theta": [5.0, 25.0], "mu_s": 0.3, "amplitude": 4.0, "frequency": 1.0}
    found = slipsweep.published_statistics(slipsweep.sweep(**angles), "jibson-2007")
    expected = published.jibson_2007(math.tan(math.atan(0.3) - math.radians(5.0)), 4.0 / G)
    medians = found.nonzero_median.squeeze()
    assert medians[0].item() == pytest.approx(expected.median, rel=1e-12)
    assert np.isnan(medians[1].item())
    measured = slipsweep.sweep(**angles | {"theta": 5.0, "yield_acceleration": 0.981})
    found = slipsweep.published_statistics(measured, "jibson-2007")
    expected = published.jibson_2007(0.1, 4.0 / G)
    assert found.nonzero_median.item() == pytest.approx(expected.median, rel=1e-12)


@pytest.mark.parametrize(
    "waveform",
    [slipsweep.Sine(3), slipsweep.Cosine(3), slipsweep.Triangle(3), slipsweep.Square(3)],
)
def test_equations_of_equal_cycles_take_those_of_a_waveform(waveform: Any) -> None:
    block: dict[str, Any] = {"amplitude": 4.0, "frequency": 2.0, "excitation": waveform}
    result = slipsweep.sweep(yield_coefficient=0.1, model="newmark", **block)
    names = ["yegian-1991", "newmark-1965", "sarma-1975"]
    found = slipsweep.published_statistics(result, names).nonzero_median
    history = slipsweep.simulate(5.0, 0.3, **block, points_per_cycle=2000)
    velocity = integrate.cumulative_trapezoid(history.ground_acceleration, history.time)
    pgv = float(np.abs(velocity).max())
    expected = [
        published.yegian_1991(0.1, 4.0 / G, period=0.5, cycles=3).median,
        published.newmark_1965(0.1, 4.0 / G, pgv=pgv, cycles=3).median,
        published.sarma_1975(0.1, 4.0 / G, pulse_duration=0.25, cycles=3).median,
    ]
    np.testing.assert_allclose(found.values, expected, rtol=5e-3)


def test_motions_scaled_otherwise_have_the_median_acceleration(suite: slipsweep.Suite) -> None:
    scaled = slipsweep.sweep(
        yield_coefficient=0.05, scale=[1.0, 2.0], excitation=suite, model="newmark"
    )
    found = slipsweep.published_statistics(scaled, "jibson-2007").nonzero_median.squeeze()
    pga = np.median([suite[label].peak for label in scaled.motion.values]) / G
    expected = published.jibson_2007(0.05, pga * np.array([1.0, 2.0])).median
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_base_at_rest_moves_no_block() -> None:
    result = slipsweep.sweep(5, 0.3, [0.0, 4.0], 1.0)
    found = slipsweep.published_statistics(result, "jibson-2007").nonzero_median.squeeze()
    assert found[0] == 0.0
    assert found[1] > 0.0


def test_the_table_has_the_suite_and_the_equations_at_each_point(result: xr.Dataset) -> None:
    table = published_table(result, "jibson-2007,newmark-1965", thresholds=["50mm"])
    assert [*table.columns] == [
        "PGA (g)",
        "ky",
        "displacement of",
        "16 % (mm)",
        "median (mm)",
        "84 % (mm)",
        "zero",
        "P(u > 50 mm)",
        "range",
    ]
    assert len(table) == 2 * 3 * 3
    own = slipsweep.suite_statistics(result, thresholds=0.05)
    rows = table[table["displacement of"] == "this suite"]
    np.testing.assert_allclose(
        rows["84 % (mm)"], 1000 * own.displacement_quantile.sel(quantile=0.84).values.ravel()
    )
    np.testing.assert_allclose(rows["P(u > 50 mm)"], own.exceedance_probability.values.ravel())
    jibson = table[table["displacement of"] == "Jibson 2007"]
    expected = 1000 * published.jibson_2007(jibson["ky"], jibson["PGA (g)"]).median
    np.testing.assert_allclose(jibson["median (mm)"], expected, rtol=1e-12)
    assert [*jibson["range"]] == ["outside", "", ""] * 2


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        ("jibson-2008", "equations = 'jibson-2008': no such published equation; did you mean"),
        ("rathje-saygili-2009", "rathje-saygili-2009: needs moment magnitude M (magnitude)"),
        ("yegian-1991", "yegian-1991: needs period T, s (period): the result does not have it"),
    ],
)
def test_what_is_missing_is_named(result: xr.Dataset, equations: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        slipsweep.published_statistics(result, equations)
    assert message in str(error.value)


def test_cycles_that_a_ramp_makes_unequal_are_refused() -> None:
    ramped = slipsweep.sweep(5, 0.3, 4.0, 1.0, excitation=slipsweep.Sine(10, ramp_in=2))
    with pytest.raises(InputError, match="yegian-1991: needs period T"):
        slipsweep.published_statistics(ramped, "yegian-1991")


# ------------------------------------------------------------------------------ the hazard


CURVE = HazardCurve(
    np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.5]) * G,
    np.array([0.02, 0.007, 0.002, 4e-4, 6e-5, 8e-6]),
)


def test_annual_rates_by_equations_are_the_integral_over_the_curve(result: xr.Dataset) -> None:
    rates = slipsweep.displacement_hazard(
        result, CURVE, ["50mm"], equations=["jibson-2007", "rathje-saygili-2009"], magnitude=7.0
    )
    assert rates.annual_rate.dims == ("equation", "yield_coefficient", "threshold")
    knots = np.log(CURVE.amplitude)

    def integrand(log_a: float, name: str, ky: float) -> float:
        pga = math.exp(log_a) / G
        given = {"magnitude": 7.0} if name == "rathje-saygili-2009" else {}
        estimate = EQUATIONS[name].function(ky, pga, **given)
        part = int(np.clip(np.searchsorted(knots, log_a, side="right") - 1, 0, knots.size - 2))
        slope = math.log(CURVE.rate[part] / CURVE.rate[part + 1]) / (knots[part + 1] - knots[part])
        rate = CURVE.rate[part] * math.exp(-slope * (log_a - knots[part]))
        return float(estimate.exceedance_probability(0.05) * slope * rate)

    for name in rates.equation.values:
        for ky in (0.1, 0.2):
            inside = sum(
                integrate.quad(integrand, *ends, args=(name, ky), epsrel=1e-8)[0]
                for ends in itertools.pairwise(knots)
            )
            given = {"magnitude": 7.0} if name == "rathje-saygili-2009" else {}
            last = EQUATIONS[name].function(ky, CURVE.amplitude[-1] / G, **given)
            held = last.exceedance_probability(0.05) * CURVE.rate[-1]
            one = rates.sel(equation=name, yield_coefficient=ky)
            assert one.annual_rate.item() == pytest.approx(inside + held, rel=1e-3)
            assert one.held_rate.item() == pytest.approx(held, rel=1e-9)


def test_rates_say_which_part_is_extrapolated(result: xr.Dataset) -> None:
    rates = slipsweep.displacement_hazard(result, CURVE, ["50mm"], equations="jibson-2007")
    one = rates.squeeze(["equation", "threshold"])
    assert one.outside_rate.sel(yield_coefficient=0.04) == one.annual_rate.sel(
        yield_coefficient=0.04
    )
    assert (one.outside_rate.sel(yield_coefficient=[0.1, 0.2]) == 0.0).all()
    # ky/PGA of 0.1 is 1 g for ky 0.1
    rates = slipsweep.displacement_hazard(result, CURVE, ["50mm"], equations="ambraseys-menu-1988")
    one = rates.squeeze(["equation", "threshold"]).sel(yield_coefficient=0.1)
    beyond = float(CURVE.rate_at(np.array([G]))[0])
    assert one.outside_rate.item() == pytest.approx(beyond, rel=0.02)


def test_a_curve_that_begins_too_high_is_told(result: xr.Dataset) -> None:
    late = HazardCurve(CURVE.amplitude[3:], CURVE.rate[3:])
    rates = slipsweep.displacement_hazard(result, late, ["50mm"], equations="jibson-2007")
    assert np.isnan(rates.omitted_rate.sel(yield_coefficient=0.1).item())


def test_equations_need_no_axis_of_accelerations(result: xr.Dataset) -> None:
    whole = slipsweep.displacement_hazard(result, CURVE, ["50mm"], equations="jibson-2007")
    single = result.isel(amplitude=0)
    one = slipsweep.displacement_hazard(single, CURVE, ["50mm"], equations="jibson-2007")
    np.testing.assert_array_equal(whole.annual_rate, one.annual_rate)


def test_a_magnitude_alone_is_refused(result: xr.Dataset) -> None:
    with pytest.raises(InputError, match="magnitude = 7: only with equations"):
        slipsweep.displacement_hazard(result, CURVE, ["50mm"], magnitude=7)


def test_a_block_that_is_not_stable_has_no_rate() -> None:
    unstable = slipsweep.sweep(30, 0.3, 4.0, 1.0)
    with pytest.raises(slipsweep.RunError, match="each block slides under its own weight"):
        slipsweep.displacement_hazard(unstable, CURVE, ["50mm"], equations="jibson-2007")
