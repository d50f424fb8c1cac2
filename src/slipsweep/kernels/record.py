"""The response to a recorded motion, joined by straight lines: pulse by pulse, piece by piece.

The motion rules are those of a harmonic motion (docs/model.md), extended (docs/records.md): a
pulse is an excursion of the plane's acceleration above zero that exceeds Üy; Eq. 7 with the
pulse's own peak decides whether the block sticks and slips in it or slides continuously, and
Eqs. 8-11 with that peak give its friction.  Between two events the motion is a closed form
(`linear`), so that the answer carries rounding errors only.

A place on the record is (i, x, rest): on the piece from sample i to the next, at plane
acceleration x, with the time `rest` left of the piece.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.cache import Kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    EQ4_BELOW_YIELD,
    FRICTION_NOT_DECAYING,
    INTEGRATE,
    KD_NOT_POSITIVE,
    LIMIT_UNDEFINED,
    LITERAL,
    NEWMARK,
    NO_VALUE,
    NOT_RECOUPLED,
    STATICALLY_UNSTABLE,
    TILE,
    UPLIFT,
    Block,
    Cell,
    Options,
    block_of,
    cell_of,
    opposite,
    relative_acceleration,
    relative_acceleration_root,
    response,
    starting_acceleration,
    stays_below_yield,
)
from slipsweep.kernels.cycle import next_break, onset, rising_leg, straight_lag
from slipsweep.kernels.events import root_of
from slipsweep.kernels.grid import Grid, empty_runs, gather, place_of
from slipsweep.kernels.linear import held_integrals, held_stop
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS

#: More legs than a piece has: breaks of Eq. 4, and a stop and an onset between each.
_MOST_LEGS = 64

#: Signs at the start of a leg are read this fraction of the leg inside it.
_SLIVER = 1e-10


class History(NamedTuple):
    """A record at scale 1, and its positive half waves: their first and last samples above zero, and their peaks."""

    times: np.ndarray
    values: np.ndarray
    first: np.ndarray
    last: np.ndarray
    peak: np.ndarray
    lowest: float


class Response(NamedTuple):
    """What a block does: displacement, largest velocity, slips from rest, pulses by mode, flags."""

    displacement: float
    peak_velocity: float
    slips: int
    stick_slips: int
    continuous: int
    validity: int


# A moving block is a small array, which functions can change: rows of it.
VELOCITY, DISPLACEMENT, PEAK, HELD, SLIDES, FOLLOWS, SLIPS = range(7)
_STATE_SIZE = 7


@scalar
def slope_of(history: History, scale: float, i: int) -> float:
    """Rate of the plane's acceleration on piece i."""
    return scale * (history.values[i + 1] - history.values[i]) / (history.times[i + 1] - history.times[i])


@scalar
def follow_integrals(block: Block, x: float, slope: float, duration: float, side: float) -> tuple[float, float]:
    """Gains of velocity and displacement under Eq. 4 from plane acceleration x on, on one `side` (±1) of Üg = 0."""
    first, second, first_x, second_x = straight_lag(block, abs(x), side * slope * duration, duration)
    side_g = side * block.g
    return side_g * first + block.tan_theta * first_x, side_g * second + block.tan_theta * second_x


@scalar
def _followed_lost(where: tuple[Block, float, float, float], t: float) -> tuple[float, float]:
    block, x, slope, velocity = where
    left = velocity + follow_integrals(block, x, slope, t, 1.0)[0]
    return -left, -relative_acceleration(block, x + slope * t)


_followed_stop = root_of(_followed_lost)


@scalar
def follow_stop(block: Block, x: float, slope: float, duration: float, velocity: float) -> float:
    """When, within `duration`, a velocity that falls under Eq. 4 (x > 0) is zero."""
    return _followed_stop((block, x, slope, velocity), 0.0, duration, 0.5 * duration, 0.0)


@scalar
def advance(state: np.ndarray, gained: float, moved: float, duration: float) -> None:
    """Add a leg's gains."""
    state[DISPLACEMENT] += state[VELOCITY] * duration + moved
    state[VELOCITY] += gained
    state[PEAK] = max(state[PEAK], state[VELOCITY])


@scalar
def rest(state: np.ndarray) -> None:
    """The block has come to rest against the plane."""
    state[VELOCITY] = state[SLIDES] = 0.0


@scalar
def brake(state: np.ndarray, duration: float) -> None:
    """Eq. 12 for `duration`: the velocity, of either sign, is taken to zero at the rate b."""
    speed, b = abs(state[VELOCITY]), state[HELD]
    side = math.copysign(1.0, state[VELOCITY])
    if speed <= b * duration:
        state[DISPLACEMENT] += side * 0.5 * speed * speed / b
        rest(state)
    else:
        state[DISPLACEMENT] += side * (speed - 0.5 * b * duration) * duration
        state[VELOCITY] = side * (speed - b * duration)


@scalar
def hold(state: np.ndarray, x: float, slope: float, duration: float) -> float:
    """Slide with b held for `duration`, or until the stop: the time it took."""
    b = state[HELD]
    rate = x - b
    stop = held_stop(state[VELOCITY], rate, slope)
    taken = min(stop, duration)
    if rate > 0.0 and slope < 0.0 and -rate / slope < taken:
        crest = state[VELOCITY] - 0.5 * rate * rate / slope
        state[PEAK] = max(state[PEAK], crest)
    gained, moved = held_integrals(x, slope, b, taken)
    advance(state, gained, moved, taken)
    if stop <= duration:
        rest(state)
    return taken


@scalar
def hold_through(state: np.ndarray, history: History, scale: float, i: int, x: float, left: float, until: int) -> None:
    """Slide with b held from a place on to sample `until`, or to the stop."""
    while i < until and state[SLIDES] > 0.0:
        hold(state, x, slope_of(history, scale, i), left)
        i += 1
        if i < until:
            x, left = scale * history.values[i], history.times[i + 1] - history.times[i]


@scalar
def rise_piece(block: Block, state: np.ndarray, x: float, top: float, slope: float, left: float) -> None:
    """On a piece along which the plane's acceleration does not fall, x to `top` in the time `left`."""
    literal = block.rise == LITERAL
    for _ in range(_MOST_LEGS):
        if state[SLIDES] == 0.0:
            # at rest, below Üy, nothing begins
            if top <= block.yield_acceleration:
                break
            if x < block.yield_acceleration:
                left -= (block.yield_acceleration - x) / slope
                x = block.yield_acceleration
        if slope == 0.0:
            _flat_piece(block, state, x, left)
            break
        if state[SLIDES] == 0.0:
            began = onset(block, x, top)
            if began >= top:
                break
            left -= (began - x) / slope
            x = began
            state[HELD] = min(starting_acceleration(block, x), x)  # equal at an onset, but for rounding
            state[SLIDES], state[FOLLOWS] = 1.0, 1.0 if literal else 0.0
            state[SLIPS] += 1.0
        elif not literal:
            # where a fall before it has left b below what Eq. 4 asks at the beginning of the rise
            state[HELD] = max(state[HELD], response(block, x))
        end, follows, follows_on = rising_leg(block, x, top, state[HELD], state[FOLLOWS] > 0.0)
        duration = left if end == top else min((end - x) / slope, left)
        if follows:
            gained, moved = follow_integrals(block, x, slope, duration, 1.0)
            if state[VELOCITY] + gained <= 0.0 and (state[VELOCITY] > 0.0 or gained < 0.0):
                taken = follow_stop(block, x, slope, duration, state[VELOCITY])
                gained, moved = follow_integrals(block, x, slope, taken, 1.0)
                advance(state, gained, moved, taken)
                rest(state)
            else:
                taken = duration
                advance(state, gained, moved, taken)
                state[HELD] = response(block, end)
        else:
            taken = hold(state, x, slope, duration)
        left -= taken
        if state[SLIDES] == 0.0 and taken < duration:
            x += slope * taken
            continue
        x = end
        state[FOLLOWS] = 1.0 if follows_on else 0.0
        if x >= top:
            break


@scalar
def _flat_piece(block: Block, state: np.ndarray, x: float, left: float) -> None:
    """On a piece of constant acceleration: "not falling", so that b is what a rise would have it."""
    if state[SLIDES] == 0.0:
        b = starting_acceleration(block, x)
        if b >= x:
            return
        state[HELD], state[SLIDES] = b, 1.0
        state[SLIPS] += 1.0
    elif block.rise == LITERAL:
        state[HELD] = response(block, x)
    elif block.rise != NEWMARK:
        state[HELD] = max(state[HELD], response(block, x))
    hold(state, x, 0.0, left)


@scalar
def stick_slip_pulse(
    block: Block, state: np.ndarray, history: History, scale: float, wave: int, i: int, x: float, left: float
) -> tuple[int, float]:
    """A stick-slip pulse from its beginning to Üg = 0 (t5), which is on piece `i` returned, with the time then left."""
    # v never goes below 0: a velocity upslope, left by a continuous pulse, is neglected
    state[VELOCITY] = max(state[VELOCITY], 0.0)
    state[HELD] = starting_acceleration(block, x)
    state[SLIDES] = 1.0 if state[VELOCITY] > 0.0 else 0.0
    state[FOLLOWS] = 1.0 if block.rise == LITERAL else 0.0
    if state[SLIDES] == 0.0 and state[HELD] < x:
        # the onset is at the beginning itself, or the record starts above it: a rise at once
        state[SLIDES] = 1.0
        state[SLIPS] += 1.0
    last = history.last[wave]
    pieces = history.values.size - 1
    while i < pieces:
        slope = slope_of(history, scale, i)
        end = scale * history.values[i + 1]
        if i == last:
            end = 0.0
        if end >= x:
            rise_piece(block, state, x, end, slope, left)
        else:
            duration = -x / slope if i == last else left
            state[FOLLOWS] = 1.0 if block.rise == LITERAL else 0.0
            if state[SLIDES] > 0.0:
                hold(state, x, slope, duration)
            if i == last:
                return i, max(left - duration, 0.0)
        i += 1
        if i < pieces:
            x, left = scale * history.values[i], history.times[i + 1] - history.times[i]
    return pieces, 0.0


@scalar
def follow_leg(
    block: Block, state: np.ndarray, x: float, end: float, slope: float, duration: float, side: float
) -> None:
    """Eq. 4 along a part of a piece on one side of Üg = 0, the velocity of either sign."""
    if slope != 0.0:
        # V peaks where its rate D changes sign; E and D are monotone between breaks, from zero outwards
        low, high = (x, end) if abs(x) < abs(end) else (end, x)
        for _ in range(_MOST_LEGS):
            target = next_break(block, low, high)
            inner = low + _SLIVER * (target - low)
            if opposite(relative_acceleration(block, inner), relative_acceleration(block, target)):
                zero = relative_acceleration_root(block, inner, target)
                gained = follow_integrals(block, x, slope, (zero - x) / slope, side)[0]
                state[PEAK] = max(state[PEAK], state[VELOCITY] + gained)
            low = target
            if low == high:
                break
    gained, moved = follow_integrals(block, x, slope, duration, side)
    advance(state, gained, moved, duration)


@scalar
def follow_through(
    block: Block, state: np.ndarray, history: History, scale: float, i: int, x: float, left: float, until: int
) -> None:
    """Eq. 4 from a place on to sample `until`."""
    while i < until:
        slope, end = slope_of(history, scale, i), scale * history.values[i + 1]
        if opposite(x, end):
            duration = min(-x / slope, left)
            follow_leg(block, state, x, math.copysign(0.0, x), slope, duration, math.copysign(1.0, x))
            x, left = math.copysign(0.0, end), left - duration
        side = math.copysign(1.0, end if x == 0.0 else x)
        follow_leg(block, state, math.copysign(x, side), math.copysign(end, side), slope, left, side)
        i += 1
        if i < until:
            x, left = end, history.times[i + 1] - history.times[i]


@scalar
def begin_of(history: History, scale: float, wave: int, threshold: float) -> tuple[int, float, float]:
    """The place at which a half wave first reaches `threshold`: the beginning of its pulse."""
    i = history.first[wave]
    while scale * history.values[i] <= threshold:
        i += 1
    if i == 0:
        step = history.times[1] - history.times[0] if history.values.size > 1 else 0.0
        return 0, scale * history.values[0], step
    return i - 1, threshold, (scale * history.values[i] - threshold) / slope_of(history, scale, i - 1)


@scalar
def bottom_of(history: History, wave: int) -> int:
    """Where the negative half wave after a positive one ends: its last sample (the sample after, if there is none)."""
    pieces = history.values.size - 1
    i = min(history.last[wave] + 1, pieces)
    while i < pieces and history.values[i + 1] < 0.0:
        i += 1
    return i


@scalar
def rises_from(history: History, bottom: int, wave: int) -> bool:
    """Whether a half wave follows the negative one that ends at sample `bottom` at once, with no rest at zero."""
    between = history.first[wave] - bottom
    return between == 1 or (between == 2 and history.values[bottom + 1] == 0.0 and history.values[bottom] < 0.0)


@scalar
def follow_up(
    block: Block, state: np.ndarray, history: History, scale: float, bottom: int, i: int, x: float, left: float
) -> None:
    """Eq. 4 from sample `bottom` up to a place, where the next pulse begins."""
    follow_through(
        block, state, history, scale, bottom, scale * history.values[bottom],
        history.times[bottom + 1] - history.times[bottom], i,
    )  # fmt: skip
    slope, start = slope_of(history, scale, i), scale * history.values[i]
    duration = history.times[i + 1] - history.times[i] - left
    if start < 0.0:
        below = min(-start / slope, duration)
        follow_leg(block, state, start, -0.0, slope, below, -1.0)
        start, duration = 0.0, duration - below
    follow_leg(block, state, start, x, slope, duration, 1.0)


@scalar
def mendez(cell: Cell, options: Options, history: History) -> Response:
    """The paper's model, pulse by pulse; `cell.amplitude` is the scale."""
    scale = cell.amplitude
    highest = 0.0
    for peak in history.peak:
        highest = max(highest, peak)
    largest = scale * max(highest, -history.lowest)
    block = block_of(_at_peak(cell, largest), options.rise, options.g)
    validity = block.validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED)
    # n = g + Üg tan θ is least where the plane's acceleration is lowest
    if eq.normal_acceleration(scale * history.lowest, cell.tan_theta, options.g) <= 0.0:
        validity |= UPLIFT
    if validity:
        return Response(math.nan, math.nan, -1, -1, -1, validity)
    threshold = block.yield_acceleration
    state = np.zeros(_STATE_SIZE)
    stick_slips, continuous = 0, 0
    # the place and the state that the pulse before has left: what happens up to the next beginning
    pieces, waves = history.values.size - 1, history.peak.size
    wave = 0
    while wave < waves and scale * history.peak[wave] <= threshold:
        wave += 1
    if wave == waves:
        return Response(0.0, 0.0, 0, 0, 0, 0)
    i, x, left = begin_of(history, scale, wave, threshold)
    while wave < waves:
        following = wave + 1
        while following < waves and scale * history.peak[following] <= threshold:
            following += 1
        block = block_of(_at_peak(cell, scale * history.peak[wave]), options.rise, options.g)
        validity |= block.validity & FRICTION_NOT_DECAYING
        next_i, next_x, next_left = pieces, 0.0, 0.0
        if following < waves:
            next_i, next_x, next_left = begin_of(history, scale, following, threshold)
        end = history.times[pieces] if following == waves else history.times[next_i + 1] - next_left
        # not the block's own mode, which is missing where the harmonic motion of that peak would uplift
        if eq.sliding_mode(block.amplitude, threshold, block.limiting_acceleration) == CONTINUOUS:
            continuous += 1
            if state[VELOCITY] == 0.0:
                state[SLIPS] += 1.0
            state[PEAK] = max(state[PEAK], state[VELOCITY])
            state[SLIDES] = 1.0
            bottom = bottom_of(history, wave)
            follow_through(block, state, history, scale, i, x, left, bottom)
            if following == wave + 1 and following < waves and rises_from(history, bottom, following):
                follow_up(block, state, history, scale, bottom, next_i, next_x, next_left)
            else:
                # no pulse follows at once: Eq. 4 up to the rise to zero, then Eq. 12 with the pulse's Ümax
                since = history.times[bottom]
                if bottom < pieces and history.values[bottom] < 0.0:
                    slope, x_last = slope_of(history, scale, bottom), scale * history.values[bottom]
                    duration = -x_last / slope
                    follow_leg(block, state, x_last, -0.0, slope, duration, -1.0)
                    since += duration
                state[HELD] = response(block, block.amplitude)
                if end > since:
                    brake(state, end - since)
        else:
            stick_slips += 1
            if stays_below_yield(block, threshold, block.amplitude):
                validity |= EQ4_BELOW_YIELD
            if block.rise == LITERAL and response(block, block.amplitude) <= 0.0:
                validity |= KD_NOT_POSITIVE
            at, over = stick_slip_pulse(block, state, history, scale, wave, i, x, left)
            if state[SLIDES] > 0.0 and state[HELD] <= 0.0:
                validity |= KD_NOT_POSITIVE
            if validity & NO_VALUE:
                return Response(math.nan, math.nan, -1, -1, -1, validity)
            if state[SLIDES] > 0.0 and at < pieces:
                if options.recoupling == INTEGRATE:
                    hold_through(state, history, scale, at, 0.0, over, next_i)
                    if state[SLIDES] > 0.0 and following < waves:
                        slope, x_last = slope_of(history, scale, next_i), scale * history.values[next_i]
                        hold(state, x_last, slope, (next_x - x_last) / slope)
                else:
                    brake(state, end - (history.times[at + 1] - over))
            if state[SLIDES] > 0.0 and following < waves:
                validity |= NOT_RECOUPLED
        if validity & NO_VALUE:
            return Response(math.nan, math.nan, -1, -1, -1, validity)
        wave, i, x, left = following, next_i, next_x, next_left
    if state[VELOCITY] != 0.0:
        brake(state, math.inf)  # the plane is at rest
    return Response(state[DISPLACEMENT], state[PEAK], int(state[SLIPS]), stick_slips, continuous, validity)


@scalar
def _at_peak(cell: Cell, peak: float) -> Cell:
    """The cell with a pulse's peak as its amplitude."""
    return Cell(
        cell.tan_theta, cell.mu_s, peak, cell.yield_acceleration, cell.decay_rate, cell.delta_mu, cell.minimum_friction
    )


@scalar
def newmark(cell: Cell, options: Options, history: History) -> Response:
    """The classical rigid block, downslope only: b = Üy from Üg = Üy on until the velocity is zero.

    In units of the scale (`cell.amplitude`), by which everything is multiplied at the end.
    """
    scale = cell.amplitude
    yield_acceleration = block_of(cell, NEWMARK, options.g).yield_acceleration
    if yield_acceleration <= 0.0:
        return Response(math.nan, math.nan, -1, -1, -1, STATICALLY_UNSTABLE)
    threshold = yield_acceleration / scale
    times, values = history.times, history.values
    pieces, waves = values.size - 1, history.peak.size
    velocity, displacement, peak = 0.0, 0.0, 0.0
    slips, pulses, validity = 0, 0, 0
    i = 0  # no sample before has to be looked at
    for wave in range(waves):
        if history.peak[wave] <= threshold:
            continue
        pulses += 1
        i = max(i, history.first[wave])
        while i <= history.last[wave]:
            rate = values[i] - threshold
            if rate <= 0.0:
                i += 1
                continue
            slips += 1
            if i > 0:
                rising = rate * (times[i] - times[i - 1]) / (values[i] - values[i - 1])
                velocity, moved = 0.5 * rate * rising, rate * rising * rising / 6.0
                displacement += moved
            slides = True
            while slides and i < pieces:
                rate, after = values[i] - threshold, values[i + 1] - threshold
                step = times[i + 1] - times[i]
                if rate < 0.0 or after < 0.0:
                    slope = (after - rate) / step
                    if rate > 0.0:
                        peak = max(peak, velocity - 0.5 * rate * rate / slope)
                    stop = held_stop(velocity, rate, slope)
                    if stop <= step:
                        slides = False
                        displacement += (velocity + (0.5 * rate + slope * stop / 6.0) * stop) * stop
                        velocity = 0.0
                if slides:
                    displacement += (velocity + (rate / 3.0 + after / 6.0) * step) * step
                    velocity += 0.5 * (rate + after) * step
                    peak = max(peak, velocity)
                i += 1
            if slides:  # the record has ended
                displacement += 0.5 * velocity * velocity / threshold
                peak = max(peak, velocity)
                velocity = 0.0
                i = pieces + 1
    if slips:
        validity |= EQ4_BELOW_YIELD  # its yield value always governs
    return Response(scale * displacement, scale * peak, slips, pulses, 0, validity)


def _record_grid(
    grid: Grid, first: int, last: int, inputs: tuple[np.ndarray, ...], options: Options, history: History,
    motion: np.ndarray, counts: np.ndarray, validity: np.ndarray,
) -> None:  # fmt: skip
    cells, runs = np.empty(7 * TILE), empty_runs(grid)
    for begin in range(first, last, TILE):
        found = gather(grid, begin, min(TILE, last - begin), inputs, cells, runs)
        for run in range(found):
            for j in range(runs.first[run], runs.first[run + 1]):
                cell = cell_of(cells, j)
                answer = newmark(cell, options, history) if options.rise == NEWMARK else mendez(cell, options, history)
                place = place_of(grid, runs, run, j)
                motion[0, place], motion[1, place] = answer.displacement, answer.peak_velocity
                counts[0, place], counts[1, place] = answer.slips, answer.stick_slips
                counts[2, place], validity[place] = answer.continuous, answer.validity


#: Responses of every cell to one record: displacement and peak velocity, counts, flags.
RECORD_KERNEL = Kernel(_record_grid)
