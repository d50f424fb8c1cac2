"""Flags at their borders, of a record's pulses and of a cell without a value; others are in test_accuracy."""

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
from tests.support.reference import solve_record


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
        amplitudes = [math.nextafter(amplitudes[0], 0.0), *amplitudes, math.nextafter(amplitudes[-1], math.inf)]
    found = slipsweep.sweep(
        theta, mu_s, amplitudes, 1.0, yield_acceleration=onset, solver=solver, decay_rate=3.0,
        variables=["acceleration_ratio", "validity", "sliding_mode"],
    )  # fmt: skip
    near = (found.validity.values & Validity.NEAR_MODE_LIMIT) != 0
    ratio = found.acceleration_ratio.values
    np.testing.assert_array_equal(near, (ratio >= 0.9) & (ratio <= 1.1) & (found.sliding_mode.values > 0))
    assert near.any()
    assert not near.all()


@st.composite
def records(draw: st.DrawFn) -> np.ndarray:
    samples = draw(st.lists(st.floats(-1.0, 1.0).map(lambda x: round(x, 3)), min_size=3, max_size=25))
    return np.array([0.0, *samples, 0.0])


@strategies.reproducible
@given(
    samples=records(),
    theta=strategies.thetas,
    mu_s=st.floats(0.15, 0.9),
    strength=st.floats(0.3, 1.6),
    share=st.none() | st.floats(0.05, 1.0),
    friction=st.fixed_dictionaries({}, optional={"decay_rate": st.floats(0, 8), "delta_mu": st.floats(0, 0.4)}),
)
def test_a_record_has_the_flags_of_its_pulses(
    samples: np.ndarray, theta: float, mu_s: float, strength: float, share: float | None, friction: dict[str, float]
) -> None:
    onset = strategies.coulomb_yield(theta, mu_s)
    assume(onset > 0.05 and samples.any())
    limit = strategies.limiting_acceleration(theta, mu_s, onset)
    shaking = np.array((samples * strength * limit).tolist())
    record = slipsweep.Record(np.array([0.05 * k for k in range(samples.size)]), shaking)
    own: dict[str, Any] = dict(friction) if share is None else friction | {"yield_acceleration": onset * share}
    found = slipsweep.sweep(theta, mu_s, excitation=record, **own)
    raised = int(found.validity)
    if raised & VALUELESS:
        assert not raised & (Validity.UPSLOPE | Validity.NEAR_MODE_LIMIT | Validity.FRICTION_ESTIMATED)
        return
    expected = solve_record(record.times, shaking, theta, mu_s, **own).validity
    assert Validity(raised) == Validity(expected)
    newmark = slipsweep.sweep(theta, mu_s, excitation=record, model="newmark")
    assert int(newmark.validity) == 0


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
    found = slipsweep.sweep(5.0, 0.4, [3.2, 4.5], 1.0, excitation=slipsweep.Sine(1, 0.5, 0.5), solver=solver)
    np.testing.assert_array_equal(found.permanent_displacement, [0.0, 0.0])
    np.testing.assert_array_equal(found.validity, [0, 0])
    assert (found.sliding_mode > 0).all()
