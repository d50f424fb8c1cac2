"""Elementary functions of the kernels, in loops, against mpmath; errors in ulp."""

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.coefficients import APPROXIMATIONS
from slipsweep.jit import elementary
from slipsweep.jit.compiling import kernel

HALF_PI = 0.5 * math.pi

Array = NDArray[np.float64]


def over(function: Callable[..., float], *arguments: Array) -> Array:
    """A function of every element."""
    if len(arguments) == 1:

        def loop(x: Array, results: Array) -> None:
            for i in range(x.size):
                results[i] = function(x[i])

        compiled = kernel(loop)
    else:

        def loop_of_two(x: Array, y: Array, results: Array) -> None:
            for i in range(x.size):
                results[i] = function(x[i], y[i])

        compiled = kernel(loop_of_two)
    results = np.empty_like(arguments[0])
    compiled(*arguments, results)
    return results


def worst(results: Array, function: Callable[..., Any], *arguments: Array) -> float:
    """Largest error, in units in the last place of the true values."""
    errors = []
    with mpmath.workdps(400):
        for value, *inputs in zip(
            results.tolist(), *(argument.tolist() for argument in arguments), strict=True
        ):
            true = function(*map(mpmath.mpf, inputs))
            errors.append(float(abs(value - true)) / math.ulp(float(true)))
    return max(errors)


def spread(low: float, high: float, smallest: float = 1e-300) -> Array:
    """Places over a range: evenly, closer and closer to 0, and its ends."""
    random = np.random.default_rng(7)
    near_zero = np.exp(random.uniform(math.log(smallest), math.log(high), 1000))
    both = np.concatenate([near_zero, -near_zero[near_zero <= -low]]) if low < 0.0 else near_zero
    ends = [low, high, np.nextafter(high, low), *([np.nextafter(low, high)] if low else [])]
    return np.concatenate([random.uniform(low, high, 2000), both, ends])


#: Its like in mpmath, places to try, and the largest error allowed: half a unit or more above what
#: was seen.
FUNCTIONS: dict[str, tuple[Callable[[Any], Any], Array, float]] = {
    "exp": (mpmath.exp, spread(-708.0, 709.0), 1.5),
    "log": (
        mpmath.log,
        np.concatenate([spread(1e-300, 1.7e308, 2.3e-308), 1.0 + spread(-0.5, 1.0, 1e-15)]),
        2.5,
    ),
    "versine": (lambda x: 1 - mpmath.cos(x), spread(-HALF_PI, HALF_PI, 1e-150), 2.0),
    "angle_minus_sine": (lambda x: x - mpmath.sin(x), spread(-HALF_PI, HALF_PI, 1e-100), 3.5),
    "half_square_minus_versine": (
        lambda x: x**2 / 2 - 1 + mpmath.cos(x),
        spread(-HALF_PI, HALF_PI, 1e-75),
        4.0,
    ),
    "inverse_versine": (lambda q: 2 * mpmath.asin(mpmath.sqrt(q / 2)), spread(0.0, 1.0), 2.5),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_errors_are_a_few_units_in_the_last_place(name: str) -> None:
    function, places, allowed = FUNCTIONS[name]
    assert worst(over(getattr(elementary, name), places), function, places) <= allowed


def test_the_rising_phase_is_accurate_near_the_peak() -> None:
    """As near to the peak as the two differ: there an angle of arccos has no digits."""
    amplitude = np.exp(np.random.default_rng(1).uniform(-20.0, 20.0, 3000))
    below = np.concatenate([spread(0.0, 1.0, 1e-16)[:2999], [0.0]])
    x = amplitude - amplitude * below
    phases = over(elementary.rising_phase, x, amplitude)
    assert np.all((phases >= -HALF_PI) & (phases <= 0.0))
    assert worst(phases, lambda x, a: -mpmath.acos(x / a), x, amplitude) <= 3.5


def test_arguments_beyond_the_range_give_the_values_at_its_ends() -> None:
    held = over(elementary.exp, np.array([-1e300, -710.0, -708.0, 709.0, 710.0, 1e300]))
    assert held.tolist() == [held[2]] * 3 + [held[3]] * 3
    ends = over(elementary.log, np.array([-math.inf, -1.0, 0.0, 1.0, math.inf]))
    assert np.isnan(ends[:2]).all()
    assert ends[2:].tolist() == [-math.inf, 0.0, math.inf]
    assert over(elementary.inverse_versine, np.array([-0.1, 0.0, 1.0, 1.1])).tolist() == [
        0.0,
        0.0,
        HALF_PI,
        HALF_PI,
    ]


@pytest.mark.parametrize("name", APPROXIMATIONS)
def test_coefficients_are_those_of_the_script(name: str) -> None:
    expected = APPROXIMATIONS[name].coefficients()
    if name == "exp":  # the beginning of the series, exact
        expected[0] = 0.5
    assert list(vars(elementary)[f"_{name.upper()}"]) == expected
