"""The displacement that limits are set on: the permanent one, or the largest |u| over time.

A block that slides both ways may come back to where it began.  It needs room for the largest |u|.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.model.options import Model, changing_strength, slides_both_ways
from slipsweep.model.variables import EXTREMES, Validity

#: Attribute `criterion` of the results of a block that slides both ways.
LARGEST = "largest displacement over time, downslope or upslope"


def results_of(model: Model) -> tuple[str, ...]:
    """Return the names of the results that the displacement follows from."""
    names = tuple(EXTREMES) if slides_both_ways(model) else ("permanent_displacement",)
    return names if changing_strength(model) is None else (*names, "validity")


def displacement_of(results: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    """Return the displacement that limits are set on, m, from these results.

    It is infinite where the block does not come to rest.
    """
    if "largest_displacement" in results:
        upslope = -results["smallest_displacement"]
        moved = np.asarray(np.maximum(results["largest_displacement"], upslope))
    else:
        moved = results["permanent_displacement"]
    if "validity" not in results:
        return moved
    return np.where(results["validity"] & Validity.NOT_AT_REST.value, math.inf, moved)


def attributes_of(model: Model) -> dict[str, str]:
    """Return the attribute `criterion`, if limits are set on the largest |u|."""
    return {"criterion": LARGEST} if slides_both_ways(model) else {}
