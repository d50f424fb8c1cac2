"""The block that both solvers move: its parameters, its validity, and Eq. 4 on the rise.

Time enters the motion only through the phase φ = ωt.  The kernels work in phase: rates
of velocity are accelerations (m/s² a radian), and a velocity V and a displacement W of
theirs, both in m/s², belong to v = V/ω and u = W/ω².  Phase on and around a pulse is
counted from its peak: ψ = φ − π/2, where the plane's acceleration is A (1 − vers ψ).
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.jit.elementary import log, rising_phase
from slipsweep.kernels.events import STRIP, root_of
from slipsweep.model import equations as eq
from slipsweep.model.variables import VALUELESS, Validity

#: Cells solved together; their inputs, states and results stay in the second-level cache.
#: Rows of a tile's arrays lie this far apart, a constant: LLVM then sees that no two rows
#: overlap, and vectorises loops over many of them (seen: 2.6 against 10.8 ns a cell).  A
#: multiple of 32 (`whole_lanes`), but no power of two, whose rows would share cache sets.
TILE = 1056

#: How the block's acceleration rises with the plane's (the `model` and `rise` options).
NEWMARK, MONOTONE, LITERAL = 0, 1, 2

#: How the block recouples (the `recoupling` option).
EQ12, INTEGRATE = 0, 1

STATICALLY_UNSTABLE = int(Validity.STATICALLY_UNSTABLE)
UPLIFT = int(Validity.UPLIFT)
LIMIT_UNDEFINED = int(Validity.LIMIT_UNDEFINED)
FRICTION_NOT_DECAYING = int(Validity.FRICTION_NOT_DECAYING)
YIELD_GOVERNS = int(Validity.YIELD_GOVERNS)
KD_NOT_POSITIVE = int(Validity.KD_NOT_POSITIVE)
NOT_RECOUPLED = int(Validity.NOT_RECOUPLED)
UPSLOPE = int(Validity.UPSLOPE)
NEAR_MODE_LIMIT = int(Validity.NEAR_MODE_LIMIT)
FRICTION_ESTIMATED = int(Validity.FRICTION_ESTIMATED)

#: Not a flag of results: an event was not found (`events`), and the engine raises an error.
UNSOLVED = 1 << 14
NO_VALUE = int(VALUELESS) | UNSOLVED


class Cell(NamedTuple):
    """What is given of one cell; NaN stands for "by default" in the last four."""

    tan_theta: float
    mu_s: float
    amplitude: float
    yield_acceleration: float
    decay_rate: float
    delta_mu: float
    minimum_friction: float


class Options(NamedTuple):
    """What all cells of a grid share."""

    rise: int
    recoupling: int
    cycles: int
    rule: int
    steps_per_cycle: int
    wants_peak: bool
    g: float


class Block(NamedTuple):
    """A block with all its parameters, and what can be said of it before it moves."""

    amplitude: float
    yield_acceleration: float
    limiting_acceleration: float
    acceleration_ratio: float
    mu_s: float
    tan_theta: float
    minimum_friction: float
    delta_mu: float
    decay_rate: float
    g: float
    rise: int
    sliding_mode: int
    validity: int


class Motion(NamedTuple):
    """The response: W and V of the module's docstring, and the flags of the motion."""

    displacement: float
    peak_velocity: float
    validity: int


@in_lanes
def cell_of(cells: np.ndarray, j: int) -> Cell:
    """Cell j of a tile, whose rows are the fields of `Cell`."""
    return Cell(
        cells[j],
        cells[TILE + j],
        cells[2 * TILE + j],
        cells[3 * TILE + j],
        cells[4 * TILE + j],
        cells[5 * TILE + j],
        cells[6 * TILE + j],
    )


@in_lanes
def _given(given: float, estimate: float) -> float:
    """What is given, or where that is NaN its estimate."""
    return estimate if math.isnan(given) else given


@in_lanes
def remarks_on(cell: Cell, ratio: float) -> int:
    """Cautions and notes on a block of the paper's model that slides, with what is known before it does."""
    near = (ratio >= 0.9) & (ratio <= 1.1)
    estimated = math.isnan(cell.decay_rate) | math.isnan(cell.delta_mu)
    return (NEAR_MODE_LIMIT if near else 0) | (FRICTION_ESTIMATED if estimated else 0)


@in_lanes
def settled(validity: int, displacement: float) -> int:
    """The flags of a block once its displacement is known: what is said of a value needs one."""
    moved = validity | (UPSLOPE if displacement < 0.0 else 0)
    return moved if validity & NO_VALUE == 0 else validity & ~(NEAR_MODE_LIMIT | FRICTION_ESTIMATED)


@in_lanes
def settled_in_cycles(validity: int, displacement: float) -> int:
    """`settled` for pulses of one friction, which plays no part where the yield acceleration governs them."""
    return settled(validity & ~FRICTION_ESTIMATED if validity & YIELD_GOVERNS else validity, displacement)


@in_lanes
def interface_of(cell: Cell, rise: int, g: float) -> tuple[float, float, float, float, float, int, int]:
    """Üy, Ü1, ξ, μmin and Δμ (Eqs. 7-11), sliding mode and a-priori validity of a cell: all that needs no λ."""
    # estimates first, then what is given in their place: without branches, so that a loop
    # over cells becomes SIMD (seen: 32 ns a cell with them)
    tan_theta, mu_s, amplitude = cell.tan_theta, cell.mu_s, cell.amplitude
    yield_acceleration = _given(cell.yield_acceleration, eq.coulomb_yield_acceleration(mu_s, tan_theta, g))
    limit = eq.limiting_acceleration(yield_acceleration, mu_s, tan_theta, g)
    ratio = eq.acceleration_ratio(amplitude, limit)
    minimum_friction = _given(cell.minimum_friction, eq.minimum_friction(mu_s, ratio))
    delta_mu = _given(cell.delta_mu, eq.delta_mu(mu_s, ratio))

    newmark = rise == NEWMARK
    unstable = yield_acceleration <= 0.0
    uplift = (amplitude * tan_theta >= g) & (not newmark)
    undefined = (eq.limit_denominator(mu_s, tan_theta) <= 0.0) & (not newmark)
    # λ <= 0, said without the division by an amplitude that may be zero
    rises = math.isnan(cell.decay_rate) & (mu_s + delta_mu <= minimum_friction) & (not (unstable | undefined | newmark))
    validity = (
        (STATICALLY_UNSTABLE if unstable else 0)
        | (UPLIFT if uplift else 0)
        | (LIMIT_UNDEFINED if undefined else 0)
        | (FRICTION_NOT_DECAYING if rises else 0)
    )
    mode = eq.sliding_mode(amplitude, yield_acceleration, math.inf if newmark else limit)
    mode = mode if validity == 0 else -1
    validity |= remarks_on(cell, ratio) if (mode > eq.STUCK) & (not newmark) else 0
    return yield_acceleration, limit, ratio, minimum_friction, delta_mu, mode, validity


@in_lanes
def decay_rate_of(cell: Cell, delta_mu: float, minimum_friction: float, g: float) -> float:
    """λ, given or from Eq. 6 at the peak."""
    return _given(cell.decay_rate, eq.decay_rate(cell.amplitude, cell.mu_s, delta_mu, minimum_friction, g))


@in_lanes
def block_of(cell: Cell, rise: int, g: float) -> Block:
    """Friction parameters (Eqs. 7-11, λ from Eq. 6), sliding mode and a-priori validity of a cell."""
    yield_acceleration, limit, ratio, minimum_friction, delta_mu, mode, validity = interface_of(cell, rise, g)
    decay_rate = decay_rate_of(cell, delta_mu, minimum_friction, g)
    return Block(
        cell.amplitude, yield_acceleration, limit, ratio, cell.mu_s, cell.tan_theta, minimum_friction, delta_mu,
        decay_rate, g, rise, mode, validity,
    )  # fmt: skip


@scalar
def block_at(cells: np.ndarray, j: int, options: Options) -> Block:
    """The block of cell j of a tile: `block_of` where no loop wants it inlined."""
    return block_of(cell_of(cells, j), options.rise, options.g)


@scalar
def store_motion(found: Motion, j: int, motion: np.ndarray, codes: np.ndarray) -> None:
    """Store the motion of cell j of a tile; an iteration that has not ended has made it NaN."""
    motion[0, j], motion[1, j] = found.displacement, found.peak_velocity
    validity = codes[1, j] | found.validity
    if math.isnan(found.displacement) and validity & NO_VALUE == 0:
        validity |= UNSOLVED
    codes[1, j] = settled_in_cycles(validity, found.displacement)
    if validity & NO_VALUE:
        codes[0, j] = -1


@scalar
def friction(block: Block, x: float) -> float:
    """μ at plane acceleration x (Eq. 6)."""
    return eq.friction_coefficient(x, block.mu_s, block.delta_mu, block.decay_rate, block.g)


@scalar
def response(block: Block, x: float) -> float:
    """E(x), the block's acceleration that Eq. 4 asks at plane acceleration x."""
    return eq.block_acceleration(x, friction(block, x), block.mu_s, block.tan_theta, block.g)


@scalar
def response_and_slope(block: Block, x: float) -> tuple[float, float]:
    """E and dE/dx (x ≠ 0)."""
    mu = friction(block, x)
    slope = eq.relative_acceleration_slope(x, mu, block.mu_s, block.tan_theta, block.decay_rate / block.g, block.g)
    return eq.block_acceleration(x, mu, block.mu_s, block.tan_theta, block.g), 1.0 - slope


@scalar
def slope_and_curvature(block: Block, x: float) -> tuple[float, float]:
    """dE/dx and d²E/dx² (x ≠ 0)."""
    mu, decay = friction(block, x), block.decay_rate / block.g
    slope = eq.relative_acceleration_slope(x, mu, block.mu_s, block.tan_theta, decay, block.g)
    return 1.0 - slope, -eq.relative_acceleration_curvature(x, mu, block.tan_theta, decay, block.g)


@scalar
def inflection(block: Block) -> float:
    """x > 0 up to which E is concave; it is convex beyond (and everywhere where λ ≥ 2 tan θ).

    docs/numerics.md#slope-and-inflection
    """
    return (2.0 * block.tan_theta / block.decay_rate - 1.0) * block.g / block.tan_theta


@scalar
def relative_acceleration(block: Block, x: float) -> float:
    """D(x) = x − E(x): rate of the relative velocity where the block obeys Eq. 4."""
    return eq.relative_acceleration(x, friction(block, x), block.mu_s, block.tan_theta, block.g)


@scalar
def opposite(a: float, b: float) -> bool:
    """Whether one is positive and the other negative; their product might underflow."""
    return a < 0.0 < b or b < 0.0 < a


@scalar
def phase(block: Block, x: float) -> float:
    """ψ ≤ 0 at which the plane's acceleration reaches x on its rise."""
    return rising_phase(x, block.amplitude)


@scalar
def starting_acceleration(block: Block, x: float) -> float:
    """c(x), the block's acceleration as it starts to slide at plane acceleration x."""
    if block.rise == NEWMARK:
        return block.yield_acceleration
    if block.rise == LITERAL:
        return response(block, x)
    return max(block.yield_acceleration, response(block, x))


@scalar
def _response_above(where: tuple[Block, float], x: float) -> tuple[float, float]:
    block, level = where
    value, slope = response_and_slope(block, x)
    return value - level, slope


@scalar
def _slope_above(where: tuple[Block, float], x: float) -> tuple[float, float]:
    block, level = where
    value, slope = slope_and_curvature(block, x)
    return value - level, slope


@scalar
def _relative_acceleration_and_slope(block: Block, x: float) -> tuple[float, float]:
    value, slope = response_and_slope(block, x)
    return x - value, 1.0 - slope


_response_root = root_of(_response_above)
_slope_root = root_of(_slope_above)
_relative_acceleration_root = root_of(_relative_acceleration_and_slope)


@scalar
def response_root(block: Block, level: float, below: float, above: float) -> float:
    """x between `below`, where E < level, and `above`, at which E = level."""
    return _response_root((block, level), below, above, above, 0.0)


@scalar
def slope_root(block: Block, level: float, start: float, end: float) -> float:
    """x between start and end at which dE/dx = level, which it passes."""
    if slope_and_curvature(block, end)[0] >= level:
        return _slope_root((block, level), start, end, end, 0.0)
    return _slope_root((block, level), end, start, end, 0.0)


@scalar
def relative_acceleration_root(block: Block, start: float, end: float) -> float:
    """x between start and end at which D = 0, whose sign changes."""
    # friction is back at μs there, and most D are near 0: from the end Newton's steps would leave the bracket
    static = math.copysign(block.g / block.decay_rate * log((block.mu_s + block.delta_mu) / block.mu_s), end)
    first = static if min(start, end) < static < max(start, end) else end
    if relative_acceleration(block, end) >= 0.0:
        return _relative_acceleration_root(block, start, end, first, 0.0)
    return _relative_acceleration_root(block, end, start, first, 0.0)


@scalar
def stays_below_yield(block: Block, start: float, end: float) -> bool:
    """Whether Eq. 4 stays at or below the yield value on the plane's way from `start`, no less than it, to `end`."""
    highest = max(response(block, start), response(block, end))
    bend = min(inflection(block), end)
    if bend > start and slope_and_curvature(block, start)[0] > 0.0 > slope_and_curvature(block, bend)[0]:
        highest = max(highest, response(block, slope_root(block, 0.0, start, bend)))
    return highest <= block.yield_acceleration


#: Rows of lanes, blocks laid out for SIMD loops: row + j is cell j.  A solver's own rows
#: follow from `LANE_ROWS` on.
AMPLITUDE, YIELD, MU_S, TAN_THETA, DELTA_MU, DECAY, BEGAN = range(0, 7 * TILE, TILE)
LANE_ROWS = 7


@scalar
def whole_lanes(count: int) -> int:
    """`count` up to the next multiple that leaves no remainder."""
    return -(-count // STRIP) * STRIP


@scalar
def fill_up(used: int, rows: int, lanes: np.ndarray) -> None:
    """Repeat the first lane up to the next whole number of strips."""
    for row in range(0, rows * TILE, TILE):
        for lane in range(used, whole_lanes(used)):
            lanes[row + lane] = lanes[row]


@in_lanes
def lane_friction(lanes: np.ndarray, j: int, x: float) -> float:
    """μ(x) of a lane: Eq. 6 for λ/g, so that no g is divided by."""
    return eq.friction_coefficient(x, lanes[MU_S + j], lanes[DELTA_MU + j], lanes[DECAY + j], 1.0)


@in_lanes
def lane_response(lanes: np.ndarray, j: int, x: float, g: float) -> float:
    """E(x) of a lane."""
    return eq.block_acceleration(x, lane_friction(lanes, j, x), lanes[MU_S + j], lanes[TAN_THETA + j], g)


@in_lanes
def lane_loss(lanes: np.ndarray, j: int, x: float, g: float) -> float:
    """n (μs − μ) at x of a lane, what friction has lost: D = ± n (μs − μ) − |x| tan²θ.

    Of D all that has no integral in closed form over a part of the sine (docs/numerics.md#eq-4-as-a-lag).
    """
    return eq.normal_acceleration(x, lanes[TAN_THETA + j], g) * (lanes[MU_S + j] - lane_friction(lanes, j, x))


@in_lanes
def lane_slant(lanes: np.ndarray, j: int, plane: float) -> float:
    """|x| tan²θ of a lane, the rest of D, or its integral from that of |x|."""
    return lanes[TAN_THETA + j] * lanes[TAN_THETA + j] * plane


@in_lanes
def lane_rate_and_slope(lanes: np.ndarray, j: int, x: float, g: float) -> tuple[float, float]:
    """D and dD/dx of a lane (x ≠ 0, or a zero with the sign of its side)."""
    tan_theta, mu_s = lanes[TAN_THETA + j], lanes[MU_S + j]
    mu = lane_friction(lanes, j, x)
    slope = eq.relative_acceleration_slope(x, mu, mu_s, tan_theta, lanes[DECAY + j], g)
    return eq.relative_acceleration(x, mu, mu_s, tan_theta, g), slope
