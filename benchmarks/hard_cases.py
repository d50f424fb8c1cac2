"""The hard cases and how each solver fares: ``python -m benchmarks.hard_cases``.

Solves the cells of tests/support/hard_cells.py and all their neighbours one ulp away in multiple
precision into tests/data/hard_cases.csv, and writes docs/hard-cases.md.  Nothing is timed.
"""

import csv
from concurrent.futures import ProcessPoolExecutor
from statistics import median
from typing import Any

import numpy as np
from mpmath import mpf

from benchmarks.machine import DOCS, cores, number, table
from tests.support.cases import DATA, OPTIONAL_INPUTS, PARAMETERS, Case, Found, read_cases, solve
from tests.support.hard_cells import CATEGORIES, G, conditioning, dtype_of

STEPPED = [(rule, steps) for rule in ("trapezoid", "simpson") for steps in (1024, 4096)]


def row_of(number_of_case: int, category: str, cell: dict[str, Any]) -> dict[str, Any]:
    """One line of hard_cases.csv."""
    defaults = {"model": "mendez", "rise": "monotone", "recoupling": "eq12", "g": G}
    bounds = conditioning(cell, dtype_of(category))
    return {"case": number_of_case, "category": category, **defaults, **cell, **bounds}


def write_cases() -> None:
    """Solve every cell and its neighbours, and write hard_cases.csv."""
    names, cells = zip(
        *((category.__name__, cell) for category in CATEGORIES for cell in category()), strict=True
    )
    with ProcessPoolExecutor(cores()) as pool:
        rows = list(pool.map(row_of, range(len(cells)), names, cells))
    columns = [
        *(
            "case",
            "category",
            "model",
            "rise",
            "recoupling",
            *PARAMETERS,
            "cycles",
            "g",
            *OPTIONAL_INPUTS,
        ),
        *(
            "permanent_displacement",
            "displacement_bound",
            "peak_relative_velocity",
            "velocity_bound",
        ),
        *("sliding_mode", "validity", "outcomes"),
    ]
    with (DATA / "hard_cases.csv").open("w", newline="") as file:
        writer = csv.DictWriter(
            file, columns, lineterminator="\n", extrasaction="ignore", restval=""
        )
        writer.writeheader()
        writer.writerows(rows)


def span(values: list[float]) -> str:
    """Least to greatest."""
    low = number(min(values), 2)
    high = number(max(values), 2)
    return low if low == high else f"{low} – {high}"


def errors_table(cases: list[Case], answers: dict[str, dict[int, Found]]) -> str:
    """A line a category: conditioning, and the errors of every solver in units of it."""
    rows = []
    for name in (category.__name__ for category in CATEGORIES):
        of_category = [case for case in cases if case.category == name]
        moving = [case for case in of_category if float(case.permanent_displacement or "0")]
        row = [name.replace("_", " "), len(of_category)]
        relative = [
            float(mpf(case.displacement_bound) / abs(mpf(case.permanent_displacement)))
            for case in moving
        ]
        row.append(span(relative) if relative else "at rest")
        for answers_of_solver in answers.values():
            answered = [case for case in of_category if case.sliding_mode >= 0]
            kept = [
                float(np.dtype(dtype_of(name)).type(answers_of_solver[case.case][0]))
                for case in answered
            ]  # as in a file
            times = [
                case.times_bounds((displacement, 0.0, 0, 0))[0]
                for case, displacement in zip(answered, kept, strict=True)
            ]
            row.append(f"{number(median(times), 2)}, {number(max(times), 2)}")
        rows.append(row)
    header = ["hard because of", "cells", "conditioning", *answers]
    return table(header, rows)


def main() -> None:
    """Write tests/data/hard_cases.csv and docs/hard-cases.md."""
    write_cases()
    cases = read_cases("hard_cases")
    answers = {"cycle": solve(cases, solver="cycle")}
    for rule, steps in STEPPED:
        answers[f"{rule}, {steps}"] = solve(cases, solver="step", rule=rule, steps_per_cycle=steps)
    dangers = [
        [category.__name__.replace("_", " "), (category.__doc__ or "").rstrip(".")]
        for category in CATEGORIES
    ]
    (DOCS / "hard-cases.md").write_text(f"""# Hard cases

Cases with the largest effects of rounding, and the errors of the solvers in them. Written by
`python -m benchmarks.hard_cases`; the cells are defined in tests/support/hard_cells.py, and are
stored with their solutions in tests/data/hard_cases.csv ({len(cases)} cells).
tests/kernels/test_accuracy.py tests the solvers against this page.

## What could go wrong

{table(["hard because of", "what could go wrong"], dangers)}
## Errors in units of the conditioning

*Conditioning* is the largest relative change of the exact displacement when one of the inputs (θ,
μs, A, f, g, and Üy, λ, Δμ where given) changes by one ulp, plus half an ulp of the displacement
itself. It is computed, not estimated: every neighbour of every cell is solved in multiple precision
(tests/support/reference.py). The column has the smallest and the largest of the cells of a category
that slide. A solver with inputs in double precision cannot guarantee an error below 1 in these
units.

Errors of the permanent displacement are divided by that bound, cell by cell: median, then largest.
For the step solver the heading has the rule and the steps per cycle; its errors decrease with the
step, until rounding dominates. That of V over a cycle, some 1e-14 A/ω, adds up with the square of
the number of cycles: for a million cycles the step solver is no tool.

{errors_table(cases, answers)}
The errors of the cycle solver must be at most 100 everywhere, also for the peak velocity. Where one
ulp of an input changes the sliding mode or a flag, a solver may give that of either side (column
`outcomes` of the data file); a neighbour without a value is left out of the bound.

The step solver must converge at first order at least, everywhere (sixteen times the steps, from
1024 on, a twelfth of the error), until its error is at most 100. Steps of equal length do not
converge where the motion changes within a shorter time. `kernels/step.py` therefore has two rules.
A slide that lasts less than a few steps (just above yield, or where Eq. 4 touches Üg between two
nodes) gets steps of its own, which grow with the time since its onset. A step in which the friction
decays is halved until Eq. 4 is nearly straight in it. Where the two halves of a cycle are mirror
images, V over many cycles is the integral of the part of D that both have in common. A sum with the
other part, which cancels, would have a rounding error of 1e-14 per cycle; on a nearly level base
this is more than the sum itself.
""")


if __name__ == "__main__":
    main()
