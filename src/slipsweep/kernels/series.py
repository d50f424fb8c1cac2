"""Continuous sliding over all cycles: one cycle of each shape, and the repeated ones as an arithmetic series.

Both solvers bring their own way along Eq. 4; what follows from it over many cycles stands here.
docs/numerics.md#continuous-sliding
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import Block, Options
from slipsweep.kernels.pulse import Pulse, beginning, first_pulse
from slipsweep.motion.pieces import Wave


class Gain(NamedTuple):
    """V and W gained from rest, and the largest V on the way."""

    velocity: float
    displacement: float
    peak: float


def series_of(
    follow: Callable[[Block, Wave, Any, int, int, float], Gain],
) -> Callable[[Block, Options, Wave, Any], Pulse]:
    """The jitted series of the cycles of continuous sliding.

    ``follow(block, wave, workspace, c, p, tau)`` is Eq. 4 from rest at τ on piece p to the end of
    cycle c of the table.
    """

    @scalar
    def slide_continuously(block: Block, options: Options, wave: Wave, workspace: Any) -> Pulse:
        """Continuous sliding from the first Üg ≥ Üy on, as one pulse: Eq. 4 throughout."""
        velocity = 0.0
        displacement = 0.0
        peak = 0.0
        whole = Gain(0.0, 0.0, 0.0)
        known = -1
        k = first_pulse(block, wave, 0)
        p, tau = beginning(block, wave, k) if k < wave.height.size else (wave.pieces.shape[0], 0.0)
        for c in range(wave.shape.size):
            first = wave.cycle[c]
            repeats = wave.repeats if wave.repeats > 0 and c == wave.lead else 1
            if wave.cycle[c + 1] <= p:
                continue
            if first <= p:
                velocity, displacement, peak = follow(block, wave, workspace, c, p, tau)
                repeats -= 1
            if repeats == 0:
                continue
            if wave.shape[c] != known:
                whole = follow(block, wave, workspace, c, first, wave.pieces[first].begin)
                known = wave.shape[c]
            later = repeats - 1.0
            peak = max(peak, max(velocity, velocity + later * whole.velocity) + whole.peak)
            displacement += repeats * (
                whole.displacement + math.pi * (2.0 * velocity + whole.velocity * later)
            )
            velocity += repeats * whole.velocity
        return Pulse(velocity, displacement, peak, 0.0, 0.0, 0)

    return slide_continuously
