"""A fixed random sample of cells with their 30-digit displacements, data/sample.csv.

Sixty-four cells a regime, one cycle of loading each, so that no solver gains from knowing that
cycles repeat.  Stuck, stick-slip, continuous and Newmark cells are uniform over the range of the
design chart and 1 % clear of the regime's ends; the hard ones are the hard categories of
tests/data/cases.csv that the default options can take.  tests/test_benchmarks.py solves some again.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

import slipsweep

SAMPLE = Path(__file__).parent / "data" / "sample.csv"
SIZE = 64
REGIMES = ("stuck", "stick_slip", "continuous", "newmark", "hard")

INPUTS = ("theta", "mu_s", "amplitude", "frequency", "yield_acceleration", "decay_rate", "delta_mu")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Group:
    """Cells of one regime, model and sliding mode; NaN where an input is not given."""

    regime: str
    model: str
    inputs: dict[str, Array]
    reference: Array

    @property
    def size(self) -> int:
        """Number of cells."""
        return self.reference.size

    def errors(self, displacement: Array) -> Array:
        """|u − reference| over |reference|; over A/ω² where the reference is 0."""
        omega = 2 * np.pi * self.inputs["frequency"]
        scale = np.where(
            self.reference == 0, self.inputs["amplitude"] / omega**2, np.abs(self.reference)
        )
        return np.asarray(np.abs(displacement - self.reference) / scale)

    def take(self, cells: NDArray[np.int_]) -> "Group":
        """The group of those cells, in that order, as often as they are named."""
        inputs = {name: values[cells] for name, values in self.inputs.items()}
        return Group(self.regime, self.model, inputs, self.reference[cells])

    def displacement(self, solver: Any) -> Array:
        """What a solver of `slipsweep.sweep` gives."""
        inputs = {
            name: values for name, values in self.inputs.items() if not np.isnan(values).all()
        }
        cells: dict[str, Any] = {
            name: xr.DataArray(values, dims="cell") for name, values in inputs.items()
        }
        options: dict[str, Any] = {
            "model": self.model,
            "solver": solver,
            "variables": ["permanent_displacement"],
        }
        result = slipsweep.sweep(**cells, **options, excitation=slipsweep.Sine(1))
        return result["permanent_displacement"].to_numpy()


def read() -> dict[str, list[Group]]:
    """Groups of every regime."""
    rows = pd.read_csv(SAMPLE, float_precision="round_trip")
    groups: dict[str, list[Group]] = {regime: [] for regime in REGIMES}
    is_given = [rows[name].notna() for name in INPUTS]
    for (regime, model, *_), part in rows.groupby(
        [rows.regime, rows.model, rows.sliding_mode, *is_given], sort=False
    ):
        inputs = {name: part[name].to_numpy(float) for name in INPUTS}
        groups[regime].append(
            Group(regime, model, inputs, part.permanent_displacement.to_numpy(float))
        )
    return groups
