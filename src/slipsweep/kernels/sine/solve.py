"""The cells of a tile under a sine: put into batches by the kind of their motion, and solved."""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.kernels.block import (
    NEWMARK,
    NO_VALUE,
    UNSOLVED,
    YIELD_GOVERNS,
    Options,
    settled,
    without_estimates,
)
from slipsweep.kernels.sine import kinds
from slipsweep.kernels.sine.alone import slide_alone, slip_alone
from slipsweep.kernels.sine.batch import (
    BATCH,
    DISPLACEMENT,
    PEAK_VELOCITY,
    SLIDING_MODE,
    VALIDITY,
    WIDTH,
    Batch,
    load,
)
from slipsweep.kernels.sine.continuous import (
    find_highest,
    slide_through_cycles,
    slide_through_quarter,
)
from slipsweep.kernels.sine.pulse import begin_to_slide, fall, repeat, rise
from slipsweep.model.equations import CONTINUOUS, STUCK


@inlined
def append(source: Batch, j: int, cell: int, target: Batch) -> None:
    """Append the block of cell j of a batch, a `cell` of the results, to another batch."""
    k = target.used
    target.cell[k] = cell
    target.amplitude[k] = source.amplitude[j]
    target.yield_acceleration[k] = source.yield_acceleration[j]
    target.mu_s[k] = source.mu_s[j]
    target.tan_theta[k] = source.tan_theta[j]
    target.delta_mu[k] = source.delta_mu[j]
    target.decay_rate[k] = source.decay_rate[j]
    target.yield_phase[k] = source.yield_phase[j]
    target.used = k + 1


@scalar
def store(batch: Batch, k: int, kind: int, options: Options, results: np.ndarray) -> None:
    """Write the results of cell k of a batch."""
    cell = batch.cell[k]
    displacement = batch.displacement[k]
    if batch.solved[k] == 0.0 or math.isnan(displacement):  # where sums overflow
        results[VALIDITY, cell] = UNSOLVED
        return
    validity = int(results[VALIDITY, cell]) | int(batch.validity[k])
    if kind == kinds.STAYS_AT_YIELD and options.rise != NEWMARK:
        validity |= YIELD_GOVERNS
    validity = settled(without_estimates(validity), displacement, batch.amplitude[k])
    valueless = validity & NO_VALUE != 0
    results[DISPLACEMENT, cell] = math.nan if valueless else displacement
    results[PEAK_VELOCITY, cell] = math.nan if valueless else batch.peak_velocity[k]
    results[SLIDING_MODE, cell] = -1.0 if valueless else results[SLIDING_MODE, cell]
    results[VALIDITY, cell] = validity


@single
def solve_batch(batch: Batch, kind: int, options: Options, results: np.ndarray) -> None:
    """Solve the first cells of one kind, store their results, and leave the others in the batch."""
    used = batch.used if batch.used < WIDTH else WIDTH
    for k in range(used, WIDTH):
        append(batch, k - used, batch.cell[k - used], batch)
    if kind == kinds.SLIPS_ALONE:
        slip_alone(batch, used, options)
    elif kind < kinds.SLIDES_ON:
        begin_to_slide(batch, kind, options.g)
        rise(batch, kind, options.g)
        fall(batch, options)
        repeat(batch, kind, options)
    else:
        if kind == kinds.SLIDES_ALONE:
            for j in range(used):
                slide_alone(batch, j, options)
        else:
            slide_through_quarter(batch, options.g)
            if options.wants_peak:
                find_highest(batch, options.g)
        slide_through_cycles(batch, options)
    for k in range(used):
        store(batch, k, kind, options, results)
    waiting = batch.used - WIDTH
    batch.used = 0
    for k in range(WIDTH, WIDTH + waiting):
        append(batch, k, batch.cell[k], batch)


@kernel
def solve_sine(cells: np.ndarray, options: Options, alone: bool, results: np.ndarray) -> None:
    """Solve cells under a sine into W, V, mode and validity, the first rows of `results`.

    `results` is (fields of `Motion`, cells).  Where the validity is then `UNSOLVED` a cell is of no
    kind that is solved in SIMD, and has to be solved `alone`.
    """
    # zeros: a NaN in a lane that a kind does not set would keep its iterations from ending
    batches = np.zeros(kinds.KINDS + 1, BATCH)
    for kind in range(kinds.KINDS):
        batches[kind].used = 0
    loaded = batches[kinds.KINDS]
    for first in range(0, cells.size, WIDTH):
        load(cells, first, loaded)
        kinds.classify(loaded, first, options, results)
        for j in range(loaded.used):
            kind = loaded.kind[j]
            cell = first + j
            if kind == kinds.RESTS:
                at_rest = 0.0 if loaded.sliding_mode[j] >= STUCK else math.nan
                results[DISPLACEMENT, cell] = at_rest
                results[PEAK_VELOCITY, cell] = at_rest
                continue
            if alone:
                slides_on = loaded.sliding_mode[j] == CONTINUOUS
                kind = kinds.SLIDES_ALONE if slides_on else kinds.SLIPS_ALONE
            elif kind >= kinds.SLIPS_ALONE:
                results[VALIDITY, cell] = UNSOLVED
                continue
            append(loaded, j, cell, batches[kind])
        # when no more are to come, batches need not be full
        needed = WIDTH if first + WIDTH < cells.size else 1
        for kind in range(kinds.KINDS):
            while batches[kind].used >= needed:
                solve_batch(batches[kind], kind, options, results)
