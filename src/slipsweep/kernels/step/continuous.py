"""Continuous sliding in lanes, cycle by cycle; arrays as in `stick_slip`.

docs/numerics.md#step-solver and docs/numerics.md#continuous-sliding
"""

import math

import numpy as np
from numba import literally

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    AMPLITUDE,
    TILE,
    YIELD,
    Block,
    Motion,
    Options,
    block_at,
    lane_drift,
    lane_relative_acceleration,
    relative_acceleration,
    store_motion,
    whole_lanes,
)
from slipsweep.kernels.excitation import offset_at, plane
from slipsweep.kernels.pulse import (
    SLIDES,
)
from slipsweep.kernels.step.rates import SIMPSON, coefficients, displacement_gain, take, velocity_gain
from slipsweep.kernels.step.rows import (
    BEFORE,
    BEFORE_PEAK,
    BEFORE_V,
    GAIN,
    HAPPENS,
    LANE_DISPLACEMENT,
    LANE_EQ4,
    LANE_PEAK,
    LANE_SLIDES,
    LANE_VELOCITY,
    THIN,
)
from slipsweep.kernels.step.slides import LAYER, LEAST_STEP, SHARE_OF_CYCLE, STATE_SIZE, layer_of, reset_state
from slipsweep.kernels.step.table import Steps, node
from slipsweep.motion.pieces import FINISH, TOP


@scalar
def continuous_step(
    block: Block, rule: int, steps: Steps, pieces: np.ndarray, p: int, start: float, end: float, state: np.ndarray
) -> None:
    """From τ = start to end on piece p with Eq. 4 throughout, finer in a layer of friction."""
    layer, length = layer_of(block, pieces, p, state)
    edge = min(max(layer, start), end)
    outwards = pieces[p, FINISH] == 0.0
    finest = max(SHARE_OF_CYCLE / steps.per_cycle * length, LEAST_STEP)
    for first, last, within in ((start, edge, outwards), (edge, end, not outwards)):
        parts = 1 if last > first else 0
        if parts and within and length > 0.0:
            # rounding may not make the two sides of a zero differ
            parts = max(1, math.ceil(min((last - first) / finest, float(steps.per_cycle)) - 1e-6))
        h = (last - first) / max(parts, 1)
        for part in range(parts):
            tau = first + part * h
            x, x_middle = (
                plane(pieces, p, block.amplitude, tau),
                plane(pieces, p, block.amplitude, tau + 0.5 * h),
            )
            x_end = plane(pieces, p, block.amplitude, tau + h)
            c0, c1, c2 = coefficients(
                rule,
                sided_relative_acceleration(block, pieces, p, x),
                sided_relative_acceleration(block, pieces, p, x_middle),
                sided_relative_acceleration(block, pieces, p, x_end),
            )
            take(c0, c1, c2, h, False, state)


@scalar
def sided_relative_acceleration(block: Block, pieces: np.ndarray, p: int, x: float) -> float:
    """D at Üg = x on piece p, whose side of Üg = 0 it takes where rounding would take the other's."""
    return relative_acceleration(block, math.copysign(x, pieces[p, TOP]))


@scalar
def continuous_cycle(
    count: int, rule: int, options: Options, steps: Steps, c: int, cells: np.ndarray, where: np.ndarray,
    lanes: np.ndarray, states: np.ndarray,
) -> None:  # fmt: skip
    """Continuous lanes through cycle c of the table, from the first Üg ≥ Üy on."""
    literally(rule)
    columns = states.reshape((STATE_SIZE, TILE))
    g, wave, nodes = options.g, steps.wave, steps.nodes
    thickest = 0.0
    for j in range(count):
        thickest = max(thickest, lanes[THIN + j])
    for p in range(wave.cycle[c], wave.cycle[c + 1]):
        starting = False
        for j in range(count):
            starting = starting | (states[LANE_SLIDES + j] == 0.0)
        at, h = steps.offset[p], steps.length[p]
        for j in range(count):
            lanes[LANE_EQ4 + j] = lane_relative_acceleration(lanes, j, lanes[AMPLITUDE + j] * nodes[at], g)
        for i in range(steps.counts[p]):
            w_start, w_middle, w_end = nodes[at + 2 * i], nodes[at + 2 * i + 1], nodes[at + 2 * i + 2]
            near = min(abs(w_start), abs(w_end))
            layered = near < thickest
            events = 0
            for j in range(count):
                x, x_end = lanes[AMPLITUDE + j] * w_start, lanes[AMPLITUDE + j] * w_end
                rate, rate_end = lanes[LANE_EQ4 + j], lane_relative_acceleration(lanes, j, x_end, g)
                lanes[LANE_EQ4 + j] = rate_end
                middle = 0.0
                if rule == SIMPSON:
                    middle = lane_relative_acceleration(lanes, j, lanes[AMPLITUDE + j] * w_middle, g)
                c0, c1, c2 = coefficients(rule, rate, middle, rate_end)
                velocity, began = states[LANE_VELOCITY + j], (not starting) | (states[LANE_SLIDES + j] > 0.0)
                after = velocity + velocity_gain(c0, c1, c2, h, 1.0)
                moved = velocity * h + displacement_gain(c0, c1, c2, h, 1.0)
                turns = (c0 > 0.0) & (c0 + c1 + c2 < 0.0)
                begins = max(x, x_end) > lanes[YIELD + j]
                happens = (turns | (layered & (near < lanes[THIN + j]))) if began else begins
                goes = began & (not happens)
                states[LANE_VELOCITY + j] = after if goes else velocity
                states[LANE_DISPLACEMENT + j] += moved if goes else 0.0
                states[LANE_PEAK + j] = max(states[LANE_PEAK + j], after if goes else velocity)
                lanes[HAPPENS + j] = 1.0 if happens else 0.0
                events += 1 if happens else 0
            if events > 0:
                for j in range(count):
                    if lanes[HAPPENS + j] > 0.0:
                        block, state = block_at(cells, where[j], options), columns[:, j]
                        start = node(steps, p, i)
                        if state[SLIDES] == 0.0 and block.amplitude * w_start < block.yield_acceleration:
                            start = offset_at(wave.pieces, p, block.amplitude, block.yield_acceleration)
                        state[SLIDES] = 1.0
                        continuous_step(block, rule, steps, wave.pieces, p, start, node(steps, p, i + 1), state)


@scalar
def mirrored_gain(count: int, rule: int, options: Options, steps: Steps, c: int, lanes: np.ndarray) -> None:
    """Gain of V of continuous lanes over cycle c, whose halves mirror each other: what both sides share, twice.

    The rest cancels.  In V it would leave its rounding, and on a plane nearly level that is more than the gain.
    """
    literally(rule)
    wave, nodes = steps.wave, steps.nodes
    for j in range(count):
        lanes[GAIN + j] = 0.0
    stride = 1 if rule == SIMPSON else 2
    for p in range(wave.cycle[c], wave.cycle[c + 1]):
        if wave.pieces[p, TOP] > 0.0:
            at, last = steps.offset[p], 2 * steps.counts[p]
            for k in range(0, last + 1, stride):
                # what the step before k and that behind it give the node
                c0, c1, c2 = coefficients(rule, 0.0, 1.0 if k % 2 else 0.0, 0.0 if k % 2 or k == 0 else 1.0)
                share = velocity_gain(c0, c1, c2, steps.length[p], 1.0)
                c0, c1, c2 = coefficients(rule, 0.0 if k % 2 or k == last else 1.0, 0.0, 0.0)
                share += velocity_gain(c0, c1, c2, steps.length[p], 1.0)
                w = nodes[at + k]
                for j in range(count):
                    lanes[GAIN + j] += 2.0 * share * lane_drift(lanes, j, lanes[AMPLITUDE + j] * w)


@scalar
def continuous_lanes(
    count: int, rule: int, options: Options, steps: Steps, cells: np.ndarray, where: np.ndarray, lanes: np.ndarray,
    states: np.ndarray, motion: np.ndarray, codes: np.ndarray,
) -> None:  # fmt: skip
    """Continuous sliding, cycle by cycle; repeated ones are stepped twice, the later ones follow from the second."""
    literally(rule)
    columns = states.reshape((STATE_SIZE, TILE))
    wave, whole = steps.wave, whole_lanes(count)
    for j in range(whole):
        state = columns[:, j]
        reset_state(block_at(cells, where[j], options), state)
        lanes[THIN + j] = state[LAYER] / lanes[AMPLITUDE + j]
    for c in range(wave.shape.size):
        continuous_cycle(whole, rule, options, steps, c, cells, where, lanes, states)
        if c != wave.lead or wave.repeats == 0:
            continue
        times = wave.repeats - 1.0 + (1.0 if wave.alike else 0.0)
        if times > 0.0:
            for j in range(whole):
                lanes[BEFORE + j], lanes[BEFORE_V + j] = states[LANE_DISPLACEMENT + j], states[LANE_VELOCITY + j]
                lanes[BEFORE_PEAK + j], states[LANE_PEAK + j] = states[LANE_PEAK + j], states[LANE_VELOCITY + j]
            continuous_cycle(whole, rule, options, steps, c, cells, where, lanes, states)
            if steps.mirrored:
                mirrored_gain(whole, rule, options, steps, c, lanes)
            for j in range(whole):
                moved, velocity = states[LANE_DISPLACEMENT + j] - lanes[BEFORE + j], lanes[BEFORE_V + j]
                gain = lanes[GAIN + j] if steps.mirrored else states[LANE_VELOCITY + j] - velocity
                peak = states[LANE_PEAK + j] + max(0.0, (times - 1.0) * gain)
                states[LANE_PEAK + j] = max(lanes[BEFORE_PEAK + j], peak)
                states[LANE_VELOCITY + j] = velocity + times * gain
                states[LANE_DISPLACEMENT + j] = lanes[BEFORE + j] + times * (moved + math.pi * gain * (times - 1.0))
        if wave.alike:
            break
    for j in range(count):
        store_motion(Motion(states[LANE_DISPLACEMENT + j], states[LANE_PEAK + j], 0), where[j], motion, codes)
