"""Error of the default steps where the strength changes while the block slides, on random cells.

    python -m benchmarks.strength [cells]

A cell by steps eight times as fine is the reference; tests/kernels/test_changing_strength.py holds
both to SciPy's integrator.
"""

import sys
import time
from typing import Any, Literal

import numpy as np
import xarray as xr

import slipsweep
from slipsweep.model.options import STRENGTH_STEPS

SLIDING: tuple[Literal["downslope", "both"], ...] = ("downslope", "both")


def random_cells(rng: np.random.Generator, count: int, strength: str) -> dict[str, Any]:
    """Return random cells that slide: slopes to 15°, 0.3 to 10 Hz, 1.01 to 4 times the yield."""
    theta = rng.uniform(0.0, 15.0, count) * (rng.random(count) < 0.7)
    mu_s = np.tan(np.radians(theta)) + rng.uniform(0.03, 0.5, count)
    given = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": 9.81
        * np.tan(np.arctan(mu_s) - np.radians(theta))
        * rng.uniform(1.01, 4.0, count),
        "frequency": 10.0 ** rng.uniform(-0.5, 1.0, count),
    }
    if strength == "weakening":
        given["residual_mu"] = mu_s * rng.uniform(0.3, 1.0, count)
        given["weakening_distance"] = 10.0 ** rng.uniform(-3.0, 0.0, count)
    else:
        given["fast_mu"] = mu_s * rng.uniform(0.3, 1.6, count)
        given["rate_constant"] = 10.0 ** rng.uniform(0.0, 2.2, count)
    return {name: xr.DataArray(values, dims="case") for name, values in given.items()}


def main(count: int) -> None:
    """Print a table of errors."""
    rng = np.random.default_rng(1)
    fine = slipsweep.Step("simpson", 8 * STRENGTH_STEPS.steps_per_cycle)
    print(f"{STRENGTH_STEPS}, error in u over the largest |u| of each cell\n")
    print("| strength | sliding | cells | median | 99 % | largest | µs a cell |")
    print("|---|---|--:|--:|--:|--:|--:|")
    everything = []
    for strength in ("weakening", "rate"):
        for sliding in SLIDING:
            given = random_cells(rng, count // 4, strength)
            model = slipsweep.Newmark(sliding=sliding, strength=strength)
            slipsweep.sweep(**{name: one[:2] for name, one in given.items()}, model=model)
            started = time.perf_counter()
            found = slipsweep.sweep(**given, model=model)
            took = time.perf_counter() - started
            exact = slipsweep.sweep(**given, model=model, solver=fine)
            assert (found.validity == exact.validity).all()
            moved = abs(exact.permanent_displacement)
            if sliding == "both":
                moved = np.maximum(exact.largest_displacement, -exact.smallest_displacement)
            error = abs(found.permanent_displacement - exact.permanent_displacement) / moved
            values = error.values[np.isfinite(error.values)]
            everything.append(values)
            row(f"{strength} | {sliding}", values, 1e6 * took / (count // 4))
    row("all |", np.concatenate(everything), None)


def row(name: str, errors: np.ndarray, took: float | None) -> None:
    """Print a row."""
    parts = (np.median(errors), np.quantile(errors, 0.99), errors.max())
    texts = " | ".join(f"{part:.1e}" for part in parts)
    print(f"| {name} | {errors.size} | {texts} | {'' if took is None else f'{took:.0f}'} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
