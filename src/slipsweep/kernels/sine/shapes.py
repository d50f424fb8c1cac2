"""A quarter of the wave, from which lanes have all they need of it: of a sine, a triangle or a square.

From the peak x = A (1 − `fallen`), from Üg = 0 before it x = A `risen`.  `shape` is known where a kernel is compiled,
and costs nothing there.  docs/numerics.md#lanes-of-the-triangle-and-the-square
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes
from slipsweep.jit.elementary import angle_minus_sine, exp, half_square_minus_versine, rising_phase, versine
from slipsweep.kernels.linear import exponential_moments
from slipsweep.kernels.sine.lanes import HALF_PI, SHORT_NODES, SHORT_WEIGHTS

#: Shapes; and the slope of a triangle of peak 1.
SINE, TRIANGLE, SQUARE = range(3)
_SLOPE = 1.0 / HALF_PI

#: Coefficients, highest first, of ∫ e^(−k sin φ) dφ over [0, π/2] in powers of 4 − k: integrals of
#: sinⁿ e^(−4 sin) / n!, all positive, on 8 panels of 8 nodes (more on fewer panels have weights that
#: are wrong by 3e-15).  31 terms give 4e-16 for k from 0 to 6; about 4, no digits cancel where k is large.
_CENTRE = 4.0
_PANEL_WIDTH = HALF_PI / 8
_SINES = np.sin(_PANEL_WIDTH * (np.arange(8)[:, np.newaxis] + SHORT_NODES))
_WEIGHTED = _PANEL_WIDTH * SHORT_WEIGHTS * np.exp(-_CENTRE * _SINES)
_QUARTER_SERIES = np.array([np.sum(_WEIGHTED * _SINES**n) / math.factorial(n) for n in range(30, -1, -1)])


@in_lanes
def phase_of(shape: int, x: float, amplitude: float) -> float:
    """ψ ≤ 0 at which the rise to the peak comes to x."""
    if shape == TRIANGLE:
        return (x - amplitude) / amplitude * HALF_PI
    if shape == SQUARE:
        return -HALF_PI
    return rising_phase(x, amplitude)


@in_lanes
def fallen(shape: int, psi: float) -> float:
    """How far below the peak, 1, the wave is at ψ from it, |ψ| ≤ π/2."""
    if shape == TRIANGLE:
        return _SLOPE * abs(psi)
    return 0.0 if shape == SQUARE else versine(psi)


@in_lanes
def fallen_integrals(shape: int, psi: float) -> tuple[float, float]:
    """Its integral from the peak on, and that one's."""
    if shape == TRIANGLE:
        half = 0.5 * _SLOPE * psi * abs(psi)
        return half, half * psi / 3.0
    if shape == SQUARE:
        return 0.0, 0.0
    return angle_minus_sine(psi), half_square_minus_versine(psi)


@in_lanes
def steepness(shape: int, psi: float) -> float:
    """How fast the wave falls at ψ ≥ 0."""
    if shape == TRIANGLE:
        return _SLOPE
    return 0.0 if shape == SQUARE else psi - angle_minus_sine(psi)


@in_lanes
def risen(shape: int, phi: float) -> float:
    """The wave at φ from Üg = 0, φ ≤ π/2."""
    if shape == TRIANGLE:
        return _SLOPE * phi
    return 1.0 if shape == SQUARE else phi - angle_minus_sine(phi)


@in_lanes
def risen_integrals(shape: int, phi: float) -> tuple[float, float]:
    """Its integral from Üg = 0 on, and that one's."""
    if shape == TRIANGLE:
        half = 0.5 * _SLOPE * phi * phi
        return half, half * phi / 3.0
    if shape == SQUARE:
        return phi, 0.5 * phi * phi
    return versine(phi), angle_minus_sine(phi)


@in_lanes
def half_wave(shape: int, chi: float) -> tuple[float, float, float]:
    """A half wave at χ from its beginning, 0 ≤ χ ≤ π, its integral, and that one's."""
    if shape == TRIANGLE:
        rest = math.pi - chi
        falls = chi > HALF_PI
        near = rest if falls else chi
        half, third = 0.5 * _SLOPE * near * near, _SLOPE * near * near * near / 6.0
        return _SLOPE * near, HALF_PI - half if falls else half, HALF_PI * (chi - HALF_PI) + third if falls else third
    if shape == SQUARE:
        return 1.0, chi, 0.5 * chi * chi
    half_sine, half_cosine = 0.5 * chi - angle_minus_sine(0.5 * chi), 1.0 - versine(0.5 * chi)
    sine = 2.0 * half_sine * half_cosine
    return sine, 2.0 * half_sine * half_sine, chi - sine


@in_lanes
def half_wave_bound(shape: int) -> float:
    """The largest c for which the integral of a half wave is c χ²/2 or more, χ ≤ π."""
    if shape == TRIANGLE:
        return 1.0 / math.pi
    return 2.0 / math.pi if shape == SQUARE else 4.0 / (math.pi * math.pi)


@in_lanes
def quarter_integrals(shape: int, k: float) -> tuple[float, float, float]:
    """∫ w, ∫ e^(−k w) and ∫ w e^(−k w) over a quarter of the wave w, for k from 0 to the e-foldings of the lanes.

    Under the sine the last is the derivative of the second by −k.  In closed form they are π/2 (I₀ − L₀) and
    1 + π/2 (L₁ − I₁), modified Bessel and Struve functions of k.
    """
    if shape == TRIANGLE:
        whole, _, late, _ = exponential_moments(k)
        return 0.5 * HALF_PI, HALF_PI * whole, HALF_PI * late
    if shape == SQUARE:
        kept = HALF_PI * exp(-k)
        return HALF_PI, kept, kept
    below = _CENTRE - k
    first, second = 0.0, 0.0
    for n in range(_QUARTER_SERIES.size):
        second = second * below + first
        first = first * below + _QUARTER_SERIES[n]
    return 1.0, first, second
