"""Odd arguments from Python: every call gives a result or one clear message, and nothing else happens."""

import warnings
from collections import Counter

import xarray as xr
from hypothesis import HealthCheck, Phase, given, settings

import slipsweep
from slipsweep import InputError
from slipsweep.model.choices import Choice
from tests.support import odd_arguments

#: How the calls ended: printed with pytest -s.
ended: Counter[str] = Counter()


@settings(
    max_examples=1500, deadline=None, derandomize=True, database=None, phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
@given(odd_arguments.calls())
def test_a_call_gives_a_result_or_is_refused_by_name(call: odd_arguments.Call) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = call()
            if isinstance(found, xr.Dataset):
                found.load()
        except InputError as error:
            message = str(error)
            assert message.splitlines() == [message], message
            assert message.isprintable(), ascii(message)
            assert len(message) < 500, message
            assert any(name in message for name in (*call.arguments, *odd_arguments.WORDS)), message
            ended[f"{call.function} refused"] += 1
            return
    assert isinstance(found, (xr.Dataset, slipsweep.Record, Choice))
    ended[f"{call.function} solved"] += 1
