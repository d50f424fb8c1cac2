"""Shaking in sections on which Üg is smooth, monotone and of one sign; roots and integrals."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, TypeAlias

import gmpy2
import mpmath
from gmpy2 import mpfr
from scipy.special import roots_legendre

from tests.support.digits import decimals, epsilon, workdps

Function: TypeAlias = Callable[[mpfr], mpfr]


@lru_cache
def _gauss_legendre(count: int, digits: int) -> list[tuple[mpfr, mpfr]]:
    """Nodes and weights of the `count`-point rule on (0, 1)."""
    rule = []
    with mpmath.workdps(digits):
        for near in roots_legendre(count)[0]:
            node = mpmath.findroot(lambda x: mpmath.legendre(count, x), near)
            weight = (1 - node**2) / ((count + 1) * mpmath.legendre(count + 1, node)) ** 2
            rule.append((mpfr(str((1 + node) / 2)), mpfr(str(weight))))
    return rule


def root(f: Function, low: mpfr, high: mpfr) -> mpfr:
    """Root of `f` in a bracket: bisection made faster by inverse quadratic steps (Chandrupatla)."""
    a = high
    b = low
    f_a = f(a)
    f_b = f(b)
    if f_a == 0 or f_b == 0:
        return a if f_a == 0 else b
    assert gmpy2.sign(f_a) != gmpy2.sign(f_b), "no change of sign in the bracket"
    width = mpfr(1) / 2
    while True:
        x = a + width * (b - a)
        f_x = f(x)
        if gmpy2.sign(f_x) == gmpy2.sign(f_a):
            c = a
            f_c = f_a
        else:
            c = b
            f_c = f_b
            b = a
            f_b = f_a
        a = x
        f_a = f_x
        best = a if abs(f_a) < abs(f_b) else b
        tolerance = 4 * epsilon() * abs(best) / abs(b - a) if b != a else mpfr(1)
        if tolerance > 0.5 or f_a == 0:
            return best
        xi = (a - b) / (c - b)
        phi = (f_a - f_b) / (f_c - f_b)
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            width = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (
                f_c - f_a
            ) * f_b / (f_c - f_b)
        else:
            width = mpfr(1) / 2
        width = min(1 - tolerance, max(tolerance, width))


def _zeros(f: Function, grid: Sequence[mpfr]) -> list[mpfr]:
    values = [f(x) for x in grid]
    return [
        root(f, a, b) for (a, x), (b, y) in pairwise(zip(grid, values, strict=True)) if x * y < 0
    ]


# ----------------------------------------------------------------------------------------- the
# shaking


@dataclass(frozen=True)
class Section:
    """A part of the shaking on which Üg is smooth, monotone and of one sign.

    `longest` is the length on which the rule of many nodes is exact, and `nodes` are those that Üg
    itself takes.
    """

    start: mpfr
    end: mpfr
    first: mpfr
    last: mpfr
    ground: Function
    longest: mpfr
    nodes: int

    @property
    def side(self) -> int:
        return int(gmpy2.sign(self.first + self.last))

    def phase(self, ground: mpfr) -> mpfr:
        """Where the base's acceleration is `ground`, a value between the first and the last."""
        rounding = epsilon() * 2**20 * abs(self.last - self.first)
        for end, value in ((self.start, self.first), (self.end, self.last)):
            if abs(ground - value) <= rounding:
                return end
        return root(lambda phi: self.ground(phi) - ground, self.start, self.end)

    def cut(self, ground: mpfr) -> "Section":
        """The part from `ground` on."""
        return replace(self, start=self.phase(ground), first=ground)

    def integrals(self, rate: Function, start: mpfr, end: mpfr, decay: mpfr) -> tuple[mpfr, mpfr]:
        """Integrals of rate(Üg) and (end - φ) rate(Üg); `decay` of its friction in 1/(m/s²)."""
        rule = _gauss_legendre(30 if decay else self.nodes, decimals())
        cuts = [start, end]
        if decay:  # the friction falls by e^-8 at most over a part, until it is negligible
            least, greatest = sorted((abs(self.ground(start)), abs(self.ground(end))))
            count = min(
                int(gmpy2.floor((greatest - least) * decay / 8.001)),
                int(decimals() * math.log(10) / 8),
            )
            levels = [self.side * (least + 8 * j / decay) for j in range(1, count + 1)]
            with workdps(15):  # these places are of no consequence to the last digit
                cuts[1:1] = sorted(self.phase(x) for x in levels)
        first = second = mpfr(0)
        for a, b in pairwise(cuts):
            parts = int(gmpy2.ceil((b - a) / self.longest))
            for i in range(parts):
                left = a + (b - a) * i / parts
                width = (b - a) / parts
                for node, weight in rule:
                    phi = left + node * width
                    term = weight * width * rate(self.ground(phi))
                    first += term
                    second += term * (end - phi)
        return first, second


@dataclass(frozen=True)
class Waveform:
    """A wave of peak 1 under its envelope; `harmonics`: "amplitude:multiple:phase (°), ..."."""

    name: str
    harmonics: str
    cycles: int
    ramp_in: float
    ramp_out: float

    def terms(self) -> list[tuple[mpfr, int, mpfr]]:
        text = {"cosine": "1:1:90", "harmonics": self.harmonics}.get(self.name, "1:1:0")
        rows = [term.split(":") for term in text.split(",")]
        return [(mpfr(float(a)), int(m), gmpy2.radians(mpfr(float(p)))) for a, m, p in rows]

    def alike(self, n: int) -> int:
        """Number of cycles from cycle n on that are the same; 1 within a ramp."""
        return (
            max(1, self.cycles - math.ceil(self.ramp_out) - n)
            if n >= math.ceil(self.ramp_in)
            else 1
        )

    def sections(self, n: int, amplitude: mpfr) -> Iterator[Section]:
        """Cycle n, its phase from 0 on."""
        first_alike = math.ceil(self.ramp_in)
        number = first_alike if self.alike(first_alike) > n - first_alike >= 0 else n
        for start, end, first, last, unit, longest, nodes in _unit_sections(
            self, number, decimals()
        ):

            def ground(phi: mpfr, unit: Function = unit) -> mpfr:
                return amplitude * unit(phi)

            yield Section(start, end, amplitude * first, amplitude * last, ground, longest, nodes)


@lru_cache
def _unit_sections(wave: Waveform, n: int, digits: int) -> list[tuple[Any, ...]]:
    """The sections of a cycle for A = 1."""
    quarter = gmpy2.const_pi() / 2
    terms = wave.terms()
    fastest = max(m for _, m, _ in terms)
    pieces = [
        (
            mpfr(0),
            4 * quarter,
            lambda phi: _harmonic(terms, phi),
            lambda phi: _harmonic_slope(terms, phi),
        )
    ]
    if wave.name in ("triangle", "square"):
        lines = (
            [(0, 1), (2, -1), (2, -1), (-4, 1)]
            if wave.name == "triangle"
            else [(1, 0), (1, 0), (-1, 0), (-1, 0)]
        )
        pieces = [
            (i * quarter, (i + 1) * quarter, *_line(at, rate / quarter))
            for i, (at, rate) in enumerate(lines)
        ]
    scale = mpfr(1)
    if wave.name == "harmonics":
        grid = [4 * quarter * i / (24 * fastest) for i in range(24 * fastest + 1)]
        scale = max(
            abs(_harmonic(terms, phi))
            for phi in _zeros(lambda phi: _harmonic_slope(terms, phi), grid)
        )
    kinks = [
        4 * quarter * (mpfr(wave.ramp_in) - n),
        4 * quarter * (wave.cycles - mpfr(wave.ramp_out) - n),
    ]
    sections = []
    for start, end, w, slope in pieces:
        for a, b in pairwise([start, *(kink for kink in kinks if start < kink < end), end]):
            height = mpfr(1) / scale
            incline = mpfr(0)
            if (a + b) / 2 < kinks[0]:
                height = n / mpfr(wave.ramp_in) / scale
                incline = 1 / (4 * quarter * mpfr(wave.ramp_in)) / scale
            elif (a + b) / 2 > kinks[1]:
                height = (wave.cycles - n) / mpfr(wave.ramp_out) / scale
                incline = -1 / (4 * quarter * mpfr(wave.ramp_out)) / scale

            def unit(
                phi: mpfr, w: Function = w, height: mpfr = height, incline: mpfr = incline
            ) -> mpfr:
                return (height + incline * phi) * w(phi)

            def rate(
                phi: mpfr,
                w: Function = w,
                dw: Function = slope,
                height: mpfr = height,
                incline: mpfr = incline,
            ) -> mpfr:
                return incline * w(phi) + (height + incline * phi) * dw(phi)

            straight = wave.name in ("triangle", "square")
            grid = [a + (b - a) * i / (24 * fastest + 7) for i in range(24 * fastest + 8)]
            zeros = [] if straight else _zeros(unit, grid)
            turns = [] if wave.name == "square" and not incline else _zeros(rate, grid)
            ends = [a]
            for phi in [*sorted([*zeros, *turns]), b]:
                if phi - ends[-1] > mpfr(10) ** (-decimals() // 2):
                    ends.append(phi)
            for x, y in pairwise(ends):
                values = [
                    mpfr(0) if abs(unit(phi)) < epsilon() * 2**20 else unit(phi) for phi in (x, y)
                ]
                shape = w if height == 1 and incline == 0 else unit
                sections.append(
                    (
                        x,
                        y,
                        *values,
                        shape,
                        4 * quarter if straight else quarter / 2 / fastest,
                        2 if straight else 12,
                    )
                )
    return sections


def _harmonic(terms: list[tuple[mpfr, int, mpfr]], phi: mpfr) -> mpfr:
    return sum((a * gmpy2.sin(m * phi + p) for a, m, p in terms), mpfr(0))


def _harmonic_slope(terms: list[tuple[mpfr, int, mpfr]], phi: mpfr) -> mpfr:
    return sum((a * m * gmpy2.cos(m * phi + p) for a, m, p in terms), mpfr(0))


def _line(at: int, rate: mpfr) -> tuple[Function, Function]:
    """A straight line and its slope."""
    return (lambda phi: at + rate * phi), (lambda phi: rate)


def sections_of_record(times: Any, values: Sequence[mpfr]) -> list[Section]:
    """Straight lines between the samples, cut at zero."""
    sections = []
    for (t0, first), (t1, last) in pairwise(zip(times, values, strict=True)):
        length = mpfr(t1) - mpfr(t0)
        ends = [(mpfr(0), first), (length, last)]
        if first * last < 0:
            ends.insert(1, (-first * length / (last - first), mpfr(0)))
        for (a, x), (b, y) in pairwise(ends):

            def ground(t: mpfr, a: mpfr = a, x: mpfr = x, slope: mpfr = (y - x) / (b - a)) -> mpfr:
                return x + slope * (t - a)

            sections.append(Section(a, b, x, y, ground, b - a, 2))
    return sections
