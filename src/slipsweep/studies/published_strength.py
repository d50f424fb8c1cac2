"""Published equations solved for ky, beside the strengths that a suite requires."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.parameters import shown
from slipsweep.model.variables import (
    PUBLISHED_RESULTS,
    REQUIRED_RESULTS,
    STATISTIC_COORDINATES,
)
from slipsweep.published import EQUATIONS, Estimate, check_equations
from slipsweep.studies.published_statistics import (
    axis_labels_of,
    axis_title,
    conditions_texts,
    estimates,
    peak_acceleration_in_g,
)
from slipsweep.studies.sampling import check_increasing
from slipsweep.studies.suite_statistics import QUANTILES, SUITE

if TYPE_CHECKING:
    import pandas as pd

TITLE = "Yield coefficient that published equations require for a tolerable displacement"

#: ky/PGA of the scan, in equal steps of ln(r/(1 − r)); times that the step with the crossing is cut
#: into as many parts.
_RATIOS = 1.0 / (1.0 + np.exp(-np.linspace(-9.0, 14.0, 512)))
_NARROWINGS = 6

_RESULT = "required_yield_coefficient_quantile"


def published_strength(
    strengths: xr.Dataset,
    equations: str | Sequence[str],
    *,
    magnitude: float | None = None,
    quantiles: float | Sequence[float] | np.ndarray = QUANTILES,
) -> xr.Dataset:
    """Yield coefficients that published equations require, at the points of required strengths.

    The equations are solved for ky: at it their quantile of the displacement is the tolerable one.
    What they were fitted to is not this block: the attribute ``conditions`` names it.

    Parameters
    ----------
    strengths : Dataset
        A result of `required_strength`, of the yield coefficient.
    equations : str or list of str
        Names, such as "jibson-2007", of `slipsweep.published.EQUATIONS`; a text may have several,
        with commas.
    magnitude : float, optional
        Moment magnitude M, for the equations that need it.
    quantiles : float or array
        Increasing, between 0 and 1: shares of the cases that stay within.

    Returns
    -------
    Dataset
        Over `equation`, the dimensions of the grid that the equations depend on, and `quantile`:
        `required_yield_coefficient_quantile`, 0 where every ky is enough, and `in_range`, 1 where
        the inputs lie in the range of the equation, else 0.

    Raises
    ------
    InputError
        There is no such equation, or the result lacks an input of it.

    See Also
    --------
    required_strength : the same of one's own motions
    published_statistics : displacements by the equations

    Examples
    --------
    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/*_H1.AT2")
    >>> design = slipsweep.required_strength("50mm", amplitude=3.924, excitation=suite)
    >>> beside = slipsweep.published_strength(design, "jibson-2007", quantiles=[0.5, 0.84])
    >>> beside.required_yield_coefficient_quantile.values.round(3)
    array([[0.109, 0.169]])
    """
    if not isinstance(strengths, xr.Dataset):
        raise InputError(f"strengths = {shown(strengths)}: must be a Dataset")
    if strengths.attrs.get("required") != "yield_coefficient":
        raise InputError("equations: only beside required strengths of = 'yield_coefficient'")
    names = check_equations(equations)
    shares = check_increasing("quantiles", quantiles, "quantile")
    parts = []
    for name in names:
        by_share = [strength_by(strengths, name, magnitude, float(share)) for share in shares]
        dataset = xr.Dataset(
            {
                _RESULT: xr.concat([strength for strength, _ in by_share], "quantile"),
                "in_range": xr.concat([inside for _, inside in by_share], "quantile"),
            }
        )
        parts.append(dataset)
    grid = [dim for dim in strengths.dims if any(dim in part.dims for part in parts)]
    grid = [dim for dim in grid if dim != "quantile"]
    table = xr.concat(xr.broadcast(*parts), "equation").transpose("equation", *grid, "quantile")
    table["in_range"] = table["in_range"].astype(np.int8)
    table["in_range"].attrs = PUBLISHED_RESULTS["in_range"]
    table[_RESULT].attrs = {
        name: text
        for name, text in REQUIRED_RESULTS[_RESULT].items()
        if name != "ancillary_variables"
    }
    coords = {
        name: coordinate.variable
        for name, coordinate in strengths.coords.items()
        if {*coordinate.dims} <= {*grid} and name not in SUITE
    }
    statistic_coords = {
        "equation": list(names),
        "quantile": xr.Variable("quantile", shares, STATISTIC_COORDINATES["quantile"]),
    }
    attrs = {**strengths.attrs, "title": TITLE, "conditions": "\n".join(conditions_texts(names))}
    if magnitude is not None:
        attrs["magnitude"] = float(magnitude)
    return table.assign_coords(coords | statistic_coords).assign_attrs(attrs)


def strength_by(
    strengths: xr.Dataset, name: str, magnitude: float | None, share: float
) -> tuple[xr.DataArray, xr.DataArray]:
    """Return ky at which an equation's quantile is the displacement, and if it is in range.

    If there are several such ky, it is the largest: above it the quantile stays within.
    """
    pga = peak_acceleration_in_g(strengths)
    if pga is None:
        raise InputError(f"{name}: needs the peak ground acceleration: the result does not have it")
    bare = strengths.drop_vars([*strengths.data_vars])
    target = strengths["displacement"].drop_vars([*strengths["displacement"].coords])

    def estimate(ratio: xr.DataArray) -> Estimate:
        coefficient = ratio * pga
        return estimates(bare.assign_coords(yield_coefficient=coefficient), [name], magnitude)[name]

    def exceeds(ratio: xr.DataArray) -> xr.DataArray:
        by_equation = estimate(ratio)
        dims = by_equation.median.dims
        return xr.DataArray(by_equation.quantile(share), dims=dims) > target

    def step(ratios: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
        """Return the last ratio that exceeds the displacement, the next, and if there is one."""
        above = exceeds(ratios)
        last = ratios.sizes["scan"] - 1 - above.isel(scan=slice(None, None, -1)).argmax("scan")
        following = np.minimum(last + 1, ratios.sizes["scan"] - 1)
        return ratios.isel(scan=last), ratios.isel(scan=following), above.any("scan")

    parts = xr.DataArray(np.linspace(0.0, 1.0, _RATIOS.size), dims="scan")
    low, high, crosses = step(xr.DataArray(_RATIOS, dims="scan"))
    for _ in range(_NARROWINGS):
        low, high, _any = step(low + (high - low) * parts)
    ratio = high.where(crosses, 0.0)
    inside = estimate(ratio.where(ratio > 0.0, _RATIOS[0])).in_range
    return ratio * pga, inside & (ratio > 0.0)


def strength_table(
    strengths: xr.Dataset, equations: Sequence[str], magnitude: float | None = None
) -> "pd.DataFrame":
    """Return required ky in rows: of the suite and of each equation, at each grid point.

    Columns: the axes, ``ky by``, the quantiles, and ``range``, which is "outside" where an
    equation is extrapolated.
    """
    import pandas as pd

    shares = strengths["quantile"].values if _RESULT in strengths else QUANTILES
    by_equations = published_strength(strengths, equations, magnitude=magnitude, quantiles=shares)
    sources = {EQUATIONS[name].label: by_equations.sel(equation=name) for name in equations}
    if _RESULT in strengths:
        values = strengths[[_RESULT]]
        of_suite = values.assign(in_range=xr.ones_like(values[_RESULT]))
        sources = {"these motions": of_suite} | sources
    columns = []
    for source in sources.values():
        named: dict[str, Any] = {}
        for share in shares:
            title = "median" if share == 0.5 else f"{100.0 * share:.3g} %"
            named[title] = source[_RESULT].sel(quantile=share, drop=True)
        named["range"] = source["in_range"].min("quantile")
        columns.append(xr.Dataset(named).reset_coords(drop=True))
    whole = xr.concat(columns, pd.Index([*sources], name="ky by"))
    axes = [str(dim) for dim in strengths.dims if whole.sizes.get(dim, 1) > 1]
    single = [dim for dim in whole.dims if dim not in (*axes, "ky by")]
    labels: dict[str, Any] = {dim: axis_labels_of(strengths, dim) for dim in axes}
    laid = whole.squeeze(single, drop=True).assign_coords(labels)
    table = laid.to_dataframe([*axes, "ky by"]).reset_index()
    table["range"] = np.where(table["range"] == 0, "outside", "")
    return table.rename(columns={dim: axis_title(strengths, dim) for dim in axes})


def strength_lines(
    strengths: xr.Dataset, equations: Sequence[str], magnitude: float | None = None
) -> list[str]:
    """Return the table of `strength_table` in lines, and the conditions of the equations."""
    table = strength_table(strengths, equations, magnitude)
    outside = ["outside: an input lies outside of the range of the equation"]
    if not table["range"].any():
        table = table.drop(columns="range")
        outside = []
    lines = table.to_string(index=False, float_format="{:.4g}".format).splitlines()
    return [
        "required ky, published equations beside:",
        *(line.rstrip() for line in lines),
        *outside,
        *conditions_texts(equations),
    ]
