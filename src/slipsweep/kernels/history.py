"""Time histories, sampled from the legs of the cycle solver.

The legs, and with them every sample, come from the same functions that a sweep calls: a
history ends at the displacement that the sweep gives.
"""

import math

import numpy as np

from slipsweep.jit.cache import Kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import Block, Options, block_at, cell_of, response
from slipsweep.kernels.cycle.eq4 import eq4_integrals
from slipsweep.kernels.cycle.legs import ATTENUATE, FOLLOW, MOST_LEGS, STATE_SIZE, Room, room_of
from slipsweep.kernels.cycle.pulse import pulse
from slipsweep.kernels.excitation import held_integrals, phase_at, plane
from slipsweep.kernels.pulse import beginning, first_pulse
from slipsweep.kernels.record import block_in_pulse, end_of_following, one_pulse, slides_on
from slipsweep.model import equations as eq
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP
from slipsweep.motion.pieces import BEGIN, END, FINISH, START, Wave

#: Columns of a history.
GROUND, BLOCK, FRICTION, VELOCITY, DISPLACEMENT = range(5)


@scalar
def table_cycle(wave: Wave, n: int) -> int:
    """The cycle of the table that is cycle n of the shaking."""
    if n < wave.lead:
        return n
    return wave.lead if n < wave.lead + wave.repeats else n - max(wave.repeats - 1, 0)


@scalar
def ground_history(block: Block, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill the base's acceleration; at a jump, the value after it."""
    for at in range(phases.size):
        history[at, GROUND] = 0.0
        if phases[at] < 2.0 * math.pi * options.cycles:
            n = min(int(phases[at] / (2.0 * math.pi)), options.cycles - 1)
            c = table_cycle(wave, n)
            phi = phases[at] - 2.0 * math.pi * (n - c)
            p = wave.cycle[c]
            while p + 1 < wave.cycle[c + 1] and wave.pieces[p, END] <= phi:
                p += 1
            tau = min(
                max(wave.pieces[p, BEGIN] + (phi - wave.pieces[p, START]), wave.pieces[p, BEGIN]),
                wave.pieces[p, FINISH],
            )
            history[at, GROUND] = plane(wave.pieces, p, block.amplitude, tau)


@scalar
def sample_leg(
    block: Block, wave: Wave, room: Room, row: int, phi: float, sample: np.ndarray, displacement: float
) -> None:
    """Fill Ü, V and W, `displacement` at the beginning of the pulse, at phase φ of the table on a leg."""
    legs = room.legs
    kind, p, tau = int(legs[row, 0]), int(legs[row, 1]), legs[row, 2]
    since, b, velocity, moved = max(phi - legs[row, 3], 0.0), legs[row, 5], legs[row, 6], legs[row, 7]
    if kind == ATTENUATE:
        sample[BLOCK] += b
        gained, gained_displacement = -b * since, -0.5 * b * since * since
    elif kind == FOLLOW:
        sample[BLOCK] = response(block, sample[GROUND])
        gained, gained_displacement = eq4_integrals(block, wave.pieces, p, tau, tau + since, room.state)
    else:
        sample[BLOCK] = b
        gained, gained_displacement = held_integrals(wave.pieces, p, block.amplitude, b, tau, tau + since)
    sample[VELOCITY] = max(velocity + gained, 0.0)
    sample[DISPLACEMENT] = displacement + moved + velocity * since + gained_displacement


@scalar
def history_room(wave: Wave) -> Room:
    """Room with a log of as many legs as a pulse may have."""
    longest = 0
    for k in range(wave.height.size):
        longest = max(longest, wave.interval[k, 1] - wave.interval[k, 0])
    return room_of(longest * MOST_LEGS + wave.pieces.shape[0] + 2, 0, 0)


@scalar
def begins_at(block: Block, wave: Wave, k: int) -> float:
    """The table's phase at which the pulse of interval k begins; infinite past the last."""
    if k >= wave.height.size:
        return math.inf
    p, tau = beginning(block, wave, k)
    return phase_at(wave.pieces, p, tau)


@scalar
def sample_pulse(
    block: Block, wave: Wave, room: Room, start: float, until: float, offset: float, displacement: float,
    gained: float, phases: np.ndarray, at: int, history: np.ndarray,
) -> int:  # fmt: skip
    """Fill Ü, V and W up to phase `until`, from the legs of a pulse that begins at `start`; the first sample beyond.

    W is `displacement` before the pulse and `gained` more after it; phases of the table are less by `offset`.
    """
    row, legs = 1, room.legs
    while at < phases.size and phases[at] < until:
        phi = phases[at] - offset
        while row <= legs[0, 0] and phi >= legs[row, 4]:
            row += 1
        moved = 0.0
        if phases[at] >= start:
            moved = gained if row > legs[0, 0] else legs[row, 7]
        history[at, DISPLACEMENT] = displacement + moved
        # a leg that is entered with V follows the one before: what lies between them is rounding
        if row <= legs[0, 0] and (phi >= legs[row, 3] or legs[row, 6] > 0.0):
            sample_leg(block, wave, room, row, phi, history[at], displacement)
        at += 1
    return at


@scalar
def stick_slip_history(block: Block, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill Ü, V and W of a stick-slip (or Newmark) block at increasing phases φ."""
    room = history_room(wave)
    at, velocity, displacement = 0, 0.0, 0.0
    k, repeat = first_pulse(block, wave, 0), 0
    intervals = wave.height.size
    while at < phases.size and k < intervals:
        # the plain cycle of the table comes again and again
        again = first_pulse(block, wave, k + 1)
        offset = 2.0 * math.pi * repeat
        room.legs[0, 0] = 0.0
        start, until = begins_at(block, wave, k) + offset, begins_at(block, wave, again) + offset
        now = pulse(block, options, wave, room, k, again, velocity)
        at = sample_pulse(block, wave, room, start, until, offset, displacement, now.displacement, phases, at, history)
        velocity = now.velocity
        displacement += now.displacement
        if again < intervals and repeat < wave.repeats - 1 and wave.interval[again, 0] >= wave.cycle[wave.lead + 1]:
            repeat += 1
            again = first_pulse(block, wave, 0)
            while wave.interval[again, 0] < wave.cycle[wave.lead]:
                again = first_pulse(block, wave, again + 1)
        k = again


@scalar
def sample_following(
    block: Block, wave: Wave, p: int, tau: float, until: int, tau_until: float, offset: float, moving: np.ndarray,
    state: np.ndarray, phases: np.ndarray, at: int, history: np.ndarray,
) -> int:  # fmt: skip
    """Fill Ü, V and W under Eq. 4 from τ on piece p to `tau_until` on piece `until`; the first sample beyond.

    `moving` has V and W before, and then after; phases of the table are less by `offset`.
    """
    for q in range(p, min(until + 1, wave.pieces.shape[0])):
        start = tau if q == p else wave.pieces[q, BEGIN]
        end, end_phase = wave.pieces[q, FINISH], wave.pieces[q, END]
        if q == until:
            end, end_phase = tau_until, phase_at(wave.pieces, q, tau_until)
        if end <= start:
            continue
        start_phase = phase_at(wave.pieces, q, start) + offset
        while at < phases.size and phases[at] < end_phase + offset:
            since = max(phases[at] - start_phase, 0.0)
            gained, moved = eq4_integrals(block, wave.pieces, q, start, min(start + since, end), state)
            history[at, BLOCK] = response(block, history[at, GROUND])
            history[at, VELOCITY] = moving[0] + gained
            history[at, DISPLACEMENT] = moving[1] + moving[0] * since + moved
            at += 1
        gained, moved = eq4_integrals(block, wave.pieces, q, start, end, state)
        moving[1] += moving[0] * (end - start) + moved
        moving[0] += gained
    return at


@scalar
def continuous_history(block: Block, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill Ü, V and W of a continuously sliding block at increasing phases φ, piece by piece."""
    k = first_pulse(block, wave, 0)
    if k == wave.height.size:
        return
    first, began = beginning(block, wave, k)
    at, moving, state = 0, np.zeros(2), np.zeros(STATE_SIZE)
    while at < phases.size and phases[at] < phase_at(wave.pieces, first, began):
        at += 1
    for n in range(options.cycles):
        c = table_cycle(wave, n)
        p, until = max(wave.cycle[c], first), wave.cycle[c + 1]
        if p < until:
            tau = began if p == first and n == c else wave.pieces[p, BEGIN]
            tau_until = wave.pieces[until, BEGIN] if until < wave.pieces.shape[0] else 0.0
            offset = 2.0 * math.pi * (n - c)
            at = sample_following(block, wave, p, tau, until, tau_until, offset, moving, state, phases, at, history)
        if c == wave.lead:
            first = 0 if wave.cycle[c] == 0 else min(first, wave.cycle[c])
    for after in range(at, phases.size):
        history[after, VELOCITY], history[after, DISPLACEMENT] = moving[0], moving[1]


@scalar
def sample_continuous_pulse(
    block: Block, wave: Wave, k: int, following: int, peak: float, moving: np.ndarray, state: np.ndarray,
    times: np.ndarray, at: int, history: np.ndarray,
) -> int:  # fmt: skip
    """Fill Ü, v and u of a continuous pulse of a record (`record.continuous_pulse`); the first sample beyond.

    `moving` has v and u before it.
    """
    p, tau = beginning(block, wave, k)
    until, tau_until, ends, begins = end_of_following(block, wave, k, following)
    while at < times.size and times[at] < phase_at(wave.pieces, p, tau):
        at += 1
    at = sample_following(block, wave, p, tau, until, tau_until, 0.0, moving, state, times, at, history)
    held, speed, side = response(block, peak), abs(moving[0]), math.copysign(1.0, moving[0])
    while at < times.size and times[at] < begins:
        since = max(times[at] - ends, 0.0)
        left = eq.attenuated_velocity(speed, held, since)
        history[at, BLOCK] += side * held if left > 0.0 else 0.0
        history[at, VELOCITY] = side * left
        history[at, DISPLACEMENT] = moving[1] + side * eq.attenuated_displacement(speed, held, since)
        at += 1
    return at


@scalar
def recorded_ground(wave: Wave, scale: float, times: np.ndarray, history: np.ndarray) -> None:
    """Fill the base's acceleration under a record; at a jump, the value after it."""
    p, pieces = 0, wave.pieces.shape[0]
    for at in range(times.size):
        while p < pieces and wave.pieces[p, END] <= times[at]:
            p += 1
        if p < pieces and times[at] >= wave.pieces[p, START]:
            tau = wave.pieces[p, BEGIN] + (times[at] - wave.pieces[p, START])
            history[at, GROUND] = plane(wave.pieces, p, scale, min(tau, wave.pieces[p, FINISH]))


def _record_history(cells: np.ndarray, options: Options, wave: Wave, times: np.ndarray, history: np.ndarray) -> None:
    cell = cell_of(cells, 0)
    history[:] = 0.0
    recorded_ground(wave, cell.amplitude, times, history)
    history[:, BLOCK] = history[:, GROUND]
    block, room, moving = block_in_pulse(cell, options, cell.amplitude * wave.highest), history_room(wave), np.zeros(2)
    at, velocity, displacement = 0, 0.0, 0.0
    k = first_pulse(block, wave, 0)
    while at < times.size and k < wave.height.size:
        following, peak = first_pulse(block, wave, k + 1), cell.amplitude * wave.height[k]
        block = block_in_pulse(cell, options, peak)
        room.legs[0, 0] = 0.0
        now = one_pulse(block, options, wave, k, following, peak, velocity, room)
        if slides_on(block, peak):
            moving[0], moving[1] = velocity, displacement
            at = sample_continuous_pulse(block, wave, k, following, peak, moving, room.state, times, at, history)
        else:
            start, until = begins_at(block, wave, k), begins_at(block, wave, following)
            at = sample_pulse(block, wave, room, start, until, 0.0, displacement, now.displacement, times, at, history)
        velocity, displacement = now.velocity, displacement + now.displacement
        k = following
    fill_friction(block, history)


@scalar
def fill_friction(block: Block, history: np.ndarray) -> None:
    """Fill what Eq. 1 gives for the accelerations of plane and block."""
    for at in range(history.shape[0]):
        history[at, FRICTION] = eq.mobilised_friction(
            history[at, GROUND], history[at, BLOCK], block.mu_s, block.tan_theta, block.g
        )


def _history(cells: np.ndarray, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    block = block_at(cells, 0, options)
    history[:] = 0.0
    ground_history(block, options, wave, phases, history)
    history[:, BLOCK] = history[:, GROUND]
    if block.sliding_mode == CONTINUOUS:
        continuous_history(block, options, wave, phases, history)
    elif block.sliding_mode == STICK_SLIP:
        stick_slip_history(block, options, wave, phases, history)
    fill_friction(block, history)


#: Fill rows of ground and block acceleration, friction, V and W for one cell: at increasing phases of a waveform, and
#: at increasing times of a record at time scale 1.
history = Kernel(_history)
record_history = Kernel(_record_history)
