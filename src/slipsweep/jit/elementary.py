"""exp, log and versines in plain arithmetic, so that a loop over them becomes SIMD.

numba as pip installs it has no vector mathematics library (SVML left in 0.62): a `math.exp` in a
loop is a call of 4.3 ns an element and keeps the whole loop scalar.  `exp` below was seen
at 0.65 ns an element (AVX-512, in cache), within 1 ulp of the true value.  Polynomials are two sums, four of many
terms, that do not wait for each other: a cell takes 0.92 to 0.96 of the time of Horner's one.  Ranges, methods,
errors: docs/numerics.md#elementary-functions.
"""

import math
from typing import Any

import numpy as np

from slipsweep.jit.decorators import elementary

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


@elementary
def _float_of(bits: int) -> float:
    """The float64 whose bit pattern is an int64."""
    return np.int64(bits).view(np.float64)


@elementary
def _bits_of(value: float) -> int:
    """The bit pattern of a float64 as an int64."""
    bits: Any = np.float64(value).view(np.int64)
    return bits


@elementary
def exp(x: float) -> float:
    """e^x for -708 ≤ x ≤ 709, held at the ends beyond them.

    Range reduction to |r| ≤ ln 2 / 2; (e^r − 1 − r)/r² interpolated at 10 Chebyshev nodes
    (e^r within 2e-17); exponent by shifting the rounded quotient's low bits into place.
    """
    x = min(max(x, _EXP_MIN), _EXP_MAX)
    rounded = x * _LOG2_E + _ROUND
    k = rounded - _ROUND
    r = x - k * _LN2_HIGH - k * _LN2_LOW
    r2 = r * r
    p0 = 2.510038549551032e-08
    p0 = p0 * r2 + 2.7557268459997064e-06
    p0 = p0 * r2 + 0.00019841269863053618
    p0 = p0 * r2 + 0.008333333333330062
    p0 = p0 * r2 + 0.16666666666666669
    p1 = 2.7620088445409746e-07
    p1 = p1 * r2 + 2.4801521295954376e-05
    p1 = p1 * r2 + 0.0013888888917213717
    p1 = p1 * r2 + 0.04166666666662413
    p = (p1 * r + p0) * r + 0.5
    p = p * r + 1.0
    p = p * r + 1.0
    return p * _float_of((_bits_of(rounded) + 1023) << 52)


@elementary
def versine(angle: float) -> float:
    """1 − cos for |angle| ≤ π/2, without cancellation at 0 (over angle² at 9 Chebyshev nodes, 1e-17)."""
    z = angle * angle
    z2 = z * z
    p0 = -4.777404889695354e-14
    p0 = p0 * z2 - 2.0876756238770223e-09
    p0 = p0 * z2 - 2.4801587301556646e-05
    p0 = p0 * z2 - 0.041666666666666664
    p1 = 1.5169166967261124e-16
    p1 = p1 * z2 + 1.147069401087498e-11
    p1 = p1 * z2 + 2.7557319217593045e-07
    p1 = p1 * z2 + 0.0013888888888888816
    p = (p1 * z + p0) * z + 0.5
    return p * z


@elementary
def angle_minus_sine(angle: float) -> float:
    """angle − sin for |angle| ≤ π/2, without cancellation at 0 (over angle³ at 9 Chebyshev nodes, 6e-17)."""
    z = angle * angle
    z2 = z * z
    p0 = -2.8104687777073216e-15
    p0 = p0 * z2 - 1.605904347941901e-10
    p0 = p0 * z2 - 2.7557319223971264e-06
    p0 = p0 * z2 - 0.008333333333333333
    p1 = 8.006069886350886e-18
    p1 = p1 * z2 + 7.647139121983424e-13
    p1 = p1 * z2 + 2.5052108382391406e-08
    p1 = p1 * z2 + 0.00019841269841269806
    p = (p1 * z + p0) * z + 0.16666666666666666
    return p * z * angle


@elementary
def half_square_minus_versine(angle: float) -> float:
    """angle²/2 − (1 − cos) for |angle| ≤ π/2, without cancellation at 0 (over angle⁴, 6e-17)."""
    z = angle * angle
    z2 = z * z
    p0 = -1.5614707523569033e-16
    p0 = p0 * z2 - 1.1470745434999399e-11
    p0 = p0 * z2 - 2.755731922397923e-07
    p0 = p0 * z2 - 0.001388888888888889
    p1 = 4.0126841356251555e-19
    p1 = p1 * z2 + 4.779466128305698e-14
    p1 = p1 * z2 + 2.0876756986479165e-09
    p1 = p1 * z2 + 2.4801587301587285e-05
    p = (p1 * z + p0) * z + 0.041666666666666664
    return p * z * z


@elementary
def inverse_versine(q: float) -> float:
    """The angle in [0, π/2] with 1 − cos(angle) = q, without cancellation at 0.

    2 arcsin √z with z = q/2 ≤ 1/2; arcsin √z / √z interpolated at 20 Chebyshev nodes on
    [0, 1/2] (within 3e-18).
    """
    z = min(max(0.5 * q, 0.0), 0.5)
    z2 = z * z
    z4 = z2 * z2
    p0 = 8.32498352944691
    p0 = p0 * z4 + 2.0016041109291547
    p0 = p0 * z4 + 0.015091795028583365
    p0 = p0 * z4 + 0.022372313172485805
    p0 = p0 * z4 + 0.16666666666666963
    p1 = -4.438816692066939
    p1 = p1 * z4 - 4.535791802822955
    p1 = p1 * z4 - 0.026316324552338826
    p1 = p1 * z4 + 0.017349310327158196
    p1 = p1 * z4 + 0.07499999999921603
    p2 = 1.1264192878807509
    p2 = p2 * z4 + 7.768165374555008
    p2 = p2 * z4 + 0.1809574620911065
    p2 = p2 * z4 + 0.01401917204006966
    p2 = p2 * z4 + 0.044642857225197834
    p3 = -9.669659398550623
    p3 = p3 * z4 - 0.6641236302549411
    p3 = p3 * z4 + 0.01092934906491237
    p3 = p3 * z4 + 0.030381939881673394
    p = ((p3 * z + p2) * z2 + (p1 * z + p0)) * z + 1.0
    return min(2.0 * p * math.sqrt(z), _HALF_PI)


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
    bits = _bits_of(x)
    k = ((bits - _SQRT_HALF_BITS) >> 52) * 1.0
    m = _float_of(bits - (((bits - _SQRT_HALF_BITS) >> 52) << 52))
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    z2 = z * z
    p0 = 2.0 / 21.0
    p0 = p0 * z2 + 2.0 / 17.0
    p0 = p0 * z2 + 2.0 / 13.0
    p0 = p0 * z2 + 2.0 / 9.0
    p0 = p0 * z2 + 2.0 / 5.0
    p1 = 2.0 / 19.0
    p1 = p1 * z2 + 2.0 / 15.0
    p1 = p1 * z2 + 2.0 / 11.0
    p1 = p1 * z2 + 2.0 / 7.0
    p = (p1 * z + p0) * z + 2.0 / 3.0
    y = k * _LN2_HIGH + (2.0 * s + (p * z * s + k * _LN2_LOW))
    y = y if x > 0.0 else (-math.inf if x == 0.0 else math.nan)
    return y if x < math.inf else x
