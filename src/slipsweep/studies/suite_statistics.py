"""Statistics of the displacement over the motions of a suite, at every other grid point."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.parameters import check_list, shown
from slipsweep.model.variables import STATISTIC_COORDINATES, SUITE_STATISTICS, VALUELESS, LimitStatus, Validity
from slipsweep.studies.sampling import check_quantiles, check_thresholds

Floats = NDArray[np.float64]

TITLE = "Statistics of the permanent displacement over a suite of motions"

#: What makes up a suite, of the dimensions that a result has.
_SUITE = ("motion", "polarity")

#: Flags under which a motion has no value.
REASONS = tuple(flag for flag in Validity if flag in VALUELESS)


def suite_table(table: xr.Dataset, *, thresholds: Any, quantiles: Any, zero: Any, over: Any) -> xr.Dataset:
    """What `slipsweep.suite_statistics` returns, of a table that holds `permanent_displacement` and `validity`."""
    for name in ("permanent_displacement", "validity"):
        if name not in table.data_vars:
            raise InputError(f"result: {name}: missing: must be there, of all motions")
    displacement = table["permanent_displacement"]
    g = float(table.attrs.get("g", np.nan))
    dims = _suite_dims(displacement, over)
    grid = {dim: size for dim, size in displacement.sizes.items() if dim not in dims}
    order = (*grid, *dims)
    shape = (*grid.values(), -1)
    values = displacement.values.transpose([displacement.dims.index(dim) for dim in order]).reshape(shape)
    codes = np.broadcast_to(_spread(table["validity"], order), [displacement.sizes[dim] for dim in order]).reshape(
        shape
    )
    limits, wanted = check_thresholds("thresholds", thresholds, g), check_quantiles("quantiles", quantiles)
    least = check_thresholds("zero", zero, g)
    if least.size > 1:
        raise InputError(f"zero = {shown(zero)}: must be one displacement")
    found = _statistics(np.asarray(values, np.float64), codes, limits, wanted, float(least[0]))
    own = {
        "displacement_quantile": "quantile",
        "exceedance_probability": "threshold",
        "valueless_flag_count": "flag",
    }
    names = " ".join((flag.name or "").lower() for flag in REASONS)
    bits = np.array([int(flag) for flag in REASONS], np.int16)
    flag = {**STATISTIC_COORDINATES["flag"], "flag_values": bits.tolist(), "flag_meanings": names}
    coords = {
        **{name: one for name, one in table.coords.items() if not {*dims, *own.values()} & {*one.dims, name}},
        "quantile": xr.Variable(("quantile",), wanted, STATISTIC_COORDINATES["quantile"]),
        "threshold": xr.Variable(("threshold",), limits, STATISTIC_COORDINATES["threshold"]),
        "flag": xr.Variable(("flag",), bits, flag),
    }
    results = {
        name: xr.Variable((*grid, *([own[name]] if name in own else [])), found[name], about)
        for name, about in SUITE_STATISTICS.items()
    }
    attrs = {**table.attrs, "title": TITLE, "suite_dimensions": " ".join(dims), "zero_displacement": float(least[0])}
    return xr.Dataset(results, coords, attrs)


def limit_quantiles(table: xr.Dataset, quantiles: Any) -> xr.Dataset:
    """Quantiles of the limit amplitudes of a suite's motions, at every other grid point.

    A motion that does not reach the displacement up to the maximum amplitude has a limit above all others.  Motions
    without a value are left out.

    Parameters
    ----------
    table : xr.Dataset
        Limit amplitudes with the dimension `motion`, and their status.
    quantiles : float or array

    Returns
    -------
    xr.Dataset
        `limit_quantile` (m/s², dimension `quantile`; infinite where so many motions do not reach it, NaN where none has
        a value), `value_count` and `not_reached_count`.
    """
    limits = table["limit_amplitude"]
    dims = _suite_dims(limits, None)
    grid = {dim: size for dim, size in limits.sizes.items() if dim not in dims}
    order = [limits.dims.index(dim) for dim in (*grid, *dims)]
    values, status = (
        table[name].values.transpose(order).reshape((*grid.values(), -1))
        for name in ("limit_amplitude", "limit_status")
    )
    beyond = status == LimitStatus.NOT_REACHED
    ordered = np.sort(np.where(beyond, np.inf, values), axis=-1)
    count = np.count_nonzero(~np.isnan(ordered), axis=-1)
    wanted = check_quantiles("quantiles", quantiles)
    found = _quantiles(ordered, np.zeros_like(count), count, wanted)
    coords = {name: one for name, one in table.coords.items() if not {*dims} & {*one.dims, name}}
    results = {
        "limit_quantile": xr.Variable((*grid, "quantile"), found, {"units": "m s-2"}),
        "value_count": xr.Variable(tuple(grid), count),
        "not_reached_count": xr.Variable(tuple(grid), np.count_nonzero(beyond, axis=-1)),
    }
    return xr.Dataset(results, {**coords, "quantile": xr.Variable(("quantile",), wanted)}, table.attrs)


def point_names(table: xr.Dataset, sizes: Mapping[Any, int]) -> list[str]:
    """What each point of a grid is called, in order: ``theta = 5, mu_s = 0.3``."""

    def names(dim: str) -> Iterator[str]:
        for i in range(sizes[dim]):
            label: Any = i + 1
            if dim in table:
                label = table[dim].values[i]
            elif "label" in table and table["label"].dims == (dim,):
                label = table["label"].values[i]
            numeric = getattr(label, "dtype", np.dtype(object)).kind in "iuf"
            yield f"{dim} = {label:.6g}" if numeric else f"{dim} = {label}"

    return [", ".join(parts) for parts in itertools.product(*(names(dim) for dim in sizes))]


def _suite_dims(displacement: xr.Variable, over: Any) -> tuple[str, ...]:
    """The dimensions that the statistics are taken over."""
    there = displacement.dims
    if "motion" not in there:
        raise InputError(
            f"result: dimensions {', '.join(there) or 'none'}: must have motion, as a result of a suite has"
        )
    if over is None:
        return tuple(dim for dim in _SUITE if dim in there)
    dims: Sequence[Any] = [over] if isinstance(over, str) else check_list("over", over, "dimensions")
    for dim in dims:
        if dim not in there:
            raise InputError(f"over = {shown(dim)}: must be a dimension of the result: {', '.join(there)}")
    if "motion" not in dims:
        raise InputError(f"over = {shown(over)}: must have motion among them")
    return tuple(dict.fromkeys(dims))


def _spread(variable: xr.Variable, dims: Sequence[str]) -> NDArray[Any]:
    """Values along `dims`, of length 1 where the variable does not have one."""
    values = variable.values
    if values.dtype.kind == "f":  # codes that a file's reader has made numbers with NaN of
        values = np.nan_to_num(values)
    there = [dim for dim in dims if dim in variable.dims]
    ordered = values.transpose([variable.dims.index(dim) for dim in there])
    return ordered.astype(np.int64).reshape([variable.sizes.get(dim, 1) for dim in dims])


def _statistics(
    values: Floats, codes: NDArray[Any], thresholds: Floats, quantiles: Floats, zero: float
) -> dict[str, Any]:
    """Statistics along the last axis."""
    total = values.shape[-1]
    missing = np.isnan(values)
    reasons = np.stack([np.count_nonzero(missing & (codes & int(flag) != 0), axis=-1) for flag in REASONS], axis=-1)
    ordered = np.sort(values, axis=-1)  # NaN goes last
    count = total - np.count_nonzero(missing, axis=-1)
    zeros = np.count_nonzero(ordered <= zero, axis=-1)
    slid = count - zeros
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = np.log(np.where(ordered > zero, ordered, 1.0))
        mean = logs.sum(axis=-1) / np.where(slid > 0, slid, np.nan)
        squares = np.where(ordered > zero, logs - mean[..., None], 0.0) ** 2
        scatter = np.sqrt(squares.sum(axis=-1) / np.where(slid > 1, slid - 1, np.nan))
        valued = np.where(count > 0, count, np.nan)
        exceeding = [np.count_nonzero(ordered > one, axis=-1) / valued for one in thresholds]
    return {
        "value_count": count.astype(np.int32),
        "valueless_count": (total - count).astype(np.int32),
        "valueless_flag_count": reasons.astype(np.int32),
        "valueless_share": (total - count) / total,
        "zero_probability": zeros / valued,
        "nonzero_median": _quantiles(ordered, zeros, slid, np.array([0.5]))[..., 0],
        "nonzero_geometric_mean": np.exp(mean),
        "log_standard_deviation": scatter,
        "displacement_quantile": _quantiles(ordered, np.zeros_like(count), count, quantiles),
        "exceedance_probability": np.stack(exceeding, axis=-1),
    }


def _quantiles(ordered: Floats, first: NDArray[Any], count: NDArray[Any], wanted: Floats) -> Floats:
    """Quantiles of `count` values that begin at `first`, linear between them (numpy's default); NaN of none."""
    most = ordered.shape[-1] - 1
    # infinite values, those above all others, have no straight line to them
    place = wanted * np.maximum(count - 1, 0)[..., None]
    below = np.floor(place).astype(np.intp)
    last = np.maximum(first + count - 1, 0)[..., None]
    at = np.minimum(first[..., None] + below, most)
    low = np.take_along_axis(ordered, at, axis=-1)
    high = np.take_along_axis(ordered, np.minimum(at + 1, np.maximum(last, 0)), axis=-1)
    with np.errstate(invalid="ignore"):
        between = np.where((high == low) | (place == below), low, low + (place - below) * (high - low))
    return np.asarray(np.where(count[..., None] > 0, between, np.nan))
