"""What steps of one length do not resolve: slides and layers of friction shorter than a few of them.

The state of a block is a small array, rows as in `slipsweep.kernels.pulse` and four more; docs/numerics.md#step-solver.
"""

import math

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.block import (
    NEWMARK,
    Block,
    inflection,
    response_and_slope,
    slope_root,
)
from slipsweep.kernels.excitation import offset_at, phase_at
from slipsweep.kernels.pulse import (
    BEGAN_AT,
    HELD,
    STATE_ROWS,
)
from slipsweep.kernels.step.table import Steps
from slipsweep.motion.pieces import BEGIN, FINISH, FIRST, LAST, START, TOP

#: No slide up to its greatest rate, and no layer of decaying friction, is covered by fewer than
#: steps_per_cycle / 64 steps, or one shorter than a step would not converge with the step.
SHARE_OF_CYCLE = 64

_SHORTEST = 2.0 * math.pi / SHARE_OF_CYCLE

#: Friction decays in a layer of this many e-foldings: e^-40 of it is less than rounding.
_FOLDINGS = 40.0

#: No step is shorter: it would no longer move the phase.
LEAST_STEP = 1e-14

#: Rows of a state beside those of every solver's: the phase up to which the last slide needs steps of its own,
#: and how long its rate grows; the plane's acceleration where D has its maximum on the way up, and that up to
#: which friction is a layer thinner than steps.
REACH, LENGTH, TOUCH, LAYER = range(STATE_ROWS, STATE_ROWS + 4)

STATE_SIZE = STATE_ROWS + 4


@scalar
def reset_state(block: Block, state: np.ndarray) -> None:
    """Fill the state of a block at rest that has not moved yet."""
    state[:] = 0.0
    state[BEGAN_AT], state[REACH], state[TOUCH] = -math.inf, -math.inf, math.inf
    if block.rise == NEWMARK:
        return
    if block.decay_rate * block.amplitude * _SHORTEST > _FOLDINGS * block.g:
        state[LAYER] = _FOLDINGS * block.g / block.decay_rate
    # D = x − E is concave only beyond the inflection of E: it has its maximum there, if at all, and none where
    # friction is steeper than the plane and decays by more than tan θ
    steep = block.mu_s < block.tan_theta or block.decay_rate < block.tan_theta
    if steep and response_and_slope(block, block.amplitude)[1] > 1.0:
        low = max(inflection(block), LEAST_STEP * block.amplitude)
        if low < block.amplitude and response_and_slope(block, low)[1] < 1.0:
            state[TOUCH] = slope_root(block, 1.0, low, block.amplitude)


@scalar
def layer_of(block: Block, pieces: np.ndarray, p: int, state: np.ndarray) -> tuple[float, float]:
    """τ at which the layer of friction on piece p ends (or begins, where |Üg| falls), and its length."""
    outwards = pieces[p, FINISH] == 0.0
    near = pieces[p, BEGIN] if outwards else pieces[p, FINISH]
    if state[LAYER] <= block.amplitude * min(abs(pieces[p, FIRST]), abs(pieces[p, LAST])):
        return near, 0.0
    end = offset_at(pieces, p, block.amplitude, math.copysign(state[LAYER], pieces[p, TOP]))
    return end, abs(end - near)


@scalar
def longest_step(
    block: Block, steps: Steps, pieces: np.ndarray, p: int, tau: float, x: float, state: np.ndarray
) -> float:
    """The longest step from τ on that resolves a slide just begun and a layer of friction on the rise.

    It grows with the time since the slide's onset, but not before the short slides end that stop soon after
    the peak: over steps of one length the rectangle's errors on the way up and down cancel.
    """
    share, longest = SHARE_OF_CYCLE / steps.per_cycle, math.inf
    phi = phase_at(pieces, p, tau)
    if phi < state[REACH]:
        longest = share * max(state[LENGTH], 0.25 * (phi - state[BEGAN_AT]))
    if x < state[LAYER]:
        longest = min(longest, share * layer_of(block, pieces, p, state)[1])
    return max(longest, LEAST_STEP)


@scalar
def resolve_slide(pieces: np.ndarray, p: int, tau: float, turn: float, state: np.ndarray) -> None:
    """A slide begins at τ on piece p; its rate grows up to τ = `turn`."""
    phi, length = phase_at(pieces, p, tau), turn - tau
    state[LENGTH] = length
    state[REACH] = phi + 4.0 * _SHORTEST if length < _SHORTEST else -math.inf


@scalar
def resolve_fall(block: Block, pieces: np.ndarray, p: int, state: np.ndarray) -> None:
    """Along a piece on which Üg does not rise: if a slide begins with it, it grows up to where Üg = b."""
    if state[BEGAN_AT] == pieces[p, START]:
        level = pieces[p, FIRST] == pieces[p, LAST]
        turn = pieces[p, FINISH] if level else offset_at(pieces, p, block.amplitude, state[HELD])
        resolve_slide(pieces, p, pieces[p, BEGIN], turn, state)
