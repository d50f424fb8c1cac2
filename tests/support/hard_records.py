"""Recorded motions to which the response is hardest to solve, and the effect of an ulp of an input.

`CATEGORIES` makes the cells of Newmark's block; `conditioning` is the response, and its bounds.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from gmpy2 import mpfr
from numpy.typing import NDArray

from tests.support.digits import workdps
from tests.support.hard_cells import bound_of
from tests.support.reference import RecordSolution, solve_record

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """Samples at an interval or at times, yield acceleration, and the factor on the samples."""

    samples: Floats
    onset: float
    interval: float = 1.0
    times: Any = None
    scale: float = 1.0


#: Cells that are hard for one reason, which is the docstring.
Category: TypeAlias = Callable[[], Iterator[Cell]]


def solve(cell: Cell) -> RecordSolution:
    """The response of Newmark's block to straight lines between the samples."""
    times = cell.times
    with workdps(60):
        if times is None:
            times = [mpfr(cell.interval) * i for i in range(cell.samples.size)]
        return solve_record(
            times,
            cell.samples,
            0.0,
            0.5,
            scale=cell.scale,
            model="newmark",
            yield_acceleration=cell.onset,
            dps=30,
        )


def neighbours(cell: Cell) -> Iterator[Cell]:
    """Cells with an input an ulp up or down; all samples are an input, and so are all times."""
    for toward in (-math.inf, math.inf):
        yield replace(cell, onset=math.nextafter(cell.onset, toward))
        yield replace(cell, scale=math.nextafter(cell.scale, toward))
        yield replace(
            cell, samples=np.nextafter(cell.samples, np.where(cell.samples == 0.0, 0.0, toward))
        )
        if cell.times is None:
            yield replace(cell, interval=math.nextafter(cell.interval, toward))
        else:
            turns = np.where(np.arange(cell.times.size) % 2, toward, -toward)
            yield replace(cell, times=np.nextafter(cell.times, turns))


def conditioning(cell: Cell) -> tuple[RecordSolution, mpfr, mpfr]:
    """Exact response, and bounds of displacement and peak velocity, with half an ulp of theirs."""
    answer = solve(cell)
    others = [solve(other) for other in neighbours(cell)]
    with workdps(60):
        displacement = bound_of(
            answer.permanent_displacement, (other.permanent_displacement for other in others)
        )
        return (
            answer,
            displacement,
            bound_of(answer.peak_relative_velocity, (o.peak_relative_velocity for o in others)),
        )


# ------------------------------------------------------------------------------------- cells


def _noise(seed: int, count: int, coarse: int = 1) -> Floats:
    """Samples of a band of frequencies under an envelope, from 0 to 0, of peak 1."""
    rng = np.random.default_rng(seed)
    at = np.linspace(0.0, 1.0, count)
    waves = np.sin(
        2.0 * np.pi * (np.arange(2, 14)[:, None] / coarse * at + rng.uniform(size=(12, 1)))
    ).sum(axis=0)
    shaped = np.asarray(waves * np.sin(np.pi * at) ** 2)
    return shaped / float(np.abs(shaped).max())


def onset_on_a_sample() -> Iterator[Cell]:
    """Üy is a sample, or its neighbour: a slide begins at an end of a piece."""
    for seed in range(8):
        samples = _noise(seed, 60)
        rising = np.flatnonzero((samples[1:-1] > 0.05) & (samples[2:] > samples[1:-1])) + 1
        onset = float(samples[rising[seed % rising.size]])
        yield Cell(samples, onset, interval=0.02)
        yield Cell(samples, math.nextafter(onset, (-1) ** seed * math.inf), interval=0.02)


def peak_just_above() -> Iterator[Cell]:
    """a peak one ulp above Üy: the slide is all cancellation."""
    for seed in range(5):
        samples = _noise(100 + seed, 40)
        peak = float(samples.max())
        if peak < 0.9:
            peak = float(-samples.min())
            samples = -samples
        for ulps in (1, 2, 1000):
            yield Cell(samples, peak - ulps * float(np.spacing(peak) / 2.0), interval=0.01)


def plateaus() -> Iterator[Cell]:
    """plateaus at Üy, just above and just below."""
    for onset in (0.3, 1.0, 0.1):
        for above in (0.0, 1e-15, 1e-8, 1e-2):
            high = onset * (1.0 + above)
            yield Cell(np.array([0.0, high, high, high, 0.0, -0.2, 0.0]), onset, interval=0.05)
            yield Cell(
                np.array([0.0, 2 * onset, onset, onset, high, 0.0, 0.0, high, 0.0]),
                onset,
                interval=0.05,
            )
            yield Cell(
                np.array([high, high, 0.0, onset, onset, 3 * onset, onset, 0.0]),
                onset,
                interval=0.05,
            )


def duplicated_zeros() -> Iterator[Cell]:
    """rests at zero, zeros twice, numbers next to zero."""
    for gap in (1, 2, 7):
        rest = [0.0] * gap
        for onset in (0.2, 0.5, 0.99):
            yield Cell(
                np.array([*rest, 1.0, *rest, 1.0, *rest, -1.0, *rest, 1.0, -0.3, 1.0, *rest]),
                onset,
                interval=0.1,
            )
            yield Cell(
                np.array([0.0, 1e-300, 0.0, -0.0, 1.0, 0.0, 5e-324, 0.0, 0.7, -1.0, 0.0]),
                onset,
                interval=0.1,
            )


def many_small_slips() -> Iterator[Cell]:
    """hundreds of slips of some 1e-9 m: rounding adds up."""
    # each of about 1e-9 m: a triangle that exceeds the onset by 2 %
    for seed, count in enumerate((100, 200)):
        tops = 1.0 + 0.02 * np.random.default_rng(seed).uniform(0.5, 1.0, count)
        samples = np.zeros(2 * count + 1)
        samples[1::2] = tops
        yield Cell(samples, 1.0, interval=0.01)


def intervals() -> Iterator[Cell]:
    """intervals from 1e-6 s to 10 s, even or not."""
    for seed, interval in enumerate((1e-6, 1e-5, 1e-4, 1e-3, 0.1, 1.0, 3.0, 10.0)):
        for onset in (0.05, 0.4):
            yield Cell(_noise(200 + seed, 50), onset, interval=interval)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        times = np.concatenate([[0.0], np.cumsum(10.0 ** rng.uniform(-6.0, 1.0, 49))])
        yield Cell(_noise(220 + seed, 50), 0.1, times=times)


def magnitudes() -> Iterator[Cell]:
    """accelerations from 1e-25 to 1e25."""
    for seed, size in enumerate((1e-25, 1e-20, 1e-10, 1e-5, 1e5, 1e10, 1e20, 1e25)):
        for onset in (0.02, 0.8):
            yield Cell(size * _noise(300 + seed, 40), size * onset, interval=0.02)
        yield Cell(_noise(300 + seed, 40), 0.3 * size, interval=0.02, scale=size)


def never_at_rest() -> Iterator[Cell]:
    """Üy next to nothing: V is carried on beyond the record."""
    # small onsets: V is carried from pulse to pulse, and the record ends before the slide
    for seed in range(4):
        samples = _noise(400 + seed, 80)
        for onset in (1e-3, 1e-6, 1e-12):
            yield Cell(np.abs(samples) if seed % 2 else samples, onset, interval=0.01)


def stop_at_a_sample() -> Iterator[Cell]:
    """V reaches 0 at a sample, or just as the next slide begins."""
    # a rectangle in doubles: V is exactly 0 at a sample, at the next onset, or not quite
    for onset in (0.25, 0.5, 0.125):
        for level in (1.0, 2.0, 1.5):
            fall = np.array([0.0, level, level, 0.0, 0.0, 0.0, level, 0.0, 0.0])
            yield Cell(fall, onset, interval=0.25)
            for wait in range(1, 5):
                again = [0.0] * wait
                yield Cell(
                    np.array([0.0, level, *again, onset, level, 0.0, -onset, 0.0]),
                    onset,
                    interval=0.25,
                )


CATEGORIES: tuple[Category, ...] = (
    onset_on_a_sample,
    peak_just_above,
    plateaus,
    duplicated_zeros,
    many_small_slips,
    intervals,
    magnitudes,
    never_at_rest,
    stop_at_a_sample,
)
