"""Stick-slip under a sine: a pulse from its onset to the stop, and all cycles.

Rules of the motion: docs/model.md.  ψ is the phase from the peak of the pulse.
"""

import math

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.jit.elementary import (
    angle_minus_sine,
    half_square_minus_versine,
    rising_phase,
    versine,
)
from slipsweep.kernels.block import INTEGRATE, NOT_RECOUPLED, Options
from slipsweep.kernels.sine.batch import (
    HALF_PI,
    MOST_STEPS,
    TOLERANCE,
    WIDTH,
    Batch,
    find_eq4_event,
    held_gains,
    integrate_eq4,
    relative_acceleration,
)
from slipsweep.kernels.sine.kinds import STAYS_AT_YIELD, STICKS_AT_YIELD
from slipsweep.model import equations as eq
from slipsweep.model.friction import exponential_inflection

#: No λ or tan θ is divided by that is smaller.
_LEAST = 1e-150


@inlined
def gains_after_peak(amplitude: float, held: float, psi: float) -> tuple[float, float, float]:
    """Return `held_gains` from the peak to 0 ≤ ψ ≤ 3π/2, and the rate of V there, Üg − b."""
    beyond = psi > HALF_PI
    # sin ψ = −sin χ and cos ψ = −cos χ for χ = ψ − π
    near = psi - math.pi if beyond else psi
    fallen = versine(near)
    lag = angle_minus_sine(near)
    swept = half_square_minus_versine(near)
    if beyond:
        swept = 0.5 * psi * psi - (2.0 - fallen)
        fallen = 2.0 - fallen
        lag = psi + (near - lag)
    excess = amplitude - held
    rate = excess - amplitude * fallen
    return excess * psi - amplitude * lag, 0.5 * excess * psi * psi - amplitude * swept, rate


@scalar
def find_stop(batch: Batch, last: float) -> None:
    """Set `event` to the ψ of the stop, with `velocity` at the peak and b `held` from there on.

    Newton's iteration of all cells that have not `converged`, from `event` on, which is beyond the
    stop, and up to `last`.
    """
    for _ in range(MOST_STEPS):
        missing = 0
        for j in range(WIDTH):
            psi = batch.event[j]
            gain, _, rate = gains_after_peak(batch.amplitude[j], batch.held[j], psi)
            step = (batch.velocity[j] + gain) / rate
            there = batch.converged[j] > 0.0
            batch.event[j] = psi if there else min(max(psi - step, 0.0), last)
            there |= abs(step) <= TOLERANCE * psi
            batch.converged[j] = 1.0 if there else 0.0
            missing += 0 if there else 1
        if missing == 0:
            break


@scalar
def begin_to_slide(batch: Batch, kind: int, g: float) -> None:
    """Set `start` to the ψ at which a cell begins to slide (t1), and `level` to b there.

    Üg = Üy, or where the block sticks there the Üg at which E has come down to it, D = 0.
    docs/numerics.md#onset-and-switch
    """
    for j in range(WIDTH):
        batch.solved[j] = 1.0
        batch.validity[j] = 0.0
        batch.level[j] = batch.yield_acceleration[j]
        batch.start[j] = batch.yield_phase[j]
    if kind != STICKS_AT_YIELD:
        return
    for j in range(WIDTH):
        # from where D ceases to be convex: beyond the root before it, and before the root beyond it
        tan_theta = max(batch.tan_theta[j], _LEAST)
        decay_rate = max(batch.decay_rate[j], _LEAST)
        bend = exponential_inflection(tan_theta, decay_rate, g)
        batch.event[j] = min(max(bend, batch.yield_acceleration[j]), batch.amplitude[j])
        batch.converged[j] = 0.0
    find_eq4_event(batch, 0.0, 1.0, g)
    for j in range(WIDTH):
        batch.solved[j] = batch.converged[j]
        batch.level[j] = batch.event[j]
        batch.start[j] = rising_phase(batch.event[j], batch.amplitude[j])


@scalar
def rise(batch: Batch, kind: int, g: float) -> None:
    """Slide from t1 to the peak with b = max(b, E), which is `held` from there on.

    b is held up to E = b, the switch, and follows Eq. 4 beyond it.
    docs/numerics.md#onset-and-switch
    """
    if kind == STAYS_AT_YIELD:
        for j in range(WIDTH):
            batch.held[j] = batch.level[j]
            gained = held_gains(batch.amplitude[j], batch.level[j], batch.start[j], 0.0)
            batch.velocity[j], batch.displacement[j] = gained
            batch.solved[j] = 1.0 if batch.velocity[j] > 0.0 else 0.0
        return
    for j in range(WIDTH):
        amplitude = batch.amplitude[j]
        level = batch.level[j]
        rate, slope = relative_acceleration(batch, j, amplitude, g)
        excess = amplitude - rate - level
        follows = excess > 0.0
        batch.held[j] = amplitude - rate if follows else level
        batch.event[j] = amplitude - excess / (1.0 - slope) if follows else amplitude
        batch.converged[j] = 0.0 if follows else 1.0
    find_eq4_event(batch, 1.0, 1.0, g)
    for j in range(WIDTH):
        batch.solved[j] = min(batch.solved[j], batch.converged[j])
        # not before the start, from which it may differ by the rounding of two roots
        switch = max(rising_phase(batch.event[j], batch.amplitude[j]), batch.start[j])
        gained = held_gains(batch.amplitude[j], batch.level[j], batch.start[j], switch)
        batch.velocity[j], batch.displacement[j] = gained
        batch.start[j] = switch
        batch.end[j] = 0.0
    integrate_eq4(batch, 1.0, g)
    for j in range(WIDTH):
        batch.displacement[j] += batch.moment[j] - batch.velocity[j] * batch.start[j]
        batch.velocity[j] += batch.gain[j]
        batch.solved[j] = batch.solved[j] if batch.velocity[j] > 0.0 else 0.0


@scalar
def fall(batch: Batch, options: Options) -> None:
    """Slide with b held from the peak to the stop; by Eq. 12 no further than to t5, Üg = 0.

    `velocity` is then V at t5.  A block with V = 0 at the peak is at rest.

    V at t5 is V + A − b π/2.  V is largest, V₀, at Üg = b, ψ₀, and below the parabola V₀ − ½ A sin
    ψ₀ (ψ − ψ₀)² from there up to t5.  Beyond t5, χ = ψ − π/2, it is V − b χ − A vers χ, and vers χ
    ≥ 2 χ²/π².  The zeros of the parabola, and of that with 2 χ²/π², are beyond the stop: there the
    iteration starts, or at χ = π/2, where V bends. docs/numerics.md#stop
    """
    eq12 = options.recoupling != INTEGRATE
    missing = 0
    for j in range(WIDTH):
        rests = batch.velocity[j] == 0.0
        at_t5 = batch.velocity[j] + batch.amplitude[j] - HALF_PI * batch.held[j]
        at_t5 = 0.0 if rests else at_t5
        converged = (eq12 & (at_t5 > 0.0)) | rests
        batch.gain[j] = at_t5
        batch.event[j] = 0.0 if rests else HALF_PI
        batch.converged[j] = 1.0 if converged else 0.0
        batch.peak_velocity[j] = 0.0
        missing += 0 if converged else 1
    if options.wants_peak or missing > 0:
        for j in range(WIDTH):
            amplitude = batch.amplitude[j]
            held = batch.held[j]
            at_t5 = batch.gain[j]
            top = -rising_phase(held, amplitude)
            peak = batch.velocity[j] + held_gains(amplitude, held, 0.0, top)[0]
            sine = top - angle_minus_sine(top)
            before_t5 = min(top + math.sqrt(2.0 * peak / (amplitude * sine)), HALF_PI)
            longest = max(at_t5, 0.0) / held
            curvature = amplitude / held * (4.0 / (math.pi * math.pi))
            after_t5 = HALF_PI + min(
                2.0 * longest / (1.0 + math.sqrt(1.0 + 2.0 * curvature * longest)), HALF_PI
            )
            beyond = HALF_PI if eq12 else after_t5
            stop = beyond if at_t5 > 0.0 else before_t5
            rests = batch.velocity[j] == 0.0
            batch.event[j] = 0.0 if rests else stop
            batch.peak_velocity[j] = 0.0 if rests else peak
    if missing > 0:
        find_stop(batch, HALF_PI if eq12 else 3.0 * HALF_PI)
    for j in range(WIDTH):
        stop = batch.event[j]
        batch.solved[j] = min(batch.solved[j], batch.converged[j])
        gained = gains_after_peak(batch.amplitude[j], batch.held[j], stop)[1]
        batch.displacement[j] += batch.velocity[j] * stop + gained
        batch.velocity[j] = max(batch.gain[j], 0.0) if eq12 else 0.0


@scalar
def repeat(batch: Batch, kind: int, options: Options) -> None:
    """Slide on by Eq. 12 from t5, and through all cycles: `displacement` and `peak_velocity`.

    By integration the block is at rest within the cycle, and all are alike.  For Eq. 12 let L be V
    and M be W at t5, v₁ what is left of L at the next Üg = Üy, h the phase from Üg = Üy to t5, and
    W₀ = M + (L² − v₁²)/(2b).  Where a block that moves at Üg = Üy goes on as one at rest does, with
    b = Üy, each of N cycles adds v₁ to V, and the last slides to its stop:

        W = (N − 1)(W₀ + π v₁ (N − 2)) + M + (N − 1) v₁ h + (L + (N − 1) v₁)²/(2b)

    A block that sticks at Üg = Üy when at rest does not when it moves: such a cell is not solved
    (`alone` solves it). docs/numerics.md#batches-of-the-sine
    """
    if options.recoupling == INTEGRATE:
        for j in range(WIDTH):
            batch.displacement[j] *= options.cycles
        return
    later = options.cycles - 1.0
    for j in range(WIDTH):
        held = batch.held[j]
        at_t5 = batch.velocity[j]
        to_t5 = batch.displacement[j]
        pause = 3.0 * HALF_PI + batch.yield_phase[j]
        left = eq.attenuated_velocity(at_t5, held, pause)
        cycle = to_t5 + eq.attenuated_displacement(at_t5, held, pause)
        last_at_t5 = at_t5 + later * left
        last = to_t5 + later * left * (HALF_PI - batch.yield_phase[j])
        last += eq.attenuated_displacement(last_at_t5, held, math.inf)
        batch.displacement[j] = later * (cycle + math.pi * left * (later - 1.0)) + last
        batch.peak_velocity[j] += later * left
        moves = (left > 0.0) & (later > 0.0)
        batch.validity[j] = NOT_RECOUPLED if moves else 0.0
        batch.solved[j] = 0.0 if moves & (kind == STICKS_AT_YIELD) else batch.solved[j]
