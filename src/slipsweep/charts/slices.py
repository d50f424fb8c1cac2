"""Slices of a result: the cells that a chart shows, and no others, read as a table.

`Result` opens a file and reads hyperslabs.  A slice at a value that is not among those of the file is solved
anew, with the same options.
"""

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.charts.answers import amplitude_of, solve
from slipsweep.charts.style import drawn_text
from slipsweep.errors import InputError
from slipsweep.files.results import ResultFile, Where, result_file
from slipsweep.model.options import MODELS
from slipsweep.model.variables import (
    HISTORY,
    MOTION_COORDINATES,
    PARAMETERS,
    RECORD_RESULTS,
    RESULTS,
    STATISTIC_COORDINATES,
    STATISTICS,
)
from slipsweep.motion.waveforms import WAVEFORMS

Floats = NDArray[np.float64]

#: What a result may hold along its axes, and on them.
_COORDINATES = PARAMETERS | STATISTIC_COORDINATES | MOTION_COORDINATES
_RESULTS = RECORD_RESULTS | RESULTS | STATISTICS

#: Dimensions whose places have names, and no order.
NAMED = ("case", "motion")

#: Codes of cells, and what stands for a missing one.
CODES = {"sliding_mode": -1, "validity": 0}

#: Largest number that is drawn: products of a few of them are still numbers.
_MOST = 1e75

#: Points of an axis that a figure shows: more than one for every two dots on paper is lost.
MOST_POINTS = 600

#: Values as near as this, of the largest on the axis, are the same: single precision keeps seven digits.
_SAME = 1e-7

#: Where to cut an axis: a number in its own unit, a text with another ("0.3g"), a label, or several of them.
Cut = float | str | Sequence[float | str]


class Result:
    """A result of a sweep, open for reading slices; a context manager.

    Parameters
    ----------
    source : Path or ResultFile
        A file that `slipsweep run` wrote, or one that has been opened.

    Attributes
    ----------
    attrs : dict
        Global attributes.
    axes : dict of str to ndarray
        Dimensions and their values; those of ``case`` and ``motion`` are 1, 2, ...
    labels : dict of str to list of str
        Names of the cases, and of the motions, where there are any.
    sort : str
        What it is a result of: "sweep", "statistics", "record" or "suite".

    Raises
    ------
    InputError
        The file cannot be read, is not netCDF, or was not written by `slipsweep run`.
    """

    def __init__(self, source: Path | ResultFile) -> None:
        with ExitStack() as stack:
            self._file: ResultFile = stack.enter_context(result_file(source)) if isinstance(source, Path) else source
            path = self.path = self._file.path
            check_sweep(self._file)
            self.attrs: dict[str, Any] = self._file.attrs
            #: Names of the results in the file.
            self.variables = [name for name in self._file.results if name in _RESULTS]
            #: Names of the parameters in the file: axes, scalars, and those that lie along other dimensions.
            self.coordinates = [
                name for name in _COORDINATES if name in self._file.coordinates and not self._file[name].is_text
            ]
            dims = {dim for name in (*self.variables, *self.coordinates) for dim in self._file[name].dims}
            found = {dim: self._file.axis(dim) for dim in self._file.sizes if dim in dims}
            for dim, (values, _) in found.items():
                check_drawable(path, dim, values)
            self.axes: dict[str, Floats] = {dim: values for dim, (values, _) in found.items()}
            self._places = {dim: places for dim, (_, places) in found.items()}
            if not all(values.size for values in self.axes.values()):
                raise InputError(f"{path}: holds no cells")
            labels = {"case": self._file.labels, "motion": self._file.texts("motion")}
            self.labels: dict[str, list[str]] = {dim: names for dim, names in labels.items() if names}
            self.sort = self._sort()
            #: Names of the uncertain inputs that Sobol indices are of.
            self.inputs: list[str] = self._file.texts("input")
            self._open = stack.pop_all()

    def __enter__(self) -> "Result":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    def _sort(self) -> str:
        if any(name in STATISTICS for name in self.variables):
            return "statistics"
        if not is_recorded(self._file):
            return "sweep"
        return "suite" if "motion" in self.axes else "record"

    @property
    def g(self) -> float:
        """Gravity, m/s²."""
        return float(self.attrs["g"])

    def dims(self, name: str) -> tuple[str, ...]:
        """Dimensions of a variable."""
        return self._file[name].dims

    def read(self, name: str, where: Where) -> NDArray[Any]:
        """Read one hyperslab along ascending axes: the only way that values come out of the file.

        `where` says for each axis what to read of it, a dimension that is not named as a whole.
        """
        variable = self._file[name]
        there = {dim: self._places[dim][where.get(dim, slice(None))] for dim in variable.dims if dim in self._places}
        if name in CODES:
            return variable.read_codes(there, CODES[name])
        values = variable.read_floats(there)
        check_drawable(self.path, name, values)
        return values

    # ------------------------------------------------------------------------ what is meant

    @property
    def wide(self) -> list[str]:
        """Axes that a chart can be drawn over: those of a parameter that has more than one value."""
        return [dim for dim, values in self.axes.items() if values.size > 1 and dim in self.coordinates]

    @property
    def groups(self) -> list[str]:
        """Axes whose values can tell curves or panels apart: also cases and motions, which have no order."""
        return [*self.wide, *(dim for dim in NAMED if self.axes.get(dim, np.zeros(1)).size > 1)]

    def require(self, *names: str) -> None:
        """Refuse a file that has lost a parameter (InputError)."""
        derived = {"amplitude"} if {"displacement_amplitude", "frequency"} <= {*self.coordinates} else set()
        for name in names:
            if name not in derived.union(self.coordinates):
                raise InputError(f"{self.path}: {name}: not in the file, but this chart needs it")

    def axis(self, name: str) -> str:
        """`name` if it is an axis with more than one value (`case` and `motion` are of groups).

        Raises
        ------
        InputError
            Naming the axes there are.
        """
        if name in self.groups:
            return name
        if name in self.axes or name in self.coordinates:
            raise InputError(
                f"{self.path}: {name}: has no more than one value along an axis of its own; {_list(self.wide)}"
            )
        raise InputError(f"{self.path}: {name}: no such axis; {_suggest(name, self.wide)}")

    def result(self, name: str) -> str:
        """`name` if it is a result in the file (InputError otherwise, naming those there are)."""
        if name not in self.variables:
            raise InputError(f"{self.path}: {name}: no such variable; {_suggest(name, self.variables)}")
        return name

    def places(self, at: Mapping[str, Cut]) -> dict[str, list[int] | Floats]:
        """Where on the axes the values asked for are.

        Parameters
        ----------
        at : mapping of axis name to value or values
            In the axis's own unit, or a text with another ("0.3g"); a case or motion by its number or label.
            A text may hold several, with commas.  A parameter that is one number for the whole result may be
            named too, with that number.

        Returns
        -------
        dict of str to list of int, or array
            Indices into `axes`; the values themselves where one of them is not on the axis: that slice must
            be solved anew.

        Raises
        ------
        InputError
            An axis that is not there, a value beyond its range, or one between its values where no slice
            can be solved anew.
        """
        found: dict[str, list[int] | Floats] = {}
        for name, cut in at.items():
            known = [*self.axes, *(c for c in self.coordinates if not self.dims(c))]
            if name not in known:
                raise InputError(f"{self.path}: {name} = {cut}: no such axis; {_suggest(name, known)}")
            if isinstance(cut, str) and cut not in self.labels.get(name, ()):
                cut = cut.split(",")
            each = [cut] if isinstance(cut, str) or np.ndim(cut) == 0 else list(cut)  # type: ignore[arg-type]
            numbers = np.array([self._number(name, one) for one in each])  # type: ignore[arg-type]
            values = self.axes[name] if name in self.axes else np.atleast_1d(self.read(name, {}))
            slack = _SAME * np.abs(values).max()
            for number in numbers:
                if not values[0] - slack <= number <= values[-1] + slack:
                    there = f"{values[0]:.6g} to {values[-1]:.6g}" if values.size > 1 else f"{values[0]:.6g}"
                    raise InputError(
                        f"{self.path}: {name} = {number:.6g}: outside the file's range, {there}{_units_of(name)}"
                    )
            if name not in self.axes:
                continue
            indices = [int(np.argmin(np.abs(values - number))) for number in numbers]
            between = [n for n, index in zip(numbers, indices, strict=True) if abs(values[index] - n) > slack]
            found[name] = numbers if between else indices
            if between and (reason := self._unsolvable(name)):
                above = int(np.searchsorted(values, between[0]))
                raise InputError(
                    f"{self.path}: {name} = {between[0]:.6g}: not among the values of the file, and {reason}; "
                    f"its neighbours are {values[above - 1]:.6g} and {values[above]:.6g}{_units_of(name)}"
                )
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
        others = [name for name in self.coordinates if name not in (dim, *derived) and dim in self.dims(name)]
        return f"{others[0]} is known at those values only" if others else ""

    def _number(self, name: str, value: float | str) -> float:
        """A value on an axis in the axis's own unit."""
        labels = self.labels.get(name, [])
        if value in labels:
            return 1.0 + labels.index(str(value))
        try:
            return float(value)
        except ValueError:
            if name in NAMED:
                allowed = f"a number or one of {', '.join(labels)}"
                raise InputError(f"{self.path}: {name} = {value}: must be {allowed}") from None
        from slipsweep.model.units import quantity

        # of the same unit
        parameter = name if name in PARAMETERS else "displacement_amplitude" if name == "threshold" else "mu_s"
        return quantity(f"{self.path}: {name}", str(value), parameter, self.g)

    # --------------------------------------------------------------------------- reading

    def select(
        self, names: Iterable[str], keep: Mapping[str, slice | Sequence[int] | Floats], at: Mapping[str, Cut]
    ) -> xr.Dataset:
        """Read a slice, or solve it where it is not in the file.

        Parameters
        ----------
        names : iterable of str
            Results; the flags are solved for the slice if they are not in the file.
        keep : mapping of axis to slice, indices, or values
            The axes that stay, and what of them to read; they may be missing from a result.  Of values
            (an array of numbers that are not indices) one at least is not on the axis.
        at : mapping of axis to value
            Where to cut the other axes.  Those not named are cut in the middle, `polarity` at its largest, 1.

        Returns
        -------
        xr.Dataset
            With every parameter as a coordinate: along the axes kept, or of one value.

        Raises
        ------
        InputError
            As `places`, or an axis that is both kept and cut.
        """
        for name in at:
            if name in keep:
                raise InputError(
                    f"{self.path}: {name} = {at[name]}: is an axis of this chart; it cannot have one value"
                )
        where: dict[str, Any] = {}
        exact: dict[str, Floats] = {}
        cuts = self.places(at)
        for dim, places in cuts.items():
            if len(places) > 1:
                raise InputError(
                    f"{self.path}: {dim} = {at[dim]}: several values are allowed for curves or panels only"
                )
        for dim, values in self.axes.items():
            # of the polarities the record as it is
            middle = 0 if dim in NAMED else values.size - 1 if dim == "polarity" else (values.size - 1) // 2
            found: Any = keep[dim] if dim in keep else cuts.get(dim, [middle])
            if isinstance(found, np.ndarray):
                exact[dim] = found if dim in keep else found[0]
                found = np.searchsorted(values[:-1], found).tolist()
            where[dim] = found if dim in keep or isinstance(found, slice) else found[0]

        def variable(name: str) -> xr.Variable:
            dims = self.dims(name)
            attrs = _COORDINATES[name] if name in self.coordinates else _RESULTS[name]
            return xr.Variable(tuple(dim for dim in dims if dim in keep), self.read(name, where), attrs)

        coords = {name: variable(name) for name in self.coordinates}
        coords |= {dim: xr.Variable(coords[dim].dims, values, coords[dim].attrs) for dim, values in exact.items()}
        if {"displacement_amplitude", "frequency"} <= coords.keys() and ("amplitude" not in coords or exact):
            coords["amplitude"] = amplitude_of(coords["displacement_amplitude"], coords["frequency"])
        attrs: dict[str, Any] = {**self.attrs, "labels": {}, "picked": {}}
        for dim in NAMED:
            names_there = self.labels.get(dim, [])
            if dim in keep and dim in self.axes:
                numbers = self.axes[dim][where[dim]]
                coords[dim] = xr.Variable((dim,), numbers)
                attrs["labels"][dim] = [names_there[int(n) - 1] if names_there else f"{n:g}" for n in numbers]
            elif names_there:
                attrs["picked"][dim] = names_there[where[dim]]
        anew = [name for name in names if exact or name not in self.variables]
        solved = solve(xr.Dataset({}, coords, attrs), anew) if anew else {}
        results = {name: solved[name] if name in solved else variable(name) for name in names}
        return xr.Dataset(results, coords, attrs)

    def members(self, dim: str, number: int, at: Mapping[str, Cut]) -> list[int] | Floats:
        """The values that tell curves or panels apart: those asked for, or `number` at most from end to end."""
        if dim in at:
            return self.places({dim: at[dim]})[dim]
        return self.spread(dim, number)

    def thinned(self, dim: str) -> slice:
        """A slice of an axis of `MOST_POINTS` values at most."""
        size = self.axes[dim].size
        return slice(0, size, math.ceil(size / MOST_POINTS))

    def spread(self, dim: str, number: int) -> list[int]:
        """Indices of `number` values at most, from end to end of an axis, in even steps if a few less have them."""
        size = self.axes[dim].size
        even = [n for n in (number, number - 1, number - 2) if n > 3 and (size - 1) % (n - 1) == 0]
        number = even[0] if even and size > number else number
        return sorted({round(i) for i in np.linspace(0, size - 1, min(number, size))})


def check_drawable(path: Path, name: str, values: NDArray[Any], most: float = _MOST) -> None:
    """Refuse numbers that no drawing library can place (InputError)."""
    beyond = values[np.abs(values) > np.float64(most)]  # np.float64: single precision would make it infinite
    if beyond.size:
        raise InputError(f"{path}: {name}: holds {beyond.flat[0]:.4g}; what is drawn must be within +-{most:g}")


def is_recorded(file: ResultFile) -> bool:
    """Whether a result is the response to recorded motions."""
    return not {"record", "suite"}.isdisjoint(file.attrs)


def check_sweep(file: ResultFile) -> None:
    """Refuse a file that is no result of a sweep, or does not say any more what was solved.

    Raises
    ------
    InputError
        It holds something else; an attribute is missing or none that slipsweep writes; another program
        has put values into other units.
    """
    others = {"limit_amplitude", *HISTORY}
    if others & file.variables.keys() or not any(name in _RESULTS for name in file.results):
        raise InputError(f'{file.path}: not a result of "slipsweep run"')
    check_units(file, _COORDINATES)
    check_units(file, _RESULTS)
    options = (
        "model",
        "g",
        *(() if is_recorded(file) else ("cycles", "waveform")),
        *(("rise", "recoupling") if file.attrs.get("model") == "mendez" else ()),
    )
    for name in options:  # none has its default: what has been solved is not known any more
        if name not in file.attrs:
            raise InputError(f"{file.path}: attribute {name!r}: missing; it says what was solved")
    try:
        MODELS.from_attributes(file.attrs)
        if not is_recorded(file):
            WAVEFORMS.from_attributes(file.attrs)
        drawn_text(file.attrs)
    except (ValueError, TypeError) as error:  # InputError, and what numpy says of arrays
        raise InputError(f"{file.path}: {error}") from None


def check_units(file: ResultFile, described: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse a file whose values another program has put into other units (InputError)."""
    for name, attributes in described.items():
        found = file[name].attrs.get("units") if name in file else None
        if found and found != attributes.get("units", found):
            raise InputError(f'{file.path}: {name}: units = "{found}"; must be "{attributes["units"]}"')


def _units_of(name: str) -> str:
    units = _COORDINATES[name]["units"] if name in _COORDINATES else "1"
    return "" if units == "1" else f" {units}"


def _list(names: Sequence[str]) -> str:
    return f"there {'is' if len(names) == 1 else 'are'} {', '.join(names)}" if names else "there is none"


def _suggest(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return (f'did you mean "{near[0]}"? ' if near else "") + _list(known)
