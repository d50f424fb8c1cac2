"""The stepping kernel: orders and errors against 30 digits, hard cases, another friction law, Eq. 12 by hand."""

from collections.abc import Iterable, Sequence
from math import asin, cos, isfinite, pi, radians, sin, sqrt, tan
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import slipsweep
from slipsweep import Step
from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, registered
from slipsweep.kernels.block import EQ12, INTEGRATE, MONOTONE, Cell, Motion, Options
from slipsweep.kernels.step import RECTANGLE, SIMPSON, TRAPEZOID, Steps, solve_cell
from slipsweep.model.friction import FrictionLaw
from slipsweep.model.variables import VALUELESS, Validity
from slipsweep.motion.cutting import wave_of
from slipsweep.motion.waveforms import Sine, Square, Triangle, Waveform
from tests.support.cases import Case, Found, choices, read_cases
from tests.support.cases import solve as by_sweeps

G = 9.81
RULES = {"rectangle": RECTANGLE, "trapezoid": TRAPEZOID, "simpson": SIMPSON}
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
    """8192 steps a cycle: 2e-3 |u| + 1e-12 A/omega^2, hard cases included; the step squared where all is smooth."""
    found = solve_cases(CASES, rule, 8192)
    for case in CASES:
        wrong = case.missed(
            found[case.case], 20 * (2 * pi / 8192) ** 2 if case.category in SMOOTH else 2e-3
        )
        assert not wrong, wrong


def test_rectangle_errs_by_steps_of_the_pulse() -> None:
    """First order: relative error at most twice the step over the pulse's own length, W/V of the case."""
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
    """Across jumps and kinks, in all regimes: the median case gains by the order, each by the first at least."""
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


@EVERY_RULE
def test_hard_cases_converge_at_first_order(rule: str) -> None:
    """Slides and layers of friction shorter than steps, 10^6 cycles, rounding at its worst: worst of three step counts.

    Sixteen times the steps, a twelfth of the error, until it is 100 times what one ulp of the
    inputs does, or 1e-16 A/omega^2 (a slide of less than that, at a tangential onset).  Over 1000
    cycles and more the rounding of V in one, 1e-14 A/omega, adds up with their square
    (docs/hard-cases.md).
    """
    counts = [1024, 1192, 1360]
    coarse = [solve_cases(HARD_CASES, rule, count) for count in counts]
    fine = [solve_cases(HARD_CASES, rule, 16 * count) for count in counts]
    slow = []
    for case in HARD_CASES:
        if case.sliding_mode < 0:
            continue
        for run in (*coarse, *fine):
            assert isfinite(run[case.case][0]), f"displacement of case {case}"
            assert 0 <= run[case.case][1] < np.inf, f"peak velocity of case {case}"
        before, after = (
            max(case.times_bounds(run[case.case])[0] for run in runs) for runs in (coarse, fine)
        )
        rounding = pi * 1e-14 * case.cycles**2 if case.cycles >= 1000 else 1e-16
        least = rounding * case.displacement_scale / float(case.displacement_bound)
        if not after <= max(100.0, least, before / 16**0.9):
            slow.append(f"case {case}: {before:.1e} to {after:.1e} times the conditioning bound")
    assert not slow


# ------------------------------------------------------------------ closed forms


@EVERY_RULE
def test_square_wave_under_newmark(rule: str) -> None:
    """Rate (A − Üy) for π, then −(A + Üy) to the stop: constant, so that every rule is exact with any step."""
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
    """From t1 on the rate rises for L = π/4 with s = 2A/π, falls as fast, and V is 0 √2 L after the rate was."""
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
    """Newmark's slide up to t5 in closed form, then V/b more: v − b t (monotone rise that the yield value governs)."""
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


# ------------------------------------------------------------------ another law


@registered  # so that the kernel is kept for the next run
def hyperbolic_friction(
    x: float, mu_s: float, delta_mu: float, decay_rate: float, g: float
) -> float:
    return mu_s / (1.0 + decay_rate * abs(x) / g)


@inlined
def hyperbolic() -> FrictionLaw:
    return FrictionLaw(hyperbolic_friction)


def test_a_law_says_what_it_lacks_for_the_exact_kernel() -> None:
    lacking = ("inflection", "static_acceleration", "moments")
    found = FrictionLaw(hyperbolic_friction, derivatives=len, decay_length=len)
    assert found.missing == lacking


@kernel
def solve_hyperbolic(cell: Cell, options: Options, wave: Any, steps: Steps) -> Motion:
    return solve_cell(hyperbolic(), cell, options, wave, steps)


class Hyperbolic:
    """Üg = A sin φ and Eq. 4 with that friction, for SciPy."""

    def __init__(
        self, theta: float, mu_s: float, amplitude: float, least: float, decay_rate: float
    ) -> None:
        self.tangent = tan(radians(theta))
        self.mu_s = mu_s
        self.amplitude = amplitude
        self.least = least
        self.decay_rate = decay_rate

    def rate(self, x: float) -> float:
        """Üg − Ü."""
        friction = self.mu_s / (1.0 + self.decay_rate * abs(x) / G)
        n = G + x * self.tangent
        lag = n * (self.mu_s - self.tangent - friction) + G * self.tangent
        return lag if x >= 0 else -lag

    def found(
        self, rule: str, steps_per_cycle: int, cycles: int, recoupling: str = "eq12"
    ) -> Motion:
        cell = Cell(
            self.tangent, self.mu_s, self.amplitude, self.least, self.decay_rate, 0.0, np.nan
        )
        wave = wave_of(Sine(cycles=cycles))
        steps = Steps(RULES[rule], steps_per_cycle, np.empty((2, 2 * steps_per_cycle + 1)))
        options = Options(
            MONOTONE, EQ12 if recoupling == "eq12" else INTEGRATE, cycles, wants_peak=True, g=G
        )
        motion: Motion = solve_hyperbolic(cell, options, wave, steps)
        return motion

    def integrate(
        self, start: float, end: float, state: Any, rate: Any, stops: bool = False
    ) -> tuple[Any, float]:
        """V and W at the end or at the stop, and where that is."""

        def stop(t: float, y: Any) -> float:
            return float(y[0])

        stop.terminal = True  # type: ignore[attr-defined]
        stop.direction = -1.0  # type: ignore[attr-defined]
        solution = solve_ivp(
            lambda t, y: (rate(self.amplitude * sin(t)), y[0]),
            (start, end),
            state,
            "DOP853",
            rtol=1e-11,
            atol=1e-13,
            events=stop if stops else None,
        )
        return solution.y[:, -1], float(solution.t[-1])

    def stick_slip(self, recoupling: str) -> float:
        """W of one pulse from rest to rest: b = max(b, Eq. 4) on the rise, held on the fall, Eq. 12 from t5 on."""
        x = np.linspace(self.least, self.amplitude, 10_000)
        eq4 = np.array([value - self.rate(value) for value in x])
        assert (np.diff(eq4) > 0).all(), "Eq. 4 rises"
        begins = self.least
        if self.rate(begins) <= 0.0:  # t1 lies beyond Üy
            begins = brentq(self.rate, self.least, self.amplitude, xtol=1e-15)
        held = max(self.least, float(eq4[-1]))
        switch = begins
        if begins - self.rate(begins) < self.least < eq4[-1]:
            switch = brentq(
                lambda v: v - self.rate(v) - self.least, begins, self.amplitude, xtol=1e-15
            )
        phases = [asin(begins / self.amplitude), asin(min(switch / self.amplitude, 1.0)), pi / 2]
        state, _ = self.integrate(phases[0], phases[1], [0.0, 0.0], lambda x: x - self.least)
        state, _ = self.integrate(
            phases[1], phases[2], state, self.rate if eq4[-1] > self.least else lambda x: x - held
        )
        end = pi if recoupling == "eq12" else 2 * pi
        state, at = self.integrate(phases[2], end, state, lambda x: x - held, stops=True)
        return float(state[1]) + (state[0] ** 2 / (2 * held) if at == pi else 0.0)

    def continuous(self, cycles: int) -> float:
        state = np.zeros(2)
        start = asin(self.least / self.amplitude)
        for end in [*np.arange(1, 2 * cycles + 1) * pi]:
            side = 1.0 if sin(0.5 * (start + end)) > 0 else -1.0
            state, _ = self.integrate(
                start, end, state, lambda x, side=side: self.rate(side * max(side * x, 1e-300))
            )
            start = end
        return float(state[1])


@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
@pytest.mark.parametrize(
    "block",
    [
        Hyperbolic(theta=5.0, mu_s=0.38, amplitude=3.55, least=0.59, decay_rate=1.5),
        Hyperbolic(theta=5.0, mu_s=0.38, amplitude=3.1, least=2.0, decay_rate=1.0),
        Hyperbolic(theta=14.0, mu_s=0.5, amplitude=3.0, least=1.5, decay_rate=0.8),
    ],
    ids=["measured", "near Coulomb", "steep"],
)
def test_another_law_in_stick_slip(block: Hyperbolic, recoupling: str) -> None:
    """A law of another shape, in ten lines and without an edit in a kernel, as SciPy integrates it."""
    exact = block.stick_slip(recoupling)
    for rule, allowed in (("rectangle", 0.02), ("trapezoid", 1e-4), ("simpson", 1e-9)):
        found = block.found(rule, 2048, 3, recoupling)
        assert found.sliding_mode == 1
        assert not int(found.validity) & (VALUELESS | Validity.NOT_RECOUPLED)
        assert found.displacement == pytest.approx(3 * exact, rel=allowed), rule


def test_another_law_in_continuous_sliding() -> None:
    block = Hyperbolic(theta=6.0, mu_s=0.38, amplitude=5.1, least=0.08, decay_rate=2.3)
    exact = block.continuous(4)
    for rule, allowed in (("rectangle", 0.02), ("trapezoid", 1e-4), ("simpson", 1e-8)):
        found = block.found(rule, 2048, 4)
        assert found.sliding_mode == 2
        assert found.displacement == pytest.approx(exact, rel=allowed), rule
