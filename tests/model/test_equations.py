"""The paper's equations against each other."""

import math
from typing import Any

import numba
import pytest

from slipsweep.kernels.eq4 import opposite
from slipsweep.model import equations as eq

MU_S = 0.38
TAN_THETA = math.tan(math.radians(5.0))
G = 9.81


@pytest.mark.parametrize("ground", [0.7, 2.0, 3.5])
@pytest.mark.parametrize("friction", [0.12, 0.2, 0.3])
def test_eq1_gives_back_the_friction_of_eq4(ground: float, friction: float) -> None:
    block = eq.block_acceleration(ground, friction, MU_S, TAN_THETA, G)
    # Eq. 1 holds the magnitudes: Eq. 4 has to ask for an acceleration along the plane's
    if block > 0.0:
        assert eq.mobilised_friction(ground, block, MU_S, TAN_THETA, G) == pytest.approx(
            friction, rel=1e-13
        )
    else:
        assert friction < MU_S - TAN_THETA - (ground - G * TAN_THETA) / (G + ground * TAN_THETA)


@pytest.mark.parametrize("ground", [-5.1, -0.4, 0.0, 0.7, 3.5])
@pytest.mark.parametrize("theta", [0.0, 5.0, 30.0])
def test_eqs_2_and_3_are_the_force_normal_to_the_plane(ground: float, theta: float) -> None:
    """N/m is what weight and the plane's horizontal acceleration have normal to it; over cos θ."""
    angle = math.radians(theta)
    normal = G * math.cos(angle) + ground * math.sin(angle)
    assert eq.normal_acceleration(ground, math.tan(angle), G) == pytest.approx(
        normal / math.cos(angle), rel=1e-14
    )


def test_eq7_is_eq4_without_friction_at_yield() -> None:
    limit = eq.limiting_acceleration(0.59, MU_S, TAN_THETA, G)
    assert eq.block_acceleration(limit, 0.0, MU_S, TAN_THETA, G) == pytest.approx(0.59, rel=1e-14)


def test_eqs_10_and_11_meet_where_the_modes_do() -> None:
    assert eq.delta_mu(MU_S, 1.0) == 0.0
    assert eq.delta_mu(MU_S, 1.25) == pytest.approx(0.25 * MU_S, rel=1e-15)
    assert eq.delta_mu(MU_S, 0.8) == pytest.approx(0.25 * MU_S, rel=1e-15)


def test_eq6_without_an_excess_is_eq5() -> None:
    assert eq.friction_coefficient(2.0, MU_S, 0.0, 2.7, G) == pytest.approx(
        MU_S * math.exp(-2.7 * 2.0 / G)
    )


def test_eq12_brakes_evenly_and_not_backwards() -> None:
    held = 1.5  # g Kd
    assert eq.attenuated_velocity(0.3, held, 0.1) == pytest.approx(0.3 - 1.5 * 0.1, rel=1e-14)
    assert eq.attenuated_velocity(0.3, held, 0.5) == 0.0
    assert eq.attenuated_displacement(0.3, held, 0.1) == pytest.approx(
        0.3 * 0.1 - 1.5 * 0.1**2 / 2, rel=1e-14
    )
    for after_the_stop in (0.2, 0.5, math.inf):
        assert eq.attenuated_displacement(0.3, held, after_the_stop) == pytest.approx(
            0.3**2 / 3.0, rel=1e-14
        )


@pytest.mark.parametrize("ground", [-6.0, -0.4, 0.2, 3.5])
def test_slopes_of_eq4_are_those_of_its_values(ground: float) -> None:
    """By central differences, whose error is the square of their step."""
    decay = 0.3
    delta_mu = 0.1
    step = 1e-4

    def friction(x: float) -> float:
        return eq.friction_coefficient(x, MU_S, delta_mu, decay, 1.0)

    def rate(x: float) -> float:
        return eq.relative_acceleration(x, friction(x), MU_S, TAN_THETA, G)

    def slope(x: float) -> float:
        return eq.relative_acceleration_slope(
            x, friction(x), -decay * friction(x), MU_S, TAN_THETA, G
        )

    values, slopes = ((f(ground + step) - f(ground - step)) / (2 * step) for f in (rate, slope))
    assert slope(ground) == pytest.approx(values, rel=1e-8)
    derivatives = -decay * friction(ground), decay**2 * friction(ground)
    assert eq.relative_acceleration_curvature(ground, *derivatives, TAN_THETA, G) == pytest.approx(
        slopes, rel=1e-8
    )


@numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
def _lag(x: Any, mu: Any) -> Any:
    return eq.lag(x, mu, MU_S, TAN_THETA, G)


@numba.njit  # type: ignore[untyped-decorator]
def _opposite(a: float, b: float) -> bool:
    return opposite(a, b)


def test_equations_answer_python_and_jitted_functions_alike() -> None:
    """Whole numbers, too: the same function, compiled for what calls it."""
    whole = [_lag(2, 0), eq.lag(2, 0, MU_S, TAN_THETA, G)]
    assert whole == pytest.approx([whole[0]] * 2, rel=1e-14)
    fractions = [eq.lag(0.7, friction=0.2, mu_s=MU_S, tan_theta=TAN_THETA, g=G), _lag(0.7, 0.2)]
    assert fractions == pytest.approx(
        [G * (MU_S - 0.2) + 0.7 * TAN_THETA * (MU_S - TAN_THETA - 0.2)] * 2, rel=1e-14
    )
    assert [_opposite(-1.0, 2.0), _opposite(1.0, 2.0)] == [True, False]
