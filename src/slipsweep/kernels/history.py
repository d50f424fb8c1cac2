"""Time histories, sampled from the legs of the cycle solver.

The legs, and with them every sample, come from the same functions that a sweep calls: a
history ends at the displacement that the sweep gives.
"""

import math

import numpy as np

from slipsweep import equations as eq
from slipsweep.compiled import Kernel
from slipsweep.equations import CONTINUOUS
from slipsweep.kernels import cycle
from slipsweep.kernels.block import NO_VALUE, Block, Options, block_at, phase, response
from slipsweep.kernels.cycle import ATTENUATE, FOLLOW, LEG_COLUMNS, MOST_LEGS, RECOUPLE, STICK
from slipsweep.kernels.jit import scalar

_HALF_PI = 0.5 * math.pi

#: Columns of a history.
GROUND, BLOCK, FRICTION, VELOCITY, DISPLACEMENT = range(5)


@scalar
def sample_leg(block: Block, legs: np.ndarray, row: int, psi: float) -> tuple[float, float, float]:
    """Ü - Üg, V and W at phase ψ (from the cycle's peak) on a leg of a stick-slip block."""
    kind, start, b = int(legs[row, 0]), legs[row, 1], legs[row, 3]
    velocity, displacement = legs[row, 4], legs[row, 5]
    x = block.amplitude * math.cos(psi)
    since = psi - start
    if kind == STICK:
        return 0.0, 0.0, displacement
    if kind == ATTENUATE:
        return b, velocity - b * since, displacement + (velocity - 0.5 * b * since) * since
    if kind == RECOUPLE:
        lost, unmoved = cycle.recoupling_integrals(block, b, since)
        return b - x, velocity - lost, displacement + velocity * since - unmoved
    if kind == FOLLOW:
        b = response(block, x)
        gained, moved = cycle.slip_integrals(block, start, psi, 1.0)
    else:
        gained, moved = cycle.held_integrals(block, b, start, psi)
    return b - x, velocity + gained, displacement + velocity * since + moved


@scalar
def stick_slip_history(block: Block, options: Options, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill Ü - Üg, V and W of a stick-slip (or Newmark) block at increasing phases φ."""
    legs = np.zeros((MOST_LEGS, LEG_COLUMNS))
    start = phase(block, block.yield_acceleration)  # where a cycle's pulse may begin, from its peak
    at, velocity, displacement = 0, 0.0, 0.0
    for pulse in range(options.cycles):
        peak = 2.0 * math.pi * pulse + _HALF_PI
        last = pulse == options.cycles - 1
        legs[0, 0] = 0.0
        now = cycle.follow_pulse(block, options, velocity, last, legs)
        row = 1
        while at < phases.size and (last or phases[at] < peak + 2.0 * math.pi + start):
            psi = phases[at] - peak
            while row < legs[0, 0] and psi > legs[row, 2]:
                row += 1
            history[at, VELOCITY], history[at, DISPLACEMENT] = velocity, displacement
            if psi >= start:
                difference, v, w = 0.0, 0.0, now.displacement
                if legs[0, 0] > 0.0 and psi <= legs[row, 2]:
                    difference, v, w = sample_leg(block, legs, row, psi)
                history[at, BLOCK], history[at, VELOCITY] = difference, max(v, 0.0)
                history[at, DISPLACEMENT] = displacement + w
            at += 1
        velocity = now.velocity
        displacement += now.displacement


@scalar
def continuous_history(block: Block, options: Options, phases: np.ndarray, history: np.ndarray) -> None:
    """Fill Ü - Üg, V and W of a continuously sliding block at increasing phases φ, quarter by quarter."""
    began = phase(block, block.yield_acceleration)
    at, velocity, displacement = 0, 0.0, 0.0
    shaken = 2.0 * math.pi * options.cycles
    for quarter in range(4 * options.cycles):
        side = 1.0 if quarter % 4 < 2 else -1.0
        rising = quarter % 2 == 0
        start = began if quarter == 0 else -_HALF_PI
        whole, moment = cycle.slip_integrals(block, start, 0.0, side)
        phi_start = quarter * _HALF_PI + (_HALF_PI + start if quarter == 0 else 0.0)
        last = quarter == 4 * options.cycles - 1
        while at < phases.size and (phases[at] < (quarter + 1) * _HALF_PI or last):
            since = min(phases[at], shaken) - phi_start
            if since >= 0.0:
                if rising:
                    psi = min(start + since, 0.0)
                    gained, moved = cycle.slip_integrals(block, start, psi, side)
                else:
                    psi = -min(since, _HALF_PI)
                    gained, fell = cycle.slip_integrals(block, psi, 0.0, side)
                    moved = since * gained - fell
                x = side * block.amplitude * math.cos(psi)
                history[at, BLOCK] = response(block, x) - x
                history[at, VELOCITY] = velocity + gained
                history[at, DISPLACEMENT] = displacement + velocity * since + moved
            at += 1
        if rising:
            displacement += moment - velocity * start
        else:
            displacement += velocity * _HALF_PI + whole * _HALF_PI - moment
        velocity += whole


def _history(cells: np.ndarray, options: Options, phases: np.ndarray, history: np.ndarray) -> None:
    block = block_at(cells, 0, options)
    shaken = 2.0 * math.pi * options.cycles
    history[:] = 0.0
    if block.validity & NO_VALUE == 0:
        if block.sliding_mode == CONTINUOUS:
            continuous_history(block, options, phases, history)
        elif block.amplitude > block.yield_acceleration:
            stick_slip_history(block, options, phases, history)
    for at in range(phases.size):
        x = block.amplitude * math.sin(phases[at]) if phases[at] <= shaken else 0.0
        history[at, GROUND] = x
        history[at, BLOCK] += x
        if block.validity & NO_VALUE:
            history[at, BLOCK:] = math.nan
        history[at, FRICTION] = eq.mobilised_friction(x, history[at, BLOCK], block.mu_s, block.tan_theta, block.g)


#: Fills rows of ground and block acceleration, friction, V and W for one cell at increasing phases.
history = Kernel(_history)
