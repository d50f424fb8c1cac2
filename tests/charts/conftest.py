"""Results that several files of tests of charts draw."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import slipsweep
from tests.support.charts import (
    AMPLITUDES,
    FREQUENCIES,
    LINED_SINE,
    SINE,
    SUITE_AMPLITUDES,
    SWEEPS,
)


@pytest.fixture(scope="session")
def grid() -> xr.Dataset:
    return slipsweep.sweep(
        np.arange(0, 21, 2.0), [0.2, 0.3, 0.45, 0.6], AMPLITUDES, FREQUENCIES, excitation=SINE
    )


@pytest.fixture(scope="session")
def lined() -> xr.Dataset:
    amplitudes = np.linspace(0.02, 0.8, 40) * 9.81
    return slipsweep.sweep(
        [8.0, 11.0, 14.0], [0.25, 0.35, 0.45], amplitudes, [0.5, 1, 2], excitation=LINED_SINE
    )


@pytest.fixture(scope="session")
def grid_file(grid: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("charts") / "grid.nc"
    grid.to_netcdf(found)
    return found


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def suite() -> slipsweep.Suite:
    return slipsweep.read_suite(str(SWEEPS / "data" / "suite" / "*.AT2"))


@pytest.fixture(scope="session")
def result(suite: slipsweep.Suite) -> xr.Dataset:
    """Newmark's block under a suite in both polarities."""
    return slipsweep.sweep(
        [5.0, 20.0],
        [0.3, 0.4],
        SUITE_AMPLITUDES,
        excitation=suite,
        polarity="both",
        model="newmark",
        variables=["permanent_displacement", "validity", "newmark_displacement", "motion_factor"],
    )
