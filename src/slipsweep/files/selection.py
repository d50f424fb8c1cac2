"""Values of the axes of a result, as users name them: ``--at theta=5 --at amplitude=0.1g,0.2g --at case=LABEL``."""

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

#: What may be given for an axis: a number in its own unit, a text with another ("0.3g"), a label,
#: or several of them.
At = float | str | Sequence[float | str]

#: Numbers as near as this, of the largest on an axis, are the same: single precision keeps seven
#: digits.
_SAME = 1e-7

#: Fewest digits that a text is taken to have: 5 stands for 5.000.
_DIGITS = 4


@dataclass(frozen=True)
class Place:
    """A place on an axis: the value, and its index; None where it lies between the values of the result."""

    value: float
    index: int | None


def axis_labels(data: xr.Dataset, dim: str) -> list[str]:
    """Names along a dimension: those of cases, motions and inputs; empty where it has numbers, or nothing."""
    for name in ("label", dim) if dim == "case" else (dim,):
        if name in data.variables and data[name].dims == (dim,) and data[name].dtype.kind in "OUST":
            return [str(one) for one in data[name].values]
    return []


def axis_numbers(data: xr.Dataset, dim: str) -> np.ndarray:
    """The numbers along a dimension; 1, 2, ... where it has none."""
    there = dim in data.variables and data[dim].dtype.kind not in "OUST"
    return (
        np.asarray(data[dim].values, np.float64) if there else np.arange(1.0, 1.0 + data.sizes[dim])
    )


def axis_values(data: xr.Dataset, dim: str) -> list[Any]:
    """The values along a dimension, or their labels; of one without either the numbers from 1."""
    labels = axis_labels(data, dim)
    return labels or (
        data[dim].values.tolist() if dim in data.coords else list(range(1, data.sizes[dim] + 1))
    )


def units_text(one: xr.DataArray, before: str = " ") -> str:
    """Unit behind a number, if it is not 1."""
    units = one.attrs.get("units", "1")
    return "" if units == "1" else f"{before}{units}"


def find(data: xr.Dataset, at: Mapping[str, At], where: str = "result") -> dict[str, list[Place]]:
    """Find values on the axes of a result, called `where` in errors.

    A text is equal to a value of the result in the digits that it has, in its own unit: what a
    message or a caption prints can be typed.  It may hold several values, with commas; labels, or
    their numbers from 1.  A parameter that is one number for the whole result may be named too,
    with that number; it is not among what is returned.  InputError: there is no such axis, or a
    value lies outside of it.
    """
    known = [
        *map(str, data.sizes),
        *(str(name) for name, one in data.coords.items() if one.ndim == 0),
    ]
    found = {}
    for name, cut in at.items():
        if name not in known:
            raise InputError(f"{where}: {name} = {cut}: no such axis; {did_you_mean(name, known)}")
        labels = axis_labels(data, name) if name in data.sizes else []
        texts: Any = [cut] if cut in labels or np.ndim(cut) == 0 else cut
        if isinstance(cut, str) and cut not in labels:
            texts = [one.strip() for one in cut.split(",")]
        places = list(
            dict.fromkeys(_place(data, f"{where}: {name}", name, one, labels) for one in texts)
        )
        if name in data.sizes:
            found[name] = places
        elif any(place.index is None for place in places):
            whole = f"{data[name].item():.6g}{units_text(data[name])}"
            raise InputError(f"{where}: {name} = {cut}: is {whole} in the whole result")
    return found


def own_names(data: xr.Dataset, at: Mapping[str, At]) -> dict[str, At]:
    """The same by the names of the axes: `ky` is yield_coefficient, `mu_s` beside an axis phi the angle to it."""
    found: dict[str, At] = {}
    for name, cut in at.items():
        own = "yield_coefficient" if name == "ky" else name
        if own == "mu_s" and own in data.coords and data[own].dims == ("phi",):
            places = find(data.swap_dims(phi=own), {own: cut})[own]
            own = "phi"
            cut = ",".join(f"{math.degrees(math.atan(one.value)):.10g}" for one in places)
        found[own] = cut
    return found


def places_at(
    data: xr.Dataset, source: object, at: Mapping[str, At], dims: Collection[str]
) -> dict[str, NDArray[np.intp]]:
    """Indices of values on some axes of a result, of which `dims` may be cut, for `Dataset.isel`.

    InputError: as `find`, or a value lies between those of the result; the message names its
    neighbours.
    """
    at = own_names(data, at)
    for name in at:
        if name in data.sizes and name not in dims:
            raise InputError(
                f"{source}: {name} = {at[name]}: cannot be selected here; {did_you_mean(name, [*dims])}"
            )
    places = find(data, at, str(source))
    for name, found in places.items():
        for place in found:
            if place.index is None:
                raise InputError(f"{source}: {between(data, name, place.value)}")
    return {
        name: np.array([place.index for place in found], np.intp) for name, found in places.items()
    }


def selected(
    data: xr.Dataset, source: object, at: Mapping[str, At], kept: Collection[str]
) -> xr.Dataset:
    """A result at values of its axes, but for those that are `kept` whole; as `places_at`."""
    return data.isel(
        places_at(data, source, at, [str(dim) for dim in data.sizes if dim not in kept])
    )


def between(data: xr.Dataset, name: str, value: float) -> str:
    """That a value is not among those of a result, and between which it lies."""
    values = np.sort(axis_numbers(data, name))
    above = int(np.clip(np.searchsorted(values, value), 1, values.size - 1))
    return (
        f"{name} = {value:.6g}: not among the values of the result; "
        f"its neighbours are {values[above - 1]:.6g} and {values[above]:.6g}{units_text(data[name])}"
    )


def _place(data: xr.Dataset, key: str, name: str, given: float | str, labels: list[str]) -> Place:
    """The place of one value or label."""
    if given in labels:
        index = labels.index(str(given))
        return Place(index + 1.0, index)
    text = str(given)
    if labels and not text.isdecimal():
        raise InputError(f"{key} = {text}: must be a number or one of {', '.join(labels)}")
    values = axis_numbers(data, name) if name in data.sizes else np.atleast_1d(data[name].values)
    units = str(data[name].attrs.get("units", "1"))
    g = float(data.attrs.get("g", math.nan))
    number = quantity(key, text, units, g) if isinstance(given, str) else float(given)
    slack = _SAME * float(np.abs(values).max())
    if isinstance(given, str):
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
        there = f"{low:.6g} to {high:.6g}" if values.size > 1 else f"{low:.6g}"
        raise InputError(
            f"{key} = {text}: outside the range of the result, {there}{units_text(data[name])}"
        )
    return Place(number, None)
