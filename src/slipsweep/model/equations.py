"""The equations of Mendez, Romo and Botero (2012), one small function each.

Scalars in, a scalar out, SI units, angles already as tangents; the equation number of the paper
stands in each docstring.  The kernels call these functions, so that the formulas written here are
those that are computed.  The operators of the printed equations were recovered from the paper's
Table 1 (docs/tutorial.md, "Against the paper").
"""

import math

from slipsweep.jit.decorators import equation, registered
from slipsweep.jit.elementary import exp, log
from slipsweep.model.variables import SlidingMode

STUCK = int(SlidingMode.STUCK)
STICK_SLIP = int(SlidingMode.STICK_SLIP)
CONTINUOUS = int(SlidingMode.CONTINUOUS)

#: Friction that remains at the peak of a continuous slide: "zero, or very close to it".
CONTINUOUS_MINIMUM_FRICTION = 0.01


@equation
def coulomb_yield_acceleration(mu_s: float, tan_theta: float, g: float) -> float:
    """Üy of a Coulomb interface, g tan(φs − θ), m/s²."""
    return g * (mu_s - tan_theta) / (1.0 + mu_s * tan_theta)


@equation
def normal_acceleration(ground_acceleration: float, tan_theta: float, g: float) -> float:
    """Eqs. 2 and 3: normal force over m cos θ, n(t) = g + Üg tan θ, m/s²."""
    return g + ground_acceleration * tan_theta


@equation
def mobilised_friction(
    ground_acceleration: float, block_acceleration: float, mu_s: float, tan_theta: float, g: float
) -> float:
    """Eq. 1: the friction coefficient that goes with a block acceleration."""
    n = normal_acceleration(ground_acceleration, tan_theta, g)
    return (
        mu_s - tan_theta - (abs(ground_acceleration) - abs(block_acceleration) - g * tan_theta) / n
    )


@equation
def lag(
    ground_acceleration: float, friction: float, mu_s: float, tan_theta: float, g: float
) -> float:
    """Eq. 4 as the lag of the block behind the base, |Üg| − |Ü|, m/s².

    n (μs − tan θ − μ) + g tan θ is written g (μs − μ) + Üg tan θ (μs − tan θ − μ): near static
    failure Üg is small against g tan θ, which would take its digits
    (docs/numerics.md#eq-4-as-a-lag).
    """
    return g * (mu_s - friction) + drift(ground_acceleration, friction, mu_s, tan_theta)


@equation
def drift(ground_acceleration: float, friction: float, mu_s: float, tan_theta: float) -> float:
    """The part of `lag` that turns its sign with Üg, Üg tan θ (μs − tan θ − μ), m/s².

    It is the mean of the relative accelerations at Üg and at −Üg: all that drives a block in
    continuous sliding down the plane, as the other part cancels over a cycle.
    """
    return ground_acceleration * tan_theta * (mu_s - tan_theta - friction)


@equation
def relative_acceleration(
    ground_acceleration: float, friction: float, mu_s: float, tan_theta: float, g: float
) -> float:
    """Eq. 4 as the rate of the relative velocity while the block slides, D = Üg − Ü, m/s²."""
    return math.copysign(1.0, ground_acceleration) * lag(
        ground_acceleration, friction, mu_s, tan_theta, g
    )


@equation
def relative_acceleration_slope(
    ground_acceleration: float,
    friction: float,
    friction_slope: float,
    mu_s: float,
    tan_theta: float,
    g: float,
) -> float:
    """dD/dÜg of Eq. 4, `friction_slope` = dμ/d|Üg|; the slope of Ü is 1 − dD/dÜg."""
    n = normal_acceleration(ground_acceleration, tan_theta, g)
    return (
        math.copysign(tan_theta, ground_acceleration) * (mu_s - tan_theta - friction)
        - n * friction_slope
    )


@equation
def relative_acceleration_curvature(
    ground_acceleration: float,
    friction_slope: float,
    friction_curvature: float,
    tan_theta: float,
    g: float,
) -> float:
    """d²D/dÜg² of Eq. 4, from dμ/d|Üg| and d²μ/d|Üg|²."""
    n = normal_acceleration(ground_acceleration, tan_theta, g)
    return -2.0 * tan_theta * friction_slope - math.copysign(
        n * friction_curvature, ground_acceleration
    )


@equation
def block_acceleration(
    ground_acceleration: float, friction: float, mu_s: float, tan_theta: float, g: float
) -> float:
    """Eq. 4: response of the sliding block to the base's acceleration, m/s²."""
    return ground_acceleration - relative_acceleration(
        ground_acceleration, friction, mu_s, tan_theta, g
    )


@registered
def friction_coefficient(
    ground_acceleration: float, mu_s: float, delta_mu: float, decay_rate: float, g: float
) -> float:
    """Eq. 6: friction that decays with the loading rate from μs + Δμ.

    With Δμ = 0 it is the original law, Eq. 5.
    """
    return (mu_s + delta_mu) * exp(-decay_rate * abs(ground_acceleration) / g)


@equation
def limit_denominator(mu_s: float, tan_theta: float) -> float:
    """Denominator of Eq. 7; where it is not positive the interface has no limit."""
    return 1.0 - tan_theta * (mu_s - tan_theta)


@equation
def limiting_acceleration(
    yield_acceleration: float, mu_s: float, tan_theta: float, g: float
) -> float:
    """Eq. 7: the largest acceleration the interface transmits (Eq. 4 with μ = 0, Ü = Üy), m/s²."""
    return (yield_acceleration + g * mu_s) / limit_denominator(mu_s, tan_theta)


@equation
def acceleration_ratio(amplitude: float, limiting_acceleration: float) -> float:
    """Eq. 8: ξ, the base's peak acceleration over the limiting one."""
    return amplitude / limiting_acceleration


@equation
def minimum_friction(mu_s: float, ratio: float) -> float:
    """Eq. 9: friction that remains at the peak, μs² ξ in stick-slip, 0.01 in continuous sliding."""
    return mu_s * mu_s * ratio if ratio <= 1.0 else CONTINUOUS_MINIMUM_FRICTION


@equation
def delta_mu(mu_s: float, ratio: float) -> float:
    """Eqs. 10 (continuous, ξ > 1) and 11 (stick-slip, ξ ≤ 1): friction above static."""
    # without a branch, which would keep loops over cells from becoming SIMD
    return mu_s * (max(ratio, 1.0 / ratio) - 1.0)


@equation
def decay_rate(
    amplitude: float, mu_s: float, delta_mu: float, minimum_friction: float, g: float
) -> float:
    """Eq. 6 solved for λ with μ = μmin at the peak of the motion."""
    return g / amplitude * log((mu_s + delta_mu) / minimum_friction)


@equation
def attenuated_velocity(velocity: float, peak_block_acceleration: float, duration: float) -> float:
    """Eq. 12: relative velocity after `duration`, with g Kd = Ümax, not below zero.

    The rate is constant, so that one step is exact for any duration.
    """
    return max(velocity - peak_block_acceleration * duration, 0.0)


@equation
def attenuated_displacement(
    velocity: float, peak_block_acceleration: float, duration: float
) -> float:
    """Eq. 12: relative displacement in `duration`, which may be infinite, or up to the stop."""
    stops = velocity <= peak_block_acceleration * duration
    to_the_stop = 0.5 * velocity * (velocity / peak_block_acceleration)  # the square might overflow
    return (
        to_the_stop if stops else (velocity - 0.5 * peak_block_acceleration * duration) * duration
    )


@equation
def sliding_mode(amplitude: float, yield_acceleration: float, limiting_acceleration: float) -> int:
    """Sliding mode: stuck up to the yield value, continuous above Eq. 7, else stick-slip."""
    slides = CONTINUOUS if amplitude > limiting_acceleration else STICK_SLIP
    return STUCK if amplitude <= yield_acceleration else slides
