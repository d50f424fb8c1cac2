"""Newmark's block, exact: from event to event, sliding one way or both.

While V > 0 the block's acceleration is Üy, while V < 0 it is −Üy,up.  At V = 0 it rests as long as
−Üy,up ≤ Üg ≤ Üy.  On a piece of the path V therefore grows by the integral of Üg − Üy, in closed
form, and stops at a root of it: of a quadratic on a straight line, of a polynomial else.  A block
that slides upslope is one that slides downslope under −Üg (`side`): its speed is side · V, and the
rate of that is side · Üg less the yield acceleration of that side.

Places on a piece are τ, counted from its anchor, where |Üg| is largest: the excess of the peak over
the yield acceleration is then one difference, and a slide just above yield keeps all its digits.
Time is the phase, so that V = ωv and W = ω²u; under a record it is the time at scale 1.
docs/numerics.md#newmarks-block
"""

import math
from typing import Any, TypeAlias

import numpy as np

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import scalar
from slipsweep.kernels.base import moments
from slipsweep.kernels.block import STATICALLY_UNSTABLE, UNSOLVED, given_or
from slipsweep.kernels.roots import straight_stop
from slipsweep.model import equations as eq
from slipsweep.motion.paths import Curve, Path, Piece

#: What is needed of a cell; `yield_acceleration` is NaN where it is Coulomb's, and
#: `upslope_yield_acceleration` where the block slides downslope only.
DOWNSLOPE_FIELDS = ("tan_theta", "mu_s", "amplitude", "yield_acceleration")
NEWMARK_CELL = np.dtype(
    (np.record, [(name, "f8") for name in (*DOWNSLOPE_FIELDS, "upslope_yield_acceleration")])
)

#: Most slides along a piece: up to a stop, the other way, and up to a stop again.
MOST_PARTS = 3

#: A block and its motion up to now.
BLOCK = np.dtype(
    (
        np.record,
        [
            ("amplitude", "f8"),  # A, or the factor on a record
            ("yield_acceleration", "f8"),
            ("upslope_yield_acceleration", "f8"),
            ("velocity", "f8"),  # V
            ("displacement", "f8"),  # W
            ("largest_velocity", "f8"),
            ("slowest", "f8"),  # least |V| in the cycle
            ("largest_displacement", "f8"),
            ("smallest_displacement", "f8"),
            ("slips", "f8"),
            ("lost", "f8"),  # what rounding has taken from W (Kahan's sum)
            # slides along the piece gone through last: their number, and of each the τ of its
            # start and end, its side, and speed and W at its start
            ("parts", "i8"),
            ("part_start", "f8", (MOST_PARTS,)),
            ("part_end", "f8", (MOST_PARTS,)),
            ("part_side", "f8", (MOST_PARTS,)),
            ("part_speed", "f8", (MOST_PARTS,)),
            ("part_displacement", "f8", (MOST_PARTS,)),
        ],
    )
)

#: Records of `BLOCK` and `NEWMARK_CELL`; their fields have no types that mypy knows.
Block: TypeAlias = Any
Cell: TypeAlias = Any

#: Relative size of the last step to a root, whose error is its square, and the most steps.
TOLERANCE = 1e-9
MOST_STEPS = 200


# ------------------------------------------------------------------ along a piece


@scalar
def offset_and_slope(piece: Piece, curve: Curve, tau: float) -> tuple[float, float]:
    """Return w − top and dw/dτ on a piece."""
    if piece.degree <= 1:
        return piece.slope * tau, piece.slope
    total = 0.0
    slope = 0.0
    for k in range(piece.degree - 1, -1, -1):
        slope = slope * tau + total
        total = total * tau + curve.coefficients[k]
    return total * tau, slope * tau + total


@scalar
def gain_and_rate(
    piece: Piece, curve: Curve, scale: float, excess: float, tau: float
) -> tuple[float, float]:
    """Return the speed gained on a curved piece from its anchor to τ, and its rate there."""
    total = 0.0
    once = 0.0
    for k in range(piece.degree - 1, -1, -1):
        total = total * tau + curve.coefficients[k]
        once = once * tau + curve.once[k]
    return (excess + scale * once * tau) * tau, excess + scale * total * tau


@scalar
def gains(
    piece: Piece, curve: Curve, scale: float, excess: float, start: float, end: float
) -> tuple[float, float]:
    """Return the gains of speed and way, from rest, between two places on a piece."""
    width = end - start
    if piece.degree <= 1:
        slope = scale * piece.slope
        gained = (excess + 0.5 * slope * (start + end)) * width
        return gained, (0.5 * excess + slope * (2.0 * start + end) / 6.0) * width * width
    first, second = moments(curve, piece.degree, start, end)
    return excess * width + scale * first, 0.5 * excess * width * width + scale * second


@scalar
def place_of_yield(piece: Piece, curve: Curve, scale: float, excess: float) -> float:
    """Return τ at which Üg passes the yield acceleration on a piece (NaN: not found)."""
    if piece.degree <= 1:
        return -excess / (scale * piece.slope)
    far = piece.begin + piece.finish  # one of them is 0
    share = excess / (scale * (piece.top - (piece.first + piece.last - piece.top)))
    tau = far * (math.sqrt(share) if piece.slope == 0.0 else share)
    above = 0.0
    below = far
    for _ in range(MOST_STEPS):
        offset, slope = offset_and_slope(piece, curve, tau)
        value = excess + scale * offset
        if value > 0.0:
            above = tau
        else:
            below = tau
        new = tau - value / (scale * slope)
        if not min(above, below) <= new <= max(above, below):
            new = 0.5 * (above + below)
        step = abs(new - tau)
        tau = new
        if step <= TOLERANCE * abs(tau):
            return tau
    return math.nan


@scalar
def root_of_speed(
    piece: Piece,
    curve: Curve,
    scale: float,
    excess: float,
    start: float,
    speed: float,
    low: float,
    high: float,
    tau: float,
) -> float:
    """Return where the speed falls to 0 on a curved piece, between two places (NaN: not found).

    It is not negative at the first of them and negative at the second; `speed` is that at `start`,
    and τ the first guess.
    """
    first, _ = gain_and_rate(piece, curve, scale, excess, start)
    for _ in range(MOST_STEPS):
        gained, rate = gain_and_rate(piece, curve, scale, excess, tau)
        value = speed + (gained - first)
        if value > 0.0:
            low = tau
        else:
            high = tau
        new = tau - value / rate
        # at an end that has been tried before, rounding would send it to and fro
        if new != tau and not low < new < high:
            new = 0.5 * (low + high)
        step = abs(new - tau)
        tau = new
        if step <= TOLERANCE * (tau - start) or step <= 4e-16 * abs(tau):
            return tau
    return math.nan


@scalar
def stop_on_curve(
    block: Block,
    piece: Piece,
    curve: Curve,
    scale: float,
    excess: float,
    tau: float,
    speed: float,
    rate: float,
    wants_peak: bool,
) -> tuple[float, float]:
    """Return where the block stops on a curved piece (infinity: not), and its
    largest speed on it.
    """
    finish = piece.finish
    last_rate = excess + scale * (piece.last - piece.top)
    largest = speed
    if rate < 0.0 < last_rate:
        # slowest where Üg passes the yield acceleration
        turn = place_of_yield(piece, curve, scale, excess)
        least = speed + gains(piece, curve, scale, excess, tau, turn)[0]
        if least < 0.0:
            stop = root_of_speed(piece, curve, scale, excess, tau, speed, tau, turn, tau)
            return stop, largest
        block.slowest = min(block.slowest, least)
        return math.inf, largest
    if wants_peak and rate > 0.0 > last_rate:
        turn = place_of_yield(piece, curve, scale, excess)
        largest = speed + gains(piece, curve, scale, excess, tau, turn)[0]
    if last_rate >= 0.0 or speed + gains(piece, curve, scale, excess, tau, finish)[0] > 0.0:
        return math.inf, largest
    # Newton's iteration goes to the root from that side on which the speed curves towards it
    guess = finish if last_rate < rate else tau
    stop = root_of_speed(piece, curve, scale, excess, tau, speed, tau, finish, guess)
    return stop, largest


@scalar
def add(block: Block, moved: float) -> None:
    """Add to W by Kahan's sum: a record has up to a million pulses."""
    term = moved - block.lost
    total = block.displacement + term
    block.lost = (total - block.displacement) - term
    block.displacement = total


@scalar
def reach(block: Block, velocity: float) -> None:
    """Set V, and where it is 0 the extremes of W over time, which lie there."""
    block.velocity = velocity
    if velocity == 0.0:
        block.largest_displacement = max(block.largest_displacement, block.displacement)
        block.smallest_displacement = min(block.smallest_displacement, block.displacement)


@scalar
def slide_along(
    block: Block, piece: Piece, curve: Curve, tau: float, side: float, wants_peak: bool
) -> float:
    """Slide from τ on a piece to its end, or up to the stop; return where."""
    limit = block.yield_acceleration if side > 0.0 else block.upslope_yield_acceleration
    scale = side * block.amplitude
    excess = scale * piece.top - limit
    speed = side * block.velocity
    finish = piece.finish
    rate = excess + scale * offset_and_slope(piece, curve, tau)[0]
    if speed == 0.0:
        rate = max(rate, 0.0)  # of a slide that begins; below 0 is rounding
    if piece.degree <= 1:
        slope = scale * piece.slope
        stop = tau + straight_stop(speed, rate, slope)
        largest = speed
        turns = rate + slope * (finish - tau)
        if rate > 0.0 > turns:
            largest = speed - 0.5 * rate * rate / slope
        elif rate < 0.0 < turns and stop > finish:
            block.slowest = min(block.slowest, speed - 0.5 * rate * rate / slope)
    else:
        stop, largest = stop_on_curve(
            block, piece, curve, scale, excess, tau, speed, rate, wants_peak
        )
    stops = not stop > finish
    end = stop if stops else finish
    gained, moved = gains(piece, curve, scale, excess, tau, end)
    add(block, side * (moved + speed * (end - tau)))
    speed = 0.0 if stops else max(speed + gained, 0.0)
    reach(block, side * speed)
    if side > 0.0:
        block.largest_velocity = max(block.largest_velocity, largest, speed)
    block.slowest = min(block.slowest, speed)
    return end


@scalar
def onset_on(block: Block, piece: Piece, curve: Curve, tau: float) -> float:
    """Return where a block at rest at τ begins to slide on a piece (infinity: it does not)."""
    downslope = piece.top > 0.0
    limit = block.yield_acceleration if downslope else block.upslope_yield_acceleration
    excess = block.amplitude * abs(piece.top) - limit
    if not excess > 0.0:
        return math.inf
    scale = math.copysign(block.amplitude, piece.top)
    if piece.begin < 0.0:  # |Üg| grows
        if block.amplitude * abs(piece.first) >= limit:
            return tau
        place = place_of_yield(piece, curve, scale, excess)
        return tau if place < tau else place
    rate = excess + scale * offset_and_slope(piece, curve, tau)[0]
    return tau if rate > 0.0 else math.inf


@scalar
def move_along(block: Block, piece: Piece, curve: Curve, wants_peak: bool) -> None:
    """Take the block along a piece: it slides, stops, rests and slides again."""
    tau = piece.begin
    block.parts = 0
    for part in range(MOST_PARTS):
        if block.velocity == 0.0:
            tau = onset_on(block, piece, curve, tau)
            if tau >= piece.finish:
                return
            block.slips += 1.0
            side = math.copysign(1.0, piece.top)
        else:
            side = math.copysign(1.0, block.velocity)
        block.parts += 1
        block.part_start[part] = tau
        block.part_side[part] = side
        block.part_speed[part] = side * block.velocity
        block.part_displacement[part] = block.displacement
        tau = slide_along(block, piece, curve, tau, side, wants_peak)
        block.part_end[part] = tau
        if tau >= piece.finish or math.isnan(tau):
            return
        if side * piece.top > 0.0 and piece.begin == 0.0:
            return  # |Üg| falls: from the stop on it is below yield


# ------------------------------------------------------------------ along the path


@scalar
def walk(block: Block, path: Path, first: int, end: int, wants_peak: bool) -> None:
    """Go through some pieces."""
    pieces = path.base.pieces
    amplitude = block.amplitude
    downslope = block.yield_acceleration
    upslope = block.upslope_yield_acceleration
    for p in range(first, end):
        piece = pieces[p]
        if block.velocity != 0.0 or not -upslope <= amplitude * piece.top <= downslope:
            move_along(block, piece, path.base.curves[piece.curve], wants_peak)


@scalar
def walk_cycles(block: Block, path: Path, wants_peak: bool) -> None:
    """Go through all cycles of the path.

    A cycle that begins with the same V as one of the same shape gains the same.  Where V keeps its
    sign throughout, the next cycles gain the same V as long as it does, and W is a series.
    """
    period = 2.0 * math.pi
    shape = -1  # of the cycle that is remembered, and V and W at its beginning
    start = 0.0
    before = 0.0
    age = 0  # how many cycles ago that was, and how many are remembered before it is replaced
    memory = 1
    largest = 0.0
    smallest = 0.0
    for c in range(path.cycles.size - 1):
        left = path.repeats if path.repeats > 0 and c == path.lead else 1
        while left > 0:
            if age > 0 and shape == path.cycles[c].shape and block.velocity == start:
                rounds = left // age
                if rounds > 0:
                    gained = rounds * (block.displacement - before)
                    block.displacement += gained
                    block.largest_displacement += max(gained, 0.0)
                    block.smallest_displacement += min(gained, 0.0)
                    before += gained
                    left -= rounds * age
                    continue
            if shape != path.cycles[c].shape or age >= memory:
                memory = 1 if shape != path.cycles[c].shape else 2 * memory
                shape = path.cycles[c].shape
                start = block.velocity
                before = block.displacement
                age = 0
                # extremes of W before those cycles; the block's are those in them
                largest = max(largest, block.largest_displacement)
                smallest = min(smallest, block.smallest_displacement)
                block.largest_displacement = before
                block.smallest_displacement = before
            velocity = block.velocity
            displacement = block.displacement
            block.slowest = abs(velocity)
            walk(block, path, path.cycles[c].first, path.cycles[c + 1].first, wants_peak)
            left -= 1
            age += 1
            loss = abs(velocity) - abs(block.velocity)
            if left > 0 and block.slowest > 0.0 and loss > 0.0:
                alike = min(float(left), math.floor(block.slowest / loss))
                gained = block.velocity - velocity
                moved = block.displacement - displacement
                block.displacement += alike * moved + 0.5 * period * gained * alike * (alike + 1.0)
                block.velocity += alike * gained
                left -= int(alike)
                age += int(alike)
    block.largest_displacement = max(block.largest_displacement, largest)
    block.smallest_displacement = min(block.smallest_displacement, smallest)


@scalar
def begin(block: Block, cell: Cell, g: float) -> bool:
    """Set the block of a cell to rest; return False if it is statically unstable."""
    onset = given_or(
        cell.yield_acceleration, eq.coulomb_yield_acceleration(cell.mu_s, cell.tan_theta, g)
    )
    block.amplitude = cell.amplitude
    block.yield_acceleration = onset
    block.upslope_yield_acceleration = given_or(cell.upslope_yield_acceleration, math.inf)
    block.velocity = 0.0
    block.displacement = 0.0
    block.lost = 0.0
    block.largest_velocity = 0.0
    block.largest_displacement = 0.0
    block.smallest_displacement = 0.0
    block.slips = 0.0
    return onset > 0.0


@scalar
def store(block: Block, pulses: float, result: np.ndarray) -> None:
    """Let the block run out after the shaking, and write what has become of it
    (`block.RESULTS`,).
    """
    side = math.copysign(1.0, block.velocity)
    limit = block.yield_acceleration if side > 0.0 else block.upslope_yield_acceleration
    block.displacement += side * block.velocity * block.velocity / (2.0 * limit)
    slides = block.amplitude > block.yield_acceleration
    slides |= block.amplitude > block.upslope_yield_acceleration
    result[0] = block.displacement
    result[1] = block.largest_velocity
    result[2] = float(eq.STICK_SLIP if slides else eq.STUCK)
    result[3] = float(UNSOLVED if math.isnan(block.displacement) else 0)
    result[4] = block.slips
    result[5] = pulses
    result[6] = 0.0
    result[7] = max(block.largest_displacement, block.displacement)
    result[8] = min(block.smallest_displacement, block.displacement)
    result[9] = result[7] - result[8]


@scalar
def store_no_value(result: np.ndarray) -> None:
    """Write the results of a block that is statically unstable."""
    result[:] = math.nan
    result[2] = -1.0
    result[3] = float(STATICALLY_UNSTABLE)
    result[4:7] = -1.0


@kernel
def solve_newmark(
    cells: np.ndarray,
    g: float,
    wants_peak: bool,
    path: Path,
    blocks: np.ndarray,
    results: np.ndarray,
) -> None:
    """Solve the cells of a tile, of `NEWMARK_CELL`; `results` is (`block.RESULTS`, cells).

    `blocks`, (1,) of `BLOCK`, is what the motion is kept in.
    """
    block = blocks[0]
    for j in range(cells.size):
        if begin(block, cells[j], g):
            walk_cycles(block, path, wants_peak)
            store(block, 0.0, results[:, j])
        else:
            store_no_value(results[:, j])
