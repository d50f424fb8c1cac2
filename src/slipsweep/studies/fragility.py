"""Fragility: the probability that a displacement is exceeded, given the peak ground acceleration."""

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.parameters import number_text
from slipsweep.studies.sampling import check_thresholds
from slipsweep.studies.suite_statistics import point_names, suite_dims, suite_statistics

#: Displacements of a suite's fragility where none are given, m.
_THRESHOLDS = (0.01, 0.1, 1.0)


def fragility(result: xr.Dataset, thresholds: Any = None, over: Any = None) -> xr.Dataset:
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
        stored = found["threshold"].values
        wanted = check_thresholds("thresholds", thresholds, float(result.attrs.get("g", np.nan)))
        places = [int(np.argmin(np.abs(stored - one))) for one in wanted]
        for one, place in zip(wanted, places, strict=True):
            if not np.isclose(stored[place], one, rtol=1e-6):
                there = ", ".join(f"{d:.6g}" for d in stored)
                raise InputError(
                    f"thresholds = {number_text(float(one))}: not among those of the result, {there} m: "
                    "add it to the thresholds of [uncertainty], and run again"
                )
        found = found.isel(threshold=places)
    dims = suite_dims(found["exceedance_probability"], over) if "motion" in found.dims else ()
    pooled = " ".join(dims) or str(result.attrs.get("pooled", "")) or "samples"
    return found.mean(dims, keep_attrs=True).assign_attrs(suite_dimensions=pooled)


def openquake_fragility(found: xr.Dataset, about: Mapping[str, str] | None = None) -> str:
    """A fragility as an XML file of OpenQuake (NRML 0.5): a discrete function for each grid point.

    Parameters
    ----------
    found : Dataset
        What `fragility` returns.  Limit states are its thresholds.
    about : mapping of str to str, optional
        Attributes of the model: `id`, `assetCategory`, `lossCategory`.

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
    own = {"id": "slipsweep", "assetCategory": "slopes", "lossCategory": "structural", **(about or {})}
    model = xml.SubElement(root, "fragilityModel", own)
    xml.SubElement(model, "description").text = f"{found.attrs.get('title', '')} ({found.attrs.get('source', '')})"
    xml.SubElement(model, "limitStates").text = " ".join(states)
    curves = probability.values.reshape(-1, len(states), levels.size)
    for name, rows in zip(point_names(found, grid), curves, strict=True):
        function = xml.SubElement(model, "fragilityFunction", id=_identifier(name), format="discrete")
        imls = xml.SubElement(function, "imls", imt="PGA", noDamageLimit=f"{levels[0]:.6g}")
        imls.text = " ".join(f"{one:.6g}" for one in levels)
        for state, row in zip(states, rows, strict=True):
            xml.SubElement(function, "poes", ls=state).text = " ".join(f"{one:.6g}" for one in row)
    xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root, encoding="unicode") + "\n"


def _identifier(name: str) -> str:
    """The name of a grid point as a taxonomy string."""
    return "_".join(name.replace("=", " ").replace(",", " ").split()) or "block"
