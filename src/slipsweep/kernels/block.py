"""The block that both solvers move: its parameters, its validity, and Eq. 4 on the rise.

Time enters the motion only through the phase φ = ωt.  The kernels work in phase: rates
of velocity are accelerations (m/s² a radian), and a velocity V and a displacement W of
theirs, both in m/s², belong to v = V/ω and u = W/ω².  Phase on and around a pulse is
counted from its peak: ψ = φ − π/2, where the plane's acceleration is A (1 − vers ψ).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slipsweep import equations as eq
from slipsweep.elementary import inverse_versine
from slipsweep.equations import STICK_SLIP, STUCK, scalar
from slipsweep.variables import VALUELESS, Validity

#: Relative accuracy of an event's phase ; an error there enters the result squared.
EVENT_TOLERANCE = 1e-9

#: Cells solved together; their inputs, states and results stay in the first-level cache.
#: Rows of a tile's arrays lie this far apart, a constant: LLVM then sees that no two rows
#: overlap, and vectorises loops over many of them (seen: 2.6 against 10.8 ns a cell).
TILE = 256

#: How the block's acceleration rises with the plane's (the `model` and `rise` options).
NEWMARK, MONOTONE, LITERAL = 0, 1, 2

#: How the block recouples (the `recoupling` option).
EQ12, INTEGRATE = 0, 1

STATICALLY_UNSTABLE = int(Validity.STATICALLY_UNSTABLE)
UPLIFT = int(Validity.UPLIFT)
LIMIT_UNDEFINED = int(Validity.LIMIT_UNDEFINED)
FRICTION_NOT_DECAYING = int(Validity.FRICTION_NOT_DECAYING)
EQ4_BELOW_YIELD = int(Validity.EQ4_BELOW_YIELD)
KD_NOT_POSITIVE = int(Validity.KD_NOT_POSITIVE)
NOT_RECOUPLED = int(Validity.NOT_RECOUPLED)
NO_VALUE = int(VALUELESS)


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
    """The answer: W and V of the module's docstring, and the flags of the motion."""

    displacement: float
    peak_velocity: float
    validity: int


@scalar
def cell_of(cells: np.ndarray, j: int) -> Cell:
    """Column j of an array whose rows are the fields of `Cell`."""
    return Cell(cells[0, j], cells[1, j], cells[2, j], cells[3, j], cells[4, j], cells[5, j], cells[6, j])


@scalar
def block_of(cell: Cell, rise: int, g: float) -> Block:
    """Friction parameters (Eqs. 7-11, λ from Eq. 6), sliding mode and a-priori validity of a cell."""
    tan_theta, mu_s, amplitude = cell.tan_theta, cell.mu_s, cell.amplitude
    yield_acceleration = cell.yield_acceleration
    if math.isnan(yield_acceleration):
        yield_acceleration = eq.coulomb_yield_acceleration(mu_s, tan_theta, g)
    limit = eq.limiting_acceleration(yield_acceleration, mu_s, tan_theta, g)
    ratio = eq.acceleration_ratio(amplitude, limit)
    minimum_friction = cell.minimum_friction
    if math.isnan(minimum_friction):
        minimum_friction = eq.minimum_friction(mu_s, ratio)
    delta_mu = cell.delta_mu
    if math.isnan(delta_mu):
        delta_mu = eq.delta_mu(mu_s, ratio)
    decay_rate = cell.decay_rate
    calibrated = math.isnan(decay_rate)
    if calibrated:
        decay_rate = eq.decay_rate(amplitude, mu_s, delta_mu, minimum_friction, g)

    validity = 0
    if yield_acceleration <= 0.0:
        validity |= STATICALLY_UNSTABLE
    if rise == NEWMARK:
        mode = STUCK if amplitude <= yield_acceleration else STICK_SLIP
    else:
        mode = eq.sliding_mode(amplitude, yield_acceleration, limit)
        if amplitude * tan_theta >= g:
            validity |= UPLIFT
        if eq.limit_denominator(mu_s, tan_theta) <= 0.0:
            validity |= LIMIT_UNDEFINED
        if calibrated and validity & (STATICALLY_UNSTABLE | LIMIT_UNDEFINED) == 0 and decay_rate <= 0.0:
            validity |= FRICTION_NOT_DECAYING
    if validity & NO_VALUE:
        mode = -1
    return Block(
        amplitude, yield_acceleration, limit, ratio, mu_s, tan_theta, minimum_friction, delta_mu, decay_rate, g,
        rise, mode, validity,
    )  # fmt: skip


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
    tan_theta, mu = block.tan_theta, friction(block, x)
    n = eq.normal_acceleration(x, tan_theta, block.g)
    side_tan = math.copysign(tan_theta, x)
    slope = 1.0 - side_tan * (block.mu_s - tan_theta - mu) - n * mu * block.decay_rate / block.g
    return eq.block_acceleration(x, mu, block.mu_s, tan_theta, block.g), slope


@scalar
def slope_and_curvature(block: Block, x: float) -> tuple[float, float]:
    """dE/dx and d²E/dx² (x ≠ 0)."""
    decay = math.copysign(block.decay_rate / block.g, x)
    n = eq.normal_acceleration(x, block.tan_theta, block.g)
    curvature = friction(block, x) * decay * (n * abs(decay) - math.copysign(2.0 * block.tan_theta, x))
    return response_and_slope(block, x)[1], curvature


@scalar
def inflection(block: Block) -> float:
    """x > 0 up to which E is concave; it is convex beyond (and everywhere where λ ≥ 2 tan θ)."""
    return (2.0 * block.tan_theta / block.decay_rate - 1.0) * block.g / block.tan_theta


@scalar
def slip(block: Block, x: float) -> float:
    """D(x) = x − E(x): rate of the relative velocity where the block obeys Eq. 4."""
    return x - response(block, x)


@scalar
def slip_and_slope(block: Block, x: float) -> tuple[float, float]:
    """D and dD/dx (x ≠ 0)."""
    value, slope = response_and_slope(block, x)
    return x - value, 1.0 - slope


@scalar
def phase(block: Block, x: float) -> float:
    """ψ ≤ 0 at which the plane's acceleration reaches x on its rise."""
    return -inverse_versine((block.amplitude - x) / block.amplitude)


@scalar
def starting_acceleration(block: Block, x: float) -> float:
    """c(x), the block's acceleration as it starts to slide at plane acceleration x."""
    if block.rise == NEWMARK:
        return block.yield_acceleration
    if block.rise == LITERAL:
        return response(block, x)
    return max(block.yield_acceleration, response(block, x))


def _root_of(value_and_slope: Callable[[Block, float], tuple[float, float]]) -> Callable[..., float]:
    """A jitted root finder for one function of (block, x).

    Bound here rather than passed as an argument: numba cannot keep a kernel on disk in
    which a function is a value.
    """

    @scalar
    def root(block: Block, level: float, start: float, end: float) -> float:
        """Where, from start to end, the function passes `level`: Newton, bisection where that leaves the bracket."""
        low, high = start, end
        above = value_and_slope(block, end)[0] >= level
        x = end
        for _ in range(200):
            value, slope = value_and_slope(block, x)
            if (value >= level) == above:
                high = x
            else:
                low = x
            new = x - (value - level) / slope
            if not min(low, high) <= new <= max(low, high):
                new = 0.5 * (low + high)
            step = abs(new - x)
            x = new
            if step <= EVENT_TOLERANCE * abs(x):
                break
        return x

    return root


#: Roots of E = level, dE/dx = level and D = level.
response_root = _root_of(response_and_slope)
slope_root = _root_of(slope_and_curvature)
slip_root = _root_of(slip_and_slope)


@scalar
def yield_governs(block: Block) -> bool:
    """Whether Eq. 4 stays at or below the yield value from Üg = Üy to the peak."""
    start, end = block.yield_acceleration, block.amplitude
    if block.rise == NEWMARK:
        return True
    highest = max(response(block, start), response(block, end))
    bend = min(inflection(block), end)
    if bend > start and slope_and_curvature(block, start)[0] > 0.0 > slope_and_curvature(block, bend)[0]:
        highest = max(highest, response(block, slope_root(block, 0.0, start, bend)))
    return highest <= start
