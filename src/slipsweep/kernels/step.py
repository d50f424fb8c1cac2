"""The paper's block, stepped in time: V += (Üg − Ü) h.

What the block does is its phase: it says what Ü is (`rate`).  The base's motion comes in monotone
pieces, from one zero, peak or sample to the next (`walk`).  Along a piece the block takes equal
steps (`step_along`) by one of three rules (`advance`).  A step in which a phase ends (`excess`) is
taken up to there, and the block goes on in the next phase.

Time is the phase ωt here, so that V = ωv and W = ω²u; under a record it is the time at scale 1.
docs/numerics.md#step-solver
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, registered, scalar, single
from slipsweep.kernels import block as flags
from slipsweep.kernels.block import (
    EQ12,
    LITERAL,
    MONOTONE,
    NEWMARK,
    NO_VALUE,
    Cell,
    Motion,
    Options,
)
from slipsweep.model import equations as eq
from slipsweep.motion.paths import TERMS, Curve, Path, Piece

#: Rules by which steps are taken; their errors are of the orders 1, 2 and 4.
RECTANGLE = 0
TRAPEZOID = 1
SIMPSON = 2

#: Phases of the motion, each with its block acceleration Ü.
STUCK = 0  # Ü = Üg, V = 0
HELD = 1  # stick-slip: Ü = b, a constant
FOLLOWS = 2  # stick-slip: Ü by Eq. 4, b = Ü
ATTENUATES = 3  # from t5 on: Eq. 12
HELD_ON = 4  # from t5 on with recoupling = "integrate": Ü = b still
CONTINUOUS = 5  # continuous sliding: Ü by Eq. 4, V of either sign
DOWN = 6  # Newmark's block, V > 0: Ü = Üy
UP = 7  # Newmark's block, V < 0: Ü = −Üy,up


class Slide(NamedTuple):
    """What Ü depends on in a phase, besides Üg and V; `seconds` is the time of a unit of phase."""

    phase: int
    held: float  # b
    yield_acceleration: float
    upslope_yield_acceleration: float
    mu_s: float
    delta_mu: float
    decay_rate: float
    tan_theta: float
    g: float
    seconds: float


class Law(NamedTuple):
    """A friction law: μ(slide, Üg, v) with v in m/s, and whether it depends on v.

    Newmark's block keeps its yield acceleration, or (`is_strength`) has that of Coulomb with μ.
    """

    friction: Callable[..., float]
    knows_velocity: bool
    is_strength: bool


#: The cells that are stepped: a `Cell`, the yield acceleration upslope (NaN, if the block slides
#: downslope only), and the seconds in a unit of phase.
STEP_CELL = np.dtype(
    (np.record, [(name, "f8") for name in (*Cell._fields, "upslope_yield_acceleration", "seconds")])
)

#: A block: its parameters, how it is stepped, and its motion up to now.
BLOCK = np.dtype(
    (
        np.record,
        [
            ("amplitude", "f8"),  # A, or the factor on a record
            ("tan_theta", "f8"),
            ("mu_s", "f8"),
            ("delta_mu", "f8"),
            ("decay_rate", "f8"),
            ("yield_acceleration", "f8"),
            ("upslope_yield_acceleration", "f8"),
            ("g", "f8"),
            ("seconds", "f8"),
            ("mode", "i8"),  # `SlidingMode`; under a record that of the pulse
            ("rise", "i8"),
            ("recoupling", "i8"),
            ("rule", "i8"),
            ("steps", "i8"),  # in 2π of phase
            ("steps_on_piece", "i8"),  # under a record; else 0
            ("phase", "i8"),
            ("in_pulse", "i8"),  # from Üg = Üy to the end of the positive half wave
            ("held", "f8"),  # b
            ("velocity", "f8"),  # V
            ("displacement", "f8"),  # W
            ("largest_velocity", "f8"),
            ("least_velocity", "f8"),
            ("largest_displacement", "f8"),
            ("smallest_displacement", "f8"),
            ("onset", "f8"),  # when the slide began, and the rest of the piece from there
            ("growth", "f8"),
            ("slips", "f8"),
            ("stick_slip_pulses", "f8"),
            ("continuous_pulses", "f8"),
            ("validity", "i8"),
        ],
    )
)


#: A record of `BLOCK`; its fields have no types that mypy knows.
Block: TypeAlias = Any


class History(NamedTuple):
    """Samples of the motion, each (samples,); of the first `done[0]` Ü, V and W are filled in."""

    phases: np.ndarray
    ground_acceleration: np.ndarray
    block_acceleration: np.ndarray
    friction_coefficient: np.ndarray
    velocity: np.ndarray
    displacement: np.ndarray
    done: np.ndarray


class Steps(NamedTuple):
    """The base's motion at the ends of all steps, with Simpson's rule in their middles, too."""

    wave: np.ndarray  # (points,) Üg over the amplitude, piece after piece
    first: np.ndarray  # (pieces + 1,) where the points of a piece begin


#: From its onset to the end of the piece a slide takes N/64 steps at least, later a step is at most
#: 16/N of the time since the onset, so that slides shorter than a step are resolved.  No step is
#: cut shorter than the last number.
GROWTH_SHARE = 64.0
TIME_SHARE = 16.0
SHORTEST_STEP = 1e-14

#: Accelerations that differ by no more are equal: as parts of Üg and of g.
ROUNDING = 1e-12
LEAST_ROUNDING = 4e-16

#: Points of a rise at which Eq. 4 is compared with Üy (`yield_governs`).
POINTS_OF_RISE = 32


@registered
def exponential_friction(slide: Slide, ground: float, velocity: float) -> float:
    """Eq. 6, the friction law of the paper, which does not depend on the velocity."""
    return eq.friction_coefficient(ground, slide.mu_s, slide.delta_mu, slide.decay_rate, slide.g)


# ------------------------------------------------------------------ one step


@inlined
def slide_of(block: Block) -> Slide:
    """What Ü of a block depends on in its phase."""
    return Slide(
        block.phase,
        block.held,
        block.yield_acceleration,
        block.upslope_yield_acceleration,
        block.mu_s,
        block.delta_mu,
        block.decay_rate,
        block.tan_theta,
        block.g,
        block.seconds,
    )


@inlined
def eq4_rate(law: Law, slide: Slide, ground: float, velocity: float) -> float:
    """Üg − Ü with Ü by Eq. 4."""
    friction = law.friction(slide, ground, velocity * slide.seconds)
    return eq.relative_acceleration(ground, friction, slide.mu_s, slide.tan_theta, slide.g)


@inlined
def newmark_acceleration(law: Law, slide: Slide, ground: float, velocity: float) -> float:
    """Ü of Newmark's block: what it resists, by its yield acceleration or by Coulomb with μ."""
    if law.is_strength:
        friction = law.friction(slide, ground, velocity * slide.seconds)
        if slide.phase == UP:
            return -eq.coulomb_yield_acceleration(friction, -slide.tan_theta, slide.g)
        return eq.coulomb_yield_acceleration(friction, slide.tan_theta, slide.g)
    if slide.phase == UP:
        return -slide.upslope_yield_acceleration
    return slide.yield_acceleration


@inlined
def rate(law: Law, slide: Slide, ground: float, velocity: float) -> float:
    """Rate of V, Üg − Ü, in a phase; Eq. 12 takes no steps (`attenuate`)."""
    if slide.phase == HELD or slide.phase == HELD_ON:
        return ground - slide.held
    if slide.phase == DOWN or slide.phase == UP:
        return ground - newmark_acceleration(law, slide, ground, velocity)
    return eq4_rate(law, slide, ground, velocity)


@scalar
def eq4_rate_at_rest(law: Law, block: Block, ground: float) -> float:
    """Üg − Ü with Ü by Eq. 4 and V = 0: positive where a block at rest begins to slide."""
    return eq4_rate(law, slide_of(block), ground, 0.0)


@scalar
def eq4_of(law: Law, block: Block, ground: float) -> float:
    """Ü by Eq. 4 at the velocity of the block."""
    return ground - eq4_rate(law, slide_of(block), ground, block.velocity)


@inlined
def advance(
    law: Law,
    slide: Slide,
    rule: int,
    ground: tuple[float, float, float],
    h: float,
    velocity: float,
    first_rate: float,
) -> tuple[float, float, float, float]:
    """Take a step h from V: return the gains of V and W, and the rates in its middle and at its end.

    Üg is at the start, the middle and the end of the step; `first_rate` is the rate at the start.
    """
    middle = ground[1]
    end = ground[2]
    again = law.knows_velocity  # otherwise two rates at one Üg are the same
    if rule == RECTANGLE:  # Euler's
        gained = first_rate * h  # V += (Üg − Ü) h
        moved = (velocity + 0.5 * gained) * h
        last_rate = rate(law, slide, end, velocity + gained)
        return gained, moved, 0.5 * (first_rate + last_rate), last_rate
    if rule == TRAPEZOID:  # Heun's
        end_rate = rate(law, slide, end, velocity + first_rate * h)
        gained = 0.5 * (first_rate + end_rate) * h
        moved = (velocity + (2.0 * first_rate + end_rate) * h / 6.0) * h
        last_rate = rate(law, slide, end, velocity + gained) if again else end_rate
        return gained, moved, 0.5 * (first_rate + last_rate), last_rate
    # Runge's and Kutta's of order 4, which is Simpson's rule where friction does not depend on V
    early_rate = rate(law, slide, middle, velocity + 0.5 * h * first_rate)
    middle_rate = early_rate
    if again:
        middle_rate = rate(law, slide, middle, velocity + 0.5 * h * early_rate)
    end_rate = rate(law, slide, end, velocity + h * middle_rate)
    gained = (first_rate + 2.0 * (early_rate + middle_rate) + end_rate) * h / 6.0
    moved = (velocity + (first_rate + early_rate + middle_rate) * h / 6.0) * h
    last_rate = rate(law, slide, end, velocity + gained) if again else end_rate
    return gained, moved, middle_rate, last_rate


@inlined
def excess(
    law: Law,
    slide: Slide,
    monotone: bool,
    rises: bool,
    ground: tuple[float, float, float],
    rates: tuple[float, float, float],
    velocity: float,
) -> float:
    """Return what is positive at the end of a step in which the phase ends.

    A phase ends where V changes its sign.  While Üg rises b is no longer held where Eq. 4 exceeds
    it, and with the monotone rise it no longer follows Eq. 4 where that falls.  Üg and the rates
    are those at the start, the middle and the end of the step.
    """
    if slide.phase == CONTINUOUS:
        return -1.0
    if slide.phase == UP:
        return velocity
    rounding = ROUNDING * abs(ground[2]) + LEAST_ROUNDING * slide.g  # of Eq. 4
    if rises and slide.phase == HELD:
        eq4 = ground[2] - eq4_rate(law, slide, ground[2], velocity)
        return max(-velocity, eq4 - slide.held - rounding)
    if rises and slide.phase == FOLLOWS and monotone:
        first = ground[0] - rates[0]
        middle = ground[1] - rates[1]
        last = ground[2] - rates[2]
        # how a parabola through the three falls at the end
        return max(-velocity, 4.0 * middle - 3.0 * last - first - rounding)
    return -velocity


@inlined
def turning_point(
    velocity: float, h: float, first: float, middle: float, last: float
) -> tuple[float, float]:
    """Return when the rate is 0 in a step, by the parabola through three rates, and V there."""
    bend = 2.0 * (first + last) - 4.0 * middle
    slope = last - first - bend
    part = 2.0 / (math.sqrt((slope / first) ** 2 - 4.0 * (bend / first)) - slope / first)
    return part * h, velocity + h * part * (first + part * (0.5 * slope + part * bend / 3.0))


# ------------------------------------------------------------------ Üg on a piece


@inlined
def ground_at(block: Block, piece: Piece, curve: Curve, tau: float) -> float:
    """Üg at τ on a piece, with the sign of the piece also where it is 0."""
    total = piece.slope * tau
    if piece.degree > 1:
        total = 0.0
        for k in range(piece.degree - 1, -1, -1):
            total = (total + curve.coefficients[k]) * tau
    return math.copysign(block.amplitude * (piece.top + total), piece.top)


@scalar
def ground_in_step(
    block: Block, piece: Piece, curve: Curve, tau: float, h: float
) -> tuple[float, float, float]:
    """Üg at the start, the middle and the end of a step; in the middle a mean, if that will do."""
    start = ground_at(block, piece, curve, tau)
    end = ground_at(block, piece, curve, tau + h)
    if block.rule == SIMPSON:
        return start, ground_at(block, piece, curve, tau + 0.5 * h), end
    return start, 0.5 * (start + end), end


@scalar
def place_of(block: Block, piece: Piece, curve: Curve, level: float) -> float:
    """Return τ at which |Üg| reaches a level on a piece on which it grows (the end, if it does not)."""
    if block.amplitude * abs(piece.first) >= level:
        return piece.begin
    low = piece.begin
    high = piece.finish
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        if abs(ground_at(block, piece, curve, middle)) >= level:
            high = middle
        else:
            low = middle
    return high


@scalar
def advance_from(
    law: Law, block: Block, piece: Piece, curve: Curve, tau: float, h: float, first_rate: float
) -> tuple[tuple[float, float, float], float, float, float, float]:
    """Take a step from τ: return Üg in it, and what `advance` returns."""
    ground = ground_in_step(block, piece, curve, tau, h)
    gained, moved, middle_rate, last_rate = advance(
        law, slide_of(block), block.rule, ground, h, block.velocity, first_rate
    )
    return ground, gained, moved, middle_rate, last_rate


# ------------------------------------------------------------------ from phase to phase


@scalar
def rest(block: Block) -> None:
    """Come to rest."""
    block.phase = STUCK
    block.velocity = 0.0
    block.least_velocity = min(block.least_velocity, 0.0)
    block.largest_displacement = max(block.largest_displacement, block.displacement)
    block.smallest_displacement = min(block.smallest_displacement, block.displacement)


@scalar
def begin_slide(block: Block, phase: int, time: float, growth: float) -> None:
    """Begin to slide, from rest or with a velocity kept."""
    block.phase = phase
    block.onset = time
    block.growth = growth
    if block.velocity == 0.0:
        block.slips += 1.0


@scalar
def begin_stick_slip(
    law: Law, block: Block, rises: bool, ground: float, time: float, growth: float
) -> None:
    """t1: begin to slide with b = max(Üy, Eq. 4), with the literal rise b by Eq. 4."""
    eq4 = eq4_of(law, block, ground)
    follows = block.rise == LITERAL or eq4 >= block.yield_acceleration
    block.held = eq4 if follows else block.yield_acceleration
    begin_slide(block, FOLLOWS if follows and rises else HELD, time, growth)


@scalar
def end_positive_half_wave(block: Block) -> None:
    """t5: from Üg = 0 on Eq. 12 takes V to 0, with Ümax = b; or b is held on (`recoupling`)."""
    block.in_pulse = 0
    if block.phase == HELD or block.phase == FOLLOWS:
        block.phase = ATTENUATES if block.recoupling == EQ12 else HELD_ON
        if block.held <= 0.0:
            block.validity |= flags.KD_NOT_POSITIVE


@scalar
def end_phase(block: Block, eq4: float) -> None:
    """Go on after a step up to the end of a phase, where `eq4` is Ü if it is by Eq. 4."""
    if block.phase == UP or block.velocity <= 0.0:
        rest(block)
    elif block.phase == HELD:
        block.phase = FOLLOWS
    else:
        block.held = eq4
        block.phase = HELD


@scalar
def wait_for_newmark(block: Block, piece: Piece, curve: Curve, now: float, tau: float) -> float:
    """Return τ at which Newmark's block at rest begins to slide: where Üg exceeds what it resists."""
    down = piece.top > 0.0
    limit = block.yield_acceleration if down else block.upslope_yield_acceleration
    if block.amplitude * abs(piece.top) <= limit:
        return piece.finish
    if abs(piece.last) > abs(piece.first):
        tau = max(tau, place_of(block, piece, curve, limit))
    elif abs(ground_at(block, piece, curve, tau)) <= limit:
        return piece.finish
    begin_slide(block, DOWN if down else UP, now + tau, piece.finish - tau)
    return tau


@scalar
def wait(
    law: Law, block: Block, piece: Piece, curve: Curve, now: float, tau: float, end: float
) -> float:
    """Return τ at which the paper's block begins to slide while Üg rises beyond Üy: t1.

    That is where Eq. 4 is below Üg, and `end`, if that is not so at the end, either.
    """
    ground = ground_at(block, piece, curve, tau)
    if eq4_rate_at_rest(law, block, ground) > 0.0:
        begin_stick_slip(law, block, True, ground, now + tau, piece.finish - tau)
        return tau
    if eq4_rate_at_rest(law, block, ground_at(block, piece, curve, end)) <= 0.0:
        return end
    low = tau
    high = end
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        if eq4_rate_at_rest(law, block, ground_at(block, piece, curve, middle)) > 0.0:
            high = middle
        else:
            low = middle
    # Eq. 4 is Üg there, but for rounding
    block.held = ground_at(block, piece, curve, high)
    phase = FOLLOWS if block.rise == LITERAL else HELD
    begin_slide(block, phase, now + high, piece.finish - high)
    return high


# ------------------------------------------------------------------ samples of a history


@scalar
def sample_rest(block: Block, until: float, history: History) -> None:
    """Fill in the samples before a time, up to which the block rests."""
    at = history.done[0]
    while at < history.phases.size and history.phases[at] < until:
        history.velocity[at] = block.velocity  # of continuous sliding after the shaking
        history.displacement[at] = block.displacement
        at += 1
    history.done[0] = at


@scalar
def sample_step(
    law: Law,
    block: Block,
    piece: Piece,
    curve: Curve,
    now: float,
    tau: float,
    h: float,
    first_rate: float,
    history: History,
) -> None:
    """Fill in the samples within a step from τ."""
    if block.velocity == 0.0:
        sample_rest(block, now + tau, history)
    at = history.done[0]
    while at < history.phases.size and history.phases[at] < now + tau + h:
        part = max(history.phases[at] - (now + tau), 0.0)  # between two steps is rounding
        ground, gained, moved, _, last_rate = advance_from(
            law, block, piece, curve, tau, part, first_rate
        )
        history.block_acceleration[at] = ground[2] - last_rate
        history.velocity[at] = block.velocity + gained
        history.displacement[at] = block.displacement + moved
        at += 1
    history.done[0] = at


@scalar
def attenuate(block: Block, time: float, duration: float, history: History) -> None:
    """Eq. 12 for some time, or up to the stop: one step V −= b h, which is exact for any h."""
    side = math.copysign(1.0, block.velocity)
    speed = abs(block.velocity)
    until = time + min(speed / block.held, duration)
    at = history.done[0]
    while at < history.phases.size and history.phases[at] < until:
        h = max(history.phases[at] - time, 0.0)
        moved = side * eq.attenuated_displacement(speed, block.held, h)
        history.block_acceleration[at] += side * block.held
        history.velocity[at] = side * eq.attenuated_velocity(speed, block.held, h)
        history.displacement[at] = block.displacement + moved
        at += 1
    history.done[0] = at
    block.displacement += side * eq.attenuated_displacement(speed, block.held, duration)
    block.velocity = side * eq.attenuated_velocity(speed, block.held, duration)
    if block.velocity == 0.0:
        rest(block)


# ------------------------------------------------------------------ along a piece


@scalar
def excess_after(
    law: Law,
    block: Block,
    piece: Piece,
    curve: Curve,
    rises: bool,
    tau: float,
    h: float,
    first_rate: float,
) -> float:
    """Return `excess` after a step from τ."""
    ground, gained, _, middle_rate, last_rate = advance_from(
        law, block, piece, curve, tau, h, first_rate
    )
    rates = (first_rate, middle_rate, last_rate)
    return excess(
        law, slide_of(block), block.rise == MONOTONE, rises, ground, rates, block.velocity + gained
    )


@scalar
def step_to_end_of_phase(
    law: Law,
    block: Block,
    piece: Piece,
    curve: Curve,
    rises: bool,
    tau: float,
    h: float,
    first_rate: float,
) -> float:
    """Return the step, at most h, after which the phase ends.

    By false position; the value at an end that stays twice is halved (the Illinois rule).
    """
    nearest = 1e-14 * h
    low = 0.0
    high = h
    below = min(excess_after(law, block, piece, curve, rises, tau, low, first_rate), -1e-300)
    above = excess_after(law, block, piece, curve, rises, tau, high, first_rate)
    side = 0
    tries = 0
    while high - low > 2.0 * nearest:
        tries += 1
        new = 0.5 * (low + high)
        if tries < 20:
            new = high - above * ((high - low) / (above - below))
            new = min(max(new, low + nearest), high - nearest)
        value = excess_after(law, block, piece, curve, rises, tau, new, first_rate)
        if value > 0.0:
            high = new
            above = value
            below *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            low = new
            below = value
            above *= 0.5 if side == -1 else 1.0
            side = -1
    return high


@scalar
def take_whole_steps(
    law: Law,
    block: Block,
    rises: bool,
    h: float,
    points: np.ndarray,
    steps: int,
    first_rate: float,
) -> tuple[int, float]:
    """Take whole steps up to one in which a phase ends or V turns; return how many, and the rate."""
    slide = slide_of(block)
    monotone = block.rise == MONOTONE
    rule = block.rule
    amplitude = block.amplitude
    velocity = block.velocity
    displacement = block.displacement
    largest = block.largest_velocity
    least = block.least_velocity
    each = 2 if rule == SIMPSON else 1
    taken = 0
    while taken < steps:
        start = amplitude * points[each * taken]
        end = amplitude * points[each * (taken + 1)]
        middle = amplitude * points[2 * taken + 1] if each == 2 else 0.5 * (start + end)
        ground = (start, middle, end)
        gained, moved, middle_rate, last_rate = advance(
            law, slide, rule, ground, h, velocity, first_rate
        )
        rates = (first_rate, middle_rate, last_rate)
        turns = first_rate < 0.0 < last_rate or last_rate < 0.0 < first_rate
        if turns or excess(law, slide, monotone, rises, ground, rates, velocity + gained) > 0.0:
            break
        velocity += gained
        displacement += moved
        largest = max(largest, velocity)
        least = min(least, velocity)
        first_rate = last_rate
        taken += 1
    if taken > 0 and block.phase == FOLLOWS:
        block.held = amplitude * points[each * taken] - first_rate
    block.velocity = velocity
    block.displacement = displacement
    block.largest_velocity = largest
    block.least_velocity = least
    return taken, first_rate


@scalar
def take_step(
    law: Law,
    block: Block,
    piece: Piece,
    curve: Curve,
    rises: bool,
    now: float,
    tau: float,
    h: float,
    first_rate: float,
    history: History,
) -> tuple[float, float]:
    """Take a step h from τ, or a part of it up to the end of the phase; return the step and the rate.

    The rate is NaN where another phase follows.
    """
    ground, gained, moved, middle_rate, last_rate = advance_from(
        law, block, piece, curve, tau, h, first_rate
    )
    rates = (first_rate, middle_rate, last_rate)
    ends = (
        excess(
            law,
            slide_of(block),
            block.rise == MONOTONE,
            rises,
            ground,
            rates,
            block.velocity + gained,
        )
        > 0.0
    )
    turning = block.velocity
    if first_rate < 0.0 < last_rate or last_rate < 0.0 < first_rate:
        # V is largest or least in the step, and may have been 0
        until, turning = turning_point(block.velocity, h, first_rate, middle_rate, last_rate)
        stops = turning > 0.0 if block.phase == UP else turning < 0.0
        if stops and not ends and block.phase != CONTINUOUS:
            ends = True
            h = until
    if ends:
        stays = gained >= 0.0 if block.phase == UP else gained <= 0.0
        if block.velocity == 0.0 and stays:
            rest(block)  # rounding has made it slide
            return h, math.nan
        h = step_to_end_of_phase(law, block, piece, curve, rises, tau, h, first_rate)
        ground, gained, moved, _, last_rate = advance_from(
            law, block, piece, curve, tau, h, first_rate
        )
        turning = block.velocity
    if history.phases.size > 0:
        sample_step(law, block, piece, curve, now, tau, h, first_rate, history)
    block.velocity += gained
    block.displacement += moved
    block.largest_velocity = max(block.largest_velocity, block.velocity, turning)
    block.least_velocity = min(block.least_velocity, block.velocity, turning)
    if block.phase == FOLLOWS:
        block.held = ground[2] - last_rate
    if ends:
        end_phase(block, ground[2] - last_rate)
        return h, math.nan
    return h, last_rate


@scalar
def step_along(
    law: Law,
    block: Block,
    piece: Piece,
    curve: Curve,
    rises: bool,
    now: float,
    tau: float,
    finish: float,
    points: np.ndarray,
    history: History,
) -> None:
    """Go from τ to `finish` on a piece, step by step; `now` is the time of τ = 0."""
    each = 2 if block.rule == SIMPSON else 1
    count = (points.size - 1) // each
    whole = (piece.finish - piece.begin) / count
    # steps on the piece that are whole before `finish`
    last = count if finish == piece.finish else int((finish - piece.begin) / whole)
    first_rate = math.nan  # where it is not known from the step before
    j = min(max(int((tau - piece.begin) / whole), 0), count - 1)
    while tau < finish:
        while j + 1 < count and tau >= piece.begin + (j + 1) * whole:
            j += 1
        begin = piece.begin + j * whole
        end = min(piece.begin + (j + 1) * whole, finish) if j + 1 < count else finish
        if block.phase == STUCK:
            first_rate = math.nan
            if block.rise == NEWMARK:
                tau = wait_for_newmark(block, piece, curve, now, tau)
            elif rises and ground_at(block, piece, curve, finish) >= block.yield_acceleration:
                if ground_at(block, piece, curve, tau) < block.yield_acceleration:
                    tau = place_of(block, piece, curve, block.yield_acceleration)
                tau = wait(law, block, piece, curve, now, tau, max(tau, end))
            else:
                return
            continue
        since = now + tau - block.onset
        longest = max(GROWTH_SHARE * block.growth, TIME_SHARE * since) / block.steps
        if math.isnan(first_rate):
            first_rate = rate(
                law, slide_of(block), ground_at(block, piece, curve, tau), block.velocity
            )
            if block.velocity == 0.0 and block.phase != CONTINUOUS:
                # a slide that begins is not stopped by rounding
                first_rate = min(first_rate, 0.0) if block.phase == UP else max(first_rate, 0.0)
        if tau == begin and longest >= whole and j < last and history.phases.size == 0:
            taken, first_rate = take_whole_steps(
                law, block, rises, whole, points[each * j :], last - j, first_rate
            )
            if taken > 0:
                j += taken
                tau = piece.finish if j == count else piece.begin + j * whole
                continue
        h = min(max(longest, SHORTEST_STEP), end - tau)
        h_taken, first_rate = take_step(
            law, block, piece, curve, rises, now, tau, h, first_rate, history
        )
        tau = end if h_taken >= end - tau else tau + h_taken


# ------------------------------------------------------------------ pulses


@scalar
def set_friction(block: Block, cell: np.record, options: Options, peak: float) -> flags.Interface:
    """Set the block's friction and mode for shaking of that peak, by Eqs. 6-11."""
    parameters = Cell(
        cell.tan_theta,
        cell.mu_s,
        peak,
        cell.yield_acceleration,
        cell.decay_rate,
        cell.delta_mu,
        cell.minimum_friction,
    )
    interface = flags.interface_of(parameters, options.rise, options.g)
    block.yield_acceleration = interface.yield_acceleration
    block.delta_mu = interface.delta_mu
    block.decay_rate = flags.decay_rate_of(
        parameters, interface.delta_mu, interface.minimum_friction, options.g
    )
    block.mode = interface.sliding_mode
    return interface


@scalar
def yield_governs(law: Law, block: Block, low: float, high: float) -> bool:
    """Return whether Eq. 4 stays at or below Üy while Üg rises from low to high."""
    for j in range(POINTS_OF_RISE, -1, -1):
        ground = low + (high - low) * (j / POINTS_OF_RISE)
        if ground - eq4_rate_at_rest(law, block, ground) > block.yield_acceleration:
            return False
    return True


@scalar
def yield_governs_wave(law: Law, block: Block, path: Path) -> bool:
    """Return whether Eq. 4 stays at or below Üy on all rises, and wherever Üg jumps to."""
    if block.mode != eq.STICK_SLIP or block.rise != MONOTONE:
        return False
    for p in range(path.base.pieces.size):
        piece = path.base.pieces[p]
        if piece.top > 0.0 and (piece.last >= piece.first or piece.jumps):
            low = block.amplitude * piece.first
            high = max(low, block.amplitude * piece.last) if piece.last >= piece.first else low
            low = max(low, block.yield_acceleration)
            if high >= low and not yield_governs(law, block, low, high):
                return False
    return True


@scalar
def set_friction_of_pulse(
    law: Law, block: Block, cell: np.record, options: Options, peak: float
) -> None:
    """Under a record each pulse has the friction of its own peak, and with it a mode and flags."""
    block.stick_slip_pulses += 1.0
    if block.rise == NEWMARK:
        return
    interface = set_friction(block, cell, options, peak)
    estimated = math.isnan(cell.decay_rate) or math.isnan(cell.delta_mu)
    near = 0.9 <= interface.acceleration_ratio <= 1.1
    block.validity |= interface.validity & flags.FRICTION_NOT_DECAYING
    block.validity |= flags.NEAR_MODE_LIMIT if near else 0
    block.mode = eq.STICK_SLIP
    if peak > interface.limiting_acceleration:
        block.mode = eq.CONTINUOUS
        block.held = peak - eq4_rate_at_rest(law, block, peak)  # for Eq. 12 after it
        block.stick_slip_pulses -= 1.0
        block.continuous_pulses += 1.0
    elif block.rise == MONOTONE and yield_governs(law, block, block.yield_acceleration, peak):
        block.validity |= flags.YIELD_GOVERNS
        estimated = False
    block.validity |= flags.FRICTION_ESTIMATED if estimated else 0


@scalar
def begin_pulse(
    law: Law, block: Block, rises: bool, ground: float, time: float, growth: float
) -> None:
    """Go on from where Üg reaches Üy in a half wave; at rest the block waits for t1 (`wait`)."""
    block.in_pulse = 1
    if block.rise == NEWMARK:
        return
    if block.mode == eq.CONTINUOUS:  # for good; under a record for this pulse
        if block.phase != CONTINUOUS:
            begin_slide(block, CONTINUOUS, time, math.inf)
        return
    if block.velocity < 0.0:
        rest(block)  # upslope motion, which continuous sliding may leave, is neglected
    if block.velocity > 0.0 or (not rises and eq4_rate_at_rest(law, block, ground) > 0.0):
        begin_stick_slip(law, block, rises, ground, time, growth)


@scalar
def enter_rise_or_fall(law: Law, block: Block, piece: Piece, rises: bool) -> None:
    """Go on at the beginning of a piece: on a rise b is max(b, Eq. 4), on a fall it is held."""
    if not rises and block.phase == FOLLOWS:
        block.phase = HELD
    elif rises and block.phase == HELD:
        ground = block.amplitude * piece.first
        eq4 = eq4_of(law, block, ground)
        if block.rise == LITERAL or eq4 > block.held:
            block.held = eq4
            block.phase = FOLLOWS


@scalar
def walk(
    law: Law,
    block: Block,
    cell: np.record,
    options: Options,
    path: Path,
    cycle: int,
    offset: float,
    steps: Steps,
    history: History,
) -> None:
    """Go through the pieces of a cycle of the path, whose times are `offset` later."""
    is_record = block.steps_on_piece > 0
    k = 0  # the positive half wave that a piece lies in, or that comes next
    for p in range(path.cycles[cycle].first, path.cycles[cycle + 1].first):
        while k < path.intervals.size and path.intervals[k].end <= p:
            k += 1
        peak = block.amplitude * path.intervals[k].height if k < path.intervals.size else 0.0
        is_pulse = peak > block.yield_acceleration
        piece = path.base.pieces[p]
        curve = path.base.curves[piece.curve]
        rises = piece.top > 0.0 and piece.first <= piece.last
        starts = k < path.intervals.size and path.intervals[k].first == p
        if block.in_pulse and (starts or piece.top <= 0.0):
            end_positive_half_wave(block)
        ended = piece.top == 0.0 or (starts and not is_pulse)
        if is_record and block.phase == CONTINUOUS and not block.in_pulse and ended:
            block.phase = ATTENUATES  # after the negative half wave
        enter_rise_or_fall(law, block, piece, rises)

        reaches = math.inf  # τ at which the pulse begins
        highest = block.amplitude * max(piece.first, piece.last)
        comes = piece.top > 0.0 and is_pulse and not block.in_pulse
        if comes and highest >= block.yield_acceleration:
            reaches = (
                place_of(block, piece, curve, block.yield_acceleration) if rises else piece.begin
            )
        now = offset + piece.start - piece.begin
        tau = piece.begin
        for until in (min(reaches, piece.finish), piece.finish):
            waits = block.phase == STUCK and block.rise != NEWMARK and block.in_pulse == 0
            if tau < until and not waits and block.validity & NO_VALUE == 0:
                if block.phase == ATTENUATES:
                    attenuate(block, now + tau, until - tau, history)
                else:
                    points = steps.wave[steps.first[p] : steps.first[p + 1]]
                    step_along(law, block, piece, curve, rises, now, tau, until, points, history)
            if until == reaches and not block.in_pulse:
                slides = block.velocity > 0.0 and block.rise != NEWMARK
                if block.mode == eq.STICK_SLIP and slides:
                    block.validity |= flags.NOT_RECOUPLED  # Eq. 12 has not brought it to rest
                if is_record:
                    set_friction_of_pulse(law, block, cell, options, peak)
                ground = max(block.amplitude * piece.first, block.yield_acceleration)
                begin_pulse(law, block, rises, ground, now + until, piece.finish - until)
            tau = until


@scalar
def run_out(block: Block, time: float, history: History) -> None:
    """After the shaking Eq. 12 takes V to 0, but that of continuous sliding under a waveform."""
    end_positive_half_wave(block)
    if block.phase == STUCK or block.validity & NO_VALUE != 0:
        return
    if block.phase == CONTINUOUS and block.steps_on_piece == 0:
        return
    if block.phase == DOWN:
        block.held = block.yield_acceleration
    elif block.phase == UP:
        block.held = block.upslope_yield_acceleration
    block.phase = ATTENUATES
    attenuate(block, time, math.inf, history)


# ------------------------------------------------------------------ cycles


class Cycle(NamedTuple):
    """A cycle that has been walked: how the block entered it, and what it gained in it.

    `moved` is W gained, less what V at the beginning makes of it.  The extremes of V and W are from
    their values at the beginning.
    """

    shape: int
    phase: int
    held: float
    velocity: float
    gained: float
    moved: float
    highest: float
    farthest: float
    nearest: float
    never_rests: bool


@scalar
def repetitions(block: Block, cycle: Cycle, left: int) -> int:
    """Return how often the next cycles of that shape, at most `left`, gain what `cycle` did.

    They do so if they begin in the same state; and also with a larger V, if friction does not depend
    on V and the block does not come to rest: then V is larger throughout by as much.
    """
    if block.phase != cycle.phase or block.held != cycle.held:
        return 0
    faster = cycle.phase == CONTINUOUS or block.velocity >= cycle.velocity
    if cycle.never_rests and faster:
        return left if cycle.gained >= 0.0 or cycle.phase == CONTINUOUS else 1
    if block.velocity == cycle.velocity:
        return left if cycle.gained == 0.0 else 1
    return 0


@scalar
def repeat(block: Block, cycle: Cycle, count: int) -> None:
    """Add cycles that gain what `cycle` did."""
    period = 2.0 * math.pi
    later = count - 1.0
    velocity = block.velocity
    first = block.displacement
    last = first + later * (cycle.moved + period * velocity)
    highest = velocity + max(later * cycle.gained, 0.0) + cycle.highest
    block.velocity += count * cycle.gained
    block.displacement += count * (cycle.moved + period * (velocity + 0.5 * later * cycle.gained))
    block.largest_velocity = max(block.largest_velocity, highest)
    block.largest_displacement = max(block.largest_displacement, max(first, last) + cycle.farthest)
    block.smallest_displacement = min(block.smallest_displacement, min(first, last) + cycle.nearest)


@single
def walk_all(
    law: Law,
    block: Block,
    cell: np.record,
    options: Options,
    path: Path,
    steps: Steps,
    history: History,
) -> None:
    """Go through all cycles; those that gain what the last one did are not walked again."""
    walked = Cycle(-1, -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)
    n = 0
    for c in range(path.cycles.size - 1):
        left = path.repeats if path.repeats > 0 and c == path.lead else 1
        while left > 0 and block.validity & NO_VALUE == 0:
            if walked.shape == path.cycles[c].shape and history.phases.size == 0:
                count = repetitions(block, walked, left)
                if count > 0:
                    repeat(block, walked, count)
                    left -= count
                    n += count
                    continue
            phase = block.phase
            held = block.held
            velocity = block.velocity
            displacement = block.displacement
            largest_velocity = block.largest_velocity
            largest_displacement = block.largest_displacement
            smallest_displacement = block.smallest_displacement
            block.largest_velocity = velocity
            block.least_velocity = velocity
            block.largest_displacement = displacement
            block.smallest_displacement = displacement
            offset = 2.0 * math.pi * (n - c)
            walk(law, block, cell, options, path, c, offset, steps, history)
            walked = Cycle(
                path.cycles[c].shape,
                phase,
                held,
                velocity,
                block.velocity - velocity,
                block.displacement - displacement - 2.0 * math.pi * velocity,
                block.largest_velocity - velocity,
                block.largest_displacement - displacement,
                block.smallest_displacement - displacement,
                not law.knows_velocity and (phase == CONTINUOUS or block.least_velocity > 0.0),
            )
            block.largest_velocity = max(block.largest_velocity, largest_velocity)
            block.largest_displacement = max(block.largest_displacement, largest_displacement)
            block.smallest_displacement = min(block.smallest_displacement, smallest_displacement)
            left -= 1
            n += 1


# ------------------------------------------------------------------ a cell


@scalar
def validity_before(block: Block, cell: np.record, options: Options, path: Path) -> int:
    """Set friction and mode for the peak of the shaking; return the flags known before the motion."""
    if block.steps_on_piece == 0:
        interface = set_friction(block, cell, options, block.amplitude)
        if block.amplitude * path.highest > block.yield_acceleration:
            return interface.validity
        # ramps keep the shaking below Üy
        return interface.validity & ~(flags.NEAR_MODE_LIMIT | flags.FRICTION_ESTIMATED)
    peak = block.amplitude * max(path.highest, -path.lowest)
    interface = set_friction(block, cell, options, peak)
    lowest = eq.normal_acceleration(block.amplitude * path.lowest, block.tan_theta, block.g)
    uplift = flags.UPLIFT if lowest <= 0.0 and options.rise != NEWMARK else 0
    return uplift | interface.validity & (flags.STATICALLY_UNSTABLE | flags.LIMIT_UNDEFINED)


@single
def solve_cell(
    law: Law,
    block: Block,
    cell: np.record,
    options: Options,
    path: Path,
    steps: Steps,
    history: History,
) -> Motion:
    """Step a cell through the shaking and on to rest."""
    block.amplitude = cell.amplitude
    block.tan_theta = cell.tan_theta
    block.mu_s = cell.mu_s
    block.upslope_yield_acceleration = flags.given_or(cell.upslope_yield_acceleration, math.inf)
    block.g = options.g
    block.seconds = cell.seconds
    block.rise = options.rise
    block.recoupling = options.recoupling
    block.phase = STUCK
    block.in_pulse = 0
    block.held = 0.0
    block.velocity = 0.0
    block.displacement = 0.0
    block.largest_velocity = 0.0
    block.largest_displacement = 0.0
    block.smallest_displacement = 0.0
    block.slips = 0.0
    block.stick_slip_pulses = 0.0
    block.continuous_pulses = 0.0
    block.validity = validity_before(block, cell, options, path)
    is_record = block.steps_on_piece > 0
    mode = block.mode
    peak = block.amplitude * (max(path.highest, -path.lowest) if is_record else 1.0)
    slides = (
        block.amplitude * path.highest > block.yield_acceleration
        or block.amplitude * -path.lowest > block.upslope_yield_acceleration
    )
    if block.validity & NO_VALUE == 0 and slides:
        if not is_record and yield_governs_wave(law, block, path):
            block.validity = flags.without_estimates(block.validity | flags.YIELD_GOVERNS)
        walk_all(law, block, cell, options, path, steps, history)
        end = path.base.pieces[path.base.pieces.size - 1].end
        run_out(block, end + 2.0 * math.pi * max(path.repeats - 1, 0), history)
    sample_rest(block, math.inf, history)
    for at in range(history.phases.size):
        history.friction_coefficient[at] = eq.mobilised_friction(  # Eq. 1
            history.ground_acceleration[at],
            history.block_acceleration[at],
            block.mu_s,
            block.tan_theta,
            block.g,
        )
    validity = flags.settled(block.validity, block.displacement, peak)
    if validity & NO_VALUE:
        return Motion(math.nan, math.nan, -1.0, float(validity), -1.0, -1.0, -1.0)
    return Motion(
        block.displacement,
        block.largest_velocity,
        float(mode),
        float(validity),
        block.slips,
        block.stick_slip_pulses,
        block.continuous_pulses,
    )


@single
def solve_cells(
    law: Law,
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    history: History,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with a friction law, as `solve_steps` does with that of the paper."""
    for j in range(cells.size):
        motion = solve_cell(law, blocks[0], cells[j], options, path, steps, history)
        flags.store(motion, j, results)


def steps_of(path: Path, rule: int, steps: int, steps_on_piece: int) -> Steps:
    """Return the base's motion at the points of all steps: so many in 2π, or on a piece."""
    pieces = path.base.pieces
    length = pieces["finish"] - pieces["begin"]
    each = 2 if rule == SIMPSON else 1
    count = np.full(length.size, steps_on_piece)
    if steps_on_piece == 0:
        count = np.maximum(np.ceil(length / (2.0 * math.pi) * steps - 1e-9), 1).astype(np.int64)
    sizes = each * count + 1
    first = np.concatenate([[0], np.cumsum(sizes)])
    # from the anchor of the piece, so that two that mirror each other have the same values
    number = np.arange(first[-1]) - np.repeat(first[:-1], sizes)
    number -= np.repeat(np.where(pieces["begin"] == 0.0, 0, sizes - 1), sizes)
    tau = number * np.repeat(length / (each * count), sizes)
    total = np.repeat(pieces["slope"], sizes) * tau
    curved = np.flatnonzero(np.repeat(pieces["degree"] > 1, sizes))
    curve = np.repeat(pieces["curve"], sizes)[curved]
    total[curved] = 0.0
    for power in range(TERMS - 1, -1, -1):
        coefficient = path.base.curves["coefficients"][curve, power]
        total[curved] = (total[curved] + coefficient) * tau[curved]
    top = np.repeat(pieces["top"], sizes)
    return Steps(np.copysign(top + total, top), first)


def blocks_of(rule: int, steps: int, steps_on_piece: int) -> np.ndarray:
    """Return the block that `solve_steps` moves, with how it is stepped."""
    blocks = np.zeros(1, BLOCK)
    blocks["rule"] = rule
    blocks["steps"] = steps
    blocks["steps_on_piece"] = steps_on_piece
    return blocks


def history_of(phases: np.ndarray, ground_acceleration: np.ndarray) -> History:
    """Return a history to be filled in at increasing phases, of a block that rests so far."""
    return History(
        phases,
        ground_acceleration,
        ground_acceleration.copy(),
        np.zeros(phases.size),
        np.zeros(phases.size),
        np.zeros(phases.size),
        np.zeros(1, np.int64),
    )


@kernel
def solve_steps(
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    history: History,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with the friction law of the paper.

    `cells` are of dtype `STEP_CELL`; `blocks`, (1,), says how they are stepped; `results` is (fields
    of `Motion`, cells).
    """
    law = Law(exponential_friction, False, False)
    solve_cells(law, cells, options, path, blocks, steps, history, results)
