"""Steps in which nothing happens, many of one block at a time, each in a lane of SIMD loops.

The rate of V does not depend on V, so that the rates of many steps are computed side by side and then summed.  A lane
beyond the last step wanted is computed and left out of the sums.  docs/numerics.md#step-solver
"""

from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar, summed
from slipsweep.kernels.block import Block, relative_acceleration
from slipsweep.kernels.pulse import DISPLACEMENT, LEAST, PEAK, VELOCITY
from slipsweep.kernels.step.rates import RECTANGLE, SIMPSON
from slipsweep.kernels.step.slides import STATE_SIZE
from slipsweep.kernels.step.table import AHEAD, Steps
from slipsweep.kernels.train import REST_COLUMNS
from slipsweep.model import equations as eq

#: Rows of the lanes: the rate of V at the nodes and in the middles of steps (0 but for Simpson's rule), that by
#: Eq. 4 at the nodes, Üg there, and whether something happens in the step.  Row + k is lane k.
RATE, MIDDLE, EQ4, X, HAPPENS = range(0, 10 * AHEAD, 2 * AHEAD)
_LANES_SIZE = 10 * AHEAD

#: The number of a lane.
_INDEX = np.arange(AHEAD) * 1.0


class Room(NamedTuple):
    """Where a block is followed step by step.

    The table of steps, the block's state (rows as in `slides`), the lanes, and what `train` keeps of pulses.
    """

    steps: Steps
    state: np.ndarray
    lanes: np.ndarray
    rests: np.ndarray


@scalar
def room_of(steps: Steps) -> Room:
    """Room for one block after the other."""
    rests = np.empty((steps.wave.height.size, REST_COLUMNS))
    return Room(steps, np.zeros(STATE_SIZE), np.zeros(_LANES_SIZE), rests)


@in_lanes
def _eq4_rate(block: Block, x: float) -> float:
    """D at Üg = x, for λ/g, which a loop then divides once."""
    mu = eq.friction_coefficient(x, block.mu_s, block.delta_mu, block.decay_rate / block.g, 1.0)
    return eq.relative_acceleration(x, mu, block.mu_s, block.tan_theta, block.g)


@scalar
def eq4_rates(block: Block, w: np.ndarray, at: int, most: int, row: int, lanes: np.ndarray) -> None:
    """D at the nodes w[at:] of `most` steps into a row of the lanes, in whole registers."""
    count = (most | 7) + 1
    source, target = w[at : at + count], lanes[row : row + count]
    for k in range(count):
        target[k] = _eq4_rate(block, block.amplitude * source[k])


@summed
def _eq4_sums(block: Block, w: np.ndarray, at: int, count: int) -> tuple[float, float]:
    """Σ D and Σ k D over the nodes w[at + k], k < `count`, in whole registers."""
    total, late, number = 0.0, 0.0, 0.0
    most = (count | 7) + 1
    source = w[at : at + most]
    for k in range(most):
        rate = _eq4_rate(block, block.amplitude * source[k])
        rate = rate if k < count else 0.0
        total += rate
        late += number * rate
        number += 1.0
    return total, late


@scalar
def node_rate(block: Block, w: np.ndarray, at: int) -> float:
    """D at a node."""
    return relative_acceleration(block, block.amplitude * w[at])


@scalar
def take_followed(block: Block, steps: Steps, p: int, i: int, until: int, state: np.ndarray) -> None:
    """Take steps i to `until` of piece p by Eq. 4, in which V does not turn from growing to falling."""
    at, count, h = steps.offset[p] + i, until - i, steps.length[p]
    weights, velocity = steps.weights, state[VELOCITY]
    starts, starts_late = _eq4_sums(block, steps.nodes, at, count)
    middles, middles_late = 0.0, 0.0
    if steps.rule == SIMPSON:
        middles, middles_late = _eq4_sums(block, steps.middles, at, count)
    ends, ends_late = 0.0, 0.0
    if steps.rule != RECTANGLE:
        rate_end = node_rate(block, steps.nodes, at + count)
        ends = starts - node_rate(block, steps.nodes, at) + rate_end
        ends_late = starts_late + count * rate_end - ends
    gain = weights[p, 0] * starts + weights[p, 1] * middles + weights[p, 2] * ends
    late = weights[p, 0] * starts_late + weights[p, 1] * middles_late + weights[p, 2] * ends_late
    moved = weights[p, 3] * starts + weights[p, 4] * middles + weights[p, 5] * ends
    state[DISPLACEMENT] += velocity * h * count + moved + h * ((count - 1.0) * gain - late)
    state[VELOCITY] = velocity + gain
    state[PEAK] = max(state[PEAK], velocity + gain)


@scalar
def held_rates(amplitude: float, held: float, w: np.ndarray, at: int, row: int, lanes: np.ndarray) -> None:
    """Üg − b at the nodes w[at:] with b held into a row of the lanes."""
    source, target = w[at : at + AHEAD], lanes[row : row + AHEAD]
    for k in range(AHEAD):
        target[k] = amplitude * source[k] - held


@scalar
def first_event(most: int, lanes: np.ndarray) -> int:
    """The first of `most` lanes in which something happens; `most` if there is none."""
    for k in range(most):
        if lanes[HAPPENS + k] > 0.0:
            return k
    return most


@scalar
def steps_to_turn(most: int, lanes: np.ndarray) -> int:
    """Steps, `most` at most, before the one in which the rate of V falls through 0."""
    events = 0
    for k in range(AHEAD):
        turns = (lanes[RATE + k] > 0.0) & (lanes[RATE + k + 1] < 0.0) & (k < most)
        lanes[HAPPENS + k] = 1.0 if turns else 0.0
        events += 1 if turns else 0
    return first_event(most, lanes) if events > 0 else most


@scalar
def _steps_to_stop(velocity: float, most: int, weights: np.ndarray, p: int, lanes: np.ndarray) -> int:
    """Steps, `most` at most, before the one in which V comes to 0."""
    start, middle, end = weights[p, 0], weights[p, 1], weights[p, 2]
    for k in range(most):
        velocity += start * lanes[RATE + k] + middle * lanes[MIDDLE + k] + end * lanes[RATE + k + 1]
        if velocity <= 0.0:
            return k
    return most


@summed
def _sums(count: int, h: float, weights: np.ndarray, p: int, lanes: np.ndarray) -> tuple[float, float, float]:
    """What V and W of a block at rest gain over `count` steps of piece p, and what V loses where it falls."""
    v_start, v_middle, v_end = weights[p, 0], weights[p, 1], weights[p, 2]
    w_start, w_middle, w_end = weights[p, 3], weights[p, 4], weights[p, 5]
    gain, late, moved, lost = 0.0, 0.0, 0.0, 0.0
    for k in range(AHEAD):
        start, middle, end = lanes[RATE + k], lanes[MIDDLE + k], lanes[RATE + k + 1]
        gained = v_start * start + v_middle * middle + v_end * end
        shift = w_start * start + w_middle * middle + w_end * end
        gained = gained if _INDEX[k] < count else 0.0
        gain += gained
        late += _INDEX[k] * gained
        lost += gained if gained < 0.0 else 0.0
        moved += shift if _INDEX[k] < count else 0.0
    return gain, moved + h * ((count - 1.0) * gain - late), lost


@scalar
def advance(steps: Steps, p: int, most: int, stops: bool, state: np.ndarray, lanes: np.ndarray) -> int:
    """Take `most` steps of piece p with the rates of the lanes, or those before the stop; how many.

    Their rates do not fall through 0, so that V is least where they rise through it.
    """
    velocity, count, h = state[VELOCITY], most, steps.length[p]
    gain, moved, lost = _sums(count, h, steps.weights, p, lanes)
    if stops and velocity + lost <= 0.0:
        count = _steps_to_stop(velocity, most, steps.weights, p, lanes)
        gain, moved, lost = _sums(count, h, steps.weights, p, lanes)
    state[DISPLACEMENT] += velocity * h * count + moved
    state[VELOCITY] = velocity + gain
    state[PEAK], state[LEAST] = max(state[PEAK], velocity + gain), min(state[LEAST], velocity + lost)
    return count
