"""A pulse from event to event: `rise`, `hold` and `follow` along one piece, and the train of all pulses.

State arrays have the rows of `slipsweep.kernels.pulse` and those of `cycle.legs`, (STATE_SIZE,); tables of pieces
are (pieces, columns).
docs/numerics.md#onset-and-switch, docs/numerics.md#stop and docs/numerics.md#trains-of-pulses
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels import linear
from slipsweep.kernels.block import (
    LITERAL,
    NEWMARK,
    Block,
    Options,
    opposite,
    relative_acceleration,
    relative_acceleration_root,
    response,
    response_and_slope,
    response_root,
    starting_acceleration,
)
from slipsweep.kernels.cycle.eq4 import eq4_integrals
from slipsweep.kernels.cycle.legs import (
    ATTENUATE,
    CREST,
    FOLLOW,
    HOLD,
    LEG_AT,
    LEG_END,
    LEG_FOLLOWS,
    MOST_LEGS,
    NEXT_FOLLOWS,
    ONSET,
    ONSET_FROM,
    Room,
    inside,
    log_leg,
    next_break,
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
    STOPPED_AT,
    VELOCITY,
    Pulse,
    begin_slide,
    pulse_of,
)
from slipsweep.kernels.train import train_of
from slipsweep.motion.pieces import BEGIN, COEFFICIENTS, DEGREE, FINISH, FIRST, LAST, Wave


@scalar
def onset(block: Block, x: float, top: float) -> float:
    """t1: where on the rise from x to `top` the block at rest starts to slide (`top` if it does not)."""
    if block.rise == NEWMARK:
        return x
    for _ in range(MOST_LEGS):
        if x >= top:
            break
        end = next_break(block, x, top)
        inner = inside(x, end)
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
        inner = inside(x, end)
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
def _followed_lost(where: tuple[Block, np.ndarray, int, float, float, np.ndarray], tau: float) -> tuple[float, float]:
    """−V at τ where b follows Eq. 4, and its rate."""
    block, pieces, p, velocity, start, state = where
    left = velocity + eq4_integrals(block, pieces, p, start, tau, state)[0]
    return -left, -relative_acceleration(block, plane(pieces, p, block.amplitude, tau))


_held_stop = root_of(_held_lost)

_followed_stop = root_of(_followed_lost)


@in_lanes
def advance(
    pieces: np.ndarray, p: int, end: float, stops: bool, gained: float, moved: float, width: float, state: np.ndarray
) -> None:
    """Add a leg's gains; where the block stops there, it is at rest from then on, and the next slide has its own b."""
    state[DISPLACEMENT] += state[VELOCITY] * width + moved
    state[VELOCITY] += gained
    if stops:
        state[VELOCITY] = state[SLIDES] = 0.0
        state[STOPPED_AT], state[LEG_END] = phase_at(pieces, p, end), -math.inf
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
    gained, moved = eq4_integrals(block, pieces, p, start, end, state)
    stops = state[VELOCITY] + gained <= 0.0
    if stops:
        velocity = state[VELOCITY]
        end = _followed_stop((block, pieces, p, velocity, start, state), start, end, 0.5 * (start + end), start)
        gained, moved = eq4_integrals(block, pieces, p, start, end, state)
    log_leg(legs, FOLLOW, p, start, phase_at(pieces, p, start), phase_at(pieces, p, end), state)
    advance(pieces, p, end, stops, gained, moved, end - start, state)
    return end


@in_lanes
def rise(block: Block, pieces: np.ndarray, legs: np.ndarray, p: int, tau: float, x: float, state: np.ndarray) -> None:
    """Along a piece on which the plane's acceleration rises, from x at τ on.

    Goes from event to event: the block stays with the plane (stick), holds b, or follows
    Eq. 4; each leg ends where that changes, where E or D turns, or where V turns or vanishes.
    Onset and legs depend on x alone, and are looked for up to the pulse's crest: a rise in many
    pieces, that of a record, looks for them once.
    """
    amplitude, literal = block.amplitude, block.rise == LITERAL
    top, finish = amplitude * pieces[p, LAST], pieces[p, FINISH]
    for _ in range(MOST_LEGS):
        if state[SLIDES] == 0.0:
            began = top
            if top > block.yield_acceleration:
                least = max(x, block.yield_acceleration)
                if not state[ONSET_FROM] <= least <= state[ONSET]:
                    state[ONSET_FROM], state[ONSET] = least, onset(block, least, state[CREST])
                began = state[ONSET]
            if began >= top:
                break
            if began > x:
                tau = max(tau, offset_at(pieces, p, amplitude, began))
            # at an onset beyond Üy Eq. 4 meets Üg: to evaluate it there would add the rounding of g μs
            beyond = began > max(x, block.yield_acceleration)
            b = began if beyond else min(starting_acceleration(block, began), began)
            begin_slide(b, phase_at(pieces, p, tau), state)
            x, state[FOLLOWS] = began, 1.0 if literal else 0.0
        if not (x == state[LEG_AT] and x < state[LEG_END]):
            end, follows, follows_on = rising_leg(block, x, state[CREST], state[HELD], state[FOLLOWS] > 0.0)
            state[LEG_END], state[LEG_FOLLOWS] = end, 1.0 if follows else 0.0
            state[NEXT_FOLLOWS] = 1.0 if follows_on else 0.0
        end, follows = min(state[LEG_END], top), state[LEG_FOLLOWS] > 0.0
        tau_end = finish if end >= top else max(tau, offset_at(pieces, p, amplitude, end))
        if follows:
            tau = follow(block, pieces, legs, p, tau, tau_end, state)
        else:
            tau = hold(block, pieces, legs, p, tau, tau_end, state)
        if state[SLIDES] == 0.0 and tau < tau_end:
            # where b follows Eq. 4 to the stop, D < 0 up to the end of the leg: no slide begins before
            x, tau = (end, tau_end) if follows else (plane(pieces, p, amplitude, tau), tau)
            continue
        x, tau = end, tau_end
        state[FOLLOWS] = state[NEXT_FOLLOWS] if end == state[LEG_END] else state[LEG_FOLLOWS]
        state[LEG_AT] = x
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


_pulse = pulse_of(rise, hold, note_attenuation)


@scalar
def pulse(block: Block, options: Options, wave: Wave, room: Room, k: int, following: int, velocity: float) -> Pulse:
    """A pulse from Üg = Üy in stretch k to that in the `following` one, entered with a velocity."""
    state = room.state
    state[CREST], state[LEG_END], state[ONSET] = block.amplitude * wave.height[k], -math.inf, -math.inf
    return _pulse(block, options, wave, room.legs, k, following, velocity, state)


train = train_of(pulse)
