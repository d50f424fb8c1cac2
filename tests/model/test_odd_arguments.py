"""Odd arguments from Python: every call gives a result or one clear message, and nothing else happens."""

from hypothesis import HealthCheck, Phase, given, settings

from tests.support import odd_arguments


@settings(
    max_examples=750, deadline=None, derandomize=True, database=None, phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
@given(odd_arguments.calls())
def test_a_call_gives_a_result_or_is_refused_by_name(call: odd_arguments.Call) -> None:
    odd_arguments.is_served(call)
