"""The acceleration of the base on a piece of a path (`motion.paths`), its inverse, its integrals.

On a piece the wave is w = top + c₁τ + c₂τ² + …, where τ is the phase counted from the piece's
anchor: that end of it at which |w| is larger.  Differences from a peak thus come out of the sum,
not out of a subtraction of two numbers near 1, and keep their digits however small they are.
Times the amplitude A it is the base's acceleration Üg.  Three forms: a straight line, a quarter of
a sine about its peak (`arc`), and a polynomial, whose coefficients are in `curve`.
docs/numerics.md#pieces-of-a-wave
"""

import math

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.jit.elementary import (
    angle_minus_sine,
    half_square_minus_versine,
    inverse_versine,
    versine,
)
from slipsweep.kernels.roots import root_of
from slipsweep.motion.paths import Curve, Piece


@inlined
def from_top(piece: Piece, curve: Curve, tau: float) -> tuple[float, float]:
    """Return w − top and dw/dτ."""
    if piece.degree <= 1:
        return piece.slope * tau, piece.slope
    if piece.arc:
        return -piece.top * versine(tau), -piece.top * math.sin(tau)
    value = 0.0
    slope = 0.0
    for k in range(piece.degree - 1, -1, -1):
        slope = slope * tau + value
        value = value * tau + curve.coefficients[k]
    return value * tau, slope * tau + value


@scalar
def base_acceleration(piece: Piece, curve: Curve, amplitude: float, tau: float) -> float:
    """Return Üg at τ; at the ends of the piece it is the value of the table, without rounding."""
    if tau == piece.begin:
        return amplitude * piece.first
    if tau == piece.finish:
        return amplitude * piece.last
    return amplitude * (piece.top + from_top(piece, curve, tau)[0])


@inlined
def phase_at(piece: Piece, tau: float) -> float:
    """Return the phase of τ, in the count of the path."""
    return piece.start + (tau - piece.begin)


@scalar
def _offset_and_slope(where: tuple[Piece, Curve, float], tau: float) -> tuple[float, float]:
    piece, curve, offset = where
    value, slope = from_top(piece, curve, tau)
    return value - offset, slope


_offset_root = root_of(_offset_and_slope)


@scalar
def offset_at(piece: Piece, curve: Curve, amplitude: float, x: float) -> float:
    """Return the τ at which Üg = x; the nearer end, if x lies beyond the piece."""
    far = piece.begin + piece.finish  # one of them is 0
    offset = (x - amplitude * piece.top) / amplitude
    farthest = piece.first + piece.last - 2.0 * piece.top
    share = offset / farthest if farthest != 0.0 else 0.0
    if not share > 0.0:
        return 0.0
    if share >= 1.0:
        return far
    if piece.degree == 1:
        return far * share
    if piece.arc:
        return math.copysign(inverse_versine(abs(offset)), far)
    first = far * (math.sqrt(share) if piece.slope == 0.0 else share)
    below, above = (far, 0.0) if offset < 0.0 else (0.0, far)
    return _offset_root((piece, curve, offset), below, above, first, 0.0)


@inlined
def moments(curve: Curve, degree: int, start: float, end: float) -> tuple[float, float]:
    """Return ∫ (w − top) dτ and ∫ (end − τ)(w − top) dτ on a curved piece, by its Taylor series."""
    once_start = 0.0
    once_end = 0.0
    twice_start = 0.0
    twice_end = 0.0
    for k in range(degree - 1, -1, -1):
        once = curve.once[k]
        twice = curve.twice[k]
        once_start = once_start * start + once
        once_end = once_end * end + once
        twice_start = twice_start * start + twice
        twice_end = twice_end * end + twice
    once_start *= start * start
    second = twice_end * end * end * end - twice_start * start * start * start
    return once_end * end * end - once_start, second - once_start * (end - start)


@scalar
def held_gains(
    piece: Piece, curve: Curve, amplitude: float, held: float, start: float, end: float
) -> tuple[float, float]:
    """Return ∫ (Üg − b) dτ and ∫ (end − τ)(Üg − b) dτ: gains of V and W from rest with b held.

    docs/numerics.md#held-block-acceleration and docs/numerics.md#straight-pieces
    """
    width = end - start
    if piece.degree <= 1:
        rate = base_acceleration(piece, curve, amplitude, start) - held
        slope = amplitude * piece.slope
        gained = (rate + 0.5 * slope * width) * width
        return gained, (0.5 * rate + slope * width / 6.0) * width * width
    # ∫ (w − top) dτ and ∫ (end − τ)(w − top) dτ
    if start == piece.begin and end == piece.finish:
        first = curve.whole_once
        second = curve.whole_twice
    elif piece.arc:
        before = angle_minus_sine(start)
        whole = half_square_minus_versine(end) - half_square_minus_versine(start)
        first = -piece.top * (angle_minus_sine(end) - before)
        second = -piece.top * (whole - before * width)
    else:
        first, second = moments(curve, piece.degree, start, end)
    excess = amplitude * piece.top - held
    return excess * width + amplitude * first, 0.5 * excess * width * width + amplitude * second
