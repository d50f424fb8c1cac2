"""What the stepping kernel takes of a whole wave: cycles of continuous sliding, and whether Eq. 4 acts at all."""

import math
from collections.abc import Callable
from typing import Any

from slipsweep.jit.decorators import scalar
from slipsweep.kernels import block as physics
from slipsweep.kernels.block import Block
from slipsweep.kernels.excitation import phase_at
from slipsweep.kernels.pulse import Pulse, beginning, first_pulse
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import BEGIN, END, FINISH, TOP, Wave
from slipsweep.motion.steps import RECTANGLE, TRAPEZOID, Steps

#: Intervals of a rise at whose ends `yield_governs` looks at Eq. 4.
_INTERVALS = 32


@scalar
def yield_governs(block: Block, wave: Wave) -> bool:
    """Whether Eq. 4 stays at or below Üy on all rises; not said of Newmark's block, which knows no Eq. 4."""
    largest = -math.inf if block.rise != physics.NEWMARK else math.inf
    for i in range(wave.rises.shape[0]):
        low, high = block.amplitude * wave.rises[i, 0], block.amplitude * wave.rises[i, 1]
        low, before, now = max(low, block.yield_acceleration), math.inf, -math.inf
        for j in range(_INTERVALS + 1 if high > block.yield_acceleration else 0):
            eq4 = physics.response(block, low + (high - low) * (j / _INTERVALS))
            if before < now > eq4:  # the vertex of the parabola through three
                largest = max(largest, now + (eq4 - before) * (eq4 - before) / (8.0 * (2.0 * now - before - eq4)))
            largest, before, now = max(largest, eq4), now, eq4
    return largest <= block.yield_acceleration


@scalar
def drift(block: Block, w: float) -> float:
    """The part of Üg − Ü by Eq. 4 that is the same at w and −w."""
    x = block.amplitude * w
    return eq.drift(x, physics.friction(block, x), block.mu_s, block.tan_theta)


@scalar
def mirrored_gain(block: Block, wave: Wave, steps: Steps) -> float:
    """Gain of V over the repeated cycle, whose halves mirror each other: what both sides share, twice.

    The rest cancels.  In V it would leave its rounding, and on a plane nearly level that is more than the gain.
    """
    gain, ends, middles = 0.0, 0.5, 0.0  # what the rule takes of the rates at the ends and in the middle of a step
    if steps.rule != RECTANGLE and steps.rule != TRAPEZOID:
        ends, middles = 1.0 / 6.0, 2.0 / 3.0
    for p in range(wave.cycle[wave.lead], wave.cycle[wave.lead + 1]):
        h = (wave.pieces[p, FINISH] - wave.pieces[p, BEGIN]) / steps.counts[p]
        for i in range(steps.counts[p] if wave.pieces[p, TOP] > 0.0 else 0):
            j = steps.at[p] + 2 * i
            first, last = drift(block, steps.w[j]), drift(block, steps.w[j + 2])
            mean = first if steps.rule == RECTANGLE else ends * (first + last)
            gain += 2.0 * h * (mean + middles * drift(block, steps.w[j + 1]))
    return gain


def series_of(follow: Callable[..., Any]) -> Callable[[Block, Wave, Steps], Pulse]:
    """The jitted series of the cycles of continuous sliding.

    ``follow(block, pieces, steps, p, tau, last, until)`` is the block (V, W, largest V) after Eq. 4 from rest at τ on
    piece p to `until` on piece `last`.
    """

    @scalar
    def slide_continuously(block: Block, wave: Wave, steps: Steps) -> Pulse:
        """Continuous sliding from the first Üg ≥ Üy on, as one pulse: Eq. 4 throughout."""
        pieces = wave.pieces
        velocity, displacement, peak, gain, moved, most, known = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1
        k = first_pulse(block, wave, 0)
        p, tau = beginning(block, wave, k) if k < wave.height.size else (pieces.shape[0], 0.0)
        for c in range(wave.shape.size):
            first, last = wave.cycle[c], wave.cycle[c + 1] - 1
            if last < p:
                continue
            repeats = float(wave.repeats if wave.repeats > 0 and c == wave.lead else 1)
            begin, end = pieces[first, BEGIN], pieces[last, FINISH]
            if first <= p:
                before = follow(block, pieces, steps, first, begin, p, tau)
                after = follow(block, pieces, steps, p, tau, last, end)
                velocity, displacement, peak = after.velocity, after.displacement, after.peak
                rest = pieces[last, END] - phase_at(pieces, p, tau)
                gain, moved = before.velocity + velocity, before.displacement + before.velocity * rest + displacement
                most = max(before.peak, before.velocity + peak)
                repeats -= 1.0
            elif wave.shape[c] != known:
                whole = follow(block, pieces, steps, first, begin, last, end)
                gain, moved, most = whole.velocity, whole.displacement, whole.peak
            known = wave.shape[c]
            if steps.mirrored and c == wave.lead:
                gain = mirrored_gain(block, wave, steps)
            if repeats > 0.0:
                peak = max(peak, velocity + most + max(0.0, (repeats - 1.0) * gain))
                displacement += repeats * (moved + math.pi * (2.0 * velocity + gain * (repeats - 1.0)))
                velocity += repeats * gain
        return Pulse(velocity, displacement, peak, 0.0, 0.0, 0.0, 0)

    return slide_continuously
