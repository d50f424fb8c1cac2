"""Results that are drawn as a whole, not in slices: histories, limits, tests on a shaking table, annual rates."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts import calibration_figures, figures, hazard_figures, limit_figures
from slipsweep.charts.slices import check_units
from slipsweep.errors import InputError
from slipsweep.files.results import ResultFile, read_table
from slipsweep.model.variables import (
    CALIBRATION_SERIES,
    HALF_WAVES,
    HAZARD_RESULTS,
    HISTORY,
    LIMIT_RESULTS,
    PARAMETERS,
    SLIDES,
    STATISTIC_COORDINATES,
)

#: A variable that only a result of the kind has, and what draws it.
DRAWN_WHOLE: dict[str, tuple[str, Callable[[xr.Dataset, Axes | None], Figure]]] = {
    "limit": ("limit_amplitude", limit_figures.limit_chart),
    "calibration": ("computed_ground_acceleration", calibration_figures.calibration),
    "friction": ("friction_ratio", calibration_figures.friction),
    "hazard": ("annual_rate", hazard_figures.hazard_chart),
    "history": ("relative_displacement", figures.history),
}

#: Variables that the charts take in the units that slipsweep writes.
_DESCRIBED = {
    **PARAMETERS,
    **STATISTIC_COORDINATES,
    **HISTORY,
    **HALF_WAVES,
    **LIMIT_RESULTS,
    **HAZARD_RESULTS,
    **SLIDES,
    **CALIBRATION_SERIES,
}

#: Samples of the record that a file carries: no chart shows them.
_SAMPLES = ("record_time", "record_acceleration")


def whole_kind(file: ResultFile) -> str | None:
    """The kind of chart of a result that is drawn as a whole; None of others."""
    return next((kind for kind, (name, _) in DRAWN_WHOLE.items() if name in file), None)


class WholeResult:
    """A result that is drawn as a whole.

    Parameters
    ----------
    file : ResultFile
    kind : str
        What `whole_kind` says of it.

    Attributes
    ----------
    path : Path
    g : float
        Gravity, m/s².

    Raises
    ------
    InputError
        Another program has put values into other units.
    """

    def __init__(self, file: ResultFile, kind: str) -> None:
        self.path: Path = file.path
        self.kind = kind
        check_units(file, _DESCRIBED)
        self.g = float(file.attrs.get("g", 9.81))
        dims = set(file[DRAWN_WHOLE[kind][0]].dims)
        names = [
            name
            for name in file.results
            if name not in _SAMPLES and not file[name].is_text and (kind != "limit" or dims.issuperset(file[name].dims))
        ]
        self._table = read_table(file, names)
        if file.labels:
            self._table.attrs["labels"] = {"case": file.labels}

    def draw(self, axes: Axes | None) -> Figure:
        """Draw it, in `axes` if it is one panel (InputError if not, or if something is missing)."""
        try:
            return DRAWN_WHOLE[self.kind][1](self._table, axes)
        except KeyError as error:
            missing: Any = error.args[0]
            raise InputError(f"{self.path}: {missing}: not there, but a chart of {self.kind} needs it") from None
