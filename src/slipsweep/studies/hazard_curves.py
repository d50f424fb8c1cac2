"""Seismic hazard curves: mean annual rates at which peak ground accelerations are exceeded, and how they are read."""

import csv
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.parameters import check_numbers, number_text, shown
from slipsweep.model.units import conversion
from slipsweep.motion.columns import read_columns
from slipsweep.motion.formats import read_lines

Floats = NDArray[np.float64]

#: Words of a column's name that say what it holds.
_PGA = {"pga", "acceleration", "amplitude"}
_RATE = {"rate", "frequency", "exceedance", "afe"}

#: Spellings of the unit of an annual rate.
_ANNUAL = {"", "1/yr", "1/year", "1/a", "/yr", "/year", "yr-1", "year-1", "a-1", "per year"}

#: Columns of OpenQuake's files: the probability of exceeding an acceleration, in g.
_POE = re.compile(r"poe-(\d.*)")


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
        for name, values, word, sign in (("amplitude", amplitude, "greater", 1.0), ("rate", rate, "less", -1.0)):
            changes = np.diff(sign * values, prepend=-np.inf) > 0.0
            for at in np.flatnonzero(~(np.isfinite(values) & (values > 0.0) & changes))[:1]:
                text = number_text(float(values[at]))
                raise InputError(
                    f"{self.name}: {name} of point {at + 1} = {text}: must be > 0, and {word} than the one before"
                )
        for name, values in kept.items():
            object.__setattr__(self, name, values)

    def rate_at(self, amplitude: Floats) -> Floats:
        """The rate within the curve, linear between its points in logarithms of both."""
        return np.asarray(np.exp(np.interp(np.log(amplitude), np.log(self.amplitude), np.log(self.rate))))


def read_hazard_curve(path: str | Path, g: float, site: int | None = None) -> HazardCurve:
    """Read a hazard curve of peak ground acceleration from a CSV file.

    The first line that is not blank and does not begin with ``#`` names the columns: ``PGA (g), annual rate``.
    Separators are commas, semicolons or tabs.  Columns of other names are left out.  Or a file of OpenQuake,
    ``hazard_curve-mean-PGA_12.csv``, whose probabilities of exceedance become annual rates, −ln(1 − p)/T with its
    investigation time T.

    Parameters
    ----------
    path : str or Path
    g : float
        What "g" as a unit stands for, m/s²: that of the result.
    site : int, optional
        Which site of an OpenQuake file, from 1; needed if it has several.

    Raises
    ------
    InputError
        The file cannot be read, a column is missing or has no unit, or the numbers are no hazard curve.
    """
    try:
        path = Path(path)
    except TypeError:
        raise InputError(f"curve = {shown(path)}: must be the path of a CSV file, or a HazardCurve") from None
    content, lines = read_lines(path)
    about = {"hazard_curve_sha256": hashlib.sha256(content).hexdigest()}
    named = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    if _POE.search(named):
        return _openquake_curve(path, lines, g, site, about)
    if site is not None:
        raise InputError(f"{path}: site = {site}: only for a file of OpenQuake with several sites")

    def holds(column: str, words: set[str], unit: str) -> tuple[str, float] | None:
        where = f"{path}: column {shown(column)}"
        if "probability" in words:
            raise InputError(f"{where}: must be an annual rate, -ln(1 - p) of an annual probability p")
        if words & _RATE:
            if unit.lower() not in _ANNUAL:
                raise InputError(f"{where}: must be a rate per year, such as annual rate (1/yr)")
            return "annual rate", 1.0
        if not words & _PGA:
            return None
        if not unit:
            raise InputError(f"{where}: must give its unit in brackets, such as PGA (g)")
        return "PGA", conversion(f"{where}: unit", "m s-2", unit, g)

    values = read_columns(path, lines, holds, ("PGA", "annual rate"), "PGA (g), annual rate")
    return HazardCurve(values["PGA"], values["annual rate"], str(path), about)


def _openquake_curve(
    path: Path, lines: Sequence[str], g: float, site: int | None, about: Mapping[str, str]
) -> HazardCurve:
    """One site's curve from a file of OpenQuake: a comment with T and the measure, names, and a row for each site."""
    head = " ".join(line for line in lines if line.startswith("#"))
    found = re.search(r"investigation_time=([\d.eE+-]+)", head)
    if found is None:
        raise InputError(f"{path}: no investigation_time in its first line: it is needed for annual rates")
    measure = re.search(r"imt='?([^',\"]+)", head)
    if measure is not None and measure[1] != "PGA":
        raise InputError(f"{path}: curves of {measure[1]}: must be of PGA")
    names, *rows = csv.reader(line for line in lines if line.strip() and not line.startswith("#"))
    if not 1 <= (1 if site is None else site) <= len(rows) or (site is None and len(rows) > 1):
        raise InputError(f"{path}: {len(rows)} sites: give the number of one, site = 1 to {len(rows)} (--site)")
    row = dict(zip(names, rows[(site or 1) - 1], strict=False))
    try:
        levels = {float(match[1]): float(row[name]) for name in names if (match := _POE.fullmatch(name))}
    except (KeyError, ValueError):
        raise InputError(f"{path}: site {site or 1}: must have a number for each level") from None
    amplitude, probability = np.array([*levels]), np.array([*levels.values()])
    if not ((probability >= 0.0) & (probability <= 1.0)).all():
        raise InputError(f"{path}: site {site or 1}: probabilities must be from 0 to 1")
    # at 1 the rate is not known, at 0 there is none; printed probabilities of neighbours may be the same
    used = (probability > 0.0) & (probability < 1.0) & (np.diff(probability, prepend=np.inf) != 0.0)
    where = {f"hazard_curve_{name}": row[name] for name in ("lon", "lat") if name in row}
    rate = -np.log1p(-probability[used]) / float(found[1])
    return HazardCurve(amplitude[used] * g, rate, str(path), {**about, **where})
