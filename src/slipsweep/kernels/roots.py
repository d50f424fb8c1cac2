"""The one root finder of the kernels: events are where something of the motion passes zero.

It is Newton's iteration, kept in a bracket, which is halved where Newton's steps would leave it or
come to no end.  A root that is not found is NaN, and so is then the displacement: the run ends with
an error that names the cell (`block.UNSOLVED`).  Why an event's error hardly matters:
docs/numerics.md#finding-events.
"""

import math
from collections.abc import Callable
from typing import Any

from slipsweep.jit.decorators import scalar

#: Relative size of the last step to an event: the error left is its square, and at most events
#: enters the result squared again.
EVENT_TOLERANCE = 1e-9

#: Steps of `root_of`: as many halvings reach 1e-60 of the bracket.
_MOST_STEPS = 200

#: A root so close to the origin, as a part of the bracket, lies there.  Newton's iteration comes to
#: a double one by halves.
_AT_ORIGIN = 1e-30


def root_of(value_and_slope: Callable[[Any, float], tuple[float, float]]) -> Callable[..., float]:
    """The jitted root finder of a function: ``value_and_slope(where, x)`` gives f(x) and df/dx."""

    @scalar
    def root(where: Any, below: float, above: float, x: float, origin: float) -> float:
        """Return where f passes 0 between `below`, where it is negative, and `above`.

        The search begins at x; NaN says that it has found nothing.

        `where` is what f is a function of besides x, and `origin` what x is counted from: the
        root is within 1e-9 of its distance from there.
        """
        width = last = before_last = abs(above - below)
        for _ in range(_MOST_STEPS):
            value, slope = value_and_slope(where, x)
            if math.isnan(value):
                break
            if value >= 0.0:
                above = x
            else:
                below = x
            new = x - value / slope
            # halved, too, where two steps are not half as long as the two before: Newton's may go
            # to and fro
            if not (
                min(below, above) <= new <= max(below, above) and 2.0 * abs(new - x) <= before_last
            ):
                new = 0.5 * (below + above)
            before_last = last
            last = abs(new - x)
            x = new
            if last <= EVENT_TOLERANCE * abs(x - origin):
                return x
        return x if abs(x - origin) <= _AT_ORIGIN * width else math.nan

    return root


@scalar
def straight_stop(velocity: float, rate: float, slope: float) -> float:
    """Return the time after which V ≥ 0, of a rate that changes by `slope`, is 0; infinity: never.

    The roots of V + rate t + slope t²/2, each by the form that does not cancel.
    docs/numerics.md#straight-pieces
    """
    square = rate * rate - 2.0 * slope * velocity
    if rate > 0.0:
        return (rate + math.sqrt(square)) / -slope if slope < 0.0 else math.inf
    if square < 0.0:
        return math.inf
    fall = math.sqrt(square) - rate
    return 2.0 * velocity / fall if fall > 0.0 else math.inf
