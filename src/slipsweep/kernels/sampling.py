"""Samples of a history, which the walk fills in as it passes them.

Each part of the motion (`hold`, `follow`, `follow_eq4`, `attenuate`) fills those that lie in it, by
the functions that integrate it: a history ends at the displacement that the sweep gives.
"""

import numpy as np

from slipsweep.jit.decorators import scalar
from slipsweep.kernels.slide import SLIDES_ON, Slide

#: Rows of samples: the phase (of a record: the time at scale 1) and Üg, which are given, and Ü, V
#: and W.
PHASE, GROUND_ACCELERATION, BLOCK_ACCELERATION, VELOCITY, DISPLACEMENT = range(5)


@scalar
def has_sample(slide: Slide, samples: np.ndarray, start: float, end: float) -> bool:
    """Return True if the next sample lies in the part of the motion between two phases of the path.

    `slide.since` is then the phase from the start to it.  Samples before are of a block at rest.
    """
    while slide.sampled < samples.shape[1]:
        phase = samples[PHASE, slide.sampled] - slide.phases_before
        if phase >= end:
            return False
        slide.since = max(phase - start, 0.0)
        passed = start - slide.began
        displacement = slide.displacement_before + slide.velocity_before * passed
        samples[DISPLACEMENT, slide.sampled] = displacement + slide.displacement
        # a part that is entered with V follows the one before: what lies between is rounding
        if phase >= start or slide.velocity_before + slide.velocity != 0.0:
            return True
        slide.sampled += 1
    return False


@scalar
def fill_sample(
    slide: Slide, samples: np.ndarray, acceleration: float, gained: float, moved: float
) -> None:
    """Fill in the sample that `has_sample` has come to: Ü, and gains of V and W from rest."""
    at = slide.sampled
    before = slide.velocity_before + slide.velocity
    velocity = before + gained
    if slide.kind != SLIDES_ON:  # beyond a stop, by rounding
        velocity = max(velocity, 0.0) if before >= 0.0 else min(velocity, 0.0)
    samples[BLOCK_ACCELERATION, at] = acceleration
    samples[VELOCITY, at] = velocity
    samples[DISPLACEMENT, at] += before * slide.since + moved
    slide.sampled += 1
