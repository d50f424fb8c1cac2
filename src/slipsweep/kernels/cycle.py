"""The cycle solver: the response to a sine, event by event.

Between two events the block's acceleration is either held (closed forms) or follows
Eq. 4 (Gauss-Legendre quadrature of a smooth function), so that no step is taken and the
answer carries rounding errors only.  The phases of the motion stand below in their order:
`onset` (t1), `rise` (to the peak), `fall` (the hold, to t5), `recouple` or Eq. 12, and
`follow_pulse`, which goes through them; `train` strings pulses together; `continuous` needs
integrals over a quarter cycle.  The common cases go a shorter way (`sine`).  Notation:
ψ is the phase from the pulse's peak, x the plane's acceleration, b the block's, V and W
velocity and displacement (see `block`).

Events need not be located to the last digit: at an onset the rate of V is zero, at a stop
V itself, so an error δ in an event's phase moves W by δ² or less.
"""

import math

import numpy as np

from slipsweep.elementary import angle_minus_sine, half_square_minus_versine, sine_after, versine
from slipsweep.equations import CONTINUOUS, STUCK
from slipsweep.kernels.block import (
    EVENT_TOLERANCE,
    INTEGRATE,
    LITERAL,
    NEWMARK,
    Block,
    Motion,
    Options,
    friction,
    inflection,
    phase,
    response,
    response_and_slope,
    response_root,
    slip,
    slip_root,
    slope_and_curvature,
    slope_root,
    starting_acceleration,
)
from slipsweep.kernels.jit import in_lanes, scalar, summed
from slipsweep.kernels.train import Pulse, attenuate, pause, train_of

_HALF_PI = 0.5 * math.pi

#: 16 Gauss-Legendre nodes and weights on [0, 1]: two SIMD registers.
_NODES, _WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True))

#: Where panels of the quadrature end, in e-foldings of the friction from the start; past the
#: third it has decayed to 1e-18.
_PANEL_BOUNDS = (6.0, 18.0, 42.0, math.inf)

#: Signs at the start of a leg are read this fraction of the leg inside it.
_SLIVER = 1e-10

#: More legs than any rise has: five breaks, and a stop and an onset between each.
_MOST_LEGS = 32


@summed
def slip_integrals(block: Block, start: float, end: float, side: float) -> tuple[float, float]:
    """∫ D dψ and ∫ (end − ψ) D dψ over a part of a rising quarter: gains of V and W from rest.

    `side` is 1 for the positive half cycle and −1 for the negative one.
    """
    amplitude = side * block.amplitude
    x_start = amplitude * (1.0 - versine(start))
    decay = block.decay_rate / block.g
    e_foldings = decay * abs(amplitude * (1.0 - versine(end)) - x_start)
    first, second = 0.0, 0.0
    left = start
    for bound in _PANEL_BOUNDS:
        right = end if e_foldings <= bound else phase(block, abs(x_start) + bound / decay)
        width = right - left
        rate, moment = 0.0, 0.0
        for node in range(_NODES.size):
            weighted = _WEIGHTS[node] * slip(block, amplitude * sine_after(left, width * _NODES[node]))
            rate += weighted
            moment += (1.0 - _NODES[node]) * weighted
        second += (first + moment * width) * width
        first += rate * width
        left = right
        if e_foldings <= bound:
            break
    return first, second


@in_lanes
def held_motion(amplitude: float, held: float, start: float, end: float) -> tuple[float, float]:
    """∫ (x − b) dψ and ∫ (end − ψ)(x − b) dψ for a held b, |ψ| ≤ π/2: gains of V and W from rest."""
    width = end - start
    excess = amplitude - held
    sine_part = angle_minus_sine(start)
    first = excess * width - amplitude * (angle_minus_sine(end) - sine_part)
    second = 0.5 * excess * width * width - amplitude * (
        half_square_minus_versine(end) - half_square_minus_versine(start) - sine_part * width
    )
    return first, second


@scalar
def held_integrals(block: Block, held: float, start: float, end: float) -> tuple[float, float]:
    """`held_motion` of a block."""
    return held_motion(block.amplitude, held, start, end)


@scalar
def next_break(block: Block, x: float, end: float) -> float:
    """Where, on the way from x to end, one of E, dE/dx and D first ceases to be monotone."""
    inner = x + _SLIVER * (end - x)
    if 0.0 < inner < inflection(block):
        end = min(inflection(block), end)
    before = slope_and_curvature(block, inner)[0]
    after = slope_and_curvature(block, end)[0]
    # dE/dx passes 1 where D turns and 0 where E turns; the one nearer to `before` comes first
    for turn in (1.0, 0.0) if before > after else (0.0, 1.0):
        if min(before, after) < turn < max(before, after):
            return slope_root(block, turn, inner, end)
    return end


@scalar
def onset(block: Block, x: float, top: float) -> float:
    """t1: where on the rise from x to `top` the block at rest starts to slide (`top` if it does not)."""
    if block.rise == NEWMARK:
        return x
    for _ in range(_MOST_LEGS):
        if x >= top:
            break
        end = next_break(block, x, top)
        inner = x + _SLIVER * (end - x)
        if slip(block, inner) > 0.0:
            return x
        if slip(block, end) > 0.0:
            return slip_root(block, 0.0, inner, end)
        x = end
    return top


@scalar
def rising_leg(block: Block, x: float, top: float, b: float, follows: bool) -> tuple[float, bool, bool]:
    """The next leg of a slide on the rise from x to `top`: its end, whether b follows Eq. 4 on it, and from there on.

    A leg ends where that changes, where E or D turns, and where D changes its sign.
    """
    end, crosses = top, False
    if block.rise != NEWMARK:
        end = next_break(block, x, top)
        inner = x + _SLIVER * (end - x)
        asked, slope = response_and_slope(block, inner)
        if block.rise != LITERAL:
            follows = slope > 0.0 and (follows or asked >= b)
        if not follows and slope > 0.0 and response(block, end) > b:
            end = response_root(block, b, inner, end)
            crosses = True
        if follows and slip(block, inner) * slip(block, end) < 0.0:
            end = slip_root(block, 0.0, inner, end)
    if not follows and x < b < end:
        end = b
        crosses = False
    return end, follows, follows or crosses


@scalar
def stop(block: Block, held: float, follows: bool, velocity: float, start: float, end: float) -> float:
    """The phase in [start, end] at which a falling relative velocity reaches zero."""
    low, high = start, end
    psi = 0.5 * (start + end)
    for _ in range(200):
        x = block.amplitude * (1.0 - versine(psi))
        if follows:
            left, rate = velocity + slip_integrals(block, start, psi, 1.0)[0], slip(block, x)
        else:
            left, rate = velocity + held_integrals(block, held, start, psi)[0], x - held
        if left > 0.0:
            low = psi
        else:
            high = psi
        new = psi - left / rate
        if not low <= new <= high:
            new = 0.5 * (low + high)
        step = abs(new - psi)
        psi = new
        if step <= EVENT_TOLERANCE * (psi - start):
            break
    return psi


#: Kinds of legs, and the columns of a record of legs: what `history` needs to draw them.
STICK, HOLD, FOLLOW, RECOUPLE, ATTENUATE = range(5)
LEG_COLUMNS = 6
MOST_LEGS = 2 * _MOST_LEGS + 4


@scalar
def record(
    legs: np.ndarray, kind: int, start: float, end: float, held: float, velocity: float, displacement: float
) -> None:
    """Add a leg to a record whose first row counts them; a sweep keeps none and gives an empty one."""
    if legs.size:
        legs[0, 0] += 1.0
        row = int(legs[0, 0])
        legs[row, 0], legs[row, 1], legs[row, 2] = kind, start, end
        legs[row, 3], legs[row, 4], legs[row, 5] = held, velocity, displacement


@scalar
def rise(block: Block, velocity: float, legs: np.ndarray) -> tuple[float, float, float, float, float]:
    """From Üg = Üy to the peak: b, V, W, the largest and the least V.

    Goes from event to event: the block stays with the plane (stick), holds b, or follows
    Eq. 4; each leg ends where that changes, where E or D turns, or where V turns or vanishes.
    """
    amplitude, literal = block.amplitude, block.rise == LITERAL
    x = block.yield_acceleration
    psi = phase(block, x)
    b = starting_acceleration(block, x)
    displacement, peak, least = 0.0, velocity, velocity
    follows = literal
    for _ in range(_MOST_LEGS):
        if velocity <= 0.0:
            velocity = least = 0.0
            began = onset(block, x, amplitude)
            record(legs, STICK, psi, phase(block, began), 0.0, 0.0, displacement)
            if began > x:
                psi = phase(block, began)
                x = b = began  # where Eq. 4 meets Üg; to evaluate it there would add the rounding of g μs
            else:
                b = min(starting_acceleration(block, x), x)
            if x >= amplitude:
                break
            follows = literal
        end, follows, follows_on = rising_leg(block, x, amplitude, b, follows)
        psi_end = phase(block, end)
        if follows:
            gained, moved = slip_integrals(block, psi, psi_end, 1.0)
        else:
            gained, moved = held_integrals(block, b, psi, psi_end)
        if velocity + gained <= 0.0:
            stopped = stop(block, b, follows, velocity, psi, psi_end)
            if follows:
                gained, moved = slip_integrals(block, psi, stopped, 1.0)
            else:
                gained, moved = held_integrals(block, b, psi, stopped)
            record(legs, FOLLOW if follows else HOLD, psi, stopped, b, velocity, displacement)
            displacement += velocity * (stopped - psi) + moved
            velocity = 0.0
            psi = stopped
            x = amplitude * (1.0 - versine(psi))
            continue
        record(legs, FOLLOW if follows else HOLD, psi, psi_end, b, velocity, displacement)
        displacement += velocity * (psi_end - psi) + moved
        velocity += gained
        peak = max(peak, velocity)
        least = min(least, velocity)
        x, psi = end, psi_end
        if follows:
            b = response(block, x)
        follows = follows_on
        if x >= amplitude:
            break
    return b, velocity, displacement, peak, least


@scalar
def fall(block: Block, b: float, velocity: float, displacement: float, legs: np.ndarray) -> tuple[float, float, float]:
    """The hold from the peak to Üg = 0 (t2 to t5): V left at the end, W, and the largest V."""
    peak = velocity
    if b < block.amplitude:
        peak += held_integrals(block, b, 0.0, -phase(block, b))[0]
    end, left = _HALF_PI, velocity + held_integrals(block, b, 0.0, _HALF_PI)[0]
    if left <= 0.0:
        end, left = stop(block, b, False, velocity, 0.0, _HALF_PI), 0.0
    record(legs, HOLD, 0.0, end, b, velocity, displacement)
    return left, displacement + velocity * end + held_integrals(block, b, 0.0, end)[1], peak


@scalar
def recoupling_integrals(block: Block, b: float, chi: float) -> tuple[float, float]:
    """What integrating on takes from V and from W by χ = φ - π past t5."""
    sine = math.sin(0.5 * chi)
    return b * chi + 2.0 * block.amplitude * sine * sine, 0.5 * b * chi * chi + block.amplitude * (chi - math.sin(chi))


@scalar
def recouple(
    block: Block, b: float, velocity: float, duration: float, displacement: float, legs: np.ndarray
) -> tuple[float, float]:
    """From Üg = 0 (t5) on, for `duration` of phase at most, integrating on: V left and W."""
    amplitude = block.amplitude
    # V falls until the plane's next pulse exceeds b
    low, high = 0.0, duration
    if b < amplitude:
        high = min(duration, math.pi + math.asin(b / amplitude))
    chi, left = duration, 0.0
    if velocity > recoupling_integrals(block, b, high)[0]:
        left = velocity - recoupling_integrals(block, b, duration)[0]
    else:
        chi = high
        for _ in range(200):
            over = velocity - recoupling_integrals(block, b, chi)[0]
            if over > 0.0:
                low = chi
            else:
                high = chi
            new = chi + over / (b + amplitude * math.sin(chi))
            if not low <= new <= high:
                new = 0.5 * (low + high)
            step = abs(new - chi)
            chi = new
            if step <= EVENT_TOLERANCE * chi:
                break
    record(legs, RECOUPLE, _HALF_PI, _HALF_PI + chi, b, velocity, displacement)
    return left, displacement + velocity * chi - recoupling_integrals(block, b, chi)[1]


@scalar
def follow_pulse(block: Block, options: Options, velocity: float, last: bool, legs: np.ndarray) -> Pulse:
    """From one Üg = Üy to the next, or to the end of the motion if no pulse follows."""
    b, velocity, displacement, peak, least = rise(block, velocity, legs)
    if velocity > 0.0:
        velocity, displacement, highest = fall(block, b, velocity, displacement, legs)
        peak = max(peak, highest)
    started, duration = _HALF_PI, math.inf if last else pause(block)
    if velocity > 0.0 and options.recoupling == INTEGRATE:
        shaken = math.pi if last else duration
        velocity, displacement = recouple(block, b, velocity, shaken, displacement, legs)
        started += shaken
        duration -= shaken
    if velocity > 0.0 and duration > 0.0:
        record(legs, ATTENUATE, started, started + min(duration, velocity / b), b, velocity, displacement)
        velocity, slid = attenuate(b, velocity, duration)
        displacement += slid
    return Pulse(velocity, displacement, peak, min(least, velocity))


@scalar
def pulse(block: Block, options: Options, table: np.ndarray, velocity: float, last: bool) -> Pulse:
    """One cycle of a sweep, of which no record is kept."""
    return follow_pulse(block, options, velocity, last, np.empty((0, LEG_COLUMNS)))


train = train_of(pulse)


@scalar
def continuous_peak(block: Block, side: float, half_gain: float, after: float) -> float:
    """Largest V in a half cycle entered with V = 0, where the plane has passed `after` on its rise.

    V peaks where its rate D changes sign; the falling quarter mirrors the rising one, over
    which and back V gains `half_gain`.
    """
    peak = half_gain if after > 0.0 else max(0.0, half_gain)
    x, end = 0.0, side * block.amplitude
    for _ in range(_MOST_LEGS):
        target = next_break(block, x, end)
        inner = x + _SLIVER * (target - x)
        if slip(block, inner) * slip(block, target) < 0.0:
            zero = abs(slip_root(block, 0.0, inner, target))
            gained = slip_integrals(block, -_HALF_PI, phase(block, zero), side)[0]
            peak = max(peak, half_gain - gained)
            if zero > after:
                peak = max(peak, gained)
        x = target
        if x == end:
            break
    return peak


@in_lanes
def continuous_displacement(
    up: float, missed: float, missed_moment: float, drift: float, began: float, cycles: int
) -> float:
    """W of all cycles, from integrals over the rising quarter of the positive half cycle.

    `up` is ∫ D over the quarter, `missed` and `missed_moment` the integrals of D (as
    `slip_integrals`) up to ψ = `began`, where sliding starts, and `drift` the gain of V
    over a cycle.
    """
    down = 0.5 * drift - up  # ∫ D over a quarter of the negative half cycle
    # to the peak W misses what D would have given before Üg = Üy; the other quarters are whole
    displacement = (
        began * missed - missed_moment + _HALF_PI * (2.0 * up - missed) + math.pi * (2.0 * up - missed + down)
    )
    later = cycles - 1.0
    return displacement + later * math.pi * (2.0 * (drift - missed) + 3.0 * up + down + drift * (later - 1.0))


@scalar
def continuous(block: Block, cycles: int, wants_peak: bool) -> Motion:
    """Continuous sliding from the first Üg = Üy on: Eq. 4 throughout.

    |Üg| and the friction repeat every quarter cycle, mirrored, so that integrals over a
    quarter give a cycle, and the cycles an arithmetic series.
    """
    began = phase(block, block.yield_acceleration)
    missed, missed_moment = slip_integrals(block, -_HALF_PI, began, 1.0)
    up = missed + slip_integrals(block, began, 0.0, 1.0)[0]
    drift = drift_integral(block)
    displacement = continuous_displacement(up, missed, missed_moment, drift, began, cycles)
    peak = math.nan
    if wants_peak:
        positive = continuous_peak(block, 1.0, 2.0 * up, block.yield_acceleration)
        negative = 2.0 * up + continuous_peak(block, -1.0, drift - 2.0 * up, 0.0)
        peak = max(0.0, max(positive, negative) - missed)
        if cycles > 1:
            positive = continuous_peak(block, 1.0, 2.0 * up, 0.0)
            peak = max(peak, drift - missed + max(positive, negative) + max(0.0, (cycles - 2.0) * drift))
    return Motion(displacement, peak, 0)


@scalar
def drift_rate(block: Block, x: float) -> float:
    """tan θ x (μs − tan θ − μ), half of what V gains at x and at −x together; where μ is huge, tan θ x is not."""
    return block.tan_theta * x * (block.mu_s - block.tan_theta - friction(block, x))


@summed
def drift_integral(block: Block) -> float:
    """Gain of V over a whole cycle, 4 ∫ tan θ x (μs − tan θ − μ) dψ over a quarter.

    The sum of the two half cycles with g cancelled by hand: over 10⁶ cycles the rounding
    of that cancellation would show.
    """
    decay = block.decay_rate / block.g
    e_foldings = decay * block.amplitude
    total = 0.0
    left = -_HALF_PI
    for bound in _PANEL_BOUNDS:
        right = 0.0 if e_foldings <= bound else phase(block, bound / decay)
        width = right - left
        part = 0.0
        for node in range(_NODES.size):
            x = block.amplitude * sine_after(left, width * _NODES[node])
            part += _WEIGHTS[node] * drift_rate(block, x)
        total += part * width
        left = right
        if e_foldings <= bound:
            break
    return 4.0 * total


@scalar
def solve(block: Block, options: Options, table: np.ndarray) -> Motion:
    """The motion of a block that has a value."""
    if block.sliding_mode == STUCK:
        return Motion(0.0, 0.0, 0)
    if block.sliding_mode == CONTINUOUS:
        return continuous(block, options.cycles, options.wants_peak)
    return train(block, options, table)
