"""Which uncertain input moves the displacement: Sobol indices with bootstrap intervals, at every grid point.

Two sets of draws, A and B; and for each of k inputs a third that is A but for this input, which is B's: k + 2 runs for
each sample.  The estimators are those of Saltelli et al. (2010, doi:10.1016/j.cpc.2009.09.018, Table 2, b and f), as
`scipy.stats.sobol_indices` has them; it has no way to seed its bootstrap, and the same run could not be made again.

u = W/ω²: indices do not depend on the frequency where the runs do not.
"""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.grid import threads
from slipsweep.model.variables import STATISTIC_COORDINATES, SensitivityStatus
from slipsweep.studies.sampling import Sampling

Floats = NDArray[np.float64]

#: Resamples of the bootstrap, and the shares of them below the ends of an interval.
RESAMPLES = 1000
ENDS = (0.025, 0.975)

#: Most parts that a bootstrap resamples: of more samples, neighbours go together.
_PARTS = 1024

#: Grid points whose intervals are found together (5 MB).
_ROWS = 64

#: Runs that differ by less, of their largest displacement, differ by rounding.
_SAME = 1e-12

#: What the indices of a grid point take, in cells of the cycle solver.
_WORK = 30_000


class Sensitivity:
    """Sobol indices of the permanent displacement: what `SamplePlan` makes of runs (`uncertainty.Study`).

    Parameters
    ----------
    sampling : Sampling
        Inputs that are correlated count as one: indices are of inputs that are independent.

    Attributes
    ----------
    draws : dict of str to ndarray
        Of each parameter `runs` values: of A, of B, and of A with each input from B.
    """

    by_frequency: tuple[str, ...] = ()
    work = _WORK

    def __init__(self, sampling: Sampling) -> None:
        self.samples, self._seed = sampling.samples, sampling.seed
        self.inputs = sampling.independent
        self.runs = sampling.sensitivity_runs
        first, second = sampling.two_draws()
        self.draws: Mapping[str, Floats] = {
            name: np.concatenate(
                [first[name], second[name], *((second if name in one else first)[name] for one in self.inputs)]
            )
            for name in first
        }
        self.results: Mapping[str, tuple[str, ...]] = {
            "first_order_index": ("input",),
            # in this order: CDO reads no variable whose last dimension but one has texts
            "first_order_interval": ("bound", "input"),
            "total_index": ("input",),
            "total_interval": ("bound", "input"),
            "sensitivity_status": (),
        }

    @property
    def memory(self) -> int:
        """Bytes of the bootstrap, and of the terms of two grid points."""
        return 64 * self.runs + 32 * RESAMPLES * _PARTS + 8 * _ROWS * (2 + 2 * len(self.inputs)) * (_PARTS + RESAMPLES)

    @property
    def coords(self) -> dict[str, xr.Variable]:
        """The inputs, and the ends of the intervals."""
        values: dict[str, NDArray[Any]] = {
            "input": np.array(["+".join(one) for one in self.inputs]),
            "bound": np.array(ENDS),
        }
        return {name: xr.Variable((name,), one, STATISTIC_COORDINATES[name]) for name, one in values.items()}

    @functools.cached_property
    def _weights(self) -> Floats:
        """How often each resample has each part of the samples: (parts, resamples)."""
        parts = self._starts.size
        generator = np.random.default_rng(self._seed)
        drawn: Floats = generator.multinomial(parts, np.full(parts, 1.0 / parts), RESAMPLES).T.astype(np.float64)
        return drawn

    @property
    def _starts(self) -> NDArray[np.intp]:
        """The first sample of each part."""
        return np.arange(0, self.samples, -(-self.samples // _PARTS))

    def reduce(self, solved: Mapping[str, NDArray[Any]], frequency: Floats) -> dict[str, NDArray[Any]]:
        """Indices of each cell (rows), its status, and intervals."""
        inputs = len(self.inputs)
        displacement = solved["permanent_displacement"].reshape(-1, inputs + 2, self.samples)
        rows = displacement.shape[0]
        indices, intervals = np.full((2, rows, inputs), np.nan), np.full((2, rows, 2, inputs), np.nan)
        status = np.empty(rows, np.int8)
        starts = self._starts
        counts = np.diff(starts, append=self.samples).astype(np.float64) @ self._weights
        # some rows at a time: a product of matrices for each would take as long again to start its threads
        for begin in range(0, rows, _ROWS):
            parts = np.zeros((min(_ROWS, rows - begin), 2 + 2 * inputs, starts.size))

            def count(first: int, last: int, begin: int = begin, parts: Floats = parts) -> None:
                for row in range(first, last):
                    runs = displacement[begin + row]
                    status[begin + row] = found = _status(runs)
                    if found == SensitivityStatus.COMPUTED:
                        terms = _terms(runs)
                        indices[:, begin + row] = _indices(terms.sum(axis=-1), float(self.samples))
                        parts[row] = np.add.reduceat(terms, starts, axis=-1)

            threads.spread(len(parts), count, _WORK // 2)
            sums = (_exact(parts).reshape(-1, starts.size) @ self._weights).reshape(*parts.shape[:2], -1)

            def bound(first: int, last: int, begin: int = begin, sums: Floats = sums) -> None:
                for row in range(first, last):
                    resampled = _indices(sums[row], counts)
                    there = np.isfinite(resampled[0, 0])  # a resample may have no variance, and a row no indices
                    if there.any():
                        found = np.quantile(resampled[..., there], ENDS, axis=-1)
                        intervals[:, begin + row] = np.moveaxis(found, 0, 1)

            threads.spread(len(parts), bound, _WORK // 2)
        return {
            "first_order_index": indices[0],
            "first_order_interval": intervals[0],
            "total_index": indices[1],
            "total_interval": intervals[1],
            "sensitivity_status": status,
        }


def _status(runs: Floats) -> SensitivityStatus:
    """Whether runs have indices."""
    low, high = runs.min(), runs.max()
    if np.isnan(low):
        return SensitivityStatus.RUNS_WITHOUT_VALUE
    # B's variance is A's: what differs in other runs only is too rare for so many samples
    spread = np.ptp(runs[:2])
    same = spread <= _SAME * max(-low, high)
    return SensitivityStatus.NO_VARIANCE if same else SensitivityStatus.COMPUTED


def _terms(runs: Floats) -> Floats:
    """What the indices are means of, a column a sample: y, y² of A and B, and of each input both numerators."""
    runs = runs / np.abs(runs).max()  # squares of no number are too large
    first, second, *others = runs - runs[:2].mean()
    return np.stack(
        [
            first + second,
            first**2 + second**2,
            *(second * (other - first) for other in others),
            *(0.5 * (first - other) ** 2 for other in others),
        ]
    )


def _indices(sums: Floats, count: Any) -> Floats:
    """First-order and total indices from sums of `_terms` of so many samples: (2, inputs, ...)."""
    means = sums / count
    variance = means[1] / 2.0 - (means[0] / 2.0) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        found = means[2:] / np.where(variance > 0.0, variance, np.nan)
    return found.reshape(2, -1, *found.shape[1:])


def _exact(parts: Floats) -> Floats:
    """Terms to 41 bits of the largest: a sum of 1024 of them is exact, hence the same in whatever order."""
    largest = np.maximum(np.abs(parts).max(axis=-1, keepdims=True), 1e-200)  # all of them may be 0
    step = np.ldexp(1.0, np.frexp(largest)[1] - 41)
    return np.asarray(np.rint(parts / step) * step)
