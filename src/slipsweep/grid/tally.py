"""Counts of sliding modes and flags over a grid, and the spread of the displacement about Newmark's."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.model.variables import SlidingMode, Validity

#: Bits that are left off a ratio in single precision where ratios are counted: to one part in a thousand.
_LEFT_OFF = 13


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
        there = np.isfinite(values) & np.isfinite(others) & (values != 0.0) & (others != 0.0)
        if not there.any():
            return
        with np.errstate(over="ignore", under="ignore"):
            bits = np.divide(values[there], others[there], dtype=np.float32).view(np.int32)
        # as integers, negative numbers in single precision are in reverse order
        keys = (bits ^ ((bits >> 31) & np.int32(0x7FFFFFFF))) >> _LEFT_OFF
        least = int(keys.min())
        counts = np.bincount(keys - least)
        for at in np.flatnonzero(counts).tolist():
            self.counts[least + at] = self.counts.get(least + at, 0) + int(counts[at])

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


@dataclass
class Tally:
    """Counts of cells, and among them of each sliding mode and each flag, and displacements over Newmark's.

    None: not stored.
    """

    cells: int = 0
    modes: dict[SlidingMode, int] | None = None
    flags: dict[Validity, int] | None = None
    ratios: Ratios | None = None

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
        if other.modes is not None:
            self.modes = {mode: (self.modes or {}).get(mode, 0) + count for mode, count in other.modes.items()}
        if other.flags is not None:
            self.flags = {flag: (self.flags or {}).get(flag, 0) + count for flag, count in other.flags.items()}
        if other.ratios is not None:
            self.ratios = self.ratios or Ratios()
            self.ratios.merge(other.ratios)
