"""Counts of sliding modes and flags over a grid."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.model.variables import SlidingMode, Validity


@dataclass
class Tally:
    """Counts of cells, and among them of each sliding mode and each flag (None: not stored)."""

    cells: int = 0
    modes: dict[SlidingMode, int] | None = None
    flags: dict[Validity, int] | None = None

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

    def merge(self, other: "Tally") -> None:
        """Add the counts of other cells."""
        self.cells += other.cells
        if other.modes is not None:
            self.modes = {mode: (self.modes or {}).get(mode, 0) + count for mode, count in other.modes.items()}
        if other.flags is not None:
            self.flags = {flag: (self.flags or {}).get(flag, 0) + count for flag, count in other.flags.items()}
