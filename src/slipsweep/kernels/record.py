"""The response to a recorded motion: the pulses of the cycle solver, each with the friction of its own peak.

A record is a wave of straight pieces like any other (`motion.records.wave_of`), on which both b held and
Eq. 4 integrate in closed form (`linear`).  The motion rules are those of a harmonic motion
(docs/model.md), extended (docs/records.md): Eq. 7 with a pulse's own peak decides whether the block sticks
and slips in it (`cycle.pulse`) or slides continuously (`continuous_pulse`), and Eqs. 8-11 with that peak give
its friction.  Time stands in place of the phase, so that V and W are v and u of a record at time scale 1.
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    EQ12,
    FRICTION_ESTIMATED,
    FRICTION_NOT_DECAYING,
    KD_NOT_POSITIVE,
    LIMIT_UNDEFINED,
    LITERAL,
    MONOTONE,
    NEWMARK,
    NO_VALUE,
    NOT_RECOUPLED,
    STATICALLY_UNSTABLE,
    UNSOLVED,
    UPLIFT,
    YIELD_GOVERNS,
    Block,
    Cell,
    Options,
    block_of,
    cell_of,
    inflection,
    remarks_on,
    response,
    settled,
    stays_below_yield,
)
from slipsweep.kernels.cycle.common import Peak, common_pulse, enters
from slipsweep.kernels.cycle.followed import follow_straight
from slipsweep.kernels.cycle.legs import PULSE_ROWS, PULSES, Room
from slipsweep.kernels.cycle.pulse import pulse
from slipsweep.kernels.excitation import phase_at
from slipsweep.kernels.newmark import Record, add
from slipsweep.kernels.pulse import (
    DISPLACEMENT,
    HELD,
    SLIPS,
    VELOCITY,
    Pulse,
    attenuate,
    beginning,
    first_pulse,
)
from slipsweep.model import equations as eq
from slipsweep.motion.pieces import BEGIN, END, LAST, TOP, Wave

#: Rows of pulses laid out side by side: the stretch; Üg at its peak; where Üg comes to Üy, which piece, what is left of
#: it, and when; the fields of the block that follow from the peak; D at Üy and at the peak.
(
    _STRETCH, _PEAK, _PIECE, _WIDTH, _BEGINS, _LIMIT, _RATIO, _MINIMUM, _DELTA, _DECAY, _VALIDITY, _AT_YIELD, _AT_PEAK,
) = range(0, PULSE_ROWS * PULSES, PULSES)  # fmt: skip


@in_lanes
def block_in_pulse(cell: Cell, options: Options, peak: float) -> Block:
    """The block in a pulse of that peak, for Eqs. 7-11 and λ; its `amplitude` is the scale of the record."""
    own = block_of(
        Cell(
            cell.tan_theta, cell.mu_s, peak, cell.yield_acceleration, cell.decay_rate, cell.delta_mu,
            cell.minimum_friction,
        ),
        options.rise,
        options.g,
    )  # fmt: skip
    return Block(
        cell.amplitude, own.yield_acceleration, own.limiting_acceleration, own.acceleration_ratio, own.mu_s,
        own.tan_theta, own.minimum_friction, own.delta_mu, own.decay_rate, own.g, own.rise, own.sliding_mode,
        own.validity,
    )  # fmt: skip


@scalar
def half_wave_after(wave: Wave, k: int) -> int:
    """The first piece after the negative half wave that follows stretch k at once."""
    q = wave.stretch[k, 1]
    while q < wave.pieces.shape[0] and wave.pieces[q, TOP] < 0.0:
        q += 1
        if wave.pieces[q - 1, LAST] == 0.0:
            break
    return q


@scalar
def slides_on(block: Block, peak: float) -> bool:
    """Whether the block slides continuously in a pulse of that peak.

    Not its own mode, which is missing where the harmonic motion of that peak would uplift.
    """
    return block.rise != NEWMARK and peak > block.limiting_acceleration


@scalar
def end_of_following(block: Block, wave: Wave, k: int, following: int) -> tuple[int, float, float, float]:
    """Where Eq. 4 ends of a continuous pulse in stretch k: a piece, τ on it, its phase; and that of the next pulse."""
    pieces, last = wave.pieces.shape[0], following >= wave.height.size
    until = half_wave_after(wave, k)
    tau_until, ends = 0.0, wave.pieces[pieces - 1, END]
    if until < pieces:
        tau_until = wave.pieces[until, BEGIN]
        ends = phase_at(wave.pieces, until, tau_until)
    begins = math.inf
    if not last:
        next_p, next_tau = beginning(block, wave, following)
        begins = phase_at(wave.pieces, next_p, next_tau)
        if following == k + 1 and wave.stretch[following, 0] == until:
            until, tau_until, ends = next_p, next_tau, begins
    return until, tau_until, ends, begins


@scalar
def continuous_pulse(
    block: Block, options: Options, wave: Wave, k: int, following: int, peak: float, velocity: float, room: Room
) -> Pulse:
    """A continuous pulse, of that `peak`, from Üg = Üy in stretch k to the pulse of the `following` one.

    Eq. 4 holds through the negative half wave and, if the pulse follows at once, up to it; else Eq. 12
    takes V, of either sign, to zero from there on.
    """
    p, tau = beginning(block, wave, k)
    until, tau_until, ends, begins = end_of_following(block, wave, k, following)
    gained, moved, most = follow_straight(block, wave, p, tau, until, tau_until, options.wants_peak, room)
    state = room.state
    state[VELOCITY] = velocity + gained
    state[DISPLACEMENT] = velocity * (ends - phase_at(wave.pieces, p, tau)) + moved
    state[HELD] = response(block, peak)
    if begins > ends:
        attenuate(state, begins - ends)
    return Pulse(state[VELOCITY], state[DISPLACEMENT], velocity + most, 0.0, 0.0, 0)


@in_lanes
def one_pulse(
    block: Block, options: Options, wave: Wave, k: int, following: int, peak: float, velocity: float, room: Room
) -> Pulse:
    """A pulse, in the mode of its `peak`, from Üg = Üy in stretch k to the pulse of the `following` one."""
    if slides_on(block, peak):
        return continuous_pulse(block, options, wave, k, following, peak, velocity, room)
    # v never goes below 0: a velocity upslope, left by a continuous pulse, is neglected
    return pulse(block, options, wave, room, k, following, max(velocity, 0.0))


@in_lanes
def rate_at(block: Block, x: float) -> float:
    """D(x), in a loop over blocks."""
    mu = eq.friction_coefficient(x, block.mu_s, block.delta_mu, block.decay_rate, block.g)
    return eq.relative_acceleration(x, mu, block.mu_s, block.tan_theta, block.g)


@scalar
def lay_out(cell: Cell, options: Options, wave: Wave, record: Record, block: Block, k: int, pulses: np.ndarray) -> int:
    """Lay out pulses from stretch k on side by side; their number, but for the one after them.

    If none is after them, a stretch past the last that never begins stands for it.
    """
    count, scale = 0, cell.amplitude * record.unit
    while count < PULSES and k < wave.height.size:
        p, width = enters(record.lines, wave.stretch[k, 0], wave.stretch[k, 1], scale, block.yield_acceleration)
        pulses[_STRETCH + count], pulses[_PEAK + count] = k, cell.amplitude * wave.height[k]
        pulses[_PIECE + count], pulses[_WIDTH + count], pulses[_BEGINS + count] = p, width, wave.pieces[p, END] - width
        k = first_pulse(block, wave, k + 1)
        count += 1
    for j in range(count, PULSES):
        pulses[_STRETCH + j], pulses[_PEAK + j], pulses[_BEGINS + j] = k, pulses[_PEAK], math.inf
    for j in range(PULSES):
        peak = pulses[_PEAK + j]
        own = block_in_pulse(cell, options, peak)
        pulses[_LIMIT + j], pulses[_RATIO + j] = own.limiting_acceleration, own.acceleration_ratio
        pulses[_MINIMUM + j], pulses[_DELTA + j] = own.minimum_friction, own.delta_mu
        pulses[_DECAY + j], pulses[_VALIDITY + j] = own.decay_rate, own.validity
        pulses[_AT_YIELD + j] = rate_at(own, own.yield_acceleration)
        pulses[_AT_PEAK + j] = rate_at(own, peak)
    return min(count, PULSES - 1)


@scalar
def laid_out(block: Block, pulses: np.ndarray, i: int) -> tuple[Block, Peak]:
    """The block in pulse i of those that are laid out, and its peak."""
    own = Block(
        block.amplitude, block.yield_acceleration, pulses[_LIMIT + i], pulses[_RATIO + i], block.mu_s, block.tan_theta,
        pulses[_MINIMUM + i], pulses[_DELTA + i], pulses[_DECAY + i], block.g, block.rise, block.sliding_mode,
        int(pulses[_VALIDITY + i]),
    )  # fmt: skip
    return own, Peak(pulses[_PEAK + i], pulses[_AT_YIELD + i], pulses[_AT_PEAK + i])


@scalar
def remarks_in(cell: Cell, block: Block, peak: Peak) -> int:
    """The flags of a pulse."""
    remarks, continues = remarks_on(cell, block.acceleration_ratio), slides_on(block, peak.ground)
    least, most = block.yield_acceleration, peak.ground - peak.rate_at_peak
    governs = not continues and max(least - peak.rate_at_yield, most) <= least
    if governs and (inflection(block) <= least or stays_below_yield(block, least, peak.ground)):
        remarks = YIELD_GOVERNS | (remarks & ~FRICTION_ESTIMATED)
    if not continues and block.rise == LITERAL and most <= 0.0:
        remarks |= KD_NOT_POSITIVE
    return remarks | (block.validity & FRICTION_NOT_DECAYING)


@scalar
def recorded_pulse(
    block: Block, peak: Peak, options: Options, wave: Wave, record: Record, i: int, following: int, velocity: float,
    room: Room,
) -> Pulse:  # fmt: skip
    """`one_pulse` of pulse i of those laid out; a common one by its own loop."""
    state, pulses, k = room.state, room.pulses, int(room.pulses[_STRETCH + i])
    if block.rise == MONOTONE and options.recoupling == EQ12 and not slides_on(block, peak.ground):
        p, width, scale = int(pulses[_PIECE + i]), pulses[_WIDTH + i], block.amplitude * record.unit
        end = wave.stretch[k, 1]
        slide = common_pulse(block, peak, record.lines, scale, p, width, end, max(velocity, 0.0))
        if not math.isnan(slide.displacement):
            state[SLIPS] += slide.slips
            state[VELOCITY], state[DISPLACEMENT], state[HELD] = slide.velocity, slide.displacement, slide.held
            if slide.slides:
                attenuate(state, pulses[_BEGINS + i + 1] - wave.pieces[end - 1, END])
            return Pulse(state[VELOCITY], state[DISPLACEMENT], slide.peak, 0.0, 0.0, 0)
    return one_pulse(block, options, wave, k, following, peak.ground, velocity, room)


@scalar
def respond(
    cell: Cell, options: Options, wave: Wave, record: Record, room: Room, codes: np.ndarray, j: int
) -> tuple[float, float]:
    """W and the largest V of a block of the paper's model, pulse by pulse; `cell.amplitude` is the scale.

    Into column j of `codes`: slips from rest, stick-slip and continuous pulses (−1 where there is no value), validity.
    """
    scale = cell.amplitude
    block = block_in_pulse(cell, options, scale * max(wave.highest, -wave.lowest))
    validity = block.validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED)
    # n = g + Üg tan θ is least where the plane's acceleration is lowest
    if eq.normal_acceleration(scale * wave.lowest, cell.tan_theta, options.g) <= 0.0:
        validity |= UPLIFT
    room.state[SLIPS] = 0.0
    velocity, displacement, lost, highest = 0.0, 0.0, 0.0, 0.0
    stick_slips, continuous, count, i = 0, 0, 0, 0
    k = first_pulse(block, wave, 0)
    while k < wave.height.size and validity & NO_VALUE == 0:
        if i == count:
            count, i = lay_out(cell, options, wave, record, block, k, room.pulses), 0
        block, peak = laid_out(block, room.pulses, i)
        validity |= remarks_in(cell, block, peak)
        if validity & NO_VALUE:
            break
        following = int(room.pulses[_STRETCH + i + 1])
        now = recorded_pulse(block, peak, options, wave, record, i, following, velocity, room)
        if slides_on(block, peak.ground):
            continuous += 1
            if velocity == 0.0:
                room.state[SLIPS] += 1.0
        else:
            stick_slips += 1
            # of a record there is a value if b > 0 at the end of the last rise
            validity |= now.validity if math.isnan(now.displacement) else 0
            if now.velocity > 0.0 and following < wave.height.size:
                validity |= NOT_RECOUPLED
        velocity, highest = now.velocity, max(now.peak, highest)
        displacement, lost = add(displacement, lost, now.displacement)
        if math.isnan(displacement + highest) and validity & NO_VALUE == 0:
            validity |= UNSOLVED
        k, i = following, i + 1
    displacement += lost
    codes[3, j] = settled(validity, displacement)
    if validity & NO_VALUE:
        codes[0, j] = codes[1, j] = codes[2, j] = -1
        return math.nan, math.nan
    codes[0, j], codes[1, j], codes[2, j] = int(room.state[SLIPS]), stick_slips, continuous
    return displacement, highest


@scalar
def solve_cells(
    cells: np.ndarray, count: int, options: Options, wave: Wave, record: Record, room: Room, motion: np.ndarray,
    codes: np.ndarray,
) -> None:  # fmt: skip
    """Solve `count` cells of a tile (rows as in `Cell`) into W, V and the codes of `respond`."""
    for j in range(count):
        motion[0, j], motion[1, j] = respond(cell_of(cells, j), options, wave, record, room, codes, j)
