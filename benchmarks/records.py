"""Newmark's block on the ground motions that pySLAMMER ships: agreement, and the time of a million analyses.

Agreement: every motion at ky = 0.1 g, against pySLAMMER's RigidAnalysis on the motion as it is and
on the same straight lines sampled 4 and 16 times as finely, and against pyNewmarkDisp, as it is and
with Newmark's braking put into its rule.  Time: a
million (ky, motion, scale) analyses by slipsweep; the paper's law, and pySLAMMER, on a share of them.
Writes records.md.
"""

import argparse
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import arguments, measured_on, number, table
from slipsweep import Newmark, Record, Suite, sweep

KY = 0.1

#: Yield coefficients of the regression, and the displacement from which on it counts, m.
EVERY_KY, LEAST = (0.02, 0.05, 0.1, 0.2, 0.3), 1e-4

#: Refinements of the agreement table, and the longest record that is refined 16 times.
PARTS = (1, 4, 16)


def motions() -> dict[str, Any]:
    """pySLAMMER's sample ground motions by name."""
    from pyslammer import sample_ground_motions

    return dict(sorted(sample_ground_motions().items()))


def refined(values: np.ndarray, parts: int) -> np.ndarray:
    """The straight lines between samples, sampled `parts` times as finely."""
    return np.interp(np.arange((values.size - 1) * parts + 1) / parts, np.arange(values.size), values)


def pyslammer_displacement(motion: Any, parts: int, ky: float = KY) -> float:
    """RigidAnalysis on a refined motion, m."""
    from pyslammer import GroundMotion, RigidAnalysis

    return float(RigidAnalysis(ky, GroundMotion(refined(motion.accel, parts), motion.dt / parts)).max_sliding_disp)


def exact_displacement(motion: Any, g: float, ky: float = KY) -> float:
    """Newmark's block by slipsweep, m."""
    record = Record.sampled(motion.accel * g, motion.dt)
    return float(sweep(yield_coefficient=ky, model=Newmark(g), excitation=record).permanent_displacement)


def pynewmark_displacement(motion: Any, parts: int, g: float) -> float:
    """pyNewmarkDisp's direct_newmark on a refined motion, m: accelerations in g, of which it makes 9.81 m/s²."""
    from pynewmarkdisp.newmark import direct_newmark

    values = refined(motion.accel, parts)
    times = np.arange(values.size) * motion.dt / parts
    return float(direct_newmark(times, values, KY, 1.0)["perm_disp"]) * g / 9.81


def agreement(found: dict[str, Any], g: float) -> str:
    """A row a motion: the exact answer, and by how much the others differ."""
    rows = []
    for name, motion in found.items():
        exact = exact_displacement(motion, g)
        peers = [pyslammer_displacement(motion, parts) for parts in PARTS]
        peers += [pynewmark_displacement(motion, parts, g) for parts in (1, 16)]
        differences = [f"{peer / exact - 1:+.1e}" if exact else number(peer) for peer in peers]
        rows.append([name, f"{motion.dt:.4g}", motion.accel.size, f"{exact:.6f}", *differences])
    header = ["motion", "Δt, s", "samples", "slipsweep, m", *(f"pySLAMMER, Δt/{n}" for n in PARTS)]
    return table([*header, *(f"pyNewmarkDisp, Δt/{n}" for n in (1, 16))], rows)


def regression(found: dict[str, Any], g: float) -> str:
    """pySLAMMER over slipsweep on all motions and `EVERY_KY`: slope, R², share within 2 %, and the worst, refined."""
    runs = [(name, motion, ky) for name, motion in found.items() for ky in EVERY_KY]
    ours = np.array([exact_displacement(motion, g, ky) for _, motion, ky in runs])
    theirs = np.array([pyslammer_displacement(motion, 1, ky) for _, motion, ky in runs])
    slides = ours > LEAST
    slope = float((ours @ theirs) / (ours @ ours))
    r_squared = float(np.corrcoef(ours[slides], theirs[slides])[0, 1] ** 2)
    apart = np.where(slides, np.abs(theirs / np.where(slides, ours, 1.0) - 1.0), 0.0)
    rows = []
    for at in np.argsort(-apart)[:5]:
        name, motion, ky = runs[at]
        peers = [pyslammer_displacement(motion, parts, ky) / ours[at] - 1.0 for parts in PARTS]
        rows.append([name, ky, f"{ours[at]:.6f}", *(f"{peer:+.1e}" for peer in peers)])
    header = ["the five farthest apart", "ky, g", "slipsweep, m", *(f"pySLAMMER, Δt/{parts}" for parts in PARTS)]
    near = np.mean(apart[slides] <= 0.02)
    return (
        f"{slides.sum()} of {slides.size} pairs of motion and ky ({', '.join(map(str, EVERY_KY))}) slide more than "
        f"{1000 * LEAST:g} mm: slope {slope:.4f}, R² {r_squared:.6f}, {near:.0%} within 2 %.\n\n"
        f"{table(header, rows)}"
    )


def timing(found: dict[str, Any], g: float, analyses: int, share: int) -> str:
    """Processor time of `analyses` by slipsweep in one run, of a share of them by the paper's law and by pySLAMMER."""
    from pyslammer import RigidAnalysis

    suite = Suite(tuple(Record.sampled(motion.accel * g, motion.dt) for motion in found.values()), tuple(found))
    samples = float(np.mean([motion.accel.size for motion in found.values()]))

    def axes(wanted: int) -> tuple[np.ndarray, np.ndarray]:
        count = max(round((wanted / len(found)) ** 0.5), 1)
        return np.geomspace(0.02, 0.4, count), np.geomspace(0.3, 3.0, count)

    def ours(wanted: int, model: str) -> tuple[int, float]:
        onsets, scales = axes(wanted)
        newmark = {"yield_coefficient": onsets}
        mendez = {"theta": 0.0, "mu_s": 0.3, "yield_acceleration": onsets * g}
        start = time.process_time()
        result = sweep(**(newmark if model == "newmark" else mendez), excitation=suite, scale=scales, model=model)
        return result.permanent_displacement.size, time.process_time() - start

    def theirs() -> tuple[int, float]:
        onsets, scales = axes(analyses)
        rng, every = np.random.default_rng(1), list(found.values())
        start = time.process_time()
        for index in range(share):
            # every motion in turn, so that the share has the samples of the whole
            RigidAnalysis(rng.choice(onsets), every[index % len(every)], scale_factor=rng.choice(scales))
        return share, time.process_time() - start

    ours(1, "newmark"), ours(1, "mendez"), theirs()  # compiled, and loaded, before the clock starts
    runs = {
        "slipsweep, Newmark": ours(analyses, "newmark"),
        "slipsweep, the paper's law": ours(analyses // 10, "mendez"),
        "pySLAMMER's loop": min((theirs() for _ in range(3)), key=lambda run: run[1]),
    }
    each = {name: seconds / done for name, (done, seconds) in runs.items()}
    ky, law, peer = each.values()
    rows = []
    for name, (done, seconds) in runs.items():
        figures = [seconds, each[name], each[name] / samples, peer / each[name]]
        rows.append([name, done, *map(number, figures)])
    header = ["", "analyses", "seconds", "seconds an analysis", "seconds a sample", "times pySLAMMER's speed"]
    return table(header, rows) + f"\nThe paper's law takes {number(law / ky)} times as long as Newmark's block.\n"


def main(given: argparse.Namespace) -> Path:
    """Measure, and write the page."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own
        from pyslammer.constants import G_EARTH

        found = motions()
        if given.tiny:
            found = dict(list(found.items())[-2:-1])
        agree, fit = agreement(found, G_EARTH), regression(found, G_EARTH)
        times = timing(found, G_EARTH, 100 if given.tiny else 1_000_000, 2 if given.tiny else 4 * len(found))
    page = given.folder / "records.md"
    page.write_text(
        "# Newmark's block on recorded motions\n\n"
        f"{measured_on(('numpy', 'numba', 'pyslammer', 'pynewmarkdisp'))} "
        "Made by `python -m benchmarks.records`.\n\n"
        f"## Agreement, ky = {KY} g\n\n"
        "slipsweep is exact for the straight lines between samples. The others' columns are their relative\n"
        "difference from it. pySLAMMER sees onset and stop at samples only: refined, it converges to the exact\n"
        "answer. It does not run a block out that still slides as the record ends. pyNewmarkDisp has another rule:\n"
        "while Üg is below yield, its block loses the velocity |∫ Üg dt| instead of ∫ (Üy − Üg) dt, and is hardly\n"
        "braked near Üg = 0; no refinement removes that.\n\n"
        f"{agree}\n"
        "## pySLAMMER against slipsweep\n\n"
        "Of the motions as they are sampled; what differs most comes near as pySLAMMER's samples are refined.\n\n"
        f"{fit}\n"
        "## Time of (ky, motion, scale) analyses\n\n"
        "Processor time of all threads together: core for core. Motions, yield coefficients (0.02 to 0.4) and scales\n"
        "(0.3 to 3) span the grid, solved in one run; seconds a sample count those of the motion, slid\n"
        "over or not.\n\n"
        f"{times}"
    )
    return page


if __name__ == "__main__":
    print(main(arguments(__doc__)))
