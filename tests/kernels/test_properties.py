"""What must hold for every block: scaling, signs, order, symmetry, and indifference to how a sweep
is written.
"""

from math import isclose, isnan, radians, tan
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import slipsweep
from slipsweep.model.variables import DEFAULT_RESULTS, VALUELESS, Validity
from tests.support import reference, strategies
from tests.support.cases import choices

SOLVERS = pytest.mark.parametrize("solver", ["cycle", "step"])

#: Steps for which a mendez cell of the step solver is compared (a few for what does not depend on
#: them).
FINE = 8192
COARSE = 256


def respond(cell: strategies.Cell, **changes: Any) -> xr.Dataset:
    return slipsweep.sweep(**choices(**{**cell, **changes}))


def value(result: xr.Dataset, name: str = "permanent_displacement") -> float:
    return float(result[name])


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Bit for bit, NaN with NaN."""
    for name in DEFAULT_RESULTS:
        np.testing.assert_array_equal(one[name].to_numpy(), other[name].to_numpy(), err_msg=name)
        assert one[name].dtype == other[name].dtype, name


# Scaling law


@SOLVERS
@strategies.reproducible
@given(cell=strategies.sliding_cells, power=st.integers(-20, 20))
def test_scaling_law_is_exact_for_powers_of_two(
    solver: str, cell: strategies.Cell, power: int
) -> None:
    """u goes with f^-2 and v with f^-1: a power of two changes no digit; one of an axis is that one
    by itself.
    """
    cell = {**cell, "solver": solver, "steps_per_cycle": COARSE}
    one = respond(cell)
    other = respond(cell, frequency=cell["frequency"] * 2.0**power)
    axis = respond(cell, frequency=[cell["frequency"], 7.0, cell["frequency"] * 2.0**power])
    assert axis.permanent_displacement.values[::2].tolist() == [value(one), value(other)]
    assert value(other) == value(one) * 2.0 ** (-2 * power), "displacement"
    assert (
        value(other, "peak_relative_velocity") == value(one, "peak_relative_velocity") * 2.0**-power
    ), "velocity"
    assert int(other.validity) == int(one.validity)


# Signs and order


@SOLVERS
@strategies.reproducible
@given(cell=strategies.stuck(), model=st.sampled_from(["mendez", "newmark"]))
def test_no_slip_at_or_below_yield(solver: str, cell: strategies.Cell, model: str) -> None:
    result = respond(cell, model=model, solver=solver)
    assert value(result) == 0.0, "displacement"
    assert value(result, "peak_relative_velocity") == 0.0, "velocity"
    assert int(result.sliding_mode) == 0, "sliding mode"
    assert int(result.validity) == 0, "validity"


@SOLVERS
@strategies.reproducible
@given(cell=strategies.stick_slip() | strategies.newmark())
def test_one_ulp_above_yield_slips_hardly(solver: str, cell: strategies.Cell) -> None:
    """A = Uy sticks; the next double above it slides, by nothing that a double of size A/omega^2
    could show.
    """
    onset = cell["amplitude"]
    cell = {**cell, "yield_acceleration": onset, "solver": solver}
    above = float(np.nextafter(onset, np.inf))
    scale = onset * strategies.phase_scale(cell) ** 2
    limit = strategies.limiting_acceleration(cell["theta"], cell["mu_s"], onset)
    assume(cell["mu_s"] * (above / limit) ** 2 < 0.99 and above < limit)
    assert int(respond(cell).sliding_mode) == 0
    result = respond(cell, amplitude=above)
    assert int(result.sliding_mode) == 1
    assert 0 <= value(result) <= 1e-25 * scale


@SOLVERS
@strategies.reproducible
@given(cell=strategies.stick_slip() | strategies.newmark(), options=strategies.model_options)
def test_cycles_add_up(solver: str, cell: strategies.Cell, options: dict[str, str]) -> None:
    """In stick-slip no cycle moves the block upslope; where each pulse ends at rest, N cycles are N
    times one.
    """
    cell = {**cell, **options, "solver": solver, "steps_per_cycle": COARSE}
    one, some, more = (
        respond(cell, cycles=cycles) for cycles in (1, cell["cycles"], cell["cycles"] + 1)
    )
    assume(not int(more.validity) & Validity.KD_NOT_POSITIVE)
    assert {int(result.sliding_mode) for result in (one, some, more)} == {1}
    for name in ("permanent_displacement", "peak_relative_velocity"):
        assert value(more, name) >= value(some, name) * (1 - 1e-14) >= 0, name
    if not int(some.validity) & Validity.NOT_RECOUPLED:
        assert isclose(value(some), cell["cycles"] * value(one), rel_tol=1e-14), "displacement"
        assert value(some, "peak_relative_velocity") == value(one, "peak_relative_velocity"), (
            "velocity"
        )


def test_run_out_may_exceed_another_cycle() -> None:
    """The exception: where Kd is tiny the run-out under Eq. 12 is longer than what the next pulse
    lets it be.
    """
    cell: strategies.Cell = {"theta": 0.0, "mu_s": 0.75, "amplitude": 2.8, "frequency": 1.0}
    cell |= {"yield_acceleration": 0.025, "decay_rate": 20.0, "delta_mu": 0.1}
    one = respond(cell, cycles=1)
    two = respond(cell, cycles=2)
    assert int(two.validity) & Validity.NOT_RECOUPLED
    assert 0 < value(two) < value(one)
    for cycles, result in ((1, one), (2, two)):
        expected = reference.solve(**cell, cycles=cycles)
        assert value(result) == pytest.approx(float(expected.permanent_displacement), rel=1e-11)


@strategies.reproducible
@given(cell=strategies.newmark(), factor=st.floats(1.0, 3.0))
def test_newmark_grows_with_amplitude(cell: strategies.Cell, factor: float) -> None:
    larger = respond(cell, amplitude=cell["amplitude"] * factor)
    assert value(larger) >= value(respond(cell)) * (1 - 1e-12)


# Symmetry of the level plane


@strategies.reproducible
@given(cell=strategies.continuous(theta=0.0))
def test_level_plane_velocity_repeats(cell: strategies.Cell) -> None:
    """theta = 0, continuous: pushed as far down as up, the block gains nothing in a whole cycle."""
    first, *later = (respond(cell, cycles=cycles) for cycles in (1, 2, 3, 10))
    speed = value(first, "peak_relative_velocity")
    scale = cell["amplitude"] * strategies.phase_scale(cell)
    for result in later:
        assert isclose(
            value(result, "peak_relative_velocity"), speed, rel_tol=1e-12, abs_tol=1e-13 * scale
        )
    two, three, ten = (value(result) for result in later)
    gained = two - value(first)
    scale *= strategies.phase_scale(cell)
    assert isclose(three - two, gained, rel_tol=1e-11, abs_tol=1e-12 * scale), (
        "displacement gained in a cycle"
    )
    assert isclose(ten - three, 7 * gained, rel_tol=1e-11, abs_tol=1e-11 * scale), (
        "displacement gained in seven"
    )


# Validity


def near_a_limit(cell: strategies.Cell) -> bool:
    """Whether rounding could decide a condition of the model."""
    tan_theta = tan(radians(cell["theta"]))
    others = ("frequency", "cycles", "rise", "recoupling", "structure_frequency")
    parameters = reference.friction_parameters(
        **{name: cell[name] for name in cell if name not in others}
    )
    onset = float(parameters.yield_acceleration)
    ratio = float(parameters.acceleration_ratio)
    margins = [
        cell["amplitude"] * tan_theta / strategies.G - 1,
        1 - tan_theta * (cell["mu_s"] - tan_theta),
        ratio - 1,
        cell["amplitude"] / onset - 1 if onset else 1.0,
    ]
    if "yield_acceleration" not in cell:
        margins.append(onset / strategies.G)
    if "decay_rate" not in cell and cell["amplitude"] > 0:
        margins.append(float(parameters.decay_rate) * cell["amplitude"] / strategies.G)
    if "structure_frequency" in cell:
        shares = cell["frequency"] / cell["structure_frequency"]
        margins += [shares - 0.2, shares - 1.3]
    return any(abs(margin) < 1e-9 for margin in margins)


@SOLVERS
@settings(strategies.reproducible, max_examples=150)
@given(cell=strategies.anything())
def test_validity_says_why(solver: str, cell: strategies.Cell) -> None:
    """Each bit is set where, and only where, its condition holds; NaN and mode -1 with the
    valueless ones.
    """
    assume(not near_a_limit(cell))
    expected = reference.solve(**cell)
    result = respond(cell, solver=solver, steps_per_cycle=FINE)
    assert Validity(int(result.validity)) == Validity(expected.validity), "validity"
    assert int(result.sliding_mode) == expected.sliding_mode, "sliding mode"
    valueless = bool(expected.validity & VALUELESS)
    assert isnan(value(result)) == valueless, "displacement missing"
    assert isnan(value(result, "peak_relative_velocity")) == valueless, "velocity missing"
    assert (int(result.sliding_mode) == -1) == valueless, "sliding mode missing"


STANDING: strategies.Cell = {
    "theta": 10.0,
    "mu_s": 0.5,
    "amplitude": 2.0,
    "frequency": 1.0,
    "yield_acceleration": 0.05,
}
COULOMB: strategies.Cell = {"yield_acceleration": None}
SLIPPERY: strategies.Cell = {
    "theta": 0.0,
    "mu_s": 1.5,
    "amplitude": 14.0,
    "yield_acceleration": 1.0,
}
STUCK: strategies.Cell = {"theta": 0.0, "mu_s": 3.0, "amplitude": 60.0, "yield_acceleration": 60.0}
ESTIMATED = Validity.FRICTION_ESTIMATED


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ESTIMATED),
        ({"decay_rate": 2.0}, ESTIMATED),
        ({"delta_mu": 0.1, "recoupling": "integrate"}, ESTIMATED),
        ({"decay_rate": 2.0, "delta_mu": 0.1}, 0),
        ({"minimum_friction": 0.05, "delta_mu": 0.1, "cycles": 1}, ESTIMATED),
        ({"amplitude": 0.05}, 0),
        ({"amplitude": 4.8, "recoupling": "integrate"}, Validity.NEAR_MODE_LIMIT | ESTIMATED),
        ({"amplitude": 5.5, "recoupling": "integrate"}, Validity.NEAR_MODE_LIMIT | ESTIMATED),
        ({**COULOMB, "mu_s": 0.1}, Validity.STATICALLY_UNSTABLE),
        ({"yield_acceleration": 0.0}, Validity.STATICALLY_UNSTABLE),
        ({"theta": 45.0, "mu_s": 1.5, "amplitude": 9.9}, Validity.UPLIFT),
        (
            {"theta": 45.0, "mu_s": 1.5, "amplitude": 9.9, "yield_acceleration": 11.0},
            Validity.UPLIFT,
        ),
        ({"theta": 45.0, "mu_s": 2.5, "amplitude": 3.0}, Validity.LIMIT_UNDEFINED),
        (
            {"theta": 45.0, "mu_s": 2.5, "amplitude": 10.0},
            Validity.UPLIFT | Validity.LIMIT_UNDEFINED,
        ),
        (SLIPPERY, Validity.FRICTION_NOT_DECAYING),
        ({**SLIPPERY, "decay_rate": 0.5, "delta_mu": 0.5}, 0),
        (STUCK, Validity.FRICTION_NOT_DECAYING),
        ({**STUCK, "decay_rate": 1.0}, 0),
        ({**COULOMB, "amplitude": 3.2}, Validity.YIELD_GOVERNS),
        ({**COULOMB, "rise": "literal", "amplitude": 3.2}, Validity.KD_NOT_POSITIVE),
        ({"amplitude": 4.0}, Validity.NOT_RECOUPLED | ESTIMATED),
        ({"amplitude": 4.0, "cycles": 1}, ESTIMATED),
        ({"amplitude": 4.0, "recoupling": "integrate"}, ESTIMATED),
        ({"structure_frequency": 5.0}, Validity.FLEXIBLE_BLOCK | ESTIMATED),
        ({"structure_frequency": 5.01}, ESTIMATED),
        ({"frequency": 1.3, "structure_frequency": 1.0}, Validity.FLEXIBLE_BLOCK | ESTIMATED),
        ({"frequency": 1.31, "structure_frequency": 1.0}, ESTIMATED),
        (
            {**COULOMB, "mu_s": 0.1, "structure_frequency": 2.0},
            Validity.STATICALLY_UNSTABLE | Validity.FLEXIBLE_BLOCK,
        ),
        ({"model": "newmark", "theta": 45.0, "mu_s": 2.5, "amplitude": 10.0}, 0),
        ({**COULOMB, "model": "newmark", "mu_s": 0.1}, Validity.STATICALLY_UNSTABLE),
        ({**STUCK, "model": "newmark"}, 0),
    ],
)
def test_each_flag(changes: dict[str, Any], expected: int) -> None:
    result = respond(STANDING, **changes)
    assert Validity(int(result.validity)) == Validity(expected)
    assert isnan(value(result)) == bool(expected & VALUELESS)


# How a sweep is written

AXES: dict[str, Any] = {
    "theta": np.array([0.0, 4.0, 11.0, 19.0, 33.0]),
    "mu_s": np.array([0.25, 0.5, 0.75, 1.25]),
    "amplitude": np.array([0.0, 0.5, 1.25, 2.0, 3.5, 5.0, 7.5, 11.0, 16.0, 23.0]),
    "frequency": np.array([0.5, 1.0, 4.0]),
}


@pytest.fixture(
    scope="module",
    params=[
        {"solver": "cycle", "cycles": 3},
        {"solver": "cycle", "yield_acceleration": 0.375, "rise": "literal"},
        {"solver": "step", "steps_per_cycle": 128},
    ],
    ids=["batches", "walk", "step"],
)
def options(request: pytest.FixtureRequest) -> dict[str, Any]:
    return dict(request.param)


@pytest.fixture(scope="module")
def expected(options: dict[str, Any]) -> xr.Dataset:
    return slipsweep.sweep(**choices(**AXES, **options))


def test_axes_hold_every_mode_and_the_flags() -> None:
    """The grid of the tests below would prove little if it were all of one kind."""
    result = slipsweep.sweep(**AXES)
    assert set(np.unique(result.sliding_mode)) == {-1, 0, 1, 2}
    assert np.bitwise_or.reduce(result.validity.to_numpy(), axis=None) & 0b11011 == 0b11011


def test_accelerations_scale(options: dict[str, Any]) -> None:
    """With A, Uy and g doubled, u and v double, bit by bit."""
    given: dict[str, Any] = {**AXES, **options, "g": strategies.G}
    twice = {
        name: 2 * given[name] for name in ("amplitude", "yield_acceleration", "g") if name in given
    }
    one = slipsweep.sweep(**choices(**given))
    two = slipsweep.sweep(**choices(**given | twice))
    for name, factor in (
        ("permanent_displacement", 2),
        ("peak_relative_velocity", 2),
        ("validity", 1),
    ):
        np.testing.assert_array_equal(two[name], factor * one[name], err_msg=name)


def test_integers_and_single_precision_mean_the_same(
    options: dict[str, Any], expected: xr.Dataset
) -> None:
    single: dict[str, Any] = {name: values.astype(np.float32) for name, values in AXES.items()}
    assert_same(slipsweep.sweep(**choices(**single, **options)), expected)
    whole: dict[str, Any] = {**AXES, "theta": AXES["theta"].astype(int), "frequency": [1, 4]}
    assert_same(slipsweep.sweep(**choices(**whole, **options)), expected.isel(frequency=[1, 2]))


def test_order_of_values_does_not_matter(options: dict[str, Any], expected: xr.Dataset) -> None:
    generator = np.random.default_rng(12)
    orders = {name: generator.permutation(values.size) for name, values in AXES.items()}
    shuffled = slipsweep.sweep(
        **choices(**{name: values[orders[name]] for name, values in AXES.items()}, **options)
    )
    assert_same(shuffled, expected.isel(orders))
    strided: dict[str, Any] = {name: np.repeat(values, 2)[::2] for name, values in AXES.items()}
    assert_same(slipsweep.sweep(**choices(**strided, **options)), expected)


def test_order_of_dimensions_does_not_matter(options: dict[str, Any], expected: xr.Dataset) -> None:
    theta, amplitude = xr.broadcast(
        xr.DataArray(AXES["theta"], dims="row"), xr.DataArray(AXES["amplitude"], dims="column")
    )
    for dims in (("row", "column"), ("column", "row")):
        given = {**AXES, "theta": theta.transpose(*dims), "amplitude": amplitude}
        result = slipsweep.sweep(**choices(**given, **options))
        assert_same(result.transpose("row", "mu_s", "column", "frequency"), expected)


def test_zipped_is_the_diagonal_of_crossed(options: dict[str, Any], expected: xr.Dataset) -> None:
    grid = np.meshgrid(*AXES.values(), indexing="ij")
    zipped: dict[str, Any] = {
        name: xr.DataArray(values.reshape(-1), dims="case")
        for name, values in zip(AXES, grid, strict=True)
    }
    result = slipsweep.sweep(**choices(**zipped, **options))
    assert result.permanent_displacement.dims == ("case",)
    assert_same(result, expected.stack(case=list(AXES)))


def test_one_cell_is_a_cell_of_the_grid(options: dict[str, Any], expected: xr.Dataset) -> None:
    for at in ((0, 1, 5, 1), (1, 1, 6, 2), (3, 2, 4, 0), (4, 3, 8, 2), (2, 0, 2, 1)):
        index = dict(zip(AXES, at, strict=True))
        cell: strategies.Cell = {name: float(AXES[name][i]) for name, i in index.items()}
        assert_same(slipsweep.sweep(**choices(**cell, **options)), expected.isel(index))


@pytest.mark.parametrize(
    "name", ["yield_acceleration", "decay_rate", "delta_mu", "minimum_friction"]
)
def test_default_given_back_changes_nothing(name: str) -> None:
    """A parameter given at its own estimate is the estimate, to the conditioning of the cells."""
    axes: dict[str, Any] = {name: values for name, values in AXES.items() if name != "frequency"}
    axes["amplitude"] = axes["amplitude"][1:]
    result = slipsweep.sweep(**choices(**axes, frequency=1.0))
    sliding = (result.sliding_mode > 0).to_numpy()
    estimate = slipsweep.friction_parameters(**choices(**axes))[name].broadcast_like(
        result.permanent_displacement
    )
    given = xr.where(sliding, estimate, 1.0).drop_vars("frequency", errors="ignore")
    again = slipsweep.sweep(**choices(**axes, frequency=1.0, **{name: given}))
    for what in ("permanent_displacement", "peak_relative_velocity"):
        np.testing.assert_allclose(
            again[what].to_numpy()[sliding], result[what].to_numpy()[sliding], rtol=1e-11
        )
