"""The paper's two experiments: Tables 1 and 2 digit for digit, and its formulas."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep import Validity

STICK_SLIP: dict[str, Any] = {
    "theta": 5.0,
    "mu_s": 0.38,
    "amplitude": 3.55,
    "yield_acceleration": 0.59,
}
CONTINUOUS: dict[str, Any] = {
    "theta": 6.0,
    "mu_s": 0.38,
    "amplitude": 5.10,
    "yield_acceleration": 0.08,
}

#: lambda as Table 2 prints it.
PRINTED_DECAY = {"stick_slip": 2.70, "continuous": 2.30}


def printed(value: xr.DataArray, digits: int = 2) -> str:
    return f"{float(value):.{digits}f}"


@pytest.mark.parametrize(
    ("experiment", "limit", "ratio", "mode", "above_static", "least", "decay"),
    [
        (STICK_SLIP, "4.43", "0.80", 1, "0.09", "0.12", "3.90"),
        (CONTINUOUS, "3.92", "1.30", 2, "0.11", "0.01", "7.50"),
    ],
    ids=["stick_slip", "continuous"],
)
def test_tables_1_and_2(
    experiment: dict[str, Any],
    limit: str,
    ratio: str,
    mode: int,
    above_static: str,
    least: str,
    decay: str,
) -> None:
    """But for lambda: Eq. 6 at the peak does not give that of Table 2."""
    parameters = slipsweep.friction_parameters(**experiment, model=slipsweep.Mendez(g=9.81))
    assert printed(parameters.limiting_acceleration) == limit, (
        "Eq. 7: limiting acceleration, Table 1"
    )
    assert printed(parameters.acceleration_ratio) == ratio, "acceleration ratio, Table 1"
    assert int(parameters.sliding_mode) == mode, "sliding mode, Table 1"
    assert printed(parameters.delta_mu) == above_static, (
        "Eqs. 10 and 11: friction above static, Table 2"
    )
    assert printed(parameters.minimum_friction) == least, "Eq. 9: minimum friction, Table 2"
    assert mode == 1 or float(parameters.minimum_friction) == 0.01, "continuous: next to zero"
    assert printed(parameters.decay_rate) == decay, "lambda by Eq. 6"
    peak = (experiment["mu_s"] + parameters.delta_mu) * np.exp(
        -parameters.decay_rate * experiment["amplitude"] / 9.81
    )
    assert float(peak) == pytest.approx(float(parameters.minimum_friction), rel=1e-13), (
        "Eq. 6 at the peak"
    )


def test_attenuation_coefficient_with_the_printed_decay_rate() -> None:
    """Kd = max(U)/g of the stick-slip experiment; Table 3 prints 0.17."""
    history = slipsweep.simulate(
        **STICK_SLIP, frequency=1.8, decay_rate=2.70, excitation=slipsweep.Sine(cycles=1)
    )
    attenuation = history.block_acceleration.max() / 9.81
    assert printed(attenuation, 3) == "0.157", "Eq. 12: Kd with lambda 2.70"


@pytest.mark.parametrize("solver", ["cycle", "step"])
@pytest.mark.parametrize(
    ("experiment", "mode", "frequency", "displacement", "velocity"),
    [
        (STICK_SLIP, "stick_slip", 1.8, "331", "0.295"),
        (CONTINUOUS, "continuous", 3.5, "159", "0.224"),
    ],
    ids=["stick_slip", "continuous"],
)
def test_figures_with_the_printed_decay_rate(
    experiment: dict[str, Any],
    mode: str,
    frequency: float,
    displacement: str,
    velocity: str,
    solver: str,
) -> None:
    """Five cycles of a pure sine; delta_mu by Eqs. 10 and 11."""
    result = slipsweep.sweep(
        **experiment,
        frequency=frequency,
        decay_rate=PRINTED_DECAY[mode],
        solver=solver,
        excitation=slipsweep.Sine(cycles=5),
    )
    assert printed(result.permanent_displacement * 1000, 0) == displacement, "displacement, mm"
    assert printed(result.peak_relative_velocity, 3) == velocity, "peak relative velocity, m/s"
    assert int(result.validity) == slipsweep.Validity.FRICTION_ESTIMATED, "delta_mu by Eqs. 10, 11"


@pytest.mark.parametrize(
    ("experiment", "frequency", "inputs", "displacement", "newmark", "flags"),
    [
        (STICK_SLIP, 1.8, {"yield_acceleration": None}, "31.0", "31.0", Validity.YIELD_GOVERNS),
        (CONTINUOUS, 3.5, {"yield_acceleration": None}, "68.9", "64.3", Validity.YIELD_GOVERNS),
        (
            STICK_SLIP,
            1.8,
            {},
            "1858.7",
            "548.7",
            Validity.NOT_RECOUPLED | Validity.FRICTION_ESTIMATED,
        ),
        (CONTINUOUS, 3.5, {}, "377.0", "316.5", Validity.FRICTION_ESTIMATED),
        (STICK_SLIP, 1.8, {"decay_rate": 2.70}, "331.0", "548.7", Validity.FRICTION_ESTIMATED),
        (CONTINUOUS, 3.5, {"decay_rate": 2.30}, "159.1", "316.5", Validity.FRICTION_ESTIMATED),
        (STICK_SLIP, 1.8, {"decay_rate": 2.70, "delta_mu": 0.09}, "340.0", "548.7", Validity(0)),
        (CONTINUOUS, 3.5, {"decay_rate": 2.30, "delta_mu": 0.11}, "161.8", "316.5", Validity(0)),
    ],
)
def test_displacements_by_measured_printed_and_estimated_inputs(
    experiment: dict[str, Any],
    frequency: float,
    inputs: dict[str, Any],
    displacement: str,
    newmark: str,
    flags: Validity,
) -> None:
    """Displacements of both experiments, measured, printed and estimated, and Newmark's; mm."""
    result = slipsweep.sweep(
        **(experiment | inputs),
        frequency=frequency,
        excitation=slipsweep.Sine(cycles=5),
        variables=["permanent_displacement", "newmark_displacement", "validity"],
    )
    assert printed(result.permanent_displacement * 1000, 1) == displacement
    assert printed(result.newmark_displacement * 1000, 1) == newmark
    assert Validity(int(result.validity)) == flags
