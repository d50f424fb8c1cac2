"""Continuous sliding from event to event: Eq. 4 throughout, V of either sign.

docs/numerics.md#continuous-sliding
"""

import math
from typing import Any

import numpy as np

from slipsweep.jit.decorators import scalar, single
from slipsweep.kernels.base import offset_at, phase_at
from slipsweep.kernels.eq4 import (
    Block,
    LagIntegrals,
    eq4_gains,
    inflection,
    lag_integrals,
    opposite,
    relative_acceleration,
    relative_acceleration_root,
    response,
)
from slipsweep.kernels.sampling import GROUND_ACCELERATION, fill_sample, has_sample
from slipsweep.kernels.slide import (
    MOST_STAGES,
    SLIDES_ON,
    Slide,
    begin_pulse,
)
from slipsweep.kernels.stick_slip import Place, attenuate, inside, next_break
from slipsweep.motion.paths import Base, Path

#: `LagIntegrals` over a whole piece of a wave's cycle, once they are known.
KEPT_LAGS = np.dtype(
    (
        np.record,
        np.dtype(
            [(name, np.float64) for name in LagIntegrals._fields] + [("known", np.bool_)],
            align=True,
        ),
    )
)


@scalar
def find_velocity_extremes(block: Block, wants_peak: bool, path: Path, slide: Slide) -> None:
    """Find the Üg, of either sign, at which D changes its sign, if the largest V is requested.

    V may be largest there.  They go into `zeros` of the slide; one that is not found is NaN.
    """
    # where E has no inflection D bends to one side only, and changes its sign once at most
    bends = inflection(block) > 0.0
    for side in range(2):
        count = 0
        end = block.amplitude * (path.highest if side == 0 else path.lowest)
        x = math.copysign(0.0, end)
        for _ in range(MOST_STAGES if wants_peak else 0):
            if x == end:
                break
            target = end
            inner = inside(x, target)
            at_end = relative_acceleration(block, target)
            if bends or not opposite(relative_acceleration(block, inner), at_end):
                target = next_break(block, x, end)
                inner = inside(x, target)
                at_end = relative_acceleration(block, target)
            if opposite(relative_acceleration(block, inner), at_end):
                slide.zeros[side, count] = relative_acceleration_root(block, inner, target)
                count += 1
            x = target
        slide.zero_counts[side] = count


@single
def most_gained(block: Block, base: Base, p: int, start: float, end: float, slide: Slide) -> float:
    """Return the most that V gains on a part of piece p up to a zero of D; −∞, if it has none."""
    piece = base.pieces[p]
    curve = base.curves[piece.curve]
    side = 0 if piece.top > 0.0 else 1
    first = block.amplitude * piece.first
    last = block.amplitude * piece.last
    most = -math.inf
    for i in range(slide.zero_counts[side]):
        zero = slide.zeros[side, i]
        if math.isnan(zero):
            return zero
        if min(first, last) < zero < max(first, last):
            tau = offset_at(piece, curve, block.amplitude, zero)
            if start < tau < end:
                most = max(most, eq4_gains(block, piece, curve, start, tau, slide)[0])
    return most


@single
def lag_on(
    block: Block, base: Base, p: int, begin: float, end: float, place: int, slide: Slide, lags: Any
) -> LagIntegrals:
    """Return `LagIntegrals` on piece p; of a whole curve they are kept, by `place` in the cycle."""
    piece = base.pieces[p]
    curve = base.curves[piece.curve]
    is_whole = begin == piece.begin and end == piece.finish
    if piece.degree <= 1 or place >= lags.size or not is_whole:
        return lag_integrals(block, piece, curve, begin, end, slide)
    kept = lags[place]
    if not kept.known:
        lag = lag_integrals(block, piece, curve, begin, end, slide)
        kept.first = lag.first
        kept.second = lag.second
        kept.first_x = lag.first_x
        kept.second_x = lag.second_x
        kept.known = True
    return LagIntegrals(kept.first, kept.second, kept.first_x, kept.second_x)


@scalar
def follow_eq4(
    block: Block,
    base: Base,
    start: Place,
    until: Place,
    first: int,
    slide: Slide,
    lags: np.ndarray,
    samples: np.ndarray,
) -> None:
    """Follow Eq. 4 from a place, where V and W are 0, to another one.

    In a cycle of a wave, which begins with the piece `first`, `lags` has what is known of whole
    pieces; for a record it is empty.
    """
    begin_pulse(slide, 0.0)
    slide.kind = SLIDES_ON
    # apart, because over a symmetric cycle they cancel to the last digit
    above = 0.0
    below = 0.0
    lag_x = 0.0
    velocity = 0.0
    last = until.piece + 1 if until.piece < base.pieces.size else until.piece
    for p in range(start.piece, last):
        piece = base.pieces[p]
        curve = base.curves[piece.curve]
        begin = start.tau if p == start.piece else piece.begin
        end = until.tau if p == until.piece else piece.finish
        if not end > begin:
            continue
        began = phase_at(piece, begin)
        while has_sample(slide, samples, began, phase_at(piece, end)):
            gained, moved = eq4_gains(block, piece, curve, begin, begin + slide.since, slide)
            acceleration = response(block, samples[GROUND_ACCELERATION, slide.sampled])
            fill_sample(slide, samples, acceleration, gained, moved)
        if slide.zero_counts[0] + slide.zero_counts[1] > 0:
            most = velocity + most_gained(block, base, p, begin, end, slide)
            slide.peak = max(most, slide.peak)  # in this order a NaN is kept
        lag = lag_on(block, base, p, begin, end, p - first, slide, lags)
        side_g = math.copysign(block.g, piece.top)
        slide.displacement += (
            velocity * (end - begin) + side_g * lag.second + block.tan_theta * lag.second_x
        )
        if piece.top > 0.0:
            above += lag.first
        else:
            below += lag.first
        lag_x += lag.first_x
        velocity = block.g * (above - below) + block.tan_theta * lag_x
        slide.velocity = velocity
        slide.peak = max(slide.peak, velocity)


@single
def continuous_pulse(
    block: Block,
    path: Path,
    k: int,
    start: Place,
    following: int,
    next_place: Place,
    velocity: float,
    slide: Slide,
    lags: np.ndarray,
    samples: np.ndarray,
) -> None:
    """Go from Üg = Üy in interval k of a record, entered with a `velocity`, to the next pulse.

    Eq. 4 holds through the negative half wave and, if the pulse of the `following` interval is next
    to that, up to the pulse; else Eq. 12, with Ümax = E at the peak of the pulse, takes V to zero
    from there on.  docs/records.md
    """
    count = path.base.pieces.size
    until = path.intervals[k].next_end
    place = Place(until, 0.0)
    ends = path.base.pieces[count - 1].end
    if until < count:
        place = Place(until, path.base.pieces[until].begin)
        ends = path.base.pieces[until].start
    begins = math.inf
    if next_place.piece < count:
        begins = phase_at(path.base.pieces[next_place.piece], next_place.tau)
        if following == k + 1 and path.intervals[following].first == until:
            place = next_place
            ends = begins
    follow_eq4(block, path.base, start, place, start.piece, slide, lags, samples)
    began = phase_at(path.base.pieces[start.piece], start.tau)
    slide.displacement += velocity * (ends - began)
    slide.velocity += velocity
    slide.peak += velocity
    slide.velocity_before = 0.0
    slide.slips = 1.0 if velocity == 0.0 else 0.0
    if begins > ends:
        held = response(block, block.amplitude * path.intervals[k].height)
        attenuate(held, ends, begins - ends, slide, samples)
