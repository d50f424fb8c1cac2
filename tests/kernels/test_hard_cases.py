"""The hard cases (docs/hard-cases.md): what each solver's error is against what one ulp of the inputs does."""

from math import isfinite

import pytest

from tests.support.cases import PARAMETERS, solve
from tests.support.hard_cells import CATEGORIES, Category, HardCase, conditioning, read_hard_cases

CASES = read_hard_cases()
RULES = pytest.mark.parametrize("rule", ["rectangle", "trapezoid", "simpson"])


def beyond_bound(cases: list[HardCase], found: dict[int, tuple[float, float, int, int]]) -> list[str]:
    """Cases whose displacement or peak velocity is more than 100 conditioning bounds off, or neither side's mode."""
    wrong = []
    for case in cases:
        displacement, velocity, mode, validity = found[case.case]
        if (mode, validity) not in case.outcomes:
            wrong.append(f"case {case}: mode and validity {(mode, validity)}, not of {sorted(case.outcomes)}")
        if mode < 0 or case.sliding_mode < 0:
            continue
        times = case.times_bound(displacement), case.velocity_times_bound(velocity)
        if not max(times) <= 100:
            wrong.append(f"case {case}: {times[0]:.1e} (u) and {times[1]:.1e} (v) times the conditioning bound")
    return wrong


def test_every_category_has_its_cases() -> None:
    assert {case.category for case in CASES} == {category.name for category in CATEGORIES}


@pytest.mark.parametrize("category", CATEGORIES, ids=lambda category: category.name)
def test_cases_are_the_reference(category: Category) -> None:
    """The first and the last case of each category, solved again with their neighbours."""
    own = [case for case in CASES if case.category == category.name]
    for case in (own[0], own[-1]):
        inputs = {name: getattr(case, name) for name in PARAMETERS}
        found = conditioning({**inputs, **case.options}, category.dtype)
        assert found["permanent_displacement"] == case.permanent_displacement, f"displacement of case {case}"
        assert found["displacement_bound"] == case.displacement_bound, f"conditioning of case {case}"
        assert found["velocity_bound"] == case.velocity_bound, f"conditioning of case {case}"


def test_cycle_solver_within_100_times_the_conditioning() -> None:
    assert not beyond_bound(CASES, solve(CASES, solver="cycle"))


@RULES
def test_step_solver_gives_numbers(rule: str) -> None:
    """Never NaN, infinity or a negative peak velocity where there is a value."""
    for case_number, (displacement, velocity, mode, _) in solve(CASES, solver="step", rule=rule).items():
        if mode >= 0:
            assert isfinite(displacement), f"displacement of case {case_number}"
            assert 0 <= velocity < float("inf"), f"peak velocity of case {case_number}"
