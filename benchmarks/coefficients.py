"""Coefficients of the polynomials of `slipsweep.jit.elementary`, by mpmath.

    python -m benchmarks.coefficients

Each function, divided by the power of its argument with which it begins, is interpolated at Chebyshev nodes, in 60
digits; the coefficients are rounded to doubles.  They are printed as they stand in the source, in two or four sums,
and the error of the polynomial with rounded coefficients, relative to the function.
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
    """A function of z on [start, end], the number of nodes, and in how many sums the polynomial is taken.

    `variable` is the argument's name in the source.
    """

    variable: str
    function: Callable[[Any], Any]
    start: Any
    end: Any
    nodes: int
    sums: int = 2

    def coefficients(self) -> list[float]:
        """Those of the polynomial through the values at the nodes, highest power first."""
        with mpmath.workdps(DIGITS):
            start, end = mpmath.mpf(self.start), mpmath.mpf(self.end)
            angles = [(2 * k + 1) * mpmath.pi / (2 * self.nodes) for k in range(self.nodes)]
            places = [(start + end) / 2 + (end - start) / 2 * mpmath.cos(angle) for angle in angles]
            powers = mpmath.matrix([[place**power for power in range(self.nodes)] for place in places])
            found = mpmath.lu_solve(powers, mpmath.matrix([self.function(place) for place in places]))
            return [float(one) for one in reversed(found)]

    def error(self, coefficients: list[float]) -> float:
        """Largest error relative to the function."""
        with mpmath.workdps(DIGITS):
            start, end = mpmath.mpf(self.start), mpmath.mpf(self.end)
            places = [start + (end - start) * (2 * k + 1) / (2 * POINTS) for k in range(POINTS)]
            return max(float(abs(mpmath.polyval(coefficients, z) / self.function(z) - 1)) for z in places)

    def source(self, coefficients: list[float]) -> str:
        """The polynomial as it stands in the source: sums of every second or fourth power.

        They do not wait for each other.  The lowest power, which is most of the value, is added last and rounded once.
        """
        z, lines = self.variable, []
        *higher, lowest = coefficients
        for least in range(self.sums):
            first, *others = higher[::-1][least :: self.sums][::-1]
            lines.append(f"p{least} = {first!r}")
            lines += [f"p{least} = p{least} * {z}{self.sums} {_plus(one)}" for one in others]
        joined = f"p1 * {z} + p0" if self.sums == 2 else f"(p3 * {z} + p2) * {z}2 + (p1 * {z} + p0)"
        return "\n".join(f"    {line}" for line in (*lines, f"p = ({joined}) * {z} {_plus(lowest)}"))


def _plus(coefficient: float) -> str:
    return f"{'-' if coefficient < 0 else '+'} {abs(coefficient)!r}"


def _after(power: int, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """function(√z) over √z^power."""
    return lambda z: function(mpmath.sqrt(z)) / mpmath.sqrt(z) ** power


def newmark_displacement(ratio: Any) -> Any:
    """W/A of a cycle of Newmark's block with Üy/A = `ratio` under a sine."""
    if ratio == 0:
        return 2 * mpmath.pi
    onset = mpmath.asin(ratio)

    def velocity(phi: Any) -> Any:
        return mpmath.cos(onset) - mpmath.cos(phi) - ratio * (phi - onset)

    # from the second Üg = Üy on V falls; counted from the peak of Üg that comes at −1, and the stop at 2 to 3
    half = mpmath.acos(ratio)
    bracket = (mpmath.pi / 2 + half, mpmath.pi / 2 + 3 * half)
    stop = mpmath.findroot(velocity, bracket, solver="anderson", maxsteps=200, verify=False)
    slid = stop - onset
    return mpmath.cos(onset) * slid - (mpmath.sin(stop) - ratio) - ratio * slid**2 / 2


with mpmath.workdps(DIGITS):
    #: A rounded quotient may leave a little more than ln 2 / 2.
    _HALF_LN2 = mpmath.log(2) / 2 * mpmath.mpf("1.0001")
    _QUARTER = (mpmath.pi / 2) ** 2

#: By the name of the function in the source.
APPROXIMATIONS = {
    "exp": Approximation("r", lambda r: (mpmath.exp(r) - 1 - r) / r**2, -_HALF_LN2, _HALF_LN2, 10),
    "versine": Approximation("z", _after(2, lambda x: 1 - mpmath.cos(x)), 0, _QUARTER, 9),
    "angle_minus_sine": Approximation("z", _after(3, lambda x: x - mpmath.sin(x)), 0, _QUARTER, 9),
    "half_square_minus_versine": Approximation("z", _after(4, lambda x: x**2 / 2 - 1 + mpmath.cos(x)), 0, _QUARTER, 9),
    "inverse_versine": Approximation("z", _after(1, mpmath.asin), 0, 0.5, 20, 4),
}


def main() -> None:
    """Print all polynomials."""
    for name, approximation in APPROXIMATIONS.items():
        coefficients = approximation.coefficients()
        print(f"{name}: relative error {approximation.error(coefficients):.1e}")
        print(approximation.source(coefficients))


if __name__ == "__main__":
    main()
