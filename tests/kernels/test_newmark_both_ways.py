"""Newmark's block in both directions: closed forms, symmetry, and the stepping kernel."""

from math import acos, asin, degrees, pi
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep import (
    Cosine,
    Harmonics,
    InputError,
    Newmark,
    Record,
    Sine,
    Square,
    Step,
    Triangle,
    Validity,
    sweep,
)

BOTH = Newmark(sliding="both")
RESULTS = ("permanent_displacement", "largest_displacement", "smallest_displacement")


def response(share: Any, upslope: Any = None, **given: Any) -> xr.Dataset:
    """A block of A = 1 m/s² and ω = 1 rad/s, so that displacements are in A/ω²."""
    block: dict[str, Any] = {
        "theta": 0.0,
        "mu_s": 0.1,
        "yield_acceleration": share,
        "upslope_yield_acceleration": upslope,
        "model": BOTH,
    }
    if not isinstance(given["excitation"], Record):
        block |= {"amplitude": 1.0, "frequency": 1.0 / (2.0 * pi)}
    return sweep(**block, **given)


def sine_from(phase: float, cycles: int) -> Harmonics:
    """A sine that begins at a phase in radians."""
    return Harmonics([1.0], [1], [degrees(phase)], cycles=cycles)


# ------------------------------------------------------------------ closed forms


@pytest.mark.parametrize(
    ("share", "swing"), [(0.1, 1.975171880), (0.3, 1.764011226), (0.5, 1.237981785)]
)
def test_level_base_never_at_rest(share: float, swing: float) -> None:
    """V is 0 where cos φ = πη/2: a block that begins there is in the steady state at once."""
    wave = sine_from(acos(pi * share / 2.0), cycles=20)
    found = response(share, excitation=wave)
    extent = float(found.largest_displacement - found.smallest_displacement)
    assert extent == pytest.approx(swing, abs=5e-10)
    exact = 2.0 * np.sqrt(1.0 - (pi * share / 2.0) ** 2)
    assert extent == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize(
    ("share", "slip"),
    [
        (0.55, 1.011131945),
        (0.6, 0.788372109),
        (0.7, 0.432493940),
        (0.8, 0.187794523),
        (0.9, 0.045935176),
    ],
)
def test_level_base_with_rest(share: float, slip: float) -> None:
    """One half-cycle's slip there and back, for a block that begins where it slides off."""
    found = response(share, excitation=sine_from(asin(share), cycles=20))
    assert float(found.largest_displacement) == pytest.approx(slip, abs=5e-10)
    assert float(found.smallest_displacement) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(
    ("downslope", "upslope", "drift"),
    [(0.2, 0.3, 1.782556969), (0.1, 0.4, 4.595092856), (0.15, 0.25, 2.279017883)],
)
def test_drift_on_an_incline(downslope: float, upslope: float, drift: float) -> None:
    """The steady state gains the same in each cycle; 300 cycles are enough to come to it."""
    moved = [
        float(response(downslope, upslope, excitation=Sine(cycles=n)).permanent_displacement)
        for n in (300, 301)
    ]
    assert moved[1] - moved[0] == pytest.approx(drift, abs=5e-10)


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
def test_triangular_pulse(share: float, displacement: float) -> None:
    """A recorded isosceles triangle of 1 s, then rest; in units of A T₀²."""
    pulse = Record(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0, 0.0]))
    for model in (Newmark(), BOTH):
        found = sweep(0.0, 0.1, yield_acceleration=share, excitation=pulse, model=model)
        assert float(found.permanent_displacement) == pytest.approx(displacement, abs=1e-12)


@pytest.mark.parametrize(
    ("share", "displacement"),
    [(0.8, 0.019027563313), (0.9, 0.004654206411)],
)
def test_half_sine_pulse(share: float, displacement: float) -> None:
    """The first half of a sine, where the block is at rest again before the pulse ends."""
    found = response(share, 2.0, excitation=Sine(cycles=1))
    assert float(found.permanent_displacement) / pi**2 == pytest.approx(displacement, abs=1e-12)


# ------------------------------------------------------------------ both directions


def noise(seed: int) -> Record:
    """A record of white noise, quantised, with samples of exactly 0."""
    samples = np.random.default_rng(seed).normal(size=300)
    return Record.sampled(np.round(2.0 * samples, 1), 0.02)


MOTIONS = [
    Triangle(cycles=6, ramp_in=1.5),
    Square(cycles=5, ramp_out=2.0),
    Cosine(cycles=7),
    Harmonics([1.0, 0.6], [1, 3], [10.0, 50.0], cycles=6, ramp_in=1.0),
    noise(1),
    noise(2),
]


def mirrored(motion: Any) -> dict[str, Any]:
    """The same motion with the other sign."""
    if isinstance(motion, Record):
        return {"excitation": motion, "polarity": -1}
    options = {**motion.options, "phases": [p + 180.0 for p in motion.phases]}
    return {"excitation": Harmonics(**options)}


@pytest.mark.parametrize("motion", MOTIONS[3:])
def test_mirror(motion: Any) -> None:
    """−Üg with Üy and Üy,up exchanged gives −u."""
    random = np.random.default_rng(3)
    downslope, upslope = (
        xr.DataArray(random.uniform(0.02, 1.0, 100), dims="cell") for _ in range(2)
    )
    one = response(downslope, upslope, excitation=motion)
    other = response(upslope, downslope, **mirrored(motion))
    assert (np.abs(one.permanent_displacement) > 0).sum() > 50
    for name, opposite in zip(RESULTS, (RESULTS[0], RESULTS[2], RESULTS[1]), strict=True):
        np.testing.assert_allclose(one[name], -other[opposite], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("motion", MOTIONS)
def test_agreement_with_steps(motion: Any) -> None:
    """Each of 200 cells against the stepping kernel, which has no code in common."""
    random = np.random.default_rng(4)
    downslope, upslope = (
        xr.DataArray(random.uniform(0.02, 1.1, 200), dims="cell") for _ in range(2)
    )
    found = response(downslope, upslope, excitation=motion)
    stepped = response(
        downslope, upslope, excitation=motion, solver=Step("simpson", steps_per_cycle=8192)
    )
    assert (found.permanent_displacement < 0).any()
    np.testing.assert_array_equal(found.validity, stepped.validity)
    largest = np.maximum(found.largest_displacement, -found.smallest_displacement)
    for name in RESULTS:
        apart = np.abs(found[name] - stepped[name])
        assert float((apart / (largest + 1e-9)).max()) < 1e-7, name


def test_a_slide_upslope_that_ends_where_it_begins() -> None:
    """|Üg| falls through Üy,up just where the block turns; rounding sent the search for the stop
    astray.
    """
    block: dict[str, Any] = {
        "theta": 3.0,
        "mu_s": 0.3,
        "amplitude": 7.003112822853185,
        "frequency": 1.0 / (2.0 * pi),
        "yield_acceleration": 0.012776358477365565,
        "model": BOTH,
    }
    found = sweep(**block).permanent_displacement
    stepped = sweep(**block, solver=Step("simpson", steps_per_cycle=8192)).permanent_displacement
    assert float(found) == pytest.approx(float(stepped), rel=1e-9)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("model", [Newmark(), BOTH])
def test_history_ends_where_the_sweep_does(motion: Any, model: Newmark) -> None:
    """It goes from piece to piece; a sweep under a record goes over runs of samples."""
    shaking: dict[str, Any] = {"excitation": motion, "scale": 1.5}
    if not isinstance(motion, Record):
        shaking = {"excitation": motion, "amplitude": 3.0, "frequency": 1.5}
    history = slipsweep.simulate(4.0, 0.12, model=model, **shaking)
    way = history.relative_displacement.values
    extent = float(np.abs(way).max())
    final = float(history.permanent_displacement)
    assert final == pytest.approx(way[-1], rel=1e-12, abs=1e-12 * extent)
    assert float(history.relative_velocity[-1]) == 0.0
    if model == BOTH:
        largest = float(history.largest_displacement)
        smallest = float(history.smallest_displacement)
        assert smallest <= way.min() + 1e-12 * extent
        assert way.max() <= largest + 1e-12 * extent
        assert largest - smallest == pytest.approx(np.ptp(way), rel=1e-2)


def test_history_obeys_the_rules_of_motion() -> None:
    """v̇ = Üg − Ü, with Ü = Üy downslope, −Üy,up upslope, Üg at rest within the two."""
    block: dict[str, Any] = {"theta": 3.0, "mu_s": 0.1, "model": BOTH, "scale": 1.0}
    history = slipsweep.simulate(**block, excitation=noise(8), times=np.arange(1e-4, 6.0, 1e-4))
    downslope = 9.81 * np.tan(np.arctan(0.1) - np.radians(3.0))
    upslope = 9.81 * np.tan(np.arctan(0.1) + np.radians(3.0))
    ground = history.ground_acceleration.values
    speed = history.relative_velocity.values
    assert (speed > 0.1).any()
    assert (speed < -0.05).any()
    at_rest = (ground <= downslope) & (ground >= -upslope)
    expected = np.where(speed > 0, downslope, np.where(speed < 0, -upslope, ground))
    np.testing.assert_allclose(history.block_acceleration, expected, rtol=1e-12)
    assert at_rest[speed == 0.0].all()
    rate = ground - history.block_acceleration.values
    gained = 0.5e-4 * (rate[1:] + rate[:-1])
    smooth = (np.sign(speed[1:]) == np.sign(speed[:-1])) & (speed[1:] != 0.0)
    smooth &= np.abs(np.diff(rate)) < 0.5  # not across the end of the record
    np.testing.assert_allclose(np.diff(speed)[smooth], gained[smooth], atol=1e-8)
    moved = 0.5e-4 * (speed[1:] + speed[:-1])
    np.testing.assert_allclose(np.diff(history.relative_displacement), moved, atol=1e-7)


@pytest.mark.parametrize("model", [Newmark(), BOTH])
def test_the_same_lines_sampled_more_finely(model: Newmark) -> None:
    """Samples are taken together in runs: in others, if there are three times as many."""
    random = np.random.default_rng(11)
    places = np.arange(1201) / 3.0
    smooth = np.convolve(random.normal(size=401), np.hanning(25), "same")
    coarse = Record.sampled(smooth, 0.02)
    fine = Record.sampled(np.interp(places, np.arange(401), smooth), 0.02 / 3.0)
    downslope, upslope = (
        xr.DataArray(np.geomspace(0.002, 4.0, 60), dims="cell"),
        xr.DataArray(random.permutation(np.geomspace(0.002, 4.0, 60)), dims="cell"),
    )
    block: dict[str, Any] = {"theta": 0.0, "mu_s": 0.1, "yield_acceleration": downslope}
    if model == BOTH:
        block["upslope_yield_acceleration"] = upslope
    one, other = (sweep(**block, excitation=record, model=model) for record in (coarse, fine))
    assert int((one.number_of_slips > 0).sum()) > 40
    for name in ("number_of_slips", "stick_slip_pulses"):
        np.testing.assert_array_equal(one[name], other[name])
    for name in ("permanent_displacement", "peak_relative_velocity", *RESULTS[1:]):
        if name in one:
            scale = float(np.abs(one[name]).max())
            np.testing.assert_allclose(one[name], other[name], rtol=1e-10, atol=1e-12 * scale)


def test_suite_is_its_records() -> None:
    records = [noise(6), noise(7)]
    suite = slipsweep.Suite(tuple(records), ("first", "second"))
    block: dict[str, Any] = {"theta": 3.0, "mu_s": [0.1, 0.2], "model": BOTH, "scale": 2.0}
    together = sweep(**block, excitation=suite)
    for record, label in zip(records, suite.labels, strict=True):
        alone = sweep(**block, excitation=record)
        for name in RESULTS:
            np.testing.assert_array_equal(together[name].sel(motion=label), alone[name])


def test_no_sliding_upslope_is_sliding_downslope() -> None:
    """On a slope so steep that no acceleration moves the block upslope."""
    record = noise(5)
    cells: dict[str, Any] = {"theta": 40.0, "mu_s": [0.9, 1.0, 1.3], "excitation": record}
    one = sweep(**cells, model="newmark")
    both = sweep(**cells, model=BOTH)
    assert (one.permanent_displacement > 0).all()
    np.testing.assert_array_equal(one.permanent_displacement, both.permanent_displacement)
    assert (both.smallest_displacement == 0).all()


def test_yield_upslope_by_statics() -> None:
    """g tan(φs + θ), by default and from Coulomb's Üy."""
    angle = np.radians(6.0)
    mu_s = 0.3
    upslope = 9.81 * np.tan(np.arctan(mu_s) + angle)
    downslope = 9.81 * np.tan(np.arctan(mu_s) - angle)
    block: dict[str, Any] = {"amplitude": 9.0, "frequency": 1.0, "excitation": Cosine(cycles=5)}
    block |= {"model": BOTH}
    exact = sweep(6.0, mu_s, upslope_yield_acceleration=upslope, **block)
    for found in (
        sweep(6.0, mu_s, **block),
        sweep(6.0, mu_s, yield_acceleration=downslope, **block),
        sweep(theta=6.0, yield_coefficient=downslope / 9.81, **block),
    ):
        for name in RESULTS:
            assert float(found[name]) == pytest.approx(float(exact[name]), rel=1e-11), name


def test_upslope_is_no_caution() -> None:
    found = response(0.5, 0.1, excitation=Triangle(cycles=3))
    assert float(found.permanent_displacement) < 0
    assert Validity(int(found.validity)) == Validity(0)


# ------------------------------------------------------------------ inputs


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"yield_coefficient": 0.1, "model": BOTH},
            "theta, upslope_yield_acceleration: one of them must be given",
        ),
        (
            {"theta": 5.0, "mu_s": 0.4, "upslope_yield_acceleration": 3.0},
            "upslope_yield_acceleration: only with model = Newmark(sliding='both')",
        ),
        (
            {"theta": 5.0, "mu_s": 0.4, "variables": ["clearance"]},
            "variables: clearance: only with model = Newmark(sliding='both')",
        ),
    ],
)
def test_what_goes_with_both_ways_only(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        sweep(**given, amplitude=3.0, frequency=1.0)
    assert str(error.value).startswith(message)
