"""Distributions of uncertain inputs: those of scipy.stats, by name or frozen, with units and kinds checked."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model.parameters import check_choice, check_finite, check_numbers, shown
from slipsweep.model.units import conversion
from slipsweep.model.variables import PARAMETERS

Floats = NDArray[np.float64]

KINDS = ("absolute", "factor", "offset")

_USUAL = ("norm", "lognorm", "uniform", "triang", "truncnorm", "beta", "gamma", "weibull_min")


@dataclass(frozen=True)
class Distribution:
    """What an uncertain parameter is drawn from.

    Attributes
    ----------
    parameter : str
    kind : {"absolute", "factor", "offset"}
        Whether a draw is the value, multiplies the grid point's, or is added to it.
    frozen : object
        A frozen distribution of scipy.stats, or anything else with a ``ppf``.
    unit : float
        What to multiply draws by, to have them in the parameter's own unit.
    about : dict
        The distribution in words and numbers, as it was given.
    """

    parameter: str
    kind: str
    frozen: Any
    unit: float
    about: dict[str, Any]

    def __str__(self) -> str:
        numbers = [f"{name}={value}" for name, value in self.about.items() if name not in ("distribution", "kind")]
        return f"{self.about['distribution']}({', '.join(numbers)})"

    def draws(self, uniform: Floats) -> Floats:
        """Turn numbers from 0 to 1 into draws, in the parameter's own unit."""
        with np.errstate(all="ignore"):  # what is not finite is refused by `_check_draws`
            return np.asarray(self.frozen.ppf(uniform), np.float64) * self.unit

    def applied(self, base: Any, draws: Floats) -> Floats:
        """The parameter's values: draws, or draws with the values they are relative to."""
        if self.kind == "absolute":
            return draws
        with np.errstate(over="ignore"):
            return np.asarray(base * draws if self.kind == "factor" else base + draws)


def distribution_of(key: str, parameter: str, given: Any, g: float) -> Distribution:
    """One entry of `uncertain`, called `key` in errors."""
    entries = dict(given) if isinstance(given, Mapping) else {"distribution": given}
    if "distribution" not in entries:
        raise InputError(f"{key}.distribution: missing: the name of a continuous distribution of scipy.stats")
    chosen = entries.pop("distribution")
    kind = check_choice(f"{key}.kind", entries.pop("kind", "absolute"), KINDS)
    units = entries.pop("units", None)
    own = PARAMETERS[parameter]["units"]
    if units is not None and kind == "factor":
        raise InputError(f"{key}.units = {shown(units)}: not allowed with kind = 'factor', which has no unit")
    if units is not None and not isinstance(units, str):
        raise InputError(f"{key}.units = {shown(units)}: must be a unit that converts to {own}")
    if isinstance(chosen, str):
        frozen = _named(key, chosen, entries)
    elif not callable(getattr(chosen, "ppf", None)):
        raise InputError(
            f"{key}.distribution = {shown(chosen)}: must be the name of a distribution of scipy.stats, or a frozen one"
        )
    elif entries:
        raise InputError(f"{key}.{next(iter(entries))}: not allowed with a frozen distribution, which has its own")
    else:
        frozen = chosen
    with np.errstate(all="ignore"):
        median = check_numbers(f"{key}: its median", frozen.ppf(0.5))
    if median.ndim:
        raise InputError(f"{key}: is {median.size} distributions; must be one")
    about = _described(frozen)
    if not np.isfinite(median):
        raise InputError(f"{key}: parameters that scipy.stats does not allow: {about}")
    if units is not None:
        about["units"] = units
    factor = conversion(f"{key}.units", PARAMETERS[parameter]["units"], units, g)
    return Distribution(parameter, kind, frozen, factor, {**about, "kind": kind})


def _shapes(family: Any) -> list[str]:
    """Names of a distribution's shape parameters."""
    return [shape.strip() for shape in (family.shapes or "").split(",") if shape.strip()]


def _named(key: str, name: str, given: Mapping[str, Any]) -> Any:
    """A distribution of scipy.stats with its parameters, frozen."""
    from scipy import stats

    family = getattr(stats, name, None)
    if not isinstance(family, stats.rv_continuous):
        known = [one for one in dir(stats) if isinstance(getattr(stats, one), stats.rv_continuous)]
        hint = did_you_mean(name, known)
        if hint.startswith("known here"):
            hint = f"it must be a continuous one of scipy.stats, such as {', '.join(_USUAL)}"
        raise InputError(f'{key}.distribution = "{name}": no such distribution; {hint}')
    shapes = _shapes(family)
    for parameter in given:
        if parameter not in (*shapes, "loc", "scale"):
            allowed = ("distribution", "kind", "units", *shapes, "loc", "scale")
            raise InputError(f"{key}.{parameter}: unknown key; {did_you_mean(str(parameter), allowed)}")
    for shape in shapes:
        if shape not in given:
            raise InputError(f"{key}.{shape}: missing: {name} needs {', '.join(shapes)}")
    return family(**{parameter: check_finite(f"{key}.{parameter}", value) for parameter, value in given.items()})


def _described(frozen: Any) -> dict[str, Any]:
    """A frozen distribution in words and numbers."""
    family = getattr(frozen, "dist", None)
    if family is None:
        return {"distribution": repr(frozen)}
    numbers = dict(zip((*_shapes(family), "loc", "scale"), frozen.args, strict=False)) | frozen.kwds
    return {"distribution": family.name, **{name: float(value) for name, value in numbers.items()}}
