"""What a cell costs, what the machine could do, what is reached: ``python -m benchmarks.roofline`` writes roofline.md.

The machine's two ceilings, arithmetic and memory, are measured by loops that do nothing
else.  Operations are counted from the formulas, not from the code: what is left when
everything that is not the mathematics costs nothing.
"""

import functools
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any

import numpy as np
from numba import njit, types

import slipsweep
from benchmarks.grids import regime_box, regime_cells
from benchmarks.machine import alternate, arguments, cores, measured_on, number, table
from benchmarks.report import displacement, size_of, steps_taken
from slipsweep.jit import form
from slipsweep.jit.decorators import inlined

#: Operations of the building blocks; a fused multiply-add is one, a division or root is one.
EXP, LOG, VERSINE, ARCSINE = 20, 20, 13, 23
#: Eqs. 2, 4 and 6 at a given friction, and the sums of a quadrature.
NODE = 10
NODES = 12
#: Continuous sliding: nodes before Üg = Üy, and a series for two integrals over the quarter.
EARLY_NODES, SERIES = 8, 2 * 31
#: Eqs. 7-11 and λ; half of it where nothing beyond the Coulomb yield value is wanted.
SETUP = 25 + LOG
#: Newmark's displacement: a polynomial of a root of a quotient.
NEWMARK = 26 + 6
#: Two integrals of the hold, in closed form, and one Newton step towards the stop.
HELD, NEWTON = 50, 30

#: Operations of a cell at the least: what each regime cannot do without.
CYCLE_OPERATIONS = {
    "stuck": SETUP,
    "stick_slip, yield governs": SETUP + 2 * (EXP + NODE) + ARCSINE + 2 * HELD + 3 * NEWTON,
    "stick_slip, Eq. 4 governs": SETUP + 2 * (EXP + NODE) + 2 * ARCSINE + NODES * (VERSINE + EXP + NODE) + 3 * HELD,
    "continuous": SETUP + ARCSINE + SERIES + EARLY_NODES * (VERSINE + EXP + NODE),
    "newmark": SETUP // 2 + NEWMARK,
}
#: Operations of a step of the rectangle rule: Eq. 4 (but on the hold) and the two sums.
STEP_OPERATIONS = {"stick_slip": EXP // 2 + NODE + 4, "continuous": EXP + NODE + 4, "newmark": 6}


@inlined
def _sixteen(x: float) -> float:
    """16 multiply-adds, each of which waits for the one before."""
    x = (((x * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1
    x = (((x * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1
    x = (((x * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1
    return (((x * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1) * 0.9 + 0.1


def _turns(values: np.ndarray, turns: int) -> None:
    """16 multiply-adds on every value, `turns` times; the values stay in the first-level cache."""
    for _ in range(turns):
        for i in range(values.size):
            values[i] = _sixteen(values[i])


@functools.cache
def _multiply_add() -> Callable[[np.ndarray, int], None]:
    """`_turns`, compiled as kernels are: for registers as wide."""
    compiled: Callable[[np.ndarray, int], None] = form.compiled(
        _turns, (types.float64[::1], types.int64), None, nullcontext()
    )
    return compiled


@njit(nogil=True)
def _triad(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    """STREAM's triad."""
    for i in range(a.size):
        a[i] = b[i] + 3.0 * c[i]


@njit(nogil=True)
def _fill(a: np.ndarray) -> None:
    for i in range(a.size):
        a[i] = 1.0


def slot(tiny: bool) -> float:
    """Processor time of one multiply-add in registers on one core, s: a slot, in which machines compare."""
    values, turns, times = np.ones(1024), 10 if tiny else 20_000, []
    multiply_add = _multiply_add()  # compiled before the clock starts
    for _ in range(5):
        start = time.process_time()
        multiply_add(values, turns)
        times.append((time.process_time() - start) / (values.size * 16 * turns))
    return min(times)  # a ceiling is the best that was seen


def _on_all_cores(work: Callable[[int], object]) -> Callable[[], object]:
    """Call ``work(core)`` once on each core at a time."""
    pool = ThreadPoolExecutor(cores())
    return lambda: list(pool.map(work, range(cores())))


def ceilings(tiny: bool) -> dict[str, float]:
    """Multiply-adds and bytes a second of all cores together."""
    size, turns = (10_000, 10) if tiny else (20_000_000, 20_000)
    small = [np.ones(1024) for _ in range(cores())]
    large = [[np.ones(size) for _ in range(3)] for _ in range(cores())]
    multiply_add = _multiply_add()
    work: dict[str, Callable[[], object]] = {
        "multiply-add": _on_all_cores(lambda core: multiply_add(small[core], turns)),
        "triad": _on_all_cores(lambda core: _triad(*large[core])),
        "fill": _on_all_cores(lambda core: _fill(large[core][0])),
        "fresh": _on_all_cores(lambda core: np.full(size, 1.0)),
    }
    amount = {"multiply-add": 1024 * 16 * turns, "triad": 24 * size, "fill": 8 * size, "fresh": 8 * size}
    times = alternate(work, 2 if tiny else 9, typical=min)  # a ceiling is the best that was seen
    return {name: cores() * amount[name] / seconds for name, seconds in times.items()}


def _rows(regimes: dict[str, int], peak: float, tiny: bool, solver: str) -> list[list[str]]:
    """One row a regime; `regimes` gives the operations of a cell or of a step."""
    # cells on axes; but steps, of which a cell has many, of cells that do not slide on
    make, count = (regime_box, 4_000_000) if solver == "cycle" else (regime_cells, 20_000)
    grids = {regime: make(regime, 64 if tiny else count) for regime in regimes}

    def run(cells: dict[str, Any]) -> Callable[[], object]:
        method = slipsweep.Step("rectangle", 1024) if solver == "step" else slipsweep.Cycle()
        return lambda: displacement(**cells, solver=method)

    times = alternate({regime: run(cells) for regime, cells in grids.items()}, 2 if tiny else 7)
    rows = []
    for regime, operations in regimes.items():
        units = size_of(grids[regime]) if solver == "cycle" else float(steps_taken(grids[regime], regime).sum())
        each = times[regime] * cores() / units
        least = operations * cores() / peak
        row = [regime.replace("_", "–"), str(operations), number(least * 1e9, 2), number(each * 1e9)]
        row.append(number(each * peak / cores()))
        rows.append([*row, number(operations / each / 1e9, 2), f"{least / each:.1%}"])
    return rows


def main() -> None:
    """Measure, count, write roofline.md."""
    given = arguments(__doc__)
    found = ceilings(given.tiny)
    peak = found["multiply-add"]
    header = ["", "operations", "ns at the peak", "ns reached", "slots reached", "G/s and core", "of the peak"]
    cycle = _rows(CYCLE_OPERATIONS, peak, given.tiny, "cycle")
    step = _rows(STEP_OPERATIONS, peak, given.tiny, "step")
    balance = 8 * peak / found["fresh"]
    busiest = max(float(row[3]) for row in cycle) * 1e-9 / cores()
    bound = 8 / found["fresh"]
    text = f"""# Roofline

{measured_on(("numpy", "numba", "llvmlite"))}
Written by `python -m benchmarks.roofline`.

## What the machine could do

{
        table(
            ["all cores together", ""],
            [
                ["multiply-adds in registers, G/s", number(peak / 1e9)],
                ["STREAM triad, GB/s", number(found["triad"] / 1e9)],
                ["fill of memory in use, GB/s", number(found["fill"] / 1e9)],
                ["fill of fresh memory (`np.full`), GB/s", number(found["fresh"] / 1e9)],
            ],
        )
    }
Operations count a fused multiply-add, a division or a root as one, and are those of the formulas at
the least: Eqs. 7–11, the phases of the events, {NODES} nodes of quadrature where Eq. 4 is followed
({EARLY_NODES} before the first Üg = Üy of continuous sliding, whose whole quarters are a series), each an
exponential ({EXP}), a versine ({VERSINE}) and Eq. 4 ({NODE}). A slot is the time of one multiply-add on one core.

## The cycle solver, a cell

{table(header, cycle)}
A cell reads its share of the axes, which stay in the first-level cache, and writes 8 bytes into fresh
memory. Up to {balance:.0f} operations a result memory would be the limit, beyond that arithmetic is.
A 3-D sweep does a cell's operations for every 8 bytes and is bound by arithmetic in every regime that
has more of them than that.
With the frequency as a fourth axis a cell is solved once and written F times: from
F ≈ {max(busiest / bound, 1):.0f} on the costliest regime is bound by the {
        number(bound * 1e9, 2)
    } ns that a fresh double takes.

What keeps the cells from the peak: Newton iterations and root brackets are chains of operations that
wait for each other; divisions, roots and comparisons have a fraction of the multiply-adds' throughput;
and lanes in which an event is still sought hold up those that have found it.

## The step solver, a step of the rectangle rule

{table(header, step)}
Steps are those between a cell's onset and its stop. With b held their sums come from a table that all cells
share. By Eq. 4 rates are computed 32 at a time; what they cost is the exponential. The rest of a cell's time
is its events, chains of operations that wait for each other. Main memory plays no part (8 bytes a cell, once).
Steps whose sum is taken from a table, or from the cycle before, count as well: they may come to more than the peak.
"""
    (given.folder / "roofline.md").write_text(text)


if __name__ == "__main__":
    main()
