"""Newmark's block whose strength changes while it slides, by SciPy's integrator with events.

It shares no code with the kernels: the base's acceleration is a function between breaks, at which
it or its slope jumps and between which it is monotone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan, exp, inf, pi, radians, tan
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


class Piece(NamedTuple):
    """A part of the shaking: Üg is monotone and smooth from start to end, s."""

    start: float
    end: float
    ground: Callable[[float], float]


@dataclass(frozen=True)
class Block:
    """The parameters of a block; `friction` is μ(|v|, s)."""

    theta: float  # degrees
    friction: Callable[[float, float], float]
    kink: float = inf  # slip, m, at which μ has a kink
    both: bool = False
    g: float = 9.81

    def downslope(self, speed: float, slip: float) -> float:
        """Acceleration of a block that slides downslope."""
        return self.g * tan(atan(self.friction(speed, slip)) - radians(self.theta))

    def upslope(self, speed: float, slip: float) -> float:
        """That of one that slides upslope, turned; infinite where it cannot."""
        angle = atan(self.friction(speed, slip)) + radians(self.theta)
        return self.g * tan(angle) if angle < 0.5 * pi and self.both else inf


class Motion(NamedTuple):
    """What the block has done; NaN where it does not come to rest."""

    displacement: float
    largest_velocity: float
    largest: float
    smallest: float


def weakening(mu_s: float, residual_mu: float, distance: float) -> Callable[[float, float], float]:
    """μ that falls with the slip."""
    return lambda speed, slip: residual_mu + (mu_s - residual_mu) * max(0.0, 1.0 - slip / distance)


def rate(mu_s: float, fast_mu: float, constant: float) -> Callable[[float, float], float]:
    """μ that depends on the velocity."""
    return lambda speed, slip: fast_mu - (fast_mu - mu_s) * exp(-constant * speed)


def wave_pieces(
    wave: Callable[[float], float],
    breaks: Sequence[float],
    frequency: float,
    cycles: int,
    amplitude: float,
) -> list[Piece]:
    """Cycles of a wave of the phase; `breaks` are its zeros, peaks and jumps in [0, 2π]."""
    omega = 2.0 * pi * frequency
    pieces = []
    for cycle in range(cycles):
        for k in range(len(breaks) - 1):
            start = (breaks[k] + 2.0 * pi * cycle) / omega
            end = (breaks[k + 1] + 2.0 * pi * cycle) / omega
            inside = 0.5 * (start + end)
            span = end - start

            # just inside, so that a jump at an end belongs to the neighbour
            def ground(time: float, inside: float = inside, span: float = span) -> float:
                near = min(max(time, inside - 0.5 * span * (1.0 - 1e-15)), inside + 0.5 * span)
                return amplitude * wave(omega * near)

            pieces.append(Piece(start, end, ground))
    return pieces


def record_pieces(times: np.ndarray, acceleration: np.ndarray) -> list[Piece]:
    """Lines between samples, cut where they pass zero."""
    pieces = []
    for k in range(times.size - 1):
        first, last = acceleration[k : k + 2].tolist()
        start, end = times[k : k + 2].tolist()
        slope = (last - first) / (end - start)

        def ground(
            time: float, first: float = first, start: float = start, s: float = slope
        ) -> float:
            return first + s * (time - start)

        pieces.append(Piece(start, end, ground))
    return pieces


def solve(block: Block, pieces: Sequence[Piece]) -> Motion:
    """Go through the pieces, and on to rest."""
    walk = _Walk(block)
    for piece in pieces:
        walk.through(piece)
    end = pieces[-1].end
    still = Piece(end, end + 1e4, lambda time: 0.0)
    walk.through(still)
    if walk.way != 0:
        return Motion(*[float("nan")] * 4)
    return Motion(walk.u, walk.fastest, max(walk.highest, walk.u), min(walk.lowest, walk.u))


class _Walk:
    """A block on its way."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.way = 0  # 1 downslope, -1 upslope
        self.v = self.u = self.s = 0.0
        self.fastest = self.highest = self.lowest = 0.0

    def through(self, piece: Piece) -> None:
        """Go through a piece."""
        time = piece.start
        while time < piece.end:
            time = self.wait(piece, time) if self.way == 0 else self.slide(piece, time)

    def wait(self, piece: Piece, time: float) -> float:
        """Return the time at which the block at rest begins to slide."""
        down = self.block.downslope(0.0, self.s)
        up = self.block.upslope(0.0, self.s)
        first = piece.ground(time)
        last = piece.ground(piece.end)
        if first > down or first < -up:
            self.way = 1 if first > down else -1
            return time
        if last > down or last < -up:
            level = down if last > down else -up
            self.way = 1 if last > down else -1
            if first == level:
                return time
            return float(brentq(lambda t: piece.ground(t) - level, time, piece.end, xtol=1e-16))
        return piece.end

    def slide(self, piece: Piece, time: float) -> float:
        """Slide to the stop, the kink of the law, or the end of the piece."""
        way = self.way
        block = self.block

        def slope(t: float, state: np.ndarray) -> tuple[float, float]:
            speed = abs(state[0])
            slip = self.s + way * (state[1] - self.u)
            braking = block.downslope(speed, slip) if way > 0 else -block.upslope(speed, slip)
            return piece.ground(t) - braking, state[0]

        def stops(t: float, state: np.ndarray) -> float:
            return float(way * state[0])

        def passes(t: float, state: np.ndarray) -> float:
            return float(self.s + way * (state[1] - self.u) - block.kink)

        def turns(t: float, state: np.ndarray) -> float:
            return float(slope(t, state)[0])

        events: list[Any] = [stops, turns]
        if self.s < block.kink < inf:
            events.append(passes)
        for event in events:
            event.terminal = event is not turns
        stops.direction = -1.0  # type: ignore[attr-defined]
        span = piece.end - time
        solution = solve_ivp(
            slope,
            (time, piece.end),
            (self.v, self.u),
            "DOP853",
            rtol=1e-12,
            atol=1e-16,
            max_step=max(0.02 * min(span, 1.0), 1e-12) if span < 1e3 else 0.01 * span,
            first_step=min(1e-3 * span, 1e-6),
            events=events,
        )
        v, u = (float(row[-1]) for row in solution.y)
        self.s += abs(u - self.u)
        if solution.t_events[2:] and solution.t_events[2].size:
            self.s = block.kink
        for state in solution.y_events[1]:
            self.fastest = max(self.fastest, float(state[0]))
        self.fastest = max(self.fastest, v)
        self.v = v
        self.u = u
        if solution.t_events[0].size:
            self.v = 0.0
            self.way = 0
            self.highest = max(self.highest, u)
            self.lowest = min(self.lowest, u)
        return float(solution.t[-1])
