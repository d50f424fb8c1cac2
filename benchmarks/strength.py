"""Error of the default steps if the strength changes in a slide: ``python -m benchmarks.strength``.

Random cells by the default steps, against steps eight times as fine, which
tests/kernels/test_changing_strength.py holds to SciPy's integrator.  Writes strength.md.
"""

import time
from typing import Any, Literal

import numpy as np
import xarray as xr

import slipsweep
from benchmarks.machine import arguments, measured_on, table
from slipsweep.model.options import STRENGTH_STEPS

SLIDING: tuple[Literal["downslope", "both"], ...] = ("downslope", "both")
STRENGTHS: tuple[Literal["weakening", "rate"], ...] = ("weakening", "rate")


def random_cells(rng: np.random.Generator, count: int, strength: str) -> dict[str, Any]:
    """Return random cells that slide: slopes to 15°, 0.3 to 10 Hz, 1.01 to 4 times the yield."""
    theta = rng.uniform(0.0, 15.0, count) * (rng.random(count) < 0.7)
    mu_s = np.tan(np.radians(theta)) + rng.uniform(0.03, 0.5, count)
    onset = slipsweep.Newmark().g * np.tan(np.arctan(mu_s) - np.radians(theta))
    inputs = {
        "theta": theta,
        "mu_s": mu_s,
        "amplitude": onset * rng.uniform(1.01, 4.0, count),
        "frequency": 10.0 ** rng.uniform(-0.5, 1.0, count),
    }
    if strength == "weakening":
        inputs["residual_mu"] = mu_s * rng.uniform(0.3, 1.0, count)
        inputs["weakening_distance"] = 10.0 ** rng.uniform(-3.0, 0.0, count)
    else:
        inputs["fast_mu"] = mu_s * rng.uniform(0.3, 1.6, count)
        inputs["rate_constant"] = 10.0 ** rng.uniform(0.0, 2.2, count)
    return {name: xr.DataArray(values, dims="case") for name, values in inputs.items()}


def errors_of(inputs: dict[str, Any], model: slipsweep.Newmark) -> tuple[np.ndarray, float]:
    """Return errors in u over the largest |u| of each cell, and the seconds that all cells took."""
    finer = slipsweep.Step("simpson", 8 * STRENGTH_STEPS.steps_per_cycle)
    exact = slipsweep.sweep(**inputs, model=model, solver=finer)
    started = time.perf_counter()
    result = slipsweep.sweep(**inputs, model=model)
    took = time.perf_counter() - started
    assert (result.validity == exact.validity).all()
    moved = abs(exact.permanent_displacement)
    if model.sliding == "both":
        moved = np.maximum(exact.largest_displacement, -exact.smallest_displacement)
    errors = abs(result.permanent_displacement - exact.permanent_displacement) / moved
    return errors.values[np.isfinite(errors.values)], took


def row(name: str, sliding: str, errors: np.ndarray, time_of_cell: str) -> list[object]:
    """Return a row of the table."""
    parts = (np.median(errors), np.quantile(errors, 0.99), errors.max())
    return [name, sliding, errors.size, *(f"{part:.0e}" for part in parts), time_of_cell]


def main() -> None:
    """Write the table."""
    options = arguments(__doc__)
    count = 8 if options.tiny else 250
    rng = np.random.default_rng(1)
    rows = []
    everything = []
    for strength in STRENGTHS:
        for sliding in SLIDING:
            model = slipsweep.Newmark(sliding=sliding, strength=strength)
            errors, took = errors_of(random_cells(rng, count, strength), model)
            everything.append(errors)
            rows.append(row(strength, sliding, errors, f"{1e3 * took / count:.2g}"))
    rows.append(row("all", "", np.concatenate(everything), ""))
    heading = ["strength", "sliding", "cells", "median", "99 %", "largest", "ms a cell"]
    about = (
        f"Errors in u, over the largest |u| of the cell, of {STRENGTH_STEPS}, on "
        f"{4 * count} random cells of ten cycles; those that do not stop have no value. "
        f"{measured_on()} Written by `python -m benchmarks.strength`."
    )
    text = f"{table(heading, rows)}\n{about}\n"
    (options.folder / "strength.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
