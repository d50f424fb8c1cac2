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
from slipsweep.model.equations import CONTINUOUS, STICK_SLIP, STUCK


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
    target.validity_before[k] = source.validity_before[j]
    target.used = k + 1


@scalar
def store(batch: Batch, used: int, kind: int, options: Options, results: np.ndarray) -> None:
    """Write the results of the first cells of a batch."""
    mode = STICK_SLIP if kind < kinds.SLIDES_ON or kind == kinds.SLIPS_ALONE else CONTINUOUS
    governs = kind == kinds.STAYS_AT_YIELD and options.rise != NEWMARK
    of_the_kind = YIELD_GOVERNS if governs else 0
    for j in range(WIDTH):
        displacement = batch.displacement[j]
        validity = int(batch.validity_before[j]) | int(batch.validity[j]) | of_the_kind
        validity = settled(without_estimates(validity), displacement, batch.amplitude[j])
        valueless = validity & NO_VALUE != 0
        batch.displacement[j] = math.nan if valueless else displacement
        batch.peak_velocity[j] = math.nan if valueless else batch.peak_velocity[j]
        batch.sliding_mode[j] = -1.0 if valueless else mode
        # where sums overflow W is no number, either
        is_solved = (batch.solved[j] > 0.0) & (not math.isnan(displacement))
        batch.validity[j] = validity if is_solved else UNSOLVED
    for j in range(used):
        cell = batch.cell[j]
        results[DISPLACEMENT, cell] = batch.displacement[j]
        results[PEAK_VELOCITY, cell] = batch.peak_velocity[j]
        results[SLIDING_MODE, cell] = batch.sliding_mode[j]
        results[VALIDITY, cell] = batch.validity[j]


@scalar
def common_kind(batch: Batch) -> int:
    """Return the kind of all cells of a full batch; `RESTS` if they are of several."""
    kind = batch.kind[0]
    others = WIDTH - batch.used
    for j in range(WIDTH):
        others += 1 if batch.kind[j] != kind else 0
    return kind if others == 0 else kinds.RESTS


@single
def distribute(loaded: Batch, batches: np.ndarray, alone: bool, results: np.ndarray) -> None:
    """Append the cells of a batch to those of their kinds, or to be solved `alone`."""
    for j in range(loaded.used):
        kind = loaded.kind[j]
        cell = loaded.cell[j]
        if kind == kinds.RESTS:
            at_rest = 0.0 if loaded.sliding_mode[j] >= STUCK else math.nan
            results[DISPLACEMENT, cell] = at_rest
            results[PEAK_VELOCITY, cell] = at_rest
            results[SLIDING_MODE, cell] = loaded.sliding_mode[j]
            results[VALIDITY, cell] = loaded.validity_before[j]
            continue
        if alone:
            slides_on = loaded.sliding_mode[j] == CONTINUOUS
            kind = kinds.SLIDES_ALONE if slides_on else kinds.SLIPS_ALONE
        append(loaded, j, cell, batches[kind])


@scalar
def ready_kind(batches: np.ndarray, needed: int) -> int:
    """Return the first kind of which as many cells wait as are needed; `RESTS` if none do."""
    for kind in range(kinds.KINDS):
        if batches[kind].used >= needed:
            return kind
    return kinds.RESTS


@single
def solve_batch(batch: Batch, kind: int, options: Options, results: np.ndarray) -> None:
    """Solve the first cells of one kind, store their results, and leave the others in the batch."""
    used = batch.used if batch.used < WIDTH else WIDTH
    for k in range(used, WIDTH):
        append(batch, k - used, batch.cell[k - used], batch)
    batch.is_short = kind == kinds.SLIDES_ON
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
    store(batch, used, kind, options, results)
    waiting = batch.used - WIDTH
    batch.used = 0
    for k in range(WIDTH, WIDTH + waiting):
        append(batch, k, batch.cell[k], batch)


@kernel
def solve_sine(cells: np.ndarray, options: Options, alone: bool, results: np.ndarray) -> None:
    """Solve cells under a sine into W, V, mode and validity, the first rows of `results`.

    `results` is (fields of `Motion`, cells).  Where the validity is then `UNSOLVED` a batch has not
    found an event, and the cell has to be solved `alone`.
    """
    # zeros: a NaN in a lane that a kind does not set would keep its iterations from ending
    batches = np.zeros(kinds.KINDS + 1, BATCH)
    loaded = batches[kinds.KINDS]
    for first in range(0, cells.size, WIDTH):
        load(cells, first, loaded)
        kinds.classify(loaded, options)
        # along an axis of a sweep neighbours are mostly of one kind: they are solved where they are
        batch = loaded
        kind = kinds.RESTS if alone else common_kind(loaded)
        # when no more are to come, batches need not be full
        needed = WIDTH if first + WIDTH < cells.size else 1
        if kind == kinds.RESTS:
            distribute(loaded, batches, alone, results)
            kind = ready_kind(batches, needed)
            batch = batches[kind]
        while kind < kinds.KINDS:
            solve_batch(batch, kind, options, results)
            kind = ready_kind(batches, needed)
            batch = batches[kind]
