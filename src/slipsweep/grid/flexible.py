"""The flag `flexible_block` of blocks that are not rigid, as their structure responds."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipsweep.model.variables import Validity

#: Ratios f/fs of the frequency to the natural frequency of the structure between which a block is
#: not rigid (paper, section 4.1, after Wartman et al.).
LEAST_RATIO = 0.2
LARGEST_RATIO = 1.3

#: Elements that are flagged at a time: all ratios at once would take four times the memory of the
#: flags.
_AT_A_TIME = 16384


def flag_flexible_blocks(
    validity: NDArray[np.int16], frequency: NDArray[Any], structure_frequency: NDArray[Any]
) -> None:
    """Add the flag to `validity` where 0.2 ≤ f/fs ≤ 1.3; the frequencies (Hz) broadcast to it."""
    with np.nditer(
        [validity, frequency, structure_frequency],
        ["external_loop", "buffered", "zerosize_ok"],
        [["readwrite"], ["readonly"], ["readonly"]],
        buffersize=_AT_A_TIME,
    ) as pieces:
        for flags, f, fs in pieces:
            ratio = f / fs
            is_flexible = (ratio >= LEAST_RATIO) & (ratio <= LARGEST_RATIO)
            flags |= is_flexible * np.int16(Validity.FLEXIBLE_BLOCK)
