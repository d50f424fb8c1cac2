"""The stepping kernel: the paper's motion in steps of phase, V += (Üg − Ü) h.

Ü is the acceleration of the block: Üg while it sticks, Eq. 4 or a held b while it slides, that of
Eq. 12 from t5 on.  A rule is the polynomial through the rate Üg − Ü at one, two or three points of
a step; V and W are its integrals.

==========  =====================  =====  ==================================
rule        rate taken at          order  also known as
==========  =====================  =====  ==================================
rectangle   start                  1      Euler; the paper's
trapezoid   start, end             2      linear acceleration
simpson     start, middle, end     4      Runge-Kutta 4 for a rate free of V
==========  =====================  =====  ==================================

`advance` is one step, `acceleration` is Ü of a block that slides (option `rise`), `cut_step` finds
the events in a step, `pulse` is t1 to t5 and Eq. 12.  Of a friction law only μ(Üg) is used.
docs/numerics.md#step-solver
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.kernels import block as physics
from slipsweep.kernels import excitation
from slipsweep.kernels import pulse as pulses
from slipsweep.kernels.block import Block
from slipsweep.kernels.events import root_of
from slipsweep.kernels.grid import cell_at
from slipsweep.kernels.series import Gain, series_of
from slipsweep.kernels.train import cell_solver_of
from slipsweep.model import equations as eq
from slipsweep.model.friction import exponential
from slipsweep.motion.pieces import Piece, Wave

#: Rules by which steps are taken.
RECTANGLE = 0
TRAPEZOID = 1
SIMPSON = 2
#: How b goes on besides the ways of `block.rise`: held (Üg falls), and by Eq. 4 without a stop
#: (continuous sliding). Callers say int(HELD): for a constant numba compiles all that takes it once
#: more.
HELD = 3
FOLLOWED = 4
#: From its onset to the largest D a slide takes N/64 steps at least, N a cycle; no cut makes a step
#: shorter than this.
SHARE_OF_CYCLE = 64.0
LEAST_STEP = 1e-14
#: Accelerations nearer to each other than this part of Üg are one.
ROUNDING = 1e-12


class Steps(NamedTuple):
    """How steps are taken: all on a piece have one length, so that they end where it does."""

    rule: int
    per_cycle: int  # steps in 2π of phase, at least
    workspace: (
        np.ndarray
    )  # (2, 2 per_cycle + 1): Üg, and Üg − Ü by Eq. 4, at ends and middles of the steps on a piece


class State(NamedTuple):
    """The block: V, W, its acceleration b while it slides (`held`), the largest and the least V, whether it slides.

    `began` is the phase of the onset, and `growth` how long D grows from there: that limits steps
    (`longest_step`).
    """

    velocity: float
    displacement: float
    held: float
    peak: float
    least: float
    sliding: bool
    began: float
    growth: float


class Point(NamedTuple):
    """An instant: τ on its piece, Üg, and D = Üg − Ü by Eq. 4, whether or not the block follows it."""

    tau: float
    base: float
    rate: float


@inlined
def rate_polynomial(
    rule: int, start: float, middle: float, end: float
) -> tuple[float, float, float]:
    """The rate c₀ + c₁ s + c₂ s², s from 0 to 1, by that at the start, the middle and the end of a step."""
    if rule == RECTANGLE:
        return start, 0.0, 0.0
    if rule == TRAPEZOID:
        return start, end - start, 0.0
    return start, 4.0 * middle - 3.0 * start - end, 2.0 * (start + end) - 4.0 * middle


@inlined
def mean_rate(c0: float, c1: float, c2: float, s: float) -> float:
    """Mean of the rate up to the part s of a step."""
    return c0 + s * (0.5 * c1 + s * c2 / 3.0)


@scalar
def _minus_velocity(
    where: tuple[float, float, float, float, float], s: float
) -> tuple[float, float]:
    velocity, h, c0, c1, c2 = where
    return -velocity - mean_rate(c0, c1, c2, s) * h * s, -h * (c0 + s * (c1 + s * c2))


_stop = root_of(_minus_velocity)


@inlined
def advance(
    rule: int,
    start: float,
    middle: float,
    end: float,
    h: float,
    may_stop: bool,
    held: float,
    state: State,
) -> tuple[float, State]:
    """One step, V += (Üg − Ü) h: the part of it that is taken, 1 but for a stop, and the block then, with b = `held`.

    `start`, `middle` and `end` are Üg − Ü there.  V is largest or least where the rate changes its
    sign.
    """
    c0, c1, c2 = rate_polynomial(rule, start, middle, end)
    # V += (Üg − Ü) h
    taken = 1.0
    velocity = state.velocity + mean_rate(c0, c1, c2, 1.0) * h
    turn = 1.0
    extreme = velocity
    if physics.opposite(c0, c0 + c1 + c2):
        turn = 2.0 / (math.sqrt((c1 / c0) * (c1 / c0) - 4.0 * (c2 / c0)) - c1 / c0)
        extreme = state.velocity + mean_rate(c0, c1, c2, turn) * h * turn
    least = min(velocity, extreme)
    stops = may_stop and (least < 0.0 or (least == 0.0 and state.velocity > 0.0))
    if stops:
        low, high = (turn, 1.0) if extreme > state.velocity else (0.0, turn)
        taken = _stop((state.velocity, h, c0, c1, c2), low, high, 0.5 * (low + high), 0.0)
        velocity = 0.0
        least = 0.0
        h = taken * h
    displacement = (
        state.displacement
        + (state.velocity + (0.5 * c0 + taken * (c1 / 6.0 + taken * c2 / 12.0)) * h) * h
    )
    peak = max(state.peak, velocity, extreme)
    least = min(state.least, least)
    return taken, State(
        velocity,
        displacement,
        held,
        peak,
        least,
        state.sliding and not stops,
        state.began,
        state.growth,
    )


@inlined
def acceleration(how: int, yield_acceleration: float, b: float, eq4: float) -> float:
    """Ü of a block that slides, given what it was (b) and what Eq. 4 gives: by the option `rise`, HELD or FOLLOWED."""
    if how == physics.NEWMARK:
        return yield_acceleration
    if how == physics.MONOTONE:
        return max(b, eq4)
    return b if how == HELD else eq4


@inlined
def eq4_rate(block: Block, x: float) -> float:
    """Üg − Ü at Üg = x with Ü by Eq. 4 and friction by the law (Eq. 6); for Newmark's block Ü = Üy."""
    if block.rise == physics.NEWMARK:
        return x - block.yield_acceleration
    return eq.relative_acceleration(
        x, physics.friction(block, x), block.mu_s, block.tan_theta, block.g
    )


@scalar
def tabulate(
    block: Block, piece: Piece, first: int, half: float, base: np.ndarray, rates: np.ndarray
) -> None:
    """Write Üg, and the rate by Eq. 4, at τ = `half` times `first`, `first` + 1, … on a piece (SIMD)."""
    base[:] = 0.0
    for k in range(piece.degree - 1, -1, -1):
        coefficient = piece.coefficients[k]
        for j in range(base.size):
            base[j] = (base[j] + coefficient) * ((first + j) * half)
    for j in range(base.size):
        base[j] = math.copysign(block.amplitude * (piece.top + base[j]), piece.top)
        rates[j] = eq4_rate(block, base[j])


@scalar
def point_at(block: Block, piece: Piece, tau: float) -> Point:
    """The instant τ on a piece, whose side of Üg = 0 it takes where rounding would take the other's."""
    x = math.copysign(excitation.base_acceleration(piece, block.amplitude, tau), piece.top)
    return Point(tau, x, eq4_rate(block, x))


@inlined
def beyond(point: Point, state: State) -> float:
    """How far Eq. 4 is beyond Ü of the block: below Üg if it rests, so that it slides, above b if it slides."""
    return point.base - point.rate - state.held if state.sliding else point.rate


@inlined
def turns(first: float, half: float, last: float) -> bool:
    """Whether a parabola through three values has its vertex between them, and that is a maximum."""
    return 4.0 * half - 3.0 * first - last > 0.0 > first - 4.0 * half + 3.0 * last


@scalar
def _beyond_and_slope(where: tuple[Block, Piece, State, float], tau: float) -> tuple[float, float]:
    block, piece, state, part = where
    value = beyond(point_at(block, piece, tau), state)
    return value, (beyond(point_at(block, piece, tau + part), state) - value) / part


_crossing = root_of(_beyond_and_slope)


@scalar
def next_event(
    block: Block, piece: Piece, start: Point, end: Point, state: State
) -> tuple[Point, Point]:
    """The event of a step, and where `beyond` has its maximum in it (each `end`, if there is none).

    The event is where `beyond` becomes positive; of a slide on Eq. 4 it is the maximum, from which
    on b is held.
    """
    middle = point_at(block, piece, 0.5 * (start.tau + end.tau))
    top = end
    first = beyond(start, state)
    half = beyond(middle, state)
    last = beyond(end, state)
    if turns(first, half, last):
        low = start.tau
        high = end.tau
        for _ in range(50):  # the largest value, by thirds
            left = low + (high - low) / 3.0
            right = high - (high - low) / 3.0
            lower = beyond(point_at(block, piece, left), state) < beyond(
                point_at(block, piece, right), state
            )
            low, high = (left, high) if lower else (low, right)
        top = point_at(block, piece, 0.5 * (low + high))
        top = top if beyond(top, state) > max(first, last) + ROUNDING * end.base else end
    if first >= 0.0 and not state.sliding:
        return start, top
    if first >= -ROUNDING * start.base and state.sliding:
        return top, top
    if beyond(top, state) <= 0.0:
        return end, top
    where = (block, piece, state, 1e-4 * (top.tau - start.tau))
    tau = _crossing(where, start.tau, top.tau, 0.5 * (start.tau + top.tau), 0.0)
    x = excitation.base_acceleration(piece, block.amplitude, tau)
    # Ü is by Eq. 4 there, without its rounding
    return Point(tau, x, x - state.held if state.sliding else 0.0), top


@inlined
def begun(block: Block, at: Point, phase: float, growth: float, state: State) -> State:
    """The block as it begins to slide (t1), after which its rate grows for a phase."""
    b = min(
        acceleration(
            block.rise, block.yield_acceleration, block.yield_acceleration, at.base - at.rate
        ),
        at.base,
    )
    return State(
        state.velocity, state.displacement, b, state.peak, state.least, True, phase, growth
    )


@scalar
def onset(
    block: Block, piece: Piece, start: Point, end: Point, state: State
) -> tuple[Point, State]:
    """t1, if a block at rest begins to slide before `end`: Üg ≥ Üy, and Eq. 4 falls below Üg."""
    if end.base < block.yield_acceleration:
        return end, state
    if start.base < block.yield_acceleration:
        tau = min(
            max(excitation.offset_at(piece, block.amplitude, block.yield_acceleration), start.tau),
            end.tau,
        )
        start = Point(tau, block.yield_acceleration, eq4_rate(block, block.yield_acceleration))
    began, top = next_event(block, piece, start, end, state)
    if began.tau >= end.tau:
        return end, state
    growth = (top.tau if top.tau < end.tau else piece.finish) - began.tau
    return began, begun(block, began, excitation.phase_at(piece, began.tau), growth, state)


@inlined
def rate(how: int, point: Point, b: float) -> float:
    """Üg − b; where b is by Eq. 4, without its rounding."""
    by_eq4 = how == FOLLOWED or (how != HELD and point.base - point.rate == b)
    return point.rate if by_eq4 else point.base - b


@inlined
def slide(
    block: Block, rule: int, how: int, start: Point, middle: Point, end: Point, state: State
) -> tuple[float, State]:
    """One step of a block that slides: the part of it up to a stop, and the block then."""
    yields = block.yield_acceleration
    may_stop = how != FOLLOWED
    b = acceleration(how, yields, state.held, start.base - start.rate)
    b_middle = acceleration(how, yields, b, middle.base - middle.rate)
    b_end = acceleration(how, yields, b, end.base - end.rate)
    first = rate(how, start, b)
    first = (
        max(first, 0.0) if may_stop and state.velocity == 0.0 else first
    )  # rounding may not stop what starts here
    half = rate(how, middle, b_middle)
    last = rate(how, end, b_end)
    return advance(rule, first, half, last, end.tau - start.tau, may_stop, b_end, state)


@inlined
def longest_step(per_cycle: int, phase: float, state: State) -> float:
    """The longest step from a phase on: of a slide shorter than steps (64/N) `growth`, then (16/N) (φ − `began`)."""
    return max(
        SHARE_OF_CYCLE / per_cycle * max(state.growth, 0.25 * (phase - state.began)), LEAST_STEP
    )


@inlined
def is_whole(
    how: int, start: Point, middle: Point, end: Point, longest: float, limit: float, state: State
) -> bool:
    """Whether a step is taken as it is: nothing happens in it that a look at its three instants could show."""
    if not state.sliding or end.tau - start.tau > longest:
        return False
    if how == HELD or abs(start.rate - 2.0 * middle.rate + end.rate) > limit:
        return how == HELD
    first = beyond(start, state)
    half = beyond(middle, state)
    last = beyond(end, state)
    return how != physics.MONOTONE or not (turns(first, half, last) or first < 0.0 < last)


@scalar
def cut_step(
    block: Block,
    piece: Piece,
    rule: int,
    per_cycle: int,
    how: int,
    start: Point,
    end: Point,
    limit: float,
    state: State,
) -> State:
    """A step in parts: cut at t1, where Eq. 4 comes beyond b or turns back, at the stop, and where it is too long."""
    size = end.tau - start.tau
    while start.tau < end.tau:
        if not state.sliding and how != HELD:
            start, state = onset(block, piece, start, end, state)
        if not state.sliding:
            break
        longest = min(
            2.0 * size, longest_step(per_cycle, excitation.phase_at(piece, start.tau), state)
        )
        cut = end if start.tau + longest >= end.tau else point_at(block, piece, start.tau + longest)
        middle = point_at(block, piece, 0.5 * (start.tau + cut.tau))
        bend = abs(start.rate - 2.0 * middle.rate + cut.rate)
        while bend > limit and cut.tau - start.tau > LEAST_STEP:
            # friction may decay in a layer that is thinner than steps
            cut = middle
            middle = point_at(block, piece, 0.5 * (start.tau + middle.tau))
            bend = abs(start.rate - 2.0 * middle.rate + cut.rate)
        if how == physics.MONOTONE:
            event, _ = next_event(block, piece, start, cut, state)
            cut = event if event.tau - start.tau > LEAST_STEP else cut
            middle = point_at(block, piece, 0.5 * (start.tau + cut.tau))
        size = cut.tau - start.tau
        taken, state = slide(block, rule, how, start, middle, cut, state)
        stopped = start.tau + taken * size
        start = cut if state.sliding or stopped <= start.tau else point_at(block, piece, stopped)
    return state


@scalar
def walk(
    block: Block,
    pieces: np.ndarray,
    steps: Steps,
    p: int,
    tau: float,
    until: float,
    how: int,
    state: State,
) -> State:
    """From τ to `until` on piece p, step by step."""
    piece = pieces[p]
    per_cycle = steps.per_cycle
    limit = math.inf
    count = max(math.ceil((piece.finish - piece.begin) / (2.0 * math.pi) * per_cycle - 1e-9), 1)
    h = (piece.finish - piece.begin) / count
    # steps are counted from the anchor, so that mirrored pieces have mirrored values
    last = count if piece.begin == 0.0 else 0
    first = last - count + min(max(int((tau - piece.begin) / h), 0), count - 1)
    size = 2 * (last - first) + 1
    base = steps.workspace[0, :size]
    rates = steps.workspace[1, :size]
    tabulate(block, piece, 2 * first, 0.5 * h, base, rates)
    if how != HELD and block.rise != physics.NEWMARK:
        # a second difference of (32/N)² of what friction makes of Üg − Ü at most, or of rounding
        most = (block.g + block.amplitude * block.tan_theta) * physics.friction(block, 0.0)
        limit = (0.5 * SHARE_OF_CYCLE / per_cycle) ** 2 * most + ROUNDING * block.amplitude
    start = point_at(block, piece, tau)
    for step in range(first, last):
        if start.tau >= until or (how == HELD and not state.sliding):
            break
        at = 2 * (step - first)
        middle = Point((step + 0.5) * h, base[at + 1], rates[at + 1])
        end = Point((step + 1) * h, base[at + 2], rates[at + 2])
        if end.tau > until or start.tau > step * h:
            end = end if end.tau <= until else point_at(block, piece, until)
            middle = point_at(block, piece, 0.5 * (start.tau + end.tau))
        longest = longest_step(per_cycle, excitation.phase_at(piece, start.tau), state)
        after = state
        whole = is_whole(how, start, middle, end, longest, limit, state)
        if whole:
            _, after = slide(block, steps.rule, how, start, middle, end, state)
        if not whole or not (
            after.sliding or how == HELD
        ):  # after a stop on a rise a slide may begin anew
            after = cut_step(block, piece, steps.rule, per_cycle, how, start, end, limit, state)
        state = after
        start = end
    return state


@single
def pulse(
    block: Block,
    options: physics.Options,
    wave: Wave,
    steps: Steps,
    k: int,
    following: int,
    velocity: float,
) -> pulses.Pulse:
    """A pulse of the paper: t1 to t5 in interval k of Üg > 0, and Eq. 12 up to the `following` one (see `train`)."""
    pieces = wave.pieces
    end = wave.interval[k, 1]
    p, tau = pulses.beginning(block, wave, k)
    b = physics.starting_acceleration(
        block, max(block.amplitude * pieces[p].first, block.yield_acceleration)
    )
    state = State(velocity, 0.0, b, velocity, velocity, velocity > 0.0, -math.inf, 0.0)
    for q in range(p, end):
        begin = tau if q == p else pieces[q].begin
        rises = pieces[q].first <= pieces[q].last
        if (
            pieces[q].jumps and not rises
        ):  # a step of no length: b as on a rise, or a slide begins here
            top = point_at(block, pieces[q], begin)
            if state.sliding:
                _, state = slide(block, int(RECTANGLE), block.rise, top, top, top, state)
            elif top.base >= block.yield_acceleration and top.rate > 0.0:
                held = physics.starting_acceleration(block, top.base)
                growth = excitation.offset_at(pieces[q], block.amplitude, held) - begin
                state = begun(block, top, pieces[q].start, growth, state)
        if rises:
            state = walk(block, pieces, steps, q, begin, pieces[q].finish, block.rise, state)
        elif state.sliding:
            state = walk(block, pieces, steps, q, begin, pieces[q].finish, int(HELD), state)
    if state.sliding and state.held <= 0.0:
        return pulses.Pulse(0.0, math.nan, math.nan, 0.0, 0.0, physics.KD_NOT_POSITIVE)
    t5 = pieces[end - 1].end
    next_p = pieces.shape[0]
    next_tau = 0.0
    begins = math.inf
    if following < wave.height.size:
        next_p, next_tau = pulses.beginning(block, wave, following)
        begins = excitation.phase_at(pieces[next_p], next_tau)
    if options.recoupling == physics.INTEGRATE:
        for q in range(end, min(next_p + 1, pieces.shape[0])):
            if state.sliding:
                until = next_tau if q == next_p else pieces[q].finish
                state = walk(block, pieces, steps, q, pieces[q].begin, until, int(HELD), state)
    velocity = state.velocity
    displacement = state.displacement
    if state.sliding and (options.recoupling != physics.INTEGRATE or begins == math.inf):
        displacement += eq.attenuated_displacement(velocity, state.held, begins - t5)
        velocity = eq.attenuated_velocity(velocity, state.held, begins - t5)
    return pulses.Pulse(velocity, displacement, state.peak, min(state.least, velocity), 0.0, 0)


@scalar
def follow(block: Block, wave: Wave, steps: Steps, c: int, p: int, tau: float) -> Gain:
    """Eq. 4 throughout, from rest at τ on piece p to the end of cycle c."""
    state = State(0.0, 0.0, 0.0, 0.0, 0.0, True, -math.inf, 0.0)
    for q in range(p, wave.cycle[c + 1]):
        begin = tau if q == p else wave.pieces[q].begin
        state = walk(
            block, wave.pieces, steps, q, begin, wave.pieces[q].finish, int(FOLLOWED), state
        )
    return Gain(state.velocity, state.displacement, state.peak)


solve_cell = cell_solver_of(pulse, series_of(follow), pulses.yield_seems_to_govern)


@kernel
def solve_steps(
    cells: np.ndarray,
    options: physics.Options,
    wave: Wave,
    rule: int,
    per_cycle: int,
    results: np.ndarray,
) -> None:
    """Solve the cells of a tile by steps; `results` is (fields of `Motion`, cells)."""
    steps = Steps(rule, per_cycle, np.empty((2, 2 * per_cycle + 1)))
    for j in range(cells.size):
        physics.store(
            solve_cell(exponential(), cell_at(cells, j), options, wave, steps), j, results
        )
