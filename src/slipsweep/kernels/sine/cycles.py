"""All cycles in lanes, where each pulse adds the same: series.

docs/numerics.md#lanes-of-the-sine and docs/numerics.md#eq-12-over-an-interval
"""

import math

import numpy as np

from slipsweep.jit.decorators import in_lanes, scalar
from slipsweep.kernels.block import (
    AMPLITUDE,
    BEGAN,
    NOT_RECOUPLED,
)
from slipsweep.kernels.events import STRIP
from slipsweep.kernels.sine.lanes import (
    CARRIED,
    CODE,
    CONVERGED,
    HALF_PI,
    HELD,
    HIGHEST,
    LAST,
    LEFT,
    MOVED,
    ONSET,
    PEAK,
    PSI,
    START,
    STICKS,
    W,
    X,
)
from slipsweep.kernels.sine.roots import RECOUPLING, settle
from slipsweep.kernels.sine.shapes import half_wave, half_wave_bound
from slipsweep.model import equations as eq


@in_lanes
def pause_of(began: float) -> float:
    """Phase from Üg = 0 (t5) to the next Üg = Üy."""
    return 1.5 * math.pi + began


@in_lanes
def lane_series(lanes: np.ndarray, j: int, braked: float, gain: float, later: float) -> float:
    """W of the pulse that a lane has followed and of `later` more, each entered with V greater by `gain`.

    Pulse n, counted from 0, adds 2π · gain · n more than the first does with `braked`, the last slides to its
    stop (docs/numerics.md#lanes-of-the-sine).
    """
    moved, left = lanes[W + j], lanes[LEFT + j] + later * gain
    last = (
        moved
        + later * gain * (HALF_PI - lanes[BEGAN + j])
        + eq.attenuated_displacement(left, lanes[HELD + j], math.inf)
    )
    return later * (moved + braked + math.pi * gain * (later - 1.0)) + last


@scalar
def lane_attenuation(kind: int, cycles: int, lanes: np.ndarray) -> None:
    """Eq. 12, and all cycles: W in W, the largest V in PEAK.

    Where a block still slides at the next Üg = Üy, Eq. 4 and the hold act on it as in the
    pulse before, so that each cycle adds the same velocity v: an arithmetic series.  But what
    sticks at Üg = Üy when at rest does not when it slides: `lane_carried` goes on with it.
    """
    for j in range(STRIP):
        held, left, moved = lanes[HELD + j], lanes[LEFT + j], lanes[W + j]
        pause = pause_of(lanes[BEGAN + j])
        carried = eq.attenuated_velocity(left, held, pause)
        braked = eq.attenuated_displacement(left, held, pause)
        later = cycles - 1.0
        lanes[CARRIED + j], lanes[MOVED + j] = carried, moved + braked
        lanes[LAST + j] = moved + eq.attenuated_displacement(left, held, math.inf)
        lanes[HIGHEST + j], lanes[ONSET + j] = lanes[PEAK + j], lanes[START + j]
        lanes[W + j] = lane_series(lanes, j, braked, carried, later)
        lanes[PEAK + j] += later * carried
        still = (carried > 0.0) & (cycles > 1)
        lanes[CODE + j] = NOT_RECOUPLED if still else 0
        # -1: right so far, but not over
        lanes[CONVERGED + j] *= -1.0 if still & (kind == STICKS) else 1.0


@scalar
def lane_recoupling(shape: int, cycles: int, lanes: np.ndarray) -> None:
    """From Üg = 0 on by integration, χ = φ − π to the stop, which comes before 2π for b ≥ Üy; and all cycles."""
    sliding = 0
    for j in range(STRIP):
        sliding += 1 if lanes[LEFT + j] > 0.0 else 0
    for j in range(STRIP):
        lanes[CODE + j] = 0.0
        lanes[W + j] *= 1.0 if sliding > 0 else cycles
    if sliding == 0:
        return
    for j in range(STRIP):
        # as the half wave's integral is no less than this parabola, its zero lies beyond the stop
        b, left = lanes[HELD + j], lanes[LEFT + j]
        curvature = lanes[AMPLITUDE + j] * half_wave_bound(shape)
        longest = left / b
        lanes[PSI + j] = min(2.0 * longest / (1.0 + math.sqrt(1.0 + 2.0 * (curvature / b) * longest)), math.pi)
        lanes[X + j] = 0.0
    settle(RECOUPLING, shape, PSI, X, 1.0, 0.0, lanes)
    for j in range(STRIP):
        lanes[CONVERGED + j] = min(lanes[CONVERGED + j], lanes[X + j])
    for j in range(STRIP):
        amplitude, b, chi = lanes[AMPLITUDE + j], lanes[HELD + j], lanes[PSI + j]
        lanes[W + j] += (lanes[LEFT + j] - 0.5 * b * chi) * chi - amplitude * half_wave(shape, chi)[2]
        lanes[W + j] *= cycles
