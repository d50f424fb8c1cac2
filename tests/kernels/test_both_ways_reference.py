"""Blocks that slide both ways against 30 digits: every waveform, records, and the hard cases."""

import math

import pytest

from tests.support.both_ways import CATEGORIES, Cell, read_rows, row_of, solve, solve_by_package

ROWS = read_rows()

#: Of the conditioning bound, as for the hard cases of harmonic motion.
MOST_TIMES = 100


@pytest.mark.parametrize("category", [category.__name__ for category in CATEGORIES])
def test_results_within_100_times_the_conditioning(category: str) -> None:
    rows = [row for row in ROWS if row.category == category]
    assert len(rows) >= 5
    errors = {row.cell: row.times_bounds(solve_by_package(row.cell)) for row in rows}
    wrong = {cell: error for cell, error in errors.items() if not error <= MOST_TIMES}
    assert not wrong


@pytest.mark.parametrize("category", CATEGORIES, ids=lambda category: category.__name__)
def test_the_table_is_that_of_the_reference(category: object) -> None:
    """The last cell of each category, solved again."""
    name = getattr(category, "__name__", "")
    row = [row for row in ROWS if row.category == name][-1]
    assert row_of(name, row.cell) == row


def test_the_reference_has_the_closed_form() -> None:
    """A level base, one cycle of a square wave and η = 1/2: parabolas, and a run-out upslope."""
    u, largest, smallest, peak = map(float, solve(Cell(1.0, 0.5, 0.5, "square", cycles=1)))
    fast = math.pi / 2.0  # (1 − η)π
    slow = fast / 1.5  # time to the stop, at the rate 1 + η
    there = 0.5 * fast * math.pi + 0.5 * fast * slow
    left = math.pi - slow
    back = 0.5 * left  # V at the end, at the rate 1 − η
    assert peak == pytest.approx(fast, rel=1e-14)
    assert largest == pytest.approx(there, rel=1e-14)
    assert smallest == 0.0
    ends = there - 0.5 * back * left - back * back / (2.0 * 0.5)
    assert u == pytest.approx(ends, rel=1e-13)
