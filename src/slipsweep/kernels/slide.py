"""The state of a block within a pulse, which the walk changes."""

from typing import Any, TypeAlias

import numpy as np

from slipsweep.jit.decorators import inlined, scalar
from slipsweep.motion.pieces import NODES

#: More stages than any rise has: five places where E, dE/dx or D turn, and a stop and an onset
#: between each.
MOST_STAGES = 32

#: Kinds of motion: b held, b by Eq. 4 up to a stop, Eq. 12, and b by Eq. 4 whatever the
#: sign of V.
HELD, FOLLOWS_EQ4, ATTENUATES, SLIDES_ON = range(4)

#: The block in a pulse.
SLIDE = np.dtype(
    (
        np.record,
        np.dtype(
            [
                # V, and W since the beginning of the pulse; the largest and the least V
                ("velocity", np.float64),
                ("displacement", np.float64),
                ("peak", np.float64),
                ("least", np.float64),
                # how b goes on (HELD, …), and b: held, or as last taken from Eq. 4
                ("kind", np.int64),
                ("held", np.float64),
                # on a rise of Üg: b is E so far
                ("follows", np.bool_),
                ("slides", np.bool_),
                # if the largest V is requested
                ("wants_peak", np.bool_),
                # slides that began from rest
                ("slips", np.float64),
                # for the samples of a history: their number so far, and the phase from the start of
                # a part to the next one; the phase at the beginning of the pulse, V and W there,
                # to which `velocity` and `displacement` are added; what phases of the path are to
                # be increased by, as the path has the plain cycle once
                ("sampled", np.int64),
                ("since", np.float64),
                ("began", np.float64),
                ("velocity_before", np.float64),
                ("displacement_before", np.float64),
                ("phases_before", np.float64),
                # for continuous sliding: zeros of D on either side of Üg = 0, and their numbers
                ("zeros", np.float64, (2, MOST_STAGES)),
                ("zero_counts", np.int64, (2,)),
                # for the quadrature: |Üg| and μ at its nodes
                ("nodes", np.float64, (NODES.size,)),
                ("friction", np.float64, (NODES.size,)),
            ],
            align=True,
        ),
    )
)

#: A record of SLIDE.
Slide: TypeAlias = Any


@inlined
def begin_pulse(slide: Slide, velocity: float) -> None:
    """Set the state of a block at the beginning of a pulse that it enters with V = `velocity`."""
    slide.velocity = velocity
    slide.displacement = 0.0
    slide.peak = velocity
    slide.least = velocity
    slide.slides = velocity > 0.0
    slide.slips = 0.0


@inlined
def begin_to_slide(slide: Slide, held: float) -> None:
    """Let a block at rest begin to slide with an acceleration (t1)."""
    slide.velocity = 0.0
    slide.held = held
    slide.slides = True
    slide.slips += 1.0


@scalar
def gain(slide: Slide, velocity: float, displacement: float) -> None:
    """Set V at the end of a part of the motion, and add the W gained in it."""
    slide.velocity = velocity
    slide.displacement += displacement
    slide.peak = max(velocity, slide.peak)
    slide.least = min(velocity, slide.least)
