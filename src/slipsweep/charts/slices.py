"""Slices of a result file: the cells that a chart shows, and no others, read as a table.

`Result` opens a file, finds the nearest values on its axes and reads hyperslabs;
`boundaries` and `newmark` compute for a slice the accelerations of yield and of the mode limit,
and what Newmark's block does on the same cells.
"""

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.charts.style import drawn_text
from slipsweep.errors import InputError
from slipsweep.files.results import ResultFile, Where, open_result
from slipsweep.grid.tables import Table, Variable
from slipsweep.model.options import MODELS
from slipsweep.model.variables import HISTORY, PARAMETERS, RESULTS, STATISTIC_COORDINATES, STATISTICS
from slipsweep.motion.waveforms import WAVEFORMS

Floats = NDArray[np.float64]

#: What a file may hold along its axes, and on them.
_COORDINATES = PARAMETERS | STATISTIC_COORDINATES
_RESULTS = RESULTS | STATISTICS

#: Codes of cells, and what stands for a missing one.
CODES = {"sliding_mode": -1, "validity": 0}

#: Largest number that is drawn: products of a few of them are still numbers.
_MOST = 1e75

#: Points of an axis that a figure shows: more than one for every two dots on paper is lost.
MOST_POINTS = 600


class Result:
    """A file that `slipsweep run` wrote, open for reading slices; a context manager.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    attrs : dict
        Global attributes.
    axes : dict of str to ndarray
        Dimensions and their values; those of ``case`` are 1, 2, ...
    labels : list of str
        Names of the cases; empty without them.

    Raises
    ------
    InputError
        The file cannot be read, is not netCDF, or was not written by `slipsweep run`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with ExitStack() as stack:
            self._file = stack.enter_context(open_result(path))
            if "record" in self._file.attrs:
                raise InputError(
                    f"{path}: is the response to a recorded motion; charts are drawn of harmonic sweeps only "
                    "(slipsweep export makes a table of it)"
                )
            check_sweep(self._file)
            self.attrs: dict[str, Any] = self._file.attrs
            #: Names of the results in the file.
            self.variables = [name for name in self._file.results if name in _RESULTS]
            #: Names of the parameters in the file: axes, scalars, and those that lie along other dimensions.
            self.coordinates = [name for name in _COORDINATES if name in self._file.coordinates]
            dims = {dim for name in (*self.variables, *self.coordinates) for dim in self._file[name].dims}
            found = {dim: self._file.axis(dim) for dim in self._file.sizes if dim in dims}
            for dim, (values, _) in found.items():
                check_drawable(path, dim, values)
            self.axes: dict[str, Floats] = {dim: values for dim, (values, _) in found.items()}
            self._places = {dim: places for dim, (_, places) in found.items()}
            if not all(values.size for values in self.axes.values()):
                raise InputError(f"{path}: holds no cells")
            self.labels: list[str] = self._file.labels
            self._open = stack.pop_all()

    def __enter__(self) -> "Result":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

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

    def require(self, *names: str) -> None:
        """Refuse a file that has lost a parameter (InputError)."""
        derived = {"amplitude"} if {"displacement_amplitude", "frequency"} <= {*self.coordinates} else set()
        for name in names:
            if name not in derived.union(self.coordinates):
                raise InputError(f"{self.path}: {name}: not in the file, but this chart needs it")

    def axis(self, name: str) -> str:
        """`name` if it is an axis with more than one value.

        Raises
        ------
        InputError
            Naming the axes there are.
        """
        if name in self.wide:
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

    def nearest(self, at: Mapping[str, float | str]) -> dict[str, int]:
        """Where on the axes the values nearest to those asked for are.

        Parameters
        ----------
        at : mapping of axis name to value
            In the axis's own unit, or a text with another ("0.3g"); for ``case`` its number or label.
            A parameter that is one number for the whole file may be named too, with that number.

        Returns
        -------
        dict of str to int
            Indices into `axes`.

        Raises
        ------
        InputError
            An axis that is not there, or a value beyond its range by more than half a step.
        """
        found = {}
        for name, value in at.items():
            known = [*self.axes, *(c for c in self.coordinates if not self.dims(c))]
            if name not in known:
                raise InputError(f"{self.path}: {name} = {value}: no such axis; {_suggest(name, known)}")
            if name == "case" and isinstance(value, str) and value in self.labels:
                found[name] = self.labels.index(value)
                continue
            number = self._number(name, value)
            values = self.axes[name] if name in self.axes else np.atleast_1d(self.read(name, {}))
            steps = np.diff(values)
            # an axis of one value takes that value, give or take its rounding
            low, high = (steps[0] / 2, steps[-1] / 2) if steps.size else (1e-6 * abs(values[0]),) * 2
            slack = 1e-12 * abs(values).max()
            if not values[0] - low - slack <= number <= values[-1] + high + slack:
                unit = _COORDINATES[name]["units"] if name in _COORDINATES else "1"
                there = f"{values[0]:.6g} to {values[-1]:.6g}" if values.size > 1 else f"{values[0]:.6g}"
                raise InputError(
                    f"{self.path}: {name} = {number:.6g}: outside the file's range, {there}"
                    + ("" if unit == "1" else f" {unit}")
                )
            if name in self.axes:
                found[name] = int(np.argmin(np.abs(values - number)))
        return found

    def _number(self, name: str, value: float | str) -> float:
        """A value on an axis in the axis's own unit."""
        try:
            return float(value)
        except ValueError:
            if name == "case":
                allowed = f"a number or one of {', '.join(self.labels)}"
                raise InputError(f"{self.path}: {name} = {value}: must be {allowed}") from None
        from slipsweep.model.units import quantity

        # of the same unit
        parameter = name if name in PARAMETERS else "displacement_amplitude" if name == "threshold" else "mu_s"
        return quantity(f"{self.path}: {name}", str(value), parameter, float(self.attrs["g"]))

    # --------------------------------------------------------------------------- reading

    def select(
        self, names: Iterable[str], keep: Mapping[str, slice | Sequence[int]], at: Mapping[str, float | str]
    ) -> Table:
        """Read a slice.

        Parameters
        ----------
        names : iterable of str
            Results.
        keep : mapping of axis to slice or indices
            The axes that stay, and what of them to read; they may be missing from a result.
        at : mapping of axis to value
            Where to cut the other axes: at the nearest value.  Those not named are cut in the middle.

        Returns
        -------
        Table
            With every parameter as a coordinate: along the axes kept, or of one value.

        Raises
        ------
        InputError
            As `nearest`, or an axis that is both kept and cut.
        """
        for name in at:
            if name in keep:
                raise InputError(
                    f"{self.path}: {name} = {at[name]}: is an axis of this chart; it cannot be cut there too"
                )
        indices = self.nearest(at)
        where: dict[str, Any] = {}
        for dim, values in self.axes.items():
            where[dim] = keep[dim] if dim in keep else indices.get(dim, 0 if dim == "case" else (values.size - 1) // 2)

        def variable(name: str) -> Variable:
            dims = self.dims(name)
            attrs = _COORDINATES[name] if name in self.coordinates else _RESULTS[name]
            return Variable(tuple(dim for dim in dims if dim in keep), self.read(name, where), attrs)

        coords = {name: variable(name) for name in self.coordinates}
        if {"displacement_amplitude", "frequency"} <= coords.keys() and "amplitude" not in coords:
            coords["amplitude"] = amplitude_of(coords["displacement_amplitude"], coords["frequency"])
        chosen = {"case": self.labels[where["case"]]} if self.labels and "case" not in keep else {}
        attrs = {**self.attrs, **chosen}
        return Table(coords, {name: variable(name) for name in names}, attrs)

    def thinned(self, dim: str) -> slice:
        """A slice of an axis of `MOST_POINTS` values at most."""
        size = self.axes[dim].size
        return slice(0, size, math.ceil(size / MOST_POINTS))

    def spread(self, dim: str, number: int) -> list[int]:
        """Indices of `number` values at most, from end to end of an axis."""
        size = self.axes[dim].size
        return sorted({round(i) for i in np.linspace(0, size - 1, min(number, size))})


def check_drawable(path: Path, name: str, values: NDArray[Any], most: float = _MOST) -> None:
    """Refuse numbers that no drawing library can place (InputError)."""
    beyond = values[np.abs(values) > np.float64(most)]  # np.float64: single precision would make it infinite
    if beyond.size:
        raise InputError(f"{path}: {name}: holds {beyond.flat[0]:.4g}; what is drawn must be within +-{most:g}")


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
    for name, attributes in [*_COORDINATES.items(), *_RESULTS.items()]:
        found = file[name].attrs.get("units") if name in file else None
        if found and found != attributes.get("units", found):
            raise InputError(f'{file.path}: {name}: units = "{found}"; must be "{attributes["units"]}"')
    options = (
        "model",
        "g",
        "cycles",
        "waveform",
        *(("rise", "recoupling") if file.attrs.get("model") == "mendez" else ()),
    )
    for name in options:  # none has its default: what has been solved is not known any more
        if name not in file.attrs:
            raise InputError(f"{file.path}: attribute {name!r}: missing; it says what was solved")
    try:
        MODELS.from_attributes(file.attrs)
        WAVEFORMS.from_attributes(file.attrs)
        drawn_text(file.attrs)
    except (ValueError, TypeError) as error:  # InputError, and what numpy says of arrays
        raise InputError(f"{file.path}: {error}") from None


def _list(names: Sequence[str]) -> str:
    return f"there {'is' if len(names) == 1 else 'are'} {', '.join(names)}" if names else "there is none"


def _suggest(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return (f'did you mean "{near[0]}"? ' if near else "") + _list(known)


# ------------------------------------------------------------- what is computed on a slice


def amplitude_of(displacement_amplitude: Variable, frequency: Variable) -> Variable:
    """The amplitude A = ω²d on a slice: files do not hold it where d and the frequency span a grid."""
    from slipsweep.motion.amplitude import peak_acceleration

    dims = (*displacement_amplitude.dims, *(dim for dim in frequency.dims if dim not in displacement_amplitude.dims))
    both = (
        variable.values.reshape([variable.sizes.get(dim, 1) for dim in dims])
        for variable in (displacement_amplitude, frequency)
    )
    return Variable(dims, np.asarray(peak_acceleration(*both), np.float64), PARAMETERS["amplitude"])


def boundaries(table: Table) -> dict[str, Variable]:
    """Yield acceleration and, but for Newmark's block, limiting acceleration (Eq. 7) of a slice, m/s².

    Returns
    -------
    dict of str to Variable
        ``yield_acceleration`` and ``limiting_acceleration`` along those dimensions of the slice that
        they depend on; NaN where the block slides under its own weight.
    """
    from slipsweep.grid.plans import plan_friction_parameters
    from slipsweep.model.options import Mendez

    given = {name: table[name] for name in ("theta", "mu_s", "yield_acceleration") if name in table.coords}
    # neither depends on the amplitude, nor on what it is taken for otherwise
    found = plan_friction_parameters(
        amplitude=0.0, delta_mu=0.0, decay_rate=0.0, model=Mendez(g=float(table.attrs["g"])), **given
    ).solve()
    slides_at_rest = found["yield_acceleration"].values <= 0
    limit = found["limiting_acceleration"]
    unstable = found["validity"].values != 0
    lines = {
        "yield_acceleration": replace(
            found["yield_acceleration"], values=np.where(slides_at_rest, np.nan, found["yield_acceleration"].values)
        ),
        "limiting_acceleration": replace(limit, values=np.where(unstable, np.nan, limit.values)),
    }
    return lines if table.attrs["model"] != "newmark" else {"yield_acceleration": lines["yield_acceleration"]}


def newmark(table: Table) -> Variable:
    """Permanent displacement of Newmark's block on the cells of a slice, swept anew."""
    from slipsweep.grid.plans import plan_sweep
    from slipsweep.model.options import Newmark

    drive = "displacement_amplitude" if "displacement_amplitude" in table.coords else "amplitude"
    given = ("theta", "mu_s", drive, "frequency", "yield_acceleration")
    plan = plan_sweep(
        **{name: table[name] for name in given if name in table.coords},
        model=Newmark(g=float(table.attrs["g"])),
        excitation=WAVEFORMS.from_attributes(table.attrs),
        variables=["permanent_displacement"],
    )
    return plan.solve()["permanent_displacement"]
