"""The multiple-precision reference against cases.csv and against what is known in closed form."""

import random
from math import radians, tan
from typing import Any

import pytest
from mpmath import mp, mpf, nstr, workdps

from tests.support import reference
from tests.support.cases import Case, read_cases
from tests.support.flag_definitions import UPLIFT

CASES = read_cases()


def solve(case: Case, **changes: Any) -> reference.Solution:
    inputs = {"theta": case.theta, "mu_s": case.mu_s, "amplitude": case.amplitude, "frequency": case.frequency}
    return reference.solve(**{**inputs, **case.options, **changes})


def assert_close(what: str, value: mpf, expected: str, relative: str, absolute: mpf) -> None:
    error = abs(value - mpf(expected))
    allowed = mpf(relative) * abs(mpf(expected)) + absolute
    assert error <= allowed, f"{what} {nstr(value, 20)}, cases.csv {expected}, allowed error {nstr(allowed, 3)}"


@pytest.mark.parametrize("case", CASES, ids=str)
def test_motion_as_in_cases_csv(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """cases.csv was made with the decimal g = 9.81; one line of it lies beyond uplift and has a value all the same."""
    if case.uplift:
        monkeypatch.setattr(reference, "UPLIFT", 0)
    solution = solve(case, g="9.81")
    with workdps(40):
        omega = 2 * mp.pi * mpf(case.frequency)
        scale = mpf("1e-28") * mpf(case.amplitude)
        assert_close(
            "displacement", solution.permanent_displacement, case.permanent_displacement, "1e-16", scale / omega**2
        )
        assert_close(
            "peak velocity", solution.peak_relative_velocity, case.peak_relative_velocity, "1e-16", scale / omega
        )
    assert solution.sliding_mode == case.sliding_mode, "sliding mode"
    assert solution.recoupled == case.recoupled, "recoupling before the next onset"
    assert solution.eq4_below_yield == case.eq4_below_yield, "Eq. 4 below yield over the whole rise"


@pytest.mark.parametrize("case", [case for case in CASES if not case.uplift], ids=str)
def test_rounding_of_g_moves_no_case(case: Case) -> None:
    """The double 9.81 in place of the decimal stays within the conditioning that the file states."""
    solution = solve(case)
    with workdps(40):
        absolute = mpf("1e-14") * mpf(case.amplitude) / (2 * mp.pi * mpf(case.frequency)) ** 2
        assert_close("displacement", solution.permanent_displacement, case.permanent_displacement, "1e-13", absolute)


def test_uplift_has_no_value() -> None:
    (case,) = (case for case in CASES if case.uplift)
    solution = solve(case)
    assert mp.isnan(solution.permanent_displacement)
    assert (solution.sliding_mode, solution.validity) == (reference.MISSING, UPLIFT)


def test_continuous_velocity_is_that_of_bessel_and_struve_functions() -> None:
    """Over whole cycles v grows by 2 tan(theta) times the integral of |Ug| (mu_s - tan(theta) - mu)."""
    theta, mu_s, amplitude, rate, delta_mu = 6, "0.38", "5.1", "2.3", "0.114"
    options: dict[str, Any] = {"yield_acceleration": "0.08", "decay_rate": rate, "delta_mu": delta_mu, "g": "9.81"}
    one, two, three = (
        reference.solve(theta, mu_s, amplitude, 1, cycles=n, **options).permanent_displacement for n in (1, 2, 3)
    )
    with workdps(40):
        tan_theta = mp.tan(mp.radians(theta))
        k = mpf(rate) * mpf(amplitude) / mpf("9.81")
        decayed = 2 + mp.pi * (mp.struvel(1, k) - mp.besseli(1, k))
        excess = mpf(mu_s) - tan_theta
        gain = 2 * tan_theta * mpf(amplitude) * (2 * excess - (mpf(mu_s) + mpf(delta_mu)) * decayed)
        expected = gain * 2 * mp.pi / (2 * mp.pi) ** 2
        assert abs((three - two) - (two - one) - expected) < mpf("1e-27"), "velocity gained in a cycle"


def test_cycles_passed_over_are_those_gone_through() -> None:
    """Whole-cycle shortcuts (rest, carried velocity, period) agree with pulse after pulse."""
    generator = random.Random(2012)
    carried = 0
    while carried < 6:
        theta, mu_s = generator.uniform(0, 30), generator.uniform(0.1, 1.0)
        if mu_s < tan(radians(theta)):
            continue
        options: dict[str, Any] = {
            "yield_acceleration": 10 ** generator.uniform(-2, 0.5),
            "rise": generator.choice(["monotone", "literal"]),
            "recoupling": generator.choice(["eq12", "eq12", "integrate"]),
        }
        amplitude, cycles = generator.uniform(0.5, 8.0), generator.choice([3, 8, 11])
        solution = reference.solve(theta, mu_s, amplitude, 1, cycles=cycles, **options)
        if solution.sliding_mode != reference.STICK_SLIP:
            continue
        carried += not solution.recoupled
        with workdps(60):
            parameters = reference.friction_parameters(
                theta, mu_s, amplitude, yield_acceleration=options["yield_acceleration"]
            )
            interface = reference._Interface(
                mpf(9.81), mp.tan(mp.radians(mpf(theta))), mpf(mu_s), parameters, mpf(amplitude), 30
            )
            motion = reference._StickSlip(interface, "mendez", options["rise"], options["recoupling"])
            velocity = total = mpf(0)
            for n in range(cycles):
                pulse = motion._pulse(velocity, motion.next_onset if n < cycles - 1 else 2 * mp.pi)
                assert pulse is not None
                velocity, held = pulse.velocity, pulse.held
                total += pulse.displacement
            total += velocity**2 / (2 * held)
            error = abs(total / (2 * mp.pi) ** 2 - solution.permanent_displacement)
            assert error < mpf("1e-27"), f"displacement over {cycles} cycles"
