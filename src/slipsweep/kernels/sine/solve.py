"""The cells of a tile under a sine: put into batches by the kind of their motion, and solved batch by batch."""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar
from slipsweep.kernels.block import (
    MONOTONE,
    NEWMARK,
    NO_VALUE,
    UNSOLVED,
    YIELD_GOVERNS,
    Options,
    settled,
    without_estimates,
)
from slipsweep.kernels.sine import kinds, pulse
from slipsweep.kernels.sine.alone import rise_alone
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
from slipsweep.kernels.sine.continuous import find_peak_velocity, slide_on
from slipsweep.kernels.slide import LOG, SLIDE, Slide
from slipsweep.model.equations import STUCK
from slipsweep.motion.paths import Base


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


@inlined
def go_on_alone(source: Batch, k: int, options: Options, alone: Batch) -> None:
    """Append cell k of a batch to those that are solved alone, with the pulses that it has left."""
    j = alone.used
    append(source, k, source.cell[k], alone)
    pulse.begin(alone, j, options)
    if source.solved[k] > 0.0:
        alone.pulses[j] = source.pulses[k]
        alone.entered[j] = source.entered[k]
        alone.total[j] = source.total[k]
        alone.highest[j] = source.highest[k]
        alone.validity[j] = source.validity[k]


@scalar
def solve_pulses(
    batch: Batch, kind: int, options: Options, base: Base, slide: Slide, log: np.ndarray
) -> None:
    """Solve a batch of cells of a kind of stick-slip into `total`, `highest` and `validity`.

    Pulses of another kind, which may follow the first one, are left in `pulses`.  Those that are
    solved alone go on from where they are.
    """
    if kind != kinds.SLIPS_ALONE:
        for k in range(WIDTH):
            pulse.begin(batch, k, options)
    while True:
        if kind == kinds.SLIPS_ALONE:
            rise_alone(batch, options, base, slide, log)
        else:
            pulse.begin_to_slide(batch, kind, options.g)
            pulse.rise(batch, kind, options.g)
        pulse.fall(batch, options)
        others = pulse.repeat(batch, options)
        if others == 0 or kind != kinds.SLIPS_ALONE:
            break


@inlined
def is_solved(batch: Batch, k: int) -> bool:
    """Return whether all of a cell's events were found, and no pulse is left; sums may overflow."""
    found = batch.solved[k] > 0.0 and batch.pulses[k] == 0.0
    return found and not math.isnan(batch.total[k])


@inlined
def goes_on_alone(kind: int, options: Options) -> bool:
    """Return whether an unsolved cell of a kind is solved alone; Newmark's block has no Eq. 4."""
    return kind < kinds.SLIPS_ALONE and options.rise != NEWMARK


@inlined
def store_cell(batch: Batch, k: int, kind: int, options: Options, results: np.ndarray) -> None:
    """Write the results of cell k of a batch."""
    cell = batch.cell[k]
    validity = int(results[VALIDITY, cell]) | int(batch.validity[k])
    if options.rise == MONOTONE and (kind == kinds.HELD_AT_YIELD or kind == kinds.SLIPS_ALONE):
        yields = batch.yield_acceleration[k]
        governs = batch.level[k] == yields and batch.held[k] == yields
        validity |= YIELD_GOVERNS if governs else 0
    validity = without_estimates(validity)
    results[VALIDITY, cell] = settled(validity, batch.total[k], batch.amplitude[k])
    if validity & NO_VALUE:
        results[DISPLACEMENT, cell] = math.nan
        results[PEAK_VELOCITY, cell] = math.nan
        results[SLIDING_MODE, cell] = -1.0
    else:
        results[DISPLACEMENT, cell] = batch.total[k]
        results[PEAK_VELOCITY, cell] = batch.highest[k]


@scalar
def solve_batch(
    batch: Batch,
    kind: int,
    options: Options,
    base: Base,
    slide: Slide,
    log: np.ndarray,
    results: np.ndarray,
) -> int:
    """Solve a batch of cells of one kind, store their results, and empty it.

    Returns how many cells are left.  Those that are not solved by this kind, but may be alone, are
    not among them, and are not stored.
    """
    used = batch.used
    for k in range(used, WIDTH):
        append(batch, k - used, batch.cell[k - used], batch)
    batch.used = used
    if kind >= kinds.CONTINUES:
        slide_on(batch, kind, options, base, slide)
        if options.wants_peak:
            find_peak_velocity(batch, kind, options, base, slide)
    else:
        solve_pulses(batch, kind, options, base, slide, log)
    left = 0
    for k in range(used):
        if is_solved(batch, k):
            store_cell(batch, k, kind, options, results)
        elif not goes_on_alone(kind, options):
            results[VALIDITY, batch.cell[k]] = UNSOLVED
            left += 1
    batch.used = 0
    return left


@scalar
def solve_kind(
    batches: np.ndarray,
    kind: int,
    options: Options,
    base: Base,
    slide: Slide,
    log: np.ndarray,
    results: np.ndarray,
) -> int:
    """Solve the batch of a kind, and alone those cells of it that are not of this kind.

    Those have other pulses after the first, or an iteration that came to no end.  Returns how many
    cells are left.
    """
    batch = batches[kind]
    alone = batches[kinds.SLIPS_ALONE]
    used = batch.used
    left = solve_batch(batch, kind, options, base, slide, log, results)
    for k in range(used if goes_on_alone(kind, options) else 0):
        if not is_solved(batch, k):
            go_on_alone(batch, k, options, alone)
            if alone.used == WIDTH:
                left += solve_batch(alone, kinds.SLIPS_ALONE, options, base, slide, log, results)
    return left


@kernel
def solve_sine(
    cells: np.ndarray,
    options: Options,
    base: Base,
    batches: np.ndarray,
    slides: np.ndarray,
    log: np.ndarray,
    results: np.ndarray,
) -> int:
    """Solve cells under a sine into W, V, mode and validity, the first rows of `results`.

    `results` is (fields of `Motion`, cells), `base` begins with the rising quarter of the sine, and
    the three arrays before are those of `workspace_of_sine`.  Returns how many cells are left to
    the kernel that solves any waveform: their validity is `UNSOLVED`.
    """
    slide = slides[0]
    for kind in range(kinds.KINDS):
        batches[kind].used = 0
    loaded = batches[kinds.KINDS]
    left = 0
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
            else:
                if kind == kinds.SLIPS_ALONE:
                    pulse.begin(batches[kind], batches[kind].used, options)
                append(loaded, j, cell, batches[kind])
                if batches[kind].used == WIDTH:
                    left += solve_kind(batches, kind, options, base, slide, log, results)
    for kind in range(kinds.KINDS):
        if batches[kind].used > 0:
            left += solve_kind(batches, kind, options, base, slide, log, results)
    return left


def workspace_of_sine() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `solve_sine` writes into: batches, the slide, and a log without rows."""
    return np.empty(kinds.KINDS + 1, BATCH), np.zeros(1, SLIDE), np.zeros(0, LOG)
