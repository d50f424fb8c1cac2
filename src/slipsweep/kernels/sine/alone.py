"""Cells under a sine that are solved one by one, as their motion has no simple shape.

In stick-slip these blocks come to Üg = Üy in motion and would stick there, hold b and follow Eq. 4
several times on one rise, have friction that falls in a thin layer, or the literal rise.  In
continuous sliding D changes its sign several times, or friction falls in a thin layer.

Between neighbouring places (`find_places`) E is monotone and D has one sign.  The rise goes
from place to place; the fall and Eq. 12 are those of all pulses (`pulse`).
docs/numerics.md#cells-solved-alone
"""

import math
from enum import IntEnum
from typing import NamedTuple

from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.jit.elementary import rising_phase, versine
from slipsweep.kernels.block import (
    KD_NOT_POSITIVE,
    LITERAL,
    NOT_RECOUPLED,
    YIELD_GOVERNS,
    Options,
)
from slipsweep.kernels.roots import root_of
from slipsweep.kernels.sine.batch import (
    HALF_PI,
    MOST_E_FOLDINGS,
    NODES,
    WEIGHTS,
    WIDTH,
    Batch,
    friction,
    held_gains,
    relative_acceleration,
)
from slipsweep.kernels.sine.pulse import fall
from slipsweep.model import equations as eq
from slipsweep.model.friction import (
    exponential_decay_length,
    exponential_derivatives,
    exponential_inflection,
)

#: Panels of the quadrature end where |Üg| has grown by so many decay lengths of the friction.
_PANEL_ENDS = (MOST_E_FOLDINGS, 16.0, 32.0, math.inf)


class Quantity(IntEnum):
    """Quantities of which `root` seeks a level, along |Üg|: E, dE/dx, D; along ψ: V."""

    RESPONSE = 0
    SLOPE = 1
    RELATIVE_ACCELERATION = 2
    VELOCITY_HELD = 3
    VELOCITY_BY_EQ4 = 4


# ------------------------------------------------------------------------------- gains by Eq. 4


class Gains(NamedTuple):
    """Gains of V and W from rest by Eq. 4, and the part of V's that changes its sign with Üg."""

    velocity: float
    displacement: float
    drift: float


@scalar
def eq4_gains(batch: Batch, j: int, start: float, end: float, g: float) -> Gains:
    """Return the gains of cell j by Eq. 4 from ψ to ψ on the rise of the positive half cycle.

    Gauss–Legendre rules on panels that grow as the friction falls: 12 nodes are enough for 6
    e-foldings of it.  `drift` is ∫ |Üg| tan θ (μs − tan θ − μ) dψ.
    """
    amplitude = batch.amplitude[j]
    mu_s = batch.mu_s[j]
    tan_theta = batch.tan_theta[j]
    length = exponential_decay_length(batch.decay_rate[j], g)
    x_start = amplitude * (1.0 - versine(start))
    x_end = amplitude * (1.0 - versine(end))
    e_foldings = (x_end - x_start) / length
    velocity = 0.0
    displacement = 0.0
    drift = 0.0
    near = start
    for bound in _PANEL_ENDS:
        until = end
        if e_foldings > bound:
            until = rising_phase(x_start + bound * length, amplitude)
        for node in range(NODES.size):
            psi = near + (until - near) * NODES[node]
            weight = (until - near) * WEIGHTS[node]
            x = amplitude * (1.0 - versine(psi))
            mu = friction(batch, j, x, g)
            drifts = weight * eq.drift(x, mu, mu_s, tan_theta)
            lags = weight * g * (mu_s - mu) + drifts
            velocity += lags
            displacement += (end - psi) * lags
            drift += drifts
        near = until
        if e_foldings <= bound:
            break
    return Gains(velocity, displacement, drift)


# ---------------------------------------------------------------------------- roots and places


@single
def _quantity(
    where: tuple[Batch, int, Quantity, float, float, float], x: float
) -> tuple[float, float]:
    """Return a quantity, less a level, and its slope at |Üg| or ψ; V begins at ψ = `start`."""
    batch, j, quantity, level, start, g = where
    if quantity >= Quantity.VELOCITY_HELD:
        ground_acceleration = batch.amplitude[j] * (1.0 - versine(x))
        if quantity == Quantity.VELOCITY_HELD:
            gained = held_gains(batch.amplitude[j], level, start, x)[0]
            return batch.velocity[j] + gained, ground_acceleration - level
        gained = eq4_gains(batch, j, start, x, g).velocity
        return batch.velocity[j] + gained, relative_acceleration(batch, j, ground_acceleration, g)[
            0
        ]
    value, slope = relative_acceleration(batch, j, x, g)
    if quantity == Quantity.RELATIVE_ACCELERATION:
        return value, slope
    if quantity == Quantity.RESPONSE:
        return x - value - level, 1.0 - slope
    first, second = exponential_derivatives(friction(batch, j, x, g), batch.decay_rate[j], g)
    curvature = eq.relative_acceleration_curvature(x, first, second, batch.tan_theta[j], g)
    return 1.0 - slope - level, -curvature


root = root_of(_quantity)


@scalar
def find_places(batch: Batch, j: int, start: float, end: float, g: float) -> None:
    """Set `places` of cell j to Üg on the way from `start` to `end` where E turns or D is 0.

    Both ends are places, too; `last_place` is the number of the last.  Of each `phases` has ψ, and
    `responses` E.  `advances` says if D > 0 from a place to the next.
    docs/numerics.md#slope-and-inflection
    """
    places = batch.places[j]
    places[0] = start
    last = 0
    bend = exponential_inflection(batch.tan_theta[j], batch.decay_rate[j], g)
    low = start
    lag, slope = relative_acceleration(batch, j, start, g)
    for high in (bend if start < bend < end else end, end):
        # between these two dE/dx is monotone: E turns where it is 0, D where it is 1
        before = 1.0 - slope
        after = 1.0 - relative_acceleration(batch, j, high, g)[1]
        nearer = 1.0 if before > after else 0.0
        for turn in (nearer, 1.0 - nearer, math.inf):
            x = high
            if turn < math.inf:
                if not min(before, after) < turn < max(before, after):
                    continue
                where = (batch, j, Quantity.SLOPE, turn, 0.0, g)
                below, above = (low, high) if before < after else (high, low)
                x = root(where, below, above, high, 0.0)
            lag_before = lag
            lag, slope = relative_acceleration(batch, j, x, g)
            if min(lag_before, lag) < 0.0 < max(lag_before, lag):
                where = (batch, j, Quantity.RELATIVE_ACCELERATION, 0.0, 0.0, g)
                below, above = (low, x) if lag_before < 0.0 else (x, low)
                last += 1
                places[last] = root(where, below, above, x, 0.0)
            if turn == 0.0:
                last += 1
                places[last] = x
            low = x
        if high == end:
            break
    last += 1
    places[last] = end
    batch.last_place[j] = last
    amplitude = batch.amplitude[j]
    for i in range(last + 1):
        batch.phases[j, i] = rising_phase(abs(places[i]), amplitude)
        batch.responses[j, i] = places[i] - relative_acceleration(batch, j, places[i], g)[0]
    for i in range(last):
        psi = 0.5 * (batch.phases[j, i] + batch.phases[j, i + 1])
        middle = math.copysign(amplitude * (1.0 - versine(psi)), end)
        batch.advances[j, i] = 1 if relative_acceleration(batch, j, middle, g)[0] > 0.0 else 0


# ----------------------------------------------------------------------------------- stick-slip


@scalar
def rise_alone(batch: Batch, j: int, options: Options) -> None:
    """Go from Üg = Üy, with V = `entered`, to the peak: V, W, and b there (`held`).

    V = 0 at the peak is a block at rest.  docs/model.md#motion
    """
    g = options.g
    literal = options.rise == LITERAL
    amplitude = batch.amplitude[j]
    yield_acceleration = batch.yield_acceleration[j]
    velocity = batch.entered[j]
    displacement = 0.0
    slides = velocity > 0.0
    least = velocity
    held = batch.responses[j, 0] if literal else max(batch.responses[j, 0], yield_acceleration)
    for i in range(int(batch.last_place[j])):
        start = batch.phases[j, i]
        end = batch.phases[j, i + 1]
        x = batch.places[j, i]
        response = batch.responses[j, i]
        response_at_end = batch.responses[j, i + 1]
        advances = batch.advances[j, i] > 0
        while slides or advances:
            if not slides:
                # t1; where D = 0, E is x but for rounding
                onset = response if literal else max(response, yield_acceleration)
                held = x if i > 0 and start == batch.phases[j, i] else min(onset, x)
                slides = True
                least = 0.0
            switch = end
            if literal or response_at_end > held:
                switch = start
                if not literal and response < held:
                    where = (batch, j, Quantity.RESPONSE, held, 0.0, g)
                    x_end = batch.places[j, i + 1]
                    switch = rising_phase(root(where, x, x_end, x_end, 0.0), amplitude)
            # b is held; V falls up to Üg = b
            if velocity > 0.0 and switch > start:
                turn = min(max(rising_phase(held, amplitude), start), switch)
                slowest = velocity + held_gains(amplitude, held, start, turn)[0]
                least = min(least, slowest)
                if slowest <= 0.0:
                    batch.velocity[j] = velocity
                    where = (batch, j, Quantity.VELOCITY_HELD, held, start, g)
                    stop = root(where, turn, start, turn, start)
                    moved = held_gains(amplitude, held, start, stop)[1]
                    displacement += velocity * (stop - start) + moved
                    velocity = 0.0
                    slides = False
                    start = stop
                    x = amplitude * (1.0 - versine(stop))
                    response = x - relative_acceleration(batch, j, x, g)[0]
                    continue
            if switch > start:  # over no way the gains are rounding
                gained, moved = held_gains(amplitude, held, start, switch)
                displacement += velocity * (switch - start) + moved
                velocity = max(velocity + gained, 0.0)
            # b follows Eq. 4
            if switch < end:
                gains = eq4_gains(batch, j, switch, end, g)
                until = end
                slides = advances or velocity + gains.velocity > 0.0
                if not slides:
                    batch.velocity[j] = velocity
                    where = (batch, j, Quantity.VELOCITY_BY_EQ4, 0.0, switch, g)
                    until = root(where, end, switch, end, switch)
                    gains = eq4_gains(batch, j, switch, until, g)
                displacement += velocity * (until - switch) + gains.displacement
                velocity = max(velocity + gains.velocity, 0.0) if slides else 0.0
                held = response_at_end
            batch.highest[j] = max(batch.highest[j], velocity)
            least = min(least, velocity)
            break
    batch.velocity[j] = velocity
    batch.displacement[j] = displacement
    batch.least_velocity[j] = least
    batch.held[j] = held if velocity > 0.0 else amplitude
    if velocity > 0.0 and held <= 0.0:  # by Eq. 12 the block does not come to rest
        batch.validity[j] = KD_NOT_POSITIVE
        batch.cycles_left[j] = 0.0


@inlined
def yield_governs(batch: Batch, j: int, rise: int) -> bool:
    """Return True if E ≤ Üy at all places of cell j, so that b = Üy throughout; not if literal."""
    governs = rise != LITERAL
    for i in range(int(batch.last_place[j]) + 1):
        governs &= batch.responses[j, i] <= batch.yield_acceleration[j]
    return governs


@scalar
def repeat_alone(batch: Batch, j: int, cycles: int) -> None:
    """Slide on by Eq. 12 from t5 to the next Üg = Üy, and pass over cycles that are alike.

    V before cycle 1, 2, 4, 8, … is kept; if it comes back, whole periods are passed over, too.
    docs/numerics.md#trains-of-pulses
    """
    held = batch.held[j]
    at_t5 = batch.velocity[j]
    later = batch.cycles_left[j] - 1.0
    pause = 3.0 * HALF_PI + batch.yield_phase[j]
    left = eq.attenuated_velocity(at_t5, held, pause)
    if left > 0.0 and later > 0.0:
        batch.validity[j] = int(batch.validity[j]) | NOT_RECOUPLED
    to_t5 = batch.displacement[j]
    gained = to_t5 + eq.attenuated_displacement(at_t5, held, pause)
    more = left - batch.entered[j]
    least = min(batch.least_velocity[j], left)
    batch.highest[j] = max(batch.highest[j], batch.peak_velocity[j])
    if later == 0.0 or more == 0.0 or (least > 0.0 and more > 0.0):
        # all others are alike, and the last one runs out (`pulse.repeat`)
        batch.total[j] += later * (gained + math.pi * more * (later - 1.0))
        batch.total[j] += to_t5 + later * more * (HALF_PI - batch.yield_phase[j])
        batch.total[j] += eq.attenuated_displacement(at_t5 + later * more, held, math.inf)
        batch.highest[j] = max(batch.highest[j], batch.peak_velocity[j] + later * more)
        batch.cycles_left[j] = 0.0
        return
    alike = 0.0
    if least > 0.0:
        alike = min(later - 1.0, float(math.floor(least / -more)))
    batch.total[j] += (1.0 + alike) * gained + math.pi * more * alike * (alike + 1.0)
    left += alike * more
    later -= alike
    if left == batch.seen_velocity[j]:
        period = batch.seen_cycles_left[j] - later
        periods = float(math.floor((later - 1.0) / period))
        batch.total[j] += periods * (batch.total[j] - batch.seen_total[j])
        later -= periods * period
        batch.seen_velocity[j] = -1.0  # no further period fits
        batch.next_look[j] = math.inf
    elif cycles - later >= batch.next_look[j]:
        batch.seen_velocity[j] = left
        batch.seen_total[j] = batch.total[j]
        batch.seen_cycles_left[j] = later
        batch.next_look[j] = 2.0 * (cycles - later)
    batch.entered[j] = left
    batch.cycles_left[j] = later


@scalar
def slip_alone(batch: Batch, used: int, options: Options) -> None:
    """Solve a batch of cells in stick-slip: `displacement`, `peak_velocity` and `validity`."""
    for j in range(WIDTH):
        batch.solved[j] = 1.0
        batch.validity[j] = 0.0
        batch.total[j] = 0.0
        batch.highest[j] = 0.0
        batch.entered[j] = 0.0
        batch.cycles_left[j] = options.cycles if j < used else 0.0
        batch.seen_velocity[j] = -1.0
        batch.next_look[j] = 1.0
        if j < used:
            find_places(batch, j, batch.yield_acceleration[j], batch.amplitude[j], options.g)
            if yield_governs(batch, j, options.rise):
                batch.validity[j] = YIELD_GOVERNS
    moving = used
    while moving > 0:
        for j in range(WIDTH):
            if batch.cycles_left[j] > 0.0:
                rise_alone(batch, j, options)
            if batch.cycles_left[j] == 0.0:
                batch.velocity[j] = 0.0
        fall(batch, options)
        moving = 0
        for j in range(WIDTH):
            if batch.cycles_left[j] > 0.0:
                repeat_alone(batch, j, options.cycles)
            if batch.solved[j] == 0.0:
                batch.cycles_left[j] = 0.0
            moving += 1 if batch.cycles_left[j] > 0.0 else 0
    for j in range(WIDTH):
        batch.displacement[j] = batch.total[j]
        batch.peak_velocity[j] = batch.highest[j]


# --------------------------------------------------------------------------- continuous sliding


@scalar
def slide_alone(batch: Batch, j: int, options: Options) -> None:
    """Set the gains of V over a quarter and a cycle, up to Üg = Üy, and its largest of half cycles.

    They are those of `continuous.slide_through_quarter` and `continuous.find_highest`.
    """
    g = options.g
    amplitude = batch.amplitude[j]
    to_yield = eq4_gains(batch, j, -HALF_PI, batch.yield_phase[j], g)
    over_quarter = eq4_gains(batch, j, -HALF_PI, 0.0, g)
    batch.velocity[j] = to_yield.velocity
    batch.displacement[j] = to_yield.displacement
    batch.quarter[j] = over_quarter.velocity
    batch.drift[j] = 4.0 * over_quarter.drift
    batch.validity[j] = 0.0
    batch.solved[j] = 1.0
    if not options.wants_peak:
        return
    for side in (1.0, -1.0):
        positive = 2.0 * batch.quarter[j]
        half = positive if side > 0.0 else batch.drift[j] - positive
        from_yield = half
        highest = max(0.0, half)
        find_places(batch, j, side * 0.0, side * amplitude, g)
        for i in range(1, int(batch.last_place[j])):
            psi = batch.phases[j, i]
            gains = eq4_gains(batch, j, -HALF_PI, psi, g)
            gained = gains.velocity if side > 0.0 else 2.0 * gains.drift - gains.velocity
            highest = max(highest, max(gained, half - gained))
            from_yield = max(from_yield, half - gained)
            if psi >= batch.yield_phase[j]:
                from_yield = max(from_yield, gained)
        if side > 0.0:
            batch.highest_from_yield[j] = from_yield
            batch.highest_of_positive[j] = highest
        else:
            batch.highest_of_negative[j] = highest
