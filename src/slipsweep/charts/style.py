"""How figures look: colours, symbols, units and captions, the same in all of them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.options import MODELS
from slipsweep.model.variables import PARAMETERS, RESULTS
from slipsweep.motion.waveforms import WAVEFORMS

#: Okabe and Ito's colours: told apart with any kind of colour vision, and in grey.
BLUE, VERMILION = "#0072B2", "#D55E00"

#: Symbols of the paper.
SYMBOLS = {
    "theta": "θ",
    "mu_s": "μs",
    "amplitude": "A",
    "displacement_amplitude": "d",
    "frequency": "f",
    "yield_acceleration": "Üy",
    "decay_rate": "λ",
    "delta_mu": "Δμ",
    "minimum_friction": "μmin",
    "structure_frequency": "fs",
    "yield_coefficient": "ky",
    "scale": "scale",
    "pgv": "PGV",
    "arias_intensity": "Ia",
    "time_scale": "time scale",
    "polarity": "polarity",
    "azimuth": "azimuth",
}

_UNITS = {"degree": "°", "m s-2": "m/s²", "m s-1": "m/s", "1": ""}


@dataclass(frozen=True)
class Look:
    """What a reader may choose about all charts.

    Attributes
    ----------
    units : {"m/s2", "g"}
        Unit of accelerations on the main axis and in the caption.
    show_cautions : bool
        Draw values whose flags say that they are not to be relied on; otherwise they are left out.
    levels : tuple of float
        Contours, in the result's own unit; by default round values among the results.
    """

    units: Literal["m/s2", "g"] = "m/s2"
    show_cautions: bool = False
    levels: tuple[float, ...] = ()

    def scale(self, name: str, g: float) -> float:
        """What to multiply a parameter by to draw it."""
        return 1.0 / g if self.units == "g" and is_acceleration(name) else 1.0

    def unit(self, name: str) -> str:
        """The unit that a parameter or result is drawn in, as people write it."""
        return "g" if self.units == "g" and is_acceleration(name) else unit(name)


def is_acceleration(name: str) -> bool:
    """Whether a parameter is an acceleration, which people give in m/s² or in g."""
    return PARAMETERS.get(name, {}).get("units") == "m s-2"


def unit(name: str) -> str:
    """The unit of a parameter or result as people write it; nothing for a pure number."""
    return unit_text((PARAMETERS.get(name) or RESULTS[name]).get("units", "1"))


def unit_text(units: str) -> str:
    """A unit of a file as people write it."""
    return _UNITS.get(units, units)


def axis_label(name: str, look: Look | None = None) -> str:
    """The label of a parameter's axis: name, symbol and unit."""
    text = PARAMETERS[name]["long_name"]
    if SYMBOLS[name] != name.replace("_", " "):
        text = f"{text.split(',')[0].split(' that ')[0]} {SYMBOLS[name]}"
    units = (look or Look()).unit(name)
    return f"{text} ({units})" if units else text


def value_text(name: str, value: float, units: str | None = None) -> str:
    """A parameter's value with symbol and unit: ``θ = 5°``."""
    units = unit(name) if units is None else units
    space = "" if units in ("", "°") else " "
    return f"{SYMBOLS[name]} = {value:.4g}{space}{units}"


def length_text(metres: float) -> str:
    """A displacement as people write it: ``30 mm``, ``2 m``."""
    return f"{metres * 1000:.4g} mm" if metres < 0.9999 else f"{metres:.4g} m"


def plain(text: str) -> str:
    """A name that users give, as matplotlib draws it as it stands: a ``$`` begins no formula."""
    return text.replace("$", r"\$")


def caption(table: xr.Dataset, look: Look | None = None) -> str:
    """The parameters that have one value, the model and the shaking, on two lines."""
    look = look or Look()
    single = [name for name in SYMBOLS if name in table.coords and table[name].values.size == 1]
    attributes = table.attrs
    g = float(attributes["g"])
    parts = [value_text(name, table[name].item() * look.scale(name, g), look.unit(name)) for name in single]
    drawn = drawn_text(attributes)
    uncertain = [f"uncertain: {drawn}"] if drawn else []
    return "\n".join([", ".join(parts), *uncertain, model_text(attributes)]).strip()


#: Models and their options in captions.
_WORDS: dict[Any, str] = {
    "mendez": "Mendez et al. 2012",
    "newmark": "Newmark's block",
    "monotone": "monotone rise",
    "literal": "literal rise",
    "eq12": "recoupling by Eq. 12",
    "integrate": "recoupling by integration",
}


def model_text(attributes: Mapping[str, Any]) -> str:
    """What is estimated in a result, its model and its shaking, on two lines.

    Like ``Üy given; λ by Eq. 6, Δμ by Eqs. 10–11: estimated`` and
    ``Mendez et al. 2012, monotone rise, recoupling by Eq. 12; 10 cycles of a sine``.
    """
    model = MODELS.from_attributes(attributes)
    words = [_WORDS[model.name], *(_WORDS[value] for value in model.options.values() if value in _WORDS)]
    recorded = next((name for name in ("record", "suite") if name in attributes), None)
    shaking = f"{recorded} {plain(str(attributes[recorded]))}" if recorded else WAVEFORMS.from_attributes(attributes)
    inputs = [plain(str(attributes["friction_inputs"]))] if "friction_inputs" in attributes else []
    return "\n".join([*inputs, f"{', '.join(words)}; {shaking}"])


def drawn_text(attributes: Mapping[str, Any]) -> str:
    """The distributions of uncertain inputs: ``μs ~ lognorm(s=0.1, scale=0.4), A × lognorm(s=0.3)``; empty if none.

    Raises
    ------
    InputError
        The attributes are not those that slipsweep writes.
    """
    if "uncertain" not in attributes:
        return ""
    signs = {"absolute": "~", "factor": "×", "offset": "+"}
    texts = []
    try:
        for name, about in json.loads(attributes["uncertain"]).items():
            numbers = ", ".join(f"{key}={value}" for key, value in about.items() if key not in ("distribution", "kind"))
            texts.append(f"{SYMBOLS[name]} {signs[about['kind']]} {about['distribution']}({numbers})")
    except (ValueError, TypeError, LookupError, AttributeError):
        raise InputError(
            f"attribute uncertain = {attributes['uncertain']!r}: names no distributions of inputs"
        ) from None
    pooled = f"{plain(str(attributes['pooled']))} x " if "pooled" in attributes else ""
    return f"{', '.join(texts)}; {pooled}{attributes.get('samples', '?')} samples"
