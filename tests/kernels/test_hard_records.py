"""Hard records (docs/hard-cases.md): the error of Newmark's block against what one ulp of the
inputs does.
"""

import numpy as np
import pytest

from slipsweep import Record, sweep
from tests.support.digits import workdps
from tests.support.hard_records import CATEGORIES, Category, Cell, conditioning

#: Of the conditioning bound, as for the hard cases of harmonic motion.
MOST_TIMES = 100


def solved(cell: Cell) -> tuple[float, float, int]:
    """Displacement, peak velocity and slips of the package."""
    times = cell.times
    record = (
        Record.sampled(cell.samples, cell.interval)
        if times is None
        else Record(times, cell.samples)
    )
    names = ["permanent_displacement", "peak_relative_velocity", "number_of_slips"]
    found = sweep(
        0.0,
        0.5,
        excitation=record,
        scale=cell.scale,
        yield_acceleration=cell.onset,
        model="newmark",
        variables=names,
    )
    return found[names[0]].item(), found[names[1]].item(), found[names[2]].item()


@pytest.mark.parametrize("category", CATEGORIES, ids=lambda category: category.__name__)
def test_newmark_within_100_times_the_conditioning(category: Category) -> None:
    wrong = []
    for number, cell in enumerate(category()):
        exact, *bounds = conditioning(cell)
        with workdps(60):
            own = (exact.permanent_displacement, exact.peak_relative_velocity)
            times = [
                float(abs(a - b) / bound)
                for a, b, bound in zip(solved(cell), own, bounds, strict=False)
            ]
        if not max(times) <= MOST_TIMES:
            wrong.append(
                f"{number}: {times[0]:.1e} (u) and {times[1]:.1e} (v) times the conditioning bound"
            )
    assert not wrong


def test_a_million_samples() -> None:
    """A quarter of a million equal pulses, each of which comes to rest: u is that of one, times
    their number.
    """
    pulse = np.array([0.0, 1.0, 0.0, -1.0])
    exact, bound, _ = conditioning(Cell(np.append(pulse, 0.0), 0.3, interval=0.007))
    displacement, velocity, slips = solved(
        Cell(np.append(np.tile(pulse, 250_000), 0.0), 0.3, interval=0.007)
    )
    assert slips == 250_000
    assert abs(displacement / 250_000 - float(exact.permanent_displacement)) <= MOST_TIMES * float(
        bound
    )
    assert velocity == pytest.approx(float(exact.peak_relative_velocity), rel=1e-14)
