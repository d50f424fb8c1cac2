"""Cells under a sine solved twice: in SIMD batches, and from event to event as under any wave.

`tests/kernels/test_agreement.py` does so for some sweeps, ``python -m benchmarks.agreement`` for
many.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import slipsweep
from tests.support.strategies import G

Array = NDArray[np.float64]

#: The largest relative difference, and the largest in parts of what moves the block, of which D is
#: a difference: a dozen times what five million cells have shown (benchmarks/results/agreement.md).
FLOOR = 1e-9
ROUNDING = 1e-14

#: Relative moves of friction and amplitude, of some roundings, and how much more than by these two
#: ways may differ: a block that stops anew in each of 65 pulses forgets how it began.
MOVES = ((-1e-15, -1e-15), (-1e-15, 1e-15), (1e-15, -1e-15), (1e-15, 1e-15))
TIMES = 30.0

MODELS = (
    *[slipsweep.Mendez()] * 3,
    slipsweep.Mendez(recoupling="integrate"),
    slipsweep.Mendez(rise="literal"),
    slipsweep.Mendez(rise="literal", recoupling="integrate"),
    slipsweep.Newmark(),
)


@dataclass(frozen=True)
class Drawn:
    """Cycles, a model, and the inputs of cells."""

    cycles: int
    model: Any
    cells: dict[str, Array]

    def swept(self, cells: dict[str, Array], walked: bool = True) -> xr.Dataset:
        """Sweep of cells; a sine declared as a harmonic takes the walk of all waves."""
        columns: dict[str, Any] = {
            name: xr.DataArray(values, dims="cell") for name, values in cells.items()
        }
        excitation = (
            slipsweep.Harmonics([1.0], [1], cycles=self.cycles)
            if walked
            else slipsweep.Sine(self.cycles)
        )
        return slipsweep.sweep(**columns, frequency=1.0, excitation=excitation, model=self.model)

    def cell(self, at: int) -> str:
        """One of them, to be solved again."""
        cell = {name: float(values[at]) for name, values in self.cells.items()}
        return f"{self.cycles} cycles, {self.model}: {cell}"


def drawn(seed: int, count: int) -> Drawn:
    """Cells of all modes, some only just reached, with friction given or estimated."""
    rng = np.random.default_rng(seed)

    def between(low: float, high: float) -> Array:
        return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), count)))

    model = MODELS[rng.integers(len(MODELS))]
    cycles = int(rng.choice([1, 2, 3, 5, 10, 65]))
    mu_s = between(0.05, 2.0)
    tan_theta = mu_s * (rng.uniform(0.0, 0.98, count) if rng.random() < 0.7 else between(1e-6, 1.0))
    cells = {"theta": np.degrees(np.arctan(tan_theta)), "mu_s": mu_s}
    onset = G * (mu_s - tan_theta) / (1.0 + mu_s * tan_theta)
    given = rng.integers(4) if isinstance(model, slipsweep.Mendez) else rng.integers(2)
    if given > 0:
        cells["yield_acceleration"] = onset = between(1e-3, 5.0)
    if given > 1:
        cells["decay_rate"] = between(0.02, 20.0)
    if given > 2:
        cells["delta_mu"] = between(1e-3, 1.0)
    limit = np.abs((onset + G * mu_s) / (1.0 - tan_theta * (mu_s - tan_theta)))
    amplitudes = (
        between(0.1, 30.0),
        onset * (1.0 + between(1e-6, 3.0)),
        limit * (1.0 + rng.choice([-1.0, 1.0], count) * between(1e-6, 0.9)),
        onset + rng.uniform(0.0, 1.0, count) * (limit - onset),
    )
    return Drawn(
        cycles, model, cells | {"amplitude": np.clip(amplitudes[rng.integers(4)], 1e-3, 1e3)}
    )


def times_bound(cells: Drawn) -> Array:
    """Difference of the two ways over its bound, of displacement or largest velocity, by cell."""
    batches = cells.swept(cells.cells, walked=False)
    walk = cells.swept(cells.cells)
    drives = cells.cells["amplitude"] + G * (cells.cells["mu_s"] + cells.cells.get("delta_mu", 0.0))
    scales = {
        "permanent_displacement": drives / (2 * np.pi) ** 2,
        "peak_relative_velocity": drives / (2 * np.pi),
    }
    times = np.where(batches.validity.values == walk.validity.values, 0.0, np.inf)
    for name, scale in scales.items():
        displacement = batches[name].values
        right = walk[name].values
        apart = np.where(
            np.isnan(displacement) == np.isnan(right),
            np.nan_to_num(np.abs(displacement - right)),
            np.inf,
        )
        bound = FLOOR * np.nan_to_num(np.abs(right)) + ROUNDING * cells.cycles**2 * scale
        (beyond,) = np.nonzero(np.isfinite(apart) & (apart > bound))
        if beyond.size:
            bound[beyond] += TIMES * _spread(cells, beyond, name, right[beyond])
        times = np.maximum(times, apart / bound)
    return times


def _spread(one: Drawn, cells: NDArray[np.intp], name: str, right: Array) -> Array:
    """How far a result of some cells moves with their inputs."""
    picked = {key: values[cells] for key, values in one.cells.items()}
    apart = np.zeros(cells.size)
    for a, b in MOVES:
        moved = picked | {
            "mu_s": picked["mu_s"] * (1.0 + a),
            "amplitude": picked["amplitude"] * (1.0 + b),
        }
        apart = np.fmax(apart, np.abs(one.swept(moved)[name].values - right))
    return apart
