"""Checks of values that callers give: one clear message for the first that is not allowed.

The bounds and units are those of `model/parameter_table.py`.  NumPy is imported inside functions:
the command line imports this module, and `slipsweep --help` need not load NumPy.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Mapping, Set
from contextlib import suppress
from decimal import Decimal
from numbers import Real
from typing import TYPE_CHECKING, Any

from slipsweep.errors import InputError
from slipsweep.model.parameter_table import PARAMETER_TABLE, QUANTITIES, Bound
from slipsweep.model.units import without_unit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Gravity of the models by default, m/s²: the value that reproduces the paper's tables.
GRAVITY = 9.81

#: Most cycles of shaking and most points of a history: more than any case needs, and far less than
#: the kernels, which have 64 bits, can count.
MOST_CYCLES = MOST_POINTS = 1_000_000_000

#: Bounds of each parameter and of other numbers.  A value that physics does not allow is an error,
#: not a NaN.  Polarities are checked in `grid/inputs.py`.
BOUNDS: dict[str, Bound] = {
    **{row.name: row.bound for row in PARAMETER_TABLE if row.name != "polarity"},
    **{name: quantity.bound for name, quantity in QUANTITIES.items()},
}

#: Units to which values are converted that bring one.
_UNITS: dict[str, str] = {
    **{row.name: row.units for row in PARAMETER_TABLE},
    **{name: quantity.units for name, quantity in QUANTITIES.items() if quantity.units},
}


def number_text(value: float) -> str:
    """Return a number with all its digits, a whole one without a decimal point."""
    return repr(value).removesuffix(".0")


def shown(value: Any) -> str:
    """Return the text of a value in an error: one line of at most 160 characters."""
    import numpy as np

    with np.errstate(all="ignore"):  # pandas and numpy compute to write numbers
        text = " ".join(repr(value).split())
    return text if len(text) <= 160 else f"{text[:157]}..."


def check_numbers(key: str, values: Any) -> NDArray[np.float64]:
    """Return `values` as an array of float64; every number that a caller gives is converted here.

    InputError: they are not real numbers, or some entries are masked.  A masked entry stores a
    number but stands for a missing value.
    """
    import numpy as np

    array: Any = computed(values)
    if isinstance(array, np.ma.MaskedArray) and (masked := int(np.ma.count_masked(array))):
        raise InputError(
            f"{key}: {masked} of {array.size} values are masked: must be numbers, every one of them"
        )
    try:
        array = np.asarray(array)
        are_real = array.dtype == object and all(
            isinstance(entry, (Real, Decimal)) for entry in array.flat
        )
        if array.dtype.kind not in "iuf" and not are_real:
            raise TypeError
        # numbers beyond double precision become infinite, and the bounds refuse infinity
        with np.errstate(over="ignore"):
            return np.asarray(array.astype(np.float64))
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{key} = {shown(values)}: must be a number, or an array of numbers"
        ) from None


def computed(values: Any) -> Any:
    """Return the array inside a DataArray or a dask array, with its mask.

    `numpy.asarray` would drop the mask.
    """
    values = getattr(values, "data", values) if hasattr(values, "dims") else values
    dask = sys.modules.get("dask.array")  # it is loaded if `values` is one of its arrays
    return values.compute() if dask and isinstance(values, dask.Array) else values


def check_values(
    name: str, values: Any, key: str | None = None, g: float = GRAVITY
) -> NDArray[np.float64]:
    """Return `values` as float64, in the unit of parameter `name` and within its bounds.

    Values with a unit (a pint Quantity, a DataArray with the attribute `units`) are converted to
    that of the parameter; the unit "g" is `g` m/s².  InputError: a value is out of bounds; the
    message calls the parameter `key`.
    """
    key = key or name
    if name in _UNITS:
        values = without_unit(key, _UNITS[name], values, g)
    array = check_numbers(key, values)
    bound = BOUNDS[name]
    outside = array[~bound.holds(array)]
    if outside.size:
        raise InputError(f"{key} = {number_text(float(outside[0]))}: must be {bound.text}")
    return array


def check_single(name: str, value: Any, key: str | None = None) -> float:
    """Return a single number within the bounds of parameter `name`; errors call it `key`."""
    values = check_values(name, value, key)
    if values.ndim:
        raise InputError(f"{key or name} = {shown(value)}: must be a single number")
    return float(values)


def check_finite(key: str, value: Any) -> float:
    """Return a single finite number of any sign."""
    with suppress(InputError):
        number = check_numbers(key, value)
        if number.ndim == 0 and math.isfinite(number):
            return float(number)
    raise InputError(f"{key} = {shown(value)}: must be a finite number")


def check_whole(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Return `value` as an int if it is a whole number from `least` to `most`."""
    number = value  # not as a float: an integer may have more digits than a double
    if not isinstance(value, int) or isinstance(value, bool):
        number = math.nan
        with suppress(InputError):
            number = check_finite(name, value)
    if not number >= least or number % 1:
        raise InputError(f"{name} = {shown(value)}: must be a whole number >= {least}")
    if most is not None and number > most:
        raise InputError(f"{name} = {shown(value)}: must be a whole number <= {most}")
    return int(number)


def friction_coefficient(phi: Any) -> Any:
    """Static friction coefficient μs = tan φ of friction angles in degrees.

    InputError: an angle is out of bounds.
    """
    import numpy as np

    check_values("phi", phi)
    return np.tan(np.radians(phi))


def check_friction(inputs: Mapping[str, Any]) -> None:
    """Raise InputError unless static friction is given as `mu_s` or as `phi`, not as both.

    An input that is None is not given.
    """
    if inputs.get("phi") is None:
        check_given(inputs, ("mu_s",))
    elif inputs.get("mu_s") is not None:
        raise InputError("phi, mu_s: must not both be given; mu_s = tan(phi)")


def single_friction_coefficient(mu_s: Any, phi: Any) -> float:
    """Return the friction coefficient of one block, from `mu_s` or from the friction angle `phi`.

    InputError: both are given, or neither.
    """
    check_friction({"mu_s": mu_s, "phi": phi})
    if phi is not None:
        mu_s = friction_coefficient(check_single("phi", phi))
    return check_single("mu_s", mu_s)


def check_given(inputs: Mapping[str, Any], names: Collection[str]) -> None:
    """Raise InputError if one of the parameters `names` is missing, or None."""
    for name in names:
        if inputs.get(name) is None:
            raise InputError(f"{name}: must be given")


def check_choice(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return `value` if it is one of `allowed`; InputError otherwise."""
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{name} = {shown(value)}: must be one of {', '.join(map(repr, allowed))}")
    return str(value)


def check_choices(name: str, values: Any, allowed: Collection[str]) -> tuple[str, ...]:
    """Return the names in `values`, in the order of `allowed`.

    InputError: a name is not in `allowed`, or there is none.
    """
    names = [check_choice(name, value, allowed) for value in check_list(name, values, "names")]
    if not names:
        raise InputError(f"{name} = []: must name one of {', '.join(map(repr, allowed))} at least")
    return tuple(choice for choice in allowed if choice in names)


def check_list(key: str, values: Any, what: str) -> list[Any]:
    """Return the entries of a list, an array or another ordered collection.

    `what` says in errors what the entries should be.
    """
    if isinstance(values, Iterable) and not isinstance(values, (str, bytes, Mapping, Set)):
        with suppress(TypeError):  # of an array without dimensions
            return list(values)
    raise InputError(f"{key} = {shown(values)}: must be a list of {what}")


def check_progress(progress: Any) -> Any:
    """Return `progress`, a function of a number of cells or None (InputError: it is neither)."""
    if progress is not None and not callable(progress):
        raise InputError(f"progress = {shown(progress)}: must be a function of a number of cells")
    return progress
