"""Where on the axes of a result the values are that a table is asked for (``--at NAME=VALUE``)."""

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.files.results import ResultFile
from slipsweep.model.suggest import did_you_mean
from slipsweep.model.units import quantity_in

#: Values as near as this, of the largest on the axis, are the same: single precision keeps seven digits.
_SAME = 1e-7


def stored_places(file: ResultFile, at: Mapping[str, str], dims: Collection[str]) -> dict[str, NDArray[np.intp]]:
    """Find the values asked for along the axes of a result.

    Parameters
    ----------
    file : ResultFile
    at : mapping of axis to text
        A value or several with commas between, each with a unit if in another than the axis's own ("0.3g"); or a
        label.  A parameter that is one number for the whole result may be named too, with that number.
    dims : collection of str
        The axes that may be cut.

    Returns
    -------
    dict of str to ndarray
        Indices into the file, in the order asked for.

    Raises
    ------
    InputError
        There is no such axis, or the result has no such value: the message names its neighbours.
    """
    found = {}
    single = [name for name in file.coordinates if not file[name].dims and not file[name].is_text]
    for name, text in at.items():
        if name not in dims and name not in single:
            known = [*dims, *single]
            advice = did_you_mean(name, known) if known else "the result has none"
            raise InputError(f"{file.path}: --at {name}={text}: no such axis here; {advice}")
        places = _places(file, name, text)
        if name in dims:
            found[name] = places
    return found


def axis_labels(file: ResultFile, dim: str) -> list[str]:
    """Names of the values along a dimension without numbers; empty where it has numbers."""
    return file.labels if dim == "case" else file.texts(dim)


def _places(file: ResultFile, name: str, text: str) -> NDArray[np.intp]:
    labels = axis_labels(file, name)
    if text in labels:
        return np.array([labels.index(text)])
    if name in file.sizes:
        values, places = file.axis(name)
    else:
        values, places = np.atleast_1d(file[name].read_floats({})), np.zeros(1, dtype=np.intp)
    return np.array(
        list(dict.fromkeys(_place(file, name, one.strip(), labels, values, places) for one in text.split(",")))
    )


def _place(
    file: ResultFile, name: str, text: str, labels: Sequence[str], values: NDArray[np.float64], places: NDArray[np.intp]
) -> int:
    """The place in the file of one value or label."""
    key = f"{file.path}: --at {name}"
    if text in labels:
        return labels.index(text)
    if labels and not text.isdecimal():
        raise InputError(f"{key}={text}: must be a label; {did_you_mean(text, labels)}")
    units = str(file[name].attrs.get("units", "1")) if name in file else "1"
    number = quantity_in(key, text, units, float(file.attrs.get("g", math.nan)))
    nearest = int(np.argmin(np.abs(values - number)))
    if abs(values[nearest] - number) <= _SAME * np.abs(values).max():
        return int(places[nearest])
    shown = "" if units == "1" else f" {units}"
    if not values[0] <= number <= values[-1]:
        there = f"{values[0]:.6g} to {values[-1]:.6g}" if values.size > 1 else f"{values[0]:.6g}"
        raise InputError(f"{key}={text}: outside the values of the file, {there}{shown}")
    above = int(np.searchsorted(values, number))
    raise InputError(
        f"{key}={text}: not among the values of the file; "
        f"its neighbours are {values[above - 1]:.6g} and {values[above]:.6g}{shown}"
    )
