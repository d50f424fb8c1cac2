"""The displacement that limits are set on: the permanent one, or the largest |u| over time.

A block that slides both ways may come back to where it began.  What it needs room for is the
largest |u|.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.model.options import Model, slides_both_ways
from slipsweep.model.variables import EXTREMES

#: What results say of a block that slides both ways.
LARGEST = "largest displacement over time, downslope or upslope"


def results_of(model: Model) -> tuple[str, ...]:
    """Return the names of the results that the displacement follows from."""
    return tuple(EXTREMES) if slides_both_ways(model) else ("permanent_displacement",)


def displacement_of(results: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    """Return the displacement that limits are set on, m, from these results."""
    if "largest_displacement" not in results:
        return results["permanent_displacement"]
    upslope = -results["smallest_displacement"]
    return np.asarray(np.maximum(results["largest_displacement"], upslope))


def attributes_of(model: Model) -> dict[str, str]:
    """Return the attribute that says so."""
    return {"criterion": LARGEST} if slides_both_ways(model) else {}
