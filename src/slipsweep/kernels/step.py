"""The paper's block, stepped in time: V += (Üg − Ü) h.

The base's motion comes in monotone pieces, from one zero, peak or sample to the next (`walk`).
What the block does is its phase: it says what Ü is (`rate`).  Along a piece the block takes equal
steps (`step_along`) by one of three rules (`advance`).  A step in which the phase ends (`may_end`)
is taken again up to there, and the block goes on in the next phase (`take_step`).  Eq. 12 takes one
step along a piece, exact for any length (`attenuate`).

Time here is ωt, so that V = ωv and W = ω²u; under a record it is the time at scale 1.
docs/numerics.md#step-solver
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

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
    Interface,
    Options,
)
from slipsweep.model import equations as eq
from slipsweep.model.options import StepRule
from slipsweep.motion.paths import TERMS, Base, Path

#: Rules by which steps are taken (`model.options.StepRule`).
RECTANGLE = int(StepRule.RECTANGLE)
TRAPEZOID = int(StepRule.TRAPEZOID)
SIMPSON = int(StepRule.SIMPSON)

#: Stages of the rules: each evaluates the rate at a node, a part of the step, from the second on
#: reached with the rate of the stage before it; their weights in the gain of V, over h, and of W,
#: over h².
RUNGE_KUTTA = 3
STAGES = np.array([1, 1, 2, 3])  # after the first, which is known from the step before
NODES = np.array([[0, 1, 0, 0], [0, 1, 0, 0], [0, 1 / 2, 1, 0], [0, 1 / 2, 1 / 2, 1]])
VELOCITY_WEIGHTS = np.array(
    [[1, 0, 0, 0], [1 / 2, 1 / 2, 0, 0], [1 / 6, 4 / 6, 1 / 6, 0], [1 / 6, 2 / 6, 2 / 6, 1 / 6]]
)
DISPLACEMENT_WEIGHTS = np.array(
    [[1 / 2, 0, 0, 0], [1 / 3, 1 / 6, 0, 0], [1 / 6, 2 / 6, 0, 0], [1 / 6, 1 / 6, 1 / 6, 0]]
)

#: Phases of the motion, each with its block acceleration Ü.
STUCK = 0  # Ü = Üg, V = 0
HELD = 1  # stick-slip: Ü = b, a constant
FOLLOWS = 2  # stick-slip: Ü by Eq. 4, b = Ü
ATTENUATES = 3  # from t5 on: Eq. 12
HELD_ON = 4  # from t5 on with recoupling = "integrate": Ü = b still
CONTINUOUS = 5  # continuous sliding: Ü by Eq. 4, V of either sign
DOWN = 6  # Newmark's block, V > 0: Ü = Üy
UP = 7  # Newmark's block, V < 0: Ü = −Üy,up


class Law(NamedTuple):
    """A friction law μ(block, Üg, v, s).

    v is the relative velocity in m/s (of Newmark's block the speed in the direction in which it
    slides), s = ∫|v|dt the slip in m.  `knows_motion` says whether μ
    depends on v or s, `knows_slip` whether on s.  Newmark's block keeps its yield acceleration, or
    (`is_strength`) has that of Coulomb with μ.  `longest_step`, of the block and the rate of V, is
    the longest step that resolves the law (`unlimited`, if the default steps do).
    """

    friction: Callable[..., float]
    knows_motion: bool
    knows_slip: bool
    is_strength: bool
    longest_step: Callable[..., float]


#: Parameters of strength that changes while the block slides (`kernels.strength`).
STRENGTH_FIELDS = ("residual_mu", "weakening_distance", "fast_mu", "rate_constant")

#: The cells that are stepped: a `Cell`, the yield acceleration upslope (NaN, if the block slides
#: downslope only), the seconds in a unit of time, and the parameters of its strength (NaN, if it is
#: of another kind).
STEP_CELL = np.dtype(
    (
        np.record,
        [
            (name, "f8")
            for name in (*Cell._fields, "upslope_yield_acceleration", "seconds", *STRENGTH_FIELDS)
        ],
    )
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
            ("slides_up", "i8"),  # in both directions
            ("residual_mu", "f8"),
            ("weakening_distance", "f8"),
            ("fast_mu", "f8"),
            ("rate_constant", "f8"),
            ("weakens_until", "f8"),  # ∫|V| from which on the law does not depend on it
            ("g", "f8"),
            ("seconds", "f8"),  # in a unit of time
            ("mode", "i8"),  # `SlidingMode`; under a record that of the pulse
            ("rise", "i8"),
            ("recoupling", "i8"),
            ("rule", "i8"),
            ("steps", "i8"),  # in 2π of time
            ("steps_on_piece", "i8"),  # under a record; else 0
            ("phase", "i8"),
            ("in_pulse", "i8"),  # from Üg = Üy to the end of the positive half wave
            ("held", "f8"),  # b
            ("velocity", "f8"),  # V
            ("displacement", "f8"),  # W
            ("slip", "f8"),  # ∫|V|
            ("largest_velocity", "f8"),
            ("least_velocity", "f8"),
            ("largest_displacement", "f8"),
            ("smallest_displacement", "f8"),
            ("zero", "f8"),  # time at τ = 0 of the piece
            ("onset", "f8"),  # time at which the slide began, and the rest of the piece from there
            ("growth", "f8"),
            ("slips", "f8"),
            ("stick_slip_pulses", "f8"),
            ("continuous_pulses", "f8"),
            ("validity", "i8"),
            ("logged", "i8"),  # steps noted in the log
        ],
    )
)

#: A step that was taken, for histories; `first`, `middle` and `last` are values of Ü.
LOG = np.dtype(
    (
        np.record,
        [
            ("phase", "i8"),
            ("time", "f8"),
            ("step", "f8"),
            ("velocity", "f8"),
            ("gained", "f8"),
            ("displacement", "f8"),
            ("first_rate", "f8"),
            ("last_rate", "f8"),
            ("first", "f8"),
            ("middle", "f8"),
            ("last", "f8"),
        ],
    )
)

#: A record of `BLOCK`; its fields have no types that mypy knows.
Block: TypeAlias = Any


class Steps(NamedTuple):
    """The base's motion at the ends of all steps, with Simpson's rule in their middles, too."""

    wave: np.ndarray  # (points,) Üg over the amplitude, piece after piece
    first: np.ndarray  # (pieces + 1,) where the points of a piece begin


#: How long a step may be after the onset of a slide (`step_along`).  None is shorter than the last.
GROWTH_SHARE = 64.0
TIME_SHARE = 16.0
SHORTEST_STEP = 1e-14

#: Accelerations that differ by no more are equal: as parts of Üg and of g.
ROUNDING = 1e-12
LEAST_ROUNDING = 4e-16

#: Yield acceleration upslope, m/s², where no acceleration moves the block that way.
LOCKED = 1e9

#: Points of a rise at which Eq. 4 is compared with Üy (`yield_governs`).
POINTS_OF_RISE = 32


@registered
def exponential_friction(block: Block, ground: float, velocity: float, slip: float) -> float:
    """Eq. 6, the friction law of the paper, which does not depend on the motion."""
    return eq.friction_coefficient(ground, block.mu_s, block.delta_mu, block.decay_rate, block.g)


@registered
def unlimited(block: Block, first_rate: float) -> float:
    """Longest step for laws that the default steps resolve."""
    return math.inf


# ------------------------------------------------------------------ one step


@inlined
def friction_at(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """μ by the law, at V and after ∫|V|."""
    return law.friction(
        block, ground, velocity * block.seconds, slip * block.seconds * block.seconds
    )


@inlined
def eq4_rate(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Üg − Ü with Ü by Eq. 4; positive where a block at rest begins to slide."""
    friction = friction_at(law, block, ground, velocity, slip)
    return eq.relative_acceleration(ground, friction, block.mu_s, block.tan_theta, block.g)


@inlined
def resistance(law: Law, block: Block, up: bool, velocity: float, slip: float) -> float:
    """|Ü| of Newmark's block that slides: its yield acceleration, or that of Coulomb with μ.

    μ is that at the speed in the direction of the slide, which a step may carry a little below 0.
    """
    if not law.is_strength:
        return block.upslope_yield_acceleration if up else block.yield_acceleration
    friction = friction_at(law, block, 0.0, -velocity if up else velocity, slip)
    if up and friction * block.tan_theta >= 1.0:
        return LOCKED
    tan_theta = -block.tan_theta if up else block.tan_theta
    return eq.coulomb_yield_acceleration(friction, tan_theta, block.g)


@inlined
def newmark_rate(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Üg − Ü of Newmark's block."""
    up = block.phase == UP
    braking = resistance(law, block, up, velocity, slip)
    return ground + braking if up else ground - braking


@inlined
def rate(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Rate of V, Üg − Ü, in the block's phase; Eq. 12 takes no steps (`attenuate`)."""
    if block.phase == HELD or block.phase == HELD_ON:
        return ground - block.held
    if block.phase == DOWN or block.phase == UP:
        return newmark_rate(law, block, ground, velocity, slip)
    return eq4_rate(law, block, ground, velocity, slip)


class Step(NamedTuple):
    """A step: Üg at its start, its middle and its end, the rates of V there, and gains of V and W."""

    h: float
    ground: tuple[float, float, float]
    first_rate: float
    middle_rate: float
    last_rate: float
    gained: float
    moved: float


@inlined
def advance(
    law: Law,
    block: Block,
    ground: tuple[float, float, float],
    h: float,
    first_rate: float,
) -> Step:
    """Find what a step h gains: V += (Üg − Ü) h.

    Each stage of a rule goes from the start of the step to its node with the rate of the one before.
    """
    rule = RUNGE_KUTTA if block.rule == SIMPSON and law.knows_motion else block.rule
    velocity = block.velocity
    speed = velocity
    slope = first_rate
    middle_rate = first_rate
    gained = VELOCITY_WEIGHTS[rule, 0] * first_rate
    moved = DISPLACEMENT_WEIGHTS[rule, 0] * first_rate
    for stage in range(1, STAGES[rule] + 1):
        part = NODES[rule, stage]
        in_the_middle = part < 1.0
        slip = block.slip + abs(part * h * speed)
        speed = velocity + part * h * slope
        slope = rate(law, block, ground[1] if in_the_middle else ground[2], speed, slip)
        middle_rate = slope if in_the_middle else middle_rate
        gained += VELOCITY_WEIGHTS[rule, stage] * slope
        moved += DISPLACEMENT_WEIGHTS[rule, stage] * slope
    gained *= h
    moved = (velocity + moved * h) * h
    if law.knows_motion:
        slope = rate(law, block, ground[2], velocity + gained, block.slip + abs(moved))
    if rule < SIMPSON:
        middle_rate = 0.5 * (first_rate + slope)
    return Step(h, ground, first_rate, middle_rate, slope, gained, moved)


@scalar
def eq4_of(law: Law, block: Block, ground: float) -> float:
    """Ü by Eq. 4 at the velocity of the block."""
    return ground - eq4_rate(law, block, ground, block.velocity, block.slip)


# ------------------------------------------------------------------ Üg on a piece


@scalar
def ground_at(block: Block, base: Base, p: int, tau: float) -> float:
    """Üg at τ on piece p, with the sign of the piece also where it is 0."""
    piece = base.pieces[p]
    total = piece.slope * tau
    if piece.degree > 1:
        curve = base.curves[piece.curve]
        total = 0.0
        for k in range(piece.degree - 1, -1, -1):
            total = (total + curve.coefficients[k]) * tau
    return math.copysign(block.amplitude * (piece.top + total), piece.top)


@scalar
def ground_in_step(
    block: Block, base: Base, p: int, tau: float, h: float
) -> tuple[float, float, float]:
    """Üg at the start, the middle and the end of a step; in the middle a mean, if that will do."""
    start = ground_at(block, base, p, tau)
    end = ground_at(block, base, p, tau + h)
    if block.rule == SIMPSON:
        return start, ground_at(block, base, p, tau + 0.5 * h), end
    return start, 0.5 * (start + end), end


@scalar
def place_beyond(block: Block, base: Base, p: int, level: float, rises: bool) -> float:
    """Return τ at which Üg passes a level that it has passed at the end of piece p."""
    piece = base.pieces[p]
    first = block.amplitude * piece.first
    if first >= level if rises else first <= level:
        return piece.begin
    low = piece.begin
    high = piece.finish
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        ground = ground_at(block, base, p, middle)
        if ground >= level if rises else ground <= level:
            high = middle
        else:
            low = middle
    return high


# ------------------------------------------------------------------ the end of a phase


@inlined
def opposite(first: float, last: float) -> bool:
    """Return whether two values have opposite signs."""
    return first < 0.0 < last or last < 0.0 < first


@registered
def cubic(velocity: Any, h: Any, gained: Any, first_rate: Any, last_rate: Any, part: Any) -> Any:
    """V after a part of a step h: the cubic through the values and rates at both ends."""
    left = 1.0 - part
    bend = part * left * (left * first_rate - part * last_rate) * h
    return velocity + part * part * (3.0 - 2.0 * part) * gained + bend


@registered
def integral_of_cubic(
    velocity: Any, h: Any, gained: Any, first_rate: Any, last_rate: Any, part: Any
) -> Any:
    """W gained in a part of a step h: the integral of `cubic`."""
    early = first_rate * part**2 * (0.5 - part * (2.0 / 3.0 - 0.25 * part))
    late = last_rate * part**3 * (1.0 / 3.0 - 0.25 * part)
    mean = velocity * part + gained * part**3 * (1.0 - 0.5 * part)
    return h * (mean + h * (early - late))


@inlined
def velocity_in_step(block: Block, step: Step, part: float) -> float:
    """V after a part of a step."""
    velocity: float = cubic(
        block.velocity, step.h, step.gained, step.first_rate, step.last_rate, part
    )
    return velocity


@inlined
def displacement_in_step(block: Block, step: Step, part: float) -> float:
    """W gained in a part of a step."""
    moved: float = integral_of_cubic(
        block.velocity, step.h, step.gained, step.first_rate, step.last_rate, part
    )
    return moved


@scalar
def eq4_in_step(
    law: Law, block: Block, base: Base, p: int, tau: float, step: Step, part: float
) -> float:
    """Ü by Eq. 4 after a part of a step from τ."""
    ground = ground_at(block, base, p, tau + part * step.h)
    slip = block.slip + part * abs(step.moved)
    return ground - eq4_rate(law, block, ground, velocity_in_step(block, step, part), slip)


@inlined
def exceeds(law: Law, block: Block, step: Step) -> bool:
    """Return whether Eq. 4 is larger than b at the end of a step, by more than rounding."""
    ground = step.ground[2]
    velocity = block.velocity + step.gained
    eq4 = ground - eq4_rate(law, block, ground, velocity, block.slip + abs(step.moved))
    return eq4 - block.held > ROUNDING * abs(ground) + LEAST_ROUNDING * block.g


@inlined
def falls(block: Block, step: Step) -> bool:
    """Return whether Ü, by the parabola through three values, falls at the end of a step."""
    first = step.ground[0] - step.first_rate
    middle = step.ground[1] - step.middle_rate
    last = step.ground[2] - step.last_rate
    rounding = ROUNDING * abs(step.ground[2]) + LEAST_ROUNDING * block.g
    return 4.0 * middle - 3.0 * last - first > rounding


@inlined
def passes_kink(block: Block, step: Step) -> bool:
    """Return whether the slip from which on the law does not depend on it lies in a step."""
    return block.slip < block.weakens_until <= block.slip + abs(step.moved)


@inlined
def may_end(law: Law, block: Block, rises: bool, step: Step) -> bool:
    """Return whether the phase may end in a step, or V be largest or least in it.

    A phase ends where V changes its sign.  While Üg rises b is no longer held where Eq. 4 exceeds
    it, and with the monotone rise it no longer follows Eq. 4 where that falls.  A law of the slip
    has a kink where it no longer depends on it.
    """
    if opposite(step.first_rate, step.last_rate):
        return True
    if law.knows_slip and passes_kink(block, step):
        return True
    if block.phase == CONTINUOUS:
        return False
    velocity = block.velocity + step.gained
    if velocity > 0.0 if block.phase == UP else velocity < 0.0:
        return True
    if rises and block.phase == HELD:
        return exceeds(law, block, step)
    return rises and block.phase == FOLLOWS and block.rise == MONOTONE and falls(block, step)


@scalar
def part_to_turn(step: Step) -> float:
    """Return the part of a step after which the rate, a parabola through three values, is 0."""
    bend = 2.0 * (step.first_rate + step.last_rate) - 4.0 * step.middle_rate
    slope = step.last_rate - step.first_rate - bend
    low = 0.0
    high = 1.0
    while low < 0.5 * (low + high) < high:
        part = 0.5 * (low + high)
        if (step.first_rate + part * (slope + part * bend)) * step.last_rate > 0.0:
            high = part
        else:
            low = part
    return high


@scalar
def part_to_stop(block: Block, step: Step) -> float:
    """Return the part of a step after which V changes its sign; infinity, if it does not."""
    side = -1.0 if block.phase == UP else 1.0
    low = 0.0
    high = 1.0
    if side * (block.velocity + step.gained) >= 0.0:
        if not side * step.first_rate < 0.0 < side * step.last_rate:
            return math.inf
        high = part_to_turn(step)  # where it is least, and may have been 0
        if side * velocity_in_step(block, step, high) >= 0.0:
            return math.inf
    while low < 0.5 * (low + high) < high:
        part = 0.5 * (low + high)
        if side * velocity_in_step(block, step, part) < 0.0:
            high = part
        else:
            low = part
    return high


@scalar
def part_to_kink(block: Block, step: Step) -> float:
    """Return the part of a step after which the law depends on the slip no more; infinity, if none."""
    if not passes_kink(block, step):
        return math.inf
    low = 0.0
    high = 1.0
    while low < 0.5 * (low + high) < high:
        part = 0.5 * (low + high)
        if block.slip + abs(displacement_in_step(block, step, part)) >= block.weakens_until:
            high = part
        else:
            low = part
    return high


@scalar
def part_to_exceed(law: Law, block: Block, base: Base, p: int, tau: float, step: Step) -> float:
    """Return the part of a step after which Eq. 4 exceeds b; infinity, if it does not."""
    if not exceeds(law, block, step):
        return math.inf
    low = 0.0
    high = 1.0
    while low < 0.5 * (low + high) < high:
        part = 0.5 * (low + high)
        if eq4_in_step(law, block, base, p, tau, step, part) > block.held:
            high = part
        else:
            low = part
    return high


@scalar
def part_to_fall(law: Law, block: Block, base: Base, p: int, tau: float, step: Step) -> float:
    """Return the part of a step after which Eq. 4 falls; infinity, if it does not."""
    if not falls(block, step):
        return math.inf
    low = 0.0
    high = 1.0
    while high - low > 1e-8:  # it hardly changes there
        third = (high - low) / 3.0
        early = eq4_in_step(law, block, base, p, tau, step, low + third)
        late = eq4_in_step(law, block, base, p, tau, step, high - third)
        if early < late:
            low += third
        else:
            high -= third
    return low


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
def begin_slide(block: Block, base: Base, p: int, tau: float, phase: int) -> None:
    """Begin to slide at τ, from rest or with a velocity kept."""
    block.phase = phase
    block.onset = block.zero + tau
    block.growth = base.pieces[p].finish - tau if phase != CONTINUOUS else math.inf
    if block.velocity == 0.0:
        block.slips += 1.0


@scalar
def begin_stick_slip(
    law: Law, block: Block, base: Base, p: int, tau: float, rises: bool, ground: float
) -> None:
    """t1: begin to slide with b = max(Üy, Eq. 4), with the literal rise b by Eq. 4."""
    eq4 = eq4_of(law, block, ground)
    follows = block.rise == LITERAL or eq4 >= block.yield_acceleration
    block.held = eq4 if follows else block.yield_acceleration
    begin_slide(block, base, p, tau, FOLLOWS if follows and rises else HELD)


@scalar
def end_positive_half_wave(block: Block) -> None:
    """t5: from Üg = 0 on Eq. 12 takes V to 0, with Ümax = b; or b is held on (`recoupling`)."""
    block.in_pulse = 0
    if block.phase == HELD or block.phase == FOLLOWS:
        block.phase = ATTENUATES if block.recoupling == EQ12 else HELD_ON
        if block.held <= 0.0:
            block.validity |= flags.KD_NOT_POSITIVE


@scalar
def wait_for_yield(law: Law, block: Block, base: Base, p: int, tau: float) -> float:
    """Return τ at which Newmark's block at rest begins to slide: where Üg exceeds what it resists."""
    piece = base.pieces[p]
    down = resistance(law, block, False, 0.0, block.slip)
    up = resistance(law, block, True, 0.0, block.slip) if block.slides_up else math.inf
    block.yield_acceleration = down
    ground = ground_at(block, base, p, tau)
    last = block.amplitude * piece.last
    if ground > down or ground < -up:
        begin_slide(block, base, p, tau, DOWN if ground > down else UP)
    elif last > down:
        tau = max(tau, place_beyond(block, base, p, down, True))
        begin_slide(block, base, p, tau, DOWN)
    elif last < -up:
        tau = max(tau, place_beyond(block, base, p, -up, False))
        begin_slide(block, base, p, tau, UP)
    else:
        return piece.finish
    return tau


@scalar
def wait_for_eq4(law: Law, block: Block, base: Base, p: int, tau: float, end: float) -> float:
    """Return τ at which the paper's block begins to slide while Üg rises beyond Üy: t1.

    That is where Eq. 4 is below Üg; `end`, if that is not so at the end, either.
    """
    if block.amplitude * base.pieces[p].last < block.yield_acceleration:
        return base.pieces[p].finish
    if ground_at(block, base, p, tau) < block.yield_acceleration:
        tau = place_beyond(block, base, p, block.yield_acceleration, True)
    ground = ground_at(block, base, p, tau)
    if eq4_of(law, block, ground) < ground:
        begin_stick_slip(law, block, base, p, tau, True, ground)
        return tau
    end = max(tau, end)
    ground = ground_at(block, base, p, end)
    if eq4_of(law, block, ground) >= ground:
        return end
    low = tau
    high = end
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        ground = ground_at(block, base, p, middle)
        if eq4_of(law, block, ground) < ground:
            high = middle
        else:
            low = middle
    block.held = ground_at(block, base, p, high)  # Eq. 4 is Üg there, but for rounding
    begin_slide(block, base, p, high, FOLLOWS if block.rise == LITERAL else HELD)
    return high


@scalar
def wait(law: Law, block: Block, base: Base, p: int, rises: bool, tau: float, end: float) -> float:
    """Return τ at which a block at rest begins to slide, or up to which it does not."""
    if block.rise == NEWMARK:
        return wait_for_yield(law, block, base, p, tau)
    if rises and block.in_pulse:
        return wait_for_eq4(law, block, base, p, tau, end)
    return base.pieces[p].finish


@scalar
def note(block: Block, log: np.ndarray, time: float, step: Step) -> None:
    """Note a step in the log; beyond its end steps are only counted."""
    if block.logged < log.size:
        row = log[block.logged]
        row.phase = block.phase
        row.time = time
        row.step = step.h
        row.velocity = block.velocity
        row.gained = step.gained
        row.displacement = block.displacement
        row.first_rate = step.first_rate
        row.last_rate = step.last_rate
        row.first = step.ground[0] - step.first_rate
        row.middle = step.ground[1] - step.middle_rate
        row.last = step.ground[2] - step.last_rate
    block.logged += 1


@scalar
def attenuate(block: Block, log: np.ndarray, time: float, duration: float) -> None:
    """Eq. 12 for some time, or up to the stop: one step V −= b h, which is exact for any h."""
    side = math.copysign(1.0, block.velocity)
    speed = abs(block.velocity)
    moved = eq.attenuated_displacement(speed, block.held, duration)
    left = eq.attenuated_velocity(speed, block.held, duration)
    if log.size > 0:
        braking = -side * block.held
        h = min(speed / block.held, duration)
        nowhere = (0.0, 0.0, 0.0)
        gained = side * (left - speed)
        note(block, log, time, Step(h, nowhere, braking, braking, braking, gained, side * moved))
    block.displacement += side * moved
    block.slip += moved
    block.velocity = side * left
    if left == 0.0:
        rest(block)


# ------------------------------------------------------------------ along a piece


@scalar
def rate_at(law: Law, block: Block, ground: float) -> float:
    """Return the rate at the beginning of a phase; a slide that begins is not stopped by rounding."""
    first_rate = rate(law, block, ground, block.velocity, block.slip)
    if block.velocity == 0.0 and block.phase == UP:
        return min(first_rate, 0.0)
    if block.velocity == 0.0 and block.phase != CONTINUOUS:
        return max(first_rate, 0.0)
    return first_rate


@inlined
def take(block: Block, step: Step) -> None:
    """Take a step."""
    block.velocity += step.gained
    block.displacement += step.moved
    block.slip += abs(step.moved)
    if block.phase != UP:
        block.largest_velocity = max(block.largest_velocity, block.velocity)
    block.least_velocity = min(block.least_velocity, block.velocity)
    if block.phase == FOLLOWS:
        block.held = step.ground[2] - step.last_rate  # b = Ü


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
    """Take whole steps up to one in which the phase may end; return how many, and the rate there.

    `points` is Üg over A at their ends.
    """
    each = 2 if block.rule == SIMPSON else 1
    start = block.amplitude * points[0]
    for taken in range(steps):
        end = block.amplitude * points[each * (taken + 1)]
        middle = block.amplitude * points[2 * taken + 1] if each == 2 else 0.5 * (start + end)
        if law.knows_motion and law.longest_step(block, first_rate) < h:
            return taken, first_rate
        step = advance(law, block, (start, middle, end), h, first_rate)
        if may_end(law, block, rises, step):
            return taken, first_rate
        take(block, step)
        first_rate = step.last_rate
        start = end
    return steps, first_rate


@scalar
def try_step(
    law: Law, block: Block, base: Base, p: int, tau: float, h: float, first_rate: float
) -> Step:
    """Return a step h from τ."""
    return advance(law, block, ground_in_step(block, base, p, tau, h), h, first_rate)


@scalar
def take_step(
    law: Law,
    block: Block,
    base: Base,
    p: int,
    rises: bool,
    tau: float,
    h: float,
    first_rate: float,
    log: np.ndarray,
) -> tuple[float, float]:
    """Take a step h from τ, or its part up to the end of the phase; return the step and the rate.

    The rate at the end of the step is NaN where another phase follows.
    """
    step = try_step(law, block, base, p, tau, h, first_rate)
    stop = math.inf if block.phase == CONTINUOUS else part_to_stop(block, step)
    change = math.inf  # from held to following Eq. 4, or back
    if rises and block.phase == HELD:
        change = part_to_exceed(law, block, base, p, tau, step)
    elif rises and block.phase == FOLLOWS and block.rise == MONOTONE:
        change = part_to_fall(law, block, base, p, tau, step)
    kink = part_to_kink(block, step) if law.knows_slip else math.inf
    part = min(stop, change, kink)
    if part <= 1.0:
        stays = step.gained >= 0.0 if block.phase == UP else step.gained <= 0.0
        if block.velocity == 0.0 and stays:
            rest(block)  # rounding has made it slide
            return h, math.nan
        step = try_step(law, block, base, p, tau, h * part, first_rate)
    if log.size > 0:
        note(block, log, block.zero + tau, step)
    if opposite(step.first_rate, step.last_rate):
        extreme = velocity_in_step(block, step, part_to_turn(step))
        block.largest_velocity = max(block.largest_velocity, extreme)
        block.least_velocity = min(block.least_velocity, extreme)
    take(block, step)
    if part > 1.0:
        return h, step.last_rate
    if stop <= part:
        rest(block)
    elif kink <= part:
        block.slip = block.weakens_until
        return step.h, step.last_rate
    else:
        block.phase = FOLLOWS if block.phase == HELD else HELD
    return step.h, math.nan


@scalar
def step_along(
    law: Law,
    block: Block,
    base: Base,
    p: int,
    rises: bool,
    tau: float,
    until: float,
    points: np.ndarray,
    log: np.ndarray,
) -> None:
    """Go from τ to `until` on piece p, step by step; `points` is Üg over A at the ends of its steps.

    From its onset to the end of the piece a slide takes N/64 steps at least, later a step is at
    most 16/N of the time since the onset, so that slides shorter than a step are resolved.
    """
    piece = base.pieces[p]
    each = 2 if block.rule == SIMPSON else 1
    count = (points.size - 1) // each
    whole = (piece.finish - piece.begin) / count
    # steps on the piece that are whole before `until`
    last = count if until == piece.finish else int((until - piece.begin) / whole)
    j = min(max(int((tau - piece.begin) / whole), 0), count - 1)
    first_rate = math.nan  # where it is not known from the step before
    while tau < until:
        while j + 1 < count and tau >= piece.begin + (j + 1) * whole:
            j += 1
        end = min(piece.begin + (j + 1) * whole, until) if j + 1 < count else until
        if block.phase == STUCK:
            tau = wait(law, block, base, p, rises, tau, end)
            first_rate = math.nan
            continue
        if math.isnan(first_rate):
            first_rate = rate_at(law, block, ground_at(block, base, p, tau))
        since = block.zero + tau - block.onset
        longest = max(GROWTH_SHARE * block.growth, TIME_SHARE * since) / block.steps
        if law.knows_motion:
            longest = min(longest, law.longest_step(block, first_rate))
        is_whole = j < last and tau == piece.begin + j * whole and longest >= whole
        if is_whole and log.size == 0:
            taken, first_rate = take_whole_steps(
                law, block, rises, whole, points[each * j :], last - j, first_rate
            )
            if taken > 0:
                j += taken
                tau = piece.finish if j == count else piece.begin + j * whole
                continue
        h = min(max(longest, SHORTEST_STEP), end - tau)
        passed, first_rate = take_step(law, block, base, p, rises, tau, h, first_rate, log)
        tau = end if passed >= end - tau else tau + passed


# ------------------------------------------------------------------ pulses


@scalar
def set_friction(block: Block, cell: np.record, options: Options, peak: float) -> Interface:
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
        if eq4_of(law, block, ground) > block.yield_acceleration:
            return False
    return True


@scalar
def yield_governs_wave(law: Law, block: Block, base: Base) -> bool:
    """Return whether Eq. 4 stays at or below Üy on all rises, and wherever Üg jumps to."""
    if block.mode != eq.STICK_SLIP or block.rise != MONOTONE:
        return False
    for p in range(base.pieces.size):
        piece = base.pieces[p]
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
        block.held = eq4_of(law, block, peak)  # for Eq. 12 after it
        block.stick_slip_pulses -= 1.0
        block.continuous_pulses += 1.0
    elif block.rise == MONOTONE and yield_governs(law, block, block.yield_acceleration, peak):
        block.validity |= flags.YIELD_GOVERNS
        estimated = False
    block.validity |= flags.FRICTION_ESTIMATED if estimated else 0


@scalar
def begin_pulse(law: Law, block: Block, base: Base, p: int, tau: float, rises: bool) -> None:
    """Go on from where Üg reaches Üy in a half wave; at rest the block waits for t1."""
    block.in_pulse = 1
    if block.rise == NEWMARK:
        return
    if block.mode == eq.CONTINUOUS:  # for good; under a record for this pulse
        if block.phase != CONTINUOUS:
            begin_slide(block, base, p, tau, CONTINUOUS)
        return
    if block.velocity < 0.0:
        rest(block)  # upslope motion, which continuous sliding may leave, is neglected
    ground = max(block.amplitude * base.pieces[p].first, block.yield_acceleration)
    if block.velocity > 0.0 or (not rises and eq4_of(law, block, ground) < ground):
        begin_stick_slip(law, block, base, p, tau, rises, ground)


@scalar
def enter_rise_or_fall(law: Law, block: Block, ground: float, rises: bool) -> None:
    """Go on at the beginning of a piece: on a rise b is max(b, Eq. 4), on a fall it is held."""
    if not rises and block.phase == FOLLOWS:
        block.phase = HELD
    elif rises and block.phase == HELD:
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
    log: np.ndarray,
) -> None:
    """Go through the pieces of a cycle of the path, whose times are `offset` later."""
    base = path.base
    is_record = block.steps_on_piece > 0
    k = 0  # the positive half wave that a piece lies in, or that comes next
    for p in range(path.cycles[cycle].first, path.cycles[cycle + 1].first):
        while k < path.intervals.size and path.intervals[k].end <= p:
            k += 1
        peak = block.amplitude * path.intervals[k].height if k < path.intervals.size else 0.0
        is_pulse = peak > block.yield_acceleration
        piece = base.pieces[p]
        rises = piece.top > 0.0 and piece.first <= piece.last
        starts = k < path.intervals.size and path.intervals[k].first == p
        if block.in_pulse and (starts or piece.top <= 0.0):
            end_positive_half_wave(block)
        ended = piece.top == 0.0 or (starts and not is_pulse)
        if is_record and block.phase == CONTINUOUS and not block.in_pulse and ended:
            block.phase = ATTENUATES  # after the negative half wave
        enter_rise_or_fall(law, block, block.amplitude * piece.first, rises)

        reaches = math.inf  # τ at which the pulse begins
        highest = block.amplitude * max(piece.first, piece.last)
        comes = piece.top > 0.0 and is_pulse and not block.in_pulse
        if comes and highest >= block.yield_acceleration:
            reaches = piece.begin
            if rises and not law.is_strength:
                reaches = place_beyond(block, base, p, block.yield_acceleration, True)
        block.zero = offset + piece.start - piece.begin
        points = steps.wave[steps.first[p] : steps.first[p + 1]]
        tau = piece.begin
        for until in (min(reaches, piece.finish), piece.finish):
            waits = block.phase == STUCK and block.rise != NEWMARK and block.in_pulse == 0
            if tau < until and not waits and block.validity & NO_VALUE == 0:
                if block.phase == ATTENUATES:
                    attenuate(block, log, block.zero + tau, until - tau)
                else:
                    step_along(law, block, base, p, rises, tau, until, points, log)
            if until == reaches and not block.in_pulse:
                slides = block.velocity > 0.0 and block.rise != NEWMARK
                if block.mode == eq.STICK_SLIP and slides:
                    block.validity |= flags.NOT_RECOUPLED  # Eq. 12 has not brought it to rest
                if is_record:
                    set_friction_of_pulse(law, block, cell, options, peak)
                begin_pulse(law, block, base, p, until, rises)
            tau = until


@scalar
def slide_freely(law: Law, block: Block, log: np.ndarray, time: float) -> None:
    """After the shaking the strength of Newmark's block takes V to 0, or never does.

    Steps are those that the law takes, at first 64/N of the time to the stop with the strength at
    the end of the shaking, later 16/N of the time since; from where the strength is constant on, one
    step is all.
    """
    side = -1.0 if block.phase == UP else 1.0
    still = (0.0, 0.0, 0.0)
    first_rate = rate(law, block, 0.0, block.velocity, block.slip)
    shortest = GROWTH_SHARE / block.steps * abs(block.velocity / first_rate)
    start = time
    while block.phase != STUCK:
        is_constant = law.knows_slip and block.slip >= block.weakens_until
        if side * first_rate >= 0.0 and (is_constant or not law.knows_slip):
            block.validity |= flags.NOT_AT_REST
            return
        if is_constant:
            block.held = -side * first_rate
            block.phase = ATTENUATES
            attenuate(block, log, time, math.inf)
            return
        longest = max(shortest, TIME_SHARE / block.steps * (time - start))
        h = max(min(longest, law.longest_step(block, first_rate)), SHORTEST_STEP)
        step = advance(law, block, still, h, first_rate)
        stop = part_to_stop(block, step)
        kink = part_to_kink(block, step) if law.knows_slip else math.inf
        part = min(stop, kink)
        if part <= 1.0:
            step = advance(law, block, still, h * part, first_rate)
        if log.size > 0:
            note(block, log, time, step)
        take(block, step)
        time += step.h
        first_rate = step.last_rate
        # it may stop where the strength that is left is just what holds it
        creeps = block.slip + abs(step.moved) == block.slip
        if creeps or (stop <= 1.0 and stop <= kink):
            rest(block)
        elif kink <= 1.0:
            block.slip = block.weakens_until


@scalar
def run_out(law: Law, block: Block, log: np.ndarray, time: float) -> None:
    """After the shaking Eq. 12 takes V to 0, but that of continuous sliding under a waveform.

    A block that is at rest then, but too weak to stay there, has no value, either.
    """
    end_positive_half_wave(block)
    if block.validity & NO_VALUE != 0:
        return
    if law.is_strength and block.rise == NEWMARK:
        if block.phase != STUCK:
            slide_freely(law, block, log, time)
        if block.phase == STUCK and resistance(law, block, False, 0.0, block.slip) < 0.0:
            block.validity |= flags.NOT_AT_REST
        return
    if block.phase == STUCK or (block.phase == CONTINUOUS and block.steps_on_piece == 0):
        return
    if block.phase == DOWN:
        block.held = block.yield_acceleration
    elif block.phase == UP:
        block.held = block.upslope_yield_acceleration
    block.phase = ATTENUATES
    attenuate(block, log, time, math.inf)


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
    weakens: bool


@scalar
def repetitions(block: Block, cycle: Cycle, left: int) -> int:
    """Return how often the next cycles of that shape, at most `left`, gain what `cycle` did.

    They do so if they begin in the same state; and also with a larger V, if friction does not depend
    on the motion and the block does not come to rest: then V is larger throughout by as much.  A
    block that weakens with the slip is never in the same state.
    """
    if block.phase != cycle.phase or block.held != cycle.held or cycle.weakens:
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
def walk_cycle(
    law: Law,
    block: Block,
    cell: np.record,
    options: Options,
    path: Path,
    cycle: int,
    offset: float,
    steps: Steps,
    log: np.ndarray,
) -> Cycle:
    """Go through a cycle and return what the block gained in it."""
    phase = block.phase
    held = block.held
    velocity = block.velocity
    displacement = block.displacement
    weakens = block.slip < block.weakens_until
    largest_velocity = block.largest_velocity
    largest_displacement = block.largest_displacement
    smallest_displacement = block.smallest_displacement
    block.largest_velocity = velocity
    block.least_velocity = velocity
    block.largest_displacement = displacement
    block.smallest_displacement = displacement
    walk(law, block, cell, options, path, cycle, offset, steps, log)
    walked = Cycle(
        path.cycles[cycle].shape,
        phase,
        held,
        velocity,
        block.velocity - velocity,
        block.displacement - displacement - 2.0 * math.pi * velocity,
        block.largest_velocity - velocity,
        block.largest_displacement - displacement,
        block.smallest_displacement - displacement,
        not law.knows_motion and (phase == CONTINUOUS or block.least_velocity > 0.0),
        weakens,
    )
    block.largest_velocity = max(block.largest_velocity, largest_velocity)
    block.largest_displacement = max(block.largest_displacement, largest_displacement)
    block.smallest_displacement = min(block.smallest_displacement, smallest_displacement)
    return walked


@single
def walk_cycles(
    law: Law,
    block: Block,
    cell: np.record,
    options: Options,
    path: Path,
    steps: Steps,
    log: np.ndarray,
) -> None:
    """Go through all cycles; those that gain what the last one did are not walked again."""
    walked = Cycle(-1, -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False, False)
    n = 0
    for c in range(path.cycles.size - 1):
        left = path.repeats if path.repeats > 0 and c == path.lead else 1
        while left > 0 and block.validity & NO_VALUE == 0:
            count = 0
            if walked.shape == path.cycles[c].shape and log.size == 0:
                count = repetitions(block, walked, left)
            if count > 0:
                repeat(block, walked, count)
            else:
                offset = 2.0 * math.pi * (n - c)
                walked = walk_cycle(law, block, cell, options, path, c, offset, steps, log)
                count = 1
            left -= count
            n += count


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


@scalar
def put_at_rest(law: Law, block: Block, cell: np.record, options: Options) -> None:
    """Set what is given of a cell, and a block that has not moved."""
    block.amplitude = cell.amplitude
    block.tan_theta = cell.tan_theta
    block.mu_s = cell.mu_s
    block.upslope_yield_acceleration = flags.given_or(cell.upslope_yield_acceleration, math.inf)
    block.slides_up = 0 if math.isnan(cell.upslope_yield_acceleration) else 1
    block.residual_mu = cell.residual_mu
    block.weakening_distance = cell.weakening_distance
    block.fast_mu = cell.fast_mu
    block.rate_constant = cell.rate_constant
    block.weakens_until = 0.0
    if law.knows_slip:
        distance = flags.given_or(cell.weakening_distance, math.inf)
        block.weakens_until = distance / (cell.seconds * cell.seconds)
    block.g = options.g
    block.seconds = cell.seconds
    block.rise = options.rise
    block.recoupling = options.recoupling
    block.phase = STUCK
    block.in_pulse = 0
    block.held = 0.0
    block.velocity = 0.0
    block.displacement = 0.0
    block.slip = 0.0
    block.largest_velocity = 0.0
    block.largest_displacement = 0.0
    block.smallest_displacement = 0.0
    block.slips = 0.0
    block.stick_slip_pulses = 0.0
    block.continuous_pulses = 0.0
    block.logged = 0


@single
def solve_cell(
    law: Law,
    block: Block,
    cell: np.record,
    options: Options,
    path: Path,
    steps: Steps,
    log: np.ndarray,
    result: np.ndarray,
) -> None:
    """Step a cell through the shaking and on to rest; `result` is (`block.RESULTS`,)."""
    put_at_rest(law, block, cell, options)
    block.validity = validity_before(block, cell, options, path)
    mode = block.mode
    peak = block.amplitude * max(path.highest, -path.lowest)
    slides_up = block.amplitude * -path.lowest > block.upslope_yield_acceleration
    slides = slides_up or block.amplitude * path.highest > block.yield_acceleration
    if slides_up and mode == eq.STUCK:
        mode = eq.STICK_SLIP
    if block.validity & NO_VALUE == 0 and slides:
        if block.residual_mu <= block.tan_theta or block.fast_mu <= block.tan_theta:
            block.validity |= flags.MAY_NOT_STOP
        if block.steps_on_piece == 0 and yield_governs_wave(law, block, path.base):
            block.validity = flags.without_estimates(block.validity | flags.YIELD_GOVERNS)
        walk_cycles(law, block, cell, options, path, steps, log)
        end = path.base.pieces[path.base.pieces.size - 1].end
        run_out(law, block, log, end + 2.0 * math.pi * max(path.repeats - 1, 0))
    validity = flags.settled(block.validity, block.displacement, peak)
    if block.slides_up:
        validity &= ~flags.UPSLOPE  # no caution for a block that slides both ways
    if validity & NO_VALUE:
        result[:] = -1.0
        result[0] = result[1] = math.nan
        result[7:] = math.nan
        result[3] = float(validity)
        return
    result[0] = block.displacement
    result[1] = block.largest_velocity
    result[2] = float(mode)
    result[3] = float(validity)
    result[4] = block.slips
    result[5] = block.stick_slip_pulses
    result[6] = block.continuous_pulses
    result[7] = max(block.largest_displacement, block.displacement)
    result[8] = min(block.smallest_displacement, block.displacement)
    result[9] = result[7] - result[8]


@single
def solve_cells(
    law: Law,
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with a friction law, as `solve_steps` does with that of the paper."""
    for j in range(cells.size):
        solve_cell(law, blocks[0], cells[j], options, path, steps, log, results[:, j])


@kernel
def solve_steps(
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with the friction law of the paper.

    `cells` are of dtype `STEP_CELL`; `blocks`, (1,), says how they are stepped (`blocks_of`); `log`
    is of dtype `LOG`, empty if no history is asked for; `results` is (`block.RESULTS`, cells).
    """
    law = Law(exponential_friction, False, False, False, unlimited)
    solve_cells(law, cells, options, path, blocks, steps, log, results)


# ------------------------------------------------------------------ for callers in Python


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


def samples_of(
    log: np.ndarray, phases: NDArray[np.float64], ground: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return Ü, V and W at phases, (samples,), from the steps of a log; `ground` is Üg there.

    In a step V is the cubic through its values and rates at both ends, and Ü a parabola.
    """
    before = np.zeros(1, LOG)
    before["time"] = -np.inf
    before["step"] = 1.0
    rows = np.concatenate([before, log])
    at = np.searchsorted(rows["time"], phases, side="right") - 1
    # a block rests from the end of a step on, if the next one begins from rest
    goes_on = np.append(rows["velocity"][1:] != 0.0, rows["phase"][-1] == CONTINUOUS)[at]
    row = rows[at]
    step = row["step"]
    since = phases - row["time"]
    rests = (since > step) & ~goes_on
    part = np.clip(since / np.maximum(step, np.finfo(float).tiny), 0.0, 1.0)
    in_step = row["velocity"], step, row["gained"], row["first_rate"], row["last_rate"], part
    velocity = cubic(*in_step)
    displacement = row["displacement"] + integral_of_cubic(*in_step)
    bend = 2.0 * (row["first"] + row["last"] - 2.0 * row["middle"])
    block = row["first"] + part * (row["last"] - row["first"] - bend) + part**2 * bend
    block = np.where(row["phase"] == ATTENUATES, ground - row["first_rate"], block)
    return np.where(rests, ground, block), np.where(rests, 0.0, velocity), displacement
