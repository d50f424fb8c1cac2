"""How charts look and what they say: colours, symbols, units, labels, captions, cautions, the same in all of them."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap, to_rgba

from slipsweep.errors import InputError
from slipsweep.model.options import MODELS
from slipsweep.model.units import quantity
from slipsweep.model.variables import (
    PARAMETERS,
    RECORD_RESULTS,
    RESULTS,
    STATISTICS,
    TOLERABLE_DISPLACEMENT,
    SlidingMode,
    Validity,
)
from slipsweep.motion.waveforms import WAVEFORMS

#: Okabe and Ito's colours: told apart with any kind of colour vision, and in grey.
BLUE, VERMILION = "#0072B2", "#D55E00"

#: Pale to dark in even steps of lightness, read alike with any kind of colour vision; black lines show on all of it.
COLOURS = LinearSegmentedColormap.from_list("pale", mpl.colormaps["YlGnBu"](np.linspace(0.1, 0.68, 64)))

#: Symbols of the paper.
SYMBOLS = {
    "theta": "θ",
    "mu_s": "μs",
    "phi": "φ",
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
    "displacement": "u",
}

#: What sliding modes are called in legends and captions.
MODE_TEXT = {
    SlidingMode.STUCK: "no sliding",
    SlidingMode.STICK_SLIP: "stick–slip",
    SlidingMode.CONTINUOUS: "continuous",
}

#: Flags of values that are unreliable: left out unless requested.
LEFT_OUT = Validity.NOT_RECOUPLED | Validity.UPSLOPE

#: What captions say of them.
LEFT_OUT_TEXT = {
    Validity.NOT_RECOUPLED: "not_recoupled (does not come to rest within the cycle)",
    Validity.UPSLOPE: "upslope (ends above where it began)",
}

#: Other words of legends.
NEWMARK, NO_SLIDING = "Newmark's block", MODE_TEXT[SlidingMode.STUCK]
UNSOUND = "falls with A, or below\nhalf of Newmark's"

#: How the lines of yield and of the mode limit are drawn.
LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "yield_line": ("yield", {"color": "black", "linestyle": "-", "linewidth": 1.6}),
    "limit_line": ("mode limit (Eq. 7)", {"color": "black", "linestyle": (0, (5, 2)), "linewidth": 1.6}),
}

_UNITS = {"degree": "°", "m s-2": "m/s²", "m s-1": "m/s", "1": ""}

#: Width of a figure that takes the usual size of text, inches; narrower ones are for a column of a journal.
_WIDE = 5.0


@dataclass(frozen=True)
class Look:
    """What a reader may choose about all charts.

    Attributes
    ----------
    units : {"m/s2", "g"}
        Unit of accelerations on the main axis and in the caption.
    show_cautions : bool
        Draw values whose flags say that they are unreliable; otherwise they are left out.
    levels : tuple of float
        Contours, in the result's own unit; by default round values among the results.
    width : float, optional
        Width of the figure, inches.
    grey : bool
        Without colour.
    """

    units: Literal["m/s2", "g"] = "m/s2"
    show_cautions: bool = False
    levels: tuple[float, ...] = ()
    width: float | None = None
    grey: bool = False

    @property
    def font(self) -> float:
        """Size of text, points."""
        return 10.0 if self.width is None or self.width >= _WIDE else 7.0

    def scale(self, name: str, g: float) -> float:
        """What to multiply a parameter by to draw it."""
        return 1.0 / g if self.units == "g" and is_acceleration(name) else 1.0

    def unit(self, name: str) -> str:
        """The unit that a parameter or result is drawn in, as people write it."""
        return "g" if self.units == "g" and is_acceleration(name) else unit(name)


def figure_width(width: float | str | None) -> float | None:
    """Width of a figure in inches, from mm or a text with a unit (InputError if no figure can be so wide)."""
    if width is None:
        return None
    millimetres = 1000.0 * quantity("width", width, "m", 1.0) if isinstance(width, str) else width
    if not 50.0 <= millimetres <= 1000.0:
        raise InputError(f"width = {width}: must be 50 to 1000 mm, as in 90mm")
    return millimetres / 25.4


def ratio_colours(number: int) -> ListedColormap:
    """Colours of ratios, `number` below 1 and above: orange, grey at 1, blue.

    Lightness falls from the least ratio to the largest, so that grey print is unambiguous.
    """
    below, above = (
        LinearSegmentedColormap.from_list("", ends)(np.linspace(0, 1, number))
        for ends in (["#FFF4DF", "#F0BE7E"], ["#A4BCDC", "#3C68A8"])
    )
    return ListedColormap([*below, (0.75, 0.75, 0.75, 1.0), *above])


def to_grey(colour: Any) -> Any:
    """A colour, or an array of them, by its lightness alone."""
    rgba = np.atleast_2d(to_rgba(colour) if isinstance(colour, str | tuple) else colour)
    grey = rgba[:, :3] @ (0.299, 0.587, 0.114)
    return np.column_stack([grey, grey, grey, rgba[:, 3]])


def grey_map(colours: Colormap) -> Colormap:
    """A map of colours by their lightness alone."""
    found = ListedColormap(to_grey(colours(np.arange(colours.N))))
    return found.with_extremes(under=to_grey(colours.get_under())[0], over=to_grey(colours.get_over())[0])


# ------------------------------------------------------------------------- names and units


def is_acceleration(name: str) -> bool:
    """Whether a parameter is an acceleration, which people give in m/s² or in g."""
    return PARAMETERS.get(name, {}).get("units") == "m s-2"


def about(name: str) -> dict[str, Any]:
    """Long name and unit of a parameter, result or tolerable displacement."""
    return (PARAMETERS | RECORD_RESULTS | RESULTS | STATISTICS | {"displacement": TOLERABLE_DISPLACEMENT})[name]


def unit(name: str) -> str:
    """The unit of a parameter or result as people write it; nothing for a pure number."""
    return unit_text(about(name).get("units", "1"))


def unit_text(units: str) -> str:
    """A unit of a file as people write it."""
    return _UNITS.get(units, units)


def axis_label(name: str, look: Look | None = None) -> str:
    """The label of a parameter's axis: name, symbol and unit."""
    text = about(name)["long_name"]
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


def flag_name(flag: int) -> str:
    """A flag as results, legends and captions name it."""
    return (Validity(flag).name or "").lower()


# --------------------------------------------------------------------------------- captions


def caption(data: xr.Dataset, look: Look | None = None) -> str:
    """The parameters that have one value, the model and the shaking, on two lines."""
    look = look or Look()
    single = [name for name in SYMBOLS if name in data.coords and data[name].size == 1]
    g = float(data.attrs["g"])
    parts = [value_text(name, data[name].item() * look.scale(name, g), look.unit(name)) for name in single]
    drawn = drawn_text(data.attrs)
    uncertain = [f"uncertain: {drawn}"] if drawn else []
    return "\n".join([", ".join(parts), *uncertain, model_text(data.attrs)]).strip()


#: Models and their options in captions.
_WORDS: dict[Any, str] = {
    "mendez": "Mendez et al. 2012",
    "newmark": NEWMARK,
    "monotone": "monotone rise",
    "literal": "literal rise",
    "eq12": "recoupling by Eq. 12",
    "integrate": "recoupling by integration",
}


def model_text(attributes: Mapping[Any, Any]) -> str:
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


def drawn_text(attributes: Mapping[Any, Any]) -> str:
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
        for name, given in json.loads(attributes["uncertain"]).items():
            numbers = ", ".join(f"{key}={value}" for key, value in given.items() if key not in ("distribution", "kind"))
            texts.append(f"{SYMBOLS[name]} {signs[given['kind']]} {given['distribution']}({numbers})")
    except (ValueError, TypeError, LookupError, AttributeError):
        raise InputError(
            f"attribute uncertain = {attributes['uncertain']!r}: names no distributions of inputs"
        ) from None
    pooled = f"{plain(str(attributes['pooled']))} x " if "pooled" in attributes else ""
    return f"{', '.join(texts)}; {pooled}{attributes.get('samples', '?')} samples"


def left_out_text(raised: Iterable[Validity], look: Look, of_displacement: bool) -> list[str]:
    """Which unreliable values are left out, and which are drawn on request.

    No logarithmic scale shows what is below zero: displacements upslope are left out in any case.
    """
    flags = list(raised)
    below_zero = Validity.UPSLOPE if of_displacement else Validity(0)
    left_out = [flag for flag in flags if not look.show_cautions or flag in below_zero]
    heading = "Left out, below zero on a logarithmic scale" if look.show_cautions else "Left out"
    found = ((heading, left_out), ("Drawn on request", [flag for flag in flags if flag not in left_out]))
    return [
        f"{text}: values flagged {' or '.join(LEFT_OUT_TEXT[flag] for flag in group)}."
        for text, group in found
        if group
    ]


def ratio_text(ratio: np.ndarray) -> list[str]:
    """How the displacements drawn compare with those of Newmark's block: a sentence, or none."""
    there = ratio[np.isfinite(ratio) & (ratio > 0)]
    if not there.size:
        return []
    low, middle, high = np.quantile(there, (0.05, 0.5, 0.95))
    return [
        f"Ratio to the displacement of Newmark's block with the same Üy: median {middle:.3g}; "
        f"90 % of the sliding cells shown lie between {low:.3g} and {high:.3g}."
    ]


def unsound_text(falls: int, below: int, either: int, total: int, what: str) -> list[str]:
    """What share of a picture no block would show: a sentence, or none."""
    if not either or not total:
        return []
    parts = [("falls with A", falls), ("lies below half of Newmark's", below)]
    shares = [f"{text} in {100 * count / total:.2g} %" for text, count in parts if count]
    return [
        f"{what}: {100 * either / total:.2g} % of the sliding cells shown. The displacement {' and '.join(shares)}, "
        "a trend of the model that no block has."
    ]
