"""The cycle solver: the response to a sine, event by event.

Between two events the block's acceleration is either held (closed forms) or follows
Eq. 4 (Gauss-Legendre quadrature of a smooth function), so that no step is taken and the
answer carries rounding errors only.  The phases of the motion stand below in their order:
`onset` (t1), `rise` (to the peak), `fall` (the hold, to t5), `recouple` or Eq. 12, and
`follow_pulse`, which goes through them; `train` strings pulses together; `continuous` needs
integrals over a quarter cycle.  Then the common case once more, in SIMD lanes.  Notation:
ψ is the phase from the pulse's peak, x the plane's acceleration, b the block's, V and W
velocity and displacement (see `block`).

Events need not be located to the last digit: at an onset the rate of V is zero, at a stop
V itself, so an error δ in an event's phase moves W by δ² or less.
"""

import math

import numpy as np

from slipsweep import equations as eq
from slipsweep.elementary import angle_minus_sine, half_square_minus_versine, inverse_versine, versine
from slipsweep.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    DECAY_RATE,
    EQ4_BELOW_YIELD,
    EVENT_TOLERANCE,
    INTEGRATE,
    LANE_ROWS,
    LITERAL,
    MONOTONE,
    MU_S,
    NEWMARK,
    NO_VALUE,
    NOT_RECOUPLED,
    TAN_THETA,
    TILE,
    YIELD,
    Block,
    Motion,
    Options,
    block_at,
    block_of,
    cell_of,
    friction,
    inflection,
    lane_friction,
    lane_of,
    lane_response,
    phase,
    response,
    response_and_slope,
    response_root,
    slip,
    slip_root,
    slope_and_curvature,
    slope_root,
    starting_acceleration,
    whole_lanes,
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
            weighted = _WEIGHTS[node] * slip(block, amplitude * (1.0 - versine(left + width * _NODES[node])))
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
def onset(block: Block, x: float) -> float:
    """t1: where on the rise, from x on, the block at rest starts to slide (A if it does not)."""
    if block.rise == NEWMARK:
        return x
    for _ in range(_MOST_LEGS):
        if x >= block.amplitude:
            break
        end = next_break(block, x, block.amplitude)
        inner = x + _SLIVER * (end - x)
        if slip(block, inner) > 0.0:
            return x
        if slip(block, end) > 0.0:
            return slip_root(block, 0.0, inner, end)
        x = end
    return block.amplitude


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
            began = onset(block, x)
            record(legs, STICK, psi, phase(block, began), 0.0, 0.0, displacement)
            if began > x:
                psi = phase(block, began)
                x = began
            if x >= amplitude:
                break
            b = min(starting_acceleration(block, x), x)  # equal at an onset, but for rounding
            follows = literal
        end = amplitude
        crosses = False
        if block.rise != NEWMARK:
            end = next_break(block, x, amplitude)
            inner = x + _SLIVER * (end - x)
            asked, slope = response_and_slope(block, inner)
            if not literal:
                follows = slope > 0.0 and (follows or asked >= b)
            if not follows and slope > 0.0 and response(block, end) > b:
                end = response_root(block, b, inner, end)
                crosses = True
            if follows and slip(block, inner) * slip(block, end) < 0.0:
                end = slip_root(block, 0.0, inner, end)
        if not follows and x < b < end:
            end = b
            crosses = False
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
        follows = follows or crosses
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


@summed
def drift_integral(block: Block) -> float:
    """Gain of V over a whole cycle, 4 tan θ ∫ x (μs − tan θ − μ) dψ over a quarter.

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
            x = block.amplitude * (1.0 - versine(left + width * _NODES[node]))
            part += _WEIGHTS[node] * x * (block.mu_s - block.tan_theta - friction(block, x))
        total += part * width
        left = right
        if e_foldings <= bound:
            break
    return 4.0 * block.tan_theta * total


@scalar
def solve(block: Block, options: Options, table: np.ndarray) -> Motion:
    """The motion of a block that has a value."""
    if block.sliding_mode == STUCK:
        return Motion(0.0, 0.0, 0)
    if block.sliding_mode == CONTINUOUS:
        return continuous(block, options.cycles, options.wants_peak)
    return train(block, options, table)


# ------------------------------------------------------------------ the common case, in lanes
#
# Nearly all cells go the same way: they slide from Üg = Üy, hold the yield value, perhaps
# follow Eq. 4 to the peak, hold again and stop before the next pulse; or they slide
# continuously with a friction that decays gently.  The functions below are that way once
# more, phase by phase, for many cells at a time, in loops that LLVM turns into SIMD (Newton
# with a fixed number of iterations, quadrature nodes outside, cells inside).  A cell whose
# iteration has not converged, or that goes another way, is solved by `solve`.

#: Rows of the lanes beside the block's.
_X, _LEVEL, _START, _V, _W, _HELD, _RATE, _MOMENT, _PSI, _LEFT, _PEAK, _CONVERGED, _CODE = range(
    LANE_ROWS * TILE, (LANE_ROWS + 13) * TILE, TILE
)
_LANES_SIZE = (LANE_ROWS + 13) * TILE

#: Rows of a tile's blocks beside the lanes': the codes, and the way a cell goes.
_MODE, _VALIDITY, _WAY = range(LANE_ROWS * TILE, (LANE_ROWS + 3) * TILE, TILE)
_BLOCKS_SIZE = (LANE_ROWS + 3) * TILE

#: The ways a cell can go: held at the yield value to the peak; held, then by Eq. 4; stuck at
#: Üg = Üy until Eq. 4 falls below Üg; sliding continuously.
_OTHER, _YIELD_GOVERNS, _FOLLOWS, _STICKS, _CONTINUOUS = range(5)

#: 12 nodes reach 1e-14 where friction falls by no more than e^6 (at 8 e-foldings, 2e-14).
_LANE_NODES, _LANE_WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(12), (1.0, 0.0), strict=True))
_LANE_E_FOLDINGS = 6.0
_LANE_SINES = np.sin(_HALF_PI * _LANE_NODES)

#: Before Üg = Üy, on the first 0.6 radians of the cycle at most, 8 nodes reach 1e-14.
_SHORT_NODES, _SHORT_WEIGHTS = (
    (a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(8), (1.0, 0.0), strict=True)
)
_SHORT_SINE = math.sin(0.6)

#: Newton iterations of the lanes, and the relative size of the last that counts as converged
#: (the error left is its square, and enters the result squared again).
_LANE_ITERATIONS = 5
#: For lanes that stick first, few, whose curves start flat.
_STICKS_ITERATIONS = 9
_LANE_TOLERANCE = 1e-5


@in_lanes
def way_of(block: Block, options: Options, at_start: float, at_end: float) -> int:
    """Which way a cell goes, given E at Üg = Üy and at the peak."""
    decay = block.decay_rate / block.g
    start, end = block.yield_acceleration, block.amplitude
    gentle = decay * end <= _LANE_E_FOLDINGS
    # either E is convex, hence D concave, and as D > 0 at the peak it stays positive once it is;
    # or 0 < dE/dx < 1, by bounds with the largest friction and normal acceleration
    tan_theta, most = block.tan_theta, block.mu_s + block.delta_mu
    convex = block.decay_rate >= 2.0 * tan_theta
    rises = most * (decay * (block.g + end * tan_theta) - tan_theta) < eq.limit_denominator(block.mu_s, tan_theta)
    lags = most * (tan_theta - block.decay_rate) <= tan_theta * (block.mu_s - tan_theta)
    smooth = (options.rise == MONOTONE) & (at_end < end) & (convex | (rises & lags))
    sticks_or_follows = _STICKS if at_start >= start else _FOLLOWS
    way = sticks_or_follows if gentle else _OTHER
    way = _YIELD_GOVERNS if (at_start < start) & (at_end <= start) else way
    way = way if smooth else _OTHER
    way = _YIELD_GOVERNS if options.rise == NEWMARK else way
    way = way if block.sliding_mode == STICK_SLIP else _OTHER
    early = gentle & (start <= _SHORT_SINE * end) & (not options.wants_peak)
    return _CONTINUOUS if (block.sliding_mode == CONTINUOUS) & early else way


@in_lanes
def lane_response_and_slope(lanes: np.ndarray, j: int, x: float, g: float) -> tuple[float, float]:
    """E and dE/dx of a lane (x > 0)."""
    tan_theta, mu_s = lanes[TAN_THETA + j], lanes[MU_S + j]
    mu = lane_friction(lanes, j, x, g)
    n = eq.normal_acceleration(x, tan_theta, g)
    slope = 1.0 - tan_theta * (mu_s - tan_theta - mu) - n * mu * lanes[DECAY_RATE + j] / g
    return eq.block_acceleration(x, mu, mu_s, tan_theta, g), slope


@scalar
def lane_onset(count: int, way: int, g: float, lanes: np.ndarray) -> None:
    """t1: where each lane begins to slide (ψ in _START) and the value it then holds (_LEVEL)."""
    for j in range(count):
        lanes[_CONVERGED + j] = 1.0
        lanes[_LEVEL + j], lanes[_START + j] = lanes[YIELD + j], lanes[BEGAN + j]
    if way != _STICKS:
        return
    # D = 0, from the left, where a concave D converges, slowly where it starts flat
    for _ in range(_STICKS_ITERATIONS):
        for j in range(count):
            x = lanes[_LEVEL + j]
            asked, slope = lane_response_and_slope(lanes, j, x, g)
            step = (asked - x) / (1.0 - slope)
            lanes[_LEVEL + j] = x + step
            lanes[_CONVERGED + j] = 1.0 if abs(step) <= _LANE_TOLERANCE * x else 0.0
    for j in range(count):
        lanes[_START + j] = -inverse_versine((lanes[AMPLITUDE + j] - lanes[_LEVEL + j]) / lanes[AMPLITUDE + j])


@scalar
def lane_rise(count: int, way: int, g: float, lanes: np.ndarray) -> None:
    """From t1 to the peak: b in _HELD, V and W gained from rest in _V and _W."""
    for j in range(count):
        lanes[_X + j], lanes[_HELD + j] = lanes[AMPLITUDE + j], lanes[_LEVEL + j]
    if way != _YIELD_GOVERNS:
        for j in range(count):
            lanes[_HELD + j] = max(lane_response(lanes, j, lanes[AMPLITUDE + j], g), lanes[_LEVEL + j])
        # the switch from the hold to Eq. 4: E = b, from the right, where a convex E converges
        for _ in range(_STICKS_ITERATIONS if way == _STICKS else _LANE_ITERATIONS):
            for j in range(count):
                x = lanes[_X + j]
                asked, slope = lane_response_and_slope(lanes, j, x, g)
                step = (asked - lanes[_LEVEL + j]) / slope
                follows = lanes[_HELD + j] > lanes[_LEVEL + j]
                lanes[_X + j] = x - step if follows else x
                lanes[_PSI + j] = 1.0 if (abs(step) <= _LANE_TOLERANCE * x) | (not follows) else 0.0
        for j in range(count):
            lanes[_CONVERGED + j] = min(lanes[_CONVERGED + j], lanes[_PSI + j])
    # the hold
    for j in range(count):
        amplitude, x = lanes[AMPLITUDE + j], lanes[_X + j]
        # no earlier than the start, from which it may differ by the roundings of two roots
        psi = max(-inverse_versine((amplitude - x) / amplitude), lanes[_START + j])
        lanes[_PSI + j] = psi
        lanes[_V + j], lanes[_W + j] = held_motion(amplitude, lanes[_LEVEL + j], lanes[_START + j], psi)
        lanes[_RATE + j] = lanes[_MOMENT + j] = 0.0
    if way == _YIELD_GOVERNS:
        return
    # Eq. 4
    for node in range(_LANE_NODES.size):
        left, weight = 1.0 - _LANE_NODES[node], _LANE_WEIGHTS[node]
        for j in range(count):
            x = lanes[AMPLITUDE + j] * (1.0 - versine(lanes[_PSI + j] * left))
            weighted = weight * (x - lane_response(lanes, j, x, g))
            lanes[_RATE + j] += weighted
            lanes[_MOMENT + j] += left * weighted
    for j in range(count):
        width = -lanes[_PSI + j]
        lanes[_W + j] += (lanes[_V + j] + lanes[_MOMENT + j] * width) * width
        lanes[_V + j] += lanes[_RATE + j] * width


@scalar
def lane_fall(count: int, lanes: np.ndarray) -> None:
    """The hold from the peak to the stop or to Üg = 0 (t5): V left in _LEFT, the largest V in _PEAK."""
    for j in range(count):
        # V is largest where x = b; a parabola from there overestimates the stop
        amplitude, held, velocity = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_V + j]
        top = inverse_versine((amplitude - held) / amplitude)
        lanes[_PEAK + j] = velocity + held_motion(amplitude, held, 0.0, top)[0]
        lanes[_LEFT + j] = velocity + held_motion(amplitude, held, 0.0, _HALF_PI)[0]
        onward = math.sqrt(2.0 * lanes[_PEAK + j] / (amplitude * (top - angle_minus_sine(top))))
        lanes[_PSI + j] = min(top + onward, _HALF_PI)
    for iteration in range(_LANE_ITERATIONS):
        for j in range(count):
            amplitude, held, psi = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_PSI + j]
            over = lanes[_V + j] + held_motion(amplitude, held, 0.0, psi)[0]
            step = over / (amplitude - held - amplitude * versine(psi))
            lanes[_PSI + j] = min(max(psi - step, 0.0), _HALF_PI)
            settled = (abs(step) <= _LANE_TOLERANCE * psi) | (lanes[_LEFT + j] > 0.0)
            lanes[_CONVERGED + j] = lanes[_CONVERGED + j] if settled | (iteration < _LANE_ITERATIONS - 1) else 0.0
    for j in range(count):
        amplitude, held, left = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_LEFT + j]
        end = _HALF_PI if left > 0.0 else lanes[_PSI + j]
        lanes[_W + j] += lanes[_V + j] * end + held_motion(amplitude, held, 0.0, end)[1]
        lanes[_LEFT + j] = max(left, 0.0)


@scalar
def lane_attenuation(count: int, way: int, cycles: int, lanes: np.ndarray) -> None:
    """Eq. 12, and all cycles: W in _W, the largest V in _PEAK.

    Where a block still slides at the next Üg = Üy, Eq. 4 and the hold act on it as in the
    pulse before, so that each cycle adds the same velocity v: an arithmetic series.
    """
    for j in range(count):
        held, left, moved = lanes[_HELD + j], lanes[_LEFT + j], lanes[_W + j]
        duration = 1.5 * math.pi + lanes[BEGAN + j]  # from Üg = 0 to the next Üg = Üy
        carried = max(left - held * duration, 0.0)
        braked = 0.5 * (left - carried) * (left + carried) / held
        later = cycles - 1.0
        last = moved + later * carried * (_HALF_PI - lanes[BEGAN + j]) + 0.5 * (left + later * carried) ** 2 / held
        lanes[_W + j] = later * (moved + braked + math.pi * carried * (later - 1.0)) + last
        lanes[_PEAK + j] += later * carried
        still = (carried > 0.0) & (cycles > 1)
        lanes[_CODE + j] = NOT_RECOUPLED if still else 0
        # what sticks at Üg = Üy when at rest does not when it slides: its pulses differ
        lanes[_CONVERGED + j] = 0.0 if still & (way == _STICKS) else lanes[_CONVERGED + j]


@scalar
def lane_recoupling(count: int, cycles: int, lanes: np.ndarray) -> None:
    """From Üg = 0 on by integration, χ = φ − π to the stop, which comes before 2π for b ≥ Üy; and all cycles."""
    for j in range(count):
        # vers χ ≥ 2 χ²/π²: this start lies beyond the stop
        b, left = lanes[_HELD + j], lanes[_LEFT + j]
        curvature = 4.0 * lanes[AMPLITUDE + j] / (math.pi * math.pi)
        lanes[_PSI + j] = min(2.0 * left / (b + math.sqrt(b * b + 2.0 * curvature * left)), math.pi)
    for iteration in range(_LANE_ITERATIONS):
        for j in range(count):
            amplitude, b, chi = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_PSI + j]
            half_sine, half_cosine = 0.5 * chi - angle_minus_sine(0.5 * chi), 1.0 - versine(0.5 * chi)
            over = lanes[_LEFT + j] - b * chi - 2.0 * amplitude * half_sine * half_sine
            step = -over / (b + 2.0 * amplitude * half_sine * half_cosine)
            lanes[_PSI + j] = min(max(chi - step, 0.0), math.pi)
            settled = (abs(step) <= _LANE_TOLERANCE * chi) | (iteration < _LANE_ITERATIONS - 1)
            lanes[_CONVERGED + j] = lanes[_CONVERGED + j] if settled else 0.0
    for j in range(count):
        amplitude, b, chi = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_PSI + j]
        sine = 2.0 * (0.5 * chi - angle_minus_sine(0.5 * chi)) * (1.0 - versine(0.5 * chi))
        lanes[_W + j] += (lanes[_LEFT + j] - 0.5 * b * chi) * chi - amplitude * (chi - sine)
        lanes[_W + j] *= cycles
        lanes[_CODE + j] = 0.0


@scalar
def lane_continuous(count: int, options: Options, lanes: np.ndarray) -> None:
    """Continuous sliding, all cycles: W in row _W."""
    g = options.g
    for j in range(count):
        # the whole quarter: D in _V, a quarter of the drift in _X; up to Üg = Üy: _RATE, _MOMENT
        lanes[_V + j] = lanes[_X + j] = lanes[_RATE + j] = lanes[_MOMENT + j] = 0.0
    for node in range(_LANE_NODES.size):
        weight, sine = _LANE_WEIGHTS[node], _LANE_SINES[node]
        for j in range(count):
            mu_s, tan_theta, x = lanes[MU_S + j], lanes[TAN_THETA + j], lanes[AMPLITUDE + j] * sine
            mu = lane_friction(lanes, j, x, g)
            lanes[_V + j] += weight * (x - eq.block_acceleration(x, mu, mu_s, tan_theta, g))
            lanes[_X + j] += weight * x * (mu_s - tan_theta - mu)
    for node in range(_SHORT_NODES.size):
        at, left, weight = _SHORT_NODES[node], 1.0 - _SHORT_NODES[node], _SHORT_WEIGHTS[node]
        for j in range(count):
            # sin φ on the way from Üg = 0 to Üg = Üy
            phi = (_HALF_PI + lanes[BEGAN + j]) * at
            x = lanes[AMPLITUDE + j] * (phi - angle_minus_sine(phi))
            weighted = weight * (x - lane_response(lanes, j, x, g))
            lanes[_RATE + j] += weighted
            lanes[_MOMENT + j] += left * weighted
    for j in range(count):
        began = lanes[BEGAN + j]
        width = _HALF_PI + began
        lanes[_W + j] = continuous_displacement(
            _HALF_PI * lanes[_V + j],
            lanes[_RATE + j] * width,
            lanes[_MOMENT + j] * width * width,
            4.0 * lanes[TAN_THETA + j] * _HALF_PI * lanes[_X + j],
            began,
            options.cycles,
        )
        lanes[_PEAK + j], lanes[_CODE + j], lanes[_CONVERGED + j] = math.nan, 0.0, 1.0


@scalar
def solve_lanes(count: int, way: int, options: Options, lanes: np.ndarray) -> None:
    """Lanes that all go one way, from the onset to the end of all cycles."""
    if way == _CONTINUOUS:
        lane_continuous(count, options, lanes)
        return
    lane_onset(count, way, options.g, lanes)
    lane_rise(count, way, options.g, lanes)
    lane_fall(count, lanes)
    if options.recoupling == INTEGRATE:
        lane_recoupling(count, options.cycles, lanes)
    else:
        lane_attenuation(count, way, options.cycles, lanes)


@scalar
def sort_cells(cells: np.ndarray, count: int, options: Options, blocks: np.ndarray) -> None:
    """Blocks of a tile in lanes, with their codes and the way each goes."""
    for j in range(count):
        block = block_of(cell_of(cells, j), options.rise, options.g)
        lane_of(block, blocks, j)
        blocks[_MODE + j], blocks[_VALIDITY + j] = block.sliding_mode, block.validity
        at_start = lane_response(blocks, j, block.yield_acceleration, options.g)
        at_end = lane_response(blocks, j, block.amplitude, options.g)
        blocks[_WAY + j] = way_of(block, options, at_start, at_end)


@scalar
def fill_lanes(blocks: np.ndarray, count: int, way: int, lanes: np.ndarray, where: np.ndarray) -> int:
    """Lay out the blocks that go one way; the number of them.  Lanes to the next multiple repeat the first."""
    used = 0
    for j in range(count):
        if blocks[_WAY + j] == way:
            where[used] = j
            used += 1
    for row in range(LANE_ROWS):
        for lane in range(used):
            lanes[row * TILE + lane] = blocks[row * TILE + where[lane]]
        for lane in range(used, whole_lanes(used)):
            lanes[row * TILE + lane] = lanes[row * TILE]
    return used


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, table: np.ndarray, motion: np.ndarray, codes: np.ndarray
) -> None:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity."""
    blocks, lanes, where = np.empty(_BLOCKS_SIZE), np.empty(_LANES_SIZE), np.empty(TILE, np.int64)
    for row in range(7):
        for j in range(count, whole_lanes(count)):
            cells[row * TILE + j] = cells[row * TILE]
    sort_cells(cells, whole_lanes(count), options, blocks)
    for j in range(count):
        codes[0, j], codes[1, j] = int(blocks[_MODE + j]), int(blocks[_VALIDITY + j])
        motion[0, j] = motion[1, j] = 0.0 if codes[0, j] == STUCK else math.nan
    for way in (_YIELD_GOVERNS, _FOLLOWS, _STICKS, _CONTINUOUS):
        used = fill_lanes(blocks, count, way, lanes, where)
        if used == 0:
            continue
        solve_lanes(whole_lanes(used), way, options, lanes)
        for lane in range(used):
            j = where[lane]
            if lanes[_CONVERGED + lane] > 0.0:
                motion[0, j], motion[1, j] = lanes[_W + lane], lanes[_PEAK + lane]
                codes[1, j] |= int(lanes[_CODE + lane]) | (EQ4_BELOW_YIELD if way == _YIELD_GOVERNS else 0)
            else:
                blocks[_WAY + j] = _OTHER
    for j in range(count):
        if blocks[_WAY + j] == _OTHER and codes[0, j] > STUCK:
            answer = solve(block_at(cells, j, options), options, table)
            motion[0, j], motion[1, j] = answer.displacement, answer.peak_velocity
            codes[1, j] |= answer.validity
            if answer.validity & NO_VALUE:
                codes[0, j] = -1
