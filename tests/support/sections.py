"""The shaking in sections on which Üg is smooth, monotone and of one sign; roots and integrals to any precision."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, TypeAlias

from mpmath import mp, mpf, workdps
from scipy.special import roots_legendre

Function: TypeAlias = Callable[[mpf], mpf]


@lru_cache
def _gauss_legendre(count: int, precision: int) -> list[tuple[mpf, mpf]]:
    """Nodes and weights of the `count`-point rule on (0, 1), at `precision` bits."""
    rule = []
    for near in roots_legendre(count)[0]:
        node = mp.findroot(lambda x: mp.legendre(count, x), mpf(near))
        weight = (1 - node**2) / ((count + 1) * mp.legendre(count + 1, node)) ** 2
        rule.append(((1 + node) / 2, weight))
    return rule


def root(f: Function, low: mpf, high: mpf) -> mpf:
    """Root of `f` in a bracket: bisection made faster by inverse quadratic steps (Chandrupatla)."""
    a, b = high, low
    f_a, f_b = f(a), f(b)
    if f_a == 0 or f_b == 0:
        return a if f_a == 0 else b
    assert mp.sign(f_a) != mp.sign(f_b), "no change of sign in the bracket"
    width = mpf(1) / 2
    while True:
        x = a + width * (b - a)
        f_x = f(x)
        if mp.sign(f_x) == mp.sign(f_a):
            c, f_c = a, f_a
        else:
            c, f_c = b, f_b
            b, f_b = a, f_a
        a, f_a = x, f_x
        best = a if abs(f_a) < abs(f_b) else b
        tolerance = 4 * mp.eps * abs(best) / abs(b - a) if b != a else mpf(1)
        if tolerance > 0.5 or f_a == 0:
            return best
        xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            width = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
        else:
            width = mpf(1) / 2
        width = min(1 - tolerance, max(tolerance, width))


def _zeros(f: Function, grid: Sequence[mpf]) -> list[mpf]:
    values = [f(x) for x in grid]
    return [root(f, a, b) for (a, x), (b, y) in pairwise(zip(grid, values, strict=True)) if x * y < 0]


# ----------------------------------------------------------------------------------------- the shaking


@dataclass(frozen=True)
class Section:
    """A part of the shaking on which Üg is smooth, monotone and of one sign.

    `longest` is the length on which the rule of many nodes is exact, and `nodes` are those that Üg itself takes.
    """

    start: mpf
    end: mpf
    first: mpf
    last: mpf
    ground: Function
    longest: mpf
    nodes: int

    @property
    def side(self) -> int:
        return int(mp.sign(self.first + self.last))

    def phase(self, ground: mpf) -> mpf:
        """Where the base's acceleration is `ground`, a value between the first and the last."""
        rounding = mp.eps * 2**20 * abs(self.last - self.first)
        for end, value in ((self.start, self.first), (self.end, self.last)):
            if abs(ground - value) <= rounding:
                return end
        return root(lambda phi: self.ground(phi) - ground, self.start, self.end)

    def cut(self, ground: mpf) -> "Section":
        """The part from `ground` on."""
        return replace(self, start=self.phase(ground), first=ground)

    def integrals(self, rate: Function, start: mpf, end: mpf, decay: mpf) -> tuple[mpf, mpf]:
        """Integrals of rate(Üg) and of (end - φ) rate(Üg); `decay` is that of the friction in it, 1/(m/s²)."""
        rule = _gauss_legendre(30 if decay else self.nodes, mp.prec)
        cuts = [start, end]
        if decay:  # the friction falls by e^-8 at most over a part, until it is negligible
            least, greatest = sorted((abs(self.ground(start)), abs(self.ground(end))))
            count = min(int((greatest - least) * decay / 8.001), int(mp.dps * math.log(10) / 8))
            levels = [self.side * (least + 8 * j / decay) for j in range(1, count + 1)]
            with workdps(15):  # these places are of no consequence to the last digit
                cuts[1:1] = sorted(self.phase(x) for x in levels)
        first = second = mpf(0)
        for a, b in pairwise(cuts):
            parts = int(mp.ceil((b - a) / self.longest))
            for i in range(parts):
                left, width = a + (b - a) * i / parts, (b - a) / parts
                for node, weight in rule:
                    phi = left + node * width
                    term = weight * width * rate(self.ground(phi))
                    first += term
                    second += term * (end - phi)
        return first, second


@dataclass(frozen=True)
class Waveform:
    """A wave of peak 1 under its envelope; `harmonics` are "amplitude:multiple:phase in degrees, ..."."""

    name: str
    harmonics: str
    cycles: int
    ramp_in: float
    ramp_out: float

    def terms(self) -> list[tuple[mpf, int, mpf]]:
        text = {"cosine": "1:1:90", "harmonics": self.harmonics}.get(self.name, "1:1:0")
        rows = [term.split(":") for term in text.split(",")]
        return [(mpf(float(a)), int(m), mp.radians(mpf(float(p)))) for a, m, p in rows]

    def alike(self, n: int) -> int:
        """Number of cycles from cycle n on that are the same; 1 within a ramp."""
        return max(1, self.cycles - math.ceil(self.ramp_out) - n) if n >= math.ceil(self.ramp_in) else 1

    def sections(self, n: int, amplitude: mpf) -> Iterator[Section]:
        """Cycle n, its phase from 0 on."""
        first_alike = math.ceil(self.ramp_in)
        number = first_alike if self.alike(first_alike) > n - first_alike >= 0 else n
        for start, end, first, last, unit, longest, nodes in _unit_sections(self, number, mp.prec):

            def ground(phi: mpf, unit: Function = unit) -> mpf:
                return amplitude * unit(phi)

            yield Section(start, end, amplitude * first, amplitude * last, ground, longest, nodes)


@lru_cache
def _unit_sections(wave: Waveform, n: int, precision: int) -> list[tuple[Any, ...]]:
    """The sections of a cycle for A = 1."""
    quarter, terms = mp.pi / 2, wave.terms()
    fastest = max(m for _, m, _ in terms)
    pieces = [(mpf(0), 4 * quarter, lambda phi: _harmonic(terms, phi), lambda phi: _harmonic_slope(terms, phi))]
    if wave.name == "sine":  # the same, in a third of the time
        pieces = [(mpf(0), 4 * quarter, mp.sin, mp.cos)]
    if wave.name in ("triangle", "square"):
        lines = [(0, 1), (2, -1), (2, -1), (-4, 1)] if wave.name == "triangle" else [(1, 0), (1, 0), (-1, 0), (-1, 0)]
        pieces = [(i * quarter, (i + 1) * quarter, *_line(at, rate / quarter)) for i, (at, rate) in enumerate(lines)]
    scale = mpf(1)
    if wave.name == "harmonics":
        grid = [4 * quarter * i / (24 * fastest) for i in range(24 * fastest + 1)]
        scale = max(abs(_harmonic(terms, phi)) for phi in _zeros(lambda phi: _harmonic_slope(terms, phi), grid))
    kinks = [4 * quarter * (mpf(wave.ramp_in) - n), 4 * quarter * (wave.cycles - mpf(wave.ramp_out) - n)]
    found = []
    for start, end, w, slope in pieces:
        for a, b in pairwise([start, *(kink for kink in kinks if start < kink < end), end]):
            height, incline = mpf(1) / scale, mpf(0)
            if (a + b) / 2 < kinks[0]:
                height, incline = n / mpf(wave.ramp_in) / scale, 1 / (4 * quarter * mpf(wave.ramp_in)) / scale
            elif (a + b) / 2 > kinks[1]:
                height = (wave.cycles - n) / mpf(wave.ramp_out) / scale
                incline = -1 / (4 * quarter * mpf(wave.ramp_out)) / scale

            def unit(phi: mpf, w: Function = w, height: mpf = height, incline: mpf = incline) -> mpf:
                return (height + incline * phi) * w(phi)

            def rate(
                phi: mpf, w: Function = w, dw: Function = slope, height: mpf = height, incline: mpf = incline
            ) -> mpf:
                return incline * w(phi) + (height + incline * phi) * dw(phi)

            straight = wave.name in ("triangle", "square")
            grid = [a + (b - a) * i / (24 * fastest + 7) for i in range(24 * fastest + 8)]
            zeros = [] if straight else _zeros(unit, grid)
            turns = [] if wave.name == "square" and not incline else _zeros(rate, grid)
            ends = [a]
            for phi in [*sorted([*zeros, *turns]), b]:
                if phi - ends[-1] > mpf(10) ** (-mp.dps // 2):
                    ends.append(phi)
            for x, y in pairwise(ends):
                values = [mpf(0) if abs(unit(phi)) < mp.eps * 2**20 else unit(phi) for phi in (x, y)]
                shape = w if height == 1 and incline == 0 else unit
                found.append(
                    (x, y, *values, shape, 4 * quarter if straight else quarter / 2 / fastest, 2 if straight else 12)
                )
    return found


def _harmonic(terms: list[tuple[mpf, int, mpf]], phi: mpf) -> mpf:
    return mp.fsum(a * mp.sin(m * phi + p) for a, m, p in terms)


def _harmonic_slope(terms: list[tuple[mpf, int, mpf]], phi: mpf) -> mpf:
    return mp.fsum(a * m * mp.cos(m * phi + p) for a, m, p in terms)


def _line(at: int, rate: mpf) -> tuple[Function, Function]:
    """A straight line and its slope."""
    return (lambda phi: at + rate * phi), (lambda phi: rate)


def sections_of_record(times: Any, values: Sequence[mpf]) -> list[Section]:
    """Straight lines between the samples, cut at zero."""
    found = []
    for (t0, first), (t1, last) in pairwise(zip(times, values, strict=True)):
        length = mpf(t1) - mpf(t0)
        ends = [(mpf(0), first), (length, last)]
        if first * last < 0:
            ends.insert(1, (-first * length / (last - first), mpf(0)))
        for (a, x), (b, y) in pairwise(ends):

            def ground(t: mpf, a: mpf = a, x: mpf = x, slope: mpf = (y - x) / (b - a)) -> mpf:
                return x + slope * (t - a)

            found.append(Section(a, b, x, y, ground, b - a, 2))
    return found
