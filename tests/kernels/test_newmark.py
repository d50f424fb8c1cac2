"""Outside checks: Newmark's block against pySLAMMER, every mode against SciPy's integrators."""

from collections.abc import Callable
from math import asin, atan, exp, inf, pi, radians, sin, tan

import mpmath
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import slipsweep
from benchmarks.coefficients import newmark_displacement
from tests.support.cases import Case, choices, read_cases

G = 9.81

NEWMARK_BLOCKS = pytest.mark.parametrize(
    ("theta", "mu_s", "amplitude", "frequency", "cycles"),
    [
        (10.0, 0.4, 4.0, 1.0, 3),
        (20.0, 0.6, 3.5, 0.5, 2),
        (0.0, 0.3, 5.0, 2.0, 3),
        (15.0, 0.35, 2.0, 1.0, 2),
        (5.0, 0.5, 5.0, 1.0, 2),
    ],
)


@pytest.mark.filterwarnings("ignore")  # pySLAMMER's own, on import
@NEWMARK_BLOCKS
def test_newmark_against_pyslammer(theta: float, mu_s: float, amplitude: float, frequency: float, cycles: int) -> None:
    """pySLAMMER takes the trapezoidal rule from sample to sample, onset and stop at the samples: second order.

    At 256 samples a cycle it is seen to err by up to 4e-4 in these cells, so that 16384
    samples must agree to 5e-7, with a margin of 5 on the order.
    """
    from pyslammer import GroundMotion, RigidAnalysis
    from pyslammer.constants import G_EARTH

    samples = 16384
    ground = amplitude * np.sin(2 * np.pi * np.arange(samples * cycles + 1) / samples)
    yield_acceleration = G * tan(atan(mu_s) - radians(theta))
    analysis = RigidAnalysis(yield_acceleration / G_EARTH, GroundMotion(ground / G_EARTH, 1 / (samples * frequency)))
    result = slipsweep.sweep(
        theta, mu_s, amplitude, frequency, model="newmark", excitation=slipsweep.Sine(cycles=cycles)
    )
    assert analysis.max_sliding_disp == pytest.approx(float(result.permanent_displacement), rel=5e-7), "displacement"
    assert analysis.sliding_vel.max() == pytest.approx(float(result.peak_relative_velocity), rel=5e-7), "peak velocity"


def test_newmark_to_the_last_digits() -> None:
    """Every share of yield in the peak, down to what a double can hold and up to one unit below the peak."""
    random, amplitude, cycles = np.random.default_rng(11), 3.7, 7
    near = 10.0 ** random.uniform(-15.0, 0.0, 150)
    ratio = np.concatenate([random.uniform(0.0, 1.0, 150), near, 1.0 - near, [1e-300, 1e-17, np.nextafter(1.0, 0.0)]])
    onset = amplitude * ratio
    onset = onset[(onset > 0.0) & (onset < amplitude)]
    result = slipsweep.sweep(
        5.0,
        0.38,
        amplitude,
        1.0,
        yield_acceleration=onset,
        model="newmark",
        excitation=slipsweep.Sine(cycles=cycles),
    )
    with mpmath.workdps(80):
        omega = 2 * mpmath.pi
        for value, displacement, velocity in zip(
            onset.tolist(),
            result.permanent_displacement.values.tolist(),
            result.peak_relative_velocity.values.tolist(),
            strict=True,
        ):
            share = mpmath.mpf(value) / mpmath.mpf(amplitude)
            slid = cycles * amplitude * newmark_displacement(share) / omega**2
            fastest = 2 * amplitude * (mpmath.sqrt(1 - share**2) - share * mpmath.acos(share)) / omega
            assert abs(displacement / slid - 1) < 1.5e-15, f"displacement at {float(share)}"
            assert abs(velocity / fastest - 1) < 1.5e-15, f"peak velocity at {float(share)}"


class Integrated:
    """One cell of cases.csv by `solve_ivp`, in phase: V = omega v, W = omega**2 u."""

    def __init__(self, case: Case) -> None:
        given = dict(case.given)
        self.case = case
        self.tan_theta = tan(radians(case.theta))
        self.onset = given.get("yield_acceleration", G * tan(atan(case.mu_s) - radians(case.theta)))
        self.limit = (self.onset + G * case.mu_s) / (1 - self.tan_theta * (case.mu_s - self.tan_theta))
        self.is_continuous = case.amplitude > self.limit and case.model == "mendez"
        ratio = case.amplitude / self.limit
        delta_mu = case.mu_s * ((ratio if self.is_continuous else 1 / ratio) - 1)
        self.at_rest = case.mu_s + given.get("delta_mu", delta_mu)
        lowest = 0.01 if self.is_continuous else case.mu_s**2 * ratio
        self.decay = given.get("decay_rate", G / case.amplitude * np.log(self.at_rest / lowest)) / G
        self.velocity = self.displacement = self.peak = 0.0

    def ground(self, phi: float) -> float:
        return self.case.amplitude * sin(phi)

    def eq4(self, ground: float) -> float:
        friction = self.at_rest * exp(-self.decay * abs(ground))
        normal = G + ground * self.tan_theta
        size = abs(ground) - normal * (self.case.mu_s - self.tan_theta - friction) - G * self.tan_theta
        return size if ground >= 0 else -size

    def following(self, least: float = -inf) -> Callable[[float], float]:
        """Block acceleration of Eq. 4, not below `least`."""
        return lambda phi: max(least, self.eq4(self.ground(phi)))

    def holding(self, held: float) -> Callable[[float], float]:
        return lambda phi: held

    def follow(self, block: Callable[[float], float], start: float, stop: float, may_stop: bool) -> float | None:
        """Integrate Ug - b; the phase of the stop if there is one."""

        def rest(phi: float, y: np.ndarray) -> float:
            return float(y[0]) + 1e-13 * self.case.amplitude

        rest.terminal, rest.direction = may_stop, -1  # type: ignore[attr-defined]

        def crest(phi: float, y: np.ndarray) -> float:
            return self.ground(phi) - block(phi)

        solution = solve_ivp(
            lambda phi, y: [self.ground(phi) - block(phi), y[0]],
            (start, stop),
            [self.velocity, self.displacement],
            method="DOP853",
            events=(rest, crest),
            rtol=1e-11,
            atol=1e-13 * self.case.amplitude,
            max_step=0.02,
        )
        self.velocity, self.displacement = solution.y[:, -1]
        crests = solution.y_events[1]
        self.peak = max(self.peak, solution.y[0].max(), crests[:, 0].max() if len(crests) else 0.0)
        if solution.status == 1:
            self.velocity = 0.0
            return float(solution.t[-1])
        return None

    def continuous(self) -> None:
        start = asin(self.onset / self.case.amplitude)
        for quarter in range(1, 4 * self.case.cycles + 1):
            self.follow(self.following(), start, quarter * pi / 2, may_stop=False)
            start = quarter * pi / 2

    def slide_begins(self, phi: float) -> float | None:
        """First phase from `phi` to the peak at which Eq. 4 lies below Ug."""
        if self.case.model == "newmark":
            return phi
        phases = np.linspace(phi, pi / 2, 4001)
        excess = [self.ground(p) - self.eq4(self.ground(p)) for p in phases]
        first = next((i for i, value in enumerate(excess) if value > 0), None)
        if not first:
            return None if first is None else phi
        return float(brentq(lambda p: self.ground(p) - self.eq4(self.ground(p)), *phases[first - 1 : first + 1]))

    def stick_slip(self) -> None:
        onset_phase = asin(self.onset / self.case.amplitude)
        integrate = self.case.recoupling == "integrate" or self.case.model == "newmark"
        for cycle in range(self.case.cycles):
            last = cycle == self.case.cycles - 1
            held = self.rise(onset_phase)
            if held is None:
                continue
            end = 2 * pi + (0.0 if last else onset_phase)
            stopped = self.follow(self.holding(held), pi / 2, end if integrate else pi, may_stop=True)
            if stopped is None:
                self.eq12(held, 0.0 if integrate else end - pi, last)

    def rise(self, phi: float) -> float | None:
        """From the onset to the peak; b there, or None if the block is then at rest."""
        top = self.case.amplitude
        while True:
            if self.velocity == 0:
                begins = self.slide_begins(phi)
                if begins is None:
                    return None
                phi = begins
            if self.case.model == "newmark":
                first, held = self.onset, self.onset
                block = self.holding(first)
            elif self.case.rise == "literal":
                held = self.eq4(top)
                block = self.following()
            else:  # Eq. 4 is convex in these cells
                first = max(self.onset, self.eq4(self.ground(phi)))
                held = max(first, self.eq4(top))
                block = self.following(first)
            stopped = self.follow(block, phi, pi / 2, may_stop=True)
            if stopped is None:
                return held
            phi = stopped

    def eq12(self, held: float, span: float, last: bool) -> None:
        stop = self.velocity / held
        span = stop if last else min(span, stop)
        self.displacement += self.velocity * span - held * span**2 / 2
        self.velocity = max(self.velocity - held * span, 0.0)


CATEGORIES = (
    "stick_slip",
    "continuous",
    "measured_yield",
    "given_friction",
    "newmark",
    "literal",
    "integrate",
    "near_failure",
    "restick",
    "level_plane",
)


def convex(case: Case) -> bool:
    """lambda >= 2 tan(theta), for which Eq. 4 is convex on the rise; calibrated values are."""
    return dict(case.given).get("decay_rate", 10.0) >= 2 * tan(radians(case.theta))


INTEGRATED = [
    case
    for category in CATEGORIES
    for case in [case for case in read_cases() if case.category == category and not case.uplift and convex(case)][:3]
]


@pytest.mark.parametrize("case", INTEGRATED, ids=str)
def test_motion_against_scipy(case: Case) -> None:
    """DOP853 at rtol 1e-11 with events: agreement to 1e-8 asks for the same rules, not the same code."""
    integrated = Integrated(case)
    if integrated.is_continuous:
        integrated.continuous()
    else:
        integrated.stick_slip()
    omega = 2 * pi * case.frequency
    result = slipsweep.sweep(case.theta, case.mu_s, case.amplitude, case.frequency, **choices(**case.options))
    displacement, velocity = integrated.displacement / omega**2, integrated.peak / omega
    assert float(result.permanent_displacement) == pytest.approx(
        displacement, rel=1e-8, abs=1e-10 * case.displacement_scale
    ), "displacement"
    assert float(result.peak_relative_velocity) == pytest.approx(velocity, rel=1e-8, abs=1e-10 * case.velocity_scale), (
        "peak velocity"
    )


@pytest.mark.parametrize("solver", ["cycle", "step"])
@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
def test_mendez_reduces_to_newmark_just_above_yield(solver: str, recoupling: str) -> None:
    """Near yield Eq. 4 stays below Coulomb's value: b = Uy, and the pulse is over before Ug reverses."""
    theta = xr.DataArray([0.0, 5.0, 10.0, 20.0], dims="case")
    mu_s = xr.DataArray([0.3, 0.38, 0.4, 0.75], dims="case")
    onset = slipsweep.friction_parameters(theta, mu_s, 1.0).yield_acceleration.drop_vars("amplitude")
    excess = xr.DataArray(10.0 ** -np.arange(1.0, 9.0), dims="excess")
    cells = {"theta": theta, "mu_s": mu_s, "amplitude": onset * (1 + excess), "frequency": 1.0, "cycles": 3}
    mendez = slipsweep.sweep(**choices(**cells, solver=solver, recoupling=recoupling))
    newmark = slipsweep.sweep(**choices(**cells, solver=solver, model="newmark"))
    assert (mendez.validity & 16 > 0).all(), "Eq. 4 stays below yield"
    for name in ("permanent_displacement", "peak_relative_velocity"):
        assert (newmark[name] > 0).all()
        np.testing.assert_allclose(mendez[name], newmark[name], rtol=1e-13, atol=0, err_msg=name)


def test_mendez_held_at_yield_is_newmark() -> None:
    """Where Eq. 4 stays below yield and recoupling is integrated, the two models are one block."""
    theta = np.linspace(0.0, 25.0, 6)
    mu_s = np.linspace(0.5, 0.8, 4)
    amplitude = np.linspace(0.5, 12.0, 24)
    mendez = slipsweep.sweep(
        theta, mu_s, amplitude, 2.0, model=slipsweep.Mendez(recoupling="integrate"), excitation=slipsweep.Sine(cycles=4)
    )
    newmark = slipsweep.sweep(theta, mu_s, amplitude, 2.0, model="newmark", excitation=slipsweep.Sine(cycles=4))
    held = (mendez.validity & 16 > 0).to_numpy()
    assert held.sum() > 20, "cells held at yield"
    for name in ("permanent_displacement", "peak_relative_velocity"):
        np.testing.assert_allclose(
            mendez[name].to_numpy()[held], newmark[name].to_numpy()[held], rtol=1e-12, atol=0, err_msg=name
        )
