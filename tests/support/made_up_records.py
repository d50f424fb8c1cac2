"""Records of a few dozen samples in which much happens: plateaus, zeros touched, peaks of one height.

`tests/kernels/test_record.py` holds the solver to `record_reference` on some, ``python -m benchmarks.agreement`` on
many.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from slipsweep import Record, sweep
from tests.support.cases import choices
from tests.support.record_reference import Block
from tests.support.strategies import G

#: Accelerations that meet each other.
LEVELS = (0.0, 0.0, 0.53, 1.03, 2.07, 3.1, 4.1, 5.03, 6.55)

#: What no difference exceeds, some ten times what ten thousand have shown; of displacements of 1e-9 m, 1e-17 m.
SEEN = 1e-8

#: Parts of an interval between samples in which what the integrator has stepped over is looked for.
_PARTS = 7


@dataclass(frozen=True)
class Made:
    """A record, and a block that it shakes."""

    record: Record
    theta: float
    mu_s: float
    given: dict[str, Any]

    def expected(self) -> dict[str, Any]:
        """The response by an integrator."""
        return vars(Block(self.theta, self.mu_s, G, **self.given).respond(self.record, 1.0))

    def finer(self) -> "Made":
        """The same with samples added on the lines, which change nothing."""
        times = self.record.times
        many = np.interp(np.arange((times.size - 1) * _PARTS + 1) / _PARTS, np.arange(times.size), times)
        record = Record(many, np.interp(many, times, self.record.acceleration))
        return Made(record, self.theta, self.mu_s, self.given)


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
        values = 6.0 * np.sin(np.arange(count) * rng.uniform(0.2, 2.0)) * rng.uniform(0.2, 1.0, count)
    drawn = {
        "yield_acceleration": (0.7, 10 ** rng.uniform(-2.0, 0.6)),
        "decay_rate": (0.5, 10 ** rng.uniform(-1.0, 2.0)),
        "delta_mu": (0.5, rng.choice([0.0, rng.uniform(0.0, 0.4)])),
    }
    given: dict[str, Any] = {name: float(value) for name, (share, value) in drawn.items() if rng.random() < share}
    given["recoupling"] = str(rng.choice(["eq12", "integrate"]))
    given["rise"] = str(rng.choice(["monotone", "literal"]))
    theta, mu_s = float(rng.choice([0.0, rng.uniform(0.0, 25.0)])), float(rng.uniform(0.1, 1.0))
    return Made(Record.sampled(values, float(rng.choice([0.02, 0.05, 0.1]))), theta, mu_s, given)


def difference(one: Made) -> float | None:
    """The worst relative difference from `record_reference`; None where there is no value."""
    found = sweep(one.theta, one.mu_s, **choices(**one.given, excitation=one.record))
    if found.number_of_slips < 0:
        return None
    apart = _apart(found, one.expected)
    # a slide between two points of the integrator, which it has not seen
    return apart if apart < SEEN else min(apart, _apart(found, one.finer().expected))


def _apart(found: Any, expected: Any) -> float:
    try:
        wanted = expected()
    except AssertionError:  # the integrator has lost itself
        return float("inf")
    return max(abs(found[name].item() - value) / max(abs(value), 1e-9) for name, value in wanted.items())
