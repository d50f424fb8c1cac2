"""Numbers at the ends of their ranges: served, or refused by name; never infinite, missing unsaid,
or a warning.
"""

import math
import random
import re
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import xarray as xr

import slipsweep
from slipsweep.errors import InputError
from slipsweep.model.variables import VALUELESS
from tests.support.cases import choices


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def wide(rng: random.Random, exponent: float = 30.0) -> float:
    return float(10.0 ** rng.uniform(-exponent, exponent))


def extreme(rng: random.Random, name: str) -> float:
    """A number within the bounds of a parameter, near their ends or anywhere between."""
    if name == "theta":
        return rng.choice(
            [0.0, 1e-300, 1e-10, 89.9999, math.nextafter(90.0, 0.0), rng.uniform(0.0, 90.0)]
        )
    if name in ("amplitude", "decay_rate", "delta_mu") and rng.random() < 0.2:
        return 0.0
    if name == "yield_acceleration":
        return rng.choice([-1.0, 1.0, 1.0]) * wide(rng)
    return rng.choice([1e-30, 1e30, wide(rng), wide(rng)])


def common(rng: random.Random, name: str, g: float) -> float:
    """A number that an engineer would give."""
    units = g / 9.81
    ranges = {
        "theta": (0.0, 30.0),
        "mu_s": (0.1, 1.2),
        "amplitude": (0.1 * units, 10.0 * units),
        "frequency": (0.1, 10.0),
        "yield_acceleration": (0.01 * units, 5.0 * units),
        "decay_rate": (0.1, 10.0),
        "delta_mu": (0.0, 0.4),
        "minimum_friction": (0.01, 1.0),
    }
    return rng.uniform(*ranges[name])


def cell_of(rng: random.Random) -> dict[str, Any]:
    """Parameters, g among them, of which about half are extreme."""
    g = rng.choice([9.81, 9.81, 9.81, wide(rng)])
    names = ["theta", "mu_s", "amplitude", "frequency"]
    optional = ("yield_acceleration", "decay_rate", "delta_mu", "minimum_friction")
    names += [name for name in optional if rng.random() < 0.3]
    drawn = {
        name: common(rng, name, g) if rng.random() < 0.5 else extreme(rng, name) for name in names
    }
    return drawn | {"g": g}


def assert_valued(found: xr.Dataset) -> None:
    """Finite where there is a value, NaN where a flag takes it, infinite nowhere."""
    taken = (found.validity & int(VALUELESS)) != 0
    for name, values in found.data_vars.items():
        if values.dtype.kind == "f":
            assert not np.isinf(values).any(), name
            assert not (np.isnan(values) & ~taken).any(), name


WAVES: list[dict[str, Any]] = [
    {"waveform": "sine"},
    {"waveform": "square"},
    {"waveform": "triangle", "ramp_in": 1.5},
    {"waveform": "harmonics", "harmonics": "1:1:180,0.6:3:20"},
]


def without(given: dict[str, Any], *names: str) -> dict[str, Any]:
    """Arguments but for some, which a function does not take."""
    return {name: value for name, value in given.items() if name not in names}


def options_of(rng: random.Random) -> dict[str, Any]:
    options: dict[str, Any] = {"cycles": rng.choice([2, 10, 10**6]), **rng.choice(WAVES)}
    if rng.random() < 0.25:
        return options | {"model": "newmark"}
    return options | {
        "rise": rng.choice(["monotone", "literal"]),
        "recoupling": rng.choice(["eq12", "integrate"]),
    }


def sweep(rng: random.Random, cell: dict[str, Any]) -> xr.Dataset:
    options = options_of(rng)
    solver = {
        "solver": "step",
        "rule": rng.choice(["rectangle", "trapezoid", "simpson"]),
        "steps_per_cycle": 64,
    }
    return slipsweep.sweep(**choices(**cell | options | rng.choice([solver, {"solver": "cycle"}])))


def friction(rng: random.Random, cell: dict[str, Any]) -> xr.Dataset:
    given = without(choices(**cell), "frequency", "excitation", "solver")
    return slipsweep.friction_parameters(**given)


def simulate(rng: random.Random, cell: dict[str, Any]) -> xr.Dataset:
    options = options_of(rng) | {"cycles": 10}
    end = options["cycles"] / cell["frequency"]
    given = without(choices(**cell | options), "solver")
    return slipsweep.simulate(**given, times=np.linspace(0.0, 1.5 * end, 50))


def record(rng: random.Random, cell: dict[str, Any]) -> xr.Dataset:
    own = {name: value for name, value in cell.items() if name not in ("amplitude", "frequency")}
    values = np.array([0.0, 1.0, -0.7, 0.4, 0.9, -1.0, 0.0])
    peak = max(cell["amplitude"], 1e-30)
    times = np.arange(values.size) / max(cell["frequency"], 1e-29)
    options: dict[str, Any] = {
        "rise": rng.choice(["monotone", "literal"]),
        "scale": rng.choice([1.0, wide(rng)]),
    }
    motion = slipsweep.Record(times, peak * values)
    return slipsweep.sweep(
        **choices(**own, **options, excitation=motion, time_scale=rng.choice([1.0, wide(rng)]))
    )


def limit(rng: random.Random, cell: dict[str, Any]) -> xr.Dataset:
    own: dict[str, Any] = {name: value for name, value in cell.items() if name != "amplitude"}
    highest = {"maximum_amplitude": cell["amplitude"]} if cell["amplitude"] > 0.0 else {}
    given = without(choices(**own), "solver")
    found = slipsweep.limit_amplitude(
        rng.choice([1e-30, 0.1, 1e30]), **given, **highest, amplitude_steps=16
    )
    assert not np.isinf(found.limit_amplitude)
    return found[["validity"]]


def sample(rng: random.Random, cell: dict[str, Any]) -> xr.Dataset:
    drawn = {"mu_s": {"distribution": "uniform", "loc": 0.9, "scale": 0.2, "kind": "factor"}}
    found = slipsweep.sample(
        **choices(**cell), uncertain=drawn, samples=16, thresholds=[rng.choice([0.0, 0.1, 1e30])]
    )
    for name in ("displacement_quantile", "mean_displacement", "exceedance_probability"):
        assert not np.isinf(found[name]).any(), name
        assert bool((found.valueless_share == 1.0) | np.isfinite(found[name]).all()), name
    return found


WAYS: dict[str, tuple[Callable[..., xr.Dataset], int]] = {
    "sweep": (sweep, 200),
    "friction_parameters": (friction, 60),
    "simulate": (simulate, 60),
    "record": (record, 60),
    "limit": (limit, 30),
    "sample": (sample, 30),
}


@pytest.mark.parametrize("way", WAYS)
def test_served_or_refused_by_name(way: str) -> None:
    """Draws of which half the numbers are extreme; most are served, and no refusal
    is a surprise.
    """
    solve, count = WAYS[way]
    served = 0
    for seed in range(count):
        rng = random.Random(seed)
        cell = cell_of(rng)
        try:
            found = solve(rng, cell)
        except InputError as error:
            message = str(error)
            named = [
                name for name in (*cell, "maximum_amplitude", "of the record") if name in message
            ]
            assert named, f"seed {seed}: {message}"
            assert re.search("must be|are not a finite|too many cycles", message), (
                f"seed {seed}: {message}"
            )
            continue
        served += 1
        if "validity" in found:
            assert_valued(found)
    assert served > count / 2, "or this shows little"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"amplitude": 1.7e308},
            "amplitude = 1.7e+308: must be a finite number >= 0 and at most 1e+30",
        ),
        (
            {"frequency": 1e-160},
            "frequency = 1e-160: must be a finite number > 0, from 1e-30 to 1e+30",
        ),
        (
            {"yield_acceleration": -1e31},
            "yield_acceleration = -1e+31: must be a finite number from -1e+30 to 1e+30",
        ),
        (
            {"amplitude": None, "displacement_amplitude": [0.1, 1e20], "frequency": [1.0, 1e8]},
            "displacement_amplitude = 1e+20: with frequency = 1e+08, A = (2 pi f)^2 d = ",
        ),
        (
            {"amplitude": [0.0, 2.0], "variables": ["permanent_displacement", "decay_rate"]},
            "amplitude = 0: has no finite decay_rate (Eqs. 6, 11); "
            "must be > 0, or decay_rate be given",
        ),
    ],
)
@pytest.mark.parametrize("solver", ["cycle", "step"])
def test_refusals_name_what_is_too_much(given: dict[str, Any], message: str, solver: str) -> None:
    block: dict[str, Any] = {
        "theta": 5.0,
        "mu_s": 0.38,
        "amplitude": 3.0,
        "frequency": 1.0,
        "solver": solver,
    }
    with pytest.raises(InputError, match=re.escape(message)):
        slipsweep.sweep(**choices(**block | given))


@pytest.mark.parametrize("recoupling", ["eq12", "integrate"])
@pytest.mark.parametrize("rise", ["monotone", "literal"])
@pytest.mark.parametrize(
    "wave", [*WAVES, {"waveform": "triangle"}, {"waveform": "sine", "ramp_out": 1.0}], ids=str
)
def test_size_changes_nothing(wave: dict[str, Any], rise: str, recoupling: str) -> None:
    """All accelerations and g 1e±25 times as large: so is u, under a wave and a record."""
    shape = np.array([0.0, 4.2, -4.2, 4.2, 0.0])

    def moved(size: float) -> list[float]:
        block = {"theta": 4.0, "mu_s": 0.6, "rise": rise, "recoupling": recoupling}
        block |= {"yield_acceleration": 0.9 * size, "g": 9.81 * size}
        waved = {**wave, "amplitude": 4.2 * size, "frequency": 1.0, "cycles": 4, "solver": "cycle"}
        recorded = {
            "excitation": slipsweep.Record(np.array([0.0, 0.25, 0.75, 1.25, 1.5]), shape * size)
        }
        found = (slipsweep.sweep(**choices(**block, **motion)) for motion in (waved, recorded))
        return [float(one.permanent_displacement) / size for one in found]

    usual = moved(1.0)
    assert usual[0] > 0.0
    for size in (1e-25, 1e25):
        assert moved(size) == pytest.approx(usual, rel=1e-11), f"{size:g}"
