"""Calibration on synthetic tests: how often the 95 % intervals hold the true parameters.

The model itself is the truth: θ, μs, Üy, λ, Δμ, amplitude and frequency are drawn widely, in tests
where Eq. 4 acts, where the yield acceleration governs, and of continuous sliding; with white noise
of 1 % of each channel's peak, the table's among them, or a converter of 12 bits and no other noise.
Writes calibration.md.
"""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import xarray as xr

import slipsweep
from benchmarks.machine import arguments, cores, measured_on, table
from slipsweep.model.variables import Validity
from slipsweep.studies.calibration.shaking_test import CHANNELS
from tests.support.shaking import SOUGHT, measured

KINDS = {"eq4": "Eq. 4 acts", "yield": "yield governs", "continuous": "continuous"}

NOISES = ("white", "12 bits")

CYCLES = 6
RATE = 200

_NO_TEST = Validity.UPLIFT | Validity.LIMIT_UNDEFINED | Validity.STATICALLY_UNSTABLE


def drawn(kind: str, seed: int) -> tuple[dict[str, float], xr.Dataset]:
    """Parameters of one test of a kind, and what its channels would be without sensors."""
    generator = np.random.default_rng([list(KINDS).index(kind), seed])
    while True:
        theta = generator.uniform(0.0, 14.0)
        mu_s = generator.uniform(0.2, 0.6)
        amplitude = generator.uniform(1.5, 9.0)
        ratio = np.exp(generator.uniform(np.log(1.2), np.log(5.0)))
        case = {
            "theta": theta,
            "mu_s": mu_s,
            "amplitude": amplitude,
            "frequency": generator.uniform(1.0, 4.0),
            "yield_acceleration": amplitude / ratio,
            "decay_rate": generator.uniform(0.5, 6.0),
            "delta_mu": generator.uniform(0.0, 0.4) * mu_s,
        }
        shaking = slipsweep.Sine(cycles=CYCLES)
        if mu_s <= 1.2 * np.tan(np.radians(theta)):
            continue
        result = slipsweep.sweep(**case, excitation=shaking)
        flags = Validity(int(result.validity))
        mode = int(result.sliding_mode)
        governed_by = (
            "continuous" if mode == 2 else "yield" if flags & Validity.YIELD_GOVERNS else "eq4"
        )
        if (
            mode < 1
            or governed_by != kind
            or flags & _NO_TEST
            or abs(float(result.permanent_displacement)) < 1e-4
        ):
            continue
        # `simulate` does not stop a block that slides continuously as the shaking ends
        tail = 0.0 if kind == "continuous" else 0.6
        times = np.arange(0.0, CYCLES / case["frequency"] + tail, 1.0 / RATE)
        history = slipsweep.simulate(**case, excitation=shaking, times=times)
        rest = np.zeros(int(generator.choice([0, RATE // 2])))
        channels = {
            name: ("time", np.concatenate([rest, history[name].values])) for name in CHANNELS
        }
        return case, xr.Dataset(channels, {"time": np.arange(times.size + rest.size) / RATE})


def sensed(test: xr.Dataset, noise: str, seed: int) -> xr.Dataset:
    """A test as its sensors give it."""
    return (
        measured(test, seed, 0.01, bits=None)
        if noise == "white"
        else measured(test, seed, 0.0, bits=12)
    )


def outcome_of(task: tuple[str, str, int]) -> list[tuple[bool, bool]]:
    """For each parameter, two bools: the interval holds the true value; it is bounded."""
    kind, noise, seed = task
    case, test = drawn(kind, seed)
    calibration = slipsweep.calibrate(
        sensed(test, noise, seed), case["theta"], case["mu_s"], cycles=False
    )
    ends = [calibration[f"{name}_interval"].values for name in SOUGHT]
    return [
        (bool(low <= case[name] <= high), bool(np.isfinite(high) and low > 0.0))
        for name, (low, high) in zip(SOUGHT, ends, strict=True)
    ]


def report(results: dict[tuple[str, str], np.ndarray]) -> str:
    """The page, from (test, parameter, held or bounded) of each kind and noise."""
    rows: list[list[Any]] = []
    for (kind, noise), shares_of_test in results.items():
        held, bounded = shares_of_test.mean(axis=0).T
        shares = [
            f"{100 * held_share:.1f} % ({100 * bounded_share:.0f} %)"
            for held_share, bounded_share in zip(held, bounded, strict=True)
        ]
        rows.append([KINDS[kind], noise, len(shares_of_test), *shares])
    return (
        f"{measured_on(('numpy', 'scipy', 'numba'), timed=False)}\n\n"
        "Share of tests whose 95 % interval holds the true value; in brackets the share whose "
        "interval has both ends. *White*: noise of 1 % of each channel's peak, the table's among "
        "them. *12 bits*: a converter of 12 bits and no other noise. "
        f"{CYCLES} cycles, {RATE} samples a second, all four channels; θ 0 to 14°, μs 0.2 to 0.6, "
        "λ 0.5 to 6, Δμ up to 0.4 μs, A 1.5 to 9 m/s², A/Üy 1.2 to 5, 1 to 4 Hz. "
        f"By `python -m benchmarks.calibration --repetitions {rows[0][2]}`.\n\n"
        + table(["tests", "noise", "number", "Üy", "λ", "Δμ"], rows)
    )


def main() -> None:
    """Measure, write calibration.md."""
    options = arguments(__doc__, counts={"repetitions": 500})
    repetitions = 1 if options.tiny else options.repetitions
    kinds = [(kind, noise) for kind in KINDS for noise in NOISES][-1 if options.tiny else 0 :]
    tasks = [(kind, noise, seed) for seed in range(repetitions) for kind, noise in kinds]
    if options.tiny:
        calibrated = [outcome_of(task) for task in tasks]
    else:
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        outcome_of(tasks[0])  # compiled once, for all processes
        # a fork would take the threads' locks of this process along
        with ProcessPoolExecutor(cores(), multiprocessing.get_context("spawn")) as pool:
            calibrated = list(pool.map(outcome_of, tasks, chunksize=4))
    results = {
        kind: np.array(
            [result for task, result in zip(tasks, calibrated, strict=True) if task[:2] == kind]
        )
        for kind in kinds
    }
    (options.folder / "calibration.md").write_text(report(results), encoding="utf-8")


if __name__ == "__main__":
    main()
