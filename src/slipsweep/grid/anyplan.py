"""What all plans have in common: enough to carry them out in chunks, without what solves them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
import xarray as xr

from slipsweep.grid.chunks import Chunk
from slipsweep.grid.tally import Tally


class AnyPlan(Protocol):
    """What every study is, and all that it takes to carry it out in chunks: a grid, and results over it."""

    @property
    def sizes(self) -> Mapping[str, int]:
        """Dimensions of the grid in the order of the results, and their lengths."""

    @property
    def names(self) -> Sequence[str]:
        """Results in the order of the table."""

    @property
    def cells(self) -> int:
        """What there is to solve, in what `progress` counts."""

    @property
    def cost(self) -> float:
        """What a cell of the grid takes, in cells of the cycle solver."""

    @property
    def together(self) -> Sequence[str]:
        """Dimensions along which a part of the grid takes about as much as all of it: to be cut last."""

    @property
    def memory(self) -> int:
        """Bytes that solving takes beside the results, however small the grid."""

    @property
    def cell_memory(self) -> int:
        """Bytes for each cell of the grid that it takes beside them."""

    def template(self) -> xr.Dataset:
        """The results with their dimensions and coordinates but no values: zeros that take no memory."""

    def solve(self, progress: Callable[[int], None] | None = None) -> xr.Dataset:
        """Compute everything at once; `progress` is told of cells as they are finished, from any thread."""

    def part(self, chunk: Chunk) -> "AnyPlan":
        """The plan of a part of the grid, which gives the same bits as the whole does there."""

    def tally(self, results: Mapping[str, np.ndarray]) -> Tally:
        """Modes and flags in a chunk of results."""
