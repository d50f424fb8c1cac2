"""Mean annual rate of exceeding a displacement: the hazard of peak ground acceleration times a fragility.

λ(d) = ∫ P(u > d | a) |dν(a)|, where ν(a) is the mean annual rate of peak ground accelerations above a (Cornell 1968).
ln ν is straight in ln a between the points of the hazard curve, P in ln a between the amplitudes of the grid; the
integral over these lines is exact.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, RunError
from slipsweep.model.parameters import check_numbers, shown
from slipsweep.model.variables import HAZARD_RESULTS
from slipsweep.studies.fragility import fragility
from slipsweep.studies.hazard_curves import HazardCurve, read_hazard_curve

Floats = NDArray[np.float64]

TITLE = "Mean annual rate of exceeding a permanent displacement"

#: What is known of a rate if P is only known to lie between its values at neighbouring amplitudes.
_BOUNDS = {
    "lower_rate": {"units": "year-1", "long_name": "annual rate with the lower probability of each two amplitudes"},
    "upper_rate": {"units": "year-1", "long_name": "annual rate with the higher probability of each two amplitudes"},
}

#: Results, and the fields of `Rates` that they are.
_RESULTS = {
    "annual_rate": "rate",
    "held_rate": "held",
    "omitted_rate": "omitted",
    "lower_rate": "lower",
    "upper_rate": "upper",
}


class Rates(NamedTuple):
    """A mean annual rate of exceedance, and what is not known of it, 1/year.

    Attributes
    ----------
    rate : ndarray
    held : ndarray
        Part of the rate above the largest amplitude (or the end of the curve), where the probability is held.
    omitted : ndarray
        What is not in the rate: at most this much below the smallest amplitude, down to the start of the curve, if the
        probability there is not above that at the smallest amplitude.  NaN where the curve starts above the smallest
        amplitude, at a probability above 0: the rate of what lies below the curve is not known.
    lower, upper : ndarray
        The rate if the probability between two amplitudes is the lower, or the higher, of the two.
    """

    rate: Floats
    held: Floats
    omitted: Floats
    lower: Floats
    upper: Floats


def exceedance_rates(curve: HazardCurve, amplitude: Any, probability: Any) -> Rates:
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
    Rates
        Of the further dimensions of `probability`.

    Raises
    ------
    InputError
        The amplitudes are not such, or none of them lies within the curve.
    """
    from scipy.interpolate import make_interp_spline

    given = check_numbers("amplitude", amplitude)
    if given.ndim != 1 or given.size < 2 or not (given[0] > 0.0 and (np.diff(given) > 0.0).all()):
        raise InputError(f"amplitude = {shown(amplitude)}: must be two numbers or more, > 0 and increasing")
    shares = check_numbers("probability", probability)
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
    return Rates(*map(np.asarray, (inside + held, held, omitted, lower, upper)))


def _span(values: Floats) -> str:
    return f"{values[0]:.6g} to {values[-1]:.6g} m/s2"


def displacement_hazard(
    result: xr.Dataset,
    curve: HazardCurve | str | Path,
    thresholds: float | str | Sequence[float | str] | np.ndarray | None = None,
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
    shape = (*chances.shape[:-2], chances.shape[-1])
    rates = {name: np.full(shape, np.nan) for name in Rates._fields}
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
        for name, values in exceedance_rates(curve, amplitude[there], own)._asdict().items():
            rates[name][index] = values
    if np.isnan(rates["rate"]).all():
        raise RunError("no annual rate: the model gives no value under any motion at two amplitudes or more")
    dims = [dim for dim in probability.dims if dim != "amplitude"]
    about = HAZARD_RESULTS | _BOUNDS
    results = {name: xr.Variable(dims, rates[own], about[name]) for name, own in _RESULTS.items()}
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
