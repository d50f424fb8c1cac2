"""Selection of values on the axes of a result: ``--at theta=5 --at amplitude=0.1g,0.2g``."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError, did_you_mean
from slipsweep.model.units import conversion, quantity

#: Values on an axis: a number in its own unit, a text with another unit ("0.3g"), a label, or
#: several of these.
At = float | str | Sequence[float | str]

#: Difference below which numbers are the same, as a part of the largest on the axis: single
#: precision keeps seven digits.
_SAME = 1e-7

#: Fewest digits that a text is taken to have: 5 stands for 5.000.
_DIGITS = 4


@dataclass(frozen=True)
class Place:
    """A value on an axis, and its index; None if it lies between two values of the result."""

    value: float
    index: int | None


def axis_labels(data: xr.Dataset, dim: str) -> list[str]:
    """Return the labels along a dimension: of cases, motions or inputs; empty if it has none."""
    for name in ("label", dim) if dim == "case" else (dim,):
        if name in data.variables and data[name].dims == (dim,) and data[name].dtype.kind in "OUST":
            return [str(label) for label in data[name].values]
    return []


def axis_numbers(data: xr.Dataset, dim: str) -> np.ndarray:
    """Return the numbers along a dimension; 1, 2, ... if it has none."""
    if dim in data.variables and data[dim].dtype.kind not in "OUST":
        return np.asarray(data[dim].values, np.float64)
    return np.arange(1.0, 1.0 + data.sizes[dim])


def axis_values(data: xr.Dataset, dim: str) -> list[Any]:
    """Return the labels along a dimension, or else its values, or else the numbers from 1."""
    if labels := axis_labels(data, dim):
        return labels
    if dim in data.coords:
        return list(data[dim].values.tolist())
    return list(range(1, data.sizes[dim] + 1))


def units_text(values: xr.DataArray, before: str = " ") -> str:
    """Return the unit to write behind a number; empty if it is 1."""
    units = values.attrs.get("units", "1")
    return "" if units == "1" else f"{before}{units}"


def find(data: xr.Dataset, at: Mapping[str, At], where: str = "result") -> dict[str, list[Place]]:
    """Return the places of values on the axes of a result, which errors call `where`.

    A text equals a value of the result if they agree in the digits and the unit of the text, so
    that a number can be typed as a message or a caption prints it.  A text may hold several values
    with commas between, also labels, or their numbers from 1.  A parameter with one value for the
    whole result may be named with this value; it is not returned.  InputError: there is no such
    axis, or a value lies outside of it.
    """
    axes = [
        *map(str, data.sizes),
        *(str(name) for name, coordinate in data.coords.items() if coordinate.ndim == 0),
    ]
    places_on = {}
    for name, cut in at.items():
        if name not in axes:
            raise InputError(f"{where}: {name} = {cut}: no such axis; {did_you_mean(name, axes)}")
        labels = axis_labels(data, name) if name in data.sizes else []
        texts: Any = [cut] if cut in labels or np.ndim(cut) == 0 else cut
        if isinstance(cut, str) and cut not in labels:
            texts = [text.strip() for text in cut.split(",")]
        places = list(
            dict.fromkeys(_place(data, f"{where}: {name}", name, text, labels) for text in texts)
        )
        if name in data.sizes:
            places_on[name] = places
        elif any(place.index is None for place in places):
            whole = f"{data[name].item():.6g}{units_text(data[name])}"
            raise InputError(f"{where}: {name} = {cut}: is {whole} in the whole result")
    return places_on


def own_names(data: xr.Dataset, at: Mapping[str, At]) -> dict[str, At]:
    """Return the values by the names of axes: `ky` is yield_coefficient.

    `mu_s` becomes the angle on an axis `phi`.
    """
    by_axis: dict[str, At] = {}
    for name, cut in at.items():
        axis = "yield_coefficient" if name == "ky" else name
        if axis == "mu_s" and axis in data.coords and data[axis].dims == ("phi",):
            places = find(data.swap_dims(phi=axis), {axis: cut})[axis]
            axis = "phi"
            cut = ",".join(f"{math.degrees(math.atan(place.value)):.10g}" for place in places)
        by_axis[axis] = cut
    return by_axis


def places_at(
    data: xr.Dataset, source: object, at: Mapping[str, At], dims: Collection[str]
) -> dict[str, NDArray[np.intp]]:
    """Return the indices of values on axes of a result, for `Dataset.isel`.

    Only `dims` may be selected from.  InputError: as `find`; or a value lies between those of the
    result, and the message names its neighbours.
    """
    at = own_names(data, at)
    for name in at:
        if name in data.sizes and name not in dims:
            raise InputError(
                f"{source}: {name} = {at[name]}: cannot be selected here; "
                f"{did_you_mean(name, [*dims])}"
            )
    places = find(data, at, str(source))
    for name, on_axis in places.items():
        for place in on_axis:
            if place.index is None:
                raise InputError(f"{source}: {between(data, name, place.value)}")
    return {
        name: np.array([place.index for place in on_axis], np.intp)
        for name, on_axis in places.items()
    }


def selected(
    data: xr.Dataset, source: object, at: Mapping[str, At], kept: Collection[str]
) -> xr.Dataset:
    """Return a result at values of its axes, but for axes that are `kept` whole.

    InputError: as `places_at`.
    """
    return data.isel(
        places_at(data, source, at, [str(dim) for dim in data.sizes if dim not in kept])
    )


def between(data: xr.Dataset, name: str, value: float) -> str:
    """Return the message that a value lies between two values of a result."""
    values = np.sort(axis_numbers(data, name))
    above = int(np.clip(np.searchsorted(values, value), 1, values.size - 1))
    neighbours = f"{values[above - 1]:.6g} and {values[above]:.6g}{units_text(data[name])}"
    return (
        f"{name} = {value:.6g}: not among the values of the result; its neighbours are {neighbours}"
    )


def _place(data: xr.Dataset, key: str, name: str, value: float | str, labels: list[str]) -> Place:
    """Return the place of a value or label."""
    if value in labels:
        index = labels.index(str(value))
        return Place(index + 1.0, index)
    text = str(value)
    if labels and not text.isdecimal():
        raise InputError(f"{key} = {text}: must be a number or one of {', '.join(labels)}")
    values = axis_numbers(data, name) if name in data.sizes else np.atleast_1d(data[name].values)
    units = str(data[name].attrs.get("units", "1"))
    g = float(data.attrs.get("g", math.nan))
    number = quantity(key, text, units, g) if isinstance(value, str) else float(value)
    slack = _SAME * float(np.abs(values).max())
    if isinstance(value, str):
        written, unit = re.findall(r"^\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*$", text)[0]
        if typed := Decimal(written):
            last = 10.0 ** (typed.adjusted() + 1 - max(_DIGITS, len(typed.as_tuple().digits)))
            slack = max(slack, 0.5 * last * conversion(key, units, unit or None, g))
    nearest = int(np.argmin(np.abs(values - number)))
    if abs(values[nearest] - number) <= slack:
        return Place(float(values[nearest]), nearest)
    low = values.min()
    high = values.max()
    if not low <= number <= high:
        extent = f"{low:.6g} to {high:.6g}" if values.size > 1 else f"{low:.6g}"
        raise InputError(
            f"{key} = {text}: outside the range of the result, {extent}{units_text(data[name])}"
        )
    return Place(number, None)
