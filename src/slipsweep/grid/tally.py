"""Counts of sliding modes and flags over a grid, and the spread of the displacement about Newmark's."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.model.variables import SensitivityStatus, SlidingMode, Validity

#: Ratios are counted in this many classes of equal width in their logarithms, 0.1 % wide, between these.
_CLASSES, _LEAST, _LARGEST = 32_000, 1e-7, 1e7


@dataclass
class Ratios:
    """Ratios of displacements, counted in classes, so that those of any number of cells take little memory."""

    counts: NDArray[np.int64]

    @classmethod
    def of(cls, values: NDArray[Any], others: NDArray[Any]) -> "Ratios":
        """Count values over others, where neither is zero or missing; a negative one as the least."""
        there = (values != 0.0) & (others != 0.0) & np.isfinite(values) & np.isfinite(others)
        ratios = np.clip(np.divide(values[there], others[there], dtype=np.float64), _LEAST, _LARGEST)
        return cls(np.histogram(np.log(ratios), _CLASSES, (math.log(_LEAST), math.log(_LARGEST)))[0])

    @property
    def number(self) -> int:
        """How many there are."""
        return int(self.counts.sum())

    def quantile(self, share: float) -> float:
        """The ratio that a share of them does not exceed; NaN of none."""
        if not self.number:
            return math.nan
        at = int(np.searchsorted(np.cumsum(self.counts), share * self.number))
        return float(_LEAST * (_LARGEST / _LEAST) ** ((at + 0.5) / _CLASSES))


@dataclass
class Indices:
    """Sobol indices of grid points, counted."""

    status: dict[SensitivityStatus, int]  # grid points with indices, and without for each reason
    first: dict[str, float]  # sums of the indices of each input
    total: dict[str, float]
    largest: dict[str, int]  # grid points at which the total index of an input is the largest

    @classmethod
    def counted(
        cls, inputs: Sequence[str], first: NDArray[Any], total: NDArray[Any], status: NDArray[Any]
    ) -> "Indices":
        """Count indices, whose last dimension is that of the inputs, and their status."""
        by_status = {one: int(np.count_nonzero(status == int(one))) for one in SensitivityStatus}
        both = np.stack([first, total]).reshape(2, -1, len(inputs)).astype(np.float64)
        # a file may have passed through other programs
        rows = both[:, (status.ravel() == 0) & np.isfinite(both).all(axis=(0, 2))]
        largest = np.bincount(rows[1].argmax(axis=1), minlength=len(inputs)).tolist()
        by_input = [dict(zip(inputs, values, strict=True)) for values in (*rows.sum(axis=1).tolist(), largest)]
        return cls(by_status, *by_input)

    def mean(self, sums: Mapping[str, float], name: str) -> float:
        """The mean of one of the sums over all grid points with indices."""
        return sums[name] / max(self.status[SensitivityStatus.COMPUTED], 1)


@dataclass
class Tally:
    """Counts of cells, and among them of each sliding mode and each flag, and displacements over Newmark's.

    None: not stored.  Modes and flags are of all cells, or of `counted` if that is not 0.
    """

    cells: int = 0
    modes: dict[SlidingMode, int] | None = None
    flags: dict[Validity, int] | None = None
    ratios: Ratios | None = None
    indices: Indices | None = None
    counted: int = 0

    @classmethod
    def of(cls, results: xr.Dataset) -> "Tally":
        """Count results; what is not counted is not read."""
        tally = cls()
        if "sliding_mode" in results:
            modes = results["sliding_mode"].values
            tally.modes = {mode: int(np.count_nonzero(modes == int(mode))) for mode in SlidingMode}
        if "validity" in results:
            validity = results["validity"].values.astype(np.int16, copy=False)
            tally.flags = {flag: int(np.count_nonzero(validity & flag.value)) for flag in Validity}
        if {"permanent_displacement", "newmark_displacement"} <= results.keys():
            tally.ratios = Ratios.of(results["permanent_displacement"].values, results["newmark_displacement"].values)
        return tally

    def share(self, count: int) -> float:
        """A count of a mode or a flag over all that was counted."""
        return count / (self.counted or self.cells)

    def merge(self, other: "Tally") -> None:
        """Add the counts of other cells."""
        vars(self).update(vars(_added(self, other)))


def _added(one: Any, other: Any) -> Any:
    """Counts, or dictionaries or classes of them, added one by one; None is not stored."""
    if one is None or other is None:
        return one if other is None else other
    if isinstance(one, dict):
        return {name: _added(count, other[name]) for name, count in one.items()}
    if isinstance(one, (Ratios, Indices, Tally)):
        return replace(one, **_added(vars(one), vars(other)))
    return one + other
