"""A cosine in the lanes of the sine: its shaking begins at a peak, to which Üg jumps, and ends at one.

docs/numerics.md#lanes-of-the-cosine
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import AMPLITUDE, BEGAN, INTEGRATE, NOT_RECOUPLED, YIELD, Options, lane_response
from slipsweep.kernels.events import STRIP
from slipsweep.kernels.sine.carried import follow_pulses
from slipsweep.kernels.sine.cells import Room, carry_of, lanes_of
from slipsweep.kernels.sine.continuous import DIP, lane_quarters, lane_turns
from slipsweep.kernels.sine.cycles import lane_attenuation, lane_recoupling
from slipsweep.kernels.sine.lanes import (
    AT_PEAK,
    CARRIED,
    CODE,
    CONVERGED,
    GAIN,
    HELD,
    HIGHEST,
    MOST,
    MOVED,
    PEAK,
    SLIDES_ON,
    SLOWEST,
    STICKS,
    THROUGH,
    TO_PEAK,
    V,
    W,
    X,
)
from slipsweep.kernels.sine.pulse import lane_fall, lane_onset, lane_rise
from slipsweep.kernels.sine.shapes import SINE
from slipsweep.model import equations as eq

#: Rows of lanes that pulses of the sine entered in motion have for something else: of a whole pulse from rest W up to
#: the next Üg = Üy, the largest V, and b from the peak on.
_WHOLE, _WHOLE_PEAK, _WHOLE_HELD = THROUGH, SLOWEST, MOST


@scalar
def lane_to_next(kind: int, options: Options, lanes: np.ndarray) -> None:
    """From the peak to the next Üg = Üy: W in MOVED, V left there in CARRIED, the largest V in PEAK."""
    lane_fall(SINE, options.wants_peak, lanes)
    if options.recoupling == INTEGRATE:
        lane_recoupling(SINE, 1, lanes)
        for j in range(STRIP):
            lanes[MOVED + j], lanes[CARRIED + j] = lanes[W + j], 0.0
    else:
        lane_attenuation(kind, 1, lanes)


@scalar
def lane_pulses(kind: int, options: Options, lanes: np.ndarray) -> None:
    """Half a pulse from the first peak on, whole ones, and a rise to the last peak: W in W, the largest V in PEAK.

    docs/numerics.md#lanes-of-the-cosine
    """
    lane_onset(kind, SINE, options.g, lanes)
    lane_rise(kind, SINE, options.g, lanes)
    for j in range(STRIP):
        lanes[AT_PEAK + j], lanes[TO_PEAK + j], lanes[_WHOLE_HELD + j] = lanes[V + j], lanes[W + j], lanes[HELD + j]
    lane_to_next(kind, options, lanes)
    for j in range(STRIP):
        lanes[_WHOLE + j], lanes[_WHOLE_PEAK + j], lanes[GAIN + j] = (
            lanes[MOVED + j],
            lanes[PEAK + j],
            lanes[CARRIED + j],
        )
        lanes[V + j] = lanes[W + j] = 0.0
        if kind == STICKS:  # a whole pulse may hold more, which it has taken up on the way to the peak
            lanes[HELD + j] = max(lanes[YIELD + j], lane_response(lanes, j, lanes[AMPLITUDE + j], options.g))
    lane_to_next(kind, options, lanes)
    # a block that sticks at Üg = Üy when at rest goes on otherwise when it comes there in motion (`go_on`)
    goes_on, whole = 0.0 if kind == STICKS else 1.0, options.cycles - 1.0
    for j in range(STRIP):
        moves = (lanes[CARRIED + j] > 0.0) | ((lanes[GAIN + j] > 0.0) & (whole > 0.0))
        first, gain = goes_on * lanes[CARRIED + j], goes_on * lanes[GAIN + j]
        entered = first + whole * gain
        at_end = lanes[AT_PEAK + j] + entered
        last = lanes[TO_PEAK + j] - entered * lanes[BEGAN + j]
        last += eq.attenuated_displacement(at_end, lanes[_WHOLE_HELD + j], math.inf)
        pulses = whole * (lanes[_WHOLE + j] + math.pi * (2.0 * first + gain * (whole - 1.0)))
        lanes[W + j] = lanes[MOVED + j] + pulses + last
        highest = lanes[_WHOLE_PEAK + j] + (entered - gain) if whole > 0.0 else 0.0
        lanes[HIGHEST + j] = lanes[PEAK + j]
        lanes[PEAK + j] = max(max(lanes[PEAK + j], highest), at_end)
        lanes[CODE + j] = NOT_RECOUPLED if moves else 0.0
        # -1: right but for what it does in motion (`carry_of`)
        lanes[CONVERGED + j] *= -1.0 if moves & (kind == STICKS) else 1.0


@scalar
def go_on(shape: int, count: int, options: Options, lanes: np.ndarray) -> None:
    """The pulses after the first half of `count` lanes that stick at Üg = Üy when at rest, but come there in motion."""
    for j in range(count):
        rest = lanes[GAIN + j], lanes[_WHOLE + j], lanes[_WHOLE_PEAK + j]
        follow_pulses(shape, options, options.cycles, True, rest, lanes, j)


@scalar
def lane_continuous(kind: int, options: Options, lanes: np.ndarray) -> None:
    """Continuous sliding from the first peak on: W in W, the largest V in PEAK.

    docs/numerics.md#lanes-of-the-cosine
    """
    lane_quarters(SINE, options.g, lanes)
    for j in range(STRIP):
        lanes[W + j] = math.pi * lanes[GAIN + j] * options.cycles * options.cycles
    if options.wants_peak:
        lane_turns(kind, SINE, options.g, lanes)
        for j in range(STRIP):
            up, dip, drift = lanes[V + j], lanes[DIP + j], lanes[GAIN + j]
            fall, rise = max(up, up - dip), max(max(0.0, dip), up)
            highest = max(max(0.0, fall), max(up + lanes[X + j], drift - up + rise))
            lanes[PEAK + j] = highest + (options.cycles - 1.0) * max(0.0, drift)


@scalar
def solve_strip(kind: int, options: Options, lanes: np.ndarray) -> None:
    """Lanes of one kind, from the first peak to the end of all cycles."""
    if kind >= SLIDES_ON:  # or TURNS_LATE
        lane_continuous(kind, options, lanes)
    else:
        lane_pulses(kind, options, lanes)


_solve_cells = lanes_of(SINE, solve_strip, carry_of(go_on))


def solve_under_cosine(
    cells: np.ndarray, count: int, options: Options, room: Room, motion: np.ndarray, codes: np.ndarray
) -> int:
    """As `solve_under_sine`."""
    return _solve_cells(cells, count, options, room, motion, codes)
