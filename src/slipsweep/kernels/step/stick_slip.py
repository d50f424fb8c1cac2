"""Stick-slip in lanes: cells in lockstep through the pulses that begin at rest.

Arrays of lanes and states as in `rows`, (rows x TILE,); `where`, (TILE,): the cell of each lane; `cells`, `motion`
and `codes` are those of a tile (`slipsweep.kernels.grid.Tile`).  docs/numerics.md#step-solver
"""

import math

import numpy as np
from numba import literally

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    AMPLITUDE,
    INTEGRATE,
    LITERAL,
    MONOTONE,
    NEWMARK,
    TILE,
    YIELD,
    YIELD_GOVERNS,
    Block,
    Motion,
    Options,
    block_at,
    lane_response,
    store_motion,
    whole_lanes,
)
from slipsweep.kernels.excitation import offset_at
from slipsweep.kernels.pulse import (
    SLIDES,
    reset_held,
    rises_anew,
)
from slipsweep.kernels.step.pulse import rise_step, train, whole_hold_step
from slipsweep.kernels.step.rates import SIMPSON, coefficients, displacement_gain, velocity_gain
from slipsweep.kernels.step.rows import (
    BEFORE,
    BEFORE_HELD,
    BEFORE_V,
    HAPPENS,
    LANE_DISPLACEMENT,
    LANE_EQ4,
    LANE_FOLLOWS,
    LANE_HELD,
    LANE_PEAK,
    LANE_SLIDES,
    LANE_VELOCITY,
    WITHOUT_LANES,
    leave_lanes,
)
from slipsweep.kernels.step.slides import LAYER, REACH, STATE_SIZE, TOUCH, reset_state, resolve_fall
from slipsweep.kernels.step.table import Steps, node
from slipsweep.kernels.train import yield_governs
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, JUMPS, LAST, TOP, Wave

#: Kinds of pieces: Üg > 0 not falling, Üg > 0 falling, Üg < 0.
RISES, FALLS, BELOW = 0, 1, 2


@scalar
def course_of(wave: Wave, p: int) -> int:
    """Whether Üg > 0 does not fall on piece p, falls, or Üg < 0."""
    if wave.pieces[p, TOP] < 0.0:
        return BELOW
    return RISES if wave.pieces[p, LAST] >= wave.pieces[p, FIRST] else FALLS


@scalar
def lockstep_rise(
    count: int, rule: int, options: Options, steps: Steps, p: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Lanes along piece p, on which Üg > 0 does not fall."""
    literally(rule)
    columns = states.reshape((STATE_SIZE, TILE))
    rise, g = options.rise, options.g
    nodes, at, h = steps.nodes, steps.offset[p], steps.length[p]
    first, least, going = 0, math.inf, 0
    for j in range(count):
        least = min(least, lanes[YIELD + j] / lanes[AMPLITUDE + j])
        going += 1 if states[LANE_SLIDES + j] > 0.0 else 0
    if going == 0:
        # at rest below Üy nothing happens
        while first < steps.counts[p] and nodes[at + 2 * first + 2] <= least * (1.0 - 1e-15):
            first += 1
        if first == steps.counts[p]:
            return
    for j in range(count):
        lanes[LANE_EQ4 + j] = lane_response(lanes, j, lanes[AMPLITUDE + j] * nodes[at + 2 * first], g)
    for i in range(first, steps.counts[p]):
        w_start, w_middle, w_end = nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2]
        events = 0
        for j in range(count):
            x, x_end = lanes[AMPLITUDE + j] * w_start, lanes[AMPLITUDE + j] * w_end
            slides, follows, held = states[LANE_SLIDES + j] > 0.0, states[LANE_FOLLOWS + j] > 0.0, states[LANE_HELD + j]
            eq4 = lanes[LANE_EQ4 + j]
            eq4_end = -math.inf if rise == NEWMARK else lane_response(lanes, j, x_end, g)
            lanes[LANE_EQ4 + j] = eq4_end
            held_end = eq4_end if follows else held
            middle = 0.0
            if rule == SIMPSON:
                x_middle = lanes[AMPLITUDE + j] * w_middle
                eq4_middle = -math.inf if rise == NEWMARK else lane_response(lanes, j, x_middle, g)
                middle = x_middle - (eq4_middle if follows else held)
            c0, c1, c2 = coefficients(rule, x - held, middle, x_end - held_end)
            velocity = states[LANE_VELOCITY + j]
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            switches = (rise == MONOTONE) & (follows & (eq4_end < eq4) | (not follows) & (eq4_end > held))
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            irregular = switches | turns | (after <= 0.0)
            starts = (x_end > lanes[YIELD + j]) & (x_end > eq4_end)
            happens = irregular if slides else starts
            goes = slides & (not happens)
            states[LANE_VELOCITY + j] = after if goes else velocity
            states[LANE_DISPLACEMENT + j] += moved if goes else 0.0
            states[LANE_HELD + j] = held_end if goes else held
            states[LANE_PEAK + j] = max(states[LANE_PEAK + j], after if goes else 0.0)
            lanes[HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
        if events > 0:
            for j in range(count):
                if lanes[HAPPENS + j] > 0.0:
                    block, state = block_at(cells, where[j], options), columns[:, j]
                    rise_step(block, rule, steps, p, i, node(steps, p, i), block.amplitude * w_start, state)
                    if state[REACH] > -math.inf:
                        leave_lanes(lanes, states, j)


@scalar
def lockstep_fall(
    count: int, rule: int, options: Options, steps: Steps, p: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Lanes along piece p with b held, or until all have stopped."""
    literally(rule)
    columns = states.reshape((STATE_SIZE, TILE))
    nodes, at, h = steps.nodes, steps.offset[p], steps.length[p]
    for i in range(steps.counts[p]):
        w_start, w_middle, w_end = nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2]
        events, going = 0, 0
        for j in range(count):
            amplitude, held, velocity = lanes[AMPLITUDE + j], states[LANE_HELD + j], states[LANE_VELOCITY + j]
            slides = states[LANE_SLIDES + j] > 0.0
            c0, c1, c2 = coefficients(
                rule, amplitude * w_start - held, amplitude * w_middle - held, amplitude * w_end - held
            )
            after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
            moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
            turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
            happens = slides & (turns | (after <= 0.0))
            goes = slides & (not happens)
            states[LANE_VELOCITY + j] = after if goes else velocity
            states[LANE_DISPLACEMENT + j] += moved if goes else 0.0
            states[LANE_PEAK + j] = max(states[LANE_PEAK + j], after if goes else velocity)
            lanes[HAPPENS + j] = 1.0 if happens else 0.0
            events += 1 if happens else 0
            going += 1 if slides else 0
        if going == 0:
            break
        if events > 0:
            for j in range(count):
                if lanes[HAPPENS + j] > 0.0:
                    whole_hold_step(rule, lanes[AMPLITUDE + j], w_start, w_middle, w_end, h, columns[:, j])


@scalar
def until_next(block: Block, wave: Wave, p: int) -> float:
    """Phase from the beginning of piece p to where Üg next comes to Üy on the rise, or jumps past it."""
    waited = 0.0
    for q in range(p, wave.pieces.shape[0]):
        if block.amplitude * max(wave.pieces[q, FIRST], wave.pieces[q, LAST]) > block.yield_acceleration:
            if block.amplitude * wave.pieces[q, FIRST] >= block.yield_acceleration:
                return waited
            return waited + (
                offset_at(wave.pieces, q, block.amplitude, block.yield_acceleration) - wave.pieces[q, BEGIN]
            )
        waited += wave.pieces[q, FINISH] - wave.pieces[q, BEGIN]
    return math.inf


@scalar
def reset_held_in_lane(block: Block, wave: Wave, p: int, state: np.ndarray) -> None:
    """What the beginning of piece p, after a jump upwards or a fall, asks of a lane; its rise begins a slide itself."""
    if state[SLIDES] > 0.0 or wave.pieces[p, FIRST] > wave.pieces[p, LAST]:
        reset_held(block, wave.pieces, p, block.amplitude * wave.pieces[p, FIRST], state)
        resolve_fall(block, wave.pieces, p, state)


@scalar
def stick_slip_cycle(
    count: int, rule: int, options: Options, steps: Steps, c: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Stick-slip lanes through cycle c of the table; one that carries velocity into a new slide is set aside."""
    literally(rule)
    columns = states.reshape((STATE_SIZE, TILE))
    wave = steps.wave
    pieces = wave.pieces.shape[0]
    for p in range(wave.cycle[c], wave.cycle[c + 1]):
        kind = course_of(wave, p)
        before = BELOW if p == 0 else course_of(wave, p - 1)
        rises_on = kind == RISES and before == RISES and wave.pieces[p, JUMPS] == 0.0
        if kind != BELOW and not rises_on and rises_anew(wave.pieces, p):
            for j in range(count):
                if lanes[WITHOUT_LANES + j] == 0.0:
                    reset_held_in_lane(block_at(cells, where[j], options), wave, p, columns[:, j])
                    if columns[REACH, j] > -math.inf:
                        leave_lanes(lanes, states, j)
        if options.rise == LITERAL and kind != RISES and before != kind:
            for j in range(count):
                if states[LANE_SLIDES + j] > 0.0 and states[LANE_HELD + j] <= 0.0:
                    leave_lanes(lanes, states, j)
        if kind == RISES:
            lockstep_rise(count, rule, options, steps, p, cells, where, lanes, states)
        elif kind == FALLS or options.recoupling == INTEGRATE:
            lockstep_fall(count, rule, options, steps, p, cells, where, lanes, states)
        elif before != BELOW:
            pause, q = 0.0, p
            while q < pieces and wave.pieces[q, TOP] < 0.0:
                pause += wave.pieces[q, FINISH] - wave.pieces[q, BEGIN]
                q += 1
            for j in range(count):
                if states[LANE_SLIDES + j] > 0.0:
                    held, velocity = states[LANE_HELD + j], states[LANE_VELOCITY + j]
                    wait = math.inf
                    if velocity > held * pause:  # else it stops before Üg > 0
                        wait = until_next(block_at(cells, where[j], options), wave, p)
                    states[LANE_DISPLACEMENT + j] += eq.attenuated_displacement(velocity, held, wait)
                    states[LANE_VELOCITY + j] = states[LANE_SLIDES + j] = 0.0
                    if eq.attenuated_velocity(velocity, held, wait) > 0.0:
                        leave_lanes(lanes, states, j)
        if kind == BELOW and p + 1 < pieces and wave.pieces[p + 1, TOP] > 0.0:
            for j in range(count):
                if states[LANE_SLIDES + j] > 0.0:
                    leave_lanes(lanes, states, j)


@scalar
def stick_slip_lanes(
    count: int, rule: int, options: Options, steps: Steps, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    states: np.ndarray, motion: np.ndarray, codes: np.ndarray,
) -> None:  # fmt: skip
    """Stick-slip: pulses from rest in lockstep; cells that do not come to rest in one go on pulse by pulse."""
    literally(rule)
    columns = states.reshape((STATE_SIZE, TILE))
    wave, whole = steps.wave, whole_lanes(count)
    for j in range(whole):
        state = columns[:, j]
        reset_state(block_at(cells, where[j], options), state)
        lanes[WITHOUT_LANES + j] = 0.0
        if state[LAYER] > 0.0 or state[TOUCH] < math.inf:
            leave_lanes(lanes, states, j)
    for c in range(wave.shape.size):
        times = 1.0
        if c == wave.lead and wave.repeats > 0:
            times = wave.repeats + (1.0 if wave.alike else 0.0)
        for j in range(whole):
            lanes[BEFORE + j], lanes[BEFORE_V + j] = states[LANE_DISPLACEMENT + j], states[LANE_VELOCITY + j]
            lanes[BEFORE_HELD + j] = states[LANE_HELD + j] if states[LANE_SLIDES + j] > 0.0 else 0.0
        stick_slip_cycle(whole, rule, options, steps, c, cells, where, lanes, states)
        for j in range(whole):
            before = lanes[BEFORE + j]
            states[LANE_DISPLACEMENT + j] = before + times * (states[LANE_DISPLACEMENT + j] - before)
            # one cycle stands for all only if it ends in the state in which it began
            held = states[LANE_HELD + j] if states[LANE_SLIDES + j] > 0.0 else 0.0
            if times > 1.0 and (states[LANE_VELOCITY + j] != lanes[BEFORE_V + j] or held != lanes[BEFORE_HELD + j]):
                leave_lanes(lanes, states, j)
        if c == wave.lead and wave.alike:
            break
    highest = 0.0
    for height in wave.height:
        highest = max(highest, height)
    for j in range(count):
        block = block_at(cells, where[j], options)
        # the shaking may end in a rise, which leaves b <= 0 where none is held any more
        if lanes[WITHOUT_LANES + j] > 0.0 or (states[LANE_SLIDES + j] > 0.0 and states[LANE_HELD + j] <= 0.0):
            found = train(block, options, wave, steps)
        else:
            moved = states[LANE_DISPLACEMENT + j]
            if states[LANE_SLIDES + j] > 0.0:
                moved += eq.attenuated_displacement(states[LANE_VELOCITY + j], states[LANE_HELD + j], math.inf)
            slides = block.amplitude * highest > block.yield_acceleration
            validity = YIELD_GOVERNS if slides and yield_governs(block, wave) else 0
            found = Motion(moved, states[LANE_PEAK + j], validity)
        store_motion(found, where[j], motion, codes)
