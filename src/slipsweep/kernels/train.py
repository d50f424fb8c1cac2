"""A cell under a waveform, given how one pulse goes and how continuous sliding does: a train of pulses.

Both solvers bring their own `pulse`, a map from the velocity with which one is entered to that with
which the next is; what follows from that map over many cycles stands here.
"""

import math
from collections.abc import Callable
from typing import Any

from slipsweep.jit.decorators import scalar, single
from slipsweep.kernels import block as physics
from slipsweep.kernels.block import Block, Cell, Motion, Options, block_of, interface_of
from slipsweep.kernels.pulse import Pulse, first_pulse, motion_of
from slipsweep.model import equations as eq
from slipsweep.model.friction import FrictionLaw
from slipsweep.motion.pieces import Wave


def train_of(
    pulse: Callable[[Block, Options, Wave, Any, int, int, float], Pulse],
) -> Callable[[Block, Options, Wave, Any], Pulse]:
    """The jitted train of a solver's pulses.

    A pulse is given block, options, wave, the solver's own `Workspace` or `Steps`, the interval it
    begins in, the one in which the next begins (past the last, if none does) and the velocity with
    which it is entered.
    """

    @scalar
    def pulses(
        block: Block,
        options: Options,
        wave: Wave,
        workspace: Any,
        k: int,
        until: int,
        velocity: float,
    ) -> tuple[Pulse, int]:
        """Pulses from interval k on, as long as they begin before piece `until`, as one; the next one's interval."""
        displacement = 0.0
        peak = velocity
        least = velocity
        validity = 0
        while k < wave.height.size and wave.interval[k, 0] < until:
            following = first_pulse(block, wave, k + 1)
            now = pulse(block, options, wave, workspace, k, following, velocity)
            k = following
            velocity = now.velocity
            displacement += now.displacement
            peak = max(peak, now.peak)
            least = min(least, now.least)
            validity |= now.validity
            if velocity > 0.0 and now.validity == 0 and block.rise != physics.NEWMARK:
                validity |= physics.NOT_RECOUPLED
            if math.isnan(now.displacement + now.peak) and validity & physics.NO_VALUE == 0:
                validity |= physics.UNSOLVED
            if validity & physics.NO_VALUE:
                break
        return Pulse(velocity, displacement, peak, least, 0.0, validity), k

    @single
    def train(block: Block, options: Options, wave: Wave, workspace: Any) -> Pulse:
        """All pulses of a stick-slip (or Newmark) block, as one.

        Where the map of the repeated cycle returns to a velocity seen before, the cycles in between
        repeat; where the block never rests within it, V changes by the same amount each time and W
        is an arithmetic series.
        """
        k = first_pulse(block, wave, 0)
        now, k = pulses(block, options, wave, workspace, k, wave.cycle[wave.lead], 0.0)
        velocity = now.velocity
        displacement = now.displacement
        peak = now.peak
        validity = now.validity
        # what the cycles before the repeated one (a ramp, say) leave is the first velocity to come
        # back to
        seen_velocity = velocity
        seen_displacement = displacement
        seen_at = 0
        next_look = 1
        done = 0
        left = wave.repeats
        after = k
        while left > 0 and validity & physics.NO_VALUE == 0:
            before = velocity
            now, after = pulses(
                block, options, wave, workspace, k, wave.cycle[wave.lead + 1], before
            )
            validity |= now.validity
            if validity & physics.NO_VALUE:
                break
            velocity = now.velocity
            displacement += now.displacement
            peak = max(peak, now.peak)
            done += 1
            left -= 1
            if before == 0.0 and velocity == 0.0:
                alone = (
                    wave.cycle.size == wave.lead + 3
                    and wave.shape[wave.lead + 1] == wave.shape[wave.lead]
                )
                # the last cycle, which Eq. 12 ends in the same way though no pulse follows
                if alone and options.recoupling == physics.EQ12:
                    left = left + 1
                    after = wave.height.size
                displacement += left * now.displacement
                break
            if now.least > 0.0:
                gain = velocity - before
                alike = float(left)
                if gain < 0.0:
                    alike = min(alike, math.floor(now.least / -gain))
                displacement += alike * now.displacement + math.pi * gain * alike * (alike + 1.0)
                velocity += alike * gain
                left -= int(alike)
                done += int(alike)
                if gain > 0.0:
                    peak = max(peak, now.peak + alike * gain)
            elif velocity == seen_velocity:
                period = done - seen_at
                displacement += (left // period) * (displacement - seen_displacement)
                left -= left // period * period
                seen_velocity = -1.0  # no further period fits
            elif done == next_look:
                seen_velocity = velocity
                seen_displacement = displacement
                seen_at = done
                next_look *= 2
        if validity & physics.NO_VALUE == 0:
            now, _ = pulses(block, options, wave, workspace, after, wave.pieces.shape[0], velocity)
            validity |= now.validity
            displacement += now.displacement
            peak = max(peak, now.peak)
        if validity & physics.NO_VALUE:
            displacement = peak = math.nan
        return Pulse(velocity, displacement, peak, 0.0, 0.0, validity)

    return train


def cell_solver_of(
    pulse: Callable[[Block, Options, Wave, Any, int, int, float], Pulse],
    slide_continuously: Callable[[Block, Options, Wave, Any], Pulse],
    yield_governs: Callable[[Block, Wave], bool],
) -> Callable[[FrictionLaw, Cell, Options, Wave, Any], Motion]:
    """The jitted solver of a cell, from a solver's pulse, its continuous sliding, and whether by it yield governs."""
    train = train_of(pulse)

    @single
    def solve_cell(
        law: FrictionLaw, cell: Cell, options: Options, wave: Wave, workspace: Any
    ) -> Motion:
        """The response of a cell of any law that gives what the solver takes of it (`FrictionLaw.missing`)."""
        interface = interface_of(cell, options.rise, options.g)
        block = block_of(law, cell.amplitude, cell, interface, options)
        mode = interface.sliding_mode
        # ramps may keep the shaking below its peak, and a block from sliding
        slides = block.amplitude * wave.highest > block.yield_acceleration
        unknown = math.nan if mode < 0 else 0.0
        remarks = 0 if slides else physics.NEAR_MODE_LIMIT | physics.FRICTION_ESTIMATED
        validity = interface.validity & ~remarks
        found = Pulse(0.0, unknown, unknown, 0.0, 0.0, 0)
        if mode == eq.CONTINUOUS:
            found = slide_continuously(block, options, wave, workspace)
        elif mode == eq.STICK_SLIP and slides:
            validity |= physics.YIELD_GOVERNS if yield_governs(block, wave) else 0
            found = train(block, options, wave, workspace)
        return motion_of(block, mode, validity, found)

    return solve_cell
