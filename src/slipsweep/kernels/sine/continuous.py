"""Continuous sliding under a sine: Eq. 4 throughout, from integrals over one quarter of the cycle.

|Üg| and the friction repeat every quarter, mirrored, so that a quarter gives a cycle, and the cycles an
arithmetic series.  Most cells are solved in SIMD lanes (`lane_continuous`), those whose friction decays
sharply, or whose velocity turns more than once on a rise, one by one (`continuous`).  Derivations:
docs/numerics.md#continuous-sliding.
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar, summed
from slipsweep.jit.elementary import sine_after, versine
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    DECAY,
    DELTA_MU,
    MU_S,
    TAN_THETA,
    Block,
    Motion,
    Options,
    friction,
    lane_loss,
    lane_rate_and_slope,
    lane_slant,
    opposite,
    phase,
    relative_acceleration,
    relative_acceleration_root,
)
from slipsweep.kernels.cycle.continuous import continuous as continuous_of_any_wave
from slipsweep.kernels.cycle.eq4 import PANEL_BOUNDS
from slipsweep.kernels.cycle.legs import MOST_LEGS, Room, inside, next_break
from slipsweep.kernels.events import STRIP
from slipsweep.kernels.sine.lanes import (
    CARRIED,
    CODE,
    CONVERGED,
    GAIN,
    HALF_PI,
    LANE_NODES,
    LANE_WEIGHTS,
    MOMENT,
    MOVED,
    PEAK,
    PSI,
    RATE,
    SHORT_NODES,
    SHORT_WEIGHTS,
    TURNS_LATE,
    V,
    W,
    X,
)
from slipsweep.kernels.sine.roots import TURN, settle
from slipsweep.kernels.sine.shapes import phase_of, quarter_integrals, risen, risen_integrals
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import NODES, WEIGHTS, Wave

#: On the first 0.6 radians of the cycle 8 nodes are wrong by 4e-14 of that part at most.
SHORT_SINE = math.sin(0.6)

#: Rows of lanes that pulses have for something else: what V misses before Üg = Üy, and what it gains from
#: Üg = 0 up to where its rate changes sign on the rise of the positive half cycle.
_MISSED, DIP = CARRIED, MOVED


@summed
def eq4_integrals(block: Block, start: float, end: float, side: float) -> tuple[float, float]:
    """∫ D dψ and ∫ (end − ψ) D dψ over a part of a rising quarter: gains of V and W from rest.

    `side` is 1 for the positive half cycle and −1 for the negative one.
    """
    amplitude = side * block.amplitude
    x_start = amplitude * (1.0 - versine(start))
    decay = block.decay_rate / block.g
    e_foldings = decay * abs(amplitude * (1.0 - versine(end)) - x_start)
    first, second = 0.0, 0.0
    left = start
    for bound in PANEL_BOUNDS:
        right = end if e_foldings <= bound else phase(block, abs(x_start) + bound / decay)
        width = right - left
        rate, moment = 0.0, 0.0
        for node in range(NODES.size):
            weighted = WEIGHTS[node] * relative_acceleration(block, amplitude * sine_after(left, width * NODES[node]))
            rate += weighted
            moment += (1.0 - NODES[node]) * weighted
        second += (first + moment * width) * width
        first += rate * width
        left = right
        if e_foldings <= bound:
            break
    return first, second


@scalar
def continuous_peaks(block: Block, side: float, half_gain: float, after: float) -> tuple[float, float]:
    """Largest V in a half cycle entered with V = 0, where the plane has passed `after` on its rise, and from Üg = 0.

    V peaks where its rate D changes sign; the falling quarter mirrors the rising one, over
    which and back V gains `half_gain`.
    """
    late, whole = half_gain, max(0.0, half_gain)
    x, end = 0.0, side * block.amplitude
    for _ in range(MOST_LEGS):
        target = next_break(block, x, end)
        inner = inside(x, target)
        if opposite(relative_acceleration(block, inner), relative_acceleration(block, target)):
            zero = abs(relative_acceleration_root(block, inner, target))
            gained = eq4_integrals(block, -HALF_PI, phase(block, zero), side)[0]
            late, whole = max(half_gain - gained, late), max(max(gained, half_gain - gained), whole)
            if zero > after:
                late = max(gained, late)
        x = target
        if x == end:
            break
    return late, whole


@in_lanes
def continuous_displacement(
    up: float, missed: float, missed_moment: float, drift: float, began: float, cycles: int
) -> float:
    """W of all cycles, from integrals over the rising quarter of the positive half cycle.

    `up` is ∫ D over the quarter, `missed` and `missed_moment` the integrals of D (as
    `eq4_integrals`) up to ψ = `began`, where sliding starts, and `drift` the gain of V
    over a cycle.
    """
    down = 0.5 * drift - up  # ∫ D over a quarter of the negative half cycle
    # to the peak W misses what D would have given before Üg = Üy; the other quarters are whole
    displacement = began * missed - missed_moment + HALF_PI * (2.0 * up - missed) + math.pi * (2.0 * up - missed + down)
    later = cycles - 1.0
    return displacement + later * math.pi * (2.0 * (drift - missed) + 3.0 * up + down + drift * (later - 1.0))


@in_lanes
def continuous_peak(missed: float, drift: float, first: float, positive: float, negative: float, cycles: int) -> float:
    """Largest V of all cycles, from the largest of half cycles entered with V = 0.

    `first` is that of the first half cycle from Üg = Üy on, before which V misses `missed`; `positive` and
    `negative` are those of whole ones, the latter with the V that the positive one before it has left.
    """
    peak = max(0.0, max(first, negative) - missed)
    again = drift - missed + max(positive, negative) + max(0.0, (cycles - 2.0) * drift)
    return max(peak, again) if cycles > 1 else peak


@scalar
def continuous(block: Block, options: Options, wave: Wave, room: Room) -> Motion:
    """Continuous sliding from the first Üg = Üy on: Eq. 4 throughout.  Takes what `continuous_of_any_wave` does.

    |Üg| and the friction repeat every quarter cycle, mirrored, so that integrals over a
    quarter give a cycle, and the cycles an arithmetic series.
    """
    began = phase(block, block.yield_acceleration)
    missed, missed_moment = eq4_integrals(block, -HALF_PI, began, 1.0)
    up = missed + eq4_integrals(block, began, 0.0, 1.0)[0]
    drift = drift_integral(block)
    displacement = continuous_displacement(up, missed, missed_moment, drift, began, options.cycles)
    peak = math.nan
    if options.wants_peak:
        first, positive = continuous_peaks(block, 1.0, 2.0 * up, block.yield_acceleration)
        negative = 2.0 * up + continuous_peaks(block, -1.0, drift - 2.0 * up, 0.0)[1]
        peak = continuous_peak(missed, drift, first, positive, negative, options.cycles)
    if options.wants_peak and math.isnan(peak):  # an event was not found
        return continuous_of_any_wave(block, options, wave, room)
    # no event enters the displacement: it is no number only where sums overflow
    return Motion(math.inf if math.isnan(displacement) else displacement, peak, 0)


@summed
def drift_integral(block: Block) -> float:
    """Gain of V over a whole cycle, four times that of Eq. 4's `drift` over a quarter.

    The sum of the two half cycles with g cancelled by hand: over 10⁶ cycles the rounding
    of that cancellation would show.
    """
    decay = block.decay_rate / block.g
    e_foldings = decay * block.amplitude
    total = 0.0
    left = -HALF_PI
    for bound in PANEL_BOUNDS:
        right = 0.0 if e_foldings <= bound else phase(block, bound / decay)
        width = right - left
        part = 0.0
        for node in range(NODES.size):
            x = block.amplitude * sine_after(left, width * NODES[node])
            part += WEIGHTS[node] * eq.drift(x, friction(block, x), block.mu_s, block.tan_theta)
        total += part * width
        left = right
        if e_foldings <= bound:
            break
    return 4.0 * total


@in_lanes
def lane_turn_start(lanes: np.ndarray, j: int) -> float:
    """From where Newton goes to D = 0: nearly where μ = μs, after ln(1 + r) e-foldings, r = Δμ/μs, by 2r/(2 + r)."""
    delta_mu = lanes[DELTA_MU + j]
    return 2.0 * delta_mu / ((2.0 * lanes[MU_S + j] + delta_mu) * lanes[DECAY + j])


@scalar
def lane_turns(kind: int, shape: int, g: float, lanes: np.ndarray) -> None:
    """What the peak velocity needs of both half cycles: rows DIP and X.

    DIP is ∫ D dψ on the rise of the positive one, from Üg = 0 up to where D changes sign, 0 where it does not; X the
    largest V of a negative one entered with V = 0.  D is -side g Δμ at Üg = 0.  On the positive half it is concave (by
    `kind_of`), on the negative one convex (as long as the block does not lift off): it changes sign once at most.
    Where μ = μs it is −tan² θ |Üg|: before the zero on the positive half, behind it on the negative one, from where
    Newton passes it once, and not again.
    """
    late = kind == TURNS_LATE
    for side in (1.0, -1.0):
        for j in range(STRIP):
            lanes[DIP + j] = lanes[RATE + j]  # of the side before
            at_peak, slope = lane_rate_and_slope(lanes, j, side * lanes[AMPLITUDE + j], g)
            turns = side * at_peak > 0.0
            # one that has its first sign at the peak may have changed twice, unless it still goes away from it
            monotone = slope >= 0.0
            lanes[CONVERGED + j] = lanes[CONVERGED + j] if turns | monotone else 0.0
            lanes[PSI + j] = 0.0 if turns else 1.0
            lanes[X + j] = lane_turn_start(lanes, j) if turns else 0.0
        settle(TURN, shape, X, PSI, side, g, lanes)
        for j in range(STRIP):
            amplitude = lanes[AMPLITUDE + j]
            short = late | (lanes[X + j] <= SHORT_SINE * amplitude)
            lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[PSI + j]) if short else 0.0
            lanes[PSI + j] = HALF_PI + phase_of(shape, lanes[X + j], amplitude)
            lanes[RATE + j] = 0.0
        for node in range(LANE_NODES.size if late else SHORT_NODES.size):
            at = LANE_NODES[node] if late else SHORT_NODES[node]
            weight = LANE_WEIGHTS[node] if late else SHORT_WEIGHTS[node]
            for j in range(STRIP):
                phi = lanes[PSI + j] * at
                x = lanes[AMPLITUDE + j] * risen(shape, phi)
                lanes[RATE + j] += weight * lane_loss(lanes, j, side * x, g)
        for j in range(STRIP):
            phi, slant = lanes[PSI + j], lane_slant(lanes, j, lanes[AMPLITUDE + j])
            lanes[RATE + j] = side * lanes[RATE + j] * phi - slant * risen_integrals(shape, phi)[0]
    for j in range(STRIP):
        # as in `continuous_peaks`: the fall mirrors the rise
        bump, half_gain = lanes[RATE + j], lanes[GAIN + j] - 2.0 * lanes[V + j]
        lanes[X + j] = max(max(0.0, half_gain), max(bump, half_gain - bump))


@scalar
def lane_quarters(shape: int, g: float, lanes: np.ndarray) -> None:
    """∫ D dψ over the rise of the positive half cycle in V, over the whole cycle in GAIN."""
    for j in range(STRIP):
        amplitude, mu_s, tan_theta = lanes[AMPLITUDE + j], lanes[MU_S + j], lanes[TAN_THETA + j]
        most = mu_s + lanes[DELTA_MU + j]
        area, plain, with_wave = quarter_integrals(shape, lanes[DECAY + j] * amplitude)
        quarter = amplitude * tan_theta * ((mu_s - tan_theta) * area - most * with_wave)
        lanes[V + j], lanes[GAIN + j] = g * (HALF_PI * mu_s - most * plain) + quarter, 4.0 * quarter
        lanes[PEAK + j], lanes[CODE + j], lanes[CONVERGED + j] = math.nan, 0.0, 1.0


@scalar
def lane_continuous(kind: int, shape: int, options: Options, lanes: np.ndarray) -> None:
    """Continuous sliding, all cycles: W in row W, the largest V in PEAK."""
    g = options.g
    lane_quarters(shape, g, lanes)
    for j in range(STRIP):
        lanes[RATE + j] = lanes[MOMENT + j] = 0.0
    for node in range(SHORT_NODES.size):
        at, left, weight = SHORT_NODES[node], 1.0 - SHORT_NODES[node], SHORT_WEIGHTS[node]
        for j in range(STRIP):
            # the wave on the way from Üg = 0 to Üg = Üy
            phi = (HALF_PI + lanes[BEGAN + j]) * at
            x = lanes[AMPLITUDE + j] * risen(shape, phi)
            weighted = weight * lane_loss(lanes, j, x, g)
            lanes[RATE + j] += weighted
            lanes[MOMENT + j] += left * weighted
    for j in range(STRIP):
        began, drift = lanes[BEGAN + j], lanes[GAIN + j]
        width, slant = HALF_PI + began, lane_slant(lanes, j, lanes[AMPLITUDE + j])
        fell, fell_moment = risen_integrals(shape, width)
        missed = lanes[RATE + j] * width - slant * fell
        missed_moment = lanes[MOMENT + j] * width * width - slant * fell_moment
        lanes[W + j] = continuous_displacement(lanes[V + j], missed, missed_moment, drift, began, options.cycles)
        lanes[_MISSED + j] = missed
    if options.wants_peak:
        lane_turns(kind, shape, g, lanes)
        for j in range(STRIP):
            half, dip = 2.0 * lanes[V + j], lanes[DIP + j]
            first = max(half, half - dip)
            negative, positive = half + lanes[X + j], max(max(0.0, dip), first)
            missed, drift = lanes[_MISSED + j], lanes[GAIN + j]
            lanes[PEAK + j] = continuous_peak(missed, drift, first, positive, negative, options.cycles)
