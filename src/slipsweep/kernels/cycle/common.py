"""The common pulse of a record in one loop over its straight pieces; every other one is left to `cycle.pulse`.

Where E is convex from Üy to the peak and the plane outruns the block there, D > 0, onset and switch are one root each
for the whole pulse, and nothing else can happen in it but that a dip raises b.
docs/numerics.md#the-common-pulse-of-a-record
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    Block,
    inflection,
    opposite,
    relative_acceleration_root,
    response,
    response_root,
)
from slipsweep.kernels.cycle.eq4 import gains_of_straight
from slipsweep.kernels.linear import held_stop
from slipsweep.kernels.newmark import FIRST_VALUE, LARGER_VALUE, LAST_VALUE, LENGTH


class Peak(NamedTuple):
    """Üg at the peak of a pulse, and D of the friction that follows from it: at Üy and at the peak."""

    ground: float
    rate_at_yield: float
    rate_at_peak: float


class Levels(NamedTuple):
    """Of a pulse: Üg at which a block at rest begins to slide, and beyond which b follows Eq. 4; b at Üg = Üy."""

    onset: float
    switch: float
    held: float


class Slide(NamedTuple):
    """V, W since t1, b, Üg beyond which b follows Eq. 4, the largest V, slips from rest, whether the block slides.

    `ground` is Üg where it came to rest.  W is NaN where the pulse is not a common one.
    """

    velocity: float
    displacement: float
    held: float
    followed: float
    peak: float
    slips: int
    slides: bool
    ground: float


@scalar
def levels_of(block: Block, peak: Peak, velocity: float) -> Levels:
    """The levels of a pulse, entered with V; NaN, if it is not a common one."""
    least = block.yield_acceleration
    if not (inflection(block) <= least and peak.rate_at_peak > 0.0):
        return Levels(math.nan, math.nan, math.nan)
    onset = least if peak.rate_at_yield > 0.0 else relative_acceleration_root(block, least, peak.ground)
    held = max(least, least - peak.rate_at_yield) if velocity > 0.0 else onset
    switch = math.inf
    if peak.ground - peak.rate_at_peak > held:
        switch = response_root(block, held, least, peak.ground)
        if velocity > 0.0 and switch < onset:
            switch = math.nan  # b follows Eq. 4 while D < 0
    return Levels(onset, switch, held)


@scalar
def enters(lines: np.ndarray, p: int, end: int, scale: float, least: float) -> tuple[int, float]:
    """The first piece from p on, before `end`, on which Üg comes to Üy, and how long it lasts from there."""
    while p < end - 1 and scale * lines[p, LARGER_VALUE] <= least:
        p += 1
    x, x_end = scale * lines[p, FIRST_VALUE], scale * lines[p, LAST_VALUE]
    return p, lines[p, LENGTH] if x >= least else lines[p, LENGTH] * ((x_end - least) / (x_end - x))


@scalar
def along(block: Block, now: Slide, x: float, x_end: float, width: float) -> Slide:
    """Slide along a piece, or a part: b held up to where it follows Eq. 4, and V grows."""
    held_end, share = x_end, 0.0
    if x_end > now.followed and x_end > x:
        held_end = max(x, now.followed)
        share = (x_end - held_end) / (x_end - x)
    part = width * (1.0 - share)
    rate, rate_end, velocity, most = x - now.held, held_end - now.held, now.velocity, now.peak
    after = velocity + 0.5 * (rate + rate_end) * part
    stops = after <= 0.0 and rate_end < 0.0
    if opposite(rate, rate_end):
        extreme = velocity + 0.5 * rate * (rate / (rate - rate_end)) * part
        most = max(most, extreme)
        stops = stops or (rate < 0.0 and extreme <= 0.0)
    if stops:
        slope = (x_end - x) / width
        part = min(held_stop(velocity, rate, slope), part)
        moved = now.displacement + (velocity + (0.5 * rate + slope * part / 6.0) * part) * part
        return Slide(0.0, moved, now.held, now.followed, most, now.slips, False, x + slope * part)
    moved = now.displacement + (velocity + (rate / 3.0 + rate_end / 6.0) * part) * part
    if share > 0.0:
        gained, further = gains_of_straight(block, held_end, x_end - held_end, width * share)
        moved += after * (width * share) + further
        after += gained
        now = Slide(0.0, 0.0, response(block, x_end), x_end, 0.0, now.slips, True, 0.0)
    return Slide(after, moved, now.held, now.followed, max(most, after), now.slips, True, 0.0)


@scalar
def common_pulse(
    block: Block, peak: Peak, lines: np.ndarray, scale: float, p: int, width: float, end: int, velocity: float
) -> Slide:
    """From Üg = Üy on piece p, which lasts `width` from there, up to piece `end`: Üg = 0 (t5)."""
    none = Slide(0.0, math.nan, 0.0, 0.0, 0.0, 0, False, 0.0)
    least, levels = block.yield_acceleration, levels_of(block, peak, velocity)
    onset = levels.onset
    if math.isnan(onset + levels.switch) or scale * lines[p, FIRST_VALUE] > least:
        return none
    now = Slide(velocity, 0.0, levels.held, levels.switch, velocity, 0, velocity > 0.0, least)
    x, fell = least, False
    for q in range(p, end):
        if q > p:
            x, width = scale * lines[q, FIRST_VALUE], lines[q, LENGTH]
        x_end, after_fall = scale * lines[q, LAST_VALUE], fell
        fell = x > x_end
        rate, rate_end = x - now.held, x_end - now.held
        after = now.velocity + 0.5 * (rate + rate_end) * width
        same_way = (x >= onset or fell) and x_end <= now.followed and not opposite(rate, rate_end)
        if same_way and now.slides and after > 0.0:
            # most pieces: V grows or falls, but not to zero
            moved = now.displacement + (now.velocity + (rate / 3.0 + rate_end / 6.0) * width) * width
            now = Slide(after, moved, now.held, now.followed, max(now.peak, after), now.slips, True, 0.0)
            continue
        if not now.slides and x == x_end and x >= least:
            return none
        if now.slides and x < onset and (x == x_end or (after_fall and not fell)):
            # b anew (`pulse.reset_held`): from the onset to the peak E is not more than b
            raised = max(now.held, response(block, x))
            if raised > now.held and levels.switch < math.inf:
                return none
            now = Slide(now.velocity, now.displacement, raised, now.followed, now.peak, now.slips, True, x)
        rests_at, begins_at, left = x, x, width
        while now.slides or (not fell and x_end > onset):
            if not now.slides:
                if rests_at > onset:
                    return none
                if levels.held != onset:  # it was b of a block that entered in motion
                    levels = levels_of(block, peak, 0.0)
                begins_at, left = onset, width * ((x_end - onset) / (x_end - x))
                now = Slide(0.0, now.displacement, onset, levels.switch, now.peak, now.slips + 1, True, x)
            now = along(block, now, begins_at, x_end, left)
            if now.slides:
                break
            rests_at = now.ground
    return now
