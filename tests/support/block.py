"""Block of the multiple-precision reference: Eqs. 2-6 and the motion rules, section by section."""

from itertools import pairwise
from typing import Any

import gmpy2
from gmpy2 import mpfr

from tests.support.digits import decimals
from tests.support.sections import Function, Section, root


class Interface:
    """Friction at the interface and the block's acceleration that follows (Eqs. 2-6)."""

    def __init__(
        self, g: mpfr, tan_theta: mpfr, mu_s: mpfr, delta_mu: mpfr, decay_rate: mpfr, onset: mpfr
    ) -> None:
        self.g = g
        self.tan_theta = tan_theta
        self.excess = mu_s - tan_theta
        self.friction_at_rest = mu_s + delta_mu
        self.decay = decay_rate / g
        self.yield_acceleration = onset

    def relative_acceleration(self, ground: mpfr, side: int = 1) -> mpfr:
        """Üg − Ü with Ü by Eq. 4; at Üg = 0 as it is on this side of it."""
        friction = self.friction_at_rest * gmpy2.exp(-self.decay * abs(ground))
        return side * (
            (self.g + ground * self.tan_theta) * (self.excess - friction) + self.g * self.tan_theta
        )

    def slope(self, ground: mpfr, side: int = 1) -> mpfr:
        """Derivative of `relative_acceleration`."""
        friction = self.friction_at_rest * gmpy2.exp(-self.decay * abs(ground))
        normal = self.g + ground * self.tan_theta
        return side * self.tan_theta * (self.excess - friction) + normal * self.decay * friction

    def eq4(self, ground: mpfr) -> mpfr:
        return ground - self.relative_acceleration(ground)

    def monotone_pieces(self, slope: Function, low: mpfr, high: mpfr) -> list[mpfr]:
        """Ends of the pieces of [low, high] on which a function of Eq. 4 is monotone.

        Low and high are on the same side of zero.  The slope of Eq. 4 is itself monotone on either
        side of one inflection, where n lambda / g = 2 tan(theta).
        """
        cuts = [low, high]
        if self.tan_theta > 0 and self.decay > 0:
            inflection = (2 * self.tan_theta / self.decay - self.g) / self.tan_theta
            if max(low, 0) < inflection < high:
                cuts.insert(1, inflection)
        ends = [low]
        for a, b in pairwise(cuts):
            if gmpy2.sign(slope(a)) * gmpy2.sign(slope(b)) < 0:
                ends.append(root(slope, a, b))
            ends.append(b)
        return ends

    def sign_changes(self, low: mpfr, high: mpfr, side: int = 1) -> list[mpfr]:
        """The zeros of the relative acceleration between `low` and `high`, on one side of zero."""

        def value(ground: mpfr) -> mpfr:
            return self.relative_acceleration(ground, side)

        ends = (
            self.monotone_pieces(lambda ground: self.slope(ground, side), low, high)
            if low < high
            else []
        )
        zeros = [root(value, a, b) for a, b in pairwise(ends) if value(a) * value(b) < 0]
        return sorted(zeros + [x for x in ends[1:-1] if value(x) == 0])


class NoValueError(Exception):
    """Eq. 12 with b <= 0 brakes nothing."""


class Block:
    """State of the block, and the motion rules, section by section of the shaking."""

    def __init__(self, model: str, rise: str, recoupling: str) -> None:
        self.newmark = model == "newmark"
        self.literal = rise == "literal" and not self.newmark
        self.integrate = recoupling == "integrate" or self.newmark
        self.v = self.u = self.peak = self.lowest = self.b = mpfr(0)
        self.ground = mpfr(0)  # Üg at the end of the section before
        self.sliding = self.recoupled_late = False
        self.reset = True  # the next Üg = Üy on a rise resets b
        self.slips = 0

    def state(self) -> tuple[Any, ...]:
        """What the motion that follows depends on, but for u."""
        return self.v, self.b if self.v else mpfr(0), self.ground, self.sliding, self.reset

    def same(self, one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
        return all(abs(a - b) <= self.rounding for a, b in zip(one, other, strict=True))

    def meet_interface(self, interface: Interface, amplitude: mpfr, digits: int) -> None:
        self.interface = interface
        self.onset = interface.yield_acceleration
        self.rounding = amplitude * mpfr(10) ** -digits

    # ------------------------------------------------------------------ motion with a given b

    def go(self, section: Section, start: mpfr, end: mpfr, held: mpfr | None) -> mpfr:
        """Slide with b held, or by Eq. 4 (None), to the stop or to `end`, and return that.

        Üg − b is of one sign.
        """
        decay = self.interface.decay if held is None else mpfr(0)

        def rate(x: mpfr) -> mpfr:
            return self.interface.relative_acceleration(x) if held is None else x - held

        gained, moved = section.integrals(rate, start, end, decay)
        if self.v + gained >= -self.rounding:
            self.u += self.v * (end - start) + moved
            self.change_speed(max(self.v + gained, mpfr(0)))
            return end
        stop = self.stop(section, start, end, rate, decay) if self.v > self.rounding else start
        self.u += self.v * (stop - start) + section.integrals(rate, start, stop, decay)[1]
        self.change_speed(mpfr(0))
        self.sliding = False
        return stop

    def stop(self, section: Section, low: mpfr, high: mpfr, rate: Function, decay: mpfr) -> mpfr:
        """Return the zero of the velocity, which falls from low to high (Newton in its bracket)."""
        phi = low
        velocity = self.v
        tiny = (high - low) * mpfr(10) ** (10 - decimals())
        while high - low > tiny:
            slope = rate(section.ground(phi))
            new = phi - velocity / slope if slope < 0 else high
            if abs(new - phi) <= tiny:
                break
            if not low < new < high:
                new = (low + high) / 2
            change = section.integrals(rate, min(phi, new), max(phi, new), decay)[0]
            velocity += change if new > phi else -change
            phi = new
            low, high = (phi, high) if velocity > 0 else (low, phi)
        return phi

    def change_speed(self, velocity: mpfr) -> None:
        self.v = velocity
        self.peak = max(self.peak, velocity)
        self.lowest = min(self.lowest, velocity)

    def hold(self, section: Section, start: mpfr, end: mpfr) -> mpfr:
        """Slide with b held; where the block stops, or end."""
        cuts = [start, end]
        if (section.ground(start) - self.b) * (section.ground(end) - self.b) < 0:
            cuts = [start, section.phase(self.b), end]
        for a, b in pairwise(cuts):
            at = self.go(section, a, b, self.b)
            if not self.sliding:
                return at
        return end

    def brake(self, span: mpfr) -> None:
        """Eq. 12 until the velocity, of either sign, is zero."""
        time = min(abs(self.v) / self.b, span)
        slower = (
            self.v - gmpy2.sign(self.v) * self.b * time if time < abs(self.v) / self.b else mpfr(0)
        )
        self.u += (self.v + slower) * time / 2
        self.change_speed(slower)
        self.sliding = slower != 0

    def follow(self, section: Section) -> None:
        """Continuous sliding: Eq. 4, the velocity of either sign."""
        side = section.side
        (low, high) = sorted((section.first, section.last))

        def rate(x: mpfr) -> mpfr:
            return self.interface.relative_acceleration(x, side)

        turns = sorted(section.phase(x) for x in self.interface.sign_changes(low, high, side))
        for a, b in pairwise([section.start, *turns, section.end]):
            gained, moved = section.integrals(rate, a, b, self.interface.decay)
            self.u += self.v * (b - a) + moved
            self.change_speed(self.v + gained)

    # -------------------------------------------------------------------- stick, slide, attenuate

    def starting(self, x: mpfr) -> mpfr:
        """c(Üg): the block acceleration with which a slide begins."""
        if self.newmark:
            return self.onset
        return self.interface.eq4(x) if self.literal else max(self.onset, self.interface.eq4(x))

    def take(self, section: Section) -> None:
        """The rules of stick-slip along a section."""
        jumps_up = section.first > self.ground + self.rounding
        self.ground = section.last
        self.reset |= section.side <= 0
        if section.side > 0 and section.last >= section.first:
            self.rise(section)
            return
        if section.side > 0 and jumps_up:
            self.meet(section.first, section.first)
        if self.sliding and self.reset:
            self.check()
        if self.sliding and self.reset and not self.integrate:
            self.brake(section.end - section.start)
        elif self.sliding:
            self.hold(section, section.start, section.end)

    def check(self) -> None:
        """From t5 on Eq. 12 needs b > 0."""
        if self.b <= 0:
            raise NoValueError

    def rise(self, section: Section) -> None:
        interface = self.interface
        low = max(section.first, mpfr(0))
        high = section.last
        levels = [self.onset]
        if not self.newmark and low < high:
            levels += interface.sign_changes(low, high)
            levels += interface.monotone_pieces(lambda x: 1 - interface.slope(x), low, high)[1:-1]
        cuts = sorted(section.phase(x) for x in {*levels} if low < x < high)
        for a, b in pairwise([section.start, *cuts, section.end]):
            self.meet(section.ground(a), section.ground((a + b) / 2))
            while self.sliding and a < b:
                a = self.slide(section, a, b)
                if self.rests() and a < b:
                    self.begin(section.ground(a), section.ground((a + b) / 2))

    def rests(self) -> bool:
        return not self.sliding

    def meet(self, x: mpfr, beyond: mpfr) -> None:
        """What happens as the base comes to x, not falling, on its way to `beyond`."""
        if self.reset and beyond > self.onset:
            self.recoupled_late |= self.v > 0
            self.sliding = self.v > 0
            self.reset = False
            self.b = self.starting(x)
        if not self.sliding and not self.reset:
            self.begin(x, beyond)
        elif self.sliding and not self.reset and not self.newmark:
            self.b = self.interface.eq4(x) if self.literal else max(self.b, self.interface.eq4(x))

    def begin(self, x: mpfr, beyond: mpfr) -> None:
        """Begin to slide, if the block at rest does between x and beyond."""
        if beyond > self.onset and (
            self.newmark or self.interface.relative_acceleration(beyond) > 0
        ):
            self.sliding = True
            self.b = self.starting(x)
            self.slips += 1

    def slide(self, section: Section, a: mpfr, b: mpfr) -> mpfr:
        """Slide over a part of a rise on which Eq. 4 and Üg − Ü are monotone; where it ends."""
        if self.reset and not self.integrate:
            self.brake(b - a)
            return b
        at_end = self.interface.eq4(section.ground(b)) if not self.newmark else mpfr(0)
        if self.reset or self.newmark or (not self.literal and at_end <= self.b):
            return self.hold(section, a, b)
        switch = a
        level = self.b
        if (
            not self.literal
            and self.interface.eq4(section.ground(a)) < level - self.onset * mpfr(10) ** -28
        ):
            switch = root(lambda phi: self.interface.eq4(section.ground(phi)) - level, a, b)
            at = self.hold(section, a, switch)
            if not self.sliding:
                return at
        at = self.go(section, switch, b, None)
        self.b = at_end
        return at

    def run_out(self) -> None:
        """Eq. 12 after the shaking."""
        if self.sliding:
            self.check()
            self.brake(gmpy2.inf())
