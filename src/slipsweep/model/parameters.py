"""What a caller gives, checked: one clear message for the first thing that cannot be.

NumPy is imported where it is needed: the command line's options, hence `slipsweep --help`, come
from here.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Mapping, Set
from contextlib import suppress
from decimal import Decimal
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

from slipsweep.errors import InputError
from slipsweep.model.units import without_unit
from slipsweep.model.variables import PARAMETERS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: The largest number, whose inverse is the least of those that are above zero: more than physics
#: ever needs, and so much less than the largest double that no result of several of them overflows.
LARGEST = 1e30

#: Gravity of the models by default, m/s²: the value that reproduces the paper's tables.
GRAVITY = 9.81

#: More than any shaking has, or any accuracy needs; the kernels count in 64 bits.
MOST_CYCLES = MOST_POINTS = 1_000_000_000

#: Largest rate constant of friction, s/m: friction is the fast one from micrometres a second on, and
#: steps are as short as that takes.
FASTEST_RATE = 1e5

#: Longest ramp in cycles, each of which has pieces of its own.
MOST_RAMP = 100


class Bound(NamedTuple):
    """A closed interval, and how to say it."""

    low: float
    high: float
    text: str

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which values lie in the interval (NaN and infinity never do)."""
        return (values >= self.low) & (values <= self.high)


def _from(low: float, high: float) -> Bound:
    least = f">= 0 and at most {high:g}" if low == 0.0 else f"from {low:g} to {high:g}"
    return Bound(low, high, f"a finite number {'> 0, ' if low > 0.0 else ''}{least}")


_ABOVE_0 = math.ulp(0.0)
_BELOW_1 = math.nextafter(1.0, 0.0)
_BELOW_90 = math.nextafter(90.0, 0.0)
_FINITE, _NOT_NEGATIVE, _POSITIVE = (_from(low, LARGEST) for low in (-LARGEST, 0.0, 1.0 / LARGEST))

#: What each parameter may be (MODEL: what no physics allows is an error, not a NaN).
BOUNDS: dict[str, Bound] = {
    "theta": Bound(0.0, _BELOW_90, "0 <= theta < 90 degrees"),
    "phi": Bound(_ABOVE_0, _BELOW_90, "0 < phi < 90 degrees"),
    "residual_phi": Bound(_ABOVE_0, _BELOW_90, "0 < residual_phi < 90 degrees"),
    "rate_constant": _from(0.0, FASTEST_RATE),
    "azimuth": Bound(0.0, 360.0, "0 <= azimuth <= 360 degrees"),
    "quantile": Bound(_ABOVE_0, _BELOW_1, "a number between 0 and 1"),
    **dict.fromkeys(("ramp_in", "ramp_out"), Bound(0.0, MOST_RAMP, f"0 to {MOST_RAMP}")),
    **dict.fromkeys(("yield_acceleration", "yield_coefficient"), _FINITE),
    **dict.fromkeys(
        ("decay_rate", "delta_mu", "pgv", "arias_intensity", "threshold"), _NOT_NEGATIVE
    ),
    **dict.fromkeys(("amplitude", "displacement_amplitude"), _NOT_NEGATIVE),
    **dict.fromkeys(("mu_s", "minimum_friction", "scale", "time_scale", "displacement"), _POSITIVE),
    **dict.fromkeys(("residual_mu", "weakening_distance", "fast_mu"), _POSITIVE),
    **dict.fromkeys(
        (
            "frequency",
            "structure_frequency",
            "maximum_amplitude",
            "upslope_yield_acceleration",
            "g",
            "interval",
        ),
        _POSITIVE,
    ),
}

#: Own units of all that may bring one.
_UNITS = {
    "displacement": "m",
    "threshold": "m",
    "maximum_amplitude": "m s-2",
    "g": "m s-2",
    "interval": "s",
} | {name: about["units"] for name, about in PARAMETERS.items()}


def number_text(value: float) -> str:
    """A number as people write it, and as precise as it is."""
    return repr(value).removesuffix(".0")


def shown(value: Any) -> str:
    """A value as an error shows it: one line, and not a long one."""
    import numpy as np

    with np.errstate(all="ignore"):  # pandas and numpy compute to write numbers
        text = " ".join(repr(value).split())
    return text if len(text) <= 160 else f"{text[:157]}..."


def check_numbers(key: str, values: Any) -> NDArray[np.float64]:
    """Return `values` as float64; every number that a caller gives comes through here.

    InputError: they are no real numbers, or entries of them are masked: a masked entry has a
    number, but means none.
    """
    import numpy as np

    array: Any = computed(values)
    if isinstance(array, np.ma.MaskedArray) and (masked := int(np.ma.count_masked(array))):
        raise InputError(
            f"{key}: {masked} of {array.size} values are masked: must be numbers, every one of them"
        )
    try:
        array = np.asarray(array)
        exact = array.dtype == object and all(
            isinstance(one, (Real, Decimal)) for one in array.flat
        )
        if array.dtype.kind not in "iuf" and not exact:
            raise TypeError
        with np.errstate(
            over="ignore"
        ):  # what is beyond double precision becomes infinite, and is refused as such
            return np.asarray(array.astype(np.float64))
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{key} = {shown(values)}: must be a number, or an array of numbers"
        ) from None


def computed(values: Any) -> Any:
    """What lies within a lazy array or one of xarray, masks with it, which `numpy.asarray` would drop."""
    values = getattr(values, "data", values) if hasattr(values, "dims") else values
    dask = sys.modules.get("dask.array")  # is loaded if one of its arrays is here
    return values.compute() if dask and isinstance(values, dask.Array) else values


def check_values(
    name: str, values: Any, key: str | None = None, g: float = GRAVITY
) -> NDArray[np.float64]:
    """Return `values` as float64 if all are in the bounds of parameter `name`, called `key` in errors (InputError).

    What brings a unit (a pint Quantity, an array of xarray with the attribute `units`) is converted
    to the parameter's own; "g" is `g` m/s².
    """
    key = key or name
    array = check_numbers(
        key, without_unit(key, _UNITS[name], values, g) if name in _UNITS else values
    )
    bound = BOUNDS[name]
    for wrong in array[~bound.holds(array)][:1]:
        raise InputError(f"{key} = {number_text(float(wrong))}: must be {bound.text}")
    return array


def check_single(name: str, value: Any, key: str | None = None) -> float:
    """Return a single number within the bounds of parameter `name`, called `key` in errors."""
    values = check_values(name, value, key)
    if values.ndim:
        raise InputError(f"{key or name} = {shown(value)}: must be a single number")
    return float(values)


def check_finite(key: str, value: Any) -> float:
    """Return a single finite number of whatever sign."""
    with suppress(InputError):
        number = check_numbers(key, value)
        if number.ndim == 0 and math.isfinite(number):
            return float(number)
    raise InputError(f"{key} = {shown(value)}: must be a finite number")


def check_whole(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Return `value` as an int if it is a whole number from `least` to `most`."""
    number = value  # as it is: an integer may have more digits than a double
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
    """Static friction coefficient μs = tan φ of friction angles, degrees (InputError: angles that are not allowed)."""
    import numpy as np

    check_values("phi", phi)
    return np.tan(np.radians(phi))


def check_friction(given: Mapping[str, Any]) -> None:
    """Refuse static friction that is not given, or given as a coefficient and as an angle; None is not given."""
    if given.get("phi") is None:
        check_given(given, ("mu_s",))
    elif given.get("mu_s") is not None:
        raise InputError("phi, mu_s: must not both be given; mu_s = tan(phi)")


def single_friction_coefficient(mu_s: Any, phi: Any) -> float:
    """The friction coefficient of one block, given itself or as the friction angle (InputError: both, or neither)."""
    check_friction({"mu_s": mu_s, "phi": phi})
    return check_single(
        "mu_s", mu_s if phi is None else friction_coefficient(check_single("phi", phi))
    )


def check_given(given: Mapping[str, Any], names: Collection[str]) -> None:
    """Refuse to go on without a parameter that has no default; None is none."""
    for name in names:
        if given.get(name) is None:
            raise InputError(f"{name}: must be given")


def check_choice(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return `value` if it is one of `allowed`; InputError otherwise."""
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{name} = {shown(value)}: must be one of {', '.join(map(repr, allowed))}")
    return str(value)


def check_choices(name: str, values: Any, allowed: Collection[str]) -> tuple[str, ...]:
    """Return which of `allowed` a caller names, one at least, in the order of `allowed`."""
    wanted = [check_choice(name, value, allowed) for value in check_list(name, values, "names")]
    if not wanted:
        raise InputError(f"{name} = []: must name one of {', '.join(map(repr, allowed))} at least")
    return tuple(one for one in allowed if one in wanted)


def check_list(key: str, values: Any, what: str) -> list[Any]:
    """Return what stands in a list, an array or anything else that has an order."""
    if isinstance(values, Iterable) and not isinstance(values, (str, bytes, Mapping, Set)):
        with suppress(TypeError):  # an array without dimensions
            return list(values)
    raise InputError(f"{key} = {shown(values)}: must be a list of {what}")


def check_progress(progress: Any) -> Any:
    """Return the function that is called with numbers of cells as they are solved, if there is one."""
    if progress is not None and not callable(progress):
        raise InputError(f"progress = {shown(progress)}: must be a function of a number of cells")
    return progress
