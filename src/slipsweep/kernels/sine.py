"""The cycle solver's short way for the sine: the common cases in SIMD lanes.

Nearly all cells go the same way: they slide from Üg = Üy, hold the yield value, perhaps
follow Eq. 4 to the peak, hold again and stop before the next pulse; or they slide
continuously with a friction that decays gently.  The functions below are that way, phase by
phase, for many cells at a time, in loops that LLVM turns into SIMD (Newton with a fixed
number of iterations, quadrature nodes outside, cells inside).  A cell whose iteration has
not converged, or that goes another way, is left to `cycle`, which solves any waveform; in continuous
sliding it is solved here, by symmetry from one quarter of the cycle (`continuous`).
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep import equations as eq
from slipsweep.elementary import angle_minus_sine, half_square_minus_versine, rising_phase, sine_after, versine
from slipsweep.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    DECAY,
    DELTA_MU,
    EQ4_BELOW_YIELD,
    EVENT_TOLERANCE,
    INTEGRATE,
    LANE_ROWS,
    MONOTONE,
    MU_S,
    NEWMARK,
    NOT_RECOUPLED,
    STRIP,
    TAN_THETA,
    TILE,
    YIELD,
    Block,
    Motion,
    Options,
    block_at,
    cell_of,
    decay_rate_of,
    friction,
    interface_of,
    lane_friction,
    lane_response,
    lane_slip,
    opposite,
    phase,
    slip,
    slip_root,
    whole_lanes,
)
from slipsweep.kernels.cycle import (
    MOST_LEGS,
    NODES,
    PANEL_BOUNDS,
    SLIVER,
    WEIGHTS,
    answer,
    next_break,
)
from slipsweep.kernels.jit import in_lanes, scalar, summed

_HALF_PI = 0.5 * math.pi

#: Rows of the lanes beside the block's.
_X, _LEVEL, _START, _V, _W, _HELD, _RATE, _MOMENT, _PSI, _LEFT, _PEAK, _CONVERGED, _CODE = range(
    LANE_ROWS * TILE, (LANE_ROWS + 13) * TILE, TILE
)
#: What a first pulse leaves to the pulses after it: V carried on, W up to then, W if it were the
#: last, t1 and the largest V; and, of a pulse
#: entered in motion, whether a hold brings it through, V as that is slowest, V and W at the peak, what V
#: gains, and how many such pulses follow each other.
_CARRIED, _MOVED, _LAST, _ONSET, _HIGHEST, _THROUGH, _SLOWEST, _AT_PEAK, _TO_PEAK, _GAIN, _MOST = range(
    (LANE_ROWS + 13) * TILE, (LANE_ROWS + 24) * TILE, TILE
)
LANES_SIZE = (LANE_ROWS + 24) * TILE
#: The same rows in continuous sliding: what V misses before Üg = Üy, and what it gains from Üg = 0 up to where
#: its rate changes sign on the rise of the positive half cycle.
_MISSED, _DIP = _CARRIED, _MOVED

#: Rows of a tile's blocks beside the lanes': the codes, the way a cell goes, μmin, and E at Üg = Üy and at the peak.
_MODE, _VALIDITY, _WAY, _LEAST_FRICTION, _AT_START, _AT_END = range(LANE_ROWS * TILE, (LANE_ROWS + 6) * TILE, TILE)
BLOCKS_SIZE = (LANE_ROWS + 6) * TILE


class Room(NamedTuple):
    """Where the cells of a tile are worked on.

    One for all tiles: a function that makes no array need not count references to any, a nanosecond a cell.
    `runs` has the cells at which runs of one way start, `where` the cells of the lanes, and `left` is true
    for cells that are to go from event to event.
    """

    blocks: np.ndarray
    lanes: np.ndarray
    runs: np.ndarray
    where: np.ndarray
    left: np.ndarray


#: The ways a cell can go: not at all, stuck or without a value; held at the yield value to the peak;
#: held, then by Eq. 4; stuck at Üg = Üy until Eq. 4 falls below Üg; sliding continuously; any other,
#: event by event.
_STAYS, _YIELD_GOVERNS, _FOLLOWS, _STICKS, _CONTINUOUS, _OTHER = range(6)

#: 12 nodes reach 1e-14 where friction falls by no more than e^6 (at 8 e-foldings, 2e-14).
_LANE_NODES, _LANE_WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(12), (1.0, 0.0), strict=True))
_LANE_E_FOLDINGS = 6.0

#: Before Üg = Üy, on the first 0.6 radians of the cycle at most, 8 nodes reach 1e-14.
_SHORT_NODES, _SHORT_WEIGHTS = (
    (a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(8), (1.0, 0.0), strict=True)
)
_SHORT_SINE = math.sin(0.6)

#: Coefficients, highest first, of ∫ e^(−k sin φ) dφ over [0, π/2] in powers of 4 − k: integrals of
#: sinⁿ e^(−4 sin) / n!, all positive, on 8 panels of 8 nodes (more on fewer panels have weights that
#: are wrong by 3e-15).  31 terms give 4e-16 for k from 0 to 6; about 4, no digits cancel where k is large.
_CENTRE = 4.0
_PANEL_WIDTH = _HALF_PI / 8
_SINES = np.sin(_PANEL_WIDTH * (np.arange(8)[:, np.newaxis] + _SHORT_NODES))
_WEIGHTED = _PANEL_WIDTH * _SHORT_WEIGHTS * np.exp(-_CENTRE * _SINES)
_QUARTER_SERIES = np.array([np.sum(_WEIGHTED * _SINES**n) / math.factorial(n) for n in range(30, -1, -1)])

#: Relative size of a Newton step that is the last (the error left is its square, and enters the
#: result squared again).  A lane that has taken it stays where it is, whatever its neighbours do.
_LANE_TOLERANCE = 1e-7
_MOST_ITERATIONS = 16

#: Cells that stop anew in every pulse are followed that far; `train` finds where more of them repeat.
_MOST_PULSES = 64


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
    for bound in PANEL_BOUNDS:
        right = end if e_foldings <= bound else phase(block, abs(x_start) + bound / decay)
        width = right - left
        rate, moment = 0.0, 0.0
        for node in range(NODES.size):
            weighted = WEIGHTS[node] * slip(block, amplitude * sine_after(left, width * NODES[node]))
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
        inner = x + SLIVER * (target - x)
        if opposite(slip(block, inner), slip(block, target)):
            zero = abs(slip_root(block, 0.0, inner, target))
            gained = slip_integrals(block, -_HALF_PI, phase(block, zero), side)[0]
            late, whole = max(late, half_gain - gained), max(whole, max(gained, half_gain - gained))
            if zero > after:
                late = max(late, gained)
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
        first, positive = continuous_peaks(block, 1.0, 2.0 * up, block.yield_acceleration)
        negative = 2.0 * up + continuous_peaks(block, -1.0, drift - 2.0 * up, 0.0)[1]
        peak = continuous_peak(missed, drift, first, positive, negative, cycles)
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
    for bound in PANEL_BOUNDS:
        right = 0.0 if e_foldings <= bound else phase(block, bound / decay)
        width = right - left
        part = 0.0
        for node in range(NODES.size):
            x = block.amplitude * sine_after(left, width * NODES[node])
            part += WEIGHTS[node] * drift_rate(block, x)
        total += part * width
        left = right
        if e_foldings <= bound:
            break
    return 4.0 * total


@in_lanes
def way_of(blocks: np.ndarray, j: int, options: Options) -> int:
    """Which way a cell goes."""
    at_start, at_end, mode = blocks[_AT_START + j], blocks[_AT_END + j], blocks[_MODE + j]
    decay = blocks[DECAY + j]
    start, end = blocks[YIELD + j], blocks[AMPLITUDE + j]
    gentle = decay * end <= _LANE_E_FOLDINGS
    # either E is convex, hence D concave, and as D > 0 at the peak it stays positive once it is;
    # or 0 < dE/dx < 1, by bounds with the largest friction and normal acceleration
    tan_theta, mu_s = blocks[TAN_THETA + j], blocks[MU_S + j]
    most = mu_s + blocks[DELTA_MU + j]
    convex = decay * options.g >= 2.0 * tan_theta
    rises = most * (decay * (options.g + end * tan_theta) - tan_theta) < eq.limit_denominator(mu_s, tan_theta)
    lags = most * (tan_theta - decay * options.g) <= tan_theta * (mu_s - tan_theta)
    smooth = (options.rise == MONOTONE) & (at_end < end) & (convex | (rises & lags))
    sticks_or_follows = _STICKS if at_start >= start else _FOLLOWS
    way = sticks_or_follows if gentle else _OTHER
    way = _YIELD_GOVERNS if (at_start < start) & (at_end <= start) else way
    way = way if smooth else _OTHER
    way = _YIELD_GOVERNS if options.rise == NEWMARK else way
    way = way if mode == STICK_SLIP else _OTHER
    # where the peak velocity is wanted, D has to be concave (`lane_turn`)
    early = gentle & (start <= _SHORT_SINE * end) & (convex | (not options.wants_peak))
    way = _CONTINUOUS if (mode == CONTINUOUS) & early else way
    return way if mode > STUCK else _STAYS


@in_lanes
def lane_response_and_slope(lanes: np.ndarray, j: int, x: float, g: float) -> tuple[float, float]:
    """E and dE/dx of a lane (x > 0)."""
    tan_theta, mu_s = lanes[TAN_THETA + j], lanes[MU_S + j]
    mu = lane_friction(lanes, j, x)
    n = eq.normal_acceleration(x, tan_theta, g)
    slope = 1.0 - tan_theta * (mu_s - tan_theta - mu) - n * mu * lanes[DECAY + j]
    return x - eq.lag(x, mu, mu_s, tan_theta, g), slope


@scalar
def lane_onset(way: int, g: float, lanes: np.ndarray) -> None:
    """t1: where each lane begins to slide (ψ in _START) and the value it then holds (_LEVEL)."""
    for j in range(STRIP):
        lanes[_CONVERGED + j] = 1.0
        lanes[_LEVEL + j], lanes[_START + j] = lanes[YIELD + j], lanes[BEGAN + j]
    if way != _STICKS:
        return
    for j in range(STRIP):
        lanes[_CONVERGED + j] = 0.0
    # D = 0, from the left, where a concave D converges, slowly where it starts flat
    for _ in range(_MOST_ITERATIONS):
        unsettled = 0
        for j in range(STRIP):
            x = lanes[_LEVEL + j]
            asked, slope = lane_response_and_slope(lanes, j, x, g)
            step = (asked - x) / (1.0 - slope)
            settled = lanes[_CONVERGED + j] > 0.0
            lanes[_LEVEL + j] = x if settled else x + step
            settled |= abs(step) <= _LANE_TOLERANCE * min(x, lanes[AMPLITUDE + j] - x)
            lanes[_CONVERGED + j] = 1.0 if settled else 0.0
            unsettled += 0 if settled else 1
        if unsettled == 0:
            break
    for j in range(STRIP):
        lanes[_START + j] = rising_phase(lanes[_LEVEL + j], lanes[AMPLITUDE + j])


@scalar
def lane_switch(g: float, lanes: np.ndarray) -> None:
    """x at which each lane ceases to hold its level and follows Eq. 4 (_X), and b at the peak (_HELD)."""
    for j in range(STRIP):
        amplitude, level = lanes[AMPLITUDE + j], lanes[_LEVEL + j]
        asked, slope = lane_response_and_slope(lanes, j, amplitude, g)
        follows = asked > level
        lanes[_HELD + j] = asked if follows else level
        lanes[_X + j] = amplitude - (asked - level) / slope if follows else amplitude
        lanes[_PSI + j] = 0.0 if follows else 1.0
    # E = b, from the right, where a convex E converges
    for _ in range(_MOST_ITERATIONS):
        unsettled = 0
        for j in range(STRIP):
            x = lanes[_X + j]
            asked, slope = lane_response_and_slope(lanes, j, x, g)
            step = (asked - lanes[_LEVEL + j]) / slope
            settled = lanes[_PSI + j] > 0.0
            lanes[_X + j] = x if settled else x - step
            settled |= abs(step) <= _LANE_TOLERANCE * min(x, lanes[AMPLITUDE + j] - x)
            lanes[_PSI + j] = 1.0 if settled else 0.0
            unsettled += 0 if settled else 1
        if unsettled == 0:
            break
    for j in range(STRIP):
        lanes[_CONVERGED + j] = min(lanes[_CONVERGED + j], lanes[_PSI + j])


@scalar
def lane_rise(way: int, g: float, lanes: np.ndarray) -> None:
    """From t1 to the peak: b in _HELD, V and W gained from rest in _V and _W."""
    if way == _YIELD_GOVERNS:
        for j in range(STRIP):
            lanes[_X + j], lanes[_HELD + j] = lanes[AMPLITUDE + j], lanes[_LEVEL + j]
            lanes[_V + j], lanes[_W + j] = held_motion(lanes[AMPLITUDE + j], lanes[_LEVEL + j], lanes[_START + j], 0.0)
        return
    lane_switch(g, lanes)
    # the hold
    for j in range(STRIP):
        amplitude = lanes[AMPLITUDE + j]
        # no earlier than the start, from which it may differ by the roundings of two roots
        psi = max(rising_phase(lanes[_X + j], amplitude), lanes[_START + j])
        lanes[_PSI + j] = psi
        lanes[_V + j], lanes[_W + j] = held_motion(amplitude, lanes[_LEVEL + j], lanes[_START + j], psi)
        lanes[_RATE + j] = lanes[_MOMENT + j] = 0.0
    # Eq. 4
    for node in range(_LANE_NODES.size):
        left, weight = 1.0 - _LANE_NODES[node], _LANE_WEIGHTS[node]
        for j in range(STRIP):
            x = lanes[AMPLITUDE + j] * (1.0 - versine(lanes[_PSI + j] * left))
            weighted = weight * lane_slip(lanes, j, x, g)
            lanes[_RATE + j] += weighted
            lanes[_MOMENT + j] += left * weighted
    for j in range(STRIP):
        width = -lanes[_PSI + j]
        lanes[_W + j] += (lanes[_V + j] + lanes[_MOMENT + j] * width) * width
        lanes[_V + j] += lanes[_RATE + j] * width


@scalar
def lane_fall(wants_peak: bool, lanes: np.ndarray) -> None:
    """The hold from the peak to the stop or to Üg = 0 (t5): V left in _LEFT, if wanted the largest V in _PEAK."""
    unsettled = 0
    for j in range(STRIP):
        left = lanes[_V + j] + held_motion(lanes[AMPLITUDE + j], lanes[_HELD + j], 0.0, _HALF_PI)[0]
        lanes[_LEFT + j] = max(left, 0.0)
        lanes[_PSI + j] = _HALF_PI
        lanes[_PEAK + j] = math.nan
        unsettled += 0 if left > 0.0 else 1
    if wants_peak or unsettled > 0:
        for j in range(STRIP):
            # V is largest where x = b; a parabola from there overestimates the stop
            amplitude, held, velocity = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_V + j]
            top = -rising_phase(held, amplitude)
            peak = velocity + held_motion(amplitude, held, 0.0, top)[0]
            onward = math.sqrt(2.0 * peak / (amplitude * (top - angle_minus_sine(top))))
            lanes[_PSI + j] = _HALF_PI if lanes[_LEFT + j] > 0.0 else min(top + onward, _HALF_PI)
            lanes[_PEAK + j] = peak if wants_peak else math.nan
            lanes[_X + j] = 1.0 if lanes[_LEFT + j] > 0.0 else 0.0
        for _ in range(_MOST_ITERATIONS):
            if unsettled == 0:
                break
            unsettled = 0
            for j in range(STRIP):
                amplitude, held, psi = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_PSI + j]
                over = lanes[_V + j] + held_motion(amplitude, held, 0.0, psi)[0]
                step = over / (amplitude - held - amplitude * versine(psi))
                settled = lanes[_X + j] > 0.0
                lanes[_PSI + j] = psi if settled else min(max(psi - step, 0.0), _HALF_PI)
                settled |= abs(step) <= _LANE_TOLERANCE * psi
                lanes[_X + j] = 1.0 if settled else 0.0
                unsettled += 0 if settled else 1
        for j in range(STRIP):
            lanes[_CONVERGED + j] = min(lanes[_CONVERGED + j], lanes[_X + j])
    for j in range(STRIP):
        end = lanes[_PSI + j]
        lanes[_W + j] += lanes[_V + j] * end + held_motion(lanes[AMPLITUDE + j], lanes[_HELD + j], 0.0, end)[1]


@in_lanes
def pause_of(began: float) -> float:
    """Phase from Üg = 0 (t5) to the next Üg = Üy."""
    return 1.5 * math.pi + began


@in_lanes
def slid(velocity: float, after: float, held: float) -> float:
    """W while Eq. 12 brings V down: (V² − V'²) / 2b, the squares of which need be no doubles."""
    return 0.5 * (velocity - after) * ((velocity + after) / held)


@in_lanes
def lane_series(lanes: np.ndarray, j: int, braked: float, gain: float, later: float) -> float:
    """W of the pulse that a lane has followed and of `later` more, each entered with V greater by `gain`.

    All but the last slide `braked` and π · gain · (2n − 1) more between two pulses, the last to its stop.
    """
    moved, left = lanes[_W + j], lanes[_LEFT + j] + later * gain
    last = moved + later * gain * (_HALF_PI - lanes[BEGAN + j]) + slid(left, 0.0, lanes[_HELD + j])
    return later * (moved + braked + math.pi * gain * (later - 1.0)) + last


@scalar
def lane_attenuation(way: int, cycles: int, lanes: np.ndarray) -> None:
    """Eq. 12, and all cycles: W in _W, the largest V in _PEAK.

    Where a block still slides at the next Üg = Üy, Eq. 4 and the hold act on it as in the
    pulse before, so that each cycle adds the same velocity v: an arithmetic series.  But what
    sticks at Üg = Üy when at rest does not when it slides: `lane_carried` goes on with it.
    """
    for j in range(STRIP):
        held, left, moved = lanes[_HELD + j], lanes[_LEFT + j], lanes[_W + j]
        carried = max(left - held * pause_of(lanes[BEGAN + j]), 0.0)
        braked = slid(left, carried, held)
        later = cycles - 1.0
        lanes[_CARRIED + j], lanes[_MOVED + j] = carried, moved + braked
        lanes[_LAST + j] = moved + slid(left, 0.0, held)
        lanes[_HIGHEST + j], lanes[_ONSET + j] = lanes[_PEAK + j], lanes[_START + j]
        lanes[_W + j] = lane_series(lanes, j, braked, carried, later)
        lanes[_PEAK + j] += later * carried
        still = (carried > 0.0) & (cycles > 1)
        lanes[_CODE + j] = NOT_RECOUPLED if still else 0
        # -1: right so far, but not over
        lanes[_CONVERGED + j] *= -1.0 if still & (way == _STICKS) else 1.0


@scalar
def fill_carried(count: int, lanes: np.ndarray, where: np.ndarray) -> int:
    """Bring the lanes that stick at Üg = Üy and do not recouple to the front; the number of them."""
    used = 0
    for lane in range(count):
        if lanes[_CONVERGED + lane] < 0.0:
            where[used] = where[lane]
            for row in range(0, LANES_SIZE, TILE):
                lanes[row + used] = lanes[row + lane]
            used += 1
    fill_up(used, LANES_SIZE // TILE, lanes)
    return used


@scalar
def lane_carried(count: int, options: Options, lanes: np.ndarray) -> None:
    """All cycles of `count` lanes that stick at Üg = Üy when at rest, but come to the second pulse in motion.

    Then they hold E(Üy) ≥ Üg from Üy on and slide through, and each pulse is entered with V greater by
    the same gain.  Where that is a loss, one of two things ends it, and the motion repeats: a pulse that
    recouples, or one that stops before t1 of the first pulse and goes on like it.
    """
    later = options.cycles - 1.0
    for j in range(STRIP):
        lanes[_LEVEL + j] = lane_response(lanes, j, lanes[YIELD + j], options.g)
        lanes[_START + j], lanes[_CONVERGED + j] = lanes[BEGAN + j], 1.0
    # the slide through: the pulse from rest, held at E(Üy) and started at Üy, with V carried added
    lane_rise(_FOLLOWS, options.g, lanes)
    for j in range(STRIP):
        amplitude, held, began, carried = lanes[AMPLITUDE + j], lanes[_LEVEL + j], lanes[BEGAN + j], lanes[_CARRIED + j]
        slowest = rising_phase(min(held, lanes[_X + j]), amplitude)
        lanes[_SLOWEST + j] = carried + held_motion(amplitude, held, began, slowest)[0]
        # held until past its slowest, or else Eq. 4 itself slows it
        through = (held >= amplitude) | (lanes[_X + j] >= held)
        lanes[_THROUGH + j] = lanes[_CONVERGED + j] if through else 0.0
        lanes[_W + j] += -carried * began
        lanes[_V + j] += carried
        lanes[_AT_PEAK + j], lanes[_TO_PEAK + j] = lanes[_V + j], lanes[_W + j]
    lane_fall(options.wants_peak, lanes)
    for j in range(STRIP):
        # pulses that slide through without a stop, and those of them that do not recouple, until it repeats
        carried, slowest = lanes[_CARRIED + j], lanes[_SLOWEST + j]
        gain = lanes[_LEFT + j] - lanes[_HELD + j] * pause_of(lanes[BEGAN + j]) - carried
        after = carried + gain
        through = (np.ceil(slowest / -gain) if gain < 0.0 else later) if slowest > 0.0 else 0.0
        sliding = (np.ceil(after / -gain) if gain < 0.0 else later) if after > 0.0 else 0.0
        most = min(min(through, sliding + 1.0), later)
        stops = (through <= sliding) & (most < later)
        lanes[_GAIN + j], lanes[_MOST + j] = gain, most
        # the stop on the way from Üy, where Newton comes from the left: V falls ever more slowly
        lanes[_V + j] = carried + (most * gain if most > 0.0 else 0.0)
        lanes[_PSI + j] = lanes[BEGAN + j]
        lanes[_X + j] = 0.0 if stops else 1.0
    for _ in range(_MOST_ITERATIONS):
        unsettled = 0
        for j in range(STRIP):
            amplitude, held, psi = lanes[AMPLITUDE + j], lanes[_LEVEL + j], lanes[_PSI + j]
            velocity = lanes[_V + j] + held_motion(amplitude, held, lanes[BEGAN + j], psi)[0]
            step = velocity / (amplitude - held - amplitude * versine(psi))
            settled = lanes[_X + j] > 0.0
            lanes[_PSI + j] = psi if settled else min(max(psi - step, lanes[BEGAN + j]), lanes[_ONSET + j])
            settled |= abs(step) <= _LANE_TOLERANCE * abs(lanes[_PSI + j] - lanes[BEGAN + j])
            lanes[_X + j] = 1.0 if settled else 0.0
            # one that reaches t1 does not stop before
            unsettled += 0 if settled | (lanes[_PSI + j] >= lanes[_ONSET + j]) else 1
        if unsettled == 0:
            break
    for j in range(STRIP):
        began, psi, left, gain, most = (
            lanes[BEGAN + j],
            lanes[_PSI + j],
            lanes[_LEFT + j],
            lanes[_GAIN + j],
            lanes[_MOST + j],
        )
        held_on = held_motion(lanes[AMPLITUDE + j], lanes[_LEVEL + j], began, psi)[1]
        again = lanes[_V + j] * (psi - began) + held_on if psi > began else 0.0
        stops = psi > began
        braked = slid(left, lanes[_CARRIED + j] + gain, lanes[_HELD + j])
        periods = np.floor(later / (most + 1.0))
        rest = later - periods * (most + 1.0)
        sliding_on = most * (lanes[_W + j] + braked + math.pi * gain * (most - 1.0))
        slides = sliding_on if stops else lane_series(lanes, j, braked, gain, most - 1.0)
        period = lanes[_MOVED + j] + again + (slides if most > 0.0 else 0.0)
        tail = lanes[_MOVED + j] + lane_series(lanes, j, braked, gain, rest - 1.0)
        # the slides through all reach t5, as the first does
        gets_over = (lanes[_LEVEL + j] < lanes[AMPLITUDE + j]) & (lanes[_CONVERGED + j] * lanes[_THROUGH + j] > 0.0)
        alike = gets_over & ((most <= 1.0) | (left + (most - 1.0) * gain > 0.0))
        repeats = ((most == 0.0) | alike) & (lanes[_X + j] > 0.0) & ((not stops) | (psi < lanes[_ONSET + j]))
        lanes[_W + j] = (periods * period if periods > 0.0 else 0.0) + (tail if rest > 0.0 else lanes[_LAST + j])
        highest = lanes[_PEAK + j] + max(gain, 0.0) * max(rest - 1.0, 0.0)
        lanes[_PEAK + j] = max(lanes[_HIGHEST + j], highest if most > 0.0 else 0.0)
        # -1: each pulse has to be followed
        lanes[_CONVERGED + j] = 1.0 if repeats else -1.0
        lanes[_CODE + j] = NOT_RECOUPLED
    if later <= _MOST_PULSES:
        for j in range(count):
            if lanes[_CONVERGED + j] < 0.0:
                follow_pulses(options, lanes, j)


@scalar
def held_stop(lanes: np.ndarray, j: int, velocity: float) -> float:
    """ψ at which the hold from Üy on, entered with `velocity`, stops before its slowest; NaN if not found."""
    amplitude, held, began = lanes[AMPLITUDE + j], lanes[_LEVEL + j], lanes[BEGAN + j]
    psi = began
    for _ in range(_MOST_ITERATIONS):
        over = velocity + held_motion(amplitude, held, began, psi)[0]
        step = over / (amplitude - held - amplitude * versine(psi))
        psi -= step
        if abs(step) <= EVENT_TOLERANCE * (psi - began):
            return psi
    return math.nan


@summed
def followed_to_peak(lanes: np.ndarray, j: int, start: float, g: float) -> tuple[float, float]:
    """V and W gained from rest at ψ = `start` to the peak by Eq. 4."""
    rate, moment = 0.0, 0.0
    for node in range(_LANE_NODES.size):
        left = 1.0 - _LANE_NODES[node]
        x = lanes[AMPLITUDE + j] * (1.0 - versine(start * left))
        weighted = _LANE_WEIGHTS[node] * lane_slip(lanes, j, x, g)
        rate += weighted
        moment += left * weighted
    return -start * rate, start * start * moment


@scalar
def restart(lanes: np.ndarray, j: int, start: float, g: float) -> tuple[float, float, float]:
    """b at the peak, and V and W gained there, of a lane that starts to slide at ψ = `start`, beyond t1; or NaN."""
    amplitude = lanes[AMPLITUDE + j]
    asked, slope = lane_response_and_slope(lanes, j, amplitude * (1.0 - versine(start)), g)
    level = max(lanes[YIELD + j], asked)
    at_peak, slope_at_peak = lane_response_and_slope(lanes, j, amplitude, g)
    if at_peak <= level:
        return level, *held_motion(amplitude, level, start, 0.0)
    psi = start
    if slope <= 0.0 or asked < level:  # as in `lane_switch`
        x, step = amplitude - (at_peak - level) / slope_at_peak, math.inf
        for _ in range(_MOST_ITERATIONS):
            if abs(step) <= EVENT_TOLERANCE * min(x, amplitude - x):
                break
            asked, slope = lane_response_and_slope(lanes, j, x, g)
            step = (asked - level) / slope
            x -= step
        else:
            return math.nan, math.nan, math.nan
        psi = max(rising_phase(x, amplitude), start)
    held_on = held_motion(amplitude, level, start, psi)
    followed = followed_to_peak(lanes, j, psi, g)
    return at_peak, held_on[0] + followed[0], held_on[1] - held_on[0] * psi + followed[1]


@scalar
def fall_stop(amplitude: float, held: float, at_peak: float, highest: float, top: float) -> float:
    """ψ after the peak at which V = `at_peak` there, largest at ψ = `top`, is used up by the hold; NaN if not found."""
    psi = top + math.sqrt(2.0 * highest / (amplitude * (top - angle_minus_sine(top))))  # beyond it
    for _ in range(_MOST_ITERATIONS):
        psi = min(psi, _HALF_PI)
        over = at_peak + held_motion(amplitude, held, 0.0, psi)[0]
        step = over / (amplitude - held - amplitude * versine(psi))
        psi -= step
        if abs(step) <= EVENT_TOLERANCE * psi:
            return psi
    return math.nan


@scalar
def follow_pulses(options: Options, lanes: np.ndarray, j: int) -> None:
    """All cycles of a lane of `lane_carried` that stops between t1 and Üg = b, so that no pulse is like another.

    It restarts at once; the other pulses are those that `lane_carried` knows.
    """
    amplitude, began, carried = lanes[AMPLITUDE + j], lanes[BEGAN + j], lanes[_CARRIED + j]
    moved, highest, velocity = lanes[_MOVED + j], lanes[_HIGHEST + j], carried
    for later in range(options.cycles - 2, -1, -1):
        if velocity > 0.0 and lanes[_SLOWEST + j] + velocity - carried > 0.0:
            if lanes[_THROUGH + j] == 0.0:
                return
            held, at_peak = lanes[_HELD + j], lanes[_AT_PEAK + j] + (velocity - carried)
            moved += lanes[_TO_PEAK + j] - (velocity - carried) * began
        else:
            stop = began
            if velocity > 0.0:
                stop = held_stop(lanes, j, velocity)
                moved += velocity * (stop - began) + held_motion(amplitude, lanes[_LEVEL + j], began, stop)[1]
            if stop <= lanes[_ONSET + j]:
                moved += lanes[_MOVED + j] if later > 0 else lanes[_LAST + j]
                velocity = carried
                continue
            held, at_peak, gained = restart(lanes, j, stop, options.g)
            moved += gained
        top = -rising_phase(held, amplitude)
        peak = at_peak + held_motion(amplitude, held, 0.0, top)[0]
        left = at_peak + held_motion(amplitude, held, 0.0, _HALF_PI)[0]
        end = _HALF_PI if left > 0.0 else fall_stop(amplitude, held, at_peak, peak, top)
        moved += at_peak * end + held_motion(amplitude, held, 0.0, end)[1]
        left = max(left, 0.0)
        velocity = max(left - held * pause_of(began), 0.0) if later > 0 else 0.0
        moved += slid(left, velocity, held)
        highest = max(highest, peak)
    # NaN where an iteration has not converged
    if moved >= 0.0:
        lanes[_W + j], lanes[_PEAK + j], lanes[_CONVERGED + j] = moved, highest, 1.0


@scalar
def lane_recoupling(cycles: int, lanes: np.ndarray) -> None:
    """From Üg = 0 on by integration, χ = φ − π to the stop, which comes before 2π for b ≥ Üy; and all cycles."""
    for j in range(STRIP):
        # vers χ ≥ 2 χ²/π²: this start lies beyond the stop
        b, left = lanes[_HELD + j], lanes[_LEFT + j]
        curvature = 4.0 * lanes[AMPLITUDE + j] / (math.pi * math.pi)
        longest = left / b
        lanes[_PSI + j] = min(2.0 * longest / (1.0 + math.sqrt(1.0 + 2.0 * (curvature / b) * longest)), math.pi)
        lanes[_X + j] = 0.0
    for _ in range(_MOST_ITERATIONS):
        unsettled = 0
        for j in range(STRIP):
            amplitude, b, chi = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_PSI + j]
            half_sine, half_cosine = 0.5 * chi - angle_minus_sine(0.5 * chi), 1.0 - versine(0.5 * chi)
            over = lanes[_LEFT + j] - b * chi - 2.0 * amplitude * half_sine * half_sine
            step = over / (b + 2.0 * amplitude * half_sine * half_cosine)
            settled = lanes[_X + j] > 0.0
            lanes[_PSI + j] = chi if settled else min(max(chi + step, 0.0), math.pi)
            settled |= abs(step) <= _LANE_TOLERANCE * chi
            lanes[_X + j] = 1.0 if settled else 0.0
            unsettled += 0 if settled else 1
        if unsettled == 0:
            break
    for j in range(STRIP):
        lanes[_CONVERGED + j] = min(lanes[_CONVERGED + j], lanes[_X + j])
    for j in range(STRIP):
        amplitude, b, chi = lanes[AMPLITUDE + j], lanes[_HELD + j], lanes[_PSI + j]
        sine = 2.0 * (0.5 * chi - angle_minus_sine(0.5 * chi)) * (1.0 - versine(0.5 * chi))
        lanes[_W + j] += (lanes[_LEFT + j] - 0.5 * b * chi) * chi - amplitude * (chi - sine)
        lanes[_W + j] *= cycles
        lanes[_CODE + j] = 0.0


@in_lanes
def quarter_integrals(k: float) -> tuple[float, float]:
    """∫ e^(−k sin φ) dφ and ∫ sin φ e^(−k sin φ) dφ over [0, π/2], for k from 0 to the e-foldings of the lanes.

    The second is the derivative of the first by −k.  In closed form they are π/2 (I₀ − L₀) and
    1 + π/2 (L₁ − I₁), modified Bessel and Struve functions of k.
    """
    below = _CENTRE - k
    first, second = 0.0, 0.0
    for n in range(_QUARTER_SERIES.size):
        second = second * below + first
        first = first * below + _QUARTER_SERIES[n]
    return first, second


@in_lanes
def lane_rate_and_slope(lanes: np.ndarray, j: int, side: float, x: float, g: float) -> tuple[float, float]:
    """D and dD/d|Üg| of a lane in continuous sliding, |Üg| = x, on the positive (`side` 1) or negative (−1) half."""
    tan_theta, mu_s, decay = lanes[TAN_THETA + j], lanes[MU_S + j], lanes[DECAY + j]
    mu = lane_friction(lanes, j, x)
    kept = mu_s - tan_theta - mu
    rate = side * (g * (mu_s - mu)) + x * tan_theta * kept
    slope = side * (g * (mu * decay)) + tan_theta * (kept + x * (mu * decay))
    return rate, slope


@scalar
def lane_turn(side: float, g: float, lanes: np.ndarray) -> None:
    """∫ D dψ on the rise of a half cycle, from Üg = 0 up to where D changes sign, in _RATE; 0 where it does not.

    D is -side g Δμ at Üg = 0.  On the positive half it is concave (by `way_of`), on the negative one convex
    (as long as the block does not lift off): it changes sign once at most, and Newton comes there from Üg = 0
    without passing it.
    """
    for j in range(STRIP):
        at_peak, slope = lane_rate_and_slope(lanes, j, side, lanes[AMPLITUDE + j], g)
        turns = side * at_peak > 0.0
        # one that has its first sign at the peak may have changed twice, unless it still goes away from it
        monotone = side * slope >= 0.0
        lanes[_CONVERGED + j] = lanes[_CONVERGED + j] if turns | monotone else 0.0
        lanes[_PSI + j] = 0.0 if turns else 1.0
        lanes[_X + j] = 0.0
    for _ in range(_MOST_ITERATIONS):
        unsettled = 0
        for j in range(STRIP):
            x = lanes[_X + j]
            rate, slope = lane_rate_and_slope(lanes, j, side, x, g)
            step = rate / slope
            settled = lanes[_PSI + j] > 0.0
            lanes[_X + j] = x if settled else x - step
            settled |= abs(step) <= _LANE_TOLERANCE * min(x, lanes[AMPLITUDE + j] - x)
            lanes[_PSI + j] = 1.0 if settled else 0.0
            unsettled += 0 if settled else 1
        if unsettled == 0:
            break
    for j in range(STRIP):
        lanes[_CONVERGED + j] = min(lanes[_CONVERGED + j], lanes[_PSI + j])
        lanes[_PSI + j] = _HALF_PI + rising_phase(lanes[_X + j], lanes[AMPLITUDE + j])
        lanes[_RATE + j] = 0.0
    for node in range(_LANE_NODES.size):
        at, weight = _LANE_NODES[node], _LANE_WEIGHTS[node]
        for j in range(STRIP):
            phi = lanes[_PSI + j] * at
            x = lanes[AMPLITUDE + j] * (phi - angle_minus_sine(phi))
            lanes[_RATE + j] += weight * lane_rate_and_slope(lanes, j, side, x, g)[0]
    for j in range(STRIP):
        lanes[_RATE + j] *= lanes[_PSI + j]


@scalar
def lane_continuous(options: Options, lanes: np.ndarray) -> None:
    """Continuous sliding, all cycles: W in row _W, the largest V in _PEAK."""
    g = options.g
    for j in range(STRIP):
        # the whole quarter: ∫ D in _V, a quarter of the drift in _X; up to Üg = Üy: _RATE, _MOMENT
        amplitude, mu_s, tan_theta = lanes[AMPLITUDE + j], lanes[MU_S + j], lanes[TAN_THETA + j]
        most = mu_s + lanes[DELTA_MU + j]
        plain, with_sine = quarter_integrals(lanes[DECAY + j] * amplitude)
        lanes[_X + j] = amplitude * tan_theta * (mu_s - tan_theta - most * with_sine)
        lanes[_V + j] = g * (_HALF_PI * mu_s - most * plain) + lanes[_X + j]
        lanes[_RATE + j] = lanes[_MOMENT + j] = 0.0
    for node in range(_SHORT_NODES.size):
        at, left, weight = _SHORT_NODES[node], 1.0 - _SHORT_NODES[node], _SHORT_WEIGHTS[node]
        for j in range(STRIP):
            # sin φ on the way from Üg = 0 to Üg = Üy
            phi = (_HALF_PI + lanes[BEGAN + j]) * at
            x = lanes[AMPLITUDE + j] * (phi - angle_minus_sine(phi))
            weighted = weight * lane_slip(lanes, j, x, g)
            lanes[_RATE + j] += weighted
            lanes[_MOMENT + j] += left * weighted
    for j in range(STRIP):
        began = lanes[BEGAN + j]
        width = _HALF_PI + began
        missed, missed_moment = lanes[_RATE + j] * width, lanes[_MOMENT + j] * width * width
        drift = 4.0 * lanes[_X + j]
        lanes[_W + j] = continuous_displacement(lanes[_V + j], missed, missed_moment, drift, began, options.cycles)
        lanes[_MISSED + j], lanes[_GAIN + j] = missed, drift
        lanes[_PEAK + j], lanes[_CODE + j], lanes[_CONVERGED + j] = math.nan, 0.0, 1.0
    if options.wants_peak:
        lane_turn(1.0, g, lanes)
        for j in range(STRIP):
            lanes[_DIP + j] = lanes[_RATE + j]
        lane_turn(-1.0, g, lanes)
        for j in range(STRIP):
            # as in `continuous_peaks`: the fall mirrors the rise
            drift, half, dip, bump = lanes[_GAIN + j], 2.0 * lanes[_V + j], lanes[_DIP + j], lanes[_RATE + j]
            first = max(half, half - dip)
            other = drift - half
            negative = half + max(max(0.0, other), max(bump, other - bump))
            positive = max(max(0.0, dip), first)
            lanes[_PEAK + j] = continuous_peak(lanes[_MISSED + j], drift, first, positive, negative, options.cycles)


@scalar
def solve_strip(way: int, options: Options, lanes: np.ndarray) -> None:
    """Lanes that all go one way, from the onset to the end of all cycles."""
    if way == _CONTINUOUS:
        lane_continuous(options, lanes)
        return
    lane_onset(way, options.g, lanes)
    lane_rise(way, options.g, lanes)
    lane_fall(options.wants_peak, lanes)
    if options.recoupling == INTEGRATE:
        lane_recoupling(options.cycles, lanes)
    else:
        lane_attenuation(way, options.cycles, lanes)


@scalar
def sort_strip(cells: np.ndarray, options: Options, blocks: np.ndarray) -> None:
    """Blocks of a strip of a tile in lanes, with their codes and the way each goes.

    Neighbours are mostly alike, and what none of them needs is left out: λ and t1 of those that stay,
    E of those that do not stick and slip (7 against 9 ns a cell of a design chart).
    """
    g, slides, sticks = options.g, 0, 0
    for j in range(STRIP):
        cell = cell_of(cells, j)
        yield_acceleration, _, _, minimum_friction, delta_mu, mode, validity = interface_of(cell, options.rise, g)
        blocks[AMPLITUDE + j], blocks[YIELD + j] = cell.amplitude, yield_acceleration
        blocks[MU_S + j], blocks[TAN_THETA + j] = cell.mu_s, cell.tan_theta
        blocks[DELTA_MU + j], blocks[_LEAST_FRICTION + j] = delta_mu, minimum_friction
        blocks[_MODE + j], blocks[_VALIDITY + j] = mode, validity
        blocks[_WAY + j] = _STAYS
        slides += 1 if mode > STUCK else 0
        sticks += 1 if mode == STICK_SLIP else 0
    if slides == 0:
        return
    for j in range(STRIP):
        least = blocks[_LEAST_FRICTION + j]
        blocks[DECAY + j] = decay_rate_of(cell_of(cells, j), blocks[DELTA_MU + j], least, g) / g
        blocks[BEGAN + j] = rising_phase(blocks[YIELD + j], blocks[AMPLITUDE + j])
    if sticks > 0 and options.rise != NEWMARK:
        for j in range(STRIP):
            blocks[_AT_START + j] = lane_response(blocks, j, blocks[YIELD + j], g)
            blocks[_AT_END + j] = lane_response(blocks, j, blocks[AMPLITUDE + j], g)
    for j in range(STRIP):
        blocks[_WAY + j] = way_of(blocks, j, options)


@scalar
def sort_cells(cells: np.ndarray, count: int, options: Options, blocks: np.ndarray) -> None:
    """`sort_strip` for a tile."""
    for first in range(0, count, STRIP):
        sort_strip(cells[first:], options, blocks[first:])


@scalar
def runs_of(blocks: np.ndarray, count: int, runs: np.ndarray) -> int:
    """Where runs of cells that go the same way start (and the last ends); the number of them.

    Along an axis of a sweep neighbours mostly go the same way: cells are laid out and collected
    run by run.
    """
    runs[0], found = 0, 1
    for first in range(1, count, STRIP):
        size = min(STRIP, count - first)
        before, after = blocks[_WAY + first - 1 :], blocks[_WAY + first :]
        changes = 0
        for j in range(size):
            changes += 1 if after[j] != before[j] else 0
        for j in range(size if changes > 0 else 0):
            if after[j] != before[j]:
                runs[found] = first + j
                found += 1
    runs[found] = count
    return found


@scalar
def fill_lanes(blocks: np.ndarray, first: int, last: int, used: int, lanes: np.ndarray) -> int:
    """Lay out a run of blocks behind the `used` lanes; the number of lanes with them."""
    if last - first < 8:  # a loop for each row would cost more than it does
        for j in range(first, last):
            for row in range(0, LANE_ROWS * TILE, TILE):
                lanes[row + used + j - first] = blocks[row + j]
    else:
        for row in range(0, LANE_ROWS * TILE, TILE):
            source, target = blocks[row + first : row + last], lanes[row + used : row + TILE]
            for j in range(source.size):
                target[j] = source[j]
    return used + last - first


@scalar
def fill_up(used: int, rows: int, lanes: np.ndarray) -> None:
    """Repeat the first lane up to the next whole number of strips."""
    for row in range(0, rows * TILE, TILE):
        for lane in range(used, whole_lanes(used)):
            lanes[row + lane] = lanes[row]


@in_lanes
def enter(
    lanes: np.ndarray, lane: int, way: int, options: Options, blocks: np.ndarray, motion: np.ndarray,
    codes: np.ndarray, j: int,
) -> None:  # fmt: skip
    """Enter the result of a lane that has converged as cell j; else the cell is to go the long way."""
    solved = lanes[_CONVERGED + lane] > 0.0
    flags = int(lanes[_CODE + lane]) | (EQ4_BELOW_YIELD if way == _YIELD_GOVERNS else 0)
    motion[0, j] = lanes[_W + lane]
    if options.wants_peak:
        motion[1, j] = lanes[_PEAK + lane]
    codes[1, j] |= flags if solved else 0
    blocks[_WAY + j] = way if solved else _OTHER


@scalar
def solve_way(way: int, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray) -> None:
    """Solve the cells of a tile, which has `count` runs, that go one way."""
    blocks, lanes, runs, where = room.blocks, room.lanes, room.runs, room.where
    used = 0
    for run in range(count):
        if blocks[_WAY + runs[run]] == way:
            used = fill_lanes(blocks, runs[run], runs[run + 1], used, lanes)
    if used == 0:
        return
    fill_up(used, LANE_ROWS, lanes)
    for first in range(0, used, STRIP):
        solve_strip(way, options, lanes[first:])
    lane = 0
    for run in range(count):
        first, last = runs[run], runs[run + 1]
        if blocks[_WAY + first] == way:
            # by slices, which numba knows to begin at 0: then this is a loop in SIMD
            found, cells, moved, coded = lanes[lane:], blocks[first:], motion[:, first:last], codes[:, first:last]
            for j in range(last - first):
                enter(found, j, way, options, cells, moved, coded, j)
            if way == _STICKS:
                for j in range(last - first):
                    where[lane + j] = first + j
            lane += last - first
    if way == _STICKS:
        used = fill_carried(used, lanes, where)
        for first in range(0, used, STRIP):
            lane_carried(min(used - first, STRIP), options, lanes[first:])
        for lane in range(used):
            enter(lanes, lane, way, options, blocks, motion, codes, where[lane])


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> int:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity.

    Those that are to go from event to event, as any waveform does, are marked in `room.left`; their number.
    """
    blocks, left = room.blocks, room.left
    fill_up(count, 7, cells)
    sort_cells(cells, whole_lanes(count), options, blocks)
    for j in range(count):
        codes[0, j], codes[1, j] = int(blocks[_MODE + j]), int(blocks[_VALIDITY + j])
        motion[0, j] = motion[1, j] = 0.0 if blocks[_MODE + j] == STUCK else math.nan
    found = runs_of(blocks, count, room.runs)
    for way in (_YIELD_GOVERNS, _FOLLOWS, _STICKS, _CONTINUOUS):
        solve_way(way, found, options, room, motion, codes)
    others = 0
    for j in range(count):
        others += 1 if blocks[_WAY + j] == _OTHER else 0
    for j in range(count if others > 0 else 0):
        left[j] = blocks[_WAY + j] == _OTHER
        if left[j]:
            block = block_at(cells, j, options)
            if block.sliding_mode == CONTINUOUS:
                answer(continuous(block, options.cycles, options.wants_peak), j, motion, codes)
                left[j] = False
                others -= 1
    return others
