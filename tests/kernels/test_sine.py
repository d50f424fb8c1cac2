"""The sine's batches: a cell does not depend on others, accelerations scale, cycles add up, what is left is marked."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from slipsweep.kernels.block import (
    EQ12,
    INTEGRATE,
    LITERAL,
    MONOTONE,
    NOT_RECOUPLED,
    UNSOLVED,
    UPSLOPE,
    Cell,
    Motion,
    Options,
)
from slipsweep.kernels.grid import CELL
from slipsweep.kernels.sine.solve import solve_sine

Array = NDArray[np.float64]
Cells = NDArray[Any]
G = 9.81
PLAIN = Options(MONOTONE, EQ12, 1, True, G)
FIELDS = ("yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")


class Found(NamedTuple):
    displacement: Array
    peak_velocity: Array
    mode: Array
    validity: NDArray[np.int64]
    left: int


def solve(cells: Cells, options: Options = PLAIN) -> Found:
    results = np.full((len(Motion._fields), cells.size), np.nan)
    left = solve_sine(cells, options, results)
    return Found(results[0], results[1], results[2], results[3].astype(int), left)


def cells_of(theta: Array, mu_s: Array, amplitude: Array, **given: Array) -> Cells:
    rest = (np.broadcast_to(given.get(name, math.nan), amplitude.shape).astype(float) for name in FIELDS)
    cells = np.empty(amplitude.shape, CELL)
    for name, values in zip(Cell._fields, (np.tan(np.radians(theta)), mu_s, amplitude, *rest), strict=True):
        cells[name] = values
    return cells


def random_cells(number: int, seed: int) -> Cells:
    """Cells of all kinds: half of them with Coulomb's Üy, half with a measured one, often small."""
    rng = np.random.default_rng(seed)
    theta, mu_s = rng.uniform(0.0, 15.0, number), rng.uniform(0.3, 0.6, number)
    measured = np.where(rng.random(number) < 0.5, math.nan, np.exp(rng.uniform(-3.0, 1.0, number)))
    return cells_of(theta, mu_s, np.exp(rng.uniform(0.0, 2.5, number)), yield_acceleration=measured)


@pytest.mark.parametrize("cycles", [1, 3])
def test_cell_does_not_depend_on_others(cycles: int) -> None:
    """To the last digit: batches are whole, whatever their number."""
    cells, options = random_cells(500, 2), PLAIN._replace(cycles=cycles)
    whole, order = solve(cells, options), np.random.default_rng(3).permutation(500)
    for where in (order, order[:1], order[:33], np.arange(65)):
        part = solve(cells[where], options)
        for found, expected in zip(part[:4], whole[:4], strict=True):
            known = whole.validity[where] != UNSOLVED
            np.testing.assert_array_equal(found[known], expected[where][known])


def test_accelerations_scale() -> None:
    """Twice all accelerations, g among them: twice W and V, bit by bit."""
    cells = random_cells(2000, 4)
    twice = cells.copy()
    for name in ("amplitude", "yield_acceleration"):
        twice[name] *= 2.0
    found, double = solve(cells), solve(twice, PLAIN._replace(g=2.0 * G))
    np.testing.assert_array_equal(double.displacement, 2.0 * found.displacement)
    np.testing.assert_array_equal(double.peak_velocity, 2.0 * found.peak_velocity)
    np.testing.assert_array_equal(double.validity, found.validity)


def test_cycles() -> None:
    """By integration N cycles are N times one; with drift or Eq. 12 second differences of W over N are constant."""
    cells = random_cells(4000, 6)
    one, two, three, four = (solve(cells, PLAIN._replace(cycles=n)) for n in (1, 2, 3, 4))
    solved = four.validity != UNSOLVED
    w1, w2, w3, w4 = (found.displacement[solved] for found in (one, two, three, four))
    np.testing.assert_allclose(w4 - 2.0 * w3 + w2, w3 - 2.0 * w2 + w1, rtol=0.0, atol=1e-11 * np.nanmax(w4))
    recoupled = solved & (four.mode == 1) & (four.validity & NOT_RECOUPLED == 0)
    np.testing.assert_allclose(four.displacement[recoupled], 4.0 * one.displacement[recoupled], rtol=1e-14)
    assert (four.validity[solved] & NOT_RECOUPLED > 0).sum() > 20
    w1, w4 = (solve(cells, PLAIN._replace(recoupling=INTEGRATE, cycles=n)).displacement for n in (1, 4))
    np.testing.assert_array_equal(w4[one.mode == 1], 4.0 * w1[one.mode == 1])


def test_cells_left_are_marked() -> None:
    """Their number is returned; the literal rise leaves all that stick and slip and move.  V may be left out."""
    cells = random_cells(2000, 7)
    monotone, literal = solve(cells), solve(cells, PLAIN._replace(rise=LITERAL))
    without_peak = solve(cells, PLAIN._replace(wants_peak=False))
    for found in (monotone, literal, without_peak):
        assert (found.validity == UNSOLVED).sum() == found.left
    np.testing.assert_array_equal(without_peak.displacement, monotone.displacement)
    assert np.isnan(without_peak.peak_velocity[monotone.peak_velocity > 0.0]).all()
    moves = (literal.mode == 1) & (monotone.displacement != 0.0)
    assert (literal.validity[moves] == UNSOLVED).all()
    assert monotone.left < 20


def test_upslope_is_flagged_where_it_is_no_rounding() -> None:
    """A steep plane drifts upslope over some cycles; on a level plane there is none."""
    cells = cells_of(np.array([16.0, 0.0]), np.array([0.3, 0.3]), np.array([15.0, 8.0]))
    found = solve(cells, PLAIN._replace(cycles=5))
    assert found.mode.tolist() == [2, 2]
    assert (found.validity & UPSLOPE > 0).tolist() == [True, False]
