"""Every waveform against the multiple-precision reference, closed forms and what must hold between them."""

from math import acos, pi, radians, sin, sqrt, tan
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from mpmath import nstr
from scipy.optimize import brentq
from scipy.special import iv, modstruve

import slipsweep
from slipsweep import Validity
from tests.support.cases import choices
from tests.support.sine_cells import drawn, event_by_event, times_bound
from tests.support.strategies import anything, model_options, reproducible, sliding_cells
from tests.support.wave_cases import REGIMES, WaveCase, read_wave_cases
from tests.support.wave_cases import solve as reference

CASES = read_wave_cases()
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
    "measured": {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "yield_acceleration": 0.59, "decay_rate": 2.7},
    "newmark": {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.55, "model": "newmark"},
}
#: A cosine that is solved as any sum of harmonics.
SHIFTED = {"amplitudes": [1.0], "multiples": [1], "phases": [90.0]}
every_wave = pytest.mark.parametrize("wave", WAVES)


def displacement(**given: Any) -> float:
    return float(slipsweep.sweep(**choices(**{"frequency": 1.0, **given})).permanent_displacement)


def assert_alike(one: xr.Dataset, other: xr.Dataset, cycles: int) -> None:
    """The same to rounding; in continuous sliding of what the plane does, as the displacement is a rest of it."""
    plane = one.amplitude.max().item() / (2 * pi * one.frequency.min().item()) * cycles
    scales = {"peak_relative_velocity": plane, "permanent_displacement": plane / one.frequency.min().item() * cycles}
    for name, scale in scales.items():
        np.testing.assert_allclose(one[name], other[name], rtol=1e-11, atol=1e-15 * scale, err_msg=name)
    np.testing.assert_array_equal(one.sliding_mode, other.sliding_mode)
    # on a level plane the displacement is 0, and its sign one of rounding
    level = (one.theta == 0) & (one.sliding_mode == 2)
    wrong = ((one.validity ^ other.validity) & ~(level * Validity.UPSLOPE)) != 0
    assert not wrong.any(), f"flags differ: {int(wrong.sum())}"


def miss(case: WaveCase) -> str | None:
    """What is wrong with the cycle solver's answer: 1e-11 |u| + 1e-12 A/ω², peak velocity likewise."""
    found = slipsweep.sweep(**choices(**case.arguments, solver="cycle"))
    if (int(found.sliding_mode), int(found.validity)) != (case.sliding_mode, case.validity):
        return f"{case}: mode {int(found.sliding_mode)}, {Validity(int(found.validity))!r}, not {case.sliding_mode}, "
    if case.sliding_mode < 0:
        return None
    scale = case.displacement_scale
    for name, unit in (("permanent_displacement", scale), ("peak_relative_velocity", scale * 2 * pi)):
        value, right = float(found[name]), float(getattr(case, name))
        times = abs(value - right) / (1e-11 * abs(right) + 1e-12 * unit)
        if not times <= 1:
            return f"{case}: {name} {value!r}, not {right!r} ({times:.1e} times allowed)"
    return None


@pytest.mark.parametrize("regime", REGIMES)
def test_cycle_solver_on_every_case(regime: str) -> None:
    cases = [case for case in CASES if case.regime == regime]
    assert {case.waveform for case in cases} == {"sine", "cosine", "triangle", "square", "harmonics"}
    assert not [wrong for case in cases if (wrong := miss(case))]


def test_just_above_yield_keeps_its_digits() -> None:
    """Relative to u itself: an ulp of A moves it by 3 ulp / excess at most."""
    cases = [case for case in CASES if case.regime == "just_above_yield" and case.sliding_mode == 1]
    moved = 0
    for case in cases:
        right = float(case.permanent_displacement)
        assert case.yield_acceleration is not None
        excess = case.amplitude / case.yield_acceleration - 1
        if right > 1e-4 * excess**3 * case.displacement_scale:
            moved += 1
            error = abs(displacement(**case.arguments) / right - 1)
            assert error <= 100 * 3 * np.finfo(float).eps / excess, f"{case}: {error:.1e} at excess {excess:.1e}"
    assert moved > 10


@pytest.mark.parametrize("waveform", ["sine", "cosine", "triangle", "square"])
def test_cases_are_the_reference(waveform: str) -> None:
    """The first case of each waveform, solved again."""
    case = next(case for case in CASES if case.waveform == waveform)
    found = reference(case)
    assert nstr(found.permanent_displacement, 15) == nstr(
        type(found.permanent_displacement)(case.permanent_displacement), 15
    )
    assert (found.sliding_mode, found.validity) == (case.sliding_mode, case.validity)


# Closed forms


@reproducible
@given(share=st.floats(0.18, 0.999), theta=st.floats(0, 15), cycles=st.integers(1, 10**6))
def test_newmark_under_a_triangle(share: float, theta: float, cycles: int) -> None:
    """Üy/A ≥ 1 − 2/(1 + √2): parabolas from Üy to the peak and down; the block stops on the same line."""
    amplitude = 4.0
    a = (1 - share) * pi / 2
    stop = a * (1 + sqrt(2))
    slope = 2 * amplitude / pi
    pulse = slope * (a**3 / 6 + a**2 * stop / 2 + a * stop**2 / 2 - stop**3 / 6)
    found = displacement(
        theta=theta, mu_s=0.8, amplitude=amplitude, yield_acceleration=share * amplitude, model="newmark",
        waveform="triangle", cycles=cycles,
    )  # fmt: skip
    assert found == pytest.approx(cycles * pulse / (2 * pi) ** 2, rel=1e-11 + 1e-15 / (1 - share))


@reproducible
@given(share=st.floats(0.01, 0.999), theta=st.floats(0, 15), cycles=st.integers(1, 10**6))
def test_newmark_under_a_square_wave(share: float, theta: float, cycles: int) -> None:
    """A − Üy for half a cycle, −A − Üy to the stop: (A − Üy) π² A/(A + Üy) a cycle."""
    amplitude, onset = 4.0, share * 4.0
    pulse = (amplitude - onset) * pi**2 * amplitude / (amplitude + onset)
    found = displacement(
        theta=theta, mu_s=0.8, amplitude=amplitude, yield_acceleration=onset, model="newmark", waveform="square",
        cycles=cycles,
    )  # fmt: skip
    assert found == pytest.approx(cycles * pulse / (2 * pi) ** 2, rel=1e-12 + 1e-15 / (1 - share))


@reproducible
@given(share=st.floats(0.01, 0.999), theta=st.floats(0, 15), cycles=st.integers(1, 10**6))
def test_newmark_under_a_cosine(share: float, theta: float, cycles: int) -> None:
    """From the first peak to the stop, pulses of the sine, and from Üy to the last peak, where Eq. 12 begins."""
    amplitude, onset = 4.0, share * 4.0
    stop = brentq(lambda psi: amplitude * sin(psi) - onset * psi, 1e-3, pi, xtol=1e-15)
    half = 2 * amplitude * sin(stop / 2) ** 2 - onset * stop**2 / 2
    rise = acos(share)
    velocity = amplitude * (sin(rise) - share * rise)
    last = amplitude * (rise * sin(rise) + share - 1 - share * rise**2 / 2) + velocity**2 / (2 * onset)
    cell: dict[str, Any] = {"theta": theta, "mu_s": 0.8, "amplitude": amplitude, "yield_acceleration": onset}
    pulse = displacement(**cell, model="newmark", cycles=1) * (2 * pi) ** 2
    found = displacement(**cell, model="newmark", waveform="cosine", cycles=cycles)
    # near yield the terms of the closed form cancel
    expected = pytest.approx((half + (cycles - 1) * pulse + last) / (2 * pi) ** 2, rel=1e-11, abs=1e-16 * amplitude)
    assert found == expected


@reproducible
@given(
    theta=st.floats(0, 20), mu_s=st.floats(0.4, 0.9), delta_mu=st.floats(0, 0.4), decay_rate=st.floats(0.8, 5),
    cycles=st.integers(1, 10**6),
)  # fmt: skip
def test_continuous_sliding_under_a_cosine(
    theta: float, mu_s: float, delta_mu: float, decay_rate: float, cycles: int
) -> None:
    """From a peak on N cycles give W = π N² γ, and γ, what V gains over a cycle, is 4 A tan θ (μs − tan θ − μ₀ q₁)."""
    k = decay_rate * 12.0 / 9.81
    q1 = 1 + pi / 2 * (modstruve(1, k) - iv(1, k))
    gain = 4 * 12.0 * tan(radians(theta)) * (mu_s - tan(radians(theta)) - (mu_s + delta_mu) * q1)
    found = displacement(
        theta=theta, mu_s=mu_s, amplitude=12.0, yield_acceleration=0.1, delta_mu=delta_mu, decay_rate=decay_rate,
        waveform="cosine", cycles=cycles,
    )  # fmt: skip
    assert found == pytest.approx(pi * cycles**2 * gain / (2 * pi) ** 2, rel=1e-12, abs=1e-14 * cycles**2)


# What must hold between waveforms


@reproducible
@given(cell=sliding_cells | anything(), options=model_options)
def test_a_cosine_is_the_harmonic_with_its_phase(cell: dict[str, Any], options: dict[str, str]) -> None:
    if cell.get("model") != "newmark":
        cell = cell | options
    batches = slipsweep.sweep(**choices(**cell, waveform="cosine"))
    walk = slipsweep.sweep(**choices(**cell, waveform="harmonics", harmonics=SHIFTED))
    assert_alike(batches, walk, cell["cycles"])


def walked(**given: Any) -> xr.Dataset:
    """A sweep whose cells all go from event to event."""
    with event_by_event():
        return slipsweep.sweep(**choices(**given))


def test_batches_are_the_walk_over_pieces_in_a_million_cells() -> None:
    """Rare kinds of motion, of which some hundred cells have none, and neighbours of every kind."""
    for seed in range(60):
        one = drawn(seed, 20_000)
        times = times_bound(one)
        assert times.max() <= 1.0, f"{times.max()} at {one.cell(int(times.argmax()))}"


@reproducible
@given(cell=sliding_cells | anything(), options=model_options)
def test_batches_are_the_walk_over_pieces(cell: dict[str, Any], options: dict[str, str]) -> None:
    if cell.get("model") != "newmark":
        cell = cell | options
    assert_alike(slipsweep.sweep(**choices(**cell)), walked(**cell), cell["cycles"])


@pytest.mark.parametrize("cycles", [1, 2, 3, 20])
@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
@pytest.mark.parametrize(
    "measured",
    [
        {},
        {"yield_acceleration": 0.3},
        {"yield_acceleration": 2.0},
        {"decay_rate": 1.0},
        # Eq. 4 rises from Üy on: a block that comes there in motion does not hold E(Üy)
        {"yield_acceleration": 0.01, "decay_rate": 1.15, "delta_mu": 0.03},
    ],
    ids=["estimated", "low", "high", "slow", "rising"],
)
def test_batches_side_by_side(measured: dict[str, float], recoupling: str, cycles: int) -> None:
    """Cells of all kinds in one tile, those that batches leave among them."""
    axes: dict[str, Any] = {
        "theta": [0.0, 3.0, 12.0, 25.0],
        "mu_s": np.linspace(0.15, 0.9, 6),
        "amplitude": np.linspace(0.5, 18.0, 40),
        "frequency": 1.0,
        "recoupling": recoupling,
        "cycles": cycles,
    }
    given = axes | measured
    batches = slipsweep.sweep(**choices(**given))
    assert set(np.unique(batches.sliding_mode)) >= {1, 2}
    assert_alike(batches, walked(**given), cycles)


@pytest.mark.parametrize("cell", ["coulomb", "measured", "newmark"])
@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
def test_parts_of_a_cosine_are_those_of_its_history(cell: str, recoupling: str) -> None:
    """Half a pulse from the first peak, whole ones, and the rise to the last peak with what follows the shaking."""
    options = {**CELLS[cell], "waveform": "cosine", "frequency": 1.0, "recoupling": recoupling}
    # at Üg = 0 on the rise the block is at rest
    history = slipsweep.simulate(**choices(**options, cycles=3, times=[0.0, 0.75, 1.75, 2.75, 100.0]))
    assert not history.relative_velocity.values.any()
    half, first, second, last = np.diff(history.relative_displacement.values)
    assert first == pytest.approx(second, rel=1e-13)
    for cycles in (1, 2, 3, 10):
        expected = half + (cycles - 1) * first + last
        assert displacement(**options, cycles=cycles) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
def test_one_harmonic_is_the_sine(cell: str, recoupling: str) -> None:
    """The walk over pieces against the sine's batches."""
    options = {**CELLS[cell], "recoupling": recoupling, "cycles": 7}
    sine = displacement(**options)
    one = displacement(**options, waveform="harmonics", harmonics={"amplitudes": [3.0], "multiples": [1]})
    assert one == pytest.approx(sine, rel=1e-12)


@pytest.mark.parametrize("multiple", [2, 50])
def test_a_multiple_is_a_higher_frequency(multiple: int) -> None:
    """sin mφ over 3 cycles is a sine of m times the frequency over 3 m cycles."""
    harmonics = {"amplitudes": [1.0], "multiples": [multiple]}
    for cell in CELLS.values():
        found = displacement(**cell, cycles=3, waveform="harmonics", harmonics=harmonics)
        assert found == pytest.approx(displacement(**cell, cycles=3 * multiple, frequency=multiple), rel=1e-11)


@pytest.mark.parametrize("cell", ["coulomb", "newmark"])
def test_later_cycles_of_the_cosine_are_those_of_the_sine(cell: str) -> None:
    """Where the block comes to rest within each; only its first pulse begins with a jump."""
    cosine = [displacement(**CELLS[cell], waveform="cosine", cycles=n) for n in (2, 3, 12)]
    pulse = displacement(**CELLS[cell], cycles=1)
    assert cosine[1] - cosine[0] == pytest.approx(pulse, rel=1e-11)
    assert cosine[2] - cosine[0] == pytest.approx(10 * pulse, rel=1e-11)


def test_peak_below_zero_decides_the_mode_alone() -> None:
    """A wave whose positive peak stays below Üy moves no block, however large A is."""
    harmonics = {"amplitudes": [1.0, 0.5], "multiples": [1, 2], "phases": [0.0, 90.0]}  # 0.75 up, 1.5 down
    cell: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "waveform": "harmonics", "harmonics": harmonics}
    still = slipsweep.sweep(**choices(**cell, amplitude=3.55, frequency=1.0, yield_acceleration=1.8))
    assert float(still.permanent_displacement) == 0.0
    assert int(still.sliding_mode) == 1
    assert displacement(**cell, amplitude=3.55, yield_acceleration=1.7) > 0.0


@every_wave
@pytest.mark.parametrize("cell", CELLS)
def test_a_million_cycles(wave: str, cell: str) -> None:
    """u grows with the cycles as a line (rest in each) or a parabola (velocity carried on): read off three of them."""
    if "ramped" in wave:
        pytest.skip("the pieces of the ramp come once")
    options = {**CELLS[cell], **WAVES[wave]}
    counts = np.array([40, 41, 42])
    few = np.array([displacement(**options, cycles=int(n)) for n in counts])
    bend = few[2] - 2 * few[1] + few[0]
    n = 10**6 - 40
    expected = few[0] + n * (few[1] - few[0]) + bend * n * (n - 1) / 2
    # rounding of a second difference, times n²/2
    assert displacement(**options, cycles=10**6) == pytest.approx(expected, rel=1e-9, abs=1e-15 * few[0] * n**2)


@every_wave
def test_frequency_enters_by_the_scaling_law_alone(wave: str) -> None:
    for cell in CELLS.values():
        found = slipsweep.sweep(**choices(**cell, **WAVES[wave], frequency=[0.3, 1.0, 7.0], cycles=5))
        np.testing.assert_allclose(
            found.permanent_displacement * found.frequency**2, found.permanent_displacement[1], rtol=1e-14
        )


@every_wave
def test_a_ramp_of_nothing_is_no_ramp(wave: str) -> None:
    """Exactly at zero cycles, and in the limit."""
    if "ramped" in wave:
        pytest.skip("it has one")
    for cell in CELLS.values():
        options = {**cell, **WAVES[wave], "cycles": 4}
        plain = displacement(**options)
        assert displacement(**options, ramp_in=0, ramp_out=0.0) == plain
        if cell.get("yield_acceleration", 1.0) > 0.1:  # continuous sliding begins where the ramp passes Üy
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
    v, u = found.relative_velocity.values, found.relative_displacement.values
    assert u[-1] == pytest.approx(displacement(**options), rel=1e-12)
    # at a jump the trapezoid is off by half a step
    jumps = 20 * step * CELLS[cell]["amplitude"]
    assert np.abs(np.cumsum(0.5 * (excess[1:] + excess[:-1])) * step - (v - v[0])[1:]).max() < jumps
    moved = np.cumsum(0.5 * (v[1:] + v[:-1])) * step
    np.testing.assert_allclose(moved, u[1:], rtol=0, atol=1e-4 * np.abs(u).max() + 1e-9)
    if "ramped" not in wave:
        largest = np.abs(found.ground_acceleration).max()
        assert largest == pytest.approx(CELLS[cell]["amplitude"], rel=1e-4)


def test_step_solver_goes_to_the_cycle_solver() -> None:
    """Simpson with 4096 steps on every waveform and cell: 1e-7, jumps and kinks included."""
    for wave in WAVES.values():
        for cell in CELLS.values():
            options = {**cell, **wave, "cycles": 5}
            exact = displacement(**options, solver="cycle")
            assert displacement(**options, solver="step", rule="simpson", steps_per_cycle=4096) == pytest.approx(
                exact, rel=1e-7
            )


def test_a_grid_is_its_cells() -> None:
    """A sweep of a waveform, lazy or at once, gives what each cell gives by itself."""
    axes: dict[str, Any] = {
        "theta": [0.0, 5.0],
        "mu_s": [0.3, 0.5],
        "amplitude": [2.0, 4.0, 7.0],
        "frequency": [1.0, 2.0],
    }
    grid = slipsweep.sweep(**choices(**axes, **WAVES["ramped harmonics"], cycles=5))
    lazy = slipsweep.sweep(**choices(**axes, **WAVES["ramped harmonics"], cycles=5, chunks={"amplitude": 1})).compute()
    assert lazy.equals(grid)
    one = displacement(theta=5.0, mu_s=0.3, amplitude=4.0, frequency=2.0, **WAVES["ramped harmonics"], cycles=5)
    assert float(grid.permanent_displacement.sel(theta=5, mu_s=0.3, amplitude=4, frequency=2)) == one
    terms = {"amplitudes": (1.0, 0.6, 0.35), "multiples": (1, 2, 5), "phases": (0.0, 40.0, 100.0)}
    assert {name: grid.attrs[name] for name in terms} == terms
    assert grid.attrs["ramp_in"] == 2


def test_a_block_outlasts_an_interval_that_begins_no_pulse() -> None:
    """It comes to rest behind one below Üy, where in a later cycle a ramp has begun: that pulse is another."""
    wave = slipsweep.Harmonics(
        [0.4483889281248371, 0.3964501428370584],
        [1, 4],
        [11.025413290195758, 270.0],
        cycles=6,
        ramp_in=1,
        ramp_out=3.31,
    )
    cell: dict[str, Any] = {
        "theta": 3.4,
        "mu_s": 0.62,
        "amplitude": 14.26,
        "yield_acceleration": 1.92,
        "frequency": 1.8,
    }
    options: dict[str, Any] = {"model": slipsweep.Newmark(), "excitation": wave}
    history = slipsweep.simulate(**cell, **options, times=[0.0, 100.0])
    found = slipsweep.sweep(**cell, **options).permanent_displacement
    assert found.item() == pytest.approx(history.relative_displacement.values[-1], rel=1e-12)
