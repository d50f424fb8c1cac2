"""Counts of sliding modes and flags in results, and ratios of displacements to Newmark's."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid.chunks import CHUNK_CELLS, grid_chunks
from slipsweep.model.variables import SensitivityStatus, SlidingMode, Validity

#: Number of classes of ratios, and the ratios at their ends.  All classes have the same width in
#: the logarithm of the ratio, 0.1 %.
_CLASSES = 32_000
_LEAST = 1e-7
_LARGEST = 1e7

_MOVED = ("permanent_displacement", "newmark_displacement")


@dataclass
class Ratios:
    """Ratios of displacements, counted in classes: the memory does not grow with the cells."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_CLASSES, np.int64))

    def add(self, values: NDArray[Any], others: NDArray[Any]) -> None:
        """Count the ratios of values to others, where neither is zero or missing.

        A negative ratio counts as the least.
        """
        counted = (values != 0.0) & (others != 0.0) & np.isfinite(values) & np.isfinite(others)
        ratios = np.divide(values[counted], others[counted], dtype=np.float64)
        logarithms = np.log(np.clip(ratios, _LEAST, _LARGEST))
        ends = (math.log(_LEAST), math.log(_LARGEST))
        self.counts += np.histogram(logarithms, _CLASSES, ends)[0]

    @property
    def number(self) -> int:
        """Number of ratios counted."""
        return int(self.counts.sum())

    def quantile(self, share: float) -> float:
        """Return the ratio that a share of all ratios does not exceed (NaN: there are none)."""
        if not self.number:
            return math.nan
        at = int(np.searchsorted(np.cumsum(self.counts), share * self.number))
        return float(_LEAST * (_LARGEST / _LEAST) ** ((at + 0.5) / _CLASSES))


@dataclass
class Indices:
    """Sobol indices of all grid points, summed up.

    `status` counts the grid points of each status.  By input, `first` and `total` are the means of
    its indices, and `largest` is the number of points at which its total index is the largest.
    """

    status: dict[SensitivityStatus, int]
    first: dict[str, float]
    total: dict[str, float]
    largest: dict[str, int]


@dataclass
class Tally:
    """Counts of cells: all of them, and those of each sliding mode and each flag.

    `ratios` are displacements over Newmark's.  None stands for results that are not stored.  In
    results of samples the cells are grid points, and a count is the sum of their shares.
    `unflagged` cells have lost their flags in another program.
    """

    cells: int
    modes: dict[SlidingMode, float] | None = None
    flags: dict[Validity, float] | None = None
    unflagged: int = 0
    ratios: Ratios | None = None
    indices: Indices | None = None

    def share(self, count: float) -> float:
        """Return a count as a share of all cells."""
        return count / max(self.cells, 1)


def tally_of(results: xr.Dataset) -> Tally:
    """Count the results of a Dataset, chunk by chunk; only what is counted is read.

    InputError: sliding modes and flags are not of the same cells.
    """
    if {"flag_share", "flag", "valueless_share"} <= results.variables.keys():
        return _tally_of_samples(results)
    names = [name for name in ("sliding_mode", "validity") if name in results.data_vars]
    if len({results[name].size for name in names}) > 1:
        raise InputError("sliding_mode and validity are not of the same cells")
    tally = Tally(max((results[name].size for name in names), default=0))
    modes = dict.fromkeys(SlidingMode, 0.0)
    flags = dict.fromkeys(Validity, 0.0)
    tally.modes = modes if "sliding_mode" in names else None
    tally.flags = flags if "validity" in names else None
    if (
        results.data_vars.keys() >= {*_MOVED}
        and results[_MOVED[0]].sizes == results[_MOVED[1]].sizes
    ):
        names += _MOVED
        tally.ratios = Ratios()
    widest: Any = max((results[name].sizes for name in names), key=len, default={})
    for chunk in grid_chunks(widest, CHUNK_CELLS) if names else ():
        part = {name: results[name].isel(chunk, missing_dims="ignore").values for name in names}
        for mode in SlidingMode if tally.modes else ():
            modes[mode] += np.count_nonzero(part["sliding_mode"] == int(mode))
        if tally.flags:
            is_lost = np.isnan(part["validity"])
            tally.unflagged += int(np.count_nonzero(is_lost))
            raised = np.where(is_lost, 0, part["validity"]).astype(np.int16, copy=False)
            for flag in Validity:
                flags[flag] += np.count_nonzero(raised & flag.value)
        if tally.ratios:
            tally.ratios.add(part[_MOVED[0]], part[_MOVED[1]])
    return tally


def _tally_of_samples(results: xr.Dataset) -> Tally:
    """Return the sums of the shares of samples over all grid points."""

    def sums(name: str, code: str) -> dict[int, float]:
        shares = results[name].transpose(..., code).values.reshape(-1, results.sizes[code])
        codes = results[code].values.tolist()
        return dict(zip(codes, shares.sum(axis=0, dtype=np.float64), strict=True))

    valueless = results["valueless_share"]
    tally = Tally(
        valueless.size,
        flags={Validity(flag): share for flag, share in sums("flag_share", "flag").items()},
    )
    if {"mode_share", "mode"} <= results.variables.keys():
        tally.modes = {SlidingMode.MISSING: float(valueless.sum(dtype=np.float64))}
        tally.modes |= {
            SlidingMode(mode): share for mode, share in sums("mode_share", "mode").items()
        }
    if {
        "sensitivity_status",
        "first_order_index",
        "total_index",
        "input",
    } <= results.variables.keys():
        status = results["sensitivity_status"]
        both = [
            results[name].transpose(*status.dims, "input").values
            for name in ("first_order_index", "total_index")
        ]
        rows = np.stack(both).reshape(2, -1, results.sizes["input"]).astype(np.float64)
        # another program may have removed some of the values
        rows = rows[:, (status.values.ravel() == 0) & np.isfinite(rows).all(axis=(0, 2))]
        means = rows.sum(axis=1) / max(rows.shape[1], 1)
        largest = np.bincount(rows[1].argmax(axis=1), minlength=rows.shape[2])
        inputs = results["input"].values.astype(str).tolist()
        tally.indices = Indices(
            {code: int(np.count_nonzero(status == int(code))) for code in SensitivityStatus},
            *(dict(zip(inputs, values.tolist(), strict=True)) for values in (*means, largest)),
        )
    return tally
