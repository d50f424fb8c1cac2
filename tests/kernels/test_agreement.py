"""The cycle solver, the step solver, `simulate` and the reference agree, whatever options, waveform
and cell.
"""

from collections import Counter

import pytest

from tests.support.agreement import FLOORS, compare, group_of
from tests.support.sine_cells import drawn, times_bound


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_solvers_agree(first: int) -> None:
    """Some 2,000 cells under all options; ``python -m benchmarks.agreement`` draws more of them."""
    kinds: Counter[str] = Counter()
    for seed in range(first, first + 20):
        found = list(compare(group_of(seed)))
        kinds.update(comparison.kind for comparison in found)
        worst = max(found, key=lambda comparison: comparison.times_bound)
        assert worst.times_bound <= 1.0, f"{worst.kind}: {worst.text}"
    assert kinds.keys() == FLOORS.keys()


def test_batches_of_the_sine_are_the_walk_of_all_waves() -> None:
    """Rare kinds of motion, of which some hundred cells have none, and neighbours of every kind."""
    for seed in range(60):
        one = drawn(seed, 5_000)
        times = times_bound(one)
        assert times.max() <= 1.0, f"{times.max()} at {one.cell(int(times.argmax()))}"
