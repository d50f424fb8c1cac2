"""Slices of a result: the cells that a chart shows, and no others, as a dataset.

A slice at a value that is not among those of the result is solved, with the same options.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.charts.answers import solve, with_amplitude
from slipsweep.charts.style import drawn_text
from slipsweep.errors import InputError, did_you_mean
from slipsweep.files.selection import At, Place, axis_labels, between, find
from slipsweep.model.options import MODELS
from slipsweep.model.variables import (
    INTENSITY_MEASURES,
    PARAMETERS,
    RECORD_RESULTS,
    RESULTS,
    STATISTIC_COORDINATES,
    STATISTICS,
)
from slipsweep.motion.waveforms import WAVEFORMS

#: Results that charts show, and the coordinates that slices keep.
_RESULTS = RECORD_RESULTS | RESULTS | STATISTICS
_KEPT = {*PARAMETERS, *STATISTIC_COORDINATES, *(f"motion_{name}" for name in INTENSITY_MEASURES), "label", "motion"}

#: Dimensions whose places have names, and no order.
NAMED = ("case", "motion")

#: Points of an axis that a figure shows: more than one for every two dots on paper is lost.
MOST_POINTS = 600

#: What is kept of an axis: a slice of it, indices, or places some of which lie between its values.
Kept = slice | Sequence[int] | Sequence[Place]


class Result:
    """A result of a sweep, of which slices are drawn.

    Parameters
    ----------
    data : Dataset
        As `sweep` returns it, or `slipsweep.open_result`: only what is drawn of it is read.
    name : str
        What it is called in errors.

    Attributes
    ----------
    variables : list of str
        Names of its results.
    dims : tuple of str
        Dimensions of its results.
    sort : str
        What it is a result of: "sweep", "statistics", "record" or "suite".

    Raises
    ------
    InputError
        It is no result of a sweep, does not say what was solved, or has other units than slipsweep writes.
    """

    def __init__(self, data: xr.Dataset, name: str) -> None:
        self.name = name
        self.variables = [str(one) for one in data.data_vars if one in _RESULTS]
        if not self.variables:
            raise InputError(f'{name}: not a result of "slipsweep run"')
        dims = dict.fromkeys(dim for one in self.variables for dim in data[one].dims)
        self.dims = tuple(map(str, dims))
        if not all(data.sizes[dim] for dim in self.dims):
            raise InputError(f"{name}: holds no cells")
        falling = [
            dim for dim in self.dims
            if dim in PARAMETERS and dim != "polarity" and not data.get_index(dim).is_monotonic_increasing
        ]  # fmt: skip
        self.data = data.sortby(falling) if falling else data
        self.attrs: dict[str, Any] = {str(key): value for key, value in data.attrs.items()}
        check_attributes(self.attrs, name)
        for key, about in (PARAMETERS | _RESULTS).items():
            found = data[key].attrs.get("units") if key in data.variables else None
            if found and found != about.get("units", found):
                raise InputError(f'{name}: {key}: units = "{found}"; must be "{about["units"]}"')
        self.sort = self._sort()

    def _sort(self) -> str:
        if any(name in STATISTICS for name in self.variables):
            return "statistics"
        if {"record", "suite"}.isdisjoint(self.attrs):
            return "sweep"
        return "suite" if "motion" in self.dims else "record"

    # ------------------------------------------------------------------------ what is meant

    @property
    def is_newmark(self) -> bool:
        """Whether it is of Newmark's block."""
        return bool(self.attrs["model"] == "newmark")

    @property
    def wide(self) -> list[str]:
        """Axes that a chart can be drawn over: those of a parameter that has more than one value."""
        known = {*PARAMETERS, *STATISTIC_COORDINATES}
        return [dim for dim in self.dims if self.data.sizes[dim] > 1 and dim in known and dim in self.data.coords]

    @property
    def groups(self) -> list[str]:
        """Axes whose values can tell curves or panels apart: also cases and motions, which have no order."""
        return [*self.wide, *(dim for dim in NAMED if dim in self.dims and self.data.sizes[dim] > 1)]

    def require(self, *names: str) -> None:
        """Refuse a result that lacks a parameter (InputError); Newmark's block needs its yield coefficient alone."""
        there = {*map(str, with_amplitude(self.data).coords)}
        if "yield_coefficient" in there:
            there |= {"theta", "mu_s"}
        for name in names:
            if name not in there:
                raise InputError(f"{self.name}: {name}: not in the result, but this chart needs it")

    def axis(self, name: str) -> str:
        """`name` if it is an axis with more than one value, or of groups (InputError naming the axes there are)."""
        if name in self.groups:
            return name
        if name in self.dims or name in self.data.coords:
            raise InputError(f"{self.name}: {name}: has one value; axes with several: {self._axes_text()}")
        raise InputError(f"{self.name}: {name}: no such axis; {did_you_mean(name, self.wide)}")

    def _axes_text(self) -> str:
        return ", ".join(self.groups) or "none"

    def result(self, name: str) -> str:
        """`name` if it is a result in the file (InputError otherwise, naming those there are)."""
        if name not in self.variables:
            raise InputError(f"{self.name}: {name}: no such variable; {did_you_mean(name, self.variables)}")
        return name

    def places(self, at: Mapping[str, At]) -> dict[str, list[Place]]:
        """Where on the axes the values requested are.

        Raises
        ------
        InputError
            As `slipsweep.files.selection.find`, or a value between those of the result where no slice can be solved.
        """
        there = self.data[[*self.variables, *(name for name in self.data.coords if name in _KEPT)]]
        found = find(there, at, self.name)
        for name, places in found.items():
            for place in places:
                if place.index is None and (reason := self._unsolvable(name)):
                    raise InputError(f"{self.name}: {between(self.data, name, place.value)} ({reason})")
        return found

    def _unsolvable(self, dim: str) -> str:
        """Why no slice at another value of an axis can be solved; empty where it can."""
        if self.sort == "statistics":
            return "statistics are not computed again for a chart"
        if self.sort in ("record", "suite"):
            return "the response to recorded motions is not solved anew for a chart"
        if dim not in PARAMETERS:
            return "nothing lies between them"
        derived = {"amplitude"} if dim in ("displacement_amplitude", "frequency") else set()
        others = [
            name for name, one in self.data.coords.items()
            if name in PARAMETERS and name not in (dim, *derived) and dim in one.dims
        ]  # fmt: skip
        return f"{others[0]} is known at those values only" if others else ""

    # --------------------------------------------------------------------------- selection

    def select(self, names: Iterable[str], keep: Mapping[str, Kept], at: Mapping[str, At]) -> xr.Dataset:
        """The cells of a slice, read, or solved where they are not in the result.

        Parameters
        ----------
        names : iterable of str
            Results; the flags are solved for the slice if they are not in the file.
        keep : mapping of axis to slice, indices or places
            The axes that stay, and what of them; a result may lack some.
        at : mapping of axis to value
            Where to cut the other axes.  Those not named are cut in the middle, `polarity` at 1.

        Returns
        -------
        Dataset
            With every parameter as a coordinate.  The attribute ``picked`` has the names of the case and motion that
            were selected.
        """
        where: dict[str, Any] = {}
        exact: dict[str, Any] = {}
        cuts = self.places(at)
        for dim in self.dims:
            found: Any = keep[dim] if dim in keep else cuts.get(dim, [self._middle(dim)])
            if dim not in keep and len(found) > 1:
                raise InputError(f"{self.name}: {dim} = {at[dim]}: several values are for curves or panels only")
            if not isinstance(found, slice) and isinstance(found[0], Place):
                if any(place.index is None for place in found):
                    values = np.array([place.value for place in found])
                    exact[dim] = xr.Variable((dim,), values) if dim in keep else xr.Variable((), values[0])
                found = [place.index or 0 for place in found]
            where[dim] = found if dim in keep else found[0]
        wanted = [name for name in names if name in self.variables]
        picked = {
            dim: axis_labels(self.data, dim)[where[dim]]
            for dim in NAMED
            if dim in where and dim not in keep and axis_labels(self.data, dim)
        }
        coords = [name for name in self.data.coords if name in _KEPT or name in self.dims]
        data = self.data[[*wanted, *coords]].isel(where).load()
        # coordinates of a statistic that other statistics have
        data = data.drop_vars([name for name in coords if not {*data[name].dims} <= {*keep}])
        for dim, values in exact.items():
            data = data.assign_coords({dim: values.to_base_variable()})
            data[dim].attrs = dict(PARAMETERS[dim])
        if exact and "displacement_amplitude" in data.coords:
            data = data.drop_vars("amplitude", errors="ignore")
        data = with_amplitude(data)
        solved = [name for name in names if exact or name not in self.variables]
        if solved:
            data = data.drop_vars(wanted if exact else []).assign(solve(data, solved).data_vars)
        return data.assign_attrs(picked=picked)

    def _middle(self, dim: str) -> int:
        if dim == "polarity":
            return int(np.argmax(self.data[dim].values))
        return 0 if dim in NAMED else (self.data.sizes[dim] - 1) // 2

    def members(self, dim: str, number: int, at: Mapping[str, At]) -> Kept:
        """The values that tell curves or panels apart: those requested, or `number` at most from end to end."""
        return self.places({dim: at[dim]})[dim] if dim in at else spread(self.data.sizes[dim], number)

    def thinned(self, dim: str) -> slice:
        """A slice of an axis of `MOST_POINTS` values at most."""
        size = self.data.sizes[dim]
        return slice(0, size, math.ceil(size / MOST_POINTS))


def spread(size: int, number: int) -> list[int]:
    """At most `number` of `size` indices, from end to end, in even steps if a few less have them."""
    even = [n for n in (number, number - 1, number - 2) if n > 3 and (size - 1) % (n - 1) == 0]
    number = even[0] if even and size > number else number
    return sorted({round(i) for i in np.linspace(0, size - 1, min(number, size))})


def check_attributes(attrs: Mapping[str, Any], name: str) -> None:
    """Refuse a result of a sweep that does not say what was solved (InputError)."""
    recorded = not {"record", "suite"}.isdisjoint(attrs)
    options = ("rise", "recoupling") if attrs.get("model") == "mendez" else ()
    for key in ("model", "g", *(() if recorded else ("cycles", "waveform")), *options):
        if key not in attrs:
            raise InputError(f"{name}: attribute {key!r}: missing; it says what was solved")
    try:
        MODELS.from_attributes(attrs)
        if not recorded:
            WAVEFORMS.from_attributes(attrs)
        drawn_text(attrs)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
