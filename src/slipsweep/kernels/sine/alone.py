"""Cells under a sine that fit no batch: what the walk computes, cell by cell.

On the rise of a pulse such a block may hold b and follow Eq. 4 several times, come to Üg = Üy in
motion, or have friction that falls in a thin layer.  The fall, Eq. 12 and the cycles are computed
as in any batch.  docs/numerics.md#batches-of-the-sine
"""

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import KD_NOT_POSITIVE, Options
from slipsweep.kernels.eq4 import lag_integrals
from slipsweep.kernels.sine.batch import HALF_PI, WIDTH, Batch, block_at
from slipsweep.kernels.slide import Slide, begin_pulse
from slipsweep.kernels.stick_slip import Place, rise, rising_acceleration
from slipsweep.motion.paths import Base


@scalar
def rise_alone(batch: Batch, options: Options, base: Base, slide: Slide, log: np.ndarray) -> None:
    """From Üg = Üy to the peak with V = `entered`: V and W gained, and b at the peak (`held`).

    `base` begins with the rising quarter of the sine, and `log` is empty.
    """
    for j in range(WIDTH):
        if j >= batch.used:
            batch.pulses[j] = 0.0
        if batch.pulses[j] == 0.0:
            batch.slides[j] = 0.0
            continue
        block = block_at(batch, j, options)
        yields = block.yield_acceleration
        begin_pulse(slide, batch.entered[j])
        batch.level[j] = rising_acceleration(block, yields, yields)
        slide.held = batch.level[j]
        rise(block, base, Place(0, batch.yield_phase[j]), 0, yields, slide, log)
        batch.velocity[j] = slide.velocity
        batch.displacement[j] = slide.displacement
        batch.highest[j] = max(batch.highest[j], slide.peak)
        batch.held[j] = slide.held
        batch.slides[j] = 1.0 if slide.slides else 0.0
        batch.never_rests[j] = 1.0 if slide.slips == 0.0 else 0.0
        if slide.slides and slide.held <= 0.0:  # by Eq. 12 the block does not come to rest
            batch.slides[j] = 0.0
            batch.validity[j] = KD_NOT_POSITIVE
            batch.pulses[j] = 1.0


@scalar
def integrate_eq4_alone(
    batch: Batch, side: float, options: Options, base: Base, slide: Slide
) -> None:
    """`batch.integrate_eq4` by the quadrature of the walk, in as many panels as the friction needs."""
    piece = base.pieces[0]
    curve = base.curves[piece.curve]
    for j in range(WIDTH):
        block = block_at(batch, j, options)
        lag = lag_integrals(block, piece, curve, batch.start[j], batch.end[j], slide)
        batch.gain[j] = side * options.g * lag.first + batch.tan_theta[j] * lag.first_x
        batch.moment[j] = side * options.g * lag.second + batch.tan_theta[j] * lag.second_x


@scalar
def integrate_quarter_alone(batch: Batch, options: Options, base: Base, slide: Slide) -> None:
    """What V gains by Eq. 4 over a rising quarter, `quarter`, and over a cycle, `drift`."""
    piece = base.pieces[0]
    curve = base.curves[piece.curve]
    for j in range(WIDTH):
        block = block_at(batch, j, options)
        lag = lag_integrals(block, piece, curve, -HALF_PI, 0.0, slide)
        drift = batch.tan_theta[j] * lag.first_x
        batch.quarter[j] = options.g * lag.first + drift
        batch.drift[j] = 4.0 * drift
