"""The paper's block, stepped in time: V += (Üg − Ü) h.

The base's motion comes in monotone pieces, from one zero, peak or sample to the next.  What the
block does is its phase: it says what Ü is (`rate`).  `step_along` is the loop: along a piece the
block takes equal steps by one of three rules (`advance`).  A step in which the phase ends is taken
again up to there (`end_of_phase`), and the block goes on in the next phase.  Eq. 12 takes one step
of any length (`attenuate`).  `enter_piece` and `begin_pulse` say what begins and ends with the half
waves of the base: t1 and t5.

Time here is ωt, so that V = ωv and W = ω²u; under a record it is the time at scale 1.
docs/numerics.md#step-solver
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from slipsweep.jit.decorators import as_value, inlined, registered, scalar, single
from slipsweep.kernels.block import (
    EQ12,
    FRICTION_ESTIMATED,
    FRICTION_NOT_DECAYING,
    KD_NOT_POSITIVE,
    LITERAL,
    MONOTONE,
    NEAR_MODE_LIMIT,
    NO_VALUE,
    NOT_RECOUPLED,
    YIELD_GOVERNS,
    Cell,
    Interface,
    decay_rate_of,
    interface_of,
)
from slipsweep.model import equations as eq
from slipsweep.model.options import StepRule
from slipsweep.motion.paths import Path, Piece

#: Rules by which steps are taken: Euler's, Heun's and that of Runge and Kutta, which is Simpson's
#: where friction does not depend on the motion.  Their errors are of the orders 1, 2 and 4.
RECTANGLE = int(StepRule.RECTANGLE)
TRAPEZOID = int(StepRule.TRAPEZOID)
SIMPSON = int(StepRule.SIMPSON)

#: The rules in stages (`advance_by_stages`).  A stage evaluates the rate at its node, a part of the
#: step, with V there by the rate of the stage before.  The weights of its rate are those in the
#: gain of V, over h, and in that of W, over h².
STAGES = np.array([0, 1, 3])  # after the first, whose rate is known from the step before
NODES = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [0, 1 / 2, 1 / 2, 1]])
VELOCITY_WEIGHTS = np.array([[1, 0, 0, 0], [1 / 2, 1 / 2, 0, 0], [1 / 6, 2 / 6, 2 / 6, 1 / 6]])
DISPLACEMENT_WEIGHTS = np.array([[1 / 2, 0, 0, 0], [1 / 3, 1 / 6, 0, 0], [1 / 6, 1 / 6, 1 / 6, 0]])

#: Phases of the motion, each with its block acceleration Ü.
STUCK = 0  # Ü = Üg, V = 0
HELD = 1  # stick-slip: Ü = b, a constant
FOLLOWS = 2  # stick-slip: Ü by Eq. 4, b = Ü
ATTENUATES = 3  # from t5 on: Eq. 12
HELD_ON = 4  # from t5 on with recoupling = "integrate": Ü = b still
CONTINUOUS = 5  # continuous sliding: Ü by Eq. 4, V of either sign
SLIDES = 6  # Newmark's block (`kernels.step_newmark`): Ü = Üy, or V < 0 and Ü = −Üy,up

#: What happens to a phase in a step.
GOES_ON = 0
STOPS = 1  # V = 0
CHANGES = 2  # from HELD to FOLLOWS, or back
WEAKENED = 3  # from here on the law does not depend on the slip


class Law(NamedTuple):
    """A friction law μ(block, Üg, v, s), and the block that it acts on.

    v is the relative velocity in m/s, s = ∫|v|dt the slip in m; a law of the strength of Newmark's
    block is given no Üg, and the speed in the direction of the slide (`kernels.step_newmark`).
    `knows_motion` says whether μ depends on v or s, `knows_slip` whether on s.  `longest_step`, of
    the block and the rate of V, is the longest step that resolves the law (`unlimited`, if the
    default steps do).  The rest says what the block does: its rate while it slides, how it waits,
    and how it comes to rest after the shaking.  `step_cells.paper_law` makes the law of a block of
    the paper.
    """

    friction: Callable[..., float]
    knows_motion: bool
    knows_slip: bool
    longest_step: Callable[..., float]
    sliding_rate: Callable[..., float]
    wait: Callable[..., float]
    run_out: Callable[..., None]


#: A block: its parameters, how it is stepped, and its motion up to now.
BLOCK = np.dtype(
    (
        np.record,
        [
            ("amplitude", "f8"),  # A, or the factor on a record
            ("tan_theta", "f8"),
            ("mu_s", "f8"),
            # as given, NaN where they are estimated
            ("given_yield_acceleration", "f8"),
            ("given_decay_rate", "f8"),
            ("given_delta_mu", "f8"),
            ("given_minimum_friction", "f8"),
            # of the cell, under a record of the pulse
            ("delta_mu", "f8"),
            ("decay_rate", "f8"),
            ("yield_acceleration", "f8"),
            ("mode", "i8"),  # `SlidingMode`
            ("upslope_yield_acceleration", "f8"),
            ("slides_up", "i8"),  # in both directions
            ("residual_mu", "f8"),
            ("weakening_distance", "f8"),
            ("fast_mu", "f8"),
            ("rate_constant", "f8"),
            ("weakens_until", "f8"),  # ∫|V| from which on the law does not depend on it
            ("g", "f8"),
            ("seconds", "f8"),  # in a unit of time
            ("is_newmark", "i8"),
            ("rise", "i8"),
            ("recoupling", "i8"),
            ("recorded", "i8"),  # under a record, where each pulse has its own friction
            ("rule", "i8"),
            ("steps", "i8"),  # `steps_per_cycle`, N
            ("phase", "i8"),
            ("in_pulse", "i8"),  # from Üg = Üy to the end of the positive half wave
            ("side", "f8"),  # 1, of a block that slides upslope only −1
            ("rises", "i8"),  # Üg > 0 rises on the piece
            ("held", "f8"),  # b
            ("velocity", "f8"),  # V
            ("displacement", "f8"),  # W
            ("slip", "f8"),  # ∫|V|
            ("largest_velocity", "f8"),
            ("least_velocity", "f8"),
            ("largest_displacement", "f8"),
            ("smallest_displacement", "f8"),
            ("zero", "f8"),  # time at τ = 0 of the piece
            ("onset", "f8"),  # time at which the slide began
            ("first_step", "f8"),  # the longest one after it
            ("slips", "f8"),  # slides that began from rest
            ("stick_slip_pulses", "f8"),
            ("continuous_pulses", "f8"),
            ("validity", "i8"),
            # at the beginning of a cycle, and what was gained in it
            ("cycle_phase", "i8"),
            ("cycle_held", "f8"),
            ("cycle_velocity", "f8"),
            ("cycle_displacement", "f8"),
            ("cycle_slip", "f8"),
            ("gained", "f8"),
            ("moved", "f8"),
            ("highest", "f8"),
            ("farthest", "f8"),
            ("nearest", "f8"),
            # extremes before the cycle
            ("largest_so_far", "f8"),
            ("farthest_so_far", "f8"),
            ("nearest_so_far", "f8"),
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
    first: np.ndarray  # (pieces,) where the points of a piece begin
    last: np.ndarray  # (pieces,)
    pieces: np.ndarray  # those of the path, and silent ones, each twice as long as that before


#: How long a step may be after the onset of a slide (`step_along`), and the shortest that is taken:
#: with these even the shortest slides of docs/hard-cases.md have the errors of others.
GROWTH_SHARE = 64.0
TIME_SHARE = 16.0
SHORTEST_STEP = 1e-14

#: Accelerations that differ by no more are equal: as parts of Üg and of g.
ROUNDING = 1e-12
LEAST_ROUNDING = 4e-16

#: Points of a rise at which Eq. 4 is compared with Üy (`yield_governs`).
POINTS_OF_RISE = 32


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


@registered
def eq4_rate(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Üg − Ü with Ü by Eq. 4; positive where a block at rest begins to slide."""
    friction = friction_at(law, block, ground, velocity, slip)
    return eq.relative_acceleration(ground, friction, block.mu_s, block.tan_theta, block.g)


@scalar
def eq4_at(law: Law, block: Block, ground: float) -> float:
    """Ü by Eq. 4 at the velocity of the block."""
    return ground - eq4_rate(law, block, ground, block.velocity, block.slip)


@inlined
def rate(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Rate of V, Üg − Ü, in the block's phase; Eq. 12 is not stepped by the rules (`attenuate`)."""
    if block.phase == HELD or block.phase == HELD_ON:
        return ground - block.held
    return law.sliding_rate(law, block, ground, velocity, slip)


class Step(NamedTuple):
    """A step: Üg at its start, middle and end, the rates of V there, and the gains of V and W."""

    h: float
    start: float
    middle: float
    end: float
    first_rate: float
    middle_rate: float
    last_rate: float
    gained: float
    moved: float


@inlined
def advance(
    law: Law,
    block: Block,
    velocity: float,
    start: float,
    middle: float,
    end: float,
    h: float,
    first_rate: float,
) -> Step:
    """Find what a step h gains: V += (Üg − Ü) h.

    Where friction does not depend on the motion, the rules are those of integrals over the step,
    and `velocity`, that at the start, is all that is needed.
    """
    if law.knows_motion:
        return advance_by_stages(law, block, start, middle, end, h, first_rate)
    last_rate = rate(law, block, end, velocity, block.slip)
    middle_rate = 0.5 * (first_rate + last_rate)
    gained = first_rate
    moved = 0.5 * first_rate
    if block.rule == TRAPEZOID:
        gained = middle_rate
        moved = (2.0 * first_rate + last_rate) / 6.0
    elif block.rule == SIMPSON:
        middle_rate = rate(law, block, middle, velocity, block.slip)
        gained = (first_rate + 4.0 * middle_rate + last_rate) / 6.0
        moved = (first_rate + 2.0 * middle_rate) / 6.0
    gained *= h
    moved = (velocity + moved * h) * h
    return Step(h, start, middle, end, first_rate, middle_rate, last_rate, gained, moved)


@scalar
def advance_by_stages(
    law: Law,
    block: Block,
    start: float,
    middle: float,
    end: float,
    h: float,
    first_rate: float,
) -> Step:
    """Find what a step h gains where friction depends on the motion.

    Each stage of a rule goes from the start of the step to its node with the rate of the stage
    before.
    """
    rule = block.rule
    speed = block.velocity
    slope = first_rate
    middle_rate = first_rate
    gained = VELOCITY_WEIGHTS[rule, 0] * first_rate
    moved = DISPLACEMENT_WEIGHTS[rule, 0] * first_rate
    for stage in range(1, STAGES[rule] + 1):
        part = NODES[rule, stage]
        slip = block.slip + abs(part * h * speed)
        speed = block.velocity + part * h * slope
        slope = rate(law, block, middle if part < 1.0 else end, speed, slip)
        middle_rate = slope if part < 1.0 else middle_rate
        gained += VELOCITY_WEIGHTS[rule, stage] * slope
        moved += DISPLACEMENT_WEIGHTS[rule, stage] * slope
    gained *= h
    moved = (block.velocity + moved * h) * h
    last_rate = rate(law, block, end, block.velocity + gained, block.slip + abs(moved))
    if rule < SIMPSON:
        middle_rate = 0.5 * (first_rate + last_rate)
    return Step(h, start, middle, end, first_rate, middle_rate, last_rate, gained, moved)


@scalar
def ground_at(block: Block, piece: Piece, curves: np.ndarray, tau: float) -> float:
    """Üg at τ on a piece, with the sign of the piece also where it is 0."""
    total = piece.slope * tau
    if piece.degree > 1:
        coefficients = curves[piece.curve].coefficients
        total = 0.0
        for k in range(piece.degree - 1, -1, -1):
            total = (total + coefficients[k]) * tau
    return math.copysign(block.amplitude * (piece.top + total), piece.top)


@scalar
def first_rate_at(law: Law, block: Block, ground: float) -> float:
    """Rate at the beginning of a phase; rounding does not stop a slide that begins from rest."""
    first_rate = rate(law, block, ground, block.velocity, block.slip)
    starts = block.velocity == 0.0 and block.phase != CONTINUOUS
    return 0.0 if starts and block.side * first_rate < 0.0 else first_rate


@scalar
def ground_in_step(
    block: Block, piece: Piece, curves: np.ndarray, start: float, tau: float, h: float
) -> tuple[float, float]:
    """Üg in the middle and at the end of a step; in the middle a mean, if that will do."""
    end = ground_at(block, piece, curves, tau + h)
    if block.rule == SIMPSON:
        return ground_at(block, piece, curves, tau + 0.5 * h), end
    return 0.5 * (start + end), end


@inlined
def take(block: Block, step: Step) -> None:
    """Take a step."""
    block.velocity += step.gained
    block.displacement += step.moved
    block.slip += abs(step.moved)
    if block.side > 0.0:
        block.largest_velocity = max(block.largest_velocity, block.velocity)
    block.least_velocity = min(block.least_velocity, block.velocity)
    if block.phase == FOLLOWS:
        block.held = step.end - step.last_rate  # b = Ü


# ------------------------------------------------------------------ the end of a phase


@registered
def velocity_in_step(velocity: Any, step: Step, part: Any) -> Any:
    """V after a part of a step: the cubic through its values and rates at both ends."""
    left = 1.0 - part
    bend = part * left * (left * step.first_rate - part * step.last_rate) * step.h
    return velocity + part * part * (3.0 - 2.0 * part) * step.gained + bend


@registered
def moved_in_step(velocity: Any, step: Step, part: Any) -> Any:
    """W gained in a part of a step: the integral of that cubic."""
    square = part * part
    cube = square * part
    early = step.first_rate * square * (0.5 - part * (2.0 / 3.0 - 0.25 * part))
    late = step.last_rate * cube * (1.0 / 3.0 - 0.25 * part)
    mean = velocity * part + step.gained * cube * (1.0 - 0.5 * part)
    return step.h * (mean + step.h * (early - late))


@scalar
def part_to_zero(first: float, middle: float, last: float) -> float:
    """Return where the parabola through three values of a step, first ≤ 0 < last, passes 0."""
    slope = 4.0 * middle - 3.0 * first - last
    bend = 2.0 * (first - 2.0 * middle + last)
    root = math.sqrt(max(slope * slope - 4.0 * bend * first, 0.0))
    return -2.0 * first / (slope + root) if slope > 0.0 else (root - slope) / (2.0 * bend)


@inlined
def turns(step: Step) -> bool:
    """Return whether the rate of V changes its sign in a step."""
    return step.first_rate < 0.0 < step.last_rate or step.last_rate < 0.0 < step.first_rate


@scalar
def part_to_turn(step: Step) -> float:
    """Return the part of a step after which V is largest or least: its rate is 0."""
    side = math.copysign(1.0, step.last_rate)
    return part_to_zero(side * step.first_rate, side * step.middle_rate, side * step.last_rate)


@inlined
def excess(law: Law, block: Block, ground: float, velocity: float, slip: float) -> float:
    """Ü by Eq. 4 over b, less rounding."""
    eq4 = ground - eq4_rate(law, block, ground, velocity, slip)
    return eq4 - block.held - ROUNDING * abs(ground) - LEAST_ROUNDING * block.g


@inlined
def falls(block: Block, step: Step) -> bool:
    """Return whether Ü, by the parabola through three values, falls at the end of a step."""
    first = step.start - step.first_rate
    middle = step.middle - step.middle_rate
    last = step.end - step.last_rate
    rounding = ROUNDING * abs(step.end) + LEAST_ROUNDING * block.g
    return 4.0 * middle - 3.0 * last - first > rounding


@inlined
def may_end(law: Law, block: Block, step: Step) -> bool:
    """Return whether the phase may end in a step, or V be largest or least in it.

    A phase ends where V changes its sign.  While Üg rises b is no longer held where Eq. 4 exceeds
    it, and with the monotone rise it no longer follows Eq. 4 where that falls.  A law of the slip
    has a kink where it no longer depends on it.
    """
    velocity = block.velocity + step.gained
    slip = block.slip + abs(step.moved)
    if turns(step) or block.slip < block.weakens_until <= slip:
        return True
    if block.phase == CONTINUOUS:
        return False
    if block.side * velocity < 0.0:
        return True
    if block.rises and block.phase == HELD:
        return excess(law, block, step.end, velocity, slip) > 0.0
    return block.rises and block.phase == FOLLOWS and block.rise == MONOTONE and falls(block, step)


@scalar
def ending_by(block: Block, step: Step, part: float) -> int:
    """Return how the phase has ended after a part of a step: by V = 0, or as the law weakened."""
    velocity = velocity_in_step(block.velocity, step, part)
    if block.side * velocity < 0.0:
        return STOPS
    if block.slip >= block.weakens_until:
        return GOES_ON
    moved = moved_in_step(block.velocity, step, part)
    return WEAKENED if block.slip + abs(moved) >= block.weakens_until else GOES_ON


@scalar
def change_in_step(law: Law, block: Block, step: Step) -> float:
    """Return the part of a step after which Eq. 4 exceeds b, or falls; else infinity."""
    if block.phase == HELD:
        slip = block.slip + abs(step.moved)
        last = excess(law, block, step.end, block.velocity + step.gained, slip)
        if last <= 0.0:
            return math.inf
        velocity = velocity_in_step(block.velocity, step, 0.5)
        middle = excess(law, block, step.middle, velocity, block.slip + 0.5 * abs(step.moved))
        first = excess(law, block, step.start, block.velocity, block.slip)
        return part_to_zero(min(first, 0.0), middle, last)
    if not falls(block, step):
        return math.inf
    first = step.start - step.first_rate
    middle = step.middle - step.middle_rate
    last = step.end - step.last_rate
    # where the slope of the parabola through the three is 0
    slope = 4.0 * middle - 3.0 * first - last
    return slope / (4.0 * (2.0 * middle - first - last)) if slope > 0.0 else 0.0


@inlined
def has_not_begun(block: Block, step: Step) -> bool:
    """Return True if a step from rest does not leave it: only rounding has made it slide."""
    return block.velocity == 0.0 and block.side * step.gained <= 0.0


@scalar
def end_of_phase(law: Law, block: Block, step: Step) -> tuple[float, int]:
    """Return the part of a step after which the phase ends, and how; 1, if it goes on."""
    if block.phase == CONTINUOUS:
        return 1.0, GOES_ON
    high = 1.0
    ending = ending_by(block, step, high)
    if ending == GOES_ON and turns(step):
        high = part_to_turn(step)  # V may have passed 0 there, and come back
        ending = ending_by(block, step, high)
    low = 0.0 if ending != GOES_ON else high
    while low < 0.5 * (low + high) < high:
        part = 0.5 * (low + high)
        ending_there = ending_by(block, step, part)
        if ending_there == GOES_ON:
            low = part
        else:
            high = part
            ending = ending_there
    may_change = block.phase == HELD or (block.phase == FOLLOWS and block.rise == MONOTONE)
    if block.rises and may_change:
        change = change_in_step(law, block, step)
        if change < high or (change <= 1.0 and ending == GOES_ON):
            return change, CHANGES
    return high, ending


@scalar
def note_extreme(block: Block, step: Step) -> None:
    """Note V where it is largest or least in a step."""
    extreme = velocity_in_step(block.velocity, step, part_to_turn(step))
    block.largest_velocity = max(block.largest_velocity, extreme)
    block.least_velocity = min(block.least_velocity, extreme)


# ------------------------------------------------------------------ from phase to phase


@inlined
def end_phase(block: Block, ending: int) -> None:
    """Go on in the next phase."""
    if ending == STOPS:
        rest(block)
    elif ending == WEAKENED:
        block.slip = block.weakens_until
    else:
        block.phase = FOLLOWS if block.phase == HELD else HELD


@scalar
def rest(block: Block) -> None:
    """Come to rest."""
    block.phase = STUCK
    block.held = 0.0
    block.velocity = 0.0
    block.least_velocity = min(block.least_velocity, 0.0)
    block.largest_displacement = max(block.largest_displacement, block.displacement)
    block.smallest_displacement = min(block.smallest_displacement, block.displacement)


@scalar
def begin_slide(block: Block, piece: Piece, tau: float) -> None:
    """Begin to slide at τ, from rest or with a velocity kept, in the phase that is set."""
    block.onset = block.zero + tau
    rest_of_piece = piece.finish - tau if block.phase != CONTINUOUS else math.inf
    block.first_step = GROWTH_SHARE * rest_of_piece / block.steps
    if block.velocity == 0.0:
        block.slips += 1.0


@scalar
def begin_stick_slip(law: Law, block: Block, piece: Piece, tau: float, ground: float) -> None:
    """t1: begin to slide with b = max(Üy, Eq. 4), with the literal rise b by Eq. 4."""
    eq4 = eq4_at(law, block, ground)
    follows = block.rise == LITERAL or eq4 >= block.yield_acceleration
    block.held = eq4 if follows else block.yield_acceleration
    block.phase = FOLLOWS if follows and block.rises else HELD
    begin_slide(block, piece, tau)


@scalar
def end_positive_half_wave(block: Block) -> None:
    """t5: from Üg = 0 on Eq. 12 takes V to 0, with Ümax = b; or b is held on (`recoupling`)."""
    block.in_pulse = 0
    if block.phase == HELD or block.phase == FOLLOWS:
        block.phase = ATTENUATES if block.recoupling == EQ12 else HELD_ON
        if block.held <= 0.0:
            block.validity |= KD_NOT_POSITIVE


@scalar
def place_beyond(
    block: Block, piece: Piece, curves: np.ndarray, level: float, side: float
) -> float:
    """Return τ at which Üg, times side, passes a level that it has passed at the end of a piece."""
    if side * block.amplitude * piece.first >= level:
        return piece.begin
    low = piece.begin
    high = piece.finish
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        if side * ground_at(block, piece, curves, middle) >= level:
            high = middle
        else:
            low = middle
    return high


@as_value
def wait_for_eq4(
    law: Law,
    block: Block,
    piece: Piece,
    curves: np.ndarray,
    tau: float,
    until: float,
    end: float,
) -> float:
    """Return τ at which the paper's block begins to slide while Üg rises beyond Üy: t1.

    That is where Eq. 4 is below Üg.  If that is not so at the end of the step, either, it is `end`.
    Where the block cannot begin to slide, it is `until`, or the end of the piece: out of a pulse,
    on a fall, and where Üg does not reach Üy.
    """
    if not block.in_pulse or not block.rises:
        return until
    if block.amplitude * piece.last < block.yield_acceleration:
        return piece.finish
    ground = ground_at(block, piece, curves, tau)
    if ground < block.yield_acceleration:
        tau = place_beyond(block, piece, curves, block.yield_acceleration, 1.0)
        ground = ground_at(block, piece, curves, tau)
        end = max(tau, end)
    if eq4_at(law, block, ground) < ground:
        begin_stick_slip(law, block, piece, tau, ground)
        return tau
    ground = ground_at(block, piece, curves, end)
    if eq4_at(law, block, ground) >= ground:
        return end
    low = tau
    high = end
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        ground = ground_at(block, piece, curves, middle)
        if eq4_at(law, block, ground) < ground:
            high = middle
        else:
            low = middle
    block.held = ground_at(block, piece, curves, high)  # Eq. 4 is Üg there, but for rounding
    block.phase = FOLLOWS if block.rise == LITERAL else HELD
    begin_slide(block, piece, high)
    return high


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
        gained = side * (left - speed)
        step = Step(h, 0.0, 0.0, 0.0, braking, braking, braking, gained, side * moved)
        note(block, log, time, step)
    block.displacement += side * moved
    block.slip += moved
    block.velocity = side * left
    if left == 0.0:
        rest(block)


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
        row.first = step.start - step.first_rate
        row.middle = step.middle - step.middle_rate
        row.last = step.end - step.last_rate
    block.logged += 1


# ------------------------------------------------------------------ half waves


@scalar
def set_friction(block: Block, peak: float) -> Interface:
    """Set the block's friction and mode for shaking of that peak, by Eqs. 6-11."""
    parameters = Cell(
        block.tan_theta,
        block.mu_s,
        peak,
        block.given_yield_acceleration,
        block.given_decay_rate,
        block.given_delta_mu,
        block.given_minimum_friction,
    )
    interface = interface_of(parameters, block.rise, block.g)
    block.yield_acceleration = interface.yield_acceleration
    block.delta_mu = interface.delta_mu
    block.decay_rate = decay_rate_of(
        parameters, interface.delta_mu, interface.minimum_friction, block.g
    )
    block.mode = interface.sliding_mode
    return interface


@scalar
def yield_governs(law: Law, block: Block, low: float, high: float) -> bool:
    """Return True if, with the monotone rise, Eq. 4 is at most Üy for Üg from low to high.

    Where friction depends on the motion that is not known.
    """
    for j in range(POINTS_OF_RISE, -1, -1):
        ground = low + (high - low) * (j / POINTS_OF_RISE)
        if eq4_at(law, block, ground) > block.yield_acceleration:
            return False
    return block.rise == MONOTONE and not law.knows_motion


@scalar
def set_friction_of_pulse(law: Law, block: Block, peak: float) -> None:
    """Under a record each pulse has the friction of its own peak, and with it a mode and flags."""
    block.stick_slip_pulses += 1.0
    if block.is_newmark:
        return
    interface = set_friction(block, peak)
    near = 0.9 <= interface.acceleration_ratio <= 1.1
    block.validity |= interface.validity & FRICTION_NOT_DECAYING
    block.validity |= NEAR_MODE_LIMIT if near else 0
    block.mode = eq.STICK_SLIP
    if peak > interface.limiting_acceleration:
        block.mode = eq.CONTINUOUS
        block.held = eq4_at(law, block, peak)  # for Eq. 12 after it
        block.stick_slip_pulses -= 1.0
        block.continuous_pulses += 1.0
    elif yield_governs(law, block, block.yield_acceleration, peak):
        block.validity |= YIELD_GOVERNS
        return
    if math.isnan(block.given_decay_rate) or math.isnan(block.given_delta_mu):
        block.validity |= FRICTION_ESTIMATED


@scalar
def enter_piece(
    law: Law, block: Block, piece: Piece, curves: np.ndarray, starts: bool, peak: float
) -> float:
    """Go on at the beginning of a piece; return τ at which a pulse begins on it, or infinity.

    `peak` is that of the positive half wave that it lies in, or that comes next; `starts` says
    whether that begins here.
    """
    is_pulse = peak > block.yield_acceleration
    block.rises = piece.top > 0.0 and piece.first <= piece.last
    if block.in_pulse and (starts or piece.top <= 0.0):
        end_positive_half_wave(block)
    ended = piece.top == 0.0 or (starts and not is_pulse)
    if block.recorded and block.phase == CONTINUOUS and not block.in_pulse and ended:
        block.phase = ATTENUATES  # after the negative half wave
    if block.phase == FOLLOWS and not block.rises:
        block.phase = HELD  # t2
    elif block.phase == HELD and block.rises:
        ground = block.amplitude * piece.first
        eq4 = eq4_at(law, block, ground)
        if block.rise == LITERAL or eq4 > block.held:
            block.held = eq4
            block.phase = FOLLOWS
    highest = block.amplitude * max(piece.first, piece.last)
    comes = piece.top > 0.0 and is_pulse and not block.in_pulse
    if block.phase == CONTINUOUS and not block.recorded:
        comes = False  # for good
    if not comes or highest < block.yield_acceleration:
        return math.inf
    if not block.rises or block.is_newmark:
        return piece.begin
    return place_beyond(block, piece, curves, block.yield_acceleration, 1.0)


@scalar
def begin_pulse(law: Law, block: Block, piece: Piece, tau: float, peak: float) -> None:
    """Go on from where Üg reaches Üy in a half wave; at rest the block waits for t1."""
    if block.mode == eq.STICK_SLIP and block.velocity > 0.0 and not block.is_newmark:
        block.validity |= NOT_RECOUPLED  # Eq. 12 has not brought it to rest
    if block.recorded:
        set_friction_of_pulse(law, block, peak)
    block.in_pulse = 1
    if block.is_newmark:
        return
    if block.mode == eq.CONTINUOUS:  # for good; under a record for this pulse
        if block.phase != CONTINUOUS:
            block.phase = CONTINUOUS
            begin_slide(block, piece, tau)
        return
    if block.velocity < 0.0:
        rest(block)  # upslope motion, which continuous sliding may leave, is neglected
    ground = max(block.amplitude * piece.first, block.yield_acceleration)
    if block.velocity > 0.0 or (not block.rises and eq4_at(law, block, ground) < ground):
        begin_stick_slip(law, block, piece, tau, ground)


# ------------------------------------------------------------------ the loop


@scalar
def slide_on(law: Law, block: Block, points: np.ndarray, h: float, first_rate: float) -> None:
    """Continuous sliding, which does not end, in equal steps to the end of the piece.

    V and W are kept out of the block's memory; ∫|V| is not needed, as friction does not depend on
    the motion.
    """
    each = 2 if block.rule == SIMPSON else 1
    velocity = block.velocity
    displacement = block.displacement
    largest = velocity
    least = velocity
    start = block.amplitude * points[0]
    for k in range(each, points.size, each):
        end = block.amplitude * points[k]
        middle = block.amplitude * points[k - 1] if each == 2 else 0.5 * (start + end)
        step = advance(law, block, velocity, start, middle, end, h, first_rate)
        if turns(step):
            extreme = velocity_in_step(velocity, step, part_to_turn(step))
            largest = max(largest, extreme)
            least = min(least, extreme)
        velocity += step.gained
        displacement += step.moved
        largest = max(largest, velocity)
        least = min(least, velocity)
        first_rate = step.last_rate
        start = end
    block.velocity = velocity
    block.displacement = displacement
    block.largest_velocity = max(block.largest_velocity, largest)
    block.least_velocity = min(block.least_velocity, least)


@scalar
def step_along(
    law: Law,
    block: Block,
    piece: Piece,
    curves: np.ndarray,
    points: np.ndarray,
    pulse: float,
    peak: float,
    log: np.ndarray,
) -> None:
    """Go along a piece, step by step, in each phase as it says.

    `points` is Üg over A at the ends of the steps on the piece, with Simpson's rule in their
    middles, too.  At τ = `pulse` a pulse of that peak begins.  From its onset to the end of the
    piece a slide takes N/64 steps at least; later a step is no longer than those, or than 16/N of
    the time since the onset.  So slides shorter than a step are resolved.
    """
    each = 2 if block.rule == SIMPSON else 1
    count = (points.size - 1) // each
    whole = (piece.finish - piece.begin) / count
    share = TIME_SHARE / block.steps
    tau = piece.begin
    # the step on the piece that τ lies in, and its ends
    j = 0
    point = piece.begin
    next_point = piece.begin + whole if count > 1 else piece.finish
    # Üg at τ, and the rate, which is NaN where it is not known from the step before
    ground = 0.0
    first_rate = math.nan
    goes_on = not law.knows_motion and log.size == 0
    while tau < piece.finish and block.validity & NO_VALUE == 0:
        if tau >= pulse:
            begin_pulse(law, block, piece, tau, peak)
            pulse = math.inf
            first_rate = math.nan
        until = min(pulse, piece.finish)
        while j + 1 < count and tau >= next_point:
            j += 1
            point = next_point
            next_point = piece.begin + (j + 1) * whole if j + 1 < count else piece.finish
        end = min(next_point, until)
        if block.phase == STUCK:
            first_rate = math.nan
            tau = law.wait(law, block, piece, curves, tau, until, end)
            continue
        if block.phase == ATTENUATES:
            attenuate(block, log, block.zero + tau, until - tau)
            tau = until
            continue
        if math.isnan(first_rate):
            ground = ground_at(block, piece, curves, tau)
            first_rate = first_rate_at(law, block, ground)
        if goes_on and tau == point and until == piece.finish and block.phase == CONTINUOUS:
            slide_on(law, block, points[each * j :], whole, first_rate)
            return
        since = block.zero + tau - block.onset
        longest = max(block.first_step, share * since)
        if law.knows_motion:
            longest = min(longest, law.longest_step(block, first_rate))
        if longest >= whole and tau == point and end == next_point:
            h = whole
            after = end
            last = block.amplitude * points[each * j + each]
            middle = block.amplitude * points[2 * j + 1] if each == 2 else 0.5 * (ground + last)
        else:
            h = min(max(longest, SHORTEST_STEP), end - tau)
            after = end if h >= end - tau else tau + h
            middle, last = ground_in_step(block, piece, curves, ground, tau, h)
        step = advance(law, block, block.velocity, ground, middle, last, h, first_rate)
        ending = GOES_ON
        if may_end(law, block, step):
            part, ending = end_of_phase(law, block, step)
            if ending != GOES_ON and has_not_begun(block, step):
                rest(block)
                tau = after
                continue
            if ending != GOES_ON:
                h *= part
                after = tau + h
                middle, last = ground_in_step(block, piece, curves, ground, tau, h)
                step = advance(law, block, block.velocity, ground, middle, last, h, first_rate)
            if turns(step):
                note_extreme(block, step)
        if log.size > 0:
            note(block, log, block.zero + tau, step)
        take(block, step)
        ground = last
        first_rate = step.last_rate
        tau = after
        if ending != GOES_ON:
            end_phase(block, ending)
            first_rate = math.nan


# ------------------------------------------------------------------ piece after piece


@single
def walk(
    law: Law,
    block: Block,
    path: Path,
    steps: Steps,
    first: int,
    end: int,
    offset: float,
    log: np.ndarray,
) -> None:
    """Go through pieces, from `first` up to `end`, whose times are `offset` later."""
    k = 0  # the positive half wave that a piece lies in, or that comes next
    for p in range(first, end):
        while k < path.intervals.size and path.intervals[k].end <= p:
            k += 1
        starts = k < path.intervals.size and path.intervals[k].first == p
        peak = block.amplitude * path.intervals[k].height if k < path.intervals.size else 0.0
        piece = steps.pieces[p]
        curves = path.base.curves
        block.zero = offset + piece.start - piece.begin
        pulse = enter_piece(law, block, piece, curves, starts, peak)
        points = steps.wave[steps.first[p] : steps.last[p] + 1]
        step_along(law, block, piece, curves, points, pulse, peak, log)
