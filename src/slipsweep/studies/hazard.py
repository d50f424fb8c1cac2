"""Fragility, P(u > d | a), and with a seismic hazard the mean annual rate of exceeding a displacement.

λ(d) = ∫ P(u > d | a) |dν(a)|, where ν(a) is the mean annual rate of peak ground accelerations above a (Cornell 1968).
ln ν is straight in ln a between the points of the hazard curve, P in ln a between the amplitudes of the grid; the
integral over these lines is exact.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.model.parameters import number_text, shown
from slipsweep.model.variables import HAZARD_RESULTS
from slipsweep.studies.hazard_curves import HazardCurve, read_hazard_curve
from slipsweep.studies.sampling import Thresholds, check_thresholds
from slipsweep.studies.suite_statistics import point_names, suite_dims, suite_statistics

Floats = NDArray[np.float64]

TITLE = "Mean annual rate of exceeding a permanent displacement"

#: What is known of a rate if P is only known to lie between its values at neighbouring amplitudes.
_BOUNDS = {
    "lower_rate": {"units": "year-1", "long_name": "annual rate with the lower probability of each two amplitudes"},
    "upper_rate": {"units": "year-1", "long_name": "annual rate with the higher probability of each two amplitudes"},
}

#: Displacements of a suite's fragility where none are given, m.
_THRESHOLDS = (0.01, 0.1, 1.0)


def fragility(result: xr.Dataset, thresholds: Thresholds | None = None, over: Any = None) -> xr.Dataset:
    """Probability of exceeding displacements along `amplitude`, of a suite, of uncertain inputs, or of both.

    Parameters
    ----------
    result : Dataset
        A result of `sweep` under a suite, or of `sample`.  Motions of a suite that were not pooled are equally likely.
    thresholds : float, str or list of these, optional
        Increasing displacements, m or with a unit.  Of uncertain inputs they must be among those of the result.
    over : str or list of str, optional
        Dimensions that make up the suite, as in `suite_statistics`.

    Returns
    -------
    Dataset
        `exceedance_probability` (dimensions of the grid, amplitude, threshold) and `valueless_share`.

    Raises
    ------
    InputError
        There is no dimension `amplitude` of two values or more, no suite and nothing uncertain, or no such threshold.

    Examples
    --------
    >>> import slipsweep
    >>> friction = {"mu_s": {"distribution": "lognorm", "s": 0.1, "scale": 0.4}}
    >>> result = slipsweep.sample(5, amplitude=[3.0, 5.0], frequency=2.0, uncertain=friction, thresholds=["50mm"])
    >>> fragility(result).exceedance_probability.round(2).values
    array([[0.02],
           [1.  ]])
    """
    name = "exceedance_probability" if "exceedance_probability" in result else "permanent_displacement"
    if name in result and result[name].sizes.get("amplitude", 1) < 2:
        raise InputError(
            "result: amplitude: must be a dimension of two peak ground accelerations or more: the probability of "
            "exceedance is needed at each"
        )
    if name == "permanent_displacement":
        wanted = _THRESHOLDS if thresholds is None else thresholds
        found = suite_statistics(result, thresholds=wanted, quantiles=0.5, over=over)
        found = found[["exceedance_probability", "valueless_share"]].drop_vars(["quantile", "flag"], errors="ignore")
    else:
        found = _of_samples(result, thresholds, over)
    # none exceeds anything at 0, which has no logarithm
    found = found.isel(amplitude=np.flatnonzero(found["amplitude"].values > 0.0)).sortby("amplitude")
    return found.transpose(..., "amplitude", "threshold")


def _of_samples(result: xr.Dataset, thresholds: Any, over: Any) -> xr.Dataset:
    """The fragility that `sample` has stored, at some of its thresholds."""
    found = result[["exceedance_probability", "valueless_share"]].load()
    if thresholds is not None:
        wanted = check_thresholds("thresholds", thresholds, float(result.attrs.get("g", np.nan)))
        nearest = found.sel(threshold=wanted, method="nearest")
        for one, there in zip(wanted, nearest["threshold"].values, strict=True):
            if not np.isclose(there, one, rtol=1e-6):
                stored = ", ".join(f"{d:.6g}" for d in found["threshold"].values)
                raise InputError(
                    f"thresholds = {number_text(float(one))}: not among those of the result, {stored} m: "
                    "add it to the thresholds of [uncertainty], and run again"
                )
        found = nearest
    dims = suite_dims(found["exceedance_probability"], over) if "motion" in found.dims else ()
    pooled = " ".join(dims) or str(result.attrs.get("pooled", "")) or "samples"
    return found.mean(dims, keep_attrs=True).assign_attrs(suite_dimensions=pooled)


def openquake_fragility(found: xr.Dataset) -> str:
    """A fragility as an XML file of OpenQuake (NRML 0.5): a discrete function for each grid point.

    Parameters
    ----------
    found : Dataset
        What `fragility` returns.  Limit states are its thresholds.

    Returns
    -------
    str
        Peak ground accelerations in g, to which no probability is extrapolated: the first is the limit of no damage.

    Raises
    ------
    InputError
        A probability is missing: the model gives no value there.

    Examples
    --------
    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/*_H1.AT2")
    >>> result = slipsweep.sweep(5, 0.3, amplitude=[2.0, 4.0, 6.0], excitation=suite)
    >>> text = openquake_fragility(fragility(result, "50mm"))
    >>> [line.strip() for line in text.splitlines() if "poes" in line]
    ['<poes ls="u_above_50_mm">0 0.25 0.75</poes>']
    """
    g = float(found.attrs["g"])
    probability = found["exceedance_probability"].transpose(..., "threshold", "amplitude")
    if probability.isnull().any():
        raise InputError("no value under any motion or sample at some amplitudes: cut the axis amplitude")
    states = [f"u_above_{d * 1000.0:.6g}_mm" for d in found["threshold"].values]
    grid = {dim: size for dim, size in probability.sizes.items() if dim not in ("threshold", "amplitude")}
    levels = found["amplitude"].values / g
    root = xml.Element("nrml", xmlns="http://openquake.org/xmlns/nrml/0.5")
    own = {"id": "slipsweep", "assetCategory": "slopes", "lossCategory": "structural"}
    model = xml.SubElement(root, "fragilityModel", own)
    xml.SubElement(model, "description").text = f"{found.attrs.get('title', '')} ({found.attrs.get('source', '')})"
    xml.SubElement(model, "limitStates").text = " ".join(states)
    curves = probability.values.reshape(-1, len(states), levels.size)
    for name, rows in zip(point_names(found, grid), curves, strict=True):
        own_id = "_".join(name.replace("=", " ").replace(",", " ").split())
        function = xml.SubElement(model, "fragilityFunction", id=own_id or "block", format="discrete")
        imls = xml.SubElement(function, "imls", imt="PGA", noDamageLimit=f"{levels[0]:.6g}")
        imls.text = " ".join(f"{one:.6g}" for one in levels)
        for state, row in zip(states, rows, strict=True):
            xml.SubElement(function, "poes", ls=state).text = " ".join(f"{one:.6g}" for one in row)
    xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root, encoding="unicode") + "\n"


def exceedance_rates(curve: HazardCurve, amplitude: Any, probability: Any) -> dict[str, Floats]:
    """Integrate a fragility over a hazard curve.

    Parameters
    ----------
    curve : HazardCurve
    amplitude : array
        Peak ground accelerations, m/s², > 0, strictly increasing, two at least.
    probability : array
        Probability of exceedance at each, along the first dimension.  It is interpolated linearly in the logarithm of
        the amplitude between them.

    Returns
    -------
    dict of str to array
        `annual_rate`, `held_rate`, `omitted_rate`, `lower_rate` and `upper_rate` of `displacement_hazard`, of the
        further dimensions of `probability`.

    Raises
    ------
    InputError
        No amplitude lies within the curve.
    """
    from scipy.interpolate import make_interp_spline

    given, shares = np.asarray(amplitude, np.float64), np.asarray(probability, np.float64)
    low, high = max(given[0], curve.amplitude[0]), min(given[-1], curve.amplitude[-1])
    if low >= high:
        raise InputError(
            f"{curve.name}: reaches from {_span(curve.amplitude)}, and the amplitudes of the fragility from "
            f"{_span(given)}: they must overlap"
        )
    points = np.union1d(given, curve.amplitude)
    points = points[(points >= low) & (points <= high)]
    rates = curve.rate_at(points)
    chances = make_interp_spline(np.log(given), shares, k=1)(np.log(points))
    # P is straight in ln a, ν is exp(-k ln a): ∫ P |dν| = P₁ (ν₁ - ν₂) + (P₂ - P₁) ((ν₁ - ν₂) / (k h) - ν₂)
    falls = -np.diff(np.log(rates))
    drops = rates[1:] * np.expm1(falls)
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = np.where(falls > 1e-6, drops / falls - rates[1:], 0.5 * drops)
    inside = np.tensordot(drops, chances[:-1], 1) + np.tensordot(weights, np.diff(chances, axis=0), 1)
    held = chances[-1] * rates[-1]
    below = np.clip(np.searchsorted(given, points[:-1], side="right") - 1, 0, given.size - 2)
    ends = np.stack([shares[below], shares[below + 1]])
    lower, upper = (np.tensordot(drops, extreme(axis=0), 1) + held for extreme in (ends.min, ends.max))
    omitted = chances[0] * (curve.rate[0] - rates[0])
    if curve.amplitude[0] > given[0]:  # how often what lies below the curve occurs is not known
        omitted = np.where(chances[0] > 0.0, np.nan, omitted)
    return {
        "annual_rate": inside + held,
        "held_rate": held,
        "omitted_rate": omitted,
        "lower_rate": lower,
        "upper_rate": upper,
    }


def _span(values: Floats) -> str:
    return f"{values[0]:.6g} to {values[-1]:.6g} m/s2"


def displacement_hazard(
    result: xr.Dataset,
    curve: HazardCurve | str | Path,
    thresholds: Thresholds | None = None,
    *,
    over: str | Sequence[str] | None = None,
) -> xr.Dataset:
    """Mean annual rates of exceeding displacements, from a hazard curve and a fragility along `amplitude`.

    P(u > d | A) is the share of the motions, or of the samples of uncertain inputs, that exceed d; it is straight in
    ln A between the amplitudes of the result.  The hazard curve is straight in logarithms of both between its points.
    The rate is that of Cornell [1]_.

    Parameters
    ----------
    result : Dataset
        A result of `sweep` with the dimensions `motion` and `amplitude`, or of `sample` with `amplitude`: motions of a
        suite that were not pooled are equally likely.
    curve : HazardCurve, str or Path
        Or a CSV file with the columns "PGA (g)" and "annual rate", or of OpenQuake (hazard_curve-mean-PGA) with one
        site.
    thresholds : float, str or list of these, optional
        Increasing displacements, m or with a unit ("50mm"), ≥ 0; by default 0.01, 0.1 and 1 m.  Of a result of
        `sample` they must be among those that it has, which are the default.
    over : str or list of str, optional
        As in `suite_statistics`.

    Returns
    -------
    Dataset
        Over all other dimensions and `threshold` (m), per year:

        - `annual_rate`: NaN where fewer than two amplitudes have a value.
        - `held_rate`: the part of it from above the largest amplitude, or the end of the curve: P is held there.
        - `omitted_rate`: what it leaves out below the smallest amplitude, where P is taken as 0: this much at most.
          NaN where the curve starts above the smallest amplitude, and P is not 0 there.
        - `lower_rate`, `upper_rate`: the rate if P between two amplitudes is the lower, or the higher, of the two.  Far
          from each other, more amplitudes are needed.

        `valueless_share` is the largest share of motions or samples without a value at any amplitude.

    Raises
    ------
    InputError
        As `suite_statistics`; the curve does not overlap with the amplitudes; or only two amplitudes have a value, and
        different probabilities: what lies between them is then not known.
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
    found = fragility(result, thresholds, over)
    amplitude = found["amplitude"].values.astype(np.float64)
    probability = found["exceedance_probability"]
    chances = probability.values
    about = HAZARD_RESULTS | _BOUNDS
    shape = (*chances.shape[:-2], chances.shape[-1])
    rates = {name: np.full(shape, np.nan) for name in about if name != "valueless_share"}
    for index in np.ndindex(chances.shape[:-2]):
        there = np.isfinite(chances[index][:, 0])
        if np.count_nonzero(there) < 2:
            continue
        own = chances[index][there]
        if len(own) == 2 and (own[0] != own[1]).any():
            raise InputError(
                "result: amplitude: only two peak ground accelerations have a value, and P(u > d) differs between "
                "them; how it grows in between is not known: run the sweep with more values on the axis amplitude"
            )
        for name, values in exceedance_rates(curve, amplitude[there], own).items():
            rates[name][index] = values
    if np.isnan(rates["annual_rate"]).all():
        raise RunError("no annual rate: the model gives no value under any motion at two amplitudes or more")
    dims = [dim for dim in probability.dims if dim != "amplitude"]
    results = {name: xr.Variable(dims, values, about[name]) for name, values in rates.items()}
    valueless = found["valueless_share"].max("amplitude").variable
    valueless.attrs = about["valueless_share"]
    coords = {name: one.variable for name, one in found.coords.items() if "amplitude" not in (*one.dims, name)}
    attrs = {
        **{name: value for name, value in found.attrs.items() if name != "zero_displacement"},
        "title": TITLE,
        "hazard_curve": curve.name,
        **curve.attrs,
        "hazard_curve_range": curve.amplitude[[0, -1]],
        "amplitude_range": amplitude[[0, -1]],
    }
    return xr.Dataset({**results, "valueless_share": valueless}, coords, attrs)
