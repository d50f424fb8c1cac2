"""Arguments of the public functions: values that are not allowed are refused by their names."""

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import dask.array
import numpy as np
import pint
import pytest
import xarray as xr

import slipsweep
from slipsweep import InputError
from slipsweep.model.parameters import check_single, check_values

RECORD = slipsweep.Record(np.arange(5) / 10, np.array([0.0, 4.0, -4.0, 2.0, 0.0]))
UNCERTAIN = {"mu_s": {"distribution": "lognorm", "s": 0.1, "kind": "factor"}}
CELL: dict[str, Any] = {"theta": 5.0, "mu_s": 0.38, "amplitude": 3.0, "frequency": 1.0}
BLOCK = {"theta": 5.0, "mu_s": 0.38}

#: Every public function of parameters, with arguments that are good.
FUNCTIONS: dict[str, tuple[Callable[..., xr.Dataset], dict[str, Any]]] = {
    "sweep": (slipsweep.sweep, CELL),
    "friction_parameters": (slipsweep.friction_parameters, {**BLOCK, "amplitude": 3.0}),
    "simulate": (slipsweep.simulate, CELL),
    "sweep of a record": (slipsweep.sweep, {"excitation": RECORD, **BLOCK}),
    "limit_amplitude": (
        slipsweep.limit_amplitude,
        {"displacement": 0.1, **BLOCK, "frequency": 1.0},
    ),
    "required_strength": (
        slipsweep.required_strength,
        {"displacement": 0.1, "of": "mu_s", "theta": 5.0, "amplitude": 3.0, "frequency": 1.0},
    ),
    "sample": (slipsweep.sample, {**CELL, "uncertain": UNCERTAIN, "samples": 8}),
}


def call(function: str, **changed: Any) -> xr.Dataset:
    """A public function with good arguments but for some."""
    called, good = FUNCTIONS[function]
    return called(**{**good, **changed})


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_missing_parameter_is_named(function: str) -> None:
    for name in FUNCTIONS[function][1]:
        if name == "samples":
            continue
        with pytest.raises(InputError, match=name):
            call(function, **{name: None})


def test_nothing_drawn_needs_a_value() -> None:
    drawn = {"mu_s": {"distribution": "uniform", "loc": 0.3, "scale": 0.1}}
    assert call("sample", mu_s=None, uncertain=drawn).mean_displacement.item() > 0.0


# ---------------------------------------------------------------------------------- masked

MASKED = np.ma.masked_array([0.2, 0.4, 0.6, 0.8], [False, True, True, False])


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.filterwarnings("error")
def test_masked_entries_are_no_values(function: str) -> None:
    for masked in (MASKED, dask.array.from_array(MASKED)):
        with pytest.raises(InputError, match="theta: 2 of 4 values are masked"):
            call(function, theta=masked)
    with pytest.raises(InputError, match="acceleration: 2 of 4 values are masked"):
        slipsweep.Record(np.arange(4.0), MASKED)


# -------------------------------------------------------------------- names of a dataset


def test_stacked_coordinates_come_apart() -> None:
    grid = xr.Dataset(coords={"mu_s": ("mu_s", [0.3, 0.4]), "site": ("site", ["a", "b", "c"])})
    grid["theta"] = grid.mu_s * 0.0 + xr.DataArray([0.0, 5.0, 8.0], dims="site")
    cases = grid.stack(case=("mu_s", "site"))
    result = call("sweep", theta=cases.theta, mu_s=cases.mu_s)
    assert result.permanent_displacement.dims == ("case",)
    assert result.site.values.tolist() == ["a", "b", "c"] * 2
    np.testing.assert_array_equal(result.mu_s, np.repeat([0.3, 0.4], 3))
    crossed = call("sweep", theta=grid.theta, mu_s=grid.mu_s).permanent_displacement
    np.testing.assert_array_equal(
        result.permanent_displacement, crossed.transpose("mu_s", "site").values.ravel()
    )


@pytest.mark.parametrize("function", ["sweep", "sample"])
def test_coordinates_and_dimensions_named_like_a_result(function: str) -> None:
    name = {"sweep": "validity", "sample": "quantile"}[function]
    for theta in (
        xr.DataArray([1.0, 2.0], dims="case", coords={name: ("case", [1, 2])}),
        xr.DataArray([1.0, 2.0], dims=name),
    ):
        with pytest.raises(
            InputError, match=f"{name}.* is the name of a result|{name}.* has the name of a result"
        ):
            call(function, theta=theta)


# -------------------------------------------------------------------------- other arguments

REFUSED: list[tuple[str, dict[str, Any], str]] = [
    (
        "sweep of a record",
        {"variables": []},
        r"variables = \[\]: must name one of 'permanent_displacement'",
    ),
    ("sweep", {"variables": 5}, "variables = 5: must be a list of names"),
    ("sweep", {"variables": [["validity"]]}, r"variables = \['validity'\]: must be one of"),
    ("sweep", {"theta": [1.0, 2.0], "chunks": 0}, "chunks = 0: "),
    ("sweep", {"theta": True}, "theta = True: must be a number"),
    (
        "sweep",
        {"model": ["mendez"]},
        r"model = \['mendez'\]: must be one of 'mendez', 'newmark', or Mendez\(...\)",
    ),
    ("sweep", {"solver": np.zeros(3)}, r"solver = array\(\[0., 0., 0.\]\): must be one of"),
    ("sweep", {"excitation": "harmonics"}, "amplitudes: must be given with waveform = 'harmonics'"),
    ("sweep", {"excitation": slipsweep.Sine}, "excitation = <class .*>: must be one of 'sine'"),
    ("simulate", {"excitation": RECORD}, "frequency: not allowed with a Record"),
    ("sweep", {"progress": 3}, "progress = 3: must be a function"),
    ("sample", {"thresholds": None}, "thresholds = "),
    ("sample", {"correlation": 5}, "correlation = 5: must be a list"),
    (
        "sample",
        {"correlation": [["mu_s", ["theta"], 0.1]]},
        r"correlation = \['theta'\]: must be one of",
    ),
    ("sweep of a record", {"polarity": {1}}, r"polarity = \{1\}: must be 1, -1"),
    # names that no dataset can have
    (
        "sweep",
        {"theta": xr.DataArray([1.0, 2.0], dims="mu_s")},
        "mu_s: is a dimension of another parameter",
    ),
    (
        "sweep",
        {"theta": xr.DataArray([1.0], dims="case"), "mu_s": xr.DataArray(0.4, coords={"case": 1})},
        "mu_s: its coordinate 'case' has the name of a dimension",
    ),
    (
        "sweep",
        {"theta": xr.Variable(("x", "x"), np.ones((2, 2)))},
        "theta: dimensions x, x: must be named each once",
    ),
]


@pytest.mark.parametrize(("function", "changed", "message"), REFUSED)
def test_values_that_no_physics_allows_are_named(
    function: str, changed: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message) as raised:
        call(function, **changed)
    assert "\n" not in str(raised.value)


def test_long_values_are_cut_short() -> None:
    with pytest.raises(InputError) as raised:
        call("sweep", theta=xr.Dataset({"a": ("x", np.arange(1000.0))}))
    assert len(str(raised.value)) < 250
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "number", [np.float32(0.5), np.array(0.5), Decimal("0.5"), Fraction(1, 2), xr.DataArray(0.5)]
)
def test_numbers_of_other_types_are_accepted(number: Any) -> None:
    assert slipsweep.Sine(ramp_in=number) == slipsweep.Sine(ramp_in=0.5)
    for function, name in [
        ("sample", "thresholds"),
        ("sweep", "mu_s"),
        ("sweep of a record", "scale"),
    ]:
        xr.testing.assert_identical(call(function, **{name: number}), call(function, **{name: 0.5}))


# ----------------------------------------------------------------- units, friction angle, long
# texts


def test_a_friction_angle_is_its_tangent_along_its_own_dimension() -> None:
    tangents = np.tan(np.radians([20.0, 30.0]))
    expected = call("sweep", mu_s=tangents).permanent_displacement.values
    result = call("sweep", mu_s=None, phi=[20.0, 30.0])
    np.testing.assert_array_equal(result.permanent_displacement.values, expected)
    np.testing.assert_allclose(result.mu_s, tangents, rtol=1e-15)
    assert result.permanent_displacement.dims == result.mu_s.dims == ("phi",)
    assert result.phi.values.tolist() == [20.0, 30.0]
    assert result.phi.attrs["units"] == "degree"
    cases = call("sweep", mu_s=None, phi=xr.DataArray([20.0, 30.0], dims="case"))
    assert cases.mu_s.dims == cases.phi.dims == ("case",)
    np.testing.assert_array_equal(cases.permanent_displacement.values, expected)


@pytest.mark.parametrize("phi", [0.0, 90.0, -1.0, np.nan, "a"])
def test_friction_angles_that_are_none(phi: Any) -> None:
    with pytest.raises(InputError, match=r"^phi = "):
        call("sweep", mu_s=None, phi=phi)
    with pytest.raises(InputError, match="phi, mu_s: must not both be given"):
        call("sweep", mu_s=0.3, phi=20.0)


UNITS: Any = pint.UnitRegistry()


@pytest.mark.parametrize(
    ("name", "argument", "expected"),
    [
        ("amplitude", 0.3 * UNITS.standard_gravity, 0.3 * 9.80665),
        ("amplitude", UNITS.Quantity([10.0, 20.0], "cm/s**2"), [0.1, 0.2]),
        ("amplitude", xr.DataArray([0.1, 0.2], dims="x", attrs={"units": "g"}), [0.981, 1.962]),
        ("amplitude", xr.Variable("x", [1.0], {"units": "m s-2"}), [1.0]),
        ("theta", 0.1 * UNITS.radian, np.degrees(0.1)),
        ("frequency", 120.0 * UNITS.rpm, 2.0),
        ("displacement", 50.0 * UNITS.mm, 0.05),
    ],
)
def test_an_argument_with_a_unit_is_converted(name: str, argument: Any, expected: Any) -> None:
    np.testing.assert_allclose(check_values(name, argument), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        ("amplitude", 3.0 * UNITS.gram),
        ("mu_s", xr.DataArray(30.0, attrs={"units": "%"})),
    ],
)
def test_an_argument_with_a_unit_of_another_quantity_is_refused(name: str, argument: Any) -> None:
    with pytest.raises(InputError, match=f"{name}: units = .* must be a unit that converts to"):
        check_values(name, argument)


def test_displacements_have_their_direction_in_a_comment() -> None:
    result = call("sweep", variables=["permanent_displacement", "newmark_displacement"])
    for variable in (*result.data_vars.values(), call("simulate").relative_displacement):
        assert "cos(phi - theta) / cos(phi)" in variable.attrs["comment"]


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("theta", 0.0, 89.999),
        ("mu_s", 1e-30, 1e30),
        ("frequency", 1e-30, 1e30),
        ("amplitude", 0.0, 1e30),
        ("yield_acceleration", -1e30, 1e30),
        ("decay_rate", 0.0, 1e30),
        ("azimuth", 0.0, 360.0),
        ("ramp_in", 0.0, 100.0),
    ],
)
def test_bounds_of_parameters_hold_their_ends_and_nothing_beyond(
    name: str, least: float, most: float
) -> None:
    for inside in (least, most):
        assert check_single(name, inside) == inside
    step = max(abs(least), 1e-300) * 1e-3
    for outside in (least - step, most * 1.001, float("nan"), float("inf")):
        with pytest.raises(InputError, match=f"^{name} = "):
            check_single(name, outside)
