"""Time histories, sampled from the parts of the motion that the exact walk notes in its log.

These, and with them every sample, come from the same functions that a sweep calls: a history ends at the displacement
that the sweep gives.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels import block as physics
from slipsweep.kernels import record as recorded
from slipsweep.kernels.block import Block, Options
from slipsweep.kernels.eq4 import eq4_integrals
from slipsweep.kernels.exact import ATTENUATE, FOLLOW, Workspace, pulse
from slipsweep.kernels.excitation import base_acceleration, held_integrals, phase_at
from slipsweep.kernels.pulse import beginning, first_pulse
from slipsweep.model import equations as eq
from slipsweep.model.friction import exponential
from slipsweep.motion.pieces import Wave


class History(NamedTuple):
    """Samples of a history, each (samples,): Üg, Ü, μ by Eq. 1, V and W."""

    ground_acceleration: np.ndarray
    block_acceleration: np.ndarray
    friction_coefficient: np.ndarray
    velocity: np.ndarray
    displacement: np.ndarray


class Moving(NamedTuple):
    """V and W at an instant, and the first sample after it."""

    velocity: float
    displacement: float
    sample: int


@scalar
def table_cycle(wave: Wave, n: int) -> int:
    """The cycle of the table that is cycle n of the shaking."""
    if n < wave.lead:
        return n
    return wave.lead if n < wave.lead + wave.repeats else n - max(wave.repeats - 1, 0)


@scalar
def fill_base(amplitude: float, cycles: int, wave: Wave, phases: np.ndarray, found: History) -> None:
    """Fill the base's acceleration at increasing phases; at a jump, the value after it."""
    pieces, p = wave.pieces, 0
    end = pieces[pieces.shape[0] - 1].end + 2.0 * math.pi * max(wave.repeats - 1, 0)
    for at in range(phases.size):
        found.ground_acceleration[at] = 0.0
        if pieces[0].start <= phases[at] < end:
            n = min(max(int(phases[at] / (2.0 * math.pi)), 0), cycles - 1)
            c = table_cycle(wave, n)
            phi = phases[at] - 2.0 * math.pi * (n - c)
            if not wave.cycle[c] <= p < wave.cycle[c + 1] or phi < pieces[p].start:
                p = wave.cycle[c]
            while p + 1 < wave.cycle[c + 1] and pieces[p].end <= phi:
                p += 1
            tau = min(max(pieces[p].begin + (phi - pieces[p].start), pieces[p].begin), pieces[p].finish)
            found.ground_acceleration[at] = base_acceleration(pieces[p], amplitude, tau)


@scalar
def rest(found: History) -> None:
    """Fill a history in which the block moves with the base."""
    for at in range(found.velocity.size):
        found.block_acceleration[at] = found.ground_acceleration[at]
        found.velocity[at] = found.displacement[at] = 0.0


@scalar
def fill_friction(block: Block, found: History) -> None:
    """Fill what Eq. 1 gives for the accelerations of base and block."""
    for at in range(found.velocity.size):
        found.friction_coefficient[at] = eq.mobilised_friction(
            found.ground_acceleration[at], found.block_acceleration[at], block.mu_s, block.tan_theta, block.g
        )


@scalar
def sample_part(
    block: Block, wave: Wave, log: np.ndarray, row: int, phi: float, displacement: float, at: int, found: History
) -> None:
    """Fill Ü, V and W of a sample at phase φ of the table in a part of the motion; W was `displacement` before it."""
    part = log[row]
    since, b, tau = max(phi - part["start"], 0.0), part["held"], part["tau"]
    if part["kind"] == ATTENUATE:
        found.block_acceleration[at] += b
        gained, moved = -b * since, -0.5 * b * since * since
    elif part["kind"] == FOLLOW:
        found.block_acceleration[at] = physics.response(block, found.ground_acceleration[at])
        gained, moved = eq4_integrals(block, wave.pieces[part["piece"]], tau, tau + since)
    else:
        found.block_acceleration[at] = b
        gained, moved = held_integrals(wave.pieces[part["piece"]], block.amplitude, b, tau, tau + since)
    found.velocity[at] = max(part["velocity"] + gained, 0.0)
    found.displacement[at] = displacement + part["displacement"] + part["velocity"] * since + moved


@scalar
def begins_at(block: Block, wave: Wave, k: int) -> float:
    """The table's phase at which the pulse of interval k begins; infinite past the last."""
    if k >= wave.height.size:
        return math.inf
    p, tau = beginning(block, wave, k)
    return phase_at(wave.pieces[p], tau)


@scalar
def sample_pulse(
    block: Block, wave: Wave, log: np.ndarray, start: float, until: float, offset: float,
    displacement: float, gained: float, phases: np.ndarray, at: int, found: History,
) -> int:  # fmt: skip
    """Fill Ü, V and W up to phase `until`, from the log of a pulse that begins at `start`; the first sample beyond.

    W is `displacement` before the pulse and `gained` more after it; phases of the table are less by `offset`.
    """
    row = 0
    while at < phases.size and phases[at] < until:
        phi = phases[at] - offset
        while row < log.size and phi >= log[row]["end"]:
            row += 1
        moved = 0.0
        if phases[at] >= start:
            moved = log[row]["displacement"] if row < log.size else gained
        found.displacement[at] = displacement + moved
        # a part that is entered with V follows the one before: what lies between them is rounding
        if row < log.size and (phi >= log[row]["start"] or log[row]["velocity"] > 0.0):
            sample_part(block, wave, log, row, phi, displacement, at, found)
        at += 1
    return at


@scalar
def stick_slip_history(
    block: Block, options: Options, wave: Wave, workspace: Workspace, phases: np.ndarray, found: History
) -> None:
    """Fill Ü, V and W of a stick-slip (or Newmark) block at increasing phases φ."""
    at, velocity, displacement = 0, 0.0, 0.0
    k, repeat = first_pulse(block, wave, 0), 0
    intervals = wave.height.size
    while at < phases.size and k < intervals:
        # the plain cycle of the table comes again and again
        following = first_pulse(block, wave, k + 1)
        offset = 2.0 * math.pi * repeat
        start, until = begins_at(block, wave, k) + offset, begins_at(block, wave, following) + offset
        now = pulse(block, options, wave, workspace, k, following, velocity)
        log = workspace.log[: workspace.logged[0]]
        at = sample_pulse(block, wave, log, start, until, offset, displacement, now.displacement, phases, at, found)
        velocity = now.velocity
        displacement += now.displacement
        again = following < intervals and wave.interval[following, 0] >= wave.cycle[wave.lead + 1]
        if again and repeat < wave.repeats - 1:
            repeat += 1
            following = first_pulse(block, wave, 0)
            while wave.interval[following, 0] < wave.cycle[wave.lead]:
                following = first_pulse(block, wave, following + 1)
        k = following


@scalar
def sample_following(
    block: Block, wave: Wave, p: int, tau: float, until: int, tau_until: float, offset: float, now: Moving,
    phases: np.ndarray, found: History,
) -> Moving:  # fmt: skip
    """Fill Ü, V and W under Eq. 4 from τ on piece p to `tau_until` on piece `until`; what moves then.

    Phases of the table are less by `offset`.
    """
    velocity, displacement, at = now
    for q in range(p, min(until + 1, wave.pieces.shape[0])):
        start = tau if q == p else wave.pieces[q].begin
        end, end_phase = wave.pieces[q].finish, wave.pieces[q].end
        if q == until:
            end, end_phase = tau_until, phase_at(wave.pieces[q], tau_until)
        if end <= start:
            continue
        start_phase = phase_at(wave.pieces[q], start) + offset
        while at < phases.size and phases[at] < end_phase + offset:
            since = max(phases[at] - start_phase, 0.0)
            gained, moved = eq4_integrals(block, wave.pieces[q], start, min(start + since, end))
            found.block_acceleration[at] = physics.response(block, found.ground_acceleration[at])
            found.velocity[at] = velocity + gained
            found.displacement[at] = displacement + velocity * since + moved
            at += 1
        gained, moved = eq4_integrals(block, wave.pieces[q], start, end)
        displacement += velocity * (end - start) + moved
        velocity += gained
    return Moving(velocity, displacement, at)


@scalar
def continuous_history(block: Block, cycles: int, wave: Wave, phases: np.ndarray, found: History) -> None:
    """Fill Ü, V and W of a continuously sliding block at increasing phases φ, piece by piece."""
    k = first_pulse(block, wave, 0)
    if k == wave.height.size:
        return
    first, began = beginning(block, wave, k)
    at = 0
    while at < phases.size and phases[at] < phase_at(wave.pieces[first], began):
        at += 1
    now = Moving(0.0, 0.0, at)
    for n in range(cycles):
        c = table_cycle(wave, n)
        p, until = max(wave.cycle[c], first), wave.cycle[c + 1]
        if p < until:
            tau = began if p == first and n == c else wave.pieces[p].begin
            tau_until = wave.pieces[until].begin if until < wave.pieces.shape[0] else 0.0
            offset = 2.0 * math.pi * (n - c)
            now = sample_following(block, wave, p, tau, until, tau_until, offset, now, phases, found)
        if c == wave.lead:
            first = 0 if wave.cycle[c] == 0 else min(first, wave.cycle[c])
    for after in range(now.sample, phases.size):
        found.velocity[after], found.displacement[after] = now.velocity, now.displacement


@scalar
def sample_continuous_pulse(
    block: Block, wave: Wave, k: int, following: int, peak: float, now: Moving, times: np.ndarray, found: History
) -> int:
    """Fill Ü, v and u of a continuous pulse of a record (`record.continuous_pulse`); the first sample beyond."""
    p, tau = beginning(block, wave, k)
    until = recorded.end_of_following(block, wave, k, following)
    at = now.sample
    while at < times.size and times[at] < phase_at(wave.pieces[p], tau):
        found.displacement[at] = now.displacement
        at += 1
    after = sample_following(
        block, wave, p, tau, until.piece, until.tau, 0.0, Moving(now.velocity, now.displacement, at), times, found
    )
    at = after.sample
    held, speed, side = physics.response(block, peak), abs(after.velocity), math.copysign(1.0, after.velocity)
    while at < times.size and times[at] < until.begins:
        since = max(times[at] - until.ends, 0.0)
        left = eq.attenuated_velocity(speed, held, since)
        found.block_acceleration[at] += side * held if left > 0.0 else 0.0
        found.velocity[at] = side * left
        found.displacement[at] = after.displacement + side * eq.attenuated_displacement(speed, held, since)
        at += 1
    return at


@kernel
def record_history(
    cell: physics.Cell, options: Options, wave: Wave, workspace: Workspace, times: np.ndarray, found: History
) -> None:
    """Fill a history under a record at increasing times, at time scale 1; `cell.amplitude` is the factor on it."""
    fill_base(cell.amplitude, 1, wave, times, found)
    rest(found)
    block, interface = recorded.block_in_pulse(exponential(), cell, options, cell.amplitude * wave.highest)
    at, velocity, displacement = 0, 0.0, 0.0
    k = first_pulse(block, wave, 0)
    while at < times.size and k < wave.height.size:
        following, peak = first_pulse(block, wave, k + 1), cell.amplitude * wave.height[k]
        block, interface = recorded.block_in_pulse(exponential(), cell, options, peak)
        continuous = recorded.slides_continuously(interface, options, peak)
        now = recorded.recorded_pulse(block, continuous, options, wave, k, following, peak, velocity, workspace)
        if continuous:
            moving = Moving(velocity, displacement, at)
            at = sample_continuous_pulse(block, wave, k, following, peak, moving, times, found)
        else:
            start, until = begins_at(block, wave, k), begins_at(block, wave, following)
            log = workspace.log[: workspace.logged[0]]
            at = sample_pulse(block, wave, log, start, until, 0.0, displacement, now.displacement, times, at, found)
        velocity, displacement = now.velocity, displacement + now.displacement
        k = following
    fill_friction(block, found)


@kernel
def wave_history(
    cell: physics.Cell, options: Options, wave: Wave, workspace: Workspace, phases: np.ndarray, found: History
) -> None:
    """Fill a history under a waveform at increasing phases."""
    interface = physics.interface_of(cell, options.rise, options.g)
    block = physics.block_of(exponential(), cell, interface, options.rise, options.g)
    fill_base(block.amplitude, options.cycles, wave, phases, found)
    rest(found)
    if interface.sliding_mode == eq.CONTINUOUS:
        continuous_history(block, options.cycles, wave, phases, found)
    elif interface.sliding_mode == eq.STICK_SLIP:
        stick_slip_history(block, options, wave, workspace, phases, found)
    fill_friction(block, found)
