"""Units of inputs: numbers with a unit in a text, and factors to the units of the parameters."""

import math

import pytest

from slipsweep.errors import InputError
from slipsweep.model.units import conversion, quantity

MOON = 1.62


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.05", "m", 0.05),
        ("50mm", "m", 0.05),
        (" 5 cm ", "m", 0.05),
        ("-2 mm", "m", -0.002),
        ("+1e-1m", "m", 0.1),
        (".5inch", "m", 0.0127),
        ("0.3g", "m s-2", 0.3 * MOON),  # the gravity that the block feels
        ("30 gal", "m s-2", 0.3),
        ("30 Gal", "m s-2", 0.3),
        ("2 m/s2", "m s-2", 2.0),
        ("2 m/s^2", "m s-2", 2.0),
        ("2 m s-2", "m s-2", 2.0),
        ("200 cm/s²", "m s-2", 2.0),
        ("40cm/s", "m s-1", 0.4),
        ("120rpm", "Hz", 2.0),
        ("6.283185307179586 rad/s", "Hz", 1.0),
        ("500mHz", "Hz", 0.5),
        ("0.1rad", "degree", math.degrees(0.1)),
        ("5deg", "degree", 5.0),
        ("5°", "degree", 5.0),
        ("0.4", "1", 0.4),
        ("40 %", "1", None),
        ("5 kg", "m", None),
        ("5%", "degree", None),
        ("five mm", "m", None),
        ("1e999", "m", None),
        ("3 m m", "m", None),
    ],
)
def test_a_number_with_a_unit_is_in_the_parameters_own(
    text: str, unit: str, value: float | None
) -> None:
    """None: it is refused, by its name and text."""
    if value is not None:
        assert quantity("--length", text, unit, MOON) == pytest.approx(value, rel=1e-14)
        return
    with pytest.raises(InputError) as refused:
        quantity("--length", text, unit, MOON)
    assert str(refused.value).startswith("--length = ")
    assert f"a unit that converts to {unit}" in str(refused.value)


@pytest.mark.parametrize(
    ("unit", "units", "factor"),
    [
        ("m s-2", None, 1.0),
        ("m s-2", "g", MOON),
        ("m s-2", "gal", 0.01),
        ("m s-2", "ft/s**2", 0.3048),
        ("m s-1", "km/hour", 1.0 / 3.6),
        ("Hz", "1/min", 1.0 / 60.0),
        ("s", "ms", 1e-3),
    ],
)
def test_factors_to_own_units(unit: str, units: str | None, factor: float) -> None:
    assert conversion("axes.x.units", unit, units, MOON) == pytest.approx(factor, rel=1e-14)
