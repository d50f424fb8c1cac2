"""The motion of the base in phase: a wave of peak 1 cut into monotone pieces, each a polynomial.

On piece p the wave is w = top + c₁τ + c₂τ² + …, where τ is the phase counted from the piece's
anchor: that end of it at which |w| is larger.  Differences from a peak thus come out of the sum,
not out of a subtraction of two numbers near 1, and keep their digits however small they are
(near an anchor with c₁ = 0 they go with τ²).  A straight line is a polynomial, a plateau too, and
smooth waves are cut so short that the series are exact to rounding (`slipsweep.motion.waveforms`, which
fills the table): one form for all waveforms.  Only the series of a plain sine has a name, and is
evaluated by its shorter closed forms.  Times the amplitude A it is the base's acceleration x.
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.jit.elementary import angle_minus_sine, half_square_minus_versine, inverse_versine, versine
from slipsweep.kernels.events import root_of
from slipsweep.motion.pieces import (
    ARC,
    BEGIN,
    COEFFICIENTS,
    DEGREE,
    FINISH,
    FIRST,
    LAST,
    ONCE,
    START,
    TERM,
    TOP,
    TWICE,
    WHOLE,
    WHOLE_MOMENT,
)


@scalar
def from_top(pieces: np.ndarray, p: int, tau: float) -> float:
    """w − top on piece p, τ from its anchor."""
    if pieces[p, ARC] > 0.0:
        return -pieces[p, TOP] * versine(tau)
    sum_ = 0.0
    for k in range(int(pieces[p, DEGREE]) - 1, -1, -1):
        sum_ = sum_ * tau + pieces[p, COEFFICIENTS + TERM * k]
    return sum_ * tau


@scalar
def from_top_and_slope(pieces: np.ndarray, p: int, tau: float) -> tuple[float, float]:
    """w − top and dw/dτ on piece p."""
    if pieces[p, ARC] > 0.0:
        return -pieces[p, TOP] * versine(tau), -pieces[p, TOP] * math.sin(tau)
    sum_, slope = 0.0, 0.0
    for k in range(int(pieces[p, DEGREE]) - 1, -1, -1):
        slope = slope * tau + sum_
        sum_ = sum_ * tau + pieces[p, COEFFICIENTS + TERM * k]
    return sum_ * tau, slope * tau + sum_


@scalar
def integral(pieces: np.ndarray, p: int, start: float, end: float) -> float:
    """∫ (w − top) dτ over a part of piece p."""
    if pieces[p, ARC] > 0.0:
        return -pieces[p, TOP] * (angle_minus_sine(end) - angle_minus_sine(start))
    sum_start, sum_end = 0.0, 0.0
    for k in range(int(pieces[p, DEGREE]) - 1, -1, -1):
        once = pieces[p, ONCE + TERM * k]
        sum_start, sum_end = sum_start * start + once, sum_end * end + once
    return sum_end * end * end - sum_start * start * start


@scalar
def integrals(pieces: np.ndarray, p: int, start: float, end: float) -> tuple[float, float]:
    """∫ (w − top) dτ and ∫ (end − τ)(w − top) dτ over a part of piece p."""
    if start == pieces[p, BEGIN] and end == pieces[p, FINISH]:
        return pieces[p, WHOLE], pieces[p, WHOLE_MOMENT]
    if pieces[p, ARC] > 0.0:
        sine_part = angle_minus_sine(start)
        remaining = half_square_minus_versine(end) - half_square_minus_versine(start) - sine_part * (end - start)
        return -pieces[p, TOP] * (angle_minus_sine(end) - sine_part), -pieces[p, TOP] * remaining
    once_start, once_end, twice_start, twice_end = 0.0, 0.0, 0.0, 0.0
    for k in range(int(pieces[p, DEGREE]) - 1, -1, -1):
        once, twice = pieces[p, ONCE + TERM * k], pieces[p, TWICE + TERM * k]
        once_start, once_end = once_start * start + once, once_end * end + once
        twice_start, twice_end = twice_start * start + twice, twice_end * end + twice
    once_start *= start * start
    moment = twice_end * end * end * end - twice_start * start * start * start
    return once_end * end * end - once_start, moment - once_start * (end - start)


@scalar
def base_acceleration(pieces: np.ndarray, p: int, amplitude: float, tau: float) -> float:
    """The base's acceleration on piece p, τ from its anchor."""
    return amplitude * (pieces[p, TOP] + from_top(pieces, p, tau))


@scalar
def held_gain(pieces: np.ndarray, p: int, amplitude: float, held: float, start: float, end: float) -> float:
    """∫ (x − b) dτ for a held b on piece p: the gain of V."""
    return (amplitude * pieces[p, TOP] - held) * (end - start) + amplitude * integral(pieces, p, start, end)


@scalar
def held_integrals(
    pieces: np.ndarray, p: int, amplitude: float, held: float, start: float, end: float
) -> tuple[float, float]:
    """∫ (x − b) dτ and ∫ (end − τ)(x − b) dτ for a held b on piece p: gains of V and W from rest."""
    width = end - start
    excess = amplitude * pieces[p, TOP] - held
    first, second = integrals(pieces, p, start, end)
    return excess * width + amplitude * first, 0.5 * excess * width * width + amplitude * second


@scalar
def _beyond(where: tuple[np.ndarray, int, float], tau: float) -> tuple[float, float]:
    pieces, p, wanted = where
    value, slope = from_top_and_slope(pieces, p, tau)
    return value - wanted, slope


#: τ on a piece between two places, from a third on, at which w − top is `wanted`.
offset_root = root_of(_beyond)


@scalar
def offset_at(pieces: np.ndarray, p: int, amplitude: float, x: float) -> float:
    """τ at which the base's acceleration is x on piece p (the nearer end, if x lies beyond)."""
    far = pieces[p, BEGIN] + pieces[p, FINISH]  # one of them is 0
    wanted = (x - amplitude * pieces[p, TOP]) / amplitude
    farthest = pieces[p, FIRST] + pieces[p, LAST] - 2.0 * pieces[p, TOP]
    share = wanted / farthest if farthest != 0.0 else 0.0
    if not share > 0.0:
        return 0.0
    if share >= 1.0:
        return far
    if int(pieces[p, DEGREE]) == 1:
        return far * share
    if pieces[p, ARC] > 0.0:
        return math.copysign(inverse_versine(abs(wanted)), far)
    tau = far * (math.sqrt(share) if pieces[p, COEFFICIENTS] == 0.0 else share)
    if wanted < 0.0:
        return offset_root((pieces, p, wanted), far, 0.0, tau, 0.0)
    return offset_root((pieces, p, wanted), 0.0, far, tau, 0.0)


@scalar
def phase_at(pieces: np.ndarray, p: int, tau: float) -> float:
    """The phase of τ on piece p, in the table's count."""
    return pieces[p, START] + (tau - pieces[p, BEGIN])
