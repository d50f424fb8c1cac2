"""What uncertain inputs cost: ``python -m benchmarks.uncertainty`` prints it and writes results/uncertainty.md.

Seconds of processor, and by the clock, in turns.  Fragility: the statistics of many grid points, over the range of
sweeps/fragility.toml, against a sweep that solves the very same cells.  One grid point: a million samples of three
inputs, against drawing them with SciPy.  ``.ci/include-report`` puts the table into docs/uncertainty.md.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

import slipsweep
from benchmarks.grids import G
from benchmarks.machine import alternate, arguments, cores, measured_on, number, table

#: As in sweeps/fragility.toml.
UNCERTAIN: dict[str, dict[str, Any]] = {
    "mu_s": {"distribution": stats.lognorm(s=0.10, scale=0.40)},
    "amplitude": {"distribution": stats.lognorm(s=0.30), "kind": "factor"},
    "yield_acceleration": {"distribution": stats.lognorm(s=0.15), "kind": "factor"},
}
STATISTICS: dict[str, Any] = {"quantiles": [0.05, 0.25, 0.5, 0.75, 0.95], "thresholds": [0.01, 0.1, 1.0], "seed": 1}

#: What the statistics are made of.
SOLVED = ("permanent_displacement", "sliding_mode", "validity")


def drawn(samples: int) -> dict[str, np.ndarray]:
    """The draws of `slipsweep.sample`, by SciPy alone."""
    uniform = stats.qmc.Sobol(len(UNCERTAIN), rng=np.random.default_rng(STATISTICS["seed"])).random(samples).T
    return {
        name: one["distribution"].ppf(column) for (name, one), column in zip(UNCERTAIN.items(), uniform, strict=True)
    }


def fragility(
    thetas: int, amplitudes: int, samples: int, turns: int, clock: Callable[[], float]
) -> tuple[float, float]:
    """Seconds of the statistics of thetas × amplitudes grid points, and of a sweep over all their samples."""
    theta, amplitude = np.linspace(0.0, 10.0, thetas), np.linspace(0.02, 1.2, amplitudes) * G
    draws = {name: xr.DataArray(values, dims="sample") for name, values in drawn(samples).items()}
    # along the amplitudes, too: the samples are then the last dimension, in the order in which they are drawn
    angle = xr.DataArray(np.repeat(theta[:, None], amplitudes, axis=1), dims=("theta", "median"))
    coulomb = G * np.tan(np.arctan(draws["mu_s"]) - np.radians(xr.DataArray(theta, dims="theta")))
    cells = {
        "theta": angle,
        "mu_s": draws["mu_s"],
        "amplitude": xr.DataArray(amplitude, dims="median") * draws["amplitude"],
        "yield_acceleration": coulomb.transpose("theta", "sample") * draws["yield_acceleration"],
    }

    def sample() -> xr.Dataset:
        return slipsweep.sample(
            theta=theta, amplitude=amplitude, frequency=1.0, uncertain=UNCERTAIN, samples=samples, **STATISTICS
        )

    def sweep() -> xr.Dataset:
        return slipsweep.sweep(**cells, frequency=1.0, variables=SOLVED)

    wanted = sweep().permanent_displacement.transpose("theta", "median", "sample").mean("sample").values
    np.testing.assert_allclose(sample().mean_displacement.values, wanted, rtol=1e-9)  # they are the same cells
    found = alternate({"sample": sample, "sweep": sweep}, turns, clock=clock)
    return found["sample"], found["sweep"]


def one_point(samples: int, turns: int, clock: Callable[[], float]) -> tuple[float, float]:
    """Seconds of the statistics of one grid point, and of drawing its samples."""

    def sample() -> xr.Dataset:
        return slipsweep.sample(
            theta=5.0, amplitude=4.0, frequency=1.0, uncertain=UNCERTAIN, samples=samples, **STATISTICS
        )

    found = alternate({"sample": sample, "draw": lambda: drawn(samples)}, turns, clock=clock)
    return found["sample"], found["draw"]


def main() -> None:
    """Print and write the table."""
    given = arguments(__doc__)
    thetas, amplitudes, samples, million, turns = (2, 3, 64, 128, 1) if given.tiny else (10, 100, 2**13, 2**20, 15)
    points = thetas * amplitudes
    rows = []
    for name, cells, other, measure in (
        (
            f"{points:,} × {samples:,}",
            points * samples,
            "solving the same cells",
            lambda clock: fragility(thetas, amplitudes, samples, turns, clock),
        ),
        (f"1 × {million:,}", million, "drawing them with SciPy", lambda clock: one_point(million, turns, clock)),
    ):
        (own, others), (seconds, other_seconds) = measure(time.process_time), measure(time.perf_counter)
        ratios = [f"{own / others:.2f}", f"{seconds / other_seconds:.2f}"]
        rows.append([name, number(1e9 * own / cells), f"{other} ({number(1e9 * others / cells)} ns)", *ratios])
    text = (
        f"{table(['grid points × samples', 'ns a sample', 'in comparison with', 'ratio', 'by the clock'], rows)}\n"
        "Time of processor, all cores together, its ratio, and that of the time by the clock, for which `slipsweep` "
        f"has {cores()} cores and SciPy uses one: `slipsweep.sample` with three uncertain inputs, five quantiles and "
        "three thresholds, as in `sweeps/fragility.toml`; `slipsweep.sweep` with the displacement, the mode and the "
        f"flags of all samples, in the order in which they are drawn. Ten cycles of a sine; medians over {turns} "
        f"rounds. {measured_on(('numpy', 'numba', 'scipy'))} Written by `python -m benchmarks.uncertainty`.\n"
    )
    print(text)
    (given.folder / "uncertainty.md").write_text(text)


if __name__ == "__main__":
    main()
