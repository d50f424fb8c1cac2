"""The cycle solver, the step solver and `simulate` agree, whatever the options, the waveform and the cell."""

from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support import agreement
from tests.support.strategies import reproducible

#: Comparisons by kind; printed at the end (pytest -s).
compared: Counter[str] = Counter()


@pytest.fixture(scope="module", autouse=True)
def _count() -> Iterator[None]:
    yield
    print(f"\n{compared.total()} comparisons: {dict(compared)}")


@settings(reproducible, max_examples=100)
@given(group=agreement.large_groups)
def test_solvers_agree(group: agreement.Group) -> None:
    """Some 6,000 cells under all options; ``python -m benchmarks.agreement`` draws more of them."""
    found = list(agreement.compare(group))
    compared.update(comparison.kind for comparison in found)
    worst = max(found, key=lambda comparison: comparison.times_bound)
    assert worst.times_bound <= 1.0, f"{worst.kind}: {worst.text}"


@given(group=agreement.groups, kind=st.sampled_from(sorted(agreement.FLOORS)))
@settings(reproducible, max_examples=10)
def test_a_difference_is_seen(group: agreement.Group, kind: str) -> None:
    """A result that is 30% off, as one was, is a disagreement in most of the cells that move."""
    seen = agreement.detected(group, kind, 0.3)
    assert seen.count(True) >= 0.9 * len(seen), f"{seen.count(True)} of {len(seen)} cells"
