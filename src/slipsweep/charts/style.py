"""Options, colours, symbols, units, labels, words and captions of charts."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, to_rgba_array
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model import variables
from slipsweep.model.options import MODELS
from slipsweep.model.parameter_table import PARAMETER_TABLE
from slipsweep.model.units import in_mm, quantity
from slipsweep.model.variables import (
    INTENSITY_MEASURES,
    PARAMETERS,
    RESULTS,
    SIGNED,
    SlidingMode,
    Validity,
    has_signed_displacements,
)
from slipsweep.motion.waveforms import WAVEFORMS
from slipsweep.published import check_equations

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from slipsweep.files.selection import At

Floats = NDArray[np.float64]

#: Properties of an artist, by the names that matplotlib gives them.
Look = dict[str, Any]

#: Attributes of all results that charts show, and of all quantities that an axis can have.
SHOWN = (
    variables.LIMIT_RESULTS
    | variables.REQUIRED_RESULTS
    | variables.RECORD_RESULTS
    | variables.RESULTS
    | variables.STATISTICS
)
_ABOUT = (
    INTENSITY_MEASURES | SHOWN | PARAMETERS | {"displacement": variables.TOLERABLE_DISPLACEMENT}
)

#: Colours of Okabe and Ito: told apart with any kind of colour vision, and in grey.
BLUE = "#0072B2"
VERMILION = "#D55E00"

#: Pale to dark in even steps of lightness, read alike with any kind of colour vision; black lines
#: show on all of it.
COLOURS = LinearSegmentedColormap.from_list(
    "pale", mpl.colormaps["YlGnBu"](np.linspace(0.1, 0.68, 64))
)

#: Symbols of the paper.
SYMBOLS = {row.name: row.symbol for row in PARAMETER_TABLE} | {"displacement": "u"}

#: Sliding modes in legends and captions.
MODE_TEXT = {
    SlidingMode.STUCK: "no sliding",
    SlidingMode.STICK_SLIP: "stick–slip",
    SlidingMode.CONTINUOUS: "continuous",
}

#: Flags in legends and short captions.
FLAG_TEXT = {
    Validity.STATICALLY_UNSTABLE: "slides under its own weight",
    Validity.UPLIFT: "loses contact",
    Validity.LIMIT_UNDEFINED: "Eq. 7 has no limit",
    Validity.FRICTION_NOT_DECAYING: "friction does not decay",
    Validity.KD_NOT_POSITIVE: "Eq. 12 cannot stop it",
    Validity.NOT_RECOUPLED: "does not come to rest",
    Validity.FLEXIBLE_BLOCK: "block is not rigid",
    Validity.UPSLOPE: "ends upslope",
    Validity.NEAR_MODE_LIMIT: "near the mode limit",
    Validity.MAY_NOT_STOP: "may not stop",
    Validity.NOT_AT_REST: "does not stop",
}

#: Other words of legends.
NEWMARK = "Newmark's block"
NO_SLIDING = MODE_TEXT[SlidingMode.STUCK]
UNSOUND = "falls with A, or below\nhalf of Newmark's"

#: Words and looks of the lines of yield and of the mode limit.
LINES: dict[str, tuple[str, Look]] = {
    "yield_line": ("yield", {"color": "black", "linestyle": "-", "linewidth": 1.6}),
    "limit_line": (
        "mode limit (Eq. 7)",
        {"color": "black", "linestyle": (0, (5, 2)), "linewidth": 1.6},
    ),
}

_UNITS = {"degree": "°", "m s-2": "m/s²", "m s-1": "m/s", "1": ""}


@dataclass
class Options:
    """Options of a chart, checked: the parameters of `SlipsweepAccessor.chart`.

    With `more_panels` panels lie along axes that would have one value otherwise.  `heights` are the
    levels as numbers in the variable's own unit, in order.  `inches` is the width of the figure, or
    None for the usual one.  InputError: an option has a value that is not allowed.
    """

    x: str | None = None
    y: str | None = None
    at: "Mapping[str, At]" = field(default_factory=dict)
    panels: Sequence[str] = ()
    variable: str = "permanent_displacement"
    levels: Sequence[float | str] = ()
    units: Literal["m/s2", "g"] = "m/s2"
    show_cautions: bool = False
    width: float | str | None = None
    grey: bool = False
    title: str | None = None
    caption: Literal["full", "short"] | None = None
    ax: "Axes | None" = None
    equations: Sequence[str] | str = ()
    magnitude: float | None = None
    more_panels: bool = False
    heights: list[float] = field(init=False)
    inches: float | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        unit_of_levels = "m" if SHOWN.get(self.variable, {}).get("units") == "m" else "1"
        heights = {
            quantity("levels", entry, unit_of_levels, 1.0)
            if isinstance(entry, str)
            else float(entry)
            for entry in self.levels
        }
        for level in heights:
            if not 0 < level < float("inf"):
                raise InputError(f"levels: {level:g}: must be > 0")
        self.heights = sorted(heights)
        self.equations = check_equations(self.equations)
        if self.magnitude is not None and not self.equations:
            raise InputError(f"magnitude = {self.magnitude}: only with equations")
        if len(self.panels) > 2:
            raise InputError(f"--panels {','.join(self.panels)}: must be one axis or two")
        if isinstance(self.width, str):
            self.inches = quantity("width", self.width, "m", 1.0) / 0.0254
        elif self.width is not None:
            self.inches = self.width / 25.4
        if self.inches is not None and not 50.0 <= self.inches * 25.4 <= 1000.0:
            raise InputError(f"width = {self.width}: must be 50 to 1000 mm, as in 90mm")
        if self.caption not in (None, "full", "short"):
            raise InputError(f'caption = {self.caption}: must be "full" or "short"')

    @property
    def is_narrow(self) -> bool:
        """True if the figure fits a column of a journal: smaller text, and the legend above."""
        return self.inches is not None and self.inches < 5.0

    @property
    def is_brief(self) -> bool:
        """True if the caption is short: as requested, by default where the figure is narrow."""
        return self.is_narrow if self.caption is None else self.caption == "short"

    @property
    def font(self) -> float:
        """Size of text, points; smaller in narrow figures."""
        return 7.0 if self.is_narrow else 10.0

    def scale(self, name: str, g: float) -> float:
        """Return the factor by which a parameter is drawn."""
        return 1.0 / g if self.units == "g" and is_acceleration(name) else 1.0

    def unit(self, name: str) -> str:
        """Return the unit that a parameter or result is drawn in."""
        return "g" if self.units == "g" and is_acceleration(name) else unit(name)


def ratio_colours(number: int) -> ListedColormap:
    """Return colours of ratios: `number` below 1 (orange), grey at 1, `number` above (blue)."""
    below, above = (
        LinearSegmentedColormap.from_list("", ends)(np.linspace(0, 1, number))
        for ends in (["#FFF4DF", "#F0BE7E"], ["#A4BCDC", "#3C68A8"])
    )
    return ListedColormap([*below, (0.75, 0.75, 0.75, 1.0), *above])


def to_grey(colour: Any) -> Any:
    """Return a colour, or an array of them, as grey of the same lightness."""
    rgba = to_rgba_array(colour)
    grey = rgba[:, :3] @ (0.299, 0.587, 0.114)
    return np.column_stack([grey, grey, grey, rgba[:, 3]])


def to_light_grey(colour: Any) -> Any:
    """Return grey that is light enough for black lines and hatches on it."""
    grey = to_grey(colour)
    grey[:, :3] = 0.3 + 0.7 * grey[:, :3]
    return grey


def is_acceleration(name: str) -> bool:
    """Return True if a parameter is an acceleration, which people give in m/s² or in g."""
    return PARAMETERS.get(name, {}).get("units") == "m s-2"


def unit(name: str) -> str:
    """Return the unit of a quantity as people write it, empty for a pure number."""
    units: str = _ABOUT[name].get("units", "1")
    return _UNITS.get(units, units)


def axis_label(name: str, options: Options) -> str:
    """Return the label of a parameter's axis: name, symbol and unit."""
    text = _ABOUT[name]["long_name"]
    if SYMBOLS[name] != name.replace("_", " "):
        text = f"{text.split(',')[0].split(' that ')[0]} {SYMBOLS[name]}"
    units = options.unit(name)
    return f"{text} ({units})" if units else text


def displacement_symbol(attributes: Mapping[Any, Any]) -> str:
    """Return the symbol of the displacement as drawn: |u| for a block that slides both ways."""
    return "|u|" if has_signed_displacements(attributes) else "u"


def displacement_text(attributes: Mapping[Any, Any]) -> str:
    """Return the words on axes for the permanent displacement as it is drawn."""
    magnitude = "magnitude of the " if has_signed_displacements(attributes) else ""
    return f"{magnitude}permanent displacement"


def result_text(attributes: Mapping[Any, Any], name: str) -> str:
    """Return the words on axes for a result as it is drawn."""
    if name in SIGNED and has_signed_displacements(attributes):
        text = str(RESULTS[name]["long_name"]).removesuffix(", downslope")
        return f"magnitude of the {text}"
    return str(RESULTS[name]["long_name"])


def with_unit(text: str, units: str) -> str:
    """Return a number with its unit: ``5°``, ``3 Hz``."""
    return f"{text}{units}" if units in ("", "°") else f"{text} {units}"


def length_text(metres: float) -> str:
    """Return a displacement with its unit: ``30 mm``, ``2 m``."""
    return f"{in_mm(metres):.4g} mm" if metres < 0.9999 else f"{metres:.4g} m"


def value_text(data: xr.Dataset, name: str, value: float, options: Options) -> str:
    """Return a parameter's value with symbol and unit: ``θ = 5°``."""
    if name == "threshold":
        return f"d = {length_text(value)}"
    if name not in SYMBOLS:
        return f"{value:g}"
    number = f"{value * options.scale(name, float(data.attrs['g'])):.4g}"
    return f"{SYMBOLS[name]} = {with_unit(number, options.unit(name))}"


def plain(text: Any) -> str:
    """Return a user's text so that matplotlib draws it as it is: ``$`` begins no formula."""
    return str(text).replace("$", r"\$")


def flag_name(flag: int) -> str:
    """Return the name of a flag, as in results."""
    return (Validity(flag).name or "").lower()


def caption(data: xr.Dataset, options: Options | None = None) -> str:
    """Return lines with parameters of one value, uncertain inputs, model and shaking.

    A short caption leaves out the options of the model and the equations of the estimates.
    """
    options = options or Options()
    single = [name for name in SYMBOLS if name in data.coords and data[name].size == 1]
    values = ", ".join(value_text(data, name, data[name].item(), options) for name in single)
    drawn = drawn_text(data.attrs)
    lines = [values, *([f"uncertain: {drawn}"] if drawn else [])]
    if options.is_brief:
        return "\n".join([*lines, short_model_text(data.attrs)]).strip()
    return "\n".join([*lines, model_text(data.attrs)]).strip()


#: Models and their options in captions.
_WORDS: dict[Any, str] = {
    "mendez": "Mendez et al. 2012",
    "newmark": NEWMARK,
    "both": "sliding both ways",
    "monotone": "monotone rise",
    "literal": "literal rise",
    "eq12": "recoupling by Eq. 12",
    "integrate": "recoupling by integration",
    "weakening": "friction falls with slip",
    "rate": "friction depends on velocity",
}


def model_text(attributes: Mapping[Any, Any]) -> str:
    """Return the estimated inputs of a result, its model and its shaking, on two lines."""
    model = MODELS.from_attributes(attributes)
    words = [
        _WORDS[model.name],
        *(_WORDS[value] for value in model.options.values() if value in _WORDS),
    ]
    inputs = [plain(attributes["friction_inputs"])] if "friction_inputs" in attributes else []
    return "\n".join([*inputs, f"{', '.join(words)}; {_shaking_text(attributes)}"])


def short_model_text(attributes: Mapping[Any, Any]) -> str:
    """Return the model, its shaking and the estimated inputs, on one line."""
    model = _WORDS[MODELS.from_attributes(attributes).name]
    if has_signed_displacements(attributes):
        model += f", {_WORDS['both']}"
    # "Üy by Coulomb, λ by Eq. 6: estimated": the symbols alone
    inputs = re.sub(r" by (Coulomb|Eqs?\. [\d–]+)", "", str(attributes.get("friction_inputs", "")))
    inputs = plain(inputs.replace(": estimated", " estimated"))
    shaking = _shaking_text(attributes)
    if "suite" in attributes:
        shaking = f"suite of {attributes.get('motions', '?')} motions"
    return f"{model}, {shaking}{f'; {inputs}' if inputs else ''}"


def _shaking_text(attributes: Mapping[Any, Any]) -> str:
    """Return the record, suite or waveform of a result in words."""
    recorded = next((name for name in ("record", "suite") if name in attributes), None)
    if recorded is None:
        return str(WAVEFORMS.from_attributes(attributes))
    accepted = attributes.get("record_accepted")
    more = f"\naccepted: {plain(accepted)}" if accepted else ""
    return f"{recorded} {plain(attributes[recorded])}{more}"


def drawn_text(attributes: Mapping[Any, Any]) -> str:
    """Return the distributions of uncertain inputs; empty if there are none.

    For example ``μs ~ lognorm(s=0.1, scale=0.4), A × lognorm(s=0.3)``.
    """
    if "uncertain" not in attributes:
        return ""
    signs = {"absolute": "~", "factor": "×", "offset": "+"}
    texts = []
    for name, distribution in json.loads(attributes["uncertain"]).items():
        numbers = ", ".join(
            f"{key}={value}"
            for key, value in distribution.items()
            if key not in ("distribution", "kind")
        )
        texts.append(
            f"{SYMBOLS[name]} {signs[distribution['kind']]} "
            f"{distribution['distribution']}({numbers})"
        )
    pooled = f"{plain(attributes['pooled'])} x " if "pooled" in attributes else ""
    return f"{', '.join(texts)}; {pooled}{attributes.get('samples', '?')} samples"


def check_attributes(attrs: Mapping[Any, Any], name: str) -> None:
    """Raise InputError for a result whose attributes lack the model or the shaking."""
    recorded = not {"record", "suite"}.isdisjoint(attrs)
    options = ("rise", "recoupling") if attrs.get("model") == "mendez" else ()
    for key in ("model", "g", *(() if recorded else ("cycles", "waveform")), *options):
        if key not in attrs:
            raise InputError(f"{name}: attribute {key!r}: missing; it says what was solved")
    try:
        model_text(attrs)
        drawn_text(attrs)
    except (InputError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise InputError(f"{name}: attributes do not say what was solved: {error}") from None
