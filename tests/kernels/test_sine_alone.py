"""Cells under a sine that are solved one by one: blocks in motion at Üg = Üy, thin layers of
friction.
"""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.kernels.block import EQ12, MONOTONE, UNSOLVED, Options
from slipsweep.kernels.grid import CELL
from slipsweep.kernels.sine.solve import solve_sine
from tests.support import reference
from tests.support.strategies import G

#: Blocks that would stick at Üg = Üy, but come there in motion, and others of no simple shape.
CELLS: dict[str, dict[str, Any]] = {
    "stops before t1, and slides again": {
        "theta": 6.873369272653273,
        "mu_s": 0.12663419860643282,
        "amplitude": 0.8659773561648428,
        "cycles": 5,
    },
    "velocity falls from cycle to cycle": {
        "theta": 6.831875530013215e-05,
        "mu_s": 0.4331582107958491,
        "yield_acceleration": 0.005876811655616431,
        "decay_rate": 9.900717230000888,
        "amplitude": 3.0843165986769665,
        "cycles": 5,
    },
    "yield governs, not recoupled": {
        "theta": 44.967150860400594,
        "mu_s": 1.798516931687231,
        "yield_acceleration": 0.0809994816950022,
        "decay_rate": 1.2974774317863667,
        "delta_mu": 0.004572207249991502,
        "amplitude": 2.1239279484554427,
        "cycles": 3,
    },
    "friction falls in a thin layer": {
        "theta": 5.0,
        "mu_s": 0.38,
        "yield_acceleration": 0.59,
        "decay_rate": 200.0,
        "amplitude": 3.55,
        "cycles": 3,
    },
    "literal rise": {
        "theta": 5.0,
        "mu_s": 0.38,
        "yield_acceleration": 0.59,
        "amplitude": 3.55,
        "rise": "literal",
        "cycles": 3,
    },
    "continuous, D changes its sign twice": {
        "theta": 30.0,
        "mu_s": 0.5,
        "yield_acceleration": 1.0,
        "decay_rate": 1.0,
        "delta_mu": 0.2,
        "amplitude": 9.0,
        "cycles": 3,
    },
}


@pytest.mark.parametrize("name", CELLS)
def test_cells_of_no_simple_shape_are_those_of_the_reference(name: str) -> None:
    """Displacement, largest velocity and flags against multiple precision."""
    cell = dict(CELLS[name])
    cycles = cell.pop("cycles")
    exact = reference.solve(**cell, frequency=1.0, cycles=cycles, waveform="sine", dps=15)
    model = slipsweep.Mendez(rise=cell.pop("rise", "monotone"))
    motion = slipsweep.sweep(
        **cell, frequency=1.0, model=model, excitation=slipsweep.Sine(cycles=cycles)
    )
    assert int(motion.validity) == exact.validity
    assert int(motion.sliding_mode) == exact.sliding_mode
    for result in ("permanent_displacement", "peak_relative_velocity"):
        assert motion[result].item() == pytest.approx(float(getattr(exact, result)), rel=1e-11)


def test_cells_are_the_same_one_by_one_and_together() -> None:
    """And none is left to the walk of any wave, whether Eqs. 9-11 and 6 are given or estimated."""
    rng = np.random.default_rng(3)
    cells = np.full(4_000, np.nan, CELL)
    cells["mu_s"] = rng.uniform(0.1, 1.0, cells.size)
    cells["tan_theta"] = cells["mu_s"] * rng.uniform(0.0, 1.2, cells.size)
    cells["amplitude"] = rng.uniform(0.1, 12.0, cells.size)
    cells["yield_acceleration"][::2] = rng.uniform(0.01, 3.0, 2_000)
    cells["decay_rate"][::4] = 10.0 ** rng.uniform(-1.0, 3.0, 1_000)
    cells["delta_mu"][::8] = rng.uniform(0.0, 0.5, 500)
    options = Options(MONOTONE, EQ12, 10, True, G)
    together = np.empty((7, cells.size))
    alone = np.empty((7, cells.size))
    solve_sine(cells, options, False, together)
    solve_sine(cells, options, True, alone)
    assert not (alone[3] == UNSOLVED).any()
    solved = together[3] != UNSOLVED
    assert 0.5 < solved.mean() < 1.0
    np.testing.assert_array_equal(alone[2:4, solved], together[2:4, solved])
    scale = np.maximum(1.0, cells["amplitude"])[solved]
    for row in (0, 1):
        np.testing.assert_allclose(
            alone[row, solved] / scale, together[row, solved] / scale, rtol=1e-9, atol=1e-11
        )


def test_a_chart_leaves_no_cell_to_the_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first use compiles the kernel of the sine only."""

    def walk(*arguments: Any) -> None:
        raise AssertionError("the walk was called")

    monkeypatch.setattr("slipsweep.grid.solvers.solve_walk", walk)
    motion = slipsweep.sweep(
        theta=np.linspace(0.0, 20.0, 21),
        mu_s=np.array([0.2, 0.38, 0.6]),
        amplitude=np.linspace(0.5, 11.8, 60),
        frequency=1.0,
    )
    assert bool((motion.validity.astype(int) & slipsweep.Validity.NOT_RECOUPLED).any())
    assert isinstance(motion, xr.Dataset)
