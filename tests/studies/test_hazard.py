"""The displacement hazard: closed forms, what lies outside of the amplitudes, curves that are
refused, the command.
"""

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

import slipsweep
from slipsweep import (
    HazardCurve,
    InputError,
    Newmark,
    Record,
    RunError,
    Suite,
    Validity,
    displacement_hazard,
)
from slipsweep.model.options import MODELS
from slipsweep.studies.hazard import (
    exceedance_rates,
    fragility,
    openquake_fragility,
)
from slipsweep.studies.hazard_curve import read_hazard_curve
from tests.studies.test_suite_statistics import suite_result
from tests.support.commands import command

CURVE = (
    "# a site\nPGA (g); annual rate (1/yr); note\n0.1; 0.01; a\n\n0.4; 0.0005; b\n1.6; 0.00001; c\n"
)

ATTRIBUTES = {"source": "slipsweep test", **MODELS.attributes(Newmark())}


def curve_of(amplitude: list[float], rate: list[float]) -> HazardCurve:
    return HazardCurve(np.array(amplitude), np.array(rate))


def write(folder: Path, result: xr.Dataset, curve: str = CURVE) -> None:
    """A result and a hazard curve, as the command takes them."""
    result.assign_attrs(ATTRIBUTES).to_netcdf(folder / "a.nc")
    (folder / "hazard.csv").write_text(curve)


def power_law(k0: float, k: float, points: int = 12) -> HazardCurve:
    amplitude = np.geomspace(1e-4, 1e4, points)
    return HazardCurve(amplitude, k0 * amplitude**-k)


@pytest.mark.parametrize("k", [0.5, 2.5, 4.0])
@pytest.mark.parametrize(("median", "beta"), [(0.3, 0.3), (5.0, 0.9)])
def test_the_closed_form_of_a_power_law_and_a_lognormal_fragility(
    k: float, median: float, beta: float
) -> None:
    """λ = k0 θ^-k exp(k² β² / 2) (Cornell 1996)."""
    k0 = 3e-4
    expected = k0 * median**-k * math.exp(0.5 * (k * beta) ** 2)
    amplitude = median * np.exp(beta * np.linspace(-12.0, 12.0, 2401))
    found = exceedance_rates(
        power_law(k0, k), amplitude, norm.cdf(np.log(amplitude / median) / beta)
    )
    assert float(found["annual_rate"]) == pytest.approx(expected, rel=1e-3)
    assert float(found["omitted_rate"]) < 1e-9 * expected
    assert found["lower_rate"] < expected < found["upper_rate"] < 1.1 * expected


def test_a_step_of_the_fragility_gives_the_rate_of_the_curve() -> None:
    """A fragility of 0 and then 1 gives the rate of what it jumps at, wherever points of the curve
    lie.
    """
    curve = curve_of([1.0, 2.0, 8.0], [0.1, 0.01, 0.001])
    found = exceedance_rates(curve, [1.0, 4.0 * (1 - 1e-12), 4.0, 8.0], [0.0, 0.0, 1.0, 1.0])
    # straight in logarithms: 4² = 2 · 8
    assert float(found["annual_rate"]) == pytest.approx(math.sqrt(0.01 * 0.001), rel=1e-9)
    assert float(found["held_rate"]) == pytest.approx(0.001, rel=1e-12)
    assert float(found["omitted_rate"]) == 0.0


def test_rates_outside_of_the_amplitudes_are_held_above_and_omitted_below() -> None:
    """The probability is held above and taken as 0 below, also where the curve ends first."""
    curve = curve_of([1.0, 10.0], [0.1, 0.001])
    found = exceedance_rates(curve, [2.0, 5.0], [[0.25, 0.0], [0.25, 0.5]])
    rate = [0.1 * a**-2.0 for a in (2.0, 5.0)]
    np.testing.assert_allclose(found["annual_rate"][0], 0.25 * rate[0], rtol=1e-12)
    np.testing.assert_allclose(found["held_rate"], [0.25 * rate[1], 0.5 * rate[1]], rtol=1e-12)
    np.testing.assert_allclose(found["omitted_rate"], [0.25 * (0.1 - rate[0]), 0.0], rtol=1e-12)
    wider = exceedance_rates(curve, [0.5, 20.0], [[0.5, 0.0], [0.5, 0.0]])
    np.testing.assert_allclose(wider["annual_rate"], [0.05, 0.0], rtol=1e-12)
    np.testing.assert_allclose(wider["held_rate"], [0.0005, 0.0], rtol=1e-12)
    np.testing.assert_array_equal(wider["omitted_rate"], [np.nan, 0.0])
    with pytest.raises(
        InputError, match=r"reaches from 1 to 10 m/s2, .* from 20 to 30 m/s2: they must overlap"
    ):
        exceedance_rates(curve, [20.0, 30.0], [0.1, 0.2])


def test_rates_are_the_integral_over_straight_lines() -> None:
    """Straight lines of the fragility over a curve with a kink between, by a fine sum."""
    curve = curve_of([0.5, 3.0, 12.0], [0.02, 0.003, 0.00005])
    amplitude = np.array([1.0, 2.0, 6.0, 9.0])
    chance = np.array([0.0, 0.3, 0.2, 0.9])
    fine = np.geomspace(1.0, 9.0, 400_001)
    rates = curve.rate_at(fine)
    chances = np.interp(np.log(fine), np.log(amplitude), chance)
    expected = np.sum(0.5 * (chances[1:] + chances[:-1]) * -np.diff(rates)) + 0.9 * rates[-1]
    assert float(exceedance_rates(curve, amplitude, chance)["annual_rate"]) == pytest.approx(
        expected, rel=1e-9
    )


def test_lower_and_upper_rate_are_those_of_the_lower_and_higher_probability() -> None:
    curve = curve_of([0.5, 2.0, 8.0], [0.1, 0.01, 0.001])
    found = exceedance_rates(curve, [1.0, 4.0], [[0.0], [1.0]])
    first, last = curve.rate_at(np.array([1.0, 4.0]))
    np.testing.assert_allclose(
        [found["lower_rate"][0], found["upper_rate"][0]], [last, first], rtol=1e-12
    )


def test_rates_of_a_suite_are_those_by_hand() -> None:
    """Shares of motions; amplitudes in any order and 0; amplitudes, and grid points, without a
    value.
    """
    nan = np.nan
    unstable = int(Validity.STATICALLY_UNSTABLE)
    u = np.array(
        [[0.0, 0.0, 0.0], [nan, 0.2, 0.0], [nan, nan, nan], [0.0, 0.2, 0.5], [0.3, 0.2, 0.5]]
    )
    values = np.stack([u, np.full_like(u, nan)])
    flags = np.where(np.isnan(values), unstable, 0)
    result = suite_result(values, flags, ("mu_s", "amplitude", "motion"))
    result = result.assign_coords(amplitude=[0.0, 1.0, 2.0, 3.0, 4.0])
    curve = curve_of([0.5, 8.0], [0.4, 0.4 / 256])  # 0.1 a⁻²
    expected = exceedance_rates(curve, [1.0, 3.0, 4.0], [[0.5, 0.0], [2 / 3, 1 / 3], [1.0, 1 / 3]])
    for given in (
        result,
        result.isel(amplitude=[2, 0, 3, 1, 4]),
        result.transpose("motion", "amplitude", "mu_s"),
    ):
        found = displacement_hazard(given, curve, ["100mm", 0.4])
        assert found.annual_rate.dims == ("mu_s", "threshold")
        np.testing.assert_allclose(
            found.annual_rate, np.array([expected["annual_rate"], [nan, nan]]), rtol=1e-12
        )
        np.testing.assert_allclose(found.held_rate[0], expected["held_rate"], rtol=1e-12)
        np.testing.assert_allclose(found.omitted_rate[0], expected["omitted_rate"], rtol=1e-12)
        assert found.valueless_share.values.tolist() == [1.0, 1.0]
    assert found.annual_rate.attrs["units"] == "year-1"
    with pytest.raises(RunError, match="the model gives no value under any motion"):
        displacement_hazard(result.isel(mu_s=[1]), curve)
    for one in (result.isel(amplitude=1), result.rename(amplitude="pgv")):
        with pytest.raises(
            InputError,
            match="amplitude: must be a dimension of two peak ground accelerations or more",
        ):
            displacement_hazard(one, curve)
    with pytest.raises(InputError, match="only two peak ground accelerations have a value, and P"):
        displacement_hazard(result.isel(amplitude=[1, 4]), curve, 0.1)
    # where P is the same at both, nothing is in doubt
    certain = displacement_hazard(result.isel(amplitude=[3, 4]), curve, 0.4)
    assert certain.annual_rate[0, 0].item() == pytest.approx(0.1 / 3.0 / 9.0, rel=1e-12)


def test_rates_under_uncertain_friction_pool_samples_and_motions() -> None:
    """Pooled by `sample` or not, motions weigh the same; the rate is that of the fragility of all
    samples.
    """
    curve = power_law(1e-3, 2.0)
    times = np.arange(0.0, 4.0, 0.01)
    motions = [
        Record(times, np.sin(2.0 * np.pi * f * times) * np.exp(-times), name=f"m{f}")
        for f in (0.8, 1.5, 2.5)
    ]
    given: dict[str, Any] = {
        "theta": 5.0,
        "amplitude": [2.0, 4.0, 6.0, 8.0],
        "excitation": Suite(tuple(motions)),
        "samples": 256,
        "uncertain": {"mu_s": {"distribution": "lognorm", "s": 0.1, "scale": 0.4}},
        "thresholds": [0.01, 0.1],
    }
    pooled = slipsweep.sample(**given, over="motion")
    found = displacement_hazard(pooled, curve)
    chances = pooled.exceedance_probability.transpose("amplitude", "threshold").values
    expected = exceedance_rates(curve, given["amplitude"], chances)
    np.testing.assert_allclose(found.annual_rate, expected["annual_rate"], rtol=1e-12)
    assert found.attrs["suite_dimensions"] == "motion samples"
    apart = displacement_hazard(slipsweep.sample(**given), curve, ["10cm"])
    np.testing.assert_allclose(apart.annual_rate, expected["annual_rate"][1:], rtol=1e-12)
    with pytest.raises(
        InputError,
        match=r"thresholds = 0.03: not among those of the result, 0.01, 0.1 m: add it to",
    ):
        displacement_hazard(pooled, curve, 0.03)


def test_a_fragility_is_written_as_openquake_reads_it() -> None:
    u = np.array([[[0.0, 0.1], [0.02, 0.2], [0.3, 0.4]]] * 2)
    result = suite_result(u, np.zeros_like(u), ("mu_s", "amplitude", "motion"))
    result = result.assign_coords(amplitude=[0.981, 1.962, 3.924], mu_s=[0.3, 0.4])
    root = ElementTree.fromstring(openquake_fragility(fragility(result, ["1cm", "50mm"])))
    space = {"nrml": "http://openquake.org/xmlns/nrml/0.5"}
    (model,) = root.findall("nrml:fragilityModel", space)
    assert model.findtext("nrml:limitStates", namespaces=space) == "u_above_10_mm u_above_50_mm"
    functions = model.findall("nrml:fragilityFunction", space)
    assert [one.attrib for one in functions] == [
        {"id": f"mu_s_{mu}", "format": "discrete"} for mu in (0.3, 0.4)
    ]
    imls = functions[0].find("nrml:imls", space)
    assert imls is not None
    assert (imls.text, imls.attrib) == ("0.1 0.2 0.4", {"imt": "PGA", "noDamageLimit": "0.1"})
    poes = {one.attrib["ls"]: one.text for one in functions[0].findall("nrml:poes", space)}
    assert poes == {"u_above_10_mm": "0.5 1 1", "u_above_50_mm": "0.5 0.5 1"}


def test_a_curve_is_read_in_its_units(tmp_path: Path) -> None:
    path = tmp_path / "hazard.csv"
    path.write_text(CURVE)
    curve = read_hazard_curve(path, 9.81)
    np.testing.assert_allclose(curve.amplitude, [0.981, 3.924, 15.696], rtol=1e-15)
    assert curve.rate.tolist() == [0.01, 0.0005, 0.00001]
    assert float(curve.rate_at(np.array([1.962]))[0]) == pytest.approx(
        math.sqrt(0.01 * 0.0005), rel=1e-12
    )


OPENQUAKE = """\
#,,,,,,"generated_by='OpenQuake engine 3.18', kind='mean', investigation_time=50.0, imt='PGA'"
custom_site_id,lon,lat,depth,poe-0.0500000,poe-0.1000000,poe-0.2000000,poe-0.4000000,poe-0.8000000
a,12.5,41.9,0.0,1.000000E+00,4.0E-01,1.0E-01,1.0E-02,0.0
b,13.0,42.0,0.0,9.0E-01,3.0E-01,5.0E-02,5.0E-03,1.0E-04
"""


def test_probabilities_of_openquake_become_annual_rates(tmp_path: Path) -> None:
    """Probabilities in 50 years become annual rates, −ln(1 − p)/50; 1 and 0 are no rates."""
    path = tmp_path / "hazard_curve-mean-PGA_12.csv"
    path.write_text(OPENQUAKE)
    curve = read_hazard_curve(path, 9.81, site=1)
    np.testing.assert_allclose(curve.amplitude, [0.981, 1.962, 3.924], rtol=1e-12)
    np.testing.assert_allclose(curve.rate, -np.log1p([-0.4, -0.1, -0.01]) / 50.0, rtol=1e-12)
    assert read_hazard_curve(path, 9.81, site=2).amplitude.size == 5
    with pytest.raises(InputError, match=r"2 sites: give the number of one, site = 1 to 2"):
        read_hazard_curve(path, 9.81)


@pytest.mark.parametrize(
    ("imt", "measure"),
    [
        ("imt='PGA'", "PGA"),
        ('imt=""PGA""', "PGA"),
        ("imt = 'PGA'", "PGA"),
        ("imt=PGA", "PGA"),
        ("imt='SA(0.3)'", "SA(0.3)"),
        ('imt=""SA(1.0)""', "SA(1.0)"),
        ('imt="SA(1.0)"', "SA(1.0)"),
        ("imt = 'SA(1.0)'", "SA(1.0)"),
        ("imt=SA(1.0)", "SA(1.0)"),
        ("imt='PGV'", "PGV"),
        ("imt='AvgSA'", "AvgSA"),
        ("imt=''", None),
        ("truncation_level=3", None),
    ],
)
def test_curves_of_openquake_that_are_not_of_pga_are_refused(
    tmp_path: Path, imt: str, measure: str | None
) -> None:
    """Another measure than PGA is refused whatever its quotes; none wants a word."""
    path = tmp_path / "hazard.csv"
    path.write_text(OPENQUAKE.replace("imt='PGA'", imt).replace("time=50.0", "time = 50.0"))
    if measure == "PGA":
        assert read_hazard_curve(path, 9.81, site=2).amplitude.size == 5
        return
    for word in ("refuse", "accept"):
        if measure is None and word == "accept":
            assert read_hazard_curve(path, 9.81, site=2, unstated="accept").amplitude.size == 5
            continue
        with pytest.raises(InputError) as refused:
            read_hazard_curve(path, 9.81, site=2, unstated=word)
        said = "no imt in its first line: " if measure is None else f"curves of {measure}: must be"
        assert said in str(refused.value)


@pytest.mark.parametrize(
    "heading",
    [
        "PGA (g), annual rate",
        "PGA (g), rate (1/yr)",
        "Peak ground acceleration (g), annual frequency of exceedance",
        "peak acceleration (g), MAFE",
        "PGA_(g), annual_rate",
        "# PGA on rock\nacceleration (g), annual rate",
        "# site on soil, USA\nGround motion (g), PGA (g), annual rate",
        "PGA (g), SA(1.0) (g), annual rate",
    ],
)
def test_headings_of_curves_of_pga_and_annual_rates(tmp_path: Path, heading: str) -> None:
    path = tmp_path / "hazard.csv"
    values = ["0.1, 0.01", "0.4, 0.0005"]
    if heading.count(",") - heading.count(", USA") > 1:
        values = [f"{one.split(',')[0]}, {one}" for one in values]
    path.write_text("\n".join((heading, *values)))
    curve = read_hazard_curve(path, 10.0)
    np.testing.assert_allclose(curve.amplitude, [1.0, 4.0], rtol=1e-15)
    assert curve.rate.tolist() == [0.01, 0.0005]


@pytest.mark.parametrize(
    ("heading", "message"),
    [
        ("spectral acceleration (g), annual rate", "'spectral acceleration (g)': must be of PGA"),
        ("SA(1.0) (g), annual rate", "'SA(1.0) (g)': must be of PGA"),
        ("Sa [g], annual rate", "'Sa [g]': must be of PGA"),
        ("PSA_1s (g), annual rate", "'PSA_1s (g)': must be of PGA"),
        ("acceleration at 1 s (g), annual rate", "must be of PGA"),
        ("PGV (cm/s), annual rate", "must be of PGA"),
        ("# SA(1.0), 5 %\nacceleration (g), annual rate", "its comment says 'SA(1.0), 5 %'"),
        ("# Spectral acceleration\nPGA (g), annual rate", "its comment says 'Spectral acc"),
        ("PGA (g), exceedance in 50 years", "'exceedance in 50 years': must be an annual rate"),
        ("PGA (g), PoE in 50 yr", "must be an annual rate"),
        ("PGA (g), 10% in 50 years", "must be an annual rate"),
        ("PGA (g), annual rate (1/50yr)", "must be an annual rate"),
        ("PGA (g), return period (yr)", "must be an annual rate"),
        ("# exceedance in 50 years\nPGA (g), rate", "its comment says 'exceedance in 50 years'"),
    ],
)
def test_headings_that_say_something_else_are_refused(
    tmp_path: Path, heading: str, message: str
) -> None:
    path = tmp_path / "hazard.csv"
    path.write_text(f"{heading}\n0.1, 0.01\n0.4, 0.0005\n")
    for word in ("refuse", "accept"):
        with pytest.raises(InputError) as refused:
            read_hazard_curve(path, 10.0, unstated=word)
        assert message in str(refused.value)


@pytest.mark.parametrize(
    ("heading", "message"),
    [
        ("acceleration (g), annual rate", "column 'acceleration (g)': does not say that it is PGA"),
        ("amplitude (g), annual rate", "does not say that it is PGA"),
        ("iml (g), annual rate", "does not say that it is PGA"),
        ("PGA (g), rate", "column 'rate': does not say that its rates are annual"),
        ("PGA (g), exceedance", "does not say that its rates are annual"),
        ("PGA (g), frequency", "does not say that its rates are annual"),
    ],
)
def test_what_a_heading_leaves_open_is_accepted_by_a_word(
    tmp_path: Path, heading: str, message: str
) -> None:
    path = tmp_path / "hazard.csv"
    path.write_text(f"{heading}\n0.1, 0.01\n0.4, 0.0005\n")
    with pytest.raises(
        InputError, match="--unstated accept takes it for a curve of PGA"
    ) as refused:
        read_hazard_curve(path, 10.0)
    assert message in str(refused.value)
    curve = read_hazard_curve(path, 10.0, unstated="accept")
    np.testing.assert_allclose(curve.amplitude, [1.0, 4.0], rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: 0 columns of PGA: must be one, as in PGA (g), annual rate"),
        ("PGA (mm), annual rate\n1,2\n", 'unit = "mm": must be a unit that converts to m s-2'),
        ("PGA (g), annual probability\n1,2\n", "must be an annual rate, -ln(1 - p)"),
        (
            "PGA (g), annual rate\n0.1,x\n",
            "line 2: '0.1,x': must be 2 cells, and a number, or nothing, for PGA",
        ),
        (
            "PGA (m/s2), annual rate\n1,0.02\n1,0.01\n",
            "amplitude of point 2 = 1: must be > 0, and greater than",
        ),
        ("PGA (m/s2), annual rate\n1,0.02\n2,0\n", "rate of point 2 = 0: must be > 0"),
    ],
)
def test_curves_that_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "hazard.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_hazard_curve(path, 9.81)
    assert message in str(refused.value)
    assert str(path) in str(refused.value)


def test_hazard_prints_rates_and_what_is_not_known_of_them(tmp_path: Path) -> None:
    """It prints the rates that the function gives, draws them, and says what to do about what is
    not known.
    """
    rng = np.random.default_rng(3)
    amplitude = np.geomspace(0.5, 10.0, 6)
    u = amplitude[:, None] ** 2 * 0.01 * rng.lognormal(0.0, 0.6, (2, 1, 9)) * [[[1.0]], [[0.5]]]
    u[:, :2] = 0.0
    u[0, 5, :3] = np.nan
    flags = np.where(np.isnan(u), int(Validity.UPLIFT), 0)
    result = suite_result(u, flags, ("mu_s", "amplitude", "motion")).assign_coords(
        amplitude=amplitude, mu_s=[0.3, 0.4]
    )
    write(tmp_path, result)
    run = ("hazard", "a.nc", "--curve", "hazard.csv", "-d", "0.2", "-d", "50mm", "-d", "90m")
    done = command(tmp_path, *run, "-o", "h.svg", "-o", "h.png", "-o", "f.xml")
    assert (done.returncode, done.stderr) == (0, "")
    found = displacement_hazard(result, tmp_path / "hazard.csv", [0.05, 0.2, 90.0])
    table = done.stdout[done.stdout.index("mu_s d (m)") :].splitlines()[1:7]
    assert [line.split()[-7:-5] for line in table] == [
        [f"{d:.2f}", f"{rate:.4g}"]
        for point in found.annual_rate.values
        for d, rate in zip([0.05, 0.2, 90], point, strict=True)
    ]
    assert [line[:3] for line in table] == ["0.3", "   ", "   ", "0.4", "   ", "   "]
    assert "up to 33.3% of the motions have no value" in done.stdout
    assert (
        "annual rate 0: the displacement is not exceeded at any amplitude of the result\n"
        in done.stdout
    )
    assert (
        "above 1.019 g P(u > d) is taken as it is there: to compute it, extend the axis amplitude"
        in done.stdout
    )
    assert "put more values on the axis amplitude" in done.stdout
    assert (tmp_path / "h.svg").read_text(encoding="utf-8").count("μs = 0.4") == 1
    assert (tmp_path / "f.xml").read_text().count("<poes") == 6
    assert command(tmp_path, "export", "a.nc", "-o", "e.xml", "--at", "mu_s=0.4").returncode == 0
    assert (tmp_path / "e.xml").read_text().count("<poes") == 3
    cut = command(tmp_path, *run, "--at", "mu_s=0.4", "-o", "c.png")
    assert (cut.returncode, cut.stdout.count("mu_s = 0.4\n")) == (0, 1)
    assert f"{found.annual_rate.values[1, 0]:.4g}" in cut.stdout


def test_the_command_takes_what_a_curve_leaves_open(tmp_path: Path) -> None:
    u = np.array([[0.0, 0.1], [0.1, 0.2], [0.3, 0.4]])
    result = suite_result(u, np.zeros_like(u), ("amplitude", "motion"))
    write(tmp_path, result.assign_coords(amplitude=[5.0, 10.0, 20.0]))
    run = ("hazard", "a.nc", "--curve", "hazard.csv", "-d", "5cm")
    expected = command(tmp_path, *run)
    (tmp_path / "hazard.csv").write_text(CURVE.replace("PGA", "level").replace("annual", ""))
    refused = command(tmp_path, *run)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "does not say that it is PGA" in refused.stderr
    done = command(tmp_path, *run, "--unstated", "accept")
    assert (done.returncode, done.stdout) == (0, expected.stdout)


def test_the_end_of_the_curve_is_told_from_the_end_of_the_sweep(tmp_path: Path) -> None:
    u = np.array([[0.0, 0.1], [0.1, 0.2], [0.3, 0.4]])
    result = suite_result(u, np.zeros_like(u), ("amplitude", "motion")).assign_coords(
        amplitude=[5.0, 10.0, 20.0]
    )
    write(tmp_path, result, "PGA (m/s2), annual rate\n6, 0.01\n12, 0.001\n")
    done = command(tmp_path, "hazard", "a.nc", "--curve", "hazard.csv", "-d", "5cm")
    assert (
        "above 1.223 g P(u > d) is taken as it is there: to compute it, extend the hazard curve"
        in done.stdout
    )
    assert (
        "the hazard curve begins at 0.6116 g, where displacements are exceeded already"
        in done.stdout
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--at", "mu_s=0.35"), "its neighbours are 0.3 and 0.4"),
        (
            ("-d", "50"),
            "--displacement = 50: without a unit that is 50 m; give the unit: -d 50mm or -d 50m",
        ),
        (("--site", "2"), "site = 2: only for a file of OpenQuake"),
    ],
)
def test_what_the_command_refuses(tmp_path: Path, given: tuple[str, ...], message: str) -> None:
    result = suite_result(
        np.full((2, 3, 4), 0.1), np.zeros((2, 3, 4)), ("mu_s", "amplitude", "motion")
    )
    result = result.assign_coords(mu_s=[0.3, 0.4])
    write(tmp_path, result)
    lengths = () if "-d" in given else ("-d", "1cm")
    done = command(tmp_path, "hazard", "a.nc", "--curve", "hazard.csv", *lengths, *given)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
