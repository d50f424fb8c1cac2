"""One pulse of a block that sticks and slips, from event to event (the paper's Fig. 2).

Üg rises: the block sticks until t1 (`onset`) and then slides in stages, on which b is held or
follows Eq. 4 (`next_stage`).  Üg falls: b is held (`hold`).  From Üg = 0 (t5) on, Eq. 12 takes V
down, or b is held on (`recouple`).  Each part is integrated in closed form, or by quadrature to
rounding.  docs/model.md#motion, docs/numerics.md#onset-and-switch and docs/numerics.md#stop
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import scalar, single
from slipsweep.kernels.base import base_acceleration, held_gains, offset_at, phase_at
from slipsweep.kernels.block import (
    INTEGRATE,
    KD_NOT_POSITIVE,
)
from slipsweep.kernels.eq4 import (
    Block,
    Quantity,
    eq4_gains,
    eq4_root,
    follows_eq4,
    inflection,
    opposite,
    relative_acceleration,
    relative_acceleration_root,
    response,
    slopes,
)
from slipsweep.kernels.roots import root_of, straight_stop
from slipsweep.kernels.sampling import GROUND_ACCELERATION, fill_sample, has_sample
from slipsweep.kernels.slide import (
    ATTENUATES,
    FOLLOWS_EQ4,
    HELD,
    MOST_STAGES,
    Slide,
    begin_to_slide,
    gain,
)
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Base, Curve, Path, Piece

#: The signs of a stage are read `_SLIVER` of its length behind its start, and `_ROUNDING` times
#: |Üg| at least: at the start itself, which may be a root, the sign is rounding.
_SLIVER = 1e-10
_ROUNDING = 4.5e-16


class Place(NamedTuple):
    """A place on a path: the number of a piece, and τ on it."""

    piece: int
    tau: float


# ----------------------------------------------------------- the rise, as a function of Üg alone


@scalar
def rising_acceleration(block: Block, held: float, x: float) -> float:
    """Return b of a block that slides, as the base comes to x and does not fall.

    At the onset, with Üy for the b before, it is the paper's c(x).
    """
    by_eq4 = response(block, x)
    return by_eq4 if follows_eq4(block, held, by_eq4, math.inf) else held


@scalar
def inside(x: float, end: float) -> float:
    """Return a place just beyond x on the way to `end`; at x, perhaps a root, signs
    are rounding.
    """
    way = end - x
    return x + math.copysign(min(max(_SLIVER * abs(way), _ROUNDING * abs(x)), abs(way)), way)


@scalar
def next_break(block: Block, x: float, end: float) -> float:
    """Return where on the way from x to `end` one of E, dE/dx and D ceases to be monotone."""
    inner = inside(x, end)
    if 0.0 < inner < inflection(block):
        end = min(inflection(block), end)
    before = slopes(block, inner)[1]
    after = slopes(block, end)[1]
    # dE/dx passes 1 where D turns and 0 where E turns; the one nearer to `before` comes first
    nearer = 1.0 if before > after else 0.0
    for turn in (nearer, 1.0 - nearer):
        if min(before, after) < turn < max(before, after):
            return eq4_root(block, Quantity.SLOPE, turn, inner, end, end)
    return end


@scalar
def onset(block: Block, x: float, top: float) -> float:
    """Return t1 as Üg: where a block at rest begins to slide on the rise from x ≥ Üy to `top`.

    The first D > 0; `top`, if there is none.
    """
    if relative_acceleration(block, inside(x, top)) > 0.0:
        return x
    for _ in range(MOST_STAGES):
        if x >= top:
            return top
        end = next_break(block, x, top)
        inner = inside(x, end)
        if relative_acceleration(block, inner) > 0.0:
            return x
        if relative_acceleration(block, end) > 0.0:
            return relative_acceleration_root(block, inner, end)
        x = end
    return top if x >= top else math.nan


class Stage(NamedTuple):
    """A part of a rise with one rule for b: Üg at its end, and if b follows Eq. 4, and after it."""

    end: float
    follows: bool
    follows_after: bool


@scalar
def next_stage(block: Block, x: float, top: float, slide: Slide) -> Stage:
    """Return the next stage of a slide on the rise from x to `top`.

    b is held until it follows E, and follows until E or D turns.  docs/numerics.md#onset-and-switch
    """
    end = top
    inner = inside(x, end)
    bends = inner < inflection(block)
    if bends:
        end = next_break(block, x, top)
        inner = inside(x, end)
    rate, slope, _ = slopes(block, inner)
    held = slide.held
    # a block that has followed E so far has no b that E would have to exceed
    if follows_eq4(block, -math.inf if slide.follows else held, inner - rate, slope):
        if not bends:
            # E is convex, D concave: it may be positive between two places where it is not
            end = next_break(block, x, top)
            inner = inside(x, end)
        if opposite(relative_acceleration(block, inner), relative_acceleration(block, end)):
            end = relative_acceleration_root(block, inner, end)
        return Stage(end, True, True)
    crosses = response(block, end) > held
    if crosses:
        end = eq4_root(block, Quantity.RESPONSE, held, inner, end, end)
    if x < held < end:  # from there on V grows
        return Stage(held, False, False)
    return Stage(end, False, crosses)


# -------------------------------------------------------------------- along a part of one piece


@single
def _lost(where: tuple[Block, Piece, Curve, Slide, float], tau: float) -> tuple[float, float]:
    """Return −V at τ, and its rate, of a part that begins at `start` with the slide's state."""
    block, piece, curve, slide, start = where
    x = base_acceleration(piece, curve, block.amplitude, tau)
    if slide.kind == FOLLOWS_EQ4:
        gained = eq4_gains(block, piece, curve, start, tau, slide)[0]
        return -slide.velocity - gained, -relative_acceleration(block, x)
    gained = held_gains(piece, curve, block.amplitude, slide.held, start, tau)[0]
    return -slide.velocity - gained, slide.held - x


_stop_root = root_of(_lost)


@scalar
def hold(
    block: Block,
    piece: Piece,
    curve: Curve,
    start: float,
    end: float,
    slide: Slide,
    samples: np.ndarray,
) -> float:
    """Slide with b held, dV/dτ = Üg − b, from start to end, or to the stop; return τ there."""
    slide.kind = HELD
    amplitude = block.amplitude
    held = slide.held
    velocity = slide.velocity
    rate = base_acceleration(piece, curve, amplitude, start) - held
    rate_end = base_acceleration(piece, curve, amplitude, end) - held
    gained, moved = held_gains(piece, curve, amplitude, held, start, end)
    low = start
    high = end
    stops = velocity + gained <= 0.0
    if rate_end >= 0.0 and (rate >= 0.0 or velocity <= 0.0):
        # nothing slows it: over a part so short that its gain is rounding, it does not stop
        stops = False
        gained = max(gained, 0.0)
    turns = opposite(rate, rate_end) and (rate > 0.0 or velocity > 0.0)
    if turns and (rate < 0.0 or stops or slide.wants_peak):
        # V turns where Üg = b; one that starts from rest there only seems to fall, by rounding
        turn = offset_at(piece, curve, amplitude, held)
        extreme = velocity + held_gains(piece, curve, amplitude, held, start, turn)[0]
        slide.peak = max(extreme, slide.peak)  # in this order a NaN is kept
        if rate > 0.0:
            low = turn
        else:
            slide.least = min(extreme, slide.least)
            stops = extreme <= 0.0
            high = turn
    if stops:
        end = start
        if velocity > 0.0 or rate > 0.0:
            if piece.degree <= 1:
                slope = amplitude * piece.slope
                end = min(start + straight_stop(velocity, rate, slope), high)
            else:
                where = (block, piece, curve, slide, start)
                end = _stop_root(where, low, high, 0.5 * (low + high), start)
        moved = held_gains(piece, curve, amplitude, held, start, end)[1]
    while has_sample(slide, samples, phase_at(piece, start), phase_at(piece, end)):
        part = held_gains(piece, curve, amplitude, held, start, start + slide.since)
        fill_sample(slide, samples, held, part[0], part[1])
    slide.slides = not stops
    gain(slide, 0.0 if stops else velocity + gained, velocity * (end - start) + moved)
    return end


@single
def follow(
    block: Block,
    piece: Piece,
    curve: Curve,
    start: float,
    end: float,
    slide: Slide,
    samples: np.ndarray,
) -> float:
    """Slide under Eq. 4, D of one sign, from start to end, or to the stop; return τ there."""
    slide.kind = FOLLOWS_EQ4
    velocity = slide.velocity
    gained, moved = eq4_gains(block, piece, curve, start, end, slide)
    stops = velocity + gained <= 0.0
    if stops:
        where = (block, piece, curve, slide, start)
        end = _stop_root(where, start, end, 0.5 * (start + end), start)
        moved = eq4_gains(block, piece, curve, start, end, slide)[1]
    while has_sample(slide, samples, phase_at(piece, start), phase_at(piece, end)):
        part = eq4_gains(block, piece, curve, start, start + slide.since, slide)
        acceleration = response(block, samples[GROUND_ACCELERATION, slide.sampled])
        fill_sample(slide, samples, acceleration, part[0], part[1])
    slide.slides = not stops
    gain(slide, 0.0 if stops else velocity + gained, velocity * (end - start) + moved)
    return end


# ---------------------------------------------------------------- along the pieces of a pulse


@scalar
def place_of(block: Block, base: Base, x: float, place: Place, last: int) -> Place:
    """Return where Üg comes to x, or jumps past it, from a place to the end of piece `last`."""
    p, tau = place
    while p < last and block.amplitude * max(base.pieces[p].first, base.pieces[p].last) <= x:
        p += 1
        tau = base.pieces[p].begin
    piece = base.pieces[p]
    if block.amplitude * piece.first >= x:
        return Place(p, tau)
    if block.amplitude * piece.last <= x:
        return Place(p, piece.finish)
    curve = base.curves[piece.curve]
    return Place(p, max(tau, offset_at(piece, curve, block.amplitude, x)))


@scalar
def rise(
    block: Block,
    base: Base,
    place: Place,
    last: int,
    x: float,
    slide: Slide,
    samples: np.ndarray,
) -> None:
    """Go from a place, where Üg = x, to the top of the rise at the end of piece `last`."""
    top = block.amplitude * base.pieces[last].last
    slide.follows = False
    for _ in range(MOST_STAGES * (1 + last - place.piece)):
        if not slide.slides:
            from_yield = max(x, block.yield_acceleration)
            began = onset(block, from_yield, top) if top > block.yield_acceleration else top
            if began >= top:
                return
            if began > x:
                place = place_of(block, base, began, place, last)
            # at an onset beyond Üy, E = Üg: to evaluate it there would add the rounding of g μs
            held = began
            if began <= from_yield:
                held = min(rising_acceleration(block, block.yield_acceleration, began), began)
            begin_to_slide(slide, held)
            slide.follows = False
            x = began
        stage = next_stage(block, x, top, slide)
        until = place_of(block, base, stage.end, place, last)
        p, tau = place
        while True:
            piece = base.pieces[p]
            curve = base.curves[piece.curve]
            end = until.tau if p == until.piece else piece.finish
            if stage.follows:
                tau = follow(block, piece, curve, tau, end, slide, samples)
            else:
                tau = hold(block, piece, curve, tau, end, slide, samples)
            if not slide.slides or p == until.piece:
                break
            p += 1
            tau = base.pieces[p].begin
        if not slide.slides and (p < until.piece or tau < until.tau):
            place = Place(p, tau)
            x = base_acceleration(piece, curve, block.amplitude, tau)
            if stage.follows:  # D < 0 up to the end of the stage: no slide begins before
                place = until
                x = stage.end
            continue
        place = until
        x = stage.end
        slide.follows = stage.follows_after
        if stage.follows:
            slide.held = response(block, x)
        if x >= top:
            return
    slide.displacement = math.nan


@scalar
def reset_held(block: Block, piece: Piece, x: float, slide: Slide) -> None:
    """Update b where a piece begins by a jump or plateau at Üg = x, or begin to slide (t1)."""
    if slide.slides:
        slide.held = rising_acceleration(block, slide.held, x)
    elif x >= block.yield_acceleration and piece.first >= piece.last:
        held = rising_acceleration(block, block.yield_acceleration, x)
        if held < x:
            begin_to_slide(slide, held)


@scalar
def attenuate(
    held: float, start: float, duration: float, slide: Slide, samples: np.ndarray
) -> None:
    """Take V, of either sign, down by Eq. 12 with Ümax = `held`, from the phase `start` on.

    The duration may be infinite.  docs/numerics.md#eq-12-over-an-interval
    """
    side = math.copysign(1.0, slide.velocity)
    speed = abs(slide.velocity)
    slide.kind = ATTENUATES
    slide.held = side * held
    while has_sample(slide, samples, start, start + min(duration, speed / held)):
        acceleration = samples[GROUND_ACCELERATION, slide.sampled] + slide.held
        gained = -slide.held * slide.since
        fill_sample(slide, samples, acceleration, gained, 0.5 * gained * slide.since)
    moved = eq.attenuated_displacement(speed, held, duration)
    gain(slide, side * eq.attenuated_velocity(speed, held, duration), side * moved)


@single
def recouple(
    block: Block,
    recoupling: int,
    base: Base,
    t5: int,
    following: Place,
    slide: Slide,
    samples: np.ndarray,
) -> int:
    """Go from Üg = 0, at piece `t5`, to the next pulse or to the stop; return flags.

    Option `recoupling`: by Eq. 12 with Ümax = b, or with b held on until the shaking ends, and then
    Eq. 12.  A block that slides with b ≤ 0 does not come to rest, and has no value.  The
    `following` place lies past the last piece if there is no next pulse.
    """
    if not slide.slides:
        return 0
    if slide.held <= 0.0:
        slide.displacement = math.nan
        return KD_NOT_POSITIVE
    count = base.pieces.size
    started = base.pieces[t5].start if t5 < count else base.pieces[count - 1].end
    ends = following.piece >= count
    if recoupling == INTEGRATE:
        for p in range(t5, count if ends else following.piece + 1):
            piece = base.pieces[p]
            end = following.tau if p == following.piece else piece.finish
            if slide.slides and end > piece.begin:
                curve = base.curves[piece.curve]
                hold(block, piece, curve, piece.begin, end, slide, samples)
        started = base.pieces[count - 1].end
    if not slide.slides or (recoupling == INTEGRATE and not ends):
        return 0
    duration = math.inf
    if not ends:
        duration = phase_at(base.pieces[following.piece], following.tau) - started
    attenuate(slide.held, started, duration, slide, samples)
    return 0


@scalar
def first_pulse(block: Block, path: Path, k: int) -> int:
    """Return the first interval from k on in which Üg exceeds Üy; their number if none does."""
    while k < path.intervals.size:
        if block.amplitude * path.intervals[k].height > block.yield_acceleration:
            break
        k += 1
    return k


@scalar
def beginning(block: Block, path: Path, k: int) -> Place:
    """Return the place in interval k at which Üg comes to Üy; past the last it is
    past all pieces.
    """
    if k >= path.intervals.size:
        return Place(path.base.pieces.size, 0.0)
    interval = path.intervals[k]
    begin = Place(interval.first, path.base.pieces[interval.first].begin)
    return place_of(block, path.base, block.yield_acceleration, begin, interval.end - 1)


@scalar
def stick_slip_pulse(
    block: Block,
    recoupling: int,
    base: Base,
    start: Place,
    t5: int,
    following: Place,
    slide: Slide,
    samples: np.ndarray,
) -> int:
    """Go from the place where Üg = Üy to that where the next pulse begins; return flags.

    Up to Üg = 0 (t5), at the beginning of piece `t5`, the block sticks until t1, slides as `rise`
    says while Üg rises, and with b held while it falls.
    """
    p, tau = start
    x = max(block.amplitude * base.pieces[p].first, block.yield_acceleration)
    slide.held = rising_acceleration(block, block.yield_acceleration, x)
    while p < t5:
        piece = base.pieces[p]
        curve = base.curves[piece.curve]
        if piece.resets_held:
            reset_held(block, piece, x, slide)
        if piece.first < piece.last:
            rise(block, base, Place(p, tau), piece.rise_end, x, slide, samples)
            p = piece.rise_end
        elif slide.slides:
            tau = hold(block, piece, curve, tau, piece.finish, slide, samples)
            if not slide.slides and piece.first == piece.last:  # a plateau: at once anew
                reset_held(block, piece, x, slide)
                if slide.slides:
                    hold(block, piece, curve, tau, piece.finish, slide, samples)
        p += 1
        if p < t5:
            x = block.amplitude * base.pieces[p].first
            tau = base.pieces[p].begin
    return recouple(block, recoupling, base, t5, following, slide, samples)
