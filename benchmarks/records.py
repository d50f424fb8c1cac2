"""Newmark's block on the ground motions that pySLAMMER ships: agreement with other programs.

Every motion at ky = 0.1 g, against pySLAMMER's RigidAnalysis on the motion as it is and
on the same straight lines sampled 4 and 16 times as finely, and against pyNewmarkDisp, as it is and
with Newmark's braking put into its rule.  Writes records.md.

``--slammer FILE`` compares with SLAMMER 1.1 itself: the table of its results that pySLAMMER is
verified against, tests/verification_data/reference/SLAMMER_results.xlsx in pySLAMMER's repository,
which its package does not have.
"""

import argparse
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import arguments, measured_on, number, table
from slipsweep import Newmark, Record, sweep

KY = 0.1

#: Yield coefficients of the comparison with pySLAMMER.
EVERY_KY = (0.02, 0.05, 0.1, 0.2, 0.3)

#: pySLAMMER's tolerance for SLAMMER's results: a part of those above `SMALL`, m below.
SMALL = 0.005
PART = 0.02
METRES = 0.0005

#: An analysis: motion, ky, factor on the motion, and another program's displacement, m.
Run = tuple[str, float, float, float]

#: Refinements of the agreement table, and the longest record that is refined 16 times.
PARTS = (1, 4, 16)


def motions() -> dict[str, Any]:
    """pySLAMMER's sample ground motions by name."""
    from pyslammer import sample_ground_motions

    return dict(sorted(sample_ground_motions().items()))


def refined(values: np.ndarray, parts: int) -> np.ndarray:
    """The straight lines between samples, sampled `parts` times as finely."""
    places = np.arange((values.size - 1) * parts + 1) / parts
    samples: np.ndarray = np.interp(places, np.arange(values.size), values)
    return samples


def pyslammer_displacement(motion: Any, parts: int, ky: float = KY, factor: float = 1.0) -> float:
    """RigidAnalysis on a refined motion, m."""
    from pyslammer import GroundMotion, RigidAnalysis

    scaled = GroundMotion(factor * refined(motion.accel, parts), motion.dt / parts)
    return float(RigidAnalysis(ky, scaled).max_sliding_disp)


def exact_displacement(motion: Any, g: float, ky: float = KY, factor: float = 1.0) -> float:
    """Newmark's block by slipsweep, m."""
    record = Record.sampled(factor * motion.accel * g, motion.dt)
    return float(
        sweep(yield_coefficient=ky, model=Newmark(g=g), excitation=record).permanent_displacement
    )


def pynewmark_displacement(motion: Any, parts: int, g: float) -> float:
    """direct_newmark of pyNewmarkDisp on a refined motion, m; it takes g for 9.81 m/s²."""
    from pynewmarkdisp.newmark import direct_newmark

    values = refined(motion.accel, parts)
    times = np.arange(values.size) * motion.dt / parts
    return float(direct_newmark(times, values, KY, 1.0)["perm_disp"]) * g / 9.81


def agreement(motions_by_name: dict[str, Any], g: float) -> str:
    """A row a motion: the exact answer, and by how much the others differ."""
    rows = []
    for name, motion in motions_by_name.items():
        exact = exact_displacement(motion, g)
        peers = [pyslammer_displacement(motion, parts) for parts in PARTS]
        peers += [pynewmark_displacement(motion, parts, g) for parts in (1, 16)]
        differences = [f"{peer / exact - 1:+.1e}" if exact else number(peer) for peer in peers]
        rows.append([name, f"{motion.dt:.4g}", motion.accel.size, f"{exact:.6f}", *differences])
    header = ["motion", "Δt, s", "samples", "slipsweep, m", *(f"pySLAMMER, Δt/{n}" for n in PARTS)]
    return table([*header, *(f"pyNewmarkDisp, Δt/{n}" for n in (1, 16))], rows)


def slammer_runs(path: Path, motions_by_name: dict[str, Any]) -> list[Run]:
    """SLAMMER's rigid blocks, both ways, from the table of its results."""
    import pandas as pd

    runs = []
    for row in (
        pd.read_excel(path).drop_duplicates(["Earthquake", "Record", "ky (g)"]).to_dict("records")
    ):
        name = f"{row['Earthquake'].replace('.', '').replace(' ', '_')}_{row['Record']}"
        if name not in motions_by_name:  # --tiny
            continue
        factor = row["Scale"] / np.abs(motions_by_name[name].accel).max()  # to a peak of `Scale` g
        for sign, column in ((1.0, "Rigid Normal (cm)"), (-1.0, "Rigid Inverse (cm)")):
            runs.append((name, float(row["ky (g)"]), sign * factor, 0.01 * row[column]))
    return runs


def comparison(motions_by_name: dict[str, Any], runs: list[Run], g: float) -> str:
    """Another program's displacements over slipsweep's: slope, R², share within the tolerance.

    The worst are refined.
    """
    ours = np.array(
        [exact_displacement(motions_by_name[name], g, ky, factor) for name, ky, factor, _ in runs]
    )
    theirs = np.array([run[-1] for run in runs])
    apart = np.abs(theirs - ours)
    within = np.mean(apart <= np.where(theirs > SMALL, PART * theirs, METRES))
    rows = []
    for at in np.argsort(-apart / np.maximum(theirs, SMALL))[:5]:
        name, ky, factor, other = runs[at]
        refined_runs = (
            pyslammer_displacement(motions_by_name[name], parts, ky, factor) for parts in PARTS
        )
        rows.append(
            [
                name,
                ky,
                f"{factor:+.3g}",
                *(f"{1000 * u:.3f}" for u in (other, ours[at], *refined_runs)),
            ]
        )
    refinements = (f"pySLAMMER, Δt/{parts}" for parts in PARTS)
    header = [
        "the five farthest apart, mm",
        "ky, g",
        "factor",
        "the other",
        "slipsweep",
        *refinements,
    ]
    return (
        f"{len(runs)} analyses: slope {(ours @ theirs) / (ours @ ours):.4f}, "
        f"R² {np.corrcoef(ours, theirs)[0, 1] ** 2:.6f}, {within:.0%} within pySLAMMER's tolerance "
        f"({PART:.0%}; {1000 * METRES:g} mm below {1000 * SMALL:g} mm).\n\n{table(header, rows)}"
    )


def main(options: argparse.Namespace) -> Path:
    """Measure, and write the page."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own
        from pyslammer.constants import G_EARTH

        motions_by_name = motions()
        if options.tiny:
            motions_by_name = dict(list(motions_by_name.items())[-2:-1])
        agree = agreement(motions_by_name, G_EARTH)
        pairs = [(name, ky) for name in motions_by_name for ky in EVERY_KY]
        fits = {
            "pySLAMMER": [
                (name, ky, 1.0, pyslammer_displacement(motions_by_name[name], 1, ky))
                for name, ky in pairs
            ]
        }
        if options.slammer:
            fits["SLAMMER"] = slammer_runs(options.slammer, motions_by_name)
        compared = "".join(
            f"**{name}.** {comparison(motions_by_name, runs, G_EARTH)}\n"
            for name, runs in fits.items()
        )
    page = options.folder / "records.md"
    page.write_text(
        "# Newmark's block on recorded motions\n\n"
        f"{measured_on(('numpy', 'numba', 'pyslammer', 'pynewmarkdisp'))} "
        "Made by `python -m benchmarks.records --slammer SLAMMER_results.xlsx`.\n\n"
        f"## Agreement, ky = {KY} g\n\n"
        "slipsweep is exact for the straight lines between samples. The others' columns are their\n"
        "relative difference from it. pySLAMMER sees onset and stop at samples only: refined, it\n"
        "converges to the exact answer. It does not run a block out that still slides as the\n"
        "record ends. pyNewmarkDisp has another rule: while Üg is below yield, its block loses\n"
        "the velocity |∫ Üg dt| instead of ∫ (Üy − Üg) dt, and is hardly braked near Üg = 0; no\n"
        "refinement removes that.\n\n"
        f"{agree}\n"
        "## SLAMMER and pySLAMMER against slipsweep\n\n"
        "Both take the motions as they are sampled; where they differ most, pySLAMMER comes near\n"
        "as samples are refined. SLAMMER 1.1: its own results, which pySLAMMER is verified\n"
        "against; the motions scaled, and both ways.\n\n"
        f"{compared}"
    )
    return Path(page)


if __name__ == "__main__":
    print(main(arguments(__doc__, files=("slammer",))))
