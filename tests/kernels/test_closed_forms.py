"""Newmark's block against its closed forms, and these against SciPy's integration."""

import itertools
from typing import Any

import numpy as np
import pytest
from mpmath import mpf
from scipy.integrate import solve_ivp

import slipsweep
from slipsweep import Newmark, Record, Sine, Square, Step, Triangle
from tests.support import closed_forms

RATIOS = (0.01, 0.05, 0.17, 0.1716, 0.3, 0.5, 0.8, 0.99)
G = 9.81

#: Each wave, the closed form of a cycle, and where its straight or smooth parts end.
WAVES: dict[str, tuple[Any, tuple[float, ...]]] = {
    "sine": (lambda s: np.sin(2.0 * np.pi * s), (0.0, 1.0)),
    "square": (lambda s: np.where(s < 0.5, 1.0, -1.0), (0.0, 0.5, 1.0)),
    "triangle": (lambda s: 1.0 - np.abs((4.0 * s + 1.0) % 4.0 - 2.0), (0.0, 0.25, 0.5, 0.75, 1.0)),
}
OBJECTS: dict[str, Any] = {"sine": Sine, "square": Square, "triangle": Triangle}


def integrated(wave: str, r: float) -> float:
    """u/(A T²) of one cycle, by SciPy: from the onset on, part by part, to the first zero of the
    velocity.
    """
    w, ends = WAVES[wave]
    onset = {"sine": np.arcsin(r) / (2.0 * np.pi), "square": 0.0, "triangle": r / 4.0}[wave]

    def stops(_: float, state: np.ndarray) -> float:
        return float(state[0])

    stops.terminal = True  # type: ignore[attr-defined]
    stops.direction = -1.0  # type: ignore[attr-defined]
    state = np.array([0.0, 0.0])
    for start, end in itertools.pairwise(ends):
        if end <= onset:
            continue
        inside = 1e-12 * (end - start)  # of the part itself, where the wave jumps

        def rate(
            s: float, state: np.ndarray, low: float = start + inside, high: float = end - inside
        ) -> list[float]:
            return [float(w(np.clip(s, low, high))) - r, state[0]]

        span = (max(start, onset), end)
        part = solve_ivp(
            rate, span, state, method="DOP853", rtol=1e-12, atol=1e-15, max_step=0.01, events=stops
        )
        state = part.y[:, -1]
        if part.status == 1:
            break
    return float(state[1])


@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize("r", RATIOS)
def test_closed_forms_are_what_scipy_integrates(wave: str, r: float) -> None:
    assert float(getattr(closed_forms, wave)(mpf(r))) == pytest.approx(
        integrated(wave, r), rel=1e-8
    )


@pytest.mark.parametrize("cycles", [1, 7])
@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize(("solver", "rel"), [("cycle", 1e-12), (Step("simpson", 1024), 1e-7)])
def test_solvers_give_the_closed_forms(wave: str, cycles: int, solver: Any, rel: float) -> None:
    """Every cycle adds the same, as each slide ends within it."""
    found = slipsweep.sweep(
        yield_coefficient=np.array(RATIOS),
        amplitude=G,
        frequency=2.0,
        model=Newmark(g=G),
        solver=solver,
        excitation=OBJECTS[wave](cycles),
        variables=["permanent_displacement"],
    )
    expected = [cycles * G / 4.0 * float(getattr(closed_forms, wave)(mpf(r))) for r in RATIOS]
    np.testing.assert_allclose(found.permanent_displacement, expected, rtol=rel)


def test_a_rectangular_pulse() -> None:
    """A record of constant acceleration, V²/2N (1 − N/A)."""
    amplitude = 4.0
    duration = 0.3
    record = Record(np.array([0.0, duration]), np.array([amplitude, amplitude]))
    found = slipsweep.sweep(
        yield_coefficient=np.array(RATIOS) * amplitude / G,
        excitation=record,
        model=Newmark(g=G),
        variables=["permanent_displacement"],
    )
    expected = [amplitude * duration**2 * float(closed_forms.rectangle(mpf(r))) for r in RATIOS]
    np.testing.assert_allclose(found.permanent_displacement, expected, rtol=1e-12)
