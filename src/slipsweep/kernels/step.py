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
from typing import NamedTuple

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
from slipsweep.motion.pieces import Piece, Wave

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


class Law(NamedTuple):
    """A friction law: μ(block, Üg, v), with v in m/s, and whether it depends on v."""

    friction: Callable[..., float]
    knows_velocity: bool


#: The cells that are stepped: a `Cell`, the yield acceleration upslope (NaN, if the block slides
#: downslope only), and the seconds in a unit of phase.
STEP_CELL = np.dtype(
    (np.record, [(name, "f8") for name in (*Cell._fields, "upslope_yield_acceleration", "seconds")])
)

#: A block: its parameters, how it is stepped, and its motion up to now.
BLOCK = np.dtype(
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
    ]
)


class History(NamedTuple):
    """Samples of the motion, each (samples,): when, Ü, V and W; the first `done[0]` are filled in."""

    phases: np.ndarray
    block_acceleration: np.ndarray
    velocity: np.ndarray
    displacement: np.ndarray
    done: np.ndarray


#: From its onset to the end of the piece a slide takes N/64 steps at least, later a step is at most
#: 16/N of the time since the onset, so that slides shorter than a step are resolved.  No step is
#: cut shorter than the last number.
GROWTH_SHARE = 64.0
TIME_SHARE = 16.0
SHORTEST_STEP = 1e-14

#: Points of a rise at which Eq. 4 is compared with Üy (`yield_governs`).
POINTS_OF_RISE = 32


@registered
def exponential_friction(block: np.record, ground: float, velocity: float) -> float:
    """Eq. 6, the friction law of the paper, which does not depend on the velocity."""
    return eq.friction_coefficient(ground, block.mu_s, block.delta_mu, block.decay_rate, block.g)


# ------------------------------------------------------------------ one step


@inlined
def eq4_rate(law: Law, block: np.record, ground: float, velocity: float) -> float:
    """Üg − Ü with Ü by Eq. 4."""
    friction = law.friction(block, ground, velocity * block.seconds)
    return eq.relative_acceleration(ground, friction, block.mu_s, block.tan_theta, block.g)


@inlined
def rate(law: Law, block: np.record, ground: float, velocity: float) -> float:
    """Rate of V, Üg − Ü, in the phase of the block; Eq. 12 takes no steps (`attenuate`)."""
    if block.phase == HELD or block.phase == HELD_ON:
        return ground - block.held
    if block.phase == DOWN:
        return ground - block.yield_acceleration
    if block.phase == UP:
        return ground + block.upslope_yield_acceleration
    return eq4_rate(law, block, ground, velocity)


@inlined
def advance(
    law: Law, block: np.record, middle: float, end: float, h: float, first_rate: float
) -> tuple[float, float, float, float]:
    """Take a step h: return the gains of V and W, and the rates in its middle and at its end.

    `middle` and `end` are Üg there, `first_rate` is the rate at the start.
    """
    velocity = block.velocity
    if block.rule == RECTANGLE:  # Euler's
        gained = first_rate * h  # V += (Üg − Ü) h
        moved = (velocity + 0.5 * gained) * h
        last_rate = rate(law, block, end, velocity + gained)
        return gained, moved, 0.5 * (first_rate + last_rate), last_rate
    if block.rule == TRAPEZOID:  # Heun's
        end_rate = rate(law, block, end, velocity + first_rate * h)
        gained = 0.5 * (first_rate + end_rate) * h
        moved = (velocity + (2.0 * first_rate + end_rate) * h / 6.0) * h
        last_rate = rate(law, block, end, velocity + gained)
        return gained, moved, 0.5 * (first_rate + last_rate), last_rate
    # Runge's and Kutta's of order 4, which is Simpson's rule where friction does not depend on V
    early_rate = rate(law, block, middle, velocity + 0.5 * h * first_rate)
    middle_rate = rate(law, block, middle, velocity + 0.5 * h * early_rate)
    end_rate = rate(law, block, end, velocity + h * middle_rate)
    gained = (first_rate + 2.0 * (early_rate + middle_rate) + end_rate) * h / 6.0
    moved = (velocity + (first_rate + early_rate + middle_rate) * h / 6.0) * h
    return gained, moved, middle_rate, rate(law, block, end, velocity + gained)


@inlined
def excess(
    law: Law,
    block: np.record,
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
    if block.phase == CONTINUOUS:
        return -1.0
    if block.phase == UP:
        return velocity
    if rises and block.phase == HELD:
        eq4 = ground[2] - eq4_rate(law, block, ground[2], velocity)
        return max(-velocity, eq4 - block.held)
    if rises and block.phase == FOLLOWS and block.rise == MONOTONE:
        first = ground[0] - rates[0]
        middle = ground[1] - rates[1]
        last = ground[2] - rates[2]
        # how a parabola through the three falls at the end
        return max(-velocity, 4.0 * middle - 3.0 * last - first)
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
def ground_at(block: np.record, piece: Piece, tau: float) -> float:
    """Üg at τ on a piece, with the sign of the piece also where it is 0."""
    total = 0.0
    for k in range(piece.degree - 1, -1, -1):
        total = (total + piece.coefficients[k]) * tau
    return math.copysign(block.amplitude * (piece.top + total), piece.top)


@scalar
def ground_in_step(
    block: np.record, piece: Piece, tau: float, h: float
) -> tuple[float, float, float]:
    """Üg at the start, the middle and the end of a step; in the middle a mean, if that will do."""
    start = ground_at(block, piece, tau)
    end = ground_at(block, piece, tau + h)
    if block.rule == SIMPSON:
        return start, ground_at(block, piece, tau + 0.5 * h), end
    return start, 0.5 * (start + end), end


@scalar
def sample_ground(block: np.record, piece: Piece, half: float, ground: np.ndarray) -> None:
    """Write Üg at the ends and middles of all steps on a piece, `half` a step apart."""
    # counted from the anchor: two pieces that mirror each other have the same values
    first = 0 if piece.begin == 0.0 else 1 - ground.size
    ground[:] = 0.0
    for k in range(piece.degree - 1, -1, -1):
        coefficient = piece.coefficients[k]
        for j in range(ground.size):
            ground[j] = (ground[j] + coefficient) * ((first + j) * half)
    for j in range(ground.size):
        ground[j] = math.copysign(block.amplitude * (piece.top + ground[j]), piece.top)


@inlined
def steps_on(block: np.record, piece: Piece) -> int:
    """Return the number of equal steps on a piece."""
    if block.steps_on_piece > 0:
        return block.steps_on_piece
    length = piece.finish - piece.begin
    return max(math.ceil(length / (2.0 * math.pi) * block.steps - 1e-9), 1)


@scalar
def place_of(block: np.record, piece: Piece, level: float) -> float:
    """Return τ at which |Üg| reaches a level on a piece on which it grows (the end, if it does not)."""
    if block.amplitude * abs(piece.first) >= level:
        return piece.begin
    low = piece.begin
    high = piece.finish
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        if abs(ground_at(block, piece, middle)) >= level:
            high = middle
        else:
            low = middle
    return high


@scalar
def advance_from(
    law: Law, block: np.record, piece: Piece, tau: float, h: float, first_rate: float
) -> tuple[tuple[float, float, float], float, float, float, float]:
    """Take a step from τ: return Üg in it, and what `advance` returns."""
    ground = ground_in_step(block, piece, tau, h)
    gained, moved, middle_rate, last_rate = advance(law, block, ground[1], ground[2], h, first_rate)
    return ground, gained, moved, middle_rate, last_rate


# ------------------------------------------------------------------ from phase to phase


@scalar
def rest(block: np.record) -> None:
    """Come to rest."""
    block.phase = STUCK
    block.velocity = 0.0
    block.least_velocity = min(block.least_velocity, 0.0)
    block.largest_displacement = max(block.largest_displacement, block.displacement)
    block.smallest_displacement = min(block.smallest_displacement, block.displacement)


@scalar
def begin_slide(block: np.record, phase: int, time: float, growth: float) -> None:
    """Begin to slide, from rest or with a velocity kept."""
    block.phase = phase
    block.onset = time
    block.growth = growth
    if block.velocity == 0.0:
        block.slips += 1.0


@scalar
def begin_stick_slip(
    law: Law, block: np.record, rises: bool, ground: float, time: float, growth: float
) -> None:
    """t1: begin to slide with b = max(Üy, Eq. 4), with the literal rise b by Eq. 4."""
    eq4 = ground - eq4_rate(law, block, ground, block.velocity)
    if block.velocity == 0.0:
        eq4 = min(eq4, ground)  # where Eq. 4 falls below Üg they are equal but for rounding
    follows = block.rise == LITERAL or eq4 >= block.yield_acceleration
    block.held = eq4 if follows else block.yield_acceleration
    begin_slide(block, FOLLOWS if follows and rises else HELD, time, growth)


@scalar
def end_positive_half_wave(block: np.record) -> None:
    """t5: from Üg = 0 on Eq. 12 takes V to 0, with Ümax = b; or b is held on (`recoupling`)."""
    block.in_pulse = 0
    if block.phase == HELD or block.phase == FOLLOWS:
        block.phase = ATTENUATES if block.recoupling == EQ12 else HELD_ON
        if block.held <= 0.0:
            block.validity |= flags.KD_NOT_POSITIVE


@scalar
def end_phase(block: np.record, eq4: float) -> None:
    """Go on after a step up to the end of a phase, where `eq4` is Ü if it is by Eq. 4."""
    if block.phase == UP or block.velocity <= 0.0:
        rest(block)
    elif block.phase == HELD:
        block.phase = FOLLOWS
    else:
        block.held = eq4
        block.phase = HELD


@scalar
def wait(
    law: Law, block: np.record, piece: Piece, rises: bool, now: float, tau: float, end: float
) -> float:
    """Return τ at which a block at rest begins to slide, `end` if it does not before.

    Newmark's block slides where Üg is beyond what it resists; the paper's, beyond Üy, where Eq. 4
    is below Üg while that rises.
    """
    ground = ground_at(block, piece, tau)
    ahead = ground_at(block, piece, end)
    if block.rise == NEWMARK:
        if max(ground, ahead) > block.yield_acceleration:
            begin_slide(block, DOWN, now + tau, piece.finish - tau)
            return tau
        if min(ground, ahead) < -block.upslope_yield_acceleration:
            begin_slide(block, UP, now + tau, piece.finish - tau)
            return tau
        return end
    if not rises or max(eq4_rate(law, block, ground, 0.0), eq4_rate(law, block, ahead, 0.0)) <= 0.0:
        return end
    low = tau
    high = tau if eq4_rate(law, block, ground, 0.0) > 0.0 else end
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        if eq4_rate(law, block, ground_at(block, piece, middle), 0.0) > 0.0:
            high = middle
        else:
            low = middle
    ground = ground_at(block, piece, high)
    begin_stick_slip(law, block, rises, ground, now + high, piece.finish - high)
    return high


# ------------------------------------------------------------------ samples of a history


@scalar
def sample_rest(block: np.record, until: float, history: History) -> int:
    """Fill in the samples before a time, up to which the block rests; return the next sample."""
    at = history.done[0]
    while at < history.phases.size and history.phases[at] < until:
        history.displacement[at] = block.displacement
        at += 1
    history.done[0] = at
    return at


@scalar
def sample_step(
    law: Law,
    block: np.record,
    piece: Piece,
    now: float,
    tau: float,
    h: float,
    first_rate: float,
    history: History,
) -> None:
    """Fill in the samples within a step from τ."""
    at = sample_rest(block, now + tau, history)
    while at < history.phases.size and history.phases[at] < now + tau + h:
        part = history.phases[at] - (now + tau)
        ground, gained, moved, _, last_rate = advance_from(law, block, piece, tau, part, first_rate)
        history.block_acceleration[at] = ground[2] - last_rate
        history.velocity[at] = block.velocity + gained
        history.displacement[at] = block.displacement + moved
        at += 1
    history.done[0] = at


@scalar
def attenuate(block: np.record, time: float, duration: float, history: History) -> None:
    """Eq. 12 for some time, or up to the stop: one step V −= b h, which is exact for any h."""
    side = math.copysign(1.0, block.velocity)
    speed = abs(block.velocity)
    until = time + min(speed / block.held, duration)
    at = sample_rest(block, time, history)
    while at < history.phases.size and history.phases[at] < until:
        h = history.phases[at] - time
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
    block: np.record,
    piece: Piece,
    rises: bool,
    tau: float,
    h: float,
    first_rate: float,
) -> float:
    """Return `excess` after a step from τ."""
    ground, gained, _, middle_rate, last_rate = advance_from(law, block, piece, tau, h, first_rate)
    rates = (first_rate, middle_rate, last_rate)
    return excess(law, block, rises, ground, rates, block.velocity + gained)


@scalar
def step_to_end_of_phase(
    law: Law,
    block: np.record,
    piece: Piece,
    rises: bool,
    tau: float,
    h: float,
    first_rate: float,
) -> float:
    """Return the step, at most h, after which the phase ends.

    By false position; the value at the end that stays is halved (the Illinois rule).
    """
    low = 0.0
    high = h
    below = min(excess_after(law, block, piece, rises, tau, low, first_rate), -1e-300)
    above = excess_after(law, block, piece, rises, tau, high, first_rate)
    while high - low > 4e-16 * h:
        new = high - above * ((high - low) / (above - below))
        if not low < new < high:
            new = 0.5 * (low + high)
            if not low < new < high:
                break
        value = excess_after(law, block, piece, rises, tau, new, first_rate)
        if value > 0.0:
            high = new
            above = value
            below *= 0.5
        else:
            low = new
            below = value
            above *= 0.5
    return high


@scalar
def step_along(
    law: Law,
    block: np.record,
    piece: Piece,
    rises: bool,
    now: float,
    tau: float,
    finish: float,
    workspace: np.ndarray,
    history: History,
) -> None:
    """Go from τ to `finish` on a piece, step by step; `now` is the time of τ = 0."""
    count = steps_on(block, piece)
    whole = (piece.finish - piece.begin) / count
    samples = workspace[: 2 * count + 1]
    sample_ground(block, piece, 0.5 * whole, samples)
    first_rate = math.nan  # where it is not known from the step before
    for j in range(min(max(int((tau - piece.begin) / whole), 0), count - 1), count):
        begin = piece.begin + j * whole
        end = finish if j + 1 == count else min(piece.begin + (j + 1) * whole, finish)
        while tau < end:
            if block.phase == STUCK:
                tau = wait(law, block, piece, rises, now, tau, end)
                first_rate = math.nan
                continue
            since = now + tau - block.onset
            longest = max(GROWTH_SHARE * block.growth, TIME_SHARE * since) / block.steps
            h = min(max(longest, SHORTEST_STEP), end - tau)
            middle = samples[2 * j + 1]
            if block.rule != SIMPSON:
                middle = 0.5 * (samples[2 * j] + samples[2 * j + 2])
            ground = (samples[2 * j], middle, samples[2 * j + 2])
            if tau > begin or h < 0.999999999 * whole:
                ground = ground_in_step(block, piece, tau, h)
            if math.isnan(first_rate):
                first_rate = rate(law, block, ground[0], block.velocity)

            gained, moved, middle_rate, last_rate = advance(
                law, block, ground[1], ground[2], h, first_rate
            )
            rates = (first_rate, middle_rate, last_rate)
            ends = excess(law, block, rises, ground, rates, block.velocity + gained) > 0.0
            turning = block.velocity
            if first_rate < 0.0 < last_rate or last_rate < 0.0 < first_rate:
                # V is largest or least in the step, and may have been 0
                until, turning = turning_point(
                    block.velocity, h, first_rate, middle_rate, last_rate
                )
                stops = turning > 0.0 if block.phase == UP else turning < 0.0
                if stops and not ends and block.phase != CONTINUOUS:
                    ends = True
                    h = until
            if ends:
                grows = first_rate < 0.0 if block.phase == UP else first_rate > 0.0
                if block.velocity == 0.0 and not grows:
                    rest(block)  # rounding has made it slide
                    tau += h
                    continue
                h = step_to_end_of_phase(law, block, piece, rises, tau, h, first_rate)
                ground, gained, moved, _, last_rate = advance_from(
                    law, block, piece, tau, h, first_rate
                )
                turning = block.velocity
            if history.phases.size > 0:
                sample_step(law, block, piece, now, tau, h, first_rate, history)
            block.velocity += gained
            block.displacement += moved
            block.largest_velocity = max(block.largest_velocity, block.velocity, turning)
            block.least_velocity = min(block.least_velocity, block.velocity, turning)
            first_rate = last_rate
            if block.phase == FOLLOWS:
                block.held = ground[2] - last_rate
            if ends:
                end_phase(block, ground[2] - last_rate)
                first_rate = math.nan
            tau = end if h >= end - tau else tau + h


# ------------------------------------------------------------------ pulses


@scalar
def set_friction(
    block: np.record, cell: np.record, options: Options, peak: float
) -> flags.Interface:
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
def yield_governs(law: Law, block: np.record, low: float, high: float) -> bool:
    """Return whether Eq. 4 stays at or below Üy while Üg rises from low to high."""
    for j in range(POINTS_OF_RISE, -1, -1):
        ground = low + (high - low) * (j / POINTS_OF_RISE)
        if ground - eq4_rate(law, block, ground, 0.0) > block.yield_acceleration:
            return False
    return True


@scalar
def yield_governs_wave(law: Law, block: np.record, wave: Wave) -> bool:
    """Return whether Eq. 4 stays at or below Üy on all rises, and wherever Üg jumps to."""
    if block.mode != eq.STICK_SLIP or block.rise != MONOTONE:
        return False
    for p in range(wave.pieces.shape[0]):
        piece = wave.pieces[p]
        if piece.top > 0.0 and (piece.last >= piece.first or piece.jumps):
            low = block.amplitude * piece.first
            high = max(low, block.amplitude * piece.last) if piece.last >= piece.first else low
            low = max(low, block.yield_acceleration)
            if high >= low and not yield_governs(law, block, low, high):
                return False
    return True


@scalar
def set_friction_of_pulse(
    law: Law, block: np.record, cell: np.record, options: Options, peak: float
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
        block.held = peak - eq4_rate(law, block, peak, 0.0)  # for Eq. 12 after it
        block.stick_slip_pulses -= 1.0
        block.continuous_pulses += 1.0
    elif block.rise == MONOTONE and yield_governs(law, block, block.yield_acceleration, peak):
        block.validity |= flags.YIELD_GOVERNS
        estimated = False
    block.validity |= flags.FRICTION_ESTIMATED if estimated else 0


@scalar
def begin_pulse(
    law: Law, block: np.record, rises: bool, ground: float, time: float, growth: float
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
    if block.velocity > 0.0:
        block.validity |= flags.NOT_RECOUPLED
        begin_stick_slip(law, block, rises, ground, time, growth)
    elif not rises and eq4_rate(law, block, ground, 0.0) > 0.0:  # Üg has jumped here, and falls
        begin_stick_slip(law, block, rises, ground, time, growth)


@scalar
def enter_rise_or_fall(law: Law, block: np.record, piece: Piece, rises: bool) -> None:
    """Go on at the beginning of a piece: on a rise b is max(b, Eq. 4), on a fall it is held."""
    if not rises and block.phase == FOLLOWS:
        block.phase = HELD
    elif rises and block.phase == HELD:
        ground = block.amplitude * piece.first
        eq4 = ground - eq4_rate(law, block, ground, block.velocity)
        if block.rise == LITERAL or eq4 > block.held:
            block.held = eq4
            block.phase = FOLLOWS


@scalar
def walk(
    law: Law,
    block: np.record,
    cell: np.record,
    options: Options,
    wave: Wave,
    cycle: int,
    offset: float,
    workspace: np.ndarray,
    history: History,
) -> None:
    """Go through the pieces of a cycle of the wave, whose times are `offset` later."""
    is_record = block.steps_on_piece > 0
    k = 0  # the positive half wave that a piece lies in, or that comes next
    for p in range(wave.cycle[cycle], wave.cycle[cycle + 1]):
        while k < wave.height.size and wave.interval[k, 1] <= p:
            k += 1
        peak = block.amplitude * wave.height[k] if k < wave.height.size else 0.0
        is_pulse = peak > block.yield_acceleration
        piece = wave.pieces[p]
        rises = piece.top > 0.0 and piece.first <= piece.last
        starts = k < wave.height.size and wave.interval[k, 0] == p
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
            reaches = place_of(block, piece, block.yield_acceleration) if rises else piece.begin
        now = offset + piece.start - piece.begin
        tau = piece.begin
        for until in (min(reaches, piece.finish), piece.finish):
            moves = True
            if block.phase == STUCK:
                limit = block.yield_acceleration
                if piece.top < 0.0:
                    limit = block.upslope_yield_acceleration
                moves = block.amplitude * abs(piece.top) > limit
                moves = moves and (block.rise == NEWMARK or (rises and block.in_pulse == 1))
                if moves and abs(piece.last) > abs(piece.first):
                    tau = max(tau, place_of(block, piece, limit))
            if block.validity & NO_VALUE == 0 and moves and tau < until:
                if block.phase == ATTENUATES:
                    attenuate(block, now + tau, until - tau, history)
                else:
                    step_along(law, block, piece, rises, now, tau, until, workspace, history)
            if until == reaches and not block.in_pulse:
                if is_record:
                    set_friction_of_pulse(law, block, cell, options, peak)
                ground = max(block.amplitude * piece.first, block.yield_acceleration)
                begin_pulse(law, block, rises, ground, now + until, piece.finish - until)
            tau = until


@scalar
def run_out(block: np.record, time: float, history: History) -> None:
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
def repetitions(block: np.record, cycle: Cycle, left: int) -> int:
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
def repeat(block: np.record, cycle: Cycle, count: int) -> None:
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
    block: np.record,
    cell: np.record,
    options: Options,
    wave: Wave,
    workspace: np.ndarray,
    history: History,
) -> None:
    """Go through all cycles; those that gain what the last one did are not walked again."""
    walked = Cycle(-1, -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)
    n = 0
    for c in range(wave.shape.size):
        left = wave.repeats if wave.repeats > 0 and c == wave.lead else 1
        while left > 0 and block.validity & NO_VALUE == 0:
            if walked.shape == wave.shape[c] and history.phases.size == 0:
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
            walk(law, block, cell, options, wave, c, offset, workspace, history)
            walked = Cycle(
                wave.shape[c],
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
def validity_before(block: np.record, cell: np.record, options: Options, wave: Wave) -> int:
    """Set friction and mode for the peak of the shaking; return the flags known before the motion."""
    if block.steps_on_piece == 0:
        interface = set_friction(block, cell, options, block.amplitude)
        if block.amplitude * wave.highest > block.yield_acceleration:
            return interface.validity
        # ramps keep the shaking below Üy
        return interface.validity & ~(flags.NEAR_MODE_LIMIT | flags.FRICTION_ESTIMATED)
    peak = block.amplitude * max(wave.highest, -wave.lowest)
    interface = set_friction(block, cell, options, peak)
    lowest = eq.normal_acceleration(block.amplitude * wave.lowest, block.tan_theta, block.g)
    uplift = flags.UPLIFT if lowest <= 0.0 and options.rise != NEWMARK else 0
    return uplift | interface.validity & (flags.STATICALLY_UNSTABLE | flags.LIMIT_UNDEFINED)


@single
def solve_cell(
    law: Law,
    block: np.record,
    cell: np.record,
    options: Options,
    wave: Wave,
    workspace: np.ndarray,
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
    block.validity = validity_before(block, cell, options, wave)
    is_record = block.steps_on_piece > 0
    mode = block.mode
    peak = block.amplitude * (max(wave.highest, -wave.lowest) if is_record else 1.0)
    if block.validity & NO_VALUE == 0 and block.amplitude * wave.highest > block.yield_acceleration:
        if not is_record and yield_governs_wave(law, block, wave):
            block.validity = flags.without_estimates(block.validity | flags.YIELD_GOVERNS)
        walk_all(law, block, cell, options, wave, workspace, history)
        end = wave.pieces[wave.pieces.shape[0] - 1].end
        run_out(block, end + 2.0 * math.pi * max(wave.repeats - 1, 0), history)
    sample_rest(block, math.inf, history)
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
    wave: Wave,
    blocks: np.ndarray,
    workspace: np.ndarray,
    history: History,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with a friction law, as `solve_steps` does with that of the paper."""
    for j in range(cells.size):
        motion = solve_cell(law, blocks[0], cells[j], options, wave, workspace, history)
        flags.store(motion, j, results)


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
        ground_acceleration.copy(),
        np.zeros(phases.size),
        np.zeros(phases.size),
        np.zeros(1, np.int64),
    )


@kernel
def solve_steps(
    cells: np.ndarray,
    options: Options,
    wave: Wave,
    blocks: np.ndarray,
    workspace: np.ndarray,
    history: History,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with the friction law of the paper.

    `cells` are of dtype `STEP_CELL`; `blocks`, (1,), says how they are stepped, `workspace` has room
    for Üg on a piece; `results` is (fields of `Motion`, cells).
    """
    law = Law(exponential_friction, False)
    solve_cells(law, cells, options, wave, blocks, workspace, history, results)
