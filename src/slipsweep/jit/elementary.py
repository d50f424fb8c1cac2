"""exp, log and versines in plain arithmetic, so that a loop over them becomes SIMD.

numba as pip installs it has no vector mathematics library (SVML left in 0.62): a `math.exp` in a
loop is a call of 4.3 ns an element and keeps the whole loop scalar.  `exp` below was seen at 0.65
ns an element (AVX-512, in cache), within 1 ulp of the true value.  Polynomials are interpolated at
Chebyshev nodes.  Ranges, methods, errors: docs/numerics.md#elementary-functions.
"""

import math

import numpy as np

from slipsweep.jit.decorators import elementary, single

#: Added to a float of magnitude below 2^51 it leaves the nearest integer in the low bits.
_ROUND = 6755399441055744.0
_LOG2_E = 1.4426950408889634
# ln 2 in two parts, the first with 21 trailing zero bits: k * _LN2_HIGH is exact
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
# beyond these the result is held, at 3.3e-308 and 8.2e307: never Inf, never subnormal
_EXP_MIN = -708.0
_EXP_MAX = 709.0
_HALF_PI = 0.5 * math.pi
#: Bit pattern of √½.
_SQRT_HALF_BITS = 4604544271217802189

# Coefficients, lowest power first (benchmarks.coefficients): of (e^r − 1 − r)/r²; by x² of (1 − cos
# x)/x², (x − sin x)/x³ and (x²/2 − 1 + cos x)/x⁴; by x² of arcsin(x)/x; by s² of (2 artanh s −
# 2s)/s³, a series
_EXP = (
    0.5, 0.16666666666666669, 0.04166666666662413, 0.008333333333330062, 0.0013888888917213717,
    0.00019841269863053618, 2.4801521295954376e-05, 2.7557268459997064e-06, 2.7620088445409746e-07,
    2.510038549551032e-08,
)  # fmt: skip
_VERSINE = (
    0.5, -0.041666666666666664, 0.0013888888888888816, -2.4801587301556646e-05,
    2.7557319217593045e-07, -2.0876756238770223e-09, 1.147069401087498e-11, -4.777404889695354e-14,
    1.5169166967261124e-16,
)  # fmt: skip
_ANGLE_MINUS_SINE = (
    0.16666666666666666, -0.008333333333333333, 0.00019841269841269806, -2.7557319223971264e-06,
    2.5052108382391406e-08, -1.605904347941901e-10, 7.647139121983424e-13, -2.8104687777073216e-15,
    8.006069886350886e-18,
)  # fmt: skip
_HALF_SQUARE_MINUS_VERSINE = (
    0.041666666666666664, -0.001388888888888889, 2.4801587301587285e-05, -2.755731922397923e-07,
    2.0876756986479165e-09, -1.1470745434999399e-11, 4.779466128305698e-14, -1.5614707523569033e-16,
    4.0126841356251555e-19,
)  # fmt: skip
_INVERSE_VERSINE = (
    1.0, 0.16666666666666963, 0.07499999999921603, 0.044642857225197834, 0.030381939881673394,
    0.022372313172485805, 0.017349310327158196, 0.01401917204006966, 0.01092934906491237,
    0.015091795028583365, -0.026316324552338826, 0.1809574620911065, -0.6641236302549411,
    2.0016041109291547, -4.535791802822955, 7.768165374555008, -9.669659398550623,
    8.32498352944691, -4.438816692066939, 1.1264192878807509,
)  # fmt: skip
_LOG = tuple(2.0 / power for power in range(3, 23, 2))


@single
def _polynomial(x: float, coefficients: tuple[float, ...]) -> float:
    """Σ cₖ xᵏ."""
    total = 0.0
    for k in range(len(coefficients) - 1, -1, -1):
        total = total * x + coefficients[k]
    return total


@elementary
def exp(x: float) -> float:
    """e^x for -708 ≤ x ≤ 709, held at the ends beyond them.

    Range reduction to |r| ≤ ln 2 / 2 (e^r within 2e-17); exponent by shifting the rounded
    quotient's low bits to it.
    """
    x = min(max(x, _EXP_MIN), _EXP_MAX)
    rounded = x * _LOG2_E + _ROUND
    k = rounded - _ROUND
    r = x - k * _LN2_HIGH - k * _LN2_LOW
    p = _polynomial(r, _EXP)
    p = p * r + 1.0
    p = p * r + 1.0
    return p * np.int64((np.float64(rounded).view(np.int64) + 1023) << 52).view(np.float64)


@elementary
def versine(angle: float) -> float:
    """1 − cos for |angle| ≤ π/2, without cancellation at 0 (1e-17)."""
    z = angle * angle
    return _polynomial(z, _VERSINE) * z


@elementary
def angle_minus_sine(angle: float) -> float:
    """angle − sin for |angle| ≤ π/2, without cancellation at 0 (6e-17)."""
    z = angle * angle
    return _polynomial(z, _ANGLE_MINUS_SINE) * z * angle


@elementary
def half_square_minus_versine(angle: float) -> float:
    """angle²/2 − (1 − cos) for |angle| ≤ π/2, without cancellation at 0 (6e-17)."""
    z = angle * angle
    return _polynomial(z, _HALF_SQUARE_MINUS_VERSINE) * z * z


@elementary
def inverse_versine(q: float) -> float:
    """Return the angle in [0, π/2] with 1 − cos(angle) = q, 2 arcsin √(q/2).

    There is no cancellation at 0: the error is 3e-18.
    """
    z = min(max(0.5 * q, 0.0), 0.5)
    return min(2.0 * _polynomial(z, _INVERSE_VERSINE) * math.sqrt(z), _HALF_PI)


@elementary
def rising_phase(x: float, amplitude: float) -> float:
    """ψ in [−π/2, 0] at which a sine of this amplitude, counted from its peak, rises through x.

    The quotient is taken here, where it is not turned into a product: 1/amplitude may overflow.
    """
    return -inverse_versine((amplitude - x) / amplitude)


@elementary
def log(x: float) -> float:
    """ln x for normal x; NaN below 0, -Inf at 0, Inf at Inf.

    x = 2^k m with m in [√½, √2]; ln m = 2 artanh((m - 1) / (m + 1)), series to the 21st power.
    """
    bits = np.float64(x).view(np.int64)
    exponent = (bits - _SQRT_HALF_BITS) >> 52
    k = exponent * 1.0
    m = np.int64(bits - (exponent << 52)).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    p = _polynomial(z, _LOG)
    y: float = k * _LN2_HIGH + (2.0 * s + (p * z * s + k * _LN2_LOW))
    y = y if x > 0.0 else (-math.inf if x == 0.0 else math.nan)
    return y if x < math.inf else x
