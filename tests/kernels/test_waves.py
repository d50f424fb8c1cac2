"""Waveforms against closed forms, and what must hold between them and over cycles, frequencies and
ramps.
"""

from math import acos, pi, radians, sin, tan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import iv, modstruve

import slipsweep
from tests.support.cases import choices
from tests.support.strategies import reproducible

RICH = {"amplitudes": [1.0, 0.6, 0.35], "multiples": [1, 2, 5], "phases": [0.0, 40.0, 100.0]}
WAVES: dict[str, dict[str, Any]] = {
    "sine": {},
    "cosine": {"waveform": "cosine"},
    "triangle": {"waveform": "triangle"},
    "square": {"waveform": "square"},
    "harmonics": {"waveform": "harmonics", "harmonics": RICH},
    "ramped triangle": {"waveform": "triangle", "ramp_in": 1.3, "ramp_out": 0.5},
    "ramped square": {"waveform": "square", "ramp_in": 1.3, "ramp_out": 0.5},
    "ramped harmonics": {"waveform": "harmonics", "harmonics": RICH, "ramp_in": 2},
}
CELLS: dict[str, dict[str, Any]] = {
    "coulomb": {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55},
    "continuous": {"theta": 6.0, "mu_s": 0.38, "amplitude": 5.1, "yield_acceleration": 0.08},
    "measured": {
        "theta": 5.0,
        "mu_s": 0.38,
        "amplitude": 3.55,
        "yield_acceleration": 0.59,
        "decay_rate": 2.7,
    },
    "newmark": {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "model": "newmark"},
}
every_wave = pytest.mark.parametrize("wave", WAVES)
every_whole_wave = pytest.mark.parametrize("wave", [wave for wave in WAVES if "ramped" not in wave])


def displacement(**given: Any) -> float:
    return float(slipsweep.sweep(**choices(**{"frequency": 1.0, **given})).permanent_displacement)


# Closed forms


@reproducible
@given(share=st.floats(0.01, 0.999), theta=st.floats(0, 15), cycles=st.integers(1, 10**6))
def test_newmark_under_a_cosine(share: float, theta: float, cycles: int) -> None:
    """From the first peak to the stop, pulses of the sine, and from Üy to the last peak, where Eq.
    12 begins.
    """
    amplitude = 4.0
    onset = share * 4.0
    stop = brentq(lambda psi: amplitude * sin(psi) - onset * psi, 1e-3, pi, xtol=1e-15)
    half = 2 * amplitude * sin(stop / 2) ** 2 - onset * stop**2 / 2
    rise = acos(share)
    velocity = amplitude * (sin(rise) - share * rise)
    last = amplitude * (rise * sin(rise) + share - 1 - share * rise**2 / 2) + velocity**2 / (
        2 * onset
    )
    cell: dict[str, Any] = {
        "theta": theta,
        "mu_s": 0.8,
        "amplitude": amplitude,
        "yield_acceleration": onset,
    }
    pulse = displacement(**cell, model="newmark", cycles=1) * (2 * pi) ** 2
    found = displacement(**cell, model="newmark", waveform="cosine", cycles=cycles)
    # near yield the terms of the closed form cancel
    expected = pytest.approx(
        (half + (cycles - 1) * pulse + last) / (2 * pi) ** 2, rel=1e-11, abs=1e-16 * amplitude
    )
    assert found == expected


@reproducible
@given(
    theta=st.floats(0, 20),
    mu_s=st.floats(0.4, 0.9),
    delta_mu=st.floats(0, 0.4),
    decay_rate=st.floats(0.8, 5),
    cycles=st.integers(1, 10**6),
)
def test_continuous_sliding_under_a_cosine(
    theta: float, mu_s: float, delta_mu: float, decay_rate: float, cycles: int
) -> None:
    """From a peak on N cycles give W = π N² γ, and γ, what V gains over a cycle, is 4 A tan θ (μs −
    tan θ − μ₀ q₁).
    """
    k = decay_rate * 12.0 / 9.81
    q1 = 1 + pi / 2 * (modstruve(1, k) - iv(1, k))
    gain = 4 * 12.0 * tan(radians(theta)) * (mu_s - tan(radians(theta)) - (mu_s + delta_mu) * q1)
    found = displacement(
        theta=theta,
        mu_s=mu_s,
        amplitude=12.0,
        yield_acceleration=0.1,
        delta_mu=delta_mu,
        decay_rate=decay_rate,
        waveform="cosine",
        cycles=cycles,
    )
    assert found == pytest.approx(
        pi * cycles**2 * gain / (2 * pi) ** 2, rel=1e-12, abs=1e-14 * cycles**2
    )


# What must hold between waveforms


@pytest.mark.parametrize("cell", ["coulomb", "measured", "newmark"])
@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
def test_parts_of_a_cosine_are_those_of_its_history(cell: str, recoupling: str) -> None:
    """Half a pulse from the first peak, whole ones, and the rise to the last peak with what follows
    the shaking.
    """
    options = {**CELLS[cell], "waveform": "cosine", "frequency": 1.0, "recoupling": recoupling}
    # at Üg = 0 on the rise the block is at rest
    history = slipsweep.simulate(
        **choices(**options, cycles=3, times=[0.0, 0.75, 1.75, 2.75, 100.0])
    )
    assert not history.relative_velocity.values.any()
    half, first, second, last = np.diff(history.relative_displacement.values)
    assert first == pytest.approx(second, rel=1e-13)
    for cycles in (1, 2, 3, 10):
        expected = half + (cycles - 1) * first + last
        assert displacement(**options, cycles=cycles) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("multiple", [2, 50])
def test_a_multiple_is_a_higher_frequency(multiple: int) -> None:
    """sin mφ over 3 cycles is a sine of m times the frequency over 3 m cycles."""
    harmonics = {"amplitudes": [1.0], "multiples": [multiple]}
    for cell in CELLS.values():
        found = displacement(**cell, cycles=3, waveform="harmonics", harmonics=harmonics)
        assert found == pytest.approx(
            displacement(**cell, cycles=3 * multiple, frequency=multiple), rel=1e-11
        )


def test_peak_below_zero_decides_the_mode_alone() -> None:
    """A wave whose positive peak stays below Üy moves no block, however large A is."""
    harmonics = {
        "amplitudes": [1.0, 0.5],
        "multiples": [1, 2],
        "phases": [0.0, 90.0],
    }  # 0.75 up, 1.5 down
    cell: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.38,
        "waveform": "harmonics",
        "harmonics": harmonics,
    }
    still = slipsweep.sweep(
        **choices(**cell, amplitude=3.55, frequency=1.0, yield_acceleration=1.8)
    )
    assert float(still.permanent_displacement) == 0.0
    assert int(still.sliding_mode) == 1
    assert displacement(**cell, amplitude=3.55, yield_acceleration=1.7) > 0.0


@every_whole_wave
@pytest.mark.parametrize("cell", CELLS)
def test_a_million_cycles(wave: str, cell: str) -> None:
    """u grows with the cycles as a line (rest in each) or a parabola (velocity carried on): read
    off three of them.
    """
    options = {**CELLS[cell], **WAVES[wave]}
    counts = np.array([40, 41, 42])
    few = np.array([displacement(**options, cycles=int(n)) for n in counts])
    bend = few[2] - 2 * few[1] + few[0]
    n = 10**6 - 40
    expected = few[0] + n * (few[1] - few[0]) + bend * n * (n - 1) / 2
    # rounding of a second difference, times n²/2
    assert displacement(**options, cycles=10**6) == pytest.approx(
        expected, rel=1e-9, abs=1e-15 * few[0] * n**2
    )


@every_wave
def test_frequency_enters_by_the_scaling_law_alone(wave: str) -> None:
    for cell in CELLS.values():
        found = slipsweep.sweep(
            **choices(**cell, **WAVES[wave], frequency=[0.3, 1.0, 7.0], cycles=5)
        )
        np.testing.assert_allclose(
            found.permanent_displacement * found.frequency**2,
            found.permanent_displacement[1],
            rtol=1e-14,
        )


@every_whole_wave
def test_a_ramp_of_nothing_is_no_ramp(wave: str) -> None:
    """Exactly at zero cycles, and in the limit."""
    for cell in CELLS.values():
        options = {**cell, **WAVES[wave], "cycles": 4}
        plain = displacement(**options)
        assert displacement(**options, ramp_in=0, ramp_out=0.0) == plain
        if (
            cell.get("yield_acceleration", 1.0) > 0.1
        ):  # continuous sliding begins where the ramp passes Üy
            short = displacement(**options, ramp_in=1e-7, ramp_out=1e-7)
            assert short == pytest.approx(plain, rel=1e-5)


@every_wave
@pytest.mark.parametrize("cell", CELLS)
def test_history_is_that_of_the_sweep(wave: str, cell: str) -> None:
    """v integrates Üg − Ü, u integrates v, and u ends where the sweep does."""
    options = {**CELLS[cell], **WAVES[wave], "frequency": 1.0, "cycles": 4}
    found = slipsweep.simulate(**choices(**options, points_per_cycle=2048))
    step = float(found.time[1])
    excess = (found.ground_acceleration - found.block_acceleration).values
    v = found.relative_velocity.values
    u = found.relative_displacement.values
    assert u[-1] == pytest.approx(displacement(**options), rel=1e-12)
    # at a jump the trapezoid is off by half a step
    jumps = 20 * step * CELLS[cell]["amplitude"]
    assert np.abs(np.cumsum(0.5 * (excess[1:] + excess[:-1])) * step - (v - v[0])[1:]).max() < jumps
    moved = np.cumsum(0.5 * (v[1:] + v[:-1])) * step
    np.testing.assert_allclose(moved, u[1:], rtol=0, atol=1e-4 * np.abs(u).max() + 1e-9)
    if "ramped" not in wave:
        largest = np.abs(found.ground_acceleration).max()
        assert largest == pytest.approx(CELLS[cell]["amplitude"], rel=1e-4)


def test_a_grid_is_its_cells() -> None:
    """A sweep of a waveform, lazy or at once, gives what each cell gives by itself."""
    axes: dict[str, Any] = {"theta": [0.0, 5.0], "mu_s": [0.3, 0.5], "amplitude": [2.0, 4.0, 7.0]}
    wave: dict[str, Any] = {**WAVES["ramped harmonics"], "cycles": 5, "frequency": [1.0, 2.0]}
    grid = slipsweep.sweep(**choices(**axes, **wave))
    lazy = slipsweep.sweep(**choices(**axes, **wave, chunks={"amplitude": 1})).compute()
    assert lazy.equals(grid)
    one = displacement(theta=5.0, mu_s=0.3, amplitude=4.0, **wave | {"frequency": 2.0})
    assert (
        float(grid.permanent_displacement.sel(theta=5, mu_s=0.3, amplitude=4, frequency=2)) == one
    )
    assert {name: list(grid.attrs[name]) for name in RICH} == RICH
    assert grid.attrs["ramp_in"] == 2


def test_a_block_outlasts_an_interval_that_begins_no_pulse() -> None:
    """It comes to rest behind one below Üy, where in a later cycle a ramp has begun: that pulse is
    another.
    """
    terms = ([0.4483889281248371, 0.3964501428370584], [1, 4], [11.025413290195758, 270.0])
    cell: dict[str, Any] = {
        "theta": 3.4,
        "mu_s": 0.62,
        "amplitude": 14.26,
        "yield_acceleration": 1.92,
    }
    cell |= {"frequency": 1.8, "model": "newmark"}
    cell["excitation"] = slipsweep.Harmonics(*terms, cycles=6, ramp_in=1, ramp_out=3.31)
    history = slipsweep.simulate(**cell, times=[0.0, 100.0])
    found = slipsweep.sweep(**cell).permanent_displacement
    assert found.item() == pytest.approx(history.relative_displacement.values[-1], rel=1e-12)
