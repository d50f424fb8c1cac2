"""The solvers held to each other: ``python -m benchmarks.agreement`` writes agreement.md.

Draws cells as tests/support/agreement.py does, under all options and waveforms, and solves each in
every way that there is; records as tests/support/made_up_records.py does; and many more cells under
plain waves, in batches and from event to event, as tests/support/sine_cells.py does.
``.ci/include-report`` puts the table into docs/waveforms.md.  Nothing is timed; it ends with an
error where two ways disagree.
"""

import random
from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import chain
from statistics import median

from benchmarks.machine import arguments, measured_on, number, table
from tests.support.agreement import FLOORS, Comparison, compare, group_of
from tests.support.made_up_records import SEEN, difference, made
from tests.support.sine_cells import drawn, times_bound

#: Cells drawn, and in a group; and for each group made-up records, and cells under a plain wave.
CELLS = 10_000
SIZE = 32
RECORDS = 4
PLAIN = 5_000

#: What the made-up records are held to.
BY_RECORD = "reference under a record"


def rows_of(found: dict[str, list[Comparison]]) -> list[list[object]]:
    """A line a kind: counts, median and worst difference, the worst over its bound."""
    rows: list[list[object]] = []
    for kind, comparisons in found.items():
        differences = [comparison.difference for comparison in comparisons]
        times = [comparison.times_bound for comparison in comparisons]
        agreed = sum(ratio <= 1.0 for ratio in times)
        shown = (number(value, 2) for value in (median(differences), max(differences), max(times)))
        rows.append([kind.replace("_", " "), len(times), agreed, *shown])
    return rows


def compare_records(seed: int) -> Iterator[Comparison]:
    """The comparisons of some made-up records."""
    for record_seed in range(seed, seed + RECORDS):
        largest = difference(made(record_seed))
        yield Comparison(
            BY_RECORD,
            "record",
            1,
            largest,
            largest / SEEN,
            f"tests.support.made_up_records.made({record_seed})",
        )


HEADER = [
    "the cycle solver against",
    "cells",
    "agreed",
    "median difference",
    "largest",
    "largest over its bound",
]


def main() -> None:
    """Draw, compare, write agreement.md."""
    options = arguments(__doc__, counts={"cells": CELLS, "seed": -1})
    # a test draws the same cells each time
    seed = options.seed if options.seed >= 0 else 0 if options.tiny else random.randrange(2**31)
    cells = 2 * SIZE if options.tiny else options.cells
    print(f"seed {seed}", flush=True)
    kinds: dict[str, list[Comparison]] = {kind: [] for kind in (*FLOORS, BY_RECORD)}
    regimes: dict[str, list[Comparison]] = defaultdict(list)
    modes: Counter[int] = Counter()
    wrong: list[str] = []
    in_batches: list[float] = []
    for first in range(0, cells, SIZE):
        number_of_group = first // SIZE
        group = group_of(seed + number_of_group, min(SIZE, cells - first))
        plain = drawn(seed + number_of_group, PLAIN)
        times = times_bound(plain)
        in_batches.append(float(times.max()))
        if not times.max() <= 1.0:
            wrong.append(plain.cell(int(times.argmax())))
            print(f"batches: {wrong[-1]}", flush=True)
        for comparison in chain(compare(group), compare_records(seed + RECORDS * number_of_group)):
            kinds[comparison.kind].append(comparison)
            if comparison.kind.startswith("step"):
                regimes[comparison.regime].append(comparison)
                modes[comparison.mode] += 1
            if not comparison.times_bound <= 1.0:
                wrong.append(comparison.text)
                print(f"{comparison.kind}: {comparison.text}", flush=True)
        if first % (50 * SIZE) == 0:
            print(f"{first} cells, {len(wrong)} disagreements", flush=True)
    by_kind = table(
        HEADER, rows_of({kind: comparisons for kind, comparisons in kinds.items() if comparisons})
    )
    by_regime = table(
        [HEADER[0].replace("the cycle", "the step"), *HEADER[1:]],
        rows_of(dict(sorted(regimes.items()))),
    )
    print(by_kind, by_regime, sep="\n")
    head = (
        f"{cells:,} cells, {modes[0]:,} of them stuck, {modes[1]:,} in stick–slip, "
        f"{modes[2]:,} in continuous sliding, {modes[-1]:,} without a value. "
        f"{measured_on(('numpy', 'numba'))} "
        f"Written by `python -m benchmarks.agreement --cells {cells} --seed {seed}`."
    )
    batches = (
        f"{PLAIN * len(in_batches):,} cells under a sine, solved in batches and from event to "
        f"event, differ by {number(max(in_batches), 2)} of their bound at most."
    )
    page = f"{head}\n\n{by_kind}\n{by_regime}\n{batches}\n"
    (options.folder / "agreement.md").write_text(page, encoding="utf-8")
    if wrong:
        raise SystemExit(f"{len(wrong)} disagreements")


if __name__ == "__main__":
    main()
