"""Chunks of a grid: their lengths along each dimension, and that they are the whole grid."""

import numpy as np
import pytest
import xarray as xr

from slipsweep.grid.chunks import chunk_lengths, grid_chunks, sizes_within, variables_within

SHAPE = {"theta": 10, "amplitude": 100, "frequency": 60}


@pytest.mark.parametrize(
    ("most", "lengths"),
    [
        (1_000_000, (10, 100, 60)),
        (60_000, (10, 100, 60)),
        (30_000, (5, 100, 60)),
        (6_000, (1, 100, 60)),
        (3_000, (1, 50, 60)),
        (59, (1, 1, 30)),  # equal shares rather than 59 and 1
        (1, (1, 1, 1)),
    ],
)
def test_the_first_dimensions_are_cut_first(most: int, lengths: tuple[int, ...]) -> None:
    """Cells of a chunk follow one another in the file."""
    assert tuple(chunk_lengths(SHAPE, most).values()) == lengths


def test_dimensions_that_belong_together_are_cut_last() -> None:
    """All frequencies cost hardly more than one, wherever the dimension stands."""
    shape = {"frequency": 60, "theta": 10, "amplitude": 100}
    assert chunk_lengths(shape, 6_000, ["frequency"]) == {
        "frequency": 60,
        "theta": 1,
        "amplitude": 100,
    }


@pytest.mark.parametrize("most", [1, 7, 59, 3000, 10**6])
def test_chunks_are_the_whole_grid_once_in_the_order_of_the_file(most: int) -> None:
    shape = {"theta": 3, "amplitude": 7, "frequency": 5}
    cells = np.arange(3 * 7 * 5).reshape(3, 7, 5)
    variable = {"cell": xr.Variable(tuple(shape), cells)}
    seen = []
    for chunk in grid_chunks(shape, most):
        part = variables_within(chunk, variable)["cell"]
        assert part.size <= most
        assert dict(part.sizes) == sizes_within(chunk, shape)
        seen += part.values.ravel().tolist()
    assert sorted(seen) == cells.ravel().tolist()
    firsts = [
        int(variables_within(chunk, variable)["cell"].min()) for chunk in grid_chunks(shape, most)
    ]
    assert firsts == sorted(firsts)


def test_a_grid_without_cells_has_no_chunks() -> None:
    assert list(grid_chunks({"theta": 3, "amplitude": 0}, 10)) == []
    assert list(grid_chunks({}, 10)) == [{}]
