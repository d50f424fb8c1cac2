"""A cell without a value has none in any result: NaN, mode -1, and so in every solver, a record and
a history.
"""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.model.variables import VALUELESS, Validity
from tests.support.cases import choices

#: A cell for each flag that takes the value, as arguments of `slipsweep.sweep`.
CELLS: dict[Validity, dict[str, Any]] = {
    Validity.STATICALLY_UNSTABLE: {"theta": 10.0, "mu_s": 0.1, "amplitude": 2.0},
    Validity.UPLIFT: {"theta": 45.0, "mu_s": 1.5, "amplitude": 9.9},
    Validity.LIMIT_UNDEFINED: {"theta": 45.0, "mu_s": 2.5, "amplitude": 3.0},
    Validity.FRICTION_NOT_DECAYING: {
        "theta": 0.0,
        "mu_s": 1.5,
        "amplitude": 14.0,
        "yield_acceleration": 1.0,
    },
    Validity.KD_NOT_POSITIVE: {"theta": 10.0, "mu_s": 0.5, "amplitude": 3.2, "rise": "literal"},
}
FLAGS = pytest.mark.parametrize("flag", CELLS, ids=lambda flag: flag.name)
WAVES: list[dict[str, Any]] = [
    {"waveform": "sine"},
    {"waveform": "square"},
    {"waveform": "harmonics", "harmonics": "1:1:180,0.3:3:20"},
    {"waveform": "sine", "ramp_in": 1.5, "ramp_out": 1.0},
]
SOLVERS: list[dict[str, Any]] = [
    {"solver": "cycle"},
    *(
        {"solver": "step", "rule": rule, "steps_per_cycle": 256}
        for rule in ("rectangle", "trapezoid", "simpson")
    ),
]


def assert_no_value(found: xr.Dataset, flag: Validity) -> None:
    assert int(found.validity) & flag
    assert not int(found.validity) & (
        Validity.UPSLOPE | Validity.NEAR_MODE_LIMIT | Validity.FRICTION_ESTIMATED
    )
    assert np.isnan(found.permanent_displacement), "displacement"
    assert np.isnan(found.peak_relative_velocity), "velocity"


def test_every_flag_that_takes_the_value_is_here() -> None:
    """That of blocks that do not come to rest is in test_changing_strength."""
    assert {*CELLS, Validity.NOT_AT_REST} == set(VALUELESS)


@FLAGS
@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_sweep_gives_no_value(flag: Validity, wave: dict[str, Any]) -> None:
    for solver in SOLVERS:
        found = slipsweep.sweep(**choices(**CELLS[flag], **wave, **solver, frequency=1.0))
        assert_no_value(found, flag)
        assert int(found.sliding_mode) == -1


@FLAGS
@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_history_gives_no_value(flag: Validity, wave: dict[str, Any]) -> None:
    """From its beginning, also where only a later pulse takes the value."""
    history = slipsweep.simulate(
        **choices(**CELLS[flag], **wave, frequency=1.0, times=[0.0, 0.01, 0.3, 5.0, 60.0])
    )
    assert_no_value(history, flag)
    for name in (
        "block_acceleration",
        "friction_coefficient",
        "relative_velocity",
        "relative_displacement",
    ):
        assert np.isnan(history[name]).all(), name
    assert np.isfinite(history.ground_acceleration).all(), "the plane moves all the same"


@FLAGS
def test_record_gives_no_value(flag: Validity) -> None:
    cell = {name: value for name, value in CELLS[flag].items() if name != "amplitude"}
    peak = CELLS[flag]["amplitude"]
    record = slipsweep.Record(np.arange(9.0), peak * np.array([0.0, 1, 0, -1, 0, 1, 0, -1, 0]))
    found = slipsweep.sweep(**choices(**cell, excitation=record))
    assert_no_value(found, flag)
    for name in ("number_of_slips", "stick_slip_pulses", "continuous_pulses"):
        assert int(found[name]) == -1, name


@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_grids_of_literal_rises(wave: dict[str, Any]) -> None:
    """Where Eq. 12 has nothing to brake with, beside cells that have a value: one mask for all
    results.
    """
    axes: dict[str, Any] = {
        "theta": np.linspace(0.0, 20.0, 7),
        "mu_s": np.linspace(0.2, 1.0, 7),
        "frequency": 1.0,
    }
    axes |= {"amplitude": np.linspace(0.5, 9.0, 30), "rise": "literal", "cycles": 3}
    for solver in SOLVERS:
        found = slipsweep.sweep(**choices(**axes, **wave, **solver))
        missing = (found.validity & int(VALUELESS)) != 0
        assert (found.validity & int(Validity.KD_NOT_POSITIVE)).any()
        np.testing.assert_array_equal(np.isnan(found.permanent_displacement), missing)
        np.testing.assert_array_equal(np.isnan(found.peak_relative_velocity), missing)
        np.testing.assert_array_equal(found.sliding_mode == -1, missing)


@pytest.mark.parametrize("solver", SOLVERS, ids=str)
def test_a_shaking_that_ends_in_a_rise_leaves_nothing_to_brake_with(solver: dict[str, Any]) -> None:
    """The ramp keeps the first rise below yield: the last one, up to the end of the shaking, is the
    only one.
    """
    cell = {
        "theta": 0.0,
        "mu_s": 0.337,
        "amplitude": 1.44,
        "yield_acceleration": 0.81,
        "decay_rate": 51.7,
    }
    shaking = {"waveform": "cosine", "cycles": 1, "ramp_in": 0.25}
    for recoupling in ("eq12", "integrate"):
        found = slipsweep.sweep(
            **choices(
                **cell, **shaking, **solver, frequency=0.1, rise="literal", recoupling=recoupling
            )
        )
        assert_no_value(found, Validity.KD_NOT_POSITIVE)
