"""Statistics of the displacement at every grid point: quantiles, mean, probabilities, shares of modes and flags."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid import threads
from slipsweep.model.parameters import number_text
from slipsweep.model.variables import STATISTIC_COORDINATES, SlidingMode, Validity
from slipsweep.studies.sampling import Sampling

Floats = NDArray[np.float64]

#: Statistics and the dimensions that they have beside those of the grid.
_STATISTICS: dict[str, tuple[str, ...]] = {
    "displacement_quantile": ("quantile",),
    "mean_displacement": (),
    "exceedance_probability": ("threshold",),
    "mode_share": ("mode",),
    "flag_share": ("flag",),
    "valueless_share": (),
}

#: Those that depend on the frequency even where the samples do not.
_BY_FREQUENCY = ("displacement_quantile", "mean_displacement", "exceedance_probability")

#: Draws that are put in order, where each meets many grid points: to sort a million takes longer than to solve them.
_MOST_ORDERED = 65536

#: Inputs that move a block the more, and the less, the larger they are.
_SHAKING = ("amplitude", "displacement_amplitude")
_RESISTANCE = ("mu_s", "yield_acceleration")


class SampleStatistics:
    """Statistics of samples: what `SamplePlan` makes of runs (`uncertainty.Study`).

    Parameters
    ----------
    sampling : Sampling
    recorded : bool
        Whether a record shakes the block: then there is no sliding mode.
    """

    by_frequency = _BY_FREQUENCY

    # sorting and counting are part of what a sample takes
    work = 0
    memory = 0

    def __init__(self, sampling: Sampling, recorded: bool) -> None:
        self._sampling, self._recorded = sampling, recorded
        self.runs = sampling.samples
        self.draws: Mapping[str, Floats] = _alike_together(sampling.draws())
        self.results: Mapping[str, tuple[str, ...]] = {
            name: dims for name, dims in _STATISTICS.items() if not (recorded and name == "mode_share")
        }

    @property
    def coords(self) -> dict[str, xr.Variable]:
        """Quantiles, thresholds, modes and flags."""
        values: dict[str, NDArray[Any]] = {
            "quantile": self._sampling.quantiles,
            "threshold": self._sampling.thresholds,
            "mode": np.array([int(mode) for mode in SlidingMode if mode is not SlidingMode.MISSING], np.int8),
            "flag": np.array([int(flag) for flag in Validity], np.int16),
        }
        own = {dim for dims in self.results.values() for dim in dims}
        return {dim: xr.Variable((dim,), one, STATISTIC_COORDINATES[dim]) for dim, one in values.items() if dim in own}

    def reduce(self, solved: Mapping[str, NDArray[Any]], frequency: Floats) -> dict[str, NDArray[Any]]:
        """Statistics of the samples of each cell (rows), for each of its frequencies (columns)."""
        rows, squares = frequency.shape[0], frequency**2
        rows_of = {name: values.reshape(rows, -1) for name, values in solved.items()}
        displacement, flags, modes = (
            rows_of["permanent_displacement"],
            rows_of["validity"],
            rows_of.get("sliding_mode"),
        )
        samples = displacement.shape[1]
        quantiles, thresholds = self._sampling.quantiles, self._sampling.thresholds
        found = {
            "displacement_quantile": np.full((*squares.shape, quantiles.size), np.nan),
            "mean_displacement": np.full(squares.shape, np.nan),
            "exceedance_probability": np.full((*squares.shape, thresholds.size), np.nan),
            **({} if modes is None else {"mode_share": np.empty((rows, 3))}),
            "flag_share": np.empty((rows, len(Validity))),
            "valueless_share": np.empty(rows),
        }
        modes_known = [int(mode) for mode in SlidingMode if mode is not SlidingMode.MISSING]
        flags_known = [int(flag) for flag in Validity]

        def work(first: int, last: int) -> None:
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite then is refused below
                for row in range(first, last):
                    values = displacement[row]
                    values.sort()  # NaN goes last
                    count = int(np.searchsorted(values, np.nan))
                    if modes is not None:
                        shares = [np.count_nonzero(modes[row] == mode) / samples for mode in modes_known]
                        found["mode_share"][row] = shares
                    # of most flags there is none
                    raised = int(np.bitwise_or.reduce(flags[row]))
                    flagged = {
                        flag: np.count_nonzero(flags[row] & flag) if raised & flag else 0 for flag in flags_known
                    }
                    found["flag_share"][row] = [number / samples for number in flagged.values()]
                    found["valueless_share"][row] = (samples - count) / samples
                    there, square = values[:count], squares[row][:, None]
                    # these slide without any shaking: their displacement has no value and exceeds every threshold
                    unstable = flagged[Validity.STATICALLY_UNSTABLE]
                    if count + unstable:
                        above = count - np.searchsorted(there, thresholds * square, side="right")
                        found["exceedance_probability"][row] = (above + unstable) / (count + unstable)
                    if count:
                        found["displacement_quantile"][row] = _quantiles(there, quantiles) / square
                        found["mean_displacement"][row] = there.mean() / squares[row]

        # sorting and counting take about an eighth of what solving takes
        threads.spread(rows, work, max(samples // 8, 1))
        for name in ("displacement_quantile", "mean_displacement"):
            there = found["valueless_share"][:, None] < 1.0
            wrong = (~np.isfinite(found[name].reshape(*squares.shape, -1)).all(axis=-1)) & there
            if wrong.any():
                worst = number_text(float(frequency[wrong].flat[0]))
                clock = "1 / time_scale" if self._recorded else "frequency"
                raise InputError(f"{clock} = {worst}: {name} is then no finite number; must be nearer to 1")
        return found


def _alike_together(draws: Mapping[str, Floats]) -> Mapping[str, Floats]:
    """The same draws in another order: from those that move a block least to those that move it most, about.

    Cells that a kernel solves together then tend to be in one mode: fragility curves take 0.8 of the time.
    """
    samples = next(iter(draws.values())).size
    if samples > _MOST_ORDERED:
        return draws
    severity = np.ones(samples)
    with np.errstate(all="ignore"):  # whatever comes out, every order gives the same statistics
        for name, values in draws.items():
            if name in _SHAKING:
                severity *= values
            elif name in _RESISTANCE:
                severity /= values
    order = np.argsort(severity)
    return {name: values[order] for name, values in draws.items()}


def _quantiles(ordered: Floats, wanted: Floats) -> Floats:
    """Quantiles of sorted values, linear between them (numpy's default)."""
    place = wanted * (ordered.size - 1)
    below = np.floor(place).astype(np.intp)
    above = np.minimum(below + 1, ordered.size - 1)
    return np.asarray(ordered[below] + (place - below) * (ordered[above] - ordered[below]))
