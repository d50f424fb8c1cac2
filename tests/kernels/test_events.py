"""The root finder of the kernels: what it finds, what it does not, and what becomes of that."""

import math
from typing import Any

import numba
import pytest

import slipsweep
from slipsweep import RunError
from slipsweep.grid import solvers
from slipsweep.kernels import roots, step_cells
from slipsweep.kernels.block import UNSOLVED


@numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
def _power(where: tuple[float, float], x: float) -> tuple[float, float]:
    root, power = where
    return math.copysign(abs(x - root) ** power, x - root), power * abs(x - root) ** (power - 1.0)


_root_of_power = roots.root_of(_power)


@numba.njit  # type: ignore[untyped-decorator]
def _root(where: tuple[float, float], below: float, above: float) -> float:
    return _root_of_power(where, below, above, above, 0.0)


def found(root: float, power: float, below: float, above: float) -> float:
    return float(_root((root, power), below, above))


@pytest.mark.parametrize("root", [1e-300, 0.3, 0.9999999])
def test_roots_are_found_from_either_side(root: float) -> None:
    assert found(root, 1.0, 0.0, 1.0) == pytest.approx(root, rel=1e-15)
    # a triple root by thirds; Newton's steps that go to and fro, leave the bracket, are short
    for power in (3.0, 0.5, 0.3, 21.0):
        assert found(root, power, 0.0, 1.0) == pytest.approx(root, rel=1e-8), power


def test_a_root_at_the_origin_is_the_origin() -> None:
    assert abs(found(0.0, 2.0, -1.0, 1.0)) < 1e-30


def test_a_root_that_is_not_found_is_nan() -> None:
    """Not the place reached: here 200 steps are not enough."""
    assert math.isnan(found(1e-28, 5.0, 0.0, 1.0))
    assert math.isnan(found(math.nan, 1.0, 0.0, 1.0))


def failing(*arguments: Any) -> None:
    """A kernel that does not solve cell 4."""
    results = arguments[-1]
    results[:] = 0.0
    results[solvers.ROWS["validity"], 4:5] = UNSOLVED


@pytest.mark.parametrize(
    "options", [{"excitation": slipsweep.Triangle(ramp_in=1)}, {"solver": "step"}]
)
def test_a_cell_that_is_not_solved_ends_the_run_and_is_named(
    options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(solvers, "solve_walk", failing)
    monkeypatch.setattr(step_cells, "solve_steps", failing)
    axes: dict[str, Any] = {
        "theta": [0.0, 5.0],
        "mu_s": 0.3,
        "amplitude": [2.0, 3.0, 4.5],
        "frequency": [1.0, 2.0],
    }
    named = r"theta = 5, mu_s = 0.3, amplitude = 3, frequency = 1, g = 9.81: an event"
    with pytest.raises(RunError, match=named) as error:
        slipsweep.sweep(**axes, **options)
    assert "\n" not in str(error.value)


def test_a_cell_of_a_record_that_is_not_solved_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solvers, "solve_walk", failing)
    record = slipsweep.Record.sampled([0.0, 3.0, -3.0, 0.0], 0.1)
    axes: dict[str, Any] = {
        "theta": [0.0, 5.0],
        "mu_s": 0.3,
        "scale": [1.0, 2.0, 3.0],
        "polarity": -1,
    }
    with pytest.raises(
        RunError, match=r"theta = 5, mu_s = 0.3, scale = 2, .*polarity = -1, g = 9.81: an event"
    ):
        slipsweep.sweep(excitation=record, **axes)
