"""Newmark's block whose strength falls with slip or depends on velocity: SciPy, closed forms,
limits.
"""

from math import acosh, asin, atan, cos, cosh, inf, pi, radians, sin, sinh, tan
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from benchmarks.strength import random_cells
from slipsweep import (
    Cosine,
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
from tests.support import changing_strength as reference

G = 9.81
WEAKENING = Newmark(strength="weakening")
RATE = Newmark(strength="rate")

#: A block of each kind, on which nothing depends.
PARTS: dict[str, dict[str, Any]] = {
    "weakening": {"residual_mu": 0.2, "weakening_distance": 0.05},
    "rate": {"fast_mu": 0.2, "rate_constant": 30.0},
}
BLOCK: dict[str, Any] = {"theta": 4.0, "mu_s": 0.3, "amplitude": 4.0, "frequency": 1.0}

KINDS = pytest.mark.parametrize("strength", ["weakening", "rate"])
WAYS = pytest.mark.parametrize("sliding", ["downslope", "both"])


def displacement(**given: Any) -> float:
    return float(sweep(**given).permanent_displacement)


def record_of(times: Any, acceleration: Any) -> Record:
    return Record(np.asarray(times, np.float64), np.asarray(acceleration, np.float64))


# ------------------------------------------------------------------ against SciPy

QUARTERS = [0.0, 0.5 * pi, pi, 1.5 * pi, 2.0 * pi]
WAVES: list[tuple[Any, Any, list[float]]] = [
    (Sine, sin, QUARTERS),
    (Cosine, cos, QUARTERS),
    (Triangle, lambda phase: 2.0 / pi * asin(sin(phase)), QUARTERS),
    (Square, lambda phase: 1.0 if sin(phase) > 0.0 else -1.0, [0.0, pi, 2.0 * pi]),
]


def solved_by_scipy(
    cell: dict[str, Any], strength: Any, sliding: Any, pieces: list[reference.Piece]
) -> reference.Motion:
    if strength == "weakening":
        kink = cell["weakening_distance"]
        law = reference.weakening(cell["mu_s"], cell["residual_mu"], kink)
    else:
        kink = inf
        law = reference.rate(cell["mu_s"], cell["fast_mu"], cell["rate_constant"])
    block = reference.Block(cell["theta"], law, kink, sliding == "both")
    return reference.solve(block, pieces)


def assert_same(results: xr.Dataset, expected: reference.Motion, both: bool, text: str) -> None:
    """The same to 2e-6 of the largest |u|, or both without a value."""
    if np.isnan(expected.displacement):
        assert results.validity.item() & Validity.NOT_AT_REST, text
        assert np.isnan(results.permanent_displacement.item()), text
        return
    near: dict[str, Any] = {
        "rel": 0.0,
        "abs": 2e-6 * max(expected.largest, -expected.smallest),
        "nan_ok": False,
    }
    assert results.permanent_displacement.item() == pytest.approx(expected.displacement, **near), (
        text
    )
    velocity = pytest.approx(expected.largest_velocity, rel=3e-6, abs=1e-12)
    assert results.peak_relative_velocity.item() == velocity, text
    if both:
        assert results.largest_displacement.item() == pytest.approx(expected.largest, **near), text
        assert results.smallest_displacement.item() == pytest.approx(expected.smallest, **near), (
            text
        )


@KINDS
@WAYS
def test_cells_under_waves_against_scipy(strength: Any, sliding: Any) -> None:
    """Four waves, slopes to 15°, friction that falls or rises; some do not come to rest."""
    count = 40
    cells = random_cells(np.random.default_rng(7), count, strength)
    model = Newmark(sliding=sliding, strength=strength)
    for number in range(count):
        wave, function, breaks = WAVES[number % len(WAVES)]
        cycles = 1 + number % 3
        cell: dict[str, Any] = {name: float(one[number]) for name, one in cells.items()}
        amplitude = cell["amplitude"]
        pieces = reference.wave_pieces(function, breaks, cell["frequency"], cycles, amplitude)
        expected = solved_by_scipy(cell, strength, sliding, pieces)
        results = sweep(**cell, model=model, excitation=wave(cycles=cycles))
        assert_same(results, expected, sliding == "both", f"{number}: {wave.name}, {cell}")


@KINDS
@WAYS
def test_cells_under_records_against_scipy(strength: Any, sliding: Any) -> None:
    """Lines between random samples, with zeros, stretched in time."""
    count = 10
    rng = np.random.default_rng(8)
    cells = random_cells(rng, count, strength)
    model = Newmark(sliding=sliding, strength=strength)
    for number in range(count):
        cell: dict[str, Any] = {name: float(one[number]) for name, one in cells.items()}
        samples = np.concatenate([[0.0], rng.normal(size=25), [0.0, 0.0], rng.normal(size=6)])
        times = 0.06 * np.arange(samples.size)
        record = record_of(times, samples)
        amplitude = cell.pop("amplitude")
        stretch = 1.0 / cell.pop("frequency")
        scaled = samples * amplitude / abs(samples).max()
        pieces = reference.record_pieces(stretch * times, scaled)
        expected = solved_by_scipy(cell, strength, sliding, pieces)
        shaking: dict[str, Any] = {
            "excitation": record,
            "amplitude": amplitude,
            "time_scale": stretch,
        }
        results = sweep(**cell, **shaking, model=model)
        assert_same(results, expected, sliding == "both", f"{number}: {cell}")


@KINDS
@WAYS
def test_default_steps_are_exact_to_a_millionth(strength: Any, sliding: Any) -> None:
    """Against steps four times as fine; python -m benchmarks.strength has 1,000 cells."""
    cells = random_cells(np.random.default_rng(9), 60, strength)
    model = Newmark(sliding=sliding, strength=strength)
    results = sweep(**cells, model=model)
    finer = sweep(**cells, model=model, solver=Step("simpson", 2048))
    moved = abs(finer.permanent_displacement)
    if sliding == "both":
        moved = np.maximum(finer.largest_displacement, -finer.smallest_displacement)
    error = abs(results.permanent_displacement - finer.permanent_displacement) / moved
    assert float(error.max()) < 1e-6
    assert float(error.median()) < 1e-9
    assert results.validity.identical(finer.validity.assign_attrs(results.validity.attrs))


# ------------------------------------------------------------------ closed forms


def test_linear_weakening_under_a_square_wave() -> None:
    """A level base: u grows as cosh κt to D, then as t²; later cycles are at residual strength."""
    mu_s, residual_mu, distance, amplitude, frequency = 0.3, 0.1, 0.04, 5.0, 1.0
    kappa = (G * (mu_s - residual_mu) / distance) ** 0.5
    excess = amplitude - G * mu_s
    until = acosh(1.0 + distance * kappa**2 / excess) / kappa
    half = 0.5 / frequency
    assert until < half
    assert excess / kappa**2 * (cosh(kappa * until) - 1.0) == pytest.approx(distance)

    def beyond(velocity: float, duration: float) -> float:
        """At residual strength: to the end of the half cycle, and to the stop in the next."""
        gaining = amplitude - G * residual_mu
        moved = velocity * duration + 0.5 * gaining * duration**2
        fastest = velocity + gaining * duration
        assert fastest / (amplitude + G * residual_mu) < half
        return moved + 0.5 * fastest**2 / (amplitude + G * residual_mu)

    first = distance + beyond(excess / kappa * sinh(kappa * until), half - until)
    found = displacement(
        theta=0.0,
        mu_s=mu_s,
        amplitude=amplitude,
        frequency=frequency,
        residual_mu=residual_mu,
        weakening_distance=distance,
        model=WEAKENING,
        excitation=Square(cycles=3),
    )
    assert found == pytest.approx(first + 2.0 * beyond(0.0, half), rel=1e-9)


def test_a_block_that_weakens_after_the_shaking_stops_at_residual_strength() -> None:
    """Half a cycle of a square, then rest: v²/2 is the work of the friction up to the stop."""
    mu_s, residual_mu, distance, amplitude = 0.3, 0.1, 0.5, 6.0
    kappa = (G * (mu_s - residual_mu) / distance) ** 0.5
    duration = 0.4
    moved = (amplitude - G * mu_s) / kappa**2 * (cosh(kappa * duration) - 1.0)
    velocity = (amplitude - G * mu_s) / kappa * sinh(kappa * duration)
    assert moved < distance
    work = 0.5 * G * (mu_s + residual_mu - (mu_s - residual_mu) * moved / distance)
    left = distance - moved
    assert 0.5 * velocity**2 > work * left, "it stops beyond the weakening distance"
    expected = distance + (0.5 * velocity**2 - work * left) / (G * residual_mu)
    pulse = record_of([0.0, duration], [amplitude, amplitude])
    given: dict[str, Any] = {"residual_mu": residual_mu, "weakening_distance": distance}
    found = displacement(theta=0.0, mu_s=mu_s, **given, model=WEAKENING, excitation=pulse)
    assert found == pytest.approx(expected, rel=1e-6)


# ------------------------------------------------------------------ limits


@pytest.mark.parametrize(
    ("strength", "given"),
    [
        ("weakening", {"residual_mu": 0.3, "weakening_distance": 0.01}),
        ("weakening", {"residual_mu": 0.1, "weakening_distance": 1e15}),
        ("rate", {"fast_mu": 0.3, "rate_constant": 50.0}),
        ("rate", {"fast_mu": 0.1, "rate_constant": 0.0}),
    ],
)
@WAYS
def test_without_a_change_it_is_newmarks_block(
    strength: Any, given: dict[str, Any], sliding: Any
) -> None:
    """μr → μs, D → ∞, μf → μs and a → 0, also where friction falls below tan θ."""
    block: dict[str, Any] = BLOCK | {"theta": [0.0, 4.0, 8.0], "amplitude": [3.0, 5.0]}
    expected = sweep(**block, model=Newmark(sliding=sliding))
    results = sweep(**block, **given, model=Newmark(sliding=sliding, strength=strength))
    xr.testing.assert_allclose(
        results.permanent_displacement.reset_coords(drop=True),
        expected.permanent_displacement.reset_coords(drop=True),
        rtol=2e-9,
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("strength", "given"),
    [
        ("weakening", {"residual_mu": 0.2, "weakening_distance": 1e-9}),
        ("rate", {"fast_mu": 0.2, "rate_constant": 1e5}),
        ("rate", {"fast_mu": 0.35, "rate_constant": 1e5}),
    ],
)
def test_at_once_it_is_the_block_of_the_other_friction(
    strength: Any, given: dict[str, Any]
) -> None:
    """D → 0 and a → ∞, under a square wave, whose onset is that of both frictions."""
    block: dict[str, Any] = BLOCK | {"amplitude": 6.0, "excitation": Square(cycles=4)}
    found = displacement(**block, **given, model=Newmark(strength=strength))
    changed = block | {"mu_s": next(iter(given.values()))}
    assert found == pytest.approx(displacement(**changed, model="newmark"), rel=1e-4)


def test_the_onset_is_that_of_the_static_friction() -> None:
    """However fast friction falls, a block does not slide before it has been exceeded."""
    onset = G * tan(atan(0.3) - radians(4.0))
    laws: list[tuple[Any, dict[str, Any]]] = [
        ("weakening", {"residual_mu": 0.1, "weakening_distance": 1e-6}),
        ("rate", {"fast_mu": 0.1, "rate_constant": 1e4}),
    ]
    for strength, given in laws:
        amplitudes = [onset * (1.0 - 1e-9), onset * (1.0 + 1e-3)]
        block: dict[str, Any] = BLOCK | {"amplitude": amplitudes}
        found = sweep(**block, **given, model=Newmark(strength=strength)).permanent_displacement
        assert found[0] == 0.0
        assert found[1] > 0.01


# ------------------------------------------------------------------ symmetry and scaling


@KINDS
def test_the_mirror_of_a_record_gives_the_mirrored_displacement(strength: Any) -> None:
    """On a level base, both ways."""
    rng = np.random.default_rng(3)
    record = record_of(0.05 * np.arange(40), rng.normal(size=40) * 4.0)
    model = Newmark(sliding="both", strength=strength)
    found = sweep(0.0, 0.3, **PARTS[strength], model=model, excitation=record, polarity="both")
    forth, back = found.permanent_displacement.values
    assert forth == pytest.approx(-back, rel=1e-12)
    assert found.largest_displacement.values[0] == pytest.approx(
        -found.smallest_displacement.values[1], rel=1e-12
    )


@KINDS
def test_lengths_and_times_scale_together(strength: Any) -> None:
    """With D and 1/(a ω) scaled as A/ω² and A/ω are, u is; with D and a kept, it is not."""
    factor = 3.0
    names = list(PARTS[strength])
    given = dict(PARTS[strength])
    fast = BLOCK | {"frequency": factor}
    whole = displacement(**BLOCK, **given, model=Newmark(strength=strength))
    kept = displacement(**fast, **given, model=Newmark(strength=strength))
    given[names[1]] *= factor if strength == "rate" else factor**-2
    scaled = displacement(**fast, **given, model=Newmark(strength=strength))
    assert scaled == pytest.approx(whole / factor**2, rel=1e-9)
    assert abs(kept * factor**2 / whole - 1.0) > 0.01


@KINDS
def test_the_frequency_is_solved_on_a_grid(strength: Any) -> None:
    """A grid is its cells one by one, also in chunks and with a displacement amplitude."""
    model = Newmark(strength=strength)
    drive: dict[str, Any] = {"frequency": [0.5, 1.0, 4.0], "displacement_amplitude": [0.05, 0.2]}
    for given in ({"frequency": [0.5, 1.0, 4.0], "amplitude": [3.0, 5.0]}, drive):
        axes = {"theta": [2.0, 5.0], "mu_s": 0.3, **PARTS[strength], **given}
        grid = sweep(**axes, model=model).permanent_displacement
        lazy = sweep(**axes, model=model, chunks={"theta": 1}).permanent_displacement
        np.testing.assert_array_equal(lazy.values, grid.values)
        for value in grid.stack(cell=grid.dims).transpose("cell"):
            names = (*grid.dims, "mu_s", *PARTS[strength])
            cell = {str(name): float(value[name]) for name in names}
            assert displacement(**cell, model=model) == float(value)


def test_many_cycles_at_residual_strength_are_as_one() -> None:
    """Once the slip exceeds D each cycle adds what it adds to the block of residual friction."""
    block: dict[str, Any] = BLOCK | {
        "residual_mu": 0.2,
        "weakening_distance": 0.02,
        "model": WEAKENING,
    }
    few = displacement(**block, excitation=Sine(cycles=3))
    many = displacement(**block, excitation=Sine(cycles=13))
    constant = BLOCK | {"mu_s": 0.2, "model": "newmark"}
    assert many - few == pytest.approx(
        displacement(**constant, excitation=Sine(cycles=10)), rel=1e-8
    )


# ------------------------------------------------------------------ flags


def test_a_block_that_may_not_stop_is_flagged_and_one_that_does_not_has_no_value() -> None:
    """Residual friction 0.05 on 4° (tan 4° = 0.07)."""
    block: dict[str, Any] = BLOCK | {
        "residual_mu": 0.05,
        "weakening_distance": 0.05,
        "amplitude": [1.0, 2.3, 4.0],
    }
    found = sweep(**block, model=WEAKENING, excitation=Sine(cycles=2))
    assert [Validity(int(code)) for code in found.validity] == [
        Validity(0),  # it does not slide
        Validity.MAY_NOT_STOP,
        Validity.NOT_AT_REST,
    ]
    assert 0.0 < found.permanent_displacement[1] < 0.05
    assert np.isnan(found.permanent_displacement[2])
    assert np.isnan(found.peak_relative_velocity[2])
    assert found.sliding_mode.values.tolist() == [0, 1, -1]
    safe = sweep(**block | {"residual_mu": 0.08}, model=WEAKENING)
    assert not safe.validity.any()


def test_a_block_that_is_too_weak_to_rest_slides_without_shaking() -> None:
    """It is held by the base's negative acceleration at the end of a record, and no longer."""
    shaking = record_of([0.0, 0.5, 0.5001, 1.5], [4.0, 4.0, -3.0, -3.0])
    block: dict[str, Any] = {
        "theta": 4.0,
        "mu_s": 0.3,
        "weakening_distance": 0.05,
        "excitation": shaking,
    }
    for residual_mu, flag in ((0.08, Validity(0)), (0.05, Validity.NOT_AT_REST)):
        found = sweep(**block, residual_mu=residual_mu, model=WEAKENING)
        assert Validity(found.validity.item()) == flag


def test_velocity_keeps_a_fast_block_sliding() -> None:
    """Friction at velocity is below tan θ: a slow block stops, a fast one does not."""
    pulse = record_of([0.0, 1.0], [2.5, 2.5])
    law: dict[str, Any] = {"fast_mu": 0.05, "rate_constant": 5.0}
    found = sweep(4.0, 0.3, excitation=pulse, time_scale=[0.02, 1.0], **law, model=RATE)
    assert [Validity(int(code)) for code in found.validity] == [
        Validity.MAY_NOT_STOP,
        Validity.NOT_AT_REST,
    ]
    assert found.permanent_displacement[0] > 0.0


# ------------------------------------------------------------------ parameters


def test_residual_angle_stands_for_its_tangent() -> None:
    given: dict[str, Any] = {"weakening_distance": 0.05, "model": WEAKENING}
    by_angle = sweep(**BLOCK, residual_phi=[8.0, 9.0], **given)
    by_tangent = sweep(**BLOCK, residual_mu=np.tan(np.radians([8.0, 9.0])), **given)
    np.testing.assert_array_equal(
        by_angle.permanent_displacement.values, by_tangent.permanent_displacement.values
    )
    assert by_angle.residual_mu.dims == ("residual_phi",)


def test_newmarks_displacement_beside_is_that_of_the_static_friction() -> None:
    names = ["permanent_displacement", "newmark_displacement", "yield_acceleration"]
    found = sweep(**BLOCK, **PARTS["weakening"], model=WEAKENING, variables=names)
    assert found.newmark_displacement.item() == displacement(**BLOCK, model="newmark")
    assert found.permanent_displacement > 1.5 * found.newmark_displacement
    assert found.yield_acceleration.item() == pytest.approx(G * tan(atan(0.3) - radians(4.0)))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"solver": "cycle"}, "solver = 'cycle': not allowed with strength = 'weakening'"),
        ({"residual_mu": None}, "residual_mu: must be given with strength = 'weakening'"),
        ({"weakening_distance": 0.0}, "weakening_distance = 0: must be"),
        ({"residual_phi": 9.0}, "residual_phi, residual_mu: must not both be given"),
        ({"fast_mu": 0.2}, r"fast_mu: only with model = Newmark\(strength='rate'\)"),
        (
            {"yield_acceleration": 1.0},
            "yield_acceleration: not allowed with strength = 'weakening'",
        ),
        ({"model": "newmark"}, r"residual_mu: only with model = Newmark\(strength='weakening'\)"),
        ({"model": "mendez"}, r"residual_mu: only with model = Newmark\(strength='weakening'\)"),
    ],
)
def test_what_does_not_go_together_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}") as error:
        sweep(**(BLOCK | PARTS["weakening"] | {"model": WEAKENING} | given))
    assert "\n" not in str(error.value)


def test_the_rate_constant_is_within_what_steps_resolve() -> None:
    given: dict[str, Any] = {"fast_mu": 0.2, "rate_constant": 1e6, "model": RATE}
    with pytest.raises(InputError, match=r"^rate_constant = 1000000: must be a finite number >= 0"):
        sweep(**BLOCK, **given)


def test_solver_auto_is_simpsons_rule() -> None:
    found = sweep(**BLOCK, **PARTS["rate"], model=RATE)
    assert (found.attrs["solver"], found.attrs["rule"]) == ("step", "simpson")
    assert found.attrs["strength"] == "rate"
    assert "friction" in found.attrs["friction_inputs"]
    assert slipsweep.Newmark(strength="rate") == RATE


# ------------------------------------------------------------------ studies


@KINDS
@WAYS
def test_a_history_ends_where_the_sweep_does(strength: Any, sliding: Any) -> None:
    """It goes on to the stop after the shaking; the slip it shows is that of the results."""
    pulse = record_of([0.0, 0.4], [6.0, 6.0])
    laws: dict[str, Any] = {
        "weakening": {"residual_mu": 0.1, "weakening_distance": 0.5},
        "rate": {"fast_mu": 0.1, "rate_constant": 5.0},
    }
    model = Newmark(sliding=sliding, strength=strength)
    history = slipsweep.simulate(0.0, 0.3, **laws[strength], excitation=pulse, model=model)
    displacements = history.relative_displacement
    assert displacements[-1] == pytest.approx(float(history.permanent_displacement), rel=1e-9)
    assert history.relative_velocity[-1] == 0.0
    assert history.time[-1] > 0.8
    velocities = history.relative_velocity
    areas = 0.5 * (velocities.values[1:] + velocities.values[:-1]) * np.diff(history.time)
    assert areas.sum() == pytest.approx(float(displacements[-1]), rel=0.1)


def test_samples_are_solved_at_each_frequency() -> None:
    """One draw of no width is the sweep's own cell; draws that do not stop exceed every length."""
    given: dict[str, Any] = {"frequency": [0.5, 2.0], "weakening_distance": 0.05}
    block = BLOCK | given | {"model": WEAKENING}
    exact = sweep(**block, residual_mu=0.2).permanent_displacement.values
    narrow = {"residual_mu": {"distribution": "uniform", "loc": 0.2, "scale": 1e-9}}
    found = slipsweep.sample(**block, uncertain=narrow, samples=16, quantiles=[0.5])
    np.testing.assert_allclose(found.displacement_quantile.values[:, 0], exact, rtol=1e-6)
    weak = {"residual_mu": {"distribution": "uniform", "loc": 0.03, "scale": 0.02}}
    endless = slipsweep.sample(**block, uncertain=weak, samples=16, thresholds=[1e3])
    assert (endless.exceedance_probability == 1.0).all()


def test_limit_amplitudes_are_those_of_the_sweep() -> None:
    given: dict[str, Any] = {**PARTS["weakening"], "model": WEAKENING}
    limit = slipsweep.limit_amplitude(0.1, 4.0, 0.3, [1.0, 2.0], **given)
    for frequency, amplitude in zip([1.0, 2.0], limit.limit_amplitude.values, strict=True):
        block = {"theta": 4.0, "mu_s": 0.3, "amplitude": float(amplitude), "frequency": frequency}
        assert displacement(**block, **given) == pytest.approx(0.1, rel=1e-9)


def test_a_limit_is_where_the_block_no_longer_stops() -> None:
    """On 10°, with 9° at residual strength, 50 mm is reached by the first block that slides on."""
    given: dict[str, Any] = {"phi": 14.0, "residual_phi": 9.0, "weakening_distance": 0.05}
    block: dict[str, Any] = {"theta": 10.0, "frequency": 2.0, **given, "model": WEAKENING}
    limits = slipsweep.limit_amplitude([0.001, 0.05], **block)
    small, endless = limits.limit_amplitude.values
    assert displacement(**block, amplitude=small) == pytest.approx(0.001, rel=1e-9)
    assert limits.limit_status.values.tolist() == [0, 2]
    before = sweep(**block, amplitude=endless * (1.0 - 1e-9))
    assert before.permanent_displacement.item() < 0.05
    assert int(sweep(**block, amplitude=endless).validity) == Validity.NOT_AT_REST


def test_required_strengths_are_of_constant_strength() -> None:
    with pytest.raises(InputError, match=r"^strength = 'weakening': not allowed for a required"):
        slipsweep.required_strength(0.05, 3.0, 1.0, theta=5.0, of="phi", model=WEAKENING)
