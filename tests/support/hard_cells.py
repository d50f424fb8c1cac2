"""Cells in which the model is hardest to solve, the reason, and the effect of an ulp of an input.

`CATEGORIES` makes their cells; ``python -m benchmarks.hard_cases`` solves them, and all
their neighbours one ulp away, in multiple precision into data/hard_cases.csv.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeAlias

import gmpy2
import numpy as np
from gmpy2 import mpfr

from tests.support import reference
from tests.support.cases import read_cases
from tests.support.digits import shown, workdps

G = 9.81

#: Keyword arguments of `reference.solve`, and of `slipsweep.sweep`.
Cell = dict[str, Any]

#: θ (degrees) and μs.
PLANES = ((5.0, 0.38), (0.0, 0.5), (18.0, 0.4))


#: Cells that are hard for one reason, which is the docstring.
Category: TypeAlias = Callable[[], Iterator[Cell]]


def _cell(theta: float, mu_s: float, amplitude: float, **options: Any) -> Cell:
    return {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": float(amplitude),
        "frequency": 1.0,
        "cycles": 1,
        **options,
    }


def _friction(
    theta: float, mu_s: float, amplitude: float = 1.0, **given: Any
) -> reference.FrictionParameters:
    return reference.friction_parameters(theta, mu_s, amplitude, **given)


def _ulps(value: float, count: int) -> float:
    """The double `count` places above (or below) `value`."""
    for _ in range(abs(count)):
        value = math.nextafter(value, math.copysign(math.inf, count))
    return value


def just_above_yield() -> Iterator[Cell]:
    """u ~ (A − Üy)²: differences of nearly equal numbers; the slide is shorter than a step."""
    for theta, mu_s in PLANES:
        onset = _friction(theta, mu_s).yield_acceleration
        for k in (2, 5, 8, 11, 14):
            yield _cell(theta, mu_s, onset * (1 + mpfr(10) ** -k))
    for k in (4, 12):
        yield _cell(5.0, 0.38, 0.59 * (1 + 10.0**-k), yield_acceleration=0.59)
    yield _cell(5.0, 0.38, 0.59, yield_acceleration=0.59)
    yield _cell(5.0, 0.38, _ulps(0.59, 1), yield_acceleration=0.59)
    yield _cell(5.0, 0.38, _ulps(0.59, 1), yield_acceleration=0.59, model="newmark")


def mode_limit() -> Iterator[Cell]:
    """A within rounding of Üg,lim: the mode, and with it the answer, may jump."""
    for theta, mu_s in PLANES:
        limit = float(_friction(theta, mu_s).limiting_acceleration)
        for amplitude in (
            limit * (1 - 1e-9),
            _ulps(limit, -1),
            limit,
            _ulps(limit, 1),
            limit * (1 + 1e-9),
        ):
            yield _cell(theta, mu_s, amplitude)


def near_failure() -> Iterator[Cell]:
    """μs within 10⁻ᵏ of tan θ: Üy is all cancellation, Kd small."""
    for theta in (5.0, 18.0):
        with workdps(40):
            tangent = gmpy2.tan(gmpy2.radians(mpfr(theta)))
        for k in (3, 6, 9, 12, 15):
            mu_s = float(tangent * (1 + mpfr(10) ** -k))
            for amplitude in (3 * _friction(theta, mu_s).yield_acceleration, 1.0):
                yield _cell(theta, mu_s, amplitude, cycles=2)
        yield _cell(
            theta, float(tangent * (1 + mpfr(10) ** -9)), 1.0, cycles=2, recoupling="integrate"
        )
        yield _cell(theta, float(tangent * (1 + mpfr(10) ** -9)), 1.0, cycles=2, model="newmark")


def level_plane() -> Iterator[Cell]:
    """θ = 0 or nearly: division by tan θ; the drift of a cycle must vanish."""
    for amplitude in (5.5, 9.0, 11.0, 14.0):
        for cycles in (1, 1000):
            yield _cell(0.0, 0.5, amplitude, cycles=cycles)
    yield _cell(0.0, 0.5, 6.0, recoupling="integrate", yield_acceleration=2.0)
    for theta in (1e-300, 1e-14, 1e-7):
        yield _cell(theta, 0.5, 9.0)
        yield _cell(theta, 0.5, 11.0, cycles=1000)


def uplift() -> Iterator[Cell]:
    """A tan θ → g: the normal force vanishes in the cycle."""
    for theta, mu_s in ((20.0, 0.6), (30.0, 0.9)):
        with workdps(40):
            uplift = mpfr(G) / gmpy2.tan(gmpy2.radians(mpfr(theta)))
        for k in (2, 5, 8, 11, 14):
            yield _cell(theta, mu_s, uplift * (1 - mpfr(10) ** -k), cycles=2)


def limit_undefined() -> Iterator[Cell]:
    """1 − tan θ (μs − tan θ) → 0: Üg,lim and Δμ grow without bound."""
    for theta in (45.0, 60.0):
        with workdps(40):
            tangent = gmpy2.tan(gmpy2.radians(mpfr(theta)))
            highest = tangent + 1 / tangent  # μs of a zero denominator
        for k in (2, 5, 8, 11, 14):
            mu_s = float(highest * (1 - mpfr(10) ** -k))
            onset = float(_friction(theta, mu_s).yield_acceleration)
            uplift = float(G / tangent)
            yield _cell(
                theta,
                mu_s,
                onset + 0.8 * (uplift - onset) if onset < uplift else 0.9 * uplift,
                cycles=2,
            )
            yield _cell(theta, mu_s, 0.9 * uplift, yield_acceleration=0.3 * uplift, cycles=2)


def friction_not_decaying() -> Iterator[Cell]:
    """μs ξ² → 1: λ is the logarithm of nearly 1, or there is none."""
    for theta, mu_s in ((5.0, 1.2), (0.0, 1.5)):
        limit = _friction(theta, mu_s).limiting_acceleration
        for k in (2, 5, 8, 11, 14):
            short = (1 - mpfr(10) ** -k) / gmpy2.sqrt(mpfr(mu_s))
            yield _cell(theta, mu_s, limit * short, cycles=2)
            limiting = _friction(theta, mu_s, yield_acceleration=2.0).limiting_acceleration
            yield _cell(theta, mu_s, limiting * short, cycles=2, yield_acceleration=2.0)
    # beyond μs ξ² = 1 there is no value, but of Newmark's block, which slides
    limit = _friction(0.0, 1.5, yield_acceleration=2.0).limiting_acceleration
    for k in (2, 8, 14):
        amplitude = limit * (1 + mpfr(10) ** -k) / gmpy2.sqrt(mpfr(1.5))
        yield _cell(0.0, 1.5, amplitude, cycles=2, yield_acceleration=2.0)
        yield _cell(0.0, 1.5, amplitude, cycles=2, yield_acceleration=2.0, model="newmark")
    # with the default Δμ Eq. 4 holds these blocks back; without it the friction starts from μs, and
    # on a level plane they slide as soon as it decays at all, which it does up to μs ξ = 1
    for k in (2, 5, 8, 11, 14):
        for side in (-1, 1):
            amplitude = limit * (1 + side * mpfr(10) ** -k) / mpfr(1.5)
            yield _cell(0.0, 1.5, amplitude, cycles=2, yield_acceleration=2.0, delta_mu=0.0)


def sharp_decay() -> Iterator[Cell]:
    """λA/g up to 10⁶: friction gone in a layer of 10⁻⁶ of phase."""
    for k in (2, 3, 4, 5, 6):
        for amplitude, onset in ((3.0, 0.59), (5.1, 0.08), (5.1, 1e-5)):
            friction = {
                "yield_acceleration": onset,
                "decay_rate": 10.0**k * G / amplitude,
                "delta_mu": 0.1,
            }
            yield _cell(5.0, 0.38, amplitude, cycles=2, **friction)
    friction = {"yield_acceleration": 1e-5, "decay_rate": 1e6 * G / 3.0, "delta_mu": 0.1}
    yield _cell(5.0, 0.38, 3.0, **friction)
    yield _cell(5.0, 0.38, 3.0, rise="literal", **friction)


def tangential_onset() -> Iterator[Cell]:
    """Eq. 4 touches Üg: a double root, or none; the slide shrinks to a point."""
    # D(x) = x − Eq. 4 vanishes where μs + Δμ = F(x) = e^(λx/g) (μs − tan θ + g tan θ / n).  On a
    # plane steeper than friction holds, F has a maximum: there Eq. 4 touches Üg from above.
    theta = 20.0
    mu_s = 0.2
    onset = 1.3 * G
    amplitude = 1.4 * G
    options = {"yield_acceleration": onset}
    with workdps(60):
        tangent = gmpy2.tan(gmpy2.radians(mpfr(theta)))
        g = mpfr(G)
        # n/g at the maximum
        excess = mu_s - tangent
        touching = mpfr("1.5")
        rate = tangent**2 / (touching * (touching * excess + tangent))
        options["decay_rate"] = float(rate)
        x = (touching - 1) * g / tangent
        level = gmpy2.exp(float(rate) * x / g) * (excess + tangent / touching) - mu_s
        for k in (2, 4, 6, 8, 10, 12):
            yield _cell(
                theta, mu_s, amplitude, **options, delta_mu=float(level * (1 - mpfr(10) ** -k))
            )
        yield _cell(
            theta, mu_s, amplitude, **options, delta_mu=float(level * (1 + mpfr(10) ** -12))
        )
        # or Eq. 4 falls to Üg at the very peak
        theta = 5.0
        mu_s = 0.38
        amplitude = 3.0
        rate = mpfr(4)
        tangent = gmpy2.tan(gmpy2.radians(mpfr(theta)))
        n = g + amplitude * tangent
        level = gmpy2.exp(rate * amplitude / g) * (mu_s - tangent + g * tangent / n) - mu_s
        for k in (2, 5, 8, 11, 14):
            friction = {"decay_rate": 4.0, "delta_mu": float(level * (1 - mpfr(10) ** -k))}
            yield _cell(theta, mu_s, amplitude, yield_acceleration=0.59, **friction)


def restick() -> Iterator[Cell]:
    """the block stops before the peak, and may start again."""
    for case in read_cases():
        if case.category == "restick":
            cell = case.arguments
            yield cell
            if case.case % 4 == 0:
                yield {**cell, "recoupling": "integrate"}
                yield {**cell, "rise": "literal"}


def stop_at_next_onset() -> Iterator[Cell]:
    """V reaches 0 just as the next slide begins."""
    for theta, mu_s, model in (
        (18.0, 0.34, "mendez"),
        (5.0, 0.12, "mendez"),
        (10.0, 0.2, "mendez"),
    ):
        onset = float(_friction(theta, mu_s).yield_acceleration)
        low = onset
        high = float(_friction(theta, mu_s).limiting_acceleration)
        if reference.solve(**_cell(theta, mu_s, high, cycles=2, model=model)).recoupled:
            continue
        while _ulps(low, 1) < high:
            middle = 0.5 * (low + high)
            recoupled = reference.solve(
                **_cell(theta, mu_s, middle, cycles=2, model=model)
            ).recoupled
            low, high = (middle, high) if recoupled else (low, middle)
        for amplitude in (low * (1 - 1e-9), low, high, high * (1 + 1e-9)):
            yield _cell(theta, mu_s, amplitude, cycles=3, model=model)


def vanishing_kd() -> Iterator[Cell]:
    """Kd → 0 under the literal rise: u = v²/(2b) grows without bound."""
    theta = 5.0
    mu_s = 0.38
    amplitude = 1.5
    rate = 4.0
    with workdps(60):
        tangent = gmpy2.tan(gmpy2.radians(mpfr(theta)))
        g = mpfr(G)
        n = g + amplitude * tangent
        for k in (1, 3, 6, 9, 12):
            friction = mu_s - tangent - (amplitude * (1 - mpfr(10) ** -k) - g * tangent) / n
            options = {
                "decay_rate": rate,
                "delta_mu": float(friction * gmpy2.exp(rate * amplitude / g) - mu_s),
            }
            yield _cell(theta, mu_s, amplitude, yield_acceleration=0.59, rise="literal", **options)


def many_cycles() -> Iterator[Cell]:
    """10⁶ cycles: rounding adds up, or a loop takes for ever."""
    for theta, mu_s, amplitude in (
        (5.0, 0.38, 3.55),
        (6.0, 0.38, 5.1),
        (0.0, 0.5, 11.0),
        (18.0, 0.34, 2.0),
    ):
        for model in ("mendez", "newmark"):
            yield _cell(theta, mu_s, amplitude, cycles=10**6, model=model)
    yield _cell(6.0, 0.38, 5.1, cycles=10**6, yield_acceleration=0.08)
    yield _cell(1e-7, 0.5, 11.0, cycles=10**6)


def frequencies() -> Iterator[Cell]:
    """f from 10⁻⁶ to 10⁶ Hz: 1/ω² over 24 decades."""
    for theta, mu_s, amplitude in ((5.0, 0.38, 3.55), (6.0, 0.38, 7.0), (0.0, 0.5, 11.0)):
        for frequency in (1e-6, 1e-3, 1e3, 1e6):
            yield {**_cell(theta, mu_s, amplitude, cycles=3), "frequency": frequency}


def magnitudes() -> Iterator[Cell]:
    """subnormal accelerations."""
    for amplitude in (2e-323, 1e-200, 1e-100):
        yield _cell(5.0, 0.38, amplitude, yield_acceleration=0.5 * amplitude, model="newmark")
    for amplitude in (1e-200, 1e-100):
        friction = {"yield_acceleration": 0.5 * amplitude, "decay_rate": 1.0, "delta_mu": 0.0}
        yield _cell(5.0, 0.38, amplitude, **friction)


def float32() -> Iterator[Cell]:
    """results kept in single precision: subnormal there."""
    for frequency in (1e-6, 1.0, 1e6):
        yield {**_cell(5.0, 0.38, 3.55), "frequency": frequency}
    for amplitude in (1e-43, 1e-38):  # u is about as large: subnormal, the least normal
        yield _cell(5.0, 0.38, amplitude, yield_acceleration=0.5 * amplitude, model="newmark")


CATEGORIES: tuple[Category, ...] = (
    just_above_yield,
    mode_limit,
    near_failure,
    level_plane,
    uplift,
    limit_undefined,
    friction_not_decaying,
    sharp_decay,
    tangential_onset,
    restick,
    stop_at_next_onset,
    vanishing_kd,
    many_cycles,
    frequencies,
    magnitudes,
    float32,
)


def dtype_of(category: str) -> str:
    """Type in which the results of a category are kept."""
    return "float32" if category == "float32" else "float64"


def neighbours(cell: Cell) -> Iterator[Cell]:
    """`cell` with one of its doubles, g included, one ulp up or down."""
    for name, value in {"g": G, **cell}.items():
        if isinstance(value, float):
            for toward in (-math.inf, math.inf):
                moved = math.nextafter(value, toward)
                if (
                    name == "yield_acceleration"
                    or moved > 0
                    or (moved == 0 and name in ("theta", "amplitude"))
                ):
                    yield {**cell, name: moved}


def bound_of(value: mpfr, others: Iterable[mpfr], dtype: str = "float64") -> mpfr:
    """Largest difference from the results of the neighbours, plus half an ulp of the result."""
    moves = [abs(other - value) for other in others if not gmpy2.is_nan(other)]
    return (
        max(moves, default=mpfr(0)) + mpfr(float(np.spacing(np.dtype(dtype).type(abs(value))))) / 2
    )


def conditioning(cell: Cell, dtype: str = "float64") -> dict[str, str]:
    """Results of the reference, and their bounds: the effect of an ulp of an input."""
    answer = reference.solve(**cell)
    others = [reference.solve(**other) for other in neighbours(cell)]
    row = {"sliding_mode": str(answer.sliding_mode), "validity": str(answer.validity)}
    with workdps(60):
        for result, bound in (
            ("permanent_displacement", "displacement_bound"),
            ("peak_relative_velocity", "velocity_bound"),
        ):
            value = getattr(answer, result)
            has_none = gmpy2.is_nan(value)
            row[result] = "" if has_none else shown(value, 30)
            moved = bound_of(value, (getattr(other, result) for other in others), dtype)
            row[bound] = "" if has_none else shown(moved, 6)
    outcomes = sorted({(other.sliding_mode, other.validity) for other in [answer, *others]})
    return {**row, "outcomes": " ".join(f"{mode}:{validity}" for mode, validity in outcomes)}
