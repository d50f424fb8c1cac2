"""Hazard curves of peak ground acceleration: `HazardCurve`, and its files.

A file is a table of PGA and annual rates, or one of OpenQuake.  Headings decide which columns they
are; a heading that leaves the measure or the year open is refused.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from slipsweep.errors import InputError
from slipsweep.model.parameters import check_numbers, number_text, shown
from slipsweep.model.units import conversion
from slipsweep.motion.lines import read_columns, read_lines
from slipsweep.studies.sampling import Floats

Unstated: TypeAlias = Literal["refuse", "accept"]

#: Headings of the measure of a curve: peak ground acceleration, another one, or one that may be
#: either.
_PGA = r"\bpga\b|\bpeak\b.*\bacc|\bzpa\b"
_SPECTRAL = r"\bp?sa\b|\bsa\s?\(|spectral|response.spectr|\bpg[vd]\b"
_OTHER_MEASURE = (
    rf"{_SPECTRAL}|\bs[dv]\b|velocity|displacement|\bmmi\b|\barias\b|\bcav\b|\bia\b"
    r"|(?<!return )period|\b\d+(?:\.\d+)?\s?(?:s|sec|hz)\b"
)
_MEASURE = r"accel|amplitude|ground.?motion|\bi(ml|mt|m)\b|intensity|\blevel"

#: Headings of a rate; words that make it a rate a year; headings of what is not a rate.
_RATE = r"\brate|\bfrequency|exceed|\bm?afe\b|\bmaf\b|\blambda\b|λ"
_ANNUAL = r"annual|yearly|a year|per (?:year|yr|annum)|/\s?(?:year|yr|a)\b|\bm?afe\b|\bmaf\b"
_NO_RATE = r"probab|\bpoe\b|\baep\b|\bpe\b|\b\d+(?:\.\d+)?[ -]?(?:years?|yrs?|a)\b|return|period"

#: Spellings of the unit of an annual rate.
_PER_YEAR = {"1/yr", "1/year", "1/a", "/yr", "/year", "yr-1", "year-1", "a-1", "per year"}

#: Columns of OpenQuake's files: the probability of exceeding an acceleration, in g.
_POE = re.compile(r"poe-(\d[\d.eE+-]*)(?::\w+)?")

_ACCEPT = (
    "--unstated accept takes it for a curve of PGA and annual rates (in Python give a HazardCurve)"
)


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
        Name of the curve in messages and results.
    attrs : dict
        Attributes of results: the file that it was read from.

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
        amplitude, rate = (
            check_numbers(f"{self.name}: {name}", getattr(self, name))
            for name in ("amplitude", "rate")
        )
        if amplitude.ndim != 1 or amplitude.shape != rate.shape or amplitude.size < 2:
            raise InputError(
                f"{self.name}: {amplitude.size} amplitudes and {rate.size} rates: must be as many "
                "of each, 2 at least"
            )
        for name, values, word, sign in (
            ("amplitude", amplitude, "greater", 1.0),
            ("rate", rate, "less", -1.0),
        ):
            object.__setattr__(self, name, values)
            changes = np.diff(sign * values, prepend=-np.inf) > 0.0
            for at in np.flatnonzero(~(np.isfinite(values) & (values > 0.0) & changes))[:1]:
                text = number_text(float(values[at]))
                raise InputError(
                    f"{self.name}: {name} of point {at + 1} = {text}: must be > 0, and {word} "
                    "than the one before"
                )

    def rate_at(self, amplitude: Floats) -> Floats:
        """Return the rate within the curve, linear between its points in logarithms of both."""
        return np.asarray(
            np.exp(np.interp(np.log(amplitude), np.log(self.amplitude), np.log(self.rate)))
        )


def read_hazard_curve(
    path: str | Path, g: float, site: int | None = None, unstated: Unstated = "refuse"
) -> HazardCurve:
    """Read a hazard curve of peak ground acceleration from a CSV file.

    "g" as a unit is `g` m/s², that of the result. The first line that is not blank and does not
    begin with ``#`` names the columns: ``PGA (g), annual rate``.  Columns of other names are left
    out. Or a file of OpenQuake, whose probabilities of exceedance become annual rates, −ln(1 − p)/T
    with its investigation time T; `site` is which of its sites, from 1, and needed if it has
    several.

    A file that does not say that its curve is of PGA, or that its rates are annual, is refused, or
    with `unstated` "accept" taken as such.  InputError: it says otherwise, cannot be read, a column
    is missing or has no unit, or the numbers are no hazard curve.
    """
    try:
        path = Path(path)
    except TypeError:
        raise InputError(
            f"curve = {shown(path)}: must be the path of a CSV file, or a HazardCurve"
        ) from None
    digest, lines = read_lines(path)
    about = {"hazard_curve_sha256": digest}
    named = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    if _POE.search(named):
        return _openquake_curve(path, lines, g, site, unstated, about)
    if site is not None:
        raise InputError(f"{path}: site = {site}: only for a file of OpenQuake with several sites")
    comments = _comments(path, lines)
    has_pga = _says(_PGA, named)

    def holds(column: str, words: set[str], unit: str) -> tuple[str, float] | None:
        where = f"{path}: column {shown(column)}"
        if _says(_NO_RATE, column) and not _says(rf"{_PGA}|{_MEASURE}", column):
            raise InputError(
                f"{where}: must be an annual rate, -ln(1 - p)/T of a probability p in T years"
            )
        if _says(_RATE, column):
            if unit and unit.lower() not in _PER_YEAR:
                raise InputError(f"{where}: must be a rate per year, such as annual rate (1/yr)")
            if not unit and not _says(_ANNUAL, column) and unstated == "refuse":
                raise InputError(f"{where}: does not say that its rates are annual; {_ACCEPT}")
            return "annual rate", 1.0
        if _says(_OTHER_MEASURE, column):
            if has_pga:
                return None
            raise InputError(f"{where}: must be of PGA")
        is_pga = _says(_PGA, column)
        if not is_pga and (has_pga or not _says(_MEASURE, column)):
            return None
        if not is_pga and not _says(_PGA, comments) and unstated == "refuse":
            raise InputError(f"{where}: does not say that it is PGA; {_ACCEPT}")
        if not unit:
            raise InputError(f"{where}: must give its unit in brackets, such as PGA (g)")
        return "PGA", conversion(f"{where}: unit", "m s-2", unit, g)

    values = read_columns(path, lines, holds, {"PGA": "PGA (g)", "annual rate": "annual rate"})
    return HazardCurve(values["PGA"], values["annual rate"], str(path), about)


def _says(pattern: str, text: str) -> bool:
    """Return True if a heading says something; underscores separate words as blanks do."""
    return bool(re.search(pattern, text.replace("_", " "), re.IGNORECASE))


def _comments(path: Path, lines: Sequence[str]) -> str:
    """Return the comments of a table (InputError: one names another kind of curve)."""
    comments = [line for line in lines if line.startswith("#")]
    for comment in comments:
        is_other = _says(_SPECTRAL, comment) and not _says(_PGA, comment)
        if is_other or (_says(r"exceed|probab", comment) and _says(_NO_RATE, comment)):
            raise InputError(
                f"{path}: its comment says {shown(comment.strip(' #'))}: "
                "must be a curve of PGA and annual rates"
            )
    return "\n".join(comments)


def _openquake_curve(
    path: Path,
    lines: Sequence[str],
    g: float,
    site: int | None,
    unstated: Unstated,
    about: Mapping[str, str],
) -> HazardCurve:
    """Return the curve of one site from the lines of a file of OpenQuake.

    The file has a comment with T and the measure, a line of names, and a row for each site.
    """
    head = " ".join(line for line in lines if line.startswith("#"))
    duration = re.search(r"investigation_time\s*=[\s\"']*([\d.eE+-]+)", head)
    if duration is None:
        raise InputError(
            f"{path}: no investigation_time in its first line: it is needed for annual rates"
        )
    measure = re.search(r"\bimt\s*=[\s\"']*([^\s\"',]+)", head)
    if measure is None and unstated == "refuse":
        raise InputError(
            f"{path}: no imt in its first line: does not say that it is PGA; {_ACCEPT}"
        )
    if measure is not None and measure[1].upper() != "PGA":
        raise InputError(f"{path}: curves of {measure[1]}: must be of PGA")
    names, *rows = csv.reader(line for line in lines if line.strip() and not line.startswith("#"))
    if not 1 <= (1 if site is None else site) <= len(rows) or (site is None and len(rows) > 1):
        raise InputError(
            f"{path}: {len(rows)} sites: give the number of one, site = 1 to {len(rows)} (--site)"
        )
    row = dict(zip(names, rows[(site or 1) - 1], strict=False))
    try:
        levels = {
            float(match[1]): float(row[name]) for name in names if (match := _POE.fullmatch(name))
        }
    except (KeyError, ValueError):
        raise InputError(f"{path}: site {site or 1}: must have a number for each level") from None
    amplitude = np.array([*levels])
    probability = np.array([*levels.values()])
    if not ((probability >= 0.0) & (probability <= 1.0)).all():
        raise InputError(f"{path}: site {site or 1}: probabilities must be from 0 to 1")
    # at 1 the rate is not known, at 0 there is none; printed probabilities of neighbours may be the
    # same
    used = (probability > 0.0) & (probability < 1.0) & (np.diff(probability, prepend=np.inf) != 0.0)
    where = {f"hazard_curve_{name}": row[name] for name in ("lon", "lat") if name in row}
    rate = -np.log1p(-probability[used]) / float(duration[1])
    return HazardCurve(amplitude[used] * g, rate, str(path), {**about, **where})
