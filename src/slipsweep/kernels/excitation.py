"""The motion of the base in phase: a wave cut into monotone pieces, each a polynomial.

On a piece the wave is w = top + c₁τ + c₂τ² + …, where τ is the phase counted from the piece's
anchor: that end of it at which |w| is larger.  Differences from a peak thus come out of the sum,
not out of a subtraction of two numbers near 1, and keep their digits however small they are (near
an anchor with c₁ = 0 they go with τ²).  A straight line is a polynomial, a plateau too, and smooth
waves are cut so short that the series are exact to rounding (`slipsweep.motion.cutting`, which
fills the table): one form for all waveforms.  Only the series of a plain sine has a name, and is
evaluated by its shorter closed forms.  Times the amplitude A it is the base's acceleration x.
"""

import math

from slipsweep.jit.decorators import scalar
from slipsweep.jit.elementary import (
    angle_minus_sine,
    half_square_minus_versine,
    inverse_versine,
    versine,
)
from slipsweep.kernels.events import root_of
from slipsweep.motion.pieces import Piece


@scalar
def from_top(piece: Piece, tau: float) -> float:
    """w − top on a piece, τ from its anchor."""
    if piece.arc:
        return -piece.top * versine(tau)
    sum_ = 0.0
    for k in range(piece.degree - 1, -1, -1):
        sum_ = sum_ * tau + piece.coefficients[k]
    return sum_ * tau


@scalar
def from_top_and_slope(piece: Piece, tau: float) -> tuple[float, float]:
    """w − top and dw/dτ on a piece."""
    if piece.arc:
        return -piece.top * versine(tau), -piece.top * math.sin(tau)
    sum_ = 0.0
    slope = 0.0
    for k in range(piece.degree - 1, -1, -1):
        slope = slope * tau + sum_
        sum_ = sum_ * tau + piece.coefficients[k]
    return sum_ * tau, slope * tau + sum_


@scalar
def integral(piece: Piece, start: float, end: float) -> float:
    """∫ (w − top) dτ over a part of a piece."""
    if piece.arc:
        return -piece.top * (angle_minus_sine(end) - angle_minus_sine(start))
    sum_start = 0.0
    sum_end = 0.0
    for k in range(piece.degree - 1, -1, -1):
        once = piece.once[k]
        sum_start = sum_start * start + once
        sum_end = sum_end * end + once
    return sum_end * end * end - sum_start * start * start


@scalar
def integrals(piece: Piece, start: float, end: float) -> tuple[float, float]:
    """∫ (w − top) dτ and ∫ (end − τ)(w − top) dτ over a part of a piece."""
    if piece.arc:
        sine_part = angle_minus_sine(start)
        remaining = (
            half_square_minus_versine(end)
            - half_square_minus_versine(start)
            - sine_part * (end - start)
        )
        return -piece.top * (angle_minus_sine(end) - sine_part), -piece.top * remaining
    once_start = 0.0
    once_end = 0.0
    twice_start = 0.0
    twice_end = 0.0
    for k in range(piece.degree - 1, -1, -1):
        once = piece.once[k]
        twice = piece.twice[k]
        once_start = once_start * start + once
        once_end = once_end * end + once
        twice_start = twice_start * start + twice
        twice_end = twice_end * end + twice
    once_start *= start * start
    moment = twice_end * end * end * end - twice_start * start * start * start
    return once_end * end * end - once_start, moment - once_start * (end - start)


@scalar
def base_acceleration(piece: Piece, amplitude: float, tau: float) -> float:
    """The base's acceleration on a piece, τ from its anchor."""
    return amplitude * (piece.top + from_top(piece, tau))


@scalar
def held_gain(piece: Piece, amplitude: float, held: float, start: float, end: float) -> float:
    """∫ (x − b) dτ for a held b on a piece: the gain of V."""
    return (amplitude * piece.top - held) * (end - start) + amplitude * integral(piece, start, end)


@scalar
def held_integrals(
    piece: Piece, amplitude: float, held: float, start: float, end: float
) -> tuple[float, float]:
    """∫ (x − b) dτ and ∫ (end − τ)(x − b) dτ for a held b on a piece: gains of V and W from rest."""
    width = end - start
    excess = amplitude * piece.top - held
    first, second = integrals(piece, start, end)
    return excess * width + amplitude * first, 0.5 * excess * width * width + amplitude * second


@scalar
def _beyond(where: tuple[Piece, float], tau: float) -> tuple[float, float]:
    piece, wanted = where
    value, slope = from_top_and_slope(piece, tau)
    return value - wanted, slope


#: τ on a piece between two places, from a third on, at which w − top is `wanted`.
offset_root = root_of(_beyond)


@scalar
def offset_at(piece: Piece, amplitude: float, x: float) -> float:
    """τ at which the base's acceleration is x on a piece (the nearer end, if x lies beyond)."""
    far = piece.begin + piece.finish  # one of them is 0
    wanted = (x - amplitude * piece.top) / amplitude
    farthest = piece.first + piece.last - 2.0 * piece.top
    share = wanted / farthest if farthest != 0.0 else 0.0
    if not share > 0.0:
        return 0.0
    if share >= 1.0:
        return far
    if piece.degree == 1:
        return far * share
    if piece.arc:
        return math.copysign(inverse_versine(abs(wanted)), far)
    tau = far * (math.sqrt(share) if piece.coefficients[0] == 0.0 else share)
    if wanted < 0.0:
        return offset_root((piece, wanted), far, 0.0, tau, 0.0)
    return offset_root((piece, wanted), 0.0, far, tau, 0.0)


@scalar
def phase_at(piece: Piece, tau: float) -> float:
    """The phase of τ on a piece, in the table's count."""
    return piece.start + (tau - piece.begin)
