"""Units that users give: the factor to a parameter's unit, and numbers with a unit in one text."""

import json
import math
import re
from typing import Any

from slipsweep.errors import InputError

#: Other spellings of the parameters' own units, which need no units library.
_SPELLINGS = dict.fromkeys(("deg", "degrees"), "degree") | dict.fromkeys(
    ("m/s2", "m/s^2", "m/s**2"), "m s-2"
)
_SPELLINGS |= {"m/s": "m s-1", "dimensionless": "1"}

#: Products and quotients of names with powers of one digit: no text can ask pint for a huge number.
_FACTOR = r"(?:[^\W\d]+0?|°)(?:\*\*-?[1-9])?"
_UNIT_GRAMMAR = re.compile(rf"(?:1/)?{_FACTOR}(?:[ */]{_FACTOR}){{0,8}}")


def conversion(key: str, target_unit: str, units: str | None, g: float) -> float:
    """Return the factor from `units` to the unit `target_unit` (InputError: they do not convert).

    Errors call the units `key`.  The unit "g" of an acceleration is `g` m/s², the gravity of the
    sweep: an amplitude "in g" refers to the gravity that acts on the block.
    """
    if units is None or _SPELLINGS.get(units, units) == target_unit:
        return 1.0
    if target_unit == "m s-2" and units in ("g", "gal", "Gal"):  # pint reads gram and gallon
        return g if units == "g" else 0.01

    refusal = InputError(f"{key} = {show(units)}: must be a unit that converts to {target_unit}")
    # "m s-2", "m/s2" and "m/s^2" are all common; pint reads "m s**-2" and "m/s**2"
    text = re.sub(r"(?<=[A-Za-z])\^?(-?[1-9])\b", r"**\1", units.strip())
    if target_unit == "1" or not _UNIT_GRAMMAR.fullmatch(text):
        raise refusal

    import pint  # only here: it takes 0.2 s to import

    registry = pint.get_application_registry()
    pint_unit = {"m s-2": "m/s**2", "m s-1": "m/s"}.get(target_unit, target_unit)
    try:
        quantity = registry.Quantity(1.0, text)
        root = quantity.to_root_units().units
        # Pint lets radians pass for pure numbers.  Here a slope in percent is no angle, and
        # 60 rpm or 2 pi rad/s is 1 Hz: one turn a cycle.
        if target_unit == "Hz" and "radian" in str(root):
            pint_unit = "turn/s"
        if root != registry.Quantity(1.0, pint_unit).to_root_units().units:
            raise refusal
        return float(quantity.to(pint_unit).magnitude)
    except (pint.PintError, ArithmeticError, AttributeError, TypeError, ValueError):
        raise refusal from None


def without_unit(key: str, target_unit: str, values: Any, g: float) -> Any:
    """Return `values` in the unit `target_unit`, without a unit of their own.

    A pint Quantity, and a DataArray with the attribute `units`, are converted; "g" is `g` m/s².
    Other values are returned unchanged.  InputError: the unit does not convert.
    """
    data = getattr(values, "data", values) if hasattr(values, "dims") else values
    if hasattr(data, "magnitude") and hasattr(data, "units"):
        # pint's long names: its short "g" is a gram
        units: Any = re.sub(r"\s*(/|\*+)\s*", r"\1", f"{data.units:D}")
        values = values.copy(data=data.magnitude) if hasattr(values, "dims") else data.magnitude
    else:
        units = getattr(values, "attrs", {}).get("units")
    if not units:
        return values
    factor = conversion(f"{key}: units", target_unit, str(units), g)
    return values if factor == 1.0 else values * factor


def quantity(key: str, text: str, target_unit: str, g: float) -> float:
    """Return a number with a unit, such as "50 mm" or "1.5g", in the unit `target_unit`.

    The unit "g" of an acceleration is `g` m/s².  InputError: it is not a number with such a unit;
    the message calls it `key`.
    """
    match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", text)
    refusal = InputError(
        f"{key} = {show(text)}: must be a number, with a unit that converts to {target_unit} if in "
        "another"
    )
    if match is None or math.isinf(float(match[1])):
        raise refusal
    try:
        return float(match[1]) * conversion(key, target_unit, match[2] or None, g)
    except InputError:
        raise refusal from None


def show(value: object) -> str:
    """Return a value as TOML writes it, on one line of at most 60 characters."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def in_mm(metres: Any) -> Any:
    """Return displacements in mm, the unit in which charts and tables have them, from m."""
    return 1000.0 * metres
