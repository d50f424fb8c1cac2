"""Seismic hazard, fragility P(u > d | a), and with both the mean annual rate of exceeding a displacement.

λ(d) = ∫ P(u > d | a) |dν(a)|, where ν(a) is the mean annual rate of peak ground accelerations above
a (Cornell 1968): exact for the straight lines between points that `displacement_hazard` names.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias
from xml.etree import ElementTree as xml

import numpy as np
import xarray as xr

from slipsweep.errors import InputError, RunError
from slipsweep.model.parameters import check_numbers, number_text, shown
from slipsweep.model.units import conversion
from slipsweep.model.variables import (
    HAZARD_RESULTS,
    PARAMETERS,
    PUBLISHED_RESULTS,
    STRENGTHS,
    counted,
    counted_text,
)
from slipsweep.motion.lines import read_columns, read_lines
from slipsweep.studies.published_statistics import published_statistics
from slipsweep.studies.sampling import Floats, Thresholds
from slipsweep.studies.suite_statistics import (
    THRESHOLDS,
    at_thresholds,
    point_names,
    suite_dims,
    suite_statistics,
)

TITLE = "Mean annual rate of exceeding a permanent displacement"

Unstated: TypeAlias = Literal["refuse", "accept"]

#: What a heading calls the measure of a curve: peak ground acceleration, another one, or a measure
#: that may be either.
_PGA = r"\bpga\b|\bpeak\b.*\bacc|\bzpa\b"
_SPECTRAL = r"\bp?sa\b|\bsa\s?\(|spectral|response.spectr|\bpg[vd]\b"
_OTHER_MEASURE = (
    rf"{_SPECTRAL}|\bs[dv]\b|velocity|displacement|\bmmi\b|\barias\b|\bcav\b|\bia\b"
    r"|(?<!return )period|\b\d+(?:\.\d+)?\s?(?:s|sec|hz)\b"
)
_MEASURE = r"accel|amplitude|ground.?motion|\bi(ml|mt|m)\b|intensity|\blevel"

#: What it calls a rate, whether it says that it is one a year, and what is none.
_RATE = r"\brate|\bfrequency|exceed|\bm?afe\b|\bmaf\b|\blambda\b|λ"
_ANNUAL = r"annual|yearly|a year|per (?:year|yr|annum)|/\s?(?:year|yr|a)\b|\bm?afe\b|\bmaf\b"
_NO_RATE = r"probab|\bpoe\b|\baep\b|\bpe\b|\b\d+(?:\.\d+)?[ -]?(?:years?|yrs?|a)\b|return|period"

#: Spellings of the unit of an annual rate.
_PER_YEAR = {"1/yr", "1/year", "1/a", "/yr", "/year", "yr-1", "year-1", "a-1", "per year"}

#: Accelerations over a hazard curve at which published equations are evaluated.
PUBLISHED_POINTS = 401

#: Probability of exceedance at the start of a hazard curve from which on what lies below it counts.
_LITTLE = 0.01

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
        amplitude, rate = (
            check_numbers(f"{self.name}: {name}", getattr(self, name))
            for name in ("amplitude", "rate")
        )
        if amplitude.ndim != 1 or amplitude.shape != rate.shape or amplitude.size < 2:
            raise InputError(
                f"{self.name}: {amplitude.size} amplitudes and {rate.size} rates: must be as many of each, 2 at least"
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
                    f"{self.name}: {name} of point {at + 1} = {text}: must be > 0, and {word} than the one before"
                )

    def rate_at(self, amplitude: Floats) -> Floats:
        """The rate within the curve, linear between its points in logarithms of both."""
        return np.asarray(
            np.exp(np.interp(np.log(amplitude), np.log(self.amplitude), np.log(self.rate)))
        )


def read_hazard_curve(
    path: str | Path, g: float, site: int | None = None, unstated: Unstated = "refuse"
) -> HazardCurve:
    """Read a hazard curve of peak ground acceleration from a CSV file; "g" as a unit is `g` m/s², that of the result.

    The first line that is not blank and does not begin with ``#`` names the columns: ``PGA (g),
    annual rate``. Columns of other names are left out.  Or a file of OpenQuake, whose probabilities
    of exceedance become annual rates, −ln(1 − p)/T with its investigation time T; `site` is which
    of its sites, from 1, and needed if it has several.

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
    """The comments of a table (InputError: one says that the curve is another one)."""
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
    """One site's curve from a file of OpenQuake: a comment with T and the measure, names, and a row for each site."""
    head = " ".join(line for line in lines if line.startswith("#"))
    found = re.search(r"investigation_time\s*=[\s\"']*([\d.eE+-]+)", head)
    if found is None:
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
    rate = -np.log1p(-probability[used]) / float(found[1])
    return HazardCurve(amplitude[used] * g, rate, str(path), {**about, **where})


def fragility(
    result: xr.Dataset, thresholds: Thresholds | None = None, over: Any = None
) -> xr.Dataset:
    """Probability of exceeding displacements along `amplitude`, of a suite, of uncertain inputs, or of both.

    Arguments are those of `displacement_hazard`.  The result has `exceedance_probability`
    (dimensions of the grid, amplitude, threshold) and `valueless_share`.  InputError: no dimension
    `amplitude` of two values or more, no suite and nothing uncertain, or no such threshold.
    """
    name = (
        "exceedance_probability" if "exceedance_probability" in result else "permanent_displacement"
    )
    if name in result and result[name].sizes.get("amplitude", 1) < 2:
        raise InputError(
            "result: amplitude: must be a dimension of two peak ground accelerations or more: the probability of "
            "exceedance is needed at each"
        )
    wanted = ["exceedance_probability", "valueless_share"]
    if name == "permanent_displacement":
        given = THRESHOLDS if thresholds is None else thresholds
        found = suite_statistics(result, thresholds=given, quantiles=0.5, over=over)[wanted]
    else:
        found = at_thresholds(result[wanted].load(), thresholds)
        dims = suite_dims(found["exceedance_probability"], over) if "motion" in found.dims else ()
        pooled = re.findall(
            r"\d+ (\w+)", str(result.attrs.get("pooled", ""))
        )  # of "4 motion x 2 polarity"
        found = found.mean(dims, keep_attrs=True).assign_attrs(
            suite_dimensions=" ".join((*dims, *pooled, "samples"))
        )
    # none exceeds anything at 0, which has no logarithm
    found = found.isel(amplitude=np.flatnonzero(found["amplitude"].values > 0.0)).sortby(
        "amplitude"
    )
    return found.transpose(..., "amplitude", "threshold")


def published_fragility(
    result: xr.Dataset,
    curve: HazardCurve,
    equations: str | Sequence[str],
    thresholds: Thresholds | None = None,
    magnitude: float | None = None,
) -> xr.Dataset:
    """Probability of exceeding displacements by published equations, as `fragility` of a suite.

    The amplitudes are `PUBLISHED_POINTS` from one end of the hazard curve to the other: equations
    need no motions, and of the result only the blocks.  `in_range` goes with it.
    """
    strengths = [*STRENGTHS, "displacement_amplitude"]
    first = dict.fromkeys([name for name in strengths if name in result.dims], 0)
    blocks = result.isel(first).drop_vars(strengths, errors="ignore")
    amplitude = np.geomspace(curve.amplitude[0], curve.amplitude[-1], PUBLISHED_POINTS)
    amplitude[[0, -1]] = curve.amplitude[[0, -1]]  # the ends without rounding
    placed = blocks.assign_coords(amplitude=("amplitude", amplitude, PARAMETERS["amplitude"]))
    found = published_statistics(
        placed,
        equations,
        magnitude=magnitude,
        thresholds=THRESHOLDS if thresholds is None else thresholds,
        quantiles=0.5,
    )
    missing = found["exceedance_probability"].isel(threshold=0, drop=True).isnull()
    found["valueless_share"] = missing.astype(np.float64)
    wanted = ["exceedance_probability", "valueless_share", "in_range"]
    return found[wanted].transpose(..., "amplitude", "threshold")


def openquake_fragility(found: xr.Dataset) -> str:
    """A fragility as an XML file of OpenQuake (NRML 0.5): a discrete function for each grid point.

    Thresholds of `found` (`fragility`) are the limit states, amplitudes are in g.  The first is the
    limit of no damage: nothing is extrapolated to it.  InputError: a probability is missing, as the
    model gives no value there.
    """
    g = float(found.attrs["g"])
    probability = found["exceedance_probability"].transpose(..., "threshold", "amplitude")
    if probability.isnull().any():
        raise InputError(
            "no value under any motion or sample at some amplitudes: cut the axis amplitude"
        )
    states = [f"u_above_{d * 1000.0:.6g}_mm" for d in found["threshold"].values]
    grid = {
        dim: size
        for dim, size in probability.sizes.items()
        if dim not in ("threshold", "amplitude")
    }
    levels = found["amplitude"].values / g
    root = xml.Element("nrml", xmlns="http://openquake.org/xmlns/nrml/0.5")
    own = {"id": "slipsweep", "assetCategory": "slopes", "lossCategory": "structural"}
    model = xml.SubElement(root, "fragilityModel", own)
    xml.SubElement(
        model, "description"
    ).text = f"{found.attrs.get('title', '')} ({found.attrs.get('source', '')})"
    xml.SubElement(model, "limitStates").text = " ".join(states)
    curves = probability.values.reshape(-1, len(states), levels.size)
    for name, rows in zip(point_names(found, grid), curves, strict=True):
        own_id = "_".join(name.replace("=", " ").replace(",", " ").split())
        function = xml.SubElement(
            model, "fragilityFunction", id=own_id or "block", format="discrete"
        )
        imls = xml.SubElement(function, "imls", imt="PGA", noDamageLimit=f"{levels[0]:.6g}")
        imls.text = " ".join(f"{one:.6g}" for one in levels)
        for state, row in zip(states, rows, strict=True):
            xml.SubElement(function, "poes", ls=state).text = " ".join(f"{one:.6g}" for one in row)
    xml.indent(root)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root, encoding="unicode") + "\n"
    )


def exceedance_rates(curve: HazardCurve, amplitude: Any, probability: Any) -> dict[str, Floats]:
    """Integrate a fragility over a hazard curve: the rates of `displacement_hazard`.

    `probability` has that of exceedance at each `amplitude` (m/s², > 0, increasing, two at least)
    along its first dimension.  InputError: no amplitude lies within the curve.
    """
    from scipy.interpolate import make_interp_spline

    given = np.asarray(amplitude, np.float64)
    shares = np.asarray(probability, np.float64)
    low = max(given[0], curve.amplitude[0])
    high = min(given[-1], curve.amplitude[-1])
    if low >= high:
        raise InputError(
            f"{curve.name}: reaches from {curve.amplitude[0]:.6g} to {curve.amplitude[-1]:.6g} m/s2, and the "
            f"amplitudes of the fragility from {given[0]:.6g} to {given[-1]:.6g} m/s2: they must overlap"
        )
    points = np.union1d(given, curve.amplitude)
    points = points[(points >= low) & (points <= high)]
    rates = curve.rate_at(points)
    chances = make_interp_spline(np.log(given), shares, k=1)(np.log(points))
    # P is straight in ln a, ν is exp(-k ln a): ∫ P |dν| = P₁ (ν₁ - ν₂) + (P₂ - P₁) ((ν₁ - ν₂) / (k
    # h) - ν₂)
    falls = -np.diff(np.log(rates))
    drops = rates[1:] * np.expm1(falls)
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = np.where(falls > 1e-6, drops / falls - rates[1:], 0.5 * drops)
    inside = np.tensordot(drops, chances[:-1], 1) + np.tensordot(
        weights, np.diff(chances, axis=0), 1
    )
    held = chances[-1] * rates[-1]
    below = np.clip(np.searchsorted(given, points[:-1], side="right") - 1, 0, given.size - 2)
    ends = np.sort([shares[below], shares[below + 1]], axis=0)
    omitted = chances[0] * (curve.rate[0] - rates[0])
    if curve.amplitude[0] > given[0]:  # how often what lies below the curve occurs is not known
        omitted = np.where(chances[0] > 0.0, np.nan, omitted)
    return {
        "annual_rate": inside + held,
        "held_rate": held,
        "omitted_rate": omitted,
        "lower_rate": np.tensordot(drops, ends[0], 1) + held,
        "upper_rate": np.tensordot(drops, ends[1], 1) + held,
    }


def displacement_hazard(
    result: xr.Dataset,
    curve: HazardCurve | str | Path,
    thresholds: Thresholds | None = None,
    *,
    over: str | Sequence[str] | None = None,
    equations: str | Sequence[str] | None = None,
    magnitude: float | None = None,
) -> xr.Dataset:
    """Mean annual rates of exceeding displacements (Cornell [1]_), from a hazard curve and a fragility.

    P(u > d | A) is the share of the motions, or of the samples of uncertain inputs, that exceed d;
    it is straight in ln A between the amplitudes of the result.  The hazard curve is straight in
    logarithms of both between its points.

    Parameters
    ----------
    result : Dataset
        A result of `sweep` with the dimensions `motion` and `amplitude`, or of `sample` with
        `amplitude`: motions of a suite that were not pooled are equally likely.
    curve : HazardCurve, str or Path
        Or a CSV file with the columns "PGA (g)" and "annual rate", or one of OpenQuake's with one
        site.
    thresholds : float, str or list of these, optional
        In m or with a unit, as in `suite_statistics`; of a result of `sample` some of its own, by
        default all.
    over : str or list of str, optional
        As in `suite_statistics`.
    equations : str or list of str, optional
        Names of published equations that take the place of the suite, as in `published_statistics`:
        `result` then only has the blocks, and P is evaluated over the whole curve.
    magnitude : float, optional
        Moment magnitude M, for the equations that need it.

    Returns
    -------
    Dataset
        Over all other dimensions, `equation` if there are some, and `threshold` (m), per year:

        - `annual_rate`: NaN where fewer than two amplitudes have a value.
        - `held_rate`: the part of it from above the largest amplitude, or the end of the curve: P is held there.
        - `omitted_rate`: what it leaves out below the smallest amplitude, where P is taken as 0: this much at most.
          NaN where the curve starts above the smallest amplitude, and P is not 0 there.
        - `lower_rate`, `upper_rate`: the rate if P between two amplitudes is the lower, or the higher, of the two.  Far
          from each other, more amplitudes are needed.
        - `valueless_share`: the largest share of motions or samples without a value at any amplitude.
        - `outside_rate`, of equations: the part of the rate that is outside of their range.

    Raises
    ------
    InputError
        As `suite_statistics`; the curve does not overlap with the amplitudes; or only two
        amplitudes have a value, and different probabilities: what lies between them is then not
        known.
    RunError
        There is no rate at any grid point.

    See Also
    --------
    HazardCurve : the hazard of a site
    suite_statistics : without it

    References
    ----------
    .. [1] C. A. Cornell (1968), "Engineering seismic risk analysis", Bulletin of the Seismological Society of America
       58, 1583-1606.

    Examples
    --------
    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/*_H1.AT2")
    >>> result = slipsweep.sweep(5, 0.3, amplitude=[2.0, 4.0, 6.0, 8.0], excitation=suite)
    >>> curve = slipsweep.HazardCurve(amplitude=[0.5, 2.0, 8.0], rate=[2e-2, 2e-3, 6e-5])
    >>> rates = slipsweep.displacement_hazard(result, curve, "50mm")
    >>> print(f"{rates.annual_rate.item():.1e} a year")
    3.7e-04 a year
    """
    if not isinstance(result, xr.Dataset):
        raise InputError(f"result = {shown(result)}: must be a Dataset")
    if not isinstance(curve, HazardCurve):
        curve = read_hazard_curve(curve, float(result.attrs.get("g", np.nan)))
    if equations is None and magnitude is not None:
        raise InputError(f"magnitude = {shown(magnitude)}: only with equations")
    if equations is None:
        found = fragility(result, thresholds, over)
    else:
        found = published_fragility(result, curve, equations, thresholds, magnitude)
    amplitude = found["amplitude"].values.astype(np.float64)
    chances = found["exceedance_probability"].variable
    names = [*HAZARD_RESULTS, *([] if equations is None else ["outside_rate"])]
    results = {name: xr.full_like(chances.sum("amplitude"), np.nan) for name in names}
    results["valueless_share"] = found["valueless_share"].max("amplitude").variable
    for point in np.ndindex(chances.shape[:-2]):
        there = np.isfinite(chances.values[*point, :, 0])
        own = chances.values[*point, there]
        if len(own) == 2 and (own[0] != own[1]).any():
            raise InputError(
                "result: amplitude: only two peak ground accelerations have a value, and P(u > d) differs between "
                "them; how it grows in between is not known: run the sweep with more values on the axis amplitude"
            )
        rates = exceedance_rates(curve, amplitude[there], own) if len(own) > 1 else {}
        if rates and equations is not None:
            outside = np.where(found["in_range"].values[*point, there, None], 0.0, own)
            parts = exceedance_rates(curve, amplitude[there], outside)
            rates["outside_rate"] = parts["annual_rate"]
            # the least probability by a lognormal distribution is above 0
            rates["omitted_rate"] = np.where(own[0] > _LITTLE, np.nan, 0.0)
        for name, values in rates.items():
            results[name][point] = values
    if results["annual_rate"].isnull().all():
        why = "the model gives no value under any motion at two amplitudes or more"
        if equations is not None:
            why = "each block slides under its own weight"
        raise RunError(f"no annual rate: {why}")
    for name, one in results.items():
        one.attrs = counted((HAZARD_RESULTS | PUBLISHED_RESULTS)[name], found.attrs)
    coords = {
        name: one.variable
        for name, one in found.coords.items()
        if "amplitude" not in (*one.dims, name)
    }
    found.attrs.pop("zero_displacement", None)
    attrs = {
        **found.attrs,
        "title": counted_text(TITLE, found.attrs),
        "hazard_curve": curve.name,
        **curve.attrs,
    }
    ranges = {"hazard_curve_range": curve.amplitude[[0, -1]], "amplitude_range": amplitude[[0, -1]]}
    return xr.Dataset(results, coords, attrs | ranges)
