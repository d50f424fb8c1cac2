"""Results that are drawn as a whole, not in slices: histories, limits, tests on a shaking table, annual rates."""

from collections.abc import Callable
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts import calibration_figures, hazard_figures, history_figures, limit_figures
from slipsweep.charts.sheet import without_colour
from slipsweep.charts.style import Look
from slipsweep.errors import InputError

#: A variable that only a result of the kind has.
DRAWN_WHOLE: dict[str, str] = {
    "limit": "limit_amplitude",
    "calibration": "computed_ground_acceleration",
    "friction": "friction_ratio",
    "hazard": "annual_rate",
    "history": "relative_displacement",
}

#: What draws a test on a shaking table, which has a size and a caption of its own.
_TESTS: dict[str, Callable[[Any, Axes | None], Figure]] = {
    "calibration": calibration_figures.calibration,
    "friction": calibration_figures.friction,
}


def whole_kind(data: xr.Dataset) -> str | None:
    """The kind of chart of a result that is drawn as a whole; None of others."""
    return next((kind for kind, name in DRAWN_WHOLE.items() if name in data), None)


class WholeResult:
    """A result that is drawn as a whole.

    Parameters
    ----------
    data : Dataset
    name : str
        What it is called in errors.
    kind : str
        What `whole_kind` says of it.
    """

    def __init__(self, data: xr.Dataset, name: str, kind: str) -> None:
        self.name, self.kind = name, kind
        self.g = float(data.attrs.get("g", 9.81))
        self._data = data.load()

    def draw(self, axes: Axes | None, look: Look) -> Figure:
        """Draw it, in `axes` if it is one panel (InputError if not, or if something is missing)."""
        try:
            if self.kind == "limit":
                return limit_figures.limit_chart(self._data, axes, look)
            if self.kind == "hazard":
                return hazard_figures.hazard_chart(self._data, axes, look=look)
            if self.kind == "history":
                return history_figures.history(self._data, axes, look)
            figure = _TESTS[self.kind](self._data, axes)
        except KeyError as error:
            missing: Any = error.args[0]
            raise InputError(f"{self.name}: {missing}: not there, but a chart of {self.kind} needs it") from None
        if look.width is not None:
            width, height = figure.get_size_inches()
            figure.set_size_inches(look.width, height * look.width / width)
        if look.grey:
            without_colour(figure)
        return figure
