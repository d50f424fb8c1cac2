"""Events: where something of the motion passes zero.  The one root finder of the kernels, and its form in lanes.

Both are Newton's.  `root_of` keeps it in a bracket, and halves that where Newton's steps would leave it
or come to no end.  A root that it does not find is NaN, and so is then the displacement: the run ends
with an error that names the cell (`block.UNSOLVED`).  `sine.roots` takes the lanes of a strip to their
roots together, each from the side from which Newton's iteration comes there without a bracket, and marks those
that are not there in the end: they are left to the former.  Why an event's error hardly matters:
docs/numerics.md#finding-events.  `first_of` finds the first of many places, such as steps, at which something holds.
"""

import math
from collections.abc import Callable
from typing import Any

from slipsweep.jit.decorators import scalar

#: Relative size of the last step to an event: the error left is its square, and at most events enters the
#: result squared again.
EVENT_TOLERANCE = 1e-9

#: Steps of `root_of`: as many halvings reach 1e-60 of the bracket.
_MOST_STEPS = 200

#: A root so close to the origin, as a part of the bracket, lies there.  Newton's iteration comes to a
#: double one by halves.
_AT_ORIGIN = 1e-30

#: Lanes that are solved together, until the last of their iterations has settled: neighbours take as many.
#: Lanes are filled up to a multiple, so that no loop over them has a scalar remainder:
#: its roundings would differ, and a cell's last digits depend on how many stand beside it.
STRIP = 32


def root_of(value_and_slope: Callable[[Any, float], tuple[float, float]]) -> Callable[..., float]:
    """The jitted root finder of a function: ``value_and_slope(where, x)`` gives f(x) and df/dx.

    Bound here rather than passed as an argument: numba cannot keep a kernel on disk in which a
    function is a value.
    """

    @scalar
    def root(where: Any, below: float, above: float, x: float, origin: float) -> float:
        """Where f passes 0 between `below`, where it is negative, and `above`, from x on; NaN if not found.

        `where` is what f is a function of besides x, and `origin` what x is counted from: the
        root is within 1e-9 of its distance from there.
        """
        width = abs(above - below)
        last = before_last = width
        for _ in range(_MOST_STEPS):
            value, slope = value_and_slope(where, x)
            if math.isnan(value):
                break
            if value >= 0.0:
                above = x
            else:
                below = x
            new = x - value / slope
            # halved, too, where two steps are not half as long as the two before: Newton's may go to and fro
            if not (min(below, above) <= new <= max(below, above) and 2.0 * abs(new - x) <= before_last):
                new = 0.5 * (below + above)
            last, before_last = abs(new - x), last
            x = new
            if last <= EVENT_TOLERANCE * abs(x - origin):
                return x
        return x if abs(x - origin) <= _AT_ORIGIN * width else math.nan

    return root


def first_of(holds: Callable[[Any, int], bool]) -> Callable[..., int]:
    """The jitted search by halves for the first place at which ``holds(where, k)``, which holds from there on.

    Bound here for the same reason.
    """

    @scalar
    def first(where: Any, low: int, high: int) -> int:
        """The first place from `low` on, before `high`; `high` if there is none."""
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if holds(where, middle) else (middle + 1, high)
        return low

    return first
