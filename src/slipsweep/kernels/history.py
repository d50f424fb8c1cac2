"""Time histories, sampled from the legs of the cycle solver.

The legs, and with them every sample, come from the same functions that a sweep calls: a
history ends at the displacement that the sweep gives.
"""

import math

import numpy as np

from slipsweep.jit.cache import Kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels import cycle
from slipsweep.kernels.block import Block, Options, block_at, response
from slipsweep.kernels.cycle import ATTENUATE, FOLLOW, LEG_COLUMNS, MOST_LEGS, Room
from slipsweep.kernels.excitation import held_integrals, phase_at, plane
from slipsweep.kernels.pulse import STATE_ROWS, beginning, first_pulse
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
    """Fill the plane's acceleration; at a jump, the value after it."""
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
    block: Block, wave: Wave, legs: np.ndarray, row: int, phi: float, sample: np.ndarray, displacement: float
) -> None:
    """Fill Ü, V and W, `displacement` at the beginning of the pulse, at phase φ of the table on a leg."""
    kind, p, tau = int(legs[row, 0]), int(legs[row, 1]), legs[row, 2]
    since, b, velocity, moved = phi - legs[row, 3], legs[row, 5], legs[row, 6], legs[row, 7]
    if kind == ATTENUATE:
        sample[BLOCK] += b
        gained, gained_way = -b * since, -0.5 * b * since * since
    elif kind == FOLLOW:
        sample[BLOCK] = response(block, sample[GROUND])
        gained, gained_way = cycle.eq4_integrals(block, wave.pieces, p, tau, tau + since)
    else:
        sample[BLOCK] = b
        gained, gained_way = held_integrals(wave.pieces, p, block.amplitude, b, tau, tau + since)
    sample[VELOCITY] = max(velocity + gained, 0.0)
    sample[DISPLACEMENT] = displacement + moved + velocity * since + gained_way


@scalar
def stick_slip_history(block: Block, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill Ü, V and W of a stick-slip (or Newmark) block at increasing phases φ."""
    longest = 0
    for k in range(wave.height.size):
        longest = max(longest, wave.stretch[k, 1] - wave.stretch[k, 0])
    legs = np.zeros((longest * MOST_LEGS + wave.pieces.shape[0] + 2, LEG_COLUMNS))
    room = Room(np.zeros(STATE_ROWS), legs, np.zeros((2, 0)))
    at, velocity, displacement = 0, 0.0, 0.0
    k, repeat = first_pulse(block, wave, 0), 0
    stretches = wave.height.size
    while at < phases.size and k < stretches:
        # the plain cycle of the table comes again and again
        again = first_pulse(block, wave, k + 1)
        offset = 2.0 * math.pi * repeat
        legs[0, 0] = 0.0
        p, tau = beginning(block, wave, k)
        start = phase_at(wave.pieces, p, tau) + offset
        now = cycle.follow_pulse(block, options, wave, room, k, again, velocity)
        until = math.inf
        if again < stretches:
            p, tau = beginning(block, wave, again)
            until = phase_at(wave.pieces, p, tau) + offset
        row = 1
        while at < phases.size and phases[at] < until:
            phi = phases[at] - offset
            while row <= legs[0, 0] and phi >= legs[row, 4]:
                row += 1
            moved = 0.0
            if phases[at] >= start:
                moved = now.displacement if row > legs[0, 0] else legs[row, 7]
            history[at, DISPLACEMENT] = displacement + moved
            if row <= legs[0, 0] and phi >= legs[row, 3]:
                sample_leg(block, wave, legs, row, phi, history[at], displacement)
            at += 1
        velocity = now.velocity
        displacement += now.displacement
        if again < stretches and repeat < wave.repeats - 1 and wave.stretch[again, 0] >= wave.cycle[wave.lead + 1]:
            repeat += 1
            again = first_pulse(block, wave, 0)
            while wave.stretch[again, 0] < wave.cycle[wave.lead]:
                again = first_pulse(block, wave, again + 1)
        k = again


@scalar
def continuous_history(block: Block, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill Ü, V and W of a continuously sliding block at increasing phases φ, piece by piece."""
    k = first_pulse(block, wave, 0)
    if k == wave.height.size:
        return
    first, began = beginning(block, wave, k)
    at, velocity, displacement = 0, 0.0, 0.0
    while at < phases.size and phases[at] < phase_at(wave.pieces, first, began):
        at += 1
    for n in range(options.cycles):
        c = table_cycle(wave, n)
        offset = 2.0 * math.pi * (n - c)
        for p in range(max(wave.cycle[c], first), wave.cycle[c + 1]):
            start = began if p == first and n == c else wave.pieces[p, BEGIN]
            start_phase = phase_at(wave.pieces, p, start) + offset
            while at < phases.size and phases[at] < wave.pieces[p, END] + offset:
                since = max(phases[at] - start_phase, 0.0)
                gained, moved = cycle.eq4_integrals(
                    block, wave.pieces, p, start, min(start + since, wave.pieces[p, FINISH])
                )
                history[at, BLOCK] = response(block, history[at, GROUND])
                history[at, VELOCITY] = velocity + gained
                history[at, DISPLACEMENT] = displacement + velocity * since + moved
                at += 1
            gained, moved = cycle.eq4_integrals(block, wave.pieces, p, start, wave.pieces[p, FINISH])
            displacement += velocity * (wave.pieces[p, FINISH] - start) + moved
            velocity += gained
        if c == wave.lead:
            first = 0 if wave.cycle[c] == 0 else min(first, wave.cycle[c])
    for rest in range(at, phases.size):
        history[rest, VELOCITY], history[rest, DISPLACEMENT] = velocity, displacement


def _history(cells: np.ndarray, options: Options, wave: Wave, phases: np.ndarray, history: np.ndarray) -> None:
    block = block_at(cells, 0, options)
    history[:] = 0.0
    ground_history(block, options, wave, phases, history)
    history[:, BLOCK] = history[:, GROUND]
    if block.sliding_mode == CONTINUOUS:
        continuous_history(block, options, wave, phases, history)
    elif block.sliding_mode == STICK_SLIP:
        stick_slip_history(block, options, wave, phases, history)
    for at in range(phases.size):
        history[at, FRICTION] = eq.mobilised_friction(
            history[at, GROUND], history[at, BLOCK], block.mu_s, block.tan_theta, block.g
        )


#: Fills rows of ground and block acceleration, friction, V and W for one cell at increasing phases.
history = Kernel(_history)
