"""The cycle solver: the response to any periodic shaking, event by event.

Between two events the block's acceleration is either held (polynomials of the phase) or follows
Eq. 4 (closed forms on a straight piece of the wave, Gauss-Legendre quadrature of a smooth function
on a curved one), so that no step is taken and the answer carries rounding errors only.  The shaking
comes in monotone pieces (`excitation`).  What the plane does on one decides the phase of the
motion: `rise` (stick, slide and follow Eq. 4; from t1 on), `hold` (to the stop, or to Üg = 0, t5), and
then Eq. 12 or the hold again.  `follow_pulse` goes through them; `train` strings pulses together.
In continuous sliding Eq. 4 is integrated over a cycle, and the cycles are a series.  The sine has shorter
ways to the same (`sine`).  Notation: τ is the phase on a piece, from its anchor, x the plane's acceleration,
b the block's, V and W velocity and displacement (see `block`).

Events need not be located to the last digit: at an onset the rate of V is zero, at a stop
V itself, so an error δ in an event's phase moves W by δ² or less.
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar, summed
from slipsweep.jit.elementary import versine
from slipsweep.kernels.block import (
    INTEGRATE,
    KD_NOT_POSITIVE,
    LITERAL,
    NEWMARK,
    Block,
    Motion,
    Options,
    block_at,
    friction,
    inflection,
    opposite,
    relative_acceleration,
    relative_acceleration_root,
    response,
    response_and_slope,
    response_root,
    slope_and_curvature,
    slope_root,
    starting_acceleration,
    store_motion,
)
from slipsweep.kernels.events import root_of
from slipsweep.kernels.excitation import held_gain, held_integrals, offset_at, phase_at, plane
from slipsweep.kernels.linear import exponential_moments
from slipsweep.kernels.train import Pulse, attenuate, beginning, first_pulse, train_of
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.motion.pieces import ARC, BEGIN, COEFFICIENTS, DEGREE, END, FINISH, FIRST, JUMPS, LAST, START, TOP, Wave

#: 16 Gauss-Legendre nodes and weights on [0, 1]: two SIMD registers.
NODES, WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True))

#: Where panels of the quadrature end, in e-foldings of the friction from the end where it is larger;
#: past the third it has decayed to 1e-18.
PANEL_BOUNDS = (6.0, 18.0, 42.0, math.inf)

#: Signs at the start of a leg are read this fraction of the leg inside it.
SLIVER = 1e-10

#: More legs than any rise has: five breaks, and a stop and an onset between each.
MOST_LEGS = 32

# A moving block is a small array, which functions can change: rows of it.  SLIDES and FOLLOWS (b follows
# Eq. 4) are 1.0 or 0.0; PEAK and LEAST the largest and the least V; RESTED the phase of the last stop.
VELOCITY, DISPLACEMENT, PEAK, LEAST, HELD, SLIDES, FOLLOWS, RESTED = range(8)
STATE_SIZE = 8

#: Kinds of legs, and the columns of a record of them, which `history` samples: kind, piece, phase on
#: it and in the table at the start, phase at the end, b, V and W.
HOLD, FOLLOW, ATTENUATE = range(3)
LEG_COLUMNS = 8


@scalar
def record(legs: np.ndarray, kind: int, piece: int, tau: float, start: float, end: float, state: np.ndarray) -> None:
    """Add a leg to a record whose first row counts them; a sweep keeps none and gives an empty one."""
    if legs.size:
        legs[0, 0] += 1.0
        row = int(legs[0, 0])
        legs[row, 0], legs[row, 1], legs[row, 2], legs[row, 3], legs[row, 4] = kind, piece, tau, start, end
        legs[row, 5], legs[row, 6], legs[row, 7] = state[HELD], state[VELOCITY], state[DISPLACEMENT]


@scalar
def straight_lag(block: Block, x: float, change: float, width: float) -> tuple[float, float, float, float]:
    """`lag_integrals` where |Üg| goes along a straight line, by `change`: closed forms.

    The exponential is taken from the end where the friction is larger, so that its argument is
    never positive: nothing overflows, however large λ is.
    """
    largest = friction(block, min(x, x + change))
    whole, early, late, both = exponential_moments(block.decay_rate / block.g * abs(change))
    if change < 0.0:
        early, late = late, early
    kept = block.mu_s - block.tan_theta
    return (
        (block.mu_s - largest * whole) * width,
        (0.5 * block.mu_s - largest * early) * width * width,
        (kept * (x + 0.5 * change) - largest * (x * whole + change * late)) * width,
        (kept * (0.5 * x + change / 6.0) - largest * (x * early + change * both)) * width * width,
    )


@scalar
def at_nodes(wave: Wave, p: int, amplitude: float, start: float, width: float, x: np.ndarray) -> None:
    """Fill in |Üg| at the nodes of the quadrature from `start` on: power by power, so that the nodes are lanes."""
    top = wave.pieces[p, TOP]
    if wave.pieces[p, ARC] > 0.0:
        for node in range(NODES.size):
            x[node] = amplitude * (1.0 - versine(start + width * NODES[node]))
        return
    for node in range(NODES.size):
        x[node] = 0.0
    for k in range(int(wave.pieces[p, DEGREE]) - 1, -1, -1):
        coefficient = wave.pieces[p, COEFFICIENTS + k]
        for node in range(NODES.size):
            x[node] = (x[node] + coefficient) * (start + width * NODES[node])
    for node in range(NODES.size):
        x[node] = amplitude * abs(top + x[node])


@summed
def lag_integrals(block: Block, wave: Wave, p: int, start: float, end: float) -> tuple[float, float, float, float]:
    """What Eq. 4 takes the block behind the plane over a part of piece p.

    ∫ (μs − μ) dτ and ∫ |x| (μs − tan θ − μ) dτ, each followed by itself with the weight end − τ: on
    the side ±1 of Üg = 0 the relative acceleration is D = ±g (μs − μ) + tan θ |x| (μs − tan θ − μ).
    Apart, because over a symmetric cycle the first must cancel to the last digit.
    """
    amplitude = block.amplitude
    x_start, x_end = abs(plane(wave, p, amplitude, start)), abs(plane(wave, p, amplitude, end))
    if int(wave.pieces[p, DEGREE]) <= 1:
        return straight_lag(block, x_start, x_end - x_start, end - start)
    mu_s, kept = block.mu_s, block.mu_s - block.tan_theta
    decay = block.decay_rate / block.g
    rising = x_start <= x_end
    least = min(x_start, x_end)
    e_foldings = decay * abs(x_end - x_start)
    near, far = (start, end) if rising else (end, start)
    first, second, first_x, second_x = 0.0, 0.0, 0.0, 0.0
    values = np.empty(NODES.size)
    for bound in PANEL_BOUNDS:
        until = far
        if e_foldings > bound:
            until = offset_at(wave, p, amplitude, math.copysign(least + bound / decay, wave.pieces[p, TOP]))
        width = until - near
        at_nodes(wave, p, amplitude, near, width, values)
        for node in range(NODES.size):
            x = values[node]
            mu = friction(block, x)
            weight = abs(width) * WEIGHTS[node]
            left = end - (near + width * NODES[node])
            lag, lag_x = weight * (mu_s - mu), weight * x * (kept - mu)
            first += lag
            second += left * lag
            first_x += lag_x
            second_x += left * lag_x
        near = until
        if e_foldings <= bound:
            break
    return first, second, first_x, second_x


@scalar
def eq4_integrals(block: Block, wave: Wave, p: int, start: float, end: float) -> tuple[float, float]:
    """∫ D dτ and ∫ (end − τ) D dτ over a part of piece p: gains of V and W from rest."""
    first, second, first_x, second_x = lag_integrals(block, wave, p, start, end)
    side_g = math.copysign(block.g, wave.pieces[p, TOP])
    return side_g * first + block.tan_theta * first_x, side_g * second + block.tan_theta * second_x


@scalar
def next_break(block: Block, x: float, end: float) -> float:
    """Where, on the way from x to end, one of E, dE/dx and D first ceases to be monotone."""
    inner = x + SLIVER * (end - x)
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
    for _ in range(MOST_LEGS):
        if x >= top:
            break
        end = next_break(block, x, top)
        inner = x + SLIVER * (end - x)
        if relative_acceleration(block, inner) > 0.0:
            return x
        if relative_acceleration(block, end) > 0.0:
            return relative_acceleration_root(block, inner, end)
        x = end
    return top if x >= top else math.nan


@scalar
def rising_leg(block: Block, x: float, top: float, b: float, follows: bool) -> tuple[float, bool, bool]:
    """The next leg of a slide on the rise from x to `top`: its end, whether b follows Eq. 4 on it, and from there on.

    A leg ends where that changes, where E or D turns, and where D changes its sign.
    """
    end, crosses = top, False
    if block.rise != NEWMARK:
        end = next_break(block, x, top)
        inner = x + SLIVER * (end - x)
        asked, slope = response_and_slope(block, inner)
        if block.rise != LITERAL:
            follows = slope > 0.0 and (follows or asked >= b)
        if not follows and slope > 0.0 and response(block, end) > b:
            end = response_root(block, b, inner, end)
            crosses = True
        if follows and opposite(relative_acceleration(block, inner), relative_acceleration(block, end)):
            end = relative_acceleration_root(block, inner, end)
    if not follows and x < b < end:
        end = b
        crosses = False
    return end, follows, follows or crosses


@scalar
def _held_lost(where: tuple[Block, Wave, int, float, float, float], tau: float) -> tuple[float, float]:
    """−V at τ of a hold that V entered at `start`, and its rate."""
    block, wave, p, held, velocity, start = where
    left = velocity + held_gain(wave, p, block.amplitude, held, start, tau)
    return -left, held - plane(wave, p, block.amplitude, tau)


@scalar
def _followed_lost(where: tuple[Block, Wave, int, float, float], tau: float) -> tuple[float, float]:
    """−V at τ where b follows Eq. 4, and its rate."""
    block, wave, p, velocity, start = where
    left = velocity + eq4_integrals(block, wave, p, start, tau)[0]
    return -left, -relative_acceleration(block, plane(wave, p, block.amplitude, tau))


_held_stop = root_of(_held_lost)
_followed_stop = root_of(_followed_lost)


@scalar
def advance(
    wave: Wave, p: int, end: float, stops: bool, gained: float, moved: float, width: float, state: np.ndarray
) -> None:
    """Add a leg's gains; where the block stops there, it is at rest from then on."""
    state[DISPLACEMENT] += state[VELOCITY] * width + moved
    state[VELOCITY] += gained
    if stops:
        state[VELOCITY] = state[SLIDES] = 0.0
        state[RESTED] = phase_at(wave, p, end)
    state[PEAK] = max(state[PEAK], state[VELOCITY])
    state[LEAST] = min(state[LEAST], state[VELOCITY])


@scalar
def hold(block: Block, wave: Wave, p: int, start: float, end: float, state: np.ndarray, legs: np.ndarray) -> float:
    """Slide with b held along piece p from start to end, or to the stop: where that is."""
    amplitude, held, velocity = block.amplitude, state[HELD], state[VELOCITY]
    # most legs are whole pieces, whose ends are known
    rate = amplitude * wave.pieces[p, FIRST] if start == wave.pieces[p, BEGIN] else plane(wave, p, amplitude, start)
    rate_end = amplitude * wave.pieces[p, LAST] if end == wave.pieces[p, FINISH] else plane(wave, p, amplitude, end)
    rate -= held
    rate_end -= held
    gained, moved = held_integrals(wave, p, amplitude, held, start, end)
    low, high = start, end
    stops = velocity + gained <= 0.0
    if rate_end >= 0.0 and (rate >= 0.0 or velocity <= 0.0):
        # nothing slows it: over a leg so short that its gain is rounding, it does not stop
        stops, gained = False, max(gained, 0.0)
    if opposite(rate, rate_end) and (rate > 0.0 or velocity > 0.0):
        # V turns where x = b; one that starts from rest there only seems to fall, by rounding
        turn = offset_at(wave, p, amplitude, held)
        extreme = velocity + held_gain(wave, p, amplitude, held, start, turn)
        if rate > 0.0:
            state[PEAK] = max(extreme, state[PEAK])  # in this order a NaN is kept
            low = turn
        else:
            state[LEAST] = min(extreme, state[LEAST])
            stops, high = extreme <= 0.0, turn
    if stops:
        end = start
        if velocity > 0.0 or rate > 0.0:
            end = _held_stop((block, wave, p, held, velocity, start), low, high, 0.5 * (low + high), start)
        gained, moved = held_integrals(wave, p, amplitude, held, start, end)
    record(legs, HOLD, p, start, phase_at(wave, p, start), phase_at(wave, p, end), state)
    advance(wave, p, end, stops, gained, moved, end - start, state)
    return end


@scalar
def follow(block: Block, wave: Wave, p: int, start: float, end: float, state: np.ndarray, legs: np.ndarray) -> float:
    """Slide under Eq. 4 along piece p, on which D keeps its sign, from start to end or to the stop: where that is."""
    gained, moved = eq4_integrals(block, wave, p, start, end)
    stops = state[VELOCITY] + gained <= 0.0
    if stops:
        velocity = state[VELOCITY]
        end = _followed_stop((block, wave, p, velocity, start), start, end, 0.5 * (start + end), start)
        gained, moved = eq4_integrals(block, wave, p, start, end)
    record(legs, FOLLOW, p, start, phase_at(wave, p, start), phase_at(wave, p, end), state)
    advance(wave, p, end, stops, gained, moved, end - start, state)
    return end


@scalar
def arrive(block: Block, x: float, state: np.ndarray) -> None:
    """What x asks at the beginning of a rise or a plateau and after a jump upwards: b if the block slides, else t1."""
    if state[SLIDES] > 0.0:
        if block.rise == LITERAL:
            state[HELD] = response(block, x)
        elif block.rise != NEWMARK:
            state[HELD] = max(state[HELD], response(block, x))
    elif x >= block.yield_acceleration:
        b = starting_acceleration(block, x)
        if b < x:
            state[HELD], state[SLIDES] = b, 1.0
    state[FOLLOWS] = 1.0 if block.rise == LITERAL else 0.0


@scalar
def rise(block: Block, wave: Wave, p: int, tau: float, x: float, state: np.ndarray, legs: np.ndarray) -> None:
    """Along a piece on which the plane's acceleration rises, from x at τ on.

    Goes from event to event: the block stays with the plane (stick), holds b, or follows
    Eq. 4; each leg ends where that changes, where E or D turns, or where V turns or vanishes.
    """
    amplitude, literal = block.amplitude, block.rise == LITERAL
    top, finish = amplitude * wave.pieces[p, LAST], wave.pieces[p, FINISH]
    for _ in range(MOST_LEGS):
        if state[SLIDES] == 0.0:
            began = top
            if top > block.yield_acceleration:
                began = onset(block, max(x, block.yield_acceleration), top)
            if began >= top:
                break
            if began > x:
                tau = max(tau, offset_at(wave, p, amplitude, began))
            # at an onset beyond Üy Eq. 4 meets Üg: to evaluate it there would add the rounding of g μs
            beyond = began > max(x, block.yield_acceleration)
            state[HELD] = began if beyond else min(starting_acceleration(block, began), began)
            x = began
            state[VELOCITY], state[LEAST] = 0.0, 0.0
            state[SLIDES], state[FOLLOWS] = 1.0, 1.0 if literal else 0.0
        end, follows, follows_on = rising_leg(block, x, top, state[HELD], state[FOLLOWS] > 0.0)
        tau_end = finish if end >= top else max(tau, offset_at(wave, p, amplitude, end))
        if follows:
            tau = follow(block, wave, p, tau, tau_end, state, legs)
        else:
            tau = hold(block, wave, p, tau, tau_end, state, legs)
        if state[SLIDES] == 0.0 and tau < tau_end:
            x = plane(wave, p, amplitude, tau)
            continue
        x, tau = end, tau_end
        state[FOLLOWS] = 1.0 if follows_on else 0.0
        if follows:
            state[HELD] = response(block, x)
        if x >= top:
            break
    else:
        state[VELOCITY] = math.nan


@scalar
def through_stretch(block: Block, wave: Wave, k: int, p: int, tau: float, state: np.ndarray, legs: np.ndarray) -> None:
    """From Üg = Üy, τ on piece p, to Üg = 0 (t5) at the end of stretch k; b ≤ 0 at the end of a rise makes b NaN."""
    amplitude = block.amplitude
    for q in range(p, wave.stretch[k, 1]):
        first, last = wave.pieces[q, FIRST], wave.pieces[q, LAST]
        x = amplitude * first
        if q == p:
            x = max(x, block.yield_acceleration)
        else:
            tau = wave.pieces[q, BEGIN]
        if (
            wave.pieces[q, JUMPS] > 0.0
            or first == last
            or (q > p and first < last and wave.pieces[q - 1, FIRST] > wave.pieces[q - 1, LAST])
        ):
            arrive(block, x, state)
        if first < last:
            rise(block, wave, q, tau, x, state, legs)
        elif state[SLIDES] > 0.0:
            if first > last and state[HELD] <= 0.0:
                break
            hold(block, wave, q, tau, wave.pieces[q, FINISH], state, legs)
    if state[SLIDES] > 0.0 and state[HELD] <= 0.0:
        state[HELD] = math.nan


@scalar
def recouple(block: Block, wave: Wave, q: int, p: int, tau: float, state: np.ndarray, legs: np.ndarray) -> None:
    """From the beginning of piece q (t5) to τ on piece p, integrating on."""
    for piece in range(q, min(p + 1, wave.pieces.shape[0])):
        if state[SLIDES] == 0.0:
            break
        end = tau if piece == p else wave.pieces[piece, FINISH]
        if end > wave.pieces[piece, BEGIN]:
            hold(block, wave, piece, wave.pieces[piece, BEGIN], end, state, legs)


@scalar
def follow_pulse(
    block: Block, options: Options, wave: Wave, legs: np.ndarray, k: int, following: int, velocity: float
) -> Pulse:
    """From Üg = Üy in stretch k to that in the `following` one, or to the end of the motion if none follows."""
    state = np.zeros(STATE_SIZE)
    p, tau = beginning(block, wave, k)
    x = max(block.amplitude * wave.pieces[p, FIRST], block.yield_acceleration)
    state[VELOCITY] = state[PEAK] = state[LEAST] = velocity
    state[HELD], state[SLIDES] = starting_acceleration(block, x), 1.0 if velocity > 0.0 else 0.0
    state[FOLLOWS] = 1.0 if block.rise == LITERAL else 0.0
    through_stretch(block, wave, k, p, tau, state, legs)
    if math.isnan(state[HELD]):
        return Pulse(0.0, math.nan, math.nan, 0.0, 0.0, KD_NOT_POSITIVE)
    if state[SLIDES] > 0.0:
        q, last = wave.stretch[k, 1], following >= wave.height.size
        p, tau = wave.pieces.shape[0], 0.0
        if not last:
            p, tau = beginning(block, wave, following)
        if options.recoupling == INTEGRATE:
            recouple(block, wave, q, p, tau, state, legs)
        started = wave.pieces[q, START] if q < wave.pieces.shape[0] else wave.pieces[q - 1, END]
        if options.recoupling == INTEGRATE:
            started = wave.pieces[wave.pieces.shape[0] - 1, END]
        if state[SLIDES] > 0.0 and (last or options.recoupling != INTEGRATE):
            duration = math.inf if last else phase_at(wave, p, tau) - started
            b = state[HELD]
            left, slid = attenuate(b, state[VELOCITY], duration)
            record(legs, ATTENUATE, 0, 0.0, started, started + min(duration, state[VELOCITY] / b), state)
            if left == 0.0:
                # Eq. 12 goes on beyond the shaking: where it ends there, the end of the shaking has not mattered
                state[RESTED] = started if options.recoupling != INTEGRATE else math.inf
            state[VELOCITY] = left
            state[DISPLACEMENT] += slid
            state[LEAST] = min(state[LEAST], left)
    return Pulse(
        state[VELOCITY], state[DISPLACEMENT], state[PEAK], min(state[LEAST], state[VELOCITY]), state[RESTED], 0
    )


train = train_of(follow_pulse)


@scalar
def zeros_of_relative_acceleration(block: Block, side: float, zeros: np.ndarray) -> int:
    """Where on the way from Üg = 0 to the peak of one side D changes its sign; their number, or −1 if not found."""
    count = 0
    x, end = math.copysign(0.0, side), side * block.amplitude
    for _ in range(zeros.size):
        target = next_break(block, x, end)
        inner = x + SLIVER * (target - x)
        if opposite(relative_acceleration(block, inner), relative_acceleration(block, target)):
            zeros[count] = relative_acceleration_root(block, inner, target)
            if math.isnan(zeros[count]):
                return -1
            count += 1
        x = target
        if x == end:
            break
    return count


@scalar
def continuous_cycle(
    block: Block, wave: Wave, c: int, p: int, tau: float, wants_peak: bool
) -> tuple[float, float, float]:
    """Eq. 4 from rest, τ on piece p, to the end of cycle c of the table: gains of V and W, the largest V."""
    zeros = np.empty((2, MOST_LEGS)) if wants_peak else np.empty((2, 0))
    up, down = 0, 0
    if wants_peak:
        up = zeros_of_relative_acceleration(block, 1.0, zeros[0])
        down = zeros_of_relative_acceleration(block, -1.0, zeros[1])
        if min(up, down) < 0:
            return math.nan, math.nan, math.nan
    velocity, displacement, peak = 0.0, 0.0, 0.0
    above, below, both = 0.0, 0.0, 0.0
    for q in range(p, wave.cycle[c + 1]):
        start, end = tau if q == p else wave.pieces[q, BEGIN], wave.pieces[q, FINISH]
        side = 1 if wave.pieces[q, TOP] > 0.0 else 0
        if wants_peak:
            least, most = sorted_pair(block.amplitude * wave.pieces[q, FIRST], block.amplitude * wave.pieces[q, LAST])
            for i in range(up if side == 1 else down):
                zero = zeros[1 - side, i]
                if least < zero < most:
                    at = offset_at(wave, q, block.amplitude, zero)
                    if at > start:
                        peak = max(peak, velocity + eq4_integrals(block, wave, q, start, at)[0])
        first, second, first_x, second_x = lag_integrals(block, wave, q, start, end)
        side_g = block.g if side == 1 else -block.g
        displacement += velocity * (end - start) + side_g * second + block.tan_theta * second_x
        if side == 1:
            above += first
        else:
            below += first
        both += first_x
        velocity = block.g * (above - below) + block.tan_theta * both
        peak = max(peak, velocity)
    return velocity, displacement, peak


@scalar
def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """The smaller and the larger of two numbers."""
    return (a, b) if a < b else (b, a)


@scalar
def continuous(block: Block, options: Options, wave: Wave) -> Motion:
    """Continuous sliding from the first Üg ≥ Üy on: Eq. 4 throughout.

    Cycles of one shape give the same gains from rest, so that the repeated ones are an arithmetic series.
    """
    k = first_pulse(block, wave, 0)
    if k >= wave.height.size:
        return Motion(0.0, 0.0, 0)
    p, tau = beginning(block, wave, k)
    velocity, displacement, peak = 0.0, 0.0, 0.0
    gain, moved, highest, known = 0.0, 0.0, 0.0, -1
    for c in range(wave.shape.size):
        if wave.cycle[c + 1] <= p:
            continue
        repeats = wave.repeats if wave.repeats > 0 and c == wave.lead else 1
        if wave.cycle[c] <= p:
            velocity, displacement, peak = continuous_cycle(block, wave, c, p, tau, options.wants_peak)
            repeats -= 1
        if repeats == 0:
            continue
        if wave.shape[c] != known:
            gain, moved, highest = continuous_cycle(
                block, wave, c, wave.cycle[c], wave.pieces[wave.cycle[c], BEGIN], options.wants_peak
            )
            known = wave.shape[c]
        later = repeats - 1.0
        peak = max(peak, max(velocity, velocity + later * gain) + highest)
        displacement += repeats * (moved + math.pi * (2.0 * velocity + gain * later))
        velocity += repeats * gain
    return Motion(displacement, peak if options.wants_peak else math.nan, 0)


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, wave: Wave, motion: np.ndarray, codes: np.ndarray
) -> None:
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity."""
    no_legs = np.empty((0, LEG_COLUMNS))
    for j in range(count):
        block = block_at(cells, j, options)
        codes[0, j], codes[1, j] = block.sliding_mode, block.validity
        motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
        if block.sliding_mode == CONTINUOUS:
            store_motion(continuous(block, options, wave), j, motion, codes)
        elif block.sliding_mode == STICK_SLIP:
            store_motion(train(block, options, wave, no_legs), j, motion, codes)
