"""The motion rules on a record (docs/records.md) by an integrator of scipy: no closed form, none of our kernels.

The record is straight between its samples; DOP853 starts anew at every sample, at every zero of
the plane's acceleration and at every switch between Eq. 4 and the held value, which are bracketed on
a grid of points and found by Brent's method.  What a pulse's friction is comes from `reference`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from slipsweep import Record
from tests.support import reference

RTOL, ATOL = 1e-13, 1e-17

#: More stops and onsets than a piece has.
_MOST_LEGS = 20

#: Points between which a switch is looked for on a piece.
_POINTS = 200

Rate = Callable[[float], float]


@dataclass(frozen=True)
class Response:
    """What a block does: as `slipsweep.sweep` under a record has it."""

    permanent_displacement: float
    peak_relative_velocity: float
    number_of_slips: int
    stick_slip_pulses: int
    continuous_pulses: int


@dataclass(frozen=True)
class Piece:
    """A straight part of the record, from time 0 to `end`."""

    x: float
    slope: float
    end: float

    def at(self, t: float) -> float:
        return self.x + self.slope * t

    def cut(self, t: float) -> tuple["Piece", "Piece"]:
        return Piece(self.x, self.slope, t), Piece(self.at(t), self.slope, self.end - t)


def pieces_of(record: Record, scale: float) -> list[Piece]:
    """The record in parts of one sign."""
    parts = []
    for (t0, a), (t1, b) in pairwise(zip(record.times, scale * record.acceleration, strict=True)):
        piece = Piece(float(a), float((b - a) / (t1 - t0)), float(t1 - t0))
        if a * b < 0.0:
            first, second = piece.cut(-a / piece.slope)
            parts += [first, Piece(0.0, second.slope, second.end)]
        else:
            parts.append(piece)
    return parts


class Block:
    """A block on the record, pulse by pulse."""

    def __init__(
        self, theta: float, mu_s: float, g: float, rise: str = "monotone", recoupling: str = "eq12", **given: Any
    ) -> None:
        self.theta, self.mu_s, self.g, self.given = theta, mu_s, g, given
        self.literal, self.recoupling = rise == "literal", recoupling
        self.tan = math.tan(math.radians(theta))
        self.v = self.u = self.peak = self.held = 0.0
        self.slips = 0
        self.sliding = False

    # ------------------------------------------------------------------- friction of a pulse

    def take_friction(self, peak: float) -> int:
        """The friction of a pulse with this peak (Eqs. 7-11); its sliding mode."""
        found = reference.friction_parameters(self.theta, self.mu_s, peak, g=self.g, dps=20, **self.given)
        self.onset, self.decay = float(found.yield_acceleration), float(found.decay_rate)
        self.top_friction = self.mu_s + float(found.delta_mu)
        return found.sliding_mode

    def eq4(self, x: float) -> float:
        friction = self.top_friction * math.exp(-self.decay * abs(x) / self.g)
        n = self.g + x * self.tan
        return math.copysign(1.0, x) * (abs(x) - n * (self.mu_s - self.tan - friction) - self.g * self.tan)

    def asked(self, x: float) -> float:
        """The acceleration that a slide begins with."""
        return self.eq4(x) if self.literal else max(self.onset, self.eq4(x))

    # ------------------------------------------------------------------------ parts of motion

    def integrate(self, piece: Piece, block: Rate, stops: bool) -> float:
        """Move along a piece with the block's acceleration a function of the plane's; the time until it stopped."""
        if piece.end <= 0.0:
            return 0.0

        def rest(t: float, y: np.ndarray) -> float:
            return float(y[0])

        def crest(t: float, y: np.ndarray) -> float:
            return piece.at(t) - block(piece.at(t))

        rest.terminal, rest.direction = stops, -1  # type: ignore[attr-defined]
        crest.direction = -1  # type: ignore[attr-defined]
        solution = solve_ivp(
            lambda t, y: [piece.at(t) - block(piece.at(t)), y[0]],
            (0.0, piece.end),
            [self.v, self.u],
            method="DOP853",
            events=(rest, crest),
            rtol=RTOL,
            atol=ATOL,
        )
        assert solution.success
        self.v, self.u = map(float, solution.y[:, -1])
        self.peak = max(self.peak, self.v, *(float(y[0]) for y in solution.y_events[1]))
        if solution.status == 1:
            self.v, self.sliding = 0.0, False
        return float(solution.t[-1])

    def to_rest(self, piece: Piece, block: Rate, turn: float) -> float:
        """`integrate` in two parts where the velocity turns: within a step it could fall below 0 and rise unseen."""
        if not 1e-9 * piece.end < turn < piece.end:
            return self.integrate(piece, block, True)
        first, second = piece.cut(turn)
        took = self.integrate(first, block, True)
        return took + self.integrate(second, block, True) if self.sliding else took

    def hold(self, piece: Piece) -> float:
        return self.to_rest(piece, lambda x: self.held, (self.held - piece.x) / piece.slope if piece.slope else 0.0)

    def brake(self, duration: float) -> None:
        """Eq. 12 until the velocity, of either sign, is zero."""
        time = min(abs(self.v) / self.held, duration)
        slower = self.v - math.copysign(self.held * time, self.v)
        self.u += 0.5 * (self.v + slower) * time
        self.v = slower if time == duration else 0.0
        self.sliding = self.v != 0.0

    def along_a_rise(self, piece: Piece) -> None:
        for _ in range(_MOST_LEGS):
            if piece.end <= 0.0:
                return
            if not self.sliding:
                if piece.at(piece.end) <= self.onset:
                    return
                if piece.x < self.onset:
                    rest = piece.cut((self.onset - piece.x) / piece.slope)[1]
                    piece = Piece(self.onset, rest.slope, rest.end)
                began = _first(piece, lambda x: x - self.asked(x))
                if began is None:
                    return
                piece = piece.cut(began)[1]
                self.held = self.asked(piece.x)
                self.sliding = True
                self.slips += 1
            self.held = self.eq4(piece.x) if self.literal else max(self.held, self.eq4(piece.x))
            switch = 0.0 if self.literal else _first(piece, lambda x: self.eq4(x) - self.held)
            held, rest = piece.cut(piece.end if switch is None else switch)
            took = self.hold(held)
            if not self.sliding:
                piece = piece.cut(took)[1]
                continue
            if switch is None:
                return
            took = self.to_rest(rest, self.eq4, _first(rest, lambda x: x - self.eq4(x)) or 0.0)
            piece = rest.cut(took)[1]
            self.held = self.eq4(piece.x)
            if self.sliding:
                return

    # --------------------------------------------------------------------------------- pulses

    def respond(self, record: Record, scale: float) -> Response:
        parts = pieces_of(record, scale)
        onset = self.given.get("yield_acceleration")
        if onset is None:
            onset = self.g * (self.mu_s - self.tan) / (1.0 + self.mu_s * self.tan)
        pulses = [(a, b, peak) for a, b, peak in _half_waves(parts) if peak > onset]
        begins = [_begin(parts, a, onset) for a, _, _ in pulses]
        modes = {reference.STICK_SLIP: 0, reference.CONTINUOUS: 0}
        after = [*begins[1:], (len(parts), 0.0)]
        for (_, end, peak), begin, following in zip(pulses, begins, after[: len(pulses)], strict=True):
            mode = self.take_friction(peak)
            modes[mode] += 1
            if mode == reference.CONTINUOUS:
                self.slide(parts, begin, end, following, peak)
            else:
                self.stick_and_slip(parts, begin, end, following)
        if self.v != 0.0:
            self.brake(math.inf)
        return Response(self.u, self.peak, self.slips, modes[reference.STICK_SLIP], modes[reference.CONTINUOUS])

    def stick_and_slip(
        self, parts: list[Piece], begin: tuple[int, float], end: int, following: tuple[int, float]
    ) -> None:
        self.v = max(self.v, 0.0)
        self.sliding = self.v > 0.0
        x = parts[begin[0]].at(begin[1])
        self.held = self.asked(max(x, self.onset))
        if not self.sliding and x > self.onset and self.held < x:  # the record begins there: the plane jumps to it
            self.sliding = True
            self.slips += 1
        for piece in _between(parts, begin, (end, 0.0)):
            if piece.slope >= 0.0:
                self.along_a_rise(piece)
            elif self.sliding:
                self.hold(piece)
        for piece in _between(parts, (end, 0.0), following):
            if self.sliding and self.recoupling == "eq12":
                self.brake(piece.end)
            elif self.sliding:
                self.hold(piece)

    def slide(
        self, parts: list[Piece], begin: tuple[int, float], end: int, following: tuple[int, float], peak: float
    ) -> None:
        self.slips += self.v == 0.0
        bottom = end
        while bottom < len(parts) and parts[bottom].at(0.5 * parts[bottom].end) < 0.0:
            bottom += 1
            if bottom < len(parts) and parts[bottom].x == 0.0:
                break
        # whether what comes after the negative half wave, at once, is the pulse that follows
        way_up = parts[bottom : following[0] + 1]
        at_once = following[0] < len(parts) and way_up[0].x >= 0.0 and all(piece.x > 0.0 for piece in way_up[1:])
        for piece in _between(parts, begin, following if at_once else (bottom, 0.0)):
            self.integrate(piece, self.eq4, False)
        if not at_once:
            self.held = self.eq4(peak)
            self.brake(sum(piece.end for piece in _between(parts, (bottom, 0.0), following)))


def _first(piece: Piece, f: Rate) -> float | None:
    """The time at which `f` of the plane's acceleration first becomes positive on a piece."""
    times = np.linspace(0.0, piece.end, _POINTS)
    values = [f(piece.at(t)) for t in times]
    if values[0] >= 0.0 and values[1] > 0.0:
        return 0.0
    for (t0, a), (t1, b) in pairwise(zip(times, values, strict=True)):
        if a <= 0.0 < b:
            return float(brentq(lambda t: f(piece.at(t)), t0, t1, xtol=1e-15, rtol=1e-14)) if a < 0.0 else float(t0)
    return None


def _half_waves(parts: list[Piece]) -> list[tuple[int, int, float]]:
    """First and last (exclusive) pieces and peaks of the parts above zero."""
    waves: list[tuple[int, int, float]] = []
    start: int | None = None
    for i, piece in enumerate([*parts, Piece(-1.0, 0.0, 1.0)]):
        above = piece.at(0.5 * piece.end) > 0.0
        if start is not None and not (above and piece.x > 0.0):  # to touch zero ends a half wave
            waves.append((start, i, max(max(p.x, p.at(p.end)) for p in parts[start:i])))
            start = None
        if above and start is None:
            start = i
    return waves


def _begin(parts: list[Piece], first: int, onset: float) -> tuple[int, float]:
    """Where a half wave first reaches the yield value: a piece, and the time on it."""
    for i in range(first, len(parts)):
        if parts[i].x >= onset:
            return i, 0.0
        if parts[i].at(parts[i].end) > onset:
            return i, (onset - parts[i].x) / parts[i].slope
    raise AssertionError("no pulse")


def _between(parts: list[Piece], begin: tuple[int, float], end: tuple[int, float]) -> list[Piece]:
    """The pieces from one place on the record to another."""
    (i, t0), (j, t1) = begin, end
    if i == j:
        return [Piece(parts[i].at(t0), parts[i].slope, t1 - t0)] if t1 > t0 else []
    found = [parts[i].cut(t0)[1], *parts[i + 1 : j]]
    return found + ([parts[j].cut(t1)[0]] if j < len(parts) and t1 > 0.0 else [])
