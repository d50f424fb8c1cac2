"""A fixed random sample of cells with their 30-digit displacements: ``python -m benchmarks.sample`` makes it.

Sixty-four cells a regime, one cycle of loading each, so that no solver gains from knowing
that cycles repeat.  Stuck, stick-slip, continuous and Newmark cells are uniform over the
range of the design chart and 1 % clear of the regime's ends; the hard ones are the hard
categories of tests/data/cases.csv that the default options can take.
"""

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import slipsweep
from benchmarks.grids import G
from tests.support.cases import OPTIONAL_INPUTS, read_cases
from tests.support.reference import solve

SAMPLE = Path(__file__).parent / "data" / "sample.csv"
SIZE = 64
SEED = 2012
REGIMES = ("stuck", "stick_slip", "continuous", "newmark", "hard")

#: Re-sticking before the peak is left to the tests: no outside solver here follows it.
HARD = ("grazing", "near_failure", "mode_limit", "sharp_decay", "level_plane")

INPUTS = ("theta", "mu_s", "amplitude", "frequency", "yield_acceleration", "decay_rate", "delta_mu")
COLUMNS = ("regime", "category", "model", *INPUTS, "sliding_mode", "permanent_displacement")

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


def _draw(regime: str, random: np.random.Generator) -> dict[str, Any]:
    """One cell of a regime."""
    from slipsweep import SlidingMode

    model = "newmark" if regime == "newmark" else "mendez"
    mode = SlidingMode.STICK_SLIP if regime == "newmark" else SlidingMode[regime.upper()]
    while True:
        cell: dict[str, Any] = {
            "theta": random.uniform(0.0, 20.0),
            "mu_s": random.uniform(0.2, 0.9),
            "amplitude": random.uniform(0.05, 1.4) * G,
            "frequency": 10 ** random.uniform(-1.0, np.log10(20.0)),
        }
        near = [
            int(slipsweep.sweep(**{**cell, "amplitude": by * cell["amplitude"]}, model=model).sliding_mode)
            for by in (0.99, 1.0, 1.01)
        ]
        if near == [mode] * 3:
            return {"regime": regime, "category": regime, "model": model, **cell}


def _hard() -> list[dict[str, Any]]:
    return [
        {
            "regime": "hard",
            "category": case.category,
            "model": case.model,
            **{name: getattr(case, name) for name in INPUTS[:4]},
            **{name: getattr(case, name) for name in OPTIONAL_INPUTS if getattr(case, name) is not None},
        }
        for case in read_cases()
        if case.category in HARD and (case.rise, case.recoupling) == ("monotone", "eq12") and not case.uplift
    ]


def main() -> None:
    """Draw the sample, solve it to 30 digits, write it."""
    random = np.random.default_rng(SEED)
    cells = [_draw(regime, random) for regime in REGIMES[:-1] for _ in range(SIZE)] + _hard()
    SAMPLE.parent.mkdir(exist_ok=True)
    with SAMPLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for cell in cells:
            inputs = {name: cell[name] for name in INPUTS if name in cell}
            answer = solve(**inputs, model=cell["model"], cycles=1)
            cell["sliding_mode"] = answer.sliding_mode
            cell["permanent_displacement"] = f"{float(answer.permanent_displacement):.17g}"
            writer.writerow({**cell, **{name: repr(float(value)) for name, value in inputs.items()}})


if __name__ == "__main__":
    main()
