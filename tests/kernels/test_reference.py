"""The multiple-precision reference against cases.csv, which was made elsewhere, closed forms, and
its own table.
"""

import random
from math import radians, tan
from typing import Any

import gmpy2
import mpmath
import pytest
from gmpy2 import mpfr

from tests.support import reference
from tests.support.cases import read_cases
from tests.support.digits import workdps
from tests.support.sections import Waveform

CASES = read_cases()


@pytest.mark.parametrize("category", sorted({case.category for case in CASES}))
def test_motion_as_in_cases_csv(category: str) -> None:
    """cases.csv was made with the decimal g = 9.81; one line of it lies beyond uplift, and has a
    value all the same.
    """
    for case in (case for case in CASES if case.category == category):
        solution = reference.solve(**case.arguments | {"g": "9.81"})
        if case.uplift:
            assert gmpy2.is_nan(solution.permanent_displacement)
            assert (solution.sliding_mode, solution.validity) == (
                reference.MISSING,
                reference.UPLIFT,
            )
            continue
        with workdps(40):
            for value, text, scale in (
                (
                    solution.permanent_displacement,
                    case.permanent_displacement,
                    case.displacement_scale,
                ),
                (solution.peak_relative_velocity, case.peak_relative_velocity, case.velocity_scale),
            ):
                exact = mpfr(text)
                assert abs(value - exact) <= mpfr("1e-16") * abs(exact) + mpfr("1e-28") * scale, (
                    f"case {case}"
                )
        codes = (solution.sliding_mode, solution.recoupled, solution.eq4_below_yield)
        assert codes == (case.sliding_mode, case.recoupled, case.eq4_below_yield), f"case {case}"


def test_continuous_velocity_is_that_of_bessel_and_struve_functions() -> None:
    """Over whole cycles v grows by 2 tan(theta) times the integral of |Ug| (mu_s - tan(theta) -
    mu).
    """
    theta = 6
    mu_s = "0.38"
    amplitude = "5.1"
    rate = "2.3"
    delta_mu = "0.114"
    options: dict[str, Any] = {
        "yield_acceleration": "0.08",
        "decay_rate": rate,
        "delta_mu": delta_mu,
        "g": "9.81",
    }
    one, two, three = (
        reference.solve(theta, mu_s, amplitude, 1, cycles=n, **options).permanent_displacement
        for n in (1, 2, 3)
    )
    with workdps(40), mpmath.workdps(40):
        tan_theta = gmpy2.tan(gmpy2.radians(mpfr(theta)))
        k = mpmath.mpf(rate) * mpmath.mpf(amplitude) / mpmath.mpf("9.81")
        decayed = 2 + gmpy2.const_pi() * mpfr(str(mpmath.struvel(1, k) - mpmath.besseli(1, k)))
        excess = mpfr(mu_s) - tan_theta
        gain = (
            2 * tan_theta * mpfr(amplitude) * (2 * excess - (mpfr(mu_s) + mpfr(delta_mu)) * decayed)
        )
        expected = gain * 2 * gmpy2.const_pi() / (2 * gmpy2.const_pi()) ** 2
        assert abs((three - two) - (two - one) - expected) < mpfr("1e-27"), (
            "velocity gained in a cycle"
        )


def test_cycles_passed_over_are_those_gone_through(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole-cycle shortcuts (rest, velocity carried, period) agree with cycle after cycle."""
    generator = random.Random(2012)
    carried = 0
    alike = Waveform.alike
    while carried < 6:
        theta = generator.uniform(0, 30)
        mu_s = generator.uniform(0.1, 1.0)
        if mu_s < tan(radians(theta)):
            continue
        options: dict[str, Any] = {
            "yield_acceleration": 10 ** generator.uniform(-2, 0.5),
            "rise": generator.choice(["monotone", "literal"]),
            "recoupling": generator.choice(["eq12", "eq12", "integrate"]),
            "cycles": generator.choice([3, 8, 11]),
        }
        amplitude = generator.uniform(0.5, 8.0)
        monkeypatch.setattr(Waveform, "alike", alike)
        one = reference.solve(theta, mu_s, amplitude, 1, **options)
        monkeypatch.setattr(Waveform, "alike", lambda wave, n: 1)
        other = reference.solve(theta, mu_s, amplitude, 1, **options)
        if one.sliding_mode < reference.STICK_SLIP:
            continue
        carried += not one.recoupled
        for name in ("permanent_displacement", "peak_relative_velocity"):
            assert abs(getattr(one, name) - getattr(other, name)) < mpfr("1e-27"), (
                f"{name}: {theta}, {mu_s}, {options}"
            )
        assert one.validity == other.validity


@pytest.mark.parametrize("waveform", ["sine", "cosine", "triangle", "square", "harmonics"])
def test_waveforms_csv_is_the_reference(waveform: str) -> None:
    """Some cases of each waveform, solved again; one with a fiftieth harmonic."""
    for case in [case for case in read_cases("waveforms") if case.waveform == waveform][1::12]:
        found = reference.solve(**case.arguments, dps=20)
        assert (found.sliding_mode, found.validity) == (case.sliding_mode, case.validity), (
            f"case {case}"
        )
        numbers = (float(found.permanent_displacement), float(found.peak_relative_velocity), 0, 0)
        assert case.sliding_mode < 0 or not case.missed(numbers, 1e-15, 1e-20), f"case {case}"
