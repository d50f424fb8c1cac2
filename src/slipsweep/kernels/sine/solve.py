"""The cells of a tile under a sine: sorted into batches by the kind of their motion, and solved batch by batch."""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar
from slipsweep.kernels.block import UNSOLVED, Options, settled, without_estimates
from slipsweep.kernels.block import YIELD_GOVERNS as YIELD_GOVERNS_FLAG
from slipsweep.kernels.grid import Cells
from slipsweep.kernels.sine.batch import BATCH, WIDTH, Batch, load
from slipsweep.kernels.sine.continuous import slide_on
from slipsweep.kernels.sine.kinds import KINDS, OTHER, RESTS, SLIDES_ON, YIELD_GOVERNS, sort
from slipsweep.kernels.sine.pulse import solve_pulses
from slipsweep.model.equations import STUCK


@inlined
def put(source: Batch, j: int, target: Batch, k: int) -> None:
    """Put the block of cell j of a batch into place k of another."""
    target.amplitude[k] = source.amplitude[j]
    target.yield_acceleration[k] = source.yield_acceleration[j]
    target.mu_s[k] = source.mu_s[j]
    target.tan_theta[k] = source.tan_theta[j]
    target.delta_mu[k] = source.delta_mu[j]
    target.decay_rate[k] = source.decay_rate[j]
    target.yield_phase[k] = source.yield_phase[j]


@scalar
def solve_batch(batch: Batch, kind: int, used: int, options: Options, results: np.ndarray) -> int:
    """Solve a batch whose first `used` cells are of one kind, and store what was found; how many remain unsolved."""
    for k in range(used, WIDTH):
        put(batch, 0, batch, k)
    if kind == SLIDES_ON:
        slide_on(batch, options)
    else:
        solve_pulses(batch, kind, options)
    governs = YIELD_GOVERNS_FLAG if kind == YIELD_GOVERNS else 0
    unsolved = 0
    for k in range(used):
        cell, displacement = batch.cell[k], batch.displacement[k]
        validity = without_estimates(int(results[3, cell]) | int(batch.flags[k]) | governs)
        solved = batch.solved[k] > 0.0
        results[0, cell], results[1, cell] = displacement, batch.peak_velocity[k]
        results[3, cell] = settled(validity, displacement, batch.amplitude[k]) if solved else UNSOLVED
        unsolved += 0 if solved else 1
    return unsolved


@kernel
def solve_sine(cells: Cells, options: Options, results: np.ndarray) -> int:
    """Solve cells under a sine into W, V, mode and validity, the first rows of `results`, (fields of `Motion`, cells).

    Returns how many are left to the kernel that solves any waveform: their validity is `UNSOLVED`.
    """
    batches = np.zeros(KINDS + 1, BATCH)
    used = np.zeros(KINDS, np.int64)
    loaded = batches[KINDS]
    unsolved = 0
    for first in range(0, results.shape[1], WIDTH):
        size = min(WIDTH, results.shape[1] - first)
        load(cells, first, size, loaded)
        sort(loaded, first, size, options, results)
        for j in range(size):
            kind, cell = loaded.kind[j], first + j
            if kind == RESTS:
                at_rest = 0.0 if loaded.sliding_mode[j] >= STUCK else math.nan
                results[0, cell] = results[1, cell] = at_rest
            elif kind == OTHER:
                results[3, cell] = UNSOLVED
                unsolved += 1
            else:
                batch = batches[kind]
                put(loaded, j, batch, used[kind])
                batch.cell[used[kind]] = cell
                used[kind] += 1
                if used[kind] == WIDTH:
                    unsolved += solve_batch(batch, kind, WIDTH, options, results)
                    used[kind] = 0
    for kind in range(KINDS):
        if used[kind] > 0:
            unsolved += solve_batch(batches[kind], kind, used[kind], options, results)
    return unsolved
