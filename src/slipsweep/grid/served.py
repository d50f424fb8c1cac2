"""What the arithmetic serves: results that double precision does not hold are refused, by the names of what gave them.

Each parameter alone keeps its bounds (`parameters.BOUNDS`).  Several of them together may still be too much: A/ω² of
A = 1e300 and f = 1e-100 is no double.  Within `ORDINARY` nothing is, so that nothing need be looked for.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.parameters import number_text
from slipsweep.model.variables import VALUELESS

#: Inputs that make no result infinite.
UNBOUNDED = ("theta", "structure_frequency", "polarity")

#: Largest magnitude of inputs, and inverse of the least but 0, whose results are all finite: u grows as A² N²/(b ω²)
#: with N cycles and a braking rate b that may be all rounding of A.
ORDINARY = 1e40

Array = NDArray[np.float64]


def is_ordinary(values: Array) -> bool:
    """Whether all values are 0, NaN (by default) or of ordinary magnitude."""
    if not values.size:
        return True
    # without an array of magnitudes: there may be as many values as results
    low, high = np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)
    if low >= 1.0 / ORDINARY or math.isnan(low):
        return not high > ORDINARY
    size = np.abs(values)
    return not ((size > ORDINARY) | ((size > 0.0) & (size < 1.0 / ORDINARY))).any()


def check_served(
    g: float, arrays: Mapping[str, Array], results: Mapping[str, NDArray[Any]], validity: NDArray[np.int16]
) -> None:
    """Refuse results that are no finite numbers without a flag that says why.

    Parameters
    ----------
    g : float
    arrays : mapping of str to array
        Inputs, which broadcast to the results.
    results, validity
        Arrays of one shape; codes among the results do not count.

    Raises
    ------
    InputError
        Naming the inputs of the first such cell that are out of the ordinary.
    """
    valued = (validity & np.int16(VALUELESS)) == 0
    for name, values in results.items():
        if values.dtype.kind != "f":
            continue
        wrong = valued & ~np.isfinite(values)
        if wrong.any():
            cell = np.unravel_index(int(wrong.argmax()), wrong.shape)
            inputs = {one: float(np.broadcast_to(given, wrong.shape)[cell]) for one, given in arrays.items()} | {"g": g}
            odd = {
                one: value for one, value in inputs.items() if one not in UNBOUNDED and not is_ordinary(np.array(value))
            }
            named = ", ".join(f"{one} = {number_text(value)}" for one, value in (odd or inputs).items())
            raise InputError(
                f"{named}: {name} is then no finite number; must be nearer to 1 (between {1.0 / ORDINARY:g} and "
                f"{ORDINARY:g} all results are finite)"
            )
