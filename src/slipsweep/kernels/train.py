"""A train of pulses: what all of the shaking comes to, given how one pulse goes.

A pulse begins where the plane's acceleration comes to Üy, or jumps past it, after it was not positive:
there b is reset, and the velocity carried over is all that the past has left.  Both solvers bring
their own `pulse`, a map from the velocity carried into one to the velocity carried into the next;
what follows from that map over many cycles stands here.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    NEWMARK,
    NO_VALUE,
    NOT_RECOUPLED,
    UNSOLVED,
    YIELD_GOVERNS,
    Block,
    Motion,
    Options,
    stays_below_yield,
)
from slipsweep.kernels.pulse import Pulse, first_pulse
from slipsweep.motion.pieces import END, START, Wave

#: What is kept of a pulse from rest to rest: W, and the largest V.
_MOVED, _HIGHEST = range(2)
REST_COLUMNS = 2


@scalar
def yield_governs(block: Block, wave: Wave) -> bool:
    """Whether Eq. 4 stays at or below the yield value over all that the plane rises through or jumps to.

    Not said of Newmark's block, which knows no Eq. 4.
    """
    governs = block.rise != NEWMARK
    for i in range(wave.rises.shape[0]):
        high = block.amplitude * wave.rises[i, 1]
        if governs and high > block.yield_acceleration:
            low = max(block.amplitude * wave.rises[i, 0], block.yield_acceleration)
            governs = stays_below_yield(block, low, high)
    return governs


@scalar
def forget(rests: np.ndarray) -> None:
    """Nothing is known of the pulses of a block yet; `rests` is (stretches, REST_COLUMNS)."""
    for k in range(rests.shape[0]):
        rests[k, _MOVED] = math.nan


@scalar
def remember(wave: Wave, k: int, now: Pulse, rests: np.ndarray) -> None:
    """Keep a pulse that began from rest in stretch k, if it came to rest before the next stretch.

    Up to there all stretches that are the `same` have the same pieces; its next pulse may come later, and did not
    matter.
    """
    last = wave.pieces.shape[0] - 1
    until = wave.pieces[wave.stretch[k + 1, 0], START] if k + 1 < wave.height.size else wave.pieces[last, END]
    if now.velocity == 0.0 and now.validity == 0 and now.stopped_at <= until:
        rests[wave.same[k], _MOVED], rests[wave.same[k], _HIGHEST] = now.displacement, now.peak


@scalar
def remembered(wave: Wave, k: int, rests: np.ndarray) -> Pulse:
    """The pulse from rest to rest in stretch k; its W is NaN where none is kept."""
    same = wave.same[k]
    return Pulse(0.0, rests[same, _MOVED], rests[same, _HIGHEST], 0.0, 0.0, 0)


def train_of(
    pulse: Callable[[Block, Options, Wave, Any, int, int, float], Pulse],
) -> Callable[[Block, Options, Wave, Any], Motion]:
    """The jitted train of a solver's pulses.

    A pulse is given block, options, wave, what the solver itself has tabulated, the stretch it begins in,
    the one in which the next begins (past the last, if none does) and the velocity carried into it.
    In the solver's table, `rests` is room for what is kept of pulses from rest to rest.
    """

    @scalar
    def pulses(
        block: Block, options: Options, wave: Wave, table: Any, k: int, until: int, velocity: float
    ) -> tuple[Pulse, int]:
        """Pulses from stretch k on, as long as they begin before piece `until`, as one; the next one's stretch."""
        displacement, peak, least, validity = 0.0, velocity, velocity, 0
        while k < wave.height.size and wave.stretch[k, 0] < until:
            following = first_pulse(block, wave, k + 1)
            now = remembered(wave, k, table.rests)
            if velocity > 0.0 or math.isnan(now.displacement):
                now = pulse(block, options, wave, table, k, following, velocity)
                if velocity == 0.0:
                    remember(wave, k, now, table.rests)
            k, velocity = following, now.velocity
            displacement += now.displacement
            peak, least = max(peak, now.peak), min(least, now.least)
            validity |= now.validity
            if velocity > 0.0 and now.validity == 0:
                validity |= NOT_RECOUPLED
            if math.isnan(now.displacement + now.peak) and validity & NO_VALUE == 0:
                validity |= UNSOLVED
            if validity & NO_VALUE:
                break
        return Pulse(velocity, displacement, peak, least, 0.0, validity), k

    @scalar
    def train(block: Block, options: Options, wave: Wave, table: Any) -> Motion:
        """All pulses of a stick-slip (or Newmark) block.

        Where the map of the repeated cycle returns to a velocity seen before, the cycles in between
        repeat; where the block never rests within it, the velocity changes by the same amount
        each time and W is an arithmetic series.
        """
        k = first_pulse(block, wave, 0)
        if k == wave.height.size:
            return Motion(0.0, 0.0, 0)
        validity = YIELD_GOVERNS if yield_governs(block, wave) else 0
        forget(table.rests)
        now, k = pulses(block, options, wave, table, k, wave.cycle[wave.lead], 0.0)
        velocity, displacement, peak = now.velocity, now.displacement, now.peak
        validity |= now.validity
        # what the cycles before the repeated one (a ramp, say) leave is the first velocity to come back to
        seen_velocity, seen_displacement, seen_at, next_look = velocity, displacement, 0, 1
        done, left = 0, wave.repeats
        after = k
        while left > 0 and validity & NO_VALUE == 0:
            before = velocity
            now, after = pulses(block, options, wave, table, k, wave.cycle[wave.lead + 1], before)
            validity |= now.validity
            if validity & NO_VALUE:
                break
            velocity = now.velocity
            displacement += now.displacement
            peak = max(peak, now.peak)
            done += 1
            left -= 1
            if before == 0.0 and velocity == 0.0:
                displacement += left * now.displacement
                break
            if now.least > 0.0:
                gain = velocity - before
                alike = float(left)
                if gain < 0.0:
                    alike = min(alike, math.floor(now.least / -gain))
                displacement += alike * now.displacement + math.pi * gain * alike * (alike + 1.0)
                velocity += alike * gain
                left -= int(alike)
                done += int(alike)
                if gain > 0.0:
                    peak = max(peak, now.peak + alike * gain)
            elif velocity == seen_velocity:
                period = done - seen_at
                displacement += (left // period) * (displacement - seen_displacement)
                left -= left // period * period
                seen_velocity = -1.0  # no further period fits
            elif done == next_look:
                seen_velocity, seen_displacement, seen_at = velocity, displacement, done
                next_look *= 2
        if validity & NO_VALUE == 0:
            now, after = pulses(block, options, wave, table, after, wave.pieces.shape[0], velocity)
            validity |= now.validity
            displacement += now.displacement
            peak = max(peak, now.peak)
        if validity & NO_VALUE:
            return Motion(math.nan, math.nan, validity)
        return Motion(displacement, peak, validity)

    return train
