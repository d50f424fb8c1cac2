"""`displacement_hazard`: the mean annual rate of exceeding a displacement.

λ(d) = ∫ P(u > d | a) |dν(a)|, where P is the fragility, and ν(a) the mean annual rate of peak
ground accelerations above a (Cornell 1968).  The integral is exact for the straight lines between
points that `displacement_hazard` names.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
import xarray as xr

from slipsweep.errors import InputError, RunError
from slipsweep.model.parameters import shown
from slipsweep.model.units import in_mm
from slipsweep.model.variables import (
    HAZARD_RESULTS,
    PARAMETERS,
    PUBLISHED_RESULTS,
    STRENGTHS,
    counted,
    counted_text,
)
from slipsweep.studies.hazard_curve import HazardCurve, read_hazard_curve
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

#: Accelerations over a hazard curve at which published equations are evaluated.
PUBLISHED_POINTS = 401

#: Probability of exceedance at the start of a hazard curve from which on what lies below it counts.
_LITTLE = 0.01


def fragility(
    result: xr.Dataset, thresholds: Thresholds | None = None, over: Any = None
) -> xr.Dataset:
    """Return the probability of exceeding displacements along `amplitude`.

    It is that of a suite, of uncertain inputs, or of both. Arguments are those of
    `displacement_hazard`. The result has `exceedance_probability` (dimensions of the grid,
    amplitude, threshold) and `valueless_share`. InputError: no dimension `amplitude` of two values
    or more, no suite and nothing uncertain, or no such threshold.
    """
    name = (
        "exceedance_probability" if "exceedance_probability" in result else "permanent_displacement"
    )
    if name in result and result[name].sizes.get("amplitude", 1) < 2:
        raise InputError(
            "result: amplitude: must be a dimension of two peak ground accelerations or more: the "
            "probability of exceedance is needed at each"
        )
    names = ["exceedance_probability", "valueless_share"]
    if name == "permanent_displacement":
        limits = THRESHOLDS if thresholds is None else thresholds
        shares = suite_statistics(result, thresholds=limits, quantiles=0.5, over=over)[names]
    else:
        shares = at_thresholds(result[names].load(), thresholds)
        dims = suite_dims(shares["exceedance_probability"], over) if "motion" in shares.dims else ()
        # dimensions of "4 motion x 2 polarity"
        pooled = re.findall(r"\d+ (\w+)", str(result.attrs.get("pooled", "")))
        shares = shares.mean(dims, keep_attrs=True).assign_attrs(
            suite_dimensions=" ".join((*dims, *pooled, "samples"))
        )
    # nothing moves at an amplitude of 0, which has no logarithm
    is_shaken = np.flatnonzero(shares["amplitude"].values > 0.0)
    shares = shares.isel(amplitude=is_shaken).sortby("amplitude")
    return shares.transpose(..., "amplitude", "threshold")


def published_fragility(
    result: xr.Dataset,
    curve: HazardCurve,
    equations: str | Sequence[str],
    thresholds: Thresholds | None = None,
    magnitude: float | None = None,
) -> xr.Dataset:
    """Return the probability of exceeding displacements by published equations.

    It has the form of `fragility`. The amplitudes are `PUBLISHED_POINTS` from one end of the hazard
    curve to the other: equations need no motions, and of the result only the blocks. `in_range`
    goes with it.
    """
    strengths = [*STRENGTHS, "displacement_amplitude"]
    first = dict.fromkeys([name for name in strengths if name in result.dims], 0)
    blocks = result.isel(first).drop_vars(strengths, errors="ignore")
    amplitude = np.geomspace(curve.amplitude[0], curve.amplitude[-1], PUBLISHED_POINTS)
    amplitude[[0, -1]] = curve.amplitude[[0, -1]]  # the ends without rounding
    placed = blocks.assign_coords(amplitude=("amplitude", amplitude, PARAMETERS["amplitude"]))
    shares = published_statistics(
        placed,
        equations,
        magnitude=magnitude,
        thresholds=THRESHOLDS if thresholds is None else thresholds,
        quantiles=0.5,
    )
    missing = shares["exceedance_probability"].isel(threshold=0, drop=True).isnull()
    shares["valueless_share"] = missing.astype(np.float64)
    names = ["exceedance_probability", "valueless_share", "in_range"]
    return shares[names].transpose(..., "amplitude", "threshold")


def openquake_fragility(shares: xr.Dataset) -> str:
    """Return a fragility as an XML file of OpenQuake (NRML 0.5), a function for each grid point.

    Thresholds of `shares` (`fragility`) are the limit states, amplitudes are in g.  The first
    amplitude is the limit of no damage: nothing is extrapolated to it.  InputError: a probability
    is missing, as the model gives no value there.
    """
    g = float(shares.attrs["g"])
    probability = shares["exceedance_probability"].transpose(..., "threshold", "amplitude")
    if probability.isnull().any():
        raise InputError(
            "no value under any motion or sample at some amplitudes: cut the axis amplitude"
        )
    states = [f"u_above_{in_mm(d):.6g}_mm" for d in shares["threshold"].values]
    grid = {
        dim: size
        for dim, size in probability.sizes.items()
        if dim not in ("threshold", "amplitude")
    }
    levels = shares["amplitude"].values / g
    root = xml.Element("nrml", xmlns="http://openquake.org/xmlns/nrml/0.5")
    about = {"id": "slipsweep", "assetCategory": "slopes", "lossCategory": "structural"}
    model = xml.SubElement(root, "fragilityModel", about)
    description = f"{shares.attrs.get('title', '')} ({shares.attrs.get('source', '')})"
    xml.SubElement(model, "description").text = description
    xml.SubElement(model, "limitStates").text = " ".join(states)
    curves = probability.values.reshape(-1, len(states), levels.size)
    for name, rows in zip(point_names(shares, grid), curves, strict=True):
        identifier = "_".join(name.replace("=", " ").replace(",", " ").split()) or "block"
        function = xml.SubElement(model, "fragilityFunction", id=identifier, format="discrete")
        imls = xml.SubElement(function, "imls", imt="PGA", noDamageLimit=f"{levels[0]:.6g}")
        imls.text = " ".join(f"{level:.6g}" for level in levels)
        for state, row in zip(states, rows, strict=True):
            poes = xml.SubElement(function, "poes", ls=state)
            poes.text = " ".join(f"{chance:.6g}" for chance in row)
    xml.indent(root)
    text = xml.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def exceedance_rates(curve: HazardCurve, amplitude: Any, probability: Any) -> dict[str, Floats]:
    """Integrate a fragility over a hazard curve: return the rates of `displacement_hazard`.

    `probability` is that of exceedance; its first dimension is that of `amplitude` (m/s², > 0,
    increasing, two at least).  InputError: no amplitude lies within the curve.
    """
    from scipy.interpolate import make_interp_spline

    amplitudes = np.asarray(amplitude, np.float64)
    shares = np.asarray(probability, np.float64)
    low = max(amplitudes[0], curve.amplitude[0])
    high = min(amplitudes[-1], curve.amplitude[-1])
    if low >= high:
        raise InputError(
            f"{curve.name}: reaches from {curve.amplitude[0]:.6g} to {curve.amplitude[-1]:.6g} "
            f"m/s2, and the amplitudes of the fragility from {amplitudes[0]:.6g} to "
            f"{amplitudes[-1]:.6g} m/s2: they must overlap"
        )
    points = np.union1d(amplitudes, curve.amplitude)
    points = points[(points >= low) & (points <= high)]
    rates = curve.rate_at(points)
    chances = make_interp_spline(np.log(amplitudes), shares, k=1)(np.log(points))
    # P is straight in ln a, and ν = exp(−k ln a).  Over a step h of ln a,
    # ∫ P |dν| = P₁ (ν₁ − ν₂) + (P₂ − P₁) ((ν₁ − ν₂) / (k h) − ν₂)
    falls = -np.diff(np.log(rates))
    drops = rates[1:] * np.expm1(falls)
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = np.where(falls > 1e-6, drops / falls - rates[1:], 0.5 * drops)
    inside = np.tensordot(drops, chances[:-1], 1) + np.tensordot(
        weights, np.diff(chances, axis=0), 1
    )
    held = chances[-1] * rates[-1]
    below = np.clip(
        np.searchsorted(amplitudes, points[:-1], side="right") - 1, 0, amplitudes.size - 2
    )
    ends = np.sort([shares[below], shares[below + 1]], axis=0)
    omitted = chances[0] * (curve.rate[0] - rates[0])
    if (
        curve.amplitude[0] > amplitudes[0]
    ):  # the rates of accelerations below the curve are not known
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
    """Mean annual rates of exceeding displacements, from a hazard curve and a fragility.

    The integral is that of Cornell [1]_.

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
        - `held_rate`: the part of it from above the largest amplitude, or the end of the curve; P
          is held there.
        - `omitted_rate`: an upper bound of what is left out below the smallest amplitude, where P
          is taken as 0.  NaN where the curve starts above the smallest amplitude, and P is not 0
          there.
        - `lower_rate`, `upper_rate`: the rate if P between two amplitudes is the lower, or the
          higher, of the two.  If they differ much, more amplitudes are needed.
        - `valueless_share`: the largest share of motions or samples without a value at any
          amplitude.
        - `outside_rate`, of equations: the part of the rate that is outside of their range.

    Raises
    ------
    InputError
        As `suite_statistics`; the curve does not overlap with the amplitudes; or only two
        amplitudes have a value, and different probabilities: those in between are then not known.
    RunError
        There is no rate at any grid point.

    See Also
    --------
    HazardCurve : the hazard of a site
    suite_statistics : without it

    References
    ----------
    .. [1] C. A. Cornell (1968), "Engineering seismic risk analysis", Bulletin of the
       Seismological Society of America 58, 1583-1606.

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
        shares = fragility(result, thresholds, over)
    else:
        shares = published_fragility(result, curve, equations, thresholds, magnitude)
    results = _rates_of_points(curve, shares, equations is not None)
    if results["annual_rate"].isnull().all():
        reason = "the model gives no value under any motion at two amplitudes or more"
        if equations is not None:
            reason = "each block slides under its own weight"
        raise RunError(f"no annual rate: {reason}")
    results["valueless_share"] = shares["valueless_share"].max("amplitude").variable
    for name, values in results.items():
        values.attrs = counted((HAZARD_RESULTS | PUBLISHED_RESULTS)[name], shares.attrs)
    coords = {
        name: coordinate.variable
        for name, coordinate in shares.coords.items()
        if "amplitude" not in (*coordinate.dims, name)
    }
    ends = [0, -1]
    attrs = {
        **shares.attrs,
        "title": counted_text(TITLE, shares.attrs),
        "hazard_curve": curve.name,
        **curve.attrs,
        "hazard_curve_range": curve.amplitude[ends],
        "amplitude_range": shares["amplitude"].values.astype(np.float64)[ends],
    }
    attrs.pop("zero_displacement", None)
    return xr.Dataset(results, coords, attrs)


def _rates_of_points(
    curve: HazardCurve, shares: xr.Dataset, by_equations: bool
) -> dict[str, xr.Variable]:
    """Return the rates at each grid point of a fragility; NaN where there is none."""
    amplitude = shares["amplitude"].values.astype(np.float64)
    chances = shares["exceedance_probability"].variable
    names = [*HAZARD_RESULTS, *(["outside_rate"] if by_equations else [])]
    results = {name: xr.full_like(chances.sum("amplitude"), np.nan) for name in names}
    for point in np.ndindex(chances.shape[:-2]):
        there = np.isfinite(chances.values[*point, :, 0])
        of_point = chances.values[*point, there]
        if len(of_point) < 2:
            continue
        if len(of_point) == 2 and (of_point[0] != of_point[1]).any():
            raise InputError(
                "result: amplitude: only two peak ground accelerations have a value, and P(u > d) "
                "differs between them; how it grows in between is not known: run the sweep with "
                "more values on the axis amplitude"
            )
        rates = exceedance_rates(curve, amplitude[there], of_point)
        if by_equations:
            in_range = shares["in_range"].values[*point, there, None]
            outside = np.where(in_range, 0.0, of_point)
            parts = exceedance_rates(curve, amplitude[there], outside)
            rates["outside_rate"] = parts["annual_rate"]
            # a lognormal distribution has a probability above 0 at any amplitude
            rates["omitted_rate"] = np.where(of_point[0] > _LITTLE, np.nan, 0.0)
        for name, values in rates.items():
            results[name][point] = values
    return results
