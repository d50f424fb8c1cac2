"""The stepping kernel: orders and errors against 30 digits, hard cases, Eq. 12 by hand, records,
histories.
"""

from collections.abc import Iterable, Sequence
from math import asin, cos, isfinite, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

import slipsweep
from slipsweep import Step
from slipsweep.model.variables import HISTORY, VALUELESS, Validity
from slipsweep.motion.waveforms import Sine, Square, Triangle, Waveform
from tests.support.cases import Case, Found, choices, read_cases
from tests.support.cases import solve as by_sweeps

G = 9.81
RULES = ("rectangle", "trapezoid", "simpson")
ORDERS = {"rectangle": 1, "trapezoid": 2, "simpson": 4}
EVERY_RULE = pytest.mark.parametrize("rule", RULES)

CASES = [case for case in read_cases() if not case.uplift]
HARD_CASES = read_cases("hard_cases")
WAVE_CASES = [case for case in read_cases("waveforms") if case.sliding_mode >= 0]

#: Categories of cases.csv in which every piece of the motion is smooth over many steps.
SMOOTH = (
    "stick_slip",
    "continuous",
    "measured_yield",
    "newmark",
    "integrate",
    "level_plane",
    "mode_limit",
)


def scaled_displacements(
    waveform: Waveform, rule: str, steps_per_cycle: int, **given: Any
) -> np.ndarray:
    """W = ω²u of one or more yield accelerations."""
    given |= {"frequency": 1.0, "solver": "step", "rule": rule, "steps_per_cycle": steps_per_cycle}
    found = slipsweep.sweep(
        **choices(**given, excitation=waveform), variables=["permanent_displacement"]
    )
    return np.asarray((2 * pi) ** 2 * found.permanent_displacement)


def solve_cases(cases: Iterable[Case], rule: str, steps_per_cycle: int) -> dict[int, Found]:
    return by_sweeps(cases, solver="step", rule=rule, steps_per_cycle=steps_per_cycle)


def errors_of(cases: Sequence[Case], rule: str, counts: Sequence[int]) -> np.ndarray:
    """|u/exact - 1|, (counts, cases)."""
    exact = np.array([float(case.permanent_displacement) for case in cases])
    runs = [solve_cases(cases, rule, count) for count in counts]
    return np.array(
        [
            [abs(run[case.case][0] / u - 1) for case, u in zip(cases, exact, strict=True)]
            for run in runs
        ]
    )


# ------------------------------------------------------------------ errors and orders


@pytest.mark.parametrize("rule", ["trapezoid", "simpson"])
def test_every_case(rule: str) -> None:
    """8192 steps a cycle: 2e-3 |u| + 1e-12 A/omega^2, hard cases included; the step squared where
    all is smooth.
    """
    found = solve_cases(CASES, rule, 8192)
    for case in CASES:
        wrong = case.missed(
            found[case.case], 20 * (2 * pi / 8192) ** 2 if case.category in SMOOTH else 2e-3
        )
        assert not wrong, wrong


def test_rectangle_errs_by_steps_of_the_pulse() -> None:
    """First order: relative error at most twice the step over the pulse's own length, W/V of the
    case.
    """
    found = solve_cases(CASES, "rectangle", 8192)
    for case in CASES:
        exact = float(case.permanent_displacement)
        peak = float(case.peak_relative_velocity)
        if exact != 0:
            length = (
                abs(exact) / case.displacement_scale / (peak / case.velocity_scale * case.cycles)
            )
            error = abs(found[case.case][0] / exact - 1)
            assert error <= 2 * (2 * pi / 8192) / min(length, 1.0), f"case {case}"


@EVERY_RULE
@pytest.mark.parametrize("category", SMOOTH)
def test_order_on_smooth_cases(rule: str, category: str) -> None:
    """Median of the slopes, since the error varies with where events fall.

    The rectangle's first-order error in u comes from a jump of Üg − Ü at the onset, which only
    continuous sliding has.
    """
    counts = [96, 152, 240, 384, 608, 768]
    errors = np.maximum(
        errors_of([case for case in CASES if case.category == category], rule, counts), 1e-16
    )
    order = np.median([-np.polyfit(np.log(counts), np.log(error), 1)[0] for error in errors.T])
    assert order > 0.9 * ORDERS[rule], f"observed order {order:.2f}"
    if rule != "rectangle" or category == "continuous":
        assert order < 1.1 * ORDERS[rule], f"observed order {order:.2f}"


WAVEFORMS = sorted({case.waveform for case in WAVE_CASES})


@EVERY_RULE
@pytest.mark.parametrize("waveform", WAVEFORMS)
def test_order_of_every_waveform(waveform: str, rule: str) -> None:
    """Across jumps and kinks, in all regimes: the median case gains by the order, each by the first
    at least.
    """
    sharp = ("sharp_decay", "just_above_yield")
    cases = [
        c
        for c in WAVE_CASES
        if c.waveform == waveform and c.sliding_mode > 0 and c.category not in sharp
    ]
    # steps of a hundredth of a cycle resolve no fiftieth harmonic
    cases = [c for c in cases if ":50:" not in c.harmonics]
    cases = [c for c in cases if abs(float(c.permanent_displacement)) > 1e-6 * c.displacement_scale]
    cases = cases[::3] if waveform == "harmonics" else cases
    counts, times = ([256, 304, 376], 16) if rule == "rectangle" else ([96, 120, 152], 4)
    before = errors_of(cases, rule, counts).max(axis=0)
    after = errors_of(cases, rule, [times * count for count in counts]).max(axis=0)
    assert before.size >= 15
    rounding = 1e-10
    slow = [
        f"{c}: {b:.1e} to {a:.1e}"
        for c, b, a in zip(cases, before, after, strict=True)
        if a > max(b / times**0.6, rounding)
    ]
    assert not slow, "below first order"
    seen = after > rounding
    if seen.sum() >= 5:
        assert np.median(np.log(before[seen] / after[seen]) / np.log(times)) > ORDERS[rule] - 0.3


def test_modes_and_flags() -> None:
    found = solve_cases(CASES, "simpson", 256)
    for case in CASES:
        mode = found[case.case][2]
        validity = Validity(int(found[case.case][3]))
        assert mode == case.sliding_mode, f"case {case}"
        sticks_and_slips = case.sliding_mode == 1
        assert (Validity.NOT_RECOUPLED in validity) == (sticks_and_slips and not case.recoupled), (
            f"case {case}"
        )
        governs = sticks_and_slips and case.eq4_below_yield
        governs = governs and case.model != "newmark" and case.rise == "monotone"
        assert (Validity.YIELD_GOVERNS in validity) == governs, f"case {case}"


def test_modes_and_flags_of_every_waveform() -> None:
    cases = read_cases("waveforms")
    found = solve_cases(cases, "simpson", 1024)
    for case in cases:
        mode, validity = found[case.case][2:]
        assert mode == case.sliding_mode, f"case {case}"
        assert Validity(int(validity)) == Validity(case.validity), f"case {case}"
        assert np.isnan(found[case.case][0]) == bool(case.validity & VALUELESS), f"case {case}"


#: Categories of hard_cases.csv with a layer of friction, or a slide, that is thinner than a step.
THINNER_THAN_A_STEP = ("sharp_decay", "tangential_onset")

#: Cycles beyond which a case is not stepped: no two of them are alike, so that each is walked.
MOST_CYCLES = 1000


@EVERY_RULE
def test_hard_cases_converge_at_first_order(rule: str) -> None:
    """Slides shorter than steps, rounding at its worst: the worst of three step counts.

    Sixteen times the steps, a twelfth of the error, until it is 100 times what one ulp of the
    inputs does, or 1e-16 A/omega^2 (a slide of less than that, at a tangential onset).  Over 1000
    cycles the rounding of V in one, 1e-14 A/omega, adds up with their square
    (docs/hard-cases.md).
    """
    cases = [case for case in HARD_CASES if case.sliding_mode >= 0 and case.cycles <= MOST_CYCLES]
    counts = [1024, 1192, 1360]
    coarse = [solve_cases(cases, rule, count) for count in counts]
    fine = [solve_cases(cases, rule, 16 * count) for count in counts]
    slow = []
    for case in cases:
        for run in (*coarse, *fine):
            assert isfinite(run[case.case][0]), f"displacement of case {case}"
            assert 0 <= run[case.case][1] < np.inf, f"peak velocity of case {case}"
        before, after = (
            max(case.times_bounds(run[case.case])[0] for run in runs) for runs in (coarse, fine)
        )
        rounding = pi * 1e-14 * case.cycles**2 if case.cycles >= 1000 else 1e-16
        least = rounding * case.displacement_scale / float(case.displacement_bound)
        if case.category in THINNER_THAN_A_STEP:
            error = after * float(case.displacement_bound)
            u = abs(float(case.permanent_displacement))
            assert error <= 2e-3 * u + 1e-12 * case.displacement_scale, f"case {case}"
        elif not after <= max(100.0, least, before / 16**0.9):
            slow.append(f"case {case}: {before:.1e} to {after:.1e} times the conditioning bound")
    assert not slow


# ------------------------------------------------------------------ closed forms


@EVERY_RULE
def test_square_wave_under_newmark(rule: str) -> None:
    """Rate (A − Üy) for π, then −(A + Üy) to the stop: constant, so that every rule is exact with
    any step.
    """
    exact = 3 * (pi**2 / 2 + pi**2 / (2 * 3))
    for steps in (8, 1000):
        block: dict[str, Any] = {
            "theta": 0.0,
            "mu_s": 0.1,
            "amplitude": 2.0,
            "yield_acceleration": 1.0,
        }
        found = scaled_displacements(Square(cycles=3), rule, steps, model="newmark", **block)
        assert found == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("rule", ["trapezoid", "simpson"])
def test_triangle_wave_under_newmark(rule: str) -> None:
    """From t1 on the rate rises for L = π/4 with s = 2A/π, falls as fast, and V is 0 √2 L after the
    rate was.
    """
    exact = 3 * (4 / pi) * (pi / 4) ** 3 * (1 + 2 * sqrt(2) / 3)
    block: dict[str, Any] = {"theta": 0.0, "mu_s": 0.1, "amplitude": 2.0, "yield_acceleration": 1.0}
    found = scaled_displacements(Triangle(cycles=3), rule, 8, model="newmark", **block)
    assert found == pytest.approx(exact, rel=1e-12), "exact on straight lines"


@pytest.mark.parametrize("steps", [8, 1000, 4000])
@EVERY_RULE
def test_a_slide_that_begins_at_the_end_of_a_piece(rule: str, steps: int) -> None:
    """Where a ramp ends, steps grow from the little that was left of it: 1e-9 of Üy and less."""
    wave = Triangle(cycles=2, ramp_in=0.1)
    block: dict[str, Any] = {"theta": 0.0, "mu_s": 0.9, "amplitude": 5.0, "model": "newmark"}
    left = np.array([1e-9, 1e-10, 1e-11, 1e-12])
    found = scaled_displacements(wave, rule, steps, yield_acceleration=2.0 * (1 - left), **block)
    at_ramp, whole = scaled_displacements(
        wave, "simpson", 64, yield_acceleration=[2.0, 1.99999], **block
    )
    assert at_ramp < whole
    np.testing.assert_allclose(found, at_ramp, rtol=3 / steps if rule == "rectangle" else 1e-8)


def test_eq12_by_hand() -> None:
    """Newmark's slide up to t5 in closed form, then V/b more: v − b t (monotone rise that the yield
    value governs).
    """
    amplitude = 3.0
    least = 1.0
    mu_s = 0.5
    first = asin(least / amplitude)
    velocity = amplitude * (cos(first) + 1.0) - least * (pi - first)
    assert velocity > 0.0, "it still slides at t5"
    displacement = (
        amplitude * (cos(first) * (pi - first) + sin(first)) - least * (pi - first) ** 2 / 2
    )
    exact = displacement + velocity**2 / (2 * least)
    block: dict[str, Any] = {
        "yield_acceleration": least,
        "decay_rate": 50.0,
        "delta_mu": 0.0,
        "excitation": Sine(1),
    }
    found = slipsweep.sweep(0.0, mu_s, amplitude, 1.0, **block, solver=Step("simpson", 1024))
    assert Validity.YIELD_GOVERNS in Validity(int(found.validity))
    assert (2 * pi) ** 2 * float(found.permanent_displacement) == pytest.approx(exact, rel=1e-9)


# ------------------------------------------------------------------ records and histories

OPTIONS = [
    slipsweep.Mendez(),
    slipsweep.Mendez(rise="literal"),
    slipsweep.Mendez(recoupling="integrate"),
    slipsweep.Newmark(),
]


@pytest.mark.parametrize("model", OPTIONS, ids=str)
def test_records_are_stepped_as_they_are_walked(model: Any) -> None:
    """300 cells under records: modes alternate, pulses do not re-stick, v is upslope at times."""
    rng = np.random.default_rng(6)
    times: Any = np.arange(120) * 0.04
    for _ in range(5):
        samples = rng.normal(size=times.size).cumsum()
        record = slipsweep.Record(times, samples - np.linspace(samples[0], samples[-1], 120))
        block: dict[str, Any] = {
            "theta": [2.0, 9.0, 17.0],
            "mu_s": [0.35, 0.6],
            "yield_acceleration": [0.3, 1.2],
            "amplitude": [1.5, 3.0, 4.5, 7.0, 11.0],
            "excitation": record,
            "model": model,
        }
        names = ["permanent_displacement", "peak_relative_velocity", "validity"]
        names += ["number_of_slips", "stick_slip_pulses", "continuous_pulses"]
        exact = slipsweep.sweep(**block, variables=names)
        stepped = slipsweep.sweep(**block, variables=names, solver=Step("simpson", 1024))
        upslope = np.int16(Validity.UPSLOPE)  # the sign of what is 0 to rounding
        same = (exact.validity & ~upslope) == (stepped.validity & ~upslope)
        assert same.all(), exact.validity.values[~same.values]
        for name in names[3:]:
            np.testing.assert_array_equal(stepped[name], exact[name])
        for name in names[:2]:
            scale = float(np.abs(exact[name]).max())  # NaN, where no cell has a value
            np.testing.assert_allclose(
                stepped[name], exact[name], rtol=1e-7, atol=1e-9 * np.nan_to_num(scale)
            )


def test_steps_under_a_record_are_of_second_order() -> None:
    """By the trapezoid: `steps_per_cycle` is 64 times the steps between two samples."""
    times: Any = np.arange(200) * 0.02
    record = slipsweep.Record(times, 5.0 * np.sin(9.0 * times) * np.exp(-0.3 * times))
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.4, "yield_acceleration": 0.8}
    exact = slipsweep.sweep(**block, excitation=record).permanent_displacement
    errors = [
        abs(
            slipsweep.sweep(
                **block, excitation=record, solver=Step("trapezoid", count)
            ).permanent_displacement
            / exact
            - 1.0
        ).item()
        for count in (64, 256, 1024)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:]) / 2.0
    assert (abs(orders - 2.0) < 0.3).all(), errors


@pytest.mark.parametrize(
    ("excitation", "model"),
    [
        (Sine(cycles=5), slipsweep.Mendez()),
        (Sine(cycles=9, ramp_in=2.5, ramp_out=1), slipsweep.Mendez(recoupling="integrate")),
        (Square(cycles=3), slipsweep.Newmark()),
        (slipsweep.Cosine(cycles=4), slipsweep.Mendez(rise="literal")),
    ],
    ids=str,
)
def test_a_history_by_steps_is_the_exact_one(excitation: Any, model: Any) -> None:
    block: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "frequency": 1.8}
    block |= {"yield_acceleration": 0.59, "decay_rate": 2.7, "excitation": excitation}
    exact = slipsweep.simulate(**block, model=model)
    # between two samples of which one lies on an event either side of it may be taken
    times = exact.time.values[:-1] + 0.37 * np.diff(exact.time.values)
    exact = slipsweep.simulate(**block, model=model, times=times)
    stepped = slipsweep.simulate(**block, model=model, times=times, solver=Step("simpson", 2048))
    for name in HISTORY:
        scale = np.abs(exact[name]).max().item()
        np.testing.assert_allclose(stepped[name], exact[name], rtol=0, atol=1e-9 * scale)
