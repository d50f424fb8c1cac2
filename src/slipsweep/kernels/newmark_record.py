"""Newmark's block under a record, exact: from sample to sample while it slides, one way or both.

Between two samples Üg is a straight line, and the rate of the speed is Üg less the yield
acceleration: the speed gained is the trapezoid's, and the block stops at a root of a quadratic.
Where nothing can happen in a whole run of lines, its sums give what the block gains along it
(`motion.samples`).  A block that slides upslope is one that slides downslope under −Üg: `side` is
the sign of V.  Times are those at scale 1, so that V and W are v and u.

A place on a line is the time that is `left` to its end, where |Üg| is largest if a slide begins: a
slide just above yield keeps all its digits.  docs/numerics.md#newmarks-block
"""

import math

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels.newmark import (
    Block,
    add,
    begin,
    reach,
    store,
    store_no_value,
)
from slipsweep.kernels.roots import straight_stop
from slipsweep.motion.samples import SPAN, Samples


@scalar
def onset_on_line(
    block: Block, samples: Samples, i: int, left: float, stays: bool
) -> tuple[float, float, float]:
    """Return where on line i a block at rest begins to slide, which way, and the rate there.

    The side is 0 where it does not.  A block `stays` if it slid from here and stopped at once: Üg
    is beyond yield by rounding only.
    """
    first = block.amplitude * samples.acceleration[i]
    last = block.amplitude * samples.acceleration[i + 1]
    spacing = samples.spacing[i]
    ground = first
    if left < spacing:
        ground = last - (last - first) / spacing * left
    downslope = ground - block.yield_acceleration
    if downslope > 0.0 and not stays:
        return left, 1.0, downslope
    upslope = -ground - block.upslope_yield_acceleration
    if upslope > 0.0 and not stays:
        return left, -1.0, upslope
    side = 1.0 if last > 0.0 else -1.0
    limit = block.yield_acceleration if side > 0.0 else block.upslope_yield_acceleration
    excess = side * last - limit
    if excess > 0.0:
        return min(excess * spacing / (side * (last - first)), left), side, 0.0
    return 0.0, 0.0, 0.0


@scalar
def next_line_beyond(block: Block, samples: Samples, i: int) -> int:
    """Return the first line from i on that ends beyond a yield acceleration (or their number)."""
    amplitude = block.amplitude
    downslope = block.yield_acceleration
    upslope = -block.upslope_yield_acceleration
    lines = samples.acceleration.size - 1
    while i < lines:
        end = min((i // SPAN + 1) * SPAN, lines)
        while i < end:
            ground = amplitude * samples.acceleration[i + 1]
            if ground > downslope or ground < upslope:
                return i
            i += 1
        while i < lines:
            if i % (SPAN * SPAN) == 0:
                stretch = i // (SPAN * SPAN)
                highest = amplitude * samples.highest[stretch]
                lowest = amplitude * samples.lowest[stretch]
                if highest <= downslope and lowest >= upslope:
                    i += SPAN * SPAN
                    continue
            run = samples.runs[i // SPAN]
            if amplitude * run.highest > downslope or amplitude * run.lowest < upslope:
                break
            i += SPAN
    return lines


@scalar
def pass_runs(
    samples: Samples, i: int, scale: float, limit: float, speed: float, largest: float
) -> tuple[int, float, float, float]:
    """Slide along whole runs from line i on in which the block neither stops nor is fastest.

    Returns the next line, the way slid, and the speed and the largest speed by then.
    """
    lines = samples.acceleration.size - 1
    moved = 0.0
    while i < lines:
        run = samples.runs[i // SPAN]
        high = scale * run.highest - limit
        low = scale * run.lowest - limit
        most = scale * run.largest_velocity
        least = scale * run.least_velocity
        if scale < 0.0:
            high, low = low, high
            most, least = least, most
        braked = limit * run.duration
        after = speed + scale * run.velocity - braked
        slows = high <= 0.0
        quickens = low >= 0.0
        slides_on = quickens | (slows & (after > 0.0)) | (speed + least > braked)
        if not (slides_on & (quickens | slows | (speed + most <= largest))):
            break
        moved += (speed - 0.5 * braked) * run.duration + scale * run.displacement
        speed = after
        largest = max(largest, speed)
        i += SPAN
    return min(i, lines), moved, speed, largest


@scalar
def slide(
    block: Block, samples: Samples, i: int, left: float, side: float, rate: float
) -> tuple[int, float]:
    """Slide from a place on line i to the stop, or the end of the record; return where.

    Half way along a line that the block slides along the speed would be `half` at the first rate:
    no speed on the line is beyond the largest or the least of that and those at its ends.
    """
    limit = block.yield_acceleration if side > 0.0 else block.upslope_yield_acceleration
    scale = side * block.amplitude
    lines = samples.acceleration.size - 1
    # upslope there is no largest speed to keep
    largest = block.largest_velocity if side > 0.0 else math.inf
    speed = 0.0
    moved = 0.0
    stops = False
    while i < lines and not stops:
        thirds = 0.0
        end = min((i // SPAN + 1) * SPAN, lines)
        while i < end:
            last_rate = scale * samples.acceleration[i + 1] - limit
            half = speed + 0.5 * rate * left
            after = half + 0.5 * last_rate * left
            if (after <= 0.0) | ((half <= 0.0) & (speed > 0.0)):
                slope = slope_of(samples, i, scale)
                stop = straight_stop(speed, rate, slope)
                if after <= 0.0 or stop <= left:
                    stop = min(stop, left)
                    if rate > 0.0:
                        largest = max(largest, speed - 0.5 * rate * rate / slope)
                    moved += (speed + (0.5 * rate + slope * stop / 6.0) * stop) * stop
                    left -= stop
                    speed = 0.0
                    stops = True
                    break
            if max(half, after) > largest:
                peak = after
                if rate > 0.0 > last_rate:
                    peak = speed - 0.5 * rate * rate / slope_of(samples, i, scale)
                largest = max(largest, peak)
            thirds += (speed + half + after) * left
            speed = after
            rate = last_rate
            i += 1
            left = samples.spacing[i]
        moved += thirds / 3.0
        if not stops:
            i, way, speed, largest = pass_runs(samples, i, scale, limit, speed, largest)
            moved += way
            left = samples.spacing[i]
            rate = scale * samples.acceleration[i] - limit
    if side > 0.0:
        block.largest_velocity = largest
    add(block, side * moved)
    reach(block, side * speed)
    if stops and left <= 0.0:
        i += 1
        left = samples.spacing[i]
    return i, left


@scalar
def slope_of(samples: Samples, i: int, scale: float) -> float:
    """Return the slope of line i, times a scale."""
    return scale * (samples.acceleration[i + 1] - samples.acceleration[i]) / samples.spacing[i]


@scalar
def walk(block: Block, samples: Samples) -> None:
    """Move the block through the record: it rests, slides, stops, and slides again."""
    lines = samples.acceleration.size - 1
    i = 0
    left = samples.spacing[0]
    stays = False
    while i < lines:
        left, side, rate = onset_on_line(block, samples, i, left, stays)
        stays = False
        if side == 0.0:
            i = next_line_beyond(block, samples, i + 1)
            left = samples.spacing[i]
        else:
            block.slips += 1.0
            stop, left_there = slide(block, samples, i, left, side, rate)
            stays = stop == i and left_there == left
            i = stop
            left = left_there


@scalar
def pulses_beyond_yield(block: Block, peaks: np.ndarray) -> float:
    """Return the number of positive half waves whose peak exceeds Üy."""
    low = 0
    high = peaks.size
    while low < high:
        middle = (low + high) // 2
        if block.amplitude * peaks[middle] > block.yield_acceleration:
            high = middle
        else:
            low = middle + 1
    return float(peaks.size - low)


@kernel
def solve_newmark_record(
    cells: np.ndarray, g: float, samples: Samples, blocks: np.ndarray, results: np.ndarray
) -> None:
    """Solve the cells of a tile, of `NEWMARK_CELL`; `results` is (`block.RESULTS`, cells).

    `blocks`, (1,) of `newmark.BLOCK`, is what the motion is kept in.
    """
    block = blocks[0]
    for j in range(cells.size):
        if begin(block, cells[j], g):
            walk(block, samples)
            store(block, pulses_beyond_yield(block, samples.peaks), results[:, j])
        else:
            store_no_value(results[:, j])
