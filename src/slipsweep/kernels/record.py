"""The exact kernel for recorded motions: pulses of the exact walk, each with the friction of its own peak.

A record is a wave of straight pieces like any other, on which both b held and Eq. 4 integrate in
closed form.  The motion rules are those of a harmonic motion (docs/model.md), extended
(docs/records.md): Eq. 7 with a pulse's own peak decides whether the block sticks and slips in it or
slides continuously, and Eqs. 8-11 with that peak give its friction. Time stands in place of the
phase, so that V and W are v and u of a record at time scale 1.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.kernels import block as physics
from slipsweep.kernels import exact
from slipsweep.kernels import pulse as pulses
from slipsweep.kernels.block import Block, Options
from slipsweep.kernels.continuous import find_zeros, follow_eq4
from slipsweep.kernels.exact import Workspace, pulse
from slipsweep.kernels.excitation import phase_at
from slipsweep.kernels.grid import cell_at, uncounted_wave
from slipsweep.model import equations as eq
from slipsweep.model.friction import FrictionLaw, exponential
from slipsweep.motion.pieces import Wave


class Following(NamedTuple):
    """Where Eq. 4 ends in a continuous pulse: a piece, τ on it, its time; and when the next pulse begins."""

    piece: int
    tau: float
    ends: float
    begins: float


@inlined
def block_in_pulse(
    law: FrictionLaw, cell: physics.Cell, options: Options, peak: float
) -> tuple[Block, physics.Interface]:
    """The block in a pulse of that peak, for Eqs. 7-11 and λ; its `amplitude` is the factor on the record."""
    in_pulse = physics.Cell(
        cell.tan_theta,
        cell.mu_s,
        peak,
        cell.yield_acceleration,
        cell.decay_rate,
        cell.delta_mu,
        cell.minimum_friction,
    )
    interface = physics.interface_of(in_pulse, options.rise, options.g)
    return physics.block_of(law, cell.amplitude, in_pulse, interface, options), interface


@inlined
def slides_continuously(interface: physics.Interface, options: Options, peak: float) -> bool:
    """Whether a block slides continuously in a pulse of that peak: its mode is missing where a sine would uplift it."""
    return options.rise != physics.NEWMARK and peak > interface.limiting_acceleration


@scalar
def half_wave_after(wave: Wave, k: int) -> int:
    """Return the first piece after the negative half wave that follows interval k at once.

    A sample of exactly 0 between two negative ones is within the half wave.
    """
    q = wave.interval[k, 1]
    while q < wave.pieces.shape[0] and wave.pieces[q].top < 0.0:
        q += 1
    return q


@scalar
def end_of_following(block: Block, wave: Wave, k: int, following: int) -> Following:
    """Where Eq. 4 ends in a continuous pulse that begins in interval k.

    It holds through the negative half wave and, if the next pulse follows at once, up to that.
    """
    pieces = wave.pieces.shape[0]
    last = following >= wave.height.size
    until = half_wave_after(wave, k)
    tau = 0.0
    ends = wave.pieces[pieces - 1].end
    if until < pieces:
        tau = wave.pieces[until].begin
        ends = phase_at(wave.pieces[until], tau)
    begins = math.inf
    if not last:
        next_piece, next_tau = pulses.beginning(block, wave, following)
        begins = phase_at(wave.pieces[next_piece], next_tau)
        if following == k + 1 and wave.interval[following, 0] == until:
            until = next_piece
            tau = next_tau
            ends = begins
    return Following(until, tau, ends, begins)


@scalar
def continuous_pulse(
    block: Block,
    options: Options,
    wave: Wave,
    k: int,
    following: int,
    peak: float,
    velocity: float,
    workspace: Workspace,
) -> pulses.Pulse:
    """A continuous pulse, of that `peak`, from Üg = Üy in interval k to the pulse of the `following` one.

    Eq. 4 holds through the negative half wave and, if the pulse follows at once, up to it; else Eq.
    12 takes V, of either sign, to zero from there on.
    """
    p, tau = pulses.beginning(block, wave, k)
    until = end_of_following(block, wave, k, following)
    if not find_zeros(block, options.wants_peak, wave, workspace):
        return pulses.Pulse(math.nan, math.nan, math.nan, 0.0, 0.0, 0)
    gained, displaced, most = follow_eq4(block, wave, workspace, p, tau, until.piece, until.tau)
    after = velocity + gained
    displacement = velocity * (until.ends - phase_at(wave.pieces[p], tau)) + displaced
    if until.begins > until.ends:
        held = physics.response(block, peak)
        speed = abs(after)
        side = math.copysign(1.0, after)
        if workspace.log.size:
            row = workspace.log[workspace.logged[0]]
            stop = until.ends + min(speed / held, until.begins - until.ends)
            exact.note(
                row, exact.ATTENUATE, 0, 0.0, until.ends, stop, side * held, gained, displaced
            )
            workspace.logged[0] += 1
        displacement += side * eq.attenuated_displacement(speed, held, until.begins - until.ends)
        after = side * eq.attenuated_velocity(speed, held, until.begins - until.ends)
    slips = 1.0 if velocity == 0.0 else 0.0
    return pulses.Pulse(after, displacement, velocity + most, 0.0, slips, 0)


@single
def recorded_pulse(
    block: Block,
    continuous: bool,
    options: Options,
    wave: Wave,
    k: int,
    following: int,
    peak: float,
    velocity: float,
    workspace: Workspace,
) -> pulses.Pulse:
    """A pulse, continuous or not, from Üg = Üy in interval k to the pulse of the `following` one."""
    if continuous:
        return continuous_pulse(block, options, wave, k, following, peak, velocity, workspace)
    # v never goes below 0: a velocity upslope, left by a continuous pulse, is neglected
    return pulse(block, options, wave, workspace, k, following, max(velocity, 0.0))


@scalar
def remarks_in(
    cell: physics.Cell, block: Block, interface: physics.Interface, continuous: bool, peak: float
) -> int:
    """The flags of a pulse of that peak."""
    if block.rise == physics.NEWMARK:
        return 0
    remarks = physics.remarks_on(cell, interface.acceleration_ratio)
    remarks |= interface.validity & physics.FRICTION_NOT_DECAYING
    if continuous:
        return remarks
    monotone = block.rise == physics.MONOTONE
    if monotone and physics.stays_below_yield(block, block.yield_acceleration, peak):
        remarks = physics.YIELD_GOVERNS | (remarks & ~physics.FRICTION_ESTIMATED)
    return remarks


@scalar
def validity_of_record(law: FrictionLaw, cell: physics.Cell, options: Options, wave: Wave) -> int:
    """What is known before the motion: Üy ≤ 0, no limit by Eq. 7, or n ≤ 0 where Üg is lowest."""
    _, interface = block_in_pulse(
        law, cell, options, cell.amplitude * max(wave.highest, -wave.lowest)
    )
    validity = interface.validity & (physics.STATICALLY_UNSTABLE | physics.LIMIT_UNDEFINED)
    # n = g + Üg tan θ is least where the base's acceleration is lowest
    lowest = eq.normal_acceleration(cell.amplitude * wave.lowest, cell.tan_theta, options.g)
    return validity | (physics.UPLIFT if (lowest <= 0.0) & (options.rise != physics.NEWMARK) else 0)


@single
def solve_cell(
    law: FrictionLaw, cell: physics.Cell, options: Options, wave: Wave, workspace: Workspace
) -> physics.Motion:
    """The response of a cell, pulse by pulse; `cell.amplitude` is the factor on the record."""
    scale = cell.amplitude
    validity = validity_of_record(law, cell, options, wave)
    block, interface = block_in_pulse(law, cell, options, scale * wave.highest)
    velocity = 0.0
    displacement = 0.0
    lost = 0.0
    highest = 0.0
    slips = 0.0
    stick_slips = 0.0
    continuous_pulses = 0.0
    k = pulses.first_pulse(block, wave, 0)
    while k < wave.height.size and validity & physics.NO_VALUE == 0:
        following = pulses.first_pulse(block, wave, k + 1)
        peak = scale * wave.height[k]
        if block.rise != physics.NEWMARK:
            block, interface = block_in_pulse(law, cell, options, peak)
        continuous = slides_continuously(interface, options, peak)
        validity |= remarks_in(cell, block, interface, continuous, peak)
        if validity & physics.NO_VALUE:
            break
        now = recorded_pulse(
            block, continuous, options, wave, k, following, peak, velocity, workspace
        )
        if continuous:
            continuous_pulses += 1.0
        else:
            stick_slips += 1.0
            validity |= now.validity
            if (
                now.velocity > 0.0
                and following < wave.height.size
                and block.rise != physics.NEWMARK
            ):
                validity |= physics.NOT_RECOUPLED
        velocity = now.velocity
        highest = max(now.peak, highest)
        slips = slips + now.slips
        # Kahan's sum: a record has up to a million pulses
        term = now.displacement - lost
        lost = ((displacement + term) - displacement) - term
        displacement = displacement + term
        if math.isnan(displacement + highest) and validity & physics.NO_VALUE == 0:
            validity |= physics.UNSOLVED
        k = following
    validity = physics.settled(validity, displacement, scale * max(wave.highest, -wave.lowest))
    if validity & physics.NO_VALUE:
        return physics.Motion(math.nan, math.nan, math.nan, float(validity), -1.0, -1.0, -1.0)
    return physics.Motion(
        displacement, highest, math.nan, float(validity), slips, stick_slips, continuous_pulses
    )


@kernel
def solve_record(
    cells: np.ndarray, options: Options, wave: Wave, workspace: Workspace, results: np.ndarray
) -> None:
    """Solve the cells of a tile under a record exactly; `results` is (fields of `Motion`, cells)."""
    wave = uncounted_wave(wave)
    workspace = exact.uncounted_workspace(workspace)
    for j in range(cells.size):
        physics.store(
            solve_cell(exponential(), cell_at(cells, j), options, wave, workspace), j, results
        )
