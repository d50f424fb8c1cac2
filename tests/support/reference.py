"""The motion rules of the model solved in multiple precision, for the sine.

Every event (onset, switch between Eq. 4 and the held value, re-stick, end of the pulse,
stop) is a bracketed root, everything between two events an antiderivative or a
Gauss-Legendre rule on pieces short against the decay of the friction.  Time is the phase
``phi = omega t``, velocity ``V = omega v``, displacement ``W = omega**2 u``, all three in
units of acceleration.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from typing import TypeAlias

from mpmath import mp, mpf, workdps

from tests.support.flag_definitions import (
    FLEXIBLE_BLOCK,
    FRICTION_NOT_DECAYING,
    KD_NOT_POSITIVE,
    LIMIT_UNDEFINED,
    NOT_RECOUPLED,
    STATICALLY_UNSTABLE,
    UPLIFT,
    YIELD_GOVERNS,
    remarks,
)

Number: TypeAlias = float | int | str | mpf

MISSING, STUCK, STICK_SLIP, CONTINUOUS = -1, 0, 1, 2

#: Digits carried beyond those asked for: just above yield u goes with (A - Uy)**2.
GUARD_DIGITS = 30


@dataclass(frozen=True)
class FrictionParameters:
    """Eqs. 7-11 of one cell; NaN where a formula has no value."""

    yield_acceleration: mpf
    limiting_acceleration: mpf
    acceleration_ratio: mpf
    minimum_friction: mpf
    delta_mu: mpf
    decay_rate: mpf
    sliding_mode: int
    validity: int


@dataclass(frozen=True)
class Solution:
    """Response of one cell.

    ``recoupled`` is true where every pulse of stick-slip (or stuck) comes to rest before the
    next onset; it is false in continuous mode.  ``eq4_below_yield`` is bit 16 of ``validity``,
    but for Newmark's block, where it is true and the bit is not set.
    """

    permanent_displacement: mpf
    peak_relative_velocity: mpf
    sliding_mode: int
    validity: int
    recoupled: bool
    eq4_below_yield: bool


def friction_parameters(
    theta: Number,
    mu_s: Number,
    amplitude: Number,
    *,
    yield_acceleration: Number | None = None,
    decay_rate: Number | None = None,
    delta_mu: Number | None = None,
    minimum_friction: Number | None = None,
    model: str = "mendez",
    g: Number = 9.81,
    dps: int = 30,
) -> FrictionParameters:
    """Friction parameters of one cell (Eqs. 7-11), `theta` in degrees, the rest in SI units."""
    with workdps(dps + GUARD_DIGITS):
        return _friction_parameters(
            mp.tan(mp.radians(mpf(theta))),
            mpf(mu_s),
            mpf(amplitude),
            _given(yield_acceleration),
            _given(decay_rate),
            _given(delta_mu),
            _given(minimum_friction),
            model,
            mpf(g),
        )


def solve(
    theta: Number,
    mu_s: Number,
    amplitude: Number,
    frequency: Number,
    *,
    cycles: int = 10,
    yield_acceleration: Number | None = None,
    decay_rate: Number | None = None,
    delta_mu: Number | None = None,
    minimum_friction: Number | None = None,
    structure_frequency: Number | None = None,
    model: str = "mendez",
    rise: str = "monotone",
    recoupling: str = "eq12",
    g: Number = 9.81,
    dps: int = 30,
) -> Solution:
    """Response of one cell to `cycles` cycles of a sine.

    Parameters
    ----------
    theta, mu_s, amplitude, frequency, cycles, yield_acceleration, decay_rate, delta_mu, \
minimum_friction, structure_frequency, model, rise, recoupling, g
        As in `slipsweep.sweep`.  Floats are taken at their exact binary value.
    dps
        Decimal digits of the result.

    Returns
    -------
    Solution
        Displacement in m, velocity in m/s; NaN where `validity` says that there is no value.
    """
    with workdps(dps + GUARD_DIGITS):
        tan_theta = mp.tan(mp.radians(mpf(theta)))
        parameters = _friction_parameters(
            tan_theta,
            mpf(mu_s),
            mpf(amplitude),
            _given(yield_acceleration),
            _given(decay_rate),
            _given(delta_mu),
            _given(minimum_friction),
            model,
            mpf(g),
        )
        validity = parameters.validity
        if structure_frequency is not None:
            in_band = 0.2 <= float(frequency) / float(structure_frequency) <= 1.3  # in doubles: 1/5 is 0.2
            validity |= FLEXIBLE_BLOCK * in_band
        if parameters.sliding_mode == MISSING:
            return Solution(mp.nan, mp.nan, MISSING, validity, False, False)
        if parameters.sliding_mode == STUCK:
            return Solution(mpf(0), mpf(0), STUCK, validity, True, False)

        interface = _Interface(mpf(g), tan_theta, mpf(mu_s), parameters, mpf(amplitude), dps)
        omega = 2 * mp.pi * mpf(frequency)
        if parameters.sliding_mode == CONTINUOUS:
            displacement, peak = _continuous(interface, cycles)
            validity |= remarks(parameters.acceleration_ratio, displacement, decay_rate=decay_rate, delta_mu=delta_mu)
            return Solution(displacement / omega**2, peak / omega, CONTINUOUS, validity, False, False)

        motion = _StickSlip(interface, model, rise, recoupling)
        newmark = model == "newmark"
        below = newmark or motion.eq4_below_yield()
        validity |= YIELD_GOVERNS * (below and not newmark)
        response = motion.run(cycles)
        if response is None:
            return Solution(mp.nan, mp.nan, MISSING, validity | KD_NOT_POSITIVE, False, below)
        displacement, peak, recoupled = response
        validity |= NOT_RECOUPLED * (not recoupled) | remarks(
            parameters.acceleration_ratio, displacement, decay_rate=decay_rate, delta_mu=delta_mu, newmark=newmark,
            yield_governs=below,
        )  # fmt: skip
        return Solution(displacement / omega**2, peak / omega, STICK_SLIP, validity, recoupled, below)


def _given(value: Number | None) -> mpf | None:
    return None if value is None else mpf(value)


def _friction_parameters(
    tan_theta: mpf,
    mu_s: mpf,
    amplitude: mpf,
    yield_acceleration: mpf | None,
    decay_rate: mpf | None,
    delta_mu: mpf | None,
    minimum_friction: mpf | None,
    model: str,
    g: mpf,
) -> FrictionParameters:
    newmark = model == "newmark"
    if yield_acceleration is None:
        yield_acceleration = g * (mu_s - tan_theta) / (1 + mu_s * tan_theta)
    validity = STATICALLY_UNSTABLE * (yield_acceleration <= 0)

    denominator = 1 - tan_theta * (mu_s - tan_theta)
    limit = (yield_acceleration + g * mu_s) / denominator if denominator > 0 else mp.nan
    ratio = amplitude / limit
    if not newmark:
        validity |= UPLIFT * (amplitude * tan_theta >= g) | LIMIT_UNDEFINED * (denominator <= 0)
    continuous = ratio > 1
    if minimum_friction is None:
        minimum_friction = mpf("0.01") if continuous else mu_s**2 * ratio
    if delta_mu is None:
        inverse = 1 / ratio if ratio != 0 else mp.inf
        delta_mu = mu_s * ((ratio if continuous else inverse) - 1)
    if decay_rate is None:
        peak_ratio = (mu_s + delta_mu) / minimum_friction if minimum_friction != 0 else mp.inf
        if not newmark and not validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED):
            validity |= FRICTION_NOT_DECAYING * (peak_ratio <= 1)
        positive = amplitude > 0 and not mp.isnan(peak_ratio) and peak_ratio > 0
        decay_rate = g / amplitude * mp.log(peak_ratio) if positive else mp.nan

    if validity:
        mode = MISSING
    elif amplitude <= yield_acceleration:
        mode = STUCK
    else:
        mode = CONTINUOUS if continuous and not newmark else STICK_SLIP
    return FrictionParameters(yield_acceleration, limit, ratio, minimum_friction, delta_mu, decay_rate, mode, validity)


@lru_cache
def _gauss_legendre(count: int, precision: int) -> list[tuple[mpf, mpf]]:
    """Nodes and weights of the `count`-point rule on (0, 1), at `precision` bits."""
    rule = []
    for i in range(count):
        node = mpf(math.cos(math.pi * (i + 0.75) / (count + 0.5)))
        for _ in range(precision.bit_length()):
            before, value = mpf(1), node
            for n in range(2, count + 1):
                before, value = value, ((2 * n - 1) * node * value - (n - 1) * before) / n
            slope = count * (node * value - before) / (node**2 - 1)
            step = value / slope
            node -= step
            if abs(step) < mpf(2) ** (-precision // 2 - 4):
                break
        rule.append(((1 + node) / 2, 1 / ((1 - node**2) * slope**2)))
    return rule


def _difference(f: Callable[[mpf], mpf], level: mpf, x: mpf) -> mpf:
    return f(x) - level


def _root(f: Callable[[mpf], mpf], low: mpf, high: mpf) -> mpf:
    """Root of `f` in a bracket: bisection made faster by inverse quadratic steps (Chandrupatla)."""
    a, b = high, low
    f_a, f_b = f(a), f(b)
    if f_a == 0:
        return a
    if f_b == 0:
        return b
    assert mp.sign(f_a) != mp.sign(f_b), "no change of sign in the bracket"
    width = mpf(1) / 2
    epsilon = mp.eps * 4
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
        tolerance = epsilon * abs(best) / abs(b - a) if b != a else mpf(1)
        if tolerance > 0.5 or f_a == 0:
            return best
        xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            width = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
        else:
            width = mpf(1) / 2
        width = min(1 - tolerance, max(tolerance, width))


class _Interface:
    """Friction at the interface and what it asks of the block (Eqs. 2-6)."""

    def __init__(
        self, g: mpf, tan_theta: mpf, mu_s: mpf, parameters: FrictionParameters, amplitude: mpf, dps: int
    ) -> None:
        self.g = g
        self.tan_theta = tan_theta
        self.excess = mu_s - tan_theta
        self.friction_at_rest = mu_s + parameters.delta_mu
        self.decay = parameters.decay_rate / g
        self.amplitude = amplitude
        self.yield_acceleration = parameters.yield_acceleration
        self.onset_phase = mp.asin(parameters.yield_acceleration / amplitude)
        self.rule = _gauss_legendre(dps, mp.prec)
        self.negligible = (dps + GUARD_DIGITS) * mp.log(10)

    def relative_acceleration(self, ground: mpf, side: int = 1) -> mpf:
        """|Ug - U| with its sign, U from Eq. 4, at |Ug| = `ground` on the positive or negative half-cycle."""
        friction = self.friction_at_rest * mp.exp(-self.decay * ground)
        return (self.g + side * ground * self.tan_theta) * (self.excess - friction) + self.g * self.tan_theta

    def relative_acceleration_slope(self, ground: mpf, side: int = 1) -> mpf:
        """Derivative of `relative_acceleration` with respect to `ground`."""
        friction = self.friction_at_rest * mp.exp(-self.decay * ground)
        normal = self.g + side * ground * self.tan_theta
        return side * self.tan_theta * (self.excess - friction) + normal * self.decay * friction

    def eq4(self, ground: mpf) -> mpf:
        """Block acceleration of Eq. 4 on the positive half-cycle."""
        return ground - self.relative_acceleration(ground)

    def monotone_pieces(self, slope: Callable[[mpf], mpf], low: mpf, high: mpf) -> list[mpf]:
        """Ends of the pieces of [low, high] on which a function of Eq. 4 is monotone.

        The slope of Eq. 4 is itself monotone on either side of one inflection, where
        n lambda / g = 2 tan(theta).
        """
        cuts = [low, high]
        if self.tan_theta > 0 and self.decay > 0:
            inflection = (2 * self.tan_theta / self.decay - self.g) / self.tan_theta
            if low < inflection < high:
                cuts.insert(1, inflection)
        ends = [low]
        for a, b in pairwise(cuts):
            if mp.sign(slope(a)) * mp.sign(slope(b)) < 0:
                ends.append(_root(slope, a, b))
            ends.append(b)
        return ends

    def sign_changes(self, low: mpf, high: mpf, side: int = 1) -> list[mpf]:
        """[low, the zeros of the relative acceleration between, high]."""

        def value(ground: mpf) -> mpf:
            return self.relative_acceleration(ground, side)

        ends = self.monotone_pieces(lambda ground: self.relative_acceleration_slope(ground, side), low, high)
        zeros = [_root(value, a, b) for a, b in pairwise(ends) if value(a) * value(b) < 0]
        zeros += [x for x in ends[1:-1] if value(x) == 0]
        return [low, *sorted(zeros), high]

    def phase(self, ground: mpf) -> mpf:
        """Phase of the first quarter at which the plane reaches `ground`."""
        return mp.asin(min(ground / self.amplitude, mpf(1)))

    def integrals(self, start: mpf, stop: mpf, side: int = 1) -> tuple[mpf, mpf]:
        """Velocity and displacement that Eq. 4 gives from rest between two phases of one quarter cycle.

        Returns the integrals of r(phi) and of (stop - phi) r(phi), r the relative acceleration
        at |sin(phi)|.
        """
        velocity = displacement = mpf(0)
        ends = self._short_pieces(start, stop)
        for a, b in pairwise(ends):
            first = second = mpf(0)
            for node, weight in self.rule:
                phi = a + node * (b - a)
                term = weight * self.relative_acceleration(self.amplitude * abs(mp.sin(phi)), side)
                first += term
                second += term * (stop - phi)
            velocity += first * (b - a)
            displacement += second * (b - a)
        return velocity, displacement

    def _short_pieces(self, start: mpf, stop: mpf) -> list[mpf]:
        """Ends of pieces of a quarter cycle over which friction falls by e^-8 at most, while it counts."""
        quarter = mp.pi / 2
        exponent = self.decay * self.amplitude
        offset = mp.floor((start + stop) / 2 / quarter) * quarter
        mirrored = int(mp.nint(offset / quarter)) % 2 == 1

        def sine(phi: mpf) -> mpf:
            return min(abs(mp.sin(phi)), mpf(1))

        lowest, highest = sorted((sine(start), sine(stop)))
        count = min(highest * exponent, self.negligible) - lowest * exponent
        levels = [lowest + 8 * j / exponent for j in range(1, int(mp.ceil(count / 8)) + 1)] if count > 8 else []
        arcs = [mp.asin(level) for level in levels if level < highest]
        cuts = [offset + quarter - arc if mirrored else offset + arc for arc in arcs]
        cuts += [offset + quarter * i / 3 for i in (1, 2)]
        return [start, *sorted(cut for cut in cuts if start < cut < stop), stop]


def _continuous(interface: _Interface, cycles: int) -> tuple[mpf, mpf]:
    """Displacement and largest velocity of the continuous mode: Eq. 4 from the first onset to the end."""
    quarter = mp.pi / 2
    zeros = {side: interface.sign_changes(mpf(0), interface.amplitude, side)[1:-1] for side in (1, -1)}

    def cycle(start: mpf) -> tuple[mpf, mpf, mpf]:
        """Velocity, displacement and largest velocity from rest at `start` to the end of the cycle."""
        velocity = displacement = mpf(0)
        largest = mp.ninf
        for i in range(4):
            side = 1 if i < 2 else -1
            arcs = [interface.phase(x) for x in zeros[side]]
            cuts = [(i + 1) * quarter - arc if i % 2 else i * quarter + arc for arc in arcs]
            low, high = max(start, i * quarter), (i + 1) * quarter
            ends = [low, *sorted(cut for cut in cuts if low < cut < high), high]
            for a, b in pairwise(ends):
                first, second = interface.integrals(a, b, side)
                displacement += velocity * (b - a) + side * second
                velocity += side * first
                largest = max(largest, velocity)
        return velocity, displacement, largest

    velocity, displacement, peak = cycle(interface.onset_phase)
    peak = max(peak, mpf(0))
    later = cycles - 1
    if later:
        gain, whole, largest = cycle(mpf(0))
        displacement += later * whole + 2 * mp.pi * (later * velocity + gain * later * (later - 1) / 2)
        peak = max(peak, velocity + largest, velocity + (later - 1) * gain + largest)
    return displacement, peak


@dataclass
class _Pulse:
    """One pulse: from an onset phase to the next, or to the end of the shaking."""

    velocity: mpf
    displacement: mpf
    largest: mpf
    lowest: mpf
    held: mpf
    came_to_rest: bool = False


class _StickSlip:
    """The stick-slip mode: stick, slide, hold, attenuate, pulse by pulse."""

    def __init__(self, interface: _Interface, model: str, rise: str, recoupling: str) -> None:
        self.interface = interface
        self.newmark = model == "newmark"
        self.literal = rise == "literal" and not self.newmark
        self.integrate = recoupling == "integrate" or self.newmark
        self.next_onset = 2 * mp.pi + interface.onset_phase
        self.rounding = interface.amplitude * mp.eps * 1024
        peak, onset = interface.amplitude, interface.yield_acceleration
        self.sliding = [onset, peak] if self.newmark else interface.sign_changes(onset, peak)

    def eq4_below_yield(self) -> bool:
        """Whether Eq. 4 stays below the yield value over the whole rise."""
        interface = self.interface
        ends = interface.monotone_pieces(self._eq4_slope, interface.yield_acceleration, interface.amplitude)
        return all(interface.eq4(x) < interface.yield_acceleration for x in ends)

    def run(self, cycles: int) -> tuple[mpf, mpf, bool] | None:
        """Displacement, largest velocity and whether every pulse came to rest; None where b <= 0."""
        velocity = displacement = peak = mpf(0)
        recoupled = True
        seen: list[tuple[mpf, int, mpf]] = []
        done, last = 0, cycles - 1
        resolution = self.interface.amplitude * mpf(10) ** (GUARD_DIGITS // 2 - mp.dps)
        while done < last:
            for velocity_then, done_then, displacement_then in seen:
                if abs(velocity - velocity_then) <= resolution:  # the motion repeats
                    period = done - done_then
                    repeats = (last - done) // period
                    displacement += repeats * (displacement - displacement_then)
                    done += repeats * period
                    seen = []
                    break
            if done == last:
                break
            seen.append((velocity, done, displacement))
            pulse = self._pulse(velocity, self.next_onset)
            if pulse is None:
                return None
            displacement += pulse.displacement
            peak = max(peak, pulse.largest)
            done += 1
            recoupled = recoupled and pulse.velocity == 0
            if velocity > 0 and not pulse.came_to_rest:  # the next ones differ by a velocity carried
                gain = pulse.velocity - velocity
                alike = last - done
                if gain < 0:
                    alike = min(alike, max(0, int(mp.floor((velocity - pulse.lowest - pulse.velocity) / gain))))
                displacement += alike * pulse.displacement + 2 * mp.pi * gain * alike * (alike + 1) / 2
                peak = max(peak, pulse.largest + alike * gain)
                velocity = pulse.velocity + alike * gain
                done += alike
            else:
                velocity = pulse.velocity
        pulse = self._pulse(velocity, 2 * mp.pi)
        if pulse is None:
            return None
        displacement += pulse.displacement
        if pulse.velocity > 0:  # the shaking is over
            displacement += pulse.velocity**2 / (2 * pulse.held)
        return displacement, max(peak, pulse.largest), recoupled

    def _eq4_slope(self, ground: mpf) -> mpf:
        return 1 - self.interface.relative_acceleration_slope(ground)

    def _asked(self, ground: mpf) -> mpf:
        """c: the block acceleration with which a slide begins."""
        if self.newmark:
            return self.interface.yield_acceleration
        eq4 = self.interface.eq4(ground)
        return eq4 if self.literal else max(self.interface.yield_acceleration, eq4)

    def _onset(self, ground: mpf) -> mpf | None:
        """First ground acceleration from `ground` on, on the rise, beyond which c < Ug; None if there is none."""
        for a, b in pairwise(self.sliding):
            if ground < b and (self.newmark or self.interface.relative_acceleration((a + b) / 2) > 0):
                return max(a, ground)
        return None

    def _rise_pieces(self, ground: mpf, held: mpf) -> tuple[list[tuple[mpf, mpf, mpf | None]], mpf]:
        """Pieces (from, to, held value or None under Eq. 4) from `ground` to the peak, and b at the peak."""
        interface = self.interface
        top = interface.amplitude
        if self.newmark:
            return [(ground, top, held)], held
        if self.literal:
            return [(ground, top, None)], interface.eq4(top)
        pieces: list[tuple[mpf, mpf, mpf | None]] = []
        ends = interface.monotone_pieces(self._eq4_slope, ground, top)
        for a, b in pairwise(ends):
            level = held
            if interface.eq4(b) <= level:
                pieces.append((a, b, level))
                continue
            switch = a
            if interface.eq4(a) < level:
                switch = _root(partial(_difference, interface.eq4, level), a, b)
                pieces.append((a, switch, level))
            pieces.append((switch, b, None))
            held = interface.eq4(b)
        return pieces, held

    def _pulse(self, carried: mpf, end: mpf) -> _Pulse | None:
        """One pulse from its onset phase on, with the velocity carried over, to the phase `end`."""
        interface = self.interface
        pulse = _Pulse(carried, mpf(0), carried, carried, interface.yield_acceleration)
        ground: mpf | None = interface.yield_acceleration
        sliding = False
        while not sliding:
            if pulse.velocity == 0:
                ground = self._onset(ground)
                if ground is None:  # with the plane up to the peak, and at rest from there
                    pulse.came_to_rest = True
                    return pulse
            pieces, held = self._rise_pieces(ground, self._asked(ground))
            sliding = True
            for a, b, level in pieces:
                stop = self._rise(pulse, a, b, level)
                if stop is not None:
                    ground, sliding = interface.amplitude * mp.sin(stop), False
                    break
        pulse.held = held
        if held <= 0:
            return None
        stop = self._hold(pulse, mp.pi / 2, end if self.integrate else mp.pi, held)
        if stop is None and not self.integrate:
            self._attenuate(pulse, end - mp.pi, held)
        return pulse

    def _rise(self, pulse: _Pulse, low: mpf, high: mpf, held: mpf | None) -> mpf | None:
        """Slide while the plane goes from `low` to `high`; the phase at which the block comes to rest, if it does."""
        interface = self.interface
        if held is not None:
            return self._hold(pulse, interface.phase(low), interface.phase(high), held)
        cuts = [low, *(x for x in self.sliding[1:-1] if low < x < high), high]
        for x, y in pairwise(cuts):
            start, stop = interface.phase(x), interface.phase(y)
            velocity, displacement = interface.integrals(start, stop)
            if pulse.velocity + velocity < -self.rounding:
                return self._come_to_rest_under_eq4(pulse, start, stop)
            self._advance(pulse, velocity, pulse.velocity * (stop - start) + displacement)
        return None

    def _come_to_rest_under_eq4(self, pulse: _Pulse, low: mpf, high: mpf) -> mpf:
        """Phase at which the velocity, falling from `low` to `high`, is zero (Newton kept in its bracket)."""
        interface = self.interface
        start, phi, velocity = low, low, pulse.velocity
        while high - low > mp.eps * high * 16:
            slope = interface.relative_acceleration(interface.amplitude * mp.sin(phi))
            new = phi - velocity / slope if slope < 0 else high
            if not low < new < high:
                new = (low + high) / 2
            if abs(new - phi) <= mp.eps * high * 16:
                break
            change = interface.integrals(min(phi, new), max(phi, new))[0]
            velocity += change if new > phi else -change
            phi = new
            if velocity > 0:
                low = phi
            else:
                high = phi
        displacement = interface.integrals(start, phi)[1]
        self._rest(pulse, pulse.velocity * (phi - start) + displacement)
        return phi

    def _hold(self, pulse: _Pulse, start: mpf, stop: mpf, held: mpf) -> mpf | None:
        """Slide with b held between two phases; the phase at which the block comes to rest, if it does."""
        amplitude = self.interface.amplitude
        cuts = []
        if held < amplitude:
            arc = mp.asin(held / amplitude)
            cuts = [cut for cut in (arc, mp.pi - arc, 2 * mp.pi + arc) if start < cut < stop]
        ends = [start, *cuts, stop]
        for a, b in pairwise(ends):
            before = pulse.velocity

            def velocity(phi: mpf, a: mpf = a, before: mpf = before) -> mpf:
                return before - amplitude * (mp.cos(phi) - mp.cos(a)) - held * (phi - a)

            def displacement(phi: mpf, a: mpf = a, before: mpf = before) -> mpf:
                span = phi - a
                swing = amplitude * (mp.cos(a) * span - mp.sin(phi) + mp.sin(a))
                return before * span + swing - held * span**2 / 2

            if velocity(b) < -self.rounding:
                rest = _root(velocity, a, b)
                self._rest(pulse, displacement(rest))
                return rest
            self._advance(pulse, velocity(b) - before, displacement(b))
        return None

    def _attenuate(self, pulse: _Pulse, span: mpf, held: mpf) -> None:
        """Eq. 12 for the phase `span`."""
        if pulse.velocity <= held * span:
            self._rest(pulse, pulse.velocity**2 / (2 * held))
        else:
            self._advance(pulse, -held * span, pulse.velocity * span - held * span**2 / 2)

    @staticmethod
    def _advance(pulse: _Pulse, velocity: mpf, displacement: mpf) -> None:
        pulse.velocity = max(pulse.velocity + velocity, mpf(0))
        pulse.displacement += displacement
        pulse.largest = max(pulse.largest, pulse.velocity)
        pulse.lowest = min(pulse.lowest, pulse.velocity)

    @staticmethod
    def _rest(pulse: _Pulse, displacement: mpf) -> None:
        pulse.displacement += displacement
        pulse.velocity = mpf(0)
        pulse.lowest = mpf(0)
        pulse.came_to_rest = True
