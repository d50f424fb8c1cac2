"""Flags at their borders; others are in test_properties, test_accuracy and, of records, in test_record."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import slipsweep
from slipsweep import Validity
from slipsweep.model.variables import CAUTIONS, NOTES, VALUELESS
from tests.support import strategies


@pytest.mark.parametrize("solver", ["cycle", "step"])
@pytest.mark.parametrize("border", [0.9, 1.1])
@strategies.reproducible
@given(theta=strategies.thetas, mu_s=st.floats(0.1, 0.8), share=st.floats(0.1, 0.9))
def test_near_the_mode_limit_begins_and_ends_at_the_number(
    solver: str, border: float, theta: float, mu_s: float, share: float
) -> None:
    """The bit goes with ξ as it is returned, to the last digit of the amplitude."""
    onset = strategies.coulomb_yield(theta, mu_s) * share
    limit = strategies.limiting_acceleration(theta, mu_s, onset)
    assume(onset > 0 and limit > 0 and border * limit * math.tan(math.radians(theta)) <= 9.0)
    amplitudes = [border * limit]
    for _ in range(4):
        amplitudes = [
            math.nextafter(amplitudes[0], 0.0),
            *amplitudes,
            math.nextafter(amplitudes[-1], math.inf),
        ]
    found = slipsweep.sweep(
        theta,
        mu_s,
        amplitudes,
        1.0,
        yield_acceleration=onset,
        solver=solver,
        decay_rate=3.0,
        variables=["acceleration_ratio", "validity", "sliding_mode"],
    )
    near = (found.validity.values & Validity.NEAR_MODE_LIMIT) != 0
    ratio = found.acceleration_ratio.values
    np.testing.assert_array_equal(
        near, (ratio >= 0.9) & (ratio <= 1.1) & (found.sliding_mode.values > 0)
    )
    assert near.any()
    assert not near.all()


def test_flags_of_a_value_need_one_and_friction_parameters_have_those_before_the_motion() -> None:
    cell: dict[str, Any] = {"theta": 10.0, "mu_s": 0.5, "amplitude": 3.2, "frequency": 1.0}
    none = slipsweep.sweep(**cell, model=slipsweep.Mendez(rise="literal"))
    assert int(none.validity) == Validity.KD_NOT_POSITIVE | Validity.YIELD_GOVERNS
    near = slipsweep.friction_parameters(theta=10.0, mu_s=0.5, amplitude=8.0)
    assert int(near.validity) == Validity.NEAR_MODE_LIMIT
    assert CAUTIONS & NOTES == CAUTIONS & VALUELESS == NOTES & VALUELESS == Validity(0)
    assert Validity(2047) == CAUTIONS | NOTES | VALUELESS


@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_a_ramp_that_ends_too_soon_moves_no_block_and_raises_no_flag(solver: str) -> None:
    """Between two ramps the shaking stays below the yield acceleration; the mode goes by the peak without them."""
    found = slipsweep.sweep(
        5.0, 0.4, [3.2, 4.5], 1.0, excitation=slipsweep.Sine(1, 0.5, 0.5), solver=solver
    )
    np.testing.assert_array_equal(found.permanent_displacement, [0.0, 0.0])
    np.testing.assert_array_equal(found.validity, [0, 0])
    assert (found.sliding_mode > 0).all()
