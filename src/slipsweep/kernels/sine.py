"""The cycle solver's short way for the sine: the common cases in SIMD lanes.

Nearly all cells go the same way: they slide from Üg = Üy, hold the yield value, perhaps
follow Eq. 4 to the peak, hold again and stop before the next pulse; or they slide
continuously with a friction that decays gently.  The functions below are that way, phase by
phase, for many cells at a time, in loops that LLVM turns into SIMD (Newton with a fixed
number of iterations, quadrature nodes outside, cells inside).  A cell whose iteration has
not converged, or that goes another way, is solved as any waveform is, by `cycle`; in continuous sliding
by symmetry from one quarter of the cycle (`continuous`).
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
    INTEGRATE,
    LANE_ROWS,
    MONOTONE,
    MU_S,
    NEWMARK,
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
    lane_friction,
    lane_of,
    lane_response,
    phase,
    slip,
    slip_root,
    whole_lanes,
)
from slipsweep.kernels.cycle import (
    LEG_COLUMNS,
    MOST_LEGS,
    NODES,
    PANEL_BOUNDS,
    SLIVER,
    WEIGHTS,
    answer,
    next_break,
    train,
)
from slipsweep.kernels.excitation import Wave
from slipsweep.kernels.jit import in_lanes, scalar, summed

_HALF_PI = 0.5 * math.pi

#: Rows of the lanes beside the block's.
_X, _LEVEL, _START, _V, _W, _HELD, _RATE, _MOMENT, _PSI, _LEFT, _PEAK, _CONVERGED, _CODE = range(
    LANE_ROWS * TILE, (LANE_ROWS + 13) * TILE, TILE
)
#: What a first pulse leaves to the pulses after it: V carried on, W up to then, W if it were the
#: last, t1 and the largest V; and, of a pulse entered in motion, V as it is slowest.
_CARRIED, _MOVED, _LAST, _ONSET, _HIGHEST, _SLOWEST = range((LANE_ROWS + 13) * TILE, (LANE_ROWS + 19) * TILE, TILE)
_LANES_SIZE = (LANE_ROWS + 19) * TILE

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
            weighted = WEIGHTS[node] * slip(block, amplitude * (1.0 - versine(left + width * NODES[node])))
            rate += weighted
            moment += (1.0 - NODES[node]) * weighted
        second += (first + moment * width) * width
        first += rate * width
        left = right
        if e_foldings <= bound:
            break
    return first, second


@scalar
def continuous_peak(block: Block, side: float, half_gain: float, after: float) -> float:
    """Largest V in a half cycle entered with V = 0, where the plane has passed `after` on its rise.

    V peaks where its rate D changes sign; the falling quarter mirrors the rising one, over
    which and back V gains `half_gain`.
    """
    peak = half_gain if after > 0.0 else max(0.0, half_gain)
    x, end = 0.0, side * block.amplitude
    for _ in range(MOST_LEGS):
        target = next_break(block, x, end)
        inner = x + SLIVER * (target - x)
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
    for bound in PANEL_BOUNDS:
        right = 0.0 if e_foldings <= bound else phase(block, bound / decay)
        width = right - left
        part = 0.0
        for node in range(NODES.size):
            x = block.amplitude * (1.0 - versine(left + width * NODES[node]))
            part += WEIGHTS[node] * x * (block.mu_s - block.tan_theta - friction(block, x))
        total += part * width
        left = right
        if e_foldings <= bound:
            break
    return 4.0 * block.tan_theta * total


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
    pulse before, so that each cycle adds the same velocity v: an arithmetic series.  But what
    sticks at Üg = Üy when at rest does not when it slides: `lane_carried` goes on with it.
    """
    for j in range(count):
        held, left, moved = lanes[_HELD + j], lanes[_LEFT + j], lanes[_W + j]
        duration = 1.5 * math.pi + lanes[BEGAN + j]  # from Üg = 0 to the next Üg = Üy
        carried = max(left - held * duration, 0.0)
        braked = 0.5 * (left - carried) * (left + carried) / held
        later = cycles - 1.0
        last = moved + later * carried * (_HALF_PI - lanes[BEGAN + j]) + 0.5 * (left + later * carried) ** 2 / held
        lanes[_CARRIED + j], lanes[_MOVED + j] = carried, moved + braked
        lanes[_LAST + j] = moved + 0.5 * left * left / held
        lanes[_HIGHEST + j], lanes[_ONSET + j] = lanes[_PEAK + j], lanes[_START + j]
        lanes[_W + j] = later * (moved + braked + math.pi * carried * (later - 1.0)) + last
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
            for row in range(0, _LANES_SIZE, TILE):
                lanes[row + used] = lanes[row + lane]
            used += 1
    for lane in range(used, whole_lanes(used)):
        for row in range(0, _LANES_SIZE, TILE):
            lanes[row + lane] = lanes[row]
    return used


@scalar
def lane_carried(count: int, options: Options, lanes: np.ndarray) -> None:
    """All cycles of lanes that stick at Üg = Üy when at rest, but come to the second pulse in motion.

    Then they hold E(Üy) ≥ Üg from Üy on, and one of three things happens.  They stop before t1 of
    the first pulse, and go on like it; they slide through and stop before the third pulse, which
    is the first again; or they never stop, and each cycle adds the same velocity.
    """
    g, cycles = options.g, options.cycles
    later = cycles - 1.0
    # the stop on the way from Üy, where Newton comes from the left: V falls ever more slowly
    for j in range(count):
        lanes[_LEVEL + j] = lane_response(lanes, j, lanes[YIELD + j], g)
        lanes[_START + j] = lanes[_PSI + j] = lanes[BEGAN + j]
    for _ in range(_LANE_ITERATIONS):
        for j in range(count):
            amplitude, held, psi = lanes[AMPLITUDE + j], lanes[_LEVEL + j], lanes[_PSI + j]
            velocity = lanes[_CARRIED + j] + held_motion(amplitude, held, lanes[BEGAN + j], psi)[0]
            step = velocity / (amplitude - held - amplitude * versine(psi))
            lanes[_PSI + j] = min(max(psi - step, lanes[BEGAN + j]), lanes[_ONSET + j])
            settled = abs(step) <= _LANE_TOLERANCE * abs(lanes[_PSI + j] - lanes[BEGAN + j])
            lanes[_X + j] = 1.0 if settled & (lanes[_PSI + j] < lanes[_ONSET + j]) else 0.0
    for j in range(count):
        began, psi = lanes[BEGAN + j], lanes[_PSI + j]
        again = (
            lanes[_CARRIED + j] * (psi - began) + held_motion(lanes[AMPLITUDE + j], lanes[_LEVEL + j], began, psi)[1]
        )
        stops = lanes[_X + j] > 0.0
        lanes[_CODE + j] = later * (lanes[_MOVED + j] + again) + lanes[_LAST + j] if stops else math.nan
        lanes[_CONVERGED + j] = 1.0
    # the slide through: the pulse from rest, held at E(Üy) and started at Üy, with V carried added
    lane_rise(count, _FOLLOWS, g, lanes)
    for j in range(count):
        amplitude, held, began, carried = lanes[AMPLITUDE + j], lanes[_LEVEL + j], lanes[BEGAN + j], lanes[_CARRIED + j]
        slowest = -inverse_versine((amplitude - held) / amplitude)
        lanes[_SLOWEST + j] = carried + held_motion(amplitude, held, began, slowest)[0]
        # held until past its slowest, or else Eq. 4 itself slows it
        through = (held < amplitude) & (lanes[_X + j] >= held) & (lanes[_SLOWEST + j] > 0.0)
        lanes[_CONVERGED + j] = lanes[_CONVERGED + j] if through else 0.0
        lanes[_W + j] += -carried * began
        lanes[_V + j] += carried
    lane_fall(count, lanes)
    for j in range(count):
        held, left, moved, began = lanes[_HELD + j], lanes[_LEFT + j], lanes[_W + j], lanes[BEGAN + j]
        after = max(left - held * (1.5 * math.pi + began), 0.0)
        braked = 0.5 * (left - after) * (left + after) / held
        gain = after - lanes[_CARRIED + j]
        most = later - 1.0  # pulses after the second
        series = lanes[_MOVED + j] + most * (moved + braked + math.pi * gain * (most - 1.0))
        series += moved + most * gain * (_HALF_PI - began) + 0.5 * (left + most * gain) ** 2 / held
        # after == 0: pairs of pulses, and of an odd number the last is a first one
        pairs = math.floor(0.5 * cycles)
        paired = pairs * (lanes[_MOVED + j] + moved + braked) + (lanes[_LAST + j] if cycles > 2.0 * pairs else 0.0)
        lasts = min(lanes[_SLOWEST + j], after) + most * min(gain, 0.0) > 0.0
        slides = lanes[_CONVERGED + j] > 0.0
        stopped = lanes[_CODE + j]
        through = paired if after == 0.0 else series
        lanes[_W + j] = through if slides else stopped
        slides &= (after == 0.0) | lasts
        lanes[_CONVERGED + j] = 1.0 if slides | (stopped == stopped) else 0.0
        highest = lanes[_PEAK + j] + (most * max(gain, 0.0) if after > 0.0 else 0.0)
        lanes[_PEAK + j] = max(lanes[_HIGHEST + j], highest if slides else 0.0)
        lanes[_CODE + j] = NOT_RECOUPLED


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
def collect(
    used: int, way: int, lanes: np.ndarray, where: np.ndarray, blocks: np.ndarray, motion: np.ndarray, codes: np.ndarray
) -> None:
    """Results of the lanes that have converged; the other cells are to go the long way."""
    for lane in range(used):
        j = where[lane]
        if lanes[_CONVERGED + lane] > 0.0:
            motion[0, j], motion[1, j] = lanes[_W + lane], lanes[_PEAK + lane]
            codes[1, j] |= int(lanes[_CODE + lane]) | (EQ4_BELOW_YIELD if way == _YIELD_GOVERNS else 0)
            blocks[_WAY + j] = way
        else:
            blocks[_WAY + j] = _OTHER


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, wave: Wave, motion: np.ndarray, codes: np.ndarray
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
        collect(used, way, lanes, where, blocks, motion, codes)
        if way == _STICKS:
            used = fill_carried(used, lanes, where)
            if used > 0:
                lane_carried(whole_lanes(used), options, lanes)
                collect(used, way, lanes, where, blocks, motion, codes)
    no_legs = np.empty((0, LEG_COLUMNS))
    for j in range(count):
        if blocks[_WAY + j] == _OTHER and codes[0, j] > STUCK:
            block = block_at(cells, j, options)
            if block.sliding_mode == CONTINUOUS:
                answer(continuous(block, options.cycles, options.wants_peak), j, motion, codes)
            else:
                answer(train(block, options, wave, no_legs), j, motion, codes)
