"""Slices of a result: the cells that a chart shows and no others, read, or solved where the result has none."""

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
from slipsweep.model.variables import PARAMETERS, STATISTIC_COORDINATES, STATISTICS
from slipsweep.studies.solved_again import (
    DISPLACEMENT,
    is_newmark,
    is_recorded,
    solve_again,
    with_amplitude,
)

#: Dimensions whose places have names, and no order.
NAMED = ("case", "motion")

#: Variables by which results of functions other than `sweep` are known, one of which they have.
OTHER_SORTS = {
    "limit": ("limit_amplitude",),
    "strength": ("required_status", "never_within_count"),
    "calibration": ("computed_ground_acceleration",),
    "friction": ("friction_ratio",),
    "hazard": ("annual_rate",),
    "history": ("relative_displacement",),
}

#: Of them, those that have axes to draw over.
_LIMITS = ("limit", "strength")

#: Most curves of a family, panels across and down, and points of an axis that a figure can show.
_CURVES = 6
_PANELS = 3
_POINTS = 600

#: What draws a cell that no axis is left for.
_OF_ONE_CELL = "slipsweep simulate draws the time history of one cell"

#: What is kept of an axis: a slice of it, or places, some of which may lie between its values.
Kept = slice | Sequence[Place]


class Result:
    """A result that is drawn: a dataset, and what it is called in errors.  Only what is drawn of it is read.

    `sort` says what it is a result of: "sweep", "statistics", "record", "suite", or one of
    `OTHER_SORTS`, of which only limits and required strengths have `variables`, the names of its
    results, and `dims`, their dimensions.  InputError: it is no result, does not say what was
    solved, or has other units than slipsweep writes.
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
        self.variables = [str(one) for one in data.data_vars if one in SHOWN]
        if not self.variables:
            raise InputError(f'{name}: not a result of "slipsweep run"')
        recorded = self.sort in ("record", "suite")
        #: The recorded motion or motions, if the file has them; and the one to solve slices under.
        self.shaking = read_embedded(data, Path(name)) if recorded else None
        self.motion = self.shaking if self.sort == "record" else None
        data = data[self.variables]
        if 0 in data.sizes.values():
            raise InputError(f"{name}: holds no cells")
        check_attributes(data.attrs, self.name)
        for key, one in data.variables.items():
            units = (SHOWN | PARAMETERS).get(str(key), {}).get("units")
            if units and one.attrs.get("units", units) != units:
                raise InputError(
                    f'{name}: {key}: units = "{one.attrs["units"]}"; must be "{units}"'
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
        """Axes that a chart can be drawn over: those of a parameter that has more than one value."""
        known = {*PARAMETERS, *STATISTIC_COORDINATES, "displacement"}
        return [
            dim
            for dim in self.dims
            if self.data.sizes[dim] > 1 and dim in known and dim in self.data.coords
        ]

    @property
    def groups(self) -> list[str]:
        """Axes whose values can tell curves or panels apart: also cases and motions, which have no order."""
        return [
            *self.wide,
            *(dim for dim in NAMED if dim in self.dims and self.data.sizes[dim] > 1),
        ]

    def check_axes(self) -> None:
        """Refuse the result of a sweep that has no axis to draw a chart over (InputError)."""
        if self.sort in ("sweep", "record") and not self.wide:
            raise InputError(
                f"{self.name}: no axis has two values or more, which charts need; {_OF_ONE_CELL}"
            )

    def result(self, name: str) -> str:
        """`name` if it is a result in the file (InputError otherwise, naming those there are)."""
        return self.known(name, self.variables, f"{name}: no such variable")

    def known(self, given: str, there: Sequence[str], problem: str, more: str = "") -> str:
        """What a user names, if it is there (InputError otherwise: the problem, and what is there)."""
        if given not in there:
            raise InputError(f"{self.name}: {problem}; {did_you_mean(given, there)}{more}")
        return given

    def compared(self, name: str) -> list[str]:
        """A quantity with its flags, and Newmark's displacement if the file has it, or the record to solve it under."""
        if self.result(name) in ("sliding_mode", "validity"):
            raise InputError(
                f"{self.name}: --variable {name}: is a code, not a quantity; --kind modes shows the modes"
            )
        theirs = "newmark_displacement"
        known = theirs in self.variables or (self.motion is not None and not is_newmark(self.data))
        return [name, "validity", *([theirs] if name == DISPLACEMENT and known else [])]

    def places(self, at: Mapping[str, At]) -> dict[str, list[Place]]:
        """Where on the axes the requested values are; InputError as `find`, or where no cell is or can be solved."""
        found = find(self.data, at, self.name)
        for name, places in found.items():
            for place in places:
                if place.index is None and (reason := self._unsolvable(name)):
                    raise InputError(
                        f"{self.name}: {between(self.data, name, place.value)} ({reason})"
                    )
        return found

    def _unsolvable(self, dim: str) -> str:
        """Why no slice at another value of an axis can be solved; empty where it can."""
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
        """The cells of a slice, read, or solved where the result of a sweep does not have them.

        `keep` has what stays of the axes that stay; the others are cut where `at` says, else in the
        middle, `polarity` at 1.  Every parameter is a coordinate; the attribute ``picked`` names
        the case and motion that were selected.
        """
        cuts = self.places(at)
        exact = {}
        picked = {}
        index: dict[str, Any] = {dim: one for dim, one in keep.items() if isinstance(one, slice)}
        for dim in [one for one in self.dims if one not in index]:
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
                exact[dim] = dims, np.reshape([one.value for one in chosen], shape), PARAMETERS[dim]
            elif not dims and dim in NAMED and (labels := axis_labels(self.data, dim)):
                picked[dim] = labels[chosen[0].index]
        there = [name for name in names if name in self.variables]
        data = self.data[there].isel(index, missing_dims="ignore").load().assign_coords(exact)
        if exact and "displacement_amplitude" in data.coords:
            data = data.drop_vars("amplitude", errors="ignore")
        if "phi" in exact:
            tangent = np.tan(np.radians(data["phi"].values))
            data = data.assign_coords(mu_s=(data["phi"].dims, tangent, PARAMETERS["mu_s"]))
        data = with_amplitude(data)
        solved = [name for name in names if exact or name not in there]
        if solved and self.sort != "sweep" and self.motion is None:
            self.result(solved[0])
        if solved:
            data = data.assign(solve_again(data, solved, motion=self.motion).data_vars)
        return by_magnitude(data.assign_attrs(picked=picked))

    def spread(self, dim: str, number: int) -> list[Place]:
        """At most `number` places on an axis, from end to end, in even steps if a few less have them."""
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
        """The slice of a chart that needs some results, in panels.

        It is drawn over `x`, or over the first of these axes that is there, or another that the
        user chooses: axes of the first result.  `y` has axes for the ordinate of a map, and
        `curves` those that may tell curves apart, in order of preference.  `keep` stays, too, whole
        or at the values requested; of `same`, along which the results do not vary, no panels are
        made.  InputError: an axis that was chosen is not there, or none is left.
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
                f"{self.name}: --x {options.x}: not with this chart, which is drawn over another quantity"
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
                    f"{self.name}: --y {options.y}: not with a chart over one axis, --x; use --panels"
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
        # more than one value for every two dots on paper are lost
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
            self.known(
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
        """The axis that an option names, or the first of those preferred, or any that is left for it."""
        given: str | None = getattr(options, option)
        if given is not None:
            return self.known(given, there, f"--{option} {given}: no such axis", more)
        free = [
            dim for dim in there if dim not in (*options.panels, *options.at, options.x, options.y)
        ]
        found = next((dim for dim in (*preferred, *free) if dim in free), None)
        if found is None:
            fixed = f"; --at fixes {', '.join(options.at)}" if options.at else ""
            hint = "" if more else f"; {_OF_ONE_CELL}"
            raise InputError(
                f"{self.name}: this chart needs {'another' if more else 'an'} axis with two values or more{more}; "
                f"there are: {', '.join(there) or 'none'}{fixed}{hint}"
            )
        return found


def _sort(data: xr.Dataset) -> str:
    for sort, names in OTHER_SORTS.items():
        if any(name in data for name in names):
            return sort
    if any(name in STATISTICS for name in data.data_vars):
        return "statistics"
    if not is_recorded(data):
        return "sweep"
    return "suite" if any("motion" in one.dims for one in data.data_vars.values()) else "record"
