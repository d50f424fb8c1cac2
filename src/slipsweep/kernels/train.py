"""A train of pulses: what all cycles of a stick-slip block come to, given how one pulse goes.

Both solvers bring their own `pulse`, a map from the velocity carried into a cycle to the
velocity carried into the next; what follows from that map over many cycles stands here.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slipsweep.kernels.block import (
    EQ4_BELOW_YIELD,
    INTEGRATE,
    KD_NOT_POSITIVE,
    LITERAL,
    NOT_RECOUPLED,
    Block,
    Motion,
    Options,
    phase,
    response,
    yield_governs,
)
from slipsweep.kernels.jit import scalar


class Pulse(NamedTuple):
    """One cycle, from Üg = Üy to the next: V carried on, W gained, the largest and the least V."""

    velocity: float
    displacement: float
    peak: float
    least: float


@scalar
def pause(block: Block) -> float:
    """Phase from Üg = 0 (t5) to the next Üg = Üy."""
    return 1.5 * math.pi + phase(block, block.yield_acceleration)


@scalar
def attenuate(b: float, velocity: float, duration: float) -> tuple[float, float]:
    """Eq. 12 from t5 on, for `duration` of phase at most: V left and W.

    The rate −b is constant: one step, however long, is exact.
    """
    if velocity <= b * duration:
        return 0.0, 0.5 * velocity * (velocity / b)  # the square might overflow
    return velocity - b * duration, (velocity - 0.5 * b * duration) * duration


def train_of(
    pulse: Callable[[Block, Options, np.ndarray, float, bool], Pulse],
) -> Callable[[Block, Options, np.ndarray], Motion]:
    """The jitted train of a solver's pulses."""

    @scalar
    def train(block: Block, options: Options, table: np.ndarray) -> Motion:
        """All pulses of a stick-slip (or Newmark) block.

        Where the map returns to a velocity seen before, the cycles in between repeat; where
        the block never rests within a cycle, the velocity changes by the same amount each
        cycle and W is an arithmetic series.
        """
        cycles = options.cycles
        if block.rise == LITERAL and response(block, block.amplitude) <= 0.0:
            below = EQ4_BELOW_YIELD if yield_governs(block) else 0
            return Motion(math.nan, math.nan, KD_NOT_POSITIVE | below)
        # integrated on, a literal block may run past the end of the shaking, the last time only
        last_differs = block.rise == LITERAL and options.recoupling == INTEGRATE
        velocity, displacement, peak = 0.0, 0.0, 0.0
        validity = EQ4_BELOW_YIELD if yield_governs(block) else 0
        seen_velocity, seen_displacement, seen_at, next_look = 0.0, 0.0, 0, 1
        done = 0
        while done < cycles:
            last = done == cycles - 1
            before = velocity
            now = pulse(block, options, table, before, last)
            velocity = now.velocity
            displacement += now.displacement
            peak = max(peak, now.peak)
            done += 1
            if last:
                break
            if before == 0.0 and velocity == 0.0 and not last_differs:
                displacement *= cycles
                break
            if velocity > 0.0:
                validity |= NOT_RECOUPLED
            left = cycles - 1 - done  # the last pulse, which runs out freely, is always followed
            if now.least > 0.0:
                gain = velocity - before
                alike = float(left)
                if gain < 0.0:
                    alike = min(alike, math.floor(now.least / -gain))
                displacement += alike * now.displacement + math.pi * gain * alike * (alike + 1.0)
                velocity += alike * gain
                done += int(alike)
                if gain > 0.0:
                    peak = max(peak, now.peak + alike * gain)
            elif velocity == seen_velocity:
                period = done - seen_at
                displacement += (left // period) * (displacement - seen_displacement)
                done += left // period * period
                seen_velocity = -1.0  # no further period fits
            elif done == next_look:
                seen_velocity, seen_displacement, seen_at = velocity, displacement, done
                next_look *= 2
        return Motion(displacement, peak, validity)

    return train
