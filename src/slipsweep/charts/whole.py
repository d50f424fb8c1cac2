"""Results that are drawn as a whole, not in slices: histories, limits, tests on a shaking table, annual rates."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slipsweep.charts.calibration_figures import calibration, friction
from slipsweep.charts.hazard_figures import hazard_chart
from slipsweep.charts.history_figures import history
from slipsweep.charts.limit_figures import limit_chart
from slipsweep.charts.style import Look
from slipsweep.errors import InputError

#: A variable that only a result of the kind has, and what draws it.
DRAWN_WHOLE: dict[str, tuple[str, Callable[[xr.Dataset, Axes | None, Look], Figure]]] = {
    "limit": ("limit_amplitude", limit_chart),
    "calibration": ("computed_ground_acceleration", calibration),
    "friction": ("friction_ratio", friction),
    "hazard": ("annual_rate", hazard_chart),
    "history": ("relative_displacement", history),
}


@dataclass(frozen=True)
class WholeResult:
    """A result that is drawn as a whole.

    Attributes
    ----------
    data : Dataset
    name : str
        What it is called in errors.
    kind : str
        One of `DRAWN_WHOLE`.
    """

    data: xr.Dataset
    name: str
    kind: str

    def draw(self, axes: Axes | None, look: Look) -> Figure:
        """Draw it, in `axes` if it is one panel (InputError if not, or if something is missing)."""
        try:
            return DRAWN_WHOLE[self.kind][1](self.data.load(), axes, look)
        except KeyError as error:
            missing: Any = error.args[0]
            raise InputError(f"{self.name}: {missing}: not there, but a chart of {self.kind} needs it") from None
