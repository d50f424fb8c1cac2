"""The cycle solver: the response to any periodic shaking, event by event.

Between two events the block's acceleration is either held (polynomials of the phase) or follows
Eq. 4 (closed forms on a straight piece of the wave, Gauss-Legendre quadrature of a smooth function
on a curved one), so that no step is taken and the result carries rounding errors only.  The shaking
comes in monotone pieces (`excitation`).  Along one the block moves by `rise` (stick, slide and follow
Eq. 4; from t1 on) or by `hold` (to the stop, or to Üg = 0, t5); `pulse` goes through them and on by Eq. 12 or
the hold, and `train` strings pulses together.
In continuous sliding Eq. 4 is integrated over a cycle, and the cycles are a series.  The sine has shorter
ways to the same (`sine`).  Notation: τ is the phase on a piece, from its anchor, x the plane's acceleration,
b the block's, V and W velocity and displacement (see `block`).

Events need not be located to the last digit: at an onset the rate of V is zero, at a stop
V itself, so an error δ in an event's phase moves W by δ² or less.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar, summed
from slipsweep.jit.elementary import versine
from slipsweep.kernels import linear
from slipsweep.kernels.block import (
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
from slipsweep.kernels.pulse import (
    DISPLACEMENT,
    FOLLOWS,
    HELD,
    LEAST,
    PEAK,
    SLIDES,
    STATE_ROWS,
    STOPPED_AT,
    VELOCITY,
    Pulse,
    begin_slide,
    beginning,
    first_pulse,
    pulse_of,
    validity_before,
)
from slipsweep.kernels.train import train_of
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.motion.pieces import ARC, BEGIN, COEFFICIENTS, DEGREE, FINISH, FIRST, LAST, TERM, TOP, Wave

#: 16 Gauss-Legendre nodes and weights on [0, 1]: two SIMD registers.
NODES, WEIGHTS = ((a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True))

#: Where panels of the quadrature end, in e-foldings of the friction from the end where it is larger;
#: past the third it has decayed to 1e-18.
PANEL_BOUNDS = (6.0, 18.0, 42.0, math.inf)

#: Signs at the start of a leg are read this fraction of the leg inside it.
SLIVER = 1e-10

#: More legs than any rise has: five breaks, and a stop and an onset between each.
MOST_LEGS = 32


class Room(NamedTuple):
    """Where a block is followed: its state, a log of its legs, and zeros of D on either side of Üg = 0.

    One for all cells: a function that makes an array counts the references to every array it is handed.
    """

    state: np.ndarray
    legs: np.ndarray
    zeros: np.ndarray


#: Kinds of legs, and the columns of a log of them, which `history` samples: kind, piece, phase on
#: it and in the table at the start, phase at the end, b, V and W.
HOLD, FOLLOW, ATTENUATE = range(3)
LEG_COLUMNS = 8


@scalar
def room_of(legs: int) -> Room:
    """Room, with a log of so many legs; made in kernels, where the compiler knows that nothing else lies there."""
    return Room(np.zeros(STATE_ROWS), np.zeros((legs, LEG_COLUMNS)), np.empty((2, MOST_LEGS)))


@in_lanes
def log_leg(legs: np.ndarray, kind: int, piece: int, tau: float, start: float, end: float, state: np.ndarray) -> None:
    """Add a leg to a log whose first row counts them; a sweep keeps none and gives an empty one."""
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
    whole, early, late, both = linear.exponential_moments(block.decay_rate / block.g * abs(change))
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
def at_nodes(pieces: np.ndarray, p: int, amplitude: float, start: float, width: float, x: np.ndarray) -> None:
    """Fill in |Üg| at the nodes of the quadrature from `start` on: power by power, so that the nodes are lanes."""
    top = pieces[p, TOP]
    if pieces[p, ARC] > 0.0:
        for node in range(NODES.size):
            x[node] = amplitude * (1.0 - versine(start + width * NODES[node]))
        return
    for node in range(NODES.size):
        x[node] = 0.0
    for k in range(int(pieces[p, DEGREE]) - 1, -1, -1):
        coefficient = pieces[p, COEFFICIENTS + TERM * k]
        for node in range(NODES.size):
            x[node] = (x[node] + coefficient) * (start + width * NODES[node])
    for node in range(NODES.size):
        x[node] = amplitude * abs(top + x[node])


@summed
def lag_integrals(
    block: Block, pieces: np.ndarray, p: int, start: float, end: float
) -> tuple[float, float, float, float]:
    """What Eq. 4 takes the block behind the plane over a part of piece p.

    ∫ (μs − μ) dτ and ∫ |x| (μs − tan θ − μ) dτ, each followed by itself with the weight end − τ: on
    the side ±1 of Üg = 0 the relative acceleration is D = ±g (μs − μ) + tan θ |x| (μs − tan θ − μ).
    Apart, because over a symmetric cycle the first must cancel to the last digit.
    """
    amplitude = block.amplitude
    x_start, x_end = abs(plane(pieces, p, amplitude, start)), abs(plane(pieces, p, amplitude, end))
    if int(pieces[p, DEGREE]) <= 1:
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
            until = offset_at(pieces, p, amplitude, math.copysign(least + bound / decay, pieces[p, TOP]))
        width = until - near
        at_nodes(pieces, p, amplitude, near, width, values)
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
def eq4_integrals(block: Block, pieces: np.ndarray, p: int, start: float, end: float) -> tuple[float, float]:
    """∫ D dτ and ∫ (end − τ) D dτ over a part of piece p: gains of V and W from rest."""
    first, second, first_x, second_x = lag_integrals(block, pieces, p, start, end)
    side_g = math.copysign(block.g, pieces[p, TOP])
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


@in_lanes
def rising_leg(block: Block, x: float, top: float, b: float, follows: bool) -> tuple[float, bool, bool]:
    """The next leg of a slide on the rise from x to `top`: its end, whether b follows Eq. 4 on it, and from there on.

    A leg ends where that changes, where E or D turns, and where D changes its sign.
    """
    end, crosses = top, False
    if block.rise != NEWMARK:
        end = next_break(block, x, top)
        inner = x + SLIVER * (end - x)
        eq4, slope = response_and_slope(block, inner)
        if block.rise != LITERAL:
            follows = slope > 0.0 and (follows or eq4 >= b)
        if not follows and slope > 0.0 and response(block, end) > b:
            end = response_root(block, b, inner, end)
            crosses = True
        if follows and opposite(relative_acceleration(block, inner), relative_acceleration(block, end)):
            end = relative_acceleration_root(block, inner, end)
    if not follows and x < b < end and block.rise != NEWMARK:  # there the hold itself finds where V turns
        end = b
        crosses = False
    return end, follows, follows or crosses


@scalar
def _held_lost(where: tuple[Block, np.ndarray, int, float, float, float], tau: float) -> tuple[float, float]:
    """−V at τ of a hold that V entered at `start`, and its rate."""
    block, pieces, p, held, velocity, start = where
    left = velocity + held_gain(pieces, p, block.amplitude, held, start, tau)
    return -left, held - plane(pieces, p, block.amplitude, tau)


@scalar
def _followed_lost(where: tuple[Block, np.ndarray, int, float, float], tau: float) -> tuple[float, float]:
    """−V at τ where b follows Eq. 4, and its rate."""
    block, pieces, p, velocity, start = where
    left = velocity + eq4_integrals(block, pieces, p, start, tau)[0]
    return -left, -relative_acceleration(block, plane(pieces, p, block.amplitude, tau))


_held_stop = root_of(_held_lost)
_followed_stop = root_of(_followed_lost)


@in_lanes
def advance(
    pieces: np.ndarray, p: int, end: float, stops: bool, gained: float, moved: float, width: float, state: np.ndarray
) -> None:
    """Add a leg's gains; where the block stops there, it is at rest from then on."""
    state[DISPLACEMENT] += state[VELOCITY] * width + moved
    state[VELOCITY] += gained
    if stops:
        state[VELOCITY] = state[SLIDES] = 0.0
        state[STOPPED_AT] = phase_at(pieces, p, end)
    state[PEAK] = max(state[PEAK], state[VELOCITY])
    state[LEAST] = min(state[LEAST], state[VELOCITY])


@in_lanes
def hold(
    block: Block, pieces: np.ndarray, legs: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> float:
    """Slide with b held along piece p from start to end, or to the stop: where that is."""
    amplitude, held, velocity = block.amplitude, state[HELD], state[VELOCITY]
    # most legs are whole pieces, whose ends are known
    rate = amplitude * pieces[p, FIRST] if start == pieces[p, BEGIN] else plane(pieces, p, amplitude, start)
    rate_end = amplitude * pieces[p, LAST] if end == pieces[p, FINISH] else plane(pieces, p, amplitude, end)
    rate -= held
    rate_end -= held
    width, slope, straight = end - start, amplitude * pieces[p, COEFFICIENTS], pieces[p, DEGREE] <= 1.0
    if straight:
        gained, moved = linear.held_integrals(rate, slope, width)
    else:
        gained, moved = held_integrals(pieces, p, amplitude, held, start, end)
    low, high = start, end
    stops = velocity + gained <= 0.0
    if rate_end >= 0.0 and (rate >= 0.0 or velocity <= 0.0):
        # nothing slows it: over a leg so short that its gain is rounding, it does not stop
        stops, gained = False, max(gained, 0.0)
    if opposite(rate, rate_end) and (rate > 0.0 or velocity > 0.0):
        # V turns where x = b; one that starts from rest there only seems to fall, by rounding
        if straight:
            turn = start - rate / slope
            extreme = velocity - 0.5 * rate * (rate / slope)
        else:
            turn = offset_at(pieces, p, amplitude, held)
            extreme = velocity + held_gain(pieces, p, amplitude, held, start, turn)
        if rate > 0.0:
            state[PEAK] = max(extreme, state[PEAK])  # in this order a NaN is kept
            low = turn
        else:
            state[LEAST] = min(extreme, state[LEAST])
            stops, high = extreme <= 0.0, turn
    if stops:
        end = start
        if straight:
            width = min(linear.held_stop(velocity, rate, slope), width) if velocity > 0.0 or rate > 0.0 else 0.0
            end = start + width
            gained, moved = linear.held_integrals(rate, slope, width)
        else:
            if velocity > 0.0 or rate > 0.0:
                end = _held_stop((block, pieces, p, held, velocity, start), low, high, 0.5 * (low + high), start)
            width = end - start
            gained, moved = held_integrals(pieces, p, amplitude, held, start, end)
    log_leg(legs, HOLD, p, start, phase_at(pieces, p, start), phase_at(pieces, p, end), state)
    advance(pieces, p, end, stops, gained, moved, width, state)
    return end


@scalar
def follow(
    block: Block, pieces: np.ndarray, legs: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> float:
    """Slide under Eq. 4 along piece p, on which D keeps its sign, from start to end or to the stop: where that is."""
    gained, moved = eq4_integrals(block, pieces, p, start, end)
    stops = state[VELOCITY] + gained <= 0.0
    if stops:
        velocity = state[VELOCITY]
        end = _followed_stop((block, pieces, p, velocity, start), start, end, 0.5 * (start + end), start)
        gained, moved = eq4_integrals(block, pieces, p, start, end)
    log_leg(legs, FOLLOW, p, start, phase_at(pieces, p, start), phase_at(pieces, p, end), state)
    advance(pieces, p, end, stops, gained, moved, end - start, state)
    return end


@in_lanes
def rise(block: Block, pieces: np.ndarray, legs: np.ndarray, p: int, tau: float, x: float, state: np.ndarray) -> None:
    """Along a piece on which the plane's acceleration rises, from x at τ on.

    Goes from event to event: the block stays with the plane (stick), holds b, or follows
    Eq. 4; each leg ends where that changes, where E or D turns, or where V turns or vanishes.
    """
    amplitude, literal = block.amplitude, block.rise == LITERAL
    top, finish = amplitude * pieces[p, LAST], pieces[p, FINISH]
    for _ in range(MOST_LEGS):
        if state[SLIDES] == 0.0:
            began = top
            if top > block.yield_acceleration:
                began = onset(block, max(x, block.yield_acceleration), top)
            if began >= top:
                break
            if began > x:
                tau = max(tau, offset_at(pieces, p, amplitude, began))
            # at an onset beyond Üy Eq. 4 meets Üg: to evaluate it there would add the rounding of g μs
            beyond = began > max(x, block.yield_acceleration)
            b = began if beyond else min(starting_acceleration(block, began), began)
            begin_slide(b, phase_at(pieces, p, tau), state)
            x, state[FOLLOWS] = began, 1.0 if literal else 0.0
        end, follows, follows_on = rising_leg(block, x, top, state[HELD], state[FOLLOWS] > 0.0)
        tau_end = finish if end >= top else max(tau, offset_at(pieces, p, amplitude, end))
        if follows:
            tau = follow(block, pieces, legs, p, tau, tau_end, state)
        else:
            tau = hold(block, pieces, legs, p, tau, tau_end, state)
        if state[SLIDES] == 0.0 and tau < tau_end:
            x = plane(pieces, p, amplitude, tau)
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
def note_attenuation(legs: np.ndarray, start: float, end: float, state: np.ndarray) -> None:
    """Add a leg of Eq. 12 to the log of legs."""
    log_leg(legs, ATTENUATE, 0, 0.0, start, end, state)


pulse = pulse_of(rise, hold, note_attenuation)


@scalar
def follow_pulse(
    block: Block, options: Options, wave: Wave, room: Room, k: int, following: int, velocity: float
) -> Pulse:
    """A pulse of a train (see `train`)."""
    return pulse(block, options, wave, room.legs, k, following, velocity, room.state)


train = train_of(follow_pulse)


@scalar
def zeros_of_relative_acceleration(block: Block, end: float, zeros: np.ndarray) -> int:
    """Where on the way from Üg = 0 to `end` D changes its sign; their number, or −1 if one is not found."""
    count = 0
    x = math.copysign(0.0, end)
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
def follow_through(
    block: Block, wave: Wave, p: int, tau: float, until: int, tau_until: float, wants_peak: bool, zeros: np.ndarray
) -> tuple[float, float, float]:
    """Eq. 4 from rest, τ on piece p, to `tau_until` on piece `until`: gains of V and W, the largest V."""
    up, down = 0, 0
    if wants_peak:
        up = zeros_of_relative_acceleration(block, block.amplitude * wave.highest, zeros[0])
        down = zeros_of_relative_acceleration(block, block.amplitude * wave.lowest, zeros[1])
        if min(up, down) < 0:
            return math.nan, math.nan, math.nan
    velocity, displacement, peak = 0.0, 0.0, 0.0
    above, below, both = 0.0, 0.0, 0.0
    for q in range(p, min(until + 1, wave.pieces.shape[0])):
        start = tau if q == p else wave.pieces[q, BEGIN]
        end = tau_until if q == until else wave.pieces[q, FINISH]
        if end <= start:
            continue
        side = 1 if wave.pieces[q, TOP] > 0.0 else 0
        if wants_peak:
            least, most = sorted_pair(block.amplitude * wave.pieces[q, FIRST], block.amplitude * wave.pieces[q, LAST])
            for i in range(up if side == 1 else down):
                zero = zeros[1 - side, i]
                if least < zero < most:
                    at = offset_at(wave.pieces, q, block.amplitude, zero)
                    if start < at < end:
                        peak = max(peak, velocity + eq4_integrals(block, wave.pieces, q, start, at)[0])
        first, second, first_x, second_x = lag_integrals(block, wave.pieces, q, start, end)
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
def continuous_cycle(
    block: Block, wave: Wave, c: int, p: int, tau: float, wants_peak: bool, zeros: np.ndarray
) -> tuple[float, float, float]:
    """`follow_through` from τ on piece p to the end of cycle c of the table."""
    until = wave.cycle[c + 1]
    tau_until = wave.pieces[until, BEGIN] if until < wave.pieces.shape[0] else 0.0
    return follow_through(block, wave, p, tau, until, tau_until, wants_peak, zeros)


@scalar
def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """The smaller and the larger of two numbers."""
    return (a, b) if a < b else (b, a)


@scalar
def continuous(block: Block, options: Options, wave: Wave, zeros: np.ndarray) -> Motion:
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
            velocity, displacement, peak = continuous_cycle(block, wave, c, p, tau, options.wants_peak, zeros)
            repeats -= 1
        if repeats == 0:
            continue
        if wave.shape[c] != known:
            gain, moved, highest = continuous_cycle(
                block, wave, c, wave.cycle[c], wave.pieces[wave.cycle[c], BEGIN], options.wants_peak, zeros
            )
            known = wave.shape[c]
        later = repeats - 1.0
        peak = max(peak, max(velocity, velocity + later * gain) + highest)
        displacement += repeats * (moved + math.pi * (2.0 * velocity + gain * later))
        velocity += repeats * gain
    return Motion(displacement, peak if options.wants_peak else math.nan, 0)


def solver_of(
    continuous: Callable[[Block, Options, Wave, np.ndarray], Motion],
) -> Callable[[np.ndarray, int, Options, Wave, Room, np.ndarray, np.ndarray], None]:
    """The jitted solver of a tile's cells, one by one, given how one slides continuously."""

    @scalar
    def solve_cells(
        cells: np.ndarray, count: int, options: Options, wave: Wave, room: Room, motion: np.ndarray, codes: np.ndarray
    ) -> None:
        """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity."""
        for j in range(count):
            block = block_at(cells, j, options)
            codes[0, j], codes[1, j] = block.sliding_mode, validity_before(block, wave)
            motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
            if block.sliding_mode == CONTINUOUS:
                store_motion(continuous(block, options, wave, room.zeros), j, motion, codes)
            elif block.sliding_mode == STICK_SLIP:
                store_motion(train(block, options, wave, room), j, motion, codes)

    return solve_cells


solve_cells = solver_of(continuous)
