"""The page docs/accuracy.md, from what has been measured: ``python -m benchmarks.accuracy``.

Takes speed_vs_error.csv as it lies in benchmarks/results, and measures errors against closed forms.
"""

from typing import Any

import numpy as np
import pandas as pd
from mpmath import mpf

import slipsweep
from benchmarks.grids import RULES, G
from benchmarks.machine import DOCS, RESULTS, measured_on, number, table
from benchmarks.speed_vs_error import REGIMES, Point, coarsest
from tests.support import closed_forms

WANTED = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)


def points() -> list[Point]:
    """The points of speed_vs_error.csv."""
    rows = pd.read_csv(RESULTS / "speed_vs_error.csv", float_precision="round_trip")
    return [Point(*row) for row in rows.itertuples(index=False)]


def cycle_errors(points: list[Point]) -> str:
    """Errors and time of the cycle solver."""
    rows = []
    for point in points:
        if point.solver == "cycle":
            errors = (
                number(error, 2)
                for error in (point.median_error, point.error_95, point.worst_error)
            )
            rows.append(
                [point.regime.replace("_", "–"), *errors, number(point.seconds_per_cell * 1e9)]
            )
    return table(["regime", "median", "95 %", "worst", "core time per cell, ns"], rows)


def newmark() -> str:
    """Newmark's block in closed form, and the error of the cycle solver, for waves and a pulse."""
    waves = {
        "square": slipsweep.Square(1),
        "sine": slipsweep.Sine(1),
        "triangle": slipsweep.Triangle(1),
    }
    pulse = slipsweep.Record(np.array([0.0, 1.0]), np.array([G, G]))
    rows = []
    for r in (0.02, 0.1, 0.2, 0.5, 0.8, 0.95):
        block: dict[str, Any] = {"yield_coefficient": r, "model": slipsweep.Newmark(g=G)}
        results = {
            name: slipsweep.sweep(**block, amplitude=G, frequency=1.0, excitation=wave)
            for name, wave in waves.items()
        }
        results["rectangle"] = slipsweep.sweep(**block, excitation=pulse)
        row = [f"{r:g}"]
        for name in ("rectangle", *waves):
            exact = float(getattr(closed_forms, name)(mpf(r)))
            error = abs(float(results[name].permanent_displacement) / G - exact) / exact
            row += [f"{exact:.6g}", number(error, 1)]
        rows.append(row)
    names = ("pulse", "square", "sine", "triangle")
    return table(
        ["Üy/A", *(f"{name}{what}" for name in names for what in (": u/(A T²)", ", error"))], rows
    )


def main() -> None:
    """Write docs/accuracy.md."""
    measured = points()
    (DOCS / "accuracy.md").write_text(f"""# Accuracy

This page compares errors of the solvers, numbers of steps, and the limits of double precision.
{measured_on()} Every number and figure here is written by `python -m benchmarks.accuracy` from the
results of `python -m benchmarks.speed_vs_error`. Errors are relative errors of the permanent
displacement against solutions of 30 digits (tests/support/reference.py), over a fixed random sample
of 64 cells a regime (benchmarks/data/sample.csv), one cycle of loading; "hard" cells lie just above
yield, near static failure, at the mode limit, under sharply decaying friction or on a level plane.

## The cycle solver (default)

{cycle_errors(measured)}
It takes no steps, so that there is no number of steps to choose. The largest errors are in cells
nearest to yield. There the rounding of the inputs alone has the same effect (below).

## Newmark's block in closed form

With r = Üy/A, a rectangular pulse of duration T gives (V²/2Üy)(1 − r) with V = A T (Newmark 1965).
One cycle of a square wave gives u/(A T²) = (1 − r)/(4 (1 + r)), and one of a triangle wave
(3 + 2√2)/48 · (1 − r)³ where r ≥ 3 − 2√2. Under a sine the block stops at the root φ₂ of
cos φ₁ − cos φ = r (φ − φ₁) behind φ₁ = asin r, and
4π² u/(A T²) = (cos φ₁ + r φ₁)(φ₂ − φ₁) − sin φ₂ + sin φ₁ − r (φ₂² − φ₁²)/2.
It always stops within the cycle, so that n cycles give n times as much.
tests/kernels/test_closed_forms.py compares these forms with an integration by SciPy, and both
solvers with these forms. Errors here are those of the cycle solver.

{newmark()}
## The step solver

Time a cell on one core, µs, and in brackets the steps a cycle, for 95 of 100 cells to be within an
error ("–": not within 16384 steps):

{coarsest(measured, REGIMES, RULES, WANTED)}
In stick–slip and for Newmark's block the rectangle rule does better than its order: the first-order
part of its error in the displacement is half a step times the change of velocity, and the block
begins and ends at rest.

![Time a cell against relative error](../benchmarks/results/speed_vs_error.png)

Each point is one solver with one number of steps
([all numbers](../benchmarks/results/speed_vs_error.csv)).

## Where double precision ends

Just above yield the displacement grows as (A − Üy)²: a change of A, of μs or of θ by its last digit
changes it by twice that digit over A/Üy − 1. No solver with inputs in double precision can
guarantee a smaller error. [hard-cases.md](hard-cases.md) has these cells and all other hard ones,
with their conditioning and the errors of each solver in units of it.

## Options of the model

Differences between the options `rise`, `recoupling` and `model` are not numerical errors: the paper
does not specify these rules, and an option selects an interpretation ([trust.md](trust.md)). With
the literal rise the block's acceleration may be below the yield acceleration. Just above yield the
displacement then grows without bound, and some cells have no value. With re-sticking by integration
instead of Eq. 12 the block stops sooner after the base's acceleration has become negative.
""")


if __name__ == "__main__":
    main()
