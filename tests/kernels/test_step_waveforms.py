"""The step solver on any waveform: closed forms, orders across jumps and kinks, agreement with the cycle solver."""

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.errors import InputError
from slipsweep.grid import resources
from tests.support.cases import choices

ORDERS = {"rectangle": 1, "trapezoid": 2, "simpson": 4}
RULES = pytest.mark.parametrize("rule", ORDERS)

#: Several maxima in a pulse, no symmetry, a beginning above zero.
HARMONICS: dict[str, Any] = {"waveform": "harmonics", "harmonics": "1:1:0,0.6:2:40,0.35:5:100"}
WAVES: dict[str, dict[str, Any]] = {
    "sine": {},
    "cosine": {"waveform": "cosine"},
    "triangle": {"waveform": "triangle"},
    "square": {"waveform": "square"},
    "harmonics": HARMONICS,
    "ramped sine": {"ramp_in": 1.5, "ramp_out": 1.0},
    "ramped triangle": {"waveform": "triangle", "ramp_in": 2.25, "ramp_out": 0.5},
    "ramped square": {"waveform": "square", "ramp_in": 1.25},
    "ramped harmonics": {**HARMONICS, "ramp_in": 1.0, "ramp_out": 2.0},
}
EVERY_WAVE = pytest.mark.parametrize("wave", WAVES)

#: Stick-slip that recouples and that does not, sliding with v carried over, continuous; a plane nearly level.
CELLS = {
    "theta": [5.0, 5.0, 5.0, 18.0, 18.0, 18.0, 6.0, 6.0, 0.01],
    "mu_s": [0.38, 0.38, 0.38, 0.34, 0.34, 0.34, 0.38, 0.38, 0.4],
    "amplitude": [3.1, 3.8, 4.6, 0.8, 1.4, 2.1, 6.8, 8.5, 9.0],
}
OPTIONS: tuple[dict[str, Any], ...] = ({}, {"recoupling": "integrate"}, {"rise": "literal"}, {"model": "newmark"})


def solve(wave: str, cycles: int = 5, **options: Any) -> xr.Dataset:
    """All cells under all options; dimensions `options` and `cell`."""
    columns: dict[str, Any] = {name: xr.DataArray(values, dims="cell") for name, values in CELLS.items()}
    runs = [
        slipsweep.sweep(**choices(**columns, frequency=1 / (2 * pi), cycles=cycles, **WAVES[wave], **given, **options))
        for given in OPTIONS
    ]
    return xr.concat(runs, "options", combine_attrs="drop")


def errors(wave: str, rule: str, counts: list[int]) -> np.ndarray:
    """Worst relative error of the displacement over a few step counts, against the cycle solver; of cells that move."""
    exact = solve(wave, solver="cycle").permanent_displacement
    moves = (exact > 0).values
    found = [solve(wave, solver="step", rule=rule, steps_per_cycle=count).permanent_displacement for count in counts]
    return np.max([np.abs(run / exact - 1).values[moves] for run in found], axis=0)


def newmark(wave: str, rule: str, steps: int, **options: Any) -> float:
    """W of a Newmark block on the level with A = 2 and Üy = 1."""
    stepping = {"solver": "step", "rule": rule, "steps_per_cycle": steps}
    block = {"theta": 0.0, "mu_s": 0.1, "amplitude": 2.0, "yield_acceleration": 1.0, "frequency": 1 / (2 * pi)}
    result = slipsweep.sweep(**choices(**block, model="newmark", cycles=3, waveform=wave, **stepping, **options))
    return float(result.permanent_displacement)


@pytest.mark.parametrize("steps", [None, 64, 1024])
@EVERY_WAVE
def test_a_result_alone_is_the_one_among_all(wave: str, steps: int | None) -> None:
    """What is not asked for is not computed: where V turns is found for the largest V only."""
    given = {"solver": "cycle"} if steps is None else {"solver": "step", "rule": "simpson", "steps_per_cycle": steps}
    every = solve(wave, **given)
    assert {1, 2} <= {*every.sliding_mode.values.flat}
    for name in ("permanent_displacement", "peak_relative_velocity"):
        alone = solve(wave, **given, variables=[name])
        assert list(alone.data_vars) == [name]
        np.testing.assert_allclose(alone[name], every[name], rtol=1e-11)


@RULES
def test_square_wave_under_newmark(rule: str) -> None:
    """Rate (A − Üy) for π, then −(A + Üy) to the stop: constant, so that every rule is exact with any step."""
    exact = 3 * (pi**2 / 2 + pi**2 / (2 * 3))
    assert newmark("square", rule, 8) == pytest.approx(exact, rel=1e-14)
    assert newmark("square", rule, 1000) == pytest.approx(exact, rel=1e-13)


def test_triangle_wave_under_newmark() -> None:
    """From t1 on the rate rises for L = π/4 with s = 2A/π, falls as fast, and V is 0 √2 L after the rate was."""
    exact = 3 * (4 / pi) * (pi / 4) ** 3 * (1 + 2 * sqrt(2) / 3)
    for rule in ("trapezoid", "simpson"):
        assert newmark("triangle", rule, 8) == pytest.approx(exact, rel=1e-12), f"{rule} is exact on straight lines"
    coarse, fine = (abs(newmark("triangle", "rectangle", steps) / exact - 1) for steps in (100, 1600))
    assert 0 < fine < coarse / 12, "first order at least: errors of the rise and of the fall cancel in part"


def test_no_ramp_is_no_ramp() -> None:
    """A ramp over the first cycle leaves the later ones as they are: 9 cycles more, 9 plain cycles more."""
    options: dict[str, Any] = {"solver": "step", "steps_per_cycle": 256, "theta": 5.0, "mu_s": 0.38, "amplitude": 4.0}
    options |= {"frequency": 1.0, "waveform": "triangle"}
    plain = slipsweep.sweep(**choices(cycles=9, **options)).permanent_displacement
    short, long = (
        slipsweep.sweep(**choices(cycles=cycles, ramp_in=1.0, **options)).permanent_displacement for cycles in (3, 12)
    )
    assert float(long - short) == pytest.approx(float(plain), rel=1e-12)


@RULES
@EVERY_WAVE
def test_order_across_jumps_and_kinks(wave: str, rule: str) -> None:
    """More steps: the median cell gains by the rule's order, every cell by first order at least."""
    # errors of first order change their sign here and there: far enough apart that this does not count
    counts, times = ([256, 304, 376], 16) if rule == "rectangle" else ([96, 120, 152], 4)
    before, after = errors(wave, rule, counts), errors(wave, rule, [times * count for count in counts])
    assert before.size >= 20
    rounding = 1e-11
    assert (after <= np.maximum(before / times**0.75, rounding)).all(), "first order in every cell"
    seen = after > rounding
    if seen.sum() >= 5:
        gained = np.log(before[seen] / after[seen]) / np.log(times)
        assert np.median(gained) > ORDERS[rule] - 0.3
    else:
        assert rule == "simpson" or wave in ("square", "triangle"), "only these are exact"


@EVERY_WAVE
def test_finest_steps_reach_the_cycle_solver(wave: str) -> None:
    """Simpson's rule with 2048 steps, 1000 cycles: displacement and peak velocity to 1e-9, modes and flags alike."""
    exact = solve(wave, 1000, solver="cycle")
    found = solve(wave, 1000, solver="step", rule="simpson", steps_per_cycle=2048)
    for name in ("sliding_mode", "validity"):
        np.testing.assert_array_equal(found[name], exact[name], err_msg=name)
    for name in ("permanent_displacement", "peak_relative_velocity"):
        np.testing.assert_allclose(found[name], exact[name], rtol=1e-9, atol=1e-12, err_msg=name)


@EVERY_WAVE
def test_cells_do_not_depend_on_their_neighbours(wave: str) -> None:
    """Lanes of other cells beside it change no bit of a cell."""
    options: dict[str, Any] = {"frequency": 1.0, "cycles": 5, "solver": "step", "steps_per_cycle": 64, **WAVES[wave]}
    whole = slipsweep.sweep(**choices(theta=18.0, mu_s=0.34, amplitude=np.linspace(0.3, 3.0, 60), **options))
    for i in (0, 17, 59):
        alone = slipsweep.sweep(**choices(theta=18.0, mu_s=0.34, amplitude=whole.amplitude.values[i], **options))
        assert float(alone.permanent_displacement) == float(whole.permanent_displacement[i])


#: Waves whose slide runs past the end of a cycle into the next one; with a ramp, one that enters the repeated cycle.
RUNS_OVER: tuple[dict[str, Any], ...] = (
    {"harmonics": "1:1:180"},
    {"harmonics": "1:1:180", "ramp_in": 1.5},
    {"harmonics": "1:1:180", "ramp_in": 2.0, "ramp_out": 1.0},
    {"harmonics": "1:1:200,0.3:3:0"},
    {"harmonics": "1:2:180,0.4:5:90"},
)


@pytest.mark.parametrize("given", OPTIONS, ids=str)
@pytest.mark.parametrize("wave", RUNS_OVER, ids=str)
def test_slides_that_run_past_the_end_of_a_cycle(wave: dict[str, Any], given: dict[str, Any]) -> None:
    """A cycle that does not begin at rest does not stand for those that begin otherwise."""
    block: dict[str, Any] = {"theta": [0.0, 4.0], "mu_s": 0.57, "yield_acceleration": 0.73, "frequency": 1.0}
    block |= {"amplitude": [1.7, 2.6, 3.4], "waveform": "harmonics", "cycles": 10}
    exact = slipsweep.sweep(**choices(**block, **wave, **given, solver="cycle"))
    found = slipsweep.sweep(**choices(**block, **wave, **given, solver="step", rule="simpson", steps_per_cycle=2048))
    np.testing.assert_array_equal(found.validity, exact.validity)
    for name in ("permanent_displacement", "peak_relative_velocity"):
        np.testing.assert_allclose(found[name], exact[name], rtol=1e-7, err_msg=name)


@RULES
def test_a_slide_stops_before_another_positive_wave(rule: str) -> None:
    """With b below Üy (literal rise) held on, a wave that stays below Üy would take V up again after the stop."""
    block: dict[str, Any] = {"theta": 8.77, "mu_s": 0.78, "amplitude": 1.06, "frequency": 1.0, "g": 1.62}
    block |= {"waveform": "harmonics", "harmonics": "0.172:1:180,0.105:2:90,-0.316:4:248.8"}
    block |= {"rise": "literal", "recoupling": "integrate"}
    once, exact = (slipsweep.sweep(**choices(**block, cycles=cycles, solver="cycle")) for cycles in (1, 6))
    assert float(exact.permanent_displacement) == pytest.approx(6 * float(once.permanent_displacement), rel=1e-12)
    for steps in (1024, 4096):
        found = slipsweep.sweep(**choices(**block, cycles=6, solver="step", rule=rule, steps_per_cycle=steps))
        assert int(found.validity) == int(exact.validity)
        for name in ("permanent_displacement", "peak_relative_velocity"):
            allowed = 4 * (2 * pi / steps) ** ORDERS[rule]
            np.testing.assert_allclose(found[name], exact[name], rtol=allowed, err_msg=name)


@pytest.mark.parametrize("delta_mu", [0.0, 0.1])
@pytest.mark.parametrize("waveform", ["sine", "triangle"])
def test_velocity_that_turns_twice_on_a_quarter_cycle(waveform: str, delta_mu: float) -> None:
    """On a plane steeper than φs, D may be negative at both ends of the rise and positive between them."""
    block: dict[str, Any] = {"theta": 40.0, "mu_s": 0.3, "yield_acceleration": 0.5, "frequency": 1.0, "cycles": 4}
    block |= {"amplitude": np.linspace(3.0, 11.0, 9), "decay_rate": [3.0, 10.0, 40.0], "delta_mu": delta_mu}
    exact = slipsweep.sweep(**choices(**block, waveform=waveform, solver="cycle"))
    found = slipsweep.sweep(**choices(**block, waveform=waveform, solver="step", rule="simpson", steps_per_cycle=4096))
    assert (exact.sliding_mode == slipsweep.SlidingMode.CONTINUOUS).all()
    for name in ("permanent_displacement", "peak_relative_velocity"):
        np.testing.assert_allclose(found[name], exact[name], rtol=1e-8, err_msg=name)


@pytest.mark.parametrize("rise", ["monotone", "literal"])
def test_responses_that_bend_on_the_rise(rise: str) -> None:
    """With λ < 2 tan θ Eq. 4 is concave up to the inflection: it may exceed b, or meet Üg, between two steps only."""
    rng = np.random.default_rng(1)
    count = 20_000
    theta, mu_s = rng.uniform(5.0, 45.0, count), rng.uniform(0.2, 2.0, count)
    tangent = np.tan(np.radians(theta))
    columns = {
        "theta": theta,
        "mu_s": mu_s,
        "decay_rate": 2.0 * tangent * rng.uniform(0.05, 1.0, count),
        "delta_mu": rng.choice([0.0, 0.1, 0.3, 0.6], count),
        "yield_acceleration": 10.0 ** rng.uniform(-1.0, 1.0, count),
        "amplitude": 9.81 / tangent * rng.uniform(0.05, 1.0, count),
    }
    cells: dict[str, Any] = {name: xr.DataArray(values, dims="cell") for name, values in columns.items()}
    cells |= {"frequency": 1.0, "rise": rise}
    exact = slipsweep.sweep(**choices(**cells, solver="cycle"))
    found = slipsweep.sweep(**choices(**cells, solver="step", rule="simpson", steps_per_cycle=1024))
    slides = (exact.sliding_mode == slipsweep.SlidingMode.STICK_SLIP) & (exact.permanent_displacement > 0.0)
    assert slides.sum() > 5_000
    # seen: 2e-4 where E meets b at a grazing angle
    np.testing.assert_allclose(
        found.permanent_displacement[slides], exact.permanent_displacement[slides], rtol=1e-3, atol=0.0
    )


@pytest.mark.parametrize("steps", [8, 1000, 4000])
@RULES
def test_a_slide_that_begins_at_the_end_of_a_piece(rule: str, steps: int) -> None:
    """Where a ramp ends, one step of the piece behind it becomes many: they grow from the little that was left."""
    block: dict[str, Any] = {"theta": 0.0, "mu_s": 0.9, "amplitude": 5.0, "frequency": 1.0, "model": "newmark"}
    block |= {"waveform": "triangle", "ramp_in": 0.1, "cycles": 2}
    for left in (1e-9, 1e-10, 1e-11, 1e-12):
        block["yield_acceleration"] = 2.0 * (1 - left)  # 2 m/s² at the ramp's end
        exact = slipsweep.sweep(**choices(**block, solver="cycle"))
        found = slipsweep.sweep(**choices(**block, solver="step", rule=rule, steps_per_cycle=steps))
        error = abs(float(found.permanent_displacement / exact.permanent_displacement) - 1)
        assert error <= (3 / steps if rule == "rectangle" else 1e-13), left


def test_a_table_of_steps_that_memory_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every cycle of a ramp has steps of its own."""
    monkeypatch.setattr(resources, "available_memory", lambda: 2 * 10**9)
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4, "amplitude": 4.0, "frequency": 1.0, "cycles": 200}
    block |= {"ramp_in": 100.0, "ramp_out": 100.0, "solver": "step", "steps_per_cycle": 2**24}
    with pytest.raises(InputError, match="steps_per_cycle = 16777216: takes 108 GB, but 2 GB of memory is free"):
        slipsweep.sweep(**choices(**block))
