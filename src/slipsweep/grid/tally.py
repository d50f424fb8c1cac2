"""Counts of sliding modes and flags in results, and the spread of the displacement about Newmark's."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from slipsweep.errors import InputError
from slipsweep.grid.chunks import CHUNK_CELLS, grid_chunks
from slipsweep.model.variables import SensitivityStatus, SlidingMode, Validity

#: Ratios are counted in this many classes of equal width in their logarithms, 0.1 % wide, between
#: these.
_CLASSES = 32_000
_LEAST = 1e-7
_LARGEST = 1e7

_MOVED = ("permanent_displacement", "newmark_displacement")


@dataclass
class Ratios:
    """Ratios of displacements, counted in classes, so that those of any number of cells take little memory."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_CLASSES, np.int64))

    def add(self, values: NDArray[Any], others: NDArray[Any]) -> None:
        """Count values over others, where neither is zero or missing; a negative one as the least."""
        there = (values != 0.0) & (others != 0.0) & np.isfinite(values) & np.isfinite(others)
        ratios = np.clip(
            np.divide(values[there], others[there], dtype=np.float64), _LEAST, _LARGEST
        )
        self.counts += np.histogram(
            np.log(ratios), _CLASSES, (math.log(_LEAST), math.log(_LARGEST))
        )[0]

    @property
    def number(self) -> int:
        """Number of ratios counted."""
        return int(self.counts.sum())

    def quantile(self, share: float) -> float:
        """The ratio that a share of them does not exceed; NaN of none."""
        if not self.number:
            return math.nan
        at = int(np.searchsorted(np.cumsum(self.counts), share * self.number))
        return float(_LEAST * (_LARGEST / _LEAST) ** ((at + 0.5) / _CLASSES))


@dataclass
class Indices:
    """Sobol indices of grid points: how many have them, or why not; by input the means, and where it is the largest."""

    status: dict[SensitivityStatus, int]
    first: dict[str, float]
    total: dict[str, float]
    largest: dict[str, int]


@dataclass
class Tally:
    """Counts of cells, all and those of each sliding mode and each flag, and displacements over Newmark's.

    None: not stored.  Of samples the cells are grid points, and a count is the sum of their shares.
    `unflagged` cells have lost their flags in another program.
    """

    cells: int
    modes: dict[SlidingMode, float] | None = None
    flags: dict[Validity, float] | None = None
    unflagged: int = 0
    ratios: Ratios | None = None
    indices: Indices | None = None

    def share(self, count: float) -> float:
        """A count over all cells."""
        return count / max(self.cells, 1)


def tally_of(results: xr.Dataset) -> Tally:
    """Count results, read in chunks; what is not counted is not read (InputError: not of the same cells)."""
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
    """Sum up the shares of samples at all grid points."""

    def sums(name: str, own: str) -> dict[int, float]:
        shares = results[name].transpose(..., own).values.reshape(-1, results.sizes[own])
        return dict(
            zip(results[own].values.tolist(), shares.sum(axis=0, dtype=np.float64), strict=True)
        )

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
        # a file may have passed through other programs
        rows = rows[:, (status.values.ravel() == 0) & np.isfinite(rows).all(axis=(0, 2))]
        means = rows.sum(axis=1) / max(rows.shape[1], 1)
        largest = np.bincount(rows[1].argmax(axis=1), minlength=rows.shape[2])
        inputs = results["input"].values.astype(str).tolist()
        tally.indices = Indices(
            {one: int(np.count_nonzero(status == int(one))) for one in SensitivityStatus},
            *(dict(zip(inputs, values.tolist(), strict=True)) for values in (*means, largest)),
        )
    return tally
