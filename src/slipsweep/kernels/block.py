"""The definition of a cell, Eqs. 7-11 with values given in their place, and the flags.

All kernels share these.

Time enters the motion only through the phase φ = ωt.  The kernels work in phase: rates of velocity
are accelerations (m/s² a radian), and a velocity V and a displacement W of theirs, both in m/s²,
belong to v = V/ω and u = W/ω².  Under a record time stands in place of the phase, and V and W are v
and u.
"""

import math
from typing import NamedTuple

import numpy as np

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.model import equations as eq
from slipsweep.model.options import Recoupling, Rise
from slipsweep.model.variables import VALUELESS, Validity

#: Rise of the block's acceleration with the base's (the `model` and `rise` options).
NEWMARK = int(Rise.NEWMARK)
MONOTONE = int(Rise.MONOTONE)
LITERAL = int(Rise.LITERAL)

#: Rule by which the block recouples (the `recoupling` option).
EQ12 = int(Recoupling.EQ12)
INTEGRATE = int(Recoupling.INTEGRATE)

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
MAY_NOT_STOP = int(Validity.MAY_NOT_STOP)
NOT_AT_REST = int(Validity.NOT_AT_REST)

#: Not a flag of results: a root was not found (`roots`), and the engine raises an error.
UNSOLVED = 1 << 14
NO_VALUE = int(VALUELESS) | UNSOLVED

#: Cautions and notes of the motion, which a block without a value has not.
OF_A_VALUE = YIELD_GOVERNS | NOT_RECOUPLED | NEAR_MODE_LIMIT | FRICTION_ESTIMATED | MAY_NOT_STOP


class Cell(NamedTuple):
    """Parameters of a cell; NaN stands for "by default" in the last four."""

    tan_theta: float
    mu_s: float
    amplitude: float
    yield_acceleration: float
    decay_rate: float
    delta_mu: float
    minimum_friction: float


class Options(NamedTuple):
    """Options that all cells of a grid share; `rise` and `recoupling` are codes.

    `wants_peak` says whether the largest V is requested.
    """

    rise: int
    recoupling: int
    cycles: int
    wants_peak: bool
    g: float


class Interface(NamedTuple):
    """Eqs. 7-11 of a cell, its sliding mode and its validity before the motion: all without λ."""

    yield_acceleration: float
    limiting_acceleration: float
    acceleration_ratio: float
    minimum_friction: float
    delta_mu: float
    sliding_mode: int
    validity: int


class Motion(NamedTuple):
    """Results of a cell by the exact kernels: rows of their array of results.

    A further result is a further field here, filled in by the kernels and named in
    `model.variables`.  Codes and counts are whole numbers; the counts are those of records.
    """

    displacement: float
    peak_velocity: float
    sliding_mode: float
    validity: float
    number_of_slips: float
    stick_slip_pulses: float
    continuous_pulses: float


#: Rows of the results of a cell by steps, or of Newmark's block; the counts are those of a record.
RESULTS = (
    "permanent_displacement",
    "peak_relative_velocity",
    "sliding_mode",
    "validity",
    "number_of_slips",
    "stick_slip_pulses",
    "continuous_pulses",
    "largest_displacement",
    "smallest_displacement",
    "clearance",
)


@inlined
def given_or(value: float, estimate: float) -> float:
    """Return a given value, or where that is NaN its estimate."""
    return estimate if math.isnan(value) else value


@inlined
def remarks_on(cell: Cell, ratio: float) -> int:
    """Cautions and notes on a block of the paper's model that slides, known before the motion."""
    near = (ratio >= 0.9) & (ratio <= 1.1)
    estimated = math.isnan(cell.decay_rate) | math.isnan(cell.delta_mu)
    return (NEAR_MODE_LIMIT if near else 0) | (FRICTION_ESTIMATED if estimated else 0)


@inlined
def interface_of(cell: Cell, rise: int, g: float) -> Interface:
    """Üy and Eqs. 7-11 of a cell: estimates, and what is given in their place."""
    # without branches, so that a loop over cells becomes SIMD
    tan_theta = cell.tan_theta
    mu_s = cell.mu_s
    amplitude = cell.amplitude
    yield_acceleration = given_or(
        cell.yield_acceleration, eq.coulomb_yield_acceleration(mu_s, tan_theta, g)
    )
    limit = eq.limiting_acceleration(yield_acceleration, mu_s, tan_theta, g)
    ratio = eq.acceleration_ratio(amplitude, limit)
    minimum_friction = given_or(cell.minimum_friction, eq.minimum_friction(mu_s, ratio))
    delta_mu = given_or(cell.delta_mu, eq.delta_mu(mu_s, ratio))

    newmark = rise == NEWMARK
    unstable = yield_acceleration <= 0.0
    uplift = (amplitude * tan_theta >= g) & (not newmark)
    undefined = (eq.limit_denominator(mu_s, tan_theta) <= 0.0) & (not newmark)
    # λ <= 0, said without the division by an amplitude that may be zero
    rises = (
        math.isnan(cell.decay_rate)
        & (mu_s + delta_mu <= minimum_friction)
        & (not (unstable | undefined | newmark))
    )
    validity = (
        (STATICALLY_UNSTABLE if unstable else 0)
        | (UPLIFT if uplift else 0)
        | (LIMIT_UNDEFINED if undefined else 0)
        | (FRICTION_NOT_DECAYING if rises else 0)
    )
    mode = eq.sliding_mode(amplitude, yield_acceleration, math.inf if newmark else limit)
    mode = mode if validity == 0 else -1
    validity |= remarks_on(cell, ratio) if (mode > eq.STUCK) & (not newmark) else 0
    return Interface(yield_acceleration, limit, ratio, minimum_friction, delta_mu, mode, validity)


@inlined
def decay_rate_of(cell: Cell, delta_mu: float, minimum_friction: float, g: float) -> float:
    """λ, given or from Eq. 6 at the peak."""
    return given_or(
        cell.decay_rate, eq.decay_rate(cell.amplitude, cell.mu_s, delta_mu, minimum_friction, g)
    )


@inlined
def settled(validity: int, displacement: float, amplitude: float) -> int:
    """Add `upslope` to the flags of a block; where it has no value, drop what is said of one.

    A displacement that is zero to rounding, by the base's peak acceleration A/ω², is none upslope.
    """
    moved = validity | (UPSLOPE if displacement < -1e-12 * amplitude else 0)
    return moved if validity & NO_VALUE == 0 else validity & ~OF_A_VALUE


@inlined
def without_estimates(validity: int) -> int:
    """Flags of a block whose friction plays no part where the yield acceleration governs."""
    return validity & ~FRICTION_ESTIMATED if validity & YIELD_GOVERNS else validity


@scalar
def store(motion: Motion, j: int, results: np.ndarray) -> None:
    """Write the motion of cell j into its column of the results, (fields of `Motion`, cells)."""
    for row in range(len(motion)):
        results[row, j] = motion[row]
