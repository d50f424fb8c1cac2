"""Published equations at the grid points of a result, beside the statistics of its own suite."""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from slipsweep.errors import InputError
from slipsweep.model.options import Mendez
from slipsweep.model.parameters import check_numbers, number_text, shown
from slipsweep.model.units import in_mm
from slipsweep.model.variables import (
    PUBLISHED_RESULTS,
    STATISTIC_COORDINATES,
    SUITE_STATISTICS,
)
from slipsweep.motion.waveforms import peak_acceleration
from slipsweep.published import EQUATIONS, INPUTS, Estimate, check_equations
from slipsweep.studies.sampling import Thresholds, check_increasing, check_thresholds
from slipsweep.studies.suite_statistics import (
    QUANTILES,
    SUITE,
    THRESHOLDS,
    labels_along,
    suite_statistics,
)
from slipsweep.studies.sweeps import friction_parameters

if TYPE_CHECKING:
    import pandas as pd

TITLE = "Published equations for the permanent displacement of a rigid block"

#: Statistics of a suite that an equation has, too.
_STATISTICS = (
    "zero_probability",
    "nonzero_median",
    "log_standard_deviation",
    "displacement_quantile",
    "exceedance_probability",
)

#: Peak velocity of a base that a waveform sets in motion from rest, over A/ω.
_PEAK_VELOCITIES = {"sine": 2.0, "cosine": 1.0, "triangle": math.pi / 2.0, "square": math.pi}


def published_statistics(
    result: xr.Dataset,
    equations: str | Sequence[str],
    *,
    magnitude: float | None = None,
    thresholds: Thresholds = THRESHOLDS,
    quantiles: float | Sequence[float] | np.ndarray = QUANTILES,
) -> xr.Dataset:
    """Permanent displacements by published equations at the grid points of a result.

    The equations take the yield coefficient of the block and the peak ground acceleration of the
    result.  What they were fitted to is not this block: the attribute ``conditions`` names it.

    Parameters
    ----------
    result : Dataset
        A result of `sweep`, or a file of one opened with xarray.
    equations : str or list of str
        Names, such as "jibson-2007", of `slipsweep.published.EQUATIONS`; a text may have several,
        with commas.
    magnitude : float, optional
        Moment magnitude M, for the equations that need it.
    thresholds : float, str or list of these
        Increasing displacements, m or with a unit ("50mm"), ≥ 0.
    quantiles : float or array
        Increasing, between 0 and 1.

    Returns
    -------
    Dataset
        Over `equation` and the dimensions of the grid that the equations depend on:

        - `displacement_quantile` (m), dimension `quantile`, and `exceedance_probability`, dimension
          `threshold` (m), of all displacements, as `suite_statistics` has them; NaN where the block
          slides under its own weight.
        - `zero_probability`; `nonzero_median` (m) and `log_standard_deviation` (of ln u) of the
          others.
        - `in_range`: 1 where the inputs lie in the range of the equation, else 0.

        Under a suite the peak ground velocity is the median of its motions as they shake the block,
        and so is the peak ground acceleration of motions that are scaled by `scale`.  Under a
        waveform T and N are its period and its cycles.

    Raises
    ------
    InputError
        There is no such equation, or the result lacks an input of it.

    See Also
    --------
    suite_statistics : the same of the result itself
    slipsweep.published : the equations

    Examples
    --------
    >>> import slipsweep
    >>> suite = slipsweep.read_suite("sweeps/data/suite/*_H1.AT2")
    >>> result = slipsweep.sweep(5, 0.3, amplitude=[3.0, 4.0, 6.0], excitation=suite)
    >>> found = slipsweep.published_statistics(result, "jibson-2007", quantiles=0.5)
    >>> found.displacement_quantile.squeeze().values.round(4)
    array([0.002 , 0.0083, 0.0296])
    >>> found.in_range.values
    array([[1, 1, 1]], dtype=int8)
    """
    if not isinstance(result, xr.Dataset):
        raise InputError(f"result = {shown(result)}: must be a Dataset")
    if "g" not in result.attrs:
        raise InputError("result: attribute g is missing: must be there, m/s2")
    names = check_equations(equations)
    g = float(result.attrs["g"])
    limits = xr.DataArray(check_thresholds("thresholds", thresholds, g), dims="threshold")
    shares = xr.DataArray(check_increasing("quantiles", quantiles, "quantile"), dims="quantile")
    each = estimates(result, names, magnitude)
    parts = []
    for estimate in each.values():
        statistics = xr.Dataset(
            {
                "zero_probability": estimate.zero_probability,
                "nonzero_median": estimate.median,
                "log_standard_deviation": estimate.log_standard_deviation,
                "in_range": estimate.in_range,
                "displacement_quantile": _with(estimate, estimate.quantile, shares),
                "exceedance_probability": _with(estimate, estimate.exceedance_probability, limits),
            }
        )
        parts.append(statistics)
    grid = [dim for dim in result.dims if any(dim in part["in_range"].dims for part in parts)]
    dataset = xr.concat(xr.broadcast(*parts, exclude=("threshold", "quantile")), "equation")
    dataset = dataset.transpose("equation", *grid, ...)
    dataset["in_range"] = dataset["in_range"].astype(np.int8)
    for name in _STATISTICS:
        dataset[name].attrs = SUITE_STATISTICS[name]
    dataset["in_range"].attrs = PUBLISHED_RESULTS["in_range"]
    coords = {
        name: coordinate.variable
        for name, coordinate in result.coords.items()
        if {*coordinate.dims} <= {*grid} and name not in SUITE
    }
    statistic_coords = {
        dim: xr.Variable(dim, values.values, STATISTIC_COORDINATES[dim])
        for dim, values in (("threshold", limits), ("quantile", shares))
    }
    labels = {"equation": list(names)}
    attrs = {**result.attrs, "title": TITLE, "conditions": "\n".join(conditions_texts(names))}
    if magnitude is not None:
        attrs["magnitude"] = float(magnitude)
    return dataset.assign_coords(coords | statistic_coords | labels).assign_attrs(attrs)


def estimates(
    result: xr.Dataset, names: Sequence[str], magnitude: float | None = None
) -> dict[str, Estimate]:
    """Return estimates by equations at the points of a result.

    They are DataArrays along the dimensions of the inputs.
    """
    by_name = {}
    for name in names:
        equation = EQUATIONS[name]
        available = {} if magnitude is None else {"magnitude": _magnitude(magnitude)}
        arrays = {}
        for needed in equation.inputs:
            array = available[needed] if needed in available else _input(result, needed)
            if array is not None:
                arrays[needed] = array
            elif needed in equation.required:
                how = "give it, magnitude=7 or --magnitude 7"
                hint = how if needed == "magnitude" else "the result does not have it"
                raise InputError(f"{name}: needs {INPUTS[needed]} ({needed}): {hint}")
        broadcast = xr.broadcast(*arrays.values())
        values: dict[str, Any] = {
            needed: array.values for needed, array in zip(arrays, broadcast, strict=True)
        }
        if "g" in inspect.signature(equation.function).parameters:
            values["g"] = float(result.attrs["g"])
        estimate = equation.function(**values)
        by_name[name] = Estimate(*(xr.DataArray(part, dims=broadcast[0].dims) for part in estimate))
    return by_name


def conditions_texts(names: Sequence[str]) -> list[str]:
    """Return sentences on the conditions that the equations are for."""
    texts = ["Published equations are for other conditions: Newmark's rigid block, other shaking."]
    for name in names:
        equation = EQUATIONS[name]
        limits = f"; for {equation.range_text}" if equation.bounds else ""
        texts.append(f"{equation.label}: {equation.conditions}{limits}.")
    return texts


def published_table(
    result: xr.Dataset,
    equations: str | Sequence[str],
    magnitude: float | None = None,
    thresholds: Thresholds | None = None,
) -> "pd.DataFrame":
    """Return displacements in rows, of the result's own suite and of each equation.

    There is a row for each grid point.

    Columns: the axes, ``displacement of``, the quantiles (mm), the probability of zero and of
    exceeding `thresholds`, and ``range``, which is "outside" where an equation is extrapolated.
    """
    import pandas as pd

    names = check_equations(equations)
    limits = [] if thresholds is None else thresholds
    by_equations = published_statistics(
        result, names, magnitude=magnitude, thresholds=limits or 0.0
    )
    sources = {EQUATIONS[name].label: by_equations.sel(equation=name) for name in names}
    if result.sizes.get("motion", 1) > 1:
        of_suite = suite_statistics(result, thresholds=limits or 0.0)
        of_suite = of_suite.assign(in_range=xr.ones_like(of_suite["value_count"]))
        sources = {"this suite": of_suite} | sources
    parts = [_columns(source, bool(limits)) for source in sources.values()]
    whole = xr.concat(parts, pd.Index([*sources], name="displacement of"))
    # in the order of the result, without axes of one value
    axes = [str(dim) for dim in result.dims if whole.sizes.get(dim, 1) > 1]
    single = [dim for dim in whole.dims if dim not in (*axes, "displacement of")]
    laid = whole.squeeze(single, drop=True).assign_coords(
        {dim: axis_labels_of(result, dim) for dim in axes}
    )
    table = laid.to_dataframe([*axes, "displacement of"]).reset_index()
    table["range"] = np.where(table["range"] == 0, "outside", "")
    return table.rename(columns={dim: axis_title(result, dim) for dim in axes})


def _columns(statistics: xr.Dataset, exceeded: bool) -> xr.Dataset:
    """Return quantiles in mm and probabilities by the titles of a table."""
    columns: dict[str, xr.DataArray] = {}
    for share in statistics["quantile"].values:
        title = "median (mm)" if share == 0.5 else f"{100.0 * share:.3g} % (mm)"
        quantile = statistics["displacement_quantile"].sel(quantile=share, drop=True)
        columns[title] = in_mm(quantile)
    columns["zero"] = statistics["zero_probability"]
    for limit in statistics["threshold"].values if exceeded else ():
        title = f"P(u > {in_mm(limit):.6g} mm)"
        columns[title] = statistics["exceedance_probability"].sel(threshold=limit, drop=True)
    columns["range"] = statistics["in_range"]
    return xr.Dataset(columns).reset_coords(drop=True)


def published_lines(
    result: xr.Dataset,
    equations: str | Sequence[str],
    magnitude: float | None = None,
    thresholds: Thresholds | None = None,
    most: int = 100,
) -> list[str]:
    """Return the table of `published_table` in lines, and the conditions of the equations."""
    names = check_equations(equations)
    by_equations = published_statistics(result, names, magnitude=magnitude)
    points = by_equations["in_range"].isel(equation=0).size
    if points > most:
        how = "--at NAME=VALUE takes those of some"
        return [f"published equations at {points} grid points: {how}"]
    table = published_table(result, names, magnitude, thresholds)
    for title in table.select_dtypes("float"):
        is_share = title == "zero" or title.startswith("P(")
        as_text = ".1%" if is_share else ".3g" if title.endswith("(mm)") else ".4g"
        table[title] = [_number(value, as_text) for value in table[title]]
    if not table["range"].any():
        table = table.drop(columns="range")
    outside = (
        ["outside: an input lies outside of the range of the equation"] if "range" in table else []
    )
    return [
        "published equations beside:",
        *(line.rstrip() for line in table.to_string(index=False).splitlines()),
        *outside,
        *conditions_texts(names),
    ]


def _number(value: float, as_text: str) -> str:
    return "none" if np.isnan(value) else format(value, as_text)


def axis_labels_of(result: xr.Dataset, dim: str) -> list[Any]:
    """Return places along an axis: numbers, peak ground accelerations in g, or labels."""
    if dim in result.variables and result[dim].dtype.kind in "iuf":
        factor = float(result.attrs["g"]) if dim == "amplitude" else 1.0
        return [float(value) / factor for value in result[dim].values]
    return labels_along(result, dim)


def axis_title(result: xr.Dataset, dim: str) -> str:
    """Return the title of an axis: its name and unit."""
    names = {"amplitude": "PGA (g)", "yield_coefficient": "ky"}
    units = result[dim].attrs.get("units", "1") if dim in result.variables else "1"
    return names.get(dim, dim if units == "1" else f"{dim} ({units})")


def _with(estimate: Estimate, method: Callable[[Any], Any], more: xr.DataArray) -> xr.DataArray:
    """Return a method of an estimate at several values, along their own dimension."""
    values = np.stack([method(float(value)) for value in more.values], axis=-1)
    return xr.DataArray(values, dims=(*estimate.median.dims, *more.dims))


def _magnitude(magnitude: Any) -> xr.DataArray:
    values = check_numbers("magnitude", magnitude)
    if values.ndim:
        raise InputError(f"magnitude = {shown(magnitude)}: must be a single number")
    if not 0.0 < values <= 10.0:
        text = number_text(float(values))
        raise InputError(f"magnitude = {text}: must be a moment magnitude, > 0 and at most 10")
    return xr.DataArray(values)


# ------------------------------------------------------- inputs of equations from a result


def _input(result: xr.Dataset, name: str) -> xr.DataArray | None:
    """Return an input of equations at the points of a result, or None; it has no coordinates."""
    array = _FROM_RESULT[name](result) if name in _FROM_RESULT else None
    return None if array is None else array.astype(np.float64).drop_vars([*array.coords])


def _yield_coefficient(result: xr.Dataset) -> xr.DataArray | None:
    """Return Üy/g, NaN where the block slides under its own weight."""
    g = float(result.attrs["g"])
    if "yield_coefficient" in result.coords:
        coefficient = result["yield_coefficient"]
    elif "yield_acceleration" in result.coords:
        coefficient = result["yield_acceleration"] / g
    elif {"theta", "mu_s"} <= {*result.coords}:
        block = {name: result[name].reset_coords(drop=True) for name in ("theta", "mu_s")}
        # neither the amplitude nor the friction law enters Coulomb's yield acceleration
        coulomb = friction_parameters(
            **block, amplitude=0.0, delta_mu=0.0, decay_rate=0.0, model=Mendez(g=g)
        )
        coefficient = coulomb["yield_acceleration"] / g
    else:
        return None
    return coefficient.where(coefficient > 0.0)


def peak_acceleration_in_g(result: xr.Dataset) -> xr.DataArray | None:
    """Return the peak ground acceleration in g; of motions with a `scale` their median."""
    g = float(result.attrs["g"])
    if "amplitude" in result.coords:
        return _shaken(result["amplitude"] / g)
    if {"displacement_amplitude", "frequency"} <= {*result.coords}:
        peak = peak_acceleration(result["displacement_amplitude"], result["frequency"])
        return _shaken(peak / g)
    return _of_motions(result, "motion_pga", 1.0 / g)


def _pgv(result: xr.Dataset) -> xr.DataArray | None:
    """Return the peak ground velocity, m/s: that of the scaling, the motions or the waveform."""
    if "pgv" in result.coords:
        return _above_zero(result["pgv"])
    if "motion_pgv" in result.coords:
        time = result["time_scale"] if "time_scale" in result.coords else 1.0
        return _of_motions(result, "motion_pgv", time)
    peak = _PEAK_VELOCITIES.get(str(result.attrs.get("waveform")))
    pga = peak_acceleration_in_g(result)
    period = _period(result)
    if peak is None or pga is None or period is None:
        return None
    return pga * float(result.attrs["g"]) * peak * period / (2.0 * math.pi)


def _of_motions(result: xr.Dataset, measure: str, unit: Any) -> xr.DataArray | None:
    """Return the median measure of the motions as they shake the block, or None."""
    if measure not in result.coords:
        return None
    if "scale" in result.coords:
        factor = abs(result["scale"])
    elif "amplitude" in result.coords:
        factor = result["amplitude"] / result["motion_pga"]
    elif "motion_factor" in result:
        factor = abs(result["motion_factor"])
    else:
        return None
    scaled = result[measure] * factor * unit
    return _above_zero(scaled.median([dim for dim in SUITE if dim in scaled.dims]))


def _period(result: xr.Dataset) -> xr.DataArray | None:
    """Return the period of a waveform whose cycles are equal, s, or None."""
    is_plain = not (result.attrs.get("ramp_in") or result.attrs.get("ramp_out"))
    return 1.0 / result["frequency"] if "frequency" in result.coords and is_plain else None


def _cycles(result: xr.Dataset) -> xr.DataArray | None:
    """Return the number of equal cycles of a waveform, or None."""
    if _period(result) is None or "cycles" not in result.attrs:
        return None
    return xr.DataArray(float(result.attrs["cycles"]))


def _pulse_duration(result: xr.Dataset) -> xr.DataArray | None:
    """Return half a period of a waveform, s, or None."""
    period = _period(result)
    return None if period is None else 0.5 * period


def _shaken(pga: xr.DataArray) -> xr.DataArray:
    """Return peak ground accelerations, with 1e-12 g for 0, by which equations divide."""
    return pga.where(pga > 0.0, 1e-12)


def _above_zero(array: xr.DataArray) -> xr.DataArray:
    return array.where(array > 0.0)


_FROM_RESULT: Mapping[str, Callable[[xr.Dataset], xr.DataArray | None]] = {
    "yield_coefficient": _yield_coefficient,
    "pga": peak_acceleration_in_g,
    "pgv": _pgv,
    "period": _period,
    "cycles": _cycles,
    "pulse_duration": _pulse_duration,
}
