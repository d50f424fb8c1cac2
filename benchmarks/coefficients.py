"""Coefficients of the polynomials of `slipsweep.jit.elementary`, by mpmath.

    python -m benchmarks.coefficients

Each function, divided by the power of its argument with which it begins, is interpolated at
Chebyshev nodes, in 60 digits; the coefficients are rounded to doubles.  They are printed lowest
power first, as they stand in the source, and the error of the polynomial with rounded coefficients,
relative to the function.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath

DIGITS = 60
#: Points at which errors are looked for.
POINTS = 2000


@dataclass(frozen=True)
class Approximation:
    """A function of z on [start, end], and the number of nodes."""

    function: Callable[[Any], Any]
    start: Any
    end: Any
    nodes: int

    def coefficients(self) -> list[float]:
        """Those of the polynomial through the values at the nodes, lowest power first."""
        with mpmath.workdps(DIGITS):
            start = mpmath.mpf(self.start)
            end = mpmath.mpf(self.end)
            angles = [(2 * k + 1) * mpmath.pi / (2 * self.nodes) for k in range(self.nodes)]
            places = [(start + end) / 2 + (end - start) / 2 * mpmath.cos(angle) for angle in angles]
            powers = mpmath.matrix(
                [[place**power for power in range(self.nodes)] for place in places]
            )
            solution = mpmath.lu_solve(
                powers, mpmath.matrix([self.function(place) for place in places])
            )
            return [float(coefficient) for coefficient in solution]

    def error(self, coefficients: list[float]) -> float:
        """Largest error relative to the function."""
        with mpmath.workdps(DIGITS):
            start = mpmath.mpf(self.start)
            end = mpmath.mpf(self.end)
            places = [start + (end - start) * (2 * k + 1) / (2 * POINTS) for k in range(POINTS)]
            return max(
                float(abs(mpmath.polyval(coefficients[::-1], z) / self.function(z) - 1))
                for z in places
            )


def _after(power: int, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """function(√z) over √z^power."""
    return lambda z: function(mpmath.sqrt(z)) / mpmath.sqrt(z) ** power


with mpmath.workdps(DIGITS):
    #: A rounded quotient may leave a little more than ln 2 / 2.
    _HALF_LN2 = mpmath.log(2) / 2 * mpmath.mpf("1.0001")
    _QUARTER = (mpmath.pi / 2) ** 2

#: By the name of the function in the source.
APPROXIMATIONS = {
    "exp": Approximation(lambda r: (mpmath.exp(r) - 1 - r) / r**2, -_HALF_LN2, _HALF_LN2, 10),
    "versine": Approximation(_after(2, lambda x: 1 - mpmath.cos(x)), 0, _QUARTER, 9),
    "angle_minus_sine": Approximation(_after(3, lambda x: x - mpmath.sin(x)), 0, _QUARTER, 9),
    "half_square_minus_versine": Approximation(
        _after(4, lambda x: x**2 / 2 - 1 + mpmath.cos(x)), 0, _QUARTER, 9
    ),
    "inverse_versine": Approximation(_after(1, mpmath.asin), 0, 0.5, 20),
}


def main() -> None:
    """Print all polynomials."""
    for name, approximation in APPROXIMATIONS.items():
        coefficients = approximation.coefficients()
        print(f"{name}: relative error {approximation.error(coefficients):.1e}")
        print(coefficients)


if __name__ == "__main__":
    main()
