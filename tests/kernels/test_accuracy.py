"""How near the solvers come to the reference: every case of cases.csv, random cells of each regime, orders."""

from collections.abc import Sequence
from itertools import groupby
from math import ceil, isnan, log, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

import slipsweep
from slipsweep.model.variables import VALUELESS, Validity
from tests.support import reference, strategies
from tests.support.cases import Case, choices, read_cases, solve
from tests.support.flag_definitions import acceleration_ratio, coulomb, remarks

CASES = [case for case in read_cases() if not case.uplift]

#: Regimes in which every piece of the motion is smooth over many steps.
SMOOTH = ("stick_slip", "continuous", "measured_yield", "newmark", "integrate", "level_plane", "mode_limit")
HARD = ("grazing", "near_failure", "sharp_decay", "restick", "literal", "given_friction")

ORDERS = {"rectangle": 1, "trapezoid": 2, "simpson": 4}
RULES = pytest.mark.parametrize("rule", ORDERS)


def misses(
    cases: Sequence[Case],
    found: dict[int, tuple[float, float, int, int]],
    relative: float,
    absolute: float,
    quantities: Sequence[str] = ("displacement", "peak velocity"),
) -> list[str]:
    """The cases beyond relative * |value| + absolute * scale, worst first."""
    wrong = []
    for case in cases:
        for quantity, value, expected, scale in (
            ("displacement", found[case.case][0], float(case.permanent_displacement), case.displacement_scale),
            ("peak velocity", found[case.case][1], float(case.peak_relative_velocity), case.velocity_scale),
        ):
            if quantity not in quantities:
                continue
            times = abs(value - expected) / (relative * abs(expected) + absolute * scale)
            if not times <= 1:
                wrong.append(
                    (times, f"case {case} {quantity}: {value!r}, not {expected!r} ({times:.1e} times allowed)")
                )
    return [text for _, text in sorted(wrong, reverse=True)]


# Cases of cases.csv


def test_cycle_solver_on_every_case() -> None:
    """1e-11 |u| + 1e-12 A/omega^2, peak velocity likewise."""
    assert not misses(CASES, solve(CASES, solver="cycle"), 1e-11, 1e-12)


def test_automatic_solver_is_the_exact_one() -> None:
    assert not misses(CASES, solve(CASES), 1e-11, 1e-12)


@pytest.mark.parametrize("rule", ["trapezoid", "simpson"])
def test_step_solver_on_every_case(rule: str) -> None:
    """8192 steps a cycle: 2e-3 |u| + 1e-12 A/omega^2, hard cases included."""
    found = solve(CASES, solver="step", rule=rule, steps_per_cycle=8192)
    assert not misses(CASES, found, 2e-3, 1e-12)


def test_trapezoid_on_smooth_cases() -> None:
    """Second order: the step squared, 6e-7, times 20."""
    smooth = [case for case in CASES if case.category in SMOOTH]
    found = solve(smooth, solver="step", rule="trapezoid", steps_per_cycle=8192)
    assert not misses(smooth, found, 20 * (2 * np.pi / 8192) ** 2, 1e-12)


def test_simpson_on_smooth_cases() -> None:
    """Fourth order: with 1024 steps 1.4e-9, times 100."""
    smooth = [case for case in CASES if case.category in SMOOTH]
    found = solve(smooth, solver="step", rule="simpson", steps_per_cycle=1024)
    assert not misses(smooth, found, 100 * (2 * np.pi / 1024) ** 4, 1e-11)


def test_rectangle_errs_by_steps_of_the_pulse() -> None:
    """First order: relative error at most twice the step over the pulse's own length, W/V of the case."""
    found = solve(CASES, solver="step", rule="rectangle", steps_per_cycle=8192)
    wrong = []
    for case in CASES:
        expected = float(case.permanent_displacement)
        if expected == 0:
            continue
        length = (
            abs(expected)
            / case.displacement_scale
            / (float(case.peak_relative_velocity) / case.velocity_scale * case.cycles)
        )
        allowed = 2 * (2 * np.pi / 8192) / min(length, 1.0)
        error = abs(found[case.case][0] / expected - 1)
        if not error <= allowed:
            wrong.append(f"case {case}: relative error {error:.1e}, allowed {allowed:.1e}")
    assert not wrong


@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_modes_and_flags_on_every_case(solver: str) -> None:
    found = solve(CASES, solver=solver)
    for case in CASES:
        *_, mode, validity = found[case.case]
        expected = Validity(0)
        if case.sliding_mode == 1:
            expected |= Validity.YIELD_GOVERNS * (case.eq4_below_yield and case.model != "newmark")
            expected |= Validity.NOT_RECOUPLED * (not case.recoupled)
        if case.sliding_mode > 0:
            given = {"yield_acceleration": coulomb(case.theta, case.mu_s, case.g), **dict(case.given)}
            expected |= remarks(
                acceleration_ratio(case.theta, case.mu_s, case.amplitude, given["yield_acceleration"], case.g),
                float(case.permanent_displacement), decay_rate=given.get("decay_rate"), delta_mu=given.get("delta_mu"),
                newmark=case.model == "newmark", yield_governs=case.eq4_below_yield,
            )  # fmt: skip
        assert mode == case.sliding_mode, f"sliding mode of case {case}"
        assert Validity(validity) == expected, f"validity of case {case}"


@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_case_beyond_uplift_has_no_value(solver: str) -> None:
    """cases.csv gives a value to one cell with A tan(theta) = 1.14 g, where the model has none."""
    (case,) = (case for case in read_cases() if case.uplift)
    ((displacement, velocity, mode, validity),) = solve([case], solver=solver).values()
    assert isnan(displacement)
    assert isnan(velocity)
    assert (mode, Validity(validity)) == (-1, Validity.UPLIFT)


# Orders of convergence


def relative_errors(cases: Sequence[Case], rule: str, steps: Sequence[int]) -> np.ndarray:
    """|u/exact - 1|, shape (steps, cases)."""
    exact = np.array([float(case.permanent_displacement) for case in cases])
    errors = []
    for count in steps:
        found = solve(cases, solver="step", rule=rule, steps_per_cycle=count)
        errors.append([abs(found[case.case][0] / u - 1) for case, u in zip(cases, exact, strict=True)])
    return np.array(errors)


def median_order(cases: Sequence[Case], rule: str) -> float:
    """Median of the slopes fitted case by case over several steps, since the error varies with where events fall."""
    steps = [96, 120, 152, 192, 240, 304, 384, 480, 608, 768]
    errors = np.maximum(relative_errors(cases, rule, steps), 1e-16)
    return float(np.median([-np.polyfit(np.log(steps), np.log(error), 1)[0] for error in errors.T]))


@pytest.mark.parametrize("rule", ["trapezoid", "simpson"])
@pytest.mark.parametrize("category", SMOOTH)
def test_order_on_smooth_cases(rule: str, category: str) -> None:
    order = median_order([case for case in CASES if case.category == category], rule)
    assert abs(order - ORDERS[rule]) < 0.1 * ORDERS[rule], f"{rule}, {category}: observed order {order:.2f}"


@pytest.mark.parametrize("category", SMOOTH)
def test_order_of_the_rectangle_on_smooth_cases(category: str) -> None:
    """Its first-order error in u comes from a jump of v' at the onset, which only the continuous mode has."""
    cases = [case for case in CASES if case.category == category]
    order = median_order(cases, "rectangle")
    assert order > 0.9, f"rectangle, {category}: observed order {order:.2f}"
    if category == "continuous":
        assert order < 1.1, f"rectangle, {category}: observed order {order:.2f}"


#: Steps a cycle that resolve what is no sharp decay.
LEAST_STEPS = 256


@RULES
def test_order_on_hard_cases_is_at_least_one(rule: str) -> None:
    """Largest error over four fine steps against that over four coarse ones, 16 times as long.

    The coarse ones resolve the decay of the friction, of which the layer is g/(lambda A) wide; where that takes
    thousands of them, they are 4 times as long as the fine ones.
    """
    hard = [
        case
        for case in CASES
        # pulses of two coarse steps at least: shorter ones lie within a step
        if case.category in HARD and float(case.permanent_displacement) > 1e-8 * case.displacement_scale
    ]
    assert len(hard) > 40
    slow = []
    for start, together in groupby(sorted(hard, key=resolving_steps), resolving_steps):
        cases = list(together)
        times = 16 if start == LEAST_STEPS else 4
        coarse = [start, start // 6 * 7 // 4 * 4, start // 6 * 8 // 4 * 4, start // 6 * 9 // 4 * 4]
        before = relative_errors(cases, rule, coarse).max(axis=0)
        after = relative_errors(cases, rule, [times * steps for steps in coarse]).max(axis=0)
        slow += [
            f"case {case}: error {b:.1e} to {a:.1e}, order {log(b / a) / log(times):.2f}"
            for case, b, a in zip(cases, before, after, strict=True)
            if a > 1e-11 and a > b / times**0.9
        ]
    assert not slow, f"{rule}: below first order"


def resolving_steps(case: Case) -> int:
    """Steps a cycle: `LEAST_STEPS`, or as many as give four to a decay of the friction by e."""
    decay = dict(case.given).get("decay_rate", 0.0) * case.amplitude / 9.81
    return max(LEAST_STEPS, 4 * ceil(8 * pi * decay / 4))


# Random cells


REGIMES: dict[str, SearchStrategy[strategies.Cell]] = {
    "stuck": strategies.stuck(),
    "stick_slip": strategies.stick_slip(),
    "continuous": strategies.continuous(),
    "newmark": strategies.newmark(),
    "given_friction": strategies.given_friction(),
}


@pytest.mark.parametrize("regime", REGIMES)
def test_held_back_cells(regime: str) -> None:
    """Random cells of each regime and option against the reference: cycle to 1e-11, trapezoid to 2e-3."""

    @strategies.reproducible
    @given(cell=REGIMES[regime], options=strategies.model_options)
    def compare(cell: strategies.Cell, options: dict[str, str]) -> None:
        cell = {**cell, **options}
        expected = reference.solve(**cell)
        second = strategies.phase_scale(cell)
        exact = slipsweep.sweep(**choices(**cell, solver="cycle"))
        stepped = slipsweep.sweep(**choices(**cell, solver="step", rule="trapezoid", steps_per_cycle=8192))
        for result, solver, tolerance in ((exact, "cycle", 1e-11), (stepped, "step", 2e-3)):
            assert int(result.sliding_mode) == expected.sliding_mode, f"{solver}: sliding mode"
            assert Validity(int(result.validity)) == Validity(expected.validity), f"{solver}: validity"
            if expected.validity & VALUELESS:
                assert isnan(float(result.permanent_displacement)), f"{solver}: no value"
                continue
            # in continuous mode u is a difference of larger numbers, and v may hardly exceed zero
            cancelling = 1e-5 * cell["cycles"] ** 2 if solver == "step" and expected.sliding_mode == 2 else 1e-12
            for name, scale in (
                ("permanent_displacement", cell["amplitude"] * second**2),
                ("peak_relative_velocity", cell["amplitude"] * second),
            ):
                value, right = float(result[name]), float(getattr(expected, name))
                allowed = tolerance * abs(right) + cancelling * scale
                assert abs(value - right) <= allowed, f"{solver}: {name} {value!r}, not {right!r}"

    compare()


@strategies.reproducible
@given(
    cell=strategies.stick_slip() | strategies.newmark() | strategies.continuous() | strategies.given_friction(),
    cycles=st.sampled_from([1, 2, 3, 17, 1000, 10**6]),
)
def test_many_cycles(cell: strategies.Cell, cycles: int) -> None:
    """A closed form however many cycles: 1e-11 at a million of them."""
    cell = {**cell, "cycles": cycles}
    expected = reference.solve(**cell)
    result = slipsweep.sweep(**choices(**cell, solver="cycle"))
    scale = cell["amplitude"] * strategies.phase_scale(cell) ** 2
    growth = cycles**2 if expected.sliding_mode == 2 else cycles
    right = float(expected.permanent_displacement)
    assert abs(float(result.permanent_displacement) - right) <= 1e-11 * abs(right) + 1e-12 * growth * scale


@pytest.mark.parametrize(
    ("theta", "mu_s", "amplitude", "cycles"), [(10.15, 0.2, 1.223, 4), (10.15, 0.2, 1.223, 6), (13.22, 0.257, 1.822, 7)]
)
def test_pulses_that_lose_speed(theta: float, mu_s: float, amplitude: float, cycles: int) -> None:
    """At rest the block sticks beyond Üg = Üy; carried on, it slides through ever more slowly, every third or
    fourth pulse begins again, and W of the cycles repeats."""
    cell: strategies.Cell = {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "frequency": 1.0, "cycles": cycles}
    expected = reference.solve(**cell)
    result = slipsweep.sweep(**choices(**cell, solver="cycle"))
    for name in ("permanent_displacement", "peak_relative_velocity"):
        right = float(getattr(expected, name))
        assert abs(float(result[name]) / right - 1) <= 1e-13, name
    assert int(result.validity) & Validity.NOT_RECOUPLED


def test_pulses_that_stop_anew() -> None:
    """Carried on, the block stops between t1 and Üg = b and restarts at once, elsewhere in every pulse."""
    cells = [(10.51, 0.2, 0.661), (11.53, 0.214, 1.057), (13.2, 0.243, 1.114), (16.6, 0.3, 1.625), (19.7, 0.371, 2.305)]
    for theta, mu_s, amplitude in cells:
        cell: strategies.Cell = {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "frequency": 1.0}
        grown = []
        for cycles in range(1, 9):
            expected = reference.solve(**cell, cycles=cycles)
            result = slipsweep.sweep(**choices(**cell, cycles=cycles, solver="cycle"))
            for name in ("permanent_displacement", "peak_relative_velocity"):
                right = float(getattr(expected, name))
                assert abs(float(result[name]) / right - 1) <= 1e-12, f"{name} of {cell}, {cycles} cycles"
            grown.append(float(result.permanent_displacement))
        assert np.ptp(np.diff(grown)) > 0.1 * grown[0], f"cycles of {cell} are alike"


@pytest.mark.parametrize("excitation", [slipsweep.Sine(cycles=20), slipsweep.Cosine(cycles=20)])
def test_pulses_that_stop_anew_as_event_by_event(excitation: Any) -> None:
    """A sweep follows them by what its lanes know of a pulse, a time history from event to event."""
    block: dict[str, Any] = {"theta": 10.508, "mu_s": 0.2, "frequency": 1.0}
    amplitude = np.linspace(0.055, 0.12, 131) * strategies.G
    swept = slipsweep.sweep(**block, amplitude=amplitude, excitation=excitation)
    assert (swept.validity.values & Validity.NOT_RECOUPLED).any()
    for value, u in zip(amplitude, swept.permanent_displacement.values.ravel(), strict=True):
        history = slipsweep.simulate(**block, amplitude=value, excitation=excitation)
        assert abs(u / float(history.relative_displacement[-1]) - 1) <= 1e-11


@pytest.mark.parametrize("cycles", [1, 2, 10])
@pytest.mark.parametrize("delta_mu", [0.0, 0.02, 0.3, 6.0])
def test_peaks_of_continuous_sliding(delta_mu: float, cycles: int) -> None:
    """Whether the velocity turns on both half cycles, on one or on none; from friction that hardly falls to e^-7."""
    theta, mu_s, amplitude = 3.0, 0.3, 1.9 * strategies.G
    decay_rate = np.array([0.02, 0.1, 0.15, 0.3, 0.8, 2.0, 3.1, 3.5, 4.5, 5.5, 7.0]) * strategies.G / amplitude
    cell: strategies.Cell = {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "delta_mu": delta_mu}
    cell |= {"frequency": 1.0, "cycles": cycles}
    swept = slipsweep.sweep(**choices(**cell, decay_rate=decay_rate))
    assert (swept.sliding_mode == 2).all()
    for rate, velocity in zip(decay_rate, swept.peak_relative_velocity.values.ravel(), strict=True):
        right = float(reference.solve(**cell, decay_rate=rate).peak_relative_velocity)
        assert abs(velocity - right) <= 1e-13 * (abs(right) + cycles * amplitude / (2 * pi)), f"lambda {rate}"


@strategies.reproducible
@given(
    cell=strategies.given_friction(),
    exponent=st.floats(0.0, 6.0),
    options=strategies.model_options,
)
def test_sharp_decay(cell: strategies.Cell, exponent: float, options: dict[str, str]) -> None:
    """lambda A / g up to 1e6: friction gone in a layer of 1e-6 of phase."""
    cell = {**cell, **options, "decay_rate": 10**exponent * strategies.G / cell["amplitude"]}
    expected = reference.solve(**cell)
    result = slipsweep.sweep(**choices(**cell, solver="cycle"))
    assert Validity(int(result.validity)) == Validity(expected.validity), "validity"
    assume(not expected.validity & VALUELESS)
    scale = cell["amplitude"] * strategies.phase_scale(cell) ** 2
    right = float(expected.permanent_displacement)
    assert abs(float(result.permanent_displacement) - right) <= 1e-11 * abs(right) + 1e-12 * cell["cycles"] ** 2 * scale


@strategies.reproducible
@given(
    cell=strategies.stick_slip() | strategies.newmark(),
    exponent=st.floats(1.0, 15.0),
)
def test_just_above_yield(cell: strategies.Cell, exponent: float) -> None:
    """A = Uy (1 + e), Uy given: an ulp of A moves u by 2 ulp / e, and no error is a hundred times that."""
    onset = cell["amplitude"]
    amplitude = onset * (1 + 10**-exponent)
    excess = (amplitude - onset) / onset
    cell = {**cell, "yield_acceleration": onset, "amplitude": amplitude}
    expected = reference.solve(**cell)
    assume(expected.sliding_mode == 1)
    result = slipsweep.sweep(**choices(**cell, solver="cycle"))
    right = float(expected.permanent_displacement)
    conditioning = 2 * np.finfo(float).eps / excess
    scale = amplitude * strategies.phase_scale(cell) ** 2
    if right > 1e-3 * excess**2 * scale:  # elsewhere the block sticks until past yield
        assert abs(float(result.permanent_displacement) / right - 1) <= 100 * conditioning, f"excess {excess:.1e}"
    else:
        assert abs(float(result.permanent_displacement) - right) <= 1e-12 * scale
