"""Newmark's block under a sine: against pySLAMMER, its closed form to the last digits, and what
reduces to it.
"""

from math import atan, radians, tan
from typing import Any

import mpmath
import numpy as np
import pytest
import xarray as xr

import slipsweep
from tests.support import closed_forms
from tests.support.cases import choices

G = 9.81


@pytest.mark.filterwarnings("ignore")  # pySLAMMER's own, on import
@pytest.mark.parametrize(
    ("theta", "mu_s", "amplitude", "frequency", "cycles"),
    [(10.0, 0.4, 4.0, 1.0, 3), (0.0, 0.3, 5.0, 2.0, 3), (5.0, 0.5, 5.0, 1.0, 2)],
)
def test_newmark_against_pyslammer(
    theta: float, mu_s: float, amplitude: float, frequency: float, cycles: int
) -> None:
    """pySLAMMER takes the trapezoidal rule from sample to sample: of second order.

    Onset and stop are at samples there.

    At 256 samples a cycle it is seen to err by up to 4e-4 in these cells, so that 16384
    samples must agree to 5e-7, with a margin of 5 on the order.
    """
    from pyslammer import GroundMotion, RigidAnalysis
    from pyslammer.constants import G_EARTH

    samples = 16384
    ground = amplitude * np.sin(2 * np.pi * np.arange(samples * cycles + 1) / samples)
    yield_acceleration = G * tan(atan(mu_s) - radians(theta))
    analysis = RigidAnalysis(
        yield_acceleration / G_EARTH, GroundMotion(ground / G_EARTH, 1 / (samples * frequency))
    )
    result = slipsweep.sweep(
        theta, mu_s, amplitude, frequency, model="newmark", excitation=slipsweep.Sine(cycles=cycles)
    )
    assert analysis.max_sliding_disp == pytest.approx(
        float(result.permanent_displacement), rel=5e-7
    ), "displacement"
    assert analysis.sliding_vel.max() == pytest.approx(
        float(result.peak_relative_velocity), rel=5e-7
    ), "peak velocity"


def test_newmark_to_the_last_digits() -> None:
    """Every share of yield in the peak, down to what a double can hold and up to one unit below the
    peak.
    """
    random = np.random.default_rng(11)
    amplitude = 3.7
    cycles = 7
    near = 10.0 ** random.uniform(-15.0, 0.0, 150)
    ratio = np.concatenate(
        [random.uniform(0.0, 1.0, 150), near, 1.0 - near, [1e-300, 1e-17, np.nextafter(1.0, 0.0)]]
    )
    onset = amplitude * ratio
    onset = onset[(onset > 0.0) & (onset < amplitude)]
    excitation = slipsweep.Sine(cycles=cycles)
    result = slipsweep.sweep(
        5.0, 0.38, amplitude, 1.0, yield_acceleration=onset, model="newmark", excitation=excitation
    )
    found = (onset, result.permanent_displacement.values, result.peak_relative_velocity.values)
    with mpmath.workdps(80):
        for value, displacement, velocity in zip(*map(np.ndarray.tolist, found), strict=True):
            share = mpmath.mpf(value) / mpmath.mpf(amplitude)
            slid = cycles * amplitude * closed_forms.sine(share)
            fastest = (
                amplitude * (mpmath.sqrt(1 - share**2) - share * mpmath.acos(share)) / mpmath.pi
            )
            assert abs(displacement / slid - 1) < 1.5e-15, f"displacement at {float(share)}"
            assert abs(velocity / fastest - 1) < 1.5e-15, f"peak velocity at {float(share)}"


@pytest.mark.parametrize("solver", ["cycle", "step"])
@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
def test_mendez_reduces_to_newmark_just_above_yield(solver: str, recoupling: str) -> None:
    """Near yield Eq. 4 stays below Coulomb's value: b = Uy, and the pulse is over before Ug
    reverses.
    """
    theta = xr.DataArray([0.0, 5.0, 10.0, 20.0], dims="case")
    mu_s = xr.DataArray([0.3, 0.38, 0.4, 0.75], dims="case")
    onset = slipsweep.friction_parameters(theta, mu_s, 1.0).yield_acceleration.drop_vars(
        "amplitude"
    )
    excess = xr.DataArray(10.0 ** -np.arange(1.0, 9.0), dims="excess")
    cells = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": onset * (1 + excess),
        "frequency": 1.0,
        "cycles": 3,
    }
    mendez = slipsweep.sweep(**choices(**cells, solver=solver, recoupling=recoupling))
    newmark = slipsweep.sweep(**choices(**cells, solver=solver, model="newmark"))
    assert (mendez.validity & 16 > 0).all(), "Eq. 4 stays below yield"
    for name in ("permanent_displacement", "peak_relative_velocity"):
        assert (newmark[name] > 0).all()
        np.testing.assert_allclose(mendez[name], newmark[name], rtol=1e-13, atol=0, err_msg=name)


def test_mendez_held_at_yield_is_newmark() -> None:
    """Where Eq. 4 stays below yield and recoupling is integrated, the two models are one block."""
    axes: dict[str, Any] = {
        "theta": np.linspace(0.0, 25.0, 6),
        "mu_s": np.linspace(0.5, 0.8, 4),
        "frequency": 2.0,
    }
    axes |= {"amplitude": np.linspace(0.5, 12.0, 24), "excitation": slipsweep.Sine(cycles=4)}
    mendez = slipsweep.sweep(**axes, model=slipsweep.Mendez(recoupling="integrate"))
    newmark = slipsweep.sweep(**axes, model="newmark")
    held = (mendez.validity & 16 > 0).to_numpy()
    assert held.sum() > 20, "cells held at yield"
    for name in ("permanent_displacement", "peak_relative_velocity"):
        np.testing.assert_allclose(
            mendez[name].to_numpy()[held],
            newmark[name].to_numpy()[held],
            rtol=1e-12,
            atol=0,
            err_msg=name,
        )
