"""A fixed random sample of cells with their 30-digit displacements, data/sample.csv.

Sixty-four cells a regime, one cycle of loading each, so that no solver gains from knowing
that cycles repeat.  Stuck, stick-slip, continuous and Newmark cells are uniform over the
range of the design chart and 1 % clear of the regime's ends; the hard ones are the hard
categories of tests/data/cases.csv that the default options can take.  tests/test_benchmarks.py solves some again.
"""

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import slipsweep

SAMPLE = Path(__file__).parent / "data" / "sample.csv"
SIZE = 64
REGIMES = ("stuck", "stick_slip", "continuous", "newmark", "hard")

INPUTS = ("theta", "mu_s", "amplitude", "frequency", "yield_acceleration", "decay_rate", "delta_mu")

Array = NDArray[np.float64]


class Group:
    """Cells of one regime, model and sliding mode."""

    def __init__(self, rows: list[dict[str, str]]) -> None:
        self.regime, self.model = rows[0]["regime"], rows[0]["model"]
        self.mode = int(rows[0]["sliding_mode"])
        self.inputs: dict[str, Array] = {name: np.array([float(row[name] or "nan") for row in rows]) for name in INPUTS}
        self.reference = np.array([float(row["permanent_displacement"]) for row in rows])

    @property
    def size(self) -> int:
        """Number of cells."""
        return self.reference.size

    def errors(self, displacement: Array) -> Array:
        """|u − reference| over |reference|; over A/ω² where the reference is 0."""
        omega = 2 * np.pi * self.inputs["frequency"]
        scale = np.where(self.reference == 0, self.inputs["amplitude"] / omega**2, np.abs(self.reference))
        return np.asarray(np.abs(displacement - self.reference) / scale)

    def take(self, cells: NDArray[np.int_]) -> "Group":
        """The group of those cells, in that order, as often as they are named."""
        part = object.__new__(Group)
        part.regime, part.model, part.mode = self.regime, self.model, self.mode
        part.inputs = {name: values[cells] for name, values in self.inputs.items()}
        part.reference = self.reference[cells]
        return part

    def repeated(self, times: int) -> "Group":
        """The group `times` times over."""
        return self.take(np.tile(np.arange(self.size), times))

    def sweep_arguments(self) -> dict[str, Any]:
        """Arguments of `slipsweep.sweep`: the cells along one dimension."""
        import xarray as xr

        given = {name: values for name, values in self.inputs.items() if not np.isnan(values).all()}
        cells = {name: xr.DataArray(values, dims="cell") for name, values in given.items()}
        return {**cells, "model": self.model, "excitation": slipsweep.Sine(1), "variables": ["permanent_displacement"]}

    def displacement(self, solver: Any) -> Array:
        """What a solver of `slipsweep.sweep` gives."""
        return np.asarray(slipsweep.sweep(**self.sweep_arguments(), solver=solver).permanent_displacement)


def read() -> dict[str, list[Group]]:
    """Groups of every regime."""
    with SAMPLE.open(newline="") as file:
        rows = list(csv.DictReader(file))
    found: dict[str, list[Group]] = {}
    for regime in REGIMES:
        keys: dict[tuple[object, ...], list[dict[str, str]]] = {}
        for row in rows:
            if row["regime"] == regime:
                given = tuple(bool(row[name]) for name in INPUTS)
                keys.setdefault((row["model"], row["sliding_mode"], given), []).append(row)
        found[regime] = [Group(part) for part in keys.values()]
    return found
