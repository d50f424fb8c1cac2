"""The stepping solver: fixed steps in phase, cut at the events inside them.

A rule is the polynomial through the rate of the relative velocity, Üg − Ü, at one, two or
three points of a step; V and W are its first and second integrals.

==========  =====================  =====  ==================================
rule        rate taken at          order  also known as
==========  =====================  =====  ==================================
rectangle   start                  1      Euler (Eq. 12 is written this way)
trapezoid   start, end             2      linear acceleration
simpson     start, middle, end     4      Runge-Kutta 4 for a rate free of V
==========  =====================  =====  ==================================

The orders hold because a step in which something happens (t1, a switch to or from the
hold, a turn of Eq. 4, the stop) is divided there by `rise_step` and `fall_step`.  Steps
in which nothing happens, nearly all, are taken by lanes of cells in lockstep, with sin φ
from a table (`stick_slip_cells`, `continuous_cells`).
"""

import math

import numpy as np
from numba import literally

from slipsweep.elementary import versine
from slipsweep.equations import CONTINUOUS, STICK_SLIP, STUCK
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    EQ4_BELOW_YIELD,
    INTEGRATE,
    KD_NOT_POSITIVE,
    LANE_ROWS,
    LITERAL,
    MONOTONE,
    NEWMARK,
    NO_VALUE,
    TILE,
    Block,
    Motion,
    Options,
    block_at,
    lane_of,
    lane_response,
    phase,
    response,
    response_and_slope,
    response_root,
    slip,
    slip_root,
    slope_root,
    starting_acceleration,
    whole_lanes,
    yield_governs,
)
from slipsweep.kernels.excitation import Wave
from slipsweep.kernels.jit import in_lanes, scalar
from slipsweep.kernels.train import Pulse, attenuate, train_of

RECTANGLE, TRAPEZOID, SIMPSON = 0, 1, 2

#: A slide's rise is never covered by fewer than steps_per_cycle / 64 steps, or a cell just
#: above yield, whose slide is shorter than a step, would not converge with the step.
_SHARE_OF_CYCLE = 64

#: More events than any step holds.
_MOST_EVENTS = 16

_HALF_PI = 0.5 * math.pi


def sine_table(steps_per_cycle: int) -> np.ndarray:
    """sin φ at every half step of a half cycle, shape (steps_per_cycle + 1,)."""
    quarter = np.sin(np.linspace(0.0, _HALF_PI, steps_per_cycle // 2 + 1))
    return np.concatenate([quarter, quarter[-2::-1]])


#: Rows of a state: V, W, the block's acceleration b, the largest and the least V, and
#: whether the block slides and whether b follows Eq. 4 (1.0 or 0.0).  Row + j is cell j.
VELOCITY, DISPLACEMENT, HELD, PEAK, LEAST, SLIDES, FOLLOWS = range(0, 7 * TILE, TILE)
_STATE_SIZE = 7 * TILE


@in_lanes
def coefficients(rule: int, start: float, middle: float, end: float) -> tuple[float, float, float]:
    """c0, c1, c2 of the rate c0 + c1 s + c2 s², s in [0, 1] over the step."""
    if rule == RECTANGLE:
        return start, 0.0, 0.0
    if rule == TRAPEZOID:
        return start, end - start, 0.0
    return start, 4.0 * middle - 3.0 * start - end, 2.0 * (start + end) - 4.0 * middle


@in_lanes
def velocity_gain(c0: float, c1: float, c2: float, h: float, s: float) -> float:
    """∫ of the rate from 0 to s, over a step of phase h."""
    return h * s * (c0 + s * (0.5 * c1 + s * c2 / 3.0))


@in_lanes
def displacement_gain(c0: float, c1: float, c2: float, h: float, s: float) -> float:
    """∫∫ of the rate from 0 to s, over a step of phase h."""
    return h * h * s * s * (0.5 * c0 + s * (c1 / 6.0 + s * c2 / 12.0))


@scalar
def stop(velocity: float, c0: float, c1: float, c2: float, h: float) -> float:
    """Fraction of the step at which V, zero or less at its end, reaches zero."""
    low, high = 0.0, 1.0
    s = velocity / (velocity - velocity_gain(c0, c1, c2, h, 1.0)) if velocity > 0.0 else 1.0
    for _ in range(100):
        left = velocity + velocity_gain(c0, c1, c2, h, s)
        if left > 0.0:
            low = s
        else:
            high = s
        new = s - left / (h * (c0 + s * (c1 + s * c2)))
        if not low <= new <= high:
            new = 0.5 * (low + high)
        change = abs(new - s)
        s = new
        if change <= 1e-12:
            break
    return s


@scalar
def take(c0: float, c1: float, c2: float, h: float, stops: bool, state: np.ndarray, j: int) -> float:
    """Take a step of phase h, up to the stop if V may not fall below zero; the fraction taken."""
    velocity = state[VELOCITY + j]
    fraction = 1.0
    after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
    if stops and (after < 0.0 or (after == 0.0 and velocity > 0.0)):
        fraction = stop(velocity, c0, c1, c2, h)
        after = 0.0
        state[SLIDES + j] = 0.0
    if c0 > 0.0 and c0 + c1 + c2 < 0.0:
        # V is largest where the rate vanishes: the secant, then Newton
        turn = -c0 / (c1 + c2)
        for _ in range(3):
            turn -= (c0 + turn * (c1 + turn * c2)) / (c1 + 2.0 * turn * c2)
        turn = min(max(turn, 0.0), fraction)
        state[PEAK + j] = max(state[PEAK + j], velocity + velocity_gain(c0, c1, c2, h, turn))
    state[DISPLACEMENT + j] += velocity * h * fraction + displacement_gain(c0, c1, c2, h, fraction)
    state[VELOCITY + j] = after
    state[PEAK + j] = max(state[PEAK + j], after)
    state[LEAST + j] = min(state[LEAST + j], after)
    return fraction


@scalar
def plane(block: Block, psi: float) -> float:
    """The plane's acceleration at phase ψ from the peak."""
    if abs(psi) <= _HALF_PI:
        return block.amplitude * (1.0 - versine(psi))
    return block.amplitude * math.cos(psi)


@scalar
def rise_step(block: Block, rule: int, start: float, end: float, state: np.ndarray, j: int) -> None:
    """From phase start to end on the rise, cut at t1, at switches to and from the hold, and at the stop."""
    psi, x, x_end = start, plane(block, start), plane(block, end)
    literal = block.rise == LITERAL
    for _ in range(_MOST_EVENTS):
        if state[SLIDES + j] == 0.0:
            if block.rise != NEWMARK and slip(block, x) <= 0.0:
                if slip(block, x_end) <= 0.0:
                    break
                x = held = slip_root(block, 0.0, x, x_end)  # where Eq. 4 meets Üg
                psi = phase(block, x)
            else:
                held = starting_acceleration(block, x)
            by_eq4 = literal or (held > block.yield_acceleration and response_and_slope(block, x)[1] > 0.0)
            state[HELD + j] = min(held, x)  # equal at an onset, but for rounding
            state[SLIDES + j] = 1.0
            state[FOLLOWS + j] = 1.0 if by_eq4 else 0.0
        cut, x_cut, switches = end, x_end, False
        if block.rise == MONOTONE:
            asked, slope = response_and_slope(block, x)
            asked_end = response(block, x_end)
            if state[FOLLOWS + j] == 0.0 and asked_end > state[HELD + j]:
                if asked < state[HELD + j] or slope <= 0.0:
                    x_cut, switches = response_root(block, state[HELD + j], x, x_end), True
                else:
                    state[FOLLOWS + j] = 1.0
            elif state[FOLLOWS + j] == 1.0 and asked_end < asked:
                if slope > 0.0:
                    x_cut, switches = slope_root(block, 0.0, x, x_end), True
                else:
                    state[FOLLOWS + j] = 0.0
        if switches:
            cut = phase(block, x_cut)
        follows, held, h = state[FOLLOWS + j] == 1.0, state[HELD + j], cut - psi
        x_middle = plane(block, psi + 0.5 * h)
        rate = slip(block, x) if follows else x - held
        c0, c1, c2 = coefficients(
            rule,
            rate if state[VELOCITY + j] > 0.0 else max(rate, 0.0),  # rounding may not stop what starts here
            slip(block, x_middle) if follows else x_middle - held,
            slip(block, x_cut) if follows else x_cut - held,
        )
        fraction = take(c0, c1, c2, h, True, state, j)
        if state[SLIDES + j] == 0.0:
            cut = psi + fraction * h
            x_cut = plane(block, cut)
        if follows:
            state[HELD + j] = response(block, x_cut)
        if switches:
            state[FOLLOWS + j] = 1.0 - state[FOLLOWS + j]
        psi, x = cut, x_cut
        if psi >= end:
            break


@scalar
def fall_step(block: Block, rule: int, start: float, end: float, state: np.ndarray, j: int) -> None:
    """From phase start to end with b held, cut at the stop."""
    held, h = state[HELD + j], end - start
    c0, c1, c2 = coefficients(
        rule, plane(block, start) - held, plane(block, 0.5 * (start + end)) - held, plane(block, end) - held
    )
    take(c0, c1, c2, h, True, state, j)


@scalar
def begin(block: Block, velocity: float, state: np.ndarray, j: int) -> None:
    """The state at Üg = Üy on the rise."""
    state[VELOCITY + j] = state[PEAK + j] = state[LEAST + j] = velocity
    state[DISPLACEMENT + j] = 0.0
    state[HELD + j] = starting_acceleration(block, block.yield_acceleration)
    state[SLIDES + j] = 1.0 if velocity > 0.0 else 0.0
    state[FOLLOWS + j] = 1.0 if block.rise == LITERAL else 0.0


@scalar
def pause(block: Block) -> float:
    """Phase from Üg = 0 (t5) to the next Üg = Üy."""
    return 1.5 * math.pi + phase(block, block.yield_acceleration)


@scalar
def pulse(
    block: Block, options: Options, wave: Wave, table: np.ndarray, k: int, following: int, velocity: float
) -> Pulse:
    """One cell's cycle, step by step, from one Üg = Üy to the next (see `train.Pulse`)."""
    rule, state = options.rule, np.empty(_STATE_SIZE)
    last = following >= wave.height.size
    began = phase(block, block.yield_acceleration)
    h = min(2.0 * math.pi, -began * _SHARE_OF_CYCLE) / options.steps_per_cycle
    begin(block, velocity, state, 0)
    start, node = began, math.ceil(began / h)
    while node <= 0:
        rise_step(block, rule, start, node * h, state, 0)
        start = node * h
        node += 1
    if state[SLIDES + 0] == 1.0 and state[HELD + 0] <= 0.0:
        return Pulse(0.0, math.nan, math.nan, 0.0, 0.0, KD_NOT_POSITIVE)
    end = _HALF_PI
    if options.recoupling == INTEGRATE:
        end = 1.5 * math.pi if last else _HALF_PI + pause(block)
    start, node = 0.0, 1
    while start < end and state[SLIDES + 0] == 1.0:
        target = min(node * h, end)
        fall_step(block, rule, start, target, state, 0)
        start = target
        node += 1
    velocity, moved = state[VELOCITY + 0], state[DISPLACEMENT + 0]
    if velocity > 0.0 and (options.recoupling != INTEGRATE or last):
        velocity, slid = attenuate(state[HELD + 0], velocity, math.inf if last else pause(block))
        moved += slid
    return Pulse(velocity, moved, state[PEAK + 0], min(state[LEAST + 0], velocity), math.inf, 0)


train = train_of(pulse)


#: Rows of the lanes beside the block's: E (or D) at the last node, and whether something
#: happens in the step.
_ASKED, _HAPPENS = LANE_ROWS * TILE, (LANE_ROWS + 1) * TILE
_LANE_SIZE = (LANE_ROWS + 2) * TILE


@scalar
def lockstep_rise(
    count: int, rule: int, options: Options, table: np.ndarray, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    state: np.ndarray,
) -> None:  # fmt: skip
    """First pulses of `count` lanes, from rest to the peak."""
    literally(rule)
    rise, g = options.rise, options.g
    quarter = options.steps_per_cycle // 4
    h = 2.0 * math.pi / options.steps_per_cycle
    first = quarter
    for j in range(count):
        first = min(first, quarter + math.floor(lanes[BEGAN + j] / h))
    for j in range(count):
        lanes[_ASKED + j] = lane_response(lanes, j, lanes[AMPLITUDE + j] * table[2 * first], g)
    for node in range(first, quarter):
        s_start, s_middle, s_end = table[2 * node], table[2 * node + 1], table[2 * node + 2]
        psi, psi_end = (node - quarter) * h, (node + 1 - quarter) * h
        events = 0
        for j in range(count):
            x, x_end = lanes[AMPLITUDE + j] * s_start, lanes[AMPLITUDE + j] * s_end
            slides, follows, held = state[SLIDES + j] > 0.0, state[FOLLOWS + j] > 0.0, state[HELD + j]
            asked = lanes[_ASKED + j]
            asked_end = -math.inf if rise == NEWMARK else lane_response(lanes, j, x_end, g)
            lanes[_ASKED + j] = asked_end
            held_end = asked_end if follows else held
            middle = 0.0
            if rule == SIMPSON:
                x_middle = lanes[AMPLITUDE + j] * s_middle
                asked_middle = -math.inf if rise == NEWMARK else lane_response(lanes, j, x_middle, g)
                middle = x_middle - (asked_middle if follows else held)
            c0, c1, c2 = coefficients(rule, x - held, middle, x_end - held_end)
            velocity = state[VELOCITY + j]
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            switches = (rise == MONOTONE) & (follows & (asked_end < asked) | (not follows) & (asked_end > held))
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            irregular = switches | turns | (after <= 0.0)
            starts = (psi_end > lanes[BEGAN + j]) & (x_end > asked_end)
            happens = irregular if slides else starts
            steps = slides & (not happens)
            state[VELOCITY + j] = after if steps else velocity
            state[DISPLACEMENT + j] += moved if steps else 0.0
            state[HELD + j] = held_end if steps else held
            state[PEAK + j] = max(state[PEAK + j], after if steps else 0.0)
            lanes[_HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
        if events > 0:
            for j in range(count):
                if lanes[_HAPPENS + j] > 0.0:
                    block = block_at(cells, where[j], options)
                    rise_step(block, rule, max(psi, lanes[BEGAN + j]), psi_end, state, j)


@scalar
def lockstep_fall(
    count: int, rule: int, options: Options, table: np.ndarray, lanes: np.ndarray, state: np.ndarray, nodes: int
) -> None:
    """Lanes on with b held, for `nodes` steps after the peak or until all have stopped."""
    literally(rule)
    steps_per_cycle = options.steps_per_cycle
    h = 2.0 * math.pi / steps_per_cycle
    for node in range(nodes):
        at = 2 * node + steps_per_cycle // 2
        s_start, s_middle, s_end = half_wave(table, at), half_wave(table, at + 1), half_wave(table, at + 2)
        events, going = 0, 0
        for j in range(count):
            amplitude, held, velocity = lanes[AMPLITUDE + j], state[HELD + j], state[VELOCITY + j]
            slides = state[SLIDES + j] > 0.0
            c0, c1, c2 = coefficients(
                rule, amplitude * s_start - held, amplitude * s_middle - held, amplitude * s_end - held
            )
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            happens = slides & (turns | (after <= 0.0))
            steps = slides & (not happens)
            state[VELOCITY + j] = after if steps else velocity
            state[DISPLACEMENT + j] += moved if steps else 0.0
            state[PEAK + j] = max(state[PEAK + j], after if steps else velocity)
            lanes[_HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
            going += 1 if slides else 0
        if going == 0:
            break
        if events > 0:
            for j in range(count):
                if lanes[_HAPPENS + j] > 0.0:
                    amplitude, held = lanes[AMPLITUDE + j], state[HELD + j]
                    c0, c1, c2 = coefficients(
                        rule, amplitude * s_start - held, amplitude * s_middle - held, amplitude * s_end - held
                    )
                    take(c0, c1, c2, h, True, state, j)


@scalar
def half_wave(table: np.ndarray, at: int) -> float:
    """sin φ at half step `at` of the cycle, from the table of its first half."""
    half = table.size - 1
    return table[at] if at <= half else -table[at - half]


@scalar
def continuous_step(block: Block, rule: int, side: float, start: float, end: float, state: np.ndarray, j: int) -> None:
    """From phase start to end of a half cycle (side ±1, ψ from its peak) with Eq. 4 throughout."""
    x = side * max(plane(block, start), 0.0)
    x_middle = side * max(plane(block, 0.5 * (start + end)), 0.0)
    x_end = side * max(plane(block, end), 0.0)
    c0, c1, c2 = coefficients(rule, slip(block, x), slip(block, x_middle), slip(block, x_end))
    take(c0, c1, c2, end - start, False, state, j)


@scalar
def lockstep_half_cycle(
    count: int, rule: int, options: Options, table: np.ndarray, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    state: np.ndarray, side: float, starting: bool,
) -> None:  # fmt: skip
    """Continuous lanes through a half cycle; `starting`, from the first Üg = Üy on."""
    literally(rule)
    g = options.g
    h = 2.0 * math.pi / options.steps_per_cycle
    for j in range(count):
        x = side * lanes[AMPLITUDE + j] * table[0]
        lanes[_ASKED + j] = x - lane_response(lanes, j, x, g)
    for node in range(options.steps_per_cycle // 2):
        s_middle, s_end = table[2 * node + 1], table[2 * node + 2]
        psi, psi_end = node * h - _HALF_PI, (node + 1) * h - _HALF_PI
        events = 0
        for j in range(count):
            x_end = side * lanes[AMPLITUDE + j] * s_end
            rate, rate_end = lanes[_ASKED + j], x_end - lane_response(lanes, j, x_end, g)
            lanes[_ASKED + j] = rate_end
            middle = 0.0
            if rule == SIMPSON:
                x_middle = side * lanes[AMPLITUDE + j] * s_middle
                middle = x_middle - lane_response(lanes, j, x_middle, g)
            c0, c1, c2 = coefficients(rule, rate, middle, rate_end)
            velocity = state[VELOCITY + j]
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            began = (not starting) | (psi >= lanes[BEGAN + j])
            begins = (not began) & (psi_end > lanes[BEGAN + j])
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            steps = began & (not turns)
            happens = (began & turns) | begins
            state[VELOCITY + j] = after if steps else velocity
            state[DISPLACEMENT + j] += moved if steps else 0.0
            state[PEAK + j] = max(state[PEAK + j], after if steps else velocity)
            lanes[_HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
        if events > 0:
            for j in range(count):
                if lanes[_HAPPENS + j] > 0.0:
                    block = block_at(cells, where[j], options)
                    start = max(psi, lanes[BEGAN + j]) if starting else psi
                    continuous_step(block, rule, side, start, psi_end, state, j)


@scalar
def continuous_cells(
    count: int, rule: int, options: Options, table: np.ndarray, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    state: np.ndarray, motion: np.ndarray,
) -> None:  # fmt: skip
    """Continuous sliding: two cycles are stepped, the later ones follow from them (|Üg| repeats)."""
    literally(rule)
    whole = whole_lanes(count)
    for j in range(whole):
        state[VELOCITY + j] = state[DISPLACEMENT + j] = state[PEAK + j] = 0.0
    lockstep_half_cycle(whole, rule, options, table, cells, where, lanes, state, 1.0, True)
    lockstep_half_cycle(whole, rule, options, table, cells, where, lanes, state, -1.0, False)
    for j in range(count):
        motion[0, where[j]], motion[1, where[j]] = state[DISPLACEMENT + j], state[PEAK + j]
    if options.cycles == 1:
        return
    first = np.empty(whole)
    for j in range(whole):
        first[j] = state[PEAK + j] = state[VELOCITY + j]
    lockstep_half_cycle(whole, rule, options, table, cells, where, lanes, state, 1.0, False)
    lockstep_half_cycle(whole, rule, options, table, cells, where, lanes, state, -1.0, False)
    later = options.cycles - 1.0
    for j in range(count):
        drift = state[VELOCITY + j] - first[j]
        moved = state[DISPLACEMENT + j] - motion[0, where[j]]
        motion[0, where[j]] += later * (moved + math.pi * drift * (later - 1.0))
        motion[1, where[j]] = max(motion[1, where[j]], state[PEAK + j] + max(0.0, (later - 1.0) * drift))


@scalar
def stick_slip_cells(
    count: int, rule: int, options: Options, wave: Wave, table: np.ndarray, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    state: np.ndarray, motion: np.ndarray, codes: np.ndarray,
) -> None:  # fmt: skip
    """Stick-slip: the first pulse in lockstep; cells that do not come to rest in it go on one by one."""
    literally(rule)
    whole = whole_lanes(count)
    for j in range(whole):
        block = block_at(cells, where[j], options)
        begin(block, 0.0, state, j)
    lockstep_rise(whole, rule, options, table, cells, where, lanes, state)
    shortest = 2.0 * math.pi / _SHARE_OF_CYCLE  # a slide so short needs steps of its own
    quarters = 3 if options.recoupling == INTEGRATE else 1
    lockstep_fall(whole, rule, options, table, lanes, state, quarters * (options.steps_per_cycle // 4))
    for j in range(count):
        block = block_at(cells, where[j], options)
        velocity, moved = state[VELOCITY + j], state[DISPLACEMENT + j]
        if velocity > 0.0 and options.recoupling != INTEGRATE:
            velocity, slid = attenuate(state[HELD + j], velocity, math.inf if options.cycles == 1 else pause(block))
            moved += slid
        if velocity > 0.0 or block.rise == LITERAL or -lanes[BEGAN + j] < shortest:
            answer = train(block, options, wave, table)
        else:
            governs = yield_governs(block, block.yield_acceleration, block.amplitude)
            validity = EQ4_BELOW_YIELD if governs else 0
            answer = Motion(options.cycles * moved, state[PEAK + j], validity)
        motion[0, where[j]], motion[1, where[j]] = answer.displacement, answer.peak_velocity
        codes[1, where[j]] |= answer.validity
        if answer.validity & NO_VALUE:
            codes[0, where[j]] = -1


@scalar
def solve_cells(
    cells: np.ndarray, count: int, rule: int, options: Options, wave: Wave, table: np.ndarray, motion: np.ndarray,
    codes: np.ndarray,
) -> None:  # fmt: skip
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and mode, validity.

    `rule` is a compile-time constant: with it the loops over lanes lose the middle of the
    step, which only Simpson's rule wants (rectangle, 1.7 against 5.3 ns a step).
    """
    literally(rule)
    where = np.empty(TILE, np.int64)
    lanes = np.empty(_LANE_SIZE)
    state = np.empty(_STATE_SIZE)
    for wanted in (STICK_SLIP, CONTINUOUS):
        lane = 0
        for j in range(count):
            block = block_at(cells, j, options)
            if wanted == STICK_SLIP:
                codes[0, j], codes[1, j] = block.sliding_mode, block.validity
                motion[0, j] = motion[1, j] = 0.0 if block.sliding_mode == STUCK else math.nan
            if block.sliding_mode == wanted:
                lane_of(block, lanes, lane)
                where[lane] = j
                lane += 1
        for spare in range(lane, whole_lanes(lane)):  # repeats the first, see `whole_lanes`
            where[spare] = where[0]
            for row in range(LANE_ROWS):
                lanes[row * TILE + spare] = lanes[row * TILE]
        if lane > 0 and wanted == STICK_SLIP:
            stick_slip_cells(lane, rule, options, wave, table, cells, where, lanes, state, motion, codes)
        elif lane > 0:
            continuous_cells(lane, rule, options, table, cells, where, lanes, state, motion)
