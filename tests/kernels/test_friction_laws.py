"""Friction laws μ(Üg, v) that are none of ours, stepped: held to SciPy's integrator with events."""

from collections.abc import Callable
from itertools import pairwise
from math import asin, atan, exp, pi, radians, sin, tan
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slipsweep.jit.compiling import kernel
from slipsweep.jit.decorators import registered
from slipsweep.kernels import step, step_cells, step_newmark
from slipsweep.kernels.block import EQ12, LITERAL, NEWMARK, RESULTS, Options
from slipsweep.motion.cutting import path_of_waveform
from slipsweep.motion.waveforms import Sine

G = 9.81
THETA = radians(6.0)
FREQUENCY = 1.7
OMEGA = 2.0 * pi * FREQUENCY

#: By how much friction changes with the velocity, and how fast, s/m.
CHANGE = 0.3
RATE = 12.0

# ------------------------------------------------------------------ two laws


@registered
def of_velocity(block: Any, ground: float, velocity: float, slip: float) -> Any:
    """Constantinou, Mokha and Reinhorn (1990), from μs down or up by so much of it as Δμ says."""
    return block.mu_s * (1.0 + block.delta_mu * (1.0 - exp(-RATE * abs(velocity))))


@registered
def decaying_with_both(block: Any, ground: float, velocity: float, slip: float) -> Any:
    """Eq. 6, which also falls with the velocity."""
    decayed = (block.mu_s + block.delta_mu) * exp(-block.decay_rate * abs(ground) / block.g)
    return decayed * (1.0 - CHANGE * (1.0 - exp(-RATE * abs(velocity))))


@kernel
def solve_of_velocity(
    cells: Any, options: Any, path: Any, blocks: Any, steps: Any, log: Any, results: Any
) -> None:
    law = step_newmark.newmark_law(of_velocity, True, False, step.unlimited)
    step_cells.solve_cells(law, cells, options, path, blocks, steps, log, results)


@kernel
def solve_decaying(
    cells: Any, options: Any, path: Any, blocks: Any, steps: Any, log: Any, results: Any
) -> None:
    law = step_cells.paper_law(decaying_with_both, True, False, step.unlimited)
    step_cells.solve_cells(law, cells, options, path, blocks, steps, log, results)


def motion_of(
    solve: Callable[..., None], rise: int, cycles: int, steps_per_cycle: int, **cell: float
) -> dict[str, float]:
    """Step a cell, by Simpson's rule; V and W are times ω and ω²."""
    cells = np.full((1, len(step_cells.STEP_CELL.names or ())), np.nan).view(step_cells.STEP_CELL)[
        :, 0
    ]
    cells["tan_theta"] = tan(THETA)
    cells["seconds"] = 1.0 / OMEGA
    for name, value in cell.items():
        cells[name] = value
    path = path_of_waveform(Sine(cycles=cycles))
    results = np.empty((len(RESULTS), 1))
    solve(
        cells,
        Options(rise, EQ12, cycles, True, G),
        path,
        step_cells.blocks_of(step.SIMPSON, steps_per_cycle, 0),
        step_cells.steps_of(path, step.SIMPSON, steps_per_cycle, 0),
        np.empty(0, step.LOG),
        results,
    )
    return dict(zip(RESULTS, results[:, 0], strict=True))


# ------------------------------------------------------------------ the same by SciPy


def integrate(
    rate: Callable[[float, float], float], start: float, end: float, velocity: float
) -> tuple[float, float, float]:
    """Return the time of the stop, or the end, and v and u gained by then."""

    def stops(time: float, state: np.ndarray) -> float:
        return float(state[0]) if time > start else 1.0

    stops.terminal = True  # type: ignore[attr-defined]
    stops.direction = -1.0  # type: ignore[attr-defined]
    solution = solve_ivp(
        lambda time, state: (rate(time, state[0]), state[0]),
        (start, end),
        (velocity, 0.0),
        "DOP853",
        rtol=1e-12,
        atol=1e-15,
        events=stops,
    )
    return float(solution.t[-1]), float(solution.y[0, -1]), float(solution.y[1, -1])


@pytest.mark.parametrize("change", [-CHANGE, CHANGE])
def test_newmarks_block_whose_friction_depends_on_velocity(change: float) -> None:
    """It slides from its static yield acceleration on, and each cycle is as the first."""
    amplitude = 4.0
    mu_s = 0.3

    def rate(time: float, velocity: float) -> float:
        friction = mu_s * (1.0 + change * (1.0 - exp(-RATE * abs(velocity))))
        return amplitude * sin(OMEGA * time) - G * tan(atan(friction) - THETA)

    onset = asin(G * tan(atan(mu_s) - THETA) / amplitude) / OMEGA
    end, _, expected = integrate(rate, onset, 1.0 / FREQUENCY, 0.0)
    assert end < 1.0 / FREQUENCY, "it comes to rest within the cycle"
    cell = {"mu_s": mu_s, "amplitude": amplitude, "delta_mu": change}
    found = motion_of(solve_of_velocity, NEWMARK, 3, 512, **cell)
    assert found["permanent_displacement"] / OMEGA**2 == pytest.approx(3.0 * expected, rel=1e-8)


@pytest.mark.parametrize("steps", [128, 512])
def test_stick_slip_by_a_law_of_acceleration_and_velocity(steps: int) -> None:
    """Literal rise: Eq. 4 up to the peak, b held to the stop, or to Üg = 0 and then Eq. 12."""
    cell = {"mu_s": 0.4, "delta_mu": 0.1, "decay_rate": 3.0, "yield_acceleration": 1.0}
    amplitude = 3.0

    def eq4_rate(time: float, velocity: float) -> float:
        x = amplitude * sin(OMEGA * time)
        friction = 0.5 * exp(-3.0 * x / G)
        friction *= 1.0 - CHANGE * (1.0 - exp(-RATE * abs(velocity)))
        return (G + x * tan(THETA)) * (0.4 - tan(THETA) - friction) + G * tan(THETA)

    onset = asin(1.0 / amplitude) / OMEGA
    assert eq4_rate(onset, 0.0) > 0.0, "it slides from Üy on"
    peak = 0.25 / FREQUENCY
    _, velocity, moved = integrate(eq4_rate, onset, peak, 0.0)
    held = amplitude - eq4_rate(peak, velocity)
    assert held > 0.0
    end, velocity, more = integrate(
        lambda time, _: amplitude * sin(OMEGA * time) - held, peak, 2.0 * peak, velocity
    )
    expected = moved + more
    if end >= 2.0 * peak:
        expected += 0.5 * velocity**2 / held
    found = motion_of(solve_decaying, LITERAL, 1, steps, amplitude=amplitude, **cell)
    assert found["permanent_displacement"] / OMEGA**2 == pytest.approx(expected, rel=4e4 / steps**4)


def test_continuous_sliding_by_a_law_of_acceleration_and_velocity() -> None:
    """Eq. 4 from Üy on; the cycles are not alike, as friction depends on the velocity."""
    cell = {"mu_s": 0.3, "delta_mu": 0.05, "decay_rate": 2.0, "yield_acceleration": 0.5}
    amplitude = 9.0

    def eq4_rate(time: float, velocity: float) -> float:
        x = amplitude * sin(OMEGA * time)
        friction = 0.35 * exp(-2.0 * abs(x) / G)
        friction *= 1.0 - CHANGE * (1.0 - exp(-RATE * abs(velocity)))
        lag = (G + x * tan(THETA)) * (0.3 - tan(THETA) - friction) + G * tan(THETA)
        return lag if x >= 0.0 else -lag

    state = (0.0, 0.0)
    times = [asin(0.5 / amplitude) / OMEGA, *(k / (2.0 * FREQUENCY) for k in range(1, 7))]
    for start, end in pairwise(times):  # Eq. 4 jumps where Üg = 0
        solution = solve_ivp(
            lambda time, y: (eq4_rate(time, y[0]), y[0]),
            (start, np.nextafter(end, 0.0)),
            state,
            "DOP853",
            rtol=1e-12,
            atol=1e-15,
            max_step=0.01,
        )
        state = tuple(solution.y[:, -1])
    found = motion_of(solve_decaying, LITERAL, 3, 1024, amplitude=amplitude, **cell)
    assert found["sliding_mode"] == 2.0
    assert found["permanent_displacement"] / OMEGA**2 == pytest.approx(state[1], rel=1e-7)
