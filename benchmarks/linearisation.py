"""Worth of the paper's linearised friction: ``python -m benchmarks.linearisation``.

Blocks whose friction truly depends on velocity or on slip are shaken by a sine.  From one test each
the paper's Üy, λ and Δμ are calibrated, and the displacement is predicted at other amplitudes and
frequencies; beside it Newmark's block with three constant frictions.  Writes linearisation.md and
linearisation.png.
"""

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.optimize import brentq

import slipsweep
from benchmarks.machine import arguments, cores, table
from slipsweep.studies.calibration.shaking_test import CHANNELS

#: Friction coefficient that the blocks have at rest where it falls, and at speed where it rises:
#: that of the paper's interface.
MU = 0.38

#: Published sizes of friction that depends on velocity, of sliding bearings: its change (0.093 and
#: 0.113; half of it), and a in s/m.  They rise; those that fall have the same size.
RATE_LAWS = {
    "Constantinou and others 1990": (0.0927, 23.6),
    "OpenSees, VelDependent": (0.113, 24.2),
    "Fenz and Constantinou 2008": (0.19, 100.0),
}

#: Residual friction over peak, 9° over 14°, and slips in m over which a liner weakens.
RESIDUAL_SHARE = math.tan(math.radians(9.0)) / math.tan(math.radians(14.0))
WEAKENING_DISTANCES = (0.02, 0.05, 0.1)

#: Tests: inclination, amplitude in m/s² and frequency in Hz, those of the paper's experiments.
TESTS = ((5.0, 3.55, 1.8), (6.0, 5.10, 3.5))
CYCLES = 5

#: Shaking at which displacements are predicted, over that of the test.
AMPLITUDES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0)
FREQUENCIES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)

#: Samples a second of a test, and noise of its channels over their peaks.
SAMPLES = 200
NOISE = 0.005

#: Displacements in m below which ratios mean nothing.
LEAST = 1e-3

PREDICTORS = (
    "the paper's law, λ and Δμ calibrated",
    "Newmark, static friction",
    "Newmark, mean kinetic friction",
    "Newmark, fitted constant friction",
)


@dataclass(frozen=True)
class Block:
    """A block whose friction changes, and a test of it."""

    kind: str
    name: str
    model: slipsweep.Newmark
    friction: dict[str, float]
    theta: float
    amplitude: float
    frequency: float

    def moved(self, amplitude: Any, frequency: Any) -> xr.DataArray:
        """Return its permanent displacements, m."""
        block: dict[str, Any] = {"theta": self.theta, **self.friction, "model": self.model}
        wave = slipsweep.Sine(cycles=CYCLES)
        result = slipsweep.sweep(**block, amplitude=amplitude, frequency=frequency, excitation=wave)
        moved: xr.DataArray = result.permanent_displacement.reset_coords(drop=True)
        return moved


def blocks() -> list[Block]:
    """Return all blocks, each with both tests."""
    rate = slipsweep.Newmark(strength="rate")
    weakening = slipsweep.Newmark(strength="weakening")
    kinds: list[tuple[str, str, slipsweep.Newmark, dict[str, float]]] = []
    for name, (change, constant) in RATE_LAWS.items():
        falls = {"mu_s": MU, "fast_mu": MU - change, "rate_constant": constant}
        rises = {"mu_s": MU - change, "fast_mu": MU, "rate_constant": constant}
        kinds.append(("falls with velocity", name, rate, falls))
        kinds.append(("rises with velocity", name, rate, rises))
    for distance in WEAKENING_DISTANCES:
        residual = {"residual_mu": MU * RESIDUAL_SHARE, "weakening_distance": distance}
        name = f"D {1e3 * distance:.0f} mm"
        kinds.append(("falls with slip", name, weakening, {"mu_s": MU, **residual}))
    return [Block(*kind, *test) for kind in sorted(kinds, key=lambda k: k[0]) for test in TESTS]


def test_of(block: Block, seed: int) -> tuple[xr.Dataset, float]:
    """Return what the sensors of a test give, and the mean friction while the block slides."""
    case: dict[str, Any] = {"theta": block.theta, **block.friction, "model": block.model}
    times = np.arange(0.0, CYCLES / block.frequency + 0.5, 1.0 / SAMPLES)
    history = slipsweep.simulate(
        **case,
        amplitude=block.amplitude,
        frequency=block.frequency,
        excitation=slipsweep.Sine(cycles=CYCLES),
        times=times,
    )
    generator = np.random.default_rng(seed)
    channels = {}
    for name in CHANNELS:
        values = history[name].values
        noise = generator.normal(0.0, NOISE * abs(values).max(), values.size)
        channels[name] = ("time", values + noise)
    slides = history.relative_velocity.values > 0.0
    g = block.model.g
    angle = np.arctan(history.block_acceleration.values / g) + math.radians(block.theta)
    return xr.Dataset(channels, {"time": times}), float(np.tan(angle)[slides].mean())


def fitted_friction(block: Block) -> float:
    """Return the constant friction with which Newmark's block moves as far as in the test."""
    wave = slipsweep.Sine(cycles=CYCLES)
    target = float(block.moved(block.amplitude, block.frequency))
    shaking: dict[str, Any] = {"amplitude": block.amplitude, "frequency": block.frequency}

    def excess(mu_s: float) -> float:
        result = slipsweep.sweep(block.theta, mu_s, **shaking, model="newmark", excitation=wave)
        return float(result.permanent_displacement) - target

    least = math.tan(math.radians(block.theta)) + 1e-4
    return float(brentq(excess, least, 2.0, xtol=1e-9))


def predicted(job: tuple[int, Block]) -> list[dict[str, Any]]:
    """Return predictions and the true displacement at all shakings but that of the test."""
    seed, block = job
    test, kinetic = test_of(block, seed)
    calibration = slipsweep.calibrate(test, block.theta, block.friction["mu_s"], cycles=False)
    names = ("yield_acceleration", "decay_rate", "delta_mu")
    law: dict[str, Any] = {name: float(calibration[name]) for name in names}
    amplitude = xr.DataArray(block.amplitude * np.array(AMPLITUDES), dims="a")
    frequency = xr.DataArray(block.frequency * np.array(FREQUENCIES), dims="f")
    wave = slipsweep.Sine(cycles=CYCLES)
    shaking: dict[str, Any] = {
        "theta": block.theta,
        "amplitude": amplitude,
        "frequency": frequency,
        "excitation": wave,
    }
    truth = block.moved(amplitude, frequency).transpose("a", "f").values
    mu_s = block.friction["mu_s"]
    constant = (mu_s, kinetic, fitted_friction(block))
    answers = [
        slipsweep.sweep(**shaking, mu_s=mu_s, **law),
        *(slipsweep.sweep(**shaking, mu_s=friction, model="newmark") for friction in constant),
    ]
    moved = [answer.permanent_displacement.transpose("a", "f").values for answer in answers]
    rows = []
    for a, times_a in enumerate(AMPLITUDES):
        for f, times_f in enumerate(FREQUENCIES):
            if times_a == times_f == 1.0:
                continue
            rows.append(
                {
                    "kind": block.kind,
                    "amplitude": times_a,
                    "frequency": times_f,
                    "truth": truth[a, f],
                    "predicted": [values[a, f] for values in moved],
                    "law": law,
                }
            )
    return rows


def ratios_of(rows: list[dict[str, Any]], which: int) -> np.ndarray:
    """Return predicted over true displacement where the block moves by a millimetre or more."""
    pairs = [(row["predicted"][which], row["truth"]) for row in rows if row["truth"] >= LEAST]
    values, truth = np.array(pairs).T
    return np.asarray(np.nan_to_num(values, nan=0.0) / truth)


def line_of(kind: str, rows: list[dict[str, Any]], which: int) -> list[object]:
    """Return a line of the table."""
    ratios = ratios_of(rows, which)
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    within = np.mean((ratios >= 0.5) & (ratios <= 2.0))
    parts = (f"{middle:.2f}", f"{low:.2f} to {high:.2f}", f"{within:.0%}")
    return [kind, PREDICTORS[which], ratios.size, *parts]


def draw(kinds: dict[str, list[dict[str, Any]]]) -> Figure:
    """Draw the ratios: a column a kind, a strip and its median and 5 to 95 % for each predictor."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
    generator = np.random.default_rng(0)
    for axis, (kind, rows) in zip(axes, kinds.items(), strict=True):
        axis.axvline(1.0, color="0.6", linewidth=0.8)
        for which in range(len(PREDICTORS)):
            ratios = np.clip(ratios_of(rows, which), 1e-2, 1e2)
            height = which + generator.uniform(-0.25, 0.25, ratios.size)
            axis.plot(ratios, height, ".", color="#0072B2", markersize=2, alpha=0.4)
            low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
            axis.plot([low, high], [which, which], color="black", linewidth=1.5)
            axis.plot(middle, which, "|", color="black", markersize=14, markeredgewidth=2.5)
        axis.set_xscale("log")
        axis.set_xlim(8e-3, 1.2e2)
        axis.set_title(f"friction {kind}", fontsize="medium")
    axes[0].set_yticks(range(len(PREDICTORS)), PREDICTORS)
    axes[0].invert_yaxis()
    figure.supxlabel("predicted over true permanent displacement; at the ends: beyond")
    return figure


def main() -> None:
    """Write the table and the chart."""
    options = arguments(__doc__)
    jobs = list(enumerate(blocks()))
    if options.tiny:
        jobs = jobs[1:2]
        parts = [predicted(job) for job in jobs]
    else:
        with ProcessPoolExecutor(cores(), get_context("spawn")) as pool:
            parts = list(pool.map(predicted, jobs))
    rows = [row for part in parts for row in part]
    kinds: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        kinds.setdefault(row["kind"], []).append(row)
    lines = [
        line_of(kind, rows_of_kind, which)
        for kind, rows_of_kind in kinds.items()
        for which in range(len(PREDICTORS))
    ]
    slides = [row for row in rows if row["truth"] >= LEAST]
    heading = ["friction", "predicted by", "shakings", "median", "5 to 95 %", "within a factor 2"]
    legend = (
        f"Predicted over true permanent displacement of {len(jobs)} blocks, {len(slides)} shakings "
        f"of {CYCLES} cycles of a sine in which the block moves by 1 mm or more; one of no value "
        "counts as 0. Written by `python -m benchmarks.linearisation`."
    )
    text = f"{table(heading, lines)}\n{legend}\n"
    (options.folder / "linearisation.md").write_text(text, encoding="utf-8")
    draw(kinds).savefig(options.folder / "linearisation.png", dpi=120)


if __name__ == "__main__":
    main()
