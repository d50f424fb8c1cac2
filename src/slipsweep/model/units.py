"""Units of what users give: a factor to the parameter's own unit, and numbers with a unit in one text."""

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


def conversion(key: str, own: str, units: str | None, g: float) -> float:
    """Return the factor from `units` to the unit `own` (InputError: they do not convert).

    `key` is what the units are called in errors.  "g" as a unit of acceleration is `g`, the sweep's
    own gravity: an amplitude "in g" is meant against the gravity that the block feels.
    """
    if units is None or _SPELLINGS.get(units, units) == own:
        return 1.0
    if own == "m s-2" and units in ("g", "gal", "Gal"):  # a gallon, to pint
        return g if units == "g" else 0.01

    refusal = InputError(f"{key} = {show(units)}: must be a unit that converts to {own}")
    # "m s-2", "m/s2" and "m/s^2" are all common; pint reads "m s**-2" and "m/s**2"
    text = re.sub(r"(?<=[A-Za-z])\^?(-?[1-9])\b", r"**\1", units.strip())
    if own == "1" or not _UNIT_GRAMMAR.fullmatch(text):
        raise refusal

    import pint  # only here: it takes 0.2 s to import

    registry = pint.get_application_registry()
    target = {"m s-2": "m/s**2", "m s-1": "m/s"}.get(own, own)
    try:
        quantity = registry.Quantity(1.0, text)
        root = quantity.to_root_units().units
        # Pint lets radians pass for pure numbers.  Here a slope in percent is no angle, and
        # 60 rpm or 2 pi rad/s is 1 Hz: one turn a cycle.
        if own == "Hz" and "radian" in str(root):
            target = "turn/s"
        if root != registry.Quantity(1.0, target).to_root_units().units:
            raise refusal
        return float(quantity.to(target).magnitude)
    except (pint.PintError, ArithmeticError, AttributeError, TypeError, ValueError):
        raise refusal from None


def without_unit(key: str, own: str, values: Any, g: float) -> Any:
    """What brings a unit, a pint Quantity or an array of xarray with the attribute `units`, in the unit `own`.

    Other values are returned as they are; "g" is `g` m/s².  InputError: its unit does not convert.
    """
    data = getattr(values, "data", values) if hasattr(values, "dims") else values
    if hasattr(data, "magnitude") and hasattr(data, "units"):
        units: Any = re.sub(
            r"\s*(/|\*+)\s*", r"\1", f"{data.units:D}"
        )  # long names: "g" would be a gram
        values = values.copy(data=data.magnitude) if hasattr(values, "dims") else data.magnitude
    else:
        units = getattr(values, "attrs", {}).get("units")
    if not units:
        return values
    factor = conversion(f"{key}: units", own, str(units), g)
    return values if factor == 1.0 else values * factor


def quantity(key: str, text: str, own: str, g: float) -> float:
    """A number with a unit, such as "50 mm" or "1.5g", in the unit `own` (InputError: it is none).

    `key` is what it is called in errors, `g` what "g" as a unit of acceleration stands for, m/s².
    """
    found = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", text)
    refusal = InputError(
        f"{key} = {show(text)}: must be a number, with a unit that converts to {own} if in another"
    )
    if found is None or math.isinf(float(found[1])):
        raise refusal
    try:
        return float(found[1]) * conversion(key, own, found[2] or None, g)
    except InputError:
        raise refusal from None


def show(value: object) -> str:
    """Write a value as TOML would, on one line of bearable length."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def in_mm(metres: Any) -> Any:
    """Return displacements in mm, the unit in which charts and tables have them, from m."""
    return 1000.0 * metres
