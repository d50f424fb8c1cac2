"""The exact walk of the paper's law: a cell from pulse to pulse, under a wave or a record.

One kernel, compiled once: a sweep takes the results at the end of the walk, a time history the
samples that it passes (`slipsweep.kernels.sampling`).  Cycles of a wave that are alike are not gone
through one by one (docs/numerics.md#trains-of-pulses), but for samples.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import inlined, scalar, single
from slipsweep.kernels.base import phase_at
from slipsweep.kernels.block import (
    EQ12,
    FRICTION_ESTIMATED,
    FRICTION_NOT_DECAYING,
    LIMIT_UNDEFINED,
    NEAR_MODE_LIMIT,
    NO_VALUE,
    NOT_RECOUPLED,
    STATICALLY_UNSTABLE,
    UNSOLVED,
    UPLIFT,
    YIELD_GOVERNS,
    Cell,
    Interface,
    Motion,
    Options,
    interface_of,
    remarks_on,
    settled,
    store,
)
from slipsweep.kernels.continuous import (
    KEPT_LAGS,
    continuous_pulse,
    find_velocity_extremes,
    follow_eq4,
)
from slipsweep.kernels.eq4 import Block, block_of, stays_at_yield
from slipsweep.kernels.grid import cell_at
from slipsweep.kernels.slide import SLIDE, Slide, begin_pulse
from slipsweep.kernels.stick_slip import Place, beginning, first_pulse, stick_slip_pulse
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Path

#: How far a cell has come.
WALK = np.dtype(
    (
        np.record,
        np.dtype(
            [
                # V and W; what W lacks of Kahan's sum, as a record has up to a million pulses
                ("velocity", np.float64),
                ("displacement", np.float64),
                ("lost", np.float64),
                ("peak", np.float64),
                ("validity", np.int64),
                ("slips", np.float64),
                ("stick_slip_pulses", np.float64),
                ("continuous_pulses", np.float64),
                # the interval of the next pulse
                ("interval", np.int64),
                # plain cycles that are left, and the interval of their first pulse
                ("left", np.int64),
                ("first", np.int64),
                # of the cycle gone through last: V at its beginning, W gained, the largest and the
                # least V
                ("entered", np.float64),
                ("gained", np.float64),
                ("highest", np.float64),
                ("least", np.float64),
                # an earlier cycle, to whose V the walk may come back, and the next to remember
                ("seen_velocity", np.float64),
                ("seen_displacement", np.float64),
                ("seen_at", np.int64),
                ("next_look", np.int64),
                ("done", np.int64),
            ],
            align=True,
        ),
    )
)

#: A record of WALK.
Walk: TypeAlias = Any


@scalar
def begin(walk: Walk, path: Path) -> None:
    """Set a walk to the beginning of the motion."""
    walk.velocity = 0.0
    walk.displacement = 0.0
    walk.lost = 0.0
    walk.peak = 0.0
    walk.validity = 0
    walk.slips = 0.0
    walk.stick_slip_pulses = 0.0
    walk.continuous_pulses = 0.0
    walk.interval = 0
    walk.left = path.repeats
    walk.first = -1
    walk.seen_velocity = 0.0
    walk.seen_displacement = 0.0
    walk.seen_at = 0
    walk.next_look = 1
    walk.done = 0


@scalar
def add(walk: Walk, displacement: float) -> None:
    """Add a displacement to W, by Kahan's sum."""
    term = displacement - walk.lost
    total = walk.displacement + term
    walk.lost = (total - walk.displacement) - term
    walk.displacement = total


# ------------------------------------------------------------------------------ pulse by pulse


@scalar
def block_in_pulse(cell: Cell, peak: float, options: Options) -> tuple[Block, Interface]:
    """Return the block in a pulse of that peak, whose Eqs. 7-11 and λ are of the peak."""
    in_pulse = Cell(
        cell.tan_theta,
        cell.mu_s,
        peak,
        cell.yield_acceleration,
        cell.decay_rate,
        cell.delta_mu,
        cell.minimum_friction,
    )
    interface = interface_of(in_pulse, options.rise, options.g)
    return block_of(in_pulse, cell.amplitude, interface, options), interface


@scalar
def flags_of_pulse(
    cell: Cell, block: Block, interface: Interface, continuous: bool, peak: float
) -> int:
    """Return the flags of a pulse of a record, with that peak."""
    flags = remarks_on(cell, interface.acceleration_ratio)
    flags |= interface.validity & FRICTION_NOT_DECAYING
    if not continuous and stays_at_yield(block, block.yield_acceleration, peak):
        flags = YIELD_GOVERNS | (flags & ~FRICTION_ESTIMATED)
    return flags


@inlined
def cycles_before(path: Path, walk: Walk) -> int:
    """Return how many cycles more have passed than the path has, which has the plain cycle once."""
    passed = path.repeats - walk.left
    return passed - 1 if 0 < passed == path.repeats else passed


@scalar
def prepare_samples(walk: Walk, path: Path, place: Place, velocity: float, slide: Slide) -> None:
    """Set the phase, V and W at the beginning of a pulse, to which its samples add."""
    piece = path.base.pieces[place.piece]
    slide.began = phase_at(piece, place.tau)
    slide.velocity_before = velocity
    slide.displacement_before = walk.displacement
    slide.phases_before = 2.0 * math.pi * cycles_before(path, walk)


@scalar
def begin_cycle(walk: Walk) -> None:
    """Note V at the beginning of a plain cycle, with which its extremes begin."""
    walk.entered = walk.velocity
    walk.gained = 0.0
    walk.highest = walk.velocity
    walk.least = walk.velocity


@scalar
def add_pulse(walk: Walk, slide: Slide, continuous: bool) -> None:
    """Add a pulse to the walk; an event that was not found has made its W or the largest V NaN."""
    walk.continuous_pulses += 1.0 if continuous else 0.0
    walk.stick_slip_pulses += 0.0 if continuous else 1.0
    walk.slips += slide.slips
    walk.velocity = slide.velocity
    walk.peak = max(slide.peak, walk.peak)
    walk.highest = max(slide.peak, walk.highest)
    walk.least = min(slide.least, walk.least)
    walk.gained += slide.displacement
    add(walk, slide.displacement)
    if math.isnan(slide.displacement + slide.peak) and walk.validity & NO_VALUE == 0:
        walk.validity |= UNSOLVED


@scalar
def pass_over_cycles(options: Options, path: Path, walk: Walk) -> None:
    """Pass over cycles that are like the one gone through last.

    docs/numerics.md#trains-of-pulses
    """
    walk.done += 1
    gained = walk.velocity - walk.entered
    if walk.entered == 0.0 and walk.velocity == 0.0:
        # all cycles; the last one, too, which Eq. 12 ends in the same way though no pulse follows
        last = path.last_alike and options.recoupling == EQ12
        add(walk, (walk.left + path.alike + (1 if last else 0)) * walk.gained)
        walk.left = 0
        until = path.cycles[path.lead + 1 + path.alike].first
        while walk.interval < path.intervals.size and (
            last or path.intervals[walk.interval].first < until
        ):
            walk.interval += 1
    elif walk.least > 0.0:
        # the block never rests: V changes by the same amount each time
        alike = float(walk.left)
        if gained < 0.0:
            alike = min(alike, float(math.floor(walk.least / -gained)))
        add(walk, alike * walk.gained + math.pi * gained * alike * (alike + 1.0))
        walk.velocity += alike * gained
        walk.left -= int(alike)
        walk.done += int(alike)
        if gained > 0.0:
            walk.peak = max(walk.peak, walk.highest + alike * gained)
    elif walk.velocity == walk.seen_velocity:
        # what lies between has come back to where it was
        period = walk.done - walk.seen_at
        add(walk, (walk.left // period) * (walk.displacement - walk.seen_displacement))
        walk.left -= walk.left // period * period
        walk.seen_velocity = -1.0  # no further period fits
    elif walk.done == walk.next_look:
        remember(walk)
        walk.next_look *= 2


@scalar
def remember(walk: Walk) -> None:
    """Remember V and W at the end of a cycle, to which the walk may come back."""
    walk.seen_velocity = walk.velocity
    walk.seen_displacement = walk.displacement
    walk.seen_at = walk.done


@single
def walk_pulses(
    cell: Cell,
    block: Block,
    options: Options,
    path: Path,
    walk: Walk,
    slide: Slide,
    lags: np.ndarray,
    samples: np.ndarray,
) -> None:
    """Go from pulse to pulse.

    Under a wave the pulses of the plain cycle come again and again; of a record each has the
    friction of its own peak, and may be one of continuous sliding.
    """
    plain = path.cycles[path.lead].first
    plain_end = path.cycles[path.lead + 1].first if path.repeats > 0 else plain
    continuous = False
    following = -1
    ends = Place(0, 0.0)
    walk.interval = first_pulse(block, path, walk.interval)
    while walk.interval < path.intervals.size and walk.validity & NO_VALUE == 0:
        if samples.size and slide.sampled == samples.shape[1]:
            break
        k = walk.interval
        interval = path.intervals[k]
        repeats = walk.left > 0 and plain <= interval.first < plain_end
        if repeats and walk.first < 0:
            walk.first = k
            remember(walk)
        if k == walk.first:
            begin_cycle(walk)
        if path.recorded:
            peak = cell.amplitude * interval.height
            block, interface = block_in_pulse(cell, peak, options)
            continuous = peak > interface.limiting_acceleration
            walk.validity |= flags_of_pulse(cell, block, interface, continuous, peak)
            if walk.validity & NO_VALUE:
                break
        start = ends if k == following else beginning(block, path, k)
        following = first_pulse(block, path, k + 1)
        ends = beginning(block, path, following)
        if samples.size:
            velocity = walk.velocity if continuous else 0.0
            prepare_samples(walk, path, start, velocity, slide)
        flags = 0
        if continuous:
            find_velocity_extremes(block, options.wants_peak, path, slide)
            continuous_pulse(
                block, path, k, start, following, ends, walk.velocity, slide, lags, samples
            )
        else:
            # v never goes below 0: a velocity upslope, left by a continuous pulse, is neglected
            begin_pulse(slide, max(walk.velocity, 0.0))
            recoupling = options.recoupling
            flags = stick_slip_pulse(
                block, recoupling, path.base, start, interval.end, ends, slide, samples
            )
            slides_on = slide.velocity > 0.0 and flags == 0 and following < path.intervals.size
            if slides_on:
                flags = NOT_RECOUPLED
        walk.validity |= flags
        add_pulse(walk, slide, continuous)
        walk.interval = following
        last = following == path.intervals.size or path.intervals[following].first >= plain_end
        if repeats and last:
            walk.left -= 1
            if samples.size == 0:
                pass_over_cycles(options, path, walk)
                walk.interval = first_pulse(block, path, walk.interval)
            if walk.left > 0:
                walk.interval = walk.first


# ---------------------------------------------------------------------------- continuous sliding


@single
def slide_through_cycles(
    block: Block,
    options: Options,
    path: Path,
    walk: Walk,
    slide: Slide,
    lags: np.ndarray,
    samples: np.ndarray,
) -> None:
    """Slide continuously from the first Üg ≥ Üy to the end of a wave.

    Cycles of one shape, one after the other, are a series; for samples each is gone through.
    docs/numerics.md#continuous-sliding
    """
    start = beginning(block, path, first_pulse(block, path, walk.interval))
    find_velocity_extremes(block, options.wants_peak, path, slide)
    shape = -1  # of the cycle whose gains are in `walk.gained` and the two that follow
    shape_of_lags = -1
    cycle_velocity = 0.0
    while walk.done < options.cycles:
        if samples.size and slide.sampled == samples.shape[1]:
            break
        c = walk.done - cycles_before(path, walk)
        place = Place(path.cycles[c].first, path.base.pieces[path.cycles[c].first].begin)
        end = Place(path.cycles[c + 1].first, -math.inf)
        alike = 1
        if walk.slips == 0.0:
            place = start
        elif samples.size == 0 and walk.left > 0 and c == path.lead:
            alike = walk.left
        slides = end.piece > start.piece
        new = place.piece == start.piece or path.cycles[c].shape != shape
        if slides and (new or samples.size):
            if samples.size:
                prepare_samples(walk, path, place, walk.velocity, slide)
            if path.cycles[c].shape != shape_of_lags:
                shape_of_lags = path.cycles[c].shape
                for i in range(lags.size):
                    lags[i].known = False
            first = path.cycles[c].first
            follow_eq4(block, path.base, place, end, first, slide, lags, samples)
            shape = path.cycles[c].shape if walk.slips > 0.0 else -1
            cycle_velocity = slide.velocity
            walk.gained = slide.displacement
            walk.highest = slide.peak
        if slides:
            walk.slips = 1.0
            later = alike - 1.0
            fastest = max(walk.velocity, walk.velocity + later * cycle_velocity)
            walk.peak = max(fastest + walk.highest, walk.peak)
            series = math.pi * (2.0 * walk.velocity + cycle_velocity * later)
            add(walk, alike * (walk.gained + series))
            walk.velocity += alike * cycle_velocity
        walk.done += alike
        if c == path.lead and walk.left > 0:
            walk.left -= alike


# ---------------------------------------------------------------------------------------- a cell


@single
def yield_governs(block: Block, path: Path) -> bool:
    """Return True if b = Üy throughout: E is nowhere above Üy where the base rises or jumps to."""
    for i in range(path.rises.shape[0]):
        low = max(block.amplitude * path.rises[i, 0], block.yield_acceleration)
        high = block.amplitude * path.rises[i, 1]
        if high > block.yield_acceleration and not stays_at_yield(block, low, high):
            return False
    return True


@scalar
def validity_before(
    cell: Cell, block: Block, interface: Interface, options: Options, path: Path
) -> int:
    """Return the flags that are known before the motion."""
    if path.recorded:
        # n = g + Üg tan θ is least where the base's acceleration is lowest
        validity = interface.validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED)
        normal = eq.normal_acceleration(cell.amplitude * path.lowest, cell.tan_theta, options.g)
        return validity | (UPLIFT if normal <= 0.0 else 0)
    # ramps may keep the shaking below its peak, and a block from sliding
    if block.amplitude * path.highest <= block.yield_acceleration:
        return interface.validity & ~(NEAR_MODE_LIMIT | FRICTION_ESTIMATED)
    if interface.sliding_mode == eq.STICK_SLIP and yield_governs(block, path):
        return (interface.validity | YIELD_GOVERNS) & ~FRICTION_ESTIMATED
    return interface.validity


@scalar
def motion_of(cell: Cell, path: Path, mode: int, walk: Walk) -> Motion:
    """Return the results of a walk; a record has no mode, but counts of pulses, a
    wave no counts.
    """
    largest = cell.amplitude
    if path.recorded:
        largest *= max(path.highest, -path.lowest)
    validity = settled(walk.validity, walk.displacement, largest)
    if validity & NO_VALUE != 0:
        walk.displacement = math.nan
        walk.peak = math.nan
        walk.slips = -1.0
        walk.stick_slip_pulses = -1.0
        walk.continuous_pulses = -1.0
        mode = -1
    return Motion(
        walk.displacement,
        walk.peak,
        math.nan if path.recorded else float(mode),
        float(validity),
        walk.slips if path.recorded else math.nan,
        walk.stick_slip_pulses if path.recorded else math.nan,
        walk.continuous_pulses if path.recorded else math.nan,
    )


@kernel
def solve_walk(
    cells: np.ndarray,
    options: Options,
    path: Path,
    walks: np.ndarray,
    slides: np.ndarray,
    lags: np.ndarray,
    samples: np.ndarray,
    results: np.ndarray,
) -> None:
    """Solve the cells of a tile exactly; `results` is (fields of `Motion`, cells).

    The other arrays are those of `workspace_of`; samples are of a single cell.
    """
    walk = walks[0]
    slide = slides[0]
    for j in range(cells.size):
        cell = cell_at(cells, j)
        highest = cell.amplitude * path.highest
        block, interface = block_in_pulse(
            cell, highest if path.recorded else cell.amplitude, options
        )
        mode = interface.sliding_mode
        series = mode == eq.CONTINUOUS and not path.recorded
        begin(walk, path)
        walk.validity = validity_before(cell, block, interface, options, path)
        slide.sampled = 0
        slide.wants_peak = options.wants_peak
        if walk.validity & NO_VALUE or highest <= block.yield_acceleration:
            pass
        elif series:
            slide_through_cycles(block, options, path, walk, slide, lags, samples)
        else:
            walk_pulses(cell, block, options, path, walk, slide, lags, samples)
        store(motion_of(cell, path, mode, walk), j, results)


def workspace_of(path: Path, count: int = 0) -> tuple[np.ndarray, ...]:
    """Return what `solve_walk` writes into: walk, slide, lags on a cycle, and `count` samples."""
    most = 0 if path.recorded else int(np.diff(path.cycles["first"]).max())
    return (
        np.zeros(1, WALK),
        np.zeros(1, SLIDE),
        np.zeros(most, KEPT_LAGS),
        np.zeros((5, count)),
    )
