"""Newmark's block that slides both ways, in multiple precision: cells, and what one ulp moves.

While v > 0 the block's acceleration is Üy, while v < 0 it is −Üy,up; at v = 0 it rests as long as
−Üy,up ≤ Üg ≤ Üy.  Every section of the shaking is gone through (`tests.support.sections`), and
nothing is passed over.  `CATEGORIES` makes the cells, at 1 rad/s where a waveform shakes them.
"""

import csv
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise
from typing import Any, TypeAlias

import gmpy2
from gmpy2 import mpfr

from slipsweep import Harmonics, Newmark, Record, sweep
from slipsweep.motion.waveforms import WAVEFORMS
from tests.support.cases import DATA
from tests.support.digits import shown, workdps
from tests.support.hard_cells import bound_of
from tests.support.hard_records import _noise
from tests.support.sections import Section, Waveform, root, sections_of_record

#: Digits that the solution has, and further ones that it is computed with.
DIGITS = 30
GUARD = 20

#: The results, in the order of their columns.
RESULTS = (
    "permanent_displacement",
    "largest_displacement",
    "smallest_displacement",
    "peak_relative_velocity",
)


@dataclass(frozen=True)
class Cell:
    """Amplitude, or factor on a record; yield accelerations; waveform, or samples."""

    amplitude: float
    yield_acceleration: float
    upslope_yield_acceleration: float
    waveform: str = "sine"
    harmonics: str = ""
    cycles: int = 4
    ramp_in: float = 0.0
    ramp_out: float = 0.0
    samples: tuple[float, ...] = ()
    interval: float = 1.0


#: Cells that are hard for one reason, which is the docstring.
Category: TypeAlias = Callable[[], Iterator[Cell]]


def shaking_of(cell: Cell) -> Iterator[Section]:
    """Return the sections of the shaking, in the order of time."""
    amplitude = mpfr(cell.amplitude)
    if cell.samples:
        times = [mpfr(cell.interval) * i for i in range(len(cell.samples))]
        yield from sections_of_record(times, [amplitude * mpfr(a) for a in cell.samples])
        return
    wave = Waveform(cell.waveform, cell.harmonics, cell.cycles, cell.ramp_in, cell.ramp_out)
    for n in range(cell.cycles):
        yield from wave.sections(n, amplitude)


class Block:
    """The block's velocity and displacement, and their extremes."""

    def __init__(self, cell: Cell) -> None:
        self.limits = {
            1: mpfr(cell.yield_acceleration),
            -1: mpfr(cell.upslope_yield_acceleration),
        }
        self.tiny = mpfr(cell.amplitude) * mpfr(10) ** -(DIGITS + 10)
        self.v = self.u = self.peak = self.largest = self.smallest = mpfr(0)

    def take(self, section: Section) -> None:
        """Go through a section, from one event to the next."""
        at = section.start
        while at < section.end:
            side = int(gmpy2.sign(self.v))
            if side == 0:
                side, at = self.onset(section, at)
            if side == 0:
                return
            at = self.slide(section, at, side)

    def onset(self, section: Section, at: mpfr) -> tuple[int, mpfr]:
        """Return which way, and where, a block at rest begins to slide; side 0: it does not."""
        ground = section.first if at == section.start else section.ground(at)
        for side, limit in self.limits.items():
            if side * ground > limit + self.tiny:
                return side, at
        for side, limit in self.limits.items():
            if side * section.last > limit and side * section.last > side * ground:
                level = side * limit
                return side, at if side * ground >= limit else max(section.phase(level), at)
        return 0, at

    def slide(self, section: Section, start: mpfr, side: int) -> mpfr:
        """Slide up to the stop, or the end of the section; return where."""
        limit = self.limits[side]

        def rate(ground: mpfr) -> mpfr:
            return side * ground - limit

        cuts = [start, section.end]
        if rate(section.ground(start)) * rate(section.last) < 0:
            turn = section.phase(side * limit)
            cuts = [start, turn, section.end] if start < turn < section.end else cuts
        for a, b in pairwise(cuts):
            gained, moved = section.integrals(rate, a, b, mpfr(0))
            speed = side * self.v
            if speed + gained > self.tiny:
                self.change(side * (speed * (b - a) + moved), side * (speed + gained))
                continue
            stop = b
            if speed + gained < -self.tiny:

                def speed_at(x: mpfr, a: mpfr = a, speed: mpfr = speed) -> mpfr:
                    return speed + section.integrals(rate, a, x, mpfr(0))[0]

                stop = a if speed <= self.tiny else root(speed_at, a, b)
            moved = section.integrals(rate, a, stop, mpfr(0))[1]
            self.change(side * (speed * (stop - a) + moved), mpfr(0))
            return stop
        return section.end

    def change(self, moved: mpfr, velocity: mpfr) -> None:
        """Move the block, and set its velocity."""
        self.u += moved
        self.v = velocity
        self.peak = max(self.peak, velocity)
        self.largest = max(self.largest, self.u)
        self.smallest = min(self.smallest, self.u)

    def run_out(self) -> None:
        """Brake the block after the shaking."""
        if self.v != 0:
            side = int(gmpy2.sign(self.v))
            self.change(side * self.v**2 / (2 * self.limits[side]), mpfr(0))


def solve(cell: Cell) -> tuple[mpfr, ...]:
    """Return `RESULTS` of a cell."""
    with workdps(DIGITS + GUARD):
        block = Block(cell)
        for section in shaking_of(cell):
            block.take(section)
        block.run_out()
        return block.u, block.largest, block.smallest, block.peak


def neighbours(cell: Cell) -> Iterator[Cell]:
    """Return the cell with one of its inputs an ulp up or down; the samples are one input."""
    for toward in (-math.inf, math.inf):
        for name in ("amplitude", "yield_acceleration", "upslope_yield_acceleration"):
            changed: dict[str, Any] = {name: math.nextafter(getattr(cell, name), toward)}
            yield replace(cell, **changed)
        if cell.samples:
            yield replace(cell, interval=math.nextafter(cell.interval, toward))
            moved = (math.nextafter(a, toward) if a else a for a in cell.samples)
            yield replace(cell, samples=tuple(moved))


def conditioning(cell: Cell) -> tuple[tuple[mpfr, ...], list[mpfr]]:
    """Return the results, and how far each moves at most, plus half an ulp of its own."""
    results = solve(cell)
    others = [solve(other) for other in neighbours(cell)]
    with workdps(DIGITS + GUARD):
        columns = zip(*others, strict=True)
        bounds = [bound_of(result, moved) for result, moved in zip(results, columns, strict=True)]
    return results, bounds


# ------------------------------------------------------------------------------------- cells

#: Waveforms with their options.
_WAVES: tuple[dict[str, Any], ...] = (
    {"waveform": "sine"},
    {"waveform": "cosine"},
    {"waveform": "triangle", "ramp_in": 1.5},
    {"waveform": "square", "ramp_out": 1.25},
    {"waveform": "harmonics", "harmonics": "1:1:10,0.6:3:50"},
    {"waveform": "sine", "ramp_in": 1.0, "ramp_out": 2.0},
)

#: Üy/A on a level base below which a sine lets the block never rest, 1/√(1 + π²/4).
LIMIT_OF_REST = 1.0 / math.sqrt(1.0 + math.pi**2 / 4.0)


def waveforms() -> Iterator[Cell]:
    """Every waveform, with other yield accelerations either way."""
    for number, wave in enumerate(_WAVES):
        for downslope, upslope in ((0.2, 0.35), (0.45, 0.15), (0.7, 0.9)):
            yield Cell(1.0 + 0.37 * number, downslope, upslope, **wave)


def onset_at_yield() -> Iterator[Cell]:
    """Peaks that exceed a yield acceleration by next to nothing, downslope, upslope and both."""
    for less in (2.0**-53, 1e-12, 1e-6):
        yield Cell(1.0, 1.0 - less, 2.0, cycles=2)
        yield Cell(1.0, 2.0, 1.0 - less, cycles=2)
        yield Cell(1.0, 1.0 - less, 1.0 - less, "triangle", cycles=2)
        yield Cell(1.0, 1.0 - less, 0.5, "square", cycles=2)


def reversal_without_rest() -> Iterator[Cell]:
    """Blocks that slide back from the instant on at which they stop."""
    for eta in (0.05, 0.2, 0.5):
        for waveform in ("sine", "triangle", "square"):
            yield Cell(2.0, 2.0 * eta, 2.0 * eta, waveform)
    yield Cell(3.0, 0.1, 0.4, "cosine")


def limit_of_rest() -> Iterator[Cell]:
    """A level base, where the stop meets the onset the other way: η about 1/√(1 + π²/4)."""
    for factor in (1.0, 1.0 + 2.0**-52, 1.0 - 2.0**-52, 1.0 + 1e-9, 1.0 - 1e-9):
        yield Cell(1.0, LIMIT_OF_REST * factor, LIMIT_OF_REST * factor, cycles=6)


def grazing_reversals() -> Iterator[Cell]:
    """V comes to 0, exactly or not quite, where Üg is just then at a yield acceleration."""
    level = 1.0
    for onset in (0.25, 0.5, 0.125):
        for wait in (1, 2, 3):
            rest = (0.0,) * wait
            fall = (0.0, level, level, *rest, -onset, -onset, onset, level, 0.0, 0.0)
            yield Cell(1.0, onset, onset, samples=fall, interval=0.25)
            dip = (0.0, level, *rest, onset, level, -level, -onset, *rest, -level, 0.0)
            yield Cell(1.0, onset, 2.0 * onset, samples=dip, interval=0.25)


def records() -> Iterator[Cell]:
    """Records of noise, from gentle slopes to steep ones."""
    for seed, (downslope, upslope) in enumerate(
        ((0.05, 0.05), (0.1, 0.3), (0.3, 0.1), (0.02, 0.9), (0.6, 0.5), (1e-3, 2e-3))
    ):
        samples = tuple(float(a) for a in _noise(500 + seed, 60))
        yield Cell(4.0, 4.0 * downslope, 4.0 * upslope, samples=samples, interval=0.02)


CATEGORIES: tuple[Category, ...] = (
    waveforms,
    onset_at_yield,
    reversal_without_rest,
    limit_of_rest,
    grazing_reversals,
    records,
)


def cells() -> Iterable[tuple[str, Cell]]:
    """Return every cell with the name of its category."""
    return ((category.__name__, cell) for category in CATEGORIES for cell in category())


# ------------------------------------------------------------------------------------- the table

TABLE = DATA / "both_ways.csv"

#: Columns of the inputs; the samples of a record are written one after the other.
INPUTS = tuple(field.name for field in fields(Cell))


@dataclass(frozen=True)
class Row:
    """A line of the table: results in 30 digits, and the conditioning bound of each."""

    category: str
    cell: Cell
    results: tuple[str, ...]
    bounds: tuple[str, ...]

    def times_bounds(self, values: Iterable[float]) -> float:
        """Return the largest error of `RESULTS` in units of its bound."""
        with workdps(DIGITS + GUARD):
            triples = zip(values, self.results, self.bounds, strict=True)
            # a result that is 0 whatever moves by an ulp has to be 0
            least = mpfr(10) ** -300
            return max(
                float(abs(mpfr(value) - mpfr(exact)) / max(mpfr(bound), least))
                for value, exact, bound in triples
            )


def row_of(category: str, cell: Cell) -> Row:
    """Solve a cell and its neighbours."""
    results, bounds = conditioning(cell)
    return Row(
        category,
        cell,
        tuple(shown(value, DIGITS) for value in results),
        tuple(shown(bound, 3) for bound in bounds),
    )


def write_rows(rows: Iterable[Row]) -> None:
    """Write the table."""
    columns = ["category", *INPUTS, *RESULTS, *(f"{name}_bound" for name in RESULTS)]
    with TABLE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            inputs = asdict(row.cell) | {"samples": " ".join(map(repr, row.cell.samples))}
            writer.writerow([row.category, *inputs.values(), *row.results, *row.bounds])


def read_rows() -> list[Row]:
    """Read the table."""
    rows = []
    with TABLE.open(newline="") as file:
        for line in csv.DictReader(file):
            inputs: dict[str, Any] = {name: line[name] for name in INPUTS}
            numbers = (name for name in INPUTS if name not in ("waveform", "harmonics", "samples"))
            inputs |= {name: float(line[name]) for name in numbers}
            inputs["cycles"] = int(line["cycles"])
            inputs["samples"] = tuple(map(float, line["samples"].split()))
            results = tuple(line[name] for name in RESULTS)
            bounds = tuple(line[f"{name}_bound"] for name in RESULTS)
            rows.append(Row(line["category"], Cell(**inputs), results, bounds))
    return rows


def excitation_of(cell: Cell) -> Any:
    """Return the excitation of a cell, as the package takes it."""
    if cell.samples:
        return Record.sampled(cell.samples, cell.interval)
    options: dict[str, Any] = {
        "cycles": cell.cycles,
        "ramp_in": cell.ramp_in,
        "ramp_out": cell.ramp_out,
    }
    if cell.waveform != "harmonics":
        return WAVEFORMS.called(cell.waveform)(**options)
    terms = [term.split(":") for term in cell.harmonics.split(",")]
    amplitudes, multiples, phases = zip(*terms, strict=True)
    return Harmonics(
        [*map(float, amplitudes)], [*map(int, multiples)], [*map(float, phases)], **options
    )


def solve_by_package(cell: Cell) -> tuple[float, ...]:
    """Return `RESULTS` of a cell by `slipsweep.sweep`."""
    shaking: dict[str, Any] = {"scale": cell.amplitude}
    if not cell.samples:
        shaking = {"amplitude": cell.amplitude, "frequency": 1.0 / (2.0 * math.pi)}
    solution = sweep(
        0.0,
        0.1,
        **shaking,
        yield_acceleration=cell.yield_acceleration,
        upslope_yield_acceleration=cell.upslope_yield_acceleration,
        excitation=excitation_of(cell),
        model=Newmark(sliding="both"),
        variables=RESULTS,
    )
    return tuple(float(solution[name]) for name in RESULTS)
