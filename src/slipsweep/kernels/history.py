"""Time histories, sampled from the parts of the motion that the exact walk notes in its log.

These, and with them every sample, come from the same functions that a sweep calls: a history ends
at the displacement that the sweep gives.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import scalar, single
from slipsweep.kernels import block as physics
from slipsweep.kernels import exact
from slipsweep.kernels import record as recorded
from slipsweep.kernels.block import Block, Options
from slipsweep.kernels.continuous import follow_eq4
from slipsweep.kernels.eq4 import eq4_integrals
from slipsweep.kernels.exact import Workspace
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
    """V and W where a log begins, at phase `start`; `gained` is W after it."""

    start: float
    velocity: float
    displacement: float
    gained: float


@scalar
def table_cycle(wave: Wave, n: int) -> int:
    """The cycle of the table that is cycle n of the shaking."""
    if n < wave.lead:
        return n
    return wave.lead if n < wave.lead + wave.repeats else n - max(wave.repeats - 1, 0)


@scalar
def fill_base(
    amplitude: float, cycles: int, wave: Wave, phases: np.ndarray, found: History
) -> None:
    """Fill the base's acceleration at increasing phases; at a jump, the value after it."""
    pieces = wave.pieces
    p = 0
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
            tau = min(
                max(pieces[p].begin + (phi - pieces[p].start), pieces[p].begin), pieces[p].finish
            )
            found.ground_acceleration[at] = base_acceleration(pieces[p], amplitude, tau)


@scalar
def sample_part(
    block: Block,
    wave: Wave,
    log: np.ndarray,
    row: int,
    phi: float,
    now: Moving,
    at: int,
    found: History,
) -> None:
    """Fill Ü, V and W of a sample at phase φ of the table in a part of the motion."""
    part = log[row]
    since = max(phi - part["start"], 0.0)
    b = part["held"]
    tau = part["tau"]
    velocity = now.velocity + part["velocity"]
    displacement = (
        now.displacement + now.velocity * (part["start"] - now.start) + part["displacement"]
    )
    if part["kind"] == exact.ATTENUATE:
        found.block_acceleration[at] += b
        gained = -b * since
        moved = -0.5 * b * since * since
    elif part["kind"] == exact.HOLD:
        found.block_acceleration[at] = b
        gained, moved = held_integrals(
            wave.pieces[part["piece"]], block.amplitude, b, tau, tau + since
        )
    else:
        found.block_acceleration[at] = physics.response(block, found.ground_acceleration[at])
        gained, moved = eq4_integrals(block, wave.pieces[part["piece"]], tau, tau + since)
    left = velocity + gained
    if part["kind"] != exact.SLIDE_ON:  # beyond a stop, by rounding
        left = max(left, 0.0) if velocity >= 0.0 else min(left, 0.0)
    found.velocity[at] = left
    found.displacement[at] = displacement + velocity * since + moved


@scalar
def begins_at(block: Block, wave: Wave, k: int) -> float:
    """The table's phase at which the pulse of interval k begins; infinite past the last."""
    if k >= wave.height.size:
        return math.inf
    p, tau = beginning(block, wave, k)
    return phase_at(wave.pieces[p], tau)


@scalar
def sample_log(
    block: Block,
    wave: Wave,
    log: np.ndarray,
    until: float,
    offset: float,
    now: Moving,
    phases: np.ndarray,
    at: int,
    found: History,
) -> int:
    """Fill Ü, V and W up to phase `until` of the table from a log; the first sample beyond.

    Phases of the table are those of the samples less `offset`.
    """
    row = 0
    while at < phases.size and phases[at] - offset < until:
        phi = phases[at] - offset
        while row < log.size and phi >= log[row]["end"]:
            row += 1
        moved = 0.0
        if phi >= now.start:
            moved = log[row]["displacement"] if row < log.size else now.gained
        found.displacement[at] = now.displacement + moved
        # a part that is entered with V follows the one before: what lies between them is rounding
        if row < log.size and (phi >= log[row]["start"] or log[row]["velocity"] != 0.0):
            sample_part(block, wave, log, row, phi, now, at, found)
        at += 1
    return at


@scalar
def fill_pulses(
    cell: physics.Cell,
    block: Block,
    options: Options,
    wave: Wave,
    workspace: Workspace,
    is_record: bool,
    phases: np.ndarray,
    found: History,
) -> None:
    """Fill Ü, V and W pulse by pulse; of a record each has the friction of its own peak."""
    at = 0
    velocity = 0.0
    displacement = 0.0
    k = first_pulse(block, wave, 0)
    repeat = 0
    while at < phases.size and k < wave.height.size:
        following = first_pulse(block, wave, k + 1)
        peak = block.amplitude * wave.height[k]
        continuous = False
        if is_record:
            block, interface = recorded.block_in_pulse(exponential(), cell, options, peak)
            continuous = recorded.slides_continuously(interface, options, peak)
        now = recorded.recorded_pulse(
            block, continuous, options, wave, k, following, peak, velocity, workspace
        )
        # the log of continuous sliding begins at rest
        before = Moving(
            begins_at(block, wave, k),
            velocity if continuous else 0.0,
            displacement,
            now.displacement,
        )
        log = workspace.log[: workspace.logged[0]]
        until = begins_at(block, wave, following)
        at = sample_log(block, wave, log, until, 2.0 * math.pi * repeat, before, phases, at, found)
        velocity = now.velocity
        displacement = displacement + now.displacement
        # the plain cycle of the table comes again and again
        again = (
            following < wave.height.size
            and wave.interval[following, 0] >= wave.cycle[wave.lead + 1]
        )
        if again and repeat < wave.repeats - 1:
            repeat += 1
            following = first_pulse(block, wave, 0)
            while wave.interval[following, 0] < wave.cycle[wave.lead]:
                following = first_pulse(block, wave, following + 1)
        k = following


@scalar
def fill_cycles(
    block: Block, cycles: int, wave: Wave, workspace: Workspace, phases: np.ndarray, found: History
) -> None:
    """Fill Ü, V and W of a block that slides continuously under a waveform, cycle by cycle."""
    k = first_pulse(block, wave, 0)
    if k == wave.height.size:
        return
    first, began = beginning(block, wave, k)
    at = 0
    slides = False
    velocity = 0.0
    displacement = 0.0
    for n in range(cycles):
        c = table_cycle(wave, n)
        p = wave.cycle[c]
        until = wave.cycle[c + 1]
        if p == until or (not slides and until <= first):
            continue
        tau = wave.pieces[p].begin
        if not slides:
            p = first
            tau = began
            slides = True
        gain = follow_eq4(block, wave, workspace, p, tau, until, -math.inf)
        log = workspace.log[: workspace.logged[0]]
        start = phase_at(wave.pieces[p], tau)
        end = wave.pieces[until - 1].end
        before = Moving(start, velocity, displacement, 0.0)
        at = sample_log(block, wave, log, end, 2.0 * math.pi * (n - c), before, phases, at, found)
        displacement += velocity * (end - start) + gain.displacement
        velocity += gain.velocity
    for after in range(at, phases.size):
        found.velocity[after] = velocity
        found.displacement[after] = displacement


@single
def fill(
    cell: physics.Cell,
    options: Options,
    wave: Wave,
    workspace: Workspace,
    is_record: bool,
    phases: np.ndarray,
    found: History,
) -> None:
    """Fill a history; where the block does not slide it moves with the base."""
    peak = cell.amplitude * wave.highest if is_record else cell.amplitude
    block, interface = recorded.block_in_pulse(exponential(), cell, options, peak)
    fill_base(cell.amplitude, options.cycles, wave, phases, found)
    for at in range(phases.size):
        found.block_acceleration[at] = found.ground_acceleration[at]
        found.velocity[at] = found.displacement[at] = 0.0
    if is_record or interface.sliding_mode == eq.STICK_SLIP:
        fill_pulses(cell, block, options, wave, workspace, is_record, phases, found)
    elif interface.sliding_mode == eq.CONTINUOUS:
        fill_cycles(block, options.cycles, wave, workspace, phases, found)
    for at in range(phases.size):
        found.friction_coefficient[at] = eq.mobilised_friction(  # Eq. 1
            found.ground_acceleration[at],
            found.block_acceleration[at],
            block.mu_s,
            block.tan_theta,
            block.g,
        )


@kernel
def fill_history(
    cell: physics.Cell,
    options: Options,
    wave: Wave,
    workspace: Workspace,
    phases: np.ndarray,
    found: History,
) -> None:
    """Fill a history under a waveform at increasing phases."""
    fill(cell, options, wave, workspace, False, phases, found)


@kernel
def fill_recorded_history(
    cell: physics.Cell,
    options: Options,
    wave: Wave,
    workspace: Workspace,
    times: np.ndarray,
    found: History,
) -> None:
    """Fill a history under a record at increasing times, at time scale 1; `cell.amplitude` is the factor on it."""
    fill(cell, options, wave, workspace, True, times, found)
