"""Flags at their borders; others are in test_properties, test_accuracy and, of records, in
test_record.
"""

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
    assert int(none.validity) == Validity.KD_NOT_POSITIVE
    near = slipsweep.friction_parameters(theta=10.0, mu_s=0.5, amplitude=8.0)
    assert int(near.validity) == Validity.NEAR_MODE_LIMIT
    assert CAUTIONS & NOTES == CAUTIONS & VALUELESS == NOTES & VALUELESS == Validity(0)
    assert Validity(8191) == CAUTIONS | NOTES | VALUELESS


@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_a_ramp_that_ends_too_soon_moves_no_block_and_raises_no_flag(solver: str) -> None:
    """Between two ramps the shaking stays below the yield acceleration; the mode goes by the peak
    without them.
    """
    found = slipsweep.sweep(
        5.0, 0.4, [3.2, 4.5], 1.0, excitation=slipsweep.Sine(1, 0.5, 0.5), solver=solver
    )
    np.testing.assert_array_equal(found.permanent_displacement, [0.0, 0.0])
    np.testing.assert_array_equal(found.validity, [0, 0])
    assert (found.sliding_mode > 0).all()


def _harmonics(amplitudes: list[float], phases: list[float], cycles: int) -> slipsweep.Harmonics:
    return slipsweep.Harmonics(amplitudes, [1, 2, 3], phases, cycles=cycles)


@pytest.mark.parametrize("larger_first", [False, True])
def test_kd_is_that_of_the_instant_at_which_the_base_reverses(larger_first: bool) -> None:
    """Two maxima in a half wave, Eq. 4 < 0 at the smaller: no value only where that is last.

    A wave, the same motion as a record, and steps say the same.
    """
    wave = _harmonics([1.0, 0.2, 0.6], [0.0, 0.0 if larger_first else 180.0, 0.0], 2)
    cell: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.3,
        "yield_acceleration": 1.5,
        "decay_rate": 20.0,
        "delta_mu": 0.05,
        "model": slipsweep.Mendez(rise="literal"),
    }
    phases = 2 * math.pi * np.arange(8001) / 4000
    values = np.sin(phases) + 0.6 * np.sin(3 * phases)
    values += (0.2 if larger_first else -0.2) * np.sin(2 * phases)
    record = slipsweep.Record(phases / (2 * math.pi), 4.0 * values / np.abs(values).max())
    results = [
        slipsweep.sweep(**cell, amplitude=4.0, frequency=1.0, excitation=wave),
        slipsweep.sweep(**cell, amplitude=4.0, frequency=1.0, excitation=wave, solver="step"),
        slipsweep.sweep(**cell, excitation=record),
    ]
    for found in results:
        assert bool(int(found.validity) & Validity.KD_NOT_POSITIVE) == larger_first
        assert np.isnan(found.permanent_displacement) == larger_first
    if not larger_first:
        moved = [found.permanent_displacement.item() for found in results]
        np.testing.assert_allclose(moved, moved[0], rtol=1e-3)


@pytest.mark.parametrize("motion", ["sine", "triangle", "step", "record"])
def test_under_the_literal_rise_yield_does_not_govern(motion: str) -> None:
    """Eq. 4 is followed below Üy: the result depends on λ, whose estimate is named."""
    times = np.arange(21) / 4.0
    triangle = slipsweep.Record(times, 3.7 * np.array([0.0, *[1.0, 0.0, -1.0, 0.0] * 5]))
    motions: dict[str, dict[str, Any]] = {
        "sine": {"frequency": 1.0, "amplitude": 3.7},
        "triangle": {"frequency": 1.0, "amplitude": 3.7, "excitation": "triangle"},
        "step": {"frequency": 1.0, "amplitude": 3.7, "solver": "step"},
        "record": {"excitation": triangle},
    }
    literal = slipsweep.Mendez(rise="literal")
    block: dict[str, Any] = {"theta": 12.0, "mu_s": 0.45, **motions[motion]}
    monotone = slipsweep.sweep(**block)
    found = slipsweep.sweep(**block, model=literal)
    other = slipsweep.sweep(**block, decay_rate=3.0, model=literal)
    newmark = slipsweep.sweep(**block, model="newmark")
    assert int(monotone.validity) == Validity.YIELD_GOVERNS
    assert int(found.validity) & Validity.FRICTION_ESTIMATED
    assert not int(found.validity) & Validity.YIELD_GOVERNS
    assert not int(other.validity) & Validity.YIELD_GOVERNS
    assert float(found.permanent_displacement) > 2.0 * float(newmark.permanent_displacement)
    assert float(found.permanent_displacement) != float(other.permanent_displacement)


@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_newmark_which_has_no_eq12_has_no_flag_of_it(solver: str) -> None:
    """The block slides on into the next half wave, as one of the law does, which is flagged."""
    cell: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.3,
        "amplitude": 2.5,
        "frequency": 1.0,
        "yield_acceleration": 0.3,
        "excitation": _harmonics([1.0, 0.0, 1.1], [0.0, 0.0, 0.0], 2),
        "solver": solver,
    }
    integrated = slipsweep.Mendez(recoupling="integrate")
    assert int(slipsweep.sweep(**cell, model=integrated).validity) & Validity.NOT_RECOUPLED
    assert int(slipsweep.sweep(**cell, model="newmark").validity) == 0
