"""A batch: cells whose motion is computed together, and Eq. 4 in them.

A batch is a NumPy record with an array of `WIDTH` numbers for each quantity.  So the compiler knows
where each array is, that no two overlap and how long they are: a loop over the cells of a batch
becomes SIMD.  All `WIDTH` cells are computed, used or not: a scalar remainder of a loop would round
otherwise, and the last digits of a cell would depend on how many others there are.
"""

import math
from typing import TypeAlias

import numpy as np

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.jit.elementary import angle_minus_sine, half_square_minus_versine, versine
from slipsweep.kernels.block import Cell, Motion
from slipsweep.model import equations as eq
from slipsweep.model.friction import exponential_derivatives

#: Cells of a batch.  Its iterations end with that of the slowest cell.
WIDTH = 64

HALF_PI = 0.5 * math.pi

#: Cells that a batch has room for: those of a batch and those that wait for the next one.
ROOM = 2 * WIDTH

#: The block of a cell (`kernels.block`), ψ at which Üg = Üy, and the flags known before the motion.
BLOCK = (
    "amplitude",
    "yield_acceleration",
    "mu_s",
    "tan_theta",
    "delta_mu",
    "decay_rate",
    "yield_phase",
    "validity_before",
)

#: Quantities of the cells of a batch that is solved, each (WIDTH,).
QUANTITIES = (
    # what is computed before the motion: μmin, mode, and Eq. 4 at Üg = Üy and at the peak
    "minimum_friction",
    "sliding_mode",
    "response_at_yield",
    "response_at_peak",
    # the search for an event: where it is, and 1 once the iteration has come to it
    "event",
    "converged",
    # a part of the cycle, from ψ to ψ, and the gains of V and W on it
    "start",
    "end",
    "gain",
    "moment",
    # a pulse: b from its beginning and from the peak on, V and W up to now, the largest V
    "level",
    "held",
    "velocity",
    "displacement",
    "peak_velocity",
    # pulses solved alone (`alone`): V at Üg = Üy and the least V of the rise, cycles that are left
    # and W of those before; W and the cycles left when V was `seen_velocity`, when to look again
    "entered",
    "least_velocity",
    "cycles_left",
    "total",
    "highest",
    "seen_velocity",
    "seen_total",
    "seen_cycles_left",
    "next_look",
    "last_place",
    # continuous sliding (`continuous`): gains of V over a quarter and over a cycle; the largest V
    # of each half cycle that is entered with V = 0
    "quarter",
    "drift",
    "highest_from_yield",
    "highest_of_positive",
    "highest_of_negative",
    # 1 if all events have been located, and the flags of the motion
    "solved",
    "validity",
)

#: Most places between which E is monotone and D has one sign (`alone.find_places`).
MOST_PLACES = 16

BATCH = np.dtype(
    (
        np.record,
        [(name, np.float64, (ROOM,)) for name in BLOCK]
        + [(name, np.float64, (WIDTH,)) for name in QUANTITIES]
        # the number of the cell in the results, the kind of its motion (`kinds`), the number of
        # cells; if Eq. 4 is integrated by the rule of short parts; the places of each cell: Üg,
        # ψ, E, and if D > 0 from there to the next
        + [
            ("cell", np.int64, (ROOM,)),
            ("kind", np.int64, (WIDTH,)),
            ("used", np.int64),
            ("is_short", np.bool_),
            ("places", np.float64, (WIDTH, MOST_PLACES)),
            ("phases", np.float64, (WIDTH, MOST_PLACES)),
            ("responses", np.float64, (WIDTH, MOST_PLACES)),
            ("advances", np.int64, (WIDTH, MOST_PLACES)),
        ],
    )
)

Batch: TypeAlias = np.record

#: Rows of the results, (fields of `Motion`, cells).
DISPLACEMENT, PEAK_VELOCITY, SLIDING_MODE, VALIDITY = (
    Motion._fields.index(name)
    for name in ("displacement", "peak_velocity", "sliding_mode", "validity")
)

#: Gauss–Legendre rule on [0, 1].  It is right to 1e-13 where friction falls by no more than e^6
#: (`MOST_E_FOLDINGS`).
NODES, WEIGHTS = (
    (a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(12), (1.0, 0.0), strict=True)
)
MOST_E_FOLDINGS = 6.0

#: The same rule of 8 nodes, right to 1e-13 of parts of continuous sliding up to `SHORT` radians.
SHORT_NODES, SHORT_WEIGHTS = (
    (a + s) / 2 for a, s in zip(np.polynomial.legendre.leggauss(8), (1.0, 0.0), strict=True)
)
SHORT = 0.55

#: Newton's iteration has converged when its last step is smaller than this part of the value:
#: an error of 1e-14 is left.
TOLERANCE = 1e-7
MOST_STEPS = 32


@inlined
def load(cells: np.ndarray, first: int, batch: Batch) -> None:
    """Fill a batch with cells, from the `first` on; NaN stands for "by default"."""
    rest = cells.size - first
    batch.used = rest if rest < WIDTH else WIDTH
    for j in range(batch.used):
        batch.cell[j] = first + j
        batch.tan_theta[j] = cells[first + j].tan_theta
        batch.mu_s[j] = cells[first + j].mu_s
        batch.amplitude[j] = cells[first + j].amplitude
        batch.yield_acceleration[j] = cells[first + j].yield_acceleration
        batch.decay_rate[j] = cells[first + j].decay_rate
        batch.delta_mu[j] = cells[first + j].delta_mu
        batch.minimum_friction[j] = cells[first + j].minimum_friction


@inlined
def cell_of(batch: Batch, j: int) -> Cell:
    """Return the parameters of cell j of a batch that has just been loaded."""
    return Cell(
        batch.tan_theta[j],
        batch.mu_s[j],
        batch.amplitude[j],
        batch.yield_acceleration[j],
        batch.decay_rate[j],
        batch.delta_mu[j],
        batch.minimum_friction[j],
    )


@inlined
def friction(batch: Batch, j: int, x: float, g: float) -> float:
    """Return μ at Üg = x, Eq. 6."""
    return eq.friction_coefficient(x, batch.mu_s[j], batch.delta_mu[j], batch.decay_rate[j], g)


@inlined
def relative_acceleration(batch: Batch, j: int, x: float, g: float) -> tuple[float, float]:
    """Return D and dD/dx, D(x) = x − E(x) of Eq. 4; a zero x has the sign of its side."""
    mu_s = batch.mu_s[j]
    tan_theta = batch.tan_theta[j]
    mu = friction(batch, j, x, g)
    friction_slope = exponential_derivatives(mu, batch.decay_rate[j], g)[0]
    slope = eq.relative_acceleration_slope(x, mu, friction_slope, mu_s, tan_theta, g)
    return eq.relative_acceleration(x, mu, mu_s, tan_theta, g), slope


@inlined
def static_acceleration(batch: Batch, j: int, g: float) -> float:
    """Return nearly |Üg| where μ = μs: after ln(1 + r) ≈ 2r/(2 + r) e-foldings, r = Δμ/μs."""
    delta_mu = batch.delta_mu[j]
    return 2.0 * delta_mu * g / ((2.0 * batch.mu_s[j] + delta_mu) * batch.decay_rate[j])


@inlined
def held_gains(amplitude: float, held: float, start: float, end: float) -> tuple[float, float]:
    """Return the gains of V and W from rest with b held, from ψ to ψ.

    These are ∫ (Üg − b) dψ and ∫ (end − ψ)(Üg − b) dψ, in closed form:

        Üg = A (1 − vers ψ)        S = ψ − sin ψ        H = ψ²/2 − vers ψ        |ψ| ≤ π/2

        (A − b)(e − s) − A [S(e) − S(s)]        ½ (A − b)(e − s)² − A [H(e) − H(s) − S(s)(e − s)]

    docs/numerics.md#held-block-acceleration
    """
    width = end - start
    excess = amplitude - held
    before = angle_minus_sine(start)
    gain = excess * width - amplitude * (angle_minus_sine(end) - before)
    swept = half_square_minus_versine(end) - half_square_minus_versine(start) - before * width
    return gain, 0.5 * excess * width * width - amplitude * swept


@scalar
def integrate_eq4(batch: Batch, side: float, g: float) -> None:
    """Set `gain` and `moment` to the gains of V and W from rest by Eq. 4, from `start` to `end`.

    These are ∫ D dψ and ∫ (end − ψ) D dψ, with

        |Üg| = A (1 − vers ψ)        D = ± n (μs − μ) − |Üg| tan² θ        ± is `side`

    The first term is summed over nodes, the second has its integral in closed form.
    docs/numerics.md#eq-4-as-a-lag
    """
    for j in range(WIDTH):
        batch.gain[j] = batch.moment[j] = 0.0
    is_short = batch.is_short
    for node in range(SHORT_NODES.size if is_short else NODES.size):
        at = SHORT_NODES[node] if is_short else NODES[node]
        weight = SHORT_WEIGHTS[node] if is_short else WEIGHTS[node]
        for j in range(WIDTH):
            psi = batch.start[j] + (batch.end[j] - batch.start[j]) * at
            x = side * (batch.amplitude[j] * (1.0 - versine(psi)))
            normal = eq.normal_acceleration(x, batch.tan_theta[j], g)
            lost = weight * (normal * (batch.mu_s[j] - friction(batch, j, x, g)))
            batch.gain[j] += lost
            batch.moment[j] += (1.0 - at) * lost
    for j in range(WIDTH):
        width = batch.end[j] - batch.start[j]
        tan_theta = batch.tan_theta[j]
        plane, plane_moment = held_gains(batch.amplitude[j], 0.0, batch.start[j], batch.end[j])
        batch.gain[j] = side * batch.gain[j] * width - tan_theta * tan_theta * plane
        batch.moment[j] = (
            side * batch.moment[j] * width * width - tan_theta * tan_theta * plane_moment
        )


@scalar
def find_eq4_event(batch: Batch, holds: float, side: float, g: float) -> None:
    """Set `event` to the |Üg| at which D = 0 on a side of Üg = 0.

    If `holds` is 1 it is that at which E = b, `level`.

    Newton's iteration of all cells that have not `converged`, from `event` on.  It needs no
    bracket: each begins on the side from which it cannot pass the root
    (docs/numerics.md#batches-of-the-sine).
    """
    for _ in range(MOST_STEPS):
        missing = 0
        for j in range(WIDTH):
            x = batch.event[j]
            rate, slope = relative_acceleration(batch, j, side * x, g)
            # E(x) − b = (x − b) − D
            step = (holds * (x - batch.level[j]) - rate) / (holds - side * slope)
            there = batch.converged[j] > 0.0
            batch.event[j] = x if there else x - step
            there |= abs(step) <= TOLERANCE * min(x, batch.amplitude[j] - x)
            batch.converged[j] = 1.0 if there else 0.0
            missing += 0 if there else 1
        if missing == 0:
            break
