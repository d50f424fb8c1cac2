"""Values of the axes of a result, as users name them: ``--at theta=5 --at amplitude=0.1g,0.2g --at case=LABEL``."""

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.units import quantity_in

#: Values as near as this, of their own, are the same: what messages print has six digits.
_SAME = 1e-5


def places_at(
    table: xr.Dataset, source: object, at: Mapping[str, str], dims: Collection[str]
) -> dict[str, NDArray[np.intp]]:
    """Find the values asked for along the axes of a result.

    Parameters
    ----------
    table : Dataset
    source : object
        What the result is called in errors.
    at : mapping of axis to text
        A value or several with commas between, each with a unit if in another than the axis's own ("0.3g"); or a
        label.  A parameter that is one number for the whole result may be named too, with that number.
    dims : collection of str
        The axes that may be cut.

    Returns
    -------
    dict of str to ndarray
        Indices along these axes, in the order asked for.

    Raises
    ------
    InputError
        There is no such axis, or the result has no such value: the message names its neighbours.
    """
    found = {}
    single = [str(name) for name, one in table.coords.items() if not one.dims and one.dtype.kind in "iuf"]
    for name, text in at.items():
        if name not in dims and name not in single:
            known = [*dims, *single]
            advice = did_you_mean(name, known) if known else "the result has none"
            raise InputError(f"{source}: --at {name}={text}: no such axis here; {advice}")
        labels = axis_labels(table, name)
        texts = [text] if text in labels else [one.strip() for one in text.split(",")]
        places = [_place(table, f"{source}: --at {name}", name, one, labels) for one in texts]
        if name in dims:
            found[name] = np.array(list(dict.fromkeys(places)))
    return found


def axis_labels(table: xr.Dataset, dim: str) -> list[str]:
    """Names of the values along a dimension without numbers; empty where it has numbers."""
    for name in ("label", dim) if dim == "case" else (dim,):
        if name in table.coords and table[name].dims == (dim,) and table[name].dtype.kind in "OUST":
            return [str(one) for one in table[name].values]
    return []


def axis_values(table: xr.Dataset, dim: str) -> list[Any]:
    """The values along a dimension, or their labels; of one without either the numbers from 1."""
    labels = axis_labels(table, dim)
    return labels or (table[dim].values.tolist() if dim in table.coords else list(range(1, table.sizes[dim] + 1)))


def _place(table: xr.Dataset, key: str, name: str, text: str, labels: list[str]) -> int:
    """The place on an axis of one value or label."""
    if text in labels:
        return labels.index(text)
    if labels and not text.isdecimal():
        raise InputError(f"{key}={text}: must be a label; {did_you_mean(text, labels)}")
    if labels or name not in table.coords:
        values, units = np.arange(1.0, 1.0 + table.sizes[name]), "1"
    else:
        values, units = np.atleast_1d(table[name].values), str(table[name].attrs.get("units", "1"))
    number = quantity_in(key, text, units, float(table.attrs.get("g", math.nan)))
    nearest = int(np.argmin(np.abs(values - number)))
    if abs(values[nearest] - number) <= _SAME * abs(values[nearest]):
        return nearest
    shown = "" if units == "1" else f" {units}"
    below, above = values[values < number], values[values > number]
    if not below.size or not above.size:
        there = f"{values.min():.6g} to {values.max():.6g}" if values.size > 1 else f"{values[0]:.6g}"
        raise InputError(f"{key}={text}: outside the values of the file, {there}{shown}")
    raise InputError(
        f"{key}={text}: not among the values of the file; "
        f"its neighbours are {below.max():.6g} and {above.min():.6g}{shown}"
    )
