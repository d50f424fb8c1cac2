"""The sine's batches: reference cases, quadrature by SciPy in every kind of motion, and invariances."""

import math
from collections import defaultdict
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

from slipsweep.kernels.block import (
    EQ12,
    INTEGRATE,
    LITERAL,
    MONOTONE,
    NEWMARK,
    NOT_RECOUPLED,
    UNSOLVED,
    UPSLOPE,
    YIELD_GOVERNS,
    Cell,
    Motion,
    Options,
)
from slipsweep.kernels.grid import CELL
from slipsweep.kernels.sine.solve import solve_sine
from tests.support.cases import read_cases

Array = NDArray[np.float64]
Cells = NDArray[Any]
G = 9.81
PLAIN = Options(MONOTONE, EQ12, 1, True, G)
FIELDS = ("yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")

#: Array that are left to the general kernel, of those in cases.csv: sharp decay, a block that comes to the next
#: pulse in motion and sticks there when at rest, the literal rise.
LEFT = {"literal": 12, "near_failure": 7, "sharp_decay": 4, "given_friction": 2, "measured_yield": 1}


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


@pytest.mark.parametrize("category", sorted({case.category for case in read_cases()}))
def test_reference_cases(category: str) -> None:
    """Each is a batch of its own, within what the last digit of an input moves."""
    left = 0
    for case in (case for case in read_cases() if case.category == category and not case.uplift):
        rise = NEWMARK if case.model == "newmark" else {"monotone": MONOTONE, "literal": LITERAL}[case.rise]
        recoupling = EQ12 if case.recoupling == "eq12" and rise != NEWMARK else INTEGRATE
        options = Options(rise, recoupling, case.cycles, True, G)
        inputs = (np.array([value]) for value in (case.theta, case.mu_s, case.amplitude))
        found = solve(cells_of(*inputs, **{name: np.array([value]) for name, value in case.given}), options)
        left += found.left
        if found.left:
            continue
        omega, validity = 2.0 * math.pi * case.frequency, found.validity[0]
        w, v = float(case.permanent_displacement) * omega**2, float(case.peak_relative_velocity) * omega
        assert found.displacement == pytest.approx(w, rel=2e-13, abs=1e-12 * case.amplitude), case
        assert found.peak_velocity == pytest.approx(v, rel=2e-13, abs=1e-12 * case.amplitude), case
        assert found.mode == case.sliding_mode, case
        if case.model != "newmark" and case.sliding_mode == 1:
            assert (validity & NOT_RECOUPLED == 0) == case.recoupled, case
            assert (validity & YIELD_GOVERNS > 0) == case.eq4_below_yield, case
    assert left == LEFT.get(category, 0)


def by_scipy(cells: Cells, j: int, mode: float, recoupling: int) -> tuple[float, float]:
    """W of a cycle and the largest V of a block that slides, by the rules of docs/model.md."""
    tan_theta, mu_s, amplitude, onset, *_ = cells[j].tolist()
    onset = G * (mu_s - tan_theta) / (1.0 + mu_s * tan_theta) if math.isnan(onset) else onset
    ratio = amplitude / ((onset + G * mu_s) / (1.0 - tan_theta * (mu_s - tan_theta)))
    at_zero, least = (mu_s * ratio, 0.01) if mode == 2 else (mu_s / ratio, mu_s**2 * ratio)
    decay = math.log(at_zero / least) / amplitude

    def eq4(x: float) -> float:
        lag = (G + x * tan_theta) * (mu_s - tan_theta - at_zero * math.exp(-decay * abs(x))) + G * tan_theta
        return x - math.copysign(1.0, x) * lag

    def gains(rate: Callable[[float], float], *ends: float) -> tuple[float, float]:
        """Of V and of W from rest, by parts on which the rate of V is smooth."""
        velocity, moved = 0.0, 0.0
        for left, right in pairwise(ends):
            moment = quad(lambda phi, right=right: (right - phi) * rate(phi), left, right, epsabs=1e-13)[0]
            moved += velocity * (right - left) + moment
            velocity += quad(rate, left, right, epsabs=1e-13)[0]
        return velocity, moved

    def ground(phi: float) -> float:
        return float(amplitude * math.sin(phi))

    if mode == 2:
        start, half = math.asin(onset / amplitude), math.pi / 2
        edges = np.concatenate([np.linspace(start, 2 * half, 5001), np.linspace(2 * half, 4 * half, 5001)[1:]])
        rates = np.array([ground(phi) - eq4(ground(phi)) for phi in 0.5 * (edges[1:] + edges[:-1])])
        steps = np.cumsum(rates * np.diff(edges))
        moved = gains(lambda phi: ground(phi) - eq4(ground(phi)), start, half, 2 * half, 3 * half, 4 * half)[1]
        return moved, max(steps)
    if eq4(onset) >= onset:  # sticks there
        onset = brentq(lambda x: x - eq4(x), onset, amplitude, xtol=1e-14)
    start = math.asin(onset / amplitude)
    # where b leaves the value of the onset, a bend of the rate
    beyond, bend = onset * (1.0 + 1e-7), start
    if eq4(beyond) < onset < eq4(amplitude):
        bend = math.asin(brentq(lambda x: eq4(x) - onset, beyond, amplitude) / amplitude)
    held = max(onset, eq4(amplitude))
    at_peak, moved = gains(lambda phi: ground(phi) - max(onset, eq4(ground(phi))), start, bend, math.pi / 2)

    def velocity(phi: float) -> float:
        return float(at_peak - amplitude * math.cos(phi) - held * (phi - math.pi / 2))

    top = math.pi - math.asin(held / amplitude)
    last = math.pi if recoupling == EQ12 else 2.0 * math.pi
    stop = brentq(velocity, top, last, xtol=1e-14) if velocity(last) < 0.0 else last
    moved += quad(velocity, math.pi / 2, stop)[0] + max(velocity(stop), 0.0) ** 2 / (2.0 * held)
    return moved, velocity(top)


@pytest.mark.parametrize("recoupling", [EQ12, INTEGRATE])
def test_every_kind_by_quadrature(recoupling: int) -> None:
    cells = random_cells(400, 1)
    found = solve(cells, PLAIN._replace(recoupling=recoupling))
    assert found.left <= 8
    kinds: dict[tuple[float, bool], int] = defaultdict(int)
    for j in np.flatnonzero((found.mode > 0) & (found.displacement > 0.0) & (found.validity != UNSOLVED)):
        displacement, peak = by_scipy(cells, int(j), found.mode[j], recoupling)
        assert found.displacement[j] == pytest.approx(displacement, rel=1e-9, abs=1e-10 * cells["amplitude"][j]), j
        assert found.peak_velocity[j] == pytest.approx(peak, rel=1e-6 if found.mode[j] == 2 else 1e-9), j
        kinds[found.mode[j], found.validity[j] & YIELD_GOVERNS > 0] += 1
    assert min(kinds[1, True], kinds[1, False], kinds[2, False]) >= 20


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
