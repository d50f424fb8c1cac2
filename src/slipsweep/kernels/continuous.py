"""Continuous sliding from event to event: Eq. 4 throughout.

docs/numerics.md#continuous-sliding
"""

import math

import numpy as np

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.kernels import block as physics
from slipsweep.kernels import exact
from slipsweep.kernels.block import Block, Options
from slipsweep.kernels.eq4 import eq4_integrals, lag_integrals
from slipsweep.kernels.exact import MOST_STAGES, Workspace, inside, next_break
from slipsweep.kernels.excitation import offset_at, phase_at
from slipsweep.kernels.pulse import Pulse
from slipsweep.kernels.series import Gain, series_of
from slipsweep.motion.pieces import Wave


@scalar
def zeros_on_one_side(block: Block, end: float, zeros: np.ndarray) -> int:
    """Where on the way from Üg = 0 to `end` D changes its sign; their number, or −1 if one is not found."""
    count = 0
    x = math.copysign(0.0, end)
    inner = inside(x, end)
    if physics.inflection(block) <= 0.0 and physics.opposite(
        physics.relative_acceleration(block, inner), physics.relative_acceleration(block, end)
    ):
        # D bends to one side only
        zeros[0] = physics.relative_acceleration_root(block, inner, end)
        return -1 if math.isnan(zeros[0]) else 1
    for _ in range(MOST_STAGES):
        target = next_break(block, x, end)
        inner = inside(x, target)
        if physics.opposite(
            physics.relative_acceleration(block, inner),
            physics.relative_acceleration(block, target),
        ):
            zeros[count] = physics.relative_acceleration_root(block, inner, target)
            if math.isnan(zeros[count]):
                return -1
            count += 1
        x = target
        if x == end:
            break
    return count


@scalar
def find_zeros(block: Block, wants_peak: bool, wave: Wave, workspace: Workspace) -> bool:
    """Write where V may be largest, the zeros of D, into the workspace if that is wanted; whether all were found."""
    for side in range(2):
        workspace.zero_counts[side] = 0
        if wants_peak:
            end = block.amplitude * (wave.highest if side == 0 else wave.lowest)
            workspace.zero_counts[side] = zeros_on_one_side(block, end, workspace.zeros[side])
    return workspace.zero_counts[0] >= 0 and workspace.zero_counts[1] >= 0


@inlined
def most_gained(
    block: Block, wave: Wave, q: int, start: float, end: float, workspace: Workspace
) -> float:
    """The most that V gains on a part of piece q up to a zero of D (−∞, if it has none)."""
    pieces = wave.pieces
    amplitude = block.amplitude
    highest = -math.inf
    side = 0 if pieces[q].top > 0.0 else 1
    first = amplitude * pieces[q].first
    last = amplitude * pieces[q].last
    for i in range(workspace.zero_counts[side]):
        zero = workspace.zeros[side, i]
        if min(first, last) < zero < max(first, last):
            at = offset_at(pieces[q], amplitude, zero)
            if start < at < end:
                highest = max(highest, eq4_integrals(block, pieces[q], start, at)[0])
    return highest


@scalar
def follow_eq4(
    block: Block, wave: Wave, workspace: Workspace, p: int, tau: float, until: int, tau_until: float
) -> Gain:
    """Eq. 4 from rest, τ on piece p, to `tau_until` on piece `until`, by `lag_integrals`; a log has its parts."""
    pieces = wave.pieces
    log = workspace.log
    logged = 0
    velocity = 0.0
    displacement = 0.0
    peak = 0.0
    # apart, because over a symmetric cycle they cancel to the last digit
    above = 0.0
    below = 0.0
    both = 0.0
    for q in range(p, min(until + 1, pieces.shape[0])):
        start = tau if q == p else pieces[q].begin
        end = tau_until if q == until else pieces[q].finish
        if not end > start:
            continue
        if log.size:
            begins = phase_at(pieces[q], start)
            ends = phase_at(pieces[q], end)
            exact.note(
                log[logged],
                exact.SLIDE_ON,
                q,
                start,
                begins,
                ends,
                math.nan,
                velocity,
                displacement,
            )
            logged += 1
        peak = max(peak, velocity + most_gained(block, wave, q, start, end, workspace))
        lag = lag_integrals(block, pieces[q], start, end)
        upper = pieces[q].top > 0.0
        side_g = block.g if upper else -block.g
        displacement += (
            velocity * (end - start) + side_g * lag.second + block.tan_theta * lag.second_x
        )
        above = above + (lag.first if upper else 0.0)
        below = below + (0.0 if upper else lag.first)
        both += lag.first_x
        velocity = block.g * (above - below) + block.tan_theta * both
        peak = max(peak, velocity)
    workspace.logged[0] = logged
    return Gain(velocity, displacement, peak)


@scalar
def _follow_cycle(
    block: Block, wave: Wave, workspace: Workspace, c: int, p: int, tau: float
) -> Gain:
    return follow_eq4(block, wave, workspace, p, tau, wave.cycle[c + 1], -math.inf)


_slide = series_of(_follow_cycle)


@scalar
def slide_continuously(block: Block, options: Options, wave: Wave, workspace: Workspace) -> Pulse:
    """Continuous sliding from the first Üg ≥ Üy on, as one pulse."""
    if not find_zeros(block, options.wants_peak, wave, workspace):
        return Pulse(math.nan, math.nan, math.nan, 0.0, 0.0, 0)
    return _slide(block, options, wave, workspace)
