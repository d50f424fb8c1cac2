"""Counts of sliding modes and flags over a grid, and the spread of the displacement about Newmark's."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.grid.chunks import slabs
from slipsweep.model.variables import SensitivityStatus, SlidingMode, Validity

#: Bits that are left off a ratio in single precision where ratios are counted, to one part in a thousand; and how many
#: different ones are left.
_LEFT_OFF = 13
_KEYS = 2 ** (32 - _LEFT_OFF)

#: Ratios that are counted at a time: numpy keeps other threads waiting meanwhile, among them the one that writes.  With
#: those of a chunk at once a run of 1.9 GB takes 5 % longer.
_TOGETHER = 65536


def _keys(values: NDArray[Any], others: NDArray[Any]) -> NDArray[np.int32]:
    """Values over others, where neither is zero or missing, as whole numbers in the same order."""
    there = np.isfinite(values) & np.isfinite(others) & (values != 0.0) & (others != 0.0)
    with np.errstate(over="ignore", under="ignore"):
        bits = np.divide(values[there], others[there], dtype=np.float32).view(np.int32)
    # as integers, negative numbers in single precision are in reverse order
    return (bits ^ ((bits >> 31) & np.int32(0x7FFFFFFF))) >> _LEFT_OFF


@dataclass
class Ratios:
    """Ratios counted to one part in a thousand, so that those of any number of cells take little room.

    `counts` has the number of each; its keys are ratios as `_keys` gives them, in their order.
    """

    counts: dict[int, int] = field(default_factory=dict)

    @property
    def number(self) -> int:
        """How many there are."""
        return sum(self.counts.values())

    def add(self, values: NDArray[Any], others: NDArray[Any]) -> None:
        """Count values over others, where neither is zero or missing."""
        found = np.zeros(_KEYS, np.int64)  # memory that is not used takes none
        for slab in slabs(values.shape, _TOGETHER):
            keys = _keys(values[slab], others[slab]) + _KEYS // 2
            if keys.size:
                least = int(keys.min())
                counts = np.bincount(keys - least)
                found[least : least + counts.size] += counts
        for at in np.flatnonzero(found).tolist():
            key = at - _KEYS // 2
            self.counts[key] = self.counts.get(key, 0) + int(found[at])

    def merge(self, other: "Ratios") -> None:
        """Add the counts of other cells."""
        for key, count in other.counts.items():
            self.counts[key] = self.counts.get(key, 0) + count

    def quantile(self, share: float) -> float:
        """The ratio that a share of them does not exceed; NaN of none."""
        below, wanted = 0, share * self.number
        for key in sorted(self.counts):
            below += self.counts[key]
            if below >= wanted:
                middle = np.int32((key << _LEFT_OFF) + (1 << (_LEFT_OFF - 1)))
                return float((middle ^ ((middle >> 31) & np.int32(0x7FFFFFFF))).view(np.float32))
        return math.nan


#: What Sobol indices are summed in: whole numbers have the same sum in any order.
_MILLIONTH = 1e-6


@dataclass
class Indices:
    """Sobol indices of grid points, counted.

    Attributes
    ----------
    status : dict of SensitivityStatus to int
        Grid points with indices, and without for each reason.
    first, total : dict of str to int
        Sums of the indices of each input, in millionths.
    largest : dict of str to int
        Grid points at which the total index of this input is the largest.
    """

    status: dict[SensitivityStatus, int]
    first: dict[str, int]
    total: dict[str, int]
    largest: dict[str, int]

    @classmethod
    def counted(
        cls, inputs: Sequence[str], first: NDArray[Any], total: NDArray[Any], status: NDArray[Any]
    ) -> "Indices":
        """Count indices, whose last dimension is that of the inputs, and their status."""
        by_status = {one: int(np.count_nonzero(status == int(one))) for one in SensitivityStatus}
        both = np.stack([first, total]).reshape(2, -1, len(inputs)).astype(np.float64)
        # a file may have passed through other programs
        rows = both[:, (status.ravel() == 0) & np.isfinite(both).all(axis=(0, 2))]
        sums = np.rint(np.clip(rows, -1e6, 1e6) / _MILLIONTH).astype(np.int64).sum(axis=1).tolist()
        largest = np.bincount(rows[1].argmax(axis=1), minlength=len(inputs)).tolist()
        by_input = [dict(zip(inputs, values, strict=True)) for values in (*sums, largest)]
        return cls(by_status, *by_input)

    def mean(self, sums: Mapping[str, int], name: str) -> float:
        """The mean of one of the sums over all grid points with indices."""
        return sums[name] * _MILLIONTH / max(self.status[SensitivityStatus.COMPUTED], 1)

    def merged(self, other: "Indices | None") -> "Indices":
        """Those of other grid points added."""
        if other is None:
            return self
        status = {one: count + other.status[one] for one, count in self.status.items()}
        sums = (
            {name: count + more[name] for name, count in own.items()}
            for own, more in ((self.first, other.first), (self.total, other.total), (self.largest, other.largest))
        )
        return Indices(status, *sums)


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

    def share(self, count: int) -> float:
        """A count of a mode or a flag over all that was counted."""
        return count / (self.counted or self.cells)

    def add(self, results: Mapping[str, NDArray[Any]]) -> None:
        """Count one chunk; `results` holds its arrays by variable name."""
        if "sliding_mode" in results:
            self.modes = self.modes or dict.fromkeys(SlidingMode, 0)
            for mode in SlidingMode:
                # int(): numpy would take a member of an enumeration for 64 bits, and all cells with it
                self.modes[mode] += int(np.count_nonzero(results["sliding_mode"] == int(mode)))
        if "validity" in results:
            self.flags = self.flags or dict.fromkeys(Validity, 0)
            seen = int(np.bitwise_or.reduce(results["validity"], axis=None))
            for flag in Validity(seen & sum(Validity)):
                self.flags[flag] += int(np.count_nonzero(results["validity"] & int(flag)))
        if {"permanent_displacement", "newmark_displacement"} <= results.keys():
            self.ratios = self.ratios or Ratios()
            self.ratios.add(results["permanent_displacement"], results["newmark_displacement"])

    def merge(self, other: "Tally") -> None:
        """Add the counts of other cells."""
        self.cells += other.cells
        self.counted += other.counted
        if other.indices is not None:
            self.indices = other.indices.merged(self.indices)
        if other.modes is not None:
            self.modes = {mode: (self.modes or {}).get(mode, 0) + count for mode, count in other.modes.items()}
        if other.flags is not None:
            self.flags = {flag: (self.flags or {}).get(flag, 0) + count for flag, count in other.flags.items()}
        if other.ratios is not None:
            self.ratios = self.ratios or Ratios()
            self.ratios.merge(other.ratios)
