"""Hard records (docs/hard-cases.md): the error of Newmark's block against what one ulp of the inputs does."""

from decimal import Decimal, localcontext

import numpy as np
import pytest

from slipsweep import Record, sweep
from tests.support.hard_records import CATEGORIES, DIGITS, Category, Cell, conditioning

#: Of the conditioning bound, as for the hard cases of harmonic motion.
MOST_TIMES = 100


def solved(cell: Cell) -> tuple[float, float, int]:
    """Displacement, peak velocity and slips of the package."""
    times = cell.times
    record = Record.sampled(cell.samples, cell.interval) if times is None else Record(times, cell.samples)
    found = sweep(
        0.0,
        0.5,
        excitation=record,
        scale=cell.scale,
        yield_acceleration=cell.onset,
        model="newmark",
        variables=["permanent_displacement", "peak_relative_velocity", "number_of_slips"],
    )
    return float(found.permanent_displacement), float(found.peak_relative_velocity), int(found.number_of_slips)


def test_there_are_two_hundred() -> None:
    assert sum(1 for category in CATEGORIES for _ in category.cells()) >= 200


@pytest.mark.parametrize("category", CATEGORIES, ids=lambda category: category.name)
def test_newmark_within_100_times_the_conditioning(category: Category) -> None:
    wrong = []
    for number, cell in enumerate(category.cells()):
        exact, displacement_bound, velocity_bound = conditioning(cell)
        displacement, velocity, _ = solved(cell)
        with localcontext(prec=DIGITS):
            times = [
                float(abs(Decimal(answer) - own) / bound) if answer != own else 0.0
                for answer, own, bound in (
                    (displacement, exact.displacement, displacement_bound),
                    (velocity, exact.velocity, velocity_bound),
                )
            ]
        if not max(times) <= MOST_TIMES:
            wrong.append(f"{number}: {times[0]:.1e} (u) and {times[1]:.1e} (v) times the conditioning bound")
    assert not wrong


def test_a_million_samples() -> None:
    """A quarter of a million equal pulses, each of which comes to rest: u is that of one, times their number."""
    pulse = np.array([0.0, 1.0, 0.0, -1.0])
    exact, bound, _ = conditioning(Cell(np.append(pulse, 0.0), 0.3, interval=0.007))
    displacement, velocity, slips = solved(Cell(np.append(np.tile(pulse, 250_000), 0.0), 0.3, interval=0.007))
    assert slips == 250_000
    assert abs(displacement / 250_000 - float(exact.displacement)) <= MOST_TIMES * float(bound)
    assert velocity == pytest.approx(float(exact.velocity), rel=1e-14)
