"""One pulse from event to event, for waves and records: the exact walk.

While the base's acceleration Üg rises, the block sticks until t1 (`onset`), then slides in stages
that end at events (`next_stage`): its acceleration b is held, or follows Eq. 4.  While Üg falls b
is held (`hold`); from Üg = 0 (t5) on Eq. 12 takes V down, or b is held on (`recouple`).  Each stage
is integrated in closed form, or by quadrature to rounding (`eq4`).
docs/numerics.md#onset-and-switch and docs/numerics.md#stop
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import inlined, scalar, single, uncounted
from slipsweep.kernels import block as physics
from slipsweep.kernels import linear
from slipsweep.kernels.block import Block
from slipsweep.kernels.eq4 import eq4_integrals
from slipsweep.kernels.events import root_of
from slipsweep.kernels.excitation import (
    base_acceleration,
    held_gain,
    held_integrals,
    offset_at,
    phase_at,
)
from slipsweep.kernels.pulse import Pulse, beginning, rises_anew
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import Piece, Wave

#: The signs of a stage are read `_SLIVER` of its length behind its start, and `_ROUNDING` times
#: |Üg| at least: at the start itself, which may be a root, the sign is rounding.
_SLIVER = 1e-10
_ROUNDING = 4.5e-16

#: More stages than any rise has: five places where E, dE/dx or D turn, and a stop and an onset
#: between each.
MOST_STAGES = 32

#: Kinds of motion in a log of it: b held, b by Eq. 4, Eq. 12, and b by Eq. 4 whatever the sign of
#: V.
HOLD, FOLLOW, ATTENUATE, SLIDE_ON = range(4)

#: A log of the motion, for time histories: its kind, the piece, τ and phase where it starts, phase
#: at the end, and b, V and W at the start.
LOG = np.dtype(
    [
        ("kind", "i8"),
        ("piece", "i8"),
        ("tau", "f8"),
        ("start", "f8"),
        ("end", "f8"),
        ("held", "f8"),
        ("velocity", "f8"),
        ("displacement", "f8"),
    ]
)


class Workspace(NamedTuple):
    """What the exact kernels write into, one for all cells.

    `log` has one row for each part of a pulse if a history is requested, else none, and `logged`,
    (1,), is how many are in use; `zeros`, (2, MOST_STAGES), is for zeros of D on either side of Üg
    = 0, and `zero_counts`, (2,), for how many there are (`continuous`).
    """

    log: np.ndarray
    logged: np.ndarray
    zeros: np.ndarray
    zero_counts: np.ndarray


class State(NamedTuple):
    """The block in a pulse: V, W since its beginning, its acceleration b (`held`), and whether it slides.

    While it slides b is constant, or as last taken from Eq. 4.  Besides: the largest and the least
    V, slides that began from rest, and the rows of the log.
    """

    velocity: float
    displacement: float
    held: float
    sliding: bool
    peak: float
    least: float
    slips: float
    logged: int


class Part(NamedTuple):
    """A part of a slide along a piece: τ at its end, V then, W gained, the extremes of V, and whether it stops."""

    end: float
    velocity: float
    displacement: float
    peak: float
    least: float
    stops: bool


class RiseStage(NamedTuple):
    """A stage of a slide on the rise, on which b keeps one rule: Üg at its end, whether b follows Eq. 4, and then."""

    end: float
    follows: bool
    follows_after: bool


def workspace_of(wave: Wave, keeps_log: bool = False) -> Workspace:
    """A workspace for a wave; a log has as many rows as a pulse may have parts."""
    longest = int(np.diff(wave.interval, axis=1).max(initial=0))
    logged = longest * MOST_STAGES + wave.pieces.shape[0] + 3 if keeps_log else 0
    return Workspace(
        log=np.empty(logged, LOG),
        logged=np.zeros(1, np.int64),
        zeros=np.empty((2, MOST_STAGES)),
        zero_counts=np.zeros(2, np.int64),
    )


@single
def uncounted_workspace(workspace: Workspace) -> Workspace:
    """The same workspace (`decorators.uncounted`)."""
    return Workspace(
        uncounted(workspace.log),
        uncounted(workspace.logged),
        uncounted(workspace.zeros),
        uncounted(workspace.zero_counts),
    )


@inlined
def with_held(state: State, held: float) -> State:
    """The state with another b."""
    return State(
        state.velocity,
        state.displacement,
        held,
        state.sliding,
        state.peak,
        state.least,
        state.slips,
        state.logged,
    )


@inlined
def begun(state: State, held: float) -> State:
    """The state of a block at rest that begins to slide (t1)."""
    return State(
        0.0,
        state.displacement,
        held,
        True,
        state.peak,
        state.least,
        state.slips + 1.0,
        state.logged,
    )


@inlined
def state_after(
    state: State, part: Part, kind: int, pieces: np.ndarray, p: int, start: float, log: np.ndarray
) -> State:
    """The state after a part of a slide along piece p from τ = `start` on; the log has it, if one is kept."""
    logged = state.logged
    if log.size:
        begins = phase_at(pieces[p], start)
        ends = phase_at(pieces[p], part.end)
        note(
            log[logged],
            kind,
            p,
            start,
            begins,
            ends,
            state.held,
            state.velocity,
            state.displacement,
        )
        logged += 1
    return State(
        part.velocity,
        state.displacement + part.displacement,
        state.held,
        not part.stops,
        np.maximum(part.peak, state.peak),
        min(part.least, state.least),  # NaN is kept
        state.slips,
        logged,
    )


@scalar
def note(
    row: np.record,
    kind: int,
    piece: int,
    tau: float,
    start: float,
    end: float,
    held: float,
    velocity: float,
    displacement: float,
) -> None:
    """Write a part of the motion into a row of a log (`LOG`)."""
    row["kind"] = kind
    row["piece"] = piece
    row["tau"] = tau
    row["start"] = start
    row["end"] = end
    row["held"] = held
    row["velocity"] = velocity
    row["displacement"] = displacement


# ------------------------------------------------------------------ Eq. 4 on the rise, as a
# function of Üg alone


@inlined
def inside(x: float, end: float) -> float:
    """Where on the way from x to end the signs of a stage from x on are read, which is not at x itself."""
    way = end - x
    return x + math.copysign(min(max(_SLIVER * abs(way), _ROUNDING * abs(x)), abs(way)), way)


@scalar
def next_break(block: Block, x: float, end: float) -> float:
    """Where, on the way from x to end, one of E, dE/dx and D first ceases to be monotone."""
    inner = inside(x, end)
    if 0.0 < inner < physics.inflection(block):
        end = min(physics.inflection(block), end)
    before = physics.slopes(block, inner)[1]
    after = physics.slopes(block, end)[1]
    # dE/dx passes 1 where D turns and 0 where E turns; the one nearer to `before` comes first
    for turn in (1.0, 0.0) if before > after else (0.0, 1.0):
        if min(before, after) < turn < max(before, after):
            return physics.slope_root(block, turn, inner, end)
    return end


@inlined
def onset(block: Block, x: float, top: float) -> float:
    """t1: Üg on the rise from x ≥ Üy to `top` at which the block at rest starts to slide (`top` if it does not)."""
    if block.rise == physics.NEWMARK or physics.relative_acceleration(block, inside(x, top)) > 0.0:
        return x
    for _ in range(MOST_STAGES):
        if x >= top:
            break
        end = next_break(block, x, top)
        inner = inside(x, end)
        if physics.relative_acceleration(block, inner) > 0.0:
            return x
        if physics.relative_acceleration(block, end) > 0.0:
            return physics.relative_acceleration_root(block, inner, end)
        x = end
    return top if x >= top else math.nan


@inlined
def next_stage(block: Block, x: float, top: float, held: float, follows: bool) -> RiseStage:
    """The next stage of a slide on the rise from x to `top`; what `rise` does is decided here.

    Newmark: b = Üy to the top.  Literal: b = Eq. 4 throughout.  Monotone: b = max(b, Eq. 4), held
    until Eq. 4 comes to it, followed until Eq. 4 falls.  A stage that follows Eq. 4 ends where D
    changes its sign, too.
    """
    if block.rise == physics.NEWMARK:
        return RiseStage(top, False, False)
    end = top
    inner = inside(x, end)
    bends = inner < physics.inflection(block)
    if bends:
        end = next_break(block, x, top)
        inner = inside(x, end)
    eq4, slope, _ = physics.slopes(block, inner)
    follows = block.rise == physics.LITERAL or (slope > 0.0 and (follows or eq4 >= held))
    if follows:
        if (
            not bends
        ):  # E is convex, D concave: it may be positive between two places where it is not
            end = next_break(block, x, top)
            inner = inside(x, end)
        if physics.opposite(
            physics.relative_acceleration(block, inner), physics.relative_acceleration(block, end)
        ):
            end = physics.relative_acceleration_root(block, inner, end)
        return RiseStage(end, True, True)
    crosses = physics.response(block, end) > held
    if crosses:
        end = physics.response_root((block, held), inner, end, end, 0.0)
    if x < held < end:  # from there on V grows
        return RiseStage(held, False, False)
    return RiseStage(end, False, crosses)


# ------------------------------------------------------------------ along a part of one piece


@scalar
def _held_lost(where: tuple[Piece, float, float, float, float], tau: float) -> tuple[float, float]:
    """−V at τ of a hold that V entered at `start`, and its rate."""
    piece, amplitude, held, velocity, start = where
    left = velocity + held_gain(piece, amplitude, held, start, tau)
    return -left, held - base_acceleration(piece, amplitude, tau)


@scalar
def _followed_lost(where: tuple[Block, Piece, float, float], tau: float) -> tuple[float, float]:
    """−V at τ where b follows Eq. 4, and its rate."""
    block, piece, velocity, start = where
    left = velocity + eq4_integrals(block, piece, start, tau)[0]
    return -left, -physics.relative_acceleration(
        block, base_acceleration(piece, block.amplitude, tau)
    )


_held_stop = root_of(_held_lost)
_followed_stop = root_of(_followed_lost)


@inlined
def hold_integrals(
    piece: Piece, amplitude: float, held: float, rate: float, start: float, end: float
) -> tuple[float, float]:
    """Gains of V and W with b held on a part of a piece, at whose start Üg − b is `rate`."""
    if piece.degree <= 1:
        return linear.held_integrals(rate, amplitude * piece.coefficients[0], end - start)
    return held_integrals(piece, amplitude, held, start, end)


@inlined
def hold(
    piece: Piece, amplitude: float, held: float, velocity: float, start: float, end: float
) -> Part:
    """Slide with b held, V' = Üg − b, along a piece from start to end, or to the stop."""
    # most parts are whole pieces, whose ends are known
    x = (
        amplitude * piece.first
        if start == piece.begin
        else base_acceleration(piece, amplitude, start)
    )
    x_end = (
        amplitude * piece.last if end == piece.finish else base_acceleration(piece, amplitude, end)
    )
    rate = x - held
    rate_end = x_end - held
    slope = amplitude * piece.coefficients[0]
    straight = piece.degree <= 1
    gained, displaced = hold_integrals(piece, amplitude, held, rate, start, end)
    low = start
    high = end
    peak = velocity
    least = velocity
    stops = velocity + gained <= 0.0
    if rate_end >= 0.0 and (rate >= 0.0 or velocity <= 0.0):
        # nothing slows it: over a part so short that its gain is rounding, it does not stop
        stops = False
        gained = max(gained, 0.0)
    if physics.opposite(rate, rate_end) and (rate > 0.0 or velocity > 0.0):
        # V turns where x = b; one that starts from rest there only seems to fall, by rounding
        if straight:
            turn = start - rate / slope
            extreme = velocity - 0.5 * rate * (rate / slope)
        else:
            turn = offset_at(piece, amplitude, held)
            extreme = velocity + held_gain(piece, amplitude, held, start, turn)
        if rate > 0.0:
            peak = max(extreme, peak)  # in this order a NaN is kept
            low = turn
        else:
            least = min(extreme, least)
            stops = extreme <= 0.0
            high = turn
    if stops:
        end = start
        if velocity > 0.0 or rate > 0.0:
            if straight:
                end = min(start + linear.held_stop(velocity, rate, slope), high)
            else:
                where = (piece, amplitude, held, velocity, start)
                end = _held_stop(where, low, high, 0.5 * (low + high), start)
        displaced = hold_integrals(piece, amplitude, held, rate, start, end)[1]
    last = 0.0 if stops else velocity + gained
    return Part(
        end, last, velocity * (end - start) + displaced, max(peak, last), min(least, last), stops
    )


@inlined
def follow(block: Block, piece: Piece, velocity: float, start: float, end: float) -> Part:
    """Slide under Eq. 4 along a piece, on which D keeps its sign, from start to end or to the stop."""
    gained, displaced = eq4_integrals(block, piece, start, end)
    last = velocity + gained
    stops = last <= 0.0
    if stops:
        end = _followed_stop(
            (block, piece, velocity, start), start, end, 0.5 * (start + end), start
        )
        last = 0.0
        displaced = eq4_integrals(block, piece, start, end)[1]
    moved = velocity * (end - start) + displaced
    return Part(end, last, moved, max(last, velocity), min(last, velocity), stops)


# ------------------------------------------------------------------ along the pieces of a pulse


@inlined
def place_of(
    block: Block, pieces: np.ndarray, x: float, p: int, tau: float, last: int
) -> tuple[int, float]:
    """Where on the rise from τ on piece p to the end of piece `last` the base's acceleration comes to x."""
    while p < last and block.amplitude * pieces[p].last < x:
        p += 1
        tau = pieces[p].begin
    if block.amplitude * pieces[p].last <= x:
        return p, pieces[p].finish
    return p, max(tau, offset_at(pieces[p], block.amplitude, x))


@inlined
def rise(
    block: Block,
    pieces: np.ndarray,
    first: int,
    last: int,
    tau: float,
    x: float,
    state: State,
    log: np.ndarray,
) -> State:
    """From Üg = x, τ on piece `first`, to the top of the rise at the end of piece `last`, stage by stage."""
    amplitude = block.amplitude
    top = block.amplitude * pieces[last].last
    p = first
    follows = block.rise == physics.LITERAL
    for _ in range(MOST_STAGES * (1 + last - first)):
        if not state.sliding:
            began = top
            if top > block.yield_acceleration:
                began = onset(block, max(x, block.yield_acceleration), top)
            if began >= top:
                return state
            if began > x:
                p, tau = place_of(block, pieces, began, p, tau, last)
            # at an onset beyond Üy Eq. 4 meets Üg: to evaluate it there would add the rounding of g
            # μs
            beyond = began > max(x, block.yield_acceleration)
            b = began if beyond else min(physics.starting_acceleration(block, began), began)
            state = begun(state, b)
            follows = block.rise == physics.LITERAL
            x = began
        stage = next_stage(block, x, top, state.held, follows)
        until, tau_until = place_of(block, pieces, stage.end, p, tau, last)
        while True:
            end = tau_until if p == until else pieces[p].finish
            if stage.follows:
                part = follow(block, pieces[p], state.velocity, tau, end)
            else:
                part = hold(pieces[p], amplitude, state.held, state.velocity, tau, end)
            state = state_after(state, part, FOLLOW if stage.follows else HOLD, pieces, p, tau, log)
            tau = part.end
            if not state.sliding or p == until:
                break
            p += 1
            tau = pieces[p].begin
        if not state.sliding and (p < until or tau < tau_until):
            if stage.follows:  # D < 0 up to the end of the stage: no slide begins before
                p = until
                tau = tau_until
                x = stage.end
            else:
                x = base_acceleration(pieces[p], amplitude, tau)
            continue
        x = stage.end
        follows = stage.follows_after
        state = with_held(state, physics.response(block, x) if stage.follows else state.held)
        if x >= top:
            return state
    return State(
        math.nan, math.nan, state.held, True, math.nan, math.nan, state.slips, state.logged
    )


@inlined
def reset_held(block: Block, pieces: np.ndarray, p: int, x: float, state: State) -> State:
    """Reset b of a block that slides where piece p, Üg = x, begins, or begin a slide there (t1), if not by a rise."""
    if state.sliding:
        if block.rise == physics.NEWMARK:
            return state
        eq4 = physics.response(block, x)
        return with_held(state, eq4 if block.rise == physics.LITERAL else max(state.held, eq4))
    if x >= block.yield_acceleration and pieces[p].first >= pieces[p].last:
        b = physics.starting_acceleration(block, x)
        if b < x:
            return begun(state, b)
    return state


@inlined
def end_of_rise(pieces: np.ndarray, p: int, end: int) -> int:
    """The last piece of the rise that begins with piece p, before piece `end`."""
    while p + 1 < end and pieces[p].last == pieces[p + 1].first < pieces[p + 1].last:
        p += 1
    return p


@inlined
def hold_on(
    pieces: np.ndarray,
    p: int,
    amplitude: float,
    start: float,
    end: float,
    state: State,
    log: np.ndarray,
) -> State:
    """The state after `hold`."""
    part = hold(pieces[p], amplitude, state.held, state.velocity, start, end)
    return state_after(state, part, HOLD, pieces, p, start, log)


@single
def recouple(
    block: Block,
    recoupling: int,
    pieces: np.ndarray,
    q: int,
    p: int,
    tau: float,
    state: State,
    log: np.ndarray,
) -> State:
    """From Üg = 0 (t5) at the beginning of piece q to the next pulse, τ on piece p, or to the stop.

    By Eq. 12 with Ümax = b, or with b held on.  p lies past the last piece if there is no next
    pulse.
    """
    count = pieces.shape[0]
    started = pieces[q].start if q < count else pieces[q - 1].end
    if recoupling == physics.INTEGRATE:
        while state.sliding and q < min(p + 1, count):
            end = tau if q == p else pieces[q].finish
            if end > pieces[q].begin:
                state = hold_on(pieces, q, block.amplitude, pieces[q].begin, end, state, log)
            q += 1
        started = pieces[count - 1].end
    if not state.sliding or (p < count and recoupling == physics.INTEGRATE):
        return state
    duration = math.inf if p >= count else phase_at(pieces[p], tau) - started
    logged = state.logged
    if log.size:
        stop = started + min(duration, state.velocity / state.held)
        note(
            log[logged],
            ATTENUATE,
            0,
            0.0,
            started,
            stop,
            state.held,
            state.velocity,
            state.displacement,
        )
        logged += 1
    velocity = eq.attenuated_velocity(state.velocity, state.held, duration)
    displacement = state.displacement + eq.attenuated_displacement(
        state.velocity, state.held, duration
    )
    return State(
        velocity,
        displacement,
        state.held,
        state.sliding,
        state.peak,
        min(state.least, velocity),
        state.slips,
        logged,
    )


@single
def pulse(
    block: Block,
    options: physics.Options,
    wave: Wave,
    workspace: Workspace,
    k: int,
    following: int,
    velocity: float,
) -> Pulse:
    """From Üg = Üy in interval k to that in the `following` one, or to the end of the motion if none follows.

    Up to Üg = 0 (t5) the block sticks until t1, slides as `rise` says while Üg rises and with b
    held while it falls.
    """
    pieces = wave.pieces
    log = workspace.log
    end = wave.interval[k, 1]
    q, tau = beginning(block, wave, k)
    x = max(block.amplitude * pieces[q].first, block.yield_acceleration)
    state = State(
        velocity=velocity,
        displacement=0.0,
        held=physics.starting_acceleration(block, x),
        sliding=velocity > 0.0,
        peak=velocity,
        least=velocity,
        slips=0.0,
        logged=0,
    )
    while q < end:
        if rises_anew(pieces, q):
            state = reset_held(block, pieces, q, x, state)
        if pieces[q].first < pieces[q].last:
            last = end_of_rise(pieces, q, end)
            state = rise(block, pieces, q, last, tau, x, state, log)
            q = last
        elif state.sliding:
            level = pieces[q].first == pieces[q].last
            part = hold(
                pieces[q], block.amplitude, state.held, state.velocity, tau, pieces[q].finish
            )
            state = state_after(state, part, HOLD, pieces, q, tau, log)
            if level and part.stops:
                state = reset_held(block, pieces, q, x, state)
                if state.sliding:
                    state = hold_on(
                        pieces, q, block.amplitude, part.end, pieces[q].finish, state, log
                    )
        q += 1
        x = block.amplitude * pieces[min(q, end - 1)].first
        tau = pieces[min(q, end - 1)].begin
    if state.sliding:
        if state.held <= 0.0:  # by Eq. 12 the block does not come to rest
            return Pulse(0.0, math.nan, math.nan, 0.0, state.slips, physics.KD_NOT_POSITIVE)
        next_p = pieces.shape[0]
        next_tau = 0.0
        if following < wave.height.size:
            next_p, next_tau = beginning(block, wave, following)
        state = recouple(block, options.recoupling, pieces, end, next_p, next_tau, state, log)
    workspace.logged[0] = state.logged
    least = min(state.least, state.velocity)
    return Pulse(state.velocity, state.displacement, state.peak, least, state.slips, 0)
