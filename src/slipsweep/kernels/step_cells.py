"""Cells that are stepped by `kernels.step`: their cycles, results and histories."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import as_value, inlined, registered, scalar, single
from slipsweep.kernels.block import (
    FRICTION_ESTIMATED,
    LIMIT_UNDEFINED,
    MAY_NOT_STOP,
    NEAR_MODE_LIMIT,
    NEWMARK,
    NO_VALUE,
    STATICALLY_UNSTABLE,
    UPLIFT,
    UPSLOPE,
    YIELD_GOVERNS,
    Cell,
    Options,
    given_or,
    settled,
    without_estimates,
)
from slipsweep.kernels.step import (
    ATTENUATES,
    BLOCK,
    CONTINUOUS,
    LOG,
    SIMPSON,
    STUCK,
    Block,
    Law,
    Step,
    Steps,
    attenuate,
    end_positive_half_wave,
    eq4_rate,
    moved_in_step,
    set_friction,
    unlimited,
    velocity_in_step,
    wait_for_eq4,
    walk,
    yield_governs,
)
from slipsweep.model import equations as eq
from slipsweep.motion.paths import PIECE, TERMS, Path

#: Parameters of strength that changes while the block slides (`kernels.step_newmark`).
STRENGTH_FIELDS = ("residual_mu", "weakening_distance", "fast_mu", "rate_constant")

#: The cells that are stepped: a `Cell`, the yield acceleration upslope (NaN, if the block slides
#: downslope only), the seconds in a unit of time, and the parameters of its strength (NaN, if it is
#: of another kind).
STEP_CELL = np.dtype(
    (
        np.record,
        [
            (name, "f8")
            for name in (*Cell._fields, "upslope_yield_acceleration", "seconds", *STRENGTH_FIELDS)
        ],
    )
)

#: Lengths of time after the shaking, each twice the one before: a block that still slides after as
#: many never comes to rest.
DOUBLINGS = 64


@registered
def exponential_friction(block: Block, ground: float, velocity: float, slip: float) -> float:
    """Eq. 6, the friction law of the paper, which does not depend on the motion."""
    return eq.friction_coefficient(ground, block.mu_s, block.delta_mu, block.decay_rate, block.g)


# ------------------------------------------------------------------ cycles


@scalar
def begin_cycle(block: Block) -> None:
    """Note how the block enters a cycle, whose extremes begin with its state there."""
    block.cycle_phase = block.phase
    block.cycle_held = block.held
    block.cycle_velocity = block.velocity
    block.cycle_displacement = block.displacement
    block.cycle_slip = block.slip
    block.largest_so_far = block.largest_velocity
    block.farthest_so_far = block.largest_displacement
    block.nearest_so_far = block.smallest_displacement
    block.largest_velocity = block.velocity
    block.least_velocity = block.velocity
    block.largest_displacement = block.displacement
    block.smallest_displacement = block.displacement


@scalar
def end_cycle(block: Block) -> None:
    """Note what the block gained in a cycle: V, and W less what V at the beginning makes of it.

    The extremes of V and W are from their values at the beginning.
    """
    displacement = block.cycle_displacement
    period = 2.0 * math.pi
    block.gained = block.velocity - block.cycle_velocity
    block.moved = block.displacement - displacement - period * block.cycle_velocity
    block.highest = block.largest_velocity - block.cycle_velocity
    block.farthest = block.largest_displacement - displacement
    block.nearest = block.smallest_displacement - displacement
    block.largest_velocity = max(block.largest_velocity, block.largest_so_far)
    block.largest_displacement = max(block.largest_displacement, block.farthest_so_far)
    block.smallest_displacement = min(block.smallest_displacement, block.nearest_so_far)


@scalar
def repetitions(law: Law, block: Block, left: int) -> int:
    """Return how often the next cycles of that shape, at most `left`, gain what the last one did.

    They do so if they begin in the same state; and also with a larger V, if friction does not
    depend on the motion and the block does not come to rest: then V is larger throughout by as
    much.  A block that weakens with the slip is never in the same state.
    """
    weakens = block.cycle_slip < block.weakens_until
    if block.phase != block.cycle_phase or block.held != block.cycle_held or weakens:
        return 0
    never_rests = block.phase == CONTINUOUS or block.least_velocity > 0.0
    faster = block.phase == CONTINUOUS or block.velocity >= block.cycle_velocity
    if never_rests and faster and not law.knows_motion:
        return left if block.gained >= 0.0 or block.phase == CONTINUOUS else 1
    if block.velocity == block.cycle_velocity:
        return left if block.gained == 0.0 else 1
    return 0


@scalar
def repeat(block: Block, count: int) -> None:
    """Add cycles that gain what the last one did."""
    period = 2.0 * math.pi
    later = count - 1.0
    velocity = block.velocity
    first = block.displacement
    last = first + later * (block.moved + period * velocity)
    highest = velocity + max(later * block.gained, 0.0) + block.highest
    block.velocity += count * block.gained
    block.displacement += count * (block.moved + period * (velocity + 0.5 * later * block.gained))
    block.largest_velocity = max(block.largest_velocity, highest)
    block.largest_displacement = max(block.largest_displacement, max(first, last) + block.farthest)
    block.smallest_displacement = min(block.smallest_displacement, min(first, last) + block.nearest)


@single
def walk_cycles(law: Law, block: Block, path: Path, steps: Steps, log: np.ndarray) -> None:
    """Go through all cycles; those that gain what the last one did are not walked again."""
    shape = -1  # of the last cycle that was walked
    n = 0
    for c in range(path.cycles.size - 1):
        left = path.repeats if path.repeats > 0 and c == path.lead else 1
        while left > 0 and block.validity & NO_VALUE == 0:
            count = 0
            if shape == path.cycles[c].shape and log.size == 0:
                count = repetitions(law, block, left)
            if count > 0:
                repeat(block, count)
            else:
                begin_cycle(block)
                first = path.cycles[c].first
                last = path.cycles[c + 1].first
                walk(law, block, path, steps, first, last, 2.0 * math.pi * (n - c), log)
                end_cycle(block)
                shape = path.cycles[c].shape
                count = 1
            left -= count
            n += count


@as_value
def run_out(law: Law, block: Block, path: Path, steps: Steps, log: np.ndarray) -> None:
    """After the shaking Eq. 12 takes V to 0.

    Continuous sliding under a waveform ends with the shaking.
    """
    end_positive_half_wave(block)
    valueless = block.validity & NO_VALUE != 0
    if valueless or block.phase == STUCK or (block.phase == CONTINUOUS and not block.recorded):
        return
    block.phase = ATTENUATES
    end = path.base.pieces[path.base.pieces.size - 1].end
    attenuate(block, log, end + 2.0 * math.pi * max(path.repeats - 1, 0), math.inf)


# ------------------------------------------------------------------ a cell


@scalar
def yield_governs_wave(law: Law, block: Block, path: Path) -> bool:
    """Return whether Eq. 4 stays at or below Üy on all rises above Üy, and wherever Üg jumps to."""
    for i in range(path.rises.shape[0]):
        low = max(block.amplitude * path.rises[i, 0], block.yield_acceleration)
        high = block.amplitude * path.rises[i, 1]
        if high > block.yield_acceleration and not yield_governs(law, block, low, high):
            return False
    return block.mode == eq.STICK_SLIP and not block.is_newmark


@scalar
def validity_before(block: Block, path: Path) -> int:
    """Set friction and mode for the peak of the shaking; return the flags before the motion."""
    if not block.recorded:
        interface = set_friction(block, block.amplitude)
        if block.amplitude * path.highest > block.yield_acceleration:
            return interface.validity
        # ramps keep the shaking below Üy
        return interface.validity & ~(NEAR_MODE_LIMIT | FRICTION_ESTIMATED)
    peak = block.amplitude * max(path.highest, -path.lowest)
    interface = set_friction(block, peak)
    lowest = eq.normal_acceleration(block.amplitude * path.lowest, block.tan_theta, block.g)
    uplift = UPLIFT if lowest <= 0.0 and not block.is_newmark else 0
    return uplift | interface.validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED)


@scalar
def put_at_rest(law: Law, block: Block, cell: np.record, options: Options) -> None:
    """Set what is given of a cell, and a block that has not moved."""
    block.amplitude = cell.amplitude
    block.tan_theta = cell.tan_theta
    block.mu_s = cell.mu_s
    block.given_yield_acceleration = cell.yield_acceleration
    block.given_decay_rate = cell.decay_rate
    block.given_delta_mu = cell.delta_mu
    block.given_minimum_friction = cell.minimum_friction
    block.upslope_yield_acceleration = given_or(cell.upslope_yield_acceleration, math.inf)
    block.slides_up = 0 if math.isnan(cell.upslope_yield_acceleration) else 1
    block.residual_mu = cell.residual_mu
    block.weakening_distance = cell.weakening_distance
    block.fast_mu = cell.fast_mu
    block.rate_constant = cell.rate_constant
    block.weakens_until = 0.0
    if law.knows_slip:
        distance = given_or(cell.weakening_distance, math.inf)
        block.weakens_until = distance / (cell.seconds * cell.seconds)
    block.g = options.g
    block.seconds = cell.seconds
    block.is_newmark = options.rise == NEWMARK
    block.rise = options.rise
    block.recoupling = options.recoupling
    block.phase = STUCK
    block.side = 1.0
    block.in_pulse = 0
    block.held = 0.0
    block.velocity = 0.0
    block.displacement = 0.0
    block.slip = 0.0
    block.least_velocity = 0.0
    block.largest_velocity = 0.0
    block.largest_displacement = 0.0
    block.smallest_displacement = 0.0
    block.slips = 0.0
    block.stick_slip_pulses = 0.0
    block.continuous_pulses = 0.0
    block.logged = 0


@scalar
def write_results(block: Block, mode: int, validity: int, result: np.ndarray) -> None:
    """Write the results of a cell, in the order of `RESULTS` of `kernels.block`."""
    result[3] = float(validity)
    if validity & NO_VALUE:
        result[:3] = math.nan
        result[2] = -1.0
        result[4:7] = -1.0
        result[7:] = math.nan
        return
    result[0] = block.displacement
    result[1] = block.largest_velocity
    result[2] = float(mode)
    result[4] = block.slips
    result[5] = block.stick_slip_pulses
    result[6] = block.continuous_pulses
    result[7] = max(block.largest_displacement, block.displacement)
    result[8] = min(block.smallest_displacement, block.displacement)
    result[9] = result[7] - result[8]


@single
def solve_cells(
    law: Law,
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile through the shaking, and on to rest, with a friction law.

    Arguments are those of `solve_steps`, which does so with the law of the paper.
    """
    block = blocks[0]
    for j in range(cells.size):
        put_at_rest(law, block, cells[j], options)
        block.validity = validity_before(block, path)
        mode = block.mode
        peak = block.amplitude * max(path.highest, -path.lowest)
        slides_up = block.amplitude * -path.lowest > block.upslope_yield_acceleration
        slides = slides_up or block.amplitude * path.highest > block.yield_acceleration
        if slides_up and mode == eq.STUCK:
            mode = eq.STICK_SLIP
        if block.validity & NO_VALUE == 0 and slides:
            if block.residual_mu <= block.tan_theta or block.fast_mu <= block.tan_theta:
                block.validity |= MAY_NOT_STOP
            if not block.recorded and yield_governs_wave(law, block, path):
                block.validity = without_estimates(block.validity | YIELD_GOVERNS)
            walk_cycles(law, block, path, steps, log)
            law.run_out(law, block, path, steps, log)
        validity = settled(block.validity, block.displacement, peak)
        if block.slides_up:
            validity &= ~UPSLOPE  # no caution for a block that slides both ways
        write_results(block, mode, validity, results[:, j])


@inlined
def paper_law(
    friction: Callable[..., float],
    knows_motion: bool,
    knows_slip: bool,
    longest_step: Callable[..., float],
) -> Law:
    """Return the law of a block of the paper with a friction of its own."""
    return Law(friction, knows_motion, knows_slip, longest_step, eq4_rate, wait_for_eq4, run_out)


@kernel
def solve_steps(
    cells: np.ndarray,
    options: Options,
    path: Path,
    blocks: np.ndarray,
    steps: Steps,
    log: np.ndarray,
    results: np.ndarray,
) -> None:
    """Step the cells of a tile with the friction law of the paper.

    `cells` are of dtype `STEP_CELL`; `blocks`, (1,), says how they are stepped (`blocks_of`); `log`
    is of dtype `LOG`, empty if no history is asked for; `results` is (`block.RESULTS`, cells).
    """
    law = paper_law(exponential_friction, False, False, unlimited)
    solve_cells(law, cells, options, path, blocks, steps, log, results)


# ------------------------------------------------------------------ for callers in Python


def steps_of(path: Path, rule: int, steps: int, steps_on_piece: int) -> Steps:
    """Return the base's motion at the points of all steps: so many in 2π, or on a piece.

    On a silent piece after the shaking there are as many steps, the same for all of them.
    """
    shaken = path.base.pieces
    length = shaken["finish"] - shaken["begin"]
    each = 2 if rule == SIMPSON else 1
    count = np.full(length.size, steps_on_piece)
    if steps_on_piece == 0:
        # 1e-9: a quarter of a cycle has N/4 steps whichever way its length is rounded
        count = np.maximum(np.ceil(length / (2.0 * math.pi) * steps - 1e-9), 1).astype(np.int64)
    sizes = each * count + 1
    # from the anchor of the piece, so that two that mirror each other have the same values
    first = np.cumsum(sizes) - sizes
    number = np.arange(sizes.sum()) - np.repeat(first, sizes)
    number -= np.repeat(np.where(shaken["begin"] == 0.0, 0, sizes - 1), sizes)
    tau = number * np.repeat(length / (each * count), sizes)
    total = np.repeat(shaken["slope"], sizes) * tau
    curved = np.flatnonzero(np.repeat(shaken["degree"] > 1, sizes))
    curve = np.repeat(shaken["curve"], sizes)[curved]
    total[curved] = 0.0
    for power in range(TERMS - 1, -1, -1):
        coefficient = path.base.curves["coefficients"][curve, power]
        total[curved] = (total[curved] + coefficient) * tau[curved]
    top = np.repeat(shaken["top"], sizes)
    silence = np.zeros(DOUBLINGS, PIECE)
    silence["finish"] = length.max() * 2.0 ** np.arange(DOUBLINGS)
    silence["start"] = shaken["end"][-1] + np.cumsum(silence["finish"]) - silence["finish"]
    silent = np.zeros(sizes.max())
    return Steps(
        wave=np.concatenate([np.copysign(top + total, top), silent]),
        first=np.append(first, np.full(DOUBLINGS, sizes.sum())),
        last=np.append(first + sizes, np.full(DOUBLINGS, sizes.sum() + silent.size)) - 1,
        pieces=np.append(shaken, silence),
    )


def blocks_of(rule: int, steps: int, steps_on_piece: int) -> np.ndarray:
    """Return the block that `solve_steps` moves, with how it is stepped."""
    blocks = np.zeros(1, BLOCK)
    blocks["rule"] = rule
    blocks["steps"] = steps
    blocks["recorded"] = steps_on_piece > 0
    return blocks


def samples_of(
    log: np.ndarray, phases: NDArray[np.float64], ground: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return Ü, V and W at phases, (samples,), from the steps of a log; `ground` is Üg there.

    In a step V is the cubic through its values and rates at both ends, and Ü a parabola.
    """
    before = np.zeros(1, LOG)
    before["time"] = -np.inf
    before["step"] = 1.0
    rows = np.concatenate([before, log])
    at = np.searchsorted(rows["time"], phases, side="right") - 1
    # a block rests from the end of a step on, if the next one begins from rest
    goes_on = np.append(rows["velocity"][1:] != 0.0, rows["phase"][-1] == CONTINUOUS)[at]
    row: Any = rows[at]
    step = row["step"]
    since = phases - row["time"]
    rests = (since > step) & ~goes_on
    part = np.clip(since / np.maximum(step, np.finfo(float).tiny), 0.0, 1.0)
    taken = Step(
        row["step"],
        0.0,
        0.0,
        0.0,
        row["first_rate"],
        0.0,
        row["last_rate"],
        row["gained"],
        0.0,
    )
    velocity = velocity_in_step(row["velocity"], taken, part)
    displacement = row["displacement"] + moved_in_step(row["velocity"], taken, part)
    bend = 2.0 * (row["first"] + row["last"] - 2.0 * row["middle"])
    block = row["first"] + part * (row["last"] - row["first"] - bend) + part**2 * bend
    block = np.where(row["phase"] == ATTENUATES, ground - row["first_rate"], block)
    return np.where(rests, ground, block), np.where(rests, 0.0, velocity), displacement
