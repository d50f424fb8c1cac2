"""Newmark's block under a sine: what a cycle adds depends on Üy/A alone, but for a factor.

The block comes to rest within each cycle, and all cycles are alike.  docs/numerics.md#newmarks-block
"""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import elementary
from slipsweep.jit.elementary import rising_phase
from slipsweep.kernels.block import NEWMARK, Options, interface_of
from slipsweep.kernels.sine.batch import (
    BATCH,
    DISPLACEMENT,
    PEAK_VELOCITY,
    SLIDING_MODE,
    VALIDITY,
    WIDTH,
    given,
    held_gains,
    load,
)
from slipsweep.model.equations import STUCK


@elementary
def newmark_slide(yield_acceleration: float, amplitude: float) -> float:
    """W of one cycle for 0 < Üy < A: A ε² s(√(Üy/A)) with ε = (A − Üy)/A, without cancellation at Üy = A.

    s, from 2π to 9/2, is interpolated at 26 Chebyshev nodes (within 3e-17).
    """
    excess = amplitude - yield_acceleration
    z = 2.0 * math.sqrt(max(yield_acceleration, 0.0) / amplitude) - 1.0
    z2 = z * z
    z4 = z2 * z2
    p0 = 3.029390521856469e-09
    p0 = p0 * z4 + 3.742228530474216e-08
    p0 = p0 * z4 + 8.053542087361517e-07
    p0 = p0 * z4 + 3.334956838333364e-05
    p0 = p0 * z4 + 0.001362611487877144
    p0 = p0 * z4 + 0.037687276051547244
    p0 = p0 * z4 - 1.0538361128817804
    p1 = 9.43406069513249e-09
    p1 = p1 * z4 - 2.7728337420677193e-07
    p1 = p1 * z4 - 1.3088937463567394e-05
    p1 = p1 * z4 - 0.0005423085695168228
    p1 = p1 * z4 - 0.017655050353632615
    p1 = p1 * z4 - 0.0069317106936520765
    p2 = -4.587900038689338e-09
    p2 = p2 * z4 + 1.1038899341146114e-07
    p2 = p2 * z4 + 5.113486649667916e-06
    p2 = p2 * z4 + 0.00021392755501739656
    p2 = p2 * z4 + 0.007858886584783438
    p2 = p2 * z4 + 0.11508134295075098
    p3 = -6.7291888710260536e-09
    p3 = p3 * z4 - 8.716085802300114e-08
    p3 = p3 * z4 - 2.03326214888863e-06
    p3 = p3 * z4 - 8.445758311974076e-05
    p3 = p3 * z4 - 0.0033382353267762846
    p3 = p3 * z4 - 0.07421033789902089
    p = ((p3 * z + p2) * z2 + (p1 * z + p0)) * z + 5.4943702379544845
    return p * (excess / amplitude) * excess


@kernel
def solve_newmark_sine(cells: np.ndarray, options: Options, results: np.ndarray) -> int:
    """Newmark's block under a sine, as `solve.solve_sine`; no cell is left.

    V rises up to Üg = Üy on the fall, and as much from the peak on as before it.
    """
    batch = np.empty(1, BATCH)[0]
    for first in range(0, cells.size, WIDTH):
        load(cells, first, batch)
        for j in range(WIDTH):
            block = interface_of(given(batch, j), NEWMARK, options.g)
            amplitude, onset, mode = batch.amplitude[j], block.yield_acceleration, block.sliding_mode
            at_rest = 0.0 if mode == STUCK else math.nan
            slide = options.cycles * newmark_slide(onset, amplitude)
            batch.displacement[j] = slide if mode > STUCK else at_rest
            batch.peak_velocity[j] = at_rest
            batch.yield_acceleration[j], batch.sliding_mode[j], batch.validity[j] = onset, mode, block.validity
        if options.wants_peak:
            for j in range(WIDTH):
                amplitude, onset = batch.amplitude[j], batch.yield_acceleration[j]
                to_peak = held_gains(amplitude, onset, rising_phase(onset, amplitude), 0.0)[0]
                at_rest = batch.peak_velocity[j]
                batch.peak_velocity[j] = 2.0 * to_peak if batch.sliding_mode[j] > STUCK else at_rest
        for j in range(batch.used):
            cell = first + j
            results[DISPLACEMENT, cell], results[PEAK_VELOCITY, cell] = batch.displacement[j], batch.peak_velocity[j]
            results[SLIDING_MODE, cell], results[VALIDITY, cell] = batch.sliding_mode[j], batch.validity[j]
    return 0
