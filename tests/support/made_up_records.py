"""Made-up records: noise, pulses, and some of a few dozen samples in which much happens.

The last have plateaus, zeros that are touched, and peaks of one height.
`tests/kernels/test_record.py` holds the solver to the reference on some, ``python -m
benchmarks.agreement`` on many.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slipsweep import Record, sweep
from slipsweep.model.variables import VALUELESS
from tests.support.cases import choices
from tests.support.reference import solve_record


def band_noise() -> Record:
    """Noise with the band and envelope of earthquakes: pulses of all sizes, of several maxima."""
    rng = np.random.default_rng(7)
    times = np.arange(0.0, 20.0, 0.01)
    phases = rng.uniform(0, 2 * np.pi, 60)
    bands = np.sin(2 * np.pi * np.linspace(0.3, 9.0, 60)[:, None] * times + phases[:, None]).sum(0)
    wave = bands * (times / 4) ** 2 * np.exp(-times / 2.5)
    return Record(times, 6.0 * wave / np.abs(wave).max())


def few_pulses() -> Record:
    """Some pulses of different sizes and both signs."""
    times = np.arange(0.0, 8.0, 0.02)
    wave = np.sin(2 * np.pi * 1.1 * times) + 0.7 * np.sin(2 * np.pi * 2.7 * times + 1.0)
    return Record(times, wave * times**2 * np.exp(-1.2 * times))


def write_motion(path: Path, seed: int, count: int, interval: float) -> None:
    """Write noise under a window as a file of times and accelerations, without units."""
    values = 0.3 * np.random.default_rng(seed).normal(size=count) * np.hanning(count)
    rows = (f"{at * interval:.6g},{value:.6g}\n" for at, value in enumerate(values))
    path.write_text("time,acceleration\n" + "".join(rows))


#: Accelerations that meet each other.
LEVELS = (0.0, 0.0, 0.53, 1.03, 2.07, 3.1, 4.1, 5.03, 6.55)

#: What no difference exceeds, some ten times what a thousand have shown; of displacements of 1e-9
#: m, 1e-19 m.
SEEN = 1e-10


@dataclass(frozen=True)
class Made:
    """A record, and a block that it shakes."""

    record: Record
    theta: float
    mu_s: float
    given: dict[str, Any]


def made(seed: int) -> Made:
    """The record and the block of a seed, under one of all options."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 40))
    kind = rng.choice(["levels", "walk", "sine"], p=[0.4, 0.4, 0.2])
    if kind == "levels":
        values = rng.choice(LEVELS, count) * rng.choice([1, 1, -1], count)
    elif kind == "walk":
        values = np.clip(np.cumsum(rng.normal(0.0, 2.0, count)), -7.0, 7.0)
    else:
        values = (
            6.0 * np.sin(np.arange(count) * rng.uniform(0.2, 2.0)) * rng.uniform(0.2, 1.0, count)
        )
    drawn = {
        "yield_acceleration": (0.7, 10 ** rng.uniform(-2.0, 0.6)),
        "decay_rate": (0.5, 10 ** rng.uniform(-1.0, 2.0)),
        "delta_mu": (0.5, rng.choice([0.0, rng.uniform(0.0, 0.4)])),
    }
    given: dict[str, Any] = {
        name: float(value) for name, (share, value) in drawn.items() if rng.random() < share
    }
    given["recoupling"] = str(rng.choice(["eq12", "integrate"]))
    given["rise"] = str(rng.choice(["monotone", "literal"]))
    theta = float(rng.choice([0.0, rng.uniform(0.0, 25.0)]))
    mu_s = float(rng.uniform(0.1, 1.0))
    return Made(Record.sampled(values, float(rng.choice([0.02, 0.05, 0.1]))), theta, mu_s, given)


def difference(motion: Made) -> float:
    """The worst relative difference from the reference; infinite where flags differ."""
    result = sweep(motion.theta, motion.mu_s, **choices(**motion.given, excitation=motion.record))
    expected = vars(
        solve_record(
            motion.record.times,
            motion.record.acceleration,
            motion.theta,
            motion.mu_s,
            **motion.given,
        )
    )
    valueless = int(VALUELESS) & expected["validity"]
    seen = valueless or 2047  # other flags of a block without a value say nothing
    if (int(result.validity) ^ expected.pop("validity")) & seen:
        return math.inf
    pairs = [(result[name].item(), float(value)) for name, value in expected.items()]
    return (
        0.0
        if valueless
        else max(abs(value - exact) / max(abs(exact), 1e-9) for value, exact in pairs)
    )
