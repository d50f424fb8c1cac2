"""What a cell takes by few steps and by many, and one step more, over the time of the first version of `commits`.

``python -m benchmarks.steps`` writes steps.md.  Two versions run in turn as those of `benchmarks.commits` do, a
process of one thread for each.
"""

import statistics

from benchmarks.commits import BASE, answer, ask, git, running
from benchmarks.grids import BOXES, REGIMES, RULES, G
from benchmarks.machine import arguments, measured_on, number, table

COUNTS = (64, 1024, 4096)

#: Cells along θ and μs; eight times as many along the amplitude.
SIDE = 10

#: Solves a regime by so many steps of a rule, with the slipsweep that it finds, by whichever interface it has.
CHILD = f"""
import sys, time
import numpy as np
import slipsweep

boxes, side = {BOXES}, max(2, int({SIDE} * float(sys.argv[2])))
for line in sys.stdin:
    regime, rule, count = line.split()
    theta, mu_s, amplitude = (np.linspace(*ends, size) for ends, size in zip(boxes[regime], (side, side, 8 * side)))
    solver = {{"solver": "step", "rule": rule, "steps_per_cycle": int(count)}}
    if hasattr(slipsweep, "Step"):
        solver = {{"solver": slipsweep.Step(rule, int(count))}}
    if regime == "newmark":
        solver["model"] = "newmark"
    start = time.process_time()
    slipsweep.sweep(theta, mu_s, {G} * amplitude, 1.0, variables=["permanent_displacement"], **solver)
    print(time.process_time() - start, flush=True)
"""


def row_of(regime: str, rule: str, found: dict[int, list[list[float]]], cells: int) -> list[object]:
    """A line of the table: of all rounds the median of the ratios, and of the time that one step more takes."""
    ratios = [statistics.median(b / a for a, b in zip(*seconds, strict=True)) for seconds in found.values()]
    few, many = COUNTS[0], COUNTS[-1]
    before, now = (
        [(b - a) / (many - few) for a, b in zip(found[few][of], found[many][of], strict=True)] for of in (0, 1)
    )
    more = statistics.median(b / a for a, b in zip(before, now, strict=True))
    each = number(statistics.median(now) / cells * 1e9)
    return [regime.replace("_", "–"), rule, *(f"{ratio:.2f}" for ratio in ratios), f"{more:.2f}", each]


def main() -> None:
    """Measure, and write the table."""
    given = arguments(__doc__, counts={"rounds": 9})
    rounds, rules, many = (1, RULES[:1], 0.2) if given.tiny else (given.rounds, RULES, 1.0)
    versions = [BASE, git("rev-parse", "HEAD")]
    cells, rows = 8 * max(2, int(SIDE * many)) ** 3, []
    with running(versions, many, CHILD) as children:
        for regime in (regime for regime in REGIMES if regime != "stuck"):
            for rule in rules:
                found: dict[int, list[list[float]]] = {}
                for count in COUNTS:
                    seconds: list[list[float]] = [[], []]
                    for _ in range(rounds + 1):
                        for child, taken in zip(children.values(), seconds, strict=True):
                            ask(child, f"{regime} {rule} {count}")
                            taken.append(answer(child))
                    found[count] = [taken[1:] for taken in seconds]  # the first may have compiled
                rows.append(row_of(regime, rule, found, cells))
    header = ["regime", "rule", *(f"{count} steps" for count in COUNTS), "a step more", "ns"]
    about = (
        f"Processor time of version {versions[1][:7]} over that of {versions[0]}: of a cell by so many steps a cycle, "
        f"and of one step more, which is what {COUNTS[-1]:,} steps take beyond {COUNTS[0]:,}, for each of them; and "
        f"that now, ns. The permanent displacement of {cells:,} cells of one regime, ten cycles, one thread; medians "
        f"of {rounds} rounds, in turn. {measured_on()} Written by `python -m benchmarks.steps`."
    )
    (given.folder / "steps.md").write_text(f"{table(header, rows)}\n{about}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
