"""What is asked of a result under a suite of motions, from and to datasets."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown
from slipsweep.studies.datasets import _dataset
from slipsweep.studies.hazard import HazardCurve, hazard_table, read_hazard_curve
from slipsweep.studies.suite_statistics import suite_table


def suite_statistics(
    result: xr.Dataset,
    *,
    thresholds: float | str | Sequence[float | str] | np.ndarray = (0.01, 0.1, 1.0),
    quantiles: float | Sequence[float] | np.ndarray = (0.16, 0.5, 0.84),
    zero: float | str = 0.0,
    over: str | Sequence[str] | None = None,
) -> xr.Dataset:
    """Statistics of the permanent displacement over the motions of a suite.

    Parameters
    ----------
    result : Dataset
        A result of `sweep` with the dimension `motion`, or a file of one opened with xarray.
    thresholds : float, str or list of these
        Increasing displacements, m or with a unit ("50mm"), ≥ 0.
    quantiles : float or array
        Increasing, between 0 and 1.
    zero : float or str
        Largest displacement, m or with a unit, that counts as zero.
    over : str or list of str, optional
        Dimensions that make up the suite: `motion`, and by default `polarity` where it is one.

    Returns
    -------
    Dataset
        Over all other dimensions:

        - `value_count`, `valueless_count`: motions with a value, and without; `valueless_share` of all.
        - `valueless_flag_count`, dimension `flag`: motions without a value, by reason.  One may have several.
        - `zero_probability`: share of displacements of `zero` at most.
        - `nonzero_median`, `nonzero_geometric_mean` (m) and `log_standard_deviation` (of natural logarithms, with
          n - 1) of the others.
        - `displacement_quantile` (m), dimension `quantile`, and `exceedance_probability`, dimension `threshold` (m):
          of all displacements, those that are zero, too.

        All but the counts and `valueless_share` are of the motions that have a value, NaN where none has.

    Raises
    ------
    InputError
        The result has no dimension `motion`, lacks `permanent_displacement` or `validity`, or a value is not allowed.

    See Also
    --------
    displacement_hazard : with the seismic hazard of a site
    sample : statistics under uncertain inputs

    Notes
    -----
    A share of zero displacements beside the distribution of the others follows Bray and Travasarou [1]_.

    References
    ----------
    .. [1] J. D. Bray and T. Travasarou (2007), "Simplified procedure for estimating earthquake-induced deviatoric slope
       displacements", Journal of Geotechnical and Geoenvironmental Engineering 133, 381-392,
       https://doi.org/10.1061/(ASCE)1090-0241(2007)133:4(381)

    Examples
    --------
    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/*_H1.AT2")
    >>> result = slipsweep.sweep(5, 0.3, amplitude=[2.0, 4.0, 6.0], excitation=suite)
    >>> found = slipsweep.suite_statistics(result, thresholds="50mm")
    >>> found.exceedance_probability.sel(threshold=0.05).values
    array([0.  , 0.25, 0.75])
    """
    table = suite_table(_table(result), thresholds=thresholds, quantiles=quantiles, zero=zero, over=over)
    return _dataset(table, {})


def displacement_hazard(
    result: xr.Dataset,
    curve: HazardCurve | str | Path,
    thresholds: float | str | Sequence[float | str] | np.ndarray = (0.01, 0.1, 1.0),
    *,
    over: str | Sequence[str] | None = None,
) -> xr.Dataset:
    """Mean annual rates of exceeding displacements, from a hazard curve and a suite's fragility along `amplitude`.

    P(u > d | A) is the share of the motions with a value that exceed d, straight in ln A between the amplitudes of the
    result.  The hazard curve is straight in logarithms of both between its points.  The rate is that of Cornell [1]_.

    Parameters
    ----------
    result : Dataset
        A result of `sweep` with the dimensions `motion` and `amplitude`.
    curve : HazardCurve, str or Path
        Or a CSV file with the columns "PGA (g)" and "annual rate".
    thresholds : float, str or list of these
        Increasing displacements, m or with a unit ("50mm"), ≥ 0.
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

        `valueless_share` is the largest share of motions without a value at any amplitude.

    Raises
    ------
    InputError
        As `suite_statistics`; the result has fewer than two amplitudes, or the curve does not overlap with them.
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
    table = _table(result)
    if not isinstance(curve, HazardCurve):
        curve = read_hazard_curve(curve, float(table.attrs.get("g", np.nan)))
    return _dataset(hazard_table(table, curve, thresholds=thresholds, over=over), {})


def _table(result: Any) -> xr.Dataset:
    """What is needed of a dataset, computed."""
    if not isinstance(result, xr.Dataset):
        raise InputError(f"result = {shown(result)}: must be a Dataset")
    names = [name for name in ("permanent_displacement", "validity") if name in result.data_vars]

    def plain(one: xr.DataArray) -> xr.Variable:
        return xr.Variable(tuple(map(str, one.dims)), one.values, {str(key): x for key, x in one.attrs.items()})

    dims = {dim for name in names for dim in result[name].dims}
    coords = {str(name): plain(one) for name, one in result.coords.items() if dims.issuperset(one.dims)}
    attrs = {str(name): value for name, value in result.attrs.items()}
    return xr.Dataset(coords, {name: plain(result[name]) for name in names}, attrs)
