"""Slices of a result: the cells that a chart shows, and no others.

They are read, or solved where the result does not have them.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from slipsweep.charts.magnitudes import by_magnitude
from slipsweep.charts.sheet import Sheet
from slipsweep.charts.style import SHOWN, Options, check_attributes
from slipsweep.errors import InputError, did_you_mean
from slipsweep.files.motions import read_embedded
from slipsweep.files.selection import At, Place, axis_labels, between, find
from slipsweep.model.parameters import friction_coefficient
from slipsweep.model.variables import PARAMETERS, STATISTIC_COORDINATES, STATISTICS
from slipsweep.studies.solved_again import (
    DISPLACEMENT,
    is_newmark,
    is_recorded,
    solve_again,
    with_amplitude,
)

#: Dimensions whose places have names and no order.
NAMED = ("case", "motion")

#: Variables of results of functions other than `sweep`; a result of a sort has one of these.
OTHER_SORTS = {
    "limit": ("limit_amplitude",),
    "strength": ("required_status", "never_within_count"),
    "calibration": ("computed_ground_acceleration",),
    "friction": ("friction_ratio",),
    "hazard": ("annual_rate",),
    "history": ("relative_displacement",),
}

#: Sorts of them that have axes to draw over.
_LIMITS = ("limit", "strength")

#: Most curves of a family, panels across and down, and points of an axis that a figure can show.
_CURVES = 6
_PANELS = 3
_POINTS = 600

#: Advice for a result without an axis to draw over.
_OF_ONE_CELL = "slipsweep simulate draws the time history of one cell"

#: The part of an axis that is kept: a slice, or places, some of them between its values.
Kept = slice | Sequence[Place]


class Result:
    """A result to draw: a dataset, and its name in errors.  Only the cells that are drawn are read.

    `sort` is "sweep", "statistics", "record", "suite", or one of `OTHER_SORTS`.  `variables` are
    the names of its results and `dims` their dimensions; of `OTHER_SORTS` only limits and required
    strengths have these.  InputError: it is no result, its attributes lack the model or the
    shaking, or it has other units than slipsweep writes.
    """

    def __init__(self, data: xr.Dataset, name: str | Path) -> None:
        self.name = str(name)
        self.attrs = data.attrs
        self.sort = _sort(data)
        if self.sort in OTHER_SORTS and self.sort not in _LIMITS:
            self.data = data
            self.variables = []
            self.dims = []
            return
        self.variables = [str(key) for key in data.data_vars if key in SHOWN]
        if not self.variables:
            raise InputError(f'{name}: not a result of "slipsweep run"')
        recorded = self.sort in ("record", "suite")
        #: The recorded motion or motions, if the file has them, and the record of a slice.
        self.shaking = read_embedded(data, Path(name)) if recorded else None
        self.motion = self.shaking if self.sort == "record" else None
        data = data[self.variables]
        if 0 in data.sizes.values():
            raise InputError(f"{name}: holds no cells")
        check_attributes(data.attrs, self.name)
        for key, variable in data.variables.items():
            units = (SHOWN | PARAMETERS).get(str(key), {}).get("units")
            if units and variable.attrs.get("units", units) != units:
                raise InputError(
                    f'{name}: {key}: units = "{variable.attrs["units"]}"; must be "{units}"'
                )
        self.dims = [str(dim) for dim in data.sizes]
        ordered = [dim for dim in self.dims if dim in PARAMETERS and dim != "polarity"]
        self.data = data.sortby(
            [dim for dim in ordered if not data.get_index(dim).is_monotonic_increasing]
        )
        there = {*map(str, with_amplitude(data).coords)}
        block = () if "yield_coefficient" in there else ("theta", "mu_s")
        for key in (*block, "amplitude", "frequency") if self.sort == "sweep" else ():
            if key not in there:
                raise InputError(f"{name}: {key}: not in the result, but charts need it")

    @property
    def wide(self) -> list[str]:
        """Axes to draw over: those of a parameter with more than one value."""
        numbered = {*PARAMETERS, *STATISTIC_COORDINATES, "displacement"}
        return [
            dim
            for dim in self.dims
            if self.data.sizes[dim] > 1 and dim in numbered and dim in self.data.coords
        ]

    @property
    def groups(self) -> list[str]:
        """Axes of curves or panels: `wide`, and cases and motions, which have no order."""
        return [
            *self.wide,
            *(dim for dim in NAMED if dim in self.dims and self.data.sizes[dim] > 1),
        ]

    def check_axes(self) -> None:
        """Raise InputError for the result of a sweep that has no axis to draw over."""
        if self.sort in ("sweep", "record") and not self.wide:
            raise InputError(
                f"{self.name}: no axis has two values or more, which charts need; {_OF_ONE_CELL}"
            )

    def result(self, name: str) -> str:
        """Return `name` if it is a result in the file (InputError otherwise, with those in it)."""
        return self.checked(name, self.variables, f"{name}: no such variable")

    def checked(self, name: str, there: Sequence[str], problem: str, more: str = "") -> str:
        """Return a name that a user gives, if it is among `there` (InputError: `problem`)."""
        if name not in there:
            raise InputError(f"{self.name}: {problem}; {did_you_mean(name, there)}{more}")
        return name

    def compared(self, name: str) -> list[str]:
        """Return the names of a quantity, its flags and, for displacements, Newmark's.

        Newmark's is among them if the file has it, or the record under which it can be solved.
        """
        if self.result(name) in ("sliding_mode", "validity"):
            raise InputError(
                f"{self.name}: --variable {name}: is a code, not a quantity; --kind modes shows "
                "the modes"
            )
        names = [name, "validity"]
        of_newmark = "newmark_displacement"
        can_be_solved = self.motion is not None and not is_newmark(self.data)
        if name == DISPLACEMENT and (of_newmark in self.variables or can_be_solved):
            names.append(of_newmark)
        return names

    def places(self, at: Mapping[str, At]) -> dict[str, list[Place]]:
        """Return the places of requested values on their axes.

        InputError: as of `find`; or there is no cell, and none can be solved.
        """
        requested = find(self.data, at, self.name)
        for name, places in requested.items():
            for place in places:
                if place.index is None and (reason := self._unsolvable(name)):
                    raise InputError(
                        f"{self.name}: {between(self.data, name, place.value)} ({reason})"
                    )
        return requested

    def _unsolvable(self, dim: str) -> str:
        """Return why no slice can be solved at another value of an axis; empty if it can."""
        if self.sort != "sweep":
            return "nothing is computed again for a chart of statistics, limits or recorded motions"
        derived = {
            "phi": {"mu_s"},
            "displacement_amplitude": {"amplitude"},
            "frequency": {"amplitude"},
        }.get(dim, set())
        others = [
            name for name in PARAMETERS if name in self.data.coords and name not in (dim, *derived)
        ]
        tied = next((name for name in others if dim in self.data[name].dims), None)
        return f"{tied} is known at those values only" if tied else ""

    def select(
        self, names: Iterable[str], keep: Mapping[str, Kept], at: Mapping[str, At]
    ) -> xr.Dataset:
        """Return the cells of a slice, read, or solved where the result of a sweep lacks them.

        `keep` has the parts of axes that stay.  The other axes are cut at the values of `at`, else
        in the middle, and `polarity` at 1.  Every parameter is a coordinate; the attribute
        ``picked`` names the case and motion that were selected.
        """
        cuts = self.places(at)
        exact = {}
        picked = {}
        index: dict[str, Any] = {dim: part for dim, part in keep.items() if isinstance(part, slice)}
        for dim in [other for other in self.dims if other not in index]:
            middle = 0 if dim in NAMED else (self.data.sizes[dim] - 1) // 2
            if dim == "polarity":
                middle = int(np.argmax(self.data[dim].values))
            chosen: Any = keep[dim] if dim in keep else cuts.get(dim) or [Place(math.nan, middle)]
            if dim not in keep and len(chosen) > 1:
                raise InputError(
                    f"{self.name}: {dim} = {at[dim]}: several values are for curves or panels only"
                )
            dims, shape = ((dim,), [len(chosen)]) if dim in keep else ((), [])
            index[dim] = np.reshape([place.index or 0 for place in chosen], shape)
            if any(place.index is None for place in chosen):
                values = np.reshape([place.value for place in chosen], shape)
                exact[dim] = dims, values, PARAMETERS[dim]
            elif not dims and dim in NAMED and (labels := axis_labels(self.data, dim)):
                picked[dim] = labels[chosen[0].index]
        there = [name for name in names if name in self.variables]
        data = self.data[there].isel(index, missing_dims="ignore").load().assign_coords(exact)
        if exact and "displacement_amplitude" in data.coords:
            data = data.drop_vars("amplitude", errors="ignore")
        if "phi" in exact:
            tangent = friction_coefficient(data["phi"].values)
            data = data.assign_coords(mu_s=(data["phi"].dims, tangent, PARAMETERS["mu_s"]))
        data = with_amplitude(data)
        solved = [name for name in names if exact or name not in there]
        if solved and self.sort != "sweep" and self.motion is None:
            self.result(solved[0])
        if solved:
            data = data.assign(solve_again(data, solved, motion=self.motion).data_vars)
        return by_magnitude(data.assign_attrs(picked=picked))

    def spread(self, dim: str, number: int) -> list[Place]:
        """Return up to `number` places on an axis, from end to end.

        There may be one or two less if that makes the steps even.
        """
        size = self.data.sizes[dim]
        most = min(number, size)
        number = next(
            (n for n in (most, most - 1, most - 2) if n > 3 and (size - 1) % (n - 1) == 0), most
        )
        return [Place(math.nan, int(i)) for i in np.linspace(0, size - 1, number).round()]

    def sheet(
        self,
        options: Options,
        names: Sequence[str],
        x: str | Sequence[str],
        *,
        y: Sequence[str] = (),
        curves: Sequence[str] | None = None,
        keep: Sequence[str] = (),
        same: Sequence[str] = (),
    ) -> Sheet:
        """Return the sheet of a chart, with a slice of some results in panels.

        All axes are those of the first result.

        Parameters
        ----------
        options
            What the user has chosen.
        names
            Results that the chart needs.
        x
            Axis of the abscissa; or axes, of which the first that is there is taken unless the user
            chooses one.
        y
            Axes for the ordinate of a map, in order of preference.
        curves
            Axes that may tell curves apart, in order of preference; None if there is one curve.
        keep
            Further axes that stay, whole or at the values requested.
        same
            Axes along which the results do not vary: they make no panels.

        Raises
        ------
        InputError
            An axis that was chosen is not there, or none is left.
        """
        places = self.places(options.at)
        kept: dict[str, Kept] = {dim: places.get(dim, slice(None)) for dim in keep}
        along = self.data[self.result(names[0])].dims
        groups = [dim for dim in self.groups if dim in along and dim not in kept]
        wide = [dim for dim in groups if dim in (*PARAMETERS, "displacement")]
        several = [
            dim for dim in groups if len(places.get(dim, ())) > 1 and dim not in options.panels
        ]
        across = x if isinstance(x, str) else self._axis(options, "x", wide, x)
        if isinstance(x, str) and options.x is not None:
            raise InputError(
                f"{self.name}: --x {options.x}: not with this chart, which is drawn over another "
                "quantity"
            )
        rest = [dim for dim in groups if dim != across]
        up: str | None = None
        if y:
            up = self._axis(
                options, "y", [dim for dim in wide if dim != across], y, f"; --x is {across}"
            )
        elif options.y is not None:
            if curves is None:
                raise InputError(
                    f"{self.name}: --y {options.y}: not with a chart over one axis, --x; use "
                    "--panels"
                )
            up = self._axis(options, "y", rest, ())
        elif curves is not None:
            free = [
                dim for dim in rest if dim in several or dim not in (*options.at, *options.panels)
            ]
            up = next((dim for dim in (*several, *curves) if dim in free), None)
        for dim in (across, str(up)) if y else (across,):
            if dim in options.at and dim not in keep:
                why = "is an axis of this chart; it cannot have one value"
                raise InputError(f"{self.name}: {dim} = {options.at[dim]}: {why}")
        # paper does not resolve more points
        thinned = {
            dim: slice(0, size, math.ceil(size / _POINTS)) for dim, size in self.data.sizes.items()
        }
        kept.setdefault(across, thinned[across])
        if up:
            kept[up] = thinned[up] if y else places.get(up) or self.spread(up, _CURVES)
        panels = list(options.panels) or [dim for dim in several if dim not in kept]
        if options.more_panels and not panels:
            panels = [dim for dim in groups if dim not in (*kept, *same, *options.at)]
        for name in panels[:2]:
            self.checked(
                name,
                [dim for dim in groups if dim not in kept],
                f"--panels {name}: must be another axis",
            )
            kept[name] = places.get(name) or self.spread(name, _PANELS)
        sheet = Sheet(self.select(names, kept, options.at), across, up, options, panels[:2])
        for side in ("x", "y") if y else () if isinstance(x, str) or across in NAMED else ("x",):
            sheet.set_axis(side)
        if names[0] == DISPLACEMENT:
            sheet.note_slides_back(self.shaking)
            sheet.note_magnitude()
        return sheet

    def _axis(
        self,
        options: Options,
        option: str,
        there: list[str],
        preferred: Sequence[str],
        more: str = "",
    ) -> str:
        """Return the axis that an option names, else the first preferred one, else any left."""
        chosen: str | None = getattr(options, option)
        if chosen is not None:
            return self.checked(chosen, there, f"--{option} {chosen}: no such axis", more)
        free = [
            dim for dim in there if dim not in (*options.panels, *options.at, options.x, options.y)
        ]
        axis = next((dim for dim in (*preferred, *free) if dim in free), None)
        if axis is None:
            fixed = f"; --at fixes {', '.join(options.at)}" if options.at else ""
            hint = "" if more else f"; {_OF_ONE_CELL}"
            raise InputError(
                f"{self.name}: this chart needs {'another' if more else 'an'} axis with two values "
                f"or more{more}; there are: {', '.join(there) or 'none'}{fixed}{hint}"
            )
        return axis


def _sort(data: xr.Dataset) -> str:
    """Return the sort of a result (`Result.sort`)."""
    for sort, names in OTHER_SORTS.items():
        if any(name in data for name in names):
            return sort
    if any(name in STATISTICS for name in data.data_vars):
        return "statistics"
    if not is_recorded(data):
        return "sweep"
    has_motions = any("motion" in variable.dims for variable in data.data_vars.values())
    return "suite" if has_motions else "record"
