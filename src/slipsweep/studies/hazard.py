"""Mean annual rate of exceeding a displacement: the hazard of peak ground acceleration times a suite's fragility.

λ(d) = ∫ P(u > d | a) |dν(a)|, where ν(a) is the mean annual rate of peak ground accelerations above a (Cornell 1968).
ln ν is straight in ln a between the points of the hazard curve, P in ln a between the amplitudes of the grid; the
integral over these lines is exact.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.model.parameters import check_numbers, number_text, shown
from slipsweep.model.units import unit_factor
from slipsweep.model.variables import HAZARD_RESULTS
from slipsweep.motion.columns import columns_of, words_and_unit
from slipsweep.motion.records import read_lines
from slipsweep.studies.suite_statistics import suite_table

Floats = NDArray[np.float64]

TITLE = "Mean annual rate of exceeding a permanent displacement"

#: Words of a column's name that say what it holds.
_PGA = {"pga", "acceleration", "amplitude"}
_RATE = {"rate", "frequency", "exceedance", "afe"}

#: Spellings of the unit of an annual rate.
_ANNUAL = {"", "1/yr", "1/year", "1/a", "/yr", "/year", "yr-1", "year-1", "a-1", "per year"}


@dataclass(frozen=True, eq=False)
class HazardCurve:
    """Mean annual rates at which peak ground accelerations are exceeded at a site.

    Attributes
    ----------
    amplitude : ndarray
        Peak ground accelerations, m/s², > 0, strictly increasing; two at least.
    rate : ndarray
        Mean annual rate of exceeding each, 1/year, > 0, strictly decreasing.
    name : str
        What the curve is called in messages and results.
    attrs : dict
        How it was read, for the attributes of results.

    Raises
    ------
    InputError
        The numbers are not such.

    See Also
    --------
    displacement_hazard : annual rates of displacements, from such a curve

    Examples
    --------
    >>> import slipsweep
    >>> curve = slipsweep.HazardCurve(amplitude=[0.5, 1.0, 2.0, 4.0], rate=[2e-2, 7e-3, 2e-3, 4e-4])
    >>> curve.rate_at([1.5]).round(4)
    array([0.0034])
    """

    amplitude: Floats
    rate: Floats
    name: str = "hazard curve"
    attrs: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        kept = {name: check_numbers(f"{self.name}: {name}", getattr(self, name)) for name in ("amplitude", "rate")}
        amplitude, rate = kept.values()
        if amplitude.ndim != 1 or amplitude.shape != rate.shape or amplitude.size < 2:
            raise InputError(
                f"{self.name}: {amplitude.size} amplitudes and {rate.size} rates: must be as many of each, 2 at least"
            )
        for name, values in kept.items():
            for at in np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))[:1]:
                raise InputError(f"{self.name}: {name} of point {at + 1} = {_text(values[at])}: must be a number > 0")
        for name, values, word, sign in (("amplitude", amplitude, "greater", 1), ("rate", rate, "less", -1)):
            for at in np.flatnonzero(sign * np.diff(values) <= 0.0)[:1]:
                raise InputError(
                    f"{self.name}: {name} of point {at + 2} = {_text(values[at + 1])}: must be {word} than "
                    f"{_text(values[at])}, the one before it"
                )
        for name, values in kept.items():
            object.__setattr__(self, name, values)

    def rate_at(self, amplitude: Floats) -> Floats:
        """The rate within the curve, linear between its points in logarithms of both."""
        return np.asarray(np.exp(np.interp(np.log(amplitude), np.log(self.amplitude), np.log(self.rate))))


class Rates(NamedTuple):
    """A mean annual rate of exceedance, and what lies outside of the amplitudes that the fragility is known at.

    Attributes
    ----------
    rate : ndarray
        1/year.
    held : ndarray
        Part of the rate above the largest amplitude (or the end of the curve), where the probability is held.
    omitted : ndarray
        What is not in the rate: at most this much below the smallest amplitude, down to the start of the curve, if the
        probability there is not above that at the smallest amplitude.  NaN where the curve starts above the smallest
        amplitude, at a probability above 0: the rate of what lies below the curve is not known.
    """

    rate: Floats
    held: Floats
    omitted: Floats


def _text(value: Any) -> str:
    return number_text(float(value))


def exceedance_rates(curve: HazardCurve, amplitude: Any, probability: Any) -> Rates:
    """Integrate a fragility over a hazard curve.

    Parameters
    ----------
    curve : HazardCurve
    amplitude : array
        Peak ground accelerations, m/s², > 0, strictly increasing, two at least.
    probability : array or callable
        Probability of exceedance at each, along the first dimension, or what gives it of an array of amplitudes.  It is
        interpolated linearly in the logarithm of the amplitude between them.

    Returns
    -------
    Rates
        Of the further dimensions of `probability`.

    Raises
    ------
    InputError
        The amplitudes are not such, or none of them lies within the curve.
    """
    given = check_numbers("amplitude", amplitude)
    if given.ndim != 1 or given.size < 2 or not (given[0] > 0.0 and (np.diff(given) > 0.0).all()):
        raise InputError(f"amplitude = {shown(amplitude)}: must be two numbers or more, > 0 and increasing")
    shares = check_numbers("probability", probability(given) if callable(probability) else probability)
    if shares.shape[:1] != given.shape or not ((shares >= 0.0) & (shares <= 1.0)).all():
        raise InputError("probability: must be numbers between 0 and 1, one or more for each amplitude")
    low, high = max(given[0], curve.amplitude[0]), min(given[-1], curve.amplitude[-1])
    if low >= high:
        raise InputError(
            f"{curve.name}: reaches from {_span(curve.amplitude)}, and the amplitudes of the fragility from "
            f"{_span(given)}: they must overlap"
        )
    points = np.union1d(given, curve.amplitude)
    points = points[(points >= low) & (points <= high)]
    rates = curve.rate_at(points)
    chances = _straight(np.log(points), np.log(given), shares)
    # P is straight in ln a, ν is exp(-k ln a): ∫ P |dν| = P₁ (ν₁ - ν₂) + (P₂ - P₁) ((ν₁ - ν₂) / (k h) - ν₂)
    falls = -np.diff(np.log(rates))
    drops = rates[1:] * np.expm1(falls)
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = np.where(falls > 1e-6, drops / falls - rates[1:], 0.5 * drops)
    inside = np.tensordot(drops, chances[:-1], 1) + np.tensordot(weights, np.diff(chances, axis=0), 1)
    held = chances[-1] * rates[-1]
    omitted = chances[0] * (curve.rate[0] - rates[0])
    if curve.amplitude[0] > given[0]:  # how often what lies below the curve occurs is not known
        omitted = np.where(chances[0] > 0.0, np.nan, omitted)
    return Rates(np.asarray(inside + held), np.asarray(held), np.asarray(omitted))


def _span(values: Floats) -> str:
    return f"{values[0]:.6g} to {values[-1]:.6g} m/s2"


def _straight(x: Floats, known: Floats, values: Floats) -> Floats:
    """Values along the first dimension, straight between those at `known`."""
    at = np.clip(np.searchsorted(known, x, side="right") - 1, 0, known.size - 2)
    share = ((x - known[at]) / (known[at + 1] - known[at])).reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray(values[at] + np.clip(share, 0.0, 1.0) * (values[at + 1] - values[at]))


def hazard_table(table: xr.Dataset, curve: HazardCurve, *, thresholds: Any, over: Any = None) -> xr.Dataset:
    """What `slipsweep.displacement_hazard` returns, of a table that holds `permanent_displacement` and `validity`.

    Raises
    ------
    RunError
        No motion has a value at two amplitudes, at any grid point.
    """
    displacement = table.data_vars.get("permanent_displacement")
    if displacement is not None and displacement.sizes.get("amplitude", 1) < 2:
        raise InputError(
            "result: amplitude: must be a dimension of two peak ground accelerations or more: the probability of "
            "exceedance is needed at each"
        )
    statistics = suite_table(table, thresholds=thresholds, quantiles=0.5, zero=0.0, over=over)
    probability, valueless = statistics["exceedance_probability"], statistics["valueless_share"]
    order = np.argsort(table["amplitude"].values, kind="stable")
    order = order[table["amplitude"].values[order] > 0.0]  # none exceeds anything at 0, which has no logarithm
    amplitude = np.asarray(table["amplitude"].values[order], np.float64)
    at = probability.dims.index("amplitude")
    chances = np.moveaxis(probability.values, at, -2)[..., order, :]
    shares = np.moveaxis(valueless.values, at, -1)[..., order]
    grid = tuple(dim for dim in valueless.dims if dim != "amplitude")
    found = {name: np.full((*chances.shape[:-2], chances.shape[-1]), np.nan) for name in Rates._fields}
    for index in np.ndindex(chances.shape[:-2]):
        there = np.isfinite(chances[index][:, 0])
        if np.count_nonzero(there) < 2:
            continue
        rates = exceedance_rates(curve, amplitude[there], chances[index][there])
        for name, values in rates._asdict().items():
            found[name][index] = values
    if np.isnan(found["rate"]).all():
        raise RunError("no annual rate: the model gives no value under any motion at two amplitudes or more")
    names = {"annual_rate": "rate", "held_rate": "held", "omitted_rate": "omitted"}
    results = {
        name: xr.Variable((*grid, "threshold"), found[own], HAZARD_RESULTS[name]) for name, own in names.items()
    } | {"valueless_share": xr.Variable(grid, shares.max(axis=-1), HAZARD_RESULTS["valueless_share"])}
    coords = {
        name: one
        for name, one in statistics.coords.items()
        if name not in ("quantile", "flag") and "amplitude" not in (*one.dims, name)
    }
    attrs = {
        **{name: value for name, value in statistics.attrs.items() if name != "zero_displacement"},
        "title": TITLE,
        "hazard_curve": curve.name,
        **curve.attrs,
        "hazard_curve_range": curve.amplitude[[0, -1]],
        "amplitude_range": amplitude[[0, -1]],
    }
    return xr.Dataset(results, coords, attrs)


def read_hazard_curve(path: str | Path, g: float) -> HazardCurve:
    """Read a hazard curve of peak ground acceleration from a CSV file.

    The first line that is not blank and does not begin with ``#`` names the columns: ``PGA (g), annual rate``.
    Separators are commas, semicolons or tabs.  Columns of other names are left out.

    Parameters
    ----------
    path : str or Path
    g : float
        What "g" as a unit stands for, m/s²: that of the result.

    Raises
    ------
    InputError
        The file cannot be read, a column is missing or has no unit, or the numbers are no hazard curve.
    """
    try:
        path = Path(path)
    except TypeError:
        raise InputError(f"curve = {shown(path)}: must be the path of a CSV file, or a HazardCurve") from None
    content, lines = read_lines(path, "hazard curve")
    file = columns_of(path, lines, "has no line of names, such as PGA (g), annual rate")
    columns: dict[str, tuple[int, float]] = {}
    for i, cell in enumerate(file.names):
        what, factor = _column(f"{path}: line {file.number}", cell, g)
        if what in columns:
            raise InputError(f"{path}: line {file.number}: two columns are {what}: must be one")
        if what:
            columns[what] = i, factor
    for what in ("PGA", "annual rate"):
        if what not in columns:
            raise InputError(
                f"{path}: line {file.number}: no column {what}: must name them, such as PGA (g), annual rate"
            )
    values = {what: np.empty(len(file.body)) for what in columns}
    for row, (number, cells) in enumerate(file.rows()):
        for what, (i, factor) in columns.items():
            values[what][row] = factor * file.value(number, cells[i], what)
    about = {"hazard_curve_sha256": hashlib.sha256(content).hexdigest()}
    return HazardCurve(values["PGA"], values["annual rate"], str(path), about)


def _column(where: str, cell: str, g: float) -> tuple[str, float]:
    """What a column holds, nothing if it is left out, and the factor to its unit."""
    words, unit = words_and_unit(cell)
    if "probability" in words:
        raise InputError(
            f"{where}: column {shown(cell)}: must be an annual rate, -ln(1 - p) of an annual probability p"
        )
    if words & _RATE:
        if unit.lower() not in _ANNUAL:
            raise InputError(f"{where}: column {shown(cell)}: must be a rate per year, such as annual rate (1/yr)")
        return "annual rate", 1.0
    if not words & _PGA:
        return "", 1.0
    if not unit:
        raise InputError(f"{where}: column {shown(cell)}: must give its unit in brackets, such as PGA (g)")
    return "PGA", unit_factor(f"{where}: column {shown(cell)}: unit", "amplitude", unit, g)
