"""The cells of a tile under a sine: put into batches by the kind of their motion, and solved."""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar
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
def store_at_rest(batch: Batch, j: int, cell: int, results: np.ndarray) -> None:
    """Write the results of a cell that is stuck, or that has no value."""
    at_rest = 0.0 if batch.sliding_mode[j] >= STUCK else math.nan
    results[DISPLACEMENT, cell] = at_rest
    results[PEAK_VELOCITY, cell] = at_rest
    results[SLIDING_MODE, cell] = batch.sliding_mode[j]
    results[VALIDITY, cell] = batch.validity_before[j]


@inlined
def common_kind(batch: Batch) -> int:
    """Return the kind of all cells of a full batch; `RESTS` if they are of several."""
    kind = batch.kind[0]
    others = WIDTH - batch.used
    for j in range(WIDTH):
        others += 1 if batch.kind[j] != kind else 0
    return kind if others == 0 else kinds.RESTS


@scalar
def solve_batch(batch: Batch, kind: int, options: Options, results: np.ndarray) -> None:
    """Solve the cells of one kind in a batch, store their results, and empty the batch."""
    used = batch.used
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
            is_short = kind == kinds.SLIDES_ON
            slide_through_quarter(batch, is_short, options.g)
            if options.wants_peak:
                find_highest(batch, is_short, options.g)
        slide_through_cycles(batch, options)
    store(batch, used, kind, options, results)
    batch.used = 0


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
        kinds.classify(loaded, options)
        if alone:
            kinds.take_alone(loaded)
        kind = common_kind(loaded)
        if kind < kinds.KINDS:
            for j in range(WIDTH):
                loaded.cell[j] = first + j
            solve_batch(loaded, kind, options, results)
            continue
        for j in range(loaded.used):
            kind = loaded.kind[j]
            if kind == kinds.RESTS:
                store_at_rest(loaded, j, first + j, results)
                continue
            append(loaded, j, first + j, batches[kind])
            if batches[kind].used == WIDTH:
                solve_batch(batches[kind], kind, options, results)
    for kind in range(kinds.KINDS):
        if batches[kind].used > 0:
            solve_batch(batches[kind], kind, options, results)
