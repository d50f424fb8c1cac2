"""The cycle solver against 30-digit solutions: tables of cases, hard cases, and random cells of
every regime.
"""

from math import isnan, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import slipsweep
from slipsweep.model.variables import VALUELESS, Validity
from tests.support import reference, strategies
from tests.support.cases import Case, choices, read_cases, solve
from tests.support.hard_cells import CATEGORIES, Category, conditioning, dtype_of

CASES = [case for case in read_cases() if not case.uplift]
WAVE_CASES = read_cases("waveforms")
HARD_CASES = read_cases("hard_cases")
MOTION = ("permanent_displacement", "peak_relative_velocity")


def assert_solved(cases: list[Case], validities: dict[int, int], **solver: Any) -> None:
    """1e-11 |u| + 1e-12 A/omega^2, peak velocity likewise; mode and flags."""
    found = solve(cases, **solver)
    for case in cases:
        mode, validity = found[case.case][2:]
        assert (mode, Validity(validity)) == (case.sliding_mode, Validity(validities[case.case])), (
            f"case {case}"
        )
        assert mode < 0 or not (wrong := case.missed(found[case.case], 1e-11)), wrong


@pytest.mark.parametrize("category", sorted({case.category for case in CASES}))
def test_every_case(category: str) -> None:
    cases = [case for case in CASES if case.category == category]
    validities = {case.case: reference.solve(**case.arguments).validity for case in cases}
    assert_solved(cases, validities)


def test_every_case_of_every_waveform() -> None:
    assert_solved(WAVE_CASES, {case.case: case.validity for case in WAVE_CASES}, solver="cycle")


def test_just_above_yield_keeps_its_digits() -> None:
    """Relative to u itself: an ulp of A moves it by 3 ulp / excess at most."""
    cases = [
        case
        for case in WAVE_CASES
        if case.category == "just_above_yield" and case.sliding_mode == 1
    ]
    found = solve(cases)
    moved = 0
    for case in cases:
        right = float(case.permanent_displacement)
        assert case.yield_acceleration is not None
        excess = case.amplitude / case.yield_acceleration - 1
        if right > 1e-4 * excess**3 * case.displacement_scale:
            moved += 1
            error = abs(found[case.case][0] / right - 1)
            assert error <= 100 * 3 * np.finfo(float).eps / excess, (
                f"{case}: {error:.1e} at excess {excess:.1e}"
            )
    assert moved > 10


# ------------------------------------------------------------------------- hard cases
# (docs/hard-cases.md)


@pytest.mark.parametrize("category", CATEGORIES, ids=lambda category: category.__name__)
def test_hard_cases_are_the_reference(category: Category) -> None:
    """The first and the last case of each category, solved again with their neighbours."""
    own = [case for case in HARD_CASES if case.category == category.__name__]
    for case in (own[0], own[-1]):
        found = conditioning(case.arguments, dtype_of(case.category))
        for name in ("permanent_displacement", "displacement_bound", "velocity_bound"):
            assert found[name] == getattr(case, name), f"{name} of case {case}"


def test_hard_cases_within_100_times_their_conditioning() -> None:
    """Displacement and peak velocity; the mode and the flags those of either side of a border."""
    found = solve(HARD_CASES, solver="cycle")
    for case in HARD_CASES:
        mode, validity = found[case.case][2:]
        assert f"{mode}:{validity}" in case.outcomes.split(), f"case {case}"
        if mode >= 0 and case.sliding_mode >= 0:
            assert max(case.times_bounds(found[case.case])) <= 100, f"case {case}"


# ----------------------------------------------------------------------------------------- random
# cells

REGIMES = {
    "stuck": strategies.stuck(),
    "stick_slip": strategies.stick_slip(),
    "continuous": strategies.continuous(),
    "newmark": strategies.newmark(),
    "given_friction": strategies.given_friction(),
}


def assert_is_reference(
    cell: strategies.Cell, relative: float, absolute: float = 1e-12
) -> reference.Solution:
    """The cycle solver's answer, its parts that cancel to `absolute` of A/omega^2."""
    expected = reference.solve(**cell, dps=20)
    found = slipsweep.sweep(**choices(**cell, solver="cycle"))
    assert int(found.sliding_mode) == expected.sliding_mode, "sliding mode"
    assert Validity(int(found.validity)) == Validity(expected.validity), "validity"
    second = strategies.phase_scale(cell)
    for name, scale in zip(
        MOTION, (cell["amplitude"] * second**2, cell["amplitude"] * second), strict=True
    ):
        value = float(found[name])
        right = float(getattr(expected, name))
        assert isnan(value) == bool(expected.validity & VALUELESS), name
        if not isnan(value):
            assert abs(value - right) <= relative * abs(right) + absolute * scale, (
                f"{name} {value!r}, not {right!r}"
            )
    return expected


@pytest.mark.parametrize("regime", REGIMES)
def test_held_back_cells(regime: str) -> None:
    @strategies.reproducible
    @given(cell=REGIMES[regime], options=strategies.model_options)
    def compare(cell: strategies.Cell, options: dict[str, str]) -> None:
        assert_is_reference({**cell, **options}, 1e-11)

    compare()


@strategies.reproducible
@given(cell=strategies.sliding_cells, cycles=st.sampled_from([1, 2, 3, 17, 1000, 10**6]))
def test_many_cycles(cell: strategies.Cell, cycles: int) -> None:
    """A closed form however many cycles: 1e-11 at a million of them; in continuous mode u grows
    with their square.
    """
    assert_is_reference({**cell, "cycles": cycles}, 1e-11, 1e-12 * max(1, cycles) ** 2)


@pytest.mark.parametrize(
    ("theta", "mu_s", "amplitude", "cycles"),
    [(10.15, 0.2, 1.223, 4), (10.15, 0.2, 1.223, 6), (13.22, 0.257, 1.822, 7)],
)
def test_pulses_that_lose_speed(theta: float, mu_s: float, amplitude: float, cycles: int) -> None:
    """At rest the block sticks beyond Üg = Üy; carried on, it slides through ever more slowly.

    Every third or fourth pulse begins again, and W of the cycles repeats.
    """
    cell: strategies.Cell = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": amplitude,
        "frequency": 1.0,
        "cycles": cycles,
    }
    assert not assert_is_reference(cell, 1e-13, 0.0).recoupled


@pytest.mark.parametrize(
    ("theta", "mu_s", "amplitude"),
    [
        (10.51, 0.2, 0.661),
        (11.53, 0.214, 1.057),
        (13.2, 0.243, 1.114),
        (16.6, 0.3, 1.625),
        (19.7, 0.371, 2.305),
    ],
)
def test_pulses_that_stop_anew(theta: float, mu_s: float, amplitude: float) -> None:
    """Carried on, the block stops between t1 and Üg = b and restarts at once, elsewhere in every
    pulse.
    """
    cell: strategies.Cell = {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "frequency": 1.0}
    grown = [
        assert_is_reference({**cell, "cycles": n}, 1e-12, 0.0).permanent_displacement
        for n in range(1, 9)
    ]
    assert np.ptp(np.diff([float(u) for u in grown])) > 0.1 * grown[0], "cycles are alike"


def test_b_is_held_where_eq4_falls_on_the_rise() -> None:
    """On a steep plane Eq. 4 rises, turns, and falls while the base still rises: b stays at its
    largest value.
    """
    cell: strategies.Cell = {
        "theta": 45.0,
        "mu_s": 1.5,
        "amplitude": 7.848,
        "frequency": 1.0,
        "yield_acceleration": 0.2,
        "decay_rate": 1.1,
        "delta_mu": 0.0,
        "waveform": "triangle",
        "cycles": 1,
    }
    moved = assert_is_reference(cell, 1e-12, 0.0).permanent_displacement
    assert float(moved) == pytest.approx(3.2776, abs=5e-5)


@pytest.mark.parametrize("excitation", [slipsweep.Sine(cycles=20), slipsweep.Cosine(cycles=20)])
def test_pulses_that_stop_anew_as_event_by_event(excitation: Any) -> None:
    """A sweep follows them by what it knows of a pulse, a time history from event to event."""
    block: dict[str, Any] = {"theta": 10.508, "mu_s": 0.2, "frequency": 1.0}
    amplitude = np.linspace(0.055, 0.12, 27) * strategies.G
    swept = slipsweep.sweep(**block, amplitude=amplitude, excitation=excitation)
    assert (swept.validity.values & Validity.NOT_RECOUPLED).any()
    for value, u in zip(amplitude, swept.permanent_displacement.values.ravel(), strict=True):
        history = slipsweep.simulate(
            **block, amplitude=value, excitation=excitation, times=[0.0, 1e4]
        )
        assert abs(u / float(history.relative_displacement[-1]) - 1) <= 1e-11


@pytest.mark.parametrize("cycles", [1, 10])
@pytest.mark.parametrize("delta_mu", [0.0, 0.02, 0.3, 6.0])
def test_peaks_of_continuous_sliding(delta_mu: float, cycles: int) -> None:
    """Whether the velocity turns on both half cycles, on one or on none; from friction that hardly
    falls to e^-7.
    """
    theta = 3.0
    mu_s = 0.3
    amplitude = 1.9 * strategies.G
    decay_rate = (
        np.array([0.02, 0.1, 0.15, 0.3, 0.8, 2.0, 3.1, 3.5, 4.5, 5.5, 7.0])
        * strategies.G
        / amplitude
    )
    cell: strategies.Cell = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": amplitude,
        "delta_mu": delta_mu,
    }
    cell |= {"frequency": 1.0, "cycles": cycles}
    swept = slipsweep.sweep(**choices(**cell, decay_rate=decay_rate))
    assert (swept.sliding_mode == 2).all()
    for rate, velocity in zip(decay_rate, swept.peak_relative_velocity.values.ravel(), strict=True):
        right = float(reference.solve(**cell, decay_rate=rate).peak_relative_velocity)
        assert abs(velocity - right) <= 1e-13 * (abs(right) + cycles * amplitude / (2 * pi)), (
            f"lambda {rate}"
        )


@strategies.reproducible
@given(
    cell=strategies.given_friction(), exponent=st.floats(0.0, 6.0), options=strategies.model_options
)
def test_sharp_decay(cell: strategies.Cell, exponent: float, options: dict[str, str]) -> None:
    """lambda A / g up to 1e6: friction gone in a layer of 1e-6 of phase."""
    rate = 10**exponent * strategies.G / cell["amplitude"]
    assert_is_reference({**cell, **options, "decay_rate": rate}, 1e-11, 1e-12 * cell["cycles"] ** 2)


@strategies.reproducible
@given(cell=strategies.stick_slip() | strategies.newmark(), exponent=st.floats(1.0, 15.0))
def test_just_above_yield(cell: strategies.Cell, exponent: float) -> None:
    """A = Uy (1 + e), Uy given: an ulp of A moves u by 2 ulp / e, and no error is a hundred times
    that.
    """
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
        assert abs(float(result.permanent_displacement) / right - 1) <= 100 * conditioning, (
            f"excess {excess:.1e}"
        )
    else:
        assert abs(float(result.permanent_displacement) - right) <= 1e-12 * scale
