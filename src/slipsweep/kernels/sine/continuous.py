"""Continuous sliding under a sine: Eq. 4 throughout, from integrals over one quarter of the cycle.

|Üg| and the friction repeat every quarter, mirrored, so that a quarter gives a cycle, and the
cycles an arithmetic series.  docs/numerics.md#continuous-sliding
"""

import math

import numpy as np

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.jit.elementary import rising_phase
from slipsweep.kernels.block import Options
from slipsweep.kernels.sine.batch import (
    HALF_PI,
    NODES,
    WEIGHTS,
    WIDTH,
    Batch,
    find_eq4_event,
    integrate_eq4,
    relative_acceleration,
    static_acceleration,
)

#: Coefficients, highest first, of ∫ e^(−k sin φ) dφ over [0, π/2] in powers of 4 − k: integrals of
#: sinⁿ e^(−4 sin) / n!, all positive.  31 terms give 4e-16 for k from 0 to 6.
_CENTRE = 4.0
_PANEL = HALF_PI / 8
_SINES = np.sin(_PANEL * (np.arange(8)[:, np.newaxis] + NODES))
_WEIGHTED = _PANEL * WEIGHTS * np.exp(-_CENTRE * _SINES)
_SERIES = np.array([np.sum(_WEIGHTED * _SINES**n) / math.factorial(n) for n in range(30, -1, -1)])


@inlined
def quarter_integrals(k: float) -> tuple[float, float]:
    """Return ∫ e^(−k sin φ) dφ and ∫ sin φ e^(−k sin φ) dφ over [0, π/2].

    The second is the derivative of the first by −k.  In closed form they are π/2 (I₀ − L₀) and
    1 + π/2 (L₁ − I₁), modified Bessel and Struve functions of k.
    """
    below = _CENTRE - k
    plain = 0.0
    with_sine = 0.0
    for n in range(_SERIES.size):
        with_sine = with_sine * below + plain
        plain = plain * below + _SERIES[n]
    return plain, with_sine


@scalar
def slide_through_quarter(batch: Batch, g: float) -> None:
    """Set the gains by Eq. 4 over a quarter (`quarter`), a cycle (`drift`), and up to Üg = Üy.

    Over a rising quarter of the cycle let q₀ = ∫ e^(−k sin φ) dφ, q₁ = ∫ sin φ e^(−k sin φ) dφ, k =
    λA/g, and

        G = g (μs π/2 − (μs + Δμ) q₀)        R = A tan θ (μs − tan θ − (μs + Δμ) q₁)

    V gains G + R over a quarter of the positive half cycle, R − G over one of the negative, and 4R
    over a cycle.  Up to Üg = Üy, at ψy, V gains d₀ = ∫ D dψ (`gain`), and W d₁ = ∫ (ψy − ψ) D dψ
    (`moment`).
    """
    for j in range(WIDTH):
        amplitude = batch.amplitude[j]
        mu_s = batch.mu_s[j]
        tan_theta = batch.tan_theta[j]
        largest_friction = mu_s + batch.delta_mu[j]
        plain, with_sine = quarter_integrals(batch.decay_rate[j] * amplitude / g)
        drift = amplitude * tan_theta * ((mu_s - tan_theta) - largest_friction * with_sine)
        batch.quarter[j] = g * (HALF_PI * mu_s - largest_friction * plain) + drift
        batch.drift[j] = 4.0 * drift
        batch.start[j] = -HALF_PI
        batch.end[j] = batch.yield_phase[j]
        batch.validity[j] = 0.0
        batch.solved[j] = 1.0
    integrate_eq4(batch, 1.0, g)
    for j in range(WIDTH):
        batch.velocity[j] = batch.gain[j]
        batch.displacement[j] = batch.moment[j]


@scalar
def find_highest(batch: Batch, g: float) -> None:
    """Set the largest V of each half cycle that is entered with V = 0 (`highest_of_…`).

    V is largest where D changes its sign, or at an end of the half cycle.  D is ∓ g Δμ at Üg = 0.
    On the rise of the positive half cycle it is concave (by `kinds.classify`), on the negative one
    convex (as long as the block does not lift off): it changes its sign once at most, unless it has
    its first sign again at the peak; such a cell is not solved.  Where μ = μs it is −tan² θ |Üg|:
    before the zero on the positive half, behind it on the negative one, from where Newton's
    iteration passes it once, and not again.  The fall mirrors the rise: D changes its sign back
    when V has gained what it does in the half cycle, less what it had at the first change.
    """
    for side in (1.0, -1.0):
        for j in range(WIDTH):
            at_peak, slope = relative_acceleration(batch, j, side * batch.amplitude[j], g)
            turns = side * at_peak > 0.0
            # one that has its first sign at the peak may have changed twice, unless it still goes
            # away from it
            batch.solved[j] = batch.solved[j] if turns | (slope >= 0.0) else 0.0
            batch.converged[j] = 0.0 if turns else 1.0
            batch.event[j] = static_acceleration(batch, j, g) if turns else 0.0
        find_eq4_event(batch, 0.0, side, g)
        for j in range(WIDTH):
            batch.solved[j] = min(batch.solved[j], batch.converged[j])
            batch.end[j] = rising_phase(batch.event[j], batch.amplitude[j])
        integrate_eq4(batch, side, g)
        for j in range(WIDTH):
            turn = batch.gain[j]
            positive = 2.0 * batch.quarter[j]
            half = positive if side > 0.0 else batch.drift[j] - positive
            highest = max(half, half - turn)
            if side > 0.0:
                batch.highest_from_yield[j] = highest
                batch.highest_of_positive[j] = max(max(0.0, turn), highest)
            else:
                batch.highest_of_negative[j] = max(max(0.0, turn), highest)


@scalar
def slide_through_cycles(batch: Batch, options: Options) -> None:
    """Set W, and the largest V, of N cycles by Eq. 4 throughout.

    With G, R, d₀ and d₁ of `slide_through_quarter` the first cycle, up to Üg = Üy without d₀, and
    all of them add

        W₁ = ψy d₀ − d₁ + (π/2)(2 (G + R) − d₀) + π (2 (G + R) − d₀ + (R − G))

        W = W₁ + (N − 1) π (3 (G + R) + (R − G) − 2 d₀ + 4R N)
    """
    later = options.cycles - 1.0
    for j in range(WIDTH):
        missed = batch.velocity[j]
        drift = batch.drift[j]
        up = batch.quarter[j]
        down = 0.5 * drift - up  # over a quarter of the negative half cycle
        from_yield = 2.0 * up - missed  # up to the end of the first half cycle
        first = (
            batch.yield_phase[j] * missed
            - batch.displacement[j]
            + HALF_PI * from_yield
            + math.pi * (from_yield + down)
        )
        again = 3.0 * up + down - 2.0 * missed + drift * options.cycles
        batch.displacement[j] = first + later * math.pi * again
        # the negative half cycle is entered with what the positive one has left
        negative = 2.0 * up + batch.highest_of_negative[j]
        peak = max(0.0, max(batch.highest_from_yield[j], negative) - missed)
        fastest = max(batch.highest_of_positive[j], negative)
        last = drift - missed + fastest + max(0.0, (options.cycles - 2.0) * drift)
        batch.peak_velocity[j] = max(peak, last) if options.cycles > 1 else peak
