"""The cells of a tile under a sine: put into batches by the kind of their motion, and solved batch by batch."""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar
from slipsweep.kernels import block as physics
from slipsweep.kernels.sine import kinds, pulse
from slipsweep.kernels.sine.batch import (
    BATCH,
    DISPLACEMENT,
    PEAK_VELOCITY,
    VALIDITY,
    WIDTH,
    Batch,
    load,
)
from slipsweep.kernels.sine.continuous import find_peak_velocity, slide_on
from slipsweep.model.equations import STUCK


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
def solve_batch(batch: Batch, kind: int, options: physics.Options, results: np.ndarray) -> int:
    """Solve a batch of cells of one kind, store what was found, and empty it; how many cells remain unsolved."""
    used = batch.used
    for k in range(used, WIDTH):
        append(batch, k - used, batch.cell[k - used], batch)
    if kind == kinds.SLIDES_ON:
        slide_on(batch, options)
        if options.wants_peak:
            find_peak_velocity(batch, options)
    else:
        pulse.begin_to_slide(batch, kind, options.g)
        pulse.rise(batch, kind, options.g)
        pulse.fall(batch, options)
        pulse.repeat(batch, kind, options)
    governs = (
        physics.YIELD_GOVERNS
        if kind == kinds.YIELD_GOVERNS and options.rise != physics.NEWMARK
        else 0
    )
    unsolved = 0
    for k in range(used):
        cell = batch.cell[k]
        displacement = batch.displacement[k]
        validity = physics.without_estimates(
            int(results[VALIDITY, cell]) | int(batch.validity[k]) | governs
        )
        solved = batch.solved[k] > 0.0 and not math.isnan(displacement)  # where sums overflow
        results[DISPLACEMENT, cell] = displacement
        results[PEAK_VELOCITY, cell] = batch.peak_velocity[k]
        results[VALIDITY, cell] = (
            physics.settled(validity, displacement, batch.amplitude[k])
            if solved
            else physics.UNSOLVED
        )
        unsolved += 0 if solved else 1
    batch.used = 0
    return unsolved


@kernel
def solve_sine(cells: np.ndarray, options: physics.Options, results: np.ndarray) -> int:
    """Solve cells under a sine into W, V, mode and validity, the first rows of `results`, (fields of `Motion`, cells).

    Returns how many are left to the kernel that solves any waveform: their validity is `UNSOLVED`.
    """
    batches = np.empty(kinds.KINDS + 1, BATCH)
    for kind in range(kinds.KINDS):
        batches[kind].used = 0
    loaded = batches[kinds.KINDS]
    unsolved = 0
    for first in range(0, cells.size, WIDTH):
        load(cells, first, loaded)
        kinds.classify(loaded, first, options, results)
        for j in range(loaded.used):
            kind = loaded.kind[j]
            cell = first + j
            if kind == kinds.RESTS:
                at_rest = 0.0 if loaded.sliding_mode[j] >= STUCK else math.nan
                results[DISPLACEMENT, cell] = results[PEAK_VELOCITY, cell] = at_rest
            elif kind == kinds.OTHER:
                results[VALIDITY, cell] = physics.UNSOLVED
                unsolved += 1
            else:
                append(loaded, j, cell, batches[kind])
                if batches[kind].used == WIDTH:
                    unsolved += solve_batch(batches[kind], kind, options, results)
    for kind in range(kinds.KINDS):
        if batches[kind].used > 0:
            unsolved += solve_batch(batches[kind], kind, options, results)
    return unsolved
