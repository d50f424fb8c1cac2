"""The motion rules of the model solved in multiple precision for any waveform.

Unlike the solvers, which have polynomials on pieces, this evaluates the waveform by its definition:
the shaking is cut into monotone sections by bracketed roots of w and w', every event is a bracketed
root of its own condition in φ, and every integral a Gauss-Legendre rule in φ.  Cycle after cycle, no shortcut.
Friction and Eq. 4 are those of `reference`, as is the notation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from mpmath import mp, mpf, workdps

from tests.support.flag_definitions import KD_NOT_POSITIVE, NOT_RECOUPLED, YIELD_GOVERNS, remarks
from tests.support.reference import (
    CONTINUOUS,
    MISSING,
    STUCK,
    Solution,
    _friction_parameters,
    _gauss_legendre,
    _given,
    _Interface,
    _root,
)

Function = Callable[[mpf], mpf]

#: Digits: results are compared with doubles, but just above yield u goes with (A - Uy)**2.
DIGITS = 40


@dataclass
class Section:
    """A stretch of phase on which the plane's acceleration is smooth, monotone and of one sign."""

    start: mpf
    end: mpf
    ground: Function
    fastest: int

    @property
    def first(self) -> mpf:
        return self.ground(self.start)

    @property
    def last(self) -> mpf:
        return self.ground(self.end)

    @property
    def side(self) -> int:
        return 1 if self.ground((self.start + self.end) / 2) > 0 else -1

    def phase(self, ground: mpf) -> mpf:
        """Where the plane's acceleration is `ground`."""
        return _root(lambda phi: self.ground(phi) - ground, self.start, self.end)

    def integrals(self, f: Function, start: mpf, end: mpf, decay: mpf) -> tuple[mpf, mpf]:
        """Integrals of f(ground) and of (end - phi) f(ground); `decay` is that of the friction, 1/(m/s2)."""
        rule = _gauss_legendre(DIGITS, mp.prec)
        x, y = self.ground(start), self.ground(end)
        least, swing = min(abs(x), abs(y)), abs(y - x) * decay
        # the friction falls by e^-6 at most on a part, until it is negligible
        levels = [least + 6 * j / decay for j in range(1, 17) if 6 * j < swing]
        cuts = {start, end, *(phi for level in levels if start < (phi := self.phase(self.side * level)) < end)}
        ends = [start]
        for a, b in pairwise(sorted(cuts)):
            parts = 1 + int(mp.ceil((b - a) * self.fastest))
            ends += [a + (b - a) * i / parts for i in range(1, parts + 1)]
        first = second = mpf(0)
        for a, b in pairwise(ends):
            for node, weight in rule:
                phi = a + node * (b - a)
                term = weight * (b - a) * f(self.ground(phi))
                first += term
                second += term * (end - phi)
        return first, second


def sections(
    waveform: str, harmonics: dict[str, Any] | None, ramp_in: float, ramp_out: float, cycles: int, amplitude: mpf
) -> list[Section]:
    """The shaking in monotone sections."""
    terms = [(mpf(1), 1, mpf(0))]
    if waveform == "cosine":
        terms = [(mpf(1), 1, mp.pi / 2)]
    if harmonics:
        phases = harmonics.get("phases", [0] * len(harmonics["amplitudes"]))
        terms = [
            (mpf(float(a)), int(m), mp.radians(mpf(float(p))))
            for a, m, p in zip(harmonics["amplitudes"], harmonics["multiples"], phases, strict=True)
        ]
    fastest = max(m for _, m, _ in terms)
    periodic: Function
    slope: Function
    breaks = [mpf(0), 2 * mp.pi]
    if waveform in ("triangle", "square"):
        fastest = 1
        breaks = [mp.pi * i / 2 for i in range(5)]
    scale = mpf(1)

    def total(phi: mpf) -> mpf:
        return mp.fsum(a * mp.sin(m * phi + p) for a, m, p in terms) / scale

    def total_slope(phi: mpf) -> mpf:
        return mp.fsum(a * m * mp.cos(m * phi + p) for a, m, p in terms) / scale

    if harmonics:
        stationary = _zeros(total_slope, [2 * mp.pi * i / (24 * fastest) for i in range(24 * fastest + 1)])
        scale = max(abs(total(phi)) for phi in stationary)

    found = []
    for n in range(cycles):
        start = 2 * mp.pi * n
        kinks = [2 * mp.pi * mpf(ramp_in), 2 * mp.pi * (cycles - mpf(ramp_out))]
        cuts = sorted({*(start + b for b in breaks), *(k for k in kinks if start < k < start + 2 * mp.pi)})
        for a, b in pairwise(cuts):
            middle = (a + b) / 2
            periodic, slope = total, total_slope
            if waveform == "square":
                periodic, slope = _line(mpf(1 if middle - start < mp.pi else -1), mpf(0), start)
            if waveform == "triangle":
                quarter = int(mp.floor((middle - start) / (mp.pi / 2)))
                periodic, slope = _line(mpf((0, 2, 2, -4)[quarter]), (1, -1, -1, 1)[quarter] * 2 / mp.pi, start)
            height, incline = mpf(1), mpf(0)
            if middle < kinks[0]:
                height, incline = mpf(0), 1 / kinks[0]
            elif middle > kinks[1]:
                height, incline = 2 * mp.pi * cycles / (2 * mp.pi * mpf(ramp_out)), -1 / (2 * mp.pi * mpf(ramp_out))

            def ground(phi: mpf, w: Function = periodic, height: mpf = height, incline: mpf = incline) -> mpf:
                return amplitude * (height + incline * phi) * w(phi)

            def rate_of(
                phi: mpf, w: Function = periodic, dw: Function = slope, height: mpf = height, incline: mpf = incline
            ) -> mpf:
                return incline * w(phi) + (height + incline * phi) * dw(phi)

            grid = [a + (b - a) * i / (24 * fastest + 7) for i in range(24 * fastest + 8)]
            turns = [] if waveform == "square" else [*_zeros(ground, grid), *_zeros(rate_of, grid)]
            short = mpf(10) ** (-DIGITS // 2)
            ends = [a]
            for phi in [*sorted(turns), b]:
                if phi - ends[-1] > short:
                    ends.append(phi)
            found += [Section(x, y, ground, fastest) for x, y in pairwise(ends)]
    return found


def _line(at: mpf, rate: mpf, start: mpf) -> tuple[Function, Function]:
    """A straight line and its slope."""
    return (lambda phi: at + rate * (phi - start)), (lambda phi: rate)


def _zeros(f: Function, grid: list[mpf]) -> list[mpf]:
    values = [f(phi) for phi in grid]
    return [_root(f, a, b) for (a, x), (b, y) in pairwise(zip(grid, values, strict=True)) if x * y < 0]


class Block:
    """The state of the block, and the motion rules."""

    def __init__(self, interface: _Interface, model: str, rise: str, recoupling: str) -> None:
        self.interface = interface
        self.newmark = model == "newmark"
        self.literal = rise == "literal" and not self.newmark
        self.integrate = recoupling == "integrate" or self.newmark
        self.threshold = interface.yield_acceleration
        self.v = self.u = self.peak = self.b = mpf(0)
        self.sliding = False
        self.reset = True  # the next Ug = Uy on the rise resets b
        self.flags = 0
        self.rounding = interface.amplitude * mpf(10) ** (-DIGITS + 10)

    def starting(self, x: mpf) -> mpf:
        """c(x)."""
        if self.newmark:
            return self.threshold
        return self.interface.eq4(x) if self.literal else max(self.threshold, self.interface.eq4(x))

    def go(self, section: Section, start: mpf, end: mpf, held: mpf | None) -> mpf | None:
        """Slide from start to end with b held, or by Eq. 4 (None), the rate of one sign; the stop, if it comes."""

        def rate(x: mpf) -> mpf:
            return self.interface.relative_acceleration(x) if held is None else x - held

        decay = self.interface.decay if held is None else mpf(0)
        gained, moved = section.integrals(rate, start, end, decay)
        if self.v + gained < -self.rounding:
            v = self.v
            stop = start
            if v > self.rounding:
                stop = _root(lambda phi: v + section.integrals(rate, start, phi, decay)[0], start, end)
            self.u += v * (stop - start) + section.integrals(rate, start, stop, decay)[1]
            self.v, self.sliding = mpf(0), False
            return stop
        self.u += self.v * (end - start) + moved
        self.v = max(self.v + gained, mpf(0))
        self.peak = max(self.peak, self.v)
        return None

    def levels(self, section: Section, extra: list[mpf]) -> list[mpf]:
        """Phases of a section between which nothing turns, with further ground accelerations of interest."""
        low, high = sorted((section.first, section.last))
        cuts = sorted({x for x in extra if low < x < high})
        phases = [section.phase(x) for x in cuts]
        return [section.start, *sorted(phases), section.end]

    def hold(self, section: Section, start: mpf, end: mpf) -> mpf | None:
        """Slide with b held, x passing b perhaps."""
        cuts = [start, end]
        x, y = section.ground(start), section.ground(end)
        if (x - self.b) * (y - self.b) < 0:
            cuts = [start, section.phase(self.b), end]
        for a, b in pairwise(cuts):
            stop = self.go(section, a, b, self.b)
            if stop is not None:
                return stop
        return None

    def rising(self, section: Section) -> None:
        """A section along which Ug does not fall."""
        interface = self.interface
        low, high = max(section.first, mpf(0)), section.last
        extra = [self.threshold]
        if not self.newmark and low < high:
            extra += interface.sign_changes(low, high)[1:-1]
            extra += interface.monotone_pieces(self.slope, low, high)[1:-1]
        ends = self.levels(section, extra)
        for a, b in pairwise(ends):
            begin, middle = section.ground(a), section.ground((a + b) / 2)
            self.meet(begin, middle)
            while self.sliding and a < b:
                a = self.slide(section, a, b)
                if not self.sliding and a < b:
                    x = section.ground(a)
                    self.begin(x, section.ground((a + b) / 2))

    def slope(self, ground: mpf) -> mpf:
        return 1 - self.interface.relative_acceleration_slope(ground)

    def meet(self, x: mpf, beyond: mpf) -> None:
        """What happens as the plane comes to x, not falling, on its way to `beyond`."""
        if self.reset and beyond > self.threshold:
            self.flags |= NOT_RECOUPLED * (self.v > 0)
            self.reset, self.sliding = False, self.v > 0
            self.b = self.starting(x)
        if not self.sliding and not self.reset:
            self.begin(x, beyond)
        elif self.sliding and not self.reset and not self.newmark:
            self.b = self.interface.eq4(x) if self.literal else max(self.b, self.interface.eq4(x))

    def begin(self, x: mpf, beyond: mpf) -> None:
        """Begin to slide, if the block at rest does between x and beyond."""
        if beyond > self.threshold and (self.newmark or self.interface.relative_acceleration(beyond) > 0):
            self.sliding, self.b = True, self.starting(x)

    def slide(self, section: Section, a: mpf, b: mpf) -> mpf:
        """Slide over a part of a rise on which E and D are monotone; where it ends."""
        interface = self.interface
        if self.reset or self.newmark:
            if self.reset and not self.integrate:
                return self.brake(a, b)
            stop = self.hold(section, a, b)
            return b if stop is None else stop
        if self.literal:
            stop = self.go(section, a, b, None)
            self.b = interface.eq4(section.ground(b))
            return b if stop is None else stop
        if interface.eq4(section.ground(b)) <= self.b:
            stop = self.hold(section, a, b)
            return b if stop is None else stop
        switch, tiny = a, self.threshold * mpf(10) ** -28
        if interface.eq4(section.ground(a)) < self.b - tiny:
            level = self.b
            switch = _root(lambda phi: interface.eq4(section.ground(phi)) - level, a, b)
            stop = self.hold(section, a, switch)
            if stop is not None:
                return stop
        stop = self.go(section, switch, b, None)
        self.b = interface.eq4(section.ground(b))
        return b if stop is None else stop

    def brake(self, a: mpf, b: mpf) -> mpf:
        """Eq. 12."""
        span = b - a
        if self.v <= self.b * span:
            self.u += self.v**2 / (2 * self.b)
            self.v, self.sliding = mpf(0), False
            return b
        self.u += self.v * span - self.b * span**2 / 2
        self.v -= self.b * span
        return b

    def yield_governs(self, shaking: list[Section]) -> bool:
        """Whether the plane exceeds Uy, and Eq. 4 stays below it at all that the plane rises through or jumps to."""
        asked, before = [], mpf(0)
        for section in shaking:
            first, last = section.first, section.last
            low = max(first, self.threshold)
            if last > low:
                asked += self.interface.monotone_pieces(self.slope, low, last)
            elif first > self.threshold and (first > before + self.rounding or first == last):
                asked.append(first)
            before = last
        if self.newmark:
            return bool(asked)
        limit = self.threshold * (1 + mpf(10) ** -25)
        return bool(asked) and all(self.interface.eq4(x) <= limit for x in asked)

    def run(self, shaking: list[Section]) -> bool:
        """The whole motion; false where b <= 0 leaves no value."""
        before = mpf(0)
        for section in shaking:
            first, last = section.first, section.last
            if section.side < 0:
                self.reset = True
                if self.sliding and self.b <= 0:
                    return False
                if self.sliding and self.integrate:
                    self.hold(section, section.start, section.end)
                elif self.sliding:
                    self.brake(section.start, section.end)
            elif last >= first:
                self.rising(section)
            else:
                if first > before + self.rounding:  # a jump upwards
                    self.meet(first, first)
                if self.sliding and self.reset and not self.integrate:
                    self.brake(section.start, section.end)
                elif self.sliding:
                    if self.b <= 0:
                        return False
                    self.hold(section, section.start, section.end)
            before = last
        if self.sliding:
            if self.b <= 0:
                return False
            self.u += self.v**2 / (2 * self.b)
        return True


def _continuous(interface: _Interface, shaking: list[Section]) -> tuple[mpf, mpf]:
    """Eq. 4 from the first Ug >= Uy to the end."""
    v = u = peak = mpf(0)
    going = False
    threshold = interface.yield_acceleration
    for section in shaking:
        start, side = section.start, section.side
        if not going:
            if max(section.first, section.last) < threshold:
                continue
            going = True
            if section.first < threshold:
                start = section.phase(threshold)

        def rate(x: mpf, side: int = side) -> mpf:
            return side * interface.relative_acceleration(abs(x), side)

        low, high = sorted((abs(section.first), abs(section.last)))
        zeros = [] if low == high else interface.sign_changes(low, high, side)[1:-1]
        cuts = sorted({start, *(phi for x in zeros if (phi := section.phase(side * x)) > start), section.end})
        for a, b in pairwise(cuts):
            gained, moved = section.integrals(rate, a, b, interface.decay)
            u += v * (b - a) + moved
            v += gained
            peak = max(peak, v)
    return u, peak


def solve(
    theta: float,
    mu_s: float,
    amplitude: float,
    frequency: float,
    *,
    waveform: str,
    harmonics: dict[str, Any] | None = None,
    ramp_in: float = 0.0,
    ramp_out: float = 0.0,
    cycles: int = 3,
    yield_acceleration: float | None = None,
    decay_rate: float | None = None,
    delta_mu: float | None = None,
    minimum_friction: float | None = None,
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    g: float = 9.81,
) -> Solution:
    """Response of one cell, as `slipsweep.sweep` with the same arguments; results as `reference.solve`."""
    with workdps(DIGITS):
        tan_theta = mp.tan(mp.radians(mpf(theta)))
        parameters = _friction_parameters(
            tan_theta, mpf(mu_s), mpf(amplitude), _given(yield_acceleration), _given(decay_rate), _given(delta_mu),
            _given(minimum_friction), model, mpf(g),
        )  # fmt: skip
        validity, mode = parameters.validity, parameters.sliding_mode
        if mode == MISSING:
            return Solution(mp.nan, mp.nan, MISSING, validity, False, False)
        if mode == STUCK:
            return Solution(mpf(0), mpf(0), STUCK, validity, True, False)
        interface = _Interface(mpf(g), tan_theta, mpf(mu_s), parameters, mpf(amplitude), DIGITS)
        omega = 2 * mp.pi * mpf(frequency)
        shaking = sections(waveform, harmonics, ramp_in, ramp_out, cycles, mpf(amplitude))
        # ramps may keep the shaking below its peak, and the block from sliding
        slides = any(max(section.first, section.last) > parameters.yield_acceleration for section in shaking)
        if mode == CONTINUOUS:
            u, peak = _continuous(interface, shaking)
            if slides:
                validity |= remarks(parameters.acceleration_ratio, u, decay_rate=decay_rate, delta_mu=delta_mu)
            return Solution(u / omega**2, peak / omega, mode, validity, False, False)
        block = Block(interface, model, rise, recoupling)
        has_value = block.run(shaking)
        below = block.yield_governs(shaking)
        newmark = model == "newmark"
        validity |= YIELD_GOVERNS * (below and not newmark)
        if not has_value:
            return Solution(mp.nan, mp.nan, MISSING, validity | KD_NOT_POSITIVE, False, below)
        validity |= block.flags
        if slides:
            validity |= remarks(
                parameters.acceleration_ratio, block.u, decay_rate=decay_rate, delta_mu=delta_mu, newmark=newmark,
                yield_governs=below,
            )  # fmt: skip
        return Solution(block.u / omega**2, block.peak / omega, mode, validity, not block.flags, below)
