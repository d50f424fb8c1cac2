"""Statistics of the displacement over the motions of a suite, at every other grid point."""

import itertools
import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.grid.resources import grid_text
from slipsweep.model.parameters import check_list, number_text, shown
from slipsweep.model.units import in_mm
from slipsweep.model.variables import (
    STATISTIC_COORDINATES,
    SUITE_STATISTICS,
    VALUELESS,
    LimitStatus,
    Validity,
    counted,
    counted_text,
    has_signed_displacements,
)
from slipsweep.studies.sampling import Thresholds, check_increasing, check_thresholds

TITLE = "Statistics of the permanent displacement over a suite of motions"

#: Dimensions of a result that make up a suite.
SUITE = ("motion", "polarity")

#: Flags under which a motion has no value.
REASONS = tuple(flag for flag in Validity if flag in VALUELESS)

#: The median, and one standard deviation of a normal distribution on either side of it.
QUANTILES = (0.16, 0.5, 0.84)

#: Displacements to exceed where none are given, m.
THRESHOLDS = (0.01, 0.1, 1.0)


def suite_statistics(
    result: xr.Dataset,
    *,
    thresholds: Thresholds = THRESHOLDS,
    quantiles: float | Sequence[float] | np.ndarray = QUANTILES,
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

        - `value_count`, `valueless_count`: motions with a value, and without; `valueless_share` of
          all.
        - `valueless_flag_count`, dimension `flag`: motions without a value, by reason.  One may
          have several.
        - `zero_probability`: share of displacements of `zero` at most.
        - `nonzero_median`, `nonzero_geometric_mean` (m) and `log_standard_deviation` (of natural
          logarithms, with n - 1) of the others, which are described apart as by Bray and
          Travasarou [1]_.
        - `displacement_quantile` (m), dimension `quantile`, and `exceedance_probability`, dimension
          `threshold` (m): of all displacements, those that are zero, too.

        All but the counts and `valueless_share` are of the motions that have a value, NaN where
        none has.  Of a block that slides both ways they are of ``|u|``.

    Raises
    ------
    InputError
        The result has no dimension `motion`, lacks `permanent_displacement` or `validity`, or a
        value is not allowed.

    See Also
    --------
    displacement_hazard : with the seismic hazard of a site
    sample : statistics under uncertain inputs

    References
    ----------
    .. [1] J. D. Bray and T. Travasarou (2007), "Simplified procedure for estimating
       earthquake-induced deviatoric slope displacements", Journal of Geotechnical and
       Geoenvironmental Engineering 133, 381-392,
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
    if not isinstance(result, xr.Dataset):
        raise InputError(f"result = {shown(result)}: must be a Dataset")
    for name in ("permanent_displacement", "validity"):
        if name not in result.data_vars:
            raise InputError(f"result: {name}: missing: must be there, of all motions")
    dims = suite_dims(result["permanent_displacement"], over)
    g = float(result.attrs.get("g", np.nan))
    limits = check_thresholds("thresholds", thresholds, g)
    shares = check_increasing("quantiles", quantiles, "quantile")
    least, *others = check_thresholds("zero", zero, g)
    if others:
        raise InputError(f"zero = {shown(zero)}: must be one displacement")

    moved = without_rounding(result["permanent_displacement"].astype(np.float64).load())
    if has_signed_displacements(result.attrs):
        moved = abs(moved)
    # a reader may have turned codes into floating-point numbers with NaN
    codes = result["validity"].fillna(0).astype(np.int16).load()
    there = moved.notnull()
    total = int(np.prod([moved.sizes[dim] for dim in dims]))
    places = {"flag": np.array(REASONS, np.int16), "threshold": limits, "quantile": shares}
    statistic_coords = {
        dim: xr.Variable(dim, values, STATISTIC_COORDINATES[dim]) for dim, values in places.items()
    }
    meanings = " ".join((flag.name or "").lower() for flag in REASONS)
    statistic_coords["flag"].attrs |= {
        "flag_values": [*map(int, REASONS)],
        "flag_meanings": meanings,
    }
    count = there.sum(dims)
    slid = moved.where(moved > least)
    logs: xr.DataArray = np.log(slid)  # type: ignore[assignment]
    is_flagged = ~there & (codes & statistic_coords["flag"] != 0)
    statistics = {
        "value_count": count.astype(np.int32),
        "valueless_count": (total - count).astype(np.int32),
        "valueless_flag_count": is_flagged.sum(dims).astype(np.int32),
        "valueless_share": (total - count) / total,
        "zero_probability": (moved <= least).where(there).mean(dims),
        "nonzero_median": slid.median(dims),
        "nonzero_geometric_mean": np.exp(logs.mean(dims)),
        "log_standard_deviation": logs.std(dims, ddof=1).where(slid.count(dims) > 1),
        "displacement_quantile": _quantiles(moved, shares, dims),
        "exceedance_probability": (moved > statistic_coords["threshold"]).where(there).mean(dims),
    }
    attrs = {
        **result.attrs,
        "title": counted_text(TITLE, result.attrs),
        "suite_dimensions": " ".join(dims),
        "zero_displacement": float(least),
    }
    grid = [dim for dim in moved.dims if dim not in dims]
    laid = {name: variable.transpose(*grid, ...) for name, variable in statistics.items()}
    variables = {
        name: (variable.dims, variable.values, counted(SUITE_STATISTICS[name], result.attrs))
        for name, variable in laid.items()
    }
    coords = {
        name: coordinate.variable
        for name, coordinate in result.coords.items()
        if not {*dims, *statistic_coords} & {*coordinate.dims, name}
    }
    return xr.Dataset(variables, coords | statistic_coords, attrs)


def without_rounding(displacements: xr.DataArray) -> xr.DataArray:
    """Return displacements, m, with those below 1e-12 m as zero: a block at yield moves 1e-48."""
    return displacements.where(~(abs(displacements) < 1e-12), 0.0)


def _quantiles(values: xr.DataArray, quantiles: np.ndarray, dims: Sequence[str]) -> xr.DataArray:
    """Return quantiles of the values that are not NaN, linear between them.

    The dimension `quantile` has no coordinate.
    """
    there = values.notnull().any(dims)
    full = values.where(there, 0.0)  # without any value there is no quantile
    # to leave out NaN takes ten times as long
    interpolated = full.quantile(quantiles, dims, skipna=bool(full.isnull().any()))
    return interpolated.where(there).drop_vars("quantile").transpose(..., "quantile")


def suite_dims(values: xr.DataArray, over: Any = None) -> tuple[str, ...]:
    """Return the dimensions that make up the suite: those in `over`, or `SUITE`.

    InputError: `motion` is not among them.
    """
    there = tuple(map(str, values.dims))
    if "motion" not in there:
        raise InputError(
            f"result: dimensions {', '.join(there) or 'none'}: must have motion, or be of "
            "[uncertainty]"
        )
    if over is None:
        return tuple(dim for dim in SUITE if dim in there)
    dims: Sequence[Any] = (
        [over] if isinstance(over, str) else check_list("over", over, "dimensions")
    )
    for dim in dims:
        if dim not in there:
            raise InputError(
                f"over = {shown(dim)}: must be a dimension of the result: {', '.join(there)}"
            )
    if "motion" not in dims:
        raise InputError(f"over = {shown(over)}: must have motion among them")
    return tuple(dict.fromkeys(dims))


def limit_quantiles(limits: xr.Dataset) -> xr.Dataset:
    """Return `QUANTILES` of the limit amplitudes of a suite's motions, at every other grid point.

    `limits` is a result of `limit_amplitude`.  A motion that does not reach the displacement has a
    limit above all others and is counted in `not_reached_count`: a `limit_quantile` (m/s²) is
    infinite where too many do not.  Motions without a value are left out.
    """
    dims = suite_dims(limits["limit_amplitude"])
    beyond = limits["limit_status"] == LimitStatus.NOT_REACHED
    # so large that a value interpolated towards it is above all limits
    values = limits["limit_amplitude"].where(~beyond, np.finfo(np.float64).max / 4.0)
    quantiles = _quantiles(values, np.array(QUANTILES), dims)
    quantile = quantiles.where(~(quantiles > values.where(~beyond).max()), np.inf).assign_attrs(
        units="m s-2"
    )
    counts = {"value_count": values.count(dims), "not_reached_count": beyond.sum(dims)}
    return xr.Dataset(
        {"limit_quantile": quantile, **counts}, {"quantile": [*QUANTILES]}, limits.attrs
    )


def summary_lines(result: xr.Dataset, displacement: Any = None, most: int = 100) -> list[str]:
    """Return a line for each grid point: median, 16 and 84 %, share of zeros, P(u > d).

    `result` is one of `sweep` with the dimension `motion`, or of `sample`.  Lines of `sample` have
    no share of zeros, and d must be among its thresholds.  For more grid points than `most` there
    is one line, which says how to cut the grid.
    """
    import pandas as pd

    is_sampled = "displacement_quantile" in result
    moved = result["displacement_quantile" if is_sampled else "permanent_displacement"]
    dims = ("quantile",) if is_sampled else suite_dims(moved)
    grid = {dim: size for dim, size in moved.sizes.items() if dim not in dims}
    points = math.prod(grid.values())
    pooled = result.attrs.get("pooled", "")
    drawn = f"{pooled} x {result.attrs.get('samples', '')} samples".removeprefix(" x ")
    suite = drawn if is_sampled else grid_text({dim: moved.sizes[dim] for dim in dims})
    if points > most:
        how = "slipsweep info OUT.nc --at NAME=VALUE -d 50mm"
        return [f"statistics over {suite} at {points} grid points: {how} prints those of some"]
    if is_sampled:
        missing = result["valueless_share"].broadcast_like(moved.isel(quantile=0, drop=True))
        statistics = result[["displacement_quantile", "exceedance_probability"]].assign(
            valueless_share=missing
        )
        statistics = at_thresholds(statistics, displacement).transpose(*grid, ...).load()
    else:
        statistics = suite_statistics(
            result, thresholds=0.0 if displacement is None else displacement
        )
    columns = _labels_of_points(statistics, grid)
    columns |= _values_of_points(statistics, points, with_chances=displacement is not None)
    is_signed = has_signed_displacements(result.attrs)
    name = "magnitude of the permanent displacement" if is_signed else "permanent displacement"
    table = pd.DataFrame(columns).to_string(index=False)
    return [f"{name} (mm) over {suite}:", *table.splitlines()]


def _labels_of_points(
    statistics: xr.Dataset, grid: Mapping[Hashable, int]
) -> dict[str, Sequence[str]]:
    """Return columns with the places of grid points, for each dimension that varies."""
    varying = [dim for dim, size in grid.items() if size > 1]
    # peak ground accelerations in g
    factors = {"amplitude": 1.0 / float(statistics.attrs.get("g", np.nan))}
    labels = itertools.product(
        *(labels_along(statistics, dim, factors.get(str(dim), 1.0)) for dim in varying)
    )
    titles = {"amplitude": "PGA (g)", "yield_coefficient": "ky"}
    columns: dict[str, Sequence[str]] = {}
    for dim, texts in zip(varying, zip(*labels, strict=True), strict=True):
        units = statistics[dim].attrs.get("units", "1") if dim in statistics.variables else "1"
        title = str(dim) if units == "1" else f"{dim} ({units})"
        columns[titles.get(str(dim), title)] = texts
    return columns


def _values_of_points(
    statistics: xr.Dataset, points: int, with_chances: bool
) -> dict[str, Sequence[str]]:
    """Return columns with the statistics of grid points, as texts.

    Statistics of `sample` have P(u > d) always, those of a suite if `with_chances`.
    """
    rows = {
        name: values.values.reshape(points, -1).T for name, values in statistics.data_vars.items()
    }
    columns: dict[str, Sequence[str]] = {}
    shares = statistics["quantile"].values
    for share, quantile in zip(shares, rows["displacement_quantile"], strict=True):
        title = "median" if share == 0.5 else f"{100.0 * share:.3g} %"
        columns[title] = _texts(in_mm(quantile), ".3g")
    is_sampled = "zero_probability" not in rows
    if not is_sampled:
        columns["zero"] = _texts(rows["zero_probability"][0], ".1%")
    if with_chances or is_sampled:
        symbol = "|u|" if has_signed_displacements(statistics.attrs) else "u"
        limits = statistics["threshold"].values
        for limit, chance in zip(limits, rows["exceedance_probability"], strict=True):
            columns[f"P({symbol} > {in_mm(limit):.6g} mm)"] = _texts(chance, ".1%")
    if (rows["valueless_share"] > 0.0).any():
        columns["no value"] = _texts(rows["valueless_share"][0], ".1%")
    return columns


def _texts(values: np.ndarray, as_text: str) -> list[str]:
    """Return numbers as texts, "none" for NaN."""
    return ["none" if np.isnan(value) else format(value, as_text) for value in values]


def at_thresholds(statistics: xr.Dataset, thresholds: Thresholds | None) -> xr.Dataset:
    """Return statistics of `sample` at some of its thresholds (InputError: not among them)."""
    if thresholds is None:
        return statistics
    limits = check_thresholds("thresholds", thresholds, float(statistics.attrs.get("g", np.nan)))
    nearest = statistics.sel(threshold=limits, method="nearest")
    for limit in limits[~np.isclose(nearest["threshold"], limits, rtol=1e-6)][:1]:
        stored = ", ".join(f"{d:.6g}" for d in statistics["threshold"].values)
        raise InputError(
            f"thresholds = {number_text(float(limit))}: not among those of the result, {stored} m: "
            "add it to the thresholds of [uncertainty], and run again"
        )
    return nearest


def labels_along(data: xr.Dataset, dim: Hashable, factor: float = 1.0) -> list[str]:
    """Return the names of places along a dimension: labels, numbers times a factor, or 1, 2, …"""
    name = next(
        (key for key in (dim, "label") if key in data.variables and data[key].dims == (dim,)), None
    )
    values = np.arange(1, data.sizes[dim] + 1) if name is None else data[name].values
    return [
        str(label) if values.dtype.kind not in "iuf" else f"{label * factor:.4g}"
        for label in values
    ]


def point_names(
    data: xr.Dataset, sizes: Mapping[Any, int], factors: Mapping[Any, float] | None = None
) -> list[str]:
    """Return the names of grid points: ``theta = 5, mu_s = 0.3``; numbers are times `factors`."""
    along = (
        [f"{dim} = {label}" for label in labels_along(data, dim, (factors or {}).get(dim, 1.0))]
        for dim in sizes
    )
    return [", ".join(parts) for parts in itertools.product(*along)]
