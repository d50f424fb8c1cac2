"""The kind of a cell's motion under a sine, which is determined before the motion.

docs/numerics.md#batches-of-the-sine
"""

import math

from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.jit.elementary import rising_phase
from slipsweep.kernels.block import MONOTONE, NEWMARK, Options, decay_rate_of, interface_of
from slipsweep.kernels.sine.batch import (
    MOST_E_FOLDINGS,
    SHORT,
    WIDTH,
    Batch,
    cell_of,
    relative_acceleration,
    static_acceleration,
)
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK

#: Kinds of motion that batches are made of: from Üg = Üy to the peak b = Üy throughout (Newmark's
#: block, too), or b = Üy and then Eq. 4, or at rest until Eq. 4 falls below Üg; Eq. 4 all the time,
#: with μ = μs early on the rise or late.  Then all others of stick-slip and of continuous sliding,
#: solved one by one (`alone`).
STAYS_AT_YIELD, FOLLOWS_EQ4, STICKS_AT_YIELD, SLIDES_ON, SLIDES_ON_LATE = range(5)
SLIPS_ALONE = 5
SLIDES_ALONE = 6
KINDS = 7
#: No motion: stuck, without a value, or as Eq. 4 does not fall below Üg.
RESTS = 7

#: |Üg| over the amplitude up to which parts of continuous sliding are short.
_EARLY = math.sin(SHORT)


@inlined
def pulse_kind(batch: Batch, j: int, g: float) -> int:
    """Return the kind of stick-slip: that of a batch if b is held first and then follows Eq. 4."""
    tan_theta = batch.tan_theta[j]
    mu_s = batch.mu_s[j]
    decay_rate = batch.decay_rate[j]
    start = batch.yield_acceleration[j]
    end = batch.amplitude[j]
    sticks = batch.response_at_yield[j] >= start
    follows = batch.response_at_peak[j] > start
    # as D > 0 at the peak, it stays positive once it is: either E is convex from where sliding may
    # begin, hence D concave; or D, convex first, is negative at Üy or rises there, and dE/dx > 0,
    # both by bounds with the largest friction
    largest_friction = mu_s + batch.delta_mu[j]
    decay_at_yield = decay_rate * eq.normal_acceleration(start, tan_theta, g) / g
    decay_at_peak = decay_rate * eq.normal_acceleration(end, tan_theta, g) / g
    convex = decay_at_yield >= 2.0 * tan_theta
    steepest = min(decay_at_peak - tan_theta, tan_theta)
    rises = (mu_s if sticks else largest_friction) * steepest < eq.limit_denominator(
        mu_s, tan_theta
    )
    lags = sticks | (
        largest_friction * (tan_theta - decay_at_yield) <= tan_theta * (mu_s - tan_theta)
    )
    smooth = (batch.response_at_peak[j] < end) & (convex | (rises & lags))
    gentle = decay_rate * end <= MOST_E_FOLDINGS * g
    kind = (STICKS_AT_YIELD if sticks else FOLLOWS_EQ4) if gentle else SLIPS_ALONE
    kind = STAYS_AT_YIELD if (not sticks) & (not follows) else kind
    return kind if smooth else SLIPS_ALONE


@inlined
def stays_with_base(batch: Batch, j: int, g: float) -> bool:
    """Return True if Eq. 4 keeps a block with the base up to the peak: D ≤ 0 from Üy on.

    D is convex, then concave: nowhere larger than at Üy or than its tangent at the peak.
    """
    start = batch.yield_acceleration[j]
    peak = batch.amplitude[j]
    rate, slope = relative_acceleration(batch, j, peak, g)
    highest = rate - min(slope, 0.0) * (peak - start)
    return (batch.response_at_yield[j] >= start) & (highest <= 0.0)


@scalar
def classify(batch: Batch, options: Options) -> None:
    """Set the block of each cell of a batch, its mode and flags, and the kind of its motion.

    Neighbours are mostly alike: what none of the cells needs is not computed.
    """
    g = options.g
    slides = 0
    pulses = 0
    for j in range(WIDTH):
        interface = interface_of(cell_of(batch, j), options.rise, g)
        batch.yield_acceleration[j] = interface.yield_acceleration
        batch.delta_mu[j] = interface.delta_mu
        batch.minimum_friction[j] = interface.minimum_friction
        batch.sliding_mode[j] = interface.sliding_mode
        batch.validity_before[j] = interface.validity
        batch.kind[j] = RESTS
        slides += 1 if interface.sliding_mode > STUCK else 0
        pulses += 1 if interface.sliding_mode == STICK_SLIP else 0
    if slides == 0:
        return
    for j in range(WIDTH):
        batch.yield_phase[j] = rising_phase(batch.yield_acceleration[j], batch.amplitude[j])
    if options.rise == NEWMARK:
        for j in range(WIDTH):
            batch.kind[j] = STAYS_AT_YIELD if batch.sliding_mode[j] == STICK_SLIP else RESTS
        return
    for j in range(WIDTH):
        batch.decay_rate[j] = decay_rate_of(
            cell_of(batch, j), batch.delta_mu[j], batch.minimum_friction[j], g
        )
    if pulses > 0:
        classify_pulses(batch, options)
    if slides > pulses:
        for j in range(WIDTH):
            gentle = batch.decay_rate[j] * batch.amplitude[j] <= MOST_E_FOLDINGS * g
            # for the peak velocity D has to be concave (`continuous`)
            concave = batch.decay_rate[j] >= 2.0 * batch.tan_theta[j]
            together = gentle & (concave | (not options.wants_peak))
            # where the integrals end: at Üy, and for the peak velocity where D = 0
            longest = static_acceleration(batch, j, g) if options.wants_peak else 0.0
            longest = max(longest, batch.yield_acceleration[j])
            kind = SLIDES_ON if longest <= _EARLY * batch.amplitude[j] else SLIDES_ON_LATE
            kind = kind if together else SLIDES_ALONE
            batch.kind[j] = kind if batch.sliding_mode[j] == CONTINUOUS else batch.kind[j]


@single
def classify_pulses(batch: Batch, options: Options) -> None:
    """Set the kind of the cells in stick-slip."""
    g = options.g
    lagging = 0
    for j in range(WIDTH):
        start = batch.yield_acceleration[j]
        end = batch.amplitude[j]
        batch.response_at_yield[j] = start - relative_acceleration(batch, j, start, g)[0]
        batch.response_at_peak[j] = end - relative_acceleration(batch, j, end, g)[0]
        pulses = batch.sliding_mode[j] == STICK_SLIP
        kind = pulse_kind(batch, j, g) if options.rise == MONOTONE else SLIPS_ALONE
        batch.kind[j] = kind if pulses else batch.kind[j]
        lagging += 1 if pulses & (batch.response_at_peak[j] >= end) else 0
    if lagging > 0:
        for j in range(WIDTH):
            pulses = batch.sliding_mode[j] == STICK_SLIP
            rests = pulses & stays_with_base(batch, j, g)
            batch.kind[j] = RESTS if rests else batch.kind[j]
