"""Hypothesis strategies: keyword arguments of `slipsweep.sweep` for one cell of a chosen regime.

`stuck`, `stick_slip`, `continuous`, `newmark` and `given_friction` draw cells that have a
value; `anything` draws from the whole parameter space, cells without a value included.
"""

from math import cos, pi, radians, sin, tan
from typing import Any

from hypothesis import HealthCheck, assume, settings
from hypothesis import strategies as st

#: Settings of every property test: the same cells on each run, none cut short by compilation.
reproducible = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)

G = 9.81
Cell = dict[str, Any]

#: Share of the amplitude range of a regime that is drawn, away from its two ends.
INSIDE = st.floats(0.002, 0.98)

frequencies = st.floats(0.1, 20.0)
cycles = st.integers(1, 12)
thetas = st.just(0.0) | st.floats(0.1, 35.0)
frictions = st.floats(0.1, 1.2)
model_options = st.fixed_dictionaries(
    {
        "rise": st.sampled_from(["monotone", "literal"]),
        "recoupling": st.sampled_from(["eq12", "integrate"]),
    }
)


def coulomb_yield(theta: float, mu_s: float) -> float:
    """g tan(phi_s - theta)."""
    return (
        G
        * (mu_s * cos(radians(theta)) - sin(radians(theta)))
        / (cos(radians(theta)) + mu_s * sin(radians(theta)))
    )


def limiting_acceleration(theta: float, mu_s: float, yield_acceleration: float) -> float:
    """Eq. 7."""
    tan_theta = tan(radians(theta))
    return (yield_acceleration + G * mu_s) / (1 - tan_theta * (mu_s - tan_theta))


@st.composite
def _planes(draw: st.DrawFn) -> tuple[float, float, float]:
    """theta and mu_s at which the block stands, and the amplitude of uplift."""
    theta = draw(thetas)
    mu_s = draw(frictions)
    tan_theta = tan(radians(theta))
    assume(mu_s > tan_theta + 0.02)
    return theta, mu_s, G / tan_theta if tan_theta > 0 else 10 * G


@st.composite
def _cells(draw: st.DrawFn, low: float, high: float, theta: float, mu_s: float) -> Cell:
    assume(high > low * (1 + 1e-3))
    amplitude = low + draw(INSIDE) * (high - low)
    return {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "frequency": draw(frequencies)}


@st.composite
def stuck(draw: st.DrawFn) -> Cell:
    """Amplitudes up to, and often at, the yield acceleration."""
    theta, mu_s, uplift = draw(_planes())
    onset = coulomb_yield(theta, mu_s) if draw(st.booleans()) else draw(st.floats(0.05, 5.0))
    share = draw(st.just(1.0) | st.floats(0.01, 1.0))
    limit = limiting_acceleration(theta, mu_s, onset)
    amplitude = share * onset
    assume(amplitude < uplift and mu_s * (amplitude / limit) ** 2 < 0.99)
    cell = {"theta": theta, "mu_s": mu_s, "amplitude": amplitude, "frequency": draw(frequencies)}
    return {**cell, "yield_acceleration": onset, "cycles": draw(cycles)}


@st.composite
def stick_slip(draw: st.DrawFn, measured_yield: bool | None = None) -> Cell:
    """Stick-slip with calibrated friction; the yield acceleration Coulomb's or measured."""
    theta, mu_s, uplift = draw(_planes())
    onset = coulomb_yield(theta, mu_s)
    options = {}
    if draw(st.booleans()) if measured_yield is None else measured_yield:
        onset *= draw(st.floats(0.05, 0.95))
        options = {"yield_acceleration": onset}
    limit = limiting_acceleration(theta, mu_s, onset)
    cell = draw(_cells(onset, min(limit, uplift, limit * mu_s**-0.5), theta, mu_s))
    return {**cell, **options, "cycles": draw(cycles)}


@st.composite
def continuous(draw: st.DrawFn, theta: float | None = None) -> Cell:
    """Continuous mode with calibrated friction."""
    drawn_theta, mu_s, uplift = draw(_planes())
    if theta is None:
        theta = drawn_theta
    else:
        uplift = 10 * G if theta == 0 else G / tan(radians(theta))
    limit = limiting_acceleration(theta, mu_s, coulomb_yield(theta, mu_s))
    cell = draw(_cells(limit, min(3 * limit, uplift), theta, mu_s))
    return {**cell, "cycles": draw(cycles)}


@st.composite
def newmark(draw: st.DrawFn) -> Cell:
    """Newmark's block above yield."""
    theta, mu_s, _ = draw(_planes())
    onset = coulomb_yield(theta, mu_s)
    cell = draw(_cells(onset, 8 * onset, theta, mu_s))
    return {**cell, "cycles": draw(cycles), "model": "newmark"}


@st.composite
def given_friction(draw: st.DrawFn) -> Cell:
    """Yield acceleration, decay rate and delta_mu from tests; stick-slip or continuous."""
    theta, mu_s, uplift = draw(_planes())
    onset = coulomb_yield(theta, mu_s) * draw(st.floats(0.05, 1.0))
    cell = draw(
        _cells(onset, min(uplift, 3 * limiting_acceleration(theta, mu_s, onset)), theta, mu_s)
    )
    rate = draw(st.just(0.0) | st.floats(0.1, 10.0) | st.floats(10.0, 1000.0))
    friction = {
        "yield_acceleration": onset,
        "decay_rate": rate,
        "delta_mu": draw(st.just(0.0) | st.floats(0.01, 0.4)),
    }
    return {**cell, **friction, "cycles": draw(cycles)}


@st.composite
def anything(draw: st.DrawFn) -> Cell:
    """Any input that is no error, under any model and option."""
    cell: Cell = {
        "theta": draw(st.just(0.0) | st.floats(0.0, 80.0)),
        "mu_s": draw(st.floats(0.005, 4.0)),
        "amplitude": draw(st.just(0.0) | st.floats(0.01, 60.0)),
        "frequency": draw(frequencies),
        "cycles": draw(cycles),
        "model": draw(st.sampled_from(["mendez", "mendez", "mendez", "newmark"])),
    }
    if cell["model"] == "mendez":
        cell |= draw(model_options)
    given = {
        "yield_acceleration": st.floats(0.01, 10.0) | st.floats(-1.0, 0.0),
        "decay_rate": st.floats(0.0, 30.0),
        "delta_mu": st.floats(0.0, 1.0),
        "minimum_friction": st.floats(0.001, 1.0),
        "structure_frequency": st.floats(0.1, 100.0),
    }
    for name, values in given.items():
        if draw(st.integers(0, 2)) == 0:
            cell[name] = draw(values)
    return cell


#: Every regime that has a value, under every option.
sliding_cells = stick_slip() | continuous() | newmark() | given_friction()


def phase_scale(cell: Cell) -> float:
    """1 / omega, s."""
    return 1 / (2 * pi * float(cell["frequency"]))
